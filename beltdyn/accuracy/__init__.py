"""How accurate a run is: what engineers read off it, how two runs differ in it, what it costs.

::

    study       error and CPU time of a scene by method, tolerance and number of links
    suggest     the cheapest setting for an error, from short runs on coarse meshes
"""

from __future__ import annotations

from ..base.described import describe_all
from ..outputs.accuracy_report import Accuracy, Expected, QuantityError
from ..verification.quantities import QUANTITIES, Observed, differences, observe, with_links
from .studies import quick, study
from .study_table import Row, Study
from .suggestion import Suggestion, suggest

__all__ = [
    "QUANTITIES",
    "Accuracy",
    "Expected",
    "Observed",
    "QuantityError",
    "Row",
    "Study",
    "Suggestion",
    "differences",
    "observe",
    "quick",
    "study",
    "suggest",
    "with_links",
]

describe_all(map(globals().__getitem__, __all__))
