"""Damping of contact by its force (Hunt and Crossley, MODEL section 3): a mass that bounces against
its closed form, no adhesion, no energy from nowhere, off as if it were not there.

Rates, Jacobian and runs against the oracle are with those of every drive: ``test_kernels.py``,
``test_jacobian.py``, ``test_oracle.py``; that it is free when off, in ``test_off_is_free.py``.
"""

from __future__ import annotations

import math
from typing import Any

import attrs
import drives
import numpy as np
import pytest
import random_drives
from bridge import fields, oracle_of
from scipy.optimize import brentq

import beltdyn as bd
from beltdyn import _core
from beltdyn.base.checks import Array

N, RADIUS, DENSITY, STIFFNESS = 24, 0.1, 0.1, 2.5e7
MESHES = ("paper", "joint")

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def leaves_at(d: float, speed: float) -> float:
    """Speed after a bounce: g(v0) = g(-v1). By quadrature of m v dv = -e(p) (1 + d v) dp."""

    def g(v: float) -> float:
        return v / d - math.log1p(d * v) / d**2

    upper = min(speed, (1.0 - 1e-15) / d)
    return float(brentq(lambda v: g(-v) - g(speed), 1e-12, upper, xtol=1e-15, rtol=1e-14))


def ring(mesh: str, quadratic: float, d: float, speed: float) -> tuple[_core.Model, dict[str, Any]]:
    """A ring of links round one pulley, just outside, that closes on it: each link is a free mass,
    for the belt has next to no stiffness, and all do the same. The speed is that of p.
    """
    length = 2.0 * math.pi * RADIUS
    model = _core.Model(
        (length, N, DENSITY, 1e-6, 0.0, 0.0, 0.0), [[0.0, 0.0]], [RADIUS], [1.0],
        (quadratic, STIFFNESS, 0.0, 0, d), None, (0.0, 0.0), mesh=mesh,
    )  # fmt: skip
    half = math.pi / N
    # centres of links stand on the radius; ends on that times h / sin h, MODEL section 3
    rim = RADIUS if mesh == "paper" else RADIUS * half / math.sin(half)
    arm = 0.0 if mesh == "paper" else length / N / 2.0
    circle = math.sqrt((rim + 1e-6) ** 2 - arm**2)
    inwards = speed / (circle / math.hypot(circle, arm))
    around = -2.0 * np.pi * np.arange(N) / N
    nx, ny = np.cos(around), np.sin(around)
    state = {
        "x": circle * nx, "y": circle * ny, "phi": around - np.pi / 2, "vx": -inwards * nx,
        "vy": -inwards * ny, "vphi": np.zeros(N), "mu": np.empty(0), "slip": np.empty(0),
        "theta": np.zeros(1), "omega": np.zeros(1), "travel": np.empty(0),
        "travel_speed": np.empty(0), "mount_friction": np.empty(0), "t": 0.0,
    }  # fmt: skip
    return model, state


@pytest.mark.parametrize(
    ("mesh", "d", "quadratic", "method"),
    [
        ("paper", 0.0, 5e11, "rodas4"),
        ("joint", 0.0, 0.0, "tsit5"),
        ("paper", 0.05, 0.0, "tsit5"),
        ("joint", 0.5, 5e11, "tsit5"),
        ("paper", 0.5, 5e11, "rodas4"),
        ("joint", 5.0, 0.0, "rodas4"),
        ("paper", 5.0, 5e11, "tsit5"),
    ],
)
def test_a_mass_bounces_as_in_closed_form(
    mesh: str, d: float, quadratic: float, method: str
) -> None:
    """A link on the pulley leaves with what the quadrature says, whatever the stiffness.

    On the joints' mesh the ends' p changes by cos(h) = r / rho of the link's way, here taken at the
    rim; a depth of 5e-5 m changes that by 1e-5 of itself. Steps of at most a hundredth of the half
    period of bouncing, pi sqrt(rho A / c2'), err by less than 1e-5 in a method of order 4.
    """
    speed = 0.5
    model, state = ring(mesh, quadratic, d, speed)
    inwards = math.hypot(state["vx"][0], state["vy"][0])
    lasts = math.pi * math.sqrt(DENSITY / STIFFNESS)
    end = 3.0 * lasts * (1.0 + d)
    sim = _core.Simulation(
        model, state, [], end, method=method, rtol=1e-9, max_step=0.01 * lasts, guards=False
    )
    times = np.linspace(0.0, end, 200)
    out = sim.sample(times)
    assert sim.advance(math.inf)
    assert (out["normal"] >= 0.0).all() and (out["normal"].max(axis=0) > 0.0).all()
    assert (out["pulley"][-1] == -1).all(), "it has left"
    outwards = (out["x"] * out["vx"] + out["y"] * out["vy"])[-1] / np.hypot(out["x"], out["y"])[-1]
    expected = leaves_at(d, speed) if d > 0.0 else speed
    np.testing.assert_allclose(outwards / inwards, expected / speed, rtol=2e-5)
    # and the ledger has what was lost, the difference of kinetic energies
    terms = dict(zip(model.energy_terms, out["energy"].T, strict=True))
    lost = terms["kinetic"][0] - terms["kinetic"][-1]
    assert abs(terms["contact_loss"][-1] - lost) <= 1e-6 * terms["kinetic"][0]
    assert (np.diff(terms["contact_loss"]) >= -1e-12 * terms["kinetic"][0]).all()


def scene(mesh: str, **contact: float) -> bd.Scene:
    made = drives.plain_scene()
    params = drives.on_mesh(made.params, mesh)
    changed = attrs.evolve(params.contact, **contact)
    return made._replace(params=attrs.evolve(params, contact=changed), t_end=0.02)


def shaken(rest: dict[str, Any], speed: float, seed: int) -> dict[str, Any]:
    random = np.random.default_rng(seed)
    state = rest | {"t": 0.0}
    for name in ("vx", "vy"):
        state[name] = state[name] + speed * random.standard_normal(state[name].size)
    return state


@pytest.mark.parametrize("mesh", MESHES)
def test_it_never_pulls(mesh: str) -> None:
    """Also where links leave faster than 1/d, as here many do; and it damps, there too."""
    params = scene(mesh, hunt_crossley=0.5, damping=0.0).params
    oracle = oracle_of(params)
    clamped = 0
    rest = fields(bd.settle(params))
    for seed in range(20):
        state = shaken(rest, 5.0, seed)
        seen = params._model.observe(state)
        assert (seen["normal"] >= 0.0).all()
        y = oracle.pack({name: state[name] for name in state if name not in ("mu", "slip")})
        rate: Array = oracle.contacts(y).rate[oracle.contacts(y).share > 0]
        clamped += np.count_nonzero(1.0 + 0.5 * rate < 0.0)
        assert oracle.powers(0.0, y, lambda *_: np.zeros(2))[2] >= 0.0
        expected = oracle.contacts(y).normal.sum(axis=0)
        np.testing.assert_allclose(seen["normal"][0], expected, rtol=1e-9, atol=1e-9)
    assert clamped > 20


def test_explicit_fixed_steps_know_how_stiff_it_makes_contact() -> None:
    """Of a contact whose damping by the force is what is fastest: the step follows from it, and
    the run is that of the tight one.
    """
    made = scene("paper", hunt_crossley=60.0, damping=0.0)
    initial = bd.settle(made.params)
    fixed, weak = (
        bd.simulate(*one, initial=initial, method="rk4")
        for one in (made, scene("paper", hunt_crossley=0.3, damping=0.0))
    )
    assert fixed.stats.steps > 1.5 * weak.stats.steps
    tight = bd.simulate(*made, initial=initial, method="tsit5", rtol=1e-8)
    scale = np.abs(tight.pulleys.omega).max()
    assert np.abs(fixed.pulleys.omega - tight.pulleys.omega).max() <= 1e-3 * scale


def test_in_python_and_toml() -> None:
    params = scene("joint", hunt_crossley=0.25).params
    assert params.contact.hunt_crossley == 0.25
    assert bd.Params.from_toml(params.to_toml() + "\n") == params
    assert "hunt_crossley" in str(params) and "0.25 s/m" in str(params)
    with pytest.raises(ValueError, match=r"contact\.hunt_crossley must be >= 0"):
        bd.Contact(linear=1e7, hunt_crossley=-1.0)
    # without a stiffness it stands in place of the damping that would be chosen
    chosen = attrs.evolve(params, contact=bd.Contact(hunt_crossley=0.5)).effective_contact
    assert (chosen.damping, chosen.hunt_crossley, chosen.compensate) == (0.0, 0.5, True)
    assert chosen.linear is not None and chosen.linear > 0.0


@pytest.mark.parametrize("mesh", MESHES)
def test_settling_is_not_held_up_by_it(mesh: str) -> None:
    """A damper has no say in an equilibrium: however strong, the belt settles in as many steps,
    give or take what a critical one costs, where it took some ten million; and under the same
    tension, to what friction makes of another way there.
    """
    plain, strong = (scene(mesh, hunt_crossley=d).params for d in (0.0, 1e6))
    one, other = (
        _core.Simulation.settle(each._model, None, tolerance=1e-6, friction=True)
        for each in (plain, strong)
    )
    for sim in (one, other):
        while not sim.advance(0.1):
            assert sim.stats["steps"] < 100_000
    assert other.stats["steps"] <= 10 * one.stats["steps"]
    expected = plain.info["mean_tension"]
    assert strong.info["mean_tension"] == pytest.approx(expected, rel=1e-3)


def test_settling_throws_no_link_off_by_it() -> None:
    """Links that come in fast would make it stiffer than the steps are for, and bounce for ever."""
    params, *_ = random_drives.draw(710034, "varied")
    assert params.contact.hunt_crossley > 1.0
    assert bd.settle(params).residual <= 1e-9
