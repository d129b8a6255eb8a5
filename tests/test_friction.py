"""Dahl friction: the closed form (2.9), and the state form in the integrator held against it."""

from __future__ import annotations

import math
from itertools import pairwise

import attrs
import numpy as np
import pytest
import reference

import beltdyn as bd
from beltdyn import _core

SLID = np.array([1e-5, 5e-5, 1e-4, 5e-4])


def test_published_values_from_rest() -> None:
    """CHECKS section 1, seven digits."""
    mu = _core.dahl_slide(SLID, 0.0, 0.8, 1e4)
    assert mu == pytest.approx([0.0940025, 0.3717909, 0.5707962, 0.7984556], abs=5e-8)


def test_published_value_after_a_reversal() -> None:
    path = np.array([0.0, 2e-4, 2e-4 - 1.5e-4])
    assert _core.dahl_path(path, 0.0, 0.8, 1e4)[-1] == pytest.approx(-0.5647026, abs=5e-8)


def test_belt_slid_over_a_locked_drum() -> None:
    """T2/T1 = exp(mu(x) pi), CHECKS section 1, seven digits."""
    ratio = np.exp(np.pi * _core.dahl_slide(SLID, 0.0, 0.8, 1e4))
    assert ratio == pytest.approx([1.343553, 3.215605, 6.008704, 12.285533], rel=3e-7)


@pytest.mark.parametrize("mu_k", [0.3, 1.0, 1e9])
@pytest.mark.parametrize("sign", [1, -1])
def test_closed_form_keeps_its_digits(mu_k: float, sign: int) -> None:
    """Against extended precision, from 1e-12 m, and at a mu_k where the paper's form cancels."""
    dx = sign * np.geomspace(1e-12, 1e-2, 60)
    for mu0 in (0.0, 0.2, -0.29):
        exact = np.array([float(reference.dahl_closed(x, 0.0, mu0, mu_k, 1e4, sign)) for x in dx])
        got = _core.dahl_slide(dx, mu0, mu_k, 1e4)
        # two roundings of mu and one of the exponent; for mu_k = 1e9 the yardstick itself, the
        # paper's form in 64 bits of mantissa, cancels to mu_k * 2^-64
        assert np.max(np.abs(got - exact)) <= 4e-16 * max(1.0, np.max(np.abs(exact))) + mu_k * 2e-19


def test_nested_loops_follow_the_exact_path() -> None:
    rng = np.random.default_rng(3)
    turning = np.concatenate([[0.0], np.cumsum(rng.choice([-1, 1], 40) * rng.uniform(0, 3e-4, 40))])
    exact = [float(v) for v in reference.dahl_path_exact(turning, 0.8, 1e4)]
    fine = np.concatenate([np.linspace(a, b, 50, endpoint=False) for a, b in pairwise(turning)])
    fine = np.append(fine, turning[-1])
    got = _core.dahl_path(fine, 0.0, 0.8, 1e4)[::50]
    assert np.max(np.abs(got - exact)) <= 1e-14
    assert np.max(np.abs(got)) <= 0.8


def test_integrated_state_form_follows_the_closed_form() -> None:
    """Case 2, links that stay on a pulley: (2.9) evaluated along the slip they report.

    Between samples the slip may turn unseen; what that can hide is 2 sigma times the distance slid
    between two samples, which is added up from the relative velocities.
    """
    scene = bd.scenes.kubas_case_2()
    mu_k, sigma = scene.params.friction.mu_k, scene.params.friction.sigma
    times = np.linspace(0.0, 0.3, 60001)
    result = bd.simulate(*scene[:2], 0.3, t_eval=times, rtol=1e-7)
    contact = result.contact
    stays = np.all(contact.pulley == contact.pulley[0], axis=0) & (contact.pulley[0] >= 0)
    assert stays.sum() >= 20
    checked = 0
    for i in np.flatnonzero(stays)[::4]:
        slip = contact.slip[:, i]
        expected = _core.dahl_path(slip, contact.mu[0, i], mu_k, sigma)
        # only where the velocity keeps its sign over the neighbouring samples is a turn excluded
        unseen = np.abs(np.diff(slip)).max()
        error = np.max(np.abs(contact.mu[:, i] - expected))
        assert error <= 2 * sigma * unseen + 1e-6
        assert error <= 2e-2
        checked += np.max(np.abs(contact.mu[:, i])) > 0.1
    assert checked >= 3


# at this tolerance spans may shake, by rounding, on some processors: not what is asked here
@pytest.mark.filterwarnings("ignore:growth:UserWarning")
@pytest.mark.parametrize("sigma", [1e4, 1e5, 1e6])
def test_coefficient_never_leaves_its_bounds(sigma: float) -> None:
    """|mu| <= mu_k to the last bit, in and between steps, at a tolerance that would let it out."""
    scene = bd.scenes.kubas_case_2(sigma=sigma)
    result = bd.simulate(*scene[:2], 0.25, rtol=1e-2)
    mu_k = scene.params.friction.mu_k
    assert np.max(np.abs(result.contact.mu)) <= mu_k
    assert np.max(np.abs(result.final_state.mu)) <= mu_k
    assert np.max(np.abs(result.contact.mu)) >= 0.9 * mu_k  # and it gets there


def test_memory_is_lost_with_the_contact() -> None:
    """MODEL section 4: where no pulley is touched, mu and slip are 0; gained anew from 0."""
    scene = bd.scenes.three_pulleys()
    result = bd.simulate(*scene, t_eval=np.linspace(0, scene.t_end, 4001))
    off = result.contact.pulley < 0
    assert off.any()
    assert not result.contact.mu[off].any()
    assert not result.contact.slip[off].any()
    arrived = (~off[1:]) & off[:-1]
    assert arrived.sum() > 20
    # right after arrival the slip is what slid within one sample at most
    slid = np.abs(result.contact.velocity).max() * np.diff(result.t).max()
    assert np.max(np.abs(result.contact.slip[1:][arrived])) <= slid


def test_dissipation_is_positive_over_a_closed_loop() -> None:
    """Sliding there and back costs energy: the area of the hysteresis loop, in closed form.

    From saturation, over a stroke s: the loop between the two exponentials, integrated by the
    trapezoidal rule on 1e5 points (error far below 1e-8 of the area).
    """
    stroke = 3e-4
    x = np.concatenate([np.linspace(0, stroke, 50001), np.linspace(stroke, 0, 50001)[1:]])
    many = np.concatenate([x] + [x[1:]] * 3)
    mu = _core.dahl_path(many, 0.0, 0.8, 1e4)
    last = slice(-100001, None)
    area = np.trapezoid(mu[last], many[last])
    z = 1e4 * stroke / 0.8
    peak = 0.8 * math.tanh(z / 2)  # periodic loop: mu swings between -peak and peak
    assert mu[last].max() == pytest.approx(peak, rel=1e-4)
    # two branches, each mu_k s - (mu_k + peak) (mu_k / sigma) (1 - exp(-z))
    exact = 2 * (0.8 * stroke - (0.8 + peak) * (0.8 / 1e4) * (-math.expm1(-z)))
    assert area == pytest.approx(exact, rel=1e-4)
    assert area > 0


def test_memory_given_off_the_pulleys_is_forgotten() -> None:
    """An initial state with mu on links that touch nothing runs like the one without."""
    scene = bd.scenes.kubas_case_1()
    state = bd.simulate(*scene[:2], 0.1, t_eval=[0.1])
    off = state.contact.pulley[-1] < 0
    clean = state.final_state
    tainted = attrs.evolve(
        clean, mu=np.where(off, -0.9, clean.mu), slip=np.where(off, 1e-3, clean.slip)
    )
    one, other = (bd.simulate(*scene[:2], 0.16, initial=s) for s in (clean, tainted))
    assert np.array_equal(one.contact.mu, other.contact.mu)
    assert np.array_equal(one.final_state.mu, other.final_state.mu)
    arrived = (one.contact.pulley[-1] >= 0) & off
    assert arrived.any()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_memory_does_not_pass_from_pulley_to_pulley(way: float) -> None:
    """Two pulleys that touch: a link crosses from one to the other within a step, either way."""
    from beltdyn import _core

    n, radius, ring = 5, 0.1, 0.25  # five links on a circle round both, one of them moved inside
    model = _core.Model(
        (2 * np.pi * ring, n, 0.1, 1e-3, 0.0, 0.0, 0.0),
        np.array([[0.0, 0.0], [0.2, 0.0]]), [radius] * 2, [1.0] * 2,
        (0.0, 1e-6, 0.0, 0, 0.0), ("dahl", (1.0, 1e-3, 0.0, 0.0)), (0.0, 0.0),
    )  # fmt: skip
    zero = np.zeros(n)
    state = {name: zero.copy() for name in ("x", "y", "vx", "vy", "vphi", "mu", "slip")}
    place = -np.pi / 2 - 2 * np.pi / n * (np.arange(n) - 3)
    state |= {"phi": place - np.pi / 2, "t": 0.0}
    state |= {"theta": np.zeros(2), "omega": np.zeros(2)}
    state["x"], state["y"] = 0.1 + ring * np.cos(place), ring * np.sin(place)
    state["x"][3], state["vx"][3], state["mu"][3] = 0.1 - way * 1e-6, way, 0.5
    state["y"][3] = 0.0
    sim = _core.Simulation(model, state, [], 2e-5, method="rk4", step=1e-5)
    while not sim.advance(1.0):
        pass
    end = sim.state()
    assert (end["x"][3] - 0.1) * way > 0.0
    assert abs(end["mu"][3]) <= 1e-6
