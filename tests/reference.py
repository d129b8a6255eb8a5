"""The independent oracle: MODEL.md of the belt drive in plain NumPy.

Written from MODEL.md (and the paper) alone. It shares no line with the C core and imports nothing
of beltdyn, so that agreement between the two means something. Section numbers are those of
MODEL.md; equation numbers are the paper's (K. Kubas, "A model for the dynamic analysis of a belt
transmission using the Dahl friction model"). SI units, angles in rad.

Differences from the core by intention: friction memory is kept densely, one state per (pulley,
link) pair, so a link on two pulleys at once needs no special treatment; the energy ledger is
integrated with the state. The friction laws are in `reference_friction.py`, mounts of pulleys in
`reference_mounts.py`, the belt of point masses in `reference_string.py`; `reference_run.py`
integrates the drive by SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from reference_friction import Array as Array
from reference_friction import Dahl, Law, Stateless, law_states
from reference_line import belt_line as belt_line
from reference_line import depth, spans_away, tension_at_rest
from reference_mounts import MOUNT_LEDGER, Arm, Mount, Sprung, rest_of

Torque = Callable[[float, Array, Array], npt.ArrayLike]
Motion = Callable[[float], tuple[float, float]]  # of t: speed Omega [rad/s], its rate [rad/s^2]

FRESH = 0.01
"""Share of a joint in contact from which on fresh belt dilutes its bristles in full (section 4)."""

GAUSS = np.array([0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)])[:, None, None]
"""Points of Gauss and Legendre on a link, or on the part of it in contact."""

LEDGER = ("drive", "joint_damping", "contact_damping", "friction", "drag")
"""The quadratures at the end of the state: work put in, then the losses (section 7)."""


@dataclass(frozen=True)
class Reference:
    """A belt drive by its data per metre of belt (section 6), with the equations of motion.

    The state vector is `x, y, phi, vx, vy, vphi` (n_b each), `theta, omega` (n_p each), friction
    states `mu` and `slip` (n_p x n_b each, pulley first), with `mounts` travel, its rate and the
    share of friction (n_m each), and the quadratures of `columns`. The travel of a path is the
    time. `centers` are the places in the scene, q = 0.

    `mu_k` and `sigma` are the short way to Dahl's law on all pulleys, `friction` gives a law, or
    none, to each. `motion` maps pulleys to their prescribed speeds, which `rhs` takes from there,
    and what knows no time (`contacts`, `energy`) from the state; `follow` makes them one. With
    `mesh="joint"` pairs are of (pulley, joint), a joint by the link on whose left it is.
    """

    freedoms: ClassVar[int] = 3  # coordinates of a link

    length: float  # L, stress-free [m]
    n_bodies: int  # n_b
    linear_density: float  # rho A [kg/m]
    axial_stiffness: float  # EA [N]
    axial_damping: float  # eta A [N s]
    bending_stiffness: float  # EI [N m^2]
    centers: Array  # (n_p, 2) [m]
    radii: Array  # (n_p,) [m]
    inertias: Array  # (n_p,) [kg m^2]
    contact: tuple[float, float, float]  # c1' [N/m^3], c2' [N/m^2], b' [N s/m^2]
    mu_k: float | None = None  # of Dahl's law on all pulleys
    sigma: float | None = None  # [1/m]
    friction: tuple[Law | None, ...] | None = None  # (n_p,); None: that of mu_k and sigma
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s^2]
    winding: int = -1  # turns of phi once round the ring; -1: numbered clockwise
    bending_damping: float = 0.0  # [N m^2 s]; none in the paper
    drag: Array | None = None  # (n_p, 3): Coulomb [N m], viscous [N m s], quadratic [N m s^2]
    motion: Mapping[int, Motion] = field(default_factory=dict)  # by pulley
    mesh: str = "paper"  # or "joint"
    sides: tuple[int, ...] | None = None  # of each pulley, +1 inside, -1 outside; None: all inside
    hunt_crossley: float = 0.0  # d of the contact [s/m]
    compensate: bool = False  # contact radii larger by the depth under the preload (section 3)
    mounts: Mapping[int, Mount] = field(default_factory=dict)  # by pulley

    n_pulleys: int = field(init=False)
    n_states: int = field(init=False)  # of friction, of every pair
    size: int = field(init=False)
    mounted: tuple[int, ...] = field(init=False)  # pulleys with a mount
    columns: tuple[str, ...] = field(init=False)  # names of the quadratures
    rest: Array = field(init=False, repr=False)  # travel of each mount where the belt line is meant
    laws: tuple[Law | None, ...] = field(init=False)
    ruled: Array = field(init=False, repr=False)  # (n_p, 1): whether the law has a state
    l0: float = field(init=False)
    mass: float = field(init=False)
    inertia: float = field(init=False)  # I_z of a link
    contact_radii: Array = field(init=False)  # on which the ends (centres) of unloaded links run
    omega_0: Array = field(init=False)  # within which Coulomb drag changes its sign (section 5)
    c_tra: float = field(init=False)
    b_tra: float = field(init=False)
    c_tor: float = field(init=False)
    b_tor: float = field(init=False)
    c1: float = field(init=False)
    c2: float = field(init=False)
    b: float = field(init=False)
    previous: npt.NDArray[np.intp] = field(init=False, repr=False)
    following: npt.NDArray[np.intp] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        centers = np.array(self.centers, dtype=float).reshape(-1, 2)
        n_p, n_b = len(centers), self.n_bodies
        if n_b < 3 or (self.mu_k is None) != (self.sigma is None):
            raise ValueError("needs n_bodies >= 3, and mu_k and sigma both or neither")
        if self.mesh not in ("paper", "joint"):
            raise ValueError(f"unknown mesh {self.mesh!r}")
        if self.friction is not None and (self.mu_k is not None or len(self.friction) != n_p):
            raise ValueError("friction needs a law or None for each pulley, and no mu_k")
        if not set(self.motion) <= set(range(n_p)):
            raise ValueError("motion of a pulley that is not there")
        if not set(self.mounts) <= set(range(n_p)) or (self.mounts and self.mesh != "joint"):
            raise ValueError("a mount needs its pulley, and contact along the links")
        laws = self.friction
        if laws is None:
            laws = (None,) * n_p
            if self.mu_k is not None and self.sigma is not None:
                laws = (Dahl(self.mu_k, self.sigma),) * n_p
        l0 = self.length / n_b
        mass = self.linear_density * l0
        radii = np.array(self.radii, dtype=float).reshape(n_p)
        half_angle = 0.5 * l0 / radii  # of a link on each pulley
        if self.mesh == "joint" and half_angle.max() >= 0.5 * math.pi:
            raise ValueError("a link is longer than half round a pulley")
        mounts = {
            j: one.resolved(centers[j], radii[j], self.axial_stiffness, self.length)
            for j, one in sorted(self.mounts.items())
        }
        columns = (*LEDGER, *MOUNT_LEDGER) if mounts else LEDGER
        n_states = max(1 if law is None else law.n_states for law in laws)
        derived: dict[str, Any] = {
            "mounts": mounts,
            "mounted": tuple(mounts),
            "columns": columns,
            "centers": centers,
            "radii": radii,
            "inertias": np.array(self.inertias, dtype=float).reshape(n_p),
            "n_pulleys": n_p,
            "n_states": n_states,
            "size": 2 * self.freedoms * n_b
            + 2 * n_p
            + (n_states + 1) * n_p * n_b
            + 3 * len(mounts)
            + len(columns),
            "laws": tuple(laws),
            "ruled": np.array([[not isinstance(law, Stateless | None)] for law in laws]),
            "l0": l0,
            "mass": mass,
            "inertia": mass * l0**2 / (4 if self.mesh == "joint" else 12),
            "contact_radii": radii
            * (half_angle / np.sin(half_angle) if self.mesh == "joint" else 1.0),
            "c_tra": self.axial_stiffness / l0,
            "b_tra": self.axial_damping / l0,
            "c_tor": self.bending_stiffness / l0,
            "b_tor": self.bending_damping / l0,
            "c1": self.contact[0] * l0,
            "c2": self.contact[1] * l0,
            "b": self.contact[2] * l0,
            "previous": np.arange(-1, n_b - 1) % n_b,
            "following": np.arange(1, n_b + 1) % n_b,
        }
        derived["omega_0"] = np.zeros(n_p)
        path = math.nan
        at_rest, derived["rest"] = centers, np.zeros(0)
        if mounts:
            derived["rest"] = rest_of(
                list(mounts.items()),
                centers,
                lambda places: self._line_at(places, radii),
                self.axial_stiffness,
                self.length,
                np.asarray(self.gravity, dtype=float),
            )
            at_rest = centers.copy()
            for (j, one), q in zip(mounts.items(), derived["rest"], strict=True):
                at_rest[j] = one.place(q, centers[j])
        if self.compensate or self.drag is not None:
            path = belt_line(at_rest, radii, self.length, n_b, self.sides)[-1]
        if self.compensate:
            strain = path / self.length - 1
            pressure = self.axial_stiffness * strain * (1 + strain) / radii
            depths = [depth(one, self.contact) for one in pressure]
            derived["contact_radii"] = derived["contact_radii"] + np.array(depths)
        if self.drag is not None:
            derived["drag"] = np.array(self.drag, dtype=float).reshape(n_p, 3)
            wave = math.sqrt(self.axial_stiffness / self.linear_density)
            derived["omega_0"] = 1e-3 * (path / self.length - 1) * wave / 60 / derived["radii"]
        for name, value in derived.items():
            object.__setattr__(self, name, value)

    def _line_at(self, places: Array, radii: Array) -> tuple[float, Array]:
        """Tension at rest of the belt line round pulleys at these places, and its spans."""
        path, _, spans = spans_away(places, radii, self.sides)
        strain = path / self.length - 1.0
        stiffness = self.axial_stiffness, self.bending_stiffness
        tension = self.axial_stiffness * strain
        if strain > 0.0:
            tension = tension_at_rest(
                places, radii, self.sides, self.length, stiffness, self.contact, self.compensate
            )
        return tension, spans

    def links(self, y: Array) -> Array:
        """View (..., 2, 3, n_b) of the links: [position or velocity, x y phi, link]."""
        shape = 2, self.freedoms, self.n_bodies
        return y[..., : math.prod(shape)].reshape(*y.shape[:-1], *shape)

    def pulleys(self, y: Array) -> Array:
        """View (..., 2, n_p): theta and omega."""
        start = 2 * self.freedoms * self.n_bodies
        return y[..., start : start + 2 * self.n_pulleys].reshape(*y.shape[:-1], 2, -1)

    def memory(self, y: Array) -> Array:
        """View (..., n_states + 1, n_p, n_b): states z (named mu) and, in the last row, slip of
        every (pulley, link) pair.
        """
        start = 2 * (self.freedoms * self.n_bodies + self.n_pulleys)
        stop = self.size - len(self.columns) - 3 * len(self.mounted)
        return y[..., start:stop].reshape(*y.shape[:-1], -1, self.n_pulleys, self.n_bodies)

    def mount_states(self, y: Array) -> Array:
        """View (..., 3, n_m): travel, its rate and the share of friction of every mount."""
        stop = self.size - len(self.columns)
        start = stop - 3 * len(self.mounted)
        return y[..., start:stop].reshape(*y.shape[:-1], 3, -1)

    def ledger(self, y: Array) -> Array:
        """View (..., 5), with mounts 7: the quadratures, in the order of `columns`."""
        return y[..., -len(self.columns) :]

    def pack(self, state: Mapping[str, Any]) -> Array:
        """State vector from a mapping with `x y phi vx vy vphi mu slip theta omega`, and of mounts
        `travel travel_speed mount_friction` (missing: at rest, a path at the time `t`).

        `mu` and `slip` may be (n_p, n_b), or (n_b,): then each value goes to the pulley its link
        touches (the deeper one, if two), and that of a link in no contact must be 0. Of laws with
        several states `mu` has an axis of them before these. Missing velocities, pulley
        coordinates, memory and ledger are 0.
        """
        y = np.zeros(self.size)
        links, pulleys, memory = self.links(y), self.pulleys(y), self.memory(y)
        for row, name in enumerate(("x", "y", "phi")[: self.freedoms]):
            links[0, row], links[1, row] = state[name], state.get(f"v{name}", 0.0)
        for row, name in enumerate(("theta", "omega")):
            pulleys[row] = state.get(name, 0.0)
        if self.mounts:
            travel, rate, share = self.mount_states(y)
            paths = np.array([not isinstance(one, Sprung) for one in self.mounts.values()])
            now = float(state.get("t", 0.0))
            travel[:] = state.get("travel", np.where(paths, now, self.rest))
            rate[:] = state.get("travel_speed", np.where(paths, 1.0, 0.0))
            share[:] = state.get("mount_friction", 0.0)
        penetration = self.penetration(y)
        deepest = penetration.argmax(axis=0)
        touching = penetration.max(axis=0) > 0
        for rows, name in ((memory[:-1], "mu"), (memory[-1:], "slip")):
            value = np.asarray(state.get(name, 0.0), dtype=float)
            if value.ndim == (1 if len(rows) == 1 else 2):
                if np.any(value[..., ~touching]):
                    raise ValueError(f"{name} is not 0 on a link that touches no pulley")
                rows[:, deepest, np.arange(self.n_bodies)] = value
            else:
                rows[:] = value
        self.ledger(y)[:] = state.get("ledger", 0.0)
        return y

    def unpack(self, y: Array, t: float = 0.0) -> dict[str, Any]:
        """Return the mapping of `pack`, with `mu` and `slip` as (n_p, n_b), and `t`."""
        links, pulleys, memory = self.links(y), self.pulleys(y), self.memory(y)
        names = (("x", "y", "phi"), ("vx", "vy", "vphi"))
        state: dict[str, Any] = {
            name: links[..., rate, row, :].copy()
            for rate, group in enumerate(names)
            for row, name in enumerate(group[: self.freedoms])
        }
        state["theta"], state["omega"] = pulleys[..., 0, :].copy(), pulleys[..., 1, :].copy()
        mu = memory[..., :-1, :, :] if self.n_states > 1 else memory[..., 0, :, :]
        state["mu"], state["slip"] = mu.copy(), memory[..., -1, :, :].copy()
        for row, name in enumerate(("travel", "travel_speed", "mount_friction")):
            state[name] = self.mount_states(y)[..., row, :].copy()
        state["ledger"] = self.ledger(y).copy()
        state["t"] = t
        return state

    def rhs(self, t: float, y: Array, torque: Torque, held: Array | None = None) -> Array:
        """dy/dt: (2.11) for links, (2.12) for pulleys, friction laws, the powers of section 7."""
        n_b, n_p, at_pulleys = self.n_bodies, self.n_pulleys, 2 * self.freedoms * self.n_bodies
        at_memory, at_ledger = at_pulleys + 2 * n_p, self.size - len(self.columns)
        at_mounts = at_ledger - 3 * len(self.mounted)
        links = y[:at_pulleys].reshape(2, self.freedoms, n_b)
        theta, omega = y[at_pulleys : at_pulleys + n_p], y[at_pulleys + n_p : at_memory]
        if self.motion:
            omega, omega_rate = self.prescribed(t, omega)
        at_slip = at_memory + self.n_states * n_p * n_b
        z = y[at_memory:at_slip].reshape(self.n_states, n_p, n_b)
        centers, moving = self.centers, None
        if self.mounts:
            centers, moving = self.axes(y), self.axis_velocities(y)

        dy = np.zeros_like(y)
        d_links = dy[:at_pulleys].reshape(2, self.freedoms, n_b)
        d_links[0] = links[1]
        force = d_links[1, :2]
        left, right, dy[at_ledger + 1] = self._pull(links, d_links[1])

        # Contact (2.3)-(2.8) for every (pulley, link) pair, or along the links.
        point = links[:, :2]
        along: AlongLinks | None = None
        if self.mesh == "joint":
            along = self.along_links(left, right, centers, moving)
            at_previous = right.take(self.previous, axis=2)
            point = 0.5 * (at_previous + left)
        outward = point[0][:, None, :] - centers.T[:, :, None]
        distance = np.sqrt(outward[0] * outward[0] + outward[1] * outward[1])
        outward /= distance
        vx, vy = point[1]
        if moving is not None:  # against the axis of each pulley
            vx, vy = point[1][:, None, :] - moving.T[:, :, None]
        if along is None:
            p = self.contact_radii[:, None] - distance
            touch = p > 0
            p_rate = -(vx * outward[0] + vy * outward[1])
            elastic = p * (self.c1 * p + self.c2)
            normal = np.maximum(self.pressing(elastic, p_rate), 0.0) * touch
            dy[at_ledger + 2] = np.vdot((normal - elastic) * touch, p_rate)
            share, fresh = np.ones_like(p), 0.0
        else:
            normal, share = along.normal(self.previous), along.share(self.previous)
            touch = share > 0
            fresh = np.maximum(along.share_rate(self.previous), 0.0) / (share + FRESH)
            share = np.where(touch, share, 1.0)
            dy[at_ledger + 2] = along.damping_power.sum()

        # Friction (section 4): along t = z x outward, the same lever arm in speed and torque.
        speed = (vy * outward[0] - vx * outward[1] - omega[:, None] * distance) * touch
        friction: Array | None = None
        if self.mu_k is not None and self.sigma is not None:
            friction = z[0] * normal
            z_rate = self.sigma * (speed - np.abs(speed) * z / self.mu_k) - fresh * z * touch
            slip_rate = speed
        elif any(self.laws):
            friction, slip_rate = np.zeros((2, n_p, n_b))
            z_rate = np.zeros_like(z)
            for j, law in enumerate(self.laws):
                if law is not None:
                    at = law_states(law, z, j), speed[j], normal[j] / share[j], self.l0
                    friction[j] = share[j] * law.force(*at) * touch[j]
                    z_rate[: law.n_states, j] = law.rate(*at) * touch[j]
                    slip_rate[j] = speed[j]
            z_rate -= fresh * z * touch * self.ruled
        grip = np.zeros(n_p)
        at_point = np.zeros((2, n_b))
        if along is None:
            at_point += np.add.reduce(normal * outward, 1)
        if friction is not None:
            at_point[0] += np.add.reduce(friction * outward[1], 0)
            at_point[1] -= np.add.reduce(friction * outward[0], 0)
            grip = np.add.reduce(friction * distance, 1)
            dy[at_memory:at_slip] = z_rate.ravel()
            dy[at_slip:at_mounts] = slip_rate.ravel()
            dy[at_ledger + 3] = np.vdot(friction, speed)
        if along is None:
            force += at_point
        else:
            at_left = along.left_force + 0.5 * at_point
            at_right = along.right_force + 0.5 * at_point.take(self.following, axis=1)
            self._push(0.5 * (right[0] - left[0]), at_left, at_right, d_links[1])

        # Pulleys (2.12), or what it says of the torque if the motion is prescribed.
        drive = np.asarray(torque(t, theta, omega), dtype=float)
        acting = drive
        resisting, bearing = np.zeros(n_p), omega
        if self.drag is not None:
            bearing = self.bearing_speeds(y, omega)
            resisting = self.drag_torque(bearing)
            acting = drive - resisting
            dy[at_ledger + 4] = resisting @ bearing
        d_omega = dy[at_pulleys + n_p : at_memory]
        d_omega[:] = (acting + grip) / self.inertias
        if self.motion:
            drive = drive.copy()
            needed = self.inertias * omega_rate - grip + resisting
            for j in self.motion:
                drive[j], d_omega[j] = needed[j], omega_rate[j]
        if self.mounts:
            assert along is not None
            on_belt = along.on_links()
            if friction is not None:
                on_belt[0] += np.add.reduce(friction * outward[1], 1)
                on_belt[1] -= np.add.reduce(friction * outward[0], 1)
            self._move_mounts(y, dy, on_belt.T, resisting, held)

        force /= self.mass
        d_links[1, 2:] /= self.inertia
        if self.gravity[0] or self.gravity[1]:
            force[0] += self.gravity[0]
            force[1] += self.gravity[1]
        dy[at_pulleys : at_pulleys + n_p] = omega
        dy[at_ledger] = drive @ omega
        return dy

    def _pull(self, links: Array, forces: Array) -> tuple[Array, Array, float]:
        """Joints (2.2): add their forces and moments on the links to `forces` (3, n_b)."""
        centre, angle, half_length = links[:, :2], links[:, 2], 0.5 * self.l0
        half = np.empty((2, 2, self.n_bodies))  # from mass centre to right end, and its rate
        arm = half[0]
        np.cos(angle[0], arm[0])
        np.sin(angle[0], arm[1])
        arm *= half_length
        np.multiply(arm[0], angle[1], half[1, 1])
        np.multiply(arm[1], angle[1], half[1, 0])
        np.negative(half[1, 0], half[1, 0])
        left, right = centre - half, centre + half
        stretch = left - right.take(self.previous, axis=2)
        pull = self.c_tra * stretch[0] + self.b_tra * stretch[1]
        pull_right = pull.take(self.following, axis=1)
        forces[:2] += pull_right - pull
        both = pull_right + pull
        bend = angle - angle.take(self.previous, axis=1)
        bend[0, 0] += 2 * math.pi * self.winding
        bending = self.c_tor * bend[0] + self.b_tor * bend[1]
        forces[2] += arm[0] * both[1] - arm[1] * both[0]
        forces[2] += bending.take(self.following) - bending
        lost = self.b_tra * np.vdot(stretch[1], stretch[1])
        if self.b_tor:
            lost += self.b_tor * np.vdot(bend[1], bend[1])
        return left, right, float(lost)

    def _push(self, arm: Array, at_left: Array, at_right: Array, forces: Array) -> None:
        """Add forces on the links' ends (2, n_b) to `forces`; the arm is half a link."""
        forces[:2] += at_left + at_right
        turning = at_right - at_left
        forces[2] += arm[0] * turning[1] - arm[1] * turning[0]

    def _move_mounts(
        self, y: Array, dy: Array, on_belt: Array, resisting: Array, held: Array | None
    ) -> None:
        """Rates of the mounts (section 5) under the force of every pulley on the belt (n_p, 2)."""
        (travel, speed, share), d = self.mount_states(y), self.mount_states(dy)
        work = self.ledger(dy)
        d[0] = speed
        for m, (j, one) in enumerate(self.mounts.items()):
            q, rate, zeta = travel[m], speed[m], share[m]
            a = one.lever(q, self.centers[j])
            if not isinstance(one, Sprung):
                work[6] -= rate * (a @ on_belt[j])
                continue
            on = None if held is None else held[m]
            force = one.spring(q) + one.damper(rate) - one.friction * zeta + one.stop(q, rate, on)
            force += one.weighs * (self.gravity[0] * a[0] + self.gravity[1] * a[1])
            force -= a @ on_belt[j]
            if one.carries_bearing:
                force += resisting[j]
            d[1, m] = force / one.moved
            d[2, m] = one.share_rate(rate, zeta)
            work[5] += one.lost(q, rate, zeta, on)

    def pressing(self, elastic: Array, rate: Array) -> Array:
        """N of section 3 before it is clamped, of the elastic force and the rate of p."""
        return np.asarray(elastic + (self.b + self.hunt_crossley * elastic) * rate)

    def along_links(
        self, left: Array, right: Array, centers: Array, moving: Array | None = None
    ) -> AlongLinks:
        """Contact along the links (section 3), of their ends: [position or rate, xy, link]."""
        both = np.array((left, right))  # [end, position or rate, xy, link]
        arm = both[:, 0, :, None] - centers.T[:, :, None]  # [end, xy, pulley, link]
        distance = np.sqrt(arm[:, 0] * arm[:, 0] + arm[:, 1] * arm[:, 1])
        arm /= distance[:, None]
        velocity = both[:, 1, :, None]
        if moving is not None:
            velocity = velocity - moving.T[:, :, None]
        p = self.contact_radii[:, None] - distance
        v = -(velocity[:, 0] * arm[:, 0] + velocity[:, 1] * arm[:, 1])
        inside = p > 0
        partly = inside[0] != inside[1]
        drop = p[0] - p[1]
        gap = np.where(partly, drop, 1.0)
        zero = partly * p[0] / gap  # where p = 0, of links with one end inside
        zero_rate = partly * (p[0] * v[1] - p[1] * v[0]) / (gap * gap)
        begin, end = zero * inside[1], zero * inside[0] + inside[1]
        length = end - begin
        at = begin + length * GAUSS
        p_at, v_at = p[0] - drop * at, v[0] + (v[1] - v[0]) * at
        elastic = (self.c1 * p_at + self.c2) * p_at
        raw = self.pressing(elastic, v_at)
        pressure = np.maximum(raw, 0.0)
        weight = 0.5 * length
        pressed = weight * pressure
        normal = np.array((pressed * (1.0 - at), pressed * at)).sum(axis=1)  # [end, pulley, link]
        force = (normal[:, None] * arm).sum(axis=2)
        # halves of the link: weights 1 - x and x, integrated over the part in contact
        of_right = weight * (end + begin)
        grows = np.where(inside[0], zero_rate, -zero_rate)
        of_grown = grows * zero
        return AlongLinks(
            p[0], p[1], normal, length - of_right, of_right, grows - of_grown, of_grown,
            force[0], force[1], weight * ((pressure - elastic) * v_at), length, p_at, raw, partly,
            arm,
        )  # fmt: skip

    def along_links_at(self, y: Array) -> AlongLinks:
        """The same at one state (size,)."""
        return self.along_links(*self.ends(y), self.axes(y), self.axis_velocities(y))

    def prescribed(self, t: float, omega: Array) -> tuple[Array, Array]:
        """Speeds with the prescribed ones in their place, and the rates of these, 0 of others."""
        omega, rate = np.array(omega, dtype=float), np.zeros(self.n_pulleys)
        for j, motion in self.motion.items():
            omega[j], rate[j] = motion(t)
        return omega, rate

    def follow(self, t: npt.ArrayLike, y: Array) -> Array:
        """Copy of the states y (..., size) at the times t (...) with the prescribed speeds."""
        y = np.array(y, dtype=float)
        if self.motion:
            speeds = self.pulleys(y)[..., 1, :]
            for at in np.ndindex(np.shape(t)):
                speeds[at], _ = self.prescribed(float(np.asarray(t)[at]), speeds[at])
        return y

    def axes(self, y: Array) -> Array:
        """Places of the axes: (n_p, 2), or with mounts (..., n_p, 2)."""
        if not self.mounts:
            return self.centers
        travel = self.mount_states(y)[..., 0, :]
        out = np.empty((*y.shape[:-1], self.n_pulleys, 2))
        out[:] = self.centers
        for m, (j, one) in enumerate(self.mounts.items()):
            out[..., j, :] = one.place(travel[..., m], self.centers[j])
        return out

    def axis_velocities(self, y: Array) -> Array:
        """Velocities v_j of the axes, of the shape of `axes`."""
        if not self.mounts:
            return np.zeros_like(self.centers)
        states = self.mount_states(y)
        travel, rate = states[..., 0, :], states[..., 1, :]
        out = np.zeros((*y.shape[:-1], self.n_pulleys, 2))
        for m, (j, one) in enumerate(self.mounts.items()):
            out[..., j, :] = one.lever(travel[..., m], self.centers[j]) * rate[..., m, None]
        return out

    def stop_depths(self, y: Array) -> Array:
        """How deep every mount is in its lower and upper stop, (..., n_m, 2)."""
        travel = self.mount_states(y)[..., 0, :]
        out = np.full((*travel.shape, 2), -np.inf)
        for m, one in enumerate(self.mounts.values()):
            if isinstance(one, Sprung):
                out[..., m, :] = one.stop_depths(travel[..., m])
        return out

    def bearing_speeds(self, y: Array, omega: Array | None = None) -> Array:
        """Speed of each pulley in its bearing (..., n_p): against its arm, if it is on one."""
        speeds = np.array(self.pulleys(y)[..., 1, :] if omega is None else omega)
        rate = self.mount_states(y)[..., 1, :]
        for m, (j, one) in enumerate(self.mounts.items()):
            if isinstance(one, Arm):
                speeds[..., j] -= rate[..., m]
        return speeds

    def drag_torque(self, omega: Array) -> Array:
        """Return the torque of the drag against these speeds in the bearings (section 5)."""
        if self.drag is None:
            return np.zeros(self.n_pulleys)
        coulomb, viscous, quadratic = self.drag.T
        sign = omega / np.hypot(omega, self.omega_0)
        return np.asarray(coulomb * sign + viscous * omega + quadratic * omega * np.abs(omega))

    # All take one state (size,) or many (..., size).

    def directions(self, y: Array) -> Array:
        """Return unit vectors e_i of the links, (..., 2, n_b)."""
        phi = self.links(y)[..., 0, 2, :]
        return np.stack((np.cos(phi), np.sin(phi)), axis=-2)

    def ends(self, y: Array) -> tuple[Array, Array]:
        """Left and right end of each link, (..., 2, 2, n_b): [place or velocity, xy, link]."""
        links, half = self.links(y), 0.5 * self.l0 * self.directions(y)
        half_rate = links[..., 1, 2:, :] * np.stack((-half[..., 1, :], half[..., 0, :]), axis=-2)
        centre, arm = links[..., :2, :], np.stack((half, half_rate), axis=-3)
        return centre - arm, centre + arm

    def joint_vectors(self, y: Array) -> tuple[Array, Array]:
        """Stretch vector d of each joint and its rate (section 2), (..., 2, n_b) each."""
        left, right = self.ends(y)
        d = left - np.roll(right, 1, axis=-1)
        return d[..., 0, :, :], d[..., 1, :, :]

    def points(self, y: Array) -> tuple[Array, Array]:
        """Mass centres, or joints, and their velocities (section 3), (..., 2, n_b) each."""
        links = self.links(y)
        position, velocity = links[..., 0, :2, :], links[..., 1, :2, :]
        if self.mesh == "paper":
            return position, velocity
        left, right = self.ends(y)
        mean = 0.5 * (np.roll(right, 1, axis=-1) + left)
        return mean[..., 0, :, :], mean[..., 1, :, :]

    def joint_angles(self, y: Array) -> tuple[Array, Array]:
        """Bend of each joint and its rate, (..., n_b) each; joint 0 closes the winding."""
        links = self.links(y)
        phi, rate = links[..., 0, 2, :], links[..., 1, 2, :]
        bend = phi - np.roll(phi, 1, axis=-1)
        bend[..., 0] += 2 * math.pi * self.winding
        return bend, rate - np.roll(rate, 1, axis=-1)

    def joints(self, y: Array) -> tuple[Array, Array]:
        """Deformation and force of each joint, left of its link, along the mean of both links."""
        e = self.directions(y)
        mean = e + np.roll(e, 1, axis=-1)
        mean /= np.hypot(mean[..., :1, :], mean[..., 1:, :])
        d, d_rate = self.joint_vectors(y)
        force = self.c_tra * d + self.b_tra * d_rate
        return (d * mean).sum(axis=-2), (force * mean).sum(axis=-2)

    def penetration(self, y: Array) -> Array:
        """Return p of every pair (2.5), (..., n_p, n_b); contact is p > 0."""
        if self.mesh == "paper":
            return self._depth(self.links(y)[..., 0, :2, :], self.centers)
        left, right = (self._depth(end[..., 0, :, :], self.axes(y)) for end in self.ends(y))
        p = np.maximum(left, right)
        return np.maximum(p, np.roll(p, 1, axis=-1))

    def _depth(self, position: Array, centers: Array) -> Array:
        dx = position[..., 0, None, :] - centers[..., 0, None]
        dy = position[..., 1, None, :] - centers[..., 1, None]
        return np.asarray(self.contact_radii[:, None] - np.sqrt(dx * dx + dy * dy))

    def normals(self, y: Array) -> tuple[Array, Array]:
        """Normal force of every pair and the share of it that is in contact (0 or 1 of a link)."""
        if self.mesh == "joint":
            states = y.reshape(-1, self.size)
            shape = (*y.shape[:-1], self.n_pulleys, self.n_bodies)
            found = [self.along_links_at(state) for state in states]
            normal = [one.normal(self.previous) for one in found]
            share = [one.share(self.previous) for one in found]
            return np.reshape(normal, shape), np.reshape(share, shape)
        position, velocity = self.points(y)
        arm = position[..., None, :, :] - self.centers[:, :, None]
        outward = arm / np.hypot(arm[..., :1, :], arm[..., 1:, :])
        rate = -(velocity[..., None, :, :] * outward).sum(axis=-2)
        p = self.penetration(y)
        total = self.pressing(self.c1 * p**2 + self.c2 * p, rate)
        return np.where(p > 0, np.maximum(0.0, total), 0.0), np.where(p > 0, 1.0, 0.0)

    def contacts(self, y: Array) -> Contacts:
        """Everything about the (pulley, link) pairs, (..., n_p, n_b) each."""
        position, velocity = self.points(y)
        velocity = velocity[..., None, :, :] - self.axis_velocities(y)[..., None]
        arm = position[..., None, :, :] - self.axes(y)[..., None]  # (..., n_p, 2, n_b)
        distance = np.hypot(arm[..., 0, :], arm[..., 1, :])
        outward = arm / distance[..., None, :]
        tangent = np.stack((-outward[..., 1, :], outward[..., 0, :]), axis=-2)
        p = self.penetration(y)
        rate = -(velocity * outward).sum(axis=-2)
        omega = self.pulleys(y)[..., 1, :]
        speed = (velocity * tangent).sum(axis=-2) - omega[..., None] * distance
        normal, share = self.normals(y)
        touching = share > 0
        whole = np.where(touching, share, 1.0)
        z = self.memory(y)[..., :-1, :, :]
        friction = np.zeros_like(normal)
        for j, law in enumerate(self.laws):
            if law is not None:
                pairs = (..., j, slice(None))
                at = law_states(law, z, j), speed[pairs], normal[pairs] / whole[pairs], self.l0
                friction[pairs] = share[pairs] * law.force(*at)
        mu = np.divide(friction, normal, out=np.zeros_like(normal), where=normal > 0)
        for j, law in enumerate(self.laws):
            if isinstance(law, Dahl):  # F = z N, also where N = 0
                pairs = (..., j, slice(None))
                mu[pairs] = np.where(touching[pairs], z[..., 0, j, :], 0.0)
        return Contacts(p, rate, normal, share, friction, mu, speed, outward, tangent, distance)

    def kinks(self, y: Array) -> dict[str, Array]:
        """What changes its form of equation at 0, of one state: penetrations [m], normal forces
        before they are clamped [N], slip velocities [m/s] and rates of the share of joints partly
        in contact [1/s], the latter three of what touches.
        """
        contacts = self.contacts(y)
        touching = contacts.share > 0
        if self.mesh == "paper":
            p = np.maximum(contacts.penetration, 0)
            raw = self.pressing(self.c1 * p**2 + self.c2 * p, contacts.rate)
            return {
                "penetration": contacts.penetration.ravel(),
                "force": raw[touching],
                "slip": contacts.velocity[touching],
                "share": np.ones(0),
            }
        along = self.along_links_at(y)
        on = (along.share_left + along.share_right) > 0
        partly = along.partly | along.partly[:, self.previous]
        return {
            "penetration": np.concatenate((along.p_left.ravel(), along.p_right.ravel())),
            "force": along.raw[:, on].ravel(),
            "slip": contacts.velocity[touching],
            "share": along.share_rate(self.previous)[partly & touching],
        }

    def energy_terms(self, y: Array) -> dict[str, Array]:
        """Return the terms of E in section 7; their sum is `energy`."""
        links, (d, _), (bend, _) = self.links(y), self.joint_vectors(y), self.joint_angles(y)
        if self.mesh == "joint":
            found = [self.along_links_at(state) for state in y.reshape(-1, self.size)]
            stored = [
                np.sum(
                    0.5 * one.length * (self.c1 * one.points / 3.0 + self.c2 / 2.0) * one.points**2
                )
                for one in found
            ]
            contact = np.reshape(stored, y.shape[:-1])
        else:
            p = np.maximum(self.penetration(y), 0.0)
            contact = (self.c1 * p**3 / 3 + self.c2 * p**2 / 2).sum(axis=(-2, -1))
        gravity = np.asarray(self.gravity, dtype=float)[:, None]
        omega = self.pulleys(y)[..., 1, :]
        terms = {
            "translation": 0.5 * self.mass * (links[..., 1, :2, :] ** 2).sum(axis=(-2, -1)),
            "rotation": 0.5 * self.inertia * (links[..., 1, 2:, :] ** 2).sum(axis=(-2, -1)),
            "stretching": 0.5 * self.c_tra * (d**2).sum(axis=(-2, -1)),
            "bending": 0.5 * self.c_tor * (bend**2).sum(axis=-1),
            "contact": contact,
            "gravity": -self.mass * (gravity * links[..., 0, :2, :]).sum(axis=(-2, -1)),
            "pulleys": (0.5 * self.inertias * omega**2).sum(axis=-1),
        }
        if self.mounts:
            (travel, rate, _), axes = np.moveaxis(self.mount_states(y), -2, 0), self.axes(y)
            moved, weight, sprung = (np.zeros(y.shape[:-1]) for _ in range(3))
            for m, (j, one) in enumerate(self.mounts.items()):
                if isinstance(one, Sprung):
                    moved += 0.5 * one.moved * rate[..., m] ** 2
                    weight -= one.weighs * (axes[..., j, :] @ gravity[:, 0])
                    sprung += one.stored(travel[..., m])
            terms |= {"moved mounts": moved, "weight of mounts": weight, "mount": sprung}
        return terms

    def energy(self, y: Array) -> Array:
        """E of section 7."""
        return np.asarray(sum(self.energy_terms(y).values()))

    def torques(self, t: float, y: Array, torque: Torque) -> Array:
        """Return the torque on each pulley: the one set, or what its prescribed motion needs."""
        theta, omega = self.pulleys(y)
        torques = np.array(torque(t, theta, omega), dtype=float)
        contacts, drag = self.contacts(y), self.drag_torque(self.bearing_speeds(y))
        for j, motion in self.motion.items():
            grip = np.dot(contacts.friction[j], contacts.distance[j])
            torques[j] = self.inertias[j] * motion(t)[1] - grip + drag[j]
        return torques

    def axis_forces(self, y: Array) -> Array:
        """Force of the belt on the axis of every pulley, less the sum of F_ij, (..., n_p, 2)."""
        contacts = self.contacts(y)
        rubbing = (contacts.friction[..., None, :] * contacts.tangent).sum(axis=-1)
        states = y.reshape(-1, self.size)
        pressing = [self.along_links_at(state).on_links().T for state in states]
        return np.asarray(rubbing - np.reshape(pressing, rubbing.shape))

    def mount_forces(self, y: Array) -> dict[str, Array]:
        """What acts on every mount, (..., n_m): torques of arms, forces of sliders."""
        travel, rate, share = np.moveaxis(self.mount_states(y), -2, 0)
        forces = self.axis_forces(y)
        names = ("spring_force", "damper_force", "friction_force", "stop_force", "belt_force")
        found = {name: np.zeros(travel.shape) for name in names}
        for m, (j, one) in enumerate(self.mounts.items()):
            q, q_rate = travel[..., m], rate[..., m]
            a = one.lever(q, self.centers[j])
            found["belt_force"][..., m] = (a * forces[..., j, :]).sum(axis=-1)
            if isinstance(one, Sprung):
                found["spring_force"][..., m] = one.spring(q)
                found["damper_force"][..., m] = one.damper(q_rate)
                found["friction_force"][..., m] = -one.friction * share[..., m]
                found["stop_force"][..., m] = one.stop(q, q_rate)
        return found

    def mount_powers(self, y: Array) -> list[float]:
        """Powers of the further quadratures that mounts bring, in the order of `MOUNT_LEDGER`."""
        (travel, rate, share), forces = self.mount_states(y), self.axis_forces(y)
        moving = self.axis_velocities(y)
        lost, done = 0.0, 0.0
        for m, (j, one) in enumerate(self.mounts.items()):
            if isinstance(one, Sprung):
                lost += float(one.lost(travel[m], rate[m], share[m]))
            else:
                done += float(moving[j] @ forces[j])
        return [lost, done]

    def powers(self, t: float, y: Array, torque: Torque) -> Array:
        """Return the powers of section 7 as in `columns`, written apart from `rhs`."""
        omega, bearing = self.pulleys(y)[1], self.bearing_speeds(y)
        _, d_rate = self.joint_vectors(y)
        _, bend_rate = self.joint_angles(y)
        contacts = self.contacts(y)
        if self.mesh == "joint":
            contact_loss = self.along_links_at(y).damping_power.sum()
        else:
            p = np.maximum(contacts.penetration, 0.0)
            damping = np.where(p > 0, contacts.normal - self.c1 * p**2 - self.c2 * p, 0.0)
            contact_loss = np.sum(damping * contacts.rate)
        return np.array(
            [
                np.dot(self.torques(t, y, torque), omega),
                self.b_tra * np.sum(d_rate**2) + self.b_tor * np.sum(bend_rate**2),
                contact_loss,
                np.sum(contacts.friction * contacts.velocity),
                np.dot(self.drag_torque(bearing), bearing),
                *(self.mount_powers(y) if self.mounts else ()),
            ]
        )

    def residual(self, y: Array, y0: Array) -> Array:
        """E - E0 - (drive work - losses): the global error that needs no reference (section 7)."""
        works = np.moveaxis(self.ledger(y) - self.ledger(y0), -1, 0)
        supplied: Array = works[0] - works[1:].sum(axis=0)
        return self.energy(y) - self.energy(y0) - supplied

    def forget(self, y: Array) -> Array:
        """Copy of y with mu = slip = 0 on every pair with p <= 0 (section 4)."""
        y = np.array(y, dtype=float)
        lost = self.penetration(y) <= 0
        self.memory(y)[np.broadcast_to(lost[..., None, :, :], self.memory(y).shape)] = 0.0
        return y


@dataclass(frozen=True)
class Contacts:
    """Contact quantities per (pulley, link) pair, (..., n_p, n_b); vectors (..., n_p, 2, n_b)."""

    penetration: Array  # p (2.5)
    rate: Array  # dp/dt (2.6)
    normal: Array  # N (2.8), clamped
    share: Array  # of the link or of the joint's two half links that is in contact
    friction: Array  # F (2.10); the force on the link is -F tangent
    mu: Array  # F / N; where N = 0, z of Dahl's law, else 0
    velocity: Array  # v_T, of any pair, also one not in contact
    outward: Array  # unit vector from pulley centre to link, or joint
    tangent: Array  # z x outward
    distance: Array  # |r_ij|, the lever arm


@dataclass(frozen=True)
class AlongLinks:
    """Contact along the links, (n_p, n_b) each; forces are vectors (2, n_b), of all pulleys."""

    p_left: Array  # penetration of a link's left end
    p_right: Array
    normals: Array  # normal forces at the ends of the links [end, pulley, link]
    share_left: Array  # of the half that belongs to the joint on the left, in contact; at most 1/2
    share_right: Array
    rate_left: Array  # of the shares
    rate_right: Array
    left_force: Array
    right_force: Array
    damping_power: Array  # of both Gauss points
    length: Array  # part of the link in contact
    points: Array  # penetration of both Gauss points
    raw: Array  # normal force of both before it is clamped
    partly: npt.NDArray[np.bool_]  # one end inside, one outside
    outward: Array  # unit vectors from the axis to the ends, [end, xy, pulley, link]

    def normal(self, previous: npt.NDArray[np.intp]) -> Array:
        """N of the joints."""
        return np.asarray(self.normals[0] + self.normals[1].take(previous, axis=1))

    def on_links(self) -> Array:
        """Sum over the links of the normal forces, [xy, pulley]."""
        return np.asarray((self.normals[:, None] * self.outward).sum(axis=(0, -1)))

    def share(self, previous: npt.NDArray[np.intp]) -> Array:
        """f of the joints."""
        return np.asarray(self.share_left + self.share_right.take(previous, axis=1))

    def share_rate(self, previous: npt.NDArray[np.intp]) -> Array:
        """df/dt of the joints."""
        return np.asarray(self.rate_left + self.rate_right.take(previous, axis=1))


def dahl_closed(
    x: npt.ArrayLike, x0: float, mu0: Any, mu_k: float, sigma: float, sign: int
) -> npt.NDArray[np.longdouble]:
    """Friction coefficient at x after a reversal at (x0, mu0): (2.9), in extended precision.

    The displacement counts in the direction of motion, `sign`: as printed, the second line of (2.9)
    would grow without bound and not solve the law of section 4.
    """
    long = np.longdouble
    gone = sign * (np.asarray(x, dtype=long) - long(x0))
    decay = np.exp(-long(sigma) / long(mu_k) * gone)
    limit = long(mu_k) if sign >= 0 else -long(mu_k)
    return np.asarray((long(mu0) - limit) * decay + limit)


def dahl_path_exact(
    turning_points: npt.ArrayLike, mu_k: float, sigma: float, mu0: float = 0.0
) -> npt.NDArray[np.longdouble]:
    """Return mu at each of the displacements, moving straight from one to the next; mu0 first."""
    x = np.asarray(turning_points, dtype=np.longdouble)
    mu = np.empty(len(x), dtype=np.longdouble)
    mu[0] = mu0
    for k in range(1, len(x)):
        sign = 1 if x[k] >= x[k - 1] else -1
        mu[k] = dahl_closed(x[k], x[k - 1], mu[k - 1], mu_k, sigma, sign)
    return mu


def paper_drive(n_bodies: int = 60, **changes: Any) -> Reference:
    """Return the paper's two-pulley drive with set S2 of section 8; `friction` replaces Dahl's."""
    data: dict[str, Any] = {
        "length": 1.2,
        "n_bodies": n_bodies,
        "linear_density": 0.10,
        "axial_stiffness": 70e3,
        "axial_damping": 1.4,
        "bending_stiffness": 0.01,
        "centers": np.array([[0.0, 0.0], [0.29, 0.0]]),
        "radii": np.array([0.1, 0.1]),
        "inertias": np.array([0.010, 0.010]),
        "contact": (5e10, 2.5e7, 1.0e3),
        "mu_k": 1.0,
        "sigma": 1e4,
    }
    data |= changes
    if data.get("friction") is not None:
        data |= {"mu_k": None, "sigma": None}
    return Reference(**data)


def start_state(model: Reference) -> Array:
    """Lay the belt at rest along `belt_line`, which also checks the model's winding."""
    centers = model.axes(model.pack({"x": 0.0, "y": 0.0, "phi": 0.0}))
    x, y, phi, winding, _ = belt_line(
        centers, model.radii, model.length, model.n_bodies, model.sides,
        0.5 if model.freedoms == 3 else 0.0,
    )  # fmt: skip
    if winding != model.winding:
        raise ValueError(f"winding is {model.winding}, but this order of pulleys gives {winding}")
    return model.pack({"x": x, "y": y, "phi": phi})
