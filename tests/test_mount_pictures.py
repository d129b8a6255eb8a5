"""Mounts in the layout, in the picture of a drive and over time."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from drives import pressing
from matplotlib.axes import Axes
from matplotlib.patches import Circle

import beltdyn as bd

PIVOT = (0.3, -0.05)


@pytest.fixture(scope="module")
def result() -> bd.Result:
    """A back-side idler on an arm and a pulley on a slider, which a step of torque moves."""
    slider = bd.Slider(direction=(2.0, 0.0), mass=1.0, weight=2.0, stiffness=1e5)
    arm = {"pivot": PIVOT, "inertia": 3e-3, "stiffness": 30.0, "preload": -18.0, "damping": 0.2}
    belt = {"n_bodies": 100, "linear_density": 0.1, "axial_stiffness": 70e3, "axial_damping": 1.4}
    params = bd.Params(
        belt=bd.Belt(length=1.262, **belt),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
            bd.Pulley(name="pump", center=(0.4, 0.05), radius=0.06, inertia=0.004, mount=slider),
            pressing((0.2, 0.0), **arm),
        ],
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )
    torque = bd.PiecewiseLinear([0.0, 0.005], [[0, 0, 0], [-20, 0, 0]])
    return bd.simulate(params, torque, t_end=0.02, t_eval=np.linspace(0.0, 0.02, 21))


def test_layout_and_picture_show_pulleys_where_they_are(result: bd.Result) -> None:
    """At rest, as drawn, at any time."""

    def circles(ax: Axes) -> list[np.ndarray]:
        return [np.array(p.center) for p in ax.patches if isinstance(p, Circle)]

    pulleys, rest = result.params.pulleys, result.params.centers()
    ax = bd.plot.layout(result.params)
    np.testing.assert_allclose(circles(ax), rest, atol=1e-15)
    assert np.abs(rest - [p.center for p in pulleys]).max() > 1e-4
    arms = [np.array(line.get_xydata()) for line in ax.lines]
    assert any(a.shape == (2, 2) and np.allclose(a, [PIVOT, rest[2]]) for a in arms)
    np.testing.assert_array_equal(circles(bd.plot.layout(pulleys)), [p.center for p in pulleys])
    for t in (0.0, 0.02):
        row = int(np.searchsorted(result.t, t))
        ax = bd.plot.drive(result, t=t)
        expected = result.params.centers(result.mounts.travel[row])
        np.testing.assert_allclose(circles(ax), expected, atol=1e-15)
        titles = {text.get_text(): text.get_position() for text in ax.texts}
        np.testing.assert_allclose(titles["tensioner"], expected[2], atol=1e-15)
    moved = np.ptp(result.mounts.travel, axis=0)
    assert (moved > 1e-4).all()  # so that the two pictures differ


def test_travel_over_time(result: bd.Result) -> None:
    ax = bd.plot.travel(result)
    pump, idler = (np.array(line.get_ydata(), dtype=float) for line in ax.lines)
    way = result.mounts.travel
    np.testing.assert_allclose(pump, 1e3 * way[:, 0], atol=1e-12)
    np.testing.assert_allclose(idler, np.degrees(way[:, 1]), atol=1e-12)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["pump [mm]", "tensioner [deg]"]
    fixed = attrs.evolve(result, mounts=None)
    with pytest.raises(ValueError, match="no pulley of this drive is on an arm or a slider"):
        bd.plot.travel(fixed)
