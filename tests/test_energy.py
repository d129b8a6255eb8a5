"""The energy ledger (MODEL section 7): a residual that needs no reference solution."""

from __future__ import annotations

from itertools import pairwise

import attrs
import numpy as np
import pytest
from bridge import fields, oracle_of
from drives import on_mesh

import beltdyn as bd


def worst_residual(scene: bd.scenes.Scene, t_end: float, start: bd.State, rtol: float) -> float:
    """Largest residual over the run, relative to the energy that passed through."""
    result = bd.simulate(*scene[:2], t_end, initial=start, rtol=rtol)
    energy = result.energy
    passed = max(np.max(np.abs(energy.drive)), np.max(np.abs(energy.total - energy.total[0])))
    return float(np.max(np.abs(energy.residual)) / passed)


def test_case_1_closes_its_balance() -> None:
    """The whole second. What passes through is the drive's work; the bound is the issue's."""
    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    ladder = [worst_residual(scene, 1.0, start, rtol) for rtol in (1e-2, 1e-4, 1e-6, 1e-8)]
    assert ladder[-1] <= 1e-6
    # falls with the tolerance until it meets rounding: 1e5 steps of 1e-16 of the stored energy
    assert all(tight < loose for loose, tight in pairwise(ladder))
    assert ladder[-1] <= 1e-4 * ladder[0]


@pytest.mark.parametrize("name", ["three-pulleys", "unequal-pulleys", "flywheel-start"])
@pytest.mark.filterwarnings("ignore:full_slip. pulley . slips:UserWarning")  # the flywheel's does
def test_other_scenes_close_theirs(name: str, mesh: str) -> None:
    scene = bd.scenes.get(name)
    scene = scene._replace(params=on_mesh(scene.params, mesh))
    start = bd.settle(scene.params)
    loose, tight = (worst_residual(scene, 0.15, start, rtol) for rtol in (1e-3, 1e-7))
    assert tight <= 1e-6
    assert tight < loose


def test_terms_are_those_of_the_oracle(mesh: str) -> None:
    """Every stored term and every loss on its own, at a running state with gravity and bending."""
    scene = bd.scenes.three_pulleys()
    params = on_mesh(scene.params, mesh)
    result = bd.simulate(params, scene.torque_fn, 0.1, t_eval=[0.1], rtol=1e-7)
    oracle = oracle_of(params)
    y = oracle.pack(fields(result.final_state))
    terms = oracle.energy_terms(y)
    energy = result.energy
    scale = float(oracle.energy(y))
    assert abs(energy.total[-1] - oracle.energy(y)) <= 1e-12 * abs(scale)
    expected = {
        "kinetic": terms["translation"] + terms["rotation"] + terms["pulleys"],
        "axial": terms["stretching"],
        "bending": terms["bending"],
        "contact": terms["contact"],
        "gravity": terms["gravity"],
    }
    for name, value in expected.items():
        assert (float(value) != 0.0) == (name != "bending" or mesh != "string"), name
        # stretches and penetrations of 1e-4 m are differences of positions rounded to 5e-17 m
        assert getattr(energy, name)[-1] == pytest.approx(float(value), rel=1e-10), name


def test_losses_are_losses() -> None:
    """Damper losses never fall; friction may hand back only what bristles can hold.

    That is per contact mu^2 N / (2 sigma), the elastic part of a Dahl bristle near mu = 0.
    """
    scene = bd.scenes.kubas_case_2()
    energy = bd.simulate(*scene).energy
    assert np.min(np.diff(energy.joint_loss)) >= 0.0
    assert np.min(np.diff(energy.contact_loss)) >= 0.0
    held = 1.0**2 * (2 * np.pi * 1100.0) / (2 * 1e4)
    running_maximum = np.maximum.accumulate(energy.friction_loss)
    assert np.max(running_maximum - energy.friction_loss) <= held
    assert energy.friction_loss[-1] > 0.5 * energy.drive[-1]


def test_undamped_drive_conserves_energy(mesh: str) -> None:
    """No damping, no friction, no torque, from a shaken state: the stored energy stays."""
    base = on_mesh(bd.scenes.three_pulleys().params, mesh)
    params = attrs.evolve(
        base,
        belt=attrs.evolve(base.belt, axial_damping=0.0),
        contact=attrs.evolve(base.contact, damping=0.0),
        friction=None,
    )
    rest = bd.settle(params)
    rng = np.random.default_rng(5)
    shaken = attrs.evolve(rest, vx=0.05 * rng.standard_normal(len(rest.vx)))
    still = bd.Viscous([0.0, 0.0, 0.0])
    drift = []
    for rtol in (1e-5, 1e-7):
        result = bd.simulate(params, still, 0.02, initial=shaken, rtol=rtol)
        energy = result.energy
        assert not energy.joint_loss.any()
        assert not energy.friction_loss.any()
        moving = energy.kinetic[0]
        drift.append(np.max(np.abs(energy.total - energy.total[0])) / moving)
    assert drift[1] < 0.1 * drift[0]
    assert drift[1] <= 1e-4


@pytest.mark.parametrize("method", ["tsit5", "rodas4", "lbdf2"])
def test_ledger_off_costs_nothing_and_changes_nothing(method: str) -> None:
    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    on, off = (
        bd.simulate(*scene[:2], 0.02, initial=start, method=method, rtol=1e-3, ledger=ledger)
        for ledger in (True, False)
    )
    assert off.energy is None
    assert "energy ledger" in on.effects
    assert "energy ledger" not in off.effects
    # of rodas4, the ledger is an evaluation in the middle of every step
    more = on.stats.steps if method == "rodas4" else 0
    assert on.stats.nfev == off.stats.nfev + more
    # the quadratures feed nothing back; only the compiler may order a sum differently
    scale = np.max(np.abs(on.joints.force))
    assert np.max(np.abs(on.joints.force - off.joints.force)) <= 1e-10 * scale
