"""Modes of vibration and frequency responses."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..base.checks import Array, integer, positive
from ..base.rounding import percent
from ..outputs.quantity import QUANTITIES, SPANS
from ..outputs.spans import lines_of_cells
from ..vibration import FrequencyResponse, Modes
from . import style
from .animation import Animation
from .panel import Curve, choice, columns, draws, lines
from .to_scale import Machine, draw_pulley

#: Largest displacement drawn, against the size of the drive; and largest turning drawn [rad].
_LARGEST, _TURN = 0.045, 0.6


class _ModePicture:
    """A drive in a mode: belt, pulleys with a mark that turns, arms."""

    def __init__(self, ax: Axes, modes: Modes, k: int, scale: float) -> None:
        self.modes, self.k, self.ax = modes, k, ax
        self.params = modes.params
        self.centers = np.array(self.params.centers(modes.state.travel))
        self.nodes = _nodes(modes)
        self.rest = self._line(self.nodes, self.centers)
        self.scale = positive("scale", scale, "1") * _LARGEST * float(np.ptp(self.rest, 1).max())
        ax.plot(*self.rest, color="0.72", lw=1.0, label="at rest")
        self.machine = Machine(ax, self.params.pulleys, self.centers, fc="none", ec="0.8")

    def _line(self, points: Array, axes: Array, deflection: Array | None = None) -> Array:
        """Return the closed belt line (2, n) through links, or where cells begin (2, n_b)."""
        if self.params._flows:
            points = np.vstack(lines_of_cells(self.params, points.T, axes, deflection)).T
        return np.hstack([points, points[:, :1]])

    def belt(self, phase: complex) -> Array:
        """Places of the belt, exaggerated."""
        shapes, k = self.modes.shapes, self.k
        moved = np.array([(shapes.x[k] * phase).real, (shapes.y[k] * phase).real])
        across = self.scale * (shapes.deflection[k] * phase).real
        return self._line(self.nodes + self.scale * moved, self.axes_at(phase), across)

    def axes_at(self, phase: complex) -> Array:
        """Axes of the pulleys, exaggerated: along what their mounts do for a small travel."""
        travel = np.array(self.modes.state.travel)
        if not travel.size:
            return self.centers
        small = (self.modes.shapes.travel[self.k] * phase).real
        h = 1e-6 / max(float(abs(small).max()), 1e-12)
        step = np.array(self.params.centers(travel + h * small)) - self.centers
        return np.asarray(self.centers + self.scale * step / h)

    def marks(self, phase: complex) -> list[Array]:
        """Return a radius of each pulley as a line: rims move as far as the belt, or _TURN."""
        theta = self.modes.shapes.theta[self.k]
        largest = self.scale * abs(theta).max()
        less = min(1.0, _TURN / largest) if largest > 0.0 else 1.0
        turns = less * self.scale * (theta * phase).real
        reach = self.params._radii[:, None] * np.column_stack([-np.sin(turns), np.cos(turns)])
        ends = zip(self.axes_at(phase), reach, strict=True)
        return [np.column_stack([center + 0.35 * mark, center + mark]) for center, mark in ends]

    def dress(self) -> None:
        """Set limits, the title and what is below the axes; name the pulleys, the last of it."""
        ax, modes, k = self.ax, self.modes, self.k
        style.dress(ax, "x [m]", "y [m]")
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.08)
        said = f"mode {k}: {modes.frequency[k]:.4g} Hz, damping {percent(modes.damping[k])}"
        handles = ax.get_legend_handles_labels()[0]
        style.legend_below(ax, handles if len(handles) > 1 else ())
        style.set_title(ax, f"{said}\n{style.plain(modes.names[k])}")
        self.machine.name(path_effects=style.HALO, zorder=6)
        self.machine.place_names(np.hstack([self.belt(1.0), self.belt(-1.0)]).T, marks=1)


def _nodes(modes: Modes) -> Array:
    """Where the links are at the state, or the cells begin (2, n_b) [m]."""
    seen = modes.params._model.observe(modes.state._to_core(modes.params))
    return np.array([seen["x"][0], seen["y"][0]])


def _height(modes: Modes) -> float:
    """Height of a figure that the drive fills [inch]."""
    return style.height_to_scale(np.ptp(_nodes(modes), axis=1), beside=1.3, below=1.8)


@draws()
def mode(modes: Modes, k: int = 0, *, scale: float = 1.0, ax: Axes | None = None) -> Axes:
    """Draw a mode: the belt, exaggerated, at two opposite phases over the line at rest.

    Marks on the pulleys turn with them, as much exaggerated as the belt, by at most 34 degrees.
    """
    ax = style.axes(ax, _height(modes))
    picture = _ModePicture(ax, modes, integer("k", k, 0, len(modes) - 1), scale)
    for side, (phase, words) in enumerate(((1.0, "one end"), (-1.0, "half a period later"))):
        look: dict[str, Any] = style.line_style(side)
        ax.plot(*picture.belt(phase), lw=1.8, label=words, **look)
        for mark in picture.marks(phase):
            ax.plot(*mark, lw=1.8, **look)
        centers = picture.axes_at(phase)
        for j in modes.params.mounted:
            radius = modes.params.pulleys[j].radius
            draw_pulley(ax, centers[j], radius, fc="none", ec=look["color"])
    picture.dress()
    return ax


@draws()
def animate_mode(
    modes: Modes, k: int = 0, *, scale: float = 1.0, duration: float = 2.0, fps: float = 20.0
) -> Animation:
    """Animate one period of a mode, shown over ``duration`` seconds.

    Args:
        duration: Duration of the period shown [s].
        fps: Frames per second.
    """
    k = integer("k", k, 0, len(modes) - 1)
    frames = max(2, round(positive("duration", duration, "s") * positive("fps", fps, "1/s")))
    figure = style.new_figure(height=_height(modes), own=True)
    ax = figure.add_subplot()
    picture = _ModePicture(ax, modes, k, scale)
    (belt,) = ax.plot(*picture.belt(1.0), lw=1.8, color=style.COLOURS[0])
    look: dict[str, Any] = {"lw": 1.8, "color": style.COLOURS[1]}
    marks = [ax.plot(*mark, **look)[0] for mark in picture.marks(0.0)]
    ax.plot(*picture.belt(-1.0), alpha=0.0)  # so that the limits hold both ends
    picture.dress()

    def show(row: np.int64) -> None:
        phase = complex(np.exp(2j * np.pi * int(row) / frames))
        belt.set_data(*picture.belt(phase))
        for drawn, mark in zip(marks, picture.marks(phase), strict=True):
            drawn.set_data(*mark)
        picture.machine.move(picture.axes_at(phase))

    return Animation(figure, show, np.arange(frames, dtype=np.int64), frames / duration)


def _unbroken(frequency: Array, phase: Array) -> tuple[Array, Array]:
    """Leave a gap where a phase [deg] goes on at the other end of its range: it does not jump."""
    ends = np.flatnonzero(abs(np.diff(phase)) > 270.0) + 1
    return np.insert(frequency, ends, np.nan), np.insert(phase, ends, np.nan)


#: Quantities of a response, and what their axis calls them if not as elsewhere.
_QUANTITIES = {
    "theta": (QUANTITIES["pulleys.theta"], "angle"),
    "omega": (QUANTITIES["pulleys.omega"], "speed"),
    SPANS: (QUANTITIES[SPANS], ""),
    "travel": (QUANTITIES["mounts.travel"], "travel"),
}


@draws()
def frequency_response(
    response: FrequencyResponse,
    output: str = "theta",
    which: Any = None,
    *,
    axes: tuple[Axes, Axes] | None = None,
) -> tuple[Axes, Axes]:
    """Draw the amplitudes of a frequency response and their phases over the frequency.

    Args:
        response: From :func:`beltdyn.frequency_response`.
        output: "theta", "omega", "span_tension" (of the span after each pulley) or "travel".
        which: Pulleys, by index or name, one or several; None: all. Of "travel" all mounts are
            drawn.
        axes: Axes for amplitude and phase; None: those of a new figure.
    """
    choice("output", output, tuple(_QUANTITIES))
    params = response.params
    row, short = _QUANTITIES[output]
    asked = columns(params, row.dimensions[0], None if output == "travel" else which)
    if axes is None:
        figure = style.new_figure(6.4, 5.0)
        axes = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    upper, lower = (style.axes(ax) for ax in axes)
    at, values = response.frequency, getattr(response, output)
    lines(upper, [Curve(k, name, at, abs(values[:, n])) for k, n, name in asked], {})
    phases = np.degrees(np.angle(values))
    lines(lower, [Curve(k, name, *_unbroken(at, phases[:, n])) for k, n, name in asked], {})
    upper.set_yscale("log")
    along = "frequency [Hz]"
    below = upper.get_shared_x_axes().joined(upper, lower)
    style.dress(upper, "" if below else along, f"amplitude of {row.axis(short=short)}")
    style.dress(lower, along, "phase [deg]")
    lower.set_yticks([-180, -90, 0, 90, 180])
    style.legend(upper)
    return upper, lower
