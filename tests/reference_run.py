"""The oracle run: `reference.Reference` integrated by SciPy, lost contacts located as events.

And its frictionless equilibrium, by Newton's method.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import scipy.integrate
import scipy.optimize
from reference import Array, Reference, Torque
from reference_mounts import Sprung


@dataclasses.dataclass(frozen=True)
class Run:
    """What `integrate` returns: states (n_t, size) at `t`, and counts."""

    t: Array
    y: Array
    nfev: int
    steps: int
    resets: list[tuple[float, int, int]]  # (time, pulley, link) of every lost contact
    mu_excess: float  # how far |mu| was above its law's bound at any output before clipping


def error_weights(model: Reference, y0: Array, tol: float, stretch: float | None = None) -> Array:
    """Vector `atol` for SciPy: absolute weights on the scale that matters, the joint's stretch.

    `tol` times: mean stretch of the joints at y0 for x, y; stretch/(l0/2) for phi; 0.1 m/s and
    0.1/(l0/2) for their rates; 1e-3 rad for theta; 1 rad/s for omega; for mu 1, or for the state of
    a law that is no coefficient what makes friction as large as the normal force at that stretch;
    of mounts what moves the axis by the stretch, or at 0.1 m/s, and 1 for the share of friction.
    SciPy takes the RMS of error/weight; weights over sqrt(n) make a max norm of it: no link hides
    in the average. Slip displacements and the ledger, which drive nothing, have huge weights.
    """
    if stretch is None:
        stretch = max(float(np.mean(model.joints(y0)[0])), 1e-4 * model.l0)
    half = 0.5 * model.l0
    weights = np.full(model.size, 1e30)
    links, pulleys, memory = model.links(weights), model.pulleys(weights), model.memory(weights)
    units = np.array([1.0, 1.0, 1.0 / half])[: model.freedoms, None]
    links[0], links[1] = stretch * units, 0.1 * units
    pulleys[0], pulleys[1] = 1e-3, 1.0
    for j, law in enumerate(model.laws):
        pressure = model.c_tra * stretch / model.radii[j]
        memory[:-1, j] = 1.0
        if law is not None:
            memory[: law.n_states, j] = law.scale(pressure)
    travel, rate, share = model.mount_states(weights)
    for m, (j, one) in enumerate(model.mounts.items()):
        if isinstance(one, Sprung):
            reach = float(np.linalg.norm(one.lever(0.0, model.centers[j])))
            travel[m], rate[m], share[m] = stretch / reach, 0.1 / reach, 1.0
    return tol * weights / math.sqrt(model.size)


def integrate(
    model: Reference,
    y0: Array,
    torque: Torque,
    t_eval: npt.ArrayLike,
    *,
    tol: float = 1e-6,
    method: str = "DOP853",
    breakpoints: Sequence[float] = (),
    t0: float | None = None,
    rtol: float = 100 * np.finfo(float).eps,
    atol: Array | None = None,
    max_step: float = np.inf,
) -> Run:
    """Integrate with a solver of `scipy.integrate` and return the states at `t_eval`.

    From `y0` at `t0` (default: t_eval[0]), with absolute weights `atol`. A pair that holds memory
    and lost contact in a step (section 4), also in a dip within it, is traced back on the dense
    output: there mu and slip become 0 and the solver starts anew. So is the stop of a mount that is
    reached or left, and so it does at each of `breakpoints`, up to which the limit from the left is
    used.
    """
    times = np.atleast_1d(np.asarray(t_eval, dtype=float))
    if np.any(np.diff(times) <= 0):
        raise ValueError("t_eval must increase")
    t = float(times[0]) if t0 is None else float(t0)
    if times[0] < t:
        raise ValueError("t_eval begins before t0")
    if not np.array_equal(model.follow(t, y0), y0):
        raise ValueError("the motion begins at another speed than the prescribed one")
    weights = error_weights(model, y0, tol) if atol is None else atol
    make_solver = getattr(scipy.integrate, method)
    end = float(times[-1])
    stops = [*sorted({float(b) for b in breakpoints if t < b < end}), end]

    y = model.forget(y0)
    held = model.stop_depths(y) > 0
    out = np.empty((len(times), model.size))
    filled = 0
    if times[0] == t:
        out[0], filled = y, 1
    nfev = steps = 0
    resets: list[tuple[float, int, int]] = []
    first_step: float | None = None
    for stop in stops:
        latest = float(np.nextafter(stop, -np.inf))

        def fun(time: float, state: Array, latest: float = latest) -> Array:
            return model.rhs(min(time, latest), state, torque, held)

        while t < stop:
            # One solver lives until a contact is lost, a mount's stop or the end is reached.
            room = stop - t
            solver = make_solver(
                fun,
                t,
                y,
                stop,
                rtol=rtol,
                atol=weights,
                max_step=max_step,
                first_step=None if first_step is None else min(first_step, room),
            )
            lost: list[tuple[int, int]] = []
            edge = np.zeros_like(held)
            while solver.status == "running" and not lost and not edge.any():
                t_old, y_old = t, y
                message = solver.step()
                if solver.status == "failed":
                    raise RuntimeError(f"{method} failed at t = {t_old!r}: {message}")
                steps += 1
                t, y = float(solver.t), np.array(solver.y)
                if not np.all(np.isfinite(y)):
                    raise RuntimeError(f"state is not finite after t = {t_old!r}")
                dense = None
                edge = held != (model.stop_depths(y) > 0)
                if edge.any():
                    dense = solver.dense_output()
                    t, y = _locate_stop(model, dense, t_old, t, np.argwhere(edge))
                suspects = _suspects(model, t - t_old, y_old, y)
                if suspects:
                    dense = solver.dense_output() if dense is None else dense
                    t, y, lost = _locate_lost(model, dense, t_old, t, y, suspects)
                    resets += [(t, j, i) for j, i in lost]
                upto = int(np.searchsorted(times, t, side="left"))
                if upto > filled:
                    dense = solver.dense_output() if dense is None else dense
                    out[filled:upto] = dense(times[filled:upto]).T
                    filled = upto
                if filled < len(times) and times[filled] == t:
                    out[filled] = y
                    filled += 1
                held[:] = model.stop_depths(y) > 0
            nfev += solver.nfev
            first_step = getattr(solver, "h_abs", None)
        first_step = None
    # Inside a step that makes contact, the interpolant gives mu a value before there is one.
    out = model.forget(out)
    out = model.follow(times, out)
    excess = 0.0
    for j, law in enumerate(model.laws):
        if law is not None:
            mu = model.memory(out)[:, :-1, j]
            excess = max(excess, float(np.max(np.abs(mu))) - law.bound)
            np.clip(mu, -law.bound, law.bound, out=mu)
    if model.mounts:
        share = model.mount_states(out)[:, 2]
        excess = max(excess, float(np.max(np.abs(share))) - 1.0)
        np.clip(share, -1.0, 1.0, out=share)
    return Run(times, out, nfev, steps, resets, excess)


def _locate_stop(
    model: Reference, dense: Callable[[float], Array], t_old: float, t_new: float, found: Array
) -> tuple[float, Array]:
    """First time at which one of these stops (mount, side) is reached or left; the state there."""
    first = t_new
    for pair in found:

        def depth(time: float, pair: tuple[int, int] = tuple(pair)) -> float:
            return float(model.stop_depths(dense(time))[pair])

        before, after = depth(t_old) > 0, depth(t_new) > 0
        if before != after and depth(t_old) != 0:
            time = float(scipy.optimize.brentq(depth, t_old, t_new, xtol=1e-15, rtol=1e-15))
            nudge = np.spacing(time)
            while time < t_new and (depth(time) > 0) != after:
                time = min(time + nudge, t_new)
                nudge *= 2
            first = min(first, time)
    return first, dense(first)


def _penetration_rate(model: Reference, y: Array) -> Array:
    return model.contacts(y).rate


def _suspects(model: Reference, h: float, y_old: Array, y_new: Array) -> list[tuple[int, int]]:
    """Pairs (pulley, link) that may have lost contact between two states, h apart."""
    held = np.any(model.memory(y_new) != 0, axis=0)
    p_old, p_new = model.penetration(y_old), model.penetration(y_new)
    found = held & (p_new <= 0)
    # A dip: p > 0 at both ends, falling then rising, and the two end tangents meet below 0. (p is
    # convex in a dip, so it lies above them.) Only pairs near their edge are worth the look.
    near = held & (p_new > 0) & (p_old > 0)
    near &= np.minimum(p_old, p_new) < 2 * h * np.abs(model.points(y_new)[1]).max()
    if near.any():
        rate_old, rate_new = _penetration_rate(model, y_old), _penetration_rate(model, y_new)
        dip = near & (rate_old < 0) & (rate_new > 0)
        if dip.any():
            turn = (p_new - p_old - rate_new * h) / np.where(dip, rate_old - rate_new, 1.0)
            found |= dip & (p_old + rate_old * turn <= 0)
    return [(int(j), int(i)) for j, i in np.argwhere(found)]


def _locate_lost(
    model: Reference,
    dense: Callable[[float], Array],
    t_old: float,
    t_new: float,
    y_new: Array,
    suspects: list[tuple[int, int]],
) -> tuple[float, Array, list[tuple[int, int]]]:
    """First time a suspect's p reaches 0 from above; the state there, its memory forgotten."""
    first, y_first = t_new, y_new
    for pair in suspects:

        def p(time: float, pair: tuple[int, int] = pair) -> float:
            return float(model.penetration(dense(time))[pair])

        low = t_new
        if p(t_old) <= 0:  # touched and left within the step: no force is left, forget at its end
            continue
        if model.penetration(y_new)[pair] > 0:
            best = scipy.optimize.minimize_scalar(
                p,
                bounds=(t_old, t_new),
                method="bounded",
                options={"xatol": 1e-4 * (t_new - t_old)},
            )
            low = float(best.x)
            if best.fun > 0:
                continue
        elif p(t_new) > 0:  # the interpolant misses the end of the step by rounding
            continue
        time = float(scipy.optimize.brentq(p, t_old, low, xtol=1e-15, rtol=1e-15))
        # Stop on the lost side of the root, or contact would begin anew there.
        nudge = np.spacing(time)
        while time < low and p(time) > 0:
            time = min(time + nudge, low)
            nudge *= 2
        if time < first:
            first, y_first = time, dense(time)
    p_first = model.penetration(y_first)
    held = np.any(model.memory(y_first) != 0, axis=0)
    lost = [(int(j), int(i)) for j, i in np.argwhere(held & (p_first <= 0))]
    return first, model.forget(y_first), lost


def settle(model: Reference, y0: Array, *, tol: float = 1e-9, iterations: int = 300) -> Array:
    """Find the belt at rest without friction, near y0 (what the paper calls stabilised).

    Newton's method with Levenberg's damping (the belt slides along its path, contact jumps); energy
    must fall, so that it ends at a minimum. Ends when no force on a link exceeds `tol` times
    EA/1000. Motions and laws of pulleys are left out; paths stay where y0 has them.
    """
    model = dataclasses.replace(model, friction=None, motion={})
    y = np.array(y0, dtype=float)
    model.links(y)[1] = 0.0
    model.pulleys(y)[1] = 0.0
    model.memory(y)[:] = 0.0
    model.ledger(y)[:] = 0.0
    model.mount_states(y)[1:] = 0.0
    n_b, rows, half = model.n_bodies, model.freedoms, 0.5 * model.l0
    n = rows * n_b
    unit = np.repeat([1.0, 1.0, 1.0 / half][:rows], n_b)  # phi as the shift of a link's end
    inertia = np.repeat([model.mass, model.mass, model.inertia / half][:rows], n_b)
    no_torque = np.zeros(model.n_pulleys)
    # travel as the shift of the axis
    sprung = [m for m, one in enumerate(model.mounts.values()) if isinstance(one, Sprung)]
    for m in sprung:
        j = model.mounted[m]
        one = model.mounts[j]
        reach = float(np.linalg.norm(one.lever(0.0, model.centers[j])))
        unit, inertia = np.append(unit, 1.0 / reach), np.append(inertia, one.moved / reach)

    def residual(q: Array) -> Array:
        y[:n] = (q * unit)[:n]
        model.mount_states(y)[0, sprung] = (q * unit)[n:]
        rates = model.rhs(0.0, y, lambda *_: no_torque)
        moved = model.mount_states(rates)[1, sprung]
        return np.concatenate((rates[n : 2 * n], moved)) * inertia

    def stiffness(q: Array) -> Array:
        """-d residual / dq; links three apart share no neighbour, so they are moved together."""
        h = 1e-6 * model.l0
        matrix = np.zeros((rows, n_b, rows, n_b))
        whole = n_b - n_b % 3
        groups = [np.arange(k, whole, 3) for k in range(3)] + [
            np.array([k]) for k in range(whole, n_b)
        ]
        for group in groups:
            for row in range(rows):
                shift = np.zeros((rows, n_b))
                shift[row, group] = h
                moved = np.append(shift, np.zeros(len(sprung)))
                change = (residual(q - moved) - residual(q + moved))[:n]
                for offset in (-1, 0, 1):
                    at = (group + offset) % n_b
                    matrix[:, at, row, group] = change.reshape(rows, n_b)[:, at] / (2 * h)
        whole_matrix = np.zeros((len(unit), len(unit)))
        whole_matrix[:n, :n] = matrix.reshape(n, n)
        for k in range(n, len(unit)):  # forces have a potential: rows are columns
            moved = h * np.eye(len(unit))[k]
            change = (residual(q - moved) - residual(q + moved)) / (2 * h)
            whole_matrix[:, k] = whole_matrix[k] = change
        return whole_matrix

    q = np.append(y[:n], model.mount_states(y)[0, sprung]) / unit
    force, energy = residual(q), float(model.energy(y))
    target = tol * 1e-3 * model.axial_stiffness
    damping = 1e-2 * model.c_tra
    for _ in range(iterations):
        if np.abs(force).max() <= target:
            residual(q)
            return y
        k = stiffness(q)
        k = 0.5 * (k + k.T)
        for _ in range(30):
            q_new = q + np.linalg.solve(k + damping * np.eye(len(q)), force)
            force_new, energy_new = residual(q_new), float(model.energy(y))
            flat = abs(energy_new - energy) <= 1e-12 * abs(energy)
            quieter = np.linalg.norm(force_new) < np.linalg.norm(force)
            if (flat and quieter) or (not flat and energy_new < energy):
                q, force, energy, damping = q_new, force_new, energy_new, 0.1 * damping
                break
            damping *= 5
        else:
            break
    if np.abs(force).max() > 100 * target:
        raise RuntimeError(f"no equilibrium found: {np.abs(force).max():.3g} N left")
    residual(q)
    return y
