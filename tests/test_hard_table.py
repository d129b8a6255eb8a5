"""The table of hard scenes in small (`benchmarks/hard.py`): every method, each scene's own belt."""

from __future__ import annotations

import functools

import attrs
import hard_outcome
import pytest
from hard_outcome import Judge, Outcome

import beltdyn as bd

GUARD = "test_hard.py::test_hard_scenes_end_as_they_must"
METHODS = ("auto", "tsit5", "rk4", "rodas4", "lbdf2", "lie")
#: Steps of a method that nobody chose for the scene; the default one has the budget it should need.
MOST = 20_000


@functools.cache
def outcomes(name: str) -> dict[str, Outcome]:
    judge, found = Judge(bd.scenes.hard[name]), {}
    for method in METHODS:
        budget = judge.budget(method)
        run = judge.run(method, budget if method == "auto" else min(budget, MOST))
        found[method] = judge.judge(run)
    return found


@pytest.mark.extended(guard=GUARD)
@pytest.mark.parametrize("name", bd.scenes.hard)
def test_no_method_is_wrong_without_a_word(name: str) -> None:
    """Each is right within its claim, warns, ends in an error by name or within its steps."""
    for method, one in outcomes(name).items():
        assert one.kind not in ("quiet", "broken"), f"{method}: {one}"


@pytest.mark.extended(guard=GUARD)
def test_the_default_method_solves_nearly_all() -> None:
    kinds = {name: outcomes(name)["auto"].kind for name in bd.scenes.hard}
    others = {name: kind for name, kind in kinds.items() if kind != "solved"}
    assert len(others) <= 0.05 * len(kinds), others


def test_the_judge_tells_what_is_wrong() -> None:
    """Forces off by a hundredth without a word are quiet, a friction beyond its bound is broken.

    A claim of ten times the tension, with a warning, is not solved by being kept.
    """
    judge = Judge(bd.scenes.hard["sigma-1e6"])
    run = judge.run("auto")
    assert judge.judge(run).kind == "solved"
    assert judge.judge(attrs.evolve(run, force=1.01 * run.force)).kind == "quiet"
    warned = attrs.evolve(run.outcome, warnings=("chatter",))
    off = attrs.evolve(run, force=1.01 * run.force, outcome=warned)
    assert judge.judge(off).kind == "said"
    warned = attrs.evolve(run.outcome, warnings=("undamped",), claim=10.0)
    assert judge.judge(attrs.evolve(run, outcome=warned)).kind == "said"
    result = judge.scene.run()
    for part, changes in {
        "contact": {"mu": 1.1 * result.contact.mu, "normal": -result.contact.normal},
        "energy": {"joint_loss": -result.energy.joint_loss},
    }.items():
        for name, values in changes.items():
            group = attrs.evolve(getattr(result, part), **{name: values})
            assert hard_outcome.worst(attrs.evolve(result, **{part: group}))[0] > 1.0, name
    assert hard_outcome.worst(result)[0] <= 1.0


def test_random_drives_stand() -> None:
    """What `benchmarks/claims.py --many` asks of 1e5: invariants kept, or an error by name."""
    kinds = [hard_outcome.stands(seed)["kind"] for seed in range(6)]
    assert "kept" in kinds and "broken" not in kinds
