"""Optional packages, imported when they are used."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def optional_module(name: str, user: str, extra: str) -> Any:
    """Import a module of a package that an extra of this one brings."""
    package = name.partition(".")[0]
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] != package:  # it is there, and itself lacks another
            raise
        raise ImportError(
            f'{user} needs the package {package}: python -m pip install "beltdyn[{extra}]"'
        ) from None


def scipy_module(name: str, user: str) -> Any:
    """Import a module of SciPy."""
    return optional_module(f"scipy.{name}", user, "vibration")
