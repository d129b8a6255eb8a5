"""Rows of tensioner arms, sliders and paths."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.checks import Array
from ..drive.mounts import Sprung
from .rows import MountRow, Spread
from .span_rows import line_of
from .window import Window

#: Least amplitude of a line in the travel, of a turn of one radian or of the pulley's radius: below
#: it is what rounding and tolerances leave.
MIN_AMPLITUDE = 1e-6
_FORCES = ("spring", "damper", "friction", "stop", "belt")


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
