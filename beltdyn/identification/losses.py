"""SciPy's losses: how much a residual costs, and what weight it keeps once linearised."""

from __future__ import annotations

from importlib import import_module

import numpy as np

from ..checks import Array

__all__ = ["LOSSES", "cost_and_weights"]

#: Those of ``scipy.optimize.least_squares`` under which an outlier costs ever more.
LOSSES = ("linear", "soft_l1", "huber", "cauchy")


def cost_and_weights(residuals: Array, loss: str) -> tuple[float, Array]:
    """Give the cost, 1/2 sum rho(f^2), and the weights rho'(f^2) of residuals f.

    SciPy names its losses but does not hand them out. It gives the cost of a function and its
    gradient at a starting point, though, and those of f itself, by f, are these: the gradient of
    the cost is rho'(f^2) f. Infinite where a residual is not finite.
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
