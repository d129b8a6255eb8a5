"""Hub loads from the pull of the spans, without single links that land; what acts on mounts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.checks import Array
from ..drive.mounts import Sprung
from ..drive.span import Span
from ..outputs.orders import belt_turning
from ..outputs.places import force_on_pulleys, routes
from .rows import MountRow, Spread
from .span_rows import line_of
from .window import Window

#: Share of the tension at rest: a force below it is rounding, and has no direction.
NEGLIGIBLE_FORCE = 1e-6
#: Least amplitude of a line in the travel, of a turn of one radian or of the pulley's radius: below
#: it is what rounding and tolerances leave.
MIN_AMPLITUDE = 1e-6
_FORCES = ("spring", "damper", "friction", "stop", "belt")


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


# --- Arms, sliders and paths ----------------------------------------------------------------------


def mount_rows(window: Window, statics: Array | None) -> list[MountRow]:
    """Return the rows; note what is missing in them."""
    params = window.params
    if not params.mounted:
        return []
    window.lacks("mounts", "mounts.travel", *(f"mounts.{force}_force" for force in _FORCES))
    rows = []
    for m, k in enumerate(params.mounted):
        mount, name = params.effective_pulleys[k].mount, params.pulley_names[k]
        assert mount is not None
        row: dict[str, Any] = {"name": name, "kind": mount._row.name}
        if window.travels is not None:
            travel = window.travels[:, m]
            if not isinstance(mount, Sprung):
                drawn = np.array(params.pulleys[k].center)
                travel = np.hypot(*(window.centers[:, k] - drawn).T)
            elif mount.stops is not None:
                low, high = mount.stops
                row["to_stop"] = window.spread(np.minimum(travel - low, high - travel))
            row["travel"] = window.spread(travel)
            least = MIN_AMPLITUDE * (1.0 if mount._row.angle else params.pulleys[k].radius)
            row |= line_of(window, travel, least)
        if isinstance(mount, Sprung):
            there = (
                mount.stiffness or mount.spring_force or mount._hung,
                mount.damping,
                mount.friction,
                mount.stops is not None,
                True,
            )
            for force, has in zip(_FORCES, there, strict=True):
                samples = window.column(f"mounts.{force}_force", m) if has else None
                if samples is not None:
                    row[force] = window.spread(samples)
            if "belt" in row and window.travels is not None and statics is not None:
                along = mount._directions(window.centers[:, k])
                pull = np.array([a @ load for a, load in zip(along, statics[:, k], strict=True)])
                row["belt"] = _without_blows(window, row["belt"], pull)
        rows.append(MountRow(**row))
    return rows


def _without_blows(window: Window, of_contact: Spread, pull: Array) -> Spread:
    """Take the mean from the contact, which is exact, and the range from the pull of the spans."""
    swing = window.spread(pull, window.passing)
    if swing is None or np.isnan(pull).any():
        return of_contact
    mean = of_contact.mean
    return Spread(mean, mean + swing.least - swing.mean, mean + swing.most - swing.mean)
