"""Compares two builds bit for bit: does a change leave all results as they were?

    python benchmarks/freeze.py BEFORE [AFTER] [--only TEXT] [--sizes]

BEFORE and AFTER are commits; without AFTER it is the working tree. Each is built with the compiler
of this machine under build/freeze/, and runs DRIVES times methods times kernel levels; compared are
SHA-256 sums of all arrays of the result, of the final state and of the counts of steps. Ends with 1
and the list of what differs if anything does; with --sizes it says by how much: the largest
difference of a joint's force over the mean tension, after the same time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
BUILDS = ROOT / "build" / "freeze"
LEVELS = ("baseline", "avx2", "avx512")
METHODS: tuple[dict[str, Any], ...] = (
    {"method": "auto"},
    {"method": "tsit5"},
    {"method": "rk4"},
    {"method": "rodas4"},
    {"method": "lbdf2", "rtol": 1e-3},
    {"method": "lbdf2", "step": 2e-5},
    {"method": "lie", "rtol": 1e-2},
)


def git(*command: str) -> str:
    return subprocess.run(
        ["git", *command], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()


def build(commit: str | None) -> Path:
    """Where the package of that commit, or of the working tree, stands; built if need be."""
    name = git("rev-parse", commit) if commit else "tree"
    source, site = BUILDS / f"{name}-source", BUILDS / name
    if commit and site.exists():
        return site
    shutil.rmtree(site, ignore_errors=True)
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    if commit:
        archive = subprocess.run(
            ["git", "archive", name], cwd=ROOT, check=True, capture_output=True
        ).stdout
        subprocess.run(["tar", "x", "-C", str(source)], input=archive, check=True)
    else:
        for file in git("ls-files", "-co", "--exclude-standard").splitlines():
            if (ROOT / file).exists():
                (source / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / file, source / file)
    command = [sys.executable, "setup.py", "-q", "build_ext", "--inplace", f"-j{os.cpu_count()}"]
    subprocess.run(command, cwd=source, check=True)
    shutil.copytree(source / "beltdyn", site / "beltdyn")
    shutil.rmtree(source)
    return site


# ---------------------------------------------------------------- one side, in a process of its own


def drives() -> dict[str, Callable[[], tuple[Any, ...]]]:
    """Drives that have between them every effect and every kind of torque."""
    import beltdyn as bd

    # The mesh and the contact that every commit has.
    paper = {"mesh": "paper"} if "mesh" in attrs.fields_dict(bd.Belt) else {}
    on_radii = {"compensate": False} if "compensate" in attrs.fields_dict(bd.Contact) else {}

    def scene(name: str, t_end: float, n_bodies: int) -> Callable[[], tuple[Any, ...]]:
        def make() -> tuple[Any, ...]:
            params, torque, *_ = bd.scenes.get(name)
            belt = attrs.evolve(params.belt, n_bodies=n_bodies, **paper)
            contact = attrs.evolve(params.contact, **on_radii)
            return attrs.evolve(params, belt=belt, contact=contact), torque, t_end

        return make

    def belt(n_bodies: int = 60, **others: Any) -> bd.Belt:
        given = {"length": 1.2, "linear_density": 0.1, "axial_stiffness": 70e3, **paper}
        return bd.Belt(n_bodies=n_bodies, **{**given, "axial_damping": 1.4, **others})

    def two(**others: Any) -> bd.Params:
        given: dict[str, Any] = {
            "belt": belt(),
            "pulleys": [
                bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01),
                bd.Pulley(center=(0.29, 0.0), radius=0.1, inertia=0.01),
            ],
            "contact": bd.Contact(quadratic=5e10, linear=2.5e7, damping=1e3),
            "friction": bd.Dahl(mu_k=1.0, sigma=1e4),
        }
        return bd.Params(**{**given, **others})

    ramp = bd.PiecewiseLinear([0.0, 0.02, 0.04], [[0.0, 0.0], [-100.0, 0.0], [-100.0, 20.0]])
    load = bd.Viscous([0.0, 15.9])

    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        return [-80.0 * min(1.0, t / 0.02) - 0.5 * float(omega[0]), -10.0 * float(omega[1])]

    def relay(t: float, theta: Any, omega: Any) -> list[float]:
        return [-100.0 if omega[0] > -3.0 else 0.0, 0.0]

    moved = bd.Tensioning(offset=[(0.0, 0.0), (-0.01, 0.002)], friction=True)
    return {
        "case-1": scene("kubas-case-1", 0.05, 60),
        "case-2": scene("kubas-case-2", 0.05, 60),
        "three-pulleys": scene("three-pulleys", 0.03, 72),
        "unequal-pulleys": scene("unequal-pulleys", 0.03, 72),
        "frictionless": lambda: (two(friction=None), ramp + load, 0.05),
        "bending-gravity": lambda: (
            two(belt=belt(37, bending_stiffness=0.05, bending_damping=1e-5), gravity=(1.0, -9.81)),
            ramp,
            0.05,
        ),
        "full-slip": lambda: (two(friction=bd.Dahl(mu_k=0.1, sigma=1e4)), ramp + load, 0.05),
        "function": lambda: (two(), torque, 0.04),
        "relay": lambda: (two(), relay, 0.02),
        "tensioned": lambda: (two(tensioning=moved), ramp, 0.02),
        "lightly-damped": lambda: (
            two(belt=belt(axial_damping=0.05), contact=bd.Contact(linear=2.5e7, damping=100.0)),
            ramp,
            0.03,
        ),
    }


def arrays_of(result: Any) -> dict[str, np.ndarray]:
    found = {}
    for group in ("belt", "joints", "contact", "pulleys", "energy", "final_state"):
        part = getattr(result, group, None)
        for name in dir(part):
            value = getattr(part, name) if not name.startswith("_") else None
            if isinstance(value, np.ndarray) and value.size:  # of what a drive has
                found[f"{group}.{name}"] = value
    return found


def side(only: str, keep: Path) -> None:
    """Print the sums of every run as JSON; keep the joints' forces."""
    import beltdyn as bd

    warnings.simplefilter("ignore")
    sums: dict[str, str] = {}
    forces: dict[str, np.ndarray] = {}
    for name, make in drives().items():
        if only not in name:
            continue
        params, torque, t_end = make()
        try:
            start = bd.settle(params)
        except bd.SimulationError as failure:
            sums[name] = f"settle: {failure.symbol}"
            continue
        for options in METHODS:
            key = f"{name} {' '.join(f'{value}' for value in options.values())}"
            times = np.linspace(0.0, t_end, 41)
            try:
                result = bd.simulate(params, torque, t_end, initial=start, t_eval=times, **options)
            except bd.SimulationError as failure:
                if failure.result is None:
                    sums[key] = failure.symbol
                    continue
                result = failure.result
            digest = hashlib.sha256()
            for array, value in sorted(arrays_of(result).items()):
                digest.update(array.encode() + np.ascontiguousarray(value).tobytes())
            stats = result.stats
            counts = (stats.steps, stats.rejected, stats.nfev, stats.njev, stats.nlu)
            sums[key] = digest.hexdigest()[:16] + f" {stats.error} {counts}"
            forces[key] = result.joints.force
    np.savez(keep, **forces)
    json.dump(sums, sys.stdout)


def run(site: Path, level: str, only: str) -> tuple[dict[str, str], Path]:
    keep = BUILDS / f"{site.name}-{level}.npz"
    done = subprocess.run(
        [sys.executable, str(Path(__file__).resolve()), "--side", only, str(keep)],
        env={**os.environ, "PYTHONPATH": str(site), "BELTDYN_KERNELS": level},
        stdout=subprocess.PIPE, text=True, check=True, cwd=site,
    )  # fmt: skip
    return json.loads(done.stdout), keep


def levels() -> list[str]:
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    needs = {"baseline": "", "avx2": "avx2", "avx512": "avx512vl"}
    return [level for level in LEVELS if needs[level] in flags]


def size(before: Path, after: Path, key: str) -> str:
    one, two = (np.load(file)[key] for file in (before, after))
    if one.shape != two.shape:
        return "ends elsewhere"
    return f"{np.max(np.abs(one - two)) / abs(np.mean(one)):.2g} of the tension"


def main() -> int:
    if sys.argv[1:2] == ["--side"]:
        side(sys.argv[2], Path(sys.argv[3]))
        return 0
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("before")
    parser.add_argument("after", nargs="?")
    parser.add_argument("--only", default="", metavar="TEXT", help="drives with TEXT in their name")
    parser.add_argument("--sizes", action="store_true", help="say how large differences are")
    options = parser.parse_args()
    sites = build(options.before), build(options.after)
    total = apart = 0
    for level in levels():
        (one, kept), (two, kept_too) = (run(site, level, options.only) for site in sites)
        for key in sorted(one | two):
            total += 1
            if one.get(key) != two.get(key):
                apart += 1
                print(f"{level:10s}{key:32s}{one.get(key)}  {two.get(key)}")
                if options.sizes and key in one and key in two:
                    print(f"{'':10s}{size(kept, kept_too, key)}")
    print(f"{total} runs, {apart} differ")
    return int(apart > 0)


if __name__ == "__main__":
    sys.exit(main())
