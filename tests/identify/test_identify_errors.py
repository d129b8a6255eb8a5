"""Finding parameters: what goes wrong in a search, and every argument that is wrong."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np
import pytest
from identify_common import COARSE, T_END, TIMES, TORQUE, changed, free_pulley

import beltdyn as bd

pytestmark = COARSE


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
        found = bd.identify(free_pulley(0.08), [own], [data])
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
    found = bd.identify(free_pulley(0.03), [free], [data])
    assert refused and found.success
    # One-sided: (exp(-h) - 1)/h is -1 but for h/2.
    assert found.sensitivity().values.item() == pytest.approx(-1.0, abs=0.006)


def test_a_start_that_cannot_be_simulated_says_why(rig: bd.Params) -> None:
    short = bd.Experiment(TORQUE, T_END, options={"max_steps": 10})
    data = short.curve("slip[1]", [T_END], [0.0], sigma=0.1)
    with pytest.raises(bd.SimulationError, match="steps"):
        bd.identify(rig, ["friction.mu_k"], [data])
    early = bd.Experiment(TORQUE, T_END).curve("slip[1]", [0.0, T_END], [0.0, 0.0], sigma=0.1)
    with pytest.raises(ValueError, match=r"slip\[1\] at 0 s: the run has no value there"):
        bd.identify(rig, ["friction.mu_k"], [early])

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
            bd.identify(rig, ["friction.mu_k"], [data], workers=workers)
        assert caught.value is mine
        run = bd.Experiment(value_error, T_END)
        data = run.curve("pulleys.omega[0]", [T_END], [-40.0], sigma=1.0)
        with pytest.raises(ValueError, match="not a matter of parameters"):
            bd.identify(rig, ["friction.mu_k"], [data], workers=workers)


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
        bd.identify(rig, ["friction.mu_k"], [data], workers=2)
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
        bd.identify(rig, ["friction.mu_k"], [data])
    assert not isinstance(early.value, bd.IdentificationInterrupted)


@pytest.mark.ci(guard="test_sensitivity.py::test_samples_that_are_refused")
def test_without_scipy_it_says_what_to_install_and_nothing_imports_it_before() -> None:
    script = """import sys, beltdyn as bd
assert not any(name.startswith("scipy") for name in sys.modules)
sys.modules["scipy"] = sys.modules["scipy.optimize"] = None
bd.identify(bd.scenes.three_pulleys().params, [], [])"""
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert "ImportError: beltdyn.identify needs SciPy: python -m pip install scipy" in ran.stderr


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
        (curve(lambda _: ["fast"], [0.01], [1.0]), TypeError, "must give real numbers"),
        ({"targets": []}, ValueError, "at least one target"),
        ({"targets": [1.0]}, TypeError, r"targets\[0\] must be"),
        ({"targets": [unknown]}, ValueError, "too few to estimate it beside 1 free"),
        ({"targets": [flat]}, ValueError, "all its values are 0"),
        ({"targets": [flat], "loss": "huber"}, ValueError, "loss 'huber' needs the sigma"),
        ({"targets": twice}, ValueError, "two targets are called"),
        ({"limit": 1.0}, ValueError, "limit must be > 1"),
        ({"jac": "5-point"}, ValueError, "jac must be one of"),
        ({"loss": "l1"}, ValueError, "loss must be one of"),
        ({"diff_step": 0.0}, ValueError, "diff_step must be > 0"),
        ({"max_nfev": 0}, ValueError, "max_nfev must be an integer >= 1"),
        ({"prior": {"friction.sigma": (1e4, 1e3)}}, ValueError, "is not free"),
        ({"prior": {"friction.mu_k": (0.8, 0.0)}}, ValueError, "deviation must be > 0"),
        ({"prior": {"friction.mu_k": (-0.8, 0.1)}}, ValueError, "the value must be > 0"),
    ]
    for change, kind, message in rows:
        with pytest.raises(kind, match=message):
            bd.identify(**{"params": rig, "targets": targets, **MU, **change})

    # Of free parameters, experiments, curves and numbers
    def curve(**change: Any) -> Callable[[], object]:
        good = {"quantity": "pulleys.omega[0]", "t": [0.01, 0.02], "values": [1.0, 2.0]}
        return lambda: experiment.curve(**{**good, "sigma": 1.0, **change})

    number: Any = experiment.number
    rows: list[tuple[Callable[[], object], type[Exception], str]] = [
        (lambda: bd.Free("x", set=changed), ValueError, "needs start="),
        (lambda: bd.Free("belt.length", scale="cubic"), ValueError, "scale must be"),
        (lambda: bd.Free("belt.length", size=0.0), ValueError, "size must be > 0"),
        (lambda: bd.Free("belt.length", lower="0"), TypeError, "belt.length: lower"),
        (lambda: bd.Experiment(TORQUE, 0.0), ValueError, "t_end must be > 0"),
        (lambda: bd.Experiment(TORQUE, 1.0, options={"rtoll": 1}), ValueError, "mean 'rtol'"),
        (lambda: bd.Experiment(TORQUE, 1.0, settling={"frictn": 1}), ValueError, "mean 'friction'"),
        (lambda: bd.Experiment(TORQUE, 1.0, changes={"a b": 1}), ValueError, "is named like"),
        (lambda: bd.Experiment(TORQUE, 1.0, options=[1]), TypeError, "must be mappings"),
        (lambda: bd.Experiment(TORQUE, 1.0, initial=3), TypeError, "initial must be"),
        (curve(quantity="pulleys.omga[0]"), ValueError, "mean 'pulleys.omega'"),
        (curve(quantity=3), TypeError, "quantity must be"),
        (curve(t=[0.0, 0.09]), ValueError, r"t must lie within the run, \[0, 0.08\] s"),
        (curve(t=[0.02, 0.01]), ValueError, "t must be non-decreasing"),
        (curve(values=[1.0, np.nan]), ValueError, "values must be finite"),
        (curve(sigma=0.0), ValueError, "sigma must be > 0"),
        (curve(sigma=[1.0, 1.0, 1.0]), ValueError, "sigma must be one number or fit"),
        (lambda: number("slip[1]", 1.0), TypeError, "read must be callable"),
        (lambda: number(len, [1.0, 2.0], names=["one"]), ValueError, "each of the 2 values"),
        (lambda: number(len, [], sigma=1.0), ValueError, "must hold at least one number"),
    ]
    for make, kind, message in rows:
        with pytest.raises(kind, match=message):
            make()
