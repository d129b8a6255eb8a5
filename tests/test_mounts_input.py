"""Mounts that are refused, and states of others. What they cost: test_off_is_free.py; the rules of
single numbers: test_params.py; text and files: test_drive_table.py.
"""

from __future__ import annotations

import math
import re
from typing import Any

import attrs
import mounted_drives as drives
import numpy as np
import pytest

import beltdyn as bd
from beltdyn import _core

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


HOLDS_NO_TENSION = r"^pulleys\[1\]\.mount .*(balance|tension)"
#: Of each kind one that is taken; what is changed, and the message.
BAD: dict[type[Any], tuple[dict[str, Any], list[tuple[dict[str, Any], str]]]] = {
    bd.Arm: ({"pivot": (0.215, 0.105), "inertia": 0.0025, "stiffness": 10.0, "preload": 6.0}, [
        ({"friction": 0.1, "friction_stiffness": -1.0}, "friction_stiffness"),
        ({"free_angle": 0.1}, "preload.*free_angle"),
        ({"tension": 100.0}, r"arm\.tension and arm\.preload are both given"),
        ({"preload": None, "tension": -1.0}, r"arm\.tension must be > 0"),
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
    bd.Slider: ({"direction": (1.0, 0.0), "mass": 1.0, "weight": 24.0}, [
        ({"direction": (0.0, 0.0)}, "direction"),
        ({"weight": -1.0}, "weight"),
        ({"preload": 1.0, "free_travel": 0.1, "stiffness": 10.0}, "preload.*free_travel"),
        ({"tension": 9.0, "free_travel": 0.1, "stiffness": 10.0}, "slider.tension.*free_travel"),
        ({"tension": 9.0, "direction": (0.0, 1.0), "weight": 0.0}, "holds no tension in its place"),
        ({"stops": (0.1, 0.1)}, "stops|lowest|highest"),
        ({"direction": (-1.0, 0.0)}, HOLDS_NO_TENSION),
    ]),
    bd.Path: ({"t": (0.0, 0.1), "displacement": ((0.0, 0.0), (1e-3, 0.0))}, [
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


def test_a_spring_too_strong_for_the_layout_is_named() -> None:
    """By its pulley, with the travel, its unit, and all of the reason why the belt has no line
    there.
    """
    spring = bd.Slider(direction=(0.0, 1.0), mass=0.2, stiffness=100.0, preload=5000.0)
    places = [((0.0, 0.0), 0.05, None), ((0.15, -0.12), 0.04, spring), ((0.3, 0.0), 0.08, None)]
    pulleys = [bd.Pulley(center=c, radius=r, inertia=2e-3, mount=m) for c, r, m in places]
    pulleys[1] = attrs.evolve(pulleys[1], name="tensioner")
    belt = bd.Belt(length=0.95, n_bodies=60, linear_density=0.1, axial_stiffness=5e4)
    message = r"travel of 0\.\d+ m the belt has no line .* or crosses itself\); another preload"
    with pytest.raises(ValueError, match=rf'^the mount of pulley "tensioner" .*{message}'):
        bd.Params(belt=belt, pulleys=pulleys)


def test_a_path_says_where_its_spline_goes_beyond_its_points() -> None:
    """Of a jump by many times itself; of points that go evenly not at all."""
    for t, far in ((0.0101, True), (0.02, False)):
        way = ((0.0, 0.0), (0.0, 0.0), (1e-3, 0.0), (1e-3, 0.0))
        way = way if far else ((0.0, 0.0), (3e-4, 0.0), (7e-4, 0.0), (1e-3, 0.0))
        params = drives.take_up(bd.Path(t=(0.0, 0.01, t, t + 0.01), displacement=way))
        times = np.linspace(0.0, t + 0.01, 20001)
        beyond = np.ptp([params.centers([one])[1, 0] for one in times]) - 1e-3
        found = re.search(r"spline ranges (\S+) mm further than its points", str(params))
        assert (found is not None) is far
        if found:
            assert float(found[1]) == pytest.approx(1e3 * beyond, rel=0.1)  # at 8 places a piece


def test_forces_of_springs_weights_and_stops() -> None:
    """By their formulas, at travels between stops and beyond; of a path none."""
    slider = bd.Slider(
        direction=(1.0, 0.0), mass=1.0, weight=24.0, stiffness=2e3, preload=30.0,
        stops=(-0.01, 0.02), stop_stiffness=1e6,
    )  # fmt: skip
    model = model_with(slider)
    for travel, stop in ((0.005, 0.0), (-0.012, 2e3), (0.021, -1e3)):
        force = 30.0 + 9.80665 * 24.0 - 2e3 * travel + stop
        assert model.mount_forces([travel]) == pytest.approx([force], rel=1e-12)
    path = bd.Path(t=(0.0, 0.1), displacement=((0.0, 0.0), (1e-3, 0.0)))
    assert model_with(path).mount_forces([0.05]).tolist() == [0.0]
    with pytest.raises(ValueError, match=r"travel must have shape \(1,\), got \(2,\)"):
        model.mount_forces([0.0, 0.0])
