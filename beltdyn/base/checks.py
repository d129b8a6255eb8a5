"""Checks of values given by users; messages name the field and the rule."""

from __future__ import annotations

import difflib
import inspect
import numbers
import reprlib
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


#: NumPy's own limit on dimensions: deeper sequences are no arrays.
_DEEPEST = 64


def shown(value: object) -> str:
    """Write a value in short; Python itself refuses to print ints of thousands of digits."""
    try:
        return reprlib.repr(value)
    except ValueError:
        return f"{type(value).__name__} too long to print"


def _with_unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" ({unit})"


def called_with(function: Callable[..., Any], arguments: str) -> str:
    """Return in words how a function differs that cannot be called so, as "t, omega"; or ""."""
    try:
        takes = inspect.signature(function)
    except (TypeError, ValueError):  # of functions of other languages there may be none
        return ""
    try:
        takes.bind(*arguments.split(", "))
    except TypeError:
        return f"{getattr(function, '__name__', type(function).__name__)}{takes}"
    return ""


def real(name: str, value: object, unit: str = "1") -> float:
    """Check a real number; return it as a plain float."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name} must be a real number{_with_unit(unit)}, got {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite{_with_unit(unit)}, got {shown(value)}")
    return number


def real_numbers(name: str, value: object, unit: str = "1") -> tuple[float, ...]:
    """Check a list of real numbers, at least one; return them as plain floats."""
    if isinstance(value, np.ndarray) and value.ndim == 1:
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, (str, bytes)):
        raise TypeError(
            f"{name} must be a sequence of real numbers{_with_unit(unit)}, got {shown(value)}"
        )
    if not value:
        raise ValueError(f"{name} must have at least one number{_with_unit(unit)}")
    return tuple(real(f"{name}[{k}]", one, unit) for k, one in enumerate(value))


#: What other packages, data sheets and formulas call what has these names here.
_OTHER_WORDS = {
    "rtol": "tolerance tol accuracy reltol",
    "method": "solver integrator algorithm",
    "step": "dt timestep time_step first_step",
    "torque_fn": "torque torques loads",
    "t_end": "duration t_stop tf time",
    "motion": "motions speeds",
    "n_bodies": "links n_links elements cells n n_b",
    "axial_stiffness": "ea",
    "bending_stiffness": "ei",
    "linear_density": "rho rhoa rho_a mass linear_mass mass_per_length",
    "length": "l l0",
    "preload": "tension pretension f0",
    "radius": "r diameter",
    "inertia": "i j moment_of_inertia",
    "center": "position axis xy",
    "least": "min minimum lowest",
    "most": "max maximum highest peak",
    "mean": "average avg",
    "final": "last end",
    "mu": "mu_k friction_coefficient",
    "mu_k": "friction_coefficient",
    "tolerance": "tol rtol",
    "direction": "axis",
}


def close_to(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean ...?)" for a misspelt name, or ""."""
    by_lower = {one.lower(): one for one in known}
    head, dot, last = name.lower().rpartition(".")
    for here, elsewhere in _OTHER_WORDS.items():
        if last in elsewhere.split() and (meant := f"{head}{dot}{here}") in by_lower:
            return f" (did you mean {by_lower[meant]!r}?)"

    def likeness(one: str) -> float:
        alike = difflib.SequenceMatcher(None, one, name.lower()).ratio()
        return max(alike, 0.9) if one.endswith(f".{name.lower()}") else alike  # "pulleys.omega"

    best = max(by_lower, key=likeness, default="")  # the first of equals: a field that must be
    return f" (did you mean {by_lower[best]!r}?)" if best and likeness(best) >= 0.6 else ""


def unknown_field(name: str, known: Iterable[str]) -> str:
    """Return "unknown field", which is meant if it is misspelt, and which there are."""
    fields = list(known)
    there = f"the fields are {', '.join(fields)}" if fields else "there are no fields"
    return f"unknown field{close_to(name, fields)}; {there}"


def positive(name: str, value: object, unit: str = "1") -> float:
    """Check a real number > 0; return it as a plain float."""
    number = real(name, value, unit)
    if number <= 0.0:
        with_unit = "" if unit == "1" else f" {unit}"
        raise ValueError(f"{name} must be > 0{with_unit}, got {number:g}{with_unit}")
    return number


def between(name: str, value: object, low: float = 0.0, high: float = 1.0) -> float:
    """Check a real number between two others, neither of them; return it as a plain float."""
    number = real(name, value)
    if not low < number < high:
        rule = f"> {low:g}" + (f" and < {high:g}" if high < float("inf") else "")
        raise ValueError(f"{name} must be {rule}, got {number:g}")
    return number


def share_of_run(name: str, value: object) -> float:
    """Check a part of a run, counted from its end; return it as a plain float."""
    share = real(name, value)
    if not 0.0 < share <= 1.0:
        raise ValueError(f"{name} must be > 0 and <= 1 (a share of the run), got {share:g}")
    return share


def flag(name: str, value: object) -> bool:
    """Check a bool, Python's or NumPy's."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be a bool, got {shown(value)}")
    return bool(value)


def integer(name: str, value: object, least: int, most: int | None = None) -> int:
    """Check an integer from ``least`` to ``most``; return it as a plain int. 60.0 is not one."""
    bounds = f">= {least}" if most is None else f"from {least} to {most}"
    rule = f"{name} must be an integer {bounds}"
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{rule}, got {shown(value)}")
    number = int(value)
    if number < least or (most is not None and number > most):
        raise ValueError(f"{rule}, got {shown(number)}")
    if number >= 2**63:  # more than the core and files hold
        raise ValueError(f"{name} is too large: {shown(number)}")
    return number


def one_of(name: str, value: object, choices: Sequence[str]) -> str:
    """Check a choice among some names."""
    rule = f"{name} must be one of {', '.join(choices)}, got {shown(value)}"
    if not isinstance(value, str):
        raise TypeError(rule)
    if value not in choices:
        raise ValueError(f"{rule}{close_to(value, choices)}")
    return str(value)


def pair(name: str, value: object, unit: str) -> tuple[float, float]:
    """Check two finite real numbers, from any sequence or array of two."""
    refuse_masked(name, value)
    listed = isinstance(value, Sequence) and not isinstance(value, str)
    listed |= isinstance(value, np.ndarray) and value.ndim == 1
    if not listed or len(cast(Any, value)) != 2:
        raise TypeError(
            f"{name} must be a pair of real numbers{_with_unit(unit)}, got {shown(value)}"
        )
    x, y = cast(Any, value)
    return real(f"{name}[0]", x, unit), real(f"{name}[1]", y, unit)


def refuse_masked(name: str, value: object) -> None:
    """Refuse masked values, alone or in sequences: NumPy would use the numbers under the mask."""
    # Another thread may be importing it just now; nothing can be masked before that has ended.
    masked = sys.modules.get("numpy.ma")
    if hasattr(masked, "is_masked") and _holds_masked(value, masked, _DEEPEST):
        raise ValueError(
            f"{name} must not hold masked values: fill them in (.filled(...)) or leave them out "
            "(.compressed())"
        )


def _holds_masked(value: object, masked: Any, depth: int) -> bool:
    if isinstance(value, masked.MaskedArray):
        return bool(masked.is_masked(value))
    if isinstance(value, np.ndarray) or not isinstance(value, Sequence) or isinstance(value, str):
        return False
    return depth > 0 and any(
        _holds_masked(item, masked, depth - 1) for item in value if type(item) is not float
    )


def real_array(
    name: str, value: Any, *, ndim: int, most: int = 0, shape: tuple[int, ...] | None = None
) -> Array:
    """Check an array of finite real numbers, of ``ndim`` dimensions or up to ``most``.

    Return a float copy in the memory of a ``bytes`` object, which cannot be made writeable again.
    """
    refuse_masked(name, value)
    try:
        given = np.asanyarray(value)
    except ValueError:
        raise ValueError(f"{name} must be a regular array, its rows differ in length") from None
    refuse_masked(name, given)  # an object with __array__ may have returned a masked array
    if given.dtype.kind not in "iuf" and given.size:
        raise TypeError(f"{name} must hold real numbers, got {shown(value)}")
    if not ndim <= given.ndim <= max(ndim, most):
        raise ValueError(f"{name} must have {ndim} dimension(s), got shape {given.shape}")
    if shape is not None and given.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {given.shape}")
    with np.errstate(over="ignore"):  # numbers too large for a float become infinite
        array = np.array(given if given.size else np.empty(given.shape), np.float64, order="C")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0]
        index = ", ".join(map(str, where))
        raise ValueError(f"{name} must be finite, got {array[tuple(where)]} at [{index}]")
    return np.ndarray(array.shape, np.float64, array.tobytes())


def first_of(wrong: NDArray[np.bool_]) -> int | None:
    """Return the index of the first that is True."""
    return int(np.argmax(wrong)) if wrong.any() else None


def sample_times(name: str, value: Any, start: float, end: float) -> Array:
    """Check non-decreasing times within a run (n_t,) [s]."""
    if isinstance(value, numbers.Real):
        count = int(value) if isinstance(value, numbers.Integral) and int(value) > 1 else 100
        raise ValueError(
            f"{name} must have 1 dimension: it takes the times themselves [s], such as "
            f"np.linspace({start:g}, {end:g}, {count}), got {shown(value)}"
        )
    times = real_array(name, value, ndim=1)
    if (k := first_of(np.diff(times) < 0.0)) is not None:
        raise ValueError(
            f"{name} must be non-decreasing, got {times[k]:g} s before {times[k + 1]:g} s"
        )
    # np.arange may go beyond an end by rounding.
    slack = 8 * np.spacing(max(abs(start), abs(end)))
    if times.size and (times[0] < start - slack or times[-1] > end + slack):
        raise ValueError(
            f"{name} must lie within the run, [{start:.12g}, {end:.12g}] s, "
            f"got [{times[0]:.12g}, {times[-1]:.12g}] s"
        )
    return np.clip(times, start, end)
