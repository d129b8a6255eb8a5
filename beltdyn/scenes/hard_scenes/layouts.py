"""Layouts with pulleys of very unequal size, crossed belts, idlers that only just touch."""

from __future__ import annotations

from ...drive.scene import Scene
from ...loads.loads import Load
from ...loads.torques import PiecewiseLinear
from ..machines import crossed_belt
from . import theory
from .drives import beside, pair, ramp
from .hard_scene import Entry

__all__ = ["SCENES"]


def _idler(depth: float) -> Scene:
    torque = PiecewiseLinear([0.0, 0.01], [0.0, -6.0], 0) + Load(2, viscous=0.1)
    return Scene(beside(depth), torque, 0.03)


SCENES: dict[str, Entry] = {
    "radii-1-to-20": Entry(
        "A pulley a twentieth of the other, on which two links lie: contact there and inertia "
        "here are four decades apart.",
        "The energy balance closes to 2 %.",
        lambda: Scene(
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
        theory=theory.balance,
    ),
    "crossed": Entry(
        "A crossed belt: pulleys turn against each other, and links that are near are not "
        "neighbours.",
        "The energy balance closes to 2 %.",
        lambda: crossed_belt()._replace(t_end=0.1),
        theory=theory.balance,
    ),
    "back-side": Entry(
        "An idler on the back of the belt bends it the other way: contact from both sides within "
        "a few links.",
        "The load on the idler is 2 T sin(theta / 2).",
        lambda: _idler(0.03),
        theory=theory.idler_load,
    ),
    "idler-that-just-touches": Entry(
        "An idler that presses the span by 1 mm, with a thirtieth of a link on its wrap: one joint "
        "bears the belt, for moments none, and lands with more than ten times the mean force.",
        "The energy balance closes to 2 %.",
        lambda: _idler(1e-3),
        theory=theory.balance,
    ),
}
