"""Runs of the implicit methods: exact steps on linear problems, limits of friction, what they
count, exceptions, turns, restarts from a state, and what is beyond them.

Jumps of the torque and samples, of every method, are in ``test_integrators.py``.
"""

from __future__ import annotations

from typing import Any

import attrs
import drives
import numpy as np
import pytest
from test_implicit import Rodas4, held
from test_invariance import moved, renumbered

import beltdyn as bd

Array = np.ndarray
IMPLICIT = ("lbdf2", "lie", "rodas4")
of_each = pytest.mark.parametrize("method", IMPLICIT)


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
            new = (4.0 * omega[-1] - omega[-2]) / 3.0 + 2.0 / 3.0 * force
            omega.append(new / (1.0 + 2.0 / 3.0 * z))
    assert result.stats.steps == n
    got = result.pulleys.omega[:, 0]
    # step lengths differ by rounding of the times
    assert np.max(np.abs(got - omega)) <= 1e-12 * np.max(np.abs(omega))
    if drag > 1.0:
        settled = -0.1 / drag
        assert np.all(np.abs(got[at + 1 :] - settled) <= 1.001 * abs(settled) / (1.0 + z))


@pytest.mark.filterwarnings("ignore::beltdyn.AccuracyWarning")
def test_the_first_step_of_a_method_that_looks_back_errs_as_asked() -> None:
    """Nothing checks it, and on coarse links the contact is stiffer than the joints, by which first
    steps of other methods go: forces of the first 0.2 ms erred as much at any rtol below 1e-4.
    A thousandth of rtol is worth thirty times at least, of local errors that go with its power 1.4.
    """
    line = bd.route(drives.plain().pulleys).length
    belt = attrs.evolve(
        drives.plain().belt, length=line / 1.005, n_bodies=12, mesh="joint", axial_damping=1.0
    )
    params = attrs.evolve(drives.plain(), belt=belt, contact=bd.Contact())
    times, torque = np.linspace(0.0, 2e-4, 21), bd.PiecewiseLinear([0.0], [[-6.0, 2.0]])
    start = bd.settle(params)

    def force(method: str, rtol: float) -> Array:
        options: dict[str, Any] = {"initial": start, "t_eval": times, "method": method}
        return bd.simulate(params, torque, times[-1], rtol=rtol, **options).joints.force

    exact = force("rodas4", 1e-8)
    loose, tight = (np.abs(force("lbdf2", rtol) - exact).max() for rtol in (1e-3, 1e-6))
    assert 30.0 * tight < loose < 1e-3 * start.tension(params).mean


@pytest.mark.parametrize("z", [0.3, 5.0, 300.0])
def test_rodas4_damps_as_its_coefficients_say(z: float) -> None:
    """Omega after each step times R(-h lambda), to the digits of the coefficients."""
    h, method = 1e-4, Rodas4()
    params, start, rate = free_pulley(0.01 * z / h, 1e-5)
    assert rate * h == pytest.approx(z)
    torque, times = bd.Viscous([0.01 * z / h, 0.0]), h * np.arange(4)
    result = bd.simulate(params, torque, 3 * h, initial=start, t_eval=times, **held("rodas4", h))
    assert result.stats.steps == 3
    growth = 1.0 - z * method.b @ np.linalg.solve(np.eye(6) + z * method.beta, np.ones(6))
    got = result.pulleys.omega[:, 0]
    assert np.max(np.abs(got[1:] - growth * got[:-1])) <= 1e-11 * got[0]


@of_each
def test_friction_keeps_its_limit(method: str) -> None:
    """|mu| <= mu_k at every sample, in steps and between them, and at the end, to the last bit; and
    the state is one to go on from.
    """
    params, torque, *_ = bd.scenes.kubas_case_1()
    limit, start = params.friction.mu_k, bd.settle(params)
    options = {"rtol": 1e-2} if method == "rodas4" else {"step": 4e-4}
    t_end = 0.01 if method == "rodas4" else 0.1
    for sigma in (1e4, 1e8):
        stiff = attrs.evolve(params, friction=bd.Dahl(mu_k=limit, sigma=sigma))
        run = bd.simulate(
            stiff, torque, t_end, initial=start, method=method,
            t_eval=np.linspace(0, t_end, 777), **options,
        )  # fmt: skip
        again = bd.simulate(
            stiff, torque, t_end + 4e-3, initial=run.final_state, method=method, **options
        )
        for mu in (run.contact.mu, run.final_state.mu, again.contact.mu):
            assert np.max(np.abs(mu)) <= limit
    assert np.max(np.abs(run.final_state.mu)) > 0.5 * limit  # the stiffer one gets there


def test_what_they_count() -> None:
    """Work of a step: 1 of each for lbdf2 and lie; rodas4 one Jacobian a step, one factorisation
    and five evaluations more a trial, and for the ledger one in the middle. One more evaluation
    after the start and after each stop.
    """
    params = bd.scenes.kubas_case_1().params
    kink = bd.PiecewiseLinear([0, 4e-3, 0.02], [[0, 0], [-10, 0], [-5, 0]])
    given: dict[str, Any] = {"initial": bd.settle(params)}
    for method in ("lbdf2", "lie"):
        stats = bd.simulate(params, kink, 0.02, method=method, step=1e-4, **given).stats
        assert (stats.method, stats.steps, stats.rejected) == (method, 200, 0)
        assert (stats.njev, stats.nlu, stats.nfev) == (200, 200, 202)
        assert stats.smallest_step == pytest.approx(1e-4, rel=1e-9)
        assert stats.largest_step == pytest.approx(1e-4, rel=1e-9)
    for ledger in (True, False):
        stats = bd.simulate(params, kink, 0.02, method="rodas4", ledger=ledger, **given).stats
        trials = stats.steps + stats.rejected
        assert stats.rejected > 0
        assert (stats.njev, stats.nlu) == (stats.steps, trials)
        assert stats.nfev == 5 * trials + (2 if ledger else 1) * stats.steps + 2


def test_a_step_given_is_the_step_or_the_first() -> None:
    """lbdf2 and lie hold it; without one they choose by rtol; rodas4 begins with it."""
    params, torque, *_ = bd.scenes.kubas_case_1()
    start = bd.settle(params)

    def stats_of(method: str, t_end: float = 5e-3, **options: float) -> bd.Stats:
        return bd.simulate(params, torque, t_end, initial=start, method=method, **options).stats

    for method in ("lbdf2", "lie"):
        # 3 equal parts rather than a sliver at the end
        fixed = stats_of(method, 1e-3, step=4e-4)
        assert fixed.steps == 3
        assert fixed.largest_step == pytest.approx(1e-3 / 3, rel=1e-9)
        loose, tight = stats_of(method, rtol=1e-2), stats_of(method, rtol=1e-4)
        assert loose.largest_step > 1.5 * loose.smallest_step
        assert tight.steps > 2 * loose.steps
    first = stats_of("rodas4", step=2e-6)
    assert first.smallest_step == pytest.approx(2e-6, rel=1e-9)
    assert first.largest_step > 4e-6


@of_each
def test_exceptions_and_what_is_no_number_come_from_any_call(method: str) -> None:
    """At stages, for slopes over angles, speeds and time."""
    params = drives.plain()
    given: dict[str, Any] = {"initial": bd.settle(params), "t_eval": [5e-3], "method": method}

    class Mine(Exception):
        pass

    def torque(t: float, theta: Array, omega: Array) -> list[float]:
        left.pop()
        if not left and raised is not None:
            raise raised
        return [-1.0 - omega[1] if left else np.nan, theta[0]]

    raised: Mine | None
    for calls in (*range(1, 14), 100):
        left, raised = list(range(calls)), Mine(calls)
        with pytest.raises(Mine) as caught:
            bd.simulate(params, torque, 5e-3, **given)
        assert caught.value is raised
    raised = None
    for calls in (1, 2, 5, 30):
        left = list(range(calls))
        with pytest.raises(bd.SimulationError) as said:
            bd.simulate(params, torque, 5e-3, **given)
        assert said.value.symbol == "BD_ERR_TORQUE_VALUE"
        assert np.all(np.isfinite(said.value.result.final_state.x))


def started() -> tuple[bd.Scene, bd.State]:
    """A scene and its state at 0.3 s."""
    scene = bd.scenes.kubas_case_1()
    return scene, bd.simulate(*scene[:2], 0.3, t_eval=[0.3], rtol=1e-2).final_state


@of_each
def test_turns_taken_off_while_running(method: str) -> None:
    """Turns leave phi once it has gone past 50 rad: a run that starts just before goes on like one
    that starts a turn back, states of the past included.
    """
    scene, state = started()
    # link 0 is to be one that turns with a pulley
    first = int(np.flatnonzero(state.mu)[3])
    state = renumbered(scene.params, state, first)
    params, image = moved(scene.params, state, -49.9 - state.phi[0], (0.0, 0.0))
    back = attrs.evolve(image, phi=image.phi + 2 * np.pi)
    options = {"rtol": 1e-3} if method == "rodas4" else {"step": 1e-4}
    runs = [
        bd.simulate(
            params, scene.torque_fn, 0.36, initial=start, t_eval=np.linspace(0.3, 0.36, 61),
            method=method, **options,
        )
        for start in (image, back)
    ]  # fmt: skip
    assert runs[0].belt.phi[-1, 0] < -50.0 < runs[0].belt.phi[0, 0]
    assert runs[0].stats.steps == runs[1].stats.steps
    scale = np.max(np.abs(runs[0].joints.force))
    # 50 rad are rounded to 7e-15, over half a link and a stretch: 1e-12 a step
    assert np.max(np.abs(runs[0].joints.force - runs[1].joints.force)) <= 1e-8 * scale
    assert np.max(np.abs(runs[0].belt.phi + 2 * np.pi - runs[1].belt.phi)) <= 1e-9


def test_kinks_of_the_torque_cost_no_order() -> None:
    """A stop at every step, as of a torque given as a table: nothing jumps, so the past goes on."""
    scene, state = started()
    times, step = np.linspace(0.301, 0.32, 39), 1e-4
    runs = [
        bd.simulate(*scene[:2], 0.32, initial=state, t_eval=times, method="lbdf2", step=step,
                    breakpoints=breakpoints)
        for breakpoints in ((), 0.3 + step * np.arange(1, 200))
    ]  # fmt: skip
    mean = np.mean(runs[0].joints.force)
    # the same steps but for the rounding of the stops
    assert np.max(np.abs(runs[0].joints.force - runs[1].joints.force)) <= 1e-6 * mean
    assert runs[1].stats.local_error == pytest.approx(runs[0].stats.local_error, rel=1e-3)


@of_each
def test_a_state_out_of_scale_ends_the_run(method: str) -> None:
    """Not finite, or never within the tolerance: an error that says so, never an endless step."""
    params = drives.plain()
    mad = attrs.evolve(bd.settle(params), vx=np.full(60, 1e160))
    words = r"finite numbers|reached its lower limit|blew up"
    for options in ({"rtol": 1e-4}, {"rtol": 1e-9}, {"step": 1e-4}):
        with pytest.raises(bd.SimulationError, match=words) as caught:
            bd.simulate(params, bd.Viscous([0, 0]), 1e-3, initial=mad, method=method, **options)
        assert caught.value.symbol in ("BD_ERR_NOT_FINITE", "BD_ERR_STEP_FLOOR")


def test_tolerances_below_rounding_are_not_chased() -> None:
    """Divided differences of states know nothing below 1e-10 of a stretch: no fallbacks, and the
    error that is claimed is the one that was held, not the one that was asked for.
    """
    params = bd.scenes.kubas_case_1().params
    held_to, asked = (
        bd.simulate(params, bd.Viscous([0.0, 1.0]), 2e-4, method="lbdf2", rtol=rtol).stats
        for rtol in (1e-6, 1e-9)
    )
    assert held_to.steps == asked.steps
    assert asked.fallbacks == 0
    assert asked.local_error is None or asked.local_error >= 1e-7


@pytest.mark.parametrize("method", [*IMPLICIT, "tsit5"])
def test_a_run_in_two_parts_is_the_run_in_one(method: str) -> None:
    """One step of order 1 more, or steps of other sizes: errors as between two tolerances."""
    scene = bd.scenes.kubas_case_1()
    state = bd.simulate(*scene[:2], 0.06, t_eval=[0.06], rtol=1e-2).final_state
    tight = {"rodas4": {"rtol": 1e-6}, "tsit5": {"rtol": 1e-7}}.get(method, {"step": 2e-6})

    def run(start: bd.State, end: float) -> bd.State:
        options: dict[str, Any] = {"method": method, "t_eval": [end], **tight}
        return bd.simulate(*scene[:2], end, initial=start, **options).final_state

    whole, rest = run(state, 0.07), run(run(state, 0.065), 0.07)
    stretch = scene.params.info["strain"] * scene.params.info["link_length"]
    assert np.max(np.abs(rest.x - whole.x)) <= (1e-5 if method == "tsit5" else 1e-4) * stretch
    assert rest.t == 0.07 and np.max(np.abs(rest.omega - whole.omega)) <= 1e-5
