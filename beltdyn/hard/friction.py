"""Friction laws where they are stiffest, steepest, weakest."""

from __future__ import annotations

import attrs

from ..friction import (
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
from ..scene import Scene
from ..tensioning import Tensioning
from ..torques import PiecewiseLinear
from . import theory
from .drives import pair, ramp
from .hard_scene import Entry

__all__ = ["SCENES"]


def _loaded(law: Friction, torque: float = -6.0, t_end: float = 0.03) -> Scene:
    return Scene(attrs.evolve(pair(), friction=law), ramp(torque), t_end)


def _stiff(law: Friction, within: str, limit: str = "mu_k") -> Entry:
    """A law that is developed within so little slip, or so low a slip velocity."""
    return Entry(
        f"Friction is developed within {within}: steps that follow the belt's waves overshoot it.",
        f"Friction stays within its limit, |mu| <= {limit}.",
        lambda: _loaded(law),
        theory=theory.friction_limit,
    )


def _reversing() -> Scene:
    """Full slip one way and the other, by jumps 1 ms apart."""
    t = [1e-3 * (k // 2) for k in range(2, 42)]
    values = [-60.0 * (-1.0) ** ((k + 1) // 2) for k in range(40)]
    return Scene(pair({"friction.sigma": 1e7}), PiecewiseLinear(t, values, 0), 0.02)


def _at_rest() -> Scene:
    """Tensioned with friction, which stays in the wraps."""
    params = attrs.evolve(
        pair(), tensioning=Tensioning(friction=True, pulleys="free", offset={1: (-2e-3, 0.0)})
    )
    return Scene(params, PiecewiseLinear([0.0], [0.0], 0), 0.02)


SCENES: dict[str, Entry] = {
    "sigma-1e6": _stiff(Dahl(mu_k=0.6, sigma=1e6), "0.6 um of slip"),
    "sigma-1e7": _stiff(Dahl(mu_k=0.6, sigma=1e7), "60 nm of slip"),
    "sigma-1e8": _stiff(Dahl(mu_k=0.6, sigma=1e8), "6 nm of slip"),
    "sigma-tiny": Entry(
        "Friction of sigma = 2 1/m is developed after 0.3 m of slip: whoever takes a belt that "
        "slips for one in full slip takes the limit for the force.",
        "mu of a link is mu_k (1 - exp(-sigma x / mu_k)) after the slip x.",
        lambda: _loaded(Dahl(mu_k=0.6, sigma=2.0)),
        theory=theory.dahl_curve,
    ),
    "mu-0": Entry(
        "Without friction the ratio of tensions, torque capacity and slip have no meaning: "
        "divisions by mu_k.",
        "Pulley 0 spins up as if it were alone, omega = M t / I.",
        lambda: Scene(attrs.evolve(pair(), friction=Frictionless()),
                      PiecewiseLinear([0.0], [-6.0], 0), 0.02),
        theory=theory.free_spin_up,
    ),
    "coulomb-steep": _stiff(Coulomb(mu=0.6, v_reg=1e-5), "10 um/s of slip velocity", "mu"),
    "creep-rate-steep": _stiff(
        CreepRate(mu=0.6, v_critical=1e-5), "10 um/s of slip velocity", "mu"
    ),
    "threlfall-steep": _stiff(Threlfall(mu=0.6, v_reg=1e-5), "10 um/s of slip velocity", "mu"),
}  # fmt: skip
