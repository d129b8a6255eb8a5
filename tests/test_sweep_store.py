"""The store of a sweep: a client killed and begun again computes only what is missing and gives the
same Dataset; extended sweeps find what is there; parts hold every run once, and any text.
"""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pytest
import sweep_runs
import xarray
from sweep_runs import MEASURE, TIMES, do, plain, same, under_function

import beltdyn as bd
from beltdyn.base import sqlite
from beltdyn.many import content, store
from beltdyn.many.collect import of_kept, to_kept
from beltdyn.many.outcome import Outcome
from beltdyn.many.store import Kept, Store
from beltdyn.sweeping import SweepInterrupted
from beltdyn.sweeping.outcomes import Axis, Layout, Quantity, as_layout

N = 60


GUARD = "test_sweep_store.py::test_what_an_interrupted_sweep_leaves_is_gone_on_with"
linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")


OVER = {"torque.scale": [k / N for k in range(N)], "friction.mu_k": [0.5, 1.0]}

#: A sweep in a process of its own, which writes a part whenever it can and after two of them goes
#: on slowly, so that signals reach it on its way. Arguments: folder, executor.
SCRIPT = (
    sweep_runs.PATH
    + """
import signal
import sweep_runs, test_sweep_store as of
from beltdyn.sweeping import SweepInterrupted
sweep_runs.go_on_slowly(sys.argv[1], 2)
def go(executor):
    try:
        of.sweep(sys.argv[1], executor)
    except SweepInterrupted as error:
        status = error.dataset.status
        print("interrupted", *(int((status == one).sum()) for one in ("finished", "missing")))
signal.signal(signal.SIGINT, signal.default_int_handler)
print("begun", flush=True)
if sys.argv[2] == "dask":
    with sweep_runs.cluster() as client:
        go(client)
else:
    go(sys.argv[2])
"""
)


def sweep(folder: Any, executor: str, over: Any = OVER, scene: Any = None) -> Any:
    given: Any = {"executor": executor, "store": folder, "t_eval": TIMES}
    return do(scene or plain(), over, MEASURE, **given)


@pytest.fixture(scope="module")
def expected() -> Any:
    return sweep(None, "threads").dataset


def keys(folder: Path) -> list[str]:
    """All keys in the parts, which must be complete; not those that were being written."""
    found: list[str] = []
    for part in folder.glob("part-*.sqlite"):
        with closing(sqlite.opened(part, store._TABLES)) as db:
            found += [key for (key,) in db.execute("SELECT key FROM runs")]
    return found


def check_resumed(folder: Path, expected: Any) -> None:
    """Go on with a sweep that was ended: what was kept is not repeated, and nothing is missing."""
    before = keys(folder)
    assert 0 < len(before) == len(set(before)) < 2 * N
    swept = sweep(folder, "threads")
    assert (swept.stored, swept.computed) == (len(before), 2 * N - len(before))
    same(swept.dataset, expected)
    after = keys(folder)
    assert len(after) == len(set(after)) == 2 * N and set(before) <= set(after)
    again = sweep(folder, "threads")
    assert (again.stored, again.computed, again.workers) == (2 * N, 0, "none")
    same(again.dataset, expected)


def test_what_an_interrupted_sweep_leaves_is_gone_on_with(
    tmp_path: Path, expected: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By Ctrl-C after some parts; beside them one of which a kill let only the half be written."""

    def tend(self: Any) -> None:
        self.flush()
        if len(list(tmp_path.glob("part-*.sqlite"))) == 2:
            (whole, *_) = tmp_path.glob("part-*.sqlite")
            (tmp_path / f".{whole.name}.half").write_bytes(whole.read_bytes()[:1000])
            raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(SweepInterrupted) as caught:
        patch.setattr(Store, "tend", tend)
        sweep(tmp_path, "threads")
    status = list(caught.value.dataset["status"].values.ravel())
    assert status.count("finished") == len(keys(tmp_path))
    assert status.count("finished") + status.count("missing") == 2 * N
    check_resumed(tmp_path, expected)


def start(folder: Path, executor: str) -> subprocess.Popen[str]:
    """Start a sweep in another process, and wait until it has written two parts."""
    command = [sys.executable, "-c", SCRIPT, str(folder), executor]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout and process.stdout.readline() == "begun\n", process.communicate()
    while process.poll() is None and len(list(folder.glob("part-*.sqlite"))) < 2:
        time.sleep(0.01)
    return process


def children(process: int) -> list[int]:
    """Return the processes that one has started, and theirs."""
    found: list[int] = []
    for child in Path(f"/proc/{process}/task").glob("*/children"):
        for one in map(int, child.read_text().split()):
            found += [one, *children(one)]
    return found


def ended(processes: list[int]) -> bool:
    """Wait until all have ended, if only to be asked how."""
    for _ in range(1200):
        left = [Path(f"/proc/{one}/stat") for one in processes]
        if not any(one.exists() and ") Z" not in one.read_text() for one in left):
            return True
        time.sleep(0.05)
    return False


@linux
@pytest.mark.parametrize(
    "executor",
    [
        pytest.param("processes", marks=pytest.mark.ci(guard=GUARD)),
        pytest.param("dask", marks=pytest.mark.extended(guard=GUARD)),
    ],
)
def test_ctrl_c_and_a_kill(executor: str, tmp_path: Path, expected: Any) -> None:
    """What is done is given and kept; no process stays behind, nor if the client is killed."""
    process = start(tmp_path, executor)
    workers = children(process.pid)
    os.kill(process.pid, signal.SIGINT)
    said, errors = process.communicate(timeout=120)
    assert said.startswith("interrupted"), errors
    _, done, missing = said.splitlines()[0].split()
    assert int(done) == len(keys(tmp_path)) and int(done) + int(missing) == 2 * N
    assert workers and ended(workers)
    check_resumed(tmp_path, expected)
    if executor == "processes":
        process = start(tmp_path / "other", executor)
        workers = children(process.pid)
        process.kill()
        process.communicate()
        assert workers and ended(workers)
        check_resumed(tmp_path / "other", expected)


def test_what_an_extended_sweep_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    both = {"torque.scale": [0.5, 1.0]}

    def counts(scene: Any = None, over: Any = both, measure: Any = MEASURE, **more: Any) -> Any:
        """Return how many runs were found and how many computed."""
        given: Any = {"t_eval": TIMES, **more}
        swept = do(scene or plain(), over, measure, store=tmp_path, **given)
        assert swept.counts == {"finished": swept.stored + swept.computed}
        return swept.stored, swept.computed

    assert (counts(), counts()) == ((0, 2), (2, 0))
    assert counts(progress=True) == (2, 0)
    assert "sweep: 2 of 2 runs found in the store" in capsys.readouterr().err
    # more values of one name, in another order
    assert counts(over={"torque.scale": [1.0, 0.75, 0.5]}) == (2, 1)
    # one more name, of which one value is that of the scene: of the drive, of the options
    mu_k = plain().params.friction.mu_k  # type: ignore[union-attr]
    assert counts(over={"friction.mu_k": [mu_k, 0.5], **both}) == (2, 2)
    assert counts(over={"torque.scale": [0.5], "rtol": [1e-4, 1e-3]}) == (1, 1)
    # sampled and listed, zipped
    assert counts(over=[{"friction.mu_k": 0.5, "torque.scale": 1.0}]) == (1, 0)
    # the factor 1 is the scene itself
    assert counts(over={"friction.mu_k": [mu_k]}) == (1, 0)
    # what makes a difference: of Python torques what they do
    functions = [counts(under_function(gain)) for gain in (40.0, 40.0, 41.0)]
    assert functions == [(0, 2), (2, 0), (0, 2)]
    assert counts(t_eval=[1e-3, 1.5e-3]) == (0, 2)
    assert counts(t_eval=np.array(TIMES)) == (2, 0)
    assert counts(measure=["stats.steps"]) == (0, 2)
    assert counts(last=0.3) == (0, 2)
    assert counts(key="of mine") == (0, 2)
    assert counts(scene=plain(1.9e-3), t_eval=[1e-3, 1.9e-3]) == (0, 2)
    # chains go on where they were
    assert counts(warm="torque.scale") == (0, 2)
    longer: Any = {"over": {"torque.scale": [0.5, 1.0, 1.5]}, "warm": "torque.scale"}
    assert counts(**longer) == (2, 1)
    here, anew = (
        do(plain(), measure=MEASURE, store=store, t_eval=TIMES, **longer)
        for store in (tmp_path, None)
    )
    assert (here.stored, here.computed) == (3, 0)
    same(here.dataset, anew.dataset)
    monkeypatch.setattr(content._core, "__version__", "0.0.0")
    assert counts() == (0, 2)


def test_runs_that_might_end_otherwise_are_not_kept(tmp_path: Path) -> None:
    """What is refused costs nothing; what a function raised may be mended, on the same machine."""

    def raising(_t: float, _theta: Any, _omega: Any) -> list[float]:
        raise OSError("the file is not there")

    def unmeasured(_result: Any) -> float:
        raise ImportError("something is not installed")

    def go(over: Any, measure: Any = MEASURE, scene: Any = None) -> Any:
        return do(scene or plain(), over, measure, store=tmp_path)

    assert go({"belt.axial_stiffness": [7e4, -1.0]}).counts == {"finished": 1, "refused": 1}
    assert len(keys(tmp_path)) == 1
    one = {"torque.scale": [1.0]}
    assert go(one, scene=plain()._replace(torque_fn=raising)).counts == {"failed": 1}
    assert go(one, unmeasured).counts == {"measure": 1}
    assert len(keys(tmp_path)) == 1
    # but what the drive itself does is
    over = {"max_steps": [3, 100_000]}
    swept, again = go(over), go(over)
    assert swept.counts == {"finished": 1, "failed": 1} and len(keys(tmp_path)) == 3
    assert (again.stored, again.computed) == (2, 0)
    same(again.dataset, swept.dataset)

    # Texts of any characters, names that files do not allow, several shapes, nothing at all
    def odd(result: bd.Result) -> dict[str, Any]:
        return {
            "a/b key": float(result.t[-1]),
            "status of mine": "zero \0, half a pair \ud800, \u00e4\nend",
            "empty": np.zeros((0, 3)),
            "minus zero, infinite, none": np.array([-0.0, np.inf, np.nan]),
            "one": xarray.DataArray(np.arange(3.0), dims="x"),
            "text": "",
        }

    over = {"torque.scale": [0.5, 1.0]}
    expected = do(plain(), over, odd).dataset
    for stored in (0, 2):
        swept = do(plain(), over, odd, store=tmp_path)
        assert swept.stored == stored
        same(swept.dataset, expected)
    # Runs of two sweeps at once; nothing else, and no part that cannot be read
    over = {"torque.scale": [1.0]}
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="it is a file"):
        do(plain(), over, MEASURE, store=tmp_path / "file")
    with pytest.raises(ValueError, match="holds something else, file"):
        do(plain(), over, MEASURE, store=tmp_path)
    folder = tmp_path / "store"
    do(plain(), over, MEASURE, store=folder)
    (part,) = folder.glob("part-*.sqlite")
    part.write_bytes(part.read_bytes()[:2000])
    with pytest.raises(ValueError, match=rf"{part.name} cannot be read.*remove it"):
        do(plain(), over, MEASURE, store=folder)
    part.unlink()
    part.mkdir()
    with pytest.raises(OSError, match=f"regular file; it is a part of the store {folder}.*{part}"):
        do(plain(), over, MEASURE, store=folder)
    one, other = Store(tmp_path / "both"), Store(tmp_path / "both")
    for k in range(3):
        one.add(f"one {k}", Kept("x"))
        other.add(f"other {k}", Kept(str(k), b"%d" % k, "common"))
    one.flush(), other.flush()
    found = one.find([*(f"one {k}" for k in range(3)), "other 2", "none"])
    assert sorted(found) == ["one 0", "one 1", "one 2", "other 2"]
    assert found["other 2"] == Kept("2", b"2", "common")

    # A part is there when it is whole
    def half(path: Path, _runs: Any) -> None:
        with sqlite.created(path, store._TABLES):
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(store, "_write", half)
        one.add("cut off", Kept("x"))
        one.flush()
    assert Store(tmp_path / "both").find(["cut off"]) == {}
    one.flush()
    assert set(one.find(["cut off"])) == {"cut off"}


def test_a_changed_bit_is_found(tmp_path: Path) -> None:
    """In numbers, states, texts and in what SQLite keeps of them: nothing wrong is given, and the
    error names the part and what to do.
    """
    layout = Layout((Quantity("a", (Axis("pulley", ("x", "y"), 2),), "N", "tension"),))
    outcomes = {
        f"key {k}": Outcome(
            status="finished",
            message="as it ended",
            value=(np.array([0.1, k + 0.2]), ["two", "words"]),
            layout=layout,
            final=np.arange(3.0) + 0.3,
        )
        for k in range(3)
    }
    kept = {key: to_kept(outcome) for key, outcome in outcomes.items()}
    for key, outcome in outcomes.items():
        again = attrs.asdict(of_kept(kept[key]), recurse=False)
        again["layout"] = as_layout(again["layout"])
        np.testing.assert_equal(again, attrs.asdict(outcome, recurse=False))
    one = Store(tmp_path)
    for key, each in kept.items():
        one.add(key, each)
    one.flush()
    (part,) = tmp_path.glob("part-*.sqlite")
    whole = part.read_bytes()

    def change(at: int) -> str:
        """Change a bit; return what is said, or nothing of what makes no difference."""
        content = bytearray(whole)
        content[at] ^= 4
        part.write_bytes(content)
        try:
            found = one.find(kept)
        except ValueError as error:
            return str(error)
        assert found.items() <= kept.items()
        return ""

    for value in (np.array([0.1, 1.2]).tobytes(), np.array([1.3]).tobytes(), b"as it ended"):
        said = change(whole.index(value) + 1)
        assert part.name in said and "checksum" in said and "remove it, and its runs" in said
    # in what SQLite keeps of the file: its head, the tables, and what lies between
    said = [change(at) for at in (*range(200), *range(200, len(whole), 89))]
    assert any("malformed" in one for one in said) and any(
        "begins otherwise" in one for one in said
    )
    assert all(part.name in one for one in said if one)
    part.unlink()
    assert one.find(kept) == {}


@pytest.mark.parametrize("small", [True, False])
def test_a_full_disk_is_named_with_the_file(
    small: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the system says it, and as SQLite does. What was kept before is found."""
    do(plain(), {"torque.scale": [1.0]}, MEASURE, store=tmp_path)
    before = keys(tmp_path)
    both = {"torque.scale": [1.0, 0.5]}

    write = store._write

    def full(path: Path, runs: Any) -> None:
        if not small:
            with sqlite.created(path, store._TABLES):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        with monkeypatch.context() as patch:
            patch.setattr(store, "_TABLES", "PRAGMA max_page_count = 2;" + store._TABLES)
            write(path, runs)

    with monkeypatch.context() as patch, pytest.raises(OSError, match="make room") as caught:
        patch.setattr(store, "_write", full)
        do(plain(), both, MEASURE, store=tmp_path)
    assert caught.value.errno == errno.ENOSPC
    assert Path(caught.value.filename).parent == tmp_path
    assert "no file was left there" in str(caught.value) and keys(tmp_path) == before
    swept = do(plain(), both, MEASURE, store=tmp_path)
    assert (swept.stored, swept.computed) == (1, 1)
