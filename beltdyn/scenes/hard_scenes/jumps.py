"""Loads that jump, strike, shake and lock."""

from __future__ import annotations

import numpy as np

from ...drive.parts import Drag
from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from . import theory
from .drives import LOCKED, pair, pulled, ramp
from .hard_scene import Entry

__all__ = ["SCENES"]


def _step() -> Scene:
    """Both pulleys in the same sense, so that each half of the drive is the other, turned."""
    values = [[0.0, 0.0], [-20.0, -20.0]]
    return Scene(pair(), PiecewiseLinear([1e-3, 1e-3], values), 0.02)


def _impulse() -> Scene:
    """20 mN m s within 1 us."""
    t = [1e-3, 1e-3, 1.001e-3, 1.001e-3]
    return Scene(pair({"belt.n_bodies": 240}), PiecewiseLinear(t, [0.0, -2e4, -2e4, 0.0], 0), 0.03)


def _noise() -> Scene:
    """Set a torque that jumps anywhere within 20 N m every 10 us."""
    values = np.random.default_rng(26).uniform(-20.0, 20.0, 1000)
    t = 1e-5 * np.arange(1001)
    return Scene(pair(), PiecewiseLinear(np.repeat(t, 2)[1:-1], np.repeat(values, 2), 0), 0.01)


def _reversal() -> Scene:
    """Twice what friction can transmit, one way, and at once the other way."""
    t = [5e-3, 5e-3, 0.02, 0.02]
    return Scene(pair(), PiecewiseLinear(t, [0.0, -60.0, -60.0, 60.0], 0) + ramp(0.0, 0.1), 0.04)


SCENES: dict[str, Entry] = {
    "torque-step": Entry(
        "A torque of two thirds of full slip within no time: a front that every method of order "
        "above 1 rings at.",
        "Equal torques on equal pulleys give equal speeds.",
        _step,
        theory=theory.symmetric,
    ),
    "impulse": Entry(
        "A blow of 20 kN m for 1 us: steps that grow in the calm before it pass it by.",
        "Pulleys and belt have the momentum of the blow.",
        _impulse,
        theory=theory.momentum,
    ),
    "noise": Entry(
        "A torque that jumps every 10 us: no two steps see the same, error estimates are noise.",
        "Friction stays within its limit, |mu| <= mu_k.",
        _noise,
        theory=theory.friction_limit,
    ),
    "reversal-in-full-slip": Entry(
        "The torque turns over while a pulley slips in full: all links of a wrap pass v_T = 0, "
        "one after the other, within microseconds.",
        "Friction stays within its limit, |mu| <= mu_k.",
        _reversal,
        theory=theory.friction_limit,
    ),
    "dry-drag": Entry(
        "Dry drag of 12 N m at standstill under a torque of 6: a sign of the speed that rounding "
        "decides, or a pulley that creeps away.",
        "The pulley stands, but for the creep of its smooth sign.",
        lambda: Scene(pair({"pulleys[1].drag": Drag(coulomb=12.0)}), ramp(-6.0, 0.0), 0.1),
        theory=theory.held_by_drag,
    ),
    "locked-pulley": Entry(
        "A locked pulley and one with a torque that friction just holds: a belt that sticks at "
        "full friction, on the way to slip.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-25.0),
        theory=theory.statics,
    ),
    "full-slip": Entry(
        "One pulley is locked, the other races at twice the torque that friction transmits: "
        "friction at its limit all round, and slip velocities of 26 m/s.",
        "ln(T_1 / T_2) = mu_k theta, to the error of the mesh.",
        lambda: Scene(pair(), PiecewiseLinear([0.0, 0.01], [0.0, -50.0], 0), 0.05, {1: LOCKED}),
        theory=theory.capstan,
    ),
}
