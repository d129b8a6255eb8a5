"""Ten thousand runs in bounded memory."""

from __future__ import annotations

import gc
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
import sweep_runs
from sweep_runs import TIMES, do, plain

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


@pytest.mark.extended(guard="test_sweep_many.py::test_results_are_let_go")
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
    """The same in short: no Result nor State outlives its run, neither while others go on."""
    held: list[Any] = []
    alive: list[int] = []

    def measure(result: bd.Result) -> float:
        if len(held) == 2 * 99:
            gc.collect()
            alive.append(sum(one() is not None for one in held))
        held.extend([weakref.ref(result), weakref.ref(result.final_state)])
        return float(result.span_tension[-1].max())

    over = {"torque.scale": [k / 100 for k in range(100)]}
    with ThreadPoolExecutor(1) as one:
        swept = do(plain(), over, measure, t_eval=TIMES, executor=one)
    assert swept.counts == {"finished": 100}
    assert alive[0] <= 2 and len(held) == 200  # those of the run before, at most
    gc.collect()
    assert not any(one() is not None for one in held)
