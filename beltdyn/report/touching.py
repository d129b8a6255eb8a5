"""Where belt and pulleys touch, at the samples: radii, strains, slip and forces of the places."""

from __future__ import annotations

import math

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..drive.compliance import running_radius
from ..drive.span import Span
from ..outputs.arcs import contact_points
from ..outputs.gross_slip import GrossSlip, gross_slip
from .window import Window, missing

__all__ = ["NEEDED", "Touching", "touching"]

#: Links that must pass in a window for a mean over the time of one to tell the mesh from the drive.
PASSINGS = 10.0
#: Of the length of a link: a belt that moves by less stands still.
STILL = 0.1
#: The outputs that it is read off from.
NEEDED = (
    "belt.x",
    "belt.y",
    "belt.phi",
    "belt.vx",
    "belt.vy",
    "belt.flow",
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
            off it, the middle of a link of the paper's mesh within it. Of cells the same.
        stretch: Length of the belt over its stress-free length there, lambda [1].
        tension: Force of the belt there [N].
        normal: Normal force [N].
        friction: Friction on the belt against the counter-clockwise tangent [N].
        velocity: Slip velocity, counter-clockwise, of belt on the arc of ``running`` [m/s].
        speed: Stress-free length of belt that passes in a second, in the order of the links, mean
            of the window [m/s].
        speeds: The same at the samples (n_w,) [m/s].
        torques: Torques of the belt on the pulleys, counter-clockwise (n_w, n_p) [N m].
        gross: Where pulleys slip over their whole wrap; None: nowhere.
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
    speeds: Array
    torques: Array
    gross: GrossSlip | None

    def passing(self, window: Window) -> float:
        """Return the time over which histories are averaged to remove the ripple of links [s].

        That in which a link passes, or as many links as the samples need to have four of them; 0
        where so few pass that no mean can tell them apart, and of cells, which do not.
        """
        if window.params._belt_facts["flows"]:
            return 0.0
        speed, length = self._speed(window), float(window.params.info["link_length"])
        if not speed * window.lasts > PASSINGS * length:
            return 0.0
        one = length / speed
        return one * max(1.0, math.ceil(4.0 * window.lasts / (window.t.size - 1) / one))

    def _speed(self, window: Window) -> float:
        return float(window.mean(np.abs(self.speeds)))

    def belt(self, window: Window) -> Span:
        """Return the belt as it runs in the mean: its speed, tension, centrifugal tension."""
        belt = window.params.belt
        stretch = float(window.mean(self.stretch.mean(axis=1)))
        return Span(belt, belt.axial_stiffness * (stretch - 1.0), self.speed)

    def stands(self, window: Window, least: float) -> bool:
        """Return whether the belt is slower than this [m/s], or moves by a small part of a link."""
        speed, length = self._speed(window), float(window.params.info["link_length"])
        return not (speed > least and speed * window.lasts > STILL * length)

    def reverses(self, window: Window) -> bool:
        """Return whether the belt's speed changes by more than its mean: no mean state exists."""
        smooth = window.smoothed(self.speeds[:, None], self.passing(window))
        change = float(np.nanmax(smooth) - np.nanmin(smooth))
        return change > max(abs(self.speed), float(window.params.info["drag_speed"]))


def touching(window: Window) -> Touching | None:
    """Read contact and friction off a run; None if its outputs lack them."""
    run, params = window.run, window.params
    if missing(run, NEEDED):
        return None
    l0, facts = float(params.info["link_length"]), params._belt_facts
    force, touched = window.of(run.joints.force), window.of(run.contact.pulley)
    at = contact_points(params, run.belt, window.rows)
    x, y = at[..., 0], at[..., 1]
    if facts["flows"]:
        stretch = Span(params.belt, force).stretch
    else:
        deformation = window.of(run.joints.deformation)
        if not facts["at_joints"]:  # friction acts between the joints, or bars, on both sides
            force = 0.5 * (force + np.roll(force, -1, axis=1))
            deformation = 0.5 * (deformation + np.roll(deformation, -1, axis=1))
        stretch = 1.0 + deformation / l0
    centers = window.centers
    rows = np.arange(x.shape[0])[:, None]
    axis = centers[rows, np.maximum(touched, 0)]
    dx, dy = x - axis[..., 0], y - axis[..., 1]
    radius = np.hypot(dx, dy)
    normal, friction = window.of(run.contact.normal), window.of(run.contact.friction)
    speed, speeds = _speed(window, touched, stretch)
    if facts["flows"]:
        radii = params._radii[touched]
        running = running_radius(params, radii, force, speeds[:, None])
        dx, dy, radius, chord = dx * running / radius, dy * running / radius, running, np.ones(1)
    else:
        chord = _chord(0.5 * l0 / radius, stretch, facts)
    n_p = len(params.pulleys)
    sums = [np.sum(np.where(touched == k, friction * radius, 0.0), axis=1) for k in range(n_p)]
    gross = None
    if params.has_friction:
        gross = gross_slip(
            params, window.t, touched, normal, friction, window.of(run.contact.velocity)
        )
    return Touching(
        pulley=touched,
        x=dx,
        y=dy,
        radius=radius,
        running=radius * chord,
        stretch=stretch,
        tension=force,
        normal=normal,
        friction=friction,
        velocity=window.of(run.contact.velocity) * chord,
        speed=speed,
        speeds=speeds,
        torques=np.column_stack(sums),
        gross=gross,
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


def _speed(window: Window, touched: NDArray[np.int32], stretch: Array) -> tuple[float, Array]:
    """Return the stress-free length of belt that passes in a second, from the free links [m/s].

    Their speed along themselves: what they have across is swing of the spans. Mean, and (n_w,).
    """
    belt = window.run.belt
    if window.params._belt_facts["flows"]:
        speeds = window.of(belt.flow)
        return float(window.mean(speeds)), speeds
    vx, vy, phi = window.of(belt.vx), window.of(belt.vy), window.of(belt.phi)
    free = touched < 0
    if not free.any():
        free = np.ones_like(free)
    along = vx * np.cos(phi) + vy * np.sin(phi)
    moved = np.where(free, along, 0.0).sum(axis=1)
    length = np.where(free, stretch, 0.0).sum(axis=1)
    mean = float(window.mean(moved) / window.mean(length))
    return mean, np.divide(moved, length, out=np.full_like(moved, mean), where=length > 0.0)
