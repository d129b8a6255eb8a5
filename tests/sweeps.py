"""Small scenes for sweeps, and each run of a sweep by hand."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

import beltdyn as bd


def small(t_end: float = 0.002, n_bodies: int = 24) -> bd.Scene:
    """Two named pulleys, a driving torque and a load, a run of milliseconds."""
    belt = bd.Belt(
        length=1.2,
        n_bodies=n_bodies,
        linear_density=0.1,
        axial_stiffness=70e3,
        axial_damping=1.4,
        mesh="paper",
    )
    params = bd.Params(
        belt=belt,
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01, name="crank"),
            bd.Pulley(center=(0.29, 0.0), radius=0.1, inertia=0.01, name="fan"),
        ],
        contact=bd.Contact(quadratic=5e10, linear=2.5e7, damping=1e3),
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )
    torque = bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-40.0, 0.0]]) + bd.Load(
        "fan", viscous=0.5, quadratic=1e-3
    )
    return bd.Scene(params, torque, t_end)


def moved() -> bd.Scene:
    """The same with a prescribed speed of the crank instead of its torque."""
    scene = small()._replace(torque_fn=bd.Load("fan", viscous=0.5, quadratic=1e-3))
    speed = bd.PiecewiseLinear([0.0, 0.002], [0.0, -5.0])
    return scene._replace(motion={"crank": speed})


def alone(scene: bd.Scene, **options: Any) -> bd.Result:
    """A run by itself."""
    return bd.simulate(scene.params, scene.torque_fn, scene.t_end, scene.motion, **options)


def with_belt(scene: bd.Scene, **changes: Any) -> bd.Scene:
    """The scene with numbers of the belt changed."""
    belt = attrs.evolve(scene.params.belt, **changes)
    return scene._replace(params=attrs.evolve(scene.params, belt=belt))


def bits(values: Any) -> bytes:
    """All bits of numbers."""
    return np.ascontiguousarray(np.asarray(values, dtype=float)).tobytes()
