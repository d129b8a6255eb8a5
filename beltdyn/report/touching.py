"""Where belt and pulleys touch, at the samples: radii, strains, slip and forces of the places."""

from __future__ import annotations

import attrs
import numpy as np
from numpy.typing import NDArray

from ..checks import Array
from .window import Window, missing

__all__ = ["NEEDED", "Touching", "touching"]

#: The outputs that it is read off from.
NEEDED = (
    "belt.x",
    "belt.y",
    "belt.phi",
    "belt.vx",
    "belt.vy",
    "joints.deformation",
    "joints.force",
    "contact.pulley",
    "contact.normal",
    "contact.friction",
    "contact.velocity",
)


@attrs.frozen(eq=False, kw_only=True)
class Touching:
    """Contact and friction where they act (MODEL sections 3, 4), each (n_w, n_b).

    Attributes:
        pulley: The pulley touched there, -1 for none.
        x: Place where friction acts, from the axis of that pulley [m].
        y: The same.
        radius: Its distance from the axis [m].
        running: Radius of the arc that the polygon of links stands for there [m]: a joint stands
            off it, the middle of a link of the paper's mesh within it.
        stretch: Length of the belt over its stress-free length there, lambda [1].
        tension: Force of the belt there [N].
        normal: Normal force [N].
        friction: Friction on the belt against the counter-clockwise tangent [N].
        velocity: Slip velocity, counter-clockwise, of belt on the arc of ``running`` [m/s].
        speed: Stress-free length of belt that passes in a second, in the order of the links, mean
            of the window [m/s].
    """

    pulley: NDArray[np.int32]
    x: Array
    y: Array
    radius: Array
    running: Array
    stretch: Array
    tension: Array
    normal: Array
    friction: Array
    velocity: Array
    speed: float


def touching(window: Window) -> Touching | None:
    """Read it off a run; None if its outputs do not hold it."""
    run, params = window.run, window.params
    if missing(run, NEEDED):
        return None
    belt, l0 = run.belt, float(params.info["link_length"])
    x, y, phi = window.of(belt.x), window.of(belt.y), window.of(belt.phi)
    force, deformation = window.of(run.joints.force), window.of(run.joints.deformation)
    along_links = params.belt.mesh == "joint"
    string = params.belt_model == "string"
    if along_links and not string:
        tip_x, tip_y = 0.5 * l0 * np.cos(phi), 0.5 * l0 * np.sin(phi)
        x, y = (
            0.5 * (mid - tip + np.roll(mid + tip, 1, axis=1))
            for mid, tip in ((x, tip_x), (y, tip_y))
        )
    else:  # friction acts between the joints, or bars, on both sides
        force = 0.5 * (force + np.roll(force, -1, axis=1))
        deformation = 0.5 * (deformation + np.roll(deformation, -1, axis=1))
    stretch = 1.0 + deformation / l0
    touched = window.of(run.contact.pulley)
    centers = window.centers()
    rows = np.arange(x.shape[0])[:, None]
    axis = centers[rows, np.maximum(touched, 0)]
    dx, dy = x - axis[..., 0], y - axis[..., 1]
    radius = np.hypot(dx, dy)
    chord = _chord(0.5 * l0 / radius, stretch, along_links, string)
    return Touching(
        pulley=touched,
        x=dx,
        y=dy,
        radius=radius,
        running=radius * chord,
        stretch=stretch,
        tension=force,
        normal=window.of(run.contact.normal),
        friction=window.of(run.contact.friction),
        velocity=window.of(run.contact.velocity) * chord,
        speed=_speed(window, touched, stretch),
    )


def _chord(half: Array, stretch: Array, along_links: bool, string: bool) -> Array:
    """Give the radius of the arc that a polygon stands for, over that of its places.

    A pitch of belt, of the length l0 lambda, takes up an angle; that length over this angle is the
    radius. Bars of a string stretch along their chord. Links do not, half = l0 / (2 radius) is half
    of their angle but for its curve, and the gaps between them lie along the circle.
    """
    if string:
        chord = np.clip(half * stretch, 0.0, 1.0)
        return np.asarray(chord / np.arcsin(chord))
    angle = np.arcsin(np.clip(half, 0.0, 1.0)) if along_links else np.arctan(half)
    return np.asarray(stretch * half / (angle + (stretch - 1.0) * half))


def _speed(window: Window, touched: NDArray[np.int32], stretch: Array) -> float:
    """Give the stress-free length of belt that passes in a second, from the free links [m/s]."""
    belt = window.run.belt
    vx, vy, phi = window.of(belt.vx), window.of(belt.vy), window.of(belt.phi)
    free = touched < 0
    if not free.any():
        free = np.ones_like(free)
    along = vx * np.cos(phi) + vy * np.sin(phi)
    way = np.sign(np.sum(window.weights * np.mean(along, axis=1)))
    speeds = np.where(free, np.hypot(vx, vy), 0.0).sum(axis=1)
    return float(way * window.mean(speeds) / window.mean(np.where(free, stretch, 0.0).sum(axis=1)))
