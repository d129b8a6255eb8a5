"""The text of an explanation."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from ..base.rounding import percent
from ..base.tables import columns
from .ablation import ANSWERS, LEVELS, NO_GAIN, RUNS, SAFETY, Ablation, LeftOut
from .effects import Effect
from .run_length import Window
from .step_cost import StateSize, Step

_WIDTH = 98
#: A space at which no line is broken.
_FIXED = "\N{NO-BREAK SPACE}"
#: A name and its number, or numbers in brackets, and the unit behind it.
_QUANTITY = re.compile(
    r"(\S+ = )?(\([^)]*\)|[\d.e+-]+)( (N|kg|m|s|rad|%)([/^][^\s,;]*)?(?=[\s,;.:]|$))*"
)


def text_of(
    effects: Sequence[Effect],
    state: StateSize,
    step: Step,
    window: Window,
    ablation: Ablation | None,
    error: float,
) -> str:
    """Write an explanation as it is printed."""
    sections = [_effects(effects), _state(state), _step(step)]
    if ablation is not None:  # the answer first
        sections = [_advice(ablation, error), *sections, _ablation(ablation, window)]
    return "\n\n".join("\n".join(section) for section in sections)


def _effects(effects: Sequence[Effect]) -> list[str]:
    lines = ["Effects that are on, and what in the scene calls for them"]
    for effect in effects:
        if effect.on:
            lines.append(f"  {effect.name}")
            lines += [line for reason in effect.because for line in _wrapped(reason, 6)]
    zero = [name for effect in effects if effect.on for name in effect.zero]
    off = [effect.name for effect in effects if not effect.on]
    if zero:
        lines += ["Off, for their numbers are 0", *_wrapped(", ".join(dict.fromkeys(zero)), 2)]
    if off:
        lines += ["Off, for nothing calls for them", *_wrapped(", ".join(off), 2)]
    return lines


def _state(state: StateSize) -> list[str]:
    parts = [(part, numbers) for part, numbers in state.parts.items() if numbers]
    rows = [(part, f"{numbers}", ", ".join(state.fields[part])) for part, numbers in parts]
    title = (
        f"State: {sum(state.parts.values())} numbers, {state.numbers} with their padding, "
        f"{state.bytes} bytes; the simulation {state.simulation} bytes"
    )
    return [title, *columns(rows, "<><")]


def _step(step: Step) -> list[str]:
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


def _ablation(ablation: Ablation, window: Window) -> list[str]:
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


def _advice(ablation: Ablation, error: float) -> list[str]:
    idle = [row.name for row in ablation.rows if not row.exercised]
    if not ablation.sets:
        lines = _wrapped(_why_none(ablation, LEVELS[-1] * error), 0)
    else:
        end = ablation.sets[0][2].end
        lines = [f"What may be left out together, tried from 0 to {end:.4g} s"]
        rows = [("at", "left out", "changed", "error", "CPU time")]
        for level, _, row in ablation.sets:
            changed, error_of = percent(max(row.change.values())), percent(row.error)
            rows.append((percent(level), row.name, changed, error_of, _cpu_time(row)))
        lines += columns(rows, "><>")
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
