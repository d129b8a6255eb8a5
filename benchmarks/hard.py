"""Every hard scene by every method on every belt model: how each run ends, and what it costs.

    python benchmarks/hard.py [--quick] [--scenes NAME,FAMILY,...] [--records FILE] [--table]
                              [--write]
    python benchmarks/hard.py --peers [...]
    python benchmarks/hard.py --map [--write]

A run ends in one of the kinds of `tests/hard_outcome.py`, which judges it. Each has a process of
its own with a budget of steps and of CPU time, so that none can hang or take the others with it.
Every run is appended to a file of JSON lines as soon as it is made; what is in it is not run again.

``--peers`` gives the same scenes to SciPy and CVODE (`hard_peers.py`); ``--map`` draws which fixed
steps are stable (`hard_map.py`).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import common

import beltdyn as bd
from beltdyn.drive import parts
from beltdyn.scenes.hard_scenes import HardScene

sys.path.insert(0, str(common.HERE.parent / "tests"))
import hard_outcome
from hard_outcome import Judge, Outcome

Record = dict[str, Any]
Key = tuple[str, str, str]
METHODS = ("auto", "tsit5", "rk4", "rodas4", "lbdf2", "lie")
BELTS = tuple(parts.BELTS)
#: CPU seconds of a run, of the default method and of the others.
LIMIT, LIMIT_OTHERS = 30.0, 3.0
#: Links of a drive whose reference may take the usual number of steps; longer belts have fewer.
REFERENCE_LINKS = 120
WORDS = {
    "solved": "solved: finished with theory and invariants kept, and an error, where a reference"
    f" exists, at most {hard_outcome.FACTOR:g} times the claim; or ended in the error it must",
    "said": "said: finished, and warned by name that its accuracy is less or not known",
    "refused": "refused: ended in an error that says when, where, why and what to try",
    "budget": "budget: too many steps or too much CPU time for this method",
    "unjudged": "unjudged: finished soundly, but no reference is known to be better",
    "quiet": "QUIET: wrong beyond its claim without a word",
    "broken": "BROKEN: NaN, crash or a broken invariant",
}
LETTERS = {"solved": "+", "said": "w", "refused": "r", "budget": "b", "unjudged": "?"}
LETTERS |= {"quiet": "!", "broken": "X"}


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0],
        epilog="In full this takes 20 minutes, with --quick half a minute.",
    )
    parser.add_argument("--quick", action="store_true", help="a scene of each family, two methods")
    parser.add_argument("--write", action="store_true", help="keep table and figure under results/")
    parser.add_argument("--scenes", default="", metavar="A,B", help="names or families; all")
    parser.add_argument("--table", action="store_true", help="only read the records")
    parser.add_argument("--peers", action="store_true", help="SciPy's solvers and CVODE")
    parser.add_argument("--map", action="store_true", help="the map of stable fixed steps")
    parser.add_argument("--records", type=Path, default=None, help="build/hard.jsonl")
    return parser.parse_args()


def chosen(names: str, quick: bool) -> list[str]:
    """Names of the scenes; quick: the first of each family."""
    wanted = set(filter(None, names.split(",")))
    families = {name: scene.family for name, scene in bd.scenes.hard.items()}
    if unknown := wanted - {*families, *families.values()}:
        raise SystemExit(f"neither scene nor family: {', '.join(sorted(unknown))}")
    found = [n for n, family in families.items() if not wanted or {n, family} & wanted]
    if quick:
        found = list({families[name]: name for name in reversed(found)}.values())[::-1]
    return found


# ---------------------------------------------------------------- runs


def key_of(record: Record) -> Key:
    return record["scene"], record["belt"], record["method"]


def own_belt(scene: HardScene) -> str:
    """Which of BELTS the scene has as it is."""
    return scene.params._belt_facts["name"]


def of_belt(scene: HardScene, belt: str) -> HardScene | None:
    try:
        return scene if belt == own_belt(scene) else scene.with_belt(belt)
    except ValueError:  # links too long for the paper's mesh
        return None


def run(judge: Judge, method: str, seconds: float) -> Outcome:
    """Run in a process of its own; the references are this one's."""
    how, found = common.isolated(lambda: judge.run(method), seconds)
    if how == "done":
        return judge.judge(found)
    if how == "budget":
        return Outcome("budget", cpu=seconds, text=f"more than {seconds:g} s of CPU time")
    return Outcome("broken", broken="crash", text=f"exit code {found}")


def study(
    path: Path, names: list[str], methods: Iterable[str], belts: Iterable[str]
) -> dict[Key, Record]:
    records = common.read_records(path, key_of)
    path.parent.mkdir(parents=True, exist_ok=True)
    own = {name: own_belt(bd.scenes.hard[name]) for name in names}
    pairs = [(name, belt) for name in names for belt in belts]
    with path.open("a") as out:
        for name, belt in sorted(pairs, key=lambda pair: own[pair[0]] != pair[1]):
            todo = [m for m in methods if (name, belt, m) not in records]
            scene = of_belt(bd.scenes.hard[name], belt) if todo else None
            if scene is None:
                continue
            common.progress(f"{name}, {belt}")
            is_own = belt == own[name]
            max_steps = hard_outcome.MAX_REFERENCE_STEPS * min(
                1.0, REFERENCE_LINKS / scene.params.belt.n_bodies
            )
            judge = Judge(scene, math.ceil(max_steps), theory=is_own)
            for method in todo:
                outcome = run(judge, method, LIMIT if method == "auto" else LIMIT_OTHERS)
                record = {"scene": name, "family": scene.family, "belt": belt, "own": is_own}
                record |= {"method": method, "t_end": scene.t_end, **attrs.asdict(outcome)}
                line = json.dumps(record)
                records[name, belt, method] = json.loads(line)
                print(line, file=out, flush=True)
    return records


@cache
def easy(method: str) -> tuple[float, float]:
    """CPU seconds of the README's drive, per simulated second and per step."""
    params = bd.Params(
        belt=bd.Belt(
            length=1.2, n_bodies=60, linear_density=0.1, axial_stiffness=70e3, axial_damping=1.4
        ),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01),
            bd.Pulley(center=(0.29, 0.0), radius=0.1, inertia=0.01),
        ],
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )
    torque = bd.PiecewiseLinear([0.0, 0.3], [[0, 0], [-60, 0]]) + bd.Viscous([0.0, 15.9])
    stats = bd.simulate(params, torque, 1.0, method=method).stats
    return stats.cpu_time, stats.cpu_time / stats.steps


# ---------------------------------------------------------------- tables


def share(records: list[Record], kind: str) -> str:
    return f"{sum(r['kind'] == kind for r in records):9d}"


def counts(
    records: Iterable[Record], by: Callable[[Record], str], order: Iterable[str]
) -> list[str]:
    records = list(records)
    lines = [" " * 12 + "   runs" + "".join(f"{kind:>9s}" for kind in WORDS) + "   solved"]
    for name in order:
        of = [r for r in records if by(r) == name]
        if of:
            solved = sum(r["kind"] == "solved" for r in of) / len(of)
            row = "".join(share(of, kind) for kind in WORDS)
            lines.append(f"{name:12s}{len(of):7d}{row}{solved:8.0%}")
    return lines


def number(value: float | None) -> str:
    return f"{value:9.1e}" if value is not None else " " * 8 + "-"


def scene_lines(records: dict[Key, Record], names: Iterable[str]) -> list[str]:
    """A line for each scene and belt; error, invariant and cost are those of "auto"."""
    lines = [
        f"{'scene':26s} {'belt':7s}" + "".join(f"{m:>7s}" for m in METHODS)
        + "    error    claim   theory invariant    CPU s   cost/s cost/step"
    ]  # fmt: skip
    family = ""
    for name in names:
        for belt in BELTS:
            of = {m: records[name, belt, m] for m in METHODS if (name, belt, m) in records}
            if not of:
                continue
            one = next(iter(of.values()))
            if one["family"] != family:
                family = one["family"]
                lines += ["", family]
            row = "".join(f"{LETTERS[of[m]['kind']] if m in of else ' ':>7s}" for m in METHODS)
            lines.append(f"{name:26s} {belt + '*' * one['own']:7s}{row}{of_auto(of.get('auto'))}")
    return lines


def of_auto(record: Record | None) -> str:
    if record is None:
        return ""
    shown = [record[name] for name in ("error", "claim", "deviation", "invariant", "cpu")]
    cost = ""
    if record["steps"]:
        per_second, per_step = easy("auto")
        cost = f"{record['cpu'] / record['t_end'] / per_second:9.3g}"
        cost += f"{record['cpu'] / record['steps'] / per_step:9.3g}"
    return "".join(map(number, shown)) + cost


def remarks(records: Iterable[Record]) -> list[str]:
    """What each run that "auto" did not solve says, and each that is quiet or broken."""
    lines = []
    for r in records:
        if r["kind"] in ("quiet", "broken") or (r["method"] == "auto" and r["kind"] != "solved"):
            said = ", ".join([*r["warnings"], *filter(None, [r["symbol"]])])
            off = f"error {number(r['error']).strip()} of claim {number(r['claim']).strip()}"
            if r["deviation"] is not None:
                off = f"{r['deviation']:.2g} of what theory allows"
            if r["kind"] == "broken":
                off = f"{r['broken']} {number(r['invariant']).strip()}"
            lines.append(f"{r['kind']:9s}{r['scene']}, {r['belt']}, {r['method']}: {off}; {said}")
            if r["kind"] in ("broken", "refused", "budget"):
                lines.append(f"         {r['text'][:200]}")
    return lines


def table(records: dict[Key, Record], names: list[str]) -> list[str]:
    shown = [r for r in records.values() if r["scene"] in names]
    own = [r for r in shown if r["own"]]
    worst = max((r["invariant"] or 0.0 for r in shown if r["kind"] != "broken"), default=0.0)
    lines = [f"{LETTERS[kind]}  {text}" for kind, text in WORDS.items()]
    lines += ["", "by method, each scene on its own belt (*)", *counts(own, of("method"), METHODS)]
    lines += ["", "on all belts", *counts(shown, of("method"), METHODS)]
    lines += ["", "by belt, default method"]
    lines += counts([r for r in shown if r["method"] == "auto"], of("belt"), BELTS)
    lines += ["", f"worst invariant of all that is not broken, over its bound: {worst:.3g}"]
    lines += [
        "CPU s of the README's drive by \"auto\": {:.3f} a simulated second, {:.2e} a step; cost/s"
        " and cost/step are".format(*easy("auto")),
        "times these. error: rms of joint forces over the mean tension; theory: deviation over what"
        " it allows; all of \"auto\"",
        "", *scene_lines(records, names),
        "", "what \"auto\" did not solve, and all that is quiet or broken:", *remarks(shown),
    ]  # fmt: skip
    return lines


def of(field: str) -> Callable[[Record], str]:
    return lambda record: str(record[field])


def main() -> None:
    given = arguments()
    names = chosen(given.scenes, given.quick)
    if given.map:
        import hard_map

        hard_map.study(given.quick, given.write)
        return
    if given.peers:
        import hard_peers

        path = given.records or Path("build/hard_peers.jsonl")
        hard_peers.study(names, path, given.table, given.quick, given.write)
        return
    path = given.records or Path("build/hard.jsonl")
    methods, belts = (METHODS[:2], BELTS[:1]) if given.quick else (METHODS, BELTS)
    records = (
        common.read_records(path, key_of) if given.table else study(path, names, methods, belts)
    )
    lines = [f"Hard scenes: {len(names)} in all, each by every method", *common.machine(), ""]
    import hard_picture

    common.publish(
        "hard", [*lines, *table(records, names)], given.write, hard_picture.draw(records, names)
    )
    if given.write and any(not record["own"] for record in records.values()):
        hard_picture.draw_belts(records, names).savefig(common.RESULTS / "hard_belts.png", dpi=130)


if __name__ == "__main__":
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    main()
