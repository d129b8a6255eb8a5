"""Forecasts of the cost and the error of a run, from cheap runs on coarse meshes.

The error in space falls as a power of the number of links; it is seen from meshes each twice as
fine as the one before. The error in time of a method and tolerance is measured against a tight run
on one of these meshes, and taken over to the others. Costs are those measured there, times the
growth of cost with the number of links; explicit steps follow the stability limit of a mesh, which
is known without a run.
"""

from __future__ import annotations

import bisect
import itertools
import math
import time
from collections.abc import Callable, Iterable

import attrs
import numpy as np

from ..drive.params import Params
from ..outputs.accuracy_report import SPACE_FLOOR, TENSIONS, TIME_FLOOR
from ..result.errors import SimulationError
from .quantities import Observed, differences, with_links
from .runs import Done, Setting, fewest

#: The first mesh has twice the fewest links that lie round the smallest pulley: twelve on it.
_FIRST = 2
#: A mesh is looked for that takes this share of the error, and leaves the rest for time.
_SPACE = 0.7
#: Orders of convergence that are believed: those of the meshes are 1 to 2. Below the lowest that is
#: trusted, a forecast does not go beyond the finest mesh tried.
_ORDERS, _TRUSTED, _ASSUMED = (0.3, 2.2), 1.0, 1.5
#: How far beyond the finest mesh tried a forecast goes [times its links].
_BEYOND = 4.0
#: How far beyond it, at most, the mesh that is looked for should be [the same].
_NEAR = 2.5
#: What settling and a run on twice the links may cost, over those on the last mesh.
_DOUBLED = 3.0
#: Settings of the runs on several meshes: the first one that does not fail.
_PROBES = (("lbdf2", 3e-2), ("rodas4", 1e-2), ("auto", 1e-3))
#: The loosest setting is right enough without a tight run to compare it to, if it differs from the
#: probe by less than this share of the error. The errors of both, over this difference: in the
#: scenes of the library those of "lbdf2" at 0.03 are a tenth to six tenths of those at 0.1.
_LOOSE, _OF_DIFFERENCE = 0.6, (1.25, 0.6)
#: Tolerances of the tight runs that errors in time are measured against, as a share of the error.
_TIGHT, _TIGHT_RANGE = 0.3, (1e-7, 1e-2)
#: Settings whose errors in time are measured, from cheap to costly.
LADDER = (
    *(("lbdf2", rtol) for rtol in (1e-1, 3e-2, 1e-2)),
    *(("rodas4", rtol) for rtol in (3e-2, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6)),
)
#: By method, the tolerances that a forecast goes beyond the tightest tried, and how the CPU time
#: then grows, as a power of the tolerance: in the scenes of the library that of "rodas4" by 0.2 to
#: 0.4, of "lbdf2" by 0.4 to 1. Errors fall with it at least as its square root.
_UNTRIED, _SLOWER = 100.0, {"lbdf2": 1.0, "rodas4": 0.45}
#: How many times the cheap runs they take, at most.
_TIGHT_COST = 8.0
#: An error in time below this share of the error asked for is as good as none.
_NONE = 0.1
#: Steps of "tsit5" over 1/(spectral bound), and the CPU time of one, a + b n_b [s]: rough numbers,
#: which only decide whether it is tried.
_EXPLICIT_STEP, _EXPLICIT_COST = 2.5, (1e-6, 5e-8)
#: Runs shorter than this [s], and than this share of the limit, are run twice: the least CPU time
#: counts.
_SHORT, _AGAIN = 0.05, 0.05
#: Growth of the cost with the number of links that is believed beyond the finest mesh tried.
_GROWTH = (0.8, 1.4)
#: Forecasts whose errors differ by less are equally good: the cheaper one is better.
_AS_GOOD = 1.1
#: More links than this are not proposed.
_FINEST = 10_000


@attrs.frozen(kw_only=True)
class Forecast:
    """Forecast of a setting."""

    setting: Setting
    seconds: float  # CPU time of the run, without settling [s]
    space: float  # error in space [1]; NaN if the mesh is fixed
    time: float  # error in time [1]

    @property
    def error(self) -> float:
        """Both together [1], as :attr:`beltdyn.accuracy.QuantityError.total` adds them."""
        return self.time if math.isnan(self.space) else self.space + self.time


class Pilot:
    """Cheap runs of a scene, and forecasts from them."""

    def __init__(
        self,
        run: Callable[[Setting], Done],
        params: Params,
        quantity: str,  # of which errors are meant
        *,
        fixed: bool = False,  # whether the mesh is; errors in space are NaN then
        limit: float = math.inf,  # CPU time after which no further run begins [s]
        clock: Callable[[], float] = time.thread_time,
    ) -> None:
        self._run, self._params, self._quantity = run, params, quantity
        self._fixed, self._limit, self._clock = fixed, limit, clock
        self._begun = clock()
        self._done: dict[Setting, Done] = {}
        self._failed: dict[Setting, SimulationError] = {}
        self.meshes: list[int] = []  # numbers of links tried
        self.space_errors: list[float] = []  # theirs [1]
        #: The power of the link length by which the error in space goes on falling.
        self.order = _ASSUMED
        #: Errors in time by method and tolerance [1], on the mesh of so many links.
        self.time_errors: dict[tuple[str, float], float] = {}
        self.time_mesh = params.n_bodies

    @property
    def spent(self) -> float:
        """CPU time of the pilot so far, with settling [s]."""
        return self._clock() - self._begun

    @property
    def runs(self) -> int:
        """Number of settings run so far."""
        return len(self._done) + len(self._failed)

    def explore(self, error: float) -> None:
        """Make the runs that tell which setting reaches an error; those made before are kept."""
        if self._fixed:
            n_b = self._params.n_bodies
            self._first(Setting(n_b, *probe) for probe in _PROBES)
            self.meshes, self.space_errors = [n_b], [math.nan]
        else:
            self._explore_space(error)
        self._explore_time(error)

    # --- runs ---

    def _try(self, setting: Setting) -> Done | None:
        """Run once, short runs twice; None if the run fails."""
        if setting in self._failed:
            return None
        if setting not in self._done:
            try:
                done = self._run(setting)
                if done.cpu < min(_SHORT, _AGAIN * self._limit):
                    done = attrs.evolve(done, cpu=min(done.cpu, self._run(setting).cpu))
            except SimulationError as error:
                self._failed[setting] = error
                return None
            self._done[setting] = done
        return self._done[setting]

    def _first(self, settings: Iterable[Setting]) -> Done | None:
        """Return the first run that does not fail."""
        return next((done for one in settings if (done := self._try(one)) is not None), None)

    def _affords(self, seconds: float) -> bool:
        return self.spent + seconds <= self._limit

    def off(self, seen: Observed) -> float:
        """Return the difference of a run to that on the finest mesh tried [1]."""
        return self._difference(seen, self._finest)

    def _difference(self, a: Observed, b: Observed) -> float:
        return differences(a, b)[self._quantity]

    # --- space ---

    def _explore_space(self, error: float) -> None:
        tight = (("rodas4", max(error, 1e-6)), *_PROBES) if error < 3e-3 else _PROBES
        n_b, found, last = _FIRST * fewest(self._params), list[tuple[int, Done]](), 0.0
        while n_b <= _FINEST and (not found or self._affords(_DOUBLED * last)):
            begun = self.spent
            done = self._first(Setting(n_b, *probe) for probe in tight)
            last = self.spent - begun  # settling included, and a second run
            if done is not None:
                found.append((n_b, done))
                if len(found) >= len(self.meshes):  # else what is known of finer meshes is better
                    self._probes = tight
                    self._fit(found)
                if len(found) > 2 and self._near(error):
                    break
            elif self.runs >= 3 * len(tight) and not found:
                raise next(iter(self._failed.values()))
            n_b *= 2

    def _fit(self, found: list[tuple[int, Done]]) -> None:
        """Find the errors of all meshes from their differences to the finest."""
        self.meshes = [n_b for n_b, _ in found]
        self._probed = [done.cpu for _, done in found]
        seen = [done.seen for _, done in found]
        self._finest = seen[-1]
        last = len(seen) - 1
        if last == 0:  # all that is known without a second mesh
            self.space_errors, self.order = [self._free(found[0][1])], 2.0
            return
        steps = [self._difference(a, b) for a, b in itertools.pairwise(seen)]
        self.order = _ASSUMED
        if last > 1:
            fall = max(steps[-2], 1e-300) / max(steps[-1], 1e-300)
            self.order = float(np.clip(math.log2(fall), *_ORDERS))
        errors = [
            self._difference(seen[k], seen[-1]) / (1.0 - 2.0 ** (self.order * (k - last)))
            for k in range(last)
        ]
        errors.append(steps[-1] / (2.0**self.order - 1.0))
        self.space_errors = _falling(errors)
        if self._quantity in TENSIONS and (last < 2 or self.order < _TRUSTED):
            # Meshes that do not converge may agree by chance: what a result would say of its mesh
            # is right to a factor of three.
            least = [self._free(done) / 3.0 for _, done in found]
            self.space_errors = np.maximum(self.space_errors, least).tolist()

    def _free(self, done: Done) -> float:
        """Return the error of the mesh in the result of a run, of the tension if of no other."""
        known = (done.accuracy[name].space for name in (self._quantity, "tension"))
        return next((space for space in known if space is not None), math.inf)

    def _near(self, error: float) -> bool:
        """Whether the mesh looked for is among those tried, or not far beyond them."""
        return self.links_for(_SPACE * error) <= min(_NEAR * self.meshes[-1], self.most)

    @property
    def most(self) -> int:
        """Largest number of links of forecasts."""
        if self._fixed:
            return self.meshes[-1]
        beyond = _BEYOND if self.order >= _TRUSTED else 1.0
        return min(_FINEST, math.floor(self.meshes[-1] * beyond))

    def space_error(self, n_bodies: float) -> float:
        """Return the error in space on a mesh [1], NaN if it is fixed."""
        if n_bodies < self.meshes[0]:
            return math.inf
        if n_bodies >= self.meshes[-1]:
            return float(self.space_errors[-1] * (n_bodies / self.meshes[-1]) ** -self.order)
        return _between(n_bodies, self.meshes, self.space_errors)

    def links_for(self, error: float) -> int:
        """Return the least number of links with an error in space within a limit."""
        if self._fixed or self.space_error(self.meshes[0]) <= error:
            return self.meshes[0]
        numbers = range(self.meshes[0] + 1, 100 * _FINEST)
        k = bisect.bisect_left(numbers, -error, key=lambda n_b: -self.space_error(n_b))
        return numbers.start + k

    # --- time ---

    def _explore_time(self, error: float) -> None:
        wanted = self.links_for(_SPACE * error)
        coarser = [n for n in self.meshes if n <= wanted] or self.meshes[:1]
        before = self.time_mesh, self.time_errors
        self.time_errors = {}
        try:
            for n_b in reversed(coarser):
                self.time_mesh, probe = n_b, self._probe(n_b)
                if probe is None or self._affords(_TIGHT_COST * self._done[probe].cpu):
                    self._measure_time(error, wanted)
                    break
            else:
                if not before[1]:
                    self._estimate_time(coarser)
        finally:
            if not self.time_errors:
                self.time_mesh, self.time_errors = before

    def _estimate_time(self, meshes: list[int]) -> None:
        """Find errors in time where tight runs take too long: by one loose run, or none."""
        probes = (one for n_b in reversed(meshes) if (one := self._probe(n_b)) is not None)
        for probe in probes:
            self.time_mesh, claim = probe.n_bodies, self._done[probe].accuracy["tension"].time
            error = probe.rtol if claim is None else claim
            self.time_errors = {(probe.method, probe.rtol): error}
            if not self._affords(0.0) or self._loose(probe, math.inf):
                return

    def _measure_time(self, error: float, wanted: int) -> None:
        probe = Setting(self.time_mesh, *_PROBES[0])
        if probe in self._done and self._loose(probe, _LOOSE * error):
            return
        rtol = float(np.clip(_TIGHT * error, *_TIGHT_RANGE))
        exact = self._first(Setting(self.time_mesh, name, rtol) for name in ("rodas4", "auto"))
        if exact is None:
            raise next(iter(self._failed.values()))
        if self._explicit(min(wanted, self.most)) <= exact.cpu:
            self._time("tsit5", float(np.clip(error, 1e-7, 1e-1)), exact)
        for method, tolerance in LADDER:
            if tolerance <= rtol and method == "rodas4":
                break
            self._time(method, tolerance, exact)
            if self.time_errors.get((method, tolerance), math.inf) <= _NONE * error:
                break

    def _loose(self, probe: Setting, limit: float) -> bool:
        """Whether the loosest setting of a method differs from the probe by less than a limit."""
        pair = next((one for one in LADDER if one[0] == probe.method), None)
        if pair is None or (done := self._try(loose := Setting(probe.n_bodies, *pair))) is None:
            return False
        apart = self._difference(done.seen, self._done[probe].seen)
        if apart > limit:
            return False
        for one, share in zip((loose, probe), _OF_DIFFERENCE, strict=True):
            self.time_errors[one.method, one.rtol] = share * apart
        return True

    def _time(self, method: str, rtol: float, exact: Done) -> None:
        setting = Setting(self.time_mesh, method, rtol)
        if setting not in self._done and not self._affords(exact.cpu if rtol < 3e-2 else 0.0):
            return
        done = self._try(setting)
        if done is not None:
            self.time_errors[method, rtol] = self._difference(done.seen, exact.seen)

    def _probe(self, n_bodies: int) -> Setting | None:
        """Return the setting that was tried first on a mesh."""
        return next((one for one in self._done if one.n_bodies == n_bodies), None)

    def _explicit(self, n_b: int) -> float:
        """Return roughly the CPU time of a run by explicit steps [s]."""
        a, b = _EXPLICIT_COST
        t = next(iter(self._done.values())).seen.t
        return float(t[-1] - t[0]) * self._bound(n_b) / _EXPLICIT_STEP * (a + b * n_b)

    def _bound(self, n_bodies: int) -> float:
        return float(with_links(self._params, n_bodies).info["spectral_bound"])

    # --- forecasts ---

    def _there(self, method: str, rtol: float) -> tuple[float, float]:
        """Return error in time [1] and CPU time [s] on ``time_mesh``, or from those tried there."""
        if (method, rtol) in self.time_errors:
            done = self._done[Setting(self.time_mesh, method, rtol)]
            return self.time_errors[method, rtol], done.cpu
        tried = self._tightest(method)
        error, cpu = self._there(method, tried)
        return error * math.sqrt(rtol / tried), cpu * math.pow(tried / rtol, _SLOWER[method])

    def _tightest(self, method: str) -> float:
        return min((rtol for name, rtol in self.time_errors if name == method), default=0.0)

    def seconds(self, setting: Setting) -> float:
        """Return the CPU time of a run at a setting of :meth:`settings` [s]."""
        cpu = self._there(setting.method, setting.rtol)[1]
        if setting.method == "tsit5":
            a, b = _EXPLICIT_COST
            steps = self._bound(setting.n_bodies) / self._bound(self.time_mesh)
            return cpu * max(steps, 1e-3) * (a + b * setting.n_bodies) / (a + b * self.time_mesh)
        return cpu * self._probe_cost(setting.n_bodies) / self._probe_cost(self.time_mesh)

    def _probe_cost(self, n_bodies: int) -> float:
        """Return the CPU time of the runs on all meshes, between and beyond them [s]."""
        meshes, cost = self.meshes, self._probed if not self._fixed else [1.0]
        if len(meshes) == 1:
            return cost[0] * n_bodies / meshes[0]
        if n_bodies <= meshes[-1]:
            return _between(n_bodies, meshes, cost)
        growth = math.log(cost[-1] / cost[0]) / math.log(meshes[-1] / meshes[0])
        return float(cost[-1] * (n_bodies / meshes[-1]) ** float(np.clip(growth, *_GROWTH)))

    def forecast(self, setting: Setting) -> Forecast:
        """Return the forecast of a setting of :meth:`settings`."""
        return Forecast(
            setting=setting,
            seconds=self.seconds(setting),
            # results know errors no better
            space=math.nan if self._fixed else max(SPACE_FLOOR, self.space_error(setting.n_bodies)),
            time=max(TIME_FLOOR, self._there(setting.method, setting.rtol)[0]),
        )

    def cheapest(self, error: float) -> Forecast | None:
        """Return the cheapest setting for an error, None if none is known to reach it."""
        # A mesh between those tried is tried as well: there the error may jump.
        while (one := self._cheapest(error)) is not None and self._worse(one.setting.n_bodies):
            pass
        return one

    def _worse(self, n_bodies: int) -> bool:
        """Try a mesh between others, if affordable; return whether it is worse than thought."""
        if n_bodies in self.meshes or not self.meshes[0] < n_bodies < self.meshes[-1]:
            return False
        if not self._affords(_DOUBLED * self._probe_cost(n_bodies)):
            return False
        done = self._first(Setting(n_bodies, *pair) for pair in self._probes)
        if done is None:
            return False
        thought = self.space_error(n_bodies)
        error = self._difference(done.seen, self._finest) + self.space_errors[-1]
        k = bisect.bisect(self.meshes, n_bodies)
        self.meshes.insert(k, n_bodies)
        self._probed.insert(k, done.cpu)
        self.space_errors.insert(k, max(error, thought))
        self.space_errors = _falling(self.space_errors)
        return error > _AS_GOOD * thought

    def _cheapest(self, error: float) -> Forecast | None:
        found = []
        for (method, rtol), off in self.time_errors.items():
            if off + (0.0 if self._fixed else SPACE_FLOOR) < error:
                n_b = self.links_for(error - off)
                if n_b <= self.most:
                    found.append(self.forecast(Setting(n_b, method, rtol)))
        return min(found, key=lambda one: one.seconds, default=None)

    def settings(self) -> list[Setting]:
        """List settings of which forecasts can be made, with tighter tolerances than were tried."""
        between = np.rint(np.geomspace(self.meshes[0], self.most, 40)).astype(int)
        tried = [n_b for n_b in self.meshes if n_b <= self.most]  # which are settled already
        meshes = np.union1d(between, tried)
        untried = [
            (method, rtol)
            for method, rtol in LADDER
            if self._tightest(method) / _UNTRIED <= rtol < self._tightest(method)
        ]
        return [
            Setting(n_b, *pair) for pair in (*self.time_errors, *untried) for n_b in meshes.tolist()
        ]

    def best(self, affordable: Callable[[Forecast], bool] = lambda _one: True) -> Forecast | None:
        """Return the most accurate of all settings that are affordable, None if none is."""
        forecasts = [one for one in map(self.forecast, self.settings()) if affordable(one)]
        least_error = min((one.error for one in forecasts), default=0.0)
        good = (one for one in forecasts if one.error <= _AS_GOOD * least_error)
        return min(good, key=lambda one: one.seconds, default=None)


def _falling(errors: list[float]) -> list[float]:
    """Where a finer mesh seems to be worse, the coarser one was right by chance."""
    found: list[float] = np.maximum.accumulate(errors[::-1])[::-1].tolist()
    return found


def _between(x: float, at: list[int], values: list[float]) -> float:
    """Interpolate positive values in the logarithms of both."""
    y = np.log(np.maximum(values, 1e-300))
    return float(math.exp(np.interp(math.log(x), np.log(at), y)))
