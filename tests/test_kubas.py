"""The readers of the paper's numbers on runs made by hand, and the table of them."""

from __future__ import annotations

import math
from typing import Any

import attrs
import beltdyn_kubas as kubas
import numpy as np
import pytest
from beltdyn_kubas import paper_numbers as rows

import beltdyn as bd

T = np.linspace(0.0, 1.0, 2001)
DT = T[1]
LINK_1, LINK_2 = 12, 15
PAPER = rows.paper_values()


@pytest.fixture(scope="module")
def blank() -> bd.Result:
    """A run of the paper's drive with mu_k = 1 in which nothing happens."""
    params = bd.scenes.kubas_case_2().params
    params = attrs.evolve(params, friction=bd.Dahl(mu_k=1.0, sigma=1e4))
    run = bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-3, t_eval=[0.0, 1e-3])
    parts = {}
    for name in ("pulleys", "belt", "joints", "contact"):
        group = getattr(run, name)
        silent = {k: np.zeros((T.size, v.shape[1]), v.dtype) for k, v in group.arrays().items()}
        parts[name] = attrs.evolve(group, **silent)
    parts["contact"].pulley[:] = -1
    return attrs.evolve(run, t=T, energy=None, **parts)


def made(blank: bd.Result, **changes: dict[str, Any]) -> bd.Result:
    """Change arrays of some groups; each is broadcast to its shape."""
    groups = {}
    for group, arrays in changes.items():
        before = getattr(blank, group)
        new = {k: np.broadcast_to(v, getattr(before, k).shape).copy() for k, v in arrays.items()}
        groups[group] = attrs.evolve(before, **new)
    return attrs.evolve(blank, **groups)


def of_link(blank: bd.Result, link: int, values: Any) -> np.ndarray:
    array = np.zeros(blank.contact.mu.shape)
    array[:, link] = values
    return array


def through(*points: tuple[float, float]) -> np.ndarray:
    """Straight lines over time."""
    return np.interp(T, *zip(*points, strict=True))


@pytest.fixture(scope="module")
def case_1(blank: bd.Result) -> bd.Result:
    """Case 1 as the paper tells it, to the letter."""
    # of elements 1-9, 10-22, 23-39, 40-52, 53-60
    along, ramp = np.zeros(60), np.arange(1, 14) / 14.0
    along[9:22], along[22:39], along[39:52] = ramp, 1.0, 1.0 - ramp
    force = np.broadcast_to(120.0 + 1000.0 * along, blank.joints.force.shape)
    pulley = np.full(blank.contact.pulley.shape, -1, dtype=np.int32)
    pulley[:, 9:22], pulley[:, 39:52] = 1, 0
    here = ((T >= 0.31) & (T < 0.38)) | ((T >= 0.39) & (T <= 0.82))
    pulley[:, LINK_1] = np.where(here, 1, -1)
    mu = -through(
        (0.31, 0), (0.335, 0.59), (0.38, 0), (0.39, 0), (0.6, 0.9), (0.68, 0.95), (0.75, 1)
    )
    return made(
        blank,
        pulleys={"omega": -2.0 * np.pi * np.minimum(T / 0.3, 1.0)[:, None]},
        joints={"force": force, "deformation": force / blank.params.info["joint_stiffness"]},
        contact={"pulley": pulley, "mu": of_link(blank, LINK_1, mu)},
    )


@pytest.fixture(scope="module")
def case_2(blank: bd.Result) -> bd.Result:
    """Case 2 as the paper tells it, to the letter."""
    mu = through(
        (0, 0), (0.16, -0.95), (0.2, -1), (0.24, -1), (0.25, -0.95), (0.3, 0), (0.66, 0.95),
        (0.7, 1), (0.74, 1), (0.76, 0.95), (0.8, 0),
    )  # fmt: skip
    slip = through((0, 0), (0.25, -0.83e-3), (0.75, -0.38e-3), (1, -0.5e-3))
    force = through((0, 420), (0.25, 100), (0.75, 1110), (1, 580))
    contact = {"mu": mu, "slip": slip, "friction": 190.0 * mu}
    return made(
        blank,
        pulleys={"omega": np.array([0.05, -0.05])},
        joints={"force": of_link(blank, LINK_2, force)},
        contact={name: of_link(blank, LINK_2, values) for name, values in contact.items()},
    )


def test_runs_to_the_letter_read_as_the_paper(case_1: bd.Result, case_2: bd.Result) -> None:
    values = rows.read(case_1, 1, LINK_1)
    assert values.keys() == rows.paper_values(1).keys()
    for name, value in values.items():
        # An element starts somewhere in its link; times are read to a sample.
        near = 0.5 if name in ("growing", "grown", "falling", "fallen") else 1.01 * DT
        assert value == pytest.approx(PAPER[name], abs=near), name
    values = rows.read(case_2, 2, LINK_2)
    assert values.keys() == rows.paper_values(2).keys()
    for name, value in values.items():
        assert value == pytest.approx(PAPER[name], abs=1.01 * DT, rel=1e-9), name
    # The sum over 13 quantities, each within a sample of 0.5 ms or exact.
    assert rows.misfit(values) < 13 * (DT / 0.02) ** 2


def test_the_part_of_damping(blank: bd.Result, case_1: bd.Result) -> None:
    """A force of stiffness alone that goes up and down, and 3 % of it from damping."""
    spring = 100.0 * np.sin(20.0 * np.pi * T)
    force = of_link(blank, LINK_1, spring + 3.0 * np.cos(20.0 * np.pi * T))
    deformation = of_link(blank, LINK_1, spring / blank.params.info["joint_stiffness"])
    joints = {"force": force, "deformation": deformation}
    share = rows.read(made(case_1, joints=joints), 1, LINK_1)["damping"]
    # the whole is 0.05 % above the spring's part; one sample in 2001 is counted twice
    assert share == pytest.approx(0.03, rel=2e-3)


def test_what_never_happens_reads_as_the_end(case_1: bd.Result, case_2: bd.Result) -> None:
    away = made(case_1, contact={"pulley": np.full(60, -1)})
    values = rows._passage(away, LINK_1)
    assert all(values[name] == T[-1] for name in ("arrival", "departure", "full", "equal"))
    assert values["peak"] == 0.0
    never = rows.read(made(case_2, contact={"mu": np.zeros(60)}), 2, LINK_2)
    assert never["negative_from"] == 0.4 and never["positive_from"] == 0.9


def test_the_misfit_and_the_demands() -> None:
    exact = rows.paper_values()
    assert rows.misfit(exact) == 0.0 and not rows.demands(exact).any()
    # twice the scale: z = 2; only a demanded quantity presses back
    off = exact | {"start": 420.0 + 2 * 21.0}
    assert rows.misfit(off) == pytest.approx(4.0) and not rows.demands(off).any()
    missed = exact | {"end": 580.0 + 2 * 29.0}
    assert rows.misfit(missed) == pytest.approx(4.0)
    assert np.count_nonzero(rows.demands(missed)) == 1


@pytest.fixture(scope="module")
def letter(case_1: bd.Result, case_2: bd.Result) -> kubas.Runs:
    """Case 1 to the letter; in place of case 2 the loops of (2.9) for both values of sigma: one
    forward stroke of 2 mm from -mu_k = -1 at t = 0.25 s on.
    """
    stroke, runs = 2e-3 * np.clip((T - 0.25) / 0.5, 0.0, 1.0), T > 0.25
    for_slip = {"slip": of_link(case_2, LINK_2, stroke - 0.83e-3)}
    for_slip |= {"velocity": np.where(runs, 4e-3, 0.0)[:, None]}

    def loop(sigma: float) -> bd.Result:
        mu = of_link(case_2, LINK_2, 1.0 - 2.0 * np.exp(-sigma * stroke))
        swing = np.where(runs, np.sin(700.0 * T), 0.0)[:, None] * [1e3 / sigma, 0.0]
        looped = made(case_2, pulleys={"omega": swing}, contact={"mu": mu, **for_slip})
        friction = bd.Dahl(mu_k=1.0, sigma=sigma)
        return attrs.evolve(looped, params=attrs.evolve(looped.params, friction=friction))

    return kubas.Runs(case_1, loop(1e4), loop(5e3))


LINKS = kubas.Links(LINK_1, LINK_2)


def test_a_smaller_sigma(letter: kubas.Runs) -> None:
    """The loops of (2.9) leave -mu_k with slopes 2 sigma. A chord over a sample, dx = 2 um, has the
    slope in its middle but for (sigma dx)^2/24 of it, 2e-5.
    """
    table = kubas.compare(letter, LINKS)
    assert table["slope"].computed == pytest.approx(0.5, rel=1e-4)
    for k in (1, 2):
        assert table[f"oscillation_{k}"].computed == pytest.approx(2.0, rel=1e-6)
        assert table[f"oscillation_{k}"].within
    same = kubas.compare(letter._replace(case_2_soft=letter.case_2), LINKS)
    assert same["slope"].computed == pytest.approx(1.0)
    assert same["slope"] in same.missed
    assert not same["oscillation_1"].within


def test_little_strokes_back_and_forth_do_not_change_the_slope(letter: kubas.Runs) -> None:
    """While it runs forward the belt shakes: strokes back obey the other branch of (2.9)."""
    x, mu, velocity = np.full(T.size, -0.83e-3), np.full(T.size, -1.0), np.zeros(T.size)
    for k in range(int(0.25 / DT), T.size - 1):
        velocity[k] = -2e-3 if k % 8 > 4 else 4e-3
        step, sense = velocity[k] * DT, np.sign(velocity[k])
        x[k + 1] = x[k] + step
        mu[k + 1] = sense + (mu[k] - sense) * math.exp(-5e3 * abs(step))
    contact = {"mu": mu, "slip": x, "velocity": velocity}
    contact = {name: of_link(letter.case_2, LINK_2, v) for name, v in contact.items()}
    shaken = made(letter.case_2_soft, contact=contact)
    table = kubas.compare(letter._replace(case_2_soft=shaken), LINKS)
    assert table["slope"].computed == pytest.approx(0.5, rel=1e-4)


def test_every_quantity_has_its_line(letter: kubas.Runs) -> None:
    table = kubas.compare(letter, LINKS)
    names = [line.quantity.name for line in table.lines]
    assert len(set(names)) == len(names)
    assert {q.name for q in kubas.QUANTITIES} < set(names)
    numbers = [line.quantity.row for line in table.lines]
    assert set(numbers) == set(range(15)) and numbers == sorted(numbers)
    text, html = str(table), table._repr_html_()
    assert all(line.quantity.says in text for line in table.lines)
    assert html.count("<tr") == len(text.splitlines()) == len(table.lines) + 1
    assert "&gt; 1" in html and "|mu|" in html
    assert table["end"].computed == 580.0
    with pytest.raises(KeyError):
        table["nothing"]
    # only some lines
    assert {line.quantity.case for line in table.only(case=1).lines} == {1}
    assert {line.quantity.row for line in table.only(rows=(9, 14)).lines} == {9, 14}
    assert table.only(case=1, rows=(9,)).lines == ()


def test_verdicts_and_the_assertion(letter: kubas.Runs) -> None:
    table = kubas.compare(letter, LINKS).only(case=1)
    table.assert_demands()
    assert table.missed == ()
    force = letter.case_1.joints.force
    heavier = letter._replace(case_1=made(letter.case_1, joints={"force": force + 30.0}))
    off = kubas.compare(heavier, LINKS).only(case=1)
    # 1120 N may be off by 33.6 N, 120 N by 3.6 N
    assert "passive" in {line.quantity.name for line in off.missed}
    assert off["active"].within and off["passive"].deviation == pytest.approx(30.0)
    with pytest.raises(AssertionError, match="passive span"):
        off.assert_demands()
    assert "MISSED" in str(off)
    line = kubas.Line(rows.QUANTITIES[0], 0.0)
    assert not line.quantity.demanded and line.verdict == "conflict, see identification"
