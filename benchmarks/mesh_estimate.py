"""What a result says of its mesh without other runs, against meshes four times as fine.

    python benchmarks/mesh_estimate.py [--drives 200] [--seed 1] [--free] [--quick] [--write]

Random drives of two to five pulleys at 2 to 50 % of the critical speed sqrt(T / (rho A)), whose
pulley 0 has a prescribed speed; another one is loaded with up to 70 % of what friction can carry.
Strains of 0.2 to 2 %, links that turn by half angles of 0.05 to 0.35 on the smallest pulley, all
kinds of friction, with and without bending stiffness, chosen contact and others, damping from none
to critical. Each starts at speed and runs on its mesh and on one of four times the links. Errors
are those of ``beltdyn.accuracy.differences`` over the last fifth, estimates ``result.accuracy``.
With ``--free`` pulley 0 has the torque of that load in place of its prescribed speed, the other one
a load in proportion to its speed, or none has any (two in five), and speeds are compared.
Prints each drive of which an estimate is less than a third of the truth, and how often estimates
are off, upwards and downwards.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import NamedTuple

import common
import numpy as np

import beltdyn as bd
from beltdyn.accuracy import differences, observe, with_links
from beltdyn.base.run_warnings import silenced

sys.path.insert(0, str(common.HERE.parent / "tests"))
import random_drives
from random_drives import chance, log_uniform

FINER = 4
#: Links of the coarse mesh, from and to.
LINKS = (20, 110)
#: The quantities whose errors are estimated.
QUANTITIES = ("tension", "speed", "span_mean", "friction", "power")
SAMPLES = 801
#: An estimate is said to be right to the first of these factors.
FACTORS = (3.0, 5.0, 10.0)


class Run(NamedTuple):
    """A drive, what it is called, and its error and estimate by quantity."""

    name: str
    error: dict[str, float]
    estimate: dict[str, float]


def friction(rng: np.random.Generator, mu: float) -> bd.Friction:
    """Draw a law with this coefficient."""
    stiff, slow = log_uniform(rng, 1e3, 1e5), log_uniform(rng, 1e-3, 1e-1)
    laws: list[bd.Friction] = [
        bd.Dahl(mu_k=mu, sigma=stiff),
        bd.LuGre(mu_k=mu, mu_s=1.2 * mu, sigma=stiff, v_stribeck=0.1),
        bd.Coulomb(mu=mu, v_reg=slow),
        bd.CreepRate(mu=mu, v_critical=slow),
    ]
    return laws[int(rng.choice(len(laws), p=[0.6, 0.15, 0.15, 0.1]))]


def draw(rng: np.random.Generator) -> tuple[bd.Scene, str]:
    """Draw a drive; a ValueError if there is none with these numbers."""
    lay = random_drives._layout(rng, calm=False)
    strain, stiffness = log_uniform(rng, 0.002, 0.02), log_uniform(rng, 2e4, 2e5)
    density, least = log_uniform(rng, 0.03, 0.3), float(lay.radii.min())
    tension, length = stiffness * strain, lay.length / (1.0 + strain)
    n_bodies = round(lay.length / (2.0 * log_uniform(rng, 0.05, 0.35) * least))
    if not LINKS[0] <= n_bodies <= LINKS[1]:
        raise ValueError("too few links, or too many")
    fastest = 2.0 * n_bodies / length * math.sqrt(stiffness / density)  # of the joints [1/s]
    damping = log_uniform(rng, 1e-3, 1.0) if chance(rng, 0.7) else 0.0
    bending = tension * least**2 * log_uniform(rng, 1e-3, 0.1) if chance(rng, 0.3) else 0.0
    contact = bd.Contact()
    if chance(rng, 0.35):
        linear = tension / (least**2 * log_uniform(rng, 1e-4, 5e-3))
        of_critical = 2.0 * math.sqrt(linear * density)
        contact = bd.Contact(linear=linear, damping=of_critical * log_uniform(rng, 0.02, 2.0))
    mu = rng.uniform(0.25, 1.2)
    params = bd.Params(
        belt=bd.Belt(
            length=length,
            n_bodies=n_bodies,
            linear_density=density,
            axial_stiffness=stiffness,
            axial_damping=2.0 * damping * stiffness / fastest,
            bending_stiffness=bending,
        ),
        pulleys=[  # steel discs 5 to 40 mm thick
            bd.Pulley(
                center=center,
                radius=float(radius),
                inertia=0.5 * math.pi * 7800.0 * radius**4 * log_uniform(rng, 0.005, 0.04),
            )
            for center, radius in zip(lay.centers, lay.radii, strict=True)
        ],
        friction=friction(rng, mu),
        contact=contact,
    )
    with_links(params, FINER * n_bodies).info  # noqa: B018 - a ValueError where it cannot be
    critical = math.sqrt(tension / density)
    v, other = rng.uniform(0.02, 0.5) * critical, int(rng.integers(1, lay.radii.size))
    pressing = tension - density * v**2
    carried = 2.0 * pressing * np.tanh(0.5 * mu * lay.wraps[[0, other]])
    pull = rng.uniform(0.0, 0.7) * float(carried.min())
    omega = float(rng.choice([-1.0, 1.0])) * v / lay.radii[0]
    senses = params.route.senses
    load = np.zeros((2, lay.radii.size))
    load[1, other] = -math.copysign(pull * lay.radii[other], omega * senses[0] * senses[other])
    t_end = min(max(2.5 * length / v, 0.03), 0.2)
    name = f"{n_bodies} links, {v:.3g} m/s ({v / critical:.2f} of critical), {pull / tension:.2f} T"
    motion = {0: bd.PiecewiseLinear([0.0, 1.0], [omega, omega])}
    scene = bd.Scene(params, bd.PiecewiseLinear([0.0, 0.25 * t_end], load), t_end, motion)
    return scene, f"{name}, {type(params.friction).__name__}"


def let_go(scene: bd.Scene, coasts: bool) -> bd.Scene:
    """Return a drawn drive whose torques are set, for three times as long."""
    assert scene.motion is not None and isinstance(scene.torque_fn, bd.PiecewiseLinear)
    radii, senses = scene.params._radii, scene.params.route.senses
    load = scene.torque_fn.values[-1] * (0.0 if coasts else 1.0)
    omega = float(scene.motion[0].values[0, 0]) * senses[0] * radii[0] / radii * senses
    drives = -float(np.sum(load * senses / radii)) * senses[0] * radii[0]
    torque = bd.PiecewiseLinear([0.0], [drives], pulley=0) + bd.Viscous(np.abs(load / omega))
    return bd.Scene(scene.params, torque, 3.0 * scene.t_end)


def compared(scene: bd.Scene, omega: float | None) -> tuple[dict[str, float], dict[str, float]]:
    """Return the error of a mesh by quantity, and what its result says of it."""
    meshes = [with_links(scene.params, n * scene.params.belt.n_bodies) for n in (1, FINER)]
    coarse, fine = (
        bd.simulate(
            *scene._replace(params=params),
            initial=None if omega is None else bd.settle(params, speed={0: omega}),
            rtol=1e-3,
            t_eval=np.linspace(0.0, scene.t_end, SAMPLES),
            max_steps=500_000,
        )
        for params in meshes
    )
    error = differences(observe(coarse), observe(fine))
    said = {name: coarse.accuracy[name].space or math.nan for name in QUANTITIES}
    return error, said


def runs(seed: int, drives: int, free: bool) -> tuple[list[Run], int]:
    """Run so many drives; give them, and how many did not run on one of the meshes."""
    found, failed, number = list[Run](), 0, 0
    while len(found) < drives:
        common.progress(f"drive {len(found) + 1} of {drives}")
        number += 1
        try:
            rng = np.random.default_rng([seed, number])
            scene, name = draw(rng)
        except ValueError:
            continue
        try:
            omega = float(scene.motion[0].values[0, 0]) if free and scene.motion else None
            scene = let_go(scene, chance(rng, 0.4)) if free else scene
            with silenced():
                found.append(Run(f"{number}: {name}", *compared(scene, omega)))
        except bd.SimulationError:
            failed += 1
    return found, failed


def _over(found: list[Run], name: str) -> np.ndarray:
    """Return the true errors of a quantity over the estimates."""
    return np.array([one.error[name] / one.estimate[name] for one in found])


def _worst(found: list[Run]) -> np.ndarray:
    """Return the largest of these of each drive."""
    return np.nanmax([_over(found, name) for name in QUANTITIES], axis=0)


def lines_of(found: list[Run]) -> list[str]:
    """Return a table of the true errors over the estimates, and the drives that are far off."""
    above, below = ([f"{way}{one:.0f}" for one in FACTORS] for way in ("above ", "below 1/"))
    heads = "".join(f"{one:>12s}" for one in above + below)
    lines = [f"true over estimate   median    0.1    0.9{heads}"]
    ratios = {name: _over(found, name) for name in QUANTITIES}
    for name, over in (*ratios.items(), ("the worst of them", _worst(found))):
        over = over[np.isfinite(over)]
        if over.size == 0:  # speeds that are prescribed
            continue
        middle, low, high = np.quantile(over, (0.5, 0.1, 0.9))
        shares = [np.mean(over > one) for one in FACTORS]
        shares += [np.mean(over < 1.0 / one) for one in FACTORS]
        told = "".join(f"{100.0 * share:10.1f} %" for share in shares)
        lines.append(f"{name:18s} {middle:8.2f} {low:6.2f} {high:6.2f}{told}")
    lines += ["", "estimates below a third of the truth"]
    for one in found:
        far = [
            f"{name} {100.0 * one.estimate[name]:.2g} for {100.0 * one.error[name]:.2g} %"
            for name in QUANTITIES
            if one.error[name] > FACTORS[0] * one.estimate[name]
        ]
        if far:
            lines.append(f"  {one.name}: {', '.join(far)}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--drives", type=int, default=200, help="how many, some 3 s of CPU time each"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--free", action="store_true", help="torques set, speeds compared")
    parser.add_argument("--quick", action="store_true", help="five drives")
    parser.add_argument("--write", action="store_true", help="keep the table under results/")
    given = parser.parse_args()
    found, failed = runs(given.seed, 5 if given.quick else given.drives, given.free)
    head = f"{len(found)} drives of seed {given.seed}, {failed} more did not run on both meshes"
    common.publish("mesh_estimate", [head, *lines_of(found)], given.write)


if __name__ == "__main__":
    main()
