"""Torques: objects, Python callables and compiled functions, right and wrong."""

from __future__ import annotations

import ctypes
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import cffi
import numba
import numpy as np
import pytest
from scipy import LowLevelCallable

import beltdyn as bd

T_END = 0.005
DOUBLES = ctypes.POINTER(ctypes.c_double)
PROTOTYPE = ctypes.CFUNCTYPE(None, ctypes.c_double, DOUBLES, DOUBLES, DOUBLES, ctypes.c_void_p)
_REALS = numba.types.CPointer(numba.types.double)
NUMBA_SIGNATURE = numba.types.void(numba.types.double, _REALS, _REALS, _REALS, numba.types.voidptr)
C_SIGNATURE = "void (double, double *, double *, double *, void *)"


def law(t: float, theta: Any, omega: Any) -> list[float]:
    """Return the torque that every variant below gives."""
    return [-2e4 * t, -10.0 * omega[1]]


@numba.cfunc(NUMBA_SIGNATURE)  # type: ignore[untyped-decorator]
def numba_law(t: float, theta: Any, omega: Any, torque: Any, user: Any) -> None:
    torque[0] = -2e4 * t
    torque[1] = -10.0 * omega[1]


@numba.cfunc(NUMBA_SIGNATURE)  # type: ignore[untyped-decorator]
def numba_law_with_data(t: float, theta: Any, omega: Any, torque: Any, user: Any) -> None:
    data = numba.carray(user, 2, numba.types.double)
    torque[0] = data[0] * t
    torque[1] = data[1] * omega[1]


@cache
def start() -> tuple[bd.Params, bd.State]:
    params = bd.scenes.kubas_case_1().params
    return params, bd.settle(params)


def run(torque: Any) -> bd.Result:
    params, state = start()
    return bd.simulate(params, torque, T_END, initial=state)


@cache
def expected() -> bd.Result:
    return run(law)


def test_values() -> None:
    """At a jump the value after it; of one time a constant; sums by their parts."""
    still = [0, 0]
    torque = bd.PiecewiseLinear([1.0, 2.0, 2.0, 4.0], [[0, 1], [10, 1], [20, 1], [40, 5]])
    for t, value in [(0, 0), (1, 0), (1.5, 5), (2.0, 20), (3, 30), (4, 40), (9, 40)]:
        assert torque(t, still, still)[0] == value
    assert torque(np.nextafter(2.0, 0.0), still, still)[0] == pytest.approx(10.0)
    flat = bd.PiecewiseLinear([0.0, 1.0], [0.0, 2.0])
    assert flat == bd.PiecewiseLinear([0.0, 1.0], [[0.0], [2.0]])
    assert (torque.n_pulleys, flat.n_pulleys) == (2, 1)
    for t in (0.0, 0.3, 1.0):
        assert bd.PiecewiseLinear([0.3], [[1.0, -2.0]])(t, still, still).tolist() == [1.0, -2.0]
    assert bd.Viscous([2.0, 0.5])(0.0, [9, 9], [3.0, -4.0]).tolist() == [-6.0, 2.0]
    ramp, drag = bd.PiecewiseLinear([0, 1], [[0, 0], [1, 2]]), bd.Viscous([1, 1])
    total = ramp + drag + ramp
    assert isinstance(total, bd.TorqueSum) and total.parts == (ramp, drag, ramp)
    for add in (lambda: total + law, lambda: law + total):
        with pytest.raises(TypeError, match="cannot be added to a torque object: give a function"):
            add()
    assert total(0.5, still, [3, 4]).tolist() == [-2.0, -2.0]
    assert len(total.terms()) == 3
    with pytest.raises(ValueError, match=r"torque\[1\] must be for 2 pulley\(s\).*got one for 3"):
        ramp + bd.Viscous([1, 1, 1])
    with pytest.raises(TypeError):
        ramp + law  # type: ignore[operator]


def test_objects_are_values() -> None:
    torque = bd.PiecewiseLinear([0, 1], [[0, 0], [1, 2]]) + bd.Viscous([1, 1])
    assert eval(repr(torque), vars(bd)) == torque
    assert pickle.loads(pickle.dumps(torque)) == torque
    assert torque != bd.Viscous([1, 1]) != bd.Viscous([1, 2])
    assert "piecewise linear" in str(torque) and "N m s/rad" in str(torque)
    given = np.array([1.0, 2.0])
    viscous = bd.Viscous(given)
    given[0] = 7.0
    assert viscous.coefficients[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        viscous.coefficients[0] = 3.0


@pytest.mark.parametrize(
    ("t", "values", "error", "message"),
    [
        ([0, -1], [[0], [0]], ValueError, r"PiecewiseLinear\.t must be non-decreasing"),
        ([0, 0, 0], [[0]] * 3, ValueError, r"PiecewiseLinear\.t .* at most twice"),
        ([], np.zeros((0, 1)), ValueError, r"PiecewiseLinear\.t must hold at least one"),
        ([0, np.nan], [[0], [0]], ValueError, r"PiecewiseLinear\.t must be finite.*\[1\]"),
        ([[0, 1]], [[0], [0]], ValueError, r"PiecewiseLinear\.t must have 1 dimension"),
        (["0"], [[0]], TypeError, r"PiecewiseLinear\.t must hold real numbers"),
        (None, [[0]], TypeError, r"PiecewiseLinear\.t must hold real numbers"),
        ([0, 1], [[[0]], [[1]]], ValueError, r"PiecewiseLinear\.values must have 2 dimension"),
        ([0, 1], [[0]], ValueError, r"PiecewiseLinear\.values .* = \(2, n_p\), got \(1, 1\)"),
        ([0, 1], [[], []], ValueError, r"PiecewiseLinear\.values must have shape"),
        ([0, 1], [[0], [1, 2]], ValueError, r"PiecewiseLinear\.values must be a regular array"),
        ([0], [[np.inf]], ValueError, r"PiecewiseLinear\.values must be finite.*\[0, 0\]"),
        ([0], [[1j]], TypeError, r"PiecewiseLinear\.values must hold real numbers"),
        ([0], [[True]], TypeError, r"PiecewiseLinear\.values must hold real numbers"),
    ],
)
def test_bad_piecewise_linear(t: Any, values: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        bd.PiecewiseLinear(t, values)


@pytest.mark.parametrize(
    ("coefficients", "error", "rule"),
    [
        ([], ValueError, "hold one value per pulley"),
        ([1.0, np.nan], ValueError, r"be finite, got nan at \[1\]"),
        (1.0, ValueError, "have 1 dimension"),
        ("1", TypeError, "hold real numbers"),
    ],
)
def test_bad_viscous(coefficients: Any, error: type[Exception], rule: str) -> None:
    with pytest.raises(error, match=rf"^Viscous\.coefficients must {rule}"):
        bd.Viscous(coefficients)


def ctypes_callback() -> Any:
    def fill(t: float, theta: Any, omega: Any, torque: Any, user: Any) -> None:
        torque[0], torque[1] = law(t, theta, omega)

    return PROTOTYPE(fill)


def address() -> int:
    return int(numba_law.address)


def as_cffi(declaration: str) -> Any:
    return FFI.cast(declaration, address())


#: Of the two coefficients of the law; they must outlive the run.
DATA = (ctypes.c_double * 2)(-2e4, -10.0)
FFI = cffi.FFI()
FFI_DATA = FFI.new("double[2]", list(DATA))


def low_level_with_data(kind: str) -> Any:
    """Make a function that reads its coefficients through the user pointer."""
    if kind == "ctypes":
        return LowLevelCallable(numba_law_with_data.ctypes, ctypes.cast(DATA, ctypes.c_void_p))
    function = FFI.cast(C_SIGNATURE.replace("(", "(*)(", 1), int(numba_law_with_data.address))
    return LowLevelCallable(function, FFI.cast("void *", FFI_DATA))


def capsule() -> Any:
    new = ctypes.pythonapi.PyCapsule_New
    new.restype = ctypes.py_object
    new.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return new(address(), CAPSULE_NAME, None)


CAPSULE_NAME = C_SIGNATURE.encode()  # a capsule keeps the pointer to its name only


COMPILED: dict[str, Callable[[], Any]] = {
    "ctypes callback": ctypes_callback,
    "cffi": lambda: as_cffi("void (*)(double, double *, double *, double *, void *)"),
    "cffi const": lambda: as_cffi("void (*)(double, const double *, const double *, double *, "
                                  "void *)"),
    "numba": lambda: numba_law,
    "numba.ctypes": lambda: numba_law.ctypes,
    "ctypes address": lambda: PROTOTYPE(address()),
    "LowLevelCallable ctypes": lambda: LowLevelCallable(numba_law.ctypes),
    "LowLevelCallable capsule": lambda: LowLevelCallable(capsule()),
    "capsule": capsule,
    "ctypes with data": lambda: low_level_with_data("ctypes"),
    "cffi with data": lambda: low_level_with_data("cffi"),
}  # fmt: skip


@pytest.mark.parametrize("kind", COMPILED)
def test_compiled_is_as_python(kind: str) -> None:
    """User data reach those that are made with some."""
    result, python = run(COMPILED[kind]()), expected()
    np.testing.assert_allclose(result.pulleys.omega, python.pulleys.omega, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(result.pulleys.torque, python.pulleys.torque, rtol=1e-9)
    assert result.stats.nfev == python.stats.nfev


def test_objects_are_as_python() -> None:
    torque = bd.PiecewiseLinear([0.0, 1.0], [[0, 0], [-2e4, 0]]) + bd.Viscous([0, 10.0])
    for given in (torque, lambda t, theta, omega: torque(t, theta, omega)):
        omega = run(given).pulleys.omega
        np.testing.assert_allclose(omega, expected().pulleys.omega, rtol=1e-9, atol=1e-12)


def test_not_a_torque_or_for_another_number_of_pulleys() -> None:
    for wrong in (None, 3.0, "law", [1.0, 2.0], object(), lambda t: [0.0, 0.0]):
        with pytest.raises(TypeError, match=r"^torque_fn must be callable") as error:
            run(wrong)
        assert (wrong is None) == ("for none give bd.Viscous([0.0, 0.0])" in str(error.value))
    for torque in (bd.Viscous([1.0]), bd.PiecewiseLinear([0.0], [[1, 2, 3]]), bd.Viscous([1] * 3)):
        message = rf"each of the 2 pulley\(s\), got a torque for {torque.n_pulleys}$"
        with pytest.raises(ValueError, match=message):
            run(torque)
    with pytest.raises(ValueError, match="must not be a null pointer"):
        run(PROTOTYPE())


def test_callable_returns_something_else() -> None:
    for error, values in {
        ValueError: ([1.0], [1.0, 2.0, 3.0], np.zeros((2, 2)), []),
        TypeError: (1.0, None, "ab", ["1", "2"], [1.0, 1j], [1.0, None]),
    }.items():
        for value in values:
            calls: list[float] = []

            def torque(t: float, *_: Any, value: Any = value, calls: list[float] = calls) -> Any:
                calls.append(t)
                return value

            with pytest.raises(error, match="2 torques, one per pulley"):
                run(torque)
            assert calls == [0.0], "refused at the first call"


def test_not_finite_torque_stops_the_run() -> None:
    with pytest.raises(bd.SimulationError, match="pulley 1 is nan") as caught:
        run(lambda t, theta, omega: [0.0, np.nan])
    assert caught.value.pulley == 1
    assert caught.value.result is not None


def test_exceptions_of_a_callable_come_out_unchanged() -> None:
    mine = Exception("from the torque")

    def torque(t: float, theta: Any, omega: Any) -> Any:
        if t > T_END / 2:
            raise mine
        return [0.0, 0.0]

    with pytest.raises(Exception, match="from the torque") as caught:
        run(torque)
    assert caught.value is mine


OTHERS: dict[str, Callable[[], Any]] = {
    "ctypes few": lambda: ctypes.CFUNCTYPE(None, ctypes.c_double)(lambda t: None),
    "ctypes int": lambda: ctypes.CFUNCTYPE(
        ctypes.c_int, ctypes.c_double, DOUBLES, DOUBLES, DOUBLES, ctypes.c_void_p
    )(lambda *_: 0),
    "ctypes float": lambda: ctypes.CFUNCTYPE(
        None, ctypes.c_float, DOUBLES, DOUBLES, DOUBLES, ctypes.c_void_p
    )(lambda *_: None),
    "cffi": lambda: as_cffi("double (*)(double)"),
    "cffi void *": lambda: as_cffi("void *"),
    "numba": lambda: numba.cfunc(numba.types.double(numba.types.double))(lambda x: x),
    "LowLevel": lambda: LowLevelCallable(OTHERS["ctypes few"]()),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_compiled_with_another_signature(kind: str) -> None:
    with pytest.raises(TypeError, match=r"^torque_fn must be compiled as void f\(double t, "):
        run(OTHERS[kind]())
