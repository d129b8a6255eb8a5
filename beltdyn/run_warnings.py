"""Warnings of a run: what is noticed, and how it is issued."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import attrs

__all__ = ["AccuracyWarning", "BeltdynWarning", "RunWarning", "distinct", "issue", "silenced"]


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


def distinct(of_runs: Iterable[Iterable[RunWarning]]) -> list[RunWarning]:
    """Give what several runs noticed, what they say alike once."""
    return list({str(one): one for of_run in of_runs for one in of_run}.values())
