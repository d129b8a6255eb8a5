"""Marks of the paper's numbers in a panel: orange bands, and the numbers on the opposite axes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Patch

from .paper_numbers import Quantity

__all__ = ["BAND", "INK", "LINE", "PAPER", "Marks", "legend_entry", "number"]

#: Colour of everything that the paper states, and of its numbers.
PAPER, INK = "#E69F00", "#8A5A00"
BAND: dict[str, Any] = {"facecolor": PAPER, "alpha": 0.35, "edgecolor": "none", "zorder": 1.5}
LINE: dict[str, Any] = {"color": INK, "linewidth": 0.9, "zorder": 1.6}
#: Numbers closer than these shares of the axis have one label, or are turned upright.
_SAME, _NEAR = 0.035, 0.14


class Marks:
    """Marks in one panel: a line at the number, with a band as wide as its scale.

    :meth:`finish` writes the numbers on the upper and the right axis, away from the curves.
    """

    def __init__(self, ax: Axes) -> None:
        self._ax = ax
        self._top: list[tuple[float, str]] = []
        self._right: list[tuple[float, str]] = []

    def at(self, x: float, half: float = 0.0, label: str | None = None) -> None:
        """Mark a place on the x axis over the full height."""
        if half:
            self._ax.axvspan(x - half, x + half, **BAND)
        self._ax.axvline(x, **LINE)
        self._top.append((x, number(x) if label is None else label))

    def time(self, quantity: Quantity) -> None:
        """Mark a time that the paper states."""
        self.at(quantity.paper, quantity.scale)

    def level(
        self,
        y: float,
        half: float = 0.0,
        label: str | None = None,
        *,
        span: tuple[float, float] | None = None,
    ) -> None:
        """Mark a value on the y axis, over the full width or a span of it."""
        if span is None:
            if half:
                self._ax.axhspan(y - half, y + half, **BAND)
            self._ax.axhline(y, **LINE)
        else:
            if half:
                self._ax.fill_between(span, y - half, y + half, **BAND)
            self._ax.plot(span, [y, y], label="_paper", **LINE)
        self._right.append((y, number(y) if label is None else label))

    def value(
        self, quantity: Quantity, *, sign: float = 1.0, span: tuple[float, float] | None = None
    ) -> None:
        """Mark a value that the paper states; ``sign`` where it states the absolute value."""
        self.level(sign * quantity.paper, quantity.scale, span=span)

    def name(self, x: float, text: str) -> None:
        """Write above the panel, without a mark."""
        self._top.append((x, text))

    def finish(self) -> None:
        """Write the numbers."""
        ax = self._ax
        if self._top:
            places, texts, upright = _arranged(self._top, ax.get_xlim())
            top = ax.secondary_xaxis("top")
            top.set_xticks(places, texts, rotation=90 if upright else 0)
            top.tick_params(colors=INK, length=0.0, pad=2.0, labelsize="small")
            top.spines[:].set_visible(False)
        if self._right:
            places, texts, _ = _arranged(self._right, ax.get_ylim())
            right = ax.secondary_yaxis("right")
            right.set_yticks(places, texts)
            right.tick_params(colors=INK, length=0.0, pad=3.0, labelsize="small")
            right.spines[:].set_visible(False)


def _arranged(
    numbers: list[tuple[float, str]], limits: tuple[float, float]
) -> tuple[list[float], list[str], bool]:
    """Sort and group what is too close together; return whether labels must be upright."""
    extent = abs(limits[1] - limits[0])
    groups: list[list[tuple[float, str]]] = []
    for place, text in sorted(set(numbers)):
        if groups and place - groups[-1][-1][0] < _SAME * extent:
            groups[-1].append((place, text))
        else:
            groups.append([(place, text)])
    places = [sum(place for place, _ in group) / len(group) for group in groups]
    texts = ["\n".join(text for _, text in group) for group in groups]
    gaps = [b - a for a, b in pairwise(places)]
    upright = len(numbers) > len(groups) or min(gaps, default=extent) < _NEAR * extent
    return places, texts, upright


def number(value: float) -> str:
    """Write a number as the axes do, with a typographic minus sign."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


def legend_entry() -> Patch:
    """Make the legend's entry for all marks."""
    return Patch(facecolor=to_rgba(PAPER, 0.35), edgecolor=INK, linewidth=0.9, label="paper")
