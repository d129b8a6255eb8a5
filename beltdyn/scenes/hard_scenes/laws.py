"""Friction laws where they are stiffest, steepest, weakest."""

from __future__ import annotations

from collections.abc import Callable

import attrs

from ...drive.friction import (
    Coulomb,
    CreepRate,
    Dahl,
    ElasticPlastic,
    Friction,
    Frictionless,
    LuGre,
    MaxwellSlip,
    Threlfall,
)
from ...drive.scene import Scene
from ...drive.tensioning import Tensioning
from ...loads.torques import PiecewiseLinear
from .drives import LOCKED, pair, pulled, ramp

__all__ = ["MAKE"]


def _loaded(law: Friction, t_end: float = 0.03) -> Scene:
    return Scene(attrs.evolve(pair(), friction=law), ramp(), t_end)


def _slow_slip(law: Friction, t_end: float) -> Scene:
    """Pulley 0 turns slowly, pulley 1 is locked: the belt sticks and slips."""
    params = attrs.evolve(pair(), friction=law)
    motion = {0: PiecewiseLinear([0.0, 1e-3], [0.0, -0.3]), 1: LOCKED}
    return Scene(params, PiecewiseLinear([0.0], [0.0], 0), t_end, motion)


def _reversing() -> Scene:
    """Torques that turn over every 20 us, faster than the contact's own vibration."""
    t = [2e-5 * (k // 2) for k in range(1, 501)]
    values = [-40.0 * (-1.0) ** (k // 2) for k in range(500)]
    return Scene(pair({"friction.sigma": 1e7}), PiecewiseLinear(t, values, 0), 6e-3)


def _tensioned_with_friction() -> Scene:
    """Pulley 1 is moved outwards by 2 mm against friction, which stays in the wraps."""
    tensioning = Tensioning(friction=True, offset={1: (-2e-3, 0.0)})
    params = attrs.evolve(pair({"friction.sigma": 1e6}), tensioning=tensioning)
    return Scene(params, PiecewiseLinear([0.0], [0.0], 0), 0.02, {0: LOCKED, 1: LOCKED})


MAKE: dict[str, Callable[[], Scene]] = {
    "sigma-1e6": lambda: _loaded(Dahl(mu_k=0.6, sigma=1e6)),
    "sigma-1e7": lambda: _loaded(Dahl(mu_k=0.6, sigma=1e7)),
    "sigma-1e8": lambda: _loaded(Dahl(mu_k=0.6, sigma=1e8)),
    "sigma-tiny": lambda: _loaded(Dahl(mu_k=0.6, sigma=2.0)),
    "mu-0": lambda: Scene(
        attrs.evolve(pair(), friction=Frictionless()),
        PiecewiseLinear([0.0], [-6.0], 0),
        0.02,
    ),
    "mu-0.01": lambda: pulled(-6.0, {"friction.mu_k": 0.01}),
    "mu-3": lambda: pulled(-34.0, {"friction.mu_k": 3.0}),
    "stribeck-dahl": lambda: _slow_slip(Dahl(mu_k=0.3, sigma=1e5, mu_s=1.2, v_stribeck=0.03), 0.2),
    "stribeck-coulomb": lambda: _slow_slip(
        Coulomb(mu=0.3, v_reg=1e-4, mu_s=1.2, v_stribeck=0.03), 0.2
    ),
    "reversal-within-a-step": _reversing,
    "slip-velocity-0": _tensioned_with_friction,
    "coulomb-steep": lambda: _loaded(Coulomb(mu=0.6, v_reg=1e-6)),
    "creep-rate-steep": lambda: _loaded(CreepRate(mu=0.6, v_critical=1e-6)),
    "threlfall-steep": lambda: _loaded(Threlfall(mu=0.6, v_reg=1e-6)),
    "lugre-stiff": lambda: _loaded(LuGre(mu_k=0.5, mu_s=0.6, v_stribeck=0.01, sigma=1e8)),
    "elastic-plastic-stiff": lambda: _loaded(ElasticPlastic(mu=0.6, stiffness=1e13, damping=1e7)),
    "maxwell-slip-stiff": lambda: _loaded(
        MaxwellSlip(mu=(0.2, 0.2, 0.2), stiffness=(1e7, 1e10, 1e13), damping=(1e2, 1e4, 1e7))
    ),
}
