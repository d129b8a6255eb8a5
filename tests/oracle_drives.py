"""Drives and states that the tests of the oracle share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import reference as ref
from reference_friction import Dahl, ElasticPlastic, Law, LuGre


def no_torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
    return np.zeros_like(omega)


def some_torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
    return np.array([-30.0, 12.0]) - np.array([0.5, 2.0]) * omega


def small_drive(**changes: Any) -> ref.Reference:
    """24 soft links on the paper's pulleys: 100 times fewer right-hand sides per second."""
    data: dict[str, Any] = {
        "axial_stiffness": 7e3,
        "axial_damping": 2.0,
        "contact": (1e8, 5e6, 200.0),
        "mu_k": 0.8,
        "sigma": 2e3,
    }
    return ref.paper_drive(24, **(data | changes))


def laid_on_joints(model: ref.Reference, y: ref.Array) -> ref.Array:
    """Links on the pulleys moved so far in that their ends, not their centres, run on the rims."""
    y = y.copy()
    position = model.links(y)[0, :2]
    for center, radius, contact in zip(
        model.centers, model.radii, model.contact_radii, strict=True
    ):
        arm = position - center[:, None]
        on = np.hypot(*arm) < radius * (1 + 1e-9)
        chord = math.sqrt(contact**2 - 0.25 * model.l0**2)
        position[:, on] = center[:, None] + arm[:, on] * chord / radius
    return y


def shaken(model: ref.Reference, seed: int) -> ref.Array:
    """Return a random state near the belt line: links in and out of contact, all moving.

    Every pair is kept off the kinks p = 0, N = 0 and v_T = 0, so that a finite difference along the
    motion sees a smooth function. Speeds that are prescribed are those of t = 0. Where elastic/
    plastic friction begins to slip, its force has a kink, but no energy has.
    """
    rng = np.random.default_rng(seed)
    y0 = ref.start_state(model)
    if model.mesh == "joint":
        y0 = laid_on_joints(model, y0)
    scale = 0.02 * model.l0
    while True:
        y = y0.copy()
        links, pulleys, memory = model.links(y), model.pulleys(y), model.memory(y)
        links[0, :2] += scale * rng.uniform(-1, 1, links[0, :2].shape)
        links[0, 2] += 0.1 * rng.uniform(-1, 1, model.n_bodies)
        links[1, :2] = rng.uniform(-1, 1, links[1, :2].shape)
        links[1, 2] = 30 * rng.uniform(-1, 1, model.n_bodies)
        pulleys[:] = rng.uniform(-5, 5, pulleys.shape)
        touching = model.penetration(y) > 0
        y = model.follow(0.0, y)
        links, pulleys, memory = model.links(y), model.pulleys(y), model.memory(y)
        if any(model.laws):
            memory[0] = rng.uniform(-1, 1, touching.shape) * touching
            normal = model.contacts(y).normal
            for j, law in enumerate(model.laws):
                if isinstance(law, ElasticPlastic):
                    memory[0, j] *= 1.5 * law.mu * normal[j] / (law.stiffness * model.l0)
                else:
                    memory[0, j] *= 0.0 if law is None else law.bound
        memory[1] = 1e-3 * rng.uniform(-1, 1, touching.shape) * touching
        at = model.contacts(y)
        p = np.maximum(at.penetration, 0)
        total = model.c1 * p**2 + model.c2 * p + model.b * at.rate
        if (
            np.abs(at.penetration).min() > 1e-7
            and np.abs(total[touching]).min() > 1e-3
            and np.abs(at.velocity[touching]).min() > 1e-3
        ):
            return y


def law_by_hand(
    law: Law | None, z: float, v: float, normal: float, l0: float
) -> tuple[float, float]:
    """F and dz/dt of one link, the equations of MODEL section 4 as they stand there."""
    if law is None:
        return 0.0, 0.0
    if isinstance(law, Dahl):
        return z * normal, law.sigma * (v - abs(v) * z / law.mu_k)
    if isinstance(law, LuGre):
        g = law.mu_k + (law.mu_s - law.mu_k) * math.exp(-((v / law.v_stribeck) ** 2))
        h = v - abs(v) * z / g
        return normal * (z + law.damping * h + law.viscous * v), law.sigma * h
    assert isinstance(law, ElasticPlastic)
    k, c, limit = law.stiffness * l0, law.damping * l0, law.mu * normal
    rate = min(max(v, (-limit - k * z) / c), (limit - k * z) / c)
    return k * z + c * rate, rate
