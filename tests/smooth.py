"""A drive without kinks, for orders of convergence, and what to hold results against."""

from __future__ import annotations

import math

import numpy as np

import beltdyn as bd

T_END = 4e-3  # s


def smooth_params() -> bd.Params:
    """No kinks: friction far from saturation and no contact damping (MODEL: mu_k large, b' = 0).

    A coarse, soft belt, so that steps are limited by accuracy and not by stability.
    """
    return bd.Params(
        belt=bd.Belt(length=1.2, n_bodies=24, linear_density=0.1, axial_stiffness=7e3,
                     axial_damping=0.05, mesh="paper"),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01),
            bd.Pulley(center=(0.29, 0.0), radius=0.1, inertia=0.01),
        ],
        contact=bd.Contact(linear=2.5e6),
        friction=bd.Dahl(mu_k=1e9, sigma=1e3),
    )  # fmt: skip


def smooth_scene() -> tuple[bd.Params, bd.State]:
    params = smooth_params()
    return params, bd.settle(params)


def swing(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
    return [-2.0 * math.sin(200.0 * t), -0.1 * omega[1]]


def observed_order(steps: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
