"""What is read off runs, and how well `simulate(verify=True)` knows its own errors."""

from __future__ import annotations

import json
import math
import threading
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from click.testing import CliRunner
from tiers import first

import beltdyn as bd
from beltdyn import cli
from beltdyn.accuracy import QUANTITIES, Observed, differences, observe, with_links
from beltdyn.drive import sanity
from beltdyn.drive.compliance import compliance_error
from beltdyn.outputs.accuracy_report import SPACE_FLOOR, TIME_FLOOR
from beltdyn.verification import verification
from beltdyn.verification.space import space_error

# Coarse meshes are the subject here.
pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

HISTORIES = ("tension", "speed")
FACTOR = 3.0


def on(scene: bd.Scene, mesh: str, links: int | None = None) -> bd.Scene:
    params = drives.on_mesh(scene.params, mesh)
    return scene._replace(params=params if links is None else with_links(params, links))


def short(mesh: str = "joint", links: int = 24) -> bd.Scene:
    """A few milliseconds of computing."""
    return on(drives.plain_scene()._replace(t_end=0.02), mesh, links)


@cache
def verified(mesh: str = "paper", rtol: float = 1e-4) -> bd.Result:
    return bd.simulate(*on(drives.scene_u(), mesh), rtol=rtol, verify=True)


@cache
def verified_short() -> bd.Result:
    return bd.simulate(*short(), verify=True)


def check_ratios(run: bd.Result, exact: bd.Result, part: str, floor: float, most: float) -> None:
    """What a run says of its errors is right to a factor; of means, to ``most`` times that.

    A mean agrees better than its history now and then, which the estimate does not believe.
    """
    seen = observe(run)  # its estimates, too, are relative to the scales of the run
    true = differences(seen, attrs.evolve(observe(exact), scales=seen.scales))
    for name in QUANTITIES:
        ratio = getattr(run.accuracy[name], part) / max(floor, true[name])
        allowed = FACTOR if name in HISTORIES else most * FACTOR
        assert 1.0 / FACTOR <= ratio <= allowed, (name, ratio, true[name])


def observed(scale: float = 1.0, **changes: Any) -> Observed:
    """Invented numbers of two pulleys."""
    scales = dict(tension=100.0, speed=10.0, span_mean=100.0, creep=0.01, friction=50.0, power=60.0)
    values: dict[str, Any] = {
        "tension": np.full((11, 2), 100.0),
        "speed": np.full((11, 2), 10.0),
        "span_mean": np.array([100.0, 100.0]),
        "creep": np.array([0.0, 0.01]),
        "friction": np.array([50.0, -50.0]),
        "power": np.array([60.0, -59.0, 1.0]),
    }
    values = {name: scale * value for name, value in values.items()}
    return Observed(t=np.linspace(0.0, 1.0, 11), scales=scales, **{**values, **changes})


def test_what_is_read_at_rest() -> None:
    """No torque: the spans have the tension of the joints, and nothing else happens."""
    params = drives.on_mesh(drives.plain(), "joint")
    run = bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-3)
    seen = observe(run)
    assert seen.tension.shape == seen.speed.shape == (run.t.size, 2)
    # bending and the arcs' links make the joints differ a little along a belt at rest
    assert seen.span_mean == pytest.approx(np.mean(run.joints.force[0]), rel=0.02)
    assert np.abs(seen.power).max() < 1e-3
    still = attrs.evolve(run.pulleys, omega=0.0 * run.pulleys.omega)
    at_rest = observe(attrs.evolve(run, pulleys=still))
    assert (at_rest.creep == 0.0).all()
    assert at_rest.scales["speed"] == at_rest.scales["power"] == 0.0
    assert set(differences(at_rest, at_rest).values()) == {0.0}
    # the middle of a span is a place, between joints: a force along x is read there
    half = 0.5 * params.info["link_length"]
    x = run.belt.x - half * np.cos(run.belt.phi)  # left ends of the links: joints, at rest
    along = attrs.evolve(run, joints=attrs.evolve(run.joints, force=500.0 + 1000.0 * x))
    assert observe(along).tension == pytest.approx(500.0 + 1000.0 * 0.145, rel=1e-3)
    for last in (0.0, 1.5, -0.1):
        with pytest.raises(ValueError, match="last must be > 0 and <= 1"):
            observe(run, last=last)
    other = with_links(params, 90)  # changes the mesh alone
    assert other.belt.n_bodies == 90 and with_links(other, 60) == params


def test_creep_and_friction_are_those_of_the_drive() -> None:
    """A steady drive: friction carries the torque, and creep is the loss of speed."""
    run = verified("joint")
    seen, late = observe(run), run.t >= 0.8 * run.t[-1]
    radii = np.array([pulley.radius for pulley in run.params.pulleys])
    speed = np.abs(np.mean(run.pulleys.omega[late], axis=0) * radii)
    assert seen.creep.max() == pytest.approx(1.0 - speed.min() / speed.max(), rel=0.02)
    assert (seen.creep >= 0.0).all() and seen.power[2] > 0.0
    # torque and friction balance but for what accelerates the pulleys
    torque = np.mean(run.pulleys.torque[late], axis=0)
    assert seen.friction * radii == pytest.approx(-torque, abs=0.03 * np.abs(torque).max())


def test_differences_are_relative_to_the_scales_of_the_second() -> None:
    a, b, off = observed(), observed(), observed(scale=1.02)
    assert set(differences(a, b).values()) == {0.0}
    found = differences(off, b)
    assert found == pytest.approx(dict.fromkeys(QUANTITIES, 0.02), rel=1e-9)
    assert list(found) == list(QUANTITIES)
    doubled = attrs.evolve(b, scales={name: 2.0 * scale for name, scale in b.scales.items()})
    assert differences(off, doubled)["creep"] == pytest.approx(0.01)
    late = attrs.evolve(a, tension=a.tension + 50.0 * (a.t > 0.55)[:, None])
    assert differences(a, late, until=0.5)["tension"] == 0.0
    assert differences(a, late)["tension"] > 0.3
    with pytest.raises(ValueError, match="same times"):
        differences(a, attrs.evolve(b, t=2.0 * b.t))


def off_by(error: float, other: float = 0.0) -> Observed:
    """Span tensions off by these shares of the mean tension."""
    return observed(span_mean=np.array([100.0 * (1.0 + other), 100.0 * (1.0 + error)]))


def test_a_trend_is_extrapolated() -> None:
    """Errors C/n^p: the finer mesh alone gives p and C; the coarser one assumes order 2."""
    for order in (1.0, 1.5, 2.0):
        error = {ratio: 0.1 * ratio**-order for ratio in (0.5, 1.0, 1.5)}
        coarse, fine = (0.5, off_by(error[0.5])), (1.5, off_by(error[1.5]))
        found, seen = space_error("span_mean", off_by(error[1.0]), coarse, fine)
        richardson = (error[0.5] - error[1.0]) / 3.0
        assert found == pytest.approx(math.sqrt((0.1**2 + richardson**2) / 2.0), rel=1e-2)
        assert seen == pytest.approx(order, rel=1e-2)
    # one other mesh is better than none
    assert space_error("span_mean", off_by(0.1), None, None) == (None, None)
    for meshes in ((None, (1.5, off_by(0.1 * 1.5**-2))), ((0.5, off_by(0.4)), None)):
        found, seen = space_error("span_mean", off_by(0.1), *meshes)
        assert found == pytest.approx(0.1, rel=0.7)
        assert seen is None


def test_meshes_that_agree_by_chance() -> None:
    """Whichever two of three agree, the third shows that the error is not zero."""
    for coarse, run, fine in ((0.1, 0.1, 0.0), (0.3, 0.1, 0.1), (0.2, 0.0, 0.2)):
        found, _ = space_error("span_mean", off_by(run), (0.5, off_by(coarse)), (1.5, off_by(fine)))
        assert found is not None
        assert 0.04 < found < 0.3
    # no order where there is no trend
    others = (0.5, off_by(0.0, 0.2)), (1.5, off_by(0.0, -0.2))
    assert space_error("span_mean", off_by(0.1), *others)[1] is None


@pytest.mark.parametrize("mesh", first(1, ["paper", "joint"]))
def test_the_error_of_the_mesh_is_that_against_a_fine_one(mesh: str) -> None:
    """Drive U with 60 links, against 480: within a factor of three."""
    run = verified(mesh)
    fine = bd.simulate(*on(drives.scene_u(), mesh, 480), rtol=1e-3)
    check_ratios(run, fine, "space", SPACE_FLOOR, 1.0)
    assert run.accuracy.verified
    if mesh == "paper":  # the polygon: tensions converge with order 2
        assert run.accuracy["span_mean"].order == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("rtol", first(1, [1e-2, 1e-3]))
def test_the_error_in_time_is_that_against_a_tight_run(rtol: float) -> None:
    """The reference is by another method than the check; looser tolerances have larger errors."""
    run = verified("paper", rtol)
    exact = bd.simulate(*on(drives.scene_u(), "paper"), method="rodas4", rtol=1e-6)
    check_ratios(run, exact, "time", TIME_FLOOR, 2.0)
    tight = verified("paper").accuracy["tension"].time
    assert tight is not None and run.accuracy["tension"].time > 2.0 * tight


def test_when_the_check_in_time_begins_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the run, by the method that it seems to need; at the end, by the one it does need."""
    found = []
    for begun in (verification.BEGUN, 0.05, 2.0):
        monkeypatch.setattr(verification, "BEGUN", begun)
        scene = on(drives.scene_u()._replace(t_end=0.1), "joint")
        found.append(bd.simulate(*scene, rtol=1e-2, verify=True).accuracy.errors)
    assert found[0] == found[1] == found[2]


def shaken(run: bd.Result) -> float:
    """By how much links that land raise the mean tension, from the velocities that are kept."""
    late = run.t >= run.t[-1] - 0.2 * (run.t[-1] - run.t[0])
    belt, radii = run.belt, np.array([pulley.radius for pulley in run.params.pulleys])
    across = belt.vy * np.cos(belt.phi) - belt.vx * np.sin(belt.phi)
    square = np.mean(np.where(run.contact.pulley < 0, across, 0.0)[late] ** 2)
    rims = np.abs(run.pulleys.omega[late] * radii).max(axis=1)
    speed = math.sqrt(np.mean(rims**2))
    return sanity.shaking_seen(run.params, speed, float(square), float(run.t[-1] - run.t[0]))


@pytest.mark.parametrize("mesh", ["paper", "joint"])
def test_what_shakes_a_belt_is_known_whatever_is_kept(mesh: str) -> None:
    """Of links and, on the other mesh, of the masses of a string."""
    run, bare = (bd.simulate(*short(mesh), outputs=one) for one in (None, ()))
    assert run._running == bare._running
    # of a quarter of the samples there, of all here
    assert bare._running.shaking == pytest.approx(shaken(run), rel=0.03)
    assert {one.quantity for one in bare.accuracy.errors if one.space} == {"tension", "span_mean"}


def test_without_verification_there_is_what_costs_nothing() -> None:
    scene = short("paper")
    run = bd.simulate(*scene)
    known = run.accuracy
    assert not known.verified and known.runs == () and "not verified" in str(known)
    late = run.t >= run.t[-1] - 0.2 * (run.t[-1] - run.t[0])
    torque = np.abs(run.pulleys.torque[late].mean(axis=0))
    radii = np.array([pulley.radius for pulley in scene.params.pulleys])
    shaking = run._running.shaking
    of_mesh = sanity.mesh_error(scene.params, shaking, float(np.max(torque / radii)))
    # means by equal weights here, by the trapezoidal rule there
    assert known["span_mean"].space == pytest.approx(of_mesh["span_mean"], rel=1e-4)
    assert known["span_mean"].space > sanity.mesh_share(scene.params)
    assert known["span_mean"].time == known["tension"].time == run.stats.error
    assert known.local_error == run.stats.local_error and known.balance == run.stats.balance
    of_contact = compliance_error(scene.params)
    assert {one.quantity: one.compliance for one in known.errors} == of_contact
    assert known["speed"].time is known["speed"].space is known["speed"].total is None
    with pytest.raises(KeyError):
        known["colour"]


def test_a_verified_run_is_the_same_and_says_so(tmp_path: Path) -> None:
    plain, run = bd.simulate(*short()), verified_short()
    assert (plain.joints.force == run.joints.force).all()
    assert plain.stats.steps == run.stats.steps
    for one in run.accuracy.errors:
        assert one.time is not None and one.space is not None and one.compliance is not None
        assert one.total == one.time + one.space + one.compliance
        assert one.time >= TIME_FLOOR and one.space >= SPACE_FLOOR
    assert "accuracy, measured" in str(run)
    assert "accuracy, estimated" in str(plain) and "accuracy, measured" not in str(plain)
    assert [text.rpartition(", ")[0] for text in run.accuracy.runs] == [
        "tsit5 at rtol = 1e-05 on the same mesh",  # rodas4 ran it
        "12 links with rodas4 at rtol = 0.001",
        "36 links with auto at rtol = 0.001",
    ]
    run.save(tmp_path / "run.npz")
    assert bd.Result.load(tmp_path / "run.npz").accuracy == run.accuracy


def test_another_method_where_it_is_affordable() -> None:
    """And 6 links for the coarser mesh of 12, two of which would touch both pulleys: it is said."""
    scene = short(links=12)
    for options, check in (
        ({"method": "tsit5"}, "rodas4 at rtol = 1e-05"),
        ({"method": "rodas4"}, "tsit5 at rtol = 1e-05"),
        ({"method": "lbdf2", "rtol": 1e-2}, "tsit5 at rtol = 0.001"),
        ({"method": "lie", "step": 1e-4}, "tsit5 at rtol = 1e-05"),
    ):
        accuracy = bd.simulate(*scene, verify=True, **options).accuracy
        assert accuracy.verified and accuracy.runs[0].startswith(check), options
        assert [note[:7] for note in accuracy.notes] == ["6 links"]
        assert accuracy["span_mean"].space is not None  # from the finer mesh


def test_files_of_earlier_versions_and_crafted_ones(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    bd.simulate(*short()).save(path)
    with np.load(path) as file:
        values = dict(file)
    for is_good, change in (
        (True, lambda meta: meta.pop("accuracy")),
        (False, lambda meta: meta["accuracy"].update(verified=1)),
        (False, lambda meta: meta["accuracy"].update(notes="none")),
        (False, lambda meta: meta["accuracy"]["errors"].pop()),
        (False, lambda meta: meta["accuracy"]["errors"][0].update(time="small")),
        (False, lambda meta: meta["accuracy"]["errors"][0].update(colour=1.0)),
        (False, lambda meta: meta.update(accuracy=None)),
    ):
        meta = json.loads(str(values["meta.json"]))
        change(meta)
        np.savez(path, **{**values, "meta.json": np.array(json.dumps(meta))})
        if is_good:
            assert not bd.Result.load(path).accuracy.verified
            continue
        with pytest.raises(ValueError, match="is not a saved Result: accuracy"):
            bd.Result.load(path)


def test_the_command_line_prints_the_errors(tmp_path: Path) -> None:
    path, out = tmp_path / "drive.toml", tmp_path / "run.npz"
    short().to_toml(path)
    done = CliRunner().invoke(cli.main, ["run", str(path), "--verify", "--out", str(out)])
    assert done.exit_code == 0, done.output
    for words in ("estimated errors", "creep", "of the mesh", "verified by 12 links with rodas4"):
        assert words in done.stdout
    assert bd.Result.load(out).accuracy.verified
    plain = CliRunner().invoke(cli.main, ["run", str(path)])
    assert "estimated errors" not in plain.stdout


def test_functions_of_torque_are_called_here_and_may_fail() -> None:
    """In this thread alone; a verification that fails, or is interrupted, keeps the run."""
    scene, threads, calls = short(), set(), []
    left: float = math.inf
    error: BaseException = RuntimeError("the file of torques is at its end")

    def torque(t: float, theta: Any, omega: Any) -> Any:
        nonlocal left
        left -= 1
        if left < 0:
            raise error
        threads.add(threading.get_ident())
        calls.append(t)
        return scene.torque_fn(t, theta, omega)

    bd.simulate(scene.params, torque, scene.t_end)
    of_one = len(calls)
    run = bd.simulate(scene.params, torque, scene.t_end, verify=True)
    assert run.accuracy.verified and threads == {threading.get_ident()}
    for one, of_core in zip(run.accuracy.errors, verified_short().accuracy.errors, strict=True):
        assert one.space == pytest.approx(of_core.space, rel=0.1, abs=SPACE_FLOOR)
    left = of_one
    run = bd.simulate(scene.params, torque, scene.t_end, verify=True)
    assert run.success and not run.accuracy.verified and run.accuracy.runs == ()
    assert len(run.accuracy.notes) == 3
    assert all("at its end" in note for note in run.accuracy.notes)
    assert run.accuracy["tension"].time == run.stats.error  # what is known without other runs
    assert run.accuracy["speed"].time is None
    left, error = of_one, KeyboardInterrupt()
    with pytest.raises(bd.Interrupted, match="it had itself finished") as caught:
        bd.simulate(scene.params, torque, scene.t_end, verify=True)
    assert caught.value.result is not None
    assert caught.value.result.success and not caught.value.result.accuracy.verified


def test_bad_arguments_are_refused_by_name_and_a_run_that_fails_ends_its_verification() -> None:
    wrong: tuple[dict[str, Any], ...] = (
        {"motion": [1.0]}, {"rtol": "fine"}, {"method": 5}, {"t_eval": ["now"]}, {"verify": "yes"}
    )  # fmt: skip
    for one in wrong:
        with pytest.raises(TypeError, match=f"^{next(iter(one))}"):
            bd.simulate(*short()[:3], **{"verify": True, **one})
    with pytest.raises(bd.SimulationError, match="max_steps"):
        bd.simulate(*short(), max_steps=5, verify=True)
    assert not [one for one in threading.enumerate() if one.name.startswith("beltdyn")]


def test_states_that_settling_gives_are_settled_on_other_meshes() -> None:
    """Other states belong to their links."""
    scene = short()
    rest = bd.settle(scene.params)
    given = bd.simulate(*scene, initial=rest, verify=True).accuracy
    expected = verified_short().accuracy.errors
    assert [one.space for one in given.errors] == [one.space for one in expected]
    running = rest.at_speed(scene.params, {0: -30.0})
    assert bd.simulate(*scene, initial=running, verify=True).accuracy.verified
    half = bd.simulate(*scene[:2], 0.01).final_state
    accuracy = bd.simulate(*scene, initial=half, verify=True).accuracy
    assert not accuracy.verified
    assert accuracy["speed"].time is not None and accuracy["speed"].space is None
    assert any("the initial state is given on 24 links" in note for note in accuracy.notes)


@pytest.mark.ci(guard="test_growth.py::test_a_drive_that_chatters")
def test_histories_that_part_are_judged_up_to_there() -> None:
    """Seen in the difference of two integrations, before the run itself has noticed it.

    Links chatter: contact damping is a tenth of the usual, as in tests/test_growth.py.
    """
    params = drives.plain()
    contact = bd.Contact(linear=2.5e7, damping=100.0)
    belt = attrs.evolve(params.belt, bending_stiffness=0.0)
    params = attrs.evolve(params, contact=contact, belt=belt)
    scene = drives.plain_scene()._replace(params=params, t_end=0.35)
    run = bd.simulate(*scene, verify=True)
    until = run.accuracy.until
    (growth,) = (one.t for one in run.warnings if one.code == "growth")
    assert until is not None and growth is not None and until <= growth
    assert "small differences grow" in str(run.accuracy)
    for name in QUANTITIES:  # means are judged in any case
        assert name in HISTORIES or run.accuracy[name].total is not None
    # a run that verification has not seen agrees up to there, and not beyond
    other = observe(bd.simulate(*scene, method="rodas4", rtol=1e-6))
    seen = observe(run)
    apart = np.abs(seen.tension - other.tension).max(axis=1) / seen.scales["tension"]
    assert apart[seen.t <= until].max() < 0.01
    assert apart[seen.t > until].max() > 0.01
    time = run.accuracy["tension"].time
    assert time is not None and time < 0.005
