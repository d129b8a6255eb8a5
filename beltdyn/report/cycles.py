"""Load cycles of a link: rainflow counts of the force in its joint (ASTM E1049-85, 5.4.4)."""

from __future__ import annotations

from importlib import import_module

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Array
from .rows import Cycle
from .touching import Touching
from .window import Window

__all__ = ["cycle_rows", "rainflow"]

#: Classes of ranges in a report.
CLASSES = 8


def rainflow(values: ArrayLike) -> list[Cycle]:
    """Count the cycles of a history by rainflow, with their residue as half cycles.

    Args:
        values: The history (n,), such as the force in a joint [N].

    Returns:
        Cycles in the order in which they close, halves of 0.5 last.

    Raises:
        ImportError: The package rainflow is not installed.

    Source: ASTM E1049-85, Standard Practices for Cycle Counting in Fatigue Analysis, 5.4.4.
    """
    try:
        library = import_module("rainflow")
    except ModuleNotFoundError as error:
        if error.name != "rainflow":
            raise
        raise ImportError(
            'load cycles need the package rainflow: python -m pip install "beltdyn[report]"'
        ) from None
    samples = np.asarray(values, dtype=float).tolist()
    return [
        Cycle(range=float(size), mean=float(mean), count=float(count))
        for size, mean, count, *_ in library.extract_cycles(samples)
    ]


def cycle_rows(
    window: Window, touching: Touching | None, joint: int
) -> tuple[list[Cycle], float | None, list[str]]:
    """Count the cycles of a joint in the window, in classes of equal width.

    Returns:
        Cycles, largest range first; rounds of the belt in the window, None if not known; what is
        missing.
    """
    run = window.run
    if not run._has("joints.force"):
        return [], None, ["no load cycles: joints.force was not asked for"]
    rounds = None
    if touching is not None:
        rounds = abs(touching.speed) * window.lasts / float(window.params.info["length"])
    try:
        cycles = rainflow(window.of(run.joints.force)[:, joint])
    except ImportError as error:
        return [], rounds, [str(error)]
    notes = []
    if rounds is not None and rounds < 1.0:
        notes.append(
            f"load cycles: the window holds {rounds:.2g} rounds of the belt, so not every pulley "
            "is in them; report(last=...) takes more of the run"
        )
    return _classes(cycles), rounds, notes


def _classes(cycles: list[Cycle]) -> list[Cycle]:
    """Put cycles into classes by their ranges, and average in each."""
    if not cycles:
        return []
    ranges = np.array([one.range for one in cycles])
    largest = float(ranges.max())
    if largest == 0.0:
        return []
    index = np.minimum((CLASSES * ranges / largest).astype(int), CLASSES - 1)
    means = np.array([one.mean for one in cycles])
    counts = np.array([one.count for one in cycles])
    found = []
    for which in range(CLASSES - 1, -1, -1):
        inside = index == which
        total = float(counts[inside].sum())
        if total > 0.0:
            found.append(
                Cycle(
                    range=_mean(ranges[inside], counts[inside]),
                    mean=_mean(means[inside], counts[inside]),
                    count=total,
                )
            )
    return found


def _mean(values: Array, weights: Array) -> float:
    return float(np.sum(values * weights) / np.sum(weights))
