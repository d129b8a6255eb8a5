"""Mounts of pulleys (MODEL section 5) against closed forms: balances at rest, hysteresis of a
pivot, stops, a weighted take-up at rest and running, paths.

Geometry is written here anew, from tangents of two circles. test_mounts_oracle.py compares with the
oracle; test_mounts_input.py is about what is given, refused, and off.
"""

from __future__ import annotations

import math
from itertools import cycle as turns_of
from typing import Any

import attrs
import mounted_drives as drives
import numpy as np
import pytest
import scipy.integrate
import scipy.interpolate
import scipy.optimize
from mounted_drives import METHODS

import beltdyn as bd
from beltdyn import _core
from beltdyn.mounts import friction_stiffness, stop_stiffness

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
G = 9.80665
GRAVITIES = ((0.0, 0.0), (0.0, -9.81), (-9.81, 0.0))
Array = np.ndarray[Any, np.dtype[np.float64]]


def tangent(
    one: Array, r: float, side: int, other: Array, q: float, its_side: int
) -> tuple[Array, float]:
    """Unit vector along the span that a belt running clockwise takes from one circle to the other,
    +1 inside its loop, -1 outside, and the span's length.

    The belt has inside pulleys on its right. From the span each axis is so far to the right, with
    sign, as its radius: in the span's own frame the centres differ by (length, r_0 - r_1).
    """
    across = side * r - its_side * q
    apart = other - one
    length = math.sqrt(apart @ apart - across**2)
    # rotate (length, across) on to the vector between the centres
    turn = math.atan2(apart[1], apart[0]) - math.atan2(across, length)
    return np.array([math.cos(turn), math.sin(turn)]), length


def line_of(params: bd.Params, centers: Array) -> tuple[float, list[tuple[Array, Array]]]:
    """Length of the tight belt line, and by pulley the unit vectors of its spans away from it."""
    n = len(params.pulleys)
    sides = [1 if one.side == "inside" else -1 for one in params.pulleys]
    spans = [
        tangent(centers[k], params.pulleys[k].radius, sides[k],
                centers[(k + 1) % n], params.pulleys[(k + 1) % n].radius, sides[(k + 1) % n])
        for k in range(n)
    ]  # fmt: skip
    total, away = 0.0, []
    for k in range(n):
        before, behind = spans[k - 1][0], spans[k][0]
        cross = before[0] * behind[1] - before[1] * behind[0]
        wrap = math.atan2(cross, before @ behind) * -sides[k] % (2 * math.pi)
        total += spans[k][1] + params.pulleys[k].radius * wrap
        away.append((-before, behind))
    return total, away


def centers_of(params: bd.Params) -> Array:
    return np.array([pulley.center for pulley in params.pulleys])


def turned(center: Array, pivot: Any, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return pivot + np.array([[c, -s], [s, c]]) @ (center - np.asarray(pivot))


def test_this_geometry_is_the_route() -> None:
    """The line written here and that of the package, which has tests of its own, are one."""
    for make in (drives.tensioner, drives.take_up, drives.both):
        params = make()
        total, _ = line_of(params, centers_of(params))
        assert total == pytest.approx(bd.route(params.pulleys).length, rel=1e-12)


def span_tensions(params: bd.Params, state: bd.State) -> Array:
    """Of a belt at rest, from a run so short that nothing moves."""
    still = bd.Viscous([0.0] * len(params.pulleys))
    result = bd.simulate(params, still, 1e-7, initial=state, t_eval=[0.0])
    return np.asarray(result.span_tension[0])


def arm_at_rest(params: bd.Params) -> tuple[float, float]:
    """Angle and tension by the balance of moments about the pivot, r x F of each force."""
    (j,) = params.mounted
    mount, radius_of = params.pulleys[j].mount, centers_of(params)
    preload = mount.preload or 0.0
    if mount.free_angle is not None:
        preload = mount.stiffness * mount.free_angle

    def moment(angle: float) -> tuple[float, float]:
        centers = radius_of.copy()
        centers[j] = turned(centers[j], mount.pivot, angle)
        total, away = line_of(params, centers)
        tension = params.belt.axial_stiffness * (total / params.belt.length - 1.0)
        force = tension * (away[j][0] + away[j][1]) + mount.mass * np.asarray(params.gravity)
        r = centers[j] - np.asarray(mount.pivot)
        spring = preload - mount.stiffness * angle
        return r[0] * force[1] - r[1] * force[0] + spring, tension

    angle = scipy.optimize.brentq(lambda a: moment(a)[0], -0.12, 0.2, xtol=1e-14)
    return angle, moment(angle)[1]


SPRINGS: dict[str, dict[str, Any]] = {
    "preload": {"preload": 6.0, "stiffness": 10.0},
    "free angle": {"preload": None, "free_angle": 0.8, "stiffness": 7.0},
    "preload alone": {"preload": 5.0, "stiffness": 0.0},
}


@pytest.mark.parametrize(("gravity", "spring"), [*zip(GRAVITIES, SPRINGS, strict=True)])
def test_arm_settles_where_moments_balance(gravity: tuple[float, float], spring: str) -> None:
    """Angle to 0.2 % of the spring's, or belt's, whole travel; tensions to 0.2 %. The belt is light
    and without bending stiffness, its mesh fine: links of 1/120 of the belt leave some 1e-4 of the
    tension (MODEL section 6), contact compensated for this tension nothing.
    """
    mount = drives.arm(friction=0.0, mass=0.5, inertia=0.005, **SPRINGS[spring])
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
    assert span_tensions(params, state) == pytest.approx(tension, rel=2e-3)
    # what 0.2 % of the tension moves the arm by: the belt's stretch over dl/dq, and the spring
    lever = abs(angle_lever(params, angle))
    stiffness = params.belt.axial_stiffness / params.belt.length * lever**2 + mount.stiffness
    assert state.travel[0] == pytest.approx(angle, abs=2e-3 * tension * lever / stiffness)
    assert abs(angle) > 20 * 2e-3 * tension * lever / stiffness or spring == "preload"


def angle_lever(params: bd.Params, angle: float) -> float:
    """dl/dq of the line by differences [m/rad]."""
    (j,) = params.mounted
    lengths = []
    for a in (angle - 1e-5, angle + 1e-5):
        centers = centers_of(params)
        centers[j] = turned(centers[j], params.pulleys[j].mount.pivot, a)
        lengths.append(line_of(params, centers)[0])
    return (lengths[1] - lengths[0]) / 2e-5


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
    tension = weight * G / 2.0
    assert span_tensions(params, state) == pytest.approx(tension, rel=1e-6)
    assert params.info["strain_tension"] == pytest.approx(tension, rel=2e-3)
    at_drawn = bd.route(base.pulleys).length
    travel = (length * (1.0 + tension / params.belt.axial_stiffness) - at_drawn) / 2.0
    # the mesh: a fifteenth of its strain, l0^2 / 12 L of the wraps over the radii (section 6)
    strain = (length / 120) ** 2 / (12 * length) * 2 * math.pi / 0.08
    assert state.travel[0] == pytest.approx(travel, abs=strain * length / 15)


@pytest.mark.parametrize("gravity", [(0.0, -9.81), (2.0, 3.0)])
def test_take_up_under_gravity(gravity: tuple[float, float]) -> None:
    """Hung weight pulls along the slider whatever gravity; the carriage's own mass with it, here
    downwards, and half of the belt. Spans are vertical and carry both: free body of the lower half.
    """
    mount = drives.slider(
        direction=(0.0, -1.0), mass=3.0, weight=10.0, stiffness=400.0, preload=50.0
    )
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
        bd.Pulley(center=(0.0, -0.30), radius=0.08, inertia=0.005, mount=mount),
    ]
    params = drives.drive(
        pulleys, 48, gravity=gravity, friction=None,
        belt_changes={"linear_density": 1e-3, "bending_stiffness": 0.0, "axial_damping": 0.1},
    )  # fmt: skip
    state = bd.settle(params)
    pull = 10.0 * G - 3.0 * gravity[1] + 50.0 - 400.0 * state.travel[0]
    # the belt weighs 0.01 N, of some 100
    assert span_tensions(params, state) == pytest.approx(pull / 2.0, rel=2e-4)


def test_slider_between_its_stops_and_spring() -> None:
    """A take-up pulled against its upper stop holds the belt there: T by the line's strain."""
    mount = drives.slider(weight=40.0, stops=(-0.01, 1e-3), stop_stiffness=1e9, stop_damping=1e4)
    params = drives.take_up(mount, n_bodies=96, belt_changes={"bending_stiffness": 0.0})
    state = bd.settle(params)
    centers = centers_of(params)
    centers[1, 0] += 1e-3
    total, _ = line_of(params, centers)
    tension = params.belt.axial_stiffness * (total / params.belt.length - 1.0)
    assert tension < 0.9 * 20.0 * G
    assert span_tensions(params, state) == pytest.approx(tension, rel=2e-3)
    assert 0.0 < state.travel[0] - 1e-3 < 1e-6


def test_a_free_travel_is_a_preload() -> None:
    one = drives.take_up(drives.slider(weight=0.0, stiffness=5e3, preload=240.0))
    other = drives.take_up(drives.slider(weight=0.0, stiffness=5e3, free_travel=0.048))
    states = [bd.settle(params) for params in (one, other)]
    assert states[0].travel == pytest.approx(states[1].travel, rel=1e-12)
    assert states[0].x == pytest.approx(states[1].x, abs=1e-14)


def test_stiffnesses_that_are_chosen_are_those_of_the_core() -> None:
    """Python's copy of the rules: given as numbers they give the core's rates of what is chosen."""
    for params in (
        drives.tensioner(drives.arm(stops=(-0.1, 0.1), stop_damping=1.0)),
        drives.take_up(drives.slider(friction=20.0, stops=(-0.01, 0.01), stop_damping=1.0)),
    ):
        (k,) = params.mounted
        pulley = params.pulleys[k]
        mount, center = pulley.mount, np.array(pulley.center)
        assert isinstance(mount, (bd.Arm, bd.Slider))
        stop = stop_stiffness(
            mount, center, params.belt.axial_stiffness, float(params.info["length"])
        )
        friction = friction_stiffness(mount, pulley.radius)
        given = attrs.evolve(mount, friction_stiffness=friction, stop_stiffness=stop)
        pulleys = [*params.pulleys[:k], attrs.evolve(pulley, mount=given), *params.pulleys[k + 1 :]]
        state = bd.settle(params)
        pressed = attrs.evolve(state, travel=state.travel + 0.2, travel_speed=np.array([0.3]))
        rates = [
            one._model.rate(pressed._to_core(one), np.zeros(len(pulleys)))
            for one in (params, attrs.evolve(params, pulleys=pulleys))
        ]
        for name in ("travel_speed", "mount_friction"):
            assert rates[0][name] != 0.0
            assert rates[1][name] == pytest.approx(rates[0][name], rel=1e-14)


@pytest.mark.ci(guard="test_mounts.py::test_weighted_take_up_keeps_its_tension")
def test_running_belt_on_a_weighted_slider() -> None:
    """The spans of an idling belt have W g / 2 and rho A v^2 more, which rims do not feel, rho A
    of the strained belt; between fixed axes its strain stays, and so its tension. 22 N and 118: to
    0.2 % of the latter. Of the 22 N fixed axes show what a lighter contact lengthens the belt line
    by, 2 pi rho A v^2 / (r c_2) or 0.6 N, and as much for vibration, which nothing damps there.
    """
    speed, changes = 15.0, {"n_bodies": 96}
    spin = bd.PiecewiseLinear([0.0, 0.15], [0.0, -speed / 0.08])
    times = np.linspace(0.35, 0.5, 301)
    means = []
    for fixed in (False, True):
        params = drives.take_up(drives.slider(damping=1500.0), fixed=fixed, **changes)
        rest = np.mean(span_tensions(params, bd.settle(params)))
        free = bd.Viscous([0.0, 0.0])
        result = bd.simulate(params, free, 0.5, motion={0: spin}, t_eval=times, rtol=1e-4)
        means.append(float(np.mean(result.span_tension) - rest))
        if not fixed:
            assert np.mean(result.mounts.belt_force) == pytest.approx(-24.0 * G, rel=2e-3)
    more = 0.1 * speed**2 / (1.0 + 140.0 / 20e3)
    assert means[0] == pytest.approx(more, abs=2e-3 * 12.0 * G)
    lengthened = 2.0 * math.pi * more / (0.08 * 5e7) * 20e3 / params.belt.length
    assert 0.0 < means[1] < 3.0 * lengthened


@pytest.mark.ci(guard="test_mounts.py::test_weighted_take_up_keeps_its_tension")
def test_loaded_take_up_keeps_the_sum_of_its_spans() -> None:
    """Tight and slack span differ by M / r, and have W g and 2 rho A v^2 together."""
    params = drives.take_up(drives.slider(damping=200.0), n_bodies=48)
    load, speed = 3.0, 4.0
    drive = bd.PiecewiseLinear([0.0, 0.1], [[0.0, 0.0], [0.0, load]])
    spin = bd.PiecewiseLinear([0.0, 0.1], [0.0, -speed / 0.08])
    times = np.linspace(0.4, 0.6, 401)
    result = bd.simulate(params, drive, 0.6, motion={0: spin}, t_eval=times, rtol=1e-4)
    spans = np.mean(result.span_tension, axis=0)
    expected = 24.0 * G + 2 * 0.1 * speed**2
    assert spans.sum() == pytest.approx(expected, rel=2e-3)
    assert abs(spans[0] - spans[1]) == pytest.approx(load / 0.08, rel=1e-2)


def cycled(damping: float = 0.0, **options: Any) -> tuple[bd.Params, bd.Result]:
    """An arm that the belt's tension moves there and back: the crank is held, the alternator turned
    by torques up to 5 N m either way.
    """
    mount = drives.arm(friction=0.4, friction_stiffness=80.0, damping=damping, mass=0.0)
    params = drives.tensioner(mount)
    torque = bd.PiecewiseLinear(
        [0.0, 0.06, 0.18, 0.30, 0.42], np.outer([0.0, 1.0, -1.0, 1.0, -1.0], [0.0, 0.0, 5.0])
    )
    still = bd.PiecewiseLinear([0.0], [0.0])
    times = np.linspace(0.0, 0.42, 4201)
    given = {"rtol": 1e-6, "method": "tsit5", **options}
    return params, bd.simulate(params, torque, 0.42, motion={0: still}, t_eval=times, **given)


@pytest.fixture(scope="module")
def cycle() -> tuple[bd.Params, bd.Result]:
    return cycled()


def test_pivot_friction_is_dahl_along_the_travel(cycle: tuple[bd.Params, bd.Result]) -> None:
    """Its share is (2.9) in closed form over the travel, mu_k = 1 and sigma = kappa / F_m. A turn
    between two samples is seen at the nearer one, a travel of a/2 (dt/2)^2 short; belt and arm
    turn within some milliseconds and so by less than 1e-5 rad, 2e-3 of the share, and forget it.
    """
    params, result = cycle
    mount = params.pulleys[1].mount
    travel, force = result.mounts.travel[:, 0], result.mounts.friction_force[:, 0]
    sigma = mount.friction_stiffness / mount.friction
    expected = -mount.friction * _core.dahl_path(travel, 0.0, 1.0, sigma)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(travel))) != 0)
    assert len(turns) >= 3
    assert np.abs(force).max() > 0.9 * mount.friction
    assert np.abs(force).max() <= mount.friction
    second = np.abs(np.diff(travel, 2)).max()  # a dt^2
    missed = np.minimum(len(turns), 3) * second / 4.0 * sigma * mount.friction
    assert missed < 0.02 * mount.friction
    assert np.max(np.abs(force - expected)) <= missed + 1e-5 * mount.friction


def test_pivot_friction_is_a_loop(cycle: tuple[bd.Params, bd.Result]) -> None:
    """Force over travel goes round against the motion; its area is what the mount has lost."""
    _, result = cycle
    travel, force = result.mounts.travel[:, 0], result.mounts.friction_force[:, 0]
    area = -np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(travel))
    lost = result.energy.mount_loss
    assert lost[-1] == pytest.approx(area, rel=1e-4)
    assert lost[-1] > 0.5 * 0.4 * np.ptp(travel)
    assert not result.mounts.damper_force.any()
    assert np.max(np.abs(result.energy.residual)) <= 1e-5 * result.energy.passed[-1]


def test_forces_of_a_mount_are_those_of_its_parts() -> None:
    """Spring, damper and their loss, from the travel; the sum is inertia times its rate."""
    params, result = cycled(damping=0.2)
    mount, at = params.pulleys[1].mount, result.mounts
    q, rate = at.travel[:, 0], at.travel_speed[:, 0]
    assert at.spring_force[:, 0] == pytest.approx(mount.preload - mount.stiffness * q, rel=1e-12)
    assert at.damper_force[:, 0] == pytest.approx(-0.2 * rate, rel=1e-12)
    assert not at.stop_force.any()
    total = at.spring_force + at.damper_force + at.friction_force + at.belt_force
    # the arm's own inertia, by the second difference of its travel: 4th order in dt of vibrations
    dt = result.t[1] - result.t[0]
    inertia = mount.inertia * np.diff(q, 2) / dt**2
    apart = np.abs(total[1:-1, 0] - inertia)
    assert np.sqrt(np.mean(apart**2)) <= 0.02 * np.sqrt(np.mean(at.spring_force**2))
    power = 0.2 * rate**2 - at.friction_force[:, 0] * rate
    lost = scipy.integrate.cumulative_simpson(power, x=result.t, initial=0.0)
    assert result.energy.mount_loss == pytest.approx(lost, abs=1e-3 * lost[-1])


@pytest.mark.parametrize(("method", "way"), [*zip(METHODS, turns_of((1.0, -1.0)), strict=False)])
def test_stops_make_no_energy(method: str, way: float) -> None:
    """An arm thrown against a stop is pushed back, never pulled, and slower than it came: damper
    and belt take the rest. The books balance as elsewhere (test_drag.py), where errors are held to
    `rtol` by a method of high order. The damper's force jumps where the stop is reached: a step
    over that edge has it for some part of it too much or too little, by w h of the arm's energy, w
    the frequency of the arm on its stop.
    """
    low, high = -0.04, 0.03
    mount = drives.arm(stops=(low, high), friction=0.0, damping=0.0)
    params = drives.tensioner(mount)
    start = bd.settle(params)
    speed = 20.0 * way
    thrown = attrs.evolve(start, travel_speed=[speed])
    times = np.linspace(0.0, 0.02, 2001)
    free = bd.Viscous([0.0] * 3)
    result = bd.simulate(params, free, 0.02, initial=thrown, t_eval=times, method=method,
                         **METHODS[method])  # fmt: skip
    q, rate, stop = (getattr(result.mounts, name)[:, 0] for name in
                     ("travel", "travel_speed", "stop_force"))  # fmt: skip
    edge = high if way > 0 else low
    beyond = (q - edge) * way > 0
    assert beyond.any()
    assert np.all(stop[q > high] <= 0.0) and np.all(stop[q < low] >= 0.0)
    assert not stop[(q >= low) & (q <= high)].any()
    assert np.abs(stop).max() > 10 * drives.tension_of(params) * 0.03
    first = int(np.argmax(beyond))
    back = first + int(np.argmin(beyond[first:]))
    assert back > first  # it returns
    came, left = rate[first - 1], rate[back]
    assert came * way > 0.0 > left * way
    assert abs(left) < abs(came)
    # all energy, but for what was lost, is that of the start
    energy = result.energy
    stored = energy.kinetic + energy.axial + energy.bending + energy.contact + energy.mount
    residual = np.max(np.abs(energy.residual))
    bound = 10 * METHODS[method].get("rtol", 1e-4) * energy.passed[-1]
    if method in ("rk4", "lbdf2", "lie"):
        reach = math.dist(mount.pivot, params.pulleys[1].center)
        stiffness = 200 * params.belt.axial_stiffness * reach**2 / params.belt.length
        frequency = math.sqrt(stiffness / mount.inertia)
        bound = max(bound, frequency * result.stats.largest_step * 0.5 * mount.inertia * came**2)
    assert residual <= bound
    assert stored.max() <= stored[0] + residual
    assert np.all(np.diff(energy.mount_loss) >= -bound)  # between the ends of such a step
    assert energy.mount_loss[-1] > 5 * residual


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
    at = result.mounts
    assert at.travel[:, 0] == pytest.approx(times, abs=1e-15)
    assert np.all(at.travel_speed == 1.0)
    for name in ("spring_force", "damper_force", "friction_force", "stop_force"):
        assert not getattr(at, name).any()
    spline = scipy.interpolate.CubicSpline(drives.PATH_T, drives.PATH_D, bc_type="clamped")
    center = np.array([0.30, 0.0]) + spline(np.minimum(times, drives.PATH_T[-1]))
    on = result.contact.pulley == 1
    full = on & np.roll(on, -1, axis=1)  # both joints of the link
    distance = np.hypot(result.belt.x - center[:, :1], result.belt.y - center[:, 1:])
    chord = distance[full]
    half = 0.5 * params.belt.length / params.belt.n_bodies
    # mean of a chord's middle on the radius 0.08; depth and stretch are some 1e-5 m
    assert np.median(chord) == pytest.approx(math.sqrt(0.08**2 * (half / 0.08
                / math.sin(half / 0.08)) ** 2 - half**2), abs=5e-5)  # fmt: skip
    work = np.concatenate(([0.0], np.cumsum(0.5 * (at.belt_force[1:, 0] + at.belt_force[:-1, 0])
                                            * np.diff(times))))  # fmt: skip
    energy = result.energy
    assert energy.path_work == pytest.approx(work, abs=2e-3 * np.ptp(work))
    assert np.ptp(work) > 1e-3
    assert np.max(np.abs(energy.residual)) <= 1e-4 * energy.passed[-1]
    assert getattr(energy, "mount", None) is None or not energy.mount.any()


def test_a_path_that_goes_back_leaves_the_tension_it_had() -> None:
    """There and back without friction; in between the tension is that of the line where it is."""
    there = bd.Path(t=(0.0, 0.1, 0.2, 0.3), displacement=((0, 0), (1e-3, 0), (1e-3, 0), (0, 0)))
    changes = {"bending_stiffness": 0.0, "axial_damping": 5.0}
    params = drives.take_up(there, n_bodies=96, friction=None, belt_changes=changes)
    times = np.linspace(0.0, 0.45, 451)
    free = bd.Viscous([0.0, 0.0])
    result = bd.simulate(params, free, 0.45, t_eval=times, rtol=1e-5)
    tension = result.joints.force.mean(axis=1)
    middle = np.mean(tension[(times > 0.148) & (times < 0.152)])
    base = params.belt.axial_stiffness * (bd.route(params.pulleys).length / params.belt.length - 1)
    spline = scipy.interpolate.CubicSpline(there.t, there.displacement, bc_type="clamped")
    more = params.belt.axial_stiffness * 2.0 * spline(0.15)[0] / params.belt.length
    # compensated for the tension at rest, the belt sinks in by 1e-5 m more at most
    assert middle - tension[0] == pytest.approx(more, rel=0.03)
    assert tension[0] == pytest.approx(base, rel=5e-3)
    assert np.mean(tension[-50:]) == pytest.approx(tension[0], rel=1e-3)


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


def test_a_stiff_mount_is_a_fixed_axis() -> None:
    """A carriage of 1e6 kg: 235 N move it by 1e-7 m in 20 ms. Its belt's forces are the same."""
    hard = bd.Contact(linear=5e7, damping=2e3, compensate=False)  # on the radii as they are
    mount = drives.slider(mass=1e6, weight=0.0, preload=235.0, damping=0.0)
    heavy = drives.take_up(mount, contact=hard)
    start = bd.settle(heavy)
    shift = start.travel[0]
    pulleys = [heavy.pulleys[0],
               attrs.evolve(heavy.pulleys[1], center=(0.30 + shift, 0.0), mount=None)]  # fmt: skip
    fixed = attrs.evolve(heavy, pulleys=pulleys)
    torque = drives.torque(fixed)
    times = np.linspace(0.0, 0.02, 21)
    same = attrs.evolve(
        bd.settle(fixed), **{name: getattr(start, name) for name in ("x", "y", "phi")}
    )
    one = bd.simulate(heavy, torque, 0.02, initial=start, t_eval=times, rtol=1e-7)
    other = bd.simulate(fixed, torque, 0.02, initial=same, t_eval=times, rtol=1e-7)
    assert np.ptp(one.mounts.travel) < 2e-7
    # 1e-7 m of 1.1 m, times 20 kN, twice, and as much for vibration
    assert np.max(np.abs(one.joints.force - other.joints.force)) <= 0.01
    assert np.ptp(other.joints.force) > 20.0
