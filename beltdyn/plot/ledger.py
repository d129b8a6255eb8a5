"""The energy ledger over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..outputs.quantity import QUANTITIES, TIME
from ..result.result import Result
from . import style
from .select import with_samples

__all__ = ["energy"]

_LOSSES = (
    ("friction_loss", "friction"),
    ("contact_loss", "contact dampers"),
    ("joint_loss", "damping of the belt"),
    ("drag_loss", "bearing drag"),
)


def energy(result: Result, *, ax: Axes | None = None) -> Axes:
    """Draw where the work of the set torques went: losses stacked, stored energy on top.

    Losses and stored energy together differ from the net work of all set torques, motors less
    loads, by the residual E(t) - E(0) - (drive - losses) alone. The title shows its size, also as a
    share of the energy transmitted.

    Args:
        result: A run with at least one sample and its ledger.
        ax: Axes to draw into; None: those of a new figure.

    Raises:
        TypeError, ValueError: An argument breaks its rule, or the run carried no ledger.
    """
    result = with_samples(result)
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
