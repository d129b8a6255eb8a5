"""How long the runs may be that explain a drive."""

from __future__ import annotations

import time
from typing import Any

import attrs

from ..motions import MotionLike
from ..naming import ByPulley
from ..params import Params
from ..result import Result
from ..simulation import simulate
from ..state import State
from ..torques import TorqueLike

__all__ = ["Drive", "Timed", "Window", "find_window"]

#: The first piece of the run that is looked at, as a part of the whole.
_FIRST = 1.0 / 64.0


@attrs.frozen(kw_only=True)
class Drive:
    """A drive with its loads, and how it is run.

    Attributes:
        params: The drive.
        torque_fn: The set torques.
        motion: The prescribed motions.
        rtol: Tolerance.
        method: Integration method.
    """

    params: Params
    torque_fn: TorqueLike
    motion: ByPulley[MotionLike] | None
    rtol: float
    method: str

    def run(self, t_end: float, **options: Any) -> Timed:
        """Run it; ``options`` are those of :func:`beltdyn.simulate`."""
        given: dict[str, Any] = {"rtol": self.rtol, "method": self.method, **options}
        begin = time.thread_time()
        result = simulate(self.params, self.torque_fn, t_end, motion=self.motion, **given)
        return Timed(result, time.thread_time() - begin)


@attrs.frozen
class Timed:
    """A run and the CPU time that it took with settling [s]."""

    result: Result
    seconds: float


@attrs.frozen(kw_only=True)
class Window:
    """The part of a run that is looked at.

    Attributes:
        end: Its end [s]; it begins with the run.
        asked: End of the run that was to be explained [s].
        final: A state late in it, or at its end.
    """

    end: float
    asked: float
    final: State = attrs.field(repr=False)


def find_window(drive: Drive, t_end: float, allowance: float) -> Window:
    """Find how far a run comes in some CPU time, settling included.

    In pieces that double its length, each from the end of the one before, until the next one would
    take too long; all of them together take about the allowance.

    Args:
        drive: The drive.
        t_end: The longest window [s].
        allowance: CPU time of a run [s].
    """
    reached, spent, state = 0.0, 0.0, None
    end = _FIRST * t_end
    while True:
        piece = drive.run(end, initial=state, t_eval=[end])
        spent += piece.seconds
        pace = piece.result.stats.cpu_time / (end - reached)
        reached, state = end, piece.result.final_state
        left = allowance - spent
        if end >= t_end or left < pace * min(end, t_end - end):
            longer = reached + max(0.0, left) / pace if pace > 0.0 else t_end
            return Window(end=min(t_end, longer), asked=t_end, final=state)
        end = min(2.0 * end, t_end)
