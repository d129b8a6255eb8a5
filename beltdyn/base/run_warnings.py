"""Warnings of a run, and how they are issued."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import attrs


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

        mesh *        the mesh makes the mean tension wrong by an estimated 2 % or more: more links
        strain        the strain at rest is above 3 %: a longer belt
        compliance *  the belt sinks into a pulley by more than 0.5 % of its radius: stiffer contact
        long_links *  links longer than half a radius, or hardly one on a wrap: more links
        near_limit *  of an ALE belt: a wrap or span hardly longer than its bent ends, a span much
                      heavier than both pulleys at its ends: mesh "joint"
        tensioning    of an ALE belt: it begins without what tensioning asks for: mesh "joint"
        units         implausible values: were data given in mm, kN, g/m, N mm, percent, degrees?

    From the samples of a run::

        mesh *        as above, of the load and of links that land as well, in its place
        mesh_speed *  links slow the pulleys down by an estimated 2 % or more, or catch on them
                      (needs the ledger): mesh "ale", or more links
        no_friction   a pulley is driven, but friction is off: set ``Params.friction``
        full_slip     a pulley slips over its whole wrap: more preload, or less torque
        slack_span *  a span without tension: the same; the error is unknown then
        units         a torque far beyond what the belt can transmit: was it given in N mm?
        near_slack *  of an ALE belt: a span presses on pulleys with a tenth of the tension at rest
        span_modes *  of an ALE belt: it runs so fast that its lateral vibrations are inaccurate
        steep_span *  of an ALE belt: a span swings by more than a slope of 0.1
        squeal *      of an ALE belt: friction makes vibrations on a hardly damped contact grow,
                      which it leaves out: more ``contact.damping``, or mesh "joint"
        never_drives  an overrunning clutch is free, or brakes what it is to drive, under a rim that
                      turns the other way than it drives: is ``clockwise`` right?

    From its steps::

        balance *     the energy balance is off by more than 2 % of the energy transmitted: a
                      tighter ``rtol``, a shorter ``step``; compare with another method
        stretch       a joint is stretched by more than 10 % of a link (or three times the strain
                      at rest, if that is more): is a torque or a speed out of scale?
        no_contact *  no link touches a pulley while a stretch wave runs ten times round the belt:
                      more tension, or more links
        growth *      small differences grow exponentially: from this time on no tolerance makes
                      single forces and positions right, averages may be; more damping helps;
                      or vibrations of hardly damped joints grow which long implicit steps damp
                      out: compare with ``method="tsit5"``
        chatter *     links make and lose contact many times as often as the belt's motion explains,
                      and it could not be seen that small differences do not grow: the error in
                      time is unknown; more damping helps (else a note, ``accuracy.notes``)
        undamped *    vibrations along the belt decay so slowly that errors of steps add up to more
                      than twenty times ``rtol``, as ``stats.error`` says: a tighter ``rtol``, more
                      ``axial_damping``; or links vibrate on their contact, hardly damped, which
                      long implicit steps do not follow: more ``contact.damping``
        torque *      the torque function changes faster than the steps follow: ``breakpoints``, a
                      smaller ``max_step``
        rough_torque *  the torque function jumps all the time (noise, a relay), which the steps
                      follow only down to a limit: let it change over a range instead
        fallback *    steps in which only the first-order method succeeded have errors of more than
                      five times what was asked: a jump, or a stiffness out of scale?
        fixed_step *  the error of fixed steps exceeds half the tension: shorter ones, or ``rtol``
        budget        pilot, settling and run took more CPU time than the ``budget`` given
        checkpoint    the file of ``checkpoint`` could not be written: is the disk full?
        torque_ignored  a torque is set on a pulley whose motion is prescribed: it has no effect
        beyond_table  a pulley turns faster, by more than 1 %, than the table of its torque
                      reaches (:class:`SpeedTable`, :class:`Motor`), which is constant there: give
                      it up to this speed

    Of a sweep, issued when it has ended::

        no_result     runs were refused, failed or lost: ``status`` and ``message`` of its dataset,
                      which as an error it has in its attribute ``dataset``

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


_PACKAGE = f"{__name__.partition('.')[0]}."
#: Set in the threads of a search, which issues the warnings of its best run alone.
_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silenced() -> Iterator[None]:
    """Let runs in this thread alone issue no warnings; their results still hold them."""
    token = _SILENT.set(True)
    try:
        yield
    finally:
        _SILENT.reset(token)


def issue(noticed: Iterable[RunWarning]) -> None:
    """Issue each as a Python warning, on behalf of who called the package."""
    if _SILENT.get():
        return
    for one in noticed:
        warnings.warn(str(one), _category(one), stacklevel=caller()[0])


def caller() -> tuple[int, str]:
    """Return who called the package: the ``stacklevel`` as seen from here, and its module."""
    level, frame = 1, sys._getframe(1)
    while (module := str(frame.f_globals.get("__name__", ""))).startswith(_PACKAGE):
        if frame.f_back is None:
            break
        level, frame = level + 1, frame.f_back
    return level, module


def is_error(one: RunWarning) -> bool:
    """Return whether a filter turns a warning into an error, issued as by :func:`issue`."""

    def fits(pattern: Any, text: str) -> bool:  # those that Python begins with are plain texts
        return pattern is None or bool(
            pattern == text if isinstance(pattern, str) else pattern.match(text)
        )

    module = caller()[1]
    for action, message, category, where, line in warnings.filters:
        of_it = issubclass(_category(one), category) and fits(message, str(one))
        if of_it and fits(where, module) and not line:
            return action == "error"
    return False


def _category(one: RunWarning) -> type[BeltdynWarning]:
    return AccuracyWarning if one.accuracy else BeltdynWarning


def distinct(of_runs: Iterable[Iterable[RunWarning]]) -> list[RunWarning]:
    """Return the warnings of several runs, each distinct one once."""
    return list({str(one): one for of_run in of_runs for one in of_run}.values())
