"""The friction laws as the kernels evaluate them, at every instruction level: their values against
the oracle's, their slopes against differences of their values, on both sides of every kink.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from laws import EXAMPLES, STRIBECK, core_law
from reference_friction import Array, LuGre
from test_friction_laws import (
    ELASTIC,
    EPS,
    L0,
    LAWS,
    LUGRE,
    NORMAL,
    core,
    oracle,
    random_points,
    rounding,
)
from test_kernels import available

from beltdyn import _core
from beltdyn.drive.friction import Friction


class Numbers(NamedTuple):
    """A law as the core takes it, and which of its elements."""

    name: str
    values: tuple[float | tuple[float, ...], ...]
    element: int = 0

    def at(self, *point: Array) -> dict[str, Array]:
        """Force, rate and their slopes at z, v, N."""
        return _core.friction_law((self.name, self.values), L0, *point, self.element)


@pytest.fixture(params=range(3), ids=["baseline", "AVX2", "AVX-512"])
def kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """The kernel levels that the processor has, one after the other; its best one again for more.

    So that a slower processor runs the same tests.
    """
    levels = available(monkeypatch)
    name = levels[min(request.param, len(levels) - 1)]
    monkeypatch.setenv("BELTDYN_KERNELS", name)
    return name


@pytest.mark.parametrize("name", LAWS)
def test_core_and_oracle_agree(kernels: str, name: str) -> None:
    law = LAWS[name]
    for seed in range(5, 8):
        z, v, normal = random_points(law, seed)
        force, rate = core(law, L0, z, v, normal)
        expected, expected_rate = oracle(law, L0, z, v, normal)
        f_rounding, rate_rounding = rounding(law, z, v, normal)
        assert np.all(np.abs(force - expected) <= f_rounding)
        assert np.all(np.abs(rate - expected_rate) <= rate_rounding)


def test_stribeck_curve_has_the_digits_of_exp(kernels: str) -> None:
    """With mu_s = 1 and next to nothing for mu_k (1e-19 of the least here), g(v) is exp(-v^2), and
    -dG/dz is |v| / g(v).

    exp to two ulp (its own statement), the quotients and products of dG/dz one and a half more,
    NumPy's exp half a one.
    """
    law = LuGre(mu_k=1e-306, mu_s=1.0, v_stribeck=1.0, sigma=1.0, damping=0.0, viscous=0.0)
    a = np.concatenate([10.0 ** np.arange(-18.0, 0.0), np.linspace(0.0, 660.0, 20001)[1:]])
    v = np.sqrt(a)
    zero, one = np.zeros_like(v), np.ones_like(v)
    slope = _core.friction_law(core_law(law), L0, zero, v, one)["rate_by_state"]
    exact = np.exp(-(v * v))
    assert np.max(np.abs(v / -slope - exact) / exact) <= 4 * EPS
    # In steady sliding the force is that coefficient, for any coefficients and speeds.
    force, rate = core(LUGRE, L0, steady := LUGRE.level(v) * np.sign(v), v, NORMAL * one)
    f_rounding, rate_rounding = rounding(LUGRE, steady, v, NORMAL * one)
    assert np.all(np.abs(rate) <= rate_rounding)
    assert np.all(np.abs(force - NORMAL * (steady + LUGRE.viscous * v)) <= f_rounding)


SLOPES = {
    "z": ("by_state", "rate_by_state"),
    "v": ("by_slip", "rate_by_slip"),
    "normal": ("by_normal", "rate_by_normal"),
}
#: Steps of differences: a coefficient, or a stretch as large as presses like one; slip velocity far
#: below the scales on which the laws change with it, 0.02 m/s; normal force.
STEPS = {"v": 1e-6, "normal": 1e-4}


def state_scale(numbers: Numbers) -> float:
    """Size of z at which friction is of the order of the normal force NORMAL; any, without one."""
    one = np.ones(1)
    if _core.friction_states((numbers.name, numbers.values)) == 0:
        return 1.0
    out = numbers.at(0.0 * one, 0.0 * one, NORMAL * one)
    return float(NORMAL / out["by_state"][0])


def by_differences(
    numbers: Numbers, at: dict[str, Array], name: str, h: float
) -> tuple[Array, Array]:
    """Slopes of force and rate (2, n) by central differences; what rounding leaves of them.

    Rounding: 100 times the last bit of every term of a first order sum, over the step.
    """
    ahead, behind = (
        numbers.at(*({**at, name: at[name] + way * h}).values()) for way in (1.0, -1.0)
    )
    here = numbers.at(*at.values())
    slopes, left = [], []
    for k, value in enumerate(("force", "rate")):
        slopes.append((ahead[value] - behind[value]) / ((at[name] + h) - (at[name] - h)))
        terms = np.abs(here[value])
        for other, columns in SLOPES.items():
            terms = terms + np.abs(here[columns[k]] * at[other])
        left.append(100 * EPS * terms / h)
    return np.array(slopes), np.array(left)


def assert_slopes(numbers: Numbers, at: dict[str, Array], bent: float = 0.0) -> None:
    """All six of the core, of law and points off the kinks, against differences of its value.

    Curvature: (1e-6 / 0.02)^2 = 2.5e-9 of a slope, times 6 and some for the third derivative.
    bent: how much of a slope a corner in it makes between two points of a difference.
    """
    here = numbers.at(*at.values())
    for name, columns in SLOPES.items():
        h = STEPS.get(name, 1e-6 * state_scale(numbers))
        slopes, left = by_differences(numbers, at, name, h)
        for column, slope, rounded in zip(columns, slopes, left, strict=True):
            largest = np.max(np.abs(slope))
            error = np.abs(here[column] - slope)
            assert np.all(error <= (1e-7 + bent) * largest + rounded), (name, column)


def points_of(z: Any, v: Any, normal: Any) -> dict[str, Array]:
    arrays = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (z, v, normal)))
    return dict(zip(("z", "v", "normal"), (np.ravel(a) for a in arrays), strict=True))


#: Every law of the table, those with a Stribeck curve and every element of one with several.
EACH = {name: (law, 0) for name, law in EXAMPLES.items()}
EACH |= {f"{name}, Stribeck": (law, 0) for name, law in STRIBECK.items()}
EACH |= {
    f"{kind}maxwell_slip, element {e}": (law["maxwell_slip"], e)
    for kind, law in {"": EXAMPLES, "Stribeck, ": STRIBECK}.items()
    for e in (1, 2)
}


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", EACH)
def test_slopes_anywhere(kernels: str, name: str) -> None:
    """Of every law in the table, whatever it is: where slopes to both sides agree, they are the
    law's; elsewhere, at a kink, its are those of one side, and that is rare.
    """
    law, element = EACH[name]
    numbers, rng, n = Numbers(*law._to_core(), element), np.random.default_rng(9), 600
    scale = state_scale(numbers)
    bound = min(1.0, _bound(law)) * scale
    at = points_of(
        bound * rng.uniform(-1, 1, n),
        rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-5, 1, n),
        rng.uniform(1.0, 300.0, n),
    )
    here = numbers.at(*at.values())
    assert all(np.isfinite(column).all() for column in here.values())
    kinks = np.zeros(n, dtype=bool)
    for variable in SLOPES:
        h = STEPS.get(variable, 1e-6 * scale)
        for k, value in enumerate(("force", "rate")):
            ahead, behind = (
                numbers.at(*({**at, variable: at[variable] + way}).values()) for way in (h, -h)
            )
            _, left = by_differences(numbers, at, variable, h)
            two = [(ahead[value] - here[value]) / h, (here[value] - behind[value]) / h]
            largest = np.max(np.abs(two))
            kinks |= np.abs(two[0] - two[1]) > 1e-3 * largest + 2 * left[k]
            error = np.min(np.abs(two - here[SLOPES[variable][k]]), axis=0)
            assert np.all(error <= 1e-3 * largest + 2 * left[k]), (variable, value)
    assert kinks.sum() <= 0.02 * n
    assert_slopes(numbers, {variable: a[~kinks] for variable, a in at.items()})


def _bound(law: Friction) -> float:
    """Bound of the state over its scale: the law's largest coefficient."""
    found = [getattr(law, field, 0.0) for field in ("mu_k", "mu_s", "mu")]
    return max(sum(mu) if isinstance(mu, tuple) else mu for mu in found) or 1.0


@pytest.mark.parametrize("name", EACH)
def test_slopes_where_the_slip_velocity_changes_its_sign(kernels: str, name: str) -> None:
    """On either side, two steps away; at v = 0 the slopes are the mean of both sides.

    Threlfall's slope, exp(-3 |v| / v_reg), has a corner there: differences give its mean over the
    step, which is half of 3 h / v_reg less.
    """
    law, element = EACH[name]
    numbers = Numbers(*law._to_core(), element)
    z = state_scale(numbers) * 0.3 * np.array([-1.0, -0.3, 0.0, 0.7, 1.0])
    for side in (2.0, -2.0, 0.0):
        corner = side == 0.0 and name == "threlfall"
        bent = 1.5 * STEPS["v"] / law.v_reg if corner else 0.0  # type: ignore[attr-defined]
        assert_slopes(numbers, points_of(z[:, None], side * STEPS["v"], [10.0, NORMAL]), bent)


@pytest.mark.parametrize("name", EACH)
def test_slopes_where_the_normal_force_vanishes(kernels: str, name: str) -> None:
    """Just pressed; and N = 0, where what is left are the slopes at constant N."""
    law, element = EACH[name]
    numbers = Numbers(*law._to_core(), element)
    z = state_scale(numbers) * np.array([-0.5, -0.1, 0.2, 0.6])
    v = np.array([-0.3, -1e-3, 2e-3, 0.5])
    assert_slopes(numbers, points_of(z[:, None], v, 2 * STEPS["normal"]))
    at = points_of(z[:, None], v, 0.0)
    here = numbers.at(*at.values())
    assert np.all(here["force"] == 0.0)
    for variable in ("z", "v"):
        slopes, left = by_differences(
            numbers, at, variable, STEPS.get(variable, 1e-6 * state_scale(numbers))
        )
        for column, slope, rounded in zip(SLOPES[variable], slopes, left, strict=True):
            error = np.abs(here[column] - slope)
            assert np.all(error <= 1e-7 * np.max(np.abs(slope)) + rounded), column


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_slopes_on_both_sides_of_sticking(kernels: str, way: float) -> None:
    """K z + c v at mu N, less or more by three steps of each: first all slopes are those of spring
    and damper, then the force follows N alone and the spring goes to it.
    """
    numbers = Numbers(*core_law(ELASTIC))
    k, c = ELASTIC.stiffness * L0, ELASTIC.damping * L0
    v = way * np.array([-0.05, -1e-3, 1e-3, 0.02, 0.2])
    limit = way * ELASTIC.mu * NORMAL
    margin = 3 * way * (c * STEPS["v"] + ELASTIC.mu * STEPS["normal"] + 1e-6 * limit)
    for side in (-1.0, 1.0):
        at = points_of((limit + side * margin - c * v) / k, v, NORMAL)
        assert_slopes(numbers, at)
        here = numbers.at(*at.values())
        sticks, slips = float(side < 0), float(side > 0)
        expected = {
            "by_state": sticks * k,
            "by_slip": sticks * c,
            "by_normal": slips * way * ELASTIC.mu,
            "rate_by_state": -slips * k / c,
            "rate_by_slip": sticks,
            "rate_by_normal": slips * way * ELASTIC.mu / c,
        }
        for column, value in expected.items():
            assert here[column] == pytest.approx(value, rel=4 * EPS), column


def test_core_names_what_is_wrong_with_a_law() -> None:
    one = np.ones(1)
    for name, _, _ in _core.LAWS:
        numbers = EXAMPLES[name]._to_core()[1]
        rules = [row for row in _core.PARAMETERS if row[0] == name]
        assert len(rules) == len(numbers)
        for k, (_, field, _, _, _) in enumerate(rules):
            for bad in (-1.0, math.nan, math.inf):
                value = numbers[k]
                given = (*value[:-1], bad) if isinstance(value, tuple) else bad
                broken = (*numbers[:k], given, *numbers[k + 1 :])
                with pytest.raises(ValueError, match=rf"^friction\.{field} must be "):
                    _core.friction_law((name, broken), L0, one, one, one)
        with pytest.raises(ValueError, match="friction"):
            _core.friction_law((name, numbers[:-1]), L0, one, one, one)
    good = EXAMPLES["dahl"]._to_core()
    with pytest.raises(ValueError, match="glue"):
        _core.friction_law(("glue", (1.0,)), L0, one, one, one)
    for length, z, v, normal in [
        (0.0, 1.0, 1.0, 1.0),
        (math.nan, 1.0, 1.0, 1.0),
        (L0, math.inf, 1.0, 1.0),
        (L0, 1.0, math.nan, 1.0),
        (L0, 1.0, 1.0, -1.0),
    ]:
        with pytest.raises(ValueError):
            _core.friction_law(good, length, [z], [v], [normal])
    with pytest.raises(ValueError):
        _core.friction_law(good, L0, [0.0, 0.0], [0.0], [1.0])
