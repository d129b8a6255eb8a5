"""The effects that a scene can call for, each with a drive that has nothing else: what switches it
on, on with next to nothing, and off by a 0; and what it takes. Laws of friction come from the
table of the core by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import drives
from laws import EXAMPLES, times

import beltdyn as bd
from beltdyn import _core

#: So small that products with it underflow or are lost against anything they are added to.
TINY = 1e-200
#: Friction scaled by it is as much below rounding of the forces.
FAINT = 1e-20

Change = Callable[[bd.Params], bd.Params]


def bare(mesh: str) -> bd.Params:
    """A drive with nothing but what every drive has: joints and contact."""
    params = drives.on_mesh(drives.plain(), mesh)
    belt = attrs.evolve(params.belt, bending_stiffness=0.0, axial_damping=0.0)
    contact = attrs.evolve(params.contact, damping=0.0)
    return attrs.evolve(params, belt=belt, contact=contact, friction=None)


def of_part(part: str, **numbers: float) -> Change:
    """Change numbers of the belt or of the contact."""

    def change(params: bd.Params) -> bd.Params:
        return attrs.evolve(params, **{part: attrs.evolve(getattr(params, part), **numbers)})

    return change


def of_pulley(**parts: Any) -> Change:
    def change(params: bd.Params) -> bd.Params:
        first, *others = params.pulleys
        return attrs.evolve(params, pulleys=[first, *(attrs.evolve(p, **parts) for p in others)])

    return change


def still(size: float) -> bd.Path:
    """A path on which an axis goes by no more than this [m]."""
    return bd.Path(t=(0.0, 1.0), displacement=((0.0, 0.0), (size, 0.0)))


@attrs.frozen(kw_only=True)
class Effect:
    """An effect, on, on with coefficients of next to nothing, and with 0; what it takes when on:
    passes, numbers of the state for n links, and whether the simulation needs more bytes.
    """

    on: Change
    tiny: Change
    zero: Change | None = None
    passes: int = 0
    state: int = 0
    bytes: bool = False
    outputs: frozenset[str] = frozenset()
    meshes: tuple[str, ...] = ("paper", "joint")


#: Effects of a single number, which joints and contact have by themselves.
NUMBERS = {
    "bending stiffness": ("belt", "bending_stiffness", 0.01),
    "bending damping": ("belt", "bending_damping", 1e-6),
    "axial damping": ("belt", "axial_damping", 1.4),
    "contact damping": ("contact", "damping", 1e3),
    "contact damping by the force": ("contact", "hunt_crossley", 0.3),
}
EFFECTS: dict[str, Effect] = {
    **{
        name: Effect(
            on=of_part(part, **{number: value}),
            tiny=of_part(part, **{number: TINY}),
            zero=of_part(part, **{number: 0.0}),
        )
        for name, (part, number, value) in NUMBERS.items()
    },
    "gravity": Effect(
        on=lambda params: attrs.evolve(params, gravity=(0.0, -9.81)),
        tiny=lambda params: attrs.evolve(params, gravity=(0.0, -TINY)),
        zero=lambda params: attrs.evolve(params, gravity=(0.0, -0.0)),
        passes=1,
    ),
    "bearing drag": Effect(
        on=of_pulley(drag=bd.Drag(coulomb=0.1, viscous=0.01, quadratic=1e-5)),
        tiny=of_pulley(drag=bd.Drag(coulomb=TINY, viscous=TINY, quadratic=TINY)),
        zero=of_pulley(drag=bd.Drag()),
        passes=1,
        bytes=True,
        outputs=frozenset({"energy"}),
    ),
    "mounts": Effect(
        on=of_pulley(mount=still(1e-4)),
        tiny=of_pulley(mount=still(TINY)),
        passes=2,
        bytes=True,
        outputs=frozenset(
            {"energy", *(name for name, group, *_ in _core.OUTPUTS if group == "mounts")}
        ),
        meshes=("joint",),
    ),
    "couplings": Effect(
        on=of_pulley(coupling=bd.OverrunningClutch(inertia=1e-3, stiffness=20.0)),
        tiny=of_pulley(coupling=bd.TorsionalDamper(inertia=TINY, stiffness=0.0, damping=TINY)),
        passes=1,
        bytes=True,
        outputs=frozenset(
            {"energy", *(name for name, group, *_ in _core.OUTPUTS if group == "couplings")}
        ),
    ),
}


def faint(law: bd.Friction) -> bd.Friction:
    """The same law with forces next to nothing, and the same speeds and displacements."""
    return times(law, FAINT, "1", "1/m", "s/m", "N/m^2", "N s/m^2")


for law_name, example in EXAMPLES.items():
    EFFECTS[f"friction, {law_name}"] = Effect(
        on=lambda params, law=example: attrs.evolve(params, friction=law),
        tiny=lambda params, law=example: attrs.evolve(params, friction=faint(law)),
        zero=lambda params: attrs.evolve(params, friction=None),
        state=1 + example.n_states,  # and the slip
        bytes=True,
        outputs=frozenset(
            name for name, _, size, *_ in _core.OUTPUTS if size in ("FRICTION", "SLIPS")
        ),
    )
