"""How far every pulley is from full slip: quasi-static creep theory from a measured mean state.

All torques of the belt grow in proportion, and what is held is

- the differences of tension across the pulleys, H_k - H_(k-1) = s_k M_k / r_k, with the tension
  less what the belt's mass takes, H = T - m c^2 lambda, lambda = 1 + T / EA, c the stress-free
  length that passes in a second, m the mass per stress-free length, s_k the sense of pulley k;
- the belt's stress-free length, the integral of ds / lambda along its line. On a pulley it sticks
  from where it arrives, with the tension that it has there, and slips with dH = mu H dphi over the
  angle |ln(H_k / H_(k-1))| / mu up to where it leaves. It runs where the contact lets it sink to;
- the balance of arms and sliders: spring, hung weight, stops, and what else acted on them in the
  mean, such as the rest of dry friction.

Creep theory of an extensible belt under Coulomb friction (K. L. Johnson, Contact Mechanics, 8.2;
Euler and Eytelwein with the centrifugal part). A pulley slips in full when its slip angle is its
wrap.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import attrs
import numpy as np

from ..base.checks import Array
from ..drive.compliance import depth_under, raised
from ..drive.params import Params
from ..drive.route import Route, route_at
from ..drive.span import Span

#: Points and weights of Gauss and Legendre on an arc in slip: its integrand is an exponential of at
#: most some e^3, which they integrate to rounding.
_AT, _WEIGHT = np.polynomial.legendre.leggauss(8)
#: Largest factor that is looked for: a pulley that holds a hundred times its torque does not slip.
LARGEST = 100.0
#: Relative accuracy of factors; of the one at which a span goes slack, near which ratios go to
#: infinity.
_CLOSE, _SLACK = 1e-6, 1e-3


class _State(NamedTuple):
    """A solved state."""

    factor: float
    unknown: Array
    used: Array  # share of every wrap


@attrs.frozen(kw_only=True, eq=False)
class Steady:
    """A mean state of a running belt."""

    params: Params
    tension: Array  # of the span after each pulley (n_p,) [N]
    torque: Array  # of the belt on each pulley, counter-clockwise (n_p,) [N m]
    flow: float  # stress-free length that passes in a second, in the order of the links [m/s]
    driver: int  # the pulley whose speed is held
    travel: Array  # of the mounts (n_m,) [rad, m, s]
    friction: Array | None = None  # coefficients (n_p,) [1]; None: those in fast slip


class FullSlip(NamedTuple):
    """Full slip of a pulley.

    What else takes power, such as a belt that resists being bent, does not grow with the loads, so
    the torque of the driving pulley grows by less than the factor.
    """

    factor: float  # of all loads
    torque: float  # of the belt on it [N m]
    tensions: tuple[float, float]  # of its tight and slack span [N]


class _Theory:
    """Tensions at torques grown by a factor: all of them, or that of one pulley and the driver."""

    def __init__(self, steady: Steady, growing: int | None = None, *, coarse: bool) -> None:
        params = steady.params
        self.steady, self.params = steady, params
        self.length = float(params.info["length"])
        given = steady.friction
        self.mu = params._slip_limits[0] if given is None else given
        self.radii = params._radii
        self.raised = raised(params, self.radii)
        self.mean = float(steady.tension.mean())
        # Of span k the pulley k + 1 is the next one: tension on arriving is that of span k - 1.
        self.arrives = -1 if steady.flow >= 0.0 else 0
        self.stretch_in = self.span(steady.tension[steady.driver + self.arrives]).stretch
        pulls = self.span(steady.tension, steady.flow).pull
        self.measured = pulls - np.roll(pulls, 1)
        per_factor = params.route.senses * steady.torque / self.radii
        if growing is not None:
            per_factor = np.where(np.arange(per_factor.size) == growing, per_factor, 0.0)
        # The driving pulley makes up for what else takes power: the ring closes.
        per_factor[steady.driver] -= per_factor.sum()
        self.per_factor = per_factor
        self.moving = params._moving
        self.free = [m for m, *_ in self.moving]
        #: Unknowns of the mean state: tension of the last span, travels of mounts that move.
        self.start = np.concatenate([steady.tension[-1:], steady.travel[self.free]])
        self.offset = np.zeros(self.start.size)
        self.offset = self._misfit(self.start, 1.0)
        # Of a single pulley coarse steps are enough: the span that goes slack is not its own, or it
        # slips before.
        self.growth, self.slack = (1.6, 10.0 * _SLACK) if coarse else (1.25, _SLACK)
        self.solved: dict[float, _State | None] = {}

    def span(self, tension: Any, flow: float = 0.0) -> Span:
        return Span(self.params.belt, tension, flow)

    def _steps(self, factor: float) -> Array:
        """Return the pull of each span over that of the last one [N]."""
        return np.cumsum(self.measured + (factor - 1.0) * self.per_factor)

    def tensions(self, last: float, factor: float) -> tuple[Array, float]:
        """Return the tensions of all spans from that of the last one, and the belt's flow."""
        flow, steps = self.steady.flow, self._steps(factor)
        for _ in range(3):  # the flow changes by strains alone
            pull = self.span(last, flow).pull + steps
            tension = Span.of_pull(self.params.belt, pull, flow).tension
            # it is held where the belt arrives at the driving pulley
            arriving = self.span(float(tension[self.steady.driver + self.arrives]))
            flow = float(self.steady.flow * self.stretch_in / arriving.stretch)
        if np.min(pull) <= 0.0:
            raise ValueError("a span would be slack")
        return tension, flow

    def route(self, unknown: Array) -> tuple[Route, Array, Array]:
        """Return the way of the belt, travels of all mounts, axes."""
        travels = np.array(self.steady.travel)
        travels[self.free] = unknown[1:]
        centers = self.params.centers(travels)
        way = self.params.route
        return route_at(self.params.pulleys, centers) if travels.size else way, travels, centers

    def _misfit(self, unknown: Array, factor: float) -> Array:
        """Return the residuals of length (relative) and of mounts (over the tension)."""
        tension, flow = self.tensions(float(unknown[0]), factor)
        way, travels, centers = self.route(unknown)
        span = self.span(tension, flow)
        pull, free = span.pull, np.sum(way.spans / span.stretch)
        misfit = [float(free + self._on_pulleys(pull, flow, way)) / self.length]
        ends = way._ways / way.spans[:, None]
        forces = self.params._model.mount_forces(travels)
        for m, k, mount in self.moving:
            along = mount._direction(centers[k])
            held = float(along @ (pull[k] * ends[k] - pull[k - 1] * ends[k - 1]))
            scale = float(np.linalg.norm(along) * self.mean)
            misfit.append((held + float(forces[m])) / scale)
        return np.array(misfit) - self.offset

    def slip_angles(self, pull: Array) -> Array:
        """Return the angle of slip that each pulley needs; infinite where it has no friction."""
        if (pull <= 0.0).any():
            raise ValueError("a span would be slack")
        logs = np.abs(np.log(pull / np.roll(pull, 1)))
        return np.divide(logs, self.mu, out=np.where(logs > 0.0, np.inf, 0.0), where=self.mu > 0.0)

    def _on_pulleys(self, pull: Array, flow: float, way: Route) -> float:
        """Return the stress-free length of the belt on the pulleys [m]."""
        first, last = np.roll(pull, 1), pull
        if self.arrives == 0:
            first, last = last, first
        slip = np.minimum(self.slip_angles(pull), way.wraps)

        def unstretched(pulls: Array, radii: Array, raised: Array) -> Array:
            """Stress-free length per angle."""
            span = Span.of_pull(self.params.belt, pulls, flow)
            sunk = depth_under(self.params, radii, span.tension, span.speed) - raised
            return np.asarray((radii - sunk) / span.stretch)

        sticking = (way.wraps - slip) * unstretched(first, self.radii, self.raised)
        part = 0.5 * (1.0 + _AT)
        pulls = first[:, None] * (last / first)[:, None] ** part
        inside = unstretched(pulls, self.radii[:, None], self.raised[:, None])
        return float(np.sum(sticking + slip * (inside @ (0.5 * _WEIGHT))))

    def solve(self, factor: float, start: Array) -> Array:
        """Return the unknowns at a factor, by Newton's method with differences."""
        unknown = np.array(start)
        # with which no span is slack
        least = float(0.02 * self.mean - np.min(self._steps(factor)))
        tight = Span.of_pull(self.params.belt, least, self.steady.flow).tension
        unknown[0] = max(unknown[0], float(tight))
        sizes = np.append(self.mean, np.full(len(self.free), 1e-2))
        reach = np.append(0.5 * self.mean, np.full(len(self.free), 0.1))
        best, worse = math.inf, 0
        for _ in range(60):
            misfit = self._misfit(unknown, factor)
            size = float(np.max(np.abs(misfit)))
            if size < 1e-11:
                return unknown
            slopes = np.empty((unknown.size, unknown.size))
            for n in range(unknown.size):
                moved = unknown.copy()
                moved[n] += 1e-6 * sizes[n]
                slopes[:, n] = (self._misfit(moved, factor) - misfit) / (1e-6 * sizes[n])
            step = np.linalg.solve(slopes, misfit)
            # Whole steps: where a stop begins, misfits are piecewise linear, and a step across it
            # is away from the solution before the next one finds it.
            share = min(1.0, *(reach / np.maximum(np.abs(step), 1e-300)))
            for _ in range(40):
                moved = unknown - share * step
                try:
                    self._misfit(moved, factor)
                    break
                except ValueError:
                    share *= 0.5
            else:
                raise ValueError("a span would be slack")
            unknown = moved
            worse = worse + 1 if size > 0.9 * best else 0
            best = min(best, size)
            if worse > 12:  # at a kink, or there is none
                break
        if best < 1e-8:
            return unknown
        raise ValueError("no state found")

    def _at(self, factor: float, start: Array) -> _State | None:
        """Solve for a factor; None if there is no such state."""
        if factor not in self.solved:
            self.solved[factor] = None
            with contextlib.suppress(ValueError, np.linalg.LinAlgError):
                unknown = self.solve(factor, start)
                tension, flow = self.tensions(float(unknown[0]), factor)
                angles = self.slip_angles(self.span(tension, flow).pull)
                used = angles / self.route(unknown)[0].wraps
                self.solved[factor] = _State(factor, unknown, used)
        return self.solved[factor]

    def _march(self) -> Iterator[_State]:
        """Yield states at rising factors, up to where a span goes slack."""
        last = self._at(1.0, self.start)
        if last is None:
            raise ValueError("the tensions of the window are none of a tight belt")
        none = self._at(0.0, last.unknown)
        yield from (last,) if none is None else (none, last)
        failed = math.inf
        while failed - last.factor >= self.slack * last.factor:
            factor = min(self.growth * last.factor, 0.5 * (last.factor + failed))
            if factor > LARGEST:
                return
            state = self._at(factor, last.unknown)
            if state is None:
                failed = factor
            else:
                yield (last := state)

    def slips(self, watched: list[int], k: int) -> FullSlip:
        """Find the factor at which the first of these slips in full; return that of pulley k."""

        def used(state: _State) -> float:
            return float(np.max(state.used[watched]))

        steps = pairwise(self._march())
        around = next((two for two in steps if max(map(used, two)) >= 1.0), None)
        if around is None or used(around[0]) >= 1.0:
            return FullSlip(factor=math.inf, torque=math.nan, tensions=(math.nan, math.nan))
        low, high = around
        while high.factor - low.factor > _CLOSE * high.factor:
            # By the secant, kept off the ends so that both of them move.
            share = min(max((1.0 - used(low)) / (used(high) - used(low)), 0.02), 0.98)
            middle = self._at(low.factor + share * (high.factor - low.factor), low.unknown)
            if middle is None or abs(used(middle) - 1.0) < _CLOSE:
                low = middle or low
                break
            low, high = (middle, high) if used(middle) < 1.0 else (low, middle)
        tension = self.tensions(float(low.unknown[0]), low.factor)[0]
        pair = float(tension[k]), float(tension[k - 1])
        lever = self.radii[k] * self.params.route.senses[k]
        torque = float(self.steady.torque[k] + (low.factor - 1.0) * self.per_factor[k] * lever)
        return FullSlip(factor=low.factor, torque=torque, tensions=(max(pair), min(pair)))


def full_slip(
    steady: Steady, pulleys: Sequence[int] | None = None, alone: bool = False
) -> list[FullSlip | None]:
    """Find the torque at which each pulley slips in full, as if no other slipped before.

    ``alone``: as its own torque grows, where the first of all slips. None: it has no friction.
    """

    def of(k: int) -> FullSlip | None:
        theory = together or _Theory(steady, k, coarse=True)
        holds = np.flatnonzero(theory.mu > 0.0).tolist()
        return theory.slips(holds if alone else [k], k) if k in holds else None

    together = None if alone else _Theory(steady, coarse=pulleys is not None)
    return [of(k) for k in (range(len(steady.params.pulleys)) if pulleys is None else pulleys)]
