"""A panel: curves over an axis, with labels, grid and legend; what is checked of its arguments."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import wraps
from inspect import signature
from itertools import pairwise
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..base.checks import Array, close_to, integer, real
from ..base.described import share_texts
from ..base.naming import index_of
from ..drive.params import Params
from ..outputs.quantity import QUANTITIES, TIME
from ..result.labelled import places
from ..result.result import Result
from ..vibration import FrequencyResponse, Modes
from . import style

Indices = int | Sequence[int]
Pulleys = int | str | Sequence[int | str]
_P = ParamSpec("_P")
_R = TypeVar("_R")

#: What is drawn: by the name of the argument its class, and what makes it.
_DRAWN: dict[str, tuple[type, str]] = {
    "result": (Result, "simulate"),
    "modes": (Modes, "modes"),
    "response": (FrequencyResponse, "frequency_response"),
}
#: Texts of arguments that several functions have.
_ARGUMENTS = {
    "result": "A run with at least one sample.",
    "t": "Time [s], the nearest sample; None: the last.",
    "pulleys": "A pulley or several, by index or name; None: all.",
    "link": "Index or indices of links, from 0.",
    "joint": "Index or indices of joints, from 0; joint i is on the left of link i.",
    "colour": 'What colours the belt: "tension" (of a link, the mean of the joints at its ends), '
    '"friction" (mu; grey off the pulleys) or None.',
    "arcs": "Whether to mark, within the rims, where the belt sticks and where it slips; not for a "
    "drive without friction.",
    "links": "Links to highlight: an index, a sequence of them, {name: index} or None. One makes "
    "the motion of the belt visible; of an ALE belt it is a mark that goes with it, in the middle "
    "of this cell at first.",
    "limits": "Ends of the colour scale; None: least and largest tension of all that is shown, or "
    "the kinetic coefficient, to either side, for friction.",
    "slip_from": "A link counts as slipping from this share of full friction on, in (0, 1]; with a "
    "Stribeck curve that at its slip velocity.",
    "modes": "From :func:`beltdyn.modes`.",
    "k": "Which of them.",
    "scale": "Factor of the exaggeration.",
    "output": '"span_tension", or an array such as "pulleys.omega" or "joints.force".',
    "over": "The pulley whose speed counts, by name or index.",
    "span": 'For "span_tension": a span by its name, or by name or index of the pulley before it. '
    "Left out, as the ones below: what fluctuates most.",
    "pulley": "For outputs of pulleys, by name or index.",
    "mount": "For outputs of mounts, by the name of the pulley or by index.",
    "dataset": "The result of ``bd.sweep``.",
    "quantity": "Name of a variable of numbers in it.",
    "at": 'The values of all other dimensions, such as ``{"pulley": "alternator"}``.',
    "ax": "Axes to draw into; None: those of a new figure.",
    "line": "For matplotlib's ``plot``. A ``label`` stands before the names of several lines.",
}


class Curve(NamedTuple):
    """A line: the number of its style, its name, its points and a look of its own."""

    style: int
    name: str
    x: Array
    y: Array
    look: Mapping[str, Any] = {}


def draws(
    *artists: type, to: Sequence[Callable[..., Any]] = (Axes.plot,)
) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Check what a function draws and its keywords, some for matplotlib; complete its docstring."""
    takers = artists or (Line2D,)
    setters = {name[4:] for one in takers for name in dir(one) if name[:4] == "set_"}
    theirs = setters.union(*(signature(one).parameters for one in to)) - {"args", "kwargs", "self"}

    def decorate(draw: Callable[_P, _R]) -> Callable[_P, _R]:
        share_texts(draw, _ARGUMENTS)
        own = signature(draw).parameters
        first = next(iter(own))
        passed_on = any(one.kind is one.VAR_KEYWORD for one in own.values())
        known = [*own, *(theirs if passed_on else ())]
        nor = f", nor has {' and '.join(one.__name__ for one in takers)} of matplotlib"
        nor = nor if passed_on else ""

        @wraps(draw)
        def checked(*args: _P.args, **given: _P.kwargs) -> _R:
            for name in given:
                if name not in known:
                    hint = close_to(name, known) or f"; it takes {', '.join(own)}"
                    raise TypeError(f"{draw.__name__} has no argument {name!r}{nor}{hint}")
            if first in _DRAWN and (args or first in given):
                drawable(first, args[0] if args else given[first], *_DRAWN[first])
            return draw(*args, **given)

        return checked

    return decorate


def lines(ax: Axes, curves: Sequence[Curve], given: dict[str, Any]) -> None:
    """Draw curves; ``given`` goes to ``plot``.

    A ``label`` replaces the name of a single curve and stands before those of several.
    """
    for k, name, x, y, own in curves:
        label = given.get("label", name)
        if "label" in given and len(curves) > 1 and label is not None:
            label = f"{label}, {name}"
        look = style.line_style(style.unused(ax, k)) | {"linewidth": 1.2, **own}
        style.draw_line(ax, x, y, look, given | {"label": label})


def panel(
    ax: Axes | None,
    curves: Sequence[Curve],
    given: dict[str, Any],
    x: str = TIME.axis(),
    y: str = "",
) -> Axes:
    """Draw curves into axes, or those of a new figure, with the labels ``x`` and ``y``."""
    ax = style.axes(ax)
    lines(ax, curves, given)
    style.dress(ax, x, y)
    style.legend(ax)
    return ax


def over_time(
    result: Result,
    quantity: str,
    which: Pulleys | None,
    ax: Axes | None,
    given: dict[str, Any],
    unit: str = "",
    more: Sequence[Curve] = (),
) -> Axes:
    """Draw a quantity over time: of the pulleys, spans, joints or links asked for, None: all."""
    row, values = QUANTITIES[quantity], result._history(quantity)
    values = values if unit != "mm" else 1e3 * values
    asked = columns(result.params, row.dimensions[0], which)
    curves = [Curve(k, name, result.t, values[:, column]) for k, column, name in asked]
    return panel(ax, [*curves, *more], given, y=row.axis(unit))


def columns(params: Params, dimension: str, which: Pulleys | None) -> list[tuple[int, int, str]]:
    """Return style, index and name of what is asked for along a dimension, None: all of it.

    Pulleys and spans have the same style in every figure; joints and links of ALE belts are cells.
    """
    found, numbered = places(params)[dimension], dimension in ("joint", "link")
    word = "cell" if params._flows else dimension
    names = [f"{word} {k}" if numbered else style.plain(k) for k in found]
    known = () if numbered else params.pulley_names
    asked = range(len(names)) if which is None else which
    chosen = indices(dimension if numbered else "pulleys", asked, len(names), known)
    return [(n if numbered else k, k, names[k]) for n, k in enumerate(chosen)]


# --- What is to be drawn: results, samples, indices and options ----------------------------------


def drawable(name: str, value: object, cls: type, made_by: str) -> None:
    """Check that this is of a class; a result must have samples."""
    if not isinstance(value, cls):
        raise TypeError(
            f"{name} must be a {cls.__name__}, got {type(value).__name__}: draw what "
            f"bd.{made_by} returns"
        )
    if isinstance(value, Result) and value.t.size == 0:
        raise ValueError("result must hold at least one sample to be drawn")


def sample(result: Result, t: float | None) -> int:
    """Find the sample nearest to a time; the last one for None."""
    times = result.t
    if t is None:
        return times.size - 1
    time = real("t", t, "s")
    beyond = (times[-1] - times[0]) / max(times.size - 1, 1)
    if not times[0] - beyond <= time <= times[-1] + beyond:
        raise ValueError(
            f"t must lie within the samples, {times[0]:g} to {times[-1]:g} s, got {time:g} s"
        )
    return int(np.argmin(np.abs(times - time)))


def indices(name: str, value: object, count: int, names: Sequence[str] = ()) -> list[int]:
    """Check one index or a sequence of them, from 0 to ``count`` - 1, or one of ``names``."""

    def index(field: str, one: object) -> int:
        named = names and isinstance(one, str) and not one.isdecimal()
        return index_of(field, one, names) if named else integer(field, one, 0, count - 1)

    if isinstance(value, str) or not isinstance(value, Iterable):
        return [index(name, value)]
    found = [index(f"{name}[{k}]", one) for k, one in enumerate(value)]
    if not found:
        raise ValueError(f"{name} must hold at least one index, got none")
    return found


def named_links(links: Indices | Mapping[str, int] | None, params: Params) -> dict[str, int]:
    """Check links to highlight, with names or not; marks on an ALE belt are where cells were."""
    if links is None:
        return {}
    count = params.n_bodies
    if isinstance(links, Mapping):
        last = count - 1
        return {str(name): integer(f"links[{name!r}]", k, 0, last) for name, k in links.items()}
    name = "belt of cell" if params._flows else "link"
    return {f"{name} {k}": k for k in indices("links", links, count)}


def choice(name: str, value: object, options: Sequence[str | None]) -> None:
    """Check an option against those allowed."""
    if not (value is None or isinstance(value, str)) or value not in options:
        words = ", ".join(repr(option) for option in options)
        raise ValueError(f"{name} must be one of {words}, got {reprlib.repr(value)}")


def runs(values: Any) -> Iterator[tuple[int, int, int]]:
    """Yield begin, end and value of every run of equal values."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    for begin, end in pairwise(edges):
        yield begin, end, int(values[begin])
