"""Prescribed motion of pulleys: their speeds or angles as functions of time (MODEL section 5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import attrs
import numpy as np

from . import _core
from .checks import real, shown
from .naming import ByPulley, by_index, key, label
from .torques import PiecewiseLinear, Torque

__all__ = ["Motion", "MotionLike", "as_motions", "first_speeds", "motion_terms"]

#: A motion; a :class:`PiecewiseLinear` with one value per time or a function is a speed.
MotionLike: TypeAlias = "Motion | PiecewiseLinear | Callable[[float], float]"

#: Weights of values one step apart in the derivative at the first: order 6, as in the core.
_FORWARD = np.array([-147.0, 360.0, -450.0, 400.0, -225.0, 72.0, -10.0]) / 60.0
_STEP = 5e-5


def _check_speed(name: str, value: object) -> None:
    if isinstance(value, PiecewiseLinear):
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
            f"{name} must be a PiecewiseLinear with one value per time, a function f(t) or a "
            f"Motion, got {shown(value)}"
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


def as_motions(motion: ByPulley[MotionLike] | None, names: Sequence[str]) -> dict[int, Motion]:
    """Check the motions of a run, of pulleys with these names; give them by index.

    Raises:
        TypeError: Not a mapping from pulleys to motions.
        ValueError: There is no such pulley; a speed that jumps, or is for several pulleys.
    """
    if motion is None:
        return {}
    if not isinstance(motion, Mapping):
        raise TypeError(
            "motion must be a mapping from a pulley's index or name to its motion, "
            f"got {shown(motion)}"
        )
    found = {}
    for index, value in by_index("motion", motion, names).items():
        if not isinstance(value, Motion):
            _check_speed(f"motion[{key(index, names)}]", value)
        found[index] = value if isinstance(value, Motion) else Motion(speed=value)
    return found


def motion_terms(motions: Mapping[int, Motion]) -> list[_core.MotionTerm]:
    """Give the motions as the C core takes them."""

    def term(pulley: int, motion: Motion) -> _core.MotionTerm:
        if isinstance(motion.speed, PiecewiseLinear):
            return (pulley, "piecewise", motion.speed.t, motion.speed.values[:, 0])
        if motion.speed is not None:
            return (pulley, "speed", motion.speed)
        return (pulley, "angle", motion.angle)

    return [term(pulley, motion) for pulley, motion in motions.items()]


def first_speeds(
    motions: Mapping[int, Motion], t: float, until: float, names: Sequence[str]
) -> dict[int, float]:
    """Give the speeds at the start of a run whose functions are smooth up to a time."""
    step = min(_STEP, (until - t) / (_FORWARD.size - 1))

    def call(pulley: int, function: Callable[[float], float], time: float) -> float:
        return real(f"what the motion of {label(pulley, names)} returns", function(time))

    def speed(pulley: int, motion: Motion) -> float:
        if isinstance(motion.speed, PiecewiseLinear):
            return float(motion.speed(t, (), ())[0])
        if motion.speed is not None:
            return call(pulley, motion.speed, t)
        angle: Any = motion.angle
        values = [call(pulley, angle, t + k * step) for k in range(_FORWARD.size)]
        return float(_FORWARD @ (np.array(values) - values[0])) / step

    return {pulley: speed(pulley, motion) for pulley, motion in motions.items()}
