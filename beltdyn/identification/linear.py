"""The linearised problem: weights, covariance, directions that the data do not determine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib import import_module

import attrs
import numpy as np

from ..base.checks import Array

#: Losses of ``scipy.optimize.least_squares`` whose cost grows without bound with the residual.
LOSSES = ("linear", "soft_l1", "huber", "cauchy")

#: Singular values below this share of the largest are rounding errors.
_RANK = 1e-9
#: Smaller components of a direction, relative to its largest, are left out.
_LEAST_WEIGHT = 0.1
#: Pairs of parameters whose estimates are correlated more strongly are listed.
_CORRELATED = 0.95


@attrs.frozen(kw_only=True)
class Combination:
    """Parameters that can change together with hardly any effect on the data.

    Attributes:
        weights: Change of each of them, as its logarithm or as a share of its size; the squares add
            up to 1.
        std: Standard deviation along this direction, the other directions unchanged; for
            logarithms exp(std) is a factor. Infinite if the data do not change at all.
        correlation: Correlation of the estimates, for a pair listed for its correlation; else None.
    """

    weights: Mapping[str, float]
    std: float
    correlation: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(self.weights)

    def __str__(self) -> str:
        first, *others = self.weights.items()
        if not others:
            return f"{first[0]} alone"
        words = [f"{name} {'up' if weight * first[1] > 0 else 'down'}" for name, weight in others]
        text = f"{first[0]} up with {', '.join(words)}"
        return text if self.correlation is None else f"{text} (correlation {self.correlation:.3f})"


def cost_and_weights(residuals: Array, loss: str) -> tuple[float, Array]:
    """Return the cost, 1/2 sum rho(f^2), and the weights rho'(f^2) of residuals f.

    SciPy has no public functions for its losses, but it returns the cost and its gradient at the
    starting point of a search. For the identity as a function of f the gradient is rho'(f^2) f. The
    cost is infinite if a residual is not finite.
    """
    if not np.isfinite(residuals).all():
        return np.inf, np.zeros_like(residuals)
    size = residuals.size
    at_start = import_module("scipy.optimize").least_squares(
        lambda f: f,
        residuals,
        jac=lambda _: import_module("scipy.sparse").eye_array(size, format="csr"),
        loss=loss,
        max_nfev=1,
    )
    is_zero = residuals == 0.0
    weights = at_start.grad / np.where(is_zero, 1.0, residuals)
    return float(at_start.cost), np.where(is_zero, 1.0, weights)


def _split(jacobian: Array) -> tuple[Array, Array, int]:
    """Return singular values and vectors (as columns, all n_free), and the rank."""
    _, values, rows = np.linalg.svd(jacobian, full_matrices=True)
    singular = np.zeros(jacobian.shape[1])
    singular[: values.size] = values
    largest = singular.max(initial=0.0)
    return singular, rows.T, int((singular > _RANK * largest).sum())


def covariance(jacobian: Array) -> Array:
    """Return the covariance (n_free, n_free) from a Jacobian in standard deviations.

    Infinite, with a sign off the diagonal, along directions that the data do not determine.
    """
    singular, vectors, rank = _split(jacobian)
    known, open_ = vectors[:, :rank], vectors[:, rank:]
    spread = (known / singular[:rank] ** 2) @ known.T
    nowhere = open_ @ open_.T
    return np.asarray(np.where(np.abs(nowhere) > 1e-8, np.copysign(np.inf, nowhere), spread))


def correlation(jacobian: Array) -> Array:
    """Return the correlation (n_free, n_free); undetermined directions count as very wide."""
    singular, vectors, rank = _split(jacobian)
    # Wide enough to outweigh everything known, narrow enough for 1 - |r| to be right to 1e-6.
    least = (singular[rank - 1] if rank else 1.0) * 1e-4
    wide = vectors / np.where(np.arange(singular.size) < rank, singular, least) ** 2 @ vectors.T
    scale = np.sqrt(np.diag(wide))
    return np.asarray(np.clip(wide / np.outer(scale, scale), -1.0, 1.0))


def leverage(jacobian: Array) -> Array:
    """Return the part of each residual (n,) that the free parameters can absorb."""
    left, singular, _ = np.linalg.svd(jacobian, full_matrices=False)
    rank = int((singular > _RANK * singular.max(initial=0.0)).sum())
    return np.asarray((left[:, :rank] ** 2).sum(axis=1))


def _sparse(basis: Array) -> Array:
    """Return a basis of the same space (columns) in which each has a parameter of its own."""
    basis = basis.copy()
    pivots: list[int] = []
    for k in range(basis.shape[1]):
        rest = np.abs(basis[:, k:])
        rest[pivots] = -1.0
        row, column = np.unravel_index(int(np.argmax(rest)), rest.shape)
        basis[:, [k, k + int(column)]] = basis[:, [k + int(column), k]]
        pivots.append(int(row))
        basis[:, k] /= basis[row, k]
        others = [j for j in range(basis.shape[1]) if j != k]
        basis[:, others] -= np.outer(basis[:, k], basis[row, others])
    return np.asarray(basis / np.linalg.norm(basis, axis=0))


def _combination(
    names: Sequence[str], weights: Array, std: float, correlation: float | None = None
) -> Combination:
    # Rounding does not decide which of two equal parts comes first.
    order = np.argsort(-np.abs(weights).round(6), kind="stable")
    kept = [k for k in order if abs(weights[k]) >= _LEAST_WEIGHT * abs(weights[order[0]])]
    sign = math.copysign(1.0, weights[order[0]])
    return Combination(
        weights={names[k]: sign * float(weights[k]) for k in kept},
        std=std,
        correlation=correlation,
    )


def combinations(names: Sequence[str], jacobian: Array, limit: float) -> tuple[Combination, ...]:
    """List the combinations of parameters that the data cannot distinguish."""
    singular, vectors, rank = _split(jacobian)
    with np.errstate(divide="ignore"):
        loose = (np.arange(singular.size) >= rank) | (singular * limit < 1.0)
    found = []
    for direction in _sparse(vectors[:, loose]).T:
        change = float(np.linalg.norm(jacobian @ direction))
        known = change > _RANK * singular.max(initial=0.0) and change > 0.0
        found.append(_combination(names, direction, 1.0 / change if known else math.inf))
    together = [set(combination.names) for combination in found]
    related = correlation(jacobian)
    spread = np.sqrt(np.diag(covariance(jacobian)))
    for i in range(len(names)):
        for k in range(i):
            pair = {names[i], names[k]}
            if abs(related[i, k]) > _CORRELATED and not any(pair <= others for others in together):
                weights = np.zeros(len(names))
                weights[k], weights[i] = spread[k], math.copysign(spread[i], related[i, k])
                if not np.isfinite(weights).all():
                    weights[k], weights[i] = 1.0, math.copysign(1.0, related[i, k])
                std = float(np.linalg.norm(weights))
                found.append(_combination(names, weights / std, std, float(related[i, k])))
    return tuple(found)
