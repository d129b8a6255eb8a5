"""Lines that links make, and lines that they do not: no load may be called an artefact.

A line of the drive beside the link passing, a belt that rocks, a run-up, a standing drive: what is
put in at a frequency of its own is known to be of the drive, so no name of the mesh may be there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from drives import reduction

import beltdyn as bd
from beltdyn.report.spans import _of_links
from beltdyn.spectra.sources import Source, lines_at, sources

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


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
    assert of_links and "* links that pass" in str(told)
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
    assert "artefact" not in str(told)
    line = bd.spectra.spectrum(result).lines(1)[0]
    assert line.frequency == pytest.approx(pulse, abs=0.1) and not line.from_mesh


def test_a_belt_that_rocks_or_stands_has_no_link_passing() -> None:
    """Rocked at 15 and 97 Hz: on an average the belt stands, however fast its links go by."""

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
