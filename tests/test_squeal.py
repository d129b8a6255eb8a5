"""Squeal: friction that makes vibrations on a hardly damped contact grow (MODEL section 11.11)."""

from __future__ import annotations

import attrs
import numpy as np
import pytest

import beltdyn as bd
from beltdyn.outputs.squeal import Contact, growth, least_damping, squeals

EA, RADIUS, DENSITY, STIFFNESS, AXIAL = 66e3, 0.0166, 0.056, 1.7e9, 0.34
LENGTH = np.pi * RADIUS
OMEGA = float(np.sqrt(STIFFNESS / DENSITY))
#: Contact damping [N s/m^2] under which it squeals, and with which it does not.
HARDLY, WELL = 650.0, 3500.0


def wrap(damping: float, axial: float = AXIAL) -> Contact:
    return Contact(
        damping=damping / (2.0 * DENSITY * OMEGA),
        stretch=EA / (STIFFNESS * RADIUS**2),
        stretch_damping=axial * OMEGA / EA,
        omega=OMEGA,
    )


def of_masses(coefficient: np.ndarray, damping: float, held: bool) -> float:
    """Rate at which the fastest vibration on a wrap grows, of masses along it and across."""
    n, dx = coefficient.size, LENGTH / coefficient.size
    strain = np.zeros((n, 2 * n + 1))  # of n + 1 masses along the belt, n cells across
    cell = np.arange(n)
    strain[cell, cell], strain[cell, cell + 1] = -1.0 / dx, 1.0 / dx
    strain[cell, n + 1 + cell] = 1.0 / RADIUS
    mass = DENSITY * dx * np.ones(2 * n + 1)
    mass[[0, n]] *= 0.5
    rates = []
    for of_belt, of_contact in ((EA, STIFFNESS), (AXIAL, damping)):
        matrix = of_belt * dx * strain.T @ strain
        matrix[n + 1 + cell, n + 1 + cell] += of_contact * dx
        for end in (0, 1):  # friction, half of a cell's at each of its ends
            matrix[cell + end, n + 1 + cell] -= 0.5 * coefficient * of_contact * dx
        rates.append(-matrix / mass[:, None])
    keep = np.delete(np.arange(2 * n + 1), [0, n] if held else [])
    size = keep.size
    both = [one[np.ix_(keep, keep)] for one in rates]
    whole = np.block([[np.zeros((size, size)), np.eye(size)], both])
    found = np.linalg.eigvals(whole)
    return float(found.real[np.abs(found.imag) > 0.3 * OMEGA].max())


def test_growth_is_that_of_masses_on_a_wrap() -> None:
    """Between that of ends held and free, to a tenth: those have wave numbers of their own.

    Cells of 1/60 of a wave err by (2 pi / 60)^2 / 24 of its frequency, 80 1/s, in their growth by
    a share of that. A wrap on which nothing grows is seen to be one.
    """
    for z, damping in ((0.9, HARDLY), (1.2, HARDLY), (0.5, 0.2 * HARDLY)):
        exact = [of_masses(np.full(60, z), damping, held) for held in (True, False)]
        found = float(growth(wrap(damping), np.array([z]))[0]) * OMEGA
        assert 0.9 * exact[0] < found < 1.1 * exact[1]
    for held in (True, False):
        assert of_masses(np.full(60, 0.9), WELL, held) < 0.0
    assert growth(wrap(WELL), np.array([0.9]))[0] < 0.0
    rising = 0.9 * np.sqrt((np.arange(60) + 0.5) / 60.0)  # its mean square counts
    exact = [of_masses(rising, HARDLY, held) for held in (True, False)]
    mean = float(np.sqrt(np.mean(rising**2)))
    assert exact[0] < growth(wrap(HARDLY), np.array([mean]))[0] * OMEGA < exact[1]


@pytest.mark.parametrize("z", [0.3, 0.6, 0.9])
def test_damping_that_is_needed(z: float) -> None:
    """About z^2 / 8 of critical without axial damping, for z^2 / 4 small against EA / (c R^2), of
    which that is the first order; less with it; it is enough, and less is not.
    """
    free = wrap(0.0, axial=0.0)
    needed = least_damping(free, z)
    assert abs(needed / (z**2 / 8.0) - 1.0) < 0.25 * z**2 / free.stretch
    with_axial = least_damping(wrap(0.0), z)
    assert 0.0 < with_axial < needed
    for share, grows in ((0.9, True), (1.1, False)):
        damped = wrap(0.0)._replace(damping=share * with_axial)
        assert (growth(damped, np.array([z]))[0] > 0.0) == grows


def drive(damping: float, mesh: str = "ale", links: int | None = None) -> bd.Params:
    return bd.Params(
        belt=bd.Belt(
            mesh=mesh, n_bodies=links, preload=190.0, linear_density=DENSITY, axial_stiffness=EA,
            axial_damping=AXIAL,
        ),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=RADIUS, inertia=1e-5),
            bd.Pulley(name="fan", center=(0.108, 0.0), radius=0.025, inertia=5e-5),
        ],
        friction=bd.Dahl(mu_k=1.0, sigma=3000.0),
        contact=bd.Contact(linear=STIFFNESS, damping=damping),
    )  # fmt: skip


def loaded(params: bd.Params) -> bd.Result:
    """Loaded within 10 ms to two thirds of full slip, then for 8 ms more."""
    torque = bd.PiecewiseLinear([0.0, 0.01, 0.02], [[0.0, 0.0], [0.0, 7.0], [0.0, 7.0]])
    turns = {0: bd.PiecewiseLinear([0.0], [-600.0])}
    return bd.simulate(params, torque, 0.018, turns, rtol=1e-2)


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
def test_ale_belt_warns_where_links_squeal() -> None:
    """Links part from ALE belts by a tenth of the tension and more, by 1 % where it is damped."""
    squealing, calm = loaded(drive(HARDLY)), loaded(drive(WELL))
    assert [one.code for one in calm.warnings] == []
    (told,) = squealing.warnings
    assert told.code == "squeal" and told.accuracy and told.where == "pulley 0"
    assert 0.008 < told.t < 0.012
    assert "0.033 of critical" in told.text and "contact.damping >= " in told.text
    enough = float(told.text.rpartition(">= ")[2].split()[0])
    assert not loaded(drive(1.01 * enough)).warnings
    for flows, damping, apart in ((squealing, HARDLY, (0.1, 1.0)), (calm, WELL, (0.0, 0.02))):
        links = loaded(drive(damping, "joint", 240))
        off = np.abs(links.span_tension - flows.span_tension).max() / flows.span_tension.mean()
        assert apart[0] < off < apart[1], off


def test_short_squeal_is_none() -> None:
    """Vibrations that have no time to grow by e; and friction of nobody, or not finite."""
    params, t = drive(HARDLY), np.linspace(0.0, 0.01, 101)
    pulley = np.zeros((t.size, 4), dtype=np.int32)
    rate = float(growth(wrap(HARDLY), np.array([1.15]))[0]) * OMEGA
    for lasts, count in ((0.5, 0), (2.0, 1)):
        mu = np.where((t > 0.004) & (t < 0.004 + lasts / rate), 1.0, 0.0)[:, None] * np.ones(4)
        assert len(list(squeals(params, t, pulley, mu))) == count
    for mu in (np.zeros(pulley.shape), np.full(pulley.shape, np.nan)):
        assert not list(squeals(params, t, pulley, mu))
    pressed = attrs.evolve(params.contact, hunt_crossley=0.3)  # damps by the force as well
    for contact, count in ((params.contact, 1), (pressed, 0)):
        one = attrs.evolve(params, contact=contact)
        assert len(list(squeals(one, t, pulley, np.full(pulley.shape, 0.8)))) == count
