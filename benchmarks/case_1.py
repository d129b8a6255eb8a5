"""What accuracy costs on the paper's case 1: CPU time and error of a ladder of tolerances.

    python benchmarks/case_1.py [--quick] [--write]

Errors are joint forces at irregular times against a run at a tolerance far below all others, from
the same settled state, as root mean square and maximum over joints and times, relative to the mean
tension. Times are CPU seconds of the run alone (settling apart), 1001 samples included, medians of
interleaved repeats: rung by rung, round after round, so that a machine that slows down slows all.
"""

from __future__ import annotations

import argparse
import platform
import statistics
from pathlib import Path

import numpy as np

import beltdyn as bd

LADDER = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
TIGHT = 1e-10


def machine() -> str:
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [x.split(":")[1].strip() for x in cpuinfo.read_text().splitlines()
                 if x.startswith("model name")]  # fmt: skip
        model = f"{len(names)} x {names[0]}" if names else model
    return (
        f"{model}; {platform.system()} {platform.release()}; Python {platform.python_version()}, "
        f"NumPy {np.__version__}, beltdyn {bd.__version__}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the run, two repeats")
    parser.add_argument("--write", action="store_true", help="keep the table under results/")
    arguments = parser.parse_args()
    repeats = 2 if arguments.quick else 9
    t_end = 0.1 if arguments.quick else 1.0

    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    times = np.sort(np.random.default_rng(1).uniform(0.0, t_end, 1001))

    def run(rtol: float) -> bd.Result:
        return bd.simulate(*scene[:2], t_end, initial=start, t_eval=times, rtol=rtol)

    exact = run(TIGHT).joints.force
    floor = run(10 * TIGHT).joints.force
    tension = exact.mean()
    cpu: dict[float, list[float]] = {rtol: [] for rtol in LADDER}
    last: dict[float, bd.Result] = {}
    for _ in range(repeats):
        for rtol in LADDER:
            last[rtol] = run(rtol)
            cpu[rtol].append(last[rtol].stats.cpu_time)

    lines = [
        f"case 1, n_b = 60, {t_end:g} s simulated, method {last[LADDER[0]].stats.method}, "
        f"kernels {last[LADDER[0]].stats.kernels}",
        machine(),
        f"medians of {repeats} interleaved repeats; reference rtol = {TIGHT:g}, against "
        f"{10 * TIGHT:g}: {np.sqrt(np.mean((floor - exact) ** 2)) / tension:.1e}",
        "",
        "   rtol  CPU [s]  (min-max)      steps  rejected  RHS calls  force error rms   max",
    ]
    for rtol in LADDER:
        error = np.abs(last[rtol].joints.force - exact) / tension
        stats, seconds = last[rtol].stats, cpu[rtol]
        lines.append(
            f"{rtol:7.0e} {statistics.median(seconds):8.3f}"
            f"  ({min(seconds):.3f}-{max(seconds):.3f})"
            f" {stats.steps:9d} {stats.rejected:9d} {stats.nfev:10d}"
            f" {np.sqrt(np.mean(error**2)):16.1e} {error.max():9.1e}"
        )
    text = "\n".join(lines)
    print(text)
    if arguments.write:
        target = Path(__file__).parent / "results" / "case_1.txt"
        target.parent.mkdir(exist_ok=True)
        target.write_text(text + "\n")


if __name__ == "__main__":
    main()
