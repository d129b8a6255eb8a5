"""Over time: speeds, torques, tensions, joints, mounts, arcs, energy; contact of single links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.naming import span_names
from ..outputs.quantity import QUANTITIES, SPANS, TIME
from ..result.result import Result
from . import style
from .panel import Indices, Pulleys, choice, draws, lines, named_pulleys, numbered, over_time, panel

_LOSSES = (
    ("friction_loss", "friction"),
    ("contact_loss", "contact dampers"),
    ("joint_loss", "damping of the belt"),
    ("drag_loss", "bearing drag"),
)
_FORCES = ("normal", "friction")


@draws()
def speeds(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the angular velocities of the pulleys over time: Figs 7, 14 and 19 of the paper.

    Of pulleys with a coupling those of their shafts, and dotted those of their rims.
    """
    columns = named_pulleys(result, pulleys)
    which = [k for k, *_ in columns]
    rims = []
    for c, k in enumerate(result.params.coupled):
        if k in which and result.couplings is not None:
            coupling = result.params.pulleys[k].coupling
            part = "rim" if coupling is None else coupling._part
            name = f"{part} of {style.plain(result.pulleys.names[k])}"
            rim = (k, name, result.t, result.couplings.rim_speed[:, c])
            rims.append((rim, {"linestyle": ":"}))
    return over_time(result, "pulleys.omega", columns, ax, line, more=rims)


@draws()
def torques(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the set torques M_d of (2.12) over time: Figs 6 and 13 of the paper."""
    return over_time(result, "pulleys.torque", named_pulleys(result, pulleys), ax, line)


@draws()
def span_tensions(result: Result, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the mean tension of each free span over time; gaps where a span has no joint."""
    names = span_names(result.pulleys.names)
    columns = [(k, k, style.plain(name)) for k, name in enumerate(names)]
    return over_time(result, SPANS, columns, ax, line)


@draws()
def joint_force(result: Result, joint: Indices, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the force along joints (2.2) over time: Figs 8b and 15 of the paper."""
    return over_time(result, "joints.force", numbered(result, "joint", joint), ax, line)


@draws()
def joint_deformation(
    result: Result, joint: Indices, *, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the stretch of joints (2.2) over time, in mm: Fig. 8a of the paper."""
    columns = numbered(result, "joint", joint)
    return over_time(result, "joints.deformation", columns, ax, line, (1e3, "mm"))


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
    params = result.params
    moving = [(m, k, *mount._row.shown) for m, k, mount in params._moving]
    if result.mounts is None or not moving:
        raise ValueError("no pulley of this drive is on an arm or a slider")
    units = sorted({unit for *_, unit in moving})
    curves = []
    for m, k, factor, unit in moving:
        name = style.plain(result.pulleys.names[k])
        label = name if len(units) == 1 else f"{name} [{unit}]"
        curves.append((k, label, result.t, factor * result.mounts.travel[:, m]))
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
    columns, wrap = named_pulleys(result, pulleys), np.degrees(found.wrap)
    ax = style.axes(ax)
    lines(ax, [(k, name, result.t, wrap[:, k]) for k, _, name in columns], line)
    for (k, *_), drawn in zip(columns, ax.lines[-len(columns) :], strict=True):
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
    for k, (name, label) in enumerate(_LOSSES):
        loss = getattr(ledger, name)
        if loss is None:
            continue
        top = base + loss
        ax.fill_between(
            result.t,
            base,
            top,
            facecolor=style.tint(k + 1),
            edgecolor=style.COLOURS[k + 1],
            hatch=style.HATCHES[k + 1],
            linewidth=0.5,
            label=label,
        )
        base = top
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
    style.add_headroom(ax, rows=-(-len(ax.get_legend_handles_labels()[0]) // 2))
    style.legend(ax, loc="upper left", ncols=2, handlelength=1.6, columnspacing=1.2)
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
