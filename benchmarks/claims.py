"""Errors of random drives against the errors that the runs claim, each with its own reference.

    python benchmarks/claims.py [--quick] [--seeds A:B] [--short] [--varied] [--records FILE]
                                [--write]
    python benchmarks/claims.py --many [--seeds A:B] [--records FILE] [--write]

`tests/random_drives.py` draws the drives, `tests/judged.py` runs and judges them; every record goes
to a file of JSON lines as soon as it is made, with all of ``stats``; seeds already in the file are
not run again. A run is QUIET if it finished without a warning of its accuracy in time;
warnings of mesh and contact compliance do not count as such.

``--many`` asks less of more drives, 1e5 of a few dozen steps each: that a run keeps its invariants
or ends in an error by name. Each slice of them runs in a process of its own, so that a crash is
told with its seed and the others go on.
"""

from __future__ import annotations

import argparse
import collections
import json
import math
import sys
import time
from collections.abc import Callable, Iterable
from operator import itemgetter
from pathlib import Path
from typing import Any

import common
import numpy as np

sys.path.insert(0, str(common.HERE.parent / "tests"))
import hard_outcome
import judged

Record = dict[str, Any]
RECORDS = Path("build/claims.jsonl")
#: Where neither an estimate nor a tolerance claims anything, fixed steps: the README's figure of
#: what such runs are good for.
UNCLAIMED = 0.1
#: Lengths of short varied runs in the length of a whole one: what is judged from a run's course
#: must hold for short courses too.
SHARES = (0.02, 0.04, 0.08, 0.16)
#: One seed in so many is a calm drive.
CALM_EVERY = 4


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0],
        epilog="In full (3000 seeds) this takes two hours, with --quick a minute.",
    )
    parser.add_argument("--quick", action="store_true", help="the first 30 seeds")
    parser.add_argument("--write", action="store_true", help="keep the table under results/")
    parser.add_argument("--seeds", default=None, metavar="A:B", help="from A up to B; 0:3000")
    parser.add_argument("--records", type=Path, default=RECORDS, help="appended to, and read")
    parser.add_argument(
        "--short", action="store_true", help="a quarter of the length, as the tests' (half an hour)"
    )
    parser.add_argument("--varied", action="store_true",
        help="of any law, mesh, model, layout, mount, load and contact; runs that warn of their "
        "accuracy in time get no reference",
    )  # fmt: skip
    parser.add_argument(
        "--many", action="store_true", help="1e5 drives of a few dozen steps, without references"
    )
    parser.add_argument("--table", action="store_true", help="only read the records")
    return parser.parse_args()


def plain(value: Any) -> Any:
    """NumPy's numbers as Python's."""
    return value.item() if isinstance(value, np.generic) else str(value)


def study(seeds: Iterable[int], path: Path, short: bool, varied: bool) -> dict[int, Record]:
    records = common.read_records(path, itemgetter("seed"))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as out:
        for seed in seeds:
            if seed in records:
                continue
            begun = time.process_time()
            share = 0.25 if short else 1.0
            if short and varied:
                share = float(np.random.default_rng([seed, 79]).choice(SHARES))
            kind = "varied" if varied else "any" if seed % CALM_EVERY else "calm"
            radians = share * judged.random_drives.RADIANS
            max_steps = 30_000 if short else judged.MAX_REFERENCE_STEPS
            record = judged.judge(seed, kind, max_steps, radians, many=varied)
            record["cpu"] = time.process_time() - begun
            line = json.dumps(record, default=plain)
            records[seed] = json.loads(line)
            print(line, file=out, flush=True)
            if seed % 50 == 0:
                common.progress(f"seed {seed}")
    return {seed: records[seed] for seed in seeds}


# ---------------------------------------------------------------- many

#: Seeds of a process, and the CPU time they may take; a drive takes some 30 ms.
SLICE, SLICE_SECONDS = 500, 600.0


def many(seeds: range, path: Path) -> dict[int, Record]:
    """Run what is not in the file yet."""
    done = common.read_records(path, itemgetter("seed"))
    path.parent.mkdir(parents=True, exist_ok=True)

    def run(todo: Iterable[int]) -> None:
        with path.open("a") as out:
            for seed in todo:
                print(json.dumps(hard_outcome.stands(seed), default=plain), file=out, flush=True)

    for first in range(seeds.start, seeds.stop, SLICE):
        part = range(first, min(first + SLICE, seeds.stop))
        while todo := [seed for seed in part if seed not in done]:
            how, code = common.isolated(lambda todo=todo: run(todo), SLICE_SECONDS)
            if how == "done":
                break
            done = common.read_records(path, itemgetter("seed"))
            dead = next((seed for seed in todo if seed not in done), None)
            if dead is not None:
                which = f"crash, exit code {code}" if how == "crash" else "no end"
                done[dead] = {"seed": dead, "kind": "broken", "which": which, "symbol": ""}
                with path.open("a") as out:
                    print(json.dumps(done[dead]), file=out)
        common.progress(f"seed {part.stop}")
    return common.read_records(path, itemgetter("seed"))


def many_lines(records: list[Record]) -> list[str]:
    kinds = collections.Counter(r["kind"] for r in records)
    symbols = collections.Counter(r["symbol"] for r in records if r["kind"] in NAMED)
    broken = [r for r in records if r["kind"] == "broken"]
    worst = max((r.get("invariant") or 0.0 for r in records if r["kind"] == "kept"), default=0.0)
    steps = sum(r.get("steps", 0) for r in records)
    return [
        f"{steps} steps; at most {hard_outcome.STEPS} a drive, then it is cut off",
        *(f"{kinds[kind]:8d}  {text}" for kind, text in STANDS.items()),
        "by name: " + ", ".join(f"{n} {name}" for name, n in symbols.most_common()),
        f"worst invariant kept, over its bound: {worst:.2g}",
        *(f"  seed {r['seed']}: {r['which']} {r.get('invariant')}" for r in broken),
    ]


NAMED = ("settle", "refused")
STANDS = {
    "kept": "finished, finite, within their invariants",
    "cut": "within them when cut off",
    "settle": "refused by name while settling",
    "refused": "refused by name later, within them until then",
    "broken": "BROKEN: a crash, a NaN or a broken invariant",
}


# ---------------------------------------------------------------- tables


def finished(record: Record) -> bool:
    return record["outcome"] not in ("settle", "failed")


def is_quiet(record: Record) -> bool:
    return finished(record) and not judged.IN_TIME & set(record["warnings"])


def times_claim(record: Record) -> float:
    """True error over the claim; NaN where it is not known beyond doubt to be above it."""
    if record["outcome"] != "known":
        return math.nan
    claim = UNCLAIMED if record["claim"] is None else record["claim"]
    return float(record["error"] / claim)


def beyond(records: Iterable[Record], times: float) -> list[Record]:
    return [r for r in records if is_quiet(r) and times_claim(r) > times]


def is_sensitive(record: Record) -> bool:
    """Quiet, five times off its claim, but the references are no better: errors grow in the drive,
    and no run of it keeps such a claim."""
    claim = UNCLAIMED if record["claim"] is None else record["claim"]
    return is_quiet(record) and record["outcome"] == "doubtful" and record["error"] > 5.0 * claim


def count_line(name: str, records: list[Record]) -> str:
    known = [r for r in records if is_quiet(r) and r["outcome"] == "known"]
    ratios = [times_claim(r) for r in known]
    median = f"{np.median(ratios):9.2g}" if ratios else "        -"
    return (
        f"{name:32s}{len(records):6d}{sum(not finished(r) for r in records):8d}"
        f"{sum(finished(r) and not is_quiet(r) for r in records):8d}{len(known):8d}"
        + "".join(f"{len(beyond(records, times)):7d}" for times in (1.0, 5.0, 10.0, 100.0))
        + f"{sum(is_sensitive(r) for r in records):7d}"
        + f"{sum(bool(r['lost']) and is_quiet(r) for r in records):7d}"
        + f"{sum(r['over'] for r in records):7d}{median}"
    )


def estimate_lines(records: list[Record]) -> list[str]:
    """What estimates are worth, and how runs that have one stand to the rtol asked."""
    own = [r for r in records if r["claimed_by"] == "estimate" and r["outcome"] == "known"]
    if not own:
        return ["no run estimated its error"]
    over = [r["claim"] / max(r["error"], 1e-300) for r in own]
    at = (0.01, 0.1, 0.5, 0.9, 0.99)
    shares = ", ".join(f"{q:g}: {x:.2g}" for q, x in zip(at, np.quantile(over, at), strict=True))
    asked = [r for r in own if r["rtol"] is not None and is_quiet(r)]
    beyond_asked = [sum(r["error"] > k * r["rtol"] for r in asked) for k in (1, 5, 10)]
    return [
        f"estimate over true error, quantiles: {shares}",
        f"of {len(asked)} quiet runs with an estimate {beyond_asked[0]}, {beyond_asked[1]} and "
        f"{beyond_asked[2]} are off by more than 1, 5 and 10 times the rtol asked",
    ]


def table(records: list[Record]) -> list[str]:
    def setting(r: Record) -> str:
        return f"{r['method']} fixed" if r["rtol"] is None else f"{r['method']} {r['rtol']:g}"

    groups: list[tuple[str, Callable[[Record], bool]]] = [
        ("all", lambda r: True),
        ("any", lambda r: r["kind"] == "any"),
        ("calm", lambda r: r["kind"] == "calm"),
        ("claim: estimate", lambda r: r["claimed_by"] == "estimate"),
        ("claim: rtol asked", lambda r: r["claimed_by"] == "asked"),
        (f"claim: none (taken as {UNCLAIMED:g})", lambda r: r["claimed_by"] == "none"),
    ]
    for name in sorted({setting(r) for r in records}):
        groups.append((name, lambda r, name=name: setting(r) == name))  # type: ignore[misc]
    drawn: list[tuple[str, Callable[[Record], bool]]] = [
        ("light damping, below 0.02", lambda d: d["light_damping"]),
        ("heavy damping, above 1", lambda d: d["damping"] > 1.0),
        ("light contact damping", lambda d: d["contact_damping"] < 0.05),
        ("idlers", lambda d: d["idlers"] > 0),
        ("links longer than a radius", lambda d: d["link_over_radius"] > 1.0),
        ("mesh above half the tension", lambda d: d["mesh_share"] > 0.5),
        ("torque steps", lambda d: d["shape"] == "step"),
        ("torque functions", lambda d: d["shape"] == "function"),
        ("full slip", lambda d: d["full_slip"]),
        ("above 3000 rpm", lambda d: d["high_speed"]),
        ("starts running", lambda d: d["belt_speed"] > 0.0),
        ("stiff friction, above 10", lambda d: d["stiff_friction"] > 10.0),
        ("no friction", lambda d: d["friction"] is None),
        ("axes that move", lambda d: d["mounted"] > 0),
        ("crossed or on the back", lambda d: d["turned"]),
    ]
    groups += [(name, lambda r, test=test: test(r["drawn"])) for name, test in drawn]  # type: ignore[misc]
    lines = [
        "Quiet runs whose true error is beyond so many times their claim; sens: beyond 5x, but the",
        "references are apart; lost: a pulley the belt left unsaid; over: runs beyond the",
        "budget of steps; median of true error over claim.",
        "",
        " " * 32
        + "  runs  failed  warned   known"
        + "    >1x    >5x   >10x  >100x   sens   lost   over   median",
    ]
    for name, test in groups:
        chosen = [r for r in records if test(r)]
        if chosen:
            lines.append(count_line(name, chosen))
    lines += ["", *estimate_lines(records)]
    outcomes = collections.Counter(r["outcome"] for r in records)
    off = [r["seed"] for r in records if r["off_drawing"]]
    lines += [f"belts that do not lie as drawn: {len(off)}" + (f", of seeds {off}" if off else "")]
    lines += ["outcomes: " + ", ".join(f"{n} {name}" for name, n in outcomes.most_common())]
    for kind in dict.fromkeys(r["kind"] for r in records):
        chosen = [r for r in records if r["kind"] == kind]
        codes = collections.Counter(code for r in chosen for code in set(r["warnings"]))
        symbols = collections.Counter(r["symbol"] for r in chosen if r["symbol"])
        counts = ", ".join(f"{n} {name}" for name, n in (codes + symbols).most_common())
        lines.append(f"{kind}: {len(chosen)} runs; warnings and errors by name: {counts or 'none'}")
    worst = sorted(beyond(records, 5.0), key=times_claim, reverse=True)[:20]
    lines += ["", "worst quiet runs: seed, setting, error, claim"]
    lines += [
        f"  {r['seed']:6d} {r['kind']:5s} {setting(r):14s} {r['error']:9.2g} "
        + ("        -" if r["claim"] is None else f"{r['claim']:9.2g}")
        for r in worst
    ]
    return lines


def main() -> None:
    given = arguments()
    if given.many:
        first, last = map(int, (given.seeds or ("0:50" if given.quick else "0:100000")).split(":"))
        path = given.records.with_name("many.jsonl") if given.records == RECORDS else given.records
        done = many(range(first, last), path)
        chosen = [done[seed] for seed in range(first, last) if seed in done]
        lines = [f"Random drives that must stand, seeds {first} to {last - 1}: {len(chosen)}"]
        common.publish("many", [*lines, *common.machine(), "", *many_lines(chosen)], given.write)
        return
    first, last = map(int, (given.seeds or ("0:30" if given.quick else "0:3000")).split(":"))
    seeds = range(first, last)
    done = (
        common.read_records(given.records, itemgetter("seed"))
        if given.table
        else study(seeds, given.records, given.short, given.varied)
    )
    records = [done[seed] for seed in seeds if seed in done]
    lines = [
        f"Claims of random drives, seeds {first} to {last - 1}: {len(records)} runs",
        *common.machine(),
        "",
        *table(records),
    ]
    common.publish("claims", lines, given.write)


if __name__ == "__main__":
    main()
