"""One run of a drive: created, advanced to its end, collected as a result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import attrs

from .. import _core
from ..base.progress import over_time
from ..base.run_warnings import RunWarning, is_error, issue
from ..base.stopping import stoppable
from ..drive import sanity
from ..drive.params import Params
from ..drive.scene import first_speeds
from ..loads.callback_errors import CallbackErrors
from ..loads.motions import as_motions, motion_terms
from ..loads.torques import as_terms
from ..outputs.histories import Stats
from ..outputs.quantity import LEDGER
from ..outputs.selection import of_belt, of_core, unchecked
from ..outputs.state import State
from ..result.errors import Interrupted, SimulationError, annotate
from ..result.result import Result
from ..verification.runs import Reached
from . import memory, observed
from .checkpoints import Recorder, Spent
from .settling import CHUNK, settle
from .start_of_run import Start

#: The same for a run that a verifying run follows [s].
_CHUNK_FOLLOWED = 0.01


def once(
    start: Start, watch: Callable[[Reached], None] | None = None, **others: Any
) -> tuple[Result, State]:
    """Run once; return also the state it started from. ``others`` are those of :class:`Run`.

    ``watch`` is called now and then with how far it is; a SimulationError of its ends the run.
    """
    run = Run(start, **others)
    finished = run.advance(watch)
    try:
        issue(finished.warnings[len(run.of_drive) :])
    except Warning as error:  # a warning filter has turned it into an error
        _keep_result(error, finished)
        raise
    return finished, run.initial


class Run:
    """A run, ready to be advanced: its drive is settled, its samples have their memory.

    A recorder writes it as it goes; with that of a run that was stopped, it goes on.
    """

    def __init__(
        self, start: Start, *, progress: bool = False, recorder: Recorder | None = None
    ) -> None:
        scene, params, times = start.scene, start.scene.params, start.t_eval
        outputs, options = of_belt(start.outputs, params), start.options
        if outputs is not None and LEDGER not in outputs:
            options = attrs.evolve(options, ledger=False)
        ledger = options.ledger
        self._progress, self._recorder = progress, recorder or Recorder()
        terms = as_terms(scene.torque_fn, params.pulley_names)
        self._motions = as_motions(scene.motion, params.pulley_names)
        names = of_core(outputs, ledger)
        needed = memory.check_samples(times.size, params._model.sizes, names, ledger)

        # Before settling, which may take long, and may fail for the very reason they name.
        of_motions = sanity.of_motions(params, self._motions, scene.t_end)
        self.of_drive = (*(one for one in params._noticed if one.code != "mesh"), *of_motions)
        for one in params._noticed:  # of its mesh a run knows more, and warns at its end
            if one.code == "mesh" and start.expected is None and is_error(one):
                issue([one])
        issue(self.of_drive)
        start = attrs.evolve(start, outputs=outputs, options=options, settle_time=0.0)
        if start.initial is None:
            begun = time.perf_counter()
            with _nothing_computed(params):
                speed = first_speeds(scene, options.breakpoints)
            initial = settle(params, speed=speed, progress=progress)
            settle_time = time.perf_counter() - begun
            start = attrs.evolve(start, initial=initial, settle_time=settle_time)
        assert start.initial is not None
        self._start, self.initial = start, start.initial

        with _nothing_computed(params):
            self._sim = _core.Simulation(
                params._model,
                self.initial._to_core(params),
                terms,
                scene.t_end,
                motion=motion_terms(self._motions),
                **options.of_core(),
            )
        try:
            self._arrays = self._sim.sample(times, names)
            with _nothing_computed(params):
                before = self._recorder.begin(self._sim, self._arrays, start)
            cpu, wall = time.thread_time(), time.perf_counter()
        except MemoryError:
            raise memory.no_room(times.size, needed, "which could not be had") from None
        except KeyboardInterrupt as error:  # arrays of a million rows take time to make
            raise Interrupted("interrupted before the first step, nothing was computed") from error

        def spent() -> Spent:  # no method: the recorder keeps it, and must not keep the run
            return before._replace(
                cpu=before.cpu + time.thread_time() - cpu,
                wall=before.wall + time.perf_counter() - wall,
            )

        self._spent = spent

    def advance(self, watch: Callable[[Reached], None] | None = None) -> Result:
        """Go on to the end, and return the result.

        Raises:
            SimulationError, Interrupted, Exception: As :func:`beltdyn.simulate`, with the result
                up to there.
        """
        sim, recorder = self._sim, self._recorder
        begin, end = self.initial.t, self._start.scene.t_end
        finishing = False
        callback_errors = CallbackErrors(sim.stop)
        recorder.count(self._spent)
        chunk = min(CHUNK if watch is None else _CHUNK_FOLLOWED, recorder.every)
        try:
            with (
                callback_errors,
                stoppable(sim),
                over_time(self._progress, "simulating", begin, end) as show,
            ):
                while not sim.advance(chunk):
                    show(sim.time)
                    if watch is not None:
                        watch(Reached(self.initial, sim.time, int(sim.stats["steps"]), sim.method))
                    if callback_errors.error is None:
                        recorder.look(sim)
            recorder.end(sim, finished=True)
            finishing = True
            return self.collect("finished", self._at_end())
        except SimulationError as error:
            recorder.end(sim)
            error.result = self.collect("failed", str(error))
            annotate(error, self._start.scene.params, error.result.warnings)
            raise
        except (KeyboardInterrupt, Exception) as error:
            raised = callback_errors.error or error
            if not finishing:
                recorder.end(sim, sound=callback_errors.error is None)
            if isinstance(raised, KeyboardInterrupt):
                why = f"interrupted at t = {sim.time:.6g} s"
                ended = Interrupted(why, self.collect("interrupted", why))
                for note in recorder.hint:
                    ended.add_note(note)
                raise ended from raised
            if finishing:
                raise
            whose = "a torque or motion function" if self._motions else "the torque function"
            # raised by it, or by the core for what it returned
            cause = f"{type(raised).__name__} of {whose}"
            why = f"{cause} ended the run, which had reached t = {sim.time:.6g} s"
            _keep_result(raised, self.collect("failed", why))
            for note in (why, *recorder.hint):
                raised.add_note(note)
            if raised is error:
                raise
            raise raised from None

    def collect(self, status: str, message: str) -> Result:
        """Return the result of what was computed so far."""
        sim, start = self._sim, self._start
        params, outputs = start.scene.params, start.outputs
        counters, spent = sim.stats, self._spent()
        stats = Stats._from_core(
            counters,
            method="auto" if counters["changes"] else sim.method,
            choice=sim.choice,
            kernels=_core.kernel_level(),
            cpu_time=spent.cpu,
            wall_time=spent.wall,
            settle_time=spent.settle,
        )
        seen = Result._from_core(
            start.t_eval,
            self._arrays,
            sim.samples,
            stats=stats,
            effects=tuple(sim.passes),
            success=status == "finished",
            status=status,
            message=message,
            params=params,
            prescribed=tuple(params.pulley_names[k] for k in self._motions),
            outputs=outputs,
            unchecked=unchecked(outputs, params),
            final_state=State._from_core(sim.state()),
        )
        if start.expected is not None:
            seen = attrs.evolve(seen, accuracy=seen.accuracy.foreseen(start.expected))
        of_core = [RunWarning(**one) for one in sim.warnings]
        of_samples = observed.observe(seen, self._motions)
        slack = any(one.code == "slack_span" for one in of_samples)
        accuracy, notes = seen.accuracy, list(seen.accuracy.notes)
        if slack:
            stats = attrs.evolve(stats, error=None)
            unknown = tuple(attrs.evolve(one, time=None) for one in accuracy.errors)
            accuracy = attrs.evolve(accuracy, errors=unknown)
        if stats.error is not None:  # links that chatter then have no consequence
            notes += [_excused(one, stats.error) for one in of_core if one.code == "chatter"]
            of_core = [one for one in of_core if one.code != "chatter"]
        if start.options.step is None and status != "failed" and not slack:
            notes += observed.hint(seen, start.options.rtol)
        return attrs.evolve(
            seen,
            stats=stats,
            accuracy=attrs.evolve(accuracy, notes=tuple(notes)),
            warnings=(*self.of_drive, *of_core, *of_samples, *self._recorder.warnings),
        )

    def _at_end(self) -> str:
        """Return the message of a run that has finished."""
        sim, start = self._sim, self._start
        message = f"reached t_end = {start.scene.t_end:g} s"
        if start.options.method == "auto":
            return f"{message}; {sim.choice}"
        again = sim.stats["rejected"]
        if start.options.step is None or sim.stats["local_error"] < 1.0 or not again:
            return message
        return (
            f"{message}; {again} steps of the length asked for had errors of many times a joint's "
            "stretch and were repeated with shorter ones: take a shorter step"
        )


def _excused(one: RunWarning, error: float | None) -> str:
    """Make a note of links that chatter, where differences were watched and did not grow."""
    found = one.text.partition(":")[0]
    return f"{found}; differences did not grow meanwhile: the error in time is {error:.2g}"


@contextmanager
def _nothing_computed(params: Params) -> Iterator[None]:
    """Yield exceptions from here an empty ``result``."""
    try:
        yield
    except Exception as error:
        if isinstance(error, SimulationError):
            annotate(error, params, ())
        _keep_result(error, None)
        raise


def _keep_result(error: BaseException, result: Result | None) -> None:
    """Attach the finished part of a run to the user's exception, unless it has a ``result``."""
    if not hasattr(error, "result"):
        with suppress(AttributeError, TypeError):
            error.result = result  # type: ignore[attr-defined]
