"""The search for parameters: nonlinear least squares over simulated experiments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

import attrs
import numpy as np

from ..base.checks import Array, between, flag, integer, one_of, pair, positive
from ..base.described import suggesting
from ..base.optional import optional_module
from ..base.progress import counted
from ..base.run_warnings import distinct, issue
from ..drive.params import Params
from ..many.pools import as_pool
from ..run.settling import check_params
from ..verification.space import ASSUMED
from . import linear
from .experiment import Target
from .findings import Identification, IdentificationInterrupted
from .free import Free, Parameter, resolve
from .trials import Rig, Trial

#: Unknown standard deviations: first guess and least value, in parts of the target's rms, and the
#: relative change at which they count as found.
_GUESS, _LEAST, _SETTLED, _PASSES = 0.05, 1e-6, 0.05, 8
#: Points tried around the start for each parameter, and how far they and probes may lie from where
#: they begin: a factor of 2, or that share of the size.
_SPREAD_POINTS, _FAR = 4, math.log(2.0)
#: Standard deviations from the best fit at which others are tried: within the intervals, at their
#: ends, and where a local minimum much narrower than the valley it lies in is left behind.
_PROBES = (1.0, 2.0, 6.0, 20.0)
#: Twice the logarithm of the likelihood by which a probe must be better to go on from there.
_BETTER = 0.1


def _checked(name: str, check: Callable[..., Any], *rule: Any) -> Any:
    return attrs.field(converter=lambda value: check(name, value, *rule))


@attrs.frozen(kw_only=True)
class _Options:
    """Arguments of :func:`beltdyn.identify`; of each prior index, coordinate and its deviation."""

    confidence: float = _checked("confidence", between)
    limit: float = _checked("limit", between, 1.0, math.inf)
    jac: str = _checked("jac", one_of, ("3-point", "2-point"))
    diff_step: float = _checked("diff_step", between)
    tol: float = _checked("tol", positive)
    max_nfev: int = _checked("max_nfev", integer, 1)
    starts: int = _checked("starts", integer, 1)
    mesh: bool = _checked("mesh", flag)
    loss: str = _checked("loss", one_of, linear.LOSSES)
    prior: tuple[tuple[int, float, float], ...]

    @classmethod
    def among(cls, given: Mapping[str, Any], parameters: Sequence[Parameter]) -> Self:
        """Return those among the arguments, checked."""
        named = {field.name: given[field.name] for field in attrs.fields(cls)}
        return cls(**named | {"prior": _prior(parameters, given["prior"])})


def _prior(
    parameters: Sequence[Parameter], prior: Mapping[str, tuple[float, float]] | None
) -> tuple[tuple[int, float, float], ...]:
    names = [part.name for part in parameters]
    rows = []
    for name, given in (prior or {}).items():
        if name not in names:
            raise ValueError(f"prior {name!r} is not free; free are {', '.join(names)}")
        part = parameters[names.index(name)]
        value, std = pair(f"prior {name!r}", given, part.unit)
        if std <= 0.0:
            raise ValueError(f"prior {name!r}: the standard deviation must be > 0, got {std:g}")
        if part.log and value <= 0.0:
            raise ValueError(f"prior {name!r}: the value must be > 0, got {value:g}")
        on_scale = std / (value if part.log else part.size)
        rows.append((names.index(name), part.coordinate(value), on_scale))
    return tuple(rows)


@suggesting
def identify(
    params: Params,
    free: Sequence[Free | str],
    targets: Sequence[Target],
    *,
    workers: int | None = None,
    executor: Any = None,
    confidence: float = 0.95,
    limit: float = 2.0,
    jac: str = "3-point",
    diff_step: float = 0.01,
    tol: float = 1e-5,
    max_nfev: int = 300,
    starts: int = 3,
    mesh: bool = True,
    loss: str = "linear",
    prior: Mapping[str, tuple[float, float]] | None = None,
    progress: bool = False,
) -> Identification:
    """Find parameters of a drive from what was measured on a rig.

    Least squares, 1/2 sum ((computed - measured)/sigma)^2, by SciPy's trust-region method in the
    logarithms of positive parameters. Points at which the experiments cannot be simulated are
    rejected by the search. Several runs may be combined; they are simulated in parallel.

    With ``result`` of a run in place of a measurement::

        import attrs
        import numpy as np

        measured = result.span_tension[:, 0] + np.random.default_rng(1).normal(
            0.0, 5.0, result.t.size
        )
        guess = attrs.evolve(params, belt=attrs.evolve(params.belt, axial_stiffness=90e3))
        run = bd.Experiment(torque, t_end=1.0)
        found = bd.identify(
            guess,
            ["belt.axial_stiffness", "friction.mu_k"],
            [run.curve("span_tension[0]", result.t, measured, sigma=5.0)],
        )
        print(found)

    Links that make and lose contact give the sum of squares many minima. So the search is repeated
    from the best of some points spread by a factor of 2 to either side. The ends of its intervals
    and points far beyond them are tried, and the search goes on from any that fits better; finally
    from the best fit with the least known parameter changed by a factor of 2.

    The result has values, confidence intervals, the sensitivity of every number to every parameter,
    and lists the parameters that the data cannot distinguish. Intervals are those of the linearised
    problem, and hold all points tried that fit as well: in tests on a coarse belt, those of 95 %
    held the true value in 91 to 94 % of the draws. They are widened by how far the fit would move
    on a mesh of twice the links (``found.mesh``). Trust no interval where ``found.structured``
    names curves, whose residuals are not those of independent noise, or where ``found.confirmed``
    is False, as no other search found the fit.

    A target without ``sigma`` is taken to be measured with one unknown standard deviation; it is
    estimated from the residuals, with the freedom the fitted parameters take away, and the search
    repeated until it no longer changes. Intervals then come from Student's t. Such a target needs
    more numbers than there are free parameters.

    Args:
        params: The drive; its values are where the search begins, and what is not free stays.
        free: What to find: names, or :class:`Free` for limits, scales, and parameters of one's own.
        targets: What was measured, from :meth:`Experiment.curve` and :meth:`Experiment.number`.
        workers: Threads that simulate; None: one per CPU. The result does not depend on it.
        executor: In place of ``workers``, where runs are done: "processes", better for torques that
            are Python functions, any ``concurrent.futures.Executor`` or a Dask ``Client``, as in
            :func:`beltdyn.sweep`.
        confidence: Confidence level of the intervals, between 0 and 1.
        limit: Factor, > 1: parameters whose standard deviation is a larger factor count as
            undetermined.
        jac: Derivatives by differences, "3-point" (central) or "2-point" (half the runs).
        diff_step: Step of these, relative for logarithmic and as a share of the size for linear
            parameters; small steps are disturbed by the error of integration and by links that make
            or lose contact.
        tol: The search ends when the cost or the parameters change less than this, relatively.
        max_nfev: Most points tried in all searches, not counting those for derivatives.
        starts: From how many points to search; 1: from ``params`` alone, and no further.
        mesh: Whether to run the experiments once more with twice the links, for the error of the
            mesh in the intervals. Without it they are for this mesh alone.
        loss: "linear", or a loss that gives outliers less weight: "soft_l1", "huber", "cauchy";
            needs the sigma of every target.
        prior: What is known beforehand, {name: (value, standard deviation)}, in the unit of the
            parameter; counts like one more measured number.
        progress: Whether to show runs and cost on stderr (needs ``rich``).

    Raises:
        ImportError: SciPy is not installed.
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: The experiments cannot be simulated with the parameters the search begins
            with.
        IdentificationInterrupted: Ctrl-C; ``.identification`` holds the best found so far.
        BeltdynWarning: Not raised but issued, each once, for the runs with the best parameters;
            runs tried before issue none.
        Exception: What a torque function or a reader raises comes out unchanged.
    """
    given = dict(locals())
    least_squares = optional_module("scipy.optimize", "beltdyn.identify", "identify").least_squares
    check_params(params)
    parameters = resolve(params, free)
    options = _Options.among(given, parameters)
    if workers is not None and executor is not None:
        raise ValueError("workers are threads, executor something else: give one of them")
    with (
        as_pool(executor if workers is None else integer("workers", workers, 1)) as pool,
        counted(flag("progress", progress), "identifying") as show,
    ):
        search = _Search(Rig(params, parameters, targets, pool), parameters, options, show)
        try:
            search.run(least_squares)
            shift, note = search.mesh() if options.mesh else (None, "not asked for")
        except KeyboardInterrupt as error:
            stopped = f"interrupted after {search.rig.runs} runs"
            raise IdentificationInterrupted(stopped, search.stopped(stopped)) from error
        found = search.report(shift, note)
    issue(distinct(run.warnings for run in found.results.values()))
    return found


@attrs.frozen(eq=False, kw_only=True)
class _Place:
    """Where a search is, or ended, and what a report needs of it."""

    best: Trial
    sigma: Array
    slopes: tuple[Array, Array]  # the point of the last derivatives, and these
    active: Array
    success: bool = False
    message: str = ""


class _Search:
    """An identification in progress; its residuals are of measured numbers, then of priors."""

    def __init__(
        self,
        rig: Rig,
        parameters: tuple[Parameter, ...],
        options: _Options,
        show: Callable[[int, int | None, str], None],
    ) -> None:
        self.rig = rig
        self._parameters, self._options, self._show_runs = parameters, options, show
        free = len(parameters)
        self._low = np.array([part.coordinate(part.low) for part in parameters])
        self._high = np.array([part.coordinate(part.high) for part in parameters])
        self._nfev = self._failed = 0
        self._ends: list[_Place] = []
        #: Every point that could be simulated: its coordinates, its score.
        self._tried: list[tuple[Array, float]] = []
        self._unknown = [name for name, target in rig.targets.items() if target.sigma is None]
        if self._unknown and options.loss != "linear":
            raise ValueError(
                f"loss {options.loss!r} needs the sigma of target {self._unknown[0]!r}"
            )
        self._measured = np.concatenate([target.values.ravel() for target in rig.targets.values()])
        sigma = np.ones_like(self._measured)
        for name, target in rig.targets.items():
            if target.sigma is not None:
                sigma[rig.slices[name]] = target.sigma.ravel()
                continue
            if target.values.size <= free:
                raise ValueError(
                    f"target {name!r} needs a sigma: {target.values.size} number(s) are too few "
                    f"to estimate it beside {free} free parameter(s)"
                )
            sigma[rig.slices[name]] = _GUESS * self._size(name)
        self._best_cost = np.inf
        self._last = Trial(u=np.empty(0), y=np.empty(0))
        self._guess = self._now = _Place(
            best=self._last,
            sigma=sigma,
            slopes=(np.full(free, np.nan), np.full((sigma.size, free), np.nan)),
            active=np.zeros(free, dtype=int),
        )
        if (error := self._try(np.ones(free)).error) is not None:  # it is the user's
            raise error

    def _size(self, name: str) -> float:
        size = float(np.sqrt(np.mean(self.rig.targets[name].values ** 2)))
        if size == 0.0:
            raise ValueError(f"target {name!r} needs a sigma: all its values are 0")
        return size

    def run(self, least_squares: Callable[..., Any]) -> None:
        """Search from several points, and from what fits better than where that ended."""
        for u in self._starts():
            self._move(sigma=self._guess.sigma)
            success, message = self._search(least_squares, u)
            self._ends.append(self._move(success=success, message=message))
            self.restore()
            if self._nfev >= self._options.max_nfev:
                break

    def stopped(self, why: str) -> Identification:
        """Return the best so far of a search that did not end."""
        self.restore()
        self._move(success=False, message=why)
        return self.report(None, why)

    def _move(self, **changes: Any) -> _Place:
        self._now = attrs.evolve(self._now, **changes)
        return self._now

    def _starts(self) -> Iterator[Array]:
        """Yield where to search from; what is beyond the best fit so far once that is there."""
        more = self._options.starts - 1
        yield np.ones(len(self._parameters))
        yield from self._others(more)
        for _ in range(more):
            better = self._probe()
            if better is None:
                break
            yield better
        for side in (-1.0, 1.0) if more else ():
            yield self._beside(side)

    def restore(self) -> None:
        """Go back to the best end, if it is better than what is being searched."""
        self._ends.sort(key=lambda end: self._score(end.best))
        if self._ends and self._score(self._ends[0].best) <= self._score(self._now.best):
            self._now = self._ends[0]

    def _others(self, count: int) -> list[Array]:
        """Return the best of points spread evenly in each parameter around the start."""
        if count < 1:
            return []
        free = len(self._parameters)
        cells = _SPREAD_POINTS * free
        draw = np.random.default_rng(0)
        rows = np.stack([draw.permutation(cells) for _ in range(free)], axis=1)
        points = 1.0 + _FAR * (2.0 * (rows + 0.5) / cells - 1.0)
        return [u for u, _ in self._scored(points)[:count]]

    def _probe(self) -> Array | None:
        """Try the ends of the intervals and beyond; return a point that fits better, or None."""
        # The other parameters follow as in the linearised problem.
        points = []
        spread = linear.covariance(self._jacobian)
        for k, row in enumerate(spread):
            if np.isfinite(row).all() and spread[k, k] > 0.0:
                way = row / np.sqrt(spread[k, k])
                longest = _FAR / np.abs(way).max()
                for side in (1.0, -1.0):
                    points += [self._now.best.u + side * min(one, longest) * way for one in _PROBES]
        scored = self._scored(np.array(points)) if points else []
        better = scored and scored[0][1] < self._score(self._now.best) - _BETTER
        return scored[0][0] if better else None

    def _beside(self, side: float) -> Array:
        """Return the best fit with the least known parameter changed by a factor of 2."""
        spread = np.diag(linear.covariance(self._jacobian))
        u = self._now.best.u.copy()
        u[int(np.argmax(spread))] += side * _FAR
        return np.asarray(np.clip(u, self._low, self._high))

    def _scored(self, points: Array) -> list[tuple[Array, float]]:
        """Try points within the limits; return those that can be simulated, the best first."""
        trials = self.rig.try_all(list(np.clip(points, self._low, self._high)))
        self._show()
        return sorted(self._noted(trials), key=lambda one: one[1])

    def _noted(self, trials: Iterable[Trial]) -> list[tuple[Array, float]]:
        """Return coordinates and score of those that could be simulated, and keep them."""
        good = [(one.u, self._score(one)) for one in trials if one.error is None]
        self._tried += good
        return good

    def _score(self, trial: Trial) -> float:
        """Return twice the negative logarithm of the likelihood, unknown sigmas at their best."""
        rows, total = self._rows(trial), 0.0
        known = np.ones(rows.size, dtype=bool)
        for name in self._unknown:
            here = self.rig.slices[name]
            known[here] = False
            off = (trial.y - self._measured)[here]
            least = (_LEAST * self._size(name)) ** 2
            total += off.size * np.log(max(float(np.mean(off**2)), least))
        if known.any():
            total += 2.0 * linear.cost_and_weights(rows[known], self._options.loss)[0]
        return float(total)

    def mesh(self) -> tuple[Array | None, str]:
        """Return how far the fit would move on an infinitely fine mesh, or None and why not."""
        try:
            [fine] = self.rig.try_all([self._now.best.u], refine=2)
        except Exception as error:  # what fits the links of this mesh, such as an initial state
            return None, str(error)
        if fine.error is not None:
            return None, str(fine.error)
        jacobian = self._jacobian
        apart = (fine.y - self._now.best.y) / self._now.sigma / (1.0 - 2.0**-ASSUMED)
        with np.errstate(invalid="ignore"):
            moved = -linear.covariance(jacobian) @ (jacobian[: apart.size].T @ apart)
        return moved, ""

    def _search(self, least_squares: Callable[..., Any], u: Array) -> tuple[bool, str]:
        """Search from a point; repeat it as long as the estimates of unknown sigmas change."""
        options = self._options
        for _ in range(_PASSES):
            self._best_cost = np.inf
            found = least_squares(
                self._residuals,
                u,
                jac=self._jacobian_at,
                bounds=(self._low, self._high),
                method="trf",
                x_scale=1.0,
                loss=options.loss,
                ftol=options.tol,
                xtol=options.tol,
                gtol=1e-12,
                max_nfev=max(1, options.max_nfev - self._nfev),
            )
            u = found.x
            self._move(best=self._try(u), active=found.active_mask)
            self._jacobian_at(u)
            if not self._unknown or found.status == 0 or self._estimate_sigma() <= _SETTLED:
                return found.status > 0, str(found.message)
        return False, "the estimated standard deviations keep changing"

    def _try(self, u: Array) -> Trial:
        """Simulate a point that is not known yet; keep it if it is the best of this search."""
        known = [one for one in (self._last, self._now.best) if np.array_equal(one.u, u)]
        if known:
            trial = known[0]
        else:
            self._last = trial = self.rig.try_all([u.copy()], keep=True)[0]
            self._nfev += 1
            self._failed += trial.error is not None
            self._noted([trial])
        if trial.error is None:
            cost = linear.cost_and_weights(self._rows(trial), self._options.loss)[0]
            if cost < self._best_cost:
                self._move(best=trial)
                self._best_cost = cost
        self._show()
        return trial

    def _show(self) -> None:
        self._show_runs(self.rig.runs, None, f"cost {self._best_cost:.6g}")

    def _residuals(self, u: Array) -> Array:
        trial = self._try(u)
        if trial.error is None:
            return self._rows(trial)
        # The trust region shrinks on what is not finite.
        return np.full(self._measured.size + len(self._options.prior), np.nan)

    def _rows(self, trial: Trial) -> Array:
        """Return the residuals of a trial."""
        known = [(trial.u[k] - at) / std for k, at, std in self._options.prior]
        return np.concatenate([(trial.y - self._measured) / self._now.sigma, known])

    @property
    def _jacobian(self) -> Array:
        """Derivatives of the residuals where they were taken last."""
        rows = np.zeros((len(self._options.prior), len(self._parameters)))
        for row, (k, _, std) in zip(rows, self._options.prior, strict=True):
            row[k] = 1.0 / std
        return np.concatenate([self._now.slopes[1] / self._now.sigma[:, None], rows])

    def _jacobian_at(self, u: Array) -> Array:
        """Take the derivatives at a point, by differences, and return those of the residuals."""
        if not np.array_equal(self._now.slopes[0], u):
            self._move(slopes=(u.copy(), self._differences(self._try(u))))
        return self._jacobian

    def _differences(self, here: Trial) -> Array:
        slopes = np.zeros((self._measured.size, here.u.size))
        todo, step = list(range(here.u.size)), self._options.diff_step
        error: Exception | None = None
        # Where no step is possible, a smaller one may be.
        for _ in range(3):
            points = [(k, point) for k in todo for point in self._points(here.u, k, step)]
            trials = self.rig.try_all([point for _, point in points])
            self._show()
            self._noted(trials)
            for k in todo.copy():
                tried = [t for (j, _), t in zip(points, trials, strict=True) if j == k]
                good = [t for t in tried if t.error is None]
                if good:
                    first, last = good[0], good[1] if len(good) == 2 else here
                    slopes[:, k] = (first.y - last.y) / (first.u[k] - last.u[k])
                    todo.remove(k)
                else:
                    error = tried[0].error
            if not todo:
                return slopes
            step /= 8.0
        assert error is not None
        raise error

    def _points(self, u: Array, k: int, step: float) -> Iterator[Array]:
        room = {1.0: self._high[k] - u[k], -1.0: u[k] - self._low[k]}
        sides = [side for side in room if room[side] >= 0.1 * step]
        if not sides:
            sides = [max(room, key=lambda side: room[side])]
        for side in sides if self._options.jac == "3-point" else sides[:1]:
            point = u.copy()
            point[k] += side * min(step, room[side])
            yield point

    def _estimate_sigma(self) -> float:
        """Estimate unknown sigmas; return the largest relative change."""
        residuals, old = self._rows(self._now.best), self._now.sigma
        freedom, new = 1.0 - linear.leverage(self._jacobian), old.copy()
        for name in self._unknown:
            here = self.rig.slices[name]
            factor = np.sqrt(float(np.sum(residuals[here] ** 2)) / float(np.sum(freedom[here])))
            new[here] = np.maximum(old[here] * factor, _LEAST * self._size(name))
        self._move(sigma=new)
        return float(np.max(abs(np.log(new / old))))

    def report(self, mesh: Array | None, note: str) -> Identification:
        """Make the result."""
        best, options, rig, parts = self._now.best, self._options, self.rig, self._parameters
        assert best.params is not None
        residuals, jacobian = self._rows(best), self._jacobian
        cost, weights = linear.cost_and_weights(residuals, options.loss)
        weighted = jacobian * np.sqrt(weights)[:, None]
        dof = np.inf
        if self._unknown and np.isfinite(weighted).all():
            freedom = 1.0 - linear.leverage(weighted)
            dof = float(sum(np.sum(freedom[rig.slices[name]]) for name in self._unknown))

        def by_target(row: Array) -> dict[str, Array]:
            return {
                name: row[rig.slices[name]].reshape(target.values.shape)
                for name, target in rig.targets.items()
            }

        def by_name(values: Iterable[Any]) -> dict[str, Any]:
            return dict(zip((part.name for part in parts), values, strict=True))

        limits = {1: "upper", -1: "lower"}
        return Identification(
            params=best.params,
            values=by_name(map(Parameter.value, parts, best.u.tolist())),
            confidence=options.confidence,
            limit=options.limit,
            residuals=by_target(residuals),
            sigma=by_target(self._now.sigma),
            estimated=tuple(self._unknown),
            jacobian=jacobian[: self._measured.size],
            labels=rig.labels,
            computed=best.y,
            weighted=weighted,
            cost=cost,
            dof=dof,
            nfev=self._nfev,
            failed=self._failed,
            runs=rig.runs,
            success=self._now.success,
            message=self._now.message,
            mesh=None if mesh is None else by_name(map(Parameter.spread, parts, mesh)),
            mesh_message=note,
            ends=np.array([end.best.u for end in self._ends]),
            tried=np.array([u for u, _ in self._tried]),
            excess=np.array([score for _, score in self._tried]) - self._score(best),
            results=dict(zip(rig.experiments, best.results, strict=True)),
            at_limit={
                name: limits[side] for name, side in by_name(self._now.active).items() if side
            },
            parameters=parts,
            curves=frozenset(name for name, target in rig.targets.items() if target.is_curve),
        )
