"""What explain says may be left out: the removals, the bounds, and whether advice holds."""

from __future__ import annotations

import math
from itertools import permutations
from types import SimpleNamespace
from typing import Any
from unittest import mock

import attrs
import drives
import numpy as np
import pytest

import beltdyn as bd
from beltdyn.base.run_warnings import silenced
from beltdyn.drive.balance import tension_held
from beltdyn.explaining import ablation, run_length
from beltdyn.explaining.ablation import Answers, LeftOut, answers_of, changes_of, growth_of
from beltdyn.explaining.removals import Removal, leave_out, removals_of
from beltdyn.explaining.run_length import Timed

#: So much that the whole run is the window, however slow the machine.
ENOUGH = 500.0


def rich(speed: float = -60.0) -> bd.Scene:
    """Return a drive of which nearly everything can be left out. Few links land below 50 rad/s."""
    plain = drives.plain()
    changes = {"length": None, "n_bodies": 30, "bending_stiffness": 0.02, "bending_damping": 1e-6}
    arm = bd.Arm(
        pivot=(0.2, -0.1), inertia=2e-3, mass=0.1, stops=(-0.2, 0.2), friction=0.4, damping=0.1
    )
    arm = attrs.evolve(arm, stiffness=200.0, preload=-90.0)
    law = bd.LuGre(mu_k=0.8, mu_s=0.9, v_stribeck=0.01, sigma=1e4, viscous=1e-3)
    drag = bd.Drag(coulomb=0.01, viscous=1e-4, quadratic=1e-6)
    params = bd.Params(
        belt=attrs.evolve(plain.belt, mesh="joint", **changes),
        pulleys=(
            attrs.evolve(plain.pulleys[0], friction=law),
            attrs.evolve(plain.pulleys[1], drag=drag, mount=arm),
        ),
        friction=bd.Dahl(mu_k=0.8, sigma=1e4),
        gravity=(0.0, -9.81),
    )
    torque = bd.Viscous([0.0, 1.0]) + bd.Harmonics(1, [2.0], [0.5])
    crank = bd.CrankMotion(speed, [2.0], [0.005], fade=(0.5, 1.0))
    return bd.Scene(params, torque, 0.04, {0: crank})


EVERYTHING = {
    "belt.axial_damping", "belt.bending_stiffness", "belt.bending_damping", "contact.damping",
    "friction.viscous", "drag.coulomb", "drag.viscous", "drag.quadratic", "mount.mass",
    "mount.damping", "mount.friction", "gravity", "Stribeck curve", "harmonics of the crank",
    "harmonics of torques", "motion of mounts", "finer friction law", "landing links",
}  # fmt: skip


def test_each_removal_takes_away_its_own_effect_alone() -> None:
    """Everything that is there can be left out, in any order."""
    scene = rich()
    there = {one.name: one for one in removals_of(scene)}
    assert there.keys() == EVERYTHING
    for name, removal in there.items():
        left = removal.apply(scene)
        gone = {
            "motion of mounts": {name, "mount.mass", "mount.damping", "mount.friction"},
            "finer friction law": {name, "friction.viscous"},
        }
        assert EVERYTHING - {one.name for one in removals_of(left)} == gone.get(name, {name})
        left.check()
    bare = leave_out(scene, removals_of(scene))
    assert not removals_of(bare)
    assert bare.params.pulleys[1].mount is None and bare.params.gravity == (0.0, 0.0)
    assert bare.params.friction_on(0).mu_s == 0.8  # type: ignore[union-attr]
    some = [there[name] for name in ("drag.viscous", "gravity", "Stribeck curve")]
    assert len({leave_out(scene, group).to_toml() for group in permutations(some)}) == 1
    # fixed axes stand where the belt rests
    fixed = there["motion of mounts"].apply(scene)
    assert np.allclose([p.center for p in fixed.params.pulleys], scene.params.centers())
    assert fixed.params.belt.length == scene.params.info["length"]


@pytest.mark.parametrize("name", ["unequal-pulleys", "tensioned-alternator"])
def test_a_belt_without_bending_keeps_its_tension_at_rest(name: str) -> None:
    """Whether its length makes it, to the 0.1 % that a preload has, or the spring of an arm."""
    scene = bd.scenes.get(name)
    (bending,) = (one for one in removals_of(scene) if one.name == "belt.bending_stiffness")
    left = bending.apply(scene).params
    assert left.belt_model == "string" and "at the same tension at rest" in bending.how

    def at_rest(params: bd.Params) -> float:
        stiffness = params.belt.bending_stiffness
        held = tension_held(params.effective_pulleys, params.gravity, stiffness)
        return float(params.info["mean_tension"]) if held is None else held

    assert at_rest(left) == pytest.approx(at_rest(scene.params), rel=1e-3)


def test_bounds() -> None:
    """Changes are over the scales; growth is the largest of the last two fifths over that of the
    first three, 1 to 10; what may go adds up to less than the error.
    """

    def answers(*tension: float) -> Answers:
        """Of one span: mean tensions over the whole and the fifths; all else the same."""
        values = dict.fromkeys(ablation.ANSWERS, np.ones((6, 1)))
        values["tension, mean"] = np.array(tension)[:, None]
        return Answers(values=values, scales={"tension": 100.0, "speed": 0.0})

    base = answers(*[10.0] * 6)
    changes = changes_of(answers(11.0, 10.0, 10.0, 12.0, 10.0, 10.0), base)
    assert changes["tension, mean"] == pytest.approx([0.01, 0.0, 0.0, 0.02, 0.0, 0.0])
    assert not changes["speed, mean"].any()  # of a drive that stands still, too
    assert np.all(np.isinf(changes_of(answers(*[math.nan] * 6), base)["tension, mean"]))
    for fifths, growth in (
        ([1, 2, 1, 3, 6], 3.0), ([1, 2, 4, 3, 2], 1.0),
        ([0, 0, 1, 2, 30], 10.0), ([0, 0, 0, 0, 1], 10)
    ):  # fmt: skip
        assert growth_of({"tension, mean": np.array([9.0, *fifths])}) == growth
    rows = [
        LeftOut(name=name, how="", change={}, worst=bound, growth=1.0, bound=bound, cpu_time=0.0,
                error=bound, end=1.0, exercised=name != "d", may_be_left_out=True,
                warned=("growth",) * (name == "e"), failed="")
        for name, bound in (("a", 0.006), ("b", 0.001), ("c", 0.004), ("d", 0.0), ("e", 0.0))
    ]  # fmt: skip
    assert ablation.removals_that_may_go(rows, 0.01) == ["b", "c"]
    assert ablation.removals_that_may_go(rows, 0.011) == ["b", "c", "a"]
    slower = [attrs.evolve(row, cpu_time=1.0 if row.name == "b" else -0.1) for row in rows]
    assert ablation.removals_that_may_go(slower, 0.005) == ["c"]
    assert ablation.removals_that_may_go(rows, 0.003, safety=4.0) == ["b", "c", "a"]


def test_answers_of_a_run_that_is_known() -> None:
    """A pulley under a constant torque, free of the belt's friction: omega = M t / I."""
    params, _, _, _ = bd.scenes.kubas_case_1()
    free = attrs.evolve(params, friction=None)
    torque, inertia = 3.0, free.pulleys[1].inertia
    with silenced():  # 60 links of the paper's mesh are few, which is no matter here
        result = bd.simulate(free, bd.PiecewiseLinear([0.0], [[0.0, torque]]), 0.01)
    seen = answers_of(result)
    last = torque * 0.01 / inertia
    assert seen.scales["speed"] == pytest.approx(last, rel=1e-9)
    middles = [0.5, 0.1, 0.3, 0.5, 0.7, 0.9]
    assert seen.values["speed, mean"][:, 1] == pytest.approx(np.array(middles) * last, rel=1e-9)
    # samples at the edges of the fifths belong to both
    lengths = np.array([1.0, 0.2, 0.2, 0.2, 0.2, 0.2])
    assert seen.values["speed, range"][:, 1] == pytest.approx(lengths * last, rel=6e-3)


def explain_untimed(scene: bd.Scene) -> bd.Explanation:
    """Explain it, whatever the CPU times measured: a busy machine must not choose what may go."""
    with mock.patch.object(ablation, "NO_GAIN", math.inf):
        return bd.explain(*scene[:4], error=0.05, budget=ENOUGH)


@pytest.fixture(scope="module")
def explained() -> bd.Explanation:
    return explain_untimed(rich())


def test_rows_are_bounds_of_what_was_seen(explained: bd.Explanation) -> None:
    """What did not act is named so: the crank's harmonics fade in after the window."""
    found = explained.ablation
    assert found is not None and explained.window.end == explained.window.asked
    assert found.rounds == 3 and "of one run each" not in str(explained)
    for one in found.rows:
        assert not one.failed, one.failed
        assert set(one.change) == set(ablation.ANSWERS)
        assert one.bound >= 4.0 * max(one.change.values()) + 2.0 * found.own_error
        if not one.warned:
            assert one.error == pytest.approx(one.worst + 2.0 * found.own_error)
        assert one.may_be_left_out == (one.exercised and one.error <= 0.05)
        assert math.isfinite(one.cpu_time)
    rows = {one.name: one for one in found.rows}
    # without damping, links that land on a pulley vibrate on its contact: that is warned of
    damping = rows["contact.damping"]
    assert "undamped" in damping.warned and math.isinf(damping.bound)
    assert not damping.may_be_left_out
    crank = rows["harmonics of the crank"]
    assert not crank.exercised and crank.worst == 0.0 and "Not exercised" in str(explained)
    assert rows["gravity"].exercised and rows["mount.friction"].exercised
    # sets grow with the error; each is a run of its own, over all of the run
    assert found.sets[0][0] == 0.05
    for error, names, row in found.sets:
        assert row.error <= error and row.end == explained.window.asked
        assert all(one.error <= error for one in found.rows if one.name in names)
    level, names, row = found.sets[0]
    for cpu_time in (-0.2, 0.2):
        sets = ((level, names, attrs.evolve(row, cpu_time=cpu_time)),)
        told = str(attrs.evolve(explained, ablation=attrs.evolve(found, sets=sets)))
        assert ("At 5 % no CPU time is saved: nothing is gained." in told) == (cpu_time > 0.0)
    told = str(attrs.evolve(explained, ablation=attrs.evolve(found, sets=())))
    said = "In the window of the table each of these may be left out at an error of 50 % or less: "
    assert said in " ".join(told.split())
    sizes = [len(names) for _, names, _ in found.sets]
    assert sizes == sorted(set(sizes)) and set(found.advice) < rows.keys()
    assert explained.without("gravity").params.gravity == (0.0, 0.0)
    with pytest.raises(ValueError, match=r"name must be one of belt\.axial_damping, "):
        explained.without("nothing")


def test_runs_that_fail_or_end_with_the_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time that is spent, runs that would take many times the steps of the first, and drives that
    do not run without an effect.
    """
    scene = bd.scenes.kubas_case_1()._replace(t_end=1e-3)

    def ablate(left: float, limit: int = 1) -> ablation.Ablation:
        def run(scene: bd.Scene, *_: float, max_steps: int | None, **__: Any) -> Timed:
            with silenced():
                return Timed(bd.simulate(*scene, max_steps=max_steps and max_steps // limit), 1.0)

        drive: Any = SimpleNamespace(scene=scene, run=run)
        return ablation.ablate(drive, mock.Mock(end=1e-3), 0.5, lambda: left)

    none = ablate(0.0)
    assert {one.failed for one in none.rows} == {"the budget is spent"}
    assert none.runs == 2 and none.rounds == 1 and none.advice == () and none.together is None
    monkeypatch.setattr(ablation, "MOST_STEPS", 1)
    some = ablate(0.5, 4)
    assert all("the limit of" in one.failed for one in some.rows)
    fails = mock.Mock(side_effect=ValueError("there is nothing left"))
    monkeypatch.setattr(ablation, "removals_of", lambda _: (Removal("all", "nothing", fails),))
    found = bd.explain(*scene, budget=ENOUGH)
    assert found.ablation is not None and not found.ablation.advice
    (one,) = found.ablation.rows
    assert one.failed == "there is nothing left" and not one.may_be_left_out
    assert "there is nothing left" in str(found)


def test_runs_begin_as_those_of_simulate_and_each_drive_is_settled_once() -> None:
    """Three rounds of runs, and one at a tighter tolerance, settle a drive once, at the speed with
    which a motion begins.
    """
    speed = bd.PiecewiseLinear([0.0], [30.0])
    scene = bd.scenes.kubas_case_1()._replace(t_end=1e-3, motion={0: speed})
    with mock.patch.object(run_length, "settle", wraps=bd.settle) as settle, silenced():
        found = bd.explain(*scene[:4], budget=ENOUGH).ablation
        drives = [(call.args[0], *call.kwargs["speed"].items()) for call in settle.call_args_list]
        assert found is not None and found.rounds == 3 and found.runs > 3 * len(found.rows)
        assert len(drives) == len(set(drives)) > len(found.rows)  # those of sets, too
        drive = run_length.Drive(scene=scene, rtol=1e-3, method="tsit5")
        own = bd.simulate(*scene, rtol=1e-3, method="tsit5")
        run = drive.run(scene, 1e-3).result
    assert np.array_equal(run.joints.force, own.joints.force)


@pytest.mark.ci(guard="test_ablation.py::test_rows_are_bounds_of_what_was_seen")
def test_advice_holds_over_a_longer_run_and_under_more_load() -> None:
    """Within the bounds for other runs, together and each for itself."""
    explained = explain_untimed(rich(speed=-20.0))
    found = explained.ablation
    assert found is not None and found.together is not None and len(found.advice) >= 5

    def answers(scene: bd.Scene) -> Answers:
        more = scene.torque_fn + bd.Viscous([0.0, 0.7])  # to 1 N m s
        with silenced():  # of the mesh, which is the same in all
            return answers_of(bd.simulate(scene.params, more, 0.15, scene.motion, rtol=1e-3))

    base = answers(explained.scene)
    cases = [(found.advice, found.together.bound)]
    cases += [((one.name,), one.bound) for one in found.rows if one.may_be_left_out]
    for names, bound in cases:
        changes = changes_of(answers(explained.without(*names)), base)
        assert max(float(change[0]) for change in changes.values()) < bound, names


def test_a_part_of_a_run_ranks_and_a_longer_one_confirms() -> None:
    """What goes is tried over more of the run than ranks the effects, all of it here."""
    scene = bd.scenes.kubas_case_1()._replace(t_end=4e-3)
    params = attrs.evolve(scene.params, gravity=(0.0, -9.81))
    scene = scene._replace(params=params)
    ends = []

    def run(scene: bd.Scene, end: float, tighter: float, **_: Any) -> Timed:
        ends.append(end)
        with silenced():
            result = bd.simulate(*scene._replace(t_end=end), rtol=1e-3 * tighter)
        seconds = 1.0 if scene.params == params else 0.5  # what is left out saves time
        stats = attrs.evolve(result.stats, cpu_time=seconds)
        return Timed(attrs.evolve(result, stats=stats), seconds)

    drive: Any = SimpleNamespace(scene=scene, run=run)
    window: Any = SimpleNamespace(end=1e-3, reached_in=lambda _: 4e-3)
    found = ablation.ablate(drive, window, 0.5, lambda: 100.0)
    assert {row.end for row in found.rows} == {1e-3} and ends.count(1e-3) == 2 + len(found.rows)
    assert found.sets and {row.end for _, _, row in found.sets} == {4e-3}
    assert found.runs == len(ends)
