"""A belt that resists no bending as a string of point masses, against one of rigid links.

    python benchmarks/point_masses.py [--quick] [--write]

The paper's drive with contact of the joints, without bending stiffness, run up against 60 N m, from
rest to 0.6 s. Both models take turns in one process; times are CPU seconds of whole runs, medians
over rounds, and ratios are taken round by round. Differences are those of means over the last 0.05
s, when the belt runs steadily, at a hundredth of the tolerance of the timed runs.
"""

from __future__ import annotations

import statistics
import warnings

import attrs
import common
import numpy as np

import beltdyn as bd
from beltdyn import _core

warnings.simplefilter("ignore", bd.BeltdynWarning)

METHODS = ("auto", "tsit5", "rodas4", "lbdf2")
T_END, LATE = 0.6, 0.05  # s


def scene(model: str, n_bodies: int) -> bd.Scene:
    """The drive by a model of its belt."""
    given = bd.scenes.kubas_case_1().params
    belt = attrs.evolve(
        given.belt, n_bodies=n_bodies, mesh="joint", bending_stiffness=0.0, bending_damping=0.0,
        model=model,
    )  # fmt: skip
    ramp = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-60.0, 0.0]])
    load = bd.Viscous([0.0, 60.0 / (2.0 * np.pi)])
    return bd.Scene(attrs.evolve(given, belt=belt), ramp + load, T_END)


def run(model: str, n_bodies: int, method: str, rtol: float, initial: bd.State) -> bd.Result:
    params, torque, t_end, _ = scene(model, n_bodies)
    return bd.simulate(
        params,
        torque,
        t_end,
        t_eval=np.linspace(t_end - LATE, t_end, 51),
        method=method,
        rtol=rtol,
        initial=initial,
        outputs=("span_tension", "pulleys.omega"),
    )


def speeds(n_bodies: int, rounds: int) -> list[str]:
    starts = {one: bd.settle(scene(one, n_bodies).params) for one in ("links", "string")}
    lines = []
    for method in METHODS:
        times: dict[str, list[float]] = {"links": [], "string": []}
        steps = {}
        for k in range(rounds):
            for model in ("links", "string") if k % 2 else ("string", "links"):
                stats = run(model, n_bodies, method, 1e-3, starts[model]).stats
                times[model].append(stats.cpu_time)
                steps[model] = stats.steps
        ratios = [a / b for a, b in zip(times["links"], times["string"], strict=True)]
        whole = statistics.median(ratios)
        low, _, high = statistics.quantiles(ratios, n=4)
        lines.append(
            f"{n_bodies:5d}  {method:7s}"
            + "".join(f"{steps[m]:8d}{statistics.median(times[m]):9.4f}" for m in times)
            + f"{whole:8.2f} ({low:.2f} to {high:.2f})"
            f"{whole * steps['string'] / steps['links']:10.2f}"
        )
        common.progress(lines[-1])
    return lines


def differences(n_bodies: int) -> str:
    """Of the string's means to the links', in percent."""
    found = {}
    for model in ("links", "string"):
        params = scene(model, n_bodies).params
        result = run(model, n_bodies, "rodas4", 1e-5, bd.settle(params))
        slack, tight = np.sort(result.span_tension.mean(axis=0))
        first, second = np.abs(result.pulleys.omega.mean(axis=0))
        found[model] = np.array([tight, slack, first, 1.0 - second / first])
    apart = 100.0 * (found["string"] / found["links"] - 1.0)
    return f"{n_bodies:5d}  " + "".join(f"{value:12.3f}" for value in apart)


def main() -> None:
    arguments = common.arguments(__doc__, "3 min", "20 s")
    rounds = 3 if arguments.quick else 11
    counts = (60,) if arguments.quick else (60, 240)
    lines = [
        f"A string of point masses against rigid links, kernels {_core.kernel_level()}",
        *common.machine(),
        f"medians of {rounds} rounds in turn (quartiles); rtol 1e-3",
        "",
        "                 links           string        links over string, CPU time",
        "links  method    steps    CPU s   steps    CPU s    of a run             of a step",
    ]
    for n_bodies in counts:
        lines += speeds(n_bodies, rounds)
    lines += [
        "",
        "String less links, percent, means of steady running",
        "links         tight       slack       speed       creep",
        *map(differences, counts),
    ]
    common.publish("point_masses", lines, arguments.write)


if __name__ == "__main__":
    main()
