"""The command ``beltdyn sweep``: files of sweeps, what they are refused for, and a whole one.

Stopped or killed it leaves what is done, and the same command goes on.
"""

from __future__ import annotations

import os
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
from sweeps import bits, small

import beltdyn as bd
from beltdyn import cli
from beltdyn.sweeping import file as sweep_file
from beltdyn.sweeping.measure import as_measure

pytestmark = pytest.mark.filterwarnings("ignore:long_links")

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


def test_a_sweep_from_a_file(folder: Path) -> None:
    out = folder / "sweep.nc"
    done = call(folder / "sweep.toml", "--out", out, "--workers", 2)
    assert done.exit_code == 0, done.stderr
    found = table(out)
    over = {"torque.scale": np.linspace(0.5, 1.5, 3), "belt.length": [1.198, 1.2, 0.2]}
    measure = ["span_tension.final", "stats.steps"]
    expected = bd.sweep(small(), over, measure, rtol=1e-3, progress=False)
    xr.testing.assert_equal(found, expected)
    assert found.attrs == expected.attrs
    assert "9 runs: 6 finished, 3 refused; 9 computed by 2 thread(s)" in done.stdout
    assert "belt.length is too short" in done.stdout and "span_tension.final" in done.stdout
    assert sorted(one.name for one in folder.iterdir()) == ["drive.toml", "sweep.nc", "sweep.toml"]
    quiet = call(folder / "sweep.toml", "--out", out, "--quiet")
    assert (quiet.exit_code, quiet.stdout) == (0, "")


def test_a_store_that_is_named_stays_and_is_used_again(folder: Path) -> None:
    arguments = (folder / "sweep.toml", "--out", folder / "sweep.nc", "--store", folder / "kept")
    assert call(*arguments).exit_code == 0
    again = call(*arguments)
    # what is refused costs nothing and is refused again
    assert "9 runs: 6 finished, 3 refused; 3 computed by" in again.stdout
    assert "6 found in the store" in again.stdout


def test_the_file_of_the_notebooks() -> None:
    """The one that notebook 14 shows; runs are cut short, before there are margins to look for."""
    path = Path(__file__).resolve().parent.parent / "notebooks" / "sweep.toml"
    found = sweep_file.read(path)
    assert found.scene == bd.scenes.serpentine()
    as_measure(found.measure, found.scene.params, found.arguments["last"])
    options = {**found.arguments, "executor": "threads", "progress": False}
    over, measure = {**found.over, "t_end": [0.002]}, "report.pulleys.hub_load"
    assert measure in found.measure
    table = bd.sweep(found.scene, over, measure, **options)
    assert table["status"].values.ravel().tolist() == 6 * ["finished"], table["message"].values
    held = table[measure].squeeze().sel(pulley="tensioner")
    # a tighter spring: more load on its pulley
    assert (held.diff("pulleys[tensioner].mount.preload") > 0.0).all()


def test_no_run_finishes(folder: Path) -> None:
    text = SWEEP.replace("[1.198, 1.2, 0.2]", "[0.2]")
    (folder / "sweep.toml").write_text(text)
    done = call(folder / "sweep.toml", "--out", folder / "sweep.nc")
    assert done.exit_code == 1 and "no run finished" in done.stderr
    assert (table(folder / "sweep.nc")["status"] == "refused").all()


def test_values_of_every_kind(tmp_path: Path) -> None:
    scene = small().to_toml()
    tables = scene.replace("[belt]", "[scene.belt]").replace("[friction]", "[scene.friction]")
    lines = [
        '"friction" = [{ kind = "coulomb", mu = 0.5, v_reg = 0.01 }, { mu_k = 0.7, sigma = 1e4 }]',
        '"torque" = [[{ kind = "viscous", coefficients = [0.1, 0.0] }]]',
        '"contact.quadratic" = { from = 1e9, to = 1e11, count = 3, spacing = "geometric" }',
        '"method" = ["tsit5", "rodas4"]',
    ]
    text = 'scene = "kubas-case-1"\n[over]\n' + "\n".join(lines)
    (tmp_path / "s.toml").write_text(text)
    found = sweep_file.read(tmp_path / "s.toml")
    assert found.over["friction"] == [bd.Coulomb(mu=0.5, v_reg=0.01), bd.Dahl(mu_k=0.7, sigma=1e4)]
    assert found.over["torque"] == [bd.Viscous([0.1, 0.0])]
    np.testing.assert_allclose(found.over["contact.quadratic"], [1e9, 1e10, 1e11], rtol=1e-12)
    assert found.over["method"] == ["tsit5", "rodas4"]
    assert "[scene.belt]" in tables


def test_samples_in_a_file(tmp_path: Path) -> None:
    from scipy import stats

    text = """
        scene = "kubas-case-1"
        [sample]
        n = 8
        method = "latin-hypercube"
        seed = 4
        [sample.ranges]
        "friction.mu_k" = [0.6, 0.9]
        "belt.axial_stiffness" = { normal = [90e3, 4e3] }
        "contact.quadratic" = { lognormal = [5e10, 0.2] }
    """
    (tmp_path / "s.toml").write_text(text)
    found = sweep_file.read(tmp_path / "s.toml").over
    expected = bd.sample(
        {
            "friction.mu_k": (0.6, 0.9),
            "belt.axial_stiffness": stats.norm(90e3, 4e3),
            "contact.quadratic": stats.lognorm(0.2, scale=5e10),
        },
        8,
        "latin-hypercube",
        seed=4,
    )
    assert found.names == expected.names and bits(found.values) == bits(expected.values)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('scene = "drive.toml"', "", "scene: missing"),
        ('scene = "drive.toml"', "scene = 3", "scene: must be a table"),
        ('scene = "drive.toml"', 'scene = "driv"', "no scene is called"),
        ("measure", "mesure", "mesure: unknown field (did you mean 'measure'?)"),
        ("[over]", "[ower]", "ower: unknown field"),
        ("count = 3", "number = 3", "over.torque.scale.number: unknown field"),
        ("from = 0.5, ", "", "over.torque.scale.from: missing"),
        ("count = 3", "count = 0", "over.torque.scale.count"),
        ("count = 3", 'count = 3, spacing = "log"', "spacing must be one of even, geometric"),
        ("from = 0.5", "from = -1, spacing = 'geometric'", "must not reach or pass 0"),
        ("rtol = 1e-3", "rtoll = 1e-3", "did you mean 'rtol'"),
        ("rtol = 1e-3", "store = 'x'", "options.store"),
        ("[1.198, 1.2, 0.2]", "1.2", "over.belt.length: must be a list of values, or a range"),
        ('"torque.scale" =', "torque.scale =", "names stand in quotes"),
        ("[1.198, 1.2, 0.2]", "[{ a = 1 }]", "over.belt.length[0]: must be a number"),
        ("belt.length", "belt.lenght", "did you mean 'belt.length'"),
        ("span_tension.final", "span_tension.last", "did you mean"),
        ("[options]", "[sample]\nn = 3\n[options]", "either over or sample"),
        ("[over]", "over = 3\n[x]", "x: unknown field"),
    ],
)
def test_what_files_are_refused_for(folder: Path, old: str, new: str, words: str) -> None:
    assert old in SWEEP
    (folder / "sweep.toml").write_text(SWEEP.replace(old, new))
    done = call(folder / "sweep.toml", "--out", folder / "sweep.nc")
    assert done.exit_code == 2, done.stdout
    assert words in done.stderr and done.stderr.count("\n") == 1
    assert not (folder / "sweep.nc").exists()


def test_bad_usage(folder: Path) -> None:
    file = folder / "sweep.toml"
    for options, words in [
        (["--out", folder / "no" / "sweep.nc"], "there is no folder"),
        (["--out", folder / "a.nc", "--workers", 0], "at least 1"),
        (["--out", folder / "a.nc", "--workers", 1, "--scheduler", "tcp://x:1"], "together"),
        (["--out", folder / "a.nc", "--store", file], "it is a file"),
        ([], "--out"),
    ]:
        done = call(file, *options)
        assert done.exit_code == 2 and words in done.stderr
    missing = call(folder / "none.toml", "--out", folder / "a.nc")
    assert missing.exit_code == 2 and "cannot read" in missing.stderr


def command(folder: Path) -> list[str]:
    """The command line of a sweep of some 40 runs, in a process of its own."""
    text = SWEEP.replace("count = 3", "count = 20").replace(", 0.2]", "]")
    (folder / "sweep.toml").write_text(text)
    small(0.05).to_toml(folder / "drive.toml")
    out = str(folder / "sweep.nc")
    arguments = ["sweep", str(folder / "sweep.toml"), "--out", out, "--workers", "1"]
    return [sys.executable, "-m", "beltdyn", *arguments]


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_stopped_sweep_goes_on_with_the_same_command(folder: Path, sent: signal.Signals) -> None:
    begin, out, parts = command(folder), folder / "sweep.nc", folder / "sweep.nc.runs"
    running = subprocess.Popen(begin, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120.0
    wanted = 1 if sent is signal.SIGKILL else 0  # of a killed one, some part must have been written
    while not (parts.is_dir() and len(list(parts.glob("part-*"))) >= wanted):
        assert running.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    os.kill(running.pid, sent)
    _, said = running.communicate(timeout=60)
    if sent is signal.SIGKILL:
        assert running.returncode == -signal.SIGKILL and not out.exists()
    else:
        assert running.returncode == 130 and "go on with the same command" in said
        status = table(out)["status"]
        assert (status == "missing").any()
    again = subprocess.run(begin, capture_output=True, text=True, check=True)
    if sent is signal.SIGKILL:
        assert " found in the store" in again.stdout
    assert not parts.exists()
    over: dict[str, Any] = {"torque.scale": np.linspace(0.5, 1.5, 20), "belt.length": [1.198, 1.2]}
    measure = ["span_tension.final", "stats.steps"]
    whole = bd.sweep(small(0.05), over, measure, rtol=1e-3, progress=False)
    xr.testing.assert_equal(table(out), whole)
