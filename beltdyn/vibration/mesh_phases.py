"""A drive over the passing of one link: states at phases of the mesh, linearised together.

The links that touch a pulley, and where the last of them stands against the point where the belt
leaves, are those of one moment. A belt that runs passes through all such phases of its mesh while
it moves on by a link. A small motion about it is then eta_i(t) = xi_i(t) exp(lambda t), xi the same
again after the time 1 / a of a passing, when link i stands where link i + 1 has stood (Floquet):

    lambda xi_i,k = J_k xi_i,k - a K (D xi)_i,k,    k = 0 ... K - 1 phases,

one linear system of K times the size, D the derivative by the number i K + k, second order against
the run; of pulleys and mounts by k alone, round a passing. Of its eigenvalues lambda + 2 pi i m a
belong to one mode; that with m = 0 is the one of which the mean over the phases moves.

A belt at rest stands at one phase. Moved along so slowly that it is in equilibrium all the time, it
passes the others too.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from ..drive.params import Params
from ..loads.torques import PiecewiseLinear, Torque, TorqueLike, TorqueSum, Viscous
from ..outputs.state import SPEEDS, State
from ..run.simulation import simulate
from .eigenvalues import first_rate
from .linearised import BEHIND, Linear, balancing, derivative, linearise, passing_of, scipy_sparse

#: A belt at rest moves by a link in so many periods of its spans; the pulleys that are free are
#: damped by this share of their inertia and the spans' rate meanwhile.
PERIODS, DAMPING = 40.0, 0.03
#: Of the runs from phase to phase.
RTOL = 1e-6


def states_over(
    params: Params,
    state: State,
    torque: TorqueLike | None,
    prescribed: tuple[int, ...],
    phases: int,
) -> list[State]:
    """Return the states at phases of a passing, from runs: at rest with all speeds zero."""
    core = state._to_core(params)
    a = passing_of(params, core)
    if torque is None:
        held = balancing(params, core, prescribed)
        torque = PiecewiseLinear([0.0], held[None, :])
    if a != 0.0:
        motion: Any = at_their_speeds(state, prescribed)
        states, time = [state], 1.0 / (abs(a) * phases)
    else:
        inertia, radii, rate = params.shaft_inertias, params._radii, first_rate(params)
        turn = PERIODS * 2.0 * np.pi / rate
        speeds = params.route.senses * float(params.info["link_length"]) / (turn * radii)
        driven = prescribed or (int(np.argmax(inertia)),)
        motion = {
            k: PiecewiseLinear([state.t, state.t + 0.25 * turn], [0.0, float(speeds[k])])
            for k in driven
        }
        # on a pulley whose motion is set torques have no effect
        free = ~np.isin(np.arange(inertia.size), driven)
        resisting = Viscous(DAMPING * rate * inertia * free)
        torque = _sum(torque, resisting)
        time = turn / phases
        states = [after(params, state, torque, motion, 0.5 * turn)]
    while len(states) < phases:
        states.append(after(params, states[-1], torque, motion, time))
    if a != 0.0:
        return states
    stopped = {name: 0.0 * getattr(state, name) for name in SPEEDS}
    return [attrs.evolve(one, **stopped) for one in states]


def after(
    params: Params,
    state: State,
    torque: TorqueLike,
    motion: Any,
    time: float,
    rtol: float = RTOL,
) -> State:
    """Return the state some time later."""
    end = state.t + time
    result = simulate(
        params, torque, end, motion=motion, initial=state, rtol=rtol, t_eval=[end], outputs=()
    )
    return result.final_state


def at_their_speeds(state: State, pulleys: Iterable[int]) -> dict[int, PiecewiseLinear]:
    """Return motions that hold the speeds of pulleys."""
    return {k: PiecewiseLinear([0.0], [float(state.omega[k])]) for k in pulleys}


def _sum(torque: TorqueLike, more: Viscous) -> TorqueLike:
    if isinstance(torque, Torque):
        return TorqueSum([torque, more])
    if not callable(torque):
        raise TypeError("phases of a belt at rest need torque objects or Python functions")
    return lambda t, theta, omega: np.asarray(torque(t, theta, omega)) + more(t, theta, omega)


def linearise_over(
    params: Params,
    states: list[State],
    torque_slopes: tuple[Array, Array] | None,
    prescribed: tuple[int, ...],
) -> Linear:
    """Linearise a running drive over a passing, as the text at the head says."""
    sparse, _ = scipy_sparse()
    parts = [linearise(params, one, torque_slopes, prescribed, places=False) for one in states]
    passing = passing_of(params, parts[0].state)
    names = np.concatenate([part.names for part in parts])
    index = np.concatenate([part.index for part in parts])
    phase = np.concatenate([np.full(part.size, k) for k, part in enumerate(parts)])
    jacobian = sparse.block_diag([part.matrix for part in parts], format="csc")
    weights = dict.fromkeys(names.tolist(), BEHIND)
    by_phase = derivative(params, names, index, phase, len(parts), passing, weights)
    given = [sparse.vstack([part.given[k] for part in parts], format="csc") for k in range(2)]
    return attrs.evolve(
        parts[0],
        matrix=(jacobian - abs(passing) * len(parts) * by_phase).tocsc(),
        names=names,
        index=index,
        unit=np.concatenate([part.unit for part in parts]),
        passing=passing,
        speed=passing * float(params.info["link_length"]),
        trusted=np.inf,
        given=(given[0], given[1]),
        phase=phase,
        parts=tuple(parts),
    )
