"""``Result.to_xarray()``: arrays with names, units and texts; equal when read from a file."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import drives
import mounted_drives
import numpy as np
import pytest
import xarray as xr

import beltdyn as bd
from beltdyn import _core
from beltdyn.outputs.histories import GROUPS

T = np.linspace(0.0, 4e-3, 5)

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@cache
def plain() -> bd.Result:
    scene = drives.plain_scene()
    return bd.simulate(scene.params, scene.torque_fn, T[-1], t_eval=T)


@cache
def mounted() -> bd.Result:
    params = mounted_drives.both()
    return bd.simulate(params, bd.Viscous([0.0] * len(params.pulleys)), T[-1], t_eval=T)


@pytest.fixture(params=[plain, mounted])
def result(request: pytest.FixtureRequest) -> Any:
    return request.param()


def test_every_array_is_there_with_its_unit_and_text(result: bd.Result) -> None:
    data = result.to_xarray()
    found = {"span_tension": result.span_tension}
    for group in GROUPS:
        if (held := getattr(result, group)) is not None:
            found |= {f"{group}.{name}": array for name, array in held.arrays().items()}
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
    data, params = result.to_xarray(), result.params
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
    """Also one that failed, of what was computed."""
    with pytest.raises(bd.SimulationError) as caught:
        bd.simulate(*drives.plain_scene()[:2], T[-1], t_eval=T, max_steps=3)
    failed = caught.value.result
    assert failed is not None and failed.to_xarray().sizes["time"] == failed.t.size < T.size
    for one in (result, failed):
        attributes = one.to_xarray().attrs
        assert bd.Params.from_toml(attributes["scene"]) == one.params
        assert attributes["beltdyn_version"] == bd.__version__
        said = [attributes[name] for name in ("method", "kernels", "status", "message")]
        assert said == [one.stats.method, one.stats.kernels, one.status, one.message]
        lines = attributes["warnings"].splitlines()
        assert [line.partition(":")[0] for line in lines] == [each.code for each in one.warnings]


def test_only_what_was_asked_for_and_files_come_back_equal(tmp_path: Path) -> None:
    whole, path, scene = plain().to_xarray(), tmp_path / "run.nc", drives.plain_scene()
    found = [whole, mounted().to_xarray()]
    energy = {name for name in whole.data_vars if name.startswith("energy.")}
    omega, force = {"pulleys.omega"}, {"joints.force", "contact.pulley"}
    for names, expected in (
        (omega, omega), (force, {*force, "span_tension"}), ({"energy"}, energy), (set(), set()),
    ):  # fmt: skip
        data = bd.simulate(*scene[:2], T[-1], t_eval=T, outputs=names).to_xarray()
        assert set(data.data_vars) == expected and "time" in data.coords
        assert ("pulley" in data.coords) == (names == omega)
        assert names or set(data.coords) == {"time"}
        found.append(data)
    for data in found:
        data.to_netcdf(path)
        with xr.open_dataset(path) as read:
            assert read.identical(data)
            assert all(read[name].dtype == data[name].dtype for name in data.data_vars)


def test_without_xarray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = Mock(side_effect=ModuleNotFoundError(name="xarray"))
    monkeypatch.setattr("beltdyn.base.optional.import_module", missing)
    with pytest.raises(ImportError, match=r'needs the package xarray: .* "beltdyn\[sweep\]"'):
        plain().to_xarray()
