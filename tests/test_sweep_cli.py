"""The command ``beltdyn sweep``: files of sweeps, what they are refused for, and a whole one.

Stopped it leaves what is done, and the same command goes on.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner, Result
from scipy import stats
from sweep_runs import PATH, bits, small

import beltdyn as bd
from beltdyn import cli
from beltdyn.many.store import Store
from beltdyn.sweeping import file as sweep_file
from beltdyn.sweeping.measure import as_measure

pytestmark = pytest.mark.filterwarnings("ignore:long_links")

MEASURE = ["span_tension.final", "stats.steps"]
SWEEP = """
scene = "drive.toml"
measure = ["span_tension.final", "stats.steps"]

[over]
"torque.scale" = { from = 0.5, to = 1.5, count = 3 }
"belt.length" = [1.198, 1.2, 0.2]

[options]
rtol = 1e-3
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    small().to_toml(tmp_path / "drive.toml")
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return tmp_path


def call(*arguments: object) -> Result:
    return CliRunner().invoke(cli.main, ["sweep", *map(str, arguments)])


def table(path: Path) -> xr.Dataset:
    with xr.open_dataset(path) as read:
        return read.load()


def test_a_sweep_from_a_file(folder: Path, tmp_path: Path) -> None:
    out = folder / "sweep.nc"
    done = call(folder / "sweep.toml", "--out", out, "--workers", 2)
    assert done.exit_code == 0, done.stderr
    found = table(out)
    over = {"torque.scale": np.linspace(0.5, 1.5, 3), "belt.length": [1.198, 1.2, 0.2]}
    with pytest.warns(bd.BeltdynWarning, match="no_result: 3 of 9"):
        expected = bd.sweep(small(), over, MEASURE, rtol=1e-3, progress=False)
    xr.testing.assert_equal(found, expected)
    assert found.attrs == expected.attrs
    assert "9 runs: 6 finished, 3 refused; 9 computed by 2 thread(s)" in done.stdout
    assert "belt.length is too short" in done.stdout and "span_tension" in done.stdout
    shown = re.findall(r"^  (0.5|1|1.5) +(1.198|1.2|0.2) +(.*)", done.stdout, re.M)
    assert len(shown) == 9, "a row for each of so few runs, of numbers or dashes"
    assert all(("-" in row) == (length == "0.2") for _, length, row in shown)
    assert sorted(one.name for one in folder.iterdir()) == ["drive.toml", "sweep.nc", "sweep.toml"]
    # a store that is named stays and is used again; what is refused costs nothing, and is so again
    kept = (folder / "sweep.toml", "--out", out, "--store", folder / "kept")
    assert call(*kept, "--quiet").stdout == ""
    again = call(*kept)
    assert "9 runs: 6 finished, 3 refused; 3 computed by" in again.stdout
    assert "6 found in the store" in again.stdout

    # values of every kind
    def read(*lines: str) -> Any:
        (tmp_path / "s.toml").write_text("\n".join(['scene = "kubas-case-1"', *lines]))
        return sweep_file.read(tmp_path / "s.toml")["over"]

    over = read(
        "[over]",
        '"friction" = [{ kind = "coulomb", mu = 0.5, v_reg = 0.01 }, { mu_k = 0.7, sigma = 1e4 }]',
        '"torque" = [[{ kind = "viscous", coefficients = [0.1, 0.0] }]]',
        '"contact.quadratic" = { from = 1e9, to = 1e11, count = 3, spacing = "geometric" }',
        '"method" = ["tsit5", "rodas4"]',
    )
    assert over["friction"] == [bd.Coulomb(mu=0.5, v_reg=0.01), bd.Dahl(mu_k=0.7, sigma=1e4)]
    assert over["torque"] == [bd.Viscous([0.1, 0.0])]
    np.testing.assert_allclose(over["contact.quadratic"], [1e9, 1e10, 1e11], rtol=1e-12)
    assert over["method"] == ["tsit5", "rodas4"]
    found = read(
        '[sample]\nn = 8\nmethod = "latin-hypercube"\nseed = 4',
        "[sample.ranges]",
        '"friction.mu_k" = [0.6, 0.9]',
        '"belt.axial_stiffness" = { normal = [90e3, 4e3] }',
        '"contact.quadratic" = { lognormal = [5e10, 0.2] }',
    )
    ranges = {
        "friction.mu_k": (0.6, 0.9),
        "belt.axial_stiffness": stats.norm(90e3, 4e3),
        "contact.quadratic": stats.lognorm(0.2, scale=5e10),
    }
    expected = bd.sample(ranges, 8, "latin-hypercube", seed=4)
    assert found.names == expected.names and bits(found.values) == bits(expected.values)


@pytest.mark.ci(guard="test_sweep_cli.py::test_a_sweep_from_a_file")
def test_the_file_of_the_notebooks() -> None:
    """The one that notebook 14 shows; runs are cut short, before there are margins to look for."""
    found = sweep_file.read(Path(__file__).resolve().parents[1] / "notebooks" / "sweep.toml")
    assert found["scene"] == bd.scenes.serpentine()
    as_measure(found["measure"], found["scene"].params, found["last"])
    over, measure = {**found["over"], "t_end": [0.002]}, "report.pulleys.hub_load"
    assert measure in found["measure"]
    table = bd.sweep(**{**found, "over": over, "measure": measure, "progress": False})
    assert table["status"].values.ravel().tolist() == 6 * ["finished"], table["message"].values
    # a tighter spring: more load on its pulley
    held = table[measure].squeeze().sel(pulley="tensioner")
    assert (held.diff("pulleys[tensioner].mount.preload") > 0.0).all()


WRONG = [
    ('scene = "drive.toml"', "", "scene: missing"),
    ('scene = "drive.toml"', "belt = {}", "this is a scene: name it"),
    ("measure", "mesure", "mesure: unknown field (did you mean 'measure'?)"),
    ("count = 3", "number = 3", "over.torque.scale.number: unknown field"),
    ("from = 0.5, ", "", "over.torque.scale.from: missing"),
    ("count = 3", "count = 0", "over.torque.scale.count"),
    ("count = 3", 'count = 3, spacing = "log"', "spacing must be one of even, geometric"),
    ("from = 0.5", "from = -1, spacing = 'geometric'", "must not reach or pass 0"),
    ("rtol = 1e-3", "store = 'x'", "options.store"),
    ("rtol = 1e-3", "rtol = 'x'", "rtol must be a real number"),
    ("[1.198, 1.2, 0.2]", "1.2", "over.belt.length: must be a list of values, or a range"),
    ('"torque.scale" =', "torque.scale =", "names stand in quotes"),
    ("[1.198, 1.2, 0.2]", "[{ a = 1 }]", "over.belt.length[0]: must be a number"),
    ("[options]", "[sample]\nn = 3\n[options]", "either over or sample"),
    ("[over]", "[ower]", "ower: unknown field"),
    ('scene = "drive.toml"', "scene = 3", "scene: must be a table"),
    ("belt.length", "belt.lenght", "did you mean 'belt.length'"),
]


def test_what_is_refused_and_where_no_run_finishes(folder: Path) -> None:
    """Each in a line: of the file, of the command; nothing is written. Refused runs are."""
    file, out = folder / "sweep.toml", folder / "sweep.nc"
    for old, new, words in WRONG:
        assert old in SWEEP
        file.write_text(SWEEP.replace(old, new))
        done = call(file, "--out", out)
        assert done.exit_code == 2 and words in done.stderr, (new, done.stderr)
        assert done.stderr.count("\n") == 1 and not out.exists()
    file.write_text(SWEEP.replace("[1.198, 1.2, 0.2]", "[0.2]"))
    for options, words in [
        ([file, "--out", folder / "no" / "sweep.nc"], "there is no folder"),
        ([file, "--out", out, "--workers", 0], "at least 1"),
        ([file, "--out", out, "--workers", 1, "--scheduler", "tcp://x:1"], "together"),
        ([file, "--out", out, "--store", file], "it is a file"),
        ([file], "--out"),
        ([folder / "none.toml", "--out", out], "cannot read"),
    ]:
        done = call(*options)
        assert done.exit_code == 2 and words in done.stderr
    done = call(file, "--out", out)
    assert done.exit_code == 1 and "no run finished" in done.stderr
    assert (table(out)["status"] == "refused").all()


#: The command in a process of its own, which goes on slowly once there is a part.
SLOWED = (
    PATH
    + """
import sweep_runs
from beltdyn.cli import main
sweep_runs.go_on_slowly(sys.argv[4] + ".runs", 1)
main()
"""
)


def of_many(folder: Path) -> list[str]:
    """Arguments for a sweep of 40 runs."""
    text = SWEEP.replace("count = 3", "count = 20").replace(", 0.2]", "]")
    (folder / "sweep.toml").write_text(text)
    out = str(folder / "sweep.nc")
    return ["sweep", str(folder / "sweep.toml"), "--out", out, "--workers", "1"]


def check_went_on(folder: Path) -> None:
    assert not (folder / "sweep.nc.runs").exists()
    over = {"torque.scale": np.linspace(0.5, 1.5, 20), "belt.length": [1.198, 1.2]}
    whole = bd.sweep(small(), over, MEASURE, rtol=1e-3, progress=False)
    xr.testing.assert_equal(table(folder / "sweep.nc"), whole)


def test_an_interrupted_sweep_goes_on(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def tend(self: Any) -> None:
        self.flush()
        raise KeyboardInterrupt

    begin = of_many(folder)
    with monkeypatch.context() as patch:
        patch.setattr(Store, "tend", tend)
        done = call(*begin[1:])
    assert done.exit_code == 130 and "go on with the same command" in done.stderr
    status = table(folder / "sweep.nc")["status"]
    assert (status == "missing").any() and (status == "finished").any()
    again = call(*begin[1:])
    assert f"{int((status == 'finished').sum())} found in the store" in again.stdout
    check_went_on(folder)


@pytest.mark.ci(guard="test_sweep_cli.py::test_an_interrupted_sweep_goes_on")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_sweep_goes_on_with_the_same_command(folder: Path, sent: signal.Signals) -> None:
    arguments = of_many(folder)
    running = subprocess.Popen(
        [sys.executable, "-c", SLOWED, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not list((folder / "sweep.nc.runs").glob("part-*")):
        assert running.poll() is None
        time.sleep(0.02)
    os.kill(running.pid, sent)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130 and "go on with the same command" in said
    assert (table(folder / "sweep.nc")["status"] == "missing").any()
    command = [sys.executable, "-m", "beltdyn", *arguments]
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert " found in the store" in again.stdout
    check_went_on(folder)
