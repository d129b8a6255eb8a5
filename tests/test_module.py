"""The binding by itself: what it takes, what it refuses and in which words, what it returns.

Here its tables, scalars and models; the rest is in test_module_run.py.
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
    Broken,
    kind_of,
    make_model,
    make_simulation,
    refused,
    same_bits,
    strange_layouts,
)

from beltdyn import _core
from beltdyn.result.errors import SimulationError

V, T = ValueError, TypeError


def test_tables_are_what_the_objects_use(model, rest):
    for name, width in {
        "PARAMETERS": 5, "STATE_FIELDS": 4, "OUTPUTS": 5, "ENERGY_TERMS": 3, "STATS": 2,
    }.items():  # fmt: skip
        table = getattr(_core, name)
        assert isinstance(table, tuple) and len(table) > 0
        assert all(isinstance(row, tuple) and len(row) == width for row in table), name
        assert all(isinstance(cell, str) and cell for row in table for cell in row), name
    simulation = make_simulation(model, rest)
    state_names = [name for name, *_ in _core.STATE_FIELDS]
    assert list(simulation.state()) == ["t", *state_names]
    assert list(model.rate(rest, [0, 0])) == state_names
    of_some = ("MOUNTS", "COUPLINGS", "MODES", "ALONG", "FLOW")
    outputs = [name for name, _, size, *_ in _core.OUTPUTS if size not in of_some]
    assert list(simulation.sample([0.0])) == [*outputs, "pulley"]
    assert list(simulation.stats) == [name for name, _ in _core.STATS]
    assert {row[2] for row in _core.PARAMETERS} <= {row[0] for row in _core.RULES}
    names = [name for group, name, *_ in _core.PARAMETERS if group == "belt"]
    assert names[:4] == ["length", "n_bodies", "linear_density", "axial_stiffness"]
    assert len(names) == len(SCENE["belt"])
    symbols, codes, kinds, texts = zip(*_core.ERRORS, strict=True)
    assert all(symbol.startswith("BD_ERR_") for symbol in symbols) and all(texts)
    assert all(code < 0 for code in codes) and len(set(codes)) == len(codes)
    assert set(kinds) == {"VALUE", "MEMORY", "USE", "CALL", "RUN"}


def test_constants_and_the_kernel_level_of_the_environment(monkeypatch):
    assert _core.MAX_STRAIN == 0.25
    assert re.fullmatch(r"\d+\.\d+\.\d+", _core.__version__)
    assert _core.kernel_level() in {"avx512", "avx2", "baseline"}
    monkeypatch.setenv("BELTDYN_KERNELS", "baseline")
    assert _core.kernel_level() == "baseline"


def test_signatures_and_docstrings_can_be_read():
    others = ["drag", "pulley_friction", "mesh", "outside", "names", "mounts", "model",
              "couplings"]  # fmt: skip
    assert list(inspect.signature(_core.Model).parameters) == [*SCENE, *others]
    parameters = inspect.signature(_core.Simulation).parameters.values()
    assert [one.name for one in parameters] == [
        "model", "state", "torque", "t_end", "method", "rtol", "step", "max_step", "max_steps",
        "ledger", "breakpoints", "torque_interval", "guards", "motion",
    ]  # fmt: skip
    settle = inspect.signature(_core.Simulation.settle).parameters
    assert list(settle)[:2] == ["model", "state"] and settle["state"].default is None
    things = [_core, _core.kernel_level, _core.friction_law, _core.belt_line]
    for kind in (_core.Model, _core.Simulation):
        things += [kind, *(getattr(kind, name) for name in dir(kind) if name[0] != "_")]
    assert [thing for thing in things if len(thing.__doc__ or "") <= 20] == []


def test_types_are_closed(model):
    for kind in (_core.Model, _core.Simulation):
        with pytest.raises(T, match="not an acceptable base type"):
            type("Derived", (kind,), {})
        with pytest.raises(T, match="immutable type"):
            kind.advance = None
        with pytest.raises(T, match="missing required argument"):
            kind.__new__(kind)
        assert kind.__module__ == "beltdyn._core"
    before = model.info
    model.__init__()  # a model cannot be made twice
    assert model.info == before
    for name in ("info", "other"):
        with pytest.raises(AttributeError):
            setattr(model, name, {})
    for name in SCENE:
        with pytest.raises(T, match=f"missing required argument '{name}'"):
            _core.Model(**{key: value for key, value in SCENE.items() if key != name})


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"z": [[0.0, 1.0]]}, V, "z must have shape (n,), got (1, 2)"),
        ({"v": [INF]}, V, "v[0] must be finite, got inf"),
        ({"link_length": "0"}, T, "link_length must be a real number, got str"),
        ({"link_length": Broken()}, ZeroDivisionError, "mine"),
    ],
)
def test_a_law_refuses(changes, kind, message):
    one = {
        "friction": SCENE["friction"],
        "link_length": 0.1,
        "z": [0.0],
        "v": [0.0],
        "normal": [1.0],
    }
    with refused(kind, message):
        _core.friction_law(**one | changes)


def test_no_argument_overflows():
    """Numbers beyond what C holds are bad values as others are."""
    one, law = [0.0], SCENE["friction"]
    with refused(V, "length is too large for a float64"):
        _core.check_parameter("belt", "length", "belt", 10**400)
    with refused(V, f"element is too large: {2**70}"):
        _core.friction_law(law, 0.1, one, one, one, 2**70)
    for element in (1, -1, 2**40, -(2**40)):
        with refused(V, "element must lie in 0 to 0, got ..."):
            _core.friction_law(law, 0.1, one, one, one, element)


def test_real_numbers_are_taken(model, rest):
    kinds = (int, float, np.float64, np.float32, np.float16, np.int8, np.uint64, np.longdouble)
    for value in [*(kind(1) for kind in kinds), np.array(1.0), np.array(1), Fraction(2, 2)]:
        assert same_bits(model.set_going(rest, value), model.set_going(rest, 1.0)), type(value)


@pytest.mark.parametrize(
    "value",
    [True, np.True_, "1", b"1", None, 1j, np.complex128(1), [1.0], np.array([1.0]),
     np.array(True), np.array(1j), np.array("1"), np.array(None)],
    ids=lambda value: f"{type(value).__name__} {value!r}",
)  # fmt: skip
def test_other_things_are_no_numbers(model, rest, value):
    got = f"must be a real number, got {kind_of(value)}"
    with refused(T, f"seconds {got}"):
        make_simulation(model, rest).advance(value)
    for name in ["t_end", "rtol", "step", "max_step"]:
        with refused(T, f"{name} {got}"):
            make_simulation(model, rest, **{name: value})
    for name in ["move_time", "shift", "tolerance", "max_time"]:
        with refused(T, f"{name} {got}"):
            _core.Simulation.settle(model, **{name: value})


def test_integers_are_integers_of_any_width_and_flags_are_bools(model, rest):
    for value in [1.0, "1", True, np.True_, None, np.float64(3), np.array(3.0)]:
        with refused(T, "max_steps must be an integer, got ..."):
            make_simulation(model, rest, max_steps=value)
    for value, what in ((2**70, "large"), (-(2**70), "small")):
        with refused(V, f"max_steps is too {what}: {value}"):
            make_simulation(model, rest, max_steps=value)
    for value in [7, np.int16(7), np.uint8(7), np.array(7)]:
        simulation = make_simulation(model, rest, max_steps=value)
        with pytest.raises(SimulationError) as caught:
            simulation.advance(INF)
        assert caught.value.symbol == "BD_ERR_MAX_STEPS" and simulation.stats["steps"] == 7
    for value in [0, 1, "yes", None, [], 1.0]:
        got = f"must be True or False, got {type(value).__name__}"
        with refused(T, f"ledger {got}"):
            make_simulation(model, rest, ledger=value)
        for name in ["friction", "free_pulleys"]:
            with refused(T, f"{name} {got}"):
                _core.Simulation.settle(model, **{name: value})


def test_model_info(model):
    info, without = model.info, make_model(friction=None).info
    assert info["n_bodies"] == N_B and info["n_pulleys"] == N_P and info["winding"] == -1
    assert info["n_slots"] == 1 and without["n_slots"] == 0
    assert info["n_states"] == 1 and without["n_states"] == 0
    assert info["link_length"] == 1.2 / N_B
    assert info["path_length"] == pytest.approx(0.58 + 0.2 * math.pi, rel=1e-14)
    integers = {
        "n_bodies",
        "n_pulleys",
        "n_mounts",
        "n_couplings",
        "n_slots",
        "n_states",
        "n_modes",
        "n_along",
        "winding",
    }
    assert {name for name, value in info.items() if isinstance(value, int)} == integers
    assert all(type(value) in (int, float) for value in info.values())
    info.clear()
    assert model.info["n_bodies"] == N_B


def belt(place, value):
    """The belt with another number in this place."""
    return {"belt": (*SCENE["belt"][:place], value, *SCENE["belt"][place + 1 :])}


def dahl(*numbers):
    return ("dahl", numbers)


REAL = "must hold real numbers, got dtype"


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"belt": [1.2] * 7}, T, "belt must be a tuple of 7 numbers, got list"),
        ({"belt": (1.2, 24)}, V, "belt must have 7 numbers, got 2"),
        (belt(0, "1.2"), T, "belt.length must be a real number, got str"),
        (belt(1, 24.0), T, "belt.n_bodies must be an integer, got float"),
        (belt(1, 2**40), V, f"belt.n_bodies is too large: {2**40}"),
        (belt(6, 1j), T, "belt.bending_damping must be a real number, got complex"),
        ({"contact": None}, T, "contact must be a tuple of 5 numbers, got NoneType"),
        ({"friction": dahl(1.0)}, V, "friction must have 4 numbers, got 1"),
        ({"friction": ("glue", ())}, V, "friction: there is no friction law 'glue'"),
        ({"friction": "ab"}, T,
         "friction must be a tuple (name of the law, its numbers), got 'ab'"),
        ({"pulley_friction": [None]}, V,
         "friction must have one entry for each of 2 pulleys, got 1"),
        ({"pulley_friction": [None, dahl(1.0, -1.0, 0.0, 0.0)]}, V,
         "pulleys[1].friction.sigma must be > 0 (Dahl stiffness, the slope dmu/ds at mu = 0 "
         "(2.9)), got -1 1/m"),
        ({"gravity": (0.0, 0.0, 0.0)}, V, "gravity must have shape (2,), got (3,)"),
        ({"gravity": (0.0, -INF)}, V, "gravity[1] must be finite, got -inf"),
        ({"centers": np.zeros((2, 3))}, V, "centers must have shape (n, 2), got (2, 3)"),
        ({"centers": [(0.0, 0.0), (math.nan, 0.0)]}, V, "centers[1, 0] must be finite, got nan"),
        ({"centers": [(0.0, 0.0), (1.0,)]}, V,
         "centers must be an array: its rows differ in length"),
        ({"radii": [0.1]}, V, "radii must have shape (2,), got (1,)"),
        ({"radii": np.ones((1,) * 60)}, V, f"radii must have shape (2,), got ({'1, ' * 43}...)"),
        ({"radii": None}, T, f"radii {REAL} object"),
        ({"radii": Broken()}, ZeroDivisionError, "mine"),
        ({"inertias": [0.1, 1j]}, T, f"inertias {REAL} complex128"),
        ({"inertias": [True, True]}, T, f"inertias {REAL} bool"),
        ({"inertias": ["1", "2"]}, T, f"inertias {REAL} <U1"),
        ({"inertias": [0.1] * 3}, V, "inertias must have shape (2,), got (3,)"),
        # rules of the core
        (belt(0, -1.2), V, "belt.length must be > 0 ..."),
        (belt(0, math.nan), V, "belt.length must be finite and > 0 ..."),
        (belt(1, 2), V, "belt.n_bodies must be an integer from 3 to 1000000 "
         "(number of rigid links, n_b), got 2"),
        ({"radii": [0.1, 0.0]}, V, "pulleys[1].radius must be > 0 ..."),
        ({"inertias": [-1, 1]}, V, "pulleys[0].inertia must be > 0 ..."),
        ({"contact": (1.0, -1.0, 1.0, 0, 0.0)}, V, "contact.linear must be >= 0 ..."),
        ({"contact": (1.0, 1.0, 1.0, 2, 0.0)}, V, "contact.compensate must be 0 or 1 ..."),
        ({"friction": dahl(0.0, 1.0, 0.0, 0.0)}, V, "friction.mu_k must be > 0 ..."),
        ({"centers": np.zeros((0, 2)), "radii": [], "inertias": []}, V,
         "pulleys must hold 1 to 1000 pulleys, got 0"),
    ],
)  # fmt: skip
def test_model_refuses(changes, kind, message):
    with refused(kind, message):
        make_model(**changes)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_model_layouts(model, rest, layout):
    names = ["centers", "radii", "inertias", "gravity"]
    other = make_model(**{name: strange_layouts(SCENE[name])[layout] for name in names})
    assert other.info == model.info
    assert same_bits(other.rate(rest, [1, 2]), model.rate(rest, [1, 2]))


def test_depth_is_the_root_of_its_equation(model):
    """c1 p^2 + c2 p = (T lambda - rho v^2) / R, to rounding; 0 where nothing presses."""
    (_, _, rho, stiffness, *_), (c1, c2, *_) = SCENE["belt"], SCENE["contact"]
    radius, tension, speed = (np.array([a, [0.1, 0.2]]) for a in ([0.1, 0.3], [9.0, 8e3], [5, 0.0]))
    tension[1], speed[1] = [300.0, 400.0], [9.0, 90.0]
    pressed = (tension * (1.0 + tension / stiffness) - rho * speed**2) / radius
    depth = model.depth(radius, tension, speed)
    assert depth[1, 1] == 0.0 and pressed[1, 1] < 0.0
    np.testing.assert_allclose(c1 * depth**2 + c2 * depth, np.maximum(pressed, 0.0), rtol=1e-14)
    with refused(V, "tension must have shape (2, 2), got (2,)"):
        model.depth(radius, tension[0], speed)
    with refused(V, "speed[0, 1] must be finite, got inf"):
        model.depth(radius, tension, [[0.0, INF], [0.0, 0.0]])
    with refused(V, "radius must be > 0 m"):
        model.depth(0.0, 1.0, 0.0)


def test_torques_and_prescribed_speeds_at_a_time(model):
    """Of a pulley that is prescribed none; an angle is differentiated towards later times alone."""
    seen = []

    def angle(t):
        seen.append(t)
        return 3.0 * t + 0.5 * t * t

    terms = [("viscous", [1.0, 2.0]), ("piecewise", [0.0, 2.0], [[0.0, 0.0], [4.0, 0.0]])]
    torque, omega = model.torques(terms, [(1, "angle", angle)], 1.0, 1.0 + 6e-6, [0, 0], [5, 7])
    assert torque.tolist() == [2.0 - 5.0, 0.0]
    # differences over 1 us of an angle of 3 keep 1e-9 of a speed of 4
    assert omega[0] == 5.0 and omega[1] == pytest.approx(4.0, rel=1e-8)
    assert min(seen) == 1.0 and max(seen) <= 1.0 + 6e-6
    torque, omega = model.torques(terms, (), 0.0, 0.0, [0, 0], [5, 7])
    assert torque.tolist() == [-5.0, -14.0] and omega.tolist() == [5.0, 7.0]
    with refused(V, "omega must have shape (2,), got (1,)"):
        model.torques(terms, (), 0.0, 0.0, [0, 0], [5])
    with pytest.raises(ZeroDivisionError):
        model.torques([("call", lambda t, theta, omega: 1 / 0)], (), 0.0, 0.0, [0, 0], [5, 7])
