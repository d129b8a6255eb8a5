"""Estimators of Sobol' indices, by SALib, for one quantity of the runs of a design."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import attrs
import numpy as np

from ..base.checks import Array
from ..base.optional import optional_module

__all__ = ["Design", "Indices", "by_groups", "by_runs"]

#: Groups of runs below which the spread of resampled groups says little of the indices' errors.
_LEAST_GROUPS = 16
#: Harmonics of RBD-FAST that count as the parameter's (Tarantola, Gatelli and Mara 2006), and the
#: runs for each. What noise adds to a variance of N runs is 2 harmonics / N of it; of the half of
#: the runs that the confidence is estimated by, half of it at these.
_HARMONICS, _RUNS_PER_HARMONIC = 10, 8
#: A range of values below this part of the largest is rounding.
_CONSTANT = 1e-12

TOO_FEW, CONSTANT = "few", "constant"


class Design(NamedTuple):
    """Data of the design of a sweep for its analysis.

    Attributes:
        names: Names of the parameters (k,).
        groups: Number of groups of runs, or of runs.
        size: Runs of a group: k + 2 or 2 k + 2, of samples without groups 1.
        second_order: Whether groups serve second indices.
    """

    names: list[str]
    groups: int
    size: int
    second_order: bool

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self.groups * self.size

    @property
    def least(self) -> int:
        """Smallest number of groups, or runs."""
        return _LEAST_GROUPS if self.size > 1 else _HARMONICS * _RUNS_PER_HARMONIC

    @property
    def unit(self) -> str:
        """Name of the unit left out where a run has no value."""
        return "groups" if self.size > 1 else "runs"


@attrs.frozen(eq=False)
class Indices:
    """Of one quantity.

    Attributes:
        arrays: "first", "first_conf", ...: (k,); "second", "second_conf": (k, k).
        used: Groups, or runs, with a value throughout.
        reason: Why there are none: "few" of these, "constant" values, or "".
    """

    arrays: dict[str, Array]
    used: int
    reason: str = ""


def by_groups(design: Design, options: dict[str, Any]) -> Callable[[Array], Indices]:
    """Return the function that analyses the values of Saltelli's groups (groups, size)."""
    sobol = optional_module("SALib.analyze.sobol", "sensitivity", "sensitivity")
    keys = {"first": "S1", "total": "ST"} | ({"second": "S2"} if design.second_order else {})
    keys |= {f"{name}_conf": f"{key}_conf" for name, key in keys.items()}

    def analysed(values: Array) -> Indices:
        kept = values[np.isfinite(values).all(axis=1)]
        # The variance is that of the first and the last of each group, the two independent runs.
        reason = _reason(kept[:, [0, -1]], design)
        if reason:
            return Indices(_nothing(design, keys), len(kept), reason)
        found = sobol.analyze(
            _problem(design), kept.ravel(), calc_second_order=design.second_order, **options
        )
        return Indices({name: np.asarray(found[key]) for name, key in keys.items()}, len(kept))

    return analysed


def by_runs(design: Design, inputs: Array, options: dict[str, Any]) -> Callable[[Array], Indices]:
    """Return the function that analyses values (runs, 1) for parameters ``inputs`` (runs, k)."""
    rbd_fast = optional_module("SALib.analyze.rbd_fast", "sensitivity", "sensitivity")
    keys = {"first": "S1", "first_conf": "S1_conf"}

    def analysed(values: Array) -> Indices:
        good = np.isfinite(values[:, 0])
        kept = values[good, 0]
        reason = _reason(kept, design)
        if reason:
            return Indices(_nothing(design, keys), len(kept), reason)
        found = rbd_fast.analyze(_problem(design), inputs[good], kept, M=_HARMONICS, **options)
        return Indices({name: np.asarray(found[key]) for name, key in keys.items()}, len(kept))

    return analysed


def _reason(values: Array, design: Design) -> str:
    if len(values) < design.least:
        return TOO_FEW
    constant = np.ptp(values) <= _CONSTANT * np.abs(values).max()
    return CONSTANT if constant else ""


def _problem(design: Design) -> dict[str, Any]:
    k = len(design.names)
    return {"num_vars": k, "names": design.names, "bounds": [[0.0, 1.0]] * k}


def _nothing(design: Design, names: dict[str, str]) -> dict[str, Array]:
    k = len(design.names)
    return {name: np.full((k, k) if "second" in name else k, np.nan) for name in names}
