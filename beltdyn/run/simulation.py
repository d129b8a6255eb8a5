"""Running a drive under torques."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Array, flag, positive, sample_times
from ..base.described import suggesting
from ..base.naming import ByPulley
from ..base.run_options import BY_BUDGET, USUAL, Options
from ..base.run_warnings import issue
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.motions import MotionLike
from ..loads.torques import TorqueLike
from ..outputs.accuracy_report import Expected
from ..outputs.selection import chosen, lacking
from ..outputs.state import State
from ..result.errors import Interrupted
from ..result.result import Result
from ..verification import budget as budgets
from ..verification.quantities import OBSERVED
from ..verification.runs import Reached
from ..verification.verification import Verification
from .checkpoints import Checkpoint, Fresh, Recorder
from .run import once
from .settling import check_initial, check_params, settle
from .start_of_run import Start, span

_DEFAULT_SAMPLES = 1001


@suggesting
def simulate(
    params: Params,
    torque_fn: TorqueLike,
    t_end: float,
    motion: ByPulley[MotionLike] | None = None,
    *,
    t_eval: ArrayLike | None = None,
    method: str = USUAL.method,
    rtol: float = USUAL.rtol,
    initial: State | None = None,
    progress: bool = False,
    breakpoints: ArrayLike = (),
    step: float | None = None,
    max_step: float | None = None,
    max_steps: int | None = None,
    ledger: bool = USUAL.ledger,
    outputs: Sequence[str] | None = None,
    torque_interval: float = USUAL.torque_interval,
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
    ``print(result)`` shows all three as far as they are known, ``verify=True`` measures those in
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
            beyond a hundred, as for sigma = 1e7 1/m) reverses in jumps; errors were up to three
            times as large there. Values above 0.1 loosen nothing further. Fixed steps ignore it.
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
            ledger, which is otherwise left out as by ``ledger=False``, and "span_tension", which
            keeps none of the forces that it is computed from. Other arrays are an AttributeError
            when read. The run itself and ``final_state`` are the same; warnings that show in other
            outputs are not looked for, ``result.unchecked`` lists them. ``verify`` keeps more in
            memory until it is done.
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
            of estimates, and without a warning that the mesh may be coarse where they show that it
            is not. Errors that ``verify`` measures take their place.
        checkpoint: A file to write the run to as it goes, every 30 s of wall time or as
            ``Checkpoint(path, every=...)`` says, on Ctrl-C, where it fails and when it ends; there
            must be none yet. Should the process be killed at any time, :func:`resume` goes on from
            the last write, and its result is that of a run that was not stopped, bit for bit. The
            file holds drive, state, samples, and torques and motions but for functions. If it
            cannot be written (a full disk), a warning "checkpoint" says why, and the run goes on.
            Not together with ``verify`` or ``budget``.

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
            alone, except ``mesh``, before the run, the rest after it; :class:`beltdyn.RunWarning`
            lists all. A filter that turns them into errors raises those of the drive at rest,
            ``mesh`` too, before the run.
        Exception: Whatever ``torque_fn`` or a motion raises comes out unchanged, from ctypes, cffi
            and Numba callbacks as well; what was computed is in its attribute ``result``, None
            before the run has begun (as while settling).
    """
    given = dict(locals())
    check_params(params)
    kept = chosen(outputs, flag("ledger", ledger), lacking(params))
    if not (expected is None or isinstance(expected, Expected)):
        raise TypeError(f"expected must be a bd.accuracy.Expected, got {type(expected).__name__}")
    if checkpoint is not None and (budget is not None or flag("verify", verify)):
        raise ValueError(
            "checkpoint is of one run: give it without verify and budget, which make several"
        )
    if budget is not None:
        chosen_by_it = (*(given[name] for name in BY_BUDGET), expected, flag("verify", verify))
        if chosen_by_it != (*(getattr(USUAL, name) for name in BY_BUDGET), None, False):
            raise ValueError(
                "budget chooses method and rtol: give it without them, step, expected and verify"
            )
        begun, budget = time.thread_time(), positive("budget", budget, "s")
    check_initial(params, initial)
    begin, end = span(initial, t_end)
    times = np.linspace(begin, end, _DEFAULT_SAMPLES)
    if t_eval is not None:
        times = sample_times("t_eval", t_eval, begin, end)
    start = Start(
        scene=Scene(params, torque_fn, end, motion),
        options=Options.among(given),
        t_eval=times,
        initial=initial,
        outputs=kept,
        expected=expected,
    )
    shown = flag("progress", progress)
    if budget is not None:
        plan = budgets.plan(
            _runner(start),
            settle,
            start.scene,
            budget,
            initial=initial,
            t_eval=times,
            breakpoints=start.options.breakpoints,
        )
        start = attrs.evolve(
            start,
            scene=start.scene._replace(params=plan.params),
            options=attrs.evolve(start.options, **plan.forecast.setting.options),
            initial=plan.initial,
            expected=plan.expected,
        )
        result = once(start, progress=shown)[0]
        result, noticed = plan.judge(result, time.thread_time() - begun)
        issue(noticed)
        return result
    if not flag("verify", verify):
        with Recorder() if checkpoint is None else Fresh(Checkpoint.of(checkpoint)) as recorder:
            return once(start, progress=shown, recorder=recorder)[0]
    others = Verification(_runner(start), settle, start.scene, initial, start.t_eval, start.options)
    with closing(others) as verification:
        compared = None if kept is None else chosen((*kept, *OBSERVED), ledger)
        start = attrs.evolve(start, outputs=compared)
        result, first = once(start, verification.watch, progress=shown)
        try:
            accuracy = verification.judge(result, first)
            return attrs.evolve(result, accuracy=accuracy)._keeping(kept)
        except KeyboardInterrupt as error:
            message = "interrupted while the run was verified; it had itself finished"
            raise Interrupted(message, result) from error


def _runner(start: Start) -> Callable[..., Result]:
    """Return ``simulate`` for runs beside one, with its options but for those that are given."""

    def run(
        params: Params,
        torque_fn: Any,
        end: float,
        *,
        motion: Any,
        initial: State | None,
        t_eval: Array,
        watch: Callable[[Reached], None] | None = None,
        outputs: tuple[str, ...] | None = None,
        **given: Any,
    ) -> Result:
        scene, options = Scene(params, torque_fn, end, motion), attrs.evolve(start.options, **given)
        own = Start(scene=scene, options=options, t_eval=t_eval, initial=initial, outputs=outputs)
        return once(own, watch)[0]

    return run
