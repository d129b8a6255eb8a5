"""The scenes of real drives settle, run up, take loads and keep their ledger, by every method."""

from __future__ import annotations

import numpy as np
import pytest

import beltdyn as bd

MACHINES = ("serpentine", "tensioned-alternator", "crossed-belt", "conveyor", "flat-belt-axis")
#: Of the energy that passed: ten times the error that is asked of forces.
CLOSED = 1e-3


def balance(result: bd.Result) -> float:
    return float(np.abs(result.energy.residual).max() / result.energy.passed.max())


@pytest.mark.parametrize("name", MACHINES)
def test_machines_begin_and_keep_their_ledger(name: str) -> None:
    scene = bd.scenes.get(name)
    t_end = scene.t_end / 50.0
    result = bd.simulate(*scene[:2], t_end, scene.motion, t_eval=np.linspace(0.0, t_end, 21))
    assert result.success and balance(result) < CLOSED
    assert {warning.code for warning in result.warnings} <= {"mesh"}
    assert not np.isnan(result.span_tension).any()


@pytest.mark.ci(guard="test_machines.py::test_machines_begin_and_keep_their_ledger")
def test_serpentine_runs_up() -> None:
    """From rest to 3000 1/min, under its loads: as fast as the radii say, and the ledger closes."""
    scene = bd.scenes.serpentine(n_bodies=200)
    run_up = bd.PiecewiseLinear([0.0, 0.4], [0.0, -314.16])
    result = bd.simulate(
        *scene[:2], 0.45, {"crank": run_up}, t_eval=np.linspace(0.0, 0.45, 201), method="rodas4"
    )
    assert result.success and balance(result) < 1e-3
    radii = np.array([pulley.radius for pulley in scene.params.pulleys])
    late = result.pulleys.omega[-20:].mean(axis=0) * radii * result.params.route.senses
    np.testing.assert_allclose(late, late[0], rtol=0.02)  # less the creep
