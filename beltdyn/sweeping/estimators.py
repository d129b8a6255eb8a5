"""Estimators of Sobol' indices, by SALib, for one quantity of the runs of a design."""

from __future__ import annotations

from typing import Any, NamedTuple

import attrs
import numpy as np

from ..base.checks import Array
from ..base.optional import optional_module

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


@attrs.frozen(eq=False)
class Indices:
    """Of one quantity."""

    arrays: dict[str, Array]  # "first", "first_conf", ...: (k,); "second", "second_conf": (k, k)
    used: int  # groups, or runs, with a value throughout
    reason: str  # why there are none: TOO_FEW of these, CONSTANT values, or ""


def estimated(design: Design, values: Array, inputs: Array, options: dict[str, Any]) -> Indices:
    """Return the indices of values (groups, size) for parameters (groups, k) of single runs."""
    of_groups, k = design.size > 1, len(design.names)
    name = "sobol" if of_groups else "rbd_fast"
    estimator = optional_module(f"SALib.analyze.{name}", "sensitivity", "sensitivity")
    keys = {"first": "S1"} | ({"total": "ST"} if of_groups else {})
    keys |= {"second": "S2"} if design.second_order else {}
    keys |= {f"{name}_conf": f"{key}_conf" for name, key in keys.items()}
    good = np.isfinite(values).all(axis=1)
    kept = values[good]
    # The variance is that of the first and the last of each group, the two independent runs.
    independent = kept[:, [0, -1]]
    reason = ""
    if len(kept) < design.least:
        reason = TOO_FEW
    elif np.ptp(independent) <= _CONSTANT * np.abs(independent).max():
        reason = CONSTANT
    if reason:
        nothing = {name: np.full((k, k) if "second" in name else k, np.nan) for name in keys}
        return Indices(nothing, len(kept), reason)
    problem = {"num_vars": k, "names": design.names, "bounds": [[0.0, 1.0]] * k}
    if of_groups:
        order = {"calc_second_order": design.second_order}
        found = estimator.analyze(problem, kept.ravel(), **order, **options)
    else:
        found = estimator.analyze(problem, inputs[good], kept[:, 0], M=_HARMONICS, **options)
    return Indices({name: np.asarray(found[key]) for name, key in keys.items()}, len(kept), "")
