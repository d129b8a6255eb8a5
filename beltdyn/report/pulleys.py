"""What a report says of the pulleys: motion, power, hub loads, arcs, tensions, margin to slip."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from ..checks import Array
from .margin import Steady, full_slip
from .rows import PulleyRow, Spread
from .touching import Touching
from .window import OF_ARCS, Window

__all__ = ["pulley_rows", "spread", "steady_state"]

#: A pulley whose torque changes the tension by less than this share of the mean one is an idler:
#: what the drag of its bearings takes is no torque that one would let grow.
IDLE = 0.01
#: Of the tension at rest: a force below it is rounding, and has no direction.
FAINT = 1e-6
#: A pulley that slips in full in the window: its used share is 1 but for the mesh and the samples.
FULL = 0.98


def spread(window: Window, samples: Array) -> Spread | None:
    """Give mean, least and largest of samples (n_w,); None if all are missing."""
    there = samples[~np.isnan(samples)]
    if there.size == 0:
        return None
    return Spread(float(window.mean(samples)), float(there.min()), float(there.max()))


def pulley_rows(
    window: Window, touching: Touching | None, driver: int | None
) -> tuple[list[PulleyRow], list[str]]:
    """Give the rows, and what is missing in them.

    Args:
        window: The part of the run.
        touching: Contact and friction in it, if known.
        driver: The driving pulley, if the belt turns.
    """
    params, run = window.params, window.run
    rows = [PulleyRow(name=name) for name in params.pulley_names]
    notes: list[str] = []
    for names, of in (
        (("pulleys.omega",), _speeds),
        (("pulleys.torque",), _torques),
        (("pulleys.omega", "pulleys.torque"), _powers),
        (("pulleys.load",), _hub_loads),
        (OF_ARCS, _arcs),
    ):
        if all(run._has(name) for name in names):
            rows = [attrs.evolve(row, **of(window, k)) for k, row in enumerate(rows)]
    if touching is not None:
        rows = [attrs.evolve(row, **_contact(window, touching, k)) for k, row in enumerate(rows)]
    tension = _tension(window)
    if tension is not None and touching is not None:
        rows = _ratios(window, touching, tension, rows, notes)
        if driver is not None:
            rows = _margins(window, touching, tension, driver, rows, notes)
    return rows, notes


def _speeds(window: Window, k: int) -> dict[str, Any]:
    return {"speed": spread(window, window.of(window.run.pulleys.omega)[:, k])}


def _torques(window: Window, k: int) -> dict[str, Any]:
    return {"torque": spread(window, window.of(window.run.pulleys.torque)[:, k])}


def _powers(window: Window, k: int) -> dict[str, Any]:
    pulleys = window.run.pulleys
    power = window.of(pulleys.torque)[:, k] * window.of(pulleys.omega)[:, k]
    return {"power": spread(window, power)}


def _hub_loads(window: Window, k: int) -> dict[str, Any]:
    load = window.of(window.run.pulleys.load)[:, k]
    hub = spread(window, np.hypot(load[:, 0], load[:, 1]))
    x, y = window.mean(load)
    if math.hypot(x, y) < FAINT * float(window.params.info["strain_tension"]):
        return {"hub_load": hub}
    return {"hub_load": hub, "hub_direction": math.atan2(y, x)}


def _contact(window: Window, touching: Touching, k: int) -> dict[str, Any]:
    """Give the torque of the belt on a pulley."""
    on = touching.pulley == k
    friction = np.where(on, touching.friction, 0.0)
    belt_torque = float(window.mean(np.sum(friction * touching.radius, axis=1)))
    return {"belt_torque": belt_torque}


def _arcs(window: Window, k: int) -> dict[str, Any]:
    """Give the arcs of contact and slip of a pulley, by the rule of :class:`beltdyn.arcs.Arcs`."""
    arcs = window.arcs
    wrap = float(window.mean(arcs.wrap[:, k]))
    if window.params.friction_on(k) is None or wrap == 0.0:
        return {"wrap": wrap}
    slip = float(window.mean(arcs.slip[:, k]))
    return {"wrap": wrap, "slip_arc": slip, "slip_share": slip / wrap}


def _tension(window: Window) -> Array | None:
    """Give the mean tensions of the spans (n_p,); None where one is not known."""
    spans = window.spans()
    if spans is None or spans.shape[1] < 2:
        return None
    mean = window.mean(spans)
    return None if np.isnan(mean).any() else mean


def _ratios(
    window: Window,
    touching: Touching,
    tension: Array,
    rows: list[PulleyRow],
    notes: list[str],
) -> list[PulleyRow]:
    """Add the ratios of tensions, against those of full slip."""
    params = window.params
    belt = params.belt
    mass = belt.linear_density * touching.speed**2
    pull = tension - mass * (1.0 + tension / belt.axial_stiffness)
    wraps, mu = window.route().wraps, params._slip_limits[0]
    found = []
    for k, row in enumerate(rows):
        tight, slack = max(pull[k], pull[k - 1]), min(pull[k], pull[k - 1])
        changes: dict[str, Any] = {"tight": float(tight), "slack": float(slack)}
        if slack > 0.0:
            changes["ratio"] = float(tight / slack)
        else:
            notes.append(
                f"{params.label(k)}: its slack span is slack, {slack:.3g} N less rho v^2: there is "
                "no ratio of tensions"
            )
        if mu[k] > 0.0:
            changes["limit"] = math.exp(mu[k] * wraps[k])
            if slack > 0.0:
                changes["used"] = float(math.log(tight / slack) / (mu[k] * wraps[k]))
        elif params.has_friction:
            notes.append(f"{params.label(k)} has no friction: it can hold no torque of the belt")
        found.append(attrs.evolve(row, **changes))
    return found


def steady_state(
    window: Window, touching: Touching, tension: Array, driver: int, torque: Array
) -> Steady:
    """Give the mean state of a window, tensions (n_p,) [N], belt's torques (n_p,) [N m]."""
    travels = window.travels()
    return Steady(
        params=window.params,
        tension=tension,
        torque=torque,
        speed=touching.speed,
        driver=driver,
        travel=np.zeros(0) if travels is None else window.mean(travels),
    )


def _margins(
    window: Window,
    touching: Touching,
    tension: Array,
    driver: int,
    rows: list[PulleyRow],
    notes: list[str],
) -> list[PulleyRow]:
    """Add how far torques can grow."""
    params = window.params
    torque = np.array([row.belt_torque for row in rows], dtype=float)
    radii = np.array([pulley.radius for pulley in params.pulleys])
    mean = float(np.mean(tension))
    working = np.abs(torque / radii) > IDLE * mean
    if not working.any():
        if params.has_friction:
            notes.append("no margin to slip: the belt hands on no torque in this window")
        return rows
    if window.run.mounts is not None and window.travels() is None:
        notes.append("no margin to slip: mounts.travel was not asked for")
        return rows
    slipping = [row.name for row in rows if row.used is not None and row.used >= FULL]
    try:
        found = full_slip(steady_state(window, touching, tension, driver, torque))
    except (ValueError, np.linalg.LinAlgError) as error:
        notes.append(f"no margin to slip: {error}")
        return rows
    for name in slipping:
        notes.append(f"{name} slips in full in this window, or is within 2 % of it")
    idle = [row.name for row, works in zip(rows, working, strict=True) if not works]
    if idle:
        notes.append(f"no margin to slip, for want of a load: {', '.join(idle)}")
    return [
        attrs.evolve(
            row,
            margin=one.factor,
            slip_torque=None if math.isinf(one.factor) else one.torque,
            slip_tensions=None if math.isinf(one.factor) else one.tensions,
        )
        if one is not None and works
        else row
        for row, one, works in zip(rows, found, working, strict=True)
    ]
