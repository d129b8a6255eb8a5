"""The first screen of a report: what a designer asks first."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator

from ..base import tables
from ..base.rounding import rounded
from ..base.tables import Table, columns
from . import digits, text
from .columns import Layout, made
from .digits import NONE, number, or_nan, within
from .rows import ReportData
from .text import opening

#: The command prints a line above it.
_WIDTH, _HEIGHT = 100, 39
#: Rows that a table has in any case.
_LEAST = 2
#: Losses listed one by one, largest first; smaller shares of the input power are left out.
_LOSSES, _SMALL = 3, 1e-3
_GROW = "factor by which all loads can grow until it slips in full"
#: What headings of columns mean; the last one where the one before it is not there.
_MEANINGS = {
    "lost %": "lost: speed, against the driving pulley",
    "to deg": "to deg: of the hub load",
    "used %": "used: of friction, at most",
    "margin": f"margin: {_GROW} (later: others slip first)",
    "worst": f"worst: {_GROW}, at the worst instant",
}


def lines(report: ReportData) -> list[str]:
    """Return the lines of the first screen: at most 39, none longer than 100 characters."""
    above = [one for sentence in opening(report) for one in _wrapped(sentence)]
    below = ["", *(one for sentence in _closing(report) for one in _wrapped(sentence))]
    shown = [
        (table, [line for one in table.remarks for line in _wrapped("  " + one)])
        for table in _tables(report)
    ]
    room = _HEIGHT - len(above) - len(below)
    room -= sum(2 + len(remarks) for _, remarks in shown)  # a blank line and the heading
    most = max((len(table.rows) for table, _ in shown), default=0)
    while most > _LEAST and sum(_height(table, most) for table, _ in shown) > room:
        most -= 1
    for table, remarks in shown:
        above += ["", *_columns(table, most), *remarks]
    return [*above, *below]


def html(report: ReportData) -> str:
    """Return the first screen as HTML, with the full report in a section that opens."""
    first = tables.html([*opening(report), *_tables(report), *_closing(report)])
    return f"{first}\n<details><summary>All of it</summary>{text.html(report)}</details>"


def _wrapped(sentence: str) -> list[str]:
    return textwrap.wrap(sentence, _WIDTH, subsequent_indent="    ")


def _height(table: Table, most: int) -> int:
    """Count the lines of so many rows, with the one that says that there are more."""
    return len(table.rows) if len(table.rows) <= most else most + 1


def _columns(table: Table, most: int) -> list[str]:
    """Print so many rows of a table, its first column as wide as there is room for it."""
    rows = [table.heading, *table.rows[:most]]
    wide = len(columns([("", *row[1:]) for row in rows])[0])
    room = max(_WIDTH - wide, 1)
    cut = [row[0] if len(row[0]) <= room else row[0][: room - 1] + "…" for row in rows]
    found = columns([(first, *row[1:]) for first, row in zip(cut, rows, strict=True)])
    left = len(table.rows) - most
    return found + ([f"  ... and {left} more"] if left > 0 else [])


def _tables(report: ReportData) -> Iterator[Table]:
    """Yield the tables of pulleys, spans and mounts, without empty columns."""
    for layout in _LAYOUTS:
        table = made(report, layout)
        whole = zip(table.heading, *table.rows, strict=True)
        first, *kept = (one for k, one in enumerate(whole) if k == 0 or {*one[1:]} - {NONE})
        if kept:
            heading, *rows = zip(first, *kept, strict=True)
            words = {*heading} - ({"worst"} if "margin" in heading else set())
            meanings = [meaning for word, meaning in _MEANINGS.items() if word in words]
            remarks = (*filter(None, ["; ".join(meanings)]), *table.remarks)
            yield Table(table.title, heading, rows, remarks)


def _on_spans(report: ReportData) -> list[str]:
    remarks = text.beside_tensions(report)
    passing = {row.link_passing for row in report.spans if row.frequency is not None}
    if True in passing:
        remarks.append("mesh: the strongest line is of links that pass")
    if None in passing:
        remarks.append("?: or of links that pass")
    return ["; ".join(remarks)] if remarks else []


_LAYOUTS = (
    Layout(
        "Pulleys",
        "pulleys",
        "name turns lost torque power load load:most direction most_used margin worst",
        text.couplings,
    ),
    Layout(
        "Spans",
        "spans",
        "name tension:least mean tension:most of_run:least of_run:most line_of_drive string_3",
        _on_spans,
    ),
    Layout("Mounts", "mounts", "name travel travel:range stop stop:range"),
)


def _closing(report: ReportData) -> Iterator[str]:
    """Yield a sentence each on slip, power, errors, warnings and what else there is."""
    yield from (f"Slip: {one}" for one in text.slips(report))
    if report.powers:
        yield f"Power: {_balance(report)}."
    yield report.accuracy.sentence()
    for note in report.notes:
        if note.startswith("Belt("):  # what would be cheaper
            yield f"{note}."
    if note := text.note_on_mesh(report):
        yield f"{note}."
    if report.warnings:
        yield f"Warnings: {', '.join(_named(report))} (in full: result.warnings)."
    many = len(report.notes)
    notes = f"{many} note{'s'[: many > 1]}, " if many else ""
    yield (
        f"More ({notes}arcs of slip, creep by its causes, all losses, load cycles): "
        "report.text(full=True), --full"
    )


def _balance(report: ReportData) -> str:
    put_in, taken = digits.total(report, "in"), digits.total(report, "out")
    lost, known = digits.lost(report)
    error, of_losses = report.power_error, report.efficiency_error or 0.0
    ends = [within(one, or_nan(error) * put_in) for one in (put_in, taken)]
    sentence = f"{ends[0]} W put in, {ends[1]} W taken off, {lost}"
    parts = sorted(report.powers, key=lambda one: -abs(one.power))
    shown = [one for one in parts if one.kind == "lost" and abs(one.power) > _SMALL * put_in]
    if shown and known:
        named = (f"{one.name} {digits.loss(report, one.power)}" for one in shown[:_LOSSES])
        sentence += f" (most: {', '.join(named)})"
    rest = put_in - taken - digits.total(report, "lost")
    if report.efficiency is not None and abs(rest) > max(_SMALL * put_in, _unit(put_in, error)):
        parts = [one for one in report.powers if one.kind in ("stored", "left")]
        most = max(parts, key=lambda one: abs(one.power)).name
        sentence += f"; the rest, {number(rest, 2)} W: {most}"
    if report.efficiency is not None:
        percent = 100.0 * of_losses
        sentence += f"; efficiency {digits.efficiency(report)} %"
        if any(row.margin is not None and row.margin <= 1.0 for row in report.pulleys):
            return f"{sentence} in full slip"
        return f"{sentence} (+- {number(percent, 2)} % from the mesh)"
    if of_losses:
        sentence += f"; losses +- {number(of_losses * put_in, 2)} W from the mesh"
    return "; ".join([sentence, *(one for one in report.notes if one.startswith("no efficiency"))])


def _unit(put_in: float, error: float | None) -> float:
    """Return the decimal place to which the input power is shown."""
    shown, places = rounded(put_in, or_nan(error) * put_in)
    return 10.0 ** (math.floor(math.log10(shown)) + 1 - places)


def _named(report: ReportData) -> list[str]:
    """Name each warning once, with the number of pulleys or spans concerned."""
    codes = [one.code for one in report.warnings]
    return [
        f"{code} ({codes.count(code)})"
        if codes.count(code) > 1
        else code + ", foreseen" * text.foreseen(report, code)
        for code in dict.fromkeys(codes)
    ]
