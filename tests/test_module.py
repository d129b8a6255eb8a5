"""The binding by itself: what it takes, what it refuses and in which words, what it returns."""

import ctypes
import inspect
import math
import re
from fractions import Fraction

import numpy as np
import pytest

from beltdyn import _core
from beltdyn.errors import SimulationError

N_B, N_P = 24, 2
SCENE = {
    "belt": (1.2, N_B, 0.1, 70e3, 1.4, 0.01, 0.0),
    "centers": [(0.0, 0.0), (0.29, 0.0)],
    "radii": [0.1, 0.1],
    "inertias": [0.01, 0.01],
    "contact": (5e10, 2.5e7, 1e3),
    "dahl": (1.0, 1e4),
    "gravity": (0.0, 0.0),
}
TORQUE = [("piecewise", [0.0, 0.02], [[0.0, 0.0], [-50.0, 0.0]]), ("viscous", [0.0, 16.0])]
INF = math.inf


def make_model(**changes):
    return _core.Model(**{**SCENE, **changes})


@pytest.fixture(scope="module")
def model():
    return make_model()


@pytest.fixture(scope="module")
def rest(model):
    settling = _core.Simulation.settle(model, tolerance=1e-5)
    assert settling.advance(INF) is True
    return settling.state()


def make_simulation(model, rest, torque=TORQUE, t_end=0.02, **options):
    return _core.Simulation(model, rest, torque, t_end, **options)


def refused(kind, message):
    """pytest.raises with the whole message, as it stands."""
    return pytest.raises(kind, match=f"^{re.escape(message)}$")


def same_bits(one, other):
    """Compare two dicts of arrays to the last bit."""
    return one.keys() == other.keys() and all(
        np.asarray(one[name]).tobytes() == np.asarray(other[name]).tobytes() for name in one
    )


def kind_of(value):
    """Name a value's type as messages do."""
    kind = type(value)
    return kind.__name__ if kind.__module__ == "builtins" else f"{kind.__module__}.{kind.__name__}"


def strange_layouts(values):
    """Lay the same numbers out in every way NumPy knows, by name."""
    values = np.asarray(values, dtype=float)
    padded = np.zeros((*values.shape[:-1], 2 * values.shape[-1]))
    padded[..., ::2] = values
    unaligned = np.zeros(values.nbytes + 1, np.uint8)[1:].view(float).reshape(values.shape)
    unaligned[...] = values
    read_only = values.copy()
    read_only.flags.writeable = False
    return {
        "non-contiguous": padded[..., ::2],
        "reversed": np.ascontiguousarray(values[::-1])[::-1],
        "big-endian": values.astype(">f8"),
        "Fortran order": np.asfortranarray(values),
        "unaligned": unaligned,
        "read-only": read_only,
        "list": values.tolist(),
    }


LAYOUTS = list(strange_layouts([0.0]))


# --- the module --------------------------------------------------------------------------------


def test_tables_are_what_the_objects_use(model, rest):
    simulation = make_simulation(model, rest)
    state_names = [name for name, _ in _core.STATE_FIELDS]
    assert list(simulation.state()) == ["t", *state_names]
    assert list(model.rate(rest, [0, 0])) == state_names
    assert list(simulation.sample([0.0])) == [row[0] for row in _core.OUTPUTS] + ["pulley"]
    assert list(simulation.stats) == [name for name, _ in _core.STATS]
    assert {size for _, size in _core.STATE_FIELDS} == {"LINKS", "SLOTS", "PULLEYS"}
    assert {row[2] for row in _core.OUTPUTS} == {"LINKS", "PULLEYS", "ENERGY"}
    assert {row[2] for row in _core.PARAMETERS} <= {"POSITIVE", "NONNEGATIVE", "FINITE", "LINKS"}


def test_tables_hold_their_columns():
    for table, width in [
        (_core.PARAMETERS, 5),
        (_core.STATE_FIELDS, 2),
        (_core.OUTPUTS, 5),
        (_core.ENERGY_TERMS, 2),
        (_core.STATS, 2),
    ]:
        assert isinstance(table, tuple) and len(table) > 0
        assert all(isinstance(row, tuple) and len(row) == width for row in table)
        assert all(isinstance(cell, str) and cell for row in table for cell in row)
    symbols, codes, kinds, texts = zip(*_core.ERRORS, strict=True)
    assert all(symbol.startswith("BD_ERR_") for symbol in symbols) and all(texts)
    assert all(code < 0 for code in codes) and len(set(codes)) == len(codes)
    assert set(kinds) == {"VALUE", "MEMORY", "USE", "CALL", "RUN"}


def test_belt_parameters_are_in_the_order_of_the_tuple():
    names = [name for group, name, *_ in _core.PARAMETERS if group == "belt"]
    assert names[:4] == ["length", "n_bodies", "linear_density", "axial_stiffness"]
    assert len(names) == len(SCENE["belt"])


def test_constants():
    assert _core.MAX_STRAIN == 0.25
    assert re.fullmatch(r"\d+\.\d+\.\d+", _core.__version__)
    assert _core.kernel_level() in {"avx512", "avx2", "baseline"}


def test_kernel_level_follows_the_environment(monkeypatch):
    monkeypatch.setenv("BELTDYN_KERNELS", "baseline")
    assert _core.kernel_level() == "baseline"


@pytest.mark.parametrize(
    "thing",
    [
        _core,
        _core.kernel_level,
        _core.dahl_slide,
        _core.dahl_path,
        _core.Model,
        _core.Model.check_geometry,
        _core.Model.info,
        _core.Model.rate,
        _core.Simulation,
        _core.Simulation.settle,
        _core.Simulation.sample,
        _core.Simulation.advance,
        _core.Simulation.state,
        _core.Simulation.time,
        _core.Simulation.samples,
        _core.Simulation.method,
        _core.Simulation.passes,
        _core.Simulation.stats,
    ],
    ids=lambda thing: getattr(thing, "__qualname__", None) or thing.__name__,
)
def test_everything_has_a_docstring(thing):
    assert len(thing.__doc__) > 20


def test_signatures_can_be_read():
    assert list(inspect.signature(_core.Model).parameters) == list(SCENE)
    keyword = [
        name
        for name, parameter in inspect.signature(_core.Simulation).parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY
    ]
    assert keyword == [
        "method", "rtol", "step", "max_step", "max_steps", "ledger", "breakpoints",
    ]  # fmt: skip
    settle = inspect.signature(_core.Simulation.settle).parameters
    assert list(settle)[:2] == ["model", "state"] and settle["state"].default is None


def test_arguments_have_their_names(model, rest):
    simulation = _core.Simulation(model=model, state=rest, torque=TORQUE, t_end=0.02)
    assert len(simulation.sample(t=[0.0])["x"]) == 1 and simulation.advance(seconds=INF) is True
    assert model.rate(state=rest, torque=[0, 0]).keys() == model.rate(rest, [0, 0]).keys()
    assert _core.Simulation.settle(model=model, state=rest).time == 0.0


@pytest.mark.parametrize("kind", [_core.Model, _core.Simulation])
def test_types_are_closed(kind):
    with pytest.raises(TypeError, match="not an acceptable base type"):
        type("Derived", (kind,), {})
    with pytest.raises(TypeError, match="immutable type"):
        kind.advance = None
    with pytest.raises(TypeError, match="missing required argument"):
        kind.__new__(kind)
    assert kind.__module__ == "beltdyn._core"


def test_the_model_cannot_be_made_twice(model):
    before = model.info
    model.__init__()
    assert model.info == before
    with pytest.raises(AttributeError):
        model.info = {}
    with pytest.raises(AttributeError):
        model.other = 1


# --- Dahl --------------------------------------------------------------------------------------


def test_dahl_slide_keeps_the_shape():
    dx = np.array([[1e-5, -1e-5, 0.0], [1.0, -1.0, 2e-4]])
    mu = _core.dahl_slide(dx, 0.1, 1.0, 1e4)
    assert mu.shape == dx.shape and mu.dtype == np.float64
    sign = np.where(dx < 0, -1.0, 1.0)
    np.testing.assert_allclose(mu, (0.1 - sign) * np.exp(-1e4 * abs(dx)) + sign, rtol=1e-13)
    point = _core.dahl_slide(1e-4, 0.0, 1.0, 1e4)
    assert point.shape == () and point == pytest.approx(1 - math.exp(-1))


def test_dahl_path():
    mu = _core.dahl_path([0.0, 1e-4, 0.0], mu0=0.0, mu_k=1.0, sigma=1e4)
    top = 1 - math.exp(-1)
    np.testing.assert_allclose(mu, [0, top, (top + 1) * math.exp(-1) - 1], rtol=1e-13)
    assert _core.dahl_path([], 0.0, 1.0, 1e4).shape == (0,)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_dahl_layouts(layout):
    x = np.array([0.0, 2e-5, -1e-4, 3e-4])
    given = strange_layouts(x)[layout]
    assert _core.dahl_path(given, 0.0, 1.0, 1e4).tobytes() == (
        _core.dahl_path(x, 0.0, 1.0, 1e4).tobytes()
    )


def test_dahl_refuses():
    with refused(ValueError, "x must have shape (n,), got (1, 2)"):
        _core.dahl_path([[0.0, 1.0]], 0, 1, 1)
    with refused(ValueError, "dx[0, 1] must be finite, got inf"):
        _core.dahl_slide([[0.0, INF]], 0, 1, 1)
    with refused(ValueError, "dx must be finite, got nan"):
        _core.dahl_slide(math.nan, 0, 1, 1)
    with refused(ValueError, "mu_k must be > 0, got 0"):
        _core.dahl_slide(0.0, 0, 0, 1)
    with refused(ValueError, "sigma must be finite, got inf"):
        _core.dahl_slide(0.0, 0, 1, INF)
    with refused(TypeError, "mu0 must be a real number, got str"):
        _core.dahl_path([0.0], "0", 1, 1)


@pytest.mark.parametrize(
    "call",
    [
        lambda model: _core.dahl_slide(1.0),
        lambda model: _core.dahl_path([1.0], 0, 1, sigma_0=1),
        lambda model: _core.kernel_level(1),
        lambda model: model.rate({}),
        lambda model: model.check_geometry(1),
        lambda model: _core.Simulation(model),
        lambda model: _core.Simulation.settle(),
    ],
)
def test_arguments_are_counted(model, call):
    with pytest.raises(TypeError, match="argument"):
        call(model)


# --- scalars -----------------------------------------------------------------------------------


class Half:
    def __float__(self):
        return 0.5


class Broken:
    def __float__(self):
        raise ZeroDivisionError("mine")


@pytest.mark.parametrize(
    "value",
    [1, 1.0, np.float64(1), np.float32(1), np.float16(1), np.int8(1), np.uint64(1),
     np.longdouble(1), np.array(1.0), np.array(1), Fraction(2, 2)],
    ids=lambda value: f"{type(value).__name__}",
)  # fmt: skip
def test_real_numbers_are_taken(value):
    assert _core.dahl_slide(0.0, value, 1.0, 1.0) == 1.0
    assert _core.dahl_slide(0.0, Half(), 1.0, 1.0) == 0.5


@pytest.mark.parametrize(
    "value",
    [True, np.True_, "1", b"1", None, 1j, np.complex128(1), [1.0], np.array([1.0]),
     np.array(True), np.array(1j), np.array("1"), np.array(None)],
    ids=lambda value: f"{type(value).__name__} {value!r}",
)  # fmt: skip
def test_other_things_are_no_numbers(model, rest, value):
    got = f"must be a real number, got {kind_of(value)}"
    with refused(TypeError, f"t_end {got}"):
        make_simulation(model, rest, t_end=value)
    with refused(TypeError, f"seconds {got}"):
        make_simulation(model, rest).advance(value)
    for name in ["rtol", "step", "max_step"]:
        with refused(TypeError, f"{name} {got}"):
            make_simulation(model, rest, **{name: value})
    for name in ["move_time", "tolerance", "max_time"]:
        with refused(TypeError, f"{name} {got}"):
            _core.Simulation.settle(model, **{name: value})


def test_numbers_out_of_reach(model, rest):
    with refused(ValueError, "mu0 is too large for a float64"):
        _core.dahl_slide(0.0, 10**400, 1.0, 1.0)
    with pytest.raises(ZeroDivisionError, match="mine"):
        _core.dahl_slide(0.0, Broken(), 1.0, 1.0)
    with refused(ValueError, f"max_steps is too large: {2**70}"):
        make_simulation(model, rest, max_steps=2**70)
    with refused(ValueError, f"max_steps is too small: {-(2**70)}"):
        make_simulation(model, rest, max_steps=-(2**70))


@pytest.mark.parametrize("value", [1.0, "1", True, np.True_, None, np.float64(3), np.array(3.0)])
def test_integers_are_integers(model, rest, value):
    with pytest.raises(TypeError, match=r"^max_steps must be an integer, got "):
        make_simulation(model, rest, max_steps=value)


@pytest.mark.parametrize("value", [7, np.int16(7), np.uint8(7), np.array(7)])
def test_integers_of_any_width(model, rest, value):
    simulation = make_simulation(model, rest, max_steps=value)
    with pytest.raises(SimulationError) as caught:
        simulation.advance(INF)
    assert caught.value.symbol == "BD_ERR_MAX_STEPS" and simulation.stats["steps"] == 7


@pytest.mark.parametrize("value", [0, 1, "yes", None, [], 1.0])
def test_flags_are_bools(model, rest, value):
    kind = type(value).__name__
    with refused(TypeError, f"ledger must be True or False, got {kind}"):
        make_simulation(model, rest, ledger=value)
    for name in ["friction", "free_pulleys"]:
        with refused(TypeError, f"{name} must be True or False, got {kind}"):
            _core.Simulation.settle(model, **{name: value})


# --- Model -------------------------------------------------------------------------------------


def test_model_info(model):
    info = model.info
    assert info["n_bodies"] == N_B and info["n_pulleys"] == N_P and info["winding"] == -1
    assert info["n_slots"] == 1 and make_model(dahl=None).info["n_slots"] == 0
    assert info["link_length"] == 1.2 / N_B
    assert info["path_length"] == pytest.approx(0.58 + 0.2 * math.pi, rel=1e-14)
    integers = {"n_bodies", "n_pulleys", "n_slots", "winding"}
    assert {name for name, value in info.items() if isinstance(value, int)} == integers
    assert all(type(value) in (int, float) for value in info.values())
    info.clear()
    assert model.info["n_bodies"] == N_B


def test_check_geometry(model):
    assert model.check_geometry() is None
    with pytest.raises(ValueError, match="overlap"):
        make_model(centers=[(0, 0), (0.1, 0)]).check_geometry()
    with pytest.raises(ValueError, match="slack"):
        make_model(centers=[(0, 0), (0.25, 0)]).check_geometry()


@pytest.mark.parametrize("name", SCENE)
def test_model_needs_every_argument(name):
    with pytest.raises(TypeError, match=f"missing required argument '{name}'"):
        _core.Model(**{key: value for key, value in SCENE.items() if key != name})


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"belt": [1.2] * 7}, TypeError, "belt must be a tuple of 7 numbers, got list"),
        ({"belt": (1.2, 24)}, ValueError, "belt must have 7 numbers, got 2"),
        ({"belt": ("1.2", *SCENE["belt"][1:])}, TypeError,
         "belt.length must be a real number, got str"),
        ({"belt": (1.2, 24.0, *SCENE["belt"][2:])}, TypeError,
         "belt.n_bodies must be an integer, got float"),
        ({"belt": (1.2, True, *SCENE["belt"][2:])}, TypeError,
         "belt.n_bodies must be an integer, got bool"),
        ({"belt": (1.2, 2**40, *SCENE["belt"][2:])}, ValueError,
         f"belt.n_bodies is too large: {2**40}"),
        ({"belt": (*SCENE["belt"][:6], 1j)}, TypeError,
         "belt.bending_damping must be a real number, got complex"),
        ({"contact": None}, TypeError, "contact must be a tuple of 3 numbers, got NoneType"),
        ({"contact": (1.0, None, 1.0)}, TypeError,
         "contact.linear must be a real number, got NoneType"),
        ({"dahl": (1.0,)}, ValueError, "friction must have 2 numbers, got 1"),
        ({"dahl": "ab"}, TypeError, "friction must be a tuple of 2 numbers, got str"),
        ({"dahl": (True, 1e4)}, TypeError, "friction.mu_k must be a real number, got bool"),
        ({"gravity": (0.0, 0.0, 0.0)}, ValueError, "gravity must have shape (2,), got (3,)"),
        ({"gravity": (0.0, -INF)}, ValueError, "gravity[1] must be finite, got -inf"),
        ({"gravity": "down"}, TypeError, "gravity must hold real numbers, got dtype <U4"),
        ({"centers": [0.0, 0.29]}, ValueError, "centers must have shape (n, 2), got (2,)"),
        ({"centers": np.zeros((2, 3))}, ValueError, "centers must have shape (n, 2), got (2, 3)"),
        ({"centers": [(0.0, 0.0), (math.nan, 0.0)]}, ValueError,
         "centers[1, 0] must be finite, got nan"),
        ({"centers": [(0.0, 0.0), (1.0,)]}, ValueError,
         "centers must be an array: its rows differ in length"),
        ({"radii": [0.1]}, ValueError, "radii must have shape (2,), got (1,)"),
        ({"radii": 0.1}, ValueError, "radii must have shape (2,), got ()"),
        ({"radii": np.full((2, 1), 0.1)}, ValueError, "radii must have shape (2,), got (2, 1)"),
        ({"radii": [0.1, math.nan]}, ValueError, "radii[1] must be finite, got nan"),
        ({"radii": None}, TypeError, "radii must hold real numbers, got dtype object"),
        ({"inertias": [0.1, 1j]}, TypeError,
         "inertias must hold real numbers, got dtype complex128"),
        ({"inertias": [True, True]}, TypeError,
         "inertias must hold real numbers, got dtype bool"),
        ({"inertias": ["1", "2"]}, TypeError, "inertias must hold real numbers, got dtype <U1"),
        ({"inertias": [0.1] * 3}, ValueError, "inertias must have shape (2,), got (3,)"),
    ],
)  # fmt: skip
def test_model_refuses(changes, kind, message):
    with refused(kind, message):
        make_model(**changes)


class NoArray:
    def __array__(self, *args, **kwargs):
        raise ZeroDivisionError("mine")


def test_what_an_argument_raises_comes_out():
    with pytest.raises(ZeroDivisionError, match="mine"):
        make_model(radii=NoArray())


def test_shapes_of_many_dimensions_are_cut_short():
    with refused(ValueError, f"radii must have shape (2,), got ({'1, ' * 43}...)"):
        make_model(radii=np.ones((1,) * 60))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"belt": (-1.2, *SCENE["belt"][1:])}, r"belt\.length must be > 0 .* got -1\.2 m"),
        ({"belt": (math.nan, *SCENE["belt"][1:])}, r"belt\.length must be finite and > 0"),
        ({"belt": (1.2, 2, *SCENE["belt"][2:])}, r"belt\.n_bodies must be an integer >= 3"),
        ({"radii": [0.1, 0.0]}, r"pulleys\[1\]\.radius must be > 0"),
        ({"inertias": [-1, 1]}, r"pulleys\[0\]\.inertia must be > 0"),
        ({"contact": (1.0, -1.0, 1.0)}, r"contact\.linear must be >= 0"),
        ({"dahl": (0.0, 1.0)}, r"friction\.mu_k must be > 0"),
        ({"centers": np.zeros((0, 2)), "radii": [], "inertias": []}, "at least one pulley"),
    ],
)
def test_rules_of_the_core_come_through(changes, words):
    with pytest.raises(ValueError, match=words):
        make_model(**changes)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_model_layouts(model, rest, layout):
    scene = {
        name: strange_layouts(SCENE[name])[layout]
        for name in ["centers", "radii", "inertias", "gravity"]
    }
    scene["radii"] = strange_layouts([0.1, 0.1])[layout]
    other = make_model(**scene)
    assert other.info == model.info
    assert same_bits(other.rate(rest, [1, 2]), model.rate(rest, [1, 2]))


# --- states ------------------------------------------------------------------------------------


def test_rate(model, rest):
    state = {**rest, "omega": np.array([0.5, -1.0]), "vx": np.linspace(-1, 1, N_B)}
    rate = model.rate(state, [3.0, 0.0])
    sizes = {"LINKS": N_B, "SLOTS": N_B, "PULLEYS": N_P}
    for name, size in _core.STATE_FIELDS:
        assert rate[name].shape == (sizes[size],) and rate[name].dtype == np.float64
    np.testing.assert_array_equal(rate["theta"], state["omega"])
    np.testing.assert_array_equal(rate["x"], state["vx"])
    more = model.rate(state, [4.0, 0.0])
    assert more["omega"][0] - rate["omega"][0] == pytest.approx(1.0 / 0.01)
    assert more["omega"][1] == rate["omega"][1]
    rate["x"][0] = 7.0
    assert model.rate(state, [3.0, 0.0])["x"][0] == -1.0


def test_rate_refuses(model, rest):
    with refused(ValueError, "torque must have shape (2,), got (3,)"):
        model.rate(rest, [0, 0, 0])
    with refused(ValueError, "torque[0] must be finite, got inf"):
        model.rate(rest, [INF, 0])
    with refused(TypeError, "torque must hold real numbers, got dtype object"):
        model.rate(rest, None)


def users(model):
    """List everything that takes a state."""
    return [
        lambda state: model.rate(state, [0, 0]),
        lambda state: _core.Simulation(model, state, [], 1.0),
        lambda state: _core.Simulation.settle(model, state),
    ]


@pytest.mark.parametrize("name", ["t"] + [name for name, _ in _core.STATE_FIELDS])
def test_states_are_whole(model, rest, name):
    state = {key: value for key, value in rest.items() if key != name}
    for use in users(model):
        with refused(ValueError, f"state lacks '{name}'"):
            use(state)


@pytest.mark.parametrize(("name", "size"), _core.STATE_FIELDS)
def test_states_have_their_shapes(model, rest, name, size):
    n = N_P if size == "PULLEYS" else N_B
    for use in users(model):
        with refused(ValueError, f"state '{name}' must have shape ({n},), got ({n - 1},)"):
            use({**rest, name: np.zeros(n - 1)})
        with refused(ValueError, f"state '{name}' must have shape ({n},), got (1, {n})"):
            use({**rest, name: np.zeros((1, n))})
        with refused(ValueError, f"state '{name}' must have shape ({n},), got ()"):
            use({**rest, name: 0.0})
        with refused(ValueError, f"state '{name}'[1] must be finite, got nan"):
            use({**rest, name: np.where(np.arange(n) == 1, math.nan, 0.0)})
        with refused(TypeError, f"state '{name}' must hold real numbers, got dtype complex128"):
            use({**rest, name: np.zeros(n, complex)})
        with refused(TypeError, f"state '{name}' must hold real numbers, got dtype object"):
            use({**rest, name: None})


def test_state_time(model, rest):
    for use in users(model):
        with refused(ValueError, "state 't' must be finite, got nan"):
            use({**rest, "t": math.nan})
        with refused(TypeError, "state 't' must be a real number, got str"):
            use({**rest, "t": "0"})


@pytest.mark.parametrize("value", [3, [1.0], (1.0,), "state", b"state", np.zeros(3)])
def test_states_are_mappings(model, value):
    for use in users(model):
        got = kind_of(value)
        with refused(TypeError, f"state must be a mapping of arrays by name, got {got}"):
            use(value)


class Lazy:
    """A mapping that is no dict."""

    def __init__(self, values):
        self.values = values

    def __getitem__(self, name):
        if name not in self.values:
            raise LookupError("mine")
        return self.values[name]


def test_states_may_be_any_mapping(model, rest):
    assert same_bits(model.rate(Lazy(rest), [0, 0]), model.rate(rest, [0, 0]))
    with pytest.raises(LookupError, match="mine"):
        model.rate(Lazy({}), [0, 0])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_state_layouts(model, rest, layout):
    state = {
        name: value if name == "t" else strange_layouts(value)[layout]
        for name, value in rest.items()
    }
    copy = make_simulation(model, state).state()
    assert same_bits(copy, rest)
    assert same_bits(model.rate(state, [1, 2]), model.rate(rest, [1, 2]))


@pytest.mark.parametrize("dtype", ["f2", "f4", ">f4", "i1", "i8", ">i2", "u8"])
def test_state_numbers_of_other_widths(model, rest, dtype):
    omega = np.array([2, 3]).astype(dtype)
    state = make_simulation(model, {**rest, "omega": omega}).state()
    assert state["omega"].dtype == np.dtype(float) and state["omega"].tolist() == [2.0, 3.0]


def test_no_cast_loses_digits(model, rest):
    values = np.zeros(N_P, np.longdouble)
    if values.itemsize == 8:  # the same as float64 here, so nothing is lost
        assert not model.rate({**rest, "omega": values}, [0, 0])["theta"].any()
    else:
        got = f"got dtype {values.dtype}"
        with refused(TypeError, f"state 'omega' must hold real numbers, {got}"):
            model.rate({**rest, "omega": values}, [0, 0])


def test_the_state_is_copied(model, rest):
    state = {name: value if name == "t" else value.copy() for name, value in rest.items()}
    simulation = make_simulation(model, state)
    state["x"][:] = math.nan
    before = simulation.state()
    assert before["x"].tobytes() == rest["x"].tobytes() and before["t"] == 0.0
    before["x"][:] = math.nan
    assert simulation.advance(INF) is True
    assert np.isfinite(simulation.state()["x"]).all()


def test_no_friction_no_friction_state(rest):
    model = make_model(dahl=None)
    state = {**rest, "mu": [], "slip": []}
    simulation = make_simulation(model, state)
    samples = simulation.sample([0.01])
    assert simulation.advance(INF) is True
    assert simulation.state()["mu"].shape == (0,) and simulation.state()["slip"].shape == (0,)
    for name in ["mu", "friction", "slip"]:
        assert not samples[name].any()
    assert samples["normal"].max() > 0
    with refused(ValueError, "state 'mu' must have shape (0,), got (24,)"):
        make_simulation(model, rest)


# --- Simulation: arguments ---------------------------------------------------------------------


def test_the_model_must_be_one(model, rest):
    with pytest.raises(TypeError, match=r"must be beltdyn\._core\.Model, not dict"):
        _core.Simulation({}, rest, [], 1.0)
    with pytest.raises(TypeError, match=r"must be beltdyn\._core\.Model, not None"):
        _core.Simulation.settle(None)
    with pytest.raises(TypeError, match="positional"):
        _core.Simulation(model, rest, [], 1.0, "tsit5")
    with pytest.raises(TypeError, match="positional"):
        _core.Simulation.settle(model, None, True)
    with pytest.raises(TypeError, match=r"unexpected keyword|invalid keyword"):
        make_simulation(model, rest, tolerance=1.0)


def test_method(model, rest):
    assert make_simulation(model, rest).method == "tsit5"
    assert make_simulation(model, rest, method="rk4").method == "rk4"
    with pytest.raises(ValueError, match=r'method must be .* got "euler"'):
        make_simulation(model, rest, method="euler")
    with refused(TypeError, "method must be a str, got bytes"):
        make_simulation(model, rest, method=b"rk4")
    with refused(ValueError, "method must not contain a null character"):
        make_simulation(model, rest, method="rk4\0")
    with pytest.raises(UnicodeEncodeError):
        make_simulation(model, rest, method="\udc80")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": 0.0}, "rtol must be > 0"),
        ({"rtol": math.nan}, "rtol must be > 0"),
        ({"step": -1.0}, "step must be finite and >= 0"),
        ({"max_step": INF}, "max_step must be finite and >= 0"),
        ({"max_steps": -1}, "max_steps must be >= 0"),
        ({"t_end": 0.0}, "t_end must be finite and later than the start"),
        ({"t_end": INF}, "^t_end must be finite, got inf$"),
        ({"breakpoints": [math.nan]}, r"^breakpoints\[0\] must be finite, got nan$"),
        ({"breakpoints": 0.1}, r"^breakpoints must have shape \(n,\), got \(\)$"),
    ],
)
def test_options_out_of_range(model, rest, options, words):
    with pytest.raises(ValueError, match=words):
        make_simulation(model, rest, **options)


def test_options_reach_the_core(model, rest):
    simulation = make_simulation(model, rest, method="rk4", step=1e-5)
    assert simulation.advance(INF) is True
    assert simulation.stats["largest_step"] == pytest.approx(1e-5, rel=1e-6)
    simulation = make_simulation(model, rest, max_step=2e-5)
    assert simulation.advance(INF) is True
    assert simulation.stats["largest_step"] <= 2e-5
    stats = [make_simulation(model, rest, rtol=rtol) for rtol in (1e-4, 1e-6)]
    assert all(simulation.advance(INF) for simulation in stats)
    assert stats[1].stats["steps"] > stats[0].stats["steps"]


def test_breakpoints_are_hit(model, rest):
    at = []

    def torque(t, theta, omega):
        at.append(t)
        return [0.0, 0.0]

    simulation = make_simulation(model, rest, [("call", torque)], breakpoints=[0.0123, 0.017])
    assert simulation.advance(INF) is True
    assert {0.0123, 0.017} <= set(at)


def test_stats_and_passes(model, rest):
    simulation = make_simulation(model, rest)
    assert simulation.stats["steps"] == 0
    assert simulation.advance(INF) is True
    stats = simulation.stats
    assert stats["steps"] > 10 and stats["nfev"] > stats["steps"]
    assert type(stats["steps"]) is int and type(stats["smallest_step"]) is float
    assert isinstance(simulation.passes, tuple)
    assert any("friction" in name for name in simulation.passes)
    assert len(make_simulation(make_model(gravity=(0, -9.81)), rest).passes) == (
        len(simulation.passes) + 1
    )


# --- torque terms ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("torque", "kind", "message"),
    [
        (None, TypeError, "torque must be a sequence of terms, got NoneType"),
        (7, TypeError, "torque must be a sequence of terms, got int"),
        ([7], TypeError, "torque[0] must be a tuple that begins with its kind, got 7"),
        ([()], TypeError, "torque[0] must be a tuple that begins with its kind, got ()"),
        ([("viscous", [0, 0]), ["viscous", [0, 0]]], TypeError,
         "torque[1] must be a tuple that begins with its kind, got ['viscous', [0, 0]]"),
        ([(1, 2)], TypeError, "torque[0] must be a tuple that begins with its kind, got (1, 2)"),
        ([("spline", [0, 0])], ValueError,
         "torque[0] must be of kind 'piecewise', 'viscous', 'function' or 'call', got 'spline'"),
        ([("viscous",)], ValueError, "torque[0] of kind 'viscous' must have 1 argument, got 0"),
        ([("call", print, 1)], ValueError, "torque[0] of kind 'call' must have 1 argument, got 2"),
        ([("piecewise", [0])], ValueError,
         "torque[0] of kind 'piecewise' must have 2 arguments, got 1"),
        ([("viscous", [0, 0, 0])], ValueError,
         "torque[0] coefficients must have shape (2,), got (3,)"),
        ([("viscous", [0, math.nan])], ValueError,
         "torque[0] coefficients[1] must be finite, got nan"),
        ([("viscous", None)], TypeError,
         "torque[0] coefficients must hold real numbers, got dtype object"),
        ([("piecewise", 0.0, [[0, 0]])], ValueError,
         "torque[0] times must have shape (n,), got ()"),
        ([("piecewise", [0, INF], [[0, 0]])], ValueError,
         "torque[0] times[1] must be finite, got inf"),
        ([("piecewise", [0, 1], [[0, 0]])], ValueError,
         "torque[0] values must have shape (2, 2), got (1, 2)"),
        ([("piecewise", [0, 1], [0, 0])], ValueError,
         "torque[0] values must have shape (2, 2), got (2,)"),
        ([("piecewise", [0, 1], [[0, 0], [0, INF]])], ValueError,
         "torque[0] values[1, 1] must be finite, got inf"),
        ([("call", None)], TypeError, "torque[0] must hold a callable, got NoneType"),
        ([("function", 0, 0)], ValueError, "torque[0] function address must not be 0"),
        ([("function", -1, 0)], ValueError,
         "torque[0] function address must be an address, got -1"),
        ([("function", 1.0, 0)], TypeError,
         "torque[0] function address must be an integer, got float"),
        ([("function", 1, None)], TypeError,
         "torque[0] user address must be an integer, got NoneType"),
    ],
)  # fmt: skip
def test_torque_refuses(model, rest, torque, kind, message):
    with refused(kind, message):
        make_simulation(model, rest, torque)


def test_rules_for_torque_times(model, rest):
    with pytest.raises(ValueError, match="non-decreasing"):
        make_simulation(model, rest, [("piecewise", [1, 0], [[0, 0], [0, 0]])])
    with pytest.raises(ValueError, match="t must not be empty"):
        make_simulation(model, rest, [("piecewise", [], np.zeros((0, 2)))])


def same_run(model, rest, torque, expected):
    simulation = make_simulation(model, rest, torque)
    assert simulation.advance(INF) is True
    return same_bits(simulation.state(), expected)


@pytest.fixture(scope="module")
def driven(model, rest):
    """Run under TORQUE and return the final state."""
    simulation = make_simulation(model, rest)
    assert simulation.advance(INF) is True
    return simulation.state()


def test_torque_may_be_any_iterable(model, rest, driven):
    assert same_run(model, rest, tuple(TORQUE), driven)
    assert same_run(model, rest, iter(TORQUE), driven)
    assert not same_run(model, rest, TORQUE[:1], driven)
    assert not same_run(model, rest, [], driven)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_torque_layouts(model, rest, driven, layout):
    (_, t, values), (_, coefficients) = TORQUE
    torque = [
        ("piecewise", strange_layouts(t)[layout], strange_layouts(values)[layout]),
        ("viscous", strange_layouts(coefficients)[layout]),
    ]
    assert same_run(model, rest, torque, driven)


def test_the_torque_is_copied(model, rest, driven):
    t, values = np.array([0.0, 0.02]), np.array([[0.0, 0.0], [-50.0, 0.0]])
    coefficients = np.array([0.0, 16.0])
    torque = [("piecewise", t, values), ("viscous", coefficients)]
    simulation = make_simulation(model, rest, torque)
    for array in (t, values, coefficients):
        array[...] = math.nan
    torque.clear()
    assert simulation.advance(INF) is True
    assert simulation.state()["omega"].tobytes() == driven["omega"].tobytes()


def test_compiled_functions(model, rest):
    """Called with the right arguments, user pointer included; the same as the same in Python."""
    numbers = ctypes.POINTER(ctypes.c_double)
    seen = set()

    @ctypes.CFUNCTYPE(None, ctypes.c_double, numbers, numbers, numbers, numbers)
    def compiled(t, theta, omega, torque, user):
        seen.add(user[0])
        torque[0] = -50.0 * t + theta[0]
        torque[1] = -16.0 * omega[1]

    user = ctypes.c_double(42.0)
    address = ctypes.cast(compiled, ctypes.c_void_p).value
    simulation = make_simulation(model, rest, [("function", address, ctypes.addressof(user))])
    assert simulation.advance(INF) is True and seen == {42.0}

    def plain(t, theta, omega):
        return [-50.0 * t + theta[0], -16.0 * omega[1]]

    assert same_run(model, rest, [("call", plain)], simulation.state())


def test_terms_add_up(model, rest):
    half = [("viscous", [0.0, 8.0]), ("call", lambda t, theta, omega: [-50.0 * t / 0.02, 0.0])]
    simulation = make_simulation(model, rest, [*half, ("viscous", [0.0, 8.0])])
    whole = make_simulation(model, rest)
    assert simulation.advance(INF) and whole.advance(INF)
    np.testing.assert_allclose(simulation.state()["omega"], whole.state()["omega"], rtol=1e-6)


# --- what a torque callable may return ---------------------------------------------------------

GOOD = [-1.0, -2.0]


@pytest.mark.parametrize(
    "answer",
    [
        GOOD,
        tuple(GOOD),
        [-1, -2],
        [np.float64(-1), np.float32(-2)],
        [Fraction(-1), np.array(-2.0)],
        np.array(GOOD),
        np.array(GOOD, "f4"),
        np.array(GOOD, ">f8"),
        np.array([-1, -2]),
        np.array([-1.0, 0.0, -2.0, 0.0])[::2],
        memoryview(np.array(GOOD)),
        range(-1, -3, -1),
    ],
    ids=lambda answer: f"{type(answer).__name__}",
)
def test_callables_may_return(model, rest, answer):
    simulation = make_simulation(model, rest, [("call", lambda t, theta, omega: answer)])
    assert simulation.advance(INF) is True
    assert same_run(model, rest, [("piecewise", [0.0], [GOOD])], simulation.state())


MUST = "torque_fn must return 2 torques, one per pulley"


@pytest.mark.parametrize(
    ("answer", "kind", "message"),
    [
        (None, TypeError, f"{MUST}, got NoneType"),
        ("12", TypeError, f"{MUST}, got str"),
        (b"12", TypeError, f"{MUST}, got bytes"),
        (1.0, TypeError, f"{MUST}, got float"),
        (np.float64(1.0), TypeError, f"{MUST}, got numpy.float64"),
        (np.array(1.0), TypeError, f"{MUST}, got numpy.ndarray"),
        ({0: 1.0, 1: 2.0}, TypeError, f"{MUST}, got dict"),
        ({1.0, 2.0}, TypeError, f"{MUST}, got set"),
        ([1.0], ValueError, f"{MUST}, got 1"),
        ((1.0, 2.0, 3.0), ValueError, f"{MUST}, got 3"),
        ([], ValueError, f"{MUST}, got 0"),
        (np.zeros(3), ValueError, f"{MUST}, got 3"),
        (range(1), ValueError, f"{MUST}, got 1"),
        (np.zeros((2, 1)), ValueError, f"{MUST}, got an array of shape (2, 1)"),
        (np.zeros(2, complex), TypeError, f"{MUST}, got an array of dtype complex128"),
        (np.zeros(2, bool), TypeError, f"{MUST}, got an array of dtype bool"),
        (np.array([None, 1.0]), TypeError, f"{MUST}, got an array of dtype object"),
        ([1.0, None], TypeError, f"{MUST}: number 1 must be a real number, got NoneType"),
        ([1j, 1.0], TypeError, f"{MUST}: number 0 must be a real number, got complex"),
        ([1.0, "2"], TypeError, f"{MUST}: number 1 must be a real number, got str"),
        ([True, 1.0], TypeError, f"{MUST}: number 0 must be a real number, got bool"),
        ([1.0, [2.0]], TypeError, f"{MUST}: number 1 must be a real number, got list"),
    ],
    ids=lambda value: repr(value) if isinstance(value, type) else None,
)
def test_callables_must_not_return(model, rest, answer, kind, message):
    simulation = make_simulation(model, rest, [("call", lambda t, theta, omega: answer)])
    with refused(kind, message):
        simulation.advance(INF)
    assert simulation.time == 0.0


def test_one_pulley_is_singular(rest):
    model = make_model(centers=[(0, 0)], radii=[0.2], inertias=[0.01])
    state = {**rest, "theta": [0.0], "omega": [0.0]}
    simulation = make_simulation(model, state, [("call", lambda t, theta, omega: [])])
    with refused(ValueError, "torque_fn must return 1 torque, one per pulley, got 0"):
        simulation.advance(INF)


def test_what_an_answer_raises_comes_out(model, rest):
    for answer in [[0.0, Broken()], NoArray()]:
        torque = [("call", lambda t, theta, omega, answer=answer: answer)]
        with pytest.raises(ZeroDivisionError, match="mine"):
            make_simulation(model, rest, torque).advance(INF)


class Shrinking:
    """A number that takes itself, and the rest, out of the list it stands in."""

    def __init__(self, owner):
        self.owner = owner

    def __float__(self):
        self.owner.clear()
        return 1.0


def test_a_list_that_shrinks_while_it_is_read(model, rest):
    def torque(t, theta, omega):
        answer = []
        answer += [Shrinking(answer), 1.0]
        return answer

    with refused(ValueError, f"{MUST}, got 0"):
        make_simulation(model, rest, [("call", torque)]).advance(INF)


def test_callables_get_plain_read_only_arrays(model, rest):
    state = {**rest, "theta": [0.25, 0.5], "omega": [1.0, 2.0]}
    calls = []

    def torque(t, theta, omega):
        calls.append((t, theta, omega))
        return [0.0, 0.0]

    make_simulation(model, state, [("call", torque)]).advance(0.0)
    t, theta, omega = calls[0]
    assert t == 0.0 and type(t) is float
    assert theta.tolist() == [0.25, 0.5] and omega.tolist() == [1.0, 2.0]
    for array in (theta, omega):
        assert type(array) is np.ndarray and array.dtype == np.dtype(float)
        assert array.shape == (2,) and not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize("value", [math.nan, INF, -INF], ids=["nan", "inf", "-inf"])
def test_torque_that_is_not_finite(model, rest, value):
    def torque(t, theta, omega):
        return [0.0, value if t > 0.01 else 0.0]

    simulation = make_simulation(model, rest, [("call", torque)])
    with pytest.raises(SimulationError, match="torque on pulley 1") as caught:
        simulation.advance(INF)
    error = caught.value
    assert error.symbol == "BD_ERR_TORQUE_VALUE" and error.pulley == 1 and error.body == -1
    assert error.t > 0.01 and error.field == "torque" and error.result is None
    assert repr(error.value) == repr(value)
    assert 0.0 < simulation.time <= 0.01
    with pytest.raises(SimulationError) as again:
        simulation.advance(INF)
    assert str(again.value) == str(error) and again.value is not error


# --- sampling and running ----------------------------------------------------------------------


def test_sample_shapes(model, rest):
    simulation = make_simulation(model, rest)
    samples = simulation.sample([0.0, 0.01, 0.02])
    widths = {"LINKS": N_B, "PULLEYS": N_P, "ENERGY": len(_core.ENERGY_TERMS)}
    for name, _, size, *_ in _core.OUTPUTS:
        assert samples[name].shape == (3, widths[size]) and samples[name].dtype == np.float64
        assert np.isnan(samples[name]).all() and samples[name].flags.c_contiguous
    assert samples["pulley"].dtype == np.int32 and samples["pulley"].shape == (3, N_B)
    assert (samples["pulley"] == -1).all() and simulation.samples == 0
    assert simulation.advance(INF) is True and simulation.samples == 3
    for name, *_ in _core.OUTPUTS:
        assert np.isfinite(samples[name]).all(), name
    assert set(samples["pulley"].ravel()) == {-1, 0, 1}
    final = simulation.state()
    for name in ["x", "y", "phi", "vx", "vy", "vphi", "theta", "omega"]:
        np.testing.assert_array_equal(samples[name][-1], final[name])
        np.testing.assert_array_equal(samples[name][0], rest[name])


def test_rows_come_one_by_one(model, rest):
    simulation = make_simulation(model, rest, max_steps=20)
    samples = simulation.sample(np.linspace(0.0, 0.02, 201))
    with pytest.raises(SimulationError, match="max_steps"):
        simulation.advance(INF)
    done = simulation.samples
    assert 0 < done < 201
    assert np.isfinite(samples["x"][:done]).all() and np.isnan(samples["x"][done:]).all()
    assert (samples["pulley"][done:] == -1).all()


def test_no_ledger_no_energy(model, rest):
    simulation = make_simulation(model, rest, ledger=False)
    samples = simulation.sample([0.0])
    assert "energy" not in samples and "x" in samples
    assert simulation.advance(INF) is True


@pytest.mark.parametrize(
    ("t", "kind", "message"),
    [
        (0.0, ValueError, "t_eval must have shape (n,), got ()"),
        ([[0.0]], ValueError, "t_eval must have shape (n,), got (1, 1)"),
        ([0.0, math.nan], ValueError, "t_eval[1] must be finite, got nan"),
        (None, TypeError, "t_eval must hold real numbers, got dtype object"),
        ([1j], TypeError, "t_eval must hold real numbers, got dtype complex128"),
    ],
)
def test_sample_refuses(model, rest, t, kind, message):
    simulation = make_simulation(model, rest)
    with refused(kind, message):
        simulation.sample(t)
    assert simulation.sample([])["theta"].shape == (0, N_P)


@pytest.mark.parametrize("t", [[-0.1], [0.0, 0.03], [0.01, 0.0]])
def test_sample_times_within_the_run(model, rest, t):
    simulation = make_simulation(model, rest)
    with pytest.raises(ValueError, match="non-decreasing and within"):
        simulation.sample(t)
    samples = simulation.sample([0.02])
    assert simulation.advance(INF) is True and np.isfinite(samples["x"]).all()


def test_sample_times_are_set_once_and_early(model, rest):
    simulation = make_simulation(model, rest)
    simulation.sample([0.0])
    with refused(RuntimeError, "the sample times are set already"):
        simulation.sample([0.0])
    simulation = make_simulation(model, rest)
    simulation.advance(0.0)
    with refused(RuntimeError, "sample times must be set before the run"):
        simulation.sample([0.0])


def test_the_sample_times_are_copied(model, rest):
    t = np.array([0.01, 0.02])
    simulation = make_simulation(model, rest)
    samples = simulation.sample(t)
    t[:] = math.nan
    assert simulation.advance(INF) is True and np.isfinite(samples["x"]).all()


def test_chunks_do_not_matter(model, rest, driven):
    simulation = make_simulation(model, rest)
    times = [simulation.time]
    while not simulation.advance(0):
        times.append(simulation.time)
    assert len(times) > 3 and times == sorted(set(times)) and simulation.time == 0.02
    assert same_bits(simulation.state(), driven)
    assert simulation.advance(0) is True and simulation.advance(INF) is True


def test_advance_returns_in_between(model, rest):
    simulation = make_simulation(model, rest, t_end=1e5)
    assert simulation.advance(0.02) is False
    assert 0.0 < simulation.time < 1e5


@pytest.mark.parametrize("value", [-1.0, math.nan, -INF])
def test_seconds_must_be_positive(model, rest, value):
    with refused(ValueError, f"seconds must be >= 0, got {value!r}"):
        make_simulation(model, rest).advance(value)


# --- settling ----------------------------------------------------------------------------------


def test_settle_comes_to_rest(rest):
    for name in ["vx", "vy", "vphi", "omega"]:
        assert not rest[name].any()
    assert rest["t"] == 0.0 and rest["x"].shape == (N_B,)


def test_settle_from_a_state(model, rest):
    settling = _core.Simulation.settle(model, rest, tolerance=1e-4)
    assert isinstance(settling, _core.Simulation)
    assert settling.advance(INF) is True
    np.testing.assert_allclose(settling.state()["x"], rest["x"], atol=1e-5)


def test_settle_with_moving_centres(model):
    offset = np.array([[0.0, 0.0], [-0.02, 0.0]])
    settling = _core.Simulation.settle(
        model, offset=offset, move_time=0.05, friction=True, free_pulleys=True, tolerance=1e-3
    )
    offset[:] = math.nan
    assert settling.passes[0] == "moving centres"
    assert settling.advance(INF) is True
    assert settling.state()["mu"].any()


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"offset": [0.0, 0.0]}, ValueError, "offset must have shape (2, 2), got (2,)"),
        ({"offset": [[0, 0]] * 3}, ValueError, "offset must have shape (2, 2), got (3, 2)"),
        ({"offset": [[0, 0], [0, math.nan]]}, ValueError, "offset[1, 1] must be finite, got nan"),
        ({"offset": "near"}, TypeError, "offset must hold real numbers, got dtype <U4"),
    ],
)
def test_settle_refuses(model, options, kind, message):
    with refused(kind, message):
        _core.Simulation.settle(model, **options)


def test_settle_rules_of_the_core(model):
    with pytest.raises(ValueError, match="tolerance must be > 0"):
        _core.Simulation.settle(model, tolerance=0.0)
    with pytest.raises(ValueError, match="max_time must be finite and >= 0"):
        _core.Simulation.settle(model, max_time=-1.0)
    with pytest.raises(ValueError, match="overlap"):
        _core.Simulation.settle(make_model(centers=[(0, 0), (0.1, 0)]))
    with pytest.raises(RuntimeError, match="sample times"):
        _core.Simulation.settle(model).sample([0.0])


def test_settle_that_does_not_end(model):
    settling = _core.Simulation.settle(model, tolerance=1e-9, max_time=1e-3)
    with pytest.raises(SimulationError, match="did not come to rest") as caught:
        settling.advance(INF)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.value > 0
