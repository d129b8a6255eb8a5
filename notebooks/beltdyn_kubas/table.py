"""The paper's numbers and ours side by side.

Rows 1 to 13 are those of :mod:`beltdyn_kubas.paper_numbers`. Added here: row 0, that every run
starts from rest, and row 14, the effect of a smaller sigma.
"""

from __future__ import annotations

from collections.abc import Collection
from html import escape

import attrs
import numpy as np

import beltdyn as bd

from .cases import LINKS, REVERSALS, SOFT_SIGMA, Runs
from .paper_numbers import QUANTITIES, Links, Quantity, dahl, read

__all__ = ["Comparison", "Line", "compare"]

_HEAD = ("row", "quantity", "unit", "paper", "computed", "deviation", "scale", "demanded", "")
_TEXT_COLUMNS = (1, 2, 7, 8)
#: Time at the start in which no force may jump [s].
_AT_ONCE = 1e-3
#: Time after a reversal of the torque in which the speeds are seen to oscillate [s].
_RINGS = 0.1


@attrs.frozen
class Line:
    """One line of the table.

    Attributes:
        quantity: What the paper states.
        computed: The same, read off our runs.
        above: Whether the paper says "more than" and not "about".
    """

    quantity: Quantity
    computed: float
    above: bool = False

    @property
    def deviation(self) -> float:
        """Computed less paper, in the unit of the quantity."""
        return self.computed - self.quantity.paper

    @property
    def within(self) -> bool:
        """Whether it agrees with the paper: within the scale, or more than the paper's value."""
        if self.above:
            return self.deviation > 0.0
        return abs(self.deviation) <= self.quantity.scale

    @property
    def verdict(self) -> str:
        """The last column: within, missed, or in conflict."""
        if self.within:
            return "within"
        return "MISSED" if self.quantity.demanded else "conflict, see identification"

    def cells(self) -> tuple[str, ...]:
        """Return the texts of the columns."""
        q = self.quantity
        return (
            str(q.row),
            q.says,
            q.unit,
            f"{'> ' if self.above else ''}{q.paper:.4g}",
            f"{self.computed:.4g}",
            f"{self.deviation:+.3g}",
            "" if self.above else f"{q.scale:.3g}",
            "yes" if q.demanded else "no",
            self.verdict,
        )


@attrs.frozen(repr=False)
class Comparison:
    """The table; it prints itself, in notebooks as HTML.

    Attributes:
        lines: One per quantity, sorted by row.
    """

    lines: tuple[Line, ...]

    @property
    def demanded(self) -> tuple[Line, ...]:
        """Lines of the quantities that must come out within their scale."""
        return tuple(line for line in self.lines if line.quantity.demanded)

    @property
    def missed(self) -> tuple[Line, ...]:
        """Lines of the demanded quantities that did not come out within their scale."""
        return tuple(line for line in self.demanded if not line.within)

    def only(self, *, case: int | None = None, rows: Collection[int] | None = None) -> Comparison:
        """Keep the lines of a case, of some rows, or of both."""
        return Comparison(
            tuple(
                line
                for line in self.lines
                if case in (None, line.quantity.case)
                and (rows is None or line.quantity.row in rows)
            )
        )

    def __getitem__(self, name: str) -> Line:
        """Find the line of a quantity by its short name."""
        for line in self.lines:
            if line.quantity.name == name:
                return line
        raise KeyError(name)

    def assert_demands(self) -> None:
        """Raise AssertionError that lists the demanded quantities outside their scale."""
        if self.missed:
            raise AssertionError("\n" + _aligned([line.cells() for line in self.missed]))

    def assert_conflicts(self, scales: float) -> None:
        """Raise AssertionError that lists the other quantities more than so many scales off."""
        far = [
            line
            for line in self.lines
            if not line.quantity.demanded and abs(line.deviation) > scales * line.quantity.scale
        ]
        if far:
            raise AssertionError("\n" + _aligned([line.cells() for line in far]))

    def __str__(self) -> str:
        return _aligned([line.cells() for line in self.lines])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        def row(tag: str, cells: tuple[str, ...], look: str = "") -> str:
            sides = ["left" if k in _TEXT_COLUMNS else "right" for k in range(len(cells))]
            texts = zip(sides, cells, strict=True)
            inner = (f'<{tag} style="text-align:{s}">{escape(text)}</{tag}>' for s, text in texts)
            return f"<tr{look}>{''.join(inner)}</tr>"

        lines = []
        before = None
        for line in self.lines:
            look = "" if line.quantity.row == before else "border-top:1px solid #bbb;"
            look += "font-weight:bold;color:#b03000;" if line in self.missed else ""
            lines.append(row("td", line.cells(), f' style="{look}"' if look else ""))
            before = line.quantity.row
        return f"<table><thead>{row('th', _HEAD)}</thead><tbody>{''.join(lines)}</tbody></table>"


def _aligned(rows: list[tuple[str, ...]]) -> str:
    texts = [_HEAD, *rows]
    cells = [
        f"{'<' if k in _TEXT_COLUMNS else '>'}{max(map(len, column))}"
        for k, column in enumerate(zip(*texts, strict=True))
    ]
    return "\n".join("  ".join(map(format, row, cells)).rstrip() for row in texts)


def compare(runs: Runs, links: Links = LINKS) -> Comparison:
    """Read every number that the paper states from the runs.

    Args:
        runs: The three runs, of :func:`beltdyn_kubas.runs`.
        links: The chosen elements.
    """
    values = read(runs.case_1, 1, links.case_1) | read(runs.case_2, 2, links.case_2)
    lines = [
        _rest(runs.case_1, 1),
        _rest(runs.case_2, 2),
        *(Line(quantity, values[quantity.name]) for quantity in QUANTITIES),
        *_smaller_sigma(runs, links.case_2),
    ]
    return Comparison(tuple(sorted(lines, key=lambda line: line.quantity.row)))


def _rest(result: bd.Result, case: int) -> Line:
    """Row 0: in the first millisecond forces change by no more than the set torque can explain.

    So nothing jumps when the run starts. The drive need not be in equilibrium: pulleys that were
    held while the belt was laid may carry a torque when they are released.

    At rest a torque M on the pulleys changes the tension of each span by M/(2 r), one up and one
    down. The ramp starts from 0, and a ramp overshoots its own static answer by less than 22 %
    (1 - sin x/x of an undamped oscillator), so M/r at the end of that millisecond bounds it.
    """
    early = result.t <= result.t[0] + _AT_ONCE
    if np.count_nonzero(early) < 3:
        raise ValueError(f"case {case} must be sampled at least three times in its first 1 ms")
    force = result.joints.force[early]
    torque = np.abs(result.pulleys.torque[early] - result.pulleys.torque[0]).max(axis=0)
    bound = max(m / p.radius for m, p in zip(torque, result.params.pulleys, strict=True))
    return Line(
        Quantity(
            f"rest_{case}", 0, case, f"no jump, case {case}: joint forces move in the first ms by",
            "N", 0.0, float(bound), True,
        ),
        float(np.abs(force - force[0]).max()),
    )  # fmt: skip


def _smaller_sigma(runs: Runs, link: int) -> list[Line]:
    """Row 14: "the slope of the curve has changed", "slightly larger amplitudes"."""
    stiff, soft = runs.case_2, runs.case_2_soft
    ratio = SOFT_SIGMA / dahl(stiff).sigma
    slope = _slope_at_reversal(soft, link) / _slope_at_reversal(stiff, link)
    lines = [
        Line(
            Quantity(
                "slope", 14, 2, "sigma 5e3 against 1e4: slope of mu(x) at the reversal, ratio",
                "", ratio, 0.05 * ratio, True,
            ),
            slope,
        )
    ]  # fmt: skip
    for k, start in enumerate(REVERSALS, start=1):
        says = f"sigma 5e3 against 1e4: speed oscillation after {start} s, ratio"
        quantity = Quantity(f"oscillation_{k}", 14, 2, says, "", 1.0, np.nan, False)
        swing = _swing(soft, start) / _swing(stiff, start)
        lines.append(Line(quantity, swing, above=True))
    return lines


def _slope_at_reversal(result: bd.Result, link: int) -> float:
    """Slope of mu over the slip displacement where it leaves -mu_k [1/m].

    Where the belt slips forward, the local slope of (2.9) falls along a straight line in mu; its
    value at -mu_k is taken from the line through the samples between the reversal and mu = 0.
    Short back-and-forth motions of a vibrating belt are left out.
    """
    t, contact = result.t, result.contact
    mu_k = dahl(result).mu_k
    x, mu, speed = contact.slip[:, link], contact.mu[:, link], contact.velocity[:, link]
    first = np.flatnonzero(t <= sum(REVERSALS) / 2.0)
    turn = int(first[x[first].argmin()])
    rising = np.arange(turn, int(first[-1]))
    forward = np.minimum(speed[rising], speed[rising + 1]) > 0.0
    rising = rising[forward & (x[rising + 1] > x[rising]) & (mu[rising + 1] < 0.0)]
    dx, dmu = x[rising + 1] - x[rising], mu[rising + 1] - mu[rising]
    middle = 0.5 * (mu[rising + 1] + mu[rising])
    # Weighted by the slip between samples: division by a short one magnifies errors.
    line = np.polynomial.Polynomial.fit(middle, dmu / dx, 1, w=dx)
    return float(line(-mu_k))


def _swing(result: bd.Result, start: float) -> float:
    """Half the range of the speed difference soon after a reversal of the torque [rad/s]."""
    after = (result.t >= start) & (result.t <= start + _RINGS)
    difference = result.pulleys.omega[after, 0] - result.pulleys.omega[after, 1]
    return float(np.ptp(difference)) / 2.0
