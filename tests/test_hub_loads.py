"""Hub loads, ``pulleys.load``: what the belt does to its pulleys, by contact and friction.

Held to the oracle's forces of contact at states anywhere, to Newton's law for the whole belt with
the accelerations of the rate's own kernels and over runs, to span statics at rest and running, and
to the forces in the equations of mounts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import attrs
import dense
import drives
import mounted_drives
import numpy as np
import pytest
import reference
from bridge import oracle_of
from laws import EXAMPLES, core_law, oracle_law

import beltdyn as bd
from beltdyn import _core
from beltdyn.base.checks import Array
from beltdyn.drive.route import Route

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

State = dict[str, Any]

#: Relative to the sum of the magnitudes of all contact forces: penetrations of 1e-5 m are
#: differences of places known to 5e-17 m, and some hundred forces are summed in two orders.
ROUNDING = 1e-10


def observed(model: _core.Model, state: State) -> Array:
    return np.asarray(model.observe(state)["load"][0])


def plain(mesh: str, law: str, hunt_crossley: float) -> bd.Params:
    params = drives.on_mesh(drives.plain(), mesh)
    contact = attrs.evolve(params.contact, hunt_crossley=hunt_crossley)
    return attrs.evolve(params, friction=EXAMPLES[law], contact=contact, gravity=(1.0, -9.81))


#: Every belt, law, mount and layout, and how mounts are moved if they are not just moving.
DRIVES: dict[str, Callable[[], bd.Params]] = {
    "paper's mesh": lambda: plain("paper", "dahl", 0.0),
    "paper's mesh, lugre": lambda: plain("paper", "lugre", 0.5),
    "joint mesh": lambda: plain("joint", "elastic_plastic", 0.5),
    "string": lambda: plain("string", "dahl", 0.5),
    "crossed": lambda: drives.crossed_scene().params,
    "idler": lambda: drives.on_mesh(drives.idler_scene().params, "paper"),
} | mounted_drives.DRIVES
HOW = {"arm with stops": "stops", "slider, gravity": "saturated", "string, arm": "saturated"}
HOW |= {"arm and slider, three laws": "saturated", "string, arm with stops": "stops"}


@cache
def shaken(name: str) -> tuple[_core.Model, reference.Reference, State]:
    """A state under way whose links and mounts are displaced and moving, so that links are on and
    off the pulleys, and friction anywhere between nothing and what it was.
    """
    params, rng = DRIVES[name](), np.random.default_rng(1)
    torque = mounted_drives.torque(params)
    run = bd.simulate(params, torque, 0.02, t_eval=[0.02], rtol=1e-2, outputs=("pulleys.omega",))
    oracle, state = oracle_of(params), run.final_state._to_core(params)
    scales = {"x": 1e-5, "y": 1e-5, "phi": 1e-3, "vx": 1.0, "vy": 1.0, "vphi": 50.0}
    for key, scale in scales.items():
        state[key] = state[key] + scale * rng.standard_normal(oracle.n_bodies)
    state["omega"] = state["omega"] + 5.0 * rng.standard_normal(oracle.n_pulleys)
    state["mu"] = state["mu"] * rng.uniform(-1.0, 1.0, np.shape(state["mu"]))
    how = HOW.get(name, "moving")
    return params._model, oracle, mounted_drives.shake_mounts(oracle, state, 1, how)


def overlapping(mesh: str) -> tuple[_core.Model, reference.Reference, State]:
    """A ring through two pulleys that overlap, which no Params has: links on none, one and both."""
    law = oracle_law(EXAMPLES["dahl"])
    given = {"centers": np.array([[0.0, 0.0], [0.05, 0.02]]), "radii": np.array([0.1, 0.09])}
    given |= {"length": 0.6, "contact": (5e8, 2.5e6, 1e2), "gravity": (1.0, -9.81)}
    o = reference.paper_drive(40, mesh=mesh, friction=(law, law), **given)
    belt = (o.length, o.n_bodies, o.linear_density, o.axial_stiffness, o.axial_damping,
            o.bending_stiffness, o.bending_damping)  # fmt: skip
    model = _core.Model(
        belt, o.centers, o.radii, o.inertias, (*o.contact, int(o.compensate), o.hunt_crossley),
        None, o.gravity, None, [core_law(law)] * 2, o.mesh, None, model="links",
    )  # fmt: skip
    rng, angle = np.random.default_rng(1), np.linspace(0.0, -2 * np.pi, 40, endpoint=False)
    state = {"x": 0.025 + 0.115 * np.cos(angle), "y": 0.01 + 0.085 * np.sin(angle), "t": 0.0}
    state |= {"phi": angle - np.pi / 2, "theta": np.zeros(2), "omega": rng.uniform(-20, 20, 2)}
    state |= {name: rng.uniform(-0.5, 0.5, 40) for name in ("vx", "vy")}
    n = 40 * (1 + max(dense.slots_of(o)))
    state |= {"vphi": rng.uniform(-50, 50, 40), "mu": rng.uniform(-0.7, 0.7, n)}
    return model, o, state | {"slip": np.zeros(n)}


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", [*DRIVES, "overlapping, paper", "overlapping, joint"])
def test_loads_are_those_of_the_oracle_and_of_newton(name: str) -> None:
    """With links on one pulley, on two at once and on none; of every mesh and friction law, and of
    axes that move: what a mount takes of the load is the force of the belt in its equation.
    """
    _, _, mesh = name.partition("overlapping, ")
    model, oracle, state = overlapping(mesh) if mesh else shaken(name)
    y = dense.vector_of_oracle(oracle, state, dense.slots_of(oracle))
    at = oracle.contacts(y)
    on_belt = -(at.friction[:, None, :] * at.tangent).sum(axis=-1)
    if oracle.mesh == "joint":
        on_belt = on_belt + oracle.along_links_at(y).on_links().T
    else:
        on_belt = on_belt + (at.normal[:, None, :] * at.outward).sum(axis=-1)
    scale = float(np.abs(at.normal).sum() + np.abs(at.friction).sum())
    load, seen = observed(model, state), model.observe(state)
    assert load.shape == (oracle.n_pulleys, 2)
    assert np.abs(load + on_belt).max() <= ROUNDING * scale
    if mesh:
        touching = (oracle.penetration(y) > 0).sum(axis=0)
        assert set(touching) == {0, 1, 2}
    # Newton: the weight of the links less the rate of their momentum is the sum of the loads;
    # accelerations are sums of joint forces as well, which cancel: up to 5e-11 of those each
    mass, rate = model.info["link_mass"], model.rate(state, np.zeros(oracle.n_pulleys))
    weight = oracle.n_bodies * mass * np.asarray(oracle.gravity, dtype=float)
    left = weight - [mass * np.sum(rate[name]) for name in ("vx", "vy")]
    joints = np.abs(seen["force"]).sum()
    assert np.abs(load.sum(axis=0) - left).max() <= ROUNDING * (scale + joints)
    axes = oracle.axes(y)
    for m, (k, mount) in enumerate(oracle.mounts.items()):
        if hasattr(mount, "pivot"):
            reach = axes[k] - np.array(mount.pivot)
            found, arm = reach[0] * load[k, 1] - reach[1] * load[k, 0], np.hypot(*reach)
        elif hasattr(mount, "direction"):
            found, arm = np.array(mount.direction) @ load[k] / np.hypot(*mount.direction), 1.0
        else:
            continue
        assert seen["belt_force"][0][m] == pytest.approx(found, abs=ROUNDING * scale * arm)


def idler(n_bodies: int, model: str, bending: float = 0.0) -> bd.Params:
    """Two pulleys and an idler on the back of the belt, preloaded to 400 N; contact compensated."""
    params = drives.idler_scene().params
    changes = {"n_bodies": n_bodies, "bending_stiffness": bending, "model": model}
    belt = attrs.evolve(params.belt, length=None, preload=400.0, **changes)
    return attrs.evolve(params, belt=belt)


def statics(tensions: Array, line: Route) -> Array:
    """What the spans at both sides pull of a pulley (n_p, 2): T_1 d_1 + T_2 d_2."""
    along = np.roll(line.arrive, -1, axis=0) - line.leave
    pull = tensions[:, None] * along / np.hypot(*along.T)[:, None]
    return np.asarray(pull - np.roll(pull, 1, axis=0))


def off_statics(load: Array, expected: Array) -> Array:
    return np.asarray(np.hypot(*(load - expected).T) / np.hypot(*expected.T))


def straight_line(params: bd.Params, tension: float) -> Route:
    """The belt line that the straight parts of the spans lie on.

    Where the belt leaves a rim it is not bent at once. On an elastic contact, of stiffness c to
    the metre, it rises from its depth T / (c r) to 0 within sqrt(T / c); against its bending
    stiffness it straightens within sqrt(EI / T). Both have it meet the rim at the angle of that
    length over r, and the straight part passes the axis at r + T / (2 c r), r + EI / (2 T r).
    """
    bends, gives = params.belt.bending_stiffness / tension, tension / params.contact.linear
    further = [
        attrs.evolve(one, radius=one.radius + 0.5 * (bends + gives) / one.radius)
        for one in params.pulleys
    ]
    return bd.route(further)


@pytest.mark.parametrize(("model", "bending"), [("string", 0.0), ("links", 0.0), ("links", 0.02)])
def test_at_rest_loads_are_what_the_spans_pull(model: str, bending: float) -> None:
    """To 0.2 %, on a fine mesh. Of the idler's load bending is 2 %, compliance 0.08 %.

    Where a wrap ends a link of length l lies on it in part and may leave the line by l^2 / (8 r),
    which turns a span of length s by that over s, at both ends. The load of a pulley of wrap w,
    2 T sin(w / 2), grows by that over tan(w / 2) at most.
    """
    params = idler(360, model, bending)
    start = bd.settle(params)
    load = observed(params._model, start._to_core(params))
    tension = start.tension(params).spans
    assert np.abs(load.sum(axis=0)).max() <= 1e-8 * np.abs(load).sum(), "it is at rest"
    line = straight_line(params, 400.0)
    kink = params.info["link_length"] ** 2 / (8.0 * params.pulleys[1].radius)
    of_mesh = 2.0 * kink / line.spans.min() / np.tan(line.wraps.min() / 2.0)
    assert of_mesh < 0.002
    off = off_statics(load, statics(tension, line))
    assert (off <= of_mesh).all(), (off, of_mesh)
    if bending:
        assert off_statics(load, statics(tension, params.route)).max() > 0.015


@pytest.mark.parametrize("method", ["tsit5", "rk4", "rodas4", "lbdf2", "lie"])
def test_loads_are_sampled_by_every_method(method: str) -> None:
    """As of the states that each passes through, to the bit."""
    scene = drives.idler_scene()
    times = np.linspace(0.0, 2e-3, 5)
    for end in times[1:3]:
        result = bd.simulate(*scene[:2], end, t_eval=[end], method=method)
        state = result.final_state._to_core(scene.params)
        np.testing.assert_array_equal(result.pulleys.load[-1], observed(scene.params._model, state))


def test_impulse_of_the_loads_is_the_momentum_the_belt_loses() -> None:
    """Over a run from rest, by Simpson's rule through samples 20 to the fastest joint period."""
    scene = drives.idler_scene()
    params = attrs.evolve(drives.on_mesh(scene.params, "joint"), gravity=(0.0, -9.81))
    end = 4e-3
    per_period = 20.0 * params.info["spectral_bound"] / (2.0 * np.pi)
    n = 2 * int(np.ceil(end * per_period / 2.0))
    result = bd.simulate(
        params, scene.torque_fn, end, t_eval=np.linspace(0.0, end, n + 1), rtol=1e-8
    )
    weights = np.r_[1.0, np.tile([4.0, 2.0], n // 2)]
    weights[-1] = 1.0
    impulse = end / n / 3.0 * np.einsum("t,tkx->x", weights, result.pulleys.load)
    mass = params.info["link_mass"]
    gained = [mass * (v[-1] - v[0]).sum() for v in (result.belt.vx, result.belt.vy)]
    weight = end * mass * params.belt.n_bodies * np.array(params.gravity)
    passed = end * np.abs(result.pulleys.load).sum(axis=(1, 2)).mean()
    assert np.abs(weight - gained - impulse).max() <= 1e-6 * passed
