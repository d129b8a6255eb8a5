"""Drives with names, for the tests of names."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import attrs

import beltdyn as bd

NAMES = ("crank", "Spannrolle 2 ö", "alternator")

#: Gives the pulleys names, or leaves them as they are.
Dress = Callable[[Any], Any]


def named(what: Any, names: tuple[str | None, ...] = NAMES) -> Any:
    """The same drive, or the same pulleys, with names."""
    if isinstance(what, bd.Params):
        return attrs.evolve(what, pulleys=named(what.pulleys, names))
    return tuple(attrs.evolve(pulley, name=names[k % len(names)]) for k, pulley in enumerate(what))


def as_it_is(what: Any) -> Any:
    return what


def with_names(text: str) -> str:
    """What a message about a drive without names must be with them."""

    def label(match: re.Match[str]) -> str:
        return f'pulley "{NAMES[int(match[1])]}"'

    text = re.sub(r"pulleys (\d) and (\d)", r"pulley \1 and pulley \2", text)
    return re.sub(r"pulleys?[ \[](\d)\]?", label, text)


def pulley(name: Any = None, **changes: Any) -> bd.Pulley:
    given = {"center": (0.0, 0.0), "radius": 0.1, "inertia": 0.01, "name": name}
    return bd.Pulley(**(given | changes))
