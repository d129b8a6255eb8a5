"""Packages that only parts of this one need, imported when those are used."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["scipy_module"]


def scipy_module(name: str, user: str) -> Any:
    """Import a module of SciPy.

    Args:
        name: Of the module, such as "signal".
        user: What needs it, as the message begins.

    Raises:
        ImportError: SciPy is not there; the message says how to get it.
    """
    try:
        return import_module(f"scipy.{name}")
    except ImportError:
        raise ImportError(
            f"{user} need SciPy: python -m pip install scipy (or beltdyn[vibration])"
        ) from None
