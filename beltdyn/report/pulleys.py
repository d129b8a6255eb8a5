"""Rows of the pulleys: motion, power, hub loads, arcs, tensions, margin to slip."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from ..drive.couplings import OverrunningClutch
from .rows import PulleyRow, Spread
from .slipping import slip_rows
from .touching import Touching
from .window import OF_ARCS, Window, missing

__all__ = ["pulley_rows", "spread"]

#: Share of the tension at rest: a force below it is rounding, and has no direction.
NEGLIGIBLE_FORCE = 1e-6


def spread(window: Window, samples: Array, passing: float = 0.0) -> Spread | None:
    """Return mean, least and largest of samples (n_w,); None if all are missing.

    The ends are those of running means over ``passing`` [s], if it is > 0.
    """
    smooth = window.smoothed(samples[:, None], passing)[:, 0]
    there = smooth[~np.isnan(smooth)]
    if there.size == 0:
        return None
    return Spread(float(window.mean(samples)), float(there.min()), float(there.max()))


def pulley_rows(
    window: Window, touching: Touching | None, driver: int | None, margins: bool = True
) -> list[PulleyRow]:
    """Return the rows; note what is missing in them."""
    params, run = window.params, window.run
    rows = [PulleyRow(name=name, prescribed=name in run.prescribed) for name in params.pulley_names]
    for names, of in (
        ((), _motion),
        (("pulleys.load",), _hub_loads),
        (OF_ARCS, _arcs),
        ((), _coupling),
    ):
        if not missing(run, names):
            rows = [attrs.evolve(row, **of(window, k)) for k, row in enumerate(rows)]
    if touching is not None:
        rows = [attrs.evolve(row, **_contact(window, touching, k)) for k, row in enumerate(rows)]
        rows = slip_rows(window, touching, driver, rows, margins)
    for k, row in enumerate(rows):
        if row.slip_arc is not None:
            returning = float(window.mean(window.arcs.returning[:, k]))
            rows[k] = attrs.evolve(row, slip_error=_slip_error(row, returning))
    return rows


def _slip_error(row: PulleyRow, returning: float) -> float:
    """Return the error of the arc of slip [rad]: a quarter of a link, and the effect of landings.

    All of the friction in use is gone from the arc, and below 95 % elsewhere on the wrap, where the
    belt creeps back for a quarter of the time; right to a factor of three on steady drives.
    """
    arc, wrap, links = row.slip_arc or 0.0, row.wrap or 0.0, row.links or math.inf
    in_use = wrap if row.used is None else min(row.used, 1.0) * wrap
    return 0.25 * wrap / links + min(1.0, 4.0 * returning) * abs(in_use - arc)


def _motion(window: Window, k: int) -> dict[str, Any]:
    run = window.run
    kept = {
        name: window.of(getattr(run.pulleys, output))[:, k]
        for name, output in (("speed", "omega"), ("torque", "torque"))
        if run._has(f"pulleys.{output}")
    }
    if len(kept) == 2:
        kept["power"] = kept["torque"] * kept["speed"]
    return {name: spread(window, samples) for name, samples in kept.items()}


def _coupling(window: Window, k: int) -> dict[str, Any]:
    params, run = window.params, window.run
    if run.couplings is None or k not in params.coupled:
        return {}
    c = params.coupled.index(k)
    found: dict[str, Any] = {}
    for name in ("rim_speed", "windup"):
        if run._has(f"couplings.{name}"):
            found[name] = spread(window, window.of(getattr(run.couplings, name))[:, c])
    clutch = isinstance(params.pulleys[k].coupling, OverrunningClutch)
    if clutch and run._has("couplings.transmitted"):
        free = window.of(run.couplings.transmitted)[:, c] == 0.0
        found["overruns"] = float(window.mean(free.astype(float)))
    return found


def _hub_loads(window: Window, k: int) -> dict[str, Any]:
    load = window.of(window.run.pulleys.load)[:, k]
    hub = spread(window, np.hypot(load[:, 0], load[:, 1]))
    x, y = window.mean(load)
    if math.hypot(x, y) < NEGLIGIBLE_FORCE * float(window.params.info["strain_tension"]):
        return {"hub_load": hub}
    return {"hub_load": hub, "hub_direction": math.atan2(y, x)}


def _contact(window: Window, touching: Touching, k: int) -> dict[str, Any]:
    """Return the torque of the belt on a pulley."""
    if window.lost_mounts and k in window.params.mounted:
        return {}
    found: dict[str, Any] = {"belt_torque": float(window.mean(touching.torques[:, k]))}
    if window.run._has("belt.x") and window.params.friction_on(k) is not None:
        arcs = window.arcs
        share = np.divide(
            arcs.slip, arcs.wrap, out=np.full_like(arcs.wrap, np.nan), where=arcs.wrap > 0.0
        )[:, k, None]
        smooth = spread(window, window.smoothed(share, touching.passing(window))[:, 0])
        found["slip_range"] = smooth
    return found


def _arcs(window: Window, k: int) -> dict[str, Any]:
    """Return wrap and slip of a pulley: the share that slips, by :class:`beltdyn.Arcs`."""
    params, way = window.params, window.route()
    found: dict[str, Any] = {}
    if way is not None:
        wrap = float(way.wraps[k])
        length = wrap * params.pulleys[k].radius
        found = {"wrap": wrap, "links": length / float(params.info["link_length"])}
        if params._belt_facts["flows"]:
            found["links"] = float(np.count_nonzero(params._cells == k))
    elif k in params.mounted:
        return {}
    arcs = window.arcs
    touched = float(window.mean(arcs.wrap[:, k]))
    if params.friction_on(k) is None or touched == 0.0:
        return found
    share = float(window.mean(arcs.slip[:, k])) / touched
    found["slip_share"] = share
    if way is not None:
        found["slip_arc"] = share * wrap
    return found
