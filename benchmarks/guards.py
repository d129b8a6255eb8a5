"""Cost of the checks (guards) of a run together, on the paper's case 1.

    python benchmarks/guards.py [--quick] [--write]

The core with and without its checks (joints, winding, contact, balance of energy, progress, growth
of small differences), in turn in one process; the same without a ledger; and the checks of the
drive and of the result in Python, for 1001 samples. The additional calls of a torque function are
counted; torque objects need none.
"""

from __future__ import annotations

import time
import warnings
from typing import Any

import common
import numpy as np

import beltdyn as bd
from beltdyn import _core
from beltdyn.drive import sanity
from beltdyn.loads.torques import as_terms
from beltdyn.run import observed

SETTINGS = (("auto", 1e-4), ("rodas4", 1e-3), ("lbdf2", 1e-2))


def core_seconds(scene: bd.Scene, state: Any, t_end: float, **options: Any) -> tuple[float, Any]:
    terms = as_terms(scene.torque_fn, scene.params.pulley_names)
    run = _core.Simulation(scene.params._model, state, terms, t_end, **options)
    run.sample(np.linspace(0.0, t_end, 1001))
    begun = time.thread_time()
    while not run.advance(1.0):
        pass
    return time.thread_time() - begun, run.stats


def milliseconds_of(call: Any) -> float:
    times = []
    for _ in range(51):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return 1e3 * float(np.median(times))


def calls_of(scene: bd.Scene, state: bd.State, t_end: float, interval: float) -> int:
    count = 0

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return scene.torque_fn(t, theta, omega)

    bd.simulate(
        scene.params, torque, t_end, initial=state, method="rodas4", rtol=1e-2,
        torque_interval=interval, t_eval=[t_end],
    )  # fmt: skip
    return count


def row(method: str, rtol: float, repeats: int, *run: Any) -> str:
    seconds: dict[tuple[bool, bool], list[float]] = {}
    stats: Any = {}
    for _ in range(repeats):
        for ledger in (True, False):
            for guards in (False, True):
                spent, stats = core_seconds(
                    *run, method=method, rtol=rtol, ledger=ledger, guards=guards
                )
                seconds.setdefault((ledger, guards), []).append(spent)
    text = f"{method:7s} {rtol:6.0e}"
    for ledger in (True, False):
        without, guarded = (np.array(seconds[ledger, guards]) for guards in (False, True))
        text += f" {np.median(without):9.4f} {np.median(guarded):9.4f}"
        text += f" {np.median(guarded / without):7.3f}  "
    return text + f"{100.0 * stats['twin_steps'] / stats['steps']:9.2f} %"


def main() -> None:
    arguments = common.arguments(__doc__, "1 min", "3 s")
    warnings.simplefilter("ignore", bd.BeltdynWarning)
    repeats, t_end = (3, 0.1) if arguments.quick else (21, 1.0)
    scene = bd.scenes.kubas_case_1()
    rest = bd.settle(scene.params)
    state = rest._to_core(scene.params)
    lines = [
        f"case 1, {t_end:g} s simulated, 1001 samples: CPU s of the core",
        *common.machine(),
        f"medians of {repeats} rounds, in turn; ratios round by round",
        "",
        "                with a ledger                 without               steps of twins",
        "method   rtol   unguarded guarded   ratio   unguarded guarded   ratio",
    ]
    lines += [row(*setting, repeats, scene, state, t_end) for setting in SETTINGS]
    result = bd.simulate(*scene[:2], t_end, initial=rest)
    calls, without_looks = (calls_of(scene, rest, t_end, interval) for interval in (5e-4, 10.0))
    lines += [
        "",
        f"checks of the drive   {milliseconds_of(lambda: sanity.check(scene.params)):.3f} ms",
        f"checks of the result  {milliseconds_of(lambda: observed.observe(result)):.3f} ms",
        f"calls of a torque function, rodas4 at 1e-2: {calls}, and {without_looks} without looks",
    ]
    common.publish("guards", lines, arguments.write)


if __name__ == "__main__":
    main()
