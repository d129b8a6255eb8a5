"""Results as files; whatever is read is checked against the parameters in the file."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base import npz
from ..base.run_warnings import RunWarning
from ..drive.params import Params
from ..outputs.accuracy_report import WORDS, Accuracy, QuantityError
from ..outputs.histories import GROUPS, Stats, absent_groups, shape_of
from ..outputs.quantity import LEDGER, QUANTITIES, SPANS
from ..outputs.selection import chosen, lacking
from ..outputs.state import PARTS, State, from_file
from .exported import RESULTS

__all__ = ["read", "write"]

_T = TypeVar("_T")

#: Raised whenever older files could be misread.
_FORMAT = 4
_STATUS = ("finished", "failed", "interrupted")
_FINAL = {f"final_state.{name}": size for name, size, *_ in _core.STATE_FIELDS}
#: A step is accepted only if the state after it is finite, but before a run fails the forces and
#: energies of such a state may exceed the range of floats. The state itself is always finite.
_MAY_OVERFLOW = {
    "pulleys.torque",
    "pulleys.load",
    "joints.deformation",
    "joints.force",
    "contact.normal",
    "contact.friction",
    "contact.velocity",
}


_ALL = {
    "t",
    "meta.json",
    "params.toml",
    SPANS,
    *_FINAL,
    *(f"{group}.{name}" for group, kind in GROUPS.items() for name in kind.array_names()),
}


def write(result: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write the fields of a :class:`beltdyn.Result`; see its ``save``."""
    final = result["final_state"]
    meta = {
        "format": _FORMAT,
        "version": _core.__version__,
        "final_t": final.t,
        **{name: result[name] for name in ("effects", "success", "status", "message")},
        "stats": attrs.asdict(result["stats"]),
        "warnings": [attrs.asdict(one) for one in result["warnings"]],
        "accuracy": attrs.asdict(result["accuracy"]),
        **{name: result[name] for name in ("outputs", "unchecked", "prescribed")},
    }
    values: dict[str, Any] = {"t": result["t"]}
    for group in GROUPS:
        if result[group] is not None:
            arrays = result[group].arrays()
            values |= {f"{group}.{name}": array for name, array in arrays.items()}
    if result["sampled_spans"] is not None:
        values[SPANS] = result["sampled_spans"]
    values |= {f"final_state.{name}": getattr(final, name) for name, *_ in _core.STATE_FIELDS}
    values |= {"meta.json": json.dumps(meta), "params.toml": result["params"].to_toml()}
    npz.write(path, values)


def read(path: str | os.PathLike[str], build: Callable[[dict[str, Any]], _T]) -> _T:
    """Build a :class:`beltdyn.Result` from its checked fields; see its ``load``."""
    try:
        return npz.read(path, "Result", _ALL, lambda values: build(_fields(values)))
    except ValueError as error:
        if os.path.splitext(path)[1].lower() in (*RESULTS,)[1:]:
            raise ValueError(f"{error}; of the files that save writes only .npz is read") from None
        raise


# --- what describes the run ----------------------------------------------------------------------


def _must(good: bool, name: str, rule: str, value: object) -> None:
    if not good:
        raise ValueError(f"{name} must be {rule}, got {type(value).__name__} {value!r:.60}")


def _text(name: str, value: Any) -> str:
    _must(isinstance(value, str), name, "a text", value)
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise ValueError(f"{name} holds invalid characters")
    return str(value)


def _bool(name: str, value: Any) -> bool:
    _must(isinstance(value, bool), name, "true or false", value)
    return bool(value)


def _count(name: str, value: Any) -> int:
    good = isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63
    _must(good, name, "a count", value)
    return int(value)


def _number(name: str, value: Any) -> float:
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    _must(good and abs(value) <= sys.float_info.max, name, "a finite number", value)
    return float(value)


def _number_or_none(name: str, value: Any) -> float | None:
    return None if value is None else _number(name, value)


#: By what the fields of Stats, RunWarning and QuantityError are declared as.
_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "str": _text,
    "bool": _bool,
    "int": _count,
    "float": _number,
    "float | None": _number_or_none,
}


def _record(cls: type, name: str, value: Any, **checks: Callable[[str, Any], Any]) -> Any:
    """Build an attrs class from a table that has exactly its fields.

    Those of plain values are checked as they are declared, the others by ``checks``.
    """
    _must(isinstance(value, dict), name, "a table", value)
    fields = attrs.fields(cls)
    unknown = set(value) - {field.name for field in fields}
    if unknown:
        raise ValueError(f"{name} holds {min(unknown)!r}, which does not belong there")
    built = {}
    for field in fields:
        check = checks.get(field.name) or _CHECKS[str(field.type)]
        built[field.name] = check(f"{name}.{field.name}", _entry(value, field.name, name))
    return cls(**built)


def _texts(name: str, value: Any) -> tuple[str, ...]:
    return tuple(_text(name, one) for one in _list(name, value))


def _outputs(name: str, value: Any) -> tuple[str, ...] | None:
    if value is None:
        return None
    names = _texts(name, value)
    try:
        _must(chosen(names, ledger=True) == names, name, "names of arrays in order", value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    return names


def _accuracy(name: str, value: Any) -> Accuracy:
    def errors(name: str, value: Any) -> tuple[QuantityError, ...]:
        return tuple(
            _record(QuantityError, f"{name}[{k}]", one) for k, one in enumerate(_list(name, value))
        )

    found: Accuracy = _record(Accuracy, name, value, errors=errors, runs=_texts, notes=_texts)
    if [one.quantity for one in found.errors] != list(WORDS):
        raise ValueError(f"{name}.errors must be those of {', '.join(WORDS)}")
    return found


def _entry(table: Mapping[str, Any], key: str, name: str) -> Any:
    if key not in table:
        raise ValueError(f"{name}.{key} is missing")
    return table[key]


def _list(name: str, value: Any) -> list[Any]:
    _must(isinstance(value, list), name, "a list", value)
    return list(value)


def _meta(value: NDArray[Any]) -> dict[str, Any]:
    """Return the checked description of the run."""
    content = npz.text("meta.json", value)
    try:
        table = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"meta.json is not valid JSON: {error}") from None
    _must(isinstance(table, dict), "meta.json", "a table", table)

    def entry(key: str) -> Any:
        return _entry(table, key, "meta.json")

    found = entry("format")
    if type(found) is not int or found != _FORMAT:
        raise ValueError(f"its format is {found!r:.20}, this version reads {_FORMAT}")
    status, success = _text("status", entry("status")), _bool("success", entry("success"))
    _must(status in _STATUS, "status", f"one of {', '.join(_STATUS)}", status)
    _must(success == (status == "finished"), "success", f"that of a run that {status}", success)
    return {
        "final_t": _number("final_t", entry("final_t")),
        "effects": _texts("effects", entry("effects")),
        "success": success,
        "status": status,
        "message": _text("message", entry("message")),
        "stats": _record(Stats, "stats", entry("stats")),
        "warnings": tuple(
            _record(RunWarning, f"warnings[{k}]", one)
            for k, one in enumerate(_list("warnings", entry("warnings")))
        ),
        # Not in the files of earlier versions, whose results then have what is known of any run.
        **({"accuracy": _accuracy("accuracy", table["accuracy"])} if "accuracy" in table else {}),
        "outputs": _outputs("outputs", table.get("outputs")),
        "prescribed": _texts("prescribed", table.get("prescribed", [])),
        "unchecked": _texts("unchecked", table.get("unchecked", [])),
    }


# --- all of it -----------------------------------------------------------------------------------


def _fields(values: dict[str, NDArray[Any]]) -> dict[str, Any]:
    meta = _meta(values["meta.json"])
    try:
        # With a line break it is always read as text, never as the path of another file.
        params = Params.from_toml(npz.text("params.toml", values["params.toml"]) + "\n")
    except (TypeError, ValueError) as error:
        raise ValueError(f"params.toml: {error}") from None
    n_p = len(params.pulleys)
    t = npz.number_array("t", values["t"], np.float64, (values["t"].size,))
    if not np.isfinite(t).all() or (np.diff(t) < 0.0).any():
        raise ValueError("t must be finite and non-decreasing")

    without = {f"energy.{name}" for name, *_ in _core.ENERGY_TERMS}
    without -= {f"energy.{name}" for name in params._model.energy_terms}
    without |= lacking(params)
    for name in sorted(without & values.keys()):
        raise ValueError(f"{name} does not belong there: the drive has nothing of the kind")
    kept = meta["outputs"]
    with_energy = any(name.startswith("energy.") for name in values) if kept is None else True
    left_out = ({"energy"} if not with_energy else set()) | absent_groups(params)
    sizes = params._model.sizes

    def history(group: str) -> dict[str, NDArray[Any]]:
        arrays = {}
        for field in GROUPS[group].array_names():
            name = f"{group}.{field}"
            asked = group if group == LEDGER else name
            if name in without or not (kept is None or asked in kept):
                if name in values:
                    raise ValueError(f"{name} does not belong there: it was not asked for")
                continue
            kind = np.int32 if name == "contact.pulley" else np.float64
            size = QUANTITIES[name].size
            shape = (t.size, *(() if group == LEDGER else shape_of(size, params)))
            arrays[field] = npz.number_array(name, values[name], kind, shape)
            beyond = not meta["success"] and (
                name in _MAY_OVERFLOW or size in PARTS or group == LEDGER
            )
            if not beyond and not np.isfinite(arrays[field]).all():
                raise ValueError(f"{name} must be finite")
        return arrays

    arrays = {name: history(name) for name in GROUPS if name not in left_out}
    touched = arrays["contact"].get("pulley", np.zeros(0))
    if touched.size and not -1 <= touched.min() <= touched.max() < n_p:
        raise ValueError(f"contact.pulley must be from -1 to {n_p - 1}")
    final: dict[str, Any] = {"t": meta.pop("final_t")}
    for name, size in _FINAL.items():
        if size in PARTS and sizes[size] == 0 and name not in values:
            continue  # files of earlier versions
        field = name.removeprefix("final_state.")
        final[field] = from_file(name, size, values[name], sizes.get(size))
    groups: dict[str, Any] = dict.fromkeys(GROUPS)
    for name, found in arrays.items():
        whole = name == LEDGER and (kept is None or LEDGER in kept)
        groups[name] = GROUPS[name](**found) if whole else GROUPS[name]._holding(found)
    if kept is not None and SPANS in kept:
        per_span = (t.size, n_p)
        groups["sampled_spans"] = npz.number_array(SPANS, values[SPANS], np.float64, per_span)
    elif SPANS in values:
        raise ValueError(f"{SPANS} does not belong there: it was not asked for")
    return {"t": t, **groups, "params": params, "final_state": State(**final), **meta}
