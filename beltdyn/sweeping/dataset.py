"""The results of a sweep as a labelled table: an xarray.Dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..base.checks import Array
from ..base.optional import optional_module
from ..many.outcome import STATUSES, Outcome
from .outcomes import Axis, Layout, Quantity, as_layout, in_text
from .points import RUN, Points

#: A run, its numbers and its texts; its layout is kept once for many.
_Row = tuple[int, Array, list[str]]


class Table:
    """Results of the runs of a sweep so far."""

    def __init__(self, points: Points, words_of: dict[str, tuple[str, str]]) -> None:
        n = len(points.rows)
        self._points, self._words_of = points, words_of
        self._status = ["missing"] * n
        self._message = [STATUSES["missing"]] * n
        self._warnings = [""] * n
        self._kernels: set[str] = set()
        self._rows: dict[Layout, list[_Row]] = {}
        self.counted = Counter(missing=n)  #: Runs by status.

    def add(self, run: int, outcome: Outcome) -> None:
        """Put in the outcome of a run."""
        self.counted[self._status[run]] -= 1
        self.counted[outcome.status] += 1
        self._status[run], self._message[run] = outcome.status, outcome.message
        self._warnings[run] = outcome.warnings
        if outcome.kernels:
            self._kernels.add(outcome.kernels)
        if outcome.status == "finished":
            self._rows.setdefault(as_layout(outcome.layout), []).append((run, *outcome.value))

    def dataset(self, attributes: dict[str, str]) -> Any:
        """Return the table; it does not depend on the order in which runs were done."""
        xarray = optional_module("xarray", "beltdyn.sweep", "sweep")
        joined = _Joined([*self._points.names, *self._points.dims])
        kept: list[tuple[Layout, list[_Row]]] = []
        status, message = list(self._status), list(self._message)
        for layout, rows in sorted(
            self._rows.items(), key=lambda item: min(run for run, *_ in item[1])
        ):
            misfit = joined.join(layout)
            if misfit:
                for run, *_ in rows:
                    status[run], message[run] = "measure", misfit
            else:
                kept.append((layout, rows))
        dims, shape = self._points.dims, self._points.shape
        data: dict[str, Any] = {}
        for name, values in joined.filled(kept, len(self._points.rows)).items():
            one = joined.quantities[name]
            own = tuple(axis.name for axis in one.axes)
            described = _described(one.units, one.text)
            data[name] = ((*dims, *own), values.reshape(*shape, *values.shape[1:]), described)
        for name, values, text in (
            ("status", status, "; ".join(f"{one}: {said}" for one, said in STATUSES.items())),
            ("message", message, "why a run did not finish"),
            ("warnings", self._warnings, "warnings of the run, one in a line"),
        ):
            # Of any length: one long message is not to make room in all runs.
            texts = np.array(values, dtype=str if name == "status" else object)
            data[name] = (dims, texts.reshape(shape), {"long_name": text})
        coords: dict[str, Any] = self._coordinates()
        for axis in joined.axes.values():
            if axis.labels:
                described = _described(axis.units, axis.text)
                coords[axis.name] = ((axis.name,), np.array(axis.labels), described)
        kernels = ", ".join(sorted(self._kernels))
        return xarray.Dataset(data, coords, {**attributes, "kernels": kernels})

    def _coordinates(self) -> dict[str, Any]:
        points = self._points
        coords: dict[str, Any] = {}
        if not points.axes:
            coords[RUN] = ((RUN,), np.arange(len(points.rows)), {"long_name": "number of the run"})
        for k, name in enumerate(points.names):
            values = points.axes[k] if points.axes else [row[k] for row in points.rows]
            dim = name if points.axes else RUN
            coords[name] = ((dim,), _column(values), _described(*self._words_of[name]))
        return coords


def _described(units: str, text: str) -> dict[str, str]:
    return {key: value for key, value in (("units", units), ("long_name", text)) if value}


def _column(values: Sequence[Any]) -> Any:
    """Return swept values as an array of numbers or, if they are something else, of texts."""
    kinds = {type(one) for one in values}
    for dtype, of in ((np.bool_, {bool}), (np.int64, {int}), (np.float64, {int, float})):
        if kinds <= of:
            return np.array(values, dtype=dtype)
    return np.array([one if isinstance(one, str) else in_text(one) for one in values], dtype=str)


def _apart(layout: Layout, numbers: Array, words: Sequence[Any]) -> Iterator[tuple[Quantity, Any]]:
    """Take rows apart: yield each quantity and its values (n, ...)."""
    texts = np.array(words, dtype=object)
    at = {False: 0, True: 0}
    for one in layout:
        begin, at[one.words] = at[one.words], at[one.words] + one.size
        values = (texts if one.words else numbers)[:, begin : at[one.words]]
        yield one, values.reshape(len(numbers), *one.shape)


class _Joined:
    """The quantities of rows of several layouts in one table."""

    def __init__(self, taken: Sequence[str]) -> None:
        self._taken = {*taken, "status", "message", "warnings"}
        self.axes: dict[str, Axis] = {}
        self.quantities: dict[str, Quantity] = {}

    def join(self, layout: Layout) -> str:
        """Add the quantities of a layout; if they do not fit, add none and return a message."""
        axes, quantities = dict(self.axes), dict(self.quantities)
        for one in layout:
            known = quantities.get(one.name)
            names = [axis.name for axis in one.axes]
            if one.name in self._taken or self._taken & set(names):
                return f"{one.name}: this name is that of something swept, or of an axis"
            if known is not None and (
                known.words != one.words or [axis.name for axis in known.axes] != names
            ):
                return f"{one.name} has other axes than in the first runs"
            for axis in one.axes:
                before = axes.get(axis.name)
                if before is None:
                    axes[axis.name] = axis
                elif before.named and axis.named:
                    labels = tuple(dict.fromkeys((*before.labels, *axis.labels)))
                    axes[axis.name] = before._replace(labels=labels, size=len(labels))
                elif before.size != axis.size:
                    return (
                        f"{one.name} has {axis.size} values along {axis.name!r}, "
                        f"{before.size} in the first runs"
                    )
                elif before.labels != axis.labels:
                    return f"{one.name} has other values of {axis.name!r} than the first runs" + (
                        ": give t_eval" if axis.name == "time" else ""
                    )
            if known is None:
                quantities[one.name] = one
            elif one.units and not known.units:
                quantities[one.name] = known._replace(units=one.units)
        self.axes, self.quantities = axes, quantities
        return ""

    def filled(self, rows: Sequence[tuple[Layout, list[_Row]]], n: int) -> dict[str, Any]:
        """Return the values (n, ...) of each quantity, NaN or "" where there are none."""
        found: dict[str, Any] = {}
        for name, one in self.quantities.items():
            shape = (n, *(self.axes[axis.name].size for axis in one.axes))
            found[name] = np.full(shape, "", dtype=object) if one.words else np.full(shape, np.nan)
        for layout, of in rows:
            runs, numbers, words = zip(*of, strict=True)
            for one, values in _apart(layout, np.array(numbers), words):
                places = [np.array(runs)]
                for axis in one.axes:
                    joined = self.axes[axis.name]
                    where = {label: k for k, label in enumerate(joined.labels)}
                    named = (
                        [where[label] for label in axis.labels] if axis.named else range(axis.size)
                    )
                    places.append(np.array(named, dtype=int))
                found[one.name][np.ix_(*places)] = values
        return {
            name: values.astype(str) if values.dtype == object else values
            for name, values in found.items()
        }
