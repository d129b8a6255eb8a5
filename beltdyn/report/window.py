"""Window of a report: its samples, means over them, whether it is steady."""

from __future__ import annotations

import functools
from collections.abc import Collection
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..drive.params import Params
from ..drive.route import Route, route_at
from ..outputs.accuracy_report import Run
from ..outputs.arcs import Arcs, arcs_of
from ..outputs.averages import mean_over, time_weights
from ..outputs.histories import BeltHistory, ContactHistory
from ..outputs.selection import lacking

__all__ = ["OF_ARCS", "Window", "missing"]

#: The outputs that arcs are found from.
OF_ARCS = (
    "belt.x",
    "belt.y",
    "belt.phi",
    "contact.pulley",
    "contact.normal",
    "contact.mu",
    "contact.velocity",
)


#: Change of a mean between the halves of the window from which on it is not steady, of speeds over
#: the pulley's largest speed, of tensions over the mean tension: half of it is as much as a link
#: that lands does to a mean of some passings of links.
STEADY = 0.01
_HALVES = " from the first half of the window to the second"


def missing(run: Run, names: Collection[str]) -> list[str]:
    """Return the outputs, of these, that the belt has but the run was not asked for."""
    lacks = lacking(run.params)
    return [name for name in names if not run._has(name) and name not in lacks]


@attrs.frozen(eq=False, kw_only=True)
class Window:
    """The last part of a run, in samples.

    Attributes:
        run: The run.
        rows: Its samples.
        weights: Weights of the trapezoidal rule over the times of these samples, of sum 1 (n_w,).
        notes: What could not be determined, and why.
    """

    run: Run
    rows: slice
    weights: Array
    notes: list[str] = attrs.field(factory=list)

    @classmethod
    def last(cls, run: Run, share: float) -> Window:
        """Take the samples of this share of the run's time, counted from its end."""
        t = run.t
        if t.size < 2 or not t[-1] > t[0]:
            raise ValueError(
                "a report needs samples at two times at least: give simulate a t_eval that has them"
            )
        # A sample that stands at the beginning but for rounding belongs to it.
        begin = t[-1] - share * (t[-1] - t[0]) - 1e-9 * (t[-1] - t[0])
        first = min(int(np.searchsorted(t, begin)), t.size - 2)
        while not t[-1] > t[first]:
            first -= 1
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

    def of(self, history: NDArray[Any]) -> NDArray[Any]:
        """Return the samples of a history (n_t, ...) that are in the window."""
        return history[self.rows]

    def mean(self, samples: Array) -> Array:
        """Return the mean over time of samples in the window (n_w, ...), NaN left out."""
        return mean_over(self.weights, samples)

    def smoothed(self, samples: Array, width: float) -> Array:
        """Return the running mean over a time [s] of samples (n_w, n), NaN left out.

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
        there = ~np.isnan(samples)
        for k in range(samples.shape[1]):
            parts = [
                np.interp(t + half, t, total) - np.interp(t - half, t, total)
                for total in (
                    _integral(t, np.where(there[:, k], samples[:, k], 0.0)),
                    _integral(t, there[:, k].astype(float)),
                )
            ]
            known = whole & (parts[1] > 0.5 * width)
            found[known, k] = parts[0][known] / parts[1][known]
        return found

    def travels(self) -> Array | None:
        """Return the travels of the mounts (n_w, n_m); None without mounts, or not asked for."""
        mounts = self.run.mounts
        if mounts is None or not self.run._has("mounts.travel"):
            return None
        return np.asarray(self.of(mounts.travel))

    @functools.cached_property
    def centers(self) -> Array:
        """Return the axes of the pulleys at the samples (n_w, n_p, 2) [m].

        Where the run has not kept travels of the mounts, these rest.
        """
        travels = self.travels()
        if travels is None:
            return np.broadcast_to(
                self.params.centers(), (self.t.size, len(self.params.pulleys), 2)
            )
        return np.array([self.params.centers(row) for row in travels])

    @functools.cached_property
    def arcs(self) -> Arcs:
        """Arcs of contact and slip at the samples (n_w, n_p)."""
        lacks = lacking(self.params)
        found: dict[str, dict[str, Any]] = {"belt": {}, "contact": {}}
        for output in OF_ARCS:
            if output not in lacks:
                group, _, name = output.partition(".")
                found[group][name] = self.of(getattr(getattr(self.run, group), name))
        belt, contact = (
            BeltHistory._holding(found["belt"]),
            ContactHistory._holding(found["contact"]),
        )
        return arcs_of(self.params, belt, contact, self.centers)

    @property
    def lost_mounts(self) -> bool:
        """Whether pulleys are on mounts whose travels the run was not asked for."""
        return bool(self.params.mounted) and self.travels() is None

    def route(self) -> Route | None:
        """Return the way of the belt with the mounts at their mean travels; None: not known."""
        if self.lost_mounts:
            return None
        travels = self.travels()
        if travels is None:
            return self.params.route
        return route_at(self.params.pulleys, self.params.centers(self.mean(travels)))

    def spans(self) -> Array | None:
        """Return the tensions of the free spans at the samples (n_w, n_p) [N]; None: not kept."""
        if not self.run._has("span_tension"):
            return None
        return np.asarray(self.of(self.run.span_tension), dtype=float)

    def unsteady(self) -> list[str]:
        """Describe what changes between the halves of the window, the largest change first."""
        half = self.t.size // 2
        if half < 2:
            return ["whether it is steady cannot be told from fewer than four samples"]
        found: list[tuple[float, str]] = []
        names = self.params.pulley_names

        def look(samples: Array, name: str, unit: str, scale: float, least: float) -> None:
            before, after = self._halves(samples)
            change = abs(after - before)
            if change > max(STEADY * scale, least) > 0.0:
                text = f"the mean {name} goes from {before:.3g} to {after:.3g} {unit}{_HALVES}"
                found.append((change / scale, text))

        if self.run._has("pulleys.omega"):
            omega, radii = self.of(self.run.pulleys.omega), self.params._radii
            scale = float(np.max(np.abs(omega) * radii))
            least = float(self.params.info["drag_speed"])  # what errors of speeds leave
            for name, samples, radius in zip(names, omega.T, radii, strict=True):
                look(samples, f"speed of {name}", "rad/s", scale / radius, least / radius)
        spans = self.spans()
        if spans is not None and spans.shape[1] > 1:
            scale = float(np.nanmean(np.abs(spans))) if not np.isnan(spans).all() else 0.0
            for k, samples in enumerate(spans.T):
                name = f"tension from {names[k]} to {names[(k + 1) % len(names)]}"
                look(samples, name, "N", scale, 0.0)
        return [text for _, text in sorted(found, key=lambda one: -one[0])]

    def _halves(self, samples: Array) -> tuple[float, float]:
        middle = 0.5 * (self.t[0] + self.t[-1])
        before, after = (
            float(mean_over(np.where(part, self.weights, 0.0), samples))
            for part in (self.t <= middle, self.t >= middle)
        )
        return before, after


def _integral(t: Array, values: Array) -> Array:
    """Integrate samples over time, from 0 at the first (n,)."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(t)
    return np.concatenate([[0.0], np.cumsum(steps)])
