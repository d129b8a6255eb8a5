"""Hypothesis: a few examples of everything by default, many in the extended tier; the same ones
again and again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis.strategies import SearchStrategy
from tiers import first

#: For a test that takes the number of its `examples`.
EXAMPLES = pytest.mark.parametrize("examples", first(1, [40, 600]))


def fuzz(examples: int, check: Callable[..., object], *strategies: SearchStrategy[Any]) -> None:
    """Call the check with so many examples."""
    run = settings(max_examples=examples, derandomize=True, database=None, deadline=None)
    run(given(*strategies)(check))()
