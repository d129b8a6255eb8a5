"""Drives with an ALE belt, states of theirs and the oracle's rates there, as text in numbers.

`python tests/ale_cases.py > FILE` writes what the C programs tests/c/test_ale*.c read: a name, how
many numbers, the numbers (to the last bit); a drive begins with `case NAME`. States are off steady
ones by some 5 % of what errors are measured by, in both directions of flow and about rest, where J
changes its sign within arcs.
"""

from __future__ import annotations

from typing import Any

import ale_reference_run as runs
import attrs
import drives
import laws
import numpy as np
import reference_mounts
from ale_reference import Ale
from bridge import ale_oracle_of as ale_of
from reference_friction import Array

import beltdyn as bd

LAWS = (
    "Dahl", "LuGre", "ElasticPlastic", "Coulomb", "CreepRate", "Threlfall", "MaxwellSlip",
)  # fmt: skip
"""In the order of the core's table."""


def put(name: str, values: Any) -> None:
    flat = np.asarray(values, dtype=float).ravel()
    print(name, len(flat), *(float(x).hex() for x in flat))


def put_law(law: Any) -> None:
    """Number of the law, 0 without one, and its parameters; of lists, their length before them."""
    found: list[float] = [0.0]
    if law is not None:
        found = [1.0 + LAWS.index(type(law).__name__)]
        for name in type(law).__dataclass_fields__:
            value = getattr(law, name)
            found += [len(value), *value] if isinstance(value, tuple) else [value]
    put("law", found)


def put_drive(name: str, model: Ale, n: int) -> None:
    put(f"case {name}", [n, model.n_m, bool(model.mounts)])
    put("n_p", model.n_p)
    put("n", model.n)
    put("K", model.n_modes)
    put("sense", model.sense)
    put("sides", model.s)
    put("radii", model.radii)
    put("length", model.length)
    put("rhoA", model.linear_density)
    put("EA", model.axial_stiffness)
    put("etaA", model.axial_damping)
    put("EI", model.bending_stiffness)
    put("etaI", model.bending_damping)
    put("contact", model.contact[:2])
    put("gravity", model.g)
    put("h_0", model.h_0)
    put("p_0", model.compensated)
    put("on", model.on)
    put("EI_n", np.broadcast_to(model.stiff, (model.n_p, model.n_modes)))
    put("inertias", model.inertias)
    put("sprung", model.sprung)
    put("centers", places_of(model, model.q_0))
    for law in model.friction:
        put_law(law)


def places_of(model: Ale, q: Array) -> Array:
    """Where the axes are with these travels, paths at t = 0."""
    places = np.array(model.centers, dtype=float)
    for j, one in model.mounts.items():
        travel = q[model.sprung.index(j)] if j in model.sprung else 0.0
        places[j] = one.place(travel, model.centers[j])
    return places


def put_state(model: Ale, y: Array) -> None:
    rate, geo = model.rate(0.0, y), model.geometry(0.0, y)
    ax = model.axial(y, geo)
    for name in ("m", "v", "z", "a", "p", "omega"):
        put(name, model.get(y, name))
    for name in ("m", "v", "z", "a", "p"):
        put(f"d_{name}", model.get(rate, name))
    q, dq, zeta = (model.get(y, name) for name in ("q", "dq", "zeta"))
    omega = model.get(y, "omega")
    carrier = np.zeros_like(omega)
    own, bend, speed = [], np.zeros((model.n_p, 2)), np.zeros(model.n_p)
    for i, j in enumerate(model.sprung):
        one = model.mounts[j]
        force = one.spring(q[i]) + one.damper(dq[i]) - one.friction * zeta[i]
        force = force + one.stop(q[i], dq[i]) + one.weighs * (geo.lever[j] @ model.g)
        speed[j] = dq[i]
        if one.carries_bearing:
            carrier[j] = dq[i]
            bend[j] = -geo.lever[j][1], geo.lever[j][0]
        own.append([one.moved, float(force)])
    resists = model.bearing(omega - carrier)
    for i, j in enumerate(model.sprung):
        if model.mounts[j].carries_bearing:
            own[i][1] += float(resists[j])
    put("torque_of_belt", model.get(rate, "omega") * model.inertias + resists)
    put("W", np.stack((ax.share, ax.cuts), axis=-3))
    put("ax_tension", ax.tension)
    put("ax_flow", ax.flow)
    put("ax_pressing", ax.pressing)
    put("geo_span", geo.span)
    put("geo_wrap", geo.wrap)
    put("geo_axis", geo.axis)
    put("geo_lever", geo.lever)
    put("geo_known", geo.known)
    put("d_works", model.get(rate, "works"))
    stored = model.energy(0.0, y)
    for name in ("elastic", "contact", "bending", "kinetic", "lateral"):
        put(f"E_{name}", stored[name])
    put("places", places_of(model, q))
    put("bend", bend)
    put("speed", speed)
    if model.n_m:
        put("mount_own", own)
        put("d_dq", model.get(rate, "dq"))


def put_case(
    name: str, params: bd.Params, speeds: tuple[float, ...], n: int = 3, amplitude: float = 0.05,
    **changes: Any,
) -> None:  # fmt: skip
    model = ale_of(params, **changes)
    rng = np.random.default_rng(1)
    put_drive(name, model, n * len(speeds))
    scale = runs.scales(model)
    for speed in speeds:
        begins = runs.at_speed(model, speed)
        for _ in range(n):
            off = amplitude * scale * rng.normal(size=model.size)
            for field in ("theta", "works"):
                off[model.layout[field][0]] = 0.0
            where, shape = model.layout["z"]
            off[where] = (rng.uniform(-0.6, 0.6, size=shape) * model.get(scale, "z")).ravel()
            where = model.layout["a"][0]
            off[where] = 2e-3 * rng.normal(size=where.stop - where.start)
            off[model.layout["zeta"][0]] = rng.uniform(-0.8, 0.8, size=model.n_m)
            y, where = begins + off, model.layout["m"][0]
            y[where] *= begins[where].sum() / y[where].sum()
            put_state(model, y)


def main() -> None:
    u = drives.scene_u().params
    down = {"gravity": (0.0, -9.81)}
    slow = (-63.0, 63.0)
    slider = reference_mounts.Slider(
        direction=(1.0, 0.3), mass=0.4, stiffness=2e4, preload=640.0, damping=50.0, friction=20.0,
        stops=(-0.002, 0.0001),
    )  # fmt: skip
    other = reference_mounts.Slider(
        direction=(-1.0, 0.2), mass=0.3, stiffness=2e5, preload=640.0, damping=50.0
    )
    path = reference_mounts.Path(
        t=(-1e-2, 0.0045, 2e-2), displacement=((0.0, 0.0), (1e-3, 5e-4), (2e-3, 0.0))
    )
    put_case("u_ei0", u, slow, bending_stiffness=0.0)
    put_case("u", u, slow)
    put_case("u_still", u, (0.0,))
    put_case("u_still_lugre", attrs.evolve(u, friction=laws.STRIBECK["lugre"]), (0.0,))
    put_case("u_fast", u, (-628.0, 628.0), n_modes=4)
    put_case("u_damped", u, slow, bending_stiffness=0.02, bending_damping=1e-4, **down)
    put_case("u_compensated", u, slow, compensate=True)
    put_case("u_slack", u, slow, amplitude=0.6)  # H from -1.1 to 0.3 H0 where it is least
    put_case("crossed", drives.crossed_scene().params, (-50.0, 50.0), bending_damping=1e-4)
    put_case("idler", drives.idler_scene().params, (-50.0, 50.0))
    put_case("serpentine", bd.scenes.serpentine(120).params, (-300.0, 300.0))
    put_case("slider", u, slow, mounts={1: slider}, **down)
    put_case("two_sliders", u, slow, mounts={0: other, 1: slider})
    put_case("slider_loses", u, slow, mounts={1: slider}, bending_damping=1e-4)
    put_case("path", u, slow, mounts={0: other, 1: path})
    for name, law in (laws.EXAMPLES | {f"{k}_curve": v for k, v in laws.STRIBECK.items()}).items():
        put_case(f"law_{name}", attrs.evolve(u, friction=law), slow, n=2)
    print("end 0")


if __name__ == "__main__":
    main()
