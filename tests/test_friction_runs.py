"""Runs with every friction law of the table, and with laws mixed on the pulleys: the ledger, the
bounds, the methods and the kernels against each other, records, settling, what is not used costing
nothing, warnings.
"""

from __future__ import annotations

import functools
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from bridge import fields, oracle_of
from drives import METHODS
from laws import EXAMPLES, PLAIN_LUGRE, STRIBECK, UNDAMPED_LUGRE, scaled, with_laws
from module_common import INF, TORQUE, make_model, same_bits
from test_kernels import available

import beltdyn as bd
from beltdyn import _core, run_warnings, sanity

Laws = tuple[bd.Friction | None, ...]

LUGRE, ELASTIC, COULOMB = (EXAMPLES[name] for name in ("lugre", "elastic_plastic", "coulomb"))
DAHL = EXAMPLES["dahl"]
#: On the two pulleys of the plain drive, with the paper's mesh or with contact of the joints.
PAIRS: dict[str, Laws] = {
    **{name: (law, law) for name, law in EXAMPLES.items()},
    "lugre, undamped": (UNDAMPED_LUGRE, UNDAMPED_LUGRE),
    "mixed": (scaled(LUGRE, 1.2), ELASTIC),
    "one without": (ELASTIC, None),
    "no state and one": (COULOMB, LUGRE),
    "joints, coulomb": (COULOMB, COULOMB),
    "joints, no state and one": (ELASTIC, scaled(COULOMB, 0.7)),
    "joints, dahl": (EXAMPLES["dahl"], EXAMPLES["dahl"]),
    "joints, mixed": (scaled(LUGRE, 1.2), ELASTIC),
    "joints, one without": (ELASTIC, None),
    "several states and one": (EXAMPLES["maxwell_slip"], STRIBECK["dahl"]),
    "joints, several states and none": (STRIBECK["maxwell_slip"], STRIBECK["coulomb"]),
}
T_END = 0.05
TIMES = np.linspace(0.0, T_END, 101)

pytestmark = pytest.mark.filterwarnings("ignore:(mesh|full_slip):UserWarning")


def drive(pair: str) -> bd.Params:
    mesh = "joint" if pair.startswith("joints") else "paper"
    return with_laws(drives.on_mesh(drives.plain(), mesh), *PAIRS[pair])


@functools.cache
def rest(pair: str) -> bd.State:
    return bd.settle(drive(pair))


def n_states(params: bd.Params) -> int:
    states: int = params.info["n_states"]
    return states


def core_rest(pair: str) -> dict[str, Any]:
    return rest(pair)._to_core(drive(pair))


def pull() -> bd.Torque:
    return bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-50.0, 0.0]]) + bd.Viscous([0.0, 16.0])


def run(pair: str, method: str, **options: Any) -> bd.Result:
    given = {**METHODS[method], "t_eval": TIMES, "initial": rest(pair), **options}
    return bd.simulate(drive(pair), pull(), T_END, method=method, **given)


@functools.cache
def tight(pair: str) -> bd.Result:
    return run(pair, "tsit5", rtol=1e-8)


# -------------------------------------------------------------------- energy


@pytest.mark.parametrize("pair", PAIRS)
def test_the_ledger_closes(pair: str) -> None:
    """Explicit, at a tight tolerance: a millionth of what passes through, as with Dahl's law; every
    kink of sticking and slipping is found by the error control. And friction has lost some.
    """
    result = tight(pair)
    assert np.max(np.abs(result.energy.residual)) <= 1e-6 * result.energy.passed[-1]
    assert result.energy.friction_loss[-1] > 1e-5 * result.energy.passed[-1]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("pair", PAIRS)
def test_the_ledger_of_every_method(pair: str, method: str) -> None:
    """It errs by a small part of what passes through, and by far less than friction takes."""
    energy = run(pair, method).energy
    most = 10 * METHODS[method].get("rtol", 1e-4) * energy.passed[-1]
    assert np.max(np.abs(energy.residual)) <= most


@pytest.mark.parametrize("pair", PAIRS)
def test_terms_of_the_ledger_are_the_oracles(pair: str) -> None:
    """Rates of all works at a running state, from two codes; rounding only."""
    result = tight(pair)
    oracle, state = oracle_of(result.params), fields(result.final_state)
    y = oracle.pack(state)
    powers = oracle.rhs(state["t"], y, pull())[-5:]
    friction = oracle.contacts(y)
    sample = result.contact
    assert float(powers[3]) == pytest.approx(
        float(np.sum(sample.friction[-1] * sample.velocity[-1])),
        abs=1e-12 * float(np.sum(np.abs(friction.friction * friction.velocity))),
    )


# -------------------------------------------------------------------- bounds


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


@pytest.mark.parametrize("method", ["tsit5", "lbdf2", "rodas4"])
@pytest.mark.parametrize("pair", PAIRS)
def test_states_keep_their_bounds(pair: str, method: str) -> None:
    """At a tolerance that would let them out, at every eighth accepted step; and that of links that
    touch nothing, or a pulley without friction, is 0. A law without a state has none in the run.
    """
    params = drive(pair)
    hard = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-150.0, 0.0]])
    sim = _core.Simulation(
        params._model, core_rest(pair), hard.terms(), 0.03, method=method, rtol=1e-2
    )
    looked, finished, reached = 0, False, 0.0
    while not finished:
        finished = sim.advance(0.0)
        state = sim.state()
        bounds, rubs = _bounds(pair, state)
        states, n = n_states(params), rubs.size
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


@pytest.mark.parametrize("method", ["tsit5", "lbdf2", "rodas4"])
def test_elastic_plastic_friction_keeps_its_limit(method: str) -> None:
    """|F| <= mu N to rounding in every sample, and it gets there."""
    hard = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-150.0, 0.0]])
    for coefficient in (0.4, 0.8):
        law = attrs.evolve(ELASTIC, mu=coefficient)
        params = with_laws(drives.plain(), law, law)
        result = bd.simulate(
            params, hard, 0.03, initial=rest("elastic_plastic"), method=method, rtol=1e-2
        )
        limit = coefficient * result.contact.normal
        size = np.abs(result.contact.friction)
        assert np.all(size <= limit * (1 + 4 * np.finfo(float).eps))
        assert np.all(np.abs(result.contact.mu) <= coefficient * (1 + 4 * np.finfo(float).eps))
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


# -------------------------------------------------------------------- LuGre as Dahl's law


def as_dahl(mu: float) -> tuple[bd.Dahl, bd.LuGre]:
    return bd.Dahl(mu_k=mu, sigma=1e4), attrs.evolve(PLAIN_LUGRE, mu_k=mu, mu_s=mu)


@pytest.mark.parametrize("method", ["rk4", "tsit5"])
def test_lugre_without_its_additions_runs_like_dahl(method: str) -> None:
    """With mu_k = 1, z / mu_k and z times its inverse are the same number, and d h + e v is 0, so
    that every step of an explicit method is the same to the last bit, and so are their numbers.
    """
    step = {"step": 5e-6} if method == "rk4" else {}
    runs = []
    for law in as_dahl(1.0):
        params = with_laws(drives.plain(), law, law)
        start = bd.settle(drives.plain())
        runs.append(
            bd.simulate(params, pull(), T_END, initial=start, t_eval=TIMES, method=method, **step)
        )
    dahl, lugre = runs
    assert dahl.stats.steps == lugre.stats.steps and dahl.stats.rejected == lugre.stats.rejected
    assert np.array_equal(dahl.joints.force, lugre.joints.force)
    assert np.array_equal(dahl.final_state.mu, lugre.final_state.mu)
    assert np.array_equal(dahl.energy.friction_loss, lugre.energy.friction_loss)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "rk4"])
@pytest.mark.parametrize("mu", [1.0, 0.7])
def test_lugre_without_its_additions_makes_the_steps_of_dahl(method: str, mu: float) -> None:
    """Rounding differs by some bits a step, of the forces of joints at rest by 1e-13 (positions
    rounded to 5e-17 m, over stretches of 1e-4 m); the drive is damped, so that it adds up at most
    over the steps, here some thousands. Steps are chosen in rungs, so that they are the same.
    """
    runs = []
    for law in as_dahl(mu):
        params = with_laws(drives.plain(), law, law)
        start = bd.settle(drives.plain())
        runs.append(
            bd.simulate(params, pull(), T_END, initial=start, t_eval=TIMES, method=method,
                        **METHODS[method])
        )  # fmt: skip
    dahl, lugre = runs
    assert dahl.stats.steps == lugre.stats.steps and dahl.stats.rejected == lugre.stats.rejected
    error = np.max(np.abs(dahl.joints.force - lugre.joints.force))
    assert error <= 1e-13 * dahl.stats.steps * np.max(dahl.joints.force)


# -------------------------------------------------------------------- methods, kernels


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("pair", PAIRS)
def test_methods_agree(pair: str, method: str) -> None:
    """Errors are what runs claim, by five at most (README); fixed steps claim nothing, and that of
    rk4 is a thousandth.
    """
    exact = tight(pair)
    result = run(pair, method)
    rest_tension = exact.params.info["strain_tension"]
    error = np.sqrt(np.mean((result.joints.force - exact.joints.force) ** 2)) / rest_tension
    claim = result.stats.error
    assert method == "rk4" or claim is not None
    assert error <= 5 * (1e-3 / 5 if claim is None else claim)
    assert error <= 5 * METHODS[method].get("rtol", 1e-3)


@pytest.mark.parametrize("pair", PAIRS)
def test_kernel_levels_agree(monkeypatch: pytest.MonkeyPatch, pair: str) -> None:
    """One rate, by rounding alone; 2 ms of a run, by what that grows to. 61 links: the last vector
    is not full.
    """
    base = drive(pair)
    belt = attrs.evolve(base.belt, n_bodies=61)
    start: bd.State | None = None
    rates, runs = [], []
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        params = attrs.evolve(base, belt=belt)
        if start is None:
            start = bd.simulate(params, pull(), 0.03, t_eval=[0.03]).final_state
        core = start._to_core(params)
        rates.append(params._model.rate(core, np.array([-10.0, 2.0])))
        times = np.linspace(0.03, 0.032, 3)
        runs.append(
            [
                bd.simulate(params, pull(), 0.032, initial=start, t_eval=times, method=method)
                for method in ("tsit5", "rodas4")
            ]
        )
        assert runs[-1][0].stats.kernels == level
    acceleration = params.info["strain_tension"] / params.info["link_mass"]
    for rate, pair_of_runs in zip(rates[1:], runs[1:], strict=True):
        for name, expected in rates[0].items():
            scale = {"vx": acceleration, "vy": acceleration}.get(
                name, np.max(np.abs(expected), initial=0.0)
            )
            scale = 6 * acceleration / params.info["link_length"] if name == "vphi" else scale
            assert np.max(np.abs(rate[name] - expected), initial=0.0) <= 1e-11 * scale, name
        for one, other in zip(pair_of_runs, runs[0], strict=True):
            tension = np.max(np.abs(other.joints.force))
            assert np.max(np.abs(one.joints.force - other.joints.force)) <= 1e-10 * tension
            assert one.stats.steps == other.stats.steps


@pytest.mark.parametrize("pair", PAIRS)
def test_a_run_is_the_same_every_time(pair: str) -> None:
    one, other = (run(pair, "auto") for _ in range(2))
    assert np.array_equal(one.joints.force, other.joints.force)
    assert np.array_equal(one.final_state.mu, other.final_state.mu)


# -------------------------------------------------------------------- records and states


@pytest.mark.parametrize("method", ["tsit5", "rodas4", "lbdf2"])
@pytest.mark.parametrize("pair", PAIRS)
def test_a_run_goes_on_from_its_record_bit_for_bit(pair: str, method: str) -> None:
    """In a simulation of its own; in another process: tests/test_record.py."""

    def make() -> tuple[Any, dict[str, Any]]:
        state = core_rest(pair)
        sim = _core.Simulation(drive(pair)._model, state, pull().terms(), 0.02, method=method)
        return sim, sim.sample(np.linspace(0.0, 0.02, 21))

    whole, expected = make()
    assert whole.advance(INF) is True
    stopped, _ = make()
    for _ in range(5):
        stopped.advance(0.0)
    record = stopped.export_record()
    later, samples = make()
    later.import_record(record)
    first = later.samples
    assert later.advance(INF) is True
    assert same_bits(later.state(), whole.state())
    assert same_bits(
        {name: rows[first:] for name, rows in samples.items()},
        {name: rows[first:] for name, rows in expected.items()},
    )


def test_a_record_of_another_law_is_refused() -> None:
    """Of another law, of other numbers, of another pulley's."""

    def make(*laws: bd.Friction | None) -> Any:
        params = with_laws(drives.plain(), *laws)
        state = rest("dahl")._to_core(params)
        return _core.Simulation(params._model, state, pull().terms(), 0.02, method="tsit5")

    laws = list(EXAMPLES.values())
    variants = [(law, law) for law in laws] + [(laws[0], law) for law in laws[1:]]
    variants += [(scaled(law, 1.01), law) for law in laws] + [(laws[0], None), (None, laws[0])]
    records = [make(*pair).export_record() for pair in variants]
    for k, pair in enumerate(variants):
        for other, record in enumerate(records):
            if other == k:
                make(*pair).import_record(record)
            else:
                with pytest.raises(ValueError, match="the record is of another run"):
                    make(*pair).import_record(record)


@pytest.mark.parametrize("pair", PAIRS)
def test_a_state_goes_out_and_in(pair: str, tmp_path: Any) -> None:
    """Split in two, a run with a fixed step is that in one, to rounding of the places' origin.

    Friction without a state is a damper mu N / v_reg near v = 0, of a link at 1e6 / s here.
    """
    halves = TIMES[:51], TIMES[50:]
    sticks = all(law is None or law.n_states for law in PAIRS[pair])
    step = 5e-6 if sticks else 2e-6
    options: dict[str, Any] = {"method": "rk4", "step": step}
    whole = run(pair, "rk4", step=step)
    first = bd.simulate(
        drive(pair), pull(), halves[0][-1], initial=rest(pair), t_eval=halves[0], **options
    )
    first.final_state.save(tmp_path / "state.npz")
    middle = bd.State.load(tmp_path / "state.npz")
    assert np.array_equal(middle.mu, first.final_state.mu)
    second = bd.simulate(drive(pair), pull(), T_END, initial=middle, t_eval=halves[1], **options)
    assert np.max(np.abs(second.joints.force - whole.joints.force[50:])) <= 1e-8 * np.max(
        whole.joints.force
    )


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_state_beyond_the_bound_is_refused(name: str) -> None:
    """By its name, before anything runs; within a bit of it, and where nothing is touched, not."""
    law = EXAMPLES[name]
    params = with_laws(drives.plain(), law, None)
    oracle = oracle_of(params)
    bound = oracle.laws[0].bound if oracle.laws[0] is not None else 0.0
    state = bd.settle(params)
    touch = oracle.penetration(oracle.pack(fields(state))) > 0
    link = int(np.flatnonzero(touch[0])[3])
    still = bd.Viscous([0.0, 0.0])

    def started_with(value: float, at: int = link) -> bd.Result:
        mu = np.zeros_like(state.mu)
        mu[..., at] = value
        return bd.simulate(params, still, 1e-6, initial=attrs.evolve(state, mu=mu))

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
    dahl = bd.Dahl(mu_k=0.3, sigma=1e4)
    for other in (ELASTIC, bd.Dahl(mu_k=0.9, sigma=1e4), LUGRE):
        params = with_laws(drives.plain(), dahl, other)
        oracle, state = oracle_of(params), bd.settle(params)
        touch = oracle.penetration(oracle.pack(fields(state))) > 0
        for pulley, fits in ((0, False), (1, True)):
            mu = np.where(touch[pulley], 0.5, 0.0)
            start = attrs.evolve(state, mu=mu if pulley == 0 else 1e-5 * mu)
            if fits:
                bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-6, initial=start)
            else:
                with pytest.raises(ValueError, match=r"^state mu\[\d+\] must lie within \+-0\.3"):
                    bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-6, initial=start)


# -------------------------------------------------------------------- what is off costs nothing


def test_off_costs_nothing() -> None:
    """No pass, no slot, no number in the state, the same bits, whichever way it is off."""
    runs = []
    for friction, own in ((None, None), (None, [None, None])):
        model = make_model(friction=friction, pulley_friction=own)
        assert model.info["n_slots"] == 0
        assert [row[0] for row in model.friction] == ["none", "none"]
        settling = _core.Simulation.settle(model, tolerance=1e-5)
        assert settling.advance(INF) is True
        state = settling.state()
        assert state["mu"].size == 0 and state["slip"].size == 0
        sim = _core.Simulation(model, state, TORQUE, 0.02, method="rodas4")
        samples = sim.sample(np.linspace(0.0, 0.02, 9))
        sim.advance(0.0)
        record = sim.export_record()
        assert sim.advance(INF) is True
        assert "contact without friction" in sim.passes
        runs.append((sim, samples, record))
    (plain, samples, record), (other, its_samples, its_record) = runs
    assert other.passes == plain.passes and its_record == record
    assert same_bits(its_samples, samples)


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_law_costs_one_slot_and_no_more(name: str) -> None:
    """All laws the same: passes, outputs, columns of energy, bytes of a record, whether the law is
    the drive's, or the pulleys' own, or one of two. One without a state has the slip of its slot
    and nothing else: of each vector in the record, a block of links less; one with several a block
    more for each.
    """
    law = EXAMPLES[name]._to_core()

    def facts(**changes: Any) -> tuple[Any, ...]:
        model = make_model(**changes)
        settling = _core.Simulation.settle(model, tolerance=1e-5)
        assert settling.advance(INF) is True
        sim = _core.Simulation(model, settling.state(), TORQUE, 0.02, method="tsit5")
        arrays = sim.sample(np.linspace(0.0, 0.02, 9))
        shapes = {key: (rows.shape, rows.dtype) for key, rows in arrays.items()}
        size = len(sim.export_record())
        passes = [name for name in sim.passes if not name.startswith("contact with")]
        assert len(passes) == len(sim.passes) - 1
        return passes, model.energy_terms, model.info["n_slots"], shapes, size

    dahl = facts()
    assert dahl[2] == 1
    own = facts(friction=law)
    assert own[:4] == dahl[:4]
    assert facts(friction=None, pulley_friction=[law, law]) == own
    assert facts(friction=None, pulley_friction=[law, None]) == own
    most = max((dahl, own), key=lambda found: found[4])
    assert facts(friction=None, pulley_friction=[law, DAHL._to_core()]) == most
    without, states = facts(friction=None), EXAMPLES[name].n_states
    assert without[4] < own[4] and without[2] == 0
    assert np.sign(own[4] - dahl[4]) == np.sign(states - 1)
    if states > 1:
        block = dahl[4] - facts(friction=EXAMPLES["coulomb"]._to_core())[4]
        assert own[4] - dahl[4] == (states - 1) * block
    if EXAMPLES[name].n_states == 0:  # a block as large as that of the slip, and the link's owner
        blocks, owners = dahl[4] - own[4], own[4] - without[4] - (dahl[4] - own[4])
        assert blocks > 0 and blocks % 8 == 0 and 0 < owners < blocks
    assert without[:2] == dahl[:2]
    assert dahl[3].items() - without[3].items() == {
        (column, dahl[3][column]) for column in ("friction", "mu", "slip")
    }


@pytest.mark.parametrize("pair", PAIRS)
def test_a_run_says_which_laws_it_has(pair: str) -> None:
    """Each once, in the order of the table."""
    texts = {name: text for name, _, text in _core.LAWS}
    used = {law.law for law in PAIRS[pair] if law is not None}
    words = " and ".join(text for name, text in texts.items() if name in used)
    assert f"contact with {words} friction" in tight(pair).effects


def test_a_law_of_its_own_that_is_the_drives_changes_nothing() -> None:
    """To the last bit, for each law."""
    for name, law in EXAMPLES.items():
        base = attrs.evolve(drives.plain(), friction=law)
        one, other = (
            bd.simulate(params, pull(), 0.01, initial=rest(name), method="rodas4")
            for params in (base, with_laws(base, law, law))
        )
        assert np.array_equal(one.joints.force, other.joints.force)
        assert one.effects == other.effects


# -------------------------------------------------------------------- settling


@pytest.mark.parametrize("pulleys", ["held", "free"])
@pytest.mark.parametrize("pair", PAIRS)
def test_settling_with_friction(pair: str, pulleys: str) -> None:
    """From the belt line, pulley 1 moved to its place: still, balanced, and within the bounds."""
    params = drive(pair)
    state = bd.settle(params, friction=True, pulleys=pulleys, offset={1: (-0.002, 0.0)})
    assert not any(getattr(state, v).any() for v in ("vx", "vy", "vphi", "omega"))
    assert state.residual is not None and state.residual <= 1e-9
    assert state.mu.any() == (n_states(params) > 0)
    core = fields(state)
    assert np.all(np.abs(state.mu) <= _bounds(pair, core)[0])
    oracle = oracle_of(params)
    rate = oracle.rhs(0.0, oracle.pack(core), lambda t, theta, omega: 0 * omega)
    acceleration = oracle.links(rate)[1]
    force = oracle.mass * np.hypot(acceleration[0], acceleration[1])
    assert force.max() <= 1.1e-9 * params.info["strain_tension"]
    if pulleys == "free":
        contacts = oracle.contacts(oracle.pack(core))
        torque = np.sum(contacts.friction * contacts.distance, axis=1)
        assert np.max(np.abs(torque)) <= 1e-8 * params.info["strain_tension"]
    # it stays at rest when it is let go
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 2e-3, initial=state, rtol=1e-6)
    moved = np.max(np.abs(result.joints.force - result.joints.force[0]))
    assert moved <= 1e-6 * params.info["strain_tension"] or pulleys == "held"


# -------------------------------------------------------------------- warnings


@pytest.mark.parametrize("name", EXAMPLES)
def test_full_slip_is_seen_with_every_law(name: str) -> None:
    """A torque beyond what half the friction can hold; on the pulley whose friction is weak."""
    strong, weak = scaled(EXAMPLES[name], 2.0), scaled(EXAMPLES[name], 0.25)
    torque = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-60.0, 0.0]]) + bd.Viscous([0.0, 16.0])
    for laws, slipping in (((weak, strong), "pulley 0"), ((strong, strong), None)):
        params = with_laws(drives.plain(), *laws)
        with run_warnings.silenced():
            result = bd.simulate(params, torque, 0.08)
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
    law = EXAMPLES[name]
    percent = scaled(law, 100.0 / 2)
    base = attrs.evolve(drives.plain(), friction=law)

    def doubts(params: bd.Params) -> list[tuple[str | None, str]]:
        return [(one.where, one.text) for one in sanity.check(params) if one.code == "units"]

    assert doubts(base) == []
    (one,) = doubts(attrs.evolve(base, friction=percent))
    assert one[0] == "friction" and "percent" in one[1]
    own = with_laws(base, law, percent)
    (one,) = doubts(own)
    assert one[0] == "pulley 1" and "percent" in one[1]
    both = with_laws(base, percent, percent)
    (one,) = doubts(both)
    assert one[0] == "pulley 0"
