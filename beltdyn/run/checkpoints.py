"""Runs that are written as they go: what is in such a file, writing it, and reading it again.

An SQLite file: what the run was called with, the samples so far, and the core's restart record at
the last write, from which a run goes on bit for bit. A write that is cut off is taken back when the
file is opened again, by the journal that is then beside it. Like all files, it may come from
anywhere: nothing in it is executed, all is checked.
"""

from __future__ import annotations

import hashlib
import math
import os
import sqlite3
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, Self

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base import files, sqlite
from ..base.checks import real
from ..base.run_warnings import RunWarning
from . import start_of_run
from .start_of_run import Start

#: The versions are those of the kind and of the form of the file.
_TABLES = """
PRAGMA application_id = 0x62656c74;
PRAGMA user_version = 3;
CREATE TABLE parts (
  id INTEGER PRIMARY KEY, kind TEXT, first INTEGER, content BLOB, checksum BLOB
);
"""
_HEAD, _ROWS, _RECORD = "head", "rows", "rest"
#: Of a restart record: samples before it, time [s], CPU and wall time so far [s], whether the run
#: has finished.
_BEFORE = struct.Struct("<Qddd?")
#: Samples of one row [byte], which are in memory two or three times while it is written or read.
_MOST_ROWS = 1 << 26


def _path(value: object) -> str:
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"Checkpoint.path must be a path, got {type(value).__name__}")
    path = os.fspath(value)
    if not isinstance(path, str) or not path:
        raise ValueError(f"Checkpoint.path must be a text that is not empty, got {path!r}")
    return path


def _every(value: object) -> float:
    every = real("Checkpoint.every", value, "s")
    if every < 0.0:
        raise ValueError(f"Checkpoint.every must be >= 0 s, got {every:g} s")
    return every


@attrs.frozen
class Checkpoint:
    """File that a run is written to, and how often (``checkpoint`` of :func:`simulate`).

    Attributes:
        path: The file; there must be none yet.
        every: Wall time between two writes [s], >= 0; 0: every few milliseconds. A write waits for
            the disk; besides samples the file takes some 60 kB for 60 links, 130 to 150 kB for 240.

    Raises:
        TypeError, ValueError: Not a path, not a time.
    """

    path: str = attrs.field(converter=_path)
    every: float = attrs.field(default=30.0, converter=_every)

    @classmethod
    def of(cls, value: object) -> Checkpoint:
        """Return a Checkpoint for a path, or the Checkpoint given.

        Raises:
            TypeError, ValueError: It is neither.
        """
        if isinstance(value, Checkpoint):
            return value
        if not isinstance(value, (str, os.PathLike)):
            raise TypeError(
                "checkpoint must be a path, a Checkpoint(path, every=...) or None, "
                f"got {type(value).__name__}"
            )
        return cls(value)


class Spent(NamedTuple):
    """Times spent on a run so far [s]: CPU, wall, settling."""

    cpu: float = 0.0
    wall: float = 0.0
    settle: float = 0.0


class _Kept(NamedTuple):
    """A restart record and what goes with it."""

    samples: int
    t: float
    spent: Spent
    finished: bool
    record: bytes


class Recorder:
    """Writes a run to its file when it is time, and when it ends; this one has no file.

    After each chunk of the run the restart record is kept in memory, so that there is one also
    where the run ends in the middle of a step: by an exception of the torque function.
    """

    def __init__(self, path: str = "", every: float = math.inf) -> None:
        self.path, self.every = path, every
        self._db: sqlite3.Connection | None = None
        self._writes = False
        self._arrays: Mapping[str, NDArray[Any]] = {}
        self._spent: Callable[[], Spent] = Spent
        self._kept: _Kept | None = None
        self._written = 0  # samples
        self._up_to: float | None = None  # time [s]
        self._due = 0.0
        self._failures: list[tuple[float, str]] = []
        self._place: sqlite.Place | None = None
        self._lost = False

    def begin(
        self, _sim: _core.Simulation, _arrays: Mapping[str, NDArray[Any]], start: Start
    ) -> Spent:
        """Begin with a simulation that has not made a step; return what was spent on it before."""
        return Spent(settle=start.settle_time)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        if self._db is not None:
            self._db.close()

    def count(self, spent: Callable[[], Spent]) -> None:
        """Set the function that returns the times spent on the run."""
        self._spent = spent
        self._due = time.perf_counter() + self.every

    def look(self, sim: _core.Simulation) -> None:
        """Write what is there if it is time to; between two chunks of the run."""
        if self._writes:
            self._keep(sim, finished=False)
            if time.perf_counter() >= self._due:
                self._write()

    def end(self, sim: _core.Simulation, *, finished: bool = False, sound: bool = True) -> None:
        """Write what is there when the run ends.

        It is not ``sound``, that of the drive up to there, if a torque function failed and the core
        does not know.
        """
        if not self._writes:
            return
        if sound:
            with suppress(RuntimeError):  # it failed, perhaps in the middle of a step
                self._keep(sim, finished)
        self._write()

    @property
    def hint(self) -> list[str]:
        """How to go on, if anything is in the file."""
        if self._db is None or self._lost:
            return []
        return [f"go on with beltdyn.resume({self.path!r})"]

    @property
    def warnings(self) -> tuple[RunWarning, ...]:
        """What went wrong with the file."""
        if not self._failures:
            return ()
        t, why = self._failures[0]
        often = "" if len(self._failures) == 1 else f", and {len(self._failures) - 1} time(s) later"
        if self._lost:
            holds = "cannot be gone on with"
        elif self._up_to is None:
            holds = "has nothing but how the run began"
        else:
            holds = f"holds the run up to t = {self._up_to:.6g} s"
        text = (
            f"the checkpoint {self.path} could not be written at t = {t:.6g} s{often} ({why}); the "
            f"run went on, and the file {holds}"
        )
        return (RunWarning(code="checkpoint", text=text, t=t),)

    def _keep(self, sim: _core.Simulation, finished: bool) -> None:
        record = sim.export_record()
        self._kept = _Kept(sim.samples, sim.time, self._spent(), finished, record)

    def _write(self) -> None:
        """Write the kept record and the samples before it, if it is not there already."""
        kept, db, place = self._kept, self._db, self._place
        if kept is None or db is None or place is None:
            return
        try:
            place.check()
        except OSError as error:
            self._failures.append((kept.t, str(error.strerror)))
            self._lost, self._writes = True, False
            return
        try:
            with sqlite.written(db, self.path):
                # Ctrl-C may have come between the end of a write and the note of it in this object
                db.execute("DELETE FROM parts WHERE first >= ?", (self._written,))
                rows = max(1, _MOST_ROWS // max(1, row_size(self._arrays)))
                for begin in range(self._written, kept.samples, rows):
                    some = slice(begin, min(begin + rows, kept.samples))
                    pieces = [self._arrays[name][some].data for name in self._names]
                    _add(db, _ROWS, begin, *pieces)
                before = _BEFORE.pack(kept.samples, kept.t, *kept.spent[:2], kept.finished)
                _add(db, _RECORD, kept.samples, before, kept.record)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else None
            self._failures.append((kept.t, why or str(error)))
        else:
            self._written, self._up_to, self._kept = kept.samples, kept.t, None
            place.look()
        self._due = time.perf_counter() + self.every

    @property
    def _names(self) -> list[str]:
        return sorted(self._arrays)


def _add(db: sqlite3.Connection, kind: str, first: int, *pieces: Any) -> None:
    """Add a part, of the samples from the first one on."""
    content = b"".join(pieces)
    row = (kind, first, content, hashlib.sha256(content).digest())
    db.execute("INSERT INTO parts (kind, first, content, checksum) VALUES (?, ?, ?, ?)", row)


def row_size(arrays: Mapping[str, NDArray[Any]]) -> int:
    """Return the size of the samples at one time [byte]."""
    return sum(
        array.dtype.itemsize * int(np.prod(array.shape[1:], dtype=np.int64))
        for array in arrays.values()
    )


class Fresh(Recorder):
    """Writes a run from its beginning, to a file that is not there yet."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        super().__init__(checkpoint.path, checkpoint.every)
        if os.path.lexists(self.path):
            raise ValueError(
                f"checkpoint: there is a file {self.path} already{_use_of(self.path)}remove it, or "
                "choose another name"
            )
        files.check_writable(self.path)

    def begin(
        self, _sim: _core.Simulation, arrays: Mapping[str, NDArray[Any]], start: Start
    ) -> Spent:
        """Make the file, with all that the run was called with."""
        with sqlite.created(self.path, _TABLES) as db:
            _add(db, _HEAD, -1, start_of_run.pack(start, self.every))
        self._db = sqlite.opened(self.path, _TABLES, write=True)
        self._place, self._arrays, self._writes = sqlite.Place(self.path), arrays, True
        return super().begin(_sim, arrays, start)


class Continued(Recorder):
    """Goes on with a run, and with writing it if ``write``, as often as before unless ``every``.

    Raises:
        OSError: The file cannot be read or, for ``write``, written.
        ValueError: It is no file of a run, of another version, damaged, or of another machine.
    """

    #: What the run was called with.
    start: Start

    def __init__(self, path: str | os.PathLike[str], write: bool, every: float | None) -> None:
        super().__init__(_path(path))
        with self._refusing("it is no checkpoint of a run, or one of another version: "):
            self._db = sqlite.opened(self.path, _TABLES, write=write)
            self._place = sqlite.Place(self.path)
        self._writes = write
        with self._refusing():
            self.start, kept_every = start_of_run.unpack(b"".join(self._contents(_HEAD)))
            self.every = _every(kept_every if every is None else every)
            level = _core.kernel_level()
            if self.start.kernels != level:
                raise ValueError(
                    f"the run uses the instruction level {self.start.kernels}, this process "
                    f"{level}, and they do not give the same bits: set the environment variable "
                    f"BELTDYN_KERNELS={self.start.kernels}, on a processor that has it"
                )

    def begin(
        self, sim: _core.Simulation, arrays: Mapping[str, NDArray[Any]], _start: Start
    ) -> Spent:
        """Take the samples and the restart record, if they are of this run."""
        self._arrays = arrays
        with self._refusing(), self._at_one_time():
            return self._resume(sim)

    def _resume(self, sim: _core.Simulation) -> Spent:
        settle = self.start.settle_time
        content = b"".join(self._contents(_RECORD))
        if not content:
            return Spent(settle=settle)
        if len(content) < _BEFORE.size:
            raise ValueError("a restart record is too short")
        samples, t, cpu, wall, finished = _BEFORE.unpack_from(content)
        sim.import_record(memoryview(content)[_BEFORE.size :])
        if sim.samples != samples or sim.time != t:
            raise ValueError("a restart record and what is said of it do not fit together")
        self._read_rows(samples)
        self._written, self._up_to = samples, t
        if finished:
            self._writes = False  # all is there
        return Spent(cpu, wall, settle)

    def _read_rows(self, samples: int) -> None:
        size, at = row_size(self._arrays), 0
        for content in self._contents(_ROWS):
            count = len(content) // max(1, size)
            if count * size != len(content) or count > samples - at:
                raise ValueError("its samples are not those of the run")
            offset = 0
            for name in self._names:
                rows = self._arrays[name][at : at + count]
                if rows.nbytes:
                    values = np.frombuffer(content, rows.dtype, rows.size, offset)
                    rows[...] = values.reshape(rows.shape)
                    offset += rows.nbytes
            at += count
        if size and at != samples:
            raise ValueError("samples are missing")
        touched = self._arrays.get("pulley", np.zeros(0))[:samples]
        n_p = len(self.start.scene.params.pulleys)
        if touched.size and not -1 <= touched.min() <= touched.max() < n_p:
            raise ValueError(f"contact.pulley must be from -1 to {n_p - 1}")

    def check(self) -> None:
        """Raise ValueError if any part is damaged."""
        for kind in (_ROWS, _RECORD):
            for _ in self._contents(kind):
                pass

    @contextmanager
    def _at_one_time(self) -> Iterator[None]:
        """Read what one write left, while another run writes."""
        assert self._db is not None
        with sqlite.errors(self.path):
            alone = not self._db.in_transaction
            if alone:
                self._db.execute("BEGIN")
            yield
            if alone:
                self._db.execute("COMMIT")

    def _contents(self, kind: str) -> Iterator[bytes]:
        assert self._db is not None
        with sqlite.errors(self.path):
            found = self._db.execute(
                "SELECT content, checksum FROM parts WHERE kind = ? ORDER BY id", (kind,)
            )
            for content, checksum in found:
                if not isinstance(content, bytes) or hashlib.sha256(content).digest() != checksum:
                    raise ValueError("it is damaged: a checksum does not fit")
                yield content

    @contextmanager
    def _refusing(self, what: str = "") -> Iterator[None]:
        """Refuse the file for what is wrong with it; close it after any error."""
        try:
            yield
        except BaseException as error:
            self.close()
            if isinstance(error, (TypeError, ValueError)):
                raise ValueError(f"cannot go on from {self.path}: {what}{error}") from None
            raise


def _use_of(path: str) -> str:
    """Describe what can be done with a file that stands where a run is to be written."""
    try:
        with Continued(path, write=False, every=None) as run:
            run.check()
    except ValueError as error:
        return f"; {error}: "
    except OSError:
        pass  # it cannot be read now
    return f": go on with the run in it (beltdyn resume {path}, or beltdyn.resume in Python), "
