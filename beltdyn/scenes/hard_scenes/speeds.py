"""Fast, for long, near the speeds at which a belt lifts off or loses its stiffness."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np

from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from ...outputs.state import State
from ...run.settling import settle
from . import theory
from .drives import NOTHING, pair, ramp
from .hard_scene import Entry, HardScene

__all__ = ["SCENES"]


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


SCENES: dict[str, Entry] = {
    "10000-rpm": Entry(
        "10 000 1/min on 120 mm, 63 m/s: rho A v^2 is 395 of 600 N, links land every 90 us.",
        "The belt presses on its pulleys with (T - rho A v^2) / R.",
        lambda: _driven([1047.2, 1047.2], [0.0, 0.02], {"belt.preload": 600.0, **_FINE}),
        start=_running,
        theory=theory.centrifugal,
    ),
    "lift-off": Entry(
        "From 8000 to 12 000 1/min the belt all but lifts off: from 54.8 m/s on rho A v^2 exceeds "
        "the 300 N at rest, a stretch of 50 N more holds it, and links lose contact in the wraps.",
        "The energy balance closes to 2 %, whether they touch or not.",
        lambda: _driven([838.0, 1257.0], [0.0, 0.05], _FINE),
        start=_running,
        theory=theory.balance,
    ),
    "critical-speed": Entry(
        "At 53 m/s, 93 % of the speed of waves across it, a span has hardly any stiffness.",
        "The belt presses on its pulleys with (T - rho A v^2) / R.",
        lambda: _driven([885.0, 885.0], [0.0, 0.02], _FINE),
        start=_running,
        theory=theory.centrifugal,
    ),
    "moving-string": Entry(
        "A span that moves at six tenths of the speed of its waves swings on without damping: "
        "methods that damp take the swing away, centrifugal and Coriolis terms set its pitch.",
        "Its frequency is (c^2 - v^2) / (2 L c).",
        lambda: _driven([548.0, 548.0], [0.0, 0.1], _FINE),
        start=_plucked,
        theory=theory.string_frequency,
    ),
    "whip": Entry(
        "A span of 20 N, torn upwards faster than its waves, whips: links turn by right angles "
        "within a step.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(pair({"belt.preload": 20.0}), NOTHING, 0.02),
        start=_whipped,
        theory=theory.energy_falls,
    ),
    "5000-turns": Entry(
        "5000 turns of the pulleys: 70 000 links land, errors of each add up.",
        "The energy balance closes to 2 %.",
        lambda: Scene(
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
        options={"rtol": 0.01},
        theory=theory.balance,
    ),
}
