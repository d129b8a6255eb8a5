"""Settling a drive: at rest under preload, or running steadily without load."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
from numpy.typing import ArrayLike

from .. import _core
from ..base.checks import flag, positive
from ..base.described import suggesting
from ..base.naming import ByPulley
from ..base.progress import over_time
from ..base.stopping import stoppable
from ..drive import compliance
from ..drive.params import Params
from ..drive.tensioning import Tensioning
from ..outputs.state import State, belt_speed
from ..result.errors import Interrupted, SimulationError, annotate
from ..result.result import Result

#: Wall time between two updates of the progress bar and two checks for Ctrl-C [s].
CHUNK = 0.1


@suggesting
def settle(
    params: Params,
    *,
    initial: State | None = None,
    friction: bool | None = None,
    pulleys: str | None = None,
    offset: ByPulley[Sequence[float]] | ArrayLike | None = None,
    move_time: float | None = None,
    shift: float | None = None,
    speed: ByPulley[float] | None = None,
    tolerance: float | None = None,
    max_time: float | None = None,
    progress: bool = False,
) -> State:
    """Bring the belt to rest under preload, or to run steadily without load.

    Rest is what the paper calls the stabilisation phase. The friction that remains in the wraps
    depends on how the belt was tensioned: ``params.tensioning``. Arguments that are given replace
    its fields of the same names; see :class:`beltdyn.Tensioning`.

    With ``speed={0: 100.0}`` the belt runs, with pulley 0 at that speed: no run-up need be
    simulated. Its centrifugal force, rho A v^2, is taken off the pressure on the pulleys. Between
    fixed axes the tension is what its path and its stretch then give, nearly that at rest; where a
    weight on a mount sets the pressure, it is that much higher. The pulleys turn with the belt
    where it runs on them, without slip, and nothing is left of the friction of tensioning. The
    vibration that links make as they land on the pulleys is not in it; it falls with the square of
    their number, and within a round adds some 2 to 7 % to the mean tension of 60 links at 30 m/s,
    0.1 to 0.3 % to that of 240, and 0.03 % at most to that of 240 with some bending stiffness.

    Args:
        params: The drive.
        initial: State to start from; None: the belt line round the pulleys.
        friction: Whether friction acts while settling; its state is then kept.
        pulleys: "held": the pulleys do not turn; "free": they may.
        offset: Where the centres start, relative to their places: {pulley: (dx, dy)}, by index or
            name, or one (dx, dy) per pulley [m].
        move_time: Duration of the motion from there [s].
        shift: How far all links are moved along the belt line [m].
        speed: Speeds of one or several pulleys, by index or name [rad/s]; of several, the speeds of
            their rims must agree to 1 %. None, or all zero: at rest.
        tolerance: The belt is at rest when the largest unbalanced force is below this times the
            mean tension; None: 1e-9. A value of 1e-9 or more is raised to the rounding error of the
            forces, where the contact is very stiff or the tension very low. An ALE belt is laid at
            rest, or running, at once: it takes neither this nor ``max_time``, and refuses
            ``friction``, ``offset`` and ``shift``.
        max_time: Simulated time after which to give up [s]; None: chosen.
        progress: Whether to show progress on stderr (needs ``rich``).

    Returns:
        A state with ``residual`` set, and the time of ``initial`` (else 0); at rest its velocities
        are zero.

    Raises:
        TypeError, ValueError: An argument breaks its rule; the belt would leave its pulleys at that
            speed, and the message says from which on.
        SimulationError: The belt did not come to rest, or rests without touching a pulley.
        Interrupted: Ctrl-C.
    """
    given = dict(locals())
    check_params(params)
    check_initial(params, initial)
    shown = flag("progress", progress)
    fields = (field.name for field in attrs.fields(Tensioning))
    changes = {name: given[name] for name in fields if given[name] is not None}
    tensioning = attrs.evolve(params.tensioning, **changes).fitted(params.pulley_names)
    name = attrs.evolve(Tensioning(), **changes).beyond_cells()
    if params._flows and name:
        raise ValueError(
            f'{name} is none of a belt on the mesh "ale", which is laid at rest without friction: '
            'leave it out, or take Belt(mesh="joint")'
        )
    n_pulleys, has_friction = len(params.pulleys), params.has_friction
    options = tensioning._options(n_pulleys, has_friction)
    for name, unit in (("max_time", "s"), ("tolerance", "1")):
        if given[name] is not None:
            options[name] = positive(name, given[name], unit)
    speeds, v = ({}, 0.0) if speed is None else belt_speed("speed", params, speed)
    if v != 0.0:
        if friction:
            raise ValueError(
                "friction must not be set together with speed: of a belt that runs, nothing is "
                "left of how it was tensioned"
            )
        named = next(iter(speeds))
        running = compliance.compliance(params, speed=v).radius[named].mean()
        options["speed"] = v * float(running) / params.pulleys[named].radius
        options["friction"] = False
    state = None if initial is None else initial._to_core(params)
    sim = _core.Simulation.settle(params._model, state, **options)
    try:
        with stoppable(sim), over_time(shown, "settling", 0.0, None) as show:
            while not sim.advance(CHUNK):
                show(sim.time)
    except SimulationError as error:
        annotate(error, params, params._noticed)
        raise
    except KeyboardInterrupt as error:
        raise Interrupted(f"interrupted while settling, at t = {sim.time:.6g} s") from error
    start = 0.0 if initial is None else initial.t
    settled = State._from_core(sim.state(), t=start, residual=float(sim.stats["residual"]))
    if v == 0.0:
        return settled
    return attrs.evolve(settled.at_speed(params, speeds), residual=settled.residual)


def check_params(params: object) -> None:
    """Check that it is a drive."""
    if not isinstance(params, Params):
        raise TypeError(f"params must be a Params, got {type(params).__name__}")


def check_initial(params: Params | None, initial: object) -> None:
    """Check that it is a state, of a drive if one is given, or None."""
    if initial is None:
        return
    if not isinstance(initial, State):
        hint = ", its final_state is one" if isinstance(initial, Result) else ""
        raise TypeError(f"initial must be a State or None, got {type(initial).__name__}{hint}")
    if params is not None:
        initial.check_fits(params)
