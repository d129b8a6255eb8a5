"""Numbers stated in the paper, and the same numbers read from a run.

Every statement of the paper is a :class:`Quantity` with the printed value and a scale: the
deviation that is accepted or, where the paper's own numbers conflict, the precision to which its
text can be read. With z = (computed - paper)/scale, the misfit, fixed before the search for
parameters, is

    misfit = sum z^2, to be minimised with |z| <= 1 for every demanded quantity.

A least-squares search has no constraints; :func:`demands` replaces them by residuals
40 max(0, |z| - 0.85).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import attrs
import numpy as np
from numpy.typing import NDArray

import beltdyn as bd

__all__ = [
    "QUANTITIES",
    "Links",
    "Quantity",
    "best_links",
    "candidates",
    "cost",
    "demands",
    "misfit",
    "paper_values",
    "read",
    "residuals",
]

Array = NDArray[np.float64]
#: Share of mu_k from which on friction counts as fully developed.
_FULL = 0.95
_ALMOST_EQUAL = 0.90
#: A joint force deviates from a span's level from this share of the spans' difference on.
_OFF_LEVEL = 0.01
#: Weight of the residuals that keep a search within the demands, and |z| at which they begin.
_HINGE, _HINGE_FROM = 40.0, 0.85


def dahl(result: bd.Result) -> bd.Dahl:
    """Return the friction of a run of the paper's drives."""
    friction = result.params.friction
    if not isinstance(friction, bd.Dahl):
        raise TypeError(f"the paper's drives have Dahl friction, got {friction!r}")
    return friction


@attrs.frozen
class Quantity:
    """One number that the paper states.

    Attributes:
        name: Short name, the key of :func:`read`.
        row: Row of the table it belongs to, 1 to 13.
        case: Load case of the paper, 1 or 2.
        says: What it is.
        unit: Its unit.
        paper: What the paper prints.
        scale: Deviation that counts as 1, in the unit.
        demanded: Whether it must agree within the scale; the others are in conflict with each
            other and agree as well as possible.
    """

    name: str
    row: int
    case: int
    says: str
    unit: str
    paper: float
    scale: float
    demanded: bool


class Links(NamedTuple):
    """Indices of the two "chosen elements", from 0; the paper shows them in a drawing only."""

    case_1: int
    case_2: int


def _table() -> tuple[Quantity, ...]:
    two_pi = 2.0 * np.pi
    lines: list[tuple[str, int, int, str, str, float, float, bool]] = [
        ("omega_0", 1, 1, "speed of the driving pulley after 0.3 s", "rad/s",
         -two_pi, 0.02 * two_pi, False),
        ("omega_1", 1, 1, "speed of the driven pulley after 0.3 s", "rad/s",
         -two_pi, 0.02 * two_pi, False),
        ("passive", 2, 1, "joint force at 0.4 s, passive span", "N", 120.0, 3.6, True),
        ("active", 3, 1, "joint force at 0.4 s, active span", "N", 1120.0, 33.6, True),
        ("growing", 4, 1, "first element of the growing force", "", 10.0, 1.0, True),
        ("grown", 4, 1, "first element of the active span", "", 23.0, 1.0, True),
        ("falling", 4, 1, "first element of the falling force", "", 40.0, 1.0, True),
        ("fallen", 4, 1, "first element of the passive span", "", 53.0, 1.0, True),
        ("arrival", 5, 1, "chosen element reaches the driven pulley", "s", 0.31, 0.01, False),
        ("departure", 5, 1, "chosen element leaves it", "s", 0.82, 0.01, False),
        ("peak", 6, 1, "its |mu|: first peak (within 40 ms)", "", 0.59, 0.03, False),
        ("floor", 6, 1, "its |mu|: lowest value after that", "", 0.0, 0.1, False),
        ("lost", 6, 1, "its |mu|: back to zero", "s", 0.38, 0.01, False),
        ("regained", 6, 1, "its |mu|: regained", "s", 0.39, 0.01, False),
        ("full", 6, 1, "its |mu|: mu_k reached (0.95 mu_k)", "s", 0.68, 0.02, False),
        ("equal", 7, 1, "friction almost the normal force (0.9 N)", "s", 0.60, 0.05, True),
        ("damping", 8, 1, "part of damping in the joint force, rms", "", 0.0, 0.01, True),
        ("start", 9, 2, "joint force of the chosen element: start", "N", 420.0, 21.0, False),
        ("minimum", 9, 2, "joint force: minimum", "N", 100.0, 5.0, False),
        ("maximum", 9, 2, "joint force: maximum", "N", 1110.0, 55.5, False),
        ("end", 9, 2, "joint force: end", "N", 580.0, 29.0, True),
        ("difference_1", 10, 2, "speed difference just before 0.25 s", "rad/s", 0.1, 0.02, False),
        ("difference_2", 10, 2, "speed difference just before 0.75 s", "rad/s", 0.1, 0.02, False),
        ("friction", 11, 2, "largest friction force of the chosen element", "N",
         190.0, 28.5, True),
        ("negative_from", 12, 2, "fully developed friction, -mu_k: from", "s", 0.16, 0.02, True),
        ("negative_to", 12, 2, "-mu_k: to", "s", 0.25, 0.02, True),
        ("positive_from", 12, 2, "+mu_k: from", "s", 0.66, 0.02, True),
        ("positive_to", 12, 2, "+mu_k: to", "s", 0.76, 0.02, True),
        ("extreme", 13, 2, "slip displacement: extreme", "mm", -0.83, 0.083, True),
        ("return", 13, 2, "slip displacement: return", "mm", 0.45, 0.045, False),
    ]  # fmt: skip
    return tuple(Quantity(*line) for line in lines)


QUANTITIES = _table()


def paper_values(case: int | None = None) -> dict[str, float]:
    """Return the paper's values by name; of one case only, if given."""
    return {q.name: q.paper for q in QUANTITIES if case in (None, q.case)}


def residuals(values: Mapping[str, float]) -> dict[str, float]:
    """Return (computed - paper)/scale of every quantity in ``values``."""
    return {q.name: (values[q.name] - q.paper) / q.scale for q in QUANTITIES if q.name in values}


def demands(values: Mapping[str, float]) -> Array:
    """Return the residuals that keep the demanded quantities of a search within their scales."""
    z = residuals(values)
    excess = [abs(z[q.name]) - _HINGE_FROM for q in QUANTITIES if q.demanded and q.name in z]
    return _HINGE * np.maximum(excess, 0.0)


def misfit(values: Mapping[str, float]) -> float:
    """Measure how far ``values`` are from the paper, sum z^2."""
    return float(sum(z * z for z in residuals(values).values()))


def cost(values: Mapping[str, float]) -> float:
    """Return the objective of a search: the misfit and the squares of :func:`demands`."""
    return misfit(values) + float(np.sum(demands(values) ** 2))


def read(result: bd.Result, case: int, link: int) -> dict[str, float]:
    """Read every quantity of a case from its run.

    Args:
        result: The run of that case; its samples must lie within 2 ms of each other.
        case: 1 or 2.
        link: Index of the chosen element.

    Returns:
        Values by name. The time of an event that does not occur (a link that never arrives,
        friction that never develops) is the end of the interval searched.
    """
    return _read_case_1(result, link) if case == 1 else _read_case_2(result, link)


def candidates(result: bd.Result, case: int) -> tuple[int, ...]:
    """Links that may be the chosen element of a case.

    Case 1: in a span at the start, on the driven pulley from just before or after 0.3 s. Case 2:
    on or beside the arriving half of the driven pulley from the start.
    """
    touching = result.contact.pulley == 1
    if case == 1:
        first = np.where(touching.any(axis=0), touching.argmax(axis=0), -1)
        time = result.t[np.maximum(first, 0)]
        return tuple(np.flatnonzero((first > 0) & (time > 0.26) & (time < 0.36)).tolist())
    start = np.flatnonzero(touching[0])[:4]
    return tuple(int(start[0]) + k for k in range(start.size))


def best_link(result: bd.Result, case: int) -> int:
    """Choose the element with which the run of a case agrees best with the paper."""
    return min(candidates(result, case), key=lambda link: cost(read(result, case, link)))


def best_links(case_1: bd.Result, case_2: bd.Result) -> Links:
    """Choose the elements with which the two runs agree best with the paper."""
    return Links(best_link(case_1, 1), best_link(case_2, 2))


def _row(result: bd.Result, t: float) -> int:
    return int(np.argmin(np.abs(result.t - t)))


def _first_at_or_above(t: Array, values: Array, level: float) -> float:
    """First time at which ``values`` reach ``level``, between samples by interpolation."""
    if t.size == 0:
        return float("nan")
    above = values >= level
    if not above.any():
        return float(t[-1])
    k = int(above.argmax())
    if k == 0:
        return float(t[0])
    part = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(t[k - 1] + part * (t[k] - t[k - 1]))


def _last_at_or_above(t: Array, values: Array, level: float) -> float:
    return -_first_at_or_above(-t[::-1], values[::-1], level)


def _within(t: Array, low: float, high: float) -> Array:
    return np.asarray((t >= low) & (t <= high))


def _elements(force: Array, passive: float, active: float) -> dict[str, float]:
    """Row 4: where the force along the belt leaves and reaches the levels of the spans.

    Elements are numbered from 1, as in the paper; between two elements by interpolation, and
    half an element is added, so that a change between elements 9 and 10 is at 10 on average.
    """
    n_b = force.size
    off = _OFF_LEVEL * (active - passive)
    number = np.arange(1.0, n_b + 1.0)
    low, high = passive + off, active - off
    top = n_b // 2
    rising, sinking = slice(0, top + 1), slice(top, n_b)
    return {
        "growing": 0.5 + _last_below(number[rising], force[rising], low),
        "grown": 0.5 + _first_at_or_above(number[rising], force[rising], high),
        "falling": 0.5 + _last_at_or_above(number[sinking], force[sinking], high),
        "fallen": 0.5 + _first_at_or_above(number[sinking], -force[sinking], -low),
    }


def _last_below(number: Array, force: Array, level: float) -> float:
    return _last_at_or_above(number, -force, -level)


def _read_case_1(result: bd.Result, link: int) -> dict[str, float]:
    late = result.t >= 0.35
    k = _row(result, 0.4)
    passive, active = (float(value) for value in result.span_tension[k])
    omega = result.pulleys.omega[late].mean(axis=0)
    values = {"omega_0": float(omega[0]), "omega_1": float(omega[1])}
    values |= {"passive": passive, "active": active}
    values |= _elements(result.joints.force[k], passive, active)
    return values | _passage(result, link) | {"damping": _damping_share(result, link)}


def _passage(result: bd.Result, link: int) -> dict[str, float]:
    """Rows 5 to 7: the chosen element on the driven pulley."""
    t = result.t
    touching = (result.contact.pulley[:, link] == 1) & (t > 0.2)
    if not touching.any():
        late = dict.fromkeys(("arrival", "departure", "lost", "regained", "full", "equal"), t[-1])
        return late | {"peak": 0.0, "floor": 1.0}
    first, last = int(touching.argmax()), int(np.flatnonzero(touching)[-1])
    arrival, departure = float(t[first]), float(t[last])
    mu = np.where(touching, np.abs(result.contact.mu[:, link]), 0.0)
    mu_k = dahl(result).mu_k
    here = np.arange(first, last + 1)
    # The first peak ends at the least |mu| within 0.12 s, with or without loss of contact.
    early = here[t[here] <= arrival + 0.04]
    dip = here[_within(t[here], arrival + 0.04, arrival + 0.12)]
    floor = float(mu[dip].min()) if dip.size else 1.0
    at_floor = dip[mu[dip] <= floor] if dip.size else here[-1:]
    after = here[here >= at_floor[-1]]
    return {
        "arrival": arrival,
        "departure": departure,
        "peak": float(mu[early].max()),
        "floor": floor,
        "lost": float(t[at_floor[0]]),
        "regained": float(t[at_floor[-1]]),
        "full": _first_at_or_above(t[after], mu[after], _FULL * mu_k),
        "equal": _first_at_or_above(t[after], mu[after], _ALMOST_EQUAL),
    }


def _damping_share(result: bd.Result, link: int) -> float:
    """Row 8: rms of the force from damping over the rms of the changes of the force."""
    info = result.params.info
    force = result.joints.force[:, link]
    damping = force - info["joint_stiffness"] * result.joints.deformation[:, link]
    return float(np.sqrt(np.mean(damping**2)) / np.std(force))


def _read_case_2(result: bd.Result, link: int) -> dict[str, float]:
    t, contact = result.t, result.contact
    force = result.joints.force[:, link]
    mu_k = dahl(result).mu_k
    mu, slip = contact.mu[:, link] / mu_k, 1e3 * contact.slip[:, link]
    speeds = result.pulleys.omega
    difference = np.abs(speeds[:, 0] - speeds[:, 1])
    negative, positive = _within(t, 0.05, 0.4), _within(t, 0.45, 0.9)
    # Slip until 0.5 s, with the reversal at 0.25 s, then the return.
    first = _within(t, 0.0, 0.5)
    extreme = float(slip[first].min())
    after = t >= t[first][slip[first].argmin()]
    return {
        "start": float(force[0]),
        "minimum": float(force.min()),
        "maximum": float(force.max()),
        "end": float(force[-1]),
        "difference_1": float(difference[_within(t, 0.23, 0.25)].mean()),
        "difference_2": float(difference[_within(t, 0.73, 0.75)].mean()),
        "friction": float(np.abs(contact.friction[:, link]).max()),
        "negative_from": _first_at_or_above(t[negative], -mu[negative], _FULL),
        "negative_to": _last_at_or_above(t[negative], -mu[negative], _FULL),
        "positive_from": _first_at_or_above(t[positive], mu[positive], _FULL),
        "positive_to": _last_at_or_above(t[positive], mu[positive], _FULL),
        "extreme": extreme,
        "return": float(slip[after].max()) - extreme,
    }
