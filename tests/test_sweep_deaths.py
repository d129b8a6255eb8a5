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

import beltdyn as bd
from beltdyn import pools

MEASURE = ["span_tension.final"]
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
    swept = do(sleeping(begun), OVER, MEASURE, executor=executor)
    killer.join()
    assert len(list(begun.iterdir())) > 1, "no other worker has taken over"
    same(swept.dataset, do(sleeping(begun), OVER, MEASURE).dataset)


def check_lost(executor: Any, survivors: Any) -> None:
    """One run of four is lost, with a message, and the others are as they would be without it."""
    torques = [harmless, lethal, harmless, harmless]
    over = {"torque": torques, "friction.mu_k": [0.5, 0.6, 0.7, 1.0]}
    dataset = do(plain(), over, MEASURE, combine="zip", executor=executor).dataset
    assert list(dataset.status.values) == ["finished", "lost", "finished", "finished"]
    assert "the worker process died in this run" in str(dataset.message.values[1])
    tensions = dataset["span_tension.final"].values
    assert np.isnan(tensions[1]).all()
    assert tensions[[0, 2, 3]].tobytes() == survivors.tobytes()


@pytest.fixture(scope="module")
def survivors() -> Any:
    """What the runs that kill nothing give."""
    torques = {"torque": [harmless] * 3, "friction.mu_k": [0.5, 0.7, 1.0]}
    return do(plain(), torques, MEASURE, combine="zip").dataset["span_tension.final"].values


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


def test_workers_of_the_users_that_die_are_an_error(tmp_path: Path) -> None:
    """Their executor is broken for good, and the error says so; what was done before is kept."""

    def few(torque: Any, executor: Any = "threads") -> Any:
        over = {"torque": [harmless, torque], "friction.mu_k": [0.5, 0.6]}
        return do(plain(), over, MEASURE, combine="zip", executor=executor, store=tmp_path)

    with sweep_runs.Sent() as workers:
        few(harmless, workers)
        with pytest.raises(RuntimeError, match="takes no more work: give a new one; with store="):
            few(lethal, workers)
    assert few(harmless).stored == 2


@pytest.mark.ci(guard="test_sweep_deaths.py::test_a_run_that_kills_its_worker_is_lost_alone")
def test_processes_killed(tmp_path: Path, survivors: Any) -> None:
    """By another, and by a run; those of the user's are then broken."""
    kill_in(tmp_path, "processes")
    check_lost("processes", survivors)
    over = {"torque": [harmless, lethal], "friction.mu_k": [0.5, 0.6]}
    with (
        ProcessPoolExecutor(2, get_context("spawn")) as workers,
        pytest.raises(RuntimeError, match="takes no more work: give a new one; with store="),
    ):
        do(plain(), over, MEASURE, combine="zip", executor=workers)


@pytest.mark.ci(guard="test_sweep_deaths.py::test_a_run_that_kills_its_worker_is_lost_alone")
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
            do(sleeping(tmp_path / "more"), OVER, MEASURE, executor=client)
        closer.join()
