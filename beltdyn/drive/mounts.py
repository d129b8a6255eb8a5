"""Mounts that let the axis of a pulley move: tensioner arms, sliders, prescribed paths.

Equations in MODEL section 5. An arm and a slider have one coordinate each, their travel: of an arm
the angle by which it has turned, counter-clockwise, of a slider the way along its direction, 0 in
the place that the pulley has in the drive. Torques and forces count in its sense.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple, TypeAlias, get_args

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array, real_array
from .rules import Printable, Rule, from_table, numbers_of, rules_of

Stops: TypeAlias = tuple[float, float] | None


class MountKind(NamedTuple):
    """A row of the table of mounts, a class each: what the package asks for by it.

    What stands still in a picture is ``_drawn`` of the class: points (n, 2) by style, of a pulley.
    """

    name: str  # in the core, in TOML files and in reports
    part: str  # name in modes
    sense: str  # in which travels and forces count
    remark: str  # in reports
    guide: str = ""  # field of the core's pair, along which it moves
    free: str = ""  # field of the travel at which its spring is unloaded
    spring: str = "spring"  # name of its force in reports

    @property
    def angle(self) -> bool | None:
        """Whether its travel is one [rad] or a length [m]; None: the time."""
        stop = rules_of(self.name).get("lowest")
        return None if stop is None else stop.unit == "rad"

    @property
    def force(self) -> str:
        """Unit of what acts on it in the sense of its travel."""
        return self.unit("N m or N")

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit in which travels are printed."""
        return (180.0 / math.pi, "deg") if self.angle else (1e3, "mm")

    @property
    def moves(self) -> bool:
        """Whether the mount moves under forces; otherwise it is prescribed."""
        return self.angle is not None

    def unit(self, either: str) -> str:
        """Return the unit of a travel, a rate or a force, from "rad or m"."""
        return either.split(" or ")[0 if self.angle else -1]

    def travel_text(self, travel: float) -> str:
        """Write a travel in degrees or millimetres."""
        factor, unit = self.shown
        shown = round(factor * travel, 6) + 0.0  # what settling leaves of a travel of 0 is 0
        return f"{shown:.4g} {unit}"


def _stops_in_order(mount: Sprung, _field: object, stops: Stops) -> None:
    if stops is not None and not stops[0] < stops[1]:
        name, unit = mount._row.name, mount._row.unit("rad or m")
        raise ValueError(
            f"{name}.stops must be (lowest, highest) with lowest < highest ({unit}), "
            f"got ({stops[0]:g}, {stops[1]:g})"
        )


def _given_by(guide: Rule, free: str, unit: str) -> tuple[Rule, ...]:
    """Return the rules of fields that reach the core as other numbers."""
    held = "tension of the belt that it holds in the place of the drive"
    return (
        guide,
        Rule(guide.group, "tension", "POSITIVE", "N", held),
        Rule(guide.group, free, "FINITE", unit, "travel at which the spring is unloaded"),
        Rule(guide.group, "stops", "PAIR", unit, "lowest and highest travel"),
    )


_OF_ARM = _given_by(Rule("arm", "pivot", "PAIR", "m", "about which it turns"), "free_angle", "rad")
_OF_SLIDER = _given_by(
    Rule("slider", "direction", "PAIR", "1", "of its travel"), "free_travel", "m"
)


class Sprung(Printable):
    """A mount that moves under the forces on it: an arm or a slider."""

    __slots__ = ()
    _row: ClassVar[MountKind]
    mass: float
    stiffness: float
    preload: float | None
    tension: float | None
    damping: float
    friction: float
    stops: Stops

    @property
    def _unloaded_at(self) -> float | None:
        free: float | None = getattr(self, self._row.free)
        return free

    def __attrs_post_init__(self) -> None:
        group, unloaded = self._row.name, self._row.free
        if self.tension is not None:
            for name in ("preload", unloaded):
                if getattr(self, name) is not None:
                    raise ValueError(
                        f"{group}.tension and {group}.{name} are both given: the preload follows "
                        "from the tension"
                    )
        if self.preload is not None and self._unloaded_at is not None:
            raise ValueError(
                f"{group}.preload and {group}.{unloaded} are both given: one follows from the "
                f"other, preload = stiffness * {unloaded}"
            )
        if self._unloaded_at is not None and self.stiffness == 0.0:
            raise ValueError(f"{group}.{unloaded} needs a spring: {group}.stiffness is 0")

    def _rows(self) -> list[tuple[str, str, str]]:
        """Leave out what does not apply: preload or unloaded place, missing stops."""
        given = ("preload", "tension", "stops", self._row.free)
        left_out = {name for name in given if getattr(self, name) is None}
        if self.friction == 0.0:
            left_out |= {"friction_stiffness"}
        if self.stops is None:
            left_out |= {"stop_stiffness", "stop_damping"}
        return [row for row in Printable._rows(self) if row[0] not in left_out]

    @property
    def spring_force(self) -> float:
        """Torque (force) of the spring in the place of the drive, S_0 without a hung weight.

        For a mount given by its ``tension``, ``params.effective_pulleys`` has it.

        Raises:
            ValueError: It is given by ``tension``.
        """
        if self.tension is not None:
            raise ValueError(
                "the spring's force follows from mount.tension and the places of the pulleys: "
                "params.effective_pulleys has it"
            )
        if self._unloaded_at is not None:
            return float(self.stiffness * self._unloaded_at)
        return float(self.preload or 0.0)

    @property
    def _hung(self) -> float:
        """Mass hung on it by a rope [kg]."""
        return float(getattr(self, "weight", 0.0))

    def _directions(self, centers: Array) -> Array:
        """Return how axes at these places (n, 2) move with the travel, a of MODEL section 5."""
        return _core.mount_directions(self._row.name, getattr(self, self._row.guide), centers)

    def _direction(self, center: Array) -> Array:
        return np.asarray(self._directions(np.reshape(center, (1, 2)))[0])

    def _to_core(self) -> tuple[Any, ...]:
        group = self._row.name
        low, high = self.stops or (0.0, 0.0)
        numbers = numbers_of(group, self, preload=self.spring_force, lowest=low, highest=high)
        return group, getattr(self, self._row.guide), numbers


@attrs.frozen(kw_only=True, field_transformer=from_table("arm", *_OF_ARM))
class Arm(Sprung):
    """An arm that turns about a pivot: a belt tensioner.

    It needs something that holds the belt's tension: a spring with a preload, or a stop. The
    belt settles where both are in balance, so the place of the pulley is where the arm is drawn,
    and not necessarily where it rests.

    Attributes:
        pivot: Point about which it turns (x, y) [m].
        inertia: Moment of inertia about the pivot [kg m^2], > 0, the mass of the pulley included.
        mass: Mass on the pulley's axis that gravity acts on [kg], >= 0; part of ``inertia``.
        stiffness: Stiffness of the spring [N m/rad], >= 0.
        preload: Torque of the spring on the arm in the place of the drive [N m], counter-clockwise
            positive; None: 0, or by ``free_angle``.
        free_angle: Angle from that place at which the spring is unloaded [rad], in place of
            ``preload``.
        tension: Tension of the belt at rest that the arm is to hold in the place of the drive [N],
            > 0, in place of ``preload``, which is found from it (``params.effective_pulleys``),
            also for a belt that bending lifts off its pulleys: to 0.5 % where sqrt(EI / T) is less
            than half the arc of contact and a quarter of the spans.
        damping: Damping beside the spring [N m s/rad], >= 0.
        friction: Torque of Dahl friction in the pivot, in full sliding [N m], >= 0.
        friction_stiffness: Stiffness of that friction before it slides [N m/rad], >= 0; None or 0:
            chosen so that it develops within 0.01 rad.
        stops: Angles between which it can turn, (lowest, highest) [rad]; None: no stops.
        stop_stiffness: Stiffness of a stop [N m/rad], >= 0; None or 0: 50 times the stiffness with
            which the belt holds the arm.
        stop_damping: Damping of a stop [N m s/rad], >= 0; None or 0: half of critical for a
            stiffness that is chosen, else 0.
    """

    _row: ClassVar[MountKind] = MountKind(
        name="arm",
        part="arm",
        sense="counter-clockwise",
        remark="Arms: travel from the drawn place and torques counter-clockwise.",
        guide="pivot",
        free="free_angle",
    )

    def _drawn(self, _center: Array, _radius: float) -> dict[str, Array]:
        return {"pivot": np.array([self.pivot])}

    pivot: tuple[float, float]
    inertia: float
    mass: float = 0.0
    stiffness: float = 0.0
    preload: float | None = None
    free_angle: float | None = None
    tension: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    friction_stiffness: float | None = None
    stops: Stops = attrs.field(default=None, validator=_stops_in_order)
    stop_stiffness: float | None = None
    stop_damping: float | None = None


def _not_zero(_mount: object, _field: object, direction: tuple[float, float]) -> None:
    if direction == (0.0, 0.0):
        raise ValueError("slider.direction must not be (0, 0)")


@attrs.frozen(kw_only=True, field_transformer=from_table("slider", *_OF_SLIDER))
class Slider(Sprung):
    """A carriage that moves along a line: a take-up, with a spring, a screw or a weight.

    Attributes:
        direction: Direction of its travel (x, y), of any length > 0.
        mass: Mass of carriage and pulley [kg], > 0; gravity acts on it.
        weight: Mass hung on it by a rope [kg], >= 0, which pulls it along ``direction`` with
            9.80665 N/kg, whatever the gravity of the drive, and moves with it.
        stiffness: Stiffness of a spring [N/m], >= 0.
        preload: Force of the spring on the carriage in the place of the drive [N]; None: 0, or by
            ``free_travel``.
        free_travel: Travel from that place at which the spring is unloaded [m], in place of
            ``preload``.
        tension: Tension of the belt at rest that the carriage is to hold in the place of the drive
            [N], > 0, in place of ``preload``, which is found from it (``params.effective_pulleys``)
            so that spring and hung weight hold it together.
        damping: Damping beside the spring [N s/m], >= 0.
        friction: Force of Dahl friction in the guide, in full sliding [N], >= 0.
        friction_stiffness: Stiffness of that friction before it slides [N/m], >= 0; None or 0:
            chosen so that it develops within a hundredth of the pulley's radius.
        stops: Travels between which it can move, (lowest, highest) [m]; None: no stops.
        stop_stiffness: Stiffness of a stop [N/m], >= 0; None or 0: 50 times the stiffness with
            which the belt holds the carriage.
        stop_damping: Damping of a stop [N s/m], >= 0; None or 0: half of critical for a stiffness
            that is chosen, else 0.
    """

    _row: ClassVar[MountKind] = MountKind(
        name="slider",
        part="carriage",
        sense="forward",
        remark="Sliders: travel from the drawn place and forces along their direction.",
        guide="direction",
        free="free_travel",
        spring="spring, hung weight",
    )

    def _drawn(self, center: Array, radius: float) -> dict[str, Array]:
        start, end, tip = center + np.outer((-1.6, 1.6, 2.1), radius * self._direction(center))
        pull = {"pull": np.array([end, tip])} if self.weight > 0.0 else {}
        return {"guide": np.array([start, end])} | pull

    direction: tuple[float, float] = attrs.field(validator=_not_zero)
    mass: float
    weight: float = 0.0
    stiffness: float = 0.0
    preload: float | None = None
    free_travel: float | None = None
    tension: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    friction_stiffness: float | None = None
    stops: Stops = attrs.field(default=None, validator=_stops_in_order)
    stop_stiffness: float | None = None
    stop_damping: float | None = None


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
        displacement: Displacement of the axis from the pulley's place at these times (n_t, 2) [m];
            the first is (0, 0). The belt settles where the axis is at t = 0. Where points are steep
            the spline goes beyond them; ``print(params)`` says by how much.

    Raises:
        TypeError: Not real numbers.
        ValueError: Shapes that do not fit, times that do not increase, a first point that is not
            (0, 0).
    """

    _row: ClassVar[MountKind] = MountKind(
        name="path",
        part="axis",
        sense="",
        remark="Paths: distance of the axis from the drawn place.",
    )

    def _drawn(self, center: Array, _radius: float) -> dict[str, Array]:
        return {"way": center + self.displacement}

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
        return isinstance(other, Path) and self._to_core() == other._to_core()

    def __hash__(self) -> int:
        return hash(self._to_core())

    def _rows(self) -> list[tuple[str, str, str]]:
        span = f"{self.t[0]:.6g} to {self.t[-1]:.6g} s"
        return [("path", f"{self.t.size} points, {span}", "prescribed path of the axis")]

    def _to_core(self) -> tuple[Any, ...]:
        # Hashable: settled tensions are kept by the arguments of the core.
        return self._row.name, tuple(self.t.tolist()), tuple(map(tuple, self.displacement.tolist()))


Mount: TypeAlias = Arm | Slider | Path
#: Rows by name.
KINDS: dict[str, MountKind] = {cls._row.name: cls._row for cls in get_args(Mount)}
