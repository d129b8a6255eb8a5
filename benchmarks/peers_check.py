"""Whether the peers' models are right: against the tests' oracle, the Jacobian against differences.

A row of f is known to ROUNDING times the terms it is the sum of, and two values of it a step h
apart give a derivative to ROUNDING times terms over h. With a step of STEP times the length over
which f bends, the cube root of a rounding, truncation, (h / length)^3 of the terms, is no more.

A difference is a derivative where no kink lies within its step: links that touch, contact that
begins to pull, slip that turns. A settled belt does not slip, which is on the kink of |v_T|. So the
Jacobian is checked near the start in GENERAL POSITION, where that is made sure of.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import bridge
import common
import numpy as np
from numpy_model import DECAY, FIELDS, Drive

if TYPE_CHECKING:
    from peers import Problem

NAMES = (*FIELDS, "theta", "omega")
#: Some fifty roundings; the step over `lengths`.
ROUNDING, STEP = 1e-14, 6e-6
#: How far the state in general position is from the start, over `lengths`.
AWAY = 0.1


def check(problem: Problem, case: common.Case) -> str:
    """Check the models at the start and in general position, the Jacobian there; how close it is.

    Raises:
        AssertionError: They differ, and where.
    """
    drive, natural, oracle = problem.drive, problem.natural, bridge.oracle_of(case.params)
    general, worst = in_general_position(drive, problem.y0), {"NumPy": 0.0, "Numba": 0.0}
    for t, y in ((problem.t0, problem.y0), (0.5 * (problem.t0 + problem.t1), general)):
        fields = dict(zip(NAMES, drive.split(y), strict=True))
        truth = oracle.unpack(oracle.rhs(t, oracle.pack({"t": t, **fields}), case.torque))
        truth["mu"] = truth["mu"].sum(axis=0)
        exact, compiled = np.concatenate([truth[name] for name in NAMES]), np.empty_like(y)
        compiled[natural.order] = natural.rhs(t, y[natural.order])
        for name, model in (("NumPy", problem.plain(t, y)), ("Numba", compiled)):
            off = np.abs(model - exact) / (ROUNDING * terms(drive, y))
            worst[name] = max(worst[name], float(np.max(off)))
            if not np.all(off <= 1.0):
                at = int(np.argmax(~(off <= 1.0)))
                raise AssertionError(
                    f"{name} model: rate of {named(drive, at)} is {model[at]:.9g}, the oracle's "
                    f"{exact[at]:.9g}"
                )

    z, step = general[natural.order], (STEP * lengths(drive))[natural.order]
    matrix, room = natural.jacobian(t, z), ROUNDING * terms(drive, general)[natural.order]
    furthest, sharp = 0.0, 0
    for k in range(z.size):
        column, shift = np.zeros(z.size), np.zeros(z.size)
        inside = slice(*matrix.indptr[k : k + 2])
        column[matrix.indices[inside]] = matrix.data[inside] * step[k]
        shift[k] = step[k]
        change = 0.5 * (natural.rhs(t, z + shift) - natural.rhs(t, z - shift))
        off = np.abs(column - change) / room
        furthest = max(furthest, float(np.max(off)))
        if not np.all(off <= 1.0):
            at = int(np.argmax(~(off <= 1.0)))
            names = (named(drive, natural.order[j]) for j in (at, k))
            raise AssertionError(
                f"Jacobian: rate of {' by '.join(names)} is {column[at] / step[k]:.9g}, by "
                f"differences {change[at] / step[k]:.9g}"
            )
        # Those that would be found if they were off by a thousandth.
        sharp += np.count_nonzero(1e-3 * np.abs(column) > 2.0 * room)
    share = sharp / np.count_nonzero(matrix.data)
    return (
        f"checked against the oracle: NumPy model to {worst['NumPy']:.0e}, Numba model to "
        f"{worst['Numba']:.0e} of what rounding allows; Jacobian against differences to "
        f"{furthest:.0e}, {share:.0%} of its entries to a thousandth or better"
    )


def named(drive: Drive, at: int) -> str:
    """An entry of NumPy's state vector."""
    field, link = divmod(at, drive.n)
    if field < len(FIELDS):
        return f"{FIELDS[field]} of link {link}"
    part, pulley = divmod(at - len(FIELDS) * drive.n, drive.n_p)
    return f"{('theta', 'omega')[part]} of pulley {pulley}"


def lengths(drive: Drive) -> np.ndarray:
    """Lengths over which f bends, half a link and a radian, and speeds of waves in the belt."""
    d = drive
    speed = d.half * math.sqrt(d.c_tra / d.mass)
    return d.per_variable(
        {"x": d.half, "y": d.half, "phi": 1.0, "vx": speed, "vy": speed, "vphi": speed / d.half,
         "mu": 1.0, "theta": 1.0, "omega": speed / np.min(d.radius)}
    )  # fmt: skip


def gaps(drive: Drive, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """What has a kink where it is zero, of each pulley and link: depth, force of contact, slip."""
    d, (x, y_, _, vx, vy, *_, omega) = drive, drive.split(y)
    out_x, out_y = x - d.center[:, :1], y_ - d.center[:, 1:]
    rho = np.hypot(out_x, out_y)
    depth = d.radius[:, None] - rho
    rate = -(vx * out_x + vy * out_y) / rho
    slip = (vy * out_x - vx * out_y) / rho - omega[:, None] * rho
    return depth, depth * (d.c1 * depth + d.c2) + d.b * rate, slip


def in_general_position(drive: Drive, start: np.ndarray) -> np.ndarray:
    """A state near the start, no step from which meets a kink.

    All is moved at random: links are on the pulleys and off them, pressed and pulled, and slip
    either way. mu is zero where the oracle has none.
    """
    scale = lengths(drive)
    steps = []
    for part in range(len(NAMES)):  # of all links at once: the gaps of one are its own
        step = np.zeros(start.size)
        drive.split(step)[part][:] = STEP * drive.split(scale)[part]
        steps += [step, -step]
    for seed in range(100):
        y = start + AWAY * scale * np.random.default_rng(seed).uniform(-1.0, 1.0, start.size)
        here = np.signbit(gaps(drive, y))
        on = ~here[0].all(axis=0)
        drive.split(y)[FIELDS.index("mu")][~on | (drive.sigma == 0.0)] = 0.0
        if all(np.array_equal(np.signbit(gaps(drive, y + step)), here) for step in steps):
            return y
    raise AssertionError("no state was found that is off all kinks")


def terms(drive: Drive, y: np.ndarray) -> np.ndarray:
    """What each row of f is a sum of; of stiff parts the coordinates, as they are rounded."""
    d = drive
    x, y_, phi, vx, vy, vphi, mu, _, omega = (float(np.max(np.abs(v))) for v in d.split(y))
    radius = float(np.max(d.radius))
    place = max(x, y_) + float(np.max(np.abs(d.center))) + radius + d.half
    speed = max(vx, vy) + d.half * vphi
    deep = max(0.0, float(np.max(gaps(d, y)[0])))
    pull = 4.0 * (d.c_tra * place + d.b_tra * speed)
    push = (1.0 + mu) * ((2.0 * d.c1 * deep + d.c2) * place + d.b * speed)
    bending = 4.0 * (d.c_tor * (phi + abs(d.winding)) + d.b_tor * vphi)
    force = (pull + push) / d.mass + float(np.max(np.abs(d.gravity)))
    sliding = d.sigma * (speed + radius * omega) * (1.0 + mu / d.mu_k)
    torque = np.max(np.abs(d.torque)) + d.viscous * omega + d.n * radius * push
    found = d.per_variable(
        {"x": speed, "y": speed, "phi": vphi, "vx": force, "vy": force,
         "vphi": (d.half * pull + bending) / d.inertia, "mu": sliding + DECAY * mu,
         "theta": omega, "omega": torque / d.pulley_inertia}
    )  # fmt: skip
    return np.maximum(found, np.finfo(float).tiny / ROUNDING)
