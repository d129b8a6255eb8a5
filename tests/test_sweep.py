"""Sweeps: each run is that of simulate, bit for bit, with what its names stand for changed; what is
measured, labelled, refused, and what happens to runs that fail."""

from __future__ import annotations

import json
from typing import Any

import attrs
import numpy as np
import pytest
import xarray as xr
from sweeps import alone, bits, moved, small, with_belt

import beltdyn as bd
from beltdyn.sweeping import names
from beltdyn.sweeping.sweep import run_sweep

pytestmark = pytest.mark.filterwarnings("ignore:long_links")


def run(*args: Any, **options: Any) -> xr.Dataset:
    options = {"progress": False, "executor": 1, **options}
    dataset = bd.sweep(*args, **options)
    assert isinstance(dataset, xr.Dataset)
    return dataset


# --- Numbers --------------------------------------------------------------------------------------


def test_a_grid_is_every_combination_of_runs_by_hand() -> None:
    scene, lengths, factors = small(), [1.198, 1.2], [0.5, 1.0, 2.0]
    found = run(
        scene,
        {"belt.length": lengths, "torque.scale": factors},
        ["pulleys.omega", "span_tension.final", "joints.force"],
    )
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


def by_hand() -> dict[str, tuple[Any, bd.Scene]]:
    """Names, a value, and the scene with it, made without names."""
    scene, moving = small(), moved()
    params, torque = scene.params, scene.torque_fn
    assert isinstance(torque, bd.TorqueSum)
    drive, load = torque.parts
    crank, fan = params.pulleys

    def pulleys(*parts: bd.Pulley) -> bd.Scene:
        return scene._replace(params=attrs.evolve(params, pulleys=parts))

    heavy = [attrs.evolve(one, inertia=0.02) for one in (crank, fan)]
    return {
        "belt.axial_damping": (2.0, with_belt(scene, axial_damping=2.0)),
        "friction.mu_k": (
            0.6, scene._replace(params=attrs.evolve(params, friction=bd.Dahl(mu_k=0.6, sigma=1e4)))
        ),
        "friction": (
            bd.Coulomb(mu=0.5, v_reg=0.01),
            scene._replace(params=attrs.evolve(params, friction=bd.Coulomb(mu=0.5, v_reg=0.01))),
        ),
        "gravity[1]": (-9.81, scene._replace(params=attrs.evolve(params, gravity=(0.0, -9.81)))),
        "pulleys[1].inertia": (0.02, pulleys(crank, heavy[1])),
        "pulleys[fan].inertia": (0.02, pulleys(crank, heavy[1])),
        "pulleys[*].inertia": (0.02, pulleys(*heavy)),
        "torque.scale": (1.5, scene._replace(torque_fn=drive * 1.5 + load * 1.5)),
        "torque[0].scale": (1.5, scene._replace(torque_fn=drive * 1.5 + load)),
        "torque[1].quadratic": (
            2e-3, scene._replace(torque_fn=drive + bd.Load("fan", viscous=0.5, quadratic=2e-3))
        ),
        "torque[0].values[1][0]": (
            -30.0,
            scene._replace(
                torque_fn=bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-30.0, 0.0]]) + load
            ),
        ),
        "torque": (drive, scene._replace(torque_fn=drive)),
        "t_end": (0.001, scene._replace(t_end=0.001)),
        "motion.scale": (
            2.0, moving._replace(motion={0: bd.PiecewiseLinear([0.0, 0.002], [0.0, -10.0])})
        ),
        "motion[crank].scale": (
            2.0, moving._replace(motion={0: bd.PiecewiseLinear([0.0, 0.002], [0.0, -10.0])})
        ),
        "motion[0].values[1][0]": (
            -7.0, moving._replace(motion={0: bd.PiecewiseLinear([0.0, 0.002], [0.0, -7.0])})
        ),
    }  # fmt: skip


@pytest.mark.parametrize("name", by_hand())
def test_a_name_changes_what_it_stands_for(name: str) -> None:
    value, scene = by_hand()[name]
    base = moved() if name.startswith("motion") else small()
    found = run(base, {name: [value]}, "joints.force.final")
    result, before = alone(scene), alone(base)
    assert bits(found["joints.force.final"][0]) == bits(result.joints.force[-1])
    assert bits(result.joints.force[-1]) != bits(before.joints.force[-1])


@pytest.mark.parametrize(
    ("name", "value"), [("rtol", 1e-6), ("method", "rodas4"), ("max_step", 1e-5)]
)
def test_options_of_simulate_are_swept_as_well(name: str, value: Any) -> None:
    found = run(small(), {name: [value]}, ["joints.force.final", "stats.method"])
    result = alone(small(), **{name: value})
    assert bits(found["joints.force.final"][0]) == bits(result.joints.force[-1])
    assert found["stats.method"].values[0] == result.stats.method
    again = run(small(), {"torque.scale": [1.0]}, "joints.force.final", **{name: value})
    assert bits(again["joints.force.final"]) == bits(found["joints.force.final"])


def test_a_preload_takes_the_place_of_a_length() -> None:
    scene = small(0.001)
    found = run(scene, {"belt.preload": [900.0, 1000.0]}, "span_tension.final", rtol=1e-3)
    for preload in (900.0, 1000.0):
        by_hand = with_belt(scene, length=None, preload=preload)
        here = found["span_tension.final"].sel({"belt.preload": preload})
        assert bits(here) == bits(alone(by_hand, rtol=1e-3).span_tension[-1])
    back = run(with_belt(scene, length=None, preload=900.0), {"belt.length": [1.2]}, "stats.steps")
    assert list(back["status"].values) == ["finished"]


def test_factors_come_after_what_they_are_factors_of() -> None:
    """In whatever order they are named."""
    drive = bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-30.0, 0.0]])
    over = {"torque.scale": [2.0], "torque[0].scale": [1.5], "torque": [drive]}
    found = run(small(), over, "pulleys.torque.final", t_end=0.001)
    assert list(found["pulleys.torque.final"].values.ravel()) == [-90.0, 0.0]


def test_mounts_and_cranks_by_name() -> None:
    scene = bd.scenes.tensioned_alternator()._replace(t_end=0.003)
    mounted = scene.params.pulley_names[scene.params.mounted[0]]
    name = f"pulleys[{mounted}].mount.damping"
    found = run(scene, {name: [0.5]}, ["mounts.travel.final"])
    pulleys = list(scene.params.pulleys)
    k = scene.params.mounted[0]
    pulleys[k] = attrs.evolve(pulleys[k], mount=attrs.evolve(pulleys[k].mount, damping=0.5))
    params = attrs.evolve(scene.params, pulleys=pulleys)
    result = alone(scene._replace(params=params))
    assert bits(found["mounts.travel.final"][0]) == bits(result.mounts.travel[-1])
    assert found["mount"].values == [mounted]
    assert found["mounts.travel.final"].attrs["units"] == "rad"


def test_zipped_listed_and_sampled_runs_are_along_one_dimension() -> None:
    over = {"belt.length": [1.198, 1.2], "torque.scale": [0.5, 2.0]}
    grid = run(small(), over, "span_tension.final")
    zipped = run(small(), over, "span_tension.final", combine="zip")
    points = [dict(zip(over, values, strict=True)) for values in zip(*over.values(), strict=True)]
    listed = run(small(), points, "span_tension.final")
    assert zipped["span_tension.final"].dims == ("run", "span")
    for k in range(2):
        assert bits(zipped["span_tension.final"][k]) == bits(grid["span_tension.final"][k, k])
    assert zipped.drop_attrs().identical(listed.drop_attrs())
    assert list(zipped["torque.scale"].values) == [0.5, 2.0]
    samples = bd.sample({"belt.length": (1.195, 1.2), "friction.mu_k": (0.5, 0.9)}, 4, seed=3)
    found = run(small(), samples, "span_tension.final")
    assert bits(found["friction.mu_k"]) == bits(samples.values[:, 1])
    one = attrs.evolve(small().params.friction, mu_k=float(samples.values[2, 1]))
    scene = with_belt(small(), length=float(samples.values[2, 0]))
    scene = scene._replace(params=attrs.evolve(scene.params, friction=one))
    assert bits(found["span_tension.final"][2]) == bits(alone(scene).span_tension[-1])
    assert json.loads(found.attrs["design"])["seed"] == 3


def test_a_warm_start_goes_on_from_the_run_before() -> None:
    """As by hand: the final state, at t = 0, is the start of the next run along that name."""
    scene, factors = small(), [0.5, 1.0, 1.5]
    over = {"torque.scale": factors, "belt.length": [1.198, 1.2]}
    found = run_sweep(
        scene, over, "pulleys.omega.final", warm="torque.scale", executor=1, progress=False
    )
    assert found.settled == 2
    for length in over["belt.length"]:
        before = None
        for factor in factors:
            one = with_belt(scene, length=length)._replace(torque_fn=scene.torque_fn * factor)
            result = alone(one, initial=before)
            before = attrs.evolve(result.final_state, t=0.0)
            here = found.dataset["pulleys.omega.final"]
            here = here.sel({"torque.scale": factor, "belt.length": length})
            assert bits(here) == bits(result.pulleys.omega[-1])


def test_a_run_after_one_that_failed_starts_from_rest() -> None:
    over = {"belt.length": [1.2, 0.2, 1.198]}
    found = run(small(), over, "span_tension.final", warm="belt.length")
    assert list(found["status"].values) == ["finished", "refused", "finished"]
    rest = run(small(), over, "span_tension.final")
    assert bits(found["span_tension.final"][2]) == bits(rest["span_tension.final"][2])


def test_states_are_settled_once_for_runs_that_differ_in_loads() -> None:
    over = {
        "torque.scale": [0.5, 1.0],
        "belt.length": [1.198, 1.2],
        "rtol": [1e-3, 1e-4],
    }
    swept = run_sweep(small(), over, "stats.steps", executor=2, progress=False)
    assert (swept.settled, swept.computed) == (2, 8)


# --- What is measured -----------------------------------------------------------------------------


def test_reductions_are_of_the_last_part() -> None:
    scene = small(0.01)
    found = run(
        scene,
        {"torque.scale": [1.0]},
        [f"pulleys.omega.{how}" for how in ("mean", "least", "most", "rms", "final")],
        last=0.5,
    )
    result = alone(scene)
    inside = result.t >= 0.005 - 1e-12
    t, omega = result.t[inside], result.pulleys.omega[inside]
    lasts = t[-1] - t[0]
    mean = np.trapezoid(omega, t, axis=0) / lasts
    rms = np.sqrt(np.trapezoid(omega**2, t, axis=0) / lasts)
    at = {how: found[f"pulleys.omega.{how}"].values[0] for how in ("mean", "rms")}
    # another order of summing up
    np.testing.assert_allclose(at["mean"], mean, rtol=1e-12)
    np.testing.assert_allclose(at["rms"], rms, rtol=1e-12)
    assert bits(found["pulleys.omega.least"][0]) == bits(omega.min(axis=0))
    assert bits(found["pulleys.omega.most"][0]) == bits(omega.max(axis=0))
    assert bits(found["pulleys.omega.final"][0]) == bits(omega[-1])
    assert found["pulleys.omega.mean"].attrs["units"] == "rad/s"


def test_quantities_of_the_report() -> None:
    scene = small(0.05)
    wanted = [
        "report.pulleys.margin",
        "report.pulleys.speed most",
        "report.pulleys[fan].torque",
        "report.pulleys[0].hub_load",
        "report.spans.tension least",
        "report.creep.lost",
        "report.belt_speed",
        "report.driver",
        "report.powers.power",
    ]
    found = run(scene, {"torque.scale": [1.0]}, {"fans": "report.pulleys[fan].torque"} | {
        name: name for name in wanted
    }).isel({"torque.scale": 0})  # fmt: skip
    report = alone(scene).report()
    assert report.driver is not None
    margins = [row.margin for row in report.pulleys]
    assert bits(found["report.pulleys.margin"]) == bits(
        [np.nan if m is None else m for m in margins]
    )
    assert bits(found["report.pulleys.speed most"]) == bits([p.speed.most for p in report.pulleys])
    assert float(found["report.pulleys[fan].torque"]) == report.pulleys["fan"].torque.mean
    assert float(found["fans"]) == report.pulleys["fan"].torque.mean
    assert float(found["report.pulleys[0].hub_load"]) == report.pulleys["crank"].hub_load.mean
    assert bits(found["report.spans.tension least"]) == bits(
        [s.tension.least for s in report.spans]
    )
    creep = found["report.creep.lost"]
    assert np.isnan(creep.sel(pulley=report.driver))
    assert {row.name: float(creep.sel(pulley=row.name)) for row in report.creep} == {
        row.name: row.lost for row in report.creep
    }
    assert float(found["report.belt_speed"]) == report.belt_speed
    assert str(found["report.driver"].values) == report.driver
    powers = found["report.powers.power"]
    assert {str(name): float(powers.sel(part=name)) for name in powers["part"].values} == {
        row.name: row.power for row in report.powers
    }
    assert found["report.pulleys[fan].torque"].attrs["units"] == "N m"
    whole = run(scene, {"torque.scale": [1.0]}, "report")
    assert {name for name in wanted if "[" not in name} < set(map(str, whole.data_vars))


def test_a_function_gives_numbers_texts_arrays_and_labelled_arrays() -> None:
    def measure(result: bd.Result) -> dict[str, Any]:
        force = result.joints.force[-1]
        return {
            "largest": float(force.max()),
            "count": force.size,
            "word": "tight" if force.max() > 1000.0 else "slack",
            "all": force,
            "both": xr.DataArray(
                force[:2], {"end": ["left", "right"]}, ("end",), attrs={"units": "N"}
            ),
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
    assert bits(found["both"].sel(end="right")[0]) == bits(force[1])
    assert float(found["inside.least"][0]) == force.min()
    assert np.isnan(found["none"]).all()
    named = run(
        small(), over, {"top": lambda result: result.joints.force.max(), "n": "stats.steps"}
    )
    assert {"top", "n"} < set(map(str, named.data_vars))


def test_only_what_is_measured_is_computed() -> None:
    seen: list[bd.Result] = []

    def measure(result: bd.Result) -> float:
        seen.append(result)
        return 0.0

    run(small(), {"torque.scale": [1.0]}, measure)
    assert seen[0].outputs is None
    from beltdyn.sweeping.measure import as_measure

    what = as_measure(
        ["span_tension.mean", "pulleys.omega.final", "stats.steps"], small().params, 0.2
    )
    assert what.outputs == ("span_tension", "pulleys.omega")


# --- Runs that fail -------------------------------------------------------------------------------


def test_runs_that_fail_stop_nothing_and_say_why() -> None:
    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        return [-40.0, 0.0]

    def breaks(t: float, theta: Any, omega: Any) -> list[float]:
        raise ZeroDivisionError("no torque\nfor you")

    scene = small(0.02)
    usual = {"torque": torque, "belt.length": 1.2, "max_steps": None, "gravity[1]": 0.0}
    points = [
        {**usual},
        {**usual, "torque": breaks},
        {**usual, "belt.length": 0.2},
        {**usual, "belt.length": -1.0},
        {**usual, "max_steps": 3},
        {**usual, "gravity[1]": -1e7},
        {**usual, "max_steps": -3},
        {**usual, "torque": "none"},
    ]
    found = run(scene, points, "span_tension.mean")
    status, message = found["status"].values, found["message"].values
    assert list(status) == [
        "finished", "failed", "refused", "refused", "failed", "failed", "refused", "refused"
    ]  # fmt: skip
    finite = np.isfinite(found["span_tension.mean"]).all("span").values
    assert list(finite) == [one == "finished" for one in status]
    for k, words in enumerate(
        ["", "ZeroDivisionError: no torque for you", "too short", "belt.length", "limit of 3 steps",
         "", "max_steps", "torque_fn"]
    ):  # fmt: skip
        assert words in message[k] and (message[k] != "") == (status[k] != "finished")
        assert "\n" not in message[k]
    assert "mesh" in str(found["warnings"].values[0])
    params = attrs.evolve(scene.params, gravity=(0.0, -1e7))
    with pytest.raises(bd.SimulationError) as error:
        bd.settle(params)
    assert message[5] == " ".join(str(error.value).split())


def test_a_measure_that_fails_or_does_not_fit() -> None:
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
    assert said.startswith("KeyError: 'peak' (line ") and said.endswith(
        " of measure, test_sweep.py)"
    )
    assert found["message"].values[2] == ("force has 4 values along 'force_0', 3 in the first runs")
    assert np.isnan(found["force"][1:]).all() and np.isfinite(found["force"][0]).all()


def test_curves_over_other_times_do_not_fit() -> None:
    over = {"t_end": [0.002, 0.001]}
    found = run(small(), over, "pulleys.omega")
    assert list(found["status"].values) == ["finished", "measure"]
    assert "give t_eval" in str(found["message"].values[1])
    found = run(small(), over, "pulleys.omega", t_eval=[0.0, 0.0005, 0.001])
    assert list(found["status"].values) == ["finished", "finished"]


def test_no_run_finished() -> None:
    found = run(small(), {"belt.length": [0.2, 0.3]})
    assert list(found["status"].values) == ["refused", "refused"]


# --- The table ------------------------------------------------------------------------------------


def test_units_texts_and_what_the_sweep_was_of() -> None:
    over = {"belt.length": [1.2], "torque.scale": [1.0], "rtol": [1e-3], "t_end": [0.001]}
    found = run(small(), over, ["span_tension.mean"], method="tsit5")
    units = {name: found[name].attrs.get("units") for name in over}
    assert units == {"belt.length": "m", "torque.scale": "1", "rtol": None, "t_end": "s"}
    assert found["belt.length"].attrs["long_name"] and found["span_tension.mean"].attrs["long_name"]
    assert found["span_tension.mean"].attrs["units"] == "N"
    assert bd.Scene.from_toml(found.attrs["scene"]).t_end == small().t_end
    assert "method = tsit5" in found.attrs["options"]
    assert found.attrs["beltdyn_version"] == bd.__version__
    assert found.attrs["kernels"]


def test_a_table_comes_back_from_a_file(tmp_path: Any) -> None:
    over = {"friction": [bd.Dahl(mu_k=1.0, sigma=1e4), None], "torque.scale": [1, 2]}
    found = run(small(), over, ["span_tension.final", "stats.method", "pulleys.omega"])
    assert found["torque.scale"].dtype.kind == "i"
    found.to_netcdf(tmp_path / "sweep.nc")
    with xr.open_dataset(tmp_path / "sweep.nc") as read:
        xr.testing.assert_equal(read.load(), found)
    assert read.attrs == found.attrs


# --- What is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ({"belt.lenght": [1.2]}, "did you mean 'belt.length'"),
        ({"pulleys[pump].inertia": [1.0]}, "no pulley is called 'pump'"),
        ({"pulleys[7].inertia": [1.0]}, "has 2 entries"),
        ({"torque[2].scale": [1.0]}, "2 part"),
        ({"torque[1].linear": [1.0]}, "not 'linear'"),
        ({"torque.viscous": [1.0]}, 'torque[0].viscous'),
        ({"motion.scale": [1.0]}, "no motion is prescribed"),
        ({"belt.length": []}, "at least one value"),
        ({"belt.length": 1.2}, "a list of values"),
        ({"belt.length": [1.2, 1.2]}, "twice"),
        ({}, "at least one"),
        ([], "at least one"),
        ([{"belt.length": 1.2}, {"torque.scale": 1.0}], "over[1] must name belt.length"),
        ({"pulleys[0].inertia": [1.0], "pulleys[*].inertia": [1.0]}, "a number in common"),
        ({"pulleys[0].inertia": [1.0], "pulleys[crank].inertia": [1.0]}, "a number in common"),
        ({"outputs": [("belt",)]}, "nothing is called 'outputs'"),
        ("belt.length", "over must be"),
    ],
)  # fmt: skip
def test_bad_names_are_refused_before_anything_runs(over: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        run(small(), over)
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"measure": "span_tensoin"}, "did you mean 'span_tension'"),
        ({"measure": "report.pulleys.margn"}, "did you mean 'margin'"),
        ({"measure": "report.pulley.margin"}, "did you mean 'pulleys'"),
        ({"measure": "report.pulleys[pump].margin"}, "no pulley is called 'pump'"),
        ({"measure": "mounts.travel"}, "no mounts"),
        ({"measure": "stats.stepps"}, "did you mean 'steps'"),
        ({"measure": []}, "at least one"),
        ({"measure": {"a": 3}}, "must be a name or a function"),
        ({"measure": 3}, "measure must be"),
        ({"measure": {"status": "span_tension.mean"}}, "'status' is the name of something else"),
        ({"measure": {"belt.length": "slip.mean"}}, "'belt.length' is the name of"),
        ({"t_end": -1.0}, "t_end must be > 0"),
        ({"rtoll": 1e-3}, "did you mean 'rtol'"),
        ({"outputs": ("belt",)}, "follows from measure"),
        ({"method": "rk4", "over": {"method": ["rk4"]}}, "leave one of them out"),
        ({"combine": "both"}, "combine must be"),
        ({"combine": "zip", "over": {"belt.length": [1.0, 2.0], "t_end": [1.0]}}, "as many values"),
        ({"warm": "belt.width"}, "warm must be one of"),
        ({"warm": "belt.length", "combine": "zip"}, "needs a grid"),
        ({"last": 0.0}, "last must be"),
        ({"executor": 0}, "executor"),
        ({"executor": "cluster"}, "executor must be"),
        ({"executor": 1.5}, "executor must be"),
        ({"scene": "no-such-scene"}, "no scene is called"),
        ({"scene": 3}, "scene must be"),
    ],
)
def test_bad_arguments_are_refused_before_anything_runs(
    options: dict[str, Any], words: str
) -> None:
    options = {"scene": small(), "over": {"belt.length": [1.2]}, **options}
    with pytest.raises((TypeError, ValueError)) as error:
        run(**options)
    assert words in str(error.value)


def test_a_function_as_torque_has_a_factor_and_no_fields() -> None:
    def torque(t: float, theta: Any, omega: Any) -> list[float]:
        return [-20.0, 0.0]

    scene = small()._replace(torque_fn=torque)
    found = run(scene, {"torque.scale": [2.0]}, "pulleys.torque.final")
    assert list(found["pulleys.torque.final"].values[0]) == [-40.0, 0.0]
    with pytest.raises(ValueError, match="the torque is a function"):
        names.find(scene, "torque[0].values")


def test_torques_times_numbers() -> None:
    """In proportion at every speed and time, of each kind; sums by their parts."""
    kinds: list[bd.Torque] = [
        bd.PiecewiseLinear([0.0, 1.0], [0.0, 2.0], pulley=0),
        bd.Viscous([0.5, 1.0]),
        bd.Load(1, coulomb=1.0, viscous=2.0, quadratic=3.0),
        bd.SpeedTable(0, [0.0, 10.0], [1.0, 2.0]),
        bd.Harmonics(0, [1.0, 2.0], [0.5, 0.2]),
        bd.Step(1, 0.2, 3.0),
        bd.Ramp(1, 0.1, 0.4, -3.0),
    ]
    whole = bd.TorqueSum(kinds)
    at = (0.3, np.array([0.3, -0.2]), np.array([4.0, -5.0]))
    for torque in [*kinds, whole]:
        for product in (torque * 2.5, 2.5 * torque):
            assert type(product) is type(torque)
            np.testing.assert_allclose(product(*at), 2.5 * torque(*at), rtol=1e-14)
    with pytest.raises(TypeError):
        kinds[0] * "2"  # type: ignore[operator]
    with pytest.raises(ValueError, match="against the rotation"):
        kinds[2] * -1.0
