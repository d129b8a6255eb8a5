"""Prescribed motion of pulleys: their speeds or angles as functions of time (MODEL section 5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import attrs
import numpy as np

from . import _core
from .checks import Array, pair, real, shown
from .loads import EQUAL, as_row, as_row_or_none, harmonic_fields, named
from .naming import ByPulley, by_index, key, label
from .torques import PiecewiseLinear, Torque

__all__ = [
    "CrankMotion",
    "Motion",
    "MotionLike",
    "as_motions",
    "described",
    "first_speeds",
    "in_core",
    "motion_terms",
]

#: A motion; a :class:`PiecewiseLinear` with one value per time or a function is a speed.
MotionLike: TypeAlias = "Motion | CrankMotion | PiecewiseLinear | Callable[[float], float]"

#: Weights of values one step apart in the derivative at the first: order 6, as in the core.
_FORWARD = np.array([-147.0, 360.0, -450.0, 400.0, -225.0, 72.0, -10.0]) / 60.0
_STEP = 5e-5


def _check_speed(name: str, value: object) -> None:
    if isinstance(value, PiecewiseLinear):
        if value.pulley is not None:
            raise ValueError(f"{name} must not name a pulley: the motion does")
        if value.n_pulleys != 1:
            raise ValueError(
                f"{name} must have one value per time, got values of shape {value.values.shape}"
            )
        if (np.diff(value.t) == 0.0).any():
            k = int(np.argmax(np.diff(value.t) == 0.0))
            raise ValueError(
                f"{name} must not jump, for a pulley's speed cannot: it holds the time "
                f"{value.t[k]:g} s twice"
            )
    elif isinstance(value, Torque) or not callable(value):
        raise TypeError(
            f"{name} must be a PiecewiseLinear with one value per time, a function f(t), a Motion "
            f"or a CrankMotion, got {shown(value)}"
        )


@attrs.frozen(kw_only=True)
class Motion:
    """The prescribed motion of a pulley, given by its speed or by its angle.

    ``Motion(angle=lambda t: 0.1 * math.sin(50.0 * t))``. Functions are called with a time within
    the run and return a number. They must depend on time alone, for they are called several times
    round each time, and be smooth but at the run's ``breakpoints``: their derivatives, which the
    torque needs, are differences over 0.3 ms.

    Attributes:
        speed: Angular velocity, counter-clockwise [rad/s]: a :class:`PiecewiseLinear` with one
            value per time, without jumps, or a function of time [s].
        angle: Angle [rad] as a function of time [s], of which the changes count: the pulley begins
            at the angle that it has.

    Raises:
        TypeError: Neither or both are given, or one of the wrong kind.
        ValueError: A speed that jumps; an angle that is a PiecewiseLinear, whose speed would.
    """

    speed: PiecewiseLinear | Callable[[float], float] | None = None
    angle: Callable[[float], float] | None = None

    def __attrs_post_init__(self) -> None:
        if (self.speed is None) == (self.angle is None):
            raise TypeError("Motion takes either speed or angle")
        if self.speed is not None:
            _check_speed("Motion.speed", self.speed)
        elif isinstance(self.angle, PiecewiseLinear):
            raise ValueError(
                "Motion.angle must not be a PiecewiseLinear, for the speed would jump at its times"
                ": give the speed, or a smooth function of time"
            )
        elif isinstance(self.angle, Torque) or not callable(self.angle):
            raise TypeError(f"Motion.angle must be a function f(t), got {shown(self.angle)}")


def _mean_speed(value: float | PiecewiseLinear, name: str = "speed") -> PiecewiseLinear:
    if isinstance(value, PiecewiseLinear):
        _check_speed(name, value)
        return value
    if callable(value):
        raise TypeError(
            f"{name} must be a number or a PiecewiseLinear, got a function: give the "
            "angle of the whole motion as a function, Motion(angle=...)"
        )
    return PiecewiseLinear([0.0], [real(name, value, "rad/s")])


def _listed(values: Array) -> str:
    return repr(values.tolist())


def _fade(value: Sequence[float] | None, name: str = "fade") -> tuple[float, float] | None:
    if value is None:
        return None
    begin, end = pair(name, value, "s")
    if end <= begin:
        raise ValueError(f"{name} must end after it begins, got {begin:g} s and {end:g} s")
    return begin, end


@attrs.frozen(field_transformer=named)
class CrankMotion:
    """The prescribed motion of a crank that turns unevenly: a mean speed, and harmonics.

    The angle is ``theta_m + f sum_k amplitudes[k] cos(orders[k] theta_m + phases[k])`` [rad]: round
    the angle theta_m(t) that follows from the mean speed, 0 at the first time of ``speed`` (at t =
    0 of a number), it fluctuates by harmonics of that angle, whatever the speed. An amplitude that
    is known as one of the speed, dw at the mean speed w, is ``dw / (order w)`` of the angle. The
    core knows all derivatives; steps are no longer than half the period of the highest order.

    A run begins with the speed that this motion has then: :func:`beltdyn.simulate` sees to that
    where it is given no ``initial``. Fading in, the factor f goes from 0 to 1 so that speed and
    acceleration are continuous; without, a run that begins at speed begins with the acceleration of
    the fluctuation, as with a jolt.

    ``CrankMotion(-84.0, orders=[2, 4], amplitudes=[0.02, 0.004], fade=(0.0, 0.15))`` is the crank
    of a four-cylinder engine at 800 1/min, clockwise.

    Attributes:
        speed: Mean speed, counter-clockwise [rad/s]: a number, or a :class:`PiecewiseLinear` with
            one value per time, without jumps, for a run-up.
        orders: Orders (n,), periods per revolution, real numbers > 0.
        amplitudes: Amplitudes of the angle (n,) [rad].
        phases: Phases (n,) [rad]; None: zeros.
        fade: Times between which the fluctuation fades in [s]; None: it is there all the time.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    speed: PiecewiseLinear = attrs.field(converter=_mean_speed)
    orders: Array = attrs.field(converter=as_row, eq=EQUAL, repr=_listed)
    amplitudes: Array = attrs.field(converter=as_row, eq=EQUAL, repr=_listed)
    phases: Array = attrs.field(default=None, converter=as_row_or_none, eq=EQUAL, repr=_listed)
    fade: tuple[float, float] | None = attrs.field(default=None, converter=_fade, kw_only=True)

    def __attrs_post_init__(self) -> None:
        harmonic_fields(self)

    def _first_speed(self, t: float) -> float:
        """Give the speed at a time (MODEL section 5)."""
        times, speeds = self.speed.t, self.speed.values[:, 0]
        mean = float(self.speed.at(t)[0])
        knots = np.array([times[0], *times[(times > times[0]) & (times < t)], t])
        at_knots = np.interp(knots, times, speeds)
        angle = float(0.5 * (at_knots[1:] + at_knots[:-1]) @ np.diff(knots))
        factor, rate = 1.0, 0.0
        if self.fade is not None:
            begin, end = self.fade
            s = min(max((t - begin) / (end - begin), 0.0), 1.0)
            factor = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            rate = 30.0 * s * s * (1.0 - s) ** 2 / (end - begin)
        at = self.orders * angle + self.phases
        over_angle = -float((self.orders * self.amplitudes) @ np.sin(at))
        return mean * (1.0 + factor * over_angle) + rate * float(self.amplitudes @ np.cos(at))

    def __str__(self) -> str:
        speeds = self.speed.values
        orders = ", ".join(f"{order:g}" for order in self.orders)
        fade = "" if self.fade is None else f", from {self.fade[0]:g} to {self.fade[1]:g} s"
        return (
            f"mean speed {speeds.min():g} to {speeds.max():g} rad/s, harmonics of orders {orders}, "
            f"up to {np.abs(self.amplitudes).max():g} rad{fade}"
        )


def described(motion: MotionLike) -> str:
    """Say in words what motion this is."""
    speed = motion.speed if isinstance(motion, Motion) else motion
    return speed.described("", "rad/s") if isinstance(speed, PiecewiseLinear) else str(motion)


def in_core(motion: object) -> bool:
    """Whether the core evaluates a motion by itself."""
    speed = motion.speed if isinstance(motion, Motion) else motion
    return isinstance(speed, (PiecewiseLinear, CrankMotion))


def as_motions(
    motion: ByPulley[MotionLike] | None, names: Sequence[str]
) -> dict[int, Motion | CrankMotion]:
    """Check the motions of a run, of pulleys with these names; give them by index.

    Raises:
        TypeError: Not a mapping from pulleys to motions.
        ValueError: There is no such pulley, or one is named twice; a speed that jumps, or is for
            several pulleys.
    """
    if motion is None:
        return {}
    if not isinstance(motion, Mapping):
        raise TypeError(
            "motion must be a mapping from a pulley's index or name to its motion, "
            f"got {shown(motion)}"
        )
    found: dict[int, Motion | CrankMotion] = {}
    for index, value in by_index("motion", motion, names).items():
        if isinstance(value, (Motion, CrankMotion)):
            found[index] = value
            continue
        _check_speed(f"motion[{key(index, names)}]", value)
        found[index] = Motion(speed=value)
    return found


def motion_terms(motions: Mapping[int, Motion | CrankMotion]) -> list[_core.MotionTerm]:
    """Give the motions as the C core takes them."""

    def term(pulley: int, motion: Motion | CrankMotion) -> _core.MotionTerm:
        if isinstance(motion, CrankMotion):
            harmonics = (motion.orders, motion.amplitudes, motion.phases)
            mean = (motion.speed.t, motion.speed.values[:, 0])
            return (pulley, "crank", *mean, *harmonics, motion.fade or (0.0, 0.0))
        if isinstance(motion.speed, PiecewiseLinear):
            return (pulley, "piecewise", motion.speed.t, motion.speed.values[:, 0])
        if motion.speed is not None:
            return (pulley, "speed", motion.speed)
        return (pulley, "angle", motion.angle)

    return [term(pulley, motion) for pulley, motion in motions.items()]


def first_speeds(
    motions: Mapping[int, Motion | CrankMotion], t: float, until: float, names: Sequence[str]
) -> dict[int, float]:
    """Give the speeds at the start of a run whose functions are smooth up to a time."""
    step = min(_STEP, (until - t) / (_FORWARD.size - 1))

    def call(pulley: int, function: Callable[[float], float], time: float) -> float:
        return real(f"what the motion of {label(pulley, names)} returns", function(time))

    def speed(pulley: int, motion: Motion | CrankMotion) -> float:
        if isinstance(motion, CrankMotion):
            return motion._first_speed(t)
        if isinstance(motion.speed, PiecewiseLinear):
            return float(motion.speed.at(t)[0])
        if motion.speed is not None:
            return call(pulley, motion.speed, t)
        angle: Any = motion.angle
        values = [call(pulley, angle, t + k * step) for k in range(_FORWARD.size)]
        return float(_FORWARD @ (np.array(values) - values[0])) / step

    return {pulley: speed(pulley, motion) for pulley, motion in motions.items()}
