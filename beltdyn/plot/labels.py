"""Names of pulleys: in pictures to scale within the rim or beside it, in rows over an axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox, ScaledTranslation

from ..base.checks import Array
from . import style

#: A name is within the rim if it ends within this share of the radius.
_WITHIN = 0.84
#: Directions and distances [points from the rim] that are tried for a name beside it.
_DIRECTIONS, _DISTANCES = 32, (4.0, 8.0, 14.0, 22.0, 32.0, 44.0)
#: Room left free round a name beside its pulley, and the size of pivots, to either side [points].
_AIR, _PIVOT = 2.0, 5.0
#: Texts at points, with no rim to belong to, are left out rather than put farther off [points], or
#: where they would cover this much.
_FARTHEST, _COVERED = 14.0, 20.0
#: Most rows of names above axes; room between two of a row, and between a name and a line [points].
_ROWS, _APART, _LINE = 3, 5.0, 2.0
#: What a point of distance from the pulley weighs, and what :func:`_astray` counts; what is
#: covered weighs as in :func:`_cost`.
_FAR, _ASTRAY = 0.05, 15.0


def draw_name(ax: Axes, name: str, center: Sequence[float] | Array, **look: Any) -> Text:
    """Write a name in the middle of its pulley; marks and arms pass beneath it."""
    halo = [withStroke(linewidth=2.5, foreground=style.METAL)]
    place: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": "small"}
    x, y = map(float, center)
    return ax.text(x, y, name, **place | {"path_effects": halo} | look)


def place_names(
    ax: Axes,
    names: Sequence[Text],
    centers: Array,
    radii: Array,
    belt: Array,
    *,
    marks: int = 0,
    fixed: Sequence[Text] = (),
    pivots: Array | None = None,
) -> None:
    """Place the names of pulleys, which stand at their centres, so that each can be read.

    A name that does not fit is put beside the pulley where it covers neither belt nor pulleys nor
    another text, and nearest of such places; one of radius 0, a length beside a short span, is left
    out where there is none. It keeps its distance in points, so the names of
    pulleys that move go with them.
    """
    style.settle_layout(ax)
    figure = ax.figure.figure
    to_points = 72.0 / figure.dpi
    at = ax.transData.transform(centers) * to_points
    rims = np.asarray(radii) * per_unit(ax)
    line = _dense(ax.transData.transform(belt) * to_points)
    taken = [_box(text, to_points) for text in fixed]
    if pivots is not None and pivots.size:
        drawn = ax.transData.transform(pivots) * to_points
        taken += [_around(pivot, np.full(2, _PIVOT)) for pivot in drawn]
    frame = _box(ax, to_points)
    beside: list[tuple[int, Array]] = []
    for k, text in enumerate(names):
        half = np.array(_box(text, to_points).size) / 2.0
        off = -marks * max(0.0, half[1] - 0.2 * rims[k])
        if np.hypot(half[0], abs(off) + half[1]) <= _WITHIN * rims[k]:
            _shift(ax, text, np.array([0.0, off]))
            taken.append(_around(at[k] + (0.0, off), half))
        else:
            beside.append((k, half))
    chosen: dict[int, Bbox] = {}
    # Once more when all are there: the first were placed without regard to the last.
    for k, half in beside + beside:
        offsets = _offsets(rims[k], half)
        others = taken + [box for j, box in chosen.items() if j != k]
        costs = [
            _cost(_around(at[k] + offset, half + _AIR), line, at, rims, others, frame)
            + _FAR * float(np.hypot(*offset) - rims[k])
            + _ASTRAY * _astray(k, at, rims, _around(at[k] + offset, half), line)
            for offset in offsets
        ]
        best = offsets[int(np.argmin(costs))]
        chosen.pop(k, None)
        names[k].set_visible(bool(rims[k]) or min(costs) <= _COVERED)
        if names[k].get_visible():
            _shift(ax, names[k], best)
            names[k].set_path_effects([withStroke(linewidth=2.5, foreground="white", alpha=0.8)])
            chosen[k] = _around(at[k] + best, half)


def per_unit(ax: Axes) -> float:
    """Return the points on paper to a unit of length in axes to scale."""
    ends = ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(abs(ends[1, 0] - ends[0, 0]) * 72.0 / ax.figure.figure.dpi)


def rows_of_names(ax: Axes, middles: Array, names: Sequence[str], *, inside: bool = False) -> None:
    """Write names over the places along the x axis that they belong to.

    Names that would run into one another stand in up to :data:`_ROWS` rows, above the axes with
    lines down to their places; upright if these do not do.
    """
    style.settle_layout(ax)
    to_points = 72.0 / ax.figure.figure.dpi
    frame = ax.get_window_extent()
    at = (ax.transData.transform([(x, 0.0) for x in middles])[:, 0] - frame.x0) * to_points
    look: dict[str, Any] = {
        "xycoords": ax.get_xaxis_transform(),
        "textcoords": "offset points",
        "annotation_clip": False,
    }
    place: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": "small"}
    texts = [
        ax.annotate(name, (float(x), 1.0), (0.0, 2.0), **look, **place)
        for name, x in zip(names, middles, strict=True)
    ]
    boxes = [_box(text, to_points) for text in texts]
    order = np.argsort(at)
    found = _in_rows(at[order], np.array([boxes[k].width for k in order]), frame.width * to_points)
    step = 1.15 * max((box.height for box in boxes), default=0.0)
    for text in texts if found is None else ():
        text.set(rotation=90.0, va="top" if inside else "bottom", y=-2.0 if inside else 2.0)
    if inside and texts:
        long = max(box.width for box in boxes) / step
        style.add_headroom(ax, int(np.ceil(long if found is None else 1 + max(found)[0])))
    for k, (row, left) in zip(order, found or (), strict=False):
        height = 2.0 + step * row if not inside else -step * (1 + max(found or ())[0] - row)
        texts[k].set_position((left + boxes[k].width / 2.0 - at[k], height))
        if row and not inside:
            line = {"arrowstyle": "-", "color": "0.6", "lw": 0.6, "shrinkA": 0.0, "shrinkB": 0.0}
            ax.annotate("", texts[k].xy, (0.0, height), arrowprops=line, **look)


def _in_rows(at: Array, widths: Array, room: float) -> list[tuple[int, float]] | None:
    """Find a row and a left end for each name [points], places rising; None if there is none."""
    # A name is over its place; names of a row are apart, and none is in the way of the line from a
    # higher name down to its place. The fewest rows, then names in the middle over their places.
    tried = (_placed([], at, widths, room, rows) for rows in range(1, _ROWS + 1))
    return next((found for found in tried if found is not None), None)


def _placed(
    before: list[tuple[int, float]], at: Array, widths: Array, room: float, rows: int
) -> list[tuple[int, float]] | None:
    """Place the names after ``before``; None where that cannot be."""
    k = len(before)
    if k == at.size:
        return before
    for share in (0.5, 0.75, 0.25, 0.95, 0.05):
        left = float(np.clip(at[k] - share * widths[k], 0.0, max(room - widths[k], 0.0)))
        for row in range(rows):
            free = all(
                (low + widths[j] + _APART <= left if one == row else True)
                # lines down from the higher one of the two pass the lower
                and (at[j] + _LINE <= left if one > row else True)
                and (low + widths[j] + _LINE <= at[k] if one < row else True)
                for j, (one, low) in enumerate(before)
            )
            if free:
                found = _placed([*before, (row, left)], at, widths, room, rows)
                if found is not None:
                    return found
    return None


def _astray(k: int, at: Array, rims: Array, box: Bbox, line: Array) -> int:
    """Count ambiguities of a name: 1 for a nearer pulley, 1 for a belt between."""
    gaps = np.where(rims > 0.0, np.hypot(*(np.clip(at, box.min, box.max) - at).T) - rims, np.inf)
    to = np.clip(at[k], box.min, box.max) - at[k]
    length = float(np.hypot(*to))
    away = line - at[k]
    along, aside = away @ to / length, np.abs(away[:, 0] * to[1] - away[:, 1] * to[0]) / length
    # but for that on the pulley itself
    between = ((along > rims[k] + 3.0) & (along < length) & (aside < 2.0)).any()
    return int(rims[k] > 0.0 and gaps.min() < gaps[k]) + int(between)


def _offsets(rim: float, half: Array) -> list[Array]:
    """Return places beside a rim, from the middle of the pulley to that of the text [points]."""
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
    """Return how much a box covers, weighted: texts, belt, pulleys, the edge of the axes."""
    texts = sum(box.overlaps(other) for other in taken)
    belt = box.count_contains(line)
    nearest = np.clip(at, box.min, box.max)
    pulleys = int((np.hypot(*(at - nearest).T) < rims).sum())
    within = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
    return 100.0 * texts + 5.0 * belt + 20.0 * pulleys + 50.0 * (not within)


def _dense(line: Array) -> Array:
    """Return points along a closed polyline, two points apart at most."""
    ends = np.roll(line, -1, axis=0)
    counts = np.ceil(np.hypot(*(ends - line).T) / 2.0).astype(int) + 1
    return np.concatenate(
        [np.linspace(a, b, n) for a, b, n in zip(line, ends, counts, strict=True)]
    )


def _shift(ax: Axes, text: Text, offset: Array) -> None:
    figure = ax.figure.figure
    moved = ScaledTranslation(offset[0] / 72.0, offset[1] / 72.0, figure.dpi_scale_trans)
    text.set_transform(ax.transData + moved)


def _box(drawn: Artist, to_points: float) -> Bbox:
    return Bbox(drawn.get_window_extent().get_points() * to_points)


def _around(middle: Array, half: Array) -> Bbox:
    return Bbox([middle - half, middle + half])
