"""The friction laws of MODEL section 4 on their own: closed forms and published numbers, of the
core's. The oracle's are the same (test_law_slopes.py). Loops: test_friction_path.py.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import scipy.integrate
from laws import core_law
from oracle_drives import law_by_hand
from reference_friction import (
    Array,
    Coulomb,
    CreepRate,
    Dahl,
    ElasticPlastic,
    Law,
    LuGre,
    MaxwellSlip,
    Stateless,
    Threlfall,
)

import beltdyn as bd
from beltdyn import _core

EPS = float(np.finfo(float).eps)
L0 = 0.02  # m, of a link


def oracle(law: Law, l0: float, z: Array, v: Array, normal: Array) -> tuple[Array, Array]:
    """F and dz/dt, of arrays of one size."""
    return law.force(z, v, normal, l0), law.rate(z, v, normal, l0)


def core(law: Law, l0: float, z: Array, v: Array, normal: Array) -> tuple[Array, Array]:
    if z.ndim == 2:  # several states: the sum of the elements' forces, and the rate of each
        each = [_core.friction_law(core_law(law), l0, one, v, normal, e) for e, one in enumerate(z)]
        return np.sum([out["force"] for out in each], axis=0), np.array([o["rate"] for o in each])
    out = _core.friction_law(core_law(law), l0, z, v, normal)
    return out["force"], out["rate"]


DAHL = Dahl(mu_k=0.8, sigma=1e4)
LUGRE = LuGre(mu_k=0.5, mu_s=0.75, v_stribeck=0.02, sigma=1e4, damping=0.3, viscous=0.05)
ELASTIC = ElasticPlastic(mu=0.5, stiffness=4e8, damping=2.5e4)  # c / k = 62.5 us
COULOMB, CREEP = Coulomb(mu=0.7, v_reg=0.02), CreepRate(mu=0.7, v_critical=0.03)
THRELFALL = Threlfall(mu=0.7, v_reg=0.05)
STATELESS = {"Coulomb": COULOMB, "creep rate": CREEP, "Threlfall": THRELFALL}
MAXWELL = MaxwellSlip(mu=(0.1, 0.25, 0.15), stiffness=(4e8, 1e8, 2e7), damping=(2.5e4, 1e4, 5e3))
FALLING = {"mu_s": 0.9, "v_stribeck": 0.02}
LAWS: dict[str, Law] = {
    "Dahl": DAHL,
    "LuGre": LUGRE,
    "elastic/plastic": ELASTIC,
    **STATELESS,
    "Maxwell slip": MAXWELL,
    "Dahl, Stribeck": dataclasses.replace(DAHL, **FALLING),
    "elastic/plastic, Stribeck": dataclasses.replace(ELASTIC, **FALLING),
    "Coulomb, Stribeck": dataclasses.replace(COULOMB, **FALLING),
    "Maxwell slip, Stribeck": dataclasses.replace(MAXWELL, **FALLING),
}


def at_one(law: Law, z: float, v: float, normal: float) -> tuple[float, float]:
    force, rate = core(law, L0, np.array([z]), np.array([v]), np.array([normal]))
    return float(force[0]), float(rate[0])


def random_points(law: Law, seed: int) -> tuple[Array, Array, Array]:
    """States within the bound (elastic/plastic: up to twice the limit, N falls while z waits)."""
    rng = np.random.default_rng(seed)
    n = 400
    normal = rng.uniform(0.0, 300.0, n)
    v = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-8, 1, n)
    if isinstance(law, ElasticPlastic):
        z = rng.uniform(-2, 2, n) * law.mu * normal / (law.stiffness * L0)
    elif isinstance(law, MaxwellSlip):
        z = np.array([random_points(one, seed + 100 * e)[0] for e, one in enumerate(law.elements)])
    else:
        z = rng.uniform(-1, 1, n) * law.bound
    normal[:20], v[10:30], z[..., 20:40] = 0.0, 0.0, 0.0
    return z, v, normal


def rounding(law: Law, z: Array, v: Array, normal: Array) -> tuple[Array, Array]:
    """Rounding of F and of dz/dt: 20 times the last bit of the largest term of each.

    Ten operations at most lead to each, and two evaluations differ by twice their rounding.
    """
    if isinstance(law, ElasticPlastic):
        k, c = law.stiffness * L0, law.damping * L0
        force = k * np.abs(z) + c * np.abs(v) + max(law.mu, law.mu_s) * normal
        return 20 * EPS * force, 20 * EPS * force / c
    if isinstance(law, LuGre):
        deflecting = np.abs(v) * (1 + np.abs(z) / law.mu_k)
        force = normal * (np.abs(z) + law.damping * deflecting + law.viscous * np.abs(v))
        return 20 * EPS * force, 20 * EPS * law.sigma * deflecting
    if isinstance(law, Stateless):
        most = max(law.mu, getattr(law, "mu_s", 0.0))  # type: ignore[attr-defined]
        return 20 * EPS * most * normal, 0.0 * z
    if isinstance(law, MaxwellSlip):
        each = [rounding(one, x, v, normal) for one, x in zip(law.elements, z, strict=True)]
        return np.sum([one for one, _ in each], axis=0), np.array([other for _, other in each])
    assert isinstance(law, Dahl)
    rate = law.sigma * np.abs(v) * (1 + np.abs(z) / law.mu_k)
    return 20 * EPS * np.abs(z) * normal, 20 * EPS * rate


@pytest.mark.parametrize("name", LAWS)
def test_force_and_rate_are_those_of_the_equations(name: str) -> None:
    """And those of the mirror image are opposite, to the last bit."""
    law = LAWS[name]
    z, v, normal = random_points(law, 1)
    force, rate = core(law, L0, z, v, normal)
    by_hand = [law_by_hand(law, *p, L0) for p in zip(z.T, v, normal, strict=True)]
    f_rounding, rate_rounding = rounding(law, z, v, normal)
    assert np.all(np.abs(force - np.array([force for force, _ in by_hand])) <= f_rounding)
    assert np.all(np.abs(rate - np.array([rate for _, rate in by_hand]).T) <= rate_rounding)
    opposite, opposite_rate = core(law, L0, -z, -v, normal)
    np.testing.assert_array_equal(opposite, -force)
    np.testing.assert_array_equal(opposite_rate, -rate)


def test_state_does_not_leave_its_bound() -> None:
    v = np.concatenate([10.0 ** np.arange(-8.0, 2.0), -(10.0 ** np.arange(-8.0, 2.0)), [0.0]])
    for law in (DAHL, LUGRE):
        z, normal = np.full_like(v, law.bound), np.full_like(v, 100.0)
        _, rate = core(law, L0, z, v, normal)
        # Dahl's rate is 0 there for v > 0, but for the rounding of z / mu_k.
        assert np.all(rate <= rounding(law, z, v, normal)[1]), law
        assert np.all(rate[v < 0] < 0), law


def test_elastic_plastic_never_pulls_beyond_its_limit_and_never_drives() -> None:
    """F v is at least the growth of the spring's energy, k z dz/dt, for any state."""
    z, v, normal = random_points(ELASTIC, 3)
    force, rate = core(ELASTIC, L0, z, v, normal)
    limit = ELASTIC.mu * normal
    f_rounding, rate_rounding = rounding(ELASTIC, z, v, normal)
    assert np.all(np.abs(force) <= limit + f_rounding)
    sticks = np.abs(rate - v) <= rate_rounding
    slips = np.abs(force) >= limit - f_rounding
    assert np.all(sticks | slips) and sticks.sum() > 50 and slips.sum() > 50
    # Beyond the limit (|k z| > mu N) the spring is let go: its energy falls into the damper.
    spring = ELASTIC.stiffness * L0 * z
    lost = force * v - spring * rate
    assert np.all(lost >= -(f_rounding * np.abs(v) + np.abs(spring) * rate_rounding))


@pytest.mark.parametrize("name", STATELESS)
def test_friction_without_a_state_has_its_published_points(name: str) -> None:
    """Nothing at rest, mu N in full slip, and what stands between as it is published: at v_reg
    Coulomb 1 / sqrt(2), Threlfall 1 - exp(-3) = 0.950213; half of v_critical half of mu. And no
    hysteresis: whatever stands where other laws have their state, the force is the same.
    """
    law = STATELESS[name]
    points = {
        "Coulomb": [(0.02, math.sqrt(0.5)), (0.02 * 0.75, 0.6), (2e6, 1.0)],
        "creep rate": [(0.015, 0.5), (0.03, 1.0), (0.3, 1.0), (1e-9, 1e-9 / 0.03)],
        "Threlfall": [(0.05, 0.9502129316321360), (0.05 / 3.0, 0.6321205588285577), (2e3, 1.0)],
    }[name]
    for v, share in points:
        for way in (1.0, -1.0):
            force, rate = at_one(law, 0.0, way * v, 80.0)
            assert force == pytest.approx(way * share * law.mu * 80.0, rel=1e-14, abs=20 * EPS * 80)
            assert rate == 0.0
            assert at_one(law, 0.3 * way, way * v, 80.0) == (force, 0.0)
    assert at_one(law, 0.0, 0.0, 80.0) == (0.0, 0.0)
    assert at_one(law, 0.0, 0.3, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize("name", STATELESS)
def test_creep_is_the_velocity_that_a_share_of_friction_needs(name: str) -> None:
    """The closed forms of MODEL section 4 turn those of the force round."""
    law = STATELESS[name]
    friction = getattr(bd, type(law).__name__)(**dataclasses.asdict(law))
    for share in (0.0, 1e-6, 0.3, 0.5, 0.9, 0.999):
        v = friction.creep(share)
        force, _ = at_one(law, 0.0, v, 80.0)
        assert force == pytest.approx(share * law.mu * 80.0, abs=40 * EPS * 80.0)
    for bad in (1.0, -0.1, math.nan):
        with pytest.raises(ValueError, match=r"^share must "):
            friction.creep(bad)
    assert bd.Dahl(mu_k=0.8, sigma=1e4).creep(0.5) == 0.0


NORMAL = 120.0


def test_elastic_plastic_force_drops_at_a_reversal() -> None:
    """By 2 c V while it sticks; by c V, and what the damper carried of it, while it slips."""
    k, c, limit = ELASTIC.stiffness * L0, ELASTIC.damping * L0, ELASTIC.mu * NORMAL
    v, rounded = 0.02, 40 * EPS * limit
    # slipping, k z + c dz/dt = mu N: from where it began, z goes to mu N / k, 1.5 c / k later
    slipping = (limit - c * v * math.exp(-1.5)) / k
    drops = {0.0: 2.0, 0.5 * limit / k: 2.0, -0.3 * limit / k: 2.0, limit / k: 1.0}
    for z, drop in (drops | {slipping: 1.0 + math.exp(-1.5)}).items():
        ahead, back = (at_one(ELASTIC, z, way * v, NORMAL)[0] for way in (1.0, -1.0))
        assert ahead - back == pytest.approx(drop * c * v, abs=rounded)
        assert drop == 2.0 or ahead == pytest.approx(limit, abs=rounded)


def test_lugre_without_its_additions_is_dahl() -> None:
    plain = LuGre(DAHL.mu_k, DAHL.mu_k, 0.02, DAHL.sigma, 0.0, 0.0)
    z, v, normal = random_points(DAHL, 4)
    pairs = zip(*(core(law, L0, z, v, normal) for law in (plain, DAHL)), strict=True)
    for (one, dahl), bound in zip(pairs, rounding(DAHL, z, v, normal), strict=True):
        assert np.all(np.abs(one - dahl) <= bound)


def test_lugre_mass_of_the_article() -> None:
    """Mass on a spring whose end is drawn at 0.1 m/s, 25 s of stick and slip (CHECKS section 1).

    In the article's symbols M = 1, K = 2, sigma_0 = 1e5, sigma_1 = sqrt(1e5), sigma_2 = 0.4,
    F_C = 1, F_S = 1.5, v_s = 1e-3; with N = 1 N, z is its deflection times sigma_0.
    """
    sigma = 1e5
    law = core_law(LuGre(1.0, 1.5, 1e-3, sigma, math.sqrt(sigma), 0.4))

    def motion(t: float, state: Array) -> list[float]:
        x, v, z = state
        out = _core.friction_law(law, L0, np.array([z]), np.array([v]), np.array([1.0]))
        return [v, 2.0 * (0.1 * t - x) - out["force"][0], out["rate"][0]]

    # An error dz leaves the mass swinging on its bristles at dz / sqrt(sigma_0 M): 7e-15 at these.
    atol = np.array([1e-12, 1e-15, 1e-12])
    run = scipy.integrate.solve_ivp(
        motion, (0.0, 25.0), [0.0, 0.0, 0.0], method="LSODA", rtol=1e-12, atol=atol
    )
    x, v, z = run.y[:, -1]
    # Half a unit of the last digit given. At the end it sticks, and earlier errors have decayed; v,
    # the smallest of the three, is known to a few times its own tolerance.
    assert x == pytest.approx(1.9088392, abs=5e-8)
    assert v == pytest.approx(9.42415459e-6, abs=5e-15 + 10 * atol[1])
    assert z / sigma == pytest.approx(1.18167955e-5, abs=5e-14)
