"""Maxwell slip: one element is the elastic/perfectly plastic law, and what a state of several rows
asks of runs and settling. Loops: test_friction_path.py; files and records: test_drive_table.py.
"""

from __future__ import annotations

from typing import Any

import attrs
import drives
import numpy as np
import pytest
from laws import EXAMPLES, STRIBECK, with_laws

import beltdyn as bd

MAXWELL = EXAMPLES["maxwell_slip"]
assert isinstance(MAXWELL, bd.MaxwellSlip)
STILL = bd.PiecewiseLinear([0.0, 1.0], [[0.0, 0.0], [0.0, 0.0]])


def run(params: bd.Params, **options: Any) -> bd.Result:
    """A short one, under a torque that makes some of the wrap slip."""
    torque = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-40.0, 40.0]])
    if options.get("method") == "rk4":
        options["step"] = 2e-6
    return bd.simulate(params, torque, t_end=0.01, t_eval=np.linspace(0.0, 0.01, 6), **options)


@pytest.mark.parametrize(
    ("method", "mesh", "curve"),
    [("tsit5", "paper", False), ("rk4", "joint", True), ("rodas4", "paper", True),
     ("lbdf2", "joint", False)],
)  # fmt: skip
def test_one_element_is_elastic_plastic_to_the_last_bit(
    method: str, mesh: str, curve: bool
) -> None:
    """Force, state and every step of the run: the same operations in the same order."""
    law = (STRIBECK if curve else EXAMPLES)["elastic_plastic"]
    numbers = {name: (getattr(law, name),) for name in ("mu", "stiffness", "damping")}
    alone = bd.MaxwellSlip(**numbers, mu_s=law.mu_s, v_stribeck=law.v_stribeck)
    base = drives.on_mesh(drives.plain(), mesh)
    one, other = (run(with_laws(base, each, each), method=method) for each in (law, alone))
    assert one.stats.steps == other.stats.steps and one.contact.friction.any()
    np.testing.assert_array_equal(one.joints.force, other.joints.force)
    np.testing.assert_array_equal(one.pulleys.omega, other.pulleys.omega)
    np.testing.assert_array_equal(one.contact.friction, other.contact.friction)
    assert one.final_state.mu.shape == other.final_state.mu.shape == (base.belt.n_bodies,)
    np.testing.assert_array_equal(one.final_state.mu, other.final_state.mu)


def test_equal_elements_are_one_of_their_sum() -> None:
    """Four quarters: powers of two leave every bit of the sums as it is."""
    law, base = EXAMPLES["elastic_plastic"], drives.plain()
    parts = {name: (getattr(law, name) / 4,) * 4 for name in ("mu", "stiffness", "damping")}
    quarters = bd.MaxwellSlip(**parts)
    one, other = (run(with_laws(base, each, each), method="tsit5") for each in (law, quarters))
    for name in ("force", "deformation"):
        whole, summed = getattr(one.joints, name), getattr(other.joints, name)
        assert np.max(np.abs(whole - summed)) <= 1e-9 * np.max(np.abs(whole))
    mu = other.final_state.mu
    assert mu.shape == (4, base.belt.n_bodies) and (mu == mu[0]).all() and mu.any()


def test_a_drive_goes_on_from_its_own_state_however_laws_differ() -> None:
    """Stretches a thousand times as large on one pulley as on the other, of one element and of
    lists in opposite order. Of laws of one state and of three, the first row is used by both.
    """
    soft, hard = (bd.ElasticPlastic(mu=0.8, stiffness=k, damping=1e-5 * k) for k in (1e6, 1e9))
    lists = [
        bd.MaxwellSlip(mu=(0.4, 0.4), stiffness=k, damping=(100.0, 100.0))
        for k in ((1e6, 1e9), (1e9, 1e6))
    ]
    for laws in ((soft, hard), lists, (MAXWELL, EXAMPLES["dahl"])):
        params = with_laws(drives.plain(), *laws)
        first = run(params)
        state, on = first.final_state, first.contact.pulley[-1]
        assert bd.simulate(params, STILL, t_end=0.0101, initial=state).stats.steps > 0
    assert state.mu.shape == (3, params.belt.n_bodies) and params.info["n_states"] == 3
    assert not state.mu[1:, on == 1].any() and state.mu[0, on == 1].any()
    assert state.mu[1:, on == 0].any()


def test_the_mesh_is_verified_from_a_state_of_other_rows() -> None:
    """That of a drive with another number of elements, but without friction in it."""
    base = drives.on_mesh(drives.plain(), "joint")
    other = with_laws(base, EXAMPLES["dahl"], EXAMPLES["dahl"])
    start = bd.settle(with_laws(base, MAXWELL, MAXWELL))
    assert start.mu.shape[0] == 3 and not start.mu.any()
    torque = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-20.0, 20.0]])
    seen = bd.simulate(other, torque, t_end=0.01, initial=start, verify=True)
    assert seen.accuracy is not None and seen.accuracy["tension"].space is not None


def test_a_state_of_other_laws_is_refused_by_name() -> None:
    base = drives.plain()
    of_dahl = run(with_laws(base, EXAMPLES["dahl"], EXAMPLES["dahl"])).final_state
    several = with_laws(base, MAXWELL, MAXWELL)
    with pytest.raises(ValueError, match=r"^initial\.mu must have 3 row\(s\), .* got 1: is it of"):
        bd.simulate(several, STILL, t_end=0.02, initial=of_dahl)
    # as many rows, but of a coefficient where a stretch is meant
    elastic = with_laws(base, EXAMPLES["elastic_plastic"], EXAMPLES["elastic_plastic"])
    with pytest.raises(ValueError, match=r"^state mu\[\d+\] must .* is it of a drive with"):
        bd.simulate(elastic, STILL, t_end=0.02, initial=of_dahl)
    # without friction in it, it is one of any law
    empty = attrs.evolve(of_dahl, mu=np.zeros(base.belt.n_bodies))
    assert bd.simulate(several, STILL, t_end=0.0101, initial=empty).stats.steps > 0
    with pytest.raises(ValueError, match=r"^State\.mu must have shape"):
        attrs.evolve(of_dahl, mu=np.zeros((3, 7)))


def test_settling_with_friction_holds_every_element() -> None:
    params = with_laws(drives.plain(), MAXWELL, MAXWELL)
    settled = bd.settle(params, friction=True, tolerance=1e-3)
    assert settled.mu.shape == (3, params.belt.n_bodies) and all(row.any() for row in settled.mu)
    limits = np.array(MAXWELL.mu)[:, None]
    stiffness = np.array(MAXWELL.stiffness)[:, None] * params.info["link_length"]
    seen = params._model.observe(settled._to_core(params))
    assert np.all(np.abs(stiffness * settled.mu) <= limits * seen["normal"][0] * 1.01 + 1e-9)
