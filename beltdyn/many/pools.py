"""Where runs are done: threads, processes, the user's executors, a Dask cluster.

The C core runs without the GIL, so that threads are enough for all but Python code.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from importlib import import_module
from typing import Any

from ..base.checks import integer
from ..base.optional import optional_module
from ..base.stopping import Stopper

#: Wall time of a batch [s]: what it takes to hand one out is then small against it.
_IN_THREADS, _ELSEWHERE = 0.1, 0.5

#: Time between checks of a process that the one that began the sweep is still there [s].
_PARENT_CHECK_INTERVAL = 0.5


def _available() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def as_bytes(what: Any) -> bytes:
    """Pickle a job for another process."""
    pickler: Any = pickle
    with suppress(ImportError):  # which knows functions of notebooks and scripts
        pickler = import_module("cloudpickle")
    try:
        return pickler.dumps(what, 5)  # type: ignore[no-any-return]
    except Exception as error:
        why = " ".join(str(error).split())
        raise TypeError(
            f'this cannot be sent to other processes ({why}): give executor="threads"'
        ) from None


class Pool(AbstractContextManager["Pool"]):
    """Workers that do batches: those of an executor."""

    remote = True  #: Whether they share no memory with this process, so that jobs are sent to them.
    seconds = _ELSEWHERE  #: Wall time that a batch should take [s].

    def __init__(self, executor: Any, count: int, text: str) -> None:
        self._count, self._text = count, text
        self._executor = executor

    @property
    def count(self) -> int:
        """Number of workers."""
        return self._count

    @property
    def text(self) -> str:
        """What they are, in words."""
        return f"{self.count} {self._text}"

    def __exit__(self, kind: type[BaseException] | None, *_: Any) -> None:
        self.close(kind is not None)

    def submit(self, work: Callable[..., Any], *args: Any) -> Future[Any]:
        """Submit a job to a worker."""
        future = self._executor.submit(work, *args)
        if not isinstance(future, Future):
            raise TypeError(
                f"executor: submit of {type(self._executor).__name__} gives "
                f"{type(future).__name__}, not a concurrent.futures.Future"
            )
        return future

    def deaths(self, error: BaseException) -> int:
        """Return the number of worker processes that died by an error; 0: it is another error."""
        return int(isinstance(error, BrokenExecutor))

    def renew(self) -> None:
        """Replace workers that have died, or raise RuntimeError, which says what to do."""
        raise RuntimeError(
            "a worker of the executor died, and the executor takes no more work: give a new one; "
            "with store= the runs that are done are not repeated"
        )

    def stop(self) -> None:
        """Stop running jobs, as far as this is possible."""

    def close(self, ended: bool) -> None:
        """Release the workers of this pool; ``ended``: by an error."""


class _Threads(Pool):
    remote = False
    seconds = _IN_THREADS

    def __init__(self, executor: Executor | None, count: int) -> None:
        self._own = executor is None
        executor = executor or ThreadPoolExecutor(count, thread_name_prefix="beltdyn")
        super().__init__(executor, count, "thread(s)")
        self._stopper = Stopper()

    def submit(self, work: Callable[..., Any], *args: Any) -> Future[Any]:
        def stoppable() -> Any:
            with self._stopper.watch():
                return work(*args)

        return super().submit(stoppable)

    def stop(self) -> None:
        self._stopper.stop()

    def close(self, ended: bool) -> None:
        if ended:
            self.stop()
        if self._own:
            self._executor.shutdown(cancel_futures=ended)


def _begin(parent: int) -> None:
    """Prepare a process: it leaves Ctrl-C to the one that began the sweep, and ends with that."""
    # A terminal sends Ctrl-C to all; one that was killed tells no other to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_CHECK_INTERVAL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class _Processes(Pool):
    def __init__(self, count: int) -> None:
        self._loky = optional_module("loky", "a sweep in other processes", "sweep")
        super().__init__(self._new(count), count, "process(es)")

    def _new(self, count: int) -> Any:
        # Not those of the standard library: they want scripts to guard what starts them by
        # `if __name__ == "__main__"`, and cannot send functions of notebooks.
        return self._loky.ProcessPoolExecutor(count, initializer=_begin, initargs=(os.getpid(),))

    def renew(self) -> None:
        self.stop()
        self._executor = self._new(self.count)

    def stop(self) -> None:
        self._executor.shutdown(wait=False, kill_workers=True)

    def close(self, ended: bool) -> None:
        self._executor.shutdown(wait=not ended, kill_workers=ended)


class _Dask(Pool):
    #: How often a batch is done again by another worker if one cannot do it.
    _RETRIES = 2
    #: How long the number of workers is taken to stay the same [s].
    _STEADY = 1.0

    def __init__(self, client: Any) -> None:
        if client.asynchronous:
            raise ValueError(
                "executor: this Client belongs to an asynchronous loop (asynchronous=True), a "
                "sweep waits for its runs: give a Client of its own"
            )
        if client.status != "running":
            raise ValueError(f"executor: this Client is {client.status}, not running")
        self._client = client
        self._counted = 0.0
        super().__init__(
            client.get_executor(pure=False, retries=self._RETRIES), 0, "thread(s) of a Dask cluster"
        )

    @property
    def count(self) -> int:
        """How many work at a time; clusters may grow and shrink, and begin with none."""
        now = time.monotonic()
        if now - self._counted > self._STEADY or not self._counted:
            self._counted, self._count = now, int(sum(self._client.nthreads().values()))
        return max(self._count, 1)

    def deaths(self, error: BaseException) -> int:
        """Return the number of workers that have died: the scheduler tries several itself."""
        # by name: Dask need not be installed
        if type(error).__name__ == "KilledWorker":
            return int(getattr(error, "allowed_failures", 0)) + 1
        return 0

    def renew(self) -> None:
        """Do nothing: the cluster replaces its workers."""

    def close(self, ended: bool) -> None:
        with suppress(Exception) if ended else nullcontext():  # the client may be closed
            self._executor.shutdown(wait=not ended)


def as_pool(executor: object, in_python: str = "") -> Pool:
    """Make the pool of an argument ``executor``."""
    if executor is None or executor in ("threads", "processes"):
        count = _available()
        if executor == "processes" or (executor is None and in_python):
            return _Processes(count)
        return _Threads(None, count)
    module = type(executor).__module__.partition(".")[0]  # by name: Dask need not be installed
    if module == "distributed" and hasattr(executor, "get_executor"):
        return _Dask(executor)
    if isinstance(executor, Executor) or hasattr(executor, "submit"):
        count = getattr(executor, "_max_workers", None) or os.cpu_count() or 1
        if isinstance(executor, ThreadPoolExecutor):
            return _Threads(executor, count)
        return Pool(executor, count, f"worker(s) of {type(executor).__name__}")
    if isinstance(executor, str):
        raise ValueError(f'executor must be "threads" or "processes", got {executor!r}')
    try:
        count = integer("executor", executor, 1)
    except TypeError:
        raise TypeError(
            "executor must be None, a number of workers, a concurrent.futures.Executor or a Dask "
            f"Client, got {type(executor).__name__}"
        ) from None
    return _Processes(count) if in_python else _Threads(None, count)
