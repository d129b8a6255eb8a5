"""The belt at rest under preload, in every way ``settle`` can bring it there."""

from __future__ import annotations

from typing import Any

import attrs
import drives
import numpy as np
import pytest
import reference
import reference_run
from bridge import fields, oracle_of
from tiers import first

import beltdyn as bd
from beltdyn import _core

PLAIN = drives.plain()


@pytest.fixture(scope="module")
def rest() -> bd.State:
    return bd.settle(PLAIN)


def with_links(n_bodies: int) -> bd.Params:
    return attrs.evolve(PLAIN, belt=attrs.evolve(PLAIN.belt, n_bodies=n_bodies))


def joint_forces(params: bd.Params, state: bd.State) -> np.ndarray:
    oracle = oracle_of(params)
    return np.asarray(oracle.joints(oracle.pack(fields(state)))[1])


def check_rest(params: bd.Params, state: bd.State) -> None:
    """Nothing moves; by the oracle no link bears a force, over EA times the strain, unbalanced."""
    assert not any(getattr(state, v).any() for v in ("vx", "vy", "vphi", "omega"))
    assert state.residual <= 1e-9
    oracle = oracle_of(params)
    rate = oracle.rhs(0.0, oracle.pack(fields(state)), lambda t, a, b: 0 * a)
    acceleration = oracle.links(rate)[1]
    force = oracle.mass * np.hypot(acceleration[0], acceleration[1])
    moments = oracle.inertia * np.abs(acceleration[2:]) / (0.5 * oracle.l0)
    largest = float(max(force.max(), moments.max(initial=0.0)))
    assert largest <= 1.1e-9 * params.info["strain_tension"]


def check_stays(params: bd.Params, state: bd.State | None) -> None:
    """Simulated without torque the belt stays where it is, its own friction joining in."""
    t = 0.0 if state is None else state.t
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), t + 0.02, initial=state)
    force = result.joints.force
    assert np.max(np.abs(force - force[0])) <= 1e-7 * np.mean(force[0])


@pytest.mark.parametrize("name", bd.scenes.names())
def test_every_scene_comes_to_rest(name: str) -> None:
    params = bd.scenes.get(name).params
    state = bd.settle(params)
    check_rest(params, state)
    # friction has its part in it where the scene says so, and nowhere else
    assert state.mu.any() == params.tensioning.friction


@pytest.mark.parametrize("n_bodies", first(2, [24, 61, 120]))
def test_mean_tension_is_that_of_the_oracle(n_bodies: int) -> None:
    """Newton on the oracle's equilibrium against the core's bath: two ways to one minimum.

    The belt may stand at a different place along its path (both are equilibria of a potential that
    is all but flat along it), so only the mean is compared; it varies by some 1e-4 with the place.
    """
    params = with_links(n_bodies)
    oracle = oracle_of(attrs.evolve(params, friction=None))
    start = reference.start_state(oracle)
    mean = np.mean(oracle.joints(reference_run.settle(oracle, start))[1])
    assert np.mean(joint_forces(params, bd.settle(params))) == pytest.approx(mean, rel=2e-3)


def test_polygon_raises_the_tension_and_fades() -> None:
    """MODEL section 6: about a quarter at n_b = 60, fading as n_b^-2."""
    coarse, fine, finest = (
        float(np.mean(joint_forces(params, bd.settle(params))))
        for params in map(with_links, (60, 120, 240))
    )
    # n_b^-2: each halving of the link leaves a quarter of the excess
    assert (coarse - fine) / (fine - finest) == pytest.approx(4.0, rel=0.15)
    limit = finest - (fine - finest) / 3
    assert 0.15 < coarse / limit - 1 < 0.35


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
    force = joint_forces(PLAIN, moved)
    touching = (oracle.penetration(oracle.pack(fields(moved))) > 0).any(axis=0)
    arcs = force[touching & np.roll(touching, 1)]
    spans = force[~touching & ~np.roll(touching, 1)]
    assert spans.mean() > 1.05 * arcs.mean()
    assert spans.max() / arcs.min() <= np.exp(PLAIN.friction.mu_k * np.pi / 2) * 1.05
    # without friction the way does not matter
    means = [np.mean(joint_forces(PLAIN, s)) for s in (bd.settle(PLAIN, offset=offset), rest)]
    assert means[0] == pytest.approx(means[1], rel=2e-3)


def test_slower_tensioning_ends_the_same() -> None:
    """Quasi-static: doubling the time of the motion moves the tensions by little."""
    one, two = (
        joint_forces(
            PLAIN, bd.settle(PLAIN, friction=True, offset={1: (-0.004, 0.0)}, move_time=time)
        )
        for time in (0.15, 0.3)
    )
    assert np.max(np.abs(one - two)) <= 0.05 * np.mean(one)


def test_true_rest_starts_without_a_jump_and_keeps_its_time(rest: bd.State) -> None:
    check_stays(PLAIN, None)
    again = bd.settle(PLAIN, initial=attrs.evolve(rest, t=2.5, x=rest.x + 1e-5))
    assert again.t == 2.5
    assert again.residual <= 1e-9


def test_settles_from_a_running_state() -> None:
    """Its velocities are dropped; without friction so is its friction."""
    scene = drives.plain_scene()
    running = bd.simulate(*scene[:2], 0.2, t_eval=[0.2]).final_state
    assert np.max(np.abs(running.mu)) > 0.5
    for pulleys in ("held", "free"):
        for friction in (True, False):
            state = bd.settle(PLAIN, initial=running, pulleys=pulleys, friction=friction)
            check_rest(PLAIN, state)
            assert state.mu.any() == friction
        check_stays(PLAIN, state)  # the last one, without friction


def test_what_cannot_be_tensioned_is_refused() -> None:
    for length, words in ((1.21, "too long"), (0.9, "too short")):
        with pytest.raises(ValueError, match=f"belt.length is {words} for its pulleys"):
            attrs.evolve(PLAIN, belt=attrs.evolve(PLAIN.belt, length=length))
    taut = attrs.evolve(PLAIN, belt=attrs.evolve(PLAIN.belt, length=1.2083))
    assert 0.0 < taut.info["strain"] < 2e-5
    assert bd.settle(taut).residual <= 1e-9
    with pytest.raises(ValueError, match="overlap"):
        bd.settle(PLAIN, offset={1: (-0.2, 0.0)})


def thrust(rest: bd.State, depth: float, quadratic: float) -> tuple[bd.Params, bd.State]:
    """A stiff contact and a link thrust that deep into the driven pulley."""
    contact = bd.Contact(quadratic=quadratic, linear=0.0, damping=1e3)
    center, i = np.array([0.29, 0.0]), 15
    arm = np.array([rest.x[i], rest.y[i]]) - center
    arm *= 1.0 - depth / np.hypot(*arm)
    x, y = rest.x.copy(), rest.y.copy()
    x[i], y[i] = center + arm
    return attrs.evolve(PLAIN, contact=contact), attrs.evolve(rest, x=x, y=y)


def test_starts_over_with_a_shorter_step(rest: bd.State) -> None:
    """The step estimated from the belt line's contact blows up, and is halved until it does not."""
    params, state = thrust(rest, 8e-3, 5e12)
    sim = _core.Simulation.settle(params._model, state._to_core(params))
    while not sim.advance(1.0):
        pass
    assert sim.stats["smallest_step"] < 0.6 * sim.stats["largest_step"]
    assert sim.stats["residual"] <= 1e-9


def test_says_when_it_does_not_come_to_rest(rest: bd.State) -> None:
    with pytest.raises(bd.SimulationError, match=r"did not come to rest.*max_time") as caught:
        bd.settle(PLAIN, max_time=1e-3)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.value > 1e-9
    params, state = thrust(rest, 8e-3, 1e13)
    with pytest.raises(bd.SimulationError, match="settling blew up") as caught:
        bd.settle(params, initial=state)
    assert caught.value.symbol == "BD_ERR_NOT_FINITE"


@pytest.mark.parametrize("pulleys", first(1, ["free", "held"]))
def test_rounding_does_not_decide_what_friction_holds(pulleys: str) -> None:
    """With friction 1024 m away, where centres are rounded to 2e-13 m, 1e-9 of a stretch."""
    here = bd.scenes.three_pulleys().params
    away = [
        attrs.evolve(p, center=(p.center[0] + 1024.0, p.center[1] - 1024.0)) for p in here.pulleys
    ]
    there = attrs.evolve(here, pulleys=away)
    one, other = (bd.settle(p, friction=True, pulleys=pulleys) for p in (here, there))
    assert np.max(np.abs(one.mu)) > 1e-2
    assert np.max(np.abs(one.mu - other.mu)) <= 1e-6
    assert np.max(np.abs(one.x + 1024.0 - other.x)) <= 1e-9


@pytest.mark.parametrize("friction", first(1, [True, False]))
def test_a_shift_by_whole_links_only_renumbers(friction: bool) -> None:
    """Laid k pitches on, link i stands where link i + k stood, through the closure of the ring."""
    params = bd.scenes.unequal_pulleys().params
    n_b = params.belt.n_bodies
    pitch = params.info["path_length"] / n_b
    here = bd.settle(params, friction=friction, pulleys="free")
    for k in (1, -3):
        there = bd.settle(params, friction=friction, pulleys="free", shift=k * pitch)
        turned = 2 * np.pi * np.where(np.arange(n_b) + k >= n_b, -1, 0)
        turned += 2 * np.pi * np.where(np.arange(n_b) + k < 0, 1, 0)
        # settled to 1e-9 of the tension; the belt slides along itself a thousand times more easily
        for name in ("x", "y"):
            there_now, here_rolled = getattr(there, name), np.roll(getattr(here, name), -k)
            assert there_now == pytest.approx(here_rolled, abs=1e-6 * 0.1)
        assert there.phi == pytest.approx(np.roll(here.phi, -k) + turned, abs=1e-5)
        assert there.mu == pytest.approx(np.roll(here.mu, -k), abs=1e-3)
    # half a link on is another place
    here, half = (bd.settle(params, friction=friction, shift=shift) for shift in (0.0, pitch / 2))
    assert half.x[3] - here.x[3] == pytest.approx(pitch / 2, rel=0.1)


# ------------------------------------------------------------------ how it was tensioned
def test_tensioning_of_params_is_what_settle_and_simulate_do() -> None:
    options: dict[str, Any] = {"friction": True, "pulleys": "free", "offset": {1: (-0.001, 0.0)}}
    params = attrs.evolve(PLAIN, tensioning=bd.Tensioning(**options))
    by_params, by_arguments = bd.settle(params), bd.settle(PLAIN, **options)
    assert np.array_equal(by_params.x, by_arguments.x)
    assert np.array_equal(by_params.mu, by_arguments.mu)
    assert np.abs(by_params.mu).max() > 0.1
    # arguments take the place of the fields, one by one
    assert not bd.settle(params, friction=False).mu.any()
    start = bd.simulate(params, drives.plain_scene().torque_fn, 1e-3, t_eval=[0.0])
    assert np.array_equal(start.contact.mu[0], by_params.mu)


def test_tensioning_survives_toml_and_says_itself() -> None:
    how = bd.Tensioning(friction=True, pulleys="free", offset=[[0, 0], [1e-3, 0]], move_time=0.1)
    params = attrs.evolve(PLAIN, tensioning=how)
    assert bd.Params.from_toml(params.to_toml()) == params
    said = "tensioned with friction, pulleys free to turn, pulley 1 moved to its place"
    assert said in str(params)
    assert how.offset == ((0.0, 0.0), (1e-3, 0.0))
    assert str(bd.Tensioning(shift=-2e-3)).endswith("moved along the belt line by -0.002 m")
    text = PLAIN.to_toml()
    assert "tensioning" not in text
    # a table may name the pulley
    text += "\n[tensioning]\nfriction = true\noffset = { 1 = [-0.006, 0] }\n"
    named = bd.Tensioning(friction=True, offset={1: (-0.006, 0.0)})
    assert bd.Params.from_toml(text).tensioning == named


def test_a_bad_tensioning_is_named() -> None:
    rows: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"friction": 1}, TypeError, "friction must be a bool"),
        ({"pulleys": "loose"}, ValueError, "pulleys must be one of held, free"),
        ({"offset": 3}, TypeError, "offset must be a mapping"),
        ({"offset": {-1: (0, 0)}}, ValueError, "offset index must be an integer from 0 to 9999"),
        ({"offset": [(0, 0, 0)]}, TypeError, r"offset\[0\] must be a pair"),
        ({"offset": {0: (np.nan, 0)}}, ValueError, r"offset\[0\]\[0\] must be finite"),
        ({"move_time": 0.0}, ValueError, "move_time must be > 0"),
    ]
    for wrong, error, message in rows:
        with pytest.raises(error, match=message):
            bd.Tensioning(**wrong)
    with pytest.raises(ValueError, match="one of the 2 pulley"):
        attrs.evolve(PLAIN, tensioning=bd.Tensioning(offset={2: (0.0, 0.0)}))
    with pytest.raises(TypeError, match="tensioning must be a Tensioning"):
        attrs.evolve(PLAIN, tensioning="free")
    for value in ("no", 1):
        with pytest.raises(TypeError, match="friction must be a bool"):
            bd.settle(PLAIN, friction=value)
        with pytest.raises(TypeError, match="ledger must be a bool"):
            bd.simulate(*drives.plain_scene(), ledger=value)
