"""The oracle's string against potentials, closed forms and balances; nothing from the C core.

What `test_reference.py` shows of every model it shows of those of `oracle_string.py` too: forces
one by one, momentum, power by differences, symmetries; `test_reference_mounts.py` that forces are
slopes of the energy, `test_reference_run.py` that the books of a run balance.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import reference as ref
import reference_run as runs
from oracle_drives import no_torque
from reference_string import String, as_string

RUN = pytest.mark.extended(guard="test_oracle.py::test_core_agrees_with_oracle")


def ring(n: int, around: tuple[float, float], radius: float) -> tuple[String, ref.Array]:
    """Around one pulley, as long as its circumference; directions of the masses from its axis."""
    model = as_string(
        ref.paper_drive(
            n,
            length=2 * math.pi * radius,
            centers=np.array([around]),
            radii=np.array([radius]),
            inertias=np.array([1.0]),
            winding=1,
        )
    )
    angle = 2 * math.pi * np.arange(n) / n
    return model, np.stack((np.cos(angle), np.sin(angle)))


def turning(model: String, at: ref.Array, distance: float, speed: float) -> ref.Array:
    """The ring so far from the axis, turning with the pulley."""
    x, y = model.centers[0][:, None] + distance * at
    vx, vy = speed * distance * np.stack((-at[1], at[0]))
    return model.pack({"x": x, "y": y, "vx": vx, "vy": vy, "omega": np.array([speed])})


def test_masses_of_a_laid_ring_run_on_its_pulley() -> None:
    """Chords l0 long on the circle of contact stand for arcs l0 long on the radius (section 3).

    Turned as one with the pulley nothing stretches, sinks in or slips: rounding of 1 m and 1 m/s.
    """
    model, at = ring(11, (0.3, -0.2), 0.1)
    distance = model.l0 / (2 * math.sin(math.pi / 11))
    assert distance == pytest.approx(model.contact_radii[0], rel=1e-15)
    y = turning(model, at, distance, 4.0)
    assert np.abs(model.penetration(y)).max() < 1e-15
    assert np.abs(model.joints(y)[0]).max() < 1e-15
    assert np.abs(model.contacts(y).velocity).max() < 1e-14
    phi, rate = model.angles(y)
    np.testing.assert_allclose(np.diff(phi), 2 * math.pi / 11, rtol=1e-12)
    np.testing.assert_allclose(rate, 4.0, rtol=1e-12)


def test_a_ring_that_turns_freely_carries_its_centrifugal_force() -> None:
    """T = rho A v^2 l0/lambda: 2 T sin(pi/n) holds a mass, m w^2 r, on a polygon of sides lambda.

    Found with the tension that stretches the bars so, away from the pulley; damping has no part in
    a motion as a whole.
    """
    n, speed = 24, 300.0
    model, at = ring(n, (0.0, 0.0), 0.1)
    half = math.sin(math.pi / n)
    # c (lambda - l0) 2 sin(pi/n) = m w^2 r, lambda = 2 r sin(pi/n)
    distance = (
        model.c_tra * model.l0 * 2 * half / (4 * model.c_tra * half**2 - model.mass * speed**2)
    )
    y = turning(model, at, distance, speed)
    assert model.penetration(y).max() < 0.0
    stretch, tension = model.joints(y)
    v = speed * distance
    expected = model.linear_density * v**2 * model.l0 / (model.l0 + stretch)
    np.testing.assert_allclose(tension, expected, rtol=1e-11)
    dy = model.rhs(0.0, y, no_torque)
    towards = -(speed**2) * distance * at
    np.testing.assert_allclose(model.links(dy)[1], towards, atol=1e-10 * speed**2 * distance)
    assert model.ledger(dy)[1] <= 1e-20


@pytest.mark.parametrize("k", [1, 2, 5])
def test_modes_of_a_span(k: int) -> None:
    """Small lateral waves of a span of N bars: w = 2 sqrt(T/(m lambda)) sin(k pi/2N).

    For k << N that is k/2L sqrt(T/rho A) 2 pi of a taut string. Bars at a slope s carry T cos s:
    third powers of the slope are left, 1e-12 of it at 1e-6.
    """
    model = as_string(ref.paper_drive())
    y = ref.start_state(model)
    first, bars = 1, 12  # masses 1 .. 13 are on the upper span, straight
    place = model.links(y)[0][:, first : first + bars + 1]
    stretched = model.l0 * 1.007
    place[0] = place[0, 0] + stretched * np.arange(bars + 1)
    place[1] = 0.2  # clear of the pulleys
    wave = np.sin(k * math.pi * np.arange(bars + 1) / bars)
    place[1] += 1e-6 * stretched * wave
    pull = model.links(model.rhs(0.0, y, no_torque))[1, 1, first + 1 : first + bars]
    tension = model.axial_stiffness * 0.007
    w = 2 * math.sqrt(tension / (model.mass * stretched)) * math.sin(k * math.pi / (2 * bars))
    # places of 0.2 m are rounded to 3e-17 m, 1e-9 of the wave
    scale = w**2 * 1e-6 * stretched
    np.testing.assert_allclose(pull, -scale * wave[1:-1], atol=1e-7 * scale)
    if k == 1:
        length, density = bars * stretched, model.mass / stretched
        assert w == pytest.approx(math.pi / length * math.sqrt(tension / density), rel=4e-3)


@RUN
def test_settled_string_is_in_equilibrium_at_one_tension() -> None:
    """No bending, no friction: spans carry the same, and wraps but for the corners of the polygon.

    A mass that a pulley presses is in balance along its tangent, T_{i+1} cos a = T_i cos b. Inside
    a wrap a = b = h, half the turn from bar to bar; where it begins b is anything from h to 0, so
    that the wrap has up to 1/cos h - 1 more; the compliance of the contact adds some 0.1 %.
    """
    model = as_string(ref.paper_drive())
    y = runs.settle(model, ref.start_state(model))
    force = model.mass * model.links(model.rhs(0.0, y, no_torque))[1]
    tension = model.joints(y)[1]
    assert np.abs(force).max() < 1e-6  # N, of 430 N
    share = model.contacts(y).share.sum(axis=0)
    free = (share == 0) & (np.roll(share, 1) == 0)
    assert free.sum() >= 20 and np.ptp(tension[free]) < 1e-8 * tension.mean()
    half = 0.5 * model.l0 / model.radii[0]
    assert tension.min() == pytest.approx(tension[free][0], rel=1e-5)
    assert tension.max() / tension.min() - 1 < 0.5 * half**2 + 1e-3


def test_a_belt_that_bends_is_no_string() -> None:
    for changes in ({"bending_stiffness": 0.01}, {"bending_damping": 1e-5}, {"mesh": "paper"}):
        with pytest.raises(ValueError, match="does not bend"):
            as_string(ref.paper_drive(), **changes)
