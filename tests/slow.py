"""Cases of which some are marked slow: CI runs them, a plain `python -m pytest` does not."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def slow_if(is_slow: Callable[[Any], bool], cases: Iterable[Any]) -> list[Any]:
    """The cases, for `pytest.mark.parametrize`; a tuple is several arguments."""
    rows = [(case, case if isinstance(case, tuple) else (case,)) for case in cases]
    return [
        pytest.param(*row, marks=pytest.mark.slow if is_slow(case) else ()) for case, row in rows
    ]


def first(n: int, cases: Iterable[Any]) -> list[Any]:
    """The first n by default: drawn at random, each stands for all."""
    cases = list(cases)
    return slow_if(cases[n:].__contains__, cases)
