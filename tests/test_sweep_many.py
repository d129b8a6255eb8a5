"""Ten thousand runs in bounded memory; failures of every kind stand beside the results."""

from __future__ import annotations

import gc
import subprocess
import sys
from typing import Any

import attrs
import numpy as np
import pytest
import sweep_runs
from sweep_runs import MEASURE, TIMES, do, plain

import beltdyn as bd

MANY = (
    sweep_runs.PATH
    + """
import resource
import sweep_runs
n = int(sys.argv[1])
over = {"torque.scale": [k / n for k in range(n)]}
swept = sweep_runs.do(sweep_runs.plain(), over, ["span_tension.least"], t_eval=sweep_runs.TIMES,
                      store=sys.argv[2])
assert swept.counts == {"finished": n} and swept.settled == 1, (swept.counts, swept.settled)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss is in KiB on Linux")
def test_memory_of_ten_thousand_runs(tmp_path: Any) -> None:
    """Nine thousand runs more take what the table holds of them.

    Of a run that is 16 bytes of tensions in an array (130 with its head) and in the Dataset, value
    and number (200), key (100), a status, a message and one text of warnings of some 400 letters:
    that twice, as a text and, four bytes a letter and the same for all, in the Dataset, which is
    put together from a copy: 4 kB in all. A Result is 30 kB, a State 4 kB.
    """
    peaks = []
    for n in (1000, 10_000):
        command = [sys.executable, "-c", MANY, str(n), str(tmp_path / str(n))]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        peaks.append(1024 * int(done.stdout))
    assert peaks[1] - peaks[0] < 9000 * 5000, peaks


def test_results_are_let_go() -> None:
    """The same in short: after many runs there are no more Results and States than before."""

    def living() -> int:
        gc.collect()
        return sum(isinstance(one, (bd.Result, bd.State)) for one in gc.get_objects())

    before = living()
    swept = do(plain(), {"torque.scale": [k / 100 for k in range(100)]}, MEASURE, t_eval=TIMES)
    assert swept.counts == {"finished": 100}
    assert living() <= before


def torque(t: float, _theta: Any, omega: Any) -> list[float]:
    if t > 1e-3:
        raise ZeroDivisionError("of the user's own")
    return [-10.0, -float(omega[1])]


def of_one(result: bd.Result) -> Any:
    """A measure that raises for one drive and has another shape for another."""
    damping = result.params.belt.axial_damping
    if damping == 2.0:
        raise KeyError("nothing of that name")
    return np.ones(3 if damping == 3.0 else 2)


@pytest.mark.parametrize("executor", ["threads", pytest.param("processes", marks=pytest.mark.slow)])
def test_failures_of_every_kind_stand_beside_the_results(executor: str) -> None:
    def one(over: Any, measure: Any = MEASURE, scene: Any = None, **options: Any) -> Any:
        given: Any = {"t_eval": TIMES, "executor": executor, **options}
        return do(scene or plain(), over, measure, **given).dataset

    # refused: by the drive, by a load, by an option, by settling; the others are as alone
    stiffness = [7e4, -1.0, 6e4]
    found = one({"belt.axial_stiffness": stiffness})
    assert list(found.status.values) == ["finished", "refused", "finished"]
    assert "belt.axial_stiffness must be > 0" in str(found.message.values[1])
    tensions = found["span_tension"].values
    assert np.isnan(tensions[1]).all() and np.isnan(found["stats.steps"].values[1])
    alone = one({"belt.axial_stiffness": [6e4]})["span_tension"].values
    assert tensions[2].tobytes() == alone[0].tobytes()
    assert str(found["stats.method"].values[1]) == ""
    found = one({"t_end": [2e-3, -1.0], "rtol": [1e-3, 5.0]})
    assert list(found.status.values.ravel()) == ["finished", "refused", "refused", "refused"]
    assert "rtol must be" in str(found.message.values[0, 1])
    assert "t_end must be" in str(found.message.values[1, 0])
    found = one({"torque": [bd.Viscous([0.0, 1.0]), bd.Viscous([0.0, 1.0, 2.0]), "none"]})
    assert list(found.status.values) == ["finished", "refused", "refused"]
    found = one({"belt.length": [1.2, 1.5]})
    assert list(found.status.values) == ["finished", "refused"]

    # a run that ends in an error of the core, with the warnings before it
    found = one({"max_steps": [3, 100_000]})
    assert list(found.status.values) == ["failed", "finished"]
    assert "max_steps" in str(found.message.values[0])
    for k in range(2):
        assert "mesh" in str(found.warnings.values[k])

    # a torque function that raises
    found = one(
        {"t_end": [5e-4, 2e-3]}, ["stats.steps"], plain()._replace(torque_fn=torque), t_eval=None
    )
    assert list(found.status.values) == ["finished", "failed"]
    assert "ZeroDivisionError: of the user's own" in str(found.message.values[1])

    # measuring raises, or gives another shape than the first runs
    found = one({"belt.axial_damping": [1.0, 2.0, 3.0, 4.0]}, of_one)
    assert list(found.status.values) == ["finished", "measure", "measure", "finished"]
    assert "KeyError" in str(found.message.values[1])
    assert "3 values" in str(found.message.values[2])
    assert found["of_one"].shape == (4, 2)


def test_a_drive_that_does_not_settle_is_tried_once() -> None:
    """Its runs all fail, with the same message, at the cost of one."""
    scene = plain()
    loose = attrs.evolve(scene.params.tensioning, move_time=1e-9, offset=[(0.0, 0.0), (-0.2, 0.0)])
    over = {"torque.scale": [0.0, 0.5, 1.0]}
    swept = do(scene._replace(params=attrs.evolve(scene.params, tensioning=loose)), over, MEASURE)
    assert swept.settled == 1
    assert swept.counts in ({"failed": 3}, {"refused": 3})
    assert len({str(one) for one in swept.dataset.message.values}) == 1
