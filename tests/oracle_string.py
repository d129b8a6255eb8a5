"""Drives with a string for their belt, for the tests of the oracle."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import oracle_mounted
import reference as ref
from oracle_mounted import DAHL, DRAG, ELASTIC, GRAVITY, LUGRE
from reference_string import String, as_string

MODELS: dict[str, Callable[[], String]] = {
    "string, paper": lambda: as_string(ref.paper_drive()),
    "string, gravity, drag": lambda: as_string(
        ref.paper_drive(gravity=GRAVITY, drag=np.array([[3.0, 0.1, 0.02], [1.0, 0.0, 0.3]]))
    ),
    "string, no friction": lambda: as_string(ref.paper_drive(mu_k=None, sigma=None)),
    "string, idler, three laws": lambda: as_string(
        oracle_mounted.drive(
            [[0.0, 0.0], [0.13, 0.085], [0.30, 0.02]], [0.08, 0.04, 0.10], (1, -1, 1),
            friction=(DAHL, LUGRE, ELASTIC), drag=np.array([DRAG] * 3),
        )
    ),
    "string, crossed": lambda: as_string(
        oracle_mounted.drive(
            [[0.0, 0.0], [0.35, 0.05]], [0.06, 0.10], (1, -1), friction=(ELASTIC, None), winding=0,
        )
    ),
    "string, arm, path and slider": lambda: as_string(oracle_mounted.every()),
    "string, arm, path and slider, motions": lambda: as_string(
        oracle_mounted.every(
            motion={
                1: lambda t: (5.0 * math.cos(20.0 * t), -100.0 * math.sin(20.0 * t)),
                2: lambda t: (-4.0 - 300.0 * t, -300.0),
            }
        )
    ),
}  # fmt: skip
