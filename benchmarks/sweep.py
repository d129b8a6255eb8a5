"""What a sweep adds to its runs: against a bare loop of simulate, in threads and on a Dask cluster.

    python benchmarks/sweep.py [--quick] [--write]

The paper's case 1 with loads that differ, runs of some 50 ms, 60 links, and fewer with 240. Bare:
the same runs by `concurrent.futures`, each a call of `simulate` from the settled state with these
outputs, nothing kept. All ways in turn, in every round; the overhead is that of the wall time,
medians over the rounds. Threads: wall time of a sweep in one over that in two. The Dask cluster is
local, two worker processes of one thread each with a scheduler of their own.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import common
import numpy as np

import beltdyn as bd

WORKERS = 2
#: Links, end of a run [s].
SIZES = ((60, 0.2), (240, 0.06))
MEASURE = ["span_tension.mean", "pulleys.omega.final"]
OUTPUTS = ("span_tension", "pulleys.omega")


def drive(n_bodies: int, t_end: float) -> bd.Scene:
    case = common.with_belt(bd.scenes.kubas_case_1(), n_bodies=n_bodies)
    return case._replace(t_end=t_end)


def bare(case: bd.Scene, scales: np.ndarray) -> float:
    """CPU time of the core in the runs of a loop written by hand."""
    start = bd.settle(case.params)

    def run(scale: float) -> float:
        stats = bd.simulate(
            case.params, case.torque_fn * scale, case.t_end, initial=start, outputs=OUTPUTS
        ).stats
        return stats.cpu_time

    with ThreadPoolExecutor(WORKERS) as pool:
        return sum(pool.map(run, map(float, scales)))


def swept(case: bd.Scene, scales: np.ndarray, executor: Any) -> None:
    over = {"torque.scale": scales}
    table = bd.sweep(case, over, MEASURE, executor=executor, progress=False)
    assert (table["status"] == "finished").all()


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    begun = time.perf_counter()
    found = work()
    return time.perf_counter() - begun, found


def overheads(rounds: int, runs: int, client: Any) -> list[str]:
    case = drive(*SIZES[0])
    ways: dict[str, Any] = {"threads": WORKERS, "Dask": client}
    found: dict[str, list[float]] = {name: [] for name in ways}
    core = []
    for k in range(rounds + 1):
        scales = np.linspace(0.5, 1.0, runs) + 1e-6 * k
        loop, cpu = seconds(lambda scales=scales: bare(case, scales))
        walls = {
            name: seconds(lambda scales=scales, way=way: swept(case, scales, way))[0]
            for name, way in ways.items()
        }
        if k:  # the first starts what is slow to start
            core.append(1e3 * cpu / runs)
            for name, wall in walls.items():
                found[name].append(wall / loop - 1.0)
    return [
        f"{rounds * runs} runs of {statistics.median(core):.0f} ms in the core, {WORKERS} workers, "
        f"{rounds} rounds; wall time over that of a bare loop in {WORKERS} threads:",
        *(
            f"  {name:<8} {100 * statistics.median(values):+5.1f} % "
            f"({100 * min(values):+.1f} to {100 * max(values):+.1f})"
            for name, values in found.items()
        ),
    ]


def speedups(rounds: int, runs: int) -> list[str]:
    lines = [f"wall time in one thread over that in {WORKERS}, sweeps of {runs} runs:"]
    for n_bodies, t_end in SIZES:
        case = drive(n_bodies, t_end)
        ratios: list[float] = []
        for k in range(rounds + 1):
            scales = np.linspace(0.5, 1.0, runs) + 1e-6 * k
            one, two = (
                seconds(lambda scales=scales, count=count, case=case: swept(case, scales, count))[0]
                for count in (1, WORKERS)
            )
            if k:
                ratios.append(one / two)
        lines.append(
            f"  {n_bodies:>3} links  {statistics.median(ratios):.2f} "
            f"({min(ratios):.2f} to {max(ratios):.2f})"
        )
    return lines


def main() -> None:
    arguments = common.arguments(__doc__, "10 min", "1 min")
    from distributed import Client, LocalCluster

    rounds, runs = (1, 20) if arguments.quick else (5, 400)
    with (
        LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,
    ):
        lines = overheads(rounds, runs, client)
    lines = [*common.machine(), "", *lines, "", *speedups(rounds, max(runs // 4, 10))]
    common.publish("sweep", lines, arguments.write)


if __name__ == "__main__":
    main()
