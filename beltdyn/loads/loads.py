"""Loads and other torques on single pulleys, which the C core evaluates itself.

Each acts on one pulley, given by its index or its name, and they are added with ``+``, to one
another and to torques on all pulleys. Torques that resist the rotation have positive
numbers, others are counter-clockwise positive (MODEL section 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array, first_of, pair, real, shown
from ..base.naming import PulleyLike, index_of, label
from .torques import EQUAL, PiecewiseLinear, Torque, as_row, named


def _resisting(value: float, name: str = "value") -> float:
    number = real(name, value)
    if number < 0.0:
        raise ValueError(f"{name} must be >= 0, for it acts against the rotation, got {number:g}")
    return number


def _factor(value: PiecewiseLinear, name: str = "factor") -> PiecewiseLinear:
    if not isinstance(value, PiecewiseLinear):
        raise TypeError(f"{name} must be a PiecewiseLinear of factors, got {shown(value)}")
    if value.pulley is not None or value.values.shape[1] != 1:
        raise ValueError(f"{name} must have one value per time and name no pulley")
    return value


def _loading(value: PiecewiseLinear, name: str = "factor") -> PiecewiseLinear:
    if (_factor(value, name).values < 0.0).any():
        raise ValueError(
            f"{name} must be >= 0: a load turned round drives a pulley that turns and does nothing "
            "to one at rest, which so never starts; what drives is a Motor"
        )
    return value


def interval(value: Sequence[float] | None, name: str = "interval") -> tuple[float, float]:
    """Check beginning and end of an interval of time [s]."""
    begin, end = pair(name, value, "s")
    if not end > begin:
        raise ValueError(f"{name} must end after it begins, got {begin:g} s and {end:g} s")
    return begin, end


def _ramp(value: float | Sequence[float] | None, name: str = "ramp") -> tuple[float, float]:
    given: Any = value
    return interval(given if np.ndim(given) else (0.0, real(name, given, "s")), name)


def harmonic_fields(owner: Any) -> None:
    """Check orders, amplitudes and phases; no phases are zeros."""
    name, n = type(owner).__name__, owner.orders.size
    if owner.phases is None:
        object.__setattr__(owner, "phases", as_row(np.zeros(n)))
    if n == 0:
        raise ValueError(f"{name}.orders must hold at least one order")
    if (k := first_of(owner.orders <= 0.0)) is not None:
        raise ValueError(f"{name}.orders must be > 0, got {owner.orders[k]:g} at [{k}]")
    for field in ("amplitudes", "phases"):
        if getattr(owner, field).size != n:
            raise ValueError(
                f"{name}.{field} must have one value for each of the {n} order(s), "
                f"got {getattr(owner, field).size}"
            )


class _OnOnePulley(Torque):
    """Base of torques on one pulley, with a factor over time."""

    __slots__ = ()
    #: Name in texts, and of its term in the core.
    _noun: ClassVar[str]
    _term: ClassVar[str]
    pulley: PulleyLike
    factor: PiecewiseLinear | None

    @property
    def n_pulleys(self) -> None:
        """None: it acts on ``pulley``, in a drive of any number of pulleys."""
        return None

    def _numbers(self, pulleys: Sequence[str], path: str) -> tuple[Any, ...]:
        """Return what stands in its term between pulley and factor."""
        raise NotImplementedError

    def _words(self) -> str:
        """Return what its text says after the pulley."""
        raise NotImplementedError

    def _over_time(self) -> PiecewiseLinear | None:
        return self.factor

    def _core_terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        index, factor = index_of(f"{path}.pulley", self.pulley, pulleys), self._over_time()
        times = None if factor is None else (factor.t, factor.values[:, 0])
        return [(self._term, index, *self._numbers(pulleys, path), times)]

    def __str__(self) -> str:
        text, factor = f"{self._noun} on {label(self.pulley, ())}{self._words()}", self._over_time()
        if factor is None:
            return text
        t, values = factor.t, factor.values
        return f"{text}, times {values.min():g} to {values.max():g} from {t[0]:g} to {t[-1]:g} s"


class _OverSpeed(_OnOnePulley):
    """A torque from a table over the speed of its pulley."""

    __slots__ = ()
    _points: ClassVar[str]
    omega: Array
    torque: Array

    def _check_points(self) -> None:
        name, omega, torque = type(self).__name__, self.omega, self.torque
        if torque.size != omega.size:
            raise ValueError(
                f"{name}.torque must have one value for each of the {omega.size} speed(s), "
                f"got {torque.size}"
            )
        if (k := first_of(np.diff(omega) <= 0.0)) is not None:
            raise ValueError(
                f"{name}.omega must be increasing, got {omega[k]:g} rad/s before {omega[k + 1]:g}"
            )

    def _numbers(self, _pulleys: Sequence[str], _path: str) -> tuple[Any, ...]:
        return self.omega, self.torque

    def _words(self) -> str:
        omega, torque = self.omega, self.torque
        return (
            f" over its speed, {omega.size} {self._points} from {omega[0]:g} to {omega[-1]:g} "
            f"rad/s, {torque.min():g} to {torque.max():g} N m"
        )


@attrs.frozen(repr=False, field_transformer=named)
class Load(_OnOnePulley):
    """A load that resists the rotation of a pulley, in either direction.

    At the speed omega its torque is ``-(coulomb s + viscous omega + quadratic omega |omega|)``,
    with the sign s of omega made smooth as that of bearing drag (:class:`beltdyn.Drag`): it changes
    sign within ``params.info["drag_speed"]`` at the rim, so that a pulley at rest under a smaller
    torque is not locked but creeps. ``Load(1, quadratic=2e-4)`` is a fan.

    Attributes:
        pulley: Index or name of the pulley.
        coulomb: Part that does not depend on speed [N m], >= 0.
        viscous: Part in proportion to speed [N m s/rad], >= 0.
        quadratic: Part in proportion to speed squared [N m s^2/rad^2], >= 0.
        factor: Factor over time, >= 0, a :class:`PiecewiseLinear` of one value per time, to switch
            the load: ``PiecewiseLinear([0.2, 0.25], [0, 1])``; None: 1.
    """

    _noun, _term = "load", "load"
    _in_proportion = ("coulomb", "viscous", "quadratic")
    pulley: PulleyLike
    coulomb: float = attrs.field(default=0.0, converter=_resisting, kw_only=True)
    viscous: float = attrs.field(default=0.0, converter=_resisting, kw_only=True)
    quadratic: float = attrs.field(default=0.0, converter=_resisting, kw_only=True)
    factor: PiecewiseLinear | None = attrs.field(default=None, converter=_loading, kw_only=True)

    def _numbers(self, _pulleys: Sequence[str], _path: str) -> tuple[Any, ...]:
        return ([self.coulomb, self.viscous, self.quadratic],)

    def _words(self) -> str:
        parts = [
            f"{name} {getattr(self, name):g} {unit}"
            for name, unit in (
                ("coulomb", "N m"),
                ("viscous", "N m s/rad"),
                ("quadratic", "N m s^2/rad^2"),
            )
            if getattr(self, name) != 0.0
        ]
        return f", {', '.join(parts) or 'none'}"


@attrs.frozen(repr=False, field_transformer=named)
class SpeedTable(_OverSpeed):
    """The load torque of an accessory over its speed, from a table: alternator, pump, compressor.

    At the speed omega its torque is ``-s M(|omega|)``: it resists the rotation in either direction,
    with the smooth sign s of :class:`Load`. M is linear between the points of the table, and
    constant below the first and above the last. The run warns of a pulley that turns more than 1 %
    faster than the last point (``beyond_table``). For a torque that drives, also from rest, use
    :class:`Motor`.

    Attributes:
        pulley: Index or name of the pulley.
        omega: Speeds, magnitudes (n,) [rad/s], >= 0 and increasing.
        torque: Torque that the accessory takes at these speeds (n,) [N m], >= 0.
        factor: Factor over time, as in :class:`Load`; None: 1.
    """

    _noun, _term, _points = "load", "table", "point(s)"
    _in_proportion = ("torque",)
    pulley: PulleyLike
    omega: Array = attrs.field(converter=as_row, eq=EQUAL)
    torque: Array = attrs.field(converter=as_row, eq=EQUAL)
    factor: PiecewiseLinear | None = attrs.field(default=None, converter=_loading, kw_only=True)

    def __attrs_post_init__(self) -> None:
        if self.omega.size == 0:
            raise ValueError("SpeedTable.omega must hold at least one speed")
        for name, values in (("omega", self.omega), ("torque", self.torque)):
            if (k := first_of(values < 0.0)) is not None:
                raise ValueError(
                    f"SpeedTable.{name} must be >= 0, for the table holds magnitudes of torques "
                    f"against the rotation, got {values[k]:g} at [{k}]"
                )
        self._check_points()


@attrs.frozen(repr=False, field_transformer=named)
class Motor(_OverSpeed):
    """The torque of a motor over the speed of its pulley, from a table; at rest too, so it starts.

    Speeds and torques are counter-clockwise positive, each of either sign: torque with the speed
    drives, torque against it brakes. Linear between the points of the table, constant below the
    first and above the last, beyond which the run warns (``beyond_table``). An induction motor of
    1500 1/min that turns clockwise, with starting, breakdown and rated torque, none at 157 rad/s
    and braking beyond it, switched on within 0.2 s::

        bd.Motor("crank", [-165, -157, -150, -120, 0], [12, 0, -10, -25, -18], ramp=0.2)

    Attributes:
        pulley: Index or name of the pulley.
        omega: Speeds (n,) [rad/s], n >= 2, increasing, of either sign.
        torque: Torque at these speeds (n,) [N m], of either sign.
        ramp: Time, from 0, in which the torque rises from zero to that of the table [s], or (begin,
            end) of the rise; None: it is there from the beginning.
        factor: Factor over time, as in :class:`Load` but of either sign, in place of ``ramp``.
    """

    _noun, _term, _points = "motor", "curve", "points"
    _in_proportion = ("torque",)
    pulley: PulleyLike
    omega: Array = attrs.field(converter=as_row, eq=EQUAL)
    torque: Array = attrs.field(converter=as_row, eq=EQUAL)
    ramp: tuple[float, float] | None = attrs.field(default=None, converter=_ramp, kw_only=True)
    factor: PiecewiseLinear | None = attrs.field(default=None, converter=_factor, kw_only=True)

    def __attrs_post_init__(self) -> None:
        if self.omega.size < 2:
            raise ValueError(
                f"Motor.omega must hold at least two speeds, got {self.omega.size}: a torque "
                "that does not depend on speed is a Ramp or a Step"
            )
        self._check_points()
        if self.ramp is not None and self.factor is not None:
            raise ValueError("Motor.ramp and Motor.factor are both given: put the rise in factor")

    def _over_time(self) -> PiecewiseLinear | None:
        return self.factor if self.ramp is None else PiecewiseLinear(self.ramp, [0.0, 1.0])


@attrs.frozen(repr=False, field_transformer=named)
class Harmonics(_OnOnePulley):
    """A torque that depends on an angle: ``sum_k amplitudes[k] cos(orders[k] theta + phases[k])``.

    theta is the angle of a pulley: gas and inertia torques of an engine over its crank, the torque
    of a compressor over its own shaft. Steps are no longer than half the period of the highest
    order.

    Attributes:
        pulley: Index or name of the pulley on which it acts.
        orders: Orders (n,), periods per revolution, real numbers > 0.
        amplitudes: Amplitudes (n,) [N m].
        phases: Phases (n,) [rad]; None: zeros.
        of: Index or name of the pulley whose angle counts; None: that on which it acts.
        factor: Factor over time, as in :class:`Load`; None: 1.
    """

    _noun, _term = "harmonics", "harmonics"
    _in_proportion = ("amplitudes",)
    pulley: PulleyLike
    orders: Array = attrs.field(converter=as_row, eq=EQUAL)
    amplitudes: Array = attrs.field(converter=as_row, eq=EQUAL)
    phases: Array = attrs.field(default=None, converter=as_row, eq=EQUAL)
    of: PulleyLike | None = attrs.field(default=None, kw_only=True)
    factor: PiecewiseLinear | None = attrs.field(default=None, converter=_factor, kw_only=True)

    def __attrs_post_init__(self) -> None:
        harmonic_fields(self)

    @property
    def _over(self) -> PulleyLike:
        return self.pulley if self.of is None else self.of

    def _numbers(self, pulleys: Sequence[str], path: str) -> tuple[Any, ...]:
        of = index_of(f"{path}.of", self._over, pulleys)
        return of, self.orders, self.amplitudes, self.phases

    def _words(self) -> str:
        orders = ", ".join(f"{order:g}" for order in self.orders)
        most = np.abs(self.amplitudes).max()
        return f" over the angle of {label(self._over, ())}, orders {orders}, up to {most:g} N m"


class _OverTime(_OnOnePulley):
    """A torque on one pulley that is a function of time alone."""

    __slots__ = ()
    factor = None

    def _history(self) -> PiecewiseLinear:
        raise NotImplementedError

    def _core_terms(self, pulleys: Sequence[str], path: str) -> list[_core.TorqueTerm]:
        return self._history()._core_terms(pulleys, path)


@attrs.frozen(repr=False, field_transformer=named)
class Step(_OverTime):
    """A torque on one pulley that is there from a time on: 0 before, ``torque`` after it.

    Attributes:
        pulley: Index or name of the pulley.
        t: Time of the jump [s].
        torque: Torque after it, counter-clockwise [N m].
    """

    _noun = "step"
    _in_proportion = ("torque",)
    pulley: PulleyLike
    t: float
    torque: float

    def _history(self) -> PiecewiseLinear:
        return PiecewiseLinear([self.t, self.t], [0.0, self.torque], self.pulley)

    def _words(self) -> str:
        return f", {self.torque:g} N m from {self.t:g} s on"


@attrs.frozen(repr=False, field_transformer=named)
class Ramp(_OverTime):
    """A torque on one pulley that rises linearly: 0 before, ``torque`` after it.

    Attributes:
        pulley: Index or name of the pulley.
        t_begin: Time at which it begins to rise [s].
        t_end: Time from which on it is ``torque`` [s], after ``t_begin``.
        torque: Torque in the end, counter-clockwise [N m].
    """

    _noun = "ramp"
    _in_proportion = ("torque",)
    pulley: PulleyLike
    t_begin: float
    t_end: float
    torque: float

    def __attrs_post_init__(self) -> None:
        if self.t_end <= self.t_begin:
            raise ValueError(
                f"Ramp.t_end must be > t_begin ({self.t_begin:g} s), got {self.t_end:g} s"
                + (": a jump is a Step" if self.t_end == self.t_begin else "")
            )

    def _history(self) -> PiecewiseLinear:
        return PiecewiseLinear([self.t_begin, self.t_end], [0.0, self.torque], self.pulley)

    def _words(self) -> str:
        return f", to {self.torque:g} N m from {self.t_begin:g} to {self.t_end:g} s"
