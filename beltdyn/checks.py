"""Checks of plain values, for everything a user can build; messages name field and rule."""

from __future__ import annotations

import difflib
import numbers
import reprlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Array",
    "close_to",
    "flag",
    "integer",
    "pair",
    "positive",
    "real",
    "real_array",
    "sample_times",
]

Array = NDArray[np.float64]


def _with_unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" ({unit})"


def real(name: str, value: object, unit: str = "1") -> float:
    """Check a real number; give it as a plain float.

    Raises:
        TypeError: Not a real number (bool, str, None and complex are not).
        ValueError: NaN or infinite.
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise TypeError(
            f"{name} must be a real number{_with_unit(unit)}, got {reprlib.repr(value)}"
        )
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite{_with_unit(unit)}, got {value!r}")
    return number


def close_to(name: str, known: Iterable[str]) -> str:
    """Give " (did you mean ...?)" for a misspelt name, or nothing."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def positive(name: str, value: object, unit: str = "1") -> float:
    """Check a real number > 0; give it as a plain float.

    Raises:
        TypeError: Not a real number.
        ValueError: NaN, infinite, zero or negative.
    """
    number = real(name, value, unit)
    if number <= 0.0:
        with_unit = "" if unit == "1" else f" {unit}"
        raise ValueError(f"{name} must be > 0{with_unit}, got {number:g}{with_unit}")
    return number


def flag(name: str, value: object) -> bool:
    """Check a bool, Python's or NumPy's.

    Raises:
        TypeError: Not a bool.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be a bool, got {value!r}")
    return bool(value)


def integer(name: str, value: object, least: int, most: int | None = None) -> int:
    """Check an integer from ``least`` to ``most``; give it as a plain int. 60.0 is not one.

    Raises:
        TypeError: Not an integer.
        ValueError: Too small or too large.
    """
    bounds = f">= {least}" if most is None else f"from {least} to {most}"
    rule = f"{name} must be an integer {bounds}"
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{rule}, got {reprlib.repr(value)}")
    number = int(value)
    if number < least or (most is not None and number > most):
        raise ValueError(f"{rule}, got {number}")
    return number


def pair(name: str, value: object, unit: str) -> tuple[float, float]:
    """Check two finite real numbers, from any sequence or array of two."""
    if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, str) or len(value) != 2:
        raise TypeError(
            f"{name} must be a pair of real numbers{_with_unit(unit)}, got {reprlib.repr(value)}"
        )
    return real(f"{name}[0]", value[0], unit), real(f"{name}[1]", value[1], unit)


def real_array(name: str, value: Any, *, ndim: int, shape: tuple[int, ...] | None = None) -> Array:
    """Check an array of finite real numbers; give a read-only C-contiguous float copy.

    Raises:
        TypeError: Not real numbers.
        ValueError: Wrong shape, ragged, NaN or infinite.
    """
    try:
        given = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} must be a regular array, its rows differ in length") from None
    if given.dtype.kind not in "iuf" and given.size:
        raise TypeError(f"{name} must hold real numbers, got {reprlib.repr(value)}")
    if given.ndim != ndim:
        raise ValueError(f"{name} must have {ndim} dimension(s), got shape {given.shape}")
    if shape is not None and given.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {given.shape}")
    array = np.array(given, dtype=np.float64, order="C")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0]
        index = ", ".join(map(str, where))
        raise ValueError(f"{name} must be finite, got {array[tuple(where)]} at [{index}]")
    array.flags.writeable = False
    return array


def sample_times(name: str, value: Any, start: float, end: float) -> Array:
    """Check non-decreasing times within a run (n_t,) [s].

    Raises:
        TypeError: Not real numbers.
        ValueError: Wrong shape, NaN, infinite, decreasing or outside the run.
    """
    times = real_array(name, value, ndim=1)
    if (np.diff(times) < 0.0).any():
        k = int(np.argmax(np.diff(times) < 0.0))
        raise ValueError(
            f"{name} must be non-decreasing, got {times[k]:g} s before {times[k + 1]:g} s"
        )
    # What np.arange leaves by rounding beyond an end is meant to be that end.
    slack = 8 * np.spacing(max(abs(start), abs(end)))
    if times.size and (times[0] < start - slack or times[-1] > end + slack):
        raise ValueError(
            f"{name} must lie within the run, [{start:.12g}, {end:.12g}] s, "
            f"got [{times[0]:.12g}, {times[-1]:.12g}] s"
        )
    return np.clip(times, start, end)
