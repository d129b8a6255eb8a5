"""Off is free: what a scene does not call for has no pass, no state, no byte and no output of its
own, and a coefficient of 0, or one too small to count, changes nothing but that.

By counters, of the core's own: passes (``Simulation.passes``), numbers in the state, works in it
and bytes of the whole simulation (``Simulation.sizes``), arrays of samples, evaluations. Two more
are counted in C: exponentials (``tests/c/test_exponentials.c``) and allocations while running
(``tests/c/test_memory.c``). ``benchmarks/effects.py`` measures the time.
"""

from __future__ import annotations

import itertools
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from effects import EFFECTS, bare
from laws import EXAMPLES, STRIBECK, with_laws, without_curve

import beltdyn as bd
from beltdyn import _core
from beltdyn.loads.motions import as_motions, motion_terms
from beltdyn.loads.torques import as_terms

T_END = 4e-3

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

#: Every effect, and both meshes in turn; that effects are there only in drives that call for them,
#: and the ledger off, are in ``test_drive_table.py``.
cases = pytest.mark.parametrize(
    ("name", "mesh"),
    [(name, EFFECTS[name].meshes[k % len(EFFECTS[name].meshes)]) for k, name in enumerate(EFFECTS)],
)


class Counted:
    """What a simulation of a drive takes."""

    def __init__(self, params: bd.Params, **parts: Any) -> None:
        state = bd.settle(params)
        motion = motion_terms(as_motions(parts.get("motion"), params.pulley_names))
        torque = as_terms(parts.get("torque", bd.Viscous([0.0, 0.0])), params.pulley_names)
        self.sim = _core.Simulation(
            params._model, state._to_core(params), torque, T_END, method="rodas4", motion=motion
        )
        self.passes, self.sizes = self.sim.passes, self.sim.sizes
        arrays = self.sim.sample([0.0, T_END])
        self.widths = {name: array.shape[1] for name, array in arrays.items()}

    def run(self) -> dict[str, Any]:
        assert self.sim.advance(np.inf)
        return dict(self.sim.stats)


def assert_same_in_all(one: Counted, other: Counted) -> None:
    """In every counter, and in the bits of a run."""
    assert (one.passes, one.sizes, one.widths) == (other.passes, other.sizes, other.widths)
    assert one.run() == other.run()
    found, expected = one.sim.state(), other.sim.state()
    for field, values in expected.items():
        np.testing.assert_array_equal(found[field], values, err_msg=field)


@pytest.mark.one_in(3)
@cases
def test_off_is_not_there_and_on_takes_what_it_needs(name: str, mesh: str) -> None:
    effect, off = EFFECTS[name], Counted(bare(mesh))
    on = Counted(effect.on(bare(mesh)))
    assert len(on.passes) == len(off.passes) + effect.passes
    grown = on.sizes["state"] - off.sizes["state"]
    if effect.state:
        n = bare(mesh).belt.n_bodies  # and at most so many to fill vectors and margins
        assert effect.state * n <= grown <= effect.state * (n + 3 * 8)
    else:  # of pulleys and mounts a few numbers at most
        assert grown <= (16 if effect.bytes else 0)
    assert (on.sizes["bytes"] > off.sizes["bytes"]) == effect.bytes
    changed = {k for k in on.widths if on.widths[k] != off.widths.get(k)}
    assert changed == effect.outputs and not set(off.widths) - set(on.widths)


@pytest.mark.one_in(3)
@cases
def test_a_coefficient_of_0_is_off(name: str, mesh: str) -> None:
    effect, off = EFFECTS[name], Counted(bare(mesh))
    if effect.zero is None:
        assert name in ("mounts", "couplings"), "only bodies have no number that is 0 without them"
        return
    assert_same_in_all(Counted(effect.zero(bare(mesh))), off)


@pytest.mark.one_in(3)
@cases
def test_next_to_nothing_changes_nothing_but_rounding(name: str, mesh: str) -> None:
    """In fixed steps, so that no choice of steps depends on it: the effect's pass is made, and what
    it adds is lost. Sums may be in another order where it has kernels of its own; a relative
    rounding of 1e-16 in each of 2000 steps is 2e-13, over forces that are differences of places,
    T / (EA / L) = 7 mm, of 1e-16 of 1 m.
    """
    effect, params = EFFECTS[name], bare(mesh)
    torque = bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-5.0, 2.0]])
    # settled without it, so that both begin alike
    start = bd.settle(params)
    runs = []
    for one in (params, effect.tiny(params)):
        at_rest, untwisted = np.zeros(len(one.mounted)), np.zeros(len(one.coupled))
        begin = attrs.evolve(
            start,
            **dict.fromkeys(("travel", "travel_speed", "mount_friction"), at_rest),
            **dict.fromkeys(("rim_angle", "rim_speed", "windup"), untwisted),
        )
        runs.append(bd.simulate(one, torque, T_END, initial=begin, method="rk4", step=2e-6))
    off, on = runs
    assert len(on.effects) == len(off.effects) + effect.passes
    assert on.stats.steps == off.stats.steps
    scale, speeds = np.abs(off.joints.force).mean(), np.abs(off.pulleys.omega).max()
    assert np.abs(on.joints.force - off.joints.force).max() <= 1e-9 * scale
    assert np.abs(on.pulleys.omega - off.pulleys.omega).max() <= 1e-9 * speeds
    assert np.abs(on.contact.normal - off.contact.normal).max() <= 1e-9 * scale


def test_motions_and_loads() -> None:
    """A prescribed motion takes two passes and bytes, and nothing without; loads are terms of the
    one pass of the pulleys, in bytes what their numbers take.
    """
    off = Counted(bare("joint"))
    moved = Counted(bare("joint"), motion={0: bd.PiecewiseLinear([0.0, 1e-2], [0.0, 1.0])})
    assert len(moved.passes) == len(off.passes) + 2 and moved.sizes["bytes"] > off.sizes["bytes"]
    assert moved.sizes["state"] == off.sizes["state"] and moved.widths == off.widths
    none = Counted(bare("joint"), motion={})
    assert (none.passes, none.sizes) == (off.passes, off.sizes)
    loaded = Counted(bare("joint"), torque=bd.Viscous([0.0, 0.0]) + bd.Load(pulley=1, viscous=0.1))
    assert loaded.passes == off.passes and loaded.sizes["state"] == off.sizes["state"]
    assert loaded.sizes["bytes"] > off.sizes["bytes"]


def run(params: bd.Params, torque: bd.TorqueLike) -> bd.Result:
    return bd.simulate(params, torque, T_END, method="rk4", step=2e-6)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("name", "mesh"), list(zip(STRIBECK, itertools.cycle(["paper", "joint"]), strict=False))
)
def test_a_stribeck_curve_costs_no_counter_and_equal_coefficients_are_none(
    name: str, mesh: str
) -> None:
    """Passes, states, bytes and outputs are the same with it; where its static coefficient is the
    kinetic one, so are all bits of a run.
    """
    plain, curved = EXAMPLES[name], STRIBECK[name]
    equal = without_curve(curved)
    without = attrs.evolve(equal, v_stribeck=1.0) if name == "lugre" else plain
    off, on, same = (
        Counted(attrs.evolve(bare(mesh), friction=law)) for law in (without, curved, equal)
    )
    assert (on.passes, on.sizes, on.widths) == (off.passes, off.sizes, off.widths)
    assert_same_in_all(same, off)


@pytest.mark.parametrize("law", EXAMPLES)
def test_where_friction_is_given_changes_nothing(law: str) -> None:
    """For the whole drive, or for each of its pulleys: the same bits."""
    params = drives.on_mesh(drives.plain(), "joint")
    torque = bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-5.0, 2.0]])
    whole = attrs.evolve(params, friction=EXAMPLES[law])
    one, other = run(whole, torque), run(with_laws(params, EXAMPLES[law], EXAMPLES[law]), torque)
    assert one.effects == other.effects and one.final_state == other.final_state
    np.testing.assert_array_equal(one.contact.friction, other.contact.friction)
