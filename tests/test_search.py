"""The search for what the paper leaves out; that it ends well is for its notebook to show."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np
import pytest
from beltdyn_kubas import LINKS, QUANTITIES, paper_numbers, search
from beltdyn_kubas.paper_numbers import demands, misfit, residuals
from tiers import ci_if

import beltdyn as bd
from beltdyn.identification.free import resolve

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

DEMANDED = [q.name for q in QUANTITIES if q.demanded]


@pytest.fixture(scope="module")
def results() -> tuple[bd.Result, bd.Result]:
    """Both cases with the published set."""
    first, second = (
        bd.simulate(*scene, t_eval=search._T, ledger=False, method=search._METHOD)
        for scene in (bd.scenes.kubas_case_1(), bd.scenes.kubas_case_2())
    )
    return first, second


@pytest.fixture(scope="module")
def published() -> search.Trial:
    return search.evaluate(bd.scenes.kubas_case_1().params)


WAYS = {
    "held": bd.Tensioning(),
    "friction": bd.Tensioning(friction=True),
    "free": bd.Tensioning(friction=True, pulleys="free"),
}


@pytest.mark.parametrize(
    ("start", "way"), ci_if(("S1", "held").__ne__, product(search.STARTS, WAYS))
)
def test_the_published_set_beats_both_starts(published: search.Trial, start: str, way: str) -> None:
    trial = search.evaluate(attrs.evolve(search.STARTS[start], tensioning=WAYS[way]))
    assert published.misfit < trial.misfit < np.inf


def test_misfit_and_cost_of_a_trial(
    published: search.Trial, results: tuple[bd.Result, bd.Result]
) -> None:
    """Of the published set, which is one of both cases and holds every demand."""
    read = [paper_numbers.read(results[k], k + 1, LINKS[k]) for k in range(2)]
    assert published.values == {**read[0], **read[1]}
    assert bd.scenes.kubas_case_1().params == bd.scenes.kubas_case_2().params
    assert published.links == LINKS
    assert published.missed == ()
    z = residuals(published.values)
    assert set(z) == {q.name for q in QUANTITIES}
    assert published.misfit == pytest.approx(sum(value**2 for value in z.values()))
    assert published.cost == published.misfit + np.sum(demands(published.values) ** 2)
    off = published.values | {"passive": 120.0 + 2 * 3.6}
    # two scales off: z = 2 in the misfit, and well over what any conflict could pay for that
    assert misfit(off) == pytest.approx(published.misfit - z["passive"] ** 2 + 4.0)
    assert np.sum(demands(off) ** 2) > 1000.0


def test_a_drive_that_cannot_run_is_a_bad_trial() -> None:
    # so soft that the belt slips off its pulleys while it is settled
    trial = search.evaluate(attrs.evolve(search.STARTS["S2"], contact=bd.Contact(linear=1e3)))
    assert trial.values == {} and trial.misfit == trial.cost == np.inf
    assert set(trial.missed) == set(DEMANDED)


def test_targets_are_the_table_in_two_runs(
    published: search.Trial, results: tuple[bd.Result, bd.Result]
) -> None:
    """Least squares of them are the cost of a trial, or, without the demands, its misfit."""
    for within, sum_of_squares in ((True, published.cost), (False, published.misfit)):
        z, labels = [], []
        for target, result in zip(
            search.targets(LINKS, within_demands=within), results, strict=True
        ):
            z += list((target.compute("", result) - target.values).ravel() / target.sigma)
            labels += target.labels("")
        assert sum(one**2 for one in z) == pytest.approx(sum_of_squares, rel=1e-12)
        of_table = [name for name in labels if not name.startswith("demand ")]
        assert set(of_table) == set(published.values) and len(of_table) == len(QUANTITIES)
        assert len(labels) - len(of_table) == within * len(DEMANDED)


@pytest.mark.ci(guard="test_search.py::test_targets_are_the_table_in_two_runs")
def test_identification_has_the_cost_of_a_trial(published: search.Trial) -> None:
    options = {"max_nfev": 1, "diff_step": 0.01, "mesh": False}
    targets = search.targets(LINKS)
    at = bd.identify(published.params, search.UNKNOWNS[:1], targets, **options)
    computed = dict(zip(at.labels, at.computed, strict=True))
    assert {name: computed[name] for name in published.values} == published.values
    assert 2.0 * at.cost == pytest.approx(published.cost, rel=1e-12)


@pytest.mark.parametrize("runs", ci_if(bool, [False, True]))
def test_exploring_is_the_same_for_any_number_of_threads(
    monkeypatch: pytest.MonkeyPatch, runs: bool
) -> None:
    """Of what is tried and of its costs, be they of runs or of the strategy's own steps alone."""

    def masses(drives: list[bd.Params], **_: Any) -> list[search.Trial]:
        return [search.Trial(params, cost=params.belt.linear_density) for params in drives]

    if not runs:
        monkeypatch.setattr(search, "evaluate_all", masses)

    def explore(workers: int, seed: int) -> list[search.Trial]:
        return search.explore(
            search.BEGIN, generations=1 if runs else 3, population=4, seed=seed, workers=workers
        )

    one, two, other = explore(1, 1), explore(2, 1), explore(2, 2)
    assert [trial.params for trial in one] == [trial.params for trial in two]
    assert [trial.cost for trial in one] == [trial.cost for trial in two]
    assert one[0].params != other[0].params


def test_a_trade_off_is_the_step_of_the_weighted_least_squares(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As far as it is linear: the quantity comes nearer to the paper, and the sum of squares,
    which was least, grows.
    """
    monkeypatch.setattr(
        search, "evaluate_all", lambda drives, links, **_: [search.Trial(d, links) for d in drives]
    )
    free = search.UNKNOWNS[:3]
    names, rng = ["minimum", "maximum", "start", "end", "friction"], np.random.default_rng(1)
    jacobian = 5.0 * rng.standard_normal((5, 3))
    z = np.linalg.qr(jacobian, "complete")[0][:, 3:] @ [0.3, 0.2]  # what no parameter takes away
    params = bd.scenes.kubas_case_1().params
    found: Any = SimpleNamespace(
        params=params, residuals={"case 2": z}, labels=names, jacobian=jacobian
    )
    here, *pulled = search.trade_off(found, LINKS, "end", weights=(2.0, 4.0, 1e9), free=free)
    assert here.params == params
    parameters = resolve(params, free)
    after = [z]
    for trial in pulled:
        steps = [
            one.coordinate(getattr(trial.params.belt, one.name.removeprefix("belt."))) - 1.0
            for one in parameters
        ]
        after.append(z + jacobian @ steps)
    nearer = [abs(one[3]) for one in after]
    assert nearer == sorted(nearer, reverse=True) and nearer[1] < 0.9 * nearer[0]
    squares = [float(one @ one) for one in after]
    assert squares == sorted(squares)


@pytest.mark.extended(
    guard="test_search.py::test_a_trade_off_is_the_step_of_the_weighted_least_squares"
)
def test_a_trade_off_pulls_its_quantity_towards_the_paper(published: search.Trial) -> None:
    targets = search.targets(LINKS, within_demands=False)
    options = {"jac": "2-point", "diff_step": 0.03, "max_nfev": 1, "mesh": False}
    at = bd.identify(published.params, search.UNKNOWNS, targets, **options)
    here, pulled = search.trade_off(at, LINKS, "minimum", weights=(4.0,))
    assert here.values == published.values
    z, z_pulled = residuals(here.values), residuals(pulled.values)
    # the slack side goes down everywhere: row 9 nearer to the paper, row 2 farther from it
    assert abs(z_pulled["minimum"]) < abs(z["minimum"]) - 0.5
    assert z_pulled["passive"] < z["passive"] - 0.5
    assert pulled.misfit > here.misfit
