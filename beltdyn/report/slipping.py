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
from ..outputs.averages import durations, span_of
from .rows import Spread
from .slip_torque import FullSlip, Steady, full_slip
from .window import Window

#: A pulley whose torque changes the tension by less than this share of the mean one is an idler:
#: what the drag of its bearings takes is no torque that one would let grow.
IDLE = 0.01
#: Part of the friction in use at the worst instant from which on an idler in the mean is none.
SWINGS = 0.3
#: What the search for full slip raises where it finds none.
_NO_STATE = (ValueError, np.linalg.LinAlgError)


def friction_limits(window: Window) -> Array:
    """Return the friction coefficient that each pulley's law reaches in this window (n_p,) [1].

    Where it depends on the slip velocity (Stribeck), the highest at the slip velocities of the
    window; else that of full slip. A pulley that begins to slip in full slips faster than these.
    """
    params, touching = window.params, window.touching
    assert touching is not None
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


def slips_of(window: Window, margins: bool = True) -> list[dict[str, Any]]:
    """Return ratios of tensions, friction in use and margins by pulley; note what is missing."""
    spans, way = window.spans, window.route
    none: list[dict[str, Any]] = [{} for _ in window.params.pulleys]
    if window.touching is None or spans is None or spans.shape[1] < 2 or way is None:
        return none
    tension = window.mean(spans)
    if np.isnan(tension).any():
        return none
    slipping = _Slipping(window, spans, way.wraps, tension)
    slipping.add_ratios()
    slipping.note_full_slips()
    if margins:
        slipping.add_margins()
    slipping.note_falling_friction()
    return slipping.found


class _Slipping:
    """What is found of each pulley, by the fields of its row."""

    def __init__(self, window: Window, spans: Array, wraps: Array, tension: Array) -> None:
        assert window.touching is not None
        self.window, self.touching, self.wraps = window, window.touching, wraps
        self.params, self.notes, self.tension = window.params, window.notes, tension
        # A pulley in full slip gets faster: a law that falls is down to what it has in fast slip.
        self.mu = np.array(self.params._slip_limits[0], dtype=float)
        self.reached = friction_limits(window)
        self.falls = self.reached > 1.01 * self.mu
        self.radii = self.params._radii
        # A shorter wrap is now and then without a link, and nothing holds its spans apart.
        least = 0.0 if self.params._flows else self.params.info["link_length"]
        self.holds = wraps * self.radii >= least
        self.tensions = window.smoothed(spans, window.passing)
        self.flows = window.flows
        self.torques = window.smoothed(self.touching.torques, window.passing)
        over_time = Span(self.params.belt, self.tensions, self.flows[:, None])
        self.over_time = self._used(over_time.pull)
        self.slips: NDArray[np.bool_] = np.zeros(self.radii.size, dtype=np.bool_)
        if self.touching.gross is not None:
            self.slips = np.asarray(self.touching.gross.slips.any(axis=0))
        none = np.zeros((window.t.size, 0))
        self.travels = none if window.travels is None else window.travels
        self.found: list[dict[str, Any]] = [{} for _ in self.radii]

    def _used(self, pull: Array) -> Array:
        """Return the part of the friction in use, from tensions less rho v^2 (..., n_p)."""
        before = np.roll(pull, 1, axis=-1)
        tight, slack = np.maximum(pull, before), np.minimum(pull, before)
        with np.errstate(divide="ignore", invalid="ignore"):
            used = np.log(tight / slack) / (self.mu * self.wraps)
        used = np.where(slack > 0.0, used, np.inf)
        unknown = np.isnan(pull) | np.isnan(before) | (self.mu == 0.0) | ~self.holds
        return np.where(unknown, np.nan, used)

    def add_ratios(self) -> None:
        params = self.params
        pull = Span(params.belt, self.tension, self.touching.flow).pull
        mean = self._used(pull)
        for k, found in enumerate(self.found):
            tight, slack = float(max(pull[k], pull[k - 1])), float(min(pull[k], pull[k - 1]))
            found |= {"tight": tight, "slack": slack}
            if not self.holds[k]:
                self.notes.append(
                    f"{params.label(k)}: less than a link lies on it, and when none does friction "
                    "does not hold its spans apart: no ratio of tensions, no friction in use"
                )
            elif slack > 0.0:
                found["ratio"] = tight / slack
            else:
                self.notes.append(
                    f"{params.label(k)}: its slack span is slack, {slack:.3g} N less rho v^2: "
                    "there is no ratio of tensions"
                )
            if self.mu[k] > 0.0:
                with np.errstate(over="ignore"):  # of a belt that cannot slip: unlimited
                    found["limit"] = float(np.exp(self.mu[k] * self.wraps[k]))
                if slack > 0.0 and self.holds[k]:
                    found["used"] = float(mean[k])
                history = self.over_time[:, k]
                if not np.isnan(history).all():
                    finite = np.where(np.isinf(history), np.nan, history)
                    ends = float(np.nanmin(history)), float(np.nanmax(history))
                    found["used_range"] = Spread(float(self.window.mean(finite)), *ends)
            elif params.has_friction:
                self.notes.append(
                    f"{params.label(k)} has no friction: it can hold no torque of the belt"
                )

    def note_full_slips(self) -> None:
        gross, t, lasts = self.touching.gross, self.window.t, durations(self.window.t)
        for k in np.flatnonzero(self.slips).tolist():
            assert gross is not None
            during = gross.slips[:, k]
            whole = float(np.sum(lasts[during]))
            self.notes.append(
                f"full_slip: {self.params.label(k)} slips over its whole wrap in this window, "
                f"for {whole:.3g} of {self.window.lasts:.3g} s {span_of(t[during])}, by "
                f"{gross.slip_distance[k]:.2g} m: it has no margin left"
            )

    def note_falling_friction(self) -> None:
        """Describe where friction falls once a pulley slips, and what it holds until then."""
        for k in np.flatnonzero(self.falls).tolist():
            held, until = self.found[k].get("sticking_margin"), ""
            if held is not None and math.isfinite(held):
                until = f"; with {self.reached[k]:.3g}, while nothing makes it slip, {held:.2g}"
            self.notes.append(
                f"{self.params.label(k)}: friction falls with slip velocity, from "
                f"{self.reached[k]:.3g} at those of this window to {self.mu[k]:.3g} in fast slip. "
                f"Limit, part in use and margin are for {self.mu[k]:.3g}{until}"
            )

    # --- Margins ----------------------------------------------------------------------------------

    def add_margins(self) -> None:
        if not self.params.has_friction:
            return
        torque = self.window.mean(self.touching.torques)
        scale = IDLE * float(np.mean(self.tension))
        most = np.max(np.abs(np.nan_to_num(self.torques)), axis=0)
        used = np.nanmax(np.nan_to_num(self.over_time), axis=0)
        in_mean = (self.mu > 0.0) & (np.abs(torque) / self.radii > scale)
        swings = (self.mu > 0.0) & (most / self.radii > scale) & (used > SWINGS)
        working = in_mean | swings
        if working.any():
            none = ~working & ~self.slips & (self.mu > 0.0)  # that of one that slips is used up
            idle = [self.params.pulley_names[k] for k in np.flatnonzero(none)]
            if idle:
                self.notes.append(f"no margin to slip, for want of a load: {', '.join(idle)}")
            if in_mean.any():
                self._add_margins_of_means(torque, in_mean)
            for k in np.flatnonzero(working).tolist():
                self._add_worst(k)
        else:
            self.notes.append("no margin to slip: the belt hands on no torque in this window")
        for found, slips in zip(self.found, self.slips, strict=True):
            margins = ("margin", "least_margin", "own_margin", "sticking_margin")
            if slips:  # it has none left
                found |= {"margin": 1.0, "least_margin": 1.0} | {
                    name: min(found[name], 1.0) for name in margins if name in found
                }
            if "margin" in found and "least_margin" in found:
                found["least_margin"] = min(found["margin"], found["least_margin"])

    def _add_margins_of_means(self, torque: Array, working: NDArray[np.bool_]) -> None:
        """Add the factors by which mean torques can grow, all together and each by itself."""
        window = self.window
        if window.driver is not None and window.reverses:
            mean = float(np.mean(self.tension))
            low, high = (
                Span(self.params.belt, mean, end(self.flows)).speed
                for end in (np.nanmin, np.nanmax)
            )
            self.notes.append(
                f"no margin of mean torques: the belt's speed goes from {low:.3g} to "
                f"{high:.3g} m/s in this window"
            )
            return
        travels, sticking = window.mean(self.travels), []
        state = self._state(window.driver, self.tension, torque, self.touching.flow, travels)
        try:
            together = full_slip(state)
            if self.falls.any():
                sticking = full_slip(attrs.evolve(state, friction=self.reached))
        except _NO_STATE as error:
            self.notes.append(f"no margin of mean torques: {error}")
            return
        for k in np.flatnonzero(working).tolist():
            found, one = self.found[k], together[k]
            if one is None:
                continue
            found["margin"] = one.factor
            if math.isfinite(one.factor):
                found |= {"slip_torque": one.torque, "slip_tensions": one.tensions}
            if self.falls[k] and (held := sticking[k]) is not None:
                found["sticking_margin"] = held.factor
            alone = one if k == state.driver else _found(state, k, alone=True)
            if alone is not None:
                own = None if math.isinf(alone.factor) else alone.torque
                found |= {"own_margin": alone.factor, "own_slip_torque": own}

    def _add_worst(self, k: int) -> None:
        """Add the margin at the instant at which most of the friction is in use."""
        history, found = self.over_time[:, k], self.found[k]
        if np.isnan(history).all():
            return
        at = int(np.nanargmax(history))
        when = float(self.window.t[at])
        if math.isinf(history[at]):
            found |= {"least_margin": 1.0, "worst_time": when}
            return
        driver, torque, flow = self.window.driver, self.torques[at], float(self.flows[at])
        if driver is not None:  # the one that puts in most then
            omega = self.window.of(self.window.run.pulleys.omega)[at]
            driver = int(np.argmin(torque * omega))
        one = _found(self._state(driver, self.tensions[at], torque, flow, self.travels[at]), k)
        if one is not None and (math.isfinite(one.factor) or "margin" in found):
            found |= {"least_margin": one.factor, "worst_time": when}

    def _state(
        self, driver: int | None, tension: Array, torque: Array, flow: float, travel: Array
    ) -> Steady:
        if driver is None:  # it stands still: what holds it makes up for the rest
            driver, flow = int(np.argmax(np.abs(torque))), 0.0
        return Steady(
            params=self.params,
            tension=tension,
            torque=torque,
            flow=flow,
            driver=driver,
            travel=travel,
            friction=self.mu,
        )


def _found(state: Steady, k: int, *, alone: bool = False) -> FullSlip | None:
    """Find the torque at which a pulley slips, by itself or if its own alone grows, if there is."""
    try:
        return full_slip(state, [k], alone=alone)[0]
    except _NO_STATE:
        return None
