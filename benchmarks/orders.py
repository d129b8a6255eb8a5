"""Orders of convergence: error against step, on a smooth drive and on one with many kinks.

    python benchmarks/orders.py [--quick] [--write]

Left, a smooth drive: friction far from saturation, no contact damping, nothing makes or breaks
contact, so each method must show its order. Right, the paper's case 1 after its ramp: links that
stick vibrate through v_T = 0, links make and lose contact, and a step that straddles a kink has
order one, whatever the method. Error control makes up for it (`work_precision.py`), which is why
adaptive steps are the default. Methods that control their error are held to a step by `max_step`.
Smooth: joint forces at the end. Case 1: at irregular times, dense output included.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any

import common
import numpy as np

import beltdyn as bd

sys.path.insert(0, str(common.HERE.parent / "tests"))
from smooth import T_END, smooth_params

#: Methods that take a fixed step; the others are held to one.
FIXED = {ladder.method for ladder in common.LADDERS if ladder.option == "step"}
EXPLICIT = {"tsit5", "rk4"}
METHODS = tuple(dict.fromkeys(x.method for x in common.LADDERS if x.method != "auto"))
#: h times the spectral bound at which explicit methods are still stable
LIMIT = 2.7
#: How far an error must be off the floor to tell an order.
CLEAR = 100.0
#: Of the torque on the smooth drive [N m], [rad/s]: fast enough to shake the belt's own modes.
AMPLITUDE, FREQUENCY = 50.0, 5000.0


def swing(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
    return [-AMPLITUDE * math.sin(FREQUENCY * t), -0.1 * omega[1]]


def held(method: str, h: float) -> dict[str, Any]:
    if method in FIXED:
        return {"method": method, "step": h}
    return {"method": method, "step": h, "max_step": h, "rtol": 1.0}


def errors(
    case: common.Case, counts: Sequence[int], error: Callable[[bd.Result], float]
) -> dict[str, list[tuple[float, float]]]:
    """Step and error of every method that is stable there."""
    bound = case.params.info["spectral_bound"]
    found: dict[str, list[tuple[float, float]]] = {method: [] for method in METHODS}
    for method in METHODS:
        for count in counts:
            h = case.duration / count
            if method in EXPLICIT and h * bound > LIMIT:
                continue
            result = case.run(**held(method, h), ledger=False)
            stats = result.stats
            if stats.largest_step > h * (1 + 1e-9) or stats.rejected > 0.02 * stats.steps:
                continue  # not held to its step: no order to see
            found[method].append((h, error(result)))
    return found


def lines_of(found: dict[str, list[tuple[float, float]]], floor: float) -> list[str]:
    lines = ["method      step [s]      error   order from the step before"]
    for method, points in found.items():
        before = None
        for h, error in points:
            text = ""
            if before is not None and min(error, before[1]) > CLEAR * floor:
                text = f"{math.log(before[1] / error) / math.log(before[0] / h):8.2f}"
            lines.append(f"{method:8s} {h:11.3e} {error:10.2e} {text}")
            before = (h, error)
        order = fitted(points, floor)
        lines.append(
            f"{method:8s} order fitted to its four shortest steps clear of the floor: {order:.2f}"
        )
    return lines


def fitted(points: Sequence[tuple[float, float]], floor: float) -> float:
    off = [point for point in points if point[1] > CLEAR * floor][-4:]
    return common.slope([h for h, _ in off], [error for _, error in off])


def draw(axes: Any, title: str, found: dict[str, list[tuple[float, float]]], floor: float) -> None:
    styles = common.colours(list(METHODS))
    for method, points in found.items():
        if not points:
            continue
        colour, marker = styles[method]
        order = fitted(points, floor)
        label = method if math.isnan(order) else f"{method}: order {order:.2f}"
        axes.plot(*zip(*points, strict=True), marker=marker, ms=5, color=colour, label=label)
    axes.set(xscale="log", yscale="log", title=title, xlabel="step [s]")
    bottom = min(axes.get_ylim()[0], 0.3 * floor)
    axes.axhspan(bottom, floor, color="0.88", zorder=0)
    axes.set_ylim(bottom=bottom)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=9)


def main() -> None:
    arguments = common.arguments(__doc__, "1 minute", "5 s")
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(13, 5.5), layout="constrained")
    panels[0].set_ylabel("error of joint forces, rms over mean tension")
    lines = ["Orders of convergence", *common.machine(), ""]

    # Smooth: samples at the end only, so that no interpolation plays a part.
    scene = bd.Scene(smooth_params(), swing, T_END)
    start = bd.settle(scene.params)
    smooth = common.Case(
        "smooth", scene.params, scene.torque_fn, start, scene.t_end, np.array([scene.t_end])
    )
    bound = scene.params.info["spectral_bound"]
    exact = smooth.run(method="rk4", step=0.02 / bound)
    tight = smooth.run(method="tsit5", rtol=1e-12, max_step=0.1 / bound)
    floor = common.rms_error(tight.joints.force, exact.joints.force)
    pulley = bd.simulate(*scene, initial=start).contact.pulley
    if np.any(pulley != pulley[0]):
        raise AssertionError("a contact was made or lost: the smooth drive is not smooth")
    counts = tuple(round(20 * 2 ** (0.5 * k)) for k in range(9 if arguments.quick else 17))
    found = errors(
        smooth, counts, lambda result: common.rms_error(result.joints.force, exact.joints.force)
    )
    title = "smooth drive"
    lines += [
        f"== {title}, {scene.t_end:g} s; reference by rk4, against tsit5: {floor:.1e} (the floor)",
        *lines_of(found, floor),
        "",
    ]
    draw(panels[0], title, found, floor)

    case = common.case("case 1", bd.scenes.kubas_case_1(), 0.3, 0.301 if arguments.quick else 0.32)
    reference = common.reference(case)
    longest = 4e-4 if not arguments.quick else 1e-4
    first = round(case.duration / longest)
    counts = tuple(first * 2**k for k in range(5 if arguments.quick else 10))
    found = errors(case, counts, reference.error)
    title = f"case 1, {case.start.t:g} to {case.t_end:g} s, kinks"
    lines += [f"== {title}; {reference.text}", *lines_of(found, reference.floor)]
    draw(panels[1], title, found, reference.floor)
    common.publish("orders", lines, arguments.write, figure)


if __name__ == "__main__":
    main()
