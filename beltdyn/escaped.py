"""Exceptions that a compiled torque function cannot raise.

Python code called back through ctypes, cffi or Numba has no way to hand an exception on: they
report it to ``sys.unraisablehook`` and return, and the torque is whatever was left in the array. So
while a run with such a function goes on, the hook takes the exception, and stops the core at that
very call.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any

__all__ = ["Escaped"]

_lock = threading.Lock()
#: By thread, the innermost last; the hook of before stands in for all.
_watching: dict[int, list[Escaped]] = {}
_before: list[Any] = []


def _hook(report: Any) -> None:
    watching = _watching.get(threading.get_ident())
    # A __del__ that fails names itself; callbacks are named in the message, Numba by a text.
    is_callback = "callback" in (report.err_msg or "") or isinstance(report.object, str)
    if watching and is_callback:
        watching[-1].take(report)
    else:
        _before[0](report)


class Escaped:
    """Within it, the first exception of this thread that a callback could not raise.

    Attributes:
        error: The exception, or None.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self.error: BaseException | None = None

    def take(self, report: Any) -> None:
        """Keep what ``sys.unraisablehook`` was given, if it is the first."""
        if self.error is None:
            error = report.exc_value if report.exc_value is not None else report.exc_type()
            self.error = error.with_traceback(report.exc_traceback)
            self._stop()

    def __enter__(self) -> Escaped:
        with _lock:
            if sys.unraisablehook is not _hook:  # somebody else may have put it back
                _before[:] = [sys.unraisablehook]
                sys.unraisablehook = _hook
            _watching.setdefault(threading.get_ident(), []).append(self)
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        with _lock:
            mine = _watching[threading.get_ident()]
            mine.remove(self)
            if not mine:
                del _watching[threading.get_ident()]
            if not _watching and sys.unraisablehook is _hook:
                sys.unraisablehook = _before[0]
