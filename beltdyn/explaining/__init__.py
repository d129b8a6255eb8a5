"""Effects of a drive, why it has them, and what they cost: :func:`explain`."""

from __future__ import annotations

from ..base.described import describe_all
from .ablation import Ablation, LeftOut
from .effects import Effect
from .explanation import Explanation, explain
from .step_cost import Pass, StateSize, Step

__all__ = ["Ablation", "Effect", "Explanation", "LeftOut", "Pass", "StateSize", "Step", "explain"]

describe_all(map(globals().__getitem__, __all__))
