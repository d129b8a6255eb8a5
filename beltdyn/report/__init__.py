"""Reports: what an engineer reads off a run, in units and by name (``result.report()``)."""

from __future__ import annotations

from ..base.described import describe_all
from . import rows
from .creep import creep_rows
from .cycles import rainflow
from .digits import speed_errors
from .report import Report, make_report
from .rows import Creep, Cycle, MountRow, Power, PulleyRow, Rows, SpanRow, Spread
from .window import Window

__all__ = [
    "Creep",
    "Cycle",
    "MountRow",
    "Power",
    "PulleyRow",
    "Report",
    "Rows",
    "SpanRow",
    "Spread",
    "Window",
    "creep_rows",
    "make_report",
    "rainflow",
    "speed_errors",
]

describe_all((Report, *vars(rows).values()))
