"""Curves over time, of the drive and of single links, and of forces along the belt."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..base.checks import integer
from ..outputs.places import along
from ..outputs.quantity import QUANTITIES, SPANS, TIME
from ..result.result import Result
from . import style
from .labels import rows_of_names
from .panel import (
    Curve,
    Indices,
    Pulleys,
    choice,
    columns,
    draws,
    lines,
    over_time,
    panel,
    runs,
    sample,
)

_LOSSES = (
    ("friction_loss", "friction"),
    ("contact_loss", "contact dampers"),
    ("joint_loss", "damping of the belt"),
    ("drag_loss", "bearing drag"),
)
_FORCES = ("normal", "friction")
#: Places to a link: joints are met where they are, and between them forces are interpolated.
_PER_LINK = 4


@draws()
def speeds(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the angular velocities of the pulleys over time: Figs 7, 14 and 19 of the paper.

    Of pulleys with a coupling those of their shafts, and dotted those of their rims.
    """
    params, rims = result.params, []
    for k, _, name in columns(params, "pulley", pulleys):
        coupling = params.pulleys[k].coupling
        if coupling is not None and result.couplings is not None:
            speed = result.couplings.rim_speed[:, params.coupled.index(k)]
            rims.append(
                Curve(k, f"{coupling._part} of {name}", result.t, speed, {"linestyle": ":"})
            )
    return over_time(result, "pulleys.omega", pulleys, ax, line, more=rims)


@draws()
def torques(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the set torques M_d of (2.12) over time: Figs 6 and 13 of the paper."""
    return over_time(result, "pulleys.torque", pulleys, ax, line)


@draws()
def span_tensions(result: Result, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the mean tension of each free span over time; gaps where a span has no joint."""
    return over_time(result, SPANS, None, ax, line)


@draws()
def joint_force(result: Result, joint: Indices, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the force along joints (2.2) over time: Figs 8b and 15 of the paper."""
    return over_time(result, "joints.force", joint, ax, line)


@draws()
def joint_deformation(
    result: Result, joint: Indices, *, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the stretch of joints (2.2) over time, in mm: Fig. 8a of the paper."""
    return over_time(result, "joints.deformation", joint, ax, line, "mm")


@draws()
def travel(result: Result, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the travel of arms and sliders over time, from the places of the drive.

    Arms in degrees, counter-clockwise, sliders in millimetres along their direction; paths are
    prescribed and left out.

    Args:
        result: A run of a drive with mounts, with at least one sample.

    Raises:
        TypeError, ValueError: An argument breaks its rule; the drive has no arm and no slider.
    """
    moving = [(m, k, *mount._row.shown) for m, k, mount in result.params._moving]
    if result.mounts is None or not moving:
        raise ValueError("no pulley of this drive is on an arm or a slider")
    units, curves = sorted({unit for *_, unit in moving}), []
    for m, k, factor, unit in moving:
        name = style.plain(result.pulleys.names[k]) + (f" [{unit}]" if len(units) > 1 else "")
        curves.append(Curve(k, name, result.t, factor * result.mounts.travel[:, m]))
    return panel(ax, curves, line, y=f"travel from the drawn place [{', '.join(units)}]")


@draws()
def arcs(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the arcs of contact over time in degrees, and what of them slips, shaded.

    Where the shade reaches the line, the whole wrap slips and friction can carry no more; between
    the two the belt sticks. A link slips from 95 % of full friction on (:class:`beltdyn.Arcs`).

    Raises:
        AttributeError: An output that :attr:`beltdyn.Result.arcs` needs was not asked for.
    """
    found = result.arcs
    asked, wrap = columns(result.params, "pulley", pulleys), np.degrees(found.wrap)
    ax = style.axes(ax)
    lines(ax, [Curve(k, name, result.t, wrap[:, k]) for k, _, name in asked], line)
    for (k, *_), drawn in zip(asked, ax.lines[-len(asked) :], strict=True):
        slip = np.degrees(found.slip[:, k])
        ax.fill_between(result.t, slip, color=drawn.get_color(), alpha=0.25, lw=0.0)
    style.dress(ax, TIME.axis(), "arc [deg]")
    ax.set_ylim(bottom=0.0)
    style.legend(ax, handles=[*ax.lines, Patch(color="0.75", label="shaded: slips")])
    return ax


@draws()
def energy(result: Result, *, ax: Axes | None = None) -> Axes:
    """Draw where the work of the set torques went: losses stacked, stored energy on top.

    Losses and stored energy together differ from the net work of all set torques, motors less
    loads, by the residual E(t) - E(0) - (drive - losses) alone. The title shows its size, also as a
    share of the energy transmitted.

    Args:
        result: A run with at least one sample and its ledger.

    Raises:
        TypeError, ValueError: An argument breaks its rule, or the run carried no ledger.
    """
    ledger = result.energy
    if ledger is None:
        raise ValueError("result must carry the energy ledger: run simulate with ledger=True")
    ax = style.axes(ax)
    base = np.zeros_like(result.t)
    for k, (name, label) in enumerate(_LOSSES, 1):
        if (loss := getattr(ledger, name)) is None:
            continue
        look: dict[str, Any] = {"facecolor": style.tint(k), "edgecolor": style.COLOURS[k]}
        look |= {"hatch": style.HATCHES[k], "linewidth": 0.5, "label": label}
        ax.fill_between(result.t, base, base + loss, **look)
        base = base + loss
    # E(t) - E(0), where E(0) is that of the start of the run, which may precede the first sample.
    stored = ledger.residual + ledger.drive - ledger.losses
    blue = style.COLOURS[0]
    for values, label, colour, dashes, width in (
        (base + stored, "losses + stored", blue, "-", 2.4),
        (ledger.drive, "net work of set torques", "black", (0, (4, 2)), 1.0),
        (stored, "stored", blue, style.DASHES[3], 1.4),
    ):
        ax.plot(result.t, values, color=colour, ls=dashes, lw=width, label=label)
    worst = float(np.abs(ledger.residual).max())
    passed = float(ledger.passed[-1])
    amount = f"{passed:.3g} J" if passed < 1e3 else f"{passed / 1e3:.3g} kJ"
    share = f", {worst / passed:.1g} of {amount} transmitted" if passed > 0 else ""
    ax.set_title(f"residual at most {worst:.1g} J{share}", fontsize="small")
    style.dress(ax, TIME.axis(), QUANTITIES["energy.passed"].axis(short="energy"))
    style.legend(ax)
    return ax


# --- Contact and friction of single links ---------------------------------------------------------


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
    links, t = columns(result.params, "link", link), result.t
    forces = [which] if isinstance(which, str) else which
    if not isinstance(forces, Sequence):
        raise TypeError(f"which must be a str or a sequence of them, got {which!r}")
    if not forces:
        raise ValueError(f"which must hold at least one of {', '.join(_FORCES)}, got none")
    for word in forces:
        choice("which", word, _FORCES)
    curves = [
        Curve(n * len(forces) + m, f"{force}, {name}", t, getattr(result.contact, force)[:, k])
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
    row, contact, curves = QUANTITIES[quantity], result.contact, []
    for n, k, name in columns(result.params, "link", link):
        touches = contact.pulley[:, k] >= 0
        y = np.where(touches, result._history(quantity)[:, k], np.nan)
        x = np.where(touches, 1e3 * contact.slip[:, k], np.nan) if against == "slip" else result.t
        anew: Any = [] if result.params._flows else _begun_anew(result, k)
        name += "" if touches.any() else " (no contact)"
        curves.append(Curve(n, name, np.insert(x, anew, np.nan), np.insert(y, anew, np.nan)))
    over = TIME.axis() if against == "time" else QUANTITIES["contact.slip"].axis("mm")
    return panel(ax, curves, given, over, row.axis())


def _begun_anew(result: Result, k: int) -> NDArray[np.intp]:
    """Find the samples just before which link k lost contact and regained it."""
    # Another pulley is one sign. On the same one the slip displacement, the integral of v_T since
    # contact began, is then closer to the integral over this interval alone than to its old value
    # plus that integral, and farther from the latter than v_T allows.
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


# --- Along the belt -----------------------------------------------------------------------------


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
    flows, ends = result.params._flows, (first - 0.5, first + result.params.n_bodies - 0.5)
    label = f"t = {result.t[row]:.4g} s"
    ax = style.axes(ax)
    look = {"marker": ".", "markersize": 3, "linewidth": 0.9, "linestyle": "-"}
    at = np.arange(result.params.n_bodies, dtype=np.float64) + ends[0] + 0.5 * flows
    black = len(style.COLOURS) - 1
    lines(ax, [Curve(black, label, at, result.joints.force[row], look)], line)
    parts = [one for one in runs(result.contact.pulley[row]) if wraps and one[2] >= 0]
    shades = [(begin + ends[0], end + ends[0], pulley) for begin, end, pulley in parts]
    word, force = ("cell", "tension") if flows else ("element", "joint force")
    style.dress(ax, f"{word} along the belt", QUANTITIES["joints.force"].axis(short=force))
    ax.set_xlim(ends)
    _shade(ax, result, shades, style.tint)
    if len(ax.lines) > 1 or "label" in line:
        ax.set_title("")
        style.legend(ax)
    else:
        ax.set_title(label, fontsize="medium")
    return ax


def _shade(
    ax: Axes, result: Result, wraps: Iterable[tuple[float, float, int]], tint: Callable[[int], Any]
) -> None:
    """Shade wraps, and name the longest of each pulley."""
    longest: dict[int, tuple[float, float]] = {}
    for begin, end, pulley in wraps:
        ax.axvspan(begin, end, color=tint(pulley), lw=0.0, zorder=0.5)
        longest[pulley] = max((end - begin, begin + end), longest.get(pulley, (0.0, 0.0)))
    names = [style.plain(result.pulleys.names[pulley]) for pulley in longest]
    rows_of_names(ax, [0.5 * both for _, both in longest.values()], names)


@draws()
def tension_along(
    result: Result,
    t: float | Iterable[float] | None = None,
    *,
    ax: Axes | None = None,
    **line: Any,
) -> Axes:
    """Draw the tension along the belt line, in places fixed in space, at some times.

    Places are counted from where the belt leaves pulley 0, in the sense in which its links are
    numbered; the wraps on the pulleys are shaded and named. A belt that runs in that sense is drawn
    from left to right. Where the tension changes on a wrap, friction carries torque; it is constant
    where the belt sticks and has not stretched since it arrived.

    Args:
        t: Times [s], of each the nearest sample; None: the last.
        **line: For matplotlib's ``plot``. A ``label`` stands before the times if there are several.

    Raises:
        AttributeError: ``joints.force`` or ``belt`` was not asked for.
    """
    times = list(t) if isinstance(t, Iterable) and not isinstance(t, str) else [t]
    if not times:
        raise ValueError("t must hold at least one time, got none")
    rows = [sample(result, one) for one in times]
    n_s = _PER_LINK * result.params.n_bodies
    places = np.linspace(0.0, result.params.route.length, n_s + 1)
    found = along(result, "joints.force", places, rows)
    ax = style.axes(ax)
    wraps = [] if ax.lines else [(*ends, k) for k, ends in enumerate(found.wraps)]
    names = [f"t = {result.t[row]:.4g} s" for row in rows]
    lines(ax, [Curve(k, name, found.s, found.values[k]) for k, name in enumerate(names)], line)
    force = QUANTITIES["joints.force"].axis(short="tension")
    style.dress(ax, "place along the belt line [m]", force)
    ax.set_xlim(0.0, found.length)
    _shade(ax, result, wraps, lambda _: style.METAL)
    style.legend(ax)
    return ax
