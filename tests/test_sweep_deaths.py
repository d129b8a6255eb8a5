"""Workers of a sweep that are killed: the same Dataset; runs that kill them are given up, alone."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_runs
from sweep_runs import do, plain, same
from tiers import ci_if

import beltdyn as bd
from beltdyn import pools

MEASURE = ["span_tension.final"]
OVER = {"torque.scale": [float(k) for k in range(12)]}
GUARD = "test_sweep_deaths.py::test_a_run_that_kills_its_worker_is_lost_alone"
ci = pytest.mark.ci(guard=GUARD)


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


def kill_one(found: list[int]) -> None:
    assert os.getpid() not in found
    os.kill(found[0], signal.SIGKILL)


def kill_in(begun: Path, expected: Any, executor: Any) -> None:
    """Do a sweep of which a worker is killed: another takes over, and the Dataset is the same."""
    killer = when_begun(begun, kill_one)
    swept = do(sleeping(begun), OVER, MEASURE, executor=executor)
    killer.join()
    assert len(list(begun.iterdir())) > 1, "no other worker has taken over"
    same(swept.dataset, expected)


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return do(sleeping(tmp_path_factory.mktemp("here")), OVER, MEASURE).dataset


@pytest.fixture(scope="module")
def survivors() -> Any:
    """What the runs that kill nothing give."""
    torques = {"torque": [harmless] * 3, "friction.mu_k": [0.5, 0.7, 1.0]}
    return do(plain(), torques, MEASURE, combine="zip").dataset["span_tension.final"].values


LETHAL = {"torque": [harmless, lethal, harmless, harmless], "friction.mu_k": [0.5, 0.6, 0.7, 1.0]}


def check_lost(executor: Any, survivors: Any) -> None:
    """One run of four is lost, with a message, and the others are as they would be without it."""
    swept = do(plain(), LETHAL, MEASURE, combine="zip", executor=executor)
    assert swept.counts == {"finished": 3, "lost": 1}
    dataset = swept.dataset
    assert list(dataset.status.values) == ["finished", "lost", "finished", "finished"]
    assert "the worker process died in this run" in str(dataset.message.values[1])
    tensions = dataset["span_tension.final"].values
    assert np.isnan(tensions[1]).all()
    assert tensions[[0, 2, 3]].tobytes() == survivors.tobytes()


def test_a_run_that_kills_its_worker_is_lost_alone(
    survivors: Any, monkeypatch: pytest.MonkeyPatch
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
        swept = do(plain(), over, MEASURE, executor="processes", warm="torque")
        assert swept.counts == (counts or {"finished": 2, "lost": 2})
        message = str(swept.dataset.message.values[1, 0])
        assert ("the run from whose end it starts was lost" in message) == (counts is not None)
    tensions = swept.dataset["span_tension.final"].values[0]
    assert tensions.tobytes() == survivors[:2].tobytes()


@pytest.mark.parametrize("kind", ci_if("processes".__eq__, ["bytes", "processes"]))
def test_workers_of_the_users_that_die_are_an_error(tmp_path: Path, kind: str) -> None:
    """Their executor is broken for good, and the error says so; what was done before is kept."""

    def few(torque: Any, executor: Any = "threads") -> Any:
        over = {"torque": [harmless, torque], "friction.mu_k": [0.5, 0.6]}
        return do(plain(), over, MEASURE, combine="zip", executor=executor, store=tmp_path)

    spawn = get_context("spawn")
    with sweep_runs.Sent() if kind == "bytes" else ProcessPoolExecutor(2, spawn) as workers:
        few(harmless, workers)
        with pytest.raises(RuntimeError, match="takes no more work: give a new one; with store="):
            few(lethal, workers)
    assert few(harmless).stored == 2


@ci
def test_a_process_killed(tmp_path: Path, expected: Any) -> None:
    kill_in(tmp_path, expected, "processes")


@pytest.mark.extended(guard=GUARD)
def test_a_run_that_kills_its_process(survivors: Any) -> None:
    check_lost("processes", survivors)


@ci
def test_a_dask_worker_killed(tmp_path: Path, expected: Any, survivors: Any) -> None:
    """Its nanny starts another, the scheduler does its batch again; one that kills all is lost."""
    with sweep_runs.cluster() as client:
        kill_in(tmp_path, expected, client)
        check_lost(client, survivors)


@pytest.mark.extended(guard="test_sweep_deaths.py::test_workers_of_the_users_that_die_are_an_error")
def test_a_cluster_that_is_closed(tmp_path: Path) -> None:
    with sweep_runs.cluster(1) as client:

        def close(_found: list[int]) -> None:
            client.cluster.scale(0)
            client.close()

        closer = when_begun(tmp_path, close)
        with pytest.raises(RuntimeError, match="the executor or the cluster was closed"):
            do(sleeping(tmp_path), OVER, MEASURE, executor=client)
        closer.join()
