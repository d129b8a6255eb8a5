"""The friction law and the method of CONTRIBUTING.md at work; run by `test_contributing.py`.

Not collected by itself: the package that is imported here must be the one built with them.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from click.testing import CliRunner
from smooth import T_END, observed_order, smooth_scene, swing
from test_integrators import test_explicit_methods_meet_their_order_conditions as order_conditions

import beltdyn as bd
from beltdyn import _core, cli
from beltdyn import parameters as names

Array = np.ndarray
TREE = Path(os.environ["CONTRIBUTED"])
MU, SIGMA = 0.8, 1e4


def test_this_is_the_copy() -> None:
    assert Path(bd.__file__).is_relative_to(TREE.parent)
    assert Path(_core.__file__).is_relative_to(TREE.parent)


# --- the friction law ----------------------------------------------------------------------------


def law(**changes: Any) -> Any:
    return getattr(bd, "BoucWen")(**{"mu_k": MU, "sigma": SIGMA, **changes})  # noqa: B009


def drive(friction: Any = None, **changes: Any) -> bd.Params:
    return attrs.evolve(drives.plain(), friction=friction or law(), **changes)


def slid(s: Array) -> Array:
    """The slip, times sigma / mu_k, in which z / mu_k comes from 0 to s: of 1 / (1 - s^3)."""
    root = np.sqrt(3.0)
    turned = (np.arctan((2 * s + 1) / root) - np.arctan(1 / root)) / root
    return np.asarray(np.log((s * s + s + 1) / (1 - s) ** 2) / 6 + turned)


def off_closed_form(before: Array, after: Array, slip: Array) -> Array:
    """How far z is beside its closed form after a slip in one direction: to first order."""
    s = np.sign(slip) * after / MU
    late = slid(s) - slid(np.sign(slip) * before / MU) - SIGMA * np.abs(slip) / MU
    return np.asarray(MU * (1 - s**3) * late)


def test_its_class() -> None:
    cls = type(law())
    assert cls is bd.friction.LAWS["bouc_wen"]
    assert issubclass(cls, bd.Friction) and cls.law == "bouc_wen"
    assert "mu_k: kinetic friction coefficient [1], > 0." in (cls.__doc__ or "")
    assert law() == law() and hash(law()) == hash(law()) and law() != law(mu_k=0.7)
    assert repr(law()) == "BoucWen(mu_k=0.8, sigma=10000.0)"
    assert pickle.loads(pickle.dumps(drive())) == drive()
    assert attrs.evolve(law(), sigma=2e4).sigma == 2e4


def test_its_parameters_are_checked() -> None:
    with pytest.raises(ValueError, match=r"^bouc_wen\.mu_k must be > 0 .*, got 0"):
        law(mu_k=0.0)
    with pytest.raises(ValueError, match=r"^bouc_wen\.sigma must be finite .*, got inf"):
        law(sigma=np.inf)
    with pytest.raises(TypeError, match=r"^bouc_wen\.mu_k"):
        law(mu_k="high")
    with pytest.raises(TypeError, match="mu_s"):
        law(mu_s=1.0)
    with pytest.raises(TypeError, match=r"friction law \(.*BoucWen"):
        attrs.evolve(drives.plain(), friction=0.8)


def test_it_is_printed_and_doubted() -> None:
    assert str(law()).splitlines()[:2] == ["BoucWen", "  law    bouc_wen"]
    text = str(drive())
    assert "friction.law" in text and "bouc_wen" in text
    assert "stiffness at rest, the slope dmu/ds at mu = 0" in text and "10000 1/m" in text
    assert "a friction coefficient of mu_k = 50" in str(drive(law(mu_k=50.0)))
    assert {"friction.mu_k", "friction.sigma"} <= set(names.numbers(drive()))


def test_it_goes_into_toml_and_comes_back() -> None:
    pulleys = drives.plain().pulleys
    own = drive(bd.Dahl(mu_k=0.5, sigma=1e4),
                pulleys=[attrs.evolve(pulleys[0], friction=law()), *pulleys[1:]])  # fmt: skip
    for params in (drive(), own):
        text = params.to_toml()
        assert 'kind = "bouc_wen"' in text
        assert bd.Params.from_toml(text) == params
    text = drive().to_toml()
    for change, message in {
        "mu_k = 0.8": r"^friction\.mu_k: missing",
        "sigma = 10000.0": r"^friction\.sigma: missing",
    }.items():
        with pytest.raises(ValueError, match=message):
            bd.Params.from_toml(text.replace(change, ""))
    with pytest.raises(ValueError, match=r"^friction\.mu_k must be > 0 .*, got -1"):
        bd.Params.from_toml(text.replace("mu_k = 0.8", "mu_k = -1.0"))
    with pytest.raises(ValueError, match=r"kind must be one of .*bouc_wen"):
        bd.Params.from_toml(text.replace("bouc_wen", "bouc"))


def test_its_example(capsys: pytest.CaptureFixture[str]) -> None:
    text = drive().to_toml()
    exec(os.environ["LAW_EXAMPLE"], {"PARAMS": text})
    out = capsys.readouterr().out
    assert "bouc_wen" in out and "friction.sigma" in out


def at_points(z: Array, v: Array, normal: Array) -> dict[str, Array]:
    return _core.friction_law(law()._to_core(), 0.02, z, v, normal)


def random_points(n: int = 400) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(7)
    v = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-6, 0, n)
    return rng.uniform(-0.99, 0.99, n) * MU, v, rng.uniform(0.0, 300.0, n)


def test_its_force_and_rate_are_those_of_the_formula() -> None:
    """To rounding: five operations to each."""
    z, v, normal = random_points()
    got = at_points(z, v, normal)
    exact = SIGMA * (v - np.abs(v) * (z / MU) ** 3)
    np.testing.assert_allclose(got["rate"], exact, rtol=1e-13)
    np.testing.assert_allclose(got["force"], z * normal, rtol=1e-15)
    assert np.all(at_points(z, 0 * v, normal)["rate"] == 0.0)


def test_it_is_the_same_at_every_level() -> None:
    """But for the rounding of products that some levels fuse."""
    program = (
        "import numpy as np, contributed as c; from beltdyn import _core;"
        "print(_core.kernel_level(), *(float(x).hex() for column in c.at_points("
        "*c.random_points(40)).values() for x in column))"
    )
    found = {}
    for level in ("baseline", "avx2", "avx512"):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "BELTDYN_KERNELS": level},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode == 0:
            name, *numbers = done.stdout.split()
            assert name == level
            found[level] = np.array([float.fromhex(number) for number in numbers])
        else:
            assert "kernel level" in done.stderr  # this processor lacks it
    assert "baseline" in found and _core.kernel_level() in found
    for numbers in found.values():
        np.testing.assert_allclose(numbers, found["baseline"], rtol=1e-13)


@pytest.fixture(scope="module")
def runs() -> dict[str, bd.Result]:
    """One start, under a ramp of torque against a load, by an explicit and an implicit method."""
    params = drive()
    start = bd.settle(params)
    load = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-40.0, 0.0]]) + bd.Viscous([0.0, 5.0])
    return {
        method: bd.simulate(
            params, load, 0.04, initial=start, method=method, rtol=1e-6,
            t_eval=np.linspace(0.0, 0.04, 801),
        )
        for method in ("tsit5", "rodas4")
    }  # fmt: skip


def test_explicit_and_implicit_runs_agree(runs: dict[str, bd.Result]) -> None:
    """The forces, each to 1e-6 of the tension as asked for; ten times that for two of them, whose
    largest difference is compared and not its mean square.
    """
    one, other = runs.values()
    assert "contact with Bouc-Wen friction" in one.effects
    assert one.effects == other.effects and other.stats.njev > 0
    tension = np.mean(one.joints.force)
    rms = np.sqrt(np.mean((one.joints.force - other.joints.force) ** 2))
    assert rms <= 1e-5 * tension
    assert np.abs(one.contact.mu).max() > 0.3 * MU


def test_friction_of_links_follows_the_closed_form(runs: dict[str, bd.Result]) -> None:
    """Over every 2.5 ms in which a link stays on its pulley and slips one way, as samples show it.

    To 1e-6, for a step may err by as much, and errors decay with the slip; but for one case in a
    hundred, of links that turned round and back between two samples.
    """
    n = 50
    for result in runs.values():
        c = result.contact
        steady = (c.pulley[1:] == c.pulley[:-1]) & (c.pulley[1:] >= 0)
        steady &= (c.normal[1:] > 0.0) & (c.normal[:-1] > 0.0)
        steady &= np.sign(c.velocity[1:]) == np.sign(c.velocity[:-1])
        rows = np.lib.stride_tricks.sliding_window_view(steady, n, axis=0).all(axis=-1)
        slip = (c.slip[n:] - c.slip[:-n])[rows]
        error = np.abs(off_closed_form(c.mu[:-n][rows], c.mu[n:][rows], slip))
        assert rows.sum() > 10_000 and np.abs(slip).max() > 0.3 * MU / SIGMA
        assert np.mean(error > 1e-6) < 0.01


def test_mixed_with_another_law_and_settled_with_it() -> None:
    pulleys = drives.plain().pulleys
    params = drive(bd.LuGre(mu_k=0.5, mu_s=0.6, v_stribeck=0.05, sigma=1e4, damping=0.1),
                   pulleys=[attrs.evolve(pulleys[0], friction=law()), *pulleys[1:]],
                   tensioning=bd.Tensioning(friction=True))  # fmt: skip
    result = bd.simulate(params, bd.Viscous([0.0, 1.0]), 2e-3)
    assert "contact with LuGre and Bouc-Wen friction" in result.effects


def test_results_and_restart_records_know_it(tmp_path: Path, runs: dict[str, bd.Result]) -> None:
    runs["tsit5"].save(tmp_path / "run.npz")
    again = bd.Result.load(tmp_path / "run.npz")
    assert again.params == runs["tsit5"].params and again.effects == runs["tsit5"].effects

    def simulation(friction: Any, method: str = "rodas4") -> _core.Simulation:
        state = runs["tsit5"].final_state
        terms = bd.Viscous([0.0, 5.0]).terms()
        params = drive(friction)
        return _core.Simulation(params._model, state._to_core(params), terms, 0.05, method=method)

    for method in ("rodas4", "bs32"):
        whole = simulation(law(), method)
        whole.advance(0.0)
        record = whole.export_record()
        rest = simulation(law(), method)
        rest.import_record(record)
        assert whole.advance(np.inf) and rest.advance(np.inf)
        assert np.array_equal(whole.state()["x"], rest.state()["x"])
        assert np.array_equal(whole.state()["mu"], rest.state()["mu"])
        with pytest.raises(ValueError, match="another"):
            simulation(law(sigma=2e4), method).import_record(record)


# --- the method ----------------------------------------------------------------------------------


def test_its_name_is_listed() -> None:
    assert bd.METHODS == _core.METHODS
    assert bd.METHODS == ("auto", "tsit5", "rk4", "bs32", "lbdf2", "rodas4", "lie")
    scene = drives.plain_scene()
    with pytest.raises(ValueError, match=r"method must be one of auto, .*, bs32, .*, got 'bs23'"):
        bd.simulate(*scene, method="bs23")
    state = bd.settle(scene[0])._to_core(scene[0])
    with pytest.raises(ValueError, match=r"method must be one of auto, .*, bs32, .*, got \"bs23\""):
        _core.Simulation(scene[0]._model, state, [], 1.0, method="bs23")
    assert "bs32" in CliRunner().invoke(cli.main, ["run", "--help"]).output


def test_its_order_conditions() -> None:
    order_conditions(TREE / "csrc" / "solvers" / "bs32.c")


def test_its_example_of_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    exec(os.environ["METHOD_EXAMPLE"], {})
    out = capsys.readouterr().out
    assert "'bs32'" in out and "method='bs32'" in out


def test_it_agrees_with_tsit5_as_asked() -> None:
    """Through contact and friction kinks; errors within ten times what is asked.

    Where errors limit the step, and not the joints, it goes with their third root: 2.15 times as
    many for a tenth.
    """
    params, torque, *_ = drives.plain_scene()
    start = bd.simulate(params, torque, 0.1, t_eval=[0.1]).final_state
    times = np.linspace(0.1, 0.12, 101)
    kwargs: dict[str, Any] = {"initial": start, "t_eval": times}
    exact = bd.simulate(params, torque, 0.12, method="tsit5", rtol=1e-11, **kwargs).joints.force
    steps = []
    for rtol in (1e-3, 1e-5, 1e-7, 1e-8):
        result = bd.simulate(params, torque, 0.12, method="bs32", rtol=rtol, **kwargs)
        rms = np.sqrt(np.mean((result.joints.force - exact) ** 2))
        assert rms <= 10 * rtol * np.mean(exact), rtol
        assert result.stats.method == "bs32" and result.stats.local_error <= rtol
        steps.append(result.stats.steps)
    assert steps == sorted(steps) and steps[-1] == pytest.approx(2.15 * steps[-2], rel=0.1)


def test_its_order_also_between_steps() -> None:
    """3, at the end and by cubic Hermite between steps; steps held by max_step."""
    params, start = smooth_scene()
    times = np.sort(np.random.default_rng(2).uniform(0, T_END, 200))
    bound = params.info["spectral_bound"]
    kwargs: dict[str, Any] = {"initial": start, "t_eval": times}
    exact = bd.simulate(params, swing, T_END, method="rk4", step=0.02 / bound, **kwargs)
    steps = [T_END / n for n in (80, 110, 150, 200)]
    ends, between = [], []
    for h in steps:
        held = {"step": h, "max_step": h, "rtol": 1.0}
        got = bd.simulate(params, swing, T_END, method="bs32", **kwargs, **held)
        ends.append(np.max(np.abs(got.final_state.x - exact.final_state.x)))
        between.append(np.max(np.abs(got.belt.x - exact.belt.x)))
    # as for the other methods (test_integrators.py): not quite asymptotic, from above is no fault
    assert 2.65 <= observed_order(steps, ends) <= 4.0
    assert 2.65 <= observed_order(steps, between) <= 4.0
