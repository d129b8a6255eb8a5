"""Slip over a whole wrap: a pulley carries all that friction can, and slips."""

from __future__ import annotations

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..drive.friction import TINY
from ..drive.params import Params
from .arcs import full_friction, per_pulley
from .averages import durations

#: Share of the largest possible friction, |sum mu N| / sum mu_k N, from which on the whole wrap
#: slips; links that have just arrived still need a slip of some mu_k/sigma. A steady drive stays
#: below: 0.88 in case 1 of the paper, which is loaded almost to its limit. In place of mu_k stands
#: what friction has at the slip velocity of each link, where its law depends on that: with LuGre's
#: law a link that sticks can hold mu_s.
FULL_SLIP = 0.98
#: Slip in units of mu_k/sigma, below which a pulley has only moved within its friction joint.
MIN_SLIP = 10.0
#: Friction below this share of the belt's tension is neglected.
NEGLIGIBLE_FRICTION = 0.01


@attrs.frozen(eq=False, kw_only=True)
class GrossSlip:
    """Slip of whole wraps, of each pulley (n_p,)."""

    #: At which samples (n_t, n_p); nowhere on one that moves by no more than the travel in which
    #: its friction develops.
    slips: NDArray[np.bool_]
    slip_distance: Array  # meanwhile [m]
    carried: Array  # mean friction meanwhile [N]; single samples have what landing links add
    lost: Array  # energy dissipated by it [J]


def gross_slip(
    params: Params,
    t: Array,
    pulley: NDArray[np.int32],
    normal: Array,
    friction: Array,
    velocity: Array,
) -> GrossSlip | None:
    """Find where pulleys slip over their whole wrap; None if none does."""
    if not params.has_friction:
        return None
    _, developed = params._slip_limits
    n_t, n_p = t.size, len(params.pulleys)
    carried = np.abs(per_pulley(friction, pulley, n_p))
    most = per_pulley(full_friction(params, pulley, velocity) * normal, pulley, n_p)
    saturated = (carried >= FULL_SLIP * most) & (
        most > NEGLIGIBLE_FRICTION * params.info["strain_tension"]
    )
    rows = np.flatnonzero(saturated.any(axis=1))
    if rows.size == 0:
        return None
    lost = np.zeros((n_t, n_p))
    lost[rows] = per_pulley(friction[rows] * velocity[rows], pulley[rows], n_p)
    speed = np.divide(lost, carried, out=np.zeros_like(lost), where=saturated & (carried > 0.0))
    # A wrap whose friction is fully developed from tensioning alone does not slip.
    slips = speed > 0.01 * speed.max(axis=0)
    lasts = durations(t)[:, None]
    distance = np.sum(np.where(slips, lasts * speed, 0.0), axis=0)
    slips &= distance > MIN_SLIP * developed
    if not slips.any():
        return None
    during = np.where(slips, lasts, 0.0)
    return GrossSlip(
        slips=slips,
        slip_distance=distance,
        carried=np.sum(during * carried, axis=0) / np.maximum(np.sum(during, axis=0), TINY),
        lost=np.sum(during * lost, axis=0),
    )
