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


def kill_one(begun: Path, killed: list[int]) -> None:
    """Wait until a run is on its way in some process, and kill that."""
    for _ in range(600):
        found = [int(one.name) for one in begun.iterdir()]
        if len(found) > 0:
            assert os.getpid() not in found
            os.kill(found[0], signal.SIGKILL)
            killed.append(found[0])
            return
        time.sleep(0.05)


def kill_in(tmp_path: Path, run: Callable[[], Any]) -> Any:
    """Do a sweep of which a worker is killed."""
    killed: list[int] = []
    killer = threading.Thread(target=kill_one, args=(tmp_path, killed))
    killer.start()
    try:
        swept = run()
    finally:
        killer.join()
    assert killed, "no run has begun"
    assert len(list(tmp_path.iterdir())) > 1, "no other worker has taken over"
    return swept


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return do(sleeping(tmp_path_factory.mktemp("here")), OVER, MEASURE).dataset


@pytest.fixture(scope="module")
def survivors() -> Any:
    """What the runs that kill nothing give."""
    torques = {"torque": [harmless] * 3, "friction.mu_k": [0.5, 0.7, 1.0]}
    return do(plain(), torques, MEASURE, combine="zip").dataset


def check_lost(swept: Any, survivors: Any) -> None:
    """One run of four is lost, with a message, and the others are as they would be without it."""
    assert swept.counts == {"finished": 3, "lost": 1}
    dataset = swept.dataset
    assert list(dataset.status.values) == ["finished", "lost", "finished", "finished"]
    assert "the worker process died in this run" in str(dataset.message.values[1])
    tensions = dataset["span_tension.final"].values
    assert np.isnan(tensions[1]).all()
    assert tensions[[0, 2, 3]].tobytes() == survivors["span_tension.final"].values.tobytes()


LETHAL = {"torque": [harmless, lethal, harmless, harmless], "friction.mu_k": [0.5, 0.6, 0.7, 1.0]}


def test_a_process_killed(tmp_path: Path, expected: Any) -> None:
    run = lambda: do(sleeping(tmp_path), OVER, MEASURE, executor="processes")  # noqa: E731
    same(kill_in(tmp_path, run).dataset, expected)


def test_a_run_that_kills_its_process(survivors: Any) -> None:
    check_lost(do(plain(), LETHAL, MEASURE, combine="zip", executor="processes"), survivors)


def test_a_process_of_the_users_killed(tmp_path: Path, expected: Any) -> None:
    """The executor is broken for good: an error that says so, and nothing done is lost."""
    runs, store = tmp_path / "runs", tmp_path / "store"
    runs.mkdir()
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        # first some runs that end
        few = {"torque.scale": OVER["torque.scale"][:3]}
        do(sleeping(tmp_path / "runs"), few, MEASURE, executor=processes, store=store)
        for one in runs.iterdir():
            one.unlink()
        killed: list[int] = []
        killer = threading.Thread(target=kill_one, args=(runs, killed))
        killer.start()
        with pytest.raises(RuntimeError, match="takes no more work: give a new one; with store="):
            do(sleeping(runs), OVER, MEASURE, executor=processes, store=store)
        killer.join()
    swept = do(sleeping(runs), OVER, MEASURE, store=store)
    assert swept.stored >= 3 and swept.stored + swept.computed == 12
    same(swept.dataset, expected)


def test_a_dask_worker_killed(tmp_path: Path, expected: Any, survivors: Any) -> None:
    """Its nanny starts another, the scheduler does its batch again; one that kills all is lost."""
    with sweep_runs.cluster() as client:
        run = lambda: do(sleeping(tmp_path), OVER, MEASURE, executor=client)  # noqa: E731
        same(kill_in(tmp_path, run).dataset, expected)
        check_lost(do(plain(), LETHAL, MEASURE, combine="zip", executor=client), survivors)


def test_a_cluster_that_is_closed(tmp_path: Path) -> None:
    with sweep_runs.cluster(1) as client:

        def close() -> None:
            for _ in range(600):
                if any(tmp_path.iterdir()):
                    client.cluster.scale(0)
                    client.close()
                    return
                time.sleep(0.05)

        closer = threading.Thread(target=close)
        closer.start()
        with pytest.raises(RuntimeError, match="the executor or the cluster was closed"):
            do(sleeping(tmp_path), OVER, MEASURE, executor=client)
        closer.join()


def test_runs_after_a_lost_one_are_lost(survivors: Any) -> None:
    """Runs that start from the end of a lost one have no start; the others are not touched."""
    over = {"torque": [lethal, harmless], "friction.mu_k": [0.5, 0.7]}
    swept = do(plain(), over, MEASURE, executor="processes", warm="torque")
    assert swept.counts == {"lost": 4}
    assert "the run from whose end it starts was lost" in str(swept.dataset.message.values[1, 0])
    over = {"torque": [harmless, lethal], "friction.mu_k": [0.5, 0.7]}
    swept = do(plain(), over, MEASURE, executor="processes", warm="torque")
    assert list(swept.dataset.status.values[0]) == ["finished"] * 2
    tensions = swept.dataset["span_tension.final"].values[0]
    assert tensions.tobytes() == survivors["span_tension.final"].values[:2].tobytes()
