"""Torques that the C core evaluates itself, and other objects that can be used as torques.

All torques are the set torques M_d of (2.12), counter-clockwise positive, one per pulley [N m].
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import attrs
import numpy as np
from numpy.typing import ArrayLike

from . import _core
from .checks import Array, real_array, refuse_masked

__all__ = ["PiecewiseLinear", "Torque", "TorqueLike", "TorqueSum", "Viscous", "as_terms"]

#: A torque object, ``f(t, theta, omega) -> n_p values``, or a compiled C function.
TorqueLike: TypeAlias = "Torque | Callable[[float, Array, Array], ArrayLike] | Any"

_EQUAL = attrs.cmp_using(eq=np.array_equal)
_SIGNATURE = "void f(double t, double *theta, double *omega, double *torque, void *user)"


class Torque:
    """Base class of the torques that the C core evaluates itself; ``+`` adds them.

    They can also be called like any torque function, and then give the numbers of the core.
    """

    __slots__ = ()

    @property
    def n_pulleys(self) -> int:
        """Number of pulleys it acts on, n_p."""
        raise NotImplementedError

    def terms(self) -> list[_core.TorqueTerm]:
        """Give the terms the C core evaluates."""
        raise NotImplementedError

    def __call__(self, t: float, theta: ArrayLike, omega: ArrayLike) -> Array:
        """Give the torques (n_p,) [N m] at a time, for angles and speeds (n_p,)."""
        raise NotImplementedError

    def __add__(self, other: object) -> TorqueSum:
        if not isinstance(other, Torque):
            return NotImplemented
        return TorqueSum([*_parts(self), *_parts(other)])


def _parts(torque: Torque) -> Sequence[Torque]:
    return torque.parts if isinstance(torque, TorqueSum) else (torque,)


def _times(value: ArrayLike) -> Array:
    t = real_array("PiecewiseLinear.t", value, ndim=1)
    if t.size == 0:
        raise ValueError("PiecewiseLinear.t must hold at least one time")
    if (np.diff(t) < 0.0).any():
        k = int(np.argmax(np.diff(t) < 0.0))
        raise ValueError(
            f"PiecewiseLinear.t must be non-decreasing, got {t[k]:g} s before {t[k + 1]:g} s"
        )
    if (t[2:] == t[:-2]).any():
        k = int(np.argmax(t[2:] == t[:-2]))
        raise ValueError(
            f"PiecewiseLinear.t must hold a time at most twice (a jump), got {t[k]:g} s three times"
        )
    return t


def _values(value: ArrayLike) -> Array:
    refuse_masked("PiecewiseLinear.values", value)
    try:
        of_one_pulley = np.ndim(value) == 1
    except ValueError:  # rows of different lengths
        of_one_pulley = False
    if not of_one_pulley:
        return real_array("PiecewiseLinear.values", value, ndim=2)
    return real_array("PiecewiseLinear.values", value, ndim=1)[:, None]


@attrs.frozen(repr=False)
class PiecewiseLinear(Torque):
    """Values given at times, linear between them, constant before the first and after the last.

    Torques, or, for one pulley, the speed of a prescribed motion (:func:`beltdyn.simulate`).

    The paper's driving torque of case 1 on two pulleys: ``PiecewiseLinear([0, 0.3],
    [[0, 0], [-100, 0]])``.

    Attributes:
        t: Times (n_t,) [s], non-decreasing; a time given twice is a jump.
        values: Torques (n_t, n_p) [N m], or speeds (n_t, 1) [rad/s]. For one pulley they may be
            given as (n_t,).

    Raises:
        TypeError: Not real numbers.
        ValueError: A rule is broken; the message names field and rule.
    """

    t: Array = attrs.field(converter=_times, eq=_EQUAL)
    values: Array = attrs.field(converter=_values, eq=_EQUAL)

    @values.validator
    def _check_values(self, _field: attrs.Attribute[Array], values: Array) -> None:
        if values.shape[0] != self.t.size or values.shape[1] == 0:
            raise ValueError(
                "PiecewiseLinear.values must have shape (n_t, n_p) = "
                f"({self.t.size}, n_p), got {values.shape}"
            )

    @property
    def n_pulleys(self) -> int:
        """Number of pulleys, the columns of ``values``."""
        return int(self.values.shape[1])

    def terms(self) -> list[_core.TorqueTerm]:
        """Give its one term."""
        return [("piecewise", self.t, self.values)]

    def __call__(self, t: float, theta: ArrayLike, omega: ArrayLike) -> Array:
        """Interpolate; at a jump the value after it."""
        k = int(np.searchsorted(self.t, t, side="right"))
        if k == 0 or k == self.t.size:
            return np.array(self.values[max(k - 1, 0)])
        share = (t - self.t[k - 1]) / (self.t[k] - self.t[k - 1])
        return np.asarray(self.values[k - 1] + share * (self.values[k] - self.values[k - 1]))

    def __reduce__(self) -> tuple[Any, ...]:
        # Through the constructor, so that a copy is checked and immutable as well.
        return type(self), (self.t, self.values)

    def __repr__(self) -> str:
        return f"PiecewiseLinear(t={self.t.tolist()}, values={self.values.tolist()})"

    def __str__(self) -> str:
        return (
            f"piecewise linear, {self.t.size} time(s) from {self.t[0]:g} to {self.t[-1]:g} s, "
            f"{self.n_pulleys} pulley(s), {self.values.min():g} to {self.values.max():g} N m"
        )


def _coefficients(value: ArrayLike) -> Array:
    coefficients = real_array("Viscous.coefficients", value, ndim=1)
    if coefficients.size == 0:
        raise ValueError("Viscous.coefficients must hold one value per pulley, got none")
    return coefficients


@attrs.frozen(repr=False)
class Viscous(Torque):
    """A torque against the motion, -coefficient_j omega_j; (2.13) of the paper has 100/(2 pi).

    Attributes:
        coefficients: One per pulley (n_p,) [N m s/rad]; negative ones drive.

    Raises:
        TypeError: Not real numbers.
        ValueError: A rule is broken; the message names field and rule.
    """

    coefficients: Array = attrs.field(converter=_coefficients, eq=_EQUAL)

    @property
    def n_pulleys(self) -> int:
        """Number of pulleys, the length of ``coefficients``."""
        return self.coefficients.size

    def terms(self) -> list[_core.TorqueTerm]:
        """Give its one term."""
        return [("viscous", self.coefficients)]

    def __call__(self, t: float, theta: ArrayLike, omega: ArrayLike) -> Array:
        """Give -coefficient_j omega_j."""
        return np.asarray(-self.coefficients * np.asarray(omega))

    def __reduce__(self) -> tuple[Any, ...]:
        # Through the constructor, so that a copy is checked and immutable as well.
        return type(self), (self.coefficients,)

    def __repr__(self) -> str:
        return f"Viscous(coefficients={self.coefficients.tolist()})"

    def __str__(self) -> str:
        values = ", ".join(f"{value:g}" for value in self.coefficients)
        return f"viscous, coefficients ({values}) N m s/rad"


def _summands(value: Sequence[Torque]) -> tuple[Torque, ...]:
    parts = tuple(value)
    if not parts:
        raise ValueError("torque must hold at least one torque")
    for k, part in enumerate(parts):
        if not isinstance(part, Torque):
            raise TypeError(f"torque[{k}] must be a torque object, got {part!r}")
        if part.n_pulleys != parts[0].n_pulleys:
            raise ValueError(
                f"torque[{k}] must be for {parts[0].n_pulleys} pulley(s) like the first, "
                f"got one for {part.n_pulleys}"
            )
    return parts


@attrs.frozen(repr=False)
class TorqueSum(Torque):
    """A sum of torque objects, as ``+`` makes it.

    Attributes:
        parts: The summands, all for the same number of pulleys.

    Raises:
        TypeError, ValueError: A summand is not a torque object, or has another number of pulleys.
    """

    parts: tuple[Torque, ...] = attrs.field(converter=_summands)

    @property
    def n_pulleys(self) -> int:
        """Number of pulleys of every part."""
        return self.parts[0].n_pulleys

    def terms(self) -> list[_core.TorqueTerm]:
        """Give the terms of all parts."""
        return [term for part in self.parts for term in part.terms()]

    def __call__(self, t: float, theta: ArrayLike, omega: ArrayLike) -> Array:
        """Add up the parts."""
        return np.asarray(sum(part(t, theta, omega) for part in self.parts))

    def __repr__(self) -> str:
        return " + ".join(map(repr, self.parts))

    def __str__(self) -> str:
        return "\n+ ".join(map(str, self.parts))


def as_terms(torque_fn: TorqueLike, n_pulleys: int) -> list[_core.TorqueTerm]:
    """Turn anything a user may pass as torque into terms for the C core.

    Compiled functions are passed as addresses: the caller must keep ``torque_fn`` alive.

    Args:
        torque_fn: A torque object; a compiled function (ctypes, cffi, Numba ``cfunc``, SciPy's
            ``LowLevelCallable``) ``void f(double t, const double *theta, const double *omega,
            double *torque, void *user)``; or a Python callable ``f(t, theta, omega)`` returning
            n_p values.
        n_pulleys: Number of pulleys, n_p.

    Raises:
        TypeError: None of these, or a compiled function with another signature.
        ValueError: A torque object for another number of pulleys.
    """
    if isinstance(torque_fn, Torque):
        if torque_fn.n_pulleys != n_pulleys:
            raise ValueError(
                f"torque_fn must give one torque for each of the {n_pulleys} pulley(s), "
                f"got a torque for {torque_fn.n_pulleys}"
            )
        return torque_fn.terms()
    compiled = _compiled(torque_fn)
    if compiled is not None:
        return [("function", *compiled)]
    if callable(torque_fn):
        return [("call", torque_fn)]
    raise TypeError(
        "torque_fn must be callable as f(t, theta, omega), a torque object or a compiled function, "
        f"got {torque_fn!r}"
    )


def _compiled(function: Any) -> tuple[int, int] | None:
    """Addresses of a compiled function and of its user data; None if it is not compiled."""
    if _is_cffi(function):
        return _cffi_function(function), 0
    if isinstance(function, ctypes._CFuncPtr):  # type: ignore[attr-defined]
        return _ctypes_function(function), 0
    if type(function).__name__ == "PyCapsule":
        return _capsule_function(function), 0
    if type(function).__module__.partition(".")[0] == "numba" and hasattr(function, "address"):
        return _ctypes_function(function.ctypes), 0
    if type(function).__name__ == "LowLevelCallable" and isinstance(function, tuple):
        inner = _compiled(function.function)  # type: ignore[attr-defined]
        if inner is None:
            raise TypeError(f"torque_fn: no compiled function in {function!r}")
        return inner[0], _user_data(function.user_data)  # type: ignore[attr-defined]
    return None


def _wrong(found: str) -> TypeError:
    return TypeError(f"torque_fn must be compiled as {_SIGNATURE}, got {found}")


def _ctypes_function(function: Any) -> int:
    kinds = function.argtypes
    # Functions of a library carry no types until the user sets them.
    if kinds is not None:
        pointers = (ctypes.POINTER(ctypes.c_double), ctypes.c_void_p)
        fits = (
            function.restype is None
            and len(kinds) == 5
            and kinds[0] is ctypes.c_double
            and all(kind in pointers for kind in kinds[1:4])
            and issubclass(kinds[4], (ctypes.c_void_p, ctypes._Pointer))
        )
        if not fits:
            names = ", ".join(kind.__name__ for kind in kinds)
            raise _wrong(f"argtypes ({names}) and restype {function.restype}")
    address = ctypes.cast(function, ctypes.c_void_p).value
    if not address:
        raise ValueError("torque_fn must not be a null pointer")
    return address


def _is_cffi(thing: Any) -> bool:
    backend = sys.modules.get("_cffi_backend")
    return backend is not None and isinstance(thing, backend._CDataBase)


def _cffi_address(pointer: Any) -> int:
    return int(sys.modules["_cffi_backend"].FFI().cast("uintptr_t", pointer))


def _cffi_function(function: Any) -> int:
    kind = sys.modules["_cffi_backend"].typeof(function)
    fits = (
        kind.kind == "function"
        and kind.result.kind == "void"
        and len(kind.args) == 5
        and kind.args[0].cname == "double"
        and all(arg.cname in ("double *", "void *") for arg in kind.args[1:4])
        and kind.args[4].kind == "pointer"
    )
    if not fits:
        raise _wrong(kind.cname)
    return _cffi_address(function)


def _capsule(capsule: Any) -> tuple[int, str | None]:
    """Address and name of a PyCapsule."""
    name_of = ctypes.pythonapi.PyCapsule_GetName
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    name = name_of(capsule)
    return pointer_of(capsule, name), None if name is None else name.decode()


def _capsule_function(capsule: Any) -> int:
    address, name = _capsule(capsule)
    # SciPy's convention: the name of a capsule is the signature.
    squeezed = (name or "").replace("const", "").replace(" ", "")
    if squeezed != "void(double,double*,double*,double*,void*)":
        raise _wrong(f"a capsule named {name!r}")
    return address


def _user_data(data: Any) -> int:
    if data is None:
        return 0
    if isinstance(data, ctypes.c_void_p):
        return data.value or 0
    if _is_cffi(data):
        return _cffi_address(data)
    return _capsule(data)[0]
