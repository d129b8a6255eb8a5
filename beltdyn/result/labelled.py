"""A run as an ``xarray.Dataset``: every array with its dimensions, unit and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..base.naming import span_name
from ..base.optional import optional_module
from ..drive.mounts import KINDS
from ..drive.params import Params
from ..outputs.histories import EnergyLedger
from ..outputs.selection import LEDGER, SPANS

__all__ = [
    "dataset",
    "described",
    "dimensions",
    "mount_kinds",
    "places",
    "span_names",
    "unit_of_mounts",
]

#: Dimensions after time, by the sizes of the core's table.
_DIMENSIONS = {
    "PULLEYS": ("pulley",),
    "PLANE": ("pulley", "xy"),
    "LINKS": ("link",),
    "NODES": ("link",),
    "MODES": ("span", "mode"),
    "JOINTS": ("joint",),
    "CONTACT": ("link",),
    "FRICTION": ("link",),
    "SLIPS": ("link",),
    "MOUNTS": ("mount",),
    "COUPLINGS": ("coupling",),
    "SPANS": ("span",),
}
#: What is not in the tables of the core.
_TEXTS = {
    "contact.pulley": "index of the pulley that a link touches, -1: none",
    "belt.passed": "stress-free belt that has passed pulley 0 since the first sample",
    "energy.passed": "energy transmitted so far, the scale of the residual",
    SPANS: "mean joint force of the free span that follows each pulley",
    "time": "time",
    "pulley": "pulley",
    "span": "free span, from a pulley to the next along the belt",
    "link": "link",
    "joint": "joint, on the left of the link of the same number",
    "mode": "half waves of a sine across the span",
    "mount": "pulley that stands on the mount",
    "coupling": "pulley whose shaft a coupling joins to its rim",
    "mount_kind": "kind of mount: travels of arms are angles, of sliders lengths",
    "xy": "component",
}
_UNITS = {"contact.pulley": "1", SPANS: "N", "time": "s"}


def span_names(params: Params) -> list[str]:
    """Return the names of the free spans after each pulley (n_p,), as in reports."""
    names = params.pulley_names
    after = [*names[1:], names[0]]
    return [span_name(k, names, unnamed=f"{names[k]} to {after[k]}") for k in range(len(names))]


def mount_kinds(params: Params) -> list[str]:
    """Return the kinds of the mounts (n_m,), in words of :data:`beltdyn.drive.mounts.KINDS`."""
    return [mount._row.name for pulley in params.pulleys if (mount := pulley.mount) is not None]


def dimensions(size: str) -> tuple[str, ...]:
    """Return the dimensions after time of a history of this size."""
    return _DIMENSIONS.get(size, ())


def places(params: Params) -> dict[str, Sequence[Any]]:
    """Return the names of the places along each dimension."""
    links, names = range(params.n_bodies), params.pulley_names
    parts = {_DIMENSIONS[size][0]: [names[k] for k in ks] for size, ks in params._having.items()}
    modes = range(1, 1 + params._model.sizes.get("MODES", 0) // len(names))
    along = {"span": span_names(params), "link": links, "joint": links, "mode": modes}
    return {"pulley": parts["pulley"], **along, **parts, "xy": ["x", "y"]}


def described() -> dict[str, tuple[str, str, str]]:
    """Return size, unit and text of every history by name; sizes are those of the core's tables."""
    found = {
        f"{group}.{name}": (size, unit, text) for name, group, size, unit, text in _core.OUTPUTS
    }
    del found[f"{LEDGER}.{LEDGER}"]
    found |= {f"{LEDGER}.{name}": ("", "J", text) for name, _, text in _core.ENERGY_TERMS}
    for name in EnergyLedger.array_names():
        found.setdefault(f"{LEDGER}.{name}", ("", "J", _TEXTS.get(f"{LEDGER}.{name}", name)))
    found["belt.passed"] = ("FLOW", "m", _TEXTS["belt.passed"])
    found["contact.pulley"] = ("CONTACT", _UNITS["contact.pulley"], _TEXTS["contact.pulley"])
    found[SPANS] = ("SPANS", _UNITS[SPANS], _TEXTS[SPANS])
    return found


def dataset(
    t: Array,
    arrays: Mapping[str, NDArray[Any]],
    params: Params,
    attributes: Mapping[str, str],
) -> Any:
    """Return an ``xarray.Dataset``; see :meth:`beltdyn.Result.to_xarray`."""
    xarray = optional_module("xarray", "to_xarray", "sweep")
    rows = described()
    variables: dict[str, Any] = {}
    for name, array in arrays.items():
        size, unit, text = rows[name]
        own = dimensions(size) if array.ndim > 1 else ()
        if size == "MOUNTS":
            unit = unit_of_mounts(unit, params)
        variables[name] = (("time", *own), array, {"units": unit, "long_name": text})
    coordinates: dict[str, Any] = {"time": t, **places(params)}
    used = {dim for dims, *_ in variables.values() for dim in dims} | {"time"}
    found = {
        dim: (dim, list(values) if isinstance(values, range) else values, _labels(dim))
        for dim, values in coordinates.items()
        if dim in used
    }
    if "mount" in used:
        found["mount_kind"] = ("mount", mount_kinds(params), _labels("mount_kind"))
    return xarray.Dataset(variables, found, dict(attributes))


def unit_of_mounts(unit: str, params: Params) -> str:
    """Return the unit of all mounts, "rad or m" if they differ."""
    rows = [KINDS[name] for name in mount_kinds(params)]
    known = None not in (angles := {row.angle for row in rows})
    return rows[0].unit(unit) if known and len(angles) == 1 else unit


def _labels(name: str) -> dict[str, str]:
    unit = _UNITS.get(name)
    return ({} if unit is None else {"units": unit}) | {"long_name": _TEXTS[name]}
