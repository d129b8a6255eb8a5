"""The belt at rest under preload, in every way ``settle`` can bring it there."""

from __future__ import annotations

import math
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from bridge import fields, oracle_of
from laws import with_laws
from mounted_drives import both

import beltdyn as bd
from beltdyn import _core

PLAIN = drives.plain()


@pytest.fixture(scope="module")
def rest() -> bd.State:
    return bd.settle(PLAIN)


def check_rest(params: bd.Params, state: bd.State) -> None:
    """Nothing moves; by the oracle no link bears a force, over EA times the strain, unbalanced."""
    assert not any(getattr(state, v).any() for v in ("vx", "vy", "vphi", "omega"))
    assert state.residual <= 1e-9
    oracle = oracle_of(params)
    rate = oracle.rhs(0.0, oracle.pack(fields(state)), lambda t, a, b: 0 * a)
    acceleration = oracle.links(rate)[1]
    force = oracle.mass * np.hypot(*acceleration[:2])
    moments = oracle.inertia * np.abs(acceleration[2:]) / (0.5 * oracle.l0)
    largest = max(force.max(), moments.max(initial=0.0))
    assert largest <= 1.1e-9 * params.info["strain_tension"]


def check_stays(state: bd.State | None) -> None:
    """Simulated without torque the belt stays where it is, its own friction joining in."""
    t = 0.0 if state is None else state.t
    force = bd.simulate(PLAIN, bd.Viscous([0.0, 0.0]), t + 0.02, initial=state).joints.force
    assert np.max(np.abs(force - force[0])) <= 1e-7 * np.mean(force[0])


@pytest.mark.parametrize("name", bd.scenes.names())
def test_every_scene_comes_to_rest(name: str) -> None:
    params = bd.scenes.get(name).params
    state = bd.settle(params)
    check_rest(params, state)
    # friction has its part in it where the scene says so, and nowhere else
    assert state.mu.any() == params.tensioning.friction


def test_with_friction_it_stays_where_it_locked() -> None:
    """With friction on from the belt line, arcs keep some of it: mu within its limit, at rest."""
    state = bd.settle(PLAIN, friction=True)
    check_rest(PLAIN, state)
    assert 0.0 < np.max(np.abs(state.mu)) <= PLAIN.friction.mu_k
    without = attrs.evolve(PLAIN, friction=None, tensioning=bd.Tensioning(friction=True))
    assert not bd.settle(without).mu.any()


def test_free_pulleys_carry_no_torque() -> None:
    params = bd.scenes.three_pulleys().params
    state = bd.settle(params, friction=True, pulleys="free")
    check_rest(params, state)
    oracle = oracle_of(params)
    contacts = oracle.contacts(oracle.pack(fields(state)))
    torque = np.sum(contacts.friction * contacts.distance, axis=1)
    assert np.max(np.abs(torque)) <= 1e-8 * params.info["strain_tension"]
    assert np.any(state.theta != 0.0)


def test_tensioned_by_moving_a_pulley(rest: bd.State) -> None:
    """From 6 mm slack to its place with friction: the belt rubs inward over both drums, so spans
    are tighter than arcs, and by no more than the capstan allows.
    """
    offset = {1: (-0.006, 0.0)}
    moved = bd.settle(PLAIN, friction=True, offset=offset)
    check_rest(PLAIN, moved)
    oracle = oracle_of(PLAIN)
    force = moved.tension(PLAIN).joints
    touching = (oracle.penetration(oracle.pack(fields(moved))) > 0).any(axis=0)
    arcs = force[touching & np.roll(touching, 1)]
    spans = force[~touching & ~np.roll(touching, 1)]
    assert spans.mean() > 1.05 * arcs.mean()
    assert spans.max() / arcs.min() <= np.exp(PLAIN.friction.mu_k * np.pi / 2) * 1.05
    # without friction the way does not matter
    means = [np.mean(s.tension(PLAIN).joints) for s in (bd.settle(PLAIN, offset=offset), rest)]
    assert means[0] == pytest.approx(means[1], rel=2e-3)


def test_slower_tensioning_ends_the_same() -> None:
    """Quasi-static: doubling the time of the motion moves the tensions by little."""
    one, two = (
        bd.settle(PLAIN, friction=True, offset={1: (-0.004, 0.0)}, move_time=time)
        for time in (0.15, 0.3)
    )
    forces = one.tension(PLAIN).joints
    assert np.max(np.abs(forces - two.tension(PLAIN).joints)) <= 0.05 * np.mean(forces)


def test_settles_from_a_running_state() -> None:
    """Its velocities are dropped; without friction so is its friction. True rest has no jump."""
    check_stays(None)
    running = bd.simulate(*drives.plain_scene()[:2], 0.2, t_eval=[0.2]).final_state
    assert np.max(np.abs(running.mu)) > 0.5
    for pulleys, friction in (("held", True), ("free", False)):
        state = bd.settle(PLAIN, initial=running, pulleys=pulleys, friction=friction)
        check_rest(PLAIN, state)
        assert state.mu.any() == friction
    check_stays(state)  # the last one, without friction


def test_what_cannot_be_tensioned_is_refused() -> None:
    for length, words in ((1.21, "too long"), (0.9, "too short")):
        with pytest.raises(ValueError, match=f"belt.length is {words} for its pulleys"):
            attrs.evolve(PLAIN, belt=attrs.evolve(PLAIN.belt, length=length))
    taut = attrs.evolve(PLAIN, belt=attrs.evolve(PLAIN.belt, length=1.2083))
    assert 0.0 < taut.info["strain"] < 2e-5
    assert bd.settle(taut).residual <= 1e-9
    with pytest.raises(ValueError, match="overlap"):
        bd.settle(PLAIN, offset={1: (-0.2, 0.0)})


def thrust(rest: bd.State, quadratic: float) -> tuple[bd.Params, bd.State]:
    """A stiff contact and a link thrust 8 mm deep into the driven pulley."""
    contact = bd.Contact(quadratic=quadratic, linear=0.0, damping=1e3)
    x, y, i = rest.x.copy(), rest.y.copy(), 15
    share = 1.0 - 8e-3 / np.hypot(x[i] - 0.29, y[i])
    x[i], y[i] = 0.29 + share * (x[i] - 0.29), share * y[i]
    return attrs.evolve(PLAIN, contact=contact), attrs.evolve(rest, x=x, y=y)


def test_starts_over_with_a_shorter_step(rest: bd.State) -> None:
    """The step estimated from the belt line's contact blows up, and is halved until it does not."""
    params, state = thrust(rest, 5e12)
    sim = _core.Simulation.settle(params._model, state._to_core(params))
    assert sim.advance(np.inf)
    assert sim.stats["smallest_step"] < 0.6 * sim.stats["largest_step"]
    assert sim.stats["residual"] <= 1e-9


def test_implicit_steps_damp_as_critical_damping_does() -> None:
    """Steps are a quarter of 1 / beta, beta the damping; what is critical falls at beta / 2,
    by 1 + 1/8 a step if the derivatives know it: to 1e-9 in 176 steps, looked at every eighth.
    """
    params = bd.scenes.tensioned_alternator(60).params
    sim = _core.Simulation.settle(params._model, friction=True)
    assert sim.advance(np.inf) and sim.method == "lie"
    assert sim.stats["steps"] <= math.log(1e9) / math.log(1.125) + 2 * 8


def test_an_arm_settles_in_stiff_contact() -> None:
    """In implicit steps."""
    params = bd.scenes.tensioned_alternator(40).params
    params = attrs.evolve(params, contact=bd.Contact(linear=2.5e10, damping=1e3))
    assert bd.settle(params).residual <= 1e-9


def test_shorter_steps_where_a_blow_up_throws_an_arm_first() -> None:
    """Links as long as the least radius: steps estimated too long throw the arm among the pulleys,
    at every other of these lengths, before any other guard sees it. It follows the length.
    """
    params = bd.scenes.serpentine(60).params
    travels = []
    for length in np.linspace(1.7714, 1.7721, 8):
        belt = attrs.evolve(params.belt, length=float(length))
        travels.append(bd.settle(attrs.evolve(params, belt=belt)).travel[0])
    steps = np.diff(travels)
    assert np.allclose(steps, np.mean(steps), rtol=0.05)  # the lever changes by 3 %


def test_goes_on_while_there_is_progress() -> None:
    """Under friction on free pulleys, without bending: it needs more than the usual time."""
    belt = attrs.evolve(PLAIN.belt, mesh="joint", n_bodies=560, bending_stiffness=0.0)
    state = bd.settle(attrs.evolve(PLAIN, belt=belt), friction=True, pulleys="free")
    assert state.residual <= 1e-9


def test_says_when_it_does_not_come_to_rest(rest: bd.State) -> None:
    """A longer time is advised where it is that which ended it."""
    for options in ({"max_time": 1e-3}, {"max_time": 1e6, "tolerance": 1e-17}):
        with pytest.raises(bd.SimulationError, match="did not come to rest") as caught:
            bd.settle(PLAIN, **options)
        assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.value > 1e-17
        assert ("max_time" in str(caught.value)) == ("tolerance" not in options)
        assert "rtol" not in str(caught.value)
    with pytest.raises(ValueError, match="max_time must be within"):
        bd.settle(PLAIN, max_time=1e300)
    params, state = thrust(rest, 1e13)
    with pytest.raises(bd.SimulationError, match="settling blew up") as caught:
        bd.settle(params, initial=state)
    assert caught.value.symbol == "BD_ERR_NOT_FINITE"


def test_links_that_stay_turned_over_are_no_rest(rest: bd.State) -> None:
    """Laid with six links of a span turned once round, a third of a turn from each to the next."""
    middle = np.argmin(np.abs(rest.x - 0.145) + np.abs(rest.y - 0.1))
    turned = rest.phi + np.clip(2.0 * np.pi - 2.0 * np.abs(np.arange(60) - middle), 0.0, None)
    with pytest.raises(bd.SimulationError, match=r"link \d+ has turned over") as caught:
        bd.settle(PLAIN, initial=attrs.evolve(rest, phi=turned))
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED"


@pytest.mark.ci(guard="test_settle.py::test_says_when_it_does_not_come_to_rest")
def test_a_belt_that_sinks_too_far_ends_in_an_error() -> None:
    """It sinks past half a radius. Its steps became ever shorter, without end."""
    params = bd.scenes.serpentine(120).params
    belt = attrs.evolve(params.belt, preload=None, length=params.route.length / 1.04,
                        bending_stiffness=0.0)  # fmt: skip
    params = attrs.evolve(params, belt=belt, contact=bd.Contact(linear=1e6, damping=1e3))
    with pytest.raises(bd.SimulationError, match="contact too soft for the tension") as caught:
        bd.settle(params)
    assert caught.value.symbol == "BD_ERR_PASSED_THROUGH"


def fine(n_bodies: int) -> bd.Params:
    params = bd.scenes.unequal_pulleys().params
    return attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=n_bodies))


def settled_in(params: bd.Params, steps: int) -> bd.State:
    settling = _core.Simulation.settle(params._model)
    assert settling.advance(math.inf) is True
    assert settling.stats["steps"] <= steps
    found = bd.State._from_core(settling.state(), residual=settling.stats["residual"])
    check_rest(params, found)
    return found


def test_fine_belts_come_to_rest_at_once() -> None:
    """Left to slide against next to no force they take 13 000, 21 000 and 27 000 steps, with a soft
    contact, which sinks 15 mm, 30 000, with large damping 14 000. Other motions die down in 30 /
    0.25 steps; Newton's method then needs some twenty.
    """
    pulleys = [bd.Pulley(center=(x, 0.0), radius=0.05, inertia=1e-3) for x in (0.0, 0.35)]
    bent = bd.Belt(preload=500.0, n_bodies=240, linear_density=0.1, axial_stiffness=5e4,
                   axial_damping=10.0, bending_stiffness=0.01)  # fmt: skip
    equal = bd.Params(belt=bent, pulleys=pulleys)
    damped = drives.with_belt(triangle(0.2, 960), axial_damping=1e3)
    soft = attrs.evolve(triangle(0.2, 240), contact=bd.Contact(linear=6.25e5, damping=1e3))
    for params in (equal, fine(535), drives.with_belt(equal, n_bodies=960), soft, damped):
        settled_in(params, 220)


def test_a_fine_belt_that_runs_is_moved_along_itself() -> None:
    """Left to slide it takes 15 000 steps."""
    params = fine(535)
    settling = _core.Simulation.settle(params._model, speed=5.0)
    assert settling.advance(math.inf) is True
    assert settling.stats["steps"] <= 1500 and settling.stats["residual"] <= 1e-9


def triangle(side: float, n_bodies: int) -> bd.Params:
    """Three equal pulleys, on which the polygon of links resists circulation least."""
    places = [(0.0, 0.0), (side, 0.0), (0.5 * side, math.sqrt(0.75) * side)]
    belt = bd.Belt(length=(3 * side + 0.08 * math.pi) / 1.01, n_bodies=n_bodies,
                   linear_density=0.1, axial_stiffness=5e4, axial_damping=10.0)  # fmt: skip
    pulleys = [bd.Pulley(center=place, radius=0.04, inertia=1e-3) for place in places]
    return bd.Params(belt=belt, pulleys=pulleys, contact=bd.Contact(linear=1e6, damping=100.0))


@pytest.mark.parametrize(("side", "n_bodies"), [(0.12, 40), (0.12, 60), (0.16, 37)])
def test_belts_that_creep_along_themselves_come_to_rest(side: float, n_bodies: int) -> None:
    """Waiting, they were not at rest after 30 000 to 260 000 steps. They rest where they stay, not
    on the ridge between two such places: pushed on by a twentieth of a link they come back.
    """
    params = triangle(side, n_bodies)
    here = settled_in(params, 20_000)
    wind = 2.0 * np.pi
    ahead, behind = (np.stack([np.roll(q, k) for q in (here.x, here.y, here.phi)]) for k in (-1, 1))
    ahead[2, -1] += wind
    behind[2, 0] -= wind
    dx, dy, dphi = 0.025 * (ahead - behind)
    pushed = attrs.evolve(here, x=here.x + dx, y=here.y + dy, phi=here.phi + dphi)
    again = bd.settle(params, initial=pushed)
    pitch = params.info["link_length"]
    assert np.hypot(again.x - here.x, again.y - here.y).max() <= 1e-3 * pitch


def test_a_shift_by_whole_links_only_renumbers() -> None:
    """Laid k pitches on, link i stands where link i + k stood, through the closure of the ring."""
    params = bd.scenes.unequal_pulleys().params
    n_b = params.belt.n_bodies
    pitch = params.info["path_length"] / n_b
    here = bd.settle(params, friction=True, pulleys="free")
    for k in (1, -3):
        there = bd.settle(params, friction=True, pulleys="free", shift=k * pitch)
        turned = -2 * np.pi * ((np.arange(n_b) + k) // n_b)
        # settled to 1e-9 of the tension; the belt slides along itself a thousand times more easily
        for name, far, within in (("x", 0, 1e-7), ("y", 0, 1e-7), ("phi", turned, 1e-5),
                                  ("mu", 0, 1e-3)):  # fmt: skip
            rolled = np.roll(getattr(here, name), -k) + far
            assert getattr(there, name) == pytest.approx(rolled, abs=within), name
    # half a link on is another place
    here, half = (bd.settle(params, friction=True, shift=shift) for shift in (0.0, pitch / 2))
    assert half.x[3] - here.x[3] == pytest.approx(pitch / 2, rel=0.1)


def test_tensioning_of_params_is_what_settle_and_simulate_do() -> None:
    options: dict[str, Any] = {"friction": True, "pulleys": "free", "offset": {1: (-0.001, 0.0)}}
    params = attrs.evolve(PLAIN, tensioning=bd.Tensioning(**options))
    by_params = bd.settle(params)
    assert by_params == bd.settle(PLAIN, **options)
    assert np.abs(by_params.mu).max() > 0.1
    # arguments take the place of the fields, one by one
    assert not bd.settle(params, friction=False).mu.any()
    start = bd.simulate(params, drives.plain_scene().torque_fn, 1e-3, t_eval=[0.0])
    assert np.array_equal(start.contact.mu[0], by_params.mu)


def test_tensioning_survives_toml_and_says_itself() -> None:
    how = bd.Tensioning(friction=True, pulleys="free", offset=[[0, 0], [1e-3, 0]], move_time=0.1)
    assert how.offset == ((0.0, 0.0), (1e-3, 0.0))
    params = attrs.evolve(PLAIN, tensioning=how)
    assert bd.Params.from_toml(params.to_toml()) == params
    said = "tensioned with friction, pulleys free to turn, pulley 1 moved to its place"
    assert said in str(params)
    assert str(bd.Tensioning(shift=-2e-3)).endswith("moved along the belt line by -0.002 m")
    text = PLAIN.to_toml()
    assert "tensioning" not in text
    # a table may name the pulley
    text += "\n[tensioning]\nfriction = true\noffset = { 1 = [-0.006, 0] }\n"
    named = bd.Tensioning(friction=True, offset={1: (-0.006, 0.0)})
    assert bd.Params.from_toml(text).tensioning == named


def test_a_bad_tensioning_is_named() -> None:
    """By the rules of `settle` (test_result.py)."""
    for wrong, error, message in (
        ({"friction": 1}, TypeError, "friction must be a bool"),
        ({"pulleys": "loose"}, ValueError, "pulleys must be one of held, free"),
        ({"offset": 3}, TypeError, "offset must be a mapping"),
        ({"offset": {2: (0, 0)}}, ValueError, "one of the 2 pulley"),
        ({"move_time": 0.0}, ValueError, "move_time must be > 0"),
    ):
        with pytest.raises(error, match=message):
            attrs.evolve(PLAIN, tensioning=bd.Tensioning(**wrong))


def test_laws_of_two_scales_beside_pulleys_without_come_to_rest() -> None:
    """Where no pulley of a row of friction states has a law, these weigh nothing in the error."""
    law = bd.ElasticPlastic(mu=0.8, stiffness=2e7, damping=400.0)
    params = with_laws(both(n_bodies=36), law, None, law, None)
    assert int(params.info["n_slots"]) > 1
    assert bd.settle(params).residual <= 1e-8
