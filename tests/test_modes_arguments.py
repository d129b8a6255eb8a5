"""What is no argument is refused by name, and what is printed stays short."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
import pytest
from drives import reduction

import beltdyn as bd

PARAMS = reduction(40)
STATE = bd.settle(PARAMS)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"torque": {0: np.nan}}, ValueError, r"torque\[0\] must be finite"),
        ({"motion": {0: np.inf}}, ValueError, r"motion\[0\] must be finite"),
        ({"torque": {0: "a"}}, TypeError, r"torque\[0\] must be a real or complex number"),
        ({"torque": 0, "params": None}, TypeError, "params must be a Params"),
        ({"torque": 0, "state": None}, TypeError, "state must be a State"),
        ({"torque": 0, "params": reduction(42)}, ValueError, r"state\.x must have shape \(42,\)"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_responses(given: dict[str, Any], error: type[Exception], message: str) -> None:
    one = {"params": PARAMS, "state": STATE} | given
    with pytest.raises(error, match=message):
        bd.frequency_response(one.pop("params"), one.pop("state"), [10.0], **one)


def test_modes_beyond_the_mesh() -> None:
    with pytest.raises(ValueError, match="n must be at most 40, the number of links"):
        bd.modes(PARAMS, STATE, n=1000)
    with pytest.raises(ValueError, match=r"state\.x must have shape \(42,\)"):
        bd.modes(reduction(42), STATE)


def test_decays_are_printed_in_four_lines() -> None:
    modes = bd.modes(PARAMS, STATE, n=1)
    many = attrs.evolve(modes, decay=np.arange(1.0, 18.0), decay_names=("rotation",) * 17)
    lines = [line for line in str(many).splitlines() if "not oscillating" in line]
    assert len(lines) == 5
    assert lines[-1] == "  not oscillating: and 13 more (modes.decay)"


def test_a_print_says_what_is_held_and_fits_80_columns() -> None:
    scene = bd.scenes.tensioned_alternator(60)
    state = bd.settle(scene.params)
    held = str(bd.modes(scene.params, state, n=3, motion={"crank": 0.0}))
    free = str(bd.modes(scene.params, state, n=3))
    assert "prescribed motion: crank" in held and "prescribed motion: none" in free
    assert max(len(line) for line in (held + "\n" + free).splitlines()) <= 80
