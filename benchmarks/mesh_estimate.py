"""How large the error of a mesh of joints is, as ``sanity.mesh_error`` estimates it from angles.

Random drives of two pulleys: ratio of the radii 0.4 to 1, strain at rest 0.2 to 2 %, with and
without bending stiffness, either pulley driving with 30 to 75 % of what friction can carry. Each
runs on meshes whose links turn on the smaller pulley by half angles of 0.05 to 0.4, and on a fine
one, 0.025, as the reference. Prints the errors as shares of what straight links would add at rest,
``JOINT_ERRORS`` in ``beltdyn/sanity.py``. Takes some seconds of CPU time per drive.
"""

from __future__ import annotations

import math

import numpy as np
from common import arguments, progress, publish

import beltdyn as bd
from beltdyn import sanity
from beltdyn.accuracy import differences, observe, with_links
from beltdyn.run_warnings import silenced

HALF_ANGLES = (0.05, 0.1, 0.14, 0.2, 0.3, 0.4)
FINEST = 0.025
LAST = 0.35
DRIVES, SEED = 24, 7


def random_drive(rng: np.random.Generator) -> bd.Scene:
    """Draw a drive that comes to steady motion within its time."""
    radii = np.array([0.1, 0.1 * float(rng.choice([0.4, 0.6, 1.0]))])
    distance = float(rng.uniform(1.3, 4.0)) * radii.sum()
    strain = float(10.0 ** rng.uniform(-2.7, -1.7))
    lean = math.asin((radii[1] - radii[0]) / distance)
    path = 2.0 * distance * math.cos(lean)
    path += (math.pi - 2.0 * lean) * radii[0] + (math.pi + 2.0 * lean) * radii[1]
    stiffness, small = 7e4, radii.min()
    tension = stiffness * strain
    bending = float(rng.choice([0.0, 0.003, 0.02])) * tension * small**2
    mu = float(rng.uniform(0.4, 1.0))
    carried = 2.0 * tension * math.tanh(0.5 * mu * (math.pi - 2.0 * abs(lean)))
    force = float(rng.uniform(0.3, 0.75)) * carried
    drives = int(rng.integers(2))
    driven = 1 - drives
    speed = float(rng.uniform(10.0, 60.0)) * 0.1 / radii[driven]
    inertia = 100.0 * radii**4
    loads = [0.0, 0.0]
    loads[driven] = force * radii[driven] / speed
    ramp = np.zeros((2, 2))
    ramp[1, drives] = -force * radii[drives]
    params = bd.Params(
        belt=bd.Belt(
            length=path / (1.0 + strain),
            n_bodies=60,
            linear_density=0.1,
            axial_stiffness=stiffness,
            axial_damping=2e-5 * stiffness,
            bending_stiffness=bending,
        ),
        pulleys=[
            bd.Pulley(center=(x, 0.0), radius=float(r), inertia=float(i))
            for x, r, i in zip((0.0, distance), radii, inertia, strict=True)
        ],
        friction=bd.Dahl(mu_k=mu, sigma=2e3 / small),
    )
    t_end = min(1.2, 1.15 + 6.0 * inertia[driven] / loads[driven])
    return bd.Scene(params, bd.PiecewiseLinear([0.0, 0.15], ramp) + bd.Viscous(loads), t_end)


def links(params: bd.Params, half_angle: float) -> int:
    """Give the number of links that turn by no more than this on the smaller pulley."""
    small = min(pulley.radius for pulley in params.pulleys)
    return math.ceil(params.belt.length / (2.0 * small * half_angle))


def shares(scene: bd.Scene) -> list[tuple[float, float]]:
    """Give the errors of "tension" and "span_mean" on each mesh over what straight links add."""
    times = np.linspace(0.0, scene.t_end, 1501)

    def seen(params: bd.Params):  # type: ignore[no-untyped-def]
        run = bd.simulate(*scene._replace(params=params), rtol=1e-3, t_eval=times)
        return observe(run, last=LAST)

    exact = seen(with_links(scene.params, links(scene.params, FINEST)))
    found = []
    for half_angle in HALF_ANGLES:
        params = with_links(scene.params, links(scene.params, half_angle))
        try:
            error = differences(seen(params), exact)
        except (ValueError, bd.SimulationError):
            continue
        estimate = sanity.mesh_error(params)
        found.append(
            tuple(
                error[name] / estimate[name] * sanity.JOINT_ERRORS[name]
                for name in ("tension", "span_mean")
            )
        )
    return found  # type: ignore[return-value]


def main() -> None:
    """Run all drives and print medians and deciles."""
    given = arguments(__doc__, "4 minutes", "15 s")
    rng = np.random.default_rng(SEED)
    found: list[tuple[float, float]] = []
    drives = 2 if given.quick else DRIVES
    for k in range(drives):
        progress(f"drive {k + 1} of {drives}")
        with silenced():
            found += shares(random_drive(rng))
    lines = [f"{len(found)} meshes of {drives} drives; error over what straight links add"]
    for name, column in zip(("tension", "span_mean"), np.array(found).T, strict=True):
        low, middle, high = np.quantile(column, (0.1, 0.5, 0.9))
        lines.append(
            f"{name:10s} median 1/{1 / middle:.0f}, deciles 1/{1 / low:.0f}, 1/{1 / high:.0f}"
        )
    publish("mesh_estimate", lines, given.write)


if __name__ == "__main__":
    main()
