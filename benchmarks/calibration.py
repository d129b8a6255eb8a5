"""True error over the error asked for, by drive, method and tolerance.

    python benchmarks/calibration.py [--quick] [--write]

The drives are the library's scenes, and M and U (see mesh.py) on the mesh "joint" with 60 and 120
links, over their first 0.15 to 0.45 s. The error is that of `common.py`; references are made by
"tsit5" at 1e-9 and "rodas4" at 1e-8, and their difference is the floor: a ratio is only told where
the error is at least three times that.

A ratio is as it should be between 1/10 and 3. Explicit steps that stability keeps short ("s") have
a smaller error than was asked for, without any waste that error control could avoid: steps less
than 1.3 times as many as "tsit5" takes at rtol = 0.1, or at the loosest tolerance that is not
refused for the energy it adds.

At the end: how many ratios would be as they should if a method were given another tolerance than
rtol, `factor` times rtol, or rtol^power, the same at 1e-2: with its power of error_target[1] the
factor is one on error_target[0] of a method (csrc/solvers/), on the mesh "joint" of
error_target_smooth.
Between the tolerances measured the error is interpolated as a power of rtol, beyond them it is
taken as proportional to it. Runs at rtol = 0.1 serve that alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import common
import numpy as np
from mesh import DRIVES

import beltdyn as bd
from beltdyn.base.run_warnings import silenced

BAND = (0.1, 3.0)
ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
LOOSEST = 1e-1
LEAST = {"lbdf2": 1e-5}  # the tightest tolerance of a method that gets slow
LEAST_QUICK = {"lbdf2": 1e-4}
METHODS = ("tsit5", "rodas4", "lbdf2", "auto")
STABILITY = 1.3
SAMPLES = 150
REFERENCE, UNRELATED = ("tsit5", 1e-9), ("rodas4", 1e-8)
FACTORS = (0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10)
POWERS = (0.9, 0.8, 0.7, 0.6)

#: Ends of the windows [s].
WINDOWS = {
    "kubas-case-1": 0.45,
    "kubas-case-2": 0.40,
    "three-pulleys": 0.20,
    "unequal-pulleys": 0.15,
    "flywheel-start": 0.20,
}


@dataclass(frozen=True)
class Record:
    """One run: what was asked for, and the error got."""

    drive: str
    mesh: str
    method: str
    rtol: float
    error: float
    floor: float
    steps: int
    estimate: float | None
    chosen: str  # by "auto"
    limited: bool  # its explicit steps by stability

    @property
    def ratio(self) -> float:
        return self.error / self.rtol

    @property
    def known(self) -> bool:
        return self.error >= 3.0 * self.floor

    @property
    def right(self) -> bool:
        return BAND[0] <= self.ratio <= BAND[1]


def cases(quick: bool) -> Iterable[tuple[str, Callable[[], bd.Scene], float]]:
    for name in bd.scenes.names():
        if not quick or name in ("kubas-case-1", "unequal-pulleys"):
            yield name, (lambda name=name: bd.scenes.get(name)), WINDOWS[name]  # type: ignore[misc]
    for name in ("M", "U"):
        for links in (60,) if quick else (60, 120):

            def build(name: str = name, links: int = links) -> bd.Scene:
                return common.with_belt(DRIVES[name][0](), mesh="joint", n_bodies=links)

            yield f"{name} {links}", build, 0.4


def study(name: str, scene: bd.Scene, t_end: float, least: dict[str, float]) -> list[Record]:
    """Run a drive with every method and tolerance."""
    params, torque, *_ = scene
    times = np.sort(np.random.default_rng(5).uniform(0.0, t_end, SAMPLES))
    start = bd.settle(params)

    def run(method: str, rtol: float) -> bd.Result:
        return bd.simulate(
            params, torque, t_end, initial=start, t_eval=times, method=method, rtol=rtol
        )

    exact, check = (run(*setting).joints.force for setting in (REFERENCE, UNRELATED))
    floor = common.rms_error(check, exact)
    common.progress(f"{name}: floor {floor:.1e}")
    records: list[Record] = []
    most = 0.0
    for method in METHODS:
        for rtol in (LOOSEST, *ASKED):
            if rtol < least.get(method, 0.0):
                continue
            try:
                result = run(method, rtol)
            except bd.SimulationError as failure:
                common.progress(f"{name}, {method}, {rtol:g}: {failure}")
                continue
            stats = result.stats
            most = most or STABILITY * stats.steps  # the first that "tsit5" got through
            records.append(
                Record(
                    name,
                    params.belt.mesh,
                    method,
                    rtol,
                    common.rms_error(result.joints.force, exact),
                    floor,
                    stats.steps,
                    stats.error,
                    stats.method,
                    stats.method == "tsit5" and stats.steps <= most,
                )
            )
    return records


# ---------------------------------------------------------------- tables


def judged(records: Iterable[Record], method: str | None = None) -> list[Record]:
    """Those asked for whose ratio can be told."""
    return [
        record
        for record in records
        if record.known and record.rtol in ASKED and method in (None, record.method)
    ]


def cell(record: Record | None) -> str:
    if record is None:
        return f"{'-':>10s} "
    below = "" if record.known else "<"
    return f"{below + format(record.ratio, '.3g'):>10s}{'s' if record.limited else ' '}"


def ratio_lines(records: Sequence[Record]) -> list[str]:
    lines = [
        "error over rtol; s: steps limited by stability, <: error below 3 floors, -: no run",
        "drive            floor   method " + "".join(f"{rtol:>11.0e}" for rtol in ASKED),
    ]
    for drive in dict.fromkeys(record.drive for record in records):
        for method in METHODS:
            by_rtol = {r.rtol: r for r in records if (r.drive, r.method) == (drive, method)}
            text = "".join(map(cell, map(by_rtol.get, ASKED)))
            floor = max(record.floor for record in by_rtol.values())
            lines.append(f"{drive:16s} {floor:.1e} {method:7s}{text}")
    return lines


def share(records: Sequence[Record]) -> str:
    if not records:
        return f"{'-':>18s}"
    right = sum(record.right for record in records)
    return f"{right:6d} of {len(records):3d} {100 * right / len(records):4.0f} %"


def share_lines(records: Sequence[Record]) -> list[str]:
    lines = [
        f"ratios within {BAND[0]:g} to {BAND[1]:g}",
        "method               all      without stability      too small   too large   median",
    ]
    for method in (None, *METHODS):
        found = judged(records, method)
        free = [record for record in found if not record.limited]
        small = sum(record.ratio < BAND[0] for record in free)
        large = sum(record.ratio > BAND[1] for record in free)
        lines.append(
            f"{method or 'all':7s} {share(found)} {share(free)} {small:14d} {large:11d}"
            f" {np.median([r.ratio for r in free] or [math.nan]):8.3f}"
        )
    return lines


def exception_lines(records: Sequence[Record]) -> list[str]:
    off = [r for r in judged(records) if not (r.right or r.limited)]
    lines = ["exceptions that stability does not explain: ratio, error estimated over rtol"]
    for record in sorted(off, key=lambda record: record.ratio):
        ran = f" ({record.chosen})" if record.method == "auto" else ""
        estimate = f"{record.estimate / record.rtol:.3g}" if record.estimate else "none"
        lines.append(
            f"  {record.drive:16s} {record.method:6s} {record.rtol:.0e} "
            f"{record.ratio:8.3g} {estimate:>9s}{ran}"
        )
    return lines


# ---------------------------------------------------------------- constants


def count(records: Iterable[Record], factor: float, power: float = 1.0) -> tuple[int, int]:
    """How many ratios would be in the band with another tolerance, and of how many."""
    right = total = 0
    known = [record for record in records if record.known]
    for drive in dict.fromkeys(record.drive for record in known):
        run = sorted((r for r in known if r.drive == drive), key=lambda record: record.rtol)
        rtol, error = np.log([[record.rtol, record.error] for record in run]).T
        asked = np.log([r.rtol for r in run if r.rtol in ASKED and not r.limited])
        given = math.log(factor) + power * asked + (1.0 - power) * math.log(ASKED[0])
        inside = np.clip(given, rtol[0], rtol[-1])
        ratio = np.exp(np.interp(inside, rtol, error) + (given - inside) - asked)
        right += int(np.sum((ratio >= BAND[0]) & (ratio <= BAND[1])))
        total += asked.size
    return right, total


def constant_lines(records: Sequence[Record]) -> list[str]:
    lines = [
        "ratios in the band, those limited by stability left out, by the factor on the tolerance,"
        " and by its power",
        "mesh   method      of"
        + "".join(f"{f'x {factor:g}':>7s}" for factor in FACTORS)
        + "".join(f"{f'^ {power:g}':>8s}" for power in POWERS),
    ]
    for mesh in ("joint", "paper"):
        for method in ("tsit5", "rodas4", "lbdf2"):
            mine = [r for r in records if (r.mesh, r.method) == (mesh, method)]
            if not mine:
                continue
            lines.append(
                f"{mesh:6s} {method:7s}{count(mine, 1.0)[1]:7d}"
                + "".join(f"{count(mine, factor)[0]:7d}" for factor in FACTORS)
                + "".join(f"{count(mine, 1.0, power)[0]:8d}" for power in POWERS)
            )
    return lines


def main() -> None:
    arguments = common.arguments(__doc__, "5 minutes", "20 s")
    records: list[Record] = []
    with silenced():
        for name, build, t_end in cases(arguments.quick):
            window = 0.1 if arguments.quick else t_end
            least = LEAST_QUICK if arguments.quick else LEAST
            records += study(name, build(), window, least)
    lines = [
        "Calibration of tolerances: true error of joint forces, rms over mean tension, over rtol",
        *common.machine(),
        "",
        *ratio_lines(records),
        "",
        *share_lines(records),
        "",
        *exception_lines(records),
        "",
        *constant_lines(records),
    ]
    common.publish("calibration", lines, arguments.write)


if __name__ == "__main__":
    main()
