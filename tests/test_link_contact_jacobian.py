"""Both sides of every kink of contact along the links: J of the solver against differences that go
to one side alone, and by hand what the kink changes. Guards csrc/kernels/link_contact_jacobian.h.

Kinks are: an end of a link comes to the pulley or leaves it; the damper lets a Gauss point go; the
share of a joint in contact begins to grow; friction under N / f slips. (Reversals of slip are in
test_jacobian.py, for both meshes.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import dense
import numpy as np
import pytest
import reference
from laws import EXAMPLES, oracle_law
from reference_friction import ElasticPlastic, Law, MaxwellSlip
from test_jacobian import Case, core_of, crossed, one_sided, shaken

Array = reference.Array
N_LINKS = 24
GAUSS = 0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)
#: Directions in which the link moves, or turns so that its left end goes inwards.
DIRECTIONS = ("out", "across", "turn")

#: Penetrations of a link's left and right end [m], and their rates [m/s].
Depth = tuple[float, float, float, float]
FLAT: Depth = (2e-4, 2e-4, 0.05, 0.02)
OFF: Depth = (-1e-3, -1.2e-3, 0.1, 0.2)
Quantity = Callable[[reference.AlongLinks], float]


@dataclass(frozen=True)
class Laid:
    """A link of a ring laid on pulley 0 and what is 0 at the kink, as a function of a state."""

    case: Case
    link: int
    quantity: Quantity

    @property
    def radial(self) -> Array:
        state = self.case.state
        centre = np.array([state["x"][self.link], state["y"][self.link]])
        return np.asarray(centre / np.hypot(*centre))

    def place(self) -> Array:
        return packed(self.case.oracle, self.case.state)

    def at_kink(self) -> float:
        return self.quantity(self.case.oracle.along_links_at(self.place()))

    def moving(self, direction: str, rates: bool) -> Array:
        """One scaled unit of a place or velocity of the link."""
        blocks = self.case.layout.blocks()
        nx, ny = self.radial
        x, y, phi = {"out": (nx, ny, 0.0), "across": (-ny, nx, 0.0), "turn": (0.0, 0.0, 1.0)}[
            direction
        ]
        out = np.zeros(len(self.case.layout.scale))
        for name, value in zip(("x", "y", "phi"), (x, y, phi), strict=True):
            out[blocks["v" * rates + name].start + self.link] = value
        return out

    def by(self, along: Array, quantity: Quantity) -> float:
        """Derivative of something of the contact, by the oracle, in the direction."""
        layout, oracle = self.case.layout, self.case.oracle
        y, h = layout.pack(self.case.state), 1e-4

        def value(step: float) -> float:
            place = packed(oracle, layout.unpack(y + step * along))
            return quantity(oracle.along_links_at(place))

        return (value(h) - value(-h)) / (2 * h)

    def slope(self, along: Array, away: float | None = None) -> Array:
        """J along the direction, compared block by block with the rates' differences on this side.

        Steps of 1e-9 m against lengths of 1e-5 m over which a share changes, of second order:
        1e-7; rounding, 5e-17 m over these, less. Speeds: 1e-5 m/s.
        """
        case, layout = self.case, self.case.layout
        if away is None:
            away = math.copysign(1.0, self.at_kink()) * (
                np.sign(self.by(along, self.quantity)) or 1
            )
        fast = along[layout.blocks()["vx"].start :].any()
        got, want = one_sided(case, along, away * (1e-6 if fast else 1e-5))
        for name, rows in layout.blocks().items():
            largest = np.max(np.abs(want[rows]), initial=0.0)
            bound = 2e-6 * largest + (1e-7 if name.startswith("v") else 1e-9) * case.fastest
            assert np.max(np.abs(got - want)[rows], initial=0.0) <= bound, name
        return got

    def force(self, rates: Array) -> Array:
        """On the link and its neighbours, which have the friction of its joints, over the mass."""
        blocks, scale = self.case.layout.blocks(), self.case.layout.scale
        three = self.link + np.array([-1, 0, 1])
        rows = np.array([blocks[name].start + three for name in ("vx", "vy")])
        return np.asarray((rates * scale)[rows].sum(axis=1))

    def pressed(self, left: float, right: float, mu: float) -> Array:
        """The force of such normal forces of its ends, with Dahl's friction at its joints."""
        contacts = self.case.oracle.contacts(self.place())
        y, total = self.place(), np.zeros(2)
        links, e = self.case.oracle.links(y), self.case.oracle.directions(y)[:, self.link]
        for end, side, normal in ((0, -1.0, left), (1, 1.0, right)):
            arm = links[0, :2, self.link] + side * 0.5 * self.case.oracle.l0 * e
            tangent = contacts.tangent[0, :, self.link + end]
            total += normal * (arm / np.hypot(*arm) - mu * tangent)
        return total / self.case.oracle.mass

    def entry(self, name: str, joint: int = 0) -> int:
        """Of the joint on the left of the link, or of another next to it."""
        return self.case.layout.blocks()[name].start + self.link + joint


def packed(oracle: reference.Reference, state: dict[str, Any]) -> Array:
    return oracle.pack({k: v for k, v in state.items() if k not in ("mu", "slip")})


def lay_link(
    oracle: reference.Reference,
    state: dict[str, Any],
    link: int,
    angle: float,
    depth: Depth,
    slide: float,
) -> float:
    """Put a link on pulley 0, its left end at this angle; returns the right end's angle."""
    a, b = (oracle.contact_radii[0] - p for p in depth[:2])
    turn = math.acos((a * a + b * b - oracle.l0**2) / (2 * a * b))  # clockwise
    n = np.array([[math.cos(angle), math.sin(angle)],
                  [math.cos(angle - turn), math.sin(angle - turn)]])  # fmt: skip
    left, right = a * n[0], b * n[1]
    middle, e = 0.5 * (left + right), (right - left) / oracle.l0
    across = np.array([-middle[1], middle[0]]) / np.hypot(*middle)
    spin = 0.5 * oracle.l0 * np.array([-e[1], e[0]])
    conditions = np.array([[*n[0], -n[0] @ spin], [*n[1], n[1] @ spin], [*across, 0.0]])
    speed = slide + state["omega"][0] * oracle.contact_radii[0]
    velocity = np.linalg.solve(conditions, [-depth[2], -depth[3], speed])
    phi = math.atan2(e[1], e[0])
    phi += 2 * math.pi * round((state["phi"][link] - phi) / (2 * math.pi))
    state["x"][link], state["y"][link], state["phi"][link] = *middle, phi
    state["vx"][link], state["vy"][link], state["vphi"][link] = velocity
    return angle - turn


def lay(
    before: Depth,
    here: Depth,
    behind: Depth,
    quantity: str | Quantity,
    law: Law | None = None,
    z: float = 0.0,
    slide: float = 0.2,
) -> Laid:
    """Three links on the side of pulley 0 that is away from the other, under this friction.

    The kink: of the left end, "end"; of the first Gauss point, "gauss"; of the share of the joint
    on the left, "share"; or of a quantity given.
    """
    friction = {} if law is None else {"friction": (law, law)}
    oracle, state = crossed(N_LINKS, mesh="joint", **friction)
    state = shaken(oracle, state, seed=3)
    link = int(np.argmin(state["x"]))
    angle = math.atan2(state["y"][link - 1], state["x"][link - 1]) + 0.5 * oracle.l0 / 0.1
    for one, depth in zip((link - 1, link, link + 1), (before, here, behind), strict=True):
        angle = lay_link(oracle, state, one, angle, depth, slide)
    if state["mu"].size:
        slots = state["mu"].reshape(-1, oracle.n_states, N_LINKS)
        slots[dense.slots_of(oracle)[0], :, link - 1 : link + 3] = z
    known: dict[str, Quantity] = {
        "end": lambda at: float(at.p_left[0, link]),
        "gauss": lambda at: float(at.raw[0, 0, link]),
        "share": lambda at: float(at.share_rate(oracle.previous)[0, link]),
    }
    chosen = known[quantity] if isinstance(quantity, str) else quantity
    return Laid(Case(core_of(oracle), oracle, state), link, chosen)


def all_slopes(laid: Laid) -> dict[tuple[str, bool], Array]:
    return {
        (direction, rates): laid.slope(laid.moving(direction, rates))
        for direction in DIRECTIONS
        for rates in (False, True)
    }


def state_of(name: str) -> tuple[Law, float]:
    law = oracle_law(EXAMPLES[name])
    assert law is not None
    pressure = 2.5e6 * 1e-4
    if isinstance(law, MaxwellSlip):  # all elements stick
        return law, 0.5 * pressure * min(one.mu / one.stiffness for one in law.elements)
    return law, 0.5 * float(law.scale(pressure))


# -------------------------------------------------------------------- ends


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("rate", [0.1, -0.1], ids=["coming", "leaving"])
@pytest.mark.parametrize("other", ["in", "out"])
def test_an_end_at_the_rim(name: str, rate: float, other: str) -> None:
    """The left end, the right one of the same link deep in contact or far off."""
    law, z = state_of(name)
    right = 3e-4 if other == "in" else -1e-3
    for side in (1.0, -1.0):
        here = (side * 1e-11, right, rate, 0.05)
        laid = lay(OFF, here, FLAT if other == "in" else OFF, "end", law, z)
        assert laid.at_kink() == pytest.approx(side * 1e-11, rel=1e-3)
        slopes = all_slopes(laid)
        touched = other == "in" or side > 0.0
        slide = slopes["across", True]
        assert (slide[laid.entry("slip")] != 0.0) == touched


@pytest.mark.parametrize("rate", [0.1, -0.1], ids=["coming", "leaving"])
def test_a_link_begins_to_press(rate: float) -> None:
    """One end just inside, the other p_b outside: N_a = b p_a' p_a / (p_a - p_b), if it comes in;
    the spring's part is of second order.
    """
    mu, slopes = 0.5, {}
    for side in (1.0, -1.0):
        here = (side * 1e-11, -1e-3, rate, 0.05)
        laid = lay(OFF, here, OFF, "end", z=mu)
        slopes[side] = all_slopes(laid)
    oracle = laid.case.oracle
    per_depth = oracle.b * max(0.0, rate) / 1e-3
    for direction in DIRECTIONS:
        deeper = laid.by(laid.moving(direction, False), laid.quantity)
        change = laid.force(slopes[1.0][direction, False] - slopes[-1.0][direction, False])
        expected = laid.pressed(per_depth * deeper, 0.0, mu)
        # what each side's slope leaves to the rounding of forces that cancel
        scale = laid.case.oracle.c_tra / oracle.mass * dense.STRETCH
        assert change == pytest.approx(expected, rel=1e-4, abs=1e-8 * scale), direction
        assert rate < 0.0 or direction == "across" or np.hypot(*expected) > 1e-5 * scale


# -------------------------------------------------------------------- Gauss points

CUT = 0.75  # share of the link in contact where it is partly


def let_go(oracle: reference.Reference, partly: bool, side: float) -> Depth:
    """A link whose first Gauss point is about to be let go, or to be pressed again, by the damper;
    the second one is pressed.
    """
    pa, pb = (3e-4, 3e-4 * (1 - 1 / CUT)) if partly else (2e-4, 3e-4)
    share = CUT if partly else 1.0
    x = share * np.array(GAUSS)
    p = pa + (pb - pa) * x
    release = -(oracle.c1 * p[0] + oracle.c2) * p[0] / oracle.b
    rates = np.array([release + side * 1e-9, 0.3])
    va, vb = np.linalg.solve(np.column_stack([1 - x, x]), rates)
    return pa, pb, float(va), float(vb)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("partly", [False, True], ids=["flat", "partly"])
def test_a_gauss_point_is_let_go(name: str, partly: bool) -> None:
    law, z = state_of(name)
    bare = crossed(N_LINKS, mesh="joint")[0]
    for side in (1.0, -1.0):
        here = let_go(bare, partly, side)
        laid = lay(FLAT, here, OFF if partly else FLAT, "gauss", law, z)
        assert np.sign(laid.at_kink()) == side
        all_slopes(laid)


@pytest.mark.parametrize("partly", [False, True], ids=["flat", "partly"])
def test_what_a_gauss_point_takes_away(partly: bool) -> None:
    """Of each end's normal force the point's weight, times 1 - x or x, times what its own changes;
    its place and weight do not matter, for there it does not press.
    """
    bare, mu, slopes = crossed(N_LINKS, mesh="joint")[0], 0.5, {}
    for side in (1.0, -1.0):
        here = let_go(bare, partly, side)
        laid = lay(FLAT, here, OFF if partly else FLAT, "gauss", z=mu)
        slopes[side] = all_slopes(laid)
    share = CUT if partly else 1.0
    weight, x = 0.5 * share, share * GAUSS[0]
    scale = bare.c_tra / bare.mass * dense.STRETCH
    for key in slopes[1.0]:
        q = laid.by(laid.moving(*key), laid.quantity)
        change = laid.force(slopes[1.0][key] - slopes[-1.0][key])
        expected = laid.pressed(weight * (1 - x) * q, weight * x * q, mu)
        assert change == pytest.approx(expected, rel=1e-4, abs=1e-8 * scale), key
    assert np.hypot(*expected) > 1e-3 * scale


# -------------------------------------------------------------------- share


@pytest.mark.parametrize("name", [name for name, law in EXAMPLES.items() if law.n_states])
def test_a_share_begins_to_grow(name: str) -> None:
    """z' has - z f' / (f + FRESH) where belt comes into contact, nothing where belt leaves."""
    law, z = state_of(name)
    pa, pb, va = 3e-4, -2e-4, 0.1
    slopes = {}
    for side in (1.0, -1.0):
        # (pa vb - pb va) / (pa - pb)^2
        vb = pb * va / pa + side * 1e-9
        laid = lay(FLAT, (pa, pb, va, vb), OFF, "share", law, z)
        assert np.sign(laid.at_kink()) == side
        slopes[side] = all_slopes(laid)
    oracle, row = laid.case.oracle, laid.entry("mu")
    share = float(oracle.along_links_at(laid.place()).share(oracle.previous)[0, laid.link])
    assert 0.5 < share < 1.0
    for key in slopes[1.0]:
        grows = laid.by(laid.moving(*key), laid.quantity)
        change = (slopes[1.0][key] - slopes[-1.0][key])[row] * laid.case.layout.scale[row]
        expected = -z * grows / (share + reference.FRESH)
        assert change == pytest.approx(expected, rel=1e-5, abs=1e-6 * abs(z)), key


# -------------------------------------------------------------------- slip under N / f


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("partly", [False, True], ids=["flat", "partly"])
def test_both_sides_of_sticking_along_the_links(way: float, partly: bool) -> None:
    """Elastic/plastic friction at its limit mu N / f: z' = v and F = f (k z + c v) below it; above,
    |F| = mu N, and z' does not know of v.
    """
    law = oracle_law(EXAMPLES["elastic_plastic"])
    assert isinstance(law, ElasticPlastic)
    here = (3e-4, -2e-4, -0.05, -0.1) if partly else FLAT  # belt leaves: nothing is diluted
    at_limit: dict[float, list[float]] = {}
    for side in (-1.0, 1.0):  # sticks, slips
        laid = lay(FLAT, here, OFF if partly else FLAT, "share", law, 0.0, way * 0.2)
        oracle, link = laid.case.oracle, laid.link
        k, c = law.stiffness * oracle.l0, law.damping * oracle.l0

        def pressure(at: reference.AlongLinks, o: Any = oracle, i: int = link) -> float:
            return float(at.normal(o.previous)[0, i] / at.share(o.previous)[0, i])

        along = oracle.along_links_at(laid.place())
        assert along.share_rate(oracle.previous)[0, link] <= 0.0
        limit = way * law.mu * pressure(along)
        v = float(oracle.contacts(laid.place()).velocity[0, link])
        slot = dense.slots_of(oracle)[0]
        laid.case.state["mu"].reshape(-1, N_LINKS)[slot, link] = (
            (1.0 + 1e-9 * side) * limit - c * v
        ) / k
        row, scale = laid.entry("mu"), laid.case.layout.scale
        stretch = np.zeros(len(scale))
        stretch[row] = 1.0
        moves = [laid.moving("across", True), stretch, laid.moving("out", False)]
        sides = [side * way, side * way, side]  # farther out, N falls
        rates = [laid.slope(one, away)[row] for one, away in zip(moves, sides, strict=True)]
        at_limit[side] = [float(rate * scale[row]) for rate in rates]
    # the joint has half of its link's velocity, across the link's middle
    nx, ny = laid.radial
    aligned = float(oracle.contacts(laid.place()).tangent[0, :, link] @ [-ny, nx])
    assert at_limit[-1.0][0] == pytest.approx(0.5 * aligned * scale[laid.entry("vx")], rel=1e-6)
    assert at_limit[-1.0][1] == pytest.approx(0.0, abs=1e-9 * k / c * scale[row])
    lost = way * law.mu / c * laid.by(moves[2], pressure)
    assert at_limit[1.0][0] == pytest.approx(
        way * law.mu / c * laid.by(moves[0], pressure), rel=1e-5, abs=1e-9
    )
    assert at_limit[1.0][1:] == pytest.approx([-k / c * scale[row], lost], rel=1e-5)
