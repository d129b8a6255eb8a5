"""The number of eigenvalues in a part of the complex plane, without finding any.

By the principle of the argument: as z goes round a region once, det(z - J) turns once round 0 for
each eigenvalue inside. A sparse LU gives its argument. det is divided by z^m first, m the number of
friction states, for friction that sticks makes so many eigenvalues of 0, all outside, which would
turn it most. Each side of the outline is halved until no half turns by more than a quarter.

That counts exactly, unless both halves of a step turn by nearly a whole turn more than is seen. On
twelve drives, four at rest in forty regions each and eight at rest and running in four (those of
tests/test_modes.py), 16 steps of a side miscounted 15 of 224 times, always too few; 50 never. Such
an error would have to be just that of a search to pass unseen: a count that agrees with it is as
good as a proof. One that does not is repeated with shorter steps before anything is said.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.optional import scipy_module
from .linearised import Linear, scipy_sparse

#: Largest turn of a step; steps of each side at first, in one try after the other; most points.
QUARTER, STEPS, MOST = 0.5 * np.pi, (50, 150), 5000


def counted(linear: Linear, found: int, low: float, high: float, damping: float) -> int | None:
    """Count as :func:`count` does, until it is the number found or steps are shortest."""
    for steps in STEPS:
        seen = count(linear, low, high, damping, steps)
        if seen == found:
            break
    return seen


def count(linear: Linear, low: float, high: float, damping: float, steps: int) -> int | None:
    """Count eigenvalues with low < |z| < high [rad/s], |Re z| < damping |z| and Im z > 0.

    None: the outline of this region took too many points.
    """
    argument = _argument(linear, float(np.sqrt(low * high)))
    tilt = np.arcsin(damping)
    left, right = 1j * np.exp(1j * tilt), 1j * np.exp(-1j * tilt)
    corners = np.log([high * right, high * left, low * left, low * right, high * right])
    waiting: list[Any] = []  # pairs of a place, as log z, and the argument there
    for start, end in pairwise(corners):
        places = start + (end - start) * np.linspace(0.0, 1.0, steps + 1)
        waiting += pairwise([(place, argument(np.exp(place))) for place in places])
    total, points = 0.0, len(waiting)
    while waiting:
        (a, at_a), (b, at_b) = waiting.pop()
        middle = 0.5 * (a + b)
        at = argument(np.exp(middle))
        points += 1
        one, other = _turn(at - at_a), _turn(at_b - at)
        if max(abs(one), abs(other), abs(one + other)) < QUARTER:
            total += one + other
        elif points > MOST:
            return None
        else:
            waiting += [((a, at_a), (middle, at)), ((middle, at), (b, at_b))]
    return round(total / (2.0 * np.pi))


def _argument(linear: Linear, rate: float) -> Callable[[complex], float]:
    """Return the argument of det(z - J) / z^m as a function of z."""
    sparse, linalg = scipy_sparse()
    matrix = linear.scaled(rate)[1]
    one = sparse.identity(linear.size, format="csc")
    m = int(np.count_nonzero(linear.names == "mu"))

    def argument(z: complex) -> float:
        lu = linalg.splu((z * one - matrix).tocsc())
        turned = np.pi * (_odd(lu.perm_r) != _odd(lu.perm_c)) - m * np.angle(z)
        return float(np.sum(np.angle(lu.U.diagonal())) + turned)

    return argument


def _odd(permutation: Any) -> bool:
    """Whether a permutation is odd, as its length less the number of its cycles is."""
    n = len(permutation)
    sparse, graphs = scipy_sparse()[0], scipy_module("sparse.csgraph", "counting modes")
    to = sparse.csr_matrix((np.ones(n), permutation, np.arange(n + 1)), shape=(n, n))
    return bool((n - graphs.connected_components(to, return_labels=False)) % 2)


def _turn(angle: float) -> float:
    """Return the same angle between -pi and pi."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
