"""The implicit methods: coefficients, orders, dense output, the ledger; errors of every method."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from smooth import T_END, observed_order, smooth_scene, swing

import beltdyn as bd

Array = np.ndarray
SOURCE = Path(__file__).parent.parent / "csrc" / "solvers" / "rodas4.c"


def table(name: str) -> Array:
    """Numbers of an array of rodas4.c."""
    found = re.search(rf"\b{name}\[\] = \{{(.*?)\}}", SOURCE.read_text(), re.DOTALL)
    assert found is not None, name
    return np.array([float(number) for number in found[1].split(",") if number.strip()])


def lower(entries: Array, stages: int) -> Array:
    matrix = np.zeros((stages, stages))
    matrix[np.tril_indices(stages, -1)] = entries
    return matrix


class Rodas4:
    """Coefficients as Hairer and Wanner write them (IV.7): alpha, Gamma, b, from those stored.

    Stored are A = alpha Gamma^-1, C = 1 / gamma - Gamma^-1, m = b Gamma^-1; the last two rows of A
    are one, the last one with a 1 behind, and m is that with another 1.
    """

    def __init__(self) -> None:
        stages, gamma = 6, 0.25
        a = table("a")
        assert len(a) == 15
        self.a = lower(a, stages)
        self.gamma = np.linalg.inv(np.eye(stages) / gamma - lower(table("c"), stages))
        self.alpha = self.a @ self.gamma
        self.beta = self.alpha + self.gamma
        self.times, self.slopes = table("time"), table("slope")
        self.m = np.append(self.a[-1, :-1], 1.0)
        self.b = self.m @ self.gamma
        self.b_embedded = self.alpha[-1]

    def dense(self, s: float) -> Array:
        d2, d3 = table("d2"), table("d3")
        return s * (self.m + (1 - s) * (d2 + s * d3)) @ self.gamma

    def conditions(self, b: Array, s: float = 1.0) -> dict[str, tuple[float, float]]:
        """Of orders 1 to 4 for weights b at the fraction s of the step: what is, what should be."""
        row, beta = self.alpha.sum(axis=1), self.beta @ np.ones(6)
        return {
            "1": (b.sum(), s),
            "2": (b @ beta, s**2 / 2),
            "3a": (b @ row**2, s**3 / 3),
            "3b": (b @ self.beta @ beta, s**3 / 6),
            "4a": (b @ row**3, s**4 / 4),
            "4b": (b @ (row * (self.alpha @ beta)), s**4 / 8),
            "4c": (b @ self.beta @ row**2, s**4 / 12),
            "4d": (b @ self.beta @ self.beta @ beta, s**4 / 24),
        }


#: Printed to 16 digits, up to 34 in size, and inverted.
DIGITS = 1e-12


def test_rodas4_meets_its_order_conditions() -> None:
    """Order 4, and 3 of the solution it is compared with; between steps 3. It is stiffly accurate,
    the last row of beta is b, so R(infinity) = 0, and A-stable; times and slopes are row sums.
    """
    method = Rodas4()
    for name, (got, wanted) in method.conditions(method.b).items():
        assert got == pytest.approx(wanted, abs=DIGITS), name
    embedded = method.conditions(method.b_embedded)
    for name in ("1", "2", "3a", "3b"):
        assert embedded[name][0] == pytest.approx(embedded[name][1], abs=DIGITS), name
    assert max(abs(got - wanted) for got, wanted in embedded.values()) > 1e-3  # or no estimate
    for s in (0.2, 0.5, 0.9, 1.0):
        inside = method.conditions(method.dense(s), s)
        for name in ("1", "2", "3a", "3b"):
            assert inside[name][0] == pytest.approx(inside[name][1], abs=DIGITS), (s, name)
    assert method.beta[-1] == pytest.approx(method.b, abs=DIGITS)
    assert method.times == pytest.approx(method.alpha.sum(axis=1), abs=DIGITS)
    assert method.slopes == pytest.approx(method.gamma.sum(axis=1), abs=DIGITS)
    at_infinity = 1.0 - method.b @ np.linalg.solve(method.beta, np.ones(6))
    assert at_infinity == pytest.approx(0.0, abs=1e-10)
    for z in 1j * np.logspace(-2, 4, 200):
        growth = 1.0 + z * method.b @ np.linalg.solve(np.eye(6) - z * method.beta, np.ones(6))
        assert abs(growth) <= 1.0 + 1e-6


def coupled(t: float, theta: Array, omega: Array) -> list[float]:
    """Of everything that it may depend on, each pulley on the other, too."""
    twist = theta[1] - theta[0]
    return [
        -2.0 * math.sin(200.0 * t) + 500.0 * twist - 0.5 * omega[0] + 5.0 * omega[1],
        -500.0 * twist - 2.0 * omega[1],
    ]


STOP = 0.4 * T_END  # s; steps are T_END / a multiple of 5
TORQUES: dict[str, Any] = {
    "function of time": swing,
    "function of all": coupled,
    "kink": bd.PiecewiseLinear([0.0, STOP, T_END], [[0, 0], [-3.0, 0], [-1.0, 0]])
    + bd.Viscous([2.0, 3.0]),
    "jump": bd.PiecewiseLinear([0.0, STOP, STOP, T_END], [[0, 0], [-1.0, 0], [-3.0, 0], [-1.0, 0]])
    + bd.Viscous([2.0, 3.0]),
}
METHODS = {  # name: order, steps
    "lbdf2": (2, (100, 150, 200, 300)),
    "lie": (1, (100, 150, 200, 300)),
    "rodas4": (4, (30, 40, 60, 80)),
}
SAMPLES = np.linspace(0.0, T_END, 38)  # no step ends there but the first and the last


def held(method: str, h: float) -> dict[str, Any]:
    """Options that make steps of that length."""
    fixed = method in ("lbdf2", "lie", "rk4")
    return {"method": method, "step": h} | ({} if fixed else {"max_step": h, "rtol": 1.0})


def numbers(state: bd.State) -> Array:
    """All of a state, to about the same scale."""
    rates = (state.vx / 100, state.vy / 100, state.vphi / 1e4, state.omega / 100)
    return np.concatenate(
        [state.x, state.y, state.phi / 100, state.theta, state.mu, state.slip, *rates]
    )


@pytest.fixture(scope="module")
def smooth() -> tuple[bd.Params, bd.State]:
    return smooth_scene()


def go(smooth: tuple[bd.Params, bd.State], torque: Any, **options: Any) -> bd.Result:
    params, start = smooth
    return bd.simulate(params, torque, T_END, initial=start, t_eval=SAMPLES, **options)


def share(result: bd.Result) -> float:
    """What the ledger leaves over, of the work put in."""
    energy = result.energy
    assert energy is not None
    return float(np.max(np.abs(energy.residual)) / np.max(np.abs(energy.drive)))


@pytest.mark.parametrize("torque", TORQUES.values(), ids=list(TORQUES))
def test_orders(smooth: tuple[bd.Params, bd.State], torque: Any) -> None:
    """At the end, in between, and of the ledger, against the explicit pair at rounding.

    Not only for a torque that changes with time and with every angle and speed: across a kink and
    a jump, at which steps end and begin, as well. Ratios of errors are not quite asymptotic; an
    order too high, where a leading error happens to be small, is no fault.
    """
    bound = smooth[0].info["spectral_bound"]
    exact = go(smooth, torque, method="tsit5", rtol=1e-12, max_step=0.1 / bound)
    for method, (order, counts) in METHODS.items():
        steps, errors = [T_END / n for n in counts], {"end": [], "inside": [], "ledger": []}
        for h in steps:
            result = go(smooth, torque, **held(method, h))
            end = numbers(result.final_state) - numbers(exact.final_state)
            inside = np.abs(result.belt.x - exact.belt.x).max()
            errors["end"].append(np.max(np.abs(end)))
            errors["inside"].append(max(inside, np.abs(result.contact.mu - exact.contact.mu).max()))
            errors["ledger"].append(share(result))
            assert result.stats.steps == round(T_END / h)
            assert result.stats.rejected == 0
        for what, found in errors.items():
            seen = observed_order(steps, found)
            assert order - 0.3 <= seen <= order + 0.6, (method, what, found)


def test_samples_inside_long_steps(smooth: tuple[bd.Params, bd.State]) -> None:
    """The interpolants by themselves, in the last of some steps of length h: errors, less the
    straight line between those at the step's ends. A parabola: h^3, a line: h^2, rodas4's: h^4.
    """
    params, start = smooth
    at, lengths = 1.6e-3, [4e-5, 5e-5, 8e-5]
    for method, order in (("lbdf2", 3), ("lie", 2), ("rodas4", 4)):
        errors = []
        for h in lengths:
            part = np.array([0.0, 0.3, 0.5, 0.8, 1.0])
            kwargs = {"initial": start, "t_eval": at + h * part}
            coarse = bd.simulate(params, swing, at + h, **held(method, h), **kwargs)
            exact = bd.simulate(params, swing, at + h, method="rk4", step=h / 100, **kwargs)
            assert coarse.stats.steps == round(at / h) + 1
            error = coarse.belt.vx - exact.belt.vx
            line = (1 - part)[:, None] * error[0] + part[:, None] * error[-1]
            errors.append(float(np.abs(error - line).max()))
        assert order - 0.3 <= observed_order(lengths, errors) <= order + 1.0, (method, errors)


@pytest.mark.parametrize("method", METHODS)
def test_samples_at_the_end_are_the_state(smooth: tuple[bd.Params, bd.State], method: str) -> None:
    """The interpolant's ends: a sample on the last step's end, and one as near as there is."""
    params, start = smooth
    times = [0.0, np.nextafter(T_END, 0.0), T_END]
    run = bd.simulate(params, swing, T_END, initial=start, t_eval=times, **held(method, 5e-5))
    for name in ("x", "y", "phi", "vx", "vy", "vphi"):
        values, end = getattr(run.belt, name), getattr(run.final_state, name)
        assert np.array_equal(values[0], getattr(start, name)), name
        assert np.array_equal(values[-1], end), name
        assert np.max(np.abs(values[1] - end)) <= 1e-12 * np.max(np.abs(end)), name
    assert np.array_equal(run.pulleys.theta[-1], run.final_state.theta)
    assert np.array_equal(run.contact.mu[-1], run.final_state.mu)


def test_variable_steps_keep_order_2(smooth: tuple[bd.Params, bd.State]) -> None:
    """Steps chosen by the tolerance: the error falls as their number to the power -2.

    Local errors of h^3 are held at rtol^2 (methods.c), so h ~ rtol^(2/3) and errors ~ rtol^(4/3).
    """
    bound = smooth[0].info["spectral_bound"]
    exact = numbers(go(smooth, swing, method="rk4", step=0.02 / bound).final_state)
    ladder = [1e-3, 3e-4, 1e-4, 3e-5]
    runs = [go(smooth, swing, method="lbdf2", rtol=rtol) for rtol in ladder]
    errors = [float(np.max(np.abs(numbers(run.final_state) - exact))) for run in runs]
    steps = [T_END / run.stats.steps for run in runs]
    assert 1.7 <= observed_order(steps, errors) <= 2.3
    assert 1.1 <= observed_order(ladder, errors) <= 1.6
    for run in runs:
        assert run.stats.largest_step > 3.0 * run.stats.smallest_step


@pytest.mark.one_in(3)
@pytest.mark.parametrize("method", ["lbdf2", "lie", "rodas4", "auto"])
@pytest.mark.filterwarnings("ignore:balance")  # Euler's method damps 2 % away, and says so
def test_error_follows_the_tolerance(method: str) -> None:
    """Through contact and friction kinks: rtol is the error asked for, whatever the method."""
    scene = bd.scenes.three_pulleys()
    start = bd.simulate(*scene[:2], 0.2, t_eval=[0.2]).final_state
    times = 0.2 + np.sort(np.random.default_rng(4).uniform(0, 0.01, 50))
    kwargs = {"initial": start, "t_eval": times}
    exact = bd.simulate(*scene[:2], 0.21, rtol=1e-9, **kwargs).joints.force
    tension, errors = np.mean(exact), []
    # errors of rodas4 are far below 1e-2 there
    last = {"rodas4": -5, "auto": -6}.get(method, -4)
    ladder = [10.0**k for k in range(-2, last - 1, -1)]
    for rtol in ladder:
        force = bd.simulate(*scene[:2], 0.21, method=method, rtol=rtol, **kwargs).joints.force
        errors.append(float(np.sqrt(np.mean((force - exact) ** 2)) / tension))
    assert all(error <= rtol for error, rtol in zip(errors, ladder, strict=True)), errors
    assert errors[-1] < 0.1 * errors[0]
