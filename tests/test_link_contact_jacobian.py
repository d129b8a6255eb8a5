"""Both sides of every kink of contact along the links: J against differences that go to one side
alone. Guards csrc/kernels/link_contact_tangent.h and contact_points.h.

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
from reference_friction import Law, MaxwellSlip
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
#: What is 0 at a kink of a link: of its left end, its first Gauss point, the joint on its left.
QUANTITIES: dict[str, Callable[[reference.Reference, reference.AlongLinks, int], Any]] = {
    "end": lambda oracle, at, link: at.p_left[0, link],
    "gauss": lambda oracle, at, link: at.raw[0, 0, link],
    "share": lambda oracle, at, link: at.share_rate(oracle.previous)[0, link],
}


@dataclass(frozen=True)
class Laid:
    """A link of a ring laid on pulley 0, and the name of what is 0 at the kink."""

    case: Case
    link: int
    quantity: str

    def quantity_at(self, state: dict[str, Any]) -> float:
        oracle = self.case.oracle
        at = oracle.along_links_at(packed(oracle, state))
        return float(QUANTITIES[self.quantity](oracle, at, self.link))

    def at_kink(self) -> float:
        return self.quantity_at(self.case.state)

    def moving(self, direction: str, rates: bool) -> Array:
        """One scaled unit of a place or velocity of the link."""
        blocks, state = self.case.layout.blocks(), self.case.state
        centre = np.array([state["x"][self.link], state["y"][self.link]])
        nx, ny = centre / np.hypot(*centre)
        unit = {"out": (nx, ny, 0.0), "across": (-ny, nx, 0.0), "turn": (0.0, 0.0, 1.0)}[direction]
        out = np.zeros(len(self.case.layout.scale))
        for name, value in zip(("x", "y", "phi"), unit, strict=True):
            out[blocks["v" * rates + name].start + self.link] = value
        return out

    def slope(self, along: Array, away: float | None = None) -> Array:
        """J along the direction, compared block by block with the rates' differences on this side.

        Steps of 1e-9 m against lengths of 1e-5 m over which a share changes, of second order:
        1e-7; rounding, 5e-17 m over these, less. Speeds: 1e-5 m/s.
        """
        case, layout = self.case, self.case.layout
        if away is None:
            y, h = layout.pack(case.state), 1e-4 * along
            change = self.quantity_at(layout.unpack(y + h)) - self.quantity_at(layout.unpack(y - h))
            away = math.copysign(1.0, self.at_kink()) * (np.sign(change) or 1)
        fast = along[layout.blocks()["vx"].start :].any()
        got, want = one_sided(case, along, away * (1e-6 if fast else 1e-5))
        for name, rows in layout.blocks().items():
            largest = np.max(np.abs(want[rows]), initial=0.0)
            bound = 2e-6 * largest + (1e-7 if name.startswith("v") else 1e-9) * case.fastest
            assert np.max(np.abs(got - want)[rows], initial=0.0) <= bound, name
        return got

    def assert_slopes(self) -> None:
        for direction in DIRECTIONS:
            for rates in (False, True):
                self.slope(self.moving(direction, rates))

    def entry(self, name: str) -> int:
        """Of the joint on the left of the link."""
        return self.case.layout.blocks()[name].start + self.link


def packed(oracle: reference.Reference, state: dict[str, Any]) -> Array:
    return oracle.pack({k: v for k, v in state.items() if k not in ("mu", "slip")})


def lay_link(
    oracle: reference.Reference, state: dict[str, Any], link: int, angle: float, depth: Depth,
    slide: float,
) -> float:  # fmt: skip
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
    depths: tuple[Depth, Depth, Depth], quantity: str, law: Law, z: float, slide: float = 0.2
) -> Laid:
    """Three links on the side of pulley 0 that is away from the other, under this friction; the
    kink is of the middle one.
    """
    oracle, state = crossed(N_LINKS, mesh="joint", friction=(law, law))
    state = shaken(oracle, state, seed=3)
    link = int(np.argmin(state["x"]))
    angle = math.atan2(state["y"][link - 1], state["x"][link - 1]) + 0.5 * oracle.l0 / 0.1
    for one, depth in zip((link - 1, link, link + 1), depths, strict=True):
        angle = lay_link(oracle, state, one, angle, depth, slide)
    if state["mu"].size:
        slots = state["mu"].reshape(-1, oracle.n_states, N_LINKS)
        slots[dense.slots_of(oracle)[0], :, link - 1 : link + 3] = z
    return Laid(Case(core_of(oracle), oracle, state), link, quantity)


def let_go(partly: bool, side: float) -> Depth:
    """A link, three quarters of it in contact where it is partly, whose first Gauss point is about
    to be let go, or to be pressed again, by the damper; the second one is pressed.
    """
    oracle, share = crossed(N_LINKS, mesh="joint")[0], 0.75 if partly else 1.0
    pa, pb = (3e-4, 3e-4 * (1 - 1 / share)) if partly else (2e-4, 3e-4)
    x = share * np.array(GAUSS)
    p = pa + (pb - pa) * x
    release = -(oracle.c1 * p[0] + oracle.c2) * p[0] / oracle.b
    rates = np.array([release + side * 1e-9, 0.3])
    va, vb = np.linalg.solve(np.column_stack([1 - x, x]), rates)
    return pa, pb, float(va), float(vb)


def rim(right: float, rate: float) -> Callable[[float], tuple[Depth, Depth, Depth]]:
    """The left end comes to the rim or leaves it, the right one deep in contact or far off."""
    behind = FLAT if right > 0.0 else OFF
    return lambda side: (OFF, (side * 1e-11, right, rate, 0.05), behind)


#: Depths of three links on a side of each kink; a share's rate is (pa vb - pb va) / (pa - pb)^2.
KINKS: dict[str, Callable[[float], tuple[Depth, Depth, Depth]]] = {
    "end, other in, coming": rim(3e-4, 0.1),
    "end, other in, leaving": rim(3e-4, -0.1),
    "end, other out, coming": rim(-1e-3, 0.1),
    "end, other out, leaving": rim(-1e-3, -0.1),
    "gauss, flat": lambda side: (FLAT, let_go(False, side), FLAT),
    "gauss, partly": lambda side: (FLAT, let_go(True, side), OFF),
    "share": lambda side: (FLAT, (3e-4, -2e-4, 0.1, -2e-4 * 0.1 / 3e-4 + side * 1e-9), OFF),
}


@pytest.mark.one_in(5)
@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("kink", KINKS)
def test_both_sides_of_a_kink(kink: str, name: str) -> None:
    """J is that of the rates in every direction, and a link that does not touch does not rub."""
    law = oracle_law(EXAMPLES[name])
    pressure = 2.5e6 * 1e-4
    z = 0.5 * law.scale(pressure)
    if isinstance(law, MaxwellSlip):  # all elements stick
        z = 0.5 * pressure * min(one.mu / one.stiffness for one in law.elements)
    for side in (1.0, -1.0):
        laid = lay(KINKS[kink](side), kink.partition(",")[0], law, z)
        assert np.sign(laid.at_kink()) == side
        laid.assert_slopes()
        slide = laid.case.jacobian @ laid.moving("across", True)
        assert (slide[laid.entry("slip")] != 0.0) == ("other out" not in kink or side > 0.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("partly", [False, True], ids=["flat", "partly"])
def test_both_sides_of_sticking_along_the_links(way: float, partly: bool) -> None:
    """Elastic/plastic friction at its limit mu N / f, reached by speed, by the stretch, as N falls:
    above it the rate of the stretch goes with its own part of the limit alone, - k / c.
    """
    law = oracle_law(EXAMPLES["elastic_plastic"])
    here = (3e-4, -2e-4, -0.05, -0.1) if partly else FLAT  # belt leaves: nothing is diluted
    for side in (-1.0, 1.0):  # sticks, slips
        laid = lay((FLAT, here, OFF if partly else FLAT), "share", law, 0.0, way * 0.2)
        oracle, link = laid.case.oracle, laid.link
        y = packed(oracle, laid.case.state)
        at = oracle.along_links_at(y)
        assert laid.at_kink() <= 0.0
        pressure = at.normal(oracle.previous)[0, link] / at.share(oracle.previous)[0, link]
        limit = (1.0 + 1e-9 * side) * way * law.mu * pressure / oracle.l0
        v = float(oracle.contacts(y).velocity[0, link])
        slots = laid.case.state["mu"].reshape(-1, N_LINKS)
        slots[dense.slots_of(oracle)[0], link] = (limit - law.damping * v) / law.stiffness
        row, size = laid.entry("mu"), len(laid.case.layout.scale)
        laid.slope(laid.moving("across", True), side * way)
        longer = laid.slope(np.eye(size)[row], side * way)[row]
        laid.slope(laid.moving("out", False), side)  # farther out, N falls
        slips = -law.stiffness / law.damping if side > 0 else 0.0
        assert longer == pytest.approx(slips, rel=1e-5, abs=1e-9 * law.stiffness / law.damping)
