"""What lets the axis of a pulley move: tensioner arms, sliders, prescribed paths.

Equations in MODEL section 5. An arm and a slider have one coordinate each, their travel: of an arm
the angle by which it has turned, counter-clockwise, of a slider the way along its direction, 0 in
the place that the pulley has in the drive. Torques and forces count in its sense.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import attrs
import numpy as np

from .checks import Array, pair, real, real_array
from .rules import Printable, Rule, from_table, rules_of

__all__ = [
    "Arm",
    "Mount",
    "Path",
    "Slider",
    "axis_direction",
    "friction_stiffness",
    "mount_or_none",
    "stop_stiffness",
    "travel_text",
]

#: What ``csrc/model/mount.c`` chooses where it is not given: stops, over what the belt holds the
#: mount with; the travel in which friction develops, of an arm [rad], of a slider over the radius
#: of its pulley. tests/test_mounts.py compares them.
_STOP, _PRESLIDING = 50.0, 0.01

Stops: TypeAlias = tuple[float, float] | None


def _pair(group: str, name: str, unit: str, text: str) -> Rule:
    return Rule(group, name, "PAIR", unit, text)


_UNLOADED = "travel at which the spring is unloaded"
_HELD = "tension of the belt that it holds in the place of the drive"
_STOPS = "lowest and highest travel"
_PIVOT = _pair("arm", "pivot", "m", "about which it turns")
_DIRECTION = _pair("slider", "direction", "1", "of its travel")


def _stops(name: str, value: Sequence[float] | None, unit: str) -> Stops:
    if value is None:
        return None
    low, high = pair(name, value, unit)
    if not low < high:
        raise ValueError(
            f"{name} must be (lowest, highest) with lowest < highest ({unit}), "
            f"got ({low:g}, {high:g})"
        )
    return low, high


def _arm_stops(value: Sequence[float] | None) -> Stops:
    return _stops("arm.stops", value, "rad")


def _slider_stops(value: Sequence[float] | None) -> Stops:
    return _stops("slider.stops", value, "m")


def _free_angle(value: float | None) -> float | None:
    return None if value is None else real("arm.free_angle", value, "rad")


def _free_travel(value: float | None) -> float | None:
    return None if value is None else real("slider.free_travel", value, "m")


class _Sprung(Printable):
    """What arms and sliders have in common."""

    __slots__ = ()

    @property
    def _unloaded_at(self) -> float | None:
        raise NotImplementedError

    def _check(self, group: str, unloaded: str) -> None:
        mount: Any = self
        if mount.tension is not None:
            for name in ("preload", unloaded):
                if getattr(mount, name) is not None:
                    raise ValueError(
                        f"{group}.tension and {group}.{name} are both given: the preload follows "
                        "from the tension"
                    )
        if mount.preload is not None and self._unloaded_at is not None:
            raise ValueError(
                f"{group}.preload and {group}.{unloaded} are both given: one follows from the "
                f"other, preload = stiffness * {unloaded}"
            )
        if self._unloaded_at is not None and mount.stiffness == 0.0:
            raise ValueError(f"{group}.{unloaded} needs a spring: {group}.stiffness is 0")

    def _rows(self) -> list[tuple[str, str, str]]:
        """Leave out what does not apply: of preload and unloaded place one, stops that are none."""
        mount: Any = self
        given = ("preload", "tension", "stops")
        left_out = {name for name in given if getattr(mount, name) is None}
        if self._unloaded_at is None:
            left_out |= {"free_angle", "free_travel"}
        if mount.friction == 0.0:
            left_out |= {"friction_stiffness"}
        if mount.stops is None:
            left_out |= {"stop_stiffness", "stop_damping"}
        return [row for row in Printable._rows(self) if row[0] not in left_out]

    @property
    def spring_force(self) -> float:
        """Torque (force) of the spring in the place of the drive, S_0 without a hung weight.

        Of a mount with a ``tension`` ``params.effective_pulleys`` knows it.

        Raises:
            ValueError: It is given by ``tension``.
        """
        mount: Any = self
        if mount.tension is not None:
            raise ValueError(
                "the spring's force follows from mount.tension and the places of the pulleys: "
                "params.effective_pulleys has it"
            )
        if self._unloaded_at is not None:
            return float(mount.stiffness * self._unloaded_at)
        return float(mount.preload or 0.0)

    def _numbers(self, group: str) -> tuple[float, ...]:
        """Give the numbers of the core's struct."""
        mount: Any = self
        low, high = mount.stops or (0.0, 0.0)
        own = {"preload": self.spring_force, "lowest": low, "highest": high}
        return tuple(
            own[name] if name in own else float(getattr(mount, name) or 0.0)
            for name in rules_of(group)
        )


_OF_ARM = Rule("arm", "tension", "POSITIVE", "N", _HELD)


@attrs.frozen(kw_only=True, field_transformer=from_table("arm", _PIVOT, _OF_ARM))
class Arm(_Sprung):
    """An arm that turns about a pivot: a belt tensioner.

    It needs something that holds the belt's tension: a spring with a preload, or a stop. The
    belt settles where both are in balance, so the place of the pulley is where the arm is drawn,
    and not necessarily where it rests.

    Attributes:
        pivot: Point about which it turns (x, y) [m].
        inertia: Moment of inertia about the pivot [kg m^2], > 0, the mass of the pulley included.
        mass: Mass on the pulley's axis that gravity acts on [kg], >= 0; part of ``inertia``.
        stiffness: Of the spring [N m/rad], >= 0.
        preload: Torque of the spring on the arm in the place of the drive [N m], counter-clockwise
            positive; None: 0, or by ``free_angle``.
        free_angle: Angle from there at which the spring is unloaded [rad], in place of ``preload``.
        tension: Tension of the belt at rest that the arm is to hold in the place of the drive [N],
            > 0, in place of ``preload``, which is found from it (``params.effective_pulleys``),
            also of a belt that bending lifts off its pulleys: to 0.5 % where sqrt(EI / T) is below
            a half of what of it lies on the pulley and a quarter of its spans.
        damping: Of a damper beside the spring [N m s/rad], >= 0.
        friction: Torque of Dahl friction in the pivot, in full sliding [N m], >= 0.
        friction_stiffness: Of that friction before it slides [N m/rad], >= 0; None or 0: so that it
            develops within 0.01 rad.
        stops: Angles between which it can turn, (lowest, highest) [rad]; None: no stops.
        stop_stiffness: Of a stop [N m/rad], >= 0; None or 0: 50 times what the belt holds the arm
            with.
        stop_damping: Of a stop [N m s/rad], >= 0; None or 0: half of critical for a stiffness that
            is chosen, else 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    pivot: tuple[float, float]
    inertia: float
    mass: float = 0.0
    stiffness: float = 0.0
    preload: float | None = None
    free_angle: float | None = attrs.field(
        default=None,
        converter=_free_angle,
        metadata={"rule": Rule("arm", "free_angle", "FINITE", "rad", _UNLOADED)},
    )
    tension: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    friction_stiffness: float | None = None
    stops: Stops = attrs.field(
        default=None,
        converter=_arm_stops,
        metadata={"rule": _pair("arm", "stops", "rad", _STOPS)},
    )
    stop_stiffness: float | None = None
    stop_damping: float | None = None

    def __attrs_post_init__(self) -> None:
        self._check("arm", "free_angle")

    @property
    def _unloaded_at(self) -> float | None:
        return self.free_angle

    def _to_core(self) -> tuple[Any, ...]:
        return "arm", self.pivot, self._numbers("arm")


def _direction(value: Sequence[float]) -> tuple[float, float]:
    x, y = _DIRECTION.check(value)
    if x == 0.0 and y == 0.0:
        raise ValueError("slider.direction must not be (0, 0)")
    return x, y


_OF_SLIDER = Rule("slider", "tension", "POSITIVE", "N", _HELD)


@attrs.frozen(kw_only=True, field_transformer=from_table("slider", _OF_SLIDER))
class Slider(_Sprung):
    """A carriage that moves along a line: a take-up, with a spring, a screw or a weight.

    Attributes:
        direction: Direction of its travel (x, y), of any length > 0.
        mass: Of carriage and pulley [kg], > 0; gravity acts on it.
        weight: Mass hung on it by a rope [kg], >= 0, which pulls it along ``direction`` with
            9.80665 N/kg, whatever the gravity of the drive, and moves with it.
        stiffness: Of a spring [N/m], >= 0.
        preload: Force of the spring on the carriage in the place of the drive [N]; None: 0, or by
            ``free_travel``.
        free_travel: Travel from there at which the spring is unloaded [m], in place of ``preload``.
        tension: Tension of the belt at rest that the carriage is to hold in the place of the drive
            [N], > 0, in place of ``preload``, which is found from it (``params.effective_pulleys``)
            so that spring and hung weight hold it together.
        damping: Of a damper beside the spring [N s/m], >= 0.
        friction: Force of Dahl friction in the guide, in full sliding [N], >= 0.
        friction_stiffness: Of that friction before it slides [N/m], >= 0; None or 0: so that it
            develops within a hundredth of the pulley's radius.
        stops: Travels between which it can move, (lowest, highest) [m]; None: no stops.
        stop_stiffness: Of a stop [N/m], >= 0; None or 0: 50 times what the belt holds the carriage
            with.
        stop_damping: Of a stop [N s/m], >= 0; None or 0: half of critical for a stiffness that is
            chosen, else 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    direction: tuple[float, float] = attrs.field(
        converter=_direction, metadata={"rule": _DIRECTION}
    )
    mass: float
    weight: float = 0.0
    stiffness: float = 0.0
    preload: float | None = None
    free_travel: float | None = attrs.field(
        default=None,
        converter=_free_travel,
        metadata={"rule": Rule("slider", "free_travel", "FINITE", "m", _UNLOADED)},
    )
    tension: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    friction_stiffness: float | None = None
    stops: Stops = attrs.field(
        default=None,
        converter=_slider_stops,
        metadata={"rule": _pair("slider", "stops", "m", _STOPS)},
    )
    stop_stiffness: float | None = None
    stop_damping: float | None = None

    def __attrs_post_init__(self) -> None:
        self._check("slider", "free_travel")

    @property
    def _unloaded_at(self) -> float | None:
        return self.free_travel

    def _to_core(self) -> tuple[Any, ...]:
        return "slider", self.direction, self._numbers("slider")


def _times(value: object) -> Array:
    return real_array("path.t", value, ndim=1)


def _displacement(value: object) -> Array:
    return real_array("path.displacement", value, ndim=2)


@attrs.frozen(kw_only=True, eq=False)
class Path(Printable):
    """A prescribed path of the axis over time: a cubic spline through points, at rest at both ends.

    Attributes:
        t: Times (n_t,) [s], n_t >= 2, increasing. Before the first and after the last the axis
            stands still.
        displacement: Of the axis from the pulley's place at these times (n_t, 2) [m]; the first is
            (0, 0). The belt settles where the axis is at t = 0. Where points are steep the spline
            goes beyond them; ``print(params)`` says by how much.

    Raises:
        TypeError: Not real numbers.
        ValueError: Shapes that do not fit, times that do not increase, a first point that is not
            (0, 0).
    """

    t: Array = attrs.field(converter=_times)
    displacement: Array = attrs.field(converter=_displacement)

    def __attrs_post_init__(self) -> None:
        if self.t.size < 2 or not np.all(np.diff(self.t) > 0.0):
            raise ValueError("path.t must hold at least two times that increase (s)")
        if self.displacement.shape != (self.t.size, 2):
            raise ValueError(
                f"path.displacement must have shape {(self.t.size, 2)}, a row for each time, "
                f"got {self.displacement.shape}"
            )
        if np.any(self.displacement[0] != 0.0):
            raise ValueError("path.displacement must begin with (0, 0), the pulley's place (m)")

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Path)
            and np.array_equal(self.t, other.t)
            and np.array_equal(self.displacement, other.displacement)
        )

    def __hash__(self) -> int:
        return hash((self.t.tobytes(), self.displacement.tobytes()))

    def _rows(self) -> list[tuple[str, str, str]]:
        span = f"{self.t[0]:.6g} to {self.t[-1]:.6g} s"
        return [("path", f"{self.t.size} points, {span}", "prescribed path of the axis")]

    def _to_core(self) -> tuple[Any, ...]:
        # Hashable: settled tensions are kept by the arguments of the core.
        return "path", tuple(self.t.tolist()), tuple(map(tuple, self.displacement.tolist()))


Mount: TypeAlias = Arm | Slider | Path


def travel_text(mount: Mount, travel: float) -> str:
    """Write a travel as an engineer reads it: degrees of an arm, millimetres of a slider."""
    if isinstance(mount, Arm):
        return f"{math.degrees(travel):.4g} deg"
    return f"{1e3 * travel:.4g} mm" if isinstance(mount, Slider) else f"at {travel:.4g} s"


def axis_direction(mount: Arm | Slider, center: Array) -> Array:
    """Give how the axis of a pulley at ``center`` moves with the travel, a of MODEL section 5.

    Of an arm its length, which is the lever of forces on the axis, is the arm's [m]; of a slider 1.
    """
    if isinstance(mount, Arm):
        x, y = center - np.array(mount.pivot)
        return np.array([-y, x])
    along = np.array(mount.direction)
    return np.asarray(along / np.hypot(*along))


def friction_stiffness(mount: Arm | Slider, radius: float) -> float:
    """Give the stiffness of a mount's friction before it slides, chosen unless given.

    Args:
        mount: The mount.
        radius: Of its pulley [m].

    Returns:
        Of an arm [N m/rad], of a slider [N/m].
    """
    travel = _PRESLIDING if isinstance(mount, Arm) else _PRESLIDING * radius
    return mount.friction_stiffness or mount.friction / travel


def stop_stiffness(
    mount: Arm | Slider, center: Array, axial_stiffness: float, length: float
) -> float:
    """Give the stiffness of a mount's stops, chosen unless given.

    Args:
        mount: The mount.
        center: Of its pulley as it is drawn (2,) [m].
        axial_stiffness: EA of the belt [N].
        length: Stress-free, of the belt [m].

    Returns:
        Of an arm [N m/rad], of a slider [N/m].
    """
    along = axis_direction(mount, center)
    held = 4.0 * axial_stiffness / length * float(along @ along)
    return mount.stop_stiffness or _STOP * held


def mount_or_none(_self: Any, _field: attrs.Attribute[Any], value: Any) -> None:
    """Check the field of a pulley that holds its mount."""
    if value is not None and not isinstance(value, (Arm, Slider, Path)):
        raise TypeError(
            f"pulley.mount must be an Arm, a Slider, a Path or None, got {type(value).__name__}"
        )
