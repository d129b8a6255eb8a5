"""The command line: exit codes, what is written where, and errors without tracebacks."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import beltdyn_kubas as kubas
import drives
import pytest
from click.testing import CliRunner, Result
from matplotlib.figure import Figure

import beltdyn as bd
from beltdyn import cli
from beltdyn.cli import commands

RUN = ("run", "kubas-case-1")
SHORT = (*RUN, "--t-end", "0.002")


def call(*arguments: object) -> Result:
    return CliRunner().invoke(cli.main, [str(argument) for argument in arguments])


def refused(result: Result, *words: str) -> None:
    """Bad input: exit code 2, one or two lines on stderr that hold the words, no traceback."""
    assert result.exit_code == 2, result.output
    assert result.stdout == "" and "Traceback" not in result.stderr
    assert 1 <= len(result.stderr.strip().splitlines()) <= 2, result.stderr
    assert all(word in result.stderr for word in words), result.stderr


def only_the_mesh(stderr: str) -> None:
    """The paper's belt has 60 links by design; nothing else is to be said of its runs."""
    (line,) = stderr.splitlines()
    assert line.startswith("beltdyn: warning: mesh: 60 straight links ")


def test_run_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture is the overview of the run, the film that of the same run."""
    out, plot, overview = tmp_path / "run.npz", tmp_path / "run.png", Mock(return_value=Figure())
    film, animate = tmp_path / "run.gif", Mock(return_value=Mock(frames=3))
    monkeypatch.setattr("beltdyn.plot.overview", overview)
    monkeypatch.setattr("beltdyn.plot.animate", animate)
    result = call(*SHORT, "--out", out, "--plot", plot, "--animate", film)
    assert result.exit_code == 0, result.output
    for word in ("1/min", "tension N", "creep", "Errors, estimated", "CPU time"):
        assert word in result.stdout
    assert "The mesh is the paper's, kept to reproduce it" in " ".join(result.stdout.split())
    assert len(result.stdout.splitlines()) <= 40
    assert f"written: {out}, {plot}, {film}" in result.stdout
    assert animate.call_args == overview.call_args
    assert animate.return_value.save.call_args.args == (film,)
    assert bd.Result.load(out).t[-1] == overview.call_args.args[0].t[-1] == 0.002
    assert plot.read_bytes().startswith(b"\x89PNG")
    long = call(*SHORT, "--verbose")  # adds what the integrator did
    assert long.exit_code == 0
    for word in ("accepted", "rates evaluated", "Jacobians", "local error", "method"):
        assert (word in long.stdout, word in result.stdout) == (True, False)


@pytest.mark.ci(guard="test_cli.py::test_run_a_scene")
def test_animate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def simulate(params: bd.Params, torque: Any, t_end: float, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, t_end, t_eval=[0.0, 1e-3, 2e-3], **options)

    monkeypatch.setattr(commands, "simulate", simulate)  # three samples, so three frames
    film = tmp_path / "run.gif"
    result = call(*SHORT, "--animate", film)
    assert result.exit_code == 0
    only_the_mesh(result.stderr)
    assert f"written: {film}" in result.stdout
    assert film.read_bytes().startswith(b"GIF8")


def test_scenes_by_name_and_file_options_and_quiet(tmp_path: Path) -> None:
    """A name may have underscores; --quiet prints nothing but errors."""
    path, out = tmp_path / "drive.toml", tmp_path / "run.npz"
    scene = bd.scenes.unequal_pulleys()._replace(t_end=0.001)
    scene.to_toml(path)
    assert call("run", path, "--out", out).exit_code == 0
    loaded = bd.Result.load(out)
    assert loaded.params == scene.params and loaded.t[-1] == 0.001
    options = ("--t-end", "0.002", "--method", "rk4", "--outputs", "span_tension, pulleys.omega")
    result = call("run", "kubas_case_2", *options, "--quiet", "--out", out)
    assert result.exit_code == 0 and result.output == ""
    loaded = bd.Result.load(out)
    assert loaded.stats.method == "rk4" and loaded.outputs == ("pulleys.omega", "span_tension")
    refused(call("run", "nope", "--quiet"), "nope")


def test_scenes_version_and_help() -> None:
    result = call("scenes")
    assert result.exit_code == 0
    for name in bd.scenes.names():
        assert name in result.stdout
    *_, blank, last = result.stdout.splitlines()
    assert (blank, last.partition(" made")[0]) == ("", f"and {len(bd.scenes.hard)}")
    assert call("--version").stdout.strip().endswith(bd.__version__)
    for arguments in (["--help"], ["run", "--help"], ["run", "-h"]):
        assert call(*arguments).exit_code == 0
    result = call()
    assert result.exit_code == 0
    assert "Usage:" in result.stdout and result.stderr == ""


def test_bad_input_is_named_in_one_line(tmp_path: Path) -> None:
    """Scenes, their files, values and the usage."""
    with pytest.raises(ValueError, match="kubas-case-1, kubas-case-2"):
        bd.scenes.get("nope")
    misspelt, broken = tmp_path / "misspelt.toml", tmp_path / "broken.toml"
    misspelt.write_text(bd.scenes.kubas_case_1().to_toml().replace("radius", "radus", 1))
    broken.write_text("[belt\n")
    sweep, saved = tmp_path / "sweep.toml", tmp_path / "saved.npz"
    sweep.write_text("scene = 'serpentine'\n[over]\nrtol = [1e-3]\n")
    saved.write_bytes(b"PK\x03\x04\xff")
    kind, law = tmp_path / "kind.toml", tmp_path / "law.toml"
    for path, wrongly in ((kind, 'kind = "Dahl"'), (law, 'law = "dahl"')):
        text = bd.scenes.kubas_case_1().to_toml()
        assert 'kind = "dahl"' in text
        path.write_text(text.replace('kind = "dahl"', wrongly))
    wrong: list[tuple[tuple[object, ...], list[str]]] = [
        (("run", "nope"), ["beltdyn: no scene is called 'nope'", *bd.scenes.names()]),
        (("run", "Kubas-case1"), ["(did you mean 'kubas-case-1'?)"]),
        (("run", "sigma-1e8"), ["(did you mean 'hard/sigma-1e8'?)"]),
        (("run", "hard"), ["called hard/NAME"]),
        (("scenes", "--hard", "layout"), ["(did you mean 'layouts'?)"]),
        (("run", tmp_path / "none.toml"), ["none.toml", "No such file"]),
        (("run", tmp_path / "mispelt.tml"), ["no file", "(did you mean 'misspelt.toml'?)"]),
        (("run", kind), ["friction.kind must be", "(did you mean 'dahl'?)"]),
        (("run", law), ["friction.law: unknown field (did you mean 'kind'?)"]),
        (("run", tmp_path), ["is a folder, not a scene"]),
        (("run", misspelt), [str(misspelt), "pulleys[0].radus: unknown field"]),
        (("run", broken), [str(broken), "not valid TOML"]),
        (("run", sweep), ["this is a sweep: run it with `beltdyn sweep`"]),
        (("show", saved), [str(saved), "which Result.load reads"]),
        ((*RUN, "--t-end", "-1"), ["t_end must be > initial.t"]),
        ((*RUN, "--t-end", "nan"), ["t_end must be finite"]),
        ((*RUN, "--rtol", "0"), ["rtol must be from 1e-12 to 1"]),
        ((*RUN, "--method", "euler"), ["euler"]),
        ((*RUN, "--rtol", "x"), ["--rtol"]),
        ((*RUN, "--nope"), ["--nope"]),
        ((*RUN, "--plto", "a.png"), ["No such option '--plto' (did you mean '--plot'?)"]),
        ((*RUN, "--plot"), ["'--plot' requires an argument (try: beltdyn run --help)"]),
        (("accuracy", *RUN[1:], "--error", "-1"), ["error must be > 0"]),
        (("rum",), ["No such command 'rum' (did you mean 'run'?)"]),
        ((*RUN, "--t-end"), ["--t-end"]),
        ((*RUN, "--outputs", "tension"), ["there is no 'tension' (did you mean 'span_tension'?)"]),
        ((*RUN, "--outputs", "belt", "--plot", "a.png"), ["leave --outputs out"]),
        ((*RUN, "--outputs", "belt", "--animate", "a.gif"), ["leave --outputs out"]),
        (("run",), []),
    ]
    for arguments, words in wrong:
        result = call(*arguments)
        refused(result, *words)
        assert len(result.stderr.splitlines()) == 1 and result.stderr.startswith("beltdyn: ")


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("it ran")


def test_output_that_cannot_be_written_is_found_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "simulate", never)
    monkeypatch.setattr(kubas, "runs", never)
    for option in ("--out", "--plot", "--animate"):
        missing = tmp_path / "none" / "run.png"
        refused(call(*RUN, option, missing), "cannot write", "no folder")
        refused(call(*RUN, option, tmp_path), "cannot write", "it is a folder")
    long = tmp_path / ("x" * 300)
    refused(call(*RUN, "--out", long))
    refused(call(*RUN, "--plot", tmp_path / "run.xyz"), "run.xyz", "png")
    refused(call(*RUN, "--animate", tmp_path / "run.avi"), "run.avi", "gif, mp4")
    for first, second, name in (("out", "plot", "a.png"), ("plot", "animate", "a.gif")):
        target = tmp_path / name
        result = call(*RUN, f"--{first}", target, f"--{second}", target)
        refused(result, f"--{first} and --{second} must not be the same file")
        assert not target.exists()
    file = tmp_path / "file"
    file.touch()
    figures = ("figures", "--out")
    refused(call(*figures, file), str(file), "it is a file")
    refused(call(*figures, tmp_path / "a" / "b"), "no folder", str(tmp_path / "a"))
    refused(call(*figures, long), "cannot write to")
    for kinds in ("png,xyz", "", "png,,pdf"):
        refused(call(*figures, tmp_path, "--format", kinds), "--format", "png")
    refused(call(*figures, tmp_path, "--size", "poster"), "--size", "notebook")
    refused(call("figures"), "--out")


def test_packages_that_are_missing_are_said_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "simulate", never)
    film = ("--animate", tmp_path / "run.mp4")
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "which", lambda *_: None)
        patch.setitem(sys.modules, "imageio_ffmpeg", None)
        refused(call(*RUN, *film), "pip install", "beltdyn[animation]")
    for name in [name for name in sys.modules if name.startswith("beltdyn.plot")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.backend_bases", None)
    for option, name in (("--plot", "run.png"), ("--animate", "run.gif")):
        refused(call(*RUN, option, tmp_path / name), "pip install", "beltdyn[plot]")
    monkeypatch.setattr(kubas, "runs", never)
    refused(call("figures", "--out", tmp_path), "pip install", "beltdyn[plot]")


def at_1_ms(monkeypatch: pytest.MonkeyPatch, action: Callable[[], Any]) -> None:
    """Let the command run with a torque that does this from 1 ms on, and gives what it returns."""

    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        return [action() if t > 1e-3 else 0.0, 0.0]

    def simulate(params: bd.Params, _torque: Any, *arguments: Any, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, *arguments, **options)

    monkeypatch.setattr(commands, "simulate", simulate)


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_run_writes_the_finished_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, which: signal.Signals
) -> None:
    """Told so twice, as an impatient user does: the second must not lose what is being written."""
    at_1_ms(monkeypatch, lambda: signal.raise_signal(which) or 0.0)
    monkeypatch.setattr("beltdyn.plot.overview", lambda result: Figure())
    fsync = os.fsync

    def impatient(descriptor: int) -> None:
        signal.raise_signal(which)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", impatient)
    out, plot = tmp_path / "run.npz", tmp_path / "run.png"
    result = call(*SHORT, "--out", out, "--plot", plot)
    assert result.exit_code == 130
    assert result.stdout == ""
    assert "interrupted at t = 0.0" in result.stderr
    assert f"written (up to that time): {out}, {plot}" in result.stderr
    partial = bd.Result.load(out)
    assert partial.status == "interrupted" and 0 < partial.t.size < 1001
    assert plot.is_file()


def test_failed_run_writes_the_finished_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_1_ms(monkeypatch, lambda: float("nan"))
    out = tmp_path / "run.npz"
    result = call(*SHORT, "--out", out)
    assert result.exit_code == 1
    mesh, why, there = result.stderr.strip().splitlines()
    only_the_mesh(mesh)
    assert "torque" in why and f"written (up to that time): {out}" in there
    assert bd.Result.load(out).status == "failed"


def test_ctrl_c_while_the_result_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _descriptor: signal.raise_signal(signal.SIGTERM))
    out = tmp_path / "run.npz"
    out.write_bytes(b"old")
    result = call(*SHORT, "--out", out)
    assert result.exit_code == 130
    assert result.stderr == "beltdyn: interrupted while the result was written\n"
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == [b"old"]


def test_a_scene_that_cannot_be_settled_fails(tmp_path: Path) -> None:
    """The exit code of a run that failed, not of bad input."""
    scene = tmp_path / "scene.toml"
    params = drives.small_idler(0.02, 20)
    bd.Scene(params, bd.Viscous([0.0, 0.0, 1.0]), 1e-3).to_toml(scene)
    for command in ("run", "explain"):
        result = call(command, scene)
        assert result.exit_code == 1 and "no link touches pulley 1" in result.stderr


@pytest.fixture
def one_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave Fig. 12 alone, of runs that are made once."""
    from beltdyn_kubas import figures

    monkeypatch.setattr(figures, "FIGURES", {12: figures.FIGURES[12]})
    monkeypatch.setattr(kubas, "runs", cache(kubas.runs))


@pytest.mark.ci(guard="test_cli.py::test_run_a_scene")
def test_options_of_the_figures(tmp_path: Path, one_figure: None) -> None:
    for size, width in (("notebook", 504), ("print", 1020)):
        result = call("figures", "--out", tmp_path, "--format", "PNG, .svg,pdf", "--size", size)
        assert result.exit_code == 0
        names = ["fig-12.pdf", "fig-12.png", "fig-12.svg", "table.txt"]
        assert sorted(path.name for path in tmp_path.iterdir()) == names
        header = (tmp_path / "fig-12.png").read_bytes()[16:20]
        assert int.from_bytes(header, "big") == width
        assert (tmp_path / "fig-12.pdf").read_bytes().startswith(b"%PDF")
        table = (tmp_path / "table.txt").read_text()
        assert "joint force at 0.4 s, passive span" in table and table in result.stdout
        assert f"written: 4 files in {tmp_path}" in result.stdout
    assert call("figures", "--out", tmp_path, "--quiet").output == ""


def test_figures_that_do_not_finish_tell_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_figure: None
) -> None:
    """Stopped while the runs are made, while figures are drawn, and by a full disk."""

    def savefig(_figure: object, _file: object, format: str) -> None:
        if format == "pdf":
            raise KeyboardInterrupt

    def write_bytes(path: Path, _content: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    folder = tmp_path / "figures"
    for error, code in (
        (bd.SimulationError("the step became too small"), 1),
        (bd.Interrupted("interrupted at t = 0.5 s"), 130),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(kubas, "runs", Mock(side_effect=error))
            result = call("figures", "--out", folder)
        assert result.exit_code == code and result.stdout == ""
        assert result.stderr.strip() == f"beltdyn: {error}"
        assert not folder.exists()
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", savefig)
    result = call("figures", "--out", tmp_path)
    assert result.exit_code == 130
    assert f"interrupted; 2 files written to {tmp_path}" in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"table.txt", "fig-12.png"}
    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    result = call("figures", "--out", tmp_path)
    assert result.exit_code == 1
    assert "table.txt: No space left on device" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def start(cwd: Path, *arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    command = [sys.executable, *arguments]
    return subprocess.run(command, text=True, cwd=cwd, timeout=60, **streams)


def test_as_a_module(tmp_path: Path) -> None:
    """Also with standard output that is full."""
    done = start(tmp_path, "-m", "beltdyn", *SHORT, "--out", "run.npz")
    assert done.returncode == 0, done.stderr
    assert "tension N" in done.stdout
    only_the_mesh(done.stderr)
    assert bd.Result.load(tmp_path / "run.npz").success
    with open("/dev/full", "w") as full:
        done = start(tmp_path, "-m", "beltdyn", "scenes", stdout=full)
    assert done.returncode == 1
    assert done.stderr.startswith("beltdyn: cannot write: ")
    assert len(done.stderr.splitlines()) == 1


def test_importing_without_the_core_says_what_to_do(tmp_path: Path) -> None:
    """Of a copy of the package without its compiled core."""
    for options, version, says in (
        # -S: without site-packages no installed core is found
        (("-S",), bd.__version__, "the C core of beltdyn is not built: run `python -m pip"),
        ((), "9.9.9", "beltdyn is version 9.9.9 but its C core is "),
    ):
        text = Path(bd.__file__).read_text().replace(bd.__version__, version)
        copy = tmp_path / version / "beltdyn" / "__init__.py"
        copy.parent.mkdir(parents=True)
        copy.write_text(text)
        done = start(tmp_path / version, *options, "-c", "import beltdyn")
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1].startswith(f"ImportError: {says}")


def test_importing_is_light(tmp_path: Path) -> None:
    code = (
        "import beltdyn, sys; "
        "rooms = 'accuracy explaining identification scenes spectra sweeping vibration'; "
        "heavy = {'click', 'matplotlib', 'rich', 'scipy', 'tomli_w'}; "
        "heavy |= {f'beltdyn.{room}' for room in rooms.split()}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = start(tmp_path, "-c", code)
    assert done.stdout.strip() == "[]", done.stderr
