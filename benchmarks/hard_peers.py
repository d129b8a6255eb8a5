"""The hard scenes for SciPy's solvers and SUNDIALS CVODE, on the compiled model of `peers.py`.

All start from the package's settled state, on the paper's belt, and are asked for the same: an
error of 1e-3 of a joint's stretch; 1e-2 of the tension is good enough. A solver may take a hundred
times the CPU time of "auto", at least LEAST seconds. Constant speeds that are prescribed are a
pulley of hardly limited inertia in the peers' model; what that cannot express is listed with the
reason. Solvers are begun anew where a torque jumps or bends, if that is seldom. The model of each
scene is checked first (`peers_check.py`); what fails there or elsewhere is listed by name, and the
others go on.
"""

from __future__ import annotations

import collections
import json
import statistics
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import attrs
import common
import judged
import numpy as np
import numpy_model
import peers_check
from numba_model import BAND
from peers import Problem, filled

import beltdyn as bd
from beltdyn.base import run_warnings
from beltdyn.scenes.hard_scenes import HardScene

Record = dict[str, Any]
TOLERANCE, GOOD = 1e-3, 1e-2
LEAST, MOST, TIMES = 2.0, 30.0, 100.0
#: Steps of a reference at most.
MAX_REFERENCE_STEPS = 1_000_000
#: A matrix of seven variables of each, squared, is 0.4 GB.
MOST_LINKS = 1000
OURS = "beltdyn auto"
#: A pulley that no belt slows down [kg m^2].
DRIVEN = 1e9
KINDS = {
    "solved": "solved: error of 1e-2 of the tension at most",
    "said": "warned that it may be off (the package alone)",
    "refused": "ended in an error",
    "budget": f"more than a hundred times our CPU time, at least {LEAST:g} s, at most {MOST:g} s",
    "unjudged": "finished, and no reference is sure",
    "quiet": "wrong by more, or no error where there must be one, without a word",
    "broken": "not finite, or a crash",
}
LETTERS = {"solved": "+", "said": "w", "refused": "r", "budget": "b", "unjudged": "?"}
LETTERS |= {"quiet": "!", "broken": "X"}


def solvers(problem: Problem) -> dict[str, Callable[[float, float], Any]]:
    """Each with the linear algebra that was the cheapest for it on the paper's case 1."""
    free, folded = problem.natural, problem.folded
    band = {"linsolver": "band", "lband": BAND, "uband": BAND, "jacfn": filled(folded)}
    lsoda = {"jac": folded.packed, "lband": BAND, "uband": BAND}
    return {
        "SciPy RK45": problem.scipy("RK45", free.rhs, free.order),
        "SciPy LSODA": problem.scipy("LSODA", folded.rhs, folded.order, **lsoda),
        "SciPy BDF": problem.scipy("BDF", free.rhs, free.order, jac=free.jacobian),
        "SciPy Radau": problem.scipy("Radau", free.rhs, free.order, jac=free.jacobian),
        "CVODE BDF": problem.cvode("BDF", 5, folded, **band),
        "CVODE Adams": problem.cvode("Adams", 12, folded, **band),
    }


def expressed(scene: HardScene) -> HardScene:
    """The scene on the paper's belt, prescribed constant speeds as inertia.

    Raises:
        ValueError: That is not possible; the reason.
    """
    found = scene if scene.params.belt.mesh == "paper" else scene.with_belt("paper")
    if found is None:
        raise ValueError("axes that move")
    pulleys = list(found.params.pulleys)
    for k, motion in (found.motion or {}).items():
        values = np.unique(motion.values) if isinstance(motion, bd.PiecewiseLinear) else ()
        if len(values) != 1:
            raise ValueError("a speed that is prescribed and changes")
        pulleys[k] = attrs.evolve(pulleys[k], inertia=DRIVEN)
    if found.params.belt.n_bodies > MOST_LINKS:
        raise ValueError("more links than the full matrix that scikit-sundae fills has memory for")
    params = attrs.evolve(found.params, pulleys=pulleys)
    numpy_model.Drive.of(found._replace(params=params, motion=None))
    return found._replace(params=params)


def runs(name: str, done: Iterable[str]) -> Iterable[Record]:
    """Records of a scene by every solver; one without a solver: why it cannot be."""
    scene = bd.scenes.hard[name]
    base = {"scene": name, "family": scene.family}
    if scene.expects == "BD_ERR_NOT_SETTLED":
        yield base | {"solver": "", "why": "no state at rest to start from"}
        return
    try:
        theirs = expressed(scene)
        ours = scene if scene.params.belt.mesh == "paper" else scene.with_belt("paper")
        begin = ours.initial() or bd.settle(ours.params)
    except (ValueError, bd.SimulationError) as failure:
        yield base | {"solver": "", "why": str(failure)}
        return
    times = np.sort(np.random.default_rng(1).uniform(begin.t, ours.t_end, 60))
    exact = reference(ours, begin, times)
    free = theirs._replace(motion=None)
    case = common.Case(name, free.params, free.torque_fn, begin, ours.t_end, times)
    problem = Problem(case, free)
    base["check"] = peers_check.check(problem, case)

    def us() -> Any:
        options = {"initial": begin, "t_eval": times, "max_steps": 10_000_000}
        with run_warnings.silenced():
            return ours.run("auto", **{"rtol": TOLERANCE, **ours.options, **options})

    def attempt(solve: Any, tolerance: float) -> Record:
        kind, cpu, force, text = ended(solve or us, ours, problem, limit, tolerance)
        error = exact.error(force) if exact is not None and kind == "" else None
        if error is not None:
            kind = "solved" if error <= GOOD else "said" if text else "quiet"
        elif kind == "":
            kind = "quiet" if scene.expects else "said" if text else "unjudged"
        return {"kind": kind, "cpu": cpu, "error": error, "text": text}

    limit = MOST
    for solver, solve in {OURS: None, **solvers(problem)}.items():
        if solver in done and solver != OURS:
            continue
        record = base | {"solver": solver} | attempt(solve, TOLERANCE)
        if solver == OURS:
            record["kind"] = "solved" if record["text"] == scene.expects else record["kind"]
            limit = min(max(TIMES * record["cpu"], LEAST), MOST)
        elif record["kind"] == "quiet" and exact is not None:
            record["tighter"] = attempt(solve, 0.1 * TOLERANCE)
        if solver not in done:
            yield record


def reference(scene: HardScene, begin: bd.State, times: np.ndarray) -> judged.Reference | None:
    """One that is sure of itself, or that an unrelated one agrees with far better than is asked."""
    given = (scene.params, scene.torque_fn, scene.t_end, begin, times, "auto", MAX_REFERENCE_STEPS)
    found: list[judged.Reference] = []
    for one in judged.references(*given, motion=scene.motion):
        if one.sure or any(one.error(other.force) < 0.01 * GOOD for other in found):
            return one
        found.append(one)
    return None


def told(name: str, done: Iterable[str]) -> Iterable[Record]:
    """Records of a scene; what stops it, as a check that fails, is one, and not the table's end."""
    try:
        yield from runs(name, done)
    except Exception as failure:
        text = f"{type(failure).__name__}: {failure}"
        yield {"scene": name, "family": bd.scenes.hard[name].family, "solver": "", "failed": text}


def ended(
    solve: Callable[..., Any], scene: HardScene, problem: Problem, limit: float, tolerance: float
) -> tuple[str, float, Any, str]:
    """Kind ("" where the error has to tell), CPU seconds, forces, and what was said."""

    def call() -> tuple[str, float, Any, str]:
        begun = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = solve(tolerance, scene.t_end) if scene_takes(solve) else solve()
        except (bd.SimulationError, RuntimeError, ValueError, FloatingPointError) as failure:
            said = getattr(failure, "symbol", str(failure)[:100])
            return "refused", time.process_time() - begun, None, said
        cpu, said = time.process_time() - begun, ""
        if isinstance(found, bd.Result):
            force = found.joints.force
            said = ", ".join(judged.IN_TIME & {one.code for one in found.warnings})
        else:
            force = problem.force(found)
        return ("" if np.all(np.isfinite(force)) else "broken"), cpu, force, said

    how, found = common.isolated(call, limit)
    if how == "done":
        return found  # type: ignore[no-any-return]
    return ("budget" if how == "budget" else "broken"), limit, None, how


def scene_takes(solve: Callable[..., Any]) -> bool:
    return solve.__code__.co_argcount == 2


def key_of(record: Record) -> tuple[str, str]:
    return record["scene"], record["solver"]


def study(names: list[str], path: Path, table: bool, quick: bool, write: bool) -> None:
    records = common.read_records(path, key_of)
    path.parent.mkdir(parents=True, exist_ok=True)
    if not table:
        with path.open("a") as out:
            for name in names[:2] if quick else names:
                done = {solver for scene, solver in records if scene == name}
                if done & {"", "CVODE Adams"}:
                    continue
                common.progress(name)
                for record in told(name, done):
                    line = json.dumps(record)
                    records[key_of(record)] = json.loads(line)
                    print(line, file=out, flush=True)
    common.publish("hard_peers", lines(list(records.values())), write)


def cell(record: Record) -> str:
    return f"{LETTERS[record['kind']]:>5s}{record['cpu']:8.2g}s"


def lines(records: list[Record]) -> list[str]:
    ran = [r for r in records if r["solver"]]
    scenes = list(dict.fromkeys(r["scene"] for r in ran))
    of = {key_of(r): r for r in ran}
    names = list(dict.fromkeys(r["solver"] for r in ran))
    found = [
        f"Hard scenes for other solvers: {len(scenes)}, on the paper's belt", *common.machine(), "",
        *(f"{LETTERS[kind]}  {text}" for kind, text in KINDS.items()), "",
        "cheaper: solved in less CPU time than \"auto\" took, or where \"auto\" did not solve it",
        "cost: median of CPU times over those of \"auto\", of what both solved",
        f"{'':14s}" + "".join(f"{kind:>9s}" for kind in KINDS) + "  cheaper     cost",
    ]  # fmt: skip
    for name in names:
        mine = [r for r in ran if r["solver"] == name]
        counts = collections.Counter(r["kind"] for r in mine)
        solved = [(r, of[r["scene"], OURS]) for r in mine if r["kind"] == "solved"]
        both = [r["cpu"] / us["cpu"] for r, us in solved if us["kind"] == "solved"]
        wins = sum(us["kind"] != "solved" or r["cpu"] < us["cpu"] for r, us in solved)
        row = "".join(f"{counts[kind]:9d}" for kind in KINDS)
        cost = f"{statistics.median(both):9.1f}" if both else "        -"
        found.append(f"{name:14s}{row}{wins:9d}{cost}")
    width = max(map(len, scenes), default=10) + 2
    found += ["", " " * width + "".join(f"{name.replace(' ', '-'):>14s}" for name in names)]
    for scene in scenes:
        cells = (of.get((scene, name)) for name in names)
        row = "".join(f"{'':>14s}" if r is None else cell(r) for r in cells)
        found.append(f"{scene:{width}s}{row}")
    found += ["", "wrong without a word, and by a tenth of the tolerance:"]
    for r in (r for r in ran if r["kind"] == "quiet"):
        by = "there must be an error, and the peers' model knows none"
        if r["error"] is not None:
            then = r["tighter"]
            by = f"off by {r['error']:.1e}; then {then['kind']}, {then['cpu']:.2g} s"
            by += "" if then["error"] is None else f", off by {then['error']:.1e}"
        found.append(f"  {r['scene']}, {r['solver']}: {by}")
    for heading, field in {"not run": "why", "FAILED": "failed"}.items():
        reasons: dict[str, list[str]] = collections.defaultdict(list)
        for r in records:
            if field in r:
                reasons[r[field]].append(r["scene"])
        found += ["", f"{heading}, {sum(map(len, reasons.values()))}:"]
        found += [f"  {reason}: {', '.join(of_it)}" for reason, of_it in reasons.items()]
    return found
