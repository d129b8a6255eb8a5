"""Figures and animations of results. Needs matplotlib; no setting of it is changed.

Each function draws one panel::

    over time    speeds, torques, span_tensions, joint_force, joint_deformation, contact_forces,
                 friction_coefficient (also over slip), relative_velocity, energy, travel of mounts,
                 arcs of contact and slip
    frequency    spectrum; campbell, over the speed of a run-up (both need SciPy)
    over place   tension_along the belt line, fixed in space, at some times
    at one time  force_along_belt; drive: to scale, coloured by tension or friction, with the stick
                 and slip arcs
    before a run layout: the way of the belt round its pulleys
    of a sweep   map, over two of the swept names; lines, over one of them or over time
    vibration    mode, frequency_response; animate_mode (of bd.modes, bd.frequency_response)
    several      overview (a figure of four panels), animate (GIF, MP4, HTML or in a notebook)

It takes a :class:`beltdyn.Result`, finished or not, or the Dataset of a sweep, and ``ax=``, the
axes to draw into (make them with ``plt.subplots(..., layout="constrained")``), and returns these
axes. Without ``ax`` it makes a figure of its own, ``.figure`` of the returned axes::

    bd.plot.speeds(result).figure.savefig("speeds.png")

In a script that has imported ``matplotlib.pyplot`` that figure is pyplot's current one, so that
``plt.savefig`` writes it and ``plt.show`` shows it; close many of them by ``plt.close``. Elsewhere,
and in notebooks, pyplot does not know it, and no window opens.

Further keywords of the functions that draw lines go to matplotlib's ``plot``: a ``label``, a
``color``. In axes that already hold lines, new ones take the next style, so two runs can be
compared in one picture. Colours are those of Okabe and Ito; lines also differ by their dashes.

What changes fast, such as friction over slip, needs more samples than the default of 1001:
``t_eval=np.linspace(0, 1, 5001)``.
"""

from __future__ import annotations

try:
    import matplotlib as _matplotlib  # noqa: F401
except ImportError:
    raise ImportError(
        "beltdyn.plot needs matplotlib: python -m pip install matplotlib (or beltdyn[plot])"
    ) from None

from .animation import Animation
from .history import (
    arcs,
    contact_forces,
    energy,
    force_along_belt,
    friction_coefficient,
    joint_deformation,
    joint_force,
    relative_velocity,
    span_tensions,
    speeds,
    tension_along,
    torques,
    travel,
)
from .mode_shapes import animate_mode, frequency_response, mode
from .picture import animate, drive, overview
from .spectrum_lines import campbell, spectrum
from .sweeps import lines, map
from .to_scale import layout

__all__ = [
    "Animation",
    "animate",
    "animate_mode",
    "arcs",
    "campbell",
    "contact_forces",
    "drive",
    "energy",
    "force_along_belt",
    "frequency_response",
    "friction_coefficient",
    "joint_deformation",
    "joint_force",
    "layout",
    "lines",
    "map",
    "mode",
    "overview",
    "relative_velocity",
    "span_tensions",
    "spectrum",
    "speeds",
    "tension_along",
    "torques",
    "travel",
]
