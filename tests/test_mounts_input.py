"""Mounts as they are given: what they cost, what is refused, text and files. Off they cost nothing:
test_off_is_free.py.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import attrs
import mounted_drives as drives
import numpy as np
import pytest

import beltdyn as bd
from beltdyn import _core

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def test_mounts_cost_their_own_numbers_and_no_more() -> None:
    """Of a drive with, less one without: three numbers of state each, and what the ledger has."""
    without, slider, path = (
        bd.simulate(params, drives.torque(params), 1e-4, t_eval=[0.0, 1e-4])
        for params in (drives.take_up(fixed=True), drives.take_up(), drives.path())
    )
    assert without.params.mounted == () and slider.params.mounted == (1,)
    for result, columns in ((slider, {"mount", "mount_loss"}), (path, {"path_work"})):
        assert set(result.energy.arrays()) - set(without.energy.arrays()) == columns
        assert set(without.effects) < set(result.effects)
    assert without.mounts is None or without.mounts.travel.shape == (2, 0)
    assert slider.mounts.travel.shape == (2, 1)
    for name in ("travel", "travel_speed", "mount_friction"):
        value = getattr(without.final_state, name)
        assert value is None or value.size == 0


ARM: dict[str, Any] = {
    "pivot": (0.215, 0.105),
    "inertia": 0.0025,
    "stiffness": 10.0,
    "preload": 6.0,
}
SLIDER: dict[str, Any] = {"direction": (1.0, 0.0), "mass": 1.0, "weight": 24.0}
PATH: dict[str, Any] = {"t": (0.0, 0.1), "displacement": ((0.0, 0.0), (1e-3, 0.0))}
HOLDS_NO_TENSION = r"^pulleys\[1\]\.mount .*(balance|tension)"
#: What is changed, and the message.
BAD: dict[type[Any], tuple[dict[str, Any], list[tuple[dict[str, Any], str]]]] = {
    bd.Arm: (ARM, [
        ({"inertia": 0.0}, "inertia"),
        ({"mass": -1.0}, "mass"),
        ({"stiffness": -1.0}, "stiffness"),
        ({"damping": -0.1}, "damping"),
        ({"friction": -0.1}, "friction"),
        ({"friction": 0.1, "friction_stiffness": -1.0}, "friction_stiffness"),
        ({"free_angle": 0.1}, "preload.*free_angle"),
        ({"stops": (0.1, -0.1)}, "stops|lowest|highest"),
        ({"stops": (-0.1, 0.1), "stop_stiffness": -1.0}, "stop_stiffness"),
        ({"stops": (-0.1, 0.1), "stop_damping": -1.0}, "stop_damping"),
        ({"preload": math.nan}, "preload"),
        ({"pivot": (math.inf, 0.0)}, "pivot"),
        ({"pivot": (0.135, 0.068)}, "pivot"),  # at the axis
        # a spring that pushes the pulley away from the belt, or none at all, against no stop
        ({"preload": -6.0, "stiffness": 0.0}, HOLDS_NO_TENSION),
        ({"preload": None, "stiffness": 0.0}, HOLDS_NO_TENSION),
    ]),
    bd.Slider: (SLIDER, [
        ({"direction": (0.0, 0.0)}, "direction"),
        ({"mass": 0.0}, "mass"),
        ({"weight": -1.0}, "weight"),
        ({"friction": -0.1}, "friction"),
        ({"preload": 1.0, "free_travel": 0.1, "stiffness": 10.0}, "preload.*free_travel"),
        ({"stops": (0.1, 0.1)}, "stops|lowest|highest"),
        ({"direction": (-1.0, 0.0)}, HOLDS_NO_TENSION),
    ]),
    bd.Path: (PATH, [
        ({"displacement": ((1e-3, 0.0), (0.0, 0.0))}, "displacement"),  # does not begin at 0
        ({"t": (0.1, 0.1)}, r"\bt\b"),
        ({"t": (0.1, 0.0)}, r"\bt\b"),
        ({"t": (0.0,), "displacement": ((0.0, 0.0),)}, r"\bt\b|point"),
        ({"displacement": ((0.0, 0.0),)}, "displacement"),
        ({"displacement": ((0.0, 0.0), (math.nan, 0.0))}, "displacement"),
    ]),
}  # fmt: skip


def model_with(mount: Any, **changes: Any) -> _core.Model:
    make = drives.tensioner if isinstance(mount, bd.Arm) else drives.take_up
    return make(mount, **changes)._model


@pytest.mark.parametrize("kind", BAD)
def test_bad_mounts_are_refused(kind: type[Any]) -> None:
    """By a ValueError before anything runs: when the part is made, or the drive with it. So is the
    paper's mesh.
    """
    given, changes = BAD[kind]
    for change, message in changes:
        with pytest.raises(ValueError, match=message):
            model_with(kind(**(given | change)))
            pytest.fail(f"{change} is taken")
    model_with(kind(**given))
    with pytest.raises(ValueError, match=r"mesh|joint"):
        model_with(kind(**given), belt_changes={"mesh": "paper"})
    with pytest.raises(TypeError, match="mount"):
        bd.Pulley(center=(0, 0), radius=0.1, inertia=0.01, mount=3.0)


def test_states_of_other_mounts_are_refused() -> None:
    """Of another number of them; and friction of the pivot beyond either of its bounds."""
    for params, bad in (
        *((drives.take_up(), {name: [0.0, 0.0]})
          for name in ("travel", "travel_speed", "mount_friction")),
        (drives.tensioner(), {"mount_friction": [1.01]}),
        (drives.tensioner(), {"mount_friction": [-1.01]}),
    ):  # fmt: skip
        start = bd.settle(params)
        with pytest.raises(ValueError, match=next(iter(bad))):
            wrong = attrs.evolve(start, **bad)
            bd.simulate(params, drives.torque(params), 1e-4, initial=wrong)


def test_text_toml_and_files(tmp_path: Path) -> None:
    params = drives.both()
    assert bd.Params.from_toml(params.to_toml()) == params
    assert "mount" in str(params)
    result = bd.simulate(params, drives.torque(params), 1e-3, t_eval=[0.0, 1e-3])
    result.save(tmp_path / "run.npz")
    again = bd.Result.load(tmp_path / "run.npz")
    assert again.params == params
    assert np.array_equal(again.mounts.travel, result.mounts.travel)
    assert np.array_equal(again.final_state.travel, result.final_state.travel)
    on = bd.simulate(params, drives.torque(params), 2e-3, initial=again.final_state)
    assert on.success
