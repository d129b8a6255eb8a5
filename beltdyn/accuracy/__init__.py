"""How accurate a run is: what engineers read off it, how two runs differ in it, what it costs.

::

    study       error and CPU time of a scene by method, tolerance and number of links
    suggest     the cheapest setting for an error, from short runs on coarse meshes
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..base.described import describe_all
from ..outputs.accuracy_report import Accuracy, Expected, QuantityError
from ..verification.quantities import QUANTITIES, Observed, differences, observe, with_links

if TYPE_CHECKING:
    from .studies import quick as quick
    from .studies import study as study
    from .study_rows import Row as Row
    from .study_table import Study as Study
    from .suggestion import Suggestion as Suggestion
    from .suggestion import suggest as suggest

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

#: Where to find what few programs need: imported when it is first asked for.
_LATE = {
    "Row": "study_rows",
    "Study": "study_table",
    "Suggestion": "suggestion",
    "quick": "studies",
    "study": "studies",
    "suggest": "suggestion",
}


def __getattr__(name: str) -> Any:
    if name in _LATE:
        found = globals()[name] = getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
        describe_all((found,))
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


describe_all(globals().get(name) for name in __all__)
