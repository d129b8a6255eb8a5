"""A report, as text, dictionaries and data frames."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import attrs

from ..base.checks import flag
from . import brief, flat, text
from .rows import ReportData

__all__ = ["Report"]


@attrs.frozen(kw_only=True, repr=False)
class Report(ReportData):
    """What an engineer reads off the last part of a run.

    ``print(report)`` shows what is asked first, ``print(report.text(full=True))`` all tables; a
    notebook shows both by itself. Rows are found by index or name:
    ``report.pulleys["alternator"].hub_load.mean``. Questions, and where the answers stand:

    ==================================================  ==========================================
    what load do the alternator's bearings carry?       ``pulleys["alternator"].hub_load``
    in which direction?                                 ``pulleys["alternator"].hub_direction``
    how far is it from slipping?                        ``pulleys["alternator"].own_margin``,
                                                        all torques: ``margin``, ``least_margin``
    at which torque does it slip?                       ``pulleys["alternator"].slip_torque``
    which pulley slips first?                           ``first_to_slip``
    where does the power go?                            ``powers``, ``efficiency``
    how much of it is friction on the crank?            ``powers["friction on crank"]``
    why is the alternator slower than its radius says?  ``creep["alternator"]``
    how tight are the spans, how much does that change? ``spans[k].tension``
    does a span resonate with something?                ``spans[k].lateral``, ``spans[k].frequency``
    how far does the tensioner swing?                   ``mounts["tensioner"].travel``
    does it reach a stop?                               ``mounts["tensioner"].to_stop``
    what load cycles does a link go through?            ``cycles``, ``rounds``
    can I trust the means?                              ``unsteady``, ``notes``
    ==================================================  ==========================================

    Attributes:
        begin: First sample of the window [s].
        end: Last one [s].
        samples: Number of samples.
        driver: Name of the pulley that drives the belt; None if the belt stands still.
        belt_speed: Mean speed of the belt in the order of its links, along itself [m/s].
        belt_speeds: The same with its range, without the ripple of passing links [m/s].
        rest_tension: Mean tension of the belt at rest [N]; None with the paper's mesh, on which it
            is higher on pulleys than in spans.
        mass_tension: Centrifugal tension rho v^2, the part of every tension that turns the belt
            [N].
        pulleys: A row for each pulley.
        spans: A row for each free span; none with one pulley.
        mounts: A row for each arm, slider and path.
        creep: A row for each pulley but the driving one.
        powers: Power balance; the input power is the sum of all others.
        efficiency: Share of the input power that is not lost [1].
        efficiency_error: Its error, or where it is None that of what is lost over what is put in
            [1]: that of the powers if the run was verified; else what the mesh adds to the losses,
            nearly all of the contact's damping, of links that land.
        power_error: Error of the powers, relative to the largest of a pulley in the run [1], as
            ``result.accuracy`` has it.
        tension_error: Error of the spans' mean tensions [1], as ``result.accuracy`` has it.
        creep_error: The same of creep, relative to the largest [1]; None without verification.
        nodes: What the belt consists of: "links", "point masses", or "cells", which stand still.
        cycles: Load cycles of a joint, largest range first; of an ALE belt those of the belt that
            is in the middle of a cell at the end.
        joint: That joint, or cell.
        cycles_begin: Time from which they are counted [s]: a round of the belt before the end of
            the run, or the beginning of the window if that is earlier.
        rounds: Rounds that the belt makes from then on.
        unsteady: What is not steady in the window, and by how much; empty: it is steady.
        notes: What could not be determined, and why.
        accuracy: Errors of the run as far as they are known, ``result.accuracy``.
        warnings: Warnings of the run, ``result.warnings``.
    """

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        steady = "not steady" if self.unsteady else "steady"
        return (
            f"Report(t = {self.begin:g} to {self.end:g} s, {self.samples} samples, {steady}, "
            f"{len(self.pulleys)} pulley(s))"
        )

    def _repr_html_(self) -> str:
        return brief.html(self)

    def text(self, *, full: bool = False) -> str:
        """Return the report as text.

        Args:
            full: False, as ``print`` does: the first screen, at most 39 lines of 100 columns.
                True: all tables with their remarks, warnings and notes, in 80 columns.

        Raises:
            TypeError: ``full`` is not a bool.
        """
        return "\n".join(text.lines(self) if flag("full", full) else brief.lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, such as ``json.dump`` takes.

        SI units, angles in rad, as the attributes, and what follows from them: "steady",
        "first_to_slip", the name of that pulley, and "slower" of rows of creep, which is what is
        printed as lost. What is not known is None; so is a number that is infinite (an unlimited
        margin).
        """
        plain: dict[str, Any] = _plain(attrs.asdict(self, recurse=True))
        first = self.first_to_slip
        for row, one in zip(self.creep, plain["creep"], strict=True):
            one["slower"] = row.slower
        plain["steady"] = not self.unsteady
        plain["first_to_slip"] = None if first is None else first.name
        return plain

    def to_frame(self) -> Any:
        """Return a pandas.DataFrame, a number a row: part, name, quantity, unit, value and text.

        SI units, angles in rad. Parts are "report" for the run as a whole, "pulleys", "spans",
        "mounts", "creep", "powers" and "cycles". Texts, such as the kind of a power or a note,
        stand in the last column, with a value of NaN; yes is 1 and no 0.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            pandas = import_module("pandas")
        except ModuleNotFoundError as error:
            if error.name != "pandas":
                raise
            raise ImportError(
                'to_frame needs the package pandas: python -m pip install "beltdyn[report]"'
            ) from None
        return pandas.DataFrame(flat.numbers(self), columns=list(flat.Number._fields))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
