"""The core against the oracle: one initial state, two codes that share nothing, the same curves.

The bounds are the project's promise, not what came out: pulley angles to 1e-8 of the largest, joint
forces to 1e-6 of the mean tension, friction coefficients to 1e-5. Both sides run tight enough that
their own errors, seen by tightening each once more (mu: 3e-7 and 1e-6), stay well below.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import attrs
import drives
import numpy as np
import pytest
import reference_run
from bridge import fields, oracle_of
from dense import MOUNT_STATES
from drives import on_mesh
from laws import EXAMPLES, scaled, with_laws
from slow import slow_if

import beltdyn as bd

WINDOW = 0.05


Start = Callable[[], tuple[bd.scenes.Scene, bd.State]]


def settled_case_1() -> tuple[bd.scenes.Scene, bd.State]:
    scene = bd.scenes.kubas_case_1()
    return scene, bd.settle(scene.params)


def running(make: Callable[[], bd.scenes.Scene], t: float) -> tuple[bd.scenes.Scene, bd.State]:
    scene = make()
    return scene, bd.simulate(*scene[:2], t, t_eval=[t]).final_state


def bending_damped() -> bd.scenes.Scene:
    """The reduction 1:2 with a bending damper, which no scene of the paper has."""
    scene = bd.scenes.unequal_pulleys()
    belt = attrs.evolve(scene.params.belt, bending_damping=5e-5)
    return scene._replace(params=attrs.evolve(scene.params, belt=belt))


def dragging() -> bd.scenes.Scene:
    """Case 1 with drag on both pulleys, none of its terms small against the drive's 100 N m."""
    scene = bd.scenes.kubas_case_1()
    drags = (bd.Drag(coulomb=3.0, viscous=0.1, quadratic=0.02), bd.Drag(coulomb=1.0, viscous=0.3))
    pulleys = [
        attrs.evolve(pulley, drag=drag)
        for pulley, drag in zip(scene.params.pulleys, drags, strict=True)
    ]
    return scene._replace(params=attrs.evolve(scene.params, pulleys=pulleys))


def with_law(make: Callable[[], bd.scenes.Scene], law: bd.Friction) -> bd.scenes.Scene:
    scene = make()
    return scene._replace(params=attrs.evolve(scene.params, friction=law))


def mixed(make: Callable[[], bd.scenes.Scene], *laws: bd.Friction | None) -> bd.scenes.Scene:
    scene = make()
    return scene._replace(params=with_laws(scene.params, *laws))


DAHL, LUGRE, ELASTIC = (EXAMPLES[name] for name in ("dahl", "lugre", "elastic_plastic"))


def mixed_two() -> bd.scenes.Scene:
    """Case 1 with a law of its own on each pulley, and coefficients of its own."""
    return mixed(bd.scenes.kubas_case_1, scaled(LUGRE, 1.5), scaled(ELASTIC, 1.3))


def mixed_three() -> bd.scenes.Scene:
    return mixed(bd.scenes.three_pulleys, ELASTIC, None, LUGRE)


def cases_of(name: str, law: bd.Friction) -> dict[str, Start]:
    """Every law of the table but Dahl's, which the cases below have."""
    strong, weak = scaled(law, 1.5), scaled(law, 0.5)

    def case_1() -> bd.scenes.Scene:
        return with_law(bd.scenes.kubas_case_1, strong)

    return {
        f"{name}, from rest": lambda: (case_1(), bd.settle(case_1().params)),
        f"{name}, running": lambda: running(case_1, 0.28),
        f"{name}, three unequal pulleys": lambda: running(
            lambda: with_law(bd.scenes.three_pulleys, law), 0.22
        ),
        f"{name}, full slip": lambda: running(
            lambda: with_law(bd.scenes.flywheel_start, weak), 0.10
        ),
    }


#: Contact of the mass centres, the paper's, for the paper's drive; along the links for the others.
CASES: dict[str, Start] = {
    "case 1 from rest": settled_case_1,
    "case 1 at the end of its ramp": lambda: running(bd.scenes.kubas_case_1, 0.28),
    "three unequal pulleys, gravity, a load step": lambda: running(bd.scenes.three_pulleys, 0.22),
    "1:2 reduction, bending stiff and damped": lambda: running(bending_damped, 0.08),
    "bearing drag, from rest": lambda: (dragging(), bd.settle(dragging().params)),
    "bearing drag, running": lambda: running(dragging, 0.2),
    "flywheel, full slip": lambda: running(bd.scenes.flywheel_start, 0.10),
    "a law for each pulley, from rest": lambda: (mixed_two(), bd.settle(mixed_two().params)),
    "a law for each pulley, running": lambda: running(mixed_two, 0.28),
    "two laws on three pulleys, one without": lambda: running(mixed_three, 0.22),
}


def joints(make: Callable[[], bd.scenes.Scene], t: float = 0.0, mesh: str = "joint") -> Start:
    """The scene with contact of the joints, or a string, from rest or running."""

    def scene() -> bd.scenes.Scene:
        made = make()
        return made._replace(params=on_mesh(made.params, mesh))

    return lambda: running(scene, t) if t > 0.0 else (scene(), bd.settle(scene().params))


def damped_by_force() -> bd.scenes.Scene:
    """Case 1 with Hunt-Crossley damping of its contact."""
    scene = bd.scenes.kubas_case_1()
    contact = attrs.evolve(scene.params.contact, damping=0.0, hunt_crossley=0.5)
    return scene._replace(params=attrs.evolve(scene.params, contact=contact))


CASES |= {
    "damping by the force, from rest": lambda: (
        damped_by_force(),
        bd.settle(damped_by_force().params),
    ),
    "joints, damping by the force, from rest": joints(damped_by_force),
    "joints, damping by the force, running": joints(damped_by_force, 0.28),
    "joints, case 1 from rest": joints(bd.scenes.kubas_case_1),
    "joints, case 1 at the end of its ramp": joints(bd.scenes.kubas_case_1, 0.28),
    "joints, bearing drag, running": joints(dragging, 0.2),
    "joints, a law for each pulley, from rest": joints(mixed_two),
    "joints, a law for each pulley, running": joints(mixed_two, 0.28),
}
CASES |= {
    "string, case 1 from rest": joints(bd.scenes.kubas_case_1, 0.0, "string"),
    # without bending the paper's belt slips at 98.5 N m, short of the end of its ramp
    "string, case 1 at the end of its ramp, full slip": joints(
        bd.scenes.kubas_case_1, 0.28, "string"
    ),
    "string, case 1 on its ramp": joints(bd.scenes.kubas_case_1, 0.2, "string"),
    "string, three unequal pulleys": joints(bd.scenes.three_pulleys, 0.22, "string"),
    "string, bearing drag, running": joints(dragging, 0.2, "string"),
    "string, flywheel, full slip": joints(bd.scenes.flywheel_start, 0.10, "string"),
    "string, a law for each pulley, full slip": joints(mixed_two, 0.28, "string"),
    "string, a law for each pulley, running": joints(mixed_two, 0.2, "string"),
    "string, two laws on three pulleys, one without": joints(mixed_three, 0.22, "string"),
    "string, crossed": joints(drives.crossed_scene, 0.1, "string"),
    "string, outside idler": joints(drives.idler_scene, 0.1, "string"),
}
CASES |= {name: lambda make=make: running(make, 0.1) for name, make in drives.LAYOUTS.items()}
for law_name, example in EXAMPLES.items():
    if law_name != "dahl":
        CASES |= cases_of(law_name, example)
SHORT = (
    "case 1 from rest",
    "a law for each pulley, from rest",
    "joints, case 1 from rest",
    "joints, damping by the force, from rest",
    "joints, a law for each pulley, from rest",
    "string, case 1 from rest",
)


def is_long(case: str) -> bool:
    return case not in SHORT


@pytest.mark.filterwarnings("ignore:full_slip. pulley . slips:UserWarning")
@pytest.mark.parametrize("case", slow_if(is_long, CASES))
def test_core_agrees_with_oracle(case: str) -> None:
    scene, start = CASES[case]()
    params, torque = scene.params, scene.torque_fn
    times = start.t + np.linspace(0.0, WINDOW, 26)
    result = bd.simulate(params, torque, times[-1], initial=start, t_eval=times, rtol=1e-9)

    slips = any(one.code == "full_slip" for one in result.warnings)
    assert slips == ("full slip" in case)

    oracle = oracle_of(params)
    kinks = [t for term in torque.terms() if term[0] == "piecewise" for t in term[1]]
    # SciPy begins with a trial step that is far too long: quadratic drag overflows in it
    with np.errstate(over="ignore", invalid="ignore"):
        run = reference_run.integrate(
            oracle, oracle.pack(fields(start)), torque, times, tol=1e-8, breakpoints=kinks
        )
    theta = oracle.pulleys(run.y)[..., 0, :]
    _, force = oracle.joints(run.y)
    by_link = oracle.memory(run.y).sum(axis=-2)
    state, slip = by_link[-1, :-1], by_link[:, -1]
    contacts = oracle.contacts(run.y)
    normal = contacts.normal.sum(axis=-2)

    tension = np.mean(force)
    assert np.max(np.abs(result.pulleys.theta - theta)) <= 1e-8 * np.max(np.abs(theta))
    assert np.max(np.abs(result.joints.force - force)) <= 1e-6 * tension
    losses = oracle.ledger(run.y)[:, 1:]
    energy = result.energy
    drag_loss = np.zeros(len(times)) if energy.drag_loss is None else energy.drag_loss
    assert (energy.drag_loss is None) == all(one.drag is None for one in params.pulleys)
    ours = np.transpose([energy.joint_loss, energy.contact_loss, energy.friction_loss, drag_loss])
    assert np.max(np.abs(ours - losses)) <= 1e-6 * np.max(np.abs(losses))
    # of a contact that has only begun mu is a quotient of two small numbers: known as its force is
    begun = np.divide(1e-8 * tension, normal, out=np.zeros_like(normal), where=normal > 0)
    assert np.all(np.abs(result.contact.mu - contacts.mu.sum(axis=-2)) <= 1e-5 + begun)
    friction = contacts.friction.sum(axis=-2)
    assert np.max(np.abs(result.contact.friction - friction)) <= 1e-5 * np.max(normal)
    # a slip displacement is mu's over the stiffness; contact forces are joint forces turned by an
    # angle
    kinetic, developed = params._slip_limits
    per_mu = np.divide(developed, kinetic, out=np.zeros_like(kinetic), where=kinetic > 0)
    # in full slip it runs up to decimetres, a quadrature in the oracle, as accurate as the loss
    known = 10e-5 * per_mu[result.contact.pulley] + 1e-6 * np.max(np.abs(slip))
    if not params.info["n_states"]:
        # Where a link lands its slip velocity jumps, which the error of a friction state sees and
        # without one nothing: weights of the stages may count a step of it too much or too little.
        steps = min(result.stats.steps, run.steps)  # of both sides
        known += np.max(np.abs(result.contact.velocity)) * WINDOW / steps
    assert np.all(np.abs(result.contact.slip - slip) <= known)
    assert np.max(np.abs(result.contact.normal - normal)) <= 1e-6 * tension
    touched = result.contact.pulley
    assert np.array_equal(touched >= 0, (contacts.penetration > 0).any(axis=-2))
    for k, law in enumerate(oracle.laws):
        error = np.abs(result.final_state.mu - state)[:, touched[-1] == k]
        assert law is None or np.all(error <= 1e-5 * law.scale(tension / oracle.radii[k]))


def test_comparison_can_fail() -> None:
    """A drive that differs by a millionth of its axial stiffness is told apart."""
    scene, start = settled_case_1()
    times = np.array([0.0, 0.02])
    result = bd.simulate(*scene[:2], 0.02, initial=start, t_eval=times, rtol=1e-9)
    oracle = oracle_of(scene.params)
    other = dataclasses.replace(oracle, axial_stiffness=oracle.axial_stiffness * (1 + 3e-6))
    y0 = other.pack(fields(start))
    run = reference_run.integrate(other, y0, scene.torque_fn, times, tol=1e-6)
    _, force = other.joints(run.y)
    assert np.max(np.abs(result.joints.force - force)) > 1e-6 * np.mean(force)


#: Every scene on each mesh, but those with mounts, which ask for contact along the links.
ON_MESHES = [
    *((name, "paper") for name in (*drives.FIXED, *drives.LAYOUTS)),
    *((name, mesh) for name in (*bd.scenes.names(), *drives.LAYOUTS)
      for mesh in ("joint", "string")),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore:strain:UserWarning")  # the published benchmark's 5 %
@pytest.mark.parametrize(("name", "mesh"), ON_MESHES)
def test_rates_agree_at_random_states(name: str, mesh: str) -> None:
    """One evaluation at a shaken running state, with links both on and off the pulleys: rounding
    only. Positions of about 0.3 m carry 5e-17 m of it, against stretches of 1e-4 m; larger ones
    more.
    """
    scene = drives.scene(name)
    params = on_mesh(scene.params, mesh)
    rng = np.random.default_rng(7)
    state = fields(bd.simulate(params, scene.torque_fn, 0.06, t_eval=[0.06]).final_state)
    for key, scale in [
        ("x", 1e-4),
        ("y", 1e-4),
        ("phi", 1e-2),
        ("vx", 1.0),
        ("vy", 1.0),
        ("vphi", 50.0),
        ("omega", 5.0),
    ]:
        state[key] = state[key] + scale * rng.standard_normal(len(state[key]))
    torque = rng.standard_normal(len(params.pulleys)) * 50.0
    oracle = oracle_of(params)
    touching = (
        oracle.penetration(oracle.pack({**state, "mu": 0 * state["mu"], "slip": 0 * state["slip"]}))
        > 0
    ).any(axis=0)
    pressure = params.info["mean_tension"] / np.max(oracle.radii)
    # a coefficient up to half its bound; a stretch, which has none, well into sliding
    size = min(
        0.5 * law.bound if np.isfinite(law.bound) else 5.0 * float(law.scale(pressure))
        for law in oracle.laws
        if law is not None
    )
    state["mu"] = np.where(touching, rng.uniform(-1.0, 1.0, len(touching)), 0.0) * min(0.5, size)
    state["slip"] = 0 * state["mu"]
    expected = oracle.unpack(oracle.rhs(state["t"], oracle.pack(state), lambda t, a, b: torque))
    rate = params._model.rate(state, torque)
    rounding = 1e-11 * max(1.0, np.max(np.abs([state["x"], state["y"]])) / 0.3)
    keys = {"x", "y", "phi", "vx", "vy", "vphi", "theta", "omega", "mu", "slip", *MOUNT_STATES}
    assert keys - expected.keys() == ({"phi", "vphi"} if mesh == "string" else set())
    for key in keys & expected.keys():
        want = np.asarray(expected[key])
        want = want.sum(axis=0) if want.ndim == 2 else want
        scale = np.max(np.abs(want), initial=0.0)
        assert np.max(np.abs(rate[key] - want), initial=0.0) <= rounding * scale, key


@pytest.mark.slow
def test_link_on_two_pulleys_at_once(mesh: str) -> None:
    """Two overlapping circles hold some links at once: forces add, each pair keeps its friction.

    ``Params`` refuses such a drive, for the belt line round it is not defined; the core does not
    need that line.
    """
    from beltdyn import _core

    base = on_mesh(bd.scenes.kubas_case_1().params, mesh)
    state = fields(bd.settle(base))
    centers = np.array([[0.0, 0.0], [0.29, 0.0], [0.27, -0.015], [0.05, -0.02]])
    radii = np.array([0.1, 0.1, 0.1, 0.1])
    inertias = np.array([0.01, 0.01, 0.02, 0.03])
    belt = base.belt
    model = _core.Model(
        (belt.length, belt.n_bodies, belt.linear_density, belt.axial_stiffness, belt.axial_damping,
         belt.bending_stiffness, belt.bending_damping),
        centers, radii, inertias, (5e8, 2.5e5, 1e3, 0, 0.0), ("dahl", (1.0, 1e4, 0.0, 0.0)),
        (0.0, 0.0),
        mesh=belt.mesh, model=belt.model,
    )  # fmt: skip
    slots = model.info["n_slots"]
    assert slots >= 2
    oracle = type(oracle_of(base))(
        belt.length, belt.n_bodies, belt.linear_density, belt.axial_stiffness, belt.axial_damping,
        belt.bending_stiffness, centers=centers, radii=radii, inertias=inertias,
        contact=(5e8, 2.5e5, 1e3), mu_k=1.0, sigma=1e4, mesh=belt.mesh,
    )  # fmt: skip
    n = belt.n_bodies
    state["mu"] = np.zeros(slots * n)
    state["slip"] = np.zeros(slots * n)
    state["theta"], state["omega"] = np.zeros(4), np.array([-3.0, 2.0, 4.0, -1.0])
    pairs = {**state, "mu": np.zeros((4, n)), "slip": np.zeros((4, n))}
    y0 = oracle.pack(pairs)
    twice = (oracle.penetration(y0) > 0).sum(axis=0) >= 2
    assert twice.sum() >= 3

    times = np.linspace(0.0, 2e-3, 5)
    torque = np.array([1.0, -2.0, 0.5, 0.0])
    sim = _core.Simulation(
        model, state, [("piecewise", np.zeros(1), torque[None])], times[-1], rtol=1e-10
    )
    out = sim.sample(times)
    while not sim.advance(1.0):
        pass
    run = reference_run.integrate(oracle, y0, lambda t, a, b: torque, times, tol=1e-9)
    force = oracle.joints(run.y)[1]
    contacts = oracle.contacts(run.y)
    strongest = contacts.normal.argmax(axis=-2)[..., None, :]
    scale = np.max(np.abs(force))
    assert np.max(np.abs(out["force"] - force)) <= 1e-6 * scale
    theta = oracle.pulleys(run.y)[..., 0, :]
    assert np.max(np.abs(out["theta"] - theta)) <= 1e-8 * np.max(np.abs(theta))
    normal = np.take_along_axis(contacts.normal, strongest, axis=-2)[..., 0, :]
    mu = np.take_along_axis(oracle.memory(run.y)[..., 0, :, :], strongest, axis=-2)[..., 0, :]
    assert np.max(np.abs(out["normal"] - normal)) <= 1e-6 * scale
    # where both pulleys press almost alike, either may be the stronger
    second = np.sort(contacts.normal, axis=-2)[..., -2, :]
    clear = normal - second > 1e-3 * scale
    assert np.max(np.abs(out["mu"] - mu)[clear]) <= 1e-5
    # each friction slot follows its own pair
    end = sim.state()["mu"].reshape(slots, n)
    pair_mu = oracle.memory(run.y[-1])[0]
    assert np.allclose(
        np.sort(np.abs(end), axis=0).sum(axis=0), np.abs(pair_mu).sum(axis=0), atol=1e-5
    )
