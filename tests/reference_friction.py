"""The friction laws of MODEL.md section 4, plain NumPy, written from that page alone.

A law gives the friction force F(z, v, N) and the rate G(z, v, N) of its state z from that state,
the slip velocity v and the normal force N of one link each, arrays of any shape. `l0` is the length
of a link, for the laws whose coefficients are per metre of belt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Law(Protocol):
    """What `reference.Reference` asks of a friction law."""

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        """F [N]."""

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        """G, dz/dt."""

    @property
    def bound(self) -> float:
        """Bound of |z| that the law's own equations respect; inf if they give none."""

    def scale(self, pressure: float) -> float:
        """Size of z at which friction is of the order of the normal force, `pressure` [N/m]."""


@dataclass(frozen=True)
class Dahl:
    """The paper's law; z is the friction coefficient."""

    mu_k: float  # [1]
    sigma: float  # [1/m]

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return z * normal

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return self.sigma * (v - np.abs(v) * z / self.mu_k)

    @property
    def bound(self) -> float:
        return self.mu_k

    def scale(self, pressure: float) -> float:
        return 1.0


@dataclass(frozen=True)
class LuGre:
    """Canudas de Wit et al. (1995); z is the part of the coefficient that the bristles carry."""

    mu_k: float  # [1]
    mu_s: float  # [1]
    v_stribeck: float  # [m/s]
    sigma: float  # [1/m]
    damping: float  # d [s/m]
    viscous: float  # e [s/m]

    def level(self, v: Array) -> Array:
        """g(v), the coefficient towards which |z| goes in steady sliding."""
        ratio = v / self.v_stribeck
        return self.mu_k + (self.mu_s - self.mu_k) * np.exp(-ratio * ratio)

    def deflection_rate(self, z: Array, v: Array) -> Array:
        """h [m/s]."""
        return v - np.abs(v) * z / self.level(v)

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return normal * (z + self.damping * self.deflection_rate(z, v) + self.viscous * v)

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return self.sigma * self.deflection_rate(z, v)

    @property
    def bound(self) -> float:
        return self.mu_s

    def scale(self, pressure: float) -> float:
        return 1.0


@dataclass(frozen=True)
class ElasticPlastic:
    """Spring and damper side by side, in series with a slider; z is the stretch of the spring [m].

    The force is written as the spring and damper's while the link sticks, k z + c v, cut off at the
    slider's limit. That is k z + c G of MODEL.md, because cutting v off at the two rates at which
    the limit is reached and cutting the force off at the limit are the same, but it never exceeds
    the limit by rounding and is exactly 0 without a normal force.
    """

    mu: float  # [1]
    stiffness: float  # k' [N/m^2]
    damping: float  # c' [N s/m^2]

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        limit = self.mu * normal
        return np.clip((self.stiffness * z + self.damping * v) * l0, -limit, limit)

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        spring, limit = self.stiffness * l0 * z, self.mu * normal
        c = self.damping * l0
        return np.clip(v, (-limit - spring) / c, (limit - spring) / c)

    @property
    def bound(self) -> float:
        return math.inf

    def scale(self, pressure: float) -> float:
        return pressure / self.stiffness
