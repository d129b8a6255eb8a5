"""More samples than memory are refused before anything runs; very many can be interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from click.testing import CliRunner

import beltdyn as bd
from beltdyn import _core, cli, memory

MANY = 400_000

pytestmark = pytest.mark.filterwarnings("ignore:long_links")  # 12 links are enough here


@pytest.fixture(scope="module")
def scene() -> bd.Scene:
    scene = drives.plain_scene()
    belt = attrs.evolve(scene.params.belt, n_bodies=12)
    return scene._replace(params=attrs.evolve(scene.params, belt=belt))


@pytest.fixture(scope="module")
def start(scene: bd.Scene) -> bd.State:
    return bd.settle(scene.params)


# --- too much ------------------------------------------------------------------------------------


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("it ran")


def test_samples_beyond_memory_are_refused_before_anything_runs(
    scene: bd.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "available", lambda: 1_500_000_000)
    monkeypatch.setattr("beltdyn.simulation.settle", never)
    monkeypatch.setattr("beltdyn._core.Simulation", never)
    with pytest.raises(MemoryError) as caught:
        bd.simulate(*scene, t_eval=np.linspace(0.0, 1.0, 5 * MANY))
    assert str(caught.value) == (
        "t_eval is too long for the memory: the 2000000 samples need 3.1 GB, and 1.5 GB are "
        "available; take fewer times, or run in parts, each from the final_state of the one before"
    )


def test_what_the_samples_take_is_what_is_asked_for(
    scene: bd.Scene, start: bd.State, monkeypatch: pytest.MonkeyPatch
) -> None:
    for ledger in (True, False):
        params, terms = scene.params, scene.torque_fn.terms()
        run = _core.Simulation(params._model, start._to_core(params), terms, 1.0, ledger=ledger)
        arrays = run.sample(np.linspace(0.0, 1.0, 100)).values()
        held = sum(array.nbytes for array in arrays)
        # What building the ledger takes besides, columns like the times.
        besides = 100 * 8 * 12 if ledger else 0
        columns = len(scene.params._model.energy_terms) if ledger else 0
        assert memory.check_samples(100, 12, 2, 0, columns, friction=True) == held + besides
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
    class Refusing:
        def __init__(self, *_: Any, **__: Any) -> None:
            pass

        def sample(self, _times: Any) -> Any:
            raise MemoryError("Unable to allocate")

    monkeypatch.setattr("beltdyn.simulation._core.Simulation", Refusing)
    with pytest.raises(MemoryError, match=r"^t_eval is too long .* which could not be had; take"):
        bd.simulate(*scene, initial=start)


def test_the_command_line_says_it_without_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "available", lambda: 1000)
    done = CliRunner().invoke(cli.main, ["run", "kubas-case-1"])
    assert done.exit_code == 1 and done.stdout == ""
    assert done.stderr.startswith("beltdyn: t_eval is too long for the memory: the 1001 samples")
    assert len(done.stderr.splitlines()) == 1


# --- how much there is ---------------------------------------------------------------------------


def test_this_machine_tells() -> None:
    there = memory.available()
    if sys.platform == "linux":
        assert there is not None and there > 0


def test_a_control_group_may_leave_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


# --- very many samples and Ctrl-C ----------------------------------------------------------------


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
    if not sim.samples:
        # Nothing was kept: it can be done again, and the run goes on.
        assert (sim.sample([0.0, 1e-3])["pulley"] == -1).all()
        assert not sim.advance(1e-3)


@pytest.mark.ci(guard="test_memory.py::test_making_the_arrays_can_be_interrupted")
@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("amid", ["sample", "advance"])
def test_ctrl_c_with_very_many_samples(
    scene: bd.Scene, start: bd.State, monkeypatch: pytest.MonkeyPatch, amid: str
) -> None:
    """While the arrays are made, or the run goes on; counted from then on a slow machine too."""
    timer = threading.Timer(0.02, lambda: os.kill(os.getpid(), signal.SIGINT))
    real = _core.Simulation

    class Timed:
        def __init__(self, *arguments: Any, **options: Any) -> None:
            self.real = real(*arguments, **options)

        def __getattr__(self, name: str) -> Any:
            if name == amid and not timer.ident:
                timer.start()
            return getattr(self.real, name)

    monkeypatch.setattr("beltdyn.simulation._core.Simulation", Timed)
    times = np.linspace(0.0, 100.0, MANY)
    with pytest.raises(bd.Interrupted) as caught:
        bd.simulate(scene.params, scene.torque_fn, 100.0, initial=start, t_eval=times)
    timer.join()
    result = caught.value.result
    if result is None:
        assert str(caught.value) == "interrupted before the first step, nothing was computed"
    else:
        # All samples, if it came while the result was built.
        assert result.status == "interrupted" and result.t.size <= MANY
        assert np.isfinite(result.belt.x).all() and len(result.belt.x) == result.t.size


SMALL = """
import resource, sys
import numpy as np
sys.path.insert(0, sys.argv[1])
import beltdyn as bd, drives
scene = drives.plain_scene()
start = bd.settle(scene.params)
size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
limit = size + (256 << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    bd.simulate(*scene, initial=start, t_eval=np.linspace(0.0, 1.0, 100_000))
except MemoryError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_AS")
@pytest.mark.ci(guard="test_memory.py::test_samples_beyond_memory_are_refused_before_anything_runs")
def test_a_process_that_may_have_less_than_there_is() -> None:
    command = [sys.executable, "-c", SMALL, str(Path(__file__).parent)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.stdout.startswith("t_eval is too long for the memory: the 100000 samples need ")
    assert ", which could not be had; take fewer times" in done.stdout
