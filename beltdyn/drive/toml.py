"""Reading and writing TOML: tables and the classes they stand for.

Errors name the path of the field. The documents of a drive and of a scene are put together in
:mod:`beltdyn.drive.params` and :mod:`beltdyn.scenes`, which use this module. tomli-w is imported on
first use, so that ``import beltdyn`` takes little time.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Collection, Iterable
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

import attrs
import numpy as np

from ..base import files
from ..base.checks import close_to, shown, unknown_field
from ..loads.loads import Harmonics, Load, Motor, Ramp, SpeedTable, Step
from ..loads.motions import AngleTable, CrankMotion
from ..loads.torques import PiecewiseLinear, Torque, Viscous
from .couplings import Coupling
from .friction import LAWS, Friction, Frictionless
from .mounts import Mount

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


def table(path: str, value: object) -> dict[str, Any]:
    """Check a table; return a copy."""
    if not isinstance(value, dict):
        raise ValueError(f"{path}: must be a table, got {shown(value)}")
    return dict(value)


def tables(path: str, value: object) -> list[dict[str, Any]]:
    """Check an array of tables; return copies."""
    if not isinstance(value, list):
        name = re.sub(r"\[.*?\]", "", path)
        raise ValueError(f"{path}: must be an array of tables, [[{name}]]")
    return [table(f"{path}[{k}]", one) for k, one in enumerate(value)]


def check_fields(
    path: str, given: Iterable[str], known: Collection[str], needed: Iterable[str] = ()
) -> None:
    """Check the names of fields; unknown ones first: a misspelt field is a missing one, too."""
    for name in given:
        if name not in known:
            raise ValueError(f"{_join(path, name)}: {unknown_field(name, known)}")
    for name in needed:
        if name not in given:
            raise ValueError(f"{_join(path, name)}: missing")


def _join(path: str, field: str) -> str:
    return f"{path}.{field}" if path else field


@cache
def _kinds(cls: Any) -> dict[str, Any]:
    """Return by name what the fields of a class are declared as."""
    kinds = get_type_hints(cls)
    return {field.name: kinds[field.name] for field in attrs.fields(cls) if field.init}


def structure(value: Any, kind: Any, path: str = "") -> Any:
    """Build a class, or a tuple of them, from plain tables; classes check all other values."""
    for declared, kinds, usual in _BY_KIND:
        if kind == declared:
            return _of_kind(table(path, value), kinds, usual, path)
    some = [one for one in get_args(kind) or [kind] if attrs.has(one) or one is Torque]
    if not some or (some[0] is PiecewiseLinear and not isinstance(value, dict)):
        return value  # a number may stand in place of a history
    if get_origin(kind) is not tuple:
        return _built(some[0], table(path, value), path)
    whole = enumerate(tables(path, value))
    return tuple(structure(one, some[0], f"{path}[{k}]") for k, one in whole)


def _of_kind(fields: dict[str, Any], kinds: dict[str, type], usual: str | None, path: str) -> Any:
    """Build the class of a table's kind."""
    if "law" in fields and kinds is _FRICTION:
        raise ValueError(f"{path}.law: unknown field (did you mean 'kind'?)")
    if usual and fields and not fields.keys() & {"kind", *_kinds(kinds[usual])}:
        usual = None  # of another kind than that which is meant without
    kind = fields.pop("kind", usual)
    if not isinstance(kind, str) or kind not in kinds:
        got = "it is missing" if kind is None else f"got {shown(kind)}"
        got += close_to(kind, kinds) if isinstance(kind, str) else ""
        raise ValueError(f"{path}.kind must be one of {', '.join(kinds)}, {got}")
    return _built(kinds[kind], fields, path)


def _built(cls: Any, fields: dict[str, Any], path: str) -> Any:
    kinds = _kinds(cls)
    needed = [name for name in kinds if attrs.fields_dict(cls)[name].default is attrs.NOTHING]
    check_fields(path, fields, kinds, needed)
    given = {
        name: structure(fields[name], kinds[name], _join(path, name))
        for name in kinds
        if name in fields
    }
    try:
        return cls(**given)
    except (TypeError, ValueError) as error:
        message = str(error)
    # Messages of the classes begin with their name ("pulley.radius must ..."), which the more
    # precise path replaces.
    own = re.match(r"[A-Za-z_]+\.(?=\w)", message)
    if path:
        message = _join(path, message[own.end() :]) if own else f"{path}: {message}"
    raise ValueError(message)


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
            results = ", as results are, which Result.load reads" * (path.suffix == ".npz")
            raise ValueError(f"{prefix}not a text file in UTF-8{results}") from None
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
    """Turn an object of these classes into plain tables, with its kind where there are several."""
    if not attrs.has(type(value)):
        if isinstance(value, tuple):
            return [unstructure(one) for one in value]
        return value.tolist() if isinstance(value, np.ndarray) else value
    cls: Any = type(value)
    if isinstance(value, (Friction, Mount, Coupling, Torque)) and cls not in _KIND_OF:
        raise TypeError(f"{cls.__name__} is no class that TOML files know")
    found = {"kind": _KIND_OF[cls]} if cls in _KIND_OF else {}
    for name in _kinds(cls):
        if (one := unstructure(getattr(value, name))) is not None:
            found[name] = one
            if isinstance(getattr(value, name), PiecewiseLinear):
                del one["kind"]  # there is only one
    if isinstance(value, PiecewiseLinear) and value.values.shape[1] == 1:
        found["values"] = value.values[:, 0].tolist()
    return found


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
