"""Short runs of a coarse belt for tests of sweeps: scenes, the same by hand, and every executor."""

from __future__ import annotations

import ctypes
import logging
import math
import pickle
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import attrs
import drives
import mounted_drives
import numpy as np

import beltdyn as bd
from beltdyn.many import dispatch, store
from beltdyn.sweeping.sweep import Swept, run_sweep

#: Texts at the start of a program in another process, which then finds the modules of the tests.
PATH = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
SCALES = [0.0, 0.5, 1.0]


def plain(t_end: float = 2e-3, n_bodies: int = 20) -> bd.Scene:
    """On few links, so that a run takes milliseconds."""
    return with_belt(drives.plain_scene(), n_bodies=n_bodies)._replace(t_end=t_end)


def small(t_end: float = 2e-3) -> bd.Scene:
    """Two named pulleys, a torque and a load of its own, which have fields to be swept."""
    scene = plain(t_end, 24)
    crank, fan = scene.params.pulleys
    named = attrs.evolve(crank, name="crank"), attrs.evolve(fan, name="fan")
    torque = bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-40.0, 0.0]])
    return scene._replace(
        params=attrs.evolve(scene.params, pulleys=named),
        torque_fn=torque + bd.Load("fan", viscous=0.5, quadratic=1e-3),
    )


def alone(scene: bd.Scene, **options: Any) -> bd.Result:
    """A run by itself."""
    return bd.simulate(scene.params, scene.torque_fn, scene.t_end, scene.motion, **options)


def under_function(gain: float = 40.0) -> bd.Scene:
    """Under a Python function that encloses a number."""
    return plain()._replace(
        torque_fn=lambda t, _theta, omega: [-gain * min(1.0, t / 1e-3), -2.0 * float(omega[1])]
    )


def with_belt(scene: bd.Scene, **changes: Any) -> bd.Scene:
    """The scene with numbers of the belt changed."""
    return scene._replace(params=drives.with_belt(scene.params, **changes))


def bits(values: Any) -> bytes:
    """All bits of numbers."""
    return np.ascontiguousarray(np.asarray(values, dtype=float)).tobytes()


def moved() -> bd.Scene:
    """Its first pulley follows a speed, from running on."""
    speed = bd.PiecewiseLinear([0.0, 1e-3, 2e-3], [-10.0, -11.0, -11.0])
    return plain()._replace(motion={0: speed}, torque_fn=bd.Viscous([0.0, 2.0]))


def mounted() -> bd.Scene:
    """With a tensioner on an arm."""
    params = mounted_drives.tensioner()
    return bd.Scene(params, mounted_drives.torque(params), 2e-3)


DOUBLES = ctypes.POINTER(ctypes.c_double)


@ctypes.CFUNCTYPE(None, ctypes.c_double, DOUBLES, DOUBLES, DOUBLES, ctypes.c_void_p)
def compiled(_t: float, _theta: Any, omega: Any, torque: Any, _user: Any) -> None:
    torque[0], torque[1] = -20.0, -omega[1]


def _sent(payload: bytes) -> Any:
    work, args = pickle.loads(payload)
    return pickle.loads(pickle.dumps(work(*args)))


class Sent(Executor):
    """Workers in this process that are told everything in bytes, as those in others are.

    A batch in which "lethal" stands kills them all, as one that ends its process does.
    """

    def __init__(self) -> None:
        self._threads, self._dead, self.jobs = ThreadPoolExecutor(2), False, 0

    def submit(self, work: Any, /, *args: Any, **_: Any) -> Future[Any]:
        self.jobs += 1
        if self._dead:
            raise BrokenExecutor("a worker died before")
        payload = pickle.dumps((work, args))
        if b"lethal" in payload:
            self._dead = True
            killed: Future[Any] = Future()
            killed.set_exception(BrokenExecutor("a worker died"))
            return killed
        return self._threads.submit(_sent, payload)

    def shutdown(self, wait: bool = True, **_: Any) -> None:
        self._threads.shutdown(wait)


@contextmanager
def cluster(workers: int = 2, processes: bool = True) -> Iterator[Any]:
    """A Dask client of a scheduler and workers of one thread each."""
    import distributed

    # A busy machine starts workers slowly; one death less before a batch is given up spares starts.
    settings = {
        "distributed.deploy.lost-worker-timeout": "5 minutes",
        "distributed.scheduler.allowed-failures": 1,
    }
    with (
        import_module("dask").config.set(settings),
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=processes,
            dashboard_address=":0",
            silence_logs=logging.CRITICAL,
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


def do(scene: Any, over: Any, measure: Any = None, **options: Any) -> Swept:
    """Do a sweep, quietly, with everything that it tells of itself."""
    given: dict[str, Any] = {"combine": "grid", "executor": "threads", "store": None, "warm": None}
    given |= {"last": 0.2, "progress": False, "key": ""}
    return run_sweep(scene, over, measure, **{**given, **options})


def go_on_slowly(folder: str, parts: int) -> None:
    """Have this process write parts whenever it can, and once there are some go on slowly.

    So that signals reach a sweep on its way, however loaded the machine.
    """
    store._LEAST = 0.0
    hand_out = dispatch.Dispatch._hand_out

    def slowly(self: dispatch.Dispatch) -> None:
        time.sleep(0.5 if len(list(Path(folder).glob("part-*.sqlite"))) >= parts else 0.0)
        hand_out(self)

    dispatch.Dispatch._hand_out = slowly  # type: ignore[method-assign]


#: What tests measure: numbers and histories, none of them a time that something took.
MEASURE = ["span_tension", "pulleys.omega.final", "stats.steps", "stats.method"]
TIMES = [1e-3, 2e-3]


#: name: arguments of a sweep, made anew for every test.
def cases() -> dict[str, dict[str, Any]]:
    plain_over = {"torque.scale": SCALES, "friction.mu_k": [0.5, 1.0]}
    samples = bd.sample({"torque.scale": (0.5, 1.0), "friction.mu_k": (0.5, 1.0)}, 4, seed=1)
    listed = [
        {"belt.axial_stiffness": 7e4, "t_end": 2e-3},
        {"belt.axial_stiffness": 6e4, "t_end": 2.5e-3},
        {"belt.axial_stiffness": -1.0, "t_end": 2e-3},
    ]
    return {
        "grid": {"scene": plain(), "over": plain_over},
        "zip": {
            "scene": plain(),
            "over": {"torque.scale": SCALES, "friction.mu_k": [0.5, 0.7, 1.0]},
            "combine": "zip",
        },
        "list": {"scene": plain(), "over": listed},
        "samples": {"scene": plain(), "over": samples},
        "warm": {"scene": plain(), "over": plain_over, "warm": "torque.scale"},
        "mount": {
            "scene": mounted(),
            "over": {"pulleys[1].mount.stiffness": [15.0, 20.0], "rtol": [1e-3, 1e-4]},
        },
        "lambda": {
            "scene": under_function(),
            "over": {"belt.axial_damping": [1.0, 2.0], "torque.scale": [1, 2]},
        },
        "own motion": {
            "scene": moved()._replace(motion={0: lambda t: -10.0 + math.sin(100.0 * t)}),
            "over": {"motion.scale": [1.0, 1.5], "belt.n_bodies": [20, 24]},
        },
    }


def same(one: Any, other: Any) -> None:
    """Hold two Datasets to each other, to the last bit, with all texts."""
    assert one.identical(other), f"{one}\n\n{other}"
    for name, array in one.variables.items():
        assert repr(array.values.tolist()) == repr(other[name].values.tolist()), name
