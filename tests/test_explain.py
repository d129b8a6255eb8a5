"""``bd.explain``: the effects of a drive and what calls for them, the state, the passes of a step.

Times are only asked to be times: what they are is measured by ``benchmarks/explain.py``.
"""

from __future__ import annotations

import json
from typing import Any
from unittest import mock

import attrs
import drives
import pytest
from click.testing import CliRunner
from laws import EXAMPLES, STRIBECK
from module_common import INF, make_simulation, same_bits

import beltdyn as bd
from beltdyn import _core, cli
from beltdyn.explaining.effects import parts_of

PARAMS, TORQUE, _, _ = bd.scenes.kubas_case_1()


def quickly(params: bd.Params, torque: Any = TORQUE, t_end: float = 2e-3, **more: Any) -> Any:
    return bd.explain(params, torque, t_end, budget=0.05, **more)


@pytest.fixture(scope="module")
def explained() -> bd.Explanation:
    scene = bd.scenes.get("tensioned-alternator")
    return bd.explain(*scene._replace(t_end=0.01), budget=0.3)


def reasons(explanation: bd.Explanation) -> str:
    return "\n".join(line for effect in explanation.effects for line in effect.because)


def test_every_effect_says_what_calls_for_it() -> None:
    """Every group of parameters calls for something, but the pulleys' own: radius and inertia."""
    words = {word for _, asked_by in _core.EFFECTS for word in asked_by.split()}
    groups = {row[0] for row in _core.PARAMETERS} - {name for name, *_ in _core.LAWS}
    assert words == groups - {"pulley"} | {"gravity", "motion", "torque", "friction", "path"}


def timed(model: Any, rest: Any, *torque: Any, **options: Any) -> _core.Simulation:
    """Make a run at its start, of which the passes of a step can be timed."""
    sim = make_simulation(model, rest, *torque, **options)
    with pytest.raises(RuntimeError, match="has made a step"):
        sim.time_passes(3)
    sim.advance(0.0)
    return sim


@pytest.mark.parametrize(
    ("method", "rates", "solutions"),
    # The last stage of an explicit method is the first of the next step (tsit5: Tsitouras 2011, 7
    # stages; rk4: 4). rodas4: Hairer, Wanner, 6 stages, the first with the rate that is known, one
    # rate at the end. BDF, linearly implicit: one of each.
    [("tsit5", 6, 0), ("rk4", 4, 0), ("rodas4", 6, 6), ("lbdf2", 1, 1), ("lie", 1, 1)],
)
def test_passes_are_those_of_the_plan_in_order(
    method: str, rates: int, solutions: int, model: Any, rest: Any
) -> None:
    sim = timed(model, rest, method=method)
    before = sim.state()
    *passes, whole = sim.time_passes(3)
    of_plan = [name for name in sim.passes if name != "energy ledger"]
    split = ["contact: normal force", "contact: friction"]
    expected = [one for name in of_plan for one in (split if "contact" in name else [name])]
    assert [name for name, _, _ in passes if name in expected] == expected
    calls = {name: calls for name, calls, _ in passes}
    assert {calls[name] for name in expected} == {rates}
    assert calls.get("solution of the linear system", 0) == solutions
    assert ("Jacobian" in calls) == ("factorisation" in calls) == (solutions > 0)
    assert calls["energy ledger"] == whole[1] == 1
    # differences of two measured times may come out below 0 where nothing is to be paid
    free = ("energy ledger", *split)
    assert all(seconds > 0.0 for name, _, seconds in passes if name not in free)
    assert whole[0] == "whole step" and whole[2] > 0.0
    assert same_bits(sim.state(), before)
    for rounds in (0, 102, 10**12, -5):
        with pytest.raises(ValueError, match="rounds must be from 1 to 101"):
            sim.time_passes(rounds)
    with pytest.raises(TypeError):
        sim.time_passes(1.5)
    assert sim.advance(INF) is True


def test_an_exception_of_a_torque_comes_out_unchanged(model: Any, rest: Any) -> None:
    torque = mock.Mock(return_value=[0.0, 0.0])
    sim = timed(model, rest, [("call", torque)])
    torque.side_effect = LookupError("no such torque")
    with pytest.raises(LookupError, match="no such torque"):
        sim.time_passes(3)
    with pytest.raises(RuntimeError, match="has made a step"):
        _core.Simulation.settle(model).time_passes(3)


def test_effects_that_are_on_are_those_of_a_run(explained: bd.Explanation) -> None:
    result = bd.simulate(*bd.scenes.get("tensioned-alternator")._replace(t_end=1e-3))
    assert [effect.name for effect in explained.effects if effect.on] == [
        name for name in result.effects if name != "energy ledger"
    ]
    off = {effect.name for effect in explained.effects if not effect.on}
    assert off <= {name for name, _ in _core.EFFECTS}


def test_every_number_that_calls_for_an_effect_is_named(explained: bd.Explanation) -> None:
    params = bd.scenes.get("tensioned-alternator").params
    text = reasons(explained)
    seen = 0
    for part in parts_of(params):
        for field in attrs.fields(type(part.part)):
            rule, value = field.metadata.get("rule"), getattr(part.part, field.name)
            how_much = ("length", "preload", "n_bodies", "linear_density", "compensate")
            shown = {name for name, *_ in part.part._rows()}
            if rule is None or field.name in how_much or field.name not in shown:
                continue
            named = f"{part.path}.{field.name} = {rule.quantity(value)}"
            assert (named in text) == (value != 0.0), named
            seen += named in text
    assert seen > 10  # of belt, contact, friction and arm
    motion = 'motion of pulley "crank": piecewise linear, 2 time(s) from 0 to 0.1 s, 0 to 100 rad/s'
    assert motion in text.splitlines()


def test_an_effect_goes_when_its_number_does() -> None:
    drag = attrs.evolve(PARAMS.pulleys[1], drag=bd.Drag(viscous=2e-4))
    with_both = attrs.evolve(PARAMS, gravity=(0.0, -9.81), pulleys=(PARAMS.pulleys[0], drag))

    def start_up(t: float, theta: Any, omega: Any) -> list[float]:
        return [-50.0 * t, -16.0 * omega[1]]

    without = attrs.evolve(drives.on_mesh(PARAMS, "string"), friction=None)
    on, off = (quickly(one, start_up) for one in (with_both, without))
    at = {effect.name: effect for effect in on.effects}
    assert at["gravity"].on and at["gravity"].because == ("gravity = (0, -9.81) m/s^2",)
    assert at["bearing drag"].because == ("pulley 1: drag.viscous = 0.0002 N m s",)
    assert "pulley 1: drag.coulomb = 0 N m" in at["bearing drag"].zero
    gone = {effect.name: effect for effect in off.effects}
    assert not gone["gravity"].on and not gone["bearing drag"].on
    assert "torque: function start_up" in reasons(on)
    passes = {one.name for one in off.passes}
    assert "contact without friction" in passes and "contact: friction" not in passes
    # nor is state counted that there is not: of friction, of angles of a string
    assert off.state.parts["friction"] == 0
    assert off.state.parts["links"] == 4 * without.belt.n_bodies
    assert not {"phi", "vphi"} & set(off.state.fields["links"])


def test_state_is_counted_by_part(explained: bd.Explanation) -> None:
    params = bd.scenes.get("tensioned-alternator").params
    n_b, n_p, n_m = params.belt.n_bodies, len(params.pulleys), len(params.mounted)
    slots = params.info["n_slots"]
    parts = explained.state.parts
    assert parts["links"] == 6 * n_b  # three coordinates and their velocities
    assert parts["friction"] == 2 * slots * n_b  # state of the law, and slip
    assert parts["pulleys"] == 2 * n_p and parts["mounts"] == 3 * n_m
    assert parts["ledger"] == len(explained.state.fields["ledger"])
    assert {"drive", "joint_loss", "friction_loss"} <= set(explained.state.fields["ledger"])
    assert explained.state.bytes == 8 * explained.state.numbers
    assert sum(parts.values()) <= explained.state.numbers < explained.state.simulation / 8


@pytest.mark.one_in(4)
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_law_is_explained_with_its_states(name: str) -> None:
    """However many a link has, and what calls for it; with its Stribeck curve in the ablation."""
    law = STRIBECK.get(name, EXAMPLES[name])
    seen = quickly(attrs.evolve(PARAMS, friction=law))
    assert seen.state.parts["friction"] == (law.n_states + 1) * PARAMS.belt.n_bodies
    assert any("friction." in line for effect in seen.effects for line in effect.because)
    assert ("Stribeck" in str(seen)) == (name in STRIBECK)


def test_text_and_dictionary(explained: bd.Explanation) -> None:
    text = str(explained)
    for effect in explained.effects:
        assert effect.name in text
    for one in explained.passes:
        assert one.name in text and one.calls > 0.0 and one.seconds >= 0.0
    assert explained.step.alone > 0.0 and explained.step.measured > 0.0
    assert max(map(len, text.splitlines())) <= 100
    assert "NO-BREAK" not in ascii(text) and "\xa0" not in text
    plain = explained.to_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain  # lists, as JSON has them
    assert plain["state"]["parts"] == explained.state.parts
    assert [row["name"] for row in plain["effects"]] == [one.name for one in explained.effects]


def test_command_line_and_arguments_that_are_refused() -> None:
    arguments = ["explain", "kubas-case-1", "--t-end", "0.002", "--budget", "0.05"]
    run = CliRunner().invoke(cli.main, arguments)
    assert run.exit_code == 0, run.output
    for word in ("belt.bending_stiffness = ", "contact with Dahl friction", "ns a step", "links"):
        assert word in run.stdout
    bad = CliRunner().invoke(cli.main, ["explain", "no-such-scene"])
    assert bad.exit_code == 2 and bad.stdout == "" and "no-such-scene" in bad.stderr
    with pytest.raises(TypeError, match="params must be a Params"):
        bd.explain("serpentine", TORQUE)  # type: ignore[arg-type]
    for wrong in ({"error": 0.0}, {"method": "euler"}):
        with pytest.raises(ValueError, match=f"{next(iter(wrong))} must be "):
            bd.explain(PARAMS, TORQUE, **wrong)  # type: ignore[arg-type]
