"""Implausible data and unexpected behaviour, as found in the samples of a run.

Every limit below stands with the argument for it. They lead to warnings only; nothing is refused
or changed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from .arcs import in_slip
from .checks import Array
from .naming import span_name
from .outputs import has, unchecked
from .params import Params
from .result import Result
from .run_warnings import RunWarning
from .sanity import units

__all__ = ["observe"]

#: A torque this many times 2 T R, what is carried when all tension has gone to one side.
TORQUE = 10.0
#: Share of the largest possible friction, |sum mu N| / sum mu_k N, from which on the whole wrap
#: slips; links that have just arrived still need a slip of some mu_k/sigma. A steady drive stays
#: below: 0.88 in case 1 of the paper, which is loaded almost to its limit. In place of mu_k stands
#: what friction has at the slip velocity of each link, where its law depends on that: with LuGre's
#: law a link that sticks can hold mu_s.
SATURATED = 0.98
#: Slip in units of mu_k/sigma, below which a pulley has only moved within its friction joint.
SLIPPED = 10.0
#: Friction below this share of the belt's tension is neglected.
FAINT = 0.01


def observe(result: Result, moved: Collection[int] = ()) -> tuple[RunWarning, ...]:
    """Give the warnings of a run's samples: no_friction, full_slip, slack_span, units (of torque).

    Those alone that show in the outputs that the run was asked for (``Result.unchecked``).

    Args:
        result: A run, finished or not.
        moved: Pulleys whose motion is prescribed, whose torque nobody has set.
    """
    if result.t.size == 0:
        return ()
    with np.errstate(all="ignore"):  # a failed run may end with huge numbers
        found = {
            "no_friction": _no_friction(result),
            "units": _torques(result, moved),
            "full_slip": _full_slip(result, moved),
            "slack_span": _slack_spans(result),
        }
        missing = unchecked(result.outputs, result.params.has_friction)
        return tuple(one for code in found if code not in missing for one in found[code])


def _no_friction(result: Result) -> Iterator[RunWarning]:
    params, pulleys = result.params, result.pulleys
    if params.has_friction:
        return
    fed = pulleys.torque * pulleys.omega
    first, driven = np.unravel_index(int(np.argmax(fed > 0.0)), fed.shape)
    if fed[first, driven] > 0.0:
        yield RunWarning(
            code="no_friction",
            text=f"{params.label(int(driven))} is driven, with up to "
            f"{np.nanmax(fed[:, driven]):.3g} W, but friction is off, so the belt "
            "transmits nothing: set Params.friction",
            t=float(result.t[first]),
            where=params.label(int(driven)),
        )


def _torques(result: Result, moved: Collection[int]) -> Iterator[RunWarning]:
    params, pulleys = result.params, result.pulleys
    info = params.info
    tension = params.belt.axial_stiffness * (info["strain"] + info["mesh_strain"])
    carried = 2.0 * tension * np.array([pulley.radius for pulley in params.pulleys])
    size = np.abs(pulleys.torque)
    size[:, list(moved)] = 0.0
    # in a twentieth of the samples: a controller may set extreme torques for a moment
    over = np.quantile(size, 0.95, axis=0) / carried
    worst = int(np.argmax(over))
    if over[worst] > TORQUE:
        most = size[:, worst].max()
        yield units(
            f"a torque of {most:.3g} N m acts on {params.label(worst)}, but a belt of "
            f"{tension:.3g} N transmits at most {carried[worst]:.3g} N m: is it in N mm?",
            params.label(worst),
            t=float(result.t[np.argmax(size[:, worst] > TORQUE * carried[worst])]),
        )


def _full_slip(result: Result, moved: Collection[int]) -> Iterator[RunWarning]:
    params, contact = result.params, result.contact
    if not params.has_friction:
        return
    kinetic, developed = params._slip_limits
    n_t, n_p = result.t.size, len(params.pulleys)
    bins = _bins(contact.pulley, n_p)
    friction = _per_pulley(contact.friction, bins, n_p)
    most = kinetic * _per_pulley(contact.normal, bins, n_p)
    for k in range(n_p):
        law = params.friction_on(k)
        held = None if law is None else in_slip(law, float(kinetic[k]), contact.velocity)
        if held is not None:
            most[:, k] = _per_pulley(held * contact.normal, bins, n_p)[:, k]
    tension = params.info["strain_tension"]
    saturated = (np.abs(friction) >= SATURATED * most) & (most > FAINT * tension)
    rows = np.flatnonzero(saturated.any(axis=1))
    if rows.size == 0:
        return
    lost = np.zeros((n_t, n_p))
    lost[rows] = _per_pulley(
        contact.friction[rows] * contact.velocity[rows], _bins(contact.pulley[rows], n_p), n_p
    )
    lasts = _durations(result.t)
    for k, pulley in enumerate(params.pulleys):
        speed = np.where(saturated[:, k], lost[:, k] / np.abs(friction[:, k]), 0.0)
        # A wrap whose friction is fully developed from tensioning alone does not slip.
        slips = speed > 0.01 * speed.max()
        slip = float(np.sum(lasts * speed, where=slips))
        if not slip > SLIPPED * developed[k]:
            continue
        first, last, whole = _when(result.t, lasts, slips)
        carried = float(np.max(np.abs(friction[slips, k]))) * pulley.radius
        given = float(np.max(np.abs(result.pulleys.torque[slips, k])))
        of_set = (
            f", the set torque is {given:.3g} N m" if given > carried and k not in moved else ""
        )
        yield RunWarning(
            code="full_slip",
            text=f"{params.label(k)} slips over its whole wrap, by {slip:.2g} m, {whole} between "
            f"t = {first:.4g} and {last:.4g} s, which dissipates "
            f"{np.sum(lasts * lost[:, k], where=slips):.3g} J: friction transmits "
            f"{carried:.3g} N m at most{of_set}; {_tighter(params)} or lower the torque",
            t=first,
            where=params.label(k),
        )


def _tighter(params: Params) -> str:
    """Say how the belt gets more tension."""
    if params.belt.preload is not None:
        return "raise belt.preload"
    return "raise the preload (a shorter belt.length)"


def _slack_spans(result: Result) -> Iterator[RunWarning]:
    # Span tensions are costly to compute, so only at samples where any joint has no tension.
    of_joints = has(result.outputs, "joints.force")
    forces = result.joints.force if of_joints else result.span_tension
    rows = np.flatnonzero((forces <= 0.0).any(axis=1))
    if rows.size == 0:
        return
    params, n_p = result.params, len(result.params.pulleys)
    tension = result._span_tension(rows)
    lasts = _durations(result.t)
    for k in range(n_p):
        slack = np.zeros(result.t.size, dtype=bool)
        slack[rows] = tension[:, k] <= 0.0
        if not slack.any():
            continue
        first, last, whole = _when(result.t, lasts, slack)
        yield RunWarning(
            code="slack_span",
            text=f"span {k}, from {params.label(k)} to {params.label((k + 1) % n_p)}, is slack, "
            f"down to {np.nanmin(tension[:, k]):.3g} N, {whole} between t = {first:.4g} and "
            f"{last:.4g} s; {_tighter(params)} or lower the torque; "
            "how a slack span becomes tight again may depend on very small differences, so "
            "the error is unknown",
            t=first,
            where=f"span {span_name(k, params.pulley_names, unnamed=str(k))}",
            accuracy=True,
        )


def _bins(touched: NDArray[np.int32], n_p: int) -> NDArray[np.intp]:
    """Give every (sample, pulley) a number; pulley -1, no contact, is the first of a sample."""
    rows = np.arange(touched.shape[0], dtype=np.intp)[:, None]
    return (touched + (rows * (n_p + 1) + 1)).ravel()


def _per_pulley(values: Array, bins: NDArray[np.intp], n_p: int) -> Array:
    """Add up values of links (n_t, n_b) by the pulley they touch (n_t, n_p)."""
    n_t = values.shape[0]
    total = np.bincount(bins, weights=values.ravel(), minlength=n_t * (n_p + 1))
    return np.asarray(total.reshape(n_t, n_p + 1)[:, 1:], dtype=float)


def _durations(t: Array) -> Array:
    """Time that each sample stands for [s]."""
    half = np.diff(t) / 2.0
    return np.asarray(np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half]))


def _when(t: Array, lasts: Array, during: NDArray[np.bool_]) -> tuple[float, float, str]:
    """First and last time, and how long in all, in words."""
    seen = np.flatnonzero(during)
    return float(t[seen[0]]), float(t[seen[-1]]), f"for {np.sum(lasts[seen]):.3g} s"
