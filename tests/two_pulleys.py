"""Open drives of two pulleys side by side, for tests against closed forms."""

from __future__ import annotations

from typing import Any

import beltdyn as bd


def open_drive(
    radii: tuple[float, float], apart: float, inertias: tuple[float, float], **others: Any
) -> bd.Params:
    """The drive; contact, friction and the like, and what of the belt is not as in most of them."""
    drive = {name: others.pop(name) for name in ("contact", "friction") if name in others}
    belt = {"n_bodies": 120, "linear_density": 0.1, "axial_damping": 2.0} | others
    pulleys = [
        bd.Pulley(center=(x, 0.0), radius=radius, inertia=inertia)
        for x, radius, inertia in zip((0.0, apart), radii, inertias, strict=True)
    ]
    return bd.Params(belt=bd.Belt(**belt), pulleys=pulleys, **drive)
