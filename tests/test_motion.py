"""Prescribed motion (MODEL section 5): against the oracle, closed forms and a heavy flywheel, every
method against the others, the ledger, restart, what is refused, and nothing of it when it is off.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
import stored_runs
from bridge import oracle_of
from click.testing import CliRunner
from module_common import INF, TORQUE, make_model, refused, same_bits
from mounted_drives import METHODS

import beltdyn as bd
from beltdyn import _core, cli

T_END = 0.02
TIMES = np.linspace(0.0, T_END, 41)
#: Up to -20 rad/s by 12 ms, with a kink on the way, and steady after that.
RAMP = bd.PiecewiseLinear([0.0, 0.004, 0.012], [0.0, -4.0, -20.0])
#: A load on the other pulley.
LOAD = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [0.0, 20.0]])
FREE = bd.Viscous([0.0, 0.0])

pytestmark = pytest.mark.filterwarnings("ignore:(mesh|no_friction):UserWarning")


def wave(t: float) -> float:
    """Speed [rad/s]: from rest, and back to it after 31 ms."""
    return -20.0 * math.sin(100.0 * t) ** 2


def wave_rate(t: float) -> float:
    return -2000.0 * math.sin(200.0 * t)


def wave_angle(t: float) -> float:
    return -10.0 * (t - math.sin(200.0 * t) / 200.0)


def params_with(**changes: Any) -> bd.Params:
    """The paper's two pulleys, pulley 0 with drag."""
    base = drives.plain()
    drag = bd.Drag(coulomb=1.0, viscous=0.05, quadratic=1e-3)
    pulleys = [attrs.evolve(base.pulleys[0], drag=drag), base.pulleys[1]]
    return attrs.evolve(base, **{"pulleys": pulleys, **changes})


@pytest.fixture(scope="module")
def params() -> bd.Params:
    return params_with()


@pytest.fixture(scope="module")
def start(params: bd.Params) -> bd.State:
    return bd.settle(params)


def run(params: bd.Params, start: bd.State, motion: Any, **options: Any) -> bd.Result:
    given = {"torque_fn": LOAD, "t_end": T_END, "t_eval": TIMES, "initial": start, **options}
    return bd.simulate(params, motion=motion, **given)


def tension(params: bd.Params) -> float:
    return float(params.info["strain_tension"])


def grip(result: bd.Result, pulley: int) -> np.ndarray:
    """Torque of friction on a pulley, from what is reported of its links."""
    center = result.params.pulleys[pulley].center
    lever = np.hypot(result.belt.x - center[0], result.belt.y - center[1])
    on = result.contact.pulley == pulley
    return np.sum(np.where(on, result.contact.friction * lever, 0.0), axis=1)


def moved_run(*moved: int) -> stored_runs.Case:
    params, laws = params_with(), (
        lambda t: (wave(t), wave_rate(t)), lambda t: (0.9 * wave(t), 0.9 * wave_rate(t))
    )  # fmt: skip
    return stored_runs.Case.of(
        params, LOAD if moved == (0,) else FREE, lambda: bd.settle(params), TIMES[8::8],
        {j: laws[j] for j in moved}, breakpoints=[0.01],
    )  # fmt: skip


RUNS = stored_runs.Runs(
    __name__,
    {"one pulley moved": lambda: moved_run(0), "all pulleys moved": lambda: moved_run(0, 1)},
)


@pytest.mark.parametrize("name", RUNS.cases)
def test_core_agrees_with_oracle(name: str, params: bd.Params) -> None:
    """Bounds as in test_oracle.py; the torque is that of all joint forces, at a radius of 0.1 m."""
    stored = RUNS[name]
    oracle, torque, times = stored.oracle, stored.case.torque, stored.t
    motion = {0: wave, 1: lambda t: 0.9 * wave(t)}
    result = run(
        params, stored.state, {j: motion[j] for j in oracle.motion},
        torque_fn=torque, t_eval=times, rtol=1e-9,
    )  # fmt: skip
    y = oracle.follow(times, stored.y)
    theta, omega = np.moveaxis(oracle.pulleys(y), -2, 0)
    force = oracle.joints(y)[1]
    assert np.max(np.abs(result.pulleys.theta - theta)) <= 1e-8 * np.max(np.abs(theta))
    assert np.max(np.abs(result.pulleys.omega[:, 0] - omega[:, 0])) <= 1e-13 * 20.0
    assert np.max(np.abs(result.joints.force - force)) <= 1e-6 * np.mean(force)
    needed = np.array([oracle.torques(t, state, torque) for t, state in zip(times, y, strict=True)])
    assert np.max(np.abs(result.pulleys.torque - needed)) <= 1e-6 * np.mean(force) * 0.1 * 60
    drive = oracle.ledger(y)[:, 0]
    assert np.max(np.abs(result.energy.drive - drive)) <= 1e-6 * np.max(np.abs(drive))


@pytest.mark.filterwarnings("ignore:units")
def test_a_heavy_flywheel_moves_alike(params: bd.Params, start: bd.State) -> None:
    """Of 1e6 kg m^2, under the torque that gives it this speed. Friction, of some 50 N m, changes
    the speed by 1e-6 rad/s in 20 ms, and the rim by 1e-9 m, which half the belt answers with
    1.2e-4 N; ten times that for vibration is 1e-6 of the tension. Drag is some 3 N m.
    """
    heavy = 1e6
    slopes = np.diff(RAMP.values[:, 0]) / np.diff(RAMP.t)
    drive = bd.PiecewiseLinear(
        [0.0, 0.004, 0.004, 0.012, 0.012],
        [[heavy * slope, 0.0] for slope in (slopes[0], slopes[0], slopes[1], slopes[1], 0.0)],
    )
    first = attrs.evolve(params.pulleys[0], inertia=heavy)
    flywheel = attrs.evolve(params, pulleys=[first, params.pulleys[1]])
    free = run(flywheel, start, None, torque_fn=drive + LOAD, rtol=1e-8)
    moved = run(params, start, {0: RAMP}, rtol=1e-8)
    assert np.max(np.abs(free.pulleys.omega[:, 0] - moved.pulleys.omega[:, 0])) <= 2e-6
    assert np.max(np.abs(free.joints.force - moved.joints.force)) <= 1e-6 * tension(params)


@pytest.fixture(scope="module")
def exact(params: bd.Params, start: bd.State) -> dict[str, bd.Result]:
    options = {"method": "tsit5", "rtol": 1e-8}
    return {
        "ramp": run(params, start, {0: RAMP}, **options),
        "wave": run(params, start, {0: wave}, **options),
    }


@pytest.mark.parametrize(("method", "kind"), [*zip(METHODS, ["ramp", "wave"] * 3, strict=True)])
def test_every_method(
    method: str, kind: str, params: bd.Params, start: bd.State, exact: dict[str, bd.Result]
) -> None:
    """Forces err by what was asked, rk4 by less than 1e-4; the speed is that given, at every sample
    and in the state; the balance closes as it does without motion (test_drag.py).
    """
    options, expected = METHODS[method], exact[kind]
    motion: Any = RAMP if kind == "ramp" else wave
    result = run(params, start, {0: motion}, method=method, **options)
    apart = (result.joints.force - expected.joints.force) / tension(params)
    assert math.sqrt(np.mean(apart**2)) <= options.get("rtol", 1e-4)
    if kind == "ramp":
        speed = np.interp(TIMES, RAMP.t, RAMP.values[:, 0])
    else:
        speed = np.array([wave(t) for t in TIMES])
    assert np.max(np.abs(result.pulleys.omega[:, 0] - speed)) <= 1e-14 * 20.0
    assert abs(result.final_state.omega[0] - speed[-1]) <= 1e-14 * 20.0
    residual = np.max(np.abs(result.energy.residual))
    assert residual <= 10 * options.get("rtol", 1e-4) * result.energy.passed[-1]
    assert abs(result.energy.drive[-1]) > 20 * residual  # it would show if it were left out
    assert [one.code for one in result.warnings] == ["mesh"]


def test_fixed_steps_and_other_friction(params: bd.Params, start: bd.State) -> None:
    """lbdf2 with a fixed step is of order 2: with half the step a quarter of the error. LuGre's
    force depends on the speed itself; the methods agree within what was asked.
    """
    fine = run(params, start, {0: wave}, method="rodas4", rtol=1e-8)
    errors = [
        np.max(np.abs(run(params, start, {0: wave}, method="lbdf2", step=h).pulleys.omega
                      - fine.pulleys.omega))
        for h in (4e-5, 2e-5)
    ]  # fmt: skip
    assert 3.0 < errors[0] / errors[1] < 5.5
    law = bd.LuGre(mu_k=0.8, mu_s=1.0, sigma=1e4, v_stribeck=0.01, damping=0.1, viscous=0.05)
    lugre = attrs.evolve(params, friction=law)
    one, other = (run(lugre, start, {0: RAMP}, method=m, rtol=1e-6) for m in ("tsit5", "rodas4"))
    apart = (one.joints.force - other.joints.force) / tension(params)
    assert math.sqrt(np.mean(apart**2)) <= 2e-6


def test_times_of_a_speed_end_steps(params: bd.Params, start: bd.State) -> None:
    """At a kink the acceleration of the sample is that before it; the run is exact with few steps:
    its error would otherwise be that of a kink somewhere in a step.
    """
    free = attrs.evolve(params, friction=None)
    result = run(free, start, {0: RAMP}, torque_fn=FREE, t_eval=[0.004, 0.0041])
    drag = np.array([free_drag(free, w) for w in result.pulleys.omega[:, 0]])
    inertia = params.pulleys[0].inertia
    assert result.pulleys.torque[:, 0] - drag == pytest.approx([-1000 * inertia, -2000 * inertia])


def free_drag(params: bd.Params, omega: float) -> float:
    """As MODEL section 5 states it, of pulley 0."""
    drag = params.pulleys[0].drag
    w0 = params.info["drag_speed"] / params.pulleys[0].radius
    coulomb = drag.coulomb * omega / math.hypot(omega, w0)
    return float(coulomb + drag.viscous * omega + drag.quadratic * omega * abs(omega))


@pytest.mark.parametrize("method", ["tsit5", "rodas4", "lbdf2"])
def test_torque_of_a_pulley_free_of_the_belt(method: str, start: bd.State) -> None:
    """Closed form: I dOmega/dt + Z(Omega); its work is the energy of the pulley and what drag took,
    to what the method's quadrature of a sine leaves.
    """
    free = params_with(friction=None)
    result = run(free, start, {0: wave}, torque_fn=FREE, method=method, rtol=1e-4)
    inertia = free.pulleys[0].inertia
    needed = [inertia * wave_rate(t) + free_drag(free, wave(t)) for t in TIMES]
    assert np.max(np.abs(result.pulleys.torque[:, 0] - needed)) <= 1e-10 * np.max(np.abs(needed))
    stored = np.array([0.5 * inertia * wave(t) ** 2 for t in TIMES])
    balance = result.energy.drive - stored - result.energy.drag_loss
    assert np.max(np.abs(balance)) <= 1e-4 * np.max(result.energy.drive)


@pytest.mark.parametrize("motion", [RAMP, wave, bd.Motion(angle=wave_angle)])
def test_torque_is_what_friction_leaves(motion: Any, params: bd.Params, start: bd.State) -> None:
    """I dOmega/dt - friction + drag at every sample, from what else is reported of it."""
    result = run(params, start, {0: motion})
    if motion is RAMP:
        rates = np.diff(RAMP.values[:, 0]) / np.diff(RAMP.t)
        rate = np.select([TIMES <= 0.004, TIMES <= 0.012], rates, 0.0)
    else:
        rate = np.array([wave_rate(t) for t in TIMES])
    drag = np.array([free_drag(params, w) for w in result.pulleys.omega[:, 0]])
    needed = params.pulleys[0].inertia * rate - grip(result, 0) + drag
    # an acceleration that is the second difference of an angle is known to 1e-6 (motion.c)
    share = 1e-6 if isinstance(motion, bd.Motion) else 1e-9
    size = np.max(np.abs(needed))
    assert np.max(np.abs(result.pulleys.torque[:, 0] - needed)) <= share * size
    assert size > 20.0


def test_a_pulley_may_be_driven_through_its_sensitivity_to_others(start: bd.State) -> None:
    """Torque functions see the prescribed speed and may depend on it: a coupling from pulley 0 to
    pulley 1, in an implicit and an explicit method.
    """
    params = params_with()

    def coupled(_t: float, theta: Any, omega: Any) -> list[float]:
        return [0.0, 2.0 * (omega[0] - omega[1]) + 5.0 * (theta[0] - theta[1])]

    one, other = (
        run(params, start, {0: wave}, torque_fn=coupled, method=m, rtol=1e-6)
        for m in ("tsit5", "rodas4")
    )
    apart = (one.joints.force - other.joints.force) / tension(params)
    assert math.sqrt(np.mean(apart**2)) <= 2e-6
    assert one.stats.twin_steps > 0


def test_angle_and_speed_are_one_motion(params: bd.Params, start: bd.State) -> None:
    """Angles are those given, from where the pulley stands; the speed of an angle, a difference, is
    known to 1e-9 of it, and so are the runs' forces but for the error of the steps.
    """
    turned = attrs.evolve(start, theta=[3.0, 0.0])
    by_speed = run(params, turned, {0: wave}, rtol=1e-8)
    by_angle = run(params, turned, {0: bd.Motion(angle=lambda t: 7.0 + wave_angle(t))}, rtol=1e-8)
    angle = np.array([3.0 + wave_angle(t) for t in TIMES])
    assert np.max(np.abs(by_angle.pulleys.theta[:, 0] - angle)) <= 1e-14
    assert np.max(np.abs(by_speed.pulleys.theta[:, 0] - angle)) <= 1e-10
    difference = by_angle.pulleys.omega - by_speed.pulleys.omega
    assert np.max(np.abs(difference[:, 0])) <= 1e-9 * 20.0
    force = by_angle.joints.force - by_speed.joints.force
    assert np.max(np.abs(force)) <= 1e-6 * tension(params)


@pytest.mark.parametrize("method", ["tsit5", "rodas4", "lbdf2"])
def test_a_function_and_its_data(method: str, params: bd.Params, start: bd.State) -> None:
    """The same speed: the same forces within errors. With its kinks named, a function has the same
    accelerations on both sides of them, but for rounding.
    """

    def interpolated(t: float) -> float:
        return float(np.interp(t, RAMP.t, RAMP.values[:, 0]))

    options = {"method": method, "rtol": 1e-3 if method == "lbdf2" else 1e-6}
    data = run(params, start, {0: RAMP}, **options)
    function = run(params, start, {0: interpolated}, breakpoints=RAMP.t, **options)
    angle = np.max(np.abs(data.pulleys.theta[:, 0] - function.pulleys.theta[:, 0]))
    assert angle <= (1e-5 if method == "lbdf2" else 1e-12)
    apart = (data.joints.force - function.joints.force) / tension(params)
    assert np.max(np.abs(apart)) <= 10 * options["rtol"]
    torque = data.pulleys.torque[:, 0] - function.pulleys.torque[:, 0]
    assert np.max(np.abs(torque)) <= 10 * options["rtol"] * tension(params) * 0.1
    theta = np.array([np.trapezoid(RAMP.values[:2, 0], RAMP.t[:2]), RAMP.values[:, 0].min()])
    at = np.searchsorted(TIMES, 0.004)
    assert data.pulleys.theta[at, 0] == pytest.approx(theta[0], rel=1e-14)


def test_steps_do_not_pass_over_what_a_function_does(params: bd.Params, start: bd.State) -> None:
    """A pulse of 1.5 ms in a drive at rest, where steps would be as long as the run."""
    free = attrs.evolve(params, friction=None)

    def pulse(t: float) -> float:
        return 5.0 * math.sin(math.pi * (t - 0.011) / 0.0015) ** 4 if 0.011 < t < 0.0125 else 0.0

    options = {"torque_fn": FREE, "method": "rodas4", "rtol": 1e-2}
    result = run(free, start, {0: pulse}, **options)
    assert result.stats.largest_step <= 5e-4
    assert result.pulleys.theta[-1, 0] == pytest.approx(5.0 * 0.375 * 0.0015, rel=0.02)
    without = run(free, start, {0: bd.PiecewiseLinear([0.0], [0.0])}, **options)
    assert without.stats.largest_step > 5e-4


def test_all_pulleys_may_be_moved(params: bd.Params, start: bd.State) -> None:
    for method in ("tsit5", "rodas4", "lbdf2"):
        result = run(params, start, {0: RAMP, 1: wave}, torque_fn=FREE, method=method, rtol=1e-3)
        assert result.pulleys.omega[-1, 0] == -20.0
        assert result.final_state.omega[1] == wave(T_END)
        assert abs(result.stats.balance) <= 0.02


def test_a_torque_on_a_moved_pulley_is_ignored_with_a_warning(
    params: bd.Params, start: bd.State
) -> None:
    expected = run(params, start, {0: RAMP})
    with pytest.warns(bd.BeltdynWarning, match="^torque_ignored: the torque set on pulley 0, "):
        result = run(params, start, {0: RAMP}, torque_fn=LOAD + bd.Viscous([1.0, 0.0]))
    found = [one for one in result.warnings if one.code == "torque_ignored"]
    assert len(found) == 1
    assert found[0].where == "pulley 0" and not found[0].accuracy
    assert np.array_equal(result.joints.force, expected.joints.force)
    assert result.stats.error is not None


@pytest.mark.parametrize("scene", ["kubas-case-1", "three-pulleys"])
def test_a_state_at_speed(scene: str) -> None:
    """Where the belt runs it has the pulleys' speed; links run along themselves and turn with the
    path: no joint is stretched but by the corners of the polygon, v times half the turn squared.
    """
    params = bd.scenes.get(scene).params
    rest = bd.settle(params)
    running = rest.at_speed(params, {1: 30.0})
    winding, v = params.info["winding"], 30.0 * params.pulleys[1].radius
    assert running.omega[1] == 30.0
    # it sinks in by 0.1 % of a radius; tangents, of 60 links, turn 0.3 % less than their arcs
    for pulley, omega in zip(params.pulleys, running.omega, strict=True):
        assert omega == pytest.approx(v / pulley.radius, rel=5e-3)
    along = running.vx * np.cos(rest.phi) + running.vy * np.sin(rest.phi)
    # slower where links turn: their centres are inside of the polygon's corners
    half = 0.5 * params.info["link_length"] / min(pulley.radius for pulley in params.pulleys)
    assert along == pytest.approx(winding * v, rel=0.5 * half**2 + 5e-3)
    assert np.array_equal(running.x, rest.x) and np.array_equal(running.mu, rest.mu)
    assert running.residual is None
    oracle = oracle_of(params)
    stretch_rate = links_stretch_rate(running, params)
    turn = params.info["link_length"] / min(pulley.radius for pulley in params.pulleys)
    assert np.max(np.abs(stretch_rate)) <= v * turn**2
    assert oracle.winding == winding


def links_stretch_rate(state: bd.State, params: bd.Params) -> np.ndarray:
    """Rate of the stretch vectors along the links (MODEL section 2)."""
    half = 0.5 * params.info["link_length"]
    ex, ey = np.cos(state.phi), np.sin(state.phi)
    left = state.vx + half * ey * state.vphi, state.vy - half * ex * state.vphi
    right = state.vx - half * ey * state.vphi, state.vy + half * ex * state.vphi
    return (left[0] - np.roll(right[0], 1)) * ex + (left[1] - np.roll(right[1], 1)) * ey


def test_a_run_may_begin_at_speed(params: bd.Params, start: bd.State) -> None:
    """Settled and set going, or from a state that runs; the belt goes on at its speed."""
    steady = bd.PiecewiseLinear([0.0], [-50.0])
    runs = [
        bd.simulate(params, FREE, T_END, {0: steady}, t_eval=TIMES),
        run(params, bd.settle(params, speed={0: -50.0}), {0: steady}, torque_fn=FREE),
        bd.simulate(params, FREE, T_END, {0: bd.Motion(angle=lambda t: -50.0 * t)}, t_eval=TIMES),
        bd.simulate(params, FREE, T_END, {0: lambda t: -50.0, 1: lambda t: -50.0}, t_eval=TIMES),
    ]
    for result in runs:
        assert np.max(np.abs(result.pulleys.omega[:, 0] + 50.0)) <= 1e-7
        assert np.max(np.abs(result.pulleys.omega[:, 1] + 50.0)) <= 1.0  # creep, ripple
        rate = np.diff(result.belt.phi, axis=0) / np.diff(TIMES)[:, None]
        assert np.all(np.isfinite(rate))
    assert np.array_equal(runs[0].joints.force, runs[1].joints.force)


def test_a_run_goes_on_from_its_final_state(params: bd.Params, start: bd.State) -> None:
    """Its speed is that of the motion there, of an angle to 1e-6."""
    for motion in (RAMP, wave, bd.Motion(angle=wave_angle)):
        half = run(params, start, {0: motion}, t_end=0.01, t_eval=[0.01])
        rest = run(params, half.final_state, {0: motion}, t_eval=[T_END])
        whole = run(params, start, {0: motion}, t_eval=[T_END])
        apart = rest.joints.force[-1] - whole.joints.force[-1]
        assert np.max(np.abs(apart)) <= 20 * 1e-4 * tension(params)


def test_the_speed_of_the_start_must_fit(params: bd.Params, start: bd.State) -> None:
    message = (
        "the prescribed motion of pulley 0 begins with -50 rad/s at t = 0 s, but in the initial "
        "state it turns at 0 rad/s: begin with that speed, or start from a state that has the "
        "other (State.at_speed)"
    )
    for motion in (bd.PiecewiseLinear([0.0], [-50.0]), lambda t: -50.0):
        with refused(ValueError, message):
            run(params, start, {0: motion})
    with pytest.raises(ValueError, match="begins with -50"):
        run(params, start, {0: bd.Motion(angle=lambda t: -50.0 * t)})
    nearly = start.at_speed(params, {0: -50.0 * (1.0 + 5e-10)})
    run(params, nearly, {0: lambda t: -50.0}, t_end=1e-3, t_eval=[])
    with pytest.raises(ValueError, match=r"^the rims of pulleys 1 and 0 must run at one speed"):
        bd.simulate(params, FREE, T_END, {0: lambda t: -50.0, 1: lambda t: -49.0})


ONE_VALUE = "must be a PiecewiseLinear with one value per time"
JUMP = bd.PiecewiseLinear([0.0, 0.1, 0.1], [0.0, 1.0, 2.0])
#: By whom: a run given these motions, a `Motion` of these arguments, a state set to these speeds.
REFUSED = [
    ("run", [RAMP], TypeError, "motion must be a mapping from a pulley's index or name to"),
    ("run", {2: RAMP}, ValueError, "motion index must be an integer from 0 to 1, got 2"),
    ("run", {-1: RAMP}, ValueError, "motion index must be an integer from 0 to 1, got -1"),
    ("run", {"0": RAMP}, TypeError, "motion index must be an integer from 0 to 1"),
    ("run", {True: RAMP}, TypeError, "motion index must be an integer"),
    ("run", {0: attrs.evolve(RAMP, pulley=0)}, ValueError, r"motion\[0\] must not name a pulley"),
    *(("run", {0: one}, TypeError, rf"motion\[0\] {ONE_VALUE}") for one in (None, -50.0, FREE)),
    ("run", {0: LOAD}, ValueError, r"motion\[0\] must have one value per time, got .* \(2, 2\)"),
    ("run", {1: JUMP}, ValueError, r"motion\[1\] must not jump, .*: it holds the time 0.1 s twice"),
    ("motion", {}, TypeError, "Motion takes either speed or angle"),
    ("motion", {"speed": wave, "angle": wave}, TypeError, "Motion takes either speed or angle"),
    (
        "motion",
        {"angle": RAMP},
        ValueError,
        "Motion.angle must not be a PiecewiseLinear, for the s",
    ),
    ("motion", {"angle": FREE}, TypeError, r"Motion.angle must be a function f\(t\), got"),
    ("motion", {"angle": 1.0}, TypeError, r"Motion.angle must be a function f\(t\), got 1.0"),
    ("motion", {"speed": LOAD}, ValueError, "Motion.speed must have one value per time"),
    ("motion", {"speed": "fast"}, TypeError, "Motion.speed must be a PiecewiseLinear"),
    ("state", [1.0, 1.0], TypeError, "omega must be a mapping from pulleys to speeds"),
    ("state", {}, ValueError, "omega must name at least one pulley"),
    ("state", {2: 1.0}, ValueError, "omega index must be an integer from 0 to 1, got 2"),
    ("state", {"0": 1.0}, TypeError, "omega index must be an integer"),
    ("state", {0: math.nan}, ValueError, r"omega\[0\] must be finite"),
    ("state", {0: None}, TypeError, r"omega\[0\] must be a real number"),
    ("state", {0: 1.0, 1: 2.0}, ValueError, "the rims of pulleys 1 and 0 must run at one speed"),
]


@pytest.mark.parametrize(("by", "given", "error", "message"), REFUSED)
def test_bad_motions_and_speeds(
    by: str, given: Any, error: type[Exception], message: str, params: bd.Params, start: bd.State
) -> None:
    with pytest.raises(error, match=f"^{message}"):
        if by == "run":
            bd.simulate(params, LOAD, 1.0, given)
        elif by == "motion":
            bd.Motion(**given)
        else:
            start.at_speed(params, given)


def test_one_value_per_time_is_for_one_pulley(params: bd.Params) -> None:
    flat = bd.PiecewiseLinear([0.0, 1.0], [0.0, 2.0])
    assert flat == bd.PiecewiseLinear([0.0, 1.0], [[0.0], [2.0]])
    assert flat.n_pulleys == 1
    with pytest.raises(ValueError, match=r"one torque for each of the 2 pulley.*a torque for 1"):
        bd.simulate(params, flat, 1.0)


@pytest.mark.parametrize(
    ("motion", "error", "message"),
    [
        (3, TypeError, "motion must be a sequence of tuples, got int"),
        ([3], ValueError,
         "motion[0] must be (pulley, 'piecewise', t, values), (pulley, 'crank', t, values, orders, "
         "amplitudes, phases, fade), (pulley, 'speed', call) or (pulley, 'angle', call), got 3"),
        ([(0, "crank", [0.0], [1.0])], ValueError,
         "motion[0] must be (pulley, 'piecewise', t, values), (pulley, 'crank', t, values, orders, "
         "amplitudes, phases, fade), (pulley, 'speed', call) or (pulley, 'angle', call), got "
         "(0, 'crank', [0.0], [1.0])"),
        ([(0, "crank", [0.0], [0.0], [1.0, 2.0], [0.1], [0.0, 0.0], (0, 0))], ValueError,
         "motion[0] amplitudes must have shape (2,), got (1,)"),
        ([(0, "crank", [0.0], [0.0], [-1.0], [0.1], [0.0], (0, 0))], ValueError,
         "motion 0: orders must be finite and > 0, orders[0] is -1"),
        ([(0, "crank", [0.0], [0.0], [1.0], [0.1], [0.0], (1, 0))], ValueError,
         "motion 0: fade must be two finite times, the end not before the beginning; got 1 and 0"),
        ([(0, "speed", 3)], TypeError, "motion[0] must hold a callable, got int"),
        ([("a", "speed", wave)], TypeError, "motion[0] pulley must be an integer, got str"),
        ([(2, "speed", wave)], ValueError,
         "motion 0: pulley must be one of 0 to 1 that has no motion yet, got 2"),
        ([(0, "speed", wave), (0, "angle", wave)], ValueError,
         "motion 1: pulley must be one of 0 to 1 that has no motion yet, got 0"),
        ([(0, "piecewise", [], [])], ValueError, "motion 0: t must not be empty"),
        ([(0, "piecewise", [0.0, 0.0], [0.0, 1.0])], ValueError,
         "motion 0: t must be finite and increasing, for a speed cannot jump; t[1] is 0"),
        ([(0, "piecewise", [0.0, 1.0], [0.0])], ValueError,
         "motion[0] must have shape (2,), got (1,)"),
    ],
)  # fmt: skip
def test_the_core_names_bad_motions(
    motion: Any, error: type[Exception], message: str, model: Any, rest: Any
) -> None:
    with refused(error, message):
        _core.Simulation(model, rest, TORQUE, 0.02, motion=motion)


def failing(kind: type[BaseException], after: float) -> Callable[[float], float]:
    def motion(t: float) -> float:
        if t > after:
            raise kind("mine")
        return wave(t)

    return motion


@pytest.mark.parametrize("of", ["speed", "angle"])
def test_exceptions_come_out_unchanged(of: str, params: bd.Params, start: bd.State) -> None:
    motion = {0: bd.Motion(**{of: failing(ZeroDivisionError, 0.011)})}
    with pytest.raises(ZeroDivisionError, match=r"^mine") as caught:
        run(params, start, motion)
    result = caught.value.result  # type: ignore[attr-defined]
    assert 0.0105 < result.final_state.t <= 0.011 and result.status == "failed"
    assert "a torque or motion function raised ZeroDivisionError" in caught.value.__notes__[0]
    motion = {0: bd.Motion(**{of: failing(KeyboardInterrupt, 0.011)})}
    with pytest.raises(bd.Interrupted) as stopped:
        run(params, start, motion)
    assert 0.0105 < stopped.value.result.final_state.t <= 0.011
    for initial in (None, start):  # before the first step
        with pytest.raises(ZeroDivisionError, match=r"^mine") as caught:
            run(params, initial, {0: bd.Motion(**{of: failing(ZeroDivisionError, -1.0)})})
        assert caught.value.result is None  # type: ignore[attr-defined]


def test_values_that_are_not_finite_or_of_another_kind(params: bd.Params, start: bd.State) -> None:
    for value in (math.nan, math.inf):
        message = (
            r"^the prescribed speed of pulley 1 is (nan|inf) at t = 0\.01\d* s: it must be finite"
        )
        with pytest.raises(bd.SimulationError, match=message) as caught:
            run(params, start, {1: lambda t, value=value: value if t > 0.01 else 0.0})
        assert caught.value.symbol == "BD_ERR_TORQUE_VALUE"
        assert caught.value.pulley == 1
        assert caught.value.result.t.size > 10
    for wrong in (None, "1", [1.0], True, 1j):
        for initial in (None, start):
            message = r"^what the motion of pulley 0 returns must be a real"
            with pytest.raises(TypeError, match=message):
                run(params, initial, {0: lambda t, wrong=wrong: wrong})


def test_functions_are_called_within_the_run_alone(params: bd.Params, start: bd.State) -> None:
    """And on one side of a break, for their derivatives too."""
    seen: list[float] = []

    def motion(t: float) -> float:
        seen.append(t)
        return wave(t)

    late = attrs.evolve(start, t=0.001, omega=[wave(0.001), 0.0])
    run(params, late, {0: motion}, t_eval=[T_END])
    assert min(seen) == 0.001 and max(seen) == T_END


MOTIONS: dict[str, list[tuple[Any, ...]]] = {
    "piecewise": [(0, "piecewise", [0.0, 0.004, 0.012], [0.0, -4.0, -20.0])],
    "speed": [(0, "speed", wave)],
    "angle and speed": [(1, "angle", wave_angle), (0, "speed", wave)],
    "crank": [
        (0, "crank", [0.0, 0.015], [0.0, -20.0], [2.0, 3.5], [0.01, 2e-3], [0.3, 1.0], (2e-3, 9e-3))
    ],
}


@pytest.mark.parametrize(
    ("kind", "method"),
    [("piecewise", "rk4"), ("speed", "tsit5"), ("angle and speed", "lbdf2"), ("speed", "auto"),
     ("crank", "rodas4")],
)  # fmt: skip
def test_a_run_goes_on_from_its_record(kind: str, method: str, model: Any, rest: Any) -> None:
    def make(motion: Any = MOTIONS[kind]) -> tuple[Any, Any]:
        simulation = _core.Simulation(
            model, rest, [("viscous", [0.0, 1.0])], T_END, method=method, motion=motion
        )
        return simulation, simulation.sample(TIMES)

    def end(simulation: Any) -> bytes:
        assert simulation.advance(INF) is True
        return pickle.dumps([simulation.state(), simulation.stats, simulation.warnings])

    whole, expected = make()
    final = end(whole)
    stopped, _ = make()
    for _ in range(3):
        stopped.advance(0.0)
        later, samples = make()
        later.import_record(stopped.export_record())
        first = later.samples
        assert end(later) == final
        assert same_bits(
            {name: rows[first:] for name, rows in samples.items()},
            {name: rows[first:] for name, rows in expected.items()},
        )
    others: list[Any] = [(0, "piecewise", [0.0, 0.004, 0.012], [0.0, -4.0, -21.0])]
    if kind == "crank":
        crank = MOTIONS[kind][0]
        changes = ((4, [2.0, 3.6]), (5, [0.01, 3e-3]), (6, [0.3, 1.1]), (7, (2e-3, 8e-3)))
        others += [(*crank[:at], value, *crank[at + 1 :]) for at, value in changes]
    for motion in others:
        with pytest.raises(ValueError, match="the record is of another run"):
            make([motion])[0].import_record(stopped.export_record())


def test_a_twin_follows_the_motion(model: Any) -> None:
    """A drive so lightly damped that a twin runs: no difference grows but by the displacement, with
    the torques of the run and the motion called again; the samples are those without guards.
    """
    light = make_model(
        belt=(1.2, 24, 0.1, 70e3, 0.02, 0.01, 0.0), contact=(0.0, 2.5e7, 100.0, 0, 0.0)
    )
    settling = _core.Simulation.settle(light, tolerance=1e-5)
    assert settling.advance(INF) is True

    def torque(_t: float, _theta: Any, omega: Any) -> list[float]:
        return [0.0, -omega[1]]

    rows = []
    for guards in (True, False):
        simulation = _core.Simulation(
            light, settling.state(), [("call", torque)], T_END, method="tsit5",
            motion=MOTIONS["speed"], guards=guards,
        )  # fmt: skip
        rows.append(simulation.sample(TIMES))
        assert simulation.advance(INF) is True
        assert (simulation.stats["twin_steps"] > 100) == guards
        assert not any(one["code"] == "growth" for one in simulation.warnings)
    assert same_bits(*rows)


def test_off_costs_nothing(model: Any, rest: Any) -> None:
    """No pass, no number more in the record, the same bits."""
    runs = []
    for options in ({}, {"motion": ()}, {"motion": MOTIONS["piecewise"]}):
        simulation = _core.Simulation(model, rest, TORQUE, 0.02, method="rodas4", **options)
        samples = simulation.sample(TIMES)
        simulation.advance(0.0)
        runs.append((simulation, simulation.export_record(), samples))
        assert simulation.advance(INF) is True
    (plain, record, samples), (none, none_record, none_samples), (on, on_record, _) = runs
    assert none.passes == plain.passes and none_record == record
    assert same_bits(samples, none_samples)
    assert plain.warnings == none.warnings
    more = {"prescribed motion", "torques of prescribed motion"}
    assert set(on.passes) - set(plain.passes) == more
    assert len(on_record) > len(record)


def scene_with(motion: Any) -> bd.Scene:
    return bd.Scene(params_with(), LOAD, 0.002, motion)


def test_scenes_in_files(tmp_path: Path) -> None:
    scene = scene_with({0: RAMP})
    text = scene.to_toml(tmp_path / "scene.toml")
    assert "[[motion]]" in text and "values = [0.0, -4.0, -20.0]" in text
    assert bd.Scene.from_toml(text) == scene
    assert bd.Scene.from_toml(scene_with(None).to_toml()) == scene_with(None)
    wrapped = scene_with({0: bd.Motion(speed=RAMP)})
    assert bd.Scene.from_toml(wrapped.to_toml()) == scene
    printed = "motion of pulley 0: piecewise linear, 3 time(s) from 0 to 0.012 s, -20 to 0 rad/s"
    assert all(f"  {printed}" in str(one).splitlines() for one in (scene, wrapped))
    for motion in (wave, bd.Motion(angle=wave_angle)):
        with pytest.raises(TypeError, match=r"^motion\[1\] must be a speed that is a Piecewise"):
            scene_with({1: motion}).to_toml()
    with pytest.raises(ValueError, match=r"^motion index must be an integer from 0 to 1, got 3"):
        scene_with({3: RAMP}).to_toml()
    out = tmp_path / "run.npz"
    done = CliRunner().invoke(cli.main, ["run", str(tmp_path / "scene.toml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    loaded = bd.Result.load(out)
    assert "prescribed motion" in loaded.effects
    assert loaded.final_state.omega[0] == pytest.approx(-2.0, rel=1e-14)
    assert bd.simulate(*scene).final_state.omega[0] == loaded.final_state.omega[0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pulley = 0", "pulley = 2", "motion index must be an integer from 0 to 1, got 2"),
        ("pulley = 0", "pulley = -1", r"motion\[0\].pulley must be an integer >= 0, got -1"),
        ("pulley = 0", "", r"motion\[0\].pulley: missing"),
        ("values = [0.0, -4.0, -20.0]", "", r"motion\[0\].values: missing"),
        ("0.004", "0.0", r"motion\[0\] must not jump"),
        ("pulley = 0", "pully = 0\npulley = 0", r"motion\[0\].pully: unknown field"),
        ("[[motion]]", "[motion]", r"motion: must be an array of tables"),
        (
            "[[motion]]",
            '[[motion]]\npulley = 0\nkind = "piecewise_linear"\nt = [0.0]\nvalues = [0.0]\n'
            "[[motion]]",
            r"motion\[1\].pulley: pulley 0 has a motion already",
        ),
        (
            '[[motion]]\npulley = 0\nkind = "piecewise_linear"',
            '[[motion]]\npulley = 0\nkind = "steps"',
            r"motion\[0\].kind must be one of",
        ),
    ],
)
def test_bad_files(old: str, new: str, message: str) -> None:
    text = scene_with({0: RAMP}).to_toml()
    before, found, after = text.rpartition("[[motion]]")
    assert found
    changed = before + (found + after).replace(old, new, 1)
    with pytest.raises(ValueError, match=f"^{message}"):
        bd.Scene.from_toml(changed)
