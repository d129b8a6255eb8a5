"""Slip in a report: ratios of tensions, friction in use, margins of torque.

Of the means of the window, and of its worst instants: what the drive does in a moment counts, not
what the mesh does, so histories are taken as running means over the time in which links pass.
"""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..drive.span import Span
from ..outputs.arcs import in_slip
from ..outputs.gross_slip import durations
from .rows import PulleyRow, Spread
from .slip_torque import FullSlip, Steady, full_slip
from .touching import Touching
from .window import Window

__all__ = ["friction_limits", "slip_rows"]

#: A pulley whose torque changes the tension by less than this share of the mean one is an idler:
#: what the drag of its bearings takes is no torque that one would let grow.
IDLE = 0.01
#: Part of the friction in use at the worst instant from which on an idler in the mean is none.
SWINGS = 0.3
#: What the search for full slip raises where it finds none.
_NO_STATE = (ValueError, np.linalg.LinAlgError)


def friction_limits(window: Window, touching: Touching) -> Array:
    """Return the friction coefficient that each pulley's law reaches in this window (n_p,) [1].

    Where it depends on the slip velocity (Stribeck), the highest at the slip velocities of the
    window; else that of full slip. A pulley that begins to slip in full slips faster than these.
    """
    params = window.params
    limits = np.array(params._slip_limits[0], dtype=float)
    for k in range(limits.size):
        law = params.friction_on(k)
        velocity = touching.velocity[(touching.pulley == k) & (touching.normal > 0.0)]
        if law is None or velocity.size == 0:
            continue
        found = in_slip(law, float(limits[k]), velocity)
        if found is not None:
            limits[k] = float(np.max(found))
    return limits


def slip_rows(
    window: Window,
    touching: Touching,
    driver: int | None,
    rows: list[PulleyRow],
    margins: bool = True,
) -> list[PulleyRow]:
    """Add ratios of tensions, friction in use and margins; note what is missing."""
    spans, way = window.spans(), window.route()
    if spans is None or spans.shape[1] < 2 or way is None:
        return rows
    tension = window.mean(spans)
    if np.isnan(tension).any():
        return rows
    return _Slipping(window, touching, driver, spans, way.wraps).rows(tension, rows, margins)


class _Slipping:
    def __init__(
        self, window: Window, touching: Touching, driver: int | None, spans: Array, wraps: Array
    ) -> None:
        self.window, self.touching, self.wraps = window, touching, wraps
        self.params, self.driver = window.params, driver
        # A pulley in full slip gets faster: a law that falls is down to what it has in fast slip.
        self.mu = np.array(self.params._slip_limits[0], dtype=float)
        self.reached = friction_limits(window, touching)
        self.radii = self.params._radii
        # A shorter wrap is now and then without a link, and nothing holds its spans apart.
        least = 0.0 if self.params._belt_facts["flows"] else self.params.info["link_length"]
        self.holds = wraps * self.radii >= least
        self.notes = window.notes
        width = touching.passing(window)
        self.tensions = window.smoothed(spans, width)
        self.speeds = window.smoothed(touching.speeds[:, None], width)[:, 0]
        self.torques = window.smoothed(touching.torques, width)
        self.slips: NDArray[np.bool_] = np.zeros(self.radii.size, dtype=np.bool_)
        if touching.gross is not None:
            self.slips = np.asarray(np.any(touching.gross.slips, axis=0), dtype=np.bool_)
        travels = window.travels()
        self.travels = np.zeros((window.t.size, 0)) if travels is None else travels

    def rows(self, tension: Array, rows: list[PulleyRow], margins: bool) -> list[PulleyRow]:
        rows = self._ratios(tension, rows)
        self._full_slips()
        if margins:
            rows = self._margins(tension, rows)
        self._curves(rows)
        return rows

    def _used(self, pull: Array) -> Array:
        """Return the part of the friction in use, from tensions less rho v^2 (..., n_p)."""
        before = np.roll(pull, 1, axis=-1)
        tight, slack = np.maximum(pull, before), np.minimum(pull, before)
        with np.errstate(divide="ignore", invalid="ignore"):
            used = np.log(tight / slack) / (self.mu * self.wraps)
        used = np.where(slack > 0.0, used, np.inf)
        unknown = np.isnan(pull) | np.isnan(before) | (self.mu == 0.0) | ~self.holds
        return np.where(unknown, np.nan, used)

    def _ratios(self, tension: Array, rows: list[PulleyRow]) -> list[PulleyRow]:
        params = self.params
        pull = Span(self.params.belt, tension, self.touching.speed).pull
        spans = Span(self.params.belt, self.tensions, self.speeds[:, None])
        self.over_time = self._used(spans.pull)
        mean = self._used(pull)
        found = []
        for k, row in enumerate(rows):
            tight, slack = max(pull[k], pull[k - 1]), min(pull[k], pull[k - 1])
            changes: dict[str, Any] = {"tight": float(tight), "slack": float(slack)}
            if not self.holds[k]:
                self.notes.append(
                    f"{params.label(k)}: less than a link lies on it, and when none does friction "
                    "does not hold its spans apart: no ratio of tensions, no friction in use"
                )
            elif slack > 0.0:
                changes["ratio"] = float(tight / slack)
            else:
                self.notes.append(
                    f"{params.label(k)}: its slack span is slack, {slack:.3g} N less rho v^2: "
                    "there is no ratio of tensions"
                )
            if self.mu[k] > 0.0:
                with np.errstate(over="ignore"):  # of a belt that cannot slip: unlimited
                    changes["limit"] = float(np.exp(self.mu[k] * self.wraps[k]))
                if slack > 0.0 and self.holds[k]:
                    changes["used"] = float(mean[k])
                history = self.over_time[:, k]
                if not np.isnan(history).all():
                    finite = np.where(np.isinf(history), np.nan, history)
                    ends = float(np.nanmin(history)), float(np.nanmax(history))
                    changes["used_range"] = Spread(float(self.window.mean(finite)), *ends)
            elif params.has_friction:
                self.notes.append(
                    f"{params.label(k)} has no friction: it can hold no torque of the belt"
                )
            found.append(attrs.evolve(row, **changes))
        return found

    def _falls(self) -> NDArray[np.bool_]:
        """Return on which pulleys friction is higher in this window than in fast slip."""
        return np.asarray(self.reached > 1.01 * self.mu)

    def _curves(self, rows: list[PulleyRow]) -> None:
        """Describe where friction falls once a pulley slips, and what it holds until then."""
        for k in np.flatnonzero(self._falls()):
            held = rows[k].sticking_margin
            until = ""
            if held is not None and math.isfinite(held):
                until = f"; with {self.reached[k]:.3g}, while nothing makes it slip, {held:.2g}"
            self.notes.append(
                f"{self.params.label(int(k))}: friction falls with slip velocity, from "
                f"{self.reached[k]:.3g} at those of this window to {self.mu[k]:.3g} in fast slip. "
                f"Limit, part in use and margin are for {self.mu[k]:.3g}{until}"
            )

    def _full_slips(self) -> None:
        gross = self.touching.gross
        if gross is None:
            return
        t, lasts = self.window.t, durations(self.window.t)
        for k in np.flatnonzero(self.slips):
            during = np.flatnonzero(gross.slips[:, k])
            whole = float(np.sum(lasts[during]))
            self.notes.append(
                f"full_slip: {self.params.label(int(k))} slips over its whole wrap in this window, "
                f"for {whole:.3g} of {self.window.lasts:.3g} s between t = {t[during[0]]:.4g} and "
                f"{t[during[-1]]:.4g} s, by {gross.slip_distance[k]:.2g} m: it has no margin left"
            )

    # --- Margins ----------------------------------------------------------------------------------

    def _margins(self, tension: Array, rows: list[PulleyRow]) -> list[PulleyRow]:
        params, window = self.params, self.window
        if not params.has_friction:
            return rows
        torque = window.mean(self.touching.torques)
        scale = IDLE * float(np.mean(tension))
        most = np.max(np.abs(np.nan_to_num(self.torques)), axis=0)
        in_mean = (self.mu > 0.0) & (np.abs(torque) / self.radii > scale)
        used = np.nanmax(np.nan_to_num(self.over_time), axis=0)
        swings = (self.mu > 0.0) & (most / self.radii > scale) & (used > SWINGS)
        working = in_mean | swings
        if not working.any():
            self.notes.append("no margin to slip: the belt hands on no torque in this window")
            return [self._capped(row, k) for k, row in enumerate(rows)]
        none = ~working & ~self.slips & (self.mu > 0.0)  # that of a pulley that slips is used up
        idle = [row.name for k, row in enumerate(rows) if none[k]]
        if idle:
            self.notes.append(f"no margin to slip, for want of a load: {', '.join(idle)}")
        rows = self._of_means(tension, torque, in_mean, rows)
        rows = [self._worst(row, k) if working[k] else row for k, row in enumerate(rows)]
        return [self._capped(row, k) for k, row in enumerate(rows)]

    def _of_means(
        self, tension: Array, torque: Array, working: Any, rows: list[PulleyRow]
    ) -> list[PulleyRow]:
        """Add the factors by which mean torques can grow, all together and each by itself."""
        if not working.any():
            return rows
        if self.driver is not None and self.touching.reverses(self.window):
            mean = float(np.mean(tension))
            low, high = (
                Span(self.params.belt, mean, end(self.speeds)).speed
                for end in (np.nanmin, np.nanmax)
            )
            self.notes.append(
                f"no margin of mean torques: the belt's speed goes from {low:.3g} to "
                f"{high:.3g} m/s in this window"
            )
            return rows
        driver, speed = self.driver, self.touching.speed
        if driver is None:  # it stands still: what holds it makes up for the rest
            driver, speed = int(np.argmax(np.abs(torque))), 0.0
        travels, sticking = self.window.mean(self.travels), []
        state = self._state(driver, tension, torque, speed, travels)
        try:
            together = full_slip(state)
            if self._falls().any():
                sticking = full_slip(attrs.evolve(state, friction=self.reached))
        except _NO_STATE as error:
            self.notes.append(f"no margin of mean torques: {error}")
            return rows
        found = []
        for k, (row, one) in enumerate(zip(rows, together, strict=True)):
            if working[k] and one is not None:
                row = attrs.evolve(row, margin=one.factor)
                if math.isfinite(one.factor):
                    row = attrs.evolve(row, slip_torque=one.torque, slip_tensions=one.tensions)
                if sticking and (held := sticking[k]) is not None and self._falls()[k]:
                    row = attrs.evolve(row, sticking_margin=held.factor)
                alone = one if k == driver else _found(state, k, alone=True)
                if alone is not None:
                    own = None if math.isinf(alone.factor) else alone.torque
                    row = attrs.evolve(row, own_margin=alone.factor, own_slip_torque=own)
            found.append(row)
        return found

    def _worst(self, row: PulleyRow, k: int) -> PulleyRow:
        """Add the margin at the instant at which most of the friction is in use."""
        history = self.over_time[:, k]
        if np.isnan(history).all():
            return row
        at = int(np.nanargmax(history))
        when = float(self.window.t[at])
        if math.isinf(history[at]):
            return attrs.evolve(row, least_margin=1.0, worst_time=when)
        torque, speed = self.torques[at], float(self.speeds[at])
        if self.driver is None:
            driver, speed = int(np.argmax(np.abs(torque))), 0.0
        else:
            driver = int(np.argmin(torque * self.window.of(self.window.run.pulleys.omega)[at]))
        state = self._state(driver, self.tensions[at], torque, speed, self.travels[at])
        one = _found(state, k)
        if one is None or (math.isinf(one.factor) and row.margin is None):
            return row
        return attrs.evolve(row, least_margin=one.factor, worst_time=when)

    def _state(
        self, driver: int, tension: Array, torque: Array, speed: float, travel: Array
    ) -> Steady:
        return Steady(
            params=self.params,
            tension=tension,
            torque=torque,
            speed=speed,
            driver=driver,
            travel=travel,
            friction=self.mu,
        )

    def _capped(self, row: PulleyRow, k: int) -> PulleyRow:
        """Limit the margins of a pulley that slips in full; the least is at most that of means."""
        margins: dict[str, Any] = {"margin": row.margin, "least_margin": row.least_margin}
        others: dict[str, Any] = {
            "own_margin": row.own_margin,
            "sticking_margin": row.sticking_margin,
        }
        if self.slips[k]:
            margins = {name: 1.0 if one is None else min(one, 1.0) for name, one in margins.items()}
            others = {name: one if one is None else min(one, 1.0) for name, one in others.items()}
        known = [one for one in margins.values() if one is not None]
        if len(known) == 2:
            margins["least_margin"] = min(known)
        return attrs.evolve(row, **margins, **others)


def _found(state: Steady, k: int, *, alone: bool = False) -> FullSlip | None:
    """Find the torque at which a pulley slips, by itself or if its own alone grows, if there is."""
    try:
        return full_slip(state, [k], alone=alone)[0]
    except _NO_STATE:
        return None
