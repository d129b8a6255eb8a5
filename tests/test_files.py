"""Writing files whole or not at all: kills, full disks, missing rights, links, pipes, Ctrl-C."""

from __future__ import annotations

import errno
import itertools
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import drives
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

import beltdyn as bd
from beltdyn import cli, files
from beltdyn.cli import commands, written

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX files and processes")
OLD = b"what was there before"
CALL = ("run", "kubas-case-1", "--t-end", "1e-3")


@pytest.fixture(scope="module")
def result() -> bd.Result:
    scene = drives.plain_scene()
    return bd.simulate(scene.params, scene.torque_fn, 1e-3, t_eval=np.linspace(0.0, 1e-3, 21))


@pytest.fixture(scope="module")
def savers(result: bd.Result) -> dict[str, Callable[[Path], object]]:
    """Everything that writes a file, by the name of the file."""
    scene = drives.plain_scene()
    film = bd.plot.animate(result, duration=0.1)
    return {
        "run.npz": result.save,
        "state.npz": result.final_state.save,
        "drive.toml": scene.params.to_toml,
        "scene.toml": scene.to_toml,
        "run.png": lambda path: written.save_figure(Figure(), path),
        "run.gif": lambda path: film.save(path, dpi=30),
        "run.html": lambda path: film.save(path, dpi=30),
        "run.mp4": lambda path: film.save(path, dpi=40),
    }


NAMES = ["run.npz", "state.npz", "drive.toml", "scene.toml"]
NAMES += [f"run.{ending}" for ending in ("png", "gif", "html", "mp4")]


def contents(folder: Path) -> dict[str, bytes]:
    return {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.is_file()}


def called(*arguments: object) -> tuple[int, str]:
    """Exit code and stderr of the command line."""
    done = CliRunner().invoke(cli.main, [str(argument) for argument in arguments])
    return done.exit_code, done.stderr


# --- whatever stops it ---------------------------------------------------------------------------

KILLS = """
import os, random, signal, sys, time
from pathlib import Path
import numpy as np
import beltdyn as bd, drives

target = Path(sys.argv[1])
scene = drives.plain_scene()
runs = {
    t_end: bd.simulate(scene.params, scene.torque_fn, t_end, t_eval=np.linspace(0, t_end, 60))
    for t_end in (1e-3, 2e-3)
}
runs[1e-3].save(target)
begin = time.perf_counter()
runs[1e-3].save(target)
saving = time.perf_counter() - begin
moments, seen = random.Random(1), set()
for _ in range(25):
    child = os.fork()
    if not child:
        while True:
            for run in (runs[2e-3], runs[1e-3]):
                run.save(target)
    time.sleep(moments.uniform(0.0, 8.0 * saving))  # a child on a loaded machine starts late
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    found = bd.Result.load(target)
    run = runs[found.final_state.t]
    assert found.final_state == run.final_state
    np.testing.assert_array_equal(found.belt.x, run.belt.x)
    seen.add(found.final_state.t)
print(len(seen), len(list(target.parent.iterdir())) - 1)
"""


@posix
@pytest.mark.ci(guard="test_files.py::test_the_old_file_stays_until_the_new_one_is_complete")
def test_killed_at_any_moment_the_file_is_the_old_or_the_new(tmp_path: Path) -> None:
    path = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    command = [sys.executable, "-c", path + KILLS, str(tmp_path / "run.npz")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    seen, cut_short = map(int, done.stdout.split())
    assert seen == 2
    # Only a killed process leaves its temporary file: it shows that some were amid writing.
    assert cut_short > 0


STOPS = [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left")]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", NAMES)
def test_the_old_file_stays_until_the_new_one_is_complete(
    savers: dict[str, Callable[[Path], object]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
) -> None:
    """Of every kind one way to be stopped; of a result and a scene, all."""
    path, ways = tmp_path / name, list(itertools.product(STOPS, (True, False)))
    if name not in ("run.npz", "scene.toml"):
        ways = [ways[NAMES.index(name) % 4]]
    for stop, there in ways:

        def fsync(_descriptor: int, stop: BaseException = stop) -> None:
            raise stop

        path.unlink(missing_ok=True)
        if there:
            path.write_bytes(OLD)
        monkeypatch.setattr(os, "fsync", fsync)
        with pytest.raises(type(stop)) as caught:
            savers[name](path)
        assert contents(tmp_path) == ({name: OLD} if there else {})
        if isinstance(caught.value, OSError):
            now = "the file there is unchanged" if there else "no file was left there"
            assert caught.value.errno == errno.ENOSPC and caught.value.filename == str(path)
            assert caught.value.strerror == f"No space left; {now}"
        monkeypatch.undo()
    path.write_bytes(OLD)
    savers[name](path)
    assert list(contents(tmp_path)) == [name]
    assert not path.read_bytes().startswith(OLD)


# --- full disks ----------------------------------------------------------------------------------


@contextmanager
def files_of_at_most(n_bytes: int) -> Iterator[None]:
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@posix
def test_a_disk_that_is_full(savers: dict[str, Callable[[Path], object]], tmp_path: Path) -> None:
    names = ["run.npz", "state.npz", "drive.toml", "scene.toml", "run.gif"]
    too_large = f"[Errno {errno.EFBIG}] File too large; "
    for name in names:
        old, new = tmp_path / name, tmp_path / f"new-{name}"
        old.write_bytes(OLD)
        for path, now in ((old, "the file there is unchanged"), (new, "no file was left there")):
            with files_of_at_most(100), pytest.raises(OSError) as caught:
                savers[name](path)
            assert str(caught.value) == f"{too_large}{now}: {str(path)!r}"
    out = tmp_path / "run.npz"
    with files_of_at_most(100):
        code, said = called(*CALL, "--out", out, "--quiet")
    assert code == 1
    assert said == f"beltdyn: cannot write {out}: File too large; the file there is unchanged\n"
    assert contents(tmp_path) == dict.fromkeys(names, OLD)


@pytest.mark.ci(guard="test_files.py::test_the_old_file_stays_until_the_new_one_is_complete")
@posix
def test_pictures_on_a_disk_that_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def simulate(params: bd.Params, torque: Any, t_end: float, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, t_end, t_eval=[0.0, 5e-4, 1e-3], **options)

    def fsync(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(commands, "simulate", simulate)
    monkeypatch.setattr("beltdyn.plot.overview", lambda result: Figure())
    monkeypatch.setattr(os, "fsync", fsync)
    for option, name in (("--plot", "a.png"), ("--animate", "a.gif")):
        path = tmp_path / name
        path.write_bytes(OLD)
        said = f"cannot write {path}: No space left on device; the file there is unchanged"
        assert called(*CALL, option, path, "--quiet") == (1, f"beltdyn: {said}\n")
    assert contents(tmp_path) == {"a.png": OLD, "a.gif": OLD}


@posix
def test_a_full_device(result: bd.Result) -> None:
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full here")
    with pytest.raises(OSError, match="No space left on device: '/dev/full'") as caught:
        result.save("/dev/full")
    assert caught.value.errno == errno.ENOSPC
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


# --- rights --------------------------------------------------------------------------------------


@contextmanager
def without_privileges() -> Iterator[None]:
    """Root may do everything, so be nobody meanwhile."""
    if os.geteuid() != 0:
        yield
        return
    groups, group = os.getgroups(), os.getresgid()
    os.setgroups([])
    os.setresgid(65534, 65534, group[2])
    os.setresuid(65534, 65534, 0)
    try:
        yield
    finally:
        os.setresuid(0, 0, 0)
        os.setresgid(*group)
        os.setgroups(groups)


@pytest.fixture
def public_folder() -> Iterator[Path]:
    """A folder that any user can get to, unlike pytest's."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    yield folder
    folder.chmod(0o755)
    shutil.rmtree(folder)


@posix
def test_without_rights(public_folder: Path, result: bd.Result) -> None:
    folder, state = public_folder, result.final_state
    (folder / "open").mkdir()
    for name, mode in (("good.npz", 0o666), ("locked.npz", 0o444), ("open/locked.npz", 0o444)):
        (folder / name).write_bytes(OLD)
        (folder / name).chmod(mode)
    (folder / "open").chmod(0o777)
    folder.chmod(0o555)
    protected = "the file there is write-protected"
    good = folder / "good.npz"
    with without_privileges():
        for name, why in (
            ("good.npz", "Permission denied; the file there is unchanged"),
            ("none.npz", "Permission denied; no file was left there"),
            ("locked.npz", protected),
            ("open/locked.npz", protected),
        ):
            with pytest.raises(PermissionError) as caught:
                state.save(folder / name)
            assert str(caught.value) == f"[Errno {errno.EACCES}] {why}: '{folder}/{name}'"
        # Found before the run: the file could be written, but none be made beside it.
        assert called(*CALL, "--out", good) == (
            2, f"beltdyn: cannot write {good}: Permission denied\n"
        )  # fmt: skip
    folder.chmod(0o755)
    assert contents(folder) == {"good.npz": OLD, "locked.npz": OLD}
    assert list(contents(folder / "open")) == ["locked.npz"]


def read_only(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Make it look like a folder of a file system that is mounted read-only, for root too."""
    really = os.open

    def refuse(path: Any, flags: int, *others: Any, **options: Any) -> int:
        if flags & os.O_CREAT and Path(path).parent == folder:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), os.fspath(path))
        return really(path, flags, *others, **options)

    patch.setattr(os, "open", refuse)


def test_a_read_only_file_system(
    result: bd.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any, **__: Any) -> Any:
        raise AssertionError("it ran")

    (tmp_path / "run.npz").write_bytes(OLD)
    read_only(monkeypatch, tmp_path)
    with pytest.raises(OSError, match="Read-only file system; the file there is unchanged"):
        result.save(tmp_path / "run.npz")
    monkeypatch.setattr(commands, "simulate", never)
    for option, name in (("--out", "run.npz"), ("--plot", "a.png"), ("--animate", "a.gif")):
        said = f"beltdyn: cannot write {tmp_path / name}: Read-only file system\n"
        assert called(*CALL, option, tmp_path / name) == (2, said)
    monkeypatch.setattr("beltdyn.kubas.runs", never)
    said = f"beltdyn: cannot write to {tmp_path}: Read-only file system\n"
    assert called("figures", "--out", tmp_path) == (2, said)


def test_no_such_folder(savers: dict[str, Callable[[Path], object]], tmp_path: Path) -> None:
    for name, save in savers.items():
        with pytest.raises(FileNotFoundError) as caught:
            save(tmp_path / "none" / name)
        assert caught.value.filename == str(tmp_path / "none" / name)
        with pytest.raises(IsADirectoryError, match="it is a folder"):
            (tmp_path / name).mkdir()
            save(tmp_path / name)


# --- what the file keeps -------------------------------------------------------------------------


@posix
def test_permission_bits_stay_and_a_new_file_respects_the_umask(
    result: bd.Result, tmp_path: Path
) -> None:
    path = tmp_path / "run.npz"
    for mode in (0o600, 0o640, 0o664, 0o755):
        path.write_bytes(OLD)
        path.chmod(mode)
        result.save(path)
        assert stat.S_IMODE(path.stat().st_mode) == mode
        assert bd.Result.load(path).t.size == 21
    for mask in (0o022, 0o077, 0o002):
        path.unlink()
        before = os.umask(mask)
        try:
            result.save(path)
        finally:
            os.umask(before)
        assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


@posix
@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can give away")
def test_the_owner_stays(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(OLD)
    os.chown(path, 65534, 65534)
    files.write_bytes(path, b"new")
    assert (path.stat().st_uid, path.stat().st_gid) == (65534, 65534)
    assert path.read_bytes() == b"new"


@posix
def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    real, link, link_to_link = tmp_path / "there" / "real", tmp_path / "link", tmp_path / "twice"
    link.symlink_to(Path("there") / "real")
    link_to_link.symlink_to(link)
    for content in (b"one", b"two"):  # first it leads nowhere yet
        files.write_bytes(link_to_link, content)
        assert real.read_bytes() == content and not real.is_symlink()
        assert link.is_symlink() and link_to_link.is_symlink()
    assert [entry.name for entry in real.parent.iterdir()] == ["real"]
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(OSError) as caught:
        files.write_bytes(tmp_path / "loop", b"")
    assert caught.value.errno == errno.ELOOP


@posix
def test_pipes_and_devices_are_written_to_as_they_are(result: bd.Result, tmp_path: Path) -> None:
    result.save(os.devnull)
    assert stat.S_ISCHR(os.stat(os.devnull).st_mode)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received: list[bytes] = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()))
    reader.start()
    result.save(pipe)
    reader.join(timeout=60)
    assert stat.S_ISFIFO(os.stat(pipe).st_mode)
    (tmp_path / "run.npz").write_bytes(received[0])
    assert bd.Result.load(tmp_path / "run.npz").final_state == result.final_state


@posix
def test_any_name_that_the_system_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("x" * 250, "." + "x" * 250, "a." + "b" * 240, "ä b\n.npz", ".npz", "x."):
        for path in (tmp_path / name, name):  # relative as well
            files.write_bytes(path, b"new")
            assert (tmp_path / name).read_bytes() == b"new"


def test_looking_leaves_nothing(tmp_path: Path) -> None:
    files.check_writable(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old").write_bytes(OLD)
    files.check_writable(tmp_path / "old")
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == [OLD]
