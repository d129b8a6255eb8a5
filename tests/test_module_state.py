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


#: What a drive without mounts has; what it has none of may be left out.
FIELDS = [row[:2] for row in _core.STATE_FIELDS if row[1] != "MOUNTS"]


@pytest.mark.parametrize("name", ["t"] + [name for name, _ in FIELDS])
def test_states_are_whole(model, rest, name):
    state = {key: value for key, value in rest.items() if key != name}
    for use in users(model):
        with refused(ValueError, f"state lacks '{name}'"):
            use(state)


@pytest.mark.parametrize(("name", "size"), FIELDS)
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
    model = make_model(friction=None)
    state = {**rest, "mu": [], "slip": []}
    simulation = make_simulation(model, state)
    samples = simulation.sample([0.01])
    assert simulation.advance(INF) is True
    assert simulation.state()["mu"].shape == (0,) and simulation.state()["slip"].shape == (0,)
    assert not {"mu", "friction", "slip"} & samples.keys()
    assert samples["normal"].max() > 0
    with refused(ValueError, "state 'mu' must have shape (0,), got (24,)"):
        make_simulation(model, rest)
