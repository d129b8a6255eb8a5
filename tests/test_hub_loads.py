"""Hub loads, ``pulleys.load``: what the belt does to its pulleys, by contact and friction.

Held to the oracle's forces of contact at states anywhere, to Newton's law for the whole belt with
the accelerations of the rate's own kernels and over runs, to span statics at rest and running, and
to the forces in the equations of mounts.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs
import dense
import drives
import mounted_drives
import numpy as np
import pytest
import reference
import test_mounts_oracle as mounts_oracle
from test_jacobian import CASES, make_case
from test_jacobian import running as running  # a fixture

import beltdyn as bd
from beltdyn import _core
from beltdyn.checks import Array
from beltdyn.route import Route

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

Running = dict[str, tuple[bd.Params, dict[str, Any]]]

#: Relative to the sum of the magnitudes of all contact forces: penetrations of 1e-5 m are
#: differences of places known to 5e-17 m, and some hundred forces are summed in two orders.
ROUNDING = 1e-10


def observed(model: _core.Model, state: dict[str, Any]) -> Array:
    return np.asarray(model.observe(state)["load"][0])


def of_oracle(oracle: reference.Reference, y: Array) -> tuple[Array, float]:
    """The loads (n_p, 2), and the sum of the magnitudes of all forces of contact."""
    at = oracle.contacts(y)
    on_belt = -(at.friction[:, None, :] * at.tangent).sum(axis=-1)
    if oracle.mesh == "joint":
        on_belt = on_belt + oracle.along_links_at(y).on_links().T
    else:
        on_belt = on_belt + (at.normal[:, None, :] * at.outward).sum(axis=-1)
    return -on_belt, float(np.abs(at.normal).sum() + np.abs(at.friction).sum())


def left_over(mass: float, gravity: Array, n: int, rate: dict[str, Any]) -> Array:
    """Weight of n links less the rate of their momentum: by Newton's law the sum of the loads."""
    momentum = [mass * np.sum(rate[name]) for name in ("vx", "vy")]
    return np.asarray(n * mass * gravity - momentum)


@pytest.mark.parametrize("name", CASES)
def test_loads_are_those_of_the_oracle_and_of_newton(running: Running, name: str) -> None:
    """With links on one pulley, on two at once and on none; of every mesh and friction law."""
    case = make_case(name, running)
    y = dense.vector_of_oracle(case.oracle, case.state, dense.slots_of(case.oracle))
    expected, scale = of_oracle(case.oracle, y)
    load = observed(case.model, case.state)
    assert load.shape == (case.oracle.n_pulleys, 2)
    assert np.abs(load - expected).max() <= ROUNDING * scale
    rate = case.model.rate(case.state, np.zeros(case.oracle.n_pulleys))
    gravity = np.asarray(case.oracle.gravity, dtype=float)
    total = left_over(case.model.info["link_mass"], gravity, case.oracle.n_bodies, rate)
    # accelerations are sums of joint forces as well, which cancel: up to 5e-11 of those each
    joints = np.abs(case.model.observe(case.state)["force"]).sum()
    assert np.abs(load.sum(axis=0) - total).max() <= ROUNDING * (scale + joints)


@pytest.mark.parametrize("how", mounts_oracle.STATES)
@pytest.mark.parametrize("name", mounts_oracle.DRIVES)
def test_loads_of_axes_that_move(name: str, how: str) -> None:
    """The oracle's; and what a mount takes of them is the force of the belt in its equation."""
    params, oracle, state = mounts_oracle.shaken(name, 1, how)
    if not params.info["n_states"]:  # of its laws; shaken() gives every drive with friction one
        state["mu"] = np.zeros(0)
    absent = {name: 0.0 for name in ("mu", "slip") if not np.size(state[name])}
    y = oracle.pack({**state, **absent})
    expected, scale = of_oracle(oracle, y)
    state["mu"] = np.ravel(state["mu"])
    model = params._model
    load = observed(model, state)
    assert np.abs(load - expected).max() <= ROUNDING * scale
    taken = model.observe(state)["belt_force"][0]
    axes = oracle.axes(y)
    for m, k in enumerate(params.mounted):
        mount = params.pulleys[k].mount
        if isinstance(mount, bd.Arm):
            reach = axes[k] - np.array(mount.pivot)
            found = reach[0] * load[k, 1] - reach[1] * load[k, 0]
            assert taken[m] == pytest.approx(found, abs=ROUNDING * scale * np.hypot(*reach))
        elif isinstance(mount, bd.Slider):
            along = np.array(mount.direction) / np.hypot(*mount.direction)
            assert taken[m] == pytest.approx(along @ load[k], abs=ROUNDING * scale)


def idler(n_bodies: int, model: str, bending: float = 0.0) -> bd.Params:
    """Two pulleys and an idler on the back of the belt, preloaded to 400 N; contact compensated."""
    params = drives.idler_scene().params
    belt = attrs.evolve(
        params.belt,
        length=None,
        preload=400.0,
        n_bodies=n_bodies,
        bending_stiffness=bending,
        model=model,
    )
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
    scene = drives.on_mesh(drives.idler_scene().params, "joint"), drives.idler_scene().torque_fn
    params = attrs.evolve(scene[0], gravity=(0.0, -9.81))
    end = 4e-3
    per_period = 20.0 * params.info["spectral_bound"] / (2.0 * np.pi)
    n = 2 * int(np.ceil(end * per_period / 2.0))
    result = bd.simulate(params, scene[1], end, t_eval=np.linspace(0.0, end, n + 1), rtol=1e-8)
    weights = np.r_[1.0, np.tile([4.0, 2.0], n // 2)]
    weights[-1] = 1.0
    impulse = end / n / 3.0 * np.einsum("t,tkx->x", weights, result.pulleys.load)
    mass = params.info["link_mass"]
    gained = [mass * (v[-1] - v[0]).sum() for v in (result.belt.vx, result.belt.vy)]
    weight = end * mass * params.belt.n_bodies * np.array(params.gravity)
    passed = end * np.abs(result.pulleys.load).sum(axis=(1, 2)).mean()
    assert np.abs(weight - gained - impulse).max() <= 1e-6 * passed


def test_loads_alone_and_not_asked_for() -> None:
    params, torque, *_ = drives.idler_scene()
    alone, without = (
        bd.simulate(params, torque, 1e-3, outputs=names, method="tsit5")
        for names in (("pulleys.load",), ("pulleys.omega",))
    )
    assert list(alone.pulleys.arrays()) == ["load"] and alone.pulleys.load.shape[1:] == (3, 2)
    assert alone.stats.nfev == without.stats.nfev and alone.stats.steps == without.stats.steps
    assert alone.final_state == without.final_state, "looking changes nothing"
    with pytest.raises(AttributeError, match=r"^pulleys\.load was not asked for"):
        _ = without.pulleys.load


def test_loads_are_kept_in_files(tmp_path: Path) -> None:
    params, torque = mounted_drives.take_up(), bd.Viscous([0.0, 0.0])
    for names in (None, ("pulleys.load",)):
        result = bd.simulate(params, torque, 1e-3, t_eval=[0.0, 1e-3], outputs=names)
        result.save(tmp_path / "run.npz")
        loaded = bd.Result.load(tmp_path / "run.npz")
        np.testing.assert_array_equal(loaded.pulleys.load, result.pulleys.load)
