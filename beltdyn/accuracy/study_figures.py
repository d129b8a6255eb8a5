"""Figures of a study: what accuracy costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import (
    FixedLocator,
    FormatStrFormatter,
    LogLocator,
    NullFormatter,
    NullLocator,
    ScalarFormatter,
)

from ..plot import style

#: ``bd.accuracy.Study``, which imports this module to draw itself, and its rows.
Study: TypeAlias = Any
Row: TypeAlias = Any
_COST = "CPU time of the run [s]"
_MARKERS = "osD^v<>p"
#: Look of numbers above points.
_ABOVE: dict[str, Any] = {"xytext": (4, 8), "textcoords": "offset points", "ha": "center"}
_ABOVE |= {"fontsize": "small", "color": "0.3"}


def price(study: Study, quantity: str, error: float) -> Figure:
    """Draw a study: cost of errors and of meshes, and errors in space and time compared."""
    figure = style.new_figure(11.0, 9.0, dpi=120)
    (top_left, top_right), (bottom_left, bottom_right) = figure.subplots(2, 2)
    _cost_of_errors(top_left, study, quantity)
    _cost_of_meshes(top_right, study)
    _errors_of_meshes(bottom_left, study, quantity, error)
    _cheapest_runs(bottom_right, study, quantity, error)
    return figure


def _cost_of_errors(ax: Axes, study: Study, quantity: str) -> None:
    """Draw CPU time against error, of each method the cheapest runs on any mesh."""
    for k, method in enumerate(_methods(study)):
        front = study.front(quantity, method)
        errors = [study.believed(row, quantity) for row in front]
        ax.plot(errors, _costs(front), label=method, **_look(k))
    floor = study.space_floor[quantity]
    low, high = _range([study.believed(row, quantity) for row in study.done()] + [floor])
    ax.axvspan(low, floor, color="0.92", zorder=0, label="below the floor")
    ax.set(xscale="log", yscale="log", xlim=(low, high), title="Cost of an error, by method")
    ax.invert_xaxis()
    style.dress(ax, f"error of {_words(quantity)} [1]", _COST)
    style.legend(ax)


def _cost_of_meshes(ax: Axes, study: Study) -> None:
    """Draw CPU time against the number of links, by method at a loose and a tight tolerance."""
    for k, method in enumerate(_methods(study)):
        rows = [row for row in study.done() if row.setting.method == method]
        for rtol, hollow in zip(_two(rows), (True, False), strict=False):
            some = [row for row in rows if row.setting.rtol == rtol]
            look = _look(k) | ({"markerfacecolor": "white"} if hollow else {})
            ax.plot(_meshes(some), _costs(some), label=f"{method} {_power(rtol)}", **look)
    _links(ax, study, "Cost of a finer mesh")
    style.dress(ax, f"number of {study.nodes}", _COST)
    style.legend_below(ax, ax.get_lines())


def _errors_of_meshes(ax: Axes, study: Study, quantity: str, error: float) -> None:
    """Draw the errors in space, and in time of the cheapest runs, against the number of links."""
    bold = _look(0) | {"linewidth": 2.2, "color": "black", "linestyle": "-"}
    errors = [found[quantity] for found in study.space.values()]
    ax.plot(list(study.space), errors, label="in space", **bold)
    best = study.cheapest(error, quantity)
    fastest = study.front(quantity)
    method = best.setting.method if best else fastest[-1].setting.method if fastest else ""
    rows = [row for row in study.done() if row.setting.method == method]
    for k, rtol in enumerate(sorted({row.setting.rtol for row in rows}, reverse=True)):
        some = [row for row in rows if row.setting.rtol == rtol]
        errors = [row.time[quantity] for row in some]
        ax.plot(_meshes(some), errors, label=f"in time, {method} {_power(rtol)}", **_look(k))
    _links(ax, study, "Errors in space and in time")
    _mark(ax, study, quantity, error, best, best.setting.n_bodies if best else 0)
    style.dress(ax, f"number of {study.nodes}", f"error of {_words(quantity)} [1]")
    marked = [line for line in ax.get_lines() if str(line.get_marker()) in tuple(_MARKERS)]
    style.legend_below(ax, marked)


def _cheapest_runs(ax: Axes, study: Study, quantity: str, error: float) -> None:
    """Draw the errors of the cheapest run of each number of links against CPU time."""
    front = study.front(quantity)
    cost = _costs(front)
    parts = (
        ("in all", [study.believed(row, quantity) for row in front]),
        ("in space", [study.space[row.setting.n_bodies][quantity] for row in front]),
        ("in time", [row.time[quantity] for row in front]),
    )
    for k, (name, errors) in enumerate(parts):
        wide = {} if k else {"linewidth": 5.0, "alpha": 0.35, "markersize": 9.0}
        ax.plot(cost, errors, label=name, **_look(k) | wide)  # the others lie on it in parts
    best = study.cheapest(error, quantity)
    _mark(ax, study, quantity, error, best, best.seconds if best else 0.0)
    ax.set(xscale="log", yscale="log", title="The cheapest runs")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    style.dress(ax, _COST, f"error of {_words(quantity)} [1]")
    _number(ax, front, parts[0][1])
    style.legend(ax)


def _number(ax: Axes, rows: Sequence[Row], heights: Sequence[float]) -> None:
    """Write the number of links above the first run on each mesh."""
    before = None
    for row, height in zip(rows, heights, strict=True):
        if row.setting.n_bodies != before:
            ax.annotate(f"{row.setting.n_bodies}", (row.seconds, height), **_ABOVE)
        before = row.setting.n_bodies


def _mark(
    ax: Axes, study: Study, quantity: str, error: float, best: Row | None, place: float
) -> None:
    """Draw a line at the error asked for, and a star at the cheapest run that reaches it."""
    ax.axhline(error, color="0.5", linewidth=0.8, linestyle=":", marker="")
    if best is None:
        return
    one = best.setting
    label = (
        f"cheapest for {error:.2g}: {one.method} {_power(one.rtol)},\n{one.n_bodies} "
        f"{study.nodes}, {best.seconds:.2g} s"
    )
    height = study.believed(best, quantity)
    ax.plot([place], [height], "*", color="black", markersize=13, label=label)


def _costs(rows: Sequence[Row]) -> list[float]:
    return [row.seconds for row in rows]


def _meshes(rows: Sequence[Row]) -> list[int]:
    return [row.setting.n_bodies for row in rows]


def _links(ax: Axes, study: Study, title: str) -> None:
    ax.set(xscale="log", yscale="log", title=title)
    ax.xaxis.set_major_locator(FixedLocator(list(study.space)))
    ax.xaxis.set_major_formatter(ScalarFormatter())
    ax.xaxis.set_minor_locator(NullLocator())


def _power(rtol: float) -> str:
    """Write a tolerance: 10 to a power where it is one."""
    exponent = math.log10(rtol)
    if abs(exponent - round(exponent)) < 1e-9:
        return f"$10^{{{round(exponent)}}}$"
    return f"{rtol:g}"


def _methods(study: Study) -> list[str]:
    return list(dict.fromkeys(row.setting.method for row in study.done()))


def _two(rows: Sequence[Row]) -> list[float]:
    """Return a loose and a tight tolerance, of those that there are."""
    rtols = sorted({row.setting.rtol for row in rows}, reverse=True)
    chosen = [rtol for rtol in rtols if rtol in (1e-2, 1e-4)]
    return chosen or rtols[:1]


def _look(k: int) -> dict[str, Any]:
    marker = {"marker": _MARKERS[k % len(_MARKERS)], "markersize": 4.5, "linewidth": 1.2}
    return style.line_style(k) | marker


def _range(values: Sequence[float]) -> tuple[float, float]:
    there = [value for value in values if value > 0.0 and math.isfinite(value)]
    return 0.5 * min(there, default=1e-6), 2.0 * max(there, default=1.0)


def _words(quantity: str) -> str:
    return quantity.replace("_", " ")
