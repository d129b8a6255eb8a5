"""``bd.explain``: the effects of a drive, why it has them, their cost and influence."""

from __future__ import annotations

import time
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base.checks import flag, one_of, positive
from ..base.described import suggesting
from ..base.naming import ByPulley
from ..base.rounding import plain
from ..base.run_options import METHODS
from ..base.run_warnings import silenced
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.motions import MotionLike, as_motions, motion_terms
from ..loads.torques import TorqueLike, as_terms
from ..outputs.state import State
from .ablation import Ablation, Runs, ablate
from .effects import Effect, effects_of
from .explanation_text import text_of
from .removals import Removal, leave_out, removals_of
from .run_length import Drive, Timed, Window, find_window
from .step_cost import Pass, StateSize, Step, size_of, time_step

#: Part of the budget that the window is planned for, and that may be spent: times vary.
_PLANNED, _SPENT = 0.8, 0.9
#: Part of a window, if it is not all of the run, that ranks the effects. The time that is left then
#: goes into runs as long as possible, without what may go.
_RANKING = 0.5
#: CPU time spent on timing the passes of a step, with the run for that [s].
_PROFILING_TIME = 0.4
#: Runs besides those with one effect left out, in such runs: the window is looked for, the run with
#: all effects, that at a tighter tolerance takes twice as long, that with all advice.
_MORE_RUNS = 5
#: Tolerance of the runs over the error asked for: theirs must not hide what an effect is worth.
_TIGHTER, _LOOSEST, _TIGHTEST = 0.1, 1e-3, 1e-8
#: Samples of a run that is compared.
_SAMPLES = 501


@attrs.frozen(kw_only=True, repr=False)
class Explanation:
    """The effects of a drive, why it has them, their cost and influence; ``print`` shows them.

    Attributes:
        effects: The effects, those that are off too, in the order of their passes.
        state: The size of the state by part.
        step: A step: its method and passes, each with its time, and the time of a whole step in a
            short run.
        window: The part of the run that was looked at.
        ablation: Influence of each effect, found by leaving out one at a time; None if not asked
            for.
        error: The error asked for [1].
        scene: The scene that is explained.
    """

    effects: tuple[Effect, ...]
    state: StateSize
    step: Step
    window: Window
    ablation: Ablation | None
    error: float
    scene: Scene

    @property
    def passes(self) -> tuple[Pass, ...]:
        """The passes of a step, in their order."""
        return self.step.passes

    def without(self, *names: str) -> Scene:
        """Return the scene without some of the effects of ``ablation``.

        Args:
            names: Names of rows of ``ablation``; none: all that ``ablation.advice`` has.

        Raises:
            ValueError: There is no such row.
        """
        known: dict[str, Removal] = {one.name: one for one in removals_of(self.scene)}
        if not names and self.ablation is not None:
            names = self.ablation.advice
        for name in names:
            one_of("name", name, tuple(known))
        return leave_out(self.scene, [one for name, one in known.items() if name in names])

    def to_dict(self) -> dict[str, Any]:
        """Return all but the scene as plain dictionaries, lists, texts and numbers, for JSON.

        Numbers that are not finite, such as the bound of what failed, are None.
        """
        left_out = attrs.asdict(self, filter=lambda of, _: of.name not in ("final", "scene"))
        found: dict[str, Any] = plain(left_out)
        return found

    def __str__(self) -> str:
        return text_of(self.effects, self.state, self.step, self.window, self.ablation, self.error)

    def __repr__(self) -> str:
        on = sum(effect.on for effect in self.effects)
        return f"Explanation({on} effects on, method {self.step.method!r})"


@suggesting
def explain(
    params: Params,
    torque_fn: TorqueLike,
    t_end: float | None = None,
    motion: ByPulley[MotionLike] | None = None,
    *,
    error: float = 1e-2,
    budget: float = 30.0,
    method: str = "auto",
    ablation: bool = True,
) -> Explanation:
    """Explain which effects a drive simulates, why, what they cost and what they change.

    ``print(bd.explain(*bd.scenes.serpentine()))`` shows a built-in scene. It lists

    - the effects that are on and off, each with the numbers of the scene that call for it;
    - the size of the state, by part;
    - the passes of a step of the method, in their order, with the time of each, measured on this
      machine at a state of the run;
    - what leaving out one effect at a time does to span tensions, pulley speeds and CPU time, and
      which may be left out at the error asked for.

    Compared are the mean and the range of the tension of each span, over the mean tension, and of
    the speed of each pulley, over the highest speed, over the window and over each fifth of it.
    Where the budget is enough for all of the run, the influence of an effect is the largest change
    plus twice the runs' own error, which is measured with a run at a tenth of the tolerance. If
    not, a shorter window ranks the effects.

    What may go together, at the error asked for, 2, 5 and 10 times that, is then left out of as
    much of the run as the budget allows; changes in a part of the run bound those in the rest by
    four times their size, times the ratio of late to early changes in that part. This is also the
    bound stated for other runs like the one that is explained, longer ones too. There is none where
    the run without an effect has a warning of its accuracy that the run with it has not. An effect
    that did nothing in the window is named as not exercised: nothing follows for other runs, as
    with all that begins to act only after the window. What would cost more steps is kept.

    All runs begin as those of :func:`beltdyn.simulate` do, each of its own drive: at rest under
    preload, or at the speed with which a motion begins. Where the belt's length is found for its
    preload, it is found anew; a belt without its bending stiffness has the tension at rest that it
    had with it.

    Args:
        params: The drive.
        torque_fn: The set torques, as :func:`beltdyn.simulate` takes them.
        t_end: End of the run that is to be explained [s]; None: 1 s. Where the budget is not enough
            for all of it, a window is run, from its start.
        motion: Prescribed motions by pulley, as :func:`beltdyn.simulate` takes them.
        error: The error asked for [1], 0.01: one percent. The runs have a tenth of it, at most
            1e-3, as their ``rtol``.
        budget: CPU time for all of it [s], about.
        method: One of :data:`beltdyn.METHODS`.
        ablation: Whether to leave out effects.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: The drive does not settle or run.
        Interrupted: Ctrl-C.
    """
    begin = time.thread_time()
    if not isinstance(params, Params):
        raise TypeError(f"params must be a Params, got {type(params).__name__}")
    asked, allowed = positive("error", error, "1"), positive("budget", budget, "s")
    scene = Scene(
        params, torque_fn, 1.0 if t_end is None else positive("t_end", t_end, "s"), motion
    )
    scene.check()
    drive = Drive(
        scene=scene,
        rtol=min(_LOOSEST, max(_TIGHTEST, _TIGHTER * asked)),
        method=one_of("method", method, METHODS),
    )
    runs = _MORE_RUNS + len(removals_of(scene)) if flag("ablation", ablation) else _MORE_RUNS
    with silenced():
        window = find_window(drive, max(0.0, _PLANNED * allowed - _PROFILING_TIME) / runs)
        if window.end < window.asked:
            window = attrs.evolve(window, end=_RANKING * window.end)
        sim = _start(drive, window.final, drive.method)
        step = time_step(lambda name: _start(drive, window.final, name), drive.method)
        found = None
        if ablation:

            def runs_to(end: float) -> Runs:
                times = np.linspace(0.0, end, _SAMPLES)

                def run(one: Scene, tighter: float, most: int | None) -> Timed:
                    return drive.run(one, end, tighter, t_eval=times, max_steps=most)

                return Runs(run, end, end >= scene.t_end)

            found = ablate(
                scene,
                runs_to(window.end),
                asked,
                lambda: _SPENT * allowed - (time.thread_time() - begin),
                lambda seconds: runs_to(min(scene.t_end, window.reached_in(seconds))),
            )
    motions = as_motions(motion, params.pulley_names)
    return Explanation(
        effects=effects_of(params, _described(torque_fn), motions, sim.effects, sim.passes),
        state=size_of(sim, scene.params._belt_facts),
        step=step,
        window=window,
        ablation=found,
        error=asked,
        scene=scene,
    )


def _start(drive: Drive, state: State, method: str) -> _core.Simulation:
    """Return a run from a state of the window on, to its end or beyond."""
    scene = drive.scene
    names = scene.params.pulley_names
    return _core.Simulation(
        scene.params._model,
        state._to_core(scene.params),
        as_terms(scene.torque_fn, names),
        max(scene.t_end, 2.0 * state.t),
        method=method,
        rtol=drive.rtol,
        motion=motion_terms(as_motions(scene.motion, names)),
    )


def _described(torque_fn: TorqueLike) -> str:
    """Name a torque function; torque objects describe themselves."""
    name = getattr(torque_fn, "__name__", None)
    return f"function {name}" if name else " ".join(str(torque_fn).split("\n"))
