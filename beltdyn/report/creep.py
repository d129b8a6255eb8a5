"""The speed that pulleys lose against the driving one, split by its causes.

At a place of a wrap the belt has the speed c lambda, c the stress-free length that passes in a
second and lambda its stretch there, and the rim omega r that less the slip velocity v. So for means
over the places in contact

    omega r = c lambda_in - f,    f = v - c (lambda - lambda_in),

with the stretch lambda_in at which the belt arrives and f the slip that friction needs. With the
radius R of the pulley and q = 1 - f / (c lambda_in), of the driving pulley with d, it loses

    -ln(omega R / omega_d R_d) = -ln(lambda_in / lambda_in,d) - ln(q / q_d)
                                 - ln((R / r) / (R_d / r_d)):

the stretch of creep theory, friction and running radii. What is measured differs from this by the
remainder, as far as the motion is not steady. Places count by the friction left unused there, mu N
- |F|: most where the belt sticks, which is where it arrives; in full slip by their normal force.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.checks import Array
from ..drive.span import Span
from .rows import Creep
from .slipping import friction_limits
from .touching import Touching
from .window import Window

__all__ = ["creep_rows", "driving", "least_speed"]

#: Share of the highest speed of its rim below which a belt stands still; so it does below the speed
#: that errors of speeds leave, ``info["drag_speed"]``.
STANDSTILL_SPEED = 1e-3
#: A pulley that loses more than this does not creep but slips; elastic creep is at most the strain.
SLIPS = 0.3


class _Of(NamedTuple):
    """Factors of the speed of a pulley: stretch, 1 - f / (c lambda), R / r."""

    stretch: float
    friction: float
    radius: float


def least_speed(window: Window) -> float:
    """Return the speed of the belt below which it stands still [m/s]."""
    radii = window.params._radii
    most = float(np.max(np.abs(window.run.pulleys.omega) * radii, initial=0.0))
    return max(STANDSTILL_SPEED * most, float(window.params.info["drag_speed"]))


def driving(window: Window, torque: Array | None) -> int | None:
    """Find the pulley that puts in the most power, in the mean; None if the belt stands still.

    By the torques that are set; where none puts power in, as when a drive runs down, or none is
    known, by those of the belt.
    """
    run = window.run
    if not run._has("pulleys.omega"):
        return None
    omega = window.of(run.pulleys.omega)
    radii = window.params._radii
    if not float(np.max(window.mean(np.abs(omega)) * radii)) > least_speed(window):
        return None
    if run._has("pulleys.torque"):
        power = window.mean(window.of(run.pulleys.torque) * omega)
        if power.max() > 0.0 or torque is None:
            return int(np.argmax(power))
    return 0 if torque is None else int(np.argmin(window.mean(torque * omega)))


def creep_rows(window: Window, touching: Touching, driver: int) -> list[Creep]:
    """Return the rows of all pulleys but the driving one; note what is missing."""
    params, notes = window.params, window.notes
    names = params.pulley_names
    kept = window.run._rims()
    if kept is None:
        notes.append("no creep: couplings.rim_speed not asked for (outputs of simulate)")
        return []
    omega = window.mean(window.of(kept))
    radii = params._radii
    rims = omega * radii * params.route.senses
    spans = window.spans()
    tension = None if spans is None else window.mean(spans)
    if tension is None or np.isnan(tension).any() or touching.speed == 0.0:
        notes.append("no split of creep: not all spans have a tension in this window")
        return []
    arriving = np.roll(tension, 1) if touching.speed > 0.0 else tension
    if touching.reverses(window):
        notes.append(
            "no creep: the belt's speed changes in this window by more than its mean, "
            f"{touching.speed:.3g} m/s; take a part of the run in which it runs evenly (last)"
        )
        return []
    limits = friction_limits(window, touching)
    parts = [_of(window, touching, k, float(arriving[k]), limits[k]) for k in range(radii.size)]
    first = parts[driver]
    rows = []
    for k, part in enumerate(parts):
        if k == driver:
            continue
        ratio = float(rims[k] / rims[driver])
        if part is None or first is None or not ratio > 0.0:
            why = "it does not turn with the belt"
            if part is None or first is None:
                why = "the belt does not touch it"
            if window.lost_mounts and (k in params.mounted or driver in params.mounted):
                why = "mounts.travel was not asked for, so that running radii are not known"
            notes.append(f"{params.label(k)}: no split of its creep, {why}")
            continue
        if abs(math.log(ratio)) > SLIPS:
            notes.append(
                f"{params.label(k)} slips, its rim has {100.0 * ratio:.0f} % of the speed of the "
                f"rim of {params.label(driver)}: no split of creep"
            )
            continue
        causes = [-math.log(one / of_first) for one, of_first in zip(part, first, strict=True)]
        side = params.route.senses[k] * params.route.senses[driver]
        lost = -math.log(ratio)
        rows.append(
            Creep(
                name=names[k],
                ratio=float(omega[k] / omega[driver]),
                nominal=float(side * radii[driver] / radii[k]),
                lost=lost,
                **dict(zip(_Of._fields, causes, strict=True)),
                remainder=lost - causes[0] - causes[1] - causes[2],
            )
        )
    return rows


def _of(window: Window, touching: Touching, k: int, tension: float, mu: float) -> _Of | None:
    params = window.params
    if window.lost_mounts and k in params.mounted:
        return None
    on = (touching.pulley == k) & (touching.normal > 0.0)
    weight = np.where(on, touching.normal, 0.0)
    unused = np.where(on, np.maximum(mu * touching.normal - np.abs(touching.friction), 0.0), 0.0)
    # In full slip there is next to none unused, by the scatter of samples.
    if unused.sum() > 0.01 * mu * weight.sum():
        weight = unused
    weight = weight * window.weights[:, None]
    total = float(weight.sum())
    if total == 0.0:
        return None

    def mean(values: Array) -> float:
        return float(np.sum(weight * values) / total)

    way = math.copysign(1.0, touching.speed)
    speed = abs(touching.speed)
    velocity = way * float(params.route.senses[k]) * mean(touching.velocity)
    stretch = Span(params.belt, tension).stretch
    slip = velocity - speed * (mean(touching.stretch) - stretch)
    carried = 1.0 - slip / (speed * stretch)
    if not carried > 0.0:
        return None
    return _Of(stretch, carried, params.pulleys[k].radius / mean(touching.running))
