"""The Jacobian, and the implicit methods' linear solver: (1 - g J) k = g c.

J against differences of the core's right-hand side and of the oracle's, entry by entry; on both
sides of every kink; and what the solver leaves over of it at steps far beyond the stiffest mode.
Guards csrc/solvers/jacobian.c and newton_system.c, csrc/kernels/ring.h and jacobian.h.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import attrs
import dense
import drive_table
import drives
import numpy as np
import pytest
import reference
from bridge import oracle_of
from drives import on_mesh
from laws import EXAMPLES, PLAIN_LUGRE, UNDAMPED_LUGRE, core_law, oracle_law
from mounted_drives import path, shake_mounts, take_up, tensioner
from reference_friction import ElasticPlastic, Law, MaxwellSlip, Stateless
from reference_mounts import Arm, Sprung
from reference_string import as_string
from test_kernels import available
from tiers import extended_if

import beltdyn as bd
from beltdyn import _core

Array = reference.Array
MESHES = ("joint", "paper", "string")
#: Drives of the table; of its ALE belts test_ale.py asks the same.
LINKS = [one for one in drive_table.names() if drive_table.drive(one).row["belt"] != "ale"]
LUGRE, ELASTIC, COULOMB = (EXAMPLES[name] for name in ("lugre", "elastic_plastic", "coulomb"))
EPS = np.finfo(float).eps


@dataclass(frozen=True)
class Case:
    """A model, the oracle of the same drive, and a state."""

    model: _core.Model
    oracle: reference.Reference
    state: dict[str, Any]

    @property
    def layout(self) -> dense.Layout:
        return dense.Layout.of(self.oracle, self.state)

    @property
    def fastest(self) -> float:
        """1/s: of the joints, or of a link on its contact where that is stiffer."""
        oracle = self.oracle
        contact = (oracle.c2 + 1e-4 * oracle.c1) / oracle.mass, oracle.b / oracle.mass
        return max(self.model.info["spectral_bound"], contact[0] ** 0.5, contact[1])

    @cached_property
    def jacobian(self) -> Array:
        """Asked for once, so that the state is final."""
        for array in self.state.values():
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
        return dense.jacobian(self.model, self.layout, self.state)


def core_of(oracle: reference.Reference) -> _core.Model:
    """The core's model of the oracle's drive; pulleys may overlap, unlike those of a Params."""
    o = oracle
    laws = [None if law is None else core_law(law) for law in o.laws]
    belt = (o.length, o.n_bodies, o.linear_density, o.axial_stiffness, o.axial_damping,
            o.bending_stiffness, o.bending_damping)  # fmt: skip
    drag = None if o.drag is None else [tuple(row) for row in o.drag]
    contact = (*o.contact, int(o.compensate), o.hunt_crossley)
    outside = None if o.sides is None else [side < 0 for side in o.sides]
    return _core.Model(
        belt, o.centers, o.radii, o.inertias, contact, None, o.gravity, drag, laws, o.mesh, outside,
        model="links" if o.freedoms == 3 else "string",
    )  # fmt: skip


def off_the_kinks(oracle: reference.Reference, state: dict[str, Any]) -> bool:
    """Whether differences with the steps used here stay on one side of every kink.

    Steps are 1e-4 of the scales in dense.py: 1e-8 m, and for velocities some 1e-3 m/s.
    """
    y = oracle.pack({k: v for k, v in state.items() if k not in ("mu", "slip")})
    kinks = {name: np.abs(at).min(initial=np.inf) for name, at in oracle.kinks(y).items()}
    deepest = max(float(oracle.penetration(y).max()), 0.0)
    largest = (oracle.c2 + oracle.c1 * deepest) * deepest
    damping = oracle.b + oracle.hunt_crossley * largest
    margin = 2e-8 * (oracle.c2 + 2 * oracle.c1 * deepest) + 1e-2 * damping
    return bool(
        kinks["penetration"] > 1e-7
        and kinks["force"] > margin
        and kinks["slip"] > 1e-2
        and kinks["share"] > 1e-2
    )


def shaken(oracle: reference.Reference, state: dict[str, Any], seed: int) -> dict[str, Any]:
    """The state with every link in motion of its own and friction anywhere within its limits."""
    rng = np.random.default_rng(seed)
    n, slots = oracle.n_bodies, dense.slots_of(oracle)
    for _ in range(100):
        out = dict(state)
        for name, size in {"x": 1e-6, "y": 1e-6, "phi": 1e-3}.items():
            out[name] = state[name] + size * rng.uniform(-1, 1, n)
        for name, size in {"vx": 0.5, "vy": 0.5, "vphi": 50.0}.items():
            out[name] = state[name] + size * rng.uniform(-1, 1, n)
        out["omega"] = state["omega"] + rng.uniform(-20, 20, oracle.n_pulleys)
        out["theta"] = np.asarray(state["theta"], dtype=float)
        if off_the_kinks(oracle, out):
            break
    else:
        raise LookupError("a kink is near whatever the links do")
    n_slots = 1 + slots.max() if any(oracle.laws) else 0
    # where nothing is touched; of every slot the states
    mu = 1e-5 * rng.uniform(-1, 1, (n_slots, oracle.n_states, n))
    out["slip"] = 1e-4 * rng.uniform(-1, 1, n_slots * n)
    at = oracle.contacts(oracle.pack({k: v for k, v in out.items() if k not in ("mu", "slip")}))
    for j, law in enumerate(oracle.laws):
        if law is not None:
            z = friction_states(law, at.velocity[j], at.normal[j], oracle.l0, rng)
            own = mu[slots[j], : law.n_states]
            own[:] = np.where(at.penetration[j] > 0, z, own)
            mu[slots[j], law.n_states :, at.penetration[j] > 0] = 0.0  # not of this law
    stateless = all(law is None or isinstance(law, Stateless) for law in oracle.laws)
    out["mu"] = np.empty(0) if stateless else mu.ravel()
    return out


def friction_states(
    law: Law, v: Array, normal: Array, l0: float, rng: np.random.Generator
) -> Array:
    """Anywhere within nine tenths of the bound; where sticking has one, on both sides of its limit,
    a fifth of it away.
    """
    if isinstance(law, MaxwellSlip):
        return np.array([friction_states(one, v, normal, l0, rng) for one in law.elements])
    spread = rng.uniform(-1, 1, len(v))
    if isinstance(law, ElasticPlastic):
        share = np.where(np.abs(spread) < 0.5, 1.6 * spread, spread + np.copysign(0.7, spread))
        limit = np.clip(law.mu * normal, 1.0, 1e4)  # N; of what is hardly pressed, or hit
        return np.asarray((share * limit / l0 - law.damping * v) / law.stiffness)
    return np.asarray(0.9 * law.bound * spread)


def case_of(oracle: reference.Reference, state: dict[str, Any], seed: int = 0) -> Case:
    return Case(core_of(oracle), oracle, shaken(oracle, state, seed))


def crossed(n: int, **changes: Any) -> tuple[reference.Reference, dict[str, Any]]:
    """A ring through two pulleys that overlap: links on none, one and both of them."""
    given: dict[str, Any] = {
        "centers": np.array([[0.0, 0.0], [0.05, 0.02]]),
        "radii": np.array([0.1, 0.09]),
        "inertias": np.array([0.01, 0.02]),
        "length": 0.6,
        "contact": (5e8, 2.5e6, 1e2),
        "bending_damping": 2e-7,
        "gravity": (1.0, -9.81),
    } | changes
    string = given.get("mesh") == "string"
    oracle = reference.paper_drive(n, **given | ({"mesh": "joint"} if string else {}))
    if string:
        oracle = as_string(oracle)
    angle = np.linspace(0.0, -2 * np.pi, n, endpoint=False)
    state = {"x": 0.025 + 0.115 * np.cos(angle), "y": 0.01 + 0.085 * np.sin(angle)}
    state |= {"phi": angle - np.pi / 2, "theta": np.zeros(2), "omega": np.zeros(2), "t": 0.0}
    return oracle, state | {name: np.zeros(n) for name in ("vx", "vy", "vphi")}


def off_the_stops(oracle: reference.Reference, state: dict[str, Any]) -> bool:
    """Whether steps of 1e-8 m, and 1e-3 m/s, cross no edge of a stop and no turn of a mount, and
    pulleys with drag turn on their axes by 1 rad/s, where Coulomb's part has no bend.
    """
    spin = np.array(state["omega"])
    for m, (j, one) in enumerate(oracle.mounts.items()):
        spin[j] -= state["travel_speed"][m] if isinstance(one, Arm) else 0.0
    if oracle.drag is not None and np.any(np.abs(spin[oracle.drag.any(axis=1)]) < 1.0):
        return False
    mounts = zip(dense.levers(oracle), oracle.mounts.values(), strict=True)
    for m, (reach, one) in enumerate(mounts):
        if not isinstance(one, Sprung):
            continue
        q, rate = state["travel"][m], state["travel_speed"][m]
        if abs(rate) * reach < 2e-2:
            return False
        for side, depth in enumerate(one.stop_depths(q)):
            raw = one.stop_stiffness * depth + one.stop_damping * (rate if side else -rate)
            step = one.stop_stiffness * 2e-8 + one.stop_damping * 2e-2
            if abs(depth) * reach < 1e-6 or (depth > 0.0 and abs(raw) * reach < step):
                return False
    return True


def of_drive(params: bd.Params, state: dict[str, Any], how: str, seed: int = 0) -> Case:
    """A state shaken off the kinks, its mounts displaced and moving as mounted_drives.py says."""
    oracle = oracle_of(params)
    for attempt in range(seed, 50):
        # the belt is in by some 3e-5 m
        moved = shake_mounts(oracle, state, 100 * attempt, how, 1e-5)
        if how == "saturated":
            moved["mount_friction"] = 0.97 * moved["mount_friction"]
        try:  # pressed far into the belt, its axis alone may be near one
            moved = shaken(oracle, moved, attempt)
        except LookupError:
            continue
        if off_the_stops(oracle, moved):
            return Case(params._model, oracle, moved)
    raise AssertionError


def left_over(case: Case, j: Array, g: float, c: Array) -> float:
    """Largest residual of (1 - g J) k = g c over the terms that cancel in it, in units of rounding.

    Terms of a field's rows are taken together.
    """
    layout = case.layout
    k = dense.solve(case.model, layout, case.state, g)(c)
    residual = np.abs(k - g * (j @ k) - g * c)
    terms = np.abs(k) + g * (np.abs(j) @ np.abs(k)) + g * np.abs(c)
    blocks = [rows for rows in layout.blocks().values() if rows.stop > rows.start]
    return max(float(np.max(residual[b]) / np.max(terms[b])) for b in blocks) / EPS


#: A solve without pivots leaves rounding times the growth of its blocks. These are an inertia plus
#: stiffness and damping, with which nothing grows, plus what friction, bending and compression add:
#: up to some hundred times as much as the rest. LU with pivots of the whole matrix, in the same
#: measure, leaves up to 1e5.
GROWTH = 1e4
STEPS = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # s


def assert_entries(case: Case, cores_too: bool = True) -> None:
    """J is that of the oracle's rates, and of the core's own."""
    layout, y, t = case.layout, case.layout.pack(case.state), case.state["t"]
    rates = [dense.rate_of_oracle(case.oracle, layout, dense.slots_of(case.oracle))]
    if cores_too:
        rates.append(dense.rate_of_core(case.model, layout, t=t))
    for rate in rates:
        dense.assert_jacobian(layout, case.jacobian, rate, y, case.oracle.n_bodies, case.fastest)


def assert_solves(case: Case) -> None:
    """What is left over, which bounds how far k is from a dense solve's by the condition."""
    j, rng = case.jacobian, np.random.default_rng(1)
    for g in STEPS:
        c = case.fastest * rng.uniform(-1, 1, len(j))
        assert left_over(case, j, g, c) <= GROWTH, g


STATES = ("moving", "saturated", "stops")  # of mounts: mounted_drives.py


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", LINKS)
def test_every_entry_and_every_solve(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Of each belt, law, contact, layout and mount: J is that of the core's rates and of the
    oracle's, the same at every level, and solves leave rounding at any step. States of mounts by
    turns.
    """
    params = drive_table.drive(name).scene.params
    how = STATES[LINKS.index(name) % 3]
    # Seed 2: with others a state lies on a kink, or where rates of a string whose damper has let go
    # of a bar depend on the length of a vector (string_belt.h, the share of the bar before).
    case = of_drive(params, drive_table.drive(name).settle()._to_core(params), how, 2)
    assert_entries(case)
    blocks, j = case.layout.blocks(), case.jacobian
    # rounding; as a joint comes into contact, 5e-17 m of places over a share of 1e-8 m
    bound = 1e-12 * case.fastest + 1e-9 * np.abs(j).max(axis=1)
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        there = Case(attrs.evolve(params)._model, case.oracle, case.state)
        assert np.all(np.abs(there.jacobian - j).max(axis=1) <= bound), level
        assert_solves(there)
    for m, one in enumerate(case.oracle.mounts.values()):  # coupled with the belt both ways
        if STATES.index(how) < 2 or not (isinstance(one, Sprung) and one.stops):
            assert np.any(j[blocks["vx"], blocks["travel"]][:, m])
            assert np.any(j[blocks["travel_speed"], blocks["x"]][m]) == isinstance(one, Sprung)


#: What the table's drives have no part of, or not enough: changes of a drive of a belt of links.
EXTREMES: dict[str, dict[str, Any]] = {
    "bending without damping": {"bending_stiffness": 0.01, "bending_damping": 0.0},
    "stiff bending damping": {"bending_stiffness": 0.01, "bending_damping": 1e-3},
    "no damping": {"axial_damping": 0.0, "contact": bd.Contact(quadratic=5e10, linear=2.5e7)},
    "damping of both kinds": {
        "contact": bd.Contact(quadratic=5e10, linear=2.5e7, damping=1e3, hunt_crossley=0.5)
    },
    "hard contact": {"contact": bd.Contact(quadratic=5e13, linear=2.5e10, damping=1e3)},
    "stiff friction": {"friction": bd.Dahl(mu_k=1.0, sigma=1e8)},
    "lugre, no damping": {"friction": UNDAMPED_LUGRE},
    "lugre, no Stribeck": {"friction": attrs.evolve(PLAIN_LUGRE, damping=0.1, viscous=0.05)},
    "pressed together": {},
}


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", EXTREMES)
def test_every_entry_at_extremes(mesh: str, name: str) -> None:
    params = on_mesh(drives.plain(), mesh)
    changes = EXTREMES[name]
    belt = {key: value for key, value in changes.items() if hasattr(params.belt, key)}
    if mesh == "string" and "bending_stiffness" in belt:
        belt = {"axial_damping": 14.0}
    others = {key: value for key, value in changes.items() if not hasattr(params.belt, key)}
    belt = attrs.evolve(params.belt, n_bodies=36, **belt)
    params = attrs.evolve(params, belt=belt)
    state = bd.settle(params)._to_core(params)
    params = attrs.evolve(params, **others)
    if name == "pressed together":  # every joint in compression, by 0.5 % of a link
        middle = params.pulleys[1].center[0] / 2
        state |= {"x": middle + 0.995 * (state["x"] - middle), "y": 0.995 * state["y"]}
    case = of_drive(params, state, "moving")
    assert_entries(case)
    assert_solves(case)


OVERLAPPING = {"one law": None, "mixed laws": LUGRE, "one without a state": COULOMB}


@cache
def overlapping(mesh: str, laws: str) -> Case:
    first = OVERLAPPING[laws]
    own = {} if first is None else {"friction": (oracle_law(first), oracle_law(ELASTIC))}
    return case_of(*crossed(40, mesh=mesh, **own))


@pytest.mark.one_in(3)
@pytest.mark.parametrize("laws", OVERLAPPING)
def test_every_entry_of_links_on_two_pulleys(mesh: str, laws: str) -> None:
    case = overlapping(mesh, laws)
    assert_entries(case)
    assert_solves(case)


def test_a_wrong_entry_would_show(mesh: str) -> None:
    """The comparison itself: of a neighbour, of a link far off, of the pulleys' rows and columns,
    and of friction, off by 1e-5 of the largest; friction of mixed laws, whose steps differ.
    """
    right = overlapping(mesh, "mixed laws")
    layout, j = right.layout, right.jacobian
    blocks, y = layout.blocks(), layout.pack(right.state)
    rate = dense.rate_of_core(right.model, layout)
    touched = np.flatnonzero(np.abs(j[blocks["omega"].start, blocks["mu"]]))[0]
    for row, at, column, by in (
        ("vx", 7, "y", 8), ("vy", 7, "vx", 27), ("omega", 0, "vx", 3), ("vx", 3, "omega", 1),
        ("omega", 1, "mu", touched), ("mu", touched, "mu", touched), ("theta", 1, "omega", 1),
    ):  # fmt: skip
        wrong = j.copy()
        largest = np.max(np.abs(j[blocks[row], blocks[column]]))
        wrong[blocks[row].start + at, blocks[column].start + by] += 1e-5 * largest
        with pytest.raises(AssertionError, match=row):
            dense.assert_jacobian(layout, wrong, rate, y, right.oracle.n_bodies, right.fastest)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("n_bodies", [36, 41, 48])
@pytest.mark.parametrize("make", [tensioner, take_up, path])
def test_the_ring_may_close_on_a_mounted_pulley(make: Any, n_bodies: int) -> None:
    """Joint 0, between the last link and the first, in the wrap; with blocks of links that are full
    and with some that are padded.
    """
    params = make(n_bodies=n_bodies)
    case = of_drive(params, bd.settle(params)._to_core(params), "moving", 3)
    oracle, state = case.oracle, dict(case.state)

    def share_on() -> Array:
        """Of every joint, the share in contact with the mounted pulley."""
        where = {name: value for name, value in state.items() if name not in ("mu", "slip")}
        return np.asarray(oracle.contacts(oracle.pack(where)).share[oracle.mounted[0]])

    first = int(np.argmax(share_on()))
    for name in ("x", "y", "phi", "vx", "vy", "vphi", "mu", "slip"):
        state[name] = np.roll(state[name], -first)
    state["phi"][n_bodies - first :] += 2 * np.pi * oracle.winding
    assert share_on()[0] > 0.3
    assert_entries(Case(case.model, oracle, state), cores_too=False)


#: Around the widths of the vectors and of the arcs: arcs of one link, arcs one link shorter.
LENGTHS = (*range(3, 21), 31, 32, 33, 59, 60, 61, 63, 64, 65, 71, 72)
SOME = {"joint": (*range(3, 21), 33, 64), "paper": (3, 5, 9, 17, 65), "string": (3, 4, 8, 15, 33)}


@pytest.mark.one_in(5)
@pytest.mark.parametrize(
    ("mesh", "n", "mixed"),
    extended_if(
        lambda case: case[1] not in SOME[case[0]] or (case[2] and case[1] not in (8, 17)),
        [
            (mesh, n, mixed)
            for mesh in MESHES
            for n in LENGTHS
            for mixed in (False, True)
            if not mixed or n in (5, 7, 8, 9, 16, 17, 33)
        ],
    ),
)
def test_every_ring_length_at_every_level(
    monkeypatch: pytest.MonkeyPatch, mesh: str, n: int, mixed: bool
) -> None:
    laws = {"friction": (oracle_law(LUGRE), oracle_law(ELASTIC))} if mixed else {}
    oracle, state = crossed(n, mesh=mesh, **laws)
    j = None
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        case, rng = case_of(oracle, state, seed=n), np.random.default_rng(n)
        if j is None:
            j = case.jacobian
            assert_entries(case, cores_too=False)
        for g in (1e-6, 1e-4, 1e-2):
            for _ in range(3):
                c = case.fastest * rng.uniform(-1, 1, len(j))
                assert left_over(case, j, g, c) <= GROWTH, (level, g)


@dataclass(frozen=True)
class Spot:
    """A link of a ring on one pulley, or a joint, named by the link on its right, both of whose
    links are moved together; radial and tangential unit vectors.
    """

    case: Case
    link: int
    radial: Array
    across: Array

    def vector(self, direction: Array, rates: bool) -> Array:
        """Displacement, or velocity, of the point of contact by one scaled unit."""
        out, blocks = np.zeros(len(self.case.layout.scale)), self.case.layout.blocks()
        for component, name in zip(direction, ("vx", "vy") if rates else ("x", "y"), strict=True):
            for link in links_at(self.case.oracle, self.link):
                out[blocks[name].start + link] = component
        return out

    def stand_still(self, slide: float) -> None:
        """The links and their pulley, but for the links' sliding past it."""
        state, links = self.case.state, links_at(self.case.oracle, self.link)
        state["vx"][links], state["vy"][links] = slide * self.across
        state["vphi"][links] = state["omega"][0] = 0.0

    def slope(self, along: Array, side: float) -> Array:
        """J along, which is that of the rates on this side, to what rounding leaves of them."""
        fast = along[self.case.layout.blocks()["vx"].start :].any()
        got, expected = one_sided(self.case, along, side * (1e-6 if fast else 1e-3))
        bound = 1e-6 * np.max(np.abs(expected)) + 1e-9 * self.case.fastest
        assert np.max(np.abs(got - expected)) <= bound
        return got

    def entry(self, name: str) -> int:
        return self.case.layout.blocks()[name].start + self.link


def one_sided(case: Case, along: Array, h: float) -> tuple[Array, Array]:
    """J times a direction; the same by differences that go to one side alone.

    Of second order: exact where the rates are quadratic, as the contact's force is. Steps of
    speeds, 1e-5 m/s, are small against a Stribeck velocity.
    """
    rate, y = dense.rate_of_core(case.model, case.layout), case.layout.pack(case.state)
    slope = (-3 * rate(y) + 4 * rate(y + h * along) - rate(y + 2 * h * along)) / (2 * h)
    return case.jacobian @ along, slope


def links_at(oracle: reference.Reference, point: int) -> list[int]:
    """Links that move with a point of contact."""
    return [point - 1, point] if oracle.mesh == "joint" and oracle.freedoms == 3 else [point]


def place(mesh: str, sink: float, v_radial: float, v_slide: float, z: Any, law: Law) -> Spot:
    """A link of the ring moved onto pulley 0, so deep, with these speeds from and past it; a law
    of friction and its state.
    """
    oracle, state = crossed(24, mesh=mesh, friction=(law, law))
    state = shaken(oracle, state, seed=3)

    def packed() -> Array:
        return oracle.pack({k: v for k, v in state.items() if k not in ("mu", "slip")})

    at = oracle.penetration(packed())[:, 1:]
    link = 1 + int(np.argmax(at[0] - 10.0 * np.maximum(at[1], 0.0)))
    point, velocity = (part[:, link] for part in oracle.points(packed()))
    radial = point / np.hypot(*point)
    across = np.array([-radial[1], radial[0]])
    rho = oracle.contact_radii[0] - sink
    moved = rho * radial - point
    faster = v_radial * radial + (v_slide + state["omega"][0] * rho) * across - velocity
    for one in links_at(oracle, link):
        for k, (where, speed) in enumerate((("x", "vx"), ("y", "vy"))):
            state[where][one] += moved[k]
            state[speed][one] += faster[k]
    assert np.delete(np.abs(oracle.penetration(packed())), link, axis=1).min() > 1e-6
    if state["mu"].size:
        slots = state["mu"].reshape(-1, oracle.n_states, 24)
        slots[dense.slots_of(oracle)[0], :, link] = np.ravel(z)
    return Spot(Case(core_of(oracle), oracle, state), link, radial, across)


@pytest.mark.one_in(5)
@pytest.mark.parametrize("name", EXAMPLES)
def test_both_sides_of_sliding(mesh: str, name: str) -> None:
    """Of whatever law: forces and the state's rate; at rest, the mean of both sides. Of friction
    that has pushed either way, by turns.
    """
    share = (0.6, -0.3)[(list(EXAMPLES).index(name) + MESHES.index(mesh)) % 2]
    law = oracle_law(EXAMPLES[name])
    z = share * law.scale(2.5e6 * 1e-5)  # of the pressure at this depth
    slopes = []
    for side in (1.0, -1.0, 0.0):
        spot = place(mesh, 1e-5, 0.0, 0.0, z, law)
        spot.stand_still(side * 1e-10)
        along = spot.vector(spot.across, rates=True)
        slopes.append(spot.slope(along, side) if side else spot.case.jacobian @ along)
    fields = (field for field in ("vx", "vy", "mu", "slip") if spot.case.layout.sizes[field])
    rows = [spot.entry(field) for field in fields]
    mean = 0.5 * (slopes[0] + slopes[1])[rows]
    assert slopes[2][rows] == pytest.approx(mean, rel=1e-8, abs=1e-9 * spot.case.fastest)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_both_sides_of_sticking(way: float) -> None:
    """Elastic/plastic friction at its limit, reached by speed, by the stretch, as N falls: above
    it the rate of the stretch does not know of v.
    """
    law, sink, v = oracle_law(ELASTIC), 1e-4, way * 0.2
    bare = crossed(24)[0]
    limit = way * law.mu * (bare.c1 * sink**2 + bare.c2 * sink)
    for side in (-1.0, 1.0):  # sticks, slips
        z = ((1.0 + 1e-9 * side) * limit / bare.l0 - law.damping * v) / law.stiffness
        spot = place("paper", sink, 0.0, v, z, law)
        row, scale = spot.entry("mu"), spot.case.layout.scale
        faster = spot.slope(spot.vector(spot.across, rates=True), side * way)[row]
        spot.slope(np.eye(len(scale))[row], side * way)
        spot.slope(spot.vector(spot.radial, rates=False), side)
        by_speed = scale[spot.entry("vx")] / scale[row] if side < 0 else 0.0
        assert faster == pytest.approx(by_speed, rel=1e-7, abs=1e-9 / scale[row])


@pytest.mark.one_in(5)
@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("kink", [1e-5, 2e-4, "coming", "leaving"])
def test_both_sides_of_contact(name: str, kink: float | str) -> None:
    """N lets go by the speed of a link so deep, or by its place; or a link comes to the pulley, or
    leaves it: on both sides, J is that of the rates; outside, friction does nothing.
    """
    law, oracle = oracle_law(EXAMPLES[name]), crossed(24)[0]
    for side in (1.0, -1.0):
        if isinstance(kink, float):
            release = (oracle.c1 * kink**2 + oracle.c2 * kink) / oracle.b
            sink, v_radial = kink, release + side * 1e-10
        else:
            sink, v_radial = -side * 1e-11, -0.1 if kink == "coming" else 0.1
        spot = place("paper", sink, v_radial, 0.2, 0.5 * law.scale(2.5e6 * 1e-4), law)
        for rates in (True, False):
            spot.slope(spot.vector(spot.radial, rates), side)
        slide = spot.slope(spot.vector(spot.across, rates=True), side)
        for field in ("slip", "mu") if EXAMPLES[name].n_states else ("slip",):
            if isinstance(kink, str):
                assert (slide[spot.entry(field)] != 0.0) <= (side < 0.0), field
