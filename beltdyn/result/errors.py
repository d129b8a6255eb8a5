"""Errors of a run. Bad values are plain ``ValueError`` and ``TypeError``."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..base.run_warnings import RunWarning
from ..drive.params import Params
from .result import Result


class SimulationError(RuntimeError):
    """A run that cannot go on, or can no longer be that of a belt drive.

    The message names the time, the link or pulley, the reason and what to try; warnings found
    before are in the notes of the error. The symbols::

        BD_ERR_OFF_PULLEY      the belt has come off a pulley, or settled without touching it
        BD_ERR_JOINT_GAP       a joint is open by more than a link's length
        BD_ERR_BALANCE         more energy has appeared than half of what was transmitted
        BD_ERR_FIXED_STEP      the error of a fixed explicit step is many times a joint's stretch
        BD_ERR_STALLED         the steps are too short to reach the end; the message says why.
                               ``max_steps``, a limit of the user's own, replaces this check
        BD_ERR_MAX_STEPS       ``max_steps`` were made
        BD_ERR_STEP_FLOOR      even the shortest possible step does not meet the tolerance
        BD_ERR_NOT_FINITE      no step gives finite numbers
        BD_ERR_PASSED_THROUGH  a link passed through a pulley
        BD_ERR_TORQUE_VALUE    the torque function gave a number that is not finite
        BD_ERR_INVARIANT       the state at the end is none that a drive can have, by an error of
                               the program: please report it
        BD_ERR_NOT_SETTLED     settling only: the belt did not come to rest, or came off

    Bad values are ``ValueError``, also an initial state that does not belong to the drive.

    Attributes:
        symbol: One of these.
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
