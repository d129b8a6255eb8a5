"""Errors that `simulate(..., verify=True)` estimates, against errors of references it has not seen.

    python benchmarks/verify.py [--quick] [--records FILE] [--table] [--write]

The drives are the library's scenes, M (the paper's with 60 N m), U (radii of 50 and 120 mm) and T
(three pulleys of other sizes), each with all meshes, on its own number of links or cells and on 1.4
times as many, and at a looser tolerance. The reference in time is a run on the same mesh with
"rodas4" at 1e-7, in space one of 960 links (480 with --quick), of the ALE belt of a third as many
cells. Both errors are taken relative to the scales of
the run that is judged; errors below a floor, 1e-6 in time and 1e-4 in space, count as the floor.
Every record goes to a file of JSON lines as soon as it is made; what is there is not run again.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import common
import numpy as np

import beltdyn as bd
from beltdyn.accuracy import QUANTITIES, Observed, differences, observe, with_links
from beltdyn.base.run_warnings import silenced
from beltdyn.outputs.accuracy_report import SPACE_FLOOR, TIME_FLOOR

sys.path.insert(0, str(common.HERE.parent / "tests"))
import drives

Record = dict[str, Any]
MESHES = ("joint", "paper", "ale")
FACTOR, TENTH = 3.0, 0.1
#: Links over those of the scene, and the tolerance.
VARIANTS = ((1.0, 1e-4), (1.4, 1e-4), (1.0, 2e-3))
REPEATS = 3


def drive_t() -> bd.Scene:
    scene = bd.scenes.three_pulleys()
    radii, places = (0.07, 0.06, 0.04), ((0.0, 0.0), (0.18, 0.20), (0.28, -0.02))
    pulleys = [
        attrs.evolve(pulley, radius=radius, center=place)
        for pulley, radius, place in zip(scene.params.pulleys, radii, places, strict=True)
    ]
    belt = attrs.evolve(scene.params.belt, length=1.145)  # strained by 0.6 %
    params = attrs.evolve(scene.params, pulleys=pulleys, belt=belt)
    ramp = bd.PiecewiseLinear([0.0, 0.1], [[0.0, 0.0, 0.0], [-12.0, 0.0, 0.0]])
    return bd.Scene(params, ramp + bd.Viscous([0.0, 0.12, 0.04]), 0.4)


DRIVES: dict[str, Callable[[], bd.Scene]] = {
    "M": drives.scene_m,
    "U": drives.scene_u,
    "T": drive_t,
    **{name: (lambda name=name: bd.scenes.get(name)) for name in bd.scenes.names()},  # type: ignore[misc]
}


@cache
def finest(name: str, mesh: str, links: int) -> Observed:
    """What is read off the reference in space."""
    scene = with_mesh(DRIVES[name](), mesh)
    with silenced():
        return observe(bd.simulate(*scene._replace(params=with_links(scene.params, links))))


def with_mesh(scene: bd.Scene, mesh: str) -> bd.Scene:
    """With the number of links of the scene, or of cells that is chosen."""
    number = {"n_bodies": None} if mesh == "ale" else {}
    return common.with_belt(scene, mesh=mesh, **number)


def links_of(name: str, mesh: str, factor: float) -> int:
    return round(factor * with_mesh(DRIVES[name](), mesh).params.n_bodies)


def true_errors(run: Observed, reference: Observed) -> dict[str, float]:
    return differences(run, attrs.evolve(reference, scales=run.scales))


def cost(scene: bd.Scene, rtol: float) -> tuple[bd.Result, dict[str, float]]:
    """Verify a scene; CPU and wall times, of settling too, medians of interleaved repeats."""
    spent: dict[str, list[float]] = {"cpu": [], "wall": [], "verified_cpu": [], "verified_wall": []}
    for _ in range(REPEATS):
        for prefix, verify in (("", False), ("verified_", True)):
            cpu, wall = time.process_time(), time.perf_counter()
            result = bd.simulate(*scene, rtol=rtol, verify=verify)
            spent[f"{prefix}cpu"].append(time.process_time() - cpu)
            spent[f"{prefix}wall"].append(time.perf_counter() - wall)
    return result, {key: statistics.median(values) for key, values in spent.items()}


def judge(name: str, mesh: str, factor: float, rtol: float, reference: int) -> Record:
    scene = with_mesh(DRIVES[name](), mesh)
    links = links_of(name, mesh, factor)
    scene = scene._replace(params=with_links(scene.params, links))
    with silenced():
        result, spent = cost(scene, rtol)
        exact = observe(bd.simulate(*scene, method="rodas4", rtol=1e-7))
    run = observe(result)
    return {
        **{"drive": name, "mesh": mesh, "links": links, "rtol": rtol, "reference": reference},
        **spent,
        "estimate": {one.quantity: attrs.asdict(one) for one in result.accuracy.errors},
        "time": true_errors(run, exact),
        "space": true_errors(run, finest(name, mesh, reference)),
        "until": result.accuracy.until,
        "verified": result.accuracy.verified,
        "notes": result.accuracy.notes,
    }


def key_of(record: Record) -> tuple[Any, ...]:
    return tuple(record[key] for key in ("drive", "mesh", "links", "rtol", "reference"))


def study(path: Path, quick: bool, meshes: Sequence[str]) -> list[Record]:
    reference = 480 if quick else 960
    records = common.read_records(path, key_of)
    path.parent.mkdir(parents=True, exist_ok=True)
    chosen = []
    with path.open("a") as out:
        for name in ("M", "U") if quick else DRIVES:
            for mesh in meshes:
                finest_of = reference // 3 if mesh == "ale" else reference
                for factor, rtol in VARIANTS:
                    links = links_of(name, mesh, factor)
                    key = (name, mesh, links, rtol, finest_of)
                    if key not in records:
                        common.progress(f"{name}, {mesh}, {links} links, rtol = {rtol:g}")
                        record = judge(name, mesh, factor, rtol, finest_of)
                        print(json.dumps(record), file=out, flush=True)
                        records[key] = record
                    chosen.append(records[key])
    return chosen


# ---------------------------------------------------------------- tables


def ratios(records: list[Record], part: str) -> Iterator[tuple[Record, str, float]]:
    """Estimate over true error of every quantity that was estimated."""
    floor = {"time": TIME_FLOOR, "space": SPACE_FLOOR}[part]
    for record in records:
        for quantity in QUANTITIES:
            estimate, true = record["estimate"][quantity][part], record[part][quantity]
            if estimate is not None:
                yield record, quantity, max(floor, estimate) / max(floor, true)


def share_line(label: str, found: list[float]) -> str:
    if not found:
        return f"{label:28s}     0"
    within = np.mean([1.0 / FACTOR <= r <= FACTOR for r in found])
    low = np.mean([r < 1.0 / FACTOR for r in found])
    tenth = sum(r < TENTH for r in found)
    return (
        f"{label:28s}{len(found):6d}{100 * within:9.1f} %{100 * low:9.1f} %{tenth:9d}"
        f"{np.median(found):9.2f}"
    )


def table(records: list[Record]) -> list[str]:
    lines = []
    for part in ("time", "space"):
        found = list(ratios(records, part))
        lines += [
            f"error in {part}: estimate over true error",
            f"{'':28s} cases  within 3   below 1/3   below .1  median",
            share_line("all", [r for *_, r in found]),
        ]
        for mesh in MESHES:
            lines.append(share_line(mesh, [r for one, _, r in found if one["mesh"] == mesh]))
        for rtol in sorted({record["rtol"] for record in records}):
            chosen = [r for one, _, r in found if one["rtol"] == rtol]
            lines.append(share_line(f"rtol = {rtol:g}", chosen))
        for quantity in QUANTITIES:
            lines.append(share_line(quantity, [r for _, of, r in found if of == quantity]))
        lines += ["", "farthest off: drive, mesh, links, rtol, quantity: true, estimate"]
        off = sorted(found, key=lambda item: -abs(math.log(item[2])))[:12]
        for record, quantity, ratio in off:
            if not 1.0 / FACTOR <= ratio <= FACTOR:
                name, mesh, links, rtol, _ = key_of(record)
                lines.append(
                    f"  {name} {mesh} {links} {rtol:g} {quantity}: {record[part][quantity]:.2g}, "
                    f"{record['estimate'][quantity][part]:.2g}"
                )
        lines.append("")
    for what in ("wall", "cpu"):
        times = [record[f"verified_{what}"] / record[what] for record in records]
        lines.append(
            f"{what} time over that of the plain run: median {np.median(times):.2f}, "
            f"{np.min(times):.2f} to {np.max(times):.2f}"
        )
    parted = sum(record["until"] is not None for record in records)
    whole = sum(record["verified"] for record in records)
    lines.append(f"{len(records)} runs, {whole} verified in full, {parted} part exponentially")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="M and U, against 480 links: a minute")
    parser.add_argument("--mesh", choices=MESHES, nargs="+", default=MESHES, help="only of these")
    parser.add_argument("--write", action="store_true", help="keep the table under results/")
    parser.add_argument("--table", action="store_true", help="only read the records")
    parser.add_argument(
        "--records", type=Path, default=Path("build/verify.jsonl"), help="appended to, and read"
    )
    given = parser.parse_args()
    records = (
        list(common.read_records(given.records, key_of).values())
        if given.table
        else study(given.records, given.quick, given.mesh)
    )
    lines = ["Estimated errors against true ones", *common.machine(), "", *table(records)]
    common.publish("verify", lines, given.write)


if __name__ == "__main__":
    main()
