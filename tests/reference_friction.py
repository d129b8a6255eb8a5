"""The friction laws of MODEL.md section 4, plain NumPy, written from that page alone.

A law gives the friction force F(z, v, N) and the rate G(z, v, N) of its state z from that state,
the slip velocity v and the normal force N of one link each, arrays of any shape. `l0` is the length
of a link, for the laws whose coefficients are per metre of belt. A law of several states has them
on the last but one axis of z, (..., n_states, n).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Law(Protocol):
    """What `reference.Reference` asks of a friction law."""

    @property
    def n_states(self) -> int:
        """Number of states; 1 also of a law that does not use it."""

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        """F [N]."""

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        """G, dz/dt."""

    @property
    def bound(self) -> float:
        """Bound of |z| that the law's own equations respect; inf if they give none."""

    def scale(self, pressure: float) -> float | Array:
        """Size of z at which friction is of the order of the normal force, `pressure` [N/m]; of
        several states (n_states, 1).
        """


def law_states(law: Law, z: Array, pulley: int) -> Array:
    """Of all states z (..., n_states, n_p, n_b), those of a law on a pulley as it takes them."""
    return (
        z[..., 0, pulley, :]
        if law.n_states == 1 and not isinstance(law, MaxwellSlip)
        else (z[..., : law.n_states, pulley, :])
    )


def stribeck(kinetic: float, static: float, v_stribeck: float, v: Array) -> Array:
    """Coefficient at slip velocity v, from static at 0 to kinetic; static 0: no such curve."""
    if static == 0.0:
        return np.full_like(v, kinetic)
    return kinetic + (static - kinetic) * np.exp(-((v / v_stribeck) ** 2))


@dataclass(frozen=True)
class Dahl:
    """The paper's law; z is the friction coefficient."""

    mu_k: float  # [1]
    sigma: float  # [1/m]
    mu_s: float = 0.0  # [1]
    v_stribeck: float = 0.0  # [m/s]
    n_states: ClassVar[int] = 1

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return z * normal

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        level = stribeck(self.mu_k, self.mu_s, self.v_stribeck, v)
        return self.sigma * (v - np.abs(v) * z / level)

    @property
    def bound(self) -> float:
        return max(self.mu_k, self.mu_s)

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
    n_states: ClassVar[int] = 1

    def level(self, v: Array) -> Array:
        """g(v), the coefficient towards which |z| goes in steady sliding."""
        return stribeck(self.mu_k, self.mu_s, self.v_stribeck, v)

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


class Stateless:
    """A law that is a function of slip velocity and normal force; its z is not used and stays 0."""

    n_states: ClassVar[int] = 1

    def coefficient(self, v: Array) -> Array:
        """F / N."""
        raise NotImplementedError

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return normal * self.coefficient(v)

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        return np.zeros_like(z)

    @property
    def bound(self) -> float:
        return 0.0

    def scale(self, pressure: float) -> float:
        return 1.0


@dataclass(frozen=True)
class Coulomb(Stateless):
    """Regularised by v / sqrt(v^2 + v_reg^2)."""

    mu: float  # [1]
    v_reg: float  # [m/s]
    mu_s: float = 0.0  # [1]
    v_stribeck: float = 0.0  # [m/s]

    def coefficient(self, v: Array) -> Array:
        level = stribeck(self.mu, self.mu_s, self.v_stribeck, v)
        return level * v / np.hypot(v, self.v_reg)


@dataclass(frozen=True)
class CreepRate(Stateless):
    """Leamy and Wasfy (2002): proportional to v up to v_critical, then constant."""

    mu: float  # [1]
    v_critical: float  # [m/s]

    def coefficient(self, v: Array) -> Array:
        return self.mu * np.clip(v / self.v_critical, -1.0, 1.0)


@dataclass(frozen=True)
class Threlfall(Stateless):
    """Threlfall (1978)."""

    mu: float  # [1]
    v_reg: float  # [m/s]

    def coefficient(self, v: Array) -> Array:
        return -self.mu * np.sign(v) * np.expm1(-3.0 * np.abs(v) / self.v_reg)


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
    mu_s: float = 0.0  # [1]
    v_stribeck: float = 0.0  # [m/s]
    n_states: ClassVar[int] = 1

    def limit(self, v: Array, normal: Array) -> Array:
        return stribeck(self.mu, self.mu_s, self.v_stribeck, v) * normal

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        limit = self.limit(v, normal)
        return np.clip((self.stiffness * z + self.damping * v) * l0, -limit, limit)

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        spring, limit = self.stiffness * l0 * z, self.limit(v, normal)
        c = self.damping * l0
        return np.clip(v, (-limit - spring) / c, (limit - spring) / c)

    @property
    def bound(self) -> float:
        return math.inf

    def scale(self, pressure: float) -> float:
        return pressure / self.stiffness


@dataclass(frozen=True)
class MaxwellSlip:
    """Elements of ElasticPlastic side by side; z (..., n_states, n) their stretches [m]."""

    mu: tuple[float, ...]  # [1]
    stiffness: tuple[float, ...]  # [N/m^2]
    damping: tuple[float, ...]  # [N s/m^2]
    mu_s: float = 0.0  # [1], of all together
    v_stribeck: float = 0.0  # [m/s]

    @property
    def n_states(self) -> int:
        return len(self.mu)

    @property
    def elements(self) -> list[ElasticPlastic]:
        share = self.mu_s / sum(self.mu)
        numbers = zip(self.mu, self.stiffness, self.damping, strict=True)
        return [ElasticPlastic(mu, k, c, share * mu, self.v_stribeck) for mu, k, c in numbers]

    def force(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        forces = [one.force(z[..., e, :], v, normal, l0) for e, one in enumerate(self.elements)]
        return np.sum(forces, axis=0)

    def rate(self, z: Array, v: Array, normal: Array, l0: float) -> Array:
        rates = [one.rate(z[..., e, :], v, normal, l0) for e, one in enumerate(self.elements)]
        return np.stack(rates, axis=-2)

    @property
    def bound(self) -> float:
        return math.inf

    def scale(self, pressure: float) -> Array:
        return np.array([[pressure / k] for k in self.stiffness])
