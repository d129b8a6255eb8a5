"""What is fixed about an ALE belt, and where its mesh stands: data of the drive, numbering of
cells and nodes, layout of the state, run-offs of the spans, geometry of the loop at one instant.

`ale_reference.py` has the equations of motion on it, and says how both are to be read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from reference_friction import Array, Law
from reference_line import belt_line, depth, spans_away, tension_at_rest
from reference_mounts import Arm, Mount, Path, Sprung, rest_of
from scipy.integrate import simpson
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

Torque = Callable[[Any, Array, Array], Any]
Motion = Callable[[float], tuple[float, float]]  # of t: speed Omega [rad/s], its rate [rad/s^2]

LEDGER = (
    "drive", "joint_damping", "bending_damping", "friction", "drag", "mount", "path",
    "contact_damping",
)  # fmt: skip
"""The quadratures at the end of the state: work put in, then what goes out (section 7)."""

SLOPES = (0.02, 30.0)
"""X(H) is tabulated, and evaluated, between these shares of H0."""


def dot(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])


def along(angle: Array) -> Array:
    """Unit vectors of these directions, (..., 2)."""
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


@dataclass
class Geometry:
    """The loop at one instant [1]: spans (..., n_p), nodes (..., N)."""

    span: Array  # S
    span_rate: Array  # S'
    e: Array  # unit vector along each span
    n: Array  # its normal, D 90 degrees behind
    turning: Array  # Omega of each span
    wrap: Array  # of each arc
    wrap_rate: Array
    t: Array  # tangents at the nodes
    nn: Array  # normals at the nodes
    node_turning: Array  # Omega_k
    mesh: Array  # velocity of the mesh along t
    axis: Array  # V of each pulley
    lever: Array  # a of each pulley, 0 without a sprung mount
    known: Array  # acceleration of each axis but for a q''


@dataclass(frozen=True)
class Mesh:
    """A belt drive by its data per metre of belt, with the equations of the ALE belt.

    The state is `m` and `v` (N), `z` (states, 2, N_arc), `a` and `p` (n_p, K), `along` and
    `along_speed` (n_p or 0), `theta`, `omega` (n_p), of sprung mounts travel, rate and share of
    friction (n_m), and the quadratures LEDGER.
    Cell c lies between nodes c and c + 1; span 0, arc 1, span 1, ..., arc 0.
    """

    length: float
    linear_density: float
    axial_stiffness: float
    axial_damping: float
    bending_stiffness: float
    centers: Array
    radii: Array
    inertias: Array
    contact: tuple[float, float]  # c1' [N/m^3], c2' [N/m^2]
    friction: tuple[Law | None, ...]
    bending_damping: float = 0.0
    contact_damping: tuple[float, float] = (0.0, 0.0)  # b' [N s/m^2], d of Hunt and Crossley [s/m]
    sides: tuple[int, ...] | None = None
    compensate: bool = False
    gravity: tuple[float, float] = (0.0, 0.0)
    drag: Array | None = None  # (n_p, 3)
    mounts: Mapping[int, Mount] = field(default_factory=dict)
    motion: Mapping[int, Motion] = field(default_factory=dict)
    torque: Torque | None = None
    cell: float = 0.0125  # longest cell of an arc [m]
    least: int = 6  # cells of an arc
    small: float = 0.04  # radius of which smaller pulleys have the cells [m]
    n_modes: int = 2
    # switches, for tests of what each of them is worth
    end_moments: bool = True
    boundary_layers: bool = True
    line_raised: bool = True
    reaction: bool = True
    consistent: bool = True
    path_bends: bool = True
    clamped: bool = True
    held: Array | None = None  # W of the step, if it is frozen
    waves: Any = None  # and what waves are in it

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        centers = np.asarray(self.centers, dtype=float).reshape(-1, 2)
        n_p, radii = len(centers), np.asarray(self.radii, dtype=float)
        put("n_p", n_p)
        put("s", np.ones(n_p) if self.sides is None else np.asarray(self.sides, dtype=float))
        put("centers", centers)
        put("radii", radii)
        put("inertias", np.asarray(self.inertias, dtype=float))
        put("g", np.asarray(self.gravity, dtype=float))
        mounts = {
            j: one.resolved(centers[j], radii[j], self.axial_stiffness, self.length)
            for j, one in sorted(self.mounts.items())
        }
        put("mounts", mounts)
        put("sprung", [j for j, one in mounts.items() if isinstance(one, Sprung)])
        put("n_m", len(self.sprung))
        # direction of numbering and the place of rest, by MODEL sections 1 and 6
        at = self._rest_by_model()
        put("q_0", at)
        places = self._places(0.0, at)[0]
        line = belt_line(places, radii, self.length, 100, self.sides)
        put("sense", 1 if n_p > 2 and line[3] > 0 else -1)
        if n_p > 2 and line[3] == 0:
            raise ValueError("a loop of three that goes round none is not meant here")
        strain = line[-1] / self.length - 1.0
        put("strain", strain)
        put("compensated", np.zeros(n_p))
        pressure = self.axial_stiffness * strain * (1.0 + strain) / radii
        if self.compensate:
            put("compensated", np.array([depth(one, self.contact) for one in pressure]))
        put("h_0", self._tension_of(places))
        put("raised", np.zeros(n_p))
        put("moment", np.zeros(n_p))
        if self.line_raised:
            stretch = 1.0 + self.h_0 / self.axial_stiffness
            deep = np.array([depth(self.h_0 * stretch / r, self.contact) for r in radii])
            put("moment", self.bending_stiffness * stretch / (2.0 * radii))
            put("moment", self.moment + self.pressed(deep) * radii / stretch)
            put("raised", self.moment / self.h_0 - deep + self.compensated)
        self._mesh(places, put)
        self._run_offs(put)
        self._dampers(put)
        if self.drag is not None:
            wave = math.sqrt(self.axial_stiffness / self.linear_density)
            put("omega_0", 1e-3 * strain * wave / 60.0 / radii)
            put("drag", np.asarray(self.drag, dtype=float))

    # ---- what is fixed at the start ---------------------------------------------------------

    def _tension_of(self, places: Array) -> float:
        return tension_at_rest(
            places, self.radii, self.sides, self.length,
            (self.axial_stiffness, self.bending_stiffness), self.contact, self.compensate,
        )  # fmt: skip

    def _rest_by_model(self) -> Array:
        """Travel of the sprung mounts at rest, MODEL section 5."""
        if not self.sprung:
            return np.zeros(0)

        def line(places: Array) -> tuple[float, Array]:
            path, _, spans = spans_away(places, self.radii, self.sides)
            strain = path / self.length - 1.0
            pull = self.axial_stiffness * strain
            return (self._tension_of(places) if strain > 0.0 else pull), spans

        rest = rest_of(
            list(self.mounts.items()), self.centers, line,
            self.axial_stiffness, self.length, self.g,
        )  # fmt: skip
        return rest[[m for m, j in enumerate(self.mounts) if j in self.sprung]]

    def _mesh(self, places: Array, put: Callable[[str, Any], None]) -> None:
        """Number cells and nodes, and say of each to which pulley or span it belongs."""
        _, wraps, _ = spans_away(places, self.radii, self.sides)
        put("n_along", self.n_p if self._rings_along(places, wraps) else 0)
        counted = wraps * np.maximum(self.radii, self.small)
        even = [2 * math.ceil(length / self.cell / 2) for length in counted]
        on = [max(self.least, n) for n in even]
        pulley, fraction, arc_of, spans, arcs = [], [], [], [], {}
        for i in range(self.n_p):
            j = (i + 1) % self.n_p
            spans.append(len(pulley))
            pulley.append(i)
            fraction.append(1.0)
            arcs[j] = slice(len(arc_of), len(arc_of) + on[j])
            for k in range(on[j]):
                arc_of.append(len(pulley))
                pulley.append(j)
                fraction.append(k / on[j])
        put("n", len(pulley))
        put("on", np.array(on))
        put("pulley", np.array(pulley))  # of each node
        put("fraction", np.array(fraction))  # of the wrap, of each node
        put("spans", np.array(spans))  # cell of each span; its first node
        put("ends", (np.array(spans) + 1) % self.n)  # its last node
        put("arcs", np.array(arc_of))  # cells on arcs
        put("arc_pulley", self.pulley[self.arcs])
        put("on_arc", arcs)  # of each pulley, its cells among those on arcs
        put("next", (np.arange(self.n) + 1) % self.n)
        put("before", (np.arange(self.n) - 1) % self.n)
        put("n_z", max([1, *(one.n_states for one in self.friction if one is not None)]))
        sizes = (
            ("m", (self.n,)), ("v", (self.n,)), ("z", (self.n_z, 2, len(arc_of))),
            ("a", (self.n_p, self.n_modes)), ("p", (self.n_p, self.n_modes)),
            ("along", (self.n_along,)), ("along_speed", (self.n_along,)),
            ("theta", (self.n_p,)), ("omega", (self.n_p,)),
            ("q", (self.n_m,)), ("dq", (self.n_m,)), ("zeta", (self.n_m,)),
            ("works", (len(LEDGER),)),
        )  # fmt: skip
        begin, layout = 0, {}
        for name, shape in sizes:
            end = begin + math.prod(shape)
            layout[name] = (slice(begin, end), shape)
            begin = end
        put("layout", layout)
        put("size", begin)
        modes = np.arange(1, self.n_modes + 1)
        put("modes", modes)
        odd = (modes[:, None] + modes) % 2 == 1
        gap = np.where(odd, modes[:, None] ** 2 - modes**2, 1)
        put("gyro", np.where(odd, 4.0 * modes[:, None] * modes / gap, 0.0))  # G S
        put("odd", np.where(modes % 2 == 1, 1.0, 0.0) / (modes * math.pi))
        #: parts of a mode in the motion of a span's first and last end, w_n / (a.n)
        put("parts", 2.0 / (modes * math.pi) * np.array([modes**0, -((-1.0) ** modes)]))

    def _rings_along(self, places: Array, wraps: Array) -> bool:
        """Whether spans have waves along them. [5]"""
        rises = self.s * self.radii - np.roll(self.s * self.radii, -1)
        apart = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=-1)
        span, rho = np.sqrt(apart**2 - rises**2), self.linear_density
        in_ = np.roll(span, 1)
        mass = self.inertias / self.radii**2 + rho * (wraps * self.radii + (in_ + span) / 3.0)
        ratio = rho * np.maximum(in_, span) ** 2 * (1.0 / in_ + 1.0 / span) / mass
        return bool(ratio.max() > 0.2)

    def _run_offs(self, put: Callable[[str, Any], None]) -> None:
        """X(H) of each span without its part of 1/S, over log H, and its integral over H."""
        h = self.h_0 * np.geomspace(*SLOPES, 100)
        x = np.zeros((len(h), self.n_p))
        if self.path_bends:
            ends = np.array([[self._end(one, r, r0) for r, r0 in
                              zip(self.radii, self.compensated, strict=True)]
                             for one in h])  # fmt: skip
            x = -(ends + np.roll(ends, -1, axis=1))
        put("x_of", CubicSpline(np.log(h), x))
        put("x_sum", CubicSpline(np.log(h), x * h[:, None]).antiderivative())
        # where waves rest, over d(1/H) a cubic of l = (EI/H)^(1/2) through four values
        ei, length = self.bending_stiffness, self.geometry(0.0, self.pack(q=self.q_0)).span
        straight = self.modes * math.pi / length[:, None]
        places = math.sqrt(ei / self.h_0) * np.array([0.5, 1.0, 1.5, 2.0])
        cubics = np.zeros((4, self.n_p, self.n_modes))
        if ei > 0.0 and self.end_moments:
            values = []
            for reach in places:
                h = ei / reach**2
                of = self.clamped_waves(np.full(self.n_p, h), length)
                share = (h * straight**2 / of.value) ** 2 * of.driven
                values.append(
                    2.0 * self.end_moment(length) / (length[:, None] * straight**2) * share
                )
            solved = np.linalg.solve(
                np.vander(places, increasing=True), np.reshape(values, (4, -1))
            )
            cubics = solved.reshape(cubics.shape) * 2.0 / ei / np.arange(2, 6)[:, None, None]
        put("bend", cubics)
        k = self.s * self.moment
        put("tilt", k - np.roll(k, -1))  # o H

    def pressed(self, sink: Array) -> Array:
        """Energy of the contact per metre of stress-free belt."""
        c1, c2 = self.contact
        return np.asarray(c1 * np.maximum(sink, 0.0) ** 3 / 3.0 + c2 * sink**2 / 2.0)

    def sinking(self, force: Array, stiff: Array) -> tuple[Array, Array, Array]:
        """Exponents of belt that sinks in, those of a string without bending, whose first one has
        no share; and where it touches. [3]
        """
        ei = self.bending_stiffness
        if ei == 0.0:
            slow = np.sqrt(stiff / force) + 0j
            return 3.0 * slow, slow, -1.0 / slow.real
        square, along = 0.5 * np.sqrt(stiff / ei), 0.25 * force / ei
        apart = np.maximum(abs(square - along), 1e-6 * square) * np.sign(along - square)
        p, q = np.sqrt(square + along), np.sqrt(apart + 0j)
        return p + q, p - q, np.sqrt(ei / force) - p / square

    def _lying(self, r: float, force: float) -> tuple[float, float, Callable[[Array], Array]]:
        """Where belt touches a pulley under a force, over what length it sinks in, and its depth
        from there on. [3]
        """
        d = depth(force / r, self.contact)
        fast, slow, e = self.sinking(np.array(force), np.array(force / (r * d)))
        one = fast * (1.0 + slow * e) / (slow - fast)
        return (
            float(e), float(1.0 / slow.real),
            lambda x: d + d * (one * np.exp(-fast * x) - (1.0 + one) * np.exp(-slow * x)).real,
        )  # fmt: skip

    def _sinking(self, r: float) -> tuple[float, float]:
        """By the speed squared at which belt runs on a pulley, the integral of d'^2; by the rate of
        H squared that of (dd/dH)^2, less what the cells of the arc have of it. [5]
        """
        h = self.h_0
        small = 1e-5 * h
        (e, reach, here), (e_more, _, more), (e_less, _, less) = (
            self._lying(r, h + one) for one in (0.0, small, -small)
        )
        x = np.linspace(0.0, 30.0 * reach, 20001)
        slope = CubicSpline(x, here(x))(x, 1)
        rate = (more(x) - less(x) - slope * (e_more - e_less)) / (2.0 * small)
        cells = depth((h + small) / r, self.contact) - depth((h - small) / r, self.contact)
        cells = (cells / (2.0 * small)) ** 2
        return simpson(slope**2, x=x), simpson(rate**2 - cells, x=x) - e * cells

    def _bends(self, r: float) -> float:
        """The integral of the square of the curvature's slope where belt runs on a pulley, over
        1/(2 R^2 l): up to where it touches curvature rises as e^{x/l}. [5]
        """
        h, ei = self.h_0, self.bending_stiffness
        if ei == 0.0:
            return 0.0
        d, reach = depth(h / r, self.contact), math.sqrt(ei / h)
        fast, slow, e = self.sinking(np.array(h), np.array(h / (r * d)))
        one = fast * (1.0 + slow * e) / (slow - fast)
        of = ((fast, d * one), (slow, -d * (1.0 + one)))  # depth, less that far behind, by e^{-ax}
        touches = 1.0 / r + sum((b * a**2).real for a, b in of)
        inside = sum((b * a**3 * c * f**3 / (a + f)).real for a, b in of for f, c in of)
        return float(2.0 * r**2 * reach * (touches**2 / (2.0 * reach) + inside))

    def _dampers(self, put: Callable[[str, Any], None]) -> None:
        """Of arcs and of spans, the belt's own part and all of it; of the ends of wraps. [5]"""
        h, r, ea = self.h_0, self.radii, self.axial_stiffness
        c1, c2 = self.contact
        contact = self.contact_damping[0] + self.contact_damping[1] * h / r
        deep = np.array([depth(h / one, self.contact) for one in r])
        k = ea / ((c2 + 2.0 * c1 * deep) * r**2)
        own = self.axial_damping / (1.0 + k) ** 2
        put("arc_dampers", (own, own + contact * (k * r / (1.0 + k)) ** 2))
        runs, pressed = contact * np.transpose([self._sinking(one) for one in r])
        put("sinks", np.stack((runs, np.roll(runs, -1))))
        bends = np.array([self._bends(one) for one in r])
        put("bends", np.stack((bends, np.roll(bends, -1))))
        # a span at rest
        forces, span = np.full(self.n_p, h), self.geometry(0.0, self.pack(q=self.q_0)).span
        waves = self.waves_of(forces, span)
        x, slope = self.path_of(waves, forces, span, self.rest_modes(forces, span)[0])
        m = (span + x) / (1.0 + h / ea)
        share = m / ea / np.maximum(m / ea - slope, 0.1 * m / ea)
        own = self.axial_damping * share**2
        put("span_dampers", (own, own + (pressed + np.roll(pressed, -1)) * (ea * share) ** 2 / m))

    def _end(self, pull: float, r: float, compensated: float) -> float:
        """Delta of one end of a wrap, and what the arc's B does not reach. [2]"""
        stretch, ei = 1.0 + pull / self.axial_stiffness, self.bending_stiffness
        if ei == 0.0:
            p = depth(pull * stretch / r, self.contact)
            return -5.0 / 12.0 * p * math.sqrt(p / r)
        on_arc = max(pull - ei / (2.0 * r**2), 0.5 * pull)
        p, reach = depth(on_arc * stretch / r, self.contact), math.sqrt(ei / pull)
        tau, big_p = on_arc / ei, math.sqrt(on_arc / (r * p) / ei)
        big_s = math.sqrt(tau + 2.0 * big_p)

        def curvature(b: float) -> tuple[float, float]:
            """Where belt touches, and its slope into the wrap."""
            bent = big_p * p - big_s * b
            return 1.0 / r + bent, -big_s * bent - big_p * b

        def left(b: float) -> float:
            """Of the shear that the free part, an elastica, has by this curvature."""
            k, rises = curvature(b)
            return rises - k / reach * math.sqrt(1.0 - min(0.5 * k * reach, 0.7) ** 2)

        highest = (1.0 / r + big_p * p) / big_s  # no curvature
        b = brentq(left, 0.0, highest, xtol=1e-15)
        turned = 2.0 * math.asin(min(0.5 * curvature(b)[0] * reach, 0.7))
        foot = turned - b
        found = (b - big_s * p) / (big_p * r) + (r - p) * foot - r * math.sin(foot)
        found -= 2.0 * reach * (1.0 - math.cos(0.5 * turned))
        found -= (b**2 + big_p * p**2) / (4.0 * big_s)
        return found + reach * ei / (4.0 * self.axial_stiffness * r**2)

    # ---- state --------------------------------------------------------------------------------

    def get(self, y: Array, name: str) -> Array:
        where, shape = self.layout[name]
        return y[..., where].reshape(*y.shape[:-1], *shape)

    def pack(self, **parts: Any) -> Array:
        y = np.zeros(self.size)
        for name, value in parts.items():
            where, shape = self.layout[name]
            y[where] = np.broadcast_to(value, shape).ravel()
        return y

    # ---- [1] geometry -------------------------------------------------------------------------

    def _places(self, t: Any, q: Array) -> tuple[Array, Array]:
        """Places of the axes and their levers a, (..., n_p, 2); of paths a = 0."""
        shape = (*np.shape(q)[:-1], self.n_p, 2)
        places, levers = np.broadcast_to(self.centers, shape).copy(), np.zeros(shape)
        for j, one in self.mounts.items():
            if isinstance(one, Path):
                places[..., j, :] = one.place(t, self.centers[j])
            else:
                travel = q[..., self.sprung.index(j)]
                places[..., j, :] = one.place(travel, self.centers[j])
                levers[..., j, :] = one.lever(travel, self.centers[j])
        return places, levers

    def geometry(self, t: Any, y: Array) -> Geometry:
        q, dq = self.get(y, "q"), self.get(y, "dq")
        places, lever = self._places(t, q)
        axis, known = np.zeros_like(places), np.zeros_like(places)
        for j, one in self.mounts.items():
            if isinstance(one, Path):
                axis[..., j, :] = one.lever(t, self.centers[j])
                inside = one.t[0] <= t <= one.t[-1]
                known[..., j, :] = one.spline(np.clip(t, one.t[0], one.t[-1]), 2) * inside
            else:
                rate = dq[..., self.sprung.index(j), None]
                axis[..., j, :] = lever[..., j, :] * rate
                if isinstance(one, Arm):
                    bent = np.stack((-lever[..., j, 1], lever[..., j, 0]), axis=-1)
                    known[..., j, :] = bent * rate**2
        sense, s, rg = self.sense, self.s, self.radii + self.raised
        d = np.roll(places, -1, axis=-2) - places
        b = s * rg - np.roll(s * rg, -1)
        span = np.sqrt(dot(d, d) - b**2)
        angle = np.arctan2(d[..., 1], d[..., 0]) + sense * np.arctan2(b, span)
        e = along(angle)
        n = sense * np.stack((e[..., 1], -e[..., 0]), axis=-1)
        apart = np.roll(axis, -1, axis=-2) - axis
        turning = -sense * dot(apart, n) / span
        span_rate = dot(apart, e) - b * turning * sense
        arrives, comes = np.roll(angle, 1, axis=-1), np.roll(turning, 1, axis=-1)
        wrap = np.mod(s * sense * (angle - arrives), 2.0 * math.pi)
        of, f = self.pulley, self.fraction
        psi = arrives[..., of] + sense * s[of] * f * wrap[..., of]
        tangent = along(psi)
        normal = sense * np.stack((tangent[..., 1], -tangent[..., 0]), axis=-1)
        node_turning = (1.0 - f) * comes[..., of] + f * turning[..., of]
        mesh = dot(axis[..., of, :], tangent) + sense * s[of] * self.radii[of] * node_turning
        return Geometry(
            span=span, span_rate=span_rate, e=e, n=n, turning=turning, wrap=wrap,
            wrap_rate=s * sense * (turning - comes), t=tangent, nn=normal,
            node_turning=node_turning, mesh=mesh, axis=axis, lever=lever, known=known,
        )  # fmt: skip
