"""All of a report in tables of at most 80 columns, and the same in HTML."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from html import escape

from .. import _core
from ..base.tables import Table, wrapped
from ..base.tables import html as html_of
from ..drive.mounts import KINDS
from . import digits
from .columns import ROUNDING, Layout, drop_rounding, has_shares, made
from .cycles import CLASSES
from .digits import NONE, between, number, or_nan, placed, tension_off, within
from .rows import RESIDUAL, PulleyRow, ReportData

_WIDTH = 80
#: Part of the speed lost that may remain unexplained, and speeds lost that are as good as none.
MAX_UNEXPLAINED, NEGLIGIBLE_LOSS = 0.1, 1e-5
#: Part of the speed lost from which on a negative share of friction is explained.
LITTLE = 0.01
#: Margins this near to each other are alike: losses on the way of the power are as large.
ALIKE = 1.01
#: Part of the tension below which rho v^2 is none: the belt stands.
_STANDS = 1e-6
#: Links on a wrap from which on arcs and ratios are right to some percent.
LINKS = 3.0


def tables(report: ReportData) -> Iterator[Table]:
    """Yield the tables of a report that are not empty."""
    for layout in _layouts(report):
        table = made(report, layout)
        if any(cell != NONE for row in table.rows for cell in row[1:]):
            yield table


def _layouts(report: ReportData) -> Iterator[Layout]:
    """Yield what stands in the tables."""
    yield Layout(
        "Speed, torque in {torque}, power in {power} (counter-clockwise, and put in, positive)",
        "pulleys",
        "name turns speed speed:range torque torque:range power",
        couplings,
    )
    by = "cells" if cells(report) else "links in contact"
    yield Layout(
        f"Hub loads; wrap by the belt line; slip by the {by}",
        "pulleys",
        "name load load:range direction wrap arc arc_error share share:range",
        _on_arcs,
    )
    yield Layout(
        "Ratio (T_tight - rho v^2)/(T_slack - rho v^2), its limit exp(mu wrap), margin of torque",
        "pulleys",
        "name belt_torque ratio limit used used:range margin worst own slips",
        _on_margins,
    )
    yield Layout(
        "Spans: tension in {tension}, strongest line in it, frequency as a moving string in "
        "{string}",
        "spans",
        "name length tension tension:range line amplitude string",
        _on_spans,
    )
    yield Layout(
        "Mounts: travel, and what acts on them",
        "parts",
        "part unit value value:range line amplitude",
        _on_mounts,
    )
    yield Layout(
        f"Speed lost against {report.driver}, and why",
        "creep",
        "name ratio lost stretch friction radius remainder",
        _on_creep,
    )
    yield Layout(
        "Power: what is put in is the sum of all below", "powers", "name power share", _on_powers
    )
    yield Layout(_of_cycles(report), "cycles", "range mean count", _on_cycles)


def couplings(report: ReportData) -> Iterator[str]:
    """Describe the windup of each coupling, and for how long a clutch is free."""
    for row in report.pulleys:
        if row.windup is None:
            continue
        windup = drop_rounding(row.windup, ROUNDING)
        mean, *ends = placed(windup, digits.of_loads(report.accuracy), math.degrees(1.0))
        text = f"Coupling of {row.name}: windup {mean} deg ({between(ends)})"
        if row.overruns is not None:
            text += f", overruns {100.0 * row.overruns:.0f} % of the time"
        if row.overruns == 1.0:
            text += " and drives nothing: is it to drive the other way round (clockwise)?"
        yield f"{text}; speed, torque and power are those of its shaft, lost % those of its rim."


def _on_arcs(report: ReportData) -> Iterator[str]:
    few = [f"{row.name} {row.links:.1f}" for row in report.pulleys if (row.links or LINKS) < LINKS]
    if few:
        yield (
            f"Links on the wrap: {', '.join(few)}. So few make arcs, tensions beside them and "
            "ratios coarse: take more links."
        )
    if any(row.slip_arc is not None for row in report.pulleys):
        yield (
            "Belt slips with 95 % of full friction or more. What creeps carries less while "
            "its friction builds up, so the arc is smaller than the part of friction in use. +-: "
            "what the mesh may put it off by, to a factor of three."
        )


def _on_margins(report: ReportData) -> Iterator[str]:
    yield (
        "Torque of the belt on the pulley. Torque, ratio, used, margin are of the means of the "
        "window; range and worst are of single moments"
        f"{'' if cells(report) else ', averaged over the passing of a link'}. "
        "Margin: factor by which all loads can grow before the pulley slips in full; own: its "
        f"load alone, {report.driver or 'what holds the belt'} making up for it, before any slips."
    )
    if any(row.margin is not None and math.isinf(row.margin) for row in report.pulleys):
        yield "later: others slip in full, or a span goes slack, long before it would."
    if any(
        (row.margin or math.inf) * abs(row.belt_torque or 0.0) < 0.98 * abs(row.slip_torque or 0.0)
        for row in report.pulleys
    ):
        yield (
            "slips at: by the means. A margin of 1 at less torque is of a pulley that has slipped "
            "in full at moments of the window."
        )
    yield from slips(report)


def cells(report: ReportData) -> bool:
    """Whether the belt flows through cells: no links pass and none land."""
    return any(row["flows"] for row in _core.BELTS if row["nodes"] == report.nodes)


def note_on_mesh(report: ReportData) -> str:
    """Return a note on a mesh whose error is large enough for a warning."""
    notes = (row["note"] for row in _core.BELTS)
    warned = [one.text for one in report.warnings]
    return next((one for one in notes if one and any(one in text for text in warned)), "")


def slips(report: ReportData) -> list[str]:
    """Describe which pulleys slip first by theory, and when; "" if none."""
    first = report.first_to_slip
    if first is None:
        return []
    alike = [one for one in report.pulleys if one.least <= ALIKE * first.least]
    names = (
        [alike[0].name, f"{len(alike) - 1} others"] if len(alike) > 2 else [a.name for a in alike]
    )
    which = " and ".join(names) + (" slip together" if len(alike) > 1 else " slips first")
    soonest = min(alike, key=lambda one: one.least if one.margin is None else one.margin)
    return [f"{which}, {_when(report, soonest)}."]


def _when(report: ReportData, row: PulleyRow) -> str:
    """Describe when the first pulley slips: now, or at which torques."""
    if row.least <= 1.02 < (row.sticking_margin or 0.0):
        return "as soon as something makes it slip: only friction at rest holds it"
    if row.least <= 1.02:
        of_means = row.margin is not None and row.margin <= 1.02
        return "now" if of_means else "now, at the worst instant"
    texts = []
    if row.margin is not None and math.isfinite(row.margin):
        texts.append(f"when all loads have grown {digits.margin(report, row.margin)}-fold")
    if row.least_margin is not None and (
        row.margin is None or row.least_margin < 0.95 * row.margin
    ):
        least = digits.margin(report, row.least_margin)
        worst = f"{least}-fold at the worst instant, t = {row.worst_time:.4g} s"
        texts.append(f"but {worst}" if texts else f"when all loads have grown {worst}")
    if texts and note_on_mesh(report):
        texts.append("on the paper's mesh; the drive's own margin is lower")
    return ", ".join(texts)


def _on_spans(report: ReportData) -> Iterator[str]:
    if any(row.link_passing for row in report.spans):
        yield "* links that pass: an artefact of the mesh, not of the drive."
    if any(row.link_passing is None for row in report.spans):
        yield (
            "? may be links that pass, an artefact of the mesh: this window cannot tell them from "
            "other lines."
        )
    if not cells(report):
        yield "Ranges are of running means over the passing of a link."
    known = [(row.name, row.of_run) for row in report.spans if row.of_run is not None]
    if known:
        tight, most = max(known, key=lambda one: one[1].most)
        loose, least = min(known, key=lambda one: one[1].least)
        ends = (within(one, tension_off(report)) for one in (most.most, least.least))
        slack = "none goes slack" if least.least > 0.0 else "it goes slack"
        if any(row.absent for row in report.spans) and least.least > 0.0:
            slack = "but where a span has no tension, see the notes"
        yield (
            f"In all of the run: at most {next(ends)} N ({tight}), at least {next(ends)} N "
            f"({loose}; {slack}); means over the span."
        )
    if more := beside_tensions(report):
        yield f"Beside these: {'; '.join(more)}."


def beside_tensions(report: ReportData) -> list[str]:
    """Return the tension at rest and the part of the tension that turns the belt's mass."""
    off = or_nan(report.tension_error) * abs(report.rest_tension or 0.0)  # of the run, at most
    mass = report.mass_tension
    if mass is not None and mass < _STANDS * digits.mean_tension(report):
        mass = 0.0
    known = {"mean tension at rest": within(report.rest_tension, off), "rho v^2": number(mass, 3)}
    return [f"{name} {value} N" for name, value in known.items() if value != NONE]


def _on_mounts(report: ReportData) -> Iterator[str]:
    kinds = {row.kind for row in report.mounts}
    return (kind.remark for kind in KINDS.values() if kind.name in kinds)


def _on_creep(report: ReportData) -> Iterator[str]:
    doubtful = [
        row.name
        for row in report.creep
        if abs(row.remainder) > MAX_UNEXPLAINED * max(abs(row.lost), NEGLIGIBLE_LOSS)
    ]
    if doubtful:
        yield (
            f"Do not trust the split of {', '.join(doubtful)}: the remainder, of unsteady motion, "
            "is more than a tenth of the speed lost. Take a longer or a steadier part of the run."
        )
    if any(row.friction < -LITTLE * abs(row.lost) for row in report.creep):
        yield "friction < 0: it acts already while the belt sinks in, where the radius is larger."


def _on_powers(report: ReportData) -> Iterator[str]:
    if not has_shares(report):
        yield "No percentages: more is taken off or stored than is put in."
    unknown = abs(report.powers[RESIDUAL].power)
    if any(row.name.startswith("friction on") and row.power < -unknown for row in report.powers):
        yield "lost < 0: friction gives back what it had stored."
    if report.efficiency is not None:
        error = 100.0 * (report.efficiency_error or 0.0)
        ends = (
            ": so much may be lost by links as they land, in the contact's damping; more links "
            "tell."
        )
        yield (
            f"Efficiency {digits.efficiency(report)} %: what is put in less what is "
            f"lost. The error is some {number(error, 2)} %{'.' if cells(report) else ends}"
        )


def _of_cycles(report: ReportData) -> str:
    of = f"the belt in cell {report.joint}" if cells(report) else f"joint {report.joint}"
    title = f"Load cycles of {of} by rainflow, t = {report.cycles_begin:.4g} to {report.end:.4g} s"
    if report.rounds is None:
        return title
    many = f"{report.rounds:.3g}"
    return f"{title}, {many} round{'' if many == '1' else 's'} of the belt"


def _on_cycles(report: ReportData) -> Iterator[str]:
    before = "the last link" if report.joint == 0 else f"link {report.joint - 1}"
    yield (
        f"That which is in the middle of cell {report.joint} at the end. In steady running any "
        "part of the belt goes through the same cycles in a round."
        if cells(report)
        else f"Joint {report.joint} is between {before} and link {report.joint}. In steady running "
        "any joint of the belt goes through the same cycles in a round."
    )
    yield (
        f"Cycles are put into {CLASSES} classes by their range, of equal width from 0 to the "
        "largest; range and mean are averages over a class, halves are cycles that do not close."
    )


def opening(report: ReportData) -> list[str]:
    """Describe the part of the run, and the speed of the belt."""
    speed, range_ = "", report.belt_speeds
    if report.belt_speed is not None:
        speed = f"; belt at {digits.belt_speed(report)} m/s"
    backward = (report.belt_speed or 0.0) < -ROUNDING
    if report.driver and range_ is not None and range_.most - range_.least > abs(range_.mean):
        _, *ends = placed(range_, 1e-3, -1.0 if backward else 1.0)
        speed = f"; belt at {between(ends)} m/s"
    if backward:
        speed += f" against the order of its {'cells' if cells(report) else 'links'}"
    if report.driver is not None:
        speed += f", driven by {report.driver}"
    begin, end = f"{report.begin:.6g}", f"{report.end:.6g}"
    found = [f"Means over t = {begin} to {end} s, {report.samples} samples{speed}"]
    if report.ended_early is not None:
        found.append(f"  the run ended early, {report.ended_early}")
    for least_steady in report.unsteady[:1]:
        more = len(report.unsteady) - 1
        others = f"; and {more} more (report.unsteady)" if more else ""
        found.append(f"  not steady: {least_steady}{others}")
    return found


def _closing(report: ReportData) -> Iterator[tuple[str, Sequence[str]]]:
    """Yield what stands below the tables: heading and texts."""
    later = " (foreseen; the errors of this run are measured)"
    warned = [f"{one}{later if foreseen(report, one.code) else ''}" for one in report.warnings]
    parts = (("Warnings of the run", warned), ("Not known, and to bear in mind", report.notes))
    return (part for part in parts if part[1])


def foreseen(report: ReportData, code: str) -> bool:
    """Whether a warning is an estimate of something measured since."""
    return code in ("mesh", "mesh_speed") and report.accuracy.verified


def lines(report: ReportData) -> list[str]:
    """Return the lines of a report, none longer than 80 characters."""
    found = [
        line
        for one in opening(report)
        for line in textwrap.wrap(one, _WIDTH, subsequent_indent="    " if one[0] == " " else "")
    ]
    for table in tables(report):
        found += ["", *table.lines(_WIDTH)]
    for title, texts in _closing(report):
        found += ["", title, *(line for one in texts for line in wrapped(one, _WIDTH))]
    return found


def html(report: ReportData) -> str:
    """Return a report as HTML, for notebooks."""
    parts = [html_of([*opening(report), *tables(report)])]
    for title, texts in _closing(report):
        items = "".join(f"<li>{escape(one)}</li>" for one in texts)
        parts.append(f"<p>{title}:</p><ul>{items}</ul>")
    return "\n".join(parts)
