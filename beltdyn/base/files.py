"""Replacing files in one step: the old file stays until the new one is complete."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Characters of a name and its ending used in that of the temporary file, to limit its length.
_STEM, _ENDING = 40, 12


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the path of a temporary file with the same ending, which then replaces ``path``.

    It is in the same folder, so that there is always either the old file or the new one, also after
    a power failure; whatever the body raises, it is removed. Permission bits, the owner where the
    system allows it, and links stay; pipes and devices are written to directly.
    """
    target, before = _find(path)
    if before is not None and not stat.S_ISREG(before.st_mode):
        try:
            yield Path(path)
        except OSError as error:
            raise _explained(error, path, "") from error
        return
    temporary = _beside(target)
    try:
        _create(temporary, private=before is not None)
        yield temporary
        _complete(temporary, before)
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            now = "no file was left there" if before is None else "the file there is unchanged"
            raise _explained(error, path, now) from error
        raise
    _flush_folder(target.parent)


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file of this content, as :func:`replacing` does."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that :func:`replacing` could begin, without leaving a file behind."""
    target, before = _find(path)
    if before is not None and not stat.S_ISREG(before.st_mode):
        if not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, "permission denied", os.fspath(path))
        return
    temporary = _beside(target)
    try:
        # Rights are not enough: the file system may be read-only.
        _create(temporary, private=True)
    except OSError as error:
        raise _explained(error, path, "") from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def _find(path: str | os.PathLike[str]) -> tuple[Path, os.stat_result | None]:
    """Return the file that a path leads to and, if it exists, its status."""
    try:
        before = os.stat(path)
    except FileNotFoundError:
        before = None
    if before is not None and not stat.S_ISREG(before.st_mode):
        if stat.S_ISDIR(before.st_mode):
            raise IsADirectoryError(errno.EISDIR, "it is a folder", os.fspath(path))
        return Path(path), before  # not resolved: /dev/stdout may lead to a pipe without a name
    if before is not None and not os.access(path, os.W_OK):
        # Replacing needs no right to write to the file itself, so it would ignore the protection.
        raise PermissionError(errno.EACCES, "the file there is write-protected", os.fspath(path))
    return Path(os.path.realpath(path)), before


def _beside(target: Path) -> Path:
    ending = target.suffix if len(target.suffix) <= _ENDING else ""
    return target.with_name(f".{target.stem[:_STEM]}-{secrets.token_hex(8)}{ending}")


def _create(temporary: Path, private: bool) -> None:
    """Make the file, with the rights of any new one or, at first, for the user alone."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    os.close(os.open(temporary, flags, 0o600 if private else 0o666))


def _complete(temporary: Path, before: os.stat_result | None) -> None:
    """Flush the file to disk; set its owner and rights to those of the file it replaces."""
    with open(temporary, "r+b") as file:
        os.fsync(file.fileno())
    if before is None:
        return
    if hasattr(os, "chown"):
        with suppress(OSError):  # only root may change the owner
            os.chown(temporary, before.st_uid, before.st_gid)
    os.chmod(temporary, stat.S_IMODE(before.st_mode))


def _flush_folder(folder: Path) -> None:
    """Flush the folder to disk where the system can; the file is complete either way."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _explained(error: OSError, path: str | os.PathLike[str], now: str) -> OSError:
    """Return the same error for the path of the user, with a note on the state of the file."""
    what = "; ".join(part for part in (error.strerror or str(error), now) if part)
    if error.errno is None:
        return OSError(what)
    return OSError(error.errno, what, os.fspath(path))
