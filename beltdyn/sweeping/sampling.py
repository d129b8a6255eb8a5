"""Samples of parameters that scatter: random, of low discrepancy, and for Sobol' indices."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array, flag, integer, one_of, pair, shown
from ..base.described import suggesting
from ..base.optional import optional_module
from ..base.tables import columns

METHODS = ("sobol", "halton", "latin-hypercube", "random", "saltelli")

#: Shares of a distribution are kept this far from 0 and 1, where most have no value: half the
#: spacing of Sobol' points, which have 30 bits.
_EDGE = 2.0**-31
#: Sobol' points repeat beyond 2^30.
_MOST = 2**30


@attrs.frozen(eq=False, repr=False, kw_only=True)
class Samples:
    """Values of some parameters for many runs; ``bd.sweep`` takes it as ``over``.

    Attributes:
        names: Names of the parameters (k,).
        values: A row for each run (n, k), constant, in the units of the parameters.
        design: How they were made, plain values that JSON can hold: "method"; "n", the number
            asked for; "seed"; "second_order"; "names"; "distributions", texts by name.
    """

    names: tuple[str, ...]
    values: Array
    design: dict[str, Any]

    def __len__(self) -> int:
        return int(self.values.shape[0])

    def __repr__(self) -> str:
        return (
            f"Samples({len(self)} runs of {len(self.names)} parameter(s): "
            f"{self.design['method']}, seed {self.design['seed']})"
        )

    def __str__(self) -> str:
        rows = [("", "distribution", "least", "mean", "most")]
        for name, column in zip(self.names, self.values.T, strict=True):
            numbers = (column.min(), column.mean(), column.max())
            texts = [f"{number:.5g}" for number in numbers]
            rows.append((name, self.design["distributions"][name], *texts))
        return "\n".join([repr(self), *columns(rows, "<<>"), *self._notes()])

    def _notes(self) -> list[str]:
        n, k = self.design["n"], len(self.names)
        if self.design["method"] == "saltelli":
            groups = f"  {n} groups of {len(self) // n} runs"
            what = "first, second and total" if self.design["second_order"] else "first and total"
            return [f"{groups}, for {what} Sobol' indices of {k} parameter(s)"]
        if self.design["method"] == "sobol" and n & (n - 1):
            return [f"  not balanced: {n} is no power of two; {1 << (n - 1).bit_length()} is"]
        return []


@suggesting
def sample(
    ranges: Mapping[str, object],
    n: int,
    method: str = "sobol",
    seed: int = 0,
    *,
    second_order: bool = False,
) -> Samples:
    """Draw values of parameters from their ranges or distributions, independently of each other.

    ::

        from scipy import stats

        samples = bd.sample(
            {"belt.preload": stats.norm(400.0, 20.0), "friction.mu_k": (0.5, 0.9)}, 256, "saltelli"
        )

    The same arguments give the same bits again with the same versions of SciPy and NumPy.

    Args:
        ranges: By the name of a parameter: a pair (low, high), between which all values are equally
            likely, or a distribution, anything with ``ppf``, such as a frozen one of
            ``scipy.stats``.
        n: Number of runs; with "saltelli" of groups of runs, a power of two.
        method: "sobol": scrambled Sobol' points, which fill the space evenly, best with a power of
            two. "halton": scrambled Halton points. "latin-hypercube": each of n equally likely
            slices of each parameter once. "random": independent. "saltelli": for
            :func:`beltdyn.sensitivity`, n (k + 2) runs for k parameters.
        seed: Integer >= 0 that all random numbers follow from.
        second_order: With "saltelli": n (2 k + 2) runs, for second indices too.

    Returns:
        The values and how they were made.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
        ImportError: SciPy, or for "saltelli" SALib, is not installed.
    """
    if not isinstance(ranges, Mapping):
        raise TypeError(f"ranges must be a dict by parameter, got {shown(ranges)}")
    if not ranges:
        raise ValueError("ranges must have at least one parameter, got none")
    quantiles = {name: _quantile(name, given) for name, given in ranges.items()}
    names = tuple(quantiles)
    one_of("method", method, METHODS)
    most = 2**63 if method in ("random", "latin-hypercube", "halton") else _MOST
    n, seed = integer("n", n, 1, most), integer("seed", seed, 0)
    if flag("second_order", second_order) and method != "saltelli":
        raise ValueError(f'second_order is for method="saltelli" alone, got method={method!r}')
    if method == "saltelli" and n & (n - 1):
        low = 1 << (n.bit_length() - 1)
        raise ValueError(
            f'n must be a power of two for method="saltelli", such as {low} or {2 * low}, got {n}'
        )
    shares = np.clip(_shares(names, n, method, seed, second_order), _EDGE, 1.0 - _EDGE)
    drawn = [_values(name, quantiles[name][0], shares[:, k]) for k, name in enumerate(names)]
    values = np.ascontiguousarray(np.stack(drawn, axis=1))
    values.setflags(write=False)
    design = {
        "method": method,
        "n": n,
        "seed": seed,
        "second_order": bool(second_order),
        "names": list(names),
        "distributions": {name: text for name, (_, text) in quantiles.items()},
    }
    return Samples(names=names, values=values, design=design)


def _shares(names: tuple[str, ...], n: int, method: str, seed: int, second_order: bool) -> Array:
    """Return points in the unit cube (runs, k)."""
    rng, k = np.random.default_rng(seed), len(names)
    if method == "random":
        return rng.random((n, k))
    if method == "saltelli":
        saltelli = optional_module("SALib.sample.sobol", 'method="saltelli"', "sensitivity")
        problem = {"num_vars": k, "names": list(names), "bounds": [[0.0, 1.0]] * k}
        points = saltelli.sample(problem, n, calc_second_order=second_order, seed=rng)
        return np.asarray(points, dtype=np.float64)
    qmc = optional_module("scipy.stats.qmc", f'method="{method}"', "sensitivity")
    if method == "sobol":
        # The first n of a power of two: as drawing n, without the warning, of which the text of
        # the samples has what matters.
        points = qmc.Sobol(k, scramble=True, seed=rng).random_base2((n - 1).bit_length())[:n]
    elif method == "halton":
        points = qmc.Halton(k, scramble=True, seed=rng).random(n)
    else:
        points = qmc.LatinHypercube(k, seed=rng).random(n)
    return np.asarray(points, dtype=np.float64)


def _quantile(name: object, given: Any) -> tuple[Callable[[Array], Any], str]:
    """Return the quantile function of a range or a distribution, and what it is as text."""
    if not isinstance(name, str):
        raise TypeError(f"ranges must have names as its keys, got {shown(name)}")
    label = f"ranges[{name!r}]"
    if callable(getattr(given, "ppf", None)):
        return given.ppf, _described(given)
    if isinstance(given, str) or not hasattr(given, "__len__"):
        raise TypeError(
            f"{label} must be a pair (low, high) or a distribution with ppf, such as "
            f"scipy.stats.norm(...), got {shown(given)}"
        )
    low, high = pair(label, given, "")
    if not low < high:
        raise ValueError(f"{label} must have low < high, got {low:g} and {high:g}")
    return lambda share: low + (high - low) * share, f"{low:g} to {high:g}"


def _described(distribution: Any) -> str:
    """Write a distribution of SciPy as it was called, another as its class."""
    kind = getattr(getattr(distribution, "dist", None), "name", None)
    if kind is None:
        return type(distribution).__name__
    given = [_number(value) for value in getattr(distribution, "args", ())]
    named = getattr(distribution, "kwds", {}).items()
    return f"{kind}({', '.join([*given, *(f'{key}={_number(value)}' for key, value in named)])})"


def _number(value: object) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) else shown(value)


def _values(name: str, quantile: Callable[[Array], Any], shares: Array) -> Array:
    values = np.asarray(quantile(shares))
    if values.dtype.kind not in "iuf" or values.shape != shares.shape:
        raise ValueError(
            f"ranges[{name!r}].ppf must give a real number for each share, got {shown(values)}"
        )
    bad = ~np.isfinite(values)
    if bad.any():
        k = int(np.argmax(bad))
        raise ValueError(
            f"ranges[{name!r}].ppf must give finite numbers between 0 and 1, got {values[k]} at "
            f"{shares[k]:g}"
        )
    return values.astype(np.float64)
