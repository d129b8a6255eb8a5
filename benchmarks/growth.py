"""Cost against the number of links, at a fixed setting of each method.

    python benchmarks/growth.py [--quick] [--write]

One and the same belt, that of the paper's case 1, in 60, 120, ... links, from rest over the ramp
of the torque. Explicit steps follow the joints' spectrum, whose bound grows as n and, once damping
has taken over, as n^2; steps of implicit methods are set by accuracy. A method goes up to the first
size that takes more than a limit, and sizes grow as long as some method is below it. `common.py`
defines the times.
"""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Sequence
from typing import Any

import common

import beltdyn as bd

SIZES = tuple(60 * 2**k for k in range(7))
WINDOW = 0.30  # s
ENGINEERING, TIGHT = 1e-2, 1e-3


def settings() -> list[tuple[str, dict[str, Any]]]:
    """A loose and a tight tolerance of adaptive methods, one step of those that take one."""
    found: dict[str, dict[str, Any]] = {}
    for ladder in common.LADDERS:
        if ladder.per_bound:
            continue
        values = (ENGINEERING, TIGHT) if ladder.option == "rtol" else (1e-4,)
        for value in values:
            name = f"{ladder.name} {value:g}"
            found[name] = {"method": ladder.method, ladder.option: value}
    return list(found.items())


def measure(
    sizes: Sequence[int], limit: float, repeats: int, samples: int
) -> tuple[dict[str, list[tuple[int, float, int]]], list[str]]:
    """Per setting: links, CPU seconds per simulated second, steps per simulated second."""
    going = dict(settings())
    points: dict[str, list[tuple[int, float, int]]] = {name: [] for name in going}
    notes = []
    for n in sizes:
        if not going:
            break
        scene = common.with_belt(bd.scenes.kubas_case_1(), n_bodies=n)
        begin = time.process_time()
        rest = bd.settle(scene.params)
        notes.append(
            f"n_b = {n}: settling {time.process_time() - begin:.2f} s CPU, "
            f"spectral bound {scene.params.info['spectral_bound']:.3g} 1/s"
        )
        common.progress(notes[-1])
        times = [WINDOW * (k + 1) / samples for k in range(samples)]
        cpu: dict[str, list[float]] = {name: [] for name in going}
        steps: dict[str, int] = {}
        for round_, (name, options) in itertools.product(range(repeats), tuple(going.items())):
            if round_ and cpu[name][0] * repeats > limit:
                continue
            stats = bd.simulate(*scene[:2], WINDOW, initial=rest, t_eval=times, **options).stats
            cpu[name].append(stats.cpu_time)
            steps[name] = stats.steps
        for name, seconds in cpu.items():
            median = statistics.median(seconds)
            points[name].append((n, median / WINDOW, round(steps[name] / WINDOW)))
            if median > limit:
                del going[name]
    return points, notes


def draw(points: dict[str, list[tuple[int, float, int]]]) -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(15, 5.5), layout="constrained")
    styles = common.colours(list(points))
    sizes = sorted({row[0] for rows in points.values() for row in rows})
    for column, axes in enumerate(panels, start=1):
        for name, rows in points.items():
            colour, marker = styles[name]
            axes.plot([row[0] for row in rows], [row[column] for row in rows], marker=marker,
                      color=colour, lw=1.2, ms=5, label=name)  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="links")
        axes.set_xticks(sizes, [str(n) for n in sizes])
        axes.minorticks_off()
        axes.grid(alpha=0.25)
    bottom, top = panels[0].get_ylim()
    dearest = max((rows[-1] for rows in points.values()), key=lambda row: row[1] / row[0] ** 2)
    guides = (
        (1, "--", 0.7 * min(rows[0][1] for rows in points.values())),
        (3, ":", 2.0 * dearest[1] * (sizes[0] / dearest[0]) ** 3),  # beside the steepest
    )
    for power, style, start in guides:
        line = [start * (n / sizes[0]) ** power for n in sizes]
        panels[0].plot(sizes, line, style, color="0.4", lw=1, label=f"n^{power}")
    panels[0].set_ylim(0.5 * bottom, 2 * top)
    panels[0].set_ylabel("CPU seconds per simulated second")
    panels[1].set_ylabel("steps per simulated second")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center", fontsize=9)
    return figure


def main() -> None:
    arguments = common.arguments(__doc__, "3 minutes", "5 s")
    sizes, limit, repeats = (SIZES[:2], 1.0, 1) if arguments.quick else (SIZES, 4.0, 3)
    points, notes = measure(sizes, limit, repeats, samples=10)
    lines = [
        f"Growth with the number of links: case 1, 0 to {WINDOW:g} s, "
        f"medians of up to {repeats} repeats, up to {limit:g} s CPU a run",
        *common.machine(),
        "",
        *notes,
        "",
        "method and setting     links  CPU s per s    steps per s",
    ]
    for name, rows in points.items():
        lines += [f"{name:22s} {n:5d} {cpu:12.4f} {steps:14d}" for n, cpu, steps in rows]
    lines += ["", "fitted exponents over all its sizes: CPU time, steps; steps about their middle"]
    for name, rows in points.items():
        if len(rows) < 2:
            continue
        n, cpu, steps = zip(*rows, strict=True)
        spread = (max(steps) - min(steps)) / (max(steps) + min(steps))
        lines.append(
            f"{name:22s} to {n[-1]:4d} {common.slope(n, cpu):8.2f} {common.slope(n, steps):8.2f} "
            f"   +-{100 * spread:.0f} %"
        )
    common.publish("growth", lines, arguments.write, draw(points))


if __name__ == "__main__":
    main()
