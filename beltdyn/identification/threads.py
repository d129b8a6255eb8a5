"""Jobs in parallel threads: the C core runs without the GIL."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType
from typing import TypeVar

from ..checks import integer

__all__ = ["Workers"]

_Job = TypeVar("_Job")
_Out = TypeVar("_Out")


def _available() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


class Workers:
    """A fixed number of threads, ended with the ``with`` block; one: the calling thread itself."""

    def __init__(self, workers: int | None) -> None:
        self.count = _available() if workers is None else integer("workers", workers, 1)
        self._pool = ThreadPoolExecutor(self.count) if self.count > 1 else None
        self._busy: set[int] = set()
        self._lock = threading.Lock()

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
        futures = [self._pool.submit(self._run, work, job) for job in jobs]
        try:
            return [future.result() for future in futures]
        except BaseException:
            for future in futures:
                future.cancel()
            self._stop()
            wait(futures)
            raise

    def _run(self, work: Callable[[_Job], _Out], job: _Job) -> _Out:
        me = threading.get_ident()
        with self._lock:
            self._busy.add(me)
        try:
            return work(job)
        finally:
            with self._lock:
                self._busy.discard(me)

    def _stop(self) -> None:
        """Raise KeyboardInterrupt in the busy threads; a run stops within a tenth of a second.

        Python delivers signals to the main thread alone, so runs in other threads get none.
        """
        with self._lock:
            for ident in self._busy:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(
                    ctypes.c_ulong(ident), ctypes.py_object(KeyboardInterrupt)
                )
