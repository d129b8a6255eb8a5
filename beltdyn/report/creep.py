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

import numpy as np

from ..base.checks import Array
from ..drive.span import Span
from .rows import Creep
from .slipping import friction_limits
from .window import Window

#: A pulley that loses more than this does not creep but slips; elastic creep is at most the strain.
SLIPS = 0.3


def creep_rows(window: Window) -> list[Creep]:
    """Return the rows of all pulleys but the driving one, if any; note what is missing."""
    params, notes, touching, driver = window.params, window.notes, window.touching, window.driver
    if driver is None or touching is None or len(params.pulleys) == 1:
        return []
    kept = window.run._rims()
    if kept is None:
        window.lacks("no creep", "couplings.rim_speed")
        return []
    omega, rolling = window.mean(window.of(kept)), params._rolling
    rims = omega * rolling
    tension = None if window.spans is None else window.mean(window.spans)
    if tension is None or np.isnan(tension).any() or touching.flow == 0.0:
        notes.append("no split of creep: not all spans have a tension in this window")
        return []
    if window.reverses:
        notes.append(
            "no creep: the belt's speed changes in this window by more than its mean, "
            f"{touching.flow:.3g} m/s; take a part of the run in which it runs evenly (last)"
        )
        return []
    arriving = np.roll(tension, 1) if touching.flow > 0.0 else tension
    limits = friction_limits(window)
    parts = [_factors(window, k, float(arriving[k]), limits[k]) for k in range(rolling.size)]
    first, rows = parts[driver], []
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
        lost = -math.log(ratio)
        stretch, friction, radius = (
            -math.log(one / of_first) for one, of_first in zip(part, first, strict=True)
        )
        rows.append(
            Creep(
                name=params.pulley_names[k],
                ratio=float(omega[k] / omega[driver]),
                nominal=float(rolling[driver] / rolling[k]),
                lost=lost,
                stretch=stretch,
                friction=friction,
                radius=radius,
                remainder=lost - stretch - friction - radius,
            )
        )
    return rows


def _factors(
    window: Window, k: int, tension: float, mu: float
) -> tuple[float, float, float] | None:
    """Return the factors of the speed of a pulley, lambda_in, q, R / r; None: no contact."""
    params, on = window.params, window.touching
    assert on is not None
    if window.lost_mounts and k in params.mounted:
        return None
    touches = (on.pulley == k) & (on.normal > 0.0)
    weight = np.where(touches, on.normal, 0.0)
    unused = np.where(touches, np.maximum(mu * on.normal - np.abs(on.friction), 0.0), 0.0)
    # In full slip there is next to none unused, by the scatter of samples.
    if unused.sum() > 0.01 * mu * weight.sum():
        weight = unused
    weight = weight * window.weights[:, None]
    total = float(weight.sum())
    if total == 0.0:
        return None

    def mean(values: Array) -> float:
        return float(np.sum(weight * values) / total)

    flow, way = abs(on.flow), math.copysign(1.0, on.flow)
    velocity = way * float(params.route.senses[k]) * mean(on.velocity)
    stretch = Span(params.belt, tension).stretch
    slip = velocity - flow * (mean(on.stretch) - stretch)
    carried = 1.0 - slip / (flow * stretch)
    if not carried > 0.0:
        return None
    return stretch, carried, params.pulleys[k].radius / mean(on.running)
