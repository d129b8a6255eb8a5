"""A report as single numbers, one to a row."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import attrs

from ..base.described import unit_of
from ..drive.mounts import KINDS
from .rows import Creep, Cycle, MountRow, Power, PulleyRow, ReportData, SpanRow, Spread

__all__ = ["Number", "numbers", "quantities"]


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


def _of_run() -> list[str]:
    """List the fields of a report that are numbers of the run as a whole, and its driver."""
    kinds = ("int", "float", "float | None", "Spread | None", "str | None")
    fields: Any = attrs.fields(ReportData)
    return [one.name for one in fields if str(one.type) in kinds]


def quantities(part: str) -> list[str] | None:
    """List the quantities that :func:`numbers` may have of a part; None if there is none.

    All of a quantity: its mean, and " least" and " most" of one that has a range.
    """
    if part == "report":
        return [*_of_run(), "belt_speeds least", "belt_speeds most", "first_to_slip", "steady"]
    if part not in _ROWS:
        return None
    found: list[str] = []
    kind: Any = _ROWS[part]
    for field in attrs.fields(kind):
        if field.name != "name":
            spread, two = "Spread" in str(field.type), "tuple" in str(field.type)
            ends = (" tight", " slack") if two else ("", *((" least", " most") if spread else ()))
            found += [f"{field.name}{end}" for end in ends]
    return [*found, "slower"] if part == "creep" else found


def _unit(row: Any, field: str) -> str:
    unit = unit_of(type(row), field)
    return KINDS[row.kind].unit(unit) if isinstance(row, MountRow) else unit


def numbers(report: ReportData) -> list[Number]:
    """Return all numbers and texts, angles in rad: part, name, quantity, unit, value, text.

    Of the run itself as part "report": its window, driver and belt speed, whether it is steady, the
    notes and warnings. A text has the value NaN; yes and no are 1 and 0, with the text.
    """
    found = []

    def add(part: str, name: str, quantity: str, unit: str, value: Any) -> None:
        if isinstance(value, bool):
            found.append(Number(part, name, quantity, "1", float(value), "yes" if value else "no"))
        elif isinstance(value, str):
            found.append(Number(part, name, quantity, "", math.nan, value))
        elif isinstance(value, Spread):
            for suffix, one in (("", "mean"), (" least", "least"), (" most", "most")):
                add(part, name, quantity + suffix, unit, getattr(value, one))
        elif isinstance(value, tuple):
            for suffix, one in zip((" tight", " slack"), value, strict=True):
                add(part, name, quantity + suffix, unit, one)
        elif value is not None:
            found.append(Number(part, name, quantity, unit, float(value), None))

    for field in _of_run():
        add("report", "", field, unit_of(ReportData, field), getattr(report, field))
    first = report.first_to_slip
    add("report", "", "first_to_slip", "", None if first is None else first.name)
    add("report", "", "steady", "", not report.unsteady)
    for field in ("unsteady", "notes", "warnings"):
        for k, text in enumerate(getattr(report, field)):
            add("report", str(k), field, "", str(text))
    for part in _ROWS:
        for index, row in enumerate(getattr(report, part)):
            name = getattr(row, "name", f"class {index}")
            for field, value in attrs.asdict(row, recurse=False).items():
                if field == "link_passing" and row.frequency is None:
                    continue
                if field == "link_passing" and value is None:
                    value = "may be"
                if field != "name":
                    add(part, name, field, _unit(row, field), value)
            if isinstance(row, Creep):
                add(part, name, "slower", "1", row.slower)
    return found
