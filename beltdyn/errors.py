"""Errors of a run. Bad values are plain ``ValueError`` and ``TypeError``."""

from __future__ import annotations

import math
from collections.abc import Iterable

from .result import Result
from .run_warnings import RunWarning

__all__ = ["Interrupted", "SimulationError", "annotate"]


class SimulationError(RuntimeError):
    """A run that cannot go on.

    The message names the time, the body or pulley, the reason and what to try; what was noticed
    before is in the notes of the error. The symbols::

        BD_ERR_OFF_PULLEY      the belt has come off a pulley, or settled without touching it
        BD_ERR_JOINT_GAP       a joint gapes by more than a link's length
        BD_ERR_BALANCE         more than half of the energy that passed has come from nowhere
        BD_ERR_FIXED_STEP      a fixed explicit step errs by many times the stretch of a joint
        BD_ERR_STALLED         steps so short that the end is out of reach, and what asks for them;
                               ``max_steps``, a budget of the user's own, lifts this one
        BD_ERR_MAX_STEPS       ``max_steps`` were made
        BD_ERR_STEP_FLOOR      no step that moves the time meets the tolerance
        BD_ERR_NOT_FINITE      no step gives finite numbers
        BD_ERR_PASSED_THROUGH  a link passed through a pulley
        BD_ERR_TORQUE_VALUE    the torque function gave a number that is not finite
        BD_ERR_NOT_SETTLED     settling only: the belt did not come to rest, or came off

    Bad values, an initial state that is none of this drive among them, are ``ValueError``.

    Attributes:
        symbol: Which of these, as in ``csrc/fields.h``.
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


def annotate(error: SimulationError, noticed: Iterable[RunWarning]) -> None:
    """Add to an error what was noticed, which may be its cause: a traceback shows it."""
    for one in noticed:
        error.add_note(f"noticed before: {one}")
