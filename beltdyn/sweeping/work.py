"""The runs of a sweep, one or a batch of them: what a worker does, in a thread or a process."""

from __future__ import annotations

import pickle
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array
from ..base.run_warnings import RunWarning, silenced
from ..drive.params import Params
from ..drive.scene import Scene
from ..outputs.state import State
from ..result.errors import SimulationError
from ..result.result import Result
from ..run.simulation import settle, simulate, speeds_at_start
from .identity import NoKeyError, token
from .measure import Measure
from .names import changed, find
from .outcomes import Outcome

__all__ = ["Batch", "Job", "Work", "run_batch"]

_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")
#: Drives, and states that they settle into, that a worker keeps for runs to come.
_KEPT = 16


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


class Batch(NamedTuple):
    """What a worker gives back.

    Attributes:
        outcomes: Outcomes of its runs, in their order; fewer if it was interrupted.
        seconds: Wall time of each of them [s].
        settled: States it settled, which later runs may share.
        interrupted: Whether it was.
    """

    outcomes: list[Outcome]
    seconds: list[float]
    settled: int
    interrupted: bool


class _Shared(Generic[_Key, _Value]):
    """Values by key, each made once, the last ones kept; a thread waits for what another makes.

    What cannot be made is not tried again either.
    """

    def __init__(self, make: Callable[[_Key, Any], _Value]) -> None:
        self._make = make
        self._lock = threading.Lock()
        self._found: OrderedDict[_Key, tuple[threading.Lock, list[_Value | Exception]]]
        self._found = OrderedDict()
        self._mine = threading.local()

    @property
    def made(self) -> int:
        """How many this thread has made or tried to."""
        return getattr(self._mine, "made", 0)

    def get(self, key: _Key, of: Any) -> _Value:
        with self._lock:
            one, held = self._found.setdefault(key, (threading.Lock(), []))
            self._found.move_to_end(key)
            while len(self._found) > _KEPT:
                self._found.popitem(last=False)
        with one:
            if not held:
                self._mine.made = self.made + 1
                try:
                    held.append(self._make(key, of))
                except Exception as error:
                    held.append(error)
            found = held[0]
        if isinstance(found, Exception):
            raise found.with_traceback(None)
        return found


class Work:
    """Does runs of a job; several threads may share it."""

    def __init__(self, job: Job) -> None:
        self.job = job
        roots = [find(job.scene, name).root for name in job.names]
        self._of_drive = [k for k, root in enumerate(roots) if root == "params"]
        self._drives: _Shared[tuple[Any, ...], Params] = _Shared(self._drive)
        self._states: _Shared[tuple[Any, ...], State] = _Shared(self._settled)

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
        kernels = _core.kernel_level()
        try:
            drive, scene, options = self._scene(values)
        except (TypeError, ValueError) as error:
            return Outcome(
                status="refused", message=_line(error), kernels=kernels, reproducible=False
            )
        try:
            result = self._simulate(values, drive, scene, options, before)
        except (SimulationError, ValueError, TypeError) as error:
            return _failed(error, scene, kernels)
        except Exception as error:  # whatever a torque function raises
            return _failed(error, scene, kernels, f"{type(error).__name__}: ")
        lines = "\n".join(map(str, result.warnings))
        final = _numbers_of(result.final_state) if self.job.chained else np.zeros(0)
        try:
            layout, row, words = self.job.measure.of(result)
        except Exception as error:
            return Outcome(
                status="measure",
                message=f"{type(error).__name__}: {_line(error)}{_where(error)}",
                reproducible=False,
                warnings=lines,
                kernels=kernels,
                final=final,
            )
        return Outcome(
            status="finished",
            warnings=lines,
            layout=layout,
            numbers=row,
            words=words,
            kernels=kernels,
            final=final,
        )

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
                speeds = speeds_at_start(
                    scene.params, scene.motion, scene.t_end, options.get("breakpoints", ())
                )
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


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())


def _failed(error: Exception, scene: Scene, kernels: str, prefix: str = "") -> Outcome:
    known: tuple[RunWarning, ...] = getattr(getattr(error, "result", None), "warnings", ())
    status = "failed" if prefix or isinstance(error, SimulationError) else "refused"
    return Outcome(
        status=status,
        message=prefix + _line(error),
        reproducible=isinstance(error, SimulationError),
        warnings="\n".join(map(str, known)),
        kernels=kernels,
    )


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


# --- Batches --------------------------------------------------------------------------------------


@lru_cache(maxsize=2)
def _work_of(job: bytes) -> Work:
    return Work(pickle.loads(job))


def run_batch(
    work: Work | bytes, runs: Sequence[tuple[Sequence[Any], Array | None]] | bytes
) -> Batch:
    """Do several runs, one after the other; as bytes if they come from another process."""
    if isinstance(work, bytes):
        work = _work_of(work)
    listed = pickle.loads(runs) if isinstance(runs, bytes) else runs
    outcomes: list[Outcome] = []
    seconds: list[float] = []
    before = work.settled
    for values, start in listed:
        begun = time.perf_counter()
        try:
            outcomes.append(work.run(values, start))
        except KeyboardInterrupt:
            return Batch(outcomes, seconds, work.settled - before, True)
        seconds.append(time.perf_counter() - begun)
    return Batch(outcomes, seconds, work.settled - before, False)
