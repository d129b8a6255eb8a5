"""Where labels stand: in pictures to scale on pulleys or beside them; over an axis in rows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

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
#: Offsets that are tried for a label beside its pulley: directions, and distances from the rim
#: [points].
_DIRECTIONS, _DISTANCES = 32, (4.0, 8.0, 14.0, 22.0, 32.0, 44.0)
#: Room left free round a label beside its pulley, and the size of pivots, to either side [points].
_AIR, _PIVOT = 2.0, 5.0
#: Lengths of spans are left out rather than put farther off [points], or where they would cover
#: this much.
_FARTHEST, _COVERED = 14.0, 20.0
#: Most rows of names over an axis, and room between two names of a row [points].
_ROWS, _APART = 3, 5.0
#: Label of the artists that are names over an axis.
_OVER_AXIS = "_name"
#: Of names over an axis the row, from below, and the left end [points].
_Places = list[tuple[int, float]]


class Label(NamedTuple):
    """A text in its middle place: on a pulley of this radius, or on a span of this length."""

    text: Text
    at: Array
    radius: float
    span: float = 0.0


def draw_name(ax: Axes, name: str, center: Sequence[float] | Array, **look: Any) -> Text:
    """Write a name in the middle of its pulley; marks and arms pass beneath it."""
    place: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": "small"}
    place["path_effects"] = [withStroke(linewidth=2.5, foreground=style.METAL)]
    return ax.text(float(center[0]), float(center[1]), name, **place | look)


def place_names(
    ax: Axes, labels: Sequence[Label], belt: Array, held: Array, marks: int = 0
) -> None:
    """Place labels, which stand in their middle places, so that each can be read.

    One that does not fit is put beside its pulley where it covers neither belt nor pulleys nor
    another label nor what is ``held``, and nearest of such places; the length of a span is left out
    where there is none. It keeps its distance in points, so the names of pulleys that move go with
    them. ``marks``: whether pulleys have marks in their upper half, -1: in their lower one.
    """
    style.settle_layout(ax)
    unit, points = per_unit(ax), style.points(ax)
    at, pivots, line = (
        ax.transData.transform(one) * points for one in ([one.at for one in labels], held, belt)
    )
    line, frame = _dense(line), _box(ax)
    rims = unit * np.array([one.radius for one in labels])
    half = np.array([_box(one.text).size for one in labels]) / 2.0
    taken: list[Bbox] = []
    beside = []
    for k in np.argsort(rims > 0.0, kind="stable"):  # lengths of spans first
        up = -marks * max(0.0, half[k, 1] - 0.2 * rims[k]) if rims[k] else 0.0
        box = _around(at[k] + (0.0, up), half[k])
        if rims[k]:
            fits = bool(np.hypot(half[k, 0], abs(up) + half[k, 1]) <= _WITHIN * rims[k])
        else:
            free = not any(box.overlaps(other) for other in taken)
            fits = free and bool(2.0 * half[k, 0] + 4.0 * half[k, 1] < unit * labels[k].span)
        if fits:
            _shift(ax, labels[k].text, np.array([0.0, up]))
            taken.append(box)
        else:
            beside.append(int(k))
    taken += [_around(pivot, np.full(2, _PIVOT)) for pivot in pivots]
    chosen: dict[int, Bbox] = {}

    def cost(k: int, offset: Array) -> float:
        """Weigh what a label covers, how far it is from its pulley and whether that is clear."""
        box, wide = _around(at[k] + offset, half[k]), _around(at[k] + offset, half[k] + _AIR)
        texts = sum(wide.overlaps(one) for one in (*taken, *chosen.values()))
        pulleys = int((_gaps(wide, at, rims) < 0.0).sum())
        within = np.all(frame.min <= wide.min) and np.all(wide.max <= frame.max)
        return float(
            100.0 * texts
            + 5.0 * wide.count_contains(line)
            + 20.0 * pulleys
            + 50.0 * (not within)
            + 0.05 * (np.hypot(*offset) - rims[k])
            + 15.0 * _astray(k, at, rims, box, line)
        )

    # Once more when all are there: the first were placed without regard to the last.
    for k in sorted(beside) * 2:
        chosen.pop(k, None)
        offsets = _offsets(rims[k], half[k])
        costs = [cost(k, offset) for offset in offsets]
        best, text = offsets[int(np.argmin(costs))], labels[k].text
        text.set_visible(bool(rims[k]) or min(costs) <= _COVERED)
        if text.get_visible():
            _shift(ax, text, best)
            text.set_path_effects(style.HALO)
            chosen[k] = _around(at[k] + best, half[k])


def per_unit(ax: Axes) -> float:
    """Return the points on paper to a unit of length in axes to scale."""
    ends = ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(abs(ends[1, 0] - ends[0, 0]) * style.points(ax))


def _offsets(rim: float, half: Array) -> list[Array]:
    """Return places beside a rim, from the middle of the pulley to that of the text [points]."""
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    near = [distance for distance in _DISTANCES if rim or distance <= _FARTHEST]
    return [
        np.array([np.cos(angle), np.sin(angle)]) * (rim + distance + half)
        for distance, angle in product(near, angles)
    ]


def _gaps(box: Bbox, at: Array, rims: Array) -> Array:
    """Return the distances of a box from the rims; less than 0 where it covers one."""
    return np.asarray(np.hypot(*(at - np.clip(at, box.min, box.max)).T) - rims)


def _astray(k: int, at: Array, rims: Array, box: Bbox, line: Array) -> int:
    """Count ambiguities of a label: 1 for a nearer pulley, 1 for a belt between."""
    gaps = np.where(rims > 0.0, _gaps(box, at, rims), np.inf)
    to = np.clip(at[k], box.min, box.max) - at[k]
    length = float(np.hypot(*to))
    away = line - at[k]
    along, aside = away @ to / length, np.abs(away[:, 0] * to[1] - away[:, 1] * to[0]) / length
    # but for that on the pulley itself
    between = ((along > rims[k] + 3.0) & (along < length) & (aside < 2.0)).any()
    return int(rims[k] > 0.0 and gaps.min() < gaps[k]) + int(between)


def _dense(line: Array) -> Array:
    """Return points along a closed polyline, two points apart at most."""
    ends = np.roll(line, -1, axis=0)
    counts = np.ceil(np.hypot(*(ends - line).T) / 2.0).astype(int) + 1
    return np.concatenate(list(map(np.linspace, line, ends, counts)))


def _shift(ax: Axes, text: Text, offset: Array) -> None:
    moved = ScaledTranslation(offset[0] / 72.0, offset[1] / 72.0, ax.figure.figure.dpi_scale_trans)
    text.set_transform(ax.transData + moved)


def _box(drawn: Artist) -> Bbox:
    """Return the box of what is drawn [points]."""
    return Bbox(drawn.get_window_extent().get_points() * style.points(drawn))


def _around(middle: Array, half: Array) -> Bbox:
    return Bbox([middle - half, middle + half])


def rows_of_names(ax: Axes, middles: Sequence[float], names: Sequence[str]) -> None:
    """Write names over the places along the x axis that they belong to, at the top of the axes.

    Names that would run into one another stand in up to :data:`_ROWS` rows, upright if these do not
    do. Their height is left free of data, also that of names that were there before.
    """
    look: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": "small"}
    look |= {"textcoords": "offset points", "annotation_clip": False, "label": _OVER_AXIS}
    texts = [
        ax.annotate(name, (x, 1.0), (0.0, 0.0), ax.get_xaxis_transform(), **look)
        for x, name in sorted(zip(map(float, middles), names, strict=True))
    ]
    style.settle_layout(ax)
    frame, boxes = _box(ax), [_box(text) for text in texts]
    at = [ax.transData.transform(text.xy)[0] * style.points(ax) - frame.x0 for text in texts]
    step, widths = 1.15 * max((box.height for box in boxes), default=0.0), [b.width for b in boxes]
    tried = (_placed([], at, widths, frame.width, rows) for rows in range(1, _ROWS + 1))
    found = next((one for one in tried if one is not None), None)
    if found is None:
        for text in texts:
            text.set(rotation=90.0, va="top", y=-2.0)
    for text, x, width, (row, left) in zip(texts, at, widths, found or (), strict=False):
        row -= max(one for one, _ in found or ())
        text.set_position((left + width / 2.0 - x, step * (row - 1)))
    there = [_box(text).y0 for text in ax.texts if text.get_label() == _OVER_AXIS]
    if there:
        style.leave_free(ax, min((frame.y1 - min(there)) / frame.height, 0.6), above=True)


def _placed(
    before: _Places, at: Sequence[float], widths: Sequence[float], room: float, rows: int
) -> _Places | None:
    """Find a row and a left end for each name after some [points]; None where there is none."""
    # A name is over its place, names of a row are apart, and none is between a higher one and its
    # place. Names in the middle over their places are best.
    k = len(before)
    if k == len(at):
        return before
    for share, row in product((0.5, 0.75, 0.25, 0.95, 0.05), range(rows)):
        left = float(np.clip(at[k] - share * widths[k], 0.0, max(room - widths[k], 0.0)))
        free = all(
            (at[j] if one > row else low + widths[j]) + _APART <= (at[k] if one < row else left)
            for j, (one, low) in enumerate(before)
        )
        found = _placed([*before, (row, left)], at, widths, room, rows) if free else None
        if found is not None:
            return found
    return None
