"""A report as single numbers, one to a row."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import attrs

from ..base.described import unit_of
from ..drive.mounts import KINDS
from .rows import Creep, Cycle, MountRow, Power, PulleyRow, ReportData, SpanRow, Spread


class Number(NamedTuple):
    """A number or a text of a report, with its name and unit: a row of ``Report.to_frame()``."""

    part: str
    name: str
    quantity: str
    unit: str
    value: float
    text: str | None


#: The classes of the rows of each part.
_ROWS: dict[str, type] = {
    "pulleys": PulleyRow,
    "spans": SpanRow,
    "mounts": MountRow,
    "creep": Creep,
    "powers": Power,
    "cycles": Cycle,
}


#: Ends of the names of what a field consists of, by the name of its type.
_ENDS = {
    "Spread | None": ("", " least", " most"),
    "tuple[float, float] | None": (" tight", " slack"),
}
#: What follows from the fields of a part.
DERIVED: dict[str, dict[str, Callable[[Any], Any]]] = {
    "report": {
        "first_to_slip": lambda report: report.first_to_slip and report.first_to_slip.name,
        "steady": lambda report: not report.unsteady,
    },
    "creep": {"slower": lambda row: row.slower},
}


def _fields(part: str) -> dict[str, tuple[str, ...]]:
    """Return the fields of a part that are numbers or texts, with the ends of what is in each."""
    kind: Any = _ROWS.get(part, ReportData)
    types = {one.name: str(one.type) for one in attrs.fields(kind) if one.name != "name"}
    if kind is ReportData:  # of the run as a whole, and its driver
        of_run = ("int", "float", "float | None", "Spread | None", "str | None")
        types = {name: one for name, one in types.items() if one in of_run}
    return {name: _ENDS.get(one, ("",)) for name, one in types.items()}


def quantities(part: str) -> list[str]:
    """List the quantities that :func:`numbers` may have of a part."""
    found = [f"{name}{end}" for name, ends in _fields(part).items() for end in ends]
    return [*found, *DERIVED.get(part, ())]


def numbers(report: ReportData) -> list[Number]:
    """Return all numbers and texts, angles in rad.

    Of the run itself as part "report": its window, driver and belt speed, whether it is steady, the
    notes and warnings. A text has the value NaN; yes and no are 1 and 0, with the text.
    """
    found = list(_numbers_of("report", "", report))
    for field in ("unsteady", "notes", "warnings"):
        for k, text in enumerate(getattr(report, field)):
            found.append(_number("report", str(k), field, str(text)))
    for part in _ROWS:
        for k, row in enumerate(getattr(report, part)):
            found += _numbers_of(part, getattr(row, "name", f"class {k}"), row)
    return found


def _numbers_of(part: str, name: str, row: Any) -> Iterator[Number]:
    """Yield what is known of a row."""
    for field, ends in _fields(part).items():
        value, unit = getattr(row, field), unit_of(type(row), field)
        if isinstance(row, MountRow):
            unit = KINDS[row.kind].unit(unit)
        if field == "link_passing" and value is None:
            value = "may be"
        if field == "link_passing" and row.frequency is None:
            continue
        parts = attrs.astuple(value) if isinstance(value, Spread) else value
        for end, one in zip(ends, parts if isinstance(parts, tuple) else (value,), strict=False):
            if one is not None:
                yield _number(part, name, field + end, one, unit)
    for field, derived in DERIVED.get(part, {}).items():
        if (value := derived(row)) is not None:
            yield _number(part, name, field, value, "1")


def _number(part: str, name: str, quantity: str, value: Any, unit: str = "") -> Number:
    if isinstance(value, bool):
        return Number(part, name, quantity, "1", float(value), "yes" if value else "no")
    if isinstance(value, str):
        return Number(part, name, quantity, "", math.nan, value)
    return Number(part, name, quantity, unit, float(value), None)
