"""Hard scenes end in one of two ways: a result within what theory allows, or the error expected."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from click.testing import CliRunner
from tiers import OTHERS

import beltdyn as bd
from beltdyn.base import run_warnings
from beltdyn.cli.commands import main
from beltdyn.scenes.hard_scenes import HardScene

HARD = bd.scenes.hard
#: One of each family, and of errors; the others that end in one are those of test_guards.py.
DEFAULT = (
    "sigma-1e8", "axial-damping-x1000", "contact-x1e4", "no-preload", "full-slip", "stops-hit-hard",
    "idler-that-just-touches", "whip", "in-kilometres",
)  # fmt: skip

#: What must be among the scenes, and where it is.
COVERED = {
    "sigma 1e6 to 1e8": "sigma-1e6 sigma-1e7 sigma-1e8",
    "sigma tiny": "sigma-tiny",
    "mu_k 0, 0.01, 3": "mu-0 mu-0.01 mu-3",
    "Stribeck curves that fall steeply": "stribeck-dahl stribeck-coulomb",
    "reversals within one step": "reversal-within-a-step",
    "sliding exactly at v_T = 0": "slip-velocity-0",
    "every friction law at its stiffest": "sigma-1e8 lugre-stiff elastic-plastic-stiff "
    "maxwell-slip-stiff coulomb-steep creep-rate-steep threlfall-steep",
    "axial damping 0 and x1000": "no-axial-damping axial-damping-x1000",
    "EI 0 and large": "bending-0 bending-large",
    "mass ratio 1e3 between belt and pulleys": "pulleys-1000-times-lighter "
    "pulleys-1000-times-heavier light-pulleys-sigma-1e8",
    "belt of hardly any mass": "massless-belt",
    "4, 5, 15, 3840 links": "links-4 links-5 links-15 links-3840",
    "contact stiffness x1e4 and x1e-3": "contact-x1e4 contact-x1e-3",
    "contact damping x100": "contact-damping-x100 contact-undamped",
    "grazing and bouncing contact": "grazing bouncing bouncing-hunt-crossley",
    "no preload, slack spans, thrown off": "no-preload 1-newton slack-span thrown-off "
    "thrown-apart thrown-through",
    "locked pulley and full slip": "locked-pulley full-slip",
    "torque step, impulse, noise": "torque-step impulse noise",
    "reversal at full slip": "reversal-in-full-slip",
    "dry drag at standstill": "dry-drag",
    "radii 1 : 20": "radii-1-to-20",
    "a pulley of nearly no inertia": "pulley-of-no-inertia",
    "stops hit hard, soft arms": "stops-hit-hard soft-arm light-arm",
    "weights that swing, dry pivots, paths that jump": "swinging-weight dry-pivot path-that-jumps",
    "crossed and back-side drives": "crossed back-side",
    "an idler that only just touches": "idler-that-just-touches",
    "5000 turns": "5000-turns",
    "10 000 1/min, centrifugal lift-off": "10000-rpm lift-off",
    "near the critical speed": "critical-speed moving-string",
    "a whipping slack span": "whip",
    "a start with an inconsistent state": "start-with-pulley-turning start-out-of-place",
    "huge steps": "huge-steps",
    "an hour at low accuracy": "an-hour",
    "parameters in km or um": "in-kilometres in-micrometres",
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in DEFAULT else pytest.mark.ci(guard=OTHERS))
        for name in HARD
    ],
)
def test_hard_scenes_end_as_they_must(name: str) -> None:
    """By "auto". Where an error is expected it names time and reason, and has what was computed."""
    scene = HARD[name]
    with run_warnings.silenced():
        if scene.expects is not None:
            with pytest.raises(bd.SimulationError) as caught:
                scene.run()
            assert caught.value.symbol == scene.expects and math.isfinite(caught.value.t)
            assert (caught.value.result is None) == (scene.expects == "BD_ERR_NOT_SETTLED")
            return
        result = scene.run()
        off = scene.deviation(result)
    assert off is not None and off <= 1.0
    for values in (result.joints.force, result.belt.x, result.pulleys.omega, result.contact.normal):
        assert np.all(np.isfinite(values))
    assert np.all(result.contact.normal >= 0.0)


def test_every_kind_of_hard_case_is_there() -> None:
    """Named in full, told in sentences, each a scene that `simulate(*scene)` takes."""
    named = {name for names in COVERED.values() for name in names.split()}
    assert named == set(HARD) and len(HARD) >= 60
    assert len({HARD[name].family for name in DEFAULT}) == 8
    families = [scene.family for scene in HARD.values()]
    assert sorted(families, key=families.index) == families and len(set(families)) == 8
    for name, scene in HARD.items():
        assert isinstance(scene, bd.Scene) and scene.name == name
        assert scene.provokes.endswith(".") and scene.holds.endswith(".")
        scene.check()
        again = pickle.loads(pickle.dumps(scene))._replace(t_end=1.0)
        assert (again.name, again.holds, again.t_end) == (name, scene.holds, 1.0)
        for model in ("joint", "string", "paper"):
            try:
                other = scene.with_belt(model)
            except ValueError as refused:  # links of the paper's mesh that are too long
                assert model == "paper" and "belt." in str(refused), name
                continue
            assert other is None or isinstance(other, HardScene)
    with pytest.raises(ValueError, match="model must be one of joint, string, paper"):
        scene.with_belt("rope")
    with pytest.raises(ValueError, match=r"no hard scene is called 'sigma' \(did you mean 'sigma-"):
        bd.scenes.find("hard/sigma")


def test_hard_scenes_on_the_command_line() -> None:
    """Listed by family with what they provoke; run from where they begin, with their options.

    An error in which a scene must end is told, with what it provokes, and is no failure.
    """

    def call(*arguments: str) -> tuple[int, str]:
        done = CliRunner().invoke(main, arguments)
        return done.exit_code, done.output

    code, listed = call("scenes", "--hard")
    words = " ".join(listed.split())
    assert code == 0 and words.startswith(f"{len(HARD)} scenes ")
    assert all(f" {name} {HARD[name].provokes}" in words for name in HARD)
    ends = sum(scene.expects is not None for scene in HARD.values())
    assert words.count("[ends in an error]") == ends
    assert max(map(len, listed.splitlines())) <= 96
    code, listed = call("scenes", "--hard", "layouts")
    assert code == 0 and "crossed" in listed and "sigma-1e6" not in listed
    code, said = call("run", "hard/impulse", "--t-end", "0.003")
    assert code == 0 and f"{HARD['impulse'].holds}\nkept     deviation 0." in said
    code, said = call("run", "hard/thrown-off")
    assert code == 0 and "no longer runs round pulley 1 by t =" in said
    assert HARD["thrown-off"].told in said and "BD_ERR_OFF_PULLEY, as it must" in said
    assert call("run", "hard/thrown-off", "--method", "rk4", "--step", "1e-3")[0] == 1
    code, said = call("run", "hard/whip", "--error", "0.1")
    assert code == 2 and "leave --error and --budget out" in said
    assert call("show", "hard/whip")[0] == 0
