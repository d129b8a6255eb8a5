"""Load cycles of a link: rainflow counts of the force in its joint (ASTM E1049-85, 5.4.4)."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Array
from ..base.optional import optional_module
from ..outputs.averages import integral
from ..outputs.places import follow
from .rows import Cycle
from .window import Window

#: Classes of ranges in a report.
CLASSES = 8
#: Share of the tension at rest: cycles below it are rounding.
NEGLIGIBLE_RANGE = 1e-6


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
    library = optional_module("rainflow", "counting load cycles", "report")
    samples = np.asarray(values, dtype=float).tolist()
    return [
        Cycle(range=float(size), mean=float(mean), count=float(count))
        for size, mean, count, *_ in library.extract_cycles(samples)
    ]


def cycle_rows(window: Window, joint: int) -> dict[str, Any]:
    """Count the cycles of a joint over the last round of the belt or, if longer, the window."""
    run, driver, flows = window.run, window.driver, window.params._flows
    found: dict[str, Any] = {"cycles": (), "cycles_begin": float(window.t[0]), "rounds": None}
    for name in window.missing(("joints.force", "belt.passed"))[:1]:
        window.notes.append(f"no load cycles: {name} was not asked for")
        return found
    first, rounds = window.rows.start, None
    if driver is not None:
        gone = _gone(window, driver)
        before = np.flatnonzero(gone >= 1.0)
        first = min(first, int(before[-1]) if before.size else 0)
        rounds = float(gone[first])
    found |= {"cycles_begin": float(run.t[first]), "rounds": rounds}
    try:
        force = run.joints.force[first:]
        if flows:
            cells, _ = follow(window.params, force, run.belt.passed[first:], joint)
            values = force[np.arange(cells.size), cells]
        else:
            values = force[:, joint]
        cycles = rainflow(values)
    except ImportError as error:
        window.notes.append(str(error))
        return found
    if rounds is None or rounds < 1.0:
        part = "the belt stands still" if rounds is None else f"the run holds {rounds:.2g} rounds"
        window.notes.append(f"load cycles of a whole round: {part}, so not every pulley is in them")
    faint = NEGLIGIBLE_RANGE * float(window.params.info["strain_tension"])
    kept = [one for one in cycles if one.range > faint]
    return found | {"cycles": tuple(_classes(kept))}


def _gone(window: Window, driver: int) -> Array:
    """Return the rounds of the belt from each sample of the run to its end (n_t,)."""
    run, params = window.run, window.params
    rim = np.abs(run.pulleys.omega[:, driver]) * params.pulleys[driver].radius
    return integral(-run.t[::-1], rim[::-1])[::-1] / float(params.info["path_length"])


def _classes(cycles: list[Cycle]) -> list[Cycle]:
    """Put cycles into classes by their ranges, and average in each."""
    ranges, means, counts = np.array([attrs.astuple(one) for one in cycles]).reshape(-1, 3).T
    which = np.minimum(CLASSES * ranges / ranges.max(initial=0.0), CLASSES - 1).astype(int)
    found = []
    for one in np.unique(which)[::-1]:
        inside = which == one
        total = float(counts[inside].sum())
        size, mean = (float(np.sum((a * counts)[inside]) / total) for a in (ranges, means))
        found.append(Cycle(range=size, mean=mean, count=total))
    return found
