"""The error of a mesh, from runs on other meshes."""

from __future__ import annotations

import math

import numpy as np

from ..base.checks import Array
from ..outputs.averages import time_weights
from .quantities import HISTORIES, Observed

#: Range of the order that the extrapolation believes in: below 1 it would multiply differences by
#: more than the noise in them allows, and no mesh here converges faster than with order 2.
ORDERS = (1.0, 2.0)
#: Order assumed of creep, and where there are two meshes only: between the two.
ASSUMED = 1.5
#: Differences of meshes whose directions have at least this cosine have a common trend.
TREND = 0.5
#: Orders beyond this range are chance.
SEEN = (0.5, 4.0)


def space_error(
    quantity: str,
    run: Observed,
    coarse: tuple[float, Observed] | None,
    fine: tuple[float, Observed] | None,
    until: float = math.inf,
) -> tuple[float | None, float | None]:
    """Return the error of the mesh of a run, relative to the scale of the quantity, and its order.

    Two estimates are made, and their root mean square is given, because either can be small by
    chance: what a mesh makes wrong has a trend with the number of links, and a part that depends on
    where the links lie, which may agree on two meshes and not on a third.

    From the finer mesh: the difference to it, plus what its own trend still lacks, the geometric
    series of that difference with the observed order. The trend counts as far as the difference of
    the finer mesh to the run points the same way, as histories or as vectors of pulleys, as the
    difference of the run to the coarser one (the cosine of the two). From the coarser mesh: the
    difference to it over 2^p - 1, Richardson's estimate, with order 2 or, where a trend is seen
    that is steeper, as where the coarse mesh is very coarse, with its order. Creep converges more
    slowly, because the zone where the belt sticks ends at some link: order 1.5.
    """
    from_coarse = from_fine = None
    if coarse is not None:
        from_coarse = _difference(quantity, coarse[1], run, run, until)
    if fine is not None:
        from_fine = _difference(quantity, run, fine[1], run, until)
    if coarse is None or from_coarse is None:
        if fine is None or from_fine is None:
            return None, None
        return _size(quantity, from_fine) / (1.0 - fine[0] ** -ASSUMED), None
    size_coarse = _size(quantity, from_coarse)
    if fine is None or from_fine is None:
        return size_coarse / (coarse[0] ** -ASSUMED - 1.0), None
    size_fine = _size(quantity, from_fine)
    common = _cosine(from_coarse, from_fine)
    order = _order(size_coarse, size_fine, coarse[0], fine[0])
    left = fine[0] ** -min(max(order, ORDERS[0]), ORDERS[1])
    extrapolated = size_fine * (1.0 + max(0.0, common) * left / (1.0 - left))
    trend = common >= TREND
    expected = ASSUMED if quantity == "creep" else ORDERS[1]
    if trend and expected == ORDERS[1]:
        expected = min(max(order, expected), SEEN[1])
    richardson = size_coarse / (coarse[0] ** -expected - 1.0)
    seen = trend and SEEN[0] <= order <= SEEN[1]
    return math.hypot(extrapolated, richardson) / math.sqrt(2.0), order if seen else None


def _difference(quantity: str, a: Observed, b: Observed, run: Observed, until: float) -> Array:
    """Return the difference as one vector; of histories, its length is the root mean square."""
    scale = run.scales[quantity] or max(a.scales[quantity], b.scales[quantity]) or 1.0
    apart = (getattr(a, quantity) - getattr(b, quantity)) / scale
    if quantity in HISTORIES:
        weights = time_weights(run.t, run.t[0], until)
        apart = apart * np.sqrt(weights / apart.shape[1])[:, None]
    return np.asarray(apart.ravel())


def _size(quantity: str, difference: Array) -> float:
    if quantity in HISTORIES:
        return float(np.linalg.norm(difference))
    return float(np.max(np.abs(difference)))


def _cosine(a: Array, b: Array) -> float:
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / lengths if lengths > 0.0 else 0.0


def _order(coarse: float, fine: float, less: float, more: float) -> float:
    """Solve coarse/fine = (less^-p - 1) / (1 - more^-p), which rises with p, for p in 0.1, 6."""
    # The ratio of the differences of meshes with less, 1 and more times the links, of errors C/n^p.
    orders = np.linspace(0.1, 6.0, 600)
    ratios = (less**-orders - 1.0) / (1.0 - more**-orders)
    return float(np.interp(coarse / fine if fine > 0.0 else math.inf, ratios, orders))
