"""Samples of parameters: where they lie, that a seed gives the same bits, what is refused."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

import beltdyn as bd
from beltdyn import optional
from beltdyn.sweeping.sampling import METHODS

RANGES: dict[str, Any] = {
    "belt.preload": (300.0, 500.0),
    "friction.mu_k": stats.norm(0.8, scale=0.1),
}
SINGLE = [method for method in METHODS if method != "saltelli"]


def shares(samples: bd.Samples) -> np.ndarray:
    """Give the values back as shares of their distributions (n, 2)."""
    first, second = samples.values.T
    return np.stack([(first - 300.0) / 200.0, stats.norm.cdf(second, 0.8, 0.1)], axis=1)


def test_a_seed_gives_the_same_bits_and_another_others() -> None:
    for method in METHODS:
        one, same, other = (bd.sample(RANGES, 32, method, seed=seed) for seed in (5, 5, 6))
        assert one.values.tobytes() == same.values.tobytes(), method
        assert not (one.values == other.values).any(), method
        assert one.names == ("belt.preload", "friction.mu_k")
        assert not one.values.flags.writeable


def test_values_follow_their_distributions() -> None:
    """Kolmogorov's test of each column; no seed is chosen, and 1e-4 is missed once in 10 000."""
    for method in SINGLE:
        samples = bd.sample(RANGES, 512, method)
        assert len(samples) == 512
        for column in shares(samples).T:
            assert stats.kstest(column, "uniform").pvalue > 1e-4, method
        assert abs(np.corrcoef(samples.values.T)[0, 1]) < 4.0 / np.sqrt(512), method

    # Where normal distributions are infinite: Sobol' points without scrambling begin with 0.
    class Asked:
        def ppf(self, share: np.ndarray) -> np.ndarray:
            assert share.min() > 0.0 and share.max() < 1.0
            return stats.norm.ppf(share)

    for method in SINGLE:
        samples = bd.sample({"a": Asked()}, 4096, method)
        assert np.isfinite(samples.values).all()
        assert samples.design["distributions"] == {"a": "Asked"}


def test_each_of_n_slices_has_one_value() -> None:
    """By construction of a Latin hypercube, and of a Sobol' net of a power of two."""
    for method in ("sobol", "latin-hypercube"):
        slices = np.floor(128 * shares(bd.sample(RANGES, 128, method, seed=2))).astype(int)
        for column in slices.T:
            assert sorted(column) == list(range(128)), method
    # fewer Sobol' points are the first of more
    most, some = (bd.sample(RANGES, n, "sobol") for n in (128, 100))
    np.testing.assert_array_equal(some.values, most.values[:100])
    assert "100 is no power of two; 128 is" in str(some)
    assert "power of two" not in str(most)


def test_groups_of_saltelli() -> None:
    """Row A, rows A with one column of B, for second indices B with one of A, row B."""
    k, n = 3, 8
    ranges = {name: (0.0, 1.0) for name in "abc"}
    for second_order, size in ((False, k + 2), (True, 2 * k + 2)):
        samples = bd.sample(ranges, n, "saltelli", second_order=second_order)
        assert len(samples) == n * size
        for group in samples.values.reshape(n, size, k):
            a, b = group[0], group[-1]
            rows = [np.where(np.arange(k) == j, b, a) for j in range(k)]
            if second_order:
                rows += [np.where(np.arange(k) == j, a, b) for j in range(k)]
            assert (a != b).all()
            np.testing.assert_array_equal(group[1:-1], rows)


def test_the_design_says_how_they_were_made() -> None:
    samples = bd.sample(RANGES, 16, "saltelli", seed=3, second_order=True)
    assert json.loads(json.dumps(samples.design)) == {
        "method": "saltelli",
        "n": 16,
        "seed": 3,
        "second_order": True,
        "names": ["belt.preload", "friction.mu_k"],
        "distributions": {"belt.preload": "300 to 500", "friction.mu_k": "norm(0.8, scale=0.1)"},
    }
    assert repr(samples) == "Samples(96 runs of 2 parameter(s): saltelli, seed 3)"
    assert "friction.mu_k  norm(0.8, scale=0.1)" in str(samples)
    assert "16 groups of 6 runs, for first, second and total" in str(samples)


def wrong(values: Any) -> Any:
    return {"a": SimpleNamespace(ppf=lambda _share: values)}


REFUSED: list[tuple[type[Exception], str, dict[str, Any]]] = [
    (TypeError, r"ranges must be a dict", {"ranges": [("a", (0, 1))]}),
    (ValueError, r"ranges must have at least one", {"ranges": {}}),
    (TypeError, r"ranges must have names", {"ranges": {1: (0, 1)}}),
    (TypeError, r"ranges\['a'\] must be a pair \(low, high\) or", {"ranges": {"a": 1.0}}),
    (TypeError, r"ranges\['a'\] must be a pair \(low, high\)", {"ranges": {"a": "ab"}}),
    (TypeError, r"ranges\['a'\] must be a pair of real", {"ranges": {"a": (1, 2, 3)}}),
    (ValueError, r"ranges\['a'\] must have low < high, got 2 and 1", {"ranges": {"a": (2, 1)}}),
    (ValueError, r"ranges\['a'\]\[1\] must be finite", {"ranges": {"a": (0, np.inf)}}),
    (ValueError, r"ranges\['a'\]\.ppf must give finite", {"ranges": wrong(np.full(8, np.inf))}),
    (ValueError, r"ranges\['a'\]\.ppf must give a real", {"ranges": wrong("x")}),
    (ValueError, r"method must be one of sobol, ", {"method": "grid"}),
    (ValueError, r"n must be an integer from 1 to", {"n": 0}),
    (TypeError, r"n must be an integer", {"n": 8.0}),
    (ValueError, r"n must be a power of two .* 8 or 16", {"n": 12, "method": "saltelli"}),
    (ValueError, r"seed must be an integer >= 0", {"seed": -1}),
    (TypeError, r"seed must be an integer", {"seed": None}),
    (TypeError, r"second_order must be a bool", {"second_order": 1}),
    (ValueError, r"second_order is for method=\"saltelli\" alone", {"second_order": True}),
]  # fmt: skip


def test_what_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without SALib the extra is named."""
    for error, words, arguments in REFUSED:
        with pytest.raises(error, match=f"^{words}"):
            bd.sample(**{"ranges": {"a": (0.0, 1.0)}, "n": 8, **arguments})

    def missing(name: str) -> Any:
        raise ModuleNotFoundError(name=name.partition(".")[0])

    monkeypatch.setattr(optional, "import_module", missing)
    with pytest.raises(ImportError, match=r'needs the package SALib: .* "beltdyn\[sensitivity\]"'):
        bd.sample({"a": (0.0, 1.0)}, 8, "saltelli")
