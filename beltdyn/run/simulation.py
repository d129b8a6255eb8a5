"""Running a drive under torques."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..base.checks import Array, flag, integer, one_of, positive, real, real_array, sample_times
from ..base.naming import ByPulley
from ..base.run_warnings import RunWarning, is_error, issue
from ..base.stopping import stoppable
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.callback_errors import CallbackErrors
from ..loads.motions import CrankMotion, Motion, MotionLike, as_motions, first_speeds, motion_terms
from ..loads.torques import TorqueLike, as_terms
from ..outputs.accuracy_report import Expected
from ..outputs.histories import Stats
from ..outputs.selection import LEDGER, chosen, lacking, of_belt, of_core, unchecked
from ..outputs.state import State
from ..result.errors import Interrupted, SimulationError, annotate
from ..result.result import Result
from ..verification import budget as budgets
from ..verification.quantities import OBSERVED
from ..verification.runs import Reached
from ..verification.verification import Verification
from . import memory, observed
from .checkpoints import Checkpoint, Fresh, Recorder, Spent
from .progress import over_time
from .settling import CHUNK, check_initial, check_params, positive_or_none, settle
from .start_of_run import Start

__all__ = ["METHODS", "settle", "simulate", "speeds_at_start"]

#: Integration methods, of the core's table; :func:`simulate` describes them.
METHODS = _core.METHODS

_RTOL_RANGE = (1e-12, 1.0)
_DEFAULT_RTOL, _DEFAULT_SAMPLES = 1e-4, 1001
#: The same for a run that a verifying run follows [s].
_CHUNK_FOLLOWED = 0.01


def simulate(
    params: Params,
    torque_fn: TorqueLike,
    t_end: float,
    motion: ByPulley[MotionLike] | None = None,
    *,
    t_eval: ArrayLike | None = None,
    method: str = "auto",
    rtol: float = _DEFAULT_RTOL,
    initial: State | None = None,
    progress: bool = False,
    breakpoints: ArrayLike = (),
    step: float | None = None,
    max_step: float | None = None,
    max_steps: int | None = None,
    ledger: bool = True,
    outputs: Sequence[str] | None = None,
    torque_interval: float = 5e-4,
    verify: bool = False,
    budget: float | None = None,
    expected: Expected | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
) -> Result:
    """Integrate the equations of motion (2.11), (2.12) under given torques and motions.

    The methods, of which the default, "auto", needs no choice::

        auto    tries "tsit5" and an implicit method ("rodas4"; "lbdf2" from rtol = 0.02, or for
                very stiff friction), goes on with the one that advances further for the same
                cost, and tries again now and then; ``result.stats.choice`` says what it did; on an
                ALE belt it is "rodas4"
        tsit5   explicit Runge-Kutta 5(4) with error control; the stiffest vibration of the joints,
                known beforehand, limits its step. For coarse, lightly damped belts at tight
                tolerances
        rodas4  Rosenbrock 4(3), L-stable, with error control; stiffness does not limit its step.
                For fine belts, heavy damping, stiff contact
        lbdf2   linearly implicit BDF of order 2, one linear system a step, fixed step or error
                control. For quick estimates (rtol >= 0.01: a second of the paper's case 1 in
                16 ms, accurate to 1.5 %) and for very stiff friction. From rtol = 0.05 on
                looser ones change nothing
        lie     linearly implicit Euler method, fixed step or error control. Inaccurate, but the
                most strongly damped; the other implicit methods fall back on it where they fail
        rk4     classical Runge-Kutta, fixed step; for comparison

    The accuracy asked for, ``rtol``, is that of the integration in time. The mesh has an error of
    its own, which only more links reduce, and so has a contact that is softer than the real one:
    ``print(result)`` tells all three as far as they are known, ``verify=True`` measures those in
    time and of the mesh.

    Args:
        params: The drive.
        torque_fn: The set torques M_d of (2.12), one per pulley [N m], counter-clockwise positive:
            a Python callable ``f(t, theta, omega)`` that returns n_p values, torque objects
            (:class:`PiecewiseLinear` and :class:`Viscous` for all pulleys; for single ones
            :class:`Motor`, :class:`SpeedTable`, :class:`Load`, :class:`Harmonics`, :class:`Step`,
            :class:`Ramp`; their sums), or a compiled function
            ``void f(double t, const double *theta, const double *omega, double *torque, void *)``
            from Numba's ``cfunc``, ctypes, cffi or SciPy's ``LowLevelCallable``. A Python function
            makes a run take twice as long if it computes with plain floats, six times as long if
            it uses NumPy.
        t_end: End of the run [s], after ``initial.t``.
        motion: Prescribed motions by pulley, its index or name, ``{0: PiecewiseLinear(t, omega)}``:
            a :class:`PiecewiseLinear` of one value per time, or a function of time, gives the speed
            [rad/s], a :class:`beltdyn.Motion` the speed or the angle, a :class:`CrankMotion` a
            mean speed with harmonics, an :class:`AngleTable` measured angles. Speeds must not
            jump. The torque that a motion needs is in ``result.pulleys.torque``, its work in
            ``energy.drive``; torques set on such a pulley have no effect. While a motion is given
            by a function, steps are no longer than ``torque_interval``.
        t_eval: Times of the samples (n_t,) [s], non-decreasing, within the run; None: 1001
            equally spaced ones.
        method: One of :data:`METHODS`, see above.
        rtol: Error asked for, of the joint forces over the mean tension (root mean square over
            joints and time, for a second of the paper's drive); 1e-12 to 1. Every method keeps its
            local errors, relative to the stretch of a joint, below a limit calibrated on calm
            drives, so that errors come out about as asked there. It says nothing about the mesh,
            whose error is 1 % rather than 1e-4. Very stiff friction (sigma times a joint's stretch
            beyond a hundred,
            as for sigma = 1e7 1/m) reverses in jumps; errors were up to three times as large
            there. Values above 0.1 loosen nothing further. Fixed steps ignore it.
        initial: State to start from; None: the belt at rest under preload, from :func:`settle`,
            tensioned as ``params.tensioning`` says, or, if a motion begins with another speed than
            0, running at it, ``settle(params, speed=...)``. Otherwise the speeds of prescribed
            motions must begin with those of ``initial``, to 1e-9 of them.
        progress: Whether to show a progress bar on stderr (needs ``rich``).
        breakpoints: Times at which ``torque_fn`` has a kink or jump, or a motion given by a
            function a kink (k,) [s]; steps end exactly there. The kinks of torque objects are
            known.
        step: "rk4", "lbdf2", "lie": the fixed step [s], without error control or estimate; "tsit5",
            "rodas4", "auto": the first step [s]. None: chosen; "lbdf2" and "lie" then control their
            error, "rk4" takes three quarters of what is stable for joints, contact, friction,
            pulleys and viscous loads. A fixed step whose error is many times the stretch of a
            joint is not accepted: "rk4" ends with BD_ERR_FIXED_STEP, implicit methods repeat it
            with shorter ones, and ``result.message`` says so.
        max_step: Longest step [s]; None: no limit.
        max_steps: Most steps; None: no limit, but a run that makes no progress ends in an error.
        ledger: Whether to record the energies. Their balance is checked in any case, but without
            them it is known to 8 % only: the warning "balance" then comes from 15 % instead of 2 %
            on, and ``stats.error`` does not include it.
        outputs: What to compute and keep at the sample times, a tuple of names; None: everything.
            Names are those of groups ("pulleys", "belt", "joints", "contact", "mounts",
            "couplings"), of arrays in them ("joints.force", "pulleys.omega"), "energy" for the
            ledger, which else is left out as by ``ledger=False``, and "span_tension", which keeps
            none of the forces that it is computed from. Other arrays are an AttributeError when
            read. The run itself and ``final_state`` are the same; warnings that show in other
            outputs are not looked for, ``result.unchecked`` lists them. ``verify`` holds more until
            it is done.
        torque_interval: A torque function, Python or compiled, is called at least once in every
            interval of this length [s], so that no pulse longer than that is missed, however long
            the steps are. (Torque objects need no such calls.) If a function jumps all the time
            (noise, a relay), steps do not become shorter than a twenty-fifth of the interval,
            unless the joints ask for it, and a warning says so.
        verify: Whether to run the drive again, to a tenth of ``rtol`` (with "tsit5", or "rodas4"
            where that would take too long), and on meshes of half and of one and a half times the
            links, so that ``result.accuracy`` has the errors in time and of the mesh. That is four
            times the CPU time of the run alone, and on two free cores takes 2.2 to 2.8 times as
            long. Functions given as torque or motion must depend on their arguments alone, since
            they are called for all of these runs, one after the other; without such functions two
            runs go in parallel. Should one of them fail, ``result.accuracy.notes`` says so.
        budget: CPU time to keep to [s], pilot runs and settling included: method, tolerance and,
            unless ``initial`` is given, the number of links are chosen so that span tensions become
            as accurate as that allows; less is used where no better setting is known.
            ``result.params`` has the mesh chosen, ``result.message`` and ``stats.choice`` what was
            chosen, the error expected, which is that in ``result.accuracy``, and whether better
            settings would take too long or are not known. The choice comes from runs on coarse
            meshes, which take up to half of the budget; should all together exceed it nevertheless,
            a warning "budget" says so. Not together with ``method``, ``rtol``, ``step``,
            ``expected`` or ``verify``.
        expected: Errors that pilot runs have shown, as ``options`` of
            :func:`beltdyn.accuracy.suggest` have them: ``result.accuracy`` then has them in place
            of estimates, and a warning that the mesh may be coarse goes where they show that it is
            not. Errors that ``verify`` measures come before them.
        checkpoint: A file to write the run to as it goes, every 30 s of wall time or as
            ``Checkpoint(path, every=...)`` says, on Ctrl-C, where it fails and when it ends;
            there must be none yet. Should the process be killed at any time, :func:`resume`
            goes on from the last write, and its result is that of a run that was not stopped, bit
            for bit. The file holds drive, state, samples, and torques and motions but for
            functions. What it cannot be written for (a full disk) is a warning "checkpoint", and
            the run goes on. Not together with ``verify`` or ``budget``.

    Raises:
        TypeError, ValueError: An argument breaks its rule, before anything runs; ``budget`` does
            not suffice for the coarsest mesh, the message says what would; or ``torque_fn``
            returned something other than n_p numbers.
        OSError: There can be no file at ``checkpoint``; raised before anything runs.
        SimulationError: The run cannot go on, or failed a check; ``.symbol`` says why,
            ``.result`` holds what was computed, notes of the error list the warnings before it.
        Interrupted: Ctrl-C; ``.result`` holds what was computed, None before the run has begun.
        MemoryError: The samples do not fit into memory; raised before anything runs.
        BeltdynWarning: Not raised but issued, for each of ``result.warnings``: those of the drive
            alone, but ``mesh``, before the run, the rest after it; :class:`beltdyn.RunWarning`
            lists all. A filter that makes errors of them raises what the drive at rest has,
            ``mesh`` too, before the run.
        Exception: Whatever ``torque_fn`` or a motion raises comes out unchanged, from ctypes, cffi
            and Numba callbacks as well; what was computed is in its attribute ``result``, None
            before the run has begun (as while settling).
    """
    options: dict[str, Any] = {
        "t_eval": t_eval,
        "method": method,
        "rtol": rtol,
        "breakpoints": breakpoints,
        "step": step,
        "max_step": max_step,
        "max_steps": max_steps,
        "torque_interval": torque_interval,
    }
    check_params(params)
    kept = chosen(outputs, flag("ledger", ledger), lacking(params))
    own: dict[str, Any] = {"ledger": ledger, "progress": progress, "initial": initial, **options}
    if expected is not None:
        own["expected"] = _expected(expected)
    if checkpoint is not None and (budget is not None or flag("verify", verify)):
        raise ValueError(
            "checkpoint is of one run: give it without verify and budget, which make several"
        )
    if budget is not None:
        given = (method, rtol, step, expected, flag("verify", verify))
        if given != ("auto", _DEFAULT_RTOL, None, None, False):
            raise ValueError(
                "budget chooses method and rtol: give it without them, step, expected and verify"
            )
        begun = time.thread_time()
        plan = _plan(
            positive("budget", budget, "s"), Scene(params, torque_fn, t_end, motion), initial, own
        )
        own |= {"initial": plan.initial, "method": plan.method, "rtol": plan.rtol}
        own["expected"] = plan.expected
        result = _simulate(plan.params, torque_fn, t_end, motion, outputs=kept, **own)[0]
        result, noticed = plan.judge(result, time.thread_time() - begun)
        issue(noticed, stacklevel=2)
        return result
    if checkpoint is not None:
        with closing(Fresh(Checkpoint.of(checkpoint))) as recorder:
            return _simulate(
                params, torque_fn, t_end, motion, outputs=kept, recorder=recorder, **own
            )[0]
    if not flag("verify", verify):
        return _simulate(params, torque_fn, t_end, motion, outputs=kept, **own)[0]
    check_params(params)
    check_initial(params, initial)
    with Verification(
        _simulate, settle, params, torque_fn, t_end, motion, initial, options
    ) as verification:
        compared = None if kept is None else chosen((*kept, *OBSERVED), ledger)
        result, begin = _simulate(
            params, torque_fn, t_end, motion, outputs=compared, watch=verification.watch, **own
        )
        try:
            accuracy = verification.judge(result, begin)
            return attrs.evolve(result, accuracy=accuracy)._keeping(kept)
        except KeyboardInterrupt as error:
            message = "interrupted while the run was verified; it had itself finished"
            raise Interrupted(message, result) from error


def _plan(
    budget: float, scene: Scene, initial: State | None, own: Mapping[str, Any]
) -> budgets.Plan:
    """Choose what to run for a budget of CPU time."""
    check_params(scene.params)
    check_initial(scene.params, initial)
    start, end = _span(initial, scene.t_end)
    others = {name: own[name] for name in own if name not in ("initial", "t_eval")}
    return budgets.plan(
        lambda *args, **options: _simulate(*args, **options)[0],
        settle,
        scene,
        budget,
        initial=initial,
        t_eval=_sample_times(own["t_eval"], start, end),
        options={**others, "progress": False},
    )


def _simulate(
    params: Params,
    torque_fn: TorqueLike,
    t_end: float,
    motion: ByPulley[MotionLike] | None = None,
    *,
    t_eval: ArrayLike | None,
    method: str,
    rtol: float,
    initial: State | None,
    progress: bool,
    breakpoints: ArrayLike,
    step: float | None,
    max_step: float | None,
    max_steps: int | None,
    ledger: bool,
    torque_interval: float,
    outputs: tuple[str, ...] | None = None,
    expected: Expected | None = None,
    watch: Callable[[Reached], None] | None = None,
    recorder: Recorder | None = None,
) -> tuple[Result, State]:
    """Run once, as :func:`simulate` without ``verify``; return also the initial state.

    ``outputs`` are as :func:`beltdyn.outputs.selection.chosen` returns them.

    ``watch`` is told now and then how far it is; a SimulationError that it raises ends the run.
    ``recorder`` writes it as it goes; with one of a run that was stopped, it goes on.
    """
    check_params(params)
    check_initial(params, initial)
    outputs = of_belt(outputs, params)
    start, end = _span(initial, t_end)
    times = _sample_times(t_eval, start, end)
    options: dict[str, Any] = {
        "method": one_of("method", method, METHODS),
        "rtol": _rtol(rtol),
        "step": positive_or_none("step", step, "s"),
        "max_step": positive_or_none("max_step", max_step, "s"),
        "max_steps": 0 if max_steps is None else integer("max_steps", max_steps, 1),
        "ledger": flag("ledger", ledger) and (outputs is None or LEDGER in outputs),
        "torque_interval": positive("torque_interval", torque_interval, "s"),
        "breakpoints": np.sort(real_array("breakpoints", breakpoints, ndim=1)),
    }
    terms = as_terms(torque_fn, params.pulley_names)
    motions = as_motions(motion, params.pulley_names)
    names = of_core(outputs, options["ledger"])
    needed = memory.check_samples(times.size, params._model.sizes, names, options["ledger"])

    # Before settling, which may take long, and may fail for the very reason they name.
    of_drive = tuple(one for one in params._noticed if one.code != "mesh")
    for one in params._noticed:  # of its mesh a run knows more, and warns at its end
        if one.code == "mesh" and expected is None and is_error(one, stacklevel=3):
            issue([one], stacklevel=3)
    issue(of_drive, stacklevel=3)
    settle_start = time.perf_counter()
    state = initial
    if state is None:
        speed = _first_speeds(params, motions, start, _first_after(start, options, end))
        state = settle(params, speed=speed, progress=progress)
    settle_time = time.perf_counter() - settle_start if initial is None else 0.0

    with _nothing_computed(params):
        sim = _core.Simulation(
            params._model,
            state._to_core(params),
            terms,
            end,
            motion=motion_terms(motions),
            **options,
        )
    try:
        arrays = sim.sample(times, names)
        before = Spent(settle=settle_time)
        if recorder is not None:
            with _nothing_computed(params):
                before = recorder.begin(
                    sim,
                    arrays,
                    Start(
                        scene=Scene(params, torque_fn, end, motion),
                        initial=state,
                        t_eval=times,
                        outputs=outputs,
                        options={**options, "expected": expected},
                        settle_time=settle_time,
                    ),
                )
        cpu_start, wall_start = time.thread_time(), time.perf_counter()
    except MemoryError:
        raise memory.no_room(times.size, needed, "which could not be had") from None
    except KeyboardInterrupt as error:  # arrays of a million rows take time to make
        raise Interrupted("interrupted before the first step, nothing was computed") from error

    def spent() -> Spent:
        return before._replace(
            cpu=before.cpu + time.thread_time() - cpu_start,
            wall=before.wall + time.perf_counter() - wall_start,
        )

    def result(status: str, message: str) -> Result:
        counters, times_spent = sim.stats, spent()
        stats = Stats._from_core(
            counters,
            method="auto" if counters["changes"] else sim.method,
            choice=sim.choice,
            kernels=_core.kernel_level(),
            cpu_time=times_spent.cpu,
            wall_time=times_spent.wall,
            settle_time=times_spent.settle,
        )
        seen = Result._from_core(
            times,
            arrays,
            params._model.energy_terms,
            sim.samples,
            stats=stats,
            effects=tuple(sim.passes),
            success=status == "finished",
            status=status,
            message=message,
            params=params,
            prescribed=tuple(params.pulley_names[k] for k in motions),
            outputs=outputs,
            unchecked=unchecked(outputs, params.has_friction, bool(params.coupled)),
            final_state=State._from_core(sim.state()),
        )
        if expected is not None:
            seen = attrs.evolve(seen, accuracy=seen.accuracy.foreseen(expected))
        of_core = [RunWarning(**one) for one in sim.warnings]
        of_samples = observed.observe(seen, motions)
        if any(one.code == "slack_span" for one in of_samples):
            unknown = tuple(attrs.evolve(one, time=None) for one in seen.accuracy.errors)
            accuracy = attrs.evolve(seen.accuracy, errors=unknown)
            seen = attrs.evolve(seen, stats=attrs.evolve(stats, error=None), accuracy=accuracy)
        if seen.stats.error is not None:  # links that chatter then have no consequence
            notes = tuple(_excused(one, stats.error) for one in of_core if one.code == "chatter")
            accuracy = seen.accuracy
            accuracy = attrs.evolve(accuracy, notes=(*accuracy.notes, *notes))
            seen = attrs.evolve(seen, accuracy=accuracy)
            of_core = [one for one in of_core if one.code != "chatter"]
        slack = any(one.code == "slack_span" for one in of_samples)
        if step is None and status != "failed" and not slack:
            notes = (*seen.accuracy.notes, *observed.hint(seen, rtol))
            seen = attrs.evolve(seen, accuracy=attrs.evolve(seen.accuracy, notes=notes))
        of_file = () if recorder is None else recorder.warnings
        return attrs.evolve(seen, warnings=(*of_drive, *of_core, *of_samples, *of_file))

    def interrupted() -> Interrupted:
        message = f"interrupted at t = {sim.time:.6g} s"
        error = Interrupted(message, result("interrupted", message))
        if recorder is not None:
            error.add_note(recorder.hint)
        return error

    finishing = False
    callback_errors = CallbackErrors(sim.stop)
    chunk = CHUNK if watch is None else _CHUNK_FOLLOWED
    if recorder is not None:
        recorder.count(spent)
        chunk = min(chunk, recorder.every)
    try:
        with callback_errors, stoppable(sim), over_time(progress, "simulating", start, end) as show:
            while not sim.advance(chunk):
                show(sim.time)
                if watch is not None:
                    watch(Reached(state, sim.time, int(sim.stats["steps"]), sim.method))
                if recorder is not None and callback_errors.error is None:
                    recorder.look(sim)
        if recorder is not None:
            recorder.end(sim, finished=True)
        finishing = True
        message = f"reached t_end = {end:g} s"
        if method == "auto":
            message += f"; {sim.choice}"
        elif step is not None and sim.stats["local_error"] >= 1.0 and sim.stats["rejected"]:
            message += (
                f"; {sim.stats['rejected']} steps of the length asked for had errors of many times "
                "a joint's stretch and were repeated with shorter ones: take a shorter step"
            )
        finished = result("finished", message)
    except SimulationError as error:
        if recorder is not None:
            recorder.end(sim)
        error.result = result("failed", str(error))
        annotate(error, params, error.result.warnings)
        raise
    except (KeyboardInterrupt, Exception) as error:
        raised = callback_errors.error or error
        if recorder is not None and not finishing:
            recorder.end(sim, sound=callback_errors.error is None)
        if isinstance(raised, KeyboardInterrupt):
            raise interrupted() from raised
        if finishing:
            raise
        whose = "a torque or motion function" if motions else "the torque function"
        why = f"{whose} raised {type(raised).__name__} after t = {sim.time:.6g} s"
        _keep_result(raised, result("failed", why))
        raised.add_note(why)
        if recorder is not None:
            raised.add_note(recorder.hint)
        if raised is error:
            raise
        raise raised from None
    try:
        issue(finished.warnings[len(of_drive) :], stacklevel=3)
    except Warning as error:  # a warning filter has turned it into an error
        _keep_result(error, finished)
        raise
    return finished, state


def speeds_at_start(
    params: Params, motion: ByPulley[MotionLike] | None, t_end: float, breakpoints: ArrayLike
) -> dict[int, float] | None:
    """Return the speeds with which :func:`simulate` has the belt settle for motions; None: at rest.

    Raises:
        TypeError, ValueError: A motion or a breakpoint breaks its rule.
    """
    motions = as_motions(motion, params.pulley_names)
    if not motions:
        return None
    kinks = {"breakpoints": np.sort(real_array("breakpoints", breakpoints, ndim=1))}
    return _first_speeds(params, motions, 0.0, _first_after(0.0, kinks, t_end))


def _excused(one: RunWarning, error: float | None) -> str:
    """Make a note of links that chatter, where differences were watched and did not grow."""
    found = one.text.partition(":")[0]
    return f"{found}; differences did not grow meanwhile: the error in time is {error:.2g}"


def _first_after(start: float, options: Mapping[str, Any], end: float) -> float:
    """Return the first breakpoint of the run, or its end."""
    later = options["breakpoints"][options["breakpoints"] > start]
    return min(end, float(later[0])) if later.size else end


def _first_speeds(
    params: Params, motions: Mapping[int, Motion | CrankMotion], start: float, until: float
) -> dict[int, float] | None:
    """Return the speeds with which motions begin; None if they begin at rest."""
    with _nothing_computed(params):
        speeds = first_speeds(motions, start, until, params.pulley_names)
    return speeds if any(speeds.values()) else None


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


def _span(initial: State | None, t_end: float) -> tuple[float, float]:
    """Return the times at which a run begins and ends."""
    start = 0.0 if initial is None else initial.t
    end = real("t_end", t_end, "s")
    if end <= start:
        raise ValueError(f"t_end must be > initial.t ({start:g} s), got {end:g} s")
    return start, end


def _sample_times(t_eval: ArrayLike | None, start: float, end: float) -> Array:
    if t_eval is None:
        return np.linspace(start, end, _DEFAULT_SAMPLES)
    return sample_times("t_eval", t_eval, start, end)


def _expected(expected: object) -> Expected:
    if not isinstance(expected, Expected):
        raise TypeError(f"expected must be a bd.accuracy.Expected, got {type(expected).__name__}")
    return expected


def _rtol(rtol: object) -> float:
    number = real("rtol", rtol)
    least, most = _RTOL_RANGE
    if not least <= number <= most:
        raise ValueError(f"rtol must be from {least:g} to {most:g}, got {number:g}")
    return number
