"""Runs of the implicit methods: exact steps on linear problems, stops, limits of friction, what
they count, and that nothing depends on kernels, place, numbering, chunks or turns.
"""

from __future__ import annotations

from typing import Any

import attrs
import drives
import numpy as np
import pytest
from test_implicit import Rodas4, held
from test_invariance import T_END as SHORT
from test_invariance import assert_same, moved, renumbered

import beltdyn as bd
from beltdyn import _core

Array = np.ndarray
IMPLICIT = ("lbdf2", "lie", "rodas4")

# -------------------------------------------------------------------- a pulley by itself


def free_pulley(drag: float, omega: float) -> tuple[bd.Params, bd.State, float]:
    """Nothing but inertia and a linear drag on pulley 0: omega' = -rate omega."""
    params = attrs.evolve(drives.plain(), friction=None)
    start = attrs.evolve(bd.settle(params), omega=np.array([omega, 0.0]))
    return params, start, drag / params.pulleys[0].inertia


@pytest.mark.filterwarnings("ignore:no_friction:UserWarning")
@pytest.mark.parametrize("drag", [0.5, 1e3])
@pytest.mark.parametrize("method", ["lbdf2", "lie"])
def test_steps_are_the_formula(method: str, drag: float) -> None:
    """h lambda = 0.05 and 100: steps of order 1, then (for lbdf2) 4/3 y - 1/3 y_before over
    1 + 2/3 h lambda; a jump of the torque begins anew. Every start damps: L-stable.
    """
    params, start, rate = free_pulley(drag, 2e-2)
    h, at, n = 1e-3, 8, 16
    jump = bd.PiecewiseLinear([at * h, at * h], [[0, 0], [-0.1, 0]]) + bd.Viscous([drag, 0.0])
    times = h * np.arange(n + 1)
    result = bd.simulate(params, jump, n * h, initial=start, method=method, step=h, t_eval=times)
    z, omega = h * rate, [2e-2]
    for k in range(n):
        force = 0.0 if k < at else -0.1 / 0.01 * h
        if method == "lie" or k in (0, at):
            omega.append((omega[-1] + force) / (1.0 + z))
        else:
            two_thirds = 2.0 / 3.0
            new = (4.0 * omega[-1] - omega[-2]) / 3.0 + two_thirds * force
            omega.append(new / (1.0 + two_thirds * z))
    assert result.stats.steps == n
    got = result.pulleys.omega[:, 0]
    # step lengths differ by rounding of the times
    assert np.max(np.abs(got - omega)) <= 1e-12 * np.max(np.abs(omega))
    if drag > 1.0:
        settled = -0.1 / drag
        assert np.all(np.abs(got[at + 1 :] - settled) <= 1.001 * abs(settled) / (1.0 + z))


@pytest.mark.parametrize("z", [0.3, 5.0, 300.0])
def test_rodas4_damps_as_its_coefficients_say(z: float) -> None:
    """Omega after each step times R(-h lambda), to the digits of the coefficients."""
    h = 1e-4
    params, start, rate = free_pulley(0.01 * z / h, 1e-5)
    torque = bd.Viscous([0.01 * z / h, 0.0])
    times = h * np.arange(4)
    result = bd.simulate(params, torque, 3 * h, initial=start, t_eval=times, **held("rodas4", h))
    assert result.stats.steps == 3
    assert rate * h == pytest.approx(z)
    method = Rodas4()
    one = np.ones(6)
    growth = 1.0 - z * method.b @ np.linalg.solve(np.eye(6) + z * method.beta, one)
    got = result.pulleys.omega[:, 0]
    assert np.max(np.abs(got[1:] - growth * got[:-1])) <= 1e-11 * got[0]


def test_variable_steps_are_the_formula() -> None:
    """The same recurrence over the steps that the error control chose, seen by the torque."""
    params, start, rate = free_pulley(0.5, 2e-2)
    seen: list[float] = []

    def drag(t: float, theta: Array, omega: Array) -> list[float]:
        seen.append(t)
        return [-0.5 * omega[0], 0.0]

    kwargs: dict[str, Any] = {"initial": start, "method": "lbdf2", "rtol": 1e-5}
    bd.simulate(params, drag, 0.05, t_eval=[0.05], **kwargs)
    times = np.unique(seen)
    # the function never sees the very ends of the run's one piece; steps are no shorter than this
    times = np.concatenate([times[:1], times[1:][np.diff(times) > 1e-12]])
    times[-1] = 0.05
    result = bd.simulate(params, drag, 0.05, t_eval=times, **kwargs)
    assert result.stats.steps == len(times) - 1
    steps = np.diff(times)
    ratios = steps[1:] / steps[:-1]
    assert ratios.max() > 1.5
    omega = [2e-2, 2e-2 / (1.0 + rate * steps[0])]
    for w, h in zip(ratios, steps[1:], strict=True):
        beta, g = w * w / (1.0 + 2.0 * w), h * (1.0 + w) / (1.0 + 2.0 * w)
        omega.append((omega[-1] + beta * (omega[-1] - omega[-2])) / (1.0 + g * rate))
    # the slope of a function is a difference: half its digits, over some steps
    assert np.max(np.abs(result.pulleys.omega[:, 0] - omega)) <= 1e-6 * 2e-2


# -------------------------------------------------------------------- stops


@pytest.mark.parametrize("method", [*IMPLICIT, "tsit5"])
def test_a_jump_has_two_sides(method: str) -> None:
    """A torque step as a time given twice: nothing before, all of it after, no rejected steps."""
    params = drives.plain()
    start = bd.settle(params)
    jump = bd.PiecewiseLinear([2e-3, 2e-3], [[0, 0], [-10, 0]])
    times = np.array([0.0, 1e-3, 2e-3, np.nextafter(2e-3, 1), 3e-3])
    step = {"step": 1e-4} if method in ("lbdf2", "lie") else {}
    result = bd.simulate(params, jump, 3e-3, initial=start, t_eval=times, method=method, **step)
    assert result.pulleys.torque[:, 0].tolist() == [0.0, 0.0, 0.0, -10.0, -10.0]
    assert np.all(np.abs(result.pulleys.omega[:3, 0]) <= 1e-7)
    # free of the belt at first: -10 N m on 0.01 kg m^2 for 1 ms, less what the belt takes up
    assert -1.0 < result.pulleys.omega[-1, 0] < -0.2
    assert result.stats.rejected == 0 or method == "rodas4"


@pytest.mark.parametrize("method", IMPLICIT)
def test_a_named_jump_of_a_function_has_two_sides(method: str) -> None:
    """Functions that decide otherwise at the jump give the same to the last bit, and that of the
    object that knows it but for the differences that stand for its slopes.
    """
    params = drives.plain()
    start = bd.settle(params)
    at = 2.0001e-3
    step = {"rtol": 1e-3} if method == "rodas4" else {"step": 1e-4}
    kwargs = {"initial": start, "t_eval": np.linspace(0, 3e-3, 31), "method": method, **step}

    def run(included: bool) -> bd.Result:
        def torque(t: float, theta: Array, omega: Array) -> list[float]:
            return [-100.0 * (t >= at if included else t > at), 0.0]

        return bd.simulate(params, torque, 3e-3, breakpoints=[at], **kwargs)

    known = bd.PiecewiseLinear([at, at], [[0, 0], [-100, 0]])
    one, other, object_ = run(True), run(False), bd.simulate(params, known, 3e-3, **kwargs)
    assert np.array_equal(one.pulleys.omega, other.pulleys.omega)
    assert one.stats.steps == object_.stats.steps
    scale = np.max(np.abs(object_.pulleys.omega))
    assert np.max(np.abs(one.pulleys.omega - object_.pulleys.omega)) <= 1e-7 * scale


@pytest.mark.parametrize("method", IMPLICIT)
def test_samples_move_no_step(method: str) -> None:
    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    few, many = (
        bd.simulate(*scene[:2], 0.01, initial=start, method=method, t_eval=np.linspace(0, 0.01, n))
        for n in (2, 501)
    )
    assert few.stats.steps == many.stats.steps
    assert np.array_equal(few.final_state.x, many.final_state.x)


# -------------------------------------------------------------------- friction's limit


@pytest.mark.parametrize("sigma", [1e4, 1e6, 1e8])
@pytest.mark.parametrize("method", IMPLICIT)
def test_friction_keeps_its_limit(method: str, sigma: float) -> None:
    """|mu| <= mu_k at every sample, in steps and between them, and at the end, to the last bit."""
    scene = bd.scenes.kubas_case_1()
    limit = scene.params.friction.mu_k
    params = attrs.evolve(scene.params, friction=bd.Dahl(mu_k=limit, sigma=sigma))
    start = bd.settle(scene.params)
    step = {"rtol": 1e-2} if method == "rodas4" else {"step": 4e-4}
    t_end = 0.01 if method == "rodas4" else 0.1
    result = bd.simulate(
        params, scene.torque_fn, t_end, initial=start, method=method,
        t_eval=np.linspace(0, t_end, 777), **step,
    )  # fmt: skip
    assert np.max(np.abs(result.contact.mu)) <= limit
    assert np.max(np.abs(result.final_state.mu)) <= limit
    if sigma > 1e4:
        assert np.max(np.abs(result.final_state.mu)) > 0.5 * limit  # it gets there
    # and the state is one to go on from
    again = bd.simulate(
        params, scene.torque_fn, t_end + 4e-3, initial=result.final_state, method=method, **step
    )
    assert np.max(np.abs(again.contact.mu)) <= limit


# -------------------------------------------------------------------- counters, options


def test_what_they_count() -> None:
    """Work of a step: 1 of each for lbdf2 and lie; rodas4 one Jacobian a step, one factorisation
    and five evaluations more a trial, and for the ledger one in the middle. One more evaluation
    after the start and after each stop.
    """
    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    kink = bd.PiecewiseLinear([0, 4e-3, 0.02], [[0, 0], [-10, 0], [-5, 0]])
    for method in ("lbdf2", "lie"):
        stats = bd.simulate(scene.params, kink, 0.02, initial=start, method=method, step=1e-4).stats
        assert stats.method == method
        assert (stats.steps, stats.rejected) == (200, 0)
        assert (stats.njev, stats.nlu, stats.nfev) == (200, 200, 202)
        assert stats.smallest_step == pytest.approx(1e-4, rel=1e-9)
        assert stats.largest_step == pytest.approx(1e-4, rel=1e-9)
    for ledger in (True, False):
        stats = bd.simulate(
            scene.params, kink, 0.02, initial=start, method="rodas4", ledger=ledger
        ).stats
        trials = stats.steps + stats.rejected
        assert stats.rejected > 0
        assert (stats.njev, stats.nlu) == (stats.steps, trials)
        assert stats.nfev == 5 * trials + (2 if ledger else 1) * stats.steps + 2


def test_a_step_given_is_the_step_or_the_first() -> None:
    """lbdf2 and lie hold it; without one they choose by rtol; rodas4 begins with it."""
    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    for method in ("lbdf2", "lie"):
        # 3 equal parts rather than a sliver at the end
        fixed = bd.simulate(*scene[:2], 1e-3, initial=start, method=method, step=4e-4).stats
        assert fixed.steps == 3
        assert fixed.largest_step == pytest.approx(1e-3 / 3, rel=1e-9)
        loose, tight = (
            bd.simulate(*scene[:2], 5e-3, initial=start, method=method, rtol=rtol).stats
            for rtol in (1e-2, 1e-4)
        )
        assert loose.largest_step > 1.5 * loose.smallest_step
        assert tight.steps > 2 * loose.steps
    first = bd.simulate(*scene[:2], 5e-3, initial=start, method="rodas4", step=2e-6).stats
    assert first.smallest_step == pytest.approx(2e-6, rel=1e-9)
    assert first.largest_step > 4e-6


def test_unknown_methods_are_told_the_known() -> None:
    scene = drives.plain_scene()
    with pytest.raises(ValueError, match=r"auto, tsit5, rk4, lbdf2, rodas4, lie, .*bdf2"):
        bd.simulate(*scene, method="bdf2")


# -------------------------------------------------------------------- Python torques


@pytest.mark.parametrize("method", IMPLICIT)
def test_an_exception_comes_out_as_it_is(method: str) -> None:
    """Whichever call raises it: at stages, for slopes over angles, speeds and time."""
    params = drives.plain()
    start = bd.settle(params)

    class Mine(Exception):
        pass

    def torque(t: float, theta: Array, omega: Array) -> list[float]:
        left.pop()
        if not left:
            raise error
        return [-1.0 - omega[1], theta[0]]

    for calls in (*range(1, 14), 100):
        left, error = list(range(calls)), Mine(calls)
        with pytest.raises(Mine) as caught:
            bd.simulate(params, torque, 5e-3, initial=start, t_eval=[5e-3], method=method)
        assert caught.value is error


@pytest.mark.parametrize("method", IMPLICIT)
@pytest.mark.parametrize("when", [1, 2, 5, 30])
def test_torques_that_are_no_numbers_are_named(method: str, when: int) -> None:
    params = drives.plain()
    start = bd.settle(params)
    calls = 0

    def torque(t: float, theta: Array, omega: Array) -> list[float]:
        nonlocal calls
        calls += 1
        return [np.nan if calls >= when else 0.0, 0.0]

    with pytest.raises(bd.SimulationError) as caught:
        bd.simulate(params, torque, 5e-3, initial=start, t_eval=[5e-3], method=method)
    assert caught.value.symbol == "BD_ERR_TORQUE_VALUE"
    assert np.all(np.isfinite(caught.value.result.final_state.x))


# -------------------------------------------------------------------- the same again


def started(name: str, t: float = 0.06) -> tuple[bd.Scene, bd.State]:
    scene = bd.scenes.get(name)
    final = bd.simulate(*scene[:2], t, t_eval=[t], rtol=1e-2).final_state
    return scene, attrs.evolve(final, t=t)


def options_of(method: str) -> dict[str, Any]:
    return {"method": method, **({"rtol": 1e-3} if method == "rodas4" else {"step": 1e-4})}


@pytest.mark.parametrize("method", IMPLICIT)
def test_chunks_change_nothing(method: str) -> None:
    """A run in pieces of a step or so, as Ctrl-C would cut it, and one in a single piece."""
    scene, state = started("three-pulleys")
    terms = scene.torque_fn.terms()
    ends = []
    for seconds in (np.inf, 0.0):
        run = _core.Simulation(
            scene.params._model, state._to_core(scene.params), terms, 0.09, **options_of(method)
        )
        calls = 1
        while not run.advance(seconds):
            calls += 1
        ends.append(run.state())
    assert calls > 1
    assert all(np.array_equal(ends[0][name], ends[1][name]) for name in ends[0])


@pytest.mark.parametrize(
    ("name", "options"), [("kubas-case-1", {"rtol": 1e-3}), ("three-pulleys", {"step": 1e-4})]
)
def test_place_and_numbering_change_nothing(name: str, options: dict[str, Any]) -> None:
    """Turned, shifted, numbered from another link, gone round before: lbdf2, adaptive and fixed."""
    scene, state = started(name)

    def run(params: bd.Params, start: bd.State) -> bd.Result:
        end = start.t + SHORT
        times = np.linspace(start.t, end, 6)
        kwargs: dict[str, Any] = {"method": "lbdf2", "t_eval": times, **options}
        return bd.simulate(params, scene.torque_fn, end, initial=start, **kwargs)

    expected = run(scene.params, state)
    for angle, shift in ((0.7, (0.0, 0.0)), (0.0, (0.5, -0.25))):
        assert_same(expected, run(*moved(scene.params, state, angle, shift)))
    assert_same(expected, run(scene.params, renumbered(scene.params, state, 17)), roll=-17)
    turned = attrs.evolve(state, phi=state.phi + 20 * np.pi)
    assert_same(expected, run(scene.params, turned))


@pytest.mark.parametrize("method", IMPLICIT)
def test_turns_taken_off_while_running(method: str) -> None:
    """Turns leave phi once it has gone past 50 rad: a run that starts just before goes on like one
    that starts a turn back, states of the past included.
    """
    scene, state = started("kubas-case-1", 0.3)
    # link 0 is to be one that turns with a pulley
    first = int(np.flatnonzero(state.mu)[3])
    state = renumbered(scene.params, state, first)
    turn = -49.9 - state.phi[0]
    params, image = moved(scene.params, state, turn, (0.0, 0.0))
    back = attrs.evolve(image, phi=image.phi + 2 * np.pi)
    runs = [
        bd.simulate(
            params, scene.torque_fn, 0.36, initial=start, t_eval=np.linspace(0.3, 0.36, 61),
            **options_of(method),
        )
        for start in (image, back)
    ]  # fmt: skip
    assert runs[0].belt.phi[-1, 0] < -50.0 < runs[0].belt.phi[0, 0]
    assert runs[0].stats.steps == runs[1].stats.steps
    scale = np.max(np.abs(runs[0].joints.force))
    # 50 rad are rounded to 7e-15, over half a link and a stretch: 1e-12 a step
    assert np.max(np.abs(runs[0].joints.force - runs[1].joints.force)) <= 1e-8 * scale
    assert np.max(np.abs(runs[0].belt.phi + 2 * np.pi - runs[1].belt.phi)) <= 1e-9


@pytest.mark.parametrize("method", [*IMPLICIT, "tsit5"])
def test_a_run_in_two_parts_is_the_run_in_one(method: str) -> None:
    """From final_state on: one step of order 1 more, or steps of other sizes, errors as between two
    tolerances.
    """
    scene, state = started("kubas-case-1")
    tight = {"rodas4": {"rtol": 1e-6}, "tsit5": {"rtol": 1e-7}}.get(method, {"step": 2e-6})

    def run(start: bd.State, end: float) -> bd.State:
        options: dict[str, Any] = {"method": method, "t_eval": [end], **tight}
        return bd.simulate(*scene[:2], end, initial=start, **options).final_state

    whole, half = run(state, 0.07), run(state, 0.065)
    rest = run(half, 0.07)
    assert (half.t, rest.t) == (0.065, 0.07)
    stretch = scene.params.info["strain"] * scene.params.info["link_length"]
    assert np.max(np.abs(rest.x - whole.x)) <= (1e-5 if method == "tsit5" else 1e-4) * stretch
    assert np.max(np.abs(rest.omega - whole.omega)) <= 1e-5


# ---------------------------------------------------------------- beyond help


@pytest.mark.parametrize("options", [{"rtol": 1e-4}, {"rtol": 1e-9}, {"step": 1e-4}])
@pytest.mark.parametrize("method", ["lbdf2", "lie", "rodas4"])
def test_a_state_out_of_scale_ends_the_run(method: str, options: dict[str, float]) -> None:
    """Not finite, or never within the tolerance: an error that says so, never an endless step."""
    params = bd.scenes.kubas_case_1().params
    start = bd.settle(params)
    mad = attrs.evolve(start, vx=np.full(60, 1e160))
    with pytest.raises(
        bd.SimulationError, match=r"finite numbers|reached its lower limit|blew up"
    ) as caught:
        bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-3, initial=mad, method=method, **options)
    assert caught.value.symbol in ("BD_ERR_NOT_FINITE", "BD_ERR_STEP_FLOOR")


def test_settling_a_fine_belt_from_nowhere_is_an_error() -> None:
    base = bd.scenes.kubas_case_1().params
    params = attrs.evolve(base, belt=attrs.evolve(base.belt, n_bodies=240))
    rest = bd.settle(params)
    with pytest.raises(bd.SimulationError):
        bd.settle(params, initial=attrs.evolve(rest, x=rest.x * 1e155))


def test_tolerances_below_rounding_are_not_chased() -> None:
    """Divided differences of states know nothing below 1e-10 of a stretch: no fallbacks, and the
    error that is claimed is the one that was held, not the one that was asked for.
    """
    params = bd.scenes.kubas_case_1().params
    runs = [
        bd.simulate(params, bd.Viscous([0.0, 1.0]), 2e-4, method="lbdf2", rtol=rtol).stats
        for rtol in (1e-6, 1e-9)
    ]
    assert runs[0].steps == runs[1].steps
    assert runs[1].fallbacks == 0
    assert runs[1].local_error is None or runs[1].local_error >= 1e-7


@pytest.mark.parametrize("step", [1e-4, 5e-5])
def test_kinks_of_the_torque_cost_no_order(step: float) -> None:
    """A stop at every step, as of a torque given as a table: nothing jumps, so the past goes on."""
    scene, state = started("kubas-case-1", 0.3)
    times = np.linspace(0.301, 0.32, 39)
    stops = 0.3 + step * np.arange(1, round(0.02 / step))
    runs = [
        bd.simulate(*scene[:2], 0.32, initial=state, t_eval=times, method="lbdf2", step=step,
                    breakpoints=breakpoints)
        for breakpoints in ((), stops)
    ]  # fmt: skip
    mean = np.mean(runs[0].joints.force)
    # the same steps but for the rounding of the stops
    assert np.max(np.abs(runs[0].joints.force - runs[1].joints.force)) <= 1e-6 * mean
    assert runs[1].stats.local_error == pytest.approx(runs[0].stats.local_error, rel=1e-3)
