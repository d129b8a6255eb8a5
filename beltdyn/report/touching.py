"""Where belt and pulleys touch, at the samples: radii, stretch, slip and forces of the places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..drive.compliance import running_radius
from ..drive.span import Span
from ..outputs.arcs import contact_points, per_pulley
from ..outputs.averages import mean_over
from ..outputs.gross_slip import gross_slip
from ..outputs.sampled import Sampled
from ..outputs.selection import named

#: The outputs that it is read off from.
NEEDED = named(
    belt="x y phi vx vy flow",
    joints="deformation force",
    contact="pulley normal friction velocity",
)


class Touching:
    """Contact and friction of a window where they act (MODEL sections 3, 4), each (n_w, n_b)."""

    def __init__(self, run: Sampled, rows: slice, weights: Array, centers: Array) -> None:
        params, contact = run.params, run.contact
        facts, l0, n_p = params._belt_facts, float(params.info["link_length"]), len(params.pulleys)
        force = run.joints.force[rows]
        self.pulley = contact.pulley[rows]  # touched there, -1: none
        self.normal = contact.normal[rows]  # force [N]
        #: On the belt against the counter-clockwise tangent [N].
        self.friction = contact.friction[rows]
        if facts["flows"]:
            stretch = Span(params.belt, force).stretch
        else:
            deformation = run.joints.deformation[rows]
            if not facts["at_joints"]:  # friction acts between the joints, or bars, on both sides
                deformation = 0.5 * (deformation + np.roll(deformation, -1, axis=1))
            stretch = 1.0 + deformation / l0
        #: Length of the belt over its stress-free length there, lambda [1].
        self.stretch = stretch
        #: Stress-free length that passes in a second [m/s]: mean of the window, and at the samples
        #: (n_w,), in the order of the links.
        self.speed, self.speeds = _speed(run, rows, weights, self.pulley, stretch)
        if facts["flows"]:
            radius = running_radius(params, params._radii[self.pulley], force, self.speeds[:, None])
            chord = np.ones(1)
        else:
            axis = centers[np.arange(len(force))[:, None], np.maximum(self.pulley, 0)]
            radius = np.hypot(*np.moveaxis(contact_points(params, run.belt, rows) - axis, -1, 0))
            chord = _chord(0.5 * l0 / radius, stretch, facts)
        #: Radius of the arc that the polygon of links stands for there [m]: a joint stands off it,
        #: the middle of a link of the paper's mesh within it.
        self.running = radius * chord
        #: Slip, counter-clockwise, of belt on the arc of ``running`` [m/s].
        self.velocity = contact.velocity[rows] * chord
        #: Of the belt on the pulleys, counter-clockwise (n_w, n_p) [N m].
        self.torques = per_pulley(self.friction * radius, self.pulley, n_p)
        #: Where pulleys slip over their whole wrap; None: nowhere.
        self.gross = gross_slip(
            params,
            run.t[rows],
            self.pulley,
            self.normal,
            self.friction,
            contact.velocity[rows],
        )


def _chord(half: Array, stretch: Array, facts: _core.BeltFacts) -> Array:
    """Return the radius of the arc that a polygon stands for, over that of its places.

    A pitch of belt, of the length l0 lambda, takes up an angle; that length over this angle is the
    radius. Bars of a string stretch along their chord. Links do not, half = l0 / (2 radius) is half
    of their angle but for its curve, and the gaps between them lie along the circle.
    """
    if facts["stretches"]:
        chord = np.clip(half * stretch, 0.0, 1.0)
        return np.asarray(chord / np.arcsin(chord))
    angle = np.arctan(half) if facts["tangents"] else np.arcsin(np.clip(half, 0.0, 1.0))
    return np.asarray(stretch * half / (angle + (stretch - 1.0) * half))


def _speed(
    run: Sampled, rows: slice, weights: Array, touched: NDArray[np.int32], stretch: Array
) -> tuple[float, Array]:
    """Return the stress-free length that passes in a second [m/s]: mean, and at the samples."""
    belt = run.belt
    if run.params._belt_facts["flows"]:
        speeds = belt.flow[rows]
        return float(mean_over(weights, speeds)), speeds
    phi = belt.phi[rows]
    free = touched < 0
    if not free.any():
        free = np.ones_like(free)
    # along themselves: what they have across is swing of the spans
    along = belt.vx[rows] * np.cos(phi) + belt.vy[rows] * np.sin(phi)
    moved = np.where(free, along, 0.0).sum(axis=1)
    length = np.where(free, stretch, 0.0).sum(axis=1)
    mean = float(mean_over(weights, moved) / mean_over(weights, length))
    return mean, np.divide(moved, length, out=np.full_like(moved, mean), where=length > 0.0)
