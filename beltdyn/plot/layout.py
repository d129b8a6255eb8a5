"""The way of the belt round its pulleys, before anything runs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Text

from ..base.checks import Array
from ..drive.params import Params
from ..drive.parts import Pulley, as_pulleys
from ..drive.route import route
from . import style
from .labels import draw_name, per_unit, place_names
from .mounting import MountPicture, draw_pulley
from .panel import draws

#: Points of an arc, and where the arrow of the numbering stands on a span.
_ARC, _ARROW = 60, 0.9


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
    held = MountPicture.reach(pulleys)
    reach = np.concatenate([centers - radii, centers + radii, held])
    ax = style.axes(ax, style.height_to_scale(np.ptp(reach, axis=0), beside=1.8, below=1.5))
    MountPicture(ax, pulleys).move(centers)
    belt: dict[str, Any] = {"color": style.COLOURS[0], "lw": 2.2}
    arrow = {"arrowstyle": "-|>", "color": style.COLOURS[0], "lw": 0.0, "mutation_scale": 18.0}
    box = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
    names, spans = [], []
    line: list[Array] = []
    tips: list[Array] = []
    for k, (pulley, center) in enumerate(zip(pulleys, centers, strict=True)):
        draw_pulley(ax, center, pulley.radius)
        begins = np.arctan2(*(way.arrive[k] - center)[::-1])
        angle = begins + way.senses[k] * np.linspace(0.0, way.wraps[k], _ARC)
        arc = center[:, None] + pulley.radius * np.array([np.cos(angle), np.sin(angle)])
        ax.plot(*arc, solid_capstyle="round", **belt)
        wrap = f"{style.title(k, pulley)}\n{np.degrees(way.wraps[k]):.0f}°"
        names.append(draw_name(ax, wrap, center))
        line.append(arc.T)
        if len(pulleys) > 1:
            after = (k + 1) % len(pulleys)
            begin, along = way.leave[k], way.arrive[after] - way.leave[k]
            ax.plot(*np.array([begin, way.arrive[after]]).T, **belt)
            tips.append(begin + _ARROW * along)
            tail = begin + (_ARROW - 0.05) * along
            ax.annotate("", tuple(tips[-1]), tuple(tail), arrowprops=arrow)
            share = 0.5
            if way.turns == 0 and way.senses[k] != way.senses[after]:
                # Where crossed spans meet no label fits: in the middle of the longer part.
                meets = pulley.radius / (pulley.radius + pulleys[after].radius)
                share = 0.5 * (meets + (meets < 0.5))
            length = way.spans[k]
            text = f"{length:.3g} m" if length >= 1.0 else f"{1e3 * length:.0f} mm"
            spans.append(draw_name(ax, text, begin + share * along, bbox=box, path_effects=None))
    style.dress(ax, "x [m]", "y [m]")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    crossed = ", crossed" if way.turns == 0 else ""
    ax.set_title(f"belt line of {way.length:.4g} m{crossed}", fontsize="medium")
    kept, short = _by_room(ax, spans, way.spans)
    place_names(
        ax,
        names + short,
        np.concatenate([centers, *([text.get_position()] for text in short)]),
        np.concatenate([radii[:, 0], np.zeros(len(short))]),
        np.concatenate(line),
        fixed=kept,
        # Names cover neither arrows nor mounts.
        pivots=np.concatenate([np.array(tips).reshape(-1, 2), held]),
    )
    return ax


def _by_room(ax: Axes, texts: list[Text], lengths: Array) -> tuple[list[Text], list[Text]]:
    """Return the lengths that their spans have room for, and those to be put beside them."""
    style.settle_layout(ax)
    pixels = per_unit(ax) * ax.figure.figure.dpi / 72.0
    kept: list[Text] = []
    short: list[Text] = []
    for text, length in zip(texts, lengths, strict=False):
        box = text.get_window_extent()
        fits = box.width + 2.0 * box.height < pixels * length
        free = not any(box.overlaps(other.get_window_extent()) for other in kept)
        (kept if fits and free else short).append(text)
    return kept, short
