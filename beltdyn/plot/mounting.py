"""Drawings of arms, sliders and paths, and their travel over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ..base.checks import Array
from ..drive.parts import Pulley
from ..result.result import Result
from . import style
from .panel import panel, passes_on
from .select import with_samples

__all__ = ["MountPicture", "travel"]

#: How parts of mounts look; an arrow has a look of its own.
_STYLES: dict[str, dict[str, Any]] = {
    "bar": {"lw": 4.0, "solid_capstyle": "round", "alpha": 0.6, "zorder": 1.2},
    "pivot": {"marker": "o", "ms": 7, "mfc": "white", "mew": 1.6, "zorder": 3.4},
    # Behind the pulley, on which its name stands.
    "guide": {"lw": 1.4, "ls": (0, (6, 2, 1, 2)), "zorder": 0.9},
    "way": {"lw": 1.2, "ls": ":", "marker": ".", "zorder": 3.4},
}
_ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": "0.35", "lw": 1.4, "mutation_scale": 14.0}


def _drawn(pulleys: Iterable[Pulley]) -> list[tuple[int, str, Array]]:
    """Return the parts of mounts: index of the pulley, style, points."""
    return [
        (k, part, points)
        for k, pulley in enumerate(pulleys)
        if (mount := pulley.mount) is not None
        for part, points in mount._drawn(np.array(pulley.center), pulley.radius).items()
    ]


class MountPicture:
    """The artists of the mounts of a drive: fixed parts are drawn once, arms are moved."""

    def __init__(self, ax: Axes, pulleys: Sequence[Pulley]) -> None:
        self._bars: list[tuple[int, Array, Any]] = []
        for k, part, points in _drawn(pulleys):
            if part == "pivot":
                (bar,) = ax.plot([], [], color="0.35", **_STYLES["bar"])
                self._bars.append((k, points[0], bar))
            if part == "pull":
                ax.annotate("", tuple(points[1]), tuple(points[0]), arrowprops=_ARROW)
            else:
                ax.plot(*points.T, color="0.35", **_STYLES[part])

    def move(self, centers: Array) -> list[Artist]:
        """Move the arms to the axes (n_p, 2); return the artists that changed."""
        for k, pivot, bar in self._bars:
            bar.set_data([pivot[0], centers[k, 0]], [pivot[1], centers[k, 1]])
        return [bar for _, _, bar in self._bars]

    @staticmethod
    def reach(pulleys: Iterable[Pulley]) -> Array:
        """Return points that a picture must hold besides belt and pulleys: pivots, tips (n, 2)."""
        held = [points for _, part, points in _drawn(pulleys) if part != "way"]
        return np.concatenate([np.empty((0, 2)), *held])


@passes_on()
def travel(result: Result, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the travel of arms and sliders over time, from the places of the drive.

    Arms in degrees, counter-clockwise, sliders in millimetres along their direction; paths are
    prescribed and left out.

    Args:
        result: A run of a drive with mounts, with at least one sample.
        ax: Axes to draw into; None: those of a new figure.
        **line: Passed to ``plot``.

    Raises:
        TypeError, ValueError: An argument breaks its rule; the drive has no arm and no slider.
    """
    params = with_samples(result).params
    moving = [(m, k, *mount._row.shown) for m, k, mount in params._moving]
    if result.mounts is None or not moving:
        raise ValueError("no pulley of this drive is on an arm or a slider")
    units = sorted({unit for *_, unit in moving})
    curves = []
    for m, k, factor, unit in moving:
        name = style.plain(result.pulleys.names[k])
        label = name if len(units) == 1 else f"{name} [{unit}]"
        curves.append((k, label, result.t, factor * result.mounts.travel[:, m]))
    return panel(ax, curves, line, y=f"travel from the drawn place [{', '.join(units)}]")
