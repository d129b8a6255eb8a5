"""`beltdyn run --checkpoint` and `beltdyn resume`: a run that is killed or stopped leaves what it
computed, and goes on to the files that it was to write."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from drives import plain_scene
from test_checkpoints import same
from test_cli import call, only_the_mesh, refused

import beltdyn as bd
from beltdyn.blocks import BlockFile

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@pytest.fixture(autouse=True)
def there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def command(folder: Path, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "beltdyn", *map(str, arguments)],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def grows(process: subprocess.Popen[str], path: Path, size: int) -> None:
    """Wait until the file has so many bytes; the process must not end before."""
    while not path.exists() or path.stat().st_size < size:
        assert process.poll() is None, process.communicate()
        time.sleep(2e-3)


@pytest.mark.ci(guard="test_cli_checkpoints.py::test_options_reach_the_file")
def test_a_run_that_is_killed_twice_and_stopped_once(tmp_path: Path) -> None:
    """By kill -9, again while it goes on, then by SIGTERM; the last part writes the whole run."""
    scene = plain_scene()._replace(t_end=1.0)
    scene.to_toml(tmp_path / "drive.toml")
    written, out = tmp_path / "the run", tmp_path / "out.npz"
    arguments = ("--out", "out.npz", "--checkpoint-every", "0", "--quiet")
    size = 200_000
    process = command(tmp_path, "run", "drive.toml", "--checkpoint", "the run", *arguments)
    grows(process, written, size)
    process.kill()
    assert process.communicate() == ("", "") and process.returncode == -signal.SIGKILL
    for end in (signal.SIGKILL, signal.SIGTERM):
        assert not out.exists()
        size = written.stat().st_size + 200_000
        process = command(tmp_path, "resume", "the run", *arguments)
        grows(process, written, size)
        process.send_signal(end)
        said = process.communicate()
        assert process.returncode == (130 if end is signal.SIGTERM else -signal.SIGKILL), said
    interrupted, parts, on = said[1].splitlines()
    assert interrupted.startswith("beltdyn: interrupted at t = ")
    assert parts == "written (up to that time): out.npz"
    assert on == "go on with: beltdyn resume 'the run'"
    assert bd.Result.load(out).status == "interrupted"
    process = command(tmp_path, "resume", "the run", "--out", "out.npz")
    stdout, stderr = process.communicate()
    assert process.returncode == 0, stderr
    assert "pulley speeds" in stdout and "written: out.npz" in stdout
    only_the_mesh(stderr)
    assert same(bd.Result.load(out), bd.simulate(*scene))


def test_options_reach_the_file(tmp_path: Path) -> None:
    result = call(
        "run", "kubas-case-1", "--t-end", "0.004", "--checkpoint", "run", "--checkpoint-every", "7",
        "--method", "rodas4", "--rtol", "1e-3", "--outputs", "pulleys", "--quiet",
    )  # fmt: skip
    assert result.exit_code == 0 and result.output == ""
    assert call("resume", "run", "--out", "out.npz", "--quiet").output == ""
    saved = bd.Result.load(tmp_path / "out.npz")
    scene = bd.scenes.kubas_case_1()
    options = {"method": "rodas4", "rtol": 1e-3, "outputs": ("pulleys",)}
    assert same(saved, bd.simulate(*scene[:2], 0.004, **options))  # type: ignore[arg-type]
    for option, name in (("--plot", "file.png"), ("--animate", "file.gif")):
        refused(call("resume", "run", option, name), "draw from all outputs")


def test_the_accuracy_asked_for_may_choose(tmp_path: Path) -> None:
    """--error chooses the run, which is then one."""
    found = call(
        "run", "kubas-case-1", "--t-end", "0.01", "--error", "0.2", "--checkpoint", "run",
        "--out", "one.npz", "--quiet",
    )  # fmt: skip
    assert found.exit_code == 0, found.output
    assert call("resume", "run", "--out", "other.npz", "--quiet").exit_code == 0
    assert same(*(bd.Result.load(tmp_path / name) for name in ("one.npz", "other.npz")))


def test_what_is_refused(tmp_path: Path) -> None:
    short = ("run", "kubas-case-1", "--t-end", "0.002")
    there = tmp_path / "there"
    there.write_text("mine")
    refused(call(*short, "--checkpoint", "there"), "beltdyn resume there")
    refused(call("resume", "there"), "cannot go on from there: it is no checkpoint of a run")
    refused(call("resume", "none"), "cannot read or write none: No such file")
    refused(call(*short, "--checkpoint", "none/run"), "cannot read or write none/run: No such file")
    refused(call(*short, "--checkpoint", "a", "--out", "a"), "--out and --checkpoint", "same file")
    refused(call("resume", "there", "--out", "there"), "there is the run itself")
    refused(call(*short, "--checkpoint-every", "1"), "give both")
    refused(call(*short, "--checkpoint", "a", "--checkpoint-every", "-1"), "every must be >= 0")
    refused(call(*short, "--checkpoint", "a", "--verify"), "--verify makes several")
    refused(call(*short, "--checkpoint", "a", "--budget", "5"), "--budget makes several")
    refused(call("resume", "there", "--last", "2"), "--last")
    assert there.read_text() == "mine" and list(tmp_path.iterdir()) == [there]


def test_what_cannot_be_gone_on_with() -> None:
    """Runs of functions are for Python, and of two at once one writes."""
    scene = bd.scenes.kubas_case_1()
    bd.simulate(scene.params, lambda t, theta, omega: [0.0, 0.0], 0.001, checkpoint="of Python")
    refused(call("resume", "of Python"), "beltdyn.resume('of Python', torque_fn=...)")
    bd.simulate(*scene[:2], 0.001, checkpoint="run")
    with BlockFile("run", b"beltdyn checkpoint 1\n", b"rest", write=True):
        refused(call("resume", "run"), "cannot read or write run: another run is writing to it")
