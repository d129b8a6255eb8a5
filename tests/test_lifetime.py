"""Who keeps whom alive, and what leaks."""

import gc
import importlib.machinery
import importlib.util
import math
import os
import sys
import tracemalloc
import weakref
from pathlib import Path

import numpy as np
import pytest
from module_common import INF, N_B, N_P, TORQUE, Token, drive, make_model, run, same_bits

from beltdyn import _core
from beltdyn.errors import SimulationError

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
    # type(), for a dead weak proxy of somebody else's cannot be asked for its class
    names = [thing.__name__ for thing in gc.get_objects() if issubclass(type(thing), type)]
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
        (5e10, 2.5e7, 1e3, 0, 0.0), None, (0.0, 0.0),
    )  # fmt: skip
    settling = copy.Simulation.settle(other, tolerance=1e-4)
    copy.cycle = [other, settling]  # the module is in a cycle with objects of its own types
    del copy, spec, loader, other
    gc.collect()
    assert settling.advance(INF) is True  # the types live as long as their objects
    del settling
    gc.collect()
    assert [reference() for reference in watch] == [None, None]
    names = [thing.__name__ for thing in gc.get_objects() if issubclass(type(thing), type)]
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
    "model": lambda m, s: make_model(friction=None).info,
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
    "dahl": lambda m, s: make_model(friction=("dahl", (1.0, "x", 0.0, 0.0))),
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


@pytest.fixture
def frozen():
    """Collecting is quick when it leaves alone what was there before, most of it of other tests."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("frozen")
@pytest.mark.parametrize("name", GOOD)
def test_no_leak(rest, name):
    model = make_model()
    before = shared_counts(model, rest)
    assert not leaks(lambda: GOOD[name](model, rest))
    assert shared_counts(model, rest) == before


@pytest.mark.usefixtures("frozen")
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
    model = make_model(n_b=5000)  # some 8 MB a simulation and its twin
    zeros = np.zeros(5000)
    sizes = {"PULLEYS": N_P, "MOUNTS": 0}
    state = {name: zeros[: sizes.get(size)] for name, size, *_ in _core.STATE_FIELDS}
    state["t"] = 0.0
    place = -2 * np.pi * np.arange(5000) / 5000  # once round both pulleys, clockwise
    state["phi"] = place - np.pi / 2
    state["x"], state["y"] = 0.145 + 0.3 * np.cos(place), 0.3 * np.sin(place)

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
