"""Effects of a drive, and the numbers of the scene that require each.

The effects are the rows of the core's table, ``csrc/physics/effects.c``; a row says which groups of
parameters call for it, so an effect or a parameter that is added there appears here by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import attrs

from .. import _core
from ..drive.friction import Friction, Frictionless
from ..drive.parameters import Path
from ..drive.params import Params
from ..drive.rules import Printable, Rule
from ..loads.motions import MotionLike, described

#: Numbers of the belt that say how much of it there is, not how it acts; of contact a switch.
_NO_FORCE = {"length", "preload", "n_bodies", "linear_density", "compensate"}


@attrs.frozen(kw_only=True)
class Effect:
    """An effect of the core: whether a drive has it, and why.

    Attributes:
        name: As in ``result.effects``; of one that is off, its name in the core's table.
        on: Whether it is simulated. What is off has no pass and no part in the state.
        because: Why the scene has it, a line for each part: its numbers, named as in Python and
            TOML. Of an effect that is off, what would.
        zero: Numbers of these parts that are 0 and so call for nothing.
    """

    name: str
    on: bool
    because: tuple[str, ...]
    zero: tuple[str, ...]


class Part(NamedTuple):
    """A part of a drive that has numbers."""

    group: str  # of its parameters, such as "drag"; of a friction law "friction"
    path: str  # its field, such as "belt" or "drag"
    pulley: int | None  # that it belongs to
    part: Printable

    @property
    def place(self) -> Path:
        """Where it is in the drive."""
        return (self.path,) if self.pulley is None else ("pulleys", self.pulley, self.path)


def parts_of(params: Params) -> Iterator[Part]:
    """Yield the parts of a drive: belt, contact, friction, and what its pulleys have."""
    yield from _part("belt", None, params.belt)
    yield from _part("contact", None, params.effective_contact)
    yield from _part("friction", None, params.friction)
    for k, pulley in enumerate(params.pulleys):
        for field in attrs.fields(type(pulley)):
            yield from _part(field.name, k, getattr(pulley, field.name))


def effects_of(
    params: Params,
    torque: str,
    motions: Mapping[int, MotionLike],
    rows: Sequence[int],
    passes: Sequence[str],
) -> tuple[Effect, ...]:
    """Return all effects that a run can have, in the order of their passes."""
    names = dict(zip(rows, passes, strict=False))  # the ledger's pass is no row
    found = []
    for row, (name, asked_by) in enumerate(_core.EFFECTS):
        if asked_by or row in names:  # else of settling alone
            because, zero = map(tuple, _reasons(params, torque, motions, asked_by.split()))
            name, on = names.get(row, name), row in names
            found.append(Effect(name=name, on=on, because=because, zero=zero))
    return tuple(found)


def _part(path: str, pulley: int | None, part: object) -> Iterator[Part]:
    if isinstance(part, Frictionless):
        return
    if isinstance(part, Friction):
        yield Part("friction", path, pulley, part)
    elif isinstance(part, Printable):
        groups = {rule.group for rule in _rules(part)} or {type(part).__name__.lower()}
        yield from (Part(group, path, pulley, part) for group in groups)


def _rules(part: Printable) -> list[Rule]:
    fields: Any = attrs.fields(type(part))  # type: ignore[arg-type]
    return [field.metadata["rule"] for field in fields if "rule" in field.metadata]


def _reasons(
    params: Params, torque: str, motions: Mapping[int, MotionLike], words: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Return the numbers that require an effect, and those that are 0."""
    reasons: list[str] = []
    zero: list[str] = []
    if "gravity" in words:
        x, y = params.gravity
        (reasons if x or y else zero).append(f"gravity = ({x:g}, {y:g}) m/s^2")
    if "torque" in words:
        reasons.append(f"torque: {torque}")
    if "motion" in words:
        reasons += [f"motion of {params.label(k)}: {described(one)}" for k, one in motions.items()]
    for part in parts_of(params):
        if part.group not in words:
            continue
        where = "" if part.pulley is None else f"{params.label(part.pulley)}: "
        numbers, none = _numbers(part)
        if numbers:
            reasons.append(where + ", ".join(numbers))
        zero += [where + name for name in none]
    return reasons, zero


def _numbers(part: Part) -> tuple[list[str], list[str]]:
    """Return the numbers of a part that are not 0, and those that are, each with name and unit."""
    numbers: list[str] = []
    zero: list[str] = []
    if isinstance(part.part, Friction):
        numbers.append(f'friction law "{part.part.law}"')
    rules = {rule.name: rule for rule in _rules(part.part)}
    for name, quantity, _ in part.part._rows():
        if name in _NO_FORCE or (rules and name not in rules):
            continue
        text = f"{part.path}.{name} = {quantity}"
        (zero if getattr(part.part, name, None) == 0.0 else numbers).append(text)
    return numbers, zero
