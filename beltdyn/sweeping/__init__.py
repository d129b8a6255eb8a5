"""Sweeps: samples of parameters and sensitivities to them."""

from __future__ import annotations

from .sampling import Samples, sample
from .sensitivity import Sensitivity, sensitivity

__all__ = ["Samples", "Sensitivity", "sample", "sensitivity"]
