"""The margin of torque to full slip: against creep theory, and against runs that slip.

Theory is that of tests/creep_theory.py, two pulleys in closed form. The runs bring up all torques
in proportion, slower than the belt goes round, until the driving pulley slips: the largest torque
that it then carries is the one that the margin of a run at a part of it has foretold. So is what
bending stiffness takes off the limit of Euler and Eytelwein, which a report says by a closed form.
"""

from __future__ import annotations

import math
import re

import attrs
import creep_theory
import numpy as np
import pytest
from drives import pressing
from test_creep_theory import DENSITY, DRIVE, EA, FULL, MU, OMEGA, RADII, unequal
from tiers import OTHERS
from two_pulleys import open_drive

import beltdyn as bd
from beltdyn.report.margin import Steady, full_slip

pytestmark = [
    pytest.mark.filterwarnings("ignore:full_slip:UserWarning"),
    pytest.mark.filterwarnings("ignore:balance:UserWarning"),
    pytest.mark.filterwarnings("ignore:chatter:UserWarning"),  # once it slips
    pytest.mark.filterwarnings("ignore:slack_span:UserWarning"),
]


def state_of_theory(share: float, way: int = 1) -> Steady:
    """The state of creep theory at a share of the torque of full slip, turning either way."""
    state = creep_theory.steady(DRIVE, OMEGA, lambda _omega: share * FULL.load)
    speed = OMEGA * RADII[0] / DRIVE.stretch(state.tight)
    spans = [state.tight, state.slack]
    return Steady(
        params=unequal(120),
        tension=np.array(spans if way > 0 else spans[::-1]),
        torque=way * np.array([-state.torque, state.load]),
        speed=-way * speed,
        driver=0,
        travel=np.zeros(0),
    )


@pytest.mark.parametrize(("share", "way"), [(0.05, 1), (0.5, -1), (0.95, 1), (0.9, -1)])
def test_from_any_part_of_it_the_torque_is_that_of_theory(share: float, way: int) -> None:
    """The contact gives by EA/(c R^2) = 6e-4 of what the belt stretches: ask for a tenth of it."""
    state = state_of_theory(share, way)
    small, large = full_slip(state)
    assert share * small.factor == pytest.approx(1.0, rel=6e-5)
    assert abs(small.torque) == pytest.approx(FULL.torque, rel=6e-5)
    np.testing.assert_allclose(small.tensions, (FULL.tight, FULL.slack), rtol=6e-5)
    # The other pulley has the larger wrap and slips later, with its own Euler-Eytelwein.
    assert large.factor > small.factor
    mass = DENSITY * (OMEGA * RADII[0] / DRIVE.stretch(large.tensions[0])) ** 2
    tight, slack = (T - mass * (1.0 + T / EA) for T in large.tensions)
    assert tight / slack == pytest.approx(math.exp(MU * DRIVE.wraps[1]), rel=1e-4)
    if share == 0.9:  # past full slip with four fifths of the friction
        law = bd.ElasticPlastic(mu=0.8 * MU, stiffness=1e10, damping=1e5)
        small, _ = full_slip(attrs.evolve(state, params=attrs.evolve(state.params, friction=law)))
        assert 0.8 < small.factor < 1.0


def drive(kind: str) -> bd.Params:
    """A drive whose crank, pulley 0, has the least friction to spare."""
    pulleys = [
        bd.Pulley(name="crank", center=(0.0, 0.0), radius=0.05, inertia=2e-3),
        bd.Pulley(name="fan", center=(0.30, 0.0), radius=0.07, inertia=2e-3),
    ]
    if kind == "three":
        pulleys.append(bd.Pulley(name="pump", center=(0.15, -0.20), radius=0.06, inertia=2e-3))
    if kind == "arm":
        # It presses on the tight span from outside.
        pulleys.append(pressing((0.15, -0.030), pivot=(0.21, -0.09), stiffness=60.0, preload=-12.0))
    preload = {} if kind == "arm" else {"preload": 300.0}
    return bd.Params(
        belt=bd.Belt(
            n_bodies=100, linear_density=0.1, axial_stiffness=30e3, axial_damping=2.0, **preload
        ),
        pulleys=pulleys,
        friction=bd.Dahl(mu_k=0.4, sigma=4e4),
    )


def run(kind: str, end: float, shares: list[float]) -> bd.Result:
    """Under torques that resist at these shares of what is about full slip, from 0.4 s to the end.

    The crank turns clockwise, with the numbering of the links, from 0.3 s on at 60 rad/s.
    """
    sizes = {"two": [0.0, 15.0], "three": [0.0, 9.0, 8.0], "arm": [0.0, 20.0, 0.0]}[kind]
    load = bd.PiecewiseLinear([0.3, 0.4, end], np.outer([0.0, *shares], sizes))
    motion = {"crank": bd.PiecewiseLinear([0.0, 0.3], [0.0, -60.0])}
    return bd.simulate(drive(kind), load, end, motion, rtol=1e-3, method="rodas4")


@pytest.mark.parametrize(
    ("kind", "pull"),
    [
        ("two", 0.8),
        pytest.param("three", 0.6, marks=pytest.mark.ci(guard=OTHERS)),
        pytest.param("arm", 0.45, marks=pytest.mark.ci(guard=OTHERS)),
    ],
)
def test_the_torque_at_which_a_run_slips(kind: str, pull: float) -> None:
    report = run(kind, 1.0, [pull, pull]).report(0.3)
    first = report.first_to_slip
    assert first.name == "crank"
    assert not report.unsteady and 1.2 < first.margin < 3.0
    slips = run(kind, 1.1, [first.margin * pull * share for share in (0.95, 1.05)])
    # Over the time in which a dozen links pass, so that their landing is no larger torque.
    torque = np.abs(slips.pulleys.torque[:, 0])
    n = round(0.06 / (slips.t[1] - slips.t[0]))
    carried = np.convolve(torque, np.ones(n) / n, "valid")[slips.t[: 1 - n] > 0.4].max()
    assert slips.pulleys.omega[-1, 1] / (-60.0 * 5.0 / 7.0) < 0.9, "the run has not come to slip"
    assert abs(first.slip_torque) == pytest.approx(carried, rel=0.02)


@pytest.mark.parametrize("bending_stiffness", [0.0, 1.0])
def test_what_bending_takes_off(bending_stiffness: float) -> None:
    """Tensions in full slip reach mu wrap less what the report says, to the next order in the angle
    sqrt(EI/T)/r, 0.29 rad, at which the belt leaves the rim: its square.
    """
    belt = {"preload": 800.0, "n_bodies": 200, "axial_stiffness": 2e5, "model": "links"}
    belt["bending_stiffness"] = bending_stiffness
    law = bd.Dahl(mu_k=0.4, sigma=2e4)
    params = open_drive((0.1, 0.1), 0.4, (0.01, 0.01), friction=law, **belt)
    # the head at a steady 5 rad/s, the other pulley braked until the belt slips on both
    brake = bd.Load(1, coulomb=60.0, viscous=40.0)
    motion = {0: bd.PiecewiseLinear([0.0, 0.05], [0.0, 5.0])}
    report = bd.simulate(params, brake, 0.5, motion=motion).report(last=0.4)
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
