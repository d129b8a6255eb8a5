"""The ALE belt against creep theory and against links: modes, histories, random drives, cost.

    python benchmarks/ale.py [PART...] [--quick] [--write] [--count 1000] [--from 1]

Parts, all of them without a name:

creep       steady states of drive M with rigid pulleys and no bending, against theory (Dahl's law
            by its differential equation), by cells on each half turn, slow and at 31 m/s.
modes       natural frequencies at rest, of links extrapolated from 240, 480 and 960 of them; of a
            string that moves, against its closed form.
histories   span tensions after jumps of load, at four speeds; seven pulleys and an arm; run-up of a
            crossed belt, reversal, a pulley that seizes, a span near slack, slip from rest. Against
            the most links of each drive; beside them fewer links, and the same with rtol 1e-4.
random      random drives to half the critical speed for 0.05 s against 480 links; beside them 240.
            With `--links 1920` against these, of which 960 are a hundredth of a percent off as a
            rule; with `--extrapolated` against what both tend to.
methods     CPU time of each method, and what each effect costs.

Errors of histories are rms of span tensions over their mean, the worst span's. References take long
and are kept in build/ale/, by what they are of.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import hashlib
import itertools
import math
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import attrs
import common
import mesh_estimate
import numpy as np

import beltdyn as bd
from beltdyn.base.run_warnings import silenced

sys.path.insert(0, str(common.HERE.parent / "tests"))
import creep_theory
import drives
import random_drives as random_laws
from random_drives import chance, log_uniform

KEPT = common.HERE.parent / "build" / "ale"
RTOLS = (1e-2, 1e-3, 1e-4)
#: Time of a random drive [s], and most CPU time of its links [s], of so many.
SHORT, MOST, OF = 0.05, 20.0, 480
#: Errors of random drives [%] from which on a run ought to warn, and below which it ought not.
FAR, CALM = 3.0, 1.0


def ale(params: bd.Params, cells: int | None = None, **belt: Any) -> bd.Params:
    """The same drive with an ALE belt, of as many cells as are chosen, or of about so many."""
    return drives.with_belt(params, mesh="ale", model="auto", n_bodies=cells, **belt)


def links(params: bd.Params, n: int, **belt: Any) -> bd.Params:
    return drives.with_belt(params, mesh="joint", model="links", n_bodies=n, **belt)


def kept(of: Any, compute: Callable[[], dict[str, Any]]) -> dict[str, np.ndarray]:
    """What takes long, computed once for what it is of."""
    file = KEPT / f"{hashlib.sha256(repr(of).encode()).hexdigest()[:16]}.npz"
    if not file.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        np.savez(file, **compute())
    with np.load(file) as stored:
        return dict(stored)


@contextlib.contextmanager
def given_up(most: float) -> Iterator[None]:
    """Raise a TimeoutError after so much CPU time [s]; 0: never."""

    def late(*_: Any) -> None:
        raise TimeoutError(f"more than {most:g} s of CPU time")

    signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, most)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)


# ---------------------------------------------------------------- histories


@dataclass(frozen=True)
class History:
    """A run that begins settled, at a speed of pulley 0."""

    params: bd.Params
    torque: bd.TorqueLike
    t_end: float
    motion: dict[int, bd.MotionLike] | None = None
    speed: float = 0.0
    finest: int = 960
    exact: float = 1e-4  # rtol of references

    def run(self, params: bd.Params, **options: Any) -> bd.Result:
        speed = {0: self.speed} if self.speed else None
        with silenced():
            state = bd.settle(params, speed=speed, friction=False, pulleys="held")
            omega = state.omega.copy()
            for k, motion in (self.motion or {}).items():  # within 1e-4 of it
                if isinstance(motion, bd.PiecewiseLinear):
                    omega[k] = motion.values[0, 0]
            return bd.simulate(
                params, self.torque, self.t_end, self.motion,
                initial=attrs.evolve(state, omega=omega),
                t_eval=np.linspace(0.0, self.t_end, 1001), **options,
            )  # fmt: skip

    def reference(self, n: int, most: float = 0.0) -> dict[str, np.ndarray]:
        """Of so many links: tensions, speeds, CPU time, steps, or why it failed; kept.

        most: CPU time after which it is given up [s]; 0: never.
        """
        params = links(self.params, n)

        def compute() -> dict[str, Any]:
            try:
                with given_up(most):
                    found = self.run(params, rtol=self.exact)
            except (bd.SimulationError, TimeoutError) as failure:
                return {"failure": str(failure)}
            return {
                "tension": found.span_tension, "omega": found.pulleys.omega,
                "cpu": found.stats.cpu_time, "steps": found.stats.steps,
            }  # fmt: skip

        return kept((params, self.torque, self.t_end, self.motion, self.speed, self.exact), compute)


def u_at(speed: float, t_end: float = 0.3) -> History:
    """U, 10 N m +-50 % at 50 Hz on the small pulley and a load that balances them from t = 0 on."""
    rate = 2.0 * math.pi * 50.0 / speed
    torque = bd.PiecewiseLinear([0.0, t_end], [-10.0, -10.0], pulley=0)
    torque += bd.Harmonics(0, [rate], [5.0], [-0.5 * math.pi])
    torque += bd.Viscous([0.0, 24.0 / (speed * 5.0 / 12.0)])
    return History(drives.scene_u().params, torque, t_end, speed=-speed)


def serpentine_at(rpm: float) -> History:
    scene = bd.scenes.serpentine(120)
    speed = -rpm * math.pi / 30.0
    mean = bd.PiecewiseLinear([0.0, 1.0], [speed, speed])
    crank = attrs.evolve(scene.motion["crank"], speed=mean)
    return History(scene.params, scene.torque_fn, scene.t_end, {"crank": crank}, speed, 1440, 1e-3)


def crossed() -> History:
    scene = drives.crossed_scene()
    return History(scene.params, scene.torque_fn, 0.3)


def reversal() -> History:
    """M, +-15 rad/s at 2 Hz, 2 N m s of load."""
    turns = bd.PiecewiseLinear([0.0, 0.125, 0.375, 0.5], [0.0, 15.0, -15.0, 0.0])
    return History(drives.scene_m().params, bd.Viscous([0.0, 2.0]), 0.5, {0: turns})


def seizes() -> History:
    """U, EI 0.02, at 63 rad/s, whose large pulley is stopped within 5 ms: gross slip, 60 N left."""
    speed, other = -63.0, -63.0 * 5.0 / 12.0
    motion = {
        0: bd.PiecewiseLinear([0.0, 1.0], [speed, speed]),
        1: bd.PiecewiseLinear([0.0, 0.02, 0.025, 1.0], [other, other, 0.0, 0.0]),
    }
    still = bd.PiecewiseLinear([0.0, 1.0], [0.0, 0.0], pulley=0)
    params = drives.with_belt(drives.scene_u().params, bending_stiffness=0.02)
    return History(params, still, 0.06, motion, speed)


def near_slack() -> History:
    """M with 42 N and gravity, a pulse of 12 N m for 8 ms."""
    params = attrs.evolve(links(drives.scene_m().params, 240), gravity=(0.0, -9.81))
    params = drives.with_belt(params, length=None, preload=42.0, bending_stiffness=0.005)
    params = attrs.evolve(params, belt=params.effective_belt)  # of any mesh the same length
    pulse = [0.0, 0.002, 0.0021, 0.0101, 0.0102, 0.06], [0.0, 0.0, 12.0, 12.0, 0.0, 0.0]
    return History(params, bd.PiecewiseLinear(*pulse, pulley=1), 0.06)


def slips() -> History:
    """From rest to full slip: the large pulley held, the torque of the small one too high."""
    rises = bd.PiecewiseLinear([0.0, 0.05, 0.08], [0.0, 45.0, 45.0], pulley=0)
    held = bd.PiecewiseLinear([0.0, 1.0], [0.0, 0.0])
    return History(drives.reduction(bending_stiffness=0.01), rises, 0.08, {1: held})


HISTORIES: dict[str, Callable[[], History]] = {
    "U, 6.3 rad/s": lambda: u_at(6.3),
    "U, 63 rad/s": lambda: u_at(63.0),
    "U, 314 rad/s": lambda: u_at(314.0),
    "U, 628 rad/s": lambda: u_at(628.0, 0.15),
    "seven pulleys, 3000 1/min": lambda: serpentine_at(3000.0),
    "seven pulleys, 6000 1/min": lambda: serpentine_at(6000.0),
    "crossed, run-up": crossed,
    "reversal": reversal,
    "a pulley seizes": seizes,
    "near slack": near_slack,
    "rest to slip": slips,
}


def apart(tension: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Rms of the worst span, and the largest error of a mean, over the mean tension."""
    off = tension - exact
    mean = float(np.mean(exact))
    return (
        float(np.sqrt(np.mean(off**2, axis=0)).max()) / mean,
        float(np.abs(off.mean(axis=0)).max()) / mean,
    )


def histories(names: Iterable[str], finest: int | None) -> list[str]:
    lines = [
        f"{'drive':27s}{'belt':>12s}{'rtol':>8s}{'rms %':>8s}{'mean %':>8s}{'least N':>9s}"
        f"{'most N':>8s}{'steps/s':>10s}{'CPU s/s':>9s}"
    ]

    def row(name: str, belt: str, rtol: float, tension: np.ndarray, exact: np.ndarray,
            steps: float, cpu: float) -> None:  # fmt: skip
        rms, mean = apart(tension, exact)
        lines.append(
            f"{name:27s}{belt:>12s}{rtol:8.0e}{100.0 * rms:8.3f}{100.0 * mean:8.3f}"
            f"{tension.min():9.2f}{tension.max():8.1f}{steps:10.0f}{cpu:9.3f}"
        )

    for name in names:
        history = HISTORIES[name]()
        common.progress(name)
        n, end = finest or history.finest, history.t_end
        exact = history.reference(n)["tension"]
        for of in (n, n // 2, n // 4):
            run = history.reference(of)
            steps, cpu = float(run["steps"]) / end, float(run["cpu"]) / end
            row(name, f"links {of}", history.exact, run["tension"], exact, steps, cpu)
        for rtol in RTOLS:
            try:
                found = history.run(ale(history.params), rtol=rtol)
            except (bd.SimulationError, ValueError) as failure:
                lines.append(f"{name:27s}{'ALE':>12s}{rtol:8.0e}  {failure}")
                continue
            stats = found.stats
            row(name, "ALE", rtol, found.span_tension, exact, stats.steps / end,
                stats.cpu_time / end)  # fmt: skip
    return lines


# ---------------------------------------------------------------- theory


def creep(cells: Iterable[int]) -> list[str]:
    """M, 60 N m, rigid pulleys, EI = 0: slack tension and creep, pulley 0 at a speed."""
    lines = ["speed rad/s  cells per half turn   slack N  theory  off %   creep %  theory  off"]
    base = drives.scene_m().params
    theory = creep_theory.Drive.open(
        (0.1, 0.1), 0.29, length=base.belt.length, axial_stiffness=base.belt.axial_stiffness,
        linear_density=base.belt.linear_density, mu=base.friction.mu_k,
    )  # fmt: skip
    for speed in (3.77, 314.0):
        for n in cells:
            params = attrs.evolve(base, contact=bd.Contact(linear=1e13, damping=0.0))
            bare = dict.fromkeys(("bending_stiffness", "bending_damping", "axial_damping"), 0.0)
            params = ale(params, 2 * n + 2, **bare)  # as in theory
            end = 60.0 / speed if speed < 10.0 else 0.6
            load = bd.PiecewiseLinear([0.0, 0.1 * end, end], [0.0, 60.0, 60.0], pulley=1)
            motion = {0: bd.PiecewiseLinear([0.0, end], [-speed, -speed])}
            with silenced():
                found = bd.simulate(
                    params, load, end, motion, initial=bd.settle(params, speed={0: -speed}),
                    t_eval=[end], rtol=1e-6,
                )  # fmt: skip
            slack, omega = float(found.span_tension.min()), found.pulleys.omega[-1]
            exact, share = creep_theory.dahl(theory, speed, 60.0, base.friction.sigma)
            found_creep = float(1.0 - omega[1] / omega[0])
            lines.append(
                f"{speed:11.2f}{n:21d}{slack:10.3f}{exact:8.3f}{100.0 * (slack / exact - 1.0):7.3f}"
                f"{100.0 * found_creep:10.5f}{100.0 * share:8.5f}"
                f"{100.0 * (found_creep / share - 1.0):7.3f} %"
            )
    return lines


def rest_modes(params: bd.Params, n: int, phases: int = 1) -> dict[str, Any]:
    with silenced():
        state = bd.settle(params, friction=False, pulleys="held")
        return {"frequency": bd.modes(params, state, n=n, phases=phases).frequency}


RESTING: dict[str, Callable[[], bd.Params]] = {
    "U": lambda: drives.scene_u().params,
    "U, EI 0.02": lambda: drives.with_belt(drives.scene_u().params, bending_stiffness=0.02),
    "M": lambda: drives.scene_m().params,
    "light pulleys": lambda: drives.light_scene().params,
    "crossed": lambda: drives.crossed_scene().params,
    "idler on the back": lambda: drives.idler_scene().params,
    "seven pulleys, arm": lambda: bd.scenes.serpentine(120).params,
}


def modes(names: Iterable[str], meshes: tuple[int, ...], phases: int, most: float) -> list[str]:
    lines = [f"{'drive':22s}{'links extrapolated':>20s}{'finest':>9s}{'ALE':>9s}{'off %':>8s}"]
    for name in names:
        common.progress(f"modes of {name}")
        params, count = RESTING[name](), 10
        found = []
        for n in meshes:
            one = links(params, n)
            compute = functools.partial(rest_modes, one, count, phases)
            found.append(kept(("modes", one, count, phases), compute)["frequency"])
        own = rest_modes(ale(params), count + 2)["frequency"]
        # errors of links fall as 1 / n^2
        limit = found[-1] + (found[-1] - found[-2]) / ((meshes[-1] / meshes[-2]) ** 2 - 1.0)
        for exact, finest in zip(limit, found[-1], strict=True):
            if exact > most:
                continue
            nearest = own[np.argmin(np.abs(own - exact))]
            off = 100.0 * (nearest / exact - 1.0)
            lines.append(f"{name:22s}{exact:20.2f}{finest:9.2f}{nearest:9.2f}{off:8.2f}")
    return lines


def moving_string(shares: Iterable[float]) -> list[str]:
    """f_n = n (c_w^2 - v^2) / (2 S c_w) of M without bending, pulleys free."""
    lines = ["moving string, v/c   exact Hz      ALE   off %"]
    params = ale(drives.with_belt(drives.scene_m().params, bending_stiffness=0.0))
    belt, span = params.belt, params.pulleys[1].center[0]
    for share in shares:
        tension = params.info["mean_tension"]
        omega = share * math.sqrt(tension / belt.linear_density) / params.pulleys[0].radius
        with silenced():
            state = bd.settle(params, speed={0: -omega})
            found = bd.modes(params, state, n=12)
            run = bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-6, initial=state, t_eval=[1e-6])
        pull, v = float(run.span_tension[0, 0]), float(state.v[0])
        wave = math.sqrt(pull * (1.0 + pull / belt.axial_stiffness) / belt.linear_density)
        exact = (wave**2 - v**2) / (2.0 * span * wave)
        nearest = found.frequency[np.argmin(np.abs(found.frequency - exact))]
        lines.append(f"{share:18.2f}{exact:11.3f}{nearest:9.3f}{100 * (nearest / exact - 1):8.3f}")
    return lines


# ---------------------------------------------------------------- random drives


def drawn(number: int) -> tuple[History, str]:
    """Draw a drive of mesh_estimate.py with 2, 3, 4 or 5 pulleys by turns; a third with a crossed
    belt or one more idler on its back, more of them bent, any law, the load soon, half of them with
    an oscillation.
    """
    for attempt in itertools.count():
        rng = np.random.default_rng([number, attempt])
        try:
            scene, name = mesh_estimate.draw(rng)
            params = scene.params
            before = params.pulleys
            if len(before) != 2 + number % 4:
                continue
            belt, tension = params.belt, params.info["strain_tension"]
            if belt.bending_stiffness == 0.0 and chance(rng, 0.4):
                least = min(pulley.radius for pulley in before)
                bending = tension * least**2 * log_uniform(rng, 1e-3, 0.05)
                params = drives.with_belt(params, bending_stiffness=bending)
            if chance(rng, 0.3):
                law = scene.params.friction
                mu = getattr(law, "mu_k", None) or law.mu
                law = random_laws._law(rng, mu, log_uniform(rng, 1e3, 1e5))
                params = attrs.evolve(params, friction=law)
            if chance(rng, 1.0 / 3.0):
                params = random_laws._turned_over(rng, params)
            links(params, 480).info  # noqa: B018 - a ValueError where it cannot be
        except ValueError:
            continue
        break
    assert isinstance(scene.torque_fn, bd.PiecewiseLinear) and scene.motion is not None
    omega, load = float(scene.motion[0].values[0, 0]), scene.torque_fn.values[-1]
    torque = float(load[np.argmax(np.abs(load))])
    center = before[int(np.argmax(np.abs(load)))].center
    k = next(k for k, pulley in enumerate(params.pulleys) if pulley.center == center)
    if params.pulleys[k].side == "outside":  # of a crossed belt
        torque = -torque
    on: bd.Torque = bd.PiecewiseLinear(
        [0.0, log_uniform(rng, 5e-4, 0.0125)], [0.0, torque], pulley=k
    )
    if chance(rng, 0.5):
        turning = abs(omega) * params.pulleys[0].radius / params.pulleys[k].radius
        order = 2.0 * math.pi * log_uniform(rng, 20.0, 200.0) / turning
        on += bd.Harmonics(k, [order], [0.4 * torque], [-0.5 * math.pi])
        name += ", oscillating"
    name += f", EI {params.belt.bending_stiffness:.2g}, {len(params.pulleys)} pulleys"
    if any(pulley.side == "outside" for pulley in params.pulleys):
        name += ", turned over"
    name = name.replace(type(scene.params.friction).__name__, type(params.friction).__name__)
    return History(params, on, SHORT, {0: scene.motion[0]}, omega, 480, 1e-3), name


@dataclass(frozen=True, order=True)
class Compared:
    """A random drive with an ALE belt against links: errors [%], and what it was warned of."""

    error: float
    number: int
    name: str
    own: float  # of half the links
    warned: tuple[str, ...]

    def line(self) -> str:
        warned = ", ".join(self.warned) or "no warning"
        return (
            f"{self.error:7.2f} %  {self.number:4d} {self.name}; {warned}; links {self.own:.2f} %"
        )


def random_drives(first: int, count: int, n: int, extrapolated: bool) -> list[str]:
    found: dict[float, list[Compared]] = {rtol: [] for rtol in RTOLS}
    cpu: dict[str, list[float]] = {"links": [], **{f"{rtol:g}": [] for rtol in RTOLS}}
    refused, ended, without, own = list[str](), list[str](), list[str](), list[float]()
    for number in range(first, first + count):
        history, name = drawn(number)
        common.progress(f"drive {number} of {first + count - 1}: {name}")
        try:
            params = ale(history.params)
            params.info  # noqa: B018 - a ValueError where it cannot be
        except ValueError as reason:
            refused.append(f"{number}: {reason}")
            continue
        most = MOST * max(1.0, (n / OF) ** 2)
        meshes = [history.reference(links, most=most) for links in (n, n // 2)]
        failed = [str(mesh["failure"]) for mesh in meshes if "failure" in mesh]
        if failed:
            without.append(f"{number}: {failed[0]}")
            continue
        exact, coarse = (mesh["tension"] for mesh in meshes)
        cpu["links"].append(float(meshes[1]["cpu"]) / SHORT)
        own.append(100.0 * apart(coarse, exact)[0])
        if extrapolated:  # errors of links go with the square of their length
            exact = exact + (exact - coarse) / 3.0
        for rtol in RTOLS:
            try:
                run = history.run(params, rtol=rtol)
            except (ValueError, bd.SimulationError) as failure:
                ended.append(f"rtol {rtol:g}, drive {number}: {failure}")
                continue
            error = 100.0 * apart(run.span_tension, exact)[0]
            warned = tuple(sorted({one.code for one in run.warnings}))
            found[rtol].append(Compared(error, number, name, own[-1], warned))
            cpu[f"{rtol:g}"].append(run.stats.cpu_time / SHORT)
    lines = [f"drives {first} to {first + count - 1}; rms of the worst span over mean tension, %"]
    for rtol, runs in found.items():
        if runs:
            q = np.quantile([one.error for one in runs], (0.1, 0.5, 0.9, 1.0))
            far = [one for one in runs if one.error > FAR]
            quiet = sum(not one.warned for one in far)
            lines.append(
                f"rtol {rtol:7.0e}: 0.1 {q[0]:.2f}  median {q[1]:.2f}  0.9 {q[2]:.2f}  most"
                f" {q[3]:.2f}; {len(runs)} run, CPU s/s {np.median(cpu[f'{rtol:g}']):.3f};"
                f" beyond {FAR:g} %: {len(far) - quiet} warned, {quiet} not"
            )
    if own:
        q = np.nanquantile(own, (0.1, 0.5, 0.9, 1.0))
        lines.append(
            f"{n // 2:5d} links  : 0.1 {q[0]:.2f}  median {q[1]:.2f}  0.9 {q[2]:.2f}  most"
            f" {q[3]:.2f}; {len(own)} run, CPU s/s {np.median(cpu['links']):.3f}"
        )
    for rtol, runs in found.items():
        calm = [one.warned for one in runs if one.error < CALM]
        codes = sorted({code for warned in calm for code in warned})
        shares = ", ".join(f"{code} {sum(code in one for one in calm)}" for code in codes)
        lines.append(f"within {CALM:g} % at {rtol:g}: {len(calm)}, warned of {shares or 'nothing'}")
    for what, reasons in (
        ("without a reference of links", without), ("refused", refused), ("ended", ended),
    ):  # fmt: skip
        lines += [f"{len(reasons)} {what}", *reasons]
    for rtol, runs in found.items():
        lines.append(f"the worst ten at {rtol:g}, and all beyond {FAR:g} %")
        worst = sorted(runs, reverse=True)
        lines += [one.line() for k, one in enumerate(worst) if k < 10 or one.error > FAR]
    return lines


# ---------------------------------------------------------------- cost


def methods(scale: float) -> list[str]:
    lines = ["method      rtol or step    U, 63 rad/s: steps/s  CPU s/s   rms % of rodas4 1e-5"]
    history = u_at(63.0, scale)
    params = ale(history.params)
    exact = history.run(params, method="rodas4", rtol=1e-5).span_tension
    ladder: list[tuple[str, dict[str, float]]] = [
        (name, {"rtol": rtol})
        for name in ("auto", "rodas4", "lbdf2", "tsit5")
        for rtol in ((1e-2, 1e-3) if name != "tsit5" else (1e-2,))
    ]
    ladder += [("lbdf2", {"step": 2e-4}), ("rk4", {})]
    for name, options in ladder:
        try:
            run = history.run(params, method=name, **options)
        except (ValueError, bd.SimulationError) as failure:
            lines.append(f"{name:11s} {failure}")
            continue
        value = next(iter(options.values()), 0.0)
        lines.append(
            f"{name:11s}{value:13.0e}{run.stats.steps / scale:24.0f}"
            f"{run.stats.cpu_time / scale:9.3f}{100.0 * apart(run.span_tension, exact)[0]:23.3f}"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parts = ("creep", "modes", "histories", "random", "methods")
    parser.add_argument("parts", nargs="*", choices=[*parts, []], help="all of them by default")
    parser.add_argument("--count", type=int, default=1000, help="random drives, some 2 s each")
    parser.add_argument("--from", type=int, default=1, dest="first", help="the first of them")
    parser.add_argument("--links", type=int, default=480, help="of random drives, at most")
    parser.add_argument(
        "--extrapolated", action="store_true", help="random drives: from these and half of them"
    )
    parser.add_argument("--only", default="", help="drives whose name begins so")
    parser.add_argument("--quick", action="store_true", help="to see that it runs, 10 s")
    parser.add_argument("--write", action="store_true", help="keep the table under results/")
    given = parser.parse_args()
    quick, chosen = given.quick, given.parts or parts
    lines = common.machine()
    if "creep" in chosen:
        lines += ["", *creep((10,) if quick else (10, 20, 40))]
    if "modes" in chosen:
        names = [one for one in RESTING if one.startswith(given.only)]
        meshes, phases = ((30, 60), 1) if quick else ((240, 480, 960), 12)
        lines += ["", *modes(names[:1] if quick else names, meshes, phases, 250.0)]
        lines += ["", *moving_string((0.3,) if quick else (0.0, 0.1, 0.2, 0.3, 0.4, 0.5))]
    if "histories" in chosen:
        names = [one for one in HISTORIES if one.startswith(given.only)]
        lines += ["", *histories(names[1:2] if quick else names, 60 if quick else None)]
    if "random" in chosen:
        count, n = (1, 60) if quick else (given.count, given.links)
        lines += ["", *random_drives(given.first, count, n, given.extrapolated)]
    if "methods" in chosen:
        lines += ["", *methods(0.005 if quick else 0.3)]
    common.publish("ale", lines, given.write)


if __name__ == "__main__":
    main()
