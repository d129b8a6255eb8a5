"""Contact far too stiff and far too soft, bouncing, grazing, pressed by nothing."""

from __future__ import annotations

from collections.abc import Callable
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
from .drives import NOTHING, beside, pair, pulled, ramp
from .hard_scene import HardScene

__all__ = ["MAKE", "START"]


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


MAKE: dict[str, Callable[[], Scene]] = {
    "contact-x1e4": lambda: pulled(-6.0, {"contact.linear": 1.67e13}),
    "contact-x1e-3": lambda: pulled(-6.0, {"contact.linear": 1.67e6, "contact.damping": 4e2}),
    "contact-damping-x100": lambda: pulled(-6.0, {"contact.damping": 1.3e6}),
    "contact-undamped": lambda: Scene(_with(Contact(linear=1.67e9, compensate=True)), ramp(), 0.01),
    "bouncing": lambda: Scene(_with(Contact(linear=1.67e9, damping=1.3e3)), NOTHING, 0.02),
    "bouncing-hunt-crossley": lambda: Scene(
        _with(Contact(linear=1.67e9, hunt_crossley=1.0)), NOTHING, 0.02
    ),
    "grazing": lambda: Scene(beside(3e-4, 0.12), NOTHING, 0.03),
    "1-newton": lambda: Scene(pair({"belt.preload": 1.0}), ramp(-0.02, 1e-4), 0.05),
    "no-preload": lambda: Scene(pair({"belt.preload": 0.1}), ramp(-0.002, 1e-5), 0.05),
    "slack-span": lambda: Scene(
        pair({"friction.mu_k": 2.0}),
        PiecewiseLinear([2e-3, 2e-3], [0.0, -50.0], 0),
        0.02,
    ),
    "thrown-off": lambda: Scene(_round_a_pin(), NOTHING, 0.01),
    "thrown-apart": lambda: Scene(pair(), NOTHING, 0.01),
    "thrown-through": lambda: Scene(_with(Contact(linear=1e6, damping=1e2)), NOTHING, 0.01),
}

START: dict[str, Callable[[HardScene], State]] = {
    "bouncing": _thrown,
    "bouncing-hunt-crossley": _thrown,
    "grazing": partial(_moving, vy=1.0),
    "thrown-off": partial(_moving, vy=-40.0),
    "thrown-apart": partial(_moving, vx=-930.0),
    "thrown-through": partial(_moving, vx=-200.0),
}
