"""Kernel levels (baseline, AVX2, AVX-512): which is taken, and rings that end within a vector.

The level is chosen when a model is made, so setting the environment variable before is enough. That
levels agree on whole drives is in ``test_drive_table.py``.
"""

from __future__ import annotations

import dataclasses
import itertools

import attrs
import dense
import numpy as np
import pytest
from bridge import fields, oracle_of
from drives import on_mesh

import beltdyn as bd
from beltdyn import _core

LEVELS = ("baseline", "avx2", "avx512")


def available(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    found = []
    for level in LEVELS:
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        if _core.kernel_level() == level:
            found.append(level)
    return found


def test_the_best_level_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    levels = available(monkeypatch)
    assert levels[0] == "baseline"  # every machine has it
    monkeypatch.delenv("BELTDYN_KERNELS")
    assert _core.kernel_level() == levels[-1]
    monkeypatch.setenv("BELTDYN_KERNELS", "")
    assert _core.kernel_level() == levels[-1]
    monkeypatch.setenv("BELTDYN_KERNELS", "avx3")
    assert _core.kernel_level() == "none"
    with pytest.raises(ValueError, match="BELTDYN_KERNELS must name a kernel level"):
        bd.scenes.kubas_case_1()


def test_sine_and_cosine_of_every_level(monkeypatch: pytest.MonkeyPatch) -> None:
    """Link ends from the kernels' own sine and cosine, over many turns, against NumPy's.

    A free chain held by nothing but its joints: with all centres at 0 a joint's force is
    -c half (e_i + e_{i-1}), so the link's acceleration shows both functions.
    """
    n, far, zero = 64, 50.0, np.zeros(64)  # off the pulleys
    base = bd.scenes.kubas_case_1().params
    belt = attrs.evolve(base.belt, n_bodies=n, bending_stiffness=0.0)
    # up to 40 rad and back, closing with the clockwise winding; whole turns are taken off beyond 50
    ramp = np.linspace(0.0, 1.0, n // 2)
    phi = np.concatenate([40.0 * ramp, 40.0 - 46.0 * ramp])
    phi += np.random.default_rng(0).uniform(-1, 1, n)
    state = {name: zero for name in ("vx", "vy", "vphi", "mu", "slip")}
    state |= {"x": zero + far, "y": zero, "phi": phi, "t": 0.0,
              "theta": np.zeros(2), "omega": np.zeros(2)}  # fmt: skip
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        params = attrs.evolve(base, belt=belt)
        rate, info = params._model.rate(state, np.zeros(2)), params.info
        half, c, m = info["link_length"] / 2, info["joint_stiffness"], info["link_mass"]
        for name, function in (("vx", np.cos), ("vy", np.sin)):
            e = function(phi)
            joint = -c * half * (e + np.roll(e, 1))
            expected = (np.roll(joint, -1) - joint) / m
            # 50 m away positions are rounded to 7e-15 m; half is 1e-2 m
            assert np.max(np.abs(rate[name] - expected)) <= 2e-12 * c * half / m


@pytest.mark.parametrize("hunt_crossley", [0.0, 0.3])
def test_every_length_of_the_last_vector(
    monkeypatch: pytest.MonkeyPatch, hunt_crossley: float, mesh: str
) -> None:
    """A ring is closed within its last vector: one rate at a shaken state against the oracle."""
    for n_bodies in range(3, 19):
        check_rates(monkeypatch, n_bodies, hunt_crossley, mesh)


def check_rates(
    monkeypatch: pytest.MonkeyPatch, n_bodies: int, hunt_crossley: float, mesh: str
) -> None:
    base = on_mesh(bd.scenes.kubas_case_1().params, mesh)
    belt, contact, friction = base.belt, base.contact, base.friction
    # links short enough to lie on the pulleys
    length = belt.length if mesh == "paper" else 2.0 * np.pi * 0.1
    bending_damping = 0.0 if mesh == "string" else 1e-4
    oracle = dataclasses.replace(
        oracle_of(base),
        length=length,
        n_bodies=n_bodies,
        bending_damping=bending_damping,
        hunt_crossley=hunt_crossley,
    )
    rng = np.random.default_rng(n_bodies)
    around = -2.0 * np.pi * np.arange(n_bodies) / n_bodies  # clockwise round pulley 0, just within
    circle = 0.0999
    if mesh == "string":
        circle = oracle.contact_radii[0] - 1e-4
    elif mesh == "joint":  # of the centres of links whose ends are just within
        circle = np.sqrt((oracle.contact_radii[0] - 1e-4) ** 2 - 0.25 * oracle.l0**2)
    state = {
        "x": circle * np.cos(around), "y": circle * np.sin(around), "phi": around - np.pi / 2,
        "vx": np.zeros(n_bodies), "vy": np.zeros(n_bodies), "vphi": np.zeros(n_bodies),
        "theta": np.zeros(2), "omega": np.array([-30.0, 10.0]), "t": 0.0,
    }  # fmt: skip
    for name, scale in {"x": 5e-5, "y": 5e-5, "phi": 0.1, "vx": 1.0, "vy": 1.0, "vphi": 50}.items():
        state[name] = state[name] + scale * rng.standard_normal(n_bodies)
    torque = np.array([3.0, -2.0])
    slots = dense.slots_of(oracle)
    touch = oracle.penetration(oracle.pack(state)) > 0
    assert touch[0].any()
    mu = rng.uniform(-0.5, 0.5, touch.shape) * touch
    y = oracle.pack(state | {"mu": mu})
    expected = oracle.unpack(oracle.rhs(0.0, y, lambda t, theta, omega: torque))
    state |= {"mu": dense.by_slot(mu, slots), "slip": dense.by_slot(0.0 * mu, slots)}
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        model = _core.Model(  # Params would refuse so few links on these pulleys
            (length, n_bodies, belt.linear_density, belt.axial_stiffness, belt.axial_damping,
             belt.bending_stiffness, bending_damping),
            oracle.centers, oracle.radii, oracle.inertias,
            (contact.quadratic, contact.linear, contact.damping, 0, hunt_crossley),
            friction._to_core(), (0.0, 0.0), mesh=belt.mesh, model=belt.model,
        )  # fmt: skip
        rate = model.rate(state, torque)
        for name in expected.keys() & {"x", "y", "phi", "vx", "vy", "vphi", "omega", "mu", "slip"}:
            want = np.asarray(expected[name])
            want = dense.by_slot(want, slots) if want.ndim == 2 else want
            error = np.max(np.abs(rate[name] - want))
            assert error <= 1e-11 * np.max(np.abs(want)), (n_bodies, level, name)


@pytest.mark.parametrize("mesh", ["paper", "joint"])
def test_numbers_gone_show_in_the_rates(monkeypatch: pytest.MonkeyPatch, mesh: str) -> None:
    """What overflows, or has no direction, must not be masked away: the driver looks for it."""
    params = on_mesh(bd.scenes.kubas_case_1().params, mesh)
    start = fields(bd.settle(params))
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        model = attrs.evolve(params, belt=params.belt)._model
        for name, link in itertools.product(
            ("x", "y", "vx", "vy", "vphi", "a link on an axis"), (0, 30, 59)
        ):
            state = {key: np.array(values) for key, values in start.items()} | {"t": 0.0}
            if name != "a link on an axis":
                state[name][link] = 1.7e308
            else:  # its point of contact exactly on it, by the arithmetic of the core
                ends = (link,) if mesh == "paper" else (max(link, 1) - 1, max(link, 1))
                state["phi"][ends[0]] = state["phi"][ends[-1]]
                for one in ends:
                    state["x"][one], state["y"][one] = params.pulleys[1].center
            rate = model.rate(state, np.zeros(2))
            found = [rate[key] for key in ("vx", "vy", "vphi")]
            assert not np.isfinite(found).all(), (level, name, link)
