"""A report, as text, dictionaries and data frames."""

from __future__ import annotations

from typing import Any

import attrs

from ..base.checks import flag
from ..base.optional import optional_module
from ..base.rounding import plain
from . import brief, flat, text
from .rows import ReportData


def _with_fields(cls: type[Report]) -> type[Report]:
    """Append what ReportData says of its fields to the docstring."""
    _, section, texts = (ReportData.__doc__ or "").partition("\n    Attributes:\n")
    cls.__doc__ = cls.__doc__ and f"{cls.__doc__.rstrip()}\n{section}{texts}"
    return cls


@_with_fields
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
        found: dict[str, Any] = plain(attrs.asdict(self))
        first = self.first_to_slip
        for row, one in zip(self.creep, found["creep"], strict=True):
            one["slower"] = row.slower
        found["steady"] = not self.unsteady
        found["first_to_slip"] = None if first is None else first.name
        return found

    def to_frame(self) -> Any:
        """Return a pandas.DataFrame, a number a row: part, name, quantity, unit, value and text.

        SI units, angles in rad. Parts are "report" for the run as a whole, "pulleys", "spans",
        "mounts", "creep", "powers" and "cycles". Texts, such as the kind of a power or a note,
        stand in the last column, with a value of NaN; yes is 1 and no 0.

        Raises:
            ImportError: pandas is not installed.
        """
        pandas = optional_module("pandas", "to_frame", "report")
        return pandas.DataFrame(flat.numbers(self), columns=list(flat.Number._fields))
