"""Accuracy of a run: errors by quantity and by origin."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Protocol

import attrs
import numpy as np

from ..base import tables
from ..base.checks import Array
from ..base.rounding import percent
from ..base.run_warnings import RunWarning
from ..drive import sanity
from ..drive.params import Params
from .averages import LAST, time_weights
from .histories import (
    BeltHistory,
    ContactHistory,
    CouplingHistory,
    EnergyLedger,
    JointHistory,
    MountHistory,
    PulleyHistory,
    Stats,
)
from .spans import span_tension
from .state import State

__all__ = [
    "SPACE_FLOOR",
    "TIME_FLOOR",
    "WORDS",
    "Accuracy",
    "Expected",
    "QuantityError",
    "Running",
    "known",
    "running",
]

#: Errors in time below this are not told apart: histories are compared as they are sampled, and a
#: millionth is beyond what any datum of a belt is known to.
TIME_FLOOR = 1e-6
#: The same in space: other meshes are integrated in time to no better than about this.
SPACE_FLOOR = 1e-4

#: Samples at which tensions are looked at; all change what they show by 1 to 3 %.
LOOKS = 100

#: Least friction force by which its errors are measured, as a share of the tension.
MIN_FRICTION = 1e-2

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
        time: Error of the integration in time; ``1e-6`` stands for anything below.
        space: Error of the mesh; ``1e-4`` stands for anything below.
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
        if self.time is None or self.space is None:
            return None
        return self.time + self.space + (self.compliance or 0.0)


@attrs.frozen(kw_only=True)
class Accuracy:
    """What is known of the accuracy of a run; ``print`` it for a table.

    Without ``simulate(..., verify=True)`` it holds what costs nothing to compute: for tensions, an
    upper estimate of the error in time (``stats.error``) and an estimate of the error of the mesh,
    from the angles between links, the vibration that they cause as they land, and the torques
    (:func:`beltdyn.drive.sanity.mesh_error`); for friction and power, the error of the mesh, from
    the energy lost in the contact (:func:`beltdyn.drive.sanity.mesh_loss`, needs the ledger); for
    every quantity, the effect of the compliance of the contact; the local error; and the energy
    balance. The errors of speed and creep in time and of the mesh are not known then; for creep
    they can be many times those of tension.

    Attributes:
        verified: Whether other runs have shown the errors in time and in space of every quantity.
        errors: Errors by quantity; ``accuracy["creep"]`` is one of them.
        until: Time after which histories of two runs diverge exponentially [s]: they were compared
            up to there; beyond it only means can be right. None: they do not diverge.
        local_error: Largest *local* error of a step (``stats.local_error``): what the error
            control keeps, not the error of the result.
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
        errors = tuple(
            attrs.evolve(
                one,
                time=max(TIME_FLOOR, time),
                space=one.space if math.isnan(space) else max(SPACE_FLOOR, space),
            )
            if one.quantity in names
            else one
            for one in self.errors
        )
        note = f"errors of {WORDS[quantity]}: as pilot runs on coarser meshes foresaw them"
        return attrs.evolve(self, errors=errors, notes=(*self.notes, note))

    def summary(self) -> list[tuple[str, str]]:
        """Return the total errors of tensions and creep in a few rows of label and text."""
        rows = [("accuracy, measured" if self.verified else "accuracy, estimated", "")]
        for name in ("tension", "span_mean", "creep", "power"):
            one = self[name]
            parts = {
                "in time": one.time is not None and self._in_time(one),
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
                unknown["of" if one.space is None else "in time of"].append(name)
        told = f"Errors, {'measured' if self.verified else 'estimated'}: {', '.join(known)}"
        if any(one.total is not None for one in self.errors if one.quantity in TENSIONS):
            told += " (of time, mesh and contact together; tensions: of the mean of all spans)"
        names = ", ".join(f"{part} {', '.join(some)}" for part, some in unknown.items() if some)
        if not names:
            return f"{told}."
        how = "" if self.verified else " (verify=True measures them)"
        return f"{told}{'; ' if known else ''}not known {names}{how}."

    def _in_time(self, one: QuantityError) -> str:
        share = _share(one.time, TIME_FLOOR)
        return share if self.verified or share.startswith("<") else f"at most {share}"

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
        return "\n".join(tables.Table("", heading, rows, tuple(self.remarks())).html())

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


class Run(Protocol):
    """The part of :class:`beltdyn.Result` that is needed by modules that it imports."""

    @property
    def t(self) -> Array: ...
    @property
    def params(self) -> Params: ...
    @property
    def pulleys(self) -> PulleyHistory: ...
    @property
    def belt(self) -> BeltHistory: ...
    @property
    def joints(self) -> JointHistory: ...
    @property
    def contact(self) -> ContactHistory: ...
    @property
    def mounts(self) -> MountHistory | None: ...
    @property
    def couplings(self) -> CouplingHistory | None: ...
    @property
    def energy(self) -> EnergyLedger | None: ...
    @property
    def span_tension(self) -> Array: ...
    @property
    def stats(self) -> Stats: ...
    @property
    def accuracy(self) -> Accuracy: ...
    @property
    def warnings(self) -> tuple[RunWarning, ...]: ...
    @property
    def prescribed(self) -> tuple[str, ...]: ...
    @property
    def _running(self) -> Running | None: ...
    def _rims(self) -> Array | None: ...
    def _has(self, name: str) -> bool: ...


def known(run: Run) -> Accuracy:
    """Return the accuracy of a run as far as it is known without another run.

    ``stats.error`` is that of all joint forces, which no span's tension exceeds by much.
    """
    stats, of_contact = run.stats, run.params._compliance_error
    with np.errstate(all="ignore"):  # a failed run may end with huge numbers
        of_mesh = {name: value for name, value in _of_mesh(run).items() if math.isfinite(value)}
    return Accuracy(
        errors=tuple(
            QuantityError(
                quantity=name,
                time=None if name not in TENSIONS or not stats.error else stats.error,
                space=max(SPACE_FLOOR, of_mesh[name]) if name in of_mesh else None,
                compliance=of_contact[name],
            )
            for name in WORDS
        ),
        local_error=stats.local_error,
        balance=stats.balance,
    )


@attrs.frozen(kw_only=True)
class Running:
    """Motion and load of the belt in a run, the same whatever outputs are kept.

    Attributes:
        speed: Speed of the fastest rim, root mean square over the last part; the belt's but for
            creep [m/s].
        shaking: Relative rise of the mean tension by links that land then [1].
        shaking_over_time: The same over the whole run.
        pull: Largest difference of the mean tensions on two sides of a pulley, of its torque [N].
        power: Largest mean power of a torque [W].
    """

    speed: float
    shaking: float
    shaking_over_time: float
    pull: float = 0.0
    power: float = 0.0


def running(params: Params, t: Array, arrays: Mapping[str, Array], end: State) -> Running:
    """Read motion and load of the belt off a run."""
    radii = params._radii
    omega, torque, across = arrays["omega"], arrays["torque"], arrays["across"][:, 0]
    if t.size < 2:
        speed = float(np.max(np.abs(end.omega * radii)))
        shaken = sanity.shaken(params, speed)
        return Running(speed=speed, shaking=shaken, shaking_over_time=shaken)
    rims, lasts = np.max(np.abs(omega * radii), axis=1) ** 2, float(t[-1] - t[0])
    there = np.flatnonzero(~np.isnan(across))  # looked at in some samples

    def seen(last: float) -> tuple[float, float]:
        speed = math.sqrt(float(time_weights(t, t[-1] - last * lasts) @ rims))
        late = there[t[there] >= t[-1] - last * lasts]
        square = float(np.mean(across[late if late.size else there]))
        return speed, sanity.shaking_seen(params, speed, square, lasts)

    speed, shaken = seen(LAST)
    found = Running(speed=speed, shaking=shaken, shaking_over_time=seen(1.0)[1])
    if not lasts > 0.0:
        return found
    # Means: motions that are prescribed need torques that jump with every link.
    late = time_weights(t, t[-1] - LAST * lasts)
    most = 2.0 * float(params.info["strain_tension"])  # all it can hold
    pull = min(most, float(np.max(np.abs(late @ torque) / radii)))
    power = float(np.max(np.abs(late @ (torque * omega))))
    return attrs.evolve(found, pull=pull, power=power)


def _vibration(run: Run) -> float:
    """Return the vibration of the span tensions at the end of a run, root mean square [N].

    Where small differences grow exponentially, other meshes vibrate as much at other phases.
    """
    t, n_p = run.t, len(run.params.pulleys)
    rows = np.flatnonzero(t >= t[-1] - LAST * (t[-1] - t[0]))
    rows = rows[:: 1 + rows.size // LOOKS]
    tension = span_tension(run.contact.pulley[rows], run.joints.force[rows], n_p)
    tension = tension[:, np.isfinite(tension).all(axis=0)]
    return math.sqrt(float(np.mean(np.var(tension, axis=0)))) if tension.size else 0.0


def _of_mesh(run: Run) -> dict[str, float]:
    """Estimate the errors of the mesh, from the speeds, torques and losses of a run."""
    params, t, seen = run.params, run.t, run._running
    if seen is None:
        return {}
    shaking = {"tension": seen.shaking_over_time, "span_mean": seen.shaking}
    found = {
        name: sanity.mesh_error(params, shaken, seen.pull)[name] for name, shaken in shaking.items()
    }
    tension = float(params.info["strain_tension"])
    if run.stats.growth > 0.0 and run._has("joints.force") and run._has("contact.pulley"):
        found["tension"] = max(found["tension"], _vibration(run) / tension)
    if not seen.power > 0.0 or not run._has("energy") or run.energy is None:
        return found
    first = int(np.argmax(time_weights(t, t[-1] - LAST * (t[-1] - t[0])) > 0.0))
    losses = (run.energy.contact_loss, run.energy.friction_loss)
    lost = sanity.mesh_loss(params, *(float(one[-1] - one[first]) for one in losses))
    lost /= float(t[-1] - t[first])
    carried = seen.speed * max(seen.pull, MIN_FRICTION * tension)
    # a link at the ends of arcs, in the belt's forces and means
    half = 0.0 if params._belt_facts["flows"] else 0.5 / params.info["n_bodies"]
    if carried > 0.0:
        # set torques know nothing of the ends of arcs, those that a motion needs do
        of_torques = half if run.prescribed else 0.0
        found |= {"power": lost / seen.power + of_torques, "friction": lost / carried + half}
    return found


def _share(value: float | None, floor: float) -> str:
    if value is None:
        return "-"
    if value == 0.0:
        return "0 %"
    if value <= floor:
        return f"< {percent(floor)}"
    return percent(value)
