"""Results as files; whatever is read is checked against the parameters in the file."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import Any, TypeVar

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base import npz, plain
from ..base.run_warnings import RunWarning
from ..drive.params import Params
from ..outputs.accuracy_report import WORDS, Accuracy
from ..outputs.histories import GROUPS, Stats, grouped, kept
from ..outputs.quantity import LEDGER, QUANTITIES, SPANS
from ..outputs.selection import chosen
from ..outputs.state import PARTS, SIZES, State
from .exported import RESULTS

_T = TypeVar("_T")

#: Raised whenever older files could be misread.
_FORMAT = 4
_STATUS = ("finished", "failed", "interrupted")
_FINAL = {f"final_state.{name}": name for name in SIZES}
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
#: The entries of what describes a run, and those that earlier versions did not write: without an
#: accuracy, results have what is known of any run.
_META: dict[str, Any] = {
    "format": int,
    "final_t": float,
    "effects": tuple[str, ...],
    "success": bool,
    "status": str,
    "message": str,
    "stats": Stats,
    "warnings": tuple[RunWarning, ...],
    "accuracy": Accuracy,
    "outputs": tuple[str, ...] | None,
    "prescribed": tuple[str, ...],
    "unchecked": tuple[str, ...],
}
_LATER = ("accuracy", "outputs", "prescribed", "unchecked")
_ALL = {
    "t",
    "meta.json",
    "params.toml",
    SPANS,
    *_FINAL,
    *(f"{group}.{name}" for group, kind in GROUPS.items() for name in kind.array_names()),
}


def write(run: Any, path: str | os.PathLike[str]) -> None:
    """Write a :class:`beltdyn.Result`; see its ``save``."""
    final, spans = run.final_state, run._sampled_spans
    described = {name: getattr(run, name) for name in _META if name not in ("format", "final_t")}
    meta = {"format": _FORMAT, "version": _core.__version__, "final_t": final.t, **described}
    values = {
        "t": run.t,
        **run._histories(),
        **({} if spans is None else {SPANS: spans}),
        **{saved: getattr(final, name) for saved, name in _FINAL.items()},
        "meta.json": json.dumps(meta, default=attrs.asdict),
        "params.toml": run.params.to_toml(),
    }
    npz.write(path, values)


def read(path: str | os.PathLike[str], build: Callable[[dict[str, Any]], _T]) -> _T:
    """Build a :class:`beltdyn.Result` from its checked fields; see its ``load``."""
    try:
        return npz.read(path, "Result", _ALL, lambda values: build(_fields(values)))
    except ValueError as error:
        if os.path.splitext(path)[1].lower() in (*RESULTS,)[1:]:
            raise ValueError(f"{error}; of the files that save writes only .npz is read") from None
        raise


def _meta(value: NDArray[Any]) -> dict[str, Any]:
    """Return the checked description of the run."""
    found = plain.parse("meta.json", npz.text("meta.json", value))
    form = found.get("format", _FORMAT)  # that it is missing is said below
    if type(form) is not int or form != _FORMAT:
        raise ValueError(f"its format is {form!r:.20}, this version reads {_FORMAT}")
    kinds = {name: kind for name, kind in _META.items() if name in found or name not in _LATER}
    found = {name: one for name, one in found.items() if name in kinds}
    meta: dict[str, Any] = plain.table(kinds, "meta.json", found, prefix="")
    status, success, outputs = meta["status"], meta["success"], meta.get("outputs")
    rule = f"one of {', '.join(_STATUS)}"
    plain.check(status in _STATUS, "status", rule, status)
    rule = f"that of a run that {status}"
    plain.check(success == (status == "finished"), "success", rule, success)
    try:
        in_order = outputs is None or chosen(outputs, ledger=True) == outputs
    except ValueError as error:
        raise ValueError(f"outputs: {error}") from None
    plain.check(in_order, "outputs", "names of arrays in order", outputs)
    if "accuracy" in meta and [one.quantity for one in meta["accuracy"].errors] != list(WORDS):
        raise ValueError(f"accuracy.errors must be those of {', '.join(WORDS)}")
    del meta["format"]
    return meta


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

    outputs, ledger = meta.get("outputs"), any(name.startswith(f"{LEDGER}.") for name in values)
    asked = {
        name: shape
        for name, shape in kept(outputs, params).items()
        if ledger or outputs is not None or not name.startswith(f"{LEDGER}.")
    }
    arrays = {}
    for name, shape in asked.items():
        row, kind = QUANTITIES[name], np.int32 if name == "contact.pulley" else np.float64
        array = arrays[name] = npz.number_array(name, values[name], kind, (t.size, *shape))
        beyond = name in _MAY_OVERFLOW or row.size in PARTS or row.group == LEDGER
        unknown = name == SPANS or (beyond and not meta["success"])
        if not unknown and not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite")
    for name in sorted(values.keys() & QUANTITIES.keys() - asked.keys()):
        there = name == SPANS or name in kept(None, params)
        why = "it was not asked for" if there else "the drive has nothing of the kind"
        raise ValueError(f"{name} does not belong there: {why}")
    spans = arrays.pop(SPANS, None)
    touched = arrays.get("contact.pulley", np.zeros(0))
    if touched.size and not -1 <= touched.min() <= touched.max() < n_p:
        raise ValueError(f"contact.pulley must be from -1 to {n_p - 1}")
    final = State._of_file(values, "final_state.", params._model.sizes, t=meta.pop("final_t"))
    groups = grouped(arrays, outputs, params) | {"sampled_spans": spans}
    return {"t": t, **groups, "params": params, "final_state": final, **meta}
