"""Tension held by mounts, which sets the preload of a belt whose length is not given.

A span pulls along the line between its ends, which bending lifts off the pulleys by EI / 2 r T each
(MODEL section 6, "Tension at rest"): where that turns spans, a mount holds another tension than
with the tangents to its pulley. An arm for 200 N on spans of 0.1 m between radii of 35 and 80 mm
held 195 N with EI = 0.01 N m^2.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array
from ..base.naming import label, names_of
from .mounts import Sprung
from .parts import Pulley
from .route import route

#: To which several mounts must ask for the same tension.
_AGREE = 1e-3
#: Steps to the tension that is held, of which the lift of the spans is a function, each of which
#: takes a twentieth of the error where bending turns spans a lot.
_STEPS = 50


def _holds_none(name: str, mount: Sprung, force: float, resisted: float) -> str:
    row = mount._row
    if resisted == 0.0:
        why = "its pivot is on the axis, or the belt pulls straight along it"
    elif force == 0.0:
        why = "neither spring nor weight acts on it there"
    else:
        why = (
            f"its spring and weight, {force:.4g} {row.force} ({row.sense} positive), go with the "
            "belt's pull"
        )
    wanted = "" if resisted == 0.0 else f" {'> 0' if resisted > 0.0 else '< 0'}"
    return (
        f"the {row.name} of {name} holds no tension in its place: {why}. Is it a preload{wanted}, "
        "or the other side of the belt, that is meant? Or give belt.length"
    )


def tension_held(
    pulleys: tuple[Pulley, ...], gravity: tuple[float, float], bending: float = 0.0
) -> float | None:
    """Return the tension at which springs and weights are in balance in the places of the drive."""
    names = names_of(pulley.name for pulley in pulleys)
    held: dict[int, float] = {}
    for k, mount, weights, pull_at in _balances(pulleys, gravity, bending):
        force, tension = mount.spring_force + weights, math.inf  # of a belt that bending lifts not
        for _ in range(_STEPS):
            resisted, before = pull_at(tension), tension
            if not resisted * force > 0.0:
                raise ValueError(_holds_none(label(k, names), mount, force, resisted))
            tension = force / resisted
            if abs(tension - before) <= 1e-14 * tension:
                break
        held[k] = tension
    if not held:
        return None
    least, most = min(held.values()), max(held.values())
    if most - least > _AGREE * most:
        tensions = ", ".join(f"{held[k]:.5g} N by {label(k, names)}" for k in held)
        raise ValueError(
            f"the mounts ask for different tensions in their places, {tensions}: give belt.length, "
            "and they find a balance"
        )
    return sum(held.values()) / len(held)


def _balances(
    pulleys: tuple[Pulley, ...], gravity: tuple[float, float], bending: float
) -> Iterator[tuple[int, Sprung, float, Callable[[float], float]]]:
    """Yield of each arm and slider its pulley, weights, and pull of the belt by its tension."""
    way = route(pulleys)
    radii = np.array([pulley.radius for pulley in pulleys])
    outward = np.stack([way.leave, way.arrive]) - np.array([pulley.center for pulley in pulleys])
    outward /= radii[:, None]
    # both ends of a wrap and both of a span find room on it, as in csrc/model/rest.c
    half, quarter = 0.5 * way.wraps * radii, 0.25 * way.spans
    room = np.minimum(half, [quarter, np.roll(quarter, 1)])

    def pulled(k: int, along: Array, tension: float) -> float:
        lift = np.minimum(bending / tension, room**2) / (2.0 * radii)
        leave, arrive = np.stack([way.leave, way.arrive]) + lift[:, :, None] * outward
        spans = np.array([arrive[(k + 1) % len(pulleys)] - leave[k], leave[k - 1] - arrive[k]])
        pull = np.sum(spans / np.linalg.norm(spans, axis=1)[:, None], axis=0)
        return -float(along @ pull)

    for k, pulley in enumerate(pulleys):
        mount = pulley.mount
        if not isinstance(mount, Sprung):
            continue
        along = mount._direction(np.array(pulley.center))
        weights = _core.GRAVITY * mount._hung + mount.mass * float(along @ np.array(gravity))
        yield k, mount, weights, functools.partial(pulled, k, along)


def preloaded(
    pulleys: tuple[Pulley, ...], gravity: tuple[float, float], bending: float = 0.0
) -> tuple[Pulley, ...]:
    """Return the pulleys with a preload for each mount that has a ``tension`` in its place."""
    if all(getattr(pulley.mount, "tension", None) is None for pulley in pulleys):
        return pulleys
    found = list(pulleys)
    for k, mount, weights, pull_at in _balances(pulleys, gravity, bending):
        if mount.tension is None:
            continue
        resisted = pull_at(mount.tension)
        if resisted == 0.0:
            name = label(k, names_of(pulley.name for pulley in pulleys))
            raise ValueError(_holds_none(name, mount, 0.0, resisted))
        kept: Any = mount
        spring = mount.tension * resisted - weights
        found[k] = attrs.evolve(found[k], mount=attrs.evolve(kept, tension=None, preload=spring))
    return tuple(found)
