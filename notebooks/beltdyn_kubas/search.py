"""The search for the parameters the paper does not print: starting sets, trials, targets.

Two stages. The objective has many local minima a percent apart, because one of the 60 links more or
less touches a pulley, and times such as that of its arrival jump with it. :func:`explore` searches
widely with an evolution strategy (CMA-ES, the package ``cma``); :func:`beltdyn.identify` with
:func:`targets` then finds the least squares nearby, with the Jacobian for sensitivities and
intervals.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any

import attrs
import numpy as np

import beltdyn as bd

from .paper_numbers import (
    QUANTITIES,
    Array,
    Links,
    best_link,
    candidates,
    cost,
    demands,
    misfit,
    read,
    residuals,
)

__all__ = [
    "BEGIN",
    "STARTS",
    "UNKNOWNS",
    "Trial",
    "evaluate",
    "evaluate_all",
    "explore",
    "targets",
    "trade_off",
]

_T = np.linspace(0.0, 1.0, 2001)
#: No run of a reasonable drive takes this many steps; a trial that does is abandoned.
_MAX_STEPS = 500_000
#: One method for all trials, so that differences between them come from the parameters alone.
_METHOD = "tsit5"


def _drive(
    ea: float, ei: float, rho_a: float, eta_a: float, c1: float, c2: float, b: float,
    inertia: float, mu_k: float,
) -> bd.Params:  # fmt: skip
    return bd.Params(
        belt=bd.Belt(
            length=1.2,
            n_bodies=60,
            linear_density=rho_a,
            axial_stiffness=ea,
            axial_damping=eta_a,
            bending_stiffness=ei,
            mesh="paper",
        ),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=inertia),
            bd.Pulley(center=(0.290, 0.0), radius=0.1, inertia=inertia),
        ],
        contact=bd.Contact(quadratic=c1, linear=c2, damping=b),
        friction=bd.Dahl(mu_k=mu_k, sigma=1e4),
    )


#: Starting points: a stiff and a soft contact, from an earlier coarse search of 1100 runs.
STARTS = {
    "S1": _drive(61.1e3, 0.089, 0.074, 0.245, 0.0, 3.31e8, 2.6e3, 0.0129, 0.978),
    "S2": _drive(70e3, 0.010, 0.100, 1.4, 5e10, 2.5e7, 1.0e3, 0.0100, 1.000),
}

#: Start of the search: S1 laid round held pulleys with friction on, with enough damping not to be
#: chaotic (see below), and a small c1' so that its logarithm exists.
BEGIN = attrs.evolve(
    STARTS["S1"],
    belt=attrs.evolve(STARTS["S1"].belt, axial_damping=0.3),
    contact=attrs.evolve(STARTS["S1"].contact, quadratic=1e9, damping=5e3),
    tensioning=bd.Tensioning(friction=True, offset=((0.0, 0.0), (0.0, 0.0))),
)

#: The unknowns and their limits. A heavy belt with little damping in its contact, such as S1, is
#: chaotic: a tighter tolerance changes its forces by a percent after a second, and numbers read
#: from such runs are noise. The limits of density and damping exclude this.
UNKNOWNS = (
    bd.Free("belt.axial_stiffness", lower=4e4, upper=1.6e5),
    bd.Free("belt.bending_stiffness", lower=2e-3, upper=0.4),
    bd.Free("belt.linear_density", lower=0.04, upper=0.1),
    bd.Free("belt.axial_damping", lower=0.25, upper=2.0),
    bd.Free("contact.quadratic", lower=1e8, upper=1e12),
    bd.Free("contact.linear", lower=5e6, upper=1.5e9),
    bd.Free("contact.damping", lower=4e3, upper=2e4),
    bd.Free("pulleys[*].inertia", lower=0.005, upper=0.03),
    bd.Free("friction.mu_k", lower=0.85, upper=1.15),
    bd.Free("tensioning.shift", lower=-0.011, upper=0.011, scale="linear", size=0.01),
    bd.Free("tensioning.offset[1][0]", lower=-2e-3, upper=2e-3, scale="linear", size=1e-3),
)

#: Uncertainty of a starting set: a standard deviation of the logarithm (mm for the offset).
_UNCERTAINTY = {
    "belt.axial_stiffness": 0.1,
    "pulleys[*].inertia": 0.4,
    "friction.mu_k": 0.06,
    "tensioning.offset[1][0]": 0.2,
    "tensioning.shift": 0.5,
    "belt.bending_stiffness": 1.0,
    "belt.linear_density": 0.7,
    "belt.axial_damping": 1.0,
    "contact.quadratic": 1.5,
    "contact.linear": 0.7,
    "contact.damping": 0.7,
}


@attrs.frozen
class Trial:
    """A drive and its comparison with the paper.

    Attributes:
        params: The drive.
        links: The chosen elements with which it fits best.
        values: The quantities of the table, by name; empty if the misfit is infinite.
        misfit: Sum z^2, infinite if a run failed or no link can be a chosen element.
        cost: The same with the terms that keep a search within the demands.
    """

    params: bd.Params
    links: Links | None = None
    values: dict[str, float] = attrs.field(factory=dict, repr=False)
    misfit: float = np.inf
    cost: float = np.inf

    @property
    def missed(self) -> tuple[str, ...]:
        """Names of the demanded quantities outside their scale."""
        z = residuals(self.values)
        return tuple(
            q.name for q in QUANTITIES if q.demanded and not abs(z.get(q.name, np.inf)) <= 1.0
        )


def evaluate(params: bd.Params, links: Links | None = None) -> Trial:
    """Simulate both cases and read the table from them.

    Args:
        params: The drive, with its tensioning.
        links: The chosen elements; None: those with which it fits best.
    """
    return evaluate_all([params], links)[0]


def evaluate_all(
    drives: Iterable[bd.Params], links: Links | None = None, *, workers: int | None = None
) -> list[Trial]:
    """Do :func:`evaluate` for several drives at once, in threads; None: one per processor."""
    drives = list(drives)
    parts = [field.name for field in attrs.fields(bd.Params) if field.init]
    over = [{part: getattr(params, part) for part in parts} for params in drives]
    options: dict[str, Any] = {"t_eval": _T, "ledger": False, "method": _METHOD}
    options |= {"max_steps": _MAX_STEPS, "executor": workers, "progress": False}
    tables = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bd.BeltdynWarning)
        for case, scene in enumerate((bd.scenes.kubas_case_1(), bd.scenes.kubas_case_2()), 1):
            link = None if links is None else links[case - 1]
            read_off = partial(_read_off, case=case, link=link)
            tables.append(bd.sweep(scene, over, {"paper": read_off}, **options))
    cases = zip(*([table.isel(run=k) for k in range(len(drives))] for table in tables), strict=True)
    return [_trial(params, of) for params, of in zip(drives, cases, strict=True)]


def _read_off(result: bd.Result, *, case: int, link: int | None) -> dict[str, float]:
    """Read the table of a case, and the chosen element that it is of."""
    if link is None:
        if not candidates(result, case):
            return {"link": np.nan}
        link = best_link(result, case)
    return {"link": link, **read(result, case, link)}


def _trial(params: bd.Params, cases: Sequence[Any]) -> Trial:
    """Return the trial of the rows of both tables."""
    if any(one["status"] != "finished" or np.isnan(one["paper.link"]) for one in cases):
        return Trial(params)
    links = Links(*(int(one["paper.link"]) for one in cases))
    values = {q.name: float(cases[q.case - 1][f"paper.{q.name}"]) for q in QUANTITIES}
    return Trial(params, links, values, misfit(values), cost(values))


def _value(params: bd.Params, name: str) -> float:
    """Return one of :data:`UNKNOWNS` of a drive."""
    if name == "pulleys[*].inertia":
        return params.pulleys[0].inertia
    if name == "tensioning.offset[1][0]":
        offset: Any = params.tensioning.offset or ((0.0, 0.0), (0.0, 0.0))
        return float(offset[1][0])
    part, field = name.split(".")
    return float(getattr(getattr(params, part), field))


def _with(params: bd.Params, values: Mapping[str, float]) -> bd.Params:
    """Return a drive with values of :data:`UNKNOWNS`, that of an experiment with these changes."""
    offset = params.tensioning.offset or ((0.0, 0.0), (0.0, 0.0))
    laid = attrs.evolve(params, tensioning=attrs.evolve(params.tensioning, offset=offset))
    return bd.Experiment(bd.scenes.kubas_case_1().torque_fn, 1.0, changes=values).drive(laid)


def coordinate(free: bd.Free, start: float, value: float) -> float:
    """Return the coordinate of a search: 1 at its start, a change of 1 is large."""
    if free.scale == "linear":
        assert free.size is not None
        return 1.0 + (value - start) / free.size
    return 1.0 + math.log(value / start)


def _drive_at(params: bd.Params, free: Sequence[bd.Free], u: Array) -> bd.Params:
    """Return the drive at coordinates of a search that started at another."""
    values = {}
    for one, x in zip(free, u, strict=True):
        start = _value(params, one.name)
        linear = one.scale == "linear"
        values[one.name] = start + (x - 1.0) * one.size if linear else start * math.exp(x - 1.0)
    return _with(params, values)


def _limits(params: bd.Params, free: Sequence[bd.Free]) -> tuple[Array, Array]:
    """Return the lower and the upper limits of the coordinates."""
    limits: list[Any] = [(one.lower, one.upper) for one in free]
    starts = [_value(params, one.name) for one in free]
    low, high = (list(map(coordinate, free, starts, of)) for of in zip(*limits, strict=True))
    return np.array(low), np.array(high)


def explore(
    params: bd.Params,
    *,
    generations: int = 28,
    population: int = 14,
    spread: float = 0.4,
    seed: int = 1,
    free: Sequence[bd.Free] = UNKNOWNS,
    workers: int | None = None,
) -> list[Trial]:
    """Search widely with an evolution strategy (CMA-ES); needs the package ``cma``.

    Args:
        params: Where to begin.
        generations: How many generations.
        population: Trials in each.
        spread: Standard deviation of the first generation, in units of the parameters'
            logarithms (of ``size`` for linear ones) times the uncertainty of each.
        seed: Seed of the random numbers; the same seed gives the same trials.
        free: What is searched.
        workers: Threads; None: one per processor.

    Returns:
        All trials, in order.
    """
    strategy_of = import_module("cma").CMAEvolutionStrategy

    strategy = strategy_of(
        np.ones(len(free)),
        spread,
        {
            "CMA_stds": np.array([_UNCERTAINTY.get(one.name, 0.5) for one in free]),
            "bounds": [list(limit) for limit in _limits(params, free)],
            "popsize": population,
            "seed": seed,
            "verbose": -9,
            "maxiter": generations,
        },
    )
    trials: list[Trial] = []
    for _ in range(generations):
        points = strategy.ask()
        found = evaluate_all([_drive_at(params, free, u) for u in points], workers=workers)
        strategy.tell(points, [min(trial.cost, 1e6) for trial in found])
        trials += found
    return trials


def targets(links: Links, *, within_demands: bool = True) -> list[bd.Target]:
    """Return the table as targets for :func:`beltdyn.identify`, one per case.

    Args:
        links: The chosen elements.
        within_demands: Whether to add the terms that keep a search within the demands; not for
            sensitivities and intervals.
    """
    found = []
    for case, scene in ((1, bd.scenes.kubas_case_1()), (2, bd.scenes.kubas_case_2())):
        rows = [q for q in QUANTITIES if q.case == case]
        extra = sum(q.demanded for q in rows) if within_demands else 0
        experiment = bd.Experiment(
            scene.torque_fn,
            scene.t_end,
            options={"ledger": False, "method": _METHOD, "max_steps": _MAX_STEPS},
            name=f"case {case}",
        )
        found.append(
            experiment.number(
                partial(_numbers, case=case, link=links[case - 1], within_demands=within_demands),
                [q.paper for q in rows] + [0.0] * extra,
                t=_T,
                sigma=[q.scale for q in rows] + [1.0] * extra,
                name=f"case {case}",
                names=[q.name for q in rows]
                + [f"demand {q.name}" for q in rows if q.demanded][:extra],
            )
        )
    return found


def _numbers(result: bd.Result, *, case: int, link: int, within_demands: bool) -> Array:
    values = read(result, case, link)
    numbers = np.array([values[q.name] for q in QUANTITIES if q.case == case])
    return np.concatenate([numbers, demands(values)]) if within_demands else numbers


def trade_off(
    found: bd.Identification,
    links: Links,
    name: str,
    *,
    weights: Sequence[float] = (2.0, 4.0, 8.0),
    free: Sequence[bd.Free] = UNKNOWNS,
    workers: int | None = None,
) -> list[Trial]:
    """Increase the weight of one quantity and simulate the effect on the others.

    The step is that of the linearised least squares with the quantity's scale divided by a weight,
    limited by the uncertainty of the parameters; the trials are simulated, not linearised.

    Args:
        found: The least-squares solution, from :func:`targets` without the demands' terms.
        links: The chosen elements.
        name: The quantity.
        weights: One trial for each.
        free: What was free.
        workers: Threads; None: one per processor.

    Returns:
        The solution itself, then a trial for each weight.
    """
    uncertainty = np.array([_UNCERTAINTY[one.name] for one in free])
    z = np.concatenate([np.ravel(values) for values in found.residuals.values()])
    row = found.labels.index(name)

    def step(weight: float) -> Array:
        scale = np.ones(z.size)
        scale[row] = weight
        matrix = np.concatenate([found.jacobian * scale[:, None], np.diag(1.0 / uncertainty)])
        change, *_ = np.linalg.lstsq(
            matrix, np.concatenate([-z * (scale - 1.0), np.zeros(uncertainty.size)]), rcond=None
        )
        return np.asarray(np.clip(1.0 + change, *_limits(found.params, free)))

    drives = [found.params, *(_drive_at(found.params, free, step(w)) for w in weights)]
    return evaluate_all(drives, links, workers=workers)
