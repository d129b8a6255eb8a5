"""Runs with every friction law of the table, and with laws mixed on the pulleys: the ledger, the
bounds, the memory, the methods against each other, states that are refused, settling,
warnings. Kernels, records and files of every law: test_drive_table.py.
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
from drives import METHODS
from laws import EXAMPLES, PLAIN_LUGRE, STRIBECK, UNDAMPED_LUGRE, scaled, with_laws
from module_common import INF, TORQUE, make_model
from tiers import extended_if

import beltdyn as bd
from beltdyn import _core, run_warnings, sanity

Laws = tuple[bd.Friction | None, ...]

LUGRE, ELASTIC, COULOMB = (EXAMPLES[name] for name in ("lugre", "elastic_plastic", "coulomb"))
DAHL, MAXWELL = EXAMPLES["dahl"], EXAMPLES["maxwell_slip"]
#: On the two pulleys of the plain drive, with the paper's mesh or with contact of the joints.
PAIRS: dict[str, Laws] = {
    "dahl": (DAHL, DAHL),
    "lugre, undamped": (UNDAMPED_LUGRE, UNDAMPED_LUGRE),
    "joints, mixed": (scaled(LUGRE, 1.2), ELASTIC),
    "one without": (ELASTIC, None),
    "no state and one": (COULOMB, LUGRE),
    "joints, no state and one": (ELASTIC, scaled(COULOMB, 0.7)),
    "joints, no states": (EXAMPLES["creep_rate"], EXAMPLES["threlfall"]),
    "several states and one": (MAXWELL, STRIBECK["dahl"]),
    "joints, several states and none": (STRIBECK["maxwell_slip"], STRIBECK["coulomb"]),
}
_USED = {law.law for pair in PAIRS.values() for law in pair if law is not None}
PAIRS |= {name: (law, law) for name, law in EXAMPLES.items() if name not in _USED}
T_END = 0.05
TIMES = np.linspace(0.0, T_END, 101)

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


def core_rest(pair: str) -> dict[str, Any]:
    return settled(mesh_of(pair))._to_core(drive(pair))


def pull() -> bd.Torque:
    return bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-50.0, 0.0]]) + bd.Viscous([0.0, 16.0])


HARD = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-150.0, 0.0]])
STILL = bd.Viscous([0.0, 0.0])


def run(pair: str, method: str, **options: Any) -> bd.Result:
    given = {**METHODS[method], "t_eval": TIMES, "initial": settled(mesh_of(pair)), **options}
    return bd.simulate(drive(pair), pull(), T_END, method=method, **given)


@functools.cache
def tight(pair: str) -> bd.Result:
    return run(pair, "tsit5", rtol=1e-8)


@pytest.mark.parametrize("pair", PAIRS)
def test_the_ledger_closes(pair: str) -> None:
    """Explicit, at a tight tolerance: a millionth of what passes through, as with Dahl's law; every
    kink of sticking and slipping is found by the error control. Friction has lost some, at the rate
    of the oracle, but for rounding; and the run says which laws it has, each once, in the order of
    the table.
    """
    result = tight(pair)
    assert np.max(np.abs(result.energy.residual)) <= 1e-6 * result.energy.passed[-1]
    assert result.energy.friction_loss[-1] > 1e-5 * result.energy.passed[-1]
    oracle, state = oracle_of(result.params), fields(result.final_state)
    y = oracle.pack(state)
    powers = oracle.rhs(state["t"], y, pull())[-5:]
    friction, sample = oracle.contacts(y), result.contact
    assert float(powers[3]) == pytest.approx(
        float(np.sum(sample.friction[-1] * sample.velocity[-1])),
        abs=1e-12 * float(np.sum(np.abs(friction.friction * friction.velocity))),
    )
    used = {law.law for law in PAIRS[pair] if law is not None}
    words = " and ".join(text for name, _, text in _core.LAWS if name in used)
    assert f"contact with {words} friction" in result.effects


@dealt(METHODS)
def test_methods_agree(pair: str, method: str) -> None:
    """Errors are what runs claim, by five at most (README); fixed steps claim nothing, and that of
    rk4 is a thousandth. The ledger errs by a small part of what passes through, and by far less
    than friction takes.
    """
    exact, result = tight(pair), run(pair, method)
    rest_tension = exact.params.info["strain_tension"]
    error = np.sqrt(np.mean((result.joints.force - exact.joints.force) ** 2)) / rest_tension
    claim, energy = result.stats.error, result.energy
    assert method == "rk4" or claim is not None
    assert error <= 5 * (1e-3 / 5 if claim is None else claim)
    assert error <= 5 * METHODS[method].get("rtol", 1e-3)
    most = 10 * METHODS[method].get("rtol", 1e-4) * energy.passed[-1]
    assert np.max(np.abs(energy.residual)) <= most


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
    sim = _core.Simulation(
        params._model, core_rest(pair), HARD.terms(), 0.03, method=method, rtol=1e-2
    )
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
            share = mu[limited] / bounds[limited]
            reached = max(reached, np.max(share, initial=0.0))
        looked += 1
    assert looked > 5
    laws = [law for law in oracle_of(params).laws if law is not None]
    finite = [law for law in laws if 0.0 < law.bound < np.inf]
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


# at this tolerance spans may shake, by rounding, on some processors: not what is asked here
@pytest.mark.filterwarnings("ignore:growth:UserWarning")
@pytest.mark.parametrize("sigma", [1e4, 1e5, 1e6])
def test_coefficient_never_leaves_its_bounds(sigma: float) -> None:
    """|mu| <= mu_k to the last bit, in and between steps, at a tolerance that would let it out."""
    scene = bd.scenes.kubas_case_2(sigma=sigma)
    result = bd.simulate(*scene[:2], 0.25, rtol=1e-2)
    mu_k = scene.params.friction.mu_k
    assert np.max(np.abs(result.contact.mu)) <= mu_k
    assert np.max(np.abs(result.final_state.mu)) <= mu_k
    assert np.max(np.abs(result.contact.mu)) >= 0.9 * mu_k  # and it gets there


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


def test_integrated_state_form_follows_the_closed_form() -> None:
    """Case 2, links that stay on a pulley: (2.9) evaluated along the slip they report.

    Between samples the slip may turn unseen; what that can hide is 2 sigma times the distance slid
    between two samples, which is added up from the relative velocities.
    """
    scene = bd.scenes.kubas_case_2()
    mu_k, sigma = scene.params.friction.mu_k, scene.params.friction.sigma
    times = np.linspace(0.0, 0.1, 20001)
    result = bd.simulate(*scene[:2], 0.1, t_eval=times, rtol=1e-7)
    contact = result.contact
    stays = np.all(contact.pulley == contact.pulley[0], axis=0) & (contact.pulley[0] >= 0)
    assert stays.sum() >= 20
    checked = 0
    for i in np.flatnonzero(stays)[::4]:
        slip = contact.slip[:, i]
        expected = _core.dahl_path(slip, contact.mu[0, i], mu_k, sigma)
        # only where the velocity keeps its sign over the neighbouring samples is a turn excluded
        unseen = np.abs(np.diff(slip)).max()
        error = np.max(np.abs(contact.mu[:, i] - expected))
        assert error <= 2 * sigma * unseen + 1e-6
        assert error <= 2e-2
        checked += np.max(np.abs(contact.mu[:, i])) > 0.1
    assert checked >= 3


def test_memory_is_lost_with_the_contact() -> None:
    """MODEL section 4: where no pulley is touched, mu and slip are 0; gained anew from 0."""
    scene = bd.scenes.three_pulleys()
    result = bd.simulate(*scene, t_eval=np.linspace(0, scene.t_end, 4001))
    off = result.contact.pulley < 0
    assert off.any()
    assert not result.contact.mu[off].any()
    assert not result.contact.slip[off].any()
    arrived = (~off[1:]) & off[:-1]
    assert arrived.sum() > 20
    # right after arrival the slip is what slid within one sample at most
    slid = np.abs(result.contact.velocity).max() * np.diff(result.t).max()
    assert np.max(np.abs(result.contact.slip[1:][arrived])) <= slid


def test_memory_given_off_the_pulleys_is_forgotten() -> None:
    """An initial state with mu on links that touch nothing runs like the one without."""
    scene = bd.scenes.kubas_case_1()
    state = bd.simulate(*scene[:2], 0.1, t_eval=[0.1])
    off = state.contact.pulley[-1] < 0
    clean = state.final_state
    tainted = attrs.evolve(
        clean, mu=np.where(off, -0.9, clean.mu), slip=np.where(off, 1e-3, clean.slip)
    )
    one, other = (bd.simulate(*scene[:2], 0.16, initial=s) for s in (clean, tainted))
    assert np.array_equal(one.contact.mu, other.contact.mu)
    assert np.array_equal(one.final_state.mu, other.final_state.mu)
    arrived = (one.contact.pulley[-1] >= 0) & off
    assert arrived.any()


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


@pytest.mark.parametrize(
    ("method", "mu"),
    [("rk4", 1.0), ("tsit5", 1.0), ("tsit5", 0.7), ("auto", 0.7), ("rodas4", 1.0), ("lbdf2", 0.7),
     ("lie", 0.7)],
)  # fmt: skip
def test_lugre_without_its_additions_runs_like_dahl(method: str, mu: float) -> None:
    """With mu_k = 1, z / mu_k and z times its inverse are the same number, and d h + e v is 0, so
    that every step of an explicit method is the same to the last bit, and so are their numbers.

    Otherwise rounding differs by some bits a step, of the forces of joints at rest by 1e-13
    (positions rounded to 5e-17 m, over stretches of 1e-4 m); the drive is damped, so that it adds
    up at most over the steps, here some thousands. Steps are chosen in rungs, so that they are the
    same.
    """
    options = {"step": 5e-6} if method == "rk4" else METHODS[method]
    laws = bd.Dahl(mu_k=mu, sigma=1e4), attrs.evolve(PLAIN_LUGRE, mu_k=mu, mu_s=mu)
    dahl, lugre = (
        bd.simulate(with_laws(coarse(), law, law), pull(), T_END, initial=settled(), t_eval=TIMES,
                    method=method, **options)
        for law in laws
    )  # fmt: skip
    assert dahl.stats.steps == lugre.stats.steps and dahl.stats.rejected == lugre.stats.rejected
    if mu == 1.0 and method in ("rk4", "tsit5"):
        assert np.array_equal(dahl.joints.force, lugre.joints.force)
        assert np.array_equal(dahl.final_state.mu, lugre.final_state.mu)
        assert np.array_equal(dahl.energy.friction_loss, lugre.energy.friction_loss)
    error = np.max(np.abs(dahl.joints.force - lugre.joints.force))
    assert error <= 1e-13 * dahl.stats.steps * np.max(dahl.joints.force)


def test_a_record_of_another_law_is_refused() -> None:
    """Of another law, of other numbers, of another pulley's."""

    def make(*laws: bd.Friction | None) -> Any:
        params = with_laws(coarse(), *laws)
        state = settled()._to_core(params)
        return _core.Simulation(params._model, state, pull().terms(), 0.02, method="tsit5")

    laws = list(EXAMPLES.values())
    variants = [(law, law) for law in laws] + [(laws[0], law) for law in laws[1:]]
    variants += [(scaled(law, 1.01), law) for law in laws] + [(laws[0], None), (None, laws[0])]
    records = [make(*pair).export_record() for pair in variants]
    for k, pair in enumerate(variants):
        simulation = make(*pair)
        for other in (record for at, record in enumerate(records) if at != k):
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
    for other in (ELASTIC, bd.Dahl(mu_k=0.9, sigma=1e4), LUGRE):
        params = with_laws(coarse(), bd.Dahl(mu_k=0.3, sigma=1e4), other)
        one, another = touching(params, settled())
        with pytest.raises(ValueError, match=r"^state mu\[\d+\] must lie within \+-0\.3"):
            bd.simulate(params, STILL, 1e-6, initial=attrs.evolve(settled(), mu=0.5 * one))
        bd.simulate(params, STILL, 1e-6, initial=attrs.evolve(settled(), mu=5e-6 * another))


@pytest.mark.parametrize("name", EXAMPLES)
def test_laws_of_the_pulleys_cost_what_that_of_the_drive_does(name: str) -> None:
    """One slot, passes, outputs, columns of energy, bytes of a record; of two laws, what the one
    of more states does. What none costs, and each law more: test_off_is_free.py.
    """
    law = EXAMPLES[name]._to_core()

    def facts(friction: Any, own: Any = None) -> tuple[Any, ...]:
        model = make_model(friction=friction, pulley_friction=own)
        settling = _core.Simulation.settle(model, tolerance=1e-5)
        assert settling.advance(INF) is True
        sim = _core.Simulation(model, settling.state(), TORQUE, 0.02, method="tsit5")
        shapes = {key: (a.shape, a.dtype) for key, a in sim.sample([0.0, 0.02]).items()}
        passes = [one for one in sim.passes if not one.startswith("contact with")]
        assert len(passes) == len(sim.passes) - 1
        size = len(sim.export_record())
        return size, passes, model.energy_terms, model.info["n_slots"], shapes

    dahl, own = facts(DAHL._to_core()), facts(law)
    assert own[1:] == dahl[1:] and dahl[3] == 1
    assert facts(None, [law, law]) == facts(None, [law, None]) == own
    assert facts(None, [law, DAHL._to_core()]) == max(dahl, own, key=lambda found: found[0])


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
