"""The oracle's mounts against balances, limits and closed forms; nothing comes from the C core.

What `test_reference.py` shows of every model it shows of those with mounts too: forces one by one,
momentum, power by differences, symmetries.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import oracle_mounted
import oracle_string
import pytest
import reference as ref
import reference_run as runs
from oracle_drives import contact_by_hand, no_torque, shaken
from oracle_mounted import ARM, GRAVITY, MODELS, PATH, SLIDER
from reference_mounts import Arm, Path, Slider, Sprung
from tiers import extended_if, first

RUN = pytest.mark.extended(guard="test_oracle.py::test_core_agrees_with_oracle")


@pytest.fixture(
    params=extended_if(lambda name: name != "arm, path and slider", MODELS), scope="module"
)
def model(request: pytest.FixtureRequest) -> ref.Reference:
    return MODELS[request.param]()


# -------------------------------------------------------------------- equations


@pytest.mark.parametrize("seed", first(1, [1, 2, 3]))
def test_every_mount_by_hand(model: ref.Reference, seed: int) -> None:
    """Force by force, moments as r x F about the pivot and contact link by link."""
    y = shaken(model, seed)
    dy, at, hand = model.rhs(0.0, y, no_torque), model.contacts(y), contact_by_hand(model, y)
    on_belt = (hand.left + hand.right - at.friction[:, None] * at.tangent).sum(axis=2)
    omega = model.follow(0.0, y)[6 * model.n_bodies + model.n_pulleys :][: model.n_pulleys]
    reported = model.mount_forces(y)
    loss = 0.0
    for m, (j, one) in enumerate(model.mounts.items()):
        q, rate, share = model.mount_states(y)[:, m]
        pull = -on_belt[j]
        if isinstance(one, Path):
            h = 1e-7
            ahead, behind = (one.place(q + d, model.centers[j]) for d in (h, -h))
            slope = (ahead - behind) / (2 * h)
            np.testing.assert_allclose(model.axis_velocities(y)[j], slope, rtol=1e-6, atol=1e-9)
            assert reported["belt_force"][m] == pytest.approx(pull @ slope, rel=1e-6, abs=1e-9)
            assert model.mount_states(dy)[:, m].tolist() == [1.0, 0.0, 0.0]
            continue
        weight = one.weighs * np.asarray(model.gravity)
        if isinstance(one, Arm):
            x, y0 = model.centers[j] - np.asarray(one.pivot)
            arm = complex(x, y0) * complex(math.cos(q), math.sin(q))
            by_belt = arm.real * pull[1] - arm.imag * pull[0]
            total = by_belt + arm.real * weight[1] - arm.imag * weight[0]
            spring = one.preload - one.stiffness * q
            if model.drag is not None:
                c, d, e = model.drag[j]
                w = omega[j] - rate
                total += c * w / math.hypot(w, model.omega_0[j]) + d * w + e * w * abs(w)
        else:
            u = np.asarray(one.direction) / math.hypot(*one.direction)
            by_belt, total = pull @ u, (pull + weight) @ u
            spring = one.preload + one.weight * 9.80665 - one.stiffness * q
        stop = 0.0
        if one.stops is not None:
            k, d = one.stop_stiffness, one.stop_damping
            assert k is not None and d is not None
            if q < one.stops[0]:
                push = max(0.0, k * (one.stops[0] - q) - d * rate)
                stop, lost = push, (push - k * (one.stops[0] - q)) * -rate
                loss += lost
            if q > one.stops[1]:
                push = max(0.0, k * (q - one.stops[1]) + d * rate)
                stop, lost = -push, (push - k * (q - one.stops[1])) * rate
                loss += lost
        total += spring - one.damping * rate - one.friction * share + stop
        loss += one.damping * rate**2 + one.friction * share * rate
        # rounding of sums over the links
        size = sum(abs(f) for f in (by_belt, spring, stop)) + 1e-3
        assert model.mount_states(dy)[1, m] * one.moved == pytest.approx(total, abs=1e-10 * size)
        found = [reported[f"{name}_force"][m] for name in
                 ("spring", "damper", "friction", "stop", "belt")]  # fmt: skip
        expected = [spring, -one.damping * rate, -one.friction * share, stop, by_belt]
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-10 * size)
        zeta = 0.0
        if one.friction:
            assert one.friction_stiffness is not None
            zeta = one.friction_stiffness / one.friction * (rate - abs(rate) * share)
        assert model.mount_states(dy)[2, m] == pytest.approx(zeta, rel=1e-12)
        assert model.mount_states(dy)[0, m] == rate
    assert model.ledger(dy)[5] == pytest.approx(loss, rel=1e-12)
    done = sum(model.axis_velocities(y)[j] @ -on_belt[j] for j, one in model.mounts.items()
               if isinstance(one, Path))  # fmt: skip
    assert model.ledger(dy)[6] == pytest.approx(done, rel=1e-9, abs=1e-12)


@RUN
def test_states_reach_stops_and_their_dampers() -> None:
    """The shaken states press either stop, on the way in and, let go by the damper, on the way out.

    A stop touched while the arm leaves it fast enough does not press.
    """
    model, pressed = MODELS["arm in its stops, gravity, drag"](), []
    for seed in range(1, 30):
        q, rate, _ = model.mount_states(shaken(model, seed))[:, 0]
        one = model.mounts[1]
        assert isinstance(one, Sprung) and one.stops is not None
        side = np.sign(max(q - one.stops[1], 0.0) - max(one.stops[0] - q, 0.0))
        pressed.append((side, np.sign(rate), np.sign(one.stop(q, rate))))
    assert {(1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)} <= set(pressed)
    assert {(1.0, -1.0, 0.0), (-1.0, 1.0, 0.0)} & set(pressed)


@pytest.mark.extended(guard="test_reference.py::test_power_balance")
@pytest.mark.parametrize("name", [*MODELS, *oracle_string.MODELS])
def test_forces_are_the_slopes_of_the_energy(name: str) -> None:
    """Of everything at rest, with friction unstrained, by central differences of E.

    Steps of 1e-7 m: rounding 1e-16 E / 1e-7 m, curvature 1e-14 m^2 times third derivatives, those
    of contact at its edge, 2e6 N/m^2; together below 1e-6 N.
    """
    model = {**MODELS, **oracle_string.MODELS}[name]()
    y = shaken(model, 4)
    model.links(y)[1] = model.pulleys(y)[1] = model.mount_states(y)[1:] = 0.0
    model.memory(y)[:] = 0.0
    still = dataclasses.replace(model, motion={})
    dy, belt = still.rhs(0.0, y, no_torque), still.mount_forces(y)["belt_force"]

    def slope(view: Any, at: tuple[int, ...], h: float) -> float:
        energies = []
        for sign in (1.0, -1.0):
            moved = y.copy()
            view(moved)[at] += sign * h
            energies.append(float(still.energy(moved)))
        return (energies[0] - energies[1]) / (2 * h)

    largest = model.mass * np.abs(model.links(dy)[1, :2]).max()
    for i in range(0, model.n_bodies, 5):
        for row, mass in enumerate((model.mass, model.mass, model.inertia)[: model.freedoms]):
            reach = 1.0 if row < 2 else 0.5 * model.l0
            force = mass * model.links(dy)[1, row, i]
            found = -slope(still.links, (0, row, i), 1e-7 / reach)
            assert found / reach == pytest.approx(force / reach, abs=1e-6 * largest + 1e-6)
    for m, (j, one) in enumerate(model.mounts.items()):
        reach = float(np.linalg.norm(one.lever(still.mount_states(y)[0, m], model.centers[j])))
        force = belt[m]
        if isinstance(one, Sprung):
            force = one.moved * still.mount_states(dy)[1, m]
        found = -slope(still.mount_states, (0, m), 1e-7 / reach)
        stiff = 0.0  # what a stop's edge within the step changes
        if isinstance(one, Sprung) and one.stops is not None:
            stiff = one.stop_stiffness * (1e-7 / reach) / reach
        assert found / reach == pytest.approx(force / reach, abs=1e-6 * largest + 1e-6 + stiff)


# -------------------------------------------------------------------- places


def test_path_goes_through_its_points_and_rests_outside() -> None:
    """And between two points it is the cubic with these ends and no slope: 3 s^2 - 2 s^3."""
    center = np.array([0.3, -0.1])
    for t, d in zip(PATH.t, np.asarray(PATH.displacement), strict=True):
        assert PATH.place(t, center) == pytest.approx(center + d, abs=1e-16)
    for t in (-1.0, PATH.t[0], PATH.t[-1], 2.0):
        assert PATH.lever(t, center) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert PATH.place(5.0, center) == pytest.approx(PATH.place(PATH.t[-1], center), abs=0)
    two = Path(t=(0.1, 0.3), displacement=((0.0, 0.0), (0.02, -0.01)))
    s = 0.35
    place = center + np.array([0.02, -0.01]) * (3 * s**2 - 2 * s**3)
    assert two.place(0.1 + 0.2 * s, center) == pytest.approx(place, abs=1e-15)
    slope = np.array([0.02, -0.01]) * (6 * s - 6 * s**2) / 0.2
    assert two.lever(0.1 + 0.2 * s, center) == pytest.approx(slope, abs=1e-13)


def test_what_is_chosen() -> None:
    model = oracle_mounted.arm({"stops": (-0.1, 0.1)})
    one = model.mounts[1]
    assert isinstance(one, Arm)
    reach = math.hypot(0.08, 0.035)
    assert one.friction_stiffness == pytest.approx(0.4 / 0.01)
    k = 50 * 4 * 8e3 * reach**2 / model.length
    assert one.stop_stiffness == pytest.approx(k)
    assert one.stop_damping == pytest.approx(math.sqrt(k * 0.004))
    slid = oracle_mounted.slider().mounts[1]
    assert isinstance(slid, Slider)
    assert slid.moved == 11.0 and slid.weighs == 2.0
    assert slid.pull == pytest.approx(9 * 9.80665, rel=1e-15)
    assert slid.friction_stiffness == pytest.approx(8.0 / (0.01 * 0.08))
    assert slid.stop_stiffness == pytest.approx(200 * 8e3 / oracle_mounted.slider().length)


@pytest.mark.parametrize(("gravity", "stops"), [((0.0, 0.0), (-1e-5, 1e-5)), (GRAVITY, None)])
def test_mounts_rest_where_the_energy_of_line_and_mounts_is_least(
    gravity: tuple[float, float], stops: tuple[float, float] | None
) -> None:
    """Of E A L/2 strain^2 and what the mounts store, by differences, for an arm and a slider.

    On hard pulleys, 1e-9 m deep, without bending: the tension at rest is the line's.
    """
    hard: dict[str, Any] = {"contact": (0.0, 1e12, 0.0), "bending_stiffness": 0.0}
    model = oracle_mounted.every(gravity=gravity, **hard)
    arm_ = dataclasses.replace(oracle_mounted.ARM, stops=stops)
    model = dataclasses.replace(model, mounts={**model.mounts, 1: arm_})

    def energy(travel: ref.Array) -> float:
        centers, total = model.centers.copy(), 0.0
        for (j, one), q in zip(model.mounts.items(), travel, strict=True):
            centers[j] = one.place(q, model.centers[j])
            if isinstance(one, Sprung):
                total += float(one.stored(q)) - one.weighs * float(centers[j] @ gravity)
        path = ref.belt_line(centers, model.radii, model.length, 36, model.sides)[-1]
        ea = model.axial_stiffness
        return total + 0.5 * ea * model.length * (path / model.length - 1) ** 2

    assert np.abs(model.rest[[0, 2]]).min() > 1e-7
    assert model.rest[1] == PATH.t[0]
    for m in (0, 2):
        one = model.mounts[model.mounted[m]]
        assert isinstance(one, Sprung)
        h = 1e-7
        steps = [model.rest + s * h * np.eye(3)[m] for s in (1, -1)]
        slope = (energy(steps[0]) - energy(steps[1])) / (2 * h)
        # rounding of the line's length, some 4e-16 m, under 50 N, over the step
        assert slope == pytest.approx(0.0, abs=4e-16 * 50 / h)
        assert abs(one.pull) > 1.0


@RUN
@pytest.mark.parametrize("name", ["arm", "slider", "slider, gravity, LuGre",
                                  "arm in its stops, gravity, drag"])  # fmt: skip
def test_settled_belt_and_mount_are_in_equilibrium(name: str) -> None:
    """No force is left on links or mount; it rests where the belt line has it, but for the depth of
    contact under another tension than the line's, and the polygon of links.
    """
    model = MODELS[name]()
    y = runs.settle(model, ref.start_state(model))
    dy = model.rhs(0.0, y, no_torque)
    assert np.abs(model.mass * model.links(dy)[1, :2]).max() < 1e-6
    one = model.mounts[1]
    assert isinstance(one, Sprung)
    forces = {name: float(f[0]) for name, f in model.mount_forces(y).items()}
    lever = one.lever(model.mount_states(y)[0, 0], model.centers[1])
    weight = one.weighs * float(np.dot(model.gravity, lever))
    assert sum(forces.values()) + weight == pytest.approx(0.0, abs=1e-6)
    reach = float(np.linalg.norm(one.lever(0.0, model.centers[1])))
    moved = (model.mount_states(y)[0, 0] - model.rest[0]) * reach
    assert abs(moved) < 0.1 * model.length * oracle_mounted.STRAIN


# -------------------------------------------------------------------- runs


RUNS = {
    "arm": lambda: oracle_mounted.arm({"friction": 0.05}, gravity=GRAVITY),
    "arm with drag, thrown against its stops": lambda: oracle_mounted.arm(
        {"stops": (-0.01, 0.01)}, drag=np.array([oracle_mounted.DRAG] * 3)
    ),
    "slider": lambda: oracle_mounted.slider(
        {"weight": 0.0, "mass": 0.5, "preload": 90.0}, gravity=GRAVITY
    ),
    "path": oracle_mounted.path,
    "arm, path and slider": oracle_mounted.every,
}


@RUN
@pytest.mark.parametrize("name", RUNS)
def test_energy_residual_vanishes(name: str) -> None:
    """The books balance to tol times the work, as without mounts in test_reference_run.py."""
    model = RUNS[name]()
    y0 = runs.settle(model, ref.start_state(model))
    for m, (j, one) in enumerate(model.mounts.items()):
        if isinstance(one, Sprung):
            reach = float(np.linalg.norm(one.lever(0.0, model.centers[j])))
            model.mount_states(y0)[1, m] = (4.0 if "thrown" in name else 0.3) / reach
        else:
            model.mount_states(y0)[1, m] = 1.0

    def torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
        out = np.zeros_like(omega)
        out[0] = -2.0 * min(t / 0.004, 1.0)
        return out

    times = np.linspace(0.0, 0.008, 9)
    with np.errstate(over="ignore", invalid="ignore"):  # SciPy's first trial step is far too long
        run = runs.integrate(model, y0, torque, times, tol=1e-6, breakpoints=[0.004])
    ledger = model.ledger(run.y)
    work = np.abs(ledger).max() + model.energy_terms(y0)["moved mounts"]
    assert np.abs(model.residual(run.y, y0)).max() < 1e-6 * work
    paths = any(isinstance(one, Path) for one in model.mounts.values())
    sprung = any(isinstance(one, Sprung) for one in model.mounts.values())
    assert (ledger[-1, 6] != 0.0) == paths and (ledger[-1, 5] > 0.0) == sprung
    moved = np.ptp(model.mount_states(run.y)[:, 0], axis=0)
    assert np.all(moved > 1e-4)
    if paths:
        m = [isinstance(one, Path) for one in model.mounts.values()].index(True)
        assert model.mount_states(run.y)[:, 0, m] == pytest.approx(times, abs=1e-15)
    if "thrown" in name:
        one = model.mounts[1]
        q = model.mount_states(run.y)[:, 0, 0]
        assert isinstance(one, Sprung) and one.stops is not None and q.max() > 0.5 * one.stops[1]
    assert run.mu_excess < 1e-5


@RUN
def test_friction_of_a_mount_is_dahl_in_closed_form() -> None:
    """Along the travel of a run the share follows (2.9), sigma/mu = kappa/F_m, between turns."""
    model = oracle_mounted.arm(
        {"friction": 0.1, "damping": 0.0}, friction=(None,) * 3, axial_damping=0.1
    )
    y0 = runs.settle(model, ref.start_state(model))
    model.mount_states(y0)[1] = 6.0
    times = np.linspace(0.0, 0.06, 151)
    run = runs.integrate(model, y0, no_torque, times, tol=1e-6)
    q, rate, share = np.moveaxis(model.mount_states(run.y)[..., 0], 1, 0)
    turns = np.nonzero(np.diff(np.sign(rate)))[0]
    assert len(turns) >= 2 and np.abs(share).max() > 0.5
    legs = np.split(np.arange(len(q)), turns + 1)
    for leg in legs:
        if len(leg) > 3:
            expected = ref.dahl_closed(q[leg], q[leg[0]], share[leg[0]], 1.0, 100.0,
                                       int(np.sign(rate[leg[1]])))  # fmt: skip
            # the share was at its weight of 1 in the control of steps of 1e-6
            np.testing.assert_allclose(share[leg], expected.astype(float), atol=1e-5)


def test_mounts_ask_for_contact_along_the_links() -> None:
    with pytest.raises(ValueError, match="contact along the links"):
        oracle_mounted.arm(mesh="paper")
    with pytest.raises(ValueError, match="needs its pulley"):
        oracle_mounted.arm(mounts={5: ARM})


def test_a_mount_that_cannot_move_is_none() -> None:
    """A slider of 1e9 kg moves by nothing: links and pulleys have the rates of a fixed pulley.

    The contact radii of the two are those of the same belt line, if the slider rests where it is
    drawn, which the spring of 1e12 N/m sees to, within 1e-10 m.
    """
    mount = dataclasses.replace(SLIDER, mass=1e9, weight=0.0, stiffness=1e12)
    heavy = oracle_mounted.slider(mounts={1: mount}, drag=np.array([oracle_mounted.DRAG] * 2))
    fixed = dataclasses.replace(heavy, mounts={})
    y = shaken(fixed, 1)
    state = fixed.unpack(y)
    for name in ("travel", "travel_speed", "mount_friction", "ledger"):
        del state[name]
    one, other = fixed.rhs(0.0, y, no_torque), heavy.rhs(0.0, heavy.pack(state | {"travel": 0.0}),
                                                         no_torque)  # fmt: skip
    assert abs(heavy.rest[0]) < 1e-9
    for part in ("links", "pulleys", "memory"):
        a, b = (getattr(m, part)(d) for m, d in ((fixed, one), (heavy, other)))
        assert np.abs(a - b).max() <= 1e-7 * np.abs(a).max()
