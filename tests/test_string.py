"""The belt of point masses (MODEL section 2, "String"): rates, outputs and rest against the oracle
and closed forms, and against links, whose limit it shares; what chooses it, what refuses it.

Jacobians, kernels, energy, symmetries and runs against the oracle are in the tests of those, which
go through every mesh; records in test_record.py; mounts in test_mounts_oracle.py; starts at speed
in test_start_at_speed.py; the capstan in test_capstan.py.
"""

from __future__ import annotations

import functools
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
from dense import MOUNT_STATES
from laws import EXAMPLES, with_laws
from oracle_drives import shaken
from reference_line import spans_away, tension_at_rest
from reference_mounts import Path
from reference_string import String
from test_kernels import available
from tiers import first

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def string(params: bd.Params, **belt: Any) -> bd.Params:
    params = drives.on_mesh(params, "string")
    return attrs.evolve(params, belt=attrs.evolve(params.belt, **belt))


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
    rubbed = slice(None) if ruled.any() else slice(0, 0)
    by_mass = memory.sum(axis=1)
    state["mu"], state["slip"] = by_mass[: params.info["n_states"]].ravel(), by_mass[-1, rubbed]
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
                    want = want.sum(axis=-2).ravel()[: np.size(state[key])]
                scale = np.max(np.abs(want), initial=0.0)
                apart = np.max(np.abs(np.ravel(rate[key]) - want), initial=0.0)
                assert apart <= 1e-10 * scale, (key, level, seed)


def test_the_comparison_sees_a_part_of_a_thousand() -> None:
    """Of the stiffness of bars, their damping, the contact radius, the masses."""
    params = DRIVES["dahl"]()
    _, _, state = at_random(params, 0)
    still = np.zeros(3)
    right = params._model.rate(state, still)
    belt = params.belt
    for change in (
        {"axial_stiffness": 1.001 * belt.axial_stiffness},
        {"axial_damping": 1.001 * belt.axial_damping},
        {"linear_density": 1.001 * belt.linear_density},
    ):
        other = attrs.evolve(params, belt=attrs.evolve(belt, **change))._model.rate(state, still)
        assert np.max(np.abs(other["vx"] - right["vx"])) > 1e-5 * np.max(np.abs(right["vx"]))


@pytest.mark.parametrize("name", DRIVES)
def test_outputs_are_the_oracles(name: str) -> None:
    """Bars, contact by mass, directions of the bars, stored energy, at the start of a run."""
    params = DRIVES[name]()
    oracle, y, state = at_random(params, 4)
    names = {field.name for field in attrs.fields(bd.State)}
    given = {key: value for key, value in state.items() if key in names}
    n = oracle.n_bodies
    given |= {key: np.zeros(n) for key in ("mu", "slip") if not np.size(state[key])}
    if oracle.n_states > 1:
        given["mu"] = given["mu"].reshape(-1, n)
    start = bd.State(**given)
    still = bd.Viscous([0.0] * oracle.n_pulleys)
    t = start.t
    result = bd.simulate(params, still, t + 1e-9, initial=start, t_eval=[t])
    deformation, force = oracle.joints(y)
    contacts = oracle.contacts(y)
    touched = (contacts.share > 0).any(axis=0)
    assert touched.sum() > 5 and not touched.all()
    pulley = np.where(touched, (contacts.share > 0).argmax(axis=0), -1)
    assert np.array_equal(result.contact.pulley[0], pulley)
    phi, vphi = state["phi"], state["vphi"]
    ours = {
        "deformation": (result.joints.deformation, deformation),
        "force": (result.joints.force, force),
        "normal": (result.contact.normal, contacts.normal.sum(axis=0)),
        "friction": (result.contact.friction, contacts.friction.sum(axis=0)),
        "mu": (result.contact.mu, contacts.mu.sum(axis=0)),
        "velocity": (result.contact.velocity, (contacts.velocity * (contacts.share > 0)).sum(0)),
        "x": (result.belt.x, state["x"]),
        "vy": (result.belt.vy, state["vy"]),
        "vphi": (result.belt.vphi, vphi),
    }
    for key, (got, want) in ours.items():
        scale = np.max(np.abs(want))
        # what presses is a difference of places to the contact's stiffness: 1e-16 m over 1e-6 m
        assert np.max(np.abs(got[0] - want)) <= 1e-9 * scale, key
    turned = (result.belt.phi[0] - phi) / (2 * math.pi)
    assert np.max(np.abs(turned - round(turned[0]))) < 1e-12
    terms = oracle.energy_terms(y)
    assert terms["rotation"] == terms["bending"] == 0.0
    energy = result.energy
    moving = terms["translation"] + terms["pulleys"] + terms.get("moved mounts", 0.0)
    assert energy.kinetic[0] == pytest.approx(float(moving), rel=1e-12)
    assert energy.axial[0] == pytest.approx(float(terms["stretching"]), rel=1e-9)
    assert energy.contact[0] == pytest.approx(float(terms["contact"]), rel=1e-9)
    assert energy.bending[0] == 0.0


@pytest.mark.parametrize(
    ("name", "mass"),
    [("x", 0), ("y", 30), ("vx", 59), ("vy", 0), ("a mass on an axis", 59),
     ("a bar without length", 0), ("a bar without length", 30)],
)  # fmt: skip
def test_numbers_gone_show_in_the_rates(
    monkeypatch: pytest.MonkeyPatch, name: str, mass: int
) -> None:
    """As those of links in test_kernels.py; a bar between masses at one place has no direction."""
    params = string(bd.scenes.kubas_case_1().params)
    start = fields(bd.settle(params))
    for level in available(monkeypatch):
        monkeypatch.setenv("BELTDYN_KERNELS", level)
        state = {key: np.array(values) for key, values in start.items()} | {"t": 0.0}
        if name == "a mass on an axis":
            state["x"][mass], state["y"][mass] = params.pulleys[1].center
        elif name == "a bar without length":
            state["x"][mass], state["y"][mass] = state["x"][mass - 1], state["y"][mass - 1]
        else:
            state[name][mass] = 1.7e308
        rate = attrs.evolve(params, belt=params.belt)._model.rate(state, np.zeros(2))
        assert not np.isfinite([rate[key] for key in ("vx", "vy")]).all(), level


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
    phi, _ = oracle.angles(y)
    turns = (state.phi - phi) / (2 * math.pi)
    assert np.max(np.abs(turns - round(turns[0]))) < 1e-9
    assert np.all(np.abs(np.diff(state.phi)) < math.pi)
    links = drives.on_mesh(params, "joint")
    other = bd.settle(links, friction=friction)
    e = other.phi - np.roll(other.phi, 1)
    assert np.all(np.isfinite(e))
    half = 0.5 * links.info["link_length"]
    left = np.array([other.x - half * np.cos(other.phi), other.y - half * np.sin(other.phi)])
    # to the sag of a chord over its arc, l0^2/8r
    apart = np.hypot(state.x - left[0], state.y - left[1]).max()
    assert apart <= 0.1 * links.info["link_length"]


@pytest.mark.parametrize(
    ("name", "compensate"), [("two pulleys", False), ("dahl", True), ("outside idler", True)]
)
def test_tension_at_rest_is_that_of_a_string(name: str, compensate: bool) -> None:
    """MODEL section 6 with EI = 0, compliance of the contact included: 0.1 % of fine belts."""
    params = DRIVES[name]()
    contact = attrs.evolve(params.contact, compensate=compensate)
    params = attrs.evolve(
        params, belt=attrs.evolve(params.belt, n_bodies=480), contact=contact, gravity=(0.0, 0.0)
    )
    state = bd.settle(params, friction=False, tolerance=1e-6)
    oracle = oracle_of(params)
    path, wraps, _ = spans_away(oracle.centers, oracle.radii, oracle.sides)
    expected = tension_at_rest(
        path / oracle.length - 1.0, oracle.length, oracle.radii, wraps,
        (oracle.axial_stiffness, 0.0), oracle.contact, compensate,
    )  # fmt: skip
    found = state.tension(params)
    assert found.mean == pytest.approx(expected, rel=1e-3)
    assert params.info["mean_tension"] == pytest.approx(found.mean, rel=1e-3)


def test_a_slider_s_weight_sets_the_tension_and_speed_adds_to_it() -> None:
    """T = w g/2 in the spans at rest, and rho A v^2 l0/lambda more when running (section 9).

    Each mass on a wrap turns by 2a and T_i + T_{i+1} pull it inwards by sin a; what is left is held
    by the pulley, whose weight carries it. Equal pulleys, parallel spans; 0.1 % of a polygon.
    """
    params = string(mounted_drives.take_up(n_bodies=120))
    weight = 24.0 * 9.80665
    rest = bd.settle(params).tension(params).spans
    assert rest == pytest.approx(0.5 * weight, rel=1e-3)
    omega = 250.0
    state = bd.settle(params, speed={0: -omega})
    speed = np.hypot(state.vx, state.vy)
    turning = np.abs(state.vphi) > 1e-3 * omega
    v = float(np.median(speed[~turning]))
    assert v == pytest.approx(omega * 0.08, rel=5e-3)
    spans = state.tension(params).spans
    stretch = 1.0 + spans.mean() / params.belt.axial_stiffness
    more = params.belt.linear_density * v**2 / stretch
    assert more > 0.2 * spans.mean()
    assert spans - more == pytest.approx(rest, abs=1e-3 * spans.mean())


def test_lateral_vibration_of_a_span() -> None:
    """First lateral frequency of a long span: w = 2 sqrt(T/(m lambda)) sin(pi/2N), N bars free.

    With pi/2N for its sine that is pi/L sqrt(T/rho A), of a taut string. The ends are the masses
    next to the span that have sunk into a pulley, on whose stiffness c2 a span pulls with T/lambda:
    T/(lambda c2) of a bar further, each. Small: 1e-5 of a bar sideways, a tenth of what they have
    sunk in by.
    """
    pulleys = [bd.Pulley(center=(x, 0.0), radius=0.05, inertia=1e6) for x in (0.0, 1.5)]
    contact = bd.Contact(linear=4e9, damping=1e3)
    params = bd.Params(
        belt=bd.Belt(length=bd.route(pulleys).length / 1.006, n_bodies=140, linear_density=0.1,
                     axial_stiffness=70e3, model="string"),
        pulleys=pulleys, contact=contact, friction=None,
    )  # fmt: skip
    rest = bd.settle(params)
    oracle = oracle_of(params)
    inside = (oracle.along_links_at(oracle.pack(fields(rest))).p_left > 0.0).any(axis=0)
    upper = (~inside) & (rest.y > 0.0)
    inner = np.flatnonzero(upper)
    assert np.all(np.diff(inner) == 1)
    n_bars = len(inner) + 1
    tension = float(rest.tension(params).spans.mean())
    length = oracle.l0 * (1.0 + tension / params.belt.axial_stiffness)
    m = oracle.mass
    give = tension / (length * contact.linear * oracle.l0)
    assert give < 1e-3
    w = 2.0 * math.sqrt(tension / (m * length)) * math.sin(0.5 * math.pi / (n_bars + 2.0 * give))
    shape = np.sin(math.pi * np.arange(1, n_bars) / n_bars)
    vy = rest.vy.copy()
    vy[inner] += 1e-5 * length * w * shape
    period = 2.0 * math.pi / w
    times = np.linspace(0.0, 5.25 * period, 1001)
    run = bd.simulate(
        params, bd.Viscous([0.0, 0.0]), times[-1],
        initial=attrs.evolve(rest, vy=vy), t_eval=times, method="tsit5", rtol=1e-5,
    )  # fmt: skip
    lift = (run.belt.y - rest.y)[:, inner] @ shape
    crossings = np.flatnonzero(np.diff(np.sign(lift[1:]))) + 1
    at = times[crossings] - lift[crossings] * (times[1] - times[0]) / np.diff(lift)[crossings]
    assert len(at) == 10
    found = math.pi * (len(at) - 1) / (at[-1] - at[0])
    assert found == pytest.approx(w, rel=3e-4)
    string_of_length = math.pi / (n_bars * length) * math.sqrt(tension / (m / length))
    assert w == pytest.approx(string_of_length, rel=1e-3)


@functools.cache
def running() -> tuple[bd.Params, bd.State]:
    scene = drives.scene_m()
    params = string(scene.params)
    return params, bd.simulate(params, scene.torque_fn, 0.2, t_eval=[0.2]).final_state


#: Every law, and every method.
LAW_BY_METHOD = [*zip(EXAMPLES, itertools.cycle(mounted_drives.METHODS), strict=False)]


@pytest.mark.parametrize(("law", "method"), LAW_BY_METHOD)
def test_every_method(law: str, method: str) -> None:
    """Forces err by what was asked, rk4 by less than 1e-4; the balance closes (test_drag.py)."""
    params = string(attrs.evolve(drives.scene_m().params, friction=EXAMPLES[law]))
    torque = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-60.0, 0.0]]) + bd.Viscous([0.0, 16.0])
    given: dict[str, Any] = {"initial": bd.settle(params), "t_eval": np.linspace(0.0, 0.03, 31)}
    tight = bd.simulate(params, torque, 0.03, method="tsit5", rtol=1e-8, **given)
    options = mounted_drives.METHODS[method]
    run = bd.simulate(params, torque, 0.03, method=method, **options, **given)
    apart = (run.joints.force - tight.joints.force) / params.info["strain_tension"]
    rtol = options.get("rtol", 1e-4)
    assert np.sqrt(np.mean(apart**2)) <= rtol
    assert np.max(np.abs(run.energy.residual)) <= 10 * rtol * run.energy.passed[-1]


def test_the_balance_closes_with_the_tolerance() -> None:
    """Over a run through rest, ramp and slip, with all that takes energy."""
    scene = drives.scene_m()
    params = string(scene.params)
    drag = bd.Drag(coulomb=1.0, viscous=0.1)
    params = attrs.evolve(
        params,
        pulleys=[params.pulleys[0], attrs.evolve(params.pulleys[1], drag=drag)],
        gravity=(0.0, -9.81),
    )
    left = []
    for rtol in (1e-3, 1e-7):
        energy = bd.simulate(params, scene.torque_fn, 0.15, rtol=rtol).energy
        left.append(np.max(np.abs(energy.residual)) / energy.passed[-1])
        assert energy.drag_loss is not None
        for loss in (energy.joint_loss, energy.contact_loss, energy.drag_loss):
            assert np.min(np.diff(loss)) >= 0.0 and loss[-1] > 0.0
    assert left[1] <= 1e-6
    assert left[1] < 0.1 * left[0]


def paper_drive(n_bodies: int, model: str) -> bd.Params:
    """The paper's, without bending."""
    params = drives.plain()
    changes = {"n_bodies": n_bodies, "mesh": "joint", "model": model, "bending_stiffness": 0.0}
    return attrs.evolve(params, belt=attrs.evolve(params.belt, **changes))


def test_string_and_links_rest_at_one_limit() -> None:
    """Mean tensions at rest differ by order 2 in l0, a quarter each time: 0.04 % with 60 bodies.

    (Settled to 1e-7; which place of its polygon a belt rests at makes some 1e-5 of it.)
    """

    def at_rest(n_bodies: int, model: str) -> float:
        params = paper_drive(n_bodies, model)
        return float(bd.settle(params, friction=False, tolerance=1e-7).tension(params).mean)

    apart = {n: at_rest(n, "string") / at_rest(n, "links") - 1.0 for n in (60, 120, 240)}
    assert abs(apart[60]) < 6e-4
    assert apart[60] / apart[120] == pytest.approx(4.0, rel=0.25), apart
    assert apart[120] / apart[240] == pytest.approx(4.0, rel=0.25), apart


@functools.cache
def in_steady_motion(n_bodies: int, model: str) -> tuple[float, float]:
    """Slack tension [N], over which it runs by whole links, and creep [%]."""
    scene = drives.scene_m()
    belt = attrs.evolve(drives.on_mesh(scene.params, "string").belt, n_bodies=n_bodies, model=model)
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


@pytest.mark.parametrize("bending", [(0.0, 0.0), (0.01, 0.0), (0.0, 1e-5), (0.01, 1e-5)])
def test_which_belt_it_is(bending: tuple[float, float]) -> None:
    """The string wherever nothing bends and contact is along the links; asked for elsewhere it is
    refused, by the name of what is in its way.
    """
    base = drives.plain()
    for model, mesh in itertools.product(("auto", "links", "string"), ("joint", "paper")):
        changes = {"bending_stiffness": bending[0], "bending_damping": bending[1], "mesh": mesh}
        may_be = bending == (0.0, 0.0) and mesh == "joint"
        if model == "string" and not may_be:
            given = {"mesh": mesh == "paper"}
            given |= dict(zip(("bending_stiffness", "bending_damping"), bending, strict=True))
            reason = next(name for name, one in given.items() if one)
            with pytest.raises(ValueError, match=rf"belt\.model.*string.*{reason}"):
                attrs.evolve(base, belt=attrs.evolve(base.belt, model=model, **changes))
            continue
        made = attrs.evolve(base, belt=attrs.evolve(base.belt, model=model, **changes))
        assert made.belt_model == ("string" if may_be and model != "links" else "links")


def test_auto_is_what_is_chosen_and_nothing_else() -> None:
    """The same bits as the string that is asked for; links where they are."""
    base = drives.plain()
    belt = attrs.evolve(base.belt, bending_stiffness=0.0, mesh="joint")
    assert belt.model == "auto"
    rates = []
    for model in ("auto", "string"):
        params = attrs.evolve(base, belt=attrs.evolve(belt, model=model))
        _, _, state = at_random(params, 1)
        rates.append(params._model.rate(state, np.zeros(2)))
    assert all(np.array_equal(rates[0][key], rates[1][key]) for key in rates[0])


def test_toml_says_the_model_and_what_is_none_is_refused() -> None:
    params = string(drives.plain())
    text = params.to_toml()
    assert 'model = "string"' in text
    again = bd.Params.from_toml(text)
    assert again == params and again.belt_model == "string"
    for value in ("String", "", "masses", "rigid"):
        with pytest.raises(ValueError, match=r"belt\.model must be"):
            attrs.evolve(params.belt, model=value)
        with pytest.raises(ValueError, match="model"):
            bd.Params.from_toml(text.replace('"string"', f'"{value}"'))


def test_a_final_state_goes_on() -> None:
    """A run in two halves is the run in one, to what was asked; and a saved state is the same."""
    params, start = running()
    torque = drives.scene_m().torque_fn
    times = np.linspace(0.201, 0.22, 20)

    def run(t_end: float, initial: bd.State, at: np.ndarray) -> bd.Result:
        options: dict[str, Any] = {"t_eval": at, "method": "tsit5", "rtol": 1e-8}
        return bd.simulate(params, torque, t_end, initial=initial, **options)

    whole, half = run(0.22, start, times), run(0.21, start, np.array([0.21]))
    end = half.final_state
    assert np.array_equal(end.x, half.belt.x[-1]) and np.array_equal(end.vy, half.belt.vy[-1])
    assert np.allclose(end.phi, half.belt.phi[-1], atol=1e-12)
    apart = np.abs(run(0.22, end, times[10:]).joints.force - whole.joints.force[10:]).max()
    assert apart <= 1e-6 * params.info["strain_tension"]


def test_a_string_knows_no_angles() -> None:
    """Whatever angles a state names: places and velocities are all that the masses have."""
    params, start = running()
    torque = drives.scene_m().torque_fn
    odd = attrs.evolve(start, phi=0.0 * start.phi, vphi=1e3 + start.vphi)
    one, other = (
        bd.simulate(params, torque, 0.205, initial=state, t_eval=[0.205]) for state in (start, odd)
    )
    for name in ("x", "y", "vx", "phi"):
        assert np.array_equal(getattr(one.belt, name), getattr(other.belt, name)), name
    assert np.array_equal(one.joints.force, other.joints.force)
