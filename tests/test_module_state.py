"""States as the binding takes and returns them."""

import math

import numpy as np
import pytest
from module_common import (
    INF,
    LAYOUTS,
    N_B,
    N_P,
    kind_of,
    make_model,
    make_simulation,
    refused,
    same_bits,
    strange_layouts,
)

from beltdyn import _core

V, T = ValueError, TypeError


def test_rate(model, rest):
    state = {**rest, "omega": np.array([0.5, -1.0]), "vx": np.linspace(-1, 1, N_B)}
    rate = model.rate(state, [3.0, 0.0])
    sizes = {"LINKS": N_B, "SLOTS": N_B, "STATES": N_B, "PULLEYS": N_P, "MOUNTS": 0}
    for name, size, *_ in _core.STATE_FIELDS:
        assert rate[name].shape == (sizes[size],) and rate[name].dtype == np.float64
    np.testing.assert_array_equal(rate["theta"], state["omega"])
    np.testing.assert_array_equal(rate["x"], state["vx"])
    more = model.rate(state, [4.0, 0.0])
    assert more["omega"][0] - rate["omega"][0] == pytest.approx(1.0 / 0.01)
    assert more["omega"][1] == rate["omega"][1]
    rate["x"][0] = 7.0
    assert model.rate(state, [3.0, 0.0])["x"][0] == -1.0
    for torque, kind, message in (
        ([0, 0, 0], V, "torque must have shape (2,), got (3,)"),
        ([INF, 0], V, "torque[0] must be finite, got inf"),
        (None, T, "torque must hold real numbers, got dtype object"),
    ):
        with refused(kind, message):
            model.rate(rest, torque)


def refused_by_all(model, state, kind, message):
    """By everything that takes a state."""
    for use in (
        lambda: model.rate(state, [0, 0]),
        lambda: _core.Simulation(model, state, [], 1.0),
        lambda: _core.Simulation.settle(model, state),
    ):
        with refused(kind, message):
            use()


#: What a drive without mounts has; what it has none of may be left out.
FIELDS = [row[:2] for row in _core.STATE_FIELDS if row[1] != "MOUNTS"]


@pytest.mark.parametrize(("name", "size"), FIELDS)
def test_states_are_whole_and_have_their_shapes(model, rest, name, size):
    n = N_P if size == "PULLEYS" else N_B
    lacking = {key: value for key, value in rest.items() if key != name}
    refused_by_all(model, lacking, V, f"state lacks '{name}'")
    nan_at_1 = np.where(np.arange(n) == 1, math.nan, 0.0)
    for value, kind, message in (
        (np.zeros(n - 1), V, f" must have shape ({n},), got ({n - 1},)"),
        (np.zeros((1, n)), V, f" must have shape ({n},), got (1, {n})"),
        (0.0, V, f" must have shape ({n},), got ()"),
        (nan_at_1, V, "[1] must be finite, got nan"),
        (np.zeros(n, complex), T, " must hold real numbers, got dtype complex128"),
        (None, T, " must hold real numbers, got dtype object"),
    ):
        refused_by_all(model, {**rest, name: value}, kind, f"state '{name}'{message}")


def test_state_time(model, rest):
    without = {key: value for key, value in rest.items() if key != "t"}
    refused_by_all(model, without, V, "state lacks 't'")
    refused_by_all(model, {**rest, "t": math.nan}, V, "state 't' must be finite, got nan")
    refused_by_all(model, {**rest, "t": "0"}, T, "state 't' must be a real number, got str")


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
    for value in [3, [1.0], (1.0,), "state", b"state", np.zeros(3)]:
        got = f"state must be a mapping of arrays by name, got {kind_of(value)}"
        refused_by_all(model, value, T, got)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_state_layouts(model, rest, layout):
    state = {
        name: value if name == "t" else strange_layouts(value)[layout]
        for name, value in rest.items()
    }
    assert same_bits(make_simulation(model, state).state(), rest)
    assert same_bits(model.rate(state, [1, 2]), model.rate(rest, [1, 2]))


def test_state_numbers_of_other_widths_but_none_that_would_lose_digits(model, rest):
    for dtype in ["f2", "f4", ">f4", "i1", "i8", ">i2", "u8"]:
        omega = np.array([2, 3]).astype(dtype)
        taken = make_simulation(model, {**rest, "omega": omega}).state()["omega"]
        assert taken.dtype == np.dtype(float) and taken.tolist() == [2.0, 3.0], dtype
    values = np.zeros(N_P, np.longdouble)
    if values.itemsize == 8:  # the same as float64 here, so nothing is lost
        assert not model.rate({**rest, "omega": values}, [0, 0])["theta"].any()
    else:
        got = f"got dtype {values.dtype}"
        with refused(T, f"state 'omega' must hold real numbers, {got}"):
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
    model = make_model(friction=None)
    simulation = make_simulation(model, {**rest, "mu": [], "slip": []})
    samples = simulation.sample([0.01])
    assert simulation.advance(INF) is True
    assert simulation.state()["mu"].shape == (0,) and simulation.state()["slip"].shape == (0,)
    assert not {"mu", "friction", "slip"} & samples.keys()
    assert samples["normal"].max() > 0
    with refused(V, "state 'mu' must have shape (0,), got (24,)"):
        make_simulation(model, rest)
