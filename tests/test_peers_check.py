"""The check of the model that other solvers are given (`benchmarks/peers_check.py`)."""

from __future__ import annotations

import functools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import beltdyn as bd

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def scaled(jacobian: Any, factor: Any, t: float, y: Any) -> Any:
    matrix = jacobian(t, y)
    matrix.data *= factor
    return matrix


def test_a_wrong_entry_of_the_peers_jacobian_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """At rest, on the kink of |v_T|, the right one passes; one entry off by a hundredth does not.

    Where nothing slips differences tell no derivative, so the check moves off the kinks.
    """
    numba = pytest.importorskip("numba")
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)  # compiling takes longer than it saves
    monkeypatch.syspath_prepend(BENCHMARKS)
    import common
    import numba_model
    import numpy_model
    import peers_check

    scene = common.with_belt(bd.scenes.kubas_case_1(), n_bodies=30)
    drive, begin = numpy_model.Drive.of(scene), bd.settle(scene.params)
    case = common.Case("at rest", scene.params, scene.torque_fn, begin, 0.1, None)
    natural = numba_model.compiled(drive)
    problem: Any = SimpleNamespace(
        drive=drive, t0=0.0, t1=0.1, y0=drive.pack(begin), plain=numpy_model.make_rhs(drive)
    )
    problem.natural = natural
    assert "Jacobian against differences" in peers_check.check(problem, case)

    general = peers_check.in_general_position(drive, problem.y0)[natural.order]
    entries = abs(natural.jacobian(0.0, general).data)
    for wrong in (entries.argmax(), entries.nonzero()[0][7]):
        factor = np.where(np.arange(entries.size) == wrong, 1.01, 1.0)
        problem.natural = SimpleNamespace(
            order=natural.order,
            rhs=natural.rhs,
            jacobian=functools.partial(scaled, natural.jacobian, factor),
        )
        with pytest.raises(AssertionError, match="Jacobian: rate of"):
            peers_check.check(problem, case)
