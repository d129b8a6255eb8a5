"""Who keeps whom alive, and what leaks."""

import contextlib
import ctypes
import gc
import importlib.machinery
import importlib.util
import math
import os
import subprocess
import sys
import tracemalloc
import weakref
from pathlib import Path

import numpy as np
import pytest
from module_common import INF, N_B, SCENE, TORQUE, drive, make_model, run, same_bits

from beltdyn import _core
from beltdyn.result.errors import SimulationError


@pytest.fixture(autouse=True, scope="module")
def frozen():
    """The collector leaves alone what was there before, of other tests: quick and independent."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture
def collector_waits():
    """Objects are collected when a test says so, in the order in which it made them."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def test_arrays_outlive_everything_and_a_simulation_its_arrays_and_model(rest):
    model = make_model()
    expected, end = run(model, rest)
    simulation, other = (_core.Simulation(model, rest, TORQUE, 0.02) for _ in range(2))
    settling = _core.Simulation.settle(model, tolerance=1e-5)
    del model
    samples = simulation.sample(np.linspace(0.0, 0.02, 5))
    other.sample(np.linspace(0.0, 0.02, 5)).clear()
    gc.collect()
    noise = [np.full((5, N_B), 1e300) for _ in range(50)]
    assert simulation.advance(INF) is True and other.advance(INF) is True and other.samples == 5
    state = simulation.state()
    del simulation
    gc.collect()
    churn = [run(make_model(), rest) for _ in range(10)]
    assert same_bits(samples, expected) and same_bits(state, end) and same_bits(other.state(), end)
    assert all((array == 1e300).all() for array in noise)
    assert settling.advance(INF) is True and np.isfinite(settling.state()["x"]).all()
    del churn


def test_sampled_arrays_cannot_be_resized_under_a_run(model, rest):
    simulation = _core.Simulation(model, rest, TORQUE, 0.02)
    for array in simulation.sample([0.0, 0.02]).values():
        with pytest.raises(ValueError, match="does not own its data"):
            array.resize((0, 0), refcheck=False)
    assert simulation.advance(INF) is True


class Torque:
    def __call__(self, t, theta, omega):
        return [0.0, 0.0]


def test_a_cycle_through_the_torque_is_collected(model, rest, collector_waits):
    torque = Torque()
    watch = weakref.ref(torque)
    torque.simulation = _core.Simulation(model, rest, [("call", torque)], 0.02)
    torque.samples = torque.simulation.sample([0.0, 0.02])
    assert torque.simulation.advance(INF) is True
    torque.state = torque.simulation.state()
    del torque
    assert watch() is not None
    gc.collect()
    assert watch() is None


def test_a_simulation_cleared_by_the_collector(model, rest, collector_waits):
    """Whoever finds one amid the clearing of a cycle gets an exception, not freed memory.

    The collector does not know arrays, so weak references to them call back at that very moment;
    it clears in the order of making, so some find the simulation before and some after.
    """
    seen = []

    def look(_reference):
        for thing in gc.get_objects():
            if type(thing) is _core.Simulation:
                try:
                    seen.append(thing.state()["t"])
                except RuntimeError as error:
                    seen.append(str(error))

    members = [Torque() for _ in range(6)]
    simulation = _core.Simulation(model, rest, [("call", m) for m in members], 0.02)
    members += [Torque() for _ in range(6)]
    watches = []
    for member in members:
        array = np.zeros(1)
        watches.append(weakref.ref(array, look))
        member.others = [array, simulation, *members]
    del members, member, simulation, array
    gc.collect()
    assert all(watch() is None for watch in watches)
    assert "the simulation was cleared by the garbage collector" in seen


def test_a_second_copy_of_the_module(model, rest, collector_waits):
    """Multi-phase initialisation: another copy with types of its own, which can go away."""

    def types_of_the_core():
        # type(), for a dead weak proxy of somebody else's cannot be asked for its class
        kinds = [thing for thing in gc.get_objects() if issubclass(type(thing), type)]
        return {id(kind): kind for kind in kinds if kind.__module__ == "beltdyn._core"}

    before = types_of_the_core()
    loader = importlib.machinery.ExtensionFileLoader("beltdyn._core", _core.__file__)
    spec = importlib.util.spec_from_file_location("beltdyn._core", loader=loader)
    copy = importlib.util.module_from_spec(spec)
    loader.exec_module(copy)
    assert copy.Model is not _core.Model and copy.PARAMETERS == _core.PARAMETERS
    with pytest.raises(TypeError, match=r"must be beltdyn\._core\.Model, not beltdyn\._core\.Mo"):
        copy.Simulation(model, rest, [], 1.0)
    new = {key: kind for key, kind in types_of_the_core().items() if key not in before}
    assert {copy.Simulation, copy.Model} <= set(new.values())
    watches = [weakref.ref(kind) for kind in new.values()]
    other = copy.Model(**SCENE)
    settling = copy.Simulation.settle(other, tolerance=1e-4)
    copy.cycle = [other, settling]  # the module is in a cycle with objects of its own types
    del copy, spec, loader, other, new
    gc.collect()
    assert settling.advance(INF) is True  # the types live as long as their objects
    del settling
    gc.collect()
    assert [reference() for reference in watches] == [None] * len(watches)


IN_A_SUB_INTERPRETER = """
import sys
try:
    import _interpreters as interpreters  # 3.13
except ImportError:
    import _xxsubinterpreters as interpreters
code = '''
try:
    import beltdyn
except ImportError as error:
    print(error, flush=True)
'''
for loaded in (False, True):  # in the main interpreter
    if loaded:
        import beltdyn
    other = interpreters.create()
    getattr(interpreters, "exec", interpreters.run_string)(other, code)
    interpreters.destroy(other)
print(beltdyn._core.kernel_level(), sys.version_info[:2])
"""


def test_a_sub_interpreter_is_refused_by_name():
    """Whether or not NumPy is loaded in the main one, which works on."""
    command = [sys.executable, "-c", IN_A_SUB_INTERPRETER]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 3 and all("beltdyn._core" in line for line in lines[:2]), done.stdout
    if sys.version_info < (3, 12):  # from there on Python itself says it
        assert lines[0].startswith("beltdyn._core cannot be loaded in a sub-interpreter: NumPy")
        assert lines[1] == lines[0]


WITHOUT_MEMORY = """
import gc, sys
import _testcapi
import numpy as np
from module_common import SCENE, TORQUE
from beltdyn import _core

model = _core.Model(**SCENE)
settling = _core.Simulation.settle(model, tolerance=1e-3)
settling.advance(float("inf"))
rest = settling.state()
record = _core.Simulation(model, rest, TORQUE, 1e-3).export_record()
t, call = [0.0, 1e-4], [*TORQUE, ("call", lambda t, theta, omega: [0.0, 0.0])]
begun = _core.Simulation(model, rest, TORQUE, 1e-3)
begun.advance(0.0)
sampled = lambda: _core.Simulation(model, rest, call, 1e-3).sample(t)
ring = np.linspace(0.0, 1.0, 24)
for name, use in {
    "model": lambda: _core.Model(**SCENE),
    "info": lambda: (model.info, model.friction, model.rest, model.energy_terms),
    "rate": lambda: model.rate(rest, [0.0, 0.0]),
    "observe": lambda: model.observe(rest),
    "settle": lambda: _core.Simulation.settle(model),
    "simulation": lambda: _core.Simulation(model, rest, call, 1e-3),
    "sample": sampled,
    "state": begun.state,
    "shown": lambda: (begun.stats, begun.warnings, begun.choice, begun.passes, begun.sizes),
    "record": begun.export_record,
    "import": lambda: _core.Simulation(model, rest, TORQUE, 1e-3).import_record(record),
    "refused": lambda: _core.Model(**SCENE | {"radii": [-1.0, 0.1]}),
    "friction": lambda: _core.friction_law(SCENE["friction"], 0.1, ring, ring, ring),
    "line": lambda: _core.belt_line(SCENE["centers"], SCENE["radii"], names=["crank", None]),
}.items():
    gc.disable()
    for k in range(1, 5000):
        _testcapi.set_nomemory(k, k + 1)
        try:
            try:
                use()
                how = None
            except BaseException as error:
                how = type(error)
            finally:
                _testcapi.remove_mem_hooks()
        except MemoryError:  # of Python's own, on its way from an error to what handles it
            how = MemoryError
        if how is None or how is ValueError and name == "refused" and k > 200:
            break
        assert how is MemoryError or name == "refused" and how is ValueError, (name, k, how)
    gc.enable()
    print(name, k)
"""


def test_every_allocation_of_python_may_fail():
    """In each call of the binding, one at a time: MemoryError, and nothing crashes."""
    pytest.importorskip("_testcapi")
    done = subprocess.run(
        [sys.executable, "-X", "dev", "-c", WITHOUT_MEMORY],
        capture_output=True, text=True, timeout=120, check=False, cwd=Path(__file__).parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    counts = dict(line.split() for line in done.stdout.splitlines())
    assert len(counts) == 14 and int(counts["model"]) > 10 and int(counts["sample"]) > 10, counts


def heap():
    """Bytes that C has had and not given back: from malloc, or where it does not tell, in pages."""
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "mallinfo2"):
        pages = Path("/proc/self/statm").read_text().split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")

    class MallInfo2(ctypes.Structure):
        _fields_ = [(f"field_{k}", ctypes.c_size_t) for k in range(10)]

    libc.mallinfo2.restype = MallInfo2
    info = libc.mallinfo2()
    return info.field_4 + info.field_7  # mapped blocks, and blocks in use


def leaks(action):
    """Return whether Python, NumPy or C hold more after each call, even a small object.

    Free lists and caches grow up to a bound, a leak does without: one quiet round acquits.
    """

    def grows(measure):
        after = 0
        for _ in range(40):
            for _ in range(20):
                action()
            gc.collect()
            before, after = after, measure()
            if after - before < 160:  # 8 bytes a call
                return False
        return True

    tracemalloc.start()
    try:
        of_python = grows(lambda: tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    return of_python or grows(heap)


def shared_counts(model, state):
    """Count the references to what the actions below share."""
    gc.collect()
    things = [model, _core.Model, _core.Simulation, drive, TORQUE, SimulationError]
    things += [value for name, value in state.items() if name != "t"]
    return [sys.getrefcount(thing) for thing in things]


def new(model, state, torque=TORQUE, t_end=1.0, **options):
    return _core.Simulation(model, state, torque, t_end, **options)


def advance(model, state, torque=TORQUE):
    simulation = new(model, state, torque, 0.002)
    simulation.sample([0.0, 0.001])
    simulation.advance(INF)
    return simulation


def answers(model, state, answer):
    return advance(model, state, [("call", answer)])


def keep_all(t, theta, omega, kept=[]):  # noqa: B006
    kept[:] = [theta, omega]
    return [0.0, 0.0]


GOOD = {
    "model": lambda m, s: make_model(friction=None).info,
    "rate": lambda m, s: m.rate(s, [1.0, 2.0]),
    "law": lambda m, s: _core.friction_law(SCENE["friction"], 0.1, s["vx"], s["vx"], s["vx"]),
    "new": lambda m, s: new(m, s, breakpoints=[0.5], method="rk4"),
    "run": lambda m, s: advance(m, s).state(),
    "call": lambda m, s: answers(m, s, drive).stats,
    "kept": lambda m, s: answers(m, s, keep_all).passes,
    "array": lambda m, s: answers(m, s, lambda *_: np.zeros(2, "f4")).method,
    "settle": lambda m, s: _core.Simulation.settle(m, s, tolerance=0.5).advance(INF),
    "large": lambda m, s: _core.Simulation.settle(make_model(n_b=5000)).passes,
}
CALL = ("call", drive)
FAIL = {
    "belt": lambda m, s: make_model(n_b=2.5),
    "law": lambda m, s: make_model(friction=("dahl", (1.0, "x", 0.0, 0.0))),
    "missing": lambda m, s: m.rate({"t": 0.0, "x": s["x"]}, [1.0, 2.0]),
    "nan": lambda m, s: m.rate({**s, "omega": [0.0, math.nan]}, [1.0, 2.0]),
    "option": lambda m, s: new(m, s, [CALL], rtol=-1.0),
    "term": lambda m, s: new(m, s, [CALL, *TORQUE, ("x", 1)]),
    "breaks": lambda m, s: new(m, s, [CALL], breakpoints=[None]),
    "late": lambda m, s: advance(m, s).sample([0.0]),
    "answer": lambda m, s: answers(m, s, lambda *_: [1.0, None]),
    "raise": lambda m, s: answers(m, s, lambda *_: 1 / 0),
    "failure": lambda m, s: answers(m, s, lambda *_: [math.nan, 0.0]),
    "offset": lambda m, s: _core.Simulation.settle(m, s, offset=[[0, 0]]),
}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", [*GOOD, *FAIL])
def test_no_leak(rest, name):
    """Of Python's, NumPy's or C's memory, nor a reference to what is given, in success or error."""
    model = make_model()

    def action():
        if name in GOOD:
            GOOD[name](model, rest)
            return
        with contextlib.suppress(TypeError, ValueError, RuntimeError, ZeroDivisionError):
            FAIL[name](model, rest)
            raise AssertionError("this should have failed")

    before = shared_counts(model, rest)
    assert not leaks(action)
    assert shared_counts(model, rest) == before
