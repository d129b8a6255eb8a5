"""Runs of a scene at given settings: their CPU time and quantities."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from ..base.run_warnings import silenced
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.motions import in_core
from ..loads.torques import Torque
from ..many.shared import Settled
from ..outputs.accuracy_report import Accuracy
from ..outputs.state import State
from ..result.result import Result
from .quantities import Observed, observe, with_links

#: Links on the circumference of the smallest pulley, at least: of a hexagon.
_ROUND = 6
#: Cells of a pulley and the span that follows it, at least.
_CELLS = 7


def whole_scene(value: object, other: str = "one of bd.scenes") -> Scene:
    """Return a scene that can be run, from one or from a tuple of its parts."""
    parts = value if isinstance(value, tuple) else ()
    if not 3 <= len(parts) <= 4 or not isinstance(parts[0], Params):
        kinds = ", ".join(type(one).__name__ for one in parts)
        raise TypeError(
            "scene must be a bd.Scene(params, torque_fn, t_end), with or without motion, or "
            f"{other}, got {f'({kinds})' if kinds else type(value).__name__}"
        )
    scene = Scene(*parts)
    scene.check()
    return scene


def evaluated_in_core(scene: Scene) -> bool:
    """Whether torques and motions are objects, which the core evaluates without Python."""
    motions = scene.motion.values() if isinstance(scene.motion, Mapping) else ()
    return isinstance(scene.torque_fn, Torque) and all(map(in_core, motions))


@attrs.frozen(order=True)
class Setting:
    """Settings of a run."""

    n_bodies: int  # links, of an ALE belt about the cells
    method: str
    rtol: float  # error in time that the method is asked for

    @property
    def options(self) -> dict[str, Any]:
        """Keywords for :func:`beltdyn.simulate`, ``method`` and ``rtol``."""
        return {"method": self.method, "rtol": self.rtol}

    def __str__(self) -> str:
        return f"{self.method} at rtol {self.rtol:.2g} with n_bodies = {self.n_bodies}"


def fewest(params: Params) -> int:
    """Return the least number of links that still lie round every pulley; of cells the least."""
    if params._flows:
        return _CELLS * len(params.pulleys)
    radius = min(pulley.radius for pulley in params.pulleys)
    return max(8, math.ceil(_ROUND * params.info["length"] / (2.0 * math.pi * radius)))


@attrs.frozen(eq=False)
class Reached:
    """How far a run is."""

    start: State  # from which it started
    t: float  # [s]
    steps: int
    method: str  # in use


@attrs.frozen(eq=False, kw_only=True)
class Done:
    """A finished run."""

    cpu: float  # time without settling [s]
    steps: int  # rejected ones included
    seen: Observed  # quantities read off it
    accuracy: Accuracy  # that of its result
    apart_from: float | None = None  # time from which histories diverge [s]
    name: str = ""  # what it is called


class Runs:
    """Runs of one scene; on each mesh the belt is settled once. Safe in several threads."""

    def __init__(
        self,
        scene: Scene,
        simulate: Callable[..., Result],
        settle: Callable[..., State],
        *,
        t_eval: Array | None = None,  # None: 1001 times, as in a run by default
        last: float = 0.2,  # part of the run that means are taken over
        initial: State | None = None,  # which fits one mesh only; None: as it settles
        options: Mapping[str, Any] | None = None,  # further keywords of every run
        clock: Callable[[], float] = time.thread_time,
    ) -> None:
        self.scene = scene
        start = 0.0 if initial is None else initial.t
        self.t_eval = np.linspace(start, scene.t_end, 1001) if t_eval is None else t_eval
        self.settling: dict[int, float] = {}  # CPU time of settling on the meshes so far [s]
        self._simulate, self._settle = simulate, settle
        self._last, self._options = last, options or {}
        self._settled = Settled(self._settle_timed)
        self._initial, self._clock = initial, clock

    def __call__(self, setting: Setting) -> Done:
        """Simulate at a setting, as :meth:`on`."""
        params = with_links(self.scene.params, setting.n_bodies)
        return self.on(params, self.start(setting.n_bodies), **setting.options)

    def on(self, params: Params, initial: State | None, **options: Any) -> Done:
        """Simulate on a mesh from a state; no warnings are issued."""
        with silenced():
            result = self._simulate(
                params,
                self.scene.torque_fn,
                self.scene.t_end,
                motion=self.scene.motion,
                initial=initial,
                t_eval=self.t_eval,
                **{**self._options, **options},
            )
        return Done(
            cpu=result.stats.cpu_time,
            steps=result.stats.steps + result.stats.rejected,
            seen=observe(result, self._last),
            accuracy=result.accuracy,
            apart_from=apart_from(result),
        )

    def start(self, n_bodies: int) -> State:
        """Return the state to start from on a mesh."""
        if self._initial is not None:
            return self._initial
        scene = self.scene._replace(params=with_links(self.scene.params, n_bodies))
        return self._settled.start(scene, self._options.get("breakpoints", ()))

    def _settle_timed(self, params: Params, **options: Any) -> State:
        begun = self._clock()
        state = self._settle(params, **options)
        self.settling[params.n_bodies] = self._clock() - begun
        return state


def apart_from(result: Result) -> float | None:
    """Return the time when histories begin to diverge [s], None if they do not."""
    times = [one.t for one in result.warnings if one.code == "growth" and one.t is not None]
    return min(times, default=None)
