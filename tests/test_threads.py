"""Who may run when: threads, a torque that calls back, its arrays and exceptions, signals."""

import contextlib
import gc
import itertools
import math
import os
import re
import signal
import threading
import time
import warnings
import weakref
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import numpy as np
import pytest
from module_common import INF, TORQUE, drive, make_model, run, same_bits

import beltdyn as bd
from beltdyn import _core
from beltdyn.base import stopping
from beltdyn.result.errors import SimulationError

LONG = 2000.0  # simulated seconds, more than any test gets to see
PATIENCE = 60.0  # wall seconds after which what should have happened did not
RUNNING = "^the simulation is running in another call"
STOP = "^the simulation was stopped by stop"

USES = [lambda s: s.advance(0.0), lambda s: s.state(), lambda s: s.sample([0.0])]
USES += [lambda s, name=name: getattr(s, name)
         for name in ("stats", "samples", "time", "method", "choice")]  # fmt: skip


def wait_until_running(simulation, use=lambda s: s.time):
    """Return True once a use is refused as another thread runs it; False after a long wait."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        try:
            use(simulation)
        except RuntimeError as error:
            if re.match(RUNNING, str(error)):
                return True
    return False


def started(work):
    thread = threading.Thread(target=work)
    thread.start()
    return thread


def test_one_simulation_two_threads(model, rest):
    simulation = _core.Simulation(model, rest, TORQUE, LONG)
    stop = threading.Event()

    def work():
        while not stop.is_set():
            with contextlib.suppress(RuntimeError):
                simulation.advance(0.05)

    thread = started(work)
    try:
        for use in USES:  # between calls of the other thread some get through
            assert wait_until_running(simulation, use)
        assert len(simulation.passes) > 2
    finally:
        stop.set()
        thread.join()
    assert 0.0 < simulation.time == simulation.state()["t"]


@pytest.mark.parametrize("kind", ["C", "Python", "settling"])
def test_stop_from_another_thread(model, rest, kind):
    if kind == "settling":  # never at rest to that degree
        simulation = _core.Simulation.settle(model, rest, tolerance=1e-300, max_time=LONG)
    else:
        torque = TORQUE if kind == "C" else [("call", drive)]
        simulation = _core.Simulation(model, rest, torque, LONG)
    thread = started(lambda: wait_until_running(simulation) and simulation.stop())
    with pytest.raises(KeyboardInterrupt, match=STOP):
        simulation.advance(PATIENCE)
    thread.join()
    assert 0.0 <= simulation.time == simulation.state()["t"]
    with pytest.raises(KeyboardInterrupt, match=STOP):  # nor does it begin again
        simulation.advance(0.0)


def test_a_stopper_ends_the_runs_of_its_threads_alone():
    scene = bd.scenes.kubas_case_1()
    rest = bd.settle(scene.params)
    stopper = stopping.Stopper()
    ended, amid = [], threading.Event()

    def torque(t, theta, omega):
        if t > 0.0:
            amid.set()
        return scene.torque_fn(t, theta, omega)

    def work():
        with stopper.watch():
            with pytest.raises(bd.Interrupted) as of_run:
                bd.simulate(scene.params, torque, LONG, initial=rest)
            with pytest.raises(bd.Interrupted) as of_settling:
                bd.settle(scene.params)
        ended.extend([of_run.value, of_settling.value])

    thread = started(work)
    assert amid.wait(PATIENCE)
    stopper.stop()
    thread.join(PATIENCE)
    assert not thread.is_alive()
    of_run, of_settling = ended
    assert of_run.result.status == "interrupted" and of_settling.result is None
    assert bd.simulate(*scene[:2], 1e-3, initial=rest).success


@pytest.mark.parametrize("torque", [TORQUE, [("call", drive)]], ids=["C", "Python"])
def test_two_simulations_two_threads(model, rest, torque):
    """One model, many threads: each as alone, to the last bit."""
    states = [{**rest, "omega": np.array([scale, scale])} for scale in (0.5, 1.0, 1.5, 2.0)]
    alone = [run(model, state, torque) for state in states]
    assert not same_bits(alone[0][1], alone[1][1])
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda state: run(model, state, torque), states))
    for (samples, final), (samples_alone, final_alone) in zip(together, alone, strict=True):
        assert same_bits(samples, samples_alone) and same_bits(final, final_alone)


def test_others_run_while_the_core_does(model, rest):
    """Not once a chunk of 7 ms: 300 would take 2 s of this thread's own CPU time."""
    simulation = _core.Simulation(model, rest, TORQUE, LONG)

    def work():
        for _ in range(300):
            if not wait_until_running(simulation):
                break
            time.sleep(0)  # lets the GIL go
        simulation.stop()

    thread, begin = started(work), time.thread_time()
    with pytest.raises(KeyboardInterrupt, match=STOP):
        simulation.advance(INF)
    assert time.thread_time() - begin < 1.0
    thread.join()


def test_a_torque_cannot_use_its_own_simulation(model, rest):
    refused = []

    def torque(t, theta, omega):
        for use in USES:
            with pytest.raises(RuntimeError, match=RUNNING):
                use(simulation)
        refused.append(t)
        assert simulation.passes
        return drive(t, theta, omega)

    simulation = _core.Simulation(model, rest, [("call", torque)], 0.002)
    assert simulation.advance(INF) is True
    assert len(refused) > 6 and simulation.time == 0.002
    assert same_bits(simulation.state(), run(model, rest, [("call", drive)], 0.002)[1])


def test_a_torque_may_run_another_simulation(model, rest):
    """And make, settle, sample and drop some: both come out as alone."""
    alone = run(model, rest, [("call", drive)], 0.001)
    inner = []

    def torque(t, theta, omega):
        if len(inner) < 5:
            inner.append(run(model, rest, [("call", drive)], 0.001))
            assert _core.Simulation.settle(make_model(), tolerance=1e-2).advance(INF) is True
        return drive(t, theta, omega)

    runs = [run(model, rest, [("call", torque)], 0.001), *inner]
    assert len(runs) == 6
    for samples, final in runs:
        assert same_bits(samples, alone[0]) and same_bits(final, alone[1])


@pytest.mark.parametrize(
    "kind", [ValueError, KeyError, SimulationError, KeyboardInterrupt, SystemExit]
)
def test_an_exception_comes_out_as_it_is(model, rest, kind):
    mine = kind("mine")

    def torque(t, theta, omega):
        if t > 0.01:
            raise mine
        return drive(t, theta, omega)

    simulation = _core.Simulation(model, rest, [("call", torque)], 0.02)
    samples = simulation.sample([0.0, 0.005, 0.02])
    with pytest.raises(kind) as caught:
        simulation.advance(INF)
    assert caught.value is mine and mine.__cause__ is None and mine.__context__ is None
    assert 0.0 < simulation.time <= 0.01 and simulation.samples == 2
    assert np.isfinite(samples["x"][:2]).all() and np.isnan(samples["x"][2]).all()
    state = simulation.state()
    assert state["t"] == simulation.time and np.isfinite(state["x"]).all()
    with pytest.raises(RuntimeError, match="ended by an exception in its torque function"):
        simulation.advance(INF)
    # the state it left is one to go on from
    assert _core.Simulation(model, state, [("call", drive)], 0.02).advance(INF) is True


def test_an_exception_is_let_go(model, rest):
    mine = type("Mine", (ValueError,), {})("mine")  # of a class of Python: it can be watched
    watch = weakref.ref(mine)
    simulation = _core.Simulation(model, rest, [("call", mock.Mock(side_effect=mine))], 0.02)
    with pytest.raises(ValueError):
        simulation.advance(INF)
    del mine, simulation
    gc.collect()
    assert watch() is None


def test_kept_arrays_keep_their_values(model, rest):
    """Whether they are kept themselves, or a slice, a memoryview or a view of them."""
    keeps = [lambda a: a, lambda a: a[:1], memoryview, lambda a: a.T.view("i8")]
    state, kept = {**rest, "omega": [1.0, 2.0]}, []

    def torque(t, theta, omega):
        n = len(kept)
        keep = keeps[n // 3 % 4]
        kept.append([(keep(a), np.array(keep(a))) for a in (theta, omega)] if n % 3 != 2 else [])
        return drive(t, theta, omega)

    final = run(model, state, [("call", torque)])[1]
    assert same_bits(final, run(model, state, [("call", drive)])[1])
    gc.collect()
    pairs = list(itertools.chain(*kept))
    assert len(pairs) > 500
    for array, values in pairs:
        assert np.asarray(array).tobytes() == values.tobytes()
    assert len({values.tobytes() for _, values in pairs}) > 100


def set_flags_and_fill(array):
    array.flags.writeable = True
    array[:] = math.nan


SPOIL = {
    "size": lambda array: array.resize(1, refcheck=False),
    "flags": set_flags_and_fill,
    "shape": lambda array: setattr(array, "shape", (2, 1)),
    "dtype": lambda array: setattr(array, "dtype", "i8"),
}


@pytest.mark.parametrize("what", SPOIL)
def test_arrays_a_torque_has_spoilt(model, rest, what):
    """What a callable does to its arguments is undone, or its arrays are not used again."""
    state = {**rest, "omega": [1.0, 2.0]}

    def torque(t, theta, omega):
        assert theta.shape == omega.shape == (2,) and omega.dtype == np.dtype(float)
        assert not theta.flags.writeable and not omega.flags.writeable
        answer = drive(t, theta, omega)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            SPOIL[what](theta)
            SPOIL[what](omega)
        return answer

    _, final = run(model, state, [("call", torque)])
    assert same_bits(final, run(model, state, [("call", drive)])[1])


def signals(simulation, number, seen=(), times=1):
    """Start a thread that sends a signal once the simulation is running, and again once seen."""

    def send():
        assert wait_until_running(simulation)
        for count in range(times):
            while len(seen) < count:
                time.sleep(1e-4)
            os.kill(os.getpid(), number)

    return started(send)


@pytest.fixture
def interrupt(handlers):
    """Send SIGINT, answered as Python does, to a simulation that is running."""

    def send(simulation):
        def handler(_number, _frame):
            with pytest.raises(RuntimeError, match=RUNNING):
                simulation.state()
            raise KeyboardInterrupt

        signal.signal(signal.SIGINT, handler)
        thread = signals(simulation, signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            simulation.advance(PATIENCE)
        thread.join()
        return simulation.state()

    return send


def test_interrupt(model, rest, interrupt):
    """A run that has no end to speak of is interrupted, and goes on as if it had not been."""
    times = np.linspace(0.0, 0.2, 41)
    undisturbed, simulation = (_core.Simulation(model, rest, TORQUE, LONG) for _ in range(2))
    expected, samples = undisturbed.sample(times), simulation.sample(times)
    for _ in range(3):
        state = interrupt(simulation)
        assert 0.0 < state["t"] == simulation.time < LONG
        assert all(np.isfinite(value).all() for value in state.values())
        assert simulation.samples == np.searchsorted(times, state["t"], side="right")
    for one in (undisturbed, simulation):
        while one.samples < times.size:
            one.advance(0.01)
    assert same_bits(samples, expected)
    for other in (
        _core.Simulation(model, rest, [("call", drive)], LONG),
        _core.Simulation.settle(model, tolerance=1e-300, max_time=LONG),
    ):
        state = interrupt(other)
        assert 0.0 <= state["t"] < LONG and np.isfinite(state["x"]).all()


def test_handlers_run_between_chunks(model, rest, handlers):
    """A handler that returns lets the run go on; it cannot use the simulation; it may raise."""
    seen = []

    def handler(_number, _frame):
        with pytest.raises(RuntimeError, match=RUNNING):
            simulation.state()
        seen.append(simulation.passes)
        if len(seen) == 3:
            raise LookupError("from the handler")

    signal.signal(signal.SIGUSR1, handler)
    simulation = _core.Simulation(model, rest, TORQUE, LONG)
    thread = signals(simulation, signal.SIGUSR1, seen, 3)
    with pytest.raises(LookupError, match="from the handler"):
        simulation.advance(PATIENCE)
    thread.join()
    assert len(seen) == 3 and simulation.advance(0.0) is False
