"""Torques that the C core evaluates itself, and other objects that can be used as torques.

All torques are the set torques M_d of (2.12), counter-clockwise positive, one per pulley [N m].
"""

from __future__ import annotations

import ctypes
import functools
import numbers
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Self, TypeAlias, cast

import attrs
import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..base.checks import Array, called_with, first_of, real, real_array, refuse_masked
from ..base.described import checked, ruled
from ..base.naming import PulleyLike, as_pulley, index_of, label, names_of

#: A torque object, ``f(t, theta, omega) -> n_p values``, or a compiled C function.
TorqueLike: TypeAlias = "Torque | Callable[[float, Array, Array], ArrayLike] | Any"

EQUAL = attrs.cmp_using(eq=np.array_equal)
_SIGNATURE = "void f(double t, double *theta, double *omega, double *torque, void *user)"
#: That in C, without names, spaces and "const".
_FORM = re.compile(r"void\(double(,(double|void)\*){3},[^,]+\*\)")


class Torque:
    """Base class of the torques that the C core evaluates itself.

    ``+`` adds them, ``*`` multiplies them by a number.

    They can also be called like any torque function and then return the values of the core, except
    for loads near zero speed, where the core smooths their sign.
    """

    __slots__ = ()

    @property
    def n_pulleys(self) -> int | None:
        """Number of pulleys it is for, n_p; None: it acts on a pulley that it names."""
        raise NotImplementedError

    def terms(self, pulleys: Sequence[str] | None = None) -> list[_core.TorqueTerm]:
        """Return the terms the C core evaluates.

        Args:
            pulleys: ``Params.pulley_names`` of the drive. May be left out if ``n_pulleys`` is
                known; none of the pulleys has a name then.

        Raises:
            TypeError: They are needed.
            ValueError: The torque is for another number of pulleys, or names one that is not there.
        """
        if pulleys is None:
            if self.n_pulleys is None:
                raise TypeError("terms() needs the pulleys' names where n_pulleys is None")
            pulleys = names_of([None] * self.n_pulleys)
        return self._terms(pulleys, "torque_fn")

    def _terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        """Return the terms; messages call the torque ``path``."""
        if self.n_pulleys is not None and self.n_pulleys != len(pulleys):
            raise ValueError(
                f"{path} must give one torque for each of the {len(pulleys)} pulley(s), "
                f"got a torque for {self.n_pulleys}"
            )
        return self._core_terms(pulleys, path)

    def _core_terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        raise NotImplementedError

    def __call__(self, t: float, theta: ArrayLike, omega: ArrayLike) -> Array:
        """Return the torques (n_p,) [N m] for angles and speeds (n_p,); at a jump those after it.

        Torques against a rotation of 0 are 0.
        """
        for part in _parts(self):
            for field in ("pulley", "of"):
                if isinstance(name := getattr(part, field, None), str):
                    raise ValueError(
                        f"{type(part).__name__}.{field} is the name {name!r}: give an index to "
                        "evaluate the torque without a drive"
                    )
        n_p = np.size(omega)
        terms = self._terms(names_of([None] * n_p), type(self).__name__)
        return _stand_in(n_p).torques(terms, (), t, t, theta, omega)[0]

    def _given(self) -> dict[str, Any]:
        cls: Any = type(self)
        return {field.name: getattr(self, field.name) for field in attrs.fields(cls)}

    def __reduce__(self) -> tuple[Any, ...]:
        # Through the constructor, so that a copy is checked and immutable as well.
        return functools.partial(type(self), **self._given()), ()

    def __repr__(self) -> str:
        given = ", ".join(
            f"{name}={value.tolist() if isinstance(value, np.ndarray) else value!r}"
            for name, value in self._given().items()
            if value is not None
        )
        return f"{type(self).__name__}({given})"

    def __add__(self, other: object) -> TorqueSum:
        if isinstance(other, Torque):
            return TorqueSum([*_parts(self), *_parts(other)])
        if callable(other):
            raise TypeError(
                "a function cannot be added to a torque object: give a function that returns the "
                "sum, such as lambda t, theta, omega: torque(t, theta, omega) + function(t, theta, "
                "omega)"
            )
        return NotImplemented

    __radd__ = __add__

    #: The fields in proportion to which the torque is.
    _in_proportion: ClassVar[tuple[str, ...]] = ()

    def __mul__(self, factor: object) -> Self:
        """Return this torque times a number, where all of it is in proportion to some fields."""
        if isinstance(factor, bool) or not isinstance(factor, numbers.Real):
            return NotImplemented
        return self._scaled(float(factor))

    def _scaled(self, factor: float) -> Self:
        if not self._in_proportion:
            raise TypeError(f"{type(self).__name__} cannot be multiplied by a number")
        owner: Any = self
        scaled = {name: factor * getattr(self, name) for name in self._in_proportion}
        multiplied: Self = attrs.evolve(owner, **scaled)
        return multiplied

    __rmul__ = __mul__


def _parts(torque: Torque) -> Sequence[Torque]:
    return torque.parts if isinstance(torque, TorqueSum) else (torque,)


@functools.lru_cache(maxsize=16)
def _stand_in(n_pulleys: int) -> _core.Model:
    """Return a drive to evaluate torques, with waves so slow that no sign is smooth."""
    ones, places = (1.0,) * n_pulleys, [(3.0 * k, 0.0) for k in range(n_pulleys)]
    belt = (1.0, 3, 1.0, 1e-100, 0.0, 0.0, 0.0)
    return _core.Model(belt, places, ones, ones, (0.0, 1.0, 0.0, 0, 0.0), None, (0.0, 0.0))


#: Checks of fields without a converter, by what they are declared as.
_CHECKS: dict[Any, Callable[[str, Any], Any]] = {"float": real, "PulleyLike": as_pulley}


def named(cls: type, fields: list[attrs.Attribute[Any]]) -> list[attrs.Attribute[Any]]:
    """Check fields by a converter of value and name, or by their type (a field transformer)."""
    ruled(cls, {})

    def with_check(field: attrs.Attribute[Any]) -> Any:
        name, given = f"{cls.__name__}.{field.name}", cast(Any, field.converter)
        by_type = cast(Any, _CHECKS.get(str(field.type).removesuffix(" | None")))
        if given is not None:
            return checked(field, lambda value: given(value, name))
        return field if by_type is None else checked(field, lambda value: by_type(name, value))

    return list(map(with_check, fields))


def as_row(value: ArrayLike | None, name: str = "value") -> Array:
    """Check numbers (n,)."""
    return real_array(name, value, ndim=1)


def _times(value: ArrayLike, name: str = "t") -> Array:
    t = real_array(name, value, ndim=1)
    if t.size == 0:
        raise ValueError(f"{name} must hold at least one time")
    if (k := first_of(np.diff(t) < 0.0)) is not None:
        raise ValueError(f"{name} must be non-decreasing, got {t[k]:g} s before {t[k + 1]:g} s")
    if (k := first_of(t[2:] == t[:-2])) is not None:
        raise ValueError(
            f"{name} must hold a time at most twice (a jump), got {t[k]:g} s three times"
        )
    return t


def _values(value: ArrayLike, name: str = "values") -> Array:
    refuse_masked(name, value)
    try:
        of_one_pulley = np.ndim(value) == 1
    except ValueError:  # rows of different lengths
        of_one_pulley = False
    values = real_array(name, value, ndim=1 if of_one_pulley else 2)
    return values[:, None] if of_one_pulley else values


@attrs.frozen(repr=False, field_transformer=named)
class PiecewiseLinear(Torque):
    """Values given at times, linear between them, constant before the first and after the last.

    Torques; or, for one pulley, the speed of a prescribed motion (:func:`beltdyn.simulate`), or the
    factor over time of a load.

    The paper's driving torque of case 1 on two pulleys: ``PiecewiseLinear([0, 0.3],
    [[0, 0], [-100, 0]])``, or ``PiecewiseLinear([0, 0.3], [0, -100], pulley=0)``.

    Attributes:
        t: Times (n_t,) [s], non-decreasing; a time given twice is a jump.
        values: Torques (n_t, n_p) [N m], or speeds (n_t, 1) [rad/s], or factors (n_t, 1). Of one
            column they may be given as (n_t,).
        pulley: Index or name of the pulley that ``values``, then of one column, are for; None: they
            are for all pulleys of the drive.
    """

    _in_proportion = ("values",)
    t: Array = attrs.field(converter=_times, eq=EQUAL)
    values: Array = attrs.field(converter=_values, eq=EQUAL)
    pulley: PulleyLike | None = attrs.field(default=None)

    def __attrs_post_init__(self) -> None:
        shape = self.values.shape
        if shape[0] != self.t.size or shape[1] == 0:
            raise ValueError(
                f"PiecewiseLinear.values must have shape (n_t, n_p) = ({self.t.size}, n_p), "
                f"got {shape}"
            )
        if self.pulley is not None and shape[1] != 1:
            raise ValueError(
                "PiecewiseLinear.values must have one column where the pulley is given, "
                f"got shape {shape}"
            )

    @property
    def n_pulleys(self) -> int | None:
        """Number of pulleys, the columns of ``values``; None: it acts on ``pulley``."""
        return int(self.values.shape[1]) if self.pulley is None else None

    def _core_terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        if self.pulley is None:
            return [("piecewise", self.t, self.values)]
        on_all = np.zeros((self.t.size, len(pulleys)))
        on_all[:, index_of(f"{path}.pulley", self.pulley, pulleys)] = self.values[:, 0]
        return [("piecewise", self.t, on_all)]

    def at(self, t: float) -> Array:
        """Interpolate the rows of ``values``; at a jump the row after it."""
        still = np.zeros(self.values.shape[1])
        return attrs.evolve(self, pulley=None)(t, still, still)

    def __str__(self) -> str:
        where = f"{self.n_pulleys} pulley(s)" if self.pulley is None else label(self.pulley, ())
        return self.described(f"{where}, ", "N m")

    def described(self, where: str, unit: str) -> str:
        """Describe in words how many times and which values there are, which may be no torques."""
        return (
            f"piecewise linear, {self.t.size} time(s) from {self.t[0]:g} to {self.t[-1]:g} s, "
            f"{where}{self.values.min():g} to {self.values.max():g} {unit}"
        )


def _coefficients(value: ArrayLike, name: str = "coefficients") -> Array:
    coefficients = as_row(value, name)
    if coefficients.size == 0:
        raise ValueError(f"{name} must hold one value per pulley, got none")
    return coefficients


@attrs.frozen(repr=False, field_transformer=named)
class Viscous(Torque):
    """A torque against the motion, -coefficient_j omega_j; (2.13) of the paper has 100/(2 pi).

    Attributes:
        coefficients: One per pulley (n_p,) [N m s/rad]; negative ones drive.
    """

    _in_proportion = ("coefficients",)
    coefficients: Array = attrs.field(converter=_coefficients, eq=EQUAL)

    @property
    def n_pulleys(self) -> int:
        """Number of pulleys, the length of ``coefficients``."""
        return self.coefficients.size

    def _core_terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        return [("viscous", self.coefficients)]

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
        first = _number_of(parts[:k])
        if first is not None and part.n_pulleys not in (None, first):
            raise ValueError(
                f"torque[{k}] must be for {first} pulley(s) like the first, "
                f"got one for {part.n_pulleys}"
            )
    return parts


def _number_of(parts: Sequence[Torque]) -> int | None:
    return next((part.n_pulleys for part in parts if part.n_pulleys is not None), None)


@attrs.frozen(repr=False)
class TorqueSum(Torque):
    """A sum of torque objects, as ``+`` makes it.

    Attributes:
        parts: The summands; those that are not for single pulleys are for the same number of them.

    Raises:
        TypeError, ValueError: A summand is not a torque object, or has another number of pulleys.
    """

    parts: tuple[Torque, ...] = attrs.field(converter=_summands)

    def _scaled(self, factor: float) -> TorqueSum:
        return TorqueSum([part * factor for part in self.parts])

    @property
    def n_pulleys(self) -> int | None:
        """Number of pulleys of the parts that are for all; None: all name single pulleys."""
        return _number_of(self.parts)

    def _core_terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        return [
            term
            for k, part in enumerate(self.parts)
            for term in part._terms(pulleys, f"{path}[{k}]")
        ]

    def __repr__(self) -> str:
        return " + ".join(map(repr, self.parts))

    def __str__(self) -> str:
        return "\n+ ".join(map(str, self.parts))


def as_terms(
    torque_fn: TorqueLike, pulleys: Sequence[str], path: str = "torque_fn"
) -> list[_core.TorqueTerm]:
    """Turn anything a user may pass as torque into terms for the C core.

    Compiled functions are passed as addresses: the caller must keep ``torque_fn`` alive.
    """
    if isinstance(torque_fn, Torque):
        return torque_fn._terms(pulleys, path)
    compiled = _compiled(torque_fn)
    if compiled is not None:
        return [("function", *compiled)]
    got = called_with(torque_fn, "t, theta, omega") if callable(torque_fn) else repr(torque_fn)
    if not got:
        return [("call", torque_fn)]
    raise TypeError(
        "torque_fn must be callable as f(t, theta, omega), which returns the torques of all "
        f"pulleys [N m], a torque object or a compiled function, got {got}"
        + f"; for none give bd.Viscous({[0.0] * len(pulleys)})"
        * (torque_fn is None)
    )


def _compiled(function: Any) -> tuple[int, int] | None:
    """Addresses of a compiled function and of its user data; None if it is not compiled."""
    if type(function).__name__ == "LowLevelCallable" and isinstance(function, tuple):
        inner = _compiled(function.function)  # type: ignore[attr-defined]
        if inner is None:
            raise TypeError(f"torque_fn: no compiled function in {function!r}")
        return inner[0], _user_data(function.user_data)  # type: ignore[attr-defined]
    if type(function).__module__.partition(".")[0] == "numba" and hasattr(function, "address"):
        function = function.ctypes
    if _is_cffi(function):
        signature = sys.modules["_cffi_backend"].typeof(function).cname
        address = _cffi_address(function)
    elif isinstance(function, ctypes._CFuncPtr):  # type: ignore[attr-defined]
        signature, address = _in_c(function), ctypes.cast(function, ctypes.c_void_p).value or 0
    elif type(function).__name__ == "PyCapsule":
        address, name = _capsule(function)
        signature = name or f"a capsule named {name!r}"  # SciPy's convention: it is the signature
    else:
        return None
    if signature and not _FORM.fullmatch(re.sub(r"\(\*\)|const|\s", "", signature)):
        raise TypeError(f"torque_fn must be compiled as {_SIGNATURE}, got {signature}")
    if not address:
        raise ValueError("torque_fn must not be a null pointer")
    return address, 0


def _in_c(kind: Any) -> str:
    """Write a type of ctypes, or the signature of a function, in C; "" of one without types."""
    if isinstance(kind, ctypes._CFuncPtr):  # type: ignore[attr-defined]
        # Functions of a library carry no types until the user sets them.
        takes = kind.argtypes
        return "" if takes is None else f"{_in_c(kind.restype)}({', '.join(map(_in_c, takes))})"
    if kind is not None and issubclass(kind, ctypes._Pointer):
        return f"{_in_c(kind._type_)} *"
    plain = {None: "void", ctypes.c_double: "double", ctypes.c_void_p: "void *"}
    return plain[kind] if kind in plain else str(kind.__name__)


def _is_cffi(thing: Any) -> bool:
    backend = sys.modules.get("_cffi_backend")
    return backend is not None and isinstance(thing, backend._CDataBase)


def _cffi_address(pointer: Any) -> int:
    return int(sys.modules["_cffi_backend"].FFI().cast("uintptr_t", pointer))


def _capsule(capsule: Any) -> tuple[int, str | None]:
    """Address and name of a PyCapsule."""
    name_of = ctypes.pythonapi.PyCapsule_GetName
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    name = name_of(capsule)
    return pointer_of(capsule, name), None if name is None else name.decode()


def _user_data(data: Any) -> int:
    if data is None:
        return 0
    if isinstance(data, ctypes.c_void_p):
        return data.value or 0
    if _is_cffi(data):
        return _cffi_address(data)
    return _capsule(data)[0]
