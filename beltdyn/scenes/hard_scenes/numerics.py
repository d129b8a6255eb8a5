"""Starts, steps, durations and units that are out of proportion."""

from __future__ import annotations

import attrs
import numpy as np

from ...drive.parts import Drag
from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from ...outputs.state import State
from ...result.result import Result
from ...run.settling import settle
from . import theory
from .drives import NOTHING, pair, ramp, scaled
from .hard_scene import Entry, HardScene

__all__ = ["SCENES"]


def _pulling(changes: dict[str, object] | None = None) -> Scene:
    torque = PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-6.0, 3.0]])
    return Scene(pair(changes), torque, 0.02)


def _as_in_metres(scene: HardScene, result: Result) -> float:
    """Compare with the forces in metres, to ten times what both were asked."""
    size = scene.params.pulleys[0].radius / pair().pulleys[0].radius
    metres = scene._replace(**_pulling()._asdict()).run(result.stats.method, rtol=1e-5)
    off = result.joints.force / size - metres.joints.force
    return float(np.sqrt(np.mean(off**2)) / (1e-3 * np.mean(metres.joints.force)))


def _pulleys_turning(scene: HardScene) -> State:
    """At rest, but pulley 0 already turns, by 200 rad/s."""
    return attrs.evolve(settle(scene.params), omega=np.array([-200.0, 0.0]))


def _pushed_in(scene: HardScene) -> State:
    """Put every third link off its place by 0.3 mm along y, which joints resist by 1.2 kN."""
    rest = settle(scene.params)
    off = 3e-4 * (np.arange(rest.n_bodies) % 3 == 0)
    return attrs.evolve(rest, y=rest.y + off * np.sign(rest.y))


def _dragged(scene: HardScene, result: Result) -> float:
    """Compare the drag of pulley 1 with the difference of the tensions, over the last third."""
    part, pulley = slice(-result.t.size // 3, None), scene.params.pulleys[1]
    drag = pulley.drag.viscous * np.mean(result.pulleys.omega[part, 1])  # type: ignore[union-attr]
    tension = np.mean(result.span_tension[part], axis=0)
    pull = abs(float(drag)) / pulley.radius
    return float(abs(abs(tension[0] - tension[1]) - pull) / (theory.MESH * pull))


SCENES: dict[str, Entry] = {
    "start-with-pulley-turning": Entry(
        "Pulley 0 turns at 200 rad/s under a belt at rest: slip of 12 m/s with friction that is "
        "not developed.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(pair(), NOTHING, 0.03),
        start=_pulleys_turning,
        theory=theory.energy_falls,
    ),
    "start-out-of-place": Entry(
        "Every third link begins 0.3 mm off its place: forces of twenty times the tension from the "
        "first step on.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(pair(), NOTHING, 0.02),
        start=_pushed_in,
        theory=theory.energy_falls,
    ),
    "huge-steps": Entry(
        "A step of 4 ms, four rounds of a wave, the first one where steps adapt, else all: an "
        "explicit method leaves the range of numbers, an implicit one may settle on anything.",
        "The energy balance closes to 2 %, or the run ends and says that its steps are too long.",
        lambda: Scene(pair(), ramp(), 0.1),
        options={"step": 4e-3},
        theory=theory.balance,
    ),
    "an-hour": Entry(
        "3600 s at low accuracy, in which a stretch wave runs three million times round the belt: "
        "rounding and errors add up.",
        "The spans carry the torque of the drag, T_1 - T_2 = M / R.",
        lambda: Scene(
            pair({"pulleys[*].drag": Drag(viscous=50.0)}),
            PiecewiseLinear([0.0, 1800.0], [0.0, -6.0], 0),
            3600.0,
        ),
        options={"rtol": 0.03},
        theory=_dragged,
    ),
    "in-micrometres": Entry(
        "Lengths as numbers of micrometres, 6e4 for a radius, stiffnesses of 1e-3: absolute "
        "tolerances, paddings, thresholds.",
        "All forces are those in metres.",
        lambda: scaled(_pulling(), 1e6),
        theory=_as_in_metres,
    ),
    "in-kilometres": Entry(
        "Lengths as numbers of kilometres, 6e-5 for a radius, stiffnesses of 1e12: absolute "
        "tolerances, paddings, thresholds.",
        "All forces are those in metres.",
        lambda: scaled(_pulling(), 1e-3),
        theory=_as_in_metres,
    ),
}
