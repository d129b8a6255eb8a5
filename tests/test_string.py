"""The belt of point masses (MODEL section 2, "String"): rates, outputs and rest against the oracle
and closed forms, and against links, whose limit it shares; what chooses it, what refuses it.

Jacobians, kernels, methods, the ledger, symmetries and runs against the oracle are in the tests of
those, which go through every mesh; starts at speed, a weight's tension included, in
test_start_at_speed.py; lateral vibration in test_modes.py; drums in test_capstan.py.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import attrs
import drives
import mounted_drives
import numpy as np
import pytest
import reference
from bridge import fields, oracle_of
from dense import MOUNT_STATES, by_slot, slots_of
from laws import EXAMPLES, with_laws
from oracle_drives import shaken
from reference_line import tension_at_rest
from reference_mounts import Path
from reference_string import String
from test_kernels import available
from tiers import first

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def string(params: bd.Params) -> bd.Params:
    return drives.on_mesh(params, "string")


def three(**changes: Any) -> bd.Params:
    """Three unequal pulleys with gravity, drag on two of them."""
    params = bd.scenes.three_pulleys().params
    drags = (bd.Drag(coulomb=3.0, viscous=0.1, quadratic=0.02), None, bd.Drag(viscous=0.3))
    pulleys = [attrs.evolve(p, drag=d) for p, d in zip(params.pulleys, drags, strict=True)]
    return string(attrs.evolve(params, pulleys=pulleys, **changes))


def mixed() -> bd.Params:
    """Each pulley with a law of its own, the last one without."""
    return with_laws(three(), EXAMPLES["lugre"], EXAMPLES["elastic_plastic"], None)


DRIVES: dict[str, Any] = {
    "two pulleys": lambda: string(drives.plain()),
    "no friction": lambda: string(attrs.evolve(drives.plain(), friction=None)),
    **{name: lambda law=law: three(friction=law) for name, law in EXAMPLES.items()},
    "mixed laws": mixed,
    "crossed": lambda: string(drives.crossed_scene().params),
    "outside idler": lambda: string(drives.idler_scene().params),
    **{name: make for name, make in mounted_drives.DRIVES.items() if name.startswith("string")},
}


def at_random(params: bd.Params, seed: int) -> tuple[String, reference.Array, dict[str, Any]]:
    """A shaken state of the oracle's, off the kinks, and the same for the core."""
    oracle = oracle_of(params)
    assert isinstance(oracle, String)
    y = shaken(oracle, seed)
    state = oracle.unpack(y)
    for q, one in zip(state["travel"], oracle.mounts.values(), strict=True):
        state["t"] = q if isinstance(one, Path) else state["t"]
    # by mass, each on one pulley at most; slip where there is friction
    assert ((oracle.penetration(y) > 0).sum(axis=0) <= 1).all()
    ruled = np.array([law is not None for law in oracle.laws])[:, None]
    memory = oracle.memory(y)
    memory[-1] *= ruled
    for key, part in {"mu": memory[: params.info["n_states"]], "slip": memory[-1:]}.items():
        state[key] = by_slot(part if ruled.any() else part[:0], slots_of(oracle))
    state["phi"], state["vphi"] = oracle.angles(y)
    return oracle, y, state


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", DRIVES)
def test_rates_at_every_level(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To rounding: positions of 0.3 m carry 5e-17 m, stretches of some 1e-4 m enter the forces."""
    for seed in range(3):
        params = DRIVES[name]()
        oracle, y, state = at_random(params, seed)
        torque = 5.0 * np.random.default_rng(seed).standard_normal(oracle.n_pulleys)
        dy = oracle.rhs(state["t"], y, lambda t, a, b, torque=torque: torque)
        expected = oracle.unpack(dy)
        for level in available(monkeypatch):
            monkeypatch.setenv("BELTDYN_KERNELS", level)
            rate = attrs.evolve(params, belt=params.belt)._model.rate(state, torque)
            for key in ("x", "y", "vx", "vy", "theta", "omega", "mu", "slip", *MOUNT_STATES):
                want = np.asarray(expected[key])
                if key in ("mu", "slip"):
                    want = by_slot(want, slots_of(oracle))[: np.size(state[key])]
                scale = np.max(np.abs(want), initial=0.0)
                apart = np.max(np.abs(np.ravel(rate[key]) - want), initial=0.0)
                assert apart <= 1e-10 * scale, (key, level, seed)


@pytest.mark.parametrize("name", DRIVES)
def test_outputs_are_the_oracles(name: str) -> None:
    """Bars, contact by mass, directions of the bars, stored energy, at the start of a run."""
    params = DRIVES[name]()
    oracle, y, state = at_random(params, 4)
    names, n = {field.name for field in attrs.fields(bd.State)}, oracle.n_bodies
    given = {key: value for key, value in state.items() if key in names}
    given |= {key: np.zeros(n) for key in ("mu", "slip") if not np.size(state[key])}
    given |= {key: np.reshape(given[key], (-1, n)) for key in ("mu", "slip")}
    start = bd.State(**given)
    still = bd.Viscous([0.0] * oracle.n_pulleys)
    result = bd.simulate(params, still, start.t + 1e-9, initial=start, t_eval=[start.t])
    deformation, force = oracle.joints(y)
    contacts = oracle.contacts(y)
    touched = (contacts.share > 0).any(axis=0)
    assert touched.sum() > 5 and not touched.all()
    pulley = np.where(touched, (contacts.share > 0).argmax(axis=0), -1)
    assert np.array_equal(result.contact.pulley[0], pulley)
    belt, joints, contact = result.belt, result.joints, result.contact
    for got, want in (
        (joints.deformation, deformation),
        (joints.force, force),
        (contact.normal, contacts.normal.sum(axis=0)),
        (contact.friction, contacts.friction.sum(axis=0)),
        (contact.mu, contacts.mu.sum(axis=0)),
        (contact.velocity, (contacts.velocity * (contacts.share > 0)).sum(axis=0)),
        (belt.x, state["x"]),
        (belt.vy, state["vy"]),
        (belt.vphi, state["vphi"]),
    ):
        # what presses is a difference of places to the contact's stiffness: 1e-16 m over 1e-6 m
        assert np.max(np.abs(got[0] - want)) <= 1e-9 * np.max(np.abs(want))
    turned = (belt.phi[0] - state["phi"]) / (2 * math.pi)
    assert np.max(np.abs(turned - round(turned[0]))) < 1e-12
    terms, energy = oracle.energy_terms(y), result.energy
    assert terms["rotation"] == terms["bending"] == energy.bending[0] == 0.0
    moving = terms["translation"] + terms["pulleys"] + terms.get("moved mounts", 0.0)
    assert energy.kinetic[0] == pytest.approx(float(moving), rel=1e-12)
    assert energy.axial[0] == pytest.approx(float(terms["stretching"]), rel=1e-9)
    assert energy.contact[0] == pytest.approx(float(terms["contact"]), rel=1e-9)


def test_numbers_gone_show_in_the_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of links in test_kernels.py; a bar between masses at one place has no direction."""
    params = string(bd.scenes.kubas_case_1().params)
    start = fields(bd.settle(params))
    for (name, mass), level in itertools.product(
        [("x", 0), ("y", 30), ("vx", 59), ("vy", 0), ("a mass on an axis", 59), ("no bar", 0),
         ("no bar", 30)], available(monkeypatch),
    ):  # fmt: skip
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        state = {key: np.array(values) for key, values in start.items()} | {"t": 0.0}
        if name == "a mass on an axis":
            state["x"][mass], state["y"][mass] = params.pulleys[1].center
        elif name == "no bar":
            state["x"][mass], state["y"][mass] = state["x"][mass - 1], state["y"][mass - 1]
        else:
            state[name][mass] = 1.7e308
        rate = attrs.evolve(params, belt=params.belt)._model.rate(state, np.zeros(2))
        assert not np.isfinite([rate[key] for key in ("vx", "vy")]).all(), (level, name, mass)


@pytest.mark.parametrize(
    ("name", "friction"),
    [("two pulleys", True), ("dahl", False), ("crossed", True), ("outside idler", False)],
)
def test_nothing_is_left_at_rest(name: str, friction: bool) -> None:
    """The oracle finds no force on a mass beyond the tolerance, 1e-9 of the tension, and all masses
    where joints of links would be: shifted along the belt line, l0 apart.
    """
    params = DRIVES[name]()
    state = bd.settle(params, friction=friction)
    assert state.residual <= 1e-9
    assert not any(getattr(state, v).any() for v in ("vx", "vy", "vphi", "omega"))
    oracle = oracle_of(params)
    y = oracle.pack(fields(state))
    rate = oracle.links(oracle.rhs(0.0, y, lambda t, a, b: 0.0 * a))[1]
    assert oracle.mass * np.hypot(*rate).max() <= 1.1e-9 * params.info["strain_tension"]
    turns = (state.phi - oracle.angles(y)[0]) / (2 * math.pi)
    assert np.max(np.abs(turns - round(turns[0]))) < 1e-9
    assert np.all(np.abs(np.diff(state.phi)) < math.pi)
    links = drives.on_mesh(params, "joint")
    other, half = bd.settle(links, friction=friction), 0.5 * links.info["link_length"]
    left = np.array([other.x - half * np.cos(other.phi), other.y - half * np.sin(other.phi)])
    # to the sag of a chord over its arc, l0^2/8r
    assert np.hypot(state.x - left[0], state.y - left[1]).max() <= 0.2 * half


@pytest.mark.parametrize(
    ("name", "compensate"), [("two pulleys", False), ("dahl", True), ("outside idler", True)]
)
def test_tension_at_rest_is_that_of_a_string(name: str, compensate: bool) -> None:
    """MODEL section 6 with EI = 0, compliance of the contact included: 0.1 % of fine belts."""
    params = DRIVES[name]()
    contact = attrs.evolve(params.contact, compensate=compensate)
    belt = attrs.evolve(params.belt, n_bodies=480)
    params = attrs.evolve(params, belt=belt, contact=contact, gravity=(0.0, 0.0))
    oracle = oracle_of(params)
    expected = tension_at_rest(
        oracle.centers, oracle.radii, oracle.sides, oracle.length,
        (oracle.axial_stiffness, 0.0), oracle.contact, compensate,
    )  # fmt: skip
    found = bd.settle(params, friction=False, tolerance=1e-6).tension(params)
    assert found.mean == pytest.approx(expected, rel=1e-3)
    assert params.info["mean_tension"] == pytest.approx(found.mean, rel=1e-3)


def test_string_and_links_rest_at_one_limit() -> None:
    """Mean tensions at rest differ by order 2 in l0, a quarter each time: 0.04 % with 60 bodies.

    (Settled to 1e-7; which place of its polygon a belt rests at makes some 1e-5 of it.)
    """

    def at_rest(n_bodies: int, model: str) -> float:
        params = string(drives.plain())
        belt = attrs.evolve(params.belt, n_bodies=n_bodies, model=model)
        params = attrs.evolve(params, belt=belt)
        return float(bd.settle(params, friction=False, tolerance=1e-7).tension(params).mean)

    apart = {n: at_rest(n, "string") / at_rest(n, "links") - 1.0 for n in (60, 120, 240)}
    assert abs(apart[60]) < 6e-4
    assert apart[60] / apart[120] == pytest.approx(4.0, rel=0.25), apart
    assert apart[120] / apart[240] == pytest.approx(4.0, rel=0.25), apart


def in_steady_motion(n_bodies: int, model: str) -> tuple[float, float]:
    """Slack tension [N], over which it runs by whole links, and creep [%]."""
    scene = drives.scene_m()
    belt = attrs.evolve(string(scene.params).belt, n_bodies=n_bodies, model=model)
    params = attrs.evolve(scene.params, belt=belt)
    run = bd.simulate(
        params, scene.torque_fn, 1.2, rtol=1e-3, method="rodas4", t_eval=np.linspace(0.9, 1.2, 3001)
    )
    turned = np.abs(run.pulleys.theta[:, 0] - run.pulleys.theta[0, 0])
    passed = turned * params.pulleys[0].radius / params.info["link_length"]
    window = run.t <= np.interp(math.floor(passed[-1]), passed, run.t)
    tension = run.span_tension[window].mean(axis=0)
    speed = np.abs(run.pulleys.omega[window].mean(axis=0))
    return float(tension.min()), float(100.0 * (1.0 - speed[1] / speed[0]))


@pytest.mark.parametrize(
    ("n_bodies", "slack", "creep"), first(1, [(60, 0.01, 0.015), (240, 1e-3, 2e-3)])
)
def test_string_and_links_run_at_one_limit(n_bodies: int, slack: float, creep: float) -> None:
    """The paper's drive with 60 N m and EI = 0 in steady motion: slack tension 0.75 % apart with 60
    bodies, 0.19 % with 120, 0.04 % with 240; creep 1.1, 0.3 and 0.1 % of itself.
    """
    ours, links = (in_steady_motion(n_bodies, model) for model in ("string", "links"))
    assert ours[0] == pytest.approx(links[0], rel=slack)
    assert ours[1] == pytest.approx(links[1], rel=creep)


def test_which_belt_it_is() -> None:
    """The string wherever nothing bends and contact is along the links; asked for elsewhere it is
    refused, by the name of what is in its way.
    """
    base = drives.plain()
    assert base.belt.model == "auto"
    for bends, damps, model, mesh in itertools.product(
        (0.0, 0.01), (0.0, 1e-5), ("auto", "links", "string"), ("joint", "paper")
    ):
        belt = attrs.evolve(
            base.belt, bending_stiffness=bends, bending_damping=damps, mesh=mesh, model=model
        )
        reasons = {"mesh": mesh == "paper", "bending_stiffness": bends, "bending_damping": damps}
        reason = next((name for name, one in reasons.items() if one), None)
        if model == "string" and reason:
            with pytest.raises(ValueError, match=rf"belt\.model.*string.*{reason}"):
                attrs.evolve(base, belt=belt)
            continue
        made = attrs.evolve(base, belt=belt)
        assert made.belt_model == ("links" if reason or model == "links" else "string")
    text = string(base).to_toml()
    assert 'model = "string"' in text
    for value in ("String", "", "masses", "rigid"):
        with pytest.raises(ValueError, match=r"belt\.model must be"):
            attrs.evolve(base.belt, model=value)
        with pytest.raises(ValueError, match="model"):
            bd.Params.from_toml(text.replace('"string"', f'"{value}"'))


def test_a_final_state_goes_on_and_knows_no_angles() -> None:
    """A run in two halves is the run in one, to what was asked; whatever angles a state names,
    places and velocities are all that the masses have.
    """
    torque, params = drives.scene_m().torque_fn, string(drives.scene_m().params)
    start = bd.simulate(params, torque, 0.2, t_eval=[0.2]).final_state
    times = np.linspace(0.201, 0.22, 20)

    def run(t_end: float, initial: bd.State, at: Any) -> bd.Result:
        options: dict[str, Any] = {"t_eval": at, "method": "tsit5", "rtol": 1e-8}
        return bd.simulate(params, torque, t_end, initial=initial, **options)

    whole, half = run(0.22, start, times), run(0.21, start, [0.21])
    end = half.final_state
    assert np.array_equal(end.x, half.belt.x[-1]) and np.array_equal(end.vy, half.belt.vy[-1])
    assert np.allclose(end.phi, half.belt.phi[-1], atol=1e-12)
    apart = np.abs(run(0.22, end, times[10:]).joints.force - whole.joints.force[10:]).max()
    assert apart <= 1e-6 * params.info["strain_tension"]
    odd = run(0.21, attrs.evolve(start, phi=0.0 * start.phi, vphi=1e3 + start.vphi), [0.21])
    for name in ("x", "y", "vx", "phi"):
        assert np.array_equal(getattr(odd.belt, name), getattr(half.belt, name)), name
    assert np.array_equal(odd.joints.force, half.joints.force)


def test_rates_know_of_no_numbering() -> None:
    """Masses thrown off their pulleys, so that dampers take all force off bars which still touch: a
    mass off the pulley has its share of the bar before it wherever a block of lanes begins. To the
    bit, for each mass is computed from the same numbers.
    """
    params = drives.on_mesh(drives.plain(), "string")
    state = dict(fields(bd.settle(params)))
    away = (
        np.array([[state["x"], state["y"]]])
        - np.array([p.center for p in params.pulleys])[..., None]
    )
    near = np.argmin(np.hypot(away[:, 0], away[:, 1]), axis=0)
    out = away[near, :, np.arange(near.size)].T
    out = out / np.hypot(*out)
    state["vx"], state["vy"] = 5.0 * out + np.array([-out[1], out[0]])
    around = {"x", "y", "phi", "vx", "vy", "vphi", "mu", "slip"}

    def rates(shift: int) -> dict[str, np.ndarray]:
        rolled = {k: np.roll(v, -shift) if k in around else v for k, v in state.items()}
        found = params._model.rate(rolled, np.zeros(2))
        return {name: np.roll(found[name], shift) for name in ("vx", "vy", "mu", "slip")}

    expected = rates(0)
    assert np.abs(expected["mu"]).max() > 1e3
    for k in range(1, 16):  # twice the lanes of the widest level
        for name, values in rates(k).items():
            assert np.array_equal(values, expected[name]), (k, name)
