"""The text of an explanation."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

import attrs

from .ablation import ANSWERS, RUNS, SAFETY, Ablation, LeftOut
from .cost import StateSize, Step
from .effects import Effect
from .window import Window

__all__ = ["text_of"]

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
    if ablation is not None:
        sections.append(_ablation(ablation, window, error))
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
    rows = [
        (part, f"{numbers}", ", ".join(state.fields[part]))
        for part, numbers in state.parts.items()
        if numbers
    ]
    return [
        f"State: {sum(state.parts.values())} numbers, {state.numbers} with their padding, "
        f"{state.bytes} bytes; the simulation {state.simulation} bytes",
        *_table(rows, "<><"),
    ]


def _step(step: Step) -> list[str]:
    rows = [("pass", "calls", "ns a call", "ns a step", "part")]
    parts = [(one.name, one.calls, one.seconds, one.per_step) for one in step.passes]
    if step.between > 0.0:
        parts.append(("between them", 1.0, step.between, step.between))
    for name, calls, seconds, per_step in parts:
        part = f"{100.0 * per_step / step.alone:.0f} %"
        rows.append((name, f"{calls:g}", _ns(seconds), _ns(per_step), part))
    rows.append(("a step, called alone", "", "", _ns(step.alone), "100 %"))
    rows.append(
        (
            "a step in a run",
            "",
            "",
            _ns(step.measured),
            f"{100.0 * step.measured / step.alone:.0f} %",
        )
    )
    lines = [f'Step of method "{step.method}"', *_table(rows, "<>>>>")]
    return lines + _wrapped(
        f"The run: {step.steps} steps and {step.rejected} rejected ones, with the checks of every "
        "run.",
        2,
    )


def _ablation(ablation: Ablation, window: Window, error: float) -> list[str]:
    head = (
        f"Leaving out one effect at a time, from 0 to {window.end:.4g} s"
        + (f" of {window.asked:.4g} s" if window.end < window.asked else "")
        + f", {ablation.runs} runs; all effects: {ablation.seconds:.3g} s of CPU time"
    )
    heading = (name.replace(",", "") if "mean" in name else "range" for name in ANSWERS)
    rows: list[tuple[str, ...]] = [("left out", *heading, "CPU time", "at most")]
    rows += [_row(row) for row in ablation.rows if not row.failed]
    if ablation.together is not None and len(ablation.advice) > 1:
        rows.append(_row(attrs.evolve(ablation.together, name="all that may be")))
    lines = [*_wrapped(head, 0), *_table(rows, "<" + ">" * (len(ANSWERS) + 2))]
    for row in ablation.rows:
        if row.failed:
            lines += _wrapped(f"{row.name}: no run without it, {row.failed}", 2)
        elif row.warned:
            lines += _wrapped(
                f"{row.name}: the run without it is warned of, {', '.join(row.warned)}: it is kept",
                2,
            )
    lines += _wrapped(
        "Changes of means and ranges over this time, of spans over the mean tension, of pulleys "
        f'over the highest speed. "at most" is {SAFETY:g} times the largest change in a fifth of '
        "this time, times by how much changes are larger late in it than early, plus "
        f"{RUNS:g} times the own error of the runs, {_percent(ablation.own_error)}: for runs like "
        "this one."
        + (
            " CPU times are of one run each: small differences are chance." * (ablation.rounds == 1)
        ),
        2,
    )
    return lines + _advice(ablation, error)


def _row(row: LeftOut) -> tuple[str, ...]:
    if not row.exercised:
        return (
            row.name,
            *("-" for _ in ANSWERS),
            f"{100.0 * row.cpu_time:+.0f} %",
            "not exercised",
        )
    return (
        row.name,
        *(_percent(row.change[name]) for name in ANSWERS),
        f"{100.0 * row.cpu_time:+.0f} %",
        "no bound" if row.warned else _percent(row.bound),
    )


def _advice(ablation: Ablation, error: float) -> list[str]:
    singly = [row.name for row in ablation.rows if row.may_be_left_out]
    idle = [row.name for row in ablation.rows if not row.exercised]
    lines: list[str] = []
    if not singly:
        lines += _wrapped(f"At an error of {_percent(error)} none may be left out.", 0)
    elif ablation.together is None:
        lines += _wrapped(
            f"At an error of {_percent(error)} one of these may be left out: {', '.join(singly)}.",
            0,
        )
    else:
        how, most = ablation.together.how, max(ablation.together.change.values())
        lines += _wrapped(
            f"At an error of {_percent(error)} may be left out, all together: {how}. That changed "
            f"{_percent(most)}; at most {_percent(ablation.together.bound)}.",
            0,
        )
        others = [name for name in singly if name not in ablation.advice]
        if others:
            lines += _wrapped(f"Or, instead, one of: {', '.join(others)}.", 0)
    if idle:
        lines += _wrapped(
            f"Not exercised, they did nothing in this window, of which nothing follows: "
            f"{', '.join(idle)}.",
            0,
        )
    return lines


def _percent(share: float) -> str:
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent >= 100.0 else f"{percent:.2g} %"


def _ns(seconds: float) -> str:
    return f"{1e9 * seconds:.0f}"


def _table(rows: Sequence[Sequence[str]], aligned: str) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(aligned))]
    return [
        "  "
        + "  ".join(
            f"{cell:{a}{w}}" for cell, a, w in zip(row, aligned, widths, strict=True)
        ).rstrip()
        for row in rows
    ]


def _wrapped(text: str, indent: int) -> list[str]:
    """Wrap a text; a number, its name and its unit stay on one line."""
    whole = _QUANTITY.sub(lambda found: found[0].replace(" ", _FIXED), text)
    lines = textwrap.wrap(
        whole, _WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + 2)
    )
    return [line.replace(_FIXED, " ") for line in lines]
