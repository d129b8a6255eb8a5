"""Many runs: those that a store has are found there, the others are done and kept as they end."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any, ClassVar

import attrs
import numpy as np

from ..base.checks import Array
from ..base.progress import counted
from ..base.stopping import without_ctrl_c
from .dispatch import Dispatch, Job
from .outcome import Outcome
from .pools import Pool
from .store import Kept, Store

__all__ = ["Cost", "Each", "collect", "outcomes"]


@attrs.frozen
class Each:
    """Job of runs that share nothing: a function does each, of its row and what it starts from."""

    function: Callable[[Any, Array | None], Outcome]
    settled: ClassVar[int] = 0  # states, none of which is counted

    def work(self) -> Each:
        """Return what does the runs."""
        return self

    def run(self, row: Any, before: Array | None = None) -> Outcome:
        """Do a run."""
        return self.function(row, before)


def _to_kept(outcome: Outcome) -> Kept:
    parts = [outcome.status, outcome.message, outcome.value, outcome.final.tolist()]
    return Kept(json.dumps(parts))


def _of_kept(kept: Kept) -> Outcome:
    status, message, value, final = json.loads(kept.text)
    return Outcome(status=status, message=message, value=value, final=np.array(final))


@attrs.frozen
class Cost:
    """What many runs took.

    Attributes:
        computed: Runs that were computed.
        stored: Runs that were found in the store.
        settled: States that were settled for them.
        workers: What computed them, in words.
    """

    computed: int
    stored: int
    settled: int
    workers: str


def collect(
    job: Job,
    rows: Sequence[Any],
    pool: Callable[[], AbstractContextManager[Pool]],
    take: Callable[[int, Outcome], str],
    *,
    after: Sequence[int] = (),
    order: Callable[[list[int]], list[int]] = lambda runs: runs,
    store: str | os.PathLike[str] | None = None,
    keys: Sequence[str] = (),
    to_kept: Callable[[Outcome], Kept] = _to_kept,
    of_kept: Callable[[Kept], Outcome] = _of_kept,
    progress: bool = False,
    label: str = "runs",
) -> Cost:
    """Do runs, and hand over their outcomes as they end.

    Args:
        job: What they have in common.
        rows: What each of them has of its own.
        pool: Makes the workers, if there is anything to do.
        take: Takes the number of a run and its outcome; returns what to show beside the progress.
        after: The run from whose end each starts, -1: none; empty: of all.
        order: In which order to do those that are to do.
        store: Folder that keeps them; with it ``keys``, a key for each run.
        keys: A run with the same key is the same run.
        to_kept: Returns an outcome as it is kept; without it values are those that JSON holds.
        of_kept: Returns an outcome from what was kept.
        progress: Whether to show progress on stderr.
        label: What is shown before it.

    Raises:
        KeyboardInterrupt: Ctrl-C; what ended before was handed over and is kept.
        OSError, ValueError: The store cannot be read or written.
        RuntimeError: The executor takes no more work.
    """
    kept = None if store is None else Store(store)
    after = after or [-1] * len(rows)
    known: dict[int, Outcome] = {}
    if kept is not None:
        found = kept.find(keys)
        known = {run: of_kept(found[key]) for run, key in enumerate(keys) if key in found}
    text = ""
    for run, outcome in known.items():
        text = take(run, outcome)
    todo = order([run for run in range(len(rows)) if run not in known])
    finals = {
        before: known[before].final
        for before in (after[run] for run in todo)
        if before in known and known[before].final.size
    }
    stored = done = len(known)
    del known
    if progress and stored:
        print(f"{label}: {stored} of {len(rows)} runs found in the store", file=sys.stderr)
    if not todo:
        return Cost(0, stored, 0, "none")
    with pool() as workers, counted(progress, label) as show:
        show(done, len(rows), text)

        def end(run: int, outcome: Outcome) -> None:
            nonlocal done
            done += 1
            text = take(run, outcome)
            if kept is not None and outcome.lasting:
                kept.add(keys[run], to_kept(outcome))
            show(done, len(rows), text)

        idle = (lambda: None) if kept is None else kept.tend
        dispatch = Dispatch(workers, job, rows, todo, after, finals, end, idle)
        words = workers.text
        try:
            dispatch.all()
        finally:
            if kept is not None:
                with without_ctrl_c():
                    kept.flush()
    return Cost(len(todo), stored, dispatch.settled, words)


def outcomes(
    function: Callable[[Any, Array | None], Outcome],
    rows: Sequence[Any],
    pool: Callable[[], AbstractContextManager[Pool]],
    text: Callable[[Any], str] = lambda _row: "",
    **others: Any,
) -> list[Outcome]:
    """Return the outcomes of runs in their order, each of a function of its row.

    Args:
        function: Does a run, as of :class:`Each`.
        rows: What each of them has of its own.
        pool: Makes the workers.
        text: Returns what to show of a run that has ended.
        **others: Further arguments of :func:`collect`.
    """
    found = [Outcome(status="missing")] * len(rows)

    def take(run: int, outcome: Outcome) -> str:
        found[run] = outcome
        return text(rows[run])

    collect(Each(function), rows, pool, take, **others)
    return found
