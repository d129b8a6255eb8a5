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

from ..checks import Array
from .rows import Creep
from .touching import Touching
from .window import Window

__all__ = ["creep_rows", "driving"]

#: Share of the highest speed of its rim below which a belt stands still.
STANDS = 1e-3


class _Of(NamedTuple):
    """What goes into the speed of a pulley: stretch, 1 - f / (c lambda), R / r."""

    stretch: float
    friction: float
    radius: float


def driving(window: Window, torque: Array | None) -> int | None:
    """Find the pulley that puts the most power into the belt; None if the belt stands still.

    Args:
        window: The part of the run.
        torque: Mean torque of the belt on each pulley [N m]; None: by the torques that are set.
    """
    run = window.run
    if not run._has("pulleys.omega"):
        return None
    omega = window.mean(window.of(run.pulleys.omega))
    radii = np.array([pulley.radius for pulley in window.params.pulleys])
    most = float(np.max(np.abs(run.pulleys.omega) * radii, initial=0.0))
    if not float(np.max(np.abs(omega) * radii)) > STANDS * most:
        return None
    if torque is not None:
        return int(np.argmin(torque * omega))
    if run._has("pulleys.torque"):
        return int(np.argmax(window.mean(window.of(run.pulleys.torque)) * omega))
    return 0


def creep_rows(window: Window, touching: Touching, driver: int) -> tuple[list[Creep], list[str]]:
    """Give the rows of all pulleys but the driving one, and what is missing."""
    params, notes = window.params, []
    names = params.pulley_names
    omega = window.mean(window.of(window.run.pulleys.omega))
    radii = np.array([pulley.radius for pulley in params.pulleys])
    rims = omega * radii * params.route.senses
    spans = window.spans()
    tension = None if spans is None else window.mean(spans)
    if tension is None or np.isnan(tension).any() or touching.speed == 0.0:
        return [], ["no split of creep: not all spans have a tension in this window"]
    arriving = np.roll(tension, 1) if touching.speed > 0.0 else tension
    parts = [_of(window, touching, k, float(arriving[k])) for k in range(radii.size)]
    first = parts[driver]
    rows = []
    for k, part in enumerate(parts):
        if k == driver:
            continue
        ratio = float(rims[k] / rims[driver])
        if part is None or first is None or not ratio > 0.0:
            why = "the belt does not touch it" if part is None else "it does not turn with the belt"
            notes.append(f"{params.label(k)}: no split of its creep, {why}")
            continue
        stretch = -math.log(part.stretch / first.stretch)
        friction = -math.log(part.friction / first.friction)
        radius = -math.log(part.radius / first.radius)
        lost = -math.log(ratio)
        rows.append(
            Creep(
                name=names[k],
                ratio=float(omega[k] / omega[driver]),
                nominal=float(
                    params.route.senses[k] * params.route.senses[driver] * radii[driver] / radii[k]
                ),
                lost=lost,
                stretch=stretch,
                friction=friction,
                radius=radius,
                remainder=lost - stretch - friction - radius,
            )
        )
    return rows, notes


def _of(window: Window, touching: Touching, k: int, tension: float) -> _Of | None:
    params = window.params
    on = (touching.pulley == k) & (touching.normal > 0.0)
    mu = float(params._slip_limits[0][k])
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
    stretch = 1.0 + tension / params.belt.axial_stiffness
    slip = velocity - speed * (mean(touching.stretch) - stretch)
    carried = 1.0 - slip / (speed * stretch)
    if not carried > 0.0:
        return None
    return _Of(stretch, carried, params.pulleys[k].radius / mean(touching.running))
