"""Finding parameters: known ones come back from noisy curves, and what cannot be told is said.

What goes wrong in a search, and every argument that is wrong.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pytest
from identify_common import (
    COARSE,
    SPEED,
    T_END,
    TENSION,
    TIMES,
    TORQUE,
    changed,
    curves,
    free_pulley,
)
from scipy import stats
from sweep_runs import Sent
from tiers import ci_if

import beltdyn as bd
from beltdyn.identification import linear
from beltdyn.identification.linear import LOSSES, cost_and_weights

pytestmark = COARSE


TRUE = {"pulleys[1].inertia": 0.03, "friction.mu_k": 0.8, "belt.axial_stiffness": 80e3}


def identify(*given: Any, **options: Any) -> bd.Identification:
    """As bd.identify from one start and on one mesh: measured on it, as in most tests here."""
    return bd.identify(*given, **{"starts": 1, "mesh": False, **options})


def check_found(found: bd.Identification, part: float = 0.1) -> None:
    """Without noise only where the search stops is left, a small part of the noise it allows."""
    for name, value in found.values.items():
        assert abs(math.log(value / TRUE[name])) < part * found.std[name]


@pytest.mark.extended(
    guard="identify/test_identify.py::"
    "test_sensitivity_and_interval_of_a_free_spin_up_are_those_of_the_closed_form"
)
@pytest.mark.parametrize("known", [True, False])
def test_known_parameters_lie_within_their_intervals_in_90_of_100_draws(
    rig: bd.Params, truth: bd.Result, known: bool
) -> None:
    """With the noise known, and found from what is left; intervals of 95 %, each and jointly.

    Of 100 such fewer than 90 hold the truth with probability 0.011; the seeds are fixed, so this is
    paid once. (The intervals are linearised and links come and go: over 300 other seeds 91 to 94 %
    held it.) Those much too wide would pass: of 50 % 35 to 65 hold it with probability 0.998.
    """
    true = {name: TRUE[name] for name in (TRUE if known else [*TRUE][:2])}
    initial = None if known else bd.settle(rig)
    experiment = bd.Experiment(TORQUE, T_END, initial=initial, options={"ledger": False})
    start = changed(rig, {name: 1.05 * value for name, value in true.items()})
    held: list[Any] = []
    for seed in range(100):
        data = curves(experiment, truth, seed, known)
        found = identify(start, list(true), data, jac="2-point", workers=1)
        assert found.success
        single, half, joint = (
            [low <= true[name] <= high for name, (low, high) in intervals.items()]
            for intervals in (found.intervals, found.interval(0.5), found.joint_intervals)
        )
        held.append([all(joint), *single, *half])
    joint, *counts = np.sum(held, axis=0)
    assert min(joint, *counts[: len(true)]) >= 90
    assert min(counts[len(true) :]) >= 35 and max(counts[len(true) :]) <= 65


def test_a_start_30_percent_off_leads_to_the_same(rig: bd.Params, targets: list[bd.Target]) -> None:
    off = {"pulleys[1].inertia": 1.3, "friction.mu_k": 0.7, "belt.axial_stiffness": 1.3}
    start = changed(rig, {name: off[name] * value for name, value in TRUE.items()})
    found = identify(start, list(TRUE), targets)
    assert found.success
    check_found(found)
    assert found.cost < 0.01
    assert found.params == changed(rig, found.values)
    # printing shows every parameter and target
    for part in (*TRUE, "95 % interval", "pulleys.omega", "span_tension[0]", "converged"):
        assert part in str(found)
    assert found.residuals["pulleys.omega"].shape == (TIMES.size, 2)
    assert found.labels[1] == "pulleys.omega[1] at 0.004 s"
    assert found.jacobian.shape == (60, 3)
    assert "friction.mu_k" in str(found.sensitivity())
    assert found.sensitivity("sigma").rows == ("pulleys.omega", "span_tension[0]")
    with pytest.raises(ValueError, match="unit must be"):
        found.sensitivity("percent")
    with pytest.raises(ValueError, match="confidence must be > 0 and < 1"):
        found.interval(95.0)


@pytest.mark.ci(guard="identify/test_identify.py::test_runs_may_begin_alike")
def test_numbers_do_as_well_as_curves_and_runs_may_differ(rig: bd.Params) -> None:
    """Two runs, one on softer friction joints, from numbers alone.

    Mean tensions: that of a moment shakes as links come and go, and has as many least squares.
    """

    def speed(result: bd.Result) -> float:
        return float(result.pulleys.omega[-1, 1])

    def tensions(result: bd.Result) -> Any:
        return result.span_tension.mean(axis=0)

    soft = {"friction.sigma": 5e3}
    data, at = [], np.linspace(0.02, T_END, 200)
    for name, changes in (("stiff", {}), ("soft", soft)):
        run, drive = bd.Experiment(TORQUE, T_END, name=name, changes=changes), changed(rig, changes)
        measured = bd.simulate(drive, TORQUE, T_END, t_eval=at)
        data += [
            run.number(speed, speed(measured), t=at, sigma=0.05),
            run.number(tensions, tensions(measured), t=at, sigma=2.0, names=["tight", "slack"]),
        ]
    start = changed(rig, {name: 1.1 * value for name, value in TRUE.items()})
    found = identify(start, list(TRUE), data)
    check_found(found)
    assert found.labels == ("stiff: speed", "tight", "slack", "soft: speed", "tight", "slack")
    assert found.results["stiff"].params == found.params
    assert found.results["soft"].params == changed(found.params, soft)


@pytest.mark.parametrize("t_end", ci_if(T_END.__eq__, [1e-3, T_END]))
def test_how_the_belt_was_tensioned_can_be_found(rig: bd.Params, t_end: float) -> None:
    def moved(dx: float) -> bd.Params:
        return attrs.evolve(rig, tensioning=bd.Tensioning(friction=True, offset={1: (dx, 0.0)}))

    run, times = bd.Experiment(TORQUE, t_end, settling={"tolerance": 1e-5}), TIMES * t_end / T_END
    measured = bd.simulate(moved(-0.002), TORQUE, t_end, t_eval=times)
    data = [run.curve("joints.force", times, measured.joints.force, sigma=5.0)]
    found = identify(moved(-0.0015), ["tensioning.offset[1][0]"], data)
    assert found.params.tensioning.offset[1][0] == found.values["tensioning.offset[1][0]"]
    own = bd.Free("way", start=-0.0015, size=0.001, set=lambda _params, value: moved(value))
    by_own = identify(rig, [own], data)
    for values, std in ((found.values, found.std), (by_own.values, by_own.std)):
        [(name, value)] = values.items()
        assert abs(value + 0.002) < 0.1 * std[name]


@pytest.mark.ci(guard="identify/test_identify.py::test_runs_may_begin_alike")
def test_the_result_does_not_depend_on_where_runs_are_done(
    rig: bd.Params, targets: list[bd.Target]
) -> None:
    start, free = changed(rig, {"friction.mu_k": 0.9}), ["friction.mu_k"]
    with ThreadPoolExecutor(2) as threads, Sent() as sent:
        one, *others = (
            identify(start, free, targets, **where)
            for where in (
                {"workers": 1},
                {"workers": 2},
                *({"executor": executor} for executor in (threads, sent, "processes")),
            )
        )
    for two in others:
        assert one.values == two.values
        assert one.intervals == two.intervals
        np.testing.assert_array_equal(one.jacobian, two.jacobian)
        assert (one.nfev, one.runs, one.cost) == (two.nfev, two.runs, two.cost)
        for name, run in one.results.items():
            np.testing.assert_array_equal(run.pulleys.omega, two.results[name].pulleys.omega)
    with pytest.raises(ValueError, match="give one of them"):
        identify(start, free, targets, workers=1, executor="threads")


@pytest.mark.ci(guard="identify/test_identify.py::test_runs_may_begin_alike")
def test_runs_that_begin_alike_share_their_start_and_torques_may_be_functions(
    rig: bd.Params, rest: bd.State, capfd: pytest.CaptureFixture[str]
) -> None:
    begun = []

    def begin(params: bd.Params) -> bd.State:
        begun.append(params)
        return rest

    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        return list(TORQUE(t, theta, omega))

    omega = bd.simulate(rig, TORQUE, T_END, t_eval=TIMES, initial=rest).pulleys.omega
    runs = [bd.Experiment(loads, T_END, initial=begin) for loads in (TORQUE, torque)]
    data = [run.curve("pulleys.omega", TIMES, omega, sigma=SPEED) for run in runs]
    start = changed(rig, {"friction.mu_k": 0.84})
    found = identify(start, ["friction.mu_k"], data, workers=2, progress=True)
    check_found(found)
    assert found.runs == 2 * len(begun)
    assert list(found.residuals) == ["run 1: pulleys.omega", "run 2: pulleys.omega"]
    assert capfd.readouterr().err == ""  # no terminal, no bar


def final(result: bd.Result) -> float:
    return float(result.pulleys.omega[-1, 1])


def test_runs_may_begin_alike() -> None:
    """omega = M t/I: of runs with one start, made once for both, and torques given either way."""
    begun, rest = [], bd.settle(free_pulley(0.02))

    def begin(params: bd.Params) -> bd.State:
        begun.append(params)
        return rest

    constant = bd.PiecewiseLinear([0.0], [[0.0, 3.0]])
    runs = [bd.Experiment(one, 0.02, initial=begin) for one in (constant, lambda *_: [0.0, 3.0])]
    data = [run.curve("pulleys.omega[1]", [0.01, 0.02], [1.0, 2.0], sigma=0.01) for run in runs]
    found = bd.identify(free_pulley(0.02), ["pulleys[1].inertia"], data, workers=2)
    assert found.values["pulleys[1].inertia"] == pytest.approx(0.03, rel=1e-4)
    # a start of 20 links is none of the finer mesh, of which these runs then tell nothing
    assert found.runs == 2 * (len(begun) - 1)
    assert "without the error of the mesh: initial.x must have shape (40,)" in str(found)
    assert list(found.residuals) == [f"run {k}: pulleys.omega[1]" for k in (1, 2)]


@pytest.mark.ci(guard="identify/test_identify.py::test_runs_may_begin_alike")
def test_runs_may_differ_and_be_done_anywhere() -> None:
    """Of numbers, from different drives, to the same bits in this thread, in others, in bytes."""
    constant = bd.PiecewiseLinear([0.0], [[0.0, 3.0]])
    other = {"pulleys[0].inertia": 0.5}
    runs = [
        bd.Experiment(constant, 0.02, name=name, changes=changes)
        for name, changes in (("one", {}), ("other", other))
    ]
    numbers = [run.number(final, 2.0, t=[0.02], sigma=0.01) for run in runs]
    with ThreadPoolExecutor(2) as threads, Sent() as sent:
        one, *others = (
            bd.identify(free_pulley(0.02), ["pulleys[1].inertia"], numbers, **where)
            for where in ({"workers": 1}, {"executor": threads}, {"executor": sent})
        )
    assert one.values["pulleys[1].inertia"] == pytest.approx(0.03, rel=1e-4)
    assert one.results["other"].params == changed(one.params, other)
    for two in others:
        assert (one.values, one.intervals, one.runs) == (two.values, two.intervals, two.runs)


def test_a_fit_survives_workers_that_die(tmp_path: Path) -> None:
    """The run is done again; one in which they always die is no point of the search."""
    died = tmp_path / "died"

    def read(result: bd.Result, always: bool = False) -> float:
        if always or not died.exists():
            died.touch()
            os._exit(1)
        return final(result)

    run = bd.Experiment(bd.PiecewiseLinear([0.0], [[0.0, 3.0]]), 0.02)
    drive, free = free_pulley(0.02), ["pulleys[1].inertia"]
    data = [run.number(read, 2.0, t=[0.02], sigma=0.01)]
    found = identify(drive, free, data, executor="processes")
    assert died.exists() and found.values[free[0]] == pytest.approx(0.03, rel=1e-4)
    data = [run.number(partial(read, always=True), 2.0, t=[0.02], sigma=0.01)]
    with pytest.raises(RuntimeError, match="the worker process died in this run, 3 times"):
        identify(drive, free, data, executor="processes")


def test_a_prior_counts_like_one_more_measurement(
    rig: bd.Params, experiment: bd.Experiment, truth: bd.Result
) -> None:
    """Data and prior of equal weight meet in the middle, and sqrt(2) sharper."""
    data = [experiment.curve("pulleys.omega", TIMES, truth.pulleys.omega, sigma=SPEED)]
    alone = identify(rig, ["friction.mu_k"], data)
    std = alone.std["friction.mu_k"]
    known = 0.8 * (1.0 + std)
    both = identify(rig, ["friction.mu_k"], data, prior={"friction.mu_k": (known, std * known)})
    # The curves bend: the slope a standard deviation on is another by some per cent.
    assert both.std["friction.mu_k"] == pytest.approx(std / math.sqrt(2.0), rel=0.05)
    assert math.log(both.values["friction.mu_k"] / 0.8) == pytest.approx(std / 2.0, rel=0.1)
    # an outlier counts less with a robust loss
    speeds = truth.pulleys.omega.copy()
    speeds[-1] += 30.0 * SPEED
    wrong = [experiment.curve("pulleys.omega", TIMES, speeds, sigma=SPEED)]
    plain = identify(rig, ["friction.mu_k"], wrong)
    robust = identify(rig, ["friction.mu_k"], wrong, loss="soft_l1")
    off = [abs(found.values["friction.mu_k"] - 0.8) for found in (plain, robust)]
    assert off[1] < 0.1 * off[0] and "misses the data" in str(plain)
    few = identify(changed(rig, {"friction.mu_k": 0.84}), ["friction.mu_k"], data, max_nfev=2)
    assert not few.success and few.nfev <= 2 and "not converged" in str(few)


def test_sensitivity_and_interval_of_a_free_spin_up_are_those_of_the_closed_form() -> None:
    """omega = M t/I, so d ln(omega)/d ln(I) = -1 and std(ln I) = sigma/omega."""
    run = bd.Experiment(bd.PiecewiseLinear([0.0], [[0.0, 3.0]]), 0.02)
    omega = 3.0 * 0.02 / 0.03
    final = run.number(lambda r: r.pulleys.omega[-1, 1], omega, t=[0.02], sigma=0.01, name="final")
    found = identify(free_pulley(0.02), ["pulleys[1].inertia"], [final], tol=1e-10)
    # Central differences of 1/I with steps of 1 %: wrong by 0.01^2/6.
    assert found.values["pulleys[1].inertia"] == pytest.approx(0.03, rel=1e-6)
    assert found.sensitivity().values.item() == pytest.approx(-1.0, abs=3e-5)
    assert found.sensitivity("sigma").values.item() == pytest.approx(-omega / 0.01, rel=3e-5)
    assert found.std["pulleys[1].inertia"] == pytest.approx(0.01 / omega, rel=3e-5)
    low, high = found.interval(0.95)["pulleys[1].inertia"]
    assert high / low == pytest.approx(math.exp(2 * 1.959964 * 0.01 / omega), rel=1e-5)
    assert low * high == pytest.approx(0.03**2, rel=1e-5)
    assert found.sensitivity().rows == ("final",)
    # One parameter, n measurements of omega = M t/I: the textbook's mean and its interval
    draws = np.random.default_rng(3).normal(2.0, 0.01, 6)
    run = bd.Experiment(bd.PiecewiseLinear([0.0], [[0.0, 3.0]]), 0.02)
    data = run.number(lambda r: np.full(6, r.pulleys.omega[-1, 1]), draws, t=[0.02], name="final")
    found = identify(free_pulley(0.03), ["pulleys[1].inertia"], [data], tol=1e-10)
    assert found.dof == pytest.approx(5.0)
    assert found.sigma["final"][0] == pytest.approx(draws.std(ddof=1), rel=1e-3)
    low, high = found.intervals["pulleys[1].inertia"]
    half = stats.t.ppf(0.975, 5) * draws.std(ddof=1) / math.sqrt(6.0) / draws.mean()
    assert math.log(high / low) == pytest.approx(2.0 * half, rel=1e-3)
    assert found.estimated == ("final",) and "(estimated)" in str(found)


@pytest.mark.ci(
    guard="identify/test_identify.py::test_pulleys_that_only_ever_turn_together_have_but_one_inertia"
)
def test_contact_that_hardly_bends_says_nothing_of_its_curvature(
    rig: bd.Params, targets: list[bd.Target]
) -> None:
    """At the penetration of some 1e-4 m 1e6 p^2 is nothing beside 5e6 p."""
    drive = changed(rig, {"contact.quadratic": 1e6})
    found = identify(drive, ["contact.linear", "contact.quadratic"], targets)
    assert found.undetermined == ("contact.quadratic",)
    assert [str(part) for part in found.indistinguishable] == ["contact.quadratic alone"]
    assert found.indistinguishable[0].std > math.log(2.0)


def test_pulleys_that_only_ever_turn_together_have_but_one_inertia(
    rig: bd.Params, experiment: bd.Experiment, truth: bd.Result, targets: list[bd.Target]
) -> None:
    """Equal pulleys far below slip: only the sum of their inertias matters to the speed."""
    two = [attrs.evolve(pulley, radius=0.09, inertia=0.02) for pulley in rig.pulleys]
    drive = attrs.evolve(rig, pulleys=two, belt=attrs.evolve(rig.belt, length=1.265))
    run = bd.Experiment(bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0], [-4.0, 0.0]]), T_END)
    measured = bd.simulate(drive, run.torque_fn, T_END, t_eval=TIMES)
    data = run.curve("pulleys.omega[0]", TIMES, measured.pulleys.omega[:, 0], sigma=0.05)
    found = identify(drive, ["pulleys[0].inertia", "pulleys[1].inertia"], [data])
    assert [set(pair.names) for pair in found.indistinguishable] == [set(found.names)]
    assert found.correlation[0, 1] < -0.95
    assert "up with" in str(found) and found.undetermined == found.names
    both = identify(drive, ["pulleys[*].inertia"], [data])
    assert both.indistinguishable == ()
    assert both.std["pulleys[*].inertia"] < 0.3 * min(found.std.values())
    # fewer numbers than parameters leave a direction open
    speed = experiment.number(
        lambda r: r.pulleys.omega[-1, 1], truth.pulleys.omega[-1, 1], t=[T_END], sigma=0.1
    )
    found = identify(rig, ["friction.mu_k", "pulleys[1].inertia"], [speed])
    assert [set(part.names) for part in found.indistinguishable] == [set(found.names)]
    assert np.isinf(found.covariance).all() and math.isinf(found.indistinguishable[0].std)
    assert found.intervals["friction.mu_k"] == (0.0, math.inf)
    assert math.isnan(found.misfit)
    exact = identify(rig, ["friction.mu_k"], [speed])  # dof = 0
    assert exact.indistinguishable == () and math.isfinite(exact.std["friction.mu_k"])
    # written with few parameters: of a, b, c, d the data know a + b alone
    jacobian = np.array([[1.0, 1.0, 0.0, 0.0], [2.0, 2.0, 0.0, 0.0]])
    open_ways = linear.combinations(["a", "b", "c", "d"], jacobian, math.log(2.0))
    assert sorted(map(str, open_ways)) == ["a up with b down", "c alone", "d alone"]
    assert all(math.isinf(part.std) for part in open_ways)
    known = linear.covariance(jacobian[:, 1:])
    assert known[0, 0] == pytest.approx(0.2)
    assert np.isinf(np.diag(known)[1:]).all()
    assert linear.leverage(jacobian) == pytest.approx([0.2, 0.8])
    # a parameter on its limit is told and its interval ends there
    found = identify(rig, [bd.Free("friction.mu_k", start=0.6, upper=0.7)], targets)
    assert found.at_limit == {"friction.mu_k": "upper"}
    assert found.values["friction.mu_k"] == pytest.approx(0.7, rel=1e-3)
    low, high = found.intervals["friction.mu_k"]
    assert low < found.values["friction.mu_k"] <= high == 0.7
    assert "at its upper limit" in str(found)
    # What cannot be negative stays so: no quadratic part is the truth.
    zero = identify(rig, [bd.Free("contact.quadratic", size=1e9)], targets)
    low, high = zero.intervals["contact.quadratic"]
    assert low == 0.0 < high


@pytest.mark.parametrize("loss", LOSSES)
def test_cost_and_weights_are_those_of_the_closed_forms(loss: str) -> None:
    """The loss of z = f^2 and its derivative, as SciPy's manual has them."""
    f = np.random.default_rng(1).standard_cauchy(500)
    f[:4] = 0.0, 1.0, -1.0, 1e-170
    z = f**2
    rho, slope = {
        "linear": (z, np.ones_like(z)),
        "soft_l1": (2.0 * (np.sqrt(1.0 + z) - 1.0), (1.0 + z) ** -0.5),
        "huber": (np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0), np.maximum(z, 1.0) ** -0.5),
        "cauchy": (np.log1p(z), 1.0 / (1.0 + z)),
    }[loss]
    cost, weights = cost_and_weights(f, loss)
    assert cost == pytest.approx(0.5 * np.sum(rho), rel=1e-13)
    np.testing.assert_allclose(weights, slope, rtol=1e-14)
    assert cost_and_weights(np.array([0.0, np.inf]), loss)[0] == np.inf


def test_trials_that_cannot_be_simulated_do_not_end_the_search() -> None:
    """omega = M t/I over I itself: the first step from 0.08 to 0.03 wants to go to -0.053.

    Such a drive is refused; the second time it is the reading that has no value below 0.028.
    """
    run = bd.Experiment(bd.PiecewiseLinear([0.0], [[0.0, 3.0]]), 0.02)

    def omega(result: bd.Result) -> float:
        return float(result.pulleys.omega[-1, 1])

    def omega_if_slow(result: bd.Result) -> float:
        return omega(result) if result.params.pulleys[1].inertia > 0.028 else math.nan

    def put(params: bd.Params, value: float) -> bd.Params:
        return changed(params, {"pulleys[1].inertia": value})

    own = bd.Free("inertia", start=0.08, size=0.16, set=put)
    for read in (omega, omega_if_slow):
        data = run.number(read, 2.0, t=[0.02], sigma=0.01)
        found = identify(free_pulley(0.08), [own], [data])
        assert found.success and found.failed > 0
        assert found.params.pulleys[1].inertia == pytest.approx(0.03, rel=1e-4)
    # Just above a value that is refused only steps up are possible
    run = bd.Experiment(bd.PiecewiseLinear([0.0], [[0.0, 3.0]]), 0.02)
    data = run.number(lambda r: r.pulleys.omega[-1, 1], 2.0, t=[0.02], sigma=0.01)
    refused = []

    def heavy(params: bd.Params, value: float) -> bd.Params:
        if value < 0.02995:
            refused.append(value)
            raise ValueError("too light")
        return changed(params, {"pulleys[1].inertia": value})

    free = bd.Free("inertia", start=0.03, scale="log", set=heavy)
    found = identify(free_pulley(0.03), [free], [data])
    assert refused and found.success
    # One-sided: (exp(-h) - 1)/h is -1 but for h/2.
    assert found.sensitivity().values.item() == pytest.approx(-1.0, abs=0.006)

    # Where neither side can be simulated the reason comes out
    def only(params: bd.Params, value: float) -> bd.Params:
        if value != 0.03:
            raise ValueError("nothing but 0.03")
        return params

    with pytest.raises(ValueError, match=r"nothing but 0\.03"):
        identify(free_pulley(0.03), [bd.Free("inertia", start=0.03, set=only)], [data])


def test_a_start_that_cannot_be_simulated_says_why(rig: bd.Params) -> None:
    short = bd.Experiment(TORQUE, T_END, options={"max_steps": 10})
    data = short.curve("slip[1]", [T_END], [0.0], sigma=0.1)
    with pytest.raises(bd.SimulationError, match="steps"):
        identify(rig, ["friction.mu_k"], [data])
    early = bd.Experiment(TORQUE, T_END).curve("slip[1]", [0.0, T_END], [0.0, 0.0], sigma=0.1)
    with pytest.raises(ValueError, match=r"slip\[1\] at 0 s: the run has no value there"):
        identify(rig, ["friction.mu_k"], [early])

    # what a torque function raises comes out unchanged
    class OutOfPaper(Exception):
        """What only the user's code raises."""

    mine = OutOfPaper("the plotter jams")
    calls: list[float] = []

    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        calls.append(t)
        if len(calls) > 3000:
            raise mine
        return [-30.0, 0.0]

    def value_error(_t: float, _theta: Any, _omega: Any) -> list[float]:
        raise ValueError("not a matter of parameters")

    for workers in (1, 2):
        calls.clear()
        data = bd.Experiment(torque, T_END).curve("pulleys.omega[0]", [T_END], [-40.0], sigma=1.0)
        with pytest.raises(OutOfPaper) as caught:
            identify(rig, ["friction.mu_k"], [data], workers=workers)
        assert caught.value is mine
        run = bd.Experiment(value_error, T_END)
        data = run.curve("pulleys.omega[0]", [T_END], [-40.0], sigma=1.0)
        with pytest.raises(ValueError, match="not a matter of parameters"):
            identify(rig, ["friction.mu_k"], [data], workers=workers)


@pytest.mark.usefixtures("handlers")
def test_ctrl_c_ends_it_soon_and_loses_nothing(rig: bd.Params, rest: bd.State) -> None:
    """The runs that are interrupted would take a minute or more; their threads end with it.

    Before anything is known it is an ordinary one.
    """
    before = set(threading.enumerate())
    trials, main = [], threading.main_thread().ident
    assert main is not None

    def begin(params: bd.Params) -> bd.State:
        trials.append(params.friction.mu_k)  # type: ignore[union-attr]
        return rest

    def long_after_the_fifth(t: float, _theta: Any, _omega: Any) -> list[float]:
        if len(trials) >= 6:
            if t > 0.0 and not sent:
                sent.append(t)
                signal.pthread_kill(main, signal.SIGINT)
            time.sleep(0.01)
        return [-30.0, 0.0]

    sent: list[float] = []
    run = bd.Experiment(long_after_the_fifth, T_END, initial=begin)
    data = run.curve("pulleys.omega", TIMES, np.full((20, 2), -20.0), sigma=1.0)
    with pytest.raises(bd.Interrupted) as caught:
        identify(rig, ["friction.mu_k"], [data], workers=2)
    assert isinstance(caught.value, bd.IdentificationInterrupted)
    found = caught.value.identification
    assert not found.success and "interrupted" in str(found)
    assert found.values["friction.mu_k"] in trials
    assert math.isfinite(found.std["friction.mu_k"])
    assert not set(threading.enumerate()) - before

    def stop(_params: bd.Params) -> bd.State:
        raise KeyboardInterrupt

    run = bd.Experiment(TORQUE, T_END, initial=stop)
    data = run.curve("pulleys.omega[0]", [T_END], [-40.0], sigma=1.0)
    with pytest.raises(KeyboardInterrupt) as early:
        identify(rig, ["friction.mu_k"], [data])
    assert not isinstance(early.value, bd.IdentificationInterrupted)


def test_without_scipy_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """That nothing imports it before is in test_cli.py."""
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(ImportError, match=r"^beltdyn\.identify needs the package scipy"):
        bd.identify(bd.scenes.three_pulleys().params, [], [])


def test_a_unit_or_sense_of_another_kind_is_asked_about(rig: bd.Params) -> None:
    """A motor at a set speed, so that no parameter can make up for it; speeds with noise."""
    run = bd.Experiment(bd.Viscous([0.0, 1.0]), T_END, motion={0: bd.PiecewiseLinear([0], [20.0])})
    seen = bd.simulate(rig, run.torque_fn, T_END, motion=run.motion, t_eval=TIMES).pulleys.omega
    noisy = seen[:, 1] + np.random.default_rng(1).normal(0.0, 0.01 * np.abs(seen).max(), TIMES.size)
    for factor, asked in (
        (30.0 / math.pi, "in 1/min?"),
        (-1.0, "counted clockwise?"),
        (-180.0 / math.pi, "in degrees and counted clockwise?"),
        (1.0, None),
    ):
        data = [run.curve("pulleys.omega[1]", TIMES, factor * noisy)]
        text = str(identify(rig, ["friction.mu_k"], data, max_nfev=2))
        assert (f"computed: are they {asked}" in text) if asked else "computed: are" not in text


def test_columns_are_called_by_number_or_name(truth: bd.Result, experiment: bd.Experiment) -> None:
    for number, name in (
        ("pulleys.omega[1]", "pulleys.omega[pulley 1]"),
        ("slip[1]", "slip[pulley 1]"),
        ("span_tension[0]", "span_tension[pulley 0 to pulley 1]"),
    ):
        read, other = (experiment.curve(one, [0.01], [1.0]).read for one in (number, name))
        np.testing.assert_array_equal(read(truth), other(truth))
    with pytest.raises(ValueError, match=r"has no 'omega' \(did you mean 'pulleys.omega'\?\)"):
        experiment.curve("omega[1]", [0.01], [1.0])


MU: Any = {"free": ["friction.mu_k"]}
INERTIA = bd.Free("pulleys[*].inertia", start=0.01)


def test_bad_arguments(rig: bd.Params, targets: list[bd.Target], experiment: bd.Experiment) -> None:
    """Of the search: free parameters, priors, options; and what the run gives must fit the data."""

    def curve(*given: Any) -> dict[str, Any]:
        return {"targets": [experiment.curve(*given, sigma=1.0)]}

    unknown = experiment.curve("pulleys.omega[0]", [0.01], [1.0])
    flat = experiment.curve("pulleys.omega[0]", [0.01, 0.02], [0.0, 0.0])
    twice = [experiment.curve("slip[1]", [0.01], [0.0], sigma=1.0) for _ in range(2)]
    rows: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"free": ["belt.axial_stifness"]}, ValueError, "did you mean 'belt.axial_stiffness'"),
        ({"free": ["mu_k"]}, ValueError, "did you mean 'friction.mu_k'"),
        ({"free": ["friction.mu_kk"]}, ValueError, "did you mean 'friction.mu_k'"),
        ({"free": ["pulleys[2].inertia"]}, ValueError, r"pulleys has 2 entries"),
        ({"free": ["belt.n_bodies"]}, ValueError, "cannot be free: it is not a real number"),
        ({"free": ["tensioning.offset[1][0]"]}, ValueError, "tensioning.offset has 0 entries"),
        ({"free": ["pulleys[*].inertia"]}, ValueError, "differ .*start="),
        ({"free": ["gravity[1]"]}, ValueError, "size="),
        ({"free": ["axial stiffness"]}, ValueError, "is named like"),
        ({"free": []}, ValueError, "at least one"),
        ({"free": ["friction.mu_k", "friction.mu_k"]}, ValueError, "twice"),
        ({"free": [bd.Free("friction.mu_k", lower=0.9)]}, ValueError, "must lie within its limits"),
        ({"free": [bd.Free("friction.mu_k", lower=1.0, upper=0.9)]}, ValueError, "be < upper"),
        ({"free": [bd.Free("gravity[1]", scale="log")]}, ValueError, "needs a start > 0"),
        ({"free": ["pulleys[1].inertia", INERTIA]}, ValueError, "which overlap"),
        ({"free": "friction.mu_k"}, TypeError, "free must be a sequence"),
        ({"params": attrs.evolve(rig, friction=None)}, ValueError, "this drive has no friction"),
        ({"params": None}, TypeError, "params must be a Params"),
        (curve("pulleys.omega", [0.01], [1.0]), ValueError, r"gives shape \(1, 2\)"),
        (curve("pulleys.omega[2]", [0.01], [1.0]), ValueError, "has 2 columns"),
        (curve("pulleys.omega[fan]", [0.01], [1.0]), ValueError, "no 'fan'; there are pulley 0"),
        (curve("energy.total[0]", [0.01], [1.0]), ValueError, "has no columns"),
        (curve(lambda _: ["fast"], [0.01], [1.0]), TypeError, "must give real numbers"),
        ({"targets": []}, ValueError, "at least one target"),
        ({"targets": [1.0]}, TypeError, r"targets\[0\] must be"),
        ({"targets": [unknown]}, ValueError, "too few to estimate it beside 1 free"),
        ({"targets": [flat]}, ValueError, "all its values are 0"),
        ({"targets": [flat], "loss": "huber"}, ValueError, "loss 'huber' needs the sigma"),
        ({"targets": twice}, ValueError, "two targets are called"),
        ({"limit": 1.0}, ValueError, "limit must be > 1"),
        ({"diff_step": 10.0}, ValueError, "diff_step must be > 0 and < 1"),
        ({"workers": 0}, ValueError, "workers must be an integer >= 1"),
        ({"progress": 1}, TypeError, "progress must be a bool"),
        ({"confidence": 95.0}, ValueError, "confidence must be > 0 and < 1"),
        ({"free": ["belt[0]"]}, ValueError, r"no parameter is called 'belt\[0\]'"),
        ({"jac": "5-point"}, ValueError, "jac must be one of"),
        ({"loss": "l1"}, ValueError, "loss must be one of"),
        ({"diff_step": 0.0}, ValueError, "diff_step must be > 0"),
        ({"max_nfev": 0}, ValueError, "max_nfev must be an integer >= 1"),
        ({"starts": 0}, ValueError, "starts must be an integer >= 1"),
        ({"mesh": 2}, TypeError, "mesh must be a bool"),
        ({"prior": {"friction.sigma": (1e4, 1e3)}}, ValueError, "is not free"),
        ({"prior": {"friction.mu_k": (0.8, 0.0)}}, ValueError, "deviation must be > 0"),
        ({"prior": {"friction.mu_k": (-0.8, 0.1)}}, ValueError, "the value must be > 0"),
    ]
    for change, kind, message in rows:
        with pytest.raises(kind, match=message):
            identify(**{"params": rig, "targets": targets, **MU, **change})

    # Of free parameters, experiments, curves and numbers
    def curve(**change: Any) -> Callable[[], object]:
        good = {"quantity": "pulleys.omega[0]", "t": [0.01, 0.02], "values": [1.0, 2.0]}
        return lambda: experiment.curve(**{**good, "sigma": 1.0, **change})

    number: Any = experiment.number
    rows: list[tuple[Callable[[], object], type[Exception], str]] = [
        (lambda: bd.Free("x", set=changed), ValueError, "needs start="),
        (lambda: bd.Free("x", set=3), TypeError, "set must be callable"),
        (curve(t=[0.01]), ValueError, "one row for each of the 1 times"),
        (curve(sigma=0.0), ValueError, "sigma must be > 0"),
        (lambda: bd.Free("belt.length", scale="cubic"), ValueError, "scale must be"),
        (lambda: bd.Free("belt.length", size=0.0), ValueError, "size must be > 0"),
        (lambda: bd.Free("belt.length", lower="0"), TypeError, "belt.length: lower"),
        (lambda: bd.Experiment(TORQUE, 0.0), ValueError, "t_end must be > 0"),
        (lambda: bd.Experiment(TORQUE, 1.0, options={"rtoll": 1}), ValueError, "mean 'rtol'"),
        (lambda: bd.Experiment(TORQUE, 1.0, options={"motion": {}}), ValueError, "has no 'motion'"),
        (lambda: bd.Experiment(TORQUE, 1.0, settling={"frictn": 1}), ValueError, "mean 'friction'"),
        (lambda: bd.Experiment(TORQUE, 1.0, changes={"a b": 1}), ValueError, "is named like"),
        (lambda: bd.Experiment(TORQUE, 1.0, changes={"belt.lenght": 1}), ValueError, "belt.length"),
        (lambda: bd.Experiment(TORQUE, 1.0, options=[1]), TypeError, "must be mappings"),
        (lambda: bd.Experiment(TORQUE, 1.0, initial=3), TypeError, "initial must be"),
        (curve(quantity="pulleys.omga[0]"), ValueError, "mean 'pulleys.omega'"),
        (curve(quantity=3), TypeError, "quantity must be"),
        (curve(t=[0.0, 0.09]), ValueError, r"t must lie within the run, \[0, 0.08\] s"),
        (curve(t=[0.02, 0.01]), ValueError, "t must be non-decreasing"),
        (curve(values=[1.0, np.nan]), ValueError, "values must be finite"),
        (curve(sigma=[1.0, 1.0, 1.0]), ValueError, "sigma must be one number or fit"),
        (lambda: number("slip[1]", 1.0), TypeError, "read must be callable"),
        (lambda: number(len, [1.0, 2.0], names=["one"]), ValueError, "each of the 2 values"),
        (lambda: number(len, [], sigma=1.0), ValueError, "must hold at least one number"),
    ]
    for make, kind, message in rows:
        with pytest.raises(kind, match=message):
            make()


def test_a_rig_whose_speed_is_prescribed(rig: bd.Params) -> None:
    """The commonest: a motor holds a measured speed, and the other pulley is braked. The belt
    begins at the speed that the motion begins with, and the run is that of simulate.
    """
    motion = {0: bd.PiecewiseLinear([0.0, T_END], [-20.0, -30.0])}
    brake = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [0.0, 30.0]])
    measured = bd.simulate(rig, brake, T_END, motion, t_eval=TIMES)
    run = bd.Experiment(brake, T_END, motion=motion)
    data = [
        run.curve("span_tension", TIMES, measured.span_tension, sigma=TENSION),
        run.curve("pulleys.omega", TIMES, measured.pulleys.omega, sigma=SPEED),
    ]
    start = changed(rig, {"belt.axial_stiffness": 88e3})
    found = identify(start, ["belt.axial_stiffness"], data, workers=1)
    check_found(found)
    omega = found.results["run"].pulleys.omega
    np.testing.assert_allclose(omega[:, 0], -20.0 - 10.0 * TIMES / T_END)
    other = bd.Experiment(brake, T_END, motion={7: motion[0]})
    data = [other.curve("pulleys.omega[0]", [T_END], [-30.0], sigma=1.0)]
    with pytest.raises(ValueError, match="motion"):
        identify(rig, ["belt.axial_stiffness"], data)


def rippled(at: float) -> bd.Target:
    """A curve over the inertia I whose sum of squares has a minimum at 0.03 and many others: of
    ln(I) and a ripple, as links that come and go make one.
    """
    initial, angles = bd.settle(free_pulley(0.03)), np.linspace(0.0, 6.0, 40)

    def read(result: bd.Result) -> Any:
        u = math.log(result.params.pulleys[1].inertia)
        return angles * u + 0.4 * np.sin(25.0 * u + angles)

    run = bd.Experiment(bd.Viscous([0.0, 0.0]), 4e-5, initial=initial)
    u = math.log(at)
    noise = 0.5 * np.random.default_rng(5).standard_normal(40)
    measured = angles * u + 0.4 * np.sin(25.0 * u + angles) + noise
    return run.curve(read, np.linspace(1e-6, 4e-5, 40), measured, name="rippled")


def test_a_minimum_beside_the_best_is_left() -> None:
    """From one start the search converges into it, with an interval that does not hold the truth
    and the residuals that it takes for noise; from several it does not stay there.
    """
    data, name = [rippled(0.03)], "pulleys[1].inertia"
    one, several = (identify(free_pulley(0.06), [name], data, starts=n) for n in (1, 3))
    low, high = one.intervals[name]
    assert one.success and not low <= 0.03 <= high
    low, high = several.intervals[name]
    assert several.success and low <= 0.03 <= high < 1.3 * low
    # a fit that no other search ended at is told
    twice = attrs.evolve(several, ends=several.ends[[0, 0]])
    assert twice.confirmed and one.confirmed and "no other search" not in repr(twice)
    alone = attrs.evolve(several, ends=several.ends[:1] + np.array([[0.0], [0.5], [-0.5]]))
    assert not alone.confirmed and "2 other searches ended elsewhere" in str(alone)
    assert several.excess.min() > -0.1 and len(several.tried) == len(several.excess)


def test_intervals_hold_points_that_fit_as_well() -> None:
    """In a valley of equal minima, each of which alone would have a narrow interval."""
    initial, angles = bd.settle(free_pulley(0.03)), np.linspace(0.0, 6.0, 40)

    def read(result: bd.Result) -> Any:
        return np.sin(40.0 * math.log(result.params.pulleys[1].inertia / 0.03) + angles)

    run = bd.Experiment(bd.Viscous([0.0, 0.0]), 4e-5, initial=initial)
    measured = np.sin(angles) + 0.1 * np.random.default_rng(5).standard_normal(40)
    data = run.curve(read, np.linspace(1e-6, 4e-5, 40), measured, name="periodic")
    name = "pulleys[1].inertia"
    one, several = (identify(free_pulley(0.03), [name], [data], starts=n) for n in (1, 3))
    low, high = one.intervals[name]
    assert high / low < 1.01
    low, high = several.intervals[name]
    assert high / low > math.exp(2.0 * math.pi / 40.0) * 0.99


def test_intervals_hold_what_the_mesh_makes_wrong(rig: bd.Params) -> None:
    """Measured on eight times the links: the interval for the mesh of the fit alone misses the
    truth. Where another mesh cannot be run it is said.
    """
    name, at = "belt.axial_stiffness", np.linspace(0.02, T_END, 200)
    coarse = attrs.evolve(rig, belt=attrs.evolve(rig.belt, mesh="joint"))
    real = attrs.evolve(coarse, belt=attrs.evolve(coarse.belt, n_bodies=8 * rig.belt.n_bodies))

    def tensions(result: bd.Result) -> Any:
        return result.span_tension.mean(axis=0)

    measured = tensions(bd.simulate(real, TORQUE, T_END, t_eval=at))
    at_rest = bd.settle(coarse)
    for run in (bd.Experiment(TORQUE, T_END), bd.Experiment(TORQUE, T_END, initial=at_rest)):
        data = [run.number(tensions, measured, t=at, sigma=0.5)]
        found = identify(coarse, [name], data, jac="2-point", mesh=True)
        low, high = found.intervals[name]
        assert (low <= 80e3 <= high) == (found.mesh is not None) == (run.initial is None)
        if found.mesh is not None:
            assert 0.003 < abs(found.mesh[name]) < 0.03  # the fit is off by 1.1 %
        assert ("without the error of the mesh: initial" in str(found)) == (found.mesh is None)


def test_residuals_that_are_no_noise_are_named(rig: bd.Params, truth: bd.Result) -> None:
    """With the noise unknown a wrong model has residuals of one sigma, but not independent ones."""
    name, at = "belt.axial_stiffness", np.linspace(0.01, T_END, 60)
    wrong = changed(rig, {"pulleys[1].inertia": 0.024})
    run, noise = bd.Experiment(TORQUE, T_END), np.random.default_rng(2)
    measured = bd.simulate(rig, TORQUE, T_END, t_eval=at)
    speeds = measured.pulleys.omega + noise.normal(0.0, SPEED, (60, 2))
    data = [run.curve("pulleys.omega", at, speeds)]
    good, bad = (identify(drive, [name], data, jac="2-point") for drive in (rig, wrong))
    assert good.structured == {} and "structure" not in str(good)
    assert set(bad.structured) == {"pulleys.omega"} and bad.misfit == pytest.approx(1.0, abs=0.01)
    assert "converged, residuals with structure" in repr(bad)
    assert "not to be trusted" in str(bad)
