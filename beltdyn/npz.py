"""Files of named arrays, the form in which states and results are saved."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, TypeVar
from zipfile import BadZipFile

import numpy as np

__all__ = ["read", "write"]

_T = TypeVar("_T")


def write(path: str | os.PathLike[str], values: Mapping[str, Any]) -> None:
    """Write an ``.npz`` file, exactly to ``path``: NumPy alone would add an ending."""
    with open(path, "wb") as file:
        np.savez(file, **values)


def read(path: str | os.PathLike[str], what: str, build: Callable[[dict[str, Any]], _T]) -> _T:
    """Read an ``.npz`` file and build ``what`` from its arrays.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is no such file, or ``build`` cannot use what it holds.
    """
    with open(path, "rb") as file:
        try:
            with np.load(file, allow_pickle=False) as arrays:
                return build(dict(arrays))
        except (KeyError, TypeError, ValueError, BadZipFile, EOFError):
            # NumPy's own message would advise to load it as a pickle.
            raise ValueError(f"{os.fspath(path)} is not a saved {what}") from None
