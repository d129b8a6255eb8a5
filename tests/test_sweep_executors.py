"""A sweep gives the same Dataset, to the last bit, wherever its runs are done; Python torques go to
processes, compiled ones stay; batches stay few; results are let go. Workers that are killed: the
same Dataset; runs that kill them are given up, alone.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_runs
from sweep_runs import MEASURE, TIMES, cases, compiled, do, plain, same, under_function

import beltdyn as bd
from beltdyn.many import pools

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@pytest.fixture(scope="module")
def expected() -> dict[str, Any]:
    """What one thread gives of every case: test_sweep.py holds it to loops written by hand."""
    with ThreadPoolExecutor(1) as one:
        return {name: sweep(name, one) for name in cases()}


def sweep(name: str, executor: Any) -> Any:
    return do(measure=MEASURE, t_eval=TIMES, executor=executor, **cases()[name]).dataset


ONE = {"torque.scale": [1.0]}
GUARD = "test_sweep_executors.py::test_workers_that_are_told_everything_in_bytes"
ci = pytest.mark.ci(guard=GUARD)


def test_workers_that_are_told_everything_in_bytes(expected: dict[str, Any]) -> None:
    """As processes and clusters are, of which the tests below are run in CI; and threads."""
    with sweep_runs.Sent() as sent, ThreadPoolExecutor(3) as threads:
        for name in cases():
            same(sweep(name, sent), expected[name])
            same(sweep(name, "threads" if name == "grid" else threads), expected[name])
        assert sent.jobs > len(cases())
        assert do(plain(), ONE, MEASURE, executor=sent).workers.endswith("worker(s) of Sent")


@ci
def test_processes(expected: dict[str, Any]) -> None:
    """Of the package and of the user's."""
    same(sweep("lambda", "processes"), expected["lambda"])
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        for name in cases():
            same(sweep(name, processes), expected[name])


@ci
def test_a_dask_cluster(expected: dict[str, Any]) -> None:
    """Clients that cannot be waited for are refused; at first there may be no workers."""
    import distributed

    async def asynchronous() -> None:
        address = client.scheduler.address
        async with distributed.Client(address, asynchronous=True) as other:
            with pytest.raises(ValueError, match="asynchronous"):
                do(plain(), ONE, MEASURE, executor=other)

    with sweep_runs.cluster() as client:
        for name in cases():
            same(sweep(name, client), expected[name])
        assert "Dask" in do(plain(), ONE, MEASURE, executor=client).workers
        with pytest.raises(TypeError, match="compiled function"):
            do(plain()._replace(torque_fn=compiled), ONE, MEASURE, executor=client)
        client.sync(asynchronous)
        closed = distributed.Client(client.scheduler.address)
        closed.close()
        with pytest.raises(ValueError, match="closed"):
            do(plain(), ONE, MEASURE, executor=closed)
    with sweep_runs.cluster(workers=0, processes=False) as client:
        client.cluster.adapt(minimum=0, maximum=1, interval="50ms")
        assert do(plain(), ONE, MEASURE, executor=client).counts == {"finished": 1}


@ci
def test_a_function_of_a_script(tmp_path: Any) -> None:
    """Functions of __main__, as in a notebook, which other processes cannot import."""
    script = tmp_path / "script.py"
    script.write_text(
        sweep_runs.PATH + "import sweep_runs\n"
        "GAIN = 3.0\n"
        "def load(omega):\n    return -GAIN * float(omega[1])\n"
        "def torque(t, theta, omega):\n    return [-20.0, load(omega)]\n"
        "def most(result):\n    return GAIN * result.span_tension.max()\n"
        "scene = sweep_runs.plain()._replace(torque_fn=torque)\n"
        "over = {'torque.scale': [0.5, 1.0]}\n"
        # no guard by __name__: it would begin again in each process if that were needed
        "one = sweep_runs.do(scene, over, most, executor='threads')\n"
        "other = sweep_runs.do(scene, over, most, executor=None)\n"
        "sweep_runs.same(one.dataset, other.dataset)\n"
        "print(one.workers, '|', other.workers, '|', other.counts)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    threads, processes, counts = done.stdout.strip().split(" | ")
    assert "thread" in threads and "process" in processes and counts == "{'finished': 2}"


def test_python_torques_go_to_processes_and_it_is_said(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools._Processes, "_new", lambda *_: sweep_runs.Sent())
    swept = do(under_function(), ONE, MEASURE, executor=None, progress=True)
    assert "process" in swept.workers
    said = capsys.readouterr().err
    assert "process" in said and "the torque is a Python function" in said
    assert "process" in do(plain(), ONE, ["report.spans.tension"], executor=None).workers
    swept = do(plain(), ONE, MEASURE, executor=None, progress=True)
    assert "thread" in swept.workers and capsys.readouterr().err == ""


def test_what_cannot_be_sent_stays_in_this_process() -> None:
    """Compiled functions, and those that enclose a lock."""
    scene = plain()._replace(torque_fn=compiled)
    over = {"friction.mu_k": [0.5, 1.0]}
    objects = bd.PiecewiseLinear([0.0], [[-20.0, 0.0]]) + bd.Viscous([0.0, 1.0])
    measure = [*MEASURE, "report.spans.tension"]  # reports alone would go to processes
    found = do(scene, over, measure, executor=None)
    assert "thread" in found.workers and found.counts == {"finished": 2}
    python = do(plain()._replace(torque_fn=objects), over, measure).dataset["span_tension"]
    np.testing.assert_allclose(found.dataset["span_tension"], python, rtol=1e-6)
    for executor in ("processes", sweep_runs.Sent()):
        with pytest.raises(TypeError, match=r'compiled function.*executor="threads"'):
            do(scene, over, MEASURE, executor=executor)
        with pytest.raises(TypeError, match="compiled function"):
            do(plain(), {"torque": [compiled]}, MEASURE, executor=executor)
    lock = threading.Lock()

    def torque(_t: float, _theta: Any, _omega: Any) -> list[float]:
        with lock:
            return [0.0, 0.0]

    scene = plain()._replace(torque_fn=torque)
    with pytest.raises(TypeError, match=r'cannot be sent.*executor="threads"'):
        do(scene, ONE, MEASURE, executor="processes")
    assert do(scene, ONE, MEASURE).counts == {"finished": 1}

    # what is no executor
    class Odd:
        def submit(self, *_: Any) -> str:
            return "later"

    refused: list[tuple[Any, type[Exception], str]] = [
        ("process", ValueError, '"threads" or "processes"'),
        (0, ValueError, "executor must be"),
        (2.5, TypeError, "concurrent.futures.Executor"),
        (object(), TypeError, "Dask"),
        (Odd(), TypeError, "submit of Odd gives str"),
    ]
    for executor, error, says in refused:
        with pytest.raises(error, match=says):
            do(plain(), ONE, MEASURE, executor=executor)


class Counting(ThreadPoolExecutor):
    """An executor of the user's that counts; its workers take as long as they say."""

    def __init__(self, workers: int, seconds: float) -> None:
        super().__init__(workers)
        self.lock, self.seconds = threading.Lock(), seconds
        self.sizes: list[int] = []
        self.flying = self.most = 0

    def submit(self, work: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        with self.lock:
            self.flying += 1
            self.most = max(self.most, self.flying)

        def counted() -> Any:
            batch = work(*args, **kwargs)
            with self.lock:
                self.flying -= 1
            self.sizes.append(len(batch.outcomes))
            # as if a run took this long, whatever the machine does meanwhile
            return batch._replace(seconds=[self.seconds] * len(batch.outcomes))

        return super().submit(counted)


def test_batches_are_few_for_short_runs_and_never_many_at_a_time() -> None:
    """Half a second in a batch could be 500 runs. Two workers with two batches each get a quarter
    of what is left, again and again: 300 * 0.75^k, down to one, takes 20 batches.
    """
    for n, seconds in ((300, 1e-3), (40, 0.3)):
        over = {"torque.scale": [k / n for k in range(n)]}
        with Counting(2, seconds) as counting:
            swept = do(plain(1e-4), over, ["stats.steps"], executor=counting)
        assert swept.counts == {"finished": n} and counting.most <= 4
        assert sum(counting.sizes) == n and len(counting.sizes) <= (25 if n == 300 else 40)
    assert counting.sizes == [1] * 40


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


FINAL = ["span_tension.final"]
OVER = {"torque.scale": [float(k) for k in range(12)]}


def sleeping(begun: Path) -> bd.Scene:
    """Runs that say which process they are in and take some time, not only of the processor."""

    def torque(t: float, _theta: Any, omega: Any) -> list[float]:
        if t == 0.0:
            begun.joinpath(f"{os.getpid()}").touch()
            time.sleep(0.1)
        return [-10.0, -float(omega[1])]

    return plain()._replace(torque_fn=torque)


def lethal(_t: float, _theta: Any, _omega: Any) -> list[float]:
    os.kill(os.getpid(), signal.SIGKILL)
    return [0.0, 0.0]


def harmless(_t: float, _theta: Any, omega: Any) -> list[float]:
    return [-10.0, -float(omega[1])]


def when_begun(begun: Path, act: Callable[[list[int]], None]) -> threading.Thread:
    """Start a thread that acts once runs are on their way in some processes."""

    def wait() -> None:
        for _ in range(2400):
            if found := [int(one.name) for one in begun.iterdir()]:
                act(found)
                return
            time.sleep(0.05)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


def kill_in(begun: Path, executor: Any) -> None:
    """Do a sweep of which a worker is killed: another takes over, and the Dataset is the same."""
    killer = when_begun(begun, lambda found: os.kill(found[0], signal.SIGKILL))
    swept = do(sleeping(begun), OVER, FINAL, executor=executor)
    killer.join()
    assert len(list(begun.iterdir())) > 1, "no other worker has taken over"
    same(swept.dataset, do(sleeping(begun), OVER, FINAL).dataset)


def check_lost(executor: Any, survivors: Any) -> None:
    """One run of four is lost, with a message, and the others are as they would be without it."""
    torques = [harmless, lethal, harmless, harmless]
    over = {"torque": torques, "friction.mu_k": [0.5, 0.6, 0.7, 1.0]}
    dataset = do(plain(), over, FINAL, combine="zip", executor=executor).dataset
    assert list(dataset.status.values) == ["finished", "lost", "finished", "finished"]
    assert "the worker process died in this run" in str(dataset.message.values[1])
    tensions = dataset["span_tension.final"].values
    assert np.isnan(tensions[1]).all()
    assert tensions[[0, 2, 3]].tobytes() == survivors.tobytes()


@pytest.fixture(scope="module")
def survivors() -> Any:
    """What the runs that kill nothing give."""
    torques = {"torque": [harmless] * 3, "friction.mu_k": [0.5, 0.7, 1.0]}
    return do(plain(), torques, FINAL, combine="zip").dataset["span_tension.final"].values


def test_a_run_that_kills_its_worker_is_lost_alone(
    survivors: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With workers in this process that die as processes do; and runs after a lost one are lost."""
    made: list[sweep_runs.Sent] = []

    def new(_pool: Any, _count: int) -> Any:
        made.append(sweep_runs.Sent())
        return made[-1]

    monkeypatch.setattr(pools._Processes, "_new", new)
    check_lost("processes", survivors)
    assert len(made) > 1, "no other workers have taken over"
    # runs that start from the end of a lost one have no start; the others are not touched
    for torques, counts in (([lethal, harmless], {"lost": 4}), ([harmless, lethal], None)):
        over = {"torque": torques, "friction.mu_k": [0.5, 0.7]}
        swept = do(plain(), over, FINAL, executor="processes", warm="torque")
        assert swept.counts == (counts or {"finished": 2, "lost": 2})
        message = str(swept.dataset.message.values[1, 0])
        assert ("the run from whose end it starts was lost" in message) == (counts is not None)
    tensions = swept.dataset["span_tension.final"].values[0]
    assert tensions.tobytes() == survivors[:2].tobytes()

    # Their executor is broken for good, and the error says so; what was done before is kept
    def few(torque: Any, executor: Any = "threads") -> Any:
        over = {"torque": [harmless, torque], "friction.mu_k": [0.5, 0.6]}
        return do(plain(), over, FINAL, combine="zip", executor=executor, store=tmp_path)

    with sweep_runs.Sent() as workers:
        few(harmless, workers)
        with pytest.raises(RuntimeError, match="takes no more work: give a new one; with store="):
            few(lethal, workers)
    assert few(harmless).stored == 2


@pytest.mark.ci(guard="test_sweep_executors.py::test_a_run_that_kills_its_worker_is_lost_alone")
def test_processes_killed(tmp_path: Path, survivors: Any) -> None:
    """By another, and by a run."""
    kill_in(tmp_path, "processes")
    check_lost("processes", survivors)


@pytest.mark.ci(guard="test_sweep_executors.py::test_a_run_that_kills_its_worker_is_lost_alone")
def test_dask_workers_killed(tmp_path: Path, survivors: Any) -> None:
    """Its nanny starts another, the scheduler does its batch again; one that kills all is lost.

    A cluster that is closed meanwhile is an error.
    """
    with sweep_runs.cluster() as client:
        kill_in(tmp_path, client)
        check_lost(client, survivors)

        def close(_found: list[int]) -> None:
            client.cluster.scale(0)
            client.close()

        (tmp_path / "more").mkdir()
        closer = when_begun(tmp_path / "more", close)
        with pytest.raises(RuntimeError, match="the executor or the cluster was closed"):
            do(sleeping(tmp_path / "more"), OVER, FINAL, executor=client)
        closer.join()
