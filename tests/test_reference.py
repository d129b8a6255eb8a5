"""The oracle of `reference.py` against closed forms, conservation laws and symmetries.

Nothing here comes from the C core, and no number was produced by the oracle itself.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import oracle_mounted
import oracle_string
import pytest
import reference as ref
import reference_run as runs
import scipy.integrate
from oracle_drives import contact_by_hand, law_by_hand, no_torque, shaken, small_drive
from reference_friction import Dahl, ElasticPlastic, LuGre
from reference_mounts import Arm, Sprung
from tiers import extended_if, first

LUGRE = LuGre(mu_k=0.5, mu_s=0.8, v_stribeck=0.3, sigma=1e4, damping=0.2, viscous=0.1)
ELASTIC = ElasticPlastic(mu=0.6, stiffness=1e7, damping=5e3)  # c v of 100 N at 1 m/s


def three_pulleys(**changes: Any) -> ref.Reference:
    """Counter-clockwise, unequal."""
    data: dict[str, Any] = {
        "length": 1.55,
        "centers": np.array([[0.0, 0.0], [0.4, -0.05], [0.2, 0.3]]),
        "radii": np.array([0.1, 0.07, 0.05]),
        "inertias": np.array([0.01, 0.02, 0.005]),
        "winding": 1,
    }
    return ref.paper_drive(40, **(data | changes))


MODELS: dict[str, Callable[[], ref.Reference]] = {
    "paper": ref.paper_drive,
    "no friction": lambda: ref.paper_drive(mu_k=None, sigma=None),
    "gravity, bending damping": lambda: ref.paper_drive(
        gravity=(1.0, -9.81), bending_damping=0.02, bending_stiffness=0.5
    ),
    "bearing drag": lambda: ref.paper_drive(drag=np.array([[3.0, 0.1, 0.02], [1.0, 0.0, 0.3]])),
    "three pulleys": three_pulleys,
    "LuGre": lambda: ref.paper_drive(friction=(LUGRE, LUGRE)),
    "elastic/plastic": lambda: ref.paper_drive(friction=(ELASTIC, ELASTIC)),
    "Dahl, LuGre, elastic/plastic": lambda: three_pulleys(
        friction=(Dahl(0.7, 2e4), LUGRE, ELASTIC)
    ),
    "elastic/plastic, none, Dahl": lambda: three_pulleys(friction=(ELASTIC, None, Dahl(0.7, 2e4))),
    "joints": lambda: ref.paper_drive(mesh="joint", gravity=(1.0, -9.81), bending_damping=0.02),
    "joints, Dahl, LuGre, elastic/plastic": lambda: three_pulleys(
        mesh="joint", friction=(Dahl(0.7, 2e4), LUGRE, ELASTIC)
    ),
    "joints, no friction": lambda: three_pulleys(mesh="joint", mu_k=None, sigma=None),
    "prescribed motion": lambda: three_pulleys(
        friction=(LUGRE, ELASTIC, None),
        drag=np.array([[3.0, 0.1, 0.02], [1.0, 0.0, 0.3], [0.0, 0.2, 0.0]]),
        motion={
            0: lambda t: (4.0 + 300.0 * t, 300.0),
            2: lambda t: (-5.0 * math.cos(20.0 * t + 0.5), 100.0 * math.sin(20.0 * t + 0.5)),
        },
    ),
    **oracle_mounted.MODELS,
    **oracle_string.MODELS,
}
#: In the default tier: each belt, each law, drag, motions and mounts.
SHORT = ("paper", "joints, Dahl, LuGre, elastic/plastic", "string, arm, path and slider, motions")


@pytest.fixture(params=extended_if(lambda name: name not in SHORT, MODELS), scope="module")
def model(request: pytest.FixtureRequest) -> ref.Reference:
    return MODELS[request.param]()


# -------------------------------------------------------------------- friction law (CHECKS 1)

MU_K, SIGMA = 0.8, 1e4


def dahl_by_integration(turning_points: list[float]) -> float:
    """dmu/dt of section 4 along x(t) that goes at 1 m/s from point to point, from mu = 0."""
    mu = 0.0
    for start, end in itertools.pairwise(turning_points):
        v = math.copysign(1.0, end - start)
        run = scipy.integrate.solve_ivp(
            lambda t, m, v=v: SIGMA * (v - abs(v) * m / MU_K),
            (0.0, abs(end - start)),
            [mu],
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        )
        mu = float(run.y[0, -1])
    return mu


# The table gives seven decimals: half a unit of the last is 5e-8.
DAHL_NUMBERS = [
    ([0.0, 1e-5], 0.0940025),
    ([0.0, 5e-5], 0.3717909),
    ([0.0, 1e-4], 0.5707962),
    ([0.0, 5e-4], 0.7984556),
    ([0.0, 2e-4, 0.5e-4], -0.5647026),
]


@pytest.mark.parametrize(("path", "expected"), DAHL_NUMBERS)
def test_dahl_against_published_numbers(path: list[float], expected: float) -> None:
    closed = float(ref.dahl_path_exact(path, MU_K, SIGMA)[-1])
    assert closed == pytest.approx(expected, abs=5.1e-8)
    # Two ways to the same number: integration at 1e-12 per step leaves 1e-10.
    assert dahl_by_integration(path) == pytest.approx(closed, abs=1e-10)


def test_dahl_nested_loops_agree_with_the_rate_form() -> None:
    path = [0.0, 3e-4, 1e-4, 2.5e-4, 0.5e-4, 0.6e-4, -4e-4]
    assert dahl_by_integration(path) == pytest.approx(
        float(ref.dahl_path_exact(path, MU_K, SIGMA)[-1]), abs=1e-10
    )
    assert np.all(np.abs(ref.dahl_path_exact(path, MU_K, SIGMA)) < MU_K)


def test_dahl_second_line_as_printed_leaves_the_limits() -> None:
    """Why `dahl_closed` counts the displacement in the direction of motion."""
    mu0, travel = 0.5, -5e-4
    as_printed = (mu0 + MU_K) * math.exp(-SIGMA / MU_K * travel) - MU_K
    assert as_printed > 100 * MU_K
    assert abs(float(ref.dahl_closed(travel, 0.0, mu0, MU_K, SIGMA, -1))) < MU_K


def test_dahl_in_the_drive_follows_the_closed_form() -> None:
    """Friction of links over which the full equations of motion drag a turning pulley.

    Belt and pulleys are so heavy that they keep their speeds while the slip grows to half a
    millimetre. The slip displacement of each link goes into (2.9). Pulley 1 is made a little
    smaller than its wrap, to stay clear.
    """
    model = small_drive(linear_density=1e5, inertias=np.array([1e9, 1e9]))
    y0 = ref.start_state(model)
    model = dataclasses.replace(model, radii=np.array([0.1, 0.099]))
    links = model.links(y0)
    on_0 = links[0, 0] < 0
    links[0, :2, on_0] *= 1 - 1e-3  # p = 0.1 mm
    model.pulleys(y0)[1] = 5.0
    run = runs.integrate(model, y0, no_torque, np.linspace(0.0, 1e-3, 6), tol=1e-8)
    mu, slip = np.moveaxis(model.memory(run.y), 1, 0)
    held = (model.penetration(run.y) > 0)[:, 0].all(axis=0)
    assert held.sum() >= 5
    expected = ref.dahl_closed(slip[:, 0, held], 0.0, 0.0, 0.8, 2e3, -1).astype(float)
    # Slip reaches 5 rad/s * 0.1 m * 1 ms = 0.5 mm, well past mu_k/sigma = 0.4 mm.
    assert slip[-1, 0, held].max() < -4.5e-4
    np.testing.assert_allclose(mu[:, 0, held], expected, atol=1e-7)


# -------------------------------------------------------------------- capstan (CHECKS 2)


@pytest.mark.parametrize(
    ("mu", "ratio"), [(0.2, 1.87446), (0.3, 2.56633), (0.5, 4.81048), (0.8, 12.34528)]
)
def test_capstan_ratio_is_the_limit_of_links(mu: float, ratio: float) -> None:
    assert math.exp(mu * math.pi) == pytest.approx(ratio, abs=5.1e-6)
    errors = []
    for n in (32, 64, 128, 1024):
        half = math.tan(math.pi / n / 2)
        errors.append(abs(((1 + mu * half) / (1 - mu * half)) ** n / ratio - 1))
    # Second order in the angle of a link: a factor 4 each time it is halved.
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)
    assert errors[-1] < 5e-6


def test_capstan_ratio_per_link_from_the_forces_on_a_link() -> None:
    """The same ratio from `rhs`: links on an arc in full slip, in balance at that ratio only."""
    n, mu = 24, 0.5
    model = ref.paper_drive(
        n,
        length=2 * math.pi * 0.1,
        centers=np.array([[0.0, 0.0]]),
        radii=np.array([0.1]),
        inertias=np.array([1.0]),
        contact=(0.0, 1e9, 0.0),
        mu_k=mu,
        winding=1,
        bending_stiffness=0.0,
    )
    delta = 2 * math.pi / n
    half = mu * math.tan(delta / 2)
    ratio = (1 + half) / (1 - half)
    # Joint k between links k-1 and k carries T0 ratio^k along the bisector of the two tangents: a
    # link's end forces then make delta/2 with it. Balance across the link gives N, along it mu N.
    tension = 100.0 * ratio ** np.arange(n)
    left, right = tension[:-1], tension[1:]
    normal = (left + right) * math.sin(delta / 2)
    along = (right - left) * math.cos(delta / 2)
    np.testing.assert_allclose(along, mu * normal, rtol=1e-12)
    # Place the links so that joints and contacts carry just that; only links 1 .. n/2 are used.
    k = np.arange(n)
    angle = k * delta
    p = np.append(normal, 0.0) / model.c2
    # Tangents of neighbours meet under delta: the chord of the centres' circle is 2 R tan(delta/2)
    # for a link of that length; radial offsets come from p, tangential ones from the stretch.
    y = np.zeros(model.size)
    links = model.links(y)
    rho = model.radii[0] - p
    links[0, 0], links[0, 1] = rho * np.cos(angle), rho * np.sin(angle)
    links[0, 2] = angle + math.pi / 2
    model.memory(y)[0] = mu  # belt slides counter-clockwise: v_T > 0
    at = model.contacts(y)
    np.testing.assert_allclose(at.normal[0, :-1], normal, rtol=1e-9)
    e = model.directions(y)
    outward, tangent = at.outward[0], at.tangent[0]
    # Forces of the joints as they should be (along bisectors), contact forces from the oracle.
    bisector = np.array([-np.sin(angle - delta / 2), np.cos(angle - delta / 2)])
    pull = tension * bisector
    net = np.roll(pull, -1, axis=1) - pull + at.normal[0] * outward - at.friction[0] * tangent
    np.testing.assert_allclose(net[:, :-1], 0.0, atol=1e-9 * tension.max())
    np.testing.assert_allclose(e, tangent, atol=1e-12)


# -------------------------------------------------------------------- constants and weights


def test_constants_of_a_link_by_hand() -> None:
    """Section 6 for set S2 and the paper's 60 links of 20 mm."""
    model = ref.paper_drive(bending_damping=1e-4)
    by_hand = {
        "l0": 0.02,
        "mass": 0.002,
        "inertia": 0.002 * 0.02**2 / 12,
        "c_tra": 3.5e6,
        "b_tra": 70.0,
        "c_tor": 0.5,
        "b_tor": 5e-3,
        "c1": 1e9,
        "c2": 5e5,
        "b": 20.0,
    }
    for name, value in by_hand.items():
        assert getattr(model, name) == pytest.approx(value, rel=1e-14), name


def test_error_weights_are_a_max_norm_on_the_scale_of_the_stretch() -> None:
    model = ref.paper_drive()
    weights = runs.error_weights(model, ref.start_state(model), 1e-6, stretch=1e-4)
    weights *= 1e6 * math.sqrt(model.size)
    links = model.links(weights)
    np.testing.assert_allclose(links[0, :, 7], [1e-4, 1e-4, 1e-2], rtol=1e-14)
    np.testing.assert_allclose(links[1, :, 7], [0.1, 0.1, 10.0], rtol=1e-14)
    np.testing.assert_allclose(model.pulleys(weights)[:, 1], [1e-3, 1.0], rtol=1e-14)
    np.testing.assert_allclose(model.memory(weights)[0], 1.0, rtol=1e-14)
    assert np.all(model.memory(weights)[1] > 1e20) and np.all(model.ledger(weights) > 1e20)
    # From the belt line, 1.20832 m of path for 1.2 m of belt, the mean stretch is about the surplus
    # per link, but for chords on the arcs.
    own = runs.error_weights(model, ref.start_state(model), 1.0) * math.sqrt(model.size)
    assert model.links(own)[0, 0, 0] == pytest.approx(0.00832 / 60, rel=0.5)


# -------------------------------------------------------------------- outputs against rhs


@pytest.mark.parametrize("seed", first(1, [1, 2]))
def test_rhs_equals_newton_with_the_forces_of_the_outputs(model: ref.Reference, seed: int) -> None:
    """`rhs` is written flat for speed; here the same accelerations one force at a time."""
    y = shaken(model, seed)
    torque = no_torque
    dy = model.rhs(0.0, y, torque)
    d, d_rate = model.joint_vectors(y)
    bend, bend_rate = model.joint_angles(y)
    pull = model.c_tra * d + model.b_tra * d_rate
    twist = model.c_tor * bend + model.b_tor * bend_rate
    e, at, hand = model.directions(y), model.contacts(y), contact_by_hand(model, y)
    acceleration, alpha = np.zeros((2, model.n_bodies)), np.zeros(model.n_bodies)
    torque_on_pulley = np.zeros(model.n_pulleys)
    at_left, at_right = hand.left.sum(axis=0), hand.right.sum(axis=0)
    grips, rates = np.zeros_like(at.normal), np.zeros_like(at.normal)
    for j, i in zip(*np.nonzero(hand.share), strict=True):
        share, z = hand.share[j, i], model.memory(y)[0, j, i]
        grip, rate = law_by_hand(
            model.laws[j], z, at.velocity[j, i], hand.normal[j, i] / share, model.l0
        )
        grips[j, i], rates[j, i] = share * grip, rate
        if model.laws[j] is not None:
            rates[j, i] -= z * hand.fresh[j, i]
        torque_on_pulley[j] += grips[j, i] * at.distance[j, i]
        rub = -0.5 * grips[j, i] * at.tangent[j, :, i]
        at_left[:, i] += rub
        # a link's friction acts at its middle, that of a joint or mass on the ends that meet there
        at_right[:, i if model.mesh == "paper" else i - 1] += rub
    for i in range(model.n_bodies):
        right = (i + 1) % model.n_bodies
        # of a mass the two ends are those of the bars that meet there
        at_its_right = at_right[:, i if model.freedoms == 3 else i - 1]
        left_end, right_end = at_left[:, i] - pull[:, i], at_its_right + pull[:, right]
        force = left_end + right_end + model.mass * np.asarray(model.gravity)
        moment = twist[right] - twist[i]
        for side, at_end in ((+1, right_end), (-1, left_end)):
            arm = side * model.l0 / 2 * e[:, i]
            moment += arm[0] * at_end[1] - arm[1] * at_end[0]
        acceleration[:, i] = force / model.mass
        alpha[i] = moment / model.inertia
    if model.drag is not None:
        w = model.bearing_speeds(y)
        sign = np.array([math.tanh(math.asinh(v)) for v in w / model.omega_0])  # v / sqrt(1 + v^2)
        torque_on_pulley -= model.drag.T[0] * sign
        torque_on_pulley -= model.drag.T[1] * w + model.drag.T[2] * w**2 * np.sign(w)
    torque_on_pulley += model.torques(0.0, y, torque)
    links = model.links(dy)
    # Rounding only: 1e-11 of the largest acceleration.
    np.testing.assert_allclose(links[1, :2], acceleration, atol=1e-11 * abs(acceleration).max())
    for got in links[1, 2:]:
        np.testing.assert_allclose(got, alpha, atol=1e-11 * abs(alpha).max())
    np.testing.assert_allclose(
        model.pulleys(dy)[1], torque_on_pulley / model.inertias, rtol=1e-11, atol=1e-9
    )
    np.testing.assert_array_equal(links[0], model.links(y)[1])
    np.testing.assert_allclose(
        model.ledger(dy), model.powers(0.0, y, torque), rtol=1e-11, atol=1e-9
    )
    np.testing.assert_allclose(at.normal, hand.normal, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(at.share, hand.share, rtol=1e-11, atol=1e-15)
    touching = hand.share > 0
    z_rate, slip_rate = model.memory(dy)
    rubbing = touching & np.array([law is not None for law in model.laws])[:, None]
    np.testing.assert_allclose(slip_rate, np.where(rubbing, at.velocity, 0.0), atol=1e-12)
    np.testing.assert_allclose(z_rate, rates, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(at.friction, grips, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(at.mu * at.normal, grips, rtol=1e-11, atol=1e-9)
    for j, law in enumerate(model.laws):  # where nothing presses, Dahl's coefficient is its state
        held = touching[j] & isinstance(law, Dahl)
        lifted = at.normal[j] == 0
        np.testing.assert_array_equal(at.mu[j, lifted], (model.memory(y)[0, j] * held)[lifted])


def test_states_are_those_that_laws_tell_apart() -> None:
    """The shaken states reach sticking and slipping links, and all of LuGre's velocities."""
    model = ref.paper_drive(friction=(LUGRE, ELASTIC))
    seen = []
    for seed in range(1, 5):
        at = model.contacts(shaken(model, seed))
        holds = at.normal > 0
        seen.append(
            [
                np.sum(holds[0] & (np.abs(at.velocity[0]) < LUGRE.v_stribeck)),
                np.sum(holds[0] & (np.abs(at.velocity[0]) > 2 * LUGRE.v_stribeck)),
                np.sum(holds[1] & (np.abs(at.mu[1]) < 0.99 * ELASTIC.mu)),
                np.sum(holds[1] & (np.abs(at.mu[1]) > (1 - 1e-12) * ELASTIC.mu)),
            ]
        )
    assert np.min(np.sum(seen, axis=0)) > 5


def test_dahl_on_every_pulley_is_dahl() -> None:
    """The law as an object, and the fast way for the same law on all pulleys: the same bits."""
    one, other = ref.paper_drive(), ref.paper_drive(friction=(Dahl(1.0, 1e4),) * 2)
    y = shaken(one, 1)
    np.testing.assert_array_equal(one.rhs(0.0, y, no_torque), other.rhs(0.0, y, no_torque))
    np.testing.assert_array_equal(one.contacts(y).friction, other.contacts(y).friction)


@pytest.mark.parametrize("seed", [1, 2])
def test_torque_of_a_prescribed_motion_makes_that_motion(seed: int) -> None:
    """Set on free pulleys, it gives every link and pulley the rates that the prescription gave."""
    model = MODELS["prescribed motion"]()
    y = shaken(model, seed)
    needed = model.torques(0.0, y, no_torque)
    assert np.all(np.abs(needed[[0, 2]]) > 0.1) and needed[1] == 0
    dy = model.rhs(0.0, y, no_torque)
    np.testing.assert_array_equal(model.pulleys(dy)[0], model.pulleys(y)[1])
    assert model.pulleys(dy)[1, 0] == 300.0
    assert model.pulleys(dy)[1, 2] == 100.0 * math.sin(0.5)
    free = dataclasses.replace(model, motion={})
    # Rounding of the sums over links in (2.12), 1e-11 as above.
    np.testing.assert_allclose(free.rhs(0.0, y, lambda *_: needed), dy, rtol=1e-11, atol=1e-9)
    # What torques are set on it means nothing, whatever they are.
    absurd = np.array([np.nan, 0.0, np.inf])
    np.testing.assert_array_equal(model.rhs(0.0, y, lambda *_: absurd), dy)
    # Nor does a speed of the state that is not the prescribed one.
    astray = y.copy()
    model.pulleys(astray)[1, [0, 2]] += 1.0
    np.testing.assert_array_equal(model.rhs(0.0, astray, no_torque), dy)
    np.testing.assert_array_equal(model.follow(0.0, astray), y)


def test_joints_of_a_laid_ring_run_on_its_pulley() -> None:
    """Section 3: chords l0 long on the circle of contact stand for arcs l0 long on the radius.

    A ring of n unstretched links round one pulley of that circumference is a regular polygon: its
    joints close, and touch without pressing.
    """
    n, radius = 11, 0.1
    model = ref.paper_drive(
        n,
        length=2 * math.pi * radius,
        centers=np.array([[0.3, -0.2]]),
        radii=np.array([radius]),
        inertias=np.array([1.0]),
        winding=1,
        mesh="joint",
    )
    angle = 2 * math.pi * np.arange(n) / n
    apothem = model.l0 / (2 * math.tan(math.pi / n))
    y = model.pack(
        {
            "x": 0.3 + apothem * np.cos(angle),
            "y": -0.2 + apothem * np.sin(angle),
            "phi": angle + math.pi / 2,
            "vphi": np.full(n, 4.0),
            "vx": -4.0 * apothem * np.sin(angle),
            "vy": 4.0 * apothem * np.cos(angle),
            "omega": np.array([4.0]),
        }
    )
    # Rounding of 1 m; turning as one with the pulley, no joint slips on it, nor moves inwards.
    assert np.abs(model.penetration(y)).max() < 1e-15
    assert np.abs(model.joint_vectors(y)[0]).max() < 1e-15
    assert np.abs(model.contacts(y).velocity).max() < 1e-14
    assert np.abs(model.contacts(y).rate).max() < 1e-14
    assert model.inertia == pytest.approx(2 * model.mass / 2 * (model.l0 / 2) ** 2, rel=1e-15)


def test_penetration_agrees_with_rhs_to_the_last_bit() -> None:
    """Both decide about contact; a link exactly at the edge must not be in one and out of other."""
    model = small_drive()
    y = ref.start_state(model)  # every link on a pulley is at p = 0 within rounding
    model.links(y)[1, :2] = 1.0
    slip_rate = model.memory(model.rhs(0.0, y, no_torque))[1]
    p = model.penetration(y)
    assert np.sum(np.abs(p) < 1e-15) > 10
    np.testing.assert_array_equal(slip_rate != 0, p > 0)


def test_joint_of_a_straight_span_reads_as_a_scalar_spring() -> None:
    """(2.2): on a straight belt the vector form is c dl + b dl/dt."""
    model = ref.paper_drive()
    y = ref.start_state(model)
    span = slice(2, 8)  # joints between links 1 .. 7, all on the upper span
    links = model.links(y)
    links[0, 0, 1:8] = 0.01 + (model.l0 + 1e-4) * np.arange(7)
    links[1, 0, 1:8] = 0.3 * np.arange(7)
    deformation, force = model.joints(y)
    np.testing.assert_allclose(deformation[span], 1e-4, rtol=1e-9)
    expected = 70e3 / 0.02 * 1e-4 + 1.4 / 0.02 * 0.3
    np.testing.assert_allclose(force[span], expected, rtol=1e-9)


# -------------------------------------------------------------------- conservation


def contact_on_the_belt(model: ref.Reference, y: ref.Array) -> ref.Array:
    """Force of each pulley on the whole belt, (n_p, 2)."""
    at, hand = model.contacts(y), contact_by_hand(model, y)
    return np.asarray((hand.left + hand.right - at.friction[:, None] * at.tangent).sum(axis=2))


def test_internal_forces_sum_to_zero(model: ref.Reference) -> None:
    y = shaken(model, 3)
    dy = model.rhs(0.0, y, no_torque)
    contact = contact_on_the_belt(model, y)
    momentum_rate = model.mass * model.links(dy)[1, :2].sum(axis=1)
    weight = model.n_bodies * model.mass * np.asarray(model.gravity)
    largest = model.mass * np.abs(model.links(dy)[1, :2]).max()
    np.testing.assert_allclose(
        momentum_rate, contact.sum(axis=0) + weight, atol=1e-12 * model.n_bodies * largest
    )


def test_angular_momentum_rate_is_that_of_external_forces(model: ref.Reference) -> None:
    """About the origin: links and pulleys turn by torques, pulley bearings, weight - and a couple.

    Contact is internal to links and pulleys, but for the bearing force that balances it on each
    pulley. Wrong lever arms, signs of moments or a torsion that does not cancel all show here.

    The joint of section 2 acts at the two link ends, d apart, so its damping force leaves a couple,
    -b_tra d x d' (the elastic part, along d, leaves none): angular momentum is not quite conserved
    by the model itself. d is the stretch, 1e-4 m, so the couple is small; it is counted here.
    """
    y = shaken(model, 4)
    applied = np.linspace(-20.0, 30.0, model.n_pulleys)
    dy = model.rhs(0.0, y, lambda *_: applied)
    x, a = model.links(y)[0, :2]
    ax, ay, *alpha = model.links(dy)[1]
    spin = model.mass * (x * ay - a * ax) + model.inertia * sum(alpha)
    rate = spin.sum() + np.sum(model.inertias * model.pulleys(dy)[1])
    contact = contact_on_the_belt(model, y)
    axes = model.axes(y)
    bearings = np.sum(axes[:, 0] * contact[:, 1] - axes[:, 1] * contact[:, 0])
    gx, gy = model.gravity
    weight = np.sum(model.mass * (x * gy - a * gx))
    d, d_rate = model.joint_vectors(y)
    couple = -model.b_tra * np.sum(d[0] * d_rate[1] - d[1] * d_rate[0])
    assert rate == pytest.approx(
        model.torques(0.0, y, lambda *_: applied).sum()
        - model.drag_torque(model.bearing_speeds(y)).sum()
        + bearings
        + weight
        + couple,
        abs=1e-11 * np.abs(spin).max() * model.n_bodies,
    )


@pytest.mark.parametrize("seed", first(1, [5, 6, 7]))
def test_power_balance(model: ref.Reference, seed: int) -> None:
    """dE/dt by a finite difference of E along the motion equals drive less losses (section 7)."""
    y = shaken(model, seed)

    def torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
        return np.linspace(-20.0, 30.0, len(omega)) - 0.7 * omega

    dy = model.rhs(0.0, y, torque)
    drive, *losses = model.powers(0.0, y, torque)
    # Fourth-order difference; steps of 1e-9 s move links by 1e-9 m and change their speed by some
    # 1e-3 m/s, so truncation is far below 1e-7, and rounding is 1e-16 E/1e-9 s.
    h = 1e-9
    near = model.energy(y + h * dy) - model.energy(y - h * dy)
    far = model.energy(y + 2 * h * dy) - model.energy(y - 2 * h * dy)
    rate = (8 * near - far) / (12 * h)
    size = abs(drive) + sum(abs(loss) for loss in losses)
    assert rate == pytest.approx(drive - sum(losses), abs=1e-6 * size)
    assert losses[0] > 0 and losses[1] >= 0


def test_a_pulley_never_pulls_and_its_damper_never_drives() -> None:
    clamped = 0
    for seed in range(20):
        model = ref.paper_drive(contact=(1e8, 1e5, 1e4))
        at = model.contacts(shaken(model, seed))
        p = at.penetration
        total = model.c1 * p**2 + model.c2 * p + model.b * at.rate
        clamped += int(np.sum((p > 0) & (total < 0)))
        assert np.all(at.normal >= 0) and np.all(at.normal[p <= 0] == 0)
        np.testing.assert_allclose(at.normal[at.normal > 0], total[at.normal > 0], rtol=1e-12)
        elastic = np.where(p > 0, model.c1 * p**2 + model.c2 * p, 0.0)
        assert np.all((at.normal - elastic) * at.rate >= -1e-9)
    assert clamped > 20  # the states do reach the clamp


def test_link_on_two_overlapping_pulleys_feels_both() -> None:
    """Contact of two pulleys = sum of the contacts with each alone."""
    shared: dict[str, Any] = {"gravity": (0.0, 0.0), "length": 0.8, "linear_density": 0.2}
    centers = np.array([[0.0, 0.0], [0.05, 0.02]])
    radii, inertias = np.array([0.1, 0.1]), np.array([0.01, 0.02])
    both = ref.paper_drive(40, centers=centers, radii=radii, inertias=inertias, **shared)
    alone = [
        ref.paper_drive(40, centers=centers[j : j + 1], radii=[0.1], inertias=inertias[j], **shared)
        for j in range(2)
    ]
    free = ref.paper_drive(40, centers=[[9.0, 9.0]], radii=[0.1], inertias=[1.0], **shared)
    rng = np.random.default_rng(8)
    state: dict[str, Any] = {k: rng.normal(size=40) for k in ("vx", "vy", "vphi")}
    angle = np.linspace(0, -2 * math.pi, 40, endpoint=False)
    state["x"] = 0.025 + 0.08 * np.cos(angle)
    state["y"] = 0.01 + 0.08 * np.sin(angle)
    state["phi"] = angle - math.pi / 2
    mu = rng.uniform(-1, 1, (2, 40))
    omega = np.array([3.0, -4.0])
    y = both.pack(state | {"mu": mu, "omega": omega})
    assert np.sum((both.penetration(y) > 0).all(axis=0)) > 10
    rate = both.rhs(0.0, y, no_torque)
    base = free.rhs(0.0, free.pack(state), no_torque)
    total = both.links(rate) - free.links(base)
    for j, one in enumerate(alone):
        y_one = one.pack(state | {"mu": mu[j : j + 1], "omega": omega[j : j + 1]})
        rate_one = one.rhs(0.0, y_one, no_torque)
        total -= one.links(rate_one) - free.links(base)
        assert one.pulleys(rate_one)[1, 0] == pytest.approx(both.pulleys(rate)[1, j], rel=1e-12)
        np.testing.assert_allclose(one.memory(rate_one)[:, 0], both.memory(rate)[:, j], rtol=1e-12)
    largest = np.abs(both.links(rate)).max(axis=2, keepdims=True)
    assert np.all(np.abs(total[1]) <= 1e-11 * largest[1])


# -------------------------------------------------------------------- symmetries


def moved(
    model: ref.Reference, y: ref.Array, turn: float, shift: tuple[float, float], mirror: bool
) -> tuple[ref.Reference, ref.Array, Callable[[ref.Array], ref.Array]]:
    """Mirror (x -> -x), turn and shift the set-up; returns it, its state, the map of rates."""
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, -s], [s, c]]) @ np.diag([-1.0 if mirror else 1.0, 1.0])
    sign = -1.0 if mirror else 1.0
    changes: dict[str, Any] = {
        name: getattr(model, name)
        for name in (
            *("length", "n_bodies", "linear_density", "axial_stiffness", "axial_damping"),
            *("bending_stiffness", "bending_damping", "radii", "inertias", "contact"),
            *("mu_k", "sigma", "friction", "drag", "mesh", "sides", "compensate"),
        )
    }
    changes["mounts"] = oracle_mounted.moved(model.mounts, matrix, shift)

    def turned(motion: ref.Motion) -> ref.Motion:
        return lambda t: (sign * motion(t)[0], sign * motion(t)[1])

    changes["motion"] = {j: turned(motion) for j, motion in model.motion.items()}
    other = type(model)(
        **changes,
        centers=model.centers @ matrix.T + np.asarray(shift),
        gravity=tuple(matrix @ np.asarray(model.gravity)),
        winding=int(sign) * model.winding,
    )

    def rate_map(dy: ref.Array) -> ref.Array:
        new = dy.copy()
        links = other.links(new)
        links[:, :2] = matrix @ other.links(dy)[:, :2]
        links[:, 2:] *= sign
        other.pulleys(new)[:] *= sign
        other.memory(new)[:] *= sign
        # sliders and paths are turned themselves
        arms = [isinstance(one, Arm) for one in model.mounts.values()]
        other.mount_states(new)[:, arms] *= sign
        return new

    y_new = rate_map(y)
    other.links(y_new)[0, :2] += np.asarray(shift)[:, None]
    other.links(y_new)[0, 2:] += turn + (math.pi if mirror else 0.0)
    return other, y_new, rate_map


@pytest.mark.parametrize(
    ("turn", "shift", "mirror"),
    first(
        1,
        [
            (-2.1, (0.2, 0.5), True),
            (0.7, (0.0, 0.0), False),
            (0.0, (0.4, -0.3), False),
            (0.0, (0.0, 0.0), True),
        ],
    ),
)
def test_rhs_moves_with_the_set_up(
    model: ref.Reference, turn: float, shift: tuple[float, float], mirror: bool
) -> None:
    y = shaken(model, 9)
    other, y_other, rate_map = moved(model, y, turn, shift, mirror)
    expected = rate_map(model.rhs(0.0, y, no_torque))
    got = other.rhs(0.0, y_other, no_torque)
    # Coordinates of 1 m are rounded at 1e-16; times c_tra/m = 2e9 1/s^2 and the pairs' stiffness
    # that is below 1e-10 of the largest acceleration in a shaken belt.
    for part in (model.links, model.pulleys, model.memory, model.mount_states):
        a, b = part(expected), part(got)
        scale = np.abs(a).max(axis=-1, keepdims=True, initial=0.0)
        assert np.all(np.abs(a - b) <= 1e-10 * scale + 1e-12)
    np.testing.assert_allclose(model.ledger(got), model.ledger(expected), rtol=1e-9, atol=1e-9)
    # The shift itself lifts the links: their weight's potential changes by a constant.
    hung = sum(one.weighs for one in model.mounts.values() if isinstance(one, Sprung))
    lift = -(model.n_bodies * model.mass + hung) * np.dot(other.gravity, shift)
    assert other.energy(y_other) == pytest.approx(model.energy(y) + lift, rel=1e-10)


@pytest.mark.parametrize("start", first(1, [17, 1]))
def test_rhs_does_not_depend_on_the_numbering(model: ref.Reference, start: int) -> None:
    """Calling link `start` link 0; the links before it continue the angle past the winding."""
    y = shaken(model, 10)
    renumbered = y.copy()
    for part in (model.links, model.memory):
        part(renumbered)[:] = np.roll(part(y), -start, axis=-1)
    model.links(renumbered)[0, 2:, -start:] += 2 * math.pi * model.winding
    rate, rate_new = model.rhs(0.0, y, no_torque), model.rhs(0.0, renumbered, no_torque)
    for part in (model.links, model.memory):
        a, b = np.roll(part(rate), -start, axis=-1), part(rate_new)
        # cos and sin of an angle 2 pi further differ by 1e-15: see the tolerance above.
        assert np.all(np.abs(a - b) <= 1e-10 * np.abs(a).max(axis=-1, keepdims=True) + 1e-12)
    np.testing.assert_allclose(model.pulleys(rate_new), model.pulleys(rate), rtol=1e-12)
    mounts = [model.mount_states(one) for one in (rate_new, rate)]
    np.testing.assert_allclose(*mounts, rtol=1e-10)


# -------------------------------------------------------------------- geometry


def test_path_of_the_paper_drive() -> None:
    centers, radii = [[0.0, 0.0], [0.29, 0.0]], [0.1, 0.1]
    x, y, phi, winding, path = ref.belt_line(centers, radii, 1.2, 60)
    # Two spans of 0.290 m and one turn of 0.1 m: 1.20832 m (the paper's belt is 1.2 m).
    assert path == pytest.approx(0.58 + 0.2 * math.pi, rel=1e-14)
    assert path == pytest.approx(1.20832, abs=5e-6)
    assert winding == -1
    half = path / 120
    assert (x[0] - half, y[0]) == pytest.approx((0.0, 0.1), abs=1e-15)  # upper left tangent point
    assert np.all(np.diff(x[:14]) > 0) and np.all(phi[:14] == 0)  # upper span first
    assert np.all(np.diff(phi) <= 0) and phi[-1] > -2 * math.pi
    np.testing.assert_allclose(y[(x > 0) & (x < 0.29)] ** 2, 0.01, rtol=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_belt_line_of_three_unequal_pulleys(order: int) -> None:
    centers = np.array([[0.0, 0.0], [0.4, -0.05], [0.2, 0.3]])[::order]
    radii = np.array([0.1, 0.07, 0.05])[::order]
    x, y, phi, winding, path = ref.belt_line(centers, radii, 1.55, 4000)
    assert winding == order
    distance = np.hypot(x[None] - centers[:, :1], y[None] - centers[:, 1:]) - radii[:, None]
    # No link inside a pulley, each pulley touched, the path smooth and closed, length by chords.
    assert distance.min() > -1e-12
    assert np.all((np.abs(distance) < 1e-12).sum(axis=1) > 100)
    step = np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0]))
    assert step.sum() == pytest.approx(path, rel=1e-6)
    assert step.max() <= path / 4000 * (1 + 1e-9)
    assert phi[-1] - phi[0] == pytest.approx(2 * math.pi * order, abs=0.02)
    chord = np.arctan2(np.diff(y), np.diff(x))
    turned = np.mod(chord - 0.5 * (phi[1:] + phi[:-1]) + math.pi, 2 * math.pi) - math.pi
    assert np.abs(turned).max() < 0.01


def test_belt_line_refuses_a_pulley_outside_the_loop() -> None:
    with pytest.raises(ValueError, match="does not go round once"):
        ref.belt_line([[0.0, 0.0], [1.0, 0.0], [0.5, 0.02], [0.5, 1.0]], [0.1] * 4, 3.5, 50)
