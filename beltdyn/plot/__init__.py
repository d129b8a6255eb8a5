"""Figures and animations of results. Needs matplotlib; nothing global is changed.

Every function takes a :class:`beltdyn.Result`, finished or not, and ``ax=``, the axes to draw into,
and gives these axes. Without ``ax`` it makes a figure of its own, at ``.figure`` of what it gives,
without pyplot and without a window. Further keywords of the functions that draw lines go to
matplotlib's ``plot``: a ``label``, a ``color``. Drawn into axes that hold lines already, new ones
take the next style, so two runs can be compared in one picture. Colours are those of Okabe and
Ito, and lines differ by their dashes too.
"""

from __future__ import annotations

try:
    import matplotlib as _matplotlib  # noqa: F401
except ImportError:
    raise ImportError(
        "beltdyn.plot needs matplotlib: python -m pip install matplotlib (or beltdyn[plot])"
    ) from None

from .animation import Animation, animate
from .belt import drive, force_along_belt
from .figures import overview
from .friction import contact_forces, friction_coefficient, relative_velocity
from .history import joint_deformation, joint_force, span_tensions, speeds, torques
from .ledger import energy

__all__ = [
    "Animation",
    "animate",
    "contact_forces",
    "drive",
    "energy",
    "force_along_belt",
    "friction_coefficient",
    "joint_deformation",
    "joint_force",
    "overview",
    "relative_velocity",
    "span_tensions",
    "speeds",
    "torques",
]
