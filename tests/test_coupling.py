"""Couplings of a pulley's shaft and its rim: isolators, overrunning clutches, torsional dampers.

Without friction a belt turns no pulley: hub and rim are then two inertias on a spring, whose motion
is known in closed form.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import attrs
import dense
import numpy as np
import pytest
from bridge import fields, oracle_of
from drives import on_mesh
from mounted_drives import DRAG, drive, tensioner
from mounted_drives import METHODS as OF_MOUNTS
from reference_couplings import Coupled, Coupling
from scipy.optimize import brentq
from tiers import ci_if

import beltdyn as bd
from beltdyn import _core
from beltdyn.drive import parameters
from beltdyn.explaining.removals import leave_out, removals_of
from beltdyn.sweeping import names

Array = np.ndarray
METHODS = OF_MOUNTS | {"lie": {"rtol": 1e-3}}

RIM, HUB, STIFFNESS, DAMPING = 1e-3, 3e-3, 20.0, 0.02
ISOLATOR = bd.Isolator(inertia=HUB, stiffness=STIFFNESS, damping=DAMPING)
DECOUPLER = bd.OverrunningClutch(inertia=HUB, stiffness=STIFFNESS, damping=DAMPING)
BACKWARDS = attrs.evolve(DECOUPLER, clockwise=True)
ROLLERS = bd.OverrunningClutch(inertia=HUB)
RING = bd.TorsionalDamper(inertia=HUB, stiffness=STIFFNESS, damping=DAMPING)
NO_TORQUE = bd.Viscous([0.0, 0.0])


def two(coupling: Any, n_bodies: int = 48, **changes: Any) -> bd.Params:
    """A crank and an alternator with a coupling."""
    of_alternator = {name: changes.pop(name) for name in ("drag", "mount") if name in changes}
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01, drag=of_alternator.get("drag")),
        bd.Pulley(center=(0.30, 0.0), radius=0.06, inertia=RIM, coupling=coupling, **of_alternator),
    ]
    return drive(pulleys, n_bodies, **changes)


def turning(params: bd.Params, hub: float, rim: float, windup: float = 0.0) -> bd.State:
    """The belt at rest, hub and rim turning."""
    return attrs.evolve(
        bd.settle(params), omega=[0.0, hub], rim_speed=[rim], windup=[windup], residual=None
    )


# --- closed forms ---------------------------------------------------------------------------------


def ring_down(t: Array, start: float, inertia: float = RIM * HUB / (RIM + HUB)) -> Array:
    """Windup of two inertias on a spring, from rest with this relative speed; and its rate."""
    rate = math.sqrt(STIFFNESS / inertia)
    decay = 0.5 * DAMPING / inertia
    swing = math.sqrt(rate**2 - decay**2)
    z = start / swing * np.exp(-decay * t) * np.sin(swing * t)
    return np.array([z, start * np.exp(-decay * t) * np.cos(swing * t) - decay * z])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("coupling", [ISOLATOR, RING], ids=["isolator", "damper"])
def test_two_inertias_ring_down_as_their_closed_form(coupling: Any, method: str) -> None:
    """Frequency and damping of hub and rim on a spring, by every method to what it is asked for:
    of five swings errors of half a degree of phase are a hundredth, lie's first order more.
    """
    params = two(coupling, friction=None)
    rim = 5.0
    result = bd.simulate(
        params, NO_TORQUE, 0.15, initial=turning(params, 0.0, rim), method=method,
        **METHODS[method],
    )  # fmt: skip
    z, w = ring_down(result.t, rim)
    seen = result.couplings
    bound = {"lie": 0.1, "lbdf2": 0.02}.get(method, 1e-3)
    largest = np.max(np.abs(z))
    assert np.max(np.abs(seen.windup[:, 0] - z)) <= bound * largest
    assert np.max(np.abs(seen.rim_speed[:, 0] - result.pulleys.omega[:, 1] - w)) <= bound * rim
    torque = -(STIFFNESS * z + DAMPING * w)  # on the rim, and as much on the hub
    assert np.max(np.abs(seen.transmitted[:, 0] + torque)) <= 1.5 * bound * STIFFNESS * largest
    # nothing turns both together: angular momentum stays
    momentum = np.array([RIM, HUB]) if coupling is ISOLATOR else np.array([HUB, RIM])
    turned = momentum @ [seen.rim_speed[:, 0], result.pulleys.omega[:, 1]]
    assert np.allclose(turned, turned[0], rtol=1e-9)


def free_wheel(t: Array, start: float, brake: float) -> tuple[Array, float, float]:
    """Speed of the hub of a decoupler that a rim of speed `start` picks up from rest.

    The rim is so heavy that it keeps its speed. Engaged the hub swings as on a wall that moves, up
    to the time at which k z + d w = 0; then it overruns under a braking torque until the rim has
    caught up, what is left of the windup unwinding by itself. Gives both times as well.
    """
    # w' = -(k z + d w) / I_h + brake / I_h while engaged: swings about z = brake / k
    rate, decay = math.sqrt(STIFFNESS / HUB), 0.5 * DAMPING / HUB
    swing, rest = math.sqrt(rate**2 - decay**2), brake / STIFFNESS

    def engaged(t: Any) -> Any:
        a, b = -rest, (start - decay * rest) / swing
        c, s, e = np.cos(swing * t), np.sin(swing * t), np.exp(-decay * t)
        z = rest + e * (a * c + b * s)
        return z, e * ((b * swing - decay * a) * c - (a * swing + decay * b) * s)

    def torque(t: float) -> float:
        z, w = engaged(t)
        return float(STIFFNESS * z + DAMPING * w)

    free = brentq(torque, 0.6 * math.pi / swing, 1.4 * math.pi / swing, xtol=1e-14)
    z_free, w_free = engaged(free)

    def slipping(t: float) -> float:  # k z + d w while it overruns
        after = t - free
        z = z_free * math.exp(-STIFFNESS / DAMPING * after)
        return float(STIFFNESS * z + DAMPING * (w_free + brake / HUB * after))

    again = brentq(slipping, free + 1e-6, free - 1.5 * w_free * HUB / brake, xtol=1e-14)
    w = np.where(t < free, engaged(t)[1], w_free + brake / HUB * (t - free))
    return start - w, free, again


@pytest.mark.filterwarnings("ignore:no_friction")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sense", [1, -1])
def test_a_clutch_comes_free_and_engages_at_the_times_of_its_closed_form(
    method: str, sense: int
) -> None:
    """Speeds to what a method is asked for; and it is free between the two times and at no other:
    to 1 % of a swing, a step.
    """
    coupling = DECOUPLER if sense > 0 else BACKWARDS
    params = two(coupling, friction=None)
    heavy = attrs.evolve(params.pulleys[1], inertia=1e7)  # holds its speed
    params = attrs.evolve(params, pulleys=[params.pulleys[0], heavy])
    brake, start = 1.0, 20.0
    torque = bd.PiecewiseLinear([0.0], [[0.0, -sense * brake]])
    result = bd.simulate(
        params, torque, 0.15, initial=turning(params, 0.0, sense * start), method=method,
        t_eval=np.linspace(0.0, 0.15, 601), **METHODS[method],
    )  # fmt: skip
    speed, free, again = free_wheel(result.t, start, brake)
    until = result.t <= again
    seen = result.couplings
    assert free < again < 0.15
    bound = {"lie": 0.1, "lbdf2": 0.02}.get(method, 2e-3)
    assert np.max(np.abs(sense * result.pulleys.omega[until, 1] - speed[until])) <= bound * start
    assert (seen.windup >= 0.0).all() and (sense * seen.transmitted >= 0.0).all()
    swing = 2.0 * math.pi * math.sqrt(HUB / STIFFNESS)
    apart = {"lie": 0.1, "lbdf2": 0.03}.get(method, 0.01) * swing
    well_free = (result.t > free + apart) & (result.t < again - apart)
    well_on = (result.t > apart) & (result.t < free - apart)
    assert not seen.transmitted[well_free].any()
    assert (sense * seen.transmitted[well_on] > 0.0).all()
    assert sense * seen.transmitted[result.t > again + apart][0] > 0.0


def test_rollers_are_as_stiff_as_is_said() -> None:
    """A clutch without a spring swings at 300 Hz of its hub alone, has 5 % of critical, and is
    printed with what was chosen."""
    params = two(ROLLERS, friction=None)
    state = turning(params, 0.0, 0.0, 1e-4)
    rate = params._model.rate(state._to_core(params), [0.0, 0.0])
    stiffness = HUB * (2.0 * math.pi * 300.0) ** 2
    assert rate["omega"][1] == pytest.approx(stiffness * 1e-4 / HUB, rel=1e-12)
    state = turning(params, 0.0, 1.0, 0.0)
    rate = params._model.rate(state._to_core(params), [0.0, 0.0])
    assert rate["omega"][1] == pytest.approx(0.1 * math.sqrt(stiffness * HUB) / HUB, rel=1e-12)
    told = {name: quantity for name, quantity, _ in params._rows()}
    assert told["pulleys[1].coupling.stiffness"] == f"{stiffness:.10g} N m/rad, chosen"


@pytest.mark.filterwarnings("ignore:not_in_equilibrium")
def test_modes_are_those_of_two_inertias_and_of_a_clutch_as_it_stands() -> None:
    """Undamped frequency and damping ratio of hub and rim on their spring; a clutch swings where it
    is engaged, and has no such mode where it is free.
    """
    state_of: Callable[[bd.Params], bd.State] = bd.settle
    inertia = RIM * HUB / (RIM + HUB)
    rate = math.sqrt(STIFFNESS / inertia)
    params = two(ISOLATOR, friction=None)
    found = bd.modes(params, state_of(params), n=12)
    k = int(np.argmin(abs(found.frequency - rate / (2.0 * math.pi))))
    assert abs(found.eigenvalue[k]) == pytest.approx(rate, rel=1e-6)
    assert found.damping[k] == pytest.approx(0.5 * DAMPING / inertia / rate, rel=1e-5)
    assert found.participation.pulleys[k, 1] == pytest.approx(1.0, abs=1e-6)
    assert found.names[k] == "rotation of rim of pulley 1 against hub of pulley 1"
    for wound, there in ((0.01, True), (0.0, False)):
        params = two(DECOUPLER, friction=None)
        state = turning(params, 0.1 if not there else 0.0, 0.0, wound)
        found = bd.modes(params, state, n=12)
        near = abs(abs(found.eigenvalue) - rate) < 1e-4 * rate
        assert near.any() == there


# --- the oracle -----------------------------------------------------------------------------------


def coupled_oracle(params: bd.Params, motion: Any = None) -> Coupled:
    kinds = {bd.Isolator: "isolator", bd.OverrunningClutch: "clutch", bd.TorsionalDamper: "damper"}
    found = {}
    for j, pulley in enumerate(params.pulleys):
        if (one := pulley.coupling) is not None:
            sense = -1 if getattr(one, "clockwise", False) else 1
            found[j] = Coupling(
                kind=kinds[type(one)], inertia=one.inertia, stiffness=one.stiffness,
                damping=one.damping, sense=sense,
            )  # fmt: skip
    return Coupled(oracle_of(params), found, motion or {})


COUPLINGS = {
    "isolator": ISOLATOR,
    "decoupler": DECOUPLER,
    "clockwise": BACKWARDS,
    "rollers": ROLLERS,
    "damper": RING,
}


def on_arm(coupling: Any) -> bd.Params:
    """A tensioner whose idler has a coupling, and drag between hub and arm."""
    params = tensioner(drag=DRAG)
    first, idler, last = params.pulleys
    return attrs.evolve(params, pulleys=[first, attrs.evolve(idler, coupling=coupling), last])


DRIVES: dict[str, Callable[[Any], bd.Params]] = {
    "links": two,
    "string": lambda one: on_mesh(two(one), "string"),
    "paper": lambda one: two(one, belt_changes={"mesh": "paper"}),
    "drag, on an arm": lambda one: on_arm(one),
}


def shaken(params: bd.Params, seed: int, engaged: bool) -> dict[str, Any]:
    """The drive running under load, its coupling wound up and with a relative speed, or free."""
    rng = np.random.default_rng(seed)
    start, load = bd.settle(params).at_speed(params, {0: -20.0}), np.zeros((1, len(params.pulleys)))
    load[0, :2] = -3.0, 2.0
    run = bd.simulate(params, bd.PiecewiseLinear([0.0], load), 2e-3, initial=start, outputs=())
    state = fields(run.final_state)  # with friction that has begun to act
    one = params.pulleys[1].coupling
    sense = -1.0 if getattr(one, "clockwise", False) else 1.0
    state["windup"] = np.array([rng.uniform(0.002, 0.01)])
    state["rim_angle"] = rng.uniform(-1, 1, 1)
    state["theta"] = rng.uniform(-1, 1, len(params.pulleys))
    decay = coupled_oracle(params).couplings[1]
    ahead = rng.uniform(0.1, 0.5) if engaged else -2.0 * decay.k * state["windup"][0] / decay.d
    state["rim_speed"] = np.array(state["omega"][1:2] + sense * ahead)
    if params.mounted:
        state["travel_speed"] = np.array([0.3])
    return state


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
@pytest.mark.one_in(3)
@pytest.mark.parametrize("engaged", [True, False], ids=["engaged", "free"])
@pytest.mark.parametrize("name", COUPLINGS)
@pytest.mark.parametrize("kind", DRIVES)
def test_rates_and_energies_are_the_oracles(kind: str, name: str, engaged: bool) -> None:
    """Every rate to rounding of the largest of its field."""
    params = DRIVES[kind](COUPLINGS[name])
    oracle, state = coupled_oracle(params), shaken(params, 3, engaged)
    y, torque = oracle.pack(state), np.array([-1.5, 0.7, 0.2])[: len(params.pulleys)]
    dy = oracle.rhs(0.0, y, lambda *_: torque)
    ours = params._model.rate(state, torque)
    on_shaft, winds = oracle.transmitted(y)
    shafts, rims = oracle.shafts(dy)[1], oracle.rims(dy)[1]
    scale = max(np.abs(shafts).max(), np.abs(rims).max())
    assert np.allclose(ours["omega"], shafts, rtol=0.0, atol=1e-9 * scale)
    assert np.allclose(ours["rim_speed"], rims, rtol=0.0, atol=1e-9 * scale)
    assert np.allclose(ours["windup"], winds, rtol=1e-12)
    assert np.array_equal(ours["rim_angle"], state["rim_speed"])
    if params.mounted:
        moved = oracle.drive.mount_states(oracle.parts(dy)[0])[1]
        assert np.allclose(ours["travel_speed"], moved, rtol=1e-8)
    links = oracle.drive.links(oracle.parts(dy)[0])
    for row, field in enumerate(("vx", "vy")):
        assert np.allclose(ours[field], links[1, row], rtol=0.0, atol=1e-8 * abs(links[1]).max())
    seen = params._model.observe(state)
    assert np.allclose(seen["transmitted"][0], on_shaft, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
@pytest.mark.parametrize(
    ("name", "mesh"),
    ci_if(
        lambda case: case[1] == "paper",
        [("clockwise", "joint"), ("isolator", "paper"), ("damper", "paper")],
    ),
)
def test_a_run_is_the_oracles(name: str, mesh: str) -> None:
    """Histories of a loaded drive whose hub is braked and let go, which makes the clutch overrun:
    speeds to 1e-6, the works to 1e-6 of the energy that has passed.
    """
    friction = bd.Coulomb(mu=0.8, v_reg=0.05)  # without a memory: nothing resets
    soft = {"axial_stiffness": 7e3, "mesh": mesh}
    contact = bd.Contact(linear=5e6, damping=500.0)
    params = two(COUPLINGS[name], 20, friction=friction, belt_changes=soft, contact=contact)
    load = bd.PiecewiseLinear(
        [0.0, 0.001, 0.002, 0.005, 0.0055], [[-2, 2], [-2, 2], [2, -8], [2, -8], [-2, 3]]
    )
    start = bd.settle(params).at_speed(params, {0: -20.0})
    times = np.linspace(0.0, 0.008, 31)
    result = bd.simulate(
        params, load, 0.008, initial=start, method="tsit5", rtol=1e-9, t_eval=times
    )
    oracle = coupled_oracle(params)
    terms = load.terms(params.pulley_names)
    torque = lambda t, *_: np.array(  # noqa: E731
        [np.interp(t, terms[0][1], np.asarray(terms[0][2])[:, j]) for j in range(2)]
    )
    ys = oracle.integrate(oracle.pack(fields(start)), torque, times[1:], 0.0)
    speeds = np.array([[*oracle.shafts(y)[1], *oracle.rims(y)[1]] for y in ys])
    ours = np.column_stack([result.pulleys.omega, result.couplings.rim_speed])[1:]
    assert np.max(np.abs(ours - speeds)) <= 1e-6 * np.abs(speeds).max()
    windup = np.array([oracle.parts(y)[1][2, 0] for y in ys])
    assert np.max(np.abs(result.couplings.windup[1:, 0] - windup)) <= 1e-6
    works = np.array([oracle.parts(y)[2] for y in ys])
    energy = result.energy
    assert np.allclose(energy.drive[1:], works[:, 0], atol=1e-6 * energy.passed[-1])
    assert np.allclose(energy.coupling_loss[1:], works[:, 1], atol=1e-6 * energy.passed[-1])
    springs = [oracle.energy_terms(y)["coupling"] for y in ys]
    assert np.allclose(energy.coupling[1:], springs, atol=1e-6 * energy.passed[-1])
    first = oracle.energy(oracle.pack(fields(start)))
    gained = [oracle.energy(y) - first for y in ys]
    assert np.allclose(energy.total[1:] - energy.total[0], gained, atol=1e-6 * energy.passed[-1])
    assert np.max(np.abs(energy.residual)) <= 1e-6 * energy.passed[-1]
    if name == "clockwise":
        free = result.couplings.transmitted[:, 0] == 0.0
        assert 0.1 < free.mean() < 0.9  # it does both


def test_a_prescribed_hub_gives_the_torque_that_it_needs() -> None:
    """Motion acts on the hub, the torque reported is what its inertia, the coupling and drag ask
    for, and the ledger closes with it.
    """
    params = two(ISOLATOR, drag=DRAG)
    start = bd.settle(params).at_speed(params, {1: 10.0})
    begin = float(start.omega[1])
    rate = 400.0
    speed = bd.PiecewiseLinear([0.0, 0.05], [begin, begin + 0.05 * rate])
    result = bd.simulate(params, NO_TORQUE, 0.05, motion={1: speed}, initial=start, rtol=1e-6)
    assert np.allclose(result.pulleys.omega[:, 1], begin + rate * result.t, rtol=1e-9)
    omega = result.pulleys.omega[:, 1]
    drag = 0.05 * omega / np.hypot(omega, params.info["drag_speed"] / 0.06)
    drag += 1e-3 * omega + 1e-5 * omega * np.abs(omega)
    need = HUB * rate - result.couplings.transmitted[:, 0] + drag
    assert np.allclose(result.pulleys.torque[:-1, 1], need[:-1], atol=1e-6 * np.abs(need).max())
    assert abs(result.energy.residual[-1]) <= 1e-5 * result.energy.passed[-1]


# --- linear systems -------------------------------------------------------------------------------

#: Of differences [m, rad, m/s, rad/s]; 1e-6 of what is not named.
STEPS = {"x": 1e-9, "y": 1e-9, "phi": 1e-8, "vphi": 1e-5, "travel": 1e-8}


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
@pytest.mark.one_in(3)
@pytest.mark.parametrize("engaged", [True, False], ids=["engaged", "free"])
@pytest.mark.parametrize("name", COUPLINGS)
@pytest.mark.parametrize("kind", DRIVES)
def test_the_jacobian_is_that_of_the_rates(kind: str, name: str, engaged: bool) -> None:
    """By central differences: every column of shafts, rims, windups and travels, and what motions
    of the nodes do to their rows. Solves of (1 - g J) k = g c leave rounding.
    """
    params = DRIVES[kind](COUPLINGS[name])
    state, model = shaken(params, 5, engaged), params._model
    j, names = dense.whole(model, state)
    still, rng = np.zeros(len(params.pulleys)), np.random.default_rng(1)
    small = ["theta", "omega", "rim_angle", "rim_speed", "windup", "travel", "travel_speed"]

    def joined(at: Any) -> Array:
        return np.concatenate([at[field] for field, *_ in _core.STATE_FIELDS])

    def moved(start: Any, way: Array) -> dict[str, Any]:
        return {field: start[field] + way[names == field] for field, *_ in _core.STATE_FIELDS} | {
            "t": 0.0
        }

    def assert_left(off: Array, terms: Array, share: float) -> None:
        for rows in (names == field for field in set(names) & set(small)):
            assert np.abs(off[rows]).max() <= share * terms[rows].max()

    steps = np.array([STEPS.get(field, 1e-6) for field in names])
    signed = steps * rng.choice([-1.0, 1.0], len(names))
    ways = [signed * np.isin(names, nodes) for nodes in (("x", "y", "phi"), ("vx", "vy", "vphi"))]
    ways += [steps * (np.arange(len(names)) == k) for k in np.flatnonzero(np.isin(names, small))]
    for way in ways:
        there, back = (joined(model.rate(moved(state, s * way), still)) for s in (0.5, -0.5))
        assert_left(there - back - j @ way, np.abs(j) @ np.abs(way), 1e-5)
    none = {field: np.zeros(np.size(value)) for field, value in state.items()}
    for g in (1e-6, 1e-4, 1e-2):
        c = steps * rng.uniform(-1.0, 1.0, len(names))
        k = joined(model.solve(state, g, moved(none, c)))
        terms = np.abs(k) + g * (np.abs(j) @ np.abs(k) + np.abs(c))
        assert_left(k - g * (j @ k) - g * c, terms, 1e-12)


# --- the rest of the program ----------------------------------------------------------------------


def decoupled(**changes: Any) -> tuple[bd.Params, bd.TorqueLike]:
    return two(BACKWARDS, **changes), bd.PiecewiseLinear(
        [0.0, 0.01, 0.03, 0.05], [[-4.0, 2.0], [-4.0, 2.0], [4.0, -2.0], [-4.0, 2.0]]
    )


def test_what_is_not_there_costs_nothing() -> None:
    """A drive without couplings has none of their fields, works and passes."""
    params = two(None)
    with_one = two(ISOLATOR)
    assert params._model.info["n_couplings"] == 0 and params.coupled == ()
    assert params.shaft_inertias.tolist() == [0.01, RIM]
    result = bd.simulate(params, NO_TORQUE, 1e-3)
    assert result.couplings is None and result.energy.coupling_loss is None
    assert result.final_state.windup.size == 0
    assert not any("coupling" in name for name in result.effects)
    there = bd.simulate(with_one, NO_TORQUE, 1e-3)
    assert any("isolators" in name for name in there.effects)


def test_a_belt_settles_with_pulleys_free_to_turn_as_without_a_coupling() -> None:
    """Rims come to rest where whole pulleys do, to what friction leaves; hubs stand."""
    free = bd.Tensioning(friction=True, pulleys="free")
    whole, coupled = (
        bd.settle(two(one, tensioning=free)) for one in (None, attrs.evolve(ISOLATOR, inertia=0.01))
    )
    assert coupled.rim_angle == pytest.approx(whole.theta[1:], abs=1e-6)
    assert not coupled.windup.any() and coupled.theta[1] == 0.0


def test_a_belt_settles_from_a_state_without_its_windup() -> None:
    """At rest no torque goes through a coupling, whatever the state that settling begins with."""
    params = two(ISOLATOR)
    start = turning(params, 3.0, 5.0, 0.1)
    settling = _core.Simulation.settle(params._model, start._to_core(params))
    assert settling.advance(np.inf)
    state = settling.state()
    assert not any(state[name].any() for name in ("windup", "rim_speed", "omega"))


@pytest.mark.filterwarnings("ignore:no_friction")
def test_fixed_steps_follow_the_stiffest_coupling() -> None:
    """The step that rk4 chooses is within its limit, 2.785, of hub and rim on their spring, here
    stiffer than the belt's joints; they swing by no more than they began with.
    """
    stiff = 1e7
    params = two(attrs.evolve(ISOLATOR, stiffness=stiff, damping=0.0), friction=None)
    rate = math.sqrt(stiff * (1.0 / RIM + 1.0 / HUB))
    assert rate > params.info["spectral_bound"]
    start = turning(params, 0.0, 1e-3)
    result = bd.simulate(params, NO_TORQUE, 20.0 / rate, initial=start, method="rk4")
    assert 0.5 < result.stats.largest_step * rate < 2.785
    assert np.abs(result.couplings.windup).max() < 1.1e-3 / rate


def test_sweeps_and_explanations_know_couplings() -> None:
    """Their numbers have names; left out, hub and rim are one body of both inertias."""
    params, torque = decoupled()
    scene = bd.Scene(params, torque, 0.01)
    assert parameters.read(params, "pulleys[1].coupling.stiffness") == [STIFFNESS]
    softer, _ = names.changed(scene, {}, {"pulleys[1].coupling.stiffness": 7.0})
    assert softer.params.pulleys[1].coupling.stiffness == 7.0
    rigid = [one for one in removals_of(scene) if one.name == "couplings of shafts"]
    pulley = leave_out(scene, rigid).params.pulleys[1]
    assert pulley.coupling is None and pulley.inertia == RIM + HUB


def test_histories_of_couplings_are_told_apart_by_their_pulley() -> None:
    """In sweeps, spectra and labelled arrays; the second coupling is not on the second pulley."""
    params = two(None)
    first, last = (attrs.evolve(one, coupling=ISOLATOR) for one in params.pulleys)
    plain = bd.Pulley(center=(0.15, -0.13), radius=0.06, inertia=1e-4)
    params = drive([first, plain, attrs.evolve(last, name="fan")], 60)
    torque = bd.Harmonics(0, [2.0], [1.0]) + bd.Step(2, 0.0, 0.3)
    times = np.linspace(0.0, 4e-3, 33)
    swept = bd.sweep(
        bd.Scene(params, torque, times[-1]), {"t_end": [4e-3]}, "couplings.windup.final",
        progress=False,
    )["couplings.windup.final"]  # fmt: skip
    result = bd.simulate(params, torque, times[-1], t_eval=times)
    assert swept.dims == ("t_end", "coupling") and list(swept["coupling"]) == ["pulley 0", "fan"]
    assert np.allclose(swept[0], result.couplings.windup[-1], rtol=1e-9)
    labelled = result.to_xarray()["couplings.windup"]
    assert labelled.dims == ("time", "coupling") and np.ptp(labelled.values, axis=0).all()
    found = bd.spectra.spectrum(result, "couplings.windup", pulley="fan")
    assert found.label == "couplings.windup of fan" and found.unit == "rad"
    with pytest.raises(ValueError, match=r"^pulley: pulley 1 has none$"):
        bd.spectra.spectrum(result, "couplings.windup", pulley=1)


def test_speeds_are_drawn_of_shafts_and_rims() -> None:
    pytest.importorskip("matplotlib")
    params = two(ISOLATOR)
    result = bd.simulate(params, NO_TORQUE, 1e-3, initial=turning(params, 1.0, 2.0))
    lines = {line.get_label(): line for line in bd.plot.speeds(result).get_lines()}
    rim = lines["rim of pulley 1"]
    assert np.array_equal(rim.get_ydata(), result.couplings.rim_speed[:, 0])
    assert np.array_equal(lines["pulley 1"].get_ydata(), result.pulleys.omega[:, 1])


@pytest.mark.parametrize("name", COUPLINGS)
def test_files_have_the_coupling(name: str, tmp_path: Any) -> None:
    """TOML of the drive is exact both ways, and so are results and states with couplings."""
    params = two(COUPLINGS[name])
    again = bd.Params.from_toml(params.to_toml() + "\n")
    assert again == params
    kind = {"decoupler": "clutch", "clockwise": "clutch", "rollers": "clutch"}.get(name, name)
    assert f'kind = "{kind}"' in params.to_toml()
    assert bd.settle(again) == bd.settle(params)
    assert "coupling" in str(params)
    with pytest.raises(ValueError, match=r"pulleys\[1\].coupling.kind must be one of"):
        bd.Params.from_toml(params.to_toml().replace('kind = "', 'kind = "x') + "\n")
    result = bd.simulate(params, NO_TORQUE, 1e-3)
    result.save(tmp_path / "run.npz")
    read = bd.Result.load(tmp_path / "run.npz")
    assert np.array_equal(read.couplings.windup, result.couplings.windup)
    assert read.final_state == result.final_state
    result.final_state.save(tmp_path / "state.npz")
    assert bd.State.load(tmp_path / "state.npz") == result.final_state


def test_a_run_goes_on_from_its_checkpoint_with_the_same_bits(tmp_path: Any) -> None:
    """Windup and rims are part of what a restart record holds."""
    params, torque = decoupled()
    whole = bd.simulate(params, torque, 0.05)
    file = tmp_path / "run.bd"
    with pytest.raises(bd.SimulationError):
        bd.simulate(params, torque, 0.05, max_steps=whole.stats.steps // 2, checkpoint=file)
    again = bd.resume(file, max_steps=10 * whole.stats.steps)
    assert np.array_equal(again.couplings.windup, whole.couplings.windup)
    assert np.array_equal(again.pulleys.omega, whole.pulleys.omega)


@pytest.mark.filterwarnings("ignore:fixed_step")  # the start is rough
@pytest.mark.parametrize("method", METHODS)
def test_energy_of_an_overrunning_clutch_is_accounted_for(method: str) -> None:
    """The ledger closes through engaging and overrunning, to what the method is asked for."""
    params, torque = decoupled()
    start = bd.settle(params).at_speed(params, {0: -20.0})
    result = bd.simulate(params, torque, 0.06, initial=start, method=method, **METHODS[method])
    transmitted = result.couplings.transmitted[:, 0]
    assert (transmitted == 0.0).any() and (transmitted < 0.0).any()
    bound = {"lie": 0.05, "lbdf2": 5e-3}.get(method, 1e-3)
    assert np.max(np.abs(result.energy.residual)) <= bound * result.energy.passed[-1]
    assert (np.diff(result.energy.coupling_loss) >= 0.0).all()


def test_reports_tell_shafts_from_rims() -> None:
    """Powers are those of shafts, with the coupling's loss among them; creep is of rims."""
    params, _ = decoupled()
    torque = bd.PiecewiseLinear([0.0], [[-2.0, 1.0]])
    start = bd.settle(params).at_speed(params, {0: -40.0})
    result = bd.simulate(params, torque, 0.2, initial=start)
    report = result.report()
    lost = {row.name: row.power for row in report.powers}
    assert "dampers of couplings" in lost
    put_in = sum(row.power for row in report.powers if row.kind == "in")
    assert sum(row.power for row in report.powers if row.kind != "in") == pytest.approx(put_in)
    row = report.pulleys[1]
    assert row.overruns is not None and row.windup is not None
    assert row.windup.mean == pytest.approx(1.0 / STIFFNESS, rel=0.3)  # of the load's torque
    assert "Coupling of pulley 1: windup" in report.text() + report.text(full=True)
    rims = result._rims()
    assert rims is not None
    assert np.array_equal(rims[:, 1], result.couplings.rim_speed[:, 0])
    assert np.array_equal(rims[:, 0], result.pulleys.omega[:, 0])
    assert np.allclose(result.slip[1:, 1], 1.0 - rims[1:, 1] * 0.06 / (rims[1:, 0] * 0.08))


@pytest.mark.parametrize(
    ("fields_of", "said"),
    [
        ({"inertia": 0.0}, "isolator.inertia must be > 0"),
        ({"stiffness": 0.0}, "isolator.stiffness must be > 0"),
        ({"damping": -1.0}, "isolator.damping must be >= 0"),
    ],
)
def test_a_broken_rule_is_named(fields_of: dict[str, float], said: str) -> None:
    data = {"inertia": HUB, "stiffness": STIFFNESS, "damping": DAMPING} | fields_of
    with pytest.raises(ValueError, match=said):
        bd.Isolator(**data)
    with pytest.raises(TypeError, match=r"pulley\.coupling must be an Isolator"):
        two(3.0)


def test_what_stands_is_not_wound_up_and_clutches_never_are_backwards() -> None:
    """Settled from a run that wound a spring up, hub and rim do not push against each other."""
    params = two(ISOLATOR)
    push = bd.PiecewiseLinear([0.0], [[-2.0, 2.0]])
    run = bd.simulate(params, push, 0.02)
    assert abs(run.final_state.windup[0]) > 0.05
    rest = bd.settle(params, initial=run.final_state)
    assert rest.windup[0] == 0.0
    params = two(DECOUPLER)
    backwards = attrs.evolve(bd.settle(params), windup=[-0.1])
    with pytest.raises(ValueError, match=r"^initial\.windup of a clutch must be >= 0 \(rad\)"):
        bd.simulate(params, NO_TORQUE, 1e-3, initial=backwards)


def test_a_clutch_that_never_drives_is_asked_about() -> None:
    params = two(BACKWARDS)
    load = bd.PiecewiseLinear([0.0], [-1.0], pulley=1)
    times = np.linspace(0.01, 0.02, 21)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bd.BeltdynWarning)
        run = bd.simulate(
            params, load, 0.02, {0: bd.PiecewiseLinear([0.0], [20.0])}, t_eval=times,
            initial=bd.settle(params, speed={0: 20.0}),
        )  # fmt: skip
    # from the start on, where the crank's harmonics let the clutch catch and brake the hub
    crank = bd.CrankMotion(20.0, orders=[8.0], amplitudes=[0.02])
    with pytest.warns(bd.BeltdynWarning, match=r"^never_drives: .* pulley 1 drives nothing"):
        uneven = bd.simulate(params, load, 0.05, {0: crank})
    assert uneven.couplings.transmitted.any()
    text = run.report(0.999).text()
    assert "drives nothing: is it to drive the other way round" in " ".join(text.split())
    (warned,) = (one for one in run.warnings if one.code == "never_drives")
    assert warned.where == "pulley 1" and warned.text.endswith("is clockwise=False meant?")
