"""The oracle of `reference_run.py`: runs and equilibria against balances, limits and each other."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
import reference as ref
import reference_run as runs
from oracle_drives import no_torque, shaken, small_drive
from reference_friction import Dahl, ElasticPlastic, Law, LuGre
from reference_string import as_string

RUN = pytest.mark.extended(guard="test_oracle.py::test_core_agrees_with_oracle")

# -------------------------------------------------------------------- integration


def ramp(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
    return np.array([-20.0 * min(t / 0.01, 1.0), -2.0 * omega[1]])


@pytest.fixture(scope="module")
def small_run() -> tuple[ref.Reference, runs.Run]:
    model = small_drive(inertias=np.array([5e-4, 5e-4]))
    start = runs.settle(model, ref.start_state(model))
    times = np.linspace(0.0, 0.06, 25)
    return model, runs.integrate(model, start, ramp, times, tol=1e-6, breakpoints=[0.01])


@RUN
def test_settled_belt_is_in_equilibrium() -> None:
    model = ref.paper_drive()
    y = runs.settle(model, ref.start_state(model))
    force = model.mass * model.links(model.rhs(0.0, y, no_torque))[1, :2]
    tension = model.joints(y)[1]
    assert np.abs(force).max() < 1e-6  # newtons, against some 500 N of tension
    # Without friction nor EI a belt carries the same tension all round. The paper's drive bends a
    # little (EI/R^2 = 1 N), so it may differ by that.
    assert np.ptp(tension) < 2.0
    assert tension.min() > 100


# Links of the small drive press with some 100 N and slide at up to 1 m/s: friction changes over
# about a millimetre, and dampers carry up to half of it.
LUGRE = LuGre(mu_k=0.5, mu_s=0.7, v_stribeck=0.05, sigma=2e3, damping=0.5, viscous=0.1)
ELASTIC = ElasticPlastic(mu=0.6, stiffness=1e6, damping=500.0)
LAWS: dict[str, tuple[Law | None, Law | None]] = {
    "Dahl": (Dahl(0.8, 2e3), Dahl(0.8, 2e3)),
    "Dahl, string": (Dahl(0.8, 2e3), Dahl(0.8, 2e3)),
    "LuGre": (LUGRE, LUGRE),
    "elastic/plastic": (ELASTIC, ELASTIC),
    "LuGre and elastic/plastic": (LUGRE, ELASTIC),
    "elastic/plastic and Dahl": (ELASTIC, Dahl(0.8, 2e3)),
    "LuGre and none": (LUGRE, None),
}


@RUN
@pytest.mark.parametrize("name", LAWS)
def test_energy_residual_vanishes_with_every_law(name: str) -> None:
    """The books balance to tol times the work done, with bearing drag; every law takes its share.

    Each step errs by less than 1e-6 of the stretch; the energy of a stretch of 1e-2 l0 is a joule.
    """
    drag = np.array([[0.5, 1e-3, 0.0], [0.1, 0.0, 1e-4]])
    model = small_drive(inertias=np.array([5e-4, 5e-4]), friction=LAWS[name], drag=drag)
    model = as_string(model) if "string" in name else model
    start = runs.settle(model, ref.start_state(model))
    times = np.linspace(0.0, 0.02, 401)
    run = runs.integrate(model, start, ramp, times, tol=1e-6, breakpoints=[0.01])
    ledger = model.ledger(run.y)[-1]
    assert np.all(ledger > 0) and ledger[3] > 0.01 * ledger[0]
    assert np.abs(model.residual(run.y, run.y[0])).max() < 1e-6 * ledger[0]
    contacts = model.contacts(run.y)
    power = (contacts.friction * contacts.velocity).sum(axis=2)
    for j, law in enumerate(model.laws):
        share = np.trapezoid(power[:, j], times)
        assert share == 0 if law is None else share > 0
        limit = 0.0 if law is None else law.mu if isinstance(law, ElasticPlastic) else np.inf
        # F / N of a force that is cut off at mu N, rounded twice.
        assert np.abs(contacts.mu[:, j]).max() <= limit * (1 + 1e-15)
    # of dense output, before it is clipped; masses slip by half a bar at once where they land
    assert run.mu_excess < (1e-5 if "string" in name else 1e-6)
    lost = model.penetration(run.y) <= 0
    assert np.any(lost[0] != lost[-1]) and not model.memory(run.y)[:, 0][lost].any()


# -------------------------------------------------------------------- prescribed motion


def started(t: float) -> tuple[float, float]:
    """From rest at 2000 rad/s^2 to 20 rad/s, which is reached after 10 ms."""
    return (-2000.0 * t, -2000.0) if t < 0.01 else (-20.0, 0.0)


@RUN
@pytest.mark.parametrize("drag", [None, np.array([[0.5, 1e-3, 0.0], [0.1, 0.0, 1e-4]])])
def test_energy_residual_vanishes_under_prescribed_motion(drag: Any) -> None:
    """Torque, power, angle and speed of a drive whose pulley 0 is brought to speed."""
    model = small_drive(
        inertias=np.array([5e-4, 5e-4]), friction=(LUGRE, ELASTIC), drag=drag, motion={0: started}
    )
    start = runs.settle(model, ref.start_state(model))
    times = np.linspace(0.0, 0.02, 401)
    run = runs.integrate(model, start, no_torque, times, tol=1e-6, breakpoints=[0.01])
    theta, omega = np.moveaxis(model.pulleys(run.y), 1, 0)
    exact = np.where(times < 0.01, -1000.0 * times**2, 0.1 - 20.0 * times)
    # 1e-6 of the scale of an angle, 1e-3 rad, per step.
    assert np.abs(theta[:, 0] - exact).max() <= run.steps * 1e-9
    np.testing.assert_array_equal(omega[:, 0], [started(t)[0] for t in times])
    assert omega[-1, 1] < -1.0  # the belt takes the other one along
    ledger = model.ledger(run.y)
    assert ledger[-1, 0] > 0.05
    assert np.abs(model.residual(run.y, run.y[0])).max() < 1e-6 * ledger[-1, 0]
    # Power as reported, summed over the samples: half an interval of the largest change of power
    # is what the trapezoidal rule can miss where the acceleration jumps, and little elsewhere.
    power = np.array(
        [
            model.torques(t, y, no_torque)[0] * w[0]
            for t, y, w in zip(times, run.y, omega, strict=True)
        ]
    )
    jump = 0.5 * times[1] * np.abs(np.diff(power)).max()
    assert np.trapezoid(power, times) == pytest.approx(ledger[-1, 0], abs=2 * jump)


@RUN
def test_prescribed_speed_is_that_of_a_pulley_too_heavy_to_change_it() -> None:
    """At a constant speed the belt cannot tell, nor the torque, which is what slows the heavy one.

    20 N m, the most there is, change the speed of 1e6 kg m^2 by 2e-7 rad/s at most within the run,
    2e-8 of the slip at its start. All else that the two runs do not share is the errors of steps.
    """
    constant = {0: lambda t: (-10.0, 0.0)}
    inertias = np.array([1e6, 5e-4])
    held = small_drive(inertias=inertias, friction=(LUGRE, ELASTIC), motion=constant)
    heavy = dataclasses.replace(held, motion={})
    start = runs.settle(held, ref.start_state(held))
    held.pulleys(start)[1, 0] = -10.0
    times = np.linspace(0.0, 0.01, 5)
    one, other = (runs.integrate(m, start, no_torque, times, tol=1e-8) for m in (held, heavy))
    force, expected = held.joints(one.y)[1], held.joints(other.y)[1]
    assert np.ptp(expected[-1]) > 5.0
    # Steps of 1e-8 of the stretch, as in the test of output times below.
    assert np.abs(force - expected).max() < 1e-6 * expected.mean()
    torque = np.array([held.torques(0.0, y, no_torque)[0] for y in one.y])
    slowing = [heavy.pulleys(heavy.rhs(0.0, y, no_torque))[1, 0] * inertias[0] for y in other.y]
    assert np.abs(torque).max() > 0.5
    np.testing.assert_allclose(torque, np.negative(slowing), atol=1e-6 * np.abs(torque).max())


def test_run_begins_at_the_prescribed_speed() -> None:
    model = small_drive(motion={1: lambda t: (3.0, 0.0)})
    with pytest.raises(ValueError, match="another speed"):
        runs.integrate(model, ref.start_state(model), no_torque, [0.0, 1e-4])


# -------------------------------------------------------------------- limits and lost contacts


@RUN
def test_run_keeps_friction_within_its_limit(small_run: tuple[ref.Reference, runs.Run]) -> None:
    model, run = small_run
    assert run.mu_excess < 1e-6
    assert np.abs(model.memory(run.y)[:, 0]).max() <= 0.8
    lost = model.penetration(run.y) <= 0
    assert np.all(model.memory(run.y)[:, 0][lost] == 0) and np.all(
        model.memory(run.y)[:, 1][lost] == 0
    )


@RUN
def test_no_output_shows_friction_without_contact() -> None:
    """Steps so loose, and outputs so dense, that the interpolant of mu runs ahead of contact."""
    model = small_drive(inertias=np.array([5e-4, 5e-4]))
    start = runs.settle(model, ref.start_state(model))
    run = runs.integrate(model, start, ramp, np.linspace(0, 0.03, 20001), tol=1.0)
    lost = model.penetration(run.y) <= 0
    assert np.any(lost[0] != lost[-1])
    assert np.all(model.memory(run.y)[:, 0][lost] == 0)
    assert np.all(model.memory(run.y)[:, 1][lost] == 0)


@RUN
def test_lost_contacts_are_reset_when_they_happen(
    small_run: tuple[ref.Reference, runs.Run],
) -> None:
    """At a reset p = 0, seen from a second run that stops just there."""
    model, run = small_run
    assert run.resets, "the scene is meant to run links off the pulleys"
    time, pulley, link = run.resets[len(run.resets) // 2]
    before = time - 1e-7
    again = runs.integrate(
        model, run.y[0], ramp, [0.0, before, time + 1e-7], tol=1e-6, breakpoints=[0.01]
    )
    p = model.penetration(again.y)[:, pulley, link]
    # In 1e-7 s a link recedes by less than 1e-6 m (10 m/s).
    assert 0 < p[1] < 1e-6 and -1e-6 < p[2] <= 0
    assert model.memory(again.y)[1, 1, pulley, link] != 0
    assert np.all(model.memory(again.y)[2, :, pulley, link] == 0)


@pytest.mark.parametrize(
    ("half_depth", "crossing"), [(1e-7, True), (-1e-7, False)], ids=["dips below 0", "stays in"]
)
def test_dip_within_a_step_is_seen(half_depth: float, crossing: bool) -> None:
    """A link that leaves and comes back between two ends of a step, both in contact.

    Made by hand: p(t) = a ((t - h/2)^2 - (h/6)^2) or the same parabola raised above zero.
    """
    model = small_drive()
    base = ref.start_state(model)
    links = model.links(base)
    links[0, :2] *= np.where(links[0, 0] < 0, 1.001, 1.0)  # clear of pulley 0, but for one link
    pulley, link, h = 0, 20, 1e-5
    arm = links[0, :2, link]
    outward = arm / np.hypot(*arm)
    model.memory(base)[:, pulley, link] = 0.3, 1e-4
    a = half_depth / (h / 6) ** 2 if crossing else -half_depth / (h / 6) ** 2
    offset = -abs(half_depth) if crossing else abs(half_depth)

    def dense(t: float) -> ref.Array:
        y = base.copy()
        part = model.links(y)
        part[0, :2, link] = (0.1 - (a * (t - h / 2) ** 2 + offset)) * outward
        part[1, :2, link] = -2 * a * (t - h / 2) * outward
        return y

    suspects = runs._suspects(model, h, dense(0.0), dense(h))
    assert suspects == ([(pulley, link)] if crossing else suspects)
    time, state, lost = runs._locate_lost(model, dense, 0.0, h, dense(h), suspects)
    if crossing:
        # p = 0 at h/2 - h/6, going down; p there is known to 1e-17 m of 1 m/s or so.
        assert time == pytest.approx(h / 3, rel=1e-6)
        assert lost == [(pulley, link)] and np.all(model.memory(state)[:, pulley, link] == 0)
    else:
        assert (time, lost) == (h, []) and model.memory(state)[0, pulley, link] == 0.3


@RUN
def test_two_methods_agree() -> None:
    """DOP853 (explicit, order 8) and Radau (implicit, order 5) from the same state."""
    model = small_drive()
    start = runs.settle(model, ref.start_state(model))
    times = [0.0, 0.001, 0.002]

    def torque(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
        return np.array([-10.0, 10.0])

    one = runs.integrate(model, start, torque, times, tol=1e-7)
    two = runs.integrate(model, start, torque, times, tol=1e-4, method="Radau")
    force_one, force_two = model.joints(one.y)[1], model.joints(two.y)[1]
    assert np.ptp(force_one[-1]) > 1.0  # something happened
    # Radau at 1e-4 of the stretch per step leaves 1e-3 of the tension at most.
    assert np.abs(force_one - force_two).max() < 1e-3 * force_one.mean()
    np.testing.assert_allclose(
        model.pulleys(one.y)[-1], model.pulleys(two.y)[-1], rtol=1e-4, atol=1e-9
    )


@RUN
def test_free_ring_without_damping_keeps_energy_and_momentum() -> None:
    """No pulley within reach: energy and both momenta are constants of the motion."""
    model = small_drive(
        centers=np.array([[9.0, 9.0]]),
        radii=np.array([0.1]),
        inertias=np.array([1.0]),
        axial_damping=0.0,
        mu_k=None,
        sigma=None,
    )
    angle = -2 * math.pi * np.arange(24) / 24
    rng = np.random.default_rng(11)
    radius = 1.2 / (2 * math.pi)
    start = model.pack(
        {
            "x": radius * np.cos(angle),
            "y": radius * np.sin(angle),
            "phi": angle - math.pi / 2,
            "vx": rng.normal(size=24),
            "vy": rng.normal(size=24),
        }
    )
    run = runs.integrate(model, start, no_torque, np.linspace(0, 0.02, 5), tol=1e-8)
    energy = model.energy(run.y)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    x, y, _ = np.moveaxis(model.links(run.y)[:, 0], 1, 0)
    vx, vy, spin = np.moveaxis(model.links(run.y)[:, 1], 1, 0)
    turning = (model.mass * (x * vy - y * vx) + model.inertia * spin).sum(axis=1)
    np.testing.assert_allclose(turning, turning[0], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(vx.sum(axis=1), vx[0].sum(), atol=1e-10)


@RUN
def test_output_times_and_breakpoints_do_not_change_the_motion() -> None:
    model = small_drive()
    start = runs.settle(model, ref.start_state(model))
    coarse = runs.integrate(model, start, ramp, [0.0, 0.002], tol=1e-7)
    fine = runs.integrate(
        model, start, ramp, np.linspace(0, 0.002, 30), tol=1e-7, breakpoints=[0.0007, 0.0013]
    )
    # Joint forces to 1e-5 of the mean tension: two runs at 1e-7 with different steps.
    force = model.joints(coarse.y)[1][-1]
    assert np.abs(force - model.joints(fine.y)[1][-1]).max() < 1e-5 * force.mean()


def test_torque_step_is_taken_from_the_left_before_it() -> None:
    """A step in the torque at a breakpoint: impulse exactly M (t - t_step) on a free pulley."""
    model = small_drive(centers=np.array([[9.0, 9.0], [-9.0, 9.0]]), mu_k=None, sigma=None)
    angle = -2 * math.pi * np.arange(24) / 24
    radius = 1.2 / (2 * math.pi)
    start = model.pack(
        {"x": radius * np.cos(angle), "y": radius * np.sin(angle), "phi": angle - math.pi / 2}
    )

    def step(t: float, theta: ref.Array, omega: ref.Array) -> ref.Array:
        return np.array([0.0 if t < 0.0005 else 3.0, 0.0])

    run = runs.integrate(model, start, step, [0.0, 0.0005, 0.001], tol=1e-4, breakpoints=[0.0005])
    omega = model.pulleys(run.y)[:, 1, 0]
    np.testing.assert_allclose(omega, [0.0, 0.0, 3.0 / 0.01 * 0.0005], rtol=1e-12, atol=1e-14)


def test_pack_and_unpack() -> None:
    model = ref.paper_drive()
    y = shaken(model, 12)
    state = model.unpack(y, 0.25)
    assert state["t"] == 0.25
    np.testing.assert_array_equal(model.pack(state), y)
    touched = (model.penetration(y) > 0).any(axis=0)
    single = state | {"mu": state["mu"].sum(axis=0), "slip": state["slip"].sum(axis=0)}
    np.testing.assert_array_equal(model.pack(single), y)
    single["mu"] = np.where(touched, 0.0, 0.1)
    with pytest.raises(ValueError, match="touches no pulley"):
        model.pack(single)
