"""Rows of a report: pulley, span, mount, creep, power, load cycle."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Generic, TypeVar, overload

import attrs
from attrs import NOTHING

from ..base.described import quantity, with_units
from ..base.run_warnings import RunWarning
from ..outputs.accuracy_report import Accuracy

#: Name of the power that the energy ledger lacks: its error.
RESIDUAL = "not accounted for (residual)"

#: Margins that differ by less, to which they are found, are one: on two pulleys they always are.
TOGETHER = 1e-6

#: Factors of units that are printed in place of those of the rows.
SCALES = {"1/min": 30.0 / math.pi, "deg": 180.0 / math.pi, "mm": 1e3, "%": 100.0}

_Row = TypeVar("_Row")


@attrs.frozen
class Spread:
    """A quantity over the window: its mean over time, least and largest sample."""

    mean: float
    least: float
    most: float


@with_units
@attrs.frozen(kw_only=True)
class PulleyRow:
    """A pulley over the window. None: not known; ``Report.notes`` says why.

    Attributes:
        name: Its name, "pulley 3" if it has none.
        prescribed: Whether its motion was given, and its speed is exact.
        speed: Angular velocity, counter-clockwise.
        rim_speed: Angular velocity of the rim of a pulley with a coupling, or of the ring of a
            torsional damper; None: it has none, or it was not asked for.
        windup: Windup of the coupling.
        overruns: Share of the time in which an overrunning clutch is free.
        torque: Torque set on it or, where its motion is prescribed, that it needs.
        power: Power of that torque, positive where it drives.
        belt_torque: Mean torque of the belt on it, counter-clockwise.
        hub_load: Magnitude of the belt's force on its bearings: the pull of its two spans, T -
            rho v^2 each in the direction of the span, with the tension in its middle, and the
            weight of the belt. Not from ``result.pulleys.load``, the contact forces, which
            fluctuate as links land.
        hub_direction: Direction of the mean of that force, counter-clockwise from x.
        wrap: Angle of the belt line on it, with mounts at their mean places.
        links: Length of the wrap in links or cells.
        slip_arc: Mean part of the wrap where friction is within 5 % of its limit.
        slip_error: Error of the slip arc: a quarter of a link, and what landing links may have
            taken off it where the belt creeps back (``Arcs.returning``), to a factor of three.
        slip_share: Slip arc over the wrap, from links in contact (:class:`beltdyn.Arcs`).
        slip_range: Least and largest slip share, without the ripple of passing links.
        tight: Mean tension of the tighter of its two spans, less rho v^2.
        slack: The same of the other one.
        ratio: ``tight`` over ``slack``.
        limit: The ratio in full slip, exp(mu wrap), with the wrap of the belt line. Where
            friction falls with slip velocity, mu here and below is that of fast slip.
        used: Part of the wrap's friction in use by the mean tensions, ln(ratio) / (mu wrap);
            None, as ``ratio``, where less than a link lies on it.
        used_range: The same at single instants, without the ripple of passing links; infinite where
            its slack span loses its tension.
        margin: Factor by which all mean torques can grow before it slips in full; infinite if
            others slip long before, so that it does not; at most 1 if it slips in full in the
            window.
        sticking_margin: Where friction falls with slip velocity, the same by the most that it has
            in the window: it is lost as soon as something makes the pulley slip.
        slip_torque: Torque of the belt on it in full slip, from mean values: the mean torque
            times ``margin``, except where momentary slip in the window has used the margin up.
        slip_tensions: Tensions of its tight and slack span then.
        least_margin: The margin at its worst instant, that with the most friction in use.
        worst_time: That instant.
        own_margin: Factor by which its mean torque alone can grow, which the driving pulley makes
            up for, before one of the two, or any other, slips in full; infinite if a span that
            is not its own goes slack before.
        own_slip_torque: Torque of the belt on it then.
    """

    name: str
    prescribed: bool = False
    speed: Spread | None = quantity("rad/s")
    rim_speed: Spread | None = quantity("rad/s")
    windup: Spread | None = quantity("rad")
    overruns: float | None = quantity("1")
    torque: Spread | None = quantity("N m")
    power: Spread | None = quantity("W")
    belt_torque: float | None = quantity("N m")
    hub_load: Spread | None = quantity("N")
    hub_direction: float | None = quantity("rad")
    wrap: float | None = quantity("rad")
    links: float | None = quantity("1")
    slip_arc: float | None = quantity("rad")
    slip_error: float | None = quantity("rad")
    slip_share: float | None = quantity("1")
    slip_range: Spread | None = None
    tight: float | None = quantity("N")
    slack: float | None = quantity("N")
    ratio: float | None = quantity("1")
    limit: float | None = quantity("1")
    used: float | None = quantity("1")
    used_range: Spread | None = None
    margin: float | None = quantity("1")
    sticking_margin: float | None = quantity("1")
    slip_torque: float | None = quantity("N m")
    slip_tensions: tuple[float, float] | None = quantity("N")
    least_margin: float | None = quantity("1")
    worst_time: float | None = quantity("s")
    own_margin: float | None = quantity("1")
    own_slip_torque: float | None = quantity("N m")

    @property
    def least(self) -> float:
        """The least of ``margin`` and ``least_margin``; infinite if neither is known [1]."""
        known = [one for one in (self.margin, self.least_margin) if one is not None]
        return min(known, default=math.inf)


@with_units
@attrs.frozen(kw_only=True)
class SpanRow:
    """A free span over the window. None: not known; ``Report.notes`` says why.

    Attributes:
        name: The pulleys that it is between, as "crank to pulley 1".
        length: Length of its tangent; None: the places of mounts are not known.
        tension: Mean of the free joints; least and largest in its middle, of running means over the
            passing of a link.
        of_run: Mean tension of its joints over all of the run, the least and the largest.
        absent: Share of the samples of the run in which it has no tension, as no link of it is free
            between its pulleys or none touches one of them.
        frequency: Frequency of the dominant line in the spectrum of the tension in its middle;
            None: there is none.
        amplitude: Amplitude of that line.
        link_passing: Whether that is the frequency with which links pass, a multiple of it, or its
            alias at this sampling: of the mesh, not of the drive. None: the window cannot tell,
            being too short or the speed uneven, or because something else is as near.
        lateral: First frequency of the span as a moving string, (c^2 - v^2) / (2 l c) with the
            wave speed c; 0 where the belt is faster than the wave.
    """

    name: str
    length: float | None = quantity("m", NOTHING)
    tension: Spread | None = quantity("N")
    of_run: Spread | None = quantity("N")
    absent: float = 0.0
    frequency: float | None = quantity("Hz")
    amplitude: float | None = quantity("N")
    link_passing: bool | None = False
    lateral: float | None = quantity("Hz")


@with_units
@attrs.frozen(kw_only=True)
class MountRow:
    """An arm, slider or path over the window. None: it has no such part, or it is not known.

    For an arm, travels are angles [rad], counter-clockwise, and forces are torques [N m]; for a
    slider, travels are distances along its direction [m]. Forces are positive in the sense of the
    travel.

    Attributes:
        name: Name of its pulley.
        kind: "arm", "slider" or "path".
        travel: Travel from its place in the drive; for a path the distance of the axis
            from there [m].
        to_stop: Distance to the nearer stop; negative: it presses on it.
        spring: Force of the spring, with preload and hung weight.
        damper: Force of the damper.
        friction: Friction in its pivot or guide.
        stop: Force of the stops.
        belt: Force of the belt on it: mean of the contact forces, range from the
            tensions in the middle of the spans, as ``PulleyRow.hub_load``. Not for a path, whose
            hub load it is.
        frequency: Frequency of the dominant line in the spectrum of the travel; None: there is
            none.
        amplitude: Amplitude of that line.
    """

    name: str
    kind: str
    travel: Spread | None = quantity("rad or m")
    to_stop: Spread | None = quantity("rad or m")
    spring: Spread | None = quantity("N m or N")
    damper: Spread | None = quantity("N m or N")
    friction: Spread | None = quantity("N m or N")
    stop: Spread | None = quantity("N m or N")
    belt: Spread | None = quantity("N m or N")
    frequency: float | None = quantity("Hz")
    amplitude: float | None = quantity("rad or m")


@with_units
@attrs.frozen(kw_only=True)
class Creep:
    """Why a pulley is slower than the driving one. Parts are -ln of ratios, and so add up [1].

    Attributes:
        name: The pulley.
        ratio: Speed over that of the driving pulley, omega_k / omega_d.
        nominal: That by the radii, R_d / R_k, with the sign of the sides.
        lost: -ln(ratio / nominal): speed lost against the driving pulley's rim.
        stretch: Part due to the belt's stretch: it arrives less stretched than at the driving
            pulley.
        friction: Part due to the slip that friction needs where the belt should stick, on both
            pulleys. Negative where friction already acts while the belt is sinking in, further out.
        radius: Part due to running radii: the belt sinks into pulleys, deeper where it is tighter
            and, over the radius, into smaller ones.
        remainder: Rest of ``lost``: unsteady motion, sampling.
    """

    name: str
    ratio: float = quantity("1", NOTHING)
    nominal: float = quantity("1", NOTHING)
    lost: float
    stretch: float
    friction: float
    radius: float
    remainder: float

    @property
    def creep(self) -> float:
        """Creep proper: motion of the belt against the rim, from stretch and friction [1]."""
        return self.stretch + self.friction

    @property
    def slower(self) -> float:
        """Speed lost over that of the driving pulley's rim, 1 - ratio / nominal [1]."""
        return -math.expm1(-self.lost)

    @property
    def as_share(self) -> float:
        """Factor with which the parts add up to ``slower`` in place of ``lost`` [1]."""
        return self.slower / self.lost if self.lost != 0.0 else 1.0


@with_units
@attrs.frozen(kw_only=True)
class Power:
    """Where power goes, mean over the window.

    Attributes:
        name: Name of a pulley or a loss.
        kind: "in" (put in by a pulley), "out" (taken off by one), "lost", "stored" or "left".
        power: Magnitude; the input power is the sum of all others.
        share: Share of the input power; None where there is none.
    """

    name: str
    kind: str
    power: float = quantity("W", NOTHING)
    share: float | None = quantity("1")


@with_units
@attrs.frozen(kw_only=True)
class Cycle:
    """Cycles of the force in a joint, counted by rainflow (ASTM E1049-85).

    Attributes:
        range: Range from lowest to highest force, mean of the class.
        mean: Mean force, mean of the class.
        count: Number of cycles; those not closed count one half.
    """

    range: float = quantity("N", NOTHING)
    mean: float = quantity("N", NOTHING)
    count: float = quantity("1", NOTHING)


class Rows(tuple[_Row, ...], Generic[_Row]):
    """Rows by index or by name, ``rows["crank"]``."""

    __slots__ = ()

    def __new__(cls, rows: Iterable[_Row] = ()) -> Rows[_Row]:  # noqa: D102
        return super().__new__(cls, tuple(rows))

    @overload  # type: ignore[override]
    def __getitem__(self, key: int | str) -> _Row: ...

    @overload
    def __getitem__(self, key: slice) -> tuple[_Row, ...]: ...

    def __getitem__(self, key: int | str | slice) -> Any:
        if not isinstance(key, str):
            try:
                return super().__getitem__(key)
            except IndexError:
                raise IndexError(f"there are {len(self)} rows, from 0, got {key}") from None
        for row in self:
            if getattr(row, "name", None) == key:
                return row
        raise KeyError(f"there is no {key!r}, there are {', '.join(self.names())}")

    def names(self) -> tuple[str, ...]:
        """Return the names of the rows."""
        return tuple(str(getattr(row, "name", "")) for row in self)


@with_units
@attrs.frozen(kw_only=True)
class ReportData:
    """Data of a report.

    Attributes:
        begin: First sample of the window.
        end: Last one.
        samples: Number of samples.
        ended_early: How the run ended, if that was before its end: the state then is mostly not
            one that it would have come to. None: it reached its end.
        driver: Name of the pulley that drives the belt; None if the belt stands still.
        belt_speed: Mean speed of the belt in the order of its links, along itself.
        belt_speeds: The same with its range, without the ripple of passing links.
        rest_tension: Mean tension of the belt at rest; None with the paper's mesh, on which it
            is higher on pulleys than in spans.
        mass_tension: Centrifugal tension rho v^2, the part of every tension that turns the belt.
        pulleys: A row for each pulley.
        spans: A row for each free span; none with one pulley.
        mounts: A row for each arm, slider and path.
        creep: A row for each pulley but the driving one.
        powers: Power balance; the input power is the sum of all others.
        efficiency: Share of the input power that is not lost.
        efficiency_error: Error of ``efficiency`` or, where that is None, of the share of the input
            power that is lost: from the errors of the powers if the run was verified; else the
            losses that the mesh adds, nearly all in the contact's dampers as links land.
        power_error: Error of the powers, relative to the largest of a pulley in the run, as
            ``result.accuracy`` has it.
        tension_error: Error of the spans' mean tensions, as ``result.accuracy`` has it.
        creep_error: The same of creep, relative to the largest; None without verification.
        nodes: What the belt consists of: "links", "point masses", or "cells", which stand still.
        cycles: Load cycles of a joint, largest range first; of an ALE belt those of the belt that
            is in the middle of a cell at the end.
        joint: That joint, or cell.
        cycles_begin: Time from which they are counted: a round of the belt before the end of
            the run, or the beginning of the window if that is earlier.
        rounds: Rounds that the belt makes from then on.
        unsteady: What is not steady in the window, and by how much; empty: it is steady.
        notes: What could not be determined, and why.
        accuracy: Errors of the run as far as they are known, ``result.accuracy``.
        warnings: Warnings of the run, ``result.warnings``.
    """

    begin: float = quantity("s", NOTHING)
    end: float = quantity("s", NOTHING)
    samples: int
    ended_early: str | None = None
    driver: str | None
    belt_speed: float | None = quantity("m/s", NOTHING)
    belt_speeds: Spread | None = quantity("m/s", NOTHING)
    rest_tension: float | None = quantity("N", NOTHING)
    mass_tension: float | None = quantity("N", NOTHING)
    pulleys: Rows[PulleyRow]
    spans: Rows[SpanRow]
    mounts: Rows[MountRow]
    creep: Rows[Creep]
    powers: Rows[Power]
    efficiency: float | None = quantity("1", NOTHING)
    efficiency_error: float | None = quantity("1", NOTHING)
    power_error: float | None = quantity("1", NOTHING)
    tension_error: float | None = quantity("1", NOTHING)
    creep_error: float | None = quantity("1", NOTHING)
    nodes: str
    cycles: tuple[Cycle, ...]
    joint: int
    cycles_begin: float = quantity("s", NOTHING)
    rounds: float | None
    unsteady: tuple[str, ...]
    notes: tuple[str, ...]
    accuracy: Accuracy
    warnings: tuple[RunWarning, ...]

    @property
    def first_to_slip(self) -> PulleyRow | None:
        """The pulley with the least margin, of means or instants; None if none slips.

        Of several that slip together the first.
        """
        finite = [row for row in self.pulleys if math.isfinite(row.least)]
        together = min((row.least for row in finite), default=math.inf) * (1.0 + TOGETHER)
        return next((row for row in finite if row.least <= together), None)
