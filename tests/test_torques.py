"""Torques: objects, Python callables and compiled functions, right and wrong."""

from __future__ import annotations

import ctypes
import pickle
from collections.abc import Callable
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
NUMBA_SIGNATURE = numba.types.void(
    numba.types.double,
    numba.types.CPointer(numba.types.double),
    numba.types.CPointer(numba.types.double),
    numba.types.CPointer(numba.types.double),
    numba.types.voidptr,
)
C_SIGNATURE = "void (double, double *, double *, double *, void *)"


def law(t: float, theta: Any, omega: Any) -> list[float]:
    """Give the torque that every variant below gives."""
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


@pytest.fixture(scope="module")
def params() -> bd.Params:
    return bd.scenes.kubas_case_1().params


@pytest.fixture(scope="module")
def start(params: bd.Params) -> bd.State:
    return bd.settle(params)


@pytest.fixture(scope="module")
def run(params: bd.Params, start: bd.State) -> Callable[..., bd.Result]:
    def run(torque: Any, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, T_END, initial=start, **options)

    return run


@pytest.fixture(scope="module")
def expected(run: Callable[..., bd.Result]) -> bd.Result:
    return run(law)


def test_piecewise_linear_values() -> None:
    torque = bd.PiecewiseLinear([1.0, 2.0, 2.0, 4.0], [[0, 1], [10, 1], [20, 1], [40, 5]])
    for t, value in [(0.0, 0.0), (1.0, 0.0), (1.5, 5.0), (3.0, 30.0), (4.0, 40.0), (9.0, 40.0)]:
        assert torque(t, [0, 0], [0, 0])[0] == value
    assert torque(2.0, [0, 0], [0, 0])[0] == 20.0, "at a jump the value after it"
    assert torque(np.nextafter(2.0, 0.0), [0, 0], [0, 0])[0] == pytest.approx(10.0)
    assert torque.n_pulleys == 2


def test_one_time_is_a_constant() -> None:
    torque = bd.PiecewiseLinear([0.3], [[1.0, -2.0]])
    for t in (0.0, 0.3, 1.0):
        assert torque(t, [0, 0], [0, 0]).tolist() == [1.0, -2.0]


def test_viscous_opposes_the_motion() -> None:
    assert bd.Viscous([2.0, 0.5])(0.0, [9, 9], [3.0, -4.0]).tolist() == [-6.0, 2.0]


def test_sums() -> None:
    ramp, drag = bd.PiecewiseLinear([0, 1], [[0, 0], [1, 2]]), bd.Viscous([1, 1])
    total = ramp + drag + ramp
    assert isinstance(total, bd.TorqueSum) and total.parts == (ramp, drag, ramp)
    assert total(0.5, [0, 0], [3, 4]).tolist() == [-2.0, -2.0]
    assert len(total.terms()) == 3
    with pytest.raises(ValueError, match=r"torque\[1\] must be for 2 pulley\(s\).*got one for 3"):
        ramp + bd.Viscous([1, 1, 1])
    with pytest.raises(TypeError):
        ramp + law  # type: ignore[operator]


def test_objects_are_values() -> None:
    torque = bd.PiecewiseLinear([0, 1], [[0, 0], [1, 2]]) + bd.Viscous([1, 1])
    assert eval(repr(torque), vars(bd)) == torque
    assert pickle.loads(pickle.dumps(torque)) == torque
    assert torque != bd.Viscous([1, 1])
    assert bd.Viscous([1, 1]) != bd.Viscous([1, 2])
    assert "piecewise linear" in str(torque) and "N m s/rad" in str(torque)


def test_arrays_are_read_only_copies() -> None:
    given = np.array([1.0, 2.0])
    torque = bd.Viscous(given)
    given[0] = 7.0
    assert torque.coefficients[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        torque.coefficients[0] = 3.0


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


def cffi_pointer(const: str) -> Any:
    declaration = f"void (*)(double, {const}double *, {const}double *, double *, void *)"
    return cffi.FFI().cast(declaration, address())


def address() -> int:
    return int(numba_law.address)


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
    new.restype, new.argtypes = (
        ctypes.py_object,
        [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p],
    )
    return new(address(), CAPSULE_NAME, None)


CAPSULE_NAME = C_SIGNATURE.encode()  # a capsule keeps the pointer to its name only


COMPILED: dict[str, Callable[[], Any]] = {
    "ctypes callback": ctypes_callback,
    "cffi": lambda: cffi_pointer(""),
    "cffi const": lambda: cffi_pointer("const "),
    "numba": lambda: numba_law,
    "numba.ctypes": lambda: numba_law.ctypes,
    "ctypes address": lambda: PROTOTYPE(address()),
    "LowLevelCallable ctypes": lambda: LowLevelCallable(numba_law.ctypes),
    "LowLevelCallable capsule": lambda: LowLevelCallable(capsule()),
    "capsule": capsule,
    "ctypes with data": lambda: low_level_with_data("ctypes"),
    "cffi with data": lambda: low_level_with_data("cffi"),
}


@pytest.mark.parametrize("kind", COMPILED)
def test_compiled_is_as_python(
    kind: str, run: Callable[..., bd.Result], expected: bd.Result
) -> None:
    """User data reach those that are made with some."""
    result = run(COMPILED[kind]())
    np.testing.assert_allclose(result.pulleys.omega, expected.pulleys.omega, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(result.pulleys.torque, expected.pulleys.torque, rtol=1e-9)
    assert result.stats.nfev == expected.stats.nfev


def test_objects_are_as_python(run: Callable[..., bd.Result], expected: bd.Result) -> None:
    torque = bd.PiecewiseLinear([0.0, 1.0], [[0, 0], [-2e4, 0]]) + bd.Viscous([0, 10.0])
    for given in (torque, lambda t, theta, omega: torque(t, theta, omega)):
        result = run(given)
        np.testing.assert_allclose(
            result.pulleys.omega, expected.pulleys.omega, rtol=1e-9, atol=1e-12
        )


def test_not_a_torque_or_for_another_number_of_pulleys(run: Callable[..., bd.Result]) -> None:
    for wrong in (None, 3.0, "law", [1.0, 2.0], object()):
        with pytest.raises(TypeError, match=r"^torque_fn must be callable"):
            run(wrong)
    for torque in (bd.Viscous([1.0]), bd.PiecewiseLinear([0.0], [[1, 2, 3]]), bd.Viscous([1] * 3)):
        expected = rf"each of the 2 pulley\(s\), got a torque for {torque.n_pulleys}$"
        with pytest.raises(ValueError, match=expected):
            run(torque)


@pytest.mark.parametrize(
    ("value", "error"),
    [
        ([1.0], ValueError),
        ([1.0, 2.0, 3.0], ValueError),
        (np.zeros((2, 2)), ValueError),
        ([], ValueError),
        (1.0, TypeError),
        (None, TypeError),
        ("ab", TypeError),
        (["1", "2"], TypeError),
        ([1.0, 1j], TypeError),
        ([1.0, None], TypeError),
    ],
)
def test_callable_returns_something_else(
    run: Callable[..., bd.Result], value: Any, error: type[Exception]
) -> None:
    calls = []

    def torque(t: float, theta: Any, omega: Any) -> Any:
        calls.append(t)
        return value

    with pytest.raises(error, match="2 torques, one per pulley"):
        run(torque)
    assert calls == [0.0], "refused at the first call"


def test_not_finite_torque_stops_the_run(run: Callable[..., bd.Result]) -> None:
    with pytest.raises(bd.SimulationError, match="pulley 1 is nan") as caught:
        run(lambda t, theta, omega: [0.0, np.nan])
    assert caught.value.pulley == 1
    assert caught.value.result is not None


def test_exceptions_of_a_callable_come_out_unchanged(run: Callable[..., bd.Result]) -> None:
    class Mine(Exception):
        pass

    mine = Mine("from the torque")

    def torque(t: float, theta: Any, omega: Any) -> Any:
        if t > T_END / 2:
            raise mine
        return [0.0, 0.0]

    with pytest.raises(Mine) as caught:
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
    "cffi": lambda: cffi.FFI().cast("double (*)(double)", address()),
    "cffi void *": lambda: cffi.FFI().cast("void *", address()),
    "numba": lambda: numba.cfunc(numba.types.double(numba.types.double))(lambda x: x),
    "LowLevel": lambda: LowLevelCallable(OTHERS["ctypes few"]()),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_compiled_with_another_signature(kind: str, run: Callable[..., bd.Result]) -> None:
    with pytest.raises(TypeError, match=r"^torque_fn must be compiled as void f\(double t, "):
        run(OTHERS[kind]())


def test_null_pointer(run: Callable[..., bd.Result]) -> None:
    with pytest.raises(ValueError, match="must not be a null pointer"):
        run(PROTOTYPE())
