"""Influence of each effect: runs with one effect left out at a time.

Where all of a run is looked at, an effect is worth what leaving it out changed in it: of the whole
or of any fifth of it, plus twice the runs' own error, which is measured by the same answers of a
run at a tenth of the tolerance. Where that takes too long, a part of the run ranks the effects, and
what may go together is then left out of as long a run as the budget allows.

A bound for other runs of the kind, longer ones too, goes out from the largest change in any part of
the window; if changes are larger late in the window than early, they are taken to go on growing by
as much; and that is taken times ``SAFETY``. On nine of the built-in scenes, with a window of 0.4 of
each, changes over the whole scene came out at up to 4.0 times what these two say, where there was
nothing to warn of. What is advised to be left out together has been left out together, in a run of
its own.

There is no bound where the run without an effect is warned of and that with it is not. With windows
of a quarter, three effects, all of them damping, changed 1.5, 2.0 and 108 times the bound that they
would have been given: the vibration that they hold down had not begun. The warnings had named it
(``python benchmarks/explain.py``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import attrs
import numpy as np

from ..base.checks import Array
from ..drive.scene import Scene
from ..many.outcome import attempt
from ..outputs.averages import time_weights
from ..result.errors import SimulationError
from ..result.result import Result
from ..verification.quantities import observe
from .removals import Removal, leave_out, removals_of
from .run_length import Drive, Timed, Window

#: What is compared, in the order of the table.
ANSWERS = ("tension, mean", "tension, range", "speed, mean", "speed, range")
#: Safety factor on the largest change in any part of the window: other runs of the kind differ.
SAFETY = 4.0
#: Changes are taken to go on growing by at most as much.
MOST_GROWTH = 10.0
#: Equal parts of the window that are looked at besides the whole of it; the first three are early.
PARTS, EARLY = 5, 3
#: Both runs that are compared have the error that is measured of one.
RUNS = 2.0
#: Differences that rounding can make: the effect did not act in the window.
ROUNDING = 1e-11
#: The run that shows the others' own error has the tolerance of those times this.
TIGHTER = 0.1
#: Rounds of runs at most, for the sake of their times.
MOST_ROUNDS = 3

#: Without an effect a run may take as many times the steps that it takes with all of them.
MOST_STEPS = 10
#: Leaving out an effect gains nothing if it takes as much more CPU time, beyond chance.
NO_GAIN = 0.1
#: Errors at which sets of effects are looked for, over the error asked for.
LEVELS = (1.0, 2.0, 5.0, 10.0)
#: What a run is warned of that needs no time to show: all of a run has what it does.
_SHOWN_AT_ONCE = {"mesh", "long_links", "compliance"}
#: Samples of a run that is compared.
SAMPLES = 501
#: A run that confirms what a part of it has ranked is at least as many times as long.
LONGER = 1.5
#: The run with all effects and that at a tighter tolerance, in runs with all effects.
BASE_RUNS = 3.0


class Answers(NamedTuple):
    """Quantities of a run that are compared, made of those of :mod:`beltdyn.accuracy`."""

    #: By the names of ``ANSWERS``, of each span and each pulley, over the whole run and over each
    #: fifth of it (1 + 5, n_p) [N], [rad/s].
    values: dict[str, Array]
    #: Of the changes: the mean tension [N], the highest speed [rad/s].
    scales: dict[str, float]


@attrs.frozen(kw_only=True)
class LeftOut:
    """Influence of leaving out an effect, or several.

    Attributes:
        name: The effect; of several their names.
        how: Change of the scene.
        change: By answer, the largest change of a span over the mean tension, or of a pulley over
            the highest speed, over the whole window [1]. Empty if the run failed.
        worst: The largest change of an answer over the window or a fifth of it [1].
        growth: Ratio of late to early changes in the window, 1 to 10 [1].
        bound: Bound of the changes in runs of the kind [1]: four times ``worst`` times ``growth``,
            plus twice the runs' own error; infinite where there is something to warn of.
        error: Error of the run that is explained without it [1]: where the window is all of that,
            ``worst`` plus twice the runs' own error, else ``bound``.
        cpu_time: CPU time of the run without it over that with all effects, less 1: -0.1 is a tenth
            faster [1].
        exercised: Whether it did anything in the window, beyond rounding.
        may_be_left_out: Whether it acts in the window and ``error`` is within the error asked for.
        end: End of the window [s].
        warned: Codes of warnings that the run without it has and the run with all effects has not,
            that its results may be less accurate than was asked; see :class:`beltdyn.RunWarning`.
            Not of its mesh and contact where the window is all of the run: ``worst`` has these.
        failed: Why the run without it failed, or was not made, or "".
    """

    name: str
    how: str
    change: dict[str, float] = attrs.field(factory=dict)
    worst: float = math.inf
    growth: float = 1.0
    bound: float = math.inf
    error: float = math.inf
    cpu_time: float = math.nan
    exercised: bool = True
    may_be_left_out: bool = False
    end: float = 0.0
    warned: tuple[str, ...] = ()
    failed: str = ""


@attrs.frozen(kw_only=True)
class Ablation:
    """Influence of each effect, over a window of the run.

    Attributes:
        rows: One effect left out at a time.
        own_error: Largest difference of an answer to a run with a tenth of the tolerance [1].
        seconds: CPU time of the run with all effects, without settling [s].
        runs: Number of runs.
        rounds: Number of times each was made; the least CPU time counts.
        advice: Names of the effects that may be left out together at the error asked for.
        together: All of these left out in one run; None: there are none.
        sets: What may be left out together at the error asked for, at 2, 5 and 10 times it: the
            error, the names and the run without them. Sets that are no larger than the one
            before are not there.
    """

    rows: tuple[LeftOut, ...]
    own_error: float
    seconds: float
    runs: int
    rounds: int
    sets: tuple[tuple[float, tuple[str, ...], LeftOut], ...]
    error: float

    @property
    def advice(self) -> tuple[str, ...]:  # noqa: D102 - an attribute above
        return next((names for error, names, _ in self.sets if error == self.error), ())

    @property
    def together(self) -> LeftOut | None:  # noqa: D102 - an attribute above
        return next((row for error, _, row in self.sets if error == self.error), None)


def answers_of(result: Result) -> Answers:
    """Read the compared quantities off a run."""
    seen = observe(result)
    edges = np.linspace(seen.t[0], seen.t[-1], PARTS + 1)
    parts = [(edges[0], edges[-1]), *pairwise(edges)]
    values = {}
    for name in ("tension", "speed"):
        history = getattr(seen, name)
        values[f"{name}, mean"] = np.stack(
            [time_weights(seen.t, *part) @ history for part in parts]
        )
        inside = [(seen.t >= begin) & (seen.t <= end) for begin, end in parts]
        values[f"{name}, range"] = np.stack([np.ptp(history[part], axis=0) for part in inside])
    return Answers(values=values, scales={name: seen.scales[name] for name in ("tension", "speed")})


def changes_of(one: Answers, base: Answers) -> dict[str, Array]:
    """Return the differences of the answers of two runs, over the scales of the second.

    What cannot be read off, such as the tension of a span that is gone, is infinitely far off.
    """
    changes = {}
    for name in ANSWERS:
        scale = base.scales[name.partition(",")[0]]
        apart = np.max(np.abs(one.values[name] - base.values[name]), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            changes[name] = np.where(apart == 0.0, 0.0, np.nan_to_num(apart / scale, nan=math.inf))
    return changes


def growth_of(changes: dict[str, Array]) -> float:
    """Return the ratio of late to early changes in the run, 1 to 10."""
    by_part = np.max([change[1:] for change in changes.values()], axis=0)
    early, late = float(np.max(by_part[:EARLY])), float(np.max(by_part[EARLY:]))
    if late <= early:
        return 1.0
    return min(MOST_GROWTH, late / early) if early > 0.0 else MOST_GROWTH


def removals_that_may_go(rows: Sequence[LeftOut], error: float, safety: float = 1.0) -> list[str]:
    """Name what may be left out together: the least first, while their errors add up to the error.

    To first order changes add up. What is warned of, did nothing, or takes more time without stays.
    """
    names, total = [], 0.0
    for row in sorted(rows, key=lambda row: row.error):
        useful = row.exercised and not row.warned and row.cpu_time <= NO_GAIN
        if useful and total + row.error / safety <= error:
            names.append(row.name)
            total += row.error / safety
    return names


def ablate(drive: Drive, window: Window, error: float, time_left: Callable[[], float]) -> Ablation:
    """Leave out one effect at a time, then together what may go."""
    removals = removals_of(drive.scene)
    base = _Base(drive, window.end, error)
    rows = [
        _unknown([one], "the budget is spent") if time_left() <= 0.0 else base.left_out([one])
        for one in removals
    ]
    rounds = 1
    while rounds < MOST_ROUNDS and base.whole and time_left() > 2.0 * base.round_time:
        base.repeat(removals)
        rounds += 1
    ranked = [base.timed(row) for row in rows]
    judge, safety = base, 1.0
    if not base.whole and removals_that_may_go(ranked, LEVELS[-1] * error, SAFETY):
        end = window.reached_in(max(0.0, time_left()) / (BASE_RUNS + len(LEVELS) + 1.0))
        if end >= LONGER * window.end:
            judge, safety = _Base(drive, end, error), SAFETY
    sets: list[tuple[float, tuple[str, ...], LeftOut]] = []
    for level in LEVELS:
        names = removals_that_may_go(ranked, level * error, safety)
        while names and not (sets and len(names) <= len(sets[-1][1])) and time_left() > 0.0:
            group = [removal for removal in removals if removal.name in names]
            row = judge.left_out(group)
            if row.error <= level * error:
                sets.append((level * error, tuple(one.name for one in group), judge.timed(row)))
                break
            names.pop()  # the one that changes most
    return Ablation(
        rows=tuple(ranked),
        own_error=base.own_error,
        seconds=base.times[""],
        runs=base.runs + (judge.runs if judge is not base else 0),
        rounds=rounds,
        sets=tuple(sets),
        error=error,
    )


def _unknown(group: Sequence[Removal], why: str) -> LeftOut:
    """Return what is known of effects before a run without them."""
    names, how = [one.name for one in group], [one.how for one in group]
    return LeftOut(name=", ".join(names), how="; ".join(how), failed=why)


def _worst(changes: dict[str, Array]) -> float:
    return max(float(np.max(change)) for change in changes.values())


def _accuracy(result: Result) -> list[str]:
    """Name the warnings of a run that are about its accuracy."""
    return [one.code for one in result.warnings if one.accuracy]


class _Base:
    """The run with all effects, from the beginning; ``whole``: over all of the time asked for."""

    def __init__(self, drive: Drive, end: float, error: float) -> None:
        self.drive, self.end, self.error = drive, end, error
        self.whole = end >= drive.scene.t_end
        self.runs, self.round_time = 0, 0.0
        self.most_steps: int | None = None
        self.times: dict[str, float] = {}  # the least CPU time, by what is left out
        result = self._run("", drive.scene)
        self.answers, self.warned = answers_of(result), _accuracy(result)
        self.most_steps = MOST_STEPS * result.stats.steps
        tight = self._timed(drive.scene, TIGHTER, None).result
        self.own_error = _worst(changes_of(answers_of(tight), self.answers))

    def left_out(self, group: Sequence[Removal]) -> LeftOut:
        """Run without some effects, and compare."""
        unknown = _unknown(group, "")

        def run() -> tuple[Result, dict[str, Array]]:
            result = self._run(unknown.name, leave_out(self.drive.scene, group))
            return result, changes_of(answers_of(result), self.answers)

        outcome = attempt(run, (SimulationError, ValueError))
        if outcome.status != "finished":
            return attrs.evolve(unknown, failed=outcome.message)
        result, changes = outcome.value
        worst, growth = _worst(changes), growth_of(changes)
        known = set(self.warned) | (_SHOWN_AT_ONCE if self.whole else set())
        warned = tuple(code for code in _accuracy(result) if code not in known)
        own = RUNS * self.own_error
        bound = math.inf if warned else SAFETY * growth * worst + own
        error = worst + own if self.whole and not warned else bound
        return attrs.evolve(
            unknown,
            change={name: float(change[0]) for name, change in changes.items()},
            worst=worst,
            growth=growth,
            bound=bound,
            error=error,
            exercised=worst > ROUNDING,
            may_be_left_out=worst > ROUNDING and error <= self.error,
            end=self.end,
            warned=warned,
        )

    def repeat(self, removals: Sequence[Removal]) -> None:
        """Run all again for their times, of which the least counts."""
        self._run("", self.drive.scene)
        for one in removals:
            if one.name in self.times:
                self._run(one.name, leave_out(self.drive.scene, [one]))

    def timed(self, row: LeftOut) -> LeftOut:
        """Return a row with its time."""
        if row.failed:
            return row
        return attrs.evolve(row, cpu_time=self.times[row.name] / self.times[""] - 1.0)

    def _timed(self, scene: Scene, tighter: float, most_steps: int | None) -> Timed:
        self.runs += 1
        times = np.linspace(0.0, self.end, SAMPLES)
        return self.drive.run(scene, self.end, tighter, t_eval=times, max_steps=most_steps)

    def _run(self, name: str, scene: Scene) -> Result:
        timed = self._timed(scene, 1.0, self.most_steps)
        seconds = timed.result.stats.cpu_time
        if name not in self.times:
            self.round_time += timed.seconds
        self.times[name] = min(seconds, self.times.get(name, math.inf))
        return timed.result
