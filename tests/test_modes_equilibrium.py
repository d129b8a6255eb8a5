"""States that are no equilibrium, drives that run away or turn as a whole are told, and no others.

By what is done to a settled state by hand, runs until nothing changes, all eigenvalues of the
matrix, and closed forms.
"""

from __future__ import annotations

import warnings
from typing import Any

import attrs
import numpy as np
import pytest
from drives import light_scene, pressing, reduction, with_belt
from mounted_drives import take_up
from test_modes import dense_jacobian

import beltdyn as bd
from beltdyn.vibration.equilibrium import imbalance
from beltdyn.vibration.linearised import linearise, torque_slopes


def fan_drive(n: int) -> bd.Params:
    arm = {"pivot": (0.10, -0.10), "mass": 0.2, "stiffness": 30.0, "preload": 15.0}
    return bd.Params(
        belt=bd.Belt(n_bodies=n, linear_density=0.1, axial_stiffness=80e3, axial_damping=2.0),
        pulleys=[
            bd.Pulley(name="motor", center=(0, 0), radius=0.06, inertia=0.02),
            bd.Pulley(name="fan", center=(0.35, 0.05), radius=0.05, inertia=0.03),
            pressing((0.17, -0.04), damping=0.2, **arm),
        ],
        friction=bd.Dahl(mu_k=0.8, sigma=1e4),
    )


def noisy(state: bd.State, size: float) -> bd.State:
    noise = size * np.random.default_rng(0).standard_normal(state.x.size)
    return attrs.evolve(state, x=state.x + noise)


def test_settled_states_are_in_equilibrium_and_displaced_ones_told() -> None:
    """To the tolerance of settling, of which the threshold, 1 %, is far; with constant torques too,
    which balance pulleys, but neither links nor mounts.
    """
    for params in (reduction(), take_up(), bd.scenes.conveyor(60).params):
        state, still = bd.settle(params), bd.Viscous([0.0] * len(params.pulleys))
        assert imbalance(params, state, None, ())[0] < 1e-6
        assert imbalance(params, state, still, ())[0] < 1e-6
    params = fan_drive(80)
    rest = bd.settle(params)
    displaced = [noisy(rest, size) for size in (1e-4, 1e-2)]
    displaced += [attrs.evolve(rest, travel=rest.travel + by) for by in (0.05, -0.002)]
    for state in displaced:
        with pytest.warns(bd.BeltdynWarning, match="not_in_equilibrium"):
            bd.frequency_response(params, state, [20.0], torque=0)
    # At one moment its pulley has 3 to 4 % of the tension left over, over a passing under 1 %
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
def test_links_are_compared_with_those_that_were_there_before() -> None:
    """18 m/s: from one place to the next the rims turn links by forces of 3 % of the tension."""
    params, load, speed = reduction(120), bd.Viscous([0.0, 0.3]), -300.0
    motion = {0: bd.PiecewiseLinear([0.0], [speed])}
    start = bd.settle(params, speed={0: speed})
    state = bd.simulate(params, load, 0.4, motion=motion, initial=start).final_state
    assert imbalance(params, state, load, (0,))[0] < 0.01


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


def test_a_torque_that_feeds() -> None:
    """All with a real part > 0 and no oscillation that LAPACK finds; the run grows as the first."""

    def feeding(t: float, theta: Any, omega: Any) -> list[float]:
        """Grows with the speed, as of a motor on a falling characteristic."""
        return [0.0, 2.0 * omega[1]]

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


def test_a_carriage_is_a_mode() -> None:
    """Rims move alike in it too; all the dense matrix has is given but the turning itself."""
    params = take_up()
    state = bd.settle(params)
    modes = bd.modes(params, state, n=4)
    assert len(modes) == 4
    assert modes.names[0] == "carriage of pulley 1"
    values = np.linalg.eigvals(dense_jacobian(params, state))
    values = values[(values.imag > 0) & (abs(values) < 1.001 * abs(modes.eigenvalue[-1]))]
    values = values[(-values.real < 0.5 * abs(values)) & (abs(values) > 1.0)]
    expected = np.sort(abs(values))
    found = np.sort(np.append(abs(modes.eigenvalue), abs(modes.turning)))
    assert len(found) == len(expected)
    assert np.allclose(found, expected, rtol=1e-4)
    # w^2 = k / J, both for the belt's motion; the mesh adds its w^2, met without the spring
    params = reduction()
    state = bd.settle(params)
    mesh = bd.modes(params, state, n=1).turning
    spring = 10.0
    modes = bd.modes(params, state, lambda t, th, om: [-spring * (th[0] - state.theta[0]), 0.0])
    inertia = 0.004 / 0.06**2 + 0.02 / 0.1**2 + 0.1 * float(params.info["length"])
    expected = np.sqrt(spring / 0.06**2 / inertia + abs(mesh) ** 2)
    # the belt between the pulleys is 160 times as stiff as the spring at the rim
    assert modes.turning is None
    assert 2 * np.pi * modes.frequency[0] == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("name", ["conveyor", "fan", "light cells"])
def test_turning_is_no_mode(name: str) -> None:
    """Whatever rims differ by: no mode has rims that all turn along with most of the energy, nor
    where the belt has waves along its spans and friction in cells holds it, at 0.08 Hz.
    """
    params = fan_drive(60) if name == "fan" else bd.scenes.conveyor(60).params
    if name == "light cells":
        params = with_belt(light_scene().params, mesh="ale", n_bodies=None)
    modes = bd.modes(params, bd.settle(params), n=3)
    assert modes.turning is not None
    radii = params.route.senses * np.array([pulley.radius for pulley in params.pulleys])
    for k in range(3):
        rims = radii * modes.shapes.theta[k]
        alike = (rims * rims[0].conj()).real.min() > 0.5 * (abs(rims) ** 2).max()
        energy = modes.participation.pulleys[k].sum() + modes.participation.belt[k]
        assert not (alike and energy > 0.9)


@pytest.mark.parametrize("n", [60, 61])
def test_a_free_drive_turns_as_a_rigid_one(n: int) -> None:
    """theta = M / (-w^2 J), slowly: within 2 %, where the mesh's own 3 Hz made it 1/200.

    Left is how far the turning on the mesh is not the rigid one: rims differ by 1 to 2 %. It is no
    growth of the drive. Where friction creeps the mesh is told.
    """
    params = reduction(n)
    state = bd.settle(params)
    at = np.array([0.05, 0.2, 1.0, 3.0])
    response = bd.frequency_response(params, state, at, torque=0)
    inertia = 0.004 / 0.06**2 + 0.02 / 0.1**2 + 0.1 * float(params.info["length"])
    expected = -1.0 / ((2 * np.pi * at) ** 2 * inertia * 0.06**2)
    ratio = response.theta[:, 0] / expected
    assert abs(abs(ratio) - 1.0).max() < 0.02
    modes = bd.modes(params, state, n=1)
    assert 2 * np.pi * response.mesh_turning == pytest.approx(abs(modes.turning), rel=0.1)
    assert not modes.grows.size
    params = attrs.evolve(reduction(), friction=bd.Coulomb(mu=0.5, v_reg=0.05))
    with pytest.warns(bd.BeltdynWarning, match="mesh_turning"):
        response = bd.frequency_response(params, bd.settle(params), [1.0], torque=0)
    assert np.isnan(response.mesh_turning)
