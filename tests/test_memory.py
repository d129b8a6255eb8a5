"""More samples than memory are refused before anything runs; very many can be interrupted."""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path
from unittest import mock

import drives
import numpy as np
import pytest
from click.testing import CliRunner

import beltdyn as bd
from beltdyn import _core, cli
from beltdyn.outputs import selection as outputs
from beltdyn.run import memory

MANY = 400_000

pytestmark = pytest.mark.filterwarnings("ignore:long_links")  # 12 links are enough here


@pytest.fixture(scope="module")
def scene() -> bd.Scene:
    scene = drives.plain_scene()
    return scene._replace(params=bd.accuracy.with_links(scene.params, 12))


@pytest.fixture(scope="module")
def start(scene: bd.Scene) -> bd.State:
    return bd.settle(scene.params)


def test_samples_beyond_memory_are_refused_before_anything_runs(
    scene: bd.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "available", lambda: 1_500_000_000)
    for runs in ("beltdyn.run.run.settle", "beltdyn._core.Simulation"):
        monkeypatch.setattr(runs, mock.Mock(side_effect=AssertionError("it ran")))
    with pytest.raises(MemoryError) as caught:
        bd.simulate(*scene, t_eval=np.linspace(0.0, 1.0, 5 * MANY))
    assert str(caught.value) == (
        "t_eval is too long for the memory: the 2000000 samples need 3.12 GB, and 1.5 GB are "
        "available; take fewer times, or run in parts, each from the final_state of the one before"
    )


def test_what_the_samples_take_is_what_is_asked_for(
    scene: bd.Scene, start: bd.State, monkeypatch: pytest.MonkeyPatch
) -> None:
    for ledger in (True, False):
        params, terms = scene.params, scene.torque_fn.terms()
        run = _core.Simulation(params._model, start._to_core(params), terms, 1.0, ledger=ledger)
        names = outputs.of_core(None, ledger)
        arrays = run.sample(np.linspace(0.0, 1.0, 100), names).values()
        held = sum(array.nbytes for array in arrays)
        # What building the ledger takes besides, columns like the times.
        besides = 100 * 8 * 12 if ledger else 0
        needed = memory.check_samples(100, params._model.sizes, names, ledger)
        assert needed == held + besides
    monkeypatch.setattr(memory, "available", lambda: held)
    assert bd.simulate(*scene[:2], 1e-3, t_eval=np.linspace(0, 1e-3, 100), ledger=False).success
    monkeypatch.setattr(memory, "available", lambda: held - 1)
    with pytest.raises(MemoryError, match=r"^t_eval is too long"):
        bd.simulate(*scene[:2], 1e-3, t_eval=np.linspace(0, 1e-3, 100), ledger=False)
    monkeypatch.setattr(memory, "available", lambda: None)  # a system that does not tell
    assert bd.simulate(*scene[:2], 1e-3, t_eval=[0.0, 1e-3]).success


def test_memory_that_is_refused_after_all(
    scene: bd.Scene, start: bd.State, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusing = mock.Mock(**{"return_value.sample.side_effect": MemoryError("Unable to allocate")})
    monkeypatch.setattr("beltdyn.run.run._core.Simulation", refusing)
    with pytest.raises(MemoryError, match=r"^t_eval is too long .* which could not be had; take"):
        bd.simulate(*scene, initial=start)
    refusing.return_value.sample.side_effect = KeyboardInterrupt
    with pytest.raises(bd.Interrupted, match="before the first step, nothing was computed") as e:
        bd.simulate(*scene, initial=start)
    assert e.value.result is None


def test_the_command_line_says_it_without_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "available", lambda: 1000)
    done = CliRunner().invoke(cli.main, ["run", "kubas-case-1"])
    assert done.exit_code == 1 and done.stdout == ""
    assert done.stderr.startswith("beltdyn: t_eval is too long for the memory: the 1001 samples")
    assert len(done.stderr.splitlines()) == 1


def test_a_control_group_may_leave_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if sys.platform == "linux":  # this machine tells
        assert (memory.available() or 0) > 0

    def group(folder: Path, limit: str, used: str, stat: str = "") -> None:
        folder.mkdir(exist_ok=True)
        (folder / "memory.max").write_text(limit)
        (folder / "memory.current").write_text(used)
        (folder / "memory.stat").write_text(stat)

    group(tmp_path, "1000\n", "900\n", "anon 100\nactive_file 200\ninactive_file 100\n")
    group(tmp_path / "inner", "max\n", "10\n")
    assert memory._left(tmp_path, "/", "memory.max", "memory.current") == [400]
    assert memory._left(tmp_path, "/inner", "memory.max", "memory.current") == [400]
    group(tmp_path / "inner", "50\n", "80\n")
    assert memory._left(tmp_path, "/inner", "memory.max", "memory.current") == [0, 400]
    # In a container the names may be those of the host.
    assert memory._left(tmp_path, "/not/here", "memory.max", "memory.current") == [400]
    assert memory._left(tmp_path / "none", "/", "memory.max", "memory.current") == []
    monkeypatch.setattr(memory, "_of_machine", lambda: 700)
    monkeypatch.setattr(memory, "_of_group", lambda: 400)
    assert memory.available() == 400
    monkeypatch.setattr(memory, "_of_group", lambda: None)
    assert memory.available() == 700
    monkeypatch.setattr(memory, "_of_machine", lambda: None)
    assert memory.available() is None


@pytest.mark.usefixtures("handlers")
def test_making_the_arrays_can_be_interrupted(scene: bd.Scene, start: bd.State) -> None:
    """They are filled without the GIL, so that the timer's thread can send the signal meanwhile."""
    sim = _core.Simulation(scene.params._model, start._to_core(scene.params), [], 1.0)
    times = np.linspace(0.0, 1.0, MANY)
    timer = threading.Timer(0.02, lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        sim.sample(times)
        timer.join()  # a machine that fills 0.6 GB in 20 ms
    timer.join()
    if not sim.samples:  # nothing was kept: it can be done again, and the run goes on
        assert (sim.sample([0.0, 1e-3])["pulley"] == -1).all()
        assert not sim.advance(1e-3)
