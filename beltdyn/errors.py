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


class BeltdynWarning(UserWarning):
    """A run whose drive, loads or results are not what one would expect.

    The message begins with the code of the :class:`RunWarning`, so that Python's filters silence or
    escalate one of them or all: ``warnings.filterwarnings("ignore", "mesh")``,
    ``warnings.filterwarnings("error", category=beltdyn.AccuracyWarning)``. As an error, what the
    drive alone calls for comes before the run; the rest comes after it, and has the result in its
    attribute ``result``.
    """


class AccuracyWarning(BeltdynWarning):
    """A run whose results may be further from the truth than was asked."""


@attrs.frozen(kw_only=True)
class RunWarning:
    """One thing that was noticed; :attr:`beltdyn.Result.warnings` holds them.

    A star marks those of accuracy. Of the drive alone, before it runs and in ``print(params)``::

        mesh *        straight links raise the tension at rest by more than 2 %: more links
        strain        more than 3 % at rest: a longer belt
        compliance *  the belt sinks into a pulley by more than 0.5 % of its radius: stiffer contact
        long_links *  links longer than half the radius of a pulley: more links
        units         what no drive is: data in mm, kN, g/m, N mm?

    Of the samples of a run::

        no_friction   a pulley is driven, but friction is off: set ``Params.friction``
        full_slip     a pulley slips over its whole wrap: more preload, or less torque
        slack_span *  a span without tension: the same; errors are unknown then
        units         a torque far beyond what the belt can carry over: N mm?

    Of its steps::

        balance *     more than 2 % of the energy that passed is missing or has come from nowhere:
                      a tighter ``rtol``, a shorter ``step``; compare with another method
        stretch       a joint stretched by more than 10 % of a link (three times the strain at rest,
                      if that is more): a torque or a speed out of scale?
        no_contact *  no link touches a pulley while a stretch wave runs ten times round the belt:
                      more tension, or more links
        growth *      small differences grow exponentially: from this time on no tolerance makes
                      single forces and positions right, but averages may be; more damping calms
        chatter *     links come to the pulleys and leave them many times as often as the belt's
                      travel brings them: small differences may grow; more damping calms
        undamped *    vibrations along the belt live so long that errors of implicit steps add up
                      unseen: compare with "tsit5", a tighter ``rtol``, more ``axial_damping``
        torque *      the torque function changes faster than steps follow: ``breakpoints``, a
                      smaller ``max_step``
        rough_torque *  the torque function jumps all the time (noise, a relay) and is followed in
                      short steps only: let it change over a range
        fallback *    steps that the first order alone could make err by more than five times what
                      was asked: a jump, or a stiffness out of scale?
        fixed_step *  fixed steps err by more than half the tension: shorter ones, or ``rtol``

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
