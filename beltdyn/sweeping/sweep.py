"""Sweeps: many runs of a scene, with parameters, loads or options changed."""

from __future__ import annotations

import functools
import inspect
import json
import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, ParamSpec

import attrs
import numpy as np

from .. import _core, scenes
from ..base.checks import close_to, flag, positive, sample_times
from ..base.optional import optional_module
from ..base.run_options import Options
from ..base.run_warnings import BeltdynWarning, RunWarning, issue
from ..drive.parameters import overlap
from ..drive.scene import Scene
from ..loads.motions import as_motions, in_core
from ..loads.torques import Torque, as_terms
from ..many.collect import Cost, collect
from ..many.content import Contents, needing_keys
from ..many.identity import token
from ..many.outcome import STATUSES, Outcome
from ..many.pools import Pool, as_pool
from ..run.settling import check_initial
from ..run.start_of_run import span
from ..verification.runs import whole_scene
from .dataset import Table
from .measure import as_measure
from .names import OPTIONS, find, in_words, place
from .outcomes import in_text
from .points import RUN, Points, as_points
from .work import Work

_Given = ParamSpec("_Given")
_LATEST = 1e300  #: Any time is before it [s].


class SweepInterrupted(KeyboardInterrupt):
    """Ctrl-C during a sweep.

    Attributes:
        dataset: The runs finished before; the others have the status "missing".
    """

    def __init__(self, message: str, dataset: Any) -> None:
        super().__init__(message)
        self.dataset = dataset


@attrs.frozen(kw_only=True)
class Swept(Cost):
    """A finished sweep, and its cost."""

    dataset: Any

    @property
    def counts(self) -> dict[str, int]:
        """Runs by status, in the order of these."""
        found = Counter(self.dataset["status"].values.ravel().tolist())
        return {status: found[status] for status in STATUSES if found[status]}

    def without_result(self) -> Iterator[RunWarning]:
        """Yield the warning that runs have no result, if there are such."""
        bad, total = self.counts, sum(self.counts.values())
        if bad.pop("finished", 0) < total:
            status, message = (self.dataset[one].values.ravel() for one in ("status", "message"))
            first = np.flatnonzero(status != "finished")[0]
            why = ", ".join(f"{count} {status}" for status, count in bad.items())
            text = (
                f"{sum(bad.values())} of {total} runs have no result ({why}); the first: "
                f"{message[first]}; status and message of the dataset say it of each"
            )
            yield RunWarning(code="no_result", text=text)


def _table_alone(run: Callable[_Given, Any]) -> Callable[_Given, Any]:
    """Return a sweep that returns its dataset, and warns of runs without result."""

    @functools.wraps(run)
    def table_of(*args: _Given.args, **options: _Given.kwargs) -> Any:
        swept: Swept = run(*args, **options)
        try:
            issue(swept.without_result())
        except BeltdynWarning as error:  # a filter makes it one: what was computed is not lost
            error.dataset = swept.dataset  # type: ignore[attr-defined]
            raise
        return swept.dataset

    return table_of


@_table_alone
def sweep(
    scene: Scene | str | os.PathLike[str] | tuple[Any, ...],
    over: Any,
    measure: Any = None,
    *,
    combine: str = "grid",
    executor: Any = None,
    store: str | os.PathLike[str] | None = None,
    warm: str | None = None,
    last: float = 0.2,
    progress: bool = True,
    key: str = "",
    **options: Any,
) -> Any:
    """Run a scene many times, with numbers of the drive, loads or options changed.

    Torque capacity over preload and friction, on all processors::

        table = bd.sweep(
            bd.scenes.kubas_case_1(),
            over={"belt.length": [1.195, 1.2, 1.205], "torque.scale": [0.5, 0.75, 1.0]},
            measure=["report.pulleys.margin", "span_tension.least"],
        )
        table["span_tension.least"].sel(span="span 0")

    A run that fails does not stop the sweep: its numbers are NaN, ``status``, ``message`` and
    ``warnings`` of the result say why, and the warning "no_result" how many there are. States that
    the belt settles into are shared by the runs that differ in loads, motions and options alone.

    Every run gives the same bits wherever it is done, on processors of the same instruction level
    (``kernels`` of the result); otherwise within the errors that its ``rtol`` allows.

    Args:
        scene: What to run: a scene, or ``(params, torque_fn, t_end)`` with or without ``motion``,
            the name of a built-in scene, or a TOML file.
        over: What to change: ``{name: values}``, of which every combination is run; a list of
            ``{name: value}``, one for each run; or the result of :func:`beltdyn.sample`. Names are
            those of the fields of :class:`beltdyn.Params`, "belt.preload", "friction.mu_k",
            "pulleys[1].inertia", "pulleys[crank].inertia", "pulleys[*].inertia" (of all),
            "pulleys[tensioner].mount.stiffness" ("belt.preload" takes the place of a length that
            the scene gives, and the other way round); "torque.scale", a factor on all set torques,
            "torque[1].scale" on one of a sum, "torque[1].quadratic", a field of it, "torque", all
            of it; "motion.scale", "motion[crank].amplitudes[0]"; "t_end"; and arguments of
            :func:`beltdyn.simulate` such as "rtol". Values may also be objects: friction laws,
            torques.
        measure: What to measure in each run: names, ``{name of your own: name or function}``, or a
            function of the :class:`beltdyn.Result` that returns a number, a text, an array, an
            ``xarray.DataArray`` with dimensions and units, or a mapping of these; None: speeds,
            torques, powers, hub loads, tensions, creep and efficiency. Names are
            ``"report.<part>.<quantity>"`` of :meth:`beltdyn.Result.report` (of all rows, or of one:
            "report.pulleys[crank].margin"; "report.efficiency"; "report.spans.tension least";
            "report" for everything), of histories such as "span_tension", "pulleys.omega", whole or
            over the last part of a run with ".mean", ".least", ".most", ".rms", ".final", and
            "stats.steps".
        combine: "grid": every combination of the values; "zip": the first of all, the second of
            all, and so on.
        executor: Where runs are done. None: in threads, one for each processor; in processes if a
            torque or motion is a Python function, or if quantities of reports are measured, which
            would keep other threads waiting. A number of workers, which are threads or processes
            by the same rule; "threads" or "processes"; any ``concurrent.futures.Executor``, or the
            ``Client`` of a Dask cluster. A run in which worker processes die several times is given
            up, with the status "lost".
        store: A folder that keeps all outcomes as the sweep goes (SQLite files). A sweep that was
            killed, or that has got more points, computes only what is missing in it. Runs are known
            by their content and the build of this package, not by the sweep they are from; Python
            functions by their source, what they enclose, and what of yours they use. The contents
            of files that they read are not seen: give another ``key`` where these change. Compiled
            functions, those whose source is not at hand, and those that import modules of yours
            when they are called, are refused without a ``key``. Files have checksums.
        warm: One of the names of a grid: each run starts, at t = 0, from the final state of the run
            with the value of this name before, and not from rest (unless that run failed). For
            steady states that change slowly along it.
        last: The part of each run, counted from its end, over which reports, means and extremes are
            taken.
        progress: Whether to show progress on stderr (on terminals; needs ``rich``).
        key: A name of your own for what the functions of the scene and ``measure`` do: it is part
            of the keys of runs in the store, and stands for functions whose content cannot be
            known. Another one distinguishes runs that look alike.
        **options: ``t_end``, in place of that of the scene, and arguments of
            :func:`beltdyn.simulate` for all runs, such as ``t_eval``, ``method``, ``rtol``; not
            ``outputs``, which follow from ``measure``.

    Returns:
        An ``xarray.Dataset``. Of a grid each name is a dimension, otherwise they are coordinates
        along the dimension "run". Quantities have their own dimensions after those ("pulley",
        "span", "time"), units and descriptions. ``status`` is "finished", "refused" (there is no
        such drive), "failed", "measure" (measuring raised an error), "lost". Warnings that show in
        outputs that are not measured are not looked for, as with ``outputs`` of
        :func:`beltdyn.simulate`.

    Raises:
        ImportError: xarray is not installed; or loky, which processes need.
        TypeError, ValueError: An argument breaks its rule, before anything runs; a part of the
            store is damaged, or a function's content cannot be known: the message says which.
        OSError: The store cannot be written; what was written before is kept.
        RuntimeError: The executor given takes no more work.
        SweepInterrupted: Ctrl-C; ``.dataset`` holds what was done.
    """
    if isinstance(scene, (str, os.PathLike)):
        base = scenes.find(scene)
    else:
        base = whole_scene(scene, "the name of a scene or a TOML file")
    points = as_points(over, combine)
    if "t_end" in options and "t_end" not in points.names:
        base = base._replace(t_end=positive("t_end", options.pop("t_end"), "s"))
    table = Table(points, _check_names(base, points))
    _check_options(options, base, points)
    what = as_measure(measure, base.params, last)
    taken = {*points.names, RUN, "status", "message", "warnings"} & what.names
    if taken:
        raise ValueError(f"measure: {min(taken)!r} is the name of something else in the result")
    if not isinstance(key, str):
        raise TypeError(f"key must be a str, got {type(key).__name__}")
    work, after = Work(base, options, points.names, what, warm is not None), _chains(points, warm)
    shown = flag("progress", progress)

    def take(run: int, outcome: Outcome) -> str:
        table.add(run, outcome)
        bad = len(points.rows) - table.counted["missing"] - table.counted["finished"]
        return f"{bad} without result" if bad else ""

    try:
        cost = collect(
            work,
            points.rows,
            lambda: _workers(executor, work, points, shown),
            take,
            after=after,
            order=lambda runs: _order(work, points, runs),
            store=store,
            keys=[] if store is None else _keys(work, points, after, key),
            progress=shown,
            label="sweep",
        )
    except KeyboardInterrupt as error:
        done = len(points.rows) - table.counted["missing"]
        message = f"interrupted after {done} of {len(points.rows)} runs"
        raise SweepInterrupted(message, _dataset(work, points, table)) from error
    return Swept(
        **attrs.asdict(cost),
        dataset=_dataset(work, points, table),
    )


#: Does a sweep, as :func:`sweep`, and returns its cost, too.
run_sweep: Callable[..., Swept] = inspect.unwrap(sweep)


def _keys(work: Work, points: Points, after: Sequence[int], key: str) -> list[str]:
    """Return the key of each run in a store."""
    keys: list[str] = []
    with needing_keys(", or give key= for what the functions of the scene and measure do"):
        # runs that others start from are kept with the states at their ends
        what = token(work.measure, key) + (" chained" if max(after) >= 0 else "")
        places = [place(work.scene, name) for name in points.names]
        contents = Contents(work.scene, {**OPTIONS, **work.options}, places, what, key)
        for run, row in enumerate(points.rows):
            before = keys[after[run]] if after[run] >= 0 else ""
            keys.append(contents.key(row, before))
    return keys


def _dataset(work: Work, points: Points, table: Table) -> Any:
    options = {"last": work.measure.last, **work.options}
    try:
        scene = work.scene.to_toml()
    except TypeError:
        scene = in_text(work.scene)
    return table.dataset(
        {
            "title": f"sweep over {', '.join(points.names)}",
            "scene": scene,
            "options": "; ".join(f"{name} = {in_text(options[name])}" for name in options),
            "design": json.dumps(points.design, sort_keys=True),
            "beltdyn_version": _core.__version__,
        }
    )


def _workers(executor: Any, work: Work, points: Points, progress: bool) -> Pool:
    kinds = _kinds(work.scene, points)
    why = "" if "function" in kinds else _in_python(work, points, kinds)
    pool = as_pool(executor, why)
    if "function" in kinds and pool.remote:
        pool.close(True)
        raise TypeError(
            "the torque is a compiled function, known by an address that means nothing in "
            'other processes: give executor="threads"'
        )
    optional_module("xarray", "beltdyn.sweep", "sweep")  # before any run, after the user's mistakes
    if progress and why and executor is None:
        print(f"sweep: in {pool.text}, because {why}", file=sys.stderr)
    return pool


def _check_names(scene: Scene, points: Points) -> dict[str, tuple[str, str]]:
    """Check what is swept; return units and texts."""
    of_drive = [name for name in points.names if find(scene, name).root == "params"]
    for k, name in enumerate(of_drive):
        for other in of_drive[:k]:
            if overlap(scene.params, name, other):
                raise ValueError(f"over: {other!r} and {name!r} have a number in common")
    return {name: in_words(scene, name) for name in points.names}


def _check_options(options: Mapping[str, Any], scene: Scene, points: Points) -> None:
    """Check what all runs are given, as far as it does not depend on what is swept."""
    for name in options:
        if name not in (*OPTIONS, "t_end"):
            hint = close_to(
                name, [*OPTIONS, "measure", *inspect.getfullargspec(run_sweep).kwonlyargs]
            )
            why = ": what is kept follows from measure" if name == "outputs" else ""
            raise TypeError(f"sweep takes no argument {name!r}{hint}{why}")
        if name in points.names:
            raise ValueError(f"{name} is given and swept over: leave one of them out")
    Options(**{name: options[name] for name in Options.rows() if name in options})
    flag("verify", options.get("verify", False))
    initial, t_eval = options.get("initial"), options.get("t_eval")
    swept = {find(scene, name).root for name in points.names}
    check_initial(None if "params" in swept else scene.params, initial)
    if t_eval is not None:
        known = not {"t_end", "initial"} & {*points.names}
        within = span(initial, scene.t_end) if known else (-_LATEST, _LATEST)
        sample_times("t_eval", t_eval, *within)


def _chains(points: Points, warm: object) -> list[int]:
    """Return the run from whose end each starts; -1: none."""
    if warm is None:
        return [-1] * len(points.rows)
    if not points.axes:
        raise ValueError("warm needs a grid of values: it is for runs along one of the names swept")
    if warm not in points.names:
        raise ValueError(f"warm must be one of {', '.join(points.names)}, got {warm!r}")
    k = points.names.index(str(warm))
    stride = math.prod(points.shape[k + 1 :])
    return [
        run - stride if (run // stride) % points.shape[k] else -1 for run in range(len(points.rows))
    ]


def _order(work: Work, points: Points, runs: Sequence[int]) -> list[int]:
    """Sort runs of the same drive together: they share its settled state."""
    groups: dict[str, list[int]] = {}
    for run in runs:
        groups.setdefault(repr([points.rows[run][k] for k in work.of_drive]), []).append(run)
    return [run for group in groups.values() for run in group]


def _kinds(scene: Scene, points: Points) -> set[str]:
    """Return the kinds of all torques: "call" of Python functions, "function" of compiled ones."""
    torques = [scene.torque_fn]
    if "torque" in points.names:
        torques = [row[points.names.index("torque")] for row in points.rows]
    found: set[str] = set()
    for torque in torques:
        if not isinstance(torque, Torque):
            with suppress(TypeError, ValueError):
                found |= {str(term[0]) for term in as_terms(torque, scene.params.pulley_names)}
    return found


def _in_python(work: Work, points: Points, kinds: set[str]) -> str:
    """Return the reason why runs keep the interpreter busy, "" if they do not."""
    if "call" in kinds:
        return "the torque is a Python function"
    motions = as_motions(work.scene.motion, work.scene.params.pulley_names)
    if "motion" in points.names or not all(map(in_core, motions.values())):
        return "a motion is a Python function"
    return "reports take much Python" if work.measure.in_python else ""
