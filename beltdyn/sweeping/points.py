"""The points of a sweep: the values of its runs, and their layout."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from ..base.checks import one_of, shown
from .sampling import Samples

#: The dimension of runs that are not a grid.
RUN = "run"
#: Integers of tables are below.
_MOST = 2**63


@attrs.frozen(eq=False)
class Points:
    """All runs of a sweep."""

    names: tuple[str, ...]  # what is swept
    axes: tuple[tuple[Any, ...], ...]  # of a grid, the values of each name; empty for any other
    rows: tuple[tuple[Any, ...], ...]  # the values of each run, in the order of the names
    design: dict[str, Any]  # how they were chosen, in plain words and numbers

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions of the result."""
        return self.names if self.axes else (RUN,)

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the dimensions."""
        return tuple(map(len, self.axes)) if self.axes else (len(self.rows),)


def as_points(over: object, combine: object = "grid") -> Points:
    """Lay out the runs."""
    how = one_of("combine", combine, ("grid", "zip"))
    if isinstance(over, Samples):
        rows = tuple(tuple(map(float, row)) for row in over.values)
        return Points(over.names, (), rows, {"kind": "sample", **over.design})
    if isinstance(over, Mapping):
        names = tuple(map(_name, over))
        axes = tuple(_values(name, over[name]) for name in names)
        if not names:
            raise ValueError("over must name at least one thing to change")
        if how == "grid":
            return Points(names, axes, tuple(itertools.product(*axes)), {"kind": "grid"})
        lengths = {name: len(axis) for name, axis in zip(names, axes, strict=True)}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name}: {length}" for name, length in lengths.items())
            raise ValueError(f'combine="zip" needs as many values of each name, got {said}')
        return Points(names, (), tuple(zip(*axes, strict=True)), {"kind": "zip"})
    if isinstance(over, Sequence) and not isinstance(over, str):
        return _listed(over)
    raise TypeError(
        "over must be a mapping {name: values}, a list of such mappings with one value each, or "
        f"what bd.sample gives, got {type(over).__name__}"
    )


def _listed(over: Sequence[Any]) -> Points:
    if not over:
        raise ValueError("over must hold at least one point")
    names: tuple[str, ...] = ()
    for k, point in enumerate(over):
        if not isinstance(point, Mapping):
            raise TypeError(f"over[{k}] must be a mapping {{name: value}}, got {point!r:.60}")
        names = names or tuple(map(_name, point))
        if not names:
            raise ValueError("over[0] must name at least one thing to change")
        if set(point) != set(names):
            raise ValueError(
                f"over[{k}] must name {', '.join(names)}, as over[0] does, got "
                f"{', '.join(map(str, point)) or 'nothing'}"
            )
    rows = tuple(tuple(_plain(name, point[name]) for name in names) for point in over)
    return Points(names, (), rows, {"kind": "list"})


def _name(name: object) -> str:
    if not isinstance(name, str):
        raise TypeError(f"over: names must be texts, got {name!r}")
    if name == RUN:
        raise ValueError(f"over: {RUN!r} is no name of anything in a scene")
    return name


def _plain(name: str, value: Any) -> Any:
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, int) and not -_MOST <= plain < _MOST:
        raise ValueError(f"over[{name!r}] must hold integers of 64 bits, got {shown(plain)}")
    return plain


def _values(name: str, values: Any) -> tuple[Any, ...]:
    if isinstance(values, np.ndarray) and values.ndim == 0:
        values = values[()]
    if isinstance(values, (str, bytes, Mapping)) or not hasattr(values, "__iter__"):
        raise TypeError(f"over[{name!r}] must be a list of values, got {values!r:.60}")
    listed = tuple(_plain(name, value) for value in values)
    if not listed:
        raise ValueError(f"over[{name!r}] must hold at least one value")
    seen: set[str] = set()
    for value in listed:
        if isinstance(value, (bool, int, float, str)):
            if repr(value) in seen:
                raise ValueError(f"over[{name!r}] holds {value!r} twice")
            seen.add(repr(value))
    return listed
