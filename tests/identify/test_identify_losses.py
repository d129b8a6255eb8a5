"""The losses of residuals, which come from SciPy, against their closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from beltdyn.identification.losses import LOSSES, cost_and_weights

#: Of z = f^2: the loss and its derivative, as SciPy's manual has them.
CLOSED: dict[str, tuple[Callable[..., np.ndarray], Callable[..., np.ndarray]]] = {
    "linear": (lambda z: z, np.ones_like),
    "soft_l1": (lambda z: 2.0 * (np.sqrt(1.0 + z) - 1.0), lambda z: (1.0 + z) ** -0.5),
    "huber": (
        lambda z: np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0),
        lambda z: np.maximum(z, 1.0) ** -0.5,
    ),
    "cauchy": (np.log1p, lambda z: 1.0 / (1.0 + z)),
}


@pytest.mark.parametrize("loss", LOSSES)
def test_cost_and_weights(loss: str) -> None:
    f = np.random.default_rng(1).standard_cauchy(500)
    f[:4] = 0.0, 1.0, -1.0, 1e-170
    cost, weights = cost_and_weights(f, loss)
    rho, slope = CLOSED[loss]
    assert cost == pytest.approx(0.5 * np.sum(rho(f**2)), rel=1e-13)
    np.testing.assert_allclose(weights, slope(f**2), rtol=1e-14)
    assert cost_and_weights(np.array([0.0, np.inf]), loss)[0] == np.inf
