"""Pictures of spectra: lines are named and marked, legends and labels have room in print."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import matplotlib
import numpy as np
import pytest
from drives import cranked
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from pictures import SIZES, check_room

import beltdyn as bd

CRANK = {
    "steady": bd.CrankMotion(90.0, orders=[2], amplitudes=[3e-3]),
    "run up": bd.CrankMotion(
        bd.PiecewiseLinear([0.0, 0.3], [60.0, 120.0]), orders=[2], amplitudes=[2e-3]
    ),
}


def run(kind: str) -> bd.Result:
    return bd.simulate(
        cranked(),
        bd.Load("alternator", viscous=0.03),
        0.3,
        motion={"crank": CRANK[kind]},
        t_eval=np.linspace(0.0, 0.3, 1801),
        outputs=("span_tension", "pulleys", "belt"),
        ledger=False,
    )


@pytest.fixture(scope="module")
def steady() -> bd.Result:
    return run("steady")


@pytest.fixture(scope="module")
def run_up() -> bd.Result:
    return run("run up")


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


def test_without_marks_and_compared(steady: bd.Result) -> None:
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


def test_a_steady_run_has_no_campbell_diagram(steady: bd.Result) -> None:
    with pytest.raises(ValueError, match=r"needs a run-up.*plot\.spectrum"):
        bd.plot.campbell(steady, "pulleys.omega", pulley="alternator")


@pytest.mark.parametrize(
    ("options", "words"),
    [
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
    ],
)
def test_arguments_of_a_campbell_diagram_are_checked(
    run_up: bd.Result, options: dict[str, Any], words: str
) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        bd.plot.campbell(run_up, "pulleys.omega", pulley="crank", **options)


@pytest.mark.parametrize("options", [{"up_to": -5.0}, {"up_to": float("nan")}, {"count": -1}])
def test_arguments_of_a_spectrum_are_checked(steady: bd.Result, options: dict[str, Any]) -> None:
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


def test_why_there_is_no_campbell_diagram(run_up: bd.Result) -> None:
    """Too few samples of a run-up are not a steady speed, rounding no speed at all."""
    few = thinned(run_up, 110)
    assert few.t.size == 17
    with pytest.raises(ValueError, match=r"17 samples give .* more samples"):
        bd.plot.campbell(few, "pulleys.omega", pulley="crank")
    noise = 1e-9 * np.random.default_rng(1).normal(size=run_up.pulleys.omega.shape)
    with pytest.raises(ValueError, match='pulley "crank" stands still'):
        bd.plot.campbell(thinned(run_up, 1, omega=noise), span="crank")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("draw", [bd.plot.spectrum, bd.plot.campbell])
def test_all_has_room_on_screen_and_in_print(
    steady: bd.Result,
    run_up: bd.Result,
    draw: Callable[..., Axes],
    size: tuple[float, float, float],
) -> None:
    """No text over another or beyond the figure; in a column of 8.5 cm and a page of 17 cm."""
    width, height, points = size
    kinds: Any = {bd.plot.spectrum: steady, bd.plot.campbell: run_up}
    with matplotlib.rc_context({"font.size": points}):
        figure = Figure(figsize=(width, height), layout="constrained")
        ax = figure.add_subplot()
        # order 8 leaves the Campbell diagram at its top, beneath the title
        high = 60.0 if draw is bd.plot.campbell else None
        draw(kinds[draw], span="crank", up_to=high, ax=ax)
        check_room(figure)
        assert ax.get_window_extent().width > 0.5 * figure.bbox.width
        assert ax.get_window_extent().height > 0.3 * figure.bbox.height
