"""Drives that run away are told as unstable, against all eigenvalues of the matrix and a run."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
import pytest
from drives import reduction

import beltdyn as bd
from beltdyn.vibration.linear import linearise
from beltdyn.vibration.torque_slopes import torque_slopes

Array = np.ndarray[Any, Any]


def feeding(t: float, theta: Array, omega: Array) -> list[float]:
    """A torque that grows with the speed, as of a motor on a falling characteristic."""
    return [0.0, 2.0 * omega[1]]


def test_a_torque_that_feeds() -> None:
    """All with a real part > 0 and no oscillation that LAPACK finds; the run grows as the first."""
    params = reduction(axial_damping=50.0)
    state = bd.settle(params)
    with pytest.warns(bd.BeltdynWarning, match="unstable: rotation of pulley 1"):
        modes = bd.modes(params, state, feeding, n=4)
    matrix = linearise(params, state, torque_slopes(params, state, feeding)).matrix.toarray()
    values = np.linalg.eigvals(matrix)
    expected = values[(values.real > 0.1) & (abs(values.imag) < 1e-3 * abs(values))].real
    assert len(expected) == 2  # the mesh makes of the turning's second eigenvalue, 0, another one
    assert np.allclose(modes.grows.real, np.sort(expected)[::-1], rtol=1e-4)
    assert str(modes).splitlines()[1].startswith("  unstable: rotation of pulley 1")
    start = attrs.evolve(state, omega=1e-3 * params.route.senses / np.array([0.06, 0.1]))
    t = np.array([0.04, 0.06, 0.08])
    omega = bd.simulate(params, feeding, t[-1], initial=start, t_eval=t, rtol=1e-6).pulleys.omega
    growth = np.diff(np.log(abs(omega[:, 1]))) / np.diff(t)
    assert growth == pytest.approx(modes.grows[0].real, rel=0.05)


def test_a_stable_drive_grows_nowhere() -> None:
    """And what a mesh alone turns away is no growth of the drive: turning has it."""
    for n in (60, 120):
        params = reduction(n)
        state = bd.settle(params)
        modes = bd.modes(params, state, n=2)
        assert not modes.grows.size
        assert modes.turning is not None
