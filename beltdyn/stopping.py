"""Stopping runs from another thread: signals reach the main thread alone."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from . import _core

__all__ = ["Stopper", "stoppable"]

#: Of this thread: what may stop its runs.
_STOPPER: ContextVar[Stopper | None] = ContextVar("stopper", default=None)


class Stopper:
    """Stops all runs of the threads that are within :meth:`watch`, at once and from then on.

    They end as by Ctrl-C, with :class:`beltdyn.Interrupted`.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[_core.Simulation] = set()
        self._stopped = False

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Have the runs of this thread stopped."""
        token = _STOPPER.set(self)
        try:
            yield
        finally:
            _STOPPER.reset(token)

    def stop(self) -> None:
        """Stop the runs under way, and any that are begun later."""
        with self._lock:
            self._stopped = True
            for sim in self._running:
                sim.stop()

    def _begin(self, sim: _core.Simulation) -> None:
        with self._lock:
            self._running.add(sim)
            if self._stopped:
                sim.stop()

    def _end(self, sim: _core.Simulation) -> None:
        with self._lock:
            self._running.discard(sim)


@contextmanager
def stoppable(sim: _core.Simulation) -> Iterator[None]:
    """Let the stopper of this thread, if there is one, stop a run."""
    stopper = _STOPPER.get()
    if stopper is None:
        yield
        return
    stopper._begin(sim)
    try:
        yield
    finally:
        stopper._end(sim)
