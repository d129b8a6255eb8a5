"""The friction law and the method of CONTRIBUTING.md at work; run by `test_contributing.py`.

Not collected by itself: the package that is imported here must be the one built with them.
"""

from __future__ import annotations

import os
import pickle
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
from beltdyn.drive import parameters as names

Array = np.ndarray
TREE = Path(os.environ["CONTRIBUTED"])
MU, SIGMA = 0.8, 1e4


def law(**changes: Any) -> Any:
    return getattr(bd, "BoucWen")(**{"mu_k": MU, "sigma": SIGMA, **changes})  # noqa: B009


def drive(friction: Any = None, **changes: Any) -> bd.Params:
    return attrs.evolve(drives.plain(), friction=friction or law(), **changes)


def mixed(friction: Any) -> bd.Params:
    """The law on the first pulley, another on the second."""
    first, second = drives.plain().pulleys
    return drive(friction, pulleys=[attrs.evolve(first, friction=law()), second])


def slid(s: Array) -> Array:
    """The slip, times sigma / mu_k, in which z / mu_k comes from 0 to s: of 1 / (1 - s^3)."""
    root = np.sqrt(3.0)
    turned = (np.arctan((2 * s + 1) / root) - np.arctan(1 / root)) / root
    return np.asarray(np.log((s * s + s + 1) / (1 - s) ** 2) / 6 + turned)


def test_its_class_and_parameters() -> None:
    cls = type(law())
    assert cls is bd.friction.LAWS["bouc_wen"] and Path(bd.__file__).is_relative_to(TREE.parent)
    assert issubclass(cls, bd.Friction) and cls.law == "bouc_wen"
    assert "mu_k: Kinetic friction coefficient [1], > 0." in (cls.__doc__ or "")
    assert law() == law() and hash(law()) == hash(law()) and law() != law(mu_k=0.7)
    assert repr(law()) == "BoucWen(mu_k=0.8, sigma=10000.0)"
    assert pickle.loads(pickle.dumps(drive())) == drive()
    for wrong, error, message in (
        ({"mu_k": 0.0}, ValueError, r"^bouc_wen\.mu_k must be > 0 .*, got 0"),
        ({"sigma": np.inf}, ValueError, r"^bouc_wen\.sigma must be finite .*, got inf"),
        ({"mu_k": "high"}, TypeError, r"^bouc_wen\.mu_k"),
        ({"mu_s": 1.0}, TypeError, "mu_s"),
    ):
        with pytest.raises(error, match=message):
            law(**wrong)
    assert str(law()).splitlines()[:2] == ["BoucWen", "  kind   bouc_wen"]
    assert "stiffness at rest, the slope dmu/ds at mu = 0" in str(drive())
    assert "a friction coefficient of mu_k = 50" in str(drive(law(mu_k=50.0)))
    assert {"friction.mu_k", "friction.sigma"} <= set(names.numbers(drive()))


def test_it_goes_into_toml_and_comes_back(capsys: pytest.CaptureFixture[str]) -> None:
    """And the page's example reads it."""
    text = mixed(bd.Dahl(mu_k=0.5, sigma=1e4)).to_toml()
    assert 'kind = "bouc_wen"' in text
    assert bd.Params.from_toml(text) == mixed(bd.Dahl(mu_k=0.5, sigma=1e4))
    text = drive().to_toml()
    assert bd.Params.from_toml(text) == drive()
    for old, new, message in (
        ("mu_k = 0.8", "", r"^friction\.mu_k: missing"),
        ("mu_k = 0.8", "mu_k = -1.0", r"^friction\.mu_k must be > 0 .*, got -1"),
        ("bouc_wen", "bouc", r"kind must be one of .*bouc_wen"),
    ):
        with pytest.raises(ValueError, match=message):
            bd.Params.from_toml(text.replace(old, new))
    exec(os.environ["LAW_EXAMPLE"], {"PARAMS": text})
    out = capsys.readouterr().out
    assert "bouc_wen" in out and "friction.sigma" in out


def test_its_force_and_rate_are_those_of_the_formula() -> None:
    """To rounding: five operations to each."""
    rng = np.random.default_rng(7)
    v = rng.choice([-1.0, 0.0, 1.0], 400) * 10.0 ** rng.uniform(-6, 0, 400)
    z, normal = rng.uniform(-0.99, 0.99, 400) * MU, rng.uniform(0.0, 300.0, 400)
    got = _core.friction_law(law()._to_core(), 0.02, z, v, normal)
    np.testing.assert_allclose(got["rate"], SIGMA * (v - np.abs(v) * (z / MU) ** 3), rtol=1e-13)
    np.testing.assert_allclose(got["force"], z * normal, rtol=1e-15)


def test_runs_with_it(tmp_path: Path) -> None:
    """Under a ramp of torque, by an explicit and an implicit method, which agree: the forces, each
    to 1e-6 of the tension as asked for; ten times that for two of them, whose largest difference
    is compared and not its mean square.

    Friction follows the closed form over every 2.5 ms in which a link stays on its pulley and slips
    one way, as samples show it: to 1e-6, for a step may err by as much, and errors decay with the
    slip; but for one case in a hundred, of links that turned round and back between two samples.
    """
    start = bd.settle(drive())
    load = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-40.0, 0.0]]) + bd.Viscous([0.0, 5.0])
    asked: dict[str, Any] = {"rtol": 1e-6, "t_eval": np.linspace(0.0, 0.04, 801)}
    one, other = (
        bd.simulate(drive(), load, 0.04, initial=start, method=method, **asked)
        for method in ("tsit5", "rodas4")
    )
    assert "contact with Bouc-Wen friction" in one.effects
    assert one.effects == other.effects and other.stats.njev > 0
    rms = np.sqrt(np.mean((one.joints.force - other.joints.force) ** 2))
    assert rms <= 1e-5 * np.mean(one.joints.force)
    n = 50
    for c in (one.contact, other.contact):
        steady = (c.pulley[1:] == c.pulley[:-1]) & (c.pulley[1:] >= 0)
        steady &= (c.normal[1:] > 0.0) & (c.normal[:-1] > 0.0)
        steady &= np.sign(c.velocity[1:]) == np.sign(c.velocity[:-1])
        rows = np.lib.stride_tricks.sliding_window_view(steady, n, axis=0).all(axis=-1)
        slip = (c.slip[n:] - c.slip[:-n])[rows]
        before, after = (np.sign(slip) * mu[rows] / MU for mu in (c.mu[:-n], c.mu[n:]))
        # how far z is beside its closed form: to first order
        error = MU * (1 - after**3) * (slid(after) - slid(before) - SIGMA * np.abs(slip) / MU)
        assert rows.sum() > 10_000 and np.abs(slip).max() > 0.3 * MU / SIGMA
        assert np.mean(np.abs(error) > 1e-6) < 0.01
    one.save(tmp_path / "run.npz")
    again = bd.Result.load(tmp_path / "run.npz")
    assert again.params == one.params and again.effects == one.effects
    lugre = bd.LuGre(mu_k=0.5, mu_s=0.6, v_stribeck=0.05, sigma=1e4, damping=0.1)
    settled = attrs.evolve(mixed(lugre), tensioning=bd.Tensioning(friction=True))
    result = bd.simulate(settled, bd.Viscous([0.0, 1.0]), 2e-3)
    assert "contact with LuGre and Bouc-Wen friction" in result.effects


def test_restart_records_know_law_and_method() -> None:
    params, terms = drive(), bd.Viscous([0.0, 5.0]).terms()
    start = bd.simulate(params, bd.Viscous([0.0, 5.0]), 0.01).final_state._to_core(params)

    def simulation(friction: Any, method: str) -> _core.Simulation:
        return _core.Simulation(drive(friction)._model, start, terms, 0.02, method=method)

    for method in ("rodas4", "bs32"):
        whole, rest = (simulation(law(), method) for _ in range(2))
        whole.advance(0.0)
        record = whole.export_record()
        rest.import_record(record)
        assert whole.advance(np.inf) and rest.advance(np.inf)
        assert np.array_equal(whole.state()["x"], rest.state()["x"])
        assert np.array_equal(whole.state()["mu"], rest.state()["mu"])
        with pytest.raises(ValueError, match="another"):
            simulation(law(sigma=2e4), method).import_record(record)


def test_its_name_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    """And the page's example runs; its order conditions hold."""
    assert bd.METHODS == _core.METHODS
    assert bd.METHODS == ("auto", "tsit5", "rk4", "bs32", "lbdf2", "rodas4", "lie")
    with pytest.raises(ValueError, match=r"method must be one of auto, .*, bs32, .*, got 'bs23'"):
        bd.simulate(*drives.plain_scene(), method="bs23")
    assert "bs32" in CliRunner().invoke(cli.main, ["run", "--help"]).output
    order_conditions(TREE / "csrc" / "solvers" / "bs32.c")
    exec(os.environ["METHOD_EXAMPLE"], {})
    out = capsys.readouterr().out
    assert "'bs32'" in out and "method='bs32'" in out


def test_it_agrees_with_tsit5_as_asked() -> None:
    """Through contact and friction kinks, to ten times what is asked. Where errors limit the step,
    and not the joints, it goes with their third root: 2.15 times as many for a tenth.
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
