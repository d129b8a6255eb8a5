"""The scenes of real drives settle, run up, take loads and keep their ledger, by every method."""

from __future__ import annotations

import attrs
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


def stepped() -> bd.Scene:
    """The seven-pulley drive at 3000 1/min whose alternator is loaded at once after 1 ms."""
    scene = bd.scenes.serpentine(n_bodies=200)
    parts = [
        attrs.evolve(part, factor=bd.PiecewiseLinear([1e-3, 1.5e-3], [0.0, 1.0]))
        if getattr(part, "factor", None) is not None
        else part
        for part in scene.torque_fn.parts
    ]
    crank = bd.CrankMotion(-314.16, orders=[2, 4], amplitudes=[5e-3, 1e-3], fade=(0.0, 2e-3))
    return bd.Scene(scene.params, bd.TorqueSum(parts), 4e-3, {"crank": crank})


@pytest.mark.ci(guard="test_machines.py::test_machines_begin_and_keep_their_ledger")
def test_serpentine_takes_step_and_harmonics_by_every_method() -> None:
    """Methods agree to a few times what each is asked for, and the load reaches the belt."""
    scene = stepped()
    start = bd.settle(scene.params, speed={"crank": -314.16})
    times = np.linspace(0.0, scene.t_end, 41)
    runs = {}
    others = {"rk4": {"step": 4e-7}, "lie": {"rtol": 0.02}}
    for method in ("tsit5", "rodas4", "lbdf2", "rk4", "lie", "auto"):
        options = {"t_eval": times, "method": method} | others.get(method, {})
        runs[method] = bd.simulate(*scene[:3], scene.motion, **options)
        # of first order, whose errors are damping
        assert balance(runs[method]) < (5e-3 if method == "lie" else CLOSED), method
    reference = runs["tsit5"]
    mean = reference.params.info["mean_tension"]
    for method, run in runs.items():
        apart = np.abs(run.span_tension - reference.span_tension).max() / mean
        assert apart < (0.05 if method == "lie" else 2e-3), method
        assert np.abs(run.mounts.travel - reference.mounts.travel).max() < 1e-4, method
    assert reference.mounts.travel[0, 0] == pytest.approx(start.travel[0], abs=1e-12)
    loaded = reference.pulleys.torque[-1, 2] / reference.pulleys.torque[5, 2]
    assert loaded == pytest.approx(3.0, rel=0.02)  # its table, and twice that on top


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
