"""Layouts with pulleys of very unequal size, crossed belts, idlers that only just touch."""

from __future__ import annotations

from collections.abc import Callable

from ...drive.scene import Scene
from ...loads.loads import Load
from ...loads.torques import PiecewiseLinear
from ..machines import crossed_belt
from .drives import beside, pair, ramp

__all__ = ["MAKE"]


def _idler(depth: float) -> Scene:
    torque = PiecewiseLinear([0.0, 0.01], [0.0, -6.0], 0) + Load(2, viscous=0.1)
    return Scene(beside(depth), torque, 0.03)


MAKE: dict[str, Callable[[], Scene]] = {
    "radii-1-to-20": lambda: Scene(
        pair(
            {
                "belt.n_bodies": 150,
                "pulleys[0].radius": 0.01,
                "pulleys[0].inertia": 2e-6,
                "pulleys[1].center": (0.3, 0.0),
                "pulleys[1].radius": 0.2,
                "pulleys[1].inertia": 0.2,
            }
        ),
        ramp(-0.5, 0.1),
        0.05,
    ),
    "crossed": lambda: crossed_belt()._replace(t_end=0.1),
    "back-side": lambda: _idler(0.03),
    "idler-that-just-touches": lambda: _idler(1e-3),
}
