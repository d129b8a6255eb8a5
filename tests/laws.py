"""An example of every friction law of the core's table, and the oracle's law of the same numbers.

A law that the table gains later gets an example by the units of its parameters, so that the tests
which go through `EXAMPLES` cover it; those that need the oracle ask for its twin there.
"""

from __future__ import annotations

import dataclasses

import attrs
import reference_friction
from reference_friction import Law

import beltdyn as bd
from beltdyn import _core
from beltdyn.friction import LAWS, Friction
from beltdyn.rules import rules_of

#: A number of each unit that friction parameters have.
TYPICAL = {"1": 0.6, "1/m": 1e4, "m/s": 0.05, "s/m": 0.1, "N/m^2": 2e7, "N s/m^2": 400.0}

_CHOSEN: dict[str, Friction] = {
    "dahl": bd.Dahl(mu_k=0.8, sigma=1e4),
    "lugre": bd.LuGre(mu_k=0.6, mu_s=0.8, v_stribeck=0.05, sigma=1e4, damping=0.1, viscous=0.02),
    "elastic_plastic": bd.ElasticPlastic(mu=0.8, stiffness=2e7, damping=400.0),
}


def typical(name: str) -> Friction:
    """An instance of a law, its parameters by their units."""
    return LAWS[name](**{rule.name: TYPICAL[rule.unit] for rule in rules_of(name).values()})


#: One of every law, by its name.
EXAMPLES: dict[str, Friction] = {
    name: _CHOSEN.get(name) or typical(name) for name, _, _ in _core.LAWS
}

#: Laws whose parameters leave something out.
PLAIN_LUGRE = bd.LuGre(mu_k=0.8, mu_s=0.8, v_stribeck=0.05, sigma=1e4)
UNDAMPED_LUGRE = bd.LuGre(mu_k=0.6, mu_s=0.8, v_stribeck=0.05, sigma=1e4)


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
    names = [rule.name for rule in rules_of(friction.law).values() if rule.unit == "1"]
    return attrs.evolve(friction, **{name: factor * getattr(friction, name) for name in names})


def with_laws(params: bd.Params, *laws: Friction | None) -> bd.Params:
    """The drive with these laws on its pulleys, and none of its own."""
    pairs = zip(params.pulleys, laws, strict=True)
    pulleys = [attrs.evolve(pulley, friction=law) for pulley, law in pairs]
    return attrs.evolve(params, pulleys=pulleys, friction=None)
