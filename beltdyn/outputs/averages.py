"""Means and integrals over time of what was sampled, by the trapezoidal rule."""

from __future__ import annotations

import math

import numpy as np

from ..base.checks import Array

#: The part of a run, counted from its end, that means are taken over where nothing else is asked.
LAST = 0.2


def durations(t: Array, begin: float = -math.inf, end: float = math.inf) -> Array:
    """Return the time that each sample stands for (n_t,) [s], of that from ``begin`` to ``end``."""
    half = 0.5 * np.maximum(np.minimum(t[1:], end) - np.maximum(t[:-1], begin), 0.0)
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def span_of(t: Array) -> str:
    """Describe when something is seen, by the times of these samples, as far as they tell apart."""
    first, last = t[0], t[-1]
    digits = 4 if first == last else max(4, 2 + math.ceil(math.log10(last / (last - first))))
    if first == last:
        return f"at t = {first:.{digits}g} s"
    return f"between t = {first:.{digits}g} and {last:.{digits}g} s"


def time_weights(t: Array, begin: float = -math.inf, end: float = math.inf) -> Array:
    """Return the weights (n_t,) of the trapezoidal rule from ``begin`` to ``end``, of sum 1.

    At least the last interval before ``end`` counts; equal weights if no time passes there.
    """
    weights = durations(t, begin, end)
    total = weights.sum()
    return weights / total if total > 0.0 else np.full(t.size, 1.0 / t.size)


def integral(t: Array, values: Array) -> Array:
    """Return the integral of samples (n_t,) from the first of them to each (n_t,)."""
    return np.append(0.0, np.cumsum(0.5 * np.diff(t) * (values[1:] + values[:-1])))[: t.size]


def mean_over(weights: Array, samples: Array) -> Array:
    """Return the weighted mean over time, the first axis, of samples (n_t, ...), NaN left out.

    NaN where there is no other sample of a weight.
    """
    there = ~np.isnan(samples)
    used = np.where(there, weights.reshape((-1,) + (1,) * (samples.ndim - 1)), 0.0)
    total = used.sum(axis=0)
    summed = np.sum(used * np.where(there, samples, 0.0), axis=0)
    return np.asarray(
        np.divide(summed, total, out=np.full(np.shape(summed), np.nan), where=total > 0.0)
    )
