"""Random drives that somebody could mean: any, or calm ones that nobody should be warned about; and
varied ones, of any law, mesh and model, with a take-up, from a settled speed.

A layout is found by construction, not by trial. Running round a convex loop the belt line leaves
pulley k along a tangent with normal n_k and unit vector t_k; the centres then differ by

    c_{k+1} - c_k = s_k t_k + (r_k - r_{k+1}) n_k,

s_k the length of the span. Angles (so wraps) and radii may be chosen at will; that the loop closes
asks of the spans two linear equations.

Numbers are drawn as what makes them large or small: damping as a share of critical, contact
stiffness as the penetration at rest over the radius, torques as a share of what the belt can carry
at all, 2 T r, so that none is out of all proportion.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import attrs
import numpy as np

import beltdyn as bd

Array = np.ndarray[Any, np.dtype[np.float64]]
RPM = math.pi / 30.0
#: Most of the mean tension that a calm drive may owe to its straight links.
MESH = 0.02
#: Radians of the fastest undamped motion in a run: some thousand steps, about 0.1 s of CPU time.
RADIANS = 2.0e4
KINDS = ("any", "calm", "varied")


def draw(
    seed: int, kind: str = "any", radians: float = RADIANS
) -> tuple[bd.Params, bd.TorqueLike, float, dict[str, Any]]:
    """Give a drive, its torques, the end of its run, and what was drawn.

    The run begins with :func:`start`. ``kind``: "any"; "calm": a fine mesh, moderate damping,
    stiffnesses and speeds, no full slip; "varied": as any, but see :func:`_varied`. Fewer
    ``radians`` make shorter runs.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {KINDS}, got {kind!r}")
    calm = kind == "calm"
    for attempt in itertools.count():
        rng = np.random.default_rng([seed, KINDS.index(kind), attempt])
        try:
            params, drawn = _drive(rng, radians, kind)
            torque, loads = _loads(rng, params, drawn, calm=calm)
        except ValueError:
            continue  # pulleys overlap, links too long for them, not calm enough
        drawn |= loads
        for name in ("wraps", "capacity"):
            del drawn[name]
        return params, torque, drawn["t_end"], {"seed": seed, "kind": kind} | drawn
    raise AssertionError


def start(params: bd.Params, drawn: dict[str, Any]) -> bd.State:
    """At rest under preload, or at once running at the speed drawn, the belt stiffly with it."""
    speed = drawn["belt_speed"]
    if drawn.get("settled") and speed:
        way = int(params.info["winding"])
        return bd.settle(params, speed={0: way * speed / params.pulleys[0].radius})
    rest = bd.settle(params)
    if speed == 0.0:
        return rest
    way = int(params.info["winding"])
    vphi = np.zeros(params.belt.n_bodies)
    for pulley in params.pulleys:
        distance = np.hypot(rest.x - pulley.center[0], rest.y - pulley.center[1])
        vphi[distance < pulley.radius] = way * speed / pulley.radius
    return attrs.evolve(
        rest,
        vx=speed * np.cos(rest.phi),
        vy=speed * np.sin(rest.phi),
        vphi=vphi,
        omega=np.array([way * speed / pulley.radius for pulley in params.pulleys]),
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def chance(rng: np.random.Generator, share: float) -> bool:
    return bool(rng.random() < share)


@attrs.frozen
class Layout:
    centers: list[tuple[float, float]]
    radii: Array
    wraps: Array
    idlers: list[bool]
    length: float  # of the belt line


def _layout(rng: np.random.Generator, *, calm: bool) -> Layout:
    n = int(rng.choice([2, 3, 4, 5], p=[0.4, 0.3, 0.15, 0.15]))
    idlers = [k >= 2 and chance(rng, 0.6) for k in range(n)]
    least, size = (0.05, 0.12) if calm else (0.012, log_uniform(rng, 0.03, 0.12))
    radii = np.array([log_uniform(rng, least, max(size, 1.5 * least)) for _ in range(n)])
    if n == 2:
        apart = (radii[0] + radii[1]) * rng.uniform(1.1, 2.0 if calm else 3.5)
        turn = rng.uniform(0.0, 2.0 * math.pi)
        lean = 2.0 * math.asin((radii[0] - radii[1]) / apart)
        wraps = np.array([math.pi + lean, math.pi - lean])
        spans = np.full(2, math.sqrt(apart**2 - (radii[0] - radii[1]) ** 2))
        points = np.array([[0.0, 0.0], [apart * math.cos(turn), apart * math.sin(turn)]])
    else:
        narrow = (0.3, 0.8) if calm else (0.05, 0.6)
        shares = np.array([rng.uniform(*(narrow if idler else (0.8, 2.5))) for idler in idlers])
        wraps = 2.0 * math.pi * shares / shares.sum()
        if wraps.max() > 0.95 * math.pi:
            raise ValueError("the spans beside it would not meet")
        normals = np.cumsum(wraps) + rng.uniform(0.0, 2.0 * math.pi)  # of the span after each
        normal = np.column_stack([np.cos(normals), np.sin(normals)])
        along = np.column_stack([-np.sin(normals), np.cos(normals)])
        across = (radii - np.roll(radii, -1))[:, None] * normal
        spans = (radii + np.roll(radii, -1)) * rng.uniform(1.05, 2.0 if calm else 3.5, n)
        spans -= np.linalg.pinv(along.T) @ (spans[:, None] * along + across).sum(axis=0)
        if spans.min() < 0.01:
            raise ValueError("spans of no length")
        points = np.vstack([np.zeros(2), np.cumsum(spans[:, None] * along + across, axis=0)[:-1]])
        if chance(rng, 0.5):
            points[:, 1] *= -1.0  # the other way round
    length = float(spans.sum() + wraps @ radii)
    centers = [(float(x), float(y)) for x, y in points]
    return Layout(centers, radii, wraps, idlers, length)


def _links(rng: np.random.Generator, lay: Layout, strain: float, *, calm: bool) -> int:
    """Any number; calm: so many that straight links do not raise the tension by more than MESH."""
    if not calm:
        return round(log_uniform(rng, 20, 150))
    for n in range(60, 241, 10):
        half = 0.5 * lay.length / n / lay.radii
        longer = float(lay.wraps @ (lay.radii * (np.tan(half) / half - 1.0))) / lay.length
        if longer / (longer + strain) < 0.95 * MESH:
            return n
    raise ValueError("too small pulleys for a fine mesh")


def _law(rng: np.random.Generator, mu: float, shear: float) -> bd.Friction:
    """Any law; half of those that take one with a Stribeck curve. shear: sigma [1/m]."""
    kind = str(rng.choice(["Dahl", "LuGre", "Coulomb", "CreepRate", "Threlfall",
                           "ElasticPlastic", "MaxwellSlip"]))  # fmt: skip
    curve = {}
    if chance(rng, 0.5) or kind == "LuGre":
        curve = {"mu_s": mu * rng.uniform(1.05, 2.5), "v_stribeck": log_uniform(rng, 3e-3, 0.5)}
    if kind == "Dahl":
        return bd.Dahl(mu_k=mu, sigma=shear, **curve)
    if kind == "LuGre":
        damping = log_uniform(rng, 1e-3, 1.0) if chance(rng, 0.5) else 0.0
        return bd.LuGre(mu_k=mu, sigma=shear, damping=damping, **curve)
    if kind == "Coulomb":
        return bd.Coulomb(mu=mu, v_reg=log_uniform(rng, 1e-3, 0.1), **curve)
    if kind == "CreepRate":
        return bd.CreepRate(mu=mu, v_critical=log_uniform(rng, 1e-3, 0.1))
    if kind == "Threlfall":
        return bd.Threlfall(mu=mu, v_reg=log_uniform(rng, 1e-3, 0.1))
    stiffness = log_uniform(rng, 1e6, 1e10)
    if kind == "ElasticPlastic":
        return bd.ElasticPlastic(mu=mu, stiffness=stiffness, damping=1e-5 * stiffness, **curve)
    parts = rng.uniform(0.2, 1.0, 3)
    return bd.MaxwellSlip(
        mu=tuple(mu * parts / parts.sum()),
        stiffness=tuple(stiffness * np.array([1.0, 0.3, 0.1])),
        damping=tuple(1e-5 * stiffness * np.array([1.0, 0.3, 0.1])),
        **curve,
    )


def _varied(rng: np.random.Generator, params: bd.Params) -> tuple[bd.Params, bool]:
    """Any law and mesh, a belt of hardly any mass or without damping now and then, take-ups on a
    slider with dry friction; and whether the run starts from a settled speed.
    """
    belt, law = params.belt, params.friction
    changes: dict[str, Any] = {"mesh": "joint"} if chance(rng, 0.6) else {}
    if belt.bending_stiffness == 0.0 and chance(rng, 0.3):
        changes |= {"model": "string", "mesh": "joint"}
    if law is not None:
        assert isinstance(law, bd.Dahl)
        law = _law(rng, law.mu_k, law.sigma)
    pulleys = list(params.pulleys)
    if len(pulleys) > 2 and chance(rng, 0.25):
        k = int(rng.integers(1, len(pulleys)))
        before, after = pulleys[k - 1].center, pulleys[(k + 1) % len(pulleys)].center
        out = 2.0 * np.array(pulleys[k].center) - before - after
        tension = float(params.info["strain_tension"])
        mount = bd.Slider(
            direction=(float(out[0]), float(out[1])), mass=log_uniform(rng, 0.1, 2.0),
            stiffness=tension / (0.2 * pulleys[k].radius), preload=tension * rng.uniform(0.5, 1.5),
            damping=log_uniform(rng, 1.0, 100.0), friction=tension * log_uniform(rng, 0.01, 0.3),
        )  # fmt: skip
        pulleys[k] = attrs.evolve(pulleys[k], mount=mount)
    params = attrs.evolve(params, belt=attrs.evolve(belt, **changes), pulleys=pulleys, friction=law)
    return params, chance(rng, 0.7)


def _drive(rng: np.random.Generator, radians: float, kind: str) -> tuple[bd.Params, dict[str, Any]]:
    calm, varied = kind == "calm", kind == "varied"
    lay = _layout(rng, calm=calm)
    strain = log_uniform(rng, 0.008, 0.02) if calm else log_uniform(rng, 0.002, 0.02)
    n_bodies = _links(rng, lay, strain, calm=calm)
    stiffness = log_uniform(rng, 2e4, 2e5) if calm else log_uniform(rng, 5e3, 5e5)
    density = log_uniform(rng, 0.03, 0.3)
    if varied and chance(rng, 0.1):
        density *= log_uniform(rng, 1e-3, 0.1)  # hardly any mass
    tension, least = stiffness * strain, float(lay.radii.min())
    length = lay.length / (1.0 + strain)
    fastest = 2.0 * n_bodies / length * math.sqrt(stiffness / density)  # of the joints [1/s]
    # shares of critical damping, of that motion and of the belt on its contact
    damping = log_uniform(rng, 0.1, 1.0) if calm else log_uniform(rng, 1e-3, 10.0)
    if varied and chance(rng, 0.1):
        damping = 0.0
    of_contact = log_uniform(rng, 0.1, 1.0) if calm else log_uniform(rng, 1e-2, 10.0)
    sunk = log_uniform(rng, 1e-4, 1e-3) if calm else log_uniform(rng, 1e-5, 1e-2)
    linear = tension / (least * sunk * least)
    quadratic = linear / (sunk * least) * rng.uniform(0.0, 1.0) if chance(rng, 0.5) else 0.0
    bending = 0.0
    if chance(rng, 0.5):
        bending = tension * least**2 * log_uniform(rng, 1e-3, 0.03 if calm else 0.3)
    friction = None
    if calm:
        stretch = strain * length / n_bodies
        friction = bd.Dahl(
            mu_k=rng.uniform(0.5, 1.2), sigma=min(log_uniform(rng, 1e3, 1e5), 3.0 / stretch)
        )
    elif not chance(rng, 0.05):
        friction = bd.Dahl(mu_k=rng.uniform(0.2, 1.2), sigma=log_uniform(rng, 1e3, 1e6))
    inertia = [  # of steel discs 2 to 60 mm thick
        0.5 * math.pi * 7800.0 * r**4 * log_uniform(rng, 0.01 if calm else 2e-3, 0.06)
        for r in lay.radii
    ]
    params = bd.Params(
        belt=bd.Belt(
            length=length, n_bodies=n_bodies, linear_density=density, axial_stiffness=stiffness,
            axial_damping=stiffness * 2.0 * damping / fastest, bending_stiffness=bending,
            mesh="paper",
        ),
        pulleys=[
            bd.Pulley(center=c, radius=float(r), inertia=i)
            for c, r, i in zip(lay.centers, lay.radii, inertia, strict=True)
        ],
        contact=bd.Contact(quadratic=quadratic, linear=linear,
                           damping=2.0 * of_contact * math.sqrt(linear * density)),
        friction=friction,
        gravity=(0.0, -9.81) if chance(rng, 0.3) else (0.0, 0.0),
    )  # fmt: skip
    settled = False
    if varied:
        params, settled = _varied(rng, params)
    info = params.info
    share = info["mesh_strain"] / (info["mesh_strain"] + info["strain"])
    if calm and share > MESH:
        raise ValueError("the mesh is too coarse")
    mu, sigma = (0.5, 0.0) if friction is None else (friction.mu_k, friction.sigma)
    pull = stiffness * (info["mesh_strain"] + info["strain"])
    drawn = {
        "idlers": sum(lay.idlers),
        "link_over_radius": info["link_length"] / least,
        "mesh_share": share,
        "tension": pull,
        "damping": damping,
        "light_damping": damping < 0.02,
        "contact_damping": of_contact,
        "friction": None if params.friction is None else params.friction.law,
        "settled": settled,
        "mesh": params.belt_model if params.belt_model == "string" else params.belt.mesh,
        "mounted": len(params.mounted),
        "stiff_friction": sigma * info["strain"] * info["link_length"],
        "t_end": min(0.2, max(0.02 * radians / RADIANS, radians / fastest)),
        "wraps": lay.wraps,
        # torque at which a pulley slips: tensions of mean T in the ratio exp(mu wrap)
        "capacity": 2.0 * pull * lay.radii * np.tanh(0.5 * mu * lay.wraps),
    }
    return params, drawn


def _loads(
    rng: np.random.Generator, params: bd.Params, drawn: dict[str, Any], *, calm: bool
) -> tuple[bd.TorqueLike, dict[str, Any]]:
    """Torques on pulley 0 and against it on another, and the speed to start from.

    The drive stays below a top speed, of up to 10 000 rpm, at which the belt's inertia carries less
    than a third of its tension: what would bring it beyond is taken off by the other pulley.
    """
    n, t_end, tension = len(params.pulleys), drawn["t_end"], drawn["tension"]
    capacity = drawn["capacity"]
    radii = np.array([pulley.radius for pulley in params.pulleys])
    inertia = np.array([pulley.inertia for pulley in params.pulleys])
    rho = params.belt.linear_density
    top = log_uniform(rng, 100.0, 2000.0 if calm else 10_000.0) * RPM * float(radii.min())
    top = min(top, math.sqrt((0.02 if calm else 0.3) * tension / rho))
    running = chance(rng, 0.3 if calm else 0.5)
    belt_speed = top * rng.uniform(0.1, 0.2 if calm else 0.9) if running else 0.0

    share = log_uniform(rng, 0.05, 0.35) if calm else log_uniform(rng, 0.05, 0.9)
    slips = not calm and params.friction is not None and chance(rng, 0.12)
    other = int(rng.integers(1, n))
    # masses felt at the belt, and the pull that brings them to the top speed
    mass = float(np.sum(inertia / radii**2)) + rho * params.belt.length
    most = (top - belt_speed) / t_end
    if slips:
        passed = min(1.0, 0.9 * capacity[other] / radii[other] * radii[0] / capacity[0])
        pull = passed * capacity[0] / radii[0]  # what friction hands on, taken off again
        spare = min(rng.uniform(0.2, 1.0) * pull, most * inertia[0] / radii[0] ** 2)
        passed = pull
    elif params.friction is None:
        spare, passed = most * inertia[0] / radii[0] ** 2, 0.0
    else:
        pull = share * min(capacity[0] / radii[0], capacity[other] / radii[other])
        spare = min(pull, most * mass)
        passed = pull - spare
        slow = spare / mass * inertia / radii
        if calm and np.any(slow > 0.3 * capacity):
            raise ValueError("an idler would slip")
    way = float(rng.choice([-1.0, 1.0]))
    push = np.zeros(n)  # what the shape of the torque multiplies
    push[0] = way * (spare + passed) * radii[0]
    push[other] = -way * passed * radii[other]

    kinds = ["ramp", "sine", "function"] if calm else ["ramp", "step", "sine", "function"]
    shape = str(rng.choice(kinds))
    at = t_end * rng.uniform(0.05, 0.6)
    frequency = rng.uniform(1.0, 3.0 if calm else 10.0) / t_end
    phase = rng.uniform(0.0, 2.0 * math.pi)
    load = np.zeros(n)
    if chance(rng, 0.5):
        load[other] = spare * radii[other] / (max(top, 0.1) / radii[other]) * rng.uniform(0.0, 1.0)

    torque: bd.TorqueLike
    if shape == "ramp":
        torque = bd.PiecewiseLinear([0.0, at], [0.0 * push, push])
    elif shape == "step":
        torque = bd.PiecewiseLinear([at, at], [0.0 * push, push])
    elif shape == "sine":
        times = np.linspace(0.0, t_end, 1 + round(20 * frequency * t_end))
        torque = bd.PiecewiseLinear(
            times, 0.5 * (1.0 - np.cos(2.0 * math.pi * frequency * times))[:, None] * push
        )
    if shape == "function":
        base, drive, drag = 2.0 * math.pi * frequency, push.tolist(), load.tolist()

        def torque(t: float, theta: Array, omega: Array) -> list[float]:
            rise = 0.5 * (1.0 - math.cos(math.pi * min(t / at, 1.0)))
            rise *= 0.8 + 0.2 * math.cos(base * t + phase)
            return [rise * m - c * w for m, c, w in zip(drive, drag, omega, strict=True)]

    elif load.any():
        torque = torque + bd.Viscous(load)
    return torque, {
        "shape": shape,
        "full_slip": slips,
        "belt_speed": belt_speed,
        "high_speed": bool(top / float(radii.min()) > 3000.0 * RPM),
    }
