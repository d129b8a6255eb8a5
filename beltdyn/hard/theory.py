"""Theory that runs of hard scenes are held to, each as the error over the error allowed.

What is allowed follows from the scene: the mesh's error where the theory is that of a belt, the
accuracy asked for in time where it is exact.
"""

from __future__ import annotations

import math

import numpy as np

from ..checks import Array
from ..result import Result
from .hard_scene import HardScene

__all__ = ["at_rest", "dahl_curve", "free_spin_up", "friction_limit"]


def friction_limit(scene: HardScene, result: Result) -> float:
    """Friction stays within the limit of its law, |mu| <= mu_s or mu_k, but for rounding."""
    law = scene.params.friction
    kinetic = np.sum(getattr(law, "mu_k", 0.0) or getattr(law, "mu", 0.0))
    limit = max(float(kinetic), getattr(law, "mu_s", 0.0))
    return float(np.max(np.abs(result.contact.mu))) / (limit * (1.0 + 1e-9))


def free_spin_up(scene: HardScene, result: Result) -> float:
    """Pulley 0, which nothing holds, has the speed M t / I of its constant torque."""
    torque, inertia = result.pulleys.torque[:, 0], scene.params.pulleys[0].inertia
    speed = torque * result.t / inertia
    return float(np.max(np.abs(result.pulleys.omega[:, 0] - speed)) / (1e-8 * np.max(np.abs(speed))))


def at_rest(scene: HardScene, result: Result) -> float:
    """Nothing moves: what is left of settling, to 1e-9 of the tension, is all there is.

    A force F unbalanced swings a belt of the impedance sqrt(EA rho) at F over it.
    """
    belt = scene.params.belt
    speed = float(np.max(np.abs([result.belt.vx, result.belt.vy])))
    tension = float(np.mean(result.joints.force[0]))
    return speed / (1e-6 * tension / math.sqrt(belt.axial_stiffness * belt.linear_density))


def dahl_curve(scene: HardScene, result: Result) -> float:
    """Links that have slipped one way since contact began have mu_k (1 - exp(-sigma x / mu_k))."""
    law = scene.params.friction
    mu, slip = np.abs(result.contact.mu), result.contact.slip
    curve = -law.mu_k * np.expm1(-law.sigma * np.abs(slip) / law.mu_k)  # type: ignore[union-attr]
    grows = np.all(np.diff(np.abs(slip), axis=0) >= 0.0, axis=0)
    seen: Array = np.abs(mu - curve)[:, grows]
    return float(np.max(seen)) / (1e-3 * law.mu_k)  # type: ignore[union-attr]
