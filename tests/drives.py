"""A drive for tests that need just some drive; it stays when the paper's are identified anew."""

from __future__ import annotations

import math
from typing import Any

import attrs

import beltdyn as bd

#: Every method, with the options at which its errors are small.
METHODS: dict[str, dict[str, Any]] = {
    "auto": {"rtol": 1e-4},
    "tsit5": {"rtol": 1e-4},
    "rk4": {},
    "rodas4": {"rtol": 1e-4},
    "lbdf2": {"rtol": 1e-3},
    "lie": {"rtol": 1e-2},
}


def plain() -> bd.Params:
    """Two equal pulleys, a soft, well damped contact, settled without friction."""
    belt = {"linear_density": 0.10, "axial_stiffness": 70e3, "axial_damping": 1.4}
    return bd.Params(
        belt=bd.Belt(length=1.2, n_bodies=60, bending_stiffness=0.01, mesh="paper", **belt),
        pulleys=[bd.Pulley(center=(x, 0.0), radius=0.1, inertia=0.010) for x in (0.0, 0.290)],
        contact=bd.Contact(quadratic=5e10, linear=2.5e7, damping=1.0e3),
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )


def with_belt(params: bd.Params, **changes: Any) -> bd.Params:
    """The drive with numbers of the belt changed."""
    return attrs.evolve(params, belt=attrs.evolve(params.belt, **changes))


def small_idler(radius: float, n_bodies: int) -> bd.Params:
    """Three pulleys, the middle one so small that links of twice its radius pass it by."""
    places = {(0.0, 0.0): (0.05, 0.01), (0.15, 0.05): (radius, 1e-4), (0.3, 0.0): (0.05, 0.01)}
    base = plain()
    belt = attrs.evolve(base.belt, length=0.905, n_bodies=n_bodies, axial_stiffness=50e3,
                        axial_damping=2.0, bending_stiffness=0.0)  # fmt: skip
    pulleys = [bd.Pulley(center=c, radius=r, inertia=i) for c, (r, i) in places.items()]
    contact = bd.Contact(linear=2.5e7, damping=1e3)
    return attrs.evolve(base, belt=belt, pulleys=pulleys, contact=contact)


def on_mesh(params: bd.Params, mesh: str) -> bd.Params:
    """The same drive with another discretisation of its belt: links of a mesh; or a "string", whose
    belt loses its bending.
    """
    changes: dict[str, Any] = {"mesh": mesh, "model": "links"}
    if mesh == "string":
        changes = {"mesh": "joint", "model": "string"}
        changes |= {"bending_stiffness": 0.0, "bending_damping": 0.0}
    return with_belt(params, **changes)


def plain_scene() -> bd.Scene:
    """The same, run up against a viscous load."""
    ramp = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-100.0, 0.0]])
    return bd.Scene(plain(), ramp + bd.Viscous([0.0, 100.0 / (2.0 * math.pi)]), 1.0)


def scene_m() -> bd.Scene:
    """The paper's drive with 60 N m, far enough from full slip to have a steady creep."""
    ramp = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-60.0, 0.0]])
    load = bd.Viscous([0.0, 100.0 / (2.0 * math.pi)])
    return bd.Scene(bd.scenes.kubas_case_1().params, ramp + load, 0.6)


def scene_u() -> bd.Scene:
    """The paper's belt, on pulleys of 50 and 120 mm, strained by 0.5 %, with 10 N m."""
    params = bd.scenes.kubas_case_1().params
    apart, small, large = 0.29, 0.05, 0.12
    lean = math.asin((large - small) / apart)
    path = 2 * apart * math.cos(lean) + math.pi * (small + large) + 2 * lean * (large - small)
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=small, inertia=0.005),
        bd.Pulley(center=(apart, 0.0), radius=large, inertia=0.02),
    ]
    belt = attrs.evolve(params.belt, length=path / 1.005)
    ramp = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-10.0, 0.0]])
    params = attrs.evolve(params, belt=belt, pulleys=pulleys)
    return bd.Scene(params, ramp + bd.Viscous([0.0, 4.57]), 0.6)


def light_scene() -> bd.Scene:
    """Light pulleys half a metre apart, one above the other: the belt's own mass along it counts,
    and its spans have waves along them.
    """
    params = scene_m().params
    pulleys = [
        attrs.evolve(one, center=(0.1 * k, 0.5 * k), radius=0.05 + 0.01 * k, inertia=2e-4)
        for k, one in enumerate(params.pulleys)
    ]
    belt = attrs.evolve(
        params.belt, length=None, preload=400.0, bending_stiffness=0.02, mesh="joint", model="auto"
    )
    params = attrs.evolve(
        params, belt=belt, pulleys=pulleys, gravity=(0.0, -9.81), tensioning=bd.Tensioning()
    )
    return bd.Scene(params, bd.Viscous([0.0, 0.1]), 0.1)


def _stretched(*pulleys: bd.Pulley) -> bd.Params:
    """The belt of the scenes round any pulleys, strained by 0.6 %."""
    belt = {"linear_density": 0.10, "axial_stiffness": 80e3, "axial_damping": 1.5}
    length = bd.route(pulleys).length / 1.006
    return bd.Params(
        belt=bd.Belt(length=length, n_bodies=90, bending_stiffness=0.02, **belt),
        pulleys=pulleys,
        contact=bd.Contact(linear=2e8, damping=4.0e3, compensate=True),
        friction=bd.Dahl(mu_k=0.8, sigma=1e4),
    )


def crossed_scene() -> bd.Scene:
    """A reduction by a crossed belt, so that the pulleys turn against each other."""
    params = _stretched(
        bd.Pulley(center=(0.0, 0.0), radius=0.06, inertia=0.004),
        bd.Pulley(center=(0.35, 0.05), radius=0.10, inertia=0.02, side="outside"),
    )
    ramp = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0], [-20.0, 0.0]])
    return bd.Scene(params, ramp + bd.Viscous([0.0, 2.0]), 0.6)


def idler_scene() -> bd.Scene:
    """Two pulleys, and on the back of the belt between them an idler with drag."""
    idler = {"radius": 0.04, "inertia": 0.0003, "drag": bd.Drag(viscous=0.01)}
    params = _stretched(
        bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
        bd.Pulley(center=(0.13, 0.085), side="outside", **idler),
        bd.Pulley(center=(0.30, 0.02), radius=0.10, inertia=0.02),
    )
    ramp = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0, 0.0], [-20.0, 0.0, 0.0]])
    return bd.Scene(params, ramp + bd.Viscous([0.0, 0.0, 0.5]), 0.6)


def reduction(n_bodies: int = 60, **belt: Any) -> bd.Params:
    """Two unequal pulleys and a belt of 400 N, whose friction is small enough to slip."""
    given = {"linear_density": 0.1, "axial_stiffness": 80e3, "axial_damping": 1.5} | belt
    return bd.Params(
        belt=bd.Belt(preload=400.0, n_bodies=n_bodies, **given),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.06, inertia=0.004),
            bd.Pulley(center=(0.35, 0.05), radius=0.1, inertia=0.02),
        ],
        contact=bd.Contact(linear=2e8, damping=4e3),
        friction=bd.Dahl(mu_k=0.6, sigma=1e4),
    )


def cranked(n_bodies: int = 60) -> bd.Params:
    """A crank and an alternator, of a belt without bending stiffness."""
    belt = {"linear_density": 0.1, "axial_stiffness": 60e3, "axial_damping": 5.0}
    return bd.Params(
        belt=bd.Belt(preload=300.0, n_bodies=n_bodies, bending_stiffness=0.0, **belt),
        pulleys=[
            bd.Pulley(name="crank", center=(0.0, 0.0), radius=0.08, inertia=0.03),
            bd.Pulley(name="alternator", center=(0.3, 0.0), radius=0.05, inertia=0.01),
        ],
        friction=bd.Dahl(mu_k=0.9, sigma=1e4),
    )


def sprung_alternator(damping: float) -> bd.Params:
    """The alternator drive without what is not linear: its arm damped, without dry friction;
    friction of the belt a spring with a damper until it slips.
    """
    params = bd.scenes.tensioned_alternator(60).params
    pulleys = list(params.pulleys)
    mount = attrs.evolve(pulleys[2].mount, friction=0.0, damping=damping)
    pulleys[2] = attrs.evolve(pulleys[2], mount=mount)
    law = bd.ElasticPlastic(mu=1.0, stiffness=1e9, damping=1e4)
    belt = attrs.evolve(params.belt, bending_stiffness=0.0)
    return attrs.evolve(params, pulleys=pulleys, friction=law, belt=belt)


def pressing(center: tuple[float, float], **arm: Any) -> bd.Pulley:
    """A tensioner whose arm presses it on the back of the belt."""
    mount = bd.Arm(**{"inertia": 2e-3, "damping": 1.0, **arm})
    return bd.Pulley(
        name="tensioner", center=center, radius=0.03, inertia=2e-4, side="outside", mount=mount
    )


#: Layouts that no scene of the library has.
LAYOUTS = {"crossed": crossed_scene, "outside idler": idler_scene}


#: The scenes of the library whose axes are fixed, which can be on either mesh.
FIXED = tuple(name for name in bd.scenes.names() if not bd.scenes.get(name).params.mounted)


def scene(name: str) -> bd.Scene:
    """A scene of the library, or one of these layouts."""
    return LAYOUTS[name]() if name in LAYOUTS else bd.scenes.get(name)
