"""Tables and paragraphs of HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["paragraphs", "table_of"]


def table_of(heading: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> str:
    """Return a table; an empty heading is left out."""

    def row(tag: str, cells: Iterable[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    head = f"<thead>{row('th', heading)}</thead>" if heading else ""
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    body = "".join(row("td", cells) for cells in rows)
    return f"<table>{title}{head}<tbody>{body}</tbody></table>"


def paragraphs(texts: Iterable[str]) -> list[str]:
    """Return each text as a paragraph."""
    return [f"<p>{escape(one.strip())}</p>" for one in texts]
