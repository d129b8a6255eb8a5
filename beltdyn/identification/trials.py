"""Trials: all experiments simulated at one point of the search."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from ..base.run_warnings import silenced
from ..drive.parameters import read
from ..drive.params import Params
from ..drive.scene import Scene
from ..many.collect import outcomes
from ..many.outcome import Outcome, attempt
from ..many.pools import Pool
from ..outputs.histories import GROUPS
from ..outputs.state import State
from ..result.errors import SimulationError
from ..result.result import Result
from ..run.simulation import simulate
from ..verification.quantities import with_links
from .experiment import Experiment, Target
from .free import Parameter, place


@attrs.frozen(eq=False, kw_only=True)
class Trial:
    """Results of the experiments at the coordinates ``u``, or why there are none."""

    u: Array
    y: Array  # every computed number (n,), empty after an error
    error: Exception | None = None
    params: Params | None = None
    results: tuple[Result, ...] = ()  # one per experiment, if they were kept


@attrs.frozen(eq=False)
class _Run:
    """An experiment with its targets and the sample times of all of them."""

    name: str
    experiment: Experiment
    start: int
    targets: tuple[tuple[str, Target], ...]
    t: Array


def _rows(result: Result, rows: Any) -> Result:
    """Return a result at some of its samples."""
    groups = {
        name: type(group)(**vars(group) | {k: x[rows] for k, x in group.arrays().items()})
        for name in GROUPS
        if (group := getattr(result, name)) is not None
    }
    return attrs.evolve(result, t=result.t[rows], **groups)


class Rig:
    """All experiments, with all measured numbers in one vector."""

    def __init__(
        self, params: Params, parameters: Sequence[Parameter], targets: object, pool: Pool
    ) -> None:
        self._params = params
        self._parameters = parameters
        self._pool = lambda: nullcontext(pool)  # for the runs of all points
        self._runs = _arrange(params, _checked(targets))
        self.experiments = tuple(run.name for run in self._runs)
        #: By name; the place of each in the vector, and a name for every number of it.
        self.targets: dict[str, Target] = {}
        for run in self._runs:
            for name, target in run.targets:
                if name in self.targets:
                    raise ValueError(f"two targets are called {name!r}: tell them apart by name=")
                self.targets[name] = target
        ends = np.cumsum([target.values.size for target in self.targets.values()])
        self.slices = {
            name: slice(int(end) - target.values.size, int(end))
            for (name, target), end in zip(self.targets.items(), ends, strict=True)
        }
        self.labels = tuple(
            label for name, target in self.targets.items() for label in target.labels(name)
        )
        self.runs = 0  # simulated so far

    def try_all(
        self, points: Sequence[Array], *, keep: bool = False, refine: int = 1
    ) -> list[Trial]:
        """Simulate all experiments at several points, in parallel."""
        # Settled before the runs, which share them, so that processes need not settle them again.
        starts = {run.start: run.experiment for run in reversed(self._runs)}
        begins = [
            (self._params, self._parameters, experiment, u, refine)
            for u in points
            for experiment in starts.values()
        ]
        begun = iter(outcomes(_begin, begins, self._pool))
        of_points = [{start: next(begun) for start in starts} for _ in points]
        jobs = [(run, begun[run.start], keep) for begun in of_points for run in self._runs]
        done = iter(outcomes(_simulate, jobs, self._pool))
        self.runs += len(jobs)
        return [self._trial(u, [next(done) for _ in self._runs]) for u in points]

    def _trial(self, u: Array, done: Sequence[Outcome]) -> Trial:
        for one in done:
            if one.status != "finished":
                return Trial(u=u, y=np.empty(0), error=one.error or RuntimeError(one.message))
        numbers, results = zip(*(one.value for one in done), strict=True)
        return Trial(
            u=u,
            y=np.concatenate(numbers),
            params=place(self._params, self._parameters, u),
            results=tuple(result for result in results if result is not None),
        )


def _checked(targets: object) -> list[Target]:
    if isinstance(targets, (Target, Experiment)) or not isinstance(targets, Sequence):
        raise TypeError("targets must be a sequence of what curve() and number() give")
    for k, target in enumerate(targets):
        if not isinstance(target, Target):
            raise TypeError(
                f"targets[{k}] must be what curve() or number() of an Experiment gives, "
                f"got {type(target).__name__}"
            )
    if not targets:
        raise ValueError("targets must hold at least one target")
    return list(targets)


def _arrange(params: Params, targets: Sequence[Target]) -> list[_Run]:
    """Return the experiments with their targets, each with the number of what it starts from."""
    experiments = list(dict.fromkeys(target.experiment for target in targets))
    starts: dict[tuple[Any, ...], int] = {}
    runs: dict[str, _Run] = {}
    for k, experiment in enumerate(experiments):
        for change in experiment.changes:
            read(params, change)
        name = experiment.name or ("run" if len(experiments) == 1 else f"run {k + 1}")
        if name in runs:
            raise ValueError(f"two experiments are called {name!r}: tell them apart by name=")
        begins = (
            *(repr(experiment.changes), repr(experiment.settling), id(experiment.initial)),
            *(id(experiment.motion), experiment.motion and experiment.t_end),
        )
        own = [target for target in targets if target.experiment is experiment]
        prefix = f"{name}: " if len(experiments) > 1 else ""
        runs[name] = _Run(
            name,
            experiment,
            starts.setdefault(begins, len(starts)),
            tuple((f"{prefix}{target.name}", target) for target in own),
            np.unique(np.concatenate([target.t for target in own])),
        )
    return list(runs.values())


def _begin(
    job: tuple[Params, Sequence[Parameter], Experiment, Array, int], _before: object
) -> Outcome:
    """Return the drive of runs that begin alike, and its state."""
    params, parameters, experiment, u, refine = job

    def begun() -> tuple[Params, State]:
        drive = place(params, parameters, u)
        if refine > 1:
            drive = with_links(drive, refine * drive.n_bodies)
        drive = experiment.drive(drive)
        return drive, experiment.begin(drive)

    return attempt(begun, (ValueError, SimulationError))


def _simulate(job: tuple[_Run, Outcome, bool], _before: object) -> Outcome:
    """Return the computed numbers of a run, and its result if that is to be kept."""
    run, begun, keep = job
    if begun.status != "finished":
        return begun
    experiment, (drive, start) = run.experiment, begun.value

    def simulated() -> Result:
        scene = Scene(drive, experiment.torque_fn, experiment.t_end, experiment.motion)
        with silenced():
            return simulate(*scene, t_eval=run.t, initial=start, **experiment.options)

    ran = attempt(simulated, SimulationError)
    if ran.value is None:
        return ran
    result: Result = ran.value
    parts = []
    for name, target in run.targets:
        whole = target.t.shape == run.t.shape and bool((target.t == run.t).all())
        seen = result if whole else _rows(result, np.searchsorted(run.t, target.t))
        values = target.compute(name, seen)
        if not np.isfinite(values).all():
            first = int(np.argmin(np.isfinite(values.ravel())))
            label = target.labels(name)[first]
            none = f"{label}: the run has no value there (NaN): leave this sample out"
            return Outcome(status="measure", message=none, error=ValueError(none))
        parts.append(values.ravel())
    return attrs.evolve(ran, value=(np.concatenate(parts), result if keep else None))
