"""Mounts of the core against the oracle's: rates, every entry of the Jacobian, runs, methods.

The oracle was written from MODEL sections 3, 5 and 7 alone; its spline is SciPy's.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import attrs
import dense
import mounted_drives as drives
import numpy as np
import pytest
import reference
import reference_run
import test_jacobian
from bridge import fields, oracle_of
from mounted_drives import DRIVES, METHODS
from reference_mounts import Path, Sprung
from slow import slow_if
from test_kernels import available

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
WINDOW = 0.05
STATES = ("moving", "saturated", "stops")
FORCES = ("spring_force", "damper_force", "friction_force", "stop_force", "belt_force")


@cache
def settled(name: str) -> tuple[bd.Params, bd.State]:
    params = DRIVES[name]()
    return params, bd.settle(params)


@cache
def running(name: str, t: float = 0.03) -> bd.State:
    params, start = settled(name)
    return bd.simulate(params, drives.torque(params), t, initial=start, t_eval=[t]).final_state


# -------------------------------------------------------------------- places


@pytest.mark.parametrize("name", DRIVES)
def test_the_belt_line_is_where_mounts_rest(name: str) -> None:
    """Tension and strain that the drive reports are those of the balance of line and mounts."""
    params, _ = settled(name)
    oracle = oracle_of(params)
    assert params.mounted == oracle.mounted
    centers = oracle.axes(oracle.pack({"x": 0.0, "y": 0.0, "phi": 0.0}))
    path = reference.belt_line(centers, oracle.radii, oracle.length, oracle.n_bodies, oracle.sides)[
        -1
    ]
    strain = path / oracle.length - 1
    # rounding of the line's length against the stretch, some 1e-14 of it, and of the balance
    assert params.info["strain"] == pytest.approx(strain, rel=1e-10)
    assert params.info["strain_tension"] == pytest.approx(
        oracle.axial_stiffness * strain, rel=1e-10
    )


@pytest.mark.parametrize("name", DRIVES)
def test_settled_state_is_the_oracles(name: str) -> None:
    """No force is left on links or mounts, friction apart, and the energy is no other minimum's."""
    params, start = settled(name)
    oracle = oracle_of(attrs.evolve(params, friction=None, pulleys=[
        attrs.evolve(one, friction=None) for one in params.pulleys]))  # fmt: skip
    state = fields(start) | {"mu": 0.0, "slip": 0.0}
    y = oracle.pack(state)
    assert np.all(oracle.links(y)[1] == 0.0)
    assert not start.travel_speed.any() and not start.mount_friction.any()
    dy = oracle.rhs(0.0, y, lambda t, theta, omega: np.zeros_like(omega))
    # settled to 1e-9 of the tension
    tension = drives.tension_of(params)
    links = np.abs(oracle.mass * oracle.links(dy)[1, :2]).max()
    assert links <= 2e-9 * tension
    for m, (reach, one) in enumerate(
        zip(dense.levers(oracle), oracle.mounts.values(), strict=True)
    ):
        if isinstance(one, Sprung):
            left = one.moved * abs(oracle.mount_states(dy)[1, m]) / reach
            assert left <= 2e-9 * tension
    # Newton's method from there finds the belt already there: 1e-9 of the stretch, and of the line
    best = reference_run.settle(oracle, y, tol=1e-9)
    travel = oracle.mount_states(best)[0] * dense.levers(oracle)
    sprung = [isinstance(one, Sprung) for one in oracle.mounts.values()]
    found = start.travel * dense.levers(oracle)
    assert np.abs(travel - found)[sprung] == pytest.approx(0.0, abs=1e-7 * oracle.length)


# -------------------------------------------------------------------- rates


def shaken(name: str, seed: int, how: str) -> tuple[bd.Params, reference.Reference, dict[str, Any]]:
    """A running state with links and mounts displaced and moving, links on and off the pulleys."""
    params, _ = settled(name)
    oracle = oracle_of(params)
    rng = np.random.default_rng(seed)
    state = fields(running(name))
    n = oracle.n_bodies
    for key, scale in {
        "x": 1e-4,
        "y": 1e-4,
        "phi": 1e-2,
        "vx": 1.0,
        "vy": 1.0,
        "vphi": 50.0,
    }.items():
        state[key] = state[key] + scale * rng.standard_normal(n)
    state["omega"] = state["omega"] + 5.0 * rng.standard_normal(oracle.n_pulleys)
    state = drives.shake_mounts(oracle, state, seed, how)
    touching = (oracle.penetration(oracle.pack({**state, "mu": 0.0, "slip": 0.0})) > 0).any(axis=0)
    size = n if oracle.n_states == 1 else (oracle.n_states, n)
    state["mu"] = np.where(touching, rng.uniform(-0.5, 0.5, size), 0.0)
    if any(law is not None and not law.bound < np.inf for law in oracle.laws):
        state["mu"] *= 1e-6  # a stretch [m]
    if any(law is None for law in oracle.laws):
        free = [j for j, law in enumerate(oracle.laws) if law is None]
        on = (oracle.penetration(oracle.pack({**state, "mu": 0.0, "slip": 0.0})) > 0)[free]
        state["mu"] = np.where(on.any(axis=0), 0.0, state["mu"])
    if not any(oracle.laws):
        state["mu"] = np.zeros(0)
    state["slip"] = np.zeros(n if np.size(state["mu"]) else 0)
    return params, oracle, state


@pytest.mark.parametrize("how", STATES)
@pytest.mark.parametrize("name", DRIVES)
def test_rates_agree_at_random_states(name: str, how: str) -> None:
    """Rounding only, as in test_oracle.py: 1e-10, where axes are turned and shifted too."""
    for seed in range(3):
        params, oracle, state = shaken(name, seed, how)
        rng = np.random.default_rng(seed)
        torque = rng.standard_normal(len(params.pulleys)) * 5.0
        slots = ("mu", "slip") if any(oracle.laws) else ()
        if not params.info["n_states"]:
            state["mu"], slots = np.zeros(0), tuple(one for one in slots if one != "mu")
        y = oracle.pack(
            {"mu": 0.0, "slip": 0.0}
            | {k: v for k, v in state.items() if k in slots or k not in ("mu", "slip")}
        )
        dy = oracle.rhs(state["t"], y, lambda t, a, b, torque=torque: torque)
        expected = oracle.unpack(dy)
        rate = params._model.rate({**state, "mu": np.ravel(state["mu"])}, torque)
        for key in rate.keys() - {"t"} - ({"phi", "vphi"} if oracle.freedoms == 2 else set()):
            want = np.asarray(expected[key])
            want = want.sum(axis=-2).ravel() if want.ndim >= 2 else want
            if key in slots or key not in ("mu", "slip"):
                assert rate[key].shape == want.shape, key
                scale = np.max(np.abs(want), initial=0.0)
                apart = np.max(np.abs(rate[key] - want), initial=0.0)
                assert apart <= 1e-10 * scale, (key, apart / scale)
        for m, one in enumerate(oracle.mounts.values()):  # each by itself
            if isinstance(one, Sprung):
                size = sum(abs(force[m]) for force in oracle.mount_forces(y).values())
                apart = abs(rate["travel_speed"][m] - expected["travel_speed"][m]) * one.moved
                assert apart <= 1e-10 * size, m


def test_states_reach_what_they_are_named_for() -> None:
    """Stops pressed, let go by their damper, and full friction of the pivot occur among them."""
    pressed, released, full = 0, 0, 0
    for seed in range(8):
        _, oracle, state = shaken("arm with stops", seed, "stops")
        stop = oracle.mount_forces(oracle.pack(state))["stop_force"][0]
        pressed, released = pressed + (stop != 0.0), released + (stop == 0.0)
        _, _, state = shaken("arm", seed, "saturated")
        full += abs(state["mount_friction"][0]) == 1.0
    assert pressed >= 2 and released >= 1 and full == 8


@pytest.mark.parametrize("name", ["arm with drag", "arm and slider, three laws", "arm and path"])
def test_levels_agree(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every instruction level: moving axes are in its loops."""
    _, oracle, state = shaken(name, 5, "moving")
    still = np.zeros(oracle.n_pulleys)
    rates = []
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        rates.append(DRIVES[name]()._model.rate(state, still))
    for other in rates[1:]:
        for key in rates[0].keys() - {"t"}:
            scale = np.max(np.abs(rates[0][key]), initial=0.0)
            assert np.max(np.abs(other[key] - rates[0][key]), initial=0.0) <= 1e-12 * scale, key


# -------------------------------------------------------------------- Jacobian


def case_of(name: str, how: str, seed: int = 0) -> test_jacobian.Case:
    """A settled state shaken as in test_jacobian.py, its mounts displaced and moving, off kinks."""
    params, start = settled(name)
    oracle = oracle_of(params)
    for attempt in range(50):
        # the belt is in by some 3e-5 m
        state = drives.shake_mounts(oracle, fields(start), seed + 100 * attempt, how, 1e-5)
        if how == "saturated":
            state["mount_friction"] = 0.97 * state["mount_friction"]
        state = test_jacobian.shaken(oracle, state, seed + attempt)
        if off_the_stops(oracle, state):
            return test_jacobian.Case(params._model, oracle, state)
    raise AssertionError


def off_the_stops(oracle: reference.Reference, state: dict[str, Any]) -> bool:
    """Whether steps of 1e-8 m, and 1e-3 m/s, cross no edge of a stop and no turn of a mount."""
    for m, (reach, one) in enumerate(
        zip(dense.levers(oracle), oracle.mounts.values(), strict=True)
    ):
        if not isinstance(one, Sprung):
            continue
        q, rate = state["travel"][m], state["travel_speed"][m]
        if abs(rate) * reach < 2e-2:
            return False
        for side, depth in enumerate(one.stop_depths(q)):
            if depth > 0.0:
                raw = one.stop_stiffness * depth + one.stop_damping * (rate if side else -rate)
                step = one.stop_stiffness * 2e-8 + one.stop_damping * 2e-2
                if abs(raw) * reach < step or depth * reach < 1e-6:
                    return False
            elif -depth * reach < 1e-6:
                return False
    return True


#: Friction of the pivot and stops are the arms' own.
CASES = slow_if(
    lambda case: case[1] != "moving" and case[0] not in ("arm", "arm on its stop", "string, arm"),
    [(name, how) for name in DRIVES for how in STATES],
)


def assert_entries(case: test_jacobian.Case, j: dense.Array, expected: dense.Array) -> None:
    """Those of test_jacobian.py; a travel moves a pulley against all of its links, so that an entry
    by it is a sum over theirs, which may cancel, and known as they are.
    """
    layout = case.layout
    blocks = layout.blocks()
    column = blocks["travel"]
    over_links = sum(np.abs(expected[:, blocks[name]]).sum(axis=1) for name in ("x", "y"))
    for row, rows in blocks.items():
        apart = np.abs(j[rows, column] - expected[rows, column])
        known = 1e-7 * np.max(over_links[rows], initial=0.0) + 1e-12 * case.fastest
        if row in ("vx", "vy", "vphi"):
            known += 1e-8 * case.fastest
        assert np.max(apart, initial=0.0) <= known, (row, "travel")
    ours, theirs = j.copy(), expected.copy()
    ours[:, column] = theirs[:, column] = 0.0
    test_jacobian.assert_entries(layout, ours, theirs, case.fastest)


@pytest.mark.parametrize(("name", "how"), CASES)
def test_every_entry_of_the_jacobian(name: str, how: str) -> None:
    """(1 - g J) k = g c read off the solver, against differences of the core's and the oracle's
    rates, all unknowns of the mounts included.
    """
    case = case_of(name, how)
    layout, j = case.layout, case.jacobian()
    y = layout.pack(case.state)
    t = case.state["t"]
    slots = dense.slots_of(case.oracle)
    still = np.zeros(case.oracle.n_pulleys)
    of_core = lambda v: layout.pack(case.model.rate(layout.unpack(v, t), still))  # noqa: E731
    for rate in (of_core, dense.rate_of_oracle(case.oracle, layout, slots)):
        expected = dense.jacobian_by_differences(layout, rate, y)
        assert_entries(case, j, expected)
    # a pulley that touches the belt is coupled with it both ways
    blocks = layout.blocks()
    sprung = [isinstance(one, Sprung) for one in case.oracle.mounts.values()]
    stops = [isinstance(one, Sprung) and one.stops for one in case.oracle.mounts.values()]
    if how != "stops" or not any(stops):
        assert np.abs(j[blocks["vx"], blocks["travel"]]).max(axis=0).all()
        assert np.abs(j[blocks["travel_speed"], blocks["x"]]).max(axis=1)[sprung].all()


@pytest.mark.parametrize("n_bodies", [36, 41, 48])
@pytest.mark.parametrize("make", [drives.tensioner, drives.take_up, drives.path])
def test_the_ring_may_close_on_a_mounted_pulley(make: Any, n_bodies: int) -> None:
    """Joint 0, between the last link and the first, in the wrap; with blocks of links that are full
    and with some that are padded.
    """
    params = make(n_bodies=n_bodies)
    oracle = oracle_of(params)
    state = drives.shake_mounts(oracle, fields(bd.settle(params)), 3, "moving", 1e-5)
    state = test_jacobian.shaken(oracle, state, 3)
    on = share_on(oracle, state)
    first = int(np.argmax(on))
    for name in ("x", "y", "phi", "vx", "vy", "vphi", "mu", "slip"):
        state[name] = np.roll(state[name], -first)
    state["phi"][n_bodies - first :] += 2 * np.pi * oracle.winding
    assert share_on(oracle, state)[0] > 0.3
    case = test_jacobian.Case(params._model, oracle, state)
    layout = case.layout
    rate = dense.rate_of_oracle(oracle, layout, dense.slots_of(oracle))
    expected = dense.jacobian_by_differences(layout, rate, layout.pack(state))
    assert_entries(case, case.jacobian(), expected)


def share_on(oracle: reference.Reference, state: dict[str, Any]) -> dense.Array:
    """Of every joint, the share in contact with the mounted pulley."""
    place = {name: value for name, value in state.items() if name not in ("mu", "slip")}
    return np.asarray(oracle.contacts(oracle.pack(place)).share[oracle.mounted[0]])


@pytest.mark.parametrize(("name", "how"), CASES)
def test_solves_leave_rounding(name: str, how: str) -> None:
    """At steps far beyond the stiffest mode, as in test_jacobian.py."""
    case = case_of(name, how)
    j, rng = case.jacobian(), np.random.default_rng(1)
    for g in test_jacobian.STEPS:
        c = case.fastest * rng.uniform(-1, 1, len(j))
        assert test_jacobian.left_over(case, j, g, c) <= test_jacobian.GROWTH, g


# -------------------------------------------------------------------- runs


def thrown(name: str, state: bd.State) -> bd.State:
    """With its sprung mounts set in motion at 0.5 m/s."""
    params, _ = settled(name)
    oracle = oracle_of(params)
    reach = dense.levers(oracle)
    sprung = np.array([isinstance(one, Sprung) for one in oracle.mounts.values()])
    return attrs.evolve(state, travel_speed=np.where(sprung, 0.5 / reach, 1.0))


RUNS = {
    "arm, from rest": lambda: (settled("arm")[1], "arm"),
    "arm, running": lambda: (running("arm"), "arm"),
    "arm with stops, thrown": lambda: (thrown("arm with stops", settled("arm with stops")[1]),
                                       "arm with stops"),
    "arm with drag, running": lambda: (running("arm with drag"), "arm with drag"),
    "slider, thrown": lambda: (thrown("slider", settled("slider")[1]), "slider"),
    "slider, gravity, running": lambda: (running("slider, gravity"), "slider, gravity"),
    "path, from rest": lambda: (settled("path")[1], "path"),
    "path, running": lambda: (running("path", 0.02), "path"),
    "far path": lambda: (settled("far path")[1], "far path"),
    "arm and slider, running": lambda: (running("arm and slider"), "arm and slider"),
    "arm and slider, three laws, thrown": lambda: (
        thrown("arm and slider, three laws", running("arm and slider, three laws")),
        "arm and slider, three laws",
    ),
    "arm and path, from rest": lambda: (settled("arm and path")[1], "arm and path"),
    "no friction, thrown": lambda: (
        thrown("no friction", settled("no friction")[1]), "no friction"
    ),
    "string, arm, running": lambda: (running("string, arm"), "string, arm"),
    "string, arm with stops, thrown": lambda: (
        thrown("string, arm with stops", settled("string, arm with stops")[1]),
        "string, arm with stops",
    ),
    "string, slider, gravity, running": lambda: (
        running("string, slider, gravity"), "string, slider, gravity"
    ),
    "string, path, from rest": lambda: (settled("string, path")[1], "string, path"),
    "string, three laws, thrown": lambda: (
        thrown("string, arm and slider, three laws", running("string, arm and slider, three laws")),
        "string, arm and slider, three laws",
    ),
    "lugre, running": lambda: (running("lugre"), "lugre"),
    "elastic_plastic, running": lambda: (running("elastic_plastic"), "elastic_plastic"),
}  # fmt: skip
SHORT = ("arm, from rest", "slider, thrown", "path, from rest")


@pytest.mark.parametrize("case", slow_if(lambda name: name not in SHORT, RUNS))
def test_core_agrees_with_oracle(case: str) -> None:
    """Bounds of test_oracle.py. A mount's place to 1e-6 of the stretch of the whole belt, its
    forces to what errors of joint and contact forces of 1e-6 of the tension make at their lever.
    """
    start, name = RUNS[case]()
    params, _ = settled(name)
    torque = drives.torque(params)
    times = start.t + np.linspace(0.0, WINDOW, 26)
    result = bd.simulate(params, torque, times[-1], initial=start, t_eval=times, rtol=1e-9)
    oracle = oracle_of(params)
    given = fields(start)
    paths = np.array([isinstance(one, Path) for one in oracle.mounts.values()])
    given["travel_speed"] = np.where(paths, 1.0, given["travel_speed"])  # 0 of a settled state
    kinks = [0.02, *(t for one in oracle.mounts.values() if isinstance(one, Path) for t in one.t)]
    with np.errstate(over="ignore", invalid="ignore"):  # as in test_oracle.py
        run = reference_run.integrate(
            oracle, oracle.pack(given), torque, times, tol=1e-8, breakpoints=kinks
        )
    tension, strain = drives.tension_of(params), params.info["strain"]
    theta = oracle.pulleys(run.y)[..., 0, :]
    assert np.max(np.abs(result.pulleys.theta - theta)) <= 1e-8 * np.max(np.abs(theta))
    _, force = oracle.joints(run.y)
    assert np.max(np.abs(result.joints.force - force)) <= 1e-6 * tension

    travel, rate, share = np.moveaxis(oracle.mount_states(run.y), 1, 0)
    reach = dense.levers(oracle)
    assert result.mounts.travel.shape == travel.shape
    assert np.max(np.abs(result.mounts.travel - travel) * reach) <= 1e-6 * strain * oracle.length
    # waves carry what forces are wrong: velocity is force over rho A c
    wave = np.sqrt(oracle.axial_stiffness / oracle.linear_density)
    assert np.max(np.abs(result.mounts.travel_speed - rate) * reach) <= 1e-5 * strain * wave
    forces = oracle.mount_forces(run.y)
    sprung = [isinstance(one, Sprung) for one in oracle.mounts.values()]
    for key in FORCES:
        ours = getattr(result.mounts, key)
        size = np.abs(forces[key]).max(axis=0) + tension * reach
        assert np.all(np.abs(ours - forces[key])[:, sprung] <= 1e-5 * size[sprung]), key
        if key != "belt_force":
            assert not ours[:, np.logical_not(sprung)].any()
    for m in np.flatnonzero(np.logical_not(sprung)):
        speed = np.abs(oracle.axis_velocities(run.y)[:, oracle.mounted[m]]).max()
        ours, want = result.mounts.belt_force[:, m], forces["belt_force"][:, m]
        assert np.max(np.abs(ours - want)) <= 1e-5 * tension * speed
    end = result.final_state.mount_friction
    assert np.max(np.abs(end - share[-1])) <= 1e-5

    energy = result.energy
    columns = {"joint_damping": "joint_loss", "contact_damping": "contact_loss",
               "friction": "friction_loss", "drag": "drag_loss", "mount_loss": "mount_loss",
               "path_work": "path_work"}  # fmt: skip
    ledger = oracle.ledger(run.y)
    size = np.max(np.abs(ledger[:, 1:]))
    for k, column in enumerate(oracle.columns[1:], start=1):
        ours = getattr(energy, columns[column])
        ours = np.zeros(len(times)) if ours is None else ours
        assert np.max(np.abs(ours - ledger[:, k])) <= 1e-6 * size, column
    terms = oracle.energy_terms(run.y)
    stored = {
        "kinetic": terms["translation"] + terms["rotation"] + terms["pulleys"]
        + terms["moved mounts"],
        "mount": terms["mount"],
    }  # fmt: skip
    if params.gravity != (0.0, 0.0):
        stored["gravity"] = terms["gravity"] + terms["weight of mounts"]
    for key, want in stored.items():
        ours = getattr(energy, key)
        if ours is None:
            assert not any(sprung) and key == "mount"
            continue
        # a potential begins anywhere
        apart = (ours - ours[0]) - (want - want[0])
        assert np.max(np.abs(apart)) <= 1e-5 * max(np.ptp(want), size), key


@pytest.mark.slow
def test_prescribed_speed_of_a_pulley_on_an_arm() -> None:
    """The torque that it needs has the drag against the arm in it, Z(Omega - q')."""
    name = "arm with drag"
    params, start = settled(name)
    given = drives.torque(params)
    speeds = {1: bd.PiecewiseLinear([0.0, 0.03], [0.0, 3.0]),
              2: bd.PiecewiseLinear([0.0, 0.03], [0.0, -2.4])}  # fmt: skip
    times = np.linspace(0.0, 0.03, 16)
    thrown_ = attrs.evolve(start, travel_speed=[3.0])
    result = bd.simulate(
        params, given, times[-1], initial=thrown_, t_eval=times, rtol=1e-9, motion=speeds
    )
    rate = {1: 100.0, 2: -80.0}
    motion = {j: (lambda t, a=a: (a * t, a)) for j, a in rate.items()}
    oracle = dataclasses.replace(oracle_of(params), motion=motion)
    with np.errstate(over="ignore", invalid="ignore"):
        run = reference_run.integrate(
            oracle, oracle.pack(fields(thrown_)), given, times, tol=1e-8, breakpoints=[0.02]
        )
    y = oracle.follow(times, run.y)
    tension = drives.tension_of(params)
    assert np.max(np.abs(result.joints.force - oracle.joints(y)[1])) <= 1e-6 * tension
    travel = oracle.mount_states(y)[:, 0]
    assert np.max(np.abs(result.mounts.travel - travel)) <= 1e-8
    # the last sample is the kink of the speeds, where the acceleration is that before it
    needed = np.array([oracle.torques(t, one, given) for t, one in zip(times, y, strict=True)])
    most = 1e-5 * tension * 0.08
    assert np.max(np.abs(result.pulleys.torque - needed)) <= most
    assert np.ptp(needed[:, 1]) > 1e3 * most


# -------------------------------------------------------------------- methods


@cache
def exact(name: str) -> bd.Result:
    return simulated(name, method="tsit5", rtol=1e-8)


def simulated(name: str, **options: Any) -> bd.Result:
    """From a running state: at rest a pulley of Coulomb drag turns sharply, mount or none."""
    params, _ = settled(name)
    start = running(name)
    times = start.t + np.linspace(0.0, 0.03, 31)
    return bd.simulate(
        params, drives.torque(params), times[-1], initial=start, t_eval=times, **options
    )


@pytest.mark.parametrize("name", slow_if(
    lambda name: name not in ("arm", "arm and slider", "path"),
    ["arm", "arm with stops", "slider, gravity", "path", "arm and slider",
     "arm and slider, three laws", "string, arm and slider, three laws"],
))  # fmt: skip
@pytest.mark.parametrize("method", METHODS)
def test_every_method(method: str, name: str) -> None:
    """Forces err by what was asked, rk4 by less than 1e-4; the balance closes (test_drag.py)."""
    params, _ = settled(name)
    options, expected = METHODS[method], exact(name)
    result = simulated(name, method=method, **options)
    apart = (result.joints.force - expected.joints.force) / drives.tension_of(params)
    assert np.sqrt(np.mean(apart**2)) <= options.get("rtol", 1e-4)
    reach = dense.levers(oracle_of(params))
    moved = (result.mounts.travel - expected.mounts.travel) * reach
    most = options.get("rtol", 1e-4) * params.info["strain"] * params.belt.length
    assert np.max(np.abs(moved)) <= most
    residual = np.max(np.abs(result.energy.residual))
    assert residual <= 10 * options.get("rtol", 1e-4) * result.energy.passed[-1]
