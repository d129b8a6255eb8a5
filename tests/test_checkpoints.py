"""A run that is written as it goes survives everything that can end a process, and goes on from its
file to the result of a run that was not stopped, bit for bit; what the file cannot give is said.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import multiprocessing
import os
import pickle
import random
import signal
import sqlite3
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pytest
from drives import on_mesh, plain, plain_scene, with_belt
from module_common import refused

import beltdyn as bd
from beltdyn import _core
from beltdyn.base import sqlite
from beltdyn.outputs.histories import GROUPS
from beltdyn.run import checkpoints, start_of_run

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

#: Every method, adaptive and, where it may be, with a fixed step; and how long a run of about half
#: a second is then [s].
METHODS: dict[str, tuple[dict[str, Any], float]] = {
    "auto": ({}, 0.5),
    "tsit5": ({"method": "tsit5"}, 0.3),
    "rodas4": ({"method": "rodas4"}, 0.7),
    "lbdf2": ({"method": "lbdf2", "rtol": 1e-2}, 1.0),
    "lie": ({"method": "lie", "rtol": 1e-2}, 0.3),
    "rk4": ({"method": "rk4"}, 0.2),
    "rk4 fixed": ({"method": "rk4", "step": 2e-6}, 0.05),
    "lbdf2 fixed": ({"method": "lbdf2", "step": 1e-4}, 0.8),
    "lie fixed": ({"method": "lie", "step": 5e-5}, 0.4),
}


def same(one: bd.Result, other: bd.Result) -> bool:
    """The same bits in all that a result has, but the times it took."""

    def parts(result: bd.Result) -> list[Any]:
        final = result.final_state
        arrays = {name: getattr(final, name) for name, *_ in _core.STATE_FIELDS}
        arrays |= {"end": final.t, "times": result.t, "of spans": result._sampled_spans}
        for group in GROUPS:
            if held := getattr(result, group):
                arrays |= {f"{group}.{name}": array for name, array in held.arrays().items()}
        times = dict.fromkeys(("cpu_time", "wall_time", "settle_time"), 0.0)
        fields = "params status success message warnings effects outputs unchecked accuracy".split()  # noqa: SIM905
        return [
            {name: pickle.dumps(array) for name, array in arrays.items()},
            attrs.evolve(result.stats, **times),
            *(getattr(result, name) for name in fields),
        ]

    return parts(one) == parts(other)


def small(t_end: float = 0.02, mesh: str = "paper", **changes: Any) -> bd.Scene:
    """Twenty-four links: a run of some milliseconds."""
    params = on_mesh(plain(), mesh)
    params = attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=24), **changes)
    ramp = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-50.0, 0.0]])
    return bd.Scene(params, ramp + bd.Viscous([0.0, 16.0]), t_end)


def flowing() -> bd.Scene:
    """An ALE belt, whose friction follows from what pressed at the ends of wraps before."""
    params = with_belt(bd.scenes.get("unequal-pulleys").params, mesh="ale")
    pulse = bd.PiecewiseLinear([0.0, 0.5, 1.0], [[0.0, 0.0], [-20.0, 0.0], [0.0, 0.0]])
    return bd.Scene(params, pulse + bd.Viscous([0.0, 0.1]), 4.0)


def often(path: Path) -> bd.Checkpoint:
    return bd.Checkpoint(path, every=0.0)


def opened(path: Path, write: bool = False) -> contextlib.closing[sqlite3.Connection]:
    return contextlib.closing(sqlite.opened(path, checkpoints._TABLES, write=write))


def parts(path: Path, kind: str = "%") -> list[tuple[str, bytes]]:
    """What is in a file, in its order."""
    with opened(path) as db:
        query = "SELECT kind, content FROM parts WHERE kind LIKE ? ORDER BY id"
        return list(db.execute(query, (kind,)))


def last_record(path: Path) -> Any:
    """What stands before the restart record: its time is the second, those spent follow."""
    return checkpoints._BEFORE.unpack_from(parts(path, "rest")[0][1])


@pytest.fixture
def writes(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """What is in the file of a run after it is made, and after each write."""
    found: list[bytes] = []

    def noting(method: Any) -> Any:
        def call(self: Any, *given: Any) -> Any:
            done = method(self, *given)
            if not isinstance(self, checkpoints.Continued):
                found.append(Path(self.path).read_bytes())
            return done

        return call

    for kind, name in ((checkpoints.Fresh, "begin"), (checkpoints.Recorder, "_write")):
        monkeypatch.setattr(kind, name, noting(getattr(kind, name)))
    return found


@pytest.fixture
def short_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A restart record in memory every few milliseconds."""
    monkeypatch.setattr("beltdyn.run.run.CHUNK", 0.0)


def goes_on(path: Path, expected: bd.Result, contents: list[bytes]) -> None:
    """From the file with each of these contents the run goes on; only the copy is written."""
    copy = path.with_name("copy")
    for content in contents:
        copy.write_bytes(content)
        assert same(bd.resume(copy), expected)
    assert same(bd.resume(copy), expected)  # it is written to its end now


def some(writes: list[bytes], seed: int) -> list[bytes]:
    """What was there after some write, and before the first."""
    return [random.Random(seed).choice(writes[1:-1] or writes), writes[0]]


@pytest.mark.parametrize("name", METHODS)
def test_every_method_goes_on_from_anywhere(name: str, tmp_path: Path, writes: list[bytes]) -> None:
    # with a short fixed step there are many steps, and so records, in a short time
    t_end = 0.01 if "fixed" in name else 0.04
    scene, path = small(t_end), tmp_path / "run"
    options: dict[str, Any] = {**METHODS[name][0], "t_eval": np.linspace(0.0, t_end, 57)}
    expected = bd.simulate(*scene[:3], **options)
    assert same(bd.simulate(*scene[:3], checkpoint=often(path), **options), expected)
    assert len(writes) >= 3
    goes_on(path, expected, some(writes, 1))


MAXWELL = bd.MaxwellSlip(mu=(0.3, 0.3), stiffness=(1e8, 2e7), damping=(1e3, 1e3))
LOAD = bd.Viscous([0.0, 1.0])
CRANK = bd.CrankMotion(bd.PiecewiseLinear([0.0], [-20.0]), orders=[2.0], amplitudes=[0.05])
STEP = bd.PiecewiseLinear([0.0, 0.01], [0.0, -3.0])
EXPECTED = bd.accuracy.Expected(quantity="tension", space=1e-3, time=2e-3)
STEPS = {"step": 1e-7, "max_steps": 10**6, "torque_interval": 1e-4}
TWICE = [0.0, 0.0, 0.013, 0.013, 0.02]
CALLS: dict[str, tuple[Callable[[], bd.Scene], dict[str, Any]]] = {
    "no ledger, steps": (small, {"ledger": False, **STEPS}),
    "string": (lambda: small(mesh="string"), {}),
    "errors expected": (small, {"expected": EXPECTED}),
    "outputs": (small, {"outputs": ("span_tension", "pulleys.omega", "contact.pulley")}),
    "outputs with the ledger": (small, {"outputs": ("energy", "joints.force")}),
    "samples twice, and late": (small, {"t_eval": TWICE, "breakpoints": [7e-3, 3e-3]}),
    "no outputs, no samples": (small, {"outputs": (), "t_eval": [], "max_step": 1e-4}),
    "friction with states": (lambda: small(friction=MAXWELL), {}),
    "an arm": (lambda: bd.scenes.get("tensioned-alternator")._replace(t_end=0.001), {}),
    "motion": (lambda: small()._replace(motion={0: STEP}, torque_fn=LOAD), {}),
    "motion with harmonics": (lambda: small()._replace(motion={0: CRANK}, torque_fn=LOAD), {}),
}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", CALLS)
def test_whatever_it_is_called_with_is_in_the_file(
    name: str, tmp_path: Path, writes: list[bytes]
) -> None:
    make, options = CALLS[name]
    scene, path = make(), tmp_path / "run"
    expected = bd.simulate(*scene, **options)
    bd.simulate(*scene, checkpoint=often(path), **options)
    goes_on(path, expected, some(writes, 2))


def test_it_begins_from_any_state_and_writes_samples_in_several_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writes: list[bytes]
) -> None:
    """Also from one at a time before 0, of a run that ends before 0."""
    monkeypatch.setattr(checkpoints, "_MOST_ROWS", 50_000)
    scene, path = small()[:2], tmp_path / "run"
    first = attrs.evolve(bd.simulate(*scene, 0.01, t_eval=[]).final_state, t=-0.05)
    expected = bd.simulate(*scene, -0.03, initial=first)
    bd.simulate(*scene, -0.03, initial=first, checkpoint=path)
    rows = parts(path, "rows")
    assert len(rows) > 10 and max(len(content) for _, content in rows) <= 50_000
    goes_on(path, expected, writes)


def driven(t: float, _theta: Any, omega: Any) -> list[float]:
    """A torque function with a jump that nobody names."""
    return [-60.0 if 0.104 < t < 0.106 else -30.0 * min(t, 0.2) / 0.2, -16.0 * float(omega[1])]


def child(name: str, path: Path, out: Path) -> bd.Result:
    """Begin the run or go on with it; without a file for it, only compute it."""
    warnings.simplefilter("ignore")
    options, t_end = METHODS.get(name, ({}, 0.15))
    torque = driven if name == "function" else None
    if path.exists():
        result = bd.resume(path, torque, every=0.0)
    else:
        scene = flowing() if name == "ale" else plain_scene()
        t_end = scene.t_end if name == "ale" else t_end
        options = {"checkpoint": often(path), **options} if out.name else options
        result = bd.simulate(scene.params, torque or scene.torque_fn, t_end, **options)
    if out.name:
        result.save(out)
    return result


@pytest.mark.ci(guard="test_checkpoints.py::test_every_method_goes_on_from_anywhere")
@pytest.mark.parametrize("name", [*METHODS, "function", "ale"])
def test_a_run_survives_kills(name: str, tmp_path: Path) -> None:
    """Four times, soon after it has written something; where it has finished before, it begins
    anew.
    """
    rng, path, out = random.Random(sum(map(ord, name))), tmp_path / "run", tmp_path / "out.npz"
    expected = child(name, path, Path())
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["beltdyn", "pytest"])
    kills = 0
    while not out.exists():
        process = processes.Process(target=child, args=(name, path, out))
        before = path.stat().st_size if path.exists() else 0
        process.start()
        if kills < 4:
            while process.is_alive() and (path.stat().st_size if path.exists() else 0) == before:
                time.sleep(1e-3)
            time.sleep(rng.uniform(0.0, 0.03))
            process.kill()
        process.join()
        if process.exitcode == 0 and kills < 4:
            out.unlink()
            path.unlink()
        else:
            assert process.exitcode == (0 if kills == 4 else -signal.SIGKILL)
            kills += 1
    assert same(bd.Result.load(out), expected)
    # what is left beside it are at most the beginnings of files whose process was killed then
    others = [other.name for other in tmp_path.iterdir() if other not in (path, out)]
    assert all(other.startswith((".run-", ".out.npz-")) for other in others)


def stops(error: BaseException, after: float) -> Callable[..., list[float]]:
    """A torque function that raises after a time, once."""
    errors = [error]

    def torque(t: float, _theta: Any, omega: Any) -> list[float]:
        if errors and t > after:
            raise errors.pop()
        return [-50.0 * t / 0.02, -16.0 * float(omega[1])]

    return torque


@pytest.mark.usefixtures("short_chunks")
@pytest.mark.parametrize("error", [ZeroDivisionError("mine"), KeyboardInterrupt()])
def test_a_torque_function_that_raises_loses_little(error: BaseException, tmp_path: Path) -> None:
    """It fails in the middle of a step, so the last chunk is lost, and no more."""
    params, path, torque = small().params, tmp_path / "run", stops(error, 0.015)
    kind = bd.Interrupted if isinstance(error, KeyboardInterrupt) else ZeroDivisionError
    with pytest.raises(kind) as caught:
        bd.simulate(params, torque, 0.02, checkpoint=path)
    assert f"go on with beltdyn.resume({str(path)!r})" in caught.value.__notes__
    assert 0.005 < last_record(path)[1] < 0.015
    assert same(bd.resume(path, torque), bd.simulate(params, torque, 0.02))


@pytest.mark.usefixtures("short_chunks")
def test_a_compiled_function_that_raises_spoils_nothing(tmp_path: Path) -> None:
    """The core gets a torque that nobody gave, and does not know: that step is not written."""
    fails = [True]

    @ctypes.CFUNCTYPE(
        None, ctypes.c_double, *[ctypes.POINTER(ctypes.c_double)] * 3, ctypes.c_void_p
    )
    def torque(t: float, _theta: Any, omega: Any, out: Any, _user: Any) -> None:
        out[0], out[1] = 1e4, 0.0
        if fails[0] and t > 0.012:
            fails[0] = False
            raise ZeroDivisionError("mine")
        out[0], out[1] = -50.0 * t / 0.02, -16.0 * omega[1]

    scene, path = small(), tmp_path / "run"
    with pytest.raises(ZeroDivisionError):
        bd.simulate(scene.params, torque, 0.02, checkpoint=path)
    assert last_record(path)[1] < 0.012
    assert same(bd.resume(path, torque), bd.simulate(scene.params, torque, 0.02))


def test_stopped_between_steps_nothing_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short_chunks: None
) -> None:
    scene, path, looks = small(), tmp_path / "run", itertools.count()
    real: Any = checkpoints.Recorder.look

    def look(self: Any, sim: Any) -> None:
        real(self, sim)
        if next(looks) == 3:
            sim.stop()

    monkeypatch.setattr(checkpoints.Recorder, "look", look)
    with pytest.raises(bd.Interrupted) as caught:
        bd.simulate(*scene[:3], checkpoint=path)
    assert last_record(path)[1] == caught.value.result.final_state.t > 0.0
    assert same(bd.resume(path), bd.simulate(*scene[:3]))


def test_a_limit_of_steps_can_be_raised_and_times_add_up(tmp_path: Path) -> None:
    scene, path = small(), tmp_path / "run"
    limited = pytest.raises(bd.SimulationError, match="limit of 200 steps")
    with limited:
        bd.simulate(*scene[:3], method="tsit5", max_steps=200, checkpoint=path)
    with limited:
        bd.resume(path)
    start = start_of_run.unpack(parts(path, "head")[0][1])[0]
    expected, before = bd.simulate(*scene[:3], method="tsit5"), last_record(path)[1:4]
    for _ in range(2):  # the second time it has finished
        result = bd.resume(path, max_steps=10**6)
        stats, later = result.stats, last_record(path)[1:4]
        assert same(result, expected)
        assert stats.cpu_time > before[1] > 0.0 and stats.wall_time > before[2] > 0.0
        assert stats.settle_time == start.settle_time > 0.0
        assert later >= before and before[0] > 0.0
        before = later


def test_a_run_that_fails_fails_again(tmp_path: Path) -> None:
    scene, path = plain_scene(), tmp_path / "run"
    options: dict[str, Any] = {"method": "rk4", "step": 1e-5}
    failures: list[bd.SimulationError] = []
    for run in (
        lambda: bd.simulate(*scene, **options),
        lambda: bd.simulate(*scene, checkpoint=often(path), **options),
        lambda: bd.resume(path),
    ):
        with pytest.raises(bd.SimulationError) as caught:
            run()
        failures.append(caught.value)
        assert str(failures[-1]) == str(failures[0])
        assert same(failures[-1].result, failures[0].result)


@pytest.mark.usefixtures("short_chunks")
@pytest.mark.parametrize("again", [False, True])
def test_a_full_disk_does_not_end_the_run(
    again: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was written stays; with ``again`` there is room for the last write."""
    scene, path = small(), tmp_path / "run"
    expected = bd.simulate(*scene[:3])
    begin, write = checkpoints.Fresh.begin, checkpoints.Recorder._write

    def room(recorder: checkpoints.Recorder, pages: int) -> None:
        assert recorder._db is not None
        recorder._db.execute(f"PRAGMA max_page_count = {pages}")

    def begun(self: Any, *given: Any) -> Any:
        spent = begin(self, *given)
        room(self, 50)
        return spent

    def written(self: Any) -> None:
        if again and len(self._failures) == 2:
            room(self, 10**6)
        write(self)

    monkeypatch.setattr(checkpoints.Fresh, "begin", begun)
    monkeypatch.setattr(checkpoints.Recorder, "_write", written)
    with pytest.warns(bd.BeltdynWarning, match=r"^checkpoint: .*No space left on device"):
        result = bd.simulate(*scene[:3], checkpoint=often(path))
    *others, warning = result.warnings
    assert warning.code == "checkpoint" and str(path) in warning.text
    assert same(attrs.evolve(result, warnings=tuple(others)), expected)
    assert f"holds the run up to t = {last_record(path)[1]:.6g} s" in warning.text
    assert (last_record(path)[1] == 0.02) is again
    monkeypatch.undo()
    assert same(bd.resume(path), expected)


@pytest.mark.usefixtures("short_chunks")
@pytest.mark.parametrize("what", ["was removed", "put in its place", "cut it short"])
def test_a_file_that_is_lost_while_the_run_goes_on_is_named(what: str, tmp_path: Path) -> None:
    """The run ends as without it; nothing says that it can be gone on with."""
    scene, path = small(), tmp_path / "run"
    done: list[float] = []

    def losing(t: float, theta: Any, omega: Any) -> Any:
        if t > 0.01 and not done:
            done.append(t)
            kept = path.read_bytes()
            if what == "cut it short":
                os.truncate(path, len(kept) // 2)
            else:
                path.unlink()
            if what == "put in its place":
                path.write_bytes(kept)
        return torque(t, theta, omega)

    def torque(t: float, theta: Any, omega: Any) -> Any:
        return scene.torque_fn(t, theta, omega)  # type: ignore[operator]

    expected = bd.simulate(scene.params, torque, scene.t_end)
    said = rf"^checkpoint: the checkpoint {path} could not be written at t = .* s \(.*{what}\); "
    with pytest.warns(bd.BeltdynWarning, match=said):
        result = bd.simulate(scene.params, losing, scene.t_end, checkpoint=often(path))
    *others, warning = result.warnings
    assert warning.text.endswith("; the run went on, and the file cannot be gone on with")
    assert same(attrs.evolve(result, warnings=tuple(others)), expected)


@pytest.fixture
def half(tmp_path: Path, writes: list[bytes]) -> Path:
    """The file of half a run of :func:`small`."""
    path = tmp_path / "half"
    bd.simulate(*small()[:3], checkpoint=often(path))
    path.write_bytes(writes[len(writes) // 2])
    return path


def test_a_write_that_was_cut_off_is_taken_back(half: Path) -> None:
    """By the journal that a killed process leaves beside the file."""
    before, expected = half.read_bytes(), bd.simulate(*small()[:3])
    torn, journal = half.with_name("torn"), half.with_name("torn-journal")
    with opened(half, write=True) as db, pytest.raises(KeyboardInterrupt):
        db.execute("PRAGMA cache_size = 1")  # more than that is written before it is complete
        with sqlite.written(db, half):
            db.execute("UPDATE parts SET content = zeroblob(length(content) + 9000)")
            torn.write_bytes(half.read_bytes())
            journal.write_bytes(half.with_name("half-journal").read_bytes())
            raise KeyboardInterrupt
    assert half.read_bytes() == before != torn.read_bytes()
    assert same(bd.resume(torn, checkpoint=False), expected)
    assert torn.read_bytes() == before and not journal.exists()


def test_damage_is_seen(half: Path) -> None:
    """With a bit flipped or its end cut off it goes on as it was, or not at all."""
    whole, expected = half.read_bytes(), bd.simulate(*small()[:3])
    copy, rng, refusals = half.with_name("copy"), random.Random(1), 0
    flips = [(rng.randrange(len(whole)), 1 << rng.randrange(8)) for _ in range(40)]
    cuts = [(rng.randrange(1, len(whole)), 0) for _ in range(5)]
    for at, bit in flips + cuts:
        damaged = bytearray(whole if bit else whole[:at])
        if bit:
            damaged[at] ^= bit
        copy.write_bytes(damaged)
        try:
            assert same(bd.resume(copy, checkpoint=False), expected)
        except ValueError as error:
            assert str(error).startswith(f"cannot go on from {copy}: ")
            refusals += 1
    assert refusals > 30


def test_half_a_run_goes_on_as_it_was_or_not_at_all(
    half: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its torques, in its version, on its instruction level; and it is not written over."""
    before, expected = half.read_bytes(), bd.simulate(*small()[:3])
    with refused(
        ValueError,
        f"checkpoint: there is a file {half} already: go on with the run in it (beltdyn resume "
        f"{half}, or beltdyn.resume in Python), remove it, or choose another name",
    ):
        bd.simulate(*small()[:3], checkpoint=half)
    damaged = half.with_name("damaged")
    damaged.write_bytes(before)
    with opened(damaged, write=True) as db:
        db.execute("UPDATE parts SET content = zeroblob(length(content)) WHERE kind = 'rows'")
        db.execute("COMMIT")
    with refused(
        ValueError,
        f"checkpoint: there is a file {damaged} already; it is damaged: a checksum does not fit: "
        "remove it, or choose another name",
    ):
        bd.simulate(*small()[:3], checkpoint=damaged)
    motion = {0: bd.PiecewiseLinear([0.0], [0.0])}
    for given in ((bd.Viscous([0.0, 17.0]),), (None, motion), (driven,)):
        with pytest.raises(ValueError, match=r"cannot go on from .* the record is of another run"):
            bd.resume(half, *given)
    with monkeypatch.context() as patch:
        patch.setattr(_core, "__version__", "99.0")
        with refused(
            ValueError,
            f"cannot go on from {half}: it was written by beltdyn {bd.__version__}, and this is "
            "99.0: a run goes on in the version that began it",
        ):
            bd.resume(half)
    if (level := _core.kernel_level()) != "baseline":
        with monkeypatch.context() as patch:
            patch.setenv("BELTDYN_KERNELS", "baseline")
            with pytest.raises(ValueError, match=f"variable BELTDYN_KERNELS={level}"):
                bd.resume(half)
    with opened(half, write=True):
        with pytest.raises(BlockingIOError, match="another run is writing to it"):
            bd.resume(half)
        assert bd.resume(half, checkpoint=False).success
    half.chmod(0o400)
    assert same(bd.resume(half, checkpoint=False), expected)
    if os.geteuid() != 0:
        with pytest.raises(PermissionError):
            bd.resume(half)
    half.chmod(0o600)
    assert half.read_bytes() == before
    assert same(bd.resume(half, small().torque_fn), expected)


def test_what_cannot_be_a_checkpoint(tmp_path: Path) -> None:
    path, run = tmp_path / "run", lambda **options: bd.simulate(*small()[:3], **options)
    cases: list[tuple[Callable[[], object], type[Exception], str]] = [
        (lambda: run(checkpoint=path, verify=True), ValueError, "checkpoint is of one run"),
        (lambda: run(checkpoint=path, budget=5.0), ValueError, "checkpoint is of one run"),
        (lambda: run(checkpoint=True), TypeError, "checkpoint must be a path"),
        (lambda: run(checkpoint=tmp_path / "none" / "run"), FileNotFoundError, "No such file"),
        (lambda: bd.Checkpoint("run", every=-1.0), ValueError,
         r"Checkpoint.every must be >= 0 s, got -1 s"),
        (lambda: bd.Checkpoint(3), TypeError, r"Checkpoint\.path"),  # type: ignore[arg-type]
        (lambda: bd.Checkpoint(""), ValueError, r"Checkpoint\.path"),
        # what is wrong otherwise is found before there is a file
        (lambda: run(checkpoint=path, rtol=-1.0), ValueError, "rtol"),
    ]  # fmt: skip
    for call, kind, words in cases:
        with pytest.raises(kind, match=words):
            call()
    assert list(tmp_path.iterdir()) == []


def test_functions_must_be_given_again(tmp_path: Path, writes: list[bytes]) -> None:
    scene, path = small(), tmp_path / "run"

    def speed(t: float) -> float:
        return -100.0 * t

    torque = stops(ValueError(), np.inf)
    expected = bd.simulate(scene.params, torque, 0.005, {0: speed})
    bd.simulate(scene.params, torque, 0.005, {0: speed}, checkpoint=often(path))
    path.write_bytes(writes[2])
    for given, missing in (({}, "torque_fn"), ({"torque_fn": torque}, "motion")):
        with refused(
            ValueError,
            f"the run in {path} had a function as {missing}, which a file cannot hold: give the "
            f"same one again, in Python, beltdyn.resume({str(path)!r}, {missing}=...)",
        ):
            bd.resume(path, **given)  # type: ignore[arg-type]
    assert same(bd.resume(path, torque, {0: speed}), expected)


def test_forged_files_are_refused_by_name(half: Path) -> None:
    """Whoever makes one makes its check sums as well."""

    def option(old: str, new: str) -> Callable[[bytes], bytes]:
        def change(content: bytes) -> bytes:
            assert old.encode() in content
            return content.replace(old.encode(), new.encode())

        return change

    cases: list[tuple[str, Callable[[bytes], bytes], str]] = [
        ("head", lambda content: b"{" + content[100:], "^cannot go on from "),
        ("head", lambda content: content[:-30], "^cannot go on from "),
        ("rows", lambda content: content[:-8], "^cannot go on from .*samples"),
        ("rows", lambda content: content + content, "^cannot go on from .*samples"),
        ("rows", lambda content: b"", "^cannot go on from .*samples are missing"),
        ("rest", lambda content: content[:20], "^cannot go on from .*too short"),
        ("rest", lambda content: b"\xff" * 8 + content[8:], "do not fit together"),
        ("rest", lambda content: content[:-1], "^cannot go on from .*record is damaged"),
        ("head", option('"method": "auto"', '"method": "otto"'), "method"),
        ("head", option('"ledger": true', '"ledger": 1234'), "ledger must be true or false"),
        ("head", option('"rtol": 0.0001', '"rtol": 1e9999'), "rtol"),
        ("head", option('"t_end": 0.02', '"t_end": -5.0'), "t_end"),
        ("head", option('"every": 0.0', '"every": -1.0'), "every"),
        ("head", option('"settle_time"', '"settle_tima"'), "holds .settle_tima., which does not"),
        ("head", option('"expected": null', '"expected": ["creep"]'), "expected is of another"),
        ("head", option('"outputs": null', '"outputs": ["x"]'), "outputs"),
        (
            "head",
            option('"t_eval": {"shape": [', '"t_eval": {"shape": [2, '),
            "bytes, which are not those of",
        ),
        ("head", option('"float64": "', '"float64": "%'), "^cannot go on from "),
        ("head", option('"shape"', '"form"'), "holds 'form', which does not belong there"),
    ]
    forged = half.with_name("forged")
    for of, change, words in cases:
        forged.unlink(missing_ok=True)
        with sqlite.created(forged, checkpoints._TABLES) as db:
            for kind, held in parts(half):
                checkpoints._add(db, kind, -1, change(held) if kind == of else held)
        with pytest.raises((ValueError, TypeError), match=words) as caught:
            bd.resume(forged)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 800


def test_other_files_are_refused(tmp_path: Path, half: Path) -> None:
    path = tmp_path / "file"
    bd.simulate(*small()[:3], t_eval=[]).save(path)
    for content in (b"", b"text", path.read_bytes(), half.read_bytes()[1:]):
        path.write_bytes(content)
        with refused(
            ValueError,
            f"cannot go on from {path}: it is no checkpoint of a run, or one of another version: "
            "it begins otherwise",
        ):
            bd.resume(path)
        assert path.read_bytes() == content  # left as it is
    for wrong in (tmp_path, tmp_path / "none"):
        with pytest.raises(OSError, match=f"{wrong}"):
            bd.resume(wrong)
    for given in ((3, {}), (half, {"progress": 3}), (half, {"checkpoint": 3})):
        with pytest.raises(TypeError):
            bd.resume(given[0], **given[1])  # type: ignore[arg-type]
