"""The text of an explanation."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from .cost import StateSize, Step
from .effects import Effect

__all__ = ["text_of"]

_WIDTH = 98
#: A space at which no line is broken.
_FIXED = "\N{NO-BREAK SPACE}"


def text_of(effects: Sequence[Effect], state: StateSize, step: Step) -> str:
    """Write an explanation as it is printed."""
    sections = [_effects(effects), _state(state), _step(step)]
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
    whole = re.sub(
        r"\S+ = (\([^)]*\)[^,]*|[^,(]+)", lambda found: found[0].replace(" ", _FIXED), text
    )
    lines = textwrap.wrap(
        whole, _WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + 2)
    )
    return [line.replace(_FIXED, " ") for line in lines]
