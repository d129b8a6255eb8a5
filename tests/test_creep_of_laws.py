"""Creep of friction laws without a state: in a steady run it is what their closed form says."""

from __future__ import annotations

import math

import drives
import numpy as np
import pytest
from laws import EXAMPLES, with_laws

import beltdyn as bd

LAWS = [name for name, law in EXAMPLES.items() if law.n_states == 0]


def test_creep_under_a_stribeck_curve_is_the_first_from_rest() -> None:
    """Friction rises to 0.6 mu at 0.0234 m/s, falls below it again and reaches it for good at 0.08:
    of three velocities the lowest, for every share that the first hill reaches.
    """
    law = bd.Coulomb(mu=0.3, v_reg=0.1, mu_s=1.2, v_stribeck=0.03)
    speeds = np.linspace(0.0, 1.0, 1_000_001)
    ratio = speeds / law.v_reg
    level = law.mu + (law.mu_s - law.mu) * np.exp(-((speeds / law.v_stribeck) ** 2))
    share = level * ratio / np.sqrt(1.0 + ratio * ratio) / law.mu
    for q in (0.0, 0.05, 0.3, 0.55, 0.6, 0.62, 0.8, 0.95):
        first = speeds[np.argmax(share >= q)]
        assert law.creep(q) == pytest.approx(first, abs=1e-6)
    assert law.creep(0.6) < 0.03 < law.creep(0.8)


@pytest.mark.filterwarnings("ignore:(mesh|full_slip|torque):UserWarning")
@pytest.mark.parametrize("mu_s", [0.0, 0.01])
def test_the_step_of_rk4_is_short_enough_wherever_the_slope_is_largest(mu_s: float) -> None:
    """At rest, or with a static coefficient below the kinetic one where friction rises to it."""
    law = bd.Coulomb(mu=0.8, v_reg=0.01, mu_s=mu_s, v_stribeck=0.01 if mu_s else 0.0)
    torque = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-40.0, 40.0]])
    params = with_laws(drives.plain(), law, law)
    result = bd.simulate(params, torque, 0.01, method="rk4")
    assert result.success and not any(one.code == "balance" for one in result.warnings)


@pytest.mark.parametrize("name", LAWS)
def test_a_loaded_wrap_creeps_by_its_closed_form(name: str) -> None:
    """Where the whole wrap carries the share q = ln(T_tight / T_slack) / (mu wrap), an inextensible
    belt slips everywhere at creep(q); this one besides by its elongation, from span to span
    v (T_tight - T_slack) / EA, here a tenth of it. Tensions are those that press, less rho A v^2.
    """
    law = EXAMPLES[name]
    params = with_laws(drives.on_mesh(drives.plain(), "joint"), law, law)
    torque = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0], [-30.0, 0.0]]) + bd.Viscous([0.0, 6.0])
    result = bd.simulate(params, torque, 0.4, t_eval=np.linspace(0.3, 0.4, 401))
    radius = params.pulleys[1].radius
    speed = abs(float(result.pulleys.omega[:, 1].mean())) * radius
    spans = np.mean(result.span_tension, axis=0) - params.belt.linear_density * speed**2
    share = math.log(spans.max() / spans.min()) / (0.8 * math.pi)
    expected = law.creep(share)
    elastic = speed * (spans.max() - spans.min()) / params.belt.axial_stiffness
    assert elastic < 0.2 * expected
    for pulley in range(2):
        on = result.contact.pulley == pulley
        pressed = np.sum(result.contact.normal, where=on)
        slip = abs(np.sum(result.contact.normal * result.contact.velocity, where=on)) / pressed
        assert abs(slip - expected) <= elastic + 0.02 * expected
