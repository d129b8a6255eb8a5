"""Mounts as they are given: what is refused, text and files; nothing of them when they are off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import attrs
import mounted_drives as drives
import numpy as np
import pytest
from module_common import INF, TORQUE, make_model, same_bits

import beltdyn as bd
from beltdyn import _core

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

# -------------------------------------------------------------------- off costs nothing

LEDGER = ("kinetic", "axial", "bending", "contact", "gravity", "drive", "joint_loss",
          "contact_loss", "friction_loss", "residual", "passed")  # fmt: skip


def counters(model: _core.Model) -> dict[str, Any]:
    settling = _core.Simulation.settle(model, tolerance=1e-5)
    assert settling.advance(INF) is True
    sim = _core.Simulation(model, settling.state(), TORQUE, 0.02, method="rodas4")
    arrays = sim.sample(np.linspace(0.0, 0.02, 9))
    sim.advance(0.0)
    record = sim.export_record()
    assert sim.advance(INF) is True
    sizes = {name: np.size(value) for name, value in sim.state().items()}
    return {"passes": sim.passes, "settling": settling.passes, "energy": model.energy_terms,
            "arrays": arrays, "record": record, "sizes": sizes}  # fmt: skip


def test_off_costs_nothing() -> None:
    """No pass, no output, no column, no number in state and record, whatever the table has."""
    found = counters(make_model(mesh="joint"))
    for name in ("travel", "travel_speed", "mount_friction"):
        assert found["sizes"].get(name, 0) == 0
    assert not [one for one in (*found["passes"], *found["settling"]) if "mount" in one]
    assert not {"mount", "mount_loss", "path_work"} & set(found["energy"])
    assert set(found["energy"]) <= set(LEDGER)
    for name in ("travel", "travel_speed", "spring_force", "damper_force", "friction_force",
                 "stop_force", "belt_force"):  # fmt: skip
        assert name not in found["arrays"] or found["arrays"][name].size == 0
    again = counters(make_model(mesh="joint"))
    assert again["record"] == found["record"] and same_bits(again["arrays"], found["arrays"])


def test_mounts_cost_their_own_numbers_and_no_more() -> None:
    """Of a drive with, less one without: three numbers of state each, and what the ledger has."""
    results = {}
    for name, params in {"none": drives.take_up(fixed=True), "slider": drives.take_up(),
                         "path": drives.path()}.items():  # fmt: skip
        times = [0.0, 1e-4]
        results[name] = bd.simulate(params, drives.torque(params), 1e-4, t_eval=times)
    without = results["none"]
    assert without.params.mounted == () and results["slider"].params.mounted == (1,)
    for name, columns in {"slider": {"mount", "mount_loss"}, "path": {"path_work"}}.items():
        new = set(results[name].energy.arrays()) - set(without.energy.arrays())
        assert new == columns
        assert set(without.effects) < set(results[name].effects)
    assert without.mounts is None or without.mounts.travel.shape == (2, 0)
    assert results["slider"].mounts.travel.shape == (2, 1)
    state = without.final_state
    assert all(getattr(state, name) is None or getattr(state, name).size == 0
               for name in ("travel", "travel_speed", "mount_friction"))  # fmt: skip


# -------------------------------------------------------------------- what is refused

ARM = {"pivot": (0.215, 0.105), "inertia": 0.0025}
SLIDER = {"direction": (1.0, 0.0), "mass": 1.0}
BAD_ARMS: dict[str, tuple[dict[str, Any], str]] = {
    "inertia": ({"inertia": 0.0}, "inertia"),
    "mass": ({"mass": -1.0}, "mass"),
    "stiffness": ({"stiffness": -1.0}, "stiffness"),
    "damping": ({"damping": -0.1}, "damping"),
    "friction": ({"friction": -0.1}, "friction"),
    "friction stiffness": ({"friction": 0.1, "friction_stiffness": -1.0}, "friction_stiffness"),
    "both": ({"preload": 1.0, "free_angle": 0.1, "stiffness": 10.0}, "preload.*free_angle"),
    "stops": ({"stops": (0.1, -0.1)}, "stops|lowest|highest"),
    "stop stiffness": ({"stops": (-0.1, 0.1), "stop_stiffness": -1.0}, "stop_stiffness"),
    "stop damping": ({"stops": (-0.1, 0.1), "stop_damping": -1.0}, "stop_damping"),
    "not a number": ({"preload": math.nan}, "preload"),
    "pivot": ({"pivot": (math.inf, 0.0)}, "pivot"),
}
BAD_SLIDERS: dict[str, tuple[dict[str, Any], str]] = {
    "direction": ({"direction": (0.0, 0.0)}, "direction"),
    "mass": ({"mass": 0.0}, "mass"),
    "weight": ({"weight": -1.0}, "weight"),
    "friction": ({"friction": -0.1}, "friction"),
    "both": ({"preload": 1.0, "free_travel": 0.1, "stiffness": 10.0}, "preload.*free_travel"),
    "stops": ({"stops": (0.1, 0.1)}, "stops|lowest|highest"),
}
BAD_PATHS: dict[str, tuple[dict[str, Any], str]] = {
    "does not begin at 0": ({"displacement": ((1e-3, 0.0), (0.0, 0.0))}, "displacement"),
    "time does not increase": ({"t": (0.1, 0.1)}, r"\bt\b"),
    "time goes back": ({"t": (0.1, 0.0)}, r"\bt\b"),
    "one point": ({"t": (0.0,), "displacement": ((0.0, 0.0),)}, r"\bt\b|point"),
    "shapes": ({"displacement": ((0.0, 0.0),)}, "displacement"),
    "not a number": ({"displacement": ((0.0, 0.0), (math.nan, 0.0))}, "displacement"),
}


def refuse(make: Any, message: str) -> None:
    """A ValueError before anything runs: when the part is made, or the drive with it."""
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("name", BAD_ARMS)
def test_bad_arms(name: str) -> None:
    changes, message = BAD_ARMS[name]
    given = {"stiffness": 10.0, "preload": 6.0, **ARM}
    if "free_angle" in changes:
        del given["preload"]
    refuse(lambda: drives.tensioner(bd.Arm(**(given | changes)))._model, message)


@pytest.mark.parametrize("name", BAD_SLIDERS)
def test_bad_sliders(name: str) -> None:
    changes, message = BAD_SLIDERS[name]
    refuse(
        lambda: drives.take_up(bd.Slider(**({"weight": 24.0} | SLIDER | changes)))._model, message
    )


@pytest.mark.parametrize("name", BAD_PATHS)
def test_bad_paths(name: str) -> None:
    changes, message = BAD_PATHS[name]
    given: dict[str, Any] = {"t": (0.0, 0.1), "displacement": ((0.0, 0.0), (1e-3, 0.0))}
    refuse(lambda: drives.take_up(bd.Path(**(given | changes)))._model, message)


def test_a_pivot_at_the_axis_is_refused() -> None:
    refuse(lambda: drives.tensioner(drives.arm(pivot=(0.135, 0.068)))._model, "pivot")


@pytest.mark.parametrize("mount", [drives.slider, drives.arm, None])
def test_the_papers_mesh_is_refused(mount: Any) -> None:
    made = bd.Path(t=(0.0, 0.1), displacement=((0, 0), (1e-3, 0))) if mount is None else mount()
    make = drives.tensioner if isinstance(made, bd.Arm) else drives.take_up
    refuse(lambda: make(made, belt_changes={"mesh": "paper"})._model, "mesh|joint")


def test_a_mount_that_cannot_hold_a_tension_is_refused() -> None:
    """A spring that pushes the pulley away from the belt, or none at all, against no stop."""
    message = r"^pulleys\[1\]\.mount .*(balance|tension)"
    refuse(lambda: drives.tensioner(drives.arm(preload=-6.0, stiffness=0.0))._model, message)
    refuse(lambda: drives.tensioner(drives.arm(preload=None, stiffness=0.0))._model, message)
    refuse(lambda: drives.take_up(drives.slider(direction=(-1.0, 0.0)))._model, message)


def test_something_else_is_no_mount() -> None:
    with pytest.raises(TypeError, match="mount"):
        bd.Pulley(center=(0, 0), radius=0.1, inertia=0.01, mount=3.0)


@pytest.mark.parametrize("name", ["travel", "travel_speed", "mount_friction"])
def test_states_of_another_number_of_mounts_are_refused(name: str) -> None:
    params = drives.take_up()
    start = bd.settle(params)
    with pytest.raises(ValueError, match=name):
        bad = attrs.evolve(start, **{name: [0.0, 0.0]})
        bd.simulate(params, drives.torque(params), 1e-4, initial=bad)


def test_friction_of_the_pivot_beyond_its_bound_is_refused() -> None:
    params = drives.tensioner()
    start = bd.settle(params)
    bad = attrs.evolve(start, mount_friction=[1.01])
    with pytest.raises(ValueError, match="mount_friction"):
        bd.simulate(params, drives.torque(params), 1e-4, initial=bad)


# -------------------------------------------------------------------- files


@pytest.mark.parametrize("name", ["arm", "arm with stops", "slider, gravity", "path"])
def test_text_toml_and_files(name: str, tmp_path: Path) -> None:
    params = drives.DRIVES[name]()
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
