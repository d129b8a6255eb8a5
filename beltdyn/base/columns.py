"""Tables of text in aligned columns."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["columns", "widths"]


def columns(rows: Sequence[Sequence[str]], sides: str = "<>", indent: str = "  ") -> list[str]:
    """Return the lines of a table."""
    wide = widths(rows)
    sides = sides.ljust(len(wide), sides[-1])
    cells = [f"{side}{n}" for side, n in zip(sides, wide, strict=False)]
    return [indent + "  ".join(map(format, row, cells)).rstrip() for row in rows]


def widths(rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the widths of the columns."""
    return [max(map(len, column)) for column in zip(*rows, strict=True)]
