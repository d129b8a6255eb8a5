"""``bd.explain``: which effects a drive simulates, which numbers call for them, what they cost."""

from __future__ import annotations

from typing import Any

import attrs

from .. import _core
from ..checks import one_of, positive
from ..motions import MotionLike, as_motions, motion_terms
from ..naming import ByPulley
from ..params import Params
from ..run_warnings import silenced
from ..simulation import METHODS
from ..state import State
from ..torques import TorqueLike, as_terms
from .cost import Pass, StateSize, Step, size_of, time_step
from .effects import Effect, effects_of
from .text import text_of
from .window import Drive, Window, find_window

__all__ = ["Explanation", "explain"]

#: Part of the budget that finding the window may take.
_PILOT = 0.1
#: Tolerance of the runs over the error asked for: theirs must not hide what an effect is worth.
_TIGHTER, _LOOSEST, _TIGHTEST = 0.1, 1e-3, 1e-8


@attrs.frozen(kw_only=True, repr=False)
class Explanation:
    """What a drive simulates, why, and what it costs; ``print`` shows it.

    Attributes:
        effects: The effects, those that are off too, in the order of their passes.
        state: The size of the state by part.
        step: A step: its method and passes, each with its time, and the time of a whole step in a
            short run.
        window: The part of the run that was looked at.
        error: The error asked for [1].
    """

    effects: tuple[Effect, ...]
    state: StateSize
    step: Step
    window: Window
    error: float

    @property
    def passes(self) -> tuple[Pass, ...]:
        """The passes of a step, in their order."""
        return self.step.passes

    def to_dict(self) -> dict[str, Any]:
        """Give all of it as plain dictionaries, lists, texts and numbers, for JSON."""
        plain: dict[str, Any] = attrs.asdict(self, filter=lambda field, _: field.name != "final")
        return plain

    def __str__(self) -> str:
        return text_of(self.effects, self.state, self.step)

    def __repr__(self) -> str:
        on = sum(effect.on for effect in self.effects)
        return f"Explanation({on} effects on, method {self.step.method!r})"


def explain(
    params: Params,
    torque_fn: TorqueLike,
    t_end: float | None = None,
    motion: ByPulley[MotionLike] | None = None,
    *,
    error: float = 1e-2,
    budget: float = 8.0,
    method: str = "auto",
) -> Explanation:
    """Tell which effects a drive simulates, which numbers call for them, and what they cost.

    ``print(bd.explain(*bd.scenes.serpentine()))`` shows a built-in scene. It lists

    - the effects that are on and off, each with the numbers of the scene that call for it;
    - the size of the state, by part;
    - the passes of a step of the method, in their order, with the time of each, measured on this
      machine at a state of the run.

    Runs begin at rest under preload, as those of :func:`beltdyn.simulate` do, or at the speed with
    which a motion begins.

    Args:
        params: The drive.
        torque_fn: The set torques, as :func:`beltdyn.simulate` takes them.
        t_end: End of the run that is to be explained [s]; None: 1 s. Of it as much is run, from
            its start, as the budget allows.
        motion: Prescribed motions by pulley, as :func:`beltdyn.simulate` takes them.
        error: The error asked for [1], 0.01: one percent.
        budget: CPU time for all of it [s], about.
        method: One of :data:`beltdyn.METHODS`.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: The drive does not settle or run.
        Interrupted: Ctrl-C.
    """
    if not isinstance(params, Params):
        raise TypeError(f"params must be a Params, got {type(params).__name__}")
    asked = positive("error", error, "1")
    drive = Drive(
        params=params,
        torque_fn=torque_fn,
        motion=motion,
        rtol=min(_LOOSEST, max(_TIGHTEST, _TIGHTER * asked)),
        method=one_of("method", method, METHODS),
    )
    allowed = positive("budget", budget, "s")
    asked_end = 1.0 if t_end is None else positive("t_end", t_end, "s")
    terms = as_terms(torque_fn, params.pulley_names)
    motions = as_motions(motion, params.pulley_names)
    with silenced():
        window = find_window(drive, asked_end, _PILOT * allowed)

    def start(name: str, state: State = window.final) -> _core.Simulation:
        return _core.Simulation(
            params._model,
            state._to_core(params.has_friction),
            terms,
            max(asked_end, 2.0 * state.t),
            method=name,
            rtol=drive.rtol,
            motion=motion_terms(motions),
        )

    sim = start(drive.method)
    return Explanation(
        effects=effects_of(params, _described(torque_fn), motions, sim.effects, sim.passes),
        state=size_of(sim),
        step=time_step(start, drive.method),
        window=window,
        error=asked,
    )


def _described(torque_fn: TorqueLike) -> str:
    """Name a torque function; torque objects describe themselves."""
    name = getattr(torque_fn, "__name__", None)
    return f"function {name}" if name else " ".join(str(torque_fn).split("\n"))
