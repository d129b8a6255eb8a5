"""Jobs in parallel threads: the C core runs without the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType
from typing import TypeVar

from .checks import integer
from .stopping import Stopper

__all__ = ["Workers", "available"]

_Job = TypeVar("_Job")
_Out = TypeVar("_Out")


def available() -> int:
    """Give the number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


class Workers:
    """A fixed number of threads, ended with the ``with`` block; one: the calling thread itself."""

    def __init__(self, workers: int | None) -> None:
        self.count = available() if workers is None else integer("workers", workers, 1)
        self._pool = ThreadPoolExecutor(self.count) if self.count > 1 else None

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown()

    def map(self, work: Callable[[_Job], _Out], jobs: Iterable[_Job]) -> list[_Out]:
        """Give ``work(job)`` for every job, in their order.

        If a job raises or Ctrl-C is pressed, the others are stopped and the exception is raised.
        """
        if self._pool is None:
            return [work(job) for job in jobs]
        stopper = Stopper()

        def run(job: _Job) -> _Out:
            with stopper.watch():
                return work(job)

        futures = [self._pool.submit(run, job) for job in jobs]
        try:
            return [future.result() for future in futures]
        except BaseException:
            for future in futures:
                future.cancel()
            stopper.stop()
            wait(futures)
            raise
