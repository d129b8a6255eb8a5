"""Exceptions that a compiled torque function cannot raise.

Python code called through ctypes, cffi or Numba cannot pass an exception on: these report it to
``sys.unraisablehook`` and return, and the torque is whatever was in the array before. So during a
run with such a function the hook keeps the exception, and stops the core at this call.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any

_lock = threading.Lock()
#: By thread, the innermost last; other reports go to the hook that was there before.
_watching: dict[int, list[CallbackErrors]] = {}
_before: list[Any] = []


def _hook(report: Any) -> None:
    watching = _watching.get(threading.get_ident())
    # Reports of failed __del__ methods hold the object; callbacks are recognised by the message,
    # those of Numba by a text in place of the object.
    is_callback = "callback" in (report.err_msg or "") or isinstance(report.object, str)
    if watching and is_callback:
        watching[-1].take(report)
    else:
        _before[0](report)


class CallbackErrors:
    """Context that keeps the first exception that a callback of this thread could not raise."""

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self.error: BaseException | None = None

    def take(self, report: Any) -> None:
        """Keep the exception of a report to ``sys.unraisablehook``, if it is the first."""
        if self.error is None:
            error = report.exc_value if report.exc_value is not None else report.exc_type()
            self.error = error.with_traceback(report.exc_traceback)
            self._stop()

    def __enter__(self) -> CallbackErrors:
        with _lock:
            if sys.unraisablehook is not _hook:  # other code may have replaced it
                _before[:] = [sys.unraisablehook]
                sys.unraisablehook = _hook
            _watching.setdefault(threading.get_ident(), []).append(self)
        return self

    def __exit__(self, *_error: object) -> None:
        with _lock:
            mine = _watching[threading.get_ident()]
            mine.remove(self)
            if not mine:
                del _watching[threading.get_ident()]
            if not _watching and sys.unraisablehook is _hook:
                sys.unraisablehook = _before[0]
