"""Runs with every friction law of the table, and with laws mixed on the pulleys: the bounds, the
memory, states that are refused, settling, warnings. The ledger, methods, kernels, records and files
of every law: test_drive_table.py.
"""

from __future__ import annotations

import functools
from itertools import cycle, product
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from bridge import fields, oracle_of
from laws import EXAMPLES, STRIBECK, UNDAMPED_LUGRE, scaled, with_laws
from module_common import INF, make_model
from tiers import extended_if

import beltdyn as bd
from beltdyn import _core
from beltdyn.base import run_warnings
from beltdyn.drive import sanity

Laws = tuple[bd.Friction | None, ...]

ELASTIC, COULOMB, MAXWELL = (
    EXAMPLES[name] for name in ("elastic_plastic", "coulomb", "maxwell_slip")
)
#: On the two pulleys of the plain drive, with the paper's mesh or with contact of the joints.
PAIRS: dict[str, Laws] = {
    "dahl": (EXAMPLES["dahl"],) * 2,
    "lugre, undamped": (UNDAMPED_LUGRE, UNDAMPED_LUGRE),
    "joints, mixed": (scaled(EXAMPLES["lugre"], 1.2), ELASTIC),
    "one without": (ELASTIC, None),
    "no state and one": (COULOMB, EXAMPLES["lugre"]),
    "joints, no state and one": (ELASTIC, scaled(COULOMB, 0.7)),
    "joints, no states": (EXAMPLES["creep_rate"], EXAMPLES["threlfall"]),
    "several states and one": (MAXWELL, STRIBECK["dahl"]),
    "joints, several states and none": (STRIBECK["maxwell_slip"], STRIBECK["coulomb"]),
}
_USED = {law.law for pair in PAIRS.values() for law in pair if law is not None}
PAIRS |= {name: (law, law) for name, law in EXAMPLES.items() if name not in _USED}

pytestmark = pytest.mark.filterwarnings("ignore:(mesh|full_slip):UserWarning")


def dealt(methods: Any) -> Any:
    """Cases of pair and method: by default one method for each pair, by turns."""
    default = set(zip(PAIRS, cycle(methods), strict=False))
    cases = extended_if(lambda case: case not in default, product(PAIRS, methods))
    return pytest.mark.parametrize(("pair", "method"), cases)


def coarse(mesh: str = "paper") -> bd.Params:
    """The plain drive with 41 links, so that the last vector is not full."""
    base = drives.on_mesh(drives.plain(), mesh)
    return attrs.evolve(base, belt=attrs.evolve(base.belt, n_bodies=41))


def mesh_of(pair: str) -> str:
    return "joint" if pair.startswith("joints") else "paper"


def drive(pair: str) -> bd.Params:
    return with_laws(coarse(mesh_of(pair)), *PAIRS[pair])


@functools.cache
def settled(mesh: str = "paper") -> bd.State:
    """Without friction in it, a state is one of any law."""
    return bd.settle(with_laws(coarse(mesh), None, None))


HARD = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-150.0, 0.0]])
STILL = bd.Viscous([0.0, 0.0])


def test_a_run_says_which_laws_it_has() -> None:
    """Each once, in the order of the table."""
    for pair, laws in PAIRS.items():
        result = bd.simulate(drive(pair), STILL, 1e-6, initial=settled(mesh_of(pair)))
        used = {law.law for law in laws if law is not None}
        words = " and ".join(text for name, _, text in _core.LAWS if name in used)
        assert f"contact with {words} friction" in result.effects


def _bounds(pair: str, state: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Of |z| (n_states, n_b), link by link; infinite where a law has none, 0 where nothing is
    touched and of states that its law has not. And which links touch a pulley with friction.
    """
    oracle = oracle_of(drive(pair))
    place = {name: value for name, value in state.items() if name not in ("mu", "slip")}
    touch = oracle.penetration(oracle.pack(place)) > 0
    laws = [(0.0, 0) if law is None else (law.bound, law.n_states) for law in oracle.laws]
    bounds = np.array([[bound if e < n else 0.0 for bound, n in laws]
                       for e in range(oracle.n_states)])  # fmt: skip
    rubs = touch & np.array([law is not None for law in oracle.laws])[:, None]
    return np.max(np.where(touch, bounds[:, :, None], 0.0), axis=1), rubs.any(axis=0)


@pytest.mark.one_in(3)
@dealt(["tsit5", "lbdf2", "rodas4"])
def test_states_keep_their_bounds(pair: str, method: str) -> None:
    """At a tolerance that would let them out, at every eighth accepted step; and that of links that
    touch nothing, or a pulley without friction, is 0. A law without a state has none in the run.
    """
    params = drive(pair)
    start = settled(mesh_of(pair))._to_core(params)
    sim = _core.Simulation(params._model, start, HARD.terms(), 0.03, method=method, rtol=1e-2)
    looked, finished, reached = 0, False, 0.0
    while not finished:
        finished = sim.advance(0.0)
        state = sim.state()
        bounds, rubs = _bounds(pair, state)
        states, n = params.info["n_states"], rubs.size
        assert not state["slip"][~rubs].any() and state["mu"].size == states * n
        if states:
            mu = np.abs(state["mu"].reshape(states, n))
            assert np.all(mu <= bounds)
            limited = np.isfinite(bounds) & (bounds > 0)
            reached = max(reached, np.max(mu[limited] / bounds[limited], initial=0.0))
        looked += 1
    assert looked > 5
    finite = [law for law in oracle_of(params).laws if law is not None and 0.0 < law.bound < np.inf]
    assert reached > 0.7 or not finite


@pytest.mark.parametrize(("method", "mu"), [("tsit5", 0.4), ("lbdf2", 0.6), ("rodas4", 0.4)])
def test_elastic_plastic_friction_keeps_its_limit(method: str, mu: float) -> None:
    """|F| <= mu N to rounding in every sample, and it gets there."""
    law = attrs.evolve(ELASTIC, mu=mu)
    params = with_laws(coarse(), law, law)
    result = bd.simulate(params, HARD, 0.03, initial=settled(), method=method, rtol=1e-2)
    limit, size = mu * result.contact.normal, np.abs(result.contact.friction)
    assert np.all(size <= limit * (1 + 4 * np.finfo(float).eps))
    assert np.all(np.abs(result.contact.mu) <= mu * (1 + 4 * np.finfo(float).eps))
    assert np.mean(size[limit > 0] > 0.999 * limit[limit > 0]) > 0.1


def test_nothing_is_reported_where_nothing_presses() -> None:
    """MODEL section 4, where N = 0, as where a damper lets go: no friction, and no coefficient but
    that of Dahl's law, which is its state.
    """
    for law in EXAMPLES.values():
        model = make_model(friction=law._to_core(), contact=(0.0, 2.5e5, 1e3, 0, 0.0))
        settling = _core.Simulation.settle(model, tolerance=1e-5, friction=True)
        assert settling.advance(INF) is True
        state = settling.state()
        state["vx"], state["vy"] = 10.0 * state["x"], 10.0 * state["y"]  # away from pulley 0
        sim = _core.Simulation(model, state, [], 1e-9)
        sample = sim.sample([0.0])
        assert sim.advance(INF) is True
        lifted = (sample["pulley"][0] >= 0) & (sample["normal"][0] == 0.0)
        mu = state["mu"].reshape(law.n_states, lifted.size)
        assert lifted.sum() > 3 and all(row[lifted].any() for row in mu)
        assert not sample["friction"][0][lifted].any()
        given = mu[0, lifted] if isinstance(law, bd.Dahl) else 0.0
        assert np.all(sample["mu"][0][lifted] == given)


def test_memory_is_lost_with_the_contact() -> None:
    """MODEL section 4: where no pulley is touched, mu and slip are 0; gained anew from 0."""
    scene = bd.scenes.three_pulleys()
    result = bd.simulate(*scene[:2], 0.3, t_eval=np.linspace(0, 0.3, 1201))
    contact, off = result.contact, result.contact.pulley < 0
    assert off.any()
    assert not contact.mu[off].any() and not contact.slip[off].any()
    arrived = (~off[1:]) & off[:-1]
    assert arrived.sum() > 20
    # right after arrival the slip is what slid within one sample at most
    slid = np.abs(contact.velocity).max() * np.diff(result.t).max()
    assert np.max(np.abs(contact.slip[1:][arrived])) <= slid


def test_memory_given_off_the_pulleys_is_forgotten() -> None:
    """An initial state with mu on links that touch nothing runs like the one without."""
    scene = bd.scenes.kubas_case_1()
    state = bd.simulate(*scene[:2], 0.1, t_eval=[0.1])
    off, clean = state.contact.pulley[-1] < 0, state.final_state
    tainted = attrs.evolve(
        clean, mu=np.where(off, -0.9, clean.mu), slip=np.where(off, 1e-3, clean.slip)
    )
    one, other = (bd.simulate(*scene[:2], 0.16, initial=s) for s in (clean, tainted))
    assert np.array_equal(one.contact.mu, other.contact.mu)
    assert np.array_equal(one.final_state.mu, other.final_state.mu)
    assert np.any((one.contact.pulley[-1] >= 0) & off)  # some have arrived


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_memory_does_not_pass_from_pulley_to_pulley(way: float) -> None:
    """Two pulleys that touch: a link crosses from one to the other within a step, either way."""
    n, radius, ring = 5, 0.1, 0.25  # five links on a circle round both, one of them moved inside
    model = _core.Model(
        (2 * np.pi * ring, n, 0.1, 1e-3, 0.0, 0.0, 0.0),
        np.array([[0.0, 0.0], [0.2, 0.0]]), [radius] * 2, [1.0] * 2,
        (0.0, 1e-6, 0.0, 0, 0.0), ("dahl", (1.0, 1e-3, 0.0, 0.0)), (0.0, 0.0),
    )  # fmt: skip
    zero = np.zeros(n)
    state = {name: zero.copy() for name in ("x", "y", "vx", "vy", "vphi", "mu", "slip")}
    place = -np.pi / 2 - 2 * np.pi / n * (np.arange(n) - 3)
    state |= {"phi": place - np.pi / 2, "t": 0.0}
    state |= {"theta": np.zeros(2), "omega": np.zeros(2)}
    state["x"], state["y"] = 0.1 + ring * np.cos(place), ring * np.sin(place)
    state["x"][3], state["vx"][3], state["mu"][3] = 0.1 - way * 1e-6, way, 0.5
    state["y"][3] = 0.0
    sim = _core.Simulation(model, state, [], 2e-5, method="rk4", step=1e-5)
    while not sim.advance(1.0):
        pass
    end = sim.state()
    assert (end["x"][3] - 0.1) * way > 0.0
    assert abs(end["mu"][3]) <= 1e-6


def test_a_record_of_another_law_is_refused() -> None:
    """Of another law, of other numbers, of another pulley's."""
    laws = list(EXAMPLES.values())
    variants = [(law, law) for law in laws] + [(laws[0], law) for law in laws[1:]]
    variants += [(scaled(law, 1.01), law) for law in laws] + [(laws[0], None), (None, laws[0])]
    runs = []
    for pair in variants:
        params = with_laws(coarse(), *pair)
        runs.append(_core.Simulation(params._model, settled()._to_core(params), HARD.terms(), 0.02))
    records = [run.export_record() for run in runs]
    for k, simulation in enumerate(runs):
        for other in records[:k] + records[k + 1 :]:
            with pytest.raises(ValueError, match="the record is of another run"):
                simulation.import_record(other)
        simulation.import_record(records[k])


def touching(params: bd.Params, state: bd.State) -> np.ndarray:
    oracle = oracle_of(params)
    return oracle.penetration(oracle.pack(fields(state))) > 0


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_state_beyond_the_bound_is_refused(name: str) -> None:
    """By its name, before anything runs; within a bit of it, and where nothing is touched, not."""
    law = EXAMPLES[name]
    params = with_laws(coarse(), law, None)
    bound, state = oracle_of(params).laws[0].bound, bd.settle(params)
    touch = touching(params, state)
    link = int(np.flatnonzero(touch[0])[3])

    def started_with(value: float, at: int = link) -> bd.Result:
        mu = np.zeros_like(state.mu)
        mu[..., at] = value
        return bd.simulate(params, STILL, 1e-6, initial=attrs.evolve(state, mu=mu))

    if not np.isfinite(bound):
        started_with(1e-3)
        return
    if not law.n_states:  # as one of a law with a state, which it does not use
        assert not started_with(0.5).final_state.mu.any()
        return
    for value in (bound, -bound):
        started_with(value)
        with pytest.raises(
            ValueError, match=rf"^state mu\[{link}\] must lie within \+-{bound:g}, "
        ):
            started_with(1.001 * value)
    forgotten = started_with(0.5 * bound, int(np.flatnonzero(touch[1])[3]))
    assert not forgotten.final_state.mu[touch[1]].any()


def test_the_bound_is_that_of_the_pulley_that_a_link_touches() -> None:
    for other in (ELASTIC, bd.Dahl(mu_k=0.9, sigma=1e4), EXAMPLES["lugre"]):
        params = with_laws(coarse(), bd.Dahl(mu_k=0.3, sigma=1e4), other)
        one, another = touching(params, settled())
        with pytest.raises(ValueError, match=r"^state mu\[\d+\] must lie within \+-0\.3"):
            bd.simulate(params, STILL, 1e-6, initial=attrs.evolve(settled(), mu=0.5 * one))
        bd.simulate(params, STILL, 1e-6, initial=attrs.evolve(settled(), mu=5e-6 * another))


@pytest.mark.one_in(2)
@dealt(["free", "held"])
def test_settling_with_friction(pair: str, method: str) -> None:
    """From the belt line, pulley 1 moved to its place: still, balanced, and within the bounds."""
    params = drive(pair)
    state = bd.settle(params, friction=True, pulleys=method, offset={1: (-0.002, 0.0)})
    assert not any(getattr(state, v).any() for v in ("vx", "vy", "vphi", "omega"))
    assert state.residual is not None and state.residual <= 1e-9
    assert state.mu.any() == (params.info["n_states"] > 0)
    core = fields(state)
    assert np.all(np.abs(state.mu) <= _bounds(pair, core)[0])
    oracle = oracle_of(params)
    rate = oracle.rhs(0.0, oracle.pack(core), lambda t, theta, omega: 0 * omega)
    acceleration = oracle.links(rate)[1]
    force = oracle.mass * np.hypot(acceleration[0], acceleration[1])
    assert force.max() <= 1.1e-9 * params.info["strain_tension"]
    if method == "free":
        contacts = oracle.contacts(oracle.pack(core))
        torque = np.sum(contacts.friction * contacts.distance, axis=1)
        assert np.max(np.abs(torque)) <= 1e-8 * params.info["strain_tension"]
    # it stays at rest when it is let go
    result = bd.simulate(params, STILL, 2e-3, initial=state, rtol=1e-6)
    moved = np.max(np.abs(result.joints.force - result.joints.force[0]))
    assert moved <= 1e-6 * params.info["strain_tension"] or method == "held"


def test_links_break_loose_from_friction_that_falls_when_they_should() -> None:
    """Steps with the tangent of a steep law creep on along it, unseen: off by 8 times the claim."""
    law = bd.Coulomb(mu=0.5, v_reg=1e-3, mu_s=1.2, v_stribeck=0.01)
    params = attrs.evolve(drives.plain(), friction=law)
    torque = bd.PiecewiseLinear([0.0, 0.05], [0.0, -60.0], 0) + bd.Viscous([0.0, 0.5])
    start, times = bd.settle(params, speed={0: -50.0}), np.linspace(0.0, 0.02, 201)
    given: dict[str, Any] = {"initial": start, "t_eval": times, "method": "rodas4"}
    run = bd.simulate(params, torque, 0.02, rtol=1e-3, **given)
    exact = bd.simulate(params, torque, 0.02, rtol=1e-4, max_step=1e-5, **given)
    error = np.sqrt(np.mean((run.joints.force - exact.joints.force) ** 2))
    assert run.stats.error is not None
    assert error <= 3.0 * run.stats.error * np.mean(exact.joints.force)


def test_links_break_loose_from_a_steep_law_with_a_kink_when_they_should() -> None:
    """Where friction stops rising steps on the old line went on, unseen: off by 3.8 times rtol."""
    params = drives.with_belt(
        drives.on_mesh(drives.plain(), "joint"), n_bodies=33, axial_damping=100.0
    )
    params = attrs.evolve(params, friction=bd.CreepRate(mu=0.8, v_critical=5e-4))
    push = -1.8 * params.info["strain_tension"] * 0.1 * np.tanh(0.4 * np.pi)
    torque = bd.PiecewiseLinear([0.005, 0.005], [0.0, push], 0) + bd.Viscous([0.0, 0.5])
    given: dict[str, Any] = {"initial": bd.settle(params), "t_eval": np.linspace(0.0, 0.03, 61)}
    run = bd.simulate(params, torque, 0.03, method="rodas4", rtol=1e-3, **given)
    exact = bd.simulate(params, torque, 0.03, method="rodas4", rtol=1e-5, **given)
    error = np.sqrt(np.mean((run.joints.force - exact.joints.force) ** 2))
    assert error <= 1e-3 * np.mean(exact.joints.force)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", EXAMPLES)
def test_full_slip_is_seen_with_every_law(name: str) -> None:
    """A torque beyond what half the friction can hold; on the pulley whose friction is weak."""
    strong, weak = scaled(EXAMPLES[name], 2.0), scaled(EXAMPLES[name], 0.25)
    torque = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-60.0, 0.0]]) + bd.Viscous([0.0, 16.0])
    for laws, slipping in (((weak, strong), "pulley 0"), ((strong, strong), None)):
        with run_warnings.silenced():
            result = bd.simulate(with_laws(coarse(), *laws), torque, 0.08, initial=settled())
        seen = [one.where for one in result.warnings if one.code == "full_slip"]
        assert seen == ([] if slipping is None else [slipping])


def test_what_sticks_by_static_friction_does_not_slip() -> None:
    """A slow drive whose friction is above mu_k N on the whole wrap of pulley 1, which LuGre
    friction holds where links creep far below the Stribeck velocity: no part of the belt's speed is
    lost, and nothing is said. At twice the torque it slips, and that is.
    """
    law = bd.LuGre(mu_k=0.3, mu_s=0.9, v_stribeck=0.2, sigma=1e4, damping=0.1)
    params = with_laws(drives.plain(), law, law)

    def loaded(most: float) -> bd.Result:
        ramp = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0], [-most, 0.0]])
        with run_warnings.silenced():
            return bd.simulate(params, ramp + bd.Viscous([0.0, most / 10.0]), 0.5, rtol=1e-3)

    sticks, slips = loaded(60.0), loaded(120.0)
    contact = sticks.contact
    held = (contact.pulley == 1) & (sticks.t[:, None] > 0.3)
    carried = abs(np.sum(contact.friction, where=held)) / np.sum(contact.normal, where=held)
    assert carried > 1.3 * law.mu_k
    assert np.max(np.abs(sticks.slip[sticks.t > 0.3])) < 0.05
    assert not [one for one in sticks.warnings if one.code == "full_slip"]
    assert [one for one in slips.warnings if one.code == "full_slip"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_units_of_friction_are_doubted_with_every_law(name: str) -> None:
    """A coefficient in percent, a stiffness per mm, of the drive or of one pulley; each once."""
    law, percent = EXAMPLES[name], scaled(EXAMPLES[name], 100.0 / 2)
    base = attrs.evolve(drives.plain(), friction=law)
    assert not [one for one in sanity.check(base) if one.code == "units"]
    for params, where in (
        (attrs.evolve(base, friction=percent), "friction"),
        (with_laws(base, law, percent), "pulley 1"),
        (with_laws(base, percent, percent), "pulley 0"),
    ):
        (one,) = (one for one in sanity.check(params) if one.code == "units")
        assert one.where == where and "percent" in one.text
