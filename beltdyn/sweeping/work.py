"""A run of a sweep: what a worker does, in a thread or a process."""

from __future__ import annotations

import traceback
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array
from ..base.run_warnings import silenced
from ..drive.params import Params
from ..drive.scene import Scene, first_speeds
from ..many.identity import NoKeyError, token
from ..many.outcome import Outcome, attempt, in_line
from ..many.shared import Shared
from ..outputs.state import State
from ..result.result import Result
from ..run.simulation import settle, simulate
from .measure import Measure
from .names import changed, find

__all__ = ["Job", "Work"]


@attrs.frozen(eq=False, kw_only=True)
class Job:
    """What all runs of a sweep have in common.

    Attributes:
        scene: The scene before anything is changed.
        options: Arguments of simulate.
        names: Swept names.
        measure: Measured quantities.
        chained: Whether runs may start from the end of others, so that final states are kept.
    """

    scene: Scene
    options: dict[str, Any]
    names: tuple[str, ...]
    measure: Measure
    chained: bool = False

    def work(self) -> Work:
        """Return what does the runs."""
        return Work(self)


class Work:
    """Does runs of a job; several threads may share it."""

    def __init__(self, job: Job) -> None:
        self.job = job
        roots = [find(job.scene, name).root for name in job.names]
        self._of_drive = [k for k, root in enumerate(roots) if root == "params"]
        self._drives: Shared[tuple[Any, ...], Params] = Shared(self._drive)
        self._states: Shared[tuple[Any, ...], State] = Shared(self._settled)

    @property
    def settled(self) -> int:
        """How many states this thread has settled so far."""
        return self._states.made

    def run(self, values: Sequence[Any], before: Array | None = None) -> Outcome:
        """Do a run.

        Args:
            values: Values of the swept names.
            before: Final state, as numbers, of the run whose end this one starts from.

        Raises:
            KeyboardInterrupt: It was interrupted.
        """
        prepared = attempt(lambda: self._scene(values), (TypeError, ValueError))
        if prepared.status != "finished":
            return attrs.evolve(prepared, error=None)  # which processes need not send
        drive, scene, options = prepared.value
        ran = attempt(lambda: self._simulate(values, drive, scene, options, before))
        if ran.status != "finished":
            return attrs.evolve(ran, error=None)
        result: Result = ran.value
        lines = "\n".join(map(str, result.warnings))
        final = _numbers_of(result.final_state) if self.job.chained else np.zeros(0)
        try:
            value = self.job.measure.of(result)
        except Exception as error:
            return Outcome(
                status="measure",
                message=f"{type(error).__name__}: {in_line(error)}{_where(error)}",
                reproducible=False,
                warnings=lines,
                kernels=ran.kernels,
                final=final,
            )
        return attrs.evolve(ran, warnings=lines, value=value, final=final)

    def _scene(self, values: Sequence[Any]) -> tuple[tuple[Any, ...], Scene, dict[str, Any]]:
        """Return the scene of a run; drives with the same numbers are the same object."""
        job = self.job
        drive = tuple(_hashable(values[k]) for k in self._of_drive)
        changes = dict(zip(job.names, values, strict=True))
        of_drive = {job.names[k]: changes.pop(job.names[k]) for k in self._of_drive}
        params = self._drives.get(drive, of_drive)
        scene, options = changed(job.scene._replace(params=params), job.options, changes)
        scene.check()
        return drive, scene, options

    def _drive(self, _key: tuple[Any, ...], changes: dict[str, Any]) -> Params:
        return changed(self.job.scene, {}, changes)[0].params

    def _settled(self, _key: tuple[Any, ...], of: tuple[Params, dict[int, float] | None]) -> State:
        return settle(of[0], speed=of[1])

    def _simulate(
        self,
        values: Sequence[Any],
        drive: tuple[Any, ...],
        scene: Scene,
        options: dict[str, Any],
        before: Array | None,
    ) -> Result:
        with silenced():
            if before is not None:
                options = {**options, "initial": _state_of(before)}
            elif options.get("initial") is None and options.get("verify") is not True:
                # Runs that verify one settle on meshes of their own, as the run itself did.
                speeds = first_speeds(scene, options.get("breakpoints", ()))
                key = (*drive, tuple((speeds or {}).items()))
                state = self._states.get(key, (scene.params, speeds))
                options = {**options, "initial": state}
            return simulate(
                scene.params,
                scene.torque_fn,
                scene.t_end,
                scene.motion,
                outputs=self.job.measure.outputs,
                **options,
            )


def _hashable(value: Any) -> Hashable:
    """Return a hashable key for a value; it differs where values differ."""
    try:
        hash(value)
    except TypeError:
        try:
            return token(value)
        except NoKeyError:
            return object()  # nothing is equal to it
    return (type(value), value)


def _where(error: BaseException) -> str:
    """Return which line of the user's own code raised an error, if one did."""
    frames = traceback.extract_tb(error.__traceback__)
    if len(frames) < 2 or frames[-1].filename.startswith(str(Path(__file__).parent.parent)):
        return ""
    last = frames[-1]
    return f" (line {last.lineno} of {last.name}, {Path(last.filename).name})"


# --- Final states, from which other runs start ---------------------------------------------------


def _numbers_of(state: State) -> Array:
    """Put a state into one row: of each field its rows and columns, then its numbers."""
    parts: list[Array] = []
    for name, *_ in _core.STATE_FIELDS:
        values = np.atleast_2d(getattr(state, name))
        parts += [np.array(values.shape, dtype=float), np.ravel(values)]
    return np.concatenate(parts)


def _state_of(row: Array) -> State:
    """Put a state together again, at the time 0."""
    found: dict[str, Any] = {}
    at = 0
    for name, *_ in _core.STATE_FIELDS:
        rows, columns = (int(one) for one in row[at : at + 2])
        values = row[at + 2 : at + 2 + rows * columns]
        found[name] = values.reshape(rows, columns) if rows > 1 else values
        at += 2 + rows * columns
    return State(t=0.0, **found)
