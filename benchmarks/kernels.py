"""Nanoseconds per link of the core's inner loops, at every kernel level, beside the machine's own.

    python benchmarks/kernels.py [--quick] [--mesh joint | string] [--write]

Compiles benchmarks/kernels.c against csrc/ with the flags of setup.py and runs it on the paper's
case 1 at the state of 0.4 s. For belts of more links this state is interpolated along the belt: on
a pulley links sink in as deep as their neighbours did, the penetration being the same per metre.
The friction laws, all of the core's table, are compared at this state, too, under the coefficients
of friction that Dahl's law has there. Medians over interleaved repeats of CPU time.
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
from beltdyn import _core
from beltdyn.drive import friction, rules

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "csrc"
COMPILER = os.environ.get("CC", "cc")
SIZES = (60, 120, 240, 480, 960, 3840)
LAW_LINKS = 480  # of the belt on which the laws are compared
#: What `--mesh` makes of the paper's belt: links that meet pulleys at their centres, or along their
#: length; without bending, point masses.
MESHES: dict[str, dict[str, Any]] = {
    "paper": {"mesh": "paper"},
    "joint": {"mesh": "joint"},
    "string": {"mesh": "joint", "bending_stiffness": 0.0, "bending_damping": 0.0},
}
#: What the law decides, of the right-hand side and of the linear systems; then whole steps.
LAW_COLUMNS = {
    "contact": "  contact",
    "+ ledger": "  contact + ledger",
    "Jacobian": "  of contact",
    "solve": "  states of friction",
    "tsit5": "step of tsit5",
    "lbdf2": "step of lbdf2",
    "rodas4": "step of rodas4",
}


def setup_constants() -> dict[str, Any]:
    """The constants of setup.py, which cannot be imported: it builds."""
    module = ast.parse((ROOT / "setup.py").read_text())
    assignments = [node for node in module.body if isinstance(node, ast.Assign)]
    module.body = [node for node in assignments if ast.unparse(node.targets[0]).isupper()]
    names: dict[str, Any] = {"os": os, "platform": platform, "Path": Path}
    with contextlib.chdir(ROOT):  # paths in setup.py are those of the checkout
        exec(compile(module, "setup.py", "exec"), names)
    return names


def compile_objects(folder: Path) -> tuple[list[str], list[Path]]:
    """The core and the machine's limits; the flags, and what is to be linked."""
    constants = setup_constants()
    flags: list[str] = constants["FLAGS"]
    levels: dict[Path, list[str]] = constants["LEVELS"]
    sources = {p: levels.get(p, []) for p in constants["SOURCES"] if p.parent.name != "binding"}
    common = [COMPILER, *flags, *["-DBD_X86_LEVELS=1"][: constants["X86"]], f"-I{CORE}", "-c"]
    objects = []

    def build(source: Path, name: str, *extra: str) -> None:
        objects.append(folder / name)
        subprocess.run([*common, *extra, str(source), "-o", str(objects[-1])], check=True)

    for path, extra in sources.items():
        build(ROOT / path, path.stem + ".o", *extra)
    for path, extra in levels.items():
        if not path.name.startswith("rhs_"):
            continue
        level = path.stem.removeprefix("rhs_")
        build(ROOT / "benchmarks/kernels.c", f"limits_{level}.o", *extra, "-ffp-contract=fast",
              f"-DBD_LIMITS={level}")  # fmt: skip
    return flags, objects


def compile_benchmark(folder: Path) -> tuple[Path, list[str]]:
    flags, objects = compile_objects(folder)
    levels = ["-DBD_X86_LEVELS=1"][: setup_constants()["X86"]]
    target = folder / "kernels"
    subprocess.run([COMPILER, *flags, *levels, f"-I{CORE}",
                    str(ROOT / "benchmarks/kernels.c"), *map(str, objects), "-lm",
                    "-o", str(target)], check=True)  # fmt: skip
    return target, flags


def circle(radius: float, params: bd.Params, n: int) -> float:
    """On which the centres of n unloaded links run, or as many point masses."""
    a = 0.5 * params.belt.length / n / radius
    if params.belt.mesh == "paper":
        return radius
    return float(radius * a / (np.sin(a) if params.belt_model == "string" else np.tan(a)))


def drawn_out(state: bd.State, params: bd.Params, n: int) -> dict[str, np.ndarray]:
    """The state of a belt of fewer links as one of n links."""
    few = state.x.shape[-1]
    at = np.arange(n) * few / n
    turn = 2 * np.pi * params.info["winding"]

    def along(values: np.ndarray, closing: float = 0.0) -> np.ndarray:
        return np.asarray(np.interp(at, np.arange(few + 1), [*values, values[0] + closing]))

    out = {name: along(np.ravel(getattr(state, name)), turn if name == "phi" else 0.0)
           for name in ("x", "y", "phi", "vx", "vy", "vphi")}  # fmt: skip
    for name in ("mu", "slip"):  # of some laws several rows
        out[name] = np.concatenate([along(row) for row in np.atleast_2d(getattr(state, name))])
    for pulley in params.pulleys:
        x, y = pulley.center
        depth = along(circle(pulley.radius, params, few) - np.hypot(state.x - x, state.y - y))
        rho = np.hypot(out["x"] - x, out["y"] - y)
        scale = np.where(depth > 0, (circle(pulley.radius, params, n) - depth) / rho, 1.0)
        out["x"], out["y"] = x + scale * (out["x"] - x), y + scale * (out["y"] - y)
    return out | {"theta": state.theta, "omega": state.omega}


def laws(dahl: bd.Dahl) -> dict[str, bd.Friction | None]:
    """All laws of the table, with parameters near Dahl's; those of others than these are 1."""
    mu, sigma = dahl.mu_k, dahl.sigma
    lugre = bd.LuGre(mu_k=mu, mu_s=mu, v_stribeck=0.02, sigma=sigma, damping=0.1, viscous=0.01)
    given: dict[str, bd.Friction | None] = {
        "none": None,
        "Dahl": dahl,
        "LuGre, mu_s = mu_k": lugre,
        "LuGre": attrs.evolve(lugre, mu_s=1.3 * mu),
        "ElasticPlastic": bd.ElasticPlastic(mu=mu, stiffness=5e7, damping=500.0),
        "MaxwellSlip, 4": bd.MaxwellSlip(
            mu=(mu / 4,) * 4, stiffness=(1.25e7,) * 4, damping=(125.0,) * 4
        ),
    }
    known = {type(law) for law in given.values()}
    others = {name: law for name, law in friction.LAWS.items() if law not in known}
    return given | {
        law.__name__: law(**dict.fromkeys(rules.rules_of(name), 1.0))
        for name, law in others.items()
    }


def under(
    law: bd.Friction | None, state: bd.State, normal: np.ndarray, link_length: float
) -> bd.State:
    """The state, Dahl's, as one of the law: with the same coefficient of friction of every link."""
    if law is None or law.n_states == 0:
        return state
    pressed, none = normal > 0, np.zeros_like(normal)
    force = np.where(pressed, normal, 1.0)
    rows = []
    for element in range(law.n_states):
        at = _core.friction_law(law._to_core(), link_length, none, none, force, element)
        share = state.mu / law.n_states
        rows.append(np.where(pressed, share * force / at["by_state"], 0.0))
    return attrs.evolve(state, mu=np.array(rows) if len(rows) > 1 else rows[0])


def drive_text(params: bd.Params, state: dict[str, np.ndarray]) -> str:
    belt, contact, law = params.belt, params.contact, params.friction
    name, parameters = law._to_core() if law else ("none", ())
    numbers: list[float] = []
    values = [belt.n_bodies, belt.mesh == "joint", belt.length,
              belt.linear_density, belt.axial_stiffness,
              belt.axial_damping, belt.bending_stiffness, belt.bending_damping, contact.quadratic,
              contact.linear, contact.damping]  # fmt: skip
    for number in parameters:  # of a list its length first
        numbers += [len(number), *number] if isinstance(number, tuple) else [number]
    words = [*map(in_full, values), name, *map(in_full, numbers)]
    values = [len(params.pulleys)]
    for p in params.pulleys:
        values += [*p.center, p.radius, p.inertia]
    for array in state.values():
        values += list(array)
    return " ".join([*words, *map(in_full, values)])


def in_full(value: float) -> str:
    return float(value).hex()


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


def tables(lines: list[str], sizes: tuple[int, ...], names: list[str]) -> list[str]:
    """Of the drives of these sizes, and of those with these laws, which come after them."""
    times: dict[str, dict[str, dict[int, float]]] = {}
    touching: dict[int, int] = {}
    for line in lines:
        level, drive, contacts, row, value = line.split(",")
        times.setdefault(level, {}).setdefault(row, {})[int(drive)] = float(value)
        touching[int(drive)] = int(contacts)
    text = []
    for level, rows in times.items():
        limits = {row: values[0] for row, values in rows.items() if len(values) == 1}
        text += ["", f"{level + ': ns per link':24}" + "".join(f"{n:>8}" for n in sizes)]
        for row in [row for row in rows if row not in limits]:
            cells = [rows[row][drive] / n for drive, n in enumerate(sizes)]
            text += [f"  {row:22}" + "".join(f"{cell:8.2f}" for cell in cells)]
        for row, ns in limits.items():  # of the machine, per double
            rate = f"{2 / ns:.0f} Gflop/s" if "load" not in row else f"{8 / ns:.0f} GB/s"
            text += [f"  {row:22}{ns:8.3f} ns per double, {rate}"]
        head = "".join(f"{column:>9}" for column in LAW_COLUMNS)
        text += ["", f"{level + ', by friction law':24}{'ns per link in contact':>45}"
                 f"{'ns per link, steps':>27}", f"{f'{LAW_LINKS} links':24}{head}"]  # fmt: skip
        for drive, name in enumerate(names, start=len(sizes)):
            cells = [rows[row][drive] / (LAW_LINKS if "step" in row else touching[drive])
                     for row in LAW_COLUMNS.values()]  # fmt: skip
            text += [f"  {name:22}" + "".join(f"{cell:9.2f}" for cell in cells)]
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="two sizes, a few repeats")
    parser.add_argument("--write", action="store_true", help="keep the tables under results/")
    parser.add_argument("--mesh", choices=MESHES, default="paper")
    arguments = parser.parse_args()
    rounds = 15 if arguments.quick else 101
    # drawn out to 3840 links, angles and places of the ends of links no longer belong together
    sizes = SIZES[:3:2] if arguments.quick else SIZES[: -1 if arguments.mesh == "joint" else None]

    warnings.filterwarnings(
        "ignore", "mesh", UserWarning
    )  # the paper's belt has 60 links by design
    scene = bd.scenes.kubas_case_1()
    belt = attrs.evolve(scene.params.belt, **MESHES[arguments.mesh])
    scene = scene._replace(params=attrs.evolve(scene.params, belt=belt))
    start = bd.settle(scene.params)
    result = bd.simulate(*scene[:2], 0.4, initial=start, t_eval=[0.4])
    state, normal = result.final_state, result.contact.normal[-1]
    link_length = scene.params.info["link_length"]
    assert isinstance(scene.params.friction, bd.Dahl)
    by_name = laws(scene.params.friction)
    drives = []
    for n, law in [*((n, scene.params.friction) for n in sizes),
                   *((LAW_LINKS, law) for law in by_name.values())]:  # fmt: skip
        params = attrs.evolve(scene.params, friction=law,
                              belt=attrs.evolve(scene.params.belt, n_bodies=n))  # fmt: skip
        at = under(law, state, normal, link_length)
        drives.append(drive_text(params, drawn_out(at, scene.params, n)))
    with tempfile.TemporaryDirectory() as folder:
        program, flags = compile_benchmark(Path(folder))
        done = subprocess.run([program], input="\n".join([f"{rounds} {len(drives)}", *drives]),
                              check=True, stdout=subprocess.PIPE, text=True)  # fmt: skip
    text = "\n".join(
        [
            f"case 1 at 0.4 s, mesh {arguments.mesh}, two pulleys, friction: inner loops",
            machine(flags),
            f"CPU time, medians of {rounds} interleaved repeats",
            *tables(done.stdout.splitlines(), sizes, list(by_name)),
        ]
    )
    print(text)
    if arguments.write:
        target = Path(__file__).parent / "results" / f"kernels_{arguments.mesh}.txt"
        target.parent.mkdir(exist_ok=True)
        target.write_text(text + "\n")


if __name__ == "__main__":
    main()
