"""The style of all figures; matplotlib's rcParams are not changed."""

from __future__ import annotations

import io
import sys
import threading
from collections.abc import Sequence
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cbook import normalize_kwargs
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.transforms import Bbox, ScaledTranslation

from ..base.checks import Array
from ..drive.parts import Pulley

# Okabe and Ito: distinguishable with any colour vision; the dashes also in black and white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1.2, 1.2)), (0, (9, 2)))
HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----")
#: Colours of the belt where the quantity shown does not exist, and of pulleys.
FREE, METAL = "0.72", "0.93"
#: Most columns of a legend below the axes.
LEGEND_COLUMNS = 3
#: Outlines of texts and lines over a picture.
HALO: list[AbstractPathEffect] = [withStroke(linewidth=2.5, foreground="white", alpha=0.8)]
#: Share of the height that a legend above the data takes at most, by size; a larger one is below.
_HEADROOM = {"small": 0.4, "x-small": 0.55}
#: Above this number of points finding a place for a legend takes longer than drawing.
_MANY_POINTS = 100_000


class OwnFigure(Figure):
    """A figure that a notebook shows without pyplot."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def new_figure(
    width: float = 6.4, height: float = 4.0, dpi: float | None = None, own: bool = False
) -> OwnFigure:
    """Make a figure [inch]; where pyplot is in use it is its current one, unless ``own``.

    Not in notebooks, which show figures by themselves, nor in threads, where windows do not work.
    """
    pyplot: Any = sys.modules.get("matplotlib.pyplot")
    in_use = hasattr(pyplot, "figure") and threading.current_thread() is threading.main_thread()
    look: dict[str, Any] = {"figsize": (width, height), "dpi": dpi, "layout": "constrained"}
    if own or not in_use or "inline" in matplotlib.get_backend():
        return OwnFigure(**look)
    figure: OwnFigure = pyplot.figure(FigureClass=OwnFigure, **look)
    return figure


def plain(name: str) -> str:
    """Return a name as matplotlib shows it: no formula, nor left out of legends."""
    shown = name.replace("$", r"\$")
    return f"pulley {shown}" if shown.startswith("_") else shown


def title(k: int, pulley: Pulley) -> str:
    """Return the label of a pulley in a picture: its name, a word a line, or its number."""
    return str(k) if pulley.name is None else plain(pulley.name).replace(" ", "\n")


def axes(ax: Axes | None, height: float = 4.0) -> Axes:
    """Return the axes to draw into, those of a new figure of this height [inch] for None."""
    if ax is None:
        return new_figure(height=height).add_subplot()
    if not isinstance(ax, Axes):
        raise TypeError(f"ax must be matplotlib axes or None, got {type(ax).__name__}")
    return ax


def height_to_scale(extent: Array, beside: float, below: float) -> float:
    """Return the height [inch] of a figure of 6.4 inches that a picture to scale fills."""
    return float(np.clip((6.4 - beside) * extent[1] / extent[0] + below, 2.4, 5.2))


def line_style(k: int) -> dict[str, Any]:
    """Return colour and dashes of the k-th line."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}


def draw_line(
    ax: Axes, x: Any, y: Any, look: dict[str, Any], given: dict[str, Any]
) -> list[Line2D]:
    """Draw lines; what the user has given, by any of matplotlib's names, goes before ``look``."""
    return ax.plot(x, y, **(normalize_kwargs(look, Line2D) | normalize_kwargs(given, Line2D)))


def tint(k: int) -> tuple[float, float, float, float]:
    """Return the light colour of the k-th area."""
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


def set_title(ax: Axes, text: str, size: str = "medium") -> None:
    """Set a title, its lines broken between words at the width that the axes have by now."""
    if not text:
        return
    title = ax.set_title(text, fontsize=size)
    room = ax.figure.figure.bbox.width * ax.get_position(original=True).width
    lines = text.split("\n")
    most = int(max(map(len, lines)) * room / title.get_window_extent().width)
    title.set_text("\n".join(fill(line, max(most, 20)) for line in lines))


def leave_free(ax: Axes, share: float, *, above: bool) -> None:
    """Leave this share of the height free above the data, or below."""
    scale = ax.yaxis.get_transform()
    low, high = scale.transform(ax.get_ylim())
    room = (high - low) * share / (1.0 - share)
    end = float(scale.inverted().transform(high + room if above else low - room))
    # auto: limits still adapt to lines drawn later.
    ax.set_ylim(None if above else end, end if above else None, auto=True)


def _height(ax: Axes) -> float:
    inches = ax.figure.figure.get_size_inches()[1]
    return float(72.0 * inches * ax.get_position(original=True).height)


def _points(size: str) -> float:
    return FontProperties(size=size).get_size_in_points()


def _legend_below() -> float:
    """Return how far below the axes a legend begins [pt]: below ticks, their numbers, the label."""
    return 11.0 + 2.5 * _points("medium")


def legend(ax: Axes, handles: Sequence[Artist] | None = None) -> None:
    """Put the legend where it covers no data; above it if need be, below the axes if it is large.

    In a figure without a layout engine, which leaves no room below, it is always above.
    """
    handles = ax.get_legend_handles_labels()[0] if handles is None else handles
    if not handles:
        return
    # The sizes of axes and legend are known only after the layout.
    settle_layout(ax)
    few = sum(np.size(line.get_xdata()) for line in ax.lines) <= _MANY_POINTS
    box = _legend(ax, handles, loc="best" if few else "upper left")
    if few and not _covers(ax, box):
        return
    frame = ax.get_window_extent()
    for size, most in _HEADROOM.items():
        box = _legend(ax, handles, loc="upper left", fontsize=size)
        columns = max(1, int(frame.width / box.width))
        box = _legend(ax, handles, loc="upper left", fontsize=size, ncols=columns)
        share = (frame.y1 - box.y0) / frame.height
        if ax.figure.figure.get_layout_engine() is None or (share <= most and not ax.texts):
            leave_free(ax, min(share, 0.6), above=True)
            return
    legend_below(ax, handles)


def legend_below(ax: Axes, handles: Sequence[Artist] | None = None) -> None:
    """Put a legend beneath the label of the x axis, in as many columns as the axes are wide for."""
    handles = ax.get_legend_handles_labels()[0] if handles is None else handles
    figure = ax.figure.figure
    down = ScaledTranslation(0.0, -_legend_below() / 72.0, figure.dpi_scale_trans)
    where: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0)}
    where |= {"bbox_transform": ax.transAxes + down, "borderaxespad": 0.0}
    settle_layout(ax)
    # Wider than the axes, it would take the room from them in a layout that is computed.
    room = figure.bbox.width * ax.get_position(original=True).width
    sizes = [(count, "small") for count in range(min(LEGEND_COLUMNS, len(handles)), 0, -1)]
    for count, size in [*sizes, (1, "x-small")] if handles else ():
        spaced: dict[str, Any] = {"handlelength": 1.6, "columnspacing": 1.2, "fontsize": size}
        if _legend(ax, handles, ncols=count, **where, **spaced).width <= room:
            return


def _legend(ax: Axes, handles: Sequence[Artist], **where: Any) -> Bbox:
    """Draw the legend; return its box."""
    look: dict[str, Any] = {"framealpha": 0.8, "edgecolor": "none", "fontsize": "small"}
    return ax.legend(handles=handles, **look | where).get_window_extent()


def _covers(ax: Axes, box: Bbox) -> bool:
    """Whether a legend lies over a line, an area or a text."""
    areas = [one for one in ax.collections if isinstance(one, PolyCollection)]
    shapes: list[tuple[Artist, Path, bool]] = [(one, one.get_path(), False) for one in ax.lines]
    shapes += [(one, path, True) for one in areas for path in one.get_paths()]
    return any(box.overlaps(text.get_window_extent()) for text in ax.texts) or any(
        one.get_transform().transform_path(path).intersects_bbox(box, filled=filled)
        for one, path, filled in shapes
    )


def points(drawn: Artist) -> float:
    """Return how many points a pixel is on the figure of what is drawn."""
    figure: Any = drawn.figure
    return float(72.0 / figure.figure.dpi)


def settle_layout(ax: Axes) -> None:
    """Run the layout, as drawing does: twice for an equal aspect, which it applies after it."""
    figure = ax.figure.figure
    engine = figure.get_layout_engine()
    for _ in range(1 if ax.get_aspect() == "auto" else 2):
        if engine is not None:
            engine.execute(figure)
        locator = ax.get_axes_locator()
        ax.apply_aspect(None if locator is None else locator(ax, None))  # type: ignore[arg-type]


def room_below(ax: Axes, rows: int) -> dict[str, float]:
    """Return the ``pad`` of a colour bar below a legend in figures without a layout engine."""
    if ax.figure.figure.get_layout_engine() is not None:
        return {}
    points = _legend_below() + (1.6 * rows + 1.3) * _points("small")
    return {"pad": min(points / _height(ax), 0.5)}
