"""Checks of what is to be drawn: results, samples, indices and options."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.checks import integer, real
from ..base.naming import index_of
from ..result.result import Result

Indices = int | Sequence[int]
Pulleys = int | str | Sequence[int | str]


def drawable(name: str, value: object, cls: type, made_by: str) -> None:
    """Check that this is of a class; a result must have samples."""
    if not isinstance(value, cls):
        raise TypeError(
            f"{name} must be a {cls.__name__}, got {type(value).__name__}: draw what "
            f"bd.{made_by} returns"
        )
    if isinstance(value, Result) and value.t.size == 0:
        raise ValueError("result must hold at least one sample to be drawn")


def sample(result: Result, t: float | None) -> int:
    """Find the sample nearest to a time; the last one for None."""
    times = result.t
    if t is None:
        return times.size - 1
    time = real("t", t, "s")
    beyond = (times[-1] - times[0]) / max(times.size - 1, 1)
    if not times[0] - beyond <= time <= times[-1] + beyond:
        raise ValueError(
            f"t must lie within the samples, {times[0]:g} to {times[-1]:g} s, got {time:g} s"
        )
    return int(np.argmin(np.abs(times - time)))


def indices(name: str, value: object, count: int, names: Sequence[str] = ()) -> list[int]:
    """Check one index or a sequence of them, from 0 to ``count`` - 1, or one of ``names``."""

    def index(field: str, one: object) -> int:
        named = names and isinstance(one, str) and not one.isdecimal()
        return index_of(field, one, names) if named else integer(field, one, 0, count - 1)

    if isinstance(value, str) or not isinstance(value, Iterable):
        return [index(name, value)]
    found = [index(f"{name}[{k}]", one) for k, one in enumerate(value)]
    if not found:
        raise ValueError(f"{name} must hold at least one index, got none")
    return found


def pulley_indices(value: object, names: Sequence[str]) -> list[int]:
    """Check one pulley or a sequence of them, by name or index; all for None."""
    every = list(range(len(names)))
    return every if value is None else indices("pulleys", value, len(names), names)


def named_links(links: Indices | Mapping[str, int] | None, count: int) -> dict[str, int]:
    """Check links to highlight, with names or not."""
    if links is None:
        return {}
    if isinstance(links, Mapping):
        last = count - 1
        return {str(name): integer(f"links[{name!r}]", k, 0, last) for name, k in links.items()}
    return {f"link {k}": k for k in indices("links", links, count)}


def choice(name: str, value: object, options: Sequence[str | None]) -> None:
    """Check an option against those allowed."""
    if not (value is None or isinstance(value, str)) or value not in options:
        words = ", ".join(repr(option) for option in options)
        raise ValueError(f"{name} must be one of {words}, got {reprlib.repr(value)}")


def runs(values: Any) -> Iterator[tuple[int, int, int]]:
    """Yield begin, end and value of every run of equal values."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    for begin, end in pairwise(edges):
        yield begin, end, int(values[begin])
