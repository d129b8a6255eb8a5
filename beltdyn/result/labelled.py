"""A run as an ``xarray.Dataset``: every array with its dimensions, unit and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.naming import span_names
from ..base.optional import optional_module
from ..drive.mounts import MountKind
from ..drive.params import Params
from ..outputs.quantity import QUANTITIES, TIME, Quantity, dimensions
from ..outputs.sampled import Sampled

#: What the places along dimensions are.
_PLACES = {
    "time": TIME.text,
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


def mount_kinds(params: Params) -> list[MountKind]:
    """Return the kinds of the mounts (n_m,)."""
    return [mount._row for pulley in params.pulleys if (mount := pulley.mount) is not None]


def places(params: Params) -> dict[str, Sequence[Any]]:
    """Return the names of the places along each dimension."""
    links, names = range(params.n_bodies), params.pulley_names
    parts = {dimensions(size)[0]: [names[k] for k in ks] for size, ks in params._having.items()}
    modes = range(1, 1 + params._model.sizes.get("MODES", 0) // len(names))
    along = {"span": span_names(names), "link": links, "joint": links, "mode": modes}
    return {"pulley": parts["pulley"], **along, **parts, "xy": ["x", "y"]}


def dataset(run: Sampled, attributes: Mapping[str, str]) -> Any:
    """Return an ``xarray.Dataset``; see :meth:`beltdyn.Result.to_xarray`."""
    xarray = optional_module("xarray", "to_xarray", "sweep")
    variables: dict[str, Any] = {}
    for name, array in run._arrays().items():
        row = QUANTITIES[name]
        own = row.dimensions if array.ndim > 1 else ()
        described = {"units": unit_in(row, run.params), "long_name": row.text}
        variables[name] = (("time", *own), array, described)
    coordinates: dict[str, Any] = {"time": run.t, **places(run.params)}
    used = {dim for dims, *_ in variables.values() for dim in dims} | {"time"}
    found = {
        dim: (dim, list(values) if isinstance(values, range) else values, _labels(dim))
        for dim, values in coordinates.items()
        if dim in used
    }
    if "mount" in used:
        kinds = [kind.name for kind in mount_kinds(run.params)]
        found["mount_kind"] = ("mount", kinds, _labels("mount_kind"))
    return xarray.Dataset(variables, found, dict(attributes))


def unit_in(row: Quantity, params: Params) -> str:
    """Return the unit of a quantity in a drive, "rad or m" of mounts that differ in it."""
    kinds = mount_kinds(params) if row.size == "MOUNTS" else []
    alike = len({kind.angle for kind in kinds}) == 1 and kinds[0].moves
    return kinds[0].unit(row.unit) if alike else row.unit


def _labels(name: str) -> dict[str, str]:
    return ({"units": TIME.unit} if name == "time" else {}) | {"long_name": _PLACES[name]}
