"""Quantities that engineers read off a run, and their differences between two runs.

None of it depends on the number of links, so that runs on different meshes can be compared.
"""

from __future__ import annotations

import math

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array, integer, share_of_run
from ..drive.params import Params
from ..outputs.averages import time_weights
from ..outputs.spans import mid_span
from ..result.result import Result

#: The quantities, in the order in which they are reported; :class:`Observed` describes them.
QUANTITIES = ("tension", "speed", "span_mean", "creep", "friction", "power")
#: Those that are histories, the others are means over the last part of a run.
HISTORIES = ("tension", "speed")

#: The outputs of a run that they are read off from (:func:`observe`).
OBSERVED = (
    "pulleys.omega",
    "couplings.rim_speed",
    "pulleys.torque",
    "belt.x",
    "belt.y",
    "belt.phi",
    "joints.force",
    "contact.pulley",
    "contact.friction",
    "contact.velocity",
)

#: Least scale of creep, 0.1 %: slip is measured no better, and unloaded belts have none.
CREEP = 1e-3
#: Least scale of friction forces, as a share of the mean tension.
MIN_FRICTION = 1e-2
#: Share of its highest speed below which a belt stands still: creep is then relative to that.
STANDSTILL_SPEED = 1e-3


@attrs.frozen(eq=False, kw_only=True)
class Observed:
    """Quantities read off a run.

    Attributes:
        t: Sample times (n_t,) [s].
        tension: Joint force in the middle of the free span after each pulley (n_t, n_p) [N]: at a
            place, not at a link, interpolated between the two joints next to it. Of a drive with
            one pulley the mean of all joints.
        speed: Angular velocities of the pulleys (n_t, n_p) [rad/s].
        span_mean: Mean of ``tension`` over the last part (n_p,) [N].
        creep: Creep of each pulley relative to the fastest rim, in the last part (n_p,) [1]: the
            difference of the rims' mean speeds omega_k r_k, over the mean of the fastest rim's
            absolute speed. 0 for a belt that never moved.
        friction: Mean friction torque on each pulley over its radius (n_p,) [N], in the last part.
        power: Mean power of the torque set on each pulley, and last of friction against slip,
            positive for what is lost (n_p + 1,) [W], in the last part.
        scales: By quantity, what its differences are divided by: "tension" and "span_mean" the mean
            tension over the run [N]; "speed" the highest speed of a pulley [rad/s]; "creep" the
            largest creep, at least 0.1 %; "friction" the largest friction force of a pulley over
            the run [N], at least 1 % of the mean tension; "power" the largest power at a pulley in
            the run [W]. 0 where there is nothing to compare, as the speed of a belt at rest.
    """

    t: Array
    tension: Array
    speed: Array
    span_mean: Array
    creep: Array
    friction: Array
    power: Array
    scales: dict[str, float]


def with_links(params: Params, n_bodies: int) -> Params:
    """Return the same drive on a finer or coarser mesh: belt data are per length.

    Args:
        params: The drive.
        n_bodies: Number of links.

    Raises:
        TypeError, ValueError: The number breaks its rule.
    """
    return attrs.evolve(
        params, belt=attrs.evolve(params.belt, n_bodies=integer("n_bodies", n_bodies, 3))
    )


def observe(result: Result, last: float = 0.2) -> Observed:
    """Read the quantities off a run.

    Args:
        result: A run, with two samples at least, and :data:`OBSERVED` among its outputs.
        last: The part of the run, counted from its end, that means are taken over, 0 < last <= 1.

    Raises:
        TypeError, ValueError: ``last`` breaks its rule; too few samples.
    """
    share = share_of_run("last", last)
    t = result.t
    if t.size < 2 or t[-1] <= t[0]:
        raise ValueError("the run must have samples at two times at least")
    params, omega = result.params, result.pulleys.omega
    radii = params._radii
    late = time_weights(t, t[-1] - share * (t[-1] - t[0]))
    tension = mid_span(params, result.belt, result.joints.force)
    forces = _per_pulley(result.contact.friction, result.contact.pulley, radii.size)
    lost = np.sum(result.contact.friction * result.contact.velocity, axis=1)
    power = np.column_stack([result.pulleys.torque * omega, lost])
    means = _time_mean(tension, late)
    rims = np.abs(omega * radii)
    speed = max(float(np.max(_time_mean(rims, late))), STANDSTILL_SPEED * float(np.max(rims)))
    turning = result._rims()
    assert turning is not None  # it is among OBSERVED
    creep = _creep(_time_mean(turning, late) * params._rolling, speed)
    overall = float(np.mean(_time_mean(result.joints.force, time_weights(t, t[0]))))
    force = float(np.max(np.abs(forces)))
    return Observed(
        t=t,
        tension=tension,
        speed=omega,
        span_mean=means,
        creep=creep,
        friction=_time_mean(forces, late),
        power=_time_mean(power, late),
        scales={
            "tension": abs(overall),
            "speed": float(np.max(np.abs(omega))),
            "span_mean": abs(overall),
            "creep": max(CREEP, float(np.max(np.abs(creep)))),
            "friction": max(force, MIN_FRICTION * abs(overall)) if params.has_friction else 0.0,
            "power": float(np.max(np.abs(power[:, :-1]))),
        },
    )


def differences(a: Observed, b: Observed, until: float | None = None) -> dict[str, float]:
    """Return how far two runs differ, by quantity, relative to the scales of ``b`` [1].

    Of histories, the root mean square over time and pulleys; of means, the largest difference of a
    pulley. A quantity that has no scale in either run, such as the speed of a belt at rest, has 0;
    one that could not be read off, such as the tension of a span that is gone, NaN.

    Args:
        a: A run.
        b: The other one, sampled at the same times; the more accurate of the two.
        until: Compare histories up to this time only [s].

    Raises:
        ValueError: They were sampled at different times, or have different numbers of pulleys.
    """
    if a.t.shape != b.t.shape or not np.allclose(a.t, b.t, rtol=0.0, atol=1e-9 * abs(b.t[-1])):
        raise ValueError("the runs must be sampled at the same times")
    if a.speed.shape != b.speed.shape:
        raise ValueError("the runs must have the same number of pulleys")
    weights = time_weights(b.t, b.t[0], math.inf if until is None else until)
    found = {}
    for name in QUANTITIES:
        apart = getattr(a, name) - getattr(b, name)
        if name in HISTORIES:
            size = math.sqrt(float(np.mean(_time_mean(apart**2, weights))))
        else:
            size = float(np.max(np.abs(apart)))
        scale = b.scales[name] or a.scales[name]
        found[name] = size / scale if scale > 0.0 else 0.0
    return found


def _time_mean(values: Array, weights: Array) -> Array:
    """Return the weighted mean over time, the first axis; samples of weight 0 do not count."""
    used = weights > 0.0
    return np.asarray(np.tensordot(weights[used], values[used], axes=(0, 0)))


def _creep(rims: Array, speed: float) -> Array:
    """Return the creep of each pulley relative to the fastest rim (n_p,) [1]."""
    if speed == 0.0:
        return np.zeros_like(rims)
    fastest = rims[np.argmax(np.abs(rims))]
    return np.asarray(np.abs(fastest - rims) / speed)  # none is faster, in the same direction


def _per_pulley(values: Array, touched: NDArray[np.int32], n_p: int) -> Array:
    """Add up values of links (n_t, n_b) by the pulley they touch (n_t, n_p)."""
    return np.column_stack(
        [np.sum(values, axis=1, where=touched == k, dtype=float) for k in range(n_p)]
    )
