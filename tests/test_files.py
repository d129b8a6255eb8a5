"""Writing files whole or not at all: kills, full disks, missing rights, links, pipes, Ctrl-C."""

from __future__ import annotations

import errno
import itertools
import multiprocessing
import os
import random
import stat
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import attrs
import drives
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

import beltdyn as bd
from beltdyn import cli
from beltdyn.base import files, sqlite
from beltdyn.cli import commands, written

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX files and processes")
Savers = dict[str, Callable[[Path], object]]
OLD = b"what was there before"
CALL = ("run", "kubas-case-1", "--t-end", "1e-3")


@pytest.fixture(scope="module")
def result() -> bd.Result:
    scene = drives.plain_scene()
    return bd.simulate(scene.params, scene.torque_fn, 1e-3, t_eval=np.linspace(0.0, 1e-3, 21))


@pytest.fixture(scope="module")
def savers(result: bd.Result) -> Savers:
    """Everything that writes a file, by the name of the file."""
    scene, film = drives.plain_scene(), bd.plot.animate(result, duration=0.1)
    film._draw_was_started = True  # not every test draws it
    return {
        "run.npz": result.save,
        "state.npz": result.final_state.save,
        "scene.toml": scene.to_toml,
        "drive.toml": scene.params.to_toml,
        "run.png": lambda path: written.save_figure(Figure(), path),
        "run.gif": lambda path: film.save(path, dpi=30),
        "run.html": lambda path: film.save(path, dpi=30),
        "run.mp4": lambda path: film.save(path, dpi=40),
    }


SMALL = ["run.npz", "state.npz", "scene.toml", "drive.toml", "run.png"]


def contents(folder: Path) -> dict[str, bytes]:
    return {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.is_file()}


def called(*arguments: object) -> tuple[int, str]:
    """Exit code and stderr of the command line."""
    done = CliRunner().invoke(cli.main, [str(argument) for argument in arguments])
    return done.exit_code, done.stderr


def save_for_ever(target: Path, runs: list[bd.Result]) -> None:
    for run in itertools.cycle(runs):
        run.save(target)


@posix
@pytest.mark.ci(guard="test_files.py::test_the_old_file_stays_until_the_new_one_is_complete")
def test_killed_at_any_moment_the_file_is_the_old_or_the_new(
    result: bd.Result, tmp_path: Path
) -> None:
    target, moments, seen = tmp_path / "run.npz", random.Random(1), set()
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["beltdyn", "click", "matplotlib.figure", "pytest"])
    other = attrs.evolve(result, belt=attrs.evolve(result.belt, x=result.belt.x + 1.0))
    result.save(target)
    for _ in range(15):
        before = target.stat().st_ino
        process = processes.Process(target=save_for_ever, args=(target, [other, result]))
        process.start()
        while target.stat().st_ino == before:
            assert process.is_alive()
        time.sleep(moments.uniform(0.0, 0.02))
        process.kill()
        process.join()
        found = bd.Result.load(target)
        moved = float((found.belt.x - result.belt.x)[0, 0])
        np.testing.assert_array_equal(found.belt.x, (other if moved else result).belt.x)
        seen.add(moved)
    assert len(seen) == 2
    # Only a killed process leaves its temporary file: it shows that some were amid writing.
    assert len(list(tmp_path.iterdir())) > 1


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", [*SMALL, "run.gif", "run.html", "run.mp4"])
def test_the_old_file_stays_until_the_new_one_is_complete(
    savers: Savers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = tmp_path / name
    for there in (False, True) if name in SMALL else (True,):
        if there:
            path.write_bytes(OLD)
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(os, "fsync", Mock(side_effect=KeyboardInterrupt))
            savers[name](path)
        assert contents(tmp_path) == ({name: OLD} if there else {})
    savers[name](path)
    assert list(contents(tmp_path)) == [name]
    assert not path.read_bytes().startswith(OLD)


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
def test_a_disk_that_is_full(
    savers: Savers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was there stays; the command line says so of a result and a picture."""
    unchanged = "File too large; the file there is unchanged"
    for name in SMALL:
        (tmp_path / name).write_bytes(OLD)
        for path, now in (
            (tmp_path / name, unchanged),
            (tmp_path / f"new-{name}", "File too large; no file was left there"),
        ):
            with files_of_at_most(100), pytest.raises(OSError) as caught:
                savers[name](path)
            assert str(caught.value) == f"[Errno {errno.EFBIG}] {now}: {str(path)!r}"
    monkeypatch.setattr("beltdyn.plot.overview", lambda result: Figure())
    for option, name in (("--out", "run.npz"), ("--plot", "run.png")):
        with files_of_at_most(100):
            code, said = called(*CALL, option, tmp_path / name, "--quiet")
        assert (code, said) == (1, f"beltdyn: cannot write {tmp_path / name}: {unchanged}\n")
    assert contents(tmp_path) == dict.fromkeys(SMALL, OLD)


@contextmanager
def without_privileges() -> Iterator[None]:
    """Root may do everything, so be nobody meanwhile."""
    root = os.geteuid() == 0
    if root:
        os.setresuid(65534, 65534, 0)
    try:
        yield
    finally:
        if root:
            os.setresuid(0, 0, 0)


@pytest.fixture
def public_folder() -> Iterator[Path]:
    """A folder that any user can get to, unlike pytest's."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)
        Path(folder).chmod(0o755)


@posix
def test_a_write_that_was_cut_off_is_taken_back_where_one_may_write(public_folder: Path) -> None:
    file, tables = public_folder / "file", "CREATE TABLE rows (content BLOB);"
    torn, journal = file.with_name("torn"), file.with_name("torn-journal")
    with sqlite.created(file, tables) as db:
        db.execute("INSERT INTO rows VALUES (zeroblob(90000))")
    with (
        closing(sqlite.opened(file, tables, write=True)) as db,
        pytest.raises(KeyboardInterrupt),
        sqlite.written(db, file),
    ):
        db.execute("PRAGMA cache_size = 1")
        db.execute("UPDATE rows SET content = zeroblob(180000)")
        torn.write_bytes(file.read_bytes())
        journal.write_bytes(file.with_name("file-journal").read_bytes())
        raise KeyboardInterrupt
    for mode in (0o666, 0o444):
        torn.chmod(mode)
        journal.chmod(mode)
        public_folder.chmod(0o555)
        with (
            without_privileges(),
            pytest.raises(OSError, match="taken back by torn-journal beside it: copy both"),
        ):
            sqlite.opened(torn, tables)
    public_folder.chmod(0o755)
    sqlite.opened(torn, tables).close()
    assert torn.read_bytes() == file.read_bytes() and not journal.exists()


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


def test_a_read_only_file_system(
    result: bd.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It looks as if it were mounted so, for root too."""
    really = os.open

    def refuse(path: Any, flags: int, *others: Any, **options: Any) -> int:
        if flags & os.O_CREAT and Path(path).parent == tmp_path:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), os.fspath(path))
        return really(path, flags, *others, **options)

    def never(*_: Any, **__: Any) -> Any:
        raise AssertionError("it ran")

    (tmp_path / "run.npz").write_bytes(OLD)
    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(OSError, match="Read-only file system; the file there is unchanged"):
        result.save(tmp_path / "run.npz")
    monkeypatch.setattr(commands, "simulate", never)
    monkeypatch.setattr("beltdyn_kubas.runs", never)
    for option, name in (("--out", "run.npz"), ("--plot", "a.png"), ("--animate", "a.gif")):
        said = f"beltdyn: cannot write {tmp_path / name}: Read-only file system\n"
        assert called(*CALL, option, tmp_path / name) == (2, said)
    said = f"beltdyn: cannot write to {tmp_path}: Read-only file system\n"
    assert called("figures", "--out", tmp_path) == (2, said)


def test_no_such_folder(savers: Savers, tmp_path: Path) -> None:
    for name, save in savers.items():
        with pytest.raises(FileNotFoundError) as caught:
            save(tmp_path / "none" / name)
        assert caught.value.filename == str(tmp_path / "none" / name)
        with pytest.raises(IsADirectoryError, match="it is a folder"):
            (tmp_path / name).mkdir()
            save(tmp_path / name)


@posix
def test_permission_bits_and_owner_stay_and_a_new_file_respects_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for mode in (0o600, 0o640, 0o664, 0o755):
        path.write_bytes(OLD)
        path.chmod(mode)
        files.write_bytes(path, b"new")
        assert stat.S_IMODE(path.stat().st_mode) == mode and path.read_bytes() == b"new"
    if os.geteuid() == 0:  # only root can give away
        os.chown(path, 65534, 65534)
        files.write_bytes(path, b"newer")
        assert (path.stat().st_uid, path.stat().st_gid) == (65534, 65534)
    for mask in (0o022, 0o077, 0o002):
        path.unlink()
        before = os.umask(mask)
        try:
            files.write_bytes(path, b"new")
        finally:
            os.umask(before)
        assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


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
    if os.path.exists("/dev/full"):
        with pytest.raises(OSError, match="No space left on device: '/dev/full'") as caught:
            result.save("/dev/full")
        assert caught.value.errno == errno.ENOSPC
        assert stat.S_ISCHR(os.stat("/dev/full").st_mode)
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
    """To look whether a file can be written leaves nothing, and what was there."""
    monkeypatch.chdir(tmp_path)
    for name in ("x" * 250, "." + "x" * 250, "a." + "b" * 240, "ä b\n.npz", ".npz", "x."):
        files.check_writable(tmp_path / name)
        assert contents(tmp_path) == {}
        for path in (tmp_path / name, name):  # relative as well
            files.write_bytes(path, b"new")
            files.check_writable(path)
            assert contents(tmp_path) == {name: b"new"}
        (tmp_path / name).unlink()
