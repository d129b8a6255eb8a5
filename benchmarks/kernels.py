"""Nanoseconds per link of the core's inner loops, at every kernel level, beside the machine's own.

    python benchmarks/kernels.py [--quick] [--write]

Compiles benchmarks/kernels.c against csrc/ with the flags of setup.py and runs it on the paper's
case 1 at the state of 0.4 s. For belts of more links this state is interpolated along the belt: on
a pulley links sink in as deep as their neighbours did, the penetration being the same per metre.
Medians over interleaved repeats of CPU time.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import os
import platform
import subprocess
import tempfile
import warnings
from pathlib import Path
from typing import Any

import attrs
import numpy as np

import beltdyn as bd

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "csrc"
COMPILER = os.environ.get("CC", "cc")
SIZES = (60, 120, 240, 480, 960, 3840)


def setup_constants() -> dict[str, Any]:
    """The constants of setup.py, which cannot be imported: it builds."""
    module = ast.parse((ROOT / "setup.py").read_text())
    assignments = [node for node in module.body if isinstance(node, ast.Assign)]
    module.body = [node for node in assignments if ast.unparse(node.targets[0]).isupper()]
    names: dict[str, Any] = {"os": os, "platform": platform, "Path": Path}
    with contextlib.chdir(ROOT):  # paths in setup.py are those of the checkout
        exec(compile(module, "setup.py", "exec"), names)
    return names


def compile_benchmark(folder: Path) -> tuple[Path, list[str]]:
    constants = setup_constants()
    flags: list[str] = constants["FLAGS"]
    levels: dict[Path, list[str]] = {Path("csrc/kernels/rhs_baseline.c"): []}
    if constants["X86"]:
        levels |= constants["LEVELS"]
    sources = {p: levels.get(p, []) for p in [*constants["SOURCES"], *levels]
               if p.parent.name != "binding"}  # fmt: skip
    common = [COMPILER, *flags, *["-DBD_X86_LEVELS=1"][: constants["X86"]], f"-I{CORE}", "-c"]
    objects = []

    def build(source: Path, name: str, *extra: str) -> None:
        objects.append(folder / name)
        subprocess.run([*common, *extra, str(source), "-o", str(objects[-1])], check=True)

    for path, extra in sources.items():
        build(ROOT / path, path.stem + ".o", *extra)
    build(ROOT / "benchmarks/kernels.c", "benchmark.o")
    for path, extra in levels.items():
        if not path.name.startswith("rhs_"):
            continue
        level = path.stem.removeprefix("rhs_")
        build(ROOT / "benchmarks/kernels.c", f"limits_{level}.o", *extra, "-ffp-contract=fast",
              f"-DBD_LIMITS={level}")  # fmt: skip
    target = folder / "kernels"
    subprocess.run([COMPILER, *map(str, objects), "-lm", "-o", str(target)], check=True)
    return target, flags


def drawn_out(state: bd.State, params: bd.Params, n: int) -> dict[str, np.ndarray]:
    """The state of a belt of fewer links as one of n links."""
    few = state.x.shape[-1]
    at = np.arange(n) * few / n
    turn = 2 * np.pi * params.info["winding"]

    def along(values: np.ndarray, closing: float = 0.0) -> np.ndarray:
        return np.asarray(np.interp(at, np.arange(few + 1), [*values, values[0] + closing]))

    out = {name: along(np.ravel(getattr(state, name)), turn if name == "phi" else 0.0)
           for name in ("x", "y", "phi", "vx", "vy", "vphi", "mu", "slip")}  # fmt: skip
    for pulley in params.pulleys:
        x, y = pulley.center
        depth = along(pulley.radius - np.hypot(state.x - x, state.y - y))
        rho = np.hypot(out["x"] - x, out["y"] - y)
        scale = np.where(depth > 0, (pulley.radius - depth) / rho, 1.0)
        out["x"], out["y"] = x + scale * (out["x"] - x), y + scale * (out["y"] - y)
    return out | {"theta": state.theta, "omega": state.omega}


def drive_text(params: bd.Params, state: dict[str, np.ndarray]) -> str:
    belt, contact, friction = params.belt, params.contact, params.friction
    assert friction is not None
    values = [belt.n_bodies, belt.length, belt.linear_density, belt.axial_stiffness,
              belt.axial_damping, belt.bending_stiffness, belt.bending_damping, contact.quadratic,
              contact.linear, contact.damping, friction.mu_k, friction.sigma,
              len(params.pulleys)]  # fmt: skip
    for p in params.pulleys:
        values += [*p.center, p.radius, p.inertia]
    for array in state.values():
        values += list(array)
    return " ".join(float(v).hex() for v in values)


def machine(flags: list[str]) -> str:
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [x.split(":")[1].strip() for x in cpuinfo.read_text().splitlines()
                 if x.startswith("model name")]  # fmt: skip
        model = f"{len(names)} x {names[0]}" if names else model
    version = subprocess.run([COMPILER, "--version"], check=True, capture_output=True, text=True)
    return (
        f"{model}; {platform.system()} {platform.release()}; Python {platform.python_version()}, "
        f"NumPy {np.__version__}, beltdyn {bd.__version__}\n"
        f"{version.stdout.splitlines()[0]}: {' '.join(flags)}"
    )


def tables(lines: list[str]) -> list[str]:
    cells: dict[str, dict[str, dict[int, float]]] = {}
    for line in lines:
        level, n, row, value = line.split(",")
        cells.setdefault(level, {}).setdefault(row, {})[int(n)] = float(value) / int(n)
    text = []
    for level, rows in cells.items():
        sizes = list(rows["right-hand side"])
        text += ["", f"{level + ': ns per link':24}" + "".join(f"{n:>8}" for n in sizes)]
        for row, values in rows.items():
            if sizes[0] in values:
                text += [f"  {row:22}" + "".join(f"{values[n]:8.2f}" for n in sizes)]
            else:  # a limit of the machine, per double
                ns = next(iter(values.values()))
                rate = f"{2 / ns:.0f} Gflop/s" if "load" not in row else f"{8 / ns:.0f} GB/s"
                text += [f"  {row:22}{ns:8.3f} ns per double, {rate}"]
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="two sizes, a few repeats")
    parser.add_argument("--write", action="store_true", help="keep the tables under results/")
    arguments = parser.parse_args()
    rounds = 15 if arguments.quick else 101
    sizes = SIZES[:3:2] if arguments.quick else SIZES

    warnings.filterwarnings(
        "ignore", "mesh", UserWarning
    )  # the paper's belt has 60 links by design
    scene = bd.scenes.kubas_case_1()
    start = bd.settle(scene.params)
    state = bd.simulate(*scene[:2], 0.4, initial=start, t_eval=[0.4]).final_state
    drives = []
    for n in sizes:
        params = attrs.evolve(scene.params, belt=attrs.evolve(scene.params.belt, n_bodies=n))
        drives.append(drive_text(params, drawn_out(state, scene.params, n)))
    with tempfile.TemporaryDirectory() as folder:
        program, flags = compile_benchmark(Path(folder))
        done = subprocess.run([program], input="\n".join([f"{rounds} {len(drives)}", *drives]),
                              check=True, stdout=subprocess.PIPE, text=True)  # fmt: skip
    text = "\n".join(
        [
            "case 1 at 0.4 s, two pulleys, friction and bending: inner loops of the core",
            machine(flags),
            f"CPU time, medians of {rounds} interleaved repeats",
            *tables(done.stdout.splitlines()),
        ]
    )
    print(text)
    if arguments.write:
        target = Path(__file__).parent / "results" / "kernels.txt"
        target.parent.mkdir(exist_ok=True)
        target.write_text(text + "\n")


if __name__ == "__main__":
    main()
