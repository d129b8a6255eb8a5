"""Prescribed motion of pulleys: their speeds or angles as functions of time (MODEL section 5)."""

from __future__ import annotations

import functools
import math
import numbers
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias, cast

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array, called_with, first_of, positive, real, shown
from ..base.naming import ByPulley, by_index, key
from ..base.optional import scipy_module
from .loads import harmonic_fields, interval
from .torques import EQUAL, PiecewiseLinear, Torque, as_row, named

#: A motion; a :class:`PiecewiseLinear` with one value per time or a function is a speed.
MotionLike: TypeAlias = (
    "Motion | CrankMotion | AngleTable | PiecewiseLinear | Callable[[float], float]"
)

#: Change of the speed at a sample that those beside it do not explain, over the largest speed, from
#: which on it is a jump (a run-up of 17 samples begins with less); share of such samples that is
#: noise. Smaller changes are noise if what is not explained is, in the median, above this share of
#: the largest speed and above the changes themselves: white noise is more than half of the
#: acceleration then; a motion for which that is true has less than four samples in its period.
_KINK, _NOISY, _FAINT = 0.03, 0.1, 1e-3
#: Knots of the speed in a period of the cutoff: chords are 0.4 % off a sine then.
_KNOTS = 20
#: Order of Butterworth's filter, which runs forth and back, and so has twice that and no delay.
_ORDER = 4
#: Turns of a crank in which its slowest point is looked for, a period of orders that are multiples
#: of 1/8; points in a period of the highest order; most of them.
_TURNS, _POINTS, _MOST_POINTS = 8, 40, 100_000


def _cutoff(value: float | None, name: str = "cutoff") -> float:
    return positive(name, value, "Hz")


def _listed(values: Array) -> str:
    return repr(values.tolist())


@attrs.frozen(field_transformer=named)
class AngleTable:
    """A motion given by measured angles of a pulley at given times.

    The speed that follows is linear between the times. Without ``cutoff`` it is the slope of the
    cubic spline through the angles, so that its angle agrees with the samples to h^2/12 times the
    change of the acceleration, h being their interval. Noise and kinks are then refused:
    differentiated twice for the torque, they would dominate the motion. With ``cutoff`` faster
    components are filtered out without delay (Butterworth of fourth order, forwards and backwards,
    over even samples; a kink is rounded within about 1 / cutoff), and the speed has 20 knots per
    period of the cutoff. Before the first time and after the last the speed is constant. Needs
    SciPy.

    ``motion={"crank": bd.AngleTable(t, angle, cutoff=200.0)}``

    Attributes:
        t: Times (n,) [s], n >= 4, increasing.
        angle: Angles at these times (n,), counter-clockwise, unwrapped (no turns taken off) [rad];
            only their changes count.
        cutoff: Frequency above which motion is taken as noise [Hz], below half the sampling rate;
            None: the angles are exact.
        speed: The speed that follows [rad/s].

    Raises:
        TypeError, ValueError: A field breaks its rule; the angles are wrapped or, without
            ``cutoff``, kinks or noise.
        ImportError: SciPy is not installed.
    """

    t: Array = attrs.field(converter=as_row, eq=EQUAL, repr=_listed)
    angle: Array = attrs.field(converter=as_row, eq=EQUAL, repr=_listed)
    cutoff: float | None = attrs.field(default=None, converter=_cutoff, kw_only=True)
    speed: PiecewiseLinear = attrs.field(init=False, repr=False, eq=False)

    def __attrs_post_init__(self) -> None:
        t, n = self.t, self.t.size
        if n < 4 or not (np.diff(t) > 0.0).all():
            raise ValueError("AngleTable.t must hold at least four times that increase (s)")
        if self.angle.size != n:
            raise ValueError(
                f"AngleTable.angle must have one value for each of the {n} times, "
                f"got {self.angle.size}"
            )
        _refuse_wraps(t, self.angle)
        if self.cutoff is None:
            _refuse_kinks(t, self.angle)
            speeds = scipy_module("interpolate", "an angle table").CubicSpline(t, self.angle)(t, 1)
        else:
            t, speeds = self._filtered(self.cutoff)
        object.__setattr__(self, "speed", PiecewiseLinear(t, speeds))

    def _filtered(self, cutoff: float) -> tuple[Array, Array]:
        """Return times and speeds of the angles, filtered at the cutoff."""
        signal = scipy_module("signal", "an angle table")
        lasts = float(self.t[-1] - self.t[0])
        n = 1 + round(lasts / float(np.median(np.diff(self.t))))
        rate = (n - 1) / lasts
        if not 1.0 / lasts < cutoff < 0.5 * rate:
            raise ValueError(
                f"AngleTable.cutoff must be between {1.0 / lasts:.4g} Hz, of which the table "
                f"holds a period, and {0.5 * rate:.4g} Hz, half its sampling rate, got {cutoff:g}"
            )
        even = np.linspace(self.t[0], self.t[-1], n)
        angles = np.interp(even, self.t, self.angle)
        line = np.interp(even, even[[0, -1]], angles[[0, -1]])
        low = signal.butter(_ORDER, cutoff, fs=rate, output="sos")
        # as many samples beyond each end as the filter remembers, if there are so many
        beyond = min(n - 1, round(rate / cutoff) * _ORDER)
        smooth = line + signal.sosfiltfilt(low, angles - line, padlen=beyond)
        spline = scipy_module("interpolate", "an angle table").CubicSpline(even, smooth)
        knots = np.linspace(even[0], even[-1], 1 + min(n - 1, math.ceil(_KNOTS * cutoff * lasts)))
        return knots, spline(knots, 1)

    def __reduce__(self) -> tuple[Any, ...]:
        return functools.partial(AngleTable, self.t, self.angle, cutoff=self.cutoff), ()

    def __str__(self) -> str:
        of = "" if self.cutoff is None else f", filtered at {self.cutoff:g} Hz"
        speeds = self.speed.values
        return (
            f"angles at {self.t.size} times from {self.t[0]:g} to {self.t[-1]:g} s{of}, "
            f"speeds {speeds.min():g} to {speeds.max():g} rad/s"
        )


def _refuse_wraps(t: Array, angle: Array) -> None:
    """Raise ValueError where a whole turn is taken off between samples, in radians or degrees."""
    # Where it is 360, all angles lie within it; of angles in radians one step would be all motion.
    steps = np.diff(angle)
    for turn, unit, cure in (
        (2.0 * math.pi, "", "numpy.unwrap"),
        (360.0, " and is in degrees", "numpy.unwrap(numpy.radians(angle))"),
    ):
        off = np.abs(np.abs(steps - np.median(steps)) - turn)
        found = np.flatnonzero(off < 0.125 * turn)
        if found.size and (turn < 360.0 or np.ptp(angle) <= turn):
            raise ValueError(
                f"AngleTable.angle has turns taken off{unit}, at t = {t[1 + found[0]]:.6g} s the "
                f"first of {found.size}: give them unwrapped in rad ({cure})"
            )


def _refuse_kinks(t: Array, angle: Array) -> None:
    """Raise ValueError where the speed between samples jumps, or is noise."""
    slopes = np.diff(angle) / np.diff(t)
    changes = np.concatenate([[0.0], np.diff(slopes), [0.0]])  # at the samples but the ends
    changes[[0, -1]] = changes[[1, -2]]
    unexplained = np.abs(changes[1:-1] - 0.5 * (changes[:-2] + changes[2:]))
    fastest = np.max(np.abs(slopes), initial=0.0)
    beyond = unexplained > _KINK * fastest
    common = np.median(unexplained)
    noise = common > max(_FAINT * fastest, np.median(np.abs(changes[1:-1])))
    noise |= np.count_nonzero(beyond) > max(3.0, _NOISY * t.size)
    highest = np.array([unexplained[max(0, k - 1) : k + 2].max() for k in range(unexplained.size)])
    found = np.flatnonzero(beyond & (unexplained == highest))  # not those beside a kink as well
    if noise:
        raise ValueError(
            f"AngleTable.angle is noisy: from sample to sample the speed changes by up to "
            f"{np.max(np.abs(changes)):.3g} rad/s, its largest is {fastest:.3g}; give cutoff, the "
            "frequency up to which it is motion, or more samples"
        )
    if found.size == 0:
        return
    most = np.max(np.abs(changes[1 + found]))
    worst = found[np.argmax(unexplained[found])] + 1
    times = ", ".join(f"{one:.6g}" for one in t[1 + found][:5])
    raise ValueError(
        f"AngleTable.angle has kinks at t = {times}{', ...' if found.size > 5 else ''} s: the "
        f"speed jumps by up to {most:.3g} rad/s (at {t[worst]:.6g} s), which a pulley's cannot; "
        "give cutoff, which rounds them, or more samples where it changes"
    )


def _no_function(value: object) -> str:
    """Return in words what stands in place of a function f(t); or ""."""
    function = callable(value) and not isinstance(value, Torque)
    return called_with(cast(Any, value), "t") if function else shown(value)


def _check_speed(name: str, value: object) -> None:
    if isinstance(value, PiecewiseLinear):
        if value.pulley is not None:
            raise ValueError(f"{name} must not name a pulley: the motion does")
        if value.n_pulleys != 1:
            raise ValueError(
                f"{name} must have one value per time, got values of shape {value.values.shape}"
            )
        if (k := first_of(np.diff(value.t) == 0.0)) is not None:
            raise ValueError(
                f"{name} must not jump, for a pulley's speed cannot: it holds the time "
                f"{value.t[k]:g} s twice"
            )
    elif got := _no_function(value):
        hint = ""
        if isinstance(value, (bool, np.bool_)):
            hint = ", a bool, which is no speed"
        elif isinstance(value, numbers.Real):
            hint = f"; a constant speed [rad/s] is lambda t: {got}"
        raise TypeError(
            f"{name} must be a PiecewiseLinear with one value per time, a function f(t), a Motion "
            f"or a CrankMotion, got {got}{hint}"
        )


@attrs.frozen(kw_only=True)
class Motion:
    """The prescribed motion of a pulley, given by its speed or by its angle.

    ``Motion(angle=lambda t: 0.1 * math.sin(50.0 * t))``. Functions are called with a time within
    the run and return a number. They must depend on time alone, as they are called several times
    near each time, and be smooth but at the run's ``breakpoints``: their derivatives, which the
    torque needs, are differences over 0.3 ms.

    Attributes:
        speed: Angular velocity, counter-clockwise [rad/s]: a :class:`PiecewiseLinear` with one
            value per time, without jumps, or a function of time [s].
        angle: Angle [rad] as a function of time [s], or measured, an :class:`AngleTable`; its
            changes count: the pulley begins at the angle that it has.

    Raises:
        TypeError: Neither or both are given, or one of the wrong kind.
        ValueError: A speed that jumps; an angle that is a PiecewiseLinear, whose speed would.
    """

    speed: PiecewiseLinear | Callable[[float], float] | None = None
    angle: Callable[[float], float] | AngleTable | None = None

    def __attrs_post_init__(self) -> None:
        if (self.speed is None) == (self.angle is None):
            raise TypeError("Motion takes either speed or angle")
        if self.speed is not None:
            _check_speed("Motion.speed", self.speed)
        elif isinstance(self.angle, PiecewiseLinear):
            raise ValueError(
                "Motion.angle must not be a PiecewiseLinear, for the speed would jump at its times"
                ": give the speed, a smooth function of time, or measured angles, an AngleTable"
            )
        elif not isinstance(self.angle, AngleTable) and (got := _no_function(self.angle)):
            raise TypeError(f"Motion.angle must be a function f(t) or an AngleTable, got {got}")


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
    acceleration are continuous; without it, a run that begins at speed begins with a jolt, the
    acceleration of the fluctuation.

    ``CrankMotion(-84.0, orders=[2, 4], amplitudes=[0.02, 0.004], fade=(0.0, 0.15))`` is the crank
    of a four-cylinder engine at 800 1/min, clockwise.

    Attributes:
        speed: Mean speed, counter-clockwise [rad/s]: a number, or a :class:`PiecewiseLinear` with
            one value per time, without jumps, for a run-up.
        orders: Orders (n,), periods per revolution, real numbers > 0.
        amplitudes: Amplitudes of the angle (n,) [rad].
        phases: Phases (n,) [rad]; None: zeros.
        fade: Times between which the fluctuation fades in [s]; None: it is there all the time.
    """

    speed: PiecewiseLinear = attrs.field(converter=_mean_speed)
    orders: Array = attrs.field(converter=as_row, eq=EQUAL, repr=_listed)
    amplitudes: Array = attrs.field(converter=as_row, eq=EQUAL, repr=_listed)
    phases: Array = attrs.field(default=None, converter=as_row, eq=EQUAL, repr=_listed)
    fade: tuple[float, float] | None = attrs.field(default=None, converter=interval, kw_only=True)

    def __attrs_post_init__(self) -> None:
        harmonic_fields(self)

    @property
    def _slowest(self) -> float:
        """Least speed within a period, over the mean speed, once all of it has faded in."""
        strengths = self.amplitudes * self.orders
        if np.abs(strengths).sum() <= 1.0:  # never below 0: it need not be known better
            return float(1.0 - np.abs(strengths).sum())
        points = min(_MOST_POINTS, math.ceil(_TURNS * _POINTS * self.orders.max()))
        angles = np.linspace(0.0, 2.0 * math.pi * _TURNS, points)
        speeds = np.ones(points)
        for strength, order, phase in zip(strengths, self.orders, self.phases, strict=True):
            speeds -= strength * np.sin(order * angles + phase)
        return float(speeds.min())

    def __str__(self) -> str:
        speeds = self.speed.values
        orders = ", ".join(f"{order:g}" for order in self.orders)
        fade = "" if self.fade is None else f", from {self.fade[0]:g} to {self.fade[1]:g} s"
        return (
            f"mean speed {speeds.min():g} to {speeds.max():g} rad/s, harmonics of orders {orders}, "
            f"up to {np.abs(self.amplitudes).max():g} rad{fade}"
        )


def in_core(motion: object) -> PiecewiseLinear | CrankMotion | AngleTable | None:
    """Return the object of a motion that the core evaluates by itself; None for functions."""
    if isinstance(motion, Motion):
        motion = motion.angle if motion.speed is None else motion.speed
    return motion if isinstance(motion, (PiecewiseLinear, CrankMotion, AngleTable)) else None


def described(motion: MotionLike) -> str:
    """Describe the motion in words."""
    known = in_core(motion)
    if isinstance(known, PiecewiseLinear):
        return known.described("", "rad/s")
    return str(motion if known is None else known)


def as_motions(
    motion: ByPulley[MotionLike] | None, names: Sequence[str]
) -> dict[int, Motion | CrankMotion]:
    """Check the motions of a run, of pulleys with these names; return them by index."""
    if motion is None:
        return {}
    if not isinstance(motion, Mapping):
        raise TypeError(
            "motion must be a mapping from a pulley's index or name to its motion, such as "
            f"{{{key(0, names)}: lambda t: 100.0}} [rad/s], got {shown(motion)}"
        )
    found: dict[int, Motion | CrankMotion] = {}
    for index, given in by_index("motion", motion, names).items():
        known = in_core(given)
        value: Any = known.speed if isinstance(known, AngleTable) else given
        if isinstance(value, (Motion, CrankMotion)):
            found[index] = value
            continue
        _check_speed(f"motion[{key(index, names)}]", value)
        found[index] = Motion(speed=value)
    return found


def motion_terms(motions: Mapping[int, Motion | CrankMotion]) -> list[_core.MotionTerm]:
    """Return the motions as the C core takes them."""

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
