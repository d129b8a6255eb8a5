"""Speeds, torques, tensions and joints over time."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from ..base.naming import span_names
from ..outputs.quantity import SPANS
from ..result.result import Result
from . import style
from .panel import named_pulleys, over_time, passes_on
from .select import Indices, Pulleys, indices, with_samples

__all__ = [
    "joint_deformation",
    "joint_force",
    "span_tensions",
    "speeds",
    "torques",
]


@passes_on()
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
    columns = named_pulleys(result, pulleys)
    which = [k for k, *_ in columns]
    rims = []
    for c, k in enumerate(result.params.coupled):
        if k in which and result.couplings is not None:
            coupling = result.params.pulleys[k].coupling
            part = "rim" if coupling is None else coupling._part
            name = f"{part} of {style.plain(result.pulleys.names[k])}"
            rim = (k, name, result.t, result.couplings.rim_speed[:, c])
            rims.append((rim, {"linestyle": ":"}))
    return over_time(result, "pulleys.omega", columns, ax, line, more=rims)


@passes_on()
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
    return over_time(result, "pulleys.torque", named_pulleys(result, pulleys), ax, line)


@passes_on()
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
    names = span_names(result.pulleys.names, "span {} to {}")
    columns = [(k, k, style.plain(name)) for k, name in enumerate(names)]
    return over_time(result, SPANS, columns, ax, line)


@passes_on()
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
    return over_time(result, "joints.force", _joints(result, joint), ax, line)


@passes_on()
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
    columns = _joints(result, joint)
    return over_time(result, "joints.deformation", columns, ax, line, (1e3, "mm"))


def _joints(result: Result, joint: Indices) -> list[tuple[int, int, str]]:
    """Return style, number and name of each joint asked for, in the order of the styles."""
    what = "cell" if result.params._belt_facts["flows"] else "joint"
    which = indices("joint", joint, result.params.n_bodies)
    return [(n, k, f"{what} {k}") for n, k in enumerate(which)]
