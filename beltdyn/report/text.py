"""All of a report in tables of at most 80 columns, and the same in HTML."""

from __future__ import annotations

import html as escape
import math
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from .. import _core
from ..base.tables import columns, fitted, paragraphs, table_of
from ..drive.mounts import KINDS
from . import digits
from .cycles import CLASSES
from .digits import (
    NONE,
    between,
    number,
    of_speed,
    of_tension,
    percent,
    placed,
    tension_off,
    within,
)
from .rows import RESIDUAL, Power, PulleyRow, ReportData, Spread

__all__ = [
    "Table",
    "cells",
    "html",
    "lines",
    "note_on_mesh",
    "of_tables",
    "opening",
    "slips",
    "tables",
]

_WIDTH = 80
_TO_RPM = 30.0 / math.pi
#: Speeds below this are rounding [rad/s], and powers below that much of the largest.
_STILL, _NOTHING = 1e-6, 1e-9
#: Part of the speed lost that may remain unexplained, and speeds lost that are as good as none.
MAX_UNEXPLAINED, NEGLIGIBLE_LOSS = 0.1, 1e-5
#: Part of the speed lost from which on a negative share of friction is explained.
LITTLE = 0.01
#: Part of the largest power that is as good as none: half a place of 100.00 %.
_PART = 5e-5
#: A part over the whole of what is put in, beyond which parts are no shares of it.
TURNED = 0.05
#: Margins this near to each other are alike: losses on the way of the power are as large.
TOGETHER = 1.01
#: Links on a wrap from which on arcs and ratios are right to some percent.
LINKS = 3.0


class Table(NamedTuple):
    """A table: title, heading, rows, and remarks below it."""

    title: str
    heading: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    remarks: tuple[str, ...] = ()


def tables(report: ReportData) -> Iterator[Table]:
    """Yield the tables of a report that are not empty."""
    parts = (
        (_motion, report.pulleys),
        (_loads, report.pulleys),
        (_slip, report.pulleys),
        (_spans, report.spans),
        (_mounts, report.mounts),
        (_creep, report.creep),
        (_powers, report.powers),
        (_cycles, report.cycles),
    )
    for table, rows in parts:
        made = table(report) if rows else None
        if made is not None and any(cell != NONE for row in made.rows for cell in row[1:]):
            yield made


def _motion(report: ReportData) -> Table:
    powers = [abs(row.power.mean) for row in report.pulleys if row.power is not None]
    least = _NOTHING * max(powers, default=0.0)
    rows = []
    for row in report.pulleys:
        speed, share = _without(row.speed, _STILL), of_speed(report, row)
        turns, torque = placed(speed, share), digits.torque(report, row)
        rows.append(
            (
                row.name,
                placed(speed, share, _TO_RPM)[0],
                turns[0],
                between(turns[1:]),
                torque[0],
                between(torque[1:]),
                digits.power(report, _without(row.power, least)),
            )
        )
    heading = ("pulley", "1/min", "rad/s", "range", "torque", "range", "power")
    title = "Speed, torque in N m, power in W (counter-clockwise, and put in, positive)"
    return Table(title, heading, rows, couplings(report))


def couplings(report: ReportData) -> tuple[str, ...]:
    """Describe the windup of each coupling, and for how long a clutch is free."""
    remarks = []
    for row in report.pulleys:
        if row.windup is None:
            continue
        mean, *ends = digits.windup(report, row)
        text = f"Coupling of {row.name}: windup {mean} deg ({between(ends)})"
        if row.overruns is not None:
            text += f", overruns {100.0 * row.overruns:.0f} % of the time"
        if row.overruns == 1.0:
            text += " and drives nothing: is it to drive the other way round (clockwise)?"
        remarks.append(
            f"{text}; speed, torque and power are those of its shaft, lost % those of its rim."
        )
    return tuple(remarks)


def _without(value: Spread | None, least: float) -> Spread | None:
    """Return a spread with numbers below rounding set to 0."""
    if value is None:
        return None
    ends = (value.mean, value.least, value.most)
    return Spread(*(0.0 if abs(one) < least else one for one in ends))


def _loads(report: ReportData) -> Table:
    rows = [
        (
            row.name,
            (load := of_tension(report, row.hub_load, 2.0))[0],
            between(load[1:]),
            digits.direction(row.hub_direction),
            NONE if row.wrap is None else f"{math.degrees(row.wrap):.1f}",
            *digits.slip_arc(row),
            percent(row.slip_share, 0),
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
        "+-",
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
    if any(row.slip_arc is not None for row in report.pulleys):
        remarks += (
            "Belt slips with 95 % of full friction or more. What creeps carries less while "
            "its friction builds up, so the arc is smaller than the part of friction in use. +-: "
            "what the mesh may put it off by, to a factor of three.",
        )
    by = "cells" if cells(report) else "links in contact"
    title = f"Hub loads; wrap by the belt line; slip by the {by}"
    return Table(title, heading, rows, remarks)


def _slip(report: ReportData) -> Table:
    rows = [
        (
            row.name,
            digits.belt_torque(report, row),
            digits.ratio(report, row),
            number(row.limit, 3),
            (part := digits.used(report, row))[0] if row.used is not None else NONE,
            between(part[1:]) if row.used_range is not None else NONE,
            digits.margin(report, row.margin),
            digits.margin(report, row.least_margin),
            digits.margin(report, row.own_margin),
            digits.slip_torque(report, row),
        )
        for row in report.pulleys
    ]
    remarks = [
        "Torque of the belt on the pulley. Torque, ratio, used, margin are of the means of the "
        "window; range and worst are of single moments"
        f"{'' if cells(report) else ', averaged over the passing of a link'}. "
        "Margin: factor by which all loads can grow before the pulley slips in full; own: its "
        f"load alone, {report.driver or 'what holds the belt'} making up for it, before any slips.",
    ]
    if any(row.margin is not None and math.isinf(row.margin) for row in report.pulleys):
        remarks.append("later: others slip in full, or a span goes slack, long before it would.")
    if any(
        (row.margin or math.inf) * abs(row.belt_torque or 0.0) < 0.98 * abs(row.slip_torque or 0.0)
        for row in report.pulleys
    ):
        remarks.append(
            "slips at: by the means. A margin of 1 at less torque is of a pulley that has slipped "
            "in full at moments of the window."
        )
    remarks += slips(report)
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


def cells(report: ReportData) -> bool:
    """Whether the belt flows through cells: no links pass and none land."""
    return any(row["flows"] for row in _core.BELTS if row["nodes"] == report.nodes)


def note_on_mesh(report: ReportData) -> str:
    """Return a note on a mesh whose error is large enough for a warning."""
    notes = (row["note"] for row in _core.BELTS)
    return next((one for one in notes if one and _warned(report, one)), "")


def _warned(report: ReportData, text: str) -> bool:
    return any(text in one.text for one in report.warnings)


def slips(report: ReportData) -> list[str]:
    """Describe which pulleys slip first by theory, and when; "" if none."""
    first = report.first_to_slip
    if first is None:
        return []
    alike = [one for one in report.pulleys if one.least <= TOGETHER * first.least]
    names = (
        [alike[0].name, f"{len(alike) - 1} others"] if len(alike) > 2 else [a.name for a in alike]
    )
    which = " and ".join(names) + (" slip together" if len(alike) > 1 else " slips first")
    soonest = min(alike, key=lambda one: one.least if one.margin is None else one.margin)
    return [f"{which}, {_when(report, soonest)}."]


def _when(report: ReportData, row: PulleyRow) -> str:
    """Describe when the first pulley slips: now, or at which torques."""
    margins = [one for one in (row.margin, row.least_margin) if one is not None]
    if min(margins) <= 1.02 < (row.sticking_margin or 0.0):
        return "as soon as something makes it slip: only friction at rest holds it"
    if min(margins) <= 1.02:
        return (
            "now" if row.margin is not None and row.margin <= 1.02 else "now, at the worst instant"
        )
    told = []
    if row.margin is not None and math.isfinite(row.margin):
        told.append(f"when all loads have grown {digits.margin(report, row.margin)}-fold")
    if row.least_margin is not None and (
        row.margin is None or row.least_margin < 0.95 * row.margin
    ):
        least = digits.margin(report, row.least_margin)
        worst = f"{least}-fold at the worst instant, t = {row.worst_time:.4g} s"
        told.append(f"but {worst}" if told else f"when all loads have grown {worst}")
    if told and note_on_mesh(report):
        told.append("on the paper's mesh; the drive's own margin is lower")
    return ", ".join(told)


def _percents(value: Spread | None) -> str:
    """Return the range of a share in percent, its maximum "slack" where it is infinite."""
    if value is None:
        return NONE
    ends = ["slack" if math.isinf(one) else f"{100 * one:.0f}" for one in (value.least, value.most)]
    return " to ".join(ends)


def _spans(report: ReportData) -> Table:
    rows = []
    for row in report.spans:
        line = NONE
        if row.frequency is not None:
            mark = " ?" if row.link_passing is None else " *" if row.link_passing else ""
            line = digits.line_frequency(report, row) + mark
        rows.append(
            (
                row.name,
                NONE if row.length is None else f"{1e3 * row.length:.1f}",
                (tension := of_tension(report, row.tension))[0],
                between(tension[1:]),
                line,
                NONE if row.amplitude is None else f"{number(row.amplitude, 2)}",
                digits.string_frequency(report, row),
            )
        )
    heading = ("span", "mm", "tension", "range", "line Hz", "+- N", "string")
    remarks = []
    if any(row.link_passing for row in report.spans):
        remarks.append("* links that pass: an artefact of the mesh, not of the drive.")
    if any(row.link_passing is None for row in report.spans):
        remarks.append(
            "? may be links that pass, an artefact of the mesh: this window cannot tell them from "
            "other lines."
        )
    if not cells(report):
        remarks.append("Ranges are of running means over the passing of a link.")
    known = [row for row in report.spans if row.of_run is not None]
    if known:
        most = max(known, key=lambda row: row.of_run.most if row.of_run else 0.0)
        least = min(known, key=lambda row: row.of_run.least if row.of_run else 0.0)
        assert most.of_run is not None and least.of_run is not None
        ends = (within(one, tension_off(report)) for one in (most.of_run.most, least.of_run.least))
        slack = "none goes slack" if least.of_run.least > 0.0 else "it goes slack"
        if any(row.absent for row in report.spans) and least.of_run.least > 0.0:
            slack = "but where a span has no tension, see the notes"
        remarks.append(
            f"In all of the run: at most {next(ends)} N ({most.name}), at least {next(ends)} N "
            f"({least.name}; {slack}); means over the span."
        )
    told = []
    if report.rest_tension is not None:
        told.append(f"Mean tension at rest: {digits.at_rest(report)} N.")
    if report.mass_tension is not None:
        told.append(f"rho v^2 in this window: {number(report.mass_tension, 3)} N.")
    if told:
        remarks.append(" ".join(told))
    title = "Spans: tension in N, strongest line in it, frequency as a moving string in Hz"
    return Table(title, heading, rows, tuple(remarks))


#: What the parts of a mount are called.
_PARTS = {
    "travel": "travel",
    "to_stop": "to the nearer stop",
    "spring": "spring",
    "damper": "damper",
    "friction": "friction",
    "stop": "stop",
    "belt": "belt",
}


def _mounts(report: ReportData) -> Table:
    rows = []
    for row in report.mounts:
        kind = KINDS[row.kind]
        scale, way = kind.shown
        for field, words in _PARTS.items():
            value: Spread | None = getattr(row, field)
            if value is None:
                continue
            of_way = field in ("travel", "to_stop")
            factor = scale if of_way else 1.0
            line = field == "travel" and row.frequency is not None
            if field == "spring":
                words = kind.spring
            rows.append(
                (
                    f"{row.name}, {words}",
                    way if of_way else kind.force,
                    (shown := digits.of_mount(report, row, value, factor))[0],
                    between(shown[1:]),
                    digits.line_frequency(report, row) if line else "",
                    number(scale * (row.amplitude or 0.0), 2) if line else "",
                )
            )
    heading = ("mount", "in", "mean", "range", "line Hz", "+-")
    kinds = {row.kind for row in report.mounts}
    remarks = tuple(kind.remark for kind in KINDS.values() if kind.name in kinds)
    return Table("Mounts: travel, and what acts on them", heading, rows, remarks)


def _creep(report: ReportData) -> Table:
    # Parts have the decimals of the whole, which has the digits that its error leaves it.
    most = max((100.0 * abs(row.slower) for row in report.creep), default=0.0)
    shown = within(most, report.creep_error and report.creep_error * most)
    decimals = min(3, len(shown.partition(".")[2]))
    rows = []
    for row in report.creep:
        causes = (row.stretch, row.friction, row.radius, row.remainder)
        parts = (row.slower, *(row.as_share * one for one in causes))
        rows.append(
            (row.name, digits.speed_ratio(report, row), *(percent(one, decimals) for one in parts))
        )
    heading = (
        "pulley",
        "ratio",
        "lost",
        "= stretch",
        "+ friction",
        "+ radius",
        "+ remainder",
    )
    doubtful = [
        row.name
        for row in report.creep
        if abs(row.remainder) > MAX_UNEXPLAINED * max(abs(row.lost), NEGLIGIBLE_LOSS)
    ]
    remarks: tuple[str, ...] = ()
    if doubtful:
        remarks = (
            f"Do not trust the split of {', '.join(doubtful)}: the remainder, of unsteady motion, "
            "is more than a tenth of the speed lost. Take a longer or a steadier part of the run.",
        )
    if any(row.friction < -LITTLE * abs(row.lost) for row in report.creep):
        remarks += (
            "friction < 0: it acts already while the belt sinks in, where the radius is larger.",
        )
    return Table(f"Speed lost against {report.driver}, and why", heading, rows, remarks)


def _powers(report: ReportData) -> Table:
    kinds = {"in": "put in by", "out": "taken off by", "lost": "lost:", "stored": "", "left": ""}
    # Shares of what is put in say nothing where a drive lives on what it has stored.
    shares = all(abs(row.share or 0.0) <= 1.0 + TURNED for row in report.powers)

    largest = max((row.power for row in report.powers if row.kind in ("in", "out")), default=0.0)
    nothing = _PART * max(abs(row.power) for row in report.powers)

    def shown(row: Power, value: float, least: float = 0.005) -> str:
        if abs(value) <= least:
            return "0.00"
        if row.kind == "lost":
            return digits.loss(report, row.power, value)
        error = None if row.kind not in ("in", "out") else report.power_error
        return within(value, error and error * largest * abs(value / row.power))

    rows = [
        (
            f"{kinds[row.kind]} {row.name}".strip(),
            shown(row, row.power, min(0.005, nothing)),
            NONE if row.share is None or not shares else shown(row, 100.0 * row.share),
        )
        for row in report.powers
    ]
    remarks: tuple[str, ...] = ()
    if not shares:
        remarks = ("No percentages: more is taken off or stored than is put in.",)
    unknown = abs(report.powers[RESIDUAL].power)
    if any(row.name.startswith("friction on") and row.power < -unknown for row in report.powers):
        remarks += ("lost < 0: friction gives back what it had stored.",)
    if report.efficiency is not None:
        error = report.efficiency_error or 0.0
        remarks += (
            f"Efficiency {within(100.0 * report.efficiency, 100.0 * error)} %: what is put in "
            f"less what is lost. The error is some {number(100.0 * error, 2)} %"
            + (
                "."
                if cells(report)
                else ": so much may be lost by links as they land, in the contact's damping; more "
                "links tell."
            ),
        )
    return Table("Power: what is put in is the sum of all below", ("", "W", "%"), rows, remarks)


def _cycles(report: ReportData) -> Table:
    off = digits.history_off(report)
    rows = [
        (within(one.range, off), within(one.mean, off), f"{one.count:g}") for one in report.cycles
    ]
    of = f"the belt in cell {report.joint}" if cells(report) else f"joint {report.joint}"
    title = f"Load cycles of {of} by rainflow, t = {report.cycles_begin:.4g} to {report.end:.4g} s"
    if report.rounds is not None:
        many = f"{report.rounds:.3g}"
        title += f", {many} round{'' if many == '1' else 's'} of the belt"
    before = "the last link" if report.joint == 0 else f"link {report.joint - 1}"
    remarks = [
        f"That which is in the middle of cell {report.joint} at the end. In steady running any "
        "part of the belt goes through the same cycles in a round."
        if cells(report)
        else f"Joint {report.joint} is between {before} and link {report.joint}. In steady running "
        "any joint of the belt goes through the same cycles in a round.",
        f"Cycles are put into {CLASSES} classes by their range, of equal width from 0 to the "
        "largest; range and mean are averages over a class, halves are cycles that do not close.",
    ]
    return Table(title, ("range N", "mean N", "cycles"), rows, tuple(remarks))


def opening(report: ReportData) -> list[str]:
    """Describe the part of the run, and the speed of the belt."""
    told, range_ = "", report.belt_speeds
    if report.belt_speed is not None:
        told = f"; belt at {digits.belt_speed(report)} m/s"
    if report.driver and range_ is not None and range_.most - range_.least > abs(range_.mean):
        told = f"; belt at {range_.least:.3g} to {range_.most:.3g} m/s"
    driver = "" if report.driver is None else f", driven by {report.driver}"
    found = [
        f"Means over t = {report.begin:.6g} to {report.end:.6g} s, {report.samples} samples"
        f"{told}{_against(report)}{driver}"
    ]
    return found + ([f"  not steady: {_unsteady(report)}"] if report.unsteady else [])


def _against(report: ReportData) -> str:
    """Note that the belt runs against the numbering of its links, if it does."""
    speed = report.belt_speed or 0.0
    nodes = "cells" if cells(report) else "links"
    return f" against the order of its {nodes}" if speed < -_STILL else ""


def _unsteady(report: ReportData) -> str:
    """Return what is least steady, and how many others are not."""
    more = len(report.unsteady) - 1
    return report.unsteady[0] + (f"; and {more} more (report.unsteady)" if more else "")


def lines(report: ReportData) -> list[str]:
    """Return the lines of a report, none longer than 80 characters."""
    found = [
        line
        for one in opening(report)
        for line in textwrap.wrap(one, _WIDTH, subsequent_indent="    " if one[0] == " " else "")
    ]
    for table in tables(report):
        found += ["", *textwrap.wrap(table.title, _WIDTH)]
        for whole in fitted([table.heading, *table.rows], _WIDTH):
            found += columns(whole)
        for remark in table.remarks:
            found += _wrapped(remark)
    if report.warnings:
        found += ["", "Warnings of the run"]
        for warning in _warnings(report):
            found += _wrapped(warning)
    if report.notes:
        found += ["", "Not told, and to be kept in mind"]
        for note in report.notes:
            found += _wrapped(note)
    return found


def _warnings(report: ReportData) -> list[str]:
    later = " (foreseen; the errors of this run are measured)"
    return [f"{one}{later if foreseen(report, one.code) else ''}" for one in report.warnings]


def foreseen(report: ReportData, code: str) -> bool:
    """Whether a warning is an estimate of something measured since."""
    return code == "mesh" and report.accuracy.verified


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="    ")


def html(report: ReportData) -> str:
    """Return a report as HTML, for notebooks."""
    parts = [*paragraphs(opening(report)), *of_tables(tables(report))]
    for title, texts in (
        ("Warnings of the run", _warnings(report)),
        ("Not told, and to be kept in mind", report.notes),
    ):
        if texts:
            items = "".join(f"<li>{escape.escape(one)}</li>" for one in texts)
            parts.append(f"<p>{title}:</p><ul>{items}</ul>")
    return "\n".join(parts)


def of_tables(found: Iterable[Table]) -> list[str]:
    """Return each table, and its remarks, as HTML."""
    parts = []
    for one in found:
        parts.append(table_of(one.heading, one.rows, one.title))
        parts += paragraphs(one.remarks)
    return parts
