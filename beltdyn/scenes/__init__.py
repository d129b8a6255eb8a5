"""Named scenes: one library for tests, benchmarks, notebooks and the command line.

Each scene is a tuple ``params, torque_fn, t_end, motion``, so that
``simulate(*scenes.kubas_case_1())`` works. ``hard`` maps names to scenes that are made to break an
integrator (:class:`beltdyn.scenes.hard_scenes.HardScene`); everywhere else they are called
``"hard/NAME"``.
"""

from __future__ import annotations

from ..drive.scene import Scene
from .hard_scenes import SCENES as hard
from .machines import (
    conveyor,
    crossed_belt,
    flat_belt_axis,
    flywheel_start,
    kubas_case_1,
    kubas_case_2,
    ntarladima_2023,
    serpentine,
    tensioned_alternator,
    three_pulleys,
    unequal_pulleys,
)
from .named import describe, get, names
from .named import find as find

__all__ = [
    "Scene",
    "conveyor",
    "crossed_belt",
    "describe",
    "flat_belt_axis",
    "flywheel_start",
    "get",
    "hard",
    "kubas_case_1",
    "kubas_case_2",
    "names",
    "ntarladima_2023",
    "serpentine",
    "tensioned_alternator",
    "three_pulleys",
    "unequal_pulleys",
]
