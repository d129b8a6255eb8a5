"""What `bd.explain` takes, and whether its bounds hold over the whole run.

    python benchmarks/explain.py [--quick] [--write]

First the time of an explanation with its default budget, and whether the passes of a step add up to
a step as it is called alone and as it is in a run. Then, of each scene, a part of the run is
explained, and every effect that can be left out is left out over all of it: the change there over
the bound that was stated. Effects without which a run is warned of have no bound; beside them
stands, marked "warned", the one that they would have been given, and they do not count. Bounds
above 10 % are not looked at: nobody would leave these effects out.
"""

from __future__ import annotations

import time

import common

import beltdyn as bd
from beltdyn.base.run_warnings import silenced
from beltdyn.explaining.ablation import RUNS, SAFETY, Answers, LeftOut, answers_of, changes_of

TIMED = ("kubas-case-1", "serpentine")
HELD = (
    "kubas-case-1",
    "kubas-case-2",
    "three-pulleys",
    "unequal-pulleys",
    "flywheel-start",
    "crossed-belt",
    "conveyor",
    "flat-belt-axis",
    "tensioned-alternator",
)
WINDOWS = (0.4, 0.25)  # of the run; the first is where the safety factor comes from
ERROR = 0.03  # so that there is advice to check
LARGE = 0.1  # bounds that are not looked at


def timed(name: str, budget: float) -> str:
    """A line of the first table."""
    scene = bd.scenes.get(name)
    wall, cpu = time.perf_counter(), time.thread_time()
    found = bd.explain(*scene, budget=budget)
    wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
    step, runs = found.step, found.ablation.runs if found.ablation else 0
    passes = sum(one.per_step for one in step.passes)
    return (
        f"{name:14s} {wall:7.1f} {cpu:7.1f} {runs:5d} {found.window.end:9.4g} {scene.t_end:7.4g}"
        f"  {step.method:7s} {1e9 * passes:8.0f} {1e9 * step.alone:8.0f} {1e9 * step.measured:7.0f}"
    )


def answers(scene: bd.Scene) -> Answers:
    return answers_of(bd.simulate(*scene, rtol=1e-3))


def bound_of(row: LeftOut, own_error: float) -> float:
    """The bound of a row, of one that is warned of as if it were not."""
    return SAFETY * row.growth * row.worst + RUNS * own_error


def held(name: str, window: float) -> list[tuple[float, str]]:
    """Lines of the second table, each with the change over the bound; 0 of what is warned of."""
    scene = bd.scenes.get(name)
    found = bd.explain(*scene._replace(t_end=window * scene.t_end), error=ERROR, budget=100.0)
    ablation = found.ablation
    assert ablation is not None
    names = {one.name: (one.name,) for one in ablation.rows}
    own = ablation.own_error
    rows = [r for r in ablation.rows if r.exercised and not r.failed and bound_of(r, own) <= LARGE]
    if ablation.together is not None and len(ablation.advice) > 1:
        rows.append(ablation.together)
        names[ablation.together.name] = ablation.advice
    base, lines = answers(scene), []
    for one in rows:
        left = found.without(*names[one.name])._replace(t_end=scene.t_end)
        change = max(float(c[0]) for c in changes_of(answers(left), base).values())
        seen = max(one.change.values())
        bound = bound_of(one, own)
        advised = "yes" if one.may_be_left_out else "warned" if one.warned else ""
        label = one.name if len(names[one.name]) == 1 else "all that may be"
        lines.append(
            (
                0.0 if one.warned else change / bound,
                f"{name:20s} {window:4.2f} {label:22s} {100 * seen:8.3f} {one.growth:7.1f}"
                f" {100 * bound:8.3f} {100 * change:8.3f} {change / bound:6.2f}  {advised}",
            )
        )
    return lines


def main() -> None:
    arguments = common.arguments(__doc__, "3 min", "20 s")
    budget, scenes = (2.0, HELD[2:3]) if arguments.quick else (8.0, HELD)
    lines = [
        "bd.explain",
        *common.machine(),
        "",
        f"with a budget of {budget:g} s; passes, a step alone, a step in a run in ns",
        "scene           wall s   CPU s  runs    window     run  method    passes    alone  in run",
    ]
    with silenced():
        for name in TIMED[:1] if arguments.quick else TIMED:
            lines.append(timed(name, budget))
            common.progress(lines[-1])
        lines += [
            "",
            "bounds from a part of the run, the window, changes over all of it, in percent",
            "scene             window  left out                   seen  growth    bound  changed"
            "  ratio  advised",
        ]
        ends = []
        for window in WINDOWS[:1] if arguments.quick else WINDOWS:
            ratios = []
            for name in scenes:
                for ratio, line in held(name, window):
                    ratios += [ratio] if ratio > 0.0 else []
                    lines.append(line)
                    common.progress(line)
            beyond = sum(ratio > 1.0 for ratio in ratios)
            ends.append(
                f"window {window:g}: beyond its bound {beyond} of {len(ratios)}; largest ratio"
                f" {max(ratios):.2f}"
            )
    lines += ["", *ends]
    common.publish("explain", lines, arguments.write)


if __name__ == "__main__":
    main()
