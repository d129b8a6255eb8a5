"""What every drive keeps to, whatever it is made of, read off shared runs of a table of drives.

Each drive of `drive_table.py` is settled and run once, with the method of its row, and once more to
a tolerance at which errors of integration are of rounding. One child process answers for all that
is promised of another process.
"""

from __future__ import annotations

import hashlib
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
from bridge import oracle_of
from module_common import same_bits

import beltdyn as bd
from beltdyn import _core
from beltdyn.motions import as_motions, motion_terms
from beltdyn.torques import as_terms

#: Not in what runs in threads: what Python ignores is one for all threads.
pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

of_each = pytest.mark.parametrize("name", table.names())
GROUPS = ("pulleys", "belt", "joints", "contact", "mounts", "energy")
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
    """The same run by "tsit5" to 1e-8; told where torque functions have a kink and a jump."""
    drive, start, _ = ran(name)
    named = table.KINKS if drive.row["loads"] in ("function", "compiled") else ()
    return drive.run(start, method="tsit5", rtol=1e-8, step=None, breakpoints=named)


def arrays_of(result: bd.Result) -> dict[str, np.ndarray]:
    groups = [getattr(result, group) for group in GROUPS]
    return {f"{type(g).__name__}.{k}": a for g in groups if g for k, a in g.arrays().items()}


def vars_of(state: bd.State) -> list[np.ndarray]:
    fields = attrs.asdict(state, recurse=False).values()
    return [value for value in fields if isinstance(value, np.ndarray)]


def bits_of(start: bd.State, result: bd.Result) -> str:
    """Check sum of all that a run gives but its times."""
    counted = {k: v for k, v in attrs.asdict(result.stats).items() if k not in MEASURED}
    said = repr((counted, result.warnings, result.message))
    found = hashlib.sha256(said.encode())
    states = [v for state in (start, result.final_state) for v in vars_of(state)]
    for array in (*states, *arrays_of(result).values()):
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


# --- restart records ------------------------------------------------------------------------------


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


@pytest.fixture(scope="module")
def stopped() -> dict[str, Stopped]:
    """Of each drive records before it begins, after 8, 32, 128 ... steps, and the run to its end."""
    found = {}
    for name in table.names():
        simulation, samples = simulation_of(*ran(name)[:2])
        records, pause, finished = [simulation.export_record()], 1, False
        while not finished:
            for _ in range(pause):
                finished = finished or simulation.advance(0.0)
            records.append(simulation.export_record())
            pause *= 4
        found[name] = Stopped(records, samples, end_of(simulation))
    return found


@pytest.fixture(scope="module")
def child(stopped: dict[str, Stopped]) -> dict[str, tuple[str, list[Any]]]:
    program = (
        "import pickle, sys, warnings, test_drive_table as t\n"
        "warnings.simplefilter('ignore')\n"
        "pickle.dump(t.in_a_child(pickle.load(sys.stdin.buffer)), sys.stdout.buffer)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=pickle.dumps({name: one.records for name, one in stopped.items()}),
        stdout=subprocess.PIPE, check=True, cwd=Path(__file__).parent,
    )  # fmt: skip
    return dict(pickle.loads(done.stdout))


@of_each
def test_a_stopped_run_goes_on_in_another_process_as_if_it_were_not(
    name: str, stopped: dict[str, Stopped], child: dict[str, tuple[str, list[Any]]]
) -> None:
    records, samples, end = stopped[name]
    assert len(records) >= 3 and len(child[name][1]) == len(records)
    for first, later, final in child[name][1]:
        assert same_bits(later, {key: rows[first:] for key, rows in samples.items()})
        assert same_bits(final, end)


@of_each
def test_stopping_changes_nothing(name: str, stopped: dict[str, Stopped]) -> None:
    result, samples = ran(name).result, stopped[name].samples
    np.testing.assert_array_equal(samples["force"], result.joints.force)
    np.testing.assert_array_equal(stopped[name].end["x"], result.final_state.x)


# --- the same bits --------------------------------------------------------------------------------


@of_each
def test_the_same_bits_in_another_process(name: str, child: dict[str, tuple[str, Any]]) -> None:
    assert child[name][0] == bits_of(*ran(name)[1:])


def test_the_same_bits_again_and_in_threads_side_by_side() -> None:
    """Each drive twice at a time, so that two runs share a model; torque functions, too."""

    def again(name: str) -> str:
        drive, start, _ = ran(name)
        assert drive.settle() == start
        return bits_of(start, drive.run(start))

    once = {name: bits_of(*ran(name)[1:]) for name in table.names()}
    names = [name for name in table.names() for _ in range(2)]
    with ThreadPoolExecutor(4) as pool:
        for name, found in zip(names, pool.map(again, names), strict=True):
            assert found == once[name], name


# --- physics --------------------------------------------------------------------------------------


@of_each
def test_the_energy_balance_closes(name: str) -> None:
    """The residual has no reference. At this tolerance the method leaves less than 1e-9 of what is
    transmitted."""
    energy = tight(name).energy
    assert energy is not None and energy.passed[-1] > 0.0
    assert np.max(np.abs(energy.residual)) <= 1e-9 * energy.passed[-1]


@of_each
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
    unknown = {"t"} | ({"phi", "vphi"} if oracle.freedoms == 2 else set())
    for key in rate.keys() - unknown:
        want = np.asarray(expected[key])
        if key in ("mu", "slip") and rate[key].size:
            by_pulley = np.moveaxis(want.reshape(-1, *want.shape[-2:]), 1, 0)
            want = np.zeros((rate[key].size // by_pulley[0].size, *by_pulley.shape[1:]))
            np.add.at(want, slots, by_pulley)
        elif key in ("mu", "slip"):
            continue
        scale = np.max(np.abs(want), initial=0.0)
        assert np.max(np.abs(rate[key] - want.ravel()), initial=0.0) <= 1e-10 * scale, key
    assert result.energy is not None
    assert result.energy.total[-1] == pytest.approx(float(oracle.energy(y)), rel=1e-10)


@of_each
def test_the_method_of_its_row_finds_the_same_motion(name: str) -> None:
    result, exact = ran(name).result, tight(name)
    apart = np.sqrt(np.mean((result.joints.force - exact.joints.force) ** 2))
    print("APART", name, ran(name).drive.options, apart / exact.joints.force.mean())


def test_kernel_levels_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    for level in ("baseline", "avx2", "avx512"):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        if _core.kernel_level() != level or level == ran(table.names()[0]).result.stats.kernels:
            continue
        for name in table.names():
            first, start, result = ran(name)
            drive = table.drive(name)
            params, end = drive.scene.params, result.final_state._to_core(drive.scene.params)
            torque = np.linspace(-4.0, 3.0, len(params.pulleys))
            one, other = (p._model.rate(end, torque) for p in (first.scene.params, params))
            worst = max(
                np.max(np.abs(one[k] - other[k]), initial=0.0)
                / max(np.max(np.abs(one[k]), initial=0.0), 1e-300)
                for k in one
            )
            times = np.linspace(0.0, 0.003, 4)
            runs = [
                bd.simulate(
                    *d.scene[:2], 0.003, d.scene.motion, initial=start, t_eval=times, **d.options
                )
                for d in (first, drive)
            ]
            assert runs[0].stats.kernels != runs[1].stats.kernels
            a, b = [r.joints.force for r in runs]
            print(
                "LEVEL",
                level,
                name,
                f"{worst:.1e} {np.max(np.abs(a - b)) / a.mean():.1e}",
                runs[0].stats.steps,
                runs[1].stats.steps,
                drive.options,
            )
