"""Many runs: those that a store has are found there, the others are done and kept as they end."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from ..base.progress import counted
from ..base.stopping import without_ctrl_c
from .dispatch import Dispatch, Run
from .outcome import Outcome
from .pools import Pool
from .store import Kept, Store

Pools = Callable[[], AbstractContextManager[Pool]]


#: What is kept of an outcome, besides the layout of its value.
_KEPT = ("status", "message", "warnings", "kernels", "value", "final")


def to_kept(outcome: Outcome) -> Kept:
    """Return an outcome as a store keeps it; its value is one that JSON holds, or has arrays."""
    arrays: list[Array] = []

    def put(array: Array) -> dict[str, Any]:
        arrays.append(np.asarray(array, dtype=float))
        return {"shape": array.shape}

    text = json.dumps([getattr(outcome, name) for name in _KEPT], default=put)
    return Kept(text, b"".join(map(np.ndarray.tobytes, arrays)), json.dumps(outcome.layout))


def of_kept(kept: Kept) -> Outcome:
    """Return the outcome that a store has kept."""
    numbers, at = np.frombuffer(kept.data), 0

    def take(found: dict[str, Any]) -> Any:
        nonlocal at
        if found.keys() != {"shape"}:
            return found
        begin, at = at, at + math.prod(found["shape"])
        return numbers[begin:at].reshape(found["shape"])

    parts = json.loads(kept.text, object_hook=take)
    return Outcome(layout=json.loads(kept.common), **dict(zip(_KEPT, parts, strict=True)))


@attrs.frozen
class Cost:
    """What many runs took."""

    computed: int  # runs
    stored: int  # runs that were found in the store
    workers: str  # what computed them, in words


def collect(
    do: Run,
    rows: Sequence[Any],  # what each run has of its own
    pool: Pools,  # makes the workers, if there is anything to do
    take: Callable[[int, Outcome], str],  # returns what to show beside the progress
    *,
    after: Sequence[int] = (),  # the run from whose end each starts, -1: none; empty: of all
    order: Callable[[list[int]], list[int]] = lambda runs: runs,  # of those that are to do
    store: str | os.PathLike[str] | None = None,
    keys: Sequence[str] = (),  # with a store: a run with the same key is the same run
    progress: bool = False,
    label: str = "runs",
) -> Cost:
    """Do runs, hand over their outcomes as they end, and keep them; Ctrl-C loses none of these."""
    kept = None if store is None else Store(store)
    after = after or [-1] * len(rows)
    found = kept.find(keys) if kept else {}
    known = {run: of_kept(found[key]) for run, key in enumerate(keys) if key in found}
    text = ""
    for run, outcome in known.items():
        text = take(run, outcome)
    todo = order([run for run in range(len(rows)) if run not in known])
    starts = {after[run] for run in todo} & known.keys()
    finals = {run: known[run].final for run in starts if known[run].final is not None}
    stored = done = len(known)
    del known, found
    if progress and stored:
        print(f"{label}: {stored} of {len(rows)} runs found in the store", file=sys.stderr)
    if not todo:
        return Cost(0, stored, "none")
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
        dispatch = Dispatch(workers, do, rows, todo, after, finals, end, idle)
        words = workers.text
        try:
            dispatch.all()
        finally:
            if kept is not None:
                with without_ctrl_c():
                    kept.flush()
    return Cost(len(todo), stored, words)


def outcomes(
    do: Run,
    rows: Sequence[Any],
    pool: Pools,
    text: Callable[[Any], str] = lambda _row: "",
    **others: Any,
) -> list[Outcome]:
    """Return the outcomes of :func:`collect` in the order of the rows, of which texts are shown."""
    found = [Outcome(status="missing")] * len(rows)

    def take(run: int, outcome: Outcome) -> str:
        found[run] = outcome
        return text(rows[run])

    collect(do, rows, pool, take, **others)
    return found
