"""The friction coefficient along a path of slip, ``Friction.coefficient``, against closed forms; in
steady slip."""

from __future__ import annotations

import re
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from laws import EXAMPLES, scaled

import beltdyn as bd
from beltdyn import _core
from beltdyn.arcs import in_slip
from beltdyn.checks import Array
from beltdyn.friction import LAWS

EPS = float(np.finfo(float).eps)
NORMAL = 5e3  # N/m
LUGRE = bd.LuGre(mu_k=0.5, mu_s=0.75, v_stribeck=0.02, sigma=1e4, damping=0.3, viscous=0.05)
ELASTIC = bd.ElasticPlastic(mu=0.5, stiffness=4e7, damping=2.5e3)  # mu N / k = 62.5 um
KNOWN: dict[type[bd.Friction], bd.Friction] = {bd.LuGre: LUGRE, bd.ElasticPlastic: ELASTIC}
#: One of each law of the table.
EACH = {name: KNOWN.get(law) or scaled(EXAMPLES[name], 1.25) for name, law in LAWS.items()}


def there_and_back(points: int = 2000) -> Array:
    out = np.linspace(0.0, 3e-4, points + 1)
    return np.concatenate([out, out[-2::-1], -out[1:]])


def test_dahl_is_the_closed_form_from_however_few_points() -> None:
    """A rounding of the state for each of the 20 moves, and as many of the closed form."""
    law = bd.Dahl(mu_k=0.8, sigma=1e4)
    slip = np.cumsum(np.random.default_rng(1).uniform(-3e-4, 3e-4, 20))
    found = law.coefficient(slip, velocity=0.37, normal=NORMAL)
    assert found[0] == 0.0
    exact = _core.dahl_path(slip, 0.0, law.mu_k, law.sigma)
    assert np.max(np.abs(found - exact)) <= 20 * 20 * EPS


@pytest.mark.parametrize("v", [1e-4, 0.02, 0.5])
def test_lugre_ends_in_steady_sliding(v: float) -> None:
    """In one move of 1 m, 20000 times mu / sigma; the terms of the force are below 1 and round."""
    g = LUGRE.mu_k + (LUGRE.mu_s - LUGRE.mu_k) * np.exp(-((v / LUGRE.v_stribeck) ** 2))
    for way in (1.0, -1.0):
        found = LUGRE.coefficient([0.0, way], velocity=v, normal=NORMAL)[1]
        assert found == pytest.approx(way * (g + LUGRE.viscous * v), abs=20 * EPS)


def test_lugre_does_not_depend_on_the_number_of_points() -> None:
    """6000 moves, which each round the state, of 1 at most, five times."""
    fine = LUGRE.coefficient(there_and_back(), velocity=0.01, normal=NORMAL)
    coarse = LUGRE.coefficient(there_and_back(20), velocity=0.01, normal=NORMAL)
    assert np.max(np.abs(fine[::100] - coarse)) <= 6000 * 5 * EPS


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
    law, slip = EACH[name], np.append(there_and_back(), there_and_back()[-1])
    found = law.coefficient(slip, velocity=0.01, normal=NORMAL)
    np.testing.assert_array_equal(law.coefficient(-slip, velocity=0.01, normal=NORMAL), -found)
    assert found[-1] == found[-2]  # the same point again
    assert np.sum(found[1:] * np.diff(slip)) > 0.0
    assert not law.coefficient([1.0], velocity=0.01, normal=NORMAL).any()
    assert law.coefficient([], velocity=0.01, normal=NORMAL).shape == (0,)


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


@pytest.mark.parametrize("name", EXAMPLES)
def test_coefficients_in_slip_are_those_at_the_end_of_a_long_path(name: str) -> None:
    """Friction develops over 0.1 mm: after 10 mm it is that of slip, whatever the law."""
    law, path = EXAMPLES[name], np.linspace(0.0, 1e-2, 2001)
    params = attrs.evolve(drives.plain(), friction=law)
    kinetic = float(params._slip_limits[0][0])
    for speed in (1e-4, 0.03, 1.0):
        end = law.coefficient(path, velocity=speed, normal=5e3)[-1]
        (found,) = law._in_slip(np.array([speed]), kinetic)
        assert found == pytest.approx(end, rel=1e-9)


def test_lugre_in_slip_has_its_closed_form_and_others_none() -> None:
    law = EXAMPLES["lugre"]
    assert isinstance(law, bd.LuGre)
    velocity = np.array([-3.0, -0.04, 0.0, 1e-9, 0.01, 0.05, 0.1, 2.0])
    exact = law.mu_k + (law.mu_s - law.mu_k) * np.exp(-((velocity / law.v_stribeck) ** 2))
    exact += law.viscous * np.abs(velocity)
    found = in_slip(law, law.mu_k, velocity)
    assert found is not None
    np.testing.assert_allclose(found, exact, rtol=1e-3)
    for other in (bd.Dahl(mu_k=0.8, sigma=1e4), EXAMPLES["elastic_plastic"]):
        assert in_slip(other, 0.8, velocity) is None
    assert in_slip(law, law.mu_k, np.zeros(3)) is None
