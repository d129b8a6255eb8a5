"""Mounts of pulleys (MODEL section 5) against closed forms: balances at rest, hysteresis of a
pivot, stops, a weighted take-up, paths.

test_mounts_oracle.py compares with the oracle; test_mounts_input.py is about what is given and
refused; belts that run on mounts are in test_start_at_speed.py and test_string.py.
"""

from __future__ import annotations

import math
from itertools import cycle as turns_of
from typing import Any

import attrs
import mounted_drives as drives
import numpy as np
import pytest
import reference
import scipy.integrate
import scipy.interpolate
import scipy.optimize
from mounted_drives import METHODS

import beltdyn as bd
from beltdyn.drive.balance import tension_held
from beltdyn.drive.route import Route

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def line_with(params: bd.Params, center: Any) -> Route:
    """The belt line with its mounted pulley moved to a place."""
    (j,) = params.mounted
    pulleys = [attrs.evolve(one, mount=None) for one in params.pulleys]
    pulleys[j] = attrs.evolve(pulleys[j], center=tuple(center))
    return bd.route(pulleys)


def turned(params: bd.Params, angle: float) -> np.ndarray:
    """Where an arm has its axis at an angle."""
    (j,) = params.mounted
    pivot, (c, s) = np.array(params.pulleys[j].mount.pivot), (math.cos(angle), math.sin(angle))
    return pivot + np.array([[c, -s], [s, c]]) @ (np.array(params.pulleys[j].center) - pivot)


def arm_at_rest(params: bd.Params) -> tuple[float, float]:
    """Angle and tension by the balance of moments about the pivot, r x F of each force."""
    (j,) = params.mounted
    mount = params.pulleys[j].mount
    preload = mount.preload or 0.0
    if mount.free_angle is not None:
        preload = mount.stiffness * mount.free_angle

    def moment(angle: float) -> tuple[float, float]:
        center = turned(params, angle)
        line = line_with(params, center)
        tension = params.belt.axial_stiffness * (line.length / params.belt.length - 1.0)
        spans = np.roll(line.arrive, -1, axis=0) - line.leave
        spans /= np.hypot(*spans.T)[:, None]
        force = tension * (spans[j] - spans[j - 1]) + mount.mass * np.asarray(params.gravity)
        r = center - np.asarray(mount.pivot)
        return r[0] * force[1] - r[1] * force[0] + preload - mount.stiffness * angle, tension

    angle = scipy.optimize.brentq(lambda a: moment(a)[0], -0.12, 0.2, xtol=1e-14)
    return angle, moment(angle)[1]


@pytest.mark.parametrize(
    ("gravity", "spring"),
    [((0.0, 0.0), {"preload": 6.0, "stiffness": 10.0}),
     ((0.0, -9.81), {"preload": None, "free_angle": 0.8, "stiffness": 7.0}),
     ((-9.81, 0.0), {"preload": 5.0, "stiffness": 0.0})],
    ids=["preload", "free angle", "preload alone"],
)  # fmt: skip
def test_arm_settles_where_moments_balance(gravity: Any, spring: dict[str, Any]) -> None:
    """Angle to 0.2 % of the spring's, or belt's, whole travel; tensions to 0.2 %. The belt is light
    and without bending stiffness, its mesh fine: links of 1/120 of the belt leave some 1e-4 of the
    tension (MODEL section 6), contact compensated for this tension nothing.
    """
    mount = drives.arm(friction=0.0, mass=0.5, inertia=0.005, **spring)
    params = drives.tensioner(
        mount, n_bodies=120, gravity=gravity, friction=None,
        belt_changes={"linear_density": 0.005, "bending_stiffness": 0.0, "axial_damping": 0.4},
    )  # fmt: skip
    angle, tension = arm_at_rest(params)
    assert params.info["strain_tension"] == pytest.approx(tension, rel=2e-3)
    if gravity[1]:  # half a kilogram at the axis shows
        weightless = arm_at_rest(attrs.evolve(params, gravity=(0.0, 0.0)))[1]
        assert abs(weightless / tension - 1.0) > 0.02
    state = bd.settle(params)
    assert state.tension(params).spans == pytest.approx(tension, rel=2e-3)
    # what 0.2 % of the tension moves the arm by: the belt's stretch over dl/dq, and the spring
    lengths = [line_with(params, turned(params, angle + d)).length for d in (-1e-5, 1e-5)]
    lever = abs(lengths[1] - lengths[0]) / 2e-5
    stiffness = params.belt.axial_stiffness / params.belt.length * lever**2 + mount.stiffness
    moved = 2e-3 * tension * lever / stiffness
    assert state.travel[0] == pytest.approx(angle, abs=moved)
    assert abs(angle) > 20 * moved or spring["preload"] == 6.0


@pytest.mark.parametrize(("weight", "change"), [(24.0, 0.0), (10.0, 2e-3), (24.0, -2e-3)])
def test_weighted_take_up_keeps_its_tension(weight: float, change: float) -> None:
    """T = W g / 2 for a belt of any length, as one that has become warm or worn; the carriage takes
    up half of what the belt is longer by. Statics of the carriage and the spans alone, so that the
    mesh has no part in it: 1e-6.
    """
    base = drives.take_up(drives.slider(weight=weight), n_bodies=120)
    length = base.belt.length * (1.0 + change)
    params = attrs.evolve(base, belt=attrs.evolve(base.belt, length=length, bending_stiffness=0.0))
    state = bd.settle(params)
    tension = weight * 9.80665 / 2.0
    assert state.tension(params).spans == pytest.approx(tension, rel=1e-6)
    assert params.info["strain_tension"] == pytest.approx(tension, rel=2e-3)
    at_drawn = bd.route(base.pulleys).length
    travel = (length * (1.0 + tension / params.belt.axial_stiffness) - at_drawn) / 2.0
    # the mesh: a fifteenth of its strain, l0^2 / 12 L of the wraps over the radii (section 6)
    strain = (length / 120) ** 2 / (12 * length) * 2 * math.pi / 0.08
    assert state.travel[0] == pytest.approx(travel, abs=strain * length / 15)


def test_a_free_travel_is_a_preload() -> None:
    one = drives.take_up(drives.slider(weight=0.0, stiffness=5e3, preload=240.0))
    other = drives.take_up(drives.slider(weight=0.0, stiffness=5e3, free_travel=0.048))
    states = [bd.settle(params) for params in (one, other)]
    assert states[0].travel == pytest.approx(states[1].travel, rel=1e-12)
    assert states[0].x == pytest.approx(states[1].x, abs=1e-14)


@pytest.mark.parametrize(("gravity", "bending"), [((0.0, 0.0), 0.02), ((3.0, -9.81), 0.0)])
def test_a_tension_is_the_preload_that_holds_it(
    gravity: tuple[float, float], bending: float
) -> None:
    """Of an arm, and of a carriage beside whose spring a weight hangs: the preload found is that
    with which the same drive holds this tension, and the settled belt has it, to 0.5 % with these
    links, also if bending turns the spans at the pulley: without that the arm would hold 142 N.
    """
    of_arm = drives.arm(preload=None, tension=150.0, friction=0.0)
    of_slider = drives.slider(weight=10.0, stiffness=5e3, tension=150.0)
    for make, mount in ((drives.tensioner, of_arm), (drives.take_up, of_slider)):
        belt = {"bending_stiffness": bending}
        options = {"n_bodies": 150, "belt_changes": belt, "gravity": gravity}
        drawn = make(mount, **options)
        params = attrs.evolve(drawn, belt=attrs.evolve(drawn.belt, length=None))
        (k,) = params.mounted
        found = params.effective_pulleys[k].mount
        assert found.tension is None and params.pulleys[k].mount == mount
        held = tension_held(params.effective_pulleys, gravity, bending)
        assert held == pytest.approx(150.0, rel=1e-12)
        given = make(found, **options)
        assert bd.settle(given).travel == pytest.approx(bd.settle(drawn).travel, rel=1e-12)
        state = bd.settle(params)
        assert state.tension(params).spans == pytest.approx(150.0, rel=5e-3)
        assert abs(state.travel[0]) < 1e-3
        # it follows the drive, and is kept in files
        other = attrs.evolve(params, gravity=(5.0, 20.0))
        assert other.effective_pulleys[k].mount.preload != found.preload
        assert bd.Params.from_toml(params.to_toml()) == params
        assert "tension of the belt that it holds" in str(params)
    (spring,) = drives.take_up(of_slider).effective_pulleys[1:]
    assert spring.mount.preload == pytest.approx(2 * 150.0 - 10.0 * 9.80665, rel=1e-12)


def test_numbers_of_a_mount_are_those_that_act() -> None:
    """Given as numbers, those that the core tells give its rates of what it chooses."""
    for params in (
        drives.tensioner(drives.arm(stops=(-0.1, 0.1), stop_damping=1.0)),
        drives.take_up(drives.slider(friction=20.0, stops=(-0.01, 0.01), stop_damping=1.0)),
    ):
        (k,) = params.mounted
        pulleys, mount = list(params.pulleys), params.pulleys[k].mount
        (numbers,) = params._model.mounts
        inertia = numbers.pop("inertia")
        assert inertia == getattr(mount, "inertia", mount.mass + getattr(mount, "weight", 0.0))
        pulleys[k] = attrs.evolve(pulleys[k], mount=attrs.evolve(mount, **numbers))
        state = bd.settle(params)
        pressed = attrs.evolve(state, travel=state.travel + 0.2, travel_speed=np.array([0.3]))
        rates = [
            one._model.rate(pressed._to_core(one), np.zeros(len(pulleys)))
            for one in (params, attrs.evolve(params, pulleys=pulleys))
        ]
        for name in ("travel_speed", "mount_friction"):
            assert rates[0][name] != 0.0
            assert rates[1][name] == pytest.approx(rates[0][name], rel=1e-14)


def test_the_sense_of_a_travel_changes_nothing() -> None:
    """A carriage thrown off the belt: lists of links near its pulley were made anew only where it
    went along the direction that it was given, for a speed against it counted as none.
    """
    searches, forces = [], []
    for sense in (1.0, -1.0):
        mount = drives.slider(direction=(sense, 0.0), mass=25.0, weight=0.0, preload=sense * 240.0)
        params = drives.take_up(mount)
        thrown = attrs.evolve(bd.settle(params), travel_speed=[-5.0 * sense])
        options: dict[str, Any] = {"initial": thrown, "method": "rk4", "step": 1e-5}
        result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 0.012, **options)
        searches.append(result.stats.searches)
        forces.append(result.joints.force)
    assert searches[0] == searches[1]
    assert np.array_equal(*forces)


def test_forces_of_a_mount_are_those_of_its_parts() -> None:
    """An arm that the belt's tension moves there and back: the crank is held, the alternator turned
    by torques up to 5 N m either way. Friction's share is (2.9) in closed form over the travel,
    mu_k = 1 and sigma = kappa / F_m. A turn between two samples is seen at the nearer one, a travel
    of a/2 (dt/2)^2 short; belt and arm turn within some milliseconds and so by less than 1e-5 rad,
    2e-3 of the share, and forget it. The sum is inertia times its rate; losses add up.
    """
    mount = drives.arm(friction=0.4, friction_stiffness=80.0, damping=0.2, mass=0.0)
    torque = bd.PiecewiseLinear(
        [0.0, 0.06, 0.18, 0.30, 0.42], np.outer([0.0, 1.0, -1.0, 1.0, -1.0], [0.0, 0.0, 5.0])
    )
    still, times = bd.PiecewiseLinear([0.0], [0.0]), np.linspace(0.0, 0.42, 4201)
    result = bd.simulate(
        drives.tensioner(mount), torque, 0.42, {0: still}, t_eval=times, method="tsit5", rtol=1e-6
    )
    at = result.mounts
    q, rate, force = (a[:, 0] for a in (at.travel, at.travel_speed, at.friction_force))
    sigma = mount.friction_stiffness / mount.friction
    expected = -mount.friction * reference.dahl_path_exact(q, 1.0, sigma).astype(float)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(q))) != 0)
    assert len(turns) >= 3
    assert 0.9 * mount.friction < np.abs(force).max() <= mount.friction
    missed = 3 * np.abs(np.diff(q, 2)).max() / 4.0 * sigma * mount.friction  # a dt^2
    assert missed < 0.02 * mount.friction
    assert np.max(np.abs(force - expected)) <= missed + 1e-5 * mount.friction
    assert at.spring_force[:, 0] == pytest.approx(mount.preload - mount.stiffness * q, rel=1e-12)
    assert at.damper_force[:, 0] == pytest.approx(-0.2 * rate, rel=1e-12)
    assert not at.stop_force.any()
    total = at.spring_force + at.damper_force + at.friction_force + at.belt_force
    # the arm's own inertia, by the second difference of its travel: 4th order in dt of vibrations
    inertia = mount.inertia * np.diff(q, 2) / times[1] ** 2
    apart = np.abs(total[1:-1, 0] - inertia)
    assert np.sqrt(np.mean(apart**2)) <= 0.02 * np.sqrt(np.mean(at.spring_force**2))
    lost, power = result.energy.mount_loss, 0.2 * rate**2 - force * rate
    by_hand = scipy.integrate.cumulative_simpson(power, x=times, initial=0.0)
    assert lost == pytest.approx(by_hand, abs=1e-3 * lost[-1])
    assert lost[-1] > 0.5 * 0.4 * np.ptp(q)
    assert np.max(np.abs(result.energy.residual)) <= 1e-5 * result.energy.passed[-1]


@pytest.mark.parametrize(("method", "way"), [*zip(METHODS, turns_of((1.0, -1.0)), strict=False)])
def test_stops_make_no_energy(method: str, way: float) -> None:
    """An arm thrown against a stop is pushed back, never pulled, and slower than it came: damper
    and belt take the rest. The damper's force jumps where the stop is reached: steps that control
    their error find that edge, a fixed one over it has it for some part of it too much or too
    little, by w h of the arm's energy, w the frequency of the arm on its stop.
    """
    low, high = -0.04, 0.03
    mount = drives.arm(stops=(low, high), friction=0.0, damping=0.0)
    params = drives.tensioner(mount)
    thrown = attrs.evolve(bd.settle(params), travel_speed=[20.0 * way])
    result = bd.simulate(
        params, bd.Viscous([0.0] * 3), 0.02, initial=thrown, t_eval=np.linspace(0.0, 0.02, 2001),
        method=method, **METHODS[method],
    )  # fmt: skip
    at, energy = result.mounts, result.energy
    q, rate, stop = (a[:, 0] for a in (at.travel, at.travel_speed, at.stop_force))
    beyond = (q - (high if way > 0 else low)) * way > 0
    assert np.all(stop[q > high] <= 0.0) and np.all(stop[q < low] >= 0.0)
    assert not stop[(q >= low) & (q <= high)].any()
    assert np.abs(stop).max() > 10 * drives.tension_of(params) * 0.03
    first = int(np.argmax(beyond))
    back = first + int(np.argmin(beyond[first:]))
    assert back > first > 0  # it gets there and returns
    came, left = rate[first - 1], rate[back]
    assert came * way > 0.0 > left * way
    assert abs(left) < abs(came)
    stored = energy.kinetic + energy.axial + energy.bending + energy.contact + energy.mount
    residual = np.max(np.abs(energy.residual))
    bound = 10 * METHODS[method].get("rtol", 1e-4) * energy.passed[-1]
    if method == "rk4":
        reach = math.dist(mount.pivot, params.pulleys[1].center)
        stiffness = 200 * params.belt.axial_stiffness * reach**2 / params.belt.length
        frequency = math.sqrt(stiffness / mount.inertia)
        bound = max(bound, frequency * result.stats.largest_step * 0.5 * mount.inertia * came**2)
    assert residual <= bound
    assert stored.max() <= stored[0] + residual  # all energy, but for what was lost, is the start's
    assert np.all(np.diff(energy.mount_loss) >= -bound)  # between the ends of such a step
    assert energy.mount_loss[-1] > 5 * residual


def test_an_explicit_step_sees_a_stop_within_it() -> None:
    """An arm on stops without damping: forces were off by 19 times what was asked, for the stages
    from which the error is estimated stand together at the end of a step.
    """
    free: dict[str, Any] = {"friction": 0.0, "damping": 0.0}
    rest = bd.settle(drives.tensioner(drives.arm(**free)))
    stops = (rest.travel[0] - 5e-4, rest.travel[0] + 5e-4)
    params = drives.tensioner(drives.arm(stops=stops, stop_stiffness=1e6, **free))
    given: dict[str, Any] = {"initial": attrs.evolve(rest, travel_speed=[2.0])}
    given |= {"t_eval": np.linspace(0.0, 0.03, 61)}
    still = bd.Viscous([0.0] * 3)
    exact = bd.simulate(params, still, 0.03, method="rodas4", rtol=1e-5, **given).joints.force
    force = bd.simulate(params, still, 0.03, method="tsit5", rtol=1e-4, **given).joints.force
    assert np.sqrt(np.mean((force - exact) ** 2)) <= 1e-4 * exact.mean()


def test_errors_of_a_take_up_that_bounces_are_in_the_claim() -> None:
    """A carriage shaken between stops without damping, each bounce with the error of the last and
    more: off by ten claims that do not count them.
    """
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.0401, inertia=2.69e-4),
        bd.Pulley(center=(0.0912, 0.208), radius=0.0453, inertia=2.58e-3),
        bd.Pulley(center=(0.182, 0.0), radius=0.0312, inertia=3.09e-4),
    ]
    belt = bd.Belt(length=0.8783, n_bodies=21, linear_density=0.03, axial_stiffness=1e5,
                   axial_damping=1.41, mesh="joint", model="string")  # fmt: skip

    data: dict[str, Any] = {"contact": bd.Contact(linear=1.52e9, damping=3180.0)}
    data |= {"belt": belt, "friction": bd.Dahl(mu_k=0.8, sigma=1500.0)}
    carriage: dict[str, Any] = {"direction": (0.0, 1.0), "mass": 0.856, "stiffness": 8e4}
    carriage |= {"preload": 995.0, "damping": 9.0}

    def drive(**stops: Any) -> bd.Params:
        mounted = attrs.evolve(pulleys[1], mount=bd.Slider(**carriage, **stops))
        return bd.Params(pulleys=[pulleys[0], mounted, pulleys[2]], **data)

    start = bd.settle(drive(), speed={0: -37.4})
    stops = (start.travel[0] - 5e-5, start.travel[0] + 5e-5)
    params, times = drive(stops=stops, stop_stiffness=7e8), np.linspace(0.0, 0.04, 61)
    torque = bd.Viscous([0.0, 0.0, 0.05]) + bd.PiecewiseLinear(
        times, np.outer(np.sin(2 * np.pi * times / 0.03), [20.0, 0.0, 0.0])
    )
    given: dict[str, Any] = {"initial": attrs.evolve(start, travel_speed=[0.1]), "t_eval": times}
    exact = bd.simulate(params, torque, 0.04, method="rodas4", rtol=1e-6, **given).joints.force
    off = claims = 0.0
    for method in ("tsit5", "rodas4"):
        run = bd.simulate(params, torque, 0.04, method=method, rtol=1e-4, **given)
        assert run.stats.error is not None
        claims += run.stats.error
        off += np.sqrt(np.mean((run.joints.force - exact) ** 2)) / exact.mean()
    assert off <= 5.0 * claims


def test_a_chosen_stop_is_as_stiff_as_stated() -> None:
    """Held by the stop, the arm is in by the torque left over 50 times 4 EA a^2 / L."""
    mount = drives.arm(stops=(-0.2, -0.05), friction=0.0)
    params = drives.tensioner(mount, friction=None)
    state = bd.settle(params)
    still = bd.Viscous([0.0] * 3)
    at = bd.simulate(params, still, 1e-7, initial=state, t_eval=[0.0]).mounts
    reach = math.dist(mount.pivot, params.pulleys[1].center)
    stiffness = 50 * 4 * params.belt.axial_stiffness * reach**2 / params.belt.length
    push = float(-at.stop_force[0, 0])
    assert push > 0.5
    assert state.travel[0] + 0.05 == pytest.approx(push / stiffness, rel=1e-9)
    assert push == pytest.approx(at.spring_force[0, 0] + at.belt_force[0, 0], rel=1e-6)


def test_an_axis_on_a_path_is_where_the_spline_is() -> None:
    """Travel is the time; contact follows SciPy's clamped spline: links that lie on the pulley are
    at its radius from there. The work of the path is what the ledger has, by the trapezoidal rule.
    """
    params = drives.path()
    times = np.linspace(0.0, 0.06, 1201)
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 0.06, t_eval=times, rtol=1e-6)
    at, energy = result.mounts, result.energy
    assert at.travel[:, 0] == pytest.approx(times, abs=1e-15)
    assert np.all(at.travel_speed == 1.0)
    for name in ("spring_force", "damper_force", "friction_force", "stop_force"):
        assert not getattr(at, name).any()
    spline = scipy.interpolate.CubicSpline(drives.PATH_T, drives.PATH_D, bc_type="clamped")
    center = np.array([0.30, 0.0]) + spline(np.minimum(times, drives.PATH_T[-1]))
    on = result.contact.pulley == 1
    full = on & np.roll(on, -1, axis=1)  # both joints of the link
    distance = np.hypot(result.belt.x - center[:, :1], result.belt.y - center[:, 1:])
    half = 0.5 * params.belt.length / params.belt.n_bodies
    # mean of a chord's middle on the radius 0.08; depth and stretch are some 1e-5 m
    chord = math.sqrt((half / math.sin(half / 0.08)) ** 2 - half**2)
    assert np.median(distance[full]) == pytest.approx(chord, abs=5e-5)
    work = scipy.integrate.cumulative_trapezoid(at.belt_force[:, 0], times, initial=0.0)
    assert energy.path_work == pytest.approx(work, abs=2e-3 * np.ptp(work))
    assert np.ptp(work) > 1e-3
    assert np.max(np.abs(energy.residual)) <= 1e-4 * energy.passed[-1]
    assert energy.mount is None


def test_pulleys_that_meet_end_the_run() -> None:
    """Thrown at each other, where no stops hold them; and so near that links may touch both."""
    for params, speed, words in (
        (drives.take_up(), -30.0, "pulley 1 on its mount .* of pulley 0 at .* they overlap"),
        (drives.tensioner(), 300.0, "pulley 1 on its mount .* of pulley 2 .* two links could"),
    ):
        start = attrs.evolve(bd.settle(params), travel_speed=np.array([speed]))
        with pytest.raises(bd.SimulationError, match=words) as caught:
            bd.simulate(params, drives.torque(params), 0.02, initial=start)
        assert caught.value.symbol == "BD_ERR_OFF_PULLEY" and caught.value.pulley == 1
