"""The drive turning as a whole is told from its modes: one motion at most, and by what moves.

Against eigenvalues of the dense Jacobian (tests/dense.py) and the closed form of a drive that is
held by a spring on one pulley.
"""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from drives import reduction
from mounted_drives import take_up
from test_modes import dense_jacobian

import beltdyn as bd


def fan_drive(n: int) -> bd.Params:
    arm = bd.Arm(
        pivot=(0.10, -0.10), inertia=2e-3, mass=0.2, stiffness=30.0, preload=15.0, damping=0.2
    )
    return bd.Params(
        belt=bd.Belt(n_bodies=n, linear_density=0.1, axial_stiffness=80e3, axial_damping=2.0),
        pulleys=[
            bd.Pulley(name="motor", center=(0, 0), radius=0.06, inertia=0.02),
            bd.Pulley(name="fan", center=(0.35, 0.05), radius=0.05, inertia=0.03),
            bd.Pulley(
                name="tens",
                center=(0.17, -0.04),
                radius=0.03,
                inertia=2e-4,
                side="outside",
                mount=arm,
            ),
        ],
        friction=bd.Dahl(mu_k=0.8, sigma=1e4),
    )


def test_a_carriage_is_a_mode() -> None:
    """Rims move alike in it too; all the dense matrix has is given but the turning itself."""
    params = take_up()
    state = bd.settle(params)
    modes = bd.modes(params, state, n=4)
    assert len(modes) == 4
    assert modes.names[0] == "carriage of pulley 1"
    values = np.linalg.eigvals(dense_jacobian(params, state)[0])
    values = values[(values.imag > 0) & (abs(values) < 1.001 * abs(modes.eigenvalue[-1]))]
    values = values[(-values.real < 0.5 * abs(values)) & (abs(values) > 1.0)]
    expected = np.sort(abs(values))
    found = np.sort(np.append(abs(modes.eigenvalue), abs(modes.turning)))
    assert len(found) == len(expected)
    assert np.allclose(found, expected, rtol=1e-4)


DRIVES = {
    "conveyor 60": lambda: bd.scenes.conveyor(60).params,
    "conveyor 120": lambda: bd.scenes.conveyor(120).params,
    "fan 60": lambda: fan_drive(60),
    "fan 80": lambda: fan_drive(80),
}


@pytest.mark.parametrize("name", DRIVES)
def test_turning_is_no_mode(name: str) -> None:
    """Whatever rims differ by: no mode has rims that all turn along with most of the energy."""
    params = DRIVES[name]()
    modes = bd.modes(params, bd.settle(params), n=3)
    assert modes.turning is not None
    radii = params.route.senses * np.array([pulley.radius for pulley in params.pulleys])
    for k in range(3):
        rims = radii * modes.shapes.theta[k]
        alike = (rims * rims[0].conj()).real.min() > 0.5 * (abs(rims) ** 2).max()
        energy = modes.participation.pulleys[k].sum() + modes.participation.belt[k]
        assert not (alike and energy > 0.9)


def test_a_spring_on_a_pulley_makes_it_a_mode() -> None:
    """w^2 = k / J, both for the belt's motion; the mesh adds its w^2, met without the spring."""
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


@pytest.mark.parametrize("n", [60, 61, 120])
def test_a_free_drive_turns_as_a_rigid_one(n: int) -> None:
    """theta = M / (-w^2 J), slowly: within 2 %, where the mesh's own 3 Hz made it 1/200.

    Left is how far the turning on the mesh is not the rigid one: rims differ by 1 to 2 %.
    """
    params = reduction(n)
    state = bd.settle(params)
    at = np.array([0.05, 0.2, 1.0, 3.0])
    response = bd.frequency_response(params, state, at, torque=0)
    inertia = 0.004 / 0.06**2 + 0.02 / 0.1**2 + 0.1 * float(params.info["length"])
    expected = -1.0 / ((2 * np.pi * at) ** 2 * inertia * 0.06**2)
    ratio = response.theta[:, 0] / expected
    assert abs(abs(ratio) - 1.0).max() < 0.02
    turning = bd.modes(params, state, n=1).turning
    assert 2 * np.pi * response.mesh_turning == pytest.approx(abs(turning), rel=0.1)


def test_where_friction_creeps_the_mesh_is_told() -> None:
    params = attrs.evolve(reduction(), friction=bd.Coulomb(mu=0.5, v_reg=0.05))
    with pytest.warns(bd.BeltdynWarning, match="mesh_turning"):
        response = bd.frequency_response(params, bd.settle(params), [1.0], torque=0)
    assert np.isnan(response.mesh_turning)
