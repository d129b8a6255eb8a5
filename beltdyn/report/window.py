"""Window of a report: its samples, means over them, whether it is steady, what drives the belt.

And where belt and pulleys touch in it: radii, stretch, slip and forces of the places.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..base.naming import span_names
from ..drive.compliance import running_radius
from ..drive.params import Params
from ..drive.route import Route, route_at
from ..drive.span import Span
from ..outputs.arcs import Arcs, arcs_of, contact_points, gross_slip, per_pulley
from ..outputs.averages import integral, mean_over, time_weights
from ..outputs.places import axes_at
from ..outputs.sampled import Sampled
from ..outputs.selection import named
from ..outputs.spans import mid_span
from .digits import number
from .rows import SCALES, Spread

#: The outputs that arcs are found from.
OF_ARCS = named(belt="x y phi", contact="pulley normal mu velocity")

#: The outputs that tell where belt and pulleys touch.
NEEDED = named(
    belt="x y phi vx vy flow",
    joints="deformation force",
    contact="pulley normal friction velocity",
)

#: Change of a mean between the halves of the window from which on it is not steady, of speeds over
#: the pulley's largest speed, of tensions over the mean tension: half of it is as much as a link
#: that lands does to a mean of some passings of links.
STEADY = 0.01
_HALVES = " from the first half of the window to the second"
#: Links that must pass in a window for a mean over the time of one to tell the mesh from the drive.
PASSINGS = 10.0
#: A belt stands still that moves by less than this part of a link, or is slower than this share of
#: the highest speed of its rims, or than errors of speeds leave, ``info["drag_speed"]``.
STANDSTILL_WAY, STANDSTILL_SPEED = 0.1, 1e-3


@attrs.frozen(eq=False, kw_only=True)
class Window:
    """The last part of a run, in samples."""

    run: Sampled
    rows: slice
    weights: Array  # of the trapezoidal rule over the times of these samples, of sum 1 (n_w,)
    notes: list[str] = attrs.field(factory=list)  # what could not be determined, and why

    @classmethod
    def last(cls, run: Sampled, share: float) -> Window:
        """Take the samples of this share of the run's time, counted from its end."""
        # two at least, at different times, where the run has them
        t = run.t
        if not t.size:
            raise ValueError("the run has no samples: give simulate a t_eval that has some")
        # A sample that stands at the beginning but for rounding belongs to it.
        begin = t[-1] - share * (t[-1] - t[0]) - 1e-9 * (t[-1] - t[0])
        earlier = int(np.searchsorted(t, t[-1])) - 1
        first = max(0, min(int(np.searchsorted(t, begin)), earlier))
        return cls(run=run, rows=slice(first, t.size), weights=time_weights(t[first:]))

    @property
    def params(self) -> Params:
        """The drive."""
        return self.run.params

    @property
    def t(self) -> Array:
        """Times of the samples (n_w,) [s]."""
        return np.asarray(self.run.t[self.rows])

    @property
    def lasts(self) -> float:
        """How long it is [s]."""
        return float(self.t[-1] - self.t[0])

    def missing(self, names: Collection[str]) -> list[str]:
        """Return the outputs, of these, that the belt has but the run was not asked for."""
        run = self.run
        return [name for name in names if not run._has(name) and name not in run._lacking]

    def lacks(self, parts: str, *names: str) -> bool:
        """Note that there are no such parts of a report if any of these outputs is missing."""
        if missing := self.missing(names):
            self.notes.append(f"{parts}: {', '.join(missing)} not asked for (outputs of simulate)")
        return bool(missing)

    # --- Samples ----------------------------------------------------------------------------------

    def of(self, history: NDArray[Any]) -> NDArray[Any]:
        """Return the samples of a history (n_t, ...) that are in the window."""
        return history[self.rows]

    def mean(self, samples: Array) -> Array:
        """Return the mean over time of samples in the window (n_w, ...), NaN left out."""
        return mean_over(self.weights, samples)

    def spread(self, samples: Array, passing: float = 0.0) -> Spread | None:
        """Return mean of samples (n_w,), least and most of running means; None: all NaN."""
        smooth = self.smoothed(samples, passing)
        there = smooth[~np.isnan(smooth)]
        if there.size == 0:
            return None
        return Spread(float(self.mean(samples)), float(there.min()), float(there.max()))

    def column(self, name: str, k: int) -> Array | None:
        """Return the samples of an output, as "pulleys.omega", of one of its places; None: none."""
        if not self.run._has(name):
            return None
        group, _, field = name.partition(".")
        return np.asarray(self.of(getattr(getattr(self.run, group), field))[:, k])

    def smoothed(self, samples: Array, width: float) -> Array:
        """Return the running mean over a time [s] of samples (n_w, ...), NaN left out.

        Over half of it, or less, at the ends there is no whole one: NaN; if it is longer than the
        window, the mean of the window.
        """
        t = self.t
        if not width < self.lasts:
            return np.broadcast_to(self.mean(samples), samples.shape)
        if width == 0.0:
            return samples
        half = 0.5 * width
        whole = (t >= t[0] + half * (1.0 - 1e-9)) & (t <= t[-1] - half * (1.0 - 1e-9))
        found = np.full(samples.shape, np.nan)
        columns = (one.reshape(t.size, -1).T for one in (samples, found))
        for column, smooth in zip(*columns, strict=True):
            there = ~np.isnan(column)
            summed, counted = (
                np.interp(t + half, t, total) - np.interp(t - half, t, total)
                for total in (
                    integral(t, np.where(there, column, 0.0)),
                    integral(t, there.astype(float)),
                )
            )
            known = whole & (counted > 0.5 * width)
            smooth[known] = summed[known] / counted[known]
        return found

    # --- The drive in it --------------------------------------------------------------------------

    @functools.cached_property
    def travels(self) -> Array | None:
        """Travels of the mounts (n_w, n_m); None without mounts, or not asked for."""
        travel = self.run._travel if self.run._has("mounts.travel") else None
        return None if travel is None else self.of(travel)

    @property
    def lost_mounts(self) -> bool:
        """Whether pulleys are on mounts whose travels the run was not asked for."""
        return bool(self.params.mounted) and self.travels is None

    @functools.cached_property
    def centers(self) -> Array:
        """Axes of the pulleys (n_w, n_p, 2) [m]; of mounts without travels, where these rest."""
        axes = axes_at(self.params, self.travels)
        return np.broadcast_to(axes, (self.t.size, *axes.shape[1:]))

    @functools.cached_property
    def arcs(self) -> Arcs:
        """Arcs of contact and slip at the samples (n_w, n_p)."""
        return arcs_of(self.run, self.centers, self.rows)

    @functools.cached_property
    def route(self) -> Route | None:
        """The way of the belt with the mounts at their mean travels; None: not known."""
        if self.travels is None:
            return None if self.params.mounted else self.params.route
        return route_at(self.params.pulleys, self.params.centers(self.mean(self.travels)))

    @functools.cached_property
    def spans(self) -> Array | None:
        """Tensions of the free spans at the samples (n_w, n_p) [N]; None: not kept."""
        if not self.run._has("span_tension"):
            return None
        return np.asarray(self.of(self.run.span_tension), dtype=float)

    @functools.cached_property
    def touching(self) -> Touching | None:
        """Contact and friction where they act; None: their outputs are missing."""
        return None if self.missing(NEEDED) else Touching(self)

    @functools.cached_property
    def middles(self) -> Array | None:
        """Tension in the middle of each span (n_w, n_p) [N], NaN: no belt there; None: not kept."""
        run = self.run
        places = "" if self.params._flows else "x y phi"
        if self.missing(named(belt=places, joints="force")):
            return None
        return mid_span(self.params, run.belt, run.joints.force, self.rows)

    # --- The belt in it ---------------------------------------------------------------------------

    @functools.cached_property
    def belt(self) -> Span | None:
        """The belt as it runs in the mean: its speed, tension, centrifugal tension."""
        if self.touching is None:
            return None
        belt, stretch = self.params.belt, float(self.mean(self.touching.stretch.mean(axis=1)))
        return Span(belt, belt.axial_stiffness * (stretch - 1.0), self.touching.flow)

    @functools.cached_property
    def pace(self) -> float:
        """Mean of the magnitude of the belt's flow [m/s]."""
        return 0.0 if self.touching is None else float(self.mean(np.abs(self.touching.flows)))

    @functools.cached_property
    def passing(self) -> float:
        """Time over which histories are averaged to remove the ripple of links [s].

        That in which a link passes, or as many links as the samples need to have four of them; 0
        where so few pass that no mean can tell them apart, and of cells, which do not.
        """
        length = float(self.params.info["link_length"])
        if self.params._flows or not self.pace * self.lasts > PASSINGS * length:
            return 0.0
        one = length / self.pace
        return one * max(1.0, math.ceil(4.0 * self.lasts / (self.t.size - 1) / one))

    @functools.cached_property
    def flows(self) -> Array:
        """Stress-free length that passes in a second, without the ripple of links (n_w,) [m/s]."""
        assert self.touching is not None
        return self.smoothed(self.touching.flows, self.passing)

    @property
    def reverses(self) -> bool:
        """Whether the belt's speed changes by more than its mean: no mean state exists."""
        assert self.touching is not None
        change = float(np.nanmax(self.flows) - np.nanmin(self.flows))
        return change > max(abs(self.touching.flow), float(self.params.info["drag_speed"]))

    @functools.cached_property
    def driver(self) -> int | None:
        """The pulley that puts in the most power, in the mean; None: the belt stands still.

        By the torques that are set; where none puts power in, as when a drive runs down, or none is
        known, by those of the belt.
        """
        run, on, info = self.run, self.touching, self.params.info
        if not run._has("pulleys.omega"):
            return None
        omega, radii = self.of(run.pulleys.omega), self.params._radii
        most = float(np.max(np.abs(run.pulleys.omega) * radii, initial=0.0))
        least = max(STANDSTILL_SPEED * most, float(info["drag_speed"]))
        if not float(np.max(self.mean(np.abs(omega)) * radii)) > least:
            return None
        moves = self.pace > least and self.pace * self.lasts > STANDSTILL_WAY * float(
            info["link_length"]
        )
        if on is not None and not moves:
            return None
        if run._has("pulleys.torque"):
            power = self.mean(self.of(run.pulleys.torque) * omega)
            if power.max() > 0.0 or on is None:
                return int(np.argmax(power))
        return 0 if on is None else int(np.argmin(self.mean(on.torques * omega)))

    def unsteady(self) -> list[str]:
        """Describe what changes between the halves of the window, the largest change first."""
        t, half = self.t, self.t.size // 2
        if half < 2:
            return ["whether it is steady cannot be judged from fewer than four samples"]
        middle = 0.5 * (t[0] + t[-1])
        halves = [np.where(part, self.weights, 0.0) for part in (t <= middle, t >= middle)]
        found: list[tuple[float, str]] = []
        names = self.params.pulley_names

        def look(samples: Array, name: str, unit: str, scale: float, least: float) -> None:
            before, after = (float(mean_over(weights, samples)) for weights in halves)
            change = abs(after - before)
            if change > max(STEADY * scale, least) > 0.0:
                ends = f"{number(before, 3)} to {number(after, 3)} {unit}"
                found.append((change / scale, f"the mean {name} goes from {ends}{_HALVES}"))

        if self.run._has("pulleys.omega"):
            omega, radii = self.of(self.run.pulleys.omega), self.params._radii
            scale, turns = float(np.max(np.abs(omega) * radii)), SCALES["1/min"]
            least = float(self.params.info["drag_speed"])  # what errors of speeds leave
            for name, samples, radius in zip(names, omega.T * turns, radii / turns, strict=True):
                look(samples, f"speed of {name}", "1/min", scale / radius, least / radius)
        spans, between = self.spans, span_names(names)
        if spans is not None and spans.shape[1] > 1:
            scale = float(np.nanmean(np.abs(spans))) if not np.isnan(spans).all() else 0.0
            for k, samples in enumerate(spans.T):
                look(samples, f"tension from {between[k]}", "N", scale, 0.0)
        return [text for _, text in sorted(found, key=lambda one: -one[0])]


# --- Where belt and pulleys touch -----------------------------------------------------------------


class Touching:
    """Contact and friction of a window where they act (MODEL sections 3, 4), each (n_w, n_b)."""

    def __init__(self, window: Window) -> None:
        run, rows = window.run, window.rows
        params, contact = run.params, run.contact
        facts, l0, n_p = params._belt_facts, float(params.info["link_length"]), len(params.pulleys)
        force = run.joints.force[rows]
        self.pulley = contact.pulley[rows]  # touched there, -1: none
        self.normal = contact.normal[rows]  # force [N]
        #: On the belt against the counter-clockwise tangent [N].
        self.friction = contact.friction[rows]
        if facts["flows"]:
            stretch = Span(params.belt, force).stretch
        else:
            deformation = run.joints.deformation[rows]
            if not facts["at_joints"]:  # friction acts between the joints, or bars, on both sides
                deformation = 0.5 * (deformation + np.roll(deformation, -1, axis=1))
            stretch = 1.0 + deformation / l0
        #: Length of the belt over its stress-free length there, lambda [1].
        self.stretch = stretch
        #: Stress-free length that passes in a second [m/s]: mean of the window, and at the samples
        #: (n_w,), in the order of the links.
        self.flow, self.flows = _flow(window, self.pulley, stretch)
        if facts["flows"]:
            radius = running_radius(params, params._radii[self.pulley], force, self.flows[:, None])
            chord = np.ones(1)
        else:
            axis = window.centers[np.arange(len(force))[:, None], np.maximum(self.pulley, 0)]
            radius = np.hypot(*np.moveaxis(contact_points(params, run.belt, rows) - axis, -1, 0))
            chord = _chord(0.5 * l0 / radius, stretch, facts)
        #: Radius of the arc that the polygon of links stands for there [m]: a joint stands off it,
        #: the middle of a link of the paper's mesh within it.
        self.running = radius * chord
        #: Slip, counter-clockwise, of belt on the arc of ``running`` [m/s].
        self.velocity = contact.velocity[rows] * chord
        #: Of the belt on the pulleys, counter-clockwise (n_w, n_p) [N m].
        self.torques = per_pulley(self.friction * radius, self.pulley, n_p)
        #: Where pulleys slip over their whole wrap; None: nowhere.
        self.gross = gross_slip(run, rows) if params.has_friction else None


def _chord(half: Array, stretch: Array, facts: _core.BeltFacts) -> Array:
    """Return the radius of the arc that a polygon stands for, over that of its corners."""
    # A pitch of belt, of the length l0 lambda, takes up an angle; that length over this angle is
    # the radius. Bars of a string stretch along their chord. Links do not, half = l0 / (2 radius)
    # is half of their angle but for its curve, and the gaps between them lie along the circle.
    if facts["stretches"]:
        chord = np.clip(half * stretch, 0.0, 1.0)
        return np.asarray(chord / np.arcsin(chord))
    angle = np.arctan(half) if facts["tangents"] else np.arcsin(np.clip(half, 0.0, 1.0))
    return np.asarray(stretch * half / (angle + (stretch - 1.0) * half))


def _flow(window: Window, touched: NDArray[np.int32], stretch: Array) -> tuple[float, Array]:
    """Return the stress-free length that passes in a second [m/s]: mean, and at the samples."""
    belt, of = window.run.belt, window.of
    if window.params._flows:
        flows = of(belt.flow)
        return float(window.mean(flows)), flows
    phi, free = of(belt.phi), touched < 0
    if not free.any():
        free = np.ones_like(free)
    # along themselves: what they have across is swing of the spans
    along = of(belt.vx) * np.cos(phi) + of(belt.vy) * np.sin(phi)
    moved = np.where(free, along, 0.0).sum(axis=1)
    length = np.where(free, stretch, 0.0).sum(axis=1)
    mean = float(window.mean(moved) / window.mean(length))
    return mean, np.divide(moved, length, out=np.full_like(moved, mean), where=length > 0.0)
