"""Drives and states that the tests of the oracle share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import reference as ref
from reference_friction import (
    Coulomb,
    CreepRate,
    Dahl,
    ElasticPlastic,
    Law,
    LuGre,
    MaxwellSlip,
    Threlfall,
)
from reference_mounts import Sprung


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
        model.axes(y), model.radii, model.contact_radii, strict=True
    ):
        arm = position - center[:, None]
        on = np.hypot(*arm) < radius * (1 + 1e-9)
        chord = contact  # of the masses of a string
        if model.freedoms == 3:
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
        links[0, 2:] += 0.1 * rng.uniform(-1, 1, links[0, 2:].shape)
        links[1, :2] = rng.uniform(-1, 1, links[1, :2].shape)
        links[1, 2:] = 30 * rng.uniform(-1, 1, links[1, 2:].shape)
        pulleys[:] = rng.uniform(-5, 5, pulleys.shape)
        shake_mounts(model, y, rng, scale)
        touching = model.penetration(y) > 0
        y = model.follow(0.0, y)
        links, pulleys, memory = model.links(y), model.pulleys(y), model.memory(y)
        if any(model.laws):
            memory[:-1] = rng.uniform(-1, 1, memory[:-1].shape) * touching
            normal = model.contacts(y).normal
            for j, law in enumerate(model.laws):
                if isinstance(law, ElasticPlastic | MaxwellSlip):
                    elements = law.elements if isinstance(law, MaxwellSlip) else [law]
                    memory[len(elements) : -1, j] = 0.0
                    for e, one in enumerate(elements):
                        memory[e, j] *= 1.5 * one.mu * normal[j] / (one.stiffness * model.l0)
                else:
                    memory[:-1, j] *= 0.0 if law is None else law.bound
                    memory[1:-1, j] = 0.0
        memory[-1] = 1e-3 * rng.uniform(-1, 1, touching.shape) * touching
        kinks = {name: np.abs(at).min(initial=np.inf) for name, at in model.kinks(y).items()}
        if (
            kinks["penetration"] > 1e-7
            and kinks["force"] > 1e-3
            and kinks["slip"] > 1e-3
            and kinks["share"] > 1e-2
        ):
            return y


def shake_mounts(
    model: ref.Reference, y: ref.Array, rng: np.random.Generator, scale: float
) -> None:
    """Axes moved by up to `scale` [m], at up to 1 m/s; paths at any time of theirs."""
    travel, rate, share = model.mount_states(y)
    for m, (j, one) in enumerate(model.mounts.items()):
        if isinstance(one, Sprung):
            reach = float(np.linalg.norm(one.lever(travel[m], model.centers[j])))
            travel[m] += scale / reach * rng.uniform(-1, 1)
            rate[m] = rng.uniform(-1, 1) / reach
            share[m] = rng.uniform(-1, 1) * (one.friction > 0)
        else:
            travel[m] = rng.uniform(one.t[0], one.t[-1])


def law_by_hand(law: Law | None, z: Any, v: float, normal: float, l0: float) -> tuple[float, Any]:
    """F and dz/dt of one link, the equations of MODEL section 4 as they stand there.

    Of Maxwell slip z and dz/dt have one number for each element.
    """

    def level(mu: float, mu_s: float, v_stribeck: float) -> float:
        return mu + (mu_s - mu) * math.exp(-((v / v_stribeck) ** 2)) if mu_s else mu

    if law is None:
        return 0.0, 0.0
    if isinstance(law, MaxwellSlip):
        share = law.mu_s / sum(law.mu)
        numbers = zip(law.mu, law.stiffness, law.damping, strict=True)
        elements = [ElasticPlastic(m, k, c, share * m, law.v_stribeck) for m, k, c in numbers]
        each = [law_by_hand(one, x, v, normal, l0) for one, x in zip(elements, z, strict=True)]
        return sum(force for force, _ in each), [rate for _, rate in each]
    if isinstance(law, Dahl):
        g = level(law.mu_k, law.mu_s, law.v_stribeck)
        return z * normal, law.sigma * (v - abs(v) * z / g)
    if isinstance(law, LuGre):
        g = law.mu_k + (law.mu_s - law.mu_k) * math.exp(-((v / law.v_stribeck) ** 2))
        h = v - abs(v) * z / g
        return normal * (z + law.damping * h + law.viscous * v), law.sigma * h
    if isinstance(law, Coulomb):
        mu = level(law.mu, law.mu_s, law.v_stribeck)
        return normal * mu * v / math.sqrt(v * v + law.v_reg * law.v_reg), 0.0
    if isinstance(law, CreepRate):
        full = math.copysign(law.mu, v)
        return normal * (full if abs(v) >= law.v_critical else law.mu * v / law.v_critical), 0.0
    if isinstance(law, Threlfall):
        mu = law.mu * (1.0 - math.exp(-3.0 * abs(v) / law.v_reg))
        return normal * math.copysign(mu, v), 0.0
    assert isinstance(law, ElasticPlastic)
    k, c = law.stiffness * l0, law.damping * l0
    limit = level(law.mu, law.mu_s, law.v_stribeck) * normal
    rate = min(max(v, (-limit - k * z) / c), (limit - k * z) / c)
    return k * z + c * rate, rate


@dataclass(frozen=True)
class ByHand:
    """Contact of every pulley: forces on the links' ends [pulley, xy, link]; of the pairs the
    normal force, the share in contact and how fast belt comes into contact, over the share; and
    the power that goes into the contact's springs.
    """

    left: ref.Array
    right: ref.Array
    normal: ref.Array
    share: ref.Array
    fresh: ref.Array
    elastic_power: float


def contact_by_hand(model: ref.Reference, y: ref.Array) -> ByHand:
    """The equations of MODEL section 3 link by link; of the paper's mesh half acts on each end.

    Of a string link i is the bar from mass i to mass i + 1.
    """
    n_p, n_b, l0 = model.n_pulleys, model.n_bodies, model.l0
    left, right = np.zeros((2, n_p, 2, n_b))
    normal, share, share_rate = np.zeros((3, n_p, n_b))
    place, velocity = model.links(y)[:, :2]
    axes, moving = model.axes(y), model.axis_velocities(y)
    stored = 0.0

    def elastic(p: float) -> float:
        return model.c1 * p**2 + model.c2 * p

    def pressure(p: float, rate: float) -> float:
        return max(0.0, elastic(p) + model.b * rate)

    def seen(j: int, i: int, along: float) -> tuple[float, float, ref.Array]:
        """Penetration, its rate and the normal of a point of a link, so far from its middle."""
        if model.freedoms == 3:
            angle, spin = model.links(y)[:, 2, i]
            e = np.array([math.cos(angle), math.sin(angle)])
            arm = place[:, i] + along * e - axes[j]
            speed = velocity[:, i] + along * spin * np.array([-e[1], e[0]]) - moving[j]
        else:
            mass = i if along < 0 else (i + 1) % n_b
            arm, speed = place[:, mass] - axes[j], velocity[:, mass] - moving[j]
        outward = arm / math.dist(arm, (0.0, 0.0))
        return model.contact_radii[j] - math.dist(arm, (0.0, 0.0)), -speed @ outward, outward

    for j in range(n_p):
        for i in range(n_b):
            if model.mesh == "paper":
                p, rate, outward = seen(j, i, 0.0)
                normal[j, i] = pressure(p, rate) if p > 0 else 0.0
                share[j, i] = p > 0
                stored += elastic(p) * rate if p > 0 else 0.0
                left[j, :, i] = right[j, :, i] = 0.5 * normal[j, i] * outward
                continue
            (pa, va, na), (pb, vb, nb) = seen(j, i, -0.5 * l0), seen(j, i, 0.5 * l0)
            if pa <= 0 and pb <= 0:
                continue
            begin, end, moves = 0.0, 1.0, 0.0
            if (pa > 0) != (pb > 0):
                zero = pa / (pa - pb)
                moves = (va * (pa - pb) - pa * (va - vb)) / (pa - pb) ** 2
                begin, end = (0.0, zero) if pa > 0 else (zero, 1.0)
                share_rate[j, i] += moves * (1 - zero) * (1 if pa > 0 else -1)
                share_rate[j, (i + 1) % n_b] += moves * zero * (1 if pa > 0 else -1)
            nodes, weights = np.polynomial.legendre.leggauss(2)
            at = begin + (end - begin) * (nodes + 1) / 2
            q = [w / 2 * (end - begin) * pressure((1 - x) * pa + x * pb, (1 - x) * va + x * vb)
                 for x, w in zip(at, weights, strict=True)]  # fmt: skip
            stored += sum(w / 2 * (end - begin) * elastic((1 - x) * pa + x * pb)
                          * ((1 - x) * va + x * vb)
                          for x, w in zip(at, weights, strict=True))  # fmt: skip
            at_left, at_right = float(q @ (1 - at)), float(q @ at)
            left[j, :, i], right[j, :, i] = at_left * na, at_right * nb
            normal[j, i] += at_left
            normal[j, (i + 1) % n_b] += at_right
            share[j, i] += (end - begin) - (end**2 - begin**2) / 2
            share[j, (i + 1) % n_b] += (end**2 - begin**2) / 2
    fresh = np.maximum(share_rate, 0.0) / (share + ref.FRESH)
    return ByHand(left, right, normal, share, fresh, float(stored))
