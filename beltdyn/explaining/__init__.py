"""What a drive simulates, why, and what it costs: :func:`explain`."""

from __future__ import annotations

from .cost import Pass, StateSize, Step
from .effects import Effect
from .explanation import Explanation, explain

__all__ = ["Effect", "Explanation", "Pass", "StateSize", "Step", "explain"]
