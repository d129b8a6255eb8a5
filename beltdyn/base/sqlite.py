"""SQLite files: made in one step, written by one process at a time, read without trusting them."""

from __future__ import annotations

import errno
import os
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from . import files

#: Errors of the system, by the code of SQLite. Others are of what is in the file.
_OF_SYSTEM = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_IOERR: errno.EIO,
    sqlite3.SQLITE_CANTOPEN: errno.EIO,
    sqlite3.SQLITE_READONLY: errno.EROFS,
    sqlite3.SQLITE_NOMEM: errno.ENOMEM,
}
#: How long a write waits for others that read [s].
_PATIENCE = 5.0


@contextmanager
def errors(path: str | os.PathLike[str], hint: str = "") -> Iterator[None]:
    """Raise errors of SQLite as those of Python, of the system with a hint."""
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            what = "another run is writing to it"
            raise BlockingIOError(errno.EWOULDBLOCK, what, os.fspath(path)) from None
        if code in _OF_SYSTEM:
            number = _OF_SYSTEM[code]
            raise OSError(number, f"{os.strerror(number)}{hint}", os.fspath(path)) from error
        raise ValueError(f"it is damaged ({error})") from error


@contextmanager
def created(path: str | os.PathLike[str], tables: str) -> Iterator[sqlite3.Connection]:
    """Yield a new file, which takes its place when it is complete; an error leaves none."""
    with (
        files.replacing(path) as temporary,
        errors(path),
        closing(sqlite3.connect(temporary)) as db,
    ):
        # nobody sees it before it is on the disk
        db.executescript(f"PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; {tables}")
        with db:
            yield db


def opened(
    path: str | os.PathLike[str], tables: str, *, write: bool = False, constant: bool = False
) -> sqlite3.Connection:
    """Open a file that :func:`created` has made with these tables; others may stand at its place.

    One connection at a time may ``write``, until it is closed; nobody writes to a ``constant`` one,
    which need not be locked. Raises OSError, BlockingIOError while another process writes,
    ValueError of another file or a damaged one.
    """
    place = Path(path)
    if not stat.S_ISREG(place.stat().st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file", os.fspath(path))
    # no open(): closing a file takes away the locks that this process has on it
    if not os.access(place, os.R_OK | (os.W_OK if write else 0)):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.fspath(path))
    # for reading, too: what a killed process was writing is then taken back
    address = f"{place.absolute().as_uri()}?{'mode=ro&immutable=1' if constant else 'mode=rw'}"
    journal, hint = place.with_name(f"{place.name}-journal"), ""
    if journal.exists():
        hint = (
            f"; a write to it was cut off and is taken back by {journal.name} beside it: copy both "
            "to a folder where they can be written"
        )
    with errors(path, hint):
        db = sqlite3.connect(
            address, uri=True, timeout=0.0, isolation_level=None, check_same_thread=False
        )
        try:
            db.executescript("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON")
            if write:
                db.execute("BEGIN IMMEDIATE")
            db.execute(f"PRAGMA busy_timeout = {1000 * _PATIENCE:.0f}")
            if _shape(db) != _shape_of(tables):
                raise ValueError("it begins otherwise")
        except sqlite3.DatabaseError as error:
            db.close()
            if getattr(error, "sqlite_errorcode", 0) == sqlite3.SQLITE_NOTADB:
                raise ValueError("it begins otherwise") from None
            raise
        except BaseException:
            db.close()
            raise
    return db


class Place:
    """The file that stood at a path when it was last looked at: SQLite writes on where it was."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        self.look()

    def look(self) -> None:
        """Note which file stands there, and its size."""
        self._seen = os.stat(self.path)

    def check(self) -> None:
        """Raise OSError if the file has been removed, replaced or cut short since then."""
        try:
            now = os.stat(self.path)
        except FileNotFoundError:
            raise FileNotFoundError(errno.ENOENT, "it was removed", self.path) from None
        if (now.st_dev, now.st_ino) != (self._seen.st_dev, self._seen.st_ino):
            raise OSError(errno.ESTALE, "another file was put in its place", self.path)
        if now.st_size < self._seen.st_size:
            raise OSError(errno.ESTALE, "something else cut it short", self.path)


@contextmanager
def written(db: sqlite3.Connection, path: str | os.PathLike[str]) -> Iterator[None]:
    """Write what is done within, as a whole or, if anything raises, not at all.

    Between writes an empty transaction keeps the file from other writers, without a journal.
    """
    try:
        with errors(path):
            if not db.in_transaction:
                db.execute("BEGIN IMMEDIATE")
            yield
            db.execute("COMMIT")
    finally:
        with suppress(sqlite3.Error):
            if db.in_transaction:
                db.execute("ROLLBACK")
            db.execute("BEGIN IMMEDIATE")


def _shape(db: sqlite3.Connection) -> list[Any]:
    """Return what a file holds besides rows: views or triggers would be the work of others."""
    versions = [db.execute(f"PRAGMA {name}").fetchone() for name in _VERSIONS]
    return [*versions, *db.execute("SELECT type, name, sql FROM sqlite_master ORDER BY name")]


_VERSIONS = ("application_id", "user_version")


@lru_cache(maxsize=8)
def _shape_of(tables: str) -> list[Any]:
    with closing(sqlite3.connect(":memory:")) as db:
        db.executescript(tables)
        return _shape(db)
