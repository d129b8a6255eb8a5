"""The quantities of a report as tables print them: heading, unit and digits of each, once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from ..base.described import unit_of
from ..base.tables import Table
from ..drive.mounts import KINDS
from . import digits
from .digits import NONE, between, fixed, largest, number, or_nan, placed, within
from .rows import SCALES, Creep, Cycle, MountRow, Power, PulleyRow, ReportData, SpanRow, Spread

#: Speeds and angles below this are rounding [rad/s, rad], powers that much of the largest.
ROUNDING, _NOTHING = 1e-6, 1e-9
#: Part of the largest power that is as good as none: half a place of 100.00 %.
_PART = 5e-5
#: A part over the whole of what is put in, beyond which parts are no shares of it.
TURNED = 0.05
#: What the parts of a mount are called; its spring as its kind says.
_PARTS = {"travel": "travel", "to_stop": "to the nearer stop", "spring": ""} | {
    one: one for one in ("damper", "friction", "stop", "belt")
}

#: Of a row and with the factor of a unit: its text, or those of mean, least and most.
_Cells = Callable[[ReportData, Any, float], str | tuple[str, str, str]]


class Column(NamedTuple):
    """A quantity in tables; ``unit`` is printed in place of that of the field, if it is not ""."""

    words: str
    field: str
    cells: _Cells
    unit: str = ""


class Layout(NamedTuple):
    """A table."""

    title: str  # "{torque}" in it is the unit of a column, which its heading then has not
    part: str  # of the report
    names: str  # of columns; "torque:range" is the range of one, likewise ":least" and ":most"
    remarks: Callable[[ReportData], Iterable[str]] = lambda _: ()


def made(report: ReportData, layout: Layout) -> Table:
    """Print the rows of a part in a layout."""
    kind, columns = _COLUMNS[layout.part]
    if layout.part == "parts":  # what is known of mounts: row and field
        rows = [(row, one) for row in report.mounts for one in _PARTS if getattr(row, one)]
    else:
        rows = getattr(report, layout.part)
    title, heading, texts = layout.title, [], []
    for name in layout.names.split():
        key, _, end = name.partition(":")
        words, field, cells, unit = columns[key]
        unit = unit or (unit_of(kind, field) if field else "1")
        if end:
            heading.append(f"{words} {end}" if words.endswith(":") else end)
        else:
            bare = unit == "1" or f"{{{key}}}" in title
            heading.append(words if bare else f"{words} {unit}".strip())
        title = title.replace(f"{{{key}}}", unit)
        scale = SCALES.get(unit, 1.0)
        texts.append([_cell(cells(report, row, scale), end) for row in rows])
    remarks = tuple(layout.remarks(report)) if rows else ()
    return Table(title, tuple(heading), list(zip(*texts, strict=True)), remarks)


def _cell(texts: str | tuple[str, str, str], end: str) -> str:
    if isinstance(texts, str):
        return texts
    return between(texts[1:]) if end == "range" else texts[("", "least", "most").index(end)]


def has_shares(report: ReportData) -> bool:
    """Whether shares of what is put in say something: not where a drive lives on what it stored."""
    return all(abs(one.share or 0.0) <= 1.0 + TURNED for one in report.powers)


# --- Cells ----------------------------------------------------------------------------------------


def _named(_report: ReportData, row: Any, _scale: float) -> str:
    return str(row.name)


def _fixed(field: str, decimals: int) -> _Cells:
    return lambda _, row, scale: fixed(getattr(row, field), scale, decimals)


def _number(field: str, places: int) -> _Cells:
    return lambda _, row, __: number(getattr(row, field), places)


def _within(field: str, off: Callable[[ReportData, Any], float], places: int = 4) -> _Cells:
    """Return the cells of a number with its error."""
    return lambda report, row, _: within(getattr(row, field), off(report, row), places)


def _margin(field: str) -> _Cells:
    return lambda report, row, _: digits.margin(report, getattr(row, field))


def _tension(field: str, spans: float = 1.0) -> _Cells:
    return lambda report, row, _: digits.of_tension(report, getattr(row, field), spans)


def _off_belt_torque(report: ReportData, _row: PulleyRow) -> float:
    """Return the error of the torques of the belt on pulleys [N m], that of the largest."""
    return digits.of_loads(report.accuracy) * largest(one.belt_torque for one in report.pulleys)


def _off_slip_torque(report: ReportData, row: PulleyRow) -> float:
    """Return the error of the torque at which a pulley slips in full [N m]."""
    return digits.of_grip(report) * abs(row.slip_torque or 0.0)


def _off_string(report: ReportData, row: SpanRow) -> float:
    """Return the error of the frequency of a span as a moving string [Hz]."""
    pull = (row.tension.mean if row.tension else 0.0) - (report.mass_tension or 0.0)
    return 0.5 * (row.lateral or 0.0) * digits.tension_off(report) / pull if pull else math.nan


def _off_speed_ratio(report: ReportData, row: Creep) -> float:
    """Return the error of a ratio of speeds [1]; all of the creep where its own is not known."""
    lost = abs(row.slower) if report.creep_error is None else _off_creep(report)
    return lost * abs(row.ratio)


def _off_creep(report: ReportData) -> float:
    """Return the error of speeds lost [1], relative to the largest."""
    return (report.creep_error or 0.0) * largest(one.slower for one in report.creep)


def _torque(report: ReportData, row: PulleyRow, _scale: float) -> tuple[str, str, str]:
    """Return mean, least and most of the torque that is set, or that a speed needs."""
    return placed(row.torque, 0.0 if digits.given(row.torque) else digits.of_loads(report.accuracy))


def _off_history(report: ReportData, _row: Cycle) -> float:
    """Return the error of tensions over time [N]."""
    share = or_nan(report.accuracy["tension"].known)
    return digits.tension_off(report) * share / (report.tension_error or share)


def drop_rounding(value: Spread | None, least: float) -> Spread | None:
    """Return a spread with numbers below rounding set to 0."""
    if value is None:
        return None
    ends = (value.mean, value.least, value.most)
    return Spread(*(0.0 if abs(one) < least else one for one in ends))


def _speed(report: ReportData, row: PulleyRow, scale: float) -> tuple[str, str, str]:
    return placed(drop_rounding(row.speed, ROUNDING), digits.of_speed(report, row), scale)


def _power(report: ReportData, row: PulleyRow, _scale: float) -> str:
    """Print a pulley's power; its error is relative to the largest."""
    most = largest(one.power.mean for one in report.pulleys if one.power)
    value = drop_rounding(row.power, _NOTHING * most)
    return within(value.mean if value else None, or_nan(report.power_error) * most)


def _lost(report: ReportData, row: PulleyRow, scale: float) -> str:
    """Print the speed that a pulley loses; its error is relative to the largest."""
    slower = next((scale * one.slower for one in report.creep if one.name == row.name), None)
    known = report.creep_error is not None
    return within(slower, scale * _off_creep(report) if known else math.nan)


def _direction(_report: ReportData, row: PulleyRow, scale: float) -> str:
    shown = fixed(row.hub_direction, scale, 0)
    return "180" if shown == "-180" else shown


def _slip_arc(field: str) -> _Cells:
    """Return the cells of the arc of slip or its error [deg], to tenths where that allows."""

    def cells(_report: ReportData, row: PulleyRow, _scale: float) -> str:
        if row.slip_arc is None or row.slip_error is None:
            return NONE
        decimals = 0 if math.degrees(row.slip_error) >= 1.0 else 1
        return fixed(getattr(row, field), SCALES["deg"], decimals)

    return cells


def _slip_share(_report: ReportData, row: PulleyRow, scale: float) -> tuple[str, str, str]:
    """Print the share of the wrap that slips, "slack" where it is infinite."""
    mean, ends = fixed(row.slip_share, scale, 0), row.slip_range
    if ends is None:
        return mean, NONE, NONE
    least, most = (
        "slack" if math.isinf(one) else fixed(one, scale, 0) for one in (ends.least, ends.most)
    )
    return mean, least, most


def _used(report: ReportData, row: PulleyRow, scale: float) -> tuple[str, str, str]:
    mean, *ends = digits.used(report, row, scale)
    least, most = ends if row.used_range is not None else (NONE, NONE)
    return (mean if row.used is not None else NONE), least, most


def _line(report: ReportData, row: SpanRow, _scale: float) -> str:
    mark = " ?" if row.link_passing is None else " *" if row.link_passing else ""
    return NONE if row.frequency is None else digits.line_frequency(report, row) + mark


def _line_of_drive(report: ReportData, row: SpanRow, scale: float) -> str:
    return "mesh" if row.link_passing else _line(report, row, scale)


def _of_run(report: ReportData, row: SpanRow, _scale: float) -> tuple[str, str, str]:
    ends = row.of_run
    return (NONE,) * 3 if ends is None else digits.of_tension(report, row.tension, ends=ends)


def _of_mount(report: ReportData, row: MountRow, field: str) -> tuple[str, str, str]:
    """Print a travel or force of a mount, with the error of two spans; paths are exact."""
    share = 2.0 * or_nan(report.tension_error) if KINDS[row.kind].moves else 0.0
    return placed(getattr(row, field), share, _shown((row, field))[0])


def _name_and_unit(_report: ReportData, row: MountRow, _scale: float) -> str:
    return f"{row.name}, {KINDS[row.kind].shown[1]}"


def _shown(part: tuple[MountRow, str]) -> tuple[float, str]:
    """Return factor and unit in which a part of a mount is printed."""
    kind = KINDS[part[0].kind]
    return kind.shown if part[1] in ("travel", "to_stop") else (1.0, kind.force)


def _part_name(_report: ReportData, part: tuple[MountRow, str], _scale: float) -> str:
    row, field = part
    return f"{row.name}, {_PARTS[field] or KINDS[row.kind].spring}"


def _part_line(report: ReportData, part: tuple[MountRow, str], _scale: float) -> str:
    row, field = part
    swings = field == "travel" and row.frequency is not None
    return digits.line_frequency(report, row) if swings else ""


def _part_amplitude(report: ReportData, part: tuple[MountRow, str], scale: float) -> str:
    amplitude = _shown(part)[0] * (part[0].amplitude or 0.0)
    return number(amplitude, 2) if _part_line(report, part, scale) else ""


def _cause(field: str) -> _Cells:
    """Return the cells of a part of the speed lost [%], with the decimals of the whole."""

    def cells(report: ReportData, row: Creep, _scale: float) -> str:
        most = 100.0 * largest(one.slower for one in report.creep)
        shown = within(most, or_nan(report.creep_error) * most)
        share = row.slower if field == "slower" else row.as_share * getattr(row, field)
        return fixed(share, 100.0, min(3, len(shown.partition(".")[2])))

    return cells


def _who(_report: ReportData, row: Power, _scale: float) -> str:
    kinds = {"in": "put in by", "out": "taken off by", "lost": "lost:"}
    return f"{kinds.get(row.kind, '')} {row.name}".strip()


def _watts(report: ReportData, row: Power, _scale: float) -> str:
    nothing = _PART * largest(one.power for one in report.powers)
    return _part_of_power(report, row, row.power, min(0.005, nothing))


def _share(report: ReportData, row: Power, scale: float) -> str:
    known = row.share is not None and has_shares(report)
    return _part_of_power(report, row, scale * (row.share or 0.0), 0.005) if known else NONE


def _part_of_power(report: ReportData, row: Power, value: float, least: float) -> str:
    if abs(value) <= least:
        return "0.00"
    if row.kind == "lost":
        return digits.loss(report, row.power, value)
    of_pulleys = ("in", "out")
    error = or_nan(report.power_error) if row.kind in of_pulleys else math.nan
    most = largest(one.power for one in report.powers if one.kind in of_pulleys)
    return within(value, error * most * abs(value / row.power))


# --- The table ------------------------------------------------------------------------------------

_PULLEYS = {
    "name": Column("pulley", "", _named),
    "turns": Column("", "speed", _speed, "1/min"),
    "speed": Column("", "speed", _speed),
    "lost": Column("lost", "", _lost, "%"),
    "torque": Column("torque", "torque", _torque),
    "power": Column("power", "power", _power),
    "load": Column("hub load", "hub_load", _tension("hub_load", 2.0)),
    "direction": Column("to", "hub_direction", _direction, "deg"),
    "wrap": Column("wrap", "wrap", _fixed("wrap", 1), "deg"),
    "arc": Column("slip arc", "slip_arc", _slip_arc("slip_arc"), "deg"),
    "arc_error": Column("+-", "", _slip_arc("slip_error")),
    "share": Column("of wrap", "", _slip_share, "%"),
    "belt_torque": Column("torque", "belt_torque", _within("belt_torque", _off_belt_torque)),
    "ratio": Column("ratio", "ratio", _within("ratio", digits.of_ratio, 3)),
    "limit": Column("limit", "limit", _number("limit", 3)),
    "used": Column("used", "", _used, "%"),
    "most_used": Column("used", "", lambda report, row, _: digits.most_used(report, row), "%"),
    "margin": Column("margin", "margin", _margin("margin")),
    "worst": Column("worst", "least_margin", _margin("least_margin")),
    "own": Column("own", "own_margin", _margin("own_margin")),
    "slips": Column("slips at", "slip_torque", _within("slip_torque", _off_slip_torque)),
}
_SPANS = {
    "name": Column("span", "", _named),
    "length": Column("", "length", _fixed("length", 1), "mm"),
    "tension": Column("tension", "tension", _tension("tension")),
    "mean": Column("mean tension", "tension", _tension("tension")),
    "of_run": Column("run:", "of_run", _of_run),
    "line": Column("line", "frequency", _line),
    "line_of_drive": Column("line", "frequency", _line_of_drive),
    "amplitude": Column("+-", "amplitude", _number("amplitude", 2)),
    "string": Column("string", "lateral", _within("lateral", _off_string)),
    "string_3": Column("string", "lateral", _within("lateral", _off_string, 3)),
}
_MOUNTS = {
    "name": Column("mount: travel from its place", "", _name_and_unit),
    "travel": Column("mean", "", lambda report, row, _: _of_mount(report, row, "travel")),
    "stop": Column(_PARTS["to_stop"], "", lambda report, row, _: _of_mount(report, row, "to_stop")),
}
_PARTS_OF_MOUNTS = {
    "part": Column("mount", "", _part_name),
    "unit": Column("in", "", lambda _, part, __: _shown(part)[1]),
    "value": Column("mean", "", lambda report, part, _: _of_mount(report, *part)),
    "line": Column("line", "frequency", _part_line),
    "amplitude": Column("+-", "", _part_amplitude),
}
_CREEP = {
    "name": Column("pulley", "", _named),
    "ratio": Column("ratio", "ratio", _within("ratio", _off_speed_ratio)),
    "lost": Column("lost", "", _cause("slower"), "%"),
    "stretch": Column("= stretch", "stretch", _cause("stretch")),
    "friction": Column("+ friction", "friction", _cause("friction")),
    "radius": Column("+ radius", "radius", _cause("radius")),
    "remainder": Column("+ remainder", "remainder", _cause("remainder")),
}
_POWERS = {
    "name": Column("", "", _who),
    "power": Column("", "power", _watts),
    "share": Column("", "share", _share, "%"),
}
_CYCLES = {
    "range": Column("range", "range", _within("range", _off_history)),
    "mean": Column("mean", "mean", _within("mean", _off_history)),
    "count": Column("cycles", "count", lambda _, row, __: f"{row.count:g}"),
}
_COLUMNS: dict[str, tuple[type, dict[str, Column]]] = {
    "pulleys": (PulleyRow, _PULLEYS),
    "spans": (SpanRow, _SPANS),
    "mounts": (MountRow, _MOUNTS),
    "parts": (MountRow, _PARTS_OF_MOUNTS),
    "creep": (Creep, _CREEP),
    "powers": (Power, _POWERS),
    "cycles": (Cycle, _CYCLES),
}
