"""The oracle of `reference.py` against conservation laws, closed forms and slopes of its energy.

Nothing here comes from the C core, nor from the oracle itself. That the core has the same forces,
rates and runs is the stronger test: `test_oracle.py`, `test_mounts_oracle.py`.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
import reference as ref
import reference_run as runs
import scipy.integrate
from oracle_drives import (
    ARM,
    DAHL,
    DRAG,
    ELASTIC,
    GRAVITY,
    LUGRE,
    MODELS,
    PATH,
    STRAIN,
    arm,
    every,
    no_torque,
    shaken,
    slider,
    small_drive,
)
from reference_friction import Dahl
from reference_mounts import Path, Sprung
from reference_string import as_string
from tiers import extended_if

#: In the default tier: each belt, each law, drag, motions and mounts.
SHORT = ("paper", "joints, three laws", "string, arm, path and slider, motions")


@pytest.fixture(params=extended_if(lambda name: name not in SHORT, MODELS), scope="module")
def model(request: pytest.FixtureRequest) -> ref.Reference:
    return MODELS[request.param]()


def test_momentum_changes_by_external_forces_alone(model: ref.Reference) -> None:
    """Linear, and angular about the origin: bearings, torques, drag, weight - and a couple.

    Wrong lever arms, signs of moments or a torsion that does not cancel all show here. The joint of
    section 2 acts at the two link ends, d apart, so its damping force leaves a couple -b_tra d x d'
    (the elastic part, along d, leaves none).
    """
    y = shaken(model, 4)
    applied = np.linspace(-20.0, 30.0, model.n_pulleys)
    dy = model.rhs(0.0, y, lambda *_: applied)
    at, axes, gravity = model.contacts(y), model.axes(y), np.asarray(model.gravity)
    if model.mesh == "joint":
        on_belt = -model.axis_forces(y)
    else:
        pairs = at.normal[:, None] * at.outward - at.friction[:, None] * at.tangent
        on_belt = pairs.sum(axis=2)
    place, acceleration = model.links(y)[0, :2], model.links(dy)[1, :2]
    weight = model.n_bodies * model.mass * gravity
    np.testing.assert_allclose(
        model.mass * acceleration.sum(axis=1),
        on_belt.sum(axis=0) + weight,
        atol=1e-12 * model.n_bodies * model.mass * np.abs(acceleration).max(),
    )

    def cross(a: ref.Array, b: ref.Array) -> ref.Array:
        return np.asarray(a[0] * b[1] - a[1] * b[0])

    spin = model.mass * cross(place, acceleration)
    rate = spin.sum() + model.inertia * model.links(dy)[1, 2:].sum()
    rate += np.sum(model.inertias * model.pulleys(dy)[1])
    expected = model.torques(0.0, y, lambda *_: applied).sum()
    expected -= model.drag_torque(model.bearing_speeds(y)).sum()
    expected += cross(axes.T, on_belt.T).sum() + model.mass * cross(place.sum(axis=1), gravity)
    expected -= model.b_tra * cross(*model.joint_vectors(y)).sum()
    assert rate == pytest.approx(expected, abs=1e-11 * np.abs(spin).max() * model.n_bodies)


def test_power_balance(model: ref.Reference) -> None:
    """dE/dt by a finite difference of E along the motion equals drive less losses (section 7); the
    quadratures of `rhs`, which is written flat for speed, are the powers of the outputs.
    """
    y = shaken(model, 5)

    def torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
        return np.linspace(-20.0, 30.0, len(omega)) - 0.7 * omega

    dy = model.rhs(0.0, y, torque)
    drive, *losses = model.powers(0.0, y, torque)
    np.testing.assert_allclose(model.ledger(dy), [drive, *losses], rtol=1e-9, atol=1e-9)
    # Fourth-order difference; steps of 1e-9 s move links by 1e-9 m and change their speed by some
    # 1e-3 m/s, so truncation is far below 1e-7, and rounding is 1e-16 E/1e-9 s.
    h = 1e-9
    near = model.energy(y + h * dy) - model.energy(y - h * dy)
    far = model.energy(y + 2 * h * dy) - model.energy(y - 2 * h * dy)
    size = abs(drive) + sum(abs(loss) for loss in losses)
    assert (8 * near - far) / (12 * h) == pytest.approx(drive - sum(losses), abs=1e-6 * size)
    assert losses[0] > 0 and losses[1] >= 0


def test_forces_are_the_slopes_of_the_energy(model: ref.Reference) -> None:
    """Of everything at rest, with friction unstrained, by central differences of E.

    Steps of 1e-7 m: rounding 1e-16 E / 1e-7 m, curvature 1e-14 m^2 times third derivatives, those
    of contact at its edge, 2e6 N/m^2; together below 1e-6 N, or 1e-6 of the largest force.
    """
    y = shaken(model, 4)
    model.links(y)[1] = model.pulleys(y)[1] = model.mount_states(y)[1:] = 0.0
    model.memory(y)[:] = 0.0
    still = dataclasses.replace(model, motion={})
    dy = still.rhs(0.0, y, no_torque)

    def slope(view: Any, at: tuple[int, ...], h: float) -> float:
        ahead, behind = y.copy(), y.copy()
        view(ahead)[at] += h
        view(behind)[at] -= h
        return float(still.energy(ahead) - still.energy(behind)) / (2 * h)

    bound = 1e-6 * model.mass * np.abs(model.links(dy)[1, :2]).max() + 1e-6
    for i in range(0, model.n_bodies, 5):
        for row, mass in enumerate((model.mass, model.mass, model.inertia)[: model.freedoms]):
            reach = 1.0 if row < 2 else 0.5 * model.l0
            force = mass * model.links(dy)[1, row, i]
            found = -slope(still.links, (0, row, i), 1e-7 / reach)
            assert found / reach == pytest.approx(force / reach, abs=bound)
    for m, (j, one) in enumerate(model.mounts.items()):
        reach = float(np.linalg.norm(one.lever(still.mount_states(y)[0, m], model.centers[j])))
        force, stiff = still.mount_forces(y)["belt_force"][m], 0.0
        if isinstance(one, Sprung):
            force = one.moved * still.mount_states(dy)[1, m]
            # what a stop's edge within the step changes
            stiff = one.stop_stiffness * (1e-7 / reach) / reach if one.stops else 0.0
        found = -slope(still.mount_states, (0, m), 1e-7 / reach)
        assert found / reach == pytest.approx(force / reach, abs=bound + stiff)


def test_torque_of_a_prescribed_motion_makes_that_motion() -> None:
    """Set on free pulleys, it gives every link and pulley the rates that the prescription gave;
    what is set on them, or a speed of the state that is another, means nothing.
    """
    model = MODELS["three laws, motions"]()
    y = shaken(model, 1)
    needed, dy = model.torques(0.0, y, no_torque), model.rhs(0.0, y, no_torque)
    assert np.all(np.abs(needed[1:]) > 0.1) and needed[0] == 0
    assert model.pulleys(dy)[1, 2] == -300.0
    free = dataclasses.replace(model, motion={})
    # Rounding of the sums over links in (2.12).
    np.testing.assert_allclose(free.rhs(0.0, y, lambda *_: needed), dy, rtol=1e-11, atol=1e-9)
    astray, absurd = y.copy(), np.array([0.0, np.nan, np.inf])
    model.pulleys(astray)[1, 1:] += 1.0
    np.testing.assert_array_equal(model.rhs(0.0, astray, lambda *_: absurd), dy)
    np.testing.assert_array_equal(model.follow(0.0, astray), y)


def test_dahl_has_its_published_numbers_and_solves_its_equation() -> None:
    """Closed form (2.9) and the law of section 4, or the share of a pivot's friction, along x(t)
    that goes at 1 m/s from point to point.

    The table gives seven decimals: half a unit of the last is 5e-8. Integration at 1e-12 per step
    leaves 1e-10. The last path has loops within loops.
    """
    mu_k, sigma = 0.8, 1e4
    law = Dahl(mu_k, sigma)
    pivot = dataclasses.replace(ARM, friction_stiffness=ARM.friction * sigma / mu_k)
    for path, published in (
        ([0.0, 1e-5], 0.0940025),
        ([0.0, 5e-5], 0.3717909),
        ([0.0, 1e-4], 0.5707962),
        ([0.0, 5e-4], 0.7984556),
        ([0.0, 2e-4, 0.5e-4], -0.5647026),
        ([0.0, 3e-4, 1e-4, 2.5e-4, 0.5e-4, 0.6e-4, -4e-4], None),
    ):
        closed = ref.dahl_path_exact(path, mu_k, sigma).astype(float)
        if published is not None:
            assert closed[-1] == pytest.approx(published, abs=5.1e-8)
        assert np.all(np.abs(closed) < mu_k)
        z = np.zeros(2)
        for begin, end in itertools.pairwise(path):
            v = np.array([math.copysign(1.0, end - begin)])
            run = scipy.integrate.solve_ivp(
                lambda t, z, v=v: [*law.rate(z[:1], v, v, 1.0), *pivot.share_rate(v, z[1:])],
                (0.0, abs(end - begin)), z, method="DOP853", rtol=1e-12, atol=1e-13,
            )  # fmt: skip
            z = run.y[:, -1]
        assert z == pytest.approx(closed[-1] / np.array([1.0, mu_k]), abs=1e-10)


def ring(n: int, **changes: Any) -> tuple[ref.Reference, ref.Array]:
    """A belt round one pulley as long as its circumference; directions of its parts from there."""
    given = {"length": 0.2 * math.pi, "centers": np.array([[0.3, -0.2]]), "radii": [0.1]}
    model = ref.paper_drive(n, mesh="joint", winding=1, inertias=[1.0], **given, **changes)
    angle = 2 * math.pi * np.arange(n) / n
    return model, np.stack((np.cos(angle), np.sin(angle)))


def turning(model: ref.Reference, at: ref.Array, distance: float, speed: float) -> ref.Array:
    """The ring so far from the axis, turning with the pulley."""
    (x, y), (vx, vy) = model.centers[0][:, None] + distance * at, speed * distance * at[::-1]
    phi = np.unwrap(np.arctan2(at[1], at[0])) + math.pi / 2
    return model.pack({"x": x, "y": y, "phi": phi, "vx": -vx, "vy": vy,
                       "vphi": np.full(len(x), speed), "omega": [speed]})  # fmt: skip


@pytest.mark.parametrize("belt", ["links", "string"])
def test_a_laid_ring_runs_on_its_pulley(belt: str) -> None:
    """Section 3: chords l0 long on the circle of contact stand for arcs l0 long on the radius.

    Unstretched, it is a regular polygon: its joints close, and touch without pressing. Turned as
    one with the pulley nothing slips. Rounding of 1 m and 1 m/s.
    """
    n = 11
    model, at = ring(n)
    if belt == "string":
        model = as_string(model)
    corner = model.l0 / (2 * math.sin(math.pi / n))
    assert corner == pytest.approx(model.contact_radii[0], rel=1e-15)
    distance = corner if belt == "string" else model.l0 / (2 * math.tan(math.pi / n))
    y = turning(model, at, distance, 4.0)
    contacts = model.contacts(y)
    assert max(np.abs(model.penetration(y)).max(), np.abs(model.joints(y)[0]).max()) < 1e-15
    assert max(np.abs(contacts.velocity).max(), np.abs(contacts.rate).max()) < 1e-14


def test_a_string_that_turns_freely_carries_its_centrifugal_force() -> None:
    """T = rho A v^2 l0/lambda: 2 T sin(pi/n) holds a mass, m w^2 r, on a polygon of sides lambda.

    Found with the tension that stretches the bars so, away from the pulley; damping has no part in
    a motion as a whole.
    """
    n, speed = 24, 300.0
    links, at = ring(n)
    model, half = as_string(links), math.sin(math.pi / n)
    # c (lambda - l0) 2 sin(pi/n) = m w^2 r, lambda = 2 r sin(pi/n)
    distance = (
        model.c_tra * model.l0 * 2 * half / (4 * model.c_tra * half**2 - model.mass * speed**2)
    )
    y = turning(model, at, distance, speed)
    assert model.penetration(y).max() < 0.0
    stretch, tension = model.joints(y)
    expected = model.linear_density * (speed * distance) ** 2 * model.l0 / (model.l0 + stretch)
    np.testing.assert_allclose(tension, expected, rtol=1e-11)
    dy = model.rhs(0.0, y, no_torque)
    towards = -(speed**2) * distance * at
    np.testing.assert_allclose(model.links(dy)[1], towards, atol=1e-10 * speed**2 * distance)
    assert model.ledger(dy)[1] <= 1e-20


@pytest.mark.parametrize("order", [1, -1])
def test_belt_line(order: int) -> None:
    """Of the paper's drive in numbers; of three unequal pulleys, run either way, no link inside a
    pulley, each touched, path smooth and closed, length by chords.
    """
    x, y, phi, winding, path = ref.belt_line([[0.0, 0.0], [0.29, 0.0]], [0.1, 0.1], 1.2, 60)
    assert path == pytest.approx(0.58 + 0.2 * math.pi, rel=1e-14) and winding == -1
    assert (x[0] - path / 120, y[0]) == pytest.approx((0.0, 0.1), abs=1e-15)  # upper left
    np.testing.assert_allclose(y[(x > 0) & (x < 0.29)] ** 2, 0.01, rtol=1e-12)
    centers = np.array([[0.0, 0.0], [0.4, -0.05], [0.2, 0.3]])[::order]
    radii = np.array([0.1, 0.07, 0.05])[::order]
    x, y, phi, winding, path = ref.belt_line(centers, radii, 1.55, 4000)
    assert winding == order
    distance = np.hypot(x[None] - centers[:, :1], y[None] - centers[:, 1:]) - radii[:, None]
    assert distance.min() > -1e-12
    assert np.all((np.abs(distance) < 1e-12).sum(axis=1) > 100)
    step = np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0]))
    assert step.sum() == pytest.approx(path, rel=1e-6)
    assert step.max() <= path / 4000 * (1 + 1e-9)
    assert phi[-1] - phi[0] == pytest.approx(2 * math.pi * order, abs=0.02)


def test_constants_of_a_link_and_what_is_chosen_of_a_mount_by_hand() -> None:
    """Section 6 for set S2 and the paper's 60 links of 20 mm; section 5."""
    model = ref.paper_drive(bending_damping=1e-4)
    assert [model.l0, model.mass, model.inertia, model.c_tra, model.b_tra, model.c_tor, model.b_tor,
            model.c1, model.c2, model.b] == pytest.approx(
        [0.02, 0.002, 0.002 * 0.02**2 / 12, 3.5e6, 70.0, 0.5, 5e-3, 1e9, 5e5, 20.0], rel=1e-14
    )  # fmt: skip
    turned = arm({"stops": (-0.1, 0.1)})
    k = 50 * 4 * 8e3 * math.hypot(0.08, 0.035) ** 2 / turned.length
    one = turned.mounts[1]
    assert [one.friction_stiffness, one.stop_stiffness, one.stop_damping] == pytest.approx(
        [0.4 / 0.01, k, math.sqrt(k * 0.004)]
    )
    slid = slider().mounts[1]
    assert (slid.moved, slid.weighs, slid.pull) == pytest.approx((11.0, 2.0, 9 * 9.80665))
    assert slid.friction_stiffness == pytest.approx(8.0 / (0.01 * 0.08))
    assert slid.stop_stiffness == pytest.approx(200 * 8e3 / slider().length)


def test_path_goes_through_its_points_and_rests_outside() -> None:
    """And between two points it is the cubic with these ends and no slope: 3 s^2 - 2 s^3."""
    center = np.array([0.3, -0.1])
    for t, d in zip(PATH.t, np.asarray(PATH.displacement), strict=True):
        assert PATH.place(t, center) == pytest.approx(center + d, abs=1e-16)
    for t in (-1.0, PATH.t[0], PATH.t[-1], 2.0):
        assert PATH.lever(t, center) == pytest.approx([0.0, 0.0], abs=1e-12)
    two, end = Path(t=(0.1, 0.3), displacement=((0.0, 0.0), (0.02, -0.01))), np.array([0.02, -0.01])
    s = 0.35
    place, slope = center + end * (3 * s**2 - 2 * s**3), end * (6 * s - 6 * s**2) / 0.2
    assert two.place(0.1 + 0.2 * s, center) == pytest.approx(place, abs=1e-15)
    assert two.lever(0.1 + 0.2 * s, center) == pytest.approx(slope, abs=1e-13)


@pytest.mark.parametrize(("gravity", "stops"), [((0.0, 0.0), (-1e-5, 1e-5)), (GRAVITY, None)])
def test_mounts_rest_where_the_energy_of_line_and_mounts_is_least(
    gravity: tuple[float, float], stops: tuple[float, float] | None
) -> None:
    """Of E A L/2 strain^2 and what the mounts store, by differences, for an arm and a slider.

    On hard pulleys, 1e-9 m deep, without bending: the tension at rest is the line's.
    """
    model = every(gravity=gravity, contact=(0.0, 1e12, 0.0), bending_stiffness=0.0)
    mounts = {**model.mounts, 1: dataclasses.replace(ARM, stops=stops)}
    model = dataclasses.replace(model, mounts=mounts)

    def energy(travel: ref.Array) -> float:
        centers, total = model.centers.copy(), 0.0
        for (j, one), q in zip(model.mounts.items(), travel, strict=True):
            centers[j] = one.place(q, model.centers[j])
            if isinstance(one, Sprung):
                total += float(one.stored(q)) - one.weighs * float(centers[j] @ gravity)
        path = ref.belt_line(centers, model.radii, model.length, 36, model.sides)[-1]
        strain = path / model.length - 1
        return total + 0.5 * model.axial_stiffness * model.length * strain**2

    assert np.abs(model.rest[[0, 2]]).min() > 1e-7 and model.rest[1] == PATH.t[0]
    h = 1e-7
    for m in (0, 2):
        ahead, behind = (energy(model.rest + s * h * np.eye(3)[m]) for s in (1, -1))
        # rounding of the line's length, some 4e-16 m, under 50 N, over the step
        assert (ahead - behind) / (2 * h) == pytest.approx(0.0, abs=4e-16 * 50 / h)


@pytest.mark.extended(guard="test_mounts_oracle.py::test_settled_state_is_the_oracles")
@pytest.mark.parametrize("name", ["paper", "string", "slider, LuGre", "arm in its stops"])
def test_settled_belt_and_mount_are_in_equilibrium(name: str) -> None:
    """No force is left on links or mount. The paper's belt has the same tension all round, but for
    its bending (EI/R^2 = 1 N); a string but for the corners of its polygon, half the turn from bar
    to bar, and the compliance of the contact, 0.1 %; a mount rests where the belt line has it, but
    for the depth of contact under another tension than the line's, and the polygon of links.
    """
    model = MODELS[name]()
    y = runs.settle(model, ref.start_state(model))
    dy, tension = model.rhs(0.0, y, no_torque), model.joints(y)[1]
    assert np.abs(model.mass * model.links(dy)[1, :2]).max() < 1e-6  # N, of 50 N at least
    if name == "paper":
        assert np.ptp(tension) < 2.0 and tension.min() > 100
    elif name == "string":
        half = 0.5 * model.l0 / model.radii[0]
        assert tension.max() / tension.min() - 1 < 0.5 * half**2 + 1e-3
    for m, (j, one) in enumerate(model.mounts.items()):
        assert one.moved * model.mount_states(dy)[1, m] == pytest.approx(0.0, abs=1e-6)
        reach = float(np.linalg.norm(one.lever(0.0, model.centers[j])))
        moved = (model.mount_states(y)[0, m] - model.rest[m]) * reach
        assert abs(moved) < 0.1 * model.length * STRAIN


def light(**changes: Any) -> ref.Reference:
    """Pulleys so light that links slip, land and leave."""
    drag = np.array([[0.5, 1e-3, 0.0], [0.1, 0.0, 1e-4]])
    return small_drive(inertias=np.array([5e-4, 5e-4]), drag=drag, **changes)


#: From rest to 20 rad/s, which is reached after 10 ms.
STARTED = {0: lambda t: (-2000.0 * t, -2000.0) if t < 0.01 else (-20.0, 0.0)}
RUNS = {
    "Dahl": lambda: light(friction=(DAHL, DAHL)),
    "Dahl, string": lambda: as_string(light(friction=(DAHL, DAHL))),
    "LuGre and elastic/plastic": lambda: light(friction=(LUGRE, ELASTIC)),
    "LuGre and none": lambda: light(friction=(LUGRE, None)),
    "prescribed motion": lambda: light(friction=(LUGRE, ELASTIC), motion=STARTED),
    "arm with drag, thrown against its stops": lambda: arm(
        {"stops": (-0.01, 0.01)}, drag=np.array([DRAG] * 3)
    ),
    "arm, path and slider": every,
}


@pytest.mark.extended(guard="test_reference.py::test_power_balance")
@pytest.mark.parametrize("name", RUNS)
def test_books_of_a_run_balance_and_friction_keeps_its_limits(name: str) -> None:
    """To 1e-6 of the work done: each step errs by less than 1e-6 of the stretch, and the energy of
    a stretch of 1e-2 l0 is a joule. Where no contact is, no friction is shown. A prescribed pulley
    turns as prescribed, a path goes with time.
    """
    model = RUNS[name]()
    y0 = runs.settle(model, ref.start_state(model))
    for m, (j, one) in enumerate(model.mounts.items()):
        reach = float(np.linalg.norm(one.lever(0.0, model.centers[j])))
        thrown = 4.0 if "thrown" in name else 0.3
        model.mount_states(y0)[1, m] = thrown / reach if isinstance(one, Sprung) else 1.0

    def ramp(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
        out = np.zeros_like(omega)
        if not model.motion:
            out[0] = -20.0 * min(t / 0.01, 1.0) if not model.mounts else -2.0 * min(t / 0.004, 1.0)
        return out

    times = np.linspace(0.0, 0.008 if model.mounts else 0.02, 101)
    with np.errstate(over="ignore", invalid="ignore"):  # SciPy's first trial step is far too long
        run = runs.integrate(model, y0, ramp, times, tol=1e-6, breakpoints=[0.004, 0.01])
    ledger = model.ledger(run.y)
    work = np.abs(ledger).max()
    if model.mounts:
        work += model.energy_terms(y0)["moved mounts"]
    assert np.abs(model.residual(run.y, run.y[0])).max() < 1e-6 * work
    assert ledger[-1, 3] > 0.0
    # of dense output, before it is clipped; masses slip by half a bar at once where they land
    assert run.mu_excess < (1e-5 if "string" in name or model.mounts else 1e-6)
    lost = model.penetration(run.y) <= 0
    states = model.memory(run.y)
    assert model.mounts or np.any(lost[0] != lost[-1])
    assert not states[np.broadcast_to(lost[:, None], states.shape)].any()
    if model.motion:
        exact = np.where(times < 0.01, -1000.0 * times**2, 0.1 - 20.0 * times)
        assert np.abs(model.pulleys(run.y)[:, 0, 0] - exact).max() <= run.steps * 1e-9
    if name == "arm, path and slider":
        assert model.mount_states(run.y)[:, 0, 1] == pytest.approx(times, abs=1e-15)
    if "thrown" in name:
        assert model.mount_states(run.y)[:, 0, 0].max() > 0.5 * model.mounts[1].stops[1]
    if name == "Dahl":  # a reset is at p = 0, seen from a second run that stops just there
        time, pulley, link = run.resets[len(run.resets) // 2]
        around = [0.0, time - 1e-7, time + 1e-7]
        y = runs.integrate(model, run.y[0], ramp, around, tol=1e-6, breakpoints=[0.004, 0.01]).y
        p = model.penetration(y)[:, pulley, link]
        # in 1e-7 s a link recedes by less than 1e-6 m (10 m/s)
        assert 0 < p[1] < 1e-6 and -1e-6 < p[2] <= 0
        assert model.memory(y)[1, 1, pulley, link] != 0
        assert not model.memory(y)[2, :, pulley, link].any()


def test_what_is_no_drive_or_state_is_refused_and_packing_loses_nothing() -> None:
    model = ref.paper_drive()
    y = shaken(model, 12)
    state = model.unpack(y, 0.25)
    np.testing.assert_array_equal(model.pack(state), y)
    single = state | {"mu": state["mu"].sum(axis=0), "slip": state["slip"].sum(axis=0)}
    np.testing.assert_array_equal(model.pack(single), y)
    single["mu"] = np.where((model.penetration(y) > 0).any(axis=0), 0.0, 0.1)
    still, outside = np.zeros(model.size), [[0.0, 0.0], [1.0, 0.0], [0.5, 0.02], [0.5, 1.0]]
    moved = small_drive(motion={1: lambda t: (3.0, 0.0)})
    for make, message in (
        (lambda: model.pack(single), "touches no pulley"),
        (lambda: ref.belt_line(outside, [0.1] * 4, 3.5, 50), "does not go round once"),
        (lambda: arm(mesh="paper"), "contact along the links"),
        (lambda: arm(mounts={5: ARM}), "needs its pulley"),
        (lambda: as_string(model, bending_stiffness=0.01), "does not bend"),
        (lambda: runs.integrate(moved, still[: moved.size], no_torque, [0.0]), "another speed"),
    ):
        with pytest.raises(ValueError, match=message):
            make()
