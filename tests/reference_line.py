"""The tight belt line round pulleys, and links along it: MODEL.md sections 1 and 6, plain NumPy."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import scipy.optimize
from reference_friction import Array


def _tight(c: Array, r: Array, side: Array) -> tuple[int, Array, Array, Array, int]:
    """Sense of running, lengths and angles of the spans, wraps and turns of the tight belt line."""
    n_p = len(c)
    if n_p < 2:
        raise ValueError("a belt needs two pulleys at least")
    onward = np.roll(c, -1, axis=0) - c
    apart = np.hypot(onward[:, 0], onward[:, 1])
    step = side * r - np.roll(side * r, -1)
    if np.any(apart <= np.abs(step)):
        raise ValueError("one pulley lies inside its neighbour")
    span = np.sqrt(apart**2 - step**2)
    found = []
    area = float(np.sum(c[:, 0] * np.roll(c[:, 1], -1) - np.roll(c[:, 0], -1) * c[:, 1]))
    senses = (1, -1)  # of all pulleys inside, that in which their order goes round
    if n_p == 2 or np.all(side > 0):
        senses = (1,) if n_p > 2 and area > 0 else (-1,)
    for sense in senses:
        # Span j runs from pulley j to pulley j + 1 as a tangent.
        span_angle = np.arctan2(onward[:, 1], onward[:, 0]) + sense * np.arcsin(step / apart)
        # Wrap j turns span j - 1 into span j, on pulley j, against the sense if that is outside.
        wrap = np.mod(sense * side * (span_angle - np.roll(span_angle, 1)), 2 * math.pi)
        turns = float(np.sum(side * wrap)) / (2 * math.pi)
        if abs(turns - 1) < 1e-9 or (n_p == 2 and abs(turns) < 1e-9):
            found.append((float(np.sum(span + r * wrap)), sense, span_angle, wrap, round(turns)))
    if not found:
        raise ValueError("in this order and on these sides the belt does not go round once")
    # Where it does in either direction, the longer way crosses itself.
    _, sense, span_angle, wrap, turns = min(found, key=lambda one: one[0])
    return sense, span, span_angle, wrap, turns


def spans_away(
    centers: Array, radii: Array, sides: npt.ArrayLike | None = None
) -> tuple[float, Array, Array]:
    """Length of the tight belt line, the wraps, and the unit vectors along its spans away from each
    pulley: (n_p, 2, 2), [pulley, the span before or behind it, xy].
    """
    side = np.ones(len(centers)) if sides is None else np.asarray(sides, dtype=float)
    _, span, angle, wrap, _ = _tight(centers, radii, side)
    behind = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    before = -np.roll(behind, 1, axis=0)
    return float(np.sum(span + radii * wrap)), wrap, np.stack((before, behind), axis=1)


def depth(pressure: float, contact: tuple[float, float, float]) -> float:
    """Root p of c1' p^2 + c2' p = pressure [N/m]."""
    return float(np.roots([*contact[:2], -pressure]).real.max())


def tension_at_rest(
    centers: Array,
    radii: Array,
    sides: npt.ArrayLike | None,
    length: float,
    stiffness: tuple[float, float],
    contact: tuple[float, float, float],
    compensate: bool,
) -> float:
    """Mean tension of a settled belt of this stress-free length, section 6; of EA and EI."""
    axial, bending = stiffness
    side = np.ones(len(centers)) if sides is None else np.asarray(sides, dtype=float)
    _, spans, _, wraps, _ = _tight(centers, radii, side)
    strain = float(np.sum(spans + radii * wraps)) / length - 1.0

    def end(pull: float, bending: float, r: float, p: float) -> float:
        if bending == 0.0:
            return -5.0 / 12.0 * p * math.sqrt(p / r)
        c, tau = pull / (r * p), pull / bending
        m, big_p = tau**-0.5, math.sqrt(c / bending)
        big_s = math.sqrt(tau + 2.0 * big_p)
        b = (big_s * tau / big_p + (tau / big_p + 1.0) / m) / (r * (tau + big_p + big_s / m))
        k = 1.0 / r + big_p * p - big_s * b
        s = r * (b - k * m)
        first = ((b - big_s * p) / big_p + p * s - s**3 / (6.0 * r)) / r
        return first - k**2 * m**3 / 4.0 - (b**2 + big_p * p**2) / (4.0 * big_s)

    preload = axial * strain

    def left(tension: float) -> float:
        pull, shorter = tension * (1.0 + tension / axial), 0.0
        bend = np.minimum(math.sqrt(bending / pull), 0.25 * spans)

        def ends(turned: Array) -> Array:
            """Lifts of the two ends of each span, (2, n)."""
            turn, r, s = (np.array([x, np.roll(x, -1)]) for x in (turned, radii, side))
            fits = np.minimum(bend, 0.5 * turn * r)
            return s * (fits**2 / (2.0 * r) + turn * (bend - fits) / 2.0)

        tilts = np.subtract(*ends(wraps)) / spans
        bent = np.maximum(0.0, wraps + side * (tilts - np.roll(tilts, 1)))
        shorter += float(np.sum(np.subtract(*ends(bent)) ** 2 / (2.0 * spans)))
        for turn, r in ((bent, radii), (np.roll(bent, -1), np.roll(radii, -1))):
            shorter -= float(np.sum(turn**2 * np.maximum(0.0, bend - 0.5 * turn * r))) / 16.0
        for r, wrap, turn in zip(radii, wraps, bent, strict=True):
            p = depth(pull / r, contact)
            p_0 = depth(preload * (1.0 + strain) / r, contact) if compensate else 0.0
            has = min(bending, pull * (0.5 * turn * r) ** 2)
            shorter += wrap * (p - p_0) + 2.0 * end(pull, has, float(r), p)
        return tension - axial * (strain - shorter / length)

    return float(scipy.optimize.brentq(left, 1e-3 * preload, 2.0 * preload, xtol=1e-13, rtol=1e-15))


def belt_line(
    centers: npt.ArrayLike,
    radii: npt.ArrayLike,
    length: float,
    n_bodies: int,
    sides: npt.ArrayLike | None = None,
    middle: float = 0.5,
) -> tuple[Array, Array, Array, int, float]:
    """Links along the tight belt path round pulleys, `sides` +1 inside the loop or -1 outside.

    The belt visits the pulleys in the order given: two are run clockwise (section 1), more in the
    sense in which it goes round once, and of two on either side it is crossed and goes round none.
    Links share the path equally, their mass centres on it, their angles along its tangent and
    continuous; the left end of link 0 is where the belt leaves pulley 0. With `middle` 0 the left
    ends are returned, not the centres. Returns x, y, phi, winding and the length of the path.

    `length` (stress-free) does not move the links; it is only required to be within a factor of two
    of the path.
    """
    c = np.asarray(centers, dtype=float).reshape(-1, 2)
    r = np.asarray(radii, dtype=float).reshape(len(c))
    n_p = len(c)
    side = np.ones(n_p) if sides is None else np.asarray(sides, dtype=float)
    sense, span, span_angle, wrap, turns = _tight(c, r, side)
    pieces: list[tuple[float, float, Array]] = []  # length, curvature with sign, centre or start
    angle = float(span_angle[0])
    for j in range(n_p):
        k = (j + 1) % n_p
        outward = sense * np.array([math.sin(span_angle[j]), -math.cos(span_angle[j])])
        pieces.append((float(span[j]), 0.0, c[j] + side[j] * r[j] * outward))
        pieces.append((float(r[k] * wrap[k]), sense * side[k] / r[k], c[k]))
    path = sum(piece[0] for piece in pieces)
    if not 0.5 * path < length < 2 * path:
        raise ValueError(f"belt length {length} m is far from its path, {path} m")
    s = (np.arange(n_bodies) + middle) * path / n_bodies
    x, y, phi = np.empty(n_bodies), np.empty(n_bodies), np.empty(n_bodies)
    begin = 0.0
    for piece_length, curvature, point in pieces:
        on = (s >= begin) & (s < begin + piece_length)
        along = s[on] - begin
        phi[on] = angle + curvature * along
        if curvature == 0.0:
            x[on] = point[0] + along * math.cos(angle)
            y[on] = point[1] + along * math.sin(angle)
        else:
            x[on] = point[0] + np.sin(phi[on]) / curvature
            y[on] = point[1] - np.cos(phi[on]) / curvature
        begin += piece_length
        angle += curvature * piece_length
    return x, y, phi, sense * turns, float(path)
