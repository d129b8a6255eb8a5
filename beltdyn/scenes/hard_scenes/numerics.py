"""Starts, steps, durations and units that are out of proportion."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from ...drive.parts import Drag
from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from ...outputs.state import State
from ...run.settling import settle
from .drives import NOTHING, pair, ramp, scaled
from .hard_scene import HardScene

__all__ = ["MAKE", "START", "pulling"]


def pulling(changes: dict[str, object] | None = None) -> Scene:
    """Pull with 6 N m on pulley 0 against 3 N m on pulley 1."""
    torque = PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-6.0, 3.0]])
    return Scene(pair(changes), torque, 0.02)


def _pulleys_turning(scene: HardScene) -> State:
    """At rest, but pulley 0 already turns, by 200 rad/s."""
    return attrs.evolve(settle(scene.params), omega=np.array([-200.0, 0.0]))


def _pushed_in(scene: HardScene) -> State:
    """Put every third link off its place by 0.3 mm along y, which joints resist by 1.2 kN."""
    rest = settle(scene.params)
    off = 3e-4 * (np.arange(rest.n_bodies) % 3 == 0)
    return attrs.evolve(rest, y=rest.y + off * np.sign(rest.y))


MAKE: dict[str, Callable[[], Scene]] = {
    "start-with-pulley-turning": lambda: Scene(pair(), NOTHING, 0.03),
    "start-out-of-place": lambda: Scene(pair(), NOTHING, 0.02),
    "huge-steps": lambda: Scene(pair(), ramp(), 0.1),
    "an-hour": lambda: Scene(
        pair({"pulleys[*].drag": Drag(viscous=50.0)}),
        PiecewiseLinear([0.0, 1800.0], [0.0, -6.0], 0),
        3600.0,
    ),
    "in-micrometres": lambda: scaled(pulling(), 1e6),
    "in-kilometres": lambda: scaled(pulling(), 1e-3),
}

START: dict[str, Callable[[HardScene], State]] = {
    "start-with-pulley-turning": _pulleys_turning,
    "start-out-of-place": _pushed_in,
}
