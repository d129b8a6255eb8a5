"""Length of the runs that explain a drive."""

from __future__ import annotations

import time
from typing import Any

import attrs

from ..drive.scene import Scene
from ..many.shared import Settled
from ..outputs.state import State
from ..result.result import Result
from ..run.settling import settle
from ..run.simulation import simulate

#: The first piece of the run that is looked at, as a part of the whole.
_FIRST = 1.0 / 64.0


@attrs.frozen
class Timed:
    """A run and the CPU time that it took, with settling where its drive was new [s]."""

    result: Result
    seconds: float


@attrs.frozen(kw_only=True)
class Drive:
    """How runs are made of a scene and of what is left of it; the longest ends with ``scene``."""

    scene: Scene
    rtol: float
    method: str
    _settled: Settled = attrs.field(init=False, factory=lambda: Settled(settle))

    def run(
        self,
        scene: Scene,
        t_end: float,
        tighter: float = 1.0,
        initial: State | None = None,
        **options: Any,
    ) -> Timed:
        """Run a scene, with the tolerance times ``tighter`` and options of ``simulate``."""
        begin = time.thread_time()
        if initial is None:
            initial = self._settled.start(scene._replace(t_end=t_end))
        result = simulate(
            scene.params,
            scene.torque_fn,
            t_end,
            motion=scene.motion,
            initial=initial,
            rtol=tighter * self.rtol,
            method=self.method,
            **options,
        )
        return Timed(result, time.thread_time() - begin)


@attrs.frozen(kw_only=True)
class Window:
    """The part of a run that is looked at.

    Attributes:
        end: Its end [s]; it begins with the run.
        asked: End of the run that was to be explained [s].
        pace: CPU time of a second late in it [1].
        final: A state late in it, or at its end.
    """

    end: float
    asked: float
    pace: float
    final: State = attrs.field(repr=False)

    def reached_in(self, seconds: float) -> float:
        """Return the time that the run reaches in some CPU time, at the pace of the window [s]."""
        return min(self.asked, seconds / self.pace) if self.pace > 0.0 else self.asked


def find_window(drive: Drive, allowance: float) -> Window:
    """Find the time that a run reaches in some CPU time, settling included.

    In pieces that double its length, each from the end of the one before, until the next one would
    take too long; all of them together take about the allowance.
    """
    reached, spent, state = 0.0, 0.0, None
    t_end = drive.scene.t_end
    end = _FIRST * t_end
    while True:
        piece = drive.run(drive.scene, end, initial=state, t_eval=[end])
        spent += piece.seconds
        pace = piece.result.stats.cpu_time / (end - reached)
        reached, state = end, piece.result.final_state
        left = allowance - spent
        if end >= t_end or left < pace * min(end, t_end - end):
            longer = reached + max(0.0, left) / pace if pace > 0.0 else t_end
            return Window(end=min(t_end, longer), asked=t_end, pace=pace, final=state)
        end = min(2.0 * end, t_end)
