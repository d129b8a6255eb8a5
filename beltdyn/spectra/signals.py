"""One column of an output as a signal over time, selected by names."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from ..base.checks import Array, close_to, shown
from ..base.naming import index_of, span_names
from ..outputs.quantity import QUANTITIES
from ..outputs.selection import array_names
from ..result.labelled import mount_kinds, places
from ..result.result import Result

#: Outputs that are no signals over time; what labels call some.
_NONE = ("energy", "contact.pulley")
_WORDS = {
    "span_tension": "tension",
    "pulleys.load": "hub load",
    "spans.deflection": "deflection in the middle",
}


@attrs.frozen(eq=False)
class Signal:
    """A column of an output over time: its label, unit and values (n_t,)."""

    label: str
    unit: str
    values: Array


def signal(result: Result, output: str, rows: Any = slice(None), **where: Any) -> Signal:
    """Return one of the outputs of a run as a signal over time, with its name and unit.

    Args:
        result: The run.
        output: "span_tension", or the name of an array, such as "pulleys.omega" or "joints.force".
        rows: Which samples.
        **where: ``span`` or ``pulley``, by name or index, ``joint``, ``link`` or ``mount``: what
            the output has a column for. None or left out: the one that fluctuates most.

    Raises:
        TypeError, ValueError: There is no such output or column, or it holds NaN.
        AttributeError: The run was not asked for this output.
    """
    known = [one for names in array_names().values() for one in names if one not in _NONE]
    if output not in known:
        raise ValueError(
            f"output must be one of {', '.join(known)}, got {output!r}; which span or pulley of it "
            "is said by span=, pulley= and the like"
        )
    row = QUANTITIES[output]
    dimension = next(iter(row.dimensions), "belt")
    by = "pulley" if dimension == "coupling" else dimension
    given = {key: value for key, value in where.items() if value is not None}
    if set(given) - {by}:
        raise TypeError(f"{output} is selected by {by}=, not by {', '.join(set(given) - {by})}=")
    values = np.asarray(result._history(output)[rows], dtype=float)
    names = _columns(result, dimension)
    if values.ndim == 1:  # of the belt as a whole
        values = values[:, None]
    elif row.size == "MODES":  # in the middle of the span
        values = values @ np.sin(0.5 * np.pi * np.arange(1, 1 + values.shape[-1]))
    elif values.ndim == 3:  # forces in x and y
        values = np.linalg.norm(values, axis=-1)
    if by in given:
        column = _column(result, by, given[by], names, result.params._having.get(row.size))
    else:
        change = values - values.mean(axis=0)
        rms = np.sqrt(np.mean(change**2, axis=0))
        if np.isnan(rms).all():
            raise ValueError(f"{output} is NaN somewhere in every column")
        column = int(np.nanargmax(rms))
    chosen = values[:, column]
    if np.isnan(chosen).any():
        raise ValueError(
            f"{output} of {names[column]} is NaN at {int(np.isnan(chosen).sum())} of "
            f"{chosen.size} samples: it has no spectrum; {by}= selects another"
        )
    unit = row.unit
    if " or " in unit:
        unit = mount_kinds(result.params)[column].unit(unit)
    return Signal(f"{_WORDS.get(output, output)} of {names[column]}", unit, chosen)


def _columns(result: Result, dimension: str) -> list[str]:
    """Return the names of the columns of an output."""
    if dimension == "belt":
        return ["the belt"]
    if dimension == "span":
        return [f"span {name}" for name in span_names(result.params.pulley_names)]
    found = places(result.params)[dimension]
    return [f"{dimension} {k}" if isinstance(k, int) else k for k in found]


def _column(
    result: Result, by: str, value: object, names: list[str], having: tuple[int, ...] | None
) -> int:
    """Return the column named by span=, pulley= ...; that of a part by its pulley."""
    pulleys, named = result.params.pulley_names, isinstance(value, str)
    if by == "span" and isinstance(value, str) and not value.isdecimal() and value not in pulleys:
        asked, *spans = (name.removeprefix("span ") for name in (value, *names))
        if asked not in spans:
            raise ValueError(
                f"span: no span is called {shown(value)}{close_to(asked, spans)}; there are "
                f"{', '.join(spans)}, also by the pulley before each"
            )
        return spans.index(asked)
    if by not in ("span", "pulley") and not (by == "mount" and named):
        return index_of(by, value, names)
    pulley = index_of(by, value, pulleys)
    if having is None:
        return pulley
    if pulley not in having:
        raise ValueError(f"{by}: {pulleys[pulley]} has none")
    return having.index(pulley)
