"""A sweep gives the same Dataset, to the last bit, wherever its runs are done, and as a loop of
simulate written by hand; Python torques go to processes, compiled ones stay; batches stay few.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any

import attrs
import numpy as np
import pytest
import sweep_runs
from sweep_runs import MEASURE, TIMES, cases, do, plain, same, under_function

import beltdyn as bd

DOUBLES = ctypes.POINTER(ctypes.c_double)
PROTOTYPE = ctypes.CFUNCTYPE(None, ctypes.c_double, DOUBLES, DOUBLES, DOUBLES, ctypes.c_void_p)

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@PROTOTYPE
def compiled(_t: float, _theta: Any, omega: Any, torque: Any, _user: Any) -> None:
    torque[0], torque[1] = -20.0, -omega[1]


@pytest.fixture(scope="module")
def expected() -> dict[str, Any]:
    """What one thread gives of every case."""
    return {name: sweep(name, 1, alone=True) for name in cases()}


def sweep(name: str, executor: Any, alone: bool = False) -> Any:
    """Do a case; ``alone``: in this very thread's interpreter, also if the torque is Python."""
    if alone:
        with ThreadPoolExecutor(1) as one:
            return sweep(name, one)
    return do(measure=MEASURE, t_eval=TIMES, executor=executor, **cases()[name]).dataset


# --- the same numbers ----------------------------------------------------------------------------


def test_of_a_loop_written_by_hand(expected: dict[str, Any]) -> None:
    """The swept values put into the scene by hand, as a user would without sweeps."""
    scene = plain()

    def with_friction(mu_k: float) -> bd.Params:
        return attrs.evolve(scene.params, friction=attrs.evolve(scene.params.friction, mu_k=mu_k))

    runs = [
        scene._replace(params=with_friction(mu_k), torque_fn=scene.torque_fn * scale)
        for scale in sweep_runs.SCALES
        for mu_k in (0.5, 1.0)
    ]
    tensions = sweep_runs.of_loop(scene, runs, [{}] * 6)
    found = expected["grid"]["span_tension"].values
    assert found.tobytes() == tensions.tobytes() and found.shape == (3, 2, 2, 2)
    assert np.ptp(found[:, 0, -1]) > 1.0  # the torque tells

    moved = sweep_runs.moved()
    ((_, speed),) = moved.motion.items() if moved.motion else ()
    of_belts = [sweep_runs.coarse(moved, 2e-3, n) for n in (20, 24)]
    runs = [run._replace(motion={0: speed * scale}) for scale in (1.0, 2.0) for run in of_belts]
    tensions = sweep_runs.of_loop(moved, runs, [{}] * 4)
    assert expected["motion"]["span_tension"].values.tobytes() == tensions.tobytes()

    mounted = sweep_runs.mounted()
    pulley = mounted.params.pulleys[1]
    drives = [
        attrs.evolve(
            mounted.params,
            pulleys=[
                attrs.evolve(one, mount=attrs.evolve(one.mount, stiffness=stiffness))
                if one is pulley
                else one
                for one in mounted.params.pulleys
            ],
        )
        for stiffness in (15.0, 20.0)
    ]
    runs = [mounted._replace(params=params) for params in drives for _ in range(2)]
    tensions = sweep_runs.of_loop(mounted, runs, [{"rtol": 1e-3}, {"rtol": 1e-4}] * 2)
    assert expected["mount"]["span_tension"].values.tobytes() == tensions.tobytes()

    runs = [under_function()._replace(torque_fn=scaled(scale)) for scale in sweep_runs.SCALES]
    tensions = sweep_runs.of_loop(plain(), runs, [{}] * 3)
    assert expected["closure"]["span_tension"].values.tobytes() == tensions.tobytes()


def scaled(scale: float) -> Any:
    inner: Any = under_function().torque_fn
    return lambda *args: [scale * one for one in inner(*args)]


def test_of_a_chain_written_by_hand(expected: dict[str, Any]) -> None:
    """warm: each run from the end of the one before along this name."""
    scene = plain()
    found = expected["warm"]["span_tension"].values
    for k, mu_k in enumerate((0.5, 1.0)):
        friction = attrs.evolve(scene.params.friction, mu_k=mu_k)
        params = attrs.evolve(scene.params, friction=friction)
        state = None
        for j, scale in enumerate(sweep_runs.SCALES):
            run = bd.simulate(params, scene.torque_fn * scale, 2e-3, t_eval=TIMES, initial=state)
            assert found[j, k].tobytes() == run.span_tension.tobytes(), (j, k)
            state = attrs.evolve(run.final_state, t=0.0)
    assert not expected["warm"].identical(expected["grid"])


def test_two_threads(expected: dict[str, Any]) -> None:
    for name in cases():
        same(sweep(name, "threads"), expected[name])
    with ThreadPoolExecutor(3) as threads:
        same(sweep("warm", threads), expected["warm"])


def test_processes(expected: dict[str, Any]) -> None:
    for name in ("warm", "lambda"):
        same(sweep(name, "processes"), expected[name])


def test_processes_of_the_users(expected: dict[str, Any]) -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        for name in cases():
            same(sweep(name, processes), expected[name])


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A client of a scheduler and two worker processes, each of one thread."""
    with sweep_runs.cluster() as client:
        yield client


def test_a_dask_cluster(expected: dict[str, Any], client: Any) -> None:
    for name in cases():
        same(sweep(name, client), expected[name])
    assert "Dask" in do(plain(), {"torque.scale": [1.0]}, MEASURE, executor=client).workers


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


# --- where runs go -------------------------------------------------------------------------------


def test_python_torques_go_to_processes_and_it_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    over = {"torque.scale": [1.0]}
    swept = do(under_function(), over, MEASURE, executor=None, progress=True)
    assert "process" in swept.workers
    said = capsys.readouterr().err
    assert "process" in said and "the torque is a Python function" in said
    swept = do(plain(), over, MEASURE, executor=None, progress=True)
    assert "thread" in swept.workers and capsys.readouterr().err == ""


def test_compiled_functions_stay_in_this_process(client: Any) -> None:
    scene = plain()._replace(torque_fn=compiled)
    over = {"friction.mu_k": [0.5, 1.0]}
    objects = plain()._replace(
        torque_fn=bd.PiecewiseLinear([0.0], [[-20.0, 0.0]]) + bd.Viscous([0.0, 1.0])
    )
    measure = [*MEASURE, "report.spans.tension"]  # reports alone would go to processes
    found = do(scene, over, measure, executor=None)
    expected = do(objects, over, measure)
    assert "thread" in found.workers and found.counts == {"finished": 2}
    np.testing.assert_allclose(
        found.dataset["span_tension"], expected.dataset["span_tension"], rtol=1e-6
    )
    for executor in ("processes", client):
        with pytest.raises(TypeError, match=r'compiled function.*executor="threads"'):
            do(scene, over, MEASURE, executor=executor)
        with pytest.raises(TypeError, match="compiled function"):
            do(plain(), {"torque": [compiled]}, MEASURE, executor=executor)


def test_what_cannot_be_sent_is_said() -> None:
    lock = threading.Lock()

    def torque(_t: float, _theta: Any, _omega: Any) -> list[float]:
        with lock:
            return [0.0, 0.0]

    scene = plain()._replace(torque_fn=torque)
    with pytest.raises(TypeError, match=r'cannot be sent.*executor="threads"'):
        do(scene, {"torque.scale": [1.0]}, MEASURE, executor="processes")
    assert do(scene, {"torque.scale": [1.0]}, MEASURE).counts == {"finished": 1}


@pytest.mark.parametrize(
    ("executor", "error", "says"),
    [
        ("process", ValueError, '"threads" or "processes"'),
        (0, ValueError, "executor must be"),
        (2.5, TypeError, "concurrent.futures.Executor"),
        (object(), TypeError, "Dask"),
    ],
)
def test_what_is_no_executor(executor: Any, error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        do(plain(), {"torque.scale": [1.0]}, MEASURE, executor=executor)


def test_futures_of_another_kind_are_refused() -> None:
    class Odd:
        def submit(self, *_: Any) -> str:
            return "later"

    with pytest.raises(TypeError, match="submit of Odd gives str"):
        do(plain(), {"torque.scale": [1.0]}, MEASURE, executor=Odd())


def test_clients_that_cannot_be_waited_for(client: Any) -> None:
    distributed = pytest.importorskip("distributed")

    async def asynchronous() -> None:
        address = client.scheduler.address
        async with distributed.Client(address, asynchronous=True) as other:
            with pytest.raises(ValueError, match="asynchronous"):
                do(plain(), {"torque.scale": [1.0]}, MEASURE, executor=other)

    client.sync(asynchronous)
    closed = distributed.Client(client.scheduler.address)
    closed.close()
    with pytest.raises(ValueError, match="closed"):
        do(plain(), {"torque.scale": [1.0]}, MEASURE, executor=closed)


def test_a_cluster_that_begins_without_workers() -> None:
    with sweep_runs.cluster(workers=0, processes=False) as client:
        client.cluster.adapt(minimum=0, maximum=1, interval="50ms")
        swept = do(plain(), {"torque.scale": sweep_runs.SCALES}, MEASURE, executor=client)
    assert swept.counts == {"finished": 3}


# --- batches -------------------------------------------------------------------------------------


class Counting(Executor):
    """An executor of the user's that counts; its workers take as long as they say."""

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._max_workers = workers
        self._lock = threading.Lock()
        self.sizes: list[int] = []
        self.flying = self.most = 0

    def submit(self, work: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        with self._lock:
            self.flying += 1
            self.most = max(self.most, self.flying)

        def counted() -> Any:
            try:
                batch = work(*args, **kwargs)
                self.sizes.append(len(batch.outcomes))
                # as if a run took this long, whatever the machine does meanwhile
                return batch._replace(seconds=[self.seconds] * len(batch.outcomes))
            finally:
                with self._lock:
                    self.flying -= 1

        return self._threads.submit(counted)

    def shutdown(self, *args: Any, **kwargs: Any) -> None:
        self._threads.shutdown(*args, **kwargs)

    seconds = 1e-3


def test_batches_are_few_for_short_runs_and_never_many_at_a_time() -> None:
    over = {"torque.scale": [k / 300 for k in range(300)]}
    with Counting(2) as counting:
        assert do(plain(1e-4), over, ["stats.steps"], executor=counting).counts == {"finished": 300}
    # Half a second in a batch could be 500 runs. Two workers with two batches each get a quarter of
    # what is left, again and again: 300 * 0.75^k, down to one, takes 20 batches.
    assert sum(counting.sizes) == 300 and len(counting.sizes) <= 25
    assert counting.most <= 4
    with Counting(2) as counting:
        counting.seconds = 0.3
        do(
            plain(1e-4),
            {"torque.scale": [k / 40 for k in range(40)]},
            ["stats.steps"],
            executor=counting,
        )
    assert counting.sizes == [1] * 40 and counting.most <= 4


def test_settled_states_and_drives_are_shared() -> None:
    """One state for all runs that differ in loads alone, one for each drive, in threads."""
    loads = {"torque.scale": [k / 20 for k in range(20)]}
    for executor in (1, 2, "threads"):
        assert do(plain(), loads, ["stats.steps"], executor=executor).settled == 1
    both = {**loads, "friction.mu_k": [0.5, 0.6, 0.7]}
    assert do(plain(), both, ["stats.steps"]).settled == 3
    speeds = {"motion.scale": [1.0, 1.5], "torque.scale": [0.5, 1.0]}
    assert do(sweep_runs.moved(), speeds, ["stats.steps"]).settled == 2  # it runs at the speed
    state = bd.settle(plain().params)
    assert do(plain(), loads, ["stats.steps"], initial=state).settled == 0
    over = {"torque.scale": [0.0, 0.5, 1.0], "friction.mu_k": [0.5, 1.0]}
    assert do(plain(), over, ["stats.steps"], warm="torque.scale").settled == 2
