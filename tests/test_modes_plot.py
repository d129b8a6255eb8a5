"""Pictures of modes: what they draw is what the modes hold; text and legends do not overlap.

What is no argument is refused by name, and what is printed stays short.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import attrs
import numpy as np
import pytest
from drives import reduction

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


@pytest.mark.ci(guard="test_modes_plot.py::test_response_is_drawn_as_it_is")
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


@cache
def drive() -> tuple[bd.Params, bd.State]:
    params = reduction(40)
    return params, bd.settle(params)


RESPONSES: tuple[tuple[dict[str, Any], type[Exception], str], ...] = (
    ({"torque": {0: np.nan}}, ValueError, r"torque\[0\] must be finite"),
    ({"motion": {0: np.inf}}, ValueError, r"motion\[0\] must be finite"),
    ({"torque": {0: "a"}}, TypeError, r"torque\[0\] must be a real or complex number"),
    ({"torque": 0, "params": None}, TypeError, "params must be a Params"),
    ({"torque": 0, "state": None}, TypeError, "state must be a State"),
    ({"torque": 0, "params": reduction(42)}, ValueError, r"state\.x must have shape \(42,\)"),
    ({"torque": 0, "phases": 0}, ValueError, "phases must"),
    ({"torque": 0, "frequencies": [-1.0]}, ValueError, "frequencies"),
    ({"motion": {0: 0.0}}, ValueError, "at least one pulley"),
)
MODES: tuple[tuple[dict[str, Any], type[Exception], str], ...] = (
    ({"n": 0}, ValueError, "n must"),
    ({"n": 1000}, ValueError, "n must be at most 40, the number of links"),
    ({"phases": 0}, ValueError, "phases must"),
    ({"count": 1}, TypeError, "count must"),
    ({"state": None}, TypeError, "state"),
    ({"params": reduction(42)}, ValueError, r"state\.x must have shape \(42,\)"),
)


@pytest.mark.filterwarnings("error")
def test_arguments_are_refused_by_name() -> None:
    of_drive = dict(zip(("params", "state"), drive(), strict=True))
    for given, error, message in RESPONSES:
        with pytest.raises(error, match=message):
            bd.frequency_response(**(of_drive | {"frequencies": [10.0]} | given))
    for given, error, message in MODES:
        with pytest.raises(error, match=message):
            bd.modes(**(of_drive | given))


def test_decays_are_printed_in_four_lines() -> None:
    modes = bd.modes(*drive(), n=1)
    many = attrs.evolve(modes, decay=np.arange(1.0, 18.0), decay_names=("rotation",) * 17)
    lines = [line for line in str(many).splitlines() if "not oscillating" in line]
    assert len(lines) == 5
    assert lines[-1] == "  not oscillating: and 13 more (modes.decay)"


def test_a_print_says_what_is_held_and_fits_80_columns() -> None:
    """And a state out of balance is told: 10 N m on the alternator at rest, which nothing holds."""
    params = bd.scenes.tensioned_alternator(60).params
    state = bd.settle(params)
    held = str(bd.modes(params, state, n=3, motion={"crank": 0.0}))
    free = str(bd.modes(params, state, n=3))
    assert "prescribed motion: crank" in held and "prescribed motion: none" in free
    assert max(len(line) for line in (held + "\n" + free).splitlines()) <= 80
    load = bd.PiecewiseLinear([0.0], [10.0], "alternator")
    with pytest.warns(bd.BeltdynWarning, match="not_in_equilibrium.*alternator"):
        bd.modes(params, state, load, n=1)
