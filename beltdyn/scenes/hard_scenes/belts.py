"""Belts of few links and many, without damping and with far too much, light, heavy and rigid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from .drives import pair, pulled, ramp

__all__ = ["MAKE"]


def _run_up(changes: dict[str, Any], t_end: float = 0.03) -> Scene:
    return Scene(pair(changes), ramp(), t_end)


def _few(n: int) -> Scene:
    """Round one pulley, for round two so few links are refused before anything runs."""
    two = pair()
    belt = attrs.evolve(two.belt, n_bodies=n)
    params = attrs.evolve(two, pulleys=two.pulleys[:1], belt=belt)
    return Scene(params, PiecewiseLinear([0.0, 0.01], [0.0, -6.0], 0), 0.05)


def _rung() -> Scene:
    """Set a torque that is there at once and gone 0.1 ms later, on a belt that nothing damps."""
    params = pair({"belt.axial_damping": 0.0, "belt.n_bodies": 40})
    return Scene(params, PiecewiseLinear([1e-3, 1e-3, 1.1e-3, 1.1e-3], [0.0, -60.0, -60.0, 0.0], 0),
                 0.02)  # fmt: skip


MAKE: dict[str, Callable[[], Scene]] = {
    "no-axial-damping": _rung,
    "axial-damping-x1000": lambda: pulled(-6.0, {"belt.axial_damping": 2e3}, 0.1),
    "bending-0": lambda: pulled(-6.0, {"belt.model": "links"}),
    "bending-large": lambda: pulled(-6.0, {"belt.bending_stiffness": 0.5, "belt.preload": 600.0}),
    "pulleys-1000-times-lighter": lambda: _run_up({"pulleys[*].inertia": 3.1e-7}, 0.01),
    "pulleys-1000-times-heavier": lambda: _run_up({"pulleys[*].inertia": 0.32}, 0.05),
    "pulley-of-no-inertia": lambda: pulled(-6.0, {"pulleys[0].inertia": 1e-12}),
    "light-pulleys-sigma-1e8": lambda: _run_up(
        {"pulleys[*].inertia": 3.1e-7, "friction.sigma": 1e8}, 0.1
    ),
    "massless-belt": lambda: pulled(-6.0, {"belt.linear_density": 1e-5}),
    "links-4": lambda: _few(4),
    "links-5": lambda: _few(5),
    "links-15": lambda: _run_up({"belt.n_bodies": 15}, 0.05),
    "links-3840": lambda: pulled(-6.0, {"belt.n_bodies": 3840}, 0.03),
}
