"""Common to all benchmarks: the methods measured, times, errors, references, output.

ERROR is the root mean square, over joints and over irregular sample times, of the joint force
against a reference, relative to the mean tension. A reference is a run at a tolerance far below all
others. Its difference to a second one by an unrelated method is the floor: smaller errors cannot
be measured.

TIMES are CPU seconds without settling and without the run up to the start of the window. They are
medians of interleaved repeats, all settings once per round, so that a machine that slows down
slows all of them. Settings that take longer than a second or so are repeated less often, as the
tables show.
"""

from __future__ import annotations

import argparse
import ast
import json
import math
import multiprocessing
import platform
import resource
import signal
import statistics
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import attrs
import numpy as np

import beltdyn as bd
from beltdyn.base.run_options import METHODS

# The paper's belt has 60 links by design; whatever else a run warns of is to be seen.
warnings.filterwarnings("ignore", "mesh", UserWarning)

HERE = Path(__file__).parent
RESULTS = HERE / "results"


@dataclass(frozen=True)
class Ladder:
    """A method and the settings to measure it at, from loose to tight."""

    method: str
    option: str  # "rtol" or "step"
    values: tuple[float, ...]
    per_bound: bool = False  # values are times the drive's spectral bound: explicit, fixed step

    @property
    def name(self) -> str:
        return f"{self.method} {self.option}"

    def options(self, value: float, params: bd.Params) -> dict[str, Any]:
        scale = 1.0 / params.info["spectral_bound"] if self.per_bound else 1.0
        return {"method": self.method, self.option: value * scale}


#: Every method of the package; one whose name it does not know is left out.
LADDERS = tuple(
    ladder
    for ladder in (
        Ladder("auto", "rtol", (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)),
        Ladder("tsit5", "rtol", (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)),
        Ladder("rk4", "step", (2.5, 1.25, 0.5, 0.2), per_bound=True),
        Ladder("lie", "step", (4e-4, 2e-4, 1e-4, 5e-5, 2e-5)),
        Ladder("lie", "rtol", (1e-1, 1e-2, 1e-3)),
        Ladder("lbdf2", "step", (4e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6)),
        Ladder("lbdf2", "rtol", (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)),
        Ladder("rodas4", "rtol", (1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)),
    )
    if ladder.method in METHODS
)

#: The reference, and the unrelated method it must agree with.
REFERENCE = Ladder("tsit5", "rtol", (1e-11,))
UNRELATED = Ladder("rodas4", "rtol", (1e-8,))
#: Of either: so many are no error here, as they would be of a run without a limit.
MOST_STEPS = 10_000_000


# ---------------------------------------------------------------- what is run


@dataclass(frozen=True)
class Case:
    """A window of a scene: from a state, over irregular sample times, to an end."""

    name: str
    params: bd.Params
    torque: bd.TorqueLike
    start: bd.State
    t_end: float
    times: np.ndarray = field(repr=False)

    @property
    def duration(self) -> float:
        return self.t_end - self.start.t

    def run(self, **options: Any) -> bd.Result:
        return bd.simulate(
            self.params, self.torque, self.t_end, initial=self.start, t_eval=self.times, **options
        )


def case(name: str, scene: bd.Scene, t0: float, t1: float) -> Case:
    """The scene from t0, where it got to from rest by itself, to t1.

    A thousand samples per simulated second, the default of a run of one: more would be what is
    timed, when steps are long.
    """
    start = bd.settle(scene.params)
    if t0 > 0.0:
        start = bd.simulate(*scene[:2], t0, initial=start, t_eval=[t0]).final_state
    samples = max(20, round(1000 * (t1 - t0)))
    times = np.sort(np.random.default_rng(1).uniform(t0, t1, samples))
    return Case(name, scene.params, scene.torque_fn, start, t1, times)


def with_belt(scene: bd.Scene, **changes: Any) -> bd.Scene:
    """The same scene with other numbers of the belt."""
    belt = attrs.evolve(scene.params.belt, **changes)
    return scene._replace(params=attrs.evolve(scene.params, belt=belt))


# ---------------------------------------------------------------- errors


def rms_error(force: np.ndarray, exact: np.ndarray) -> float:
    return float(np.sqrt(np.mean((force - exact) ** 2)) / np.mean(exact))


@dataclass(frozen=True)
class Reference:
    force: np.ndarray = field(repr=False)
    floor: float
    text: str  # which methods agreed on it, and how far

    def error(self, result: bd.Result) -> float:
        return rms_error(result.joints.force, self.force)


def reference(case: Case) -> Reference:
    """Two unrelated methods at tight settings: the first one's forces, their difference."""
    force, check = (
        case.run(max_steps=MOST_STEPS, **ladder.options(ladder.values[0], case.params)).joints.force
        for ladder in (REFERENCE, UNRELATED)
    )
    floor = rms_error(check, force)
    names = " and ".join(f"{x.name} {x.values[0]:g}" for x in (REFERENCE, UNRELATED))
    return Reference(force, floor, f"reference by {names}, apart by {floor:.1e} (the floor)")


# ---------------------------------------------------------------- times


@dataclass
class Row:
    """One setting of one method: what it costs and gives."""

    name: str
    value: float
    cpu: list[float]  # seconds per run
    error: float
    last: Any = None  # what the last run gave

    @property
    def seconds(self) -> float:
        return statistics.median(self.cpu)


#: A run: gives the CPU seconds it counts and what it computed.
Run = Callable[[], tuple[float, Any]]


def climb(
    ladders: Iterable[tuple[str, Sequence[tuple[float, Run]]]],
    error: Callable[[Any], float],
    *,
    repeats: int,
    limit: float,
    budget: float,
    failures: tuple[type[Exception], ...] = (bd.SimulationError,),
) -> tuple[list[Row], list[str]]:
    """Measure named ladders of runs, loose to tight.

    A ladder ends at its first rung that takes more than ``limit`` CPU seconds. Repeats are
    interleaved; a rung is repeated while its repeats together take less than ``budget`` seconds.

    Returns:
        A row per rung, and a line for each that failed.
    """
    measured: list[tuple[Row, Run]] = []
    failed: list[str] = []
    for name, rungs in ladders:
        progress(name)
        for value, run in rungs:
            try:
                seconds, result = run()
            except failures as failure:
                failed.append(f"{name} {value:g} fails: {failure}")
                continue
            measured.append((Row(name, value, [seconds], error(result), result), run))
            if seconds > limit:
                break
    for round_ in range(1, repeats):
        for row, run in measured:
            if (round_ + 1) * row.cpu[0] <= budget:
                seconds, row.last = run()
                row.cpu.append(seconds)
    return [row for row, _ in measured], failed


def measure(
    case: Case,
    exact: Reference,
    ladders: Iterable[Ladder] = LADDERS,
    *,
    repeats: int,
    limit: float,
    budget: float,
) -> tuple[list[Row], list[str]]:
    """Climb ladders of the package's own methods on a case."""

    def rung(options: dict[str, Any]) -> Run:
        def run() -> tuple[float, bd.Result]:
            result = case.run(**options)
            return result.stats.cpu_time, result

        return run

    runs = []
    for ladder in ladders:
        settings = [ladder.options(value, case.params) for value in ladder.values]
        runs.append((ladder.name, [(chosen[ladder.option], rung(chosen)) for chosen in settings]))
    return climb(runs, exact.error, repeats=repeats, limit=limit, budget=budget)


def cheapest(rows: Iterable[Row], target: float) -> Row | None:
    """The cheapest row that reaches the error."""
    good = [row for row in rows if row.error <= target]
    return min(good, key=lambda row: row.seconds, default=None)


def row_lines(rows: Iterable[Row], duration: float) -> list[str]:
    """A table of what each setting of the package's methods cost and gave."""
    lines = [
        "method           setting   CPU s per s  repeats      steps   rejected  RHS calls"
        "  Jacobians  error rms"
    ]
    for row in rows:
        stats = row.last.stats
        lines.append(
            f"{row.name:14s} {row.value:9.1e} {row.seconds / duration:13.5f} {len(row.cpu):8d}"
            f" {stats.steps:10d} {stats.rejected:10d} {stats.nfev:10d} {stats.njev:10d}"
            f" {row.error:10.1e}"
        )
    return lines


# ---------------------------------------------------------------- in and out


def arguments(description: str | None, full: str, quick: str) -> argparse.Namespace:
    """``--quick`` and ``--write``; the texts say how long each run takes."""
    parser = argparse.ArgumentParser(
        description=(description or "").partition("\n")[0],
        epilog=f"In full this takes {full}, with --quick {quick}.",
    )
    parser.add_argument("--quick", action="store_true", help="shorter windows, fewer settings")
    parser.add_argument("--write", action="store_true", help="keep table and figure under results/")
    return parser.parse_args()


def machine() -> list[str]:
    """Facts without which no time means anything."""
    model, wide = platform.processor() or platform.machine(), ""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        facts = [line.partition(":")[::2] for line in cpuinfo.read_text().splitlines()]
        names = [value.strip() for key, value in facts if key.strip() == "model name"]
        flags = next((value.split() for key, value in facts if key.strip() == "flags"), [])
        model = f"{len(names)} x {names[0]}" if names else model
        wide = " ".join(x for x in ("avx2", "fma", "avx512f", "avx512vl") if x in flags)
    versions = [f"{platform.python_implementation()} {platform.python_version()}"]
    versions += [f"beltdyn {bd.__version__}", f"NumPy {np.__version__}"]
    return [
        f"{model} ({wide or 'no wide vectors'}), {platform.system()} {platform.release()}; "
        + ", ".join(versions),
        f"core built with {' '.join(_compile_flags())}",
    ]


def _compile_flags() -> list[str]:
    """FLAGS of setup.py, which cannot be imported: it would build."""
    tree = ast.parse((HERE.parent / "setup.py").read_text())
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "FLAGS":
            return list(ast.literal_eval(node.value))
    raise LookupError("setup.py has no FLAGS")


def progress(text: str) -> None:
    print(f"... {text}", file=sys.stderr, flush=True)


def publish(name: str, lines: Iterable[str], write: bool, figure: Any = None) -> None:
    """Print the text; with ``write`` keep it and the figure under results/."""
    text = "\n".join(lines)
    print(text)
    if write:
        RESULTS.mkdir(exist_ok=True)
        (RESULTS / f"{name}.txt").write_text(text + "\n")
        if figure is not None:
            figure.savefig(RESULTS / f"{name}.png", dpi=130)


def colours(names: Sequence[str]) -> dict[str, tuple[Any, str]]:
    """A colour and a marker for each name, in order of first appearance, the same everywhere."""
    import matplotlib as mpl

    unique, markers = list(dict.fromkeys(names)), "osv^D<>P*Xhp"
    palette = mpl.colormaps["tab10" if len(unique) <= 10 else "tab20"].colors
    return {n: (palette[k % len(palette)], markers[k % len(markers)]) for k, n in enumerate(unique)}


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Fitted exponent of y over x; nan from less than two points."""
    if len(x) < 2:
        return math.nan
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def isolated(function: Callable[[], Any], seconds: float) -> tuple[str, Any]:
    """Call it in a process of its own, which may take so much CPU time and may die.

    Returns:
        "done" and what it returned; "budget" or "crash" with None or, of a crash, the exit code.
    """

    def work(to: Any) -> None:
        used = time.process_time()
        limit = math.ceil(used + seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        to.send(function())

    context = multiprocessing.get_context("fork")
    from_, to = context.Pipe(duplex=False)
    process = context.Process(target=work, args=(to,), daemon=True)
    process.start()
    to.close()
    try:
        found = from_.recv()
    except EOFError:
        process.join()
        late = process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL)
        return ("budget", None) if late else ("crash", process.exitcode)
    process.join()
    return "done", found


def read_records(path: Path, key: Callable[[dict[str, Any]], Any]) -> dict[Any, dict[str, Any]]:
    """Lines of JSON by their key; one cut off by an interruption is left out."""
    records = {}
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue
        records[key(record)] = record
    return records
