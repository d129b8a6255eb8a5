"""Who keeps whom alive, who may run when: lifetimes, leaks, threads, re-entry, signals."""

import contextlib
import gc
import importlib.machinery
import importlib.util
import math
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
import tracemalloc
import warnings
import weakref
from pathlib import Path

import numpy as np
import pytest

from beltdyn import _core
from beltdyn.errors import SimulationError

N_B, N_P = 24, 2
INF = math.inf
TORQUE = [("piecewise", [0.0, 0.02], [[0.0, 0.0], [-50.0, 0.0]]), ("viscous", [0.0, 16.0])]
LONG = 2000.0  # simulated seconds, more than any test gets to see
PATIENCE = 10.0  # wall seconds after which what should have happened did not
RUNNING = "^the simulation is running in another call"


def make_model(n_b=N_B, dahl=(1.0, 1e4)):
    belt = (1.2, n_b, 0.1, 70e3, 1.4, 0.01, 0.0)
    centers, radii, inertias = [(0.0, 0.0), (0.29, 0.0)], [0.1, 0.1], [0.01, 0.01]
    return _core.Model(belt, centers, radii, inertias, (5e10, 2.5e7, 1e3), dahl, (0.0, 0.0))


@pytest.fixture(scope="module")
def model():
    return make_model()


@pytest.fixture(scope="module")
def rest(model):
    settling = _core.Simulation.settle(model, tolerance=1e-5)
    assert settling.advance(INF) is True
    return settling.state()


def drive(t, theta, omega):
    """Give the torques of TORQUE; to the last bit it is not, being summed otherwise."""
    return [-50.0 * t / 0.02, -16.0 * omega[1]]


def run(model, state, torque=TORQUE, t_end=0.02):
    """Run to the end: the samples and the final state."""
    simulation = _core.Simulation(model, state, torque, t_end)
    samples = simulation.sample(np.linspace(0.0, t_end, 5))
    assert simulation.advance(INF) is True
    return samples, simulation.state()


def same_bits(one, other):
    """Compare two dicts of arrays to the last bit."""
    return one.keys() == other.keys() and all(
        np.asarray(one[name]).tobytes() == np.asarray(other[name]).tobytes() for name in one
    )


def wait_until_running(simulation):
    """Return True as soon as another thread runs the simulation; False after a long wait."""
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline:
        try:
            assert simulation.time >= 0
        except RuntimeError:
            return True
    return False


# --- who keeps whom alive ----------------------------------------------------------------------


def test_arrays_outlive_everything(rest):
    model = make_model()
    expected, _ = run(model, rest)
    simulation = _core.Simulation(model, rest, TORQUE, 0.02)
    samples = simulation.sample(np.linspace(0.0, 0.02, 5))
    simulation.advance(INF)
    state = simulation.state()
    kept = {name: value if name == "t" else value.copy() for name, value in state.items()}
    del simulation, model
    gc.collect()
    churn = [run(make_model(), rest) for _ in range(20)]
    assert same_bits(samples, expected) and same_bits(state, kept)
    del churn


def test_a_simulation_outlives_its_arrays_and_its_model(rest):
    model = make_model()
    _, expected = run(model, rest)
    simulation = _core.Simulation(model, rest, TORQUE, 0.02)
    del model
    simulation.sample(np.linspace(0.0, 0.02, 5)).clear()
    gc.collect()
    noise = [np.full((5, N_B), 1e300) for _ in range(50)]
    assert simulation.advance(INF) is True and simulation.samples == 5
    assert same_bits(simulation.state(), expected)
    assert all((array == 1e300).all() for array in noise)


def test_a_settling_outlives_its_model():
    settling = _core.Simulation.settle(make_model(), tolerance=1e-5)
    gc.collect()
    assert settling.advance(INF) is True and np.isfinite(settling.state()["x"]).all()


def test_sampled_arrays_cannot_be_resized_under_a_run(model, rest):
    simulation = _core.Simulation(model, rest, TORQUE, 0.02)
    for array in simulation.sample([0.0, 0.02]).values():
        with pytest.raises(ValueError, match="does not own its data"):
            array.resize((0, 0), refcheck=False)
    assert simulation.advance(INF) is True


def test_one_reference_each(model, rest):
    def torque(t, theta, omega):
        return [0.0, 0.0]

    before = sys.getrefcount(model), sys.getrefcount(torque)
    simulation = _core.Simulation(model, rest, [("call", torque), ("call", torque)], 0.02)
    assert sys.getrefcount(model) == before[0] + 1
    assert sys.getrefcount(torque) == before[1] + 2
    samples = simulation.sample([0.0, 0.02])
    assert simulation.advance(INF) is True
    simulation.state()
    assert (sys.getrefcount(model), sys.getrefcount(torque)) == (before[0] + 1, before[1] + 2)
    del simulation
    assert (sys.getrefcount(model), sys.getrefcount(torque)) == before
    bases = [array.base for array in samples.values()]
    counts = {sys.getrefcount(base) for base in bases}
    assert counts == {4}  # of the view, the list, the variable and the argument


def test_inputs_are_given_back(model, rest):
    state = {name: value if name == "t" else value.copy() for name, value in rest.items()}
    arrays = [value for name, value in state.items() if name != "t"]
    arrays += [np.zeros(1), np.zeros((1, 2)), np.zeros(2), np.zeros(1), np.zeros((2, 2))]
    t, values, coefficients, breakpoints, offset = arrays[-5:]
    before = [sys.getrefcount(array) for array in arrays]
    torque = [("piecewise", t, values), ("viscous", coefficients)]
    simulation = _core.Simulation(model, state, torque, 0.02, breakpoints=breakpoints)
    settling = _core.Simulation.settle(model, state, offset=offset)
    model.rate(state, coefficients)
    torque.clear()
    assert [sys.getrefcount(array) for array in arrays] == before
    del simulation, settling


class Token:
    """Something that weak references can watch."""


def test_a_cycle_through_the_torque_is_collected(model, rest):
    token = Token()
    watch = weakref.ref(token)

    def make(token):
        def torque(t, theta, omega):
            return [0.0, 0.0]

        torque.token = token
        simulation = _core.Simulation(model, rest, [("call", torque)], 0.02)
        torque.simulation = simulation
        torque.samples = simulation.sample([0.0, 0.02])
        torque.state = None
        assert simulation.advance(INF) is True
        torque.state = simulation.state()

    make(token)
    del token
    assert watch() is not None
    gc.collect()
    assert watch() is None


def test_a_simulation_cleared_by_the_collector(model, rest):
    """Whoever finds one amid the clearing of a cycle gets an exception, not freed memory.

    The collector does not know arrays, so weak references to them call back at that very moment.
    """
    seen = []

    def look(_reference):
        for thing in gc.get_objects():
            if type(thing) is _core.Simulation:
                try:
                    seen.append(thing.state()["t"])
                except RuntimeError as error:
                    seen.append(str(error))

    class Member:
        def __call__(self, t, theta, omega):
            return [0.0, 0.0]

    members = [Member() for _ in range(6)]
    simulation = _core.Simulation(model, rest, [("call", m) for m in members], 0.02)
    members += [Member() for _ in range(6)]
    watches = []
    for member in members:
        array = np.zeros(1)
        watches.append(weakref.ref(array, look))
        member.others = [array, simulation, *members]
    del members, member, simulation, array
    gc.collect()
    assert all(watch() is None for watch in watches)
    assert "the simulation was cleared by the garbage collector" in seen


def test_a_second_copy_of_the_module(model, rest):
    """Multi-phase initialisation: another copy with types of its own, which can go away."""
    names = [thing.__name__ for thing in gc.get_objects() if isinstance(thing, type)]
    before = names.count("Model"), names.count("Simulation")
    loader = importlib.machinery.ExtensionFileLoader("beltdyn._core", _core.__file__)
    spec = importlib.util.spec_from_file_location("beltdyn._core", loader=loader)
    copy = importlib.util.module_from_spec(spec)
    loader.exec_module(copy)
    assert copy.Model is not _core.Model and copy.PARAMETERS == _core.PARAMETERS
    with pytest.raises(
        TypeError, match=r"must be beltdyn\._core\.Model, not beltdyn\._core\.Model"
    ):
        copy.Simulation(model, rest, [], 1.0)
    watch = weakref.ref(copy.Simulation), weakref.ref(copy.Model)
    other = copy.Model(
        (1.2, 24, 0.1, 70e3, 1.4, 0.01, 0.0), [(0.0, 0.0), (0.29, 0.0)], [0.1, 0.1], [0.01, 0.01],
        (5e10, 2.5e7, 1e3), None, (0.0, 0.0),
    )  # fmt: skip
    settling = copy.Simulation.settle(other, tolerance=1e-4)
    copy.cycle = [other, settling]  # the module is in a cycle with objects of its own types
    del copy, spec, loader, other
    gc.collect()
    assert settling.advance(INF) is True  # the types live as long as their objects
    del settling
    gc.collect()
    assert [reference() for reference in watch] == [None, None]
    names = [thing.__name__ for thing in gc.get_objects() if isinstance(thing, type)]
    assert (names.count("Model"), names.count("Simulation")) == before


# --- leaks -------------------------------------------------------------------------------------


def leaks(action):
    """Tell whether Python and NumPy hold more after each call, even a small object.

    Free lists and caches grow up to a bound, a leak does without: one quiet round acquits.
    """
    tracemalloc.start()
    try:
        before, rounds = 0, 40
        for _ in range(rounds):
            for _ in range(100):
                action()
            gc.collect()
            now = tracemalloc.get_traced_memory()[0]
            if now - before < 800:
                return False
            before = now
        return True
    finally:
        tracemalloc.stop()


def shared_counts(model, state):
    """Count the references to what the actions below share."""
    gc.collect()
    things = [model, _core.Model, _core.Simulation, drive, TORQUE, SimulationError]
    things += [value for name, value in state.items() if name != "t"]
    return [sys.getrefcount(thing) for thing in things]


def attempt(action):
    """Make the action one that must fail."""

    def attempted():
        try:
            action()
        except (TypeError, ValueError, RuntimeError, ZeroDivisionError):
            return
        raise AssertionError("this should have failed")

    return attempted


def keep_all(t, theta, omega, kept=[]):  # noqa: B006
    kept[:] = [theta, omega]
    return [0.0, 0.0]


def advance(model, state, torque):
    simulation = _core.Simulation(model, state, torque, 0.002)
    simulation.sample([0.0, 0.001])
    simulation.advance(INF)
    return simulation


def misuse(model, state):
    simulation = advance(model, state, TORQUE)
    simulation.sample([0.0])


GOOD = {
    "model": lambda m, s: make_model(dahl=None).info,
    "geometry": lambda m, s: m.check_geometry(),
    "rate": lambda m, s: m.rate(s, [1.0, 2.0]),
    "dahl": lambda m, s: (_core.dahl_slide(s["x"], 0, 1, 1), _core.dahl_path(s["x"], 0, 1, 1)),
    "new": lambda m, s: _core.Simulation(m, s, TORQUE, 1.0, breakpoints=[0.5], method="rk4"),
    "run": lambda m, s: advance(m, s, TORQUE).state(),
    "call": lambda m, s: advance(m, s, [("call", drive)]).stats,
    "kept": lambda m, s: advance(m, s, [("call", keep_all)]).passes,
    "array": lambda m, s: advance(m, s, [("call", lambda *_: np.zeros(2, "f4"))]).method,
    "settle": lambda m, s: _core.Simulation.settle(m, s, tolerance=0.5).advance(INF),
}
BAD = {
    "belt": lambda m, s: make_model(n_b=2.5),
    "rule": lambda m, s: make_model(n_b=2),
    "dahl": lambda m, s: make_model(dahl=(1.0, "x")),
    "path": lambda m, s: _core.dahl_path([0.0, math.nan], 0, 1, 1),
    "rate": lambda m, s: m.rate(s, [1.0]),
    "missing": lambda m, s: m.rate({"t": 0.0, "x": s["x"]}, [1.0, 2.0]),
    "nan": lambda m, s: m.rate({**s, "omega": [0.0, math.nan]}, [1.0, 2.0]),
    "t_end": lambda m, s: _core.Simulation(m, s, TORQUE, -1.0),
    "option": lambda m, s: _core.Simulation(m, s, [("call", drive)], 1.0, rtol=-1.0),
    "method": lambda m, s: _core.Simulation(m, s, TORQUE, 1.0, method="x"),
    "term": lambda m, s: _core.Simulation(m, s, [("call", drive), *TORQUE, ("x", 1)], 1.0),
    "values": lambda m, s: _core.Simulation(m, s, [("call", drive), ("viscous", [1])], 1.0),
    "breaks": lambda m, s: _core.Simulation(m, s, [("call", drive)], 1.0, breakpoints=[None]),
    "torque": lambda m, s: _core.Simulation(m, s, None, 1.0),
    "sample": lambda m, s: _core.Simulation(m, s, TORQUE, 1.0).sample([2.0]),
    "late": misuse,
    "seconds": lambda m, s: _core.Simulation(m, s, TORQUE, 1.0).advance(-1.0),
    "answer": lambda m, s: advance(m, s, [("call", lambda *_: [1.0, None])]),
    "shape": lambda m, s: advance(m, s, [("call", lambda *_: np.zeros((2, 2)))]),
    "raise": lambda m, s: advance(m, s, [("call", lambda *_: 1 / 0)]),
    "failure": lambda m, s: advance(m, s, [("call", lambda *_: [math.nan, 0.0])]),
    "settle": lambda m, s: _core.Simulation.settle(m, s, offset=[[0, 0]]),
    "settling": lambda m, s: _core.Simulation.settle(m, s, tolerance=-1.0),
}


@pytest.mark.parametrize("name", GOOD)
def test_no_leak(rest, name):
    model = make_model()
    before = shared_counts(model, rest)
    assert not leaks(lambda: GOOD[name](model, rest))
    assert shared_counts(model, rest) == before


@pytest.mark.parametrize("name", BAD)
def test_no_leak_where_it_fails(rest, name):
    model = make_model()
    before = shared_counts(model, rest)
    assert not leaks(attempt(lambda: BAD[name](model, rest)))
    assert shared_counts(model, rest) == before


def resident():
    """Bytes of memory in use, the core's own among them."""
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def test_the_core_gives_its_memory_back():
    model = make_model(n_b=5000)  # some 4 MB a simulation
    zeros = np.zeros(5000)
    state = {name: zeros[:N_P] if size == "PULLEYS" else zeros for name, size in _core.STATE_FIELDS}
    state["t"] = 0.0

    def once():
        make_model(n_b=5000)
        simulation = _core.Simulation(model, state, TORQUE, 1.0)
        simulation.sample(np.linspace(0, 1, 10))
        with pytest.raises(ValueError, match="non-decreasing"):
            _core.Simulation(model, state, [("piecewise", [1, 0], np.zeros((2, 2)))], 1.0)
        model.rate(state, [0, 0])

    for action, repeat in [(once, 100), (make_model, 50000)]:
        for _ in range(5):
            action()
        before = resident()
        for _ in range(repeat):
            action()
        assert resident() - before < 20e6


# --- threads -----------------------------------------------------------------------------------


def is_refused(use):
    """Try until another thread is running the simulation; between its calls one gets through."""
    for _ in range(10000):
        try:
            use()
        except RuntimeError as error:
            if re.match(RUNNING, str(error)):
                return True
    return False


def test_one_simulation_two_threads(model, rest):
    simulation = _core.Simulation(model, rest, TORQUE, LONG)
    stop = threading.Event()

    def work():
        while not stop.is_set():
            with contextlib.suppress(RuntimeError):
                simulation.advance(0.05)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        assert is_refused(lambda: simulation.advance(0.0))
        assert is_refused(lambda: simulation.state())
        assert is_refused(lambda: simulation.sample([0.0]))
        assert is_refused(lambda: simulation.stats)
        assert is_refused(lambda: simulation.samples)
        assert is_refused(lambda: simulation.time)
        assert simulation.method == "tsit5" and len(simulation.passes) > 2
    finally:
        stop.set()
        thread.join()
    assert 0.0 < simulation.time == simulation.state()["t"]


def test_one_simulation_two_threads_in_python(model, rest):
    """The GIL is kept for a Python torque, whose own code lets other threads in."""
    inside, outside = threading.Event(), threading.Event()

    def torque(t, theta, omega):
        if not inside.is_set():
            inside.set()
            assert outside.wait(10)
        return [0.0, 0.0]

    simulation = _core.Simulation(model, rest, [("call", torque)], 0.02)
    done = []
    thread = threading.Thread(target=lambda: done.append(simulation.advance(INF)))
    thread.start()
    assert inside.wait(10)
    for use in [lambda: simulation.advance(0.0), simulation.state, lambda: simulation.time]:
        with pytest.raises(RuntimeError, match=RUNNING):
            use()
    outside.set()
    thread.join()
    assert done == [True] and simulation.time == 0.02


@pytest.mark.parametrize("torque", [TORQUE, [("call", drive)]], ids=["C", "Python"])
def test_two_simulations_two_threads(model, rest, torque):
    """One model, many threads: each as alone, to the last bit."""
    scales = [0.5, 1.0, 1.5, 2.0]
    states = [{**rest, "omega": scale * np.array([1.0, 1.0])} for scale in scales]
    alone = [run(model, state, torque) for state in states]
    assert not same_bits(alone[0][1], alone[1][1])
    for _ in range(3):
        together = [None] * len(states)

        def work(k, together=together):
            together[k] = run(model, states[k], torque)

        threads = [threading.Thread(target=work, args=(k,)) for k in range(len(states))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for (samples, final), (samples_alone, final_alone) in zip(together, alone, strict=True):
            assert same_bits(samples, samples_alone) and same_bits(final, final_alone)


def turns_of_others(simulation, seconds):
    """How often another thread gets the GIL while the simulation runs."""
    count, stop = [0], threading.Event()

    def work():
        while not stop.is_set():
            count[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        before = count[0]
        assert simulation.advance(seconds) is False
        return count[0] - before
    finally:
        stop.set()
        thread.join()


def test_others_run_while_the_core_does(model, rest):
    """Without the GIL others run all the time, not once a chunk (some 40 chunks here)."""
    assert turns_of_others(_core.Simulation(model, rest, TORQUE, LONG), 0.3) > 300


# --- a torque that calls back ------------------------------------------------------------------


def test_a_torque_cannot_use_its_own_simulation(model, rest):
    errors = []

    def torque(t, theta, omega):
        for use in [
            lambda: simulation.advance(0.0),
            lambda: simulation.state(),
            lambda: simulation.sample([0.0]),
            lambda: simulation.stats,
            lambda: simulation.samples,
            lambda: simulation.time,
        ]:
            with pytest.raises(RuntimeError, match=RUNNING) as caught:
                use()
            errors.append(caught.value)
        assert simulation.method == "tsit5" and simulation.passes
        return drive(t, theta, omega)

    simulation = _core.Simulation(model, rest, [("call", torque)], 0.002)
    assert simulation.advance(INF) is True
    assert len(errors) > 6 and simulation.time == 0.002
    _, expected = run(model, rest, [("call", drive)], 0.002)
    assert same_bits(simulation.state(), expected)


def test_re_entry_that_is_not_caught_ends_the_run(model, rest):
    def torque(t, theta, omega):
        return [0.0, 0.0 if t < 0.001 else simulation.time]

    simulation = _core.Simulation(model, rest, [("call", torque)], 0.02)
    with pytest.raises(RuntimeError, match=RUNNING):
        simulation.advance(INF)
    assert 0.0 < simulation.time <= 0.001


def test_a_torque_may_run_another_simulation(model, rest):
    """And make, settle, sample and drop some: the outer and the inner come out as alone."""
    inner_alone = run(model, rest, [("call", drive)], 0.001)
    outer_alone = run(model, rest, [("call", drive)], 0.001)
    inner = []

    def torque(t, theta, omega):
        if len(inner) < 20:
            inner.append(run(model, rest, [("call", drive)], 0.001))
            assert _core.Simulation.settle(make_model(), tolerance=1e-2).advance(INF) is True
        return drive(t, theta, omega)

    outer = run(model, rest, [("call", torque)], 0.001)
    assert same_bits(outer[0], outer_alone[0]) and same_bits(outer[1], outer_alone[1])
    assert len(inner) == 20
    for samples, final in inner:
        assert same_bits(samples, inner_alone[0]) and same_bits(final, inner_alone[1])


def test_simulations_within_simulations(model, rest):
    depth = []

    def nested(level):
        def torque(t, theta, omega):
            if level and len(depth) < 30:
                depth.append(level)
                run(model, rest, [("call", nested(level - 1))], 1e-4)
            return [0.0, 0.0]

        return torque

    _, final = run(model, rest, [("call", nested(30))], 1e-4)
    assert depth == list(range(30, 0, -1))
    assert same_bits(final, run(model, rest, [("call", nested(0))], 1e-4)[1])


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
    simulation = _core.Simulation(model, state, [("call", drive)], 0.02)
    assert simulation.advance(INF) is True


def test_an_exception_is_let_go(model, rest):
    token = Token()
    watch = weakref.ref(token)

    def torque(t, theta, omega, token=token):
        raise ValueError(token)

    simulation = _core.Simulation(model, rest, [("call", torque)], 0.02)
    with pytest.raises(ValueError):
        simulation.advance(INF)
    del token, torque
    gc.collect()
    assert watch() is not None  # the simulation's callable has it as a default
    del simulation
    gc.collect()
    assert watch() is None


# --- arrays given to a torque ------------------------------------------------------------------


@pytest.mark.parametrize(
    "keep",
    [
        lambda array: array,
        lambda array: array[:1],
        lambda array: memoryview(array),
        lambda array: array.T.view("i8"),
    ],
    ids=["itself", "slice", "memoryview", "view"],
)
def test_kept_arrays_keep_their_values(model, rest, keep):
    kept = []

    def torque(t, theta, omega):
        if len(kept) < 400 and len(kept) % 3 != 2:
            kept.append([(keep(a), np.array(keep(a))) for a in (theta, omega)])
        else:
            kept.append([])
        return drive(t, theta, omega)

    final = run(model, {**rest, "omega": [1.0, 2.0]}, [("call", torque)])[1]
    assert same_bits(final, run(model, {**rest, "omega": [1.0, 2.0]}, [("call", drive)])[1])
    gc.collect()
    pairs = [pair for call in kept for pair in call]
    assert len(pairs) > 500
    for array, values in pairs:
        assert np.asarray(array).tobytes() == values.tobytes()
    assert len({values.tobytes() for _, values in pairs}) > 100


def test_arrays_are_used_again_when_nobody_has_them(model, rest):
    seen = set()

    def torque(t, theta, omega):
        seen.update((id(theta), id(omega)))
        return [0.0, 0.0]

    run(model, rest, [("call", torque)])
    assert len(seen) == 2


def spoil_size(array):
    array.resize(1, refcheck=False)


def spoil_flags(array):
    array.flags.writeable = True
    array[:] = math.nan


def spoil_shape(array):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        array.shape = (2, 1)


def spoil_dtype(array):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        array.dtype = "i8"


@pytest.mark.parametrize("spoil", [spoil_size, spoil_flags, spoil_shape, spoil_dtype])
def test_arrays_a_torque_has_spoilt(model, rest, spoil):
    """What a callable does to its arguments is undone, or its arrays are not used again."""
    state = {**rest, "omega": [1.0, 2.0]}

    def torque(t, theta, omega):
        assert theta.shape == omega.shape == (2,) and omega.dtype == np.dtype(float)
        assert not theta.flags.writeable and not omega.flags.writeable
        answer = drive(t, theta, omega)
        spoil(theta)
        spoil(omega)
        return answer

    _, final = run(model, state, [("call", torque)])
    assert same_bits(final, run(model, state, [("call", drive)])[1])


def test_a_torque_may_hand_its_arguments_back(model, rest):
    state = {**rest, "omega": [1.0, 2.0]}
    _, final = run(model, state, [("call", lambda t, theta, omega: omega)])
    _, expected = run(model, state, [("call", lambda t, theta, omega: omega.tolist())])
    assert same_bits(final, expected)


# --- signals -----------------------------------------------------------------------------------


@pytest.fixture
def handlers():
    """Let a test set signal handlers; SIGINT is Python's own, whatever the shell has set."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGUSR1)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def when_running(simulation, action):
    """Start a thread that acts once the simulation is running."""

    def work():
        if wait_until_running(simulation):
            action()

    thread = threading.Thread(target=work)
    thread.start()
    return thread


@pytest.fixture
def interrupt(handlers):
    """Send SIGINT, answered as Python does; `.seen` says whether the simulation was running."""

    def send(simulation):
        def handler(_number, _frame):
            try:
                simulation.state()
            except RuntimeError:
                send.seen.append("running")
            raise KeyboardInterrupt

        signal.signal(signal.SIGINT, handler)
        return when_running(simulation, lambda: os.kill(os.getpid(), signal.SIGINT))

    send.seen = []
    return send


def test_interrupt(model, rest, interrupt):
    """A run that has no end to speak of is interrupted, and goes on as if it had not been."""
    times = np.linspace(0.0, 0.2, 41)
    undisturbed = _core.Simulation(model, rest, TORQUE, LONG)
    expected = undisturbed.sample(times)
    while undisturbed.samples < times.size:
        undisturbed.advance(0.01)

    simulation = _core.Simulation(model, rest, TORQUE, LONG)
    samples = simulation.sample(times)
    for _ in range(3):
        thread = interrupt(simulation)
        with pytest.raises(KeyboardInterrupt):
            simulation.advance(PATIENCE)
        thread.join()
        state = simulation.state()
        assert 0.0 < state["t"] == simulation.time < LONG
        assert all(np.isfinite(value).all() for value in state.values())
        done = simulation.samples
        assert done == np.searchsorted(times, state["t"], side="right")
        assert same_bits(
            {name: array[:done] for name, array in samples.items()},
            {name: array[:done] for name, array in expected.items()},
        )
    assert interrupt.seen == ["running"] * 3
    while simulation.samples < times.size:
        simulation.advance(0.01)
    assert same_bits(samples, expected)


def test_interrupt_in_python(model, rest, interrupt):
    simulation = _core.Simulation(model, rest, [("call", drive)], LONG)
    thread = interrupt(simulation)
    with pytest.raises(KeyboardInterrupt):
        simulation.advance(PATIENCE)
    thread.join()
    state = simulation.state()
    assert interrupt.seen == ["running"]
    assert 0.0 <= state["t"] < LONG and np.isfinite(state["x"]).all()


def test_interrupt_settling(model, interrupt):
    settling = _core.Simulation.settle(model, tolerance=1e-300, max_time=LONG)
    thread = interrupt(settling)
    with pytest.raises(KeyboardInterrupt):
        settling.advance(PATIENCE)
    thread.join()
    assert interrupt.seen == ["running"]
    assert np.isfinite(settling.state()["x"]).all()


def test_handlers_run_between_chunks(model, rest, handlers):
    """A handler that returns lets the run go on; it cannot use the simulation; it may raise."""
    seen = []

    def handler(_number, _frame):
        with pytest.raises(RuntimeError, match=RUNNING) as caught:
            simulation.state()
        seen.append(caught.value)
        if len(seen) == 3:
            raise LookupError("from the handler")

    def signal_thrice():
        for count in range(3):
            os.kill(os.getpid(), signal.SIGUSR1)
            while len(seen) <= count:
                time.sleep(1e-4)

    signal.signal(signal.SIGUSR1, handler)
    simulation = _core.Simulation(model, rest, TORQUE, LONG)
    thread = when_running(simulation, signal_thrice)
    with pytest.raises(LookupError, match="from the handler"):
        simulation.advance(PATIENCE)
    thread.join()
    assert len(seen) == 3 and simulation.advance(0.0) is False


def test_interrupt_of_a_process():
    program = textwrap.dedent("""
        import signal
        from beltdyn import _core
        signal.signal(signal.SIGINT, signal.default_int_handler)
        model = _core.Model((1.2, 24, 0.1, 70e3, 1.4, 0.01, 0.0), [(0, 0), (0.29, 0)],
                            [0.1, 0.1], [0.01, 0.01], (5e10, 2.5e7, 1e3), None, (0, 0))
        settling = _core.Simulation.settle(model, tolerance=1e-300, max_time=1e6)
        print("ready", flush=True)
        settling.advance(float("inf"))
    """)
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        try:
            _, errors = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert errors.rstrip().endswith("KeyboardInterrupt") and process.returncode != 0
