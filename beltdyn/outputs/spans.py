"""The tension of free spans, from the forces of the joints and from what touches the pulleys."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..drive.params import Params

__all__ = [
    "Coordinates",
    "coordinates",
    "has_angles",
    "joint_points",
    "lines_of_cells",
    "mid_span",
    "of_spans",
    "span_tension",
]


#: Points of the line of a cell.
_POINTS = 21


def span_tension(touched: NDArray[np.int32], force: Array, n_pulleys: int) -> Array:
    """Return the mean joint force of the free span that follows each pulley (n_t, n_p) [N].

    Only joints between two links that touch nothing count, of a span with a single such link the
    joint before it, and not where links have lifted off within a wrap. Those where a belt with
    bending stiffness runs off a pulley, EI / (2 r^2) below the middle of the span at most, are
    among them; :func:`mid_span` gives the middle.
    """
    return _core.span_tension(np.asarray(touched, dtype=np.int32), force, n_pulleys)


class Line(Protocol):
    """Coordinates of the links (n_t, n_b): of a run, or of a part of it."""

    @property
    def x(self) -> Array: ...
    @property
    def y(self) -> Array: ...
    @property
    def phi(self) -> Array: ...


class Coordinates(NamedTuple):
    """Coordinates of the links at some samples, each (n_t, n_b): x, y [m], phi [rad]."""

    x: Array
    y: Array
    phi: Array


def coordinates(params: Params, belt: Line, rows: slice) -> Coordinates:
    """Return the coordinates at some samples; phi only where places depend on it."""
    x, y = belt.x[rows], belt.y[rows]
    return Coordinates(x, y, belt.phi[rows] if has_angles(params) else np.zeros_like(x))


def has_angles(params: Params) -> bool:
    """Return whether the belt's nodes have angles: links have, point masses have not."""
    return "phi" in params._belt_facts["fields"]


def joint_points(params: Params, belt: Line) -> Array:
    """Return where the joints are, each on the left of its link (n_t, n_b, 2) [m].

    Between the right end of link i - 1 and the left end of link i; of point masses the middle of
    the bar between them.
    """
    centre = np.stack([belt.x, belt.y], axis=-1)
    half = 0.5 * params.info["link_length"] if has_angles(params) else 0.0
    tip = half * np.stack([np.cos(belt.phi), np.sin(belt.phi)], axis=-1)
    return np.asarray(0.5 * (centre - tip + np.roll(centre + tip, 1, axis=1)))


def of_spans(params: Params, force: Array) -> Array:
    """Return the tension of each span of an ALE belt (n_t, n_p), from that of all cells."""
    return np.asarray(force[:, np.flatnonzero(params._cells < 0)])


def lines_of_cells(
    params: Params, points: Array, axes: Array, deflection: Array | None
) -> list[Array]:
    """Return the line of each cell of an ALE belt: arcs on pulleys, sine modes in spans [m]."""
    ends, found, span = np.roll(points, -1, axis=0), [], 0
    share = np.linspace(0.0, 1.0, _POINTS)[:, None]
    for begin, end, k in zip(points, ends, params._cells, strict=True):
        if k >= 0:
            arms = np.stack([begin, end]) - axes[k]
            (r0, r1), (a0, a1) = np.hypot(*arms.T), np.arctan2(*arms.T[::-1])
            turn = a0 + share[::5] * ((a1 - a0 + np.pi) % (2.0 * np.pi) - np.pi)
            radius = r0 + share[::5] * (r1 - r0)
            found.append(axes[k] + radius * np.hstack([np.cos(turn), np.sin(turn)]))
            continue
        line = begin + share * (end - begin)
        if deflection is not None:
            along = (end - begin) / np.linalg.norm(end - begin)
            outwards = params.route.senses[0] * np.array([along[1], -along[0]])
            modes = np.arange(1, 1 + deflection.shape[1])
            line = line + np.sin(np.pi * share * modes) @ deflection[span][:, None] * outwards
        found.append(line)
        span += 1
    return found


def mid_span(params: Params, belt: Line, force: Array) -> Array:
    """Return the joint force in the middle of the free span after each pulley (n_t, n_p) [N].

    Of the places where the belt crosses the plane through the middle of the span's tangent, across
    it, the nearest counts.
    """
    n_p = len(params.pulleys)
    if params._belt_facts["flows"]:
        return of_spans(params, force)
    if n_p == 1:
        return np.asarray(force.mean(axis=1, keepdims=True))
    x, y = np.moveaxis(joint_points(params, belt), -1, 0)
    tension = np.full((x.shape[0], n_p), np.nan)
    rows = np.arange(x.shape[0])
    begin, end = params.route.leave, np.roll(params.route.arrive, -1, axis=0)
    for k in range(n_p):
        mid_x, mid_y = 0.5 * (begin[k] + end[k])
        tx, ty = (end[k] - begin[k]) / np.linalg.norm(end[k] - begin[k])
        nx, ny = -ty, tx
        along = (x - mid_x) * tx + (y - mid_y) * ty
        across = np.abs((x - mid_x) * nx + (y - mid_y) * ny)
        after = np.roll(along, -1, axis=1)
        crossing = (along <= 0.0) & (after > 0.0)
        first = np.argmin(np.where(crossing, across, np.inf), axis=1)
        second = (first + 1) % x.shape[1]
        s0, s1 = along[rows, first], after[rows, first]
        there = crossing[rows, first]
        part = np.divide(-s0, s1 - s0, out=np.zeros_like(s0), where=there)
        value = (1.0 - part) * force[rows, first] + part * force[rows, second]
        tension[there, k] = value[there]
    return tension
