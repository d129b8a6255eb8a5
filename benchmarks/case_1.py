"""CPU time and error of the paper's case 1 for a series of tolerances.

    python benchmarks/case_1.py [--quick] [--write]

The whole second, the default method. `common.py` defines times and errors; the largest error over
joints and times is given beside the root mean square.
"""

from __future__ import annotations

import common
import numpy as np

import beltdyn as bd

LADDER = common.Ladder("auto", "rtol", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6))


def main() -> None:
    arguments = common.arguments(__doc__, "20 s", "2 s")
    repeats = 2 if arguments.quick else 9
    t_end = 0.1 if arguments.quick else 1.0
    case = common.case("case 1", bd.scenes.kubas_case_1(), 0.0, t_end)
    exact = common.reference(case)
    rows, failed = common.measure(
        case, exact, [LADDER], repeats=repeats, limit=np.inf, budget=np.inf
    )
    lines = [
        f"case 1, n_b = {case.params.belt.n_bodies}, {t_end:g} s simulated, {exact.force.shape[0]} "
        f"samples, kernels {rows[0].last.stats.kernels}",
        *common.machine(),
        f"medians of {repeats} interleaved repeats; {exact.text}",
        "",
        "   rtol  CPU [s]  (min-max)      steps  rejected  RHS calls  force error rms  max  method",
    ]
    for row in rows:
        stats, tension = row.last.stats, np.mean(exact.force)
        largest = np.max(np.abs(row.last.joints.force - exact.force)) / tension
        lines.append(
            f"{row.value:7.0e} {row.seconds:8.3f}  ({min(row.cpu):.3f}-{max(row.cpu):.3f})"
            f" {stats.steps:9d} {stats.rejected:9d} {stats.nfev:10d}"
            f" {row.error:16.1e} {largest:9.1e}  {stats.method}"
        )
    common.publish("case_1", lines + failed, arguments.write)


if __name__ == "__main__":
    main()
