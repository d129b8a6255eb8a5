"""Tables: as text in aligned columns, framed on a terminal, in HTML for notebooks."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

_Rows = Sequence[Sequence[str]]


class Table(NamedTuple):
    """A table: title, heading, rows, and remarks below it."""

    title: str
    heading: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    remarks: Sequence[str] = ()

    def lines(self, width: int) -> list[str]:
        """Return its lines, broken into tables that are no wider than this."""
        found = textwrap.wrap(self.title, width)
        for whole in fitted([self.heading, *self.rows], width):
            found += columns(whole)
        return found + [line for one in self.remarks for line in wrapped(one, width)]

    def html(self) -> str:
        """Return it and its remarks as HTML; an empty heading is left out."""

        def row(tag: str, cells: Iterable[str]) -> str:
            return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

        head = f"<thead>{row('th', self.heading)}</thead>" if self.heading else ""
        title = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        body = "".join(row("td", cells) for cells in self.rows)
        table = f"<table>{title}{head}<tbody>{body}</tbody></table>"
        return "\n".join([table, *map(_paragraph, self.remarks)])


def wrapped(text: str, width: int) -> list[str]:
    """Break an indented text into lines, further indented from the second one on."""
    return textwrap.wrap(text, width, initial_indent="  ", subsequent_indent="    ")


def columns(
    rows: _Rows, sides: str = "<>", indent: str = "  ", width: int | None = None
) -> list[str]:
    """Return the lines of a table, the last column broken where a line is longer than ``width``."""
    wide = _widths(rows)
    sides = sides.ljust(len(wide), sides[-1])
    cells = [f"{side}{n}" for side, n in zip(sides, wide, strict=False)]
    lines = [indent + "  ".join(map(format, row, cells)).rstrip() for row in rows]
    if width is None:
        return lines
    hang = " " * (len(indent) + sum(2 + one for one in wide[:-1]))
    return [one for line in lines for one in textwrap.wrap(line, width, subsequent_indent=hang)]


def _widths(rows: _Rows) -> list[int]:
    """Return the widths of the columns."""
    return [max(map(len, column)) for column in zip(*rows, strict=True)]


def fitted(rows: list[tuple[str, ...]], width: int) -> list[list[tuple[str, ...]]]:
    """Break a table that is too wide into as few as fit, all with the first column, alike wide."""
    wide_are = _widths(rows)
    n = len(wide_are)

    def wide(cut: tuple[int, ...]) -> int:
        ends = zip((1, *cut), (*cut, n), strict=True)
        return max(2 + wide_are[0] + sum(2 + one for one in wide_are[a:b]) for a, b in ends)

    for parts in range(1, n):
        cut = min(itertools.combinations(range(2, n), parts - 1), key=wide)
        if wide(cut) <= width or parts == n - 1:
            ends = list(zip((1, *cut), (*cut, n), strict=True))
            return [[(row[0], *row[a:b]) for row in rows] for a, b in ends]
    return [rows]


def framed(
    title: str,
    rows: Iterable[Sequence[str]],
    heading: Sequence[str] = (),
    sides: str = "<>",
    first: int | None = None,
) -> None:
    """Print a table in a frame, as wide as the terminal; ``first``: least width of column one."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, show_header=bool(heading), title_justify="left")
    for k, label in enumerate(heading):
        justify = "right" if sides[min(k, len(sides) - 1)] == ">" else "left"
        table.add_column(
            label,
            justify=justify,  # type: ignore[arg-type]
            no_wrap=k == 0 and first is not None,
            min_width=first if k == 0 else None,
        )
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def html(parts: Iterable[str | Table]) -> str:
    """Return tables, and texts as paragraphs, as HTML."""
    return "\n".join(one.html() if isinstance(one, Table) else _paragraph(one) for one in parts)


def _paragraph(text: str) -> str:
    return f"<p>{escape(text.strip())}</p>"
