"""The belt of point masses of MODEL.md section 2, "String", plain NumPy, from that page alone.

What contact, friction, pulleys and mounts are made of is that of `reference.py`: this file says
where the masses are, what the bars between them do, and which mass the ends of a bar belong to.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from reference import Array, Reference
from reference_line import spans_away


@dataclass(frozen=True)
class String(Reference):
    """A drive whose belt is a closed ring of masses m, joined by bars that stretch.

    "Link" i of the base class is mass i: its state is x, y and their rates. Joint i is the bar
    between mass i - 1 and mass i. Contact is integrated along the bars: of the bar behind mass i
    the left end is mass i, the right end mass i + 1.
    """

    freedoms: ClassVar[int] = 2

    def __post_init__(self) -> None:
        if self.bending_stiffness or self.bending_damping or self.mesh != "joint":
            raise ValueError("a string does not bend, and touches along its bars")
        super().__post_init__()
        # chords as long as under the preload stand for arcs as long
        half_angle = 0.5 * self.l0 / self.radii
        stretched = half_angle * self.stretch()
        more = stretched / np.sin(stretched) - half_angle / np.sin(half_angle)
        object.__setattr__(self, "contact_radii", self.contact_radii + self.radii * more)

    def stretch(self) -> float:
        """1 + epsilon of the belt line where mounts rest; 1 where no belt lies on one: round one
        pulley, or pulleys that overlap; slack, or stretched by more than a quarter.
        """
        places = self.centers.copy()
        for (j, one), q in zip(self.mounts.items(), self.rest, strict=True):
            places[j] = one.place(q, self.centers[j])
        apart = np.hypot(*(places[:, None] - places).T) + 1e300 * np.eye(self.n_pulleys)
        if self.n_pulleys < 2 or np.any(apart < self.radii[:, None] + self.radii):
            return 1.0
        stretched = spans_away(places, self.radii, self.sides)[0] / self.length
        return stretched if 1.0 < stretched <= 1.25 else 1.0

    def bars(self, links: Array) -> tuple[Array, Array, Array, Array]:
        """Length, unit vector (..., 2, n_b) and rate of length of the bar before each mass, and how
        fast it turns.
        """
        position, velocity = links[..., 0, :, :], links[..., 1, :, :]
        d = position - position.take(self.previous, axis=-1)
        v = velocity - velocity.take(self.previous, axis=-1)
        length = np.sqrt(d[..., 0, :] ** 2 + d[..., 1, :] ** 2)
        u = d / length[..., None, :]
        rate = u[..., 0, :] * v[..., 0, :] + u[..., 1, :] * v[..., 1, :]
        turning = (u[..., 0, :] * v[..., 1, :] - u[..., 1, :] * v[..., 0, :]) / length
        return length, u, rate, turning

    def _pull(self, links: Array, forces: Array) -> tuple[Array, Array, float]:
        length, u, rate, _ = self.bars(links)
        tension = self.c_tra * (length - self.l0) + self.b_tra * rate
        pull = tension * u
        forces += pull.take(self.following, axis=1) - pull
        right = links.take(self.following, axis=2)
        return links, right, float(self.b_tra * np.vdot(rate, rate))

    def _push(self, arm: Array, at_left: Array, at_right: Array, forces: Array) -> None:
        forces += at_left + at_right.take(self.previous, axis=1)

    def ends(self, y: Array) -> tuple[Array, Array]:
        links = self.links(y)
        return links, links.take(self.following, axis=-1)

    def directions(self, y: Array) -> Array:
        """Unit vectors of the bars behind the masses, (..., 2, n_b)."""
        return self.bars(self.links(y))[1].take(self.following, axis=-1)

    def angles(self, y: Array) -> tuple[Array, Array]:
        """Direction of the bar behind each mass, continuous along the belt, and its rate."""
        e = self.directions(y)
        phi = np.unwrap(np.arctan2(e[..., 1, :], e[..., 0, :]), axis=-1)
        return phi, self.bars(self.links(y))[3].take(self.following, axis=-1)

    def joint_vectors(self, y: Array) -> tuple[Array, Array]:
        """Along the bars: their stretch and the rate of it, all that spring and damper see."""
        length, u, rate, _ = self.bars(self.links(y))
        return (length - self.l0)[..., None, :] * u, rate[..., None, :] * u

    def joint_angles(self, y: Array) -> tuple[Array, Array]:
        """Nothing that any force knows of."""
        none = np.zeros(self.links(y)[..., 0, 0, :].shape)
        return none, none

    def joints(self, y: Array) -> tuple[Array, Array]:
        length, _, rate, _ = self.bars(self.links(y))
        return length - self.l0, self.c_tra * (length - self.l0) + self.b_tra * rate


def as_string(model: Reference, **changes: Any) -> String:
    """The same drive with a string for its belt, which loses its bending."""
    given = {one.name: getattr(model, one.name) for one in dataclasses.fields(model) if one.init}
    given |= {"bending_stiffness": 0.0, "bending_damping": 0.0, "mesh": "joint"}
    return String(**(given | changes))
