"""Random drives that somebody could mean: any, or calm ones that nobody should be warned about; and
varied ones, of any law, mesh, model, layout, mount, load and contact, from a settled speed.

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
    """Return a drive, its torques, the end of its run, and what was drawn.

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
            torque, loads = _loads(rng, params, drawn | {"kind": kind}, calm=calm)
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
        way = int(params.info["winding"]) or -1  # a crossed belt begins clockwise
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


def _turned_over(rng: np.random.Generator, params: bd.Params) -> bd.Params:
    """Cross the belt of two pulleys, or press an idler on the back of a span; same strain."""
    pulleys, route = list(params.pulleys), params.route
    if len(pulleys) == 2 and chance(rng, 0.5):
        pulleys[1] = attrs.evolve(pulleys[1], side="outside")
    else:
        k = int(rng.integers(len(pulleys)))
        begin, end = route.leave[k], route.arrive[(k + 1) % len(pulleys)]
        span = end - begin
        out = np.array([span[1], -span[0]]) * float(params.info["winding"]) / np.hypot(*span)
        radius = min(float(np.hypot(*span)), 0.1) * rng.uniform(0.1, 0.4)
        pressed = radius * rng.uniform(0.05, 1.0)
        place = begin + rng.uniform(0.3, 0.7) * span + (radius - pressed) * out
        idler = bd.Pulley(
            center=(float(place[0]), float(place[1])), radius=radius, side="outside",
            inertia=0.5 * math.pi * 7800.0 * radius**4 * log_uniform(rng, 5e-3, 0.05),
        )  # fmt: skip
        pulleys.insert(k + 1, idler)
    tension = params.belt.axial_stiffness * (route.length / params.belt.length - 1.0)
    belt = attrs.evolve(params.belt, length=None, preload=tension)
    turned = attrs.evolve(params, belt=belt, pulleys=pulleys)
    fixed = attrs.evolve(belt, length=turned.effective_belt.length, preload=None)
    return attrs.evolve(turned, belt=fixed)


def _mount(rng: np.random.Generator, params: bd.Params, k: int, t_end: float) -> bd.Mount:
    """A take-up of pulley k, on a slider or an arm, with dry friction; or a path that it is led."""
    pulleys, tension = params.pulleys, float(params.info["strain_tension"])
    pulley, radius = pulleys[k], pulleys[k].radius
    route = params.route
    pull = route.arrive[k] - route.leave[k - 1]
    pull /= np.hypot(*pull)
    away = route.leave[k] - route.arrive[(k + 1) % len(pulleys)]
    out = pull + away / np.hypot(*away)  # against the pull of both spans
    if np.hypot(*out) < 0.1:
        raise ValueError("the belt hardly presses on the pulley")
    if chance(rng, 0.15):
        way = 1e-3 * radius * rng.uniform(-1.0, 1.0) * out
        return bd.Path(t=[0.0, 0.3 * t_end, 0.8 * t_end], displacement=[(0.0, 0.0), way, 0.3 * way])
    held = tension * float(np.hypot(*out))
    out /= np.hypot(*out)
    stiffness, mass = held / (0.2 * radius), log_uniform(rng, 0.1, 2.0)
    damping, friction = log_uniform(rng, 1.0, 100.0), held * log_uniform(rng, 0.01, 0.3)
    preload, travel = held * rng.uniform(0.7, 1.3), radius * log_uniform(rng, 0.01, 0.3)
    stopped, by_tension = chance(rng, 0.3), chance(rng, 0.3)
    if chance(rng, 0.5):
        return bd.Slider(
            direction=(float(out[0]), float(out[1])), mass=mass, stiffness=stiffness,
            damping=damping, friction=friction, stops=(-travel, travel) if stopped else None,
            **({"tension": tension} if by_tension else {"preload": preload}),
        )  # fmt: skip
    arm = radius * rng.uniform(0.8, 4.0)
    lean = rng.uniform(-0.7, 0.7) + (0.5 * math.pi if chance(rng, 0.5) else -0.5 * math.pi)
    c, s = math.cos(lean), math.sin(lean)
    to_pulley = arm * np.array([c * out[0] - s * out[1], s * out[0] + c * out[1]])
    lever = float(to_pulley[0] * out[1] - to_pulley[1] * out[0])
    x, y = np.array(pulley.center) - to_pulley
    return bd.Arm(
        pivot=(float(x), float(y)), inertia=mass * arm**2, mass=0.5 * mass,
        stiffness=stiffness * arm**2, damping=damping * arm**2, friction=friction * arm,
        stops=(-travel / arm, travel / arm) if stopped else None,
        **({"tension": tension} if by_tension else {"preload": preload * lever}),
    )  # fmt: skip


def _varied(
    rng: np.random.Generator, params: bd.Params, t_end: float
) -> tuple[bd.Params, bool, bool]:
    """Any law, of single pulleys too, any mesh, layout, mount, bearing and contact; and whether the
    run starts from a settled speed, and whether the belt runs round the pulleys on one side only.
    """
    belt, law = params.belt, params.friction
    changes: dict[str, Any] = {"mesh": "joint"} if chance(rng, 0.6) else {}
    if belt.bending_stiffness == 0.0 and chance(rng, 0.3):
        changes |= {"model": "string", "mesh": "joint"}
    turned, mounted = chance(rng, 0.3), chance(rng, 0.25)
    if mounted:
        changes |= {"mesh": "joint"}
    params = attrs.evolve(params, belt=attrs.evolve(belt, **changes))
    if turned:
        params = _turned_over(rng, params)
    pulleys = list(params.pulleys)
    if mounted:
        k = int(rng.integers(1, len(pulleys)))
        pulleys[k] = attrs.evolve(pulleys[k], mount=_mount(rng, params, k, t_end))
    friction = law
    if law is not None:
        assert isinstance(law, bd.Dahl)
        friction = _law(rng, law.mu_k, law.sigma)
        for k, pulley in enumerate(pulleys):
            if chance(rng, 0.1):
                pulleys[k] = attrs.evolve(pulley, friction=_law(rng, law.mu_k, law.sigma))
    tension = float(params.info["strain_tension"])
    for k, pulley in enumerate(pulleys):
        if chance(rng, 0.3):
            torque = tension * pulley.radius * log_uniform(rng, 1e-3, 0.1)
            speed = math.sqrt(0.1 * tension / belt.linear_density) / pulley.radius
            drag = bd.Drag(
                coulomb=torque if chance(rng, 0.6) else 0.0,
                viscous=torque / speed if chance(rng, 0.5) else 0.0,
                quadratic=torque / speed**2 if chance(rng, 0.3) else 0.0,
            )
            pulleys[k] = attrs.evolve(pulley, drag=drag)
    contact = params.contact
    if chance(rng, 0.1):
        contact = bd.Contact()
    elif chance(rng, 0.15):
        contact = attrs.evolve(contact, hunt_crossley=log_uniform(rng, 0.1, 10.0))
    settled = chance(rng, 0.7)
    params = attrs.evolve(params, pulleys=pulleys, friction=friction, contact=contact)
    return params, settled or turned, turned


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
    settled = turned = False
    t_end = min(0.2, max(0.02 * radians / RADIANS, radians / fastest))
    radii, wraps = lay.radii, lay.wraps
    if varied:
        params, settled, turned = _varied(rng, params, t_end)
        radii, wraps = np.array([p.radius for p in params.pulleys]), params.route.wraps
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
        "mesh": params._belt_facts["name"],
        "turned": turned,
        "mounted": len(params.mounted),
        "stiff_friction": sigma * info["strain"] * info["link_length"],
        "t_end": t_end,
        "wraps": wraps,
        # torque at which a pulley slips: tensions of mean T in the ratio exp(mu wrap)
        "capacity": 2.0 * pull * radii * np.tanh(0.5 * mu * wraps),
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
    if params.pulleys[other].side == "outside":
        push[other] *= -1.0

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
    if drawn["kind"] == "varied" and isinstance(torque, bd.Torque) and chance(rng, 0.5):
        torque = torque + _load(rng, other, capacity, top / radii, t_end)
    return torque, {
        "shape": shape,
        "full_slip": slips,
        "belt_speed": belt_speed,
        "high_speed": bool(top / float(radii.min()) > 3000.0 * RPM),
    }


def _load(
    rng: np.random.Generator, pulley: int, capacity: Array, top: Array, t_end: float
) -> bd.Torque:
    """A load, motor or excitation of a twentieth to a third of what a pulley can transmit.

    capacity: of the pulleys [N m]; top: their top speeds [rad/s].
    """
    torque, speed = float(capacity[pulley]) * log_uniform(rng, 0.05, 0.3), float(top[pulley])
    kind = str(rng.choice(["Load", "SpeedTable", "Motor", "Harmonics", "Step"]))
    if kind == "Load":
        shares = rng.dirichlet(np.ones(3)) * (rng.random(3) < 0.7)
        a, b, c = (torque * shares / [1.0, speed, speed**2]).tolist()
        return bd.Load(pulley, coulomb=a, viscous=b, quadratic=c)
    if kind == "SpeedTable":
        return bd.SpeedTable(
            pulley, speed * np.linspace(0.0, 1.5, 6), torque * rng.uniform(0.0, 1.0, 6)
        )
    if kind == "Motor":
        way = float(rng.choice([-1.0, 1.0])) * float(capacity[0]) / float(capacity[pulley])
        falling = np.array([1.0, 0.8, 0.9, 0.0, -0.9])
        return bd.Motor(
            0, float(top[0]) * np.array([-1.2, -0.5, 0.0, 0.9, 1.2]),
            torque * way * (falling if way > 0.0 else falling[::-1]),
            ramp=t_end * rng.uniform(0.05, 0.5),
        )  # fmt: skip
    if kind == "Harmonics":
        orders = np.array([1.0, float(rng.integers(2, 7))])
        return bd.Harmonics(pulley, orders, torque * rng.uniform(0.0, 1.0, 2))
    return bd.Step(pulley, t_end * rng.uniform(0.1, 0.9), torque * rng.choice([-1.0, 1.0]))
