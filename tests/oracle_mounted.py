"""Drives with mounts for the tests of the oracle."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import reference as ref
from reference_friction import Dahl, ElasticPlastic, LuGre
from reference_line import spans_away
from reference_mounts import Arm, Mount, Path, Slider

STRAIN = 0.006  # 48 N
LUGRE = LuGre(mu_k=0.5, mu_s=0.7, v_stribeck=0.05, sigma=2e3, damping=0.5, viscous=0.1)
ELASTIC = ElasticPlastic(mu=0.6, stiffness=1e6, damping=500.0)
DAHL = Dahl(mu_k=0.8, sigma=2e3)
GRAVITY = (1.0, -9.81)
DRAG = (0.05, 1e-3, 1e-5)

ARM = Arm(pivot=(0.21, 0.12), inertia=0.004, mass=0.3, stiffness=15.0, preload=3.3, damping=0.05,
          friction=0.4)  # fmt: skip
SLIDER = Slider(
    direction=(2.9, 0.3), mass=2.0, weight=9.0, stiffness=500.0, damping=30.0, friction=8.0
)
PATH = Path(t=(0.0, 0.004, 0.01), displacement=((0.0, 0.0), (1e-3, 5e-4), (2e-3, -1e-3)))


def drive(centers: Any, radii: Any, sides: Any, **changes: Any) -> ref.Reference:
    """A soft belt of 36 links round these pulleys, clockwise, strained as they are drawn."""
    centers, radii = np.array(centers), np.array(radii)
    data: dict[str, Any] = {
        "length": spans_away(centers, radii, sides)[0] / (1 + STRAIN),
        "n_bodies": 36,
        "linear_density": 0.10,
        "axial_stiffness": 8e3,
        "axial_damping": 2.0,
        "bending_stiffness": 0.01,
        "bending_damping": 1e-4,
        "centers": centers,
        "radii": radii,
        "inertias": 0.05 * radii**2 * (1 + radii),
        "contact": (0.0, 2e6, 300.0),
        "friction": (DAHL,) * len(radii),
        "sides": sides,
        "mesh": "joint",
        "compensate": True,
    }
    return ref.Reference(**(data | changes))


def arm(changes: dict[str, Any] | None = None, **others: Any) -> ref.Reference:
    """Crank, an idler on the back of the belt on an arm, alternator."""
    mount = dataclasses.replace(ARM, **(changes or {}))
    return drive(
        [[0.0, 0.0], [0.13, 0.085], [0.30, 0.02]], [0.08, 0.04, 0.10], (1, -1, 1),
        **({"mounts": {1: mount}} | others),
    )  # fmt: skip


def slider(changes: dict[str, Any] | None = None, **others: Any) -> ref.Reference:
    """Two pulleys, one on a slider that a weight pulls."""
    mount = dataclasses.replace(SLIDER, **(changes or {}))
    return drive(
        [[0.0, 0.0], [0.29, 0.03]], [0.1, 0.08], (1, 1), **({"mounts": {1: mount}} | others)
    )


def path(**others: Any) -> ref.Reference:
    return slider(**({"mounts": {1: PATH}} | others))


def every(**others: Any) -> ref.Reference:
    """An arm, a path and a slider on one belt; drag on every pulley."""
    mounts: dict[int, Mount] = {
        1: dataclasses.replace(ARM, stops=(-0.2, 0.1)),
        2: PATH,
        3: Slider(direction=(0.0, -2.0), mass=0.5, weight=4.0, damping=20.0, friction=5.0,
                  friction_stiffness=1e4, stops=(-1e-5, 1e-5)),
    }  # fmt: skip
    given: dict[str, Any] = {
        "mounts": mounts,
        "friction": (DAHL, LUGRE, ELASTIC, None),
        "drag": np.array([DRAG] * 4),
        "gravity": GRAVITY,
    }
    return drive(
        [[0.0, 0.0], [0.13, 0.085], [0.30, 0.02], [0.16, -0.13]], [0.08, 0.04, 0.10, 0.05],
        (1, -1, 1, 1), **(given | others),
    )  # fmt: skip


MODELS: dict[str, Callable[[], ref.Reference]] = {
    "arm": arm,
    "arm in its stops, gravity, drag": lambda: arm(
        {"stops": (-1e-5, 1e-5)}, gravity=GRAVITY, drag=np.array([DRAG] * 3)
    ),
    "slider": slider,
    "slider, gravity, LuGre": lambda: slider(gravity=GRAVITY, friction=(LUGRE, LUGRE)),
    "slider in its stops, no friction": lambda: slider(
        {"stops": (-2e-5, 1e-5), "friction": 0.0}, friction=(None, None)
    ),
    "path, elastic/plastic": lambda: path(friction=(ELASTIC, ELASTIC)),
    "arm, path and slider": every,
    "arm, path and slider, motions": lambda: every(
        motion={
            1: lambda t: (5.0 * math.cos(20.0 * t), -100.0 * math.sin(20.0 * t)),
            2: lambda t: (-4.0 - 300.0 * t, -300.0),
        }
    ),
}


def moved(
    mounts: dict[int, Mount], matrix: ref.Array, shift: tuple[float, float]
) -> dict[int, Mount]:
    """The mounts of the drive turned or mirrored by a matrix, then shifted."""
    sign = float(np.sign(np.linalg.det(matrix)))

    def image(one: Mount) -> Mount:
        if isinstance(one, Path):
            d = np.asarray(one.displacement) @ matrix.T
            return dataclasses.replace(one, displacement=d)
        if isinstance(one, Slider):
            x, y = matrix @ np.asarray(one.direction)
            return dataclasses.replace(one, direction=(float(x), float(y)))
        x, y = matrix @ np.asarray(one.pivot) + np.asarray(shift)
        stops = one.stops
        if stops is not None and sign < 0:
            stops = (-stops[1], -stops[0])
        return dataclasses.replace(
            one, pivot=(float(x), float(y)), preload=sign * one.preload, stops=stops
        )

    return {j: image(one) for j, one in mounts.items()}
