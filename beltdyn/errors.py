"""Errors a run can raise. Bad values are plain ``ValueError`` and ``TypeError``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .result import Result

__all__ = ["Interrupted", "SimulationError"]


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
    """Ctrl-C during a run; ``result`` holds the finished part (None while settling)."""

    def __init__(self, message: str, result: Result | None = None) -> None:
        super().__init__(message)
        self.result = result
