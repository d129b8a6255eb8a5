"""Friction along a path of slip against published numbers and closed forms: Dahl's (2.9) and
``Friction.coefficient`` of every law; and in steady slip.
"""

from __future__ import annotations

import math
import re
from typing import Any

import attrs
import drives
import numpy as np
import pytest
import reference
from laws import EXAMPLES, STRIBECK, scaled

import beltdyn as bd
from beltdyn.base.checks import Array
from beltdyn.outputs.arcs import in_slip

EPS = float(np.finfo(float).eps)
NORMAL = 5e3  # N/m
LUGRE = bd.LuGre(mu_k=0.5, mu_s=0.75, v_stribeck=0.02, sigma=1e4, damping=0.3, viscous=0.05)
ELASTIC = bd.ElasticPlastic(mu=0.5, stiffness=4e7, damping=2.5e3)  # mu N / k = 62.5 um
#: One of each law of the table.
EACH = {name: scaled(law, 1.25) for name, law in EXAMPLES.items()}
EACH |= {"lugre": LUGRE, "elastic_plastic": ELASTIC}
MAXWELL = EXAMPLES["maxwell_slip"]


def test_published_values() -> None:
    """CHECKS section 1, seven digits: from rest, after a reversal, and of a belt slid over a locked
    drum, T2/T1 = exp(mu(x) pi).
    """
    law = bd.Dahl(mu_k=0.8, sigma=1e4)

    def after(*path: float) -> float:
        return float(law.coefficient([0.0, *path], velocity=0.1, normal=NORMAL)[-1])

    mu = np.array([after(x) for x in (1e-5, 5e-5, 1e-4, 5e-4)])
    assert mu == pytest.approx([0.0940025, 0.3717909, 0.5707962, 0.7984556], abs=5e-8)
    assert np.exp(np.pi * mu) == pytest.approx([1.343553, 3.215605, 6.008704, 12.285533], rel=3e-7)
    assert after(2e-4, 0.5e-4) == pytest.approx(-0.5647026, abs=5e-8)


def test_nested_loops_follow_the_exact_path() -> None:
    """Within a rounding of the state for each of the moves, and as many of the closed form."""
    rng = np.random.default_rng(3)
    turning = np.concatenate([[0.0], np.cumsum(rng.choice([-1, 1], 40) * rng.uniform(0, 3e-4, 40))])
    exact = np.array([float(v) for v in reference.dahl_path_exact(turning, 0.8, 1e4)])
    found = bd.Dahl(mu_k=0.8, sigma=1e4).coefficient(turning, velocity=0.37, normal=NORMAL)
    assert np.max(np.abs(found - exact)) <= 40 * 20 * EPS


def there_and_back(points: int = 2000) -> Array:
    out = np.linspace(0.0, 3e-4, points + 1)
    return np.concatenate([out, out[-2::-1], -out[1:]])


LOOPS = [
    (0.0, 4e-5, -4e-5) * 2,
    (0.0, -4e-4, 4e-4) * 2,
    np.cumsum([0.0, 3e-4, -1e-4, 1e-4, -1e-5, 2e-3]),
    (0.0, 1.0, -1.0),
]
LOOPED = [bd.Dahl(mu_k=0.8, sigma=1e4), bd.Dahl(mu_k=0.8, sigma=1e4, mu_s=1.0, v_stribeck=0.02)]


@pytest.mark.parametrize("law", [*LOOPED, LUGRE])
def test_hysteresis_loop_has_its_closed_form(law: Any) -> None:
    """(2.9) from turn to turn; for LuGre as well, and with a Stribeck curve: at constant velocity
    g is a constant. With the limit +-g, z - limit falls as exp(-sigma |x| / g), and F / N is
    z + d dz/dt / sigma + e v. At 1e-4 of v_stribeck, which is Dahl's law of the static coefficient,
    at it, and far above; loops of half of mu / sigma, of five times that, nested ones, and of so
    long moves that they end in steady sliding, z = g and F / N = g + e v. Each move rounds the
    state, and the closed form as often.
    """
    for turns, v in ((turns, v) for turns in LOOPS for v in (2e-6, 2e-4, 0.02, 1.0)):
        rise = (law.mu_s or law.mu_k) - law.mu_k
        g = law.mu_k + rise * math.exp(-((v / (law.v_stribeck or 1.0)) ** 2))
        z, exact = 0.0, [0.0]
        for move in np.diff(turns):
            way = math.copysign(1.0, move)
            z = way * g + (z - way * g) * math.exp(-law.sigma * abs(move) / g)
            bristles = getattr(law, "damping", 0.0) * (way * v - v * z / g)
            exact.append(z + bristles + getattr(law, "viscous", 0.0) * way * v)
        found = law.coefficient(np.array(turns), velocity=v, normal=NORMAL)
        assert found == pytest.approx(np.array(exact), abs=len(turns) * 20 * EPS)
        if abs(turns[1]) == 1.0:
            steady = g + getattr(law, "viscous", 0.0) * v
            assert found[1:] == pytest.approx(steady * np.sign(turns[1:]), abs=20 * EPS)


def test_elastic_plastic_sticks_then_slips() -> None:
    """Stuck until k s + c v = mu N, then mu; back: stuck over 2 mu N / k.

    The limit is noticed one point late, 0.15 um of slip, which stretch the spring by that and relax
    within c / k of time, 0.6 um of way.
    """
    v, k, c, mu = 0.01, ELASTIC.stiffness, ELASTIC.damping, ELASTIC.mu
    slip = there_and_back()
    found = ELASTIC.coefficient(slip, velocity=v, normal=NORMAL)
    late = k * 0.15e-6 / NORMAL
    away = slip[:2001]
    there = np.minimum((k * away + c * v) / NORMAL, mu)[1:]
    assert found[1:2001] == pytest.approx(there, abs=2000 * 5 * EPS)
    back = np.maximum(mu - (k * (away[-1] - away[::-1]) + c * v) / NORMAL, -mu)[1:]
    # The damper carried c v of mu N until it turned.
    assert np.max(np.abs(found[2001:4001] - back)) <= c * v / NORMAL + late


@pytest.mark.parametrize("name", EACH)
def test_every_law_has_a_mirror_image_and_resists(name: str) -> None:
    """LuGre does not depend on the number of points: 6000 moves round the state, of 1 at most, five
    times each.
    """
    law, slip = EACH[name], np.append(there_and_back(200), there_and_back(200)[-1])
    found = law.coefficient(slip, velocity=0.01, normal=NORMAL)
    np.testing.assert_array_equal(law.coefficient(-slip, velocity=0.01, normal=NORMAL), -found)
    assert found[-1] == found[-2]  # the same point again
    assert np.sum(found[1:] * np.diff(slip)) > 0.0
    assert not law.coefficient([1.0], velocity=0.01, normal=NORMAL).any()
    assert law.coefficient([], velocity=0.01, normal=NORMAL).shape == (0,)
    if law is LUGRE:
        fine = law.coefficient(there_and_back(), velocity=0.01, normal=NORMAL)
        assert np.max(np.abs(fine[::10] - found[:-1])) <= 6000 * 5 * EPS


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slip": 1.0}, "slip must have 1 dimension"),
        ({"slip": [0.0, np.nan]}, "slip must be finite"),
        ({"velocity": 0.0}, "velocity must be > 0 m/s, got 0 m/s"),
        ({"normal": -1.0}, "normal must be > 0 N/m, got -1 N/m"),
    ],
)
def test_what_is_refused(change: dict[str, Any], message: str) -> None:
    given = {"slip": [0.0, 1.0], "velocity": 1.0, "normal": 1.0} | change
    with pytest.raises(ValueError, match=re.escape(message)):
        LUGRE.coefficient(**given)


def prandtl(slip: Array) -> Array:
    """Friction coefficient along a slow path from rest: each element's stop operator in turn.

    An element follows the path with its stiffness and is held at its limit (Prandtl, Ishlinskii).
    """
    total = np.zeros_like(slip)
    for mu, stiffness in zip(MAXWELL.mu, MAXWELL.stiffness, strict=True):
        force = 0.0
        for k, move in enumerate(np.diff(slip).tolist()):
            force = min(max(force + stiffness / NORMAL * move, -mu), mu)
            total[k + 1] += force
    return total


STEP = 5e-7  # m


def path_of(*turns: float) -> Array:
    """Straight from turn to turn, from 0."""
    legs = [np.zeros(1)]
    for begin, end in zip((0.0, *turns), turns, strict=False):
        legs.append(np.linspace(begin, end, round(abs(end - begin) / STEP) + 1)[1:])
    return np.concatenate(legs)


def test_a_slow_path_has_the_closed_form_of_stops_in_parallel() -> None:
    """At 1e-7 m/s dampers carry next to nothing, d v / k = 3e-12 m of 1e-5; an element that begins
    to slip notices at the next point, a step of 0.5 um, of which its stiffness makes the error.
    """
    slip = path_of(2e-4, -1e-4, 3e-5, -6e-5, 1e-5, 2.5e-4, -2.5e-4)
    found = MAXWELL.coefficient(slip, velocity=1e-7, normal=NORMAL)
    error = np.max(np.abs(found - prandtl(slip)))
    assert error <= 1.01 * sum(MAXWELL.stiffness) / NORMAL * STEP
    # the first two slip, the third nearly
    assert 0.9 < np.max(np.abs(found)) / sum(MAXWELL.mu) < 1.0


def test_loops_have_the_work_and_the_memory_of_masing() -> None:
    """The work of a loop of amplitude a is 4 mu_e (a - mu_e n / k_e) of every element that slips;
    a small loop inside closes, and the path goes on as if it had not been.
    """
    a = 1.5e-4
    loop = path_of(a, -a, a)
    mu = MAXWELL.coefficient(loop, velocity=1e-7, normal=NORMAL)
    closed = slice(int(np.argmax(loop)), None)
    work = np.trapezoid(mu[closed], loop[closed])
    onset = [m * NORMAL / k for m, k in zip(MAXWELL.mu, MAXWELL.stiffness, strict=True)]
    exact = sum(4 * m * (a - s) for m, s in zip(MAXWELL.mu, onset, strict=True) if s < a)
    assert onset[0] < onset[1] < a < onset[2]  # two of three slip
    # two corners a loop, at each of which a triangle of a step is wrong
    assert work == pytest.approx(exact, rel=1e-3)
    end, other = (
        MAXWELL.coefficient(path, velocity=1e-7, normal=NORMAL)[-1]
        for path in (path_of(a, 4e-5, 9e-5, 4e-5, -a), path_of(a, -a))
    )
    # up to how far the three are past their corners when they notice
    assert end == pytest.approx(other, abs=2 * STEP * sum(MAXWELL.stiffness) / NORMAL)


def test_in_full_slip_with_a_stribeck_curve_the_sum_is_that_curve() -> None:
    law, path = STRIBECK["maxwell_slip"], np.linspace(0.0, 1e-2, 401)
    for v in (1e-4, 0.02, 0.05, 0.3):
        kinetic = sum(law.mu)
        exact = kinetic + (law.mu_s - kinetic) * np.exp(-((v / law.v_stribeck) ** 2))
        found = law.coefficient(path, velocity=v, normal=NORMAL)[-1]
        assert found == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("name", EXAMPLES)
def test_coefficients_in_slip_are_those_at_the_end_of_a_long_path(name: str) -> None:
    """Friction develops over 0.1 mm: after 10 mm it is that of slip, whatever the law."""
    law, path = EXAMPLES[name], np.linspace(0.0, 1e-2, 401)
    params = attrs.evolve(drives.plain(), friction=law)
    kinetic = float(params._slip_limits[0][0])
    for speed in (1e-4, 0.03, 1.0):
        end = law.coefficient(path, velocity=speed, normal=5e3)[-1]
        (found,) = law._in_slip(np.array([speed]), kinetic)
        assert found == pytest.approx(end, rel=1e-9)


def test_lugre_in_slip_has_its_closed_form_and_others_none() -> None:
    law = EXAMPLES["lugre"]
    velocity = np.array([-3.0, -0.04, 0.0, 1e-9, 0.01, 0.05, 0.1, 2.0])
    exact = law.mu_k + (law.mu_s - law.mu_k) * np.exp(-((velocity / law.v_stribeck) ** 2))
    exact += law.viscous * np.abs(velocity)
    np.testing.assert_allclose(in_slip(law, law.mu_k, velocity), exact, rtol=1e-3)
    for other in (bd.Dahl(mu_k=0.8, sigma=1e4), EXAMPLES["elastic_plastic"]):
        assert in_slip(other, 0.8, velocity) is None
    assert in_slip(law, law.mu_k, np.zeros(3)) is None
