"""Pictures of sweeps: a quantity as a map over two of the swept names, or as lines over one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cbook import normalize_kwargs
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection, PathCollection, QuadMesh
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..base.checks import Array, integer, real_array
from . import style, swept
from .panel import draws

#: By status where runs have no value, and a text that counts them.
_Failures = Mapping[str, tuple[Any, str]]
#: Up to so many values have a step of the colour bar each.
_STEPS = 10
#: Up to so many values along x are marked.
_MARKED = 40
#: Light yellow at the end of viridis is hardly seen on white.
_DARK_ENOUGH = 0.88
#: Lines with failed runs have their marks in rows of their own, up to so many, of this height [pt].
_ROWS, _ROW = 6, 7.0


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
    Runs without a value are hatched cells or crosses, counted by status. Axes are logarithmic where
    the values are geometric. A text as a value, such as a friction law, has a row or column.

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
    values, failures = part[quantity].values, swept.failures(part, quantity)
    drawn, handles = (_points if points else _cells)(ax, values, scales, failures, mesh)
    if np.isfinite(values).any():
        ax.figure.colorbar(drawn, ax=ax, label=swept.label(part[quantity]))
    style.dress(ax, scales[0].label, scales[1].label)
    ax.grid(points)
    style.legend_below(ax, handles)
    style.set_title(ax, where)
    if not points:
        _contours(ax, values, scales, levels)
    return ax


def _two(part: Any, quantity: str, x: object, y: object, points: bool) -> tuple[str, str]:
    """Find the names along the axes."""
    dims = [str(dim) for dim in part[quantity].dims]
    known = swept.swept_names(part) if points else dims
    swept.check_names(known, x=x, y=y)
    rest = [name for name in known if name not in (x, y)]
    needed = (x, y).count(None)
    if points and needed and len(rest) != needed:
        raise ValueError(f"x and y must be two of {', '.join(known)}: name them")
    left = [dim for dim in dims if dim != "run"] if points else rest[needed:]
    if left:
        raise swept.too_many(part, quantity, left[-1], "choose a value of all but two")
    if len(rest) < needed:
        raise ValueError(
            f"{quantity} varies along {', '.join(dims) or 'nothing'} alone, a map needs two: see "
            "bd.plot.lines"
        )
    first, second = (str(rest.pop(0) if name is None else name) for name in (x, y))
    return first, second


def _cells(
    ax: Axes, values: Array, scales: list[swept.Scale], failures: _Failures, given: dict[str, Any]
) -> tuple[ScalarMappable, list[Artist]]:
    """Draw a grid, cells of failed runs hatched; return it, and the entries of its legend."""
    edges = [one.edges() for one in scales]
    look: dict[str, Any] = {"cmap": "viridis", "rasterized": values.size > 2000} | given
    drawn = ax.pcolormesh(*edges, np.ma.masked_invalid(values), **look)
    (left, bottom), (width, height) = [one[:-1] for one in edges], [np.diff(one) for one in edges]
    handles: list[Artist] = []
    for status, (where, text) in failures.items():
        face: dict[str, Any] = {"facecolor": "0.93", "edgecolor": "0.45", "linewidth": 0.4}
        face["hatch"] = swept.FAILED_LOOKS[status][0] or None
        failed = np.argwhere(where.values)
        cells = [Rectangle((left[i], bottom[j]), width[i], height[j]) for j, i in failed]
        ax.add_collection(PatchCollection(cells, **face), autolim=False)
        handles.append(Patch(label=text, **face))
    return drawn, handles


def _points(
    ax: Axes, values: Array, scales: list[swept.Scale], failures: _Failures, given: dict[str, Any]
) -> tuple[ScalarMappable, list[Artist]]:
    """Draw runs as points, failed ones as crosses; return them, and entries of the legend."""
    x, y = (scale.places for scale in scales)
    good = np.isfinite(values)
    size = float(np.clip(4000.0 / max(values.size, 1), 6.0, 36.0))
    look: dict[str, Any] = {"cmap": "viridis", "s": size, "linewidths": 0.0, "zorder": 2} | given
    drawn = ax.scatter(x[good], y[good], c=values[good], **look)
    handles: list[Artist] = []
    for status, (where, text) in failures.items():
        look = swept.mark(status) | {"color": style.COLOURS[1]}
        ax.plot(x[where.values], y[where.values], **look)
        handles.append(Line2D([], [], label=text, **look))
    return drawn, handles


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
    lines.set_path_effects(style.HALO)
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
        text.set_path_effects(style.HALO)


# --- lines ---------------------------------------------------------------------------------------


class _Line(NamedTuple):
    """A line: rank of its value of ``by``, of points a rank for each; x; which part it is of."""

    rank: int | NDArray[np.intp]
    x: Array
    which: dict[str, Any]

    def of(self, array: Any) -> Any:
        """Take its values from an array over the dimensions of the quantity."""
        return array.isel(self.which).values


@draws()
def lines(
    dataset: Any,
    quantity: str,
    x: str | None = None,
    by: str | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    ax: Axes | None = None,
    **line: Any,
) -> Axes:
    """Draw a quantity of a sweep over a swept name, a line for each value of another.

    Lines differ by colour, dark to light, with a colour bar where ``by`` has numbers, by style with
    a legend where it has texts. Where runs have no value the line has a gap and the foot of the
    picture a mark in its colour; the legend counts them by status. Of a quantity over time each run
    is a line. Runs at random or in a list are points, as what else varies differs between them.

    Args:
        x: Name along the x axis; None: "time" if the quantity has it, else the first that is left.
        by: Name by whose values lines differ; None: the one that is left, if any.
        **line: For matplotlib's ``plot``.

    Raises:
        TypeError, ValueError: An argument breaks its rule; another dimension is left.
        ImportError: xarray is not installed.
    """
    part, where = swept.choose(dataset, quantity, at, (x, by))
    along, apart = _named(part, quantity, x, by)
    # runs that were swept together, one after the other along a line, are no points
    path = '"zip"' in str(dataset.attrs.get("design", ""))
    points = along not in part.dims and not path
    ax = style.axes(ax)
    scale = swept.scale_of(part, along)
    scale.apply(ax, "x")
    part = part.isel({"run" if along not in part.dims else along: scale.order})
    by_scale = None if apart is None else swept.scale_of(part, apart)
    texts = by_scale.texts if by_scale else None
    colour_of, colours = _colours(by_scale)
    drawn = list(_lines(part[quantity], np.sort(scale.places), along, by_scale))
    marked = points or np.unique(scale.places).size <= _MARKED
    for one in drawn:
        look: dict[str, Any] = {"linewidth": 1.2}
        look |= {"marker": "o", "markersize": 4.0 if points else 3.0} if marked else {}
        look |= {"linestyle": style.line_style(int(one.rank))["linestyle"]} if texts else {}
        look |= {"linestyle": "none"} if points else {}
        _plot(ax, one.x, one.of(part[quantity]), colour_of(one.rank), look, line)
    style.dress(ax, scale.label, swept.label(part[quantity]))
    if by_scale and colours:
        _colour_bar(ax, by_scale, colours)
    handles: list[Artist] = [
        Line2D([], [], label=name, **(style.line_style(k) | {"color": colour_of(k)}))
        for k, name in enumerate(texts or ())
    ]
    found = swept.failures(part, quantity)
    marks = [
        Line2D([], [], color="0.3", label=text, **swept.mark(name))
        for name, (_, text) in found.items()
    ]
    if marks and not handles:
        style.legend_below(ax, marks)
    style.set_title(ax, where)
    if found and along != "time":
        _marks(ax, {name: absent for name, (absent, _) in found.items()}, drawn, colour_of)
    if handles:
        style.legend(ax, handles=[*handles, *marks])
    return ax


def _plot(
    ax: Axes, x: Array, y: Array, colour: Any, look: dict[str, Any], given: dict[str, Any]
) -> None:
    """Draw a line, or points each in its colour; ``given`` by the user goes before ``look``."""
    if np.ndim(colour) == 2:
        both = look | normalize_kwargs(given, Line2D)
        words = {k: both[k] for k in ("alpha", "label", "zorder", "transform") if k in both}
        size, marker = both["markersize"], both["marker"]
        line = 1.0 if marker != "o" else 0.0
        good = np.isfinite(y)
        ax.scatter(
            x[good], y[good], c=colour[good], s=size**2, marker=marker, linewidths=line, **words
        )
        return
    style.draw_line(ax, x, y, look | {"color": colour}, given)


def _named(part: Any, quantity: str, x: object, by: object) -> tuple[str, str | None]:
    """Find the names along the x axis and of the lines."""
    dims = [str(dim) for dim in part[quantity].dims]
    of_runs = swept.swept_names(part) if "run" in dims else []
    known = [*(dim for dim in dims if dim != "run"), *of_runs, *(["run"] if "run" in dims else [])]
    swept.check_names(known, x=x, by=by)
    rest = [name for name in known if name not in (x, by, "run")]
    if x is None:
        if not rest:
            raise ValueError(f"{quantity} is one number here: there is nothing to draw it over")
        x = "time" if "time" in rest else rest[0]
        if x != "time" and of_runs and len([name for name in of_runs if name != by]) > 1:
            raise ValueError(f"x must be named, one of {', '.join(of_runs)}")
        rest.remove(str(x))
    free = [dim for dim in dims if dim not in (x, by)]
    if "run" in dims and (x in of_runs or by in of_runs):
        free.remove("run")
    if by is None and len(free) == 1 and free != ["run"]:
        by = free.pop()
    if by is None and free == ["run"] and len(of_runs) == 1:
        by = of_runs[0]
    # Of time, a line a run: what else was swept may differ between lines of a colour.
    left = [dim for dim in free if x != "time" or dim not in part["status"].dims]
    if left:
        but = "name x and by, and choose a value of the others"
        raise swept.too_many(part, quantity, left[-1], but)
    return str(x), None if by is None else str(by)


def _lines(array: Any, x: Array, along: str, by_scale: swept.Scale | None) -> Iterator[_Line]:
    """Yield the lines; runs at random as one for each value of ``by_scale``."""
    by, ranks = (by_scale.name, by_scale.ranks) if by_scale else ("", np.zeros(1, dtype=np.intp))
    if along in array.dims:
        others = [str(dim) for dim in array.dims if dim != along]
        for index in np.ndindex(*(array.sizes[dim] for dim in others)):
            which = dict(zip(others, index, strict=True))
            k = which.get(by if by in which else "run", 0)
            yield _Line(int(ranks[k]) if by_scale else 0, x, which)
    # x is a coordinate of the runs
    elif by_scale is None:
        yield _Line(0, x, {})
    elif by in array.dims:
        for k in range(array.sizes[by]):
            yield _Line(int(ranks[k]), x, {by: k})
    elif by_scale.texts is None and np.unique(ranks).size > _STEPS:
        yield _Line(ranks, x, {})
    else:
        for rank in np.unique(ranks):
            there = np.flatnonzero(ranks == rank)
            yield _Line(int(rank), x[there], {"run": there})


def _colours(by_scale: swept.Scale | None) -> tuple[Callable[[Any], Any], ScalarMappable | None]:
    """Return the colour of a rank, and what a colour bar shows: a few values as steps."""
    if by_scale is None or by_scale.texts is not None:
        return lambda rank: style.COLOURS[rank % len(style.COLOURS)], None
    colours = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, _DARK_ENOUGH, 256)))
    values = np.unique(by_scale.places)
    if (count := values.size) <= _STEPS:
        steps = ListedColormap(colours(np.arange(count) / max(count - 1, 1)))
        return steps, ScalarMappable(BoundaryNorm(np.arange(count + 1) - 0.5, count), steps)
    norm = (LogNorm if by_scale.log else Normalize)(values[0], values[-1])
    return lambda rank: colours(np.asarray(norm(values[rank]))), ScalarMappable(norm, colours)


def _colour_bar(ax: Axes, by_scale: swept.Scale, colours: ScalarMappable) -> None:
    bar = ax.figure.colorbar(colours, ax=ax, label=by_scale.label)
    values = np.unique(by_scale.places)
    if values.size <= _STEPS:
        bar.set_ticks(list(range(values.size)), labels=[f"{value:.5g}" for value in values])
        bar.ax.minorticks_off()


def _marks(ax: Axes, absent: Mapping[str, Any], drawn: list[_Line], colour_of: Any) -> None:
    """Mark runs without a value, by status, at the foot of the axes in a row for each line."""
    lacking = [line for line in drawn if any(line.of(where).any() for where in absent.values())]
    if not lacking:
        return
    rows = len(lacking) if len(lacking) <= _ROWS else 1
    style.settle_layout(ax)  # the height of the axes is known after it
    row = _ROW / (ax.get_window_extent().height * style.points(ax))
    row = min(row, 0.5 / (rows + 1))
    for k, line in enumerate(lacking):
        for name, where in absent.items():
            there = line.of(where)
            height = np.full(np.count_nonzero(there), row * (k % rows + 0.6))
            colour = colour_of(line.rank)
            colour = colour[there] if np.ndim(colour) == 2 else colour
            look = swept.mark(name) | {"transform": ax.get_xaxis_transform()}
            _plot(ax, line.x[there], height, colour, look, {})
    style.leave_free(ax, row * (rows + 1), above=False)
