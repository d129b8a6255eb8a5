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
from beltdyn import _core

HIDDEN = "must not hold masked values"
MASK = np.ma.masked
MASKED = np.ma.array([1.0, 2.0, 3.0], mask=[False, False, True])


class Rows(list[Any]):
    pass


class GivesMasked:
    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return MASKED


HIDING = [MASKED, [1.0, 2.0, MASK], (1.0, 2.0, np.ma.array(3.0, mask=True)), Rows([1.0, MASK, 3.0])]
STATE: dict[str, Any] = {"x": [0, 1, 2], "y": [0, 0, 0], "phi": [0, 0, 0], "theta": [1.0, 2.0]}


def test_states() -> None:
    """A mask that hides nothing may pass."""
    for value in (*HIDING, GivesMasked()):
        for field in ("x", "y", "phi", "mu"):
            with pytest.raises(ValueError, match=rf"^State\.{field} {HIDDEN}: fill"):
                bd.State(**STATE | {field: value})
    state = bd.State(**STATE | {"x": np.ma.array([5.0, 6.0, 7.0], mask=[False] * 3)})
    assert state.x.tolist() == [5.0, 6.0, 7.0] and type(state.x) is np.ndarray
    assert bd.Viscous(np.ma.array([1.0, 2.0])) == bd.Viscous([1.0, 2.0])


def test_arguments() -> None:
    plain = drives.plain_scene()
    experiment, times = bd.Experiment(plain.torque_fn, 1.0), np.array([0.0, 0.5, 1.0])
    calls: list[tuple[Callable[[Any], object], str]] = [
        (lambda v: bd.Viscous(v), "Viscous.coefficients"),
        (lambda v: bd.PiecewiseLinear(v, np.zeros((3, 2))), "PiecewiseLinear.t"),
        (lambda v: bd.PiecewiseLinear([0, 1], [v, v]), "PiecewiseLinear.values"),
        (lambda v: bd.PiecewiseLinear([0, 1], ([0, 0, 0], v)), "PiecewiseLinear.values"),
        (lambda v: bd.Pulley(center=v[-2:], radius=1, inertia=1), "pulley.center"),
        (lambda v: bd.Tensioning(offset={1: v[-2:]}), r"offset\[1\]"),
        (lambda v: bd.Tensioning(offset=[(0, 0), v[-2:]]), r"offset\[1\]"),
        (lambda v: bd.simulate(*plain, t_eval=v), "t_eval"),
        (lambda v: bd.simulate(*plain, breakpoints=v), "breakpoints"),
        (lambda v: _core.Model(**SCENE | {"radii": v[-2:]}), "radii"),
        (lambda v: _core.Model(**SCENE | {"centers": [(0, 0), v[-2:]]}), "centers"),
        (lambda v: experiment.curve("pulleys.omega[0]", times, v), ""),
        (lambda v: experiment.curve("pulleys.omega[0]", times, times, sigma=v), ""),
        (lambda v: experiment.number(lambda run: run.t[:3], v), ""),
        (lambda v: experiment.number(lambda run: run.t[:3], times, sigma=v), ""),
    ]
    for call, field in calls:
        for value in HIDING[:2]:
            with pytest.raises(ValueError, match=f"^{field}.* {HIDDEN}"):
                call(value)


def test_states_and_numbers_of_the_core(model: Any, rest: Any) -> None:
    for name in ("x", "omega", "theta"):
        for value in ([*rest[name][:-1], MASK], np.ma.array(rest[name], mask=True)):
            with pytest.raises(ValueError, match=f"{name}.* {HIDDEN}"):
                _core.Simulation(model, {**rest, name: value}, [], 1.0)
    for value in (MASK, np.ma.array(1.0, mask=True)):
        with pytest.raises(ValueError, match=rf"^rtol {HIDDEN}"):
            _core.Simulation(model, rest, [], 1.0, rtol=value)
        with pytest.raises(TypeError, match="must be a real number"):
            bd.simulate(*drives.plain_scene()[:2], value)
    with pytest.raises(ValueError, match=rf"^max_steps {HIDDEN}"):
        _core.Simulation(model, rest, [], 1.0, max_steps=np.ma.array(3, mask=True))
    assert _core.Simulation(model, rest, [], 1.0, rtol=np.ma.array(1e-3, mask=False))


def test_what_torque_functions_return(model: Any, rest: Any) -> None:
    def run(returned: Any, t_end: float) -> _core.Simulation:
        torque = [("call", lambda t, theta, omega: returned)]
        return _core.Simulation(model, rest, torque, t_end)

    for hiding in (
        MASKED[1:],
        np.ma.array([1, 2], mask=[True, False]),
        [1.0, MASK],
        (np.ma.array(1.0, mask=True), 2.0),
        [[1.0, MASK]],
    ):
        with pytest.raises((ValueError, TypeError), match=r"^torque_fn must return 2 torques"):
            run(hiding, 1.0).advance(1.0)
    runs = [run(torques, 1e-3) for torques in (np.ma.array([-1.0, 0.5]), [-1.0, 0.5])]
    assert all(one.advance(np.inf) is True for one in runs)  # a mask that hides nothing
    np.testing.assert_array_equal(*(one.state()["omega"] for one in runs))


@pytest.mark.parametrize(
    "kept",
    [
        bd.State(**STATE),
        bd.Viscous([1.0, 2.0]),
        bd.PiecewiseLinear([0.0, 1.0], [[1.0, 2.0], [3.0, 4.0]]),
    ],
)
def test_arrays_cannot_be_made_writeable(kept: Any) -> None:
    copies = (copy.copy(kept), copy.deepcopy(kept), pickle.loads(pickle.dumps(kept)))
    for thing in (kept, *copies, attrs.evolve(kept)):
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
def test_any_state_and_any_torque(examples: int) -> None:
    def check_state(chosen: list[str], data: st.DataObject) -> None:
        try:
            state = bd.State(**STATE | {name: data.draw(ANYTHING) for name in chosen})
        except (TypeError, ValueError) as error:
            assert "State." in str(error)
        else:
            assert np.isfinite(state.x).all() and state.x.shape == state.mu.shape[-1:]

    def check_torque(value: Any) -> None:
        for build, field in (
            (bd.Viscous, "Viscous"),
            (lambda v: bd.PiecewiseLinear(v, [[0.0]]), "PiecewiseLinear"),
            (lambda v: bd.PiecewiseLinear([0.0], v), "PiecewiseLinear"),
        ):
            try:
                build(value)
            except (TypeError, ValueError) as error:
                assert str(error).startswith(field)

    names = [field.name for field in attrs.fields(bd.State)]
    some = st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True)
    fuzz(examples, check_state, some, st.data())
    fuzz(examples, check_torque, ANYTHING)


def test_masks_while_another_thread_imports_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module is in sys.modules before its names are in it."""
    monkeypatch.setitem(sys.modules, "numpy.ma", ModuleType("numpy.ma"))
    assert bd.Pulley(center=(0.0, 0.1), radius=0.1, inertia=0.01).center == (0.0, 0.1)
