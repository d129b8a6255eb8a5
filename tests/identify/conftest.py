"""The rig, at rest, run and measured without noise."""

from __future__ import annotations

import pytest
from identify_common import T_END, TIMES, TORQUE, curves, make_rig

import beltdyn as bd


@pytest.fixture(scope="module")
def rig() -> bd.Params:
    return make_rig()


@pytest.fixture(scope="module")
def rest(rig: bd.Params) -> bd.State:
    return bd.settle(rig)


@pytest.fixture(scope="module")
def truth(rig: bd.Params) -> bd.Result:
    return bd.simulate(rig, TORQUE, T_END, t_eval=TIMES)


@pytest.fixture(scope="module")
def experiment() -> bd.Experiment:
    return bd.Experiment(TORQUE, T_END)


@pytest.fixture(scope="module")
def targets(experiment: bd.Experiment, truth: bd.Result) -> list[bd.Target]:
    """Curves without noise."""
    return curves(experiment, truth)
