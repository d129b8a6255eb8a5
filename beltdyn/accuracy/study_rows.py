"""A row of a study: a setting, its cost and its errors."""

from __future__ import annotations

from collections.abc import Mapping

import attrs

from ..base.checks import one_of
from ..verification.quantities import QUANTITIES
from ..verification.settings import Setting

Errors = Mapping[str, float]


def quantity_of(name: object) -> str:
    """Check the name of a quantity."""
    return one_of("quantity", name, QUANTITIES)


@attrs.frozen(kw_only=True)
class Row:
    """A setting, its cost and its errors, by quantity and relative [1].

    Attributes:
        setting: Number of links, method, tolerance.
        seconds: CPU time, without settling, the least of ``repeats`` [s]; NaN if the run failed.
        repeats: Number of runs.
        steps: Steps, rejected ones included.
        error: Difference to the reference on the finest mesh: the total error.
        time: Difference to the reference on the same mesh: the error in time.
        failure: Why the run failed, or "".
    """

    setting: Setting
    seconds: float
    repeats: int
    steps: int
    error: Errors
    time: Errors
    failure: str = ""
