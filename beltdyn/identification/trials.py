"""Trials: all experiments simulated at one point of the search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from ..base.run_warnings import silenced
from ..drive.parameters import read
from ..drive.params import Params
from ..many.pools import Pool
from ..outputs.histories import GROUPS
from ..outputs.state import State
from ..result.errors import SimulationError
from ..result.result import Result
from ..run.simulation import simulate
from ..verification.quantities import with_links
from .experiment import Experiment, Target
from .free import Parameter, place

__all__ = ["Rig", "Trial"]


@attrs.frozen(eq=False, kw_only=True)
class Trial:
    """Results of the experiments at a point, or why they cannot be simulated there.

    Attributes:
        u: The point: coordinates of the free parameters (n_free,).
        y: Every computed number (n,), empty after an error.
        error: Why there are no numbers, or None.
        params: The drive there.
        results: The runs, one per experiment, if they were kept.
    """

    u: Array
    y: Array
    error: Exception | None = None
    params: Params | None = None
    results: tuple[Result, ...] = ()


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
        name: attrs.evolve(group, **{k: values[rows] for k, values in group.arrays().items()})
        for name in GROUPS
        if (group := getattr(result, name)) is not None
    }
    return attrs.evolve(result, t=result.t[rows], **groups)


class Rig:
    """All experiments, with all measured numbers in one vector.

    Attributes:
        targets: The targets by name.
        slices: Where the numbers of each target are in the vector.
        labels: A name for every number of the vector.
        runs: Runs simulated so far.
    """

    def __init__(
        self, params: Params, parameters: Sequence[Parameter], targets: object, pool: Pool
    ) -> None:
        self._params = params
        self._parameters = parameters
        self._pool = pool
        self._runs = _arrange(params, _checked(targets))
        self.experiments = tuple(run.name for run in self._runs)
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
        self.runs = 0

    def try_all(
        self,
        points: Sequence[Array],
        *,
        keep: bool = False,
        refine: int = 1,
        after: Callable[[], None] | None = None,
    ) -> list[Trial]:
        """Simulate all experiments at several points, in parallel."""
        drives = [self._drives(u, refine) for u in points]
        starts: dict[tuple[int, int], Any] = {}
        for k, of_runs in enumerate(drives):
            for run, drive in zip(self._runs, of_runs, strict=True):
                starts.setdefault((k, run.start), (run.experiment, drive))
        begun = dict(zip(starts, self._pool.map(_begin, starts.values()), strict=True))
        jobs = [
            (run, drive, begun[k, run.start], keep)
            for k, of_runs in enumerate(drives)
            for run, drive in zip(self._runs, of_runs, strict=True)
        ]
        done = self._pool.map(_simulate, jobs)
        self.runs += len(jobs)
        if after is not None:
            after()
        width = len(self._runs)
        return [self._trial(u, done[k * width : (k + 1) * width]) for k, u in enumerate(points)]

    def _drives(self, u: Array, refine: int) -> list[Params | Exception]:
        try:
            drive = place(self._params, self._parameters, u)
            drive = with_links(drive, refine * drive.n_bodies) if refine > 1 else drive
        except ValueError as error:
            return [error] * len(self._runs)
        return [_drive_of(run.experiment, drive) for run in self._runs]

    def _trial(self, u: Array, done: Sequence[tuple[Array, Result | None] | Exception]) -> Trial:
        for outcome in done:
            if isinstance(outcome, Exception):
                return Trial(u=u, y=np.empty(0), error=outcome)
        good = [outcome for outcome in done if not isinstance(outcome, Exception)]
        return Trial(
            u=u,
            y=np.concatenate([y for y, _ in good]),
            params=place(self._params, self._parameters, u),
            results=tuple(result for _, result in good if result is not None),
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
    experiments = list(dict.fromkeys(target.experiment for target in targets))
    starts: list[tuple[Any, ...]] = []
    runs: list[_Run] = []
    for k, experiment in enumerate(experiments):
        for change in experiment.changes:
            read(params, change)
        name = experiment.name or ("run" if len(experiments) == 1 else f"run {k + 1}")
        if name in [run.name for run in runs]:
            raise ValueError(f"two experiments are called {name!r}: tell them apart by name=")
        begins = (
            *(repr(experiment.changes), repr(experiment.settling), id(experiment.initial)),
            *(id(experiment.motion), experiment.motion and experiment.t_end),
        )
        if begins not in starts:
            starts.append(begins)
        own = [target for target in targets if target.experiment is experiment]
        prefix = f"{name}: " if len(experiments) > 1 else ""
        runs.append(
            _Run(
                name,
                experiment,
                starts.index(begins),
                tuple((f"{prefix}{target.name}", target) for target in own),
                np.unique(np.concatenate([target.t for target in own])),
            )
        )
    return runs


def _drive_of(experiment: Experiment, drive: Params) -> Params | Exception:
    try:
        return experiment.drive(drive)
    except ValueError as error:
        return error


def _begin(job: tuple[Experiment, Params | Exception]) -> State | Exception:
    experiment, drive = job
    if isinstance(drive, Exception):
        return drive
    try:
        return experiment.begin(drive)
    except (ValueError, SimulationError) as error:
        return error


def _simulate(
    job: tuple[_Run, Params | Exception, State | Exception, bool],
) -> tuple[Array, Result | None] | Exception:
    run, drive, start, keep = job
    if isinstance(drive, Exception):
        return drive
    if isinstance(start, Exception):
        return start
    experiment = run.experiment
    options: Mapping[str, Any] = experiment.options
    try:
        with silenced():
            result = simulate(
                drive,
                experiment.torque_fn,
                experiment.t_end,
                motion=experiment.motion,
                t_eval=run.t,
                initial=start,
                **options,
            )
    except SimulationError as error:
        return error
    parts = []
    for name, target in run.targets:
        whole = target.t.shape == run.t.shape and bool((target.t == run.t).all())
        seen = result if whole else _rows(result, np.searchsorted(run.t, target.t))
        values = target.compute(name, seen)
        if not np.isfinite(values).all():
            first = int(np.argmin(np.isfinite(values.ravel())))
            label = target.labels(name)[first]
            return ValueError(f"{label}: the run has no value there (NaN): leave this sample out")
        parts.append(values.ravel())
    return np.concatenate(parts), result if keep else None
