"""Running and what it gives: results, restarts, failures, and every argument that is wrong."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest

import beltdyn as bd
from beltdyn import _core

T_END = 0.02
N_T = 41
V, T = ValueError, TypeError


@pytest.fixture(scope="module")
def scene() -> bd.Scene:
    return drives.plain_scene()._replace(t_end=T_END)


@pytest.fixture(scope="module")
def start(scene: bd.Scene) -> bd.State:
    return bd.settle(scene.params)


@pytest.fixture(scope="module")
def result(scene: bd.Scene, start: bd.State) -> bd.Result:
    return bd.simulate(*scene, t_eval=np.linspace(0.0, T_END, N_T), initial=start, method="tsit5")


def test_settled_state_is_at_rest_under_preload(
    scene: bd.Scene, start: bd.State, result: bd.Result
) -> None:
    """And a run begins with it where no state is given."""
    assert start.t == 0.0
    assert start.residual is not None and start.residual < 1e-6
    for name in ("vx", "vy", "vphi", "omega", "mu", "slip", "theta"):
        assert not getattr(start, name).any(), name
    assert start.x.shape == (60,) and start.theta.shape == (2,)
    assert start.phi[0] - start.phi[-1] == pytest.approx(2 * np.pi, abs=0.5)
    other = bd.simulate(*scene, t_eval=result.t, method="tsit5")
    np.testing.assert_array_equal(other.belt.x, result.belt.x)
    assert other.stats.settle_time > 0.0
    assert result.stats.settle_time == 0.0


def test_settling_goes_its_ways(scene: bd.Scene, start: bd.State) -> None:
    """By moving a pulley, which locks friction; from a state, whose time it keeps; or never."""
    moved = bd.settle(scene.params, friction=True, offset={1: (-0.002, 0.0)}, tolerance=1e-3)
    assert np.abs(moved.mu).max() > 0.0
    table = bd.settle(scene.params, friction=True, offset=[[0, 0], [-0.002, 0]], tolerance=1e-3)
    np.testing.assert_array_equal(table.x, moved.x)
    again = bd.settle(scene.params, initial=attrs.evolve(start, t=3.0), pulleys="free")
    assert again.t == 3.0
    np.testing.assert_allclose(again.x, start.x, atol=1e-6)
    with pytest.raises(bd.SimulationError, match="did not come to rest") as caught:
        bd.settle(scene.params, max_time=1e-4)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.result is None


def test_bad_settling_options(scene: bd.Scene) -> None:
    options: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"pulleys": "loose"}, V, "^pulleys must be one of held, free, got 'loose'"),
        ({"offset": {2: (0, 0)}}, V, "^offset index must be that of one of the 2 pulley"),
        ({"offset": {"a": (0, 0)}}, V, "^offset: no pulley is called 'a'"),
        ({"offset": {1.0: (0, 0)}}, T, "^offset index must be an integer"),
        ({"offset": [[0, 0]] * 3}, V, "^offset index must be that of one of the 2 pulley"),
        ({"tolerance": 0}, V, "^tolerance must be > 0"),
        ({"tolerance": "1"}, T, "^tolerance must be a real number"),
        ({"max_time": -1}, V, "^max_time must be > 0"),
        ({"move_time": np.inf}, V, "^move_time must be finite"),
        ({"initial": 3}, T, "^initial must be a State or None, got int"),
    ]
    for option, error, message in options:
        with pytest.raises(error, match=message):
            bd.settle(scene.params, **option)


def test_a_run_that_finished_says_what_it_did(result: bd.Result, scene: bd.Scene) -> None:
    """Its end is that of the samples; torques, energy and counters are those of the run."""
    assert result.success and result.status == "finished"
    assert result.message == "reached t_end = 0.02 s"
    assert result.params is scene.params and result.effects
    assert result.final_state.t == T_END
    np.testing.assert_array_equal(result.final_state.x, result.belt.x[-1])
    np.testing.assert_array_equal(result.final_state.omega, result.pulleys.omega[-1])
    for t, omega, torque in zip(result.t, result.pulleys.omega, result.pulleys.torque, strict=True):
        np.testing.assert_allclose(torque, scene.torque_fn(t, [0, 0], omega), rtol=1e-12)
    stats = result.stats
    assert stats.method == "tsit5" and stats.kernels == _core.kernel_level()
    assert stats.nfev > stats.steps > 0 and stats.cpu_time > 0.0
    assert stats.njev == stats.nlu == 0 and stats.local_error is not None
    assert 0.0 < stats.local_error <= 1e-4  # the default tolerance
    energy = result.energy
    balance = energy.total - energy.total[0] - (energy.drive - energy.losses)
    np.testing.assert_allclose(energy.residual, balance, atol=1e-9 * energy.total[0])
    assert (np.diff(energy.passed) >= 0.0).all()
    assert energy.passed[-1] >= energy.drive[-1] > 0.0
    assert abs(energy.residual[-1]) < 1e-3 * energy.passed[-1]


def test_any_samples_within_the_run(scene: bd.Scene, start: bd.State) -> None:
    for t_eval in ([], [0.0], [0.005], [0.0, 0.0, 0.002, 0.002, 0.005]):
        run = bd.simulate(scene.params, scene.torque_fn, 0.005, initial=start, t_eval=t_eval)
        assert run.t.tolist() == t_eval
        assert run.belt.x.shape == (len(t_eval), 60)
        assert run.final_state.t == 0.005
        assert repr(run).startswith("Result(finished: ")
        assert ("status", "finished") in run.summary()
    run = bd.simulate(scene.params, scene.torque_fn, 0.001, initial=start)
    np.testing.assert_array_equal(run.t, np.linspace(0.0, 0.001, 1001))


def test_the_summary_says_the_whole_error(result: bd.Result) -> None:
    """In time, of the mesh and of contact; what is not known is said not to be. What the integrator
    did is told on request.
    """
    known = result.accuracy["span_mean"]
    assert known.time == result.stats.error and known.total is not None
    errors = {"time": 3e-4, "space": 2e-2, "compliance": 1e-3}
    other = attrs.evolve(known, **errors)
    assert other.total == pytest.approx(sum(errors.values()))
    changed = (other if one is known else one for one in result.accuracy.errors)
    shown = attrs.evolve(result, accuracy=attrs.evolve(result.accuracy, errors=tuple(changed)))
    rows = dict(shown.summary())
    assert rows["  mean tension of the spans"] == (
        "2.1 %: at most 0.03 % in time, 2 % of the mesh, 0.1 % of contact"
    )
    assert rows["  creep"].startswith("not known in time and of the mesh")
    assert "verify=True" in rows["  measured"]
    for label, value in rows.items():
        assert label in str(shown) and value in str(shown)
    long = dict(shown.summary(verbose=True))
    assert rows.items() <= long.items()
    assert set(long) - set(rows) >= {"method", "steps", "local error", "instruction level"}
    assert long["rates evaluated"] == f"{result.stats.nfev}"


@pytest.mark.filterwarnings("ignore:no_friction:UserWarning")
def test_without_the_ledger_and_without_friction(scene: bd.Scene, start: bd.State) -> None:
    label, options = "  energy unaccounted for", {"initial": start, "t_eval": [0.0, T_END]}
    run = bd.simulate(*scene, ledger=False, **options)
    assert run.energy is None
    assert label not in dict(run.summary())
    assert label in dict(bd.simulate(*scene, **options).summary())
    params = attrs.evolve(scene.params, friction=None)
    run = bd.simulate(params, scene.torque_fn, 0.005, t_eval=[0.0, 0.005])
    assert not run.contact.friction.any() and not run.contact.mu.any()
    assert run.final_state.mu.shape == (60,) and not run.final_state.mu.any()
    more = bd.simulate(params, scene.torque_fn, 0.006, initial=run.final_state, t_eval=[0.006])
    assert more.success
    assert "no_friction" in [one.code for one in run.warnings]


@pytest.mark.filterwarnings("ignore:strain:UserWarning")  # the published benchmark's 5 %
@pytest.mark.parametrize("name", bd.scenes.names())
def test_every_scene_runs(name: str) -> None:
    scene = bd.scenes.get(name)
    run = bd.simulate(scene.params, scene.torque_fn, 0.001, t_eval=[0.0, 0.001])
    assert run.success
    assert bd.scenes.get(name.replace("-", "_")) == scene
    assert f"{scene.t_end:g} s" in str(scene) and bd.scenes.describe(name)


def test_span_tension_of_a_run(result: bd.Result) -> None:
    tension = result.span_tension
    assert tension.shape == (N_T, 2)
    np.testing.assert_allclose(tension[0], tension[0, ::-1], rtol=1e-6)
    # Clockwise drive: the lower span, which follows pulley 1, is the tight one.
    assert tension[-1, 1] > tension[-1, 0] + 30.0
    upper = result.belt.y[-1] > 0.05
    free = (result.contact.pulley[-1] < 0) & (np.roll(result.contact.pulley[-1], 1) < 0)
    assert tension[-1, 0] == pytest.approx(result.joints.force[-1][upper & free].mean())


def test_slip_by_hand(result: bd.Result) -> None:
    big, small = result.params.pulleys
    params = attrs.evolve(
        result.params,
        pulleys=[attrs.evolve(big, radius=0.1), attrs.evolve(small, radius=0.05)],
        belt=attrs.evolve(result.params.belt, length=1.055),
    )
    pulleys = attrs.evolve(result.pulleys, omega=np.array([[0.0, 1.0], [10, 19], [-10, -20]]))
    slip = attrs.evolve(result, params=params, pulleys=pulleys).slip
    np.testing.assert_allclose(slip, [[np.nan, np.nan], [0.0, 0.05], [0.0, 0.0]], atol=1e-15)


GOOD: dict[str, Any] = {"x": [0, 1, 2], "y": [0, 0, 0], "phi": [0, 0, 0], "theta": [1.0]}


def test_what_a_state_is_not_given_is_zero() -> None:
    state = bd.State(**GOOD)
    assert state.vx.tolist() == [0.0] * 3 and state.omega.tolist() == [0.0]
    assert state.t == 0.0 and state.residual is None
    assert state == bd.State(**GOOD)
    assert state != attrs.evolve(state, t=1.0) and state != attrs.evolve(state, x=[0, 1, 3])


def test_bad_states() -> None:
    changes: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"y": [0, 0]}, V, r"^State\.y must have shape \(3,\) like x, got \(2,\)"),
        ({"omega": [0, 0]}, V, r"^State\.omega must have shape \(1,\) like theta"),
        ({"x": [[0, 1, 2]]}, V, r"^State\.x must have 1 dimension"),
        ({"phi": [0, np.nan, 0]}, V, r"^State\.phi must be finite, got nan at \[1\]"),
        ({"vx": ["a", "b", "c"]}, T, r"^State\.vx must hold real numbers"),
        ({"mu": [1j, 0, 0]}, T, r"^State\.mu must hold real numbers"),
        ({"t": np.inf}, V, r"^State\.t must be finite"),
        ({"t": None}, T, r"^State\.t must be a real number"),
        ({"residual": "0"}, T, r"^State\.residual must be a real number"),
    ]
    for change, error, message in changes:
        with pytest.raises(error, match=message):
            bd.State(**GOOD | change)


def test_initial_of_another_drive(scene: bd.Scene, start: bd.State) -> None:
    """Or of a later time than the end of the run: t_end counts from that of the state."""
    arrays = {field.name: getattr(start, field.name) for field in attrs.fields(bd.State)}
    fewer = {name: value[:-1] for name, value in arrays.items() if np.shape(value) == (60,)}
    with pytest.raises(V, match=r"^initial\.x must have shape \(60,\), got \(59,\): it is"):
        bd.simulate(*scene, initial=attrs.evolve(start, **fewer))
    other = attrs.evolve(start, theta=[0.0] * 3, omega=[0.0] * 3)
    for call in (bd.simulate, lambda *scene, initial: bd.settle(scene[0], initial=initial)):
        with pytest.raises(V, match=r"^initial\.theta must have shape \(2,\), got \(3,\): "):
            call(*scene, initial=other)
    later = attrs.evolve(start, t=1.0)
    with pytest.raises(V, match=r"^t_end must be > initial\.t \(1 s\), got 0\.02 s"):
        bd.simulate(*scene, initial=later)
    run = bd.simulate(scene.params, scene.torque_fn, 1.002, initial=later)
    assert (run.t[0], run.t[-1]) == (1.0, 1.002)


def test_wrong_arguments_are_refused_before_anything_runs(scene: bd.Scene) -> None:
    def never(t: float, theta: Any, omega: Any) -> Any:
        raise AssertionError("it ran")

    wrong: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"t_end": -1.0}, V, r"^t_end must be > initial\.t \(0 s\), got -1 s"),
        ({"t_end": np.inf}, V, "^t_end must be finite"),
        ({"t_end": None}, T, "^t_end must be a real number"),
        ({"t_eval": [0.0, 0.02, 0.01]}, V, "^t_eval must be non-decreasing, got 0.02 s b"),
        ({"t_eval": [0.0, 0.03]}, V, r"^t_eval must lie within the run, \[0, 0\.02\] s"),
        ({"t_eval": [-0.01, 0.01]}, V, "^t_eval must lie within the run"),
        ({"t_eval": [0.0, np.nan]}, V, "^t_eval must be finite"),
        ({"t_eval": 100}, V, r"such as np\.linspace\(0, 0\.02, 100\), got 100$"),
        ({"t_eval": [[0.0]]}, V, "^t_eval must have 1 dimension"),
        ({"t_eval": "all"}, T, "^t_eval must hold real numbers"),
        ({"method": "euler"}, V, "^method must be one of auto, tsit5, rk4, lbdf2, .* got 'euler'"),
        ({"method": None}, T, "^method must be one of auto, tsit5, .* got None"),
        ({"rtol": 0.0}, V, "^rtol must be from 1e-12 to 1, got 0"),
        ({"rtol": 2}, V, "^rtol must be from 1e-12 to 1, got 2"),
        ({"rtol": None}, T, "^rtol must be a real number"),
        ({"step": 0.0}, V, "^step must be > 0"),
        ({"progress": "x"}, T, "^progress must be a bool, got 'x'"),
        ({"max_step": -1e-5}, V, "^max_step must be > 0"),
        ({"max_steps": 0}, V, "^max_steps must be an integer >= 1"),
        ({"max_steps": 1e3}, T, "^max_steps must be an integer >= 1"),
        ({"breakpoints": [np.inf]}, V, "^breakpoints must be finite"),
        ({"breakpoints": 0.1}, V, "^breakpoints must have 1 dimension"),
        ({"initial": {}}, T, "^initial must be a State or None, got dict"),
        ({"params": {}}, T, "^params must be a Params, got dict"),
        ({"tend": 1.0}, T, "tend"),
    ]
    good = {"params": scene.params, "torque_fn": never, "t_end": T_END}
    for arguments, error, message in wrong:
        with pytest.raises(error, match=message):
            bd.simulate(**good | arguments)


def assert_partial(result: bd.Result | None, path: Path) -> bd.Result:
    assert result is not None and not result.success
    assert 0 < result.t.size < N_T
    assert result.t[-1] <= result.final_state.t <= 0.0101
    assert len(result.belt.x) == len(result.contact.pulley) == result.t.size
    assert np.isfinite(result.belt.x).all() and np.isfinite(result.final_state.x).all()
    result.save(path)
    assert bd.Result.load(path).message == result.message
    return result


@pytest.mark.usefixtures("handlers")
def test_a_run_that_fails_or_is_interrupted_keeps_what_was_computed(
    scene: bd.Scene, start: bd.State, tmp_path: Path
) -> None:
    def failing(t: float, theta: Any, omega: Any) -> list[float]:
        return [-1e3 * t, 0.0 if t < 0.01 else np.nan]

    def interrupting(t: float, theta: Any, omega: Any) -> list[float]:
        if t > 0.01:
            signal.raise_signal(signal.SIGINT)
        return [0.0, 0.0]

    options: dict[str, Any] = {"initial": start, "t_eval": np.linspace(0.0, T_END, N_T)}
    with pytest.raises(bd.SimulationError) as caught:
        bd.simulate(scene.params, failing, T_END, method="tsit5", **options)
    partial = assert_partial(caught.value.result, tmp_path / "failed.npz")
    assert partial.status == "failed" and partial.message == str(caught.value)
    assert caught.value.symbol == "BD_ERR_TORQUE_VALUE"
    assert caught.value.t == pytest.approx(0.01, abs=1e-4)
    with pytest.raises(bd.Interrupted, match=r"^interrupted at t = 0\.0") as stopped:
        bd.simulate(scene.params, interrupting, T_END, **options)
    assert isinstance(stopped.value, KeyboardInterrupt)
    partial = assert_partial(stopped.value.result, tmp_path / "stopped.npz")
    assert partial.status == "interrupted"


def test_progress_goes_to_stderr_only(
    scene: bd.Scene, start: bd.State, capfd: pytest.CaptureFixture[str]
) -> None:
    bd.simulate(scene.params, scene.torque_fn, 0.002, progress=True)
    assert capfd.readouterr().out == ""
