"""The drives of hard scenes and their loads, as ``hard.toml`` has them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...drive.parameters import parse
from ...drive.scene import SCENE_FIELDS, Scene

_HERE = Path(__file__).parent


@cache
def tables() -> dict[str, Any]:
    """Read the tables of ``hard.toml``: a table for each family, [holds] and [like]."""
    return tomllib.loads((_HERE / "hard.toml").read_text(encoding="utf-8"))


def made(row: Mapping[str, Any]) -> Scene:
    """Make the scene of a row."""
    whole = _with_like(row)
    document = deepcopy({field: whole[field] for field in SCENE_FIELDS if field in whole})
    if isinstance(document["torque"], str):
        document["torque"] = [_TORQUES[document["torque"]]()]
    for name, value in row.get("changes", {}).items():
        _put(document, parse(name), value)
    return Scene._from_document(document)


def _with_like(row: Mapping[str, Any]) -> Mapping[str, Any]:
    if "like" not in row:
        return row
    name, others = row["like"], tables()["like"]
    file = _HERE.parent / "drives" / f"{name}.toml"
    other = others[name] if name in others else tomllib.loads(file.read_text(encoding="utf-8"))
    return {**_with_like(other), **row}


def _put(table: Any, path: tuple[str | int, ...], value: Any) -> None:
    step, *rest = path
    for key in range(len(table)) if step == "*" else [step]:
        if rest:
            _put(table[key], tuple(rest), value)
        else:
            table[key] = value


def _reversing() -> dict[str, Any]:
    """Torques that turn over every 20 us, faster than the contact's own vibration."""
    t = [2e-5 * (k // 2) for k in range(1, 501)]
    values = [-40.0 * (-1.0) ** (k // 2) for k in range(500)]
    return {"kind": "piecewise_linear", "pulley": 0, "t": t, "values": values}


def _noise() -> dict[str, Any]:
    """Set a torque that jumps anywhere within 20 N m every 10 us."""
    values = np.random.default_rng(26).uniform(-20.0, 20.0, 1000)
    t = np.repeat(1e-5 * np.arange(1001), 2)[1:-1]
    return {"kind": "piecewise_linear", "pulley": 0, "t": t, "values": np.repeat(values, 2)}


_TORQUES = {"reversing": _reversing, "noise": _noise}
