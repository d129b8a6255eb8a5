"""The paper on which this package is based: its numbers and figures beside ours.

K. Kubas, "A model for the dynamic analysis of a belt transmission using the Dahl friction model".

:func:`runs` simulates the paper's cases, :func:`compare` compares its numbers with ours, and
:mod:`beltdyn_kubas.figures` (which needs matplotlib) draws its figures.

This package uses the public interface of beltdyn alone, as a user's script does, and is installed
with it for the command ``beltdyn figures``. The paper's drives are scenes of beltdyn
(:func:`beltdyn.scenes.kubas_case_1`).
"""

from .cases import LINKS, Runs, runs
from .paper_numbers import QUANTITIES, Links, Quantity
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
