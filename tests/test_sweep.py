"""Sweeps: each run is that of simulate, bit for bit, with what its names stand for changed; what is
measured, labelled, refused, and what happens to runs that fail.
"""

from __future__ import annotations

import json
import sys
import warnings
from typing import Any

import attrs
import numpy as np
import pytest
import xarray as xr
from sweep_runs import (
    SCALES,
    TIMES,
    alone,
    bits,
    do,
    moved,
    plain,
    small,
    under_function,
    with_belt,
)

import beltdyn as bd
from beltdyn.many.dispatch import Dispatch
from beltdyn.sweeping import names
from beltdyn.sweeping.measure import as_measure

pytestmark = pytest.mark.filterwarnings("ignore:(long_links|no_result)")


def run(*args: Any, **options: Any) -> xr.Dataset:
    options = {"progress": False, "executor": "threads", **options}
    dataset = bd.sweep(*args, **options)
    assert isinstance(dataset, xr.Dataset)
    return dataset


def test_a_grid_is_every_combination_of_runs_by_hand() -> None:
    scene, lengths, factors = small(), [1.198, 1.2], [0.5, 1.0, 2.0]
    measure = ["pulleys.omega", "span_tension.final", "joints.force"]
    found = run(scene, {"belt.length": lengths, "torque.scale": factors}, measure)
    assert found["pulleys.omega"].dims == ("belt.length", "torque.scale", "time", "pulley")
    assert found["joints.force"].dims == ("belt.length", "torque.scale", "time", "joint")
    assert list(found["pulley"].values) == ["crank", "fan"]
    assert list(found["span"].values) == ["crank to fan", "fan to crank"]
    for length in lengths:
        for factor in factors:
            changed = with_belt(scene, length=length)
            result = alone(changed._replace(torque_fn=scene.torque_fn * factor))
            here = found.sel({"belt.length": length, "torque.scale": factor})
            assert here["status"] == "finished" and here["message"] == ""
            assert bits(here["pulleys.omega"]) == bits(result.pulleys.omega)
            assert bits(here["joints.force"]) == bits(result.joints.force)
            assert bits(here["span_tension.final"]) == bits(result.span_tension[-1])
            assert str(here["warnings"].values) == "\n".join(map(str, result.warnings))
    assert bits(found["time"]) == bits(result.t)
    # zipped listed and sampled runs are along one dimension
    over = {"belt.length": [1.198, 1.2], "torque.scale": [0.5, 2.0]}
    grid = run(small(), over, "span_tension.final")
    zipped = run(small(), over, "span_tension.final", combine="zip")
    listed = run(
        small(),
        [{"belt.length": 1.198, "torque.scale": 0.5}, {"belt.length": 1.2, "torque.scale": 2.0}],
        "span_tension.final",
    )
    assert zipped.drop_attrs().identical(listed.drop_attrs())
    assert zipped["span_tension.final"].dims == ("run", "span")
    for k in range(2):
        assert bits(zipped["span_tension.final"][k]) == bits(grid["span_tension.final"][k, k])
    assert list(zipped["torque.scale"].values) == [0.5, 2.0]
    samples = bd.sample({"belt.length": (1.195, 1.2), "friction.mu_k": (0.5, 0.9)}, 4, seed=3)
    found = run(small(), samples, "span_tension.final")
    assert bits(found["friction.mu_k"]) == bits(samples.values[:, 1])
    one = attrs.evolve(small().params.friction, mu_k=float(samples.values[2, 1]))
    scene = with_belt(small(), length=float(samples.values[2, 0]))
    scene = scene._replace(params=attrs.evolve(scene.params, friction=one))
    assert bits(found["span_tension.final"][2]) == bits(alone(scene).span_tension[-1])
    assert json.loads(found.attrs["design"])["seed"] == 3


OPTIONS = {"rtol": 1e-6, "method": "tsit5", "max_step": 1e-5}
MOUNTED = "tensioner"


def alternator() -> bd.Scene:
    return bd.scenes.tensioned_alternator()._replace(t_end=0.003)


def ramp_to(torque: float) -> bd.PiecewiseLinear:
    return bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [torque, 0.0]])


def by_hand() -> dict[str, tuple[Any, bd.Scene]]:
    """Names, a value, and the scene with it, made without names."""
    scene, moving, arms = small(), moved(), alternator()
    params, torque = scene.params, scene.torque_fn
    assert isinstance(torque, bd.TorqueSum)
    drive, load = torque.parts
    heavy = [attrs.evolve(one, inertia=0.02) for one in params.pulleys]
    twice = bd.PiecewiseLinear([0.0, 1e-3, 2e-3], [-20.0, -22.0, -22.0])
    other = bd.PiecewiseLinear([0.0, 1e-3, 2e-3], [-10.0, -7.0, -11.0])
    coulomb = bd.Coulomb(mu=0.5, v_reg=0.01)
    *fixed, arm = arms.params.pulleys
    damped = attrs.evolve(arm, mount=attrs.evolve(arm.mount, damping=0.5))

    def of(**changes: Any) -> bd.Scene:
        return scene._replace(params=attrs.evolve(params, **changes))

    def under(torque: Any) -> bd.Scene:
        return scene._replace(torque_fn=torque)

    return {
        "belt.axial_damping": (2.0, with_belt(scene, axial_damping=2.0)),
        "belt.n_bodies": (20, with_belt(scene, n_bodies=20)),
        "belt.preload": (900.0, with_belt(scene, length=None, preload=900.0)),
        "friction.mu_k": (0.6, of(friction=bd.Dahl(mu_k=0.6, sigma=1e4))),
        "friction": (coulomb, of(friction=coulomb)),
        "gravity[1]": (-9.81, of(gravity=(0.0, -9.81))),
        "pulleys[fan].inertia": (0.02, of(pulleys=(params.pulleys[0], heavy[1]))),
        "pulleys[*].inertia": (0.02, of(pulleys=heavy)),
        "torque.scale": (1.5, under(drive * 1.5 + load * 1.5)),
        "torque[0].scale": (1.5, under(drive * 1.5 + load)),
        "torque[1].quadratic": (2e-3, under(drive + bd.Load("fan", viscous=0.5, quadratic=2e-3))),
        "torque[0].values[1][0]": (-30.0, under(ramp_to(-30.0) + load)),
        "torque": (drive, under(drive)),
        "t_end": (0.001, scene._replace(t_end=0.001)),
        "motion.scale": (2.0, moving._replace(motion={0: twice})),
        "motion[0].values[1]": (-7.0, moving._replace(motion={0: other})),
        f"pulleys[{MOUNTED}].mount.damping": (
            *(0.5, arms._replace(params=attrs.evolve(arms.params, pulleys=[*fixed, damped]))),
        ),
        # options of simulate are swept as well
        **dict.fromkeys(OPTIONS, (None, scene)),
    }


def test_a_name_changes_what_it_stands_for() -> None:
    """A factor comes after what it is a factor of, in whatever order they are named."""
    bases = {"motion": moved, f"pulleys[{MOUNTED}]": alternator}
    before = {base: alone(base()).joints.force[-1] for base in (small, moved, alternator)}
    for name, (value, scene) in by_hand().items():
        base = bases.get(name.partition(".")[0].removesuffix("[0]"), small)
        options = {name: OPTIONS[name]} if name in OPTIONS else {}
        over = {name: [OPTIONS.get(name, value)]}
        found = run(base(), over, "joints.force.final")["joints.force.final"][0]
        assert bits(found) == bits(alone(scene, **options).joints.force[-1]), name
        assert bits(found) != bits(before[base]), name
        if options:
            again = run(small(), {"torque.scale": [1.0]}, "joints.force.final", **options)
            assert bits(again["joints.force.final"]) == bits(found), name
    tight = with_belt(small(), length=None, preload=900.0)
    assert list(run(tight, {"belt.length": [1.2]}, "stats.steps")["status"].values) == ["finished"]
    over = {"torque.scale": [2.0], "torque[0].scale": [1.5], "torque": [ramp_to(-30.0)]}
    found = run(small(), over, "pulleys.torque.final", t_end=0.001)
    assert list(found["pulleys.torque.final"].values.ravel()) == [-90.0, 0.0]
    turning = moved()._replace(motion={0: lambda t: -5.0})
    found = run(turning, {"motion.scale": [2.0], "motion[0].scale": [1.5]}, "pulleys.omega.final")
    assert found["pulleys.omega.final"].values[0, 0, 0] == -15.0


def test_a_warm_start_goes_on_from_the_run_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """As by hand: the final state, at t = 0, is the start of the next run along that name."""
    scene = plain()
    over = {"torque.scale": SCALES, "friction.mu_k": [0.5, 1.0]}
    found = do(scene, over, "span_tension", warm="torque.scale", t_eval=TIMES).dataset
    found = found["span_tension"].values
    for k, mu_k in enumerate(over["friction.mu_k"]):
        friction = attrs.evolve(scene.params.friction, mu_k=mu_k)
        params, state = attrs.evolve(scene.params, friction=friction), None
        for j, scale in enumerate(SCALES):
            result = bd.simulate(params, scene.torque_fn * scale, 2e-3, t_eval=TIMES, initial=state)
            state = attrs.evolve(result.final_state, t=0.0)
            assert found[j, k].tobytes() == result.span_tension.tobytes(), (j, k)
    cold = do(scene, over, "span_tension", t_eval=TIMES).dataset["span_tension"].values
    assert (found[1:, :, 0] != cold[1:, :, 0]).any()
    # a run after one that failed starts from rest
    lengths = {"belt.length": [1.2, 0.2, 1.198]}
    warm, cold = (run(small(), lengths, "span_tension", warm=name) for name in (*lengths, None))
    assert list(warm["status"].values) == ["finished", "refused", "finished"]
    assert bits(warm["span_tension"][2]) == bits(cold["span_tension"][2])
    # One state for all runs that differ in loads or options alone, one for each drive
    loads: dict[str, Any] = {"torque.scale": [k / 20 for k in range(20)], "rtol": [1e-3, 1e-4]}
    settled: list[bd.Params] = []

    def counted(params: bd.Params, **options: Any) -> bd.State:
        settled.append(params)
        return bd.settle(params, **options)

    monkeypatch.setattr("beltdyn.sweeping.work.settle", counted)

    def settles(*args: Any, **options: Any) -> int:
        settled.clear()
        assert do(*args, "stats.steps", **options).computed > 0
        return len(settled)

    for executor in (1, "threads"):
        assert settles(plain(), loads, executor=executor) == 1
    assert settles(plain(), {**loads, "friction.mu_k": [0.5, 0.7]}) == 2
    speeds = {"motion.scale": [1.0, 1.5], "torque.scale": [0.5, 1.0]}
    assert settles(moved(), speeds) == 2  # it runs at the speed
    assert settles(plain(), loads, initial=bd.settle(plain().params)) == 0
    # of a drive that does not settle all runs fail, with one message, at the cost of one
    params = plain().params
    loose = attrs.evolve(params.tensioning, move_time=1e-9, offset=[(0.0, 0.0), (-0.2, 0.0)])
    scene = plain()._replace(params=attrs.evolve(params, tensioning=loose))
    assert settles(scene, {"torque.scale": SCALES}) == 1
    swept = do(scene, {"torque.scale": SCALES}, "stats.steps")
    assert swept.counts in ({"failed": 3}, {"refused": 3})
    assert len({str(one) for one in swept.dataset.message.values}) == 1


def test_a_sweep_warns_of_runs_without_result() -> None:
    """How many of how many, and why the first; as an error it holds the dataset."""
    over = {"belt.axial_stiffness": [7e4, -1.0, 0.0], "t_end": [1e-3, 2e-3]}
    with pytest.raises(bd.BeltdynWarning) as caught, warnings.catch_warnings():
        warnings.simplefilter("error")
        run(small(), over, "stats.steps")
    table: xr.Dataset = caught.value.dataset  # type: ignore[attr-defined]
    assert list(table["status"].values.ravel()) == 2 * ["finished"] + 4 * ["refused"]
    why = table["message"].values[1, 0]
    assert "axial_stiffness" in why
    text = f"no_result: 4 of 6 runs have no result (4 refused); the first: {why}; status"
    assert str(caught.value).startswith(text)
    with pytest.warns(bd.BeltdynWarning, match="1 of 2 runs have no result") as told:
        run(small(), {"t_end": [1e-3, -1.0]}, "stats.steps")
    assert [one.filename for one in told] == [__file__]  # of who called
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(small(), {"t_end": [1e-3]}, "stats.steps")


def test_reductions_are_of_the_last_part() -> None:
    """And nothing is computed but what is measured."""
    scene = small(0.01)
    measure = [f"pulleys.omega.{how}" for how in ("mean", "least", "most", "rms", "final")]
    found = run(scene, {"torque.scale": [1.0]}, measure, last=0.5).isel({"torque.scale": 0})
    result = alone(scene)
    inside = result.t >= 0.005 - 1e-12
    t, omega = result.t[inside], result.pulleys.omega[inside]
    mean = np.trapezoid(omega, t, axis=0) / np.ptp(t)
    rms = np.sqrt(np.trapezoid(omega**2, t, axis=0) / np.ptp(t))
    # another order of summing up
    np.testing.assert_allclose(found["pulleys.omega.mean"], mean, rtol=1e-12)
    np.testing.assert_allclose(found["pulleys.omega.rms"], rms, rtol=1e-12)
    assert bits(found["pulleys.omega.least"]) == bits(omega.min(axis=0))
    assert bits(found["pulleys.omega.most"]) == bits(omega.max(axis=0))
    assert bits(found["pulleys.omega.final"]) == bits(omega[-1])
    assert found["pulleys.omega.mean"].attrs["units"] == "rad/s"
    names = ["span_tension.mean", "pulleys.omega.final", "stats.steps"]
    assert as_measure(names, scene.params, 0.2).outputs == ("span_tension", "pulleys.omega")
    assert as_measure(lambda result: 0.0, scene.params, 0.2).outputs is None

    # a function gives numbers texts arrays and labelled arrays
    def measure(result: bd.Result) -> dict[str, Any]:
        force = result.joints.force[-1]
        return {
            "largest": float(force.max()),
            "count": force.size,
            "word": "tight" if force.max() > 1000.0 else "slack",
            "all": force,
            "both": xr.DataArray(force[:2], {"end": ["l", "r"]}, ("end",), attrs={"units": "N"}),
            "inside": {"least": force.min()},
            "none": None,
        }

    over = {"belt.length": [1.195, 1.207]}
    found = run(small(), over, measure)
    force = alone(with_belt(small(), length=1.195)).joints.force[-1]
    assert float(found["largest"][0]) == force.max() and float(found["count"][0]) == 24
    assert list(found["word"].values) == ["tight", "slack"]
    assert found["all"].dims == ("belt.length", "all_0") and bits(found["all"][0]) == bits(force)
    assert found["both"].dims == ("belt.length", "end") and found["both"].attrs["units"] == "N"
    assert bits(found["both"].sel(end="r")[0]) == bits(force[1])
    assert float(found["inside.least"][0]) == force.min()
    assert np.isnan(found["none"]).all()
    measures = {"top": lambda result: result.joints.force.max(), "n": "stats.steps"}
    assert set(measures) < set(map(str, run(small(), over, measures).data_vars))


def test_quantities_of_the_report() -> None:
    scene, over = small(0.05), {"torque.scale": [1.0]}
    report = alone(scene).report()
    creep = {row.name: row.lost for row in report.creep}
    assert set(creep) == {"crank", "fan"} - {report.driver}
    fan = report.pulleys["fan"].torque.mean
    expected: dict[str, Any] = {
        "report.pulleys.margin": [
            np.nan if row.margin is None else row.margin for row in report.pulleys
        ],
        "report.pulleys.speed most": [row.speed.most for row in report.pulleys],
        "report.pulleys[fan].torque": fan,
        "report.pulleys[0].hub_load": report.pulleys["crank"].hub_load.mean,
        "report.spans.tension least": [row.tension.least for row in report.spans],
        "report.creep.lost": [creep.get(name, np.nan) for name in ("crank", "fan")],
        "report.belt_speed": report.belt_speed,
        "report.driver": report.driver,
        "report.powers.power": [row.power for row in report.powers],
    }
    measure = {"fans": "report.pulleys[fan].torque"} | {name: name for name in expected}
    found = run(scene, over, measure).isel({"torque.scale": 0})
    for name, values in (expected | {"fans": fan}).items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    assert list(found["part"].values) == [row.name for row in report.powers]
    assert found["report.pulleys[fan].torque"].attrs["units"] == "N m"
    whole = run(scene, over, "report")
    assert {name for name in expected if "[" not in name} < set(map(str, whole.data_vars))


def test_runs_that_fail_stop_nothing_and_say_why() -> None:
    """Refused by the drive, a load, an option; failed while settling, while running."""

    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        return [-40.0, 0.0]

    def breaks(t: float, theta: Any, omega: Any) -> list[float]:
        if t > 1e-3:
            raise ZeroDivisionError("no torque\nfor you")
        return [-10.0, -float(omega[1])]

    scene = small(0.02)
    usual = {"torque": torque, "belt.length": 1.2, "gravity[1]": 0.0, "t_end": 0.01}
    usual |= {"max_steps": None, "rtol": 1e-3}
    changes: list[tuple[dict[str, Any], str, str]] = [
        ({}, "finished", ""),
        ({"torque": breaks}, "failed", "ZeroDivisionError: no torque for you"),
        ({"belt.length": 0.2}, "refused", "too short"),
        ({"belt.length": 1.5}, "refused", "too long"),
        ({"belt.length": -1.0}, "refused", "belt.length must be > 0"),
        ({"max_steps": 3}, "failed", "limit of 3 steps"),
        ({"gravity[1]": -1e7}, "failed", ""),
        ({"max_steps": -3}, "refused", "max_steps"),
        ({"rtol": 5.0}, "refused", "rtol must be"),
        ({"t_end": -1.0}, "refused", "t_end must be"),
        ({"torque": "none"}, "refused", "torque_fn"),
        ({"torque": bd.Viscous([0.0, 1.0, 2.0])}, "refused", ""),
        ({"belt.length": 1.198}, "finished", ""),
    ]
    points = [{**usual, **change} for change, _, _ in changes]
    measure = ["span_tension.mean", "stats.method"]
    found = run(scene, points, measure)
    tensions = found["span_tension.mean"]
    for k, (_, status, words) in enumerate(changes):
        message = str(found["message"].values[k])
        assert found["status"].values[k] == status and words in message, (k, message)
        assert (message != "") == (status != "finished") and "\n" not in message
        assert np.isfinite(tensions[k]).all() == (status == "finished")
        assert (found["stats.method"].values[k] != "") == (status == "finished")
        assert "mesh" in str(found["warnings"].values[k]) or status == "refused" or k == 6
    assert bits(tensions[-1]) == bits(run(scene, points[-1:], measure)["span_tension.mean"][0])
    with pytest.raises(bd.SimulationError) as error:
        bd.settle(attrs.evolve(scene.params, gravity=(0.0, -1e7)))
    assert found["message"].values[6] == " ".join(str(error.value).split())

    # a load that lacks what is swept of it
    whole = [bd.Viscous([0.0, 1.0]), bd.Load(0, viscous=1.0)]
    over = {"torque": whole, "torque[0].coefficients[1]": [1.0]}
    found = run(plain()._replace(torque_fn=whole[0]), over, "stats.steps")
    assert [*found["status"].values.ravel()] == ["finished", "refused"]
    assert "not 'coefficients'" in str(found["message"].values[1, 0])

    # a measure that fails or does not fit
    def measure(result: bd.Result) -> Any:
        length = result.params.belt.length
        if length == 1.2:
            raise KeyError("peak")
        return result.joints.force[-1][: 3 if length == 1.195 else 4]

    found = run(small(), {"belt.length": [1.2]}, lambda result: None)
    assert "a return missing" in str(found["message"].values[0])
    found = run(small(), {"belt.length": [1.195, 1.2, 1.198]}, {"force": measure})
    assert list(found["status"].values) == ["finished", "measure", "measure"]
    said = str(found["message"].values[1])
    assert said.startswith("KeyError: 'peak' (line ") and said.endswith("easure, test_sweep.py)")
    assert found["message"].values[2] == "force has 4 values along 'force_0', 3 in the first runs"
    assert np.isnan(found["force"][1:]).all() and np.isfinite(found["force"][0]).all()

    # curves over other times
    over = {"t_end": [0.002, 0.001]}
    found = run(small(), over, "pulleys.omega")
    assert list(found["status"].values) == ["finished", "measure"]
    assert "give t_eval" in str(found["message"].values[1])
    found = run(small(), over, "pulleys.omega", t_eval=[0.0, 0.0005, 0.001])
    assert list(found["status"].values) == ["finished", "finished"]


def test_a_table_has_units_and_texts_and_comes_back_from_a_file(tmp_path: Any) -> None:
    over = {"friction": [bd.Dahl(mu_k=1.0, sigma=1e4), None], "torque.scale": [1, 2]}
    over |= {"belt.length": [1.2], "rtol": [1e-3], "t_end": [0.001]}
    measure = ["span_tension.mean", "stats.method", "pulleys.omega"]
    found = run(small(), over, measure, method="tsit5")
    units = {name: found[name].attrs.get("units") for name in [*over][1:]}
    assert units == {"torque.scale": "1", "belt.length": "m", "rtol": None, "t_end": "s"}
    assert found["belt.length"].attrs["long_name"] and found["span_tension.mean"].attrs["long_name"]
    assert found["span_tension.mean"].attrs["units"] == "N"
    assert bd.Scene.from_toml(found.attrs["scene"]).t_end == small().t_end
    assert "method = tsit5" in found.attrs["options"] and found.attrs["kernels"]
    assert found.attrs["beltdyn_version"] == bd.__version__
    assert found["torque.scale"].dtype.kind == "i"
    found.to_netcdf(tmp_path / "sweep.nc")
    with xr.open_dataset(tmp_path / "sweep.nc") as read:
        xr.testing.assert_equal(read.load(), found)
    assert read.attrs == found.attrs
    travel = run(alternator(), {"t_end": [0.001]}, "mounts.travel.final")
    assert travel["mount"].values == [MOUNTED]
    assert travel["mounts.travel.final"].attrs["units"] == "rad"


BAD_NAMES: list[tuple[Any, str]] = [
    ({"belt.lenght": [1.2]}, "did you mean 'belt.length'"),
    ({"belt.EA": [1e4]}, "did you mean 'belt.axial_stiffness'"),
    ({"preload": [1.0]}, "did you mean 'belt.preload'"),
    ({"pulleys[pump].inertia": [1.0]}, "no pulley is called 'pump'"),
    ({"torque[2].scale": [1.0]}, "2 part"),
    ({"torque[1].linear": [1.0]}, "not 'linear'"),
    ({"torque.viscous": [1.0]}, 'torque[0].viscous'),
    ({"motion.scale": [1.0]}, "no motion is prescribed"),
    ({"belt.length": 1.2}, "a list of values"),
    ({"belt.length": [1.2, 1.2]}, "twice"),
    ({}, "at least one"),
    ({"belt.length": []}, "at least one value"),
    ([], "at least one"),
    ([{"belt.length": 1.2}, {"torque.scale": 1.0}], "over[1] must name belt.length"),
    ({"pulleys[0].inertia": [1.0], "pulleys[*].inertia": [1.0]}, "a number in common"),
    ({"outputs": [("belt",)]}, "nothing is called 'outputs'"),
    ("belt.length", "over must be"),
    ({"max_steps": [2**63]}, "over['max_steps'] must hold integers of 64 bits"),
]  # fmt: skip
BAD_ARGUMENTS: list[tuple[dict[str, Any], str]] = [
    ({"measure": "span_tensoin"}, "did you mean 'span_tension'"),
    ({"measure": "span_tension.max"}, "did you mean 'span_tension.most'"),
    ({"measure": "report.pulleys.margn"}, "did you mean 'margin'"),
    ({"measure": "report.pulleys.lost"}, "did you mean 'report.creep.lost'"),
    ({"measure": "report.pulleys[pump].margin"}, "no pulley is called 'pump'"),
    ({"measure": "mounts.travel"}, "no mounts"),
    ({"measure": {"a": 3}}, "must be a name or a function"),
    ({"measure": 3}, "measure must be"),
    ({"measure": []}, "at least one"),
    ({"measure": "stats.stepps"}, "did you mean 'steps'"),
    ({"rtoll": 1e-3}, "did you mean 'rtol'"),
    ({"tolerance": 1e-3}, "did you mean 'rtol'"),
    ({"solver": "rk4"}, "did you mean 'method'"),
    ({"measure": {"status": "span_tension.mean"}}, "'status' is the name of something else"),
    ({"measure": {"belt.length": "slip.mean"}}, "'belt.length' is the name of"),
    ({"t_end": -1.0}, "t_end must be > 0"),
    ({"outputs": ("belt",)}, "follows from measure"),
    ({"method": "rk4", "over": {"method": ["rk4"]}}, "leave one of them out"),
    ({"combine": "both"}, "combine must be"),
    ({"combine": "zip", "over": {"belt.length": [1.0, 2.0], "t_end": [1.0]}}, "as many values"),
    ({"warm": "belt.width"}, "warm must be one of"),
    ({"warm": "belt.length", "combine": "zip"}, "needs a grid"),
    ({"last": 0.0}, "last must be"),
    ({"scene": "no-such-scene"}, "no scene is called"),
    ({"scene": 3}, "scene must be"),
    ({"scene": plain()[:2]}, "got (Params, TorqueSum)"),
    ({"exectuor": 2}, "did you mean 'executor'"),
    ({"store": 3}, "store must be a path or None, got int"),
    # as simulate says it of one run
    ({"rtol": "x"}, "rtol must be a real number, got 'x'"),
    ({"method": "euler"}, "method must be one of auto"),
    ({"step": 0.0}, "step must be > 0 s"),
    ({"max_steps": 2**63}, "max_steps is too large: 9223372036854775808"),
    ({"breakpoints": "x"}, "breakpoints must hold real numbers"),
    ({"verify": 1}, "verify must be a bool"),
    ({"t_eval": 100}, "t_eval must have 1 dimension"),
    ({"t_eval": [0.0, 9.0]}, "t_eval must lie within the run, [0, "),
    ({"t_eval": [0.0, -1.0], "over": {"t_end": [0.01]}}, "t_eval must be non-decreasing"),
    ({"initial": "rest"}, "initial must be a State or None"),
]


def test_what_is_wrong_is_refused_before_anything_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Dispatch, "all", None)
    monkeypatch.setitem(sys.modules, "xarray", None)  # nor is it named first that this is missing
    rows = [({"over": over}, words) for over, words in BAD_NAMES] + BAD_ARGUMENTS
    other = {"initial": bd.settle(plain().params), "over": {"torque.scale": [1.0]}}
    rows.append((other, "initial.x must have shape"))
    for options, words in rows:
        with pytest.raises((TypeError, ValueError)) as error:
            run(**{"scene": small(), "over": {"belt.length": [1.2]}, **options})
        assert words in str(error.value), options
    with pytest.raises(ImportError, match="xarray"):
        run(small(), {"belt.length": [1.2]})


def test_torques_times_numbers() -> None:
    """In proportion at every speed and time, of each kind, sums by their parts; functions in a
    sweep, which have no fields.
    """
    kinds: list[bd.Torque] = [
        bd.PiecewiseLinear([0.0, 1.0], [0.0, 2.0], pulley=0),
        bd.Viscous([0.5, 1.0]),
        bd.Load(1, coulomb=1.0, viscous=2.0, quadratic=3.0),
        bd.SpeedTable(0, [0.0, 10.0], [1.0, 2.0]),
        bd.Harmonics(0, [1.0, 2.0], [0.5, 0.2]),
        bd.Step(1, 0.2, 3.0),
        bd.Ramp(1, 0.1, 0.4, -3.0),
    ]
    at = (0.3, np.array([0.3, -0.2]), np.array([4.0, -5.0]))
    for torque in [*kinds, bd.TorqueSum(kinds)]:
        for product in (torque * 2.5, 2.5 * torque):
            assert type(product) is type(torque)
            np.testing.assert_allclose(product(*at), 2.5 * torque(*at), rtol=1e-14)
    with pytest.raises(TypeError):
        kinds[0] * "2"  # type: ignore[operator]
    with pytest.raises(ValueError, match="against the rotation"):
        kinds[2] * -1.0
    scene = under_function()
    inner: Any = scene.torque_fn
    found = run(scene, {"torque.scale": SCALES}, "span_tension", t_eval=TIMES)["span_tension"]
    for k, scale in enumerate(SCALES):
        scaled = lambda *at, scale=scale: [scale * one for one in inner(*at)]  # noqa: E731
        result = alone(scene._replace(torque_fn=scaled), t_eval=TIMES)
        assert bits(found[k]) == bits(result.span_tension)
    assert bits(found[0]) != bits(found[2])
    with pytest.raises(ValueError, match="the torque is a function"):
        names.find(scene, "torque[0].values")
