"""What every drive keeps to, whatever it is made of, read off shared runs of a table of drives.

Each drive of `drive_table.py` is settled and run once, with the method of its row, and once more to
a tolerance at which errors of integration are of rounding. One child process answers for all that
is promised of another process.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import dense
import drive_table as table
import numpy as np
import pytest
from bridge import on_mesh_of, oracle_of
from module_common import same_bits
from test_kernels import available
from tiers import ci_if

import beltdyn as bd
from beltdyn import _core
from beltdyn.loads.motions import as_motions, motion_terms
from beltdyn.loads.torques import as_terms

#: Not in what runs in threads: what Python ignores is one for all threads.
pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

of_each = pytest.mark.parametrize("name", table.names())
#: Where exact runs are wanted: they take long with functions that jump, and where stops are hit.
LONG = ("joint-dahl-stops-speed-back", "string-lugre-stops-function-back")
of_each_exact = pytest.mark.parametrize("name", ci_if(LONG.__contains__, table.names()))
#: What is asked of links alone; of ALE belts test_ale.py asks the same.
of_links = pytest.mark.parametrize(
    "name", [name for name in table.names() if table.drive(name).row["belt"] != "ale"]
)
MEASURED = ("cpu_time", "wall_time", "settle_time")


class Ran(NamedTuple):
    """A drive, the state it settled into, and its run."""

    drive: table.Drive
    start: bd.State
    result: bd.Result


@cache
def ran(name: str) -> Ran:
    drive = table.drive(name)
    start = drive.settle()
    return Ran(drive, start, drive.run(start))


@cache
def tight(name: str) -> bd.Result:
    """The same run by "tsit5" to 1e-8, beside stops, which no step ends at, to 1e-9; told where
    torque functions have a kink and a jump.
    """
    drive, start, _ = ran(name)
    rtol = 1e-9 if drive.row["mount"] == "stops" else 1e-8
    named = table.KINKS if drive.row["loads"] in ("function", "compiled") else ()
    return drive.run(start, method="tsit5", rtol=rtol, step=None, breakpoints=named)


def arrays_of(result: bd.Result) -> dict[str, np.ndarray]:
    parts = ("pulleys", "belt", "joints", "contact", "mounts", "couplings", "energy")
    groups = [getattr(result, part) for part in parts]
    return {f"{type(g).__name__}.{k}": a for g in groups if g for k, a in g.arrays().items()}


def bits_of(start: bd.State, result: bd.Result) -> str:
    """Check sum of all that a run gives but its times."""
    counted = {k: v for k, v in attrs.asdict(result.stats).items() if k not in MEASURED}
    found = hashlib.sha256(repr((counted, result.warnings, result.message)).encode())
    for state in (start, result.final_state):
        for value in attrs.asdict(state, recurse=False).values():
            found.update(value.tobytes() if isinstance(value, np.ndarray) else b"")
    for array in arrays_of(result).values():
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def test_every_pair_that_the_library_allows_is_in_the_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And every law and method of the core; the rows that a new law needs are found."""
    all_drives = [table.drive(name) for name in table.names()]
    rows = [drive.row for drive in all_drives]
    assert list(table.missing(rows)) == [], "run tests/drive_table.py: it prints the rows to add"
    refused = [pair for row in rows for pair in table.pairs(row) if pair in table.REFUSED]
    assert not refused and len(rows) <= 72
    assert {name for name, *_ in _core.LAWS} == {law().law for law in table._LAWS.values()}
    assert {drive.options["method"] for drive in all_drives} == set(_core.METHODS)
    monkeypatch.setitem(table.VALUES, "law", (*table.VALUES["law"], "another"))
    added = list(table.further_rows(rows))
    assert {row["law"] for row in added} == {"another"} and not table.missing([*rows, *added])


@pytest.mark.parametrize("pair", table.REFUSED, ids=lambda pair: "-".join(v for _, v in pair))
def test_pairs_that_are_left_out_are_refused(pair: table.Pair) -> None:
    kind, is_raised, message = table.REFUSED[pair].partition("Error: ")
    row = {**table.drive(table.names()[0]).row, **dict(pair)}
    if not is_raised:
        assert table.make(row).scene.params.friction is None  # as without it
        return
    with pytest.raises({"Value": ValueError, "Type": TypeError}[kind], match=message):
        table.make(row)


def simulation_of(drive: table.Drive, start: bd.State) -> tuple[Any, dict[str, np.ndarray]]:
    params, torque, t_end, motion = drive.scene
    simulation = _core.Simulation(
        params._model,
        start._to_core(params),
        as_terms(torque, params.pulley_names),
        t_end,
        motion=motion_terms(as_motions(motion, params.pulley_names)),
        **drive.options,
    )
    return simulation, simulation.sample(np.linspace(0.0, t_end, table.N_SAMPLES))


def end_of(simulation: Any) -> dict[str, Any]:
    assert simulation.advance(np.inf) is True
    said = pickle.dumps([simulation.warnings, simulation.stats, simulation.choice])
    return {**simulation.state(), "said": np.frombuffer(said, np.uint8)}


def go_on(drive: table.Drive, start: bd.State, record: bytes) -> tuple[int, Any, Any]:
    """The samples from a record on, and the end."""
    simulation, samples = simulation_of(drive, start)
    simulation.import_record(record)
    first = simulation.samples
    return first, {name: rows[first:] for name, rows in samples.items()}, end_of(simulation)


def in_a_child(records: dict[str, list[bytes]]) -> dict[str, tuple[str, list[Any]]]:
    """Of each drive, the bits of a run made anew and what goes on from its records."""
    found = {}
    for name, taken in records.items():
        drive, start, result = ran(name)
        found[name] = bits_of(start, result), [go_on(drive, start, record) for record in taken]
    return found


class Stopped(NamedTuple):
    records: list[bytes]
    samples: dict[str, np.ndarray]
    end: dict[str, Any]


#: Drives of the tests of restarts by default; of all in CI.
SOME = table.names()[::4]


@cache
def stopped(names: tuple[str, ...]) -> dict[str, Stopped]:
    """Of each drive records before it begins, after 8, 40, 168 ... steps, and a whole run."""
    found = {}
    for name in names:
        simulation, samples = simulation_of(*ran(name)[:2])
        records, pause, finished = [simulation.export_record()], 1, False
        while not finished:
            for _ in range(pause):
                finished = finished or simulation.advance(0.0)
            records.append(simulation.export_record())
            pause *= 4
        found[name] = Stopped(records, samples, end_of(simulation))
    return found


@cache
def child(names: tuple[str, ...]) -> dict[str, tuple[str, list[Any]]]:
    """What one process finds of the same drives."""
    program = (
        "import pickle, sys, warnings, test_drive_table as t\n"
        "warnings.simplefilter('ignore')\n"
        "pickle.dump(t.in_a_child(pickle.load(sys.stdin.buffer)), sys.stdout.buffer)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=pickle.dumps({name: one.records for name, one in stopped(names).items()}),
        stdout=subprocess.PIPE, check=True, cwd=Path(__file__).parent,
    )  # fmt: skip
    return dict(pickle.loads(done.stdout))


def with_its_like(name: str) -> tuple[str, ...]:
    """The drives whose restarts are tried in one process with those of this one."""
    return tuple(one for one in table.names() if (one in SOME) == (name in SOME))


@pytest.mark.one_in(4)
@of_each
def test_a_stopped_run_goes_on_in_another_process_as_if_it_were_not(name: str) -> None:
    records, samples, end = stopped(with_its_like(name))[name]
    gone_on = child(with_its_like(name))[name][1]
    assert len(records) >= 3 and len(gone_on) == len(records)
    for first, later, final in gone_on:
        assert same_bits(later, {key: rows[first:] for key, rows in samples.items()})
        assert same_bits(final, end)


@pytest.mark.one_in(4)
@of_each
def test_stopping_changes_nothing(name: str) -> None:
    result, one = ran(name).result, stopped(with_its_like(name))[name]
    np.testing.assert_array_equal(one.samples["force"], result.joints.force)
    np.testing.assert_array_equal(one.end["x"], result.final_state.x)


@pytest.mark.one_in(4)
@of_each
def test_the_same_bits_in_another_process(name: str) -> None:
    assert child(with_its_like(name))[name][0] == bits_of(*ran(name)[1:])


def test_the_same_bits_again_and_in_threads_side_by_side() -> None:
    """Each drive twice at a time, so that two runs share a model."""

    def again(name: str) -> str:
        drive, start, _ = ran(name)
        assert drive.settle() == start
        return bits_of(start, drive.run(start))

    once = {name: bits_of(*ran(name)[1:]) for name in SOME}
    names = [name for name in SOME for _ in range(2)]
    with ThreadPoolExecutor(4) as pool:
        for name, found in zip(names, pool.map(again, names), strict=True):
            assert found == once[name], name


@of_each_exact
def test_the_energy_balance_closes(name: str) -> None:
    """At this tolerance less than 1e-9 of what is transmitted is left; where a function of the user
    jumps, what the control of errors leaves of a step there. The equations of an ALE belt leave out
    less than 1e-4 of what is stored, by the square of its cells.
    """
    row, energy = ran(name).drive.row, tight(name).energy
    assert energy is not None and energy.passed[-1] > 0.0
    bound = (5e-3 if row["loads"] in ("function", "compiled") else 1e-9) * energy.passed[-1]
    if row["belt"] == "ale":
        bound = max(bound, 1e-4 * float(np.max(energy.total)))
    assert np.max(np.abs(energy.residual)) <= bound


@of_links
def test_rates_and_energies_are_those_of_the_oracle(name: str) -> None:
    """Of the running state: rounding only, as in test_oracle.py."""
    drive, _, result = ran(name)
    params, state = drive.scene.params, result.final_state._to_core(drive.scene.params)
    oracle = oracle_of(params)
    slots = dense.slots_of(oracle)
    y = dense.vector_of_oracle(oracle, state, slots)
    torque = np.linspace(-4.0, 3.0, len(params.pulleys))
    expected = oracle.unpack(oracle.rhs(state["t"], y, lambda t, theta, omega: torque))
    rate = params._model.rate(state, torque)
    scales = scales_of(rate, params)
    unknown = {"t", *dense.ALE_STATES, *dense.COUPLING_STATES} | (
        {"phi", "vphi"} if oracle.freedoms == 2 else set()
    )
    for key in rate.keys() - unknown:
        want = np.asarray(expected[key])
        if key in ("mu", "slip") and rate[key].size:
            want = dense.by_slot(want, slots)
        elif key in ("mu", "slip"):
            continue
        apart = np.max(np.abs(rate[key] - want.ravel()), initial=0.0)
        assert apart <= 1e-10 * scales[key], key
    terms, energy = oracle.energy_terms(y), result.energy
    moving = ("translation", "rotation", "pulleys", "moved mounts")
    assert energy is not None
    for found, names in {
        "kinetic": moving,
        "axial": ("stretching",),
        "bending": ("bending",),
        "contact": ("contact",),
        "total": tuple(terms),
    }.items():
        want = sum(float(terms.get(term, 0.0)) for term in names)
        # stretches and penetrations of 1e-5 m are differences of positions rounded to 5e-17 m
        assert getattr(energy, found)[-1] == pytest.approx(want, rel=1e-10), found


@of_each_exact
def test_the_method_of_its_row_finds_the_same_motion(name: str) -> None:
    """Within what it is asked for, of all forces, and its energy balance closes to that; with fixed
    steps within 2 %, of "rk4" 0.1 %, and 2 % where a function jumps. Mounts, of the belt's stretch.
    """
    drive, _, result = ran(name)
    exact = tight(name).joints.force
    apart = np.sqrt(np.mean((result.joints.force - exact) ** 2)) / np.mean(exact)
    jumps = drive.row["loads"] in ("function", "compiled")
    fixed = {"rk4": 1e-3, "lbdf2-h": 0.02, "lie-h": 0.02}.get(drive.row["method"])
    bound = 0.02 if jumps else fixed or 3.0 * drive.options.get("rtol", 1e-4)
    assert apart <= bound
    assert np.max(np.abs(result.energy.residual)) <= 3.5 * bound * result.energy.passed[-1]
    if result.mounts is not None:
        params = drive.scene.params
        moved = result.mounts.travel - tight(name).mounts.travel
        strain = params.info["strain_tension"] / params.belt.axial_stiffness
        oracle = on_mesh_of if drive.row["belt"] == "ale" else oracle_of
        moved *= dense.levers(oracle(params))
        assert np.max(np.abs(moved)) <= bound * strain * params.info["length"]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("part", range(4))
def test_kernel_levels_agree(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates to 1e-11 of what a link's joints alone could do; runs to what rounding grows to in 3 ms
    in which links land, with as many steps. The ledger loses no power in a ring's last vector.
    Where the control of errors meets rounding, one step more or less is taken.
    """
    others = set()
    best = {name: early(table.drive(name), ran(name)) for name in table.names()[part::4]}
    for level in available(monkeypatch)[:-1]:
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        for name, (rates, expected) in best.items():
            rate, run = early(table.drive(name), ran(name))
            assert run.stats.kernels == level
            for key, scale in scales_of(rates, ran(name).drive.scene.params).items():
                apart = np.max(np.abs(rate[key] - rates[key]), initial=0.0)
                assert apart <= (1e-10 if key == "mu" else 1e-11) * scale, (name, key)
            if run.stats.steps != expected.stats.steps:
                others.add(name)
                continue
            scale = np.max(np.abs(expected.joints.force))
            assert np.max(np.abs(run.joints.force - expected.joints.force)) <= 1e-10 * scale, name
            left = np.max(np.abs(run.energy.residual - expected.energy.residual))
            assert left <= 1e-9 * expected.energy.passed[-1], name
    assert len(others) <= 1, others


def scales_of(rates: dict[str, Any], params: bd.Params) -> dict[str, float]:
    """Sizes by which rates are compared: what the belt's tension alone would do to a link or to a
    kilogram of a mount, for forces all but cancel; the stretch of a bristle follows the slip, and
    as its damper is weak, it takes a hundred times the rounding of forces.
    """
    pull, half = params.info["strain_tension"], params.info["link_length"] / 2
    scales = {key: float(np.max(np.abs(value), initial=0.0)) for key, value in rates.items()}
    mass = params.info["link_mass"]
    least = dict.fromkeys(("vx", "vy", "v", "p"), pull / mass) | {"vphi": 3 * pull / mass / half}
    least["m"] = float(np.sqrt(pull * 2 * half / mass))  # the speed of waves: flows all but cancel
    least |= {"travel_speed": pull, "mu": 100.0 * max(scales["slip"], scales["mu"], 0.1)}
    return {key: max(scale, least.get(key, 0.0)) for key, scale in scales.items()}


def early(drive: table.Drive, one: Ran) -> tuple[dict[str, np.ndarray], Any]:
    """Rates at the end of its run, and a run of 3 ms."""
    params, torque, _, motion = drive.scene
    end = one.result.final_state._to_core(params)
    rates = params._model.rate(end, np.linspace(-4.0, 3.0, len(params.pulleys)))
    options = {"initial": one.start, "t_eval": np.linspace(0.0, 0.003, 4), **drive.options}
    if options["method"] == "tsit5":  # steps as long as is stable magnify rounding themselves
        options["rtol"] = 1e-6
    return rates, bd.simulate(params, torque, 0.003, motion, **options)


@of_each
def test_effects_are_there_only_where_the_drive_calls_for_them(name: str) -> None:
    drive, _, result = ran(name)
    row, params = drive.row, drive.scene.params
    assert name == table.name_of(row)
    assert params.belt_model == {"string": "string", "ale": "cells"}.get(row["belt"], "links")
    outside = any(pulley.side == "outside" for pulley in params.pulleys)
    assert outside == (row["layout"] in ("crossed", "back"))
    friction = params.has_friction
    assert friction or row["law"] == "none"
    called = {
        "gravity": row["gravity"] != "-",
        "bearing drag": row["drag"] != "-",
        "axes on mounts": row["mount"] != "fixed",
        "prescribed motion": row["loads"] in ("speed", "crank", "moved"),
        "energy ledger": True,
    }
    assert {effect: effect in result.effects for effect in called} == called
    assert (result.mounts is not None) == called["axes on mounts"]
    assert result.energy is not None
    assert (result.energy.drag_loss is not None) == called["bearing drag"]
    assert any("bending" in one for one in result.effects) == (row["bending"] != "-")
    assert friction == bool(result.contact.friction.any())
    if row["belt"] != "ale":  # whose places of contact stand still
        assert friction == bool(result.contact.slip.any())


@of_each
def test_ledger_and_outputs_off_change_nothing(name: str) -> None:
    """Of rodas4, the ledger is an evaluation in the middle of every step."""
    drive, start, on = ran(name)
    off = drive.run(start, ledger=False, outputs=("joints.force",))
    assert set(on.effects) - set(off.effects) == {"energy ledger"}
    more = on.stats.steps if on.stats.method == "rodas4" else 0
    if on.stats.method != "auto":
        assert on.stats.nfev == off.stats.nfev + more
    # the quadratures feed nothing back; only the compiler may order a sum differently
    scale = np.max(np.abs(on.joints.force))
    assert np.max(np.abs(on.joints.force - off.joints.force)) <= 1e-10 * scale


@of_each
def test_toml_and_files_give_it_back(name: str, tmp_path: Path) -> None:
    drive, _, result = ran(name)
    scene = drive.scene
    if drive.row["loads"] in ("function", "compiled", "moved"):
        with pytest.raises(TypeError, match="to be written as TOML"):
            scene.to_toml()
        assert bd.Params.from_toml(scene.params.to_toml()) == scene.params
    else:
        assert bd.Scene.from_toml(scene.to_toml()) == scene
    result.save(tmp_path / "run.npz")
    back = bd.Result.load(tmp_path / "run.npz")
    assert same_bits(arrays_of(back), arrays_of(result))
    for part in ("params", "final_state", "stats", "warnings", "effects", "message"):
        assert getattr(back, part) == getattr(result, part), part


@pytest.mark.parametrize("name", table.names()[::19])
def test_it_is_printed_reported_and_explained(name: str) -> None:
    drive, _, result = ran(name)
    told = result.report()
    params = drive.scene.params
    assert repr(result).startswith("Result(") and "\n" in str(result)
    labels = [params.label(k) for k in range(len(params.pulleys))]
    for text in (str(told), told.text(full=True), json.dumps(told.to_dict())):
        assert all(label in text for label in labels), text
    explanation = bd.explain(*drive.scene, ablation=False, method="rodas4")
    on = {effect.name for effect in explanation.effects if effect.on}
    assert on >= set(result.effects) - {"energy ledger"}
    assert str(explanation) and explanation.passes
