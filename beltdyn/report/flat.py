"""A report as single numbers, one to a row."""

from __future__ import annotations

import math
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
    further = {"report": ["first_to_slip", "steady"], "creep": ["slower"]}
    found = [f"{name}{end}" for name, ends in _fields(part).items() for end in ends]
    return found + further.get(part, [])


def numbers(report: ReportData) -> list[Number]:
    """Return all numbers and texts, angles in rad.

    Of the run itself as part "report": its window, driver and belt speed, whether it is steady, the
    notes and warnings. A text has the value NaN; yes and no are 1 and 0, with the text.
    """
    found = []

    def add(part: str, name: str, quantity: str, value: Any, unit: str = "") -> None:
        if isinstance(value, bool):
            found.append(Number(part, name, quantity, "1", float(value), "yes" if value else "no"))
        elif isinstance(value, str):
            found.append(Number(part, name, quantity, "", math.nan, value))
        elif value is not None:
            found.append(Number(part, name, quantity, unit, float(value), None))

    def add_fields(part: str, name: str, row: Any) -> None:
        for field, ends in _fields(part).items():
            value, unit = getattr(row, field), unit_of(type(row), field)
            if isinstance(row, MountRow):
                unit = KINDS[row.kind].unit(unit)
            if field == "link_passing" and value is None:
                value = "may be"
            if field != "link_passing" or row.frequency is not None:
                parts = attrs.astuple(value) if isinstance(value, Spread) else value
                parts = parts if isinstance(parts, tuple) else (value,)
                for end, one in zip(ends, parts, strict=False):
                    add(part, name, field + end, one, unit)

    add_fields("report", "", report)
    add("report", "", "first_to_slip", report.first_to_slip and report.first_to_slip.name)
    add("report", "", "steady", not report.unsteady)
    for field in ("unsteady", "notes", "warnings"):
        for k, text in enumerate(getattr(report, field)):
            add("report", str(k), field, str(text))
    for part in _ROWS:
        for index, row in enumerate(getattr(report, part)):
            name = getattr(row, "name", f"class {index}")
            add_fields(part, name, row)
            if isinstance(row, Creep):
                add(part, name, "slower", row.slower, "1")
    return found
