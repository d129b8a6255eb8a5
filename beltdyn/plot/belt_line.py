"""The belt in places fixed in space: tension along the belt line, arcs of contact and slip."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from ..outputs.quantity import QUANTITIES, TIME
from ..result.result import Result
from . import style
from .labels import rows_of_names
from .panel import draws, lines, named_pulleys
from .select import Pulleys, sample

#: Places to a link: joints are met where they are, and between them forces are interpolated.
_PER_LINK = 4


@draws()
def tension_along(
    result: Result,
    t: float | Iterable[float] | None = None,
    *,
    ax: Axes | None = None,
    **line: Any,
) -> Axes:
    """Draw the tension along the belt line, in places fixed in space, at some times.

    Places are counted from where the belt leaves pulley 0, in the sense in which its links are
    numbered; the wraps on the pulleys are shaded and named. A belt that runs in that sense is drawn
    from left to right. Where the tension changes on a wrap, friction carries torque; it is constant
    where the belt sticks and has not stretched since it arrived.

    Args:
        t: Times [s], of each the nearest sample; None: the last.
        **line: For matplotlib's ``plot``. A ``label`` stands before the times if there are several.

    Raises:
        AttributeError: ``joints.force`` or ``belt`` was not asked for.
    """
    times = list(t) if isinstance(t, Iterable) and not isinstance(t, str) else [t]
    if not times:
        raise ValueError("t must hold at least one time, got none")
    rows = [sample(result, one) for one in times]
    n_s = _PER_LINK * result.params.n_bodies
    places = np.linspace(0.0, result.params.route.length, n_s + 1)
    found = result._along("joints.force", places, rows)
    ax = style.axes(ax)
    first = not ax.lines
    curves = [
        (k, f"t = {result.t[row]:.4g} s", found.s, found.values[k]) for k, row in enumerate(rows)
    ]
    lines(ax, curves, line)
    force = QUANTITIES["joints.force"].axis(short="tension")
    style.dress(ax, "place along the belt line [m]", force)
    ax.set_xlim(0.0, found.length)
    if first:
        for begin, end in found.wraps:
            ax.axvspan(begin, end, color="0.93", lw=0.0, zorder=0.5)
        names = [style.plain(name) for name in result.pulleys.names]
        rows_of_names(ax, found.wraps.mean(axis=1), names)
    style.legend(ax)  # a title would stand among the names of the pulleys
    return ax


@draws()
def arcs(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the arcs of contact over time in degrees, and what of them slips, shaded.

    Where the shade reaches the line, the whole wrap slips and friction can carry no more; between
    the two the belt sticks. A link slips from 95 % of full friction on (:class:`beltdyn.Arcs`).

    Raises:
        AttributeError: An output that :attr:`beltdyn.Result.arcs` needs was not asked for.
    """
    found = result.arcs
    columns, wrap = named_pulleys(result, pulleys), np.degrees(found.wrap)
    ax = style.axes(ax)
    lines(ax, [(k, name, result.t, wrap[:, k]) for k, _, name in columns], line)
    for (k, *_), drawn in zip(columns, ax.lines[-len(columns) :], strict=True):
        slip = np.degrees(found.slip[:, k])
        ax.fill_between(result.t, slip, color=drawn.get_color(), alpha=0.25, lw=0.0)
    style.dress(ax, TIME.axis(), "arc [deg]")
    ax.set_ylim(bottom=0.0)
    style.legend(ax, handles=[*ax.lines, Patch(color="0.75", label="shaded: slips")])
    return ax
