"""How accurate a run is: what engineers read off it, how two runs differ in it, what it costs.

::

    study       error and CPU time of a scene by method, tolerance and number of links
    suggest     the cheapest setting for an error, from short runs on coarse meshes
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..accuracy_report import Accuracy, Expected, QuantityError
from .quantities import QUANTITIES, Observed, differences, observe, with_links

if TYPE_CHECKING:
    from .rows import Row as Row
    from .studies import quick as quick
    from .studies import study as study
    from .suggestion import Suggestion as Suggestion
    from .suggestion import suggest as suggest
    from .table import Study as Study

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

#: Where to find what itself runs simulations, and so cannot be imported by :mod:`.simulation`.
_LATE = {
    "Row": "rows",
    "Study": "table",
    "Suggestion": "suggestion",
    "quick": "studies",
    "study": "studies",
    "suggest": "suggestion",
}


def __getattr__(name: str) -> Any:
    if name in _LATE:
        return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
