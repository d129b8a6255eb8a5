"""The whole drive turning: belt along itself, rims with it, axes at rest.

Where no torque depends on angles nothing resists that, so its frequency is 0. A belt of links makes
of it what its polygon on the pulleys resists, which is no property of the drive; one of cells rolls
on the bristles of friction at the ends of its wraps, which give way as it goes on.
"""

from __future__ import annotations

import numpy as np

from ..base.checks import Array
from ..outputs.state import SPEEDS
from .eigenvalues import Found, first_rate
from .linearised import Complex, Linear
from .participation import weighted

#: Share of a mode's kinetic energy in the drive turning as a whole, from which on it is that.
WHOLE = 0.9
#: Rate at which a stiffness is taken for static, against the spans' lowest; and how much of the
#: force may there be out of phase.
SLOW, LOSSY = 1e-4, 0.1


def rigid_turning(linear: Linear) -> Array:
    """Return the unknowns (size,) as the drive turns with the belt at 1 m/s, displaced by 1 m."""
    core, params = linear.state, linear.params
    turns = 1.0 / params._rolling
    way = {"theta": turns, "omega": turns, "rim_speed": turns[list(params.coupled)]}
    if params._flows:
        way["v"] = np.ones(np.size(core["v"]))
        way["along_speed"] = np.full(np.size(core["along"]), 4.0 / np.pi)  # 1 as a series of sines
        return np.asarray(linear.filled(way))
    dx, dy = (np.roll(core[name], -1) - np.roll(core[name], 1) for name in ("x", "y"))
    bend = np.roll(core["phi"], -1) - np.roll(core["phi"], 1)
    bend = (bend + np.pi) % (2.0 * np.pi) - np.pi
    chord = np.hypot(dx, dy)
    belt = {"x": dx / chord, "y": dy / chord}
    belt["phi"] = bend / (2.0 * float(params.info["link_length"]))
    way |= belt | {f"v{name}": values for name, values in belt.items()}
    return np.asarray(linear.filled(way))


def rigid_share(linear: Linear, vectors: Complex) -> Array:
    """Share of the kinetic energy of modes (n,) that is the drive's turning as a whole."""
    own = weighted(linear, rigid_turning(linear)[:, None].astype(complex))[:, 0]
    modes = weighted(linear, vectors)
    energy = np.sum(abs(modes) ** 2, axis=0) * np.sum(abs(own) ** 2)
    return np.asarray(abs(own @ modes) ** 2 / np.maximum(energy, 1e-300))


def rigid_rates(linear: Linear) -> tuple[float, float]:
    """Return stiffness [1/s^2] and damping [1/s] of set torques against turning, over inertia."""
    if linear.torque_slopes is None:
        return 0.0, 0.0
    params = linear.params
    one = rigid_turning(linear)[:, None].astype(complex)
    inertia = float(np.sum(abs(weighted(linear, one)) ** 2))
    turns = 1.0 / params._rolling
    by_angle, by_speed = (-float(turns @ slope @ turns) for slope in linear.torque_slopes)
    return by_angle / inertia, by_speed / inertia


def without_turning(linear: Linear, found: Found) -> tuple[Found, complex | None]:
    """Split modes into all others and the drive's turning as a whole, None: it is not there.

    It is the one that has most of the turning, at least 0.9 of its energy; none where a pulley's
    motion is prescribed, and none where set torques make more than half of its stiffness.
    """
    if linear.prescribed or not found.values.size:
        return found, None
    share = rigid_share(linear, found.vectors)
    k = int(np.argmax(share))
    value = complex(found.values[k])
    if share[k] < WHOLE or rigid_rates(linear)[0] > 0.5 * abs(value) ** 2:
        return found, None
    return found.of(np.arange(share.size) != k), value


def mesh_stiffness(linear: Linear) -> tuple[Array, Array, float] | None:
    """Return the mesh's stiffness against turning as a rank-one term to add to J, None if unknown.

    With M the masses and t the turning, K - k (M t)(M t)^T / (t^T M t) has a free turning for the k
    that is given, 1 over the static displacement along t by a force M t / (t^T M t), less what set
    torques make of it: J + k ``by`` ``on``^T is the drive without.
    """
    turn = rigid_turning(linear)
    fast = np.isin(linear.names, SPEEDS)
    by = np.where(fast, turn, 0.0)
    places = {"x": "vx", "y": "vy", "phi": "vphi", "theta": "omega"}
    carried = linear.filled({place: linear.masses[speed] for place, speed in places.items()})
    on = np.where(fast, 0.0, turn * carried)
    on /= on @ turn
    rate = SLOW * first_rate(linear.params)
    size, _, solve = linear.solver(rate)
    moved = complex((on * size) @ solve(by / size, 2))
    if abs(moved.imag) > LOSSY * abs(moved.real):
        return None
    return by, on, 1.0 / moved.real + rate**2 - rigid_rates(linear)[0]
