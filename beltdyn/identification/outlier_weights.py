"""SciPy's losses: the cost of residuals and their weights in the linearised problem."""

from __future__ import annotations

from importlib import import_module

import numpy as np

from ..base.checks import Array

__all__ = ["LOSSES", "cost_and_weights"]

#: Those of ``scipy.optimize.least_squares`` whose cost grows without bound with the residual.
LOSSES = ("linear", "soft_l1", "huber", "cauchy")


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
