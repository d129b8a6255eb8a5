"""An example of every friction law of the core's table, and the oracle's law of the same numbers.

A law that the table gains later gets an example by the units of its parameters, so that the tests
which go through `EXAMPLES` cover it; those that need the oracle ask for its twin there.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import attrs
import reference_friction
from reference_friction import Law

import beltdyn as bd
from beltdyn import _core
from beltdyn.drive.friction import LAWS, Friction
from beltdyn.drive.rules import rules_of

#: A number of each unit that friction parameters have; of lists, two.
TYPICAL = {"1": 0.6, "1/m": 1e4, "m/s": 0.05, "s/m": 0.1, "N/m^2": 2e7, "N s/m^2": 400.0}

_CHOSEN: dict[str, Friction] = {
    "dahl": bd.Dahl(mu_k=0.8, sigma=1e4),
    "lugre": bd.LuGre(mu_k=0.6, mu_s=0.8, v_stribeck=0.05, sigma=1e4, damping=0.1, viscous=0.02),
    "elastic_plastic": bd.ElasticPlastic(mu=0.8, stiffness=2e7, damping=400.0),
    "coulomb": bd.Coulomb(mu=0.8, v_reg=0.1),
    "creep_rate": bd.CreepRate(mu=0.8, v_critical=0.15),
    "threlfall": bd.Threlfall(mu=0.8, v_reg=0.25),
    "maxwell_slip": bd.MaxwellSlip(
        mu=(0.2, 0.35, 0.25), stiffness=(3e7, 1.5e7, 4e6), damping=(600.0, 400.0, 200.0)
    ),
}


def typical(name: str) -> Friction:
    """An instance of a law, its parameters by their units."""
    numbers = {
        rule.name: (TYPICAL[rule.unit],) * 2 if rule.rule == "POSITIVES" else TYPICAL[rule.unit]
        for rule in rules_of(name).values()
    }
    return LAWS[name](**numbers)


#: One of every law, by its name.
EXAMPLES: dict[str, Friction] = {
    name: _CHOSEN.get(name) or typical(name) for name, _, _ in _core.LAWS
}

#: The laws that take a Stribeck curve, with one.
STRIBECK: dict[str, Friction] = {
    name: attrs.evolve(law, mu_s=1.0, v_stribeck=0.05)
    for name, law in EXAMPLES.items()
    if "mu_s" in rules_of(name)
}

#: Laws whose parameters leave something out.
PLAIN_LUGRE = bd.LuGre(mu_k=0.8, mu_s=0.8, v_stribeck=0.05, sigma=1e4)
UNDAMPED_LUGRE = bd.LuGre(mu_k=0.6, mu_s=0.8, v_stribeck=0.05, sigma=1e4)


def without_curve(law: Any) -> Friction:
    """With its kinetic coefficient as the static one, which is no Stribeck curve."""
    kinetic = law.mu_k if hasattr(law, "mu_k") else law.mu
    mu_s = sum(kinetic) if isinstance(kinetic, tuple) else kinetic
    changed: Friction = attrs.evolve(law, mu_s=mu_s)
    return changed


def oracle_law(friction: Friction | None) -> Law | None:
    """The oracle's law, a class of the same name, with the same numbers."""
    if friction is None:
        return None
    name = type(friction).__name__
    assert hasattr(reference_friction, name), f"tests/reference_friction.py lacks {name}"
    law: Law = getattr(reference_friction, name)(*friction._to_core()[1])
    return law


def core_law(law: Law) -> tuple[str, tuple[float, ...]]:
    """What `_core` takes for one of the oracle's laws."""
    names = {class_name: name for name, class_name, _ in _core.LAWS}
    assert dataclasses.is_dataclass(law) and not isinstance(law, type)
    return names[type(law).__name__], dataclasses.astuple(law)


def scaled(friction: Friction, factor: float) -> Friction:
    """With all coefficients of friction, its parameters without a unit, times the factor."""
    return times(friction, factor, "1")


def times(friction: Friction, factor: float, *units: str) -> Friction:
    """With all parameters of these units times the factor."""

    def changed(value: Any) -> Any:
        return tuple(map(changed, value)) if isinstance(value, tuple) else factor * value

    names = [rule.name for rule in rules_of(friction.law).values() if rule.unit in units]
    return attrs.evolve(friction, **{name: changed(getattr(friction, name)) for name in names})


def with_laws(params: bd.Params, *laws: Friction | None) -> bd.Params:
    """The drive with these laws on its pulleys, and none of its own."""
    pairs = zip(params.pulleys, laws, strict=True)
    pulleys = [attrs.evolve(pulley, friction=law) for pulley, law in pairs]
    return attrs.evolve(params, pulleys=pulleys, friction=None)
