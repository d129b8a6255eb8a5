"""The Jacobian as a dense matrix: the core's, and by differences of the core and the oracle.

Unknowns in the order of the core's state, scaled: a stretch s for places, over half a link or a
radius for angles, s w for velocities, w the fastest undamped frequency of the joints. The state of
a friction law is scaled by what a slip of s makes of it, at least by what makes friction as large
as the normal force. Entries then are of size w, or of what damps or presses more, and a matrix norm
means something.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import reference
from reference_line import belt_line, depth
from reference_mounts import Sprung

from beltdyn import _core

Array = reference.Array
Vector = Callable[[Array], Array]

STRETCH = 1e-4  # m
MOUNT_STATES = ("travel", "travel_speed", "mount_friction")
ALE_STATES = ("m", "v", "a", "p", "along", "along_speed")
COUPLING_STATES = ("rim_angle", "rim_speed", "windup")  # of reference_couplings.py
BORDER = ("theta", "omega", *MOUNT_STATES)  # each of which may know of every link
CURVED = ("x", "y", "phi", "vx", "vy", "vphi", "omega", *MOUNT_STATES[:2])


@dataclass(frozen=True)
class Layout:
    """Between the core's dict of arrays and one scaled vector."""

    sizes: Mapping[str, int]
    scale: Array
    friction: Array  # what makes friction as large as the normal force, of every entry of "mu"

    @classmethod
    def of(cls, oracle: reference.Reference, state: Mapping[str, Any]) -> Layout:
        half, radius = 0.5 * oracle.l0, float(oracle.radii[0])
        w = 2.0 * math.sqrt(oracle.c_tra * half**2 / oracle.inertia)
        units = {"x": 1.0, "y": 1.0, "phi": 1.0 / half, "theta": 1.0 / radius, "slip": 1.0}
        units |= {"vx": w, "vy": w, "vphi": w / half, "omega": w / radius}
        sizes = {name: np.size(state.get(name, ())) for name, *_ in _core.STATE_FIELDS}
        if oracle.freedoms == 2:  # reported of a string, but no part of its state
            sizes |= {"phi": 0, "vphi": 0}
        scale = {name: np.full(n, STRETCH * units.get(name, 0.0)) for name, n in sizes.items()}
        friction, by_slip = friction_scales(oracle, state)
        scale["mu"] = np.maximum(friction, STRETCH * by_slip)
        for m, (reach, one) in enumerate(zip(levers(oracle), oracle.mounts.values(), strict=True)):
            scale["travel"][m] = STRETCH / reach
            scale["travel_speed"][m] = STRETCH * w / reach
            scale["mount_friction"][m] = 1.0
            if isinstance(one, Sprung) and one.friction > 0.0:
                assert one.friction_stiffness is not None
                by_travel = one.friction_stiffness / one.friction
                scale["mount_friction"][m] = max(1.0, by_travel * STRETCH / reach)
        return cls(sizes, np.concatenate(list(scale.values())), friction)

    @cached_property
    def parts(self) -> dict[str, slice]:
        ends = np.cumsum(list(self.sizes.values()))
        return {
            name: slice(int(end) - size, int(end))
            for (name, size), end in zip(self.sizes.items(), ends, strict=True)
        }

    def pack(self, state: Mapping[str, Any]) -> Array:
        parts = [np.ravel(state[name] if size else ()) for name, size in self.sizes.items()]
        return np.concatenate(parts) / self.scale

    def unpack(self, vector: Array, t: float = 0.0) -> dict[str, Any]:
        scaled = vector * self.scale
        state = {"t": t, **{name: scaled[part] for name, part in self.parts.items()}}
        unknown = [name for name in ("phi", "vphi") if not self.sizes[name]]  # to a string
        return state | {name: np.zeros(self.sizes["x"]) for name in unknown}

    def steps(self) -> Array:
        """For differences: 1e-4 of the scales, and for friction of what is as large as N."""
        steps = np.full(len(self.scale), 1e-4)
        mu = self.blocks()["mu"]
        steps[mu] *= self.friction / self.scale[mu]
        return steps

    def blocks(self) -> dict[str, slice]:
        return self.parts


def levers(oracle: reference.Reference) -> Array:
    """How far, or fast, a mount's coordinate moves the axis [m, m/s of a path]."""
    return np.array(
        [
            np.linalg.norm(one.lever(0.0, oracle.centers[j])) if isinstance(one, Sprung) else 1.0
            for j, one in oracle.mounts.items()
        ]
    )


def friction_scales(oracle: reference.Reference, state: Mapping[str, Any]) -> tuple[Array, Array]:
    """Of every entry of "mu", by the law of the pulley that the link touches: the state at which
    friction is as large as N at the joints' stretch, and how the state changes with slip at rest.
    """
    n, zero = oracle.n_bodies, np.zeros(1)
    rows = np.size(state["mu"]) // n  # of every slot its states
    size, by_slip = np.ones((rows, n)), np.zeros((rows, n))
    states = oracle.n_states
    where = {name: value for name, value in state.items() if name not in ("mu", "slip")}
    touch = oracle.penetration(oracle.pack(where)) > 0
    for j, slot in enumerate(slots_of(oracle)):
        law = oracle.laws[j]
        if law is not None and rows > 0:
            pressure = oracle.c_tra * STRETCH / oracle.radii[j]
            normal = pressure * oracle.l0
            own = slice(slot * states, slot * states + law.n_states)
            size[own, touch[j]] = law.scale(pressure)
            step = 1e-12  # m/s; the slope at rest, where a law may have a kink
            at_rest = zero if law.n_states == 1 else np.zeros((law.n_states, 1))
            rate = law.rate(at_rest, zero + step, zero + normal, oracle.l0)
            by_slip[own, touch[j]] = rate.reshape(-1, 1) / step
    return size.ravel(), by_slip.ravel()


def solve(model: _core.Model, layout: Layout, state: Mapping[str, Any], g: float) -> Vector:
    """(1 - g J) k = g c by the core, as a function of c."""
    return lambda c: layout.pack(model.solve(state, g, layout.unpack(c)))


def whole(model: _core.Model, state: Mapping[str, Any]) -> tuple[Array, Array]:
    """J of the core in SI units, whose entries are given once each; the field of each row."""
    sizes = {name: np.size(state.get(name, ())) for name, *_ in _core.STATE_FIELDS}
    names = np.repeat(list(sizes), list(sizes.values()))
    rows, columns, values = model.jacobian(state)
    j = np.zeros((len(names), len(names)))
    j[rows, columns] = values
    assert np.count_nonzero(j) == len(values)
    return j, names


def jacobian(model: _core.Model, layout: Layout, state: Mapping[str, Any]) -> Array:
    """The same, scaled; what is no unknown of a string has no entries."""
    j, names = whole(model, state)
    known = np.isin(names, [name for name, size in layout.sizes.items() if size])
    assert not j[~known].any() and not j[:, ~known].any()
    return j[np.ix_(known, known)] * layout.scale / layout.scale[:, None]


def directions(layout: Layout, n: int, seed: int = 0) -> Iterator[tuple[list[str], Array]]:
    """Columns that differences take together, and the steps in which they do, of random signs.

    Links of one colour are three apart: in a row of a link every difference is one entry. Rows of
    pulleys and mounts see sums; columns of theirs go one by one. Last all columns at once, by half
    their steps: places and velocities of two links move what a joint's share of contact is by.
    """
    rng, steps = np.random.default_rng([seed, n]), layout.steps()
    signs = rng.choice([-1.0, 1.0], (2, len(steps)))
    parts = np.array_split(np.arange(n), n // 3)
    colour = np.concatenate([np.arange(len(part)) for part in parts])
    for name, columns in layout.blocks().items():
        groups: dict[Any, list[int]] = {}
        for k, step in enumerate(steps[columns].tolist()):  # steps of friction: of several laws
            key = k if name in BORDER else (k // n, colour[k % n], step)
            groups.setdefault(key, []).append(columns.start + k)
        for group in groups.values():
            along = np.zeros(len(steps))
            along[group] = (signs[0] * steps)[group]
            yield [name], along
    yield [name for name, size in layout.sizes.items() if size], 0.5 * signs[1] * steps


def slope_along(rate: Vector, y: Array, along: Array, curved: bool) -> Array:
    """The derivative by central differences.

    Of fourth order for speeds, with which friction may change over 0.1 m/s, some hundred steps, and
    for places and angles, by which the part of a link that is in contact is p_a / (p_a - p_b), some
    hundred steps long.
    """
    whole = 0.5 * (rate(y + along) - rate(y - along))
    if not curved:
        return np.asarray(whole)
    return np.asarray((4.0 * (rate(y + 0.5 * along) - rate(y - 0.5 * along)) - whole) / 3.0)


def assert_jacobian(
    layout: Layout, j: Array, rate: Vector, y: Array, n: int, fastest: float
) -> None:
    """Every entry of J is what differences of the rate say, in the directions above.

    Block by block, each to its own largest entry: rounding 5e-17 m of places over steps of 1e-8 m,
    1e-7 with a decade for sums (half as much again of the chords of a string); curvature, steps
    over penetrations of 1e-5 m, squared. By a travel entries are sums, which may cancel.
    """
    blocks = {name: part for name, part in layout.blocks().items() if layout.sizes[name]}
    rounding = 1e-7 if layout.sizes["phi"] else 1.5e-7
    bounds = {name: np.empty(len(y)) for name in blocks}  # of each row, by the field of the column
    size = np.abs(j)
    for column, columns in blocks.items():
        for row, rows in blocks.items():
            largest = np.max(size[rows, columns])
            bend = 1e-8 * largest
            if column == "travel":
                by_places = sum(size[rows, blocks[name]].sum(axis=1) for name in ("x", "y"))
                largest, bend = np.max(by_places), 0.0
            if row in ("vx", "vy", "vphi"):
                bend = 1e-8 * fastest
            bounds[column][rows] = rounding * largest + bend + 1e-12 * fastest
    for names, along in directions(layout, n):
        slope = slope_along(rate, y, along, not set(names).isdisjoint(CURVED))
        bound = sum(bounds[name] * np.max(np.abs(along[blocks[name]])) for name in names)
        wrong = np.abs(slope - j @ along) > bound
        assert not wrong.any(), ([row for row in blocks if wrong[blocks[row]].any()], names)


def rate_of_core(model: _core.Model, layout: Layout, t: float = 0.0) -> Vector:
    still = np.zeros(layout.sizes["theta"])
    return lambda v: layout.pack(model.rate(layout.unpack(v, t), still))


def vector_of_oracle(oracle: reference.Reference, state: dict[str, Any], slots: Array) -> Array:
    """The oracle's state of one of the core's; slots: of each pulley."""
    y = np.zeros(oracle.size)
    links, pulleys, memory = oracle.links(y), oracle.pulleys(y), oracle.memory(y)
    for row, name in enumerate(("x", "y", "phi")[: oracle.freedoms]):
        links[0, row], links[1, row] = state[name], state[f"v{name}"]
    pulleys[0], pulleys[1] = state["theta"], state["omega"]
    mounts = oracle.mount_states(y)
    for row, name in enumerate(MOUNT_STATES if oracle.mounts else ()):
        mounts[row] = state[name]
    for name, part in {"mu": memory[:-1], "slip": memory[-1:]}.items():
        if np.size(state[name]):
            by_slot = state[name].reshape(-1, len(part), oracle.n_bodies)
            part[:] = np.moveaxis(by_slot[slots], 1, 0)
    return y


def by_slot(pairs: Array, slots: Array) -> Array:
    """Friction of pairs (..., n_p, n_b) as the core keeps it: of each slot its rows of links."""
    rows = np.moveaxis(pairs.reshape(-1, *pairs.shape[-2:]), 1, 0)
    out = np.zeros((1 + max(slots), *rows.shape[1:]))
    np.add.at(out, slots, rows)
    return out.ravel()


def rate_of_oracle(oracle: reference.Reference, layout: Layout, slots: Array) -> Vector:
    """The oracle's right-hand side in the core's layout; slots: of each pulley.

    Core and oracle keep friction by slot and by pair: every pulley is given what its slot holds,
    and of the rates of a slot's pulleys, of which one at most is touched, the sum is taken.
    """
    n_p = oracle.n_pulleys
    names = ("x", "y", "phi")[: oracle.freedoms]
    held = [name for name in ("mu", "slip") if layout.sizes[name]]

    def rate(vector: Array) -> Array:
        y = vector_of_oracle(oracle, layout.unpack(vector), slots)
        dy = oracle.rhs(0.0, y, lambda t, theta, omega: np.zeros(n_p))
        d_links, d_pulleys, d_memory = oracle.links(dy), oracle.pulleys(dy), oracle.memory(dy)
        out: dict[str, Any] = {"theta": d_pulleys[0], "omega": d_pulleys[1]}
        for row, name in enumerate(MOUNT_STATES):
            out[name] = oracle.mount_states(dy)[row]
        for row, name in enumerate(names):
            out[name], out[f"v{name}"] = d_links[0, row], d_links[1, row]
        parts = {"mu": d_memory[:-1], "slip": d_memory[-1:]}
        for name in held:
            out[name] = by_slot(parts[name], slots)
        return layout.pack(out)

    return rate


def slots_of(oracle: reference.Reference) -> Array:
    """Friction slot of each pulley: the first that none before it has that it overlaps, or with
    which it could touch one joint of two links (MODEL section 8).
    """
    slots = np.zeros(oracle.n_pulleys, dtype=int)
    places = np.array(oracle.centers)
    for (j, mount), q in zip(oracle.mounts.items(), oracle.rest, strict=True):
        places[j] = mount.place(q, places[j])
    radii, reach, sides = oracle.radii, oracle.contact_radii, oracle.sides
    try:
        path = belt_line(places, radii, oracle.length, oracle.n_bodies, sides)[-1]
    except ValueError:  # no drive
        path = oracle.length
    tension = 2.0 * oracle.axial_stiffness * max(path / oracle.length - 1.0, 0.0)
    pressure = tension * (1.0 + tension / oracle.axial_stiffness) / radii
    depths = np.array([depth(one, oracle.contact) for one in pressure])
    dips = np.sqrt(0.25 + 2.0 * radii * depths / oracle.l0**2)
    moves = np.isin(np.arange(oracle.n_pulleys), oracle.mounted)
    for j in range(oracle.n_pulleys):
        apart = np.hypot(*(places[:j] - places[j]).T)
        ends = reach * (1 if sides is None else sides)
        span = np.sqrt(np.maximum(apart**2 - (ends[:j] - ends[j]) ** 2, 0.0))
        between = (2.0 + dips[:j] + dips[j] + 0.5 * (moves[:j] | moves[j])) * oracle.l0
        close = span <= (between if oracle.mesh == "joint" else 0.0)
        taken = set(slots[:j][(apart < reach[:j] + reach[j]) | close])
        slots[j] = next(slot for slot in range(j + 1) if slot not in taken)
    return slots
