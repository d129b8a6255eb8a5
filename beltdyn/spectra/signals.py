"""One column of an output as a signal over time, selected by names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from ..checks import Array, close_to, shown
from ..mounts import Arm
from ..naming import index_of, span_name
from ..outputs import array_names

if TYPE_CHECKING:
    from ..result import Result  # imports the report, which imports this

__all__ = ["Signal", "signal"]

_UNITS = {
    "pulleys": {"theta": "rad", "omega": "rad/s", "torque": "N m", "load": "N"},
    "belt": {"x": "m", "y": "m", "phi": "rad", "vx": "m/s", "vy": "m/s", "vphi": "rad/s"},
    "joints": {"deformation": "m", "force": "N"},
    "couplings": {
        "rim_angle": "rad",
        "rim_speed": "rad/s",
        "windup": "rad",
        "transmitted": "N m",
    },
    "contact": {"normal": "N", "friction": "N", "mu": "1", "slip": "m", "velocity": "m/s"},
}
_SELECTED_BY = {
    "pulleys": "pulley",
    "belt": "link",
    "joints": "joint",
    "contact": "link",
    "couplings": "pulley",
}


@attrs.frozen(eq=False)
class Signal:
    """A column of an output over time: what it is called, its unit, its values (n_t,)."""

    label: str
    unit: str
    values: Array


def signal(result: Result, output: str, rows: Any = slice(None), **where: Any) -> Signal:
    """Give one of the outputs of a run as a signal over time, with its name and unit.

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
    group, _, name = output.partition(".") if isinstance(output, str) else ("", "", "")
    known = [one for names in array_names().values() for one in names]
    if output not in known or output in ("energy", "contact.pulley"):
        listed = ", ".join(one for one in known if one not in ("energy", "contact.pulley"))
        raise ValueError(
            f"output must be one of {listed}, got {output!r}; which span or pulley of it is said "
            "by span=, pulley= and the like"
        )
    by = "span" if output == "span_tension" else "mount" if group == "mounts" else None
    by = by or _SELECTED_BY[group]
    given = {key: value for key, value in where.items() if value is not None}
    if set(given) - {by}:
        raise TypeError(f"{output} is selected by {by}=, not by {', '.join(set(given) - {by})}=")
    held = result if group == "span_tension" else getattr(result, group)
    if held is None:
        raise ValueError(f"{output}: this drive has no {group}")
    values = np.asarray(getattr(held, name or output)[rows], dtype=float)
    names, unit = _columns(result, output, by)
    if values.ndim == 3:  # forces in x and y
        values = np.linalg.norm(values, axis=-1)
    if by in given:
        column = _column(result, by, given[by], names)
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
    words = {"span_tension": "tension", "pulleys.load": "hub load"}.get(output, output)
    unit_of = unit[column] if isinstance(unit, list) else unit
    return Signal(f"{words} of {names[column]}", unit_of, chosen)


def _columns(result: Result, output: str, by: str) -> tuple[list[str], str | list[str]]:
    """Give what the columns of an output are called, and their unit or units."""
    params = result.params
    pulleys, n = params.pulley_names, len(params.pulley_names)
    if by == "span":
        return [
            "span " + span_name(k, pulleys, unnamed=f"{k} to {(k + 1) % n}") for k in range(n)
        ], "N"
    if by == "mount":
        arms = [isinstance(params.pulleys[k].mount, Arm) for k in params.mounted]
        end = output.rpartition(".")[2]
        of_arm, other = {"travel": ("rad", "m"), "travel_speed": ("rad/s", "m/s")}.get(
            end, ("N m", "N")
        )
        return [pulleys[k] for k in params.mounted], [of_arm if arm else other for arm in arms]
    group, _, name = output.partition(".")
    unit = _UNITS[group].get(name, "1")
    if group == "couplings":
        return [pulleys[k] for k in params.coupled], unit
    if by == "pulley":
        return list(pulleys), unit
    return [f"{by} {k}" for k in range(params.belt.n_bodies)], unit


def _column(result: Result, by: str, value: object, names: list[str]) -> int:
    pulleys = result.params.pulley_names
    if by == "mount":
        index = index_of(by, value, pulleys) if isinstance(value, str) else None
        if index is not None:
            if index not in result.params.mounted:
                raise ValueError(f"mount: {pulleys[index]} has none")
            return list(result.params.mounted).index(index)
    elif by == "span" and isinstance(value, str) and not value.isdecimal():
        spans = [name.removeprefix("span ") for name in names]
        asked = value.removeprefix("span ")
        if asked in spans:
            return spans.index(asked)
        if value not in pulleys:
            raise ValueError(
                f"span: no span is called {shown(value)}{close_to(asked, spans)}; there are "
                f"{', '.join(spans)}, also by the pulley before each"
            )
        return pulleys.index(value)
    elif by in ("span", "pulley"):
        return index_of(by, value, pulleys)
    return index_of(by, value, names)
