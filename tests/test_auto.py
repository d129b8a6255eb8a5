"""method="auto": what it chooses, what it says, what it costs in steps, and that it is as exact.

Steps are weighed, not timed: a try of the implicit method, six stages and a factorisation, is worth
`WORTH` of the explicit one (2.3 and 12 us at 60 links, benchmarks/kernels.py).
"""

from __future__ import annotations

import re
from typing import Any

import attrs
import numpy as np
import pytest
from drives import with_belt
from tiers import extended_if

import beltdyn as bd

WORTH = 5.2


def weight(stats: bd.Stats) -> float:
    """Tries in units of an explicit one; of auto, rejected ones shared as the accepted are."""
    said = re.findall(r"(\w+) for \S+ s in (\d+) steps", stats.choice)
    counts = {name: int(n) for name, n in said} or {stats.method: stats.steps}
    assert sum(counts.values()) == stats.steps
    explicit = counts.pop("tsit5", 0)
    return (explicit + WORTH * sum(counts.values())) * (1 + stats.rejected / stats.steps)


@pytest.mark.parametrize(
    ("case", "change", "rtol", "method", "words"),
    [
        (2, {}, 1e-7, "tsit5", "spectral bound"),
        (1, {"n_bodies": 240}, 1e-3, "rodas4", "implicit ones are cheaper"),
        (1, {"axial_damping": 3.64}, 1e-3, "rodas4", "implicit ones are cheaper"),
        (2, {}, 0.03, "lbdf2", "lbdf2: "),
    ],
)
def test_what_is_chosen(
    case: int, change: dict[str, Any], rtol: float, method: str, words: str
) -> None:
    """Explicit on a coarse belt with a tight tolerance, implicit on fine or heavily damped ones, of
    second order for a coarse tolerance; and it says why.
    """
    scene = bd.scenes.get(f"kubas-case-{case}")
    params, t_end = with_belt(scene.params, **change), 0.1 if method == "lbdf2" else 0.05
    result = bd.simulate(params, scene.torque_fn, t_end, rtol=rtol)
    stats, bound = result.stats, params.info["spectral_bound"]
    assert stats.method == method and stats.changes == 0
    assert words in stats.choice and stats.choice in result.message
    if method == "tsit5":
        assert stats.nlu == 0 and f"spectral bound {bound:.3g} 1/s" in stats.choice
    if method == "rodas4":  # the explicit method would need this many
        assert t_end / (0.93 * 3.5 / bound) > 20 * stats.steps
    if method == "lbdf2":
        assert stats.choice.startswith(words)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("name", "rtol"),
    [("kubas-case-1", 1e-3), ("kubas-case-2", 1e-4), ("three-pulleys", 1e-2)],
)
def test_costs_about_what_the_better_of_both_costs(name: str, rtol: float) -> None:
    """At most half as much again, the looks at the other method included."""
    scene = bd.scenes.get(name)
    start = bd.settle(scene.params)
    given = {"t_end": min(scene.t_end, 0.25), "initial": start, "rtol": rtol}
    costs = {
        method: weight(bd.simulate(*scene[:2], method=method, **given).stats)
        for method in ("tsit5", "rodas4", "auto")
    }
    assert costs["auto"] <= 1.5 * min(costs["tsit5"], costs["rodas4"]), costs


def test_changes_its_mind_and_says_so() -> None:
    """A contact a thousand times stiffer than the belt's joints, of which the bound knows nothing:
    explicit steps are rejected one after the other.
    """
    base = bd.scenes.kubas_case_1()
    contact = attrs.evolve(base.params.contact, linear=1e3 * base.params.contact.linear)
    params = attrs.evolve(base.params, contact=contact)
    result = bd.simulate(params, base.torque_fn, 0.05, rtol=1e-6)
    assert result.stats.changes >= 1 and result.stats.nlu > 0
    assert "switched" in result.message and "rodas4 for" in result.message
    assert "switched" in dict(result.summary(verbose=True))["method"]


@pytest.mark.parametrize(
    "name",
    extended_if("unequal-pulleys".__ne__, ["three-pulleys", "unequal-pulleys", "flywheel-start"]),
)
@pytest.mark.filterwarnings("ignore:full_slip. pulley . slips:UserWarning")  # the flywheel's does
@pytest.mark.filterwarnings("ignore:mesh:UserWarning")
def test_is_as_exact_as_asked_across_its_changes(name: str) -> None:
    """Joint forces against a tight run, and the ledger, which goes on through every change. 64
    links of the paper's mesh, on which neither method is cheaper throughout.
    """
    scene = bd.scenes.get(name)
    params, torque = with_belt(scene.params, n_bodies=64, mesh="paper"), scene.torque_fn
    times = np.sort(np.random.default_rng(3).uniform(0.0, 0.2, 300))
    given: dict[str, Any] = {"initial": bd.settle(params), "t_eval": times}
    exact = bd.simulate(params, torque, 0.2, method="tsit5", rtol=1e-9, **given).joints.force
    changes = 0
    for rtol in (1e-2, 1e-3, 1e-4):
        result = bd.simulate(params, torque, 0.2, rtol=rtol, **given)
        error = np.sqrt(np.mean((result.joints.force - exact) ** 2)) / exact.mean()
        assert error <= rtol
        slips = any(one.code == "full_slip" for one in result.warnings)
        assert slips == (name == "flywheel-start")
        assert result.stats.local_error <= rtol * (1 + 1e-12)
        # power is integrated at least to the second order of what the steps leave of the motion
        assert np.max(np.abs(result.energy.residual)) <= 10 * rtol * result.energy.passed[-1]
        changes += result.stats.changes
    assert changes > 0


def test_a_named_method_is_kept() -> None:
    params, torque, *_ = bd.scenes.kubas_case_1()
    start = bd.settle(params)
    for method in ("tsit5", "rodas4", "lbdf2", "lie"):
        result = bd.simulate(params, torque, 2e-3, initial=start, method=method)
        assert (result.stats.method, result.stats.choice) == (method, f"{method}, as asked")
        assert "asked" not in result.message


def test_steps_that_still_grow_are_not_judged() -> None:
    """Explicit steps leave vibrations of 1e-10 s in steep friction: implicit ones need 200 to be as
    long as before, and were left again after 144, for good (400 000 steps to t = 0.0159 s).
    """
    scene = bd.scenes.hard["threlfall-steep"].with_belt("joint")
    assert scene is not None
    stats = scene._replace(t_end=0.016).run().stats
    assert stats.changes == 2 and stats.steps < 2000


def test_a_belt_that_flows_has_one_method() -> None:
    """Waves in its undamped cells grow in explicit steps, and the second order damps its modes."""
    params = with_belt(bd.scenes.get("unequal-pulleys").params, mesh="ale", axial_damping=0.0)
    stats = bd.simulate(params, bd.Viscous([0.0, 1.0]), 0.05, rtol=0.03).stats
    assert stats.method == "rodas4" and "implicit ones are cheaper" in stats.choice
