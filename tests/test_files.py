"""Writing files whole or not at all: kills, full disks, missing rights, links, pipes, Ctrl-C."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import drives
import numpy as np
import pytest
from click.testing import CliRunner

import beltdyn as bd
from beltdyn import cli, files
from beltdyn.cli import commands, written

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX files and processes")
OLD = b"what was there before"


@pytest.fixture(scope="module")
def result() -> bd.Result:
    scene = drives.plain_scene()
    return bd.simulate(scene.params, scene.torque_fn, 1e-3, t_eval=np.linspace(0.0, 1e-3, 21))


@pytest.fixture(scope="module")
def savers(result: bd.Result) -> dict[str, Callable[[Path], object]]:
    """Give everything that writes a file, by the name of the file."""
    scene = drives.plain_scene()
    film = bd.plot.animate(result, duration=0.1)
    return {
        "run.npz": result.save,
        "state.npz": result.final_state.save,
        "drive.toml": scene.params.to_toml,
        "scene.toml": scene.to_toml,
        "run.png": lambda path: written._draw(result, path),
        "run.gif": lambda path: film.save(path, dpi=30),
        "run.html": lambda path: film.save(path, dpi=30),
        "run.mp4": lambda path: film.save(path, dpi=40),
    }


NAMES = [
    "run.npz", "state.npz", "drive.toml", "scene.toml", "run.png", "run.gif", "run.html", "run.mp4",
]  # fmt: skip


def python(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter that sees the tests' modules."""
    path = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    command = [sys.executable, "-c", path + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


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
for _ in range(50):
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
def test_killed_at_any_moment_the_file_is_the_old_or_the_new(tmp_path: Path) -> None:
    done = python(KILLS, tmp_path / "run.npz")
    assert done.returncode == 0, done.stderr
    seen, cut_short = map(int, done.stdout.split())
    assert seen == 2
    # Only a killed process leaves its temporary file: it shows that some were amid writing.
    assert cut_short > 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("stop", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left")])
@pytest.mark.parametrize("there", [True, False])
def test_what_stops_it_leaves_what_was_there(
    savers: dict[str, Callable[[Path], object]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    stop: BaseException,
    there: bool,
) -> None:
    def fsync(_descriptor: int) -> None:
        raise stop

    path = tmp_path / name
    if there:
        path.write_bytes(OLD)
    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(type(stop)) as caught:
        savers[name](path)
    assert [(entry.name, entry.read_bytes()) for entry in tmp_path.iterdir()] == (
        [(name, OLD)] if there else []
    )
    if isinstance(caught.value, OSError):
        now = "the file there is unchanged" if there else "no file was left there"
        assert caught.value.errno == errno.ENOSPC and caught.value.filename == str(path)
        assert caught.value.strerror == f"No space left; {now}"


@pytest.mark.parametrize("name", NAMES)
def test_the_new_file_takes_the_place_of_the_old(
    savers: dict[str, Callable[[Path], object]], tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(OLD)
    savers[name](path)
    assert [entry.name for entry in tmp_path.iterdir()] == [name]
    assert not path.read_bytes().startswith(OLD)


# --- full disks ----------------------------------------------------------------------------------

FULL = """
import resource, sys, warnings
from pathlib import Path
import numpy as np
import beltdyn as bd, drives
from beltdyn import cli
import matplotlib.font_manager

warnings.simplefilter("ignore")

scene = drives.plain_scene()
result = bd.simulate(scene.params, scene.torque_fn, 1e-3, t_eval=np.linspace(0, 1e-3, 21))
folder = Path(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
for name, save in {
    "run.npz": result.save,
    "state.npz": result.final_state.save,
    "drive.toml": scene.params.to_toml,
    "scene.toml": scene.to_toml,
    "run.gif": bd.plot.animate(result, duration=0.1).save,
}.items():
    for path in (folder / name, folder / f"new-{name}"):
        try:
            save(path)
        except OSError as error:
            print(error)
cli.main(sys.argv[2:])
"""


@posix
def test_a_disk_that_is_full(tmp_path: Path) -> None:
    names = ["drive.toml", "run.gif", "run.npz", "scene.toml", "state.npz"]
    for name in names:
        (tmp_path / name).write_bytes(OLD)
    out = tmp_path / "run.npz"
    done = python(FULL, tmp_path, "run", "kubas-case-1", "--t-end", "1e-3", "--out", out)
    lines = done.stdout.splitlines()
    assert len(lines) == 10, done
    for name in names:
        old, new = tmp_path / name, tmp_path / f"new-{name}"
        too_large = f"[Errno {errno.EFBIG}] File too large; "
        assert f"{too_large}the file there is unchanged: {str(old)!r}" in lines
        assert f"{too_large}no file was left there: {str(new)!r}" in lines
    assert done.returncode == 1
    assert done.stderr == (
        f"beltdyn: cannot write {out}: File too large; the file there is unchanged\n"
    )
    assert {entry.name: entry.read_bytes() for entry in tmp_path.iterdir()} == dict.fromkeys(
        names, OLD
    )


@posix
@pytest.mark.parametrize(("option", "name"), [("--plot", "a.png"), ("--animate", "a.gif")])
def test_pictures_on_a_disk_that_is_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str, name: str
) -> None:
    def simulate(params: bd.Params, torque: Any, t_end: float, **options: Any) -> bd.Result:
        return bd.simulate(params, torque, t_end, t_eval=[0.0, 5e-4, 1e-3], **options)

    def fsync(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(commands, "simulate", simulate)
    monkeypatch.setattr(os, "fsync", fsync)
    path = tmp_path / name
    path.write_bytes(OLD)
    call = ["run", "kubas-case-1", "--t-end", "1e-3", option, str(path), "--quiet"]
    done = CliRunner().invoke(cli.main, call)
    assert done.exit_code == 1
    assert done.stderr == (
        f"beltdyn: cannot write {path}: No space left on device; the file there is unchanged\n"
    )
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == [OLD]


@posix
def test_a_full_device(result: bd.Result) -> None:
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full here")
    with pytest.raises(OSError, match="No space left on device: '/dev/full'") as caught:
        result.save("/dev/full")
    assert caught.value.errno == errno.ENOSPC
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


# --- rights --------------------------------------------------------------------------------------

RIGHTS = """
import os, sys
from pathlib import Path
import beltdyn as bd, drives
from beltdyn import cli, saved

folder = Path(sys.argv[1])
state = bd.settle(drives.plain())
state.save(folder / "good.npz")
for name, mode in (("good.npz", 0o666), ("locked.npz", 0o444)):
    (folder / name).write_bytes(b"old")
    (folder / name).chmod(mode)
(folder / "open").mkdir()
(folder / "open" / "locked.npz").write_bytes(b"old")
(folder / "open" / "locked.npz").chmod(0o444)
(folder / "open").chmod(0o777)
folder.chmod(0o555)
if os.geteuid() == 0:  # root may do everything
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
for name in ("good.npz", "none.npz", "locked.npz", "open/locked.npz"):
    try:
        state.save(folder / name)
    except PermissionError as error:
        print(error)
cli.main(["run", "kubas-case-1", "--out", str(folder / "good.npz")])
"""


@pytest.fixture
def public_folder() -> Iterator[Path]:
    """Give a folder that any user can get to, unlike pytest's."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    yield folder
    folder.chmod(0o755)
    shutil.rmtree(folder)


@posix
def test_without_rights(public_folder: Path) -> None:
    folder = public_folder
    done = python(RIGHTS, folder)
    denied, protected = (f"[Errno {errno.EACCES}] {why}" for why in ("Permission denied", "the"))
    assert done.stdout.splitlines() == [
        f"{denied}; the file there is unchanged: '{folder}/good.npz'",
        f"{denied}; no file was left there: '{folder}/none.npz'",
        f"{protected} file there is write-protected: '{folder}/locked.npz'",
        f"{protected} file there is write-protected: '{folder}/open/locked.npz'",
    ], done.stderr
    # Found before the run: the file could be written, but none be made beside it.
    assert done.returncode == 2
    assert done.stderr == f"beltdyn: cannot write {folder}/good.npz: Permission denied\n"
    folder.chmod(0o755)
    found = {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.is_file()}
    assert found == {"good.npz": b"old", "locked.npz": b"old"}
    assert [entry.name for entry in (folder / "open").iterdir()] == ["locked.npz"]


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
        call = ["run", "kubas-case-1", option, str(tmp_path / name)]
        done = CliRunner().invoke(cli.main, call)
        assert done.exit_code == 2
        assert done.stderr == f"beltdyn: cannot write {tmp_path / name}: Read-only file system\n"
    monkeypatch.setattr("beltdyn.kubas.runs", never)
    done = CliRunner().invoke(cli.main, ["figures", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert done.stderr == f"beltdyn: cannot write to {tmp_path}: Read-only file system\n"


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
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
def test_permission_bits_stay(result: bd.Result, tmp_path: Path, mode: int) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(OLD)
    path.chmod(mode)
    result.save(path)
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert bd.Result.load(path).t.size == 21


@posix
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_a_new_file_respects_the_umask(result: bd.Result, tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        result.save(tmp_path / "run.npz")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "run.npz").stat().st_mode) == 0o666 & ~mask


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
def test_any_name_that_the_system_takes(tmp_path: Path) -> None:
    for name in ("x" * 250, "." + "x" * 250, "a." + "b" * 240, "ä b\n.npz", ".npz", "x."):
        files.write_bytes(tmp_path / name, b"new")
        assert (tmp_path / name).read_bytes() == b"new"


def test_relative_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files.write_bytes("name", b"new")
    assert (tmp_path / "name").read_bytes() == b"new"


def test_looking_leaves_nothing(tmp_path: Path) -> None:
    files.check_writable(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old").write_bytes(OLD)
    files.check_writable(tmp_path / "old")
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == [OLD]
