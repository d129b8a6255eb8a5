"""Distance of a state from equilibrium, or from steady running.

At rest what is left over are the forces of the state's rate. A running belt is steady in places
fixed in space only, and only over the passing of a link: at one moment the polygon of links leaves
some percent of the tension on a pulley. There a run over one passing tells: each link has then to
move as the next one did, and each pulley and mount as before.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.checks import Array
from ..base.run_warnings import silenced
from ..drive.params import Params
from ..loads.torques import PiecewiseLinear, TorqueLike
from ..outputs.state import State
from ..result.errors import SimulationError
from ..run.simulation import simulate
from .linearised import masses, passing_of
from .torque_slopes import torques_at

__all__ = ["imbalance"]

#: Of the run over a passing.
RTOL = 1e-5


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
    if passing == 0.0:
        given = (
            np.zeros(len(params.pulleys)) if torque is None else torques_at(params, core, torque)
        )
        rate = params._model.rate(core, given)
    else:
        after = _after_a_passing(params, state, torque, held, 1.0 / abs(passing))
        if after is None:
            return np.inf, "a run over the passing of a link fails; it"
        one = int(np.sign(passing))
        rate = {
            name: (after[name] - (np.roll(core[name], -one) if name[0] == "v" else core[name]))
            * abs(passing)
            for name in ("vx", "vy", "omega", "travel_speed", "rim_speed")
        }
    tension = max(float(state.tension(params).mean), 1e-12)
    force, what = max(_forces(params, rate, core, held), key=lambda part: part[0])
    return force / tension, what


def _forces(
    params: Params, rate: Mapping[str, Any], core: Mapping[str, Any], held: tuple[int, ...]
) -> list[tuple[float, str]]:
    """Return the unbalanced forces [N], each with what it acts on."""
    inertia = masses(params, core)
    if params._belt_facts["flows"]:
        what, left = "cell", inertia["v"] * abs(rate["v"])
    else:
        what, left = "link", inertia["vx"] * np.hypot(rate["vx"], rate["vy"])
    worst = int(np.argmax(left))
    out: list[tuple[float, str]] = [(float(left[worst]), f"{what} {worst}")]
    for k, pulley in enumerate(params.pulleys):
        if k not in held:
            force = abs(float(rate["omega"][k])) * inertia["omega"][k] / pulley.radius
            out.append((force, params.label(k)))
    for c, k in enumerate(params.coupled):
        torque = abs(float(rate["rim_speed"][c])) * inertia["rim_speed"][c]
        out.append((torque / params.pulleys[k].radius, f"the rim of {params.label(k)}"))
    centers = params.centers(core["travel"]) if params.mounted else params.centers()
    for m, k, mount in params._moving:
        lever = float(np.hypot(*mount._direction(centers[k])))
        torque = abs(float(rate["travel_speed"][m])) * inertia["travel_speed"][m]
        force = torque / max(lever, 1e-12)
        out.append((force, f"the mount of {params.label(k)}"))
    return out


def _after_a_passing(
    params: Params, state: State, torque: TorqueLike | None, held: tuple[int, ...], time: float
) -> dict[str, Array] | None:
    motion: Any = {k: PiecewiseLinear([0.0], [float(state.omega[k])]) for k in held}
    end = state.t + time
    none = PiecewiseLinear([0.0], np.zeros((1, len(params.pulleys))))
    try:
        with silenced():
            result = simulate(
                params,
                none if torque is None else torque,
                end,
                motion=motion,
                initial=state,
                rtol=RTOL,
                t_eval=[end],
                outputs=(),
            )
    except SimulationError:
        return None
    return result.final_state._to_core(params)
