"""Drawings of pulleys, arms, sliders and paths, to scale."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from ..base.checks import Array
from ..drive.parts import Pulley
from . import style

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


def draw_pulley(ax: Axes, center: Sequence[float] | Array, radius: float, **look: Any) -> Circle:
    """Draw a pulley to scale; ``look`` goes to the patch."""
    metal: dict[str, Any] = {"fc": style.METAL, "ec": "0.6", "lw": 0.8}
    x, y = map(float, center)
    rim = Circle((x, y), radius, **metal | look)
    ax.add_patch(rim)
    return rim


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
