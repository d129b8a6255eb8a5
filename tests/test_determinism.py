"""The same build gives the same bits: again, in threads side by side, in another process."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest

import beltdyn as bd

METHODS: dict[str, dict[str, Any]] = {
    "auto": {},
    "tsit5": {"method": "tsit5"},
    "rk4": {"method": "rk4"},
    "rodas4": {"method": "rodas4"},
    "lbdf2": {"method": "lbdf2", "rtol": 1e-3},
    "lbdf2, fixed": {"method": "lbdf2", "step": 2e-5},
    "lie": {"method": "lie", "rtol": 1e-2},
}

#: Not in `sums`: what Python ignores is one for all threads, and they would restore it for others.
pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def driven(t: float, _theta: Any, omega: Any) -> list[float]:
    return [-100.0 * min(1.0, t / 0.01), -16.0 * float(omega[1])]


def sums(name: str) -> list[str]:
    """Check sums of settling and of four runs by one method: under terms, under a function, with
    bearing drag, and with contact of the joints.
    """
    params, torque, *_ = drives.plain_scene()
    drag = bd.Drag(coulomb=0.5, viscous=0.02, quadratic=1e-3)
    pulleys = [attrs.evolve(pulley, drag=drag) for pulley in params.pulleys]
    dragging = attrs.evolve(params, pulleys=pulleys)
    found = []
    of_joints = drives.on_mesh(params, "joint")
    cases = ((params, torque), (params, driven), (dragging, torque), (of_joints, torque))
    for drive, load in cases:
        start = bd.settle(drive)
        times = np.linspace(0.0, 0.02, 21)
        run = bd.simulate(drive, load, 0.02, initial=start, t_eval=times, **METHODS[name])
        arrays = [run.joints.force, run.contact.mu, run.pulleys.omega, run.energy.residual]
        arrays += [run.final_state.x, run.final_state.vphi, start.x, start.phi]
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays))
        found.append(f"{digest.hexdigest()} {run.stats.steps} {run.stats.error}")
    return found


@pytest.fixture(scope="module")
def once() -> dict[str, list[str]]:
    return {name: sums(name) for name in METHODS}


def test_again(once: dict[str, list[str]]) -> None:
    assert {name: sums(name) for name in METHODS} == once


def test_in_threads_side_by_side(once: dict[str, list[str]]) -> None:
    with ThreadPoolExecutor(4) as pool:
        for name, found in zip([*METHODS] * 2, pool.map(sums, [*METHODS] * 2), strict=True):
            assert found == once[name], name


def test_in_another_process(once: dict[str, list[str]]) -> None:
    program = "import test_determinism as t; print({name: t.sums(name) for name in t.METHODS})"
    done = subprocess.run(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE, text=True, check=True, cwd=Path(__file__).parent,
    )  # fmt: skip
    assert done.stdout.strip() == str(once)
