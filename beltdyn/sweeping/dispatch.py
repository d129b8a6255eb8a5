"""Handing out the runs of a sweep: in batches, to workers that may die, some after others."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from typing import Any

from ..checks import Array
from .pools import Pool
from .rows import Outcome
from .work import Batch, Job, Work, as_bytes, run_batch

__all__ = ["ATTEMPTS", "Dispatch"]

#: How often a run is begun before it is given up because workers die in it.
ATTEMPTS = 3
#: Batches handed out for each worker: one that it does, one that waits.
_AHEAD = 2
#: Weight of the last batch in the mean time of a run.
_LAST = 0.3


class Dispatch:
    """The runs of a sweep on their way through the workers.

    Args:
        pool: The workers.
        job: What the runs have in common.
        rows: The values of each run.
        order: The runs to do, in this order.
        after: The run from whose end each starts, -1: none.
        finals: Final states of runs that are done already, as numbers.
        done: Called with each run and its outcome, in the order in which they end.
    """

    def __init__(
        self,
        pool: Pool,
        job: Job,
        rows: Sequence[Sequence[Any]],
        order: Sequence[int],
        after: Sequence[int],
        finals: Mapping[int, Array],
        done: Callable[[int, Outcome], None],
    ) -> None:
        self._pool, self._rows, self._after, self._done = pool, rows, after, done
        self._work: Work | bytes = as_bytes(job) if pool.remote else Work(job)
        self._finals = dict(finals)
        self._followers: dict[int, list[int]] = {}
        todo = set(order)
        self._ready: deque[int] = deque()
        for run in order:
            if after[run] in todo:
                self._followers.setdefault(after[run], []).append(run)
            else:
                self._ready.append(run)
        self._left = len(order)
        self._tries: dict[int, int] = {}
        self._mean: float | None = None
        #: Runs that were on their way when a worker died: each is done again with no other.
        self._suspects: deque[int] = deque()
        #: Batches on their way, and of which set of workers.
        self._flying: dict[Future[Any], tuple[list[int], int]] = {}
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
                ended, _ = wait(self._flying, return_when=FIRST_COMPLETED)
                self._collect(ended)
        except BaseException:
            self._abandon()
            raise

    def _size(self) -> int:
        """Give the runs of the next batch: of the time wanted, and enough batches at the end."""
        if self._mean is None:
            return 1
        wanted = self._pool.seconds / max(self._mean, 1e-6)
        share = math.ceil(len(self._ready) / (self._pool.count * _AHEAD))
        return max(1, min(int(wanted), share))

    def _hand_out(self) -> None:
        if self._suspects:
            if not self._flying:
                self._submit([self._suspects.popleft()])
            return
        if self._mean is None and self._flying:
            return  # the first run of each worker tells how long they take
        most = self._pool.count * (1 if self._mean is None else _AHEAD)
        while self._ready and len(self._flying) < most and not self._suspects:
            size = min(self._size(), len(self._ready))
            self._submit([self._ready.popleft() for _ in range(size)])

    def _submit(self, batch: list[int]) -> None:
        runs = [(self._rows[run], self._finals.get(self._after[run])) for run in batch]
        try:
            future = self._pool.submit(run_batch, self._work, runs)
        except Exception as error:
            if not self._pool.died(error):
                raise
            self._renew()
            future = self._pool.submit(run_batch, self._work, runs)
        self._flying[future] = batch, self._workers

    def _collect(self, ended: set[Future[Any]]) -> None:
        for future in ended:
            batch, workers = self._flying.pop(future)
            try:
                result: Batch = future.result()
            except Exception as error:
                if not self._pool.died(error):
                    raise
                if workers == self._workers:
                    self._renew()
                self._again(batch)
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
            self._left -= 1
            followers = self._followers.pop(run, [])
            if followers and outcome.final.size:
                self._finals[run] = outcome.final
            self._ready.extend(followers)
            self._done(run, outcome)
        if result.seconds:
            mean = sum(result.seconds) / len(result.seconds)
            old = self._mean
            self._mean = mean if old is None else (1.0 - _LAST) * old + _LAST * mean

    def _again(self, batch: list[int]) -> None:
        """Do the runs of a worker that died once more, or give one up in which several died."""
        for run in batch:
            self._tries[run] = self._tries.get(run, 0) + 1
            if self._tries[run] < ATTEMPTS or len(batch) > 1:
                self._suspects.append(run)
                continue
            message = f"the worker process died in this run, {self._tries[run]} times"
            self._take([run], Batch([Outcome(status="lost", message=message)], [], 0, False))

    def _abandon(self) -> None:
        """End what is on its way; take what has ended."""
        for future in self._flying:
            future.cancel()
        self._pool.stop()
        if not self._pool.remote:
            wait(self._flying)
        for future, (batch, _) in self._flying.items():
            if future.done() and not future.cancelled():
                try:
                    self._take(batch, future.result())
                except (Exception, CancelledError):
                    continue
        self._flying.clear()
