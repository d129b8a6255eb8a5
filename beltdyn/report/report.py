"""A report, as text, dictionaries and data frames, and how it is made of a run."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from ..base.checks import flag, integer, share_of_run
from ..base.optional import optional_module
from ..base.rounding import plain
from ..outputs.averages import LAST
from ..outputs.sampled import Sampled
from . import brief, flat, text
from .creep import creep_rows
from .cycles import cycle_rows
from .hubs import hub_statics, mount_rows
from .powers import power_rows
from .pulleys import pulley_rows
from .rows import PulleyRow, ReportData, Rows, Spread
from .span_rows import span_rows
from .window import NEEDED, OF_ARCS, Window

#: Share of the exponent mu wrap that bending takes off, from which on a report states it.
NOTABLE = 0.01
#: Turns of a pulley in the window below which a report states them, and those of one that stands.
MIN_TURNS, STANDSTILL_TURNS = 5.0, 0.01
#: Power over the largest one of a pulley that only runs along.
IDLE = 0.01


#: What needs which outputs; frequencies, powers and cycles name theirs themselves.
_PARTS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("pulleys.omega",), "no speeds, no creep, no margin to slip"),
    (("pulleys.torque",), "no torques"),
    (("pulleys.load",), "no hub loads"),
    (OF_ARCS, "no arcs of contact and slip"),
    (NEEDED, "no ratios of tensions, margin to slip, split of creep, friction by pulley"),
    (("span_tension",), "no mean tensions of spans, ratios, margin to slip, split of creep"),
)


def _with_fields(cls: type[Report]) -> type[Report]:
    """Append what ReportData says of its fields to the docstring."""
    _, section, texts = (ReportData.__doc__ or "").partition("\n    Attributes:\n")
    cls.__doc__ = cls.__doc__ and f"{cls.__doc__.rstrip()}\n{section}{texts}"
    return cls


@_with_fields
@attrs.frozen(kw_only=True, repr=False)
class Report(ReportData):
    """What an engineer reads off the last part of a run.

    ``print(report)`` shows what is asked first, ``print(report.text(full=True))`` all tables; a
    notebook shows both by itself. Rows are found by index or name:
    ``report.pulleys["alternator"].hub_load.mean``. Questions, and where the answers stand:

    ==================================================  ==========================================
    what load do the alternator's bearings carry?       ``pulleys["alternator"].hub_load``
    in which direction?                                 ``pulleys["alternator"].hub_direction``
    how far is it from slipping?                        ``pulleys["alternator"].own_margin``,
                                                        all torques: ``margin``, ``least_margin``
    at which torque does it slip?                       ``pulleys["alternator"].slip_torque``
    which pulley slips first?                           ``first_to_slip``
    where does the power go?                            ``powers``, ``efficiency``
    how much of it is friction on the crank?            ``powers["friction on crank"]``
    why is the alternator slower than its radius says?  ``creep["alternator"]``
    how tight are the spans, how much does that change? ``spans[k].tension``
    does a span resonate with something?                ``spans[k].lateral``, ``spans[k].frequency``
    how far does the tensioner swing?                   ``mounts["tensioner"].travel``
    does it reach a stop?                               ``mounts["tensioner"].to_stop``
    what load cycles does a link go through?            ``cycles``, ``rounds``
    can I trust the means?                              ``unsteady``, ``notes``
    ==================================================  ==========================================
    """

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        steady = "not steady" if self.unsteady else "steady"
        return (
            f"Report(t = {self.begin:g} to {self.end:g} s, {self.samples} samples, {steady}, "
            f"{len(self.pulleys)} pulley(s))"
        )

    def _repr_html_(self) -> str:
        return brief.html(self)

    def text(self, *, full: bool = False) -> str:
        """Return the report as text.

        Args:
            full: False, as ``print`` does: the first screen, at most 39 lines of 100 columns.
                True: all tables with their remarks, warnings and notes, in 80 columns.

        Raises:
            TypeError: ``full`` is not a bool.
        """
        return "\n".join(text.lines(self) if flag("full", full) else brief.lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, such as ``json.dump`` takes.

        SI units, angles in rad, as the attributes, and what follows from them: "steady",
        "first_to_slip", the name of that pulley, and "slower" of rows of creep, which is what is
        printed as lost. What is not known is None; so is a number that is infinite (an unlimited
        margin).
        """
        found: dict[str, Any] = plain(attrs.asdict(self))
        for row, one in zip(self.creep, found["creep"], strict=True):
            one |= {name: derived(row) for name, derived in flat.DERIVED["creep"].items()}
        return found | {name: derived(self) for name, derived in flat.DERIVED["report"].items()}

    def to_frame(self) -> Any:
        """Return a pandas.DataFrame, a number a row: part, name, quantity, unit, value and text.

        SI units, angles in rad. Parts are "report" for the run as a whole, "pulleys", "spans",
        "mounts", "creep", "powers" and "cycles". Texts, such as the kind of a power or a note,
        stand in the last column, with a value of NaN; yes is 1 and no 0.

        Raises:
            ImportError: pandas is not installed.
        """
        pandas = optional_module("pandas", "to_frame", "report")
        return pandas.DataFrame(flat.numbers(self), columns=list(flat.Number._fields))


def make_report(
    run: Sampled, last: float = LAST, joint: int = 0, *, margins: bool = True
) -> Report:
    """Make the report of the last part of a run; ``margins`` to slip take most of its time."""
    share, params = share_of_run("last", last), run.params
    which = integer("joint", joint, 0)
    if which >= params.n_bodies:
        raise ValueError(f"joint must be < {params.n_bodies}, the number of joints, got {which}")
    if run.t.size < 2 or not run.t[-1] > run.t[0]:
        raise ValueError(
            "a report needs samples at two times at least: give simulate a t_eval that has them"
        )
    window = Window.last(run, share)
    notes, driver, belt = window.notes, window.driver, window.belt
    for names, parts in _PARTS:
        window.lacks(parts, *names)
    if params.mounted:
        window.lacks(
            "no wraps, limits, lengths and string frequencies of spans, margin to slip, no torque "
            "of the belt on pulleys with mounts and no split of their creep",
            "mounts.travel",
        )
    if driver is None and run._has("pulleys.omega"):
        notes.append("the belt stands still in this window: no creep; margins are those at rest")
    if not params.has_friction:
        notes.append("there is no friction: the belt hands on no torque")
    _turns(window)
    statics = hub_statics(window)
    pulleys = pulley_rows(window, statics, margins)
    _bending(window, pulleys)
    rows = {  # in the order of their notes
        "pulleys": Rows(pulleys),
        "spans": Rows(span_rows(window)),
        "mounts": Rows(mount_rows(window, statics)),
        "creep": Rows(creep_rows(window)),
        **power_rows(window),
    }
    notes += run.accuracy.notes
    rows |= cycle_rows(window, which)
    return Report(
        **rows,
        begin=float(window.t[0]),
        end=float(window.t[-1]),
        samples=window.t.size,
        ended_early=None if run.status == "finished" else f"{run.status}: {run.message}",
        driver=None if driver is None else params.pulley_names[driver],
        belt_speed=None if belt is None else float(belt.speed),
        belt_speeds=_belt_speeds(window),
        rest_tension=(
            None if params._belt_facts["tangents"] else float(params.info["mean_tension"])
        ),
        mass_tension=None if belt is None else float(belt.centrifugal),
        power_error=run.accuracy["power"].known,
        tension_error=run.accuracy["span_mean"].known,
        creep_error=run.accuracy["creep"].known,
        nodes=params._belt_facts["nodes"],
        joint=which,
        unsteady=tuple(window.unsteady()),
        notes=tuple(notes),
        accuracy=run.accuracy,
        warnings=run.warnings,
    )


def _turns(window: Window) -> None:
    """Note where the window holds too few turns of a pulley for its means."""
    run = window.run
    if not run._has("pulleys.omega"):
        return
    turns = np.abs(window.mean(window.of(run.pulleys.omega))) * window.lasts / (2.0 * np.pi)
    if run._has("pulleys.torque"):  # of those whose loads may change with the angle
        power = window.mean(np.abs(window.of(run.pulleys.torque) * window.of(run.pulleys.omega)))
        turns = np.where(power > IDLE * power.max(initial=0.0), turns, np.inf)
    slowest = int(np.argmin(turns))
    if STANDSTILL_TURNS < turns[slowest] < MIN_TURNS:
        window.notes.append(
            f"the window holds {turns[slowest]:.2g} turns of {run.params.label(slowest)}: what "
            "changes with its angle goes into the means with a broken number of periods"
        )


def _bending(window: Window, rows: list[PulleyRow]) -> None:
    """Note where the belt's bending stiffness, which limits and margins neglect, matters."""
    # The belt leaves the rim at an angle sqrt(EI/T)/r to its span. There it is pressed on the rim
    # by as much as on the arc that this takes off, but pulled along the rim by the component of the
    # tension: the exponent mu wrap loses EI/(2 r^2) (1/T_slack - 1/T_tight), to leading order.
    stiffness = window.params.belt.bending_stiffness
    texts = []
    for row, pulley in zip(rows, window.params.pulleys, strict=True):
        if row.margin is None or not row.limit or not row.slack or row.limit <= 1.0:
            continue
        loss = stiffness / (2.0 * pulley.radius**2 * row.slack) * (1.0 - 1.0 / row.limit)
        share = loss / math.log(row.limit)
        if share > NOTABLE:
            texts.append(f"{100.0 * share:.1f} % on {row.name}")
    if texts:
        window.notes.append(
            "limits, friction in use and margins leave out that the belt resists bending, which "
            f"takes off mu wrap, so that full slip uses less than 100 %: {', '.join(texts)}"
        )


def _belt_speeds(window: Window) -> Spread | None:
    """Return the speed of the belt with its range."""
    if window.touching is None or window.belt is None:
        return None
    found = window.spread(window.flows * window.touching.stretch.mean(axis=1))
    return found and attrs.evolve(found, mean=float(window.belt.speed))
