"""Sweeps as TOML files, which ``beltdyn sweep`` runs.

A scene, what is changed in it, and what is measured::

    scene = "serpentine"            # a name, a file (seen from this one), or the tables of a scene
    measure = ["report.pulleys.margin", "span_tension.least"]
    last = 0.2

    [over]
    "torque.scale" = { from = 0.5, to = 1.5, count = 5 }
    "friction.mu_k" = [0.6, 0.8]

    [options]                       # of simulate
    rtol = 1e-3

In the place of [over], samples of parameters that scatter::

    [sample]
    n = 256
    method = "saltelli"
    ranges = { "friction.mu_k" = [0.6, 0.9], "belt.axial_stiffness" = { normal = [90e3, 4e3] } }
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import scenes
from ..base.checks import integer, one_of, real, shown
from ..base.optional import scipy_module
from ..drive import toml
from ..drive.friction import Friction
from ..drive.mounts import Mount
from ..drive.scene import Scene
from ..loads.torques import Torque, TorqueSum
from .sampling import sample

_FIELDS = ("scene", "measure", "last", "combine", "warm", "over", "sample", "options", "key")
_PASSED_ON = ("last", "combine", "warm", "key")
#: Distributions by name, and their classes in scipy.stats with what their two numbers are.
_DISTRIBUTIONS = {
    "uniform": "low and high",
    "normal": "mean and standard deviation",
    "lognormal": "median and standard deviation of the logarithm",
}


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the arguments of :func:`beltdyn.sweep` from a file."""
    folder = Path(path).parent
    found: dict[str, Any] = toml.read(path, lambda document: _built(document, folder))
    return found


def _built(document: dict[str, Any], folder: Path) -> dict[str, Any]:
    if "scene" not in document and "belt" in document:
        raise ValueError('this is a scene: name it in the file of a sweep, scene = "drive.toml"')
    _fields("", document, _FIELDS, 1)
    if ("over" in document) == ("sample" in document):
        raise ValueError("either over or sample must be given")
    scene = _scene(document["scene"], folder)
    if "over" in document:
        listed = toml.table("over", document["over"])
        over = {name: _values(name, one) for name, one in listed.items()}
    else:
        over = _samples(document["sample"])
    measure = document.get("measure")
    if measure is not None and not isinstance(measure, (str, list, dict)):
        raise ValueError(f"measure: must be names or a table of names, got {shown(measure)}")
    options = toml.table("options", document.get("options", {}))
    clash = set(options) & (set(_FIELDS) | {"executor", "store", "progress"})
    if clash:
        raise ValueError(f"options.{min(clash)}: is no option of simulate")
    others = {name: document[name] for name in _PASSED_ON if name in document}
    return {"scene": scene, "over": over, "measure": measure, **others, **options}


def _fields(path: str, value: object, known: Sequence[str], needed: int) -> dict[str, Any]:
    """Check a table of known fields, of which the first ones are needed."""
    table = toml.table(path, value)
    toml.check_fields(path, table, known, known[:needed])
    return table


def _scene(value: object, folder: Path) -> Scene:
    if isinstance(value, str):
        beside = folder / value
        return scenes.find(beside if value.endswith(".toml") or beside.is_file() else value)
    document = toml.table("scene", value)
    try:
        return Scene._from_document(document)
    except (TypeError, ValueError) as error:
        raise ValueError(f"scene.{error}") from None


def _values(name: str, value: Any) -> Any:
    """Return the values of a name: listed ones (tables: laws, mounts, loads), or a range."""
    if isinstance(value, list):
        return [_value(f"over.{name}[{k}]", name, one) for k, one in enumerate(value)]
    if not isinstance(value, dict):
        raise ValueError(
            f"over.{name}: must be a list of values, or a range {{ from = , to = , count = }}, "
            f"got {shown(value)}"
        )
    known = ("from", "to", "count", "spacing")
    for field, one in value.items():
        if field not in known and isinstance(one, (list, dict)):
            raise ValueError(f'over.{name}.{field}: names stand in quotes: "{name}.{field}" = ')
    fields = _fields(f"over.{name}", value, known, 3)
    low, high = (real(f"over.{name}.{field}", fields[field]) for field in ("from", "to"))
    count = integer(f"over.{name}.count", fields["count"], 1)
    spacing = one_of(f"over.{name}.spacing", fields.get("spacing", "even"), ("even", "geometric"))
    if spacing == "geometric":
        if not low * high > 0.0:
            raise ValueError(f"over.{name}: a geometric range must not reach or pass 0")
        return np.geomspace(low, high, count)
    return np.linspace(low, high, count)


def _value(path: str, name: str, value: Any) -> Any:
    last = name.rpartition(".")[2]
    if isinstance(value, dict):
        kinds: dict[str, Any] = {"friction": Friction | None, "mount": Mount | None}
        if last not in kinds:
            raise ValueError(f"{path}: must be a number or a text, got a table")
        return toml.structure(value, kinds[last], path)
    if isinstance(value, list) and name == "torque":
        parts = toml.structure(value, tuple[Torque, ...], path)
        return parts[0] if len(parts) == 1 else TorqueSum(parts)
    return value


def _samples(value: object) -> Any:
    known = ("ranges", "n", "method", "seed", "second_order")
    fields = _fields("sample", value, known, 2)
    ranges = {
        name: _distribution(f"sample.ranges.{name}", value)
        for name, value in toml.table("sample.ranges", fields["ranges"]).items()
    }
    return sample(ranges, **{name: fields[name] for name in fields if name != "ranges"})


def _distribution(path: str, value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    if len(value) != 1 or next(iter(value)) not in _DISTRIBUTIONS:
        known = ", ".join(f"{name} ({text})" for name, text in _DISTRIBUTIONS.items())
        raise ValueError(f"{path}: must be [low, high] or a table of one of {known}")
    kind, numbers = next(iter(value.items()))
    if not isinstance(numbers, list) or len(numbers) != 2:
        raise ValueError(f"{path}.{kind}: must be {_DISTRIBUTIONS[kind]}, got {shown(numbers)}")
    first, second = (real(f"{path}.{kind}[{k}]", one) for k, one in enumerate(numbers))
    if kind == "uniform":
        return [first, second]
    if second <= 0.0:
        raise ValueError(f"{path}.{kind}[1]: must be > 0, got {second:g}")
    stats = scipy_module("stats", "a distribution of samples")
    if kind == "normal":
        return stats.norm(first, second)
    if first <= 0.0:
        raise ValueError(f"{path}.{kind}[0]: must be > 0, got {first:g}")
    return stats.lognorm(second, scale=first)
