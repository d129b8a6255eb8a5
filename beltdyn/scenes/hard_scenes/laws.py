"""Friction laws where they are stiffest, steepest, weakest."""

from __future__ import annotations

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
from . import theory
from .drives import LOCKED, pair, pulled, ramp
from .hard_scene import Entry

__all__ = ["SCENES"]


def _loaded(law: Friction, t_end: float = 0.03) -> Scene:
    return Scene(attrs.evolve(pair(), friction=law), ramp(), t_end)


def _stiff(law: Friction, within: str, limit: str = "mu_k") -> Entry:
    """Enter a law that develops fully within so little slip, or at so low a slip velocity."""
    return Entry(
        f"{type(law).__name__} friction is developed within {within}: steps that follow the "
        "belt's waves overshoot it.",
        f"Friction stays within its limit, |mu| <= {limit}.",
        lambda: _loaded(law),
        theory=theory.friction_limit,
    )


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


SCENES: dict[str, Entry] = {
    "sigma-1e6": _stiff(Dahl(mu_k=0.6, sigma=1e6), "0.6 um of slip"),
    "sigma-1e7": _stiff(Dahl(mu_k=0.6, sigma=1e7), "60 nm of slip"),
    "sigma-1e8": _stiff(Dahl(mu_k=0.6, sigma=1e8), "6 nm of slip"),
    "sigma-tiny": Entry(
        "Friction of sigma = 2 1/m is developed after 0.3 m of slip: code that takes "
        "friction for its limit wherever a belt slips is far off.",
        "mu of a link is mu_k (1 - exp(-sigma x / mu_k)) after the slip x.",
        lambda: _loaded(Dahl(mu_k=0.6, sigma=2.0)),
        theory=theory.dahl_curve,
    ),
    "mu-0": Entry(
        "Without friction the torque that a belt can transmit is zero: divisions by it.",
        "Pulley 0 spins up as if it were alone, omega = M t / I.",
        lambda: Scene(
            attrs.evolve(pair(), friction=Frictionless()),
            PiecewiseLinear([0.0], [-6.0], 0),
            0.02,
        ),
        theory=theory.free_spin_up,
    ),
    "mu-0.01": Entry(
        "Friction of 0.01 lets every load slip in full: ratios of tensions near 1, small "
        "differences of large forces.",
        "ln(T_1 / T_2) = mu_k theta, to the error of the mesh.",
        lambda: pulled(-6.0, {"friction.mu_k": 0.01}),
        theory=theory.capstan,
    ),
    "mu-3": Entry(
        "Friction of 3 could hold a ratio of tensions of 12 000: the slack span is all but "
        "slack, and the limit of one wrap spans four decades.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-34.0, {"friction.mu_k": 3.0}),
        theory=theory.statics,
    ),
    "stribeck-dahl": Entry(
        "Friction falls from 1.2 to 0.3 within 30 mm/s: it feeds vibration, and its slope has the "
        "wrong sign for an implicit step.",
        "Friction stays within its limit, |mu| <= mu_s.",
        lambda: _slow_slip(Dahl(mu_k=0.3, sigma=1e5, mu_s=1.2, v_stribeck=0.03), 0.2),
        theory=theory.friction_limit,
    ),
    "stribeck-coulomb": Entry(
        "A function of the slip velocity alone that rises to 1.2 within 0.1 mm/s and falls to "
        "0.3 within 30 mm/s: two equilibria, jumps between them.",
        "Friction stays within its limit, |mu| <= mu_s.",
        lambda: _slow_slip(Coulomb(mu=0.3, v_reg=1e-4, mu_s=1.2, v_stribeck=0.03), 0.2),
        theory=theory.friction_limit,
    ),
    "reversal-within-a-step": Entry(
        "The torque turns over every 20 us, the friction with it: an end point of a step knows "
        "nothing of what happened within.",
        "Friction stays within its limit, |mu| <= mu_k.",
        _reversing,
        theory=theory.friction_limit,
    ),
    "slip-velocity-0": Entry(
        "Friction of 1e6 1/m at its limit, the slip velocity exactly 0, where |v| has its kink: "
        "signs of rounding errors decide what slips.",
        "A belt at rest under its friction stays at rest.",
        _tensioned_with_friction,
        theory=theory.at_rest,
    ),
    "coulomb-steep": _stiff(Coulomb(mu=0.6, v_reg=1e-6), "1 um/s of slip velocity", "mu"),
    "creep-rate-steep": _stiff(CreepRate(mu=0.6, v_critical=1e-6), "1 um/s of slip velocity", "mu"),
    "threlfall-steep": _stiff(Threlfall(mu=0.6, v_reg=1e-6), "1 um/s of slip velocity", "mu"),
    "lugre-stiff": _stiff(
        LuGre(mu_k=0.5, mu_s=0.6, v_stribeck=0.01, sigma=1e8), "6 nm of slip", "mu_s"
    ),
    "elastic-plastic-stiff": _stiff(
        ElasticPlastic(mu=0.6, stiffness=1e13, damping=1e7), "0.3 nm of slip", "mu"
    ),
    "maxwell-slip-stiff": _stiff(
        MaxwellSlip(mu=(0.2, 0.2, 0.2), stiffness=(1e7, 1e10, 1e13), damping=(1e2, 1e4, 1e7)),
        "0.1 nm of slip in one element, 0.1 mm in another",
        "sum of mu",
    ),
}
