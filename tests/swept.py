"""Datasets as sweeps give them, made by hand from formulas; no drive is run."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import beltdyn as bd

#: Units and texts of the names that tests sweep.
TEXTS = {
    "belt.preload": ("N", "preload"),
    "friction.mu_k": ("1", "friction coefficient"),
    "torque.scale": ("1", "torque factor"),
    "contact.quadratic": ("N/m^3", "contact stiffness"),
    "friction.kind": ("", "friction law"),
}


def of_samples(samples: bd.Samples, values: NDArray[Any], **more: Any) -> xr.Dataset:
    """Return a sampled sweep with the quantity "y" (n,) [N], or (n, n_p) by pulley."""
    dims = ("run", "pulley")[: values.ndim]
    coords: dict[str, Any] = {
        name: ("run", column, attributes(name))
        for name, column in zip(samples.names, samples.values.T, strict=True)
    }
    coords["run"] = np.arange(len(samples))
    if values.ndim > 1:
        coords["pulley"] = [f"pulley {k}" for k in range(values.shape[1])]
    design = json.dumps({"kind": "sample", **samples.design})
    given = {"y": (dims, values, {"units": "N", "long_name": "tension"})}
    return finished(xr.Dataset({**given, **more}, coords, {"design": design}), ("run",))


def of_grid(over: Mapping[str, Any], value: Callable[..., Any]) -> xr.Dataset:
    """Return a sweep over a grid with the quantity "q" of a function of the swept values."""
    axes = [np.asarray(values) for values in over.values()]
    values = np.array([value(*point) for point in product(*axes)], dtype=float)
    shape = tuple(axis.size for axis in axes)
    attrs = {"units": "N m", "long_name": "largest torque"}
    coords = {name: (name, axis, attributes(name)) for name, axis in zip(over, axes, strict=True)}
    given, design = {"q": (tuple(over), values.reshape(shape), attrs)}, {"kind": "grid"}
    return finished(xr.Dataset(given, coords, {"design": json.dumps(design)}), tuple(over))


def fail(dataset: xr.Dataset, status: str, **at: Any) -> None:
    """Mark runs, by their indices along swept dimensions, as ended with a status."""
    dataset["status"][{name.replace("__", "."): k for name, k in at.items()}] = status
    bad = dataset["status"] != "finished"
    for name in dataset.data_vars:
        if name not in ("status", "message", "warnings"):
            dataset[name] = dataset[name].where(~bad)


def attributes(name: str) -> dict[str, str]:
    units, text = TEXTS.get(name, ("1", name))
    return {"units": units, "long_name": text}


def finished(dataset: xr.Dataset, dims: tuple[str, ...]) -> xr.Dataset:
    shape = tuple(dataset.sizes[dim] for dim in dims)
    for name, text in (("status", "finished"), ("message", ""), ("warnings", "")):
        dataset[name] = (dims, np.full(shape, text, dtype=object))
    return dataset
