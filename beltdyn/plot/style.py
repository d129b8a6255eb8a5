"""The style of all figures; matplotlib's rcParams are not changed."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import LayoutEngine
from matplotlib.transforms import BboxBase, ScaledTranslation

from ..parts import Pulley

__all__ = [
    "COLOURS",
    "FREE",
    "HATCHES",
    "LEGEND_COLUMNS",
    "METAL",
    "OwnFigure",
    "add_headroom",
    "axes",
    "dress",
    "legend",
    "legend_below",
    "line_style",
    "new_figure",
    "plain",
    "room_below",
    "settle_layout",
    "tint",
    "title",
    "unused",
]

# Okabe and Ito: distinguishable with any colour vision; the dashes also in black and white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1.2, 1.2)), (0, (9, 2)))
HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----")
#: Colours of the belt where the quantity shown does not exist, and of pulleys.
FREE, METAL = "0.72", "0.93"
#: Most columns of a legend below the axes.
LEGEND_COLUMNS = 3
#: Above this number of points finding a place for a legend takes longer than drawing.
_MANY_POINTS = 100_000


class OwnFigure(Figure):
    """A figure that a notebook shows without pyplot."""

    _frozen = False

    def freeze_layout(self) -> None:
        """Compute the layout now and keep it, because it takes as long as drawing."""
        self.draw_without_rendering()
        self._frozen = True

    def get_layout_engine(self) -> LayoutEngine | None:
        """Give what lays out the figure, None once that is done."""
        return None if self._frozen else super().get_layout_engine()

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def new_figure(width: float = 6.4, height: float = 4.0, dpi: float | None = None) -> OwnFigure:
    """Make a figure without pyplot [inch]."""
    return OwnFigure(figsize=(width, height), dpi=dpi, layout="constrained")


def plain(name: str) -> str:
    """Give a name as matplotlib shows it: no formula, nor left out of legends."""
    shown = name.replace("$", r"\$")
    return f"pulley {shown}" if shown.startswith("_") else shown


def title(k: int, pulley: Pulley) -> str:
    """Give what stands on a pulley in a picture: its name, a word a line, or its number."""
    return str(k) if pulley.name is None else plain(pulley.name).replace(" ", "\n")


def axes(ax: Axes | None) -> Axes:
    """Give the axes to draw into, those of a new figure for None.

    Raises:
        TypeError: Not axes.
    """
    if ax is None:
        return new_figure().add_subplot()
    if not isinstance(ax, Axes):
        raise TypeError(f"ax must be matplotlib axes or None, got {type(ax).__name__}")
    return ax


def line_style(k: int) -> dict[str, Any]:
    """Give colour and dashes of the k-th line."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}


def tint(k: int) -> tuple[float, float, float, float]:
    """Give the light colour of the k-th area."""
    return to_rgba(COLOURS[k % len(COLOURS)], 0.25)


def unused(ax: Axes, k: int) -> int:
    """Find the first style from the k-th on that no line on these axes has."""
    used = {line.get_color() for line in ax.lines}
    free = (j for j in range(k, k + len(COLOURS)) if COLOURS[j % len(COLOURS)] not in used)
    return next(free, k + len(used))


def dress(ax: Axes, xlabel: str, ylabel: str) -> None:
    """Label the axes; draw a light grid and no box."""
    ax.set(xlabel=xlabel, ylabel=ylabel)
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)


def add_headroom(ax: Axes, rows: int) -> None:
    """Leave the height of this many rows of small text free above the data."""
    share = min((1.5 * rows + 0.8) * _points("small") / _height(ax), 0.6)
    low, high = ax.get_ylim()
    # auto: limits still adapt to lines drawn later.
    ax.set_ylim(low, high + (high - low) * share / (1.0 - share), auto=True)


def _root(ax: Axes) -> Figure:
    """Give the figure, of a subfigure the one that holds it."""
    figure: Figure = ax.figure.figure
    return figure


def _height(ax: Axes) -> float:
    return float(72.0 * _root(ax).get_size_inches()[1] * ax.get_position(original=True).height)


def _points(size: str) -> float:
    return FontProperties(size=size).get_size_in_points()


def _legend_below() -> float:
    """Give how far below the axes a legend begins [pt]: below ticks, their numbers, the label."""
    return 11.0 + 2.5 * _points("medium")


def legend(ax: Axes, **options: Any) -> None:
    """Put the legend where it covers no data, above them if necessary; or as ``options`` say."""
    look = {"framealpha": 0.8, "edgecolor": "none", "fontsize": "small"} | options
    if "loc" in options:
        ax.legend(**look)
        return
    # The sizes of axes and legend are known only after the layout.
    settle_layout(ax)
    points = sum(np.size(line.get_xdata()) for line in ax.lines)
    box = ax.legend(**look, loc="best" if points <= _MANY_POINTS else "upper left").get_tightbbox()
    if box is None or (points <= _MANY_POINTS and not _covers_data(ax, box)):
        return
    columns = max(1, int(ax.get_window_extent().width / box.width))
    rows = -(-len(ax.get_legend_handles_labels()[0]) // columns)
    add_headroom(ax, rows)
    ax.legend(**look, loc="upper left", ncols=columns)


def _covers_data(ax: Axes, box: BboxBase) -> bool:
    return any(
        box.count_contains(line.get_transform().transform(line.get_xydata())) > 0
        for line in ax.lines
    )


def settle_layout(ax: Axes) -> None:
    """Run the layout once: with equal aspect it takes two passes, and drawing is the second."""
    figure = _root(ax)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)


def room_below(ax: Axes, rows: int) -> dict[str, float]:
    """Give the ``pad`` of a colour bar below a legend in figures without a layout engine."""
    if _root(ax).get_layout_engine() is not None:
        return {}
    points = _legend_below() + (1.6 * rows + 1.3) * _points("small")
    return {"pad": min(points / _height(ax), 0.5)}


def legend_below(ax: Axes, handles: Sequence[Artist], columns: int = LEGEND_COLUMNS) -> None:
    """Put a legend beneath the label of the x axis, in as many columns as the axes are wide for."""
    figure = _root(ax)
    down = ScaledTranslation(0.0, -_legend_below() / 72.0, figure.dpi_scale_trans)
    settle_layout(ax)
    # Wider than the axes, it would take the room from them in a layout that is computed.
    room = figure.bbox.width * ax.get_position(original=True).width
    sizes = [(count, "small") for count in range(min(columns, len(handles)), 0, -1)]
    for count, size in [*sizes, (1, "x-small")]:
        legend(
            ax,
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=ax.transAxes + down,
            ncols=count,
            fontsize=size,
            handlelength=1.6,
            columnspacing=1.2,
            borderaxespad=0.0,
        )
        box = ax.get_legend()
        if box is None or box.get_window_extent().width <= room:
            return
