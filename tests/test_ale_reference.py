"""The oracle of the ALE belt against closed forms, theory and links.

What it is held to nobody here wrote: strings that move, the creep of Dahl friction on rigid pulleys
from its own differential equations, momentum and torque; and the links' own tension and modes.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import ale_reference_run as runs
import creep_theory
import drives
import numpy as np
import pytest
import reference_mounts
from ale_reference import Ale
from bridge import ale_oracle_of as ale_of
from drives import scene_m, scene_u

import beltdyn as bd

DENSITY, RADIUS, APART, LENGTH = 0.06983, 0.1, 0.29, 1.2


def tension(model: Ale, y: np.ndarray) -> np.ndarray:
    return np.asarray(model.axial(y, model.geometry(0.0, y)).tension[..., model.spans])


@pytest.mark.extended(guard="test_ale.py::test_its_tension_and_modes_at_rest_are_those_of_links")
@pytest.mark.parametrize(
    ("scene", "bending", "links"),
    [
        (scene_u, 0.0, 304.22), (scene_u, 0.02, 306.91),
        (scene_u, None, 323.33), (scene_m, None, 430.01),
    ],
)  # fmt: skip
def test_tension_at_rest_is_that_of_links(scene: Any, bending: float | None, links: float) -> None:
    """At mid span, links at 480 to 960, which differ by 0.03 N between these meshes."""
    change = {} if bending is None else {"bending_stiffness": bending}
    model = ale_of(scene().params, cell=0.05, least=4, **change)  # cells have no part in it
    y = runs.at_rest(model)
    assert tension(model, y) == pytest.approx(links, abs=0.04)
    assert model.get(y, "m").sum() == pytest.approx(model.length, rel=1e-11)
    still = np.abs(model.rate(0.0, y))
    assert still[model.layout["v"][0]].max() < 1e-4, "of 1e5 m/s^2 that a force of T0 would make"


@pytest.mark.extended(guard="test_ale.py::test_its_tension_and_modes_at_rest_are_those_of_links")
def test_modes_at_rest_are_those_of_links() -> None:
    """U: torsion 92.5, lateral 125.2, 128.5 and 254.7 Hz of 480 links, whose phase on the pulleys
    makes 0.15 %; cells of 12.5 mm make 0.15 % of torsion. The aim of the model is 0.5 %.
    """
    model = ale_of(scene_u().params)
    found, decay = runs.frequencies(model, runs.at_rest(model))
    np.testing.assert_allclose(found[:4], [92.505, 125.211, 128.482, 254.674], rtol=2e-3)
    assert np.all(decay < 0.0)


@pytest.mark.extended(guard="test_ale.py::test_a_span_that_moves_has_the_frequencies_of_a_string")
def test_a_moving_string_has_its_frequencies() -> None:
    """f = (c_w^2 - v^2) / (2 S c_w). Of K sine modes the error falls as K^-3; K = 4 has 0.05 %,
    0.17 % at v/c 0.3, 0.5, by Galerkin's method on its own.
    """
    undamped = {"bending_stiffness": 0.0, "contact_damping": (0.0, 0.0)}
    model = ale_of(scene_m().params, n_modes=4, cell=0.05, least=4, **undamped)
    for share, error in ((0.3, 6e-4), (0.5, 2e-3)):
        y = runs.at_speed(model, -share * math.sqrt(model.h_0 / DENSITY) / RADIUS)
        ax = model.axial(y, model.geometry(0.0, y))
        wave = math.sqrt(ax.tension[0] * ax.stretch[0] / DENSITY)
        exact = (wave**2 - ax.past[0] ** 2) / (2.0 * APART * wave)
        found, decay = runs.frequencies(model, y)
        nearest = np.argmin(np.abs(found - exact))
        assert found[nearest] == pytest.approx(exact, rel=error)
        # every pair of modes of the spans, which nothing damps here, neither grows nor dies
        assert abs(decay[nearest]) < 1e-4 * exact


@pytest.mark.extended(guard="test_ale.py::test_its_creep_is_that_of_theory")
@pytest.mark.parametrize("speed", [3.77, 314.0])
def test_creep_of_dahl_friction_is_that_of_theory(speed: float) -> None:
    """60 N m on M, rigid pulleys. Cells of 15.7 mm are a third of the length in which bristles
    build up, sqrt(EA / (sigma H / R)) = 40 mm: (1/3)^2 / 12 of the 300 N of friction is 1 %,
    seen 0.2 % (slow: 151.490 of 151.773 N) and a quarter of it with half the cells.
    """
    gain = 60.6 / speed

    def torque(_t: float, _theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        return np.stack((0.0 * omega[..., 0] - 60.0, -gain * omega[..., 1]), axis=-1)

    model = ale_of(
        scene_m().params, bending_stiffness=0.0, contact=(0.0, 1e14), torque=torque,
        cell=0.1 * math.pi / 20 + 1e-6, n_modes=1,
    )  # fmt: skip
    y = runs.steady(model, runs.at_speed(model, -speed))
    ax = model.axial(y, model.geometry(0.0, y))
    omega, flow = model.get(y, "omega"), ax.flow
    law = model.friction[0]
    theory = creep_theory.Drive.open(
        (RADIUS, RADIUS), APART, length=LENGTH, axial_stiffness=model.axial_stiffness,
        linear_density=DENSITY, mu=law.mu_k,
    )  # fmt: skip
    slack, creep = creep_theory.dahl(theory, float(abs(omega[0])), 60.0, law.sigma)
    assert tension(model, y).min() == pytest.approx(slack, rel=2.5e-3)
    assert 1.0 - omega[1] / omega[0] == pytest.approx(creep, abs=1e-4)
    # what follows from the equations themselves
    assert flow == pytest.approx(flow[0], rel=1e-9)
    assert model.get(y, "m").sum() == pytest.approx(LENGTH, rel=1e-13)
    t_0, t_1 = tension(model, y)
    v = model.get(y, "v")
    v = 0.5 * (v[model.spans] + v[model.ends])  # half of a span's momentum goes to each of its ends
    rho = RADIUS - float(ax.sink.mean())
    pulls = (t_0 - t_1 - DENSITY * flow[0] * (v[0] - v[1])) * rho
    # but for lambda of F, which is the cell's: second differences of the stretch, 1e-5, of rhoA J v
    assert abs(pulls) == pytest.approx(60.0, rel=2e-8)


@pytest.mark.extended(guard="test_ale.py::test_metres_are_never_lost")
def test_sum_of_metres_never_changes() -> None:
    """Whatever the state, to rounding: flow between cells only."""
    model = ale_of(bd.scenes.serpentine(120).params, cell=0.05, least=4)
    rng = np.random.default_rng(7)
    y = runs.at_speed(model, -300.0) + 0.1 * runs.scales(model) * rng.normal(size=(8, model.size))
    dm = model.get(model.rate(0.0, y), "m")
    assert np.all(np.abs(dm.sum(axis=-1)) < 1e-13 * np.abs(dm).sum(axis=-1))


def _residual(model: Ale, y: np.ndarray, h: float = 1e-6) -> np.ndarray:
    """dE/dt along the equations, less the powers that leave, by differences of E."""
    rate = model.rate(0.0, y)
    ends = [sum(model.energy(0.0, y + sign * h * rate).values()) for sign in (1.0, -1.0)]
    works = model.get(rate, "works")
    return np.asarray((ends[0] - ends[1]) / (2.0 * h) - works[..., 0] + works[..., 1:].sum(axis=-1))


def vibrating(model: Ale, speed: float, n: int = 6, parts: str = "mvapq") -> np.ndarray:
    """States about one of rest at this speed: 4 mm in the modes, speeds and metres at random."""
    rng = np.random.default_rng(3)
    rest, scale = runs.at_speed(model, speed), 0.2 * runs.scales(model)
    scale[model.layout["a"][0]] = 2e-3
    chosen = [model.layout[one][0] for one in (*parts, "dq") if one != "dq" or "q" in parts]
    kept = np.zeros(model.size)
    kept[np.r_[tuple(chosen)]] = 1.0
    return np.asarray(rest + kept * scale * rng.normal(size=(n, model.size)))


def quiet(params: bd.Params, **changes: Any) -> Ale:
    still = {"friction": (None,) * 2, "axial_damping": 0.0, "cell": 0.05, "least": 4}
    return ale_of(params, **(still | changes))


def turnover(model: Ale, y: np.ndarray, term: str, h: float = 1e-6) -> float:
    """The largest rate of one term of the energy."""
    rate = model.rate(0.0, y)
    ends = [model.energy(0.0, y + sign * h * rate)[term] for sign in (1.0, -1.0)]
    return float(np.abs(ends[0] - ends[1]).max() / (2.0 * h))


@pytest.mark.extended(guard="test_ale.py::test_its_energy_balance_closes")
@pytest.mark.parametrize("speed", [0.0, -400.0])
@pytest.mark.parametrize("bending", [0.0, 0.08272])
def test_energy_is_kept_on_fixed_axes_and_by_a_mount(bending: float, speed: float) -> None:
    """No power is without its owner, of states at random, over what goes to and fro between elastic
    and kinetic energy: the belt alone, with its bending (X, end moments), and with a slider, where
    every term of the belt's force on an axis has its counterpart in the belt, and with damping of
    bending. What the equations leave out with a slider, the path's own acceleration among c', is of
    the order of X / S, 1e-3, times the axis's speed over the belt's, a tenth.
    """
    params = scene_u().params
    slider = reference_mounts.Slider(direction=(1.0, 0.3), mass=0.4, stiffness=2e4, preload=640.0)
    for mounts, bound in (({}, 3e-5), ({1: slider}, 3e-4)):
        model = quiet(
            params, bending_stiffness=bending, bending_damping=1e-3 * bending, mounts=mounts
        )
        y = vibrating(model, speed)
        assert np.abs(_residual(model, y)).max() < bound * turnover(model, y, "elastic")


@pytest.mark.extended(guard="test_ale.py::test_its_energy_balance_closes")
def test_energy_is_kept_by_modes_of_a_belt_that_runs() -> None:
    """At 20 m/s modes of 4 mm exchange energy with the motion along the belt: all of it with the
    reaction of section 6, to a tenth of what is missed without.
    """
    model = quiet(scene_u().params, bending_stiffness=0.0)
    y = vibrating(model, -400.0, parts="ap")
    off = dataclasses.replace(model, reaction=False)
    assert np.abs(_residual(model, y)).max() < 0.1 * np.abs(_residual(off, y)).max()


@pytest.mark.extended(
    guard="test_ale.py::test_its_first_swing_after_a_jump_of_load_is_that_of_links"
)
def test_first_swing_after_a_jump_of_load_is_that_of_links() -> None:
    """U at 63 rad/s, 5 ms after torques of full load: the slack span falls to half of its tension,
    torsion, modes, load and friction of the ends of wraps take part. Links at 240 are 0.2 N from
    those at 480; cells of 12.5 mm are a tenth off in what the ends carry: 0.5 % of the mean.
    """
    params, end, speed = scene_u().params, 6e-3, 63.0
    times, gain = np.linspace(0.0, end, 31), 24.0 / (speed * 5.0 / 12.0)

    def torque(_t: float, _theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        return np.stack((0.0 * omega[..., 0] - 10.0, -gain * omega[..., 1]), axis=-1)

    links = drives.on_mesh(drives.with_belt(params, n_bodies=240), "joint")
    state = bd.settle(links, speed={0: -speed})
    ramp = bd.PiecewiseLinear([0.0, end], [-10.0, -10.0], pulley=0)
    found = bd.simulate(
        links, ramp + bd.Viscous([0.0, gain]), end, initial=state, t_eval=times, rtol=1e-3
    )  # fmt: skip
    model = ale_of(params, torque=torque)
    states = runs.run(model, runs.at_speed(model, -speed), times, rtol=3e-3).states
    apart = tension(model, states) - found.span_tension
    assert np.sqrt(np.mean(apart**2)) < 0.005 * model.h_0
