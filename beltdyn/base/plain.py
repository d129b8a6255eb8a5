"""Values written as JSON, and read from it, checked by the annotations of what they stand for."""

from __future__ import annotations

import base64
import json
import math
import sys
from collections.abc import Mapping
from types import NoneType, UnionType
from typing import Annotated, Any, get_args, get_origin

import attrs
import numpy as np

from .checks import Array

#: What a value of a kind is called, and what JSON has for it.
_PLAIN: dict[Any, tuple[str, Any]] = {
    str: ("a text", str),
    bool: ("true or false", bool),
    int: ("a count", int),
    float: ("a finite number", (int, float)),
    list: ("a list", list),
}


#: What JSON has for an array of numbers.
_NUMBERS = {"shape": tuple[int, ...], "float64": str}


def written(values: Mapping[str, Any]) -> str:
    """Write a table, its arrays and the objects of attrs in it as :func:`table` reads them."""

    def plain(value: Any) -> Any:
        if attrs.has(type(value)):
            return attrs.asdict(value, recurse=False)
        content = base64.b64encode(np.asarray(value, "<f8").tobytes())
        return {"shape": np.shape(value), "float64": content.decode()}

    return json.dumps(values, default=plain)


def parse(name: str, text: str | bytes) -> dict[str, Any]:
    """Return the table that a text holds."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{name} is not valid JSON: {error}") from None
    check(isinstance(found, dict), name, "a table", found)
    return dict(found)


def check(good: bool, name: str, rule: str, value: object) -> None:
    """Raise ValueError unless a value is good."""
    if not good:
        raise ValueError(f"{name} must be {rule}, got {type(value).__name__} {value!r:.60}")


def table(kinds: Mapping[str, Any], name: str, value: Any, prefix: str | None = None) -> Any:
    """Return the values of a table that has exactly these entries, each as its annotation says.

    Messages call an entry by ``prefix`` and its name, by that of the table where it is None.
    """
    check(isinstance(value, dict), name, "a table", value)
    if unknown := set(value) - set(kinds):
        raise ValueError(f"{name} holds {min(unknown)!r}, which does not belong there")
    for key in kinds:
        if key not in value:
            raise ValueError(f"{name}.{key} is missing")
    prefix = f"{name}." if prefix is None else prefix
    return {key: _built(kind, f"{prefix}{key}", value[key]) for key, kind in kinds.items()}


def _numbers(name: str, value: Any) -> Array:
    given = table(_NUMBERS, name, value)
    content, shape = base64.b64decode(given["float64"], validate=True), given["shape"]
    if len(content) != 8 * math.prod(shape):
        raise ValueError(f"{name} has {len(content)} bytes, which are not those of {shape}")
    return np.frombuffer(content, "<f8").astype(np.float64).reshape(shape)


def _built(kind: Any, name: str, value: Any) -> Any:
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) is np.ndarray:
        return _numbers(name, value)
    if isinstance(kind, UnionType):
        [kind] = (one for one in get_args(kind) if one is not NoneType)
        return None if value is None else _built(kind, name, value)
    if get_origin(kind) is tuple:
        kind = get_args(kind)[0]
        listed = _built(list, name, value)
        return tuple(_built(kind, f"{name}[{k}]", one) for k, one in enumerate(listed))
    if attrs.has(kind):
        fields = attrs.fields(attrs.resolve_types(kind))
        return kind(**table({field.name: field.type for field in fields}, name, value))
    rule, types = _PLAIN[kind]
    good = isinstance(value, types) and (kind is bool or not isinstance(value, bool))
    if kind is int:
        good = good and 0 <= value < 2**63
    if kind is float:
        good = good and abs(value) <= sys.float_info.max
    check(good, name, rule, value)
    if kind is str and any("\ud800" <= character <= "\udfff" for character in value):
        raise ValueError(f"{name} holds invalid characters")
    return kind(value)
