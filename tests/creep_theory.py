"""Creep of a running belt by quasi-static theory: an extensible belt, no gravity; Coulomb friction,
and Dahl's by its differential equation.

In steady motion c = v / lambda, the stress-free length that passes by in a second, is the same all
round, with lambda(T) = 1 + T / EA. On the driving pulley the belt sticks from where it enters, with
the tight side's tension, and slips towards where it leaves; on the driven pulley it sticks with
the slack side's. So omega_1 R_1 = v_t and omega_2 R_2 = v_s. Balance of forces on an element of an
arc in slip, with the momentum m c v of the belt, is dH = mu H dphi for H = T - m c^2 lambda. So the
angle of slip is the same on both pulleys, ln(H_t / H_s) / mu, and the torque of a pulley over its
radius is (T_t - T_s) - m c (v_t - v_s) = H_t - H_s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve


@dataclass(frozen=True)
class Drive:
    """Two pulleys of radii (driving, driven), wraps [rad], the length of both spans together."""

    radii: tuple[float, float]
    wraps: tuple[float, float]
    spans: float
    length: float
    axial_stiffness: float
    linear_density: float
    mu: float

    @classmethod
    def open(
        cls, radii: tuple[float, float], apart: float, *, length: float, **belt: float
    ) -> Drive:
        """An open drive; lengths of spans and wraps from its right-angled triangle."""
        lean = math.asin((radii[1] - radii[0]) / apart)
        wraps = (math.pi - 2.0 * lean, math.pi + 2.0 * lean)
        return cls(radii, wraps, 2.0 * apart * math.cos(lean), length, **belt)

    def stretch(self, tension: float) -> float:
        return 1.0 + tension / self.axial_stiffness


@dataclass(frozen=True)
class Creep:
    """A steady state: tensions [N], speed of the driven pulley, torques [N m], slip angle [rad]."""

    tight: float
    slack: float
    omega: float
    torque: float
    load: float
    slip: float


def _state(drive: Drive, omega: float, tight: float, slack: float) -> tuple[Creep, float]:
    """The state with these tensions, and how much longer its belt is than that of the drive."""
    r_1, r_2 = drive.radii
    lam_t, lam_s = drive.stretch(tight), drive.stretch(slack)
    c = omega * r_1 / lam_t
    momentum = drive.linear_density * c * c
    h_t, h_s = tight - momentum * lam_t, slack - momentum * lam_s
    slip = math.log(h_t / h_s) / drive.mu
    # lambda is linear in H: lambda = at_zero + rise H, and the slipping arc has dphi = dH / (mu H)
    rise = (lam_t - lam_s) / (h_t - h_s)
    at_zero = lam_t - rise * h_t
    sliding = (slip - math.log(lam_t / lam_s) / drive.mu) / at_zero
    length = (
        0.5 * drive.spans * (1.0 / lam_t + 1.0 / lam_s)
        + r_1 * ((drive.wraps[0] - slip) / lam_t + sliding)
        + r_2 * ((drive.wraps[1] - slip) / lam_s + sliding)
    )
    pull = h_t - h_s
    state = Creep(tight, slack, c * lam_s / r_2, pull * r_1, pull * r_2, slip)
    return state, length - drive.length


def rest(drive: Drive) -> float:
    """Tension of the belt at rest [N]."""
    path = drive.spans + sum(r * w for r, w in zip(drive.radii, drive.wraps, strict=True))
    return drive.axial_stiffness * (path / drive.length - 1.0)


def steady(drive: Drive, omega: float, load: Callable[[float], float]) -> Creep:
    """The steady state at this speed of the driving pulley, with ``load(speed)`` on the other."""

    def misfit(unknown: np.ndarray) -> list[float]:
        state, longer = _state(drive, omega, *unknown)
        return [state.load - load(state.omega), longer * drive.axial_stiffness / drive.length]

    t_0 = rest(drive)
    found = fsolve(misfit, [1.2 * t_0, 0.8 * t_0], xtol=1e-12)
    assert max(map(abs, misfit(found))) < 1e-9
    return _state(drive, omega, *found)[0]


def full_slip(drive: Drive, omega: float) -> Creep:
    """The steady state at which the smaller wrap slips all over: no larger load has one."""
    factor = math.exp(drive.mu * min(drive.wraps))

    def tight(slack: float) -> float:
        def excess(tight: float) -> float:
            momentum = drive.linear_density * (omega * drive.radii[0] / drive.stretch(tight)) ** 2
            h_t = tight - momentum * drive.stretch(tight)
            return h_t - factor * (slack - momentum * drive.stretch(slack))

        return float(brentq(excess, slack, 1.1 * factor * slack, xtol=1e-13))

    def longer(slack: float) -> float:
        return _state(drive, omega, tight(slack), slack)[1]

    low = drive.linear_density * (omega * drive.radii[0]) ** 2
    slack = float(brentq(longer, low + 1e-3 * rest(drive), rest(drive), xtol=1e-13))
    return _state(drive, omega, tight(slack), slack)[0]


def two_pulley_benchmark() -> Creep:
    """The steady end of Ntarladima et al. (2023), of the numbers published: 12 rad/s, drag, load.

    They are per metre of the stretched belt, 0.4 pi m, of which the stress-free one is 0.95.
    """
    drive = Drive(
        radii=(0.1, 0.1),
        wraps=(math.pi, math.pi),
        spans=0.2 * math.pi,
        length=0.95 * 0.4 * math.pi,
        axial_stiffness=0.95 * 8000.0,
        linear_density=0.8288 / 0.95,
        mu=0.5,
    )
    return steady(drive, 12.0, lambda omega: 2.0 * omega + 25.0)


def dahl(drive: Drive, omega: float, torque: float, sigma: float) -> tuple[float, float]:
    """Slack tension and creep under Dahl's law, rigid pulleys, by equations along each wrap:
    dT - rhoA J dv = mu' H dphi and J dmu'/dX = sigma (s - |s| mu' / mu), s = v - rim.

    Args:
        drive: Of two pulleys inside the loop.
        omega: Speed of the driving one [rad/s].
        torque: On it [N m].
        sigma: Of the friction law [1/m].
    """
    density, scale = drive.linear_density, rest(drive)

    def leaves(k: int, enters: float, flow: float, rim: float) -> np.ndarray:
        def along(_phi: float, y: np.ndarray) -> list[float]:
            stretch = drive.stretch(y[0])
            slip = flow * stretch - rim
            pressing = y[0] - density * flow**2 * stretch
            metres = drive.radii[k] / stretch
            bristles = sigma * (slip - abs(slip) * y[1] / drive.mu) * metres / flow
            rise = y[1] * pressing / (1.0 - density * flow**2 / drive.axial_stiffness)
            return [rise, bristles, metres]

        found = solve_ivp(along, (0.0, drive.wraps[k]), [enters, 0, 0], rtol=1e-9, atol=1e-11)
        return np.asarray(found.y[:, -1])

    def misfit(u: np.ndarray) -> list[float]:
        tight, slack = scale * u[:2]
        flow = omega * drive.radii[0] / u[2]
        driving, driven = leaves(0, tight, flow, u[2] * flow), leaves(1, slack, flow, u[3] * flow)
        spans = 0.5 * drive.spans * (1.0 / drive.stretch(tight) + 1.0 / drive.stretch(slack))
        pull = (tight - slack) * (1.0 - density * flow**2 / drive.axial_stiffness)
        return [
            driven[0] / scale - u[0],
            driving[0] / scale - u[1],
            (driven[2] + driving[2] + spans - drive.length) * drive.axial_stiffness / scale,
            (pull - torque / drive.radii[0]) / scale,
        ]

    part = 0.5 * torque / drive.radii[0] / scale
    rims = [drive.stretch(scale * (1.0 + part)), drive.stretch(scale * (1.0 - part))]
    found = fsolve(misfit, [1.0 + part, 1.0 - part, *rims], xtol=1e-11)
    assert max(map(abs, misfit(found))) < 1e-7
    return scale * float(found[1]), 1.0 - float(found[3] / found[2])


def dahl_slip_arc(
    enters: float, leaves: float, mu: float, sigma: float, stiffness: float, share: float
) -> float:
    """The angle with this share of Dahl's friction or more, by the forces at both ends [rad].

    dH/dphi = +-mu' H, and what the belt creeps stretches bristles: dmu'/dphi = sigma (1 - mu'/mu)
    times R |H - H_enters| / EA. They begin on the mode that grows as exp(phi sqrt(sigma R H / EA)).

    Args:
        enters, leaves: H where the belt runs on, and off [N].
        mu, sigma: Of the friction law; ``sigma`` times the radius [1].
        stiffness: EA [N].
        share: Share of ``mu``.
    """
    sign = math.copysign(1.0, leaves - enters)
    rate, first = math.sqrt(sigma * enters / stiffness), 1e-4 * mu

    def along(_phi: float, y: np.ndarray) -> list[float]:
        return [sign * y[1] * y[0], sigma * (1.0 - y[1] / mu) * abs(y[0] - enters) / stiffness]

    def ends(_phi: float, y: np.ndarray) -> float:
        return float(y[0] - leaves)

    ends.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        along,
        (0.0, 20.0),
        [enters * (1.0 + sign * first / rate), first],
        events=[lambda _phi, y: y[1] - share * mu, ends],
        rtol=1e-8,
    )
    return float(found.t_events[1][0] - found.t_events[0][0])
