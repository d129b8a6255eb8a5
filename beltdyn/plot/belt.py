"""The belt at one time: forces along it, and the drive to scale."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..base.checks import integer
from ..outputs.quantity import QUANTITIES
from ..result.result import Result
from . import style
from .labels import rows_of_names
from .panel import draws
from .picture import DrivePicture
from .select import Indices, runs, sample


@draws()
def force_along_belt(
    result: Result,
    t: float | None = None,
    *,
    first: int = 0,
    wraps: bool = True,
    ax: Axes | None = None,
    **line: Any,
) -> Axes:
    """Draw the joint forces along the belt at one time: Fig. 9 of the paper.

    The force of a joint is drawn at the left end of its element, half a number before it; that of a
    cell of an ALE belt, which is one of a place, at its number. With
    ``wraps=False`` and axes that already hold such forces, several times can be compared.

    Args:
        first: Number of the first element; the paper's is 1.
        wraps: Whether to shade the elements on each pulley.
    """
    row = sample(result, t)
    first = integer("first", first, 0)
    n_b = result.params.n_bodies
    ax = style.axes(ax)
    label = f"t = {result.t[row]:.4g} s"
    look: dict[str, Any] = {"marker": ".", "markersize": 3, "linewidth": 0.9, "label": label}
    look |= style.line_style(style.unused(ax, len(style.COLOURS) - 1)) | {"linestyle": "-"}
    flows = result.params._belt_facts["flows"]
    at = first + np.arange(n_b) - (0.0 if flows else 0.5)
    style.draw_line(ax, at, result.joints.force[row], look, line)
    words = ("cell", "tension") if flows else ("element", "joint force")
    force = QUANTITIES["joints.force"].axis(short=words[1])
    style.dress(ax, f"{words[0]} along the belt", force)
    ax.set_xlim(first - 0.5, first + n_b - 0.5)
    if wraps:
        _shade_wraps(ax, result, row, first)
    if len(ax.lines) > 1:
        ax.set_title("")
        style.legend(ax)
    elif "label" in line:
        style.legend(ax)
    else:
        ax.set_title(label, fontsize="medium")
    return ax


def _shade_wraps(ax: Axes, result: Result, row: int, first: int) -> None:
    """Shade each wrap and label its longest part."""
    longest: dict[int, tuple[int, int]] = {}
    for begin, end, pulley in runs(result.contact.pulley[row]):
        if pulley < 0:
            continue
        ax.axvspan(
            first + begin - 0.5, first + end - 0.5, color=style.tint(pulley), lw=0.0, zorder=0.5
        )
        if end - begin > int(np.subtract(*longest.get(pulley, (0, 0))[::-1])):
            longest[pulley] = begin, end
    names = [style.plain(result.pulleys.names[pulley]) for pulley in longest]
    middles = [first + (begin + end - 1) / 2.0 for begin, end in longest.values()]
    rows_of_names(ax, np.array(middles), names, inside=True)


@draws()
def drive(
    result: Result,
    t: float | None = None,
    *,
    colour: str | None = "tension",
    arcs: bool = True,
    slip_from: float = 0.95,
    links: Indices | Mapping[str, int] | None = None,
    limits: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the drive to scale at one time, as Fig. 5 of the paper.

    Pulleys carry their name or number, beside them if they are small, a mark that turns with them
    and, while they turn, an arrow.

    Args:
        colour: What colours the belt: "tension" (of a link, the mean of the joints at its ends),
            "friction" (mu; grey off the pulleys) or None.
        arcs: Whether to mark, within the rims, where the belt sticks and where it slips; not
            for a drive without friction.
        links: Links to highlight: an index, a sequence of them, or {name: index}; or cells.
        limits: Ends of the colour scale; None: least and largest tension at this time, or the
            kinetic coefficient, to either side, for friction.
    """
    row = sample(result, t)
    rows = slice(row, row + 1)
    picture = DrivePicture(result, rows, colour, arcs, slip_from, links, limits)
    ax = style.axes(ax, picture.height)
    ax.set_title(f"t = {result.t[row]:.4g} s", fontsize="medium")
    picture.draw(ax)
    picture.move(row)
    picture.add_legend(ax)
    return ax
