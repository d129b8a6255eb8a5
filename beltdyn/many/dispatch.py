"""Dispatch of many runs, in batches, to workers that may die; what such a worker does."""

from __future__ import annotations

import math
import pickle
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

from ..base.stopping import without_ctrl_c
from .outcome import Outcome
from .pools import Pool, as_bytes

#: How often workers may die in a run before it is given up; the last time it is on its way alone.
ATTEMPTS = 3
#: Batches handed out for each worker: one that it does, one that waits.
_AHEAD = 2
#: Weight of the last batch in the mean time of a run.
_LAST = 0.3
#: How long to wait at most before looking after the store again [s].
_LOOK = 1.0


#: Does a run, of its row and what the outcome that it starts from has as ``final``. Several threads
#: may share it, and it can be sent to other processes.
Run = Callable[[Any, Any], Outcome]


class Batch(NamedTuple):
    """What a worker gives back."""

    outcomes: list[Outcome]  # of its runs in their order, fewer if it was interrupted
    seconds: list[float]  # wall time of each [s]
    interrupted: bool


class Dispatch:
    """Dispatch of runs to workers."""

    def __init__(
        self,
        pool: Pool,
        do: Run,
        rows: Sequence[Any],
        order: Sequence[int],  # the runs to do
        after: Sequence[int],  # the run from whose end each starts, -1: none
        finals: Mapping[int, Any],  # of runs that are done already
        done: Callable[[int, Outcome], None],  # called as runs end
        idle: Callable[[], None] = lambda: None,  # called now and then
    ) -> None:
        self._pool, self._rows, self._after = pool, rows, after
        self._done, self._idle = done, idle
        self._do = as_bytes(do) if pool.remote else do
        self._followers: dict[int, list[int]] = {}
        todo = set(order)
        self._ready: deque[int] = deque()
        for run in order:
            if after[run] in todo:
                self._followers.setdefault(after[run], []).append(run)
            else:
                self._ready.append(run)
        #: Where runs still to do start from.
        self._starts = {run: finals[after[run]] for run in order if after[run] in finals}
        self._left = len(order)
        self._mean: float | None = None
        #: How often workers have died in a run, once they have.
        self._deaths: dict[int, int] = {}
        #: Runs that were on their way when a worker died: each is done again in a batch of its own,
        #: and at last, to tell which of several it was, with no other on its way.
        self._suspects: deque[int] = deque()
        self._alone: deque[int] = deque()
        #: Batches on their way, of which set of workers, and whether with no other.
        self._flying: dict[Future[Any], tuple[list[int], int, bool]] = {}
        self._workers = 0

    def all(self) -> None:
        """Do all runs; at Ctrl-C, and what an executor raises, what ended is handed over."""
        try:
            while self._left:
                self._hand_out()
                ended, _ = wait(self._flying, _LOOK, FIRST_COMPLETED)
                with without_ctrl_c():
                    self._collect(ended)
                    del ended  # a cluster keeps what futures hold
                    self._idle()
        except BaseException:
            self._abandon()
            raise

    def _size(self) -> int:
        """Return the number of runs of the next batch, for the time wanted; smaller at the end."""
        if self._mean is None:
            return 1
        wanted = self._pool.seconds / max(self._mean, 1e-6)
        share = math.ceil(len(self._ready) / (self._pool.count * _AHEAD))
        return max(1, min(int(wanted), share))

    def _hand_out(self) -> None:
        if self._alone and not self._suspects:
            if not self._flying:
                self._submit([self._alone.popleft()], alone=True)
            return
        # Before the first run has told how long they take, one for each worker.
        most = self._pool.count * (1 if self._mean is None else _AHEAD)
        while len(self._flying) < most and (self._suspects or self._ready):
            if self._suspects:
                self._submit([self._suspects.popleft()])
            else:
                self._submit([self._ready.popleft() for _ in range(self._size())])

    def _submit(self, batch: list[int], alone: bool = False) -> None:
        runs: Any = [(self._rows[run], self._starts.get(run)) for run in batch]
        if self._pool.remote:
            runs = as_bytes(runs)
        try:
            future = self._pool.submit(run_batch, self._do, runs)
        except Exception as error:
            if not self._pool.deaths(error):
                raise
            self._renew()
            future = self._pool.submit(run_batch, self._do, runs)
        self._flying[future] = batch, self._workers, alone

    def _collect(self, ended: set[Future[Any]]) -> None:
        while ended:
            future = ended.pop()
            batch, workers, alone = self._flying.pop(future)
            try:
                result: Batch = future.result()
            except CancelledError:
                raise RuntimeError(
                    f"{self._pool.text} gave up the work: the executor or the cluster was closed; "
                    "with store= the runs that are done are not repeated"
                ) from None
            except Exception as error:
                deaths = self._pool.deaths(error)
                if not deaths:
                    raise
                if workers == self._workers:
                    self._renew()
                self._again(batch, deaths, alone)
                continue
            self._take(batch, result)
            if result.interrupted:
                raise KeyboardInterrupt

    def _renew(self) -> None:
        """Replace dead workers; batches of the dead come back with errors of their own."""
        self._pool.renew()
        self._workers += 1

    def _take(self, batch: list[int], result: Batch) -> None:
        for run, outcome in zip(batch, result.outcomes, strict=False):
            self._end(run, outcome)
        if result.seconds:
            mean = sum(result.seconds) / len(result.seconds)
            old = self._mean
            self._mean = mean if old is None else (1.0 - _LAST) * old + _LAST * mean

    def _end(self, run: int, outcome: Outcome) -> None:
        """Hand over the outcome of a run; runs that start from its end can follow."""
        self._left -= 1
        self._starts.pop(run, None)
        self._done(run, outcome)
        followers = self._followers.pop(run, [])
        if outcome.status == "lost":
            for follower in followers:
                message = "the run from whose end it starts was lost"
                self._end(follower, Outcome(status="lost", message=message))
            return
        if outcome.final is not None:
            self._starts |= dict.fromkeys(followers, outcome.final)
        # Next, so that few states are kept at a time.
        self._ready.extendleft(reversed(followers))

    def _again(self, batch: list[int], deaths: int, alone: bool) -> None:
        """Do the runs of a worker that died once more, or give one up in which several died."""
        for run in batch:
            count = self._deaths[run] = self._deaths.get(run, 0) + deaths
            if alone and count >= ATTEMPTS:
                message = f"the worker process died in this run, {count} times"
                self._end(run, Outcome(status="lost", message=message))
            elif count >= ATTEMPTS - 1:
                self._alone.append(run)
            else:
                self._suspects.append(run)

    def _abandon(self) -> None:
        """Stop running batches; take those that have ended."""
        cancelled = {future for future in self._flying if future.cancel()}
        self._pool.stop()
        if not self._pool.remote:
            wait(set(self._flying) - cancelled)
        with without_ctrl_c():
            for future, (batch, *_) in self._flying.items():
                if future not in cancelled and future.done():
                    with suppress(Exception):
                        self._take(batch, future.result())
            self._flying.clear()


_loaded: Callable[[bytes], Run] = lru_cache(maxsize=2)(pickle.loads)


def run_batch(do: Run | bytes, runs: Sequence[tuple[Any, Any]] | bytes) -> Batch:
    """Do several runs, one after the other; as bytes if they come from another process."""
    run = _loaded(do) if isinstance(do, bytes) else do
    outcomes: list[Outcome] = []
    seconds: list[float] = []
    for row, start in pickle.loads(runs) if isinstance(runs, bytes) else runs:
        begun = time.perf_counter()
        try:
            outcomes.append(run(row, start))
        except KeyboardInterrupt:
            return Batch(outcomes, seconds, True)
        seconds.append(time.perf_counter() - begun)
    return Batch(outcomes, seconds, False)
