"""Results of an identification: values, uncertainty, and what the data cannot determine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from statistics import NormalDist

import attrs
import numpy as np

from ..base.checks import Array, between, flag, one_of
from ..base.rounding import percent
from ..base.tables import columns
from ..drive.params import Params
from ..result.errors import Interrupted
from ..result.result import Result
from . import linear
from .free import Parameter
from .linear import Combination

#: Of the test of residuals: least samples, least rms in standard deviations, and probability below
#: which they are not those of noise.
_SAMPLES, _MATTERS, _CHANCE = 20, 0.5, 1e-3
#: Factors by which measured curves are off, within a part, that are in another unit or sense, and
#: what they then leave of them: a fit that is off by less has another reason.
_UNITS = {"": 1.0, "in 1/min": 30.0 / math.pi, "in degrees": 180.0 / math.pi}
_UNITS |= {"in thousandths of its unit": 1e3, "in thousands of its unit": 1e-3}
_ALIKE, _LEFT = 0.05, 0.2


@attrs.frozen(eq=False, repr=False)
class Sensitivity:
    """How much each target changes with each parameter.

    Attributes:
        rows: Names of the single numbers, and of the curves.
        columns: Names of the parameters.
        values: Changes (n_rows, n_free) per unit of the parameter's logarithm or size: relative or
            in standard deviations. A curve has the root mean square over its samples, a number
            its sign.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    values: Array

    def __str__(self) -> str:
        rows = zip(self.rows, self.values, strict=True)
        body = [(row, *(f"{value:.3g}" for value in line)) for row, line in rows]
        return "\n".join(columns([("", *self.columns), *body], "<", ""))


@attrs.frozen(eq=False, repr=False, kw_only=True)
class Identification:
    """Fitted parameters, their uncertainty, and what the data cannot distinguish.

    All uncertainties come from the problem linearised at the solution, in the coordinates of the
    search: the logarithm of a parameter, or its change as a share of its size.

    Attributes:
        params: The fitted drive.
        values: Fitted values by name, in the parameters' units.
        confidence: Confidence level of :attr:`intervals`.
        limit: Factor from which on a parameter or a combination counts as undetermined.
        residuals: (computed - measured)/sigma by target, each of the shape of its values.
        sigma: Standard deviations used, likewise by target, given or estimated.
        estimated: Targets whose sigma was estimated from their residuals.
        jacobian: Change of every computed number, in standard deviations, per unit of every
            coordinate (n, n_free).
        labels: Names of the rows of the Jacobian (n,).
        computed: The computed numbers themselves (n,).
        weighted: The Jacobian that counts for the uncertainty (n + n_prior, n_free): outliers
            with less weight, and a row for each prior.
        cost: The minimised sum, half the sum of squares (or of the loss).
        dof: Degrees of freedom of Student's t, infinite if every sigma was given.
        nfev: Points tried by the search, without those for derivatives.
        failed: Number of these that could not be simulated.
        runs: Total number of simulations.
        success: Whether the search converged.
        message: How it ended, in words.
        mesh: How far each parameter would move on an infinitely fine mesh, by name and in the unit
            of :attr:`std`, from a run with twice the links; None: not known.
        mesh_message: Why ``mesh`` is not known.
        ends: Coordinates of where each search ended (n_searches, n_free), the best first.
        tried: Coordinates of all points simulated (n_tried, n_free).
        excess: By how much twice the negative logarithm of their likelihood exceeds that of the
            fit (n_tried,).
        results: Run of every experiment with the fitted parameters, by name.
        at_limit: Parameters that ended on a limit: "lower" or "upper" by name.
    """

    params: Params
    values: Mapping[str, float]
    confidence: float
    limit: float
    residuals: Mapping[str, Array]
    sigma: Mapping[str, Array]
    estimated: tuple[str, ...]
    jacobian: Array
    labels: tuple[str, ...]
    computed: Array
    weighted: Array
    cost: float
    dof: float
    nfev: int
    failed: int
    runs: int
    success: bool
    message: str
    mesh: Mapping[str, float] | None
    mesh_message: str
    ends: Array
    tried: Array
    excess: Array
    results: Mapping[str, Result]
    at_limit: Mapping[str, str]
    _parameters: tuple[Parameter, ...]
    _curves: frozenset[str]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, the order of every matrix."""
        return tuple(self.values)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the coordinates (n_free, n_free): logarithms, or shares of the size.

        Infinite along directions that the data do not determine; NaN if the search was interrupted
        before there was a Jacobian.
        """
        return self._linearised(linear.covariance)

    @cached_property
    def correlation(self) -> Array:
        """Correlation of the estimates (n_free, n_free)."""
        return self._linearised(linear.correlation)

    @property
    def _rows(self) -> dict[str, slice]:
        """The numbers of each target among those of all."""
        ends = np.cumsum([residuals.size for residuals in self.residuals.values()]).tolist()
        return dict(zip(self.residuals, map(slice, [0, *ends], ends), strict=True))

    def _linearised(self, of: Callable[[Array], Array]) -> Array:
        known = np.isfinite(self.weighted).all()
        return of(self.weighted) if known else np.full((len(self.values),) * 2, np.nan)

    @property
    def std(self) -> dict[str, float]:
        """Standard deviations by name: relative for a logarithm, else in the parameter's unit."""
        spread = np.sqrt(np.diag(self.covariance))
        return {
            part.name: part.spread(std) for part, std in zip(self._parameters, spread, strict=True)
        }

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Confidence intervals, each on its own at :attr:`confidence`: (low, high) by name."""
        return self.interval()

    @property
    def joint_intervals(self) -> dict[str, tuple[float, float]]:
        """Simultaneous intervals at :attr:`confidence`: (low, high) by name."""
        return self.interval(simultaneous=True)

    def interval(
        self, confidence: float | None = None, *, simultaneous: bool = False
    ) -> dict[str, tuple[float, float]]:
        """Return confidence intervals, (low, high) by name in the parameters' units.

        Linearised, from Student's t with :attr:`dof` degrees of freedom, which is the normal
        distribution if every sigma was given, and wider by :attr:`mesh`. For logarithms low and
        high are the value divided by and multiplied by one factor. Points tried that fit as well as
        the ends should (likelihood ratio) are within, wherever they lie. Intervals end at the
        limits of their parameter, so one at a limit has a one-sided interval. Without any
        information it reaches from limit to limit.

        Args:
            confidence: Between 0 and 1; None: :attr:`confidence`.
            simultaneous: Whether all intervals together are to have this confidence (Bonferroni).

        Raises:
            ValueError: ``confidence`` is not between 0 and 1.
        """
        level = self.confidence if confidence is None else between("confidence", confidence)
        shared = len(self.values) if flag("simultaneous", simultaneous) else 1
        tail = (1.0 - level) / (2.0 * shared)
        if math.isinf(self.dof):
            width = -NormalDist().inv_cdf(tail)
            most = width**2
        else:
            width = -float(import_module("scipy.special").stdtrit(self.dof, tail))
            count = sum(self.residuals[name].size for name in self.estimated)
            most = count * math.log1p(width**2 / self.dof)
        found = {}
        as_good = self.tried[self.excess <= most]
        for k, (part, std) in enumerate(zip(self._parameters, self.std.values(), strict=True)):
            moved = 0.0 if self.mesh is None else abs(self.mesh[part.name])
            value, half = self.values[part.name], width * std + (moved if moved == moved else 0.0)
            if math.isnan(std):
                found[part.name] = (math.nan, math.nan)
                continue
            if part.log:
                factor = math.exp(min(half, 700.0))
                low, high = (value / factor, value * factor) if half < 700.0 else (0.0, math.inf)
            else:
                low, high = value - half, value + half
            others = [part.value(float(u)) for u in as_good[:, k]]
            low, high = min([low, *others]), max([high, *others])
            found[part.name] = (max(low, part.low), min(high, part.high))
        return found

    @property
    def confirmed(self) -> bool:
        """Whether another search ended within all intervals; True if there was only one."""
        intervals = self.intervals
        held = np.ones(len(self.ends), dtype=bool)
        for part, us in zip(self._parameters, self.ends.T, strict=False):
            low, high = intervals[part.name]
            held &= [low <= part.value(float(u)) <= high for u in us]
        return len(self.ends) < 2 or bool(held[1:].any())

    @cached_property
    def structured(self) -> dict[str, float]:
        """Curves whose residuals are not independent from sample to sample, by name.

        The probability of such residuals if they were, after Ljung and Box (Biometrika 65, 1978),
        where it is below 0.001. Of at least 20 samples, whose residuals are no small part of sigma.
        """
        found = {}
        for name, residuals in self.residuals.items():
            rows = residuals.reshape(residuals.shape[0], -1)
            n = rows.shape[0]
            lags = np.arange(1, min(10, n // 5) + 1)
            off = rows - rows.mean(axis=0)
            power = np.sum(off**2, axis=0)
            small = float(np.mean(rows**2)) < _MATTERS**2
            if name not in self._curves or n < _SAMPLES or small or (power == 0.0).any():
                continue
            shares = [np.sum((np.sum(off[k:] * off[:-k], axis=0) / power) ** 2) for k in lags]
            total = n * (n + 2.0) * float(np.sum(shares / (n - lags)))
            chance = float(import_module("scipy.special").chdtrc(lags.size * rows.shape[1], total))
            if chance < _CHANCE:
                found[name] = chance
        return found

    @property
    def misfit(self) -> float:
        """Root mean square residual per remaining degree of freedom, in standard deviations.

        About 1 if the model can be fitted within the given sigmas; NaN if there are no more numbers
        than parameters.
        """
        squares = sum(float(np.sum(residuals**2)) for residuals in self.residuals.values())
        left = len(self.labels) - len(self.values)
        return math.sqrt(squares / left) if left > 0 else math.nan

    @cached_property
    def indistinguishable(self) -> tuple[Combination, ...]:
        """Combinations of parameters that the data cannot distinguish, widest first.

        First the directions along which the parameters can change by more than :attr:`limit` (a
        factor; for linear ones, its logarithm times the size) within one standard deviation, each
        written with as few parameters as possible; then pairs whose estimates are correlated by
        more than 0.95.
        """
        if not np.isfinite(self.weighted).all():
            return ()
        return linear.combinations(self.names, self.weighted, math.log(self.limit))

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters whose own standard deviation exceeds :attr:`limit`."""
        spread = np.sqrt(np.diag(self.covariance))
        most = math.log(self.limit)
        return tuple(name for name, std in zip(self.values, spread, strict=True) if std > most)

    def sensitivity(self, unit: str = "relative") -> Sensitivity:
        """Return how much every target changes with every parameter.

        Args:
            unit: "relative": relative change of the number per relative change of the parameter
                (per its size for a linear one), for a curve both as root mean squares;
                "sigma": in standard deviations.

        Raises:
            ValueError: No such unit.
        """
        one_of("unit", unit, ("relative", "sigma"))
        rows: list[str] = []
        values: list[Array] = []
        for name, here in self._rows.items():
            residuals, labels = self.residuals[name], self.labels[here]
            change, scale = self.jacobian[here], np.ones(residuals.size)
            if unit == "relative":
                change = change * self.sigma[name].reshape(-1, 1)
                scale = self.computed[here]
            if name in self._curves:
                size = math.sqrt(float(np.mean(scale**2)))
                change, scale = np.sqrt(np.mean(change**2, axis=0))[None], np.array([size])
                labels = (name,)
            with np.errstate(divide="ignore", invalid="ignore"):
                values += list(change / scale[:, None])
            rows += labels
        return Sensitivity(tuple(rows), self.names, np.array(values))

    def __repr__(self) -> str:
        how = "converged" if self.success else "not converged"
        how += ", residuals with structure" if self.structured else ""
        how += "" if self.confirmed else ", in a place that no other search found"
        return (
            f"Identification({how}: {len(self.values)} parameter(s) from {len(self.labels)} "
            f"number(s) of {len(self.residuals)} target(s), {self.nfev} points tried, "
            f"{self.runs} runs)"
        )

    def __str__(self) -> str:
        level, std = f"{100 * self.confidence:.4g} %", self.std
        rows = [("parameter", "value", "", f"{level} interval", "one std", "mesh", "")]
        for part in self._parameters:
            name, (low, high) = part.name, self.intervals[part.name]
            mesh = "-" if self.mesh is None else _spread(part, abs(self.mesh[name]))
            found = f"{self.values[name]:.6g}", part.unit, f"{low:.5g} to {high:.5g}"
            rows.append((name, *found, _spread(part, std[name]), mesh, self._remark(name)))
        targets = [("target", "numbers", "rms residual", "sigma")]
        for name, residuals in self.residuals.items():
            sigma = self.sigma[name]
            span = " to ".join(f"{part:.3g}" for part in sorted({sigma.min(), sigma.max()}))
            rms = math.sqrt(float(np.mean(residuals**2)))
            how = " (estimated)" if name in self.estimated else ""
            targets.append((name, str(residuals.size), f"{rms:.3g} sigma", span + how))
        lines = [repr(self)]
        if not self.success:
            lines.append(f"  not finished, values and intervals so far: {self.message}")
        remarks = (f"  {remark}" for remark in self._remarks())
        return "\n".join([*lines, *columns(rows, "<"), *remarks, *columns(targets, "<")])

    def _remarks(self) -> Iterator[str]:
        """Yield what stands below the parameters."""
        if self.mesh is None:
            yield f"the intervals are without the error of the mesh: {self.mesh_message}"
        if not self.confirmed:
            yield (
                f"{len(self.ends) - 1} other searches ended elsewhere: there may be better fits "
                "still, the intervals are not to be trusted; give more starts"
            )
        for name, chance in self.structured.items():
            yield (
                f"the residuals of {name} have structure (Ljung and Box: p = {chance:.1g}): the "
                "model, the data or this minimum is wrong, the intervals are not to be trusted"
            )
        yield from self._units()
        left = len(self.labels) - len(self.values)
        if left < 0:
            yield f"{len(self.labels)} numbers cannot fix {len(self.values)} parameters"
        if self.indistinguishable:
            yield "the data cannot distinguish:"
            yield from (f"  {combination}" for combination in self.indistinguishable)
        # Five standard deviations of the mean square of normal residuals.
        if self.misfit**2 > 1.0 + 5.0 * math.sqrt(2.0 / max(left, 1)):
            yield (
                f"the fit misses the data by {self.misfit:.3g} times sigma: the intervals are "
                "too narrow, because the model or sigma is wrong"
            )

    def _units(self) -> Iterator[str]:
        """Ask about curves that are what is computed, but for a unit or a sense."""
        for name, here in self._rows.items():
            computed = self.computed[here]
            measured = computed - (self.residuals[name] * self.sigma[name]).ravel()
            power = float(computed @ computed)
            factor = float(computed @ measured) / power if power > 0.0 else 1.0
            for unit, size in _UNITS.items():
                left = np.linalg.norm(measured - math.copysign(size, factor) * computed)
                far = abs(abs(factor) - size) > _ALIKE * size or left > _LEFT * size * power**0.5
                turned = "counted clockwise" if factor < 0.0 else ""
                if not far and name in self._curves and (unit or turned):
                    yield (
                        f"the values of {name} are some {factor:.3g} times what is computed: are "
                        f"they {' and '.join(filter(None, (unit, turned)))}?"
                    )

    def _remark(self, name: str) -> str:
        if name in self.at_limit:
            return f"at its {self.at_limit[name]} limit"
        if name in self.undetermined:
            return "undetermined"
        if any(name in combination.names for combination in self.indistinguishable):
            return "correlated"
        return ""


def _spread(part: Parameter, std: float) -> str:
    if not math.isfinite(std):
        return "none" if math.isnan(std) else "unlimited"
    if not part.log:
        return f"{std:.2g} {part.unit}".rstrip()
    if std < 0.3:
        return percent(std)
    return f"factor {math.exp(std):.3g}" if std < 7.0 else "unlimited"


class IdentificationInterrupted(Interrupted):
    """Ctrl-C during :func:`beltdyn.identify`.

    Attributes:
        identification: The best found so far, with the uncertainty of the last Jacobian.
    """

    def __init__(self, message: str, identification: Identification) -> None:
        super().__init__(message)
        self.identification = identification
