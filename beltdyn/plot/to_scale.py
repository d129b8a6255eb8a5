"""Pulleys and mounts of a drive to scale, and the way of the belt round them at rest."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.text import Text

from ..base.checks import Array
from ..drive.params import Params
from ..drive.parts import Pulley, as_pulleys
from ..drive.route import route
from . import style
from .labels import Label, draw_name, place_names
from .panel import draws

#: How parts of mounts look; an arrow has a look of its own.
_STYLES: dict[str, dict[str, Any]] = {
    "bar": {"lw": 4.0, "solid_capstyle": "round", "alpha": 0.6, "zorder": 1.2},
    "pivot": {"marker": "o", "ms": 7, "mfc": "white", "mew": 1.6, "zorder": 3.4},
    # Behind the pulley, on which its name stands.
    "guide": {"lw": 1.4, "ls": (0, (6, 2, 1, 2)), "zorder": 0.9},
    "way": {"lw": 1.2, "ls": ":", "marker": ".", "zorder": 3.4},
}
#: Points of an arc in a layout, and where the arrow of the numbering stands on a span.
_ARC, _TIP = 60, 0.9
_ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": "0.35", "lw": 1.4, "mutation_scale": 14.0}


def _parts(pulleys: Iterable[Pulley]) -> list[tuple[int, str, Array]]:
    """Return the parts of mounts: index of the pulley, style, points."""
    return [
        (k, part, points)
        for k, pulley in enumerate(pulleys)
        if (mount := pulley.mount) is not None
        for part, points in mount._drawn(np.array(pulley.center), pulley.radius).items()
    ]


def reach(pulleys: Iterable[Pulley]) -> Array:
    """Return points that a picture must hold besides belt and pulleys: pivots, tips (n, 2)."""
    held = [points for _, part, points in _parts(pulleys) if part != "way"]
    return np.concatenate([np.empty((0, 2)), *held])


def draw_pulley(ax: Axes, center: Sequence[float] | Array, radius: float, **look: Any) -> Circle:
    """Draw a pulley; ``look`` goes to the patch."""
    metal: dict[str, Any] = {"fc": style.METAL, "ec": "0.6", "lw": 0.8}
    rim = Circle((float(center[0]), float(center[1])), radius, **metal | look)
    ax.add_patch(rim)
    return rim


class Machine:
    """Pulleys with their names and mounts: fixed parts are drawn once, the others are moved."""

    def __init__(self, ax: Axes, pulleys: Sequence[Pulley], centers: Array, **rim: Any) -> None:
        self._ax, self._pulleys = ax, pulleys
        self._bars: list[tuple[int, Array, Any]] = []
        self._names: list[Text] = []
        for k, part, points in _parts(pulleys):
            if part == "pivot":
                (bar,) = ax.plot([], [], color="0.35", **_STYLES["bar"])
                self._bars.append((k, points[0], bar))
            if part == "pull":
                ax.annotate("", tuple(points[1]), tuple(points[0]), arrowprops=_ARROW)
            else:
                ax.plot(*points.T, color="0.35", **_STYLES[part])
        self._rims = [
            draw_pulley(ax, center, pulley.radius, **rim)
            for center, pulley in zip(centers, pulleys, strict=True)
        ]
        self.move(centers)

    def name(self, more: Sequence[str] = (), **look: Any) -> None:
        """Write the name of each pulley, or its number, in its middle; ``more`` below it."""
        for k, (pulley, center) in enumerate(zip(self._pulleys, self._centers, strict=True)):
            words = [style.title(k, pulley), *more[k : k + 1]]
            size = "small" if pulley.name or more else "medium"
            name = draw_name(self._ax, "\n".join(words), center, fontsize=size, **look)
            self._names.append(name)

    def place_names(
        self, belt: Array, *, marks: int = 0, lengths: Sequence[Label] = (), held: Any = ()
    ) -> None:
        """Put names that do not fit on their pulleys beside them, and lengths beside short spans.

        They cover neither belt nor mounts, nor the points that are ``held``.
        """
        on = zip(self._names, self._centers, self._pulleys, strict=True)
        labels = [Label(text, center, pulley.radius) for text, center, pulley in on]
        kept = np.concatenate([reach(self._pulleys), np.reshape(held, (-1, 2))])
        place_names(self._ax, [*labels, *lengths], belt, kept, marks)

    def move(self, centers: Array) -> None:
        """Move pulleys and arms to the axes (n_p, 2)."""
        self._centers = centers
        for k, pivot, bar in self._bars:
            bar.set_data([pivot[0], centers[k, 0]], [pivot[1], centers[k, 1]])
        for rim, center in zip(self._rims, centers, strict=True):
            rim.set_center(tuple(center))
        for name, center in zip(self._names, centers, strict=False):
            name.set_position(tuple(center))


@draws()
def layout(drive: Params | Iterable[Pulley], *, ax: Axes | None = None) -> Axes:
    """Draw the belt line round the pulleys to scale, with wrap angles and lengths of the spans.

    Arrows point along the belt as its links and spans are numbered; span k follows pulley k.
    Pulleys on arms and sliders of a drive are drawn where they rest, with the arm, or the guide of
    the slider; those given alone in their places. Names stand on pulleys that are large enough, or
    beside them; lengths for which a small picture has no room are left out.

    Args:
        drive: A drive, or its pulleys alone, in the order in which the belt visits them.

    Raises:
        TypeError: These are no pulleys.
        ValueError: The belt cannot run round these pulleys.
    """
    if isinstance(drive, Params):
        pulleys, way, centers = drive.pulleys, drive.route, drive.centers()
    else:
        pulleys = as_pulleys(drive)
        way, centers = route(pulleys), np.array([pulley.center for pulley in pulleys])
    radii = np.array([[pulley.radius] for pulley in pulleys])
    corners = np.concatenate([centers - radii, centers + radii, reach(pulleys)])
    ax = style.axes(ax, style.height_to_scale(np.ptp(corners, axis=0), beside=1.8, below=1.5))
    machine = Machine(ax, pulleys, centers)
    machine.name([f"{np.degrees(wrap):.0f}°" for wrap in way.wraps])
    arrow = {"arrowstyle": "-|>", "color": style.COLOURS[0], "lw": 0.0, "mutation_scale": 18.0}
    box = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
    begins = np.arctan2(*(way.arrive - centers).T[::-1])
    angles = begins[:, None] + np.linspace(0.0, way.senses * way.wraps, _ARC, axis=-1)
    arcs = centers[:, None] + radii[..., None] * np.stack([np.cos(angles), np.sin(angles)], -1)
    line = arcs.reshape(-1, 2)
    ax.plot(*np.vstack([line, line[:1]]).T, color=style.COLOURS[0], lw=2.2)
    lengths, tips = [], []
    for k, pulley in enumerate(pulleys if len(pulleys) > 1 else ()):
        after = (k + 1) % len(pulleys)
        begin, along = way.leave[k], way.arrive[after] - way.leave[k]
        tips.append(begin + _TIP * along)
        tail = begin + (_TIP - 0.05) * along
        ax.annotate("", tuple(tips[-1]), tuple(tail), arrowprops=arrow)
        share = 0.5
        if way.turns == 0 and way.senses[k] != way.senses[after]:
            # Where crossed spans meet no label fits: in the middle of the longer part.
            meets = pulley.radius / (pulley.radius + pulleys[after].radius)
            share = 0.5 * (meets + (meets < 0.5))
        length, at = way.spans[k], begin + share * along
        text = f"{length:.3g} m" if length >= 1.0 else f"{1e3 * length:.0f} mm"
        lengths.append(Label(draw_name(ax, text, at, bbox=box, path_effects=None), at, 0.0, length))
    style.dress(ax, "x [m]", "y [m]")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    crossed = ", crossed" if way.turns == 0 else ""
    ax.set_title(f"belt line of {way.length:.4g} m{crossed}", fontsize="medium")
    # Names cover no arrows.
    machine.place_names(line, lengths=lengths, held=tips)
    return ax
