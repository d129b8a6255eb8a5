"""Starts, Jacobian, natural frequencies and runs of the oracle of the ALE belt."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize
from ale_reference import Ale
from reference_friction import Array, Dahl, LuGre


def scales(model: Ale) -> Array:
    """Size of each unknown by which differences and errors are measured."""
    wave = np.sqrt(model.axial_stiffness * model.linear_density)
    speed = model.h_0 / wave
    y = model.pack()
    geo = model.geometry(0.0, model.pack(q=model.q_0))
    m = np.empty(model.n)
    m[model.spans] = geo.span
    of = model.arc_pulley
    m[model.arcs] = (model.radii * geo.wrap / model.on)[of]
    z = np.ones((model.n_z, 2, len(model.arcs)))
    for j, law in enumerate(model.friction):
        if law is not None and not isinstance(law, Dahl | LuGre):
            z[..., model.on_arc[j]] = np.reshape(law.scale(model.h_0 / model.radii[j]), (-1, 1, 1))
    lateral = np.sqrt(model.h_0 / model.linear_density)
    a = 1e-3 * geo.span[:, None] * np.ones(model.n_modes)
    lever = [float(np.hypot(*model.mounts[j].lever(0.0, model.centers[j]))) for j in model.sprung]
    lever = np.array(lever)
    length = float(m.sum())
    y = model.pack(
        m=m * model.h_0 / model.axial_stiffness, v=speed, z=z, a=a,
        p=a * np.pi / geo.span[:, None] * lateral,
        along=(geo.span * model.h_0 / model.axial_stiffness / np.pi)[: model.n_along],
        along_speed=speed, theta=speed / model.radii * 1e-2, omega=speed / model.radii, zeta=1.0,
        works=1.0,
    )  # fmt: skip
    if model.n_m:
        y = y + model.pack(q=1e-3 * length / lever, dq=speed / lever)
    return y


def jacobian(model: Ale, t: float, y: Array, central: bool = False, eps: float = 1e-6) -> Array:
    """df/dy by differences, all columns in one call."""
    h = eps * scales(model)
    step = np.diag(h)
    up = model.rate(t, y + step)
    down = model.rate(t, y - step) if central else model.rate(t, y)
    return ((up - down) / ((2.0 if central else 1.0) * h)[:, None]).T


def at_rest(model: Ale) -> Array:
    """Everything stands, friction forgotten: one force H along the belt, mounts in balance."""
    return at_speed(model, 0.0)


def lay(model: Ale, h: float, flow: float, q: Array) -> Array:
    """The belt with this force H in its spans and this flow, v = J lambda, without friction."""
    y = model.pack(q=q)
    geo = model.geometry(0.0, y)
    ea, rho, of = model.axial_stiffness, model.linear_density, model.arc_pulley
    m, v = np.empty(model.n), np.empty(model.n)
    stretch = 1.0 + h / ea
    for _ in range(50):  # T = H + rhoA J^2 lambda
        stretch = 1.0 + (h + rho * flow**2 * stretch) / ea
    force = np.full(model.n_p, h)
    x, _ = model.run_off(force, geo.span)
    m[model.spans] = (geo.span + x) / stretch
    angle = (geo.wrap / model.on)[of]
    # on an arc EA (lambda - 1) + EI theta'^2 / (2 m^2 lambda~) - rhoA J^2 lambda is that of a span
    low = np.full(len(of), stretch)
    r = (model.radii + model.compensated)[of]
    bends = 0.5 * model.bending_stiffness
    cells = r * angle / low
    for _ in range(50):
        sink, length = model._arc_cells(cells, angle, flow * low)
        at_end = 0.5 * (stretch + low)  # lambda of the node between span and arc
        stored = bends * (angle / cells) ** 2 - model.pressed(sink)
        tension = h + rho * flow**2 * low - stored / at_end
        # node equation: EA (low^2 - stretch^2)/2 / at_end = EA (low - stretch)
        low = 1.0 + tension / ea
        cells = length / low
    m[model.arcs] = cells
    v[:] = flow * stretch
    lam = np.empty(model.n)
    lam[model.spans], lam[model.arcs] = stretch, low
    v = flow * 0.5 * (lam + lam[model.before])
    a = model.rest_modes(force, geo.span)[0] - model.offset(geo.span)
    ends = 2.0 / np.pi * (v[model.spans] + v[model.ends])
    return model.pack(m=m, v=v, a=a, q=q, along_speed=ends[: model.n_along])


def at_speed(model: Ale, speed: float, pulley: int = 0) -> Array:
    """The belt runs, sum of m its length, mounts in balance; pulleys turn with it. omega [rad/s]"""
    sense = model.sense * model.s[pulley]

    def state(unknown: Array) -> Array:
        h, flow = model.h_0 * unknown[0], unknown[1]
        return lay(model, h, flow * wave, model.q_0 + unknown[2:] * unit)

    lever = [float(np.hypot(*model.mounts[j].lever(0.0, model.centers[j]))) for j in model.sprung]
    unit = 1e-3 * model.length / np.array(lever) if lever else np.zeros(0)
    wave = np.sqrt(model.h_0 / model.linear_density)
    rows = model.layout["dq"][0]

    def misfit(unknown: Array) -> Array:
        y = state(unknown)
        y = turning(model, y)
        omega = model.get(y, "omega")
        short = (model.get(y, "m").sum() / model.length - 1.0) * model.axial_stiffness / model.h_0
        fast = (omega[pulley] - speed) * model.radii[pulley] / wave
        balance = model.rate(0.0, y)[rows]
        inertia = np.array([model.mounts[j].moved for j in model.sprung])
        return np.concatenate(([short, fast], balance * inertia / (model.h_0 * np.array(lever))))

    first = np.concatenate(([1.0, speed * model.radii[pulley] * sense / wave], np.zeros(model.n_m)))
    found = scipy.optimize.root(misfit, first, tol=1e-13)
    assert np.abs(misfit(found.x)).max() < 1e-9, found
    return turning(model, state(found.x))


def turning(model: Ale, y: Array) -> Array:
    """With the pulleys at the speed of the belt on them, no slip."""
    y = y.copy()
    ax = model.axial(y, model.geometry(0.0, y))
    rho = (model.radii + model.compensated)[model.arc_pulley] - ax.sink
    v = 0.5 * (ax.slid + ax.slid[model.next])[model.arcs]
    omega = [(v / rho)[model.on_arc[j]].mean() for j in range(model.n_p)]
    y[model.layout["omega"][0]] = model.sense * model.s * np.array(omega)
    return y


def frequencies(
    model: Ale, y: Array, t: float = 0.0, held: Sequence[int] = ()
) -> tuple[Array, Array]:
    """Eigenvalues of the Jacobian with positive imaginary part, by frequency [Hz]; their decay."""
    jac = jacobian(model, t, y, central=True)
    out = np.r_[model.layout["works"][0], model.layout["theta"][0]]
    omega = np.arange(model.size)[model.layout["omega"][0]]
    out = np.concatenate((out, omega[list(held)]))
    keep = np.setdiff1d(np.arange(model.size), out)
    scale = scales(model)[keep]
    values = np.linalg.eigvals(jac[np.ix_(keep, keep)] * scale / scale[:, None])
    values = values[values.imag > 2.0 * np.pi]
    values = values[np.argsort(values.imag)]
    return values.imag / (2.0 * np.pi), values.real


RODAS_A = (
    (1.544,), (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0),
)  # fmt: skip
RODAS_C = (
    (-5.6688,), (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136,
     -6.058818238834054),
)  # fmt: skip
RODAS_TIME = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
RODAS_SLOPE = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0)
RODAS_DENSE = np.array([
    [10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823,
     1.025137723295662, 0.0],
    [-0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386,
     -6.594389125716872, 0.0],
])  # fmt: skip
"""RODAS of E. Hairer and G. Wanner, Solving ODEs II, IV.7, order 4(3), gamma = 1/4."""


@dataclass
class Run:
    """States at the times asked for, and what they cost."""

    states: Array
    steps: int
    rejected: int


def run(
    model: Ale, y: Array, times: Sequence[float], rtol: float = 1e-2, first: float = 1e-5
) -> Run:
    """By rodas4, W of the ends of wraps frozen over each step, errors against `scales`."""
    scale, size = scales(model), model.size
    groups = error_groups(model)
    model = copy.copy(model)
    t, h, times = float(times[0]), first, np.asarray(times)
    states, at = [y], 1
    hold(model, y, t)
    done = rejected = 0
    fresh, renewed = False, t
    while at < len(times):
        if not fresh:
            before = model.held
            hold(model, y, t)
            y = relaid(model, y, before, t - renewed)
            renewed = t
            rate, jac = model.rate(t, y), jacobian(model, t, y)
            by_time = (model.rate(t + 1e-8, y) - rate) / 1e-8
            fresh = True
        matrix = scipy.linalg.lu_factor((np.eye(size) / (0.25 * h) - jac) * scale / scale[:, None])
        u: list[Array] = []
        middle = y
        for s in range(6):
            if s:
                middle = y + sum(a * one for a, one in zip(RODAS_A[s - 1], u, strict=True))
                right = model.rate(t + RODAS_TIME[s] * h, middle)
                right = right + sum(c / h * one for c, one in zip(RODAS_C[s - 1], u, strict=True))
            else:
                right = rate
            right = right + h * RODAS_SLOPE[s] * by_time
            u.append(scipy.linalg.lu_solve(matrix, right / scale) * scale)
        error = max(np.sqrt(np.mean((u[5][one] / scale[one]) ** 2)) for one in groups) / rtol
        if not np.isfinite(error):
            error = 1e9
        if error > 1.0:
            h *= max(0.1, 0.9 * error**-0.25)
            rejected += 1
            if h < 1e-10:
                raise ArithmeticError(f"step {h:.1e} at {t}")
            continue
        full = np.array([*RODAS_A[4], 1.0])
        while at < len(times) and times[at] <= t + h * (1.0 + 1e-12):
            x = (times[at] - t) / h
            b = x * (full + (1.0 - x) * (RODAS_DENSE[0] + x * RODAS_DENSE[1]))
            states.append(y + b @ np.array(u))
            at += 1
        y, t, done = bounded(model, middle + u[5]), t + h, done + 1
        for j, motion in model.motion.items():
            y[model.layout["omega"][0].start + j] = motion(t)[0]
        h *= min(5.0, max(0.2, 0.9 * max(error, 1e-8) ** -0.25))
        fresh = False
    found = np.array(states)
    for j, motion in model.motion.items():
        found[:, model.layout["omega"][0].start + j] = [motion(one)[0] for one in times]
    return Run(found, done, rejected)


def hold(model: Ale, y: Array, t: float = 0.0) -> None:
    """Freeze W of the ends of wraps as this state has it, and what waves are."""
    geo = model.geometry(t, y)
    object.__setattr__(model, "held", None)
    ax = model.axial(y, geo)
    waves = model.waves_of(ax.pressing[..., model.spans], geo.span)
    object.__setattr__(model, "held", ax.held)
    object.__setattr__(model, "waves", dataclasses.replace(waves, rolled=ax.waves.rolled))


def relaid(model: Ale, y: Array, before: Array, elapsed: float) -> Array:
    """Belt that lifts off a pulley forgets its friction. What comes to lie of a cell has the states
    of its neighbour as far as the flow has brought it, else 0; states of the cell are the linear
    ones of the same mean and first moment.
    """
    y, ax = y.copy(), model.axial(y, model.geometry(0.0, y))
    z, of = model.get(y, "z").copy(), model.arc_pulley
    cells, next_ = model.arcs, model.next[model.arcs]
    whole = (model.radii * model.geometry(0.0, y).wrap / model.on)[of]
    flown = 0.5 * (ax.past[cells] + ax.past[next_]) * elapsed / whole
    for on in model.on_arc.values():
        order = range(on.start, on.stop)
        for c in reversed(order) if ax.past[cells[on.start]] < 0.0 else order:
            (was_0, was_1), (now_0, now_1) = before[1, :, c], model.held[1, :, c]
            left, right = (
                max(now_0, was_0 + min(0.0, flown[c])),
                min(now_1, was_1 + max(0.0, flown[c])),
            )
            if now_1 == now_0:
                z[:, :, c] = 0.0
            elif was_1 == was_0:
                other = c - 1 if flown[c] > 0.0 else c + 1
                comes = z[:, 1 if flown[c] > 0.0 else 0, other] if other in order else 0.0
                z[:, :, c] = np.reshape(comes * min(1.0, abs(flown[c]) / (now_1 - now_0)), (-1, 1))
            else:
                slope = (z[:, 1, c] - z[:, 0, c]) / (was_1 - was_0)
                a, b = z[:, 0, c] + slope * (left - was_0), z[:, 0, c] + slope * (right - was_0)
                begin, end = (np.array((left, right)) - now_0) / (now_1 - now_0)
                part = end - begin  # moments by what a linear function has on begin to end
                mean = 0.5 * part * (a + b)
                first = part * (begin * 0.5 * (a + b) + part * (a / 6.0 + b / 3.0))
                z[:, 0, c], z[:, 1, c] = 4.0 * mean - 6.0 * first, 6.0 * first - 2.0 * mean
    y[model.layout["z"][0]] = z.ravel()
    return y


def error_groups(model: Ale) -> list[Array]:
    """Unknowns of which the worst rms is the error of a step."""
    every = {name: np.arange(model.size)[where] for name, (where, _) in model.layout.items()}
    of_spans = np.concatenate((every["m"][model.spans], every["v"][model.spans],
                               every["v"][model.ends], every["along"],
                               every["along_speed"]))  # fmt: skip
    held = [every["omega"][j] for j in model.motion]
    border = np.setdiff1d(
        np.concatenate([every[one] for one in ("omega", "q", "dq", "zeta")]), held
    )
    arcs = np.concatenate((every["m"], every["v"], every["z"]))
    groups = [np.setdiff1d(arcs, of_spans), of_spans]
    groups += [np.concatenate((every["a"], every["p"])), border]
    return [one for one in groups if len(one)]


def bounded(model: Ale, y: Array) -> Array:
    """With z of laws that have a bound within it, as at the end of any step."""
    y = y.copy()
    z = model.get(y, "z").copy()
    for j, law in enumerate(model.friction):
        if law is not None and np.isfinite(law.bound) and law.bound > 0.0:
            on = model.on_arc[j]
            z[..., on] = np.clip(z[..., on], -law.bound, law.bound)
    y[model.layout["z"][0]] = z.ravel()
    return y


def steady(model: Ale, y: Array, first: float = 1e-3, n: int = 60, tol: float = 1e-9) -> Array:
    """A steady state by implicit Euler, its step four times as long each time."""
    scale = scales(model)
    held = np.r_[model.layout["works"][0], model.layout["theta"][0]]
    free = np.setdiff1d(np.arange(model.size), held)
    h = first
    for k in range(n):
        rate = model.rate(0.0, y)[free]
        jac = jacobian(model, 0.0, y)[np.ix_(free, free)] * scale[free] / scale[free, None]
        step = np.linalg.solve(np.eye(len(free)) / h - jac, rate / scale[free])
        most = np.abs(step).max()
        y = y.copy()
        y[free] += step * scale[free]
        y = bounded(model, y)
        cuts = model.axial(y, model.geometry(0.0, y)).cuts  # what does not lie has no friction
        y[model.layout["z"][0]] = (model.get(y, "z") * (cuts[1] > cuts[0])).ravel()
        h = min(h * 4.0, 1e6)
        if most < tol and h > 1.0:
            steady.steps = k + 1  # type: ignore[attr-defined]
            return y
    raise ArithmeticError(f"no steady state: last step {most:.1e}")
