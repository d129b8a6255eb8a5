"""Contact and friction of single links: forces, friction coefficient, relative velocity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..base.checks import Array
from ..outputs.quantity import QUANTITIES, TIME
from ..result.result import Result
from .panel import draws, numbered, panel
from .select import Indices, choice

_FORCES = ("normal", "friction")


@draws()
def contact_forces(
    result: Result,
    link: Indices,
    *,
    which: str | Sequence[str] = _FORCES,
    ax: Axes | None = None,
    **line: Any,
) -> Axes:
    """Draw normal (2.8) and friction force (2.10) on links over time: Figs 10 and 16 of the paper.

    Both are 0 off the pulleys. Friction has the sign of mu: it acts on the link against the
    counter-clockwise tangent.

    Args:
        which: "normal", "friction" or both.
    """
    links = numbered(result, "link", link)
    forces = [which] if isinstance(which, str) else which
    if not isinstance(forces, Sequence):
        raise TypeError(f"which must be a str or a sequence of them, got {which!r}")
    if not forces:
        raise ValueError(f"which must hold at least one of {', '.join(_FORCES)}, got none")
    for word in forces:
        choice("which", word, _FORCES)
    curves = [
        (n * len(forces) + m, f"{force}, {name}", result.t, getattr(result.contact, force)[:, k])
        for n, k, name in links
        for m, force in enumerate(forces)
    ]
    return panel(ax, curves, line, y=QUANTITIES["contact.normal"].axis(short="contact force"))


@draws()
def friction_coefficient(
    result: Result, link: Indices, *, against: str = "time", ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the friction coefficient (2.9) of links: Figs 11, 17 and 18 of the paper.

    The line has a gap where the link touches no pulley, and where contact was lost and regained
    between two samples.

    Args:
        against: "time", or "slip": over the slip displacement in mm, which shows the hysteresis
            loop of the Dahl law.

    Raises:
        TypeError, ValueError: An argument breaks its rule, or the run had no friction.
    """
    choice("against", against, ("time", "slip"))
    if not result.params.has_friction:
        raise ValueError("result must be of a drive with friction, no pulley of it has any")
    return _in_contact(result, link, "contact.mu", against, ax, line)


@draws()
def relative_velocity(
    result: Result, link: Indices, *, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the velocity v_T of links relative to the rim over time: Fig. 12 of the paper.

    The line has a gap where the link touches no pulley.
    """
    return _in_contact(result, link, "contact.velocity", "time", ax, line)


def _in_contact(
    result: Result,
    link: Indices,
    quantity: str,
    against: str,
    ax: Axes | None,
    given: dict[str, Any],
) -> Axes:
    row, curves = QUANTITIES[quantity], []
    values: Array = getattr(result.contact, row.field)
    for n, k, name in numbered(result, "link", link):
        touches = result.contact.pulley[:, k] >= 0
        at = result.t if against == "time" else 1e3 * result.contact.slip[:, k]
        y = np.where(touches, values[:, k], np.nan)
        if against == "slip":
            at = np.where(touches, at, np.nan)
        flows = result.params._flows
        anew = np.zeros(0, dtype=np.intp) if flows else _begun_anew(result, k)
        name += "" if touches.any() else " (no contact)"
        curves.append((n, name, np.insert(at, anew, np.nan), np.insert(y, anew, np.nan)))
    x = TIME.axis() if against == "time" else QUANTITIES["contact.slip"].axis("mm")
    return panel(ax, curves, given, x, row.axis())


def _begun_anew(result: Result, k: int) -> NDArray[np.intp]:
    """Find the samples just before which link k lost contact and regained it.

    One sign is another pulley. On the same pulley the slip displacement, the integral of v_T since
    contact began, has started from 0 again: then it is closer to the integral over this interval
    alone than to its old value plus that integral, and farther from the latter than v_T allows.
    """
    contact = result.contact
    pulley, slip, speed = contact.pulley[:, k], contact.slip[:, k], contact.velocity[:, k]
    touches = (pulley[:-1] >= 0) & (pulley[1:] >= 0)
    dt = np.diff(result.t)
    added = dt * (speed[:-1] + speed[1:]) / 2.0
    within = dt * np.maximum(np.abs(speed[:-1]), np.abs(speed[1:]))
    off_old = np.abs(slip[1:] - slip[:-1] - added)
    off_new = np.abs(slip[1:] - np.clip(slip[1:], np.minimum(added, 0), np.maximum(added, 0)))
    reset = (off_new < off_old) & (off_old > 3.0 * within)
    # Displacements too short to be visible do not break the line.
    reset &= np.abs(slip[:-1]) > 0.01 * np.max(np.abs(slip), initial=0.0)
    found: NDArray[np.intp] = np.flatnonzero(touches & (reset | (pulley[:-1] != pulley[1:]))) + 1
    return found
