"""Rules of parameters: bounds, unit and meaning of every number, from ``csrc/fields.h``.

The table there is shared by the C core, which checks the numbers again, and the classes of
:mod:`beltdyn.drive.parts`, whose fields are checked and printed by it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple, get_args

import attrs

from .. import _core
from ..base import checks
from ..base.described import checked, ruled
from ..base.tables import columns

#: By name: wording, lower bound, whether it is excluded, upper bound.
_RULES = {row[0]: row[1:] for row in _core.RULES}
#: Group and name of those that the core knows and checks itself.
_OF_CORE = {(row[0], row[1]) for row in _core.PARAMETERS}


class Rule(NamedTuple):
    """The rule of a field: a row of ``_core.PARAMETERS``, or of a number the core does not know."""

    group: str
    name: str
    rule: str
    unit: str
    text: str

    def check(self, value: object) -> Any:
        """Check a value and return it as plain numbers."""
        label = f"{self.group}.{self.name}".lstrip(".")
        if self.rule == "PAIR":
            return checks.pair(label, value, self.unit)
        if self.rule == "LINKS":
            _, least, _, most = _RULES[self.rule]
            return checks.integer(label, value, int(least), int(most))
        if self.rule == "FLAG":
            return checks.flag(label, value)
        if (self.group, self.name) not in _OF_CORE:
            known = checks.real if self.rule == "FINITE" else checks.positive
            return known(label, value, self.unit)
        if self.rule == "POSITIVES":
            return tuple(map(self._number, checks.real_numbers(label, value, self.unit)))
        return self._number(value)

    def _number(self, value: object) -> float:
        label = f"{self.group}.{self.name}"
        number = checks.real(label, value, self.unit)
        _core.check_parameter(self.group, self.name, self.group, number)
        return number

    @property
    def wording(self) -> str:
        """Bound of a number in words, as "> 0"."""
        wording: str = _RULES[self.rule][0]
        return wording

    @property
    def described(self) -> str:
        """Meaning, unit and bound."""
        whole = f"{self.name} {self.text}" if self.text.startswith("of ") else self.text
        return f"{whole} [{self.unit}], {self.wording}."

    def quantity(self, value: Any) -> str:
        """Write a value with its unit."""
        if value is None:
            return "chosen"
        if self.rule == "FLAG":
            return "yes" if value else "no"
        if isinstance(value, tuple):
            number = f"({', '.join(f'{one:.10g}' for one in value)})"
        else:
            number = f"{value:.10g}"
        return number if self.unit == "1" else f"{number} {self.unit}"


def rules_of(group: str) -> dict[str, Rule]:
    """Return the rules of a group of parameters, by name, in the order of the core's struct."""
    return {row[1]: Rule(*row) for row in _core.PARAMETERS if row[0] == group}


def numbers_of(group: str, part: object, **others: float) -> tuple[Any, ...]:
    """Return the numbers of a group in the core's order, 0 of what is left open."""
    values = (others[name] if name in others else getattr(part, name) for name in rules_of(group))
    return tuple(int(value or 0) if isinstance(value, bool | None) else value for value in values)


def instance_of(name: str, kinds: Any) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    """Return the validator of a field that holds a part of a drive, of one of these kinds."""
    names = [one.__name__ for one in get_args(kinds) or (kinds,)]
    *first, last = [f"{'an' if one[0] in 'AEIO' else 'a'} {one}" for one in names]
    words = f"{', '.join(first)} or None" if first else last

    def check(_self: Any, _field: attrs.Attribute[Any], value: Any) -> None:
        if not isinstance(value, kinds):
            raise TypeError(f"{name} must be {words}, got {type(value).__name__}")

    return check


def with_choice(
    name: str, choices: Sequence[str]
) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    """Return the validator of a field that is one of some names."""

    def check(_self: Any, _field: attrs.Attribute[Any], value: Any) -> None:
        checks.one_of(name, value, choices)

    return check


def from_table(
    group: str, *others: Rule
) -> Callable[[type, list[attrs.Attribute[Any]]], list[attrs.Attribute[Any]]]:
    """Attach their rules to fields of a class, of a group and others.

    A field whose default is None may be left open. Docstrings without a section "Attributes" get
    one of the rules.
    """
    of_core = rules_of(group)
    rules = of_core | {rule.name: rule for rule in others}

    def transform(cls: type, fields: list[attrs.Attribute[Any]]) -> list[attrs.Attribute[Any]]:
        cls._group = group  # type: ignore[attr-defined]
        ruled(cls, {rule.name: rule.described for rule in of_core.values()})
        return [
            checked(one, rules[one.name].check, rule=rules[one.name]) if one.name in rules else one
            for one in fields
        ]

    return transform


class Printable:
    """Base of the parts: ``str()`` lists each field with its value, unit and meaning."""

    __slots__ = ()
    #: Of its numbers in the core's table; :func:`from_table` sets it.
    _group: ClassVar[str]

    def _to_core(self) -> tuple[Any, ...]:
        return self._group, numbers_of(self._group, self)

    def _rows(self) -> list[tuple[str, str, str]]:
        """Name, quantity and meaning of each field; of a part, those of its fields."""
        rows = []
        for field in attrs.fields(type(self)):  # type: ignore[arg-type]
            value, rule = getattr(self, field.name), field.metadata.get("rule")
            if rule is not None:
                rows.append((field.name, rule.quantity(value), rule.text))
            elif isinstance(value, str):
                rows.append((field.name, value, ""))
            elif value is not None:
                rows += [(f"{field.name}.{name}", *others) for name, *others in value._rows()]
        return rows

    def __str__(self) -> str:
        return "\n".join([type(self).__name__, *columns(self._rows(), "<")])
