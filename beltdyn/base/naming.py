"""Names of pulleys: their rule, how they are looked up, and as texts and figures write them.

All here goes by the names of a drive, :attr:`beltdyn.Params.pulley_names`: the name of each pulley,
or "pulley 3" of one that has none. No pulley can be given such a name, so they all differ.
"""

from __future__ import annotations

import numbers
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias, TypeVar

import numpy as np

from .checks import close_to, integer, shown

_T = TypeVar("_T")
#: A pulley, called by its index or its name.
PulleyLike: TypeAlias = int | str
#: Something by pulley, each called by its index or its name.
ByPulley: TypeAlias = Mapping[int, _T] | Mapping[str, _T] | Mapping[int | str, _T]

#: Of a name [bytes of UTF-8].
LONGEST = 31
#: What pulleys are called that have no name, and keys of TOML tables.
_RESERVED = re.compile(r"(pulley )?[0-9]+")


def as_name(value: object) -> str | None:
    """Check the name of a pulley; None for none."""
    if value is None:
        return None
    rule = f"pulley.name must be a printable text of 1 to {LONGEST} bytes of UTF-8"
    if not isinstance(value, str):
        raise TypeError(f"{rule}, got {shown(value)}")
    if not value.isprintable() or not 1 <= len(value.encode()) <= LONGEST:
        raise ValueError(f"{rule}, got {shown(str(value))}")
    if value != value.strip():
        raise ValueError(f"pulley.name must not begin or end with a space, got {value!r}")
    if _RESERVED.fullmatch(value):
        raise ValueError(
            "pulley.name must not be a number, alone or after the word pulley, which stands for "
            f"pulleys without a name, got {value!r}"
        )
    return str(value)


def names_of(names: Iterable[str | None]) -> tuple[str, ...]:
    """Return the names of a drive's pulleys, "pulley 3" if one has none."""
    found: list[str] = []
    for k, name in enumerate(names):
        if name in found:
            raise ValueError(
                f"pulleys[{found.index(name)}].name and pulleys[{k}].name must differ, both are "
                f'"{name}"'
            )
        found.append(_unnamed(k) if name is None else name)
    return tuple(found)


def index_of(field: str, pulley: object, names: Sequence[str]) -> int:
    """Find a pulley by its name or its index."""
    if not isinstance(pulley, str) or pulley.isdecimal():
        return integer(f"{field} index", pulley, 0, len(names) - 1)
    if pulley not in names:
        raise ValueError(
            f"{field}: no pulley is called {shown(str(pulley))}{close_to(pulley, names)}; there "
            f"are {', '.join(names)}"
        )
    return names.index(pulley)


def as_pulley(field: str, value: object) -> PulleyLike:
    """Check a reference to a pulley before its drive is known: an index >= 0, or a name."""
    if isinstance(value, str) and not value.isdecimal():
        return str(value)
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{field} must be a pulley's index or its name, got {shown(value)}")
    return integer(field, value, 0)


def by_index(field: str, values: ByPulley[_T], names: Sequence[str]) -> dict[int, _T]:
    """Return values given by names or indices of pulleys, by index."""
    found: dict[int, _T] = {}
    for key, value in values.items():
        index = index_of(field, key, names)
        if index in found:
            raise ValueError(f"{field} has {label(index, names)} twice, by name and by index")
        found[index] = value
    return found


def label(pulley: int | str, names: Sequence[str]) -> str:
    """Return the name of a pulley in texts: pulley "crank", or pulley 3 if it has no name.

    It may be given by its name; of an index without a name in ``names`` the name is not known.
    """
    if not isinstance(pulley, str):
        pulley = names[pulley] if 0 <= pulley < len(names) else _unnamed(pulley)
    return pulley if _RESERVED.fullmatch(pulley) else f'pulley "{pulley}"'


def key(pulley: int, names: Sequence[str]) -> str:
    """Return the key of a pulley in the path of an argument, omega['crank'] or omega[3]."""
    return repr(names[pulley]) if _is_named(pulley, names) else str(pulley)


def labels(one: int, other: int, names: Sequence[str]) -> str:
    """Return the names of two pulleys in texts: pulleys 0 and 3, or pulley "crank" and pulley 3."""
    if _is_named(one, names) or _is_named(other, names):
        return f"{label(one, names)} and {label(other, names)}"
    return f"pulleys {one} and {other}"


def span_names(names: Sequence[str]) -> list[str]:
    """Return the names of all spans, "crank to pulley 3"."""
    return [f"{name} to {names[(k + 1) % len(names)]}" for k, name in enumerate(names)]


def with_names(values: Iterable[str], names: Iterable[str]) -> str:
    """List values, each after the name of its pulley."""
    return ", ".join(f"{name}: {value}" for name, value in zip(names, values, strict=True))


def _unnamed(pulley: int) -> str:
    return f"pulley {pulley}"


def _is_named(pulley: int, names: Sequence[str]) -> bool:
    return names[pulley] != _unnamed(pulley)
