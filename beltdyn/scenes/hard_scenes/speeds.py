"""Fast, for long, near the speeds at which a belt lifts off or loses its stiffness."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import attrs
import numpy as np

from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from ...outputs.state import State
from ...run.settling import settle
from .drives import NOTHING, pair, ramp
from .hard_scene import HardScene

__all__ = ["MAKE", "START"]


#: Links so short that those which land do not shake the belt.
_FINE = {"belt.n_bodies": 160}


def _running(scene: HardScene) -> State:
    """Steadily at the speed at which the motion of pulley 0 begins."""
    return settle(scene.params, speed={0: float(scene.motion[0].values[0, 0])})  # type: ignore[index, union-attr]


def _driven(omega: list[float], t: list[float], changes: Mapping[str, object]) -> Scene:
    """With pulley 0 at speeds over time [rad/s]."""
    return Scene(pair(changes), NOTHING, t[-1], {0: PiecewiseLinear(t, [-w for w in omega])})


def _plucked(scene: HardScene) -> State:
    """Let the upper span of the running belt move as its first mode, by 2 m/s in the middle."""
    state = _running(scene)
    span = scene.params.pulleys[1].center[0]
    mode = np.sin(np.pi * np.clip(state.x / span, 0.0, 1.0)) * (state.y > 0.0)
    return attrs.evolve(state, vy=state.vy + 2.0 * mode)


def _whipped(scene: HardScene) -> State:
    """Tear the upper span upwards at 60 m/s in the middle, faster than waves across it."""
    rest = settle(scene.params)
    span = scene.params.pulleys[1].center[0]
    mode = np.sin(np.pi * np.clip(rest.x / span, 0.0, 1.0)) * (rest.y > 0.0)
    return attrs.evolve(rest, vy=rest.vy + 60.0 * mode)


MAKE: dict[str, Callable[[], Scene]] = {
    "10000-rpm": lambda: _driven([1047.2, 1047.2], [0.0, 0.02], {"belt.preload": 600.0, **_FINE}),
    "lift-off": lambda: _driven([838.0, 1257.0], [0.0, 0.05], _FINE),
    "critical-speed": lambda: _driven([885.0, 885.0], [0.0, 0.02], _FINE),
    "moving-string": lambda: _driven([548.0, 548.0], [0.0, 0.1], _FINE),
    "whip": lambda: Scene(pair({"belt.preload": 20.0}), NOTHING, 0.02),
    "5000-turns": lambda: Scene(
        pair(
            {
                "belt.n_bodies": 24,
                "belt.axial_damping": 20.0,
                "contact.linear": 1.5e7,
                "contact.damping": 2.5e3,
                "pulleys[1].center": (0.15, 0.0),
                "pulleys[*].radius": 0.02,
                "pulleys[*].inertia": 2e-4,
            }
        ),
        ramp(-2.0, 2.0 / 300.0, 1.0),
        115.0,
    ),
}

START: dict[str, Callable[[HardScene], State]] = {
    "10000-rpm": _running,
    "lift-off": _running,
    "critical-speed": _running,
    "moving-string": _plucked,
    "whip": _whipped,
}
