"""The energy ledger (MODEL section 7): a residual that needs no reference solution.

That it closes in every drive, that its terms are those of the oracle, and that leaving it out
changes nothing, is in ``test_drive_table.py``.
"""

from __future__ import annotations

from itertools import pairwise

import attrs
import numpy as np
import pytest
from drives import on_mesh, plain, scene_m, with_belt

import beltdyn as bd


@pytest.mark.ci(guard="test_drive_table.py::test_the_energy_balance_closes")
def test_case_1_closes_its_balance() -> None:
    """The whole second. What passes through is the drive's work; the bound is the issue's."""
    params, torque, *_ = bd.scenes.kubas_case_1()
    start, ladder = bd.settle(params), []
    for rtol in (1e-2, 1e-4, 1e-6, 1e-8):
        energy = bd.simulate(params, torque, 1.0, initial=start, rtol=rtol).energy
        passed = max(np.max(np.abs(energy.drive)), np.max(np.abs(energy.total - energy.total[0])))
        ladder.append(float(np.max(np.abs(energy.residual)) / passed))
    assert ladder[-1] <= 1e-6
    # falls with the tolerance until it meets rounding: 1e5 steps of 1e-16 of the stored energy
    assert all(tight < loose for loose, tight in pairwise(ladder))
    assert ladder[-1] <= 1e-4 * ladder[0]


def test_losses_are_losses() -> None:
    """Damper losses never fall; friction may hand back only what bristles can hold.

    That is per contact mu^2 N / (2 sigma), the elastic part of a Dahl bristle near mu = 0.
    """
    energy = bd.simulate(*bd.scenes.kubas_case_2()).energy
    assert np.min(np.diff([energy.joint_loss, energy.contact_loss])) >= 0.0
    held = 1.0**2 * (2 * np.pi * 1100.0) / (2 * 1e4)
    handed_back = np.maximum.accumulate(energy.friction_loss) - energy.friction_loss
    assert np.max(handed_back) <= held
    assert energy.friction_loss[-1] > 0.5 * energy.drive[-1]


def test_it_closes_where_links_leave_too_fast_for_damping_to_pull(mesh: str) -> None:
    """Contact never pulls; what its damper would then take is not lost. Explicit steps of 1e-6."""
    for damping in ({"damping": 1e4}, {"hunt_crossley": 0.5}):
        contact = bd.Contact(linear=2.5e7, **damping)
        params = attrs.evolve(on_mesh(plain(), mesh), friction=None, contact=contact)
        rest, rng = bd.settle(params), np.random.default_rng(0)
        thrown = 5.0 * rng.standard_normal((2, rest.x.size))
        start = attrs.evolve(rest, vx=rest.vx + thrown[0], vy=rest.vy + thrown[1])
        still = bd.Viscous([0.0, 0.1])
        run = bd.simulate(params, still, 3e-3, initial=start, method="tsit5", rtol=1e-6)
        energy = run.energy
        assert energy is not None and energy.contact_loss[-1] > 0.1 * energy.kinetic[0]
        assert np.max(np.abs(energy.residual)) <= 1e-6 * energy.kinetic[0]
        assert run.contact.normal.min() >= 0.0 and run.contact.normal.max() > 0.0


def test_dampers_of_links_resist_that_stretched_joints_turn() -> None:
    """On a pulley, by eta A (strain v / R)^2 per metre, whatever the mesh: M at 20 m/s without
    bending or load; 240 links, of which those that land and run off have a few per cent. A string,
    which is damped along itself, has less than 2 % of it.
    """
    damping, speed, radius = 5.0, 20.0, 0.1
    belt = {"mesh": "joint", "n_bodies": 240, "bending_stiffness": 0.0, "axial_damping": damping}
    lost = {}
    for model in ("links", "string"):
        of = with_belt(scene_m().params, model=model, **belt)
        state = bd.settle(of, speed={0: -speed / radius}, friction=False, pulleys="held")
        result = bd.simulate(
            of, bd.PiecewiseLinear([0.0, 0.04], [0.0, 0.0], pulley=1), 0.04, initial=state,
            t_eval=[0.0, 0.02, 0.04], rtol=1e-4,
        )  # fmt: skip
        assert result.energy is not None
        lost[model] = float(np.diff(result.energy.joint_loss)[1]) / 0.02
        strain = float(result.span_tension.mean()) / of.belt.axial_stiffness
    exact = damping * (strain * speed / radius) ** 2 * 2.0 * np.pi * radius
    assert lost["links"] == pytest.approx(exact, rel=0.05)
    assert lost["string"] < 0.02 * exact
