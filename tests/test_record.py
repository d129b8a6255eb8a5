"""What a restart record is refused for, and runs that leave something to remember but their state.

That any drive of the table goes on from its record in another process, bit for bit, is in
``test_drive_table.py``; here are a twin that runs beside a lightly damped drive and a torque
function that jumps all the time, with every method.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from module_common import INF, TORQUE, make_model, refused, same_bits

from beltdyn import SimulationError, _core

#: Options of Simulation: every method, adaptive and, where it may be, with a fixed step.
METHODS: list[dict[str, Any]] = [
    {"method": "auto"}, {"method": "auto", "rtol": 1e-2}, {"method": "tsit5"}, {"method": "rk4"},
    {"method": "rodas4"}, {"method": "lbdf2", "rtol": 1e-3}, {"method": "lie", "rtol": 1e-2},
    {"method": "lbdf2", "step": 2e-5}, {"method": "lie", "step": 2e-5},
]  # fmt: skip


def relay(_t: float, _theta: Any, omega: Any) -> list[float]:
    """It jumps all the time, and that is remembered."""
    return [-60.0 if omega[0] > -1.0 else 0.0, 0.0]


#: One of each load, with factors that jump and that change.
LOADS: list[tuple[Any, ...]] = [
    TORQUE[0],
    ("load", 1, [0.5, 0.02, 1e-3], ([0.0, 0.01], [0.5, 1.0])),
    ("table", 1, [1.0, 3.0, 30.0], [0.5, 2.0, 3.0], ([0.005, 0.005], [0.0, 1.0])),
    ("harmonics", 0, 1, [2.0, 3.5], [3.0, 1.0], [0.0, 0.7], None),
]
DAMPED_LIGHTLY = {
    "belt": (1.2, 24, 0.1, 70e3, 0.02, 0.01, 0.0), "contact": (0.0, 2.5e7, 100.0, 0, 0.0),
}  # fmt: skip
#: Changes of the model, torque, t_end: a plain drive and what its record is refused by; lightly
#: damped, so that a twin runs from early on; a torque that jumps.
DRIVES: dict[str, tuple[dict[str, Any], Any, float]] = {
    "plain": ({}, TORQUE, 0.02),
    "drag": ({"drag": [(0.5, 0.02, 1e-3), None]}, TORQUE, 0.02),
    "other drag": ({"drag": [(0.6, 0.02, 1e-3), None]}, TORQUE, 0.02),
    "coupling": ({"couplings": [None, ("isolator", (0.01, 20.0, 0.02))]}, TORQUE, 0.02),
    "other coupling": ({"couplings": [None, ("isolator", (0.01, 20.0, 0.03))]}, TORQUE, 0.02),
    "joints": ({"mesh": "joint"}, TORQUE, 0.02),
    "compensated": ({"contact": (5e10, 2.5e7, 1e3, 1, 0.0)}, TORQUE, 0.02),
    "lightly damped": (DAMPED_LIGHTLY, TORQUE, 0.02),
    "relay": ({}, [("call", relay)], 0.006),
}


def fnv(data: bytes | bytearray) -> int:
    """FNV-1a, 64 bits."""
    total = 0xCBF29CE484222325
    for byte in data:
        total = (total ^ byte) * 0x100000001B3 % 2**64
    return total


def make(drive: str, state: dict[str, Any], options: dict[str, Any]) -> tuple[Any, Any]:
    changes, torque, t_end = DRIVES[drive]
    simulation = _core.Simulation(make_model(**changes), state, torque, t_end, **options)
    return simulation, simulation.sample(np.linspace(0.0, t_end, 33))


def end_of(simulation: Any) -> dict[str, Any]:
    assert simulation.advance(INF) is True
    said = pickle.dumps([simulation.warnings, simulation.stats, simulation.choice])
    return {**simulation.state(), "said": np.frombuffer(said, np.uint8)}


def go_on(drive: str, state: dict[str, Any], options: dict[str, Any], record: bytes) -> Any:
    """What the process that goes on does: the samples from there on, and the end."""
    simulation, samples = make(drive, state, options)
    simulation.import_record(record)
    first = simulation.samples
    return first, {name: rows[first:] for name, rows in samples.items()}, end_of(simulation)


@pytest.fixture(scope="module")
def plain(rest: dict[str, Any]) -> Callable[..., Any]:
    """A simulation of a drive with these options, from rest."""
    return lambda drive="plain", **options: make(drive, rest, options)[0]


def test_runs_go_on_in_another_process() -> None:
    """Stopped after 8, 16, 48, 144 ... steps (a chunk of the binding is eight at least)."""
    cases, ends = [], []
    for drive in ("lightly damped", "relay"):
        settling = _core.Simulation.settle(make_model(**DRIVES[drive][0]), tolerance=1e-5)
        assert settling.advance(INF) is True
        state = settling.state()
        for options in METHODS:
            simulation, expected = make(drive, state, options)
            end = end_of(simulation)
            stopped, samples = make(drive, state, options)
            records, pause, finished = [stopped.export_record()], 1, False  # not yet begun
            while not finished:
                for _ in range(pause):
                    finished = finished or stopped.advance(0.0)
                records.append(stopped.export_record())
                pause *= 3
            assert same_bits(samples, expected), (drive, options)
            assert len(records) >= 3
            cases += [(drive, state, options, record) for record in records]
            ends += [(expected, end)] * len(records)
    program = (
        "import pickle, sys\n"
        "sys.path.insert(0, '.')\n"  # which PYTHONSAFEPATH leaves out
        "import test_record\n"
        "cases = pickle.load(sys.stdin.buffer)\n"
        "pickle.dump([test_record.go_on(*case) for case in cases], sys.stdout.buffer)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=pickle.dumps(cases), stdout=subprocess.PIPE, check=True, cwd=Path(__file__).parent,
    )  # fmt: skip
    for case, (expected, end), found in zip(cases, ends, pickle.loads(done.stdout), strict=True):
        first, later, final = found
        same = same_bits(later, {name: rows[first:] for name, rows in expected.items()})
        assert same and same_bits(final, end), (case[0], case[2])


def test_records_of_equal_runs_are_equal(rest: dict[str, Any]) -> None:
    """To the last byte, gaps between numbers too: they hold no address, and nothing is unset."""
    for drive in ("lightly damped", "relay"):
        for method in ("auto", "lbdf2"):
            records = set()
            for _ in range(2):
                simulation, _ = make(drive, rest, {"method": method, "max_steps": 40})
                with pytest.raises(SimulationError, match="max_steps"):
                    simulation.advance(INF)
                records.add(simulation.export_record())
            assert len(records) == 1, (drive, method)


def test_what_a_record_is_refused_for(rest: dict[str, Any], plain: Callable[..., Any]) -> None:
    simulation = plain(method="rodas4")
    simulation.advance(0.0)
    record, fresh = simulation.export_record(), plain(method="rodas4")
    of_another_run = refused(
        ValueError, "the record is of another run: drive, torques, t_end and options must be those "
        "it was made with",
    )  # fmt: skip
    changes: list[dict[str, Any]] = [
        {"rtol": 1e-3}, {"method": "tsit5"}, {"ledger": False}, {"max_step": 1e-4}, {"step": 1e-6},
        {"guards": False}, {"drive": "drag"}, {"drive": "joints"}, {"drive": "compensated"},
    ]  # fmt: skip
    for change in changes:
        with of_another_run:
            plain(**{"method": "rodas4", **change}).import_record(record)
    coupled = rest | {name: np.zeros(1) for name in ("rim_angle", "rim_speed", "windup")}
    for part, state in (("drag", rest), ("coupling", coupled)):
        of_part = make(part, state, {})[0].export_record()
        with of_another_run:
            make(f"other {part}", state, {})[0].import_record(of_part)
    loaded = _core.Simulation(make_model(), rest, LOADS, 0.02).export_record()
    for at, place, value in [
        (1, 1, 0), (1, 2, [0.5, 0.02, 2e-3]), (1, 3, ([0.0, 0.01], [0.5, 0.9])),
        (2, 2, [1.0, 3.0, 31.0]), (2, 3, [0.5, 2.0, 3.1]), (3, 2, 0), (3, 4, [3.0, 1.1]),
        (3, 5, [0.0, 0.8]),
    ]:  # fmt: skip
        loads = [list(load) for load in LOADS]
        loads[at][place] = value
        other = _core.Simulation(make_model(), rest, [*map(tuple, loads)], 0.02)
        with of_another_run:
            other.import_record(loaded)
    for size in (0, 7, 40, len(record) - 1):
        with pytest.raises(ValueError, match=r"^(not a restart record|the record is damaged)"):
            fresh.import_record(record[:size])
    untouched, rng = pickle.dumps(fresh.state()), np.random.default_rng(3)
    for at in rng.integers(0, len(record), 200):
        damaged = bytearray(record)
        damaged[at] ^= 1 << int(rng.integers(8))
        with pytest.raises(ValueError, match="record"):
            fresh.import_record(damaged)
    with pytest.raises(TypeError):
        fresh.import_record("text")
    assert pickle.dumps(fresh.state()) == untouched
    fresh.import_record(record)
    with pytest.raises(RuntimeError, match="is taken by a simulation that has not begun, and not"):
        simulation.import_record(record)
    with pytest.raises(RuntimeError, match="settling has no restart record"):
        _core.Simulation.settle(make_model()).export_record()


def test_a_run_that_failed_has_no_record(rest: dict[str, Any]) -> None:
    """It may have failed in the middle of a step."""

    def failing(t: float, _theta: Any, _omega: Any) -> list[float]:
        return [0.0 / (t <= 0.002), 0.0]

    failed = _core.Simulation(make_model(), rest, [("call", failing)], 0.02)
    with pytest.raises(ZeroDivisionError):
        failed.advance(INF)
    with pytest.raises(RuntimeError, match="has no restart record"):
        failed.export_record()


def test_what_is_used_as_an_index_is_checked(plain: Callable[..., Any]) -> None:
    """Of records whose check sum was made anew: refused or run, and never out of bounds."""
    simulation = plain()
    simulation.advance(0.0)
    record = simulation.export_record()
    head, content = record[:40], bytearray(record[40:])
    assert len(head) == 40 and fnv(content) == int.from_bytes(head[32:40], sys.byteorder)
    refused_some = 0
    for at in range(0, 16, 4):
        damaged = bytearray(content)
        damaged[at : at + 4] = (77).to_bytes(4, sys.byteorder)
        forged = head[:32] + fnv(damaged).to_bytes(8, sys.byteorder) + damaged
        try:
            plain().import_record(forged)
        except ValueError as error:
            assert "index is out of range" in str(error)
            refused_some += 1
    assert refused_some >= 2  # the methods


def test_kernels_of_another_level_are_refused(
    plain: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BELTDYN_KERNELS", "baseline")
    record = plain().export_record()
    monkeypatch.delenv("BELTDYN_KERNELS")
    if _core.kernel_level() == "baseline":
        plain().import_record(record)  # the same: nothing else is there
    else:
        with pytest.raises(ValueError, match="made with another instruction level"):
            plain().import_record(record)
