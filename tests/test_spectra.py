"""Spectra: amplitude and frequency of known signals; orders of a crank, lines of the mesh.

No load may be called an artefact: what is put in at a frequency of its own is known to be of the
drive. Pictures: lines are named and marked, legends and labels have room in print.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np
import pytest
from drives import cranked, reduction
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from pictures import SIZED, axes_of, check_room, labels

import beltdyn as bd
from beltdyn import spectra
from beltdyn.outputs.orders import Source, lines_at, sources
from beltdyn.report.span_rows import _of_links

pytestmark = pytest.mark.filterwarnings("ignore:chatter")


def test_a_sine_shows_its_amplitude() -> None:
    """Anywhere between two points of the transform; mean and drift do not matter."""
    t = np.linspace(2.0, 3.0, 2001)
    for frequency in (50.0, 123.37, 123.5, 480.21):
        values = 3.0 * np.sin(2.0 * np.pi * frequency * t + 0.3) + 100.0 + 5.0 * t
        at, amplitude, resolution = spectra.amplitude_spectrum(t, values)
        assert amplitude.max() == pytest.approx(3.0, rel=4e-3)  # 0.3 %, and the line taken off
        assert at[amplitude.argmax()] == pytest.approx(frequency, abs=0.07)  # half a padded point
        assert resolution == pytest.approx(1.5, rel=1e-3)  # noise bandwidth of Hann over 1 s
        assert at[-1] == pytest.approx(1000.0)
    # two lines keep their heights, and flattop its promise
    t = np.linspace(0.0, 1.0, 4001)
    values = 2.0 * np.cos(2 * np.pi * 60.3 * t) + 0.05 * np.cos(2 * np.pi * 400.7 * t)
    at, amplitude, resolution = spectra.amplitude_spectrum(t, values, window="flattop")
    assert amplitude.max() == pytest.approx(2.0, rel=1e-3)
    assert amplitude[at > 300.0].max() == pytest.approx(0.05, rel=1e-3)
    assert resolution == pytest.approx(3.77, rel=1e-2)


def test_folding_is_where_samples_show_it() -> None:
    for true, seen in ((30.0, 30.0), (70.0, 30.0), (130.0, 30.0), (100.0, 0.0)):
        assert float(spectra.folded(true, 100.0)) == pytest.approx(seen)
        t = np.arange(400) / 100.0
        at, amplitude, _ = spectra.amplitude_spectrum(t, np.cos(2.0 * np.pi * true * t + 0.5))
        assert not seen or at[amplitude.argmax()] == pytest.approx(seen, abs=0.05)
    # Its amplitude, and its frequency at the middle of each slice
    t = np.linspace(0.0, 4.0, 8001)
    values = 2.5 * np.sin(2.0 * np.pi * (50.0 * t + 0.5 * 20.0 * t**2))
    times, at, amplitude = spectra.spectrogram(t, values, 0.25)
    np.testing.assert_allclose(at[amplitude.argmax(axis=1)], 50.0 + 20.0 * times, atol=2.5)
    np.testing.assert_allclose(amplitude.max(axis=1), 2.5, rtol=0.08)
    assert times[0] >= 0.125 - 1e-9 and times[-1] <= 3.875 + 1e-3
    with pytest.raises(ValueError, match="window must be from 16 samples"):
        spectra.spectrogram(t, values, 1e-3)


SPEED = 100.0


@pytest.fixture(scope="module")
def coarse() -> bd.Result:
    crank = bd.CrankMotion(SPEED, orders=[2, 4], amplitudes=[4e-3, 1e-3], fade=(0.0, 0.05))
    return bd.simulate(
        cranked(60),
        bd.Load("alternator", viscous=0.05),
        0.6,
        motion={"crank": crank},
        t_eval=np.linspace(0.0, 0.6, 3601),
        outputs=("span_tension", "pulleys", "belt"),
        ledger=False,
    )


@pytest.fixture(scope="module")
def run_up() -> bd.Result:
    """From 40 to 130 rad/s, without places of links."""
    speed = bd.PiecewiseLinear([0.0, 0.05, 1.0], [40.0, 40.0, 130.0])
    return bd.simulate(
        cranked(60),
        bd.Load("alternator", viscous=0.02),
        1.0,
        motion={"crank": bd.CrankMotion(speed, orders=[2], amplitudes=[2e-3])},
        t_eval=np.linspace(0.0, 1.0, 2001),
        outputs=("pulleys", "span_tension"),
        ledger=False,
    )


def thinned(result: bd.Result, step: int, **changed: Any) -> bd.Result:
    """Every so many samples, and other values of the pulleys."""
    few = slice(None, None, step)
    pulleys = {name: a[few] for name, a in result.pulleys.arrays().items()}
    belt = {name: a[few] for name, a in result.belt.arrays().items()}
    return attrs.evolve(
        result,
        t=result.t[few],
        sampled_spans=result.span_tension[few],
        pulleys=attrs.evolve(result.pulleys, **{**pulleys, **changed}),
        belt=type(result.belt)(**belt),
    )


def test_orders_of_the_crank(coarse: bd.Result) -> None:
    """Both orders put in come out by name, on the crank with the heights that were put in."""
    first, second, *_ = spectra.spectrum(coarse, "pulleys.omega", pulley="crank").lines()
    for line, order, amplitude in ((first, 2, 4e-3), (second, 4, 1e-3)):
        frequency = order * SPEED / (2.0 * np.pi)
        assert line.frequency == pytest.approx(frequency, rel=2e-3)
        # d/dt of a cos(order theta_m) is order theta_m' a; the window holds 0.3 s of it
        assert line.amplitude == pytest.approx(amplitude * order * SPEED, rel=1e-2)
        assert line.names[0] == f"crank x{order}"
    tension = spectra.spectrum(coarse, span="crank to alternator").lines()
    assert {"crank x2", "crank x4"} <= {name for line in tension for name in line.names}
    # what fluctuates most is taken
    rows = slice(coarse.t.size // 2, None)
    most = int(np.argmax(coarse.pulleys.omega[rows].std(axis=0)))
    found = spectra.signal(coarse, "pulleys.omega", rows)
    assert found.label == f"pulleys.omega of {('crank', 'alternator')[most]}"
    np.testing.assert_array_equal(found.values, coarse.pulleys.omega[rows, most])
    assert found.unit == "rad/s"
    # spans by number and by name
    for span in (1, "alternator", "alternator to crank"):
        found = spectra.signal(coarse, "span_tension", span=span)
        assert (found.label, found.unit) == ("tension of span alternator to crank", "N")
        np.testing.assert_array_equal(found.values, coarse.span_tension[:, 1])
    # mounts by their pulley
    params, torque, _, motion = bd.scenes.tensioned_alternator(60)
    result = bd.simulate(params, torque, 0.005, motion=motion)
    found = spectra.signal(result, "mounts.travel", mount="tensioner")
    assert (found.label, found.unit) == ("mounts.travel of tensioner", "rad")
    assert spectra.signal(result, "mounts.belt_force", mount=0).unit == "N m"
    with pytest.raises(ValueError, match="crank has none"):
        spectra.signal(result, "mounts.travel", mount="crank")
    # the lines are named
    found = bd.spectra.spectrum(coarse, span="crank")
    ax = bd.plot.spectrum(coarse, span="crank")
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
    ax = bd.plot.spectrum(coarse, span="crank", marks=False, label="as it is")
    bd.plot.spectrum(coarse, span="alternator", marks=False, ax=ax)
    assert labels(ax) == ["as it is", "tension of span alternator to crank"]
    assert len({line.get_color() for line in ax.lines}) == len(ax.lines) == 2


def test_the_belt_passes_as_often_as_its_links_say(coarse: bd.Result) -> None:
    """The rate from speeds against that from counting: how often a link comes to the same place."""
    rate = spectra.belt_rate(coarse)
    late = coarse.t > 0.2
    belt, t = coarse.belt, coarse.t
    passed = [
        t[1:][(belt.x[:-1, k] < 0.15) & (belt.x[1:, k] >= 0.15) & late[1:]]
        for k in range(belt.x.shape[1])
    ]
    period = np.mean([np.diff(times).mean() for times in passed if times.size > 1])
    assert rate[late].mean() == pytest.approx(1.0 / period, rel=1e-3)
    # Every twentieth sample: 300 a second, and the links pass above half of that
    (whole,) = [one for one in spectra.spectrum(coarse, span="crank").sources if one.kind == "link"]
    # v / l0 with the speed of the rim, less creep and sinking of the belt
    length = coarse.params.info["length"]
    assert whole.frequency == pytest.approx(60 * SPEED * 0.08 / length, rel=2e-2)
    lines = spectra.spectrum(coarse, span="crank").lines(12)
    (line,) = [one for one in lines if "link passing x1" in one.names]
    assert line.from_mesh
    assert line.frequency == pytest.approx(60 * rate[coarse.t > 0.3].mean(), rel=2e-3)
    (crank,) = [one for one in lines if "crank x2" in one.names]
    assert not crank.from_mesh
    spectrum = spectra.spectrum(thinned(coarse, 20), span="crank")
    (passing,) = [one for one in spectrum.sources if one.kind == "link"]
    assert spectrum.limit == pytest.approx(150.0) and passing.frequency > spectrum.limit
    at = float(spectra.folded(passing.frequency, 300.0))
    assert any("link passing x1, folded" in name for name in spectrum.names(at))
    (note,) = [note for note in spectrum.notes() if "link passing" in note and "appears" in note]
    assert f"{at:.4g} Hz" in note
    (line,) = [one for one in spectrum.lines(12) if "link passing x1, folded" in one.names]
    assert line.frequency == pytest.approx(at, abs=0.2 * spectrum.resolution + 2e-3 * 474)


def test_bad_choices_are_refused(coarse: bd.Result, run_up: bd.Result) -> None:
    """Of signals, of pictures; too few samples of a run-up are not a steady speed, rounding no
    speed at all.
    """
    t = np.linspace(0.0, 1.0, 101)
    with pytest.raises(ValueError, match="at least 16 samples, got 5"):
        spectra.amplitude_spectrum(t[:5], t[:5])
    with pytest.raises(ValueError, match="NaN"):
        spectra.amplitude_spectrum(t, np.full(101, np.nan))
    t[50] += 1e-3
    with pytest.raises(ValueError, match=r"evenly spaced.*t_eval=np\.linspace"):
        spectra.amplitude_spectrum(t, np.sin(t))
    where: dict[str, object]
    for output, where, error, words in (
        ("pulleys.speed", {}, ValueError, r"output must be one of .*pulleys\.omega"),
        ("energy", {}, ValueError, "output must be one of"),
        ("pulleys.omega", {"span": 0}, TypeError, r"selected by pulley=, not by span="),
        ("pulleys.omega", {"pulley": "fan"}, ValueError, "no pulley is called"),
        ("belt.x", {"link": 60}, ValueError, "link"),
        ("span_tension", {"span": "x"}, ValueError, "no span is called 'x'.*there are crank to a"),
        ("joints.force", {}, AttributeError, r"joints\.force was not asked for"),
        ("mounts.travel", {}, ValueError, "no mounts"),
    ):
        with pytest.raises(error, match=words):
            spectra.signal(coarse, output, **where)
    found = spectra.spectrum(coarse, span=0)
    for count in (-1, 1.5, None):
        with pytest.raises((TypeError, ValueError), match="count must be"):
            found.lines(count)
    assert found.lines(0) == ()
    for options, words in BAD_CAMPBELL:
        with pytest.raises((TypeError, ValueError), match=words):
            bd.plot.campbell(run_up, "pulleys.omega", pulley="crank", **options)
    for options in ({"up_to": -5.0}, {"count": -1}):
        with pytest.raises(ValueError, match=f"{next(iter(options))} must be"):
            bd.plot.spectrum(coarse, span="crank", **options)
    with pytest.raises(ValueError, match=r"needs a run-up.*plot\.spectrum"):
        bd.plot.campbell(coarse, "pulleys.omega", pulley="alternator")
    with pytest.raises(ValueError, match=r"17 samples give .* more samples"):
        bd.plot.campbell(thinned(run_up, 125), "pulleys.omega", pulley="crank")
    noise = 1e-9 * np.random.default_rng(1).normal(size=run_up.pulleys.omega.shape)
    with pytest.raises(ValueError, match='pulley "crank" stands still'):
        bd.plot.campbell(thinned(run_up, 1, omega=noise), span="crank")


def test_campbell_has_orders_and_modes_where_they_are(run_up: bd.Result) -> None:
    """Modes at rest as level lines, those within the picture; the legend names them only if there
    are any.
    """
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
        assert 40.0 * rpm <= x.min() < x.max() <= 130.0 * rpm
    natural = [line for line in ax.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(natural[0].get_xdata(), [70.0 * rpm, 110.0 * rpm])
    assert [list(line.get_ydata()) for line in natural] == [[20.0, 21.0], [30.0, 33.0]]
    assert labels(ax) == ["orders of crank", "belt passing", "natural frequencies"]
    assert ax.get_xlabel() == "speed of crank [rpm]"
    params = run_up.params
    modes = bd.modes(params, bd.settle(params), n=4, motion={"crank": 0.0})
    high = float(modes.frequency[1]) + 1.0
    where: dict[str, Any] = {"pulley": "alternator", "orders": (2,), "modes": modes}
    ax = bd.plot.campbell(run_up, "pulleys.omega", up_to=high, **where)
    heights = [y for line in ax.lines if (y := np.asarray(line.get_ydata())).size]
    drawn = [float(y[0]) for y in heights if np.ptp(y) == 0.0]
    assert drawn == [one for one in modes.frequency if one <= high] and len(drawn) >= 2
    assert "natural frequencies" in labels(ax)
    ax = bd.plot.campbell(run_up, "pulleys.omega", up_to=0.5 * float(modes.frequency[0]), **where)
    assert "natural frequencies" not in labels(ax)
    # a run up shows orders at the speed they have
    found = spectra.speed_spectra(run_up, "pulleys.omega", pulley="crank", over="crank")
    swept = (found.speed > 55.0) & (found.speed < 115.0)
    top = found.frequency[found.amplitude.argmax(axis=1)]
    np.testing.assert_allclose(
        top[swept], 2.0 * found.speed[swept] / (2.0 * np.pi), atol=0.75 * found.resolution
    )
    # without positions of links the belt's rate is that of the rims
    np.testing.assert_allclose(
        found.belt, found.speed * 0.08 / run_up.params.info["length"], rtol=0.03
    )


BAD_CAMPBELL: tuple[tuple[dict[str, Any], str], ...] = (
    ({"up_to": -5.0}, "up_to must be > 0 Hz, got -5"),
    ({"up_to": float("nan")}, "up_to must be finite"),
    ({"orders": (1, -1)}, r"orders\[1\] must be > 0, got -1"),
    ({"orders": ("a",)}, r"orders\[0\] must be a real number"),
    ({"limits": (0.0, 1.0)}, "limits must be .* 0 < low < high"),
    ({"modes": [1, 2]}, r"modes\[0\] must be a bd.Modes or a pair"),
    ({"modes": [(50.0, ["a"])]}, r"modes\[0\]\[1\] must hold real numbers"),
    ({"window": -1.0}, "window must be > 0 s"),
)


@SIZED
def test_all_has_room_on_screen_and_in_print(
    coarse: bd.Result, run_up: bd.Result, size: tuple[float, float, float]
) -> None:
    """No text over another or beyond the figure; in a column of 8.5 cm and a page of 17 cm."""
    # order 8 leaves the Campbell diagram at its top, beneath the title, off the corner
    for draw, result, high in ((bd.plot.spectrum, coarse, None), (bd.plot.campbell, run_up, 110.0)):
        with axes_of(size) as ax:
            draw(result, span="crank", up_to=high, ax=ax)
            check_room(ax.figure)
            assert ax.get_window_extent().width > 0.5 * ax.figure.bbox.width
            assert ax.get_window_extent().height > 0.3 * ax.figure.bbox.height


def test_titles_of_spectra_beside_each_other_keep_apart(coarse: bd.Result) -> None:
    figure = Figure(figsize=(13.0, 4.5), layout="constrained")
    axes = figure.subplots(1, 3)
    for ax in axes:  # a window that holds too few turns has a long title
        bd.plot.spectrum(coarse, span="crank", last=0.05, ax=ax)
    figure.draw_without_rendering()
    titles = [ax.title.get_window_extent() for ax in axes]
    assert titles[0].x0 > 0.0 and titles[-1].x1 < figure.bbox.width
    assert all(left.x1 < right.x0 for left, right in pairwise(titles))


def run(speed: Callable[[np.ndarray], np.ndarray], load: Callable[[float], float]) -> bd.Result:
    t = np.linspace(0.0, 1.0, 4001)
    return bd.simulate(
        reduction(),
        lambda t, _theta, _omega: [0.0, load(t) * min(t / 0.05, 1.0)],
        1.0,
        motion={0: bd.PiecewiseLinear(t, speed(t))},
        t_eval=t[::2],
    )


def steady(t: np.ndarray) -> np.ndarray:
    return -20.0 * np.minimum(t / 0.1, 1.0)


PASSING = 20.0 * 0.06 / reduction().info["link_length"]


def test_links_that_pass_are_told_and_a_short_window_says_may_be() -> None:
    """Of a steady belt; 0.06 s hold 3.6 passings, whose line other lines may lie as near."""
    result = run(steady, lambda _t: 8.0)
    told = result.report(0.5)
    of_links = [row for row in told.spans if row.link_passing]
    assert of_links and "* links that pass" in told.text(full=True)
    rate = bd.spectra.belt_rate(result, result.t > 0.5)
    for row in of_links:
        order = row.frequency / (60.0 * rate.mean())
        assert order == pytest.approx(round(order), rel=5e-3)
    late = result.t > 0.94
    few = sources(result, late)
    passing = next(one.frequency for one in few if one.kind == "link")
    assert _of_links(few, result.t[late], passing) is None
    assert _of_links(few, result.t[late], passing + 10.0) is False
    spectrum = bd.spectra.spectrum(result, last=0.06)
    assert "may be link passing x1" in spectrum.names(passing)
    # 6 Hz beside it
    pulse = PASSING + 6.0
    result = run(steady, lambda t: 8.0 + 6.0 * math.sin(2.0 * math.pi * pulse * t))
    told = result.report()
    for row in told.spans:
        assert row.frequency == pytest.approx(pulse, abs=0.3)
        assert row.amplitude > 200.0
        assert row.link_passing is False
    assert "artefact" not in told.text(full=True)
    line = bd.spectra.spectrum(result).lines(1)[0]
    assert line.frequency == pytest.approx(pulse, abs=0.1) and not line.from_mesh

    # Rocked at 15 and 97 Hz: on an average the belt stands, however fast its links go by
    def rocking(t: np.ndarray) -> np.ndarray:
        both = 8.0 * np.sin(2.0 * np.pi * 15.0 * t) + 3.0 * np.sin(2.0 * np.pi * 97.0 * t)
        return np.asarray(both * np.minimum(t / 0.1, 1.0))

    result = run(rocking, lambda _t: 0.0)
    spectrum = bd.spectra.spectrum(result)
    lines = spectrum.lines(4)
    assert {round(line.frequency) for line in lines} >= {15, 97}
    assert not any(line.from_mesh for line in lines)
    assert any("link passing changes too much" in note for note in spectrum.notes())
    ax = bd.plot.spectrum(result)
    assert "link passing changes too" in ax.get_title().replace("\n", " ")
    assert not [line for line in ax.lines if str(line.get_label()).startswith("link passing")]
    assert not any(row.link_passing for row in result.report().spans)
    standing = run(lambda t: 0.0 * t, lambda t: 3.0 * math.sin(2.0 * math.pi * 113.0 * t))
    lines = bd.spectra.spectrum(standing).lines()
    line = next(one for one in lines if abs(one.frequency - 113.0) < 0.5)
    assert not line.from_mesh and line.names == ()


def test_on_a_run_up_no_line_is_named_after_what_sweeps_over_it() -> None:
    """190 Hz on the pulley while the links pass at 56 to 240 Hz."""
    result = run(
        lambda t: -(20.0 + 60.0 * t) + 0.5 * np.sin(2.0 * np.pi * 190.0 * t), lambda _t: 3.0
    )
    spectrum = bd.spectra.spectrum(result, "pulleys.omega", pulley=0)
    (line, *_) = spectrum.lines()
    assert line.frequency == pytest.approx(190.0, abs=0.1) and line.names == ()
    assert any("link passing changes too much" in note for note in spectrum.notes())
    # links did pass at that rate for a part of the window
    late = result.t >= 0.5
    assert _of_links(sources(result, late), result.t[late], 190.0) is None
    assert _of_links(sources(result, late), result.t[late], 20.0) is False

    # Three times 2813 Hz, sampled at 8333 Hz, appears at 106 Hz: beside an order of 100 Hz
    def source(name: str, kind: str, frequency: float) -> Source:
        kept = (1.0,) * {"link": 4, "pulley": 12}[kind]
        return Source(name=name, kind=kind, frequency=frequency, spread=0, kept=kept, known=5e-4)

    links, crank = source("link passing", "link", 2813.0), source("crank", "pulley", 50.5)
    assert lines_at([links, crank], 102.0, 25.0, 4166.5) == ("crank x2",)
    assert lines_at([links], 102.0, 25.0, 4166.5) == ("may be link passing x3, folded",)
    # as near by an order that is not folded it cannot be told
    both = lines_at([source("link passing", "link", 101.5), crank], 101.2, 25.0, 4166.5)
    assert set(both) == {"crank x2", "may be link passing x1"}

    # A pulley whose speed rises by so many resolutions of 0.75 Hz: its peak is at its mean
    t = np.linspace(0.0, 2.0, 4001)
    for swept in (0.5, 2.0, 4.0, 6.0):
        turns = 30.0 * t + 0.5 * 0.75 * swept * (t - 1.0) ** 2 / 2.0
        omega = 2.0 * np.pi * np.gradient(turns, t)[:, None] * np.ones((1, 2))
        made: Any = SimpleNamespace(
            t=t,
            params=reduction(),
            pulleys=SimpleNamespace(omega=omega),
            _has="pulleys.omega".__eq__,
        )
        one = next(s for s in sources(made, slice(None)) if s.kind == "pulley")
        at, amplitude, resolution = spectra.amplitude_spectrum(t, np.cos(2.0 * np.pi * turns))
        assert one.frequency == pytest.approx(30.0, abs=1e-3)
        assert one.kept[0] == pytest.approx(amplitude[np.argmin(abs(at - 30.0))], abs=0.01)
        named = lines_at([one], float(at[amplitude.argmax()]), resolution, 1000.0)
        assert ("pulley 0 x1" in named) == (one.kept[0] >= 0.7) == (swept < 5.0)
