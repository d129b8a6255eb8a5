"""The oracle of the ALE belt in plain NumPy, from csrc/MODEL.md, section 11, alone.

It shares no line with the C core and imports nothing of beltdyn. Symbols, sides and senses are
those of MODEL.md; `[n]` in a comment is its section 11.n. SI units, angles in rad.

Every function takes states with any number of axes before the last, so that a Jacobian by
differences is one call. `ale_reference_mesh.py` has the data and the geometry;
`ale_reference_run.py` starts a drive, integrates it and finds its modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from ale_reference_mesh import LEDGER, SLOPES, Geometry, Mesh, dot
from reference_friction import Array, MaxwellSlip, Stateless
from scipy.interpolate import CubicSpline


@dataclass
class Axial:
    """Tension, flow and what presses [2]: cells (..., N) or, of arcs only, (..., N_arc)."""

    length: Array  # h
    stretch: Array  # lambda of the cells
    at_node: Array  # lambda at the nodes
    elastic: Array  # T without its damping
    tension: Array  # T
    flow: Array  # J at the nodes
    past: Array  # c = v - mesh velocity, nodes
    sink: Array  # d, arcs
    slid: Array  # w, nodes: v less V.t
    pressing: Array  # H of all cells
    deep: Array  # D at both ends of what lies of the cells on arcs (..., 2, N_arc)
    held: Array  # what of W is the end's, cuts, s R/e of that, D (..., 4, 2, N_arc)
    cuts: Array  # where these ends are, as fractions of the cell; twice 0 where nothing lies
    normal: Array  # N of both ends
    apart: Array  # w of a cell's last node less that of its first, in spans of v
    drawn: Array  # the same with what a span's waves draw out
    static: Array  # A_n(H) of the spans (..., n_p, K)
    path: Array  # X + E of the spans
    waves: Waves


@dataclass
class Clamped:
    """Waves of the spans (..., n_p, K): their number, lambda_n, mass and epsilon_n. [6]"""

    wave: Array
    value: Array
    mass: Array
    driven: Array


@dataclass
class Waves:
    """What waves of the spans are under a force (..., n_p, K), and their ends (..., 2, n_p). [6]"""

    pressing: Array  # H_s, (..., n_p)
    stiff: Array  # EI_n
    rises: Array  # e_n
    eased: Array  # 1 / (1 + mu_n)
    gyro: Array  # G S, (..., n_p, K, K)
    slopes: Array  # of sine modes at both ends, (..., 2, n_p, K)
    rest: Array  # at rest, of both ends
    lifts: Array  # by how much they lift more as H rises
    rolled: Array  # by which angle pressure there has rolled on


@dataclass(frozen=True)
class Ale(Mesh):
    """A belt drive with the equations of the ALE belt."""

    # ---- [2] tension, flow, normal force -----------------------------------------------------

    def _arc_cells(self, m: Array, angle: Array, slid: Array) -> tuple[Array, Array]:
        """Depth d and length of arcs' cells: c1' d^2 + c2' d = (T lambda - rhoA w^2)/(R - d)."""
        c1, c2 = self.contact
        ea, r, p_0 = self.axial_stiffness, self.radii[self.arc_pulley], self.compensated
        p_0 = p_0[self.arc_pulley]
        d = np.zeros_like(m)
        for _ in range(8):
            stretch = (r - d + p_0) * angle / m
            pressure = (ea * (stretch - 1.0) * stretch - self.linear_density * slid**2) / (
                r - d + p_0
            )
            left = c1 * np.maximum(d, 0.0) ** 2 + c2 * d - pressure
            slope = 2.0 * c1 * np.maximum(d, 0.0) + c2 + ea * (2.0 * stretch - 1.0) * angle / m / r
            d = d - left / slope
        return d, (r - d + p_0) * angle

    def run_off(self, h: Array, span: Array) -> tuple[Array, Array]:
        """X(H) of the spans and its slope. [2]"""
        at = np.clip(h, SLOPES[0] * self.h_0, SLOPES[1] * self.h_0)
        u = np.log(at)
        x, slope = self._tabled(self.x_of, u)
        slope = slope / at
        x = x - ((self.tilt / at) ** 2 - (self.tilt / self.h_0) ** 2) / (2.0 * span)
        slope = slope + self.tilt**2 / at**3 / span
        return x, np.where(at == h, slope, 0.0)

    def _tabled(self, table: CubicSpline, u: Array) -> tuple[Array, Array]:
        """A column of the table for each span at u (..., n_p), and its slope; x is even."""
        i = np.clip((u - table.x[0]) / (table.x[1] - table.x[0]), 0, len(table.x) - 2).astype(int)
        w, value, slope = u - table.x[i], np.zeros_like(u), np.zeros_like(u)
        for one in table.c:
            value, slope = value * w + one[i, np.arange(self.n_p)], slope * w + value
        return value, slope

    def end_moment(self, span: Array) -> Array:
        """Q_n (..., n_p, K)."""
        k = self.s / self.radii
        first, last = k[:, None], np.roll(k, -1)[:, None]
        waves = self.modes * math.pi / span[..., None]
        found = 0.5 * self.bending_stiffness * waves * (first - (-1.0) ** self.modes * last)
        return found if self.end_moments else 0.0 * found

    def offset(self, span: Array) -> Array:
        """b_n, of the line at R_g from that at R."""
        waves = self.modes * math.pi / span[..., None]
        raised = 1.0 if self.line_raised else 0.0
        return raised * self.end_moment(span) / (0.5 * span[..., None] * self.h_0 * waves**2)

    def clamped_waves(self, h: Array, span: Array) -> Clamped:
        """Waves clamped l beyond the tangent points, under H. [6]"""
        k, at, s = self.modes * math.pi / span[..., None], h[..., None], span[..., None]
        ei, wave, one = self.bending_stiffness, k, np.ones_like(k * at)
        if ei == 0.0 or not self.clamped:
            return Clamped(k * one, at * k**2 + ei * k**4, one, one)
        reach = np.sqrt(ei / at)
        for _ in range(40):
            ends = np.arctan(wave * reach / np.sqrt(1.0 + (wave * reach) ** 2))
            wave = (self.modes * math.pi + 2.0 * ends) / (s + 2.0 * reach)
        u2 = (wave * reach) ** 2
        root, both = np.sqrt(1.0 + u2), 1.0 + 2.0 * u2
        value = at * wave**2 + ei * wave**4
        mass = 1.0 + 2.0 * reach / s * (1.0 - root / both + u2 / (both * root))
        # by what is bent to e^(-x/l)/R there, of their own mass
        works = 2.0 * (root - 1.0) * np.sqrt(both) / (root**2 * u2) * wave / k
        return Clamped(wave, value, mass, works * value / (at * k**2) / np.sqrt(mass))

    def waves_of(self, h: Array, span: Array) -> Waves:
        """Clamped l beyond the tangent points, under H. [6]"""
        h, ei = np.maximum(h, SLOPES[0] * self.h_0), self.bending_stiffness
        k, at, s = self.modes * math.pi / span[..., None], h[..., None], span[..., None]
        slopes = np.stack((k, -((-1.0) ** self.modes) * k), axis=-3)
        one, of = np.ones_like(k), self.clamped_waves(h, span)
        stiff = (of.value - at * k**2) / k**4
        if ei > 0.0 and self.clamped:
            reach, wave = np.sqrt(ei / at), of.wave
            both, root = 1.0 + 2.0 * (wave * reach) ** 2, np.sqrt(1.0 + (wave * reach) ** 2)
            apart = 1.0 - 1.0 / (both * root)
            by_h = wave * reach * apart / at / (s + 2.0 * reach * apart)
            rises = (wave**2 + (2.0 * at * wave + 4.0 * ei * wave**3) * by_h) / k**2 - 1.0
            drawn = 0.5 * ei / at[..., None, :, :] * slopes
            drawn = (
                drawn * np.stack((self.s / self.radii, np.roll(self.s / self.radii, -1)))[..., None]
            )
            mu = (
                2.0
                / 3.0
                * (drawn[..., 0, :, :] ** 2 + drawn[..., 1, :, :] ** 2 - drawn.prod(axis=-3))
            )
            bent = wave * np.sqrt(both / of.mass) / reach  # curvature where they are clamped
            gap = of.value[..., :, None] - of.value[..., None, :]
            odd = self.gyro != 0.0
            gyro = 4.0 * ei * bent[..., :, None] * bent[..., None, :] / np.where(odd, gap, 1.0)
            gyro = np.where(odd, gyro, 0.0)
        else:
            rises, mu = 0.0 * one, 0.0 * one
            gyro = np.broadcast_to(self.gyro, (*k.shape, self.n_modes))
        stands, falls = self.rest_modes(h, span)
        rest = (slopes * stands[..., None, :, :]).sum(axis=-1)
        lifts = (slopes * falls[..., None, :, :]).sum(axis=-1)
        return Waves(h, stiff, rises, 1.0 / (1.0 + mu), gyro, slopes, rest, lifts, 0.0 * rest)

    def held_by(self, w: Waves, h: Array, span: Array) -> tuple[Array, Array]:
        """lambda_n(H), and its slope."""
        k = self.modes * math.pi / span[..., None]
        force = h[..., None] + w.rises * (h - w.pressing)[..., None]
        return k**2 * (force + w.stiff * k**2), k**2 * (1.0 + w.rises)

    def rest_modes(self, h: Array, span: Array) -> tuple[Array, Array]:
        """A_n(H), where the modes of a span rest, from the line at R, and by how much that falls
        with H. [2]
        """
        at = np.maximum(h, SLOPES[0] * self.h_0)[..., None]
        reach = np.sqrt(self.bending_stiffness / at)
        powers = np.stack([reach**power for power in range(2, 6)])
        slopes = powers * np.arange(2.0, 6.0).reshape(4, *(1,) * reach.ndim) / (2.0 * at)
        rest = sum(a * b for a, b in zip(powers, self.bend, strict=True))
        falls = sum(a * b for a, b in zip(slopes, self.bend, strict=True))
        return rest, np.where(at == h[..., None], falls, 0.0)

    def rolls_on(self) -> Array:
        """s R at both ends of the spans (2, n_p)."""
        return np.stack((self.s * self.radii, np.roll(self.s * self.radii, -1)))

    def angles(self, w: Waves, h: Array, ab: Array) -> Array:
        """By which waves lift both ends (..., 2, n_p). [3]"""
        waves = (w.slopes * ab[..., None, :, :]).sum(axis=-1) - w.rest
        return waves + w.lifts * (h - w.pressing)[..., None, :]

    def path_of(self, w: Waves, h: Array, span: Array, ab: Array) -> tuple[Array, Array]:
        """X(H) + E(a, H), and its slope by H. [2]"""
        x, slope = self.run_off(h, span)
        (rest, falls), (value, by) = self.rest_modes(h, span), self.held_by(w, h, span)
        apart, step = ab - rest, 1e-5 * h
        again = self.rest_modes(h + step, span)[1] - self.rest_modes(h - step, span)[1]
        again = again / (2.0 * step[..., None])
        bends = falls * (2.0 * by * apart + value * falls) + value * apart * again
        slope = slope + 0.5 * span * bends.sum(axis=-1)
        angle, pull = self.angles(w, h, ab), h[..., None, :]
        half = 0.5 * self.rolls_on() * angle
        rolls = (half * angle * (angle / 3.0 + pull * w.lifts)).sum(axis=-2)
        by_h = (4.0 * half * w.lifts * (0.5 * angle + 0.5 * pull * w.lifts)).sum(axis=-2)
        waves = apart * (by * apart + 2.0 * value * falls)
        return x + 0.25 * span * waves.sum(axis=-1) - rolls, slope - by_h

    def draws(self, w: Waves, h: Array, span: Array, ab: Array) -> Array:
        """By which modes draw their span out (..., n_p, K). [2]"""
        angle = self.angles(w, h, ab)
        ends = -0.5 * self.rolls_on() * angle * (angle + 2.0 * h[..., None, :] * w.lifts)
        (rest, falls), (value, by) = self.rest_modes(h, span), self.held_by(w, h, span)
        of_waves = 0.5 * span[..., None] * (by * (ab - rest) + value * falls)
        return of_waves + (ends[..., None] * w.slopes).sum(axis=-3)

    def turned(self, w: Waves, h: Array, ab: Array) -> Array:
        """Moments of ends that roll (..., n_p, K). [6]"""
        angle = self.angles(w, h, ab)
        return (0.5 * h[..., None, :] * self.rolls_on() * angle**2)[..., None] * w.slopes

    def _span_cells(self, m: Array, span: Array, a: Array, past: Array) -> tuple[Any, ...]:
        """T of the spans' cells by Newton's method for m (1 + T/EA) = S + X(H) + E(a, H)."""
        ea, ab, w = self.axial_stiffness, a + self.offset(span), self.waves
        momentum = self.linear_density * past**2  # rhoA c^2
        first = self.h_0 if w is None else w.pressing
        t = np.maximum(ea * (span / m - 1.0), first + momentum)
        for _ in range(30):
            stretch = 1.0 + t / ea
            h = t - momentum / stretch
            if self.waves is None:
                w = self.waves_of(h, span)
            path, slope = self.path_of(w, h, span, ab)
            left = m * stretch - span - path
            slope_t = m / ea - slope * (1.0 + momentum / stretch**2 / ea)
            step = -left / np.where(slope_t > 0.1 * m / ea, slope_t, m / ea)
            t = t + np.clip(step, -0.5 * self.h_0, 0.5 * self.h_0)
            if np.all(np.abs(step) < 1e-13 * self.h_0):
                break
        h = t - momentum / (1.0 + t / ea)
        return t, h, self.rest_modes(h, span)[0], m * (1.0 + t / ea) - span, w

    def axial(self, y: Array, geo: Geometry) -> Axial:
        m, v, a = self.get(y, "m"), self.get(y, "v"), self.get(y, "a")
        nxt, spans, arcs, of = self.next, self.spans, self.arcs, self.arc_pulley
        past = v - geo.mesh
        slid = v - dot(geo.axis[..., self.pulley, :], geo.t)
        mean = 0.5 * (slid + slid[..., nxt])[..., arcs]
        angle = geo.wrap[..., of] / self.on[of]
        length, elastic = np.empty_like(m), np.empty_like(m)
        sink, length[..., arcs] = self._arc_cells(m[..., arcs], angle, mean)
        speed = 0.5 * (past[..., spans] + past[..., self.ends])
        found = self._span_cells(m[..., spans], geo.span, a, speed)
        elastic[..., spans], pressing_span, static, path, w = found
        length[..., spans] = geo.span + path
        elastic[..., arcs] = self.axial_stiffness * (length / m - 1.0)[..., arcs]
        stretch = length / m
        at_node = 0.5 * (stretch + stretch[..., self.before])
        rate = slid[..., nxt] - slid
        rate[..., spans] = v[..., self.ends] - v[..., spans]
        drawn, dampers = rate.copy(), np.empty(self.n)
        ab, da = a + self.offset(geo.span), self.swings(y, geo)
        drawn[..., spans] += (self.draws(w, pressing_span, geo.span, ab) * da).sum(axis=-1)
        dampers[arcs], dampers[spans] = self.arc_dampers[1][of], self.span_dampers[1]
        tension = elastic + dampers * drawn / m
        pressing = np.empty_like(m)
        pressing[..., spans] = pressing_span
        centrifugal = self.linear_density * mean**2 / stretch[..., arcs]
        outward = 0.5 * self.s[of] * dot(self.g, geo.nn + geo.nn[..., nxt, :])[..., arcs]
        lifts = self.linear_density * m[..., arcs] * outward / angle
        pressing[..., arcs] = tension[..., arcs] - centrifugal - lifts
        lifted, held = self.angles(w, pressing_span, ab), self.held
        if held is None:
            held, rolled = self.boundary(pressing_span, geo.wrap, lifted)
            w = replace(w, rolled=rolled)
        end, cuts, roll = held[..., 0, :, :], held[..., 1, :, :], held[..., 2, 0, :]
        part = np.diff(cuts, axis=-2)
        lies = part > 0.0
        lifted = lifted - w.rolled
        first = 2.0 * self.fraction[arcs] < 1.0
        force = np.maximum(pressing_span, SLOPES[0] * self.h_0)
        force = np.where(first, np.roll(force, 1, axis=-1)[..., of], force[..., of])
        turned = np.where(
            first, np.roll(lifted[..., 1, :], 1, axis=-1)[..., of], lifted[..., 0, of]
        )
        shear = (force * (1.0 - roll * turned))[..., None, :]
        normal = np.maximum(0.0, pressing[..., arcs])[..., None, :] * part + shear * end
        normal = 0.5 * angle[..., None, :] * np.where(lies, np.maximum(normal, 0.0), 0.0)
        return Axial(
            length=length, stretch=stretch, at_node=at_node, elastic=elastic, tension=tension,
            flow=past / at_node, past=past, sink=sink, slid=slid, pressing=pressing,
            deep=np.where(lies, held[..., 3, :, :], 0.0), held=held, cuts=cuts, normal=normal,
            apart=rate, drawn=drawn, static=static, path=path, waves=w,
        )  # fmt: skip

    def boundary(self, pressing: Array, wrap: Array, lifted: Array) -> tuple[Array, Array]:
        """What the end of a wrap has of W, what lies of a cell as fractions of it, at both ends of
        what lies of the cells on arcs, s R/e, and D (..., 4, 2, N_arc), from H of the spans: the
        belt touches from e on and what waves that lift it have rolled it by, an angle of both ends
        of the spans (..., 2, n_p), given back. Load and its first moment are kept in a cell. [3]
        """
        of = self.arc_pulley
        if not self.boundary_layers:
            cuts = np.broadcast_to(np.array([[0.0], [1.0]]), (2, len(self.arcs)))
            held = np.stack((np.zeros_like(cuts), cuts, np.zeros_like(cuts), np.ones_like(cuts)))
            return np.broadcast_to(held, (*pressing.shape[:-1], *held.shape)), 0.0 * lifted
        on, roll = self.radii * wrap, self.s * self.radii
        whole = on[..., of]
        h = np.maximum(pressing, SLOPES[0] * self.h_0)
        c1, c2 = self.contact
        ends, rolled = [], []
        angles = np.roll(lifted[..., 1, :], 1, axis=-1), lifted[..., 0, :]
        for force, angle in zip((np.roll(h, 1, axis=-1), h), angles, strict=True):
            stiff = 0.5 * (c2 + np.sqrt(c2**2 + 4.0 * c1 * force / self.radii))  # N / d
            fast, slow, reach = self.sinking(force, stiff)
            e = np.minimum(reach, 0.45 * on)
            begin = np.clip(e + roll * angle, np.minimum(e, 0.0), 0.45 * on)
            rolled.append((begin - e) / roll)
            # R / d by the integral of the square of its slope
            one, two = fast**2 * (1.0 + slow * e), slow**2 * (1.0 + fast * e)
            square = one**2 / (2.0 * fast) + two**2 / (2.0 * slow) - 2.0 * one * two / (fast + slow)
            leans = (square / (fast - slow) ** 2).real * force / stiff
            ends.append([one[..., of] for one in (e, fast, slow, begin, leans)])
        first, last = ends[0][3], whole - ends[1][3]

        def more(x: Array, end: list[Array]) -> tuple[Array, Array]:
            """What is carried more than H/R up to x behind the touching point, less what it is far
            from there, over H/R; and its integral.
            """
            e, fast, slow, *_ = end
            one = (1.0 + slow * e) / (fast - slow) * np.exp(-fast * x)
            two = -(1.0 + fast * e) / (fast - slow) * np.exp(-slow * x)
            return (one + two).real, -(one / fast + two / slow).real

        def carried(s: Array) -> tuple[Array, Array]:
            """Of both ends together, from the start to s."""
            one, other = more(s - first, ends[0]), more(last - s, ends[1])
            return one[0] - other[0], one[1] + other[1]

        part = whole / self.on[of]  # a cell
        begin = self.fraction[self.arcs] * whole
        # belt may touch a little before the wrap begins
        first_cell = self.fraction[self.arcs] == 0.0
        last_cell = np.roll(first_cell, -1)
        s_0 = np.clip(np.where(first_cell, -np.inf, begin), first, last)
        s_1 = np.clip(np.where(last_cell, np.inf, begin + part), first, last)
        lies = s_1 - s_0 > 0.02 * part
        (c_0, sum_0), (c_1, sum_1) = carried(s_0), carried(s_1)
        mean = (sum_1 - sum_0) / np.where(lies, s_1 - s_0, 1.0)
        end = 2.0 * np.stack((mean - c_0, c_1 - mean), axis=-2) / part[..., None, :]
        cuts = np.stack((s_0 - begin, s_1 - begin), axis=-2) / part[..., None, :]
        reach = [np.maximum(one[0], 0.5 / one[2].real) for one in ends]
        reach = np.where(2.0 * self.fraction[self.arcs] < 1.0, *reach)
        share = roll[of] / reach
        size = np.where(lies, cuts[..., 1, :] - cuts[..., 0, :], 1.0)
        deep = 1.0 + end / size[..., None, :]
        for on_arc in self.on_arc.values():
            count = np.cumsum(lies[..., on_arc], axis=-1)
            for side, outer in enumerate((count == 1, count == count[..., -1:])):
                outer = outer & lies[..., on_arc]
                less = ends[side][4] / part / size
                deep[..., side, on_arc] -= np.where(outer, less[..., on_arc], 0.0)
        deep = np.maximum(deep, 0.0)
        held = np.stack((end, cuts, np.stack((share, share), axis=-2), deep), axis=-3)
        rolled = np.stack((rolled[1], np.roll(rolled[0], -1, axis=-1)), axis=-2)
        return np.where(lies[..., None, None, :], held, 0.0), rolled

    # ---- [4] friction --------------------------------------------------------------------------

    def frictions(self, y: Array, geo: Geometry, ax: Axial) -> tuple[Array, Array, Array]:
        """Forces F (..., 2, N_arc), slip velocities, rates of z."""
        z, omega = self.get(y, "z"), self.get(y, "omega")
        m = self.get(y, "m")[..., self.arcs]
        of, nodes = self.arc_pulley, np.stack((self.arcs, self.next[self.arcs]))
        part = ax.cuts[..., 1, :] - ax.cuts[..., 0, :]
        lies = part > 0.0
        part = np.where(lies, part, 1.0)[..., None, :]
        rho = self.places_rho(ax)
        rim = (self.sense * self.s * omega)[..., None, of] * rho
        ends = ax.slid[..., nodes]
        slip = (1.0 - ax.cuts) * ends[..., :1, :] + ax.cuts * ends[..., 1:, :] - rim
        force, rate = np.zeros_like(slip), np.zeros_like(z)
        on_belt = 0.5 * m[..., None, :] * part
        per_metre = ax.normal / on_belt
        carry = 0.5 * (ax.flow[..., nodes[0]] + ax.flow[..., nodes[1]])
        for j, law in enumerate(self.friction):
            if law is None:
                continue
            on = self.on_arc[j]
            z_j, flow = z[..., on], carry[..., None, on]
            m_j, lying = 2.0 * on_belt[..., 0, None, on], lies[..., None, on]
            for side in (0, 1):
                state = (
                    z_j[..., :, side, :] if isinstance(law, MaxwellSlip) else z_j[..., 0, side, :]
                )
                if isinstance(law, MaxwellSlip):
                    state = state[..., : law.n_states, :]
                args = state, slip[..., side, on], per_metre[..., side, on], 1.0
                force[..., side, on] = law.force(*args) * on_belt[..., 0, on] * lies[..., on]
                if isinstance(law, Stateless):
                    continue
                own = law.rate(*args)
                own = own * (lying if isinstance(law, MaxwellSlip) else lies[..., on])
                rate[..., : law.n_states, side, on] = (
                    own if isinstance(law, MaxwellSlip) else own[..., None, :]
                )
            if isinstance(law, Stateless):
                continue
            z_a, z_b = z_j[..., 0, :], z_j[..., 1, :]
            none = np.zeros((*z_a.shape[:-1], 1))
            arrives = np.concatenate((none, z_b[..., :-1]), axis=-1)
            returns = np.concatenate((z_a[..., 1:], none), axis=-1)
            mean, half = 0.5 * (z_a + z_b), 0.5 * (z_a - z_b)
            r_1 = flow * np.where(flow >= 0.0, arrives - mean, half)
            r_2 = flow * np.where(flow >= 0.0, half, mean - returns)
            rate[..., 0, on] += (4.0 * r_1 - 2.0 * r_2) / m_j * lying
            rate[..., 1, on] += (4.0 * r_2 - 2.0 * r_1) / m_j * lying
        return force, slip, rate

    def places_rho(self, ax: Axial) -> Array:
        """Radii on which the places of friction slip (..., 2, N_arc)."""
        depth = ax.sink[..., None, :] * ax.deep
        return (self.radii + self.compensated)[self.arc_pulley] - depth

    def on_ends(self, ax: Axial, force: Array) -> Array:
        """Friction as it acts on both nodes of the cells, (..., 2, N_arc)."""
        after = (ax.cuts * force).sum(axis=-2)
        return np.stack((force.sum(axis=-2) - after, after), axis=-2)

    # ---- [5] momentum, [6] modes, [7] mounts, pulleys ------------------------------------------

    def bending(self, m: Array, geo: Geometry) -> Array:
        """Energy of bending per metre of stress-free belt, EI (d theta)^2 / 2 m^2 in arcs."""
        found = np.zeros_like(m)
        angle = geo.wrap[..., self.arc_pulley] / self.on[self.arc_pulley]
        found[..., self.arcs] = 0.5 * self.bending_stiffness * (angle / m[..., self.arcs]) ** 2
        return found

    def pulls(self, m: Array, geo: Geometry, ax: Axial) -> Array:
        """What the energies of bending and contact on arcs do to the nodes. [5]"""
        energy = self.bending(m, geo)
        energy[..., self.arcs] -= self.pressed(ax.sink)
        return (energy - energy[..., self.before]) / ax.at_node

    def lengthens(
        self, m: Array, geo: Geometry, ax: Axial, dm: Array, da: Array, ab: Array
    ) -> tuple[Array, Array, Array, Array]:
        """At which the paths of spans and of arcs' cells grow longer without their nodes; of spans
        by c'. [5]
        """
        ea, rho, of, span = self.axial_stiffness, self.linear_density, self.arc_pulley, geo.span
        c = 0.5 * (ax.past[..., self.spans] + ax.past[..., self.ends])
        stretch, waves = ax.stretch[..., self.spans], self.modes * math.pi / span[..., None]
        h, w = ax.pressing[..., self.spans], ax.waves
        value, by = self.held_by(w, h, span)
        by_h = self.path_of(w, h, span, ab)[1]
        thrown = rho * c**2 / stretch
        by_t, by_c = 1.0 + thrown / stretch / ea, -2.0 * thrown / np.where(c == 0.0, 1.0, c)
        per = m[..., self.spans] / ea - by_h * by_t
        per = 1.0 / np.where(per > 0.1 * m[..., self.spans] / ea, per, m[..., self.spans] / ea)
        drawn = (self.draws(w, h, span, ab) * da).sum(axis=-1)
        # how path that waves make goes with S: lambda_n as -2 - 2 EI_n k^4/lambda_n
        rest, falls = self.rest_modes(h, span)
        apart = ab - rest
        by_span = by * apart + 2.0 * falls * (value + 2.0 * w.stiff * waves**4)
        by_span = -0.25 * span * (apart * by_span).sum(axis=-1)
        by_span = (by_span + 0.5 * self.tilt**2 * (h**-2 - self.h_0**-2) / span) / span
        bent = 0.25 * (waves**2 * ab**2).sum(axis=-1)
        pulls = drawn + geo.span_rate * (1.0 + by_span) - stretch * dm[..., self.spans]
        raise_ = self.s * self.raised
        turns = -self.sense * geo.turning * (raise_ - np.roll(raise_, -1, axis=-1))
        drawn = drawn - (0.5 * span[..., None] * waves**2 * ab * da).sum(axis=-1)  # not by waves
        of_spans = by_h * by_t * per * pulls + turns + (by_span + bent) * geo.span_rate + drawn
        by_quickens = by_h * by_c * (1.0 + by_t * per * by_h)
        # arcs
        turned = geo.wrap_rate[..., of] / self.on[of]
        angle = geo.wrap[..., of] / self.on[of]
        m_a, rad = m[..., self.arcs], (self.radii + self.compensated)[of]
        c1, c2 = self.contact
        r = rad - ax.sink
        w = 0.5 * (ax.slid + ax.slid[..., self.next])[..., self.arcs]
        q = angle / m_a
        firm = ea * q**2 + c2 + 2.0 * c1 * np.maximum(ax.sink, 0.0) + rho * w**2 / r**2
        by_m = ea * (1.0 - 2.0 * r * q) / firm * q / m_a
        by_w = -2.0 * rho * w / r / firm
        sinks = by_m * (dm[..., self.arcs] - m_a * turned / angle)
        return of_spans, by_quickens, (r - self.radii[of]) * turned - sinks * angle, -by_w * angle

    def rate(self, t: float, y: Array) -> Array:
        """dy/dt of states (..., size)."""
        y = np.array(y, dtype=float)
        for j, motion in self.motion.items():
            y[..., self.layout["omega"][0]][..., j] = motion(t)[0]
        m, v, a, p = (self.get(y, name) for name in "mvap")
        omega, theta = self.get(y, "omega"), self.get(y, "theta")
        nxt, prv, spans, ends, arcs = self.next, self.before, self.spans, self.ends, self.arcs
        rho, geo = self.linear_density, self.geometry(t, y)
        ax = self.axial(y, geo)
        force, slip, z_rate = self.frictions(y, geo, ax)
        dm = ax.flow - ax.flow[..., nxt]

        # [6] modes without the terms of c'
        c = 0.5 * (ax.past[..., spans] + ax.past[..., ends])
        span, waves = geo.span, self.modes * math.pi / geo.span[..., None]
        m_s, t_s = m[..., spans], ax.tension[..., spans]
        density = rho / ax.stretch[..., spans]  # mp
        da = self.swings(y, geo)
        w, h = ax.waves, ax.pressing[..., spans]
        gyro = w.gyro / span[..., None, None]
        ga = (gyro @ a[..., None])[..., 0]
        gda = (gyro @ da[..., None])[..., 0]
        ab = a + self.offset(span)
        bends = self.held_by(w, h, span)[0] - h[..., None] * waves**2
        driven = 0.5 * span[..., None] * self.held_by(w, h, span)[0] * ax.static
        driven = driven + self.turned(w, h, ab).sum(axis=-3)
        mp, cc = density[..., None], c[..., None]
        gravity = dot(self.g, geo.n)
        dp = (
            -2.0 * cc * gda
            - (t_s / density - c**2)[..., None] * waves**2 * ab
            - bends / mp * ab
            - self.bending_damping / mp * waves**4 * da
            + 2.0 * driven / (span[..., None] * mp)
            + self.odd * (4.0 * gravity + 8.0 * self.sense * geo.turning * c)[..., None]
        )  # fmt: skip
        speeds = self.end_speeds(geo, ax, da)
        losing = self.per_losing(geo, ax).sum(axis=0) * speeds
        resists = (losing[..., None] * self.rolls(geo)).sum(axis=-3)
        dp = w.eased * (dp - 2.0 * resists / (span[..., None] * mp))
        forced = dp  # what the span as a whole gives its ends
        if self.reaction:
            dp = dp - (dm[..., spans] / m_s)[..., None] * (da + cc * ga)

        # [5] momentum along the belt
        density_at = 0.5 * rho * (m + m[..., prv])  # rhoA M
        stiff = ax.tension - ax.tension[..., prv] + self.pulls(m, geo, ax)
        u_n = dot(geo.axis[..., self.pulley, :], geo.nn)
        through = 0.25 * rho * (ax.flow + ax.flow[..., nxt])
        convected, convected_n = self.convected(geo, ax, u_n, through)
        on_nodes = np.zeros_like(v)
        rubs = self.on_ends(ax, force)
        np.add.at(on_nodes, (..., arcs), -rubs[..., 0, :])
        np.add.at(on_nodes, (..., nxt[arcs]), -rubs[..., 1, :])
        np.add.at(on_nodes, (..., np.stack((spans, ends))), -losing)
        total = stiff + on_nodes - convected
        total = total + density_at * (dot(self.g, geo.t) - self.sense * geo.node_turning * u_n)
        # by how much paths grow longer, what runs along them is slower [5]
        longer, by_quickens, of_arcs, by_w = self.lengthens(m, geo, ax, dm, da, ab)
        carried = rho * c / ax.stretch[..., spans]
        first_moment, added = carried * longer, carried * by_quickens
        if self.reaction:
            weight = 0.5 * rho * m_s
            kappa = (waves * ab) ** 2
            first_moment += weight * (dp * ga + (p - da) * gda).sum(axis=-1)
            first_moment += weight * (2.0 * cc * waves**2 * ab * da).sum(axis=-1)
            shorter = -(geo.span_rate / span)[..., None]  # of waves' slopes
            first_moment += weight * (shorter * (p * ga + 2.0 * cc * kappa)).sum(axis=-1)
            added += weight * (kappa - ga**2).sum(axis=-1)
            lateral = 0.25 * density * (da**2 - cc**2 * kappa).sum(axis=-1)
            lateral = lateral + rho / 12.0 * (v[..., ends] - v[..., spans]) ** 2
            lateral = lateral + rho / 12.0 * (u_n[..., ends] - u_n[..., spans]) ** 2
            total[..., spans] += lateral
            total[..., ends] -= lateral
        # waves along spans: what their springs do to both ends, and what these lend them
        d_along, d_along_speed, on_both, lent = self.rings(y, geo)
        total[..., np.stack((spans, ends))] += on_both[..., None, :]
        # both ends of a span: consistent mass and the reaction of the modes, a symmetric 2 x 2
        mu = rho * m_s / 6.0 if self.consistent else 0.0
        k_00 = density_at[..., spans] - mu + 0.25 * added - lent
        k_11 = density_at[..., ends] - mu + 0.25 * added - lent
        k_01 = mu + 0.25 * added - lent
        determinant = k_00 * k_11 - k_01**2
        mean = 0.5 * (ax.slid + ax.slid[..., nxt])[..., arcs]
        dv = np.zeros_like(v)
        for _ in range(5):  # by 1e-5 of it each what accelerates changes depths
            dw = 0.5 * (dv + dv[..., nxt])[..., arcs]
            slows = 0.5 * rho * mean / ax.stretch[..., arcs] * (of_arcs + by_w * dw)
            f = total.copy()
            np.add.at(f, (..., arcs), -slows)
            np.add.at(f, (..., nxt[arcs]), -slows)
            dv = f / density_at
            f_0 = f[..., spans] - 0.5 * first_moment
            f_1 = f[..., ends] - 0.5 * first_moment
            dv[..., spans] = (k_11 * f_0 - k_01 * f_1) / determinant
            dv[..., ends] = (k_00 * f_1 - k_01 * f_0) / determinant
        dc = 0.5 * (dv[..., spans] + dv[..., ends])
        if self.reaction:
            dp = dp - dc[..., None] * ga

        # pulleys
        torque = np.zeros(omega.shape)
        if self.torque is not None:
            torque = torque + self.torque(t, theta, omega)
        pulls = (self.places_rho(ax) * force).sum(axis=-2)
        pulls = (self.sense * self.s)[self.arc_pulley] * pulls
        of_belt = np.stack(
            [pulls[..., self.on_arc[j]].sum(axis=-1) for j in range(self.n_p)], axis=-1
        )
        dq = self.get(y, "dq")
        carrier = np.zeros_like(omega)
        for i, j in enumerate(self.sprung):
            if self.mounts[j].carries_bearing:
                carrier[..., j] = dq[..., i]
        resists = self.bearing(omega - carrier)
        domega = (torque + of_belt - resists) / self.inertias
        for j, motion in self.motion.items():
            domega[..., j] = motion(t)[1]
            torque[..., j] = self.inertias[j] * domega[..., j] - of_belt[..., j] + resists[..., j]

        works = np.zeros((*omega.shape[:-1], len(LEDGER)))
        ddq, share_rate, works[..., 5] = self.mount_rows(
            y,
            geo,
            ax,
            rubs + slows[..., None, :],
            density_at,
            convected_n,
            forced,
            da,
            resists,
            losing + 0.5 * (first_moment + added * dc)[..., None, :],
            self.shortens(y, geo, ax, ab),
        )
        works[..., 0] = (torque * omega).sum(axis=-1)
        own, all_of = np.empty((2, self.n))
        for found, on_arcs, on_spans in zip(
            (own, all_of), self.arc_dampers, self.span_dampers, strict=True
        ):
            found[arcs], found[spans] = on_arcs[self.arc_pulley], on_spans
        works[..., 1] = (own * ax.drawn**2 / m).sum(axis=-1)
        works[..., 7] = ((all_of - own) * ax.drawn**2 / m).sum(axis=-1)
        works[..., 2] = self.bending_damping * (0.5 * span[..., None] * waves**4 * da**2).sum(
            axis=(-1, -2)
        )
        lost = (self.per_losing(geo, ax) * speeds**2).sum(axis=(-1, -2))
        works[..., 2] += lost[0]
        works[..., 7] += lost[1]
        if self.n_along:
            works[..., 1] += (self.wave_along(geo)[2] * d_along**2).sum(axis=-1)
        works[..., 3] = (force * slip).sum(axis=(-1, -2))
        works[..., 4] = (resists * (omega - carrier)).sum(axis=-1)
        parts = (
            dm, dv, z_rate, da, dp, d_along, d_along_speed, omega, domega, dq, ddq, share_rate,
            works,
        )  # fmt: skip
        return np.concatenate([one.reshape(*y.shape[:-1], -1) for one in parts], axis=-1)

    def rings(self, y: Array, geo: Geometry) -> tuple[Array, Array, Array, Array]:
        """Of waves along spans: rates of their amplitude and speed, the force on either end of
        the span, the inertia that either lends. [5]
        """
        if not self.n_along:
            return self.get(y, "along"), self.get(y, "along"), np.zeros(self.n_p), 0.0
        v, share, size = self.get(y, "v"), 2.0 / math.pi, self.get(y, "along")
        mass, spring, damper = self.wave_along(geo)
        rate = self.get(y, "along_speed") - share * (v[..., self.spans] + v[..., self.ends])
        pull = spring * size + damper * rate - share * mass * dot(self.g, geo.e)
        grows = geo.span_rate / geo.span * rate
        return rate, -pull / (0.5 * mass) - grows, share * pull, 0.5 * mass * share**2

    def wave_along(self, geo: Geometry) -> tuple[Array, Array, Array]:
        """Mass, spring and damper of waves along spans. [5]"""
        per_length = math.pi**2 / (2.0 * geo.span)
        mass = self.linear_density * geo.span / (1.0 + self.h_0 / self.axial_stiffness)
        return mass, self.axial_stiffness * per_length, self.axial_damping * per_length

    def shortens(self, y: Array, geo: Geometry, ax: Axial, ab: Array) -> Array:
        """What waves pull along their spans, for they are longer then. [7]"""
        span, h, t = geo.span, ax.pressing[..., self.spans], ax.tension[..., self.spans]
        waves = self.modes * math.pi / span[..., None]
        bent = 0.25 * span * (waves**2 * ab**2).sum(axis=-1)
        apart, pull = ab - ax.static, h[..., None]
        force = 0.25 * (pull * waves**2 + 3.0 * ax.waves.stiff * waves**4) * apart**2
        tilts = self.tilt**2 / h * (1.0 - h / self.h_0) ** 2 / (2.0 * span)
        c = 0.5 * (ax.past[..., self.spans] + ax.past[..., self.ends])
        ga = (ax.waves.gyro / span[..., None, None] @ self.get(y, "a")[..., None])[..., 0]
        m = self.get(y, "m")[..., self.spans]
        momentum = (
            0.5
            * self.linear_density
            * m
            * (self.get(y, "p") * ga + c[..., None] * (waves * ab) ** 2).sum(axis=-1)
        )
        return ((t - h) * bent + tilts - c * momentum) / span + force.sum(axis=-1)

    def swings(self, y: Array, geo: Geometry) -> Array:
        """a' of the modes (..., n_p, K). [6]"""
        of_ends = (dot(geo.axis, geo.n), dot(np.roll(geo.axis, -1, axis=-2), geo.n))
        return self.get(y, "p") - np.stack(of_ends, axis=-1) @ self.parts

    def rolls(self, geo: Geometry) -> Array:
        """By which the speed at a span's ends goes with a' (..., 2, n_p, K): an end rolls on by R
        times the angle of its waves. [5]
        """
        waves = self.modes * math.pi / geo.span[..., None]
        on = (self.s * self.radii)[:, None]
        return np.stack((on * waves, np.roll(on, -1, axis=0) * (-1.0) ** self.modes * waves), -3)

    def end_speeds(self, geo: Geometry, ax: Axial, da: Array) -> Array:
        """At which belt runs off the pulley before a span, and on the next (..., 2, n_p)."""
        past = ax.past[..., np.stack((self.spans, self.ends))]
        return past + (self.rolls(geo) * da[..., None, :, :]).sum(axis=-1)

    def per_losing(self, geo: Geometry, ax: Axial) -> Array:
        """What dampers take there over that speed, of bending and of contact (2, ..., 2, n_p): the
        curvature rises to what it is behind within l, and eta_I times the square of its rate is
        lost. [5]
        """
        found = np.zeros((2, *geo.span.shape[:-1], 2, self.n_p))
        found[1] = self.sinks
        if self.bending_damping > 0.0 and self.bending_stiffness > 0.0:
            h = np.maximum(ax.pressing[..., self.spans], SLOPES[0] * self.h_0)
            reach = np.sqrt(self.bending_stiffness / h)[..., None, :]
            radii = np.stack((self.radii, np.roll(self.radii, -1)))
            found[0] = 0.5 * self.bending_damping * self.bends / (radii**2 * reach)
        return found

    def convected(
        self, geo: Geometry, ax: Axial, u_n: Array, through: Array
    ) -> tuple[Array, Array]:
        """Along t and n of the nodes, half of each cell's on its two ends. Of an arc's cell that
        is w_k+1 - w_k and, with the tangent's turn between them, tan(dtheta/2) (w_k + w_k+1): the
        one division of w_k+1 t_k+1 - w_k t_k that keeps momentum, energy and torque.
        """
        half = 0.5 * geo.wrap[..., self.arc_pulley] / self.on[self.arc_pulley]
        along_t, along_n = through * ax.apart, through * (u_n[..., self.next] - u_n)
        both = ax.slid[..., self.arcs] + ax.slid[..., self.next[self.arcs]]
        turned = -self.s[self.arc_pulley] * np.tan(half) * both
        along_n[..., self.arcs] = through[..., self.arcs] * turned
        return along_t + along_t[..., self.before], along_n + along_n[..., self.before]

    def bearing(self, omega: Array) -> Array:
        """Z, MODEL section 5."""
        if self.drag is None:
            return np.zeros_like(omega)
        coulomb, viscous, quadratic = self.drag.T
        smooth = omega / np.sqrt(omega**2 + self.omega_0**2)
        return coulomb * smooth + viscous * omega + quadratic * omega * np.abs(omega)

    def mount_rows(
        self, y: Array, geo: Geometry, ax: Axial, force: Array, density_at: Array,
        convected_n: Array, dp: Array, da: Array, resists: Array, losing: Array, pulls: Array,
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        """q'', zeta' and the losses of the mounts. [7]"""
        q, dq, zeta = (self.get(y, name) for name in ("q", "dq", "zeta"))
        if not self.n_m:
            return dq, zeta, np.zeros(q.shape[:-1])
        m, v = self.get(y, "m"), self.get(y, "v")
        rho, nxt, of, sense = self.linear_density, self.next, self.pulley, self.sense
        lever = geo.lever[..., of, :]
        a_n, a_t = dot(lever, geo.nn), dot(lever, geo.t)
        # what the belt pulls: cells of the arc, T and the bending of its ends
        on_cells = np.zeros_like(m)
        turned = geo.t[..., nxt, :] - geo.t
        arcs, ends_of = self.arcs, self.next[self.arcs]
        on_cells[..., arcs] = (ax.tension * dot(lever, turned))[..., arcs]
        on_nodes = -a_t * self.pulls(m, geo, ax)
        f_t = force[..., 0, :] * a_t[..., arcs] + force[..., 1, :] * a_t[..., ends_of]
        on_cells[..., arcs] += f_t
        # inertia normal to the belt. rate_n: u'.n but for q''; of V.n alone, and with the turning
        axis, known = geo.axis[..., of, :], geo.known[..., of, :]
        turn = sense * geo.node_turning
        of_axis = dot(known, geo.nn) + turn * dot(axis, geo.t)
        span_mass = np.zeros_like(m)
        span_mass[..., self.spans] = 0.5 * rho * m[..., self.spans]
        span_mass[..., self.ends] = 0.5 * rho * m[..., self.spans]
        arc_mass = density_at - span_mass
        bears = density_at * (-turn * v - dot(self.g, geo.nn)) + convected_n
        on_nodes -= a_n * (bears + arc_mass * of_axis)
        own = arc_mass * a_n**2
        # spans: what modes do not carry of the consistent mass, and the modes themselves
        whole = rho * m[..., self.spans]
        rest = np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]]) - 0.5 * self.parts @ self.parts.T
        pair = np.stack((self.spans, self.ends))
        rates, levers = of_axis[..., pair], a_n[..., pair]
        gives = whole[..., None, :] * np.einsum("ij,...jk->...ik", rest, rates)
        gives += 0.5 * whole[..., None, :] * np.einsum("in,...kn->...ik", self.parts, dp)
        c = 0.5 * (ax.past[..., self.spans] + ax.past[..., self.ends])
        swings = 4.0 * rho / ax.stretch[..., self.spans] * c * (self.odd * da).sum(axis=-1)
        gives += np.array([1.0, -1.0])[:, None] * swings[..., None, :]
        # the line's lift EI/2RH follows H, R_g stands at H0
        lift = (ax.pressing[..., self.spans] / self.h_0 - 1.0) * self.tilt / geo.span
        # its tangent points turn with the axes, and c with them
        sided = (self.s * self.radii) * losing[..., 0, :]
        sided = sided + np.roll(self.s * self.radii, -1) * losing[..., 1, :]
        gives += np.array([-1.0, 1.0])[:, None] * (sided / geo.span)[..., None, :]
        if self.line_raised:
            gives += np.array([-1.0, 1.0])[:, None] * lift[..., None, :]
        losing = losing + np.array([-1.0, 1.0])[:, None] * pulls[..., None, :]
        np.add.at(on_nodes, (..., pair), -levers * gives + a_t[..., pair] * losing)

        matrix = np.zeros((*q.shape, self.n_m))
        drives = np.zeros_like(q)
        spring, lost = np.zeros_like(q), np.zeros(q.shape[:-1])
        share_rate = np.zeros_like(q)
        for i, j in enumerate(self.sprung):
            one = self.mounts[j]
            here = np.flatnonzero(of == j)
            matrix[..., i, i] += one.moved + own[..., here].sum(axis=-1)
            drives[..., i] = on_nodes[..., here].sum(axis=-1) + on_cells[..., here].sum(axis=-1)
            travel, rate, share = q[..., i], dq[..., i], zeta[..., i]
            spring[..., i] = one.spring(travel) + one.damper(rate) - one.friction * share
            spring[..., i] += one.stop(travel, rate) + one.weighs * dot(
                geo.lever[..., j, :], self.g
            )
            if one.carries_bearing:
                spring[..., i] += resists[..., j]
            share_rate[..., i] = one.share_rate(rate, share)
            lost = lost + one.lost(travel, rate, share)
        for k in range(self.n_p):
            for x, j in enumerate((k, (k + 1) % self.n_p)):
                for w, other in enumerate((k, (k + 1) % self.n_p)):
                    if j in self.sprung and other in self.sprung:
                        part = whole[..., k] * rest[x, w] * levers[..., x, k] * levers[..., w, k]
                        matrix[..., self.sprung.index(j), self.sprung.index(other)] += part
        ddq = np.linalg.solve(matrix, (drives + spring)[..., None])[..., 0]
        return ddq, share_rate, lost

    # ---- energy ---------------------------------------------------------------------------------

    def energy(self, t: float, y: Array) -> dict[str, Array]:
        """Stored energy by its terms [J]. [8]"""
        geo = self.geometry(t, y)
        ax = self.axial(y, geo)
        m, v, a, p = (self.get(y, name) for name in "mvap")
        rho, spans, arcs = self.linear_density, self.spans, self.arcs
        m_s, span, waves = m[..., spans], geo.span, self.modes * math.pi / geo.span[..., None]
        elastic = 0.5 * self.axial_stiffness * (ax.stretch - 1.0) ** 2 * m
        contact = self.pressed(ax.sink) * m[..., arcs]
        # spans: what bending stores as H changes, integral of T dX, and the modes
        ab = a + self.offset(span)
        h, w = ax.pressing[..., spans], ax.waves
        value, _ = self.held_by(w, h, span)
        u = np.log(np.clip(h, SLOPES[0] * self.h_0, SLOPES[1] * self.h_0))
        path = self.path_of(w, h, span, ab)[0]
        summed, _ = self._tabled(self.x_sum, u)
        summed = summed + self.tilt**2 / h * (1.0 - h / self.h_0) ** 2 / (2.0 * span)
        bend = summed - h * path + 0.25 * span * (value * (ab - ax.static) ** 2).sum(axis=-1)
        angle = self.angles(w, h, ab)
        bend = bend - h / 6.0 * (self.rolls_on() * angle**3).sum(axis=-2)
        arcs_bent = (self.bending(m, geo) * m).sum(axis=-1)
        mass = 0.5 * rho * (m + m[..., self.before])
        kinetic = 0.5 * (mass * v**2).sum(axis=-1)
        if self.consistent:
            kinetic = kinetic - (rho * m_s / 12.0 * (v[..., self.ends] - v[..., spans]) ** 2).sum(
                axis=-1
            )
        u_n = dot(geo.axis[..., self.pulley, :], geo.nn)
        arc_mass = mass.copy()
        arc_mass[..., spans] -= 0.5 * rho * m_s
        arc_mass[..., self.ends] -= 0.5 * rho * m_s
        kinetic = kinetic + 0.5 * (arc_mass * u_n**2).sum(axis=-1)
        rest = np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]]) - 0.5 * self.parts @ self.parts.T
        both = u_n[..., np.stack((spans, self.ends))]
        kinetic = kinetic + 0.5 * (
            rho * m_s * np.einsum("...ik,ij,...jk->...k", both, rest, both)
        ).sum(axis=-1)
        gyro = w.gyro / span[..., None, None]
        ga = (gyro @ a[..., None])[..., 0]
        c = 0.5 * (ax.past[..., spans] + ax.past[..., self.ends])[..., None]
        lateral = (p + c * ga) ** 2 + (1.0 / w.eased - 1.0) * self.swings(y, geo) ** 2
        if self.reaction:
            lateral = lateral + c**2 * ((waves * ab) ** 2 - ga**2)
        lateral = 0.25 * rho * m_s * lateral.sum(axis=-1)
        if self.n_along:
            size, speed = self.get(y, "along"), self.get(y, "along_speed")
            with_ends = 2.0 / math.pi * (v[..., spans] + v[..., self.ends])
            mass, spring, _ = self.wave_along(geo)
            kinetic = kinetic + 0.25 * (mass * (speed**2 - with_ends**2)).sum(axis=-1)
            stored = 0.5 * (spring * size**2).sum(axis=-1)
            elastic = np.concatenate((elastic, stored[..., None]), axis=-1)
        omega = self.get(y, "omega")
        found = {
            "elastic": elastic.sum(axis=-1),
            "contact": contact.sum(axis=-1),
            "bending": arcs_bent + bend.sum(axis=-1),
            "kinetic": kinetic,
            "lateral": lateral.sum(axis=-1),
            "pulleys": 0.5 * (self.inertias * omega**2).sum(axis=-1),
            "mounts": np.zeros(y.shape[:-1]),
        }
        q, dq = self.get(y, "q"), self.get(y, "dq")
        for i, j in enumerate(self.sprung):
            one = self.mounts[j]
            place = one.place(q[..., i], self.centers[j])
            found["mounts"] = found["mounts"] + 0.5 * one.moved * dq[..., i] ** 2
            found["mounts"] += one.stored(q[..., i]) - one.weighs * dot(self.g, place)
        return found
