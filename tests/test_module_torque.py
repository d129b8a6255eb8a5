"""Torque as the binding takes it: terms, and what a callable is given and may return."""

import ctypes
import math
from fractions import Fraction

import numpy as np
import pytest
from module_common import (
    INF,
    LAYOUTS,
    TORQUE,
    Broken,
    make_model,
    make_simulation,
    refused,
    same_bits,
    strange_layouts,
)

from beltdyn.errors import SimulationError

V, T = ValueError, TypeError
SHAPE = "must have shape"
BEGINS = "must be a tuple that begins with its kind, got"


def end_of(model, rest, torque):
    """The state after a run under this torque."""
    simulation = make_simulation(model, rest, torque)
    assert simulation.advance(INF) is True
    return simulation.state()


@pytest.mark.parametrize(
    ("term", "kind", "message"),
    [
        (7, T, f" {BEGINS} 7"),
        ((), T, f" {BEGINS} ()"),
        (["viscous", [0, 0]], T, f" {BEGINS} ['viscous', [0, 0]]"),
        (("spline", [0, 0]), V,
         " must be of kind 'piecewise', 'viscous', 'function', 'call', 'load', 'table' or "
         "'harmonics', got 'spline'"),
        (("load", 1, [0, 0]), V, " of kind 'load' must have 3 arguments, got 2"),
        (("load", 2, [0, 0, 0], None), V, "0: pulley must be one of 0 to 1, got 2"),
        (("load", -1, [0, 0, 0], None), V, "0: pulley must be one of 0 to 1, got -1"),
        (("load", 0.0, [0, 0, 0], None), T, " pulley must be an integer, got float"),
        (("load", 0, [0, 0], None), V, f" coefficients {SHAPE} (3,), got (2,)"),
        (("load", 0, [0, -1, 0], None), V, "0: viscous must be finite and >= 0, for it acts "
         "against the rotation; got -1"),
        (("load", 0, [0, 0, 0], [0.0]), T, " factor must be None or (times, factors), got [0.0]"),
        (("load", 0, [0, 0, 0], ([0.0], [1, 2])), V, f" factors {SHAPE} (1,), got (2,)"),
        (("load", 0, [0, 0, 0], ([1.0, 0.0], [1, 2])), V, "0: t must be finite and "
         "non-decreasing, a time given at most twice (a jump); t[1] is 0"),
        (("table", 0, [1.0, 1.0], [0, 0], None), V,
         "0: omega must be finite, >= 0 and increasing; omega[1] is 1"),
        (("table", 0, [1.0], [-3.0], None), V, "0: torque must be finite and >= 0, for it acts "
         "against the rotation; torque[0] is -3"),
        (("table", 0, [], [], None), V, "0: the table must have at least one point"),
        (("table", 0, [1.0], [1.0, 2.0], None), V, f" torques {SHAPE} (1,), got (2,)"),
        (("table", 0, [0.0, INF], [1.0, 2.0], None), V, " speeds[1] must be finite, got inf"),
        (("harmonics", 0, 2, [1], [1], [0], None), V, "0: of must be one of 0 to 1, got 2"),
        (("harmonics", 0, 1, [0], [1], [0], None), V,
         "0: orders must be finite and > 0, orders[0] is 0"),
        (("harmonics", 0, 1, [], [], [], None), V, "0: there must be at least one harmonic"),
        (("harmonics", 0, 1, [1], [1, 2], [0], None), V, f" amplitudes {SHAPE} (1,), got (2,)"),
        (("viscous",), V, " of kind 'viscous' must have 1 argument, got 0"),
        (("call", print, 1), V, " of kind 'call' must have 1 argument, got 2"),
        (("piecewise", [0]), V, " of kind 'piecewise' must have 2 arguments, got 1"),
        (("viscous", [0, 0, 0]), V, f" coefficients {SHAPE} (2,), got (3,)"),
        (("viscous", [0, math.nan]), V, " coefficients[1] must be finite, got nan"),
        (("piecewise", [0, INF], [[0, 0]]), V, " times[1] must be finite, got inf"),
        (("piecewise", [0, 1], [[0, 0]]), V, f" values {SHAPE} (2, 2), got (1, 2)"),
        (("piecewise", [0, 1], [[0, 0], [0, INF]]), V, " values[1, 1] must be finite, got inf"),
        (("call", None), T, " must hold a callable, got NoneType"),
        (("function", 0, 0), V, " function address must not be 0"),
        (("function", -1, 0), V, " function address must be an address, got -1"),
        (("function", 1.0, 0), T, " function address must be an integer, got float"),
        (("function", 1, None), T, " user address must be an integer, got NoneType"),
    ],
)  # fmt: skip
def test_terms_of_torque_refuse(model, rest, term, kind, message):
    """By the binding, "torque[0] ...", or by the core, "torque term 0: ..."."""
    begin = "torque term " if message.startswith("0: ") else "torque[0]"
    with refused(kind, begin + message):
        make_simulation(model, rest, [term])


def test_rules_for_torque_times_and_the_sequence_of_terms(model, rest):
    for t, values, word in (
        ([1, 0], [[0, 0], [0, 0]], "non-decreasing"), ([], np.zeros((0, 2)), "t must not be empty"),
        ([0, 1, 1, 1], np.zeros((4, 2)), r"given at most twice \(a jump\); t\[3\] is 1"),
    ):  # fmt: skip
        with pytest.raises(V, match=word):
            make_simulation(model, rest, [("piecewise", t, values)])
    for torque, kind in ((None, "NoneType"), (7, "int")):
        with refused(T, f"torque must be a sequence of terms, got {kind}"):
            make_simulation(model, rest, torque)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_torques_are_copied_from_any_layout_and_iterable(model, rest, driven, layout):
    (_, t, values), (_, coefficients) = TORQUE
    arrays = [strange_layouts(given)[layout] for given in (t, values, coefficients)]
    torque = [("piecewise", *arrays[:2]), ("viscous", arrays[2])]
    simulation = make_simulation(model, rest, iter(torque))
    for array in arrays:
        if layout not in ("read-only", "list"):
            array[:] = math.nan
    torque.clear()
    assert simulation.advance(INF) is True and same_bits(simulation.state(), driven)
    assert not same_bits(end_of(model, rest, TORQUE[:1]), driven)


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
    of_compiled = end_of(model, rest, [("function", address, ctypes.addressof(user))])
    assert seen == {42.0}

    def plain(t, theta, omega):
        return [-50.0 * t + theta[0], -16.0 * omega[1]]

    assert same_bits(end_of(model, rest, [("call", plain)]), of_compiled)


def test_terms_add_up(model, rest, driven):
    eight = ("viscous", [0.0, 8.0])
    ramp = ("call", lambda t, theta, omega: [-50.0 * t / 0.02, 0.0])
    final = end_of(model, rest, [eight, ramp, eight])
    np.testing.assert_allclose(final["omega"], driven["omega"], rtol=1e-6)


def test_callables_may_return(model, rest):
    expected = end_of(model, rest, [("piecewise", [0.0], [[-1.0, -2.0]])])
    for answer in [
        [-1.0, -2.0], (-1.0, -2.0), [-1, -2], [np.float64(-1), np.float32(-2)],
        [Fraction(-1), np.array(-2.0)], np.array([-1.0, -2.0]), np.array([-1, -2], "f4"),
        np.array([-1, -2], ">f8"), np.array([-1, -2]), np.array([-1.0, 0.0, -2.0, 0.0])[::2],
        memoryview(np.array([-1.0, -2.0])), range(-1, -3, -1),
    ]:  # fmt: skip
        final = end_of(model, rest, [("call", lambda *_, answer=answer: answer)])
        assert same_bits(final, expected), repr(answer)


MUST = "torque_fn must return 2 torques, one per pulley"


class Clearing:
    """A number that takes itself, and the rest, out of the list while that is read."""

    def __float__(self):
        SHRINKING.clear()
        return 1.0


SHRINKING = [Clearing(), 1.0]


@pytest.mark.parametrize(
    ("answer", "kind", "message"),
    [
        (None, T, f"{MUST}, got NoneType"),
        ("12", T, f"{MUST}, got str"),
        (1.0, T, f"{MUST}, got float"),
        (np.array(1.0), T, f"{MUST}, got numpy.ndarray"),
        ({0: 1.0, 1: 2.0}, T, f"{MUST}, got dict"),
        ([1.0], V, f"{MUST}, got 1"),
        ([], V, f"{MUST}, got 0"),
        (np.zeros(3), V, f"{MUST}, got 3"),
        (np.zeros((2, 1)), V, f"{MUST}, got an array of shape (2, 1)"),
        (np.zeros(2, complex), T, f"{MUST}, got an array of dtype complex128"),
        (np.zeros(2, bool), T, f"{MUST}, got an array of dtype bool"),
        (np.array([None, 1.0]), T, f"{MUST}, got an array of dtype object"),
        ([1.0, None], T, f"{MUST}: number 1 must be a real number, got NoneType"),
        ([1j, 1.0], T, f"{MUST}: number 0 must be a real number, got complex"),
        ([1.0, [2.0]], T, f"{MUST}: number 1 must be a real number, got list"),
        ([0.0, Broken()], ZeroDivisionError, "mine"),
        (Broken(), ZeroDivisionError, "mine"),
        (SHRINKING, V, f"{MUST}, got 0"),
    ],
)
def test_callables_must_not_return(model, rest, answer, kind, message):
    simulation = make_simulation(model, rest, [("call", lambda t, theta, omega: answer)])
    with refused(kind, message):
        simulation.advance(INF)
    assert simulation.time == 0.0


def test_callables_get_plain_read_only_arrays(model, rest):
    """And may hand them back; one pulley has one torque."""
    state = {**rest, "theta": [0.25, 0.5], "omega": [1.0, 2.0]}
    calls = []

    def torque(t, theta, omega):
        calls.append((t, theta, omega))
        return omega

    final = end_of(model, state, [("call", torque)])
    assert same_bits(final, end_of(model, state, [("call", lambda t, _, omega: omega.tolist())]))
    t, theta, omega = calls[0]
    assert t == 0.0 and type(t) is float
    assert theta.tolist() == [0.25, 0.5] and omega.tolist() == [1.0, 2.0]
    for array in (theta, omega):
        assert type(array) is np.ndarray and array.dtype == np.dtype(float)
        assert array.shape == (2,) and not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    alone = make_model(centers=[(0, 0)], radii=[0.2], inertias=[0.01])
    state = {**rest, "theta": [0.0], "omega": [0.0]}
    with refused(ValueError, "torque_fn must return 1 torque, one per pulley, got 0"):
        end_of(alone, state, [("call", lambda *_: [])])


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
