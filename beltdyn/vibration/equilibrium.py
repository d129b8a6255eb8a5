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

from ..base.run_warnings import silenced
from ..drive.params import Params
from ..loads.torques import PiecewiseLinear, TorqueLike
from ..outputs.state import State
from ..result.errors import SimulationError
from .linearised import masses, passing_of, torques_at
from .mesh_phases import after, at_their_speeds

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
    none = np.zeros(len(params.pulleys))
    if passing == 0.0:
        given = none if torque is None else torques_at(params, core, torque)
        rate = params._model.rate(core, given)
    else:
        acts = PiecewiseLinear([0.0], none[None]) if torque is None else torque
        motion = at_their_speeds(state, held)
        try:
            with silenced():
                end = after(params, state, acts, motion, 1.0 / abs(passing), RTOL)
        except SimulationError:
            return np.inf, "a run over the passing of a link fails; it"
        passed = end._to_core(params)
        one = int(np.sign(passing))
        rate = {
            name: (passed[name] - (np.roll(core[name], -one) if name[0] == "v" else core[name]))
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
    if params._flows:
        what, left = "cell", inertia["v"] * abs(rate["v"])
    else:
        what, left = "link", inertia["vx"] * np.hypot(rate["vx"], rate["vy"])
    worst = int(np.argmax(left))
    out = [(float(left[worst]), f"{what} {worst}")]
    label, radii = params.label, params._radii
    centers = params.centers(core["travel"])
    levers = [("omega", k, radii[k], label(k)) for k in range(len(radii)) if k not in held]
    for c, k in enumerate(params.coupled):
        levers.append(("rim_speed", c, radii[k], f"the rim of {label(k)}"))
    for m, k, mount in params._moving:
        lever = max(float(np.hypot(*mount._direction(centers[k]))), 1e-12)
        levers.append(("travel_speed", m, lever, f"the mount of {label(k)}"))
    for name, k, lever, where in levers:
        out.append((abs(float(rate[name][k])) * inertia[name][k] / lever, where))
    return out
