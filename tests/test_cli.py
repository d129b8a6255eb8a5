"""The command line: exit codes, what is written where, and errors without tracebacks."""

from __future__ import annotations

import errno
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import beltdyn as bd
from beltdyn import cli, kubas
from beltdyn.cli import commands

SHORT = ("--t-end", "0.002")


@pytest.fixture
def call() -> Callable[..., Result]:
    def call(*arguments: object) -> Result:
        return CliRunner().invoke(cli.main, [str(argument) for argument in arguments])

    return call


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


def test_run_a_scene(call: Callable[..., Result], tmp_path: Path) -> None:
    out, plot = tmp_path / "run.npz", tmp_path / "run.png"
    result = call("run", "kubas-case-1", *SHORT, "--out", out, "--plot", plot)
    assert result.exit_code == 0, result.output
    for word in ("pulley speeds", "span tensions", "creep", "of the mesh", "in time", "CPU time"):
        assert word in result.stdout
    of_integrator = ("accepted", "rates evaluated", "Jacobians", "local error", "method")
    for word in of_integrator:
        assert word not in result.stdout
    assert str(out) in result.stdout and str(plot) in result.stdout
    assert bd.Result.load(out).t[-1] == 0.002
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_verbose_adds_what_the_integrator_did(call: Callable[..., Result]) -> None:
    short = call("run", "kubas-case-1", *SHORT)
    long = call("run", "kubas-case-1", *SHORT, "--verbose")
    assert short.exit_code == long.exit_code == 0
    for word in ("accepted", "rates evaluated", "Jacobians", "local error", "method"):
        assert word in long.stdout and word not in short.stdout


def test_animate(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(params: bd.Params, torque: Any, t_end: float, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, t_end, t_eval=[0.0, 1e-3, 2e-3], **options)

    monkeypatch.setattr(commands, "simulate", simulate)  # three samples, so three frames
    film = tmp_path / "run.gif"
    result = call("run", "kubas-case-1", *SHORT, "--animate", film)
    assert result.exit_code == 0
    only_the_mesh(result.stderr)
    assert f"written: {film}" in result.stdout
    assert film.read_bytes().startswith(b"GIF8")


def test_names_with_underscores_and_toml_files(call: Callable[..., Result], tmp_path: Path) -> None:
    assert call("run", "kubas_case_2", *SHORT).exit_code == 0
    path = tmp_path / "drive.toml"
    scene = bd.scenes.unequal_pulleys()._replace(t_end=0.001)
    scene.to_toml(path)
    out = tmp_path / "run.npz"
    assert call("run", path, "--out", out).exit_code == 0
    loaded = bd.Result.load(out)
    assert loaded.params == scene.params and loaded.t[-1] == 0.001


def test_options_reach_the_run(call: Callable[..., Result], tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    assert call("run", "kubas-case-1", *SHORT, "--method", "rk4", "--out", out).exit_code == 0
    assert bd.Result.load(out).stats.method == "rk4"


def test_quiet(call: Callable[..., Result], tmp_path: Path) -> None:
    result = call("run", "kubas-case-1", *SHORT, "--quiet", "--out", tmp_path / "run.npz")
    assert result.exit_code == 0 and result.output == ""
    refused(call("run", "nope", "--quiet"), "nope")


def test_scenes(call: Callable[..., Result]) -> None:
    result = call("scenes")
    assert result.exit_code == 0
    for name in bd.scenes.names():
        assert name in result.stdout
    assert len(result.stdout.splitlines()) == len(bd.scenes.names())


def test_version_and_help(call: Callable[..., Result]) -> None:
    assert call("--version").stdout.strip().endswith(bd.__version__)
    for arguments in (["--help"], ["run", "--help"], ["run", "-h"]):
        assert call(*arguments).exit_code == 0


def test_unknown_scene_lists_the_names(call: Callable[..., Result]) -> None:
    refused(call("run", "nope"), "nope", *bd.scenes.names())
    with pytest.raises(ValueError, match="kubas-case-1, kubas-case-2"):
        bd.scenes.get("nope")


def test_bad_files(call: Callable[..., Result], tmp_path: Path) -> None:
    refused(call("run", tmp_path / "none.toml"), "none.toml", "No such file")
    path = tmp_path / "bad.toml"
    path.write_text(bd.scenes.kubas_case_1().to_toml().replace("radius", "radus", 1))
    refused(call("run", path), str(path), "pulleys[0].radus: unknown field")
    path.write_text("[belt\n")
    refused(call("run", path), str(path), "not valid TOML")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--t-end", "-1"], ["t_end must be > initial.t"]),
        (["--t-end", "nan"], ["t_end must be finite"]),
        (["--rtol", "0"], ["rtol must be from 1e-12 to 1"]),
    ],
)
def test_bad_values(call: Callable[..., Result], options: list[str], words: list[str]) -> None:
    refused(call("run", "kubas-case-1", *options), *words)


@pytest.mark.parametrize(
    "options", [["--method", "euler"], ["--rtol", "x"], ["--nope"], ["--t-end"], []]
)
def test_bad_usage(call: Callable[..., Result], options: list[str]) -> None:
    result = call("run", *(["kubas-case-1", *options] if options else []))
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("beltdyn: ")
    assert "Traceback" not in result.stderr


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("it ran")


@pytest.fixture
def no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commands, "simulate", never)


@pytest.mark.parametrize("option", ["--out", "--plot", "--animate"])
def test_output_that_cannot_be_written_is_found_before_the_run(
    call: Callable[..., Result], tmp_path: Path, no_run: None, option: str
) -> None:
    missing = tmp_path / "none" / "run.png"
    refused(call("run", "kubas-case-1", option, missing), "cannot write", "no folder")
    refused(call("run", "kubas-case-1", option, tmp_path), "cannot write", "it is a folder")


def test_a_figure_of_an_unknown_kind_is_found_before_the_run(
    call: Callable[..., Result], tmp_path: Path, no_run: None
) -> None:
    refused(call("run", "kubas-case-1", "--plot", tmp_path / "run.xyz"), "run.xyz", "png")


def test_plot_without_matplotlib_is_said_before_the_run(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_run: None
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.backend_bases", None)
    plot = tmp_path / "run.png"
    refused(call("run", "kubas-case-1", "--plot", plot), "pip install", "beltdyn[plot]")


def test_a_film_of_an_unknown_kind_is_found_before_the_run(
    call: Callable[..., Result], tmp_path: Path, no_run: None
) -> None:
    refused(call("run", "kubas-case-1", "--animate", tmp_path / "run.avi"), "run.avi", "gif, mp4")


def test_a_film_without_its_package_is_said_before_the_run(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_run: None
) -> None:
    monkeypatch.setattr(shutil, "which", lambda *_: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    film = tmp_path / "run.mp4"
    refused(call("run", "kubas-case-1", "--animate", film), "pip install", "beltdyn[animation]")
    for name in [name for name in sys.modules if name.startswith("beltdyn.plot")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    film = tmp_path / "run.gif"
    refused(call("run", "kubas-case-1", "--animate", film), "pip install", "beltdyn[plot]")


def stopping(error: BaseException) -> Callable[..., bd.Result]:
    """Make a simulate whose torque raises this at 1 ms."""

    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        if t > 1e-3:
            raise error
        return [0.0, 0.0]

    def simulate(params: bd.Params, _torque: Any, *arguments: Any, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, *arguments, **options)

    return simulate


def test_interrupted_run_writes_the_finished_part(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "simulate", stopping(KeyboardInterrupt()))
    out, plot = tmp_path / "run.npz", tmp_path / "run.png"
    result = call("run", "kubas-case-1", *SHORT, "--out", out, "--plot", plot)
    assert result.exit_code == 130
    assert result.stdout == ""
    assert "interrupted at t = 0.0" in result.stderr
    assert f"written (up to that time): {out}, {plot}" in result.stderr
    partial = bd.Result.load(out)
    assert partial.status == "interrupted" and 0 < partial.t.size < 1001
    assert plot.is_file()


def test_failed_run_writes_the_finished_part(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(params: bd.Params, _torque: Any, *arguments: Any, **options: Any) -> bd.Result:
        late = lambda t, theta, omega: [float("nan") if t > 1e-3 else 0.0, 0.0]  # noqa: E731
        return bd.simulate(params, late, *arguments, **options)

    monkeypatch.setattr(commands, "simulate", simulate)
    out = tmp_path / "run.npz"
    result = call("run", "kubas-case-1", *SHORT, "--out", out)
    assert result.exit_code == 1
    assert "torque" in result.stderr and f"written (up to that time): {out}" in result.stderr
    first, *error = result.stderr.strip().splitlines()
    only_the_mesh(first)
    assert len(error) == 2
    assert bd.Result.load(out).status == "failed"


def test_ctrl_c_while_the_result_is_written(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(_descriptor: int) -> None:
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("os.fsync", fsync)
    out = tmp_path / "run.npz"
    out.write_bytes(b"old")
    result = call("run", "kubas-case-1", *SHORT, "--out", out)
    assert result.exit_code == 130
    assert result.stderr == "beltdyn: interrupted while the result was written\n"
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == [b"old"]


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


@pytest.mark.slow
def test_all_figures_of_the_paper(call: Callable[..., Result], tmp_path: Path) -> None:
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


def test_options_of_the_figures(
    call: Callable[..., Result], tmp_path: Path, one_figure: None
) -> None:
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
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    refused(call("figures", "--out", tmp_path), "pip install", "beltdyn[plot]")


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (bd.SimulationError("the step became too small"), 1, "the step became too small"),
        (bd.Interrupted("interrupted at t = 0.5 s"), 130, "interrupted at t = 0.5 s"),
    ],
)
def test_runs_of_the_figures_that_do_not_finish(
    call: Callable[..., Result],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    code: int,
    says: str,
) -> None:
    def runs(progress: bool) -> kubas.Runs:
        raise error

    monkeypatch.setattr(kubas, "runs", runs)
    folder = tmp_path / "figures"
    result = call("figures", "--out", folder)
    assert result.exit_code == code and result.stdout == ""
    assert result.stderr.strip() == f"beltdyn: {says}"
    assert not folder.exists()


def test_drawing_that_is_interrupted_tells_what_is_there(
    call: Callable[..., Result],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    one_figure: None,
) -> None:
    def savefig(_figure: object, _file: object, format: str) -> None:
        if format == "pdf":
            raise KeyboardInterrupt

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", savefig)
    result = call("figures", "--out", tmp_path)
    assert result.exit_code == 130
    assert f"interrupted; 2 files written to {tmp_path}" in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"table.txt", "fig-12.png"}


def test_a_disk_that_is_full_while_drawing(
    call: Callable[..., Result],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    one_figure: None,
) -> None:
    def write_bytes(path: Path, _content: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    result = call("figures", "--out", tmp_path)
    assert result.exit_code == 1
    assert "table.txt: No space left on device" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


# --- as a user starts it -------------------------------------------------------------------------


def start(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "beltdyn", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=60)


def test_as_a_module(tmp_path: Path) -> None:
    done = start("run", "kubas-case-1", "--t-end", "0.001", "--out", "run.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "pulley speeds" in done.stdout
    only_the_mesh(done.stderr)
    assert bd.Result.load(tmp_path / "run.npz").success


def test_errors_as_a_module(tmp_path: Path) -> None:
    done = start("run", "nope", cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("beltdyn: no scene is called 'nope'")
    assert len(done.stderr.splitlines()) == 1


def import_from(folder: Path, *options: str, version: str = bd.__version__) -> str:
    """Import a copy of the package without its compiled core; give what stderr says last."""
    text = Path(bd.__file__).read_text().replace(bd.__version__, version)
    (folder / "beltdyn").mkdir()
    (folder / "beltdyn" / "__init__.py").write_text(text)
    command = [sys.executable, *options, "-c", "import beltdyn"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=60)
    assert done.returncode == 1
    return done.stderr.splitlines()[-1]


def test_importing_without_the_core_says_what_to_do(tmp_path: Path) -> None:
    # -S: without site-packages no installed core is found
    message = import_from(tmp_path, "-S")
    assert message.startswith("ImportError: the C core of beltdyn is not built: run `python -m pip")


def test_importing_with_the_core_of_another_version(tmp_path: Path) -> None:
    message = import_from(tmp_path, version="9.9.9")
    assert message.startswith("ImportError: beltdyn is version 9.9.9 but its C core is ")


def test_importing_is_light(tmp_path: Path) -> None:
    code = (
        "import beltdyn, sys; "
        "heavy = {'cattrs', 'click', 'matplotlib', 'rich', 'scipy', 'tomli_w'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, timeout=60
    )
    assert done.stdout.strip() == "[]", done.stderr


def test_output_and_figure_in_one_file(call: Callable[..., Result], tmp_path: Path) -> None:
    target = tmp_path / "both.png"
    result = call("run", "kubas-case-1", *SHORT, "--out", target, "--plot", target)
    assert result.exit_code == 2
    assert "--out and --plot must not be the same file" in result.stderr
    assert not target.exists()
    target = tmp_path / "both.gif"
    result = call("run", "kubas-case-1", *SHORT, "--plot", target, "--animate", target)
    assert result.exit_code == 2
    assert "--plot and --animate must not be the same file" in result.stderr


def test_a_folder_is_no_scene(call: Callable[..., Result], tmp_path: Path) -> None:
    result = call("run", tmp_path)
    assert result.exit_code == 2
    assert "is a folder, not a scene" in result.stderr


def test_standard_output_that_is_full(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "beltdyn", "run", "kubas-case-1", "--t-end", "0.001"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=tmp_path, timeout=60
        )
    assert done.returncode == 1
    assert done.stderr.startswith("beltdyn: cannot write: ")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_the_finished_part(tmp_path: Path, which: signal.Signals) -> None:
    """Sent twice, as an impatient user does: the second must not lose what is being written."""
    out = tmp_path / "run.npz"
    code = "import sys; from beltdyn import cli; print('ready', flush=True); cli.main(sys.argv[1:])"
    command = [sys.executable, "-c", code, "run", "kubas-case-1", "--t-end", "1000"]
    with subprocess.Popen(
        [*command, "--out", str(out)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(3.0)  # settling takes 0.1 s, a run of 1000 s takes minutes
        process.send_signal(which)
        time.sleep(0.1)
        process.send_signal(which)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "interrupted" in errors and "Traceback" not in errors
    assert bd.Result.load(out).status == "interrupted"


def test_no_command_shows_the_help(call: Callable[..., Result]) -> None:
    result = call()
    assert result.exit_code == 0
    assert "Usage:" in result.stdout and result.stderr == ""


def test_a_name_too_long(call: Callable[..., Result], tmp_path: Path) -> None:
    result = call("run", "kubas-case-1", "--out", tmp_path / ("x" * 300))
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
