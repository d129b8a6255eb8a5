"""Hub loads from the pull of the spans, without the forces of single links that land."""

from __future__ import annotations

import attrs
import numpy as np

from ..base.checks import Array
from ..drive.span import Span
from ..outputs.orders import belt_turning
from ..outputs.places import routes
from ..outputs.spans import Coordinates, mid_span, of_spans
from .pulleys import spread
from .rows import PulleyRow
from .window import Window, missing

__all__ = ["hub_statics", "middles", "with_hub_loads"]

_OF_MIDDLE = ("belt.x", "belt.y", "belt.phi", "joints.force")


def middles(window: Window) -> Array | None:
    """Return the tension in the middle of each span (n_w, n_p) [N]; None: outputs are missing.

    NaN where the belt is not there, as in a span shorter than a link.
    """
    run = window.run
    if window.params._belt_facts["flows"]:
        if missing(run, ("joints.force",)):
            return None
        return of_spans(window.params, window.of(run.joints.force))
    if missing(run, _OF_MIDDLE):
        return None
    part = Coordinates(*(window.of(one) for one in (run.belt.x, run.belt.y, run.belt.phi)))
    return mid_span(window.params, part, window.of(run.joints.force))


def hub_statics(window: Window) -> Array | None:
    """Return the force of the belt on each pulley, between the middles of its two spans.

    (T_1 - rho v^2) d_1 + (T_2 - rho v^2) d_2 by the tensions there and the directions of the belt
    line, at every sample, and the weight of that belt. The forces of contact, ``pulleys.load``,
    come to the same mean as links get shorter; but with every link that lands or leaves they swing
    by what is of the mesh, the more the fewer links there are.
    """
    params = window.params
    tension = middles(window)
    turning = belt_turning(window.run, window.rows)
    travels = window.travels()
    if tension is None or turning is None or len(params.pulleys) == 1:
        return None
    if params.mounted and travels is None:
        return None
    lines, _ = routes(params, travels)
    way = np.array([one._ways for one in lines])
    spans = np.array([one.spans for one in lines])
    span = Span(params.belt, tension, turning[:, None] * float(params.info["length"]))
    pull = span.pull[..., None] * (way / spans[..., None])
    load = pull - np.roll(pull, 1, axis=1)
    if np.any(params.gravity):
        arcs = np.array([one.wraps for one in lines]) * params._radii
        half, density = 0.5 * spans, params.belt.linear_density
        mass = density * (half + np.roll(half, 1, axis=1) + arcs) / np.nanmean(span.stretch)
        load = load + mass[..., None] * np.array(params.gravity)
    return np.asarray(load)


def with_hub_loads(
    window: Window, rows: list[PulleyRow], statics: Array | None, passing: float
) -> list[PulleyRow]:
    """Take the hub loads from the spans; note where they are still those of the contact.

    Ranges are of running means over ``passing``, the time in which a link passes [s].
    """
    found, kept = [], []
    for k, row in enumerate(rows):
        if row.hub_load is not None and (statics is None or np.isnan(statics[:, k]).any()):
            kept.append(row.name)
        elif row.hub_load is not None and statics is not None:
            load = spread(window, np.hypot(*statics[:, k].T), passing)
            x, y = window.mean(statics[:, k])
            row = attrs.evolve(row, hub_load=load, hub_direction=float(np.arctan2(y, x)))
        found.append(row)
    if kept:
        window.notes.append(
            f"hub load of {', '.join(kept)}: from the contact, because tensions or axes are not "
            "known; its range holds the blows of links that land, of the mesh"
        )
    return found
