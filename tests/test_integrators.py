"""Steps: order on a smooth scene, stops and samples of every method, closed forms, failure.

Errors against tolerances, of every method, are in ``test_implicit.py``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from smooth import T_END, observed_order, smooth_scene, swing
from test_implicit import held, numbers

import beltdyn as bd

SOLVERS = Path(__file__).parent.parent / "csrc" / "solvers"
EXPLICIT = [path for path in sorted(SOLVERS.glob("*.c")) if "BD_EXPLICIT(" in path.read_text()]

Tree = tuple[Any, ...]
"""A rooted tree, as those hanging from its root."""


def trees(order: int) -> set[Tree]:
    """All rooted trees of so many nodes: each that is smaller by one, a leaf put on any node."""

    def grown(tree: Tree) -> Iterator[Tree]:
        yield (*tree, ())
        for k, branch in enumerate(tree):
            for more in grown(branch):
                yield (*tree[:k], more, *tree[k + 1 :])

    def sorted_tree(tree: Tree) -> Tree:
        return tuple(sorted(sorted_tree(branch) for branch in tree))

    if order == 1:
        return {()}
    return {sorted_tree(more) for tree in trees(order - 1) for more in grown(tree)}


def size_and_density(tree: Tree) -> tuple[int, int]:
    parts = [size_and_density(branch) for branch in tree]
    size = 1 + sum(part[0] for part in parts)
    return size, size * math.prod(part[1] for part in parts)


def weight_of_stages(tree: Tree, a: np.ndarray) -> np.ndarray:
    products = [a @ weight_of_stages(branch, a) for branch in tree]
    return np.prod([np.ones(len(a)), *products], axis=0)


@pytest.mark.parametrize("path", EXPLICIT, ids=lambda path: path.stem)
def test_explicit_methods_meet_their_order_conditions(path: Path) -> None:
    """Butcher's, b phi(tree) = 1 / gamma(tree): of the order that the file states, and of one less
    than its errors' for the formula that it is compared with.

    Coefficients are printed to 16 digits and of size 13 at most; the products are of two of them.
    """
    text = path.read_text()

    def numbers(name: str) -> np.ndarray:
        found = re.search(rf"double {name}\[\] = \{{(.*?)\}}", text, re.DOTALL)
        assert found, name
        quotients = [number.split("/") for number in found[1].split(",") if number.strip()]
        return np.array([float(top) / float(*below or [1]) for top, *below in quotients])

    def number(name: str) -> int:
        found = re.search(rf"\.{name} = (\d+)", text)
        assert found, name
        return int(found[1])

    assert [len(trees(n)) for n in range(1, 6)] == [1, 1, 2, 4, 9]
    c, error, stages = numbers("c"), numbers("error"), number("stages")
    a = np.zeros((stages, stages))
    a[np.tril_indices(stages, -1)] = numbers("a")
    assert len(c) == len(error) == number("vectors") == stages
    np.testing.assert_allclose(a.sum(axis=1), c, rtol=0, atol=1e-13)
    assert c[-1] == 1.0
    b = a[-1]
    for weights, order in ((b, number("order")), (b - error, number("error_order") - 1)):
        for tree in {tree for n in range(1, order + 1) for tree in trees(n)}:
            exact = 1 / size_and_density(tree)[1]
            assert weights @ weight_of_stages(tree, a) == pytest.approx(exact, abs=1e-13), tree
    assert max(abs(error)) > 1e-3


def test_steps_and_dense_output_keep_the_order() -> None:
    """Classical Runge-Kutta: 4. Tsit5 with its step held by max_step: 5. Samples inside long steps
    have errors of order 4 (rk4's Hermite cubic) and 4 to 5 (Tsit5's interpolant), against a run of
    steps so short that interpolation plays no part.
    """
    params, start = smooth_scene()
    bound = params.info["spectral_bound"]
    times = np.append(np.sort(np.random.default_rng(2).uniform(0, T_END, 200)), T_END)
    given = {"initial": start, "t_eval": times}
    exact = bd.simulate(params, swing, T_END, method="rk4", step=0.02 / bound, **given)
    # friction and contact never kink in this window
    assert np.array_equal(exact.contact.pulley[0], exact.contact.pulley[-1])
    for method, order, counts in (
        ("rk4", 4.0, (60, 80, 110, 150)),
        ("tsit5", 5.0, (40, 50, 60, 75)),
    ):
        steps, ends, inside = [T_END / n for n in counts], [], []
        assert steps[0] * bound < 3.2
        for h in steps:
            run = bd.simulate(params, swing, T_END, **held(method, h), **given)
            end = numbers(run.final_state) - numbers(exact.final_state)
            ends.append(float(np.max(np.abs(end))))
            inside.append(float(np.max(np.abs(run.belt.x - exact.belt.x))))
        # steps near the stability limit are not quite asymptotic; from above is no fault
        assert order - 0.35 <= observed_order(steps, ends) <= order + 1.0, method
        assert observed_order(steps, inside) >= 3.6, method


def test_methods_agree() -> None:
    scene = bd.scenes.unequal_pulleys()
    start = bd.simulate(*scene[:2], 0.06, t_eval=[0.06]).final_state
    kwargs = {"initial": start, "t_eval": np.linspace(0.06, 0.07, 11)}
    tsit5 = bd.simulate(*scene[:2], 0.07, method="tsit5", rtol=1e-7, **kwargs)
    rk4 = bd.simulate(*scene[:2], 0.07, method="rk4", step=1e-6, **kwargs)
    rodas4 = bd.simulate(*scene[:2], 0.07, method="rodas4", rtol=1e-7, **kwargs)
    tension = np.mean(tsit5.joints.force)
    # rk4 at 1/7 of its limit straddles kinks with order 1: 1e-6 s of a step's share in them
    for other in (rk4, rodas4):
        assert np.max(np.abs(tsit5.joints.force - other.joints.force)) <= 1e-5 * tension
    assert rk4.stats.rejected == 0
    assert rk4.stats.nfev == pytest.approx(4 * rk4.stats.steps, rel=1e-3)
    assert tsit5.stats.nfev == pytest.approx(
        6 * (tsit5.stats.steps + tsit5.stats.rejected), rel=0.02
    )


@pytest.mark.parametrize("method", ["tsit5", "lbdf2", "lie", "rodas4"])
def test_steps_end_on_breakpoints_and_never_on_samples(method: str) -> None:
    params, at = drives.plain(), 1.2345e-3
    start, seen = bd.settle(params), []

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        seen.append(t)
        return [-5.0 if t >= at else 0.0, 0.0]

    given = {"initial": start, "breakpoints": [at], "method": method}
    many, few = (
        bd.simulate(params, torque, 3e-3, t_eval=np.linspace(0, 3e-3, n)[1:], **given)
        for n in (1001, 2)
    )
    # on the very time, seen from either side
    assert {np.nextafter(at, 0), np.nextafter(at, 1)} <= set(seen)
    assert method == "rodas4" or 3e-3 in seen
    assert many.stats.steps == few.stats.steps
    assert np.array_equal(many.final_state.x, few.final_state.x)


@pytest.mark.parametrize("method", ["tsit5", "lbdf2", "lie", "rodas4"])
def test_a_named_jump_of_a_function_has_two_sides(method: str) -> None:
    """However the function itself decides at the jump: the same to the last bit, and that of the
    object that knows it, but for the differences that stand for slopes in implicit methods. A
    sample at the jump is before it.
    """
    params, at = drives.plain(), 2.0001e-3
    times = np.sort(np.append(np.linspace(0, 3e-3, 31), [at, np.nextafter(at, 1)]))
    step = {"step": 1e-4} if method in ("lbdf2", "lie") else {"rtol": 1e-2}
    given = {"initial": bd.settle(params), "t_eval": times, "method": method, **step}

    def decided(included: bool) -> bd.Result:
        def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
            return [-100.0 * (t >= at if included else t > at), 0.0]

        return bd.simulate(params, torque, 3e-3, breakpoints=[at], **given)

    jump = bd.PiecewiseLinear([at, at], [[0, 0], [-100, 0]])
    known, one, other = bd.simulate(params, jump, 3e-3, **given), decided(True), decided(False)
    assert known.pulleys.torque[:, 0].tolist() == [-100.0 * (t > at) for t in times]
    assert np.all(np.abs(known.pulleys.omega[times <= at, 0]) <= 1e-7)
    assert np.array_equal(one.pulleys.omega, other.pulleys.omega)
    assert known.stats.steps == one.stats.steps == other.stats.steps
    assert known.stats.rejected == 0 or method == "rodas4"
    apart = np.max(np.abs(known.pulleys.omega - one.pulleys.omega))
    assert apart <= (0.0 if method == "tsit5" else 1e-7) * np.max(np.abs(known.pulleys.omega))


def test_free_pulleys_follow_closed_forms() -> None:
    """Friction off: under a ramp omega = slope t^2 / 2 I, theta = slope t^3 / 6 I; spinning down
    against a viscous load, exp(-c t / I).
    """
    params = attrs.evolve(drives.plain(), friction=None)
    ramp = bd.PiecewiseLinear([0.0, 1.0], [[0, 0], [-3.0, 0.0]])
    with pytest.warns(bd.BeltdynWarning, match="^no_friction: pulley 0 is driven"):
        result = bd.simulate(params, ramp, 0.05, t_eval=np.linspace(0, 0.05, 51), method="tsit5")
    t, omega, theta = result.t, result.pulleys.omega, result.pulleys.theta
    # polynomials of degree 3: exact for both the method and its dense output, but for rounding
    assert omega[:, 0] == pytest.approx(-3.0 * t**2 / 2 / 0.01, rel=1e-11, abs=1e-15)
    assert theta[:, 0] == pytest.approx(-3.0 * t**3 / 6 / 0.01, rel=1e-11, abs=1e-15)
    assert not theta[:, 1].any()
    start = attrs.evolve(bd.settle(params), omega=np.array([3.0, -2.0]))
    result = bd.simulate(params, bd.Viscous([0.1, 0.3]), 0.1, initial=start, method="tsit5")
    exact = np.array([3.0, -2.0]) * np.exp(-result.t[:, None] * np.array([0.1, 0.3]) / 0.01)
    assert np.max(np.abs(result.pulleys.omega - exact)) <= 1e-10


def test_links_in_contact_are_found_without_testing_the_rest() -> None:
    """The list of links near a pulley is rebuilt once per some millimetres of travel, and hides
    nothing: contact forces are those of all pairs (compared with the oracle in test_oracle).
    """
    scene = drives.plain_scene()
    result = bd.simulate(*scene[:2], 0.5)
    travelled = abs(result.pulleys.theta[-1]).max() * 0.1
    spacing = scene.params.info["link_length"]
    assert 2 <= result.stats.searches <= 2 + 8 * travelled / spacing
    assert result.stats.searches < 1e-2 * result.stats.steps


def test_step_floor_is_a_named_error() -> None:
    """A torque that flickers faster than any step can follow; the later, the sooner rounding of t
    ends it.
    """
    params = drives.plain()
    start, flips = attrs.evolve(bd.settle(params), t=1e3), [0]

    def flicker(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        flips[0] += 1
        return [1e13 * (-1) ** flips[0], 0.0]

    with pytest.raises(bd.SimulationError, match=r"lower limit.*breakpoints") as caught:
        bd.simulate(params, flicker, 1e3 + 1e-3, initial=start)
    error = caught.value
    assert (error.symbol, error.pulley, error.field) == ("BD_ERR_STEP_FLOOR", 0, "omega")
    assert error.result is not None and not error.result.success
