"""Stopping runs from another thread, since signals reach only the main one; deferring Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from .. import _core

#: The stopper of the runs of this thread.
_STOPPER: ContextVar[Stopper | None] = ContextVar("stopper", default=None)


class Stopper:
    """Stops all runs of the threads within :meth:`watch`, by :class:`beltdyn.Interrupted`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[_core.Simulation] = set()
        self._stopped = False

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Let this stopper stop the runs of this thread."""
        token = _STOPPER.set(self)
        try:
            yield
        finally:
            _STOPPER.reset(token)

    def stop(self) -> None:
        """Stop the runs in progress, and any that are started later."""
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


#: Signals that may end a run.
_ENDING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Defer Ctrl-C, so that finished runs are taken once and as a whole."""
    handlers = {one: signal.getsignal(one) for one in _ENDING}
    if threading.current_thread() is not threading.main_thread():
        handlers = {}
    noted: list[tuple[Any, Any]] = []
    for one, handler in handlers.items():
        if callable(handler):
            signal.signal(one, lambda *given: noted.append(given))
    try:
        yield
    finally:
        for one, handler in handlers.items():
            if callable(handler):
                signal.signal(one, handler)
        if noted and callable(handler := handlers[noted[0][0]]):
            handler(*noted[0])
