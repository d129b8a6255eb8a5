"""Contact far too stiff and far too soft, bouncing, grazing, pressed by nothing."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from ..params import Params
from ..parts import Contact
from ..scene import Scene
from ..settling import settle
from ..state import State
from ..torques import PiecewiseLinear
from . import theory
from .drives import NOTHING, pair, pulled, ramp
from .hard_scene import Entry, HardScene

__all__ = ["SCENES"]


def _thrown(share: float) -> Any:
    """Links of both spans thrown outwards, at a share of the speed of waves along the belt."""

    def start(scene: HardScene) -> State:
        rest = settle(scene.params)
        belt = scene.params.belt
        v = share * np.sqrt(belt.axial_stiffness / belt.linear_density)
        return attrs.evolve(rest, vy=rest.vy + v * np.sign(rest.y))

    return start


def _with(contact: Contact, changes: dict[str, Any] | None = None) -> Params:
    return attrs.evolve(pair(changes), contact=contact)


SCENES: dict[str, Entry] = {
    "contact-x1e4": Entry(
        "Contact vibrates at 2 MHz, a hundred times as fast as the belt's joints.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"contact.linear": 1.67e13}),
        theory=theory.statics,
    ),
    "contact-x1e-3": Entry(
        "The belt sinks into its pulleys by 3 mm, a twentieth of their radius, and farther on the "
        "tight side: friction works on a radius of its own.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"contact.linear": 1.67e6, "contact.damping": 4e2}),
        theory=theory.statics,
    ),
    "contact-damping-x100": Entry(
        "Contact relaxes within 76 ns of a touch, and pulls the force in a jump to thirty times "
        "that at rest.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"contact.damping": 1.3e6}),
        theory=theory.statics,
    ),
    "contact-undamped": Entry(
        "Links that land on a contact without damping bounce for as long as the run lasts.",
        "The energy balance closes to 1 %.",
        lambda: Scene(_with(Contact(linear=1.67e9, compensate=True)), ramp(), 0.01),
        theory=theory.balance,
    ),
    "bouncing": Entry(
        "A belt thrown off its pulleys at 10 m/s comes down and bounces: contact begins and ends "
        "within steps, thousands of times.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(_with(Contact(linear=1.67e9, damping=1.3e3)), NOTHING, 0.02),
        start=_thrown(0.013),
        theory=theory.energy_falls,
    ),
    "bouncing-hunt-crossley": Entry(
        "The same with damping in proportion to the force, which has no jump but a steep slope.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(_with(Contact(linear=1.67e9, hunt_crossley=1.0)), NOTHING, 0.02),
        start=_thrown(0.013),
        theory=theory.energy_falls,
    ),
    "no-preload": Entry(
        "A belt of 0.1 N all but falls off: a gram of inertia is more than its tension.",
        "The energy balance closes to 1 %.",
        lambda: Scene(pair({"belt.preload": 0.1}), ramp(-0.01, 1e-3), 0.05),
        theory=theory.balance,
    ),
    "slack-span": Entry(
        "A step of the torque, half as much again as lets the slack span go: bars that push, "
        "links that fold.",
        "The energy balance closes to 1 %.",
        lambda: Scene(
            pair({"friction.mu_k": 2.0}),
            PiecewiseLinear([2e-3, 2e-3], [0.0, -50.0], 0),
            0.02,
        ),
        theory=theory.balance,
    ),
    "thrown-off": Entry(
        "A belt thrown sideways at 300 m/s leaves its pulleys: positions without meaning, or "
        "numbers that overflow.",
        "The run ends in an error that names the joint which gapes.",
        lambda: Scene(pair(), NOTHING, 0.02),
        start=_thrown(0.5),
        expects="BD_ERR_OFF_PULLEY",
    ),
}
