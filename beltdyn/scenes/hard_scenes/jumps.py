"""Loads that jump, strike, shake and lock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...drive.parts import Drag
from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from .drives import LOCKED, pair, pulled, ramp

__all__ = ["MAKE"]


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


MAKE: dict[str, Callable[[], Scene]] = {
    "torque-step": _step,
    "impulse": _impulse,
    "noise": _noise,
    "reversal-in-full-slip": _reversal,
    "dry-drag": lambda: Scene(pair({"pulleys[1].drag": Drag(coulomb=12.0)}), ramp(-6.0, 0.0), 0.1),
    "locked-pulley": lambda: pulled(-25.0),
    "full-slip": lambda: Scene(
        pair(), PiecewiseLinear([0.0, 0.01], [0.0, -50.0], 0), 0.05, {1: LOCKED}
    ),
}
