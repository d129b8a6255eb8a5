"""What can be said of a drive before it runs: data that are allowed but hardly meant."""

from __future__ import annotations

from .errors import RunWarning
from .params import Params

__all__ = ["check"]


def check(params: Params) -> tuple[RunWarning, ...]:
    """Give the warnings that the parameters alone call for."""
    return ()
