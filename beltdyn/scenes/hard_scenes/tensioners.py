"""Mounts that hit their stops, hold hardly, swing, stick, jump."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...drive.mounts import Arm, Path, Slider
from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from .drives import pair, ramp, tensioned

__all__ = ["MAKE"]


def _arm(torque: float = -15.0, t_end: float = 0.06, **changes: object) -> Scene:
    """Take an arm from rest by a step of the torque."""
    given = {"pivot": (0.2, 0.11), "inertia": 1e-3, "tension": 300.0, "stiffness": 20.0}
    arm = Arm(**{**given, **changes})  # type: ignore[arg-type]
    step = PiecewiseLinear([2e-3, 2e-3], [0.0, torque], 0)
    return Scene(tensioned(arm), step + ramp(0.0, 0.1), t_end)


def _weight() -> Scene:
    """Let a weight of 60 kg pull pulley 1 outwards, on a carriage of 60 kg."""
    slider = Slider(direction=(1.0, 0.0), mass=60.0, weight=60.0)
    params = pair({"belt.preload": None, "pulleys[1].mount": slider, "gravity": (0.0, -9.81)})
    return Scene(params, PiecewiseLinear([2e-3, 2e-3], [0.0, -15.0], 0) + ramp(0.0), 0.3)


def _jump() -> Scene:
    """Let an axis jump by 2 mm within 50 us, and back."""
    near = 50e-6 * np.arange(-5, 7)  # points of a spline that holds still before and after a jump
    ahead = np.where(near <= 0.0, 0.0, -2e-3)
    path = Path(
        t=[0.0, *(5e-3 + near), *(15e-3 + near), 0.02],
        displacement=[(x, 0.0) for x in (0.0, *ahead, *(-2e-3 - ahead), 0.0)],
    )
    return Scene(pair({"pulleys[1].mount": path}), ramp(), 0.02)


MAKE: dict[str, Callable[[], Scene]] = {
    "stops-hit-hard": lambda: _arm(stops=(-0.01, 0.01), stop_stiffness=1e7, damping=0.02),
    "soft-arm": lambda: _arm(stiffness=1e-3, damping=0.02),
    "light-arm": lambda: _arm(inertia=1e-9, damping=0.02),
    "dry-pivot": lambda: _arm(friction=4.0, friction_stiffness=4e6),
    "swinging-weight": _weight,
    "path-that-jumps": _jump,
}
