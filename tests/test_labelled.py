"""``Result.to_xarray()``: arrays with names, units and texts; equal when read from a file."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import drives
import mounted_drives
import numpy as np
import pytest
import xarray as xr

import beltdyn as bd
from beltdyn import _core, outputs

T = np.linspace(0.0, 4e-3, 5)

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@cache
def plain(*names: str) -> bd.Result:
    scene = drives.plain_scene()
    options: dict[str, Any] = {"outputs": names} if names else {}
    return bd.simulate(scene.params, scene.torque_fn, T[-1], t_eval=T, **options)


@cache
def mounted() -> bd.Result:
    params = mounted_drives.both()
    return bd.simulate(params, bd.Viscous([0.0] * len(params.pulleys)), T[-1], t_eval=T)


@pytest.fixture(params=[plain, mounted])
def result(request: pytest.FixtureRequest) -> bd.Result:
    run: bd.Result = request.param()
    return run


def comes_back(data: Any, path: Path) -> None:
    data.to_netcdf(path)
    with xr.open_dataset(path) as read:
        assert read.identical(data)
        for name in data.data_vars:
            assert read[name].dtype == data[name].dtype


def test_every_array_is_there_with_its_unit_and_text(result: bd.Result) -> None:
    data = result.to_xarray()
    found = {
        f"{group}.{name}": array
        for group in ("pulleys", "belt", "joints", "contact", "mounts", "energy")
        if getattr(result, group) is not None
        for name, array in getattr(result, group).arrays().items()
    }
    found["span_tension"] = result.span_tension
    assert set(data.data_vars) == set(found)
    for name, array in found.items():
        np.testing.assert_array_equal(data[name], array)
        assert data[name].attrs["long_name"] and data[name].attrs["units"]
        assert data[name].dims[0] == "time"
    for name, group, _, unit, text in _core.OUTPUTS:
        if f"{group}.{name}" in data and group != "mounts":
            assert data[f"{group}.{name}"].attrs == {"units": unit, "long_name": text}
    for name, _, text in _core.ENERGY_TERMS:
        if f"energy.{name}" in data:
            assert data[f"energy.{name}"].attrs == {"units": "J", "long_name": text}


def test_coordinates_carry_names(result: bd.Result) -> None:
    data = result.to_xarray()
    params = result.params
    np.testing.assert_array_equal(data["time"], result.t)
    assert data["time"].attrs["units"] == "s"
    assert tuple(data["pulley"].values) == params.pulley_names
    for k, name in enumerate(params.pulley_names):
        speed = data["pulleys.omega"].sel(pulley=name)
        np.testing.assert_array_equal(speed, result.pulleys.omega[:, k])
    rows = result.report(last=1.0).spans
    assert list(data["span"].values) == [row.name for row in rows]
    load = data["pulleys.load"].sel(xy="y")
    np.testing.assert_array_equal(load, result.pulleys.load[:, :, 1])
    assert data["joints.force"].dims == ("time", "joint")
    assert data["contact.normal"].dims == ("time", "link")
    assert data.sizes["link"] == data.sizes["joint"] == params.belt.n_bodies


def test_mounts_are_called_by_their_pulleys_and_have_one_unit_where_they_are_of_one_kind() -> None:
    result = mounted()
    data = result.to_xarray()
    names = [result.params.pulley_names[k] for k in result.params.mounted]
    assert list(data["mount"].values) == names
    assert sorted(data["mount_kind"].values) == ["arm", "slider"]
    assert data["mounts.travel"].attrs["units"] == "rad or m"
    scene = bd.scenes.tensioned_alternator()
    one = bd.simulate(scene.params, scene.torque_fn, 1e-4, t_eval=[0.0, 1e-4]).to_xarray()
    assert list(one["mount_kind"].values) == ["arm"]
    assert one["mounts.travel"].attrs["units"] == "rad"
    assert one["mounts.belt_force"].attrs["units"] == "N m"


def test_the_whole_says_what_was_run(result: bd.Result) -> None:
    attributes = result.to_xarray().attrs
    assert bd.Params.from_toml(attributes["scene"]) == result.params
    assert attributes["beltdyn_version"] == bd.__version__
    assert attributes["method"] == result.stats.method
    assert attributes["kernels"] == result.stats.kernels
    assert (attributes["status"], attributes["message"]) == (result.status, result.message)
    lines = attributes["warnings"].splitlines()
    assert [line.partition(":")[0] for line in lines] == [one.code for one in result.warnings]


def test_a_file_comes_back_equal(result: bd.Result, tmp_path: Path) -> None:
    comes_back(result.to_xarray(), tmp_path / "run.nc")


def test_only_what_was_asked_for(tmp_path: Path) -> None:
    every = set(plain().to_xarray().data_vars)
    for names in (("pulleys.omega",), ("joints.force", "contact.pulley"), ("span_tension",),
                  ("energy",)):  # fmt: skip
        data = plain(*names).to_xarray()
        assert set(data.data_vars) == {
            name
            for name in every
            if outputs.has(names, "energy" if name.startswith("energy.") else name)
        }
        assert ("pulley" in data.coords) == ("pulleys.omega" in names) and "time" in data.coords
        comes_back(data, tmp_path / "run.nc")
    scene = drives.plain_scene()
    nothing = bd.simulate(scene.params, scene.torque_fn, T[-1], t_eval=T, outputs=()).to_xarray()
    assert set(nothing.data_vars) == set() and set(nothing.coords) == {"time"}
    comes_back(nothing, tmp_path / "nothing.nc")


def test_a_run_that_failed_has_what_was_computed() -> None:
    scene = drives.plain_scene()
    with pytest.raises(bd.SimulationError) as caught:
        bd.simulate(scene.params, scene.torque_fn, T[-1], t_eval=T, max_steps=3)
    result = caught.value.result
    assert result is not None
    data = result.to_xarray()
    assert data.attrs["status"] == "failed" and data.sizes["time"] == result.t.size < T.size


def test_without_xarray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from beltdyn import optional

    def missing(name: str) -> Any:
        raise ModuleNotFoundError(name=name)

    result = plain()
    monkeypatch.setattr(optional, "import_module", missing)
    with pytest.raises(ImportError, match=r'needs the package xarray: .* "beltdyn\[sweep\]"'):
        result.to_xarray()
