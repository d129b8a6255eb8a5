"""Prescribed motion (MODEL section 5): against the oracle and closed forms, what it needs, what is
refused. Methods, ledger, records: test_drive_table.py; that it costs nothing when it is off:
test_off_is_free.py; starts at speed: test_start_at_speed.py.
"""

from __future__ import annotations

import itertools
import math
import pickle
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import attrs
import drives
import numpy as np
import pytest
import stored_runs
from module_common import INF, TORQUE, make_model, refused, same_bits

import beltdyn as bd
from beltdyn import _core
from beltdyn.loads.motions import in_core

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
    base = attrs.evolve(drives.plain(), **changes)
    drag = bd.Drag(coulomb=1.0, viscous=0.05, quadratic=1e-3)
    return attrs.evolve(base, pulleys=[attrs.evolve(base.pulleys[0], drag=drag), base.pulleys[1]])


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


@pytest.mark.parametrize("motion", [RAMP, bd.Motion(angle=wave_angle)])
def test_torque_is_what_friction_leaves(motion: Any, params: bd.Params, start: bd.State) -> None:
    """I dOmega/dt - friction + drag at every sample, from what else is reported of it."""
    result = run(params, start, {0: motion})
    if motion is RAMP:
        rates = np.diff(RAMP.values[:, 0]) / np.diff(RAMP.t)
        rate = np.select([TIMES <= 0.004, TIMES <= 0.012], rates, 0.0)
    else:
        rate = np.array([wave_rate(t) for t in TIMES])
    drag = np.array([free_drag(params, w) for w in result.pulleys.omega[:, 0]])
    center = params.pulleys[0].center
    lever = np.hypot(result.belt.x - center[0], result.belt.y - center[1])
    grip = np.sum(result.contact.friction * lever, axis=1, where=result.contact.pulley == 0)
    needed = params.pulleys[0].inertia * rate - grip + drag
    # an acceleration that is the second difference of an angle is known to 1e-6 (motion.c)
    share, size = 1e-9 if motion is RAMP else 1e-6, np.max(np.abs(needed))
    assert np.max(np.abs(result.pulleys.torque[:, 0] - needed)) <= share * size
    assert size > 20.0


def test_torque_functions_see_the_prescribed_speed(params: bd.Params, start: bd.State) -> None:
    """A coupling from pulley 0 to pulley 1, in an implicit and an explicit method."""

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


@pytest.mark.parametrize("method", ["tsit5", "lbdf2"])
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
    at = np.searchsorted(TIMES, 0.004)
    assert data.pulleys.theta[at, 0] == pytest.approx(-0.5 * 4.0 * 0.004, rel=1e-14)


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
    for method in ("rodas4", "lbdf2"):
        result = run(params, start, {0: RAMP, 1: wave}, torque_fn=FREE, method=method, rtol=1e-3)
        assert result.final_state.omega == pytest.approx([-20.0, wave(T_END)], rel=1e-15)
        assert abs(result.stats.balance) <= 0.02


def test_a_torque_on_a_moved_pulley_is_ignored_with_a_warning(
    params: bd.Params, start: bd.State
) -> None:
    expected = run(params, start, {0: RAMP})
    for torque in (bd.Viscous([1.0, 0.0]), bd.Load(0, coulomb=1.0)):
        with pytest.warns(bd.BeltdynWarning, match="^torque_ignored: the torque set on pulley 0, "):
            result = run(params, start, {0: RAMP}, torque_fn=LOAD + torque)
        (found,) = (one for one in result.warnings if one.code == "torque_ignored")
        assert found.where == "pulley 0" and not found.accuracy
        assert np.array_equal(result.joints.force, expected.joints.force)
        assert result.stats.error is not None


def test_a_state_at_speed() -> None:
    """Where the belt runs it has the pulleys' speed; links run along themselves and turn with the
    path: no joint is stretched but by the corners of the polygon, v times half the turn squared.
    """
    params = bd.scenes.three_pulleys().params
    rest = bd.settle(params)
    running = rest.at_speed(params, {1: 30.0})
    v, radii = 30.0 * params.pulleys[1].radius, np.array([one.radius for one in params.pulleys])
    assert running.omega[1] == 30.0
    # it sinks in by 0.1 % of a radius; tangents, of 60 links, turn 0.3 % less than their arcs
    assert running.omega == pytest.approx(v / radii, rel=5e-3)
    half = 0.5 * params.info["link_length"]
    ex, ey = np.cos(rest.phi), np.sin(rest.phi)
    # slower where links turn: their centres are inside of the polygon's corners
    along = running.vx * ex + running.vy * ey
    bound = 0.5 * (half / radii.min()) ** 2 + 5e-3
    assert along == pytest.approx(params.info["winding"] * v, rel=bound)
    assert np.array_equal(running.x, rest.x) and np.array_equal(running.mu, rest.mu)
    assert running.residual is None
    turning = half * np.array([ey, -ex]) * running.vphi
    left, right = ([running.vx, running.vy] + way * turning for way in (1.0, -1.0))
    rate = np.sum((left - np.roll(right, 1, axis=1)) * [ex, ey], axis=0)
    assert np.max(np.abs(rate)) <= v * (2.0 * half / radii.min()) ** 2


def test_a_run_may_begin_at_speed(params: bd.Params) -> None:
    """Of functions too; the belt goes on at its speed."""
    for motion in (
        {0: bd.Motion(angle=lambda t: -50.0 * t)},
        {0: lambda t: -50.0, 1: lambda t: -50.0},
    ):
        result = bd.simulate(params, FREE, T_END, motion, t_eval=TIMES)
        assert np.max(np.abs(result.pulleys.omega[:, 0] + 50.0)) <= 1e-7
        assert np.max(np.abs(result.pulleys.omega[:, 1] + 50.0)) <= 1.0  # creep, ripple


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
    ("run", [RAMP], TypeError, r"motion must be a mapping .* such as \{0: lambda t: 100.0\} \["),
    *(("run", {one: RAMP}, ValueError, f"motion index must be an integer from 0 to 1, got {one}")
      for one in (2, -1)),
    *(("run", {one: RAMP}, TypeError, "motion index must be an integer") for one in ("0", True)),
    ("run", {0: attrs.evolve(RAMP, pulley=0)}, ValueError, r"motion\[0\] must not name a pulley"),
    *(("run", {0: one}, TypeError, rf"motion\[0\] {ONE_VALUE}") for one in (None, -50.0, FREE)),
    ("run", {0: 100}, TypeError, rf"motion\[0\] {ONE_VALUE}.* got 100; .* lambda t: 100"),
    ("run", {0: True}, TypeError, rf"motion\[0\] {ONE_VALUE}.* True, a bool, which is no speed"),
    ("run", {0: lambda: 1.0}, TypeError, rf"motion\[0\] {ONE_VALUE}.* got <lambda>\(\)"),
    ("run", {0: LOAD}, ValueError, r"motion\[0\] must have one value per time, got .* \(2, 2\)"),
    ("run", {1: JUMP}, ValueError, r"motion\[1\] must not jump, .*: it holds the time 0.1 s twice"),
    ("motion", {}, TypeError, "Motion takes either speed or angle"),
    ("motion", {"speed": wave, "angle": wave}, TypeError, "Motion takes either speed or angle"),
    ("motion", {"angle": RAMP}, ValueError, "Motion.angle must not be a PiecewiseLinear, for the"),
    ("motion", {"angle": 1.0}, TypeError, r"Motion.angle must be a function f\(t\) or an Angle"),
    ("motion", {"speed": LOAD}, ValueError, "Motion.speed must have one value per time"),
    ("motion", {"speed": "fast"}, TypeError, "Motion.speed must be a PiecewiseLinear"),
    ("state", [1.0, 1.0], TypeError, "omega must be a mapping from pulleys to speeds"),
    ("state", {}, ValueError, "omega must name at least one pulley"),
    ("state", {2: 1.0}, ValueError, "omega index must be an integer from 0 to 1, got 2"),
    ("state", {0: math.nan}, ValueError, r"omega\[0\] must be finite"),
    ("state", {0: None}, TypeError, r"omega\[0\] must be a real number"),
    ("state", {0: 1.0, 1: 2.0}, ValueError, "the rims of pulleys 1 and 0 must run at one speed"),
]  # fmt: skip


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


@pytest.mark.parametrize(
    ("motion", "error", "message"),
    [
        (3, TypeError, "motion must be a sequence of tuples, got int"),
        ([(0, "crank", [0.0], [1.0])], ValueError,
         "motion[0] must be (pulley, 'piecewise', t, values), (pulley, 'crank', t, values, orders, "
         "amplitudes, phases, fade), (pulley, 'speed', call) or (pulley, 'angle', call), got "
         "(0, 'crank', [0.0], [1.0])"),
        ([(0, "crank", [0.0], [0.0], [1.0, 2.0], [0.1], [0.0, 0.0], (0, 0))], ValueError,
         "motion[0] amplitudes must have shape (2,), got (1,)"),
        ([(0, "speed", 3)], TypeError, "motion[0] must hold a callable, got int"),
        ([(0, "speed", wave), (0, "angle", wave)], ValueError,
         "motion 1: pulley must be one of 0 to 1 that has no motion yet, got 0"),
        ([(0, "piecewise", [], [])], ValueError, "motion 0: t must not be empty"),
        ([(0, "piecewise", [0.0, 0.0], [0.0, 1.0])], ValueError,
         "motion 0: t must be finite and increasing, for a speed cannot jump; t[1] is 0"),
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
    note = caught.value.__notes__[0]
    assert note.startswith("ZeroDivisionError of a torque or motion function ended the run, which ")
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
        message = r"^the prescribed speed of pulley 1 is (nan|inf) at t = 0\.01\d* s: it must be fi"
        with pytest.raises(bd.SimulationError, match=message) as caught:
            run(params, start, {1: lambda t, value=value: value if t > 0.01 else 0.0})
        assert caught.value.symbol == "BD_ERR_TORQUE_VALUE"
        assert caught.value.pulley == 1
        assert caught.value.result.t.size > 10
    message = r"^what the motion of pulley 0 returns \(<lambda> at t = 0 s\) must be a real"
    for wrong, initial in itertools.product((None, "1", [1.0], True, 1j), (None, start)):
        with pytest.raises(TypeError, match=message):
            run(params, initial, {0: lambda t, wrong=wrong: wrong})
    with pytest.raises(TypeError, match=r"^what the motion of pulley 0 returns") as returned:
        run(params, start, {0: lambda t: 0.0 if t < 0.011 else "1"})
    assert "raised" not in returned.value.__notes__[0]


def test_functions_are_called_within_the_run_alone(params: bd.Params, start: bd.State) -> None:
    """And on one side of a break, for their derivatives too."""
    seen: list[float] = []

    def motion(t: float) -> float:
        seen.append(t)
        return wave(t)

    late = attrs.evolve(start, t=0.001, omega=[wave(0.001), 0.0])
    run(params, late, {0: motion}, t_eval=[T_END])
    assert min(seen) == 0.001 and max(seen) == T_END


def test_a_record_of_another_motion_is_refused(model: Any, rest: Any) -> None:
    """Of other numbers, or of a function where data were."""
    crank = [0, "crank", [0.0, 0.015], [0.0, -20.0], [2.0, 3.5], [0.01, 2e-3], [0.3, 1.0],
             (2e-3, 9e-3)]  # fmt: skip
    changes = ((3, [0.0, -21.0]), (4, [2.0, 3.6]), (5, [0.01, 3e-3]), (6, [0.3, 1.1]),
               (7, (2e-3, 8e-3)))  # fmt: skip
    motions = [crank, crank, *([*crank[:at], value, *crank[at + 1 :]] for at, value in changes)]
    motions += [(0, "piecewise", *crank[2:4]), (0, "speed", wave), (0, "angle", wave)]
    runs = [_core.Simulation(model, rest, TORQUE, T_END, motion=[tuple(m)]) for m in motions]
    runs[0].advance(0.0)
    record = runs[0].export_record()
    runs[1].import_record(record)
    for other in runs[2:]:
        with pytest.raises(ValueError, match="the record is of another run"):
            other.import_record(record)


def test_a_twin_follows_the_motion() -> None:
    """A drive so lightly damped that a twin runs: no difference grows but by the displacement, with
    the torques of the run and the motion called again; the samples are those without guards.
    """
    light = make_model(
        belt=(1.2, 24, 0.1, 70e3, 0.02, 0.01, 0.0), contact=(0.0, 2.5e7, 100.0, 0, 0.0)
    )
    settling = _core.Simulation.settle(light, tolerance=1e-5)
    assert settling.advance(INF) is True
    torque, rows = [("call", lambda _t, _theta, omega: [0.0, -omega[1]])], []
    for guards in (True, False):
        simulation = _core.Simulation(
            light, settling.state(), torque, T_END, method="tsit5", motion=[(0, "speed", wave)],
            guards=guards,
        )  # fmt: skip
        rows.append(simulation.sample(TIMES))
        assert simulation.advance(INF) is True
        assert (simulation.stats["twin_steps"] > 100) == guards
        assert not any(one["code"] == "growth" for one in simulation.warnings)
    assert same_bits(*rows)


def scene_with(motion: Any) -> bd.Scene:
    return bd.Scene(params_with(), LOAD, 0.002, motion)


#: Angles of a speed that swings by a tenth at 12 Hz, 33 samples a period.
ANGLE_TIMES = np.linspace(0.0, 1.0, 401)
SWING = 2.0 * math.pi * 12.0
ANGLES = 40.0 * ANGLE_TIMES + 4.0 / SWING * np.sin(SWING * ANGLE_TIMES)


def test_measured_angles() -> None:
    """Their speed is that of the motion: of exact angles to the spline's h^3 w^4 / 24 of the swing,
    and their angle to h^2 w^2 / 12 of it. Noise of 1e-3 rad, 2 rad/s from sample to sample, is
    filtered out: of white noise below the cutoff f the speed keeps a root mean square of
    sigma 2 pi f sqrt(2 f h / 3), here 0.02 rad/s; at most five times that away from the ends.
    """
    t, h = ANGLE_TIMES, ANGLE_TIMES[1]
    exact = bd.AngleTable(t, ANGLES)
    speeds = exact.speed.values[:, 0]
    amplitude = 4.0 / SWING
    inner = slice(5, -5)
    truth = 40.0 + 4.0 * np.cos(SWING * t)
    assert np.abs(speeds - truth)[inner].max() <= amplitude * SWING**5 * h**4 / 100
    angle = np.concatenate([[0.0], np.cumsum(0.5 * h * (speeds[1:] + speeds[:-1]))])
    assert np.abs(angle - ANGLES).max() <= 1.1 * amplitude * (SWING * h) ** 2 / 12
    noisy = ANGLES + 1e-3 * np.random.default_rng(1).standard_normal(t.size)
    filtered = bd.AngleTable(t, noisy, cutoff=30.0)
    kept = 1e-3 * 2.0 * math.pi * 30.0 * math.sqrt(2.0 * 30.0 * h / 3.0)
    at = filtered.speed.t
    off = np.abs(filtered.speed.values[:, 0] - 40.0 - 4.0 * np.cos(SWING * at))
    assert off[(at > 0.05) & (at < 0.95)].max() <= 5.0 * kept
    assert bd.AngleTable(t, noisy, cutoff=3.0).speed.t.size == 1 + 60  # 20 knots a period
    # more slowly than that, uneven samples are as good
    uneven = t + 0.3 * h * np.sin(np.arange(t.size))
    assert np.all(np.diff(uneven) > 0.0)
    of_uneven = 40.0 * uneven + amplitude * np.sin(SWING * uneven)
    one = bd.AngleTable(uneven, of_uneven).speed
    assert np.abs(one.values[:, 0] - 40.0 - 4.0 * np.cos(SWING * one.t))[inner].max() < 0.01


def test_a_run_follows_measured_angles() -> None:
    """As it follows the speed that they give; also through a file, and as Motion.angle."""
    table = bd.AngleTable(ANGLE_TIMES, ANGLES, cutoff=100.0)
    runs = [
        bd.simulate(params_with(), LOAD, 0.02, {0: motion})
        for motion in (table, bd.Motion(angle=table), table.speed)
    ]
    for run in runs:
        assert np.array_equal(run.pulleys.omega, runs[0].pulleys.omega)
        expected = [table.speed.at(t)[0] for t in run.t]
        np.testing.assert_allclose(run.pulleys.omega[:, 0], expected, rtol=1e-12)
    for motion in (table, bd.Motion(angle=table)):
        scene = scene_with({0: motion})
        assert 'kind = "angle_table"' in scene.to_toml()
        assert bd.Scene.from_toml(scene.to_toml()).motion == {0: table}
        assert "motion of pulley 0: angles at 401 times from 0 to 1 s, filtered at" in str(scene)
        assert in_core(motion)
    assert pickle.loads(pickle.dumps(table)) == table == eval(repr(table), vars(bd))


def test_a_scene_with_motions_that_are_none_says_so_when_it_is_printed() -> None:
    scene = bd.Scene(params_with(), LOAD, 0.1, "crank")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"^motion must be a mapping from a pulley's index"):
        str(scene)


def test_kinks_and_noise_of_measured_angles_are_refused() -> None:
    """By name and time; a run-up of 20 samples is neither, nor is noise below the acceleration.

    Of white noise with the deviation of the motion's own second difference, the fourth difference,
    halved, is 4.2 of these, what it is compared with 2.6; of a twentieth of that 0.2, and 1.
    """
    t, rng = ANGLE_TIMES, np.random.default_rng(2)
    kinked = np.where(t < 0.5, 40.0 * t, 20.0 + 10.0 * (t - 0.5))
    with pytest.raises(ValueError, match=r"kinks at t = 0\.5 s: the speed jumps by up to 30 rad/s"):
        bd.AngleTable(t, kinked)
    with pytest.raises(ValueError, match=r"is noisy: .* give cutoff"):
        bd.AngleTable(t, ANGLES + 1e-3 * rng.standard_normal(t.size))
    own = np.median(np.abs(np.diff(ANGLES, 2)))
    for part in (0.05, 1.0):
        noise = part * own * rng.standard_normal(t.size)
        with pytest.raises(ValueError, match="is noisy") if part == 1.0 else nullcontext():
            bd.AngleTable(t, ANGLES + 260.0 * t + noise)  # none a jump beside this speed
    rounded = bd.AngleTable(t, kinked, cutoff=40.0).speed
    assert rounded.at(0.4)[0] == pytest.approx(40.0, abs=0.01)
    assert rounded.at(0.6)[0] == pytest.approx(10.0, abs=0.01)
    bd.AngleTable(
        t[:60], 500.0 * np.minimum(t[:60], 0.05) ** 2 + 50.0 * np.maximum(t[:60] - 0.05, 0)
    )
    for changes, message in (
        ({"t": [0.0, 1.0, 2.0]}, r"AngleTable\.t must hold at least four times"),
        ({"t": [0.0, 1.0, 1.0, 2.0]}, r"AngleTable\.t must hold at least four times that increase"),
        ({"angle": [0.0, 1.0]}, r"AngleTable\.angle must have one value for each of the 401 times"),
        ({"cutoff": 300.0}, r"AngleTable\.cutoff must be between 1 Hz, .* and 200 Hz"),
        ({"cutoff": 0.0}, r"AngleTable\.cutoff must be > 0"),
        ({"angle": (40.0 * t) % (2.0 * np.pi), "cutoff": 40.0}, "turns taken off, at t = 0.1575 s"),
        ({"angle": np.degrees(40.0 * t) % 360.0, "cutoff": 40.0}, "in degrees, at t = 0.1575 s"),
        ({"angle": np.degrees(-40.0 * t) % 360.0, "cutoff": 40.0}, "in degrees, at t = 0.0025 s"),
    ):
        with pytest.raises(ValueError, match=message):
            bd.AngleTable(**({"t": t, "angle": ANGLES} | changes))


def test_scenes_in_files() -> None:
    scene = scene_with({0: RAMP})
    text = scene.to_toml()
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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pulley = 0", "pulley = 2", "motion index must be an integer from 0 to 1, got 2"),
        ("pulley = 0", "pulley = -1", r"motion\[0\].pulley must be an integer >= 0, got -1"),
        ("pulley = 0", "", r"motion\[0\].pulley: missing"),
        ("values = [0.0, -4.0, -20.0]", "", r"motion\[0\].values: missing"),
        ("0.004", "0.0", r"motion\[0\] must not jump"),
        ("pulley = 0", "pully = 0\npulley = 0", r"motion\[0\].pully: unknown field"),
        ("[[motion]]", "[motion]", r"motion: must be an array of tables, \[\[motion\]\]"),
        ("[[motion]]", '[[motion]]\npulley = 0\nkind = "piecewise_linear"\nt = [0.0]\n'
         "values = [0.0]\n[[motion]]", r"motion\[1\].pulley: pulley 0 has a motion already"),
        ('"piecewise_linear"', '"steps"', r"motion\[0\].kind must be one of"),
    ],
)  # fmt: skip
def test_bad_files(old: str, new: str, message: str) -> None:
    before, found, after = scene_with({0: RAMP}).to_toml().rpartition("[[motion]]")
    with pytest.raises(ValueError, match=f"^{message}"):
        bd.Scene.from_toml(before + (found + after).replace(old, new, 1))
