"""Names of pulleys in pictures to scale: within the rim if they fit, else beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox, ScaledTranslation

from ..checks import Array
from . import style

__all__ = ["place_names"]

#: A name is within the rim if it ends within this share of the radius.
_WITHIN = 0.84
#: Directions and distances [points from the rim] that are tried for a name beside it.
_DIRECTIONS, _DISTANCES = 32, (4.0, 8.0, 14.0, 22.0, 32.0, 44.0)
#: Room left free round a name beside its pulley, and the size of pivots, to either side [points].
_AIR, _PIVOT = 2.0, 5.0
#: Texts at points, with no rim to belong to, are left out rather than put farther off [points], or
#: where they would cover this much.
_FARTHEST, _COVERED = 14.0, 20.0
#: What a point of distance from the pulley weighs; what is covered weighs as in :func:`_cost`.
_FAR = 0.05


def place_names(
    ax: Axes,
    names: Sequence[Text],
    centers: Array,
    radii: Array,
    belt: Array,
    *,
    marked: bool = False,
    fixed: Sequence[Text] = (),
    pivots: Array | None = None,
) -> None:
    """Place the names of pulleys, which stand at their centres, so that each can be read.

    A name that does not fit is put beside the pulley where it covers neither belt nor pulleys nor
    another text, and nearest of such places; one of radius 0, a length beside a short span, is left
    out where there is none. It keeps its distance in points, so the names of
    pulleys that move go with them.

    Args:
        ax: Axes, with their limits set.
        names: A text per pulley (n_p,), in data coordinates.
        centers: Centres of the pulleys (n_p, 2) [m].
        radii: (n_p,) [m].
        belt: Points along the belt, closed (n, 2) [m].
        marked: Whether arrows stand below the middle of the pulleys.
        fixed: Texts that are not moved.
        pivots: Points not to cover (n, 2) [m].
    """
    style.settle_layout(ax)
    figure = ax.figure.figure
    to_points = 72.0 / figure.dpi
    at = ax.transData.transform(centers) * to_points
    size = np.abs(np.diff(ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])[:, 0]))[0] * to_points
    rims = np.asarray(radii) * size
    line = _dense(ax.transData.transform(belt) * to_points)
    taken = [_box(text, to_points) for text in fixed]
    if pivots is not None and pivots.size:
        drawn = ax.transData.transform(pivots) * to_points
        taken += [_around(pivot, np.full(2, _PIVOT)) for pivot in drawn]
    frame = _scaled(ax.get_window_extent(), to_points)
    beside = []
    for k, text in enumerate(names):
        half = _half(text, to_points)
        up = max(0.0, half[1] - 0.2 * rims[k]) if marked else 0.0
        if np.hypot(half[0], up + half[1]) <= _WITHIN * rims[k]:
            _shift(ax, text, np.array([0.0, up]))
            taken.append(_around(at[k] + (0.0, up), half))
        else:
            beside.append((k, half))
    for k, half in beside:
        offsets = _offsets(rims[k], half)
        costs = [
            _cost(_around(at[k] + offset, half + _AIR), line, at, rims, taken, frame)
            + _FAR * float(np.hypot(*offset) - rims[k])
            for offset in offsets
        ]
        best = offsets[int(np.argmin(costs))]
        if not rims[k] and min(costs) > _COVERED:
            names[k].set_visible(False)
            continue
        _shift(ax, names[k], best)
        names[k].set_path_effects([withStroke(linewidth=2.5, foreground="white", alpha=0.8)])
        taken.append(_around(at[k] + best, half))


def _offsets(rim: float, half: Array) -> list[Array]:
    """Give places beside a rim, from the middle of the pulley to that of the text [points]."""
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    return [
        np.array([np.cos(angle), np.sin(angle)]) * (rim + distance + half)
        for distance in _DISTANCES
        if rim or distance <= _FARTHEST
        for angle in angles
    ]


def _cost(
    box: Bbox, line: Array, at: Array, rims: Array, taken: Sequence[Bbox], frame: Bbox
) -> float:
    """Give how much a box covers, weighted: texts, belt, pulleys, the edge of the axes."""
    texts = sum(box.overlaps(other) for other in taken)
    belt = box.count_contains(line)
    nearest = np.clip(at, box.min, box.max)
    pulleys = int((np.hypot(*(at - nearest).T) < rims).sum())
    within = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
    return 100.0 * texts + 5.0 * belt + 20.0 * pulleys + 50.0 * (not within)


def _dense(line: Array) -> Array:
    """Give points along a closed polyline, two points apart at most."""
    ends = np.roll(line, -1, axis=0)
    counts = np.ceil(np.hypot(*(ends - line).T) / 2.0).astype(int) + 1
    return np.concatenate(
        [np.linspace(a, b, n) for a, b, n in zip(line, ends, counts, strict=True)]
    )


def _shift(ax: Axes, text: Text, offset: Array) -> None:
    figure = ax.figure.figure
    moved = ScaledTranslation(offset[0] / 72.0, offset[1] / 72.0, figure.dpi_scale_trans)
    text.set_transform(ax.transData + moved)


def _scaled(box: Bbox, factor: float) -> Bbox:
    return Bbox(box.get_points() * factor)


def _box(text: Text, to_points: float) -> Bbox:
    return _scaled(text.get_window_extent(), to_points)


def _half(text: Text, to_points: float) -> Array:
    box = _box(text, to_points)
    return np.array([box.width, box.height]) / 2.0


def _around(middle: Array, half: Array) -> Bbox:
    return Bbox([middle - half, middle + half])
