"""The tension of free spans, from the forces of the joints and from what touches the pulleys."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from . import _core
from .checks import Array
from .params import Params

__all__ = [
    "Coordinates",
    "coordinates",
    "has_angles",
    "joint_points",
    "mid_span",
    "span_tension",
]


def span_tension(touched: NDArray[np.int32], force: Array, n_pulleys: int) -> Array:
    """Give the mean joint force of the free span that follows each pulley (n_t, n_p) [N].

    Only joints between two links that touch nothing count, of a span with a single such link the
    joint before it, and not where links have lifted off within a wrap. Those where a belt with
    bending stiffness runs off a pulley, EI / (2 r^2) below the middle of the span at most, are
    among them; :func:`mid_span` gives the middle.

    Args:
        touched: The pulley that each link touches, or -1 (n_t, n_b).
        force: Force in the joint on the left of each link (n_t, n_b) [N].
        n_pulleys: Number of pulleys, n_p.

    Returns:
        NaN where a span has no such joint.
    """
    return _core.span_tension(np.asarray(touched, dtype=np.int32), force, n_pulleys)


class Line(Protocol):
    """Coordinates of the links (n_t, n_b): of a run, or of a part of it."""

    @property
    def x(self) -> Array:
        """Mass centre [m]."""

    @property
    def y(self) -> Array:
        """Mass centre [m]."""

    @property
    def phi(self) -> Array:
        """Angle [rad]."""


class Coordinates(NamedTuple):
    """Coordinates of the links at some samples, each (n_t, n_b): x, y [m], phi [rad]."""

    x: Array
    y: Array
    phi: Array


def coordinates(params: Params, belt: Line, rows: slice) -> Coordinates:
    """Give those of some samples; phi is not asked for where no place depends on it."""
    x, y = belt.x[rows], belt.y[rows]
    return Coordinates(x, y, belt.phi[rows] if has_angles(params) else np.zeros_like(x))


def has_angles(params: Params) -> bool:
    """Tell whether the belt's nodes have angles of their own: links have, point masses have not."""
    return "phi" in params._belt_facts["fields"]


def joint_points(params: Params, belt: Line) -> Array:
    """Give where the joints are, each on the left of its link (n_t, n_b, 2) [m].

    Between the right end of link i - 1 and the left end of link i; of point masses the middle of
    the bar between them.
    """
    centre = np.stack([belt.x, belt.y], axis=-1)
    half = 0.5 * params.info["link_length"] if has_angles(params) else 0.0
    tip = half * np.stack([np.cos(belt.phi), np.sin(belt.phi)], axis=-1)
    return np.asarray(0.5 * (centre - tip + np.roll(centre + tip, 1, axis=1)))


def mid_span(params: Params, belt: Line, force: Array) -> Array:
    """Give the joint force in the middle of the free span after each pulley (n_t, n_p) [N].

    Of the places where the belt crosses the plane through the middle of the span's tangent, across
    it, the nearest counts.

    Args:
        params: The drive; the tangents are those of ``params.route``.
        belt: Coordinates of the links at the samples.
        force: Force in the joint on the left of each link (n_t, n_b) [N].

    Returns:
        NaN where the belt does not cross the plane; of a drive with one pulley the mean of all
        joints.
    """
    n_p = len(params.pulleys)
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
