"""What each effect and friction law costs: on, per link and step; off, against a build without it.

    python benchmarks/effects.py [--quick] [--write]

OFF: the core is built twice from copies of the sources, as they are, and without every optional
effect, every law but Dahl's and the kernels of contact damping by the force, whose rows are taken
out of the tables. A drive that calls for none of these takes its step in both, in turn, in one
process.
ON: the same drive with one effect more, in turn with the one that has it not, in the installed
core. The table of effects is that of ``tests/effects.py``; laws are those of the core's
table, and a new one appears by itself.

Times are those of a whole step at a state of a run, as the core measures them
(``Simulation.time_passes``), medians over rounds in turn; ratios and prices are taken round by
round. A step of "tsit5" has six evaluations of the rate, one of "rodas4" six and a linear system.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import attrs
import common
import numpy as np

import beltdyn as bd
from beltdyn import _core
from beltdyn.loads.motions import as_motions, motion_terms

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from effects import EFFECTS, bare  # noqa: E402
from laws import EXAMPLES, STRIBECK, without_curve  # noqa: E402

METHODS = ("tsit5", "rodas4", "lbdf2")
LINKS = 240
#: Rows of the table of effects that every drive has.
ALWAYS = {"joints", "contact", "pulleys: set torques"}
#: And those that settling needs.
SETTLING = {"moving centres", "mass-proportional damping", "centrifugal force"}


# ---------------------------------------------------------------- builds


def without_options(tree: Path) -> list[str]:
    """Take optional effects and laws out of a copy of the sources; say which."""
    laws = tree / "csrc/friction/laws.h"
    text = laws.read_text()
    rows = re.findall(r"^  X\((\w+), .*\)", text, re.MULTILINE)
    (dahl,) = re.findall(r"^  X\(dahl, .*\)", text, re.MULTILINE)
    text = re.sub(r"#define BD_LAWS\(X\).*?\)\n(?=\n|#|/)", f"#define BD_LAWS(X) {dahl}\n", text,
                  flags=re.DOTALL)  # fmt: skip
    taken = [name for name in rows if name != "dahl"]
    for name in taken:
        text = text.replace(f'#include "friction/{name}.h"\n', "")
    laws.write_text(text)

    curve = tree / "csrc/friction/stribeck.h"
    text = curve.read_text()
    condition = "mu_s > 0.0 && mu_s != mu_k"
    assert condition in text
    curve.write_text(text.replace(condition, "0"))
    taken.append("Stribeck curve")

    physics = tree / "csrc/physics"
    row = re.compile(r'^const bd_effect bd_effect_(\w+) = \{\s+\.name = "(.*?)"', re.MULTILINE)
    rows = {
        name: one for file in physics.glob("*.c") for one, name in row.findall(file.read_text())
    }
    text = (physics / "physics.h").read_text()
    for name, _ in _core.EFFECTS:
        if name not in ALWAYS | SETTLING:
            text, n = re.subn(rf"^  X\({rows[name]}\) +\\\n", "", text, flags=re.MULTILINE)
            assert n == 1, name
            taken.append(name)
    (physics / "physics.h").write_text(text)

    changed = 0
    for header in (tree / "csrc/kernels").glob("*.h"):
        old = header.read_text()
        new = old.replace("pulley->hunt_crossley > 0.0", "0")
        changed += new != old
        header.write_text(new)
    assert changed > 0
    return [*taken, "damping by the force"]


def built(folder: Path, strip: bool) -> tuple[Any, list[str]]:
    """Build the core from a copy of the sources and load it beside the installed one."""
    tree = folder / ("without" if strip else "whole")
    tree.mkdir()
    for name in ("csrc", "beltdyn"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("*.so"))
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    taken = without_options(tree) if strip else []
    environment = {k: v for k, v in os.environ.items() if k != "BELTDYN_STRICT"}
    command = [sys.executable, "setup.py", "-q", "build_ext", "--build-lib", "out"]
    subprocess.run(command, cwd=tree, check=True, env=environment, capture_output=True)
    (found,) = (tree / "out").glob("beltdyn/_core*.so")
    loader = importlib.machinery.ExtensionFileLoader("beltdyn._core", str(found))
    spec = importlib.util.spec_from_loader("beltdyn._core", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module, taken


# ---------------------------------------------------------------- a step


class Drive:
    """A drive at a state of a run, whose step can be timed again and again."""

    def __init__(self, core: Any, params: bd.Params, ledger: bool, motion: Any = None) -> None:
        self.core, self.ledger = core, ledger
        state = bd.settle(params)
        self.state = state._to_core(params)
        self.motion = motion_terms(as_motions(motion, params.pulley_names))
        self.torque = [("piecewise", [0.0, 0.01], [[0.0, 0.0], [-5.0, 2.0]])]
        self.model = params._model if core is _core else self._model_of(params)

    def _model_of(self, params: bd.Params) -> Any:
        """The model of another core, from the same numbers."""
        belt, contact = params.effective_belt, params.effective_contact
        numbers = ("length", "n_bodies", "linear_density", "axial_stiffness", "axial_damping",
                   "bending_stiffness", "bending_damping")  # fmt: skip
        friction = None if params.friction is None else params.friction._to_core()
        return self.core.Model(
            tuple(getattr(belt, name) for name in numbers),
            [p.center for p in params.pulleys],
            [p.radius for p in params.pulleys],
            [p.inertia for p in params.pulleys],
            tuple(
                int(value) if isinstance(value, bool) else value for value in attrs.astuple(contact)
            ),
            friction,
            params.gravity,
            mesh=belt.mesh,
        )

    def step(self, method: str, rounds: int) -> float:
        """Seconds of a step."""
        sim = self.core.Simulation(
            self.model, self.state, self.torque, 0.05, method=method, rtol=1e-3, guards=False,
            ledger=self.ledger, motion=self.motion,
        )  # fmt: skip
        sim.advance(0.0)
        return float(sim.time_passes(rounds)[-1][2])


def in_turn(
    one: Drive, other: Drive, method: str, repeats: int, rounds: int
) -> tuple[list[float], list[float]]:
    """Seconds of a step of both, round by round; who begins changes."""
    times: tuple[list[float], list[float]] = ([], [])
    for k in range(repeats):
        for which in (0, 1) if k % 2 else (1, 0):
            times[which].append((one, other)[which].step(method, rounds))
    return times


def quartiles(values: list[float]) -> tuple[float, float, float]:
    low, middle, high = statistics.quantiles(values, n=4)
    return low, middle, high


def plain(mesh: str) -> bd.Params:
    """The drive without any option, on many links."""
    params = bare(mesh)
    return attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=LINKS))


def off(repeats: int, rounds: int) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        common.progress("building the core with and without the options")
        whole, _ = built(Path(folder), strip=False)
        without, taken = built(Path(folder), strip=True)
        lines = [
            f"OFF: a step of a drive that calls for none of {len(taken)} options, in a core that",
            f"has them over one that has not: {', '.join(taken)}",
            "",
            "mesh   friction  method    us with  us without   ratio  quartiles",
        ]
        for mesh in ("paper", "joint"):
            for law in (None, "dahl"):
                friction = None if law is None else EXAMPLES[law]
                params = attrs.evolve(plain(mesh), friction=friction)
                drives = [Drive(core, params, ledger=False) for core in (whole, without)]
                for method in METHODS:
                    a, b = in_turn(*drives, method, repeats, rounds)
                    low, middle, high = quartiles([x / y for x, y in zip(a, b, strict=True)])
                    us = 1e6 * np.array([statistics.median(a), statistics.median(b)])
                    lines.append(
                        f"{mesh:6s} {law or 'none':9s} {method:7s} {us[0]:9.2f} {us[1]:11.2f}"
                        f" {middle:7.3f}  {low:.3f} to {high:.3f}"
                    )
                    common.progress(lines[-1])
    return lines


def on(repeats: int, rounds: int) -> list[str]:
    lines = [
        "",
        "ON: price of an effect alone, ns per link and step, and its part of the step",
        "",
        "mesh   effect                        " + "".join(f"{m:>26s}" for m in METHODS),
    ]

    def row(mesh: str, name: str, without: Drive, having: Drive) -> None:
        text = f"{mesh:6s} {name:30s}"
        for method in METHODS:
            a, b = in_turn(having, without, method, repeats, rounds)
            low, price, high = quartiles([1e9 * (x - y) / LINKS for x, y in zip(a, b, strict=True)])
            share = price * 1e-9 * LINKS / statistics.median(b)
            text += f" {price:6.2f} ({low:5.2f},{high:5.2f}) {100 * share:4.0f} %"
        lines.append(text)
        common.progress(text)

    for mesh in ("paper", "joint"):
        params = plain(mesh)
        without = Drive(_core, params, ledger=False)
        for name, effect in EFFECTS.items():
            if mesh in effect.meshes:
                row(mesh, name, without, Drive(_core, effect.on(params), ledger=False))
        for name, law in STRIBECK.items():
            pair = [
                Drive(_core, attrs.evolve(params, friction=one), ledger=False)
                for one in (without_curve(law), law)
            ]
            row(mesh, f"Stribeck curve, {name}", *pair)
        motion = {0: bd.PiecewiseLinear([0.0, 1.0], [0.0, 1.0])}
        row(mesh, "prescribed motion", without, Drive(_core, params, False, motion))
        row(mesh, "ledger", without, Drive(_core, params, ledger=True))
    return lines


def main() -> None:
    arguments = common.arguments(__doc__, "20 min", "4 min")
    repeats, rounds = (4, 3) if arguments.quick else (15, 5)
    lines = [
        f"What effects and laws cost, {LINKS} links, two pulleys, kernels {_core.kernel_level()}",
        *common.machine(),
        f"medians of {repeats} rounds in turn; quartiles of the rounds",
        "",
        *off(repeats, rounds),
        *on(repeats, rounds),
    ]
    common.publish("effects", lines, arguments.write)


if __name__ == "__main__":
    main()
