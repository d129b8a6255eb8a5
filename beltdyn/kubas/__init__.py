"""The paper this package starts from: its stated numbers and its figures, beside our runs.

K. Kubas, "A model for the dynamic analysis of a belt transmission using the Dahl friction model".

:func:`runs` simulates the paper's cases, :func:`compare` sets its numbers beside ours, and
:mod:`beltdyn.kubas.figures` (which needs matplotlib) draws its figures.

The library knows nothing of this package, which only the command ``beltdyn figures`` imports. This
package uses the library; the paper's drives are scenes there (:func:`beltdyn.scenes.kubas_case_1`).
"""

from .cases import LINKS, Runs, runs
from .rows import QUANTITIES, Links, Quantity
from .table import Comparison, Line, compare

__all__ = [
    "LINKS",
    "QUANTITIES",
    "Comparison",
    "Line",
    "Links",
    "Quantity",
    "Runs",
    "compare",
    "runs",
]
