"""Distance of a state from equilibrium, or from steady running; states over the passing of a link.

At rest what is left over are the forces of the state's rate. A running belt is steady in places
fixed in space only, and only over the passing of a link: at one moment the polygon of links leaves
some percent of the tension on a pulley. There a run over one passing decides: each link has then to
move as the next one did, and each pulley and mount as before.

A belt at rest stands at one phase of its mesh. Moved along so slowly that it is in equilibrium all
the time, it passes the others too.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np

from ..base.run_warnings import silenced
from ..drive.params import Params
from ..loads.torques import PiecewiseLinear, Torque, TorqueLike, TorqueSum, Viscous
from ..outputs.state import SPEEDS, State
from ..result.errors import SimulationError
from ..run.simulation import simulate
from .eigenvalues import first_rate
from .linearised import levers, masses, passing_of, torques_at

#: A belt at rest moves by a link in so many periods of its spans; the pulleys that are free are
#: damped by this share of their inertia and the spans' rate meanwhile.
PERIODS, DAMPING = 40.0, 0.03
#: Tolerances of the run over a passing, and of those from phase to phase.
RTOL, RTOL_OF_PHASES = 1e-5, 1e-6


def imbalance(
    params: Params, state: State, torque: TorqueLike | None, prescribed: tuple[int, ...]
) -> tuple[float, str]:
    """Return the largest unbalanced force over the belt's tension, and where it acts.

    Torques count as forces at the rim of a pulley, or at a mount's axis. Without torques those that
    keep the pulleys' speeds are taken as constant: nothing is left over on pulleys.
    """
    core = state._to_core(params)
    passing = passing_of(params, core)
    held = tuple(range(len(params.pulleys))) if torque is None else prescribed
    none = np.zeros(len(params.pulleys))
    inertia = masses(params, core)
    if passing == 0.0:
        given = none if torque is None else torques_at(params, core, torque)
        rate = params._model.rate(core, given)
    else:
        acts = PiecewiseLinear([0.0], none[None]) if torque is None else torque
        try:
            with silenced():
                end = _after(params, state, acts, _steady(state, held), 1.0 / abs(passing), RTOL)
        except SimulationError:
            return np.inf, "a run over the passing of a link fails; it"
        passed = end._to_core(params)
        one = int(np.sign(passing))
        rate = {
            name: (passed[name] - (np.roll(core[name], -one) if name[0] == "v" else core[name]))
            * abs(passing)
            for name in ("vx", "vy", "omega", "travel_speed", "rim_speed")
        }
    if params._flows:
        what, left = "cell", inertia["v"] * abs(rate["v"])
    else:
        what, left = "link", inertia["vx"] * np.hypot(rate["vx"], rate["vy"])
    worst = int(np.argmax(left))
    forces = [(float(left[worst]), f"{what} {worst}")]
    acting = {
        "omega": {k: params.label(k) for k in range(len(params.pulleys)) if k not in held},
        "rim_speed": {c: f"the rim of {params.label(k)}" for c, k in enumerate(params.coupled)},
        "travel_speed": {m: f"the mount of {params.label(k)}" for m, k, _ in params._moving},
    }
    for name, lever in levers(params, core["travel"]).items():
        left = abs(rate[name]) * inertia[name] / np.maximum(lever, 1e-12)
        forces += [(float(left[k]), where) for k, where in acting[name].items()]
    force, what = max(forces, key=lambda part: part[0])
    return force / max(float(state.tension(params).mean), 1e-12), what


def states_over(
    params: Params,
    state: State,
    torque: TorqueLike | None,
    prescribed: tuple[int, ...],
    phases: int,
) -> list[State]:
    """Return the states at phases of a passing, from runs: at rest with all speeds zero."""
    core, inertia = state._to_core(params), params.shaft_inertias
    a = passing_of(params, core)
    if torque is None:  # those that hold the pulleys' speeds
        held = -params._model.rate(core, np.zeros(inertia.size))["omega"] * inertia
        held[list(prescribed)] = 0.0
        torque = PiecewiseLinear([0.0], held[None, :])
    if a != 0.0:
        motion: Any = _steady(state, prescribed)
        states, time = [state], 1.0 / (abs(a) * phases)
    else:
        rate = first_rate(params)
        turn = PERIODS * 2.0 * np.pi / rate
        speeds = params.route.senses * float(params.info["link_length"]) / (turn * params._radii)
        driven = prescribed or (int(np.argmax(inertia)),)
        motion = {
            k: PiecewiseLinear([state.t, state.t + 0.25 * turn], [0.0, float(speeds[k])])
            for k in driven
        }
        # on a pulley whose motion is set torques have no effect
        free = ~np.isin(np.arange(inertia.size), driven)
        torque = _sum(torque, Viscous(DAMPING * rate * inertia * free))
        time = turn / phases
        states = [_after(params, state, torque, motion, 0.5 * turn)]
    while len(states) < phases:
        states.append(_after(params, states[-1], torque, motion, time))
    if a != 0.0:
        return states
    stopped = {name: 0.0 * getattr(state, name) for name in SPEEDS}
    return [attrs.evolve(one, **stopped) for one in states]


def _after(
    params: Params,
    state: State,
    torque: TorqueLike,
    motion: Any,
    time: float,
    rtol: float = RTOL_OF_PHASES,
) -> State:
    """Return the state some time later."""
    end = state.t + time
    return simulate(
        params, torque, end, motion=motion, initial=state, rtol=rtol, t_eval=[end], outputs=()
    ).final_state


def _steady(state: State, pulleys: Iterable[int]) -> dict[int, PiecewiseLinear]:
    """Return motions that hold the speeds of pulleys."""
    return {k: PiecewiseLinear([0.0], [float(state.omega[k])]) for k in pulleys}


def _sum(torque: TorqueLike, more: Viscous) -> TorqueLike:
    if isinstance(torque, Torque):
        return TorqueSum([torque, more])
    if not callable(torque):
        raise TypeError("phases of a belt at rest need torque objects or Python functions")
    return lambda t, theta, omega: np.asarray(torque(t, theta, omega)) + more(t, theta, omega)
