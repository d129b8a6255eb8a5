"""Exudyn on the two-pulley benchmark that its authors published, beside this package, in one run.

    python -m pip install exudyn
    python benchmarks/exudyn.py [--quick] [--full] [--write]

The drive is `bd.scenes.ntarladima_2023`, in Exudyn `exudyn_model.py`: from rest to 2.45 s. Errors
are those of means over the last 0.05 s (Exudyn's tensions: of the end) against quasi-static creep
theory (`tests/creep_theory.py`), which leaves out gravity and the contact's compliance, 0.02 % of
the speed: errors below that mean nothing. Both codes take one thread and a sample a millisecond.

Times are CPU seconds. Of this package they are of the whole call, settling included, medians of
rounds that take turns with Exudyn's runs; of Exudyn they are of its time integration alone, one run
each. Exudyn runs as documented, and tuned: at twice the step and 1e-4 in place of 1e-8 for Newton's
iteration it is as accurate, and more segments per element are what makes it more so. As documented
it runs with 60 elements; with 120 and 240, too, if asked for by `--full`, which take two and four
times as long.

Each of its runs is compared with our cheapest setting that is at least as accurate. One number may
be right by chance on a coarse mesh: a setting counts if it and all finer meshes with the same
method and tolerance are as accurate, without a warning of any of these runs.
"""

from __future__ import annotations

import contextlib
import math
import statistics
import sys
import time
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import common
import exudyn_model
import numpy as np

import beltdyn as bd

sys.path.insert(0, str(common.HERE.parent / "tests"))
import creep_theory

# They are in the table.
warnings.simplefilter("ignore", bd.BeltdynWarning)

QUANTITIES = ("speed", "torque", "tight", "slack")
LINKS = (24, 30, 36, 48, 60, 80, 120, 240)
CELLS = (28, 54, 82)
SETTINGS = (("lbdf2", 1e-1), ("lbdf2", 3e-2), ("lbdf2", 1e-2), ("rodas4", 1e-1), ("rodas4", 1e-3))
WINDOW = 0.05


def theory() -> dict[str, float]:
    state = creep_theory.two_pulley_benchmark()
    return {
        "speed": state.omega,
        "torque": state.torque,
        "tight": state.tight,
        "slack": state.slack,
    }


@dataclass
class Row:
    """A setting of one of the codes: what it costs, and how far it is off, relative and signed."""

    code: str
    name: str
    links: int
    off: dict[str, float]
    cpu: list[float] = field(default_factory=list)
    warned: str = ""

    @property
    def seconds(self) -> float:
        return statistics.median(self.cpu)

    def error(self, quantities: Sequence[str]) -> float:
        return max(abs(self.off[name]) for name in quantities)


def late_mean(t: np.ndarray, values: np.ndarray) -> Any:
    late = t >= t[-1] - WINDOW - 1e-9
    return np.trapezoid(values[late], t[late], axis=0) / (t[-1] - t[late][0])


def offs(values: Iterable[float], exact: dict[str, float]) -> dict[str, float]:
    found = zip(QUANTITIES, values, strict=True)
    return {name: float(value) / exact[name] - 1.0 for name, value in found}


# ---------------------------------------------------------------- the two codes


@dataclass(frozen=True)
class Ours:
    links: int
    method: str
    rtol: float
    t_end: float
    mesh: str = "joint"

    def run(self) -> tuple[float, bd.Result]:
        scene = bd.scenes.ntarladima_2023(self.links)._replace(t_end=self.t_end)
        scene = common.with_belt(scene, mesh=self.mesh)
        times = np.linspace(0.0, self.t_end, round(self.t_end / exudyn_model.SAMPLES) + 1)
        begin = time.process_time()
        result = bd.simulate(*scene, t_eval=times, method=self.method, rtol=self.rtol)
        return time.process_time() - begin, result

    def row(self, exact: dict[str, float]) -> Row:
        name = f"{self.method} {self.rtol:g}{', ALE' if self.mesh == 'ale' else ''}"
        try:
            result = self.run()[1]
        except bd.SimulationError as error:
            common.progress(f"{self.links} links, {name}: {error}")
            return Row("beltdyn", name, self.links, dict.fromkeys(QUANTITIES, math.inf))
        values = (
            late_mean(result.t, result.pulleys.omega)[1],
            late_mean(result.t, result.pulleys.torque)[0],
            *late_mean(result.t, result.span_tension),
        )
        warned = " ".join(one.code for one in result.warnings if one.code != "strain")
        return Row("beltdyn", name, self.links, offs(values, exact), warned=warned)


def theirs(
    code: str, setting: exudyn_model.Setting, t_end: float, exact: dict[str, float]
) -> tuple[Row, exudyn_model.Run]:
    common.progress(f"Exudyn, {setting}")
    with contextlib.redirect_stdout(sys.stderr):
        run = exudyn_model.Belt(setting).run(t_end)
    # its torque is that of the constraint on the pulley
    values = (late_mean(run.t, run.omega), -late_mean(run.t, run.torque), run.tight, run.slack)
    return Row(code, str(setting), setting.elements, offs(values, exact), [run.cpu]), run


# ---------------------------------------------------------------- tables


def reaches(row: Row, rows: Sequence[Row], target: float, quantities: Sequence[str]) -> bool:
    """Whether it, and all finer meshes with the same setting, come within the target unwarned."""
    finer = [other for other in rows if other.name == row.name and other.links >= row.links]
    return all(not x.warned and x.error(quantities) <= target for x in finer)


def cheapest(rows: Sequence[Row], target: float, quantities: Sequence[str]) -> Row | None:
    good = [row for row in rows if row.cpu and reaches(row, rows, target, quantities)]
    return min(good, key=lambda row: row.seconds, default=None)


def row_lines(rows: Sequence[Row]) -> list[str]:
    head = "code                setting" + " " * 51 + "links    CPU s  runs"
    lines = [head + "".join(f"{name + ' %':>10s}" for name in QUANTITIES) + "  warnings"]
    for row in rows:
        if not row.cpu:
            lines.append(f"{row.code:20s}{row.name:58s}{row.links:5d}    fails")
            continue
        cells = "".join(f"{100.0 * row.off[name]:+10.3f}" for name in QUANTITIES)
        lines.append(
            f"{row.code:20s}{row.name:58s}{row.links:5d}{row.seconds:9.3f}{len(row.cpu):6d}{cells}"
            f"  {row.warned}"
        )
    return lines


def equal_lines(ours: Sequence[Row], peers: Sequence[Row], quantities: Sequence[str]) -> list[str]:
    """For each run of Exudyn the cheapest setting of ours that is at least as accurate."""
    lines = ["error %   Exudyn" + " " * 69 + "CPU s   beltdyn" + " " * 21 + "CPU s   times"]
    for peer in peers:
        error = peer.error(quantities)
        mine = cheapest(ours, error, quantities)
        text = f"{100.0 * error:7.3f}   {peer.code[8:]}: {peer.name}"
        text = f"{text:81s}{peer.seconds:9.1f}   "
        if mine is None:
            lines.append(f"{text}none is as accurate")
            continue
        lines.append(
            f"{text}{f'{mine.links} links, {mine.name}':25s}{mine.seconds:8.3f}"
            f"{peer.seconds / mine.seconds:8.0f}"
        )
    return lines


def transient_line(code: str, t: np.ndarray, omega: np.ndarray) -> str:
    window = (t >= 0.6) & (t <= 0.8)
    t, omega = t[window], omega[window]
    peak = int(omega.argmax())
    low = peak + int(omega[peak:].argmin())
    return (
        f"  {code}: peak {omega[peak]:.4f} rad/s at {t[peak]:.3f} s, minimum {omega[low]:.4f} "
        f"at {t[low]:.3f} s"
    )


def draw(ours: Sequence[Row], peers: Sequence[Row]) -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for code, (colour, marker) in common.colours([r.name for r in ours]).items():
        rows = [row for row in ours if row.name == code and row.cpu]
        x = [row.seconds for row in rows]
        y = [100.0 * row.error(["speed"]) for row in rows]
        axes.loglog(x, y, marker, color=colour, label=f"beltdyn, {code}")
    for code, marker in (("Exudyn, documented", "s"), ("Exudyn, tuned", "D")):
        rows = [row for row in peers if row.code == code]
        x = [row.seconds for row in rows]
        y = [100.0 * row.error(["speed"]) for row in rows]
        axes.loglog(x, y, marker, color="black", fillstyle="none", label=code)
    axes.set(xlabel="CPU time [s]", ylabel="error of the driven pulley's speed [%]")
    axes.set_ylim(1e-3, 1.0)
    axes.axhspan(1e-3, 0.02, color="0.92", zorder=0, label="what theory leaves out")
    axes.legend(loc="lower right", fontsize=8)
    axes.grid(alpha=0.3)
    return figure


def main() -> None:
    full = "--full" in sys.argv
    if full:
        sys.argv.remove("--full")
    options = common.arguments(__doc__, "6 minutes (with --full 14)", "10 s")
    exact = theory()
    t_end = 0.1 if options.quick else exudyn_model.T_END
    links = LINKS[:2] if options.quick else LINKS
    settings = [
        Ours(n, method, rtol, t_end, mesh)
        for mesh, numbers in (("joint", links), ("ale", CELLS[:1] if options.quick else CELLS))
        for method, rtol in SETTINGS
        for n in numbers
    ]
    jobs = [("Exudyn, tuned", one) for one in exudyn_model.TUNED]
    documented = exudyn_model.DOCUMENTED if full else exudyn_model.DOCUMENTED[:1]
    jobs += [("Exudyn, documented", one) for one in documented]
    jobs = jobs[:1] if options.quick else jobs

    ours = [one.row(exact) for one in settings]
    timed = [
        pair
        for pair in zip(settings, ours, strict=True)
        if math.isfinite(pair[1].error(QUANTITIES))
    ]
    peers, histories = [], []
    for code, job in jobs:
        for one, row in timed:
            row.cpu.append(one.run()[0])
        peer, run = theirs(code, job, t_end, exact)
        peers.append(peer)
        histories.append((str(peer.name), run.t, run.omega))
    for one, row in timed:
        row.cpu.append(one.run()[0])

    package = f"Exudyn {version('exudyn')}"
    lines = [
        f"Two-pulley benchmark to {t_end:g} s; errors against creep theory"
        + (", which begins to hold at 2 s" if options.quick else ""),
        *common.machine(),
        f"{package}, without range checks, one thread",
        "theory: " + ", ".join(f"{name} {value:.6g}" for name, value in exact.items()),
        "",
        *row_lines([*peers, *ours]),
    ]
    if not options.quick:
        finest = max(settings, key=lambda one: (one.links, -one.rtol))
        result = finest.run()[1]
        lines += ["", "CPU time at equal error of the driven pulley's speed"]
        lines += equal_lines(ours, peers, ["speed"])
        lines += ["", "CPU time at equal largest error of speed, torque and both tensions; theory"]
        lines[-1] += " leaves out 0.3 % of the slack tension, which both codes have"
        lines += equal_lines(ours, peers, QUANTITIES)
        lines += [
            "",
            "Transient; published: peak 12.1131 rad/s at 0.645 s, minimum 11.3627 at 0.729",
        ]
        lines += [
            transient_line(f"beltdyn, {finest.links} links", result.t, result.pulleys.omega[:, 1]),
            *(transient_line(*history) for history in histories),
        ]
    figure = draw(ours, peers) if options.write else None
    common.publish("exudyn", lines, options.write, figure)


if __name__ == "__main__":
    main()
