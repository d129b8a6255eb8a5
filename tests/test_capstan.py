"""Euler-Eytelwein: a belt dragged in full slip over a locked drum (CHECKS section 2).

A large pulley, whose wrap is wider, drags the belt slowly round; the small one is locked by its
inertia. The belt sticks on the large pulley and rubs on the whole wrap of the small one.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from drives import on_mesh
from two_pulleys import open_drive

import beltdyn as bd

MU = 0.5


def dragged(n_bodies: int, mesh: str) -> tuple[bd.Params, bd.Result]:
    params = open_drive(
        (0.06, 0.18), 0.32914, (1e9, 0.02), length=1.447, n_bodies=n_bodies, axial_stiffness=70e3,
        axial_damping=1.4 * (60 / n_bodies) ** 2, contact=bd.Contact(linear=4e7, damping=2e3),
        friction=bd.Dahl(mu_k=MU, sigma=1e4),
    )  # fmt: skip
    params = on_mesh(params, mesh)
    # an effective speed governor: -0.5 rad/s whatever the belt asks for
    governor = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0], [0.0, -0.5 * 400.0]])
    torque = governor + bd.Viscous([0.0, 400.0])
    with pytest.warns(bd.BeltdynWarning, match="^full_slip: pulley 0 slips over its whole wrap"):
        result = bd.simulate(params, torque, 0.25, t_eval=np.linspace(0.15, 0.25, 1001), rtol=1e-4)
    return params, result


@pytest.mark.parametrize("mesh", ["paper", "string"])
def test_ratios_of_links_and_spans(mesh: str) -> None:
    """The drum is locked and slips everywhere: neighbouring joints on saturated links, averaged
    over time against the belt's vibration, and T2/T1 over the whole wrap.

    The formula of a link takes both joint forces at half the angle between links; the moment about
    its centre turns them by a part of order mu delta of that, which changes ratio - 1 by a relative
    delta^2 / 4 at most; masses of a string have no moment. The vibration that averaging leaves adds
    its standard error. Of the wrap theta = pi - 2 asin((R - r)/a) the first link after arrival has
    not saturated yet and links come and go one at a time: one link's angle each way.
    """
    params, result = dragged(120, mesh)
    is_links, contact, force = mesh == "paper", result.contact, result.joints.force
    assert np.max(np.abs(result.pulleys.omega[:, 0])) < 1e-6
    mu = np.abs(contact.mu[contact.pulley == 0])
    assert np.min(mu) > 0.0
    # all but the links that have just arrived; of some 15 masses two, which have new bars
    assert np.mean(mu > 0.999 * MU) > (0.9 if is_links else 0.8)

    delta = params.belt.length * (1 + params.info["strain"]) / params.belt.n_bodies / 0.06
    link = (1 + MU * math.tan(delta / 2)) / (1 - MU * math.tan(delta / 2))
    saturated = (contact.pulley == 0) & (np.abs(contact.mu) > 0.9999 * MU)
    ratios = np.maximum(force / np.roll(force, -1, axis=1), np.roll(force, -1, axis=1) / force)
    # away from the ends of the wrap, where links, and bars of the masses beside, lie half on it
    beside = (1, -1) if is_links else (1, -1, 2, -2)
    inside = saturated & np.all([np.roll(saturated, k, axis=1) for k in beside], axis=0)
    assert inside.sum() > 1000
    assert abs(np.mean(ratios[inside]) - link) <= (delta**2 / 4 + 1e-3) * (link - 1)

    theta = math.pi - 2 * math.asin((0.18 - 0.06) / 0.32914)
    tension = np.nanmean(result.span_tension, axis=0)
    exponent = math.log(tension.max() / tension.min())
    assert abs(exponent - MU * theta) <= MU * params.belt.length / params.belt.n_bodies / 0.06
