"""The tension of free spans, from the forces of the joints and from what touches the pulleys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import _core
from .checks import Array

__all__ = ["span_tension"]


def span_tension(touched: NDArray[np.int32], force: Array, n_pulleys: int) -> Array:
    """Give the mean joint force of the free span that follows each pulley (n_t, n_p) [N].

    Only joints between two links that touch nothing count, and not where links have lifted off
    within a wrap.

    Args:
        touched: The pulley that each link touches, or -1 (n_t, n_b).
        force: Force in the joint on the left of each link (n_t, n_b) [N].
        n_pulleys: Number of pulleys, n_p.

    Returns:
        NaN where a span has no such joint.
    """
    return _core.span_tension(np.asarray(touched, dtype=np.int32), force, n_pulleys)
