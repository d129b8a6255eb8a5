"""What several runs share, as drives and the states that these settle into: each is made once."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

from numpy.typing import ArrayLike

from ..drive.scene import Scene, first_speeds
from ..outputs.state import State

_Value = TypeVar("_Value")
#: How many are kept for runs to come.
_KEPT = 16


class Shared(Generic[_Value]):
    """Values by key, each made once, the last ones kept; a thread waits for what another makes.

    What cannot be made is not tried again either. Sent to another process it is empty there.
    """

    def __init__(self, make: Callable[..., _Value]) -> None:
        self._make = make
        self._lock = threading.Lock()
        self._found: OrderedDict[Hashable, tuple[threading.Lock, list[_Value | Exception]]]
        self._found = OrderedDict()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._make,)

    def get(self, key: Hashable, *of: Any, **named: Any) -> _Value:
        """Return the value of a key; if it is not there it is made, of the other arguments."""
        with self._lock:
            one, held = self._found.setdefault(key, (threading.Lock(), []))
            self._found.move_to_end(key)
            while len(self._found) > _KEPT:
                self._found.popitem(last=False)
        with one:
            if not held:
                try:
                    held.append(self._make(*of, **named))
                except Exception as error:
                    held.append(error)
            found = held[0]
        if isinstance(found, Exception):
            raise found.with_traceback(None)
        return found


class Settled(Shared[State]):
    """States that drives settle into, by drive and speeds of its motions; made by ``settle``."""

    def start(self, scene: Scene, breakpoints: ArrayLike = ()) -> State:
        """Return the state from which a scene runs."""
        speeds = first_speeds(scene, breakpoints)
        return self.get((scene.params, tuple((speeds or {}).items())), scene.params, speed=speeds)
