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


def test_a_mode_is_drawn_at_opposite_phases_and_in_a_film() -> None:
    """Both belts are as far from rest, on opposite sides; the title names the mode."""
    modes = found()
    ax = bd.plot.mode(modes, 2)
    lines = {line.get_label(): line.get_xydata() for line in ax.lines}
    rest, one, other = (lines[name] for name in ("at rest", "one end", "half a period later"))
    assert np.allclose(one - rest, rest - other)
    assert 0.01 < np.hypot(*(one - rest).T).max() / np.ptp(rest[:, 0]) < 0.1
    assert f"{modes.frequency[2]:.4g} Hz" in ax.get_title()
    assert modes.names[2] in ax.get_title()
    ax.figure.draw_without_rendering()
    label, legend = ax.xaxis.label.get_window_extent(), ax.get_legend().get_window_extent()
    assert 0.0 <= legend.y0 < legend.y1 <= label.y0
    film = bd.plot.animate_mode(modes, 1, duration=0.5, fps=10.0)
    assert film.frames == 5
    film._draw_was_started = True  # never shown


def test_response_is_drawn_as_it_is() -> None:
    """Beyond resonance a phase passes 180 degrees; no line joins it to its going on at -180."""
    modes = found()
    sweep = np.geomspace(50.0, 400.0, 100)
    response = bd.frequency_response(modes.params, modes.state, sweep, motion="crank")
    upper, lower = bd.plot.frequency_response(response, "span_tension")
    assert len(bd.plot.frequency_response(response, "span_tension", "crank")[0].lines) == 1
    broken = 0
    for k, (size, line) in enumerate(zip(upper.lines, lower.lines, strict=True)):
        expected = response.span_tension[:, k]
        assert np.allclose(size.get_ydata(), abs(expected))
        x, phase = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        there = np.isfinite(phase)
        np.testing.assert_array_equal(x[there], sweep)
        np.testing.assert_allclose(phase[there], np.degrees(np.angle(expected)))
        assert np.nanmax(np.abs(np.diff(phase))) <= 270.0
        broken += int((~there).sum())
    assert broken > 0
    with pytest.raises(ValueError, match="output"):
        bd.plot.frequency_response(response, "colour")


RESPONSES: tuple[tuple[dict[str, Any], type[Exception], str], ...] = (
    ({"torque": {0: np.nan}}, ValueError, r"torque\[0\] must be finite"),
    ({"torque": {0: "a"}}, TypeError, r"torque\[0\] must be a real or complex number"),
    ({"torque": 0, "params": None}, TypeError, "params must be a Params"),
    ({"torque": 0, "state": None}, TypeError, "state must be a State"),
    ({"torque": 0, "params": reduction(42)}, ValueError, r"state\.x must have shape \(42,\)"),
    ({"torque": 0, "phases": 0}, ValueError, "phases must"),
    ({"torque": 0, "frequencies": [-1.0]}, ValueError, "frequencies"),
    ({"motion": {0: 0.0}}, ValueError, "at least one pulley"),
)
MODES: tuple[tuple[dict[str, Any], type[Exception], str], ...] = (
    ({"n": 1000}, ValueError, "n must be at most 40, the number of links"),
    ({"phases": 0}, ValueError, "phases must"),
    ({"count": 1}, TypeError, "count must"),
    ({"state": None}, TypeError, "state"),
    ({"params": reduction(42)}, ValueError, r"state\.x must have shape \(42,\)"),
)


@pytest.mark.filterwarnings("error")
def test_arguments_are_refused_by_name() -> None:
    params = reduction(40)
    of_drive = {"params": params, "state": bd.settle(params)}
    for given, error, message in RESPONSES:
        with pytest.raises(error, match=message):
            bd.frequency_response(**(of_drive | {"frequencies": [10.0]} | given))
    for given, error, message in MODES:
        with pytest.raises(error, match=message):
            bd.modes(**(of_drive | given))


def test_a_print_says_what_is_held_and_fits_80_columns() -> None:
    """And a state out of balance is told: 10 N m on the alternator at rest, which nothing holds."""
    params, state = found().params, found().state
    held, free = str(found()), str(bd.modes(params, state, n=1))
    assert "prescribed motion: crank" in held and "prescribed motion: none" in free
    assert max(len(line) for line in (held + "\n" + free).splitlines()) <= 80
    many = attrs.evolve(found(), decay=np.arange(1.0, 18.0), decay_names=("rotation",) * 17)
    lines = [line for line in str(many).splitlines() if "not oscillating" in line]
    assert len(lines) == 5 and lines[-1] == "  not oscillating: and 13 more (modes.decay)"
    load = bd.PiecewiseLinear([0.0], [10.0], "alternator")
    with pytest.warns(bd.BeltdynWarning, match="not_in_equilibrium.*alternator"):
        bd.modes(params, state, load, n=1)
