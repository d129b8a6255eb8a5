"""Arms, sliders and paths of pulleys as they are drawn, and their travel over time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ..checks import Array
from ..parts import Pulley
from ..result import Result
from . import style

__all__ = ["MountPicture", "travel"]

#: Half of a slider's guide, and the arrow of its weight beyond it, in radii of its pulley.
_GUIDE, _TIP = 1.6, 0.5
_LOOK: dict[str, Any] = {"color": "0.35", "zorder": 1.2}


def _arm(ax: Axes, pulley: Pulley, mount: Any) -> Any:
    """Draw the pivot; give what reaches from there to the axis."""
    (line,) = ax.plot([], [], lw=4.0, solid_capstyle="round", alpha=0.6, **_LOOK)
    ax.plot(*mount.pivot, marker="o", ms=7, mfc="white", mew=1.6, **(_LOOK | {"zorder": 3.4}))
    return line


def _slider(ax: Axes, pulley: Pulley, mount: Any) -> None:
    start, end, tip = _ends_of_slider(pulley, mount)
    # Behind the pulley, on which its name stands.
    ax.plot(
        *zip(start, end, strict=True), lw=1.4, ls=(0, (6, 2, 1, 2)), **(_LOOK | {"zorder": 0.9})
    )
    if mount.weight > 0.0:
        look = {"arrowstyle": "-|>", "color": "0.35", "lw": 1.4, "mutation_scale": 14.0}
        ax.annotate("", tuple(tip), tuple(end), arrowprops=look)


def _ends_of_slider(pulley: Pulley, mount: Any) -> list[Array]:
    """Give both ends of its guide, and the tip of the arrow of its weight."""
    center = np.array(pulley.center)
    along = pulley.radius * mount._direction(center)
    tip = _GUIDE + _TIP * (mount.weight > 0.0)
    return [center + s * along for s in (-_GUIDE, _GUIDE, tip)]


def _path(ax: Axes, pulley: Pulley, mount: Any) -> None:
    way = np.array(pulley.center)[:, None] + mount.displacement.T
    ax.plot(*way, lw=1.2, ls=":", marker=".", **(_LOOK | {"zorder": 3.4}))


#: By kind how it is drawn, which may give a line from the first point to the axis; and points that
#: a picture must hold besides belt and pulleys.
_DRAWN: dict[str, tuple[Callable[[Axes, Pulley, Any], Any], Callable[[Pulley, Any], list[Any]]]] = {
    "arm": (_arm, lambda _, mount: [mount.pivot]),
    "slider": (_slider, _ends_of_slider),
    "path": (_path, lambda *_: []),
}


class MountPicture:
    """The artists of the mounts of a drive: what stands still is drawn once, arms are moved.

    Args:
        ax: Where to draw.
        pulleys: The pulleys of the drive.
    """

    def __init__(self, ax: Axes, pulleys: Sequence[Pulley]) -> None:
        self._lines: list[tuple[int, Any, Any]] = []
        for k, pulley in enumerate(pulleys):
            if (mount := pulley.mount) is not None:
                draw, reach = _DRAWN[mount._row.name]
                if (line := draw(ax, pulley, mount)) is not None:
                    self._lines.append((k, reach(pulley, mount)[0], line))

    def move(self, centers: Array) -> list[Artist]:
        """Put the arms where the axes (n_p, 2) are; give the artists that changed."""
        for k, fixed, line in self._lines:
            line.set_data([fixed[0], centers[k, 0]], [fixed[1], centers[k, 1]])
        return [line for _, _, line in self._lines]

    @staticmethod
    def reach(pulleys: Iterable[Pulley]) -> Array:
        """Give points that a picture must hold besides belt and pulleys: pivots, tips (n, 2)."""
        mounted = [(p, p.mount) for p in pulleys if p.mount is not None]
        points = [at for p, mount in mounted for at in _DRAWN[mount._row.name][1](p, mount)]
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
    moving = [(m, k, *mount._row.shown) for m, k, mount in params._moving]
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
