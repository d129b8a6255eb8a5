"""Cost per step of a drive with a tensioner arm, against the same drive with that pulley fixed.

    python benchmarks/mounts.py [--quick] [--write]

The scene "serpentine", from running to running: the same links, pulleys, loads and crank, the belt
of the same length; without its arm the tensioner is fixed where the arm rests. Attempted steps
count, because drives that move differently reject differently many. CPU time of the run alone, both
drives in turn in one process.
"""

from __future__ import annotations

import statistics

import attrs
import common

import beltdyn as bd

SETTINGS = (("tsit5", 1e-4), ("rodas4", 1e-3), ("lbdf2", 1e-2))
START = 0.03  # s, the firing has faded in


def without_arm(params: bd.Params) -> bd.Params:
    """The drive with its pulley fixed where the arm rests."""
    (mounted,) = params.mounted
    pulleys = list(params.pulleys)
    center = tuple(params.centers()[mounted])
    pulleys[mounted] = attrs.evolve(pulleys[mounted], mount=None, center=center)
    belt = attrs.evolve(params.belt, length=params.info["length"])
    return attrs.evolve(params, pulleys=pulleys, belt=belt)


def started(scene: bd.Scene, params: bd.Params) -> bd.State:
    run = bd.simulate(params, scene.torque_fn, START, motion=scene.motion, t_eval=[START])
    return run.final_state


def microseconds(
    scene: bd.Scene, params: bd.Params, start: bd.State, t_end: float, method: str, rtol: float
) -> tuple[float, int]:
    """CPU time per attempted step, and their number."""
    stats = bd.simulate(
        params, scene.torque_fn, t_end, motion=scene.motion, initial=start, t_eval=[t_end],
        method=method, rtol=rtol,
    ).stats  # fmt: skip
    attempts = stats.steps + stats.rejected
    return 1e6 * stats.cpu_time / attempts, attempts


def main() -> None:
    arguments = common.arguments(__doc__, "5 min", "20 s")
    repeats, duration = (3, 0.004) if arguments.quick else (25, 0.02)
    scene = bd.scenes.serpentine()
    drives = {"arm": scene.params, "fixed": without_arm(scene.params)}
    starts = {name: started(scene, params) for name, params in drives.items()}
    lines = [
        f"serpentine, {scene.params.belt.n_bodies} links, {START:g} to {START + duration:g} s:"
        " CPU time per attempted step",
        *common.machine(),
        f"medians of {repeats} rounds, in turn; ratio round by round, median and quartiles",
        "",
        "                 with its arm               pulley fixed",
        "method   rtol   us per step    steps   us per step    steps    ratio  quartiles",
    ]
    for method, rtol in SETTINGS:
        cost: dict[str, list[float]] = {name: [] for name in drives}
        steps = {}
        for _ in range(repeats):
            for name, params in drives.items():
                spent, steps[name] = microseconds(
                    scene, params, starts[name], START + duration, method, rtol
                )
                cost[name].append(spent)
        ratios = [a / b for a, b in zip(cost["arm"], cost["fixed"], strict=True)]
        low, middle, high = statistics.quantiles(ratios, n=4)
        text = f"{method:7s} {rtol:6.0e}"
        for name in drives:
            text += f" {statistics.median(cost[name]):12.2f} {steps[name]:8d}"
        lines.append(f"{text} {middle:9.3f}  {low:.3f} to {high:.3f}")
        common.progress(lines[-1])
    common.publish("mounts", lines, arguments.write)


if __name__ == "__main__":
    main()
