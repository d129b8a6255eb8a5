"""Figures of several panels."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..result.result import Result
from . import style
from .belt import drive, force_along_belt
from .history import span_tensions, speeds
from .select import sample, with_samples

__all__ = ["overview"]


def overview(result: Result, *, t: float | None = None, fig: Figure | None = None) -> Figure:
    """Draw pulley speeds, span tensions, the forces along the belt and the drive to scale.

    Args:
        result: A run with at least one sample.
        t: Time of the lower two panels [s], the nearest sample; None: the last.
        fig: Figure to draw into; None: a new one.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """
    result = with_samples(result)
    time = result.t[sample(result, t)]
    figure = style.new_figure(10.0, 7.0, dpi=150) if fig is None else fig
    grid = figure.add_gridspec(2, 2, height_ratios=[1.0, 1.3])
    top_left, top_right = (figure.add_subplot(grid[0, k]) for k in range(2))
    # Grids of their own: the room below the drive, for its legend, is not taken from the other.
    bottom_left, bottom_right = (
        figure.add_subplot(grid[1, k].subgridspec(1, 1)[0]) for k in range(2)
    )
    titles = {
        top_left: "Pulley speeds",
        top_right: "Span tensions",
        bottom_left: f"Along the belt at t = {time:.4g} s",
        bottom_right: f"The drive at t = {time:.4g} s",
    }
    for ax, title in titles.items():
        ax.set_title(title)
    force_along_belt(result, time, ax=bottom_left).set_title(titles[bottom_left])
    drive(result, time, ax=bottom_right).set_title(titles[bottom_right])
    # Last, when it is known how much room is left for their legends.
    speeds(result, ax=top_left)
    span_tensions(result, ax=top_right)
    return figure
