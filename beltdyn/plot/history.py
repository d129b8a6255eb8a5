"""Speeds, torques, tensions and joints over time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes

from ..base.checks import Array
from ..base.naming import span_name
from ..result.result import Result
from . import style
from .select import Indices, Pulleys, indices, pulley_indices, with_samples

__all__ = [
    "joint_deformation",
    "joint_force",
    "lines",
    "pulley_lines",
    "span_tensions",
    "speeds",
    "torques",
]

_TIME = "time [s]"


def lines(ax: Axes, curves: Iterable[tuple[int, str, Array, Array]], given: dict[str, Any]) -> None:
    """Draw curves of (style, name, x, y); ``given`` goes to ``plot``.

    A ``label`` replaces the name of a single curve and stands before those of several.
    """
    chosen = list(curves)
    for k, name, x, y in chosen:
        label = given.get("label", name)
        if "label" in given and len(chosen) > 1 and label is not None:
            label = f"{label}, {name}"
        look = style.line_style(style.unused(ax, k)) | {"linewidth": 1.2}
        # matplotlib knows some keywords by two names.
        short = {"color": "c", "linestyle": "ls", "linewidth": "lw"}
        look = {key: value for key, value in look.items() if short[key] not in given}
        ax.plot(x, y, **(look | given | {"label": label}))


def _over_time(
    result: Result,
    columns: list[int],
    values: Array,
    names: list[str],
    ylabel: str,
    ax: Axes | None,
    given: dict[str, Any],
    *,
    fixed_styles: bool = True,
) -> Axes:
    """Draw a line per column; with ``fixed_styles`` a column has the same style in every figure."""
    ax = style.axes(ax)
    lines(
        ax,
        [
            (column if fixed_styles else k, name, result.t, values[:, column])
            for k, (column, name) in enumerate(zip(columns, names, strict=True))
        ],
        given,
    )
    style.dress(ax, _TIME, ylabel)
    style.legend(ax)
    return ax


def pulley_lines(
    result: Result,
    pulleys: Pulleys | None,
    values: Array,
    ax: Axes | None,
    given: dict[str, Any],
) -> tuple[Axes, list[int]]:
    """Draw a line for each pulley asked for, of values (n_t, n_p) over time; return their indices.

    Labels and the legend are left to the caller.
    """
    which = pulley_indices(pulleys, result.pulleys.names)
    names = [style.plain(result.pulleys.names[k]) for k in which]
    ax = style.axes(ax)
    lines(
        ax,
        [(k, name, result.t, values[:, k]) for k, name in zip(which, names, strict=True)],
        given,
    )
    return ax, which


def _pulleys(
    result: Result,
    pulleys: Pulleys | None,
    values: Array,
    ylabel: str,
    ax: Axes | None,
    given: dict[str, Any],
) -> Axes:
    ax, _ = pulley_lines(result, pulleys, values, ax, given)
    style.dress(ax, _TIME, ylabel)
    style.legend(ax)
    return ax


def speeds(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the angular velocities of the pulleys over time: Figs 7, 14 and 19 of the paper.

    Of pulleys with a coupling those of their shafts, and dotted those of their rims.

    Args:
        result: A run with at least one sample.
        pulleys: A pulley or several, by index or name; None: all.
        ax: Axes to draw into; None: those of a new figure.
        **line: For matplotlib's ``plot``. A ``label`` stands before the name of the pulley when
            there are several.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """
    result = with_samples(result)
    ax, which = pulley_lines(result, pulleys, result.pulleys.omega, ax, line)
    for c, k in enumerate(result.params.coupled):
        if k in which and result.couplings is not None:
            coupling = result.params.pulleys[k].coupling
            part = "rim" if coupling is None else coupling._part
            name = f"{part} of {style.plain(result.pulleys.names[k])}"
            look = line | {"linestyle": ":"}
            lines(ax, [(k, name, result.t, result.couplings.rim_speed[:, c])], look)
    style.dress(ax, _TIME, "angular velocity [rad/s]")
    style.legend(ax)
    return ax


def torques(
    result: Result, *, pulleys: Pulleys | None = None, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the set torques M_d of (2.12) over time: Figs 6 and 13 of the paper.

    Args:
        result: A run with at least one sample.
        pulleys: A pulley or several, by index or name; None: all.
        ax: Axes to draw into; None: those of a new figure.
        **line: For matplotlib's ``plot``, as in :func:`speeds`.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """
    result = with_samples(result)
    return _pulleys(result, pulleys, result.pulleys.torque, "set torque [N m]", ax, line)


def span_tensions(result: Result, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the mean tension of each free span over time; gaps where a span has no joint.

    Args:
        result: A run with at least one sample.
        ax: Axes to draw into; None: those of a new figure.
        **line: For matplotlib's ``plot``, as in :func:`speeds`.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """
    result = with_samples(result)
    pulleys, count = result.pulleys.names, len(result.pulleys.names)
    columns = list(range(count))
    names = [
        style.plain(span_name(k, pulleys, unnamed=f"span {k} to {(k + 1) % count}"))
        for k in columns
    ]
    return _over_time(result, columns, result.span_tension, names, "span tension [N]", ax, line)


def joint_force(result: Result, joint: Indices, *, ax: Axes | None = None, **line: Any) -> Axes:
    """Draw the force along joints (2.2) over time: Figs 8b and 15 of the paper.

    Args:
        result: A run with at least one sample.
        joint: Index or indices of joints, from 0; joint i is on the left of link i.
        ax: Axes to draw into; None: those of a new figure.
        **line: For matplotlib's ``plot``. A ``label`` stands before the name of the joint when
            there are several.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """
    result = with_samples(result)
    return _joints(result, joint, result.joints.force, "joint force [N]", ax, line)


def joint_deformation(
    result: Result, joint: Indices, *, ax: Axes | None = None, **line: Any
) -> Axes:
    """Draw the stretch of joints (2.2) over time, in mm: Fig. 8a of the paper.

    Args:
        result: A run with at least one sample.
        joint: Index or indices of joints, from 0; joint i is on the left of link i.
        ax: Axes to draw into; None: those of a new figure.
        **line: For matplotlib's ``plot``, as in :func:`joint_force`.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """
    result = with_samples(result)
    stretch = 1e3 * result.joints.deformation
    return _joints(result, joint, stretch, "joint deformation [mm]", ax, line)


def _joints(
    result: Result,
    joint: Indices,
    values: Array,
    ylabel: str,
    ax: Axes | None,
    given: dict[str, Any],
) -> Axes:
    which = indices("joint", joint, result.params.n_bodies)
    what = "cell" if result.params._belt_facts["flows"] else "joint"
    names = [f"{what} {k}" for k in which]
    return _over_time(result, which, values, names, ylabel, ax, given, fixed_styles=False)
