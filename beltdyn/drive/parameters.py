"""Parameters by name: ``"belt.axial_stiffness"``, ``"pulleys[1].inertia"``, ``"gravity[1]"``.

A pulley may be called by its name, ``"pulleys[crank].inertia"``. :mod:`beltdyn.sweeping.names`
adds those of loads, motions and options of a run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import attrs
import numpy as np

from ..base.checks import close_to
from ..base.naming import index_of
from .friction import Dahl
from .params import Params
from .parts import Belt, Contact, Pulley
from .rules import Rule
from .tensioning import Tensioning


class PulleyName(str):
    """The name of a pulley where an index could stand."""

    __slots__ = ()


#: A field, an index, "*" for every index, or the name of a pulley.
Path: TypeAlias = "tuple[str | int, ...]"

#: The classes of what every drive has.
_PARTS = {"belt": Belt, "contact": Contact, "pulleys": Pulley, "tensioning": Tensioning}
_STEP = re.compile(r"(?:^|\.)([A-Za-z]\w*)|\[([^\[\]]+)\]")


def parse(name: object) -> Path:
    """Split a name into its steps."""
    if not isinstance(name, str):
        raise TypeError(f"the name of a parameter must be a str, got {name!r}")
    steps: list[str | int] = []
    at = 0
    while match := _STEP.match(name, at):
        field, index = match.groups()
        if field:
            steps.append(field)
        elif index == "*":
            steps.append(index)
        else:
            steps.append(int(index) if index.isdecimal() else PulleyName(index))
        at = match.end()
    if at < len(name) or not steps:
        raise ValueError(f'a parameter is named like "pulleys[1].inertia", got {name!r}')
    return tuple(steps)


def check_name(name: object) -> None:
    """Check a name as far as one needs no drive for it: which laws and mounts it has is open."""
    steps = [step for step in parse(name) if type(step) is str and step != "*"]
    for kind, field in zip((Params, _PARTS.get(steps[0]) if steps else None), steps, strict=False):
        if kind is not None and field not in fields(kind):
            there = [str(name).replace(field, one) for one in fields(kind)]
            if kind is Params:  # the commonest law in place of that of a drive that is not known
                parts = {"friction": Dahl, "pulleys[*]": Pulley, **_PARTS}
                there += [f"{part}.{one}" for part, of in parts.items() for one in fields(of)]
            raise ValueError(f"no parameter is called {name!r}{close_to(str(name), there)}")


def with_indices(path: Path, pulleys: Sequence[str]) -> Path:
    """Put the index of each pulley in the place of its name."""
    field = next((str(step) for step in path if isinstance(step, str)), "")
    return tuple(
        index_of(field, step, pulleys) if isinstance(step, PulleyName) else step for step in path
    )


def path_in(params: Params, name: object) -> Path:
    """Split a name into its steps, pulleys by index."""
    return with_indices(parse(name), params.pulley_names)


def overlap(params: Params, one: str, other: str) -> bool:
    """Return whether two names have a number in common, as "pulleys[*].inertia" with any other."""
    steps = zip(path_in(params, one), path_in(params, other), strict=False)
    return all(a == b or "*" in (a, b) for a, b in steps)


def fields(kind: Any) -> list[str]:
    """List the fields of a class."""
    return [field.name for field in attrs.fields(kind) if field.init]


def _leaves(node: object, prefix: str) -> Iterator[str]:
    if attrs.has(type(node)):
        for field in fields(type(node)):
            yield from _leaves(getattr(node, field), f"{prefix}.{field}".lstrip("."))
    elif isinstance(node, tuple):
        for k, part in enumerate(node):
            yield from _leaves(part, f"{prefix}[{k}]")
    elif isinstance(node, float):
        yield prefix


def numbers(params: Params) -> list[str]:
    """List the names of all real numbers in a drive."""
    return list(_leaves(params, ""))


def known(params: Params) -> list[str]:
    """List them with those that its belt could have in place of others."""
    return [*numbers(params), *(f"belt.{field}" for field in fields(Belt))]


def _step(node: Any, step: str | int, so_far: str) -> Any:
    if isinstance(step, str):
        if not attrs.has(type(node)) or step not in fields(type(node)):
            raise KeyError
        return getattr(node, step)
    if not isinstance(node, tuple):
        raise KeyError
    if step >= len(node):
        raise ValueError(f"{so_far}[{step}]: {so_far} has {len(node)} entries here")
    return node[step]


def read(params: Params, name: str) -> list[Any]:
    """Return the value of a name, or one value for each index of a "*"."""
    nodes: list[Any] = [params]
    so_far = ""
    for step in path_in(params, name):
        try:
            if step == "*":
                if not isinstance(nodes[0], tuple):
                    raise KeyError
                nodes = [part for node in nodes for part in node]
            else:
                nodes = [_step(node, step, so_far) for node in nodes]
        except KeyError:
            if nodes[0] is None:
                raise ValueError(f"{name}: this drive has no {so_far}") from None
            hint = close_to(name, known(params))
            raise ValueError(f"no parameter is called {name!r}{hint}") from None
        so_far += f"[{step}]" if isinstance(step, int) or step == "*" else f".{step}"
        so_far = so_far.lstrip(".")
    return nodes


def rule_of(params: Params, name: str) -> Rule | None:
    """Return the rule of a named number or list, None if it has none of its own."""
    whole = path = path_in(params, name)
    if len(path) > 1 and not (isinstance(path[-1], str) and path[-1] != "*"):
        path = path[:-1]
    field = path[-1]
    if not isinstance(field, str) or field == "*":
        return None
    node: Any = params
    for step in path[:-1]:
        node = node[0] if step == "*" else _step(node, step, name)
    rule: Rule | None = getattr(attrs.fields(type(node)), field).metadata.get("rule")
    return rule if path == whole or (rule and rule.rule == "POSITIVES") else None


def assign(node: Any, changes: Sequence[tuple[Path, Any]]) -> Any:
    """Return a copy with several values changed at once; each change alone need not be valid.

    The paths must exist, as :func:`read` checks; of two values for one path the last one counts.
    """
    if not changes:
        return node
    whole = [value for path, value in changes if not path]
    if whole:
        return whole[-1]
    if isinstance(node, tuple):
        return tuple(
            assign(part, [(path[1:], value) for path, value in changes if path[0] in (k, "*")])
            for k, part in enumerate(node)
        )
    if isinstance(node, np.ndarray):  # of loads
        copy = node.copy()
        for path, value in changes:
            copy[path[0]] = assign(copy[path[0]], [(path[1:], value)])
        return copy
    touched = {path[0] for path, _ in changes}
    new = {
        field: assign(
            getattr(node, field), [(path[1:], value) for path, value in changes if path[0] == field]
        )
        for field in fields(type(node))
        if field in touched
    }
    return attrs.evolve(node, **new)


def changed(params: Params, values: Mapping[str, Any]) -> Params:
    """Return the drive with parameters changed by name, as ``{"belt.axial_damping": 0.0}``."""
    drive: Params = assign(params, [(path_in(params, name), values[name]) for name in values])
    return drive
