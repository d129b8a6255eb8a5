"""Results as files of other programs: of the kind that the ending names, with the same numbers."""

from __future__ import annotations

import csv
import errno
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import drives
import mounted_drives
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from scipy.io import loadmat

import beltdyn as bd
from beltdyn import cli
from beltdyn.cli import commands

T = np.linspace(0.0, 4e-3, 5)

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@cache
def run(**options: Any) -> bd.Result:
    scene = drives.plain_scene()
    return bd.simulate(scene.params, scene.torque_fn, T[-1], t_eval=T, **options)


def refused(*arguments: object) -> str:
    done = CliRunner().invoke(cli.main, [str(argument) for argument in arguments])
    assert done.exit_code == 2 and done.stdout == "", done.output
    (line,) = done.stderr.splitlines()
    return line


def test_csv_has_a_column_for_each_number_which_reads_as_the_same(tmp_path: Path) -> None:
    params, path = mounted_drives.both(), tmp_path / "run.CSV"
    still = bd.Viscous([0.0] * len(params.pulleys))
    for result in (run(), bd.simulate(params, still, T[-1], t_eval=T), run(outputs=("energy",))):
        result.save(path)
        with path.open(newline="") as file:
            heads, *rows = list(csv.reader(file))
        columns = dict(zip(heads, np.array(rows, dtype=float).T, strict=True))
        np.testing.assert_array_equal(columns.pop("t (s)"), result.t)
        for name, values in result.to_xarray().data_vars.items():
            for at in np.ndindex(values.shape[1:]):
                head = f"{name}[{','.join(map(str, at))}]" if at else name
                found = columns.pop(f"{head} ({values.attrs['units']})")
                np.testing.assert_array_equal(found, values.values[:, *at])
        assert not columns
    assert heads[:2] == ["t (s)", "energy.kinetic (J)"]


def test_mat_has_a_struct_for_each_group(tmp_path: Path) -> None:
    result, path = run(), tmp_path / "run.mat"
    result.save(path)
    found = loadmat(path, simplify_cells=True)
    np.testing.assert_array_equal(found["t"], result.t)
    np.testing.assert_array_equal(found["span_tension"], result.span_tension)
    for group in ("pulleys", "belt", "joints", "contact", "energy"):
        arrays = getattr(result, group).arrays()
        assert set(found[group]) == set(arrays)
        for name, values in arrays.items():
            np.testing.assert_array_equal(found[group][name], values)
    assert bd.Params.from_toml(found["scene"]) == result.params


def test_nc_is_the_dataset(tmp_path: Path) -> None:
    run().save(tmp_path / "run.nc")
    with xr.open_dataset(tmp_path / "run.nc") as found:
        assert found.identical(run().to_xarray())


def test_of_a_run_without_samples_there_is_a_head(tmp_path: Path) -> None:
    scene = drives.plain_scene()
    result = bd.simulate(scene.params, scene.torque_fn, 1e-3, t_eval=[])
    result.save(tmp_path / "run.csv")
    (head,) = (tmp_path / "run.csv").read_text().splitlines()
    assert head.startswith("t (s),pulleys.theta[0] (rad),")


def test_other_endings_are_refused_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each command lists what it writes; nothing is left behind. A name without an ending is the
    file that can be read again.
    """
    monkeypatch.setattr(commands, "simulate", Mock(side_effect=AssertionError("it ran")))
    monkeypatch.setattr(
        import_module("beltdyn.sweeping.sweep"),
        "run_sweep",
        Mock(side_effect=AssertionError("it ran")),
    )
    path = tmp_path / "run.xlsx"
    rule = "its ending must be .npz, .nc, .csv or .mat"
    with pytest.raises(ValueError, match=rule):
        run().save(path)
    assert rule in refused("run", "kubas-case-1", "--out", path)
    assert rule in refused("resume", tmp_path / "none", "--out", path)
    assert "must be .csv" in refused("accuracy", "kubas-case-1", "--out", tmp_path / "a.npz")
    assert "must be .nc" in refused("sweep", tmp_path / "none", "--out", tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []
    run().save(tmp_path / "run")
    assert bd.Result.load(tmp_path / "run").final_state == run().final_state
    run().save(tmp_path / ".csv")
    assert (tmp_path / ".csv").read_text().startswith("t (s),")


def test_a_missing_package_is_named_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "simulate", Mock(side_effect=AssertionError("it ran")))
    missing = Mock(side_effect=ModuleNotFoundError(name="scipy"))
    monkeypatch.setattr("beltdyn.base.optional.import_module", missing)
    said = refused("run", "kubas-case-1", "--out", tmp_path / "run.mat")
    assert "a .mat file needs the package scipy" in said and "beltdyn[vibration]" in said


@pytest.mark.parametrize("ending", ["nc", "csv", "mat"])
def test_load_says_which_kind_it_reads(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{ending}"
    run(outputs=("pulleys.omega",)).save(path)
    with pytest.raises(ValueError, match=r"is not a saved Result: .*; .* only \.npz is read"):
        bd.Result.load(path)


@pytest.mark.parametrize("ending", ["npz", "nc", "csv", "mat"])
def test_a_file_that_cannot_be_written_in_full_leaves_the_old_one(
    ending: str, tmp_path: Path
) -> None:
    """The error names the file, also where the library of netCDF says "HDF error" alone."""
    resource = pytest.importorskip("resource")
    path = tmp_path / f"run.{ending}"
    path.write_bytes(b"before")
    run().to_xarray()  # imports what xarray needs
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, hard))
    try:
        with pytest.raises(OSError, match="the file there is unchanged") as caught:
            run().save(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert caught.value.filename == str(path)
    assert caught.value.errno in (errno.EFBIG, errno.EIO)
    assert path.read_bytes() == b"before" and list(tmp_path.iterdir()) == [path]
