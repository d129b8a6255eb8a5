"""The belt at rest under preload, in every way ``settle`` can bring it there."""

from __future__ import annotations

import attrs
import drives
import numpy as np
import pytest
import reference
import reference_run
from bridge import fields, oracle_of

import beltdyn as bd


def unbalanced(params: bd.Params, state: bd.State) -> float:
    """Largest force on a link that nothing balances, over EA times the strain: by the oracle."""
    oracle = oracle_of(params)
    rate = oracle.rhs(0.0, oracle.pack(fields(state)), lambda t, a, b: 0 * a)
    acceleration = oracle.links(rate)[1]
    force = oracle.mass * np.hypot(acceleration[0], acceleration[1])
    moments = oracle.inertia * np.abs(acceleration[2:]) / (0.5 * oracle.l0)
    return float(max(force.max(), moments.max(initial=0.0)) / params.info["strain_tension"])


def is_still(state: bd.State) -> bool:
    return not any(getattr(state, v).any() for v in ("vx", "vy", "vphi", "omega"))


@pytest.mark.parametrize("name", bd.scenes.names())
def test_every_scene_comes_to_rest(name: str) -> None:
    params = bd.scenes.get(name).params
    state = bd.settle(params)
    assert is_still(state)
    assert state.residual <= 1e-9
    assert unbalanced(params, state) <= 1.1e-9
    # friction has its part in it where the scene says so, and nowhere else
    assert state.mu.any() == params.tensioning.friction


@pytest.mark.parametrize("n_bodies", [24, 61, 120])
def test_mean_tension_is_that_of_the_oracle(n_bodies: int) -> None:
    """Newton on the oracle's equilibrium against the core's bath: two ways to one minimum.

    The belt may stand at a different place along its path (both are equilibria of a potential that
    is all but flat along it), so only the mean is compared; it varies by some 1e-4 with the place.
    """
    base = drives.plain()
    params = attrs.evolve(base, belt=attrs.evolve(base.belt, n_bodies=n_bodies))
    oracle = oracle_of(attrs.evolve(params, friction=None))
    start = reference.start_state(oracle)
    mean = np.mean(oracle.joints(reference_run.settle(oracle, start))[1])
    ours = np.mean(oracle.joints(oracle.pack(fields(bd.settle(params))))[1])
    assert ours == pytest.approx(mean, rel=2e-3)


def test_polygon_raises_the_tension_and_fades() -> None:
    """MODEL section 6: about a quarter at n_b = 60, fading as n_b^-2."""
    base = drives.plain()

    def mean_tension(n_bodies: int) -> float:
        params = attrs.evolve(base, belt=attrs.evolve(base.belt, n_bodies=n_bodies))
        oracle = oracle_of(params)
        return float(np.mean(oracle.joints(oracle.pack(fields(bd.settle(params))))[1]))

    coarse, fine, finest = (mean_tension(n) for n in (60, 120, 240))
    # n_b^-2: each halving of the link leaves a quarter of the excess
    assert (coarse - fine) / (fine - finest) == pytest.approx(4.0, rel=0.15)
    limit = finest - (fine - finest) / 3
    assert 0.15 < coarse / limit - 1 < 0.35


def test_with_friction_it_stays_where_it_locked() -> None:
    """With friction on from the belt line, arcs keep some of it: mu within its limit, at rest."""
    params = drives.plain()
    state = bd.settle(params, friction=True)
    assert is_still(state)
    assert state.residual <= 1e-9
    assert 0.0 < np.max(np.abs(state.mu)) <= params.friction.mu_k
    assert unbalanced(params, state) <= 1.1e-9


def test_free_pulleys_carry_no_torque() -> None:
    params = bd.scenes.three_pulleys().params
    state = bd.settle(params, friction=True, pulleys="free")
    assert is_still(state)
    oracle = oracle_of(params)
    contacts = oracle.contacts(oracle.pack(fields(state)))
    torque = np.sum(contacts.friction * contacts.distance, axis=1)
    assert np.max(np.abs(torque)) <= 1e-8 * params.info["strain_tension"]
    assert np.any(state.theta != 0.0)


def test_tensioned_by_moving_a_pulley() -> None:
    """From 6 mm slack to its place with friction: the belt rubs inward over both drums, so spans
    are tighter than arcs, and by no more than the capstan allows.
    """
    params = drives.plain()
    moved = bd.settle(params, friction=True, offset={1: (-0.006, 0.0)})
    still = bd.settle(params)
    assert is_still(moved)
    assert moved.residual <= 1e-9
    assert unbalanced(params, moved) <= 1.1e-9
    oracle = oracle_of(params)
    y = oracle.pack(fields(moved))
    _, force = oracle.joints(y)
    touching = (oracle.penetration(y) > 0).any(axis=0)
    arcs = force[touching & np.roll(touching, 1)]
    spans = force[~touching & ~np.roll(touching, 1)]
    assert spans.mean() > 1.05 * arcs.mean()
    assert spans.max() / arcs.min() <= np.exp(params.friction.mu_k * np.pi / 2) * 1.05
    # without friction the way does not matter
    lubricated = bd.settle(params, offset={1: (-0.006, 0.0)})
    means = [np.mean(oracle.joints(oracle.pack(fields(s)))[1]) for s in (lubricated, still)]
    assert means[0] == pytest.approx(means[1], rel=2e-3)


def test_slower_tensioning_ends_the_same() -> None:
    """Quasi-static: doubling the time of the motion moves the tensions by little."""
    params = drives.plain()
    oracle = oracle_of(params)
    forces = []
    for move_time in (0.15, 0.3):
        state = bd.settle(params, friction=True, offset={1: (-0.004, 0.0)}, move_time=move_time)
        forces.append(oracle.joints(oracle.pack(fields(state)))[1])
    assert np.max(np.abs(forces[0] - forces[1])) <= 0.05 * np.mean(forces[0])


def test_true_rest_starts_without_a_jump() -> None:
    """Simulated without torque the settled belt stays where it is, its own friction joining in."""
    params = drives.plain()
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 0.02)
    first = result.joints.force[0]
    assert np.max(np.abs(result.joints.force - first)) <= 1e-7 * np.mean(first)


def test_settle_from_a_given_state_keeps_its_time() -> None:
    params = drives.plain()
    rest = bd.settle(params)
    again = bd.settle(params, initial=attrs.evolve(rest, t=2.5, x=rest.x + 1e-5))
    assert again.t == 2.5
    assert again.residual <= 1e-9


@pytest.mark.parametrize(("length", "words"), [(1.21, "too long"), (0.9, "too short")])
def test_refuses_what_cannot_be_tensioned(length: float, words: str) -> None:
    base = drives.plain()
    with pytest.raises(ValueError, match=f"belt.length is {words} for its pulleys"):
        attrs.evolve(base, belt=attrs.evolve(base.belt, length=length))


def test_takes_a_belt_that_is_just_taut() -> None:
    base = drives.plain()
    params = attrs.evolve(base, belt=attrs.evolve(base.belt, length=1.2083))
    assert 0.0 < params.info["strain"] < 2e-5
    assert bd.settle(params).residual <= 1e-9


def test_refuses_overlap_where_it_starts() -> None:
    params = drives.plain()
    with pytest.raises(ValueError, match="overlap"):
        bd.settle(params, offset={1: (-0.2, 0.0)})


def test_says_when_it_does_not_come_to_rest() -> None:
    params = drives.plain()
    with pytest.raises(bd.SimulationError, match=r"did not come to rest.*max_time") as caught:
        bd.settle(params, max_time=1e-3)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED"
    assert caught.value.value > 1e-9


@pytest.mark.parametrize("pulleys", ["held", "free"])
@pytest.mark.parametrize("friction", [True, False])
def test_settles_from_a_running_state(pulleys: str, friction: bool) -> None:
    """Its velocities are dropped; without friction so is its friction."""
    scene = drives.plain_scene()
    running = bd.simulate(*scene[:2], 0.2, t_eval=[0.2]).final_state
    assert np.max(np.abs(running.mu)) > 0.5
    state = bd.settle(scene.params, initial=running, pulleys=pulleys, friction=friction)
    assert is_still(state)
    assert state.residual <= 1e-9
    assert state.mu.any() == friction
    if not friction:
        result = bd.simulate(scene.params, bd.Viscous([0.0, 0.0]), 0.25, initial=state)
        first = result.joints.force[0]
        assert np.max(np.abs(result.joints.force - first)) <= 1e-7 * np.mean(first)


def thrust(depth: float, quadratic: float) -> tuple[bd.Params, bd.State]:
    """A stiff contact and a link thrust that deep into the driven pulley."""
    base = drives.plain()
    rest = bd.settle(base)
    params = attrs.evolve(base, contact=bd.Contact(quadratic=quadratic, linear=0.0, damping=1e3))
    center, i = np.array([0.29, 0.0]), 15
    arm = np.array([rest.x[i], rest.y[i]]) - center
    arm *= 1.0 - depth / np.hypot(*arm)
    x, y = rest.x.copy(), rest.y.copy()
    x[i], y[i] = center + arm
    return params, attrs.evolve(rest, x=x, y=y)


def test_starts_over_with_a_shorter_step() -> None:
    """The step estimated from the belt line's contact blows up, and is halved until it does not."""
    from beltdyn import _core

    params, state = thrust(8e-3, 5e12)
    sim = _core.Simulation.settle(params._model, state._to_core(params))
    while not sim.advance(1.0):
        pass
    stats = sim.stats
    assert stats["smallest_step"] < 0.6 * stats["largest_step"]
    assert stats["residual"] <= 1e-9


def test_says_when_the_start_is_beyond_help() -> None:
    params, state = thrust(8e-3, 1e13)
    with pytest.raises(bd.SimulationError, match="settling blew up") as caught:
        bd.settle(params, initial=state)
    assert caught.value.symbol == "BD_ERR_NOT_FINITE"


@pytest.mark.parametrize("value", ["no", 1])
def test_flags_are_bools(value: object) -> None:
    scene = drives.plain_scene()
    with pytest.raises(TypeError, match="friction must be a bool"):
        bd.settle(scene.params, friction=value)
    with pytest.raises(TypeError, match="ledger must be a bool"):
        bd.simulate(*scene, ledger=value)


@pytest.mark.parametrize("pulleys", ["held", "free"])
def test_rounding_does_not_decide_what_friction_holds(pulleys: str) -> None:
    """With friction 1024 m away, where centres are rounded to 2e-13 m, 1e-9 of a stretch."""
    here = bd.scenes.three_pulleys().params
    there = attrs.evolve(
        here,
        pulleys=[
            attrs.evolve(p, center=(p.center[0] + 1024.0, p.center[1] - 1024.0))
            for p in here.pulleys
        ],
    )
    one, other = (bd.settle(p, friction=True, pulleys=pulleys) for p in (here, there))
    assert np.max(np.abs(one.mu)) > 1e-2
    assert np.max(np.abs(one.mu - other.mu)) <= 1e-6
    assert np.max(np.abs(one.x + 1024.0 - other.x)) <= 1e-9


# ------------------------------------------------------------------ how it was tensioned
def test_tensioning_of_params_is_what_settle_and_simulate_do() -> None:
    how = bd.Tensioning(friction=True, pulleys="free", offset={1: (-0.001, 0.0)})
    scene = drives.plain_scene()
    plain = scene.params
    params = attrs.evolve(plain, tensioning=how)
    by_params = bd.settle(params)
    by_arguments = bd.settle(plain, friction=True, pulleys="free", offset={1: (-0.001, 0.0)})
    assert np.array_equal(by_params.x, by_arguments.x)
    assert np.array_equal(by_params.mu, by_arguments.mu)
    assert np.abs(by_params.mu).max() > 0.1
    # arguments take the place of the fields, one by one
    assert not bd.settle(params, friction=False).mu.any()
    start = bd.simulate(params, scene.torque_fn, 1e-3, t_eval=[0.0])
    assert np.array_equal(start.contact.mu[0], by_params.mu)


def test_tensioning_survives_toml_and_says_itself() -> None:
    plain = drives.plain()
    how = bd.Tensioning(friction=True, pulleys="free", offset=[[0, 0], [1e-3, 0]], move_time=0.1)
    params = attrs.evolve(plain, tensioning=how)
    assert bd.Params.from_toml(params.to_toml()) == params
    assert "tensioning" not in plain.to_toml()
    assert "tensioned with friction, pulleys free to turn, pulley 1 moved to its place" in str(
        params
    )
    assert how.offset == ((0.0, 0.0), (1e-3, 0.0))
    assert str(bd.Tensioning(shift=-2e-3)).endswith("moved along the belt line by -0.002 m")


def test_a_tensioning_table_may_name_the_pulley() -> None:
    text = (
        drives.plain().to_toml() + "\n[tensioning]\nfriction = true\noffset = { 1 = [-0.006, 0] }"
    )
    tensioning = bd.Params.from_toml(text + "\n").tensioning
    assert tensioning == bd.Tensioning(friction=True, offset={1: (-0.006, 0.0)})


def test_friction_while_settling_needs_a_friction_law() -> None:
    params = attrs.evolve(drives.plain(), friction=None, tensioning=bd.Tensioning(friction=True))
    assert not bd.settle(params).mu.any()


@pytest.mark.parametrize(
    ("fields", "error", "message"),
    [
        ({"friction": 1}, TypeError, "friction must be a bool"),
        ({"pulleys": "loose"}, ValueError, "pulleys must be one of held, free"),
        ({"offset": 3}, TypeError, "offset must be a mapping"),
        ({"offset": {-1: (0, 0)}}, ValueError, "offset index must be an integer from 0 to 9999"),
        ({"offset": [(0, 0, 0)]}, TypeError, r"offset\[0\] must be a pair"),
        ({"offset": {0: (np.nan, 0)}}, ValueError, r"offset\[0\]\[0\] must be finite"),
        ({"move_time": 0.0}, ValueError, "move_time must be > 0"),
    ],
)
def test_a_bad_tensioning_is_named(
    fields: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        bd.Tensioning(**fields)


def test_tensioning_must_fit_the_pulleys() -> None:
    params = drives.plain()
    with pytest.raises(ValueError, match="one of the 2 pulley"):
        attrs.evolve(params, tensioning=bd.Tensioning(offset={2: (0.0, 0.0)}))
    with pytest.raises(TypeError, match="tensioning must be a Tensioning"):
        attrs.evolve(params, tensioning="free")


@pytest.mark.parametrize("friction", [False, True])
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


def test_half_a_link_on_is_another_place() -> None:
    params = bd.scenes.unequal_pulleys().params
    pitch = params.info["path_length"] / params.belt.n_bodies
    here = bd.settle(params, friction=True)
    there = bd.settle(params, friction=True, shift=pitch / 2)
    assert there.x[3] - here.x[3] == pytest.approx(pitch / 2, rel=0.1)
