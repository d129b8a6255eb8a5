"""A run of a sweep: what a worker does, in a thread or a process."""

from __future__ import annotations

import traceback
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs

from .. import _core
from ..base.run_warnings import silenced
from ..drive.params import Params
from ..drive.scene import Scene
from ..many.identity import NoKeyError, token
from ..many.outcome import Outcome, attempt, in_line
from ..many.shared import Settled, Shared
from ..outputs.state import State
from ..result.result import Result
from ..run.settling import settle
from ..run.simulation import simulate
from .measure import Measure
from .names import changed, find


@attrs.define(eq=False)
class Work:
    """The runs of a sweep, by their values; threads may share it, other processes be sent it."""

    scene: Scene  # before anything is changed
    options: dict[str, Any]  # of simulate
    names: tuple[str, ...]  # what is swept
    measure: Measure
    chained: bool  # whether runs may start from the end of others, so that final states are kept
    of_drive: list[int] = attrs.field(init=False)  # which of the names are the drive's
    _drives: Shared[Params] = attrs.field(init=False)
    _states: Settled = attrs.field(init=False, factory=lambda: Settled(settle))

    def __attrs_post_init__(self) -> None:
        roots = [find(self.scene, name).root for name in self.names]
        self.of_drive = [k for k, root in enumerate(roots) if root == "params"]
        self._drives = Shared(self._drive)

    def __call__(self, values: Sequence[Any], before: Any = None) -> Outcome:
        """Do a run; ``before``: arrays of the final state of the one whose end it starts from."""
        return attrs.evolve(self._run(values, before), error=None)  # to be sent

    def _run(self, values: Sequence[Any], before: Any) -> Outcome:
        prepared = attempt(lambda: self._scene(values), (TypeError, ValueError))
        if prepared.status != "finished":
            return prepared
        scene, options = prepared.value
        ran = attempt(lambda: self._simulate(scene, options, before))
        if ran.status != "finished":
            return ran
        result: Result = ran.value
        more: dict[str, Any] = {"warnings": "\n".join(map(str, result.warnings))}
        if self.chained:
            state = result.final_state
            more["final"] = {name: getattr(state, name) for name, *_ in _core.STATE_FIELDS}
        try:
            more["layout"], *more["value"] = self.measure.of(result)
        except Exception as error:
            more |= {"status": "measure", "value": None, "reproducible": False}
            more["message"] = f"{type(error).__name__}: {in_line(error)}{_where(error)}"
        return attrs.evolve(ran, **more)

    def _scene(self, values: Sequence[Any]) -> tuple[Scene, dict[str, Any]]:
        """Return the scene of a run; drives with the same numbers are the same object."""
        changes = dict(zip(self.names, values, strict=True))
        of_drive = {self.names[k]: changes.pop(self.names[k]) for k in self.of_drive}
        params = self._drives.get(_key(of_drive), of_drive)
        scene, options = changed(self.scene._replace(params=params), self.options, changes)
        scene.check()
        return scene, options

    def _drive(self, changes: dict[str, Any]) -> Params:
        return changed(self.scene, {}, changes)[0].params

    def _simulate(self, scene: Scene, options: dict[str, Any], before: Any) -> Result:
        with silenced():
            if before is not None:
                options = {**options, "initial": State(t=0.0, **before)}
            elif options.get("initial") is None and options.get("verify") is not True:
                # Runs that verify one settle on meshes of their own, as the run itself did.
                state = self._states.start(scene, options.get("breakpoints", ()))
                options = {**options, "initial": state}
            return simulate(*scene, outputs=self.measure.outputs, **options)


def _key(values: Mapping[str, Any]) -> Hashable:
    """Return a key that distinguishes drives by the values that are swept."""
    try:
        return token(values)
    except NoKeyError:
        return object()  # nothing is equal to it


def _where(error: BaseException) -> str:
    """Return which line of the user's own code raised an error, if one did."""
    frames = traceback.extract_tb(error.__traceback__)
    if len(frames) < 2 or frames[-1].filename.startswith(str(Path(__file__).parent.parent)):
        return ""
    last = frames[-1]
    return f" (line {last.lineno} of {last.name}, {Path(last.filename).name})"
