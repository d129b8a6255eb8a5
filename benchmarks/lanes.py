"""Eight drives side by side in vector lanes against one after the other: is a core twice as fast?

    python benchmarks/lanes.py [--quick] [--write]

The core's kernels put neighbouring links of one drive into the lanes of a vector. Here every lane
is a drive of its own instead: eight drives of one topology, the paper's on the mesh "joint" with
torque, friction and preload each at 80 or 120 %, at a state under load, with links as they stand
there. benchmarks/lanes_kernels.c builds the lanes' kernels from the core's own headers and is held
to the core's numbers; both sides are timed in turns, medians of repeats of CPU time.

How long whole steps would take is a sum of passes. What no lanes were built for, that is the rest
of a step (searches, events, torques, step control), is counted once as slow as now and once as fast
as the passes: the two ends of the gain that is printed. Whether drives can share steps is computed
from the steps that the eight take under load: in lockstep at one time, where every step is the
shortest that one of them wants and is repeated if that one rejects it, or each lane at a time of
its own, where a group is ready when its slowest is, or lanes take up new drives.
"""

from __future__ import annotations

import argparse
import itertools
import re
import subprocess
import tempfile
import warnings
from pathlib import Path
from typing import Any

import attrs
import common
import kernels
import numpy as np

import beltdyn as bd

Array = np.ndarray[Any, np.dtype[Any]]
#: Of a level: by row, then by set, what core, core with short lists and lanes have.
Rows = dict[str, dict[int, tuple[float, float, float]]]
Levels = dict[str, Rows]

ROOT = Path(__file__).resolve().parent.parent
SIZES = (30, 60)
TORQUE = 50.0  # N m, at which the paper's belt does not slip at 120 % either
VISCOUS = 100.0 / (2.0 * np.pi)  # N m s/rad, the paper's load
PRELOAD = 530.0  # N
START = 0.4  # s, of settled drives at rest with a torque that grows over 0.3 s
SPREAD = (0.8, 1.2)

WINDOW = 0.2  # s, of the runs whose steps are timed and recorded
METHODS = ("tsit5", "rodas4")
DRIVES = 8
FIELDS = ("x", "y", "phi", "vx", "vy", "vphi", "mu", "slip", "theta", "omega")  # of a state
AGREE = 1e-12  # of the numbers of both sides, over the largest of a field

#: What the headers of csrc/kernels say that a vector for every double cannot: by file, what stands
#: there (a regular expression, found at least once) and what replaces it.
REPLACED = {
    # a lane needs no more than its neighbours round the links
    "base/base.h": [(r"#define BD_HALO 8", "#define BD_HALO 2")],
    "friction/laws.h": [
        (r"#define BD_LAWS\(X\)(.*\\\n)+.*\n", '#define BD_LAWS(X) X(dahl, Dahl, 0, 1, "Dahl")\n'),
        (r'#include "friction/(?!stribeck|dahl).*\n', ""),
    ],
    "friction/stribeck.h": [
        (r"const int on = .*;\n", ""),
        (r"return \(stribeck\)\{(.|\n)*?\};", "return (stribeck){.on = 0};"),
        (r"return mu_s > mu_k \? mu_s : mu_k;", "return larger(mu_s, mu_k);"),
    ],
    "kernels/rhs.h": [
        (r"(return ledger \? .*) : 0\.0;", r"\1 : splat(0.0);"),
        (r'#include "kernels/string_belt.h"(.|\n)*', ""),
    ],
    "kernels/jacobian.h": [
        (r"pulley->hunt_crossley > 0\.0", "0"),
        (r'#include "kernels/string_jacobian.h"(.|\n)*', ""),
    ],
    "kernels/link_geometry.h": [
        (r"double elsewhere", "float elsewhere"),
        (r": elsewhere;", ": splat(elsewhere);"),
    ],
    "kernels/link_contact_tangent.h": [
        (r"pulley->hunt_crossley > 0\.0", "0"),
        (r"h > 0\.0", "0"),
    ],
    "kernels/link_contact_jacobian.h": [(r"const double share", "const float share")],
}


def headers(folder: Path) -> None:
    """Copies of the core's headers, with REPLACED."""
    for path in kernels.CORE.glob("**/*.h"):
        name = path.relative_to(kernels.CORE).as_posix()
        text = path.read_text()
        for pattern, new in REPLACED.get(name, ()):
            text, found = re.subn(pattern, new, text)
            if not found:
                raise SystemExit(f"{name} has no {pattern!r} any more: see REPLACED in {__file__}")
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text)


def compile_lanes(folder: Path) -> tuple[Path, list[str]]:
    """The program; its flags."""
    headers(folder / "headers")
    constants = kernels.setup_constants()
    flags: list[str] = constants["FLAGS"]
    levels: dict[str, list[str]] = {"baseline": []}
    if constants["X86"]:
        levels |= {p.stem.removeprefix("newton_"): x for p, x in constants["LEVELS"].items()
                   if p.stem.startswith("newton_")}  # fmt: skip
    _, objects = kernels.compile_objects(folder)
    here = [kernels.COMPILER, *flags, *["-DBD_X86_LEVELS=1"][: constants["X86"]], f"-I{ROOT}"]

    def build(source: str, name: str, *extra: str) -> None:
        objects.append(folder / name)
        path = str(ROOT / "benchmarks" / source)
        subprocess.run([*here, *extra, "-c", path, "-o", str(objects[-1])], check=True)

    build("lanes.c", "lanes.o", f"-I{kernels.CORE}")
    for level, extra in levels.items():
        build("lanes_kernels.c", f"lanes_{level}.o", f"-I{folder / 'headers'}",
              f"-DLANES_LEVEL={level}", *extra, "-Wno-psabi")  # fmt: skip
    target = folder / "lanes"
    subprocess.run([kernels.COMPILER, *map(str, objects), "-lm", "-o", str(target)], check=True)
    return target, flags


# --- drives ---------------------------------------------------------------------------------------


def drive(n: int, torque: float, friction: float, preload: float) -> tuple[bd.Params, bd.State]:
    """One of the eight: factors of torque, coefficient of friction and preload; its state."""
    paper = bd.scenes.kubas_case_1().params
    assert isinstance(paper.friction, bd.Dahl)
    belt = attrs.evolve(
        paper.belt, n_bodies=n, mesh="joint", length=None, preload=preload * PRELOAD
    )
    law = attrs.evolve(paper.friction, mu_k=friction * paper.friction.mu_k)
    params = attrs.evolve(paper, belt=belt, friction=law)
    driving = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-torque * TORQUE, 0.0]])
    load = bd.Viscous([0.0, VISCOUS])
    result = bd.simulate(params, driving + load, START, initial=bd.settle(params), t_eval=[START],
                         rtol=1e-3)  # fmt: skip
    known = attrs.evolve(belt, length=params.effective_belt.length, preload=None)
    return attrs.evolve(params, belt=known), result.final_state


def eight(n: int) -> list[str]:
    """What lanes.c reads of eight drives, and their loads."""
    text = []
    for factors in itertools.product(SPREAD, repeat=3):
        params, state = drive(n, *factors)
        fields = {name: np.ravel(getattr(state, name)) for name in FIELDS}
        loads = [-factors[0] * TORQUE, 0.0, 0.0, VISCOUS]
        text.append(" ".join([kernels.drive_text(params, fields), *map(kernels.in_full, loads)]))
    return text


# --- steps that drives would share ----------------------------------------------------------------


def lockstep(steps: list[Array]) -> tuple[float, float]:
    """Of a group of drives: useful share of the work with common steps, and of lanes that go each
    at its own pace until the slowest is done. Given are ends of steps, and negative the beginnings
    of those rejected.
    """
    ends = [s[s >= 0] for s in steps]
    rejected = [-s[s < 0] for s in steps]
    attempts = np.array([len(e) - 1 + len(r) for e, r in zip(ends, rejected, strict=True)])
    edges = np.unique(np.concatenate(ends))
    edges = edges[edges <= min(e[-1] for e in ends)]
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    wanted = np.array([np.diff(e)[np.clip(np.searchsorted(e, middle) - 1, 0, len(e) - 2)]
                       for e in ends])  # fmt: skip
    shortest = wanted.min(axis=0)
    taken = float(np.sum(width / shortest))
    again = 0
    for lane, times in enumerate(rejected):  # only whose wish is followed has its step rejected
        at = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(middle) - 1)
        again += int(np.sum(wanted[lane, at] <= shortest[at]))
    lanes = len(steps)
    return (
        float(attempts.sum() / (lanes * (taken + again))),
        float(attempts.mean() / attempts.max()),
    )


def contact_shared(n: int, width: int) -> tuple[float, float, float]:
    """Links in contact in some lane over those of one lane, groups of so many drives: all at one
    time, and each at one of its own; share of the former that are in contact in some lanes only.
    """
    touching = []
    for factors in itertools.product(SPREAD, repeat=3):
        params, state = drive(n, *factors)
        torque = bd.PiecewiseLinear([0.0], [[-factors[0] * TORQUE, 0.0]]) + bd.Viscous([0, VISCOUS])
        times = START + np.linspace(0.0, WINDOW, 400)
        result = bd.simulate(params, torque, START + WINDOW, initial=state, t_eval=times, rtol=1e-3)
        touching.append(result.contact.normal > 0.0)
    rng = np.random.default_rng(0)
    groups = np.array(touching).reshape(-1, width, *touching[0].shape)
    apart = np.array([[lane[rng.permutation(len(lane))] for lane in group] for group in groups])
    some, every = groups.any(axis=1), groups.all(axis=1)
    mean = float(groups.mean())
    return (float(some.mean()) / mean, float(apart.any(axis=1).mean()) / mean,
            float((some & ~every).sum() / some.sum()))  # fmt: skip


# --- output ---------------------------------------------------------------------------------------


def read(lines: list[str]) -> tuple[Levels, dict[tuple[str, int], list[Array]]]:
    """By level, row and set what the three sides have; by method and set the steps."""
    values: Levels = {}
    steps: dict[tuple[str, int], list[Array]] = {}
    for line in lines:
        first, at, row, *sides = line.split(",")
        if row == "steps":
            steps.setdefault((first, int(at)), []).append(np.array(sides[-1].split(), float))
        else:
            of_row = values.setdefault(first, {}).setdefault(row, {})
            of_row[int(at)] = (float(sides[0]), float(sides[1]), float(sides[2]))
    return values, steps


def passes_table(rows: Rows) -> list[str]:
    """What the three sides take, and how much faster the lanes are than both others."""
    columns = ("core", "short", "lanes", "gain", "over")
    head = "".join(f"{column:>8}" for column in columns)
    text = [f"{'':32}" + "".join(f"{f'{n} links':>40}" for n in SIZES), f"{'':32}{head}{head}"]
    times = [row for row in rows if row[:4] not in ("widt", "diff", "list", "touc", "step")]
    for row in ["listed", *times]:
        line = f"{'links listed near pulleys' if row == 'listed' else '  ' + row:32}"
        for k, n in enumerate(SIZES):
            scale = 1.0 if row == "listed" else 1.0 / (DRIVES * n)
            core, short, lanes = (scale * value for value in rows[row][k])
            cells = (core, short, lanes, core / lanes, short / lanes)
            line += "".join(f"{cell:8.1f}" for cell in cells[:3])
            line += "".join(f"{cell:8.2f}" for cell in cells[3:])
        text.append(line)
    text.insert(3, "ns per link and drive")
    touching = ", ".join(f"{rows['touching'][k][0]:.1f}" for k in range(len(SIZES)))
    return [*text, f"links listed: some {touching} touch a pulley; a link counts once a pulley"]


def run_lines(rows: Rows, method: str, k: int, steps: list[Array], shared: dict[Any, Any]
              ) -> dict[str, str]:  # fmt: skip
    """What whole runs by a method would gain on drives of SIZES[k] links."""
    width = int(rows["width"][k][0])
    step = rows[f"step in a run of {method}"][k][0]
    core, short, lanes = rows[f"all passes of {method}"][k]
    rest = max(step - core, 0.0)
    least, most = (rest + core) / (rest + lanes), core / lanes
    groups = np.array([lockstep(steps[i : i + width]) for i in range(0, DRIVES, width)])
    together, pace = groups.mean(axis=0)

    def between(factor: float) -> str:
        return f"{factor * least:.2f} to {factor * most:.2f}"

    shares = shared[SIZES[k], width]
    return {
        "a step in a run, ns per link": f"{step / SIZES[k] / DRIVES:.1f}",
        "passes' share of it": f"{min(core / step, 1.0):.2f}",
        "core with short lists: a step gains": f"{(rest + core) / (rest + short):.2f}",
        "lanes: a step gains": between(1.0),
        "work of use, common steps": f"{together:.2f} ({lockstep(steps)[0]:.2f} of all eight)",
        "work of use, own steps, one group": f"{pace:.2f}",
        "in contact, any lane over one": f"{shares[0]:.2f}; at own times {shares[1]:.2f}",
        "in contact in some lanes only": f"{100 * shares[2]:.0f} %",
        "a run gains, common steps": between(together),
        "a run gains, own steps, one group": between(pace),
        "a run gains, own steps, many drives": between(1.0),
    }


def table(level: str, rows: Rows, steps: dict[tuple[str, int], list[Array]],
          shared: dict[Any, Any]) -> list[str]:  # fmt: skip
    """All of one instruction level."""
    text = ["", f"{level}, {int(rows['width'][0][0])} drives in a vector", *passes_table(rows)]
    for method in METHODS:
        columns = [run_lines(rows, method, k, steps[method, k], shared) for k in range(len(SIZES))]
        text.append(f"steps of {method}")
        for name in columns[0]:
            text.append(f"  {name:38}" + "".join(f"{column[name]:>37}" for column in columns))
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a few repeats")
    parser.add_argument("--write", action="store_true", help="keep the tables under results/")
    arguments = parser.parse_args()
    rounds = 5 if arguments.quick else 61
    warnings.filterwarnings("ignore", "mesh", UserWarning)
    drives = [text for n in SIZES for text in eight(n)]
    with tempfile.TemporaryDirectory() as folder:
        program, _ = compile_lanes(Path(folder))
        given = "\n".join([f"{rounds} {len(SIZES)} {WINDOW}", *drives])
        done = subprocess.run([program], input=given, check=True, stdout=subprocess.PIPE, text=True)
    levels, steps = read(done.stdout.splitlines())
    widths = {int(rows["width"][0][0]) for rows in levels.values()} | {8}
    shared = {(n, width): contact_shared(n, width) for n in SIZES for width in sorted(widths)}
    text = ["eight drives side by side, one a lane, against one after the other in the core",
            *common.machine(), f"CPU time, medians of {rounds} interleaved repeats"]  # fmt: skip
    for level, rows in levels.items():
        worst = max(
            max(row[:2]) for side in ("1", "2") for row in rows[f"difference {side}"].values()
        )
        if not worst < AGREE:
            raise SystemExit(f"{level}: rates or solutions differ by {worst:.2g} of the largest")
        text += table(level, rows, steps, shared)
        text.append(f"rates and solutions of both sides differ by {worst:.1g} of the largest")
    common.publish("lanes", text, arguments.write)


if __name__ == "__main__":
    main()
