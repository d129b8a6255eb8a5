"""Parts of a report against something independent of it.

Rainflow against the example of the standard, spectra against sines, the moving string against its
closed form, what a soft contact does to radii. Creep, arcs and powers are held to theory in
test_creep_theory.py, where the runs are.
"""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from two_pulleys import open_drive

import beltdyn as bd
from beltdyn.compliance import compliance
from beltdyn.report import rainflow
from beltdyn.report.spans import dominant, moving_string

pytestmark = [
    pytest.mark.filterwarnings("ignore:balance:UserWarning"),
    pytest.mark.filterwarnings("ignore:mesh:UserWarning"),
]


def test_rainflow_counts_the_example_of_the_standard(monkeypatch: pytest.MonkeyPatch) -> None:
    """ASTM E1049-85, figure 6: ranges and counts of its table."""
    cycles = rainflow([-2, 1, -3, 5, -1, 3, -4, 4, -2])
    counts: dict[float, float] = {}
    for one in cycles:
        counts[one.range] = counts.get(one.range, 0.0) + one.count
    assert counts == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    inner = next(one for one in cycles if one.range == 4.0 and one.count == 1.0)
    assert inner.mean == 1.0  # from -1 to 3
    # without the package it names the extra
    monkeypatch.setitem(sys.modules, "rainflow", None)
    with pytest.raises(ImportError, match=r"beltdyn\[report\]"):
        rainflow([0.0, 1.0, 0.0])


T = np.linspace(0.0, 1.0, 401)


def test_the_line_of_a_sine_has_its_frequency_and_amplitude() -> None:
    """On a trend, in noise of a tenth of it: within a tenth of the resolution, 1 Hz, and 5 %. None
    of 200 histories of noise has one (the limit is argued for one in a hundred), and no trend.
    """
    noise = np.random.default_rng(1).normal(0.0, 0.3, T.size)
    for frequency in (4.0, 17.3, 60.5, 120.25):
        sine = 3.0 * np.sin(2.0 * np.pi * frequency * T + 0.3)
        line = dominant(T, 500.0 + 40.0 * T + sine + noise)
        assert line.frequency == pytest.approx(frequency, abs=0.1)
        assert line.amplitude == pytest.approx(3.0, rel=0.05)
    random = np.random.default_rng(2)
    assert all(dominant(T, random.normal(size=T.size)) is None for _ in range(200))
    assert dominant(T, 3.0 + T + 0.2 * T**2) is None
    assert dominant(T, np.full(T.size, 7.0)) is None
    assert dominant(T[:6], np.sin(T[:6])) is None


def test_a_moving_string() -> None:
    """Waves go out at c - v and come back at c + v: the period is the sum of both times."""
    tension, density, length = 400.0, 0.1, 0.5
    wave = math.sqrt(tension / density)
    for speed in (0.0, 0.3 * wave, 0.9 * wave):
        one = 1.0 / (length / (wave - speed) + length / (wave + speed))
        assert moving_string(tension, density, length, speed) == pytest.approx(one, rel=1e-12)
        assert moving_string(tension, density, length, -speed) == pytest.approx(one)
    assert moving_string(tension, density, length, 1.1 * wave) == 0.0


def test_what_the_radius_does_is_told_apart_from_creep() -> None:
    """A soft contact, not compensated: the smaller pulley loses radius, and the driven one speed.

    The theory is beltdyn.compliance's, right to a fifth of that part, for friction acts already
    where the belt is still sinking in, further out: that much may be told as friction's.
    """
    contact = bd.Contact(linear=5.2e7, damping=2e3)
    law = bd.ElasticPlastic(mu=0.8, stiffness=1e9, damping=1e4)
    belt = {"preload": 400.0, "axial_stiffness": 60e3}
    params = open_drive((0.04, 0.09), 0.3, (2e-3, 2e-3), contact=contact, friction=law, **belt)
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
