"""A quantity of a sweep as lines over a swept name, or over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..base.checks import Array
from . import style, swept
from .panel import passes_on

__all__ = ["lines"]

#: Up to so many values have a step of the colour bar each.
_STEPS = 10
#: Up to so many values along x are marked.
_MARKED = 40
#: Light yellow at the end of viridis is hardly seen on white.
_DARK_ENOUGH = 0.88
#: Lines with failed runs have their marks in rows of their own, up to so many, of this height [pt].
_ROWS, _ROW = 6, 7.0


class _Line(NamedTuple):
    """A line: the rank of its value of ``by``, where it is along x, which values it has.

    Of points that differ in colour it has a rank for each.
    """

    rank: int | NDArray[np.intp]
    x: Array
    dims: tuple[str, ...]
    which: tuple[Any, ...]

    def of(self, array: Any) -> Any:
        """Take its values from an array over the dimensions of the quantity."""
        return array.transpose(*self.dims).values[self.which]


class _By(NamedTuple):
    """What lines are told apart by: its scale, and the rank of the k-th value, None: nothing."""

    scale: swept.Scale | None
    ranks: Any


@passes_on()
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

    Numbers that lines are told apart by are colours, dark to light, with a colour bar; texts have
    styles and a legend. Where runs have no value the line has a gap and the foot of the picture a
    mark in its colour; the legend counts them by what became of them. Of a quantity over time each
    run is a line. Runs at random or in a list are points, as what else varies differs between them.

    Args:
        dataset: The result of ``bd.sweep``.
        quantity: Name of a variable of numbers in it.
        x: Name along the x axis; None: "time" if the quantity has it, else the first that is left.
        by: What lines are told apart by; None: what is left, if anything.
        at: The values of all other dimensions, such as ``{"pulley": "alternator"}``.
        ax: Axes to draw into; None: those of a new figure.
        **line: For matplotlib's ``plot``.

    Raises:
        TypeError, ValueError: An argument breaks its rule; another dimension is left.
        ImportError: xarray is not installed.
    """
    part, where = swept.choose(dataset, quantity, at, (x, by))
    along, apart = _named(part, quantity, x, by)
    ax = style.axes(ax)
    scale = swept.scale_of(part, along)
    scale.apply(ax, "x")
    told = _told(part, apart)
    colour_of = _colours(told)
    points = along not in part.dims and not _is_path(dataset)
    drawn = list(_lines(part, quantity, along, scale, told))
    marked = points or np.unique(scale.values).size <= _MARKED
    for one in drawn:
        look: dict[str, Any] = {"linewidth": 1.2}
        look |= {"marker": "o", "markersize": 4.0 if points else 3.0} if marked else {}
        if told.scale is not None and told.scale.texts is not None:
            look["linestyle"] = style.line_style(int(one.rank))["linestyle"]
        look |= {"linestyle": "none"} if points else {}
        _plot(ax, one.x, one.of(part[quantity]), colour_of(one.rank), look, line)
    style.dress(ax, scale.label, swept.label(part[quantity]))
    handles = _of_texts(told, colour_of)
    if not handles and told.scale is not None:
        _colour_bar(ax, told.scale)
    found = swept.failures(part, quantity)
    marks = [
        Line2D([], [], color="0.3", label=text, **_mark(name)) for name, (_, text) in found.items()
    ]
    if marks and not handles:
        style.legend_below(ax, marks)
    if where:
        style.set_title_within(ax, where)
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
        words: dict[str, Any] = {
            key: given[key] for key in ("alpha", "label", "zorder") if key in given
        }
        size = given.get("markersize", given.get("ms", look["markersize"]))
        marker = given.get("marker", look["marker"])
        line = 1.0 if marker != "o" else 0.0
        good = np.isfinite(y)
        words |= {key: look[key] for key in ("transform",) if key in look}
        ax.scatter(
            x[good], y[good], c=colour[good], s=size**2, marker=marker, linewidths=line, **words
        )
        return
    style.draw_line(ax, x, y, look | {"color": colour}, given)


# --- what is drawn over what ---------------------------------------------------------------------


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
        values = part[left[-1]].values if left[-1] in part.coords else [0]
        raise ValueError(
            f"{quantity} has the dimensions {', '.join(dims)}: name x and by, and choose a value "
            f"of the others by at={{{left[-1]!r}: {np.asarray(values)[0].item()!r}}}"
        )
    return str(x), None if by is None else str(by)


def _is_path(dataset: Any) -> bool:
    """Whether runs in a list were swept together, one after the other along a line."""
    return '"zip"' in str(dataset.attrs.get("design", ""))


def _told(part: Any, by: str | None) -> _By:
    if by is None:
        return _By(None, None)
    scale = swept.scale_of(part, by)
    return _By(scale, np.unique(scale.places(), return_inverse=True)[1])


def _lines(part: Any, quantity: str, along: str, scale: swept.Scale, told: _By) -> Iterator[_Line]:
    """Yield the lines; runs at random as one for each value of ``by``."""
    array, order, x = part[quantity], scale.order, scale.values
    by = None if told.scale is None else told.scale.name
    if along in array.dims:
        others = [str(dim) for dim in array.dims if dim != along]
        for index in np.ndindex(*(array.sizes[dim] for dim in others)):
            k = dict(zip(others, index, strict=True)).get("run" if by not in others else str(by), 0)
            rank = 0 if by is None else int(told.ranks[k])
            yield _Line(rank, x, (*others, along), (*index, order))
        return
    # x is a coordinate of the runs
    if by is None:
        yield _Line(0, x, ("run",), (order,))
    elif by in array.dims:
        for k in range(array.sizes[by]):
            yield _Line(int(told.ranks[k]), x, ("run", by), (order, k))
    else:
        ranks = told.ranks[order]
        many = told.scale is not None and told.scale.texts is None and np.unique(ranks).size
        if many and many > _STEPS:
            yield _Line(ranks, x, ("run",), (order,))
            return
        for rank in np.unique(ranks):
            yield _Line(int(rank), x[ranks == rank], ("run",), (order[ranks == rank],))


# --- colours -------------------------------------------------------------------------------------


def _map() -> ListedColormap:
    return ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, _DARK_ENOUGH, 256)))


def _colours(told: _By) -> Any:
    """Return the colour of a rank."""
    if told.scale is None or told.scale.texts is not None:
        return lambda rank: style.COLOURS[rank % len(style.COLOURS)]
    distinct = np.unique(told.scale.values)
    norm = _norm(told.scale)
    stepped = isinstance(norm, BoundaryNorm)
    colours = _map()
    if stepped:
        return lambda rank: colours(rank / max(distinct.size - 1, 1))
    return lambda rank: colours(np.asarray(norm(distinct[rank])))


def _norm(scale: swept.Scale) -> Normalize:
    distinct = np.unique(scale.values)
    if distinct.size <= _STEPS:
        return BoundaryNorm(np.arange(distinct.size + 1) - 0.5, max(distinct.size, 2))
    return (LogNorm if scale.log else Normalize)(distinct[0], distinct[-1])


def _colour_bar(ax: Axes, scale: swept.Scale) -> None:
    distinct = np.unique(scale.values)
    if distinct.size > _STEPS:
        ax.figure.colorbar(ScalarMappable(_norm(scale), _map()), ax=ax, label=scale.label)
        return
    count = distinct.size
    steps = ListedColormap(_map()(np.arange(count) / max(count - 1, 1)))
    norm = BoundaryNorm(np.arange(count + 1) - 0.5, count)
    bar = ax.figure.colorbar(ScalarMappable(norm, steps), ax=ax, label=scale.label)
    bar.set_ticks(list(range(count)), labels=[f"{value:.5g}" for value in distinct])
    bar.ax.minorticks_off()


def _of_texts(told: _By, colour_of: Any) -> list[Artist]:
    """Return the handles of lines that are told apart by texts."""
    if told.scale is None or told.scale.texts is None:
        return []
    return [
        Line2D([], [], label=name, **(style.line_style(k) | {"color": colour_of(k)}))
        for k, name in enumerate(told.scale.texts)
    ]


# --- runs without a value ------------------------------------------------------------------------


def _mark(status: str) -> dict[str, Any]:
    return {"linestyle": "none", "marker": swept.FAILED_LOOKS[status][1], "markersize": 5.0}


def _marks(ax: Axes, absent: Mapping[str, Any], drawn: list[_Line], colour_of: Any) -> None:
    """Mark runs without a value, by status, at the foot of the axes in a row for each line."""
    lacking = [line for line in drawn if any(line.of(where).any() for where in absent.values())]
    if not lacking:
        return
    rows = len(lacking) if len(lacking) <= _ROWS else 1
    style.settle_layout(ax)  # the height of the axes is known after it
    row = _ROW / (ax.get_window_extent().height * 72.0 / ax.figure.figure.dpi)
    row = min(row, 0.5 / (rows + 1))
    for k, line in enumerate(lacking):
        for name, where in absent.items():
            there = line.of(where)
            height = np.full(np.count_nonzero(there), row * (k % rows + 0.6))
            colour = colour_of(line.rank)
            colour = colour[there] if np.ndim(colour) == 2 else colour
            look = _mark(name) | {"transform": ax.get_xaxis_transform()}
            _plot(ax, line.x[there], height, colour, look, {})
    _add_foot(ax, row * (rows + 1))


def _add_foot(ax: Axes, share: float) -> None:
    """Leave this share of the height free below the data."""
    scale = ax.yaxis.get_transform()
    low, high = scale.transform(ax.get_ylim())
    bottom = scale.inverted().transform(low - (high - low) * share / (1.0 - share))
    ax.set_ylim(float(bottom), ax.get_ylim()[1], auto=True)
