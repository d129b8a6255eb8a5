"""Sensitivity of quantities of a sweep to parameters: Sobol' indices, by SALib."""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import Any, NamedTuple

import attrs
import numpy as np

from ..base.checks import Array, between, integer, one_of, shown
from ..base.described import suggesting
from ..base.optional import optional_module
from ..base.tables import columns
from .sampling import METHODS

#: Entries of a quantity that are printed.
_SHOWN = 12
#: Groups of runs below which the spread of resampled groups says little of the indices' errors.
_LEAST_GROUPS = 16
#: Harmonics of RBD-FAST that count as the parameter's (Tarantola, Gatelli and Mara 2006), and the
#: runs for each. What noise adds to a variance of N runs is 2 harmonics / N of it; of the half of
#: the runs that the confidence is estimated by, half of it at these.
_HARMONICS, _RUNS_PER_HARMONIC = 10, 8
#: A range of values below this part of the largest is rounding.
_ROUNDING = 1e-12


def _index(name: str, text: str) -> Any:
    """Make a property of one of the indices."""

    def of(found: Sensitivity) -> Any:
        if name in found._indices:
            return found._indices[name]
        what = name.removesuffix("_conf")
        order = ", second_order=True" if what == "second" else ""
        raise AttributeError(
            f"these samples give no {what} indices: make them by "
            f'bd.sample(ranges, n, method="saltelli"{order})'
        )

    return property(of, doc=text)


@attrs.frozen(eq=False, repr=False, kw_only=True)
class Sensitivity:
    """First and total Sobol' indices of a quantity.

    The first index of a parameter is the share of the quantity's variance due to it alone; the
    total index adds its interactions with others. ``print`` shows them in a table. All are
    ``xarray.DataArray`` over "parameter" and the quantity's own dimensions; total and second
    indices raise AttributeError where the samples do not allow them.

    Attributes:
        quantity: Name of the quantity.
        confidence: Confidence level of the intervals, such as 0.95.
        method: The estimator.
        notes: What was left out, and what has no index.
    """

    quantity: str
    confidence: float
    method: str
    notes: tuple[str, ...]
    _indices: Any  # an xarray.Dataset of those below

    first = _index("first", "First indices [1]; NaN where there are none, ``notes`` says why.")
    first_conf = _index("first_conf", "Half width of their confidence interval [1].")
    total = _index("total", "Total indices [1].")
    total_conf = _index("total_conf", "Half width of their confidence interval [1].")
    second = _index(
        "second",
        'Second indices [1] over "parameter" and "other": interactions of two. The smaller of the '
        "two comes first; NaN elsewhere.",
    )
    second_conf = _index("second_conf", "Half width of their confidence interval [1].")
    used = _index("used", "Number of runs, or groups of them, behind the indices, by entry.")

    def to_dataset(self) -> Any:
        """Return all indices as one ``xarray.Dataset``, which can be written to a file."""
        attributes = {"quantity": self.quantity, "method": self.method}
        notes = "\n".join(self.notes)
        return self._indices.assign_attrs(attributes, confidence=self.confidence, notes=notes)

    def to_frame(self) -> Any:
        """Return a ``pandas.DataFrame``, a row a parameter and entry, a column an index.

        Second indices, which are of two parameters, are in ``second`` alone.
        """
        pairs = ["second", "second_conf", "other", "used"]
        return self.to_dataset().drop_vars(pairs, errors="ignore").to_dataframe()

    def __repr__(self) -> str:
        names = ", ".join(str(name) for name in self.first["parameter"].values)
        return f"Sensitivity of {self.quantity} to {names}"

    def __str__(self) -> str:
        own = [str(dim) for dim in self.first.dims if dim != "parameter"]
        names = [name for name in ("first", "total") if name in self._indices]
        indices = {name: (self._indices[name], self._indices[f"{name}_conf"]) for name in names}
        rows = [[*own, "parameter", *(f"{name} index" for name in indices)]]
        entries = list(np.ndindex(*(self.first.sizes[dim] for dim in own)))
        for entry in entries[:_SHOWN]:
            at = dict(zip(own, entry, strict=True))
            where = [_entry(self.first, dim, k) for dim, k in at.items()]
            for j, name in enumerate(self.first["parameter"].values):
                one = at | {"parameter": j}
                rows.append([*where, str(name), *(_cell(*pair, one) for pair in indices.values())])
        lines = columns(rows, "<")
        if len(entries) > _SHOWN:
            lines.append(f"  ... and {len(entries) - _SHOWN} more entries: see to_frame()")
        percent = f"+-: confidence of {100 * self.confidence:g} %"
        head = f"Sensitivity of {self.quantity}: {self.method}; {percent}"
        return "\n".join([head, *lines, *(f"  {one}" for one in self.notes)])


@suggesting
def sensitivity(
    dataset: Any,
    quantity: str | None = None,
    *,
    confidence: float = 0.95,
    resamples: int = 100,
    seed: int = 0,
) -> Sensitivity:
    """Find how much each parameter of a sweep contributes to the variance of a quantity.

    For ``bd.sample(..., method="saltelli")`` by the estimators of Saltelli et al. (2010,
    doi:10.1016/j.cpc.2009.09.018): first and total indices, and second ones if the samples are for
    them. For other samples by RBD-FAST with the correction of Tissot and Prieur (2012,
    doi:10.1016/j.ress.2012.06.010): first indices alone.

    Runs without a number, because they failed, are left out, of Saltelli's samples with their whole
    group; the indices are then those of the drives that run, and the notes say how many.

    Args:
        dataset: The result of ``bd.sweep`` over ``bd.sample``, or a part of its runs.
        quantity: Name of a variable of numbers; None: the only one there is. Each entry of its own
            dimensions, such as "pulley", has its own indices.
        confidence: Confidence level of the intervals, between 0 and 1.
        resamples: Resampled sets that the intervals are estimated by.
        seed: Integer >= 0 that these follow from.

    Returns:
        The indices. Errors of estimation make some slightly negative, or more than 1. They are NaN
        where the quantity is constant; the notes say so.

    Raises:
        TypeError, ValueError: An argument breaks its rule; the sweep is not of samples; too few of
            its runs have a number.
        ImportError: xarray or SALib is not installed.
    """
    xarray = optional_module("xarray", "sensitivity", "sensitivity")
    if not isinstance(dataset, xarray.Dataset):
        raise TypeError(f"dataset must be the xarray.Dataset of bd.sweep, got {shown(dataset)}")
    options = {
        "conf_level": between("confidence", confidence),
        "num_resamples": integer("resamples", resamples, 2),
        # SALib takes a seed of 0 for none.
        "seed": 1 + integer("seed", seed, 0),
    }
    design = _design(dataset)
    array = _quantity(dataset, quantity)
    own = [dim for dim in array.dims if dim != "run"]
    values = _by_run(array.transpose("run", *own), design)
    shape = values.shape[1:]
    found = _estimated(
        design,
        values.reshape(design.groups, design.size, math.prod(shape)),
        np.stack([_by_run(dataset[name], design) for name in design.names], axis=1),
        options,
    )
    _check_enough(dataset, found, design, str(array.name))
    variables = {
        name: (
            [*("parameter", "other")[: stacked.ndim - 1], *own],
            stacked.reshape(*stacked.shape[:-1], *shape),
            {"units": "1", "long_name": f"{_WORDS[name]} of {array.name}"},
        )
        for name, stacked in found.arrays.items()
    }
    variables["used"] = own, found.used.reshape(shape), {"long_name": design.unit}
    coords = {dim: array.coords[dim] for dim in own if dim in array.coords}
    labels = ("parameter", "other") if design.second_order else ("parameter",)
    return Sensitivity(
        quantity=str(array.name),
        confidence=options["conf_level"],
        method=f"Saltelli's estimators, {design.groups} groups of {design.size} runs"
        if design.size > 1
        else f"RBD-FAST, {design.groups} runs",
        notes=_notes(dataset, found, design),
        indices=xarray.Dataset(variables, dict.fromkeys(labels, design.names) | coords),
    )


_ORDERS = ("first", "total", "second")
_WORDS = {one: f"{one} Sobol' index" for one in _ORDERS} | {
    f"{one}_conf": f"half width of the confidence interval of the {one} Sobol' index"
    for one in _ORDERS
}


# --- the estimators -----------------------------------------------------------------------------


class _Design(NamedTuple):
    """Data of the design of a sweep for its analysis."""

    names: list[str]  # of the parameters (k,)
    groups: int  # of runs, or runs
    size: int  # runs of a group: k + 2 or 2 k + 2, of samples without groups 1
    second_order: bool  # whether groups serve second indices

    @property
    def least(self) -> int:
        """Smallest number of groups, or runs."""
        return _LEAST_GROUPS if self.size > 1 else _HARMONICS * _RUNS_PER_HARMONIC

    @property
    def unit(self) -> str:
        """Name of the unit left out where a run has no value."""
        return "groups" if self.size > 1 else "runs"


class _Indices(NamedTuple):
    """Of all entries of the quantity, along the last axis."""

    arrays: dict[
        str, Array
    ]  # "first", "first_conf", ...: (k, n); "second", "second_conf": (k, k, n)
    used: Any  # groups, or runs, with a value throughout (n,)
    constant: Any  # whether their values differ by rounding alone (n,)


def _estimated(design: _Design, values: Array, inputs: Array, options: dict[str, Any]) -> _Indices:
    """Return the indices of values (groups, size, n) for parameters (runs, k)."""
    of_groups, k = design.size > 1, len(design.names)
    name = "sobol" if of_groups else "rbd_fast"
    estimator = optional_module(f"SALib.analyze.{name}", "sensitivity", "sensitivity")
    problem = {"num_vars": k, "names": design.names, "bounds": [[0.0, 1.0]] * k}
    orders = {"first": "S1"} | ({"total": "ST"} if of_groups else {})
    orders |= {"second": "S2"} if design.second_order else {}
    keys = {f"{one}{of}": f"{key}{of}" for one, key in orders.items() for of in ("", "_conf")}
    n = values.shape[2]
    arrays = {one: np.full((*[k] * (1 + one.startswith("second")), n), np.nan) for one in keys}
    good: Any = np.isfinite(values).all(axis=1)
    used, constant = good.sum(axis=0), np.zeros(n, dtype=bool)
    for entry in np.flatnonzero(used >= design.least):
        kept = values[good[:, entry], :, entry]
        # The variance is that of the first and the last of each group, the two independent runs.
        independent = kept[:, [0, -1]]
        constant[entry] = np.ptp(independent) <= _ROUNDING * np.abs(independent).max()
        if constant[entry]:
            continue
        if of_groups:
            order = {"calc_second_order": design.second_order}
            found = estimator.analyze(problem, kept.ravel(), **order, **options)
        else:
            own = inputs[good[:, entry]]
            found = estimator.analyze(problem, own, kept[:, 0], M=_HARMONICS, **options)
        for one, key in keys.items():
            arrays[one][..., entry] = found[key]
    return _Indices(arrays, used, constant)


# --- what is analysed ----------------------------------------------------------------------------


def _design(dataset: Any) -> _Design:
    what = (
        "dataset must be a sweep of samples, bd.sweep(scene, over=bd.sample(...)): in a grid or a "
        "list parameters do not vary as they do in use"
    )
    try:
        design = json.loads(dataset.attrs["design"])
        if design["kind"] != "sample":
            raise ValueError(f"{what}; its design is {design['kind']!r}")
        names, n = [str(name) for name in design["names"]], int(design["n"])
        saltelli, second = design["method"] == "saltelli", bool(design["second_order"])
        known = design["method"] in METHODS
    except (KeyError, TypeError, json.JSONDecodeError):
        raise ValueError(f"{what}; it has no such attribute 'design'") from None
    if not known or n < 1:
        raise ValueError(f"{what}; its attribute 'design' is {shown(design)}")
    missing = ", ".join(name for name in (*names, "run") if name not in dataset.coords)
    if missing:
        raise ValueError(f"dataset must have the coordinates of its samples, {missing} is missing")
    size = (2 * len(names) + 2 if second else len(names) + 2) if saltelli else 1
    runs, count = np.asarray(dataset["run"].values), n * size
    good = runs.dtype.kind in "iu" and runs.size and runs.min() >= 0 and runs.max() < count
    if not good or np.unique(runs).size != runs.size:
        raise ValueError(
            f"dataset must have the runs of its design, numbers from 0 to {count - 1} along "
            f"'run', each once at most, got {shown(runs)}"
        )
    return _Design(names, n, size, second)


def _quantity(dataset: Any, quantity: object) -> Any:
    known = [
        str(name)
        for name, array in dataset.data_vars.items()
        if "run" in array.dims and array.dtype.kind in "iufb"
    ]
    if quantity is None and len(known) == 1:
        return dataset[known[0]]
    if quantity is None:
        raise ValueError(f"quantity must be named, there are {', '.join(known) or 'none'}")
    return dataset[one_of("quantity", quantity, known or ["(none)"])]


def _by_run(array: Any, design: _Design) -> Array:
    """Return the values by the number of the run (runs, ...), NaN where there is no such run."""
    return np.asarray(array.reindex(run=np.arange(design.groups * design.size)), dtype=np.float64)


def _check_enough(dataset: Any, found: _Indices, design: _Design, name: str) -> None:
    """Raise ValueError unless one entry of the quantity has runs enough."""
    most = max(found.used, default=0)
    if most < design.least:
        raise ValueError(
            f"{name} has a number in {most} of {design.groups} {design.unit}, at least "
            f"{design.least} are needed{_failures(dataset)}: draw more samples"
            + (", or narrow the ranges to what the drive can do" if most < design.groups else "")
        )


def _failures(dataset: Any) -> str:
    """Return " (3 runs failed, 2 were refused)" from the states of the runs, or ""."""
    if "status" not in dataset:
        return ""
    states = Counter(dataset["status"].values.ravel().astype(str).tolist())
    words = [f"{states[state]} {state}" for state in sorted(states) if state != "finished"]
    return f" (runs: {', '.join(words)})" if words else ""


def _notes(dataset: Any, found: _Indices, design: _Design) -> tuple[str, ...]:
    notes = []
    least, most = (design.groups - count for count in (found.used.max(), found.used.min()))
    if most:
        notes.append(
            f"left out for want of a number: {'' if least == most else 'up to '}{most} of "
            f"{design.groups} {design.unit}{_failures(dataset)}; the indices are those of the rest"
        )
    few = f"less than {design.least} {design.unit} with a number"
    none = {"the quantity is constant": found.constant, few: found.used < design.least}
    for why, entries in none.items():
        if entries.any():
            of = "" if entries.size == 1 else f" of {entries.sum()} of {entries.size} entries"
            notes.append(f"no indices{of}: {why}")
    return tuple(notes)


def _cell(values: Any, conf: Any, at: dict[str, int]) -> str:
    value, half = float(values.isel(at)), float(conf.isel(at))
    return "-" if math.isnan(value) else f"{value:6.3f} +- {half:.3f}"


def _entry(array: Any, dim: str, k: int) -> str:
    if dim not in array.coords:
        return str(k)
    value = array.coords[dim].values[k]
    return f"{value:.5g}" if array.coords[dim].dtype.kind == "f" else str(value)
