"""Motions that grow without oscillating, or hardly oscillating.

The search for modes (:mod:`.eigenvalues`) sees what lies round the imaginary axis, growing or
decaying. What lies nearer to the positive real axis than some 12 degrees it does not see. Searched
for that are discs round real shifts s of the radius 0.9 s, between them all that lies within 64
degrees of the axis, from the slowest rate of the band to its end. Friction, contact and dampers, of
which the clusters of eigenvalues are made, lie at 0 and on the other side.
"""

from __future__ import annotations

import numpy as np

from .eigenvalues import SAME, Found, disc
from .linearised import Linear
from .participation import steady_share
from .turning import rigid_rates, without_turning

#: Of a disc, against its centre; the next centre against the last, which overlap; share of the
#: energy in the mean over phases of the mesh, as of modes.
RADIUS, NEXT, STEADY = 0.9, 12.0, 0.5


def growing(
    linear: Linear, band: tuple[float, float], found: Found
) -> tuple[Found, complex | None, bool]:
    """Find what grows, its turning on the mesh aside, of rates within a band [1/s].

    Returns eigenvalues with a real part > 0 and an imaginary part >= 0 that are not in ``found``,
    fastest first; that of the drive turning as a whole if nothing but the mesh makes it grow (see
    :func:`.turning.without_turning`); and whether all have converged.
    """
    shift, done = max(band[0], 1e-6 * band[1]) / (1.0 - RADIUS), True
    values, vectors = np.empty(0, complex), np.empty((linear.size, 0), complex)
    while True:
        more, converged = disc(linear, complex(shift), RADIUS * shift)
        done &= converged
        for k, value in enumerate(more.values):
            near = SAME * abs(value)
            known = (abs(np.append(values, found.values) - value) < near).any()
            if value.imag > -near and not known:
                values = np.append(values, value.real if abs(value.imag) < near else value)
                vectors = np.hstack([vectors, more.vectors[:, [k]]])
        if shift * (1.0 + RADIUS) > band[1]:
            break
        shift *= NEXT
    grows = Found(values, vectors).of(steady_share(linear, vectors) > STEADY)
    grows = grows.of(np.argsort(-grows.values.real))
    turning = None
    if min(rigid_rates(linear)) >= 0.0:
        grows, turning = without_turning(linear, grows)
    return grows, turning, done
