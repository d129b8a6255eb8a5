"""Contact far too stiff and far too soft, bouncing, grazing, pressed by nothing."""

from __future__ import annotations

from functools import partial
from typing import Any

import attrs
import numpy as np

from ...drive.friction import Dahl
from ...drive.params import Params
from ...drive.parts import Belt, Contact, Pulley
from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from ...outputs.state import State
from ...run.settling import settle
from . import theory
from .drives import NOTHING, beside, pair, pulled, ramp
from .hard_scene import Entry, HardScene

__all__ = ["SCENES"]


def _thrown(scene: HardScene) -> State:
    """Throw both spans and the pulleys' wraps outwards, at 10 m/s."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vy=rest.vy + 10.0 * np.sign(rest.y))


def _round_a_pin() -> Params:
    """Round a pulley of 5 mm between two of 50 mm, by links of 10 mm."""
    return Params(
        belt=Belt(
            length=0.905, n_bodies=90, linear_density=0.1, axial_stiffness=50e3, axial_damping=2.0
        ),
        pulleys=[
            Pulley(center=(0.0, 0.0), radius=0.05, inertia=0.01),
            Pulley(center=(0.15, 0.05), radius=0.005, inertia=1e-4),
            Pulley(center=(0.3, 0.0), radius=0.05, inertia=0.01),
        ],
        contact=Contact(linear=2.5e7, damping=1e3),
        friction=Dahl(mu_k=1.0, sigma=1e4),
    )


def _moving(scene: HardScene, vx: float = 0.0, vy: float = 0.0) -> State:
    """Start with the whole belt at rest but for this velocity."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vx=rest.vx + vx, vy=rest.vy + vy)


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
        "Contact relaxes within 77 ns, and a touch at 0.1 m/s is a jump to thirty times the force "
        "at rest.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"contact.damping": 1.3e6}),
        theory=theory.statics,
    ),
    "contact-undamped": Entry(
        "Links that land on a contact without damping bounce for as long as the run lasts.",
        "The energy balance closes to 2 %.",
        lambda: Scene(_with(Contact(linear=1.67e9, compensate=True)), ramp(), 0.01),
        theory=theory.balance,
    ),
    "bouncing": Entry(
        "A belt thrown off its pulleys at 10 m/s comes down and bounces: contact begins and ends "
        "within steps, thousands of times.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(_with(Contact(linear=1.67e9, damping=1.3e3)), NOTHING, 0.02),
        start=_thrown,
        theory=theory.energy_falls,
    ),
    "bouncing-hunt-crossley": Entry(
        "The same with damping in proportion to the force, which has no jump but a steep slope.",
        "Nothing drives it: its energy falls.",
        lambda: Scene(_with(Contact(linear=1.67e9, hunt_crossley=1.0)), NOTHING, 0.02),
        start=_thrown,
        theory=theory.energy_falls,
    ),
    "grazing": Entry(
        "A span that swings by 3 mm on an idler that presses it by 0.3 mm: it touches at no more "
        "than a link, hardly, and leaves again.",
        "The energy balance closes to 2 %.",
        lambda: Scene(beside(3e-4, 0.12), NOTHING, 0.03),
        start=partial(_moving, vy=1.0),
        theory=theory.balance,
    ),
    "1-newton": Entry(
        "A belt of 1 N: its strain of 17 um/m is far below what the polygon of its links varies "
        "by as it turns.",
        "The energy balance closes to 2 %.",
        lambda: Scene(pair({"belt.preload": 1.0}), ramp(-0.02, 1e-4), 0.05),
        theory=theory.balance,
    ),
    "no-preload": Entry(
        "A belt of 0.1 N: the polygon of its links takes more length than there is strain, it "
        "comes to rest slack, and nothing presses it on its pulleys.",
        "The run ends before its first step, in an error that the belt has no tension.",
        lambda: Scene(pair({"belt.preload": 0.1}), ramp(-0.002, 1e-5), 0.05),
        expects="BD_ERR_NOT_SETTLED",
    ),
    "slack-span": Entry(
        "A step of the torque, half as much again as lets the slack span go: bars that push, "
        "links that fold.",
        "The energy balance closes to 2 %.",
        lambda: Scene(
            pair({"friction.mu_k": 2.0}),
            PiecewiseLinear([2e-3, 2e-3], [0.0, -50.0], 0),
            0.02,
        ),
        theory=theory.balance,
    ),
    "thrown-off": Entry(
        "A belt thrown past a pin of 5 mm, which links of twice its radius pass by: a run that "
        "goes on is one of another drive.",
        "The run ends in an error that names the pulley.",
        lambda: Scene(_round_a_pin(), NOTHING, 0.01),
        start=partial(_moving, vy=-40.0),
        expects="BD_ERR_OFF_PULLEY",
    ),
    "thrown-apart": Entry(
        "A belt thrown sideways at 930 m/s, faster than waves along it: links part, and numbers "
        "grow until they overflow.",
        "The run ends in an error that names the joint that gapes.",
        lambda: Scene(pair(), NOTHING, 0.01),
        start=partial(_moving, vx=-930.0),
        expects="BD_ERR_JOINT_GAP",
    ),
    "thrown-through": Entry(
        "A belt thrown at 200 m/s into a pulley of soft rubber comes out on its other side.",
        "The run ends in an error that names pulley and link.",
        lambda: Scene(_with(Contact(linear=1e6, damping=1e2)), NOTHING, 0.01),
        start=partial(_moving, vx=-200.0),
        expects="BD_ERR_PASSED_THROUGH",
    ),
}
