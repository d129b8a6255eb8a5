"""What a sweep takes besides its runs, in threads and in a Dask cluster, and what threads bring.

    python benchmarks/sweep.py [--quick] [--write]

The paper's case 1 under factors on its torque, so that all runs share one settled state, and all
torques are evaluated in the core. Speed: wall time in one thread over that in two, of as many runs
on 60 and on 240 links. Overhead: wall time of a sweep over that of the same runs in a loop written
by hand, `simulate` in a `ThreadPoolExecutor` of two threads from one settled state; for a Dask
cluster of two worker processes with one thread each (local, with a real scheduler, started and
warm) the loop runs in two processes, each half of it. Wall times alternate; their medians count.
"""

from __future__ import annotations

import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Any

import common

import beltdyn as bd

WORKERS = 2
#: Simulated time [s] of a run of some 50 ms on 60 links, and of one as long on 240.
T_END = {60: 0.2, 240: 0.15}
MEASURE = ["span_tension.least", "pulleys.omega.final"]
OUTPUTS = ("span_tension", "pulleys.omega")
SAMPLES = 101

warnings.simplefilter("ignore", bd.BeltdynWarning)


def scene(n_bodies: int) -> bd.Scene:
    found = common.with_belt(bd.scenes.kubas_case_1(), n_bodies=n_bodies)
    return found._replace(t_end=T_END[n_bodies])


def times(of: bd.Scene) -> list[float]:
    return [of.t_end * k / (SAMPLES - 1) for k in range(SAMPLES)]


def factors(runs: int) -> list[float]:
    return [0.2 + 0.6 * k / runs for k in range(runs)]


def swept(of: bd.Scene, runs: int, executor: Any) -> float:
    """Wall time of a sweep [s]."""
    begun = time.perf_counter()
    found = bd.sweep(
        of,
        {"torque.scale": factors(runs)},
        MEASURE,
        executor=executor,
        progress=False,
        t_eval=times(of),
    )
    taken = time.perf_counter() - begun
    assert (found.status == "finished").all(), set(found.message.values.tolist())
    return taken


def by_hand(of: bd.Scene, scales: Sequence[float], state: bd.State) -> list[float]:
    """Run one after the other; the least tensions."""
    least = []
    for scale in scales:
        torque: Any = of.torque_fn
        result = bd.simulate(
            of.params,
            torque * scale,
            of.t_end,
            initial=state,
            t_eval=times(of),
            outputs=OUTPUTS,
        )
        least.append(float(result.span_tension.min()))
    return least


def loop(of: bd.Scene, runs: int, pool: Any) -> float:
    """Wall time of the loop written by hand [s], shared out evenly."""
    begun = time.perf_counter()
    state = bd.settle(of.params)
    scales = factors(runs)
    if isinstance(pool, ThreadPoolExecutor):
        list(pool.map(lambda one: by_hand(of, [one], state), scales))
    else:
        parts = [scales[k::WORKERS] for k in range(WORKERS)]
        list(pool.map(by_hand, [of] * WORKERS, parts, [state] * WORKERS))
    return time.perf_counter() - begun


def medians(repeats: int, *ways: Callable[[], float]) -> list[float]:
    """Medians of what each way takes, in turns."""
    taken: list[list[float]] = [[] for _ in ways]
    for _ in range(repeats):
        for way, rows in zip(ways, taken, strict=True):
            rows.append(way())
    return [statistics.median(rows) for rows in taken]


def in_threads(runs: int, repeats: int) -> list[str]:
    lines = [
        f"Speed of two threads, {runs} runs",
        "links   one run   one thread   two threads   times",
    ]
    for n_bodies in T_END:
        common.progress(f"threads, {n_bodies} links")
        of = scene(n_bodies)
        one, two = medians(repeats, partial(swept, of, runs, 1), partial(swept, of, runs, WORKERS))
        lines.append(
            f"{n_bodies:5d}{1e3 * one / runs:7.1f} ms{one:11.2f} s{two:12.2f} s{one / two:8.2f}"
        )
    return lines


def overhead(runs: int, repeats: int) -> list[str]:
    from distributed import Client, LocalCluster

    of = scene(60)
    common.progress("overhead, threads")
    with ThreadPoolExecutor(WORKERS) as threads:
        hand, swept_in = medians(
            repeats, lambda: loop(of, runs, threads), lambda: swept(of, runs, WORKERS)
        )
    lines = [
        f"Overhead of a sweep, {runs} runs on 60 links, {WORKERS} workers",
        "workers              one run   by hand      sweep   overhead",
        _row("threads", runs, hand, swept_in),
    ]
    common.progress("overhead, Dask")
    cluster = LocalCluster(
        n_workers=WORKERS, threads_per_worker=1, processes=True, dashboard_address=":0"
    )
    with (
        cluster,
        Client(cluster) as client,
        ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as processes,
    ):
        loop(of, 2 * WORKERS, processes)  # imports
        swept(of, 10 * WORKERS, client)
        hand, swept_in = medians(
            repeats, lambda: loop(of, runs, processes), lambda: swept(of, runs, client)
        )
    return [*lines, _row("Dask, 2 processes", runs, hand, swept_in)]


def _row(name: str, runs: int, hand: float, swept_in: float) -> str:
    one = 1e3 * WORKERS * hand / runs
    share = 100.0 * (swept_in / hand - 1.0)
    return f"{name:18s}{one:7.1f} ms{hand:8.2f} s{swept_in:9.2f} s{share:9.1f} %"


def main() -> None:
    options = common.arguments(__doc__, "15 min", "1 min")
    few, many, repeats = (40, 40, 1) if options.quick else (200, 2000, 3)
    lines = [*common.machine(), "", *in_threads(few, repeats), "", *overhead(many, repeats)]
    common.publish("sweep", lines, options.write)


if __name__ == "__main__":
    main()
