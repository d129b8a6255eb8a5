"""A quantity of a sweep as a map over two of the swept names."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection, PathCollection, QuadMesh
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from ..base.checks import Array, integer, real_array
from . import style, swept
from .panel import draws

_FAILED_FACE, _FAILED_EDGE = "0.93", "0.45"
#: Marks runs of a status, where they are; returns their handle in the legend, with a text.
_Mark = Callable[[str, Any, str], Artist]


@draws(QuadMesh, PathCollection, to=(Axes.pcolormesh, Axes.scatter))
def map(
    dataset: Any,
    quantity: str,
    x: str | None = None,
    y: str | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    contours: int | Sequence[float] = 6,
    ax: Axes | None = None,
    **mesh: Any,
) -> Axes:
    """Draw a quantity of a sweep by colour over two swept names.

    A grid is drawn in cells round its values with contours, runs at random or in a list as points.
    Runs without a value are hatched cells or crosses, counted by what became of them. Axes are
    logarithmic where the values are geometric. A text as a value, such as a friction law, has a
    row or column.

    Args:
        x: Name along the x axis; None: the first that is left, of two.
        y: Along the y axis; None: the other.
        contours: How many lines at most, at round values; or these values; 0: none. Points have
            none.
        **mesh: For matplotlib's ``pcolormesh``, of points for ``scatter``: ``cmap``, ``norm``.

    Raises:
        TypeError, ValueError: An argument breaks its rule; more than two dimensions are left.
        ImportError: xarray is not installed.
    """
    if isinstance(contours, (Sequence, np.ndarray)) and not isinstance(contours, str):
        levels: Any = np.unique(real_array("contours", contours, ndim=1))
    else:
        levels = integer("contours", contours, 0)
    part, where = swept.choose(dataset, quantity, at, (x, y))
    points = "run" in part.dims
    along, up = _two(part, quantity, x, y, points)
    ax = style.axes(ax, 4.4)
    scales = [swept.scale_of(part, name) for name in (along, up)]
    for which, scale in zip("xy", scales, strict=True):
        scale.apply(ax, which)
    if not points:  # as rows of y and columns of x, both rising
        part = part.isel({one.name: one.order for one in scales}).transpose(up, along)
    drawn, mark = (_points if points else _cells)(ax, part[quantity].values, scales, mesh)
    if np.isfinite(part[quantity].values).any():
        ax.figure.colorbar(drawn, ax=ax, label=swept.label(part[quantity]))
    failures = swept.failures(part, quantity).items()
    handles = [mark(name, found.values, text) for name, (found, text) in failures]
    style.dress(ax, scales[0].label, scales[1].label)
    ax.grid(points)
    if handles:
        style.legend_below(ax, handles)
    if where:
        style.set_title_within(ax, where)
    if not points:
        _contours(ax, part[quantity].values, scales, levels)
    return ax


def _two(part: Any, quantity: str, x: object, y: object, points: bool) -> tuple[str, str]:
    """Find the names along the axes."""
    dims = [str(dim) for dim in part[quantity].dims]
    known = swept.swept_names(part) if points else dims
    swept.check_names(known, x=x, y=y)
    rest = [name for name in known if name not in (x, y)]
    named = [str(name) for name in (x, y) if name is not None]
    needed = 2 - len(named)
    if points:
        left = [dim for dim in dims if dim != "run"]
        if len(rest) != needed and needed:
            raise ValueError(f"x and y must be two of {', '.join(known)}: name them")
    else:
        left = rest if len(rest) > needed else []
    if left:
        raise swept.too_many(part, quantity, left[-1], "choose a value of all but two")
    if len(rest) < needed:
        raise ValueError(
            f"{quantity} varies along {', '.join(dims) or 'nothing'} alone, a map needs two: see "
            "bd.plot.lines"
        )
    first = str(x) if x is not None else rest.pop(0)
    return first, str(y) if y is not None else rest.pop(0)


def _cells(
    ax: Axes, values: Array, scales: list[swept.Scale], given: dict[str, Any]
) -> tuple[ScalarMappable, _Mark]:
    """Draw a grid; return it, and what hatches cells of failed runs."""
    edges = [one.edges() for one in scales]
    look: dict[str, Any] = {"cmap": "viridis", "rasterized": values.size > 2000} | given
    drawn = ax.pcolormesh(*edges, np.ma.masked_invalid(values), **look)
    (left, bottom), (width, height) = [one[:-1] for one in edges], [np.diff(one) for one in edges]

    def hatch(status: str, where: Any, text: str) -> Artist:
        face: dict[str, Any] = {
            "facecolor": _FAILED_FACE,
            "edgecolor": _FAILED_EDGE,
            "hatch": swept.FAILED_LOOKS[status][0] or None,
            "linewidth": 0.4,
        }
        cells = [
            Rectangle((left[i], bottom[j]), width[i], height[j]) for j, i in np.argwhere(where)
        ]
        ax.add_collection(PatchCollection(cells, **face), autolim=False)
        return Patch(label=text, **face)

    return drawn, hatch


def _points(
    ax: Axes, values: Array, scales: list[swept.Scale], given: dict[str, Any]
) -> tuple[ScalarMappable, _Mark]:
    """Draw runs as points; return them, and what marks failed ones."""
    x, y = (scale.places for scale in scales)
    good = np.isfinite(values)
    size = float(np.clip(4000.0 / max(values.size, 1), 6.0, 36.0))
    look: dict[str, Any] = {"cmap": "viridis", "s": size, "linewidths": 0.0, "zorder": 2} | given
    drawn = ax.scatter(x[good], y[good], c=values[good], **look)

    def cross(status: str, where: Any, text: str) -> Artist:
        look = swept.mark(status) | {"color": style.COLOURS[1]}
        ax.plot(x[where], y[where], **look)
        return Line2D([], [], label=text, **look)

    return drawn, cross


def _contours(ax: Axes, values: Any, scales: list[swept.Scale], asked: Any) -> None:
    """Draw up to so many contours at round values, or at these, with their values."""
    there = values[np.isfinite(values)]
    if min(values.shape) < 2 or not there.size or any(one.texts for one in scales):
        return
    low, high = float(there.min()), float(there.max())
    if isinstance(asked, int):
        asked = MaxNLocator(asked).tick_values(low, high) if asked else []
    inside = [float(level) for level in asked if low < level < high]
    if not inside:
        return
    x, y = (np.sort(scale.places) for scale in scales)
    lines = ax.contour(
        x, y, np.ma.masked_invalid(values), inside, colors="black", linewidths=0.8, zorder=2
    )
    lines.set_path_effects([withStroke(linewidth=1.8, foreground="white", alpha=0.5)])
    style.settle_layout(ax)
    names = ax.clabel(lines, fmt=lambda level: f"{level:g}", fontsize="small", zorder=3)
    _thin(names)


def _thin(names: Sequence[Text]) -> None:
    """Take away labels that lie over another, and outline those that stay."""
    kept: list[Any] = []
    for text in names:
        box = text.get_window_extent()
        if any(box.overlaps(other) for other in kept):
            text.set_visible(False)
            continue
        kept.append(box)
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white", alpha=0.8)])
