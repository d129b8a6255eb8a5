"""Arms, sliders and paths of pulleys as they are drawn, and their travel over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ..checks import Array
from ..mounts import Arm, Path, Slider
from ..parts import Pulley
from ..result import Result
from . import style

__all__ = ["MountPicture", "travel"]

#: Half of a slider's guide, and the arrow of its weight beyond it, in radii of its pulley.
_GUIDE, _TIP = 1.6, 0.5
_LOOK: dict[str, Any] = {"color": "0.35", "zorder": 1.2}


class MountPicture:
    """The artists of the mounts of a drive: what stands still is drawn once, arms are moved.

    Args:
        ax: Where to draw.
        pulleys: The pulleys of the drive.
    """

    def __init__(self, ax: Axes, pulleys: Sequence[Pulley]) -> None:
        self._arms: list[tuple[int, Array, Any]] = []
        for k, pulley in enumerate(pulleys):
            center, mount = np.array(pulley.center), pulley.mount
            if isinstance(mount, Arm):
                pivot = np.array(mount.pivot)
                (line,) = ax.plot([], [], lw=4.0, solid_capstyle="round", alpha=0.6, **_LOOK)
                ax.plot(*pivot, marker="o", ms=7, mfc="white", mew=1.6, **(_LOOK | {"zorder": 3.4}))
                self._arms.append((k, pivot, line))
            elif isinstance(mount, Slider):
                self._guide(ax, center, np.array(mount.direction), pulley.radius, mount)
            elif isinstance(mount, Path):
                way = center[:, None] + mount.displacement.T
                ax.plot(*way, lw=1.2, ls=":", marker=".", **(_LOOK | {"zorder": 3.4}))

    @staticmethod
    def _guide(ax: Axes, center: Array, direction: Array, radius: float, mount: Slider) -> None:
        along = direction / np.hypot(*direction)
        ends = center[:, None] + _GUIDE * radius * np.outer(along, [-1.0, 1.0])
        # Behind the pulley, on which its name stands.
        ax.plot(*ends, lw=1.4, ls=(0, (6, 2, 1, 2)), **(_LOOK | {"zorder": 0.9}))
        if mount.weight > 0.0:
            tip = {"arrowstyle": "-|>", "color": "0.35", "lw": 1.4, "mutation_scale": 14.0}
            head, tail = ends[:, 1] + _TIP * radius * along, ends[:, 1]
            ax.annotate("", tuple(head), tuple(tail), arrowprops=tip)

    def move(self, centers: Array) -> list[Artist]:
        """Put the arms where the axes (n_p, 2) are; give the artists that changed."""
        for k, pivot, line in self._arms:
            line.set_data([pivot[0], centers[k, 0]], [pivot[1], centers[k, 1]])
        return [line for _, _, line in self._arms]

    @staticmethod
    def reach(pulleys: Iterable[Pulley]) -> Array:
        """Give points that a picture must hold besides belt and pulleys: pivots, tips (n, 2)."""
        points: list[Any] = [p.mount.pivot for p in pulleys if isinstance(p.mount, Arm)]
        for one in pulleys:
            if isinstance(one.mount, Slider):
                along = np.array(one.mount.direction) / np.hypot(*one.mount.direction)
                tip = _GUIDE + _TIP * (one.mount.weight > 0.0)
                points += [np.array(one.center) + s * one.radius * along for s in (-_GUIDE, tip)]
        return np.array(points, dtype=float).reshape(-1, 2)


def travel(result: Result, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the travel of arms and sliders over time, from the places of the drive.

    Arms in degrees, counter-clockwise, sliders in millimetres along their direction; paths are
    prescribed and left out.

    Args:
        result: A run of a drive with mounts.
        ax: Axes to draw into; None: those of a new figure.
        **line: Passed to ``plot``.

    Raises:
        ValueError: The drive has no arm and no slider.
    """
    params = result.params
    arm, slider = (180.0 / np.pi, "deg"), (1e3, "mm")
    moving = [
        (m, k, *(arm if isinstance(params.pulleys[k].mount, Arm) else slider))
        for m, k in enumerate(params.mounted)
        if not isinstance(params.pulleys[k].mount, Path)
    ]
    if result.mounts is None or not moving:
        raise ValueError("no pulley of this drive is on an arm or a slider")
    ax = style.axes(ax)
    units = sorted({unit for *_, unit in moving})
    for m, k, factor, unit in moving:
        way = factor * result.mounts.travel[:, m]
        name = style.plain(result.pulleys.names[k])
        label = name if len(units) == 1 else f"{name} [{unit}]"
        ax.plot(result.t, way, **({"label": label} | style.line_style(k) | {"lw": 1.2} | line))
    style.dress(ax, "time [s]", f"travel from the drawn place [{', '.join(units)}]")
    style.legend(ax)
    return ax
