"""Cost of a torque function: Python, ctypes and Numba against torques the core evaluates itself.

    python benchmarks/callback.py [--quick] [--write]

The paper's case 1 over the ramp of its torque, the same torque in every form. Nanoseconds per call
are the additional time compared with torque objects, divided by the calls, which are counted in a
run of their own. Below, the run time of each method with the plain Python function.
`common.py` defines the times.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from typing import Any

import common
import numba
import numpy as np

import beltdyn as bd

RAMP, TORQUE, LOAD = 0.3, -100.0, 100.0 / (2.0 * math.pi)


def floats(t: float, theta: Any, omega: Any) -> list[float]:
    return [TORQUE * min(t / RAMP, 1.0), -LOAD * omega[1]]


def with_numpy(t: float, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    torque = np.zeros(2)
    torque[0] = TORQUE * np.clip(t / RAMP, 0.0, 1.0)
    torque[1] -= LOAD * omega[1]
    return torque


DOUBLES = ctypes.POINTER(ctypes.c_double)


@ctypes.CFUNCTYPE(None, ctypes.c_double, DOUBLES, DOUBLES, DOUBLES, ctypes.c_void_p)
def from_ctypes(t: float, theta: Any, omega: Any, torque: Any, user: Any) -> None:
    torque[0] = TORQUE * min(t / RAMP, 1.0)
    torque[1] = -LOAD * omega[1]


_DOUBLE = numba.types.double
_POINTER = numba.types.CPointer(_DOUBLE)


@numba.cfunc(numba.types.void(_DOUBLE, _POINTER, _POINTER, _POINTER, numba.types.voidptr))
def from_numba(t: float, theta: Any, omega: Any, torque: Any, user: Any) -> None:
    torque[0] = TORQUE * min(t / RAMP, 1.0)
    torque[1] = -LOAD * omega[1]


def counted(case: common.Case) -> int:
    calls = 0

    def count(t: float, theta: Any, omega: Any) -> list[float]:
        nonlocal calls
        calls += 1
        return floats(t, theta, omega)

    bd.simulate(
        case.params, count, case.t_end, initial=case.start, t_eval=case.times, breakpoints=[RAMP]
    )
    return calls


def rows(
    case: common.Case, torques: Sequence[tuple[str, Any]], repeats: int, **options: Any
) -> list[common.Row]:
    def run(torque: Any) -> common.Run:
        def once() -> tuple[float, bd.Result]:
            result = bd.simulate(case.params, torque, case.t_end, initial=case.start,
                                 t_eval=case.times, breakpoints=[RAMP], **options)  # fmt: skip
            return result.stats.cpu_time, result

        return once

    measured, _ = common.climb(
        [(name, [(0.0, run(torque))]) for name, torque in torques],
        lambda result: 0.0,
        repeats=repeats,
        limit=math.inf,
        budget=math.inf,
    )
    exact = measured[0].last.joints.force
    for row in measured:
        row.error = common.rms_error(row.last.joints.force, exact)
    return measured


def main() -> None:
    arguments = common.arguments(__doc__, "20 s", "3 s")
    t_end, repeats = (0.02, 3) if arguments.quick else (0.2, 9)
    scene = bd.scenes.kubas_case_1()
    case = common.case("case 1", scene, 0.0, t_end)
    torques = [
        ("torque objects", scene.torque_fn),
        ("Numba cfunc", from_numba),
        ("ctypes, Python inside", from_ctypes),
        ("Python, plain floats", floats),
        ("Python, NumPy inside", with_numpy),
    ]
    calls = counted(case)
    measured = rows(case, torques, repeats)
    base = measured[0]
    lines = [
        f"Torque functions: case 1, 0 to {t_end:g} s, method {base.last.stats.method} at its "
        f"default tolerance, {calls} calls, medians of {repeats} interleaved repeats",
        *common.machine(),
        "",
        "torque                      CPU s  ns per call beyond objects  times objects  apart",
    ]
    for row in measured:
        extra = (row.seconds - base.seconds) / calls * 1e9
        lines.append(
            f"{row.name:24s} {row.seconds:8.4f} {extra:28.0f} {row.seconds / base.seconds:14.2f}"
            f" {row.error:6.0e}"
        )
    lines += ["", "method and setting       objects CPU s  plain floats CPU s  times objects"]
    for ladder in common.LADDERS:
        options = ladder.options(ladder.values[len(ladder.values) // 2], case.params)
        mine, python = rows(case, [torques[0], torques[3]], repeats, **options)
        name = f"{ladder.name} {options[ladder.option]:.0e}"
        lines.append(
            f"{name:24s} {mine.seconds:13.4f} {python.seconds:19.4f}"
            f" {python.seconds / mine.seconds:14.2f}"
        )
    common.publish("callback", lines, arguments.write)


if __name__ == "__main__":
    main()
