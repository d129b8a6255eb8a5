"""Many runs of a scene: sweeps over parameters, loads and options."""

from .sampling import Samples, sample
from .sweep import SweepInterrupted, sweep

__all__ = ["Samples", "SweepInterrupted", "sample", "sweep"]
