"""The tension of free spans, from the forces of the joints and from what touches the pulleys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .checks import Array

__all__ = ["span_tension"]


def span_tension(touched: NDArray[np.int32], force: Array, n_pulleys: int) -> Array:
    """Give the mean joint force of the free span that follows each pulley (n_t, n_p) [N].

    Only joints between two links that touch nothing count.

    Args:
        touched: The pulley that each link touches, or -1 (n_t, n_b).
        force: Force in the joint on the left of each link (n_t, n_b) [N].
        n_pulleys: Number of pulleys, n_p.

    Returns:
        NaN where a span has no such joint.
    """
    before = _last_touched(touched)
    after = _last_touched(touched[:, ::-1])[:, ::-1]
    free = touched < 0
    in_span = free & np.roll(free, 1, axis=1) & (before >= 0)
    if n_pulleys > 1:
        # A link lifted off within a wrap is not in a span.
        in_span &= before != after
    tension = np.full((touched.shape[0], n_pulleys), np.nan)
    for k in range(n_pulleys):
        here = in_span & (before == k)
        count = here.sum(axis=1)
        total = np.where(here, force, 0.0).sum(axis=1)
        np.divide(total, count, out=tension[:, k], where=count > 0)
    return tension


def _last_touched(touched: NDArray[np.int32]) -> NDArray[np.int32]:
    """Give the pulley touched by each link, or else by the nearest one before it; -1: none."""
    n_b = touched.shape[1]
    twice = np.concatenate([touched, touched], axis=1)
    index = np.where(twice >= 0, np.arange(2 * n_b), 0)
    nearest = np.maximum.accumulate(index, axis=1)[:, n_b:]
    return np.take_along_axis(twice, nearest, axis=1)
