"""Hub loads from the pull of the spans, without the forces of single links that land."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.checks import Array
from ..drive.span import Span
from ..outputs.orders import belt_turning
from ..outputs.places import force_on_pulleys, routes
from .window import Window

#: Share of the tension at rest: a force below it is rounding, and has no direction.
NEGLIGIBLE_FORCE = 1e-6


def hub_statics(window: Window) -> Array | None:
    """Return the force of the belt on each pulley, between the middles of its two spans.

    (T_1 - rho v^2) d_1 + (T_2 - rho v^2) d_2 by the tensions there and the directions of the belt
    line, at every sample, and the weight of that belt. The forces of contact, ``pulleys.load``,
    come to the same mean as links get shorter; but with every link that lands or leaves they swing
    by what is of the mesh, the more the fewer links there are.
    """
    params, tension = window.params, window.middles
    turning = belt_turning(window.run, window.rows)
    if tension is None or turning is None or len(params.pulleys) == 1 or window.lost_mounts:
        return None
    lines, _ = routes(params, window.travels)
    span = Span(params.belt, tension, turning[:, None] * float(params.info["length"]))
    load = force_on_pulleys(lines, span.pull)
    if np.any(params.gravity):
        arcs = np.array([one.wraps for one in lines]) * params._radii
        half = 0.5 * np.array([one.spans for one in lines])
        density = params.belt.linear_density
        mass = density * (half + np.roll(half, 1, axis=1) + arcs) / np.nanmean(span.stretch)
        load = load + mass[..., None] * np.array(params.gravity)
    return load


def hub_load(window: Window, statics: Array | None, k: int) -> dict[str, Any]:
    """Return a pulley's hub load and its direction: by the spans, without ripple, or contact."""
    load, passing, least = window.of(window.run.pulleys.load)[:, k], 0.0, NEGLIGIBLE_FORCE
    if by_spans(statics, k):
        assert statics is not None
        load, passing, least = statics[:, k], window.passing, 0.0
    found: dict[str, Any] = {"hub_load": window.spread(np.hypot(*load.T), passing)}
    x, y = window.mean(load)
    if math.hypot(x, y) >= least * float(window.params.info["strain_tension"]):
        found["hub_direction"] = math.atan2(y, x)
    return found


def by_spans(statics: Array | None, k: int) -> bool:
    """Whether the hub load of a pulley is known from its spans."""
    return statics is not None and not np.isnan(statics[:, k]).any()
