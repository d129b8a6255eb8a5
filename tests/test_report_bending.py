"""What bending stiffness takes off the limit of Euler and Eytelwein: a report says it by a closed
form; here against belts that slip in full.
"""

from __future__ import annotations

import re

import pytest

import beltdyn as bd


def slipping(bending_stiffness: float) -> bd.Result:
    """The head at a steady 5 rad/s, the other pulley braked until the belt slips on both."""
    params = bd.Params(
        belt=bd.Belt(
            preload=800.0,
            n_bodies=200,
            linear_density=0.1,
            axial_stiffness=2e5,
            axial_damping=2.0,
            bending_stiffness=bending_stiffness,
            model="links",
        ),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01),
            bd.Pulley(center=(0.4, 0.0), radius=0.1, inertia=0.01),
        ],
        friction=bd.Dahl(mu_k=0.4, sigma=2e4),
    )
    brake = bd.Load(1, coulomb=60.0, viscous=40.0)
    return bd.simulate(params, brake, 0.5, motion={0: bd.PiecewiseLinear([0.0, 0.05], [0.0, 5.0])})


@pytest.mark.filterwarnings("ignore:full_slip:UserWarning")
@pytest.mark.parametrize("bending_stiffness", [0.0, 0.3, 1.0])
def test_what_bending_takes_off(bending_stiffness: float) -> None:
    """Tensions in full slip reach mu wrap less what the report says, to the next order in the angle
    sqrt(EI/T)/r, 0.16 and 0.29 rad, at which the belt leaves the rim: its square.
    """
    report = slipping(bending_stiffness).report(last=0.4)
    said = [note for note in report.notes if "resists bending" in note]
    row = report.pulleys[0]
    assert row.slip_share > 0.999
    if bending_stiffness == 0.0:
        assert not said
        assert row.used == pytest.approx(1.0, abs=2e-3)
        return
    found = re.search(r"([\d.]+) % on pulley 0", said[0])
    assert found
    angle = bending_stiffness / (0.01 * row.slack)  # squared
    loss = 0.01 * float(found[1])
    assert 1.0 - row.used == pytest.approx(loss, rel=angle, abs=2e-3)
    assert loss > 0.015
