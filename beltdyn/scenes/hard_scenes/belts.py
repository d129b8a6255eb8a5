"""Belts of few links and many, without damping and with far too much, light, heavy and rigid."""

from __future__ import annotations

from typing import Any

import attrs

from ...drive.scene import Scene
from ...loads.torques import PiecewiseLinear
from . import theory
from .drives import pair, pulled, ramp
from .hard_scene import Entry

__all__ = ["SCENES"]


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


SCENES: dict[str, Entry] = {
    "no-axial-damping": Entry(
        "Waves along the belt never decay: steps that damp take energy away, steps at the edge of "
        "stability feed it.",
        "The energy balance closes to 2 %.",
        _rung,
        theory=theory.balance,
    ),
    "axial-damping-x1000": Entry(
        "What neighbouring links differ by decays within 3 ns: an explicit step that follows the "
        "belt's fastest wave is a thousand times too long.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"belt.axial_damping": 2e3}, 0.1),
        theory=theory.statics,
    ),
    "bending-0": Entry(
        "Rigid links that nothing keeps straight: their rotation in the spans is held by the "
        "tension alone.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"belt.model": "links"}),
        theory=theory.statics,
    ),
    "bending-large": Entry(
        "Bending of EI = T R^2 / 4 lifts the belt off its pulleys where it meets them; rotations "
        "of links vibrate five times as fast as its waves.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"belt.bending_stiffness": 0.5, "belt.preload": 600.0}),
        theory=theory.statics,
    ),
    "pulleys-1000-times-lighter": Entry(
        "Pulleys with a thousandth of the belt's mass at the rim turn with every wave: a step "
        "chosen by the belt is too long for them.",
        "The energy balance closes to 2 %.",
        lambda: _run_up({"pulleys[*].inertia": 3.1e-7}, 0.01),
        theory=theory.balance,
    ),
    "pulleys-1000-times-heavier": Entry(
        "Pulleys of a thousand times the belt's mass take seconds, waves microseconds.",
        "The energy balance closes to 2 %.",
        lambda: _run_up({"pulleys[*].inertia": 0.32}, 0.05),
        theory=theory.balance,
    ),
    "pulley-of-no-inertia": Entry(
        "A pulley of 1e-12 kg m^2 follows friction within nanoseconds: it is at the speed of its "
        "belt at once, or explodes.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"pulleys[0].inertia": 1e-12}),
        theory=theory.statics,
    ),
    "light-pulleys-sigma-1e8": Entry(
        "Pulleys of a thousandth of the belt's mass on friction developed within 6 nm: what is "
        "calm at one moment needs steps of nanoseconds in the next, when links land.",
        "The energy balance closes to 2 %.",
        lambda: _run_up({"pulleys[*].inertia": 3.1e-7, "friction.sigma": 1e8}, 0.1),
        theory=theory.balance,
    ),
    "massless-belt": Entry(
        "A belt of 10 mg/m: waves run at 77 km/s, and the contact vibrates at 2 MHz.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"belt.linear_density": 1e-5}),
        theory=theory.statics,
    ),
    "links-4": Entry(
        "Four links round a pulley, a square: each turns by a quarter at its joints.",
        "What a drive needs of energy is put in: the balance closes to 2 %.",
        lambda: _few(4),
        theory=theory.balance,
    ),
    "links-5": Entry(
        "Five links round a pulley: none lies opposite another.",
        "What a drive needs of energy is put in: the balance closes to 2 %.",
        lambda: _few(5),
        theory=theory.balance,
    ),
    "links-15": Entry(
        "Links as long as the radius: each landing is a blow of a fifth of the tension.",
        "What a drive needs of energy is put in: the balance closes to 2 %.",
        lambda: _run_up({"belt.n_bodies": 15}, 0.05),
        theory=theory.balance,
    ),
    "links-3840": Entry(
        "Links of 0.2 mm: waves cross one in 0.3 us, damping 1000 times as fast as with 120.",
        "The spans carry T_1 - T_2 = M / R.",
        lambda: pulled(-6.0, {"belt.n_bodies": 3840}, 0.03),
        theory=theory.statics,
        options={"rtol": 1e-3},
    ),
}
