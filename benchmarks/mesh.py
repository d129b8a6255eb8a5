"""Accuracy and cost of the two meshes, "joint" and "paper", in steady motion.

    python benchmarks/mesh.py [--quick] [--write]

Four drives: M (the paper's with 60 N m), U (radii of 50 and 120 mm), three pulleys, and one with an
idler of 28 mm between two larger pulleys. Each runs up and is read off long after the ramp of its
torque, in means over a whole number of links passing by: slack tension (of the slackest span),
creep (of the pulley that creeps most, against pulley 0) and ripple (largest standard deviation of a
span tension).

Runs are made with "auto" at rtol 1e-3; the references, the finest of each mesh, at 1e-4, so that
the error of a reference's own row is one in time. Neither mesh is judged by its own reference
alone. The cost of an answer is the CPU time of the whole run of the fewest links from which on the
error stays below a bound.

Steps a second are those of drive M with pulley 0 at a prescribed speed and a constant load torque;
beside them stand CPU seconds per second, and steps per link that passes by.
CPU times are without settling, and minima of three repeats, interleaved for the drives.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import attrs
import common
import numpy as np

import beltdyn as bd
from beltdyn.base.run_warnings import silenced

sys.path.insert(0, str(common.HERE.parent / "tests"))
import drives

LINKS: dict[str, tuple[int, ...]] = {
    "joint": (30, 60, 120, 240, 480),
    "paper": (60, 120, 240, 480, 960),
}
QUICK_LINKS: dict[str, tuple[int, ...]] = {"joint": (30, 60), "paper": (60, 120)}
RTOL, REFERENCE_RTOL = 1e-3, 1e-4
SAMPLES = 3001  # of the steady part
REPEATS = 3
#: What an answer is, and the relative error that it may have.
ANSWERS = (("slack", 0.01), ("creep", 0.05))
#: Speed of the belt's driver [rad/s] and how long steps are counted [s].
SPEEDS = ((6.28, 0.2), (62.8, 0.1), (314.0, 0.05))


def idler() -> bd.Scene:
    """Two pulleys and a small free one inside the loop, strained by 0.6 %."""
    scene = bd.scenes.three_pulleys()
    places, radii = ((0.0, 0.0), (0.30, 0.0), (0.15, 0.14)), (0.08, 0.06, 0.028)
    inertias = (0.010, 0.002, 0.0001)
    pulleys = [
        bd.Pulley(center=place, radius=radius, inertia=inertia)
        for place, radius, inertia in zip(places, radii, inertias, strict=True)
    ]
    belt = attrs.evolve(scene.params.belt, length=1.0, mesh="joint", n_bodies=240)
    contact = attrs.evolve(
        scene.params.contact, linear=1.2e8
    )  # sinks less than 0.5 % into the idler
    params = attrs.evolve(
        scene.params, belt=belt, pulleys=pulleys, contact=contact, gravity=(0.0, 0.0)
    )
    path = 1.0 + params.info["strain"]
    params = attrs.evolve(params, belt=attrs.evolve(belt, length=path / 1.006))
    ramp = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0, 0.0], [-15.0, 0.0, 0.0]])
    return bd.Scene(params, ramp + bd.Viscous([0.0, 0.4, 0.0]), 0.0)


#: Name, scene, steady part [s].
DRIVES: dict[str, tuple[Callable[[], bd.Scene], tuple[float, float]]] = {
    "M": (drives.scene_m, (1.0, 1.6)),
    "U": (drives.scene_u, (1.0, 1.6)),
    "three pulleys": (bd.scenes.three_pulleys, (0.6, 0.8)),
    "idler": (idler, (0.6, 0.8)),
}


@dataclass
class Row:
    """What a mesh gives of a drive in steady motion, and its cost."""

    mesh: str
    links: int
    slack: float  # N
    creep: float  # relative
    ripple: float  # N
    steps: int
    seconds: float

    def error(self, quantity: str, reference: Row) -> float:
        expected: float = getattr(reference, quantity)
        return float(getattr(self, quantity) / expected - 1.0)


# ---------------------------------------------------------------- steady motion


def steady(name: str, mesh: str, links: int, rtol: float) -> Row:
    """Run a drive and take the means of its steady part."""
    build, (begin, end) = DRIVES[name]
    params, torque, *_ = common.with_belt(build(), n_bodies=links, mesh=mesh)
    times = np.linspace(begin, end, SAMPLES)
    run = bd.simulate(params, torque, end, rtol=rtol, t_eval=times)
    turned = np.abs(np.mean(run.belt.phi - run.belt.phi[0], axis=1))
    passed = turned * links / (2.0 * math.pi)
    if passed[-1] < 2.0:
        raise RuntimeError(f"{name}, {links} links: only {passed[-1]:.1f} of them pass by")
    window = run.t <= np.interp(math.floor(passed[-1]), passed, run.t)
    tension = run.span_tension[window]
    speed = np.abs(run.pulleys.omega[window].mean(axis=0))
    rim = speed * [pulley.radius for pulley in params.pulleys]
    return Row(
        mesh,
        links,
        float(tension.mean(axis=0).min()),
        float(1.0 - rim[1:].min() / rim[0]),
        float(tension.std(axis=0).max()),
        run.stats.steps,
        run.stats.cpu_time,
    )


def measure(
    name: str, links: dict[str, tuple[int, ...]], repeats: int
) -> tuple[list[Row], dict[str, Row], list[str]]:
    """Rows of both meshes, the references by mesh, and what fails."""
    rows, failed = [], []
    references = {
        mesh: steady(name, mesh, sizes[-1], REFERENCE_RTOL) for mesh, sizes in links.items()
    }
    for mesh, sizes in links.items():
        for n in sizes:
            common.progress(f"{name}, {mesh}, {n} links")
            try:
                rows.append(steady(name, mesh, n, RTOL))
            except (ValueError, bd.SimulationError) as failure:
                failed.append(f"{mesh:6s} {n:5d}  fails: {failure}")
    for _ in range(1, repeats):
        for row in rows:
            again = steady(name, row.mesh, row.links, RTOL)
            row.seconds = min(row.seconds, again.seconds)
    return rows, references, failed


def steady_lines(rows: Sequence[Row], references: dict[str, Row]) -> list[str]:
    marks = {mesh: f"{mesh} {row.links}" for mesh, row in references.items()}
    lines = [
        f"{'':44s}{'slack tension off':>22s}{'creep off':>22s}",
        "mesh   links   slack N  creep %  ripple N"
        + "".join(f"{mark:>12s}" for mark in (*marks.values(), *marks.values()))
        + "     steps    CPU s",
    ]
    for row in rows:
        errors = "".join(
            f"{100.0 * row.error(quantity, reference):+10.2f} %"
            for quantity, _ in ANSWERS
            for reference in references.values()
        )
        lines.append(
            f"{row.mesh:6s} {row.links:5d} {row.slack:9.2f} {100.0 * row.creep:8.4f}"
            f" {row.ripple:9.3f}{errors} {row.steps:9d} {row.seconds:8.3f}"
        )
    return lines


def enough(rows: Sequence[Row], quantity: str, bound: float, reference: Row) -> Row | None:
    """Of one mesh, the fewest links from which on the error stays below the bound."""
    found = None
    for row in sorted(rows, key=lambda row: -row.links):
        if abs(row.error(quantity, reference)) > bound:
            break
        found = row
    return found


def cost_lines(rows: Sequence[Row], references: dict[str, Row]) -> list[str]:
    lines = []
    for quantity, bound in ANSWERS:
        for reference in references.values():
            found = {
                mesh: enough([row for row in rows if row.mesh == mesh], quantity, bound, reference)
                for mesh in references
            }
            texts = [
                f"{mesh} {row.links:d} in {row.seconds:.3f} s" if row else f"{mesh}: none"
                for mesh, row in found.items()
            ]
            joint, paper = found["joint"], found["paper"]
            ratio = f"{paper.seconds / joint.seconds:.1f} times" if joint and paper else "-"
            lines.append(
                f"{quantity} within {100.0 * bound:.0f} % of {reference.mesh} {reference.links}: "
                f"{', '.join(texts)}: {ratio}"
            )
    return lines


# ---------------------------------------------------------------- speed


def steps_at(
    mesh: str, method: str, speed: float, window: float, repeats: int
) -> tuple[float, float]:
    """Steps and CPU seconds per simulated second at a prescribed speed, loaded with 60 N m."""
    params = common.with_belt(drives.scene_m(), n_bodies=60, mesh=mesh).params
    load = bd.PiecewiseLinear([0.0, 0.1], [[0.0, 0.0], [0.0, 60.0]])
    options: dict[str, Any] = {
        "method": method,
        "rtol": RTOL,
        "motion": {0: bd.PiecewiseLinear([0.0, 1.0], [-speed, -speed])},
    }
    begin, end = 0.2, 0.2 + window
    start = bd.settle(params).at_speed(params, {0: -speed})
    start = bd.simulate(params, load, begin, initial=start, t_eval=[begin], **options).final_state
    runs = [
        bd.simulate(params, load, end, initial=start, t_eval=[end], **options).stats
        for _ in range(repeats)
    ]
    return runs[0].steps / window, min(stats.cpu_time for stats in runs) / window


def speed_lines(speeds: Sequence[tuple[float, float]], repeats: int) -> list[str]:
    lines = [
        "steps a second (CPU s per s, steps per link passing by) at a prescribed speed of pulley 0,"
        " M, 60 links, 60 N m",
        "mesh   method  "
        + "".join(f"{f'{speed:.0f} rad/s':>24s}" for speed, _ in speeds)
        + "   last over first",
    ]
    params = drives.scene_m().params
    advance = params.pulleys[0].radius / (params.belt.length / 60)  # links per radian
    for mesh in LINKS:
        for method in ("auto", "tsit5", "rodas4"):
            common.progress(f"steps of {method}, {mesh}")
            found, text = [], ""
            for speed, window in speeds:
                steps, seconds = steps_at(mesh, method, speed, window, repeats)
                found.append(steps)
                text += f"{steps:12.0f} ({seconds:4.2f}, {steps / (speed * advance):3.0f})"
            lines.append(f"{mesh:6s} {method:8s}{text} {found[-1] / found[0]:17.2f}")
    return lines


def main() -> None:
    arguments = common.arguments(__doc__, "4 minutes", "10 s")
    repeats = 1 if arguments.quick else REPEATS
    links = QUICK_LINKS if arguments.quick else LINKS
    speeds = [(speed, 0.01) for speed, _ in SPEEDS[:2]] if arguments.quick else SPEEDS
    lines = [
        f'Meshes in steady motion, "auto" at rtol {RTOL:g}, references at {REFERENCE_RTOL:g}, '
        f"CPU s: minima of {repeats}",
        *common.machine(),
        "",
    ]
    with silenced():
        for name in list(DRIVES)[:2] if arguments.quick else DRIVES:
            rows, references, failed = measure(name, links, repeats)
            begin, end = DRIVES[name][1]
            lines += [f"== {name}, means over {begin:g} to {end:g} s"]
            lines += [*steady_lines(rows, references), *failed, *cost_lines(rows, references), ""]
        lines += speed_lines(speeds, repeats)
    common.publish("mesh", lines, arguments.write)


if __name__ == "__main__":
    main()
