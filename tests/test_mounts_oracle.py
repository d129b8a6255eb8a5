"""Mounts of the core against the oracle's: where they rest, rates, runs, methods.

The oracle was written from MODEL sections 3, 5 and 7 alone; its spline is SciPy's. Its runs are
kept as data (stored_runs.py). The Jacobian is that of test_jacobian.py.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import attrs
import dense
import mounted_drives as drives
import numpy as np
import pytest
import reference
import reference_run
import stored_runs
from bridge import fields, oracle_of
from mounted_drives import DRIVES
from reference_mounts import Path, Sprung
from tiers import extended_if

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
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


@pytest.mark.one_in(3)
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


@pytest.mark.one_in(3)
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


#: Friction of the pivot and stops are the arms' own; every drive has one of the states.
RATES = extended_if(
    lambda case: (
        case[0] not in ("arm with stops", "string, arm with stops")
        and STATES[list(DRIVES).index(case[0]) % 3] != case[1]
    ),
    [(name, how) for name in DRIVES for how in STATES],
)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("name", "how"), RATES)
def test_rates_agree_at_random_states(name: str, how: str) -> None:
    """Rounding only, as in test_oracle.py: 1e-10, where axes are turned and shifted too."""
    for seed in range(2):
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
        unknown = {"phi", "vphi"} if oracle.freedoms == 2 else set()
        for key in rate.keys() - {"t", *dense.ALE_STATES, *dense.COUPLING_STATES} - unknown:
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


def thrown(name: str, state: bd.State) -> bd.State:
    """With its sprung mounts set in motion at 0.5 m/s."""
    params, _ = settled(name)
    oracle = oracle_of(params)
    reach = dense.levers(oracle)
    sprung = np.array([isinstance(one, Sprung) for one in oracle.mounts.values()])
    return attrs.evolve(state, travel_speed=np.where(sprung, 0.5 / reach, 1.0))


def thrown_or(name: str, how: str) -> bd.State:
    """A state at rest or running, or one with its mounts thrown; a path goes on with time."""
    state = running(name) if "running" in how else settled(name)[1]
    state = thrown(name, state) if "thrown" in how else state
    oracle = oracle_of(settled(name)[0])
    paths = np.array([isinstance(one, Path) for one in oracle.mounts.values()])
    return attrs.evolve(state, travel_speed=np.where(paths, 1.0, state.travel_speed))


def case_of(name: str, how: str, window: float = 0.02, **options: Any) -> stored_runs.Case:
    params = DRIVES[name]()
    times = np.linspace(0.0, window, 11)
    torque = drives.torque(params)
    return stored_runs.Case.of(params, torque, lambda: thrown_or(name, how), times, **options)


SPEEDS = {1: 100.0, 2: -80.0}  # rad/s^2
STARTS = {
    "arm": "rest",
    "arm with stops": "thrown",
    "arm with drag": "running",
    "slider": "thrown",
    "slider, gravity": "running",
    "path": "running",
    "far path": "rest",
    "arm and slider, three laws": "running, thrown",
    "arm and path": "rest",
    "no friction": "thrown",
    "string, arm": "running",
    "string, arm with stops": "thrown",
    "string, path": "rest",
    "string, arm and slider, three laws": "running, thrown",
}
RUNS = stored_runs.Runs(
    __name__,
    {
        f"{name}, {how}": lambda name=name, how=how: case_of(
            name, how, 0.05 if name == "far path" else 0.02
        )
        for name, how in STARTS.items()
    }
    | {
        "arm with drag, prescribed speeds": lambda: case_of(
            "arm with drag", "thrown",
            motion={j: (lambda t, a=a: (a * t, a)) for j, a in SPEEDS.items()},
        ),
    },
)  # fmt: skip


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", STARTS)
def test_core_agrees_with_oracle(name: str) -> None:
    """Bounds of test_oracle.py. A mount's place to 1e-6 of the stretch of the whole belt, its
    forces to what errors of joint and contact forces of 1e-6 of the tension make at their lever.
    """
    params, run = DRIVES[name](), RUNS[f"{name}, {STARTS[name]}"]
    oracle, times = run.oracle, run.t
    result = bd.simulate(
        params, run.case.torque, times[-1], initial=run.state, t_eval=times, rtol=3e-10
    )
    tension, strain = drives.tension_of(params), params.info["strain"]
    theta = oracle.pulleys(run.y)[..., 0, :]
    # of no less than 0.1 rad: thrown, pulleys have turned by a hundredth after these short runs
    assert np.max(np.abs(result.pulleys.theta - theta)) <= 1e-8 * max(np.max(np.abs(theta)), 0.1)
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


def test_prescribed_speed_of_a_pulley_on_an_arm() -> None:
    """The torque that it needs has the drag against the arm in it, Z(Omega - q')."""
    params, run = DRIVES["arm with drag"](), RUNS["arm with drag, prescribed speeds"]
    oracle, given, times = run.oracle, run.case.torque, run.t
    end = times[-1]
    speeds = {j: bd.PiecewiseLinear([0.0, end], [0.0, a * end]) for j, a in SPEEDS.items()}
    result = bd.simulate(
        params, given, end, initial=run.state, t_eval=times, rtol=1e-9, motion=speeds
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
