"""Files of named arrays, the form in which states and results are saved.

A file may come from anywhere, so nothing in it is trusted. No code in it is run (no pickles), and
the memory it takes is bounded by its own size: only uncompressed members are read, each of them
once, and the header of an array must agree with the size of its member.
"""

from __future__ import annotations

import errno
import math
import os
import zipfile
from collections.abc import Callable, Collection, Mapping
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from . import files

_T = TypeVar("_T")
Arrays = Mapping[str, NDArray[Any]]


def write(path: str | os.PathLike[str], values: Mapping[str, Any]) -> None:
    """Write an ``.npz`` file, exactly to ``path``: NumPy alone would add an ending."""
    with files.replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, **values)


def read(
    path: str | os.PathLike[str],
    what: str,
    names: Collection[str],
    build: Callable[[dict[str, NDArray[Any]]], _T],
) -> _T:
    """Read an ``.npz`` file and build ``what`` from its arrays."""
    with open(path, "rb") as file:
        try:
            return build(_arrays(file, os.fstat(file.fileno()).st_size, names))
        except OSError as error:
            if error.errno not in (None, errno.EINVAL, errno.ESPIPE):
                raise
            why = "not an archive of arrays"  # it refers to a place before its own beginning
        except MemoryError:
            raise
        except KeyError as error:
            why = f"{error.args[0]} is missing"
        except Exception as error:
            # The exceptions of zipfile and NumPy for damaged files are not documented.
            why = str(error) or type(error).__name__
    raise ValueError(f"{os.fspath(path)} is not a saved {what}: {_line(why)}")


def _line(words: str) -> str:
    """Shorten a message to one line of limited length, whatever a crafted file put into it."""
    line = " ".join(words.split())
    return line if len(line) <= 300 else f"{line[:300]}..."


def _arrays(file: IO[bytes], size: int, names: Collection[str]) -> dict[str, NDArray[Any]]:
    try:
        archive = zipfile.ZipFile(file)
    except zipfile.BadZipFile as error:
        raise ValueError(f"not an archive of arrays ({error})") from None
    with archive:
        members = {}
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            if name not in names or name in members or name == member.filename:
                raise ValueError(f"it holds {member.filename!r}, which does not belong there")
            if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1:
                raise ValueError(f"{name} is compressed or encrypted")
            members[name] = member
        if sum(member.file_size for member in members.values()) > size:
            raise ValueError("its members claim to be larger than the file")
        return {name: _array(archive, member, name) for name, member in members.items()}


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo, name: str) -> NDArray[Any]:
    with archive.open(member) as data:
        try:
            shape, fortran, dtype = _header(data)
        except (Exception, MemoryError) as error:
            # The header is parsed as Python; a crafted one can exhaust the parser.
            raise ValueError(f"{name} has no valid array header ({error})") from None
        if dtype.kind not in "fiubU" or dtype.hasobject:
            raise ValueError(f"{name} must hold numbers or text, got {dtype}")
        count = math.prod(shape) if all(length >= 0 for length in shape) else -1
        rest = member.file_size - data.tell()
        if count * dtype.itemsize != rest:
            raise ValueError(f"{name} has {rest} bytes, which are not those of {shape} {dtype}")
        content = bytearray(data.read())  # verifies the checksum; writeable, unlike bytes
        if len(content) != rest:
            raise ValueError(f"{name} is truncated")
    array: NDArray[Any] = np.ndarray(shape, dtype, content, order="F" if fortran else "C")
    return array


def _header(data: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = np.lib.format.read_magic(data)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(data)
    if version == (2, 0):
        return np.lib.format.read_array_header_2_0(data)
    raise ValueError(f"version {version} of the format is not known")


def number_array(
    name: str, value: NDArray[Any], kind: DTypeLike, shape: tuple[int, ...]
) -> NDArray[Any]:
    """Check an array's kind and shape and return it in this machine's byte order."""
    native = value.dtype.newbyteorder("=")
    if native != np.dtype(kind):
        raise ValueError(f"{name} must be of type {np.dtype(kind)}, got {value.dtype}")
    if value.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {value.shape}")
    return value.astype(native, order="C", copy=False)


def text(name: str, value: NDArray[Any]) -> str:
    """Check that an array is one text and return it."""
    if value.dtype.kind != "U" or value.ndim != 0:
        raise ValueError(f"{name} must be a text, got an array of {value.dtype}")
    codes = np.frombuffer(value.tobytes(), np.dtype(np.uint32).newbyteorder(value.dtype.byteorder))
    if ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any():
        # NumPy would return a str that is not valid in Python.
        raise ValueError(f"{name} holds invalid characters")
    return str(value)
