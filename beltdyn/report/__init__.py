"""What an engineer reads off a run: a report in units, by name, with what could not be told.

``result.report()`` makes it (:class:`Report`). Each part is a module: ``window`` (which samples,
and whether they are steady), ``touching`` (where belt and pulleys touch), ``pulleys``, ``slipping``
(friction in use), ``margin`` (to full slip), ``spans``, ``creep``, ``powers``, ``cycles``, and
``text`` for how it is printed.
"""

from __future__ import annotations

from .cycles import rainflow
from .making import LAST, creep_of, make_report
from .report import Report
from .rows import Creep, Cycle, Power, PulleyRow, Rows, SpanRow, Spread

__all__ = [
    "LAST",
    "Creep",
    "Cycle",
    "Power",
    "PulleyRow",
    "Report",
    "Rows",
    "SpanRow",
    "Spread",
    "creep_of",
    "make_report",
    "rainflow",
]
