"""Loads on single pulleys, harmonics, and the motion of an uneven crank (MODEL section 5): values
and slopes against NumPy, closed forms of free pulleys, what is refused. Methods, the ledger and
files with them: test_drive_table.py.
"""

from __future__ import annotations

import math
import pickle
from typing import Any

import attrs
import drives
import numpy as np
import pytest

import beltdyn as bd
from beltdyn.loads.motions import in_core
from beltdyn.verification.runs import evaluated_in_core

pytestmark = pytest.mark.filterwarnings("ignore:(mesh|no_friction|units):UserWarning")

NOTHING = bd.Viscous([0.0, 0.0])
#: Of pulleys on a belt that they do not move.
SPEEDS = (-7.0, 5.0)
TABLE = bd.SpeedTable(1, [2.0, 4.0, 8.0], [1.0, 3.0, 2.0])
ORDERS, AMPLITUDES, PHASES = np.array([0.5, 2.0, 3.7]), np.array([2.0, 1.0, 0.3]), [0.2, -1.0, 2.0]
#: Drives, brakes, and is not 0 at rest; of either sign of the speed.
MOTOR = bd.Motor(1, [-6.5, -2.0, 4.0], [3.0, -1.0, 2.0])
HARMONICS = bd.Harmonics(0, ORDERS, AMPLITUDES, PHASES)


@pytest.fixture(scope="module")
def free() -> bd.Params:
    """Two pulleys on a belt without friction, of 0.01 kg m^2 each."""
    return attrs.evolve(drives.plain(), friction=None)


@pytest.fixture(scope="module")
def rest(free: bd.Params) -> bd.State:
    return bd.settle(free)


def turning(rest: bd.State, *omega: float, theta: tuple[float, float] = (0.0, 0.0)) -> bd.State:
    return attrs.evolve(rest, omega=omega or SPEEDS, theta=theta)


def omega_0(params: bd.Params) -> float:
    """As MODEL section 5 states it, of a pulley of 0.1 m."""
    belt = params.belt
    wave = math.sqrt(belt.axial_stiffness / belt.linear_density)
    return 1e-3 * params.info["strain"] * wave / 60 / 0.1


def sign(omega: Any, w0: float) -> Any:
    return omega / np.sqrt(omega**2 + w0**2)


def load_law(theta: Any, omega: Any, w0: float) -> Any:
    w = omega[:, 1]
    return -(0.4 * sign(w, w0) + 0.02 * w + 3e-3 * w * np.abs(w))


def table_law(theta: Any, omega: Any, w0: float) -> Any:
    w = omega[:, 1]
    return -sign(w, w0) * np.interp(np.abs(w), TABLE.omega, TABLE.torque)


def motor_law(theta: Any, omega: Any, w0: float) -> Any:
    return np.interp(omega[:, 1], MOTOR.omega, MOTOR.torque)


def harmonic_law(of: int) -> Any:
    def law(theta: Any, omega: Any, w0: float) -> Any:
        return np.cos(np.multiply.outer(theta[:, of], ORDERS) + PHASES) @ AMPLITUDES

    return law


LAWS: dict[str, tuple[bd.Torque, int, Any]] = {
    "load": (bd.Load(1, coulomb=0.4, viscous=0.02, quadratic=3e-3), 1, load_law),
    "table": (TABLE, 1, table_law),
    "motor": (MOTOR, 1, motor_law),
    "harmonics": (HARMONICS, 0, harmonic_law(0)),
    "harmonics of another": (attrs.evolve(HARMONICS, of=1), 0, harmonic_law(1)),
}


@pytest.mark.filterwarnings("ignore:beyond_table")
@pytest.mark.parametrize("kind", LAWS)
def test_values(kind: str, free: bd.Params, rest: bd.State) -> None:
    """Of every sample of a run through rest and through the table's points, with a factor over time
    that jumps, below 0 where it may: by the formulas of MODEL section 5, to rounding.
    """
    load, on, law = LAWS[kind]
    after = 2.0 if isinstance(load, (bd.Load, bd.SpeedTable)) else -2.0
    factor = bd.PiecewiseLinear([0.01, 0.02, 0.02, 0.03], [1.0, 0.5, after, 0.0])
    push = bd.Ramp(1, 0.0, 0.001, -6.0)
    for scale in (None, factor):
        scaled = attrs.evolve(load, factor=scale)  # type: ignore[misc]
        result = bd.simulate(
            free, scaled + push, 0.04, initial=turning(rest, theta=(0.3, -2.0)), rtol=1e-3
        )
        omega, theta = result.pulleys.omega, result.pulleys.theta
        assert omega[:, 1].min() < 0.0 < omega[:, 1].max()
        expected = law(theta, omega, omega_0(free))
        if scale is not None:  # at the jump, the sample is that before it
            before = result.t <= 0.02
            expected = expected * np.where(
                before,
                np.interp(result.t, [0.01, 0.02], [1.0, 0.5]),
                np.interp(result.t, [0.02, 0.03], [after, 0.0]),
            )
        torque = result.pulleys.torque.copy()
        torque[:, 1] += 6.0 * np.minimum(result.t / 0.001, 1.0)
        size = np.max(np.abs(expected))
        assert np.max(np.abs(torque[:, on] - expected)) <= 1e-13 * (size + 6.0)
        assert np.max(np.abs(torque[:, 1 - on])) <= 1e-13 * 6.0
        # the object called in Python: the same, but for the smooth sign, 2e-6 at 10 omega_0
        k = 3
        at_rest = abs(omega[k, 1]) < 1e3 * omega_0(free)
        called = (scaled + push)(result.t[k], theta[k], omega[k])
        assert not at_rest
        assert called == pytest.approx(result.pulleys.torque[k], abs=1e-6 * size + 1e-12)


def slopes(load: bd.Torque, theta: Any, omega: Any, w0: float) -> tuple[Any, Any]:
    """Derivatives (2, 2) to angles and speeds, written out."""
    by_theta, by_omega = np.zeros((2, 2)), np.zeros((2, 2))
    w = omega[1]
    rise = w0**2 / (w**2 + w0**2) ** 1.5
    if isinstance(load, bd.Load):
        by_omega[1, 1] = -(load.coulomb * rise + load.viscous + 2 * load.quadratic * abs(w))
    elif isinstance(load, bd.SpeedTable):
        at = np.interp(abs(w), load.omega, load.torque)
        inside = load.omega[0] < abs(w) < load.omega[-1]
        k = min(max(int(np.searchsorted(load.omega, abs(w))), 1), load.omega.size - 1)
        slope = inside * np.diff(load.torque)[k - 1] / np.diff(load.omega)[k - 1]
        by_omega[1, 1] = -(rise * at + abs(sign(w, w0)) * slope)
    elif isinstance(load, bd.Motor):
        inside = load.omega[0] < w < load.omega[-1]
        k = min(max(int(np.searchsorted(load.omega, w)), 1), load.omega.size - 1)
        by_omega[1, 1] = inside * np.diff(load.torque)[k - 1] / np.diff(load.omega)[k - 1]
    elif isinstance(load, bd.Harmonics):
        of = 0 if load.of is None else int(load.of)
        angles = load.orders * theta[of] + load.phases
        by_theta[0, of] = -np.sum(load.amplitudes * load.orders * np.sin(angles))
    return by_theta, by_omega


@pytest.mark.filterwarnings("ignore:(beyond_table|balance)")
@pytest.mark.parametrize("kind", LAWS)
def test_slopes(kind: str, free: bd.Params, rest: bd.State) -> None:
    """One step of Euler's linearly implicit method solves (1 - h J) dy = h f, with J those of the
    pulleys alone: speeds after it tell every derivative, a factor of 40 and a long step make them
    matter.
    """
    load, on, law = LAWS[kind]
    w0, inertia, eye = omega_0(free), 0.01, np.eye(2)
    for speed in (-9.0, -3.0, -0.5, 0.0, 0.5, 3.0, 6.0):
        h, factor = 1e-4, 40.0
        omega, theta = np.array([2.0, speed if speed else 0.5 * w0]), np.array([0.7, 1.9])
        if not speed and isinstance(
            load, (bd.Load, bd.SpeedTable)
        ):  # steep: 0.4 N m over 2 omega_0
            h, factor = 1e-6, 1.0
        constant = bd.PiecewiseLinear([0.0], [factor])
        scaled = attrs.evolve(load, factor=constant)  # type: ignore[misc]
        state = turning(rest, *omega, theta=(theta[0], theta[1]))
        result = bd.simulate(free, scaled + NOTHING, h, initial=state, method="lie", step=h)
        assert result.stats.steps == 1
        by_theta, by_omega = (factor * one / inertia for one in slopes(load, theta, omega, w0))
        f = np.zeros(2)
        f[on] = factor * law(theta[None], omega[None], w0)[0] / inertia
        matrix = np.block([[eye, -h * eye], [-h * by_theta, eye - h * by_omega]])
        explicit = h * np.concatenate([omega, f])
        step = np.linalg.solve(matrix, explicit)
        moved = result.final_state.omega - omega
        assert moved == pytest.approx(step[2:], rel=1e-9, abs=1e-12), speed
        flat = kind == "table" and speed in (-9.0, -0.5, 0.5)
        flat |= kind == "motor" and speed in (-9.0, 6.0)
        still = kind == "harmonics of another" and not speed
        if not (flat or still):  # the derivatives are seen
            assert np.max(np.abs(step - explicit)[2:]) > 1e-5 * np.max(np.abs(explicit[2:])), speed


def test_a_step_and_a_ramp_are_their_histories(free: bd.Params, rest: bd.State) -> None:
    loads = bd.Step(0, 0.004, -3.0) + bd.Ramp(1, 0.002, 0.006, 5.0)
    both = bd.PiecewiseLinear([0.002, 0.004, 0.004, 0.006], [[0, 0], [0, 2.5], [-3, 2.5], [-3, 5]])
    alone = bd.PiecewiseLinear([0.004, 0.004], [0, -3], pulley=0) + bd.PiecewiseLinear(
        [0.002, 0.006], [0, 5], pulley=1
    )
    one, other, third = (
        bd.simulate(free, torque, 0.01, initial=rest, rtol=1e-6) for torque in (loads, both, alone)
    )
    assert np.array_equal(one.pulleys.omega, third.pulleys.omega)
    np.testing.assert_allclose(one.pulleys.omega, other.pulleys.omega, rtol=1e-12, atol=1e-15)
    for t in (0.0, 0.003, 0.004, 0.005, 0.02):
        assert loads(t, [0, 0], [0, 0]) == pytest.approx(both(t, [0, 0], [0, 0]))


def test_terminal_speed(free: bd.Params, rest: bd.State) -> None:
    """A constant torque against a quadratic load: W tanh(t sqrt(M q) / I), with W = sqrt(M / q)."""
    m, q, inertia = 4.0, 1e-2, 0.01
    torque = bd.Step(0, 0.0, m) + bd.Load(0, quadratic=q)
    result = bd.simulate(free, torque, 0.3, initial=rest, rtol=1e-7)
    expected = math.sqrt(m / q) * np.tanh(result.t * math.sqrt(m * q) / inertia)
    assert np.max(np.abs(result.pulleys.omega[:, 0] - expected)) <= 1e-5 * math.sqrt(m / q)
    assert result.pulleys.omega[-1, 0] == pytest.approx(math.sqrt(m / q), rel=1e-4)
    table = bd.SpeedTable(0, np.linspace(0, 30, 301), q * np.linspace(0, 30, 301) ** 2)
    fine = bd.simulate(free, bd.Step(0, 0.0, m) + table, 0.3, initial=rest, rtol=1e-7)
    # chords of 0.1 rad/s lie up to q 0.1^2 / 4 above the parabola: 1e-5 N m of 4
    assert np.max(np.abs(fine.pulleys.omega - result.pulleys.omega)) <= 2e-5 * math.sqrt(m / q)


def test_harmonics_of_a_free_pulley(free: bd.Params, rest: bd.State) -> None:
    """I omega^2 / 2 is what the torque has worked over the angle, sum a sin(k theta + phi) / k."""
    state = turning(rest, -60.0, 5.0)
    for method in ("tsit5", "rodas4"):
        result = bd.simulate(free, HARMONICS, 0.3, initial=state, rtol=1e-7, method=method)
        theta = result.pulleys.theta[:, 0]
        work = np.sin(np.multiply.outer(theta, ORDERS) + PHASES) @ (AMPLITUDES / ORDERS)
        energy = 0.5 * 0.01 * 60.0**2 + work - work[0]
        expected = -np.sqrt(2.0 * energy / 0.01)
        assert np.max(np.abs(result.pulleys.omega[:, 0] - expected)) <= 1e-5 * 60.0
        assert np.ptp(expected) > 10.0  # the fluctuation, of 60 rad/s
        assert result.energy.drive[-1] == pytest.approx(work[-1] - work[0], abs=1e-4 * np.ptp(work))


LOADS = (
    bd.Ramp(0, 0.0, 0.01, -60.0),
    attrs.evolve(TABLE, factor=bd.PiecewiseLinear([0.02, 0.03], [0.0, 1.0])),
    bd.Load(1, coulomb=0.5, viscous=0.05, quadratic=2e-3),
    bd.Harmonics(1, [3.0], [2.0], of=0),
    bd.Step(1, 0.035, 5.0),
)
RAMPED = bd.Motor(1, [-3.0, 0.0, 5.0], [1.0, 2.0, -1.0], ramp=(0.01, 0.02))


def test_a_drive_answers_a_harmonic_torque_as_one_mass() -> None:
    """Far below the first torsional mode, 980 rad/s of these pulleys on their two spans: (I_0 + I_1
    + m r^2) omega^2 / 2 follows the work over the angle, less what the running belt has lost. The
    mode adds (25/980)^2 = 0.07 %, creep 15 N/EA = 2e-4 of 50 rad/s, links that run on and off some
    0.1 rad/s: 2 % of the swing of 10 rad/s.
    """
    params = attrs.evolve(drives.plain(), friction=bd.Dahl(mu_k=1.0, sigma=1e5))
    state = bd.settle(params).at_speed(params, {0: -50.0})
    settled = bd.simulate(params, NOTHING, 0.05, initial=state)
    wave = bd.Harmonics(0, [0.5], [3.0], [0.4], factor=bd.PiecewiseLinear([0.05, 0.05], [0, 1]))
    result = bd.simulate(params, wave + NOTHING, 0.4, initial=settled.final_state, rtol=1e-5)
    work = 6.0 * np.sin(0.5 * result.pulleys.theta[:, 0] + 0.4)
    mass = 0.02 + params.belt.length * params.belt.linear_density * 0.1**2
    mean, lost = float(result.pulleys.omega[0].mean()), result.energy.losses
    expected = -np.sqrt(mean**2 + 2.0 * (work - work[0] - lost) / mass)
    swing = np.ptp(expected)
    assert swing > 10.0 and lost[-1] < 0.1 * np.ptp(work)
    assert np.max(np.abs(result.pulleys.omega - expected[:, None])) <= 0.02 * swing


def test_the_fixed_step_follows_steep_loads(free: bd.Params, rest: bd.State) -> None:
    """Decay at 1e6 1/s, of each kind: the step of the joints would be beyond the stability limit,
    2.8e-6 s; a factor over time counts as well; harmonics of 1e6 rad/s make a pendulum.
    """
    w0, steep = omega_0(free), 1e6 * 0.01
    plain = bd.simulate(free, NOTHING, 1e-4, initial=turning(rest), method="rk4")
    assert plain.stats.largest_step > 5e-6
    tenth = bd.PiecewiseLinear([0.0], [0.1])
    for load in (
        bd.Load(0, viscous=steep),
        bd.Load(0, coulomb=steep * w0),
        bd.Load(0, coulomb=10 * steep * w0, factor=tenth),
        bd.SpeedTable(0, [1.0], [steep * w0]),
        bd.SpeedTable(0, [0.0, 1.0], [0.0, steep]),
        bd.Motor(0, [-1.0, 1.0], [steep, -steep]),
        bd.Harmonics(0, [1.0], [1e12 * 0.01], [math.pi / 2]),
    ):
        state = turning(rest, 0.3 * w0, 0.0, theta=(1e-9, 0.0))
        result = bd.simulate(free, load, 1e-4, initial=state, method="rk4")
        assert 1e-7 < result.stats.largest_step < 2.8e-6
        if isinstance(load, bd.Harmonics):
            swing = np.abs(result.pulleys.theta[:, 0]).max()
            assert swing <= 1.1 * (1e-9 + 0.3 * w0 / 1e6)
        elif not (isinstance(load, bd.SpeedTable) and load.omega[0] == 0.0):
            assert abs(result.pulleys.omega[-1, 0]) < 1e-9 * w0
        else:  # M = steep |omega|: quadratic near rest, and slow there
            assert abs(result.pulleys.omega[-1, 0]) < 0.3 * w0


def test_steps_see_the_highest_order(free: bd.Params, rest: bd.State) -> None:
    """Two a period at least, also where the torque is so small that its error would not matter; on
    a belt without friction there is nothing else to limit them. So for a crank's.
    """
    small = bd.Harmonics(0, [8.0], [1e-9])
    steady = {0: bd.PiecewiseLinear([0.0], [-100.0])}
    crank = {0: bd.CrankMotion(-100.0, [8.0], [1e-12], [math.pi / 2], fade=(0.0, 0.01))}
    for method, torque, without, motion in (
        ("rodas4", small, None, None),
        ("lbdf2", small, None, None),
        ("rodas4", NOTHING, steady, crank),
    ):
        options = {"initial": turning(rest, -100.0, 0.0), "rtol": 1e-2, "method": method}
        plain = bd.simulate(free, NOTHING, 0.2, without, **options)
        result = bd.simulate(free, torque, 0.2, motion, **options)
        assert plain.stats.largest_step > 2.0 * math.pi / 800.0
        assert result.stats.largest_step <= 1.0001 * math.pi / 800.0


def test_beyond_the_table(free: bd.Params, rest: bd.State) -> None:
    """A warning, once, that names the pulley and both speeds; not where the load is off, within a
    hundredth, or below the table.
    """
    table = bd.SpeedTable(0, [1.0, 8.0], [0.0, 0.0])
    off = attrs.evolve(table, factor=bd.PiecewiseLinear([0.0], [0.0]))
    motor = bd.Motor(0, [-8.0, 2.0], [0.0, 0.0])
    for speed, load, is_beyond in (
        (-9.0, motor, True), (-8.05, motor, False), (1.0, motor, False),
        (9.0, table, True), (-9.0, table, True), (8.05, table, False), (0.5, table, False),
        (9.0, off, False),
    ):  # fmt: skip
        with pytest.warns(bd.BeltdynWarning) as caught:
            result = bd.simulate(free, load, 0.001, initial=turning(rest, speed, 0.0))
        assert any(one.code == "beyond_table" for one in result.warnings) == is_beyond
        texts = [str(one.message) for one in caught if "beyond_table" in str(one.message)]
        assert len(texts) == is_beyond
        for text in texts:
            assert text.startswith(f"beyond_table: pulley 0 turns at {speed:g} rad/s at t = ")
            end = "-8" if load is motor else "8"
            assert f"faster than the table of its torque reaches, {end} rad/s" in text


def test_a_motor_starts_from_rest(free: bd.Params, rest: bd.State) -> None:
    """M = M_0 (1 - w / W) on a free pulley: w = W (1 - exp(-M_0 t / (W I))); with the torque rising
    within T, t^2 / 2T in place of t up to T, and t - T/2 after it. Clockwise the same.
    """
    m, top, inertia, rise = 5.0, 40.0, 0.01, 0.05
    for way, ramp in ((1.0, None), (-1.0, rise), (1.0, (0.0, rise))):
        speeds, torques = [-10.0, 50.0], [m * (1.0 + 10.0 / top), m * (1.0 - 50.0 / top)]
        if way < 0.0:
            speeds, torques = [-50.0, 10.0], [-torques[1], -torques[0]]
        motor = bd.Motor(0, speeds, torques, ramp=ramp)
        result = bd.simulate(free, motor, 0.2, initial=rest, rtol=1e-7)
        t = result.t
        time = t if ramp is None else np.where(t < rise, t**2 / (2 * rise), t - 0.5 * rise)
        expected = way * top * -np.expm1(-m * time / (top * inertia))
        assert np.max(np.abs(result.pulleys.omega[:, 0] - expected)) <= 1e-5 * top


@pytest.mark.parametrize("load", [bd.Load(0, coulomb=2.0), bd.SpeedTable(0, [0, 9], [2, 3])])
def test_a_load_turned_round_is_no_motor(load: Any) -> None:
    """It would never start: refused, with what is meant."""
    for values in ([-1.0], [1.0, -1e-3]):
        factor = bd.PiecewiseLinear(np.arange(float(len(values))), values)
        with pytest.raises(ValueError, match=r"factor must be >= 0: .* never starts; .* Motor"):
            attrs.evolve(load, factor=factor)
    with pytest.raises(ValueError, match=r"must be >= 0"):
        -1.0 * load


CRANK_SPEED = bd.PiecewiseLinear([0.01, 0.03, 0.06], [0.0, -30.0, -50.0])
CRANK = bd.CrankMotion(CRANK_SPEED, [1.5, 4.0], [0.02, 0.003], [0.3, -1.1], fade=(0.02, 0.05))


def crank_angle(t: Any) -> Any:
    """The motion of CRANK by its formula, in long double: its derivatives by differences."""
    t = np.asarray(t, dtype=np.longdouble)
    a = [np.longdouble(-30) / np.longdouble("0.02"), np.longdouble(-20) / np.longdouble("0.03")]
    first = np.clip(t - np.longdouble("0.01"), 0, np.longdouble("0.02"))
    second = np.clip(t - np.longdouble("0.03"), 0, np.longdouble("0.03"))
    third = np.maximum(t - np.longdouble("0.06"), 0)
    mean = a[0] * first**2 / 2 - 30 * second + a[1] * second**2 / 2 - 50 * third
    s = np.clip((t - np.longdouble("0.02")) / np.longdouble("0.03"), 0, 1)
    fade = s**3 * (10 - 15 * s + 6 * s**2)
    orders, sizes = (np.array(v, dtype=np.longdouble) for v in ((1.5, 4.0), (0.02, 0.003)))
    phases = np.array((0.3, -1.1), dtype=np.longdouble)
    return mean + fade * (np.cos(np.multiply.outer(mean, orders) + phases) @ sizes)


def test_crank_motion(free: bd.Params, rest: bd.State) -> None:
    """Angle, speed and the torque that the acceleration needs, at times away from the kinks, where
    differences over 10 us are right to 1e-9; to the last bits of the angle.
    """
    times = np.array([0.005, 0.015, 0.025, 0.033, 0.041, 0.049, 0.055, 0.065, 0.08])
    d = np.longdouble("1e-5")
    before, at, after = crank_angle(times - d), crank_angle(times), crank_angle(times + d)
    speed, rate = (after - before) / (2 * d), (after - 2 * at + before) / d**2
    for method in ("tsit5", "rodas4", "lbdf2", "rk4"):
        result = bd.simulate(
            free, NOTHING, 0.09, {0: CRANK}, initial=rest, t_eval=times, method=method, rtol=1e-3
        )
        angle = np.asarray(at - crank_angle(0.0), dtype=float)
        assert np.max(np.abs(result.pulleys.theta[:, 0] - angle)) <= 1e-14
        assert np.max(np.abs(result.pulleys.omega[:, 0] - np.float64(speed))) <= 1e-8 * 50.0
        # the third and fourth derivatives: (4 * 50)^4 * 0.003 * d^2 / 12 = 4e-5 of some 2000
        needed = 0.01 * np.float64(rate)
        assert np.max(np.abs(result.pulleys.torque[:, 0] - needed)) <= 1e-7 * np.max(np.abs(needed))
    assert np.ptp(np.float64(rate[5:])) > 100.0


def test_rodas4_knows_the_jerk_of_a_crank() -> None:
    """It comes as near to "tsit5" as is asked, 3e-7; with a torque that goes with the angle."""
    drive = drives.plain()
    options = {"initial": bd.settle(drive), "t_eval": np.linspace(0.0, 0.07, 71)}
    load = bd.Load(1, viscous=0.3) + bd.Harmonics(1, [2.0], [5.0], of=0)
    exact, fine = (
        bd.simulate(drive, load, 0.07, {0: CRANK}, method=method, rtol=rtol, **options)
        for method, rtol in (("tsit5", 1e-8), ("rodas4", 1e-7))
    )
    difference = np.sqrt(np.mean((exact.joints.force - fine.joints.force) ** 2))
    assert difference <= 3e-7 * drive.info["mean_tension"]


@pytest.mark.parametrize(
    ("speed", "fade", "mean", "angle"),
    [(-40.0, None, -40.0, 0.0), (-40.0, (-0.1, 0.1), -40.0, 0.0),
     (CRANK_SPEED, (-0.1, 0.1), 0.0, 0.0),
     (bd.PiecewiseLinear([-0.2, 0.5], [-9, -30]), (-0.1, 0.1), -15.0, -2.4)],
)  # fmt: skip
def test_a_run_begins_with_the_speed_of_the_crank(
    speed: Any, fade: Any, mean: float, angle: float, rest: bd.State
) -> None:
    """Also where the fluctuation has begun before."""
    drive = drives.plain()
    crank = bd.CrankMotion(speed, [2.0, 3.0], [0.02, 0.01], [0.3, 1.0], fade=fade)
    at = angle * crank.orders + crank.phases
    over_angle = -float((crank.orders * crank.amplitudes) @ np.sin(at))
    # half way through the fade s^3 (10 - 15 s + 6 s^2) is 1/2, its slope 30/16 over 0.2 s
    factor, slope = (1.0, 0.0) if fade is None else (0.5, 1.875 / 0.2)
    first = mean * (1.0 + factor * over_angle) + slope * float(crank.amplitudes @ np.cos(at))
    result = bd.simulate(drive, NOTHING, 0.002, {0: crank})
    assert result.pulleys.omega[0, 0] == pytest.approx(first, rel=1e-12)
    step = (result.pulleys.theta[1, 0] - result.pulleys.theta[0, 0]) / result.t[1]
    assert step == pytest.approx(result.pulleys.omega[:2, 0].mean(), rel=1e-6, abs=1e-12)
    if speed is not CRANK_SPEED:
        with pytest.raises(ValueError, match=r"begins with -.* rad/s at t = 0 s, but in the init"):
            bd.simulate(drive, NOTHING, 0.002, {0: crank}, initial=rest)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("kind = 'load'", "pulley: missing"),
        ("kind = 'load'\npulley = 2", "pulley index must be an integer from 0 to 1, got 2"),
        ("kind = 'load'\npulley = 'fan'", "pulley: no pulley is called 'fan'; there are pulley 0"),
        ("kind = 'load'\npulley = 1\ncoulom = 1", r"coulom: unknown field \(did you mean 'coul"),
        ("kind = 'load'\npulley = 1\nfactor = {t = [1, 0], values = [1, 1]}", "factor.t must be"),
        ("kind = 'speed_table'\npulley = 0\nomega = [1]\ntorque = [1, 2]",
         r"torque must have one value for each of the 1 speed\(s\), got 2"),
        ("kind = 'harmonics'\npulley = 0\norders = [1]\namplitudes = [1]\nof = 3",
         "of index must be an integer from 0 to 1, got 3"),
        ("kind = 'ramp'\npulley = 0\nt_begin = 1\nt_end = 1\ntorque = 1",
         r"t_end must be > t_begin \(1 s\), got 1 s: a jump is a Step"),
        ("kind = 'step'\npulley = 0\nt = nan\ntorque = 1", "t must be finite"),
        ("kind = 'piecewise_linear'\npulley = 0\nt = [0]\nvalues = [[1, 2]]",
         "values must have one column where the pulley is given"),
        ("kind = 'sped_table'", "kind must be one of piecewise_linear, viscous, load, speed_table"),
    ],
)  # fmt: skip
def test_bad_files(table: str, message: str) -> None:
    """Messages begin with the path of the field."""
    text = bd.Scene(drives.plain(), NOTHING, 0.1).to_toml() + f"\n[[torque]]\n{table}\n"
    with pytest.raises(ValueError, match=rf"^torque\[1\]\.{message}"):
        bd.Scene.from_toml(text)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        *((lambda of=of: bd.Load(of), TypeError, r"Load\.pulley must be a pulley's index or its n")
          for of in (None, True, "1", 1.0)),
        (lambda: bd.Load(-1), ValueError, r"Load\.pulley must be an integer >= 0, got -1"),
        (lambda: bd.Load(0, coulomb=-1), ValueError, r"Load\.coulomb must be >= 0, for it acts ag"),
        (lambda: bd.Load(0, viscous="1"), TypeError, r"Load\.viscous must be a real number"),
        (lambda: bd.Load(0, quadratic=math.inf), ValueError, r"Load\.quadratic must be finite"),
        (lambda: bd.Load(0, factor=[0.0, 1.0]), TypeError, r"Load\.factor must be a PiecewiseLin"),
        (lambda: bd.Load(0, factor=bd.PiecewiseLinear([0], [[1, 2]])), ValueError,
         r"Load\.factor must have one value per time and name no pulley"),
        (lambda: bd.SpeedTable(0, [], []), ValueError, r"SpeedTable\.omega must hold at least one"),
        (lambda: bd.SpeedTable(0, [[1]], [1]), ValueError, r"SpeedTable\.omega must have 1 dim"),
        (lambda: bd.SpeedTable(0, [-1, 1], [1, 1]), ValueError, r"SpeedTable\.omega must be >= 0"),
        (lambda: bd.SpeedTable(0, [2, 1], [1, 2]), ValueError,
         r"SpeedTable\.omega must be increasing, got 2 rad/s before 1"),
        (lambda: bd.SpeedTable(0, [1, 2], [1, -2]), ValueError,
         r"SpeedTable\.torque must be >= 0, for the table holds magnitudes"),
        (lambda: bd.Motor(0, [1], [1]), ValueError, r"Motor\.omega must hold at least two speeds"),
        (lambda: bd.Motor(0, [1, 1], [1, 2]), ValueError, r"Motor\.omega must be increasing"),
        (lambda: bd.Motor(0, [1, 2], [1, 2, 3]), ValueError,
         r"Motor\.torque must have one value for each of the 2 speed\(s\), got 3"),
        (lambda: bd.Motor(0, [1, 2], [1, 2], ramp=0.0), ValueError,
         r"Motor\.ramp must end after it begins, got 0 s and 0 s"),
        (lambda: bd.Motor(0, [1, 2], [1, 2], ramp=1.0, factor=bd.PiecewiseLinear([0], [1])),
         ValueError, r"Motor\.ramp and Motor\.factor are both given"),
        (lambda: bd.Harmonics(0, [], []), ValueError, r"Harmonics\.orders must hold at least one"),
        (lambda: bd.Harmonics(0, [0], [1]), ValueError,
         r"Harmonics\.orders must be > 0, got 0 at \[0\]"),
        (lambda: bd.Harmonics(0, [1, 2], [1]), ValueError,
         r"Harmonics\.amplitudes must have one value for each of the 2 order\(s\), got 1"),
        (lambda: bd.Harmonics(0, [1], [1], [1, 2]), ValueError,
         r"Harmonics\.phases must have one value for each of the 1 order\(s\), got 2"),
        (lambda: bd.CrankMotion(-1.0, [1], [1], fade=(1.0, 1.0)), ValueError,
         r"CrankMotion\.fade must end after it begins, got 1 s and 1 s"),
        (lambda: bd.CrankMotion(-1.0, [1], [1], fade=0.1), TypeError, r"CrankMotion\.fade must be"),
        (lambda: bd.CrankMotion(math.sin, [1], [1]), TypeError,
         r"CrankMotion\.speed must be a number or a PiecewiseLinear, got a function"),
        (lambda: bd.CrankMotion(None, [1], [1]), TypeError, r"CrankMotion\.speed must be a real"),
        (lambda: bd.CrankMotion(bd.PiecewiseLinear([0, 0], [1, 2]), [1], [1]), ValueError,
         r"CrankMotion\.speed must not jump"),
        (lambda: bd.CrankMotion(1.0, [-1], [1]), ValueError, r"CrankMotion\.orders must be > 0"),
        (lambda: bd.Step(0, 0.0, "1"), TypeError, r"Step\.torque must be a real number"),
        (lambda: bd.PiecewiseLinear([0], [0], pulley=1.5), TypeError,
         r"PiecewiseLinear\.pulley must be a pulley's index or its name, got 1.5"),
        (lambda: bd.Load("fan")(0.0, [0, 0], [0, 0]), ValueError,
         r"Load\.pulley is the name 'fan': give an index"),
        (lambda: bd.Load(0).terms(), TypeError, r"terms\(\) needs the pulleys' names"),
    ],
)  # fmt: skip
def test_bad_input(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=f"^{message}"):
        make()


def test_names_of_pulleys(free: bd.Params, rest: bd.State) -> None:
    """A pulley that has a name is called by it, in sums, in files and as the key of a motion, and
    gives the same bits. Pulleys are looked for when the run is made, which names the part.
    """
    pulleys = [attrs.evolve(p, name=n) for p, n in zip(free.pulleys, ("crank", "fan"), strict=True)]
    named = attrs.evolve(free, pulleys=pulleys)
    motor = attrs.evolve(RAMPED, ramp=(0.0, 0.005))
    by_index = (
        motor + bd.Load(1, viscous=0.1) + bd.Harmonics(1, [1.0], [2.0], of=0) + bd.Step(1, 0.0, 1.0)
    )
    by_name = (
        attrs.evolve(motor, pulley="fan")
        + bd.Load("fan", viscous=0.1)
        + bd.Harmonics("fan", [1.0], [2.0], of="crank")
        + bd.PiecewiseLinear([0.0, 0.0], [0.0, 1.0], pulley="fan")
    )
    one = bd.simulate(free, by_index, 0.01, {0: CRANK}, initial=rest)
    other = bd.simulate(named, by_name, 0.01, {"crank": CRANK}, initial=rest)
    assert np.array_equal(one.pulleys.omega, other.pulleys.omega)
    scene = bd.Scene(named, by_name, 0.01, {"crank": CRANK})
    assert bd.Scene.from_toml(scene.to_toml()) == scene
    assert 'kind = "crank"' in scene.to_toml()
    table = "\n[[motion]]\npulley = 0\nkind = 'crank'\nspeed = -20.0\norders = [2]\n"
    read = bd.Scene.from_toml(
        bd.Scene(free, NOTHING, 0.1).to_toml() + table + "amplitudes = [0.1]\n"
    )
    assert read.motion == {0: bd.CrankMotion(-20.0, [2], [0.1])}
    assert 'load on pulley "fan", viscous' in str(scene)
    assert "mean speed -50 to 0 rad/s, harmonics of orders 1.5, 4" in str(scene)
    with pytest.warns(bd.BeltdynWarning, match='beyond_table: pulley "fan" turns at '):
        bd.simulate(named, bd.Step(1, 0.0, 9.0) + bd.SpeedTable(1, [0.1], [0.0]), 0.01,
                    initial=rest)  # fmt: skip
    index = "index must be an integer from 0 to 1, got"
    for params, torque, message in (
        (free, bd.Load(2), rf"torque_fn\.pulley {index} 2"),
        (free, NOTHING + bd.Step(5, 0.0, 1.0), rf"torque_fn\[1\]\.pulley {index} 5"),
        (free, bd.Load("fan"), r"torque_fn\.pulley: no pulley is called 'fan'; there are pulley 0"),
        (free, bd.Harmonics(0, [1], [1], of=2), rf"torque_fn\.of {index} 2"),
        (named, NOTHING + bd.Step("fam", 0.0, 1.0),
         r"torque_fn\[1\]\.pulley: no pulley is called 'fam' \(did you mean 'fan'\?\)"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"^{message}"):
            bd.simulate(params, torque, 0.1)


def test_objects_are_values_that_the_core_reads() -> None:
    """A torque or a motion of these is data, not a function that is called."""
    whole = LOADS[0] + LOADS[1] + LOADS[2] + LOADS[3] + LOADS[4]
    for one in (*LOADS, RAMPED, CRANK, whole, bd.Load("fan"), attrs.evolve(TABLE, pulley="pump")):
        assert pickle.loads(pickle.dumps(one)) == one
        assert eval(repr(one), vars(bd)) == one
        assert str(one)
    given = np.array([1.0, 2.0])
    table = bd.SpeedTable(0, given, given)
    given[0] = 7.0
    assert table.omega[0] == 1.0
    assert bd.Load(0, viscous=1.0) != bd.Load(0, viscous=2.0)
    assert attrs.evolve(HARMONICS, of=1) != HARMONICS
    assert in_core(CRANK) and in_core(CRANK_SPEED) and in_core(bd.Motion(speed=CRANK_SPEED))
    assert not in_core(math.sin) and not in_core(bd.Motion(angle=math.sin))
    assert evaluated_in_core(bd.Scene(drives.plain(), whole, 0.1, {0: CRANK}))
    assert "call" not in {kind for kind, *_ in whole.terms(drives.plain().pulley_names)}
