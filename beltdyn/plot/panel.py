"""A panel: curves over an axis, with labels, grid and legend; lines of a quantity over time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..base.checks import Array, close_to
from ..outputs.quantity import QUANTITIES, TIME
from ..result.result import Result
from . import style
from .select import Pulleys, pulley_indices, with_samples

_P = ParamSpec("_P")
_R = TypeVar("_R")

#: The number of its style, its name, x and y.
Curve = tuple[int, str, Array, Array]


def draws(
    *artists: type, to: Sequence[Callable[..., Any]] = (Axes.plot,)
) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Check the result that a function draws and its keywords, some of which matplotlib takes."""
    takers = artists or (Line2D,)
    setters = {name[4:] for one in takers for name in dir(one) if name[:4] == "set_"}
    theirs = setters.union(*(signature(one).parameters for one in to)) - {"args", "kwargs", "self"}

    def decorate(draw: Callable[_P, _R]) -> Callable[_P, _R]:
        own = signature(draw).parameters
        passed_on = any(one.kind is one.VAR_KEYWORD for one in own.values())
        known = [*own, *(theirs if passed_on else ())]
        nor = f", nor has {' and '.join(one.__name__ for one in takers)} of matplotlib"

        @wraps(draw)
        def checked(*args: _P.args, **given: _P.kwargs) -> _R:
            for name in given:
                if name not in known:
                    raise TypeError(
                        f"{draw.__name__} has no argument {name!r}{nor if passed_on else ''}"
                        f"{close_to(name, known)}"
                    )
            if "result" in own and (args or "result" in given):
                with_samples(args[0] if args else given["result"])
            return draw(*args, **given)

        return checked

    return decorate


def lines(ax: Axes, curves: Iterable[Curve], given: dict[str, Any]) -> None:
    """Draw curves of (style, name, x, y); ``given`` goes to ``plot``.

    A ``label`` replaces the name of a single curve and stands before those of several.
    """
    chosen = list(curves)
    for k, name, x, y in chosen:
        label = given.get("label", name)
        if "label" in given and len(chosen) > 1 and label is not None:
            label = f"{label}, {name}"
        look = style.line_style(style.unused(ax, k)) | {"linewidth": 1.2}
        style.draw_line(ax, x, y, look, given | {"label": label})


def panel(
    ax: Axes | None,
    curves: Iterable[Curve],
    given: dict[str, Any],
    x: str = TIME.axis(),
    y: str = "",
    more: Iterable[tuple[Curve, dict[str, Any]]] = (),
) -> Axes:
    """Draw curves into axes, or those of a new figure, with the labels ``x`` and ``y``.

    ``more``: curves with a look of their own.
    """
    ax = style.axes(ax)
    lines(ax, curves, given)
    for curve, look in more:
        lines(ax, [curve], given | look)
    style.dress(ax, x, y)
    style.legend(ax)
    return ax


def over_time(
    result: Result,
    quantity: str,
    columns: Sequence[tuple[int, int, str]],
    ax: Axes | None,
    given: dict[str, Any],
    scale: tuple[float, str] = (1.0, ""),
    more: Iterable[tuple[Curve, dict[str, Any]]] = (),
) -> Axes:
    """Draw columns of a quantity over time: of each its style, number and name.

    ``scale``: factor and unit in which it is shown.
    """
    row, (factor, unit) = QUANTITIES[quantity], scale
    held = getattr(result, row.group) if row.group else result
    values = getattr(held, row.field)
    values = values if factor == 1.0 else factor * values
    curves = [(k, name, result.t, values[:, column]) for k, column, name in columns]
    return panel(ax, curves, given, y=row.axis(unit), more=more)


def named_pulleys(result: Result, pulleys: Pulleys | None) -> list[tuple[int, int, str]]:
    """Return style, index and name of each pulley asked for, the same style in every figure."""
    names = result.pulleys.names
    return [(k, k, style.plain(names[k])) for k in pulley_indices(pulleys, names)]
