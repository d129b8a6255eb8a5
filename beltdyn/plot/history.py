"""Speeds, torques, tensions, joints, travel of mounts, arcs of contact and energy over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from ..base.naming import span_names
from ..outputs.quantity import QUANTITIES, SPANS, TIME
from ..result.result import Result
from . import style
from .panel import draws, lines, named_pulleys, numbered, over_time, panel
from .select import Indices, Pulleys

_LOSSES = (
    ("friction_loss", "friction"),
    ("contact_loss", "contact dampers"),
    ("joint_loss", "damping of the belt"),
    ("drag_loss", "bearing drag"),
)


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
