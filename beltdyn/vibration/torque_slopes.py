"""Derivatives of set torques by angles and speeds, and torques that hold pulleys' speeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.checks import Array
from ..drive.params import Params
from ..loads.torques import TorqueLike, as_terms
from ..outputs.state import State

#: Steps of the differences: of angles [rad]; of speeds [rad/s] and against the speed.
_ANGLE, _SPEED, _RELATIVE = 1e-5, 1e-4, 1e-4


def torques_at(params: Params, core: Mapping[str, Any], torque: TorqueLike) -> Array:
    """Return the set torques at a state (n_p,) [N m], as the core evaluates them in a run."""
    now, terms = float(core["t"]), as_terms(torque, params.pulley_names)
    found, _ = params._model.torques(terms, (), now, now, core["theta"], core["omega"])
    return found


def torque_slopes(params: Params, state: State, torque: TorqueLike) -> tuple[Array, Array]:
    """Return the derivatives of the set torques by angles and by speeds, (n_p, n_p) each.

    By central differences, over steps of 1e-5 rad and of 1e-4 of the speed.
    """
    core = state._to_core(params)
    n_p = len(params.pulleys)
    slopes = []
    for name in ("theta", "omega"):
        slope = np.zeros((n_p, n_p))
        for k in range(n_p):
            at = core[name][k]
            h = _ANGLE if name == "theta" else max(_SPEED, _RELATIVE * abs(at))
            ends = []
            for step in (h, -h):
                values = np.array(core[name])
                values[k] = at + step
                ends.append(torques_at(params, {**core, name: values}, torque))
            slope[:, k] = (ends[0] - ends[1]) / (2.0 * h)
        slopes.append(slope)
    return slopes[0], slopes[1]


def balancing(params: Params, core: Mapping[str, Any], prescribed: tuple[int, ...]) -> Array:
    """Return the torques (n_p,) [N m] that hold the pulleys' speeds, 0 on those prescribed."""
    n_p = len(params.pulleys)
    rate = params._model.rate(core, np.zeros(n_p))["omega"]
    held = -rate * params.shaft_inertias
    held[list(prescribed)] = 0.0
    return np.asarray(held)
