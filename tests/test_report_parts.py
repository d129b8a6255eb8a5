"""Parts of a report against something independent of it.

Rainflow against the example of the standard, spectra against sines, the moving string against its
closed form, creep against theory, powers against the ledger and against each other.
"""

from __future__ import annotations

import functools
import math

import creep_theory
import numpy as np
import pytest
from test_creep_theory import DENSITY, DRIVE, EA, FULL, OMEGA, RADII, loaded, slip_of, stiff

import beltdyn as bd
from beltdyn.report import rainflow
from beltdyn.report.spans import dominant, moving_string

pytestmark = [
    pytest.mark.filterwarnings("ignore:balance:UserWarning"),
    pytest.mark.filterwarnings("ignore:mesh:UserWarning"),
]


def test_rainflow_counts_the_example_of_the_standard() -> None:
    """ASTM E1049-85, figure 6: ranges and counts of its table."""
    cycles = rainflow([-2, 1, -3, 5, -1, 3, -4, 4, -2])
    counts: dict[float, float] = {}
    for one in cycles:
        counts[one.range] = counts.get(one.range, 0.0) + one.count
    assert counts == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    inner = next(one for one in cycles if one.range == 4.0 and one.count == 1.0)
    assert inner.mean == 1.0  # from -1 to 3


def test_a_missing_rainflow_is_said_by_the_name_of_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rainflow", None)
    with pytest.raises(ImportError, match=r"beltdyn\[report\]"):
        rainflow([0.0, 1.0, 0.0])


T = np.linspace(0.0, 1.0, 401)


@pytest.mark.parametrize("frequency", [4.0, 17.3, 60.5, 120.25])
def test_the_line_of_a_sine_has_its_frequency_and_amplitude(frequency: float) -> None:
    """On a trend, in noise of a tenth of it: within a tenth of the resolution, 1 Hz, and 5 %."""
    noise = np.random.default_rng(1).normal(0.0, 0.3, T.size)
    line = dominant(T, 500.0 + 40.0 * T + 3.0 * np.sin(2.0 * np.pi * frequency * T + 0.3) + noise)
    assert line.frequency == pytest.approx(frequency, abs=0.1)
    assert line.amplitude == pytest.approx(3.0, rel=0.05)


def test_no_line_stands_out_of_noise_or_of_a_trend() -> None:
    """Of 200 histories of noise none may have one: the limit is argued for one in a hundred."""
    random = np.random.default_rng(2)
    assert all(dominant(T, random.normal(size=T.size)) is None for _ in range(200))
    assert dominant(T, 3.0 + T + 0.2 * T**2) is None
    assert dominant(T, np.full(T.size, 7.0)) is None
    assert dominant(T[:6], np.sin(T[:6])) is None


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_moving_string(share: float) -> None:
    """Waves go out at c - v and come back at c + v: the period is the sum of both times."""
    tension, density, length = 400.0, 0.1, 0.5
    wave = math.sqrt(tension / density)
    speed = share * wave
    period = length / (wave - speed) + length / (wave + speed)
    assert moving_string(tension, density, length, speed) == pytest.approx(1.0 / period, rel=1e-12)
    assert moving_string(tension, density, length, -speed) == pytest.approx(1.0 / period)
    assert moving_string(tension, density, length, 1.1 * wave) == 0.0


@functools.cache
def report(share: float) -> bd.Report:
    """Of the unequal pulleys of tests/test_creep_theory.py, stiff contact, over all samples."""
    return loaded(120, share).report(0.999)


@pytest.mark.parametrize("share", [0.5])
def test_creep_of_stretch_is_that_of_theory(share: float) -> None:
    state = creep_theory.steady(DRIVE, OMEGA, lambda _omega: share * FULL.load)
    row = report(share).creep["pulley 1"]
    stretch = math.log(DRIVE.stretch(state.tight) / DRIVE.stretch(state.slack))
    assert row.stretch == pytest.approx(stretch, rel=0.01)
    lost = -math.log(state.omega * RADII[1] / (OMEGA * RADII[0]))
    assert row.lost == pytest.approx(lost, rel=0.01)
    # Nothing else is there to take speed: contact and bristles are all but rigid.
    assert abs(row.friction) + abs(row.radius) + abs(row.remainder) < 0.02 * stretch


def test_parts_of_creep_add_up() -> None:
    row = report(0.5).creep[0]
    total = row.stretch + row.friction + row.radius + row.remainder
    assert total == pytest.approx(row.lost, rel=1e-12)
    assert row.ratio / row.nominal == pytest.approx(math.exp(-row.lost), rel=1e-12)


def test_arcs_and_ratios_are_those_of_theory() -> None:
    state = creep_theory.steady(DRIVE, OMEGA, lambda _omega: 0.5 * FULL.load)
    mass = DENSITY * (OMEGA * RADII[0] / DRIVE.stretch(state.tight)) ** 2
    tight, slack = (H - mass * (1.0 + H / EA) for H in (state.tight, state.slack))
    for k, row in enumerate(report(0.5).pulleys):
        assert row.ratio == pytest.approx(tight / slack, rel=5e-3)
        assert row.limit == pytest.approx(math.exp(0.4 * DRIVE.wraps[k]), rel=1e-9)
        assert row.used == pytest.approx(state.slip / DRIVE.wraps[k], rel=5e-3)
        assert row.wrap == pytest.approx(DRIVE.wraps[k], rel=5e-3)
        # Of friction from 0.95 of its limit on, and links are 5 and 10 degrees long.
        assert row.slip_arc == pytest.approx(state.slip, rel=0.05)


def test_creep_of_friction_is_that_of_dahl() -> None:
    """(1 + d) on the driving pulley, (1 - d) on the driven one, by the closed form for d.

    Within the 1 % that tests/test_creep_theory.py has for the whole, and the half of the belt's
    stretch, 0.8 % of d, that may stand in either part.
    """
    told = stiff(250.0).report(0.999)
    row = told.creep[0]
    tensions = [span.tension.mean for span in told.spans if span.tension is not None]
    d = slip_of(max(tensions) / min(tensions), 250.0)
    assert row.friction == pytest.approx(math.log((1.0 + d) / (1.0 - d)), rel=0.018)
    assert abs(row.stretch) < 0.02 * row.friction
    assert abs(row.radius) + abs(row.remainder) < 0.01 * row.friction


def test_what_the_radius_does_is_told_apart_from_creep() -> None:
    """A soft contact, not compensated: the smaller pulley loses radius, and the driven one speed.

    The theory is beltdyn.compliance's, right to a fifth of that part, for friction acts already
    where the belt is still sinking in, further out: that much may be told as friction's.
    """
    from beltdyn.compliance import compliance

    params = bd.Params(
        belt=bd.Belt(
            preload=400.0, n_bodies=120, linear_density=0.1, axial_stiffness=60e3, axial_damping=2.0
        ),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.04, inertia=2e-3),
            bd.Pulley(center=(0.3, 0.0), radius=0.09, inertia=2e-3),
        ],
        contact=bd.Contact(linear=5.2e7, damping=2e3),
        friction=bd.ElasticPlastic(mu=0.8, stiffness=1e9, damping=1e4),
    )
    load = bd.PiecewiseLinear([0.1, 0.15], [0.0, 9.0], 1)
    motion = {0: bd.PiecewiseLinear([0.0, 0.1], [0.0, -60.0])}
    result = bd.simulate(params, load, 0.6, motion)
    told = result.report(0.4)
    row = told.creep[0]
    assert not told.unsteady
    tension = [span.tension.mean for span in told.spans if span.tension is not None]
    sunk = compliance(params, tension, abs(told.belt_speed or 0.0))
    # The belt arrives at pulley 1 as slack as span 0 is, at pulley 0 as tight as span 1.
    radius = -math.log((1.0 - sunk.relative_depth[0, 0]) / (1.0 - sunk.relative_depth[1, 0]))
    assert abs(radius) > 3e-3
    assert row.radius == pytest.approx(radius, rel=0.2)
    strains = [1.0 + T / 60e3 for T in tension]
    assert row.stretch == pytest.approx(math.log(strains[1] / strains[0]), rel=1e-6)
    assert abs(row.friction) < 0.2 * abs(radius)
    assert abs(row.remainder) < 0.05 * row.lost


def test_powers_add_up_to_what_is_put_in() -> None:
    result = loaded(120, 0.5)
    rows = report(0.5).powers
    put_in = sum(row.power for row in rows if row.kind == "in")
    others = sum(row.power for row in rows if row.kind != "in")
    assert put_in == pytest.approx(others, rel=1e-12)
    # What friction takes is the creep of theory; links that pass lose some in the joints, too.
    state = creep_theory.steady(DRIVE, OMEGA, lambda _omega: 0.5 * FULL.load)
    lost = sum(row.power for row in rows if row.kind == "lost")
    friction = sum(row.power for row in rows if row.name.startswith("friction"))
    of_theory = state.torque * OMEGA - state.load * state.omega
    assert friction == pytest.approx(of_theory, rel=0.02)
    assert result.energy is not None
    told = report(0.5)
    assert told.efficiency == pytest.approx(1.0 - lost / put_in, rel=1e-12)
    assert rows["friction on pulley 0"].power > 0.0 < rows["friction on pulley 1"].power
    assert abs(rows["friction, error of sampling"].power) < 0.05 * lost
    assert abs(rows["error of sampling"].power) < 0.05 * lost
