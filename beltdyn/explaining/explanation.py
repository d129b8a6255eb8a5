"""``bd.explain``: the effects of a drive, why it has them, their cost and influence."""

from __future__ import annotations

import re
import textwrap
import time
from collections.abc import Sequence
from typing import Any

import attrs

from .. import _core
from ..base.checks import flag, one_of, positive
from ..base.described import suggesting
from ..base.naming import ByPulley
from ..base.rounding import percent, plain
from ..base.run_options import METHODS
from ..base.run_warnings import silenced
from ..base.tables import columns
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.motions import MotionLike, as_motions, motion_terms
from ..loads.torques import TorqueLike, as_terms
from ..outputs.state import State
from .ablation import ANSWERS, LEVELS, NO_GAIN, RUNS, SAFETY, Ablation, LeftOut, ablate
from .effects import Effect, effects_of
from .removals import Removal, leave_out, removals_of
from .run_length import Drive, Window, find_window
from .step_cost import Pass, StateSize, Step, size_of, time_step

#: Part of the budget that the window is planned for, and that may be spent: times vary.
_PLANNED, _SPENT = 0.8, 0.9
#: Part of a window, if it is not all of the run, that ranks the effects. The time that is left then
#: goes into runs as long as possible, without what may go.
_RANKING = 0.5
#: CPU time spent on timing the passes of a step, with the run for that [s].
_PROFILING_TIME = 0.4
#: Runs besides those with one effect left out, in such runs: the window is looked for, the run with
#: all effects, that at a tighter tolerance takes twice as long, that with all advice.
_MORE_RUNS = 5
#: Tolerance of the runs over the error asked for: theirs must not hide what an effect is worth.
_TIGHTER, _LOOSEST, _TIGHTEST = 0.1, 1e-3, 1e-8
#: Of the text.
_WIDTH = 98
#: A space at which no line is broken.
_FIXED = "\N{NO-BREAK SPACE}"
#: A name and its number, or numbers in brackets, and the unit behind it.
_QUANTITY = re.compile(
    r"(\S+ = )?(\([^)]*\)|[\d.e+-]+)( (N|kg|m|s|rad|%)([/^][^\s,;]*)?(?=[\s,;.:]|$))*"
)


@attrs.frozen(kw_only=True, repr=False)
class Explanation:
    """The effects of a drive, why it has them, their cost and influence; ``print`` shows them.

    Attributes:
        effects: The effects, those that are off too, in the order of their passes.
        state: The size of the state by part.
        step: A step: its method and passes, each with its time, and the time of a whole step in a
            short run.
        window: The part of the run that was looked at.
        ablation: Influence of each effect, found by leaving out one at a time; None if not asked
            for.
        error: The error asked for [1].
        scene: The scene that is explained.
    """

    effects: tuple[Effect, ...]
    state: StateSize
    step: Step
    window: Window
    ablation: Ablation | None
    error: float
    scene: Scene

    @property
    def passes(self) -> tuple[Pass, ...]:
        """The passes of a step, in their order."""
        return self.step.passes

    def without(self, *names: str) -> Scene:
        """Return the scene without some of the effects of ``ablation``.

        Args:
            names: Names of rows of ``ablation``; none: all that ``ablation.advice`` has.

        Raises:
            ValueError: There is no such row.
        """
        known: dict[str, Removal] = {one.name: one for one in removals_of(self.scene)}
        if not names and self.ablation is not None:
            names = self.ablation.advice
        for name in names:
            one_of("name", name, tuple(known))
        return leave_out(self.scene, [one for name, one in known.items() if name in names])

    def to_dict(self) -> dict[str, Any]:
        """Return all but the scene as plain dictionaries, lists, texts and numbers, for JSON.

        Numbers that are not finite, such as the bound of what failed, are None.
        """
        left_out = attrs.asdict(self, filter=lambda of, _: of.name not in ("final", "scene"))
        found: dict[str, Any] = plain(left_out)
        return found

    def __str__(self) -> str:
        sections = [_effects_text(self.effects), _state_text(self.state), _step_text(self.step)]
        if (found := self.ablation) is not None:  # the answer first
            advice, table = _advice_text(found, self.error), _ablation_text(found, self.window)
            sections = [advice, *sections, table]
        return "\n\n".join("\n".join(section) for section in sections)

    def __repr__(self) -> str:
        on = sum(effect.on for effect in self.effects)
        return f"Explanation({on} effects on, method {self.step.method!r})"


@suggesting
def explain(
    params: Params,
    torque_fn: TorqueLike,
    t_end: float | None = None,
    motion: ByPulley[MotionLike] | None = None,
    *,
    error: float = 1e-2,
    budget: float = 30.0,
    method: str = "auto",
    ablation: bool = True,
) -> Explanation:
    """Explain which effects a drive simulates, why, what they cost and what they change.

    ``print(bd.explain(*bd.scenes.serpentine()))`` shows a built-in scene. It lists

    - the effects that are on and off, each with the numbers of the scene that call for it;
    - the size of the state, by part;
    - the passes of a step of the method, in their order, with the time of each, measured on this
      machine at a state of the run;
    - what leaving out one effect at a time does to span tensions, pulley speeds and CPU time, and
      which may be left out at the error asked for.

    Compared are the mean and the range of the tension of each span, over the mean tension, and of
    the speed of each pulley, over the highest speed, over the window and over each fifth of it.
    Where the budget is enough for all of the run, the influence of an effect is the largest change
    plus twice the runs' own error, which is measured with a run at a tenth of the tolerance. If
    not, a shorter window ranks the effects.

    What may be left out together, at the error asked for, 2, 5 and 10 times that, is then left out
    of as much of the run as the budget allows; changes in a part of the run bound those in the rest
    by four times their size, times the ratio of late to early changes in that part. This is also
    the bound stated for other runs like the one that is explained, longer ones too. There is none
    where the run without an effect has a warning of its accuracy that the run with it has not. An
    effect that did nothing in the window is marked as not exercised: nothing follows for other
    runs, nor for effects that begin to act only after the window. What would cost more steps is
    kept.

    All runs begin as those of :func:`beltdyn.simulate` do, each of its own drive: at rest under
    preload, or at the speed with which a motion begins. Where the belt's length is found for its
    preload, it is found anew; a belt without its bending stiffness has the tension at rest that it
    had with it.

    Args:
        params: The drive.
        torque_fn: The set torques, as :func:`beltdyn.simulate` takes them.
        t_end: End of the run that is to be explained [s]; None: 1 s. Where the budget is not enough
            for all of it, a window is run, from its start.
        motion: Prescribed motions by pulley, as :func:`beltdyn.simulate` takes them.
        error: The error asked for [1], 0.01: one percent. The runs have a tenth of it, at most
            1e-3, as their ``rtol``.
        budget: CPU time for all of it [s], about.
        method: One of :data:`beltdyn.METHODS`.
        ablation: Whether to leave out effects.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: The drive does not settle or run.
        Interrupted: Ctrl-C.
    """
    begin = time.thread_time()
    if not isinstance(params, Params):
        raise TypeError(f"params must be a Params, got {type(params).__name__}")
    asked, allowed = positive("error", error, "1"), positive("budget", budget, "s")
    scene = Scene(
        params, torque_fn, 1.0 if t_end is None else positive("t_end", t_end, "s"), motion
    )
    scene.check()
    drive = Drive(
        scene=scene,
        rtol=min(_LOOSEST, max(_TIGHTEST, _TIGHTER * asked)),
        method=one_of("method", method, METHODS),
    )
    runs = _MORE_RUNS + len(removals_of(scene)) if flag("ablation", ablation) else _MORE_RUNS
    with silenced():
        window = find_window(drive, max(0.0, _PLANNED * allowed - _PROFILING_TIME) / runs)
        if window.end < window.asked:
            window = attrs.evolve(window, end=_RANKING * window.end)
        sim = _start(drive, window.final, drive.method)
        step = time_step(lambda name: _start(drive, window.final, name), drive.method)

        def time_left() -> float:
            return _SPENT * allowed - (time.thread_time() - begin)

        found = ablate(drive, window, asked, time_left) if ablation else None
    motions = as_motions(motion, params.pulley_names)
    return Explanation(
        effects=effects_of(params, _described(torque_fn), motions, sim.effects, sim.passes),
        state=size_of(sim, scene.params._belt_facts),
        step=step,
        window=window,
        ablation=found,
        error=asked,
        scene=scene,
    )


def _start(drive: Drive, state: State, method: str) -> _core.Simulation:
    """Return a run from a state of the window on, to its end or beyond."""
    scene = drive.scene
    names = scene.params.pulley_names
    return _core.Simulation(
        scene.params._model,
        state._to_core(scene.params),
        as_terms(scene.torque_fn, names),
        max(scene.t_end, 2.0 * state.t),
        method=method,
        rtol=drive.rtol,
        motion=motion_terms(as_motions(scene.motion, names)),
    )


def _described(torque_fn: TorqueLike) -> str:
    """Name a torque function; torque objects describe themselves."""
    name = getattr(torque_fn, "__name__", None)
    return f"function {name}" if name else " ".join(str(torque_fn).split("\n"))


# --- the text ------------------------------------------------------------------------------------


def _effects_text(effects: Sequence[Effect]) -> list[str]:
    lines = ["Effects that are on, and what in the scene calls for them"]
    for effect in effects:
        if effect.on:
            lines.append(f"  {effect.name}")
            lines += [line for reason in effect.because for line in _wrapped(reason, 6)]
    zero = [name for effect in effects if effect.on for name in effect.zero]
    off = [effect.name for effect in effects if not effect.on]
    if zero:
        lines += ["Off: their numbers are 0", *_wrapped(", ".join(dict.fromkeys(zero)), 2)]
    if off:
        lines += ["Off: nothing in the scene calls for them", *_wrapped(", ".join(off), 2)]
    return lines


def _state_text(state: StateSize) -> list[str]:
    parts = [(part, numbers) for part, numbers in state.parts.items() if numbers]
    rows = [(part, f"{numbers}", ", ".join(state.fields[part])) for part, numbers in parts]
    title = (
        f"State: {sum(state.parts.values())} numbers, {state.numbers} with their padding, "
        f"{state.bytes} bytes; the simulation {state.simulation} bytes"
    )
    return [title, *columns(rows, "<><")]


def _step_text(step: Step) -> list[str]:
    rows = [("pass", "calls", "ns a call", "ns a step", "part")]
    parts = [(one.name, f"{one.calls:g}", _ns(one.seconds), one.per_step) for one in step.passes]
    if step.between > 0.0:
        parts.append(("between them", "1", _ns(step.between), step.between))
    parts.append(("a step, called alone", "", "", step.alone))
    parts.append(("a step in a run", "", "", step.measured))
    for name, calls, each, seconds in parts:
        part = f"{100.0 * seconds / step.alone:.0f} %"
        rows.append((name, calls, each, _ns(seconds), part))
    many = f"{step.steps} steps and {step.rejected} rejected ones"
    run = _wrapped(f"The run: {many}, with the checks of every run.", 2)
    return [f'Step of method "{step.method}"', *columns(rows), *run]


def _ablation_text(ablation: Ablation, window: Window) -> list[str]:
    head = (
        f"Leaving out one effect at a time, from 0 to {window.end:.4g} s"
        + (f" of {window.asked:.4g} s" if window.end < window.asked else "")
        + f", {ablation.runs} runs; all effects: {ablation.seconds:.3g} s of CPU time"
    )
    heading = (name.replace(",", "") if "mean" in name else "range" for name in ANSWERS)
    whole = window.end >= window.asked
    rows: list[tuple[str, ...]] = [("left out", *heading, "CPU time", "error", "elsewhere")]
    rows += [_row(row) for row in ablation.rows if not row.failed]
    shown = len(rows[0]) - (not whole)  # of a part of a run, both are the same
    remarks = []
    for row in ablation.rows:
        if row.failed:
            remarks.append(f"{row.name}: no run without it, {row.failed}")
        elif row.warned:
            warned = ", ".join(row.warned)
            remarks.append(f"{row.name}: the run without it is warned of, {warned}: it is kept")
        elif row.exercised and row.cpu_time > NO_GAIN:
            remarks.append(f"{row.name}: the run without it takes more time: it is kept")
    bound = (
        f"{SAFETY:g} times the largest change over this time or a fifth of it, more where changes "
        "are larger late in it than early"
    )
    ends = (
        "The error is the largest change over the run or a fifth of it. For other runs like this "
        f'one "elsewhere" is its bound: {bound}.'
        if whole
        else f"The error, for the whole run and for others like this one, is a bound: {bound}."
    )
    remarks.append(
        "Changes are those of means and ranges over this time: of spans over the mean tension, of "
        f"pulleys over the highest speed. {ends} Errors include {RUNS:g} times that of the runs, "
        f"{percent(ablation.own_error)}."
        + (" CPU times are of one run each: small differences are chance." * (ablation.rounds == 1))
    )
    table = columns([row[:shown] for row in rows])
    return [*_wrapped(head, 0), *table, *(line for one in remarks for line in _wrapped(one, 2))]


def _row(row: LeftOut) -> tuple[str, ...]:
    cpu_time = _cpu_time(row)
    if not row.exercised:
        return row.name, *("-" for _ in ANSWERS), cpu_time, "not exercised", ""
    changes = [percent(row.change[name]) for name in ANSWERS]
    bounds = ("no bound", "") if row.warned else (percent(row.error), percent(row.bound))
    return row.name, *changes, cpu_time, *bounds


def _advice_text(ablation: Ablation, error: float) -> list[str]:
    idle = [row.name for row in ablation.rows if not row.exercised]
    if not ablation.sets:
        lines = _wrapped(_why_none(ablation, LEVELS[-1] * error), 0)
    else:
        end = ablation.sets[0][2].end
        lines = [f"What may be left out together, tried from 0 to {end:.4g} s"]
        rows = [("at", "changed", "error", "CPU time", "left out")]
        for level, _, row in ablation.sets:
            changed, error_of = percent(max(row.change.values())), percent(row.error)
            rows.append((percent(level), changed, error_of, _cpu_time(row), row.name))
        lines += columns(rows, ">>>><", width=_WIDTH)
        dear = [percent(level) for level, _, row in ablation.sets if row.cpu_time > NO_GAIN]
        if dear:
            lines += _wrapped(f"At {', '.join(dear)} no CPU time is saved: nothing is gained.", 2)
        if not ablation.advice:
            lines += _wrapped(f"At {percent(error)}, which was asked for, none.", 2)
    if idle:
        lines += _wrapped(
            f"Not exercised, they did nothing in this window, of which nothing follows: "
            f"{', '.join(idle)}.",
            0,
        )
    return lines


def _why_none(ablation: Ablation, most: float) -> str:
    """Describe why no effects were left out together within the largest error looked at."""
    small = [row for row in ablation.rows if row.exercised and row.error <= most]
    if not small:
        return f"None may be left out at an error of {percent(most)} or less."
    named = ", ".join(
        f"{row.name} ({percent(row.error)}, CPU time {_cpu_time(row)})" for row in small
    )
    if all(row.cpu_time > NO_GAIN for row in small):
        return f"Nothing is gained by what may be left out at {percent(most)} or less: {named}."
    return (
        f"In the window of the table each of these may be left out at an error of {percent(most)} "
        f"or less: {named}. Over more of the run the error was larger, or there was no time to "
        "find it."
    )


def _cpu_time(row: LeftOut) -> str:
    return f"{100.0 * row.cpu_time:+.0f} %"


def _ns(seconds: float) -> str:
    return f"{1e9 * seconds:.0f}"


def _wrapped(text: str, indent: int) -> list[str]:
    """Wrap a text; a number, its name and its unit stay on one line."""
    whole = _QUANTITY.sub(lambda found: found[0].replace(" ", _FIXED), text)
    lines = textwrap.wrap(
        whole, _WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + 2)
    )
    return [line.replace(_FIXED, " ") for line in lines]
