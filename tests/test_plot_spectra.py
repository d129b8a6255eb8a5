"""Pictures of spectra: lines are named and marked, legends and labels have room in print."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
import pytest
from drives import cranked
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from pictures import SIZED, axes_of, check_room

import beltdyn as bd


def run(motion: bd.CrankMotion) -> bd.Result:
    return bd.simulate(
        cranked(),
        bd.Load("alternator", viscous=0.03),
        0.3,
        motion={"crank": motion},
        t_eval=np.linspace(0.0, 0.3, 1801),
        outputs=("span_tension", "pulleys", "belt"),
        ledger=False,
    )


@pytest.fixture(scope="module")
def steady() -> bd.Result:
    return run(bd.CrankMotion(90.0, orders=[2], amplitudes=[3e-3]))


@pytest.fixture(scope="module")
def run_up() -> bd.Result:
    speed = bd.PiecewiseLinear([0.0, 0.3], [60.0, 120.0])
    return run(bd.CrankMotion(speed, orders=[2], amplitudes=[2e-3]))


def labels(ax: Axes) -> list[str]:
    legend = ax.get_legend()
    return [text.get_text() for text in legend.get_texts()]


def test_the_lines_are_named(steady: bd.Result) -> None:
    found = bd.spectra.spectrum(steady, span="crank")
    ax = bd.plot.spectrum(steady, span="crank")
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), found.amplitude)
    words = labels(ax)
    assert words[0] == "tension of span crank to alternator"
    assert any(word.startswith("link passing, ") and "the mesh" in word for word in words)
    for line in found.lines(4):
        (word,) = [one for one in words if one.startswith(f"{line.frequency:.4g} Hz, ")]
        assert all(name in word for name in line.names[:2])
    assert any(word.endswith("crank x2") for word in words)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("frequency [Hz]", "amplitude [N]")
    (passing,) = [one for one in found.sources if one.kind == "link"]
    dotted = [line for line in ax.lines if str(line.get_label()).startswith("link passing")]
    assert dotted[0].get_xdata()[0] == pytest.approx(passing.frequency)
    ax = bd.plot.spectrum(steady, span="crank", marks=False, label="as it is")
    bd.plot.spectrum(steady, span="alternator", marks=False, ax=ax)
    assert labels(ax) == ["as it is", "tension of span alternator to crank"]
    assert len({line.get_color() for line in ax.lines}) == len(ax.lines) == 2


def test_campbell_has_orders_where_they_are(run_up: bd.Result) -> None:
    ax = bd.plot.campbell(
        run_up,
        "pulleys.omega",
        pulley="crank",
        orders=(1, 2),
        up_to=60.0,
        modes=[(70.0, [20.0, 30.0]), (110.0, [21.0, 33.0])],
    )
    (mesh,) = [one for one in ax.collections if isinstance(one, QuadMesh)]
    assert mesh.norm.vmax == pytest.approx(10.0**2 * mesh.norm.vmin)
    rpm = 60.0 / (2.0 * np.pi)
    for line, order in zip(ax.lines, (1, 2), strict=False):
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        np.testing.assert_allclose(y, order * x / 60.0)
        assert 60.0 * rpm <= x.min() < x.max() <= 120.0 * rpm
    natural = [line for line in ax.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(natural[0].get_xdata(), [70.0 * rpm, 110.0 * rpm])
    assert [list(line.get_ydata()) for line in natural] == [[20.0, 21.0], [30.0, 33.0]]
    assert labels(ax) == ["orders of crank", "belt passing", "natural frequencies"]
    assert ax.get_xlabel() == "speed of crank [rpm]"


def test_campbell_draws_modes_at_rest_as_level_lines(run_up: bd.Result) -> None:
    """Those within the picture; the legend names them only if there are any."""
    params = run_up.params
    modes = bd.modes(params, bd.settle(params), n=4, motion={"crank": 0.0})
    high = float(modes.frequency[1]) + 1.0
    where: dict[str, Any] = {"pulley": "alternator", "orders": (2,), "modes": modes}
    ax = bd.plot.campbell(run_up, "pulleys.omega", up_to=high, **where)
    level = [line for line in ax.lines if np.ptp(np.asarray(line.get_ydata())) == 0.0]
    drawn = [float(np.asarray(line.get_ydata())[0]) for line in level]
    assert drawn == [one for one in modes.frequency if one <= high] and len(drawn) >= 2
    assert "natural frequencies" in labels(ax)
    ax = bd.plot.campbell(run_up, "pulleys.omega", up_to=0.5 * float(modes.frequency[0]), **where)
    assert "natural frequencies" not in labels(ax)


BAD_CAMPBELL: tuple[tuple[dict[str, Any], str], ...] = (
    ({"up_to": -5.0}, "up_to must be > 0 Hz, got -5"),
    ({"up_to": float("nan")}, "up_to must be finite"),
    ({"orders": (1, -1)}, r"orders\[1\] must be > 0, got -1"),
    ({"orders": ("a",)}, r"orders\[0\] must be a real number"),
    ({"limits": (0.0, 1.0)}, "limits must be .* 0 < low < high"),
    ({"limits": (10.0, 1.0)}, "limits must be .* 0 < low < high"),
    ({"limits": 1.0}, "limits must be a pair"),
    ({"modes": [1, 2]}, r"modes\[0\] must be a bd.Modes or a pair"),
    ({"modes": [(50.0, ["a"])]}, r"modes\[0\]\[1\] must hold real numbers"),
    ({"window": -1.0}, "window must be > 0 s"),
)


def test_arguments_are_checked(steady: bd.Result, run_up: bd.Result) -> None:
    for options, words in BAD_CAMPBELL:
        with pytest.raises((TypeError, ValueError), match=words):
            bd.plot.campbell(run_up, "pulleys.omega", pulley="crank", **options)
    for options in ({"up_to": -5.0}, {"up_to": float("nan")}, {"count": -1}):
        with pytest.raises(ValueError, match=f"{next(iter(options))} must be"):
            bd.plot.spectrum(steady, span="crank", **options)


def thinned(result: bd.Result, step: int, **changed: Any) -> bd.Result:
    few = slice(None, None, step)
    pulleys = {name: array[few] for name, array in result.pulleys.arrays().items()}
    belt = {name: array[few] for name, array in result.belt.arrays().items()}
    return attrs.evolve(
        result,
        t=result.t[few],
        pulleys=attrs.evolve(result.pulleys, **(pulleys | changed)),
        belt=attrs.evolve(result.belt, **belt),
        sampled_spans=result.span_tension[few],
    )


def test_why_there_is_no_campbell_diagram(steady: bd.Result, run_up: bd.Result) -> None:
    """Too few samples of a run-up are not a steady speed, rounding no speed at all."""
    with pytest.raises(ValueError, match=r"needs a run-up.*plot\.spectrum"):
        bd.plot.campbell(steady, "pulleys.omega", pulley="alternator")
    few = thinned(run_up, 110)
    assert few.t.size == 17
    with pytest.raises(ValueError, match=r"17 samples give .* more samples"):
        bd.plot.campbell(few, "pulleys.omega", pulley="crank")
    noise = 1e-9 * np.random.default_rng(1).normal(size=run_up.pulleys.omega.shape)
    with pytest.raises(ValueError, match='pulley "crank" stands still'):
        bd.plot.campbell(thinned(run_up, 1, omega=noise), span="crank")


@SIZED
def test_all_has_room_on_screen_and_in_print(
    steady: bd.Result, run_up: bd.Result, size: tuple[float, float, float]
) -> None:
    """No text over another or beyond the figure; in a column of 8.5 cm and a page of 17 cm."""
    # order 8 leaves the Campbell diagram at its top, beneath the title
    for draw, result, high in (
        (bd.plot.spectrum, steady, None),
        (bd.plot.campbell, run_up, 60.0),
    ):
        with axes_of(size) as ax:
            draw(result, span="crank", up_to=high, ax=ax)
            check_room(ax.figure)
            assert ax.get_window_extent().width > 0.5 * ax.figure.bbox.width
            assert ax.get_window_extent().height > 0.3 * ax.figure.bbox.height
