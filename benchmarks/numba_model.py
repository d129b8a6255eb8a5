"""The drive's equations of motion and their Jacobian in Numba: scalar loops, compiled.

For `peers.py`, so that a general integrator is slowed neither by Python nor by a Jacobian from
differences. The equations are those of `numpy_model.py`; the state vector is ordered link by link,
``x, y, phi, vx, vy, vphi, mu`` of one link side by side, then theta and omega of all pulleys. With
``fold`` the ring's links are numbered 0, n-1, 1, n-2, ..., which makes the Jacobian banded, but
for the pulleys' rows and columns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import scipy.sparse
from numpy_model import DECAY, FIELDS, Drive

WIDTH = len(FIELDS)
#: Half the bandwidth with ``fold``: neighbours stand two blocks apart.
BAND = 3 * WIDTH - 1
#: Jacobian entries of a joint, of a contact pair, of a link on its own, of a pulley.
_PER_JOINT, _PER_PAIR, _PER_LINK, _PER_PULLEY = 12 * 6, 5 * 4 + 1, 4, 2


@dataclass(frozen=True, eq=False)
class Compiled:
    """A drive's compiled functions and the order of its state vector."""

    order: np.ndarray  # place in NumPy's state vector of each entry of this one
    rhs_into: Any  # (t, y, dy)
    rhs: Any  # (t, y) -> dy
    data_into: Any  # (t, y, data): the Jacobian's entries, in the order of `pattern`
    pattern: scipy.sparse.csc_matrix
    banded: tuple[np.ndarray, ...]  # those entries within the band: which, row, column

    def jacobian(self, t: float, y: np.ndarray) -> scipy.sparse.csc_matrix:
        data = np.empty(self.pattern.nnz)
        self.data_into(t, y, data)
        return scipy.sparse.csc_matrix(
            (data, self.pattern.indices, self.pattern.indptr), shape=self.pattern.shape
        )

    def packed(self, t: float, y: np.ndarray) -> np.ndarray:
        """The entries within the band as LAPACK and LSODA pack them."""
        data = np.empty(self.pattern.nnz)
        self.data_into(t, y, data)
        which, row, column = self.banded
        matrix = np.zeros((2 * BAND + 1, y.size))
        matrix[row - column + BAND, column] = data[which]
        return matrix


def compiled(drive: Drive, fold: bool = False) -> Compiled:
    """Compile right-hand side and Jacobian with a drive's numbers as constants."""
    d, n, n_p = drive, drive.n, drive.n_p
    place = np.arange(n)
    if fold:
        place = np.minimum(2 * place, 2 * (n - 1 - place) + 1)
    at = WIDTH * place
    end = WIDTH * n
    order = np.empty(d.size, dtype=np.int64)
    for k in range(WIDTH):
        order[at + k] = k * n + np.arange(n)
    order[end:] = np.arange(end, d.size)

    half, mass, inertia = d.half, d.mass, d.inertia
    c_tra, b_tra, c_tor, b_tor, winding = d.c_tra, d.b_tra, d.c_tor, d.b_tor, d.winding
    center_x, center_y, radius = d.center[:, 0].copy(), d.center[:, 1].copy(), d.radius
    c1, c2, b, mu_k, sigma = d.c1, d.c2, d.b, d.mu_k, d.sigma
    gravity_x, gravity_y = d.gravity
    knots, torque, slope = d.knots, d.torque, d.slope
    viscous, pulley_inertia = d.viscous, d.pulley_inertia
    decay = DECAY

    @numba.njit(error_model="numpy")
    def rhs_into(t, y, dy):
        now = max(np.searchsorted(knots, t, side="right") - 1, 0)
        since = max(t - knots[now], 0.0)
        for p in range(n_p):
            omega = y[end + n_p + p]
            dy[end + p] = omega
            dy[end + n_p + p] = (torque[now, p] + slope[now, p] * since - viscous[p] * omega) / (
                pulley_inertia[p]
            )
        for i in range(n):
            k = at[i]
            x, y_, vx, vy, mu = y[k], y[k + 1], y[k + 3], y[k + 4], y[k + 6]
            force_x = force_y = 0.0
            mu_rate = -decay * mu
            for p in range(n_p):
                dx, dy_ = x - center_x[p], y_ - center_y[p]
                square = dx * dx + dy_ * dy_
                if square < radius[p] * radius[p]:
                    rho = math.sqrt(square)
                    ux, uy = dx / rho, dy_ / rho
                    depth = radius[p] - rho
                    total = depth * (c1 * depth + c2) - b * (vx * ux + vy * uy)
                    normal = max(total, 0.0)
                    friction = mu * normal
                    slip = vy * ux - vx * uy - y[end + n_p + p] * rho
                    force_x += normal * ux + friction * uy
                    force_y += normal * uy - friction * ux
                    dy[end + n_p + p] += friction * rho / pulley_inertia[p]
                    mu_rate = sigma * (slip - abs(slip) * mu / mu_k)
            dy[k], dy[k + 1], dy[k + 2] = vx, vy, y[k + 5]
            dy[k + 3], dy[k + 4] = force_x / mass + gravity_x, force_y / mass + gravity_y
            dy[k + 5], dy[k + 6] = 0.0, mu_rate
        a = at[n - 1]
        arm_xa, arm_ya = half * math.cos(y[a + 2]), half * math.sin(y[a + 2])
        closing = winding
        for i in range(n):
            k = at[i]
            arm_x, arm_y = half * math.cos(y[k + 2]), half * math.sin(y[k + 2])
            turn, turn_a = y[k + 5], y[a + 5]
            pull_x = c_tra * (y[k] - arm_x - y[a] - arm_xa) + b_tra * (
                y[k + 3] + arm_y * turn - y[a + 3] + arm_ya * turn_a
            )
            pull_y = c_tra * (y[k + 1] - arm_y - y[a + 1] - arm_ya) + b_tra * (
                y[k + 4] - arm_x * turn - y[a + 4] - arm_xa * turn_a
            )
            bending = c_tor * (y[k + 2] - y[a + 2] + closing) + b_tor * (turn - turn_a)
            closing = 0.0
            dy[k + 3] -= pull_x / mass
            dy[k + 4] -= pull_y / mass
            dy[k + 5] += (arm_x * pull_y - arm_y * pull_x - bending) / inertia
            dy[a + 3] += pull_x / mass
            dy[a + 4] += pull_y / mass
            dy[a + 5] += (arm_xa * pull_y - arm_ya * pull_x + bending) / inertia
            a, arm_xa, arm_ya = k, arm_x, arm_y

    @numba.njit
    def rhs(t, y):
        dy = np.empty_like(y)
        rhs_into(t, y, dy)
        return dy

    @numba.njit(error_model="numpy")
    def entries(y, row, column, value):
        """Rows, columns and values, always the same ones in the same order; they may repeat."""
        e = 0
        for p in range(n_p):
            row[e], column[e], value[e] = end + p, end + n_p + p, 1.0
            e += 1
            row[e], column[e] = end + n_p + p, end + n_p + p
            value[e] = -viscous[p] / pulley_inertia[p]
            e += 1
        pull = np.empty((12, 2))
        for i in range(n):
            k, a = at[i], at[i - 1]
            for j in range(3):
                row[e], column[e], value[e] = k + j, k + 3 + j, 1.0
                e += 1
            # The joint on the left: derivatives of its pull by the two links' x, y, phi, rates.
            cos, sin, turn = math.cos(y[k + 2]), math.sin(y[k + 2]), y[k + 5]
            cos_a, sin_a, turn_a = math.cos(y[a + 2]), math.sin(y[a + 2]), y[a + 5]
            pull[:] = 0.0
            pull[0, 0] = pull[1, 1] = c_tra
            pull[2, 0] = half * (c_tra * sin + b_tra * turn * cos)
            pull[2, 1] = half * (-c_tra * cos + b_tra * turn * sin)
            pull[3, 0] = pull[4, 1] = b_tra
            pull[5, 0], pull[5, 1] = half * b_tra * sin, -half * b_tra * cos
            pull[6, 0] = pull[7, 1] = -c_tra
            pull[8, 0] = half * (c_tra * sin_a + b_tra * turn_a * cos_a)
            pull[8, 1] = half * (-c_tra * cos_a + b_tra * turn_a * sin_a)
            pull[9, 0] = pull[10, 1] = -b_tra
            pull[11, 0], pull[11, 1] = half * b_tra * sin_a, -half * b_tra * cos_a
            pull_x = c_tra * (y[k] - y[a] - half * (cos + cos_a)) + b_tra * (
                y[k + 3] - y[a + 3] + half * (sin * turn + sin_a * turn_a)
            )
            pull_y = c_tra * (y[k + 1] - y[a + 1] - half * (sin + sin_a)) + b_tra * (
                y[k + 4] - y[a + 4] - half * (cos * turn + cos_a * turn_a)
            )
            for j in range(12):
                at_column = k + j if j < 6 else a + j - 6
                by_x, by_y = pull[j]
                bending = 0.0
                if j == 2:
                    bending = c_tor
                elif j == 8:
                    bending = -c_tor
                elif j == 5:
                    bending = b_tor
                elif j == 11:
                    bending = -b_tor
                moment = half * (cos * by_y - sin * by_x) - bending
                moment_a = half * (cos_a * by_y - sin_a * by_x) + bending
                if j == 2:
                    moment -= half * (sin * pull_y + cos * pull_x)
                elif j == 8:
                    moment_a -= half * (sin_a * pull_y + cos_a * pull_x)
                for r, v in (
                    (k + 3, -by_x / mass),
                    (k + 4, -by_y / mass),
                    (k + 5, moment / inertia),
                    (a + 3, by_x / mass),
                    (a + 4, by_y / mass),
                    (a + 5, moment_a / inertia),
                ):
                    row[e], column[e], value[e] = r, at_column, v
                    e += 1
            # Contact with each pulley: zeros where there is none.
            vx, vy, mu = y[k + 3], y[k + 4], y[k + 6]
            by_mu = -decay
            for p in range(n_p):
                dx, dy_ = y[k] - center_x[p], y[k + 1] - center_y[p]
                rho = math.sqrt(dx * dx + dy_ * dy_)
                ux, uy = dx / rho, dy_ / rho
                depth = radius[p] - rho
                touch = dx * dx + dy_ * dy_ < radius[p] * radius[p]
                out, along = vx * ux + vy * uy, vy * ux - vx * uy
                normal = depth * (c1 * depth + c2) - b * out
                press = touch and normal > 0.0
                if not press:
                    normal = 0.0
                slip = along - y[end + n_p + p] * rho
                to_slip = sigma * (1.0 - math.copysign(1.0, slip) * mu / mu_k) if touch else 0.0
                if touch:
                    by_mu = -sigma * abs(slip) / mu_k
                stiffness = 2.0 * c1 * depth + c2
                for j in range(5):
                    n_by = t_x = t_y = u_x = u_y = rho_by = slip_by = mu_by = 0.0
                    if j == 0:
                        n_by, rho_by = -stiffness * ux + b * along * uy / rho, ux
                        u_x, u_y = uy * uy / rho, -ux * uy / rho
                        t_x, t_y = uy * ux / rho, uy * uy / rho
                        slip_by = out * uy / rho - y[end + n_p + p] * ux
                    elif j == 1:
                        n_by, rho_by = -stiffness * uy - b * along * ux / rho, uy
                        u_x, u_y = -ux * uy / rho, ux * ux / rho
                        t_x, t_y = -ux * ux / rho, -ux * uy / rho
                        slip_by = -out * ux / rho - y[end + n_p + p] * uy
                    elif j == 2:
                        n_by, slip_by = -b * ux, -uy
                    elif j == 3:
                        n_by, slip_by = -b * uy, ux
                    else:
                        mu_by = 1.0
                    if not press:
                        n_by = 0.0
                    friction_by = mu * n_by + mu_by * normal
                    force_x = n_by * ux + friction_by * uy + normal * (u_x - mu * t_x)
                    force_y = n_by * uy - friction_by * ux + normal * (u_y - mu * t_y)
                    around = friction_by * rho + mu * normal * rho_by
                    at_column = k + (j if j < 2 else j + 1 if j < 4 else 6)
                    for r, v in (
                        (k + 3, force_x / mass),
                        (k + 4, force_y / mass),
                        (k + 6, to_slip * slip_by),
                        (end + n_p + p, around / pulley_inertia[p]),
                    ):
                        row[e], column[e], value[e] = r, at_column, v
                        e += 1
                row[e], column[e], value[e] = k + 6, end + n_p + p, -to_slip * rho
                e += 1
            row[e], column[e], value[e] = k + 6, k + 6, by_mu
            e += 1
        return e

    count = _PER_PULLEY * n_p + n * (_PER_LINK + _PER_JOINT + _PER_PAIR * n_p)
    rows, columns = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    if entries(np.ones(d.size), rows, columns, np.empty(count)) != count:
        raise AssertionError("the number of entries of the Jacobian is miscounted")
    # The diagonal belongs to every pattern: integrators factor I - h J.
    diagonal = np.arange(d.size)
    key, slots = np.unique(
        np.concatenate([columns * d.size + rows, diagonal * d.size + diagonal]), return_inverse=True
    )
    slots = slots[:count].copy()
    indptr = np.searchsorted(key // d.size, np.arange(d.size + 1))
    pattern = scipy.sparse.csc_matrix(
        (np.ones(key.size), (key % d.size).astype(np.int32), indptr.astype(np.int32)),
        shape=(d.size, d.size),
    )

    @numba.njit
    def data_into(t, y, data):
        value = np.empty(count)
        entries(y, np.empty(count, np.int64), np.empty(count, np.int64), value)
        data[:] = 0.0
        for e in range(count):
            data[slots[e]] += value[e]

    row, column = key % d.size, key // d.size
    within = np.flatnonzero(np.abs(row - column) <= BAND)
    banded = (within, row[within], column[within])
    return Compiled(order, rhs_into, rhs, data_into, pattern, banded)
