"""A drive with its loads, and how long to run: :class:`Scene`, also as TOML."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import positive
from ..base.naming import ByPulley, as_pulley, label
from ..base.run_options import Options
from ..loads.motions import MotionLike, as_motions, described, in_core, motion_terms
from ..loads.torques import Torque, TorqueLike, TorqueSum, as_terms
from . import toml
from .params import FIELDS, Params

#: Of a scene's file.
SCENE_FIELDS = (*toml.SCENE_ONLY, "motion", *FIELDS)


class Scene(NamedTuple):
    """A drive, its loads and how long to run.

    Attributes:
        params: The drive.
        torque_fn: The set torques, as :func:`beltdyn.simulate` takes them.
        t_end: End of the run [s].
        motion: The prescribed motions by pulley, its index or name, as :func:`beltdyn.simulate`
            takes them, or None.
    """

    params: Params
    torque_fn: TorqueLike
    t_end: float
    motion: ByPulley[MotionLike] | None = None

    def check(self) -> None:
        """Raise TypeError or ValueError unless drive, loads and times fit together."""
        positive("t_end", self.t_end, "s")
        as_terms(self.torque_fn, self.params.pulley_names)
        as_motions(self.motion, self.params.pulley_names)

    def __str__(self) -> str:
        self.check()
        motions = "".join(
            f"\n  motion of {label(pulley, self.params.pulley_names)}: {described(motion)}"
            for pulley, motion in (self.motion or {}).items()
        )
        return f"{self.params}\n  torque {self.torque_fn}{motions}\n  t_end  {self.t_end:g} s"

    @classmethod
    def from_toml(cls, source: str | os.PathLike[str]) -> Scene:
        """Read a scene: a drive (:meth:`beltdyn.Params.to_toml`), t_end, [[torque]], [[motion]].

        ``[friction]``, ``gravity`` and dampings may be left out. ``values`` has a row for each time
        and a torque for each pulley in it; with ``pulley``, a number for each time. The other kinds
        of torque, "motor", "speed_table", "load", "harmonics", "step" and "ramp", have the fields
        of their classes, and a factor over time is a table: ``{ kind = "load", pulley = 1,
        quadratic = 2e-4, factor = { t = [0.2, 0.25], values = [0, 1] } }``. ``motion = [{ pulley =
        0, kind = "piecewise_linear", t = [0.0, 0.3], values = [0.0, -60.0] }]`` prescribes a speed,
        kind "crank" the motion of a :class:`CrankMotion`, "angle_table" an :class:`AngleTable`. A
        pulley may have a ``name``, ``side = "outside"``, ``friction`` and ``drag`` tables of its
        own, and a mount: ``mount = { kind = "arm", pivot = [0.1, -0.05], inertia = 2e-3, preload =
        15.0, stiffness = 20.0 }``, with ``tension = 400.0`` in place of ``preload``, or kind
        "slider" or "path"; and a coupling of its shaft: ``coupling = { kind = "clutch", inertia =
        3e-3, stiffness = 20.0 }``, or kind "isolator" or "damper". In all these and in ``offset`` a
        pulley that has a ``name`` may be called by it. A complete scene::

            t_end = 1.0
            gravity = [0.0, -9.81]
            contact = { linear = 2.5e7, damping = 1e3 }
            friction = { mu_k = 1.0, sigma = 1e4 }
            pulleys = [
              { center = [0.0, 0.0], radius = 0.1, inertia = 0.01 },
              { center = [0.29, 0.0], radius = 0.1, inertia = 0.01 },
            ]
            torque = [
              { kind = "piecewise_linear", t = [0.0, 0.3], values = [[0, 0], [-60, 0]] },
              { kind = "viscous", coefficients = [0.0, 15.9] },
            ]
            tensioning = { friction = true, offset = { 1 = [-0.006, 0.0] } }

            [belt]
            length = 1.2
            n_bodies = 240
            linear_density = 0.1
            axial_stiffness = 70e3
            axial_damping = 1.4

        Args:
            source: A path; a str with a line break in it is the TOML text itself.

        Raises:
            OSError: The file cannot be read.
            ValueError: Bad TOML, an unknown or missing field, a broken rule; one line that names
                the path of the field.
        """
        return toml.read(source, cls._from_document)

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the scene as TOML text, also written to ``path``; exact both ways.

        Raises:
            TypeError: The torque or a motion is a function; only torque objects can be written, and
                motions that are a :class:`CrankMotion`, an :class:`AngleTable` or a
                :class:`PiecewiseLinear` speed.
            ValueError: The torque is for another number of pulleys, or ``t_end`` is not > 0.
            OSError: The file cannot be written; a file that was there before is unchanged.
        """
        self.check()
        return toml.write(self._document(), path)

    @classmethod
    def _from_document(cls, document: dict[str, Any]) -> Scene:
        if "scene" in document and "belt" not in document:
            raise ValueError("this is a sweep: run it with `beltdyn sweep`")
        toml.check_fields("", document, SCENE_FIELDS)
        missing = [field for field in toml.SCENE_ONLY if field not in document]
        t_end, torque = (document.pop(field, []) for field in toml.SCENE_ONLY)
        motion = _motion_of(document.pop("motion", []))
        parts = toml.structure(torque, tuple[Torque, ...], "torque")
        params = toml.structure(document, Params)
        if missing:  # said last: a drive without loads may have other mistakes
            raise ValueError(f"{missing[0]}: missing; a drive alone is read by Params.from_toml")
        scene = cls(params, parts[0] if len(parts) == 1 else TorqueSum(parts), t_end, motion)
        for k, part in enumerate(parts):
            if part.n_pulleys is None:
                as_terms(part, params.pulley_names, f"torque[{k}]")
        scene.check()
        return scene

    def _document(self) -> dict[str, Any]:
        """Return the tables of TOML; TypeError for functions, which it cannot hold."""
        torque = self.torque_fn
        if not isinstance(torque, Torque):
            raise TypeError(
                f"torque_fn must be made of torque objects to be written as TOML, got {torque!r}"
            )
        parts = torque.parts if isinstance(torque, TorqueSum) else [torque]
        motions = [_motion_table(*item) for item in (self.motion or {}).items()]
        return {
            "t_end": self.t_end,
            **self.params._document(),
            "torque": [toml.unstructure(part) for part in parts],
            **({"motion": motions} if motions else {}),
        }


def first_speeds(scene: Scene, breakpoints: ArrayLike = ()) -> dict[int, float] | None:
    """Return the speeds with which motions begin at the time 0; None if at rest."""
    params = scene.params
    motions = as_motions(scene.motion, params.pulley_names)
    if not motions:
        return None
    kinks = Options.rows()["breakpoints"].check("breakpoints", breakpoints)
    later = kinks[kinks > 0.0]
    until = min(scene.t_end, float(later[0])) if later.size else scene.t_end
    still = np.zeros(len(params.pulleys))
    _, speeds = params._laid.torques((), motion_terms(motions), 0.0, until, still, still)
    return {k: float(speeds[k]) for k in motions} if speeds.any() else None


def _motion_table(pulley: int | str, motion: MotionLike) -> dict[str, Any]:
    known = in_core(motion)
    if known is None:
        raise TypeError(
            f"motion[{pulley!r}] must be a speed that is a PiecewiseLinear, a CrankMotion or an "
            f"AngleTable, to be written as TOML, got {motion!r}"
        )
    return {"pulley": pulley, **toml.unstructure(known)}


def _motion_of(value: object) -> dict[int | str, MotionLike] | None:
    found: dict[int | str, MotionLike] = {}
    for k, fields in enumerate(toml.tables("motion", value)):
        path = f"motion[{k}]"
        toml.check_fields(path, fields, fields, ("pulley",))
        pulley = as_pulley(f"{path}.pulley", fields.pop("pulley"))
        if pulley in found:
            raise ValueError(f"{path}.pulley: {label(pulley, ())} has a motion already")
        found[pulley] = toml.structure(fields, toml.FileMotion, path)
    return found or None
