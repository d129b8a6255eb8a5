"""Work against precision: CPU time and error of each method and setting.

    python benchmarks/work_precision.py [--quick] [--write]

Drives on which different methods should win: the paper's case 1, lightly damped, over its whole
second; the same with ten times the axial damping, and with 240 links, both of which shorten the
steps of explicit methods; three pulleys with gravity; a stiff belt on unequal pulleys. Windows are
short where a reference at a tight tolerance takes long; those in the middle of a run start from its
state there. `common.py` defines times and errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import common

import beltdyn as bd

TARGETS = (2e-2, 5e-3, 1e-3, 1e-4, 1e-5, 1e-6)


def heavy() -> bd.Scene:
    scene = bd.scenes.kubas_case_1()
    return common.with_belt(scene, axial_damping=10.0 * scene.params.belt.axial_damping)


def fine() -> bd.Scene:
    return common.with_belt(bd.scenes.kubas_case_1(), n_bodies=240)


#: Name, scene, window [s], window with --quick [s].
CASES: tuple[tuple[str, Callable[[], bd.Scene], tuple[float, float], tuple[float, float]], ...] = (
    ("case 1", bd.scenes.kubas_case_1, (0.0, 1.0), (0.30, 0.32)),
    ("case 1, 10 x axial damping", heavy, (0.30, 0.40), (0.300, 0.302)),
    ("case 1, 240 links", fine, (0.30, 0.35), (0.0, 0.002)),
    ("three pulleys", bd.scenes.three_pulleys, (0.20, 0.30), (0.25, 0.26)),
    ("unequal pulleys", bd.scenes.unequal_pulleys, (0.04, 0.14), (0.05, 0.06)),
)


def best_lines(rows: Sequence[common.Row], duration: float, floor: float) -> list[str]:
    """What to take for an error, and what `auto` loses against it."""
    named = [row for row in rows if not row.name.startswith("auto")]
    lines = ["error <=   best method    setting   CPU s per s"]
    for target in TARGETS:
        best = common.cheapest(named, target)
        text = (
            f"{best.name:14s} {best.value:8.1e} {best.seconds / duration:13.5f}"
            if best and target > floor
            else "below the floor" if target <= floor else "none measured reaches it"
        )  # fmt: skip
        lines.append(f"{target:8.0e}   {text}")
    lines.append("auto at    error     CPU over that of the cheapest that is as right")
    for row in rows:
        if row.name.startswith("auto"):
            best = common.cheapest(rows, max(row.error, floor))
            assert best is not None
            ratio = row.seconds / best.seconds
            chosen = f"{best.name} {best.value:.1e}"
            lines.append(f"{row.value:7.0e} {row.error:9.1e} {ratio:9.2f}   {chosen}")
    return lines


def draw(axes: Any, case: common.Case, rows: Sequence[common.Row], floor: float) -> None:
    styles = common.colours([ladder.name for ladder in common.LADDERS])
    for name, (colour, marker) in styles.items():
        points = [row for row in rows if row.name == name]
        x, y = [row.error for row in points], [row.seconds / case.duration for row in points]
        if name.startswith("auto"):
            axes.plot(x, y, "o", ms=11, mfc="none", mec="0.25", label=name, zorder=1)
        else:
            axes.plot(x, y, marker=marker, ms=5, color=colour, lw=1.2, label=name)
    axes.set(xscale="log", yscale="log", title=case.name)
    axes.set_xlim(1e-8, 0.1)
    axes.axvspan(1e-8, max(floor, 1e-8), color="0.88", zorder=0)
    axes.grid(alpha=0.25)


def main() -> None:
    arguments = common.arguments(__doc__, "6 minutes", "10 s")
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    effort = (
        {"repeats": 2, "limit": 0.2, "budget": 0.4}
        if arguments.quick
        else {"repeats": 5, "limit": 3.0, "budget": 3.0}
    )
    figure, panels = plt.subplots(2, 3, figsize=(15, 9), layout="constrained")
    lines = ["Work against precision", *common.machine(), ""]
    for (name, scene, window, short), axes in zip(CASES, panels.flat[:-1], strict=True):
        case = common.case(name, scene(), *(short if arguments.quick else window))
        exact = common.reference(case)
        rows, failed = common.measure(case, exact, **effort)
        bound = case.params.info["spectral_bound"]
        lines += [
            f"== {name}: n_b = {case.params.belt.n_bodies}, {case.start.t:g} to {case.t_end:g} s, "
            f"joints' spectral bound {bound:.3g} 1/s, kernels {rows[0].last.stats.kernels}",
            f"{exact.text}; medians of up to {effort['repeats']} interleaved repeats",
            *common.row_lines(rows, case.duration),
            *failed,
            "",
            *best_lines(rows, case.duration, exact.floor),
            "",
        ]
        draw(axes, case, rows, exact.floor)
    for axes in panels[:, 0]:
        axes.set_ylabel("CPU seconds per simulated second")
    for axes in panels[-1, :]:
        axes.set_xlabel("error of joint forces, rms over mean tension")
    panels[0, 2].set_xlabel("error of joint forces, rms over mean tension")
    panels.flat[-1].axis("off")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    panels.flat[-1].legend(handles, labels, loc="center", title="method, what is set", fontsize=11)
    common.publish("work_precision", lines, arguments.write, figure)


if __name__ == "__main__":
    main()
