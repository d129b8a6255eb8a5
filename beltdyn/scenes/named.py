"""Scenes by name: the paper's and some small drives; hard ones and TOML files are found, too."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import attrs

from ..base.checks import close_to
from ..drive.friction import Dahl
from ..drive.scene import Scene
from ..loads.torques import PiecewiseLinear
from .from_file import kept
from .hard_scenes import SCENES as hard
from .machines import (
    conveyor,
    crossed_belt,
    flat_belt_axis,
    serpentine,
    tensioned_alternator,
)
from .published import ntarladima_2023

__all__ = [
    "describe",
    "find",
    "flywheel_start",
    "get",
    "kubas_case_1",
    "kubas_case_2",
    "names",
    "three_pulleys",
    "unequal_pulleys",
]


def kubas_case_1() -> Scene:
    """Run the paper's drive up to 2 pi rad/s against a viscous load: case 1.

    From the paper: two pulleys of radius 0.1 m, 0.290 m apart, L = 1.2 m, n_b = 60, sigma = 1e4
    1/m, the load (2.13), which resists. The driving torque goes from 0 to -100 N m over 0.3 s and
    stays. The paper calls it 100 N m in the heading of case 1 and -50 N m in its text; its joint
    forces of about 120 and 1120 N and the load 100/(2 pi) N m s/rad at 2 pi rad/s need 100 N m.

    Not in the paper: EA, rho A, eta A, EI, contact, mu_k, inertia, gravity (none here) and how the
    belt was stabilised. They were identified from the numbers the paper states for both cases, in
    ``notebooks/2-identification.ipynb``: the belt is laid round held pulleys at the strain of the
    belt line, with friction on, and the pulleys are released at t = 0, when each carries 0.13 N m.
    EA, together with the contact, is determined to 3 %, mu_k to 7 %; EI and the contact within a
    factor; the dampings not at all, mass and inertia only together with the phase of the speeds'
    oscillation. The notebook has the intervals, where the paper's numbers contradict each other,
    and which number a drive that rests without holding its pulleys would miss (row 11).

    The mesh is the paper's, whose straight links raise the tension by a quarter at rest, that of
    the spans under this load by 9 %: they have 122 and 1118 N. The drive's own numbers, with
    ``Belt(mesh="joint")``, are 69 and 1069 N.
    """
    return kept("kubas_case_1")


def kubas_case_2(sigma: float = 1e4) -> Scene:
    """Load the paper's drive both ways, opposite on the two pulleys: case 2.

    The drive is that of :func:`kubas_case_1`, which explains the origin of every number. The
    driving torque is piecewise linear, 0, -100, +100, 0 N m at 0, 0.25, 0.75, 1 s; the paper's
    text has 50, its joint forces from 100 to 1110 N need 100.

    Args:
        sigma: Stiffness of the friction joint [1/m]; the paper compares 1e4 and 5e3.
    """
    params = kubas_case_1().params
    assert isinstance(params.friction, Dahl)
    drive = [0.0, -100.0, 100.0, 0.0]
    torque = PiecewiseLinear([0.0, 0.25, 0.75, 1.0], [[value, -value] for value in drive])
    return Scene(
        attrs.evolve(params, friction=attrs.evolve(params.friction, sigma=sigma)), torque, 1.0
    )


def three_pulleys() -> Scene:
    """Drive an alternator and a pump from a crank pulley, with gravity.

    Not from the paper: numbers of the size found on a small engine, a belt strained by 0.7 %. The
    crank torque ramps up in 0.05 s; at 0.25 s the alternator is loaded within 1 ms. With 120 links
    mean tensions are right to 0.4 %; the third span swings by 11 N over the last 0.1 s, where 960
    links have 9.
    """
    return kept("three_pulleys")


def unequal_pulleys() -> Scene:
    """Step the torque on a reduction 1:2 with a stiff belt.

    Not from the paper. The step, at 0.05 s, is a jump, on which the integrator stops; the bending
    stiffness is large enough to lift the belt where it runs on to and off the small pulley.
    """
    return kept("unequal_pulleys")


def flywheel_start() -> Scene:
    """Start a flywheel through a belt that slips fully, then sticks again.

    Not from the paper. For 0.1 s the driving torque is above what friction can transmit and the
    driving pulley slips; then the torque drops and the belt sticks again.
    """
    return kept("flywheel_start")


_SCENES: dict[str, Callable[[], Scene]] = {
    scene.__name__.replace("_", "-"): scene
    for scene in (
        kubas_case_1,
        kubas_case_2,
        three_pulleys,
        unequal_pulleys,
        flywheel_start,
        ntarladima_2023,
        serpentine,
        tensioned_alternator,
        crossed_belt,
        conveyor,
        flat_belt_axis,
    )
}


def names() -> tuple[str, ...]:
    """List the names :func:`get` knows."""
    return tuple(_SCENES)


def describe(name: str) -> str:
    """Return the first line of a scene's description."""
    return (_SCENES[name].__doc__ or "").partition("\n")[0]


def get(name: str) -> Scene:
    """Look up a scene by name, with hyphens or underscores; hard ones as "hard/NAME".

    Raises:
        ValueError: There is none; the message lists the names.
    """
    key = name.replace("_", "-").lower()
    family, _, of_hard = key.partition("/")
    if family == "hard":
        if not of_hard:
            raise ValueError("hard scenes are called hard/NAME; `beltdyn scenes --hard` lists them")
        if of_hard not in hard:
            raise ValueError(
                f"no hard scene is called {of_hard!r}{close_to(of_hard, hard)}; "
                "`beltdyn scenes --hard` lists them"
            )
        return hard[of_hard]
    if key not in _SCENES:
        known = [*_SCENES, *(f"hard/{one}" for one in hard)]
        raise ValueError(
            f"no scene is called {name!r}{close_to(key, known)}; there are "
            f"{', '.join(_SCENES)}, and the hard ones that `beltdyn scenes --hard` lists"
        )
    return _SCENES[key]()


def find(scene: str | os.PathLike[str]) -> Scene:
    """Return a scene by its name, or from a TOML file."""
    if os.path.isdir(scene):
        raise ValueError(f"{os.fspath(scene)} is a folder, not a scene")
    path = os.fspath(scene)
    if path.endswith(".toml") or os.path.isfile(path):
        return Scene.from_toml(Path(path))
    folder, ending = Path(path).parent, Path(path).suffix
    if ending and folder.is_dir() and not path.startswith("hard/"):
        near = close_to(Path(path).name, [one.name for one in folder.glob("*.toml")])
        raise ValueError(f"there is no file {path}{near}, and scenes in files end with .toml")
    return get(path)
