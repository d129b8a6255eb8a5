"""Forces along the belt, the drive to scale at one time; these and histories as a figure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..base.checks import integer
from ..outputs.places import along
from ..outputs.quantity import QUANTITIES
from ..result.result import Result
from . import style
from .history import span_tensions, speeds
from .labels import rows_of_names
from .panel import Indices, draws, lines, runs, sample
from .picture import DrivePicture

#: Places to a link: joints are met where they are, and between them forces are interpolated.
_PER_LINK = 4


@draws()
def force_along_belt(
    result: Result,
    t: float | None = None,
    *,
    first: int = 0,
    wraps: bool = True,
    ax: Axes | None = None,
    **line: Any,
) -> Axes:
    """Draw the joint forces along the belt at one time: Fig. 9 of the paper.

    The force of a joint is drawn at the left end of its element, half a number before it; that of a
    cell of an ALE belt, which is one of a place, at its number. With
    ``wraps=False`` and axes that already hold such forces, several times can be compared.

    Args:
        first: Number of the first element; the paper's is 1.
        wraps: Whether to shade the elements on each pulley.
    """
    row = sample(result, t)
    first = integer("first", first, 0)
    n_b = result.params.n_bodies
    ax = style.axes(ax)
    label = f"t = {result.t[row]:.4g} s"
    look: dict[str, Any] = {"marker": ".", "markersize": 3, "linewidth": 0.9, "label": label}
    look |= style.line_style(style.unused(ax, len(style.COLOURS) - 1)) | {"linestyle": "-"}
    flows = result.params._flows
    at = first + np.arange(n_b) - (0.0 if flows else 0.5)
    style.draw_line(ax, at, result.joints.force[row], look, line)
    words = ("cell", "tension") if flows else ("element", "joint force")
    force = QUANTITIES["joints.force"].axis(short=words[1])
    style.dress(ax, f"{words[0]} along the belt", force)
    ax.set_xlim(first - 0.5, first + n_b - 0.5)
    if wraps:
        _shade_wraps(ax, result, row, first)
    if len(ax.lines) > 1:
        ax.set_title("")
        style.legend(ax)
    elif "label" in line:
        style.legend(ax)
    else:
        ax.set_title(label, fontsize="medium")
    return ax


def _shade_wraps(ax: Axes, result: Result, row: int, first: int) -> None:
    """Shade each wrap and label its longest part."""
    longest: dict[int, tuple[int, int]] = {}
    for begin, end, pulley in runs(result.contact.pulley[row]):
        if pulley < 0:
            continue
        ax.axvspan(
            first + begin - 0.5, first + end - 0.5, color=style.tint(pulley), lw=0.0, zorder=0.5
        )
        if end - begin > int(np.subtract(*longest.get(pulley, (0, 0))[::-1])):
            longest[pulley] = begin, end
    names = [style.plain(result.pulleys.names[pulley]) for pulley in longest]
    middles = [first + (begin + end - 1) / 2.0 for begin, end in longest.values()]
    rows_of_names(ax, np.array(middles), names, inside=True)


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
    found = along(result, "joints.force", places, rows)
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
def drive(
    result: Result,
    t: float | None = None,
    *,
    colour: str | None = "tension",
    arcs: bool = True,
    slip_from: float = 0.95,
    links: Indices | Mapping[str, int] | None = None,
    limits: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the drive to scale at one time, as Fig. 5 of the paper.

    Pulleys carry their name or number, beside them if they are small, a mark that turns with them
    and, while they turn, an arrow.
    """
    row = sample(result, t)
    rows = slice(row, row + 1)
    picture = DrivePicture(result, rows, colour, arcs, slip_from, links, limits)
    ax = style.axes(ax, picture.height)
    ax.set_title(f"t = {result.t[row]:.4g} s", fontsize="medium")
    picture.draw(ax)
    picture.move(row)
    picture.add_legend(ax)
    return ax


@draws()
def overview(result: Result, *, t: float | None = None, fig: Figure | None = None) -> Figure:
    """Draw pulley speeds, span tensions, the forces along the belt and the drive to scale.

    Args:
        t: Time of the lower two panels [s], the nearest sample; None: the last.
        fig: Figure to draw into; None: a new one.
    """
    time = result.t[sample(result, t)]
    figure = style.new_figure(10.0, 7.0, dpi=150) if fig is None else fig
    grid = figure.add_gridspec(2, 2, height_ratios=[1.0, 1.3])
    upper = [figure.add_subplot(grid[0, k]) for k in range(2)]
    # Grids of their own: the room below the drive, for its legend, is not taken from the other.
    lower = [figure.add_subplot(grid[1, k].subgridspec(1, 1)[0]) for k in range(2)]
    of_belt, of_drive = (f"{what} at t = {time:.4g} s" for what in ("Along the belt", "The drive"))
    titles = ("Pulley speeds", "Span tensions", of_belt, of_drive)
    for ax, title in zip(upper + lower, titles, strict=True):
        ax.set_title(title)
    force_along_belt(result, time, ax=lower[0]).set_title(of_belt)
    drive(result, time, ax=lower[1]).set_title(of_drive)
    # Last, when it is known how much room is left for their legends.
    speeds(result, ax=upper[0])
    span_tensions(result, ax=upper[1])
    return figure
