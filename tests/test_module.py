"""The binding by itself: what it takes, what it refuses and in which words, what it returns.

Here its tables, Dahl's functions, scalars and models; the rest is in test_module_*.py.
"""

import inspect
import math
import re
from fractions import Fraction

import numpy as np
import pytest
from module_common import (
    INF,
    LAYOUTS,
    N_B,
    N_P,
    SCENE,
    TORQUE,
    Broken,
    NoArray,
    kind_of,
    make_model,
    make_simulation,
    refused,
    same_bits,
    strange_layouts,
)

from beltdyn import _core
from beltdyn.errors import SimulationError

# --- the module --------------------------------------------------------------------------------


def test_tables_are_what_the_objects_use(model, rest):
    simulation = make_simulation(model, rest)
    state_names = [name for name, *_ in _core.STATE_FIELDS]
    assert list(simulation.state()) == ["t", *state_names]
    assert list(model.rate(rest, [0, 0])) == state_names
    outputs = [name for name, _, size, *_ in _core.OUTPUTS if size != "MOUNTS"]
    assert list(simulation.sample([0.0])) == [*outputs, "pulley"]
    assert list(simulation.stats) == [name for name, _ in _core.STATS]
    assert {size for _, size, *_ in _core.STATE_FIELDS} == {
        "LINKS", "SLOTS", "STATES", "PULLEYS", "MOUNTS",
    }  # fmt: skip
    sizes = {"LINKS", "FRICTION", "PULLEYS", "PLANE", "MOUNTS", "ENERGY"}
    assert {row[2] for row in _core.OUTPUTS} == sizes
    assert [row[0] for row in _core.RULES] == [
        "POSITIVE",
        "POSITIVES",
        "NONNEGATIVE",
        "FINITE",
        "LINKS",
        "FLAG",
    ]
    assert {row[2] for row in _core.PARAMETERS} <= {row[0] for row in _core.RULES}


def test_tables_hold_their_columns():
    for table, width in [
        (_core.PARAMETERS, 5),
        (_core.STATE_FIELDS, 4),
        (_core.OUTPUTS, 5),
        (_core.ENERGY_TERMS, 3),
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
    assert list(inspect.signature(_core.Model).parameters) == [
        *SCENE,
        "drag",
        "pulley_friction",
        "mesh",
        "outside",
        "names",
        "mounts",
        "model",
    ]
    keyword = [
        name
        for name, parameter in inspect.signature(_core.Simulation).parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY
    ]
    assert keyword == [
        "method", "rtol", "step", "max_step", "max_steps", "ledger", "breakpoints",
        "torque_interval", "guards", "motion",
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
    for name in ["move_time", "shift", "tolerance", "max_time"]:
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
    assert info["n_slots"] == 1 and make_model(friction=None).info["n_slots"] == 0
    assert info["n_states"] == 1 and make_model(friction=None).info["n_states"] == 0
    assert info["link_length"] == 1.2 / N_B
    assert info["path_length"] == pytest.approx(0.58 + 0.2 * math.pi, rel=1e-14)
    integers = {"n_bodies", "n_pulleys", "n_mounts", "n_slots", "n_states", "winding"}
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
        ({"contact": None}, TypeError, "contact must be a tuple of 5 numbers, got NoneType"),
        ({"contact": (1.0, None, 1.0, 0, 0.0)}, TypeError,
         "contact.linear must be a real number, got NoneType"),
        ({"friction": ("dahl", (1.0,))}, ValueError, "friction must have 4 numbers, got 1"),
        ({"friction": ("glue", ())}, ValueError, "friction: there is no friction law 'glue'"),
        ({"friction": "ab"}, TypeError,
         "friction must be a tuple (name of the law, its numbers), got 'ab'"),
        ({"pulley_friction": [None]}, ValueError,
         "friction must have one entry for each of 2 pulleys, got 1"),
        ({"pulley_friction": [None, ("dahl", (1.0, -1.0, 0.0, 0.0))]}, ValueError,
         "pulleys[1].friction.sigma must be > 0 (Dahl stiffness, the slope dmu/ds at mu = 0 "
         "(2.9)), got -1 1/m"),
        ({"friction": ("dahl", (True, 1e4, 0.0, 0.0))}, TypeError,
         "friction.mu_k must be a real number, got bool"),
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
        (
            {"belt": (1.2, 2, *SCENE["belt"][2:])},
            r"belt\.n_bodies must be an integer from 3 to 1000000 "
            r"\(number of rigid links, n_b\), got 2$",
        ),
        ({"radii": [0.1, 0.0]}, r"pulleys\[1\]\.radius must be > 0"),
        ({"inertias": [-1, 1]}, r"pulleys\[0\]\.inertia must be > 0"),
        ({"contact": (1.0, -1.0, 1.0, 0, 0.0)}, r"contact\.linear must be >= 0"),
        ({"contact": (1.0, 1.0, 1.0, 2, 0.0)}, r"contact\.compensate must be 0 or 1 .*, got 2$"),
        ({"friction": ("dahl", (0.0, 1.0, 0.0, 0.0))}, r"friction\.mu_k must be > 0"),
        (
            {"centers": np.zeros((0, 2)), "radii": [], "inertias": []},
            "pulleys must hold 1 to 1000 pulleys, got 0",
        ),
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
