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
        BD_ERR_NOT_SETTLED     settling only: the belt did not come to rest, or came off

    Bad values are ``ValueError``, also an initial state that does not belong to the drive.

    Attributes:
        symbol: One of these.
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
    """A run whose drive, loads or results are not what one would expect.

    The message begins with the code of the :class:`RunWarning`, so Python's filters can silence
    one or turn it into an error: ``warnings.filterwarnings("ignore", "mesh")``,
    ``warnings.filterwarnings("error", "full_slip")``, or all of accuracy
    ``warnings.filterwarnings("error", category=beltdyn.AccuracyWarning)``. As errors, those of the
    drive alone are raised before the run; the others after it, with the result in their attribute
    ``result``.
    """


class AccuracyWarning(BeltdynWarning):
    """A run whose results may be less accurate than was asked."""


@attrs.frozen(kw_only=True)
class RunWarning:
    """One warning of a run; :attr:`beltdyn.Result.warnings` holds all of them.

    A star marks those of accuracy. From the drive alone, before it runs and in ``print(params)``::

        mesh *        straight links raise the tension at rest by more than 2 %: more links
        strain        the strain at rest is above 3 %: a longer belt
        compliance *  the belt sinks into a pulley by more than 0.5 % of its radius: stiffer contact
        long_links *  links are longer than half the radius of a pulley: more links
        units         implausible values: were data given in mm, kN, g/m, N mm or percent?

    From the samples of a run::

        no_friction   a pulley is driven, but friction is off: set ``Params.friction``
        full_slip     a pulley slips over its whole wrap: more preload, or less torque
        slack_span *  a span without tension: the same; the error is unknown then
        units         a torque far beyond what the belt can transmit: was it given in N mm?

    From its steps::

        balance *     the energy balance is off by more than 2 % of the energy transmitted: a
                      tighter ``rtol``, a shorter ``step``; compare with another method
        stretch       a joint is stretched by more than 10 % of a link (or three times the strain
                      at rest, if that is more): is a torque or a speed out of scale?
        no_contact *  no link touches a pulley while a stretch wave runs ten times round the belt:
                      more tension, or more links
        growth *      small differences grow exponentially: from this time on no tolerance makes
                      single forces and positions right, averages may be; more damping helps
        chatter *     links make and lose contact many times as often as the belt's motion explains:
                      small differences may grow; more damping helps
        undamped *    vibrations along the belt decay so slowly that errors of implicit steps
                      accumulate unseen: compare with "tsit5", a tighter ``rtol``, more
                      ``axial_damping``
        torque *      the torque function changes faster than the steps follow: ``breakpoints``, a
                      smaller ``max_step``
        rough_torque *  the torque function jumps all the time (noise, a relay), which the steps
                      follow only down to a limit: let it change over a range instead
        fallback *    steps in which only the first-order method succeeded have errors of more than
                      five times what was asked: a jump, or a stiffness out of scale?
        fixed_step *  the error of fixed steps exceeds half the tension: shorter ones, or ``rtol``

    Attributes:
        code: Its name, such as "mesh" or "full_slip"; ``str()`` begins with it.
        text: One sentence: what was found, how much of it, what to try.
        t: When it was found first [s]; None if it holds for the whole run.
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


#: Set in the threads of a search, which issues the warnings of its best run alone.
_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silenced() -> Iterator[None]:
    """Let runs in this thread issue no warnings; their results still hold them.

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
    """Give the warnings of several runs, each distinct one once."""
    return list({str(one): one for result in results for one in result.warnings}.values())


def annotate(error: SimulationError, noticed: Iterable[RunWarning]) -> None:
    """Add warnings, which may name the cause, to an error as notes: a traceback shows them."""
    for one in noticed:
        error.add_note(f"warning before this error: {one}")
