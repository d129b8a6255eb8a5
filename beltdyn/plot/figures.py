"""Figures of several panels."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..result import Result
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
    (top_left, top_right), (bottom_left, bottom_right) = figure.subplots(2, 2)
    speeds(result, ax=top_left).set_title("Pulley speeds")
    span_tensions(result, ax=top_right).set_title("Span tensions")
    force_along_belt(result, time, ax=bottom_left).set_title(f"Along the belt at t = {time:.4g} s")
    drive(result, time, ax=bottom_right).set_title(f"The drive at t = {time:.4g} s")
    return figure
