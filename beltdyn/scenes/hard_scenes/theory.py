"""Theory that runs of hard scenes are held to, each as the error over the error allowed.

What is allowed follows from the scene: the mesh's error where the theory is that of a belt, the
accuracy asked for in time where it is exact.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np

from ...drive.friction import Dahl
from ...drive.mounts import Arm
from ...loads.torques import PiecewiseLinear
from ...outputs.histories import EnergyLedger, MountHistory
from ...result.result import Result
from .drives import made
from .hard_scene import HardScene

#: Of the links of 15 mm on pulleys of 60 mm, 2.4 % of whose tension is the mesh's (print(params)).
MESH = 0.03


def _last(result: Result, share: float = 0.3) -> slice:
    """Return the samples of the last part of a run."""
    return slice(int((1.0 - share) * result.t.size), None)


def friction_limit(scene: HardScene, result: Result) -> float:
    """Check that friction is within the limit of its law, mu_s or mu_k, but for rounding."""
    law = scene.params.friction
    kinetic = float(np.sum(getattr(law, "mu_k", 0.0) or getattr(law, "mu", 0.0)))
    limit = max(kinetic, getattr(law, "mu_s", 0.0))
    return float(np.max(np.abs(result.contact.mu))) / (limit * (1.0 + 1e-9))


def free_spin_up(scene: HardScene, result: Result) -> float:
    """Check that pulley 0, which nothing holds, has the speed M t / I."""
    speed = result.pulleys.torque[:, 0] * result.t / scene.params.pulleys[0].inertia
    off = np.max(np.abs(result.pulleys.omega[:, 0] - speed))
    return float(off / (1e-8 * np.max(np.abs(speed))))


def at_rest(scene: HardScene, result: Result) -> float:
    """Check that speeds are below F / sqrt(EA rho A), F what is left of settling, 1e-6 of T."""
    belt = scene.params.belt
    speed = float(np.max(np.abs([result.belt.vx, result.belt.vy])))
    tension = float(np.mean(result.joints.force[0]))
    return speed / (1e-6 * tension / math.sqrt(belt.axial_stiffness * belt.linear_density))


def dahl_curve(scene: HardScene, result: Result) -> float:
    """Check that links which slip one way have mu_k (1 - exp(-sigma x / mu_k)), to 1e-3 mu_k."""
    law = cast(Dahl, scene.params.friction)
    mu, slip = np.abs(result.contact.mu), np.abs(result.contact.slip)
    curve = -law.mu_k * np.expm1(-law.sigma * slip / law.mu_k)
    # Not those at the ends of a wrap, on which contact begins and ends as the belt shifts.
    normal = result.contact.normal
    stays = np.all(normal > 0.5 * np.max(normal), axis=0)
    stays &= np.all(np.diff(slip, axis=0) >= 0.0, axis=0)
    return float(np.max(np.abs(mu - curve)[:, stays]) / (1e-3 * law.mu_k))


def statics(scene: HardScene, result: Result) -> float:
    """Check a belt between a locked pulley and one under a torque: T_1 - T_2 = M / R."""
    part = _last(result)
    tension = np.mean(result.span_tension[part], axis=0)
    torque = float(np.mean(result.pulleys.torque[part, 0]))
    pull = abs(torque) / scene.params.pulleys[0].radius
    return float(abs(abs(tension[0] - tension[1]) - pull) / (MESH * pull))


def capstan(scene: HardScene, result: Result) -> float:
    """Check ln(T_1 / T_2) = mu theta in full slip, of T - rho A v^2 where the belt runs."""
    part = _last(result)
    belt, law = scene.params.belt, cast(Dahl, scene.params.friction)
    v = np.mean(np.hypot(result.belt.vx[part], result.belt.vy[part]))
    tension = np.mean(result.span_tension[part], axis=0) - belt.linear_density * v * v
    full = law.mu_k * float(scene.params.route.wraps[0])
    return float(abs(abs(math.log(tension[0] / tension[1])) - full) / (MESH * full))


def symmetric(scene: HardScene, result: Result) -> float:
    """Check that equal torques on equal pulleys give equal speeds, to what rounding grows to."""
    omega = result.pulleys.omega
    return float(np.max(np.abs(omega[:, 0] - omega[:, 1])) / (1e-6 * np.max(np.abs(omega))))


def energy_falls(scene: HardScene, result: Result) -> float:
    """Check that energy which nothing drives never rises, to the 2 % from which a run warns."""
    total = cast(EnergyLedger, result.energy).total
    return float(np.max(total - np.minimum.accumulate(total)) / (2e-2 * total[0]))


def momentum(scene: HardScene, result: Result) -> float:
    """Check that pulleys and belt have a torque's impulse: J / R = sum of I omega / R + rho A L v.

    The polygon of links gives and takes some as it turns: 6 % with links of 15 mm, 0.2 % of 4 mm.
    """
    params, part = scene.params, _last(result)
    sense = float(params.info["winding"])
    along = np.cos(result.belt.phi) * result.belt.vx + np.sin(result.belt.phi) * result.belt.vy
    moving = params.info["link_mass"] * np.mean(np.sum(along[part], axis=1))
    radius = np.array([p.radius for p in params.pulleys])
    inertia = np.array([p.inertia for p in params.pulleys])
    turning = sense * np.mean(result.pulleys.omega[part] @ (inertia / radius))
    torque = cast(PiecewiseLinear, scene.torque_fn)
    given = sense * float(np.trapezoid(torque.values[:, 0], torque.t)) / radius[0]
    return float(abs(turning + moving - given) / (MESH * abs(given)))


def string_frequency(scene: HardScene, result: Result) -> float:
    """Check that a span at the speed v swings at (c^2 - v^2) / (2 L c), c = sqrt(T / rho A).

    From crossings of the upper span's middle through its mean. The error of the mesh is allowed
    twice, for tension and length.
    """
    belt, span = scene.params.belt, float(scene.params.route.spans[0])
    middle = 0.5 * (scene.params.pulleys[0].center[0] + scene.params.pulleys[1].center[0])
    above = [row > 0.0 for row in result.belt.y]
    height = np.array([
        np.interp(middle, np.sort(x[up]), y[up][np.argsort(x[up])])
        for x, y, up in zip(result.belt.x, result.belt.y, above, strict=True)
    ])  # fmt: skip
    swing = height - np.mean(height)
    up = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    times = result.t[up] - swing[up] * np.diff(result.t)[up] / (swing[up + 1] - swing[up])
    seen = (times.size - 1) / (times[-1] - times[0])
    v = float(np.mean(np.hypot(result.belt.vx, result.belt.vy)))
    wave = math.sqrt(float(np.mean(result.span_tension[:, 0])) / belt.linear_density)
    own = (wave * wave - v * v) / (2.0 * span * wave)
    return float(abs(seen / own - 1.0) / (2.0 * MESH))


def centrifugal(scene: HardScene, result: Result) -> float:
    """Check that a running belt presses with (T - rho A v^2) / R per length."""
    part, belt = _last(result, 0.5), scene.params.belt
    v = abs(float(np.mean(result.pulleys.omega[part, 0]))) * scene.params.pulleys[0].radius
    on = result.contact.pulley[part] == 0
    pressed = float(np.mean(np.sum(np.where(on, result.contact.normal[part], 0.0), axis=1)))
    wrap = float(scene.params.route.wraps[0])
    tension = float(np.mean(result.span_tension[part]))
    left = (tension - belt.linear_density * v * v) * wrap
    return abs(pressed - left) / (MESH * tension * wrap)


def held_by_drag(scene: HardScene, result: Result) -> float:
    """Check that a torque below dry drag moves a pulley by its creep alone, some drag_speed."""
    half = result.t.size // 2
    turned = result.pulleys.theta[-1, 1] - result.pulleys.theta[half, 1]
    speed = scene.params.pulleys[1].radius * abs(turned) / (result.t[-1] - result.t[half])
    return float(speed / (10.0 * scene.params.info["drag_speed"]))


def idler_load(scene: HardScene, result: Result) -> float:
    """Check that the belt loads pulley 1, which it turns round, with 2 T sin(theta / 2)."""
    part = _last(result, 0.5)
    load = np.hypot(*np.mean(result.pulleys.load[part, 1], axis=0))
    tension = float(np.mean(result.span_tension[part, :2]))
    due = 2.0 * tension * math.sin(0.5 * float(scene.params.route.wraps[1]))
    return float(abs(load - due) / (MESH * due))


def rebound(scene: HardScene, result: Result) -> float:
    """Check that an arm leaves a stop without damping as fast as it came.

    To 5 %: samples are farther apart than the blow lasts, and the belt changes the arm's speed by
    2 % between two.
    """
    mounts = cast(MountHistory, result.mounts)
    speed, travel = mounts.travel_speed[:, 0], mounts.travel[:, 0]
    arm = cast(Arm, next(p.mount for p in scene.params.pulleys if p.mount is not None))
    near = np.abs(travel) > 0.9 * cast(tuple[float, float], arm.stops)[1]
    turns = np.flatnonzero(near[2:-1] & (speed[2:-1] * speed[3:] < 0.0))
    if turns.size == 0:
        return math.inf
    came, left = (np.max(np.abs(speed[k : k + 3])) for k in (turns[0], turns[0] + 3))
    return float(abs(left / came - 1.0) / 0.05)


def balance(scene: HardScene, result: Result) -> float:
    """Check that the energy balance closes, to the 2 % from which a run warns."""
    return abs(result.stats.balance) / 2e-2


def as_in_metres(scene: HardScene, result: Result) -> float:
    """Compare with the forces in metres, to ten times what both were asked."""
    plain = made({"like": "in_metres"})
    size = scene.params.pulleys[0].radius / plain.params.pulleys[0].radius
    metres = scene._replace(**plain._asdict()).run(result.stats.method, rtol=1e-5)
    off = result.joints.force / size - metres.joints.force
    return float(np.sqrt(np.mean(off**2)) / (1e-3 * np.mean(metres.joints.force)))


def dragged(scene: HardScene, result: Result) -> float:
    """Compare the drag of pulley 1 with the difference of the tensions, over the last third."""
    part, pulley = slice(-result.t.size // 3, None), scene.params.pulleys[1]
    drag = pulley.drag.viscous * np.mean(result.pulleys.omega[part, 1])  # type: ignore[union-attr]
    tension = np.mean(result.span_tension[part], axis=0)
    pull = abs(float(drag)) / pulley.radius
    return float(abs(abs(tension[0] - tension[1]) - pull) / (MESH * pull))
