"""Arcs of contact, of slip and of stick; and the rule by which a link slips."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..drive.friction import TINY, Friction
from ..drive.params import Params
from .averages import durations
from .histories import BeltHistory
from .sampled import Sampled
from .spans import ALL, joint_points

#: Share of the friction in full slip from which on a link counts as slipping. Laws with a state
#: approach full slip over a way of some mu_k / sigma, of Dahl's 1 - exp(-x sigma / mu_k): 95 % are
#: reached after three of these ways, short against the slip of an arc that slips. In an arc that
#: sticks friction may stay anywhere below; and results are accurate to about a percent.
SLIP_FROM = 0.95
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
#: Numbers of a block of samples: 16 MB to an array.
_BLOCK = 2_000_000


@attrs.frozen(eq=False, kw_only=True)
class Arcs:
    """Where the belt lies on the pulleys, and where it slips on them, each (n_t, n_p) [rad].

    A link, or joint, that touches a pulley counts for half the angle to its neighbours on both
    sides, seen from the axis. With contact along the links the two joints at each end of a wrap
    count for less, in proportion to their normal forces: a wrap of five links and more is right to
    a fraction of a link. On the mesh of the paper it is right to half a link at each end, as is the
    boundary of stick and slip on any; means over some passing links are better. Each cell of an ALE
    belt counts for its own angle, and the boundary is found between their middles.

    A link slips if its friction is at least 95 % of that in full slip at its slip velocity, |F| >=
    0.95 mu N; a law with a state needs some slip to get there. A law without one (``Coulomb``,
    ``CreepRate``, ``Threlfall``), which creeps at any load, slips where its friction is 95 % of the
    most that it reaches at higher speeds. On a pulley without friction all of the wrap slips. A
    link on two pulleys belongs to the one with the larger normal force.

    Links that land shake the belt. Where it creeps more slowly than it is shaken, it creeps back in
    between and friction drops each time; on coarse meshes no link may then reach 95 %.
    ``returning`` measures this: where it is more than a few percent, the arc of slip is too small.

    Attributes:
        wrap: Arc of contact [rad].
        slip: The part of it that slips [rad].
        stick: The rest of it [rad].
        returning: Share of the arc with at least half the friction of full slip on which friction
            is falling, because the belt creeps back [1].
    """

    wrap: Array
    slip: Array
    stick: Array
    returning: Array

    def __repr__(self) -> str:
        return f"Arcs(wrap, slip, stick: {self.wrap.shape})"


def in_slip(law: Friction, kinetic: float, velocity: Array) -> Array | None:
    """Return the friction coefficients in slip at these velocities; None if they depend on none.

    Interpolated between speeds 5 % apart, a millionth of the highest the least: a law that changes
    over its own scale of speed is met to a thousandth, far below what is asked of full slip.
    """
    highest = float(np.max(np.abs(velocity), initial=0.0))
    if not 0.0 < highest < np.inf:
        return None
    speed = highest * np.geomspace(1e-6, 1.0, 300)
    coefficients = law._in_slip(speed, kinetic)
    if law.n_states == 0:  # it slips at any load; what counts is what it could give when faster
        coefficients = np.maximum.accumulate(np.append(coefficients, kinetic)[::-1])[:0:-1]
    if np.ptp(coefficients) <= 1e-6 * kinetic:
        return None
    return np.interp(np.abs(velocity), speed, coefficients)


def full_friction(params: Params, touched: NDArray[np.int32], velocity: Array | None) -> Array:
    """Return the friction coefficients of links in full slip; any value off the pulleys."""
    kinetic, _ = params._slip_limits
    full = kinetic[touched]
    for k in range(len(params.pulleys)):
        law = params.friction_on(k)
        held = None
        if law is not None and velocity is not None:
            held = in_slip(law, float(kinetic[k]), velocity)
        if held is not None:
            full = np.where(touched == k, held, full)
    return np.asarray(full)


def contact_points(params: Params, belt: BeltHistory, rows: Any) -> Array:
    """Return the points at which contact is reported (n_t, n_b, 2) [m].

    The joints on the left of the links where contact acts along these, else their centres, or the
    masses of a string; of cells the middles of the lines between their ends.
    """
    if params._belt_facts["at_joints"]:
        return joint_points(params, belt, rows)
    points = np.stack([belt.x[rows], belt.y[rows]], axis=-1)
    if params._flows:
        points = 0.5 * (points + np.roll(points, -1, axis=1))
    return np.asarray(points)


def per_pulley(values: Array, touched: NDArray[np.int32], n_p: int) -> Array:
    """Add up values of links (n_t, n_b) by the pulley they touch (n_t, n_p)."""
    n_t = values.shape[0]
    bins = touched + np.arange(n_t, dtype=np.intp)[:, None] * (n_p + 1) + 1  # first: no contact
    total = np.bincount(bins.ravel(), weights=values.ravel(), minlength=n_t * (n_p + 1))
    return np.asarray(total.reshape(n_t, n_p + 1)[:, 1:], dtype=float)


def turns(begin: Array, end: Array) -> Array:
    """Return the angles from one direction to another, within +-pi; the last axis is x, y."""
    cross = begin[..., 0] * end[..., 1] - begin[..., 1] * end[..., 0]
    return np.asarray(np.arctan2(cross, (begin * end).sum(axis=-1)))


def arcs_of(run: Sampled, centers: Array, rows: slice = ALL) -> Arcs:
    """Find the arcs at every sample of ``rows``, with the axes there, or one place of them."""
    params, belt, contact = run.params, run.belt, run.contact
    first, last, _ = rows.indices(len(contact.pulley))
    n_t, n_b, n_p = last - first, contact.pulley.shape[1], len(params.pulleys)
    wrap, slip, returning = (np.zeros((n_t, n_p)) for _ in range(3))
    size = max(1, _BLOCK // n_b)
    for begin in range(0, n_t, size):
        here = slice(begin, begin + size)
        rows = slice(first + begin, min(first + begin + size, last))
        touched, normal = contact.pulley[rows], contact.normal[rows]
        points = contact_points(params, belt, rows)
        axes = centers[here] if len(centers) > 1 else centers
        full = full_friction(params, touched, contact.velocity[rows])
        rubs, falls = np.abs(contact.mu[rows]), contact.mu[rows] * contact.velocity[rows] < 0.0
        for k in range(n_p):
            on = touched == k
            if params._flows:
                angles = _of_cells(params, belt, rows, axes[:, k], on)
                slipping = _beyond(rubs - SLIP_FROM * full, on)
            else:
                angles = _angles(params, points - axes[:, k, None, :], on, normal)
                slipping = (rubs >= SLIP_FROM * full).astype(float)
            wrap[here, k] = angles.sum(axis=1)
            slip[here, k] = (slipping * angles).sum(axis=1)
            much = np.where(rubs >= 0.5 * full, angles, 0.0)
            back, whole = np.where(falls, much, 0.0).sum(axis=1), much.sum(axis=1)
            np.divide(back, whole, out=returning[here, k], where=whole > 0.0)
    return Arcs(wrap=wrap, slip=slip, stick=wrap - slip, returning=returning)


def _of_cells(
    params: Params, belt: BeltHistory, rows: slice, axis: Array, on: NDArray[np.bool_]
) -> Array:
    """Return the angles between the ends of cells on a pulley (n_t, n_b) [rad]; 0: off it."""
    arm = np.stack([belt.x[rows], belt.y[rows]], axis=-1) - axis[:, None]
    return np.where(on, np.abs(turns(arm, np.roll(arm, -1, axis=1))), 0.0)


def _beyond(excess: Array, on: NDArray[np.bool_]) -> Array:
    """Return the share of each cell (n_t, n_b) where linearly interpolated values are positive."""
    # The outer halves of the first and the last cell of a pulley are as their middles.
    share = np.zeros(excess.shape)
    for ahead in (-1, 1):
        near = np.where(np.roll(on, ahead, axis=1), np.roll(excess, ahead, axis=1), excess)
        edge = 0.5 * (excess + near)  # where the cells meet
        most, least = np.maximum(excess, edge), np.minimum(excess, edge)
        part = np.divide(most, most - least, out=np.ones_like(most), where=most > least)
        share += 0.5 * np.where(least >= 0.0, 1.0, np.where(most > 0.0, part, 0.0))
    return share


def _angles(params: Params, arm: Array, on: NDArray[np.bool_], normal: Array) -> Array:
    """Return the angles that links on a pulley stand for (n_t, n_b) [rad]; 0 for those off it."""
    after = np.abs(turns(arm, np.roll(arm, -1, axis=1)))
    angles = np.where(on, 0.5 * (after + np.roll(after, 1, axis=1)), 0.0)
    if not params._belt_facts["smooth"]:
        return angles
    # The first two at an end share the links of which a part may touch. Their forces over that of
    # the third, which is all on the rim, are that part, f + 1/2 of a link under an even pressure.
    for ahead in (-1, 1):
        inner = np.roll(on, ahead, axis=1) & np.roll(on, 2 * ahead, axis=1)
        first = on & ~np.roll(on, -ahead, axis=1) & inner
        for end, further in ((first, 2), (np.roll(first, -ahead, axis=1), 1)):
            whole = np.roll(normal, further * ahead, axis=1)
            part = np.divide(normal, whole, out=np.ones_like(normal), where=end & (whole > normal))
            angles = np.where(end, angles * part, angles)
    return angles


# --- Slip over a whole wrap: a pulley carries all that friction can, and slips --------------------


@attrs.frozen(eq=False, kw_only=True)
class GrossSlip:
    """Slip of whole wraps, of each pulley (n_p,)."""

    #: At which samples (n_t, n_p); nowhere on one that moves by no more than the travel in which
    #: its friction develops.
    slips: NDArray[np.bool_]
    slip_distance: Array  # meanwhile [m]
    carried: Array  # mean friction meanwhile [N]; single samples have what landing links add
    lost: Array  # energy dissipated by it [J]


def gross_slip(run: Sampled, rows: slice = ALL) -> GrossSlip | None:
    """Find where pulleys slip over their whole wrap, in samples of a run; None if none does."""
    params, contact, t = run.params, run.contact, run.t[rows]
    pulley, friction, velocity = (
        getattr(contact, name)[rows] for name in ("pulley", "friction", "velocity")
    )
    _, developed = params._slip_limits
    n_t, n_p = t.size, len(params.pulleys)
    carried = np.abs(per_pulley(friction, pulley, n_p))
    full = full_friction(params, pulley, velocity)
    most = per_pulley(full * contact.normal[rows], pulley, n_p)
    saturated = (carried >= FULL_SLIP * most) & (
        most > NEGLIGIBLE_FRICTION * params.info["strain_tension"]
    )
    some = np.flatnonzero(saturated.any(axis=1))
    if some.size == 0:
        return None
    lost = np.zeros((n_t, n_p))
    lost[some] = per_pulley(friction[some] * velocity[some], pulley[some], n_p)
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
