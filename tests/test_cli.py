"""The command line: exit codes, what is written where, and errors without tracebacks."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import drives
import pytest
from click.testing import CliRunner, Result
from matplotlib.figure import Figure

import beltdyn as bd
from beltdyn import cli, kubas
from beltdyn.cli import commands

RUN = ("run", "kubas-case-1")
SHORT = (*RUN, "--t-end", "0.002")


def call(*arguments: object) -> Result:
    return CliRunner().invoke(cli.main, [str(argument) for argument in arguments])


def refused(result: Result, *words: str) -> None:
    """Bad input: exit code 2, one or two lines on stderr that hold the words, no traceback."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert 1 <= len(result.stderr.strip().splitlines()) <= 2, result.stderr
    for word in words:
        assert word in result.stderr


def only_the_mesh(stderr: str) -> None:
    """The paper's belt has 60 links by design; nothing else is to be said of its runs."""
    (line,) = stderr.splitlines()
    assert line.startswith("beltdyn: warning: mesh: 60 straight links ")


OF_INTEGRATOR = ("accepted", "rates evaluated", "Jacobians", "local error", "method")


def test_run_a_scene(tmp_path: Path) -> None:
    out, plot = tmp_path / "run.npz", tmp_path / "run.png"
    result = call(*SHORT, "--out", out, "--plot", plot)
    assert result.exit_code == 0, result.output
    for word in ("pulley speeds", "span tensions", "creep", "of the mesh", "in time", "CPU time"):
        assert word in result.stdout
    assert str(out) in result.stdout and str(plot) in result.stdout
    assert bd.Result.load(out).t[-1] == 0.002
    assert plot.read_bytes().startswith(b"\x89PNG")
    long = call(*SHORT, "--verbose")  # adds what the integrator did
    assert long.exit_code == 0
    for word in OF_INTEGRATOR:
        assert word in long.stdout and word not in result.stdout


@pytest.mark.ci(guard="test_animation.py::test_gif")
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


def test_names_with_underscores_and_toml_files(tmp_path: Path) -> None:
    assert call("run", "kubas_case_2", "--t-end", "0.002").exit_code == 0
    path = tmp_path / "drive.toml"
    scene = bd.scenes.unequal_pulleys()._replace(t_end=0.001)
    scene.to_toml(path)
    out = tmp_path / "run.npz"
    assert call("run", path, "--out", out).exit_code == 0
    loaded = bd.Result.load(out)
    assert loaded.params == scene.params and loaded.t[-1] == 0.001


def test_options_reach_the_run_and_quiet_says_nothing(tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    result = call(*SHORT, "--method", "rk4", "--quiet", "--out", out)
    assert result.exit_code == 0 and result.output == ""
    assert bd.Result.load(out).stats.method == "rk4"
    refused(call("run", "nope", "--quiet"), "nope")


def test_scenes_version_and_help() -> None:
    result = call("scenes")
    assert result.exit_code == 0
    for name in bd.scenes.names():
        assert name in result.stdout
    assert len(result.stdout.splitlines()) == len(bd.scenes.names())
    assert call("--version").stdout.strip().endswith(bd.__version__)
    for arguments in (["--help"], ["run", "--help"], ["run", "-h"]):
        assert call(*arguments).exit_code == 0
    result = call()
    assert result.exit_code == 0
    assert "Usage:" in result.stdout and result.stderr == ""


def test_unknown_scene_lists_the_names() -> None:
    refused(call("run", "nope"), "nope", *bd.scenes.names())
    with pytest.raises(ValueError, match="kubas-case-1, kubas-case-2"):
        bd.scenes.get("nope")


def test_bad_files(tmp_path: Path) -> None:
    refused(call("run", tmp_path / "none.toml"), "none.toml", "No such file")
    refused(call("run", tmp_path), "is a folder, not a scene")
    path = tmp_path / "bad.toml"
    path.write_text(bd.scenes.kubas_case_1().to_toml().replace("radius", "radus", 1))
    refused(call("run", path), str(path), "pulleys[0].radus: unknown field")
    path.write_text("[belt\n")
    refused(call("run", path), str(path), "not valid TOML")


def test_bad_values_and_usage() -> None:
    refused(call(*RUN, "--t-end", "-1"), "t_end must be > initial.t")
    refused(call(*RUN, "--t-end", "nan"), "t_end must be finite")
    refused(call(*RUN, "--rtol", "0"), "rtol must be from 1e-12 to 1")
    for options in (["--method", "euler"], ["--rtol", "x"], ["--nope"], ["--t-end"], None):
        result = call("run") if options is None else call(*RUN, *options)
        refused(result)
        assert len(result.stderr.splitlines()) == 1
        assert result.stderr.startswith("beltdyn: ")


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("it ran")


def test_output_that_cannot_be_written_is_found_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "simulate", never)
    missing = tmp_path / "none" / "run.png"
    for option in ("--out", "--plot", "--animate"):
        refused(call(*RUN, option, missing), "cannot write", "no folder")
        refused(call(*RUN, option, tmp_path), "cannot write", "it is a folder")
    long = call(*RUN, "--out", tmp_path / ("x" * 300))
    refused(long)
    assert len(long.stderr.splitlines()) == 1
    refused(call(*RUN, "--plot", tmp_path / "run.xyz"), "run.xyz", "png")
    refused(call(*RUN, "--animate", tmp_path / "run.avi"), "run.avi", "gif, mp4")
    for first, second, name in (("out", "plot", "a.png"), ("plot", "animate", "a.gif")):
        target = tmp_path / name
        result = call(*RUN, f"--{first}", target, f"--{second}", target)
        refused(result, f"--{first} and --{second} must not be the same file")
        assert not target.exists()


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
    assert "torque" in result.stderr and f"written (up to that time): {out}" in result.stderr
    first, *error = result.stderr.strip().splitlines()
    only_the_mesh(first)
    assert len(error) == 2
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


# --- the paper's figures -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def three_runs() -> kubas.Runs:
    return kubas.runs()


@pytest.fixture
def one_figure(three_runs: kubas.Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave Fig. 12 alone, of runs that were made before."""
    from beltdyn.kubas import figures

    monkeypatch.setattr(figures, "FIGURES", {12: figures.FIGURES[12]})
    monkeypatch.setattr(kubas, "runs", lambda progress: three_runs)


@pytest.mark.extended(guard="test_cli.py::test_run_a_scene")
def test_all_figures_of_the_paper(tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    result = call("figures", "--out", folder)
    assert result.exit_code == 0, result.output
    numbers = range(5, 20)
    names = {f"fig-{number:02d}.{kind}" for number in numbers for kind in ("png", "pdf")}
    assert {path.name for path in folder.iterdir()} == names | {"table.txt"}
    for number in numbers:
        assert (folder / f"fig-{number:02d}.png").read_bytes().startswith(b"\x89PNG")
        assert (folder / f"fig-{number:02d}.pdf").read_bytes().startswith(b"%PDF")
    table = (folder / "table.txt").read_text()
    assert "joint force at 0.4 s, passive span" in table and table in result.stdout
    assert f"written: 31 files in {folder}" in result.stdout


@pytest.mark.ci(guard="test_cli.py::test_run_a_scene")
def test_options_of_the_figures(tmp_path: Path, one_figure: None) -> None:
    for size, width in (("notebook", 504), ("print", 1020)):
        result = call(
            "figures", "--out", tmp_path, "--format", "PNG, .svg", "--size", size, "--quiet"
        )
        assert result.exit_code == 0 and result.output == ""
        assert {path.name for path in tmp_path.iterdir()} == {
            "fig-12.png", "fig-12.svg", "table.txt",
        }  # fmt: skip
        header = (tmp_path / "fig-12.png").read_bytes()[16:20]
        assert int.from_bytes(header, "big") == width


def test_figures_that_cannot_be_written_are_refused_before_the_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kubas, "runs", never)
    file = tmp_path / "file"
    file.touch()
    refused(call("figures", "--out", file), str(file), "it is a file")
    refused(call("figures", "--out", tmp_path / "a" / "b"), "no folder", str(tmp_path / "a"))
    refused(call("figures", "--out", tmp_path / ("x" * 300)), "cannot write to")
    for kinds in ("png,xyz", "", "png,,pdf"):
        refused(call("figures", "--out", tmp_path, "--format", kinds), "--format", "png")
    refused(call("figures", "--out", tmp_path, "--size", "poster"), "--size", "notebook")
    refused(call("figures"), "--out")


def test_runs_of_the_figures_that_do_not_finish(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "figures"
    for error, code, says in (
        (bd.SimulationError("the step became too small"), 1, "the step became too small"),
        (bd.Interrupted("interrupted at t = 0.5 s"), 130, "interrupted at t = 0.5 s"),
    ):

        def runs(progress: bool, error: BaseException = error) -> kubas.Runs:
            raise error

        monkeypatch.setattr(kubas, "runs", runs)
        result = call("figures", "--out", folder)
        assert result.exit_code == code and result.stdout == ""
        assert result.stderr.strip() == f"beltdyn: {says}"
        assert not folder.exists()


def test_drawing_that_does_not_finish_tells_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_figure: None
) -> None:
    def savefig(_figure: object, _file: object, format: str) -> None:
        if format == "pdf":
            raise KeyboardInterrupt

    def write_bytes(path: Path, _content: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

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


# --- as a user starts it -------------------------------------------------------------------------


def start(cwd: Path, *arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    command = [sys.executable, *arguments]
    return subprocess.run(command, text=True, cwd=cwd, timeout=60, **streams)


def test_as_a_module(tmp_path: Path) -> None:
    done = start(tmp_path, "-m", "beltdyn", *SHORT, "--out", "run.npz")
    assert done.returncode == 0, done.stderr
    assert "pulley speeds" in done.stdout
    only_the_mesh(done.stderr)
    assert bd.Result.load(tmp_path / "run.npz").success


@pytest.mark.ci(guard="test_cli.py::test_unknown_scene_lists_the_names")
def test_errors_as_a_module(tmp_path: Path) -> None:
    done = start(tmp_path, "-m", "beltdyn", "run", "nope")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("beltdyn: no scene is called 'nope'")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("options", "version", "says"),
    [
        # -S: without site-packages no installed core is found
        (("-S",), bd.__version__, "the C core of beltdyn is not built: run `python -m pip"),
        ((), "9.9.9", "beltdyn is version 9.9.9 but its C core is "),
    ],
)
def test_importing_without_the_core_says_what_to_do(
    tmp_path: Path, options: tuple[str, ...], version: str, says: str
) -> None:
    """Of a copy of the package without its compiled core."""
    text = Path(bd.__file__).read_text().replace(bd.__version__, version)
    (tmp_path / "beltdyn").mkdir()
    (tmp_path / "beltdyn" / "__init__.py").write_text(text)
    done = start(tmp_path, *options, "-c", "import beltdyn")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {says}")


def test_importing_is_light(tmp_path: Path) -> None:
    code = (
        "import beltdyn, sys; "
        "heavy = {'cattrs', 'click', 'matplotlib', 'rich', 'scipy', 'tomli_w'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = start(tmp_path, "-c", code)
    assert done.stdout.strip() == "[]", done.stderr


def test_standard_output_that_is_full(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = start(tmp_path, "-m", "beltdyn", "scenes", stdout=full)
    assert done.returncode == 1
    assert done.stderr.startswith("beltdyn: cannot write: ")
    assert len(done.stderr.splitlines()) == 1


READY = """
import sys
from beltdyn import cli, simulate
from beltdyn.cli import commands

def with_a_sign(params, torque, *others, **options):
    def said(t, theta, omega, said=[]):
        if t > 1e-3 and not said:
            said.append(t)
            print("ready", flush=True)
        return torque(t, theta, omega)

    return simulate(params, said, *others, **options)

commands.simulate = with_a_sign
cli.main(sys.argv[1:])
"""


@pytest.mark.ci(guard="test_cli.py::test_interrupted_run_writes_the_finished_part")
@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_the_finished_part(tmp_path: Path, which: signal.Signals) -> None:
    out = tmp_path / "run.npz"
    command = [sys.executable, "-c", READY, *RUN, "--t-end", "1000", "--out", str(out)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(which)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "interrupted" in errors and "Traceback" not in errors
    assert bd.Result.load(out).status == "interrupted"
