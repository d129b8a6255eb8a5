"""The ALE belt of the core, by its Python interface, against its oracle.

Kernels, and what the row of the table of belt models makes of them: states in and out, bodies,
effects, linear systems, steps.
"""

from __future__ import annotations

from typing import Any

import ale_reference_run as runs
import attrs
import numpy as np
import pytest
from ale_reference import Ale
from bridge import on_mesh_of
from drives import crossed_scene, idler_scene, light_scene, scene_m, scene_u

import beltdyn as bd


def flowing(params: bd.Params, n_bodies: int = 50) -> bd.Params:
    """The same drive with an ALE belt of about so many cells."""
    return attrs.evolve(params, belt=attrs.evolve(params.belt, mesh="ale", n_bodies=n_bodies))


def state_of(model: Ale, y: np.ndarray, **changes: Any) -> bd.State:
    """A state of the oracle as one of the core."""
    names = ("m", "v", "z", "a", "p", "along", "along_speed", "theta", "omega")
    part = {name: model.get(y, name) for name in names}
    mounts = {"travel": "q", "travel_speed": "dq", "mount_friction": "zeta"}
    changes |= {name: model.get(y, other) for name, other in mounts.items() if model.n_m}
    z = np.zeros((2, model.n_z, model.n))
    z[:, :, model.arcs] = part["z"].swapaxes(0, 1)
    return bd.State(
        m=part["m"], v=part["v"], mu=z.reshape(-1, model.n), a=part["a"].ravel(),
        p=part["p"].ravel(), along=part["along"], along_speed=part["along_speed"],
        theta=part["theta"], omega=part["omega"], **changes,
    )  # fmt: skip


def sliding_scene() -> bd.Scene:
    """U with both pulleys on sliders, which share the inertia of two spans, one with friction."""
    plain = scene_u()
    first, last = plain.params.pulleys
    slider = bd.Slider(direction=(-1.0, 0.2), mass=0.3, stiffness=2e5, preload=640.0, damping=50.0)
    other = bd.Slider(
        direction=(1.0, 0.3), mass=0.4, stiffness=2e4, preload=640.0, damping=50.0, friction=20.0
    )
    pulleys = [attrs.evolve(first, mount=slider), attrs.evolve(last, mount=other)]
    belt = attrs.evolve(plain.params.belt, mesh="joint")
    params = attrs.evolve(
        plain.params, belt=belt, pulleys=pulleys, gravity=(0.0, -9.81), tensioning=bd.Tensioning()
    )
    return plain._replace(params=params)


def light_sliding_scene() -> bd.Scene:
    """Light pulleys far apart, the lower one on a slider."""
    plain = light_scene()
    first, last = plain.params.pulleys
    slider = bd.Slider(direction=(-0.2, -1.0), mass=0.3, stiffness=2e5, preload=800.0, damping=50.0)
    belt = attrs.evolve(plain.params.belt, preload=None)
    pulleys = [attrs.evolve(first, mount=slider), last]
    return plain._replace(params=attrs.evolve(plain.params, belt=belt, pulleys=pulleys))


MOUNTED = [
    bd.scenes.tensioned_alternator, bd.scenes.serpentine, sliding_scene, light_sliding_scene,
]  # fmt: skip


def displaced(model: Ale, speed: float, seed: int = 1, amplitude: float = 0.05) -> np.ndarray:
    """Off a steady state at this speed of pulley 0 by a share of what errors are measured by."""
    rng = np.random.default_rng(seed)
    scale, y = runs.scales(model), runs.at_speed(model, speed)
    off = amplitude * scale * rng.normal(size=model.size)
    for name in ("theta", "works"):
        off[model.layout[name][0]] = 0.0
    where, shape = model.layout["z"]
    off[where] = (rng.uniform(-0.6, 0.6, size=shape) * model.get(scale, "z")).ravel()
    return np.asarray(y + off)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("speed", [-63.0, 0.0, 63.0])
@pytest.mark.parametrize(
    "scene", [scene_u, scene_m, crossed_scene, idler_scene, light_scene, *MOUNTED]
)
def test_its_rate_is_that_of_the_oracle(scene: Any, speed: float) -> None:
    """In both directions and about rest, wherever the belt lies, axes that move included."""
    params = flowing(scene().params, 50 if scene not in MOUNTED else 70)
    model = on_mesh_of(params)
    y = displaced(model, speed)
    rate, state = model.rate(0.0, y), state_of(model, y)
    core = params._model.rate(state._to_core(params), np.zeros(len(params.pulleys)))
    expected = state_of(model, rate)
    moves = ("travel", "travel_speed", "mount_friction") if model.n_m else ()
    for name in ("m", "v", "mu", "a", "p", "along", "along_speed", "omega", *moves):
        ours, theirs = np.ravel(core[name]), np.ravel(getattr(expected, name))
        largest = np.abs(theirs).max(initial=0.0)
        np.testing.assert_allclose(ours, theirs, atol=1e-11 * largest, err_msg=name)


def core_places(model: Ale, params: bd.Params) -> np.ndarray:
    """Of each unknown of the core, in its order, that of the oracle; -1: it has none."""
    numbered = state_of(model, 1.0 + np.arange(model.size))
    core = numbered._to_core(params)
    return np.concatenate([core[row[0]] for row in bd._core.STATE_FIELDS]).astype(int) - 1


@pytest.mark.one_in(3)
@pytest.mark.parametrize("speed", [-63.0, 63.0])
@pytest.mark.parametrize("scene", [scene_u, idler_scene, light_scene, *MOUNTED])
def test_its_jacobian_is_that_of_the_oracle(scene: Any, speed: float) -> None:
    """Entries times the scales of errors, with W held, against central differences. What speeds
    do to the length of an arc's cell, by v^2, is left out: 1e-5 to 1e-3 of the rest."""
    params = flowing(scene().params, 40 if scene not in MOUNTED else 60)
    model = on_mesh_of(params)
    y, scale = displaced(model, speed, amplitude=0.01), runs.scales(model)
    runs.hold(model, y)
    at = core_places(model, params)
    rows, columns, values = params._model.jacobian(state_of(model, y)._to_core(params))
    ours = np.zeros((at.size, at.size))
    np.add.at(ours, (rows, columns), values)
    assert np.all(ours[at < 0] == 0.0) and np.all(ours[:, at < 0] == 0.0)
    # a place of the seven pulleys is 1e-6 off the change of its sense of slip
    theirs = np.asarray(runs.jacobian(model, 0.0, y, central=True, eps=1e-7))
    ours, theirs = ours[at >= 0][:, at >= 0], theirs[at[at >= 0]][:, at[at >= 0]]
    scale = scale[at[at >= 0]]
    ours, theirs = (one * scale / scale[:, None] for one in (ours, theirs))
    largest = np.abs(theirs).max(axis=1, keepdims=True)
    off = np.abs(ours - theirs) / np.maximum(largest, 1e-300)
    assert off.max() < 2e-3, np.argwhere(off >= 2e-3)[:10]


def test_its_steps_are_those_of_the_oracle() -> None:
    """Explicit ones, after each of which ends of wraps are renewed and what has been laid on or
    lifted off since has its states of friction: U in a shock, by a thousandth of a cell and more.
    """
    params = attrs.evolve(flowing(scene_u().params), tensioning=bd.Tensioning())
    model, h, n = on_mesh_of(params), 2e-6, 12
    y, cells = displaced(model, -63.0, amplitude=0.3), model.layout["m"][0]
    y[cells] *= model.length / y[cells].sum()
    found = bd.simulate(
        params, bd.Viscous([0.0, 0.0]), n * h, initial=state_of(model, y), method="rk4", step=h
    )
    runs.hold(model, y)
    first = model.held[1].copy()
    for _ in range(n):
        rates = [model.rate(0.0, y)]
        for share in (0.5, 0.5, 1.0):
            rates.append(model.rate(0.0, y + share * h * rates[-1]))
        y = y + h / 6.0 * (rates[0] + 2.0 * rates[1] + 2.0 * rates[2] + rates[3])
        before = model.held
        runs.hold(model, y)
        y = runs.bounded(model, runs.relaid(model, y, before, h))
    expected = state_of(model, y)
    assert np.abs(model.held[1] - first).max() > 1e-3
    for name in ("m", "v", "mu", "a", "p", "along", "along_speed", "omega"):
        ours, theirs = np.ravel(getattr(found.final_state, name)), np.ravel(getattr(expected, name))
        largest = np.abs(theirs).max(initial=0.0)
        np.testing.assert_allclose(ours, theirs, atol=1e-9 * largest, err_msg=name)


@pytest.mark.parametrize("scene", [scene_u, sliding_scene, light_scene, light_sliding_scene])
def test_it_hangs_at_rest_under_its_weight(scene: Any) -> None:
    """Without friction nothing moves, but for what the energy of bending has of a stretch that
    changes by 1e-5 along an arc, 0.05 m/s^2; spans sag as strings do.
    """
    params = attrs.evolve(flowing(scene().params), gravity=(0.0, -9.81))
    state = bd.settle(params, friction=False)
    rate = params._model.rate(state._to_core(params), np.zeros(len(params.pulleys)))
    assert np.abs(rate["v"]).max() < 0.01 * 9.81
    assert np.abs(rate["p"]).max() < 1e-5 * 9.81
    assert np.abs(rate["travel_speed"]).max(initial=0.0) < 1e-5 * 9.81
    still = bd.settle(attrs.evolve(params, gravity=(0.0, 0.0)), friction=False)
    model = on_mesh_of(params)
    geometry = model.geometry(0.0, model.pack())
    span, across = geometry.span, np.abs(geometry.n[..., 1])
    sags = np.reshape(state.a - still.a, (len(span), -1))[:, 0]
    weight = params.belt.linear_density * 9.81 * across / model.h_0
    np.testing.assert_allclose(np.abs(sags), weight * span**2 * 4.0 / np.pi**3, rtol=0.1)
