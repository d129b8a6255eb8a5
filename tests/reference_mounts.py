"""Mounts of MODEL.md section 5 (arm, slider, path), plain NumPy, written from that page alone.

A mount gives the place of a pulley's axis as a function of one coordinate q, and what acts on q
besides the belt: spring, damper, friction, stops. Places are arrays (..., 2) for q of shape (...).
Torques of an arm, forces of a slider, positive in the sense of q. The path's spline is SciPy's.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.interpolate
import scipy.optimize
from reference_friction import Array

GRAVITY = 9.80665
"""Pull of a hung weight [N/kg], whatever the scene's gravity."""

HOLD = 50.0
"""Stiffness of stops not given, over what the belt holds the mount with, 4 EA |a|^2 / L."""

MOUNT_LEDGER = ("mount_loss", "path_work")
"""The quadratures that a drive with mounts has in addition."""


def _pairs(x: Array, y: Array) -> Array:
    """Put x and y side by side on a last axis; `numpy.stack` takes three times as long."""
    out = np.empty((*np.shape(x), 2))
    out[..., 0], out[..., 1] = x, y
    return out


@dataclass(frozen=True, kw_only=True)
class Sprung:
    """Spring, damper, Dahl friction and stops of an arm or a slider. None: chosen by `resolved`."""

    stiffness: float = 0.0  # k
    preload: float = 0.0  # S_0 of the spring
    damping: float = 0.0  # d
    friction: float = 0.0  # F_m
    friction_stiffness: float | None = None  # kappa
    stops: tuple[float, float] | None = None  # q_lo, q_hi
    stop_stiffness: float | None = None  # k_s
    stop_damping: float | None = None  # d_s

    @property
    def moved(self) -> float:
        """J."""
        raise NotImplementedError

    @property
    def weighs(self) -> float:
        """Mass on the axis on which gravity acts, m_j."""
        raise NotImplementedError

    @property
    def pull(self) -> float:
        """S_0."""
        return self.preload

    @property
    def carries_bearing(self) -> bool:
        """Whether the drag of the pulley acts between it and the mount."""
        raise NotImplementedError

    def lever(self, q: npt.ArrayLike, center: Array) -> Array:
        """a = dc/dq."""
        raise NotImplementedError

    def near(self, center: Array, radius: float) -> float:
        """Travel within which friction is reached where its stiffness is not given."""
        raise NotImplementedError

    def resolved(
        self, center: Array, radius: float, axial_stiffness: float, length: float
    ) -> Sprung:
        """With numbers in place of what is chosen; what is given stays."""
        a = self.lever(0.0, center)
        chosen: dict[str, Any] = {}
        if self.friction_stiffness is None:
            chosen["friction_stiffness"] = self.friction / self.near(center, radius)
        damping = 0.0  # of stops whose stiffness is given
        if self.stop_stiffness is None:
            stiffness = HOLD * 4.0 * axial_stiffness * float(a @ a) / length
            chosen["stop_stiffness"] = stiffness
            damping = math.sqrt(stiffness * self.moved)
        if self.stop_damping is None:
            chosen["stop_damping"] = damping
        return dataclasses.replace(self, **chosen)

    def spring(self, q: Array) -> Array:
        return self.pull - self.stiffness * q

    def damper(self, rate: Array) -> Array:
        return -self.damping * rate

    def share_rate(self, rate: Array, share: Array) -> Array:
        """d zeta/dt."""
        if self.friction == 0.0:
            return np.zeros_like(share)
        assert self.friction_stiffness is not None
        return self.friction_stiffness / self.friction * (rate - np.abs(rate) * share)

    def stop_depths(self, q: Array) -> Array:
        """How deep q is in the lower and in the upper stop (..., 2); negative outside."""
        low, high = (-math.inf, math.inf) if self.stops is None else self.stops
        return np.stack((low - np.asarray(q), np.asarray(q) - high), axis=-1)

    def _pressed(
        self, q: Array, rate: Array, held: Array | None
    ) -> list[tuple[float, Array, Array, Array]]:
        """Both stops: the sign of the force, dp/dt, force of spring and of spring and damper."""
        if self.stops is None:
            return []
        assert self.stop_stiffness is not None and self.stop_damping is not None
        found: list[tuple[float, Array, Array, Array]] = []
        for side, sign in enumerate((1.0, -1.0)):
            depth = self.stop_depths(q)[..., side]
            on = depth > 0.0 if held is None else held[..., side]
            deeper = -sign * rate
            force = np.maximum(self.stop_stiffness * depth + self.stop_damping * deeper, 0.0)
            elastic = self.stop_stiffness * depth
            found.append((sign, deeper, np.where(on, elastic, 0.0), np.where(on, force, 0.0)))
        return found

    def stop(self, q: Array, rate: Array, held: Array | None = None) -> Array:
        """H."""
        total = np.zeros(np.shape(q))
        for sign, _, _, force in self._pressed(q, rate, held):
            total = total + sign * force
        return total

    def stored(self, q: Array) -> Array:
        """Energy of spring, hung weight and stops."""
        energy = 0.5 * self.stiffness * q**2 - self.pull * q
        if self.stops is not None:
            assert self.stop_stiffness is not None
            depths = np.maximum(self.stop_depths(q), 0.0)
            energy = energy + 0.5 * self.stop_stiffness * (depths**2).sum(axis=-1)
        return np.asarray(energy)

    def lost(self, q: Array, rate: Array, share: Array, held: Array | None = None) -> Array:
        """Power that damper, friction and stops take."""
        power = self.damping * rate**2 + self.friction * share * rate
        for _, deeper, elastic, force in self._pressed(q, rate, held):
            power = power + (force - elastic) * deeper
        return np.asarray(power)


@dataclass(frozen=True, kw_only=True)
class Arm(Sprung):
    """q is the angle of the arm, counter-clockwise [rad], 0 as the drive is drawn."""

    pivot: tuple[float, float]  # [m]
    inertia: float  # about the pivot, the pulley's mass included [kg m^2]
    mass: float = 0.0  # on the axis [kg]

    @property
    def moved(self) -> float:
        return self.inertia

    @property
    def weighs(self) -> float:
        return self.mass

    @property
    def carries_bearing(self) -> bool:
        return True

    def near(self, center: Array, radius: float) -> float:
        return 0.01

    def _arm(self, q: npt.ArrayLike, center: Array) -> Array:
        x, y = np.asarray(center) - np.asarray(self.pivot)
        c, s = np.cos(q), np.sin(q)
        return _pairs(c * x - s * y, s * x + c * y)

    def place(self, q: npt.ArrayLike, center: Array) -> Array:
        return np.asarray(self.pivot) + self._arm(q, center)

    def lever(self, q: npt.ArrayLike, center: Array) -> Array:
        arm = self._arm(q, center)
        return _pairs(-arm[..., 1], arm[..., 0])


@dataclass(frozen=True, kw_only=True)
class Slider(Sprung):
    """q is the travel along the direction [m]."""

    direction: tuple[float, float]  # of any length
    mass: float  # of carriage and pulley [kg]
    weight: float = 0.0  # hung on it [kg]

    @property
    def moved(self) -> float:
        return self.mass + self.weight

    @property
    def weighs(self) -> float:
        return self.mass

    @property
    def pull(self) -> float:
        return self.preload + self.weight * GRAVITY

    @property
    def carries_bearing(self) -> bool:
        return False

    def near(self, center: Array, radius: float) -> float:
        return 0.01 * radius

    @property
    def _unit(self) -> Array:
        return np.asarray(self.direction) / math.hypot(*self.direction)

    def place(self, q: npt.ArrayLike, center: Array) -> Array:
        return np.asarray(center) + np.multiply.outer(np.asarray(q, dtype=float), self._unit)

    def lever(self, q: npt.ArrayLike, center: Array) -> Array:
        return np.broadcast_to(self._unit, (*np.shape(q), 2))


@dataclass(frozen=True, kw_only=True)
class Path:
    """q is the time [s]; the displacement from the drawn place is a clamped cubic spline."""

    t: Sequence[float]
    displacement: npt.ArrayLike  # (n_t, 2) [m], the first (0, 0)
    spline: Callable[..., Any] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        t, d = np.asarray(self.t, dtype=float), np.asarray(self.displacement, dtype=float)
        made = scipy.interpolate.CubicSpline(t, d, bc_type="clamped")
        object.__setattr__(self, "spline", made)

    def resolved(self, *_: Any) -> Path:
        return self

    def place(self, q: npt.ArrayLike, center: Array) -> Array:
        return np.asarray(np.asarray(center) + self.spline(np.clip(q, self.t[0], self.t[-1])))

    def lever(self, q: npt.ArrayLike, center: Array) -> Array:
        inside = (np.asarray(q) >= self.t[0]) & (np.asarray(q) <= self.t[-1])
        slope = self.spline(np.clip(q, self.t[0], self.t[-1]), 1)
        return np.asarray(np.where(inside[..., None], slope, 0.0))


Mount = Arm | Slider | Path


def rest_of(
    mounts: Sequence[tuple[int, Mount]],
    centers: Array,
    line: Callable[[Array], tuple[float, Array]],
    axial_stiffness: float,
    length: float,
    gravity: Array,
) -> Array:
    """Travel of every mount where the tension of the belt line is in balance with the mounts."""
    sprung = [(m, j, one) for m, (j, one) in enumerate(mounts) if isinstance(one, Sprung)]
    at = np.array([0.0 if isinstance(one, Sprung) else one.t[0] for _, one in mounts])
    if not sprung:
        return at

    def out_of_balance(q: Array) -> Array:
        places = centers.copy()
        for (_, j, one), travel in zip(sprung, q, strict=True):
            places[j] = one.place(travel, centers[j])
        tension, spans = line(places)
        left = []
        for (_, j, one), travel in zip(sprung, q, strict=True):
            a = one.lever(travel, centers[j])
            drawn = one.spring(travel) + one.stop(travel, np.float64(0.0))
            left.append(drawn + one.weighs * gravity @ a + tension * a @ spans[j].sum(axis=0))
        return np.array(left)

    # in units of the belt's own stiffness against the mount, and of what stretches it by 1e-3
    levers = np.array([float(np.linalg.norm(one.lever(0.0, centers[j]))) for _, j, one in sprung])
    unit = 1e-3 * length / levers
    scale = axial_stiffness * 1e-3 * levers

    def residual(u: Array) -> Array:
        return out_of_balance(u * unit) / scale

    found = scipy.optimize.root(residual, np.zeros(len(sprung)), method="hybr", tol=1e-13)
    u = np.asarray(found.x)
    best = float(np.abs(residual(u)).max())
    for _ in range(8):  # Newton, down to rounding
        h = 1e-4
        slopes = [(residual(u + h * e) - residual(u - h * e)) / (2 * h) for e in np.eye(len(u))]
        nearer = u - np.linalg.solve(np.column_stack(slopes), residual(u))
        left = float(np.abs(residual(nearer)).max())
        if not left < best:
            break
        u, best = nearer, left
    if not best < 1e-9:
        raise ValueError("mounts find no place of rest")
    at[[m for m, _, _ in sprung]] = u * unit
    return at
