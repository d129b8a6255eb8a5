"""`beltdyn run --checkpoint` and `beltdyn resume`: a run that is killed or stopped leaves what it
computed, and goes on to the files that it was to write.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from drives import plain_scene
from test_checkpoints import same
from test_cli import call, only_the_mesh, refused

import beltdyn as bd
from beltdyn.base import sqlite
from beltdyn.run import checkpoints

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@pytest.fixture(autouse=True)
def there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def command(*arguments: str) -> subprocess.Popen[str]:
    parts = [sys.executable, "-m", "beltdyn", *arguments, "--out", "out.npz"]
    return subprocess.Popen(parts, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_an_interrupted_run_goes_on_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """By Ctrl-C while it writes; what is there is a run, and it goes on to the whole one."""
    short = ("run", "kubas-case-1", "--t-end", "0.01", "--out", "out.npz")
    add, added = checkpoints._add, []

    def interrupted(*given: Any) -> None:
        added.append(given)
        if len(added) == 7:
            signal.raise_signal(signal.SIGINT)
        add(*given)

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints, "_add", interrupted)
        done = call(*short, "--checkpoint", "the run", "--checkpoint-every", "0")
    assert done.exit_code == 130
    assert "go on with: beltdyn resume 'the run'" in done.stderr
    assert bd.Result.load("out.npz").status == "interrupted"
    assert call("resume", "the run", "--out", "out.npz", "--quiet").output == ""
    assert same(bd.Result.load("out.npz"), bd.simulate(*bd.scenes.kubas_case_1()[:2], 0.01))


@pytest.mark.ci(guard="test_cli_checkpoints.py::test_an_interrupted_run_goes_on_to_the_end")
def test_a_run_that_is_killed_and_interrupted_goes_on() -> None:
    """By kill -9, by Ctrl-C and by SIGTERM; the last part writes the whole run."""
    scene, written, out = plain_scene()._replace(t_end=1.0), Path("the run"), Path("out.npz")
    scene.to_toml("drive.toml")
    arguments, size = ("run", "drive.toml", "--checkpoint", "the run"), 0
    for end in (signal.SIGKILL, signal.SIGINT, signal.SIGTERM):
        process = command(*arguments, "--checkpoint-every", "0", "--quiet")
        while not written.exists() or written.stat().st_size < size + 200_000:
            assert process.poll() is None, process.communicate()
            time.sleep(2e-3)
        process.send_signal(end)
        stdout, stderr = process.communicate()
        assert stdout == ""
        if end is signal.SIGKILL:
            assert stderr == "" and process.returncode == -end and not out.exists()
        else:
            interrupted, parts, on = stderr.splitlines()
            assert process.returncode == 130
            assert interrupted.startswith("beltdyn: interrupted at t = ")
            assert parts == "written (up to that time): out.npz"
            assert on == "go on with: beltdyn resume 'the run'"
            assert bd.Result.load(out).status == "interrupted"
        arguments, size = ("resume", "the run"), written.stat().st_size
    process = command(*arguments)
    stdout, stderr = process.communicate()
    assert process.returncode == 0, stderr
    assert "Means over" in stdout and "written: out.npz" in stdout
    only_the_mesh(stderr)
    assert same(bd.Result.load(out), bd.simulate(*scene))


def test_options_reach_the_file() -> None:
    """Also --error, which chooses the run, which is then one."""
    short = ("run", "kubas-case-1", "--t-end", "0.004", "--checkpoint")
    result = call(
        *short, "run", "--checkpoint-every", "7", "--method", "rodas4", "--rtol", "1e-3",
        "--outputs", "pulleys", "--quiet",
    )  # fmt: skip
    assert result.exit_code == 0 and result.output == ""
    assert call("resume", "run", "--out", "out.npz", "--quiet").output == ""
    scene = bd.scenes.kubas_case_1()
    expected = bd.simulate(*scene[:2], 0.004, method="rodas4", rtol=1e-3, outputs=("pulleys",))
    assert same(bd.Result.load("out.npz"), expected)
    for option, name in (("--plot", "file.png"), ("--animate", "file.gif")):
        refused(call("resume", "run", option, name), "draw from all outputs")
    assert call(*short, "other", "--error", "0.2", "--out", "one.npz", "--quiet").exit_code == 0
    assert call("resume", "other", "--out", "other.npz", "--quiet").exit_code == 0
    assert same(bd.Result.load("one.npz"), bd.Result.load("other.npz"))


def test_what_is_refused(tmp_path: Path) -> None:
    short = ("run", "kubas-case-1", "--t-end", "0.002")
    there = tmp_path / "there"
    there.write_text("mine")
    for arguments, words in (
        (
            (*short, "--checkpoint", "there"),
            "there already; cannot go on from there: it is no checkp",
        ),
        (("resume", "there"), "cannot go on from there: it is no checkpoint of a run"),
        (("resume", "none"), "cannot read or write none: No such file"),
        ((*short, "--checkpoint", "none/run"), "cannot read or write none/run: No such file"),
        ((*short, "--checkpoint", "a", "--out", "a"), "--out and --checkpoint"),
        (("resume", "there", "--out", "there"), "there is the run itself"),
        ((*short, "--checkpoint-every", "1"), "give both"),
        ((*short, "--checkpoint", "a", "--checkpoint-every", "-1"), "every must be >= 0"),
        ((*short, "--checkpoint", "a", "--verify"), "--verify makes several"),
        ((*short, "--checkpoint", "a", "--budget", "5"), "--budget makes several"),
        (("resume", "there", "--last", "2"), "--last"),
    ):
        refused(call(*arguments), words)
    assert there.read_text() == "mine" and list(tmp_path.iterdir()) == [there]
    # runs of functions are for Python, and of two at once one writes
    scene = bd.scenes.kubas_case_1()
    bd.simulate(scene.params, lambda t, theta, omega: [0.0, 0.0], 0.001, checkpoint="of Python")
    refused(call("resume", "of Python"), "beltdyn.resume('of Python', torque_fn=...)")
    bd.simulate(*scene[:2], 0.001, checkpoint="run")
    with closing(sqlite.opened("run", checkpoints._TABLES, write=True)):
        refused(call("resume", "run"), "cannot read or write run: another run is writing to it")
