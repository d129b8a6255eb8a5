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
from typing import Any, NamedTuple, Protocol

from ..base.checks import Array
from ..base.stopping import without_ctrl_c
from .outcome import Outcome
from .pools import Pool, as_bytes

__all__ = ["ATTEMPTS", "Dispatch", "Job", "Work"]

#: How often workers may die in a run before it is given up; the last time it is on its way alone.
ATTEMPTS = 3
#: Batches handed out for each worker: one that it does, one that waits.
_AHEAD = 2
#: Weight of the last batch in the mean time of a run.
_LAST = 0.3
#: How long to wait at most before looking after the store again [s].
_LOOK = 1.0


class Work(Protocol):
    """What does runs; several threads may share it."""

    @property
    def settled(self) -> int:
        """How many states this thread has settled so far."""

    def run(self, row: Any, before: Array | None = None) -> Outcome:
        """Do a run; ``before`` is the final state, as numbers, that it starts from."""


class Job(Protocol):
    """What many runs have in common; it can be sent to other processes."""

    def work(self) -> Work:
        """Return what does the runs."""


class Batch(NamedTuple):
    """What a worker gives back.

    Attributes:
        outcomes: Outcomes of its runs, in their order; fewer if it was interrupted.
        seconds: Wall time of each of them [s].
        settled: States it settled, which later runs may share.
        interrupted: Whether it was.
    """

    outcomes: list[Outcome]
    seconds: list[float]
    settled: int
    interrupted: bool


class Dispatch:
    """Dispatch of runs to workers.

    Args:
        pool: The workers.
        job: Data common to all runs.
        rows: The values of each run.
        order: The runs to do, in this order.
        after: The run from whose end each starts, -1: none.
        finals: Final states of runs that are done already, as numbers.
        done: Called with each run and its outcome, in the order in which they end.
        idle: Called now and then.
    """

    def __init__(
        self,
        pool: Pool,
        job: Job,
        rows: Sequence[Any],
        order: Sequence[int],
        after: Sequence[int],
        finals: Mapping[int, Array],
        done: Callable[[int, Outcome], None],
        idle: Callable[[], None] = lambda: None,
    ) -> None:
        self._pool, self._rows, self._after = pool, rows, after
        self._done, self._idle = done, idle
        self._work: Work | bytes = as_bytes(job) if pool.remote else job.work()
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
        #: States that were settled.
        self.settled = 0

    def all(self) -> None:
        """Do all runs.

        Raises:
            KeyboardInterrupt: Ctrl-C; what ended before was handed over.
            RuntimeError: The executor takes no more work.
            Exception: What an executor raises that is none of these.
        """
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
                size = min(self._size(), len(self._ready))
                self._submit([self._ready.popleft() for _ in range(size)])

    def _submit(self, batch: list[int], alone: bool = False) -> None:
        runs: Any = [(self._rows[run], self._starts.get(run)) for run in batch]
        if self._pool.remote:
            runs = as_bytes(runs)
        try:
            future = self._pool.submit(run_batch, self._work, runs)
        except Exception as error:
            if not self._pool.deaths(error):
                raise
            self._renew()
            future = self._pool.submit(run_batch, self._work, runs)
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
        self.settled += result.settled
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
        if outcome.final.size:
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


@lru_cache(maxsize=2)
def _work_of(job: bytes) -> Work:
    job_of: Job = pickle.loads(job)
    return job_of.work()


def run_batch(work: Work | bytes, runs: Sequence[tuple[Any, Array | None]] | bytes) -> Batch:
    """Do several runs, one after the other; as bytes if they come from another process."""
    if isinstance(work, bytes):
        work = _work_of(work)
    listed = pickle.loads(runs) if isinstance(runs, bytes) else runs
    outcomes: list[Outcome] = []
    seconds: list[float] = []
    before = work.settled
    for values, start in listed:
        begun = time.perf_counter()
        try:
            outcomes.append(work.run(values, start))
        except KeyboardInterrupt:
            return Batch(outcomes, seconds, work.settled - before, True)
        seconds.append(time.perf_counter() - begun)
    return Batch(outcomes, seconds, work.settled - before, False)
