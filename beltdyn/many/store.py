"""Store of runs by key: a folder of SQLite files, its parts, written as the work goes.

A part is complete or not there: it is written beside its place and then renamed, and never changed.
So several machines may write to one folder on a shared disk, and others read it meanwhile; no file
is ever locked.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from ..base import files, sqlite

_FORMAT = 1
_NAME = "part-*.sqlite"
_TABLES = f"""
PRAGMA user_version = {_FORMAT};
CREATE TABLE common (id INTEGER PRIMARY KEY, text TEXT);
CREATE TABLE runs (key TEXT PRIMARY KEY, text TEXT, data BLOB, common INTEGER, checksum BLOB);
"""
_ROW = """
SELECT runs.text, runs.data, common.text, runs.checksum
FROM runs JOIN common ON common.id = runs.common WHERE runs.key = ?
"""
#: Between two parts: at least so long [s], this share of the time since the store was opened, at
#: most. A kill then costs little of what was computed, and long sweeps have some hundred parts.
_LEAST, _SHARE, _MOST = 2.0, 0.01, 300.0
#: Raised by what reads SQLite, and here, of files that are not what was written.
_DAMAGED = (ValueError, TypeError, AttributeError, MemoryError, OverflowError)


class Kept(NamedTuple):
    """What is kept of a run."""

    text: str  # of ASCII
    data: bytes = b""  # numbers
    common: str = ""  # a text that many runs have, kept once in a part


class Store:
    """What is kept of runs, by key, in a folder; safe in several threads."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        if not isinstance(path, (str, os.PathLike)):
            raise TypeError(f"store must be a path or None, got {type(path).__name__}")
        self._path = Path(path)
        if self._path.is_file():
            raise ValueError(f"store {self._path}: it is a file; a store is a folder of its own")
        self._path.mkdir(parents=True, exist_ok=True)
        for one in self._path.iterdir():
            if not one.match(_NAME) and not one.name.startswith("."):  # parts being written
                raise ValueError(
                    f"store {self._path}: the folder holds something else, {one.name}; a store is "
                    "a folder of its own"
                )
        files.check_writable(self._path / "part")
        self._waiting: dict[str, Kept] = {}
        self._lock = threading.Lock()
        self._begun = self._written = time.monotonic()

    def find(self, keys: Collection[str]) -> dict[str, Kept]:
        """Return what is kept of those runs that have been written."""
        wanted = set(keys)
        found: dict[str, Kept] = {}
        for part in sorted(self._path.glob(_NAME)):
            try:
                found.update(_read(part, wanted))
            except _DAMAGED as error:
                raise ValueError(
                    f"store {self._path}: {part.name} cannot be read ({error}): remove it, and its "
                    "runs are done again"
                ) from error
            except OSError as error:
                what = f"{error.strerror}; it is a part of the store {self._path}"
                raise OSError(error.errno, what, error.filename) from error
        return found

    def add(self, key: str, kept: Kept) -> None:
        """Keep a run; :meth:`tend` writes it soon."""
        with self._lock:
            self._waiting[key] = kept

    def tend(self) -> None:
        """Write the runs that wait, if the last part is some time ago."""
        now = time.monotonic()
        if now - self._written >= min(max(_LEAST, _SHARE * (now - self._begun)), _MOST):
            self.flush()

    def flush(self) -> None:
        """Write the runs that wait; if that fails they wait on."""
        with self._lock:
            if self._waiting:
                name = f"part-{time.time_ns():020d}-{secrets.token_hex(4)}.sqlite"
                try:
                    _write(self._path / name, self._waiting)
                except OSError as error:
                    what = f"{error.strerror}; make room there: what was written before is kept"
                    raise OSError(error.errno, what, error.filename) from error
                self._waiting = {}
            self._written = time.monotonic()


def _write(path: Path, runs: dict[str, Kept]) -> None:
    numbers = {text: k for k, text in enumerate(dict.fromkeys(one.common for one in runs.values()))}
    rows = (
        (key, one.text, one.data, numbers[one.common], _checksum(key, one))
        for key, one in runs.items()
    )
    with sqlite.created(path, _TABLES) as db:
        db.executemany("INSERT INTO common (text, id) VALUES (?, ?)", numbers.items())
        db.executemany("INSERT INTO runs VALUES (?, ?, ?, ?, ?)", rows)


def _read(part: Path, wanted: set[str]) -> Iterator[tuple[str, Kept]]:
    with closing(sqlite.opened(part, _TABLES, constant=True)) as db, sqlite.errors(part):
        for key in [key for (key,) in db.execute("SELECT key FROM runs") if key in wanted]:
            *row, checksum = db.execute(_ROW, (key,)).fetchone()
            kept = Kept(*row)
            if checksum != _checksum(key, kept):
                raise ValueError("its checksum does not fit: what it holds has been changed")
            yield key, kept


def _checksum(key: str, kept: Kept) -> bytes:
    digest = hashlib.sha256()
    for content in (key.encode(), kept.text.encode(), kept.data, kept.common.encode()):
        digest.update(len(content).to_bytes(8, "big") + content)
    return digest.digest()
