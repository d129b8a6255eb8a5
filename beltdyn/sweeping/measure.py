"""Measured quantities of a run of a sweep: by name, or by a function of the user's."""

from __future__ import annotations

import numbers
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array, close_to, share_of_run
from ..base.naming import index_of
from ..drive.params import Params
from ..outputs.histories import Stats, absent_groups
from ..outputs.quantity import QUANTITIES, dimensions
from ..outputs.quantity import Quantity as RunQuantity
from ..report import flat, make_report
from ..report.window import Window
from ..result.labelled import places, unit_in
from ..result.result import Result
from .outcomes import Axis, Layout, Quantity, packed

#: What is measured if nothing is asked for.
DEFAULT = (
    "report.pulleys.speed",
    "report.pulleys.torque",
    "report.pulleys.power",
    "report.pulleys.hub_load",
    "report.spans.tension",
    "report.spans.tension least",
    "report.spans.tension most",
    "report.creep.lost",
    "report.efficiency",
)
#: What a history is reduced to over the last part of a run.
_REDUCED = {
    "mean": "mean of",
    "least": "least",
    "most": "largest",
    "rms": "root mean square of",
    "final": "last",
}
#: Parts of a report and the axis of their rows; load cycles differ in number from run to run.
_PARTS = {
    "pulleys": "pulley",
    "spans": "span",
    "mounts": "mount",
    "creep": "pulley",
    "powers": "part",
}
#: Quantities of a report that looking for margins to slip gives.
_OF_MARGINS = {"margin", "least_margin", "own_margin", "slip_torque", "slip_tensions"}
_OF_MARGINS |= {"worst_time", "sticking_margin", "own_slip_torque", "first_to_slip"}

Found = tuple[Quantity, Any]


@attrs.frozen
class Measure:
    """What to measure."""

    named: tuple[tuple[str, str], ...]  # quantities: what each is called in the result, its name
    #: The user's functions, beside them; None: what it is called follows from what it returns.
    functions: tuple[tuple[str | None, Callable[[Result], Any]], ...]
    last: float  # the part of a run that reports, means and extremes are of
    outputs: tuple[str, ...] | None  # what runs have to compute and keep; None: everything

    @property
    def names(self) -> set[str]:
        """Names of the quantities, as far as they are known before a run."""
        return {called for called, _ in (*self.named, *self.functions) if called is not None}

    @property
    def in_python(self) -> bool:
        """Whether measuring takes Python long enough to keep other threads waiting."""
        return any(_is_of_report(name) for _, name in self.named)

    def of(self, result: Result) -> tuple[Layout, Array, list[str]]:
        """Measure a run; raise what the user's function does, ValueError where this cannot be."""
        found: list[Found] = []
        report = _Report(result, self) if self.in_python else None
        for called, name in self.named:
            if report is not None and _is_of_report(name):
                found += report.find(called, name)
            else:
                quantity, value = _of_result(result, name, self.last)
                found.append((quantity._replace(name=called), value))
        for of_function, function in self.functions:
            value = function(result)
            if of_function is None and value is None:
                raise TypeError(f"{_called(function)} returned None: is a return missing?")
            if of_function is None and not isinstance(value, Mapping):
                of_function = _called(function)
            found += _given(of_function, value)
        return packed(found)


def _called(function: Callable[..., Any]) -> str:
    return getattr(function, "__name__", "measure").strip("<>")


def as_measure(measure: object, params: Params, last: object) -> Measure:
    """Look up what to measure."""
    share = share_of_run("last", last)
    if measure is None:
        measure = DEFAULT
    if callable(measure):
        return Measure((), ((None, measure),), share, None)
    if isinstance(measure, str):
        measure = (measure,)
    if isinstance(measure, Mapping):
        items = list(measure.items())
    elif isinstance(measure, Sequence):
        items = [(one, one) for one in measure]
    else:
        raise TypeError(
            "measure must be names of quantities, a mapping of names, or a function of the Result, "
            f"got {type(measure).__name__}"
        )
    named: list[tuple[str, str]] = []
    functions: list[tuple[str | None, Callable[[Result], Any]]] = []
    for called, what in items:
        if not isinstance(called, str):
            raise TypeError(f"measure: quantities are called by texts, got {called!r}")
        if callable(what):
            functions.append((called, what))
        elif isinstance(what, str):
            _check(what, params)
            named.append((called, what))
        else:
            raise TypeError(f"measure[{called!r}] must be a name or a function, got {what!r:.60}")
    if not named and not functions:
        raise ValueError("measure must hold at least one quantity")
    names = [name for _, name in named]
    outputs = None if functions or any(map(_is_of_report, names)) else _outputs(names)
    return Measure(tuple(named), tuple(functions), share, outputs)


# --- Reports --------------------------------------------------------------------------------------


def _is_of_report(name: str) -> bool:
    return name == "report" or name.startswith("report.")


#: A part of a report, a row of it, whose name may hold a dot, and a quantity.
_OF_REPORT = re.compile(rf"report(?:\.({'|'.join(_PARTS)})(?:\[(.*)\])?)?(?:\.(.+))?")


def _split_report(name: str) -> tuple[str, int | str | None, str]:
    """Split "report.pulleys[crank].margin" into part, row and quantity; "" stands for all."""
    match = _OF_REPORT.fullmatch(name)
    part, row, quantity = match.groups() if match else (None, None, name)
    if part is None and (head := re.match(r"[^.[]*(?=[.[])", quantity or "")):
        if head[0] in _PARTS:
            raise ValueError(f'{name!r}: rows are named like "report.pulleys[crank].margin"')
        raise ValueError(
            f"{name!r}: a report has the parts {', '.join(_PARTS)}{close_to(head[0], _PARTS)}"
        )
    at = int(row) if row and row.isdecimal() else row
    return part or (quantity and "report") or "", at, quantity or ""


class _Report:
    """The numbers of a report by part and quantity, of each those of its rows."""

    def __init__(self, result: Result, measure: Measure) -> None:
        wanted = [_split_report(name)[2] for _, name in measure.named if _is_of_report(name)]
        margins = any(one == "" or one.split(" ")[0] in _OF_MARGINS for one in wanted)
        report = make_report(result, measure.last, margins=margins)
        self._pulleys = result.params.pulley_names
        self._found: dict[tuple[str, str], dict[str, flat.Number]] = {}
        self._rows: dict[str, dict[str, None]] = {}
        for one in flat.numbers(report):
            if one.part in _PARTS or (one.part == "report" and one.name == ""):
                self._found.setdefault((one.part, one.quantity), {})[one.name] = one
                self._rows.setdefault(one.part, {})[one.name] = None

    def find(self, called: str, name: str) -> Iterator[Found]:
        """Yield the quantities that a name stands for, by which it is called in the result."""
        part, row, quantity = _split_report(name)
        there = [at for at in self._found if part in ("", at[0]) and quantity in ("", at[1])]
        # A drive may have it, only not this run: a margin without a load.
        for of, one in there or [(part, quantity)]:
            more = [of] * (part == "" and of != "report") + [one] * (quantity == "")
            found, value = self._quantity(of, one, row)
            yield found._replace(name=".".join([called, *more])), value

    def _quantity(self, part: str, quantity: str, row: int | str | None) -> Found:
        found = self._found.get((part, quantity), {})
        rows = found.values()
        words = bool(found) and all(one.text is not None and one.unit == "" for one in rows)
        units = next((one.unit for one in rows if one.unit), "")
        values = {name: one.text if words else one.value for name, one in found.items()}
        nothing: Any = "" if words else np.nan
        if part == "report":
            return Quantity("", (), units, quantity, words), values.get("", nothing)
        text = f"{quantity} ({part})"
        by_pulley = _PARTS.get(part) == "pulley"
        names = [*self._pulleys] if by_pulley else [*self._rows.get(part, {})]
        if row is not None:
            if isinstance(row, int) and row < len(names):
                row = names[row]
            return Quantity("", (), units, text, words), values.get(str(row), nothing)
        axis = Axis(_PARTS[part], tuple(names), len(names))
        return Quantity("", (axis,), units, text, words), [values.get(n, nothing) for n in names]


# --- Histories ------------------------------------------------------------------------------------


_STATS = [one.name for one in attrs.fields(Stats)]
#: Histories by name.
_HISTORIES = {
    **QUANTITIES,
    "slip": RunQuantity("slip", "PULLEYS", "1", "speed lost against pulley 0", "speed lost"),
}


def _split(name: str) -> tuple[str, str | None]:
    """Split a name into that of a history and of its reduction, as "mean"."""
    if name in _HISTORIES:
        return name, None
    history, _, how = name.rpartition(".")
    if history in _HISTORIES and how in _REDUCED:
        return history, how
    reduced = [f"{one}.{how}" for one in _HISTORIES for how in _REDUCED]
    near = close_to(name, [*_HISTORIES, *reduced, *(f"stats.{one}" for one in _STATS)])
    raise ValueError(
        f"measure: nothing is called {name!r}{near}; there are report.<part>.<quantity>, histories "
        f'such as "span_tension", alone or with .{", .".join(_REDUCED)}, and stats.<counter>'
    )


def _check(name: str, params: Params) -> None:
    if _is_of_report(name):
        _check_of_report(name, params)
    elif name.startswith("stats."):
        field = name.removeprefix("stats.")
        if field not in _STATS:
            raise ValueError(f"measure: there is no {name!r}{close_to(field, _STATS)}")
    else:
        group = _split(name)[0].partition(".")[0]
        if group in absent_groups(params):
            raise ValueError(f"measure: {name}: this drive has no {group}")


def _check_of_report(name: str, params: Params) -> None:
    part, row, quantity = _split_report(name)
    if part == "":
        return
    known = flat.quantities(part)
    if quantity not in ("", *known):
        parts = [one for one in _PARTS if quantity in flat.quantities(one)]
        there = f" (did you mean 'report.{parts[0]}.{quantity}'?)" if parts else ""
        raise ValueError(
            f"measure: {name!r}: there is no {quantity!r}{there or close_to(quantity, known)} in "
            f"{part}; there are {', '.join(known)}"
        )
    if part == "mounts" and not params.mounted:
        raise ValueError(f"measure: {name}: this drive has no mounts")
    if row is not None and _PARTS[part] == "pulley":
        index_of(f"measure: {name!r}", row, params.pulley_names)


def _outputs(names: Sequence[str]) -> tuple[str, ...]:
    """Return what runs have to compute for histories and their reductions."""
    computed = {"energy": "energy", "slip": "pulleys.omega"}  # for all histories of a group
    histories = [_split(name)[0] for name in names if not name.startswith("stats.")]
    found = [computed.get(one.partition(".")[0], one) for one in histories]
    return tuple(dict.fromkeys(found)) or ("pulleys.omega",)


def _of_result(result: Result, name: str, last: float) -> Found:
    if name.startswith("stats."):
        value = getattr(result.stats, name.removeprefix("stats."))
        number = np.nan if value is None else value
        return Quantity(name, (), "", name, isinstance(value, str)), number
    history, how = _split(name)
    row = _HISTORIES[history]
    unit, text = unit_in(row, result.params), row.text
    values = np.asarray(result._history(history))
    axes = _axes(result, row.size)
    if how is None:
        time = Axis("time", tuple(map(float, result.t)), result.t.size, "s", "time")
        return Quantity(name, (time, *axes), unit, text), values
    window = Window.last(result, last)
    return Quantity(name, axes, unit, f"{_REDUCED[how]} {text}"), _reduced(window, values, how)


def _axes(result: Result, size: str) -> tuple[Axis, ...]:
    found = places(result.params)
    return tuple(
        Axis(dim, () if dim in ("link", "joint") else tuple(found[dim]), len(found[dim]))
        for dim in dimensions(size)
    )


def _reduced(window: Window, values: Array, how: str) -> Any:
    inside = np.asarray(values[window.rows], dtype=float)
    if how == "final":
        return inside[-1]
    if how == "mean":
        return window.mean(inside)
    if how == "rms":
        return np.sqrt(window.mean(inside**2))
    return (np.fmin if how == "least" else np.fmax).reduce(inside, axis=0)  # but NaN


# --- The user's -----------------------------------------------------------------------------------


def _given(name: str | None, value: Any) -> list[Found]:
    """Take the value of a function: a number, a text, an array, a labelled array, or several."""
    if isinstance(value, Mapping):
        before = "" if name is None else f"{name}."
        return [one for key, inner in value.items() for one in _given(f"{before}{key}", inner)]
    assert name is not None
    labelled = hasattr(value, "dims") and hasattr(value, "coords")  # an xarray.DataArray
    units, text = _described(value) if labelled else ("", "")
    values = value.values if labelled else np.nan if value is None else value
    if isinstance(values, str):
        return [(Quantity(name, (), units, text or name, True), values)]
    try:
        array = np.asarray(float(values) if isinstance(values, numbers.Real) else values)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "fiub":
        raise TypeError(
            f"{name} must be a number, a text or an array of numbers, got {type(value).__name__}"
        )
    axes: list[Axis] = []
    for k, size in enumerate(array.shape):
        axes.append(_axis(value, k, size) if labelled else Axis(f"{name}_{k}", (), size))
    return [(Quantity(name, tuple(axes), units, text or name), array)]


def _axis(labelled: Any, k: int, size: int) -> Axis:
    """Return an axis of an xarray.DataArray."""
    dim = labelled.dims[k]
    if dim not in labelled.coords:
        return Axis(str(dim), (), size)
    along = labelled.coords[dim]
    labels: Any = map(str if along.dtype.kind in "OU" else float, along.values)
    return Axis(str(dim), tuple(labels), size, *_described(along))


def _described(labelled: Any) -> tuple[str, str]:
    units, text = (str(labelled.attrs.get(key, "")) for key in ("units", "long_name"))
    return units, text
