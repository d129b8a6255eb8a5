"""Reading and writing TOML: tables and the classes they stand for.

Errors name the path of the field. The documents of a drive and of a scene are put together in
:mod:`beltdyn.drive.params` and :mod:`beltdyn.scenes`, which use this module. cattrs and tomli-w are
imported on first use, so that ``import beltdyn`` takes little time.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Mapping
from functools import cache, partial
from operator import eq
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast, get_args, get_origin

import attrs
import numpy as np

from ..base import files
from ..base.checks import Array, close_to, shown, unknown_field
from ..base.naming import PulleyLike
from ..loads.loads import Harmonics, Load, Motor, Ramp, SpeedTable, Step
from ..loads.motions import AngleTable, CrankMotion
from ..loads.torques import PiecewiseLinear, Torque, Viscous
from .couplings import Coupling
from .friction import LAWS, Friction, Frictionless
from .mounts import Mount, Stops
from .tensioning import Offsets

_T = TypeVar("_T")

_FRICTION: dict[str, type] = {Frictionless.law: Frictionless, **LAWS}
_TORQUES: dict[str, type] = {
    "piecewise_linear": PiecewiseLinear,
    "viscous": Viscous,
    "load": Load,
    "speed_table": SpeedTable,
    "motor": Motor,
    "harmonics": Harmonics,
    "step": Step,
    "ramp": Ramp,
}
_MOTIONS: dict[str, type] = {
    "piecewise_linear": PiecewiseLinear,
    "crank": CrankMotion,
    "angle_table": AngleTable,
}
#: What a motion can be in a file.
FileMotion: TypeAlias = PiecewiseLinear | CrankMotion | AngleTable
#: Tables that say what they are by `kind`: what a field of them is declared as, the classes, and
#: that which is meant without.
_BY_KIND: tuple[tuple[Any, dict[str, type], str | None], ...] = (
    (Friction | None, _FRICTION, "dahl"),
    (Mount | None, {cls._row.name: cls for cls in get_args(Mount)}, None),
    (Coupling | None, {cls._group: cls for cls in get_args(Coupling)}, None),
    (Torque, _TORQUES, None),
    (FileMotion, _MOTIONS, None),
)
_KIND_OF = {cls: kind for _, kinds, _ in _BY_KIND for kind, cls in kinds.items()}
#: Fields of a scene besides the tables of its drive.
SCENE_ONLY = ("t_end", "torque")

Source = str | os.PathLike[str]

_ARRAY = "must be an array of tables"
_PLAIN = (
    Array,
    tuple[float, ...],
    tuple[float, float],
    tuple[float, float] | None,
    Offsets,
    Stops,
    int | None,
    float | None,
    bool | None,
    PulleyLike,
    PulleyLike | None,
)


def _table(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"must be a table, got {shown(value)}")
    return value


def _is_list_of_tables(kind: Any) -> bool:
    return get_origin(kind) is tuple and (
        attrs.has(get_args(kind)[0]) or get_args(kind)[0] is Torque
    )


@cache
def _converter() -> Any:
    import cattrs
    from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn

    converter = cattrs.Converter(forbid_extra_keys=True)

    def by_kind(kinds: Mapping[str, type], default: str | None) -> Callable[[Any, Any], Any]:
        def structure(value: Any, _kind: Any) -> Any:
            fields = dict(_table(value))
            kind = fields.pop("kind", default)
            known = {field.name for field in attrs.fields(kinds[default])} if default else set()
            if "kind" not in _table(value) and fields and not known & set(fields):
                kind = None  # of another kind than that which is meant without
            if "law" in fields and kinds is _FRICTION:
                raise ValueError("this.law: unknown field (did you mean 'kind'?)")
            if not isinstance(kind, str) or kind not in kinds:
                got = "it is missing" if kind is None else f"got {shown(kind)}"
                got += close_to(kind, kinds) if isinstance(kind, str) else ""
                raise ValueError(f"this.kind must be one of {', '.join(kinds)}, {got}")
            return converter.structure(fields, kinds[kind])

        return structure

    def table_of(cls: Any) -> Callable[[Any, Any], Any]:
        structure: Any = make_dict_structure_fn(cls, converter, _cattrs_forbid_extra_keys=True)
        return lambda value, kind: structure(_table(value), kind)

    def filled(cls: Any) -> Callable[[Any], dict[str, Any]]:
        """Leave out what is None; say which kind a part of a drive is."""
        fields: Any = make_dict_unstructure_fn(cls, converter)
        kind = {"kind": _KIND_OF[cls]} if issubclass(cls, (Friction, Mount, Coupling)) else {}

        def unstructure(value: Any) -> dict[str, Any]:
            return kind | {name: one for name, one in fields(value).items() if one is not None}

        return unstructure

    def list_of(value: Any, kind: Any) -> Any:
        if not isinstance(value, list):
            raise ValueError(_ARRAY)
        element: Any = get_args(kind)[0]
        return converter.structure(value, cast(Any, list[element]))

    # Plain values pass unchanged: the classes check them against their rules.
    for kind in (bool, float, int, str):
        converter.register_structure_hook(kind, lambda value, _kind: value)
    converter.register_structure_hook_func(
        lambda kind: kind in _PLAIN,
        lambda value, _kind: value,
    )
    converter.register_structure_hook_factory(attrs.has, table_of)
    converter.register_structure_hook_func(_is_list_of_tables, list_of)
    for declared, kinds, default in _BY_KIND:
        converter.register_structure_hook_func(partial(eq, declared), by_kind(kinds, default))
    # Also a field of others, which may take a number in its place, or refuse it.
    of_table = table_of(PiecewiseLinear)
    converter.register_structure_hook_func(
        lambda kind: kind is PiecewiseLinear,
        lambda value, kind: of_table(value, kind) if isinstance(value, dict) else value,
    )
    converter.register_unstructure_hook_factory(attrs.has, filled)
    converter.register_unstructure_hook_func(lambda kind: kind is Friction, converter.unstructure)
    converter.register_unstructure_hook_func(lambda kind: kind == Array, np.ndarray.tolist)
    converter.register_unstructure_hook(PiecewiseLinear, _history_table)
    return converter


def _history_table(value: PiecewiseLinear) -> dict[str, Any]:
    one = value.values.shape[1] == 1
    pulley = {} if value.pulley is None else {"pulley": value.pulley}
    values = value.values[:, 0] if one else value.values
    return {"t": value.t.tolist(), "values": values.tolist(), **pulley}


def _join(path: str, field: str) -> str:
    return f"{path}.{field}" if path else field


def _explain(error: BaseException, path: str) -> str:
    """Describe the first error, in one line that names the path of the field."""
    from cattrs.errors import (
        ClassValidationError,
        ForbiddenExtraKeysError,
        IterableValidationError,
    )

    if isinstance(error, (ClassValidationError, IterableValidationError)):
        noted, others = error.group_exceptions()
        # Unknown fields first: a misspelt field is reported as a missing one, too.
        if others:
            return _explain(others[0], path)
        inner, note = noted[0]
        if isinstance(error, IterableValidationError):
            return _explain(inner, f"{path}[{cast(Any, note).index}]")
        return _explain(inner, _join(path, cast(Any, note).name))
    if isinstance(error, ForbiddenExtraKeysError):
        field = min(error.extra_fields)
        known = [one.name for one in attrs.fields(error.cl)]
        return f"{_join(path, field)}: {unknown_field(field, known)}"
    if isinstance(error, KeyError):
        return f"{path}: missing"
    message = str(error)
    # Messages of the classes begin with their name ("pulley.radius must ..."), which the more
    # precise path replaces.
    own = re.match(r"[A-Za-z_]+\.(?=\w)", message)
    if not path:
        return message
    if own:
        return _join(path, message[own.end() :])
    if message == _ARRAY:
        name = re.sub(r"\[.*?\]", "", path)
        message = f"{message}, [[{name}]]"
    return f"{path}: {message}"


def structure(value: Any, kind: Any, path: str = "") -> Any:
    """Build a class, or a tuple of them, from plain tables."""
    from cattrs import BaseValidationError

    try:
        return _converter().structure(value, kind)
    except (BaseValidationError, KeyError, TypeError, ValueError) as error:
        raise ValueError(_explain(error, path)) from None
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _document(source: Source) -> tuple[dict[str, Any], str]:
    """Parse; also return the prefix of error messages: the name of the file, if there is one."""
    if isinstance(source, str) and "\n" in source:
        text, prefix = source, ""
    else:
        path = Path(source)
        prefix = f"{path}: "
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            raise ValueError(f"{prefix}not a text file in UTF-8") from None
    try:
        return tomllib.loads(text), prefix
    except RecursionError:
        raise ValueError(f"{prefix}not valid TOML for a drive: nested too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or numbers and dates that Python cannot hold
        raise ValueError(f"{prefix}not valid TOML: {error}") from None


def read(source: Source, build: Callable[[dict[str, Any]], _T]) -> _T:
    """Read a document and build from it; errors begin with the file's name, if there is one."""
    document, prefix = _document(source)
    try:
        return build(document)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{prefix}{error}") from None


def unstructure(value: Any) -> Any:
    """Turn an object of these classes into plain tables; a torque or motion with its kind."""
    kind = _KIND_OF.get(type(value))
    return ({"kind": kind} if kind else {}) | _converter().unstructure(value)


def write(document: dict[str, Any], path: Source | None) -> str:
    """Return the document as text, also written to ``path`` if given."""
    import tomli_w

    text = tomli_w.dumps(document)
    # tomli-w writes one number a line; rows of numbers read better.
    text = re.sub(
        r"\[\n(?:\s*[-+.\deE]+,\n)+\s*\]",
        lambda rows: re.sub(r",\s*\]", "]", re.sub(r"\s+", " ", rows[0]).replace("[ ", "[")),
        text,
    )
    if path is not None:
        files.write_bytes(path, text.encode())
    return text
