"""Errors and warnings of a run. Bad values are plain ``ValueError`` and ``TypeError``."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

import attrs

if TYPE_CHECKING:
    from .result import Result

__all__ = ["AccuracyWarning", "BeltdynWarning", "Interrupted", "RunWarning", "SimulationError"]


class SimulationError(RuntimeError):
    """A run that cannot go on.

    The message names the time, the body or pulley, the reason and what to try.

    Attributes:
        symbol: Name of the error, as in ``csrc/fields.h`` (for example ``"BD_ERR_STEP_FLOOR"``).
        t: Time of the failure [s].
        body: Index of the link concerned, or -1.
        pulley: Index of the pulley concerned, or -1.
        value: The offending value, or NaN.
        field: The quantity concerned, or "".
        result: Everything computed before the failure, or None while settling.
    """

    def __init__(
        self,
        message: str,
        *,
        symbol: str = "",
        t: float = math.nan,
        body: int = -1,
        pulley: int = -1,
        value: float = math.nan,
        field: str = "",
    ) -> None:
        super().__init__(message)
        self.symbol = symbol
        self.t = t
        self.body = body
        self.pulley = pulley
        self.value = value
        self.field = field
        self.result: Result | None = None


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run; ``result`` holds the finished part (None before the first step)."""

    def __init__(self, message: str, result: Result | None = None) -> None:
        super().__init__(message)
        self.result = result


class BeltdynWarning(UserWarning):
    """A run whose drive, loads or results are not what one would expect."""


class AccuracyWarning(BeltdynWarning):
    """A run whose results may be further from the truth than was asked."""


@attrs.frozen(kw_only=True)
class RunWarning:
    """One thing that was noticed; :attr:`beltdyn.Result.warnings` holds them.

    Attributes:
        code: What it is, in one word, such as "mesh" or "full_slip"; the text begins with it.
        text: One sentence: what was seen, how much of it, what to try.
        t: When it was seen first [s]; None if it holds for the whole run.
        where: The pulley, link or span concerned, such as "pulley 1", or "".
        accuracy: Whether the accuracy of the results is concerned (:class:`AccuracyWarning`).
    """

    code: str
    text: str
    t: float | None = None
    where: str = ""
    accuracy: bool = False

    def __str__(self) -> str:
        return f"{self.code}: {self.text}"


#: Of this thread: a search, which tells its user of the best run alone.
_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silenced() -> Iterator[None]:
    """Let runs in this thread issue nothing; their results still hold what was noticed.

    Unlike ``warnings.catch_warnings`` it leaves other threads alone.
    """
    token = _SILENT.set(True)
    try:
        yield
    finally:
        _SILENT.reset(token)


def issue(noticed: Iterable[RunWarning], stacklevel: int) -> None:
    """Issue each as a Python warning, on behalf of the caller so many levels up."""
    if _SILENT.get():
        return
    for one in noticed:
        category = AccuracyWarning if one.accuracy else BeltdynWarning
        warnings.warn(str(one), category, stacklevel=stacklevel + 1)


def distinct(results: Iterable[Result]) -> list[RunWarning]:
    """Give what several runs noticed, what they say alike once."""
    return list({str(one): one for result in results for one in result.warnings}.values())


def annotate(error: SimulationError, noticed: Iterable[RunWarning]) -> None:
    """Add to an error what was noticed, which may be its cause: a traceback shows it."""
    for one in noticed:
        error.add_note(f"noticed before: {one}")
