"""Rows of tensioner arms, sliders and paths."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.checks import Array
from ..drive.mounts import Sprung
from ..outputs.histories import MountHistory
from .pulleys import spread
from .rows import MountRow, Spread
from .span_rows import dominant, uneven
from .window import Window

__all__ = ["mount_rows"]

#: Least amplitude of a line in the travel, of a turn of one radian or of the pulley's radius: below
#: it is what rounding and tolerances leave.
MIN_AMPLITUDE = 1e-6
_FORCES = {
    name.removesuffix("_force"): name
    for name in MountHistory.array_names()
    if name.endswith("_force")
}


def mount_rows(window: Window, statics: Array | None, passing: float) -> list[MountRow]:
    """Return the rows; note what is missing in them."""
    params, run = window.params, window.run
    mounts = run.mounts
    if mounts is None:
        return []
    lacking = [name for name in ("travel", *_FORCES.values()) if not run._has(f"mounts.{name}")]
    if lacking:
        names = ", ".join(f"mounts.{name}" for name in lacking)
        window.notes.append(f"mounts: {names} not asked for (outputs of simulate)")
    rows = []
    for m, k in enumerate(params.mounted):
        mount, name = params.effective_pulleys[k].mount, params.pulley_names[k]
        assert mount is not None
        row: dict[str, Any] = {"name": name, "kind": mount._row.name}
        if "travel" not in lacking:
            travel = window.of(mounts.travel)[:, m]
            if not isinstance(mount, Sprung):
                drawn = np.array(params.pulleys[k].center)
                travel = np.hypot(*(window.centers[:, k] - drawn).T)
            elif mount.stops is not None:
                low, high = mount.stops
                row["to_stop"] = spread(window, np.minimum(travel - low, high - travel))
            row["travel"] = spread(window, travel)
            least = MIN_AMPLITUDE * (1.0 if mount._row.angle else params.pulleys[k].radius)
            line = None if uneven(window) else dominant(window.t, travel)
            if line is not None and line.amplitude > least:
                row |= {"frequency": line.frequency, "amplitude": line.amplitude}
        if isinstance(mount, Sprung):
            for field, output in _FORCES.items():
                if output not in lacking and _there(mount, field):
                    row[field] = spread(window, window.of(getattr(mounts, output))[:, m])
            if row.get("belt") is not None and "travel" not in lacking and statics is not None:
                along = mount._directions(window.centers[:, k])
                pull = np.array([a @ load for a, load in zip(along, statics[:, k], strict=True)])
                row["belt"] = _without_blows(window, row["belt"], pull, passing)
        rows.append(MountRow(**row))
    return rows


def _there(mount: Sprung, field: str) -> bool:
    """Return whether a mount has this part."""
    if field == "spring":
        return bool(mount.stiffness or mount.spring_force or mount._hung)
    if field in ("damper", "friction"):
        return bool(mount.damping if field == "damper" else mount.friction)
    return field == "belt" or mount.stops is not None


def _without_blows(window: Window, of_contact: Spread, pull: Array, passing: float) -> Spread:
    """Take the mean from the contact, which is exact, and the range from the pull of the spans."""
    swing = spread(window, pull, passing)
    if swing is None or np.isnan(pull).any():
        return of_contact
    mean = of_contact.mean
    return Spread(mean, mean + swing.least - swing.mean, mean + swing.most - swing.mean)
