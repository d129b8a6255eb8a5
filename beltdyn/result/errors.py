"""Errors of a run. Bad values are plain ``ValueError`` and ``TypeError``."""

from __future__ import annotations

import math
from collections.abc import Iterable

from .. import _core
from ..base.described import listed
from ..base.run_warnings import RunWarning
from ..drive.params import Params
from .result import Result


class SimulationError(RuntimeError):
    """A run that cannot go on, or can no longer be that of a belt drive.

    The message names the time, the link or pulley, the reason and what to try; warnings found
    before are in the notes of the error.

    Bad values are ``ValueError``, also an initial state that does not belong to the drive.

    Attributes:
        symbol: One of those below.
        t: Time of the failure [s].
        body: Index of the link concerned, or -1.
        pulley: Index of the pulley concerned, or -1.
        pulley_name: Its name, "pulley 3" if it has none, or "".
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
        self.pulley_name = ""
        self.value = value
        self.field = field
        self.result: Result | None = None


listed(
    SimulationError,
    {symbol: f"{text}." for symbol, _, kind, text in _core.ERRORS if kind == "RUN"},
    "Symbols",
)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run; ``result`` holds the finished part (None before it has begun)."""

    def __init__(self, message: str, result: Result | None = None) -> None:
        super().__init__(message)
        self.result = result


def annotate(error: SimulationError, params: Params, noticed: Iterable[RunWarning]) -> None:
    """Add the pulley's name, and warnings, which may name the cause, as notes of a traceback."""
    if error.pulley >= 0:
        error.pulley_name = params.pulley_names[error.pulley]
    for one in noticed:
        error.add_note(f"warning before this error: {one}")
