"""The readers of the paper's numbers on runs made by hand, the table, and the figures."""

from __future__ import annotations

import math
from typing import Any

import attrs
import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

import beltdyn as bd
from beltdyn import kubas
from beltdyn.kubas import figures, rows
from beltdyn.kubas.marks import INK

T = np.linspace(0.0, 1.0, 2001)
DT = T[1]
LINK_1, LINK_2 = 12, 15
PAPER = rows.paper_values()


@pytest.fixture(scope="module")
def real() -> kubas.Runs:
    return kubas.runs()


@pytest.fixture(scope="module")
def blank() -> bd.Result:
    """A run of the paper's drive with mu_k = 1 in which nothing happens."""
    params = bd.scenes.kubas_case_2().params
    params = attrs.evolve(params, friction=bd.Dahl(mu_k=1.0, sigma=1e4))
    run = bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-3, t_eval=[0.0, 1e-3])

    def silent(group: Any) -> Any:
        arrays = group.arrays()
        return attrs.evolve(
            group, **{k: np.zeros((T.size, v.shape[1]), v.dtype) for k, v in arrays.items()}
        )

    groups = ("pulleys", "belt", "joints", "contact")
    parts = {name: silent(getattr(run, name)) for name in groups}
    parts["contact"].pulley[:] = -1
    return attrs.evolve(run, t=T, energy=None, **parts)


def made(blank: bd.Result, **changes: dict[str, Any]) -> bd.Result:
    """Change arrays of some groups; each is broadcast to its shape."""
    groups = {}
    for group, arrays in changes.items():
        before = getattr(blank, group)
        new = {
            name: np.array(np.broadcast_to(value, getattr(before, name).shape))
            for name, value in arrays.items()
        }
        groups[group] = attrs.evolve(before, **new)
    return attrs.evolve(blank, **groups)


def of_link(blank: bd.Result, link: int, values: Any, rest: float = 0.0) -> np.ndarray:
    array = np.full(blank.contact.mu.shape, rest)
    array[:, link] = values
    return array


def through(*points: tuple[float, float]) -> np.ndarray:
    """Straight lines over time."""
    return np.interp(T, *zip(*points, strict=True))


@pytest.fixture(scope="module")
def case_1(blank: bd.Result) -> bd.Result:
    """Case 1 as the paper tells it, to the letter."""
    ramp = np.arange(1, 14) / 14.0
    along = np.concatenate(
        [np.zeros(9), ramp, np.ones(17), 1.0 - ramp, np.zeros(8)]
    )  # elements 1-9, 10-22, 23-39, 40-52, 53-60
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


def dahl(sigma: float, start: float, stroke: float) -> tuple[np.ndarray, np.ndarray]:
    """Slip and mu of one forward stroke from -mu_k = -1 at t = 0.25 s on: (2.9)."""
    x = start + stroke * np.clip((T - 0.25) / 0.5, 0.0, 1.0)
    return x, 1.0 - 2.0 * np.exp(-sigma * (x - start))


@pytest.fixture(scope="module")
def case_2(blank: bd.Result) -> bd.Result:
    """Case 2 as the paper tells it, to the letter."""
    mu = through(
        (0, 0), (0.16, -0.95), (0.2, -1), (0.24, -1), (0.25, -0.95), (0.3, 0), (0.66, 0.95),
        (0.7, 1), (0.74, 1), (0.76, 0.95), (0.8, 0),
    )  # fmt: skip
    slip = through((0, 0), (0.25, -0.83e-3), (0.75, -0.38e-3), (1, -0.5e-3))
    force = through((0, 420), (0.25, 100), (0.75, 1110), (1, 580))
    return made(
        blank,
        pulleys={"omega": np.array([0.05, -0.05])},
        joints={"force": of_link(blank, LINK_2, force)},
        contact={
            "mu": of_link(blank, LINK_2, mu),
            "slip": of_link(blank, LINK_2, slip),
            "friction": of_link(blank, LINK_2, 190.0 * mu),
        },
    )


def test_case_1_to_the_letter_reads_as_the_paper(case_1: bd.Result) -> None:
    values = rows.read(case_1, 1, LINK_1)
    assert values.keys() == rows.paper_values(1).keys()
    for name, value in values.items():
        # An element starts somewhere in its link; times are read to a sample.
        near = 0.5 if name in ("growing", "grown", "falling", "fallen") else 1.01 * DT
        assert value == pytest.approx(PAPER[name], abs=near), name


def test_case_2_to_the_letter_reads_as_the_paper(case_2: bd.Result) -> None:
    values = rows.read(case_2, 2, LINK_2)
    assert values.keys() == rows.paper_values(2).keys()
    for name, value in values.items():
        assert value == pytest.approx(PAPER[name], abs=1.01 * DT, rel=1e-9), name
    # The sum over 13 quantities, each within a sample of 0.5 ms or exact.
    assert rows.misfit(values) < 13 * (DT / 0.02) ** 2


def test_the_part_of_damping(blank: bd.Result, case_1: bd.Result) -> None:
    """A force of stiffness alone that goes up and down, and 3 % of it from damping."""
    k = blank.params.info["joint_stiffness"]
    spring = 100.0 * np.sin(2.0 * np.pi * 10.0 * T)
    force = spring + 3.0 * np.cos(2.0 * np.pi * 10.0 * T)
    joints = {
        "force": of_link(blank, LINK_1, force),
        "deformation": of_link(blank, LINK_1, spring / k),
    }
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


def test_candidates(real: kubas.Runs) -> None:
    """In a span at the start and on the driven pulley about 0.3 s; or on it from the start."""
    for link in rows.candidates(real.case_1, 1):
        touching = real.case_1.contact.pulley[:, link] == 1
        assert not touching[0] and 0.26 < real.case_1.t[touching.argmax()] < 0.36
    start = real.case_2.contact.pulley[0]
    assert np.all(start[list(rows.candidates(real.case_2, 2))] == 1)
    best = rows.best_links(real.case_1, real.case_2)
    assert best.case_1 in rows.candidates(real.case_1, 1)
    assert best.case_2 in rows.candidates(real.case_2, 2)


@pytest.fixture(scope="module")
def letter(case_1: bd.Result, case_2: bd.Result) -> kubas.Runs:
    """Case 1 to the letter; in place of case 2 the loops of (2.9) for both values of sigma."""

    def loop(sigma: float) -> bd.Result:
        x, mu = dahl(sigma, -0.83e-3, 2.0e-3)
        friction = bd.Dahl(mu_k=1.0, sigma=sigma)
        swing = np.where(T > 0.25, np.sin(700.0 * T), 0.0)[:, None] * [1e3 / sigma, 0.0]
        looped = made(
            case_2,
            pulleys={"omega": swing},
            contact={
                "mu": of_link(case_2, LINK_2, mu),
                "slip": of_link(case_2, LINK_2, x),
                "velocity": np.where(T > 0.25, 4e-3, 0.0)[:, None],
            },
        )
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
    x, mu = np.full(T.size, -0.83e-3), np.full(T.size, -1.0)
    velocity = np.zeros(T.size)
    first = int(0.25 / DT)
    for k in range(first, T.size - 1):
        velocity[k] = -2e-3 if k % 8 > 4 else 4e-3
        step, sense = velocity[k] * DT, np.sign(velocity[k])
        x[k + 1] = x[k] + step
        mu[k + 1] = sense + (mu[k] - sense) * math.exp(-5e3 * abs(step))
    contact = {"mu": mu, "slip": x, "velocity": velocity}
    shaken = made(
        letter.case_2_soft,
        contact={name: of_link(letter.case_2, LINK_2, v) for name, v in contact.items()},
    )
    table = kubas.compare(letter._replace(case_2_soft=shaken), LINKS)
    assert table["slope"].computed == pytest.approx(0.5, rel=1e-4)


def test_too_few_samples_cannot_tell_a_jump(real: kubas.Runs) -> None:
    coarse = bd.simulate(*bd.scenes.kubas_case_1(), t_eval=np.linspace(0, 1, 501))
    with pytest.raises(ValueError, match="case 1 must be sampled at least three times"):
        kubas.compare(real._replace(case_1=coarse))


def test_a_start_that_is_no_rest_is_missed(real: kubas.Runs) -> None:
    table = kubas.compare(real)
    # 100 N m in 0.3 s and in 0.25 s, in 1 ms, at 0.1 m
    assert table["rest_1"].quantity.scale == pytest.approx(1.0 / 0.3)
    assert table["rest_2"].quantity.scale == pytest.approx(4.0)
    jump = np.where(real.case_2.t > 0.0, 21.0, 0.0)[:, None]
    jumped = made(real.case_2, joints={"force": real.case_2.joints.force + jump})
    missed = kubas.compare(real._replace(case_2=jumped))["rest_2"]
    assert not missed.within and missed.verdict == "MISSED"


def test_every_quantity_has_its_line(letter: kubas.Runs) -> None:
    table = kubas.compare(letter, LINKS)
    names = [line.quantity.name for line in table.lines]
    assert len(set(names)) == len(names)
    assert {q.name for q in kubas.QUANTITIES} < set(names)
    assert {line.quantity.row for line in table.lines} == set(range(15))
    assert [line.quantity.row for line in table.lines] == sorted(
        line.quantity.row for line in table.lines
    )
    text, html = str(table), table._repr_html_()
    for line in table.lines:
        assert line.quantity.says in text
    assert html.count("<tr") == len(table.lines) + 1
    assert "&gt; 1" in html and "|mu|" in html
    assert len(text.splitlines()) == len(table.lines) + 1
    assert table["end"].computed == 580.0
    with pytest.raises(KeyError):
        table["nothing"]


def test_only_some_lines(letter: kubas.Runs) -> None:
    table = kubas.compare(letter, LINKS)
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


def test_runs(real: kubas.Runs) -> None:
    for run, sigma in zip(real, (1e4, 1e4, 5e3), strict=True):
        assert run.success and run.t.size == 2001 and run.t[-1] == 1.0
        assert run.params.friction.sigma == sigma


#: Panels of the figure, and the quantities marked in it: at their place in x or in y.
CONTENT: dict[int, tuple[int, tuple[str, ...], tuple[str, ...]]] = {
    5: (1, (), ()),
    6: (1, (), ()),
    7: (1, (), ("omega_1",)),
    8: (2, ("arrival", "departure"), ()),
    9: (1, ("growing", "grown", "falling", "fallen"), ("passive", "active")),
    10: (2, ("lost", "regained", "equal"), ()),
    11: (2, ("arrival", "lost", "regained", "full", "departure"), ("peak",)),
    12: (1, (), ()),
    13: (1, (), ()),
    14: (1, (), ("difference_1", "difference_2")),
    15: (1, (), ("start", "minimum", "maximum", "end")),
    16: (1, (), ("friction",)),
    17: (2, ("negative_from", "negative_to", "positive_from", "positive_to", "extreme"), ()),
    18: (1, (), ()),
    19: (1, (), ()),
}


def marks(figure: Figure) -> tuple[list[float], list[float]]:
    """Places of the lines in the marks' colour: upright ones in x, level ones in y."""
    xs, ys = [], []
    for ax in figure.axes:
        for line in ax.lines:
            if line.get_color() == INK:
                x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
                if np.ptp(x) == 0:
                    xs.append(float(x[0]))
                if np.ptp(y) == 0:
                    ys.append(float(y[0]))
    return xs, ys


def test_there_is_a_figure_for_each_of_the_papers() -> None:
    assert list(figures.FIGURES) == list(range(5, 20)) == list(CONTENT)


@pytest.mark.parametrize("number", CONTENT)
def test_the_papers_numbers_are_marked(real: kubas.Runs, number: int) -> None:
    panels, at_x, at_y = CONTENT[number]
    figure = figures.figure(number, real)
    assert len(figure.axes) == panels
    for ax in figure.axes:
        assert "[" in ax.get_xlabel() or ax.get_xlabel() == "element along the belt"
        assert "[" in ax.get_ylabel()
    assert f"Fig. {number}." in figure.get_suptitle()
    xs, ys = marks(figure)
    for name in at_x:
        # The joint of an element stands half a number before it, between two joints the change.
        shift = 1.0 if number == 9 else 0.0
        assert PAPER[name] - shift in xs, name
    if number == 14:
        for low, high in (ys[:2], ys[2:]):
            assert high - low == pytest.approx(0.1)
        return
    for name in at_y:
        assert PAPER[name] in np.abs(ys) or PAPER[name] in ys, name


def test_the_quantities_that_are_marked_are_all_there_are() -> None:
    """But for what has no place in a figure: omega_0 has the band of omega_1, the rest no mark."""
    drawn = {name for _, *names in CONTENT.values() for group in names for name in group}
    assert set(PAPER) - drawn == {"omega_0", "floor", "damping", "return"}


def test_what_the_text_says_and_the_forces_need(real: kubas.Runs) -> None:
    """Figs 6 and 13 mark the 50 N m of the text; 100 N m, in the heading, is what is set."""
    assert {-50.0, -100.0} <= set(marks(figures.figure(6, real))[1])
    assert {-50.0, 50.0} <= set(marks(figures.figure(13, real))[1])
    assert real.case_1.pulleys.torque[:, 0].min() == pytest.approx(-100.0)


def test_slopes_of_figure_18(real: kubas.Runs) -> None:
    (ax,) = figures.figure(18, real).axes
    slopes = [
        np.ptp(line.get_ydata()) / np.ptp(line.get_xdata())
        for line in ax.lines
        if line.get_color() == INK
    ]
    assert slopes == pytest.approx([20.0, 10.0])  # 2 sigma, per mm


def texts(figure: Figure) -> list[tuple[str, Bbox]]:
    """All text that is drawn, with its box: not the labels of ticks beyond the end of an axis."""
    axes = [*figure.axes, *(child for ax in figure.axes for child in ax.child_axes)]
    beyond = set()
    for ax in axes:
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
                if not low <= tick.get_loc() <= high:
                    beyond |= {tick.label1, tick.label2}
    return [
        (text.get_text(), text.get_window_extent())
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip() and text not in beyond
    ]


@pytest.mark.parametrize("size", figures.SIZES)
@pytest.mark.parametrize("number", CONTENT)
def test_nothing_is_cut_off_or_covered(real: kubas.Runs, number: int, size: str) -> None:
    figure = figures.figure(number, real, size=size)
    figure.draw_without_rendering()
    inner = figure.bbox.padded(1.0)
    placed = texts(figure)
    for text, box in placed:
        assert inner.x0 <= box.x0 and box.x1 <= inner.x1, text
        assert inner.y0 <= box.y0 and box.y1 <= inner.y1, text
    for k, (text, box) in enumerate(placed):
        for other, second in placed[:k]:
            # The boxes hold a pixel of padding.
            assert not box.padded(-1.0).overlaps(second.padded(-1.0)), (text, other)
    width = figures.SIZES[size].panel[0] * len(figure.axes)
    assert figure.get_size_inches()[0] == pytest.approx(width)


@pytest.mark.parametrize("number", [7, 11])
def test_one_legend_that_says_each_thing_once(real: kubas.Runs, number: int) -> None:
    figure = figures.figure(number, real)
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert len(set(labels)) == len(labels) and labels.count("paper") == 1
    assert all(ax.get_legend() is None for ax in figure.axes)


def test_drawing_changes_nothing_global(real: kubas.Runs) -> None:
    before = dict(matplotlib.rcParams)
    figures.figure(8, real, size="print")
    assert dict(matplotlib.rcParams) == before


def test_other_elements_can_be_chosen(real: kubas.Runs) -> None:
    figure = figures.figure(15, real, links=kubas.Links(3, 20))
    assert "element 21" in figure.legends[0].get_texts()[0].get_text()


def test_wrong_choices_are_named(real: kubas.Runs) -> None:
    with pytest.raises(ValueError, match="number must be from 5 to 19, got 4"):
        figures.figure(4, real)
    with pytest.raises(ValueError, match="size must be one of notebook, print"):
        figures.figure(5, real, size="poster")
