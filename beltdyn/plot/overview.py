"""Figures of several panels."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..result.result import Result
from . import style
from .belt import drive, force_along_belt
from .history import span_tensions, speeds
from .panel import draws
from .select import sample


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
