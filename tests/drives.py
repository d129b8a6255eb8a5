"""A drive for tests that need just some drive; it stays when the paper's are identified anew."""

from __future__ import annotations

import math

import attrs

import beltdyn as bd


def plain() -> bd.Params:
    """Two equal pulleys, a soft, well damped contact, settled without friction."""
    return bd.Params(
        belt=bd.Belt(
            length=1.2,
            n_bodies=60,
            linear_density=0.10,
            axial_stiffness=70e3,
            axial_damping=1.4,
            bending_stiffness=0.01,
        ),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.010),
            bd.Pulley(center=(0.290, 0.0), radius=0.1, inertia=0.010),
        ],
        contact=bd.Contact(quadratic=5e10, linear=2.5e7, damping=1.0e3),
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )


def on_mesh(params: bd.Params, mesh: str) -> bd.Params:
    """The same drive with another discretisation of its belt."""
    return attrs.evolve(params, belt=attrs.evolve(params.belt, mesh=mesh))


def plain_scene() -> bd.Scene:
    """The same, run up against a viscous load."""
    ramp = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-100.0, 0.0]])
    return bd.Scene(plain(), ramp + bd.Viscous([0.0, 100.0 / (2.0 * math.pi)]), 1.0)
