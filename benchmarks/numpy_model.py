"""The drive's equations of motion as a NumPy user would write them: arrays over links, no loops.

For `peers.py`. The state vector is x, y, phi, vx, vy, vphi, mu (n_b each), theta, omega (n_p each):
only what the dynamics need, without slip displacements and energy ledger. A general integrator
cannot set mu to zero when a link leaves its pulley, so here mu decays off the pulleys at the rate
DECAY.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import common
import numpy as np

import beltdyn as bd

sys.path.insert(0, str(common.HERE.parent / "tests"))
import bridge

#: Rate at which mu is forgotten off the pulleys [1/s]. Measured from 5e3 to 3e5: this much costs
#: no peer anything, being below the joints' spectrum, and forces are within 1e-6 of a reset's.
DECAY = 1e5
FIELDS = ("x", "y", "phi", "vx", "vy", "vphi", "mu")


@dataclass(frozen=True, eq=False)
class Drive:
    """Numbers of the equations, per link, from those of a scene."""

    n: int
    n_p: int
    mass: float
    inertia: float  # of a link
    half: float  # half its length
    c_tra: float
    b_tra: float
    c_tor: float
    b_tor: float
    winding: float  # angle the ring closes with [rad]
    center: np.ndarray  # (n_p, 2)
    radius: np.ndarray
    pulley_inertia: np.ndarray
    c1: float
    c2: float
    b: float
    mu_k: float
    sigma: float
    gravity: tuple[float, float]
    knots: np.ndarray  # the set torque: from `torque[k]` at knot k (n_k, n_p)
    torque: np.ndarray  # linear in time up to the next,
    slope: np.ndarray  # in the end constant, less viscous * omega
    viscous: np.ndarray

    @classmethod
    def of(cls, scene: bd.Scene) -> Drive:
        """The numbers of a scene.

        Raises:
            ValueError: What this model is not for.
        """
        p, info, n_p = scene.params, scene.params.info, len(scene.params.pulleys)
        laws = [p.friction_on(k) for k in range(n_p)]
        law = laws[0] or bd.Dahl(mu_k=1.0, sigma=1.0)
        knots, torque, viscous = _torques(scene.torque_fn, p)
        for fault, is_so in {
            "the mesh of joints": p.belt.mesh != "paper",
            "another friction law than Dahl's": not isinstance(law, bd.Dahl),
            "laws of single pulleys": any(one != laws[0] for one in laws),
            "a Stribeck curve": getattr(law, "mu_s", 0.0) > 0.0,
            "a pulley on the back": any(one.side == "outside" for one in p.pulleys),
            "axes that move": bool(p.mounted),
            "bearing drag": any(one.drag for one in p.pulleys),
            "contact after Hunt and Crossley": p.effective_contact.hunt_crossley > 0.0,
            "prescribed motion": bool(scene.motion),
        }.items():
            if is_so:
                raise ValueError(fault)
        jump = np.diff(knots) == 0.0
        slope = np.diff(torque, axis=0) / np.where(jump, 1.0, np.diff(knots))[:, None]
        return cls(
            n=p.belt.n_bodies,
            n_p=len(p.pulleys),
            mass=info["link_mass"],
            inertia=info["link_inertia"],
            half=0.5 * info["link_length"],
            c_tra=info["joint_stiffness"],
            b_tra=info["joint_damping"],
            c_tor=info["bending_stiffness"],
            b_tor=info["bending_damping"],
            winding=2.0 * math.pi * info["winding"],
            center=np.array([pulley.center for pulley in p.pulleys]),
            radius=bridge.oracle_of(p).contact_radii,
            pulley_inertia=np.array([pulley.inertia for pulley in p.pulleys]),
            c1=info["contact_quadratic"],
            c2=info["contact_linear"],
            b=info["contact_damping"],
            mu_k=law.mu_k,
            sigma=law.sigma if laws[0] else 0.0,  # mu stays at 0
            gravity=p.gravity,
            knots=knots,
            torque=torque,
            slope=np.vstack([slope, np.zeros(n_p)]),
            viscous=viscous,
        )

    @property
    def size(self) -> int:
        return len(FIELDS) * self.n + 2 * self.n_p

    def pack(self, state: bd.State) -> np.ndarray:
        return np.concatenate([getattr(state, name) for name in (*FIELDS, "theta", "omega")])

    def split(self, y: np.ndarray) -> list[np.ndarray]:
        """Views of the fields of a state vector, then of theta and omega."""
        end = len(FIELDS) * self.n
        return [*y[:end].reshape(len(FIELDS), self.n), *y[end:].reshape(2, self.n_p)]

    def per_variable(self, values: dict[str, Any]) -> np.ndarray:
        """A vector like the state with one number for each field, or one for each pulley."""
        links = [np.full(self.n, values[name]) for name in FIELDS]
        return np.concatenate([*links, *(np.full(self.n_p, values[k]) for k in ("theta", "omega"))])


def _torques(torque: bd.TorqueLike, params: bd.Params) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Knots (n_k,), torques there (n_k, n_p), two knots at a jump, and viscous coefficients."""
    n_p = len(params.pulleys)
    viscous, given = np.zeros(n_p), None
    for part in getattr(torque, "parts", [torque]):
        if isinstance(part, bd.Viscous):
            viscous = viscous + part.coefficients
        elif isinstance(part, bd.Load) and not (part.coulomb or part.quadratic or part.factor):
            viscous[params.pulley_index(part.pulley)] += part.viscous
        elif isinstance(part, bd.PiecewiseLinear) and given is None:
            given = part
        else:
            raise ValueError(f"a torque {type(part).__name__} beside others")
    if given is None:
        return np.zeros(1), np.zeros((1, n_p)), viscous
    values = np.zeros((given.t.size, n_p))
    of = slice(None) if given.pulley is None else params.pulley_index(given.pulley)
    values[:, of] = np.squeeze(given.values)
    return np.array(given.t), values, viscous


def make_rhs(drive: Drive) -> Any:
    """The right-hand side ``f(t, y)``: (2.11), (2.12) and Dahl's law."""
    n, n_p, d = drive.n, drive.n_p, drive
    half, radius = d.half, d.radius[:, None]
    center_x, center_y = d.center[:, :1], d.center[:, 1:]
    end = len(FIELDS) * n
    before, after = np.arange(-1, n - 1) % n, np.arange(1, n + 1) % n

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        links = y[:end].reshape(len(FIELDS), n)
        place, speed, mu = links[:3], links[3:6], links[6]
        omega = y[end + n_p :]
        dy = np.empty_like(y)
        d_links = dy[:end].reshape(len(FIELDS), n)
        d_links[:3] = speed
        force, moment = d_links[3:5], d_links[5]

        arm_x, arm_y = half * np.cos(place[2]), half * np.sin(place[2])
        turn_x, turn_y = -arm_y * speed[2], arm_x * speed[2]
        pull_x = d.c_tra * ((place[0] - arm_x) - (place[0] + arm_x)[before]) + d.b_tra * (
            (speed[0] - turn_x) - (speed[0] + turn_x)[before]
        )
        pull_y = d.c_tra * ((place[1] - arm_y) - (place[1] + arm_y)[before]) + d.b_tra * (
            (speed[1] - turn_y) - (speed[1] + turn_y)[before]
        )
        bend = place[2] - place[2][before]
        bend[0] += d.winding
        bending = d.c_tor * bend + d.b_tor * (speed[2] - speed[2][before])
        right_x, right_y = pull_x[after], pull_y[after]
        moment[:] = arm_x * (right_y + pull_y) - arm_y * (right_x + pull_x)
        moment += bending[after] - bending
        moment /= d.inertia

        # (pulley, link) pairs
        out_x, out_y = place[0] - center_x, place[1] - center_y
        distance = np.sqrt(out_x * out_x + out_y * out_y)
        out_x, out_y = out_x / distance, out_y / distance
        p = radius - distance
        touch = p > 0.0
        rate = -(speed[0] * out_x + speed[1] * out_y)
        normal = np.where(touch, np.maximum(p * (d.c1 * p + d.c2) + d.b * rate, 0.0), 0.0)
        friction = mu * normal
        slip = np.where(touch, speed[1] * out_x - speed[0] * out_y - omega[:, None] * distance, 0.0)
        slip = slip.sum(axis=0)
        d_links[6] = d.sigma * (slip - np.abs(slip) * mu / d.mu_k)
        d_links[6] -= np.where(touch.any(axis=0), 0.0, DECAY * mu)
        force[0] = (right_x - pull_x + (normal * out_x + friction * out_y).sum(axis=0)) / d.mass
        force[1] = (right_y - pull_y + (normal * out_y - friction * out_x).sum(axis=0)) / d.mass
        force[0] += d.gravity[0]
        force[1] += d.gravity[1]

        k = max(int(np.searchsorted(d.knots, t, side="right")) - 1, 0)
        set_torque = d.torque[k] + d.slope[k] * max(t - d.knots[k], 0.0)
        dy[end : end + n_p] = omega
        dy[end + n_p :] = (
            set_torque - d.viscous * omega + (friction * distance).sum(axis=1)
        ) / d.pulley_inertia
        return dy

    return rhs


def joint_force(drive: Drive, y: np.ndarray) -> np.ndarray:
    """Joint forces along the mean direction of the two links, of many states (n_t, size)."""
    links = y[:, : len(FIELDS) * drive.n].reshape(len(y), len(FIELDS), drive.n)
    x, y_, phi, vx, vy, vphi = (links[:, k] for k in range(6))
    arm_x, arm_y = drive.half * np.cos(phi), drive.half * np.sin(phi)

    def before(values: np.ndarray) -> np.ndarray:
        return np.roll(values, 1, axis=1)

    d_x = (x - arm_x) - before(x + arm_x)
    d_y = (y_ - arm_y) - before(y_ + arm_y)
    rate_x = (vx + arm_y * vphi) - before(vx - arm_y * vphi)
    rate_y = (vy - arm_x * vphi) - before(vy + arm_x * vphi)
    mean_x, mean_y = arm_x + before(arm_x), arm_y + before(arm_y)
    pull_x = drive.c_tra * d_x + drive.b_tra * rate_x
    pull_y = drive.c_tra * d_y + drive.b_tra * rate_y
    return np.asarray((pull_x * mean_x + pull_y * mean_y) / np.hypot(mean_x, mean_y))
