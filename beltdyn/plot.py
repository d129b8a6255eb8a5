"""Figures of results. Needs matplotlib; makes no windows and changes no global settings."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from .result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["overview"]

# Okabe and Ito: told apart with any colour vision; the line styles do in black and white.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_LINES = ("-", "--", "-.", ":")
_TENSION_MAP = "viridis"


def overview(result: Result, *, t: float | None = None, fig: Figure | None = None) -> Figure:
    """Pulley speeds, span tensions, the forces along the belt and the drive to scale.

    Args:
        result: A run with at least one sample.
        t: Time of the lower two panels [s], the nearest sample; None: the last.
        fig: Figure to draw into; None: a new one.

    Raises:
        ValueError: The result holds no samples.
    """
    if result.t.size == 0:
        raise ValueError("result must hold at least one sample to be drawn")
    row = result.t.size - 1 if t is None else int(np.argmin(np.abs(result.t - t)))
    figure = Figure(figsize=(10.0, 7.0), dpi=150, layout="constrained") if fig is None else fig
    (speeds, tensions), (forces, drive) = figure.subplots(2, 2)
    _draw_speeds(speeds, result)
    _draw_tensions(tensions, result)
    _draw_forces(forces, result, row)
    _draw_drive(drive, result, row)
    for axes in (speeds, tensions, forces):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.9", linewidth=0.6)
        axes.set_axisbelow(True)
    return figure


def _style(k: int) -> dict[str, Any]:
    return {"color": _COLOURS[k % len(_COLOURS)], "linestyle": _LINES[k % len(_LINES)]}


def _draw_speeds(axes: Axes, result: Result) -> None:
    for k, omega in enumerate(result.pulleys.omega.T):
        axes.plot(result.t, omega, label=f"pulley {k}", linewidth=1.2, **_style(k))
    axes.set(xlabel="time [s]", ylabel="angular velocity [rad/s]", title="Pulley speeds")
    axes.legend(framealpha=0.8, edgecolor="none")


def _draw_tensions(axes: Axes, result: Result) -> None:
    n_p = len(result.params.pulleys)
    for k, tension in enumerate(result.span_tension.T):
        label = f"from pulley {k} to {(k + 1) % n_p}"
        axes.plot(result.t, tension, label=label, linewidth=1.2, **_style(k))
    axes.set(xlabel="time [s]", ylabel="mean joint force [N]", title="Span tensions")
    axes.legend(framealpha=0.8, edgecolor="none")


def _runs(values: NDArray[np.int32]) -> Iterator[tuple[int, int, int]]:
    """Begin, end and value of every run of equal values."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    for begin, end in pairwise(edges):
        yield begin, end, int(values[begin])


def _draw_forces(axes: Axes, result: Result, row: int) -> None:
    n_b = result.params.belt.n_bodies
    shaded: set[int] = set()
    for begin, end, pulley in _runs(result.contact.pulley[row]):
        if pulley >= 0:
            label = None if pulley in shaded else f"on pulley {pulley}"
            shaded.add(pulley)
            colour = _COLOURS[pulley % len(_COLOURS)]
            axes.axvspan(begin - 0.5, end - 0.5, color=colour, alpha=0.18, lw=0, label=label)
    links = np.arange(n_b)
    axes.plot(links - 0.5, result.joints.force[row], ".-", color="black", ms=3, lw=0.9)
    axes.set(
        xlabel="joint, numbered along the belt",
        ylabel="joint force [N]",
        title=f"Along the belt at t = {result.t[row]:.4g} s",
        xlim=(-0.5, n_b - 0.5),
    )
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: int(labels[k].rpartition(" ")[2]))
    axes.legend(
        [handles[k] for k in order], [labels[k] for k in order], framealpha=0.8, edgecolor="none"
    )


def _draw_drive(axes: Axes, result: Result, row: int) -> None:
    belt, half = result.belt, result.params.info["link_length"] / 2.0
    centre = np.stack([belt.x[row], belt.y[row]], axis=-1)
    along = half * np.stack([np.cos(belt.phi[row]), np.sin(belt.phi[row])], axis=-1)
    ends = np.stack([centre - along, centre + along], axis=1)
    force = result.joints.force[row]
    for k, pulley in enumerate(result.params.pulleys):
        axes.add_patch(Circle(pulley.center, pulley.radius, facecolor="0.93", edgecolor="0.6"))
        angle = result.pulleys.theta[row, k]
        rim = np.array(pulley.center) + 0.75 * pulley.radius * np.array(
            [np.cos(angle), np.sin(angle)]
        )
        axes.plot(*zip(pulley.center, rim, strict=True), color="0.6", linewidth=1.0)
        axes.annotate(
            f"{k}", pulley.center, ha="center", va="center", bbox={"fc": "0.93", "ec": "none"}
        )
    # A link is coloured by the mean of the joints at its two ends.
    lines = LineCollection(
        list(ends),
        array=(force + np.roll(force, -1)) / 2.0,
        cmap=_TENSION_MAP,
        linewidths=4.0,
        capstyle="round",
    )
    axes.add_collection(lines)
    axes.figure.colorbar(lines, ax=axes, label="joint force [N]", shrink=0.8)
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.autoscale_view()
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"The drive at t = {result.t[row]:.4g} s")
    axes.spines[["top", "right"]].set_visible(False)
