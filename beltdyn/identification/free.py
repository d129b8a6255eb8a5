"""Free parameters: what a search may change, and on which scale."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array, close_to, real
from ..drive.parameters import changed, check_name, numbers, overlap, read, rule_of
from ..drive.params import Params


@attrs.frozen
class Free:
    """A parameter to be found.

    Args:
        name: Name of a number of the drive, such as "belt.axial_stiffness", "pulleys[1].inertia",
            "pulleys[*].inertia" (one value for all), "gravity[1]", "tensioning.offset[1][0]"; with
            ``set`` any name.
        lower: Lower limit, in the unit of the parameter; None: that of its rule.
        upper: Upper limit; None: no limit.
        scale: "log": searched as its logarithm, so it stays positive and its interval is a factor;
            "linear"; None: "log" for parameters that must not be negative and do not start at 0,
            "linear" for all others and with ``set``.
        start: Where the search begins; None: the value in ``params``.
        size: For "linear": the change that counts as large, the unit of the search; None: |start|.
            Derivatives are taken by differences of ``diff_step`` times this; a parameter whose
            standard deviation exceeds ln(limit) times this counts as undetermined.
        set: ``set(params, value) -> params``, for a parameter that is no single number of the
            drive; needs ``start``. Called from several threads; a ValueError in it means that this
            value is not possible.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    name: str
    lower: float | None = attrs.field(default=None, kw_only=True)
    upper: float | None = attrs.field(default=None, kw_only=True)
    scale: str | None = attrs.field(default=None, kw_only=True)
    start: float | None = attrs.field(default=None, kw_only=True)
    size: float | None = attrs.field(default=None, kw_only=True)
    set: Callable[[Params, float], Params] | None = attrs.field(default=None, kw_only=True)

    def __attrs_post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise TypeError(f"Free.name must be a str, got {self.name!r}")
        if self.set is None:
            check_name(self.name)
        elif not callable(self.set):
            raise TypeError(f"Free.set must be callable, got {self.set!r}")
        elif self.start is None:
            raise ValueError(f"{self.name}: a parameter with set= needs start=")
        if self.scale not in (None, "log", "linear"):
            raise ValueError(f'{self.name}: scale must be "log" or "linear", got {self.scale!r}')
        for field in ("lower", "upper", "start", "size"):
            value = getattr(self, field)
            if value is not None:
                object.__setattr__(self, field, real(f"{self.name}: {field}", value))
        if self.size is not None and self.size <= 0.0:
            raise ValueError(f"{self.name}: size must be > 0, got {self.size:g}")


@attrs.frozen
class Parameter:
    """A free parameter of a drive; searches begin at the coordinate 1, a change of 1 is large."""

    name: str
    start: float
    log: bool
    size: float
    low: float
    high: float
    unit: str
    set: Callable[[Params, float], Params] | None

    def value(self, u: float) -> float:
        """Return the value at a coordinate; infinite where it leaves the range of floats."""
        if not self.log:
            return self.start + (u - 1.0) * self.size
        try:
            return self.start * math.exp(u - 1.0)
        except OverflowError:
            return math.inf

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value; infinite for infinite limits."""
        if not self.log:
            return 1.0 + (value - self.start) / self.size
        return 1.0 + math.log(value / self.start) if value > 0.0 else -math.inf

    def spread(self, off: float) -> float:
        """Return a distance of the coordinate: relative for a logarithm, else in the unit."""
        return float(off) * (1.0 if self.log else self.size)


def _start(params: Params, free: Free) -> float:
    """Return where to begin: as given, or the value that all places of the name have."""
    found: list[Any] = [] if free.set is not None else read(params, free.name)
    if free.start is not None:
        return free.start
    for value in found:
        if not isinstance(value, float):
            hint = close_to(free.name, numbers(params))
            if isinstance(value, tuple) and all(isinstance(one, float) for one in value):
                first = f"{free.name}[0]"
                hint = f" (name one of them, such as {first!r})"
            raise ValueError(
                f"{free.name} cannot be free: it is not a real number but {value!r}{hint}"
            )
    if any(value != found[0] for value in found):
        values = ", ".join(f"{value:g}" for value in found)
        raise ValueError(f"{free.name} differ ({values}): give bd.Free({free.name!r}, start=...)")
    return float(found[0])


def _resolve(params: Params, free: Free) -> Parameter:
    start = _start(params, free)
    rule = rule_of(params, free.name) if free.set is None else None
    kind = rule.rule if rule else ""
    bounded = kind in ("POSITIVE", "POSITIVES", "NONNEGATIVE")
    log = start > 0.0 and bounded if free.scale is None else free.scale == "log"
    least = 0.0 if log or bounded else -math.inf
    low = max(least, -math.inf if free.lower is None else free.lower)
    high = math.inf if free.upper is None else free.upper
    if log and start <= 0.0:
        raise ValueError(f'{free.name}: scale "log" needs a start > 0, got {start:g}')
    if not low < high:
        raise ValueError(f"{free.name}: lower must be < upper, got {low:g} and {high:g}")
    if not low <= start <= high:
        raise ValueError(
            f"{free.name}: the start {start:g} must lie within its limits, [{low:g}, {high:g}]"
        )
    size = free.size or abs(start)
    if not log and size == 0.0:
        raise ValueError(
            f"{free.name} starts at 0: give the change of it that counts as large, "
            f"bd.Free({free.name!r}, size=...)"
        )
    unit = "" if rule is None or rule.unit == "1" else rule.unit
    return Parameter(free.name, start, log, size, low, high, unit, free.set)


def resolve(params: Params, free: Iterable[Free | str]) -> tuple[Parameter, ...]:
    """Look up free parameters in a drive."""
    if isinstance(free, (str, Free)):
        raise TypeError("free must be a sequence of names or bd.Free")
    listed = [part if isinstance(part, Free) else Free(part) for part in free]
    if not listed:
        raise ValueError("free must hold at least one parameter")
    found = tuple(_resolve(params, part) for part in listed)
    for one, other in combinations(found, 2):
        if one.name == other.name:
            raise ValueError(f"free holds {one.name!r} twice")
        if one.set is None and other.set is None and overlap(params, one.name, other.name):
            raise ValueError(f"free holds {one.name!r} and {other.name!r}, which overlap")
    return found


def place(params: Params, parameters: Sequence[Parameter], u: Array) -> Params:
    """Return the drive at the coordinates ``u`` (n_free,)."""
    values = [parameter.value(float(at)) for parameter, at in zip(parameters, u, strict=True)]
    if not np.isfinite(values).all():
        raise ValueError("a parameter left the range of floats")
    pairs = list(zip(parameters, values, strict=True))
    drive = changed(params, {part.name: value for part, value in pairs if part.set is None})
    for part, value in pairs:
        if part.set is not None:
            drive = part.set(drive, value)
            if not isinstance(drive, Params):
                raise TypeError(
                    f"{part.name}: set must return a Params, got {type(drive).__name__}"
                )
    return drive
