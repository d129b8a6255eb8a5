"""What is measured in a run of a sweep: numbers and texts in a row, and the layout of the row."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from ..base.checks import Array


class Axis(NamedTuple):
    """An axis of a quantity, besides those of the sweep."""

    name: str  # such as "pulley" or "time"
    labels: tuple[str, ...] | tuple[float, ...]  # along it; empty: they are only counted
    size: int
    units: str = ""  # of numbers
    text: str = ""  # what it is

    @property
    def named(self) -> bool:
        """Whether its entries have names, so that those of several runs can be joined."""
        return bool(self.labels) and isinstance(self.labels[0], str)


class Quantity(NamedTuple):
    """A measured quantity: its name, axes and unit; of numbers or texts."""

    name: str
    axes: tuple[Axis, ...]
    units: str
    text: str
    words: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of its axes."""
        return tuple(axis.size for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of its numbers or texts."""
        return math.prod(self.shape)


#: The quantities of a row, one after the other, numbers and texts each for themselves.
Layout = tuple[Quantity, ...]


def as_layout(plain: Sequence[Any]) -> Layout:
    """Return a layout, of which a store has kept lists."""
    return tuple(
        Quantity(name, tuple(Axis(of, tuple(labels), *more) for of, labels, *more in axes), *rest)
        for name, axes, *rest in plain
    )


def in_text(value: Any) -> str:
    """Return a value as short text: of fields those not at defaults, no address of a process."""
    kind: Any = type(value)
    if attrs.has(kind) and kind.__module__.startswith("beltdyn."):
        given = [
            f"{field.name}={in_text(one)}"
            for field in attrs.fields(kind)
            if field.init and not _same(one := getattr(value, field.name), field.default)
        ]
        return f"{kind.__name__}({', '.join(given)})"
    if isinstance(value, float):
        return f"{value:g}"
    return re.sub(r" at 0x[0-9A-Fa-f]+", "", str(value))


def _same(value: Any, default: Any) -> bool:
    return value is default or (isinstance(value, (bool, int, float, str)) and value == default)


def packed(found: Sequence[tuple[Quantity, Any]]) -> tuple[Layout, Array, list[str]]:
    """Put the values of quantities into a row of numbers and one of texts."""
    parts: list[Array] = [np.zeros(0)]
    words: list[str] = []
    for quantity, value in found:
        if quantity.words:
            words += [str(one) for one in np.ravel(np.asarray(value, dtype=object))]
        else:
            parts.append(np.ravel(np.asarray(value, dtype=np.float64)))
    return tuple(quantity for quantity, _ in found), np.concatenate(parts), words
