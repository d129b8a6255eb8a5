"""Many runs of a scene: sweeps over parameters, loads and options, samples, sensitivities."""

from __future__ import annotations

from ..base.described import describe_all
from .sampling import Samples, sample
from .sensitivity import Sensitivity, sensitivity
from .sweep import SweepInterrupted, sweep

__all__ = ["Samples", "Sensitivity", "SweepInterrupted", "sample", "sensitivity", "sweep"]

describe_all(map(globals().__getitem__, __all__))
