"""Arrays from users: masks are not lost, what is kept cannot be changed, anything else is named."""

from __future__ import annotations

import copy
import pickle
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from fuzzed import EXAMPLES, fuzz
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from module_common import SCENE

import beltdyn as bd
from beltdyn import _core, checks

HIDDEN = "must not hold masked values"


def masked(values: Any, mask: Any = None) -> Any:
    """Hide the last value."""
    array = np.ma.array(values, dtype=float)
    array[..., -1] = np.ma.masked if mask is None else array[..., -1]
    return array


class GivesMasked:
    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return masked([1.0, 2.0, 3.0])


class Rows(list[Any]):
    pass


HIDING = [
    masked([1.0, 2.0, 3.0]),
    [1.0, 2.0, np.ma.masked],
    (1.0, 2.0, np.ma.array(3.0, mask=True)),
    Rows([1.0, np.ma.masked, 3.0]),
]
STATE: dict[str, Any] = {"x": [0, 1, 2], "y": [0, 0, 0], "phi": [0, 0, 0], "theta": [1.0, 2.0]}


# --- masks ---------------------------------------------------------------------------------------


def test_states() -> None:
    for value in (*HIDING, GivesMasked()):
        for field in ("x", "y", "phi", "mu"):
            with pytest.raises(ValueError, match=rf"^State\.{field} {HIDDEN}: fill"):
                bd.State(**STATE | {field: value})


def test_a_mask_that_hides_nothing_may_pass() -> None:
    state = bd.State(**STATE | {"x": np.ma.array([5.0, 6.0, 7.0], mask=[False] * 3)})
    assert state.x.tolist() == [5.0, 6.0, 7.0] and type(state.x) is np.ndarray
    assert bd.Viscous(np.ma.array([1.0, 2.0])) == bd.Viscous([1.0, 2.0])


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda v: bd.Viscous(v), "Viscous.coefficients"),
        (lambda v: bd.PiecewiseLinear(v, np.zeros((3, 2))), "PiecewiseLinear.t"),
        (lambda v: bd.PiecewiseLinear([0, 1], [v, v]), "PiecewiseLinear.values"),
        (lambda v: bd.PiecewiseLinear([0, 1], ([0, 0, 0], v)), "PiecewiseLinear.values"),
        (lambda v: bd.Pulley(center=v[-2:], radius=1, inertia=1), "pulley.center"),
        (lambda v: bd.Tensioning(offset={1: v[-2:]}), r"offset\[1\]"),
        (lambda v: bd.Tensioning(offset=[(0, 0), v[-2:]]), r"offset\[1\]"),
        (lambda v: bd.simulate(*drives.plain_scene(), t_eval=v), "t_eval"),
        (lambda v: bd.simulate(*drives.plain_scene(), breakpoints=v), "breakpoints"),
        (lambda v: _core.Model(**SCENE | {"radii": v[-2:]}), "radii"),
        (lambda v: _core.Model(**SCENE | {"centers": [(0, 0), v[-2:]]}), "centers"),
    ],
)
def test_arguments(call: Callable[[Any], object], field: str) -> None:
    for value in HIDING[:2]:
        with pytest.raises(ValueError, match=f"^{field}.* {HIDDEN}"):
            call(value)


def test_experiments() -> None:
    scene = drives.plain_scene()
    experiment = bd.Experiment(scene.torque_fn, 1.0)
    for values, sigma in (
        (masked([1.0, 2.0]), None),
        ([1.0, np.ma.masked], None),
        ([1.0, 2.0], masked([1.0, 2.0])),
        ([1.0, 2.0], [1.0, np.ma.masked]),
    ):
        with pytest.raises(ValueError, match=HIDDEN):
            experiment.curve("pulleys.omega[0]", [0.0, 1.0], values, sigma=sigma)
        with pytest.raises(ValueError, match=HIDDEN):
            experiment.number(lambda run: run.t[:2], values, sigma=sigma)


def test_states_of_the_core(model: Any, rest: Any) -> None:
    for name in ("x", "omega", "theta"):
        for value in (masked(rest[name]), [*rest[name][:-1], np.ma.masked]):
            with pytest.raises(ValueError, match=f"{name}.* {HIDDEN}"):
                _core.Simulation(model, {**rest, name: value}, [], 1.0)


def test_single_numbers(model: Any, rest: Any) -> None:
    hidden = np.ma.array(1.0, mask=True)
    for value in (np.ma.masked, hidden):
        with pytest.raises(ValueError, match=r"^rtol must not hold masked values"):
            _core.Simulation(model, rest, [], 1.0, rtol=value)
        with pytest.raises(TypeError, match="must be a real number"):
            bd.Viscous([0.0, 0.0]) and bd.simulate(*drives.plain_scene()[:2], value)
    with pytest.raises(ValueError, match=r"^max_steps must not hold masked values"):
        _core.Simulation(model, rest, [], 1.0, max_steps=np.ma.array(3, mask=True))
    assert _core.Simulation(model, rest, [], 1.0, rtol=np.ma.array(1e-3, mask=False))


def test_what_torque_functions_return(model: Any, rest: Any) -> None:
    def run(returned: Any, t_end: float) -> _core.Simulation:
        torque = [("call", lambda t, theta, omega: returned)]
        return _core.Simulation(model, rest, torque, t_end)

    for hiding in (
        masked([1.0, 2.0]),
        np.ma.array([1, 2], mask=[True, False]),
        [1.0, np.ma.masked],
        (np.ma.array(1.0, mask=True), 2.0),
        [[1.0, np.ma.masked]],
    ):
        with pytest.raises((ValueError, TypeError), match=r"^torque_fn must return 2 torques"):
            run(hiding, 1.0).advance(1.0)
    runs = [run(torques, 1e-3) for torques in (np.ma.array([-1.0, 0.5]), [-1.0, 0.5])]
    assert all(one.advance(np.inf) is True for one in runs)  # a mask that hides nothing
    np.testing.assert_array_equal(*(one.state()["omega"] for one in runs))


# --- immutable -----------------------------------------------------------------------------------

KEPT = [
    bd.State(**STATE),
    bd.Viscous([1.0, 2.0]),
    bd.PiecewiseLinear([0.0, 1.0], [[1.0, 2.0], [3.0, 4.0]]),
]


CLONES: list[Callable[[Any], Any]] = [
    lambda thing: thing, copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing)),
    attrs.evolve,
]  # fmt: skip


@pytest.mark.parametrize("kept", KEPT, ids=lambda kept: type(kept).__name__)
def test_arrays_cannot_be_made_writeable(kept: Any) -> None:
    for thing in (clone(kept) for clone in CLONES):
        assert thing == kept
        arrays = [getattr(thing, field.name) for field in attrs.fields(type(thing))]
        for array in (one for one in arrays if isinstance(one, np.ndarray)):
            assert array.flags.c_contiguous and array.flags.aligned
            for change in (
                lambda array=array: setattr(array.flags, "writeable", True),
                lambda array=array: array.setflags(write=True),
                lambda array=array: array.view().setflags(write=True),
                lambda array=array: array.__setitem__(..., 0.0),
            ):
                with pytest.raises(ValueError):
                    change()
    x = np.array([0.0, 1.0, 2.0])  # nor is what was given kept
    state = bd.State(**STATE | {"x": x})
    x[:] = 9.0
    assert state.x.tolist() == [0.0, 1.0, 2.0]


# --- anything ------------------------------------------------------------------------------------

NUMBERS = st.floats() | st.integers() | st.just(10**400) | st.booleans() | st.none()
NUMBERS |= st.text(max_size=3) | st.complex_numbers() | st.just(np.ma.masked)
ANYTHING = (
    st.recursive(NUMBERS, lambda inner: st.lists(inner, max_size=4), max_leaves=6)
    | st.lists(st.floats(-10, 10), min_size=3, max_size=3)
    | npst.arrays(
        npst.scalar_dtypes() | st.just(np.dtype(np.longdouble)) | st.just(np.dtype(object)),
        npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3),
    )
)


@EXAMPLES
def test_any_state(examples: int) -> None:
    names = [field.name for field in attrs.fields(bd.State)]

    def check(chosen: list[str], data: st.DataObject) -> None:
        try:
            state = bd.State(**STATE | {name: data.draw(ANYTHING) for name in chosen})
        except (TypeError, ValueError) as error:
            assert "State." in str(error)
        else:
            assert np.isfinite(state.x).all() and state.x.shape == state.mu.shape[-1:]

    some = st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True)
    fuzz(examples, check, some, st.data())


@EXAMPLES
def test_any_torque(examples: int) -> None:
    def check(value: Any) -> None:
        for build, field in (
            (bd.Viscous, "Viscous"),
            (lambda v: bd.PiecewiseLinear(v, [[0.0]]), "PiecewiseLinear"),
            (lambda v: bd.PiecewiseLinear([0.0], v), "PiecewiseLinear"),
        ):
            try:
                build(value)
            except (TypeError, ValueError) as error:
                assert str(error).startswith(field)

    fuzz(examples, check, ANYTHING)


def test_numbers_too_long_to_print() -> None:
    huge = 16**9000  # Python refuses to write it
    with pytest.raises(ValueError, match=r"^a must be finite, got int too long to print"):
        checks.real("a", huge)
    with pytest.raises(ValueError, match=r"^a must be an integer from 1 to 9, got int too long"):
        checks.integer("a", huge, 1, 9)
    with pytest.raises(TypeError, match=r"^a must hold real numbers, got .*too long to print"):
        checks.real_array("a", [huge], ndim=1)
    with pytest.raises(TypeError, match=r"^a must be a pair of real numbers, got"):
        checks.pair("a", [huge] * 3, "1")


def test_masks_while_another_thread_imports_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module is in sys.modules before its names are in it."""
    monkeypatch.setitem(sys.modules, "numpy.ma", ModuleType("numpy.ma"))
    assert bd.Pulley(center=(0.0, 0.1), radius=0.1, inertia=0.01).center == (0.0, 0.1)
