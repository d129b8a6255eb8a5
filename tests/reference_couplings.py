"""Couplings of MODEL.md section 5, plain NumPy, written from that page alone.

A drive with couplings is one without, of what its belt runs on, and further bodies that act on it
by torques: hubs of isolators and clutches, rings of torsional dampers. `Coupled` adds their angle,
speed and windup, and the works of set torques and of couplings, to the state of `reference.py`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.integrate
from reference import Array, Motion, Reference, Torque
from reference_mounts import Arm


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """One of MODEL section 5, with numbers that the user may leave open as None."""

    kind: str  # "isolator", "clutch" or "damper"
    inertia: float  # I_h of the hub, of a damper I_r of the ring
    stiffness: float | None = None  # k
    damping: float | None = None  # d
    sense: int = 1  # s

    @property
    def k(self) -> float:
        if self.kind == "clutch" and not self.stiffness:
            return self.inertia * (2 * np.pi * 300) ** 2
        return float(self.stiffness or 0.0)

    @property
    def d(self) -> float:
        if self.kind == "clutch" and not self.damping:
            return float(0.1 * np.sqrt(self.k * self.inertia))
        return float(self.damping or 0.0)

    def torque(self, z: float, w: float) -> float:
        """T, positive where it drives the shaft in the sense s."""
        pull = self.k * z + self.d * w
        return max(0.0, pull) if self.kind == "clutch" else pull

    def rate(self, z: float, w: float) -> float:
        """dz/dt."""
        return max(w, -self.k * z / self.d) if self.kind == "clutch" else w


@dataclass(frozen=True)
class Coupled:
    """A drive of which some pulleys have a coupling.

    `drive` has the inertias of what the belt runs on, and the drag of all pulleys; `motion` is of
    hubs.
    """

    drive: Reference
    couplings: Mapping[int, Coupling]  # by pulley
    motion: Mapping[int, Motion] = field(default_factory=dict)

    @property
    def bare(self) -> Reference:
        """Without the drag that acts on hubs."""
        hubs = [j for j, one in self.couplings.items() if one.kind != "damper"]
        drag = self.drive.drag
        if drag is not None:
            drag = np.array(drag)
            drag[hubs] = 0.0
        return dataclasses.replace(self.drive, drag=drag)

    def parts(self, y: Array) -> tuple[Array, Array, Array]:
        """The drive's own state, (3, n_c) of angle, speed and windup, and the two works."""
        n = self.drive.size
        return y[:n], y[n:-2].reshape(3, -1), y[-2:]

    def pack(self, state: Mapping[str, Any]) -> Array:
        """From the fields of a state, `theta` and `omega` of shafts; the ledger begins with 0."""
        own = {name: np.array(value, dtype=float) for name, value in state.items()}
        further = np.zeros((3, len(self.couplings)))
        for c, (j, one) in enumerate(self.couplings.items()):
            beyond = own["rim_angle"][c], own["rim_speed"][c]
            if one.kind != "damper":  # the belt's pulley is the rim, the further body the hub
                hub = own["theta"][j], own["omega"][j]
                own["theta"][j], own["omega"][j] = beyond
                beyond = hub
            further[:, c] = *beyond, own["windup"][c]
        own["t"] = state["t"]
        return np.concatenate([self.drive.pack(own), further.ravel(), np.zeros(2)])

    def shafts(self, y: Array) -> tuple[Array, Array]:
        """theta and omega of the shafts."""
        own, further, _ = self.parts(y)
        theta, omega = np.array(self.drive.pulleys(own))
        for c, (j, one) in enumerate(self.couplings.items()):
            if one.kind != "damper":
                theta[j], omega[j] = further[0, c], further[1, c]
        return theta, omega

    def rims(self, y: Array) -> tuple[Array, Array]:
        """Angle and speed of what is beyond each coupling: rims, and rings of dampers."""
        own, further, _ = self.parts(y)
        theta, omega = self.drive.pulleys(own)
        of_rim = [one.kind != "damper" for one in self.couplings.values()]
        which = list(self.couplings)
        return np.where(of_rim, theta[which], further[0]), np.where(
            of_rim, omega[which], further[1]
        )

    def transmitted(self, y: Array) -> tuple[Array, Array]:
        """Torque of every coupling on its shaft, counter-clockwise, and the rate of its windup."""
        omega, (_, speed) = self.shafts(y)[1], self.rims(y)
        z = self.parts(y)[1][2]
        found = np.zeros((2, len(self.couplings)))
        for c, (j, one) in enumerate(self.couplings.items()):
            w = one.sense * (speed[c] - omega[j])
            found[:, c] = one.sense * one.torque(z[c], w), one.rate(z[c], w)
        return found[0], found[1]

    def rhs(self, t: float, y: Array, torque: Torque) -> Array:
        """dy/dt, the powers of the set torques and of the couplings' dampers last."""
        own, further, _ = self.parts(y)
        theta, omega = self.shafts(y)
        given = np.array(torque(t, theta, omega), dtype=float)
        on_shaft, winds = self.transmitted(y)
        on_belt, out = given.copy(), np.zeros_like(further)
        drag = np.zeros(len(omega))
        if self.drive.drag is not None:
            bearing = omega.copy()
            for j, m in self.arms():  # drag acts between hub and arm
                bearing[j] -= self.drive.mount_states(own)[1, m]
            drag = self.drive.drag_torque(bearing)
        drive, lost = 0.0, 0.0
        for c, (j, one) in enumerate(self.couplings.items()):
            out[0, c], out[2, c] = further[1, c], winds[c]
            lost += one.d * winds[c] ** 2
            if one.kind == "damper":
                on_belt[j] += on_shaft[c]
                out[1, c] = -on_shaft[c] / one.inertia
                continue
            on_belt[j] = -on_shaft[c]
            if j in self.motion:
                rate = self.motion[j](t)[1]
                given[j] = one.inertia * rate - on_shaft[c] + drag[j]
            out[1, c] = (given[j] + on_shaft[c] - drag[j]) / one.inertia
        d_own = self.bare.rhs(t, own, lambda *_: on_belt)
        for j, m in self.arms():
            self.drive.mount_states(d_own)[1, m] += drag[j] / self.drive.mounts[j].moved
        drive = float(given @ omega)
        return np.concatenate([d_own, out.ravel(), [drive, lost]])

    def arms(self) -> list[tuple[int, int]]:
        """Pulleys with a hub that stand on an arm, and the number of their mounts."""
        hubs = [j for j, one in self.couplings.items() if one.kind != "damper"]
        return [
            (j, m)
            for m, (j, mount) in enumerate(self.drive.mounts.items())
            if j in hubs and isinstance(mount, Arm)
        ]

    def energy_terms(self, y: Array) -> dict[str, float]:
        """Those of the further bodies, and of the springs."""
        _, further, _ = self.parts(y)
        return {
            "kinetic": float(
                sum(0.5 * one.inertia * further[1, c] ** 2
                    for c, one in enumerate(self.couplings.values()))
            ),
            "coupling": float(
                sum(0.5 * one.k * further[2, c] ** 2
                    for c, one in enumerate(self.couplings.values()))
            ),
        }  # fmt: skip

    def energy(self, y: Array) -> float:
        own, _, _ = self.parts(y)
        return float(self.drive.energy(own)) + sum(self.energy_terms(y).values())

    def integrate(
        self, y0: Array, torque: Torque, times: Array, t0: float, tol: float = 1e-9
    ) -> Array:
        """States at times; of drives whose friction has no memory, which no event resets."""
        run = scipy.integrate.solve_ivp(
            lambda t, y: self.rhs(t, y, torque),
            (t0, float(times[-1])),
            y0,
            "DOP853",
            times,
            rtol=tol,
            atol=1e-11,
            max_step=2e-4,  # a clutch has kinks
        )
        assert run.success, run.message
        return np.asarray(run.y.T)
