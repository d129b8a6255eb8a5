"""The most accurate run that fits a budget of CPU time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import attrs
from numpy.typing import ArrayLike

from ..base.checks import Array
from ..base.rounding import percent
from ..base.run_warnings import RunWarning
from ..drive.params import Params
from ..drive.scene import Scene
from ..outputs.accuracy_report import Expected
from ..outputs.state import State
from ..result.result import Result
from .forecast import Forecast, Pilot
from .quantities import with_links
from .runs import Reached, Runs

#: What "most accurate" means: errors of this quantity.
_QUANTITY = "tension"
#: Share of the budget after which no pilot run begins, and after which one is ended.
_PILOT, _PATIENCE = 0.45, 0.6
#: Up to this share pilots go on where nothing better is known though an error was not reached.
_EARLY = 0.2
#: A run is expected to take this share of what is left at most: forecasts err by less.
_SAFE = 0.7
#: Growth of the CPU time of settling with the number of links.
_SETTLING = 2.0
#: Errors that pilots are made for, one after the other as far as the budget allows.
_ERRORS = (1e-2, 2e-3, 4e-4, 1e-4, 1e-5)
#: With fewer samples than this, pilots have the default number, for the sake of means.
_SAMPLES = 101


class _TooLong(Exception):
    """A pilot run takes too much of the budget; its argument is the time reached [s]."""


@attrs.frozen(kw_only=True)
class Plan:
    """The setting chosen for a budget."""

    params: Params  # on the mesh chosen
    initial: State
    budget: float  # CPU time to keep to [s]
    spent: float  # of it, by the pilot [s]
    forecast: Forecast
    limited: bool  # whether a better setting is known that takes longer

    @property
    def expected(self) -> Expected:
        """The errors expected, for the result."""
        return Expected(quantity=_QUANTITY, space=self.forecast.space, time=self.forecast.time)

    def __str__(self) -> str:
        expected = (
            f"{percent(self.forecast.time)} in time; the mesh is that of initial"
            if math.isnan(self.forecast.space)  # the mesh was not to be changed
            else f"{percent(self.forecast.error)}, {percent(self.forecast.space)} of the mesh, "
            f"{percent(self.forecast.time)} of time"
        )
        return (
            f"chosen for {self.budget:.3g} s: {self.forecast.setting}, about "
            f"{self.forecast.seconds:.2g} s after {self.spent:.2g} s of pilot runs; expected error "
            f"of {_QUANTITY} {expected}; "
            + ("better ones would take too long" if self.limited else "none better is known")
        )

    def judge(self, result: Result, taken: float) -> tuple[Result, tuple[RunWarning, ...]]:
        """Describe in a result what was chosen; warn if all took more CPU time than the budget."""
        found: tuple[RunWarning, ...] = ()
        if taken > self.budget:
            text = (
                f"pilot, settling and run took {taken:.3g} s of CPU time, more than the "
                f"budget of {self.budget:.3g} s; the run alone was expected to take "
                f"{self.forecast.seconds:.3g} s"
            )
            found = (RunWarning(code="budget", text=text),)
        judged = attrs.evolve(
            result,
            stats=attrs.evolve(result.stats, choice=f"{result.stats.choice}; {self}"),
            message=f"{result.message}; {self}",
            warnings=(*result.warnings, *found),
        )
        return judged, found


def plan(
    simulate: Callable[..., Result],
    settle: Callable[..., State],
    scene: Scene,
    budget: float,
    *,
    initial: State | None,
    t_eval: Array,
    breakpoints: ArrayLike = (),
    clock: Callable[[], float] = time.thread_time,
) -> Plan:
    """Choose the most accurate setting whose run fits into a budget, from pilot runs within it."""
    begun = clock()
    start = 0.0 if initial is None else initial.t

    def watch(reached: Reached) -> None:
        if clock() - begun > _PATIENCE * budget:
            raise _TooLong(reached.t)

    runs = Runs(
        scene,
        simulate,
        settle,
        t_eval=t_eval if t_eval.size >= _SAMPLES and t_eval[-1] > t_eval[0] else None,
        initial=initial,
        options={"watch": watch, "breakpoints": breakpoints},
        clock=clock,
    )
    pilot = Pilot(
        runs,
        scene.params,
        _QUANTITY,
        fixed=initial is not None,
        limit=_PILOT * budget,
        clock=clock,
    )

    def settling(n_bodies: int) -> float:
        known = runs.settling
        if n_bodies in known or not known:
            return 0.0
        return known[max(known)] * math.pow(max(1.0, n_bodies / max(known)), _SETTLING)

    def fits(one: Forecast, share: float = _SAFE) -> bool:
        left = budget - (clock() - begun)
        return one.seconds + settling(one.setting.n_bodies) <= share * left

    best: Forecast | None = None
    try:
        for error in _ERRORS:
            pilot.explore(error)
            best = pilot.best(fits)
            if best is None or pilot.spent > _PILOT * budget:
                break
            limited = best != pilot.best()  # by the time that is left
            if best.error > error and (limited or pilot.spent > _EARLY * budget):
                break
    except _TooLong as ended:
        if not pilot.time_errors:
            spent = clock() - begun
            share = max((ended.args[0] - start) / (scene.t_end - start), 1e-6)
            raise _too_small(budget, max(spent / share / _PATIENCE, 2.0 * budget)) from None
        best = pilot.best(fits)
    if best is None:  # what fits without a margin
        best = pilot.best(lambda one: fits(one, 1.0))
    if best is None:
        least = min(map(pilot.seconds, pilot.settings()), default=0.0)
        raise _too_small(budget, (clock() - begun) + least / _SAFE)
    one = best.setting
    return Plan(
        params=with_links(scene.params, one.n_bodies),
        initial=runs.start(one.n_bodies),
        budget=budget,
        spent=clock() - begun,
        forecast=best,
        limited=pilot.best() != best,
    )


def _too_small(budget: float, needed: float) -> ValueError:
    return ValueError(
        f"budget is too small: pilot runs and the coarsest run take about {needed:.2g} s of CPU "
        f"time, got {budget:.3g} s"
    )
