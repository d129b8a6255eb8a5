"""States that are no equilibrium and drives that run away are told, and steady ones are not.

Independent of the package's own measure: what is done to a settled state by hand, and that a drive
run until nothing changes is steady by definition; all eigenvalues of the matrix, and a run.
"""

from __future__ import annotations

import warnings
from typing import Any

import attrs
import numpy as np
import pytest
from drives import reduction
from mounted_drives import take_up
from test_modes_turning import fan_drive

import beltdyn as bd
from beltdyn.vibration.equilibrium import imbalance
from beltdyn.vibration.linear import linearise
from beltdyn.vibration.torque_slopes import torque_slopes


def noisy(state: bd.State, size: float) -> bd.State:
    noise = size * np.random.default_rng(0).standard_normal(state.x.size)
    return attrs.evolve(state, x=state.x + noise)


CHANGES = {
    "noise of 1e-4 m": lambda state: noisy(state, 1e-4),
    "noise of 10 mm": lambda state: noisy(state, 1e-2),
    "arm moved": lambda state: attrs.evolve(state, travel=state.travel + 0.05),
    "arm moved a little": lambda state: attrs.evolve(state, travel=state.travel - 0.002),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_displaced_state_is_told(name: str) -> None:
    """With constant torques too, which balance pulleys, but neither links nor mounts."""
    params = fan_drive(80)
    state = CHANGES[name](bd.settle(params))
    with pytest.warns(bd.BeltdynWarning, match="not_in_equilibrium"):
        bd.frequency_response(params, state, [20.0], torque=0)


@pytest.mark.parametrize("make", [reduction, take_up, lambda: bd.scenes.conveyor(60).params])
def test_a_settled_state_is_in_equilibrium(make: Any) -> None:
    """To the tolerance of settling, of which the threshold, 1 %, is far."""
    params = make()
    state = bd.settle(params)
    assert imbalance(params, state, None, ())[0] < 1e-6
    assert imbalance(params, state, bd.Viscous([0.0] * len(params.pulleys)), ())[0] < 1e-6


def test_a_steady_run_is_steady() -> None:
    """At one moment its pulley has 3 to 4 % of the tension left over, over a passing under 1 %.

    Before it is steady, and shaken, it is told.
    """
    params, load = reduction(120), bd.Viscous([0.0, 0.3])
    motion = {0: bd.PiecewiseLinear([0.0], [-100.0])}
    start = bd.settle(params, speed={0: -100.0})
    state = bd.simulate(params, load, 0.5, motion=motion, initial=start).final_state
    with warnings.catch_warnings():
        warnings.simplefilter("error", bd.BeltdynWarning)
        bd.frequency_response(params, state, [20.0], torque=1, motion={0: 0.0}, loads=load)
    for other in (start, noisy(state, 1e-4)):
        with pytest.warns(bd.BeltdynWarning, match="not_in_equilibrium"):
            bd.frequency_response(params, other, [20.0], torque=1, motion={0: 0.0}, loads=load)


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
def test_friction_that_is_nearly_full() -> None:
    """A state of a slipping drive, that of a run: no difference leaves the friction law's bound.

    Forces in joints are those of stretch alone, so the sum of a response is still its parts'.
    """
    params = fan_drive(80)
    state = bd.simulate(params, lambda t, th, om: [-30 if t > 0.02 else 0, 0, 0], 0.05).final_state
    assert abs(state.mu).max() > 0.8 - 1e-6
    one = bd.frequency_response(params, state, [10.0, 20.0], torque="motor")
    ten = bd.frequency_response(params, state, [10.0, 20.0], torque={"motor": 10.0})
    assert np.isfinite(one.joint_force).all()
    assert np.allclose(10.0 * one.joint_force, ten.joint_force, rtol=1e-4)


def feeding(t: float, theta: Any, omega: Any) -> list[float]:
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
