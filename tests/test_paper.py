"""The paper's own numbers beside ours, with the provisional parameters of the scenes (set S2).

The paper prints no stiffness, mass, damping or friction value; S2 is a first identification. Rows
are numbered as in the model's description: what the paper states for cases 1 and 2. Rows 2 and 3
are promises, within 10 %. The other rows are printed, and held to bands wide enough for a
provisional set and narrow enough that a wrong model falls out; each says where its band comes from.

    python -m pytest tests/test_paper.py -s
"""

from __future__ import annotations

import numpy as np
import pytest

import beltdyn as bd


def show(row: str, quantity: str, paper: str, ours: str) -> None:
    print(f"  row {row:>3}  {quantity:<58} paper {paper:<28} here {ours}")


@pytest.fixture(scope="module")
def case_1() -> bd.Result:
    scene = bd.scenes.kubas_case_1()
    return bd.simulate(*scene, t_eval=np.linspace(0, 1, 5001))


@pytest.fixture(scope="module")
def case_2() -> bd.Result:
    scene = bd.scenes.kubas_case_2()
    return bd.simulate(*scene, t_eval=np.linspace(0, 1, 5001))


def on_driven(result: bd.Result, link: int) -> np.ndarray:
    return result.contact.pulley[:, link] == 1


def arriving_link(result: bd.Result) -> int:
    """The "chosen element" of case 1: the paper says when it reaches the driven pulley, just over
    0.3 s, not which it is; take the link whose arrival is nearest to 0.32 s.
    """
    starts = {}
    for link in range(result.contact.pulley.shape[1]):
        touching = on_driven(result, link)
        if not touching[0] and touching.any():
            starts[link] = result.t[touching.argmax()]
    return min(starts, key=lambda link: abs(starts[link] - 0.32))


def chosen_of_case_2(result: bd.Result) -> int:
    """The "chosen element" of case 2 moves towards the right side of the driven pulley, and its
    force starts at about 420 N, falls to 100 and rises to 1110: of the links on the arriving half
    of that pulley, the one whose force swings between the extremes the paper prints.
    """
    force = result.joints.force
    misfit = np.abs(np.log(force.min(axis=0) / 100.0)) + np.abs(np.log(force.max(axis=0) / 1110.0))
    candidates = [
        link for link in range(force.shape[1])
        if on_driven(result, link).all() and np.abs(result.contact.mu[:, link]).max() > 0.95
    ]  # fmt: skip
    return min(candidates, key=lambda link: misfit[link])


def test_row_1_speeds(case_1: bd.Result) -> None:
    """After the ramp, once the start has died out: constant but for small disturbances."""
    late = case_1.t >= 0.35
    speeds = case_1.pulleys.omega[late]
    mean, spread = speeds.mean(axis=0), speeds.std(axis=0)
    show("1", "pulley speeds after 0.3 s", "almost 2 pi = 6.283 rad/s",
         f"{-mean[0]:.3f} and {-mean[1]:.3f} rad/s, +- {spread.max():.3f}")  # fmt: skip
    # "almost 2 pi": the load balances 100 N m at 2 pi exactly; creep of about 1 % comes on top
    assert -mean == pytest.approx([2 * np.pi] * 2, rel=0.02)
    assert np.all(spread < 0.02 * 2 * np.pi)


def test_rows_2_and_3_span_forces(case_1: bd.Result) -> None:
    k = int(np.argmin(np.abs(case_1.t - 0.4)))
    passive, active = case_1.span_tension[k]
    show("2", "joint force at 0.4 s, passive span", "about 120 N", f"{passive:.1f} N")
    show("3", "joint force at 0.4 s, active span", "about 1120 N", f"{active:.1f} N")
    assert passive == pytest.approx(120.0, rel=0.10)
    assert active == pytest.approx(1120.0, rel=0.10)
    # what no parameter can change: the torque is the difference of the spans
    torque = case_1.pulleys.torque[k, 1] / 0.1
    assert active - passive == pytest.approx(torque, rel=0.05)


def test_row_5_passage(case_1: bd.Result) -> None:
    link = arriving_link(case_1)
    touching = on_driven(case_1, link)
    start = case_1.t[touching.argmax()]
    end = case_1.t[np.flatnonzero(touching)[-1]]
    show("5", f"link {link} reaches the driven pulley, leaves it",
         "just over 0.3 s, about 0.82 s", f"{start:.3f} s, {end:.3f} s")  # fmt: skip
    # half a turn at 2 pi rad/s is 0.5 s; the wrap is short of pi by a link or two (0.03 s each)
    assert end - start == pytest.approx(0.5, abs=0.07)


def test_row_7_friction_against_normal_force(case_1: bd.Result) -> None:
    link = arriving_link(case_1)
    touching = on_driven(case_1, link)
    ratio = np.abs(case_1.contact.friction[:, link]) / np.maximum(
        case_1.contact.normal[:, link], 1e-9
    )
    equal = touching & (ratio > 0.98)
    first = case_1.t[equal.argmax()]
    show("7", f"link {link}: friction equals normal force (98 %)", "from about 0.6 s",
         f"from {first:.3f} s")  # fmt: skip
    assert equal.any()
    assert 0.5 < first < 0.8
    assert np.all(ratio[touching] <= 1.0 + 1e-12)  # mu_k = 1
    assert np.median(ratio[touching & (case_1.t < 0.55)]) < 0.8


def test_row_10_speed_difference(case_2: bd.Result) -> None:
    difference = np.abs(case_2.pulleys.omega[:, 0] - case_2.pulleys.omega[:, 1])
    before = [
        float(np.mean(difference[(case_2.t > end - 0.02) & (case_2.t < end)]))
        for end in (0.25, 0.75)
    ]
    after = (case_2.t > 0.25) & (case_2.t < 0.30)
    swings = np.diff(np.sign(np.diff(case_2.pulleys.omega[after, 0])))
    show("10", "speed difference just before 0.25 and 0.75 s", "about 0.1 rad/s",
         f"{before[0]:.3f} and {before[1]:.3f} rad/s")  # fmt: skip
    show("10", "then", "oscillation", f"{np.count_nonzero(swings)} turning points in 50 ms")
    # one of the rows in conflict with others: an order of magnitude is what S2 can promise
    assert all(0.03 < value < 0.3 for value in before)
    assert np.count_nonzero(swings) >= 4


def test_row_11_friction_force(case_2: bd.Result) -> None:
    link = chosen_of_case_2(case_2)
    largest = np.max(np.abs(case_2.contact.friction[:, link]))
    show("11", f"link {link}: largest friction force", "about 190 N", f"{largest:.0f} N")
    # N is at most T l0 / r of the tight span: 1120 * 0.2 = 224 N at mu_k = 1
    assert 130 < largest < 240


def test_row_12_developed_friction(case_2: bd.Result) -> None:
    link = chosen_of_case_2(case_2)
    mu = case_2.contact.mu[:, link]
    sign = np.sign(mu[np.abs(mu[case_2.t < 0.3]).argmax()])
    windows = []
    for side, span in ((sign, (0.1, 0.3)), (-sign, (0.6, 0.8))):
        inside = (case_2.t > span[0]) & (case_2.t < span[1]) & (side * mu >= 0.95)
        windows.append((case_2.t[inside.argmax()], case_2.t[np.flatnonzero(inside)[-1]]))
    text = ", ".join(f"{a:.3f}-{b:.3f} s" for a, b in windows)
    show("12", f"link {link}: fully developed friction (0.95 mu_k)",
         "0.16-0.25 s, 0.66-0.76 s", text)  # fmt: skip
    # ends with the reversal of the torque; begins as far before as the arc needs to slip through
    for (begin, end), turn in zip(windows, (0.25, 0.75), strict=True):
        assert end == pytest.approx(turn, abs=0.03)
        assert turn - 0.15 < begin < turn
