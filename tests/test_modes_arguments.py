"""What is no argument is refused by name, and what is printed stays short."""

from __future__ import annotations

from functools import cache
from typing import Any

import attrs
import numpy as np
import pytest
from drives import reduction

import beltdyn as bd


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
    ({"torque": 0, "frequency": [-1.0]}, ValueError, "frequencies"),
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
    for given, error, message in RESPONSES:
        one = dict(zip(("params", "state"), drive(), strict=True)) | {"frequency": [10.0]} | given
        with pytest.raises(error, match=message):
            bd.frequency_response(*map(one.pop, ("params", "state", "frequency")), **one)
    for given, error, message in MODES:
        one = dict(zip(("params", "state"), drive(), strict=True)) | given
        with pytest.raises(error, match=message):
            bd.modes(one.pop("params"), one.pop("state"), **one)


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
