"""The rig of the identification tests: a small fast drive that slips under its last torque."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np
import pytest

import beltdyn as bd
from beltdyn.drive import parameters as names

#: What is warned of here by design: few long links on a soft contact make a run cheap, the
#: last torque is to make it slip, and of a pulley that turns alone the closed form is known.
COARSE = [
    pytest.mark.filterwarnings(f"ignore:{code}:UserWarning")
    for code in ("compliance", "long_links", "no_friction", "full_slip")
]

T_END = 0.08
TIMES = np.linspace(T_END / 20, T_END, 20)
TORQUE = bd.PiecewiseLinear(
    [0.0, 0.01, 0.04, 0.06], [[0.0, 0.0], [-30.0, 0.0], [-30.0, 0.0], [-80.0, 0.0]]
) + bd.Viscous([0.0, 2.0])
SPEED, TENSION = 0.5, 40.0  # standard deviations of the sensors [rad/s], [N]


def changed(params: bd.Params, values: Mapping[str, float]) -> bd.Params:
    drive: bd.Params = names.assign(params, [(names.parse(k), v) for k, v in values.items()])
    return drive


def make_rig() -> bd.Params:
    drive = bd.scenes.unequal_pulleys().params
    return attrs.evolve(
        drive,
        belt=attrs.evolve(drive.belt, n_bodies=24, bending_stiffness=0.0, mesh="paper"),
        contact=bd.Contact(linear=5e6, damping=500.0),
    )


def free_pulley(inertia: float) -> bd.Params:
    """A rig whose pulley 1 spins up alone: without friction nothing holds it."""
    drive = bd.scenes.unequal_pulleys().params
    belt = attrs.evolve(drive.belt, n_bodies=20, bending_stiffness=0.0, mesh="paper")
    pulleys = [drive.pulleys[0], attrs.evolve(drive.pulleys[1], inertia=inertia)]
    return attrs.evolve(drive, belt=belt, pulleys=pulleys, friction=None)


def curves(
    experiment: bd.Experiment, truth: bd.Result, seed: int | None = None, known: bool = True
) -> list[bd.Target]:
    noise = np.zeros((TIMES.size, 3))
    if seed is not None:
        noise = np.random.default_rng(seed).standard_normal(noise.shape)
    speeds = truth.pulleys.omega + SPEED * noise[:, :2]
    tension = truth.span_tension[:, 0] + TENSION * noise[:, 2]
    return [
        experiment.curve("pulleys.omega", TIMES, speeds, sigma=SPEED if known else None),
        experiment.curve("span_tension[0]", TIMES, tension, sigma=TENSION if known else None),
    ]
