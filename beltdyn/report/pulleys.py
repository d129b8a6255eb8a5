"""Rows of the pulleys: motion, power, hub loads, arcs, tensions, margin to slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.checks import Array
from ..drive.couplings import OverrunningClutch
from .hubs import by_spans, hub_load
from .rows import PulleyRow
from .slipping import slips_of
from .window import OF_ARCS, Window


def pulley_rows(window: Window, statics: Array | None, margins: bool = True) -> list[PulleyRow]:
    """Return the rows, with hub loads by the spans; note what is missing in them."""
    run, names = window.run, window.params.pulley_names
    rows, has_arcs = [], not window.missing(OF_ARCS)
    for k, (name, slips) in enumerate(zip(names, slips_of(window, margins), strict=True)):
        found = _motion(window, k) | _contact(window, k) | slips
        found |= hub_load(window, statics, k) if run._has("pulleys.load") else {}
        found |= _arcs(window, k) if has_arcs else {}
        if "slip_arc" in found:
            returning = float(window.mean(window.arcs.returning[:, k]))
            found["slip_error"] = _slip_error(found, returning)
        rows.append(PulleyRow(name=name, prescribed=name in run.prescribed, **found))
    of_contact = [name for k, name in enumerate(names) if not by_spans(statics, k)]
    if run._has("pulleys.load") and of_contact:
        window.notes.append(
            f"hub load of {', '.join(of_contact)}: from the contact, because tensions or axes are "
            "not known; its range holds the blows of links that land, of the mesh"
        )
    return rows


def _slip_error(found: dict[str, Any], returning: float) -> float:
    """Return the error of the arc of slip [rad]: a quarter of a link, plus that of landings."""
    # Where the belt creeps back all friction in use is missing from the arc, and below 95 %
    # elsewhere on the wrap for a quarter of the time; right to a factor of three on steady drives.
    wrap = found["wrap"]
    in_use = min(found.get("used", 1.0), 1.0) * wrap
    away = abs(in_use - found["slip_arc"])
    return float(0.25 * wrap / found["links"] + min(1.0, 4.0 * returning) * away)


def _motion(window: Window, k: int) -> dict[str, Any]:
    """Return speed, torque, power, and what a coupling does."""
    kept = {"speed": window.column("pulleys.omega", k)}
    kept["torque"] = window.column("pulleys.torque", k)
    if kept["speed"] is not None and kept["torque"] is not None:
        kept["power"] = kept["torque"] * kept["speed"]
    handed = None
    if k in window.params.coupled:
        c = window.params.coupled.index(k)
        kept |= {one: window.column(f"couplings.{one}", c) for one in ("rim_speed", "windup")}
        if isinstance(window.params.pulleys[k].coupling, OverrunningClutch):
            handed = window.column("couplings.transmitted", c)
    found: dict[str, Any] = {
        name: window.spread(one) for name, one in kept.items() if one is not None
    }
    if handed is not None:
        found["overruns"] = float(window.mean((handed == 0.0).astype(float)))
    return found


def _contact(window: Window, k: int) -> dict[str, Any]:
    """Return the torque of the belt on a pulley, and the range of the share that slips."""
    params, touching = window.params, window.touching
    if touching is None or (window.lost_mounts and k in params.mounted):
        return {}
    found: dict[str, Any] = {"belt_torque": float(window.mean(touching.torques[:, k]))}
    if window.run._has("belt.x") and params.friction_on(k) is not None:
        slip, wrap = window.arcs.slip[:, k], window.arcs.wrap[:, k]
        share = np.divide(slip, wrap, out=np.full_like(wrap, np.nan), where=wrap > 0.0)
        found["slip_range"] = window.spread(window.smoothed(share, window.passing))
    return found


def _arcs(window: Window, k: int) -> dict[str, Any]:
    """Return wrap and slip of a pulley: the share that slips, by :class:`beltdyn.Arcs`."""
    params, way = window.params, window.route
    found: dict[str, Any] = {}
    if way is not None:
        wrap = float(way.wraps[k])
        links = wrap * params.pulleys[k].radius / float(params.info["link_length"])
        if params._flows:
            links = float(np.count_nonzero(params._cells == k))
        found = {"wrap": wrap, "links": links}
    elif k in params.mounted:
        return {}
    touched = float(window.mean(window.arcs.wrap[:, k]))
    if params.friction_on(k) is None or touched == 0.0:
        return found
    share = float(window.mean(window.arcs.slip[:, k])) / touched
    found["slip_share"] = share
    if way is not None:
        found["slip_arc"] = share * wrap
    return found
