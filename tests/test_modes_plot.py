"""Pictures of modes: what they draw is what the modes hold; text and legends do not overlap."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@cache
def found() -> bd.Modes:
    params = bd.scenes.tensioned_alternator(48).params
    return bd.modes(params, bd.settle(params), n=3, motion={"crank": 0.0})


def test_mode_is_drawn_at_opposite_phases() -> None:
    """Both belts are as far from rest, on opposite sides; the title names the mode."""
    modes = found()
    ax = bd.plot.mode(modes, 2)
    rest, one, other = (
        line.get_xydata()
        for name in ("at rest", "one end", "half a period later")
        for line in ax.lines
        if line.get_label() == name
    )
    assert np.allclose(one - rest, rest - other)
    largest = np.hypot(*(one - rest).T).max()
    assert 0.01 < largest / np.ptp(rest[:, 0]) < 0.1
    assert f"{modes.frequency[2]:.4g} Hz" in ax.get_title()
    assert modes.names[2] in ax.get_title()


def test_legend_lies_below_the_label_and_a_film_runs_through_a_period() -> None:
    ax = bd.plot.mode(found(), 0)
    ax.figure.draw_without_rendering()
    label, legend = ax.xaxis.label.get_window_extent(), ax.get_legend().get_window_extent()
    assert legend.y1 <= label.y0
    assert legend.y0 >= 0.0
    film = bd.plot.animate_mode(found(), 1, duration=0.5, fps=10.0)
    assert film.frames == 5
    film._draw_was_started = True  # never shown


def test_response_is_drawn_as_it_is() -> None:
    modes = found()
    response = bd.frequency_response(modes.params, modes.state, [10.0, 20.0, 40.0], motion="crank")
    upper, lower = bd.plot.frequency_response(response, "span_tension", "crank")
    assert np.allclose(upper.lines[0].get_ydata(), abs(response.span_tension[:, 0]))
    assert np.allclose(
        lower.lines[0].get_ydata(), np.degrees(np.angle(response.span_tension[:, 0]))
    )
    with pytest.raises(ValueError, match="output"):
        bd.plot.frequency_response(response, "colour")


def test_a_phase_that_goes_round_leaves_a_gap() -> None:
    """Beyond resonance a phase passes 180 degrees; no line joins it to its going on at -180."""
    modes = found()
    sweep = np.geomspace(2.0, 400.0, 400)
    response = bd.frequency_response(modes.params, modes.state, sweep, motion="crank")
    _, lower = bd.plot.frequency_response(response, "span_tension")
    broken = 0
    for k, line in enumerate(lower.lines):
        x, phase = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        there = np.isfinite(phase)
        np.testing.assert_array_equal(x[there], sweep)
        np.testing.assert_allclose(phase[there], np.degrees(np.angle(response.span_tension[:, k])))
        assert np.nanmax(np.abs(np.diff(phase))) <= 270.0
        broken += int((~there).sum())
    assert broken > 0
