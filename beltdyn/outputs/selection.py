"""Outputs on demand: the names of what a run computes and keeps."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from .. import _core
from ..base.checks import close_to
from .histories import GROUPS, absent
from .quantity import LEDGER, QUANTITIES, SPANS

#: An integral of an output.
PASSED = "passed"
#: What the core is asked for in any case, 2 n_p + 1 numbers a sample.
EVERY_RUN = ("omega", "torque", "across")


def named(**groups: str) -> tuple[str, ...]:
    """Return names of outputs, as "joints.force", from the names in each group."""
    return tuple(f"{group}.{name}" for group, names in groups.items() for name in names.split())


#: What is looked for in the samples of a run, and the outputs that it is found in; the error of the
#: mesh is of what every run samples.
_LOOKED_FOR = {
    "no_friction": named(pulleys="omega torque"),
    "units": named(pulleys="torque"),
    "full_slip": named(pulleys="torque", contact="pulley normal friction velocity"),
    "slack_span": (SPANS,),
    "never_drives": named(couplings="transmitted rim_speed", pulleys="omega"),
}
_OF_SPANS = named(contact="pulley", joints="force")


def array_names() -> dict[str, tuple[str, ...]]:
    """Return the outputs that can be asked for by group, as "joints.force"."""
    groups = {
        group: tuple(f"{group}.{name}" for name in kind.array_names())
        for group, kind in GROUPS.items()
    }
    return {**groups, LEDGER: (LEDGER,), SPANS: (SPANS,)}


def chosen(outputs: object, ledger: bool, lacks: Collection[str] = ()) -> tuple[str, ...] | None:
    """Check the outputs asked for and return their names in the order of the table; None: all."""
    if outputs is None:
        return None
    if isinstance(outputs, str):
        raise TypeError(f"outputs must be a tuple of names, got {outputs!r}: write ({outputs!r},)")
    if not isinstance(outputs, (tuple, list, set, frozenset)):
        raise TypeError(f"outputs must be a tuple of names or None, got {type(outputs).__name__}")
    known = array_names()
    every = [name for names in known.values() for name in names]
    asked: set[str] = set()
    for name in outputs:
        if not isinstance(name, str):
            raise TypeError(f"outputs must be names, got {name!r}")
        if name not in known and name not in every:
            hint = close_to(name, (*known, *every))
            raise ValueError(f"outputs: there is no {name!r}{hint}, there are {_listed()}")
        if name in lacks:
            raise ValueError(f"outputs: {name!r} is nothing that this belt has; {absent(name)}")
        asked.update(known.get(name, (name,)))
    if LEDGER in asked and not ledger:
        raise ValueError('outputs asks for "energy", the ledger, and ledger=False leaves it out')
    return tuple(name for name in every if name in asked)


def lacking(params: Any) -> frozenset[str]:
    """Return the outputs, as "contact.slip", that the belt of a drive does not have."""
    sizes = params._belt_facts["lacks"]
    return frozenset(name for name, row in QUANTITIES.items() if row.size in sizes)


def of_belt(names: Collection[str] | None, params: Any) -> tuple[str, ...] | None:
    """Leave out outputs that the belt of a drive lacks; None stands for all that it has."""
    lacks = lacking(params)
    return None if names is None else tuple(name for name in names if name not in lacks)


def _listed() -> str:
    """List the names that there are."""
    groups = []
    for group, names in array_names().items():
        short = ", ".join(name.partition(".")[2] for name in names)
        groups.append(f'"{group}"' if names == (group,) else f'"{group}" ({short})')
    return f'{"; ".join(groups)}; single arrays as "joints.force"'


def has(names: Collection[str] | None, name: str) -> bool:
    """Return whether an output is among the ``names`` asked of a run."""
    if names is None or name in names:
        return True
    return name == SPANS and all(one in names for one in _OF_SPANS)


def of_core(names: Collection[str] | None, ledger: bool) -> tuple[str, ...]:
    """Return the names to ask the core for."""
    if names is None:
        every = {"pulley", *(name for name, *_ in _core.OUTPUTS)}
        needed = every if ledger else every - {LEDGER}
    else:
        needed = {name.rpartition(".")[2] for name in names}
        needed |= {"flow", "theta"} if PASSED in needed else set()
        needed.discard(PASSED)
    return tuple(sorted(needed | set(EVERY_RUN)))


def unchecked(names: Collection[str] | None, params: Any) -> tuple[str, ...]:
    """Return the codes of warnings of such a drive that outputs not asked for would show."""
    never = {"no_friction" if params.has_friction else "full_slip"}
    never |= set() if params.coupled else {"never_drives"}
    return tuple(
        code
        for code, needs in _LOOKED_FOR.items()
        if code not in never and not all(has(names, one) for one in needs)
    )
