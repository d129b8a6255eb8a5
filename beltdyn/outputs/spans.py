"""The tension of free spans, from the forces of the joints and from what touches the pulleys."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..drive.params import Params
from .histories import BeltHistory

#: All samples of a run.
ALL = slice(None)
#: Points of the line of a cell.
_POINTS = 21


def span_tension(touched: NDArray[np.int32], force: Array, n_pulleys: int) -> Array:
    """Return :attr:`beltdyn.Result.span_tension`; :func:`mid_span` is without bends of its ends."""
    return _core.span_tension(np.asarray(touched, dtype=np.int32), force, n_pulleys)


def has_angles(params: Params) -> bool:
    """Return whether the belt's nodes have angles: links have, point masses have not."""
    return "phi" in params._belt_facts["fields"]


def joint_points(params: Params, belt: BeltHistory, rows: Any = ALL) -> Array:
    """Return where the joints are, each on the left of its link (n_t, n_b, 2) [m].

    Between the right end of link i - 1 and the left end of link i; of point masses the middle of
    the bar between them.
    """
    centre = np.stack([belt.x[rows], belt.y[rows]], axis=-1)
    tip = np.zeros(1)
    if has_angles(params):
        phi = belt.phi[rows]
        tip = 0.5 * params.info["link_length"] * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    return np.asarray(0.5 * (centre - tip + np.roll(centre + tip, 1, axis=1)))


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


def mid_span(params: Params, belt: BeltHistory, force: Array, rows: slice = ALL) -> Array:
    """Return the joint force in the middle of the free span after each pulley (n_t, n_p) [N].

    Of the places where the belt crosses the plane through the middle of the span's tangent, across
    it, the nearest counts; NaN where there is none. An ALE belt has one tension to a span.
    """
    n_p, force = len(params.pulleys), force[rows]
    if params._flows:
        return np.asarray(force[:, params._cells < 0])
    if n_p == 1:
        return np.asarray(force.mean(axis=1, keepdims=True))
    points = joint_points(params, belt, rows)
    tension = np.full((points.shape[0], n_p), np.nan)
    each = np.arange(points.shape[0])
    begin, end = params.route.leave, np.roll(params.route.arrive, -1, axis=0)
    for k in range(n_p):
        tx, ty = (end[k] - begin[k]) / np.linalg.norm(end[k] - begin[k])
        x, y = np.moveaxis(points - 0.5 * (begin[k] + end[k]), -1, 0)
        along, across = x * tx + y * ty, np.abs(y * tx - x * ty)
        after = np.roll(along, -1, axis=1)
        crossing = (along <= 0.0) & (after > 0.0)
        first = np.argmin(np.where(crossing, across, np.inf), axis=1)
        second = (first + 1) % x.shape[1]
        s0, s1 = along[each, first], after[each, first]
        there = crossing[each, first]
        part = np.divide(-s0, s1 - s0, out=np.zeros_like(s0), where=there)
        value = (1.0 - part) * force[each, first] + part * force[each, second]
        tension[there, k] = value[there]
    return tension
