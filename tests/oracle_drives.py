"""Drives and random states of the oracle that tests share."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
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
from reference_line import spans_away
from reference_mounts import Arm, Mount, Path, Slider, Sprung
from reference_string import as_string

# Links of the small drives press with some 100 N and slide at up to 1 m/s: friction changes over
# about a millimetre, and dampers carry up to half of it.
DAHL = Dahl(mu_k=0.8, sigma=2e3)
LUGRE = LuGre(mu_k=0.5, mu_s=0.7, v_stribeck=0.05, sigma=2e3, damping=0.5, viscous=0.1)
ELASTIC = ElasticPlastic(mu=0.6, stiffness=1e6, damping=500.0)
STRAIN = 0.006  # 48 N
GRAVITY = (1.0, -9.81)
DRAG = (0.05, 1e-3, 1e-5)
ARM = Arm(pivot=(0.21, 0.12), inertia=0.004, mass=0.3, stiffness=15.0, preload=3.3, damping=0.05,
          friction=0.4)  # fmt: skip
SLIDER = Slider(
    direction=(2.9, 0.3), mass=2.0, weight=9.0, stiffness=500.0, damping=30.0, friction=8.0
)
PATH = Path(t=(0.0, 0.004, 0.01), displacement=((0.0, 0.0), (1e-3, 5e-4), (2e-3, -1e-3)))


def no_torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
    return np.zeros_like(omega)


def small_drive(**changes: Any) -> ref.Reference:
    """24 soft links on the paper's pulleys: 100 times fewer right-hand sides per second."""
    data = {"axial_stiffness": 7e3, "axial_damping": 2.0, "contact": (1e8, 5e6, 200.0)}
    return ref.paper_drive(24, **(data | {"mu_k": 0.8, "sigma": 2e3} | changes))


def three_pulleys(**changes: Any) -> ref.Reference:
    """Counter-clockwise, unequal."""
    data: dict[str, Any] = {
        "length": 1.55,
        "centers": np.array([[0.0, 0.0], [0.4, -0.05], [0.2, 0.3]]),
        "radii": np.array([0.1, 0.07, 0.05]),
        "inertias": np.array([0.01, 0.02, 0.005]),
        "winding": 1,
    }
    return ref.paper_drive(40, **(data | changes))


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
    mounts = {1: dataclasses.replace(SLIDER, **(changes or {}))}
    return drive([[0.0, 0.0], [0.29, 0.03]], [0.1, 0.08], (1, 1), **({"mounts": mounts} | others))


def every(**others: Any) -> ref.Reference:
    """An arm, a path and a slider on one belt; drag on every pulley."""
    mounts: dict[int, Mount] = {
        1: dataclasses.replace(ARM, stops=(-0.2, 0.1)),
        2: PATH,
        3: Slider(direction=(0.0, -2.0), mass=0.5, weight=4.0, damping=20.0, friction=5.0,
                  friction_stiffness=1e4, stops=(-1e-5, 1e-5)),
    }  # fmt: skip
    laws = (DAHL, LUGRE, ELASTIC, None)
    given = {"mounts": mounts, "friction": laws, "drag": np.array([DRAG] * 4), "gravity": GRAVITY}
    return drive(
        [[0.0, 0.0], [0.13, 0.085], [0.30, 0.02], [0.16, -0.13]], [0.08, 0.04, 0.10, 0.05],
        (1, -1, 1, 1), **(given | others),
    )  # fmt: skip


MOTION: dict[int, ref.Motion] = {
    1: lambda t: (5.0 * math.cos(20.0 * t), -100.0 * math.sin(20.0 * t)),
    2: lambda t: (-4.0 - 300.0 * t, -300.0),
}
LAWS_OF_THREE = (Dahl(0.7, 2e4), LUGRE, ELASTIC)
MODELS: dict[str, Callable[[], ref.Reference]] = {
    "paper": ref.paper_drive,
    "paper, bearing drag, bending": lambda: ref.paper_drive(
        gravity=GRAVITY, bending_damping=0.02, bending_stiffness=0.5,
        drag=np.array([[3.0, 0.1, 0.02], [1.0, 0.0, 0.3]]),
    ),
    "three laws, motions": lambda: three_pulleys(friction=LAWS_OF_THREE, motion=MOTION),
    "joints, three laws": lambda: three_pulleys(mesh="joint", friction=LAWS_OF_THREE),
    "joints, no friction": lambda: three_pulleys(mesh="joint", mu_k=None, sigma=None),
    "arm in its stops": lambda: arm({"stops": (-1e-5, 1e-5)}, gravity=GRAVITY),
    "slider, LuGre": lambda: slider(friction=(LUGRE, LUGRE)),
    "path, elastic/plastic": lambda: slider(mounts={1: PATH}, friction=(ELASTIC, ELASTIC)),
    "arm, path and slider": every,
    "string": lambda: as_string(ref.paper_drive()),
    "string, crossed": lambda: as_string(
        drive([[0.0, 0.0], [0.35, 0.05]], [0.06, 0.10], (1, -1), friction=(ELASTIC, None),
              winding=0)
    ),
    "string, arm, path and slider, motions": lambda: as_string(every(motion=MOTION)),
}  # fmt: skip


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
