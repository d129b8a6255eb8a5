"""Squeal: friction makes vibrations of a belt on its contact grow, which are hardly damped there.

Where belt lies deeper it is pressed more, so that friction pulls it along, and along a curved way
that presses it again (MODEL section 11.11). Meshes that move have these vibrations. An ALE belt
lies as deep as its forces ask for at once, and has none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from ..base.checks import Array
from ..drive.params import Params
from .averages import durations

#: By how many powers of e a vibration has to have grown: where it is less than one, what made it
#: grow is over before anything has come of it.
GROWN = 1.0
#: What a coefficient of friction counts for: belt that vibrates so far that it leaves its contact
#: is held by it less. Links, 960 of them, squeal from 0.89 of the coefficient on from which small
#: vibrations grow.
SOONER = 1.15
#: Wave numbers, over that of a stretch wave as fast as the belt vibrates on its contact; waves grow
#: fastest at 0.7 to 2 times that. And how many coefficients growth is interpolated between.
WAVES, COEFFICIENTS = np.geomspace(0.3, 10.0, 40), 16
#: Damping of the contact, over critical, above which nothing rings on it: what vibrates falls to a
#: fifth in a period.
RINGS = 0.25


class Contact(NamedTuple):
    """A belt on a pulley, in numbers that have no unit but its frequency."""

    damping: float  # of the contact, over critical
    stretch: float  # EA / (c R^2), c its stiffness
    stretch_damping: float  # eta omega / E
    omega: float  # frequency of the contact [rad/s]


class Squeal(NamedTuple):
    """Vibrations that grow on a pulley."""

    pulley: int
    first: int  # sample from which on they grow
    coefficient: float  # largest root mean square of that of friction on its wrap [1]
    time: float  # in which they grow by e then [s]
    frequency: float  # [Hz]
    damping: float  # of the contact, over critical [1]
    needed: float  # damping with which none would grow [N s/m^2]


def growth(contact: Contact, coefficient: Array) -> Array:
    """Return the rate at which the fastest vibration grows over omega, by friction coefficients.

    The roots of MODEL section 11.11 in units of omega and c, p for s^2 + 2 D s + 1, e for 1 + h s:
    s^2 p (p + a e) + a z^2/4 e (1 + 2 D s)^2 + k^2 e p^2 = 0.
    """
    multiply = polynomial.polymul
    D, a, h, _ = contact
    p, e, through = [1.0, 2.0 * D, 1.0], [1.0, h], [1.0, 2.0 * D]
    inert = multiply([0.0, 0.0, 1.0], multiply(p, polynomial.polyadd(p, np.multiply(a, e))))
    stretched, rubbed = (multiply(e, multiply(one, one)) for one in (p, through))
    of = np.zeros((len(coefficient), WAVES.size, 7))
    of[..., : inert.size] += inert
    of[..., : stretched.size] += WAVES[:, None] ** 2 * stretched
    of[..., : rubbed.size] += 0.25 * a * np.square(coefficient)[:, None, None] * rubbed
    companion = np.zeros((*of.shape[:2], 6, 6))
    companion[..., range(1, 6), range(5)] = 1.0
    companion[..., :, 5] = -of[..., :6] / of[..., 6:]
    return np.asarray(np.linalg.eigvals(companion).real.max(axis=(1, 2)))


def least_damping(contact: Contact, coefficient: float) -> float:
    """Return the damping of the contact over critical with which no vibration grows, or rings."""
    low, high = 0.0, RINGS
    for _ in range(10):
        middle = 0.5 * (low + high)
        grows = growth(contact._replace(damping=middle), np.array([coefficient]))[0] > 0.0
        low, high = (middle, high) if grows else (low, middle)
    return high


def _on(params: Params, pulley: int) -> Contact:
    belt, at, radius = params.belt, params.effective_contact, params.pulleys[pulley].radius
    assert at.linear is not None and at.damping is not None
    pressure = float(params.info["strain_tension"]) / radius
    stiffness = math.sqrt(at.linear**2 + 4.0 * at.quadratic * pressure)
    omega = math.sqrt(stiffness / belt.linear_density)
    damping = at.damping + at.hunt_crossley * pressure
    return Contact(
        damping=damping / (2.0 * belt.linear_density * omega),
        stretch=belt.axial_stiffness / (stiffness * radius**2),
        stretch_damping=belt.axial_damping * omega / belt.axial_stiffness,
        omega=omega,
    )


def squeals(params: Params, t: Array, pulley: NDArray[np.int32], mu: Array) -> Iterator[Squeal]:
    """Find pulleys on which vibrations grow by e or more in the course of a run."""
    lasts, density = durations(t), params.belt.linear_density
    for k in range(len(params.pulleys)):
        contact, on = _on(params, k), pulley == k
        square = np.sum(np.where(on, mu, 0.0) ** 2, axis=1)
        used = SOONER * np.sqrt(square / np.maximum(1, on.sum(axis=1)))
        most = float(np.max(used))
        if contact.damping > RINGS or not 0.0 < most < math.inf:
            continue
        if not growth(contact, np.array([most]))[0] > 0.0:
            continue
        some = np.linspace(0.0, most, COEFFICIENTS)
        rate = contact.omega * np.interp(used, some, growth(contact, some))
        grown, powers = 0.0, np.zeros(t.size)
        for n, more in enumerate((rate * lasts).tolist()):
            grown = powers[n] = max(0.0, grown + more)
        if powers.max() > GROWN:
            yield Squeal(
                pulley=k,
                first=int(np.argmax(powers > GROWN)),
                coefficient=most / SOONER,
                time=1.0 / float(rate.max()),
                frequency=contact.omega / (2.0 * math.pi),
                damping=contact.damping,
                needed=least_damping(contact, most) * 2.0 * density * contact.omega,
            )
