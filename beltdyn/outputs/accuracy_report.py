"""Accuracy of a run: errors by quantity and by origin."""

from __future__ import annotations

import math
from collections.abc import Iterator

import attrs

from ..base import tables
from ..base.rounding import percent

#: Errors in time below this are not told apart: histories are compared as they are sampled, and a
#: millionth is beyond what any datum of a belt is known to.
TIME_FLOOR = 1e-6
#: The same in space: other meshes are integrated in time to no better than about this.
SPACE_FLOOR = 1e-4

#: Errors of the mesh from which on they are named, those in time known or not.
LARGE = 0.02

#: The quantities whose error in time the integration estimates.
TENSIONS = ("tension", "span_mean")

#: The quantities in engineers' words.
WORDS = {
    "tension": "tension of the spans over time",
    "speed": "speed of the pulleys over time",
    "span_mean": "mean tension of the spans",
    "creep": "creep",
    "friction": "friction on the pulleys",
    "power": "power and loss",
}

#: The same in a sentence.
SHORT = {"tension": "tension over time", "speed": "speed over time", "span_mean": "mean tension"}


@attrs.frozen(kw_only=True)
class QuantityError:
    """Estimated errors of one quantity, relative to its scale [1]; None where one is not known.

    :class:`beltdyn.accuracy.Observed` describes the quantities and their scales. Histories are
    judged by their root mean square difference, the others by the difference of means.

    Attributes:
        quantity: One of ``beltdyn.accuracy.QUANTITIES``.
        time: Error of the integration in time; ``1e-6``: 1e-6 or less.
        space: Error of the mesh; ``1e-4``: 1e-4 or less.
        order: Observed order p: the error of the mesh falls as 1/n_bodies^p. None where meshes
            differ without a trend, as where links that run on to the pulleys are most of the error.
        compliance: Effect of the compliance of the contact, against rigid pulleys.
    """

    quantity: str
    time: float | None = None
    space: float | None = None
    order: float | None = None
    compliance: float | None = None

    @property
    def known(self) -> float | None:
        """Sum of the known errors; None unless that of the mesh is known."""
        if self.space is None:
            return None
        return (self.time or 0.0) + self.space + (self.compliance or 0.0)

    @property
    def total(self) -> float | None:
        """Sum of the three errors; None unless those in time and in space are known."""
        return None if self.time is None else self.known


@attrs.frozen(kw_only=True)
class Accuracy:
    """What is known of the accuracy of a run; ``print`` it for a table.

    Without ``simulate(..., verify=True)`` it holds what costs nothing to compute: for tensions, an
    upper estimate of the error in time (``stats.error``) and an estimate of the error of the mesh,
    from the angles between links, the vibration that they cause as they land, and the torques
    (:func:`beltdyn.drive.sanity.mesh_error`); from the energy ledger, the error of the mesh for
    friction and power (:func:`beltdyn.drive.sanity.mesh_loss`) and, of links, for speeds that are
    not prescribed (:func:`beltdyn.outputs.sampled.slowed`); for every quantity, the effect of the
    compliance of the contact; the local error; and the energy balance. The errors of speed and
    creep in time, and of creep of the mesh, are not known then; for creep they can be many times
    those of tension.

    Attributes:
        verified: Whether other runs have shown the errors in time and in space of every quantity.
        errors: Errors by quantity; ``accuracy["creep"]`` is one of them.
        until: Time after which histories of two runs diverge exponentially [s]: they were compared
            up to there; beyond it only means can be right. None: they do not diverge.
        local_error: Largest *local* error of a step (``stats.local_error``): what the error control
            bounds, not the error of the result.
        balance: Largest residual of the energy balance over the energy transmitted.
        runs: The runs that verified this one, in words.
        notes: What was not verified, and why; observations without consequence.
    """

    verified: bool = False
    errors: tuple[QuantityError, ...]
    until: float | None = None
    local_error: float | None = None
    balance: float = 0.0
    runs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __getitem__(self, quantity: str) -> QuantityError:
        """Return the errors of a quantity."""
        for one in self.errors:
            if one.quantity == quantity:
                return one
        raise KeyError(quantity)

    def foreseen(self, expected: Expected) -> Accuracy:
        """Return a copy with the errors that pilot runs have shown in place of estimates.

        The error of mean tensions is at most that of the tension history, which pilots measure.
        """
        quantity, space, time = attrs.astuple(expected)
        names = TENSIONS if quantity in TENSIONS else (quantity,)
        shown = {"time": max(TIME_FLOOR, time)}
        if not math.isnan(space):
            shown["space"] = max(SPACE_FLOOR, space)
        errors = tuple(
            attrs.evolve(one, **shown) if one.quantity in names else one for one in self.errors
        )
        note = f"errors of {WORDS[quantity]}: as pilot runs on coarser meshes foresaw them"
        return attrs.evolve(self, errors=errors, notes=(*self.notes, note))

    def summary(self) -> list[tuple[str, str]]:
        """Return the total errors of a few quantities in rows of label and text."""
        rows = [("accuracy, measured" if self.verified else "accuracy, estimated", "")]
        for name in ("tension", "speed", "span_mean", "creep", "power"):
            one = self[name]
            if name == "speed" and not _large(one):
                continue
            in_time = _share(one.time, TIME_FLOOR)
            if not self.verified and not in_time.startswith("<"):
                in_time = f"at most {in_time}"
            parts = {
                "in time": one.time is not None and in_time,
                "of the mesh": one.space is not None and _share(one.space, SPACE_FLOOR),
                "of contact": one.compliance and _share(one.compliance, 0.0),
            }
            text = ", ".join(f"{share} {part}" for part, share in parts.items() if share)
            if one.total is not None:
                text = f"{_share(one.total, 0.0)}: {text}"
            else:
                unknown = [part for part in ("in time", "of the mesh") if not parts[part]]
                text = f"not known {' and '.join(unknown)}{'; ' if text else ''}{text}"
            rows.append((f"  {WORDS[name]}", text))
        if not self.verified:
            rows.append(("  measured", "with verify=True, on the command line --verify"))
        return rows

    def sentence(self) -> str:
        """Return the sum of the errors of each quantity in a sentence."""
        known: list[str] = []
        unknown: dict[str, list[str]] = {"of": [], "in time of": []}
        for one in self.errors:
            name = SHORT.get(one.quantity, one.quantity)
            if one.total is not None:
                known.append(f"{name} {_share(one.total, 0.0)}")
            else:
                name += f" (of the mesh {_share(one.space, 0.0)})" if _large(one) else ""
                unknown["of" if one.space is None else "in time of"].append(name)
        sentence = f"Errors, {'measured' if self.verified else 'estimated'}: {', '.join(known)}"
        if any(one.total is not None for one in self.errors if one.quantity in TENSIONS):
            sentence += " (of time, mesh and contact together; tensions: of the mean of all spans)"
        names = ", ".join(f"{part} {', '.join(some)}" for part, some in unknown.items() if some)
        if not names:
            return f"{sentence}."
        how = "" if self.verified else " (verify=True measures them)"
        return f"{sentence}{'; ' if known else ''}not known {names}{how}."

    def table(self) -> list[tuple[str, ...]]:
        """Return the errors as rows of text, the heading first."""
        rows = [
            (
                WORDS[one.quantity],
                _share(one.time, TIME_FLOOR),
                _share(one.space, SPACE_FLOOR),
                "-" if one.order is None else f"{one.order:.1f}",
                _share(one.compliance, 0.0),
                _share(one.total, 0.0),
            )
            for one in self.errors
        ]
        return [("error of", "in time", "of the mesh", "order", "of contact", "sum"), *rows]

    def remarks(self) -> Iterator[str]:
        """Yield the remarks below the table, a sentence each."""
        if not self.verified:
            yield (
                f"not verified{' in full' if self.runs else ''}: without other runs errors of "
                "tensions in time are upper estimates, those of the mesh right to a factor of three"
            )
        if self.until is not None:
            yield (
                f"from t = {self.until:.4g} s on small differences grow, and no tolerance makes "
                "histories right: they are judged up to there, means over the end of the run"
            )
        yield f"energy balance closed to {abs(self.balance):.2g} of the energy transmitted"
        yield from (f"verified by {run}" for run in self.runs)
        yield from self.notes

    def _repr_html_(self) -> str:
        heading, *rows = self.table()
        return tables.Table("", heading, rows, tuple(self.remarks())).html()

    def __str__(self) -> str:
        lines = tables.columns(self.table(), indent="")
        return "\n".join([*lines, *(f"  {remark}" for remark in self.remarks())])


@attrs.frozen(kw_only=True)
class Expected:
    """Errors of a run that pilot runs on other meshes have shown, for ``simulate(expected=...)``.

    Attributes:
        quantity: Quantity whose errors they are, one of ``beltdyn.accuracy.QUANTITIES``.
        space: Error of the mesh [1]; NaN: the pilot ran on this mesh alone.
        time: Error in time [1].
    """

    quantity: str
    space: float = attrs.field(converter=float)
    time: float = attrs.field(converter=float)


def _large(error: QuantityError) -> bool:
    return error.space is not None and error.space >= LARGE


def _share(value: float | None, floor: float) -> str:
    if value is None:
        return "-"
    if value == 0.0:
        return "0 %"
    if value <= floor:
        return f"< {percent(floor)}"
    return percent(value)
