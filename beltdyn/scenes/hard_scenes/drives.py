"""The drives that hard scenes are changes of, and how they are changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs

from ...drive.friction import Dahl
from ...drive.mounts import Mount
from ...drive.parameters import changed
from ...drive.params import Params
from ...drive.parts import Belt, Contact, Pulley
from ...drive.scene import Scene
from ...loads.loads import Load, Ramp
from ...loads.torques import PiecewiseLinear, TorqueLike


def pair(changes: Mapping[str, Any] | None = None) -> Params:
    """Return two equal pulleys with a belt of 300 N without bending; it slips in full at 26 N m."""
    params = Params(
        belt=Belt(
            preload=300.0, n_bodies=60, linear_density=0.1, axial_stiffness=60e3, axial_damping=2.0
        ),
        pulleys=[
            Pulley(center=(0.0, 0.0), radius=0.06, inertia=2e-3),
            Pulley(center=(0.25, 0.0), radius=0.06, inertia=2e-3),
        ],
        contact=Contact(linear=1.67e9, damping=1.3e4, compensate=True),
        friction=Dahl(mu_k=0.6, sigma=1e4),
    )
    return changed(params, changes or {})


def ramp(torque: float = -6.0, load: float = 0.1, over: float = 0.01) -> TorqueLike:
    """Drive pulley 0 with a torque that rises [N m], brake pulley 1 in proportion [N m s]."""
    return Ramp(0, 0.0, over, torque) + Load(1, viscous=load)


#: No torque.
NOTHING = PiecewiseLinear([0.0], [0.0], 0)
#: Motion of a pulley that stands still.
LOCKED = PiecewiseLinear([0.0], [0.0])


def pulled(torque: float, changes: Mapping[str, Any] | None = None, t_end: float = 0.05) -> Scene:
    """Pull with a torque on pulley 0 [N m] that rises within 10 ms; pulley 1 is locked."""
    return Scene(pair(changes), Ramp(0, 0.0, 0.01, torque), t_end, {1: LOCKED})


def pulling() -> Scene:
    """Pull with 6 N m on pulley 0 against 3 N m on pulley 1."""
    torque = PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-6.0, 3.0]])
    return Scene(pair(), torque, 0.02)


def beside(depth: float, x: float = 0.125) -> Params:
    """Add an idler on the back of the upper span, at x, which it presses in by so much [m]."""
    params = pair()
    idler = Pulley(center=(x, 0.09 - depth), radius=0.03, inertia=1e-4, side="outside")
    return attrs.evolve(params, pulleys=(params.pulleys[0], idler, params.pulleys[1]))


def tensioned(mount: Mount) -> Params:
    """Two pulleys, and on the back of the belt between them a third on a mount."""
    return Params(
        belt=Belt(n_bodies=60, linear_density=0.1, axial_stiffness=60e3, axial_damping=2.0),
        pulleys=[
            Pulley(center=(0.0, 0.0), radius=0.06, inertia=4e-3),
            Pulley(center=(0.25, 0.0), radius=0.05, inertia=2e-3),
            Pulley(center=(0.13, 0.045), radius=0.025, inertia=1e-4, side="outside", mount=mount),
        ],
        friction=Dahl(mu_k=0.6, sigma=1e4),
    )


def scaled(scene: Scene, size: float) -> Scene:
    """Return the scene with its length in a unit ``size`` times as small, forces with it.

    Masses and times are as they are: a force is ``size`` times as large, a torque its square. For
    two pulleys with a contact, Dahl friction and torques over time alone.
    """

    def part(one: Any, **powers: int) -> Any:
        changes = {name: getattr(one, name) * size**power for name, power in powers.items()}
        return attrs.evolve(one, **changes)

    params, torque = scene.params, scene.torque_fn
    pulleys = [
        part(attrs.evolve(p, center=(size * p.center[0], size * p.center[1])), radius=1, inertia=2)
        for p in params.pulleys
    ]
    given = {"length": 1} if params.belt.length is not None else {"preload": 1}
    drive = attrs.evolve(
        params,
        belt=part(
            params.belt, linear_density=-1, axial_stiffness=1, axial_damping=1,
            bending_stiffness=3, bending_damping=3, **given,
        ),
        pulleys=pulleys,
        contact=part(params.contact, quadratic=-2, linear=-1, damping=-1),
        friction=part(params.friction, sigma=-1),
    )  # fmt: skip
    terms = PiecewiseLinear(torque.t, size**2 * torque.values)  # type: ignore[union-attr]
    return scene._replace(params=drive, torque_fn=terms)
