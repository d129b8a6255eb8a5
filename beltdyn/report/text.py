"""How a report is printed: tables of at most 100 columns, the same in HTML, and single numbers."""

from __future__ import annotations

import html as escape
import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import attrs

from .rows import PulleyRow, Spread, Told

__all__ = ["Table", "html", "lines", "numbers", "tables"]

_WIDTH = 98
_TO_RPM = 30.0 / math.pi
#: What stands for a value that is not known or does not apply.
_NONE = "-"
#: Part of the speed lost that may remain unexplained, and speeds lost that are as good as none.
DOUBT, FAINT = 0.1, 1e-5
#: Links on a wrap from which on arcs and ratios are right to some percent.
LINKS = 3.0


class Table(NamedTuple):
    """A table: title, heading, rows, and remarks below it."""

    title: str
    heading: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    remarks: tuple[str, ...] = ()


def _number(value: float | None, digits: int = 4) -> str:
    """Give a number with that many digits, none as an exponent where it can be read without."""
    if value is None or math.isnan(value):
        return _NONE
    if math.isinf(value):
        return "none"
    size = abs(value)
    if size == 0.0:
        return "0"
    if 1e-3 <= size < 1e6:
        shown = f"{value:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"
        return shown
    return f"{value:.{digits - 1}e}"


def _range(value: Spread | None, digits: int = 4, scale: float = 1.0) -> str:
    if value is None:
        return _NONE
    ends = sorted((scale * value.least, scale * value.most))
    return f"{_number(ends[0], digits)} to {_number(ends[1], digits)}"


def _mean(value: Spread | None, digits: int = 4, scale: float = 1.0) -> str:
    return _NONE if value is None else _number(scale * value.mean, digits)


def _percent(share: float | None, decimals: int = 1) -> str:
    return _NONE if share is None else _signed(f"{100.0 * share:.{decimals}f}")


def _signed(shown: str) -> str:
    """Give a number without the sign of a zero."""
    return shown.removeprefix("-") if not shown.strip("-0.") else shown


def _direction(degrees: float | None) -> str:
    if degrees is None:
        return _NONE
    shown = _signed(f"{degrees:.0f}")
    return "180" if shown == "-180" else shown


def _degrees(angle: float | None) -> str:
    return _NONE if angle is None else f"{math.degrees(angle):.1f}"


def tables(report: Told) -> Iterator[Table]:
    """Give the tables of a report in which there is something."""
    parts = (
        (_motion, report.pulleys),
        (_loads, report.pulleys),
        (_slip, report.pulleys),
        (_spans, report.spans),
        (_creep, report.creep),
        (_powers, report.powers),
        (_cycles, report.cycles),
    )
    for table, rows in parts:
        made = table(report) if rows else None
        if made is not None and any(cell != _NONE for row in made.rows for cell in row[1:]):
            yield made


def _motion(report: Told) -> Table:
    rows = [
        (
            row.name,
            _mean(row.speed, 5, _TO_RPM),
            _mean(row.speed, 5),
            _range(row.speed, 5),
            _mean(row.torque),
            _range(row.torque, 3),
            _mean(row.power),
        )
        for row in report.pulleys
    ]
    heading = ("pulley", "1/min", "rad/s", "range", "torque N m", "range", "power W")
    return Table("Speed, torque, power (counter-clockwise, and put in, positive)", heading, rows)


def _loads(report: Told) -> Table:
    rows = [
        (
            row.name,
            _mean(row.hub_load),
            _range(row.hub_load, 3),
            _direction(row.hub_direction),
            _degrees(row.wrap),
            _degrees(row.slip_arc),
            _percent(row.slip_share, 0),
            _percents(row.slip_range),
        )
        for row in report.pulleys
    ]
    heading = (
        "pulley",
        "hub load N",
        "range",
        "towards deg",
        "wrap deg",
        "slip arc deg",
        "% of wrap",
        "range",
    )
    few = [f"{row.name} {row.links:.1f}" for row in report.pulleys if (row.links or LINKS) < LINKS]
    remarks: tuple[str, ...] = ()
    if few:
        remarks = (
            f"Links on the wrap: {', '.join(few)}. So few make arcs, tensions beside them and "
            "ratios coarse: take more links.",
        )
    title = "Hub loads; wrap by the belt line; slip by the links in contact"
    return Table(title, heading, rows, remarks)


def _slip(report: Told) -> Table:
    rows = [
        (
            row.name,
            _number(row.belt_torque),
            _number(row.ratio, 3),
            _number(row.limit, 3),
            _percent(row.used, 0),
            _percents(row.used_range),
            _margin(row.margin),
            _margin(row.least_margin),
            _margin(row.own_margin),
            _number(row.slip_torque),
        )
        for row in report.pulleys
    ]
    remarks = [
        "Torque, ratio, used, margin are of means over time, range and worst of instants, without "
        "what links do that pass. Margin: factor by which all torques can grow; own: its torque "
        f"alone, {report.driver or 'what holds the belt'} making up for it.",
    ]
    if any(row.margin is not None and math.isinf(row.margin) for row in report.pulleys):
        remarks.append("later: others slip in full long before it would.")
    first = report.first_to_slip
    if first is not None:
        remarks.append(f"{first.name} slips first, {_when(first)}.")
    heading = (
        "pulley",
        "torque N m",
        "ratio",
        "limit",
        "% used",
        "range",
        "margin",
        "worst",
        "own",
        "slips at N m",
    )
    return Table(
        "Ratio (T_tight - rho v^2)/(T_slack - rho v^2), its limit exp(mu wrap), margin of torque",
        heading,
        rows,
        tuple(remarks),
    )


def _when(row: PulleyRow) -> str:
    """Say when the first pulley slips: now, or at which torques."""
    margins = [one for one in (row.margin, row.least_margin) if one is not None]
    if min(margins) <= 1.02:
        return (
            "now" if row.margin is not None and row.margin <= 1.02 else "now, at the worst instant"
        )
    told = []
    if row.margin is not None:
        told.append(f"when all torques have grown {row.margin:.2f}-fold")
    if row.least_margin is not None and (
        row.margin is None or row.least_margin < 0.95 * row.margin
    ):
        worst = f"{row.least_margin:.2f}-fold at the worst instant, t = {row.worst_time:.4g} s"
        told.append(f"but {worst}" if told else f"when all torques have grown {worst}")
    return ", ".join(told)


def _margin(margin: float | None) -> str:
    if margin is None:
        return _NONE
    return "later" if math.isinf(margin) else f"{margin:.2f}"


def _percents(value: Spread | None) -> str:
    """Give the range of a share in percent, the most of it "slack" where it is infinite."""
    if value is None:
        return _NONE
    ends = ["slack" if math.isinf(one) else f"{100 * one:.0f}" for one in (value.least, value.most)]
    return " to ".join(ends)


def _spans(report: Told) -> Table:
    rows = []
    for row in report.spans:
        line = _NONE
        if row.frequency is not None:
            line = f"{_number(row.frequency)}{' *' if row.link_passing else ''}"
        rows.append(
            (
                row.name,
                _NONE if row.length is None else f"{1e3 * row.length:.1f}",
                _mean(row.tension),
                _range(row.tension, 3),
                line,
                _NONE if row.amplitude is None else f"{_number(row.amplitude, 2)}",
                _number(row.lateral),
            )
        )
    heading = ("span", "mm", "tension N", "range", "strongest Hz", "+- N", "lateral Hz")
    remarks = []
    if any(row.link_passing for row in report.spans):
        remarks.append("* links that pass: an artefact of the mesh, not of the drive.")
    title = "Spans: tension, strongest line in it, first frequency as a moving string"
    return Table(title, heading, rows, tuple(remarks))


def _creep(report: Told) -> Table:
    rows = [
        (
            row.name,
            _number(row.ratio, 5),
            _percent(row.slower, 3),
            _percent(row.as_share * row.stretch, 3),
            _percent(row.as_share * row.friction, 3),
            _percent(row.as_share * row.radius, 3),
            _percent(row.as_share * row.remainder, 3),
        )
        for row in report.creep
    ]
    heading = (
        "pulley",
        "speed ratio",
        "lost %",
        "= stretch",
        "+ friction",
        "+ radius",
        "+ remainder",
    )
    doubtful = [
        row.name for row in report.creep if abs(row.remainder) > DOUBT * max(abs(row.lost), FAINT)
    ]
    remarks: tuple[str, ...] = ()
    if doubtful:
        remarks = (
            f"Do not trust the split of {', '.join(doubtful)}: the remainder, of unsteady motion, "
            "is more than a tenth of the speed lost. Take a longer or a steadier part of the run.",
        )
    return Table(f"Speed lost against {report.driver}, and why", heading, rows, remarks)


def _powers(report: Told) -> Table:
    kinds = {"in": "put in by", "out": "taken off by", "lost": "lost:", "stored": "", "left": ""}
    rows = [
        (f"{kinds[row.kind]} {row.name}".strip(), _number(row.power), _percent(row.share, 2))
        for row in report.powers
    ]
    remarks: tuple[str, ...] = ()
    if report.efficiency is not None:
        remarks = (
            f"Efficiency {100.0 * report.efficiency:.2f} %: what is put in less what is lost.",
        )
    return Table("Power: what is put in is the sum of all below", ("", "W", "%"), rows, remarks)


def _cycles(report: Told) -> Table:
    rows = [(_number(one.range), _number(one.mean), f"{one.count:g}") for one in report.cycles]
    during = "" if report.rounds is None else f", {report.rounds:.3g} rounds of the belt"
    return Table(
        f"Load cycles of joint {report.joint} by rainflow, t = {report.cycles_begin:.4g} to "
        f"{report.end:.4g} s{during}",
        ("range N", "mean N", "cycles"),
        rows,
    )


def _opening(report: Told) -> list[str]:
    speed, range_ = "", report.belt_speeds
    if report.belt_speed is not None:
        speed = f"; belt at {abs(report.belt_speed):.4g} m/s"
    if report.driver and range_ is not None and range_.most - range_.least > abs(range_.mean):
        speed = f"; belt at {range_.least:.3g} to {range_.most:.3g} m/s"
    driver = "" if report.driver is None else f", driven by {report.driver}"
    return [
        f"Means over t = {report.begin:.6g} to {report.end:.6g} s, {report.samples} samples"
        f"{speed}{driver}"
    ]


def _unsteady(report: Told) -> str:
    """Give what is least steady, and how much else is not."""
    more = len(report.unsteady) - 1
    return report.unsteady[0] + (f"; and {more} more (report.unsteady)" if more else "")


def lines(report: Told) -> list[str]:
    """Give the lines of a report."""
    found = _opening(report)
    if report.unsteady:
        found += _wrapped(f"not steady: {_unsteady(report)}")
    for table in tables(report):
        found += ["", table.title]
        whole = [table.heading, *table.rows]
        widths = [max(len(row[k]) for row in whole) for k in range(len(table.heading))]
        for row in whole:
            cells = [
                f"{cell:{'>' if k else '<'}{width}}"
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            ]
            found.append(("  " + "  ".join(cells)).rstrip())
        for remark in table.remarks:
            found += _wrapped(remark)
    if report.notes:
        found += ["", "Not told"]
        for note in report.notes:
            found += _wrapped(note)
    return found


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="    ")


def html(report: Told) -> str:
    """Give a report as HTML, for notebooks."""
    parts = [f"<p>{escape.escape(one)}</p>" for one in _opening(report)]
    if report.unsteady:
        parts.append(f"<p><b>not steady:</b> {escape.escape(_unsteady(report))}</p>")
    for table in tables(report):
        head = "".join(f"<th>{escape.escape(cell)}</th>" for cell in table.heading)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape.escape(cell)}</td>" for cell in row) + "</tr>"
            for row in table.rows
        )
        parts.append(
            f"<table><caption>{escape.escape(table.title)}</caption>"
            f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        )
        parts += [f"<p>{escape.escape(one)}</p>" for one in table.remarks]
    if report.notes:
        items = "".join(f"<li>{escape.escape(one)}</li>" for one in report.notes)
        parts.append(f"<p>Not told:</p><ul>{items}</ul>")
    return "\n".join(parts)


_UNITS = {
    "speed": "rad/s",
    "torque": "N m",
    "power": "W",
    "belt_torque": "N m",
    "hub_load": "N",
    "hub_direction": "deg",
    "wrap": "rad",
    "slip_arc": "rad",
    "tight": "N",
    "slack": "N",
    "slip_torque": "N m",
    "slip_tensions": "N",
    "length": "m",
    "tension": "N",
    "frequency": "Hz",
    "amplitude": "N",
    "lateral": "Hz",
    "range": "N",
    "mean": "N",
}


def numbers(report: Told) -> list[tuple[str, str, str, str, float]]:
    """Give all numbers that are known: part, name, quantity, unit, value."""
    found: list[tuple[str, str, str, str, float]] = []
    parts = ("pulleys", "spans", "creep", "powers", "cycles")
    for part in parts:
        for index, row in enumerate(getattr(report, part)):
            name = getattr(row, "name", f"class {index}")
            for field, value in attrs.asdict(row, recurse=False).items():
                for suffix, one in _values(value):
                    found.append((part, name, field + suffix, _UNITS.get(field, "1"), one))
    if report.efficiency is not None:
        found.append(("powers", "efficiency", "share", "1", report.efficiency))
    return found


def _values(value: Any) -> Sequence[tuple[str, float]]:
    if isinstance(value, Spread):
        return [("", value.mean), (" least", value.least), (" most", value.most)]
    if isinstance(value, tuple):
        return [(" tight", value[0]), (" slack", value[1])]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return [("", float(value))]
    return []
