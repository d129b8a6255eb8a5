"""Identification of a drive's parameters from measurements, with confidence intervals.

Needs SciPy, which is imported when :func:`identify` is called.
"""

from __future__ import annotations

from ..base.described import describe_all
from .experiment import Experiment, Target
from .findings import Identification, IdentificationInterrupted, Sensitivity
from .fit import identify
from .free import Free
from .linear import Combination

__all__ = [
    "Combination",
    "Experiment",
    "Free",
    "Identification",
    "IdentificationInterrupted",
    "Sensitivity",
    "Target",
    "identify",
]

describe_all(map(globals().__getitem__, __all__))
