"""What a report says of slip, drivers and efficiency where means mislead.

Loads that pulsate, drives that slip in full, reverse or stand still, runs without the outputs that
a number needs: against what the samples of the run itself show, or a closed form. The margin of
torque to full slip: against creep theory (tests/creep_theory.py), and against runs that slip.
"""

from __future__ import annotations

import math
import re
from typing import Any

import attrs
import creep_theory
import numpy as np
import pytest
from drives import pressing, reduction
from test_creep_theory import DENSITY, DRIVE, EA, FULL, OMEGA, RADII, unequal
from test_creep_theory import MU as THEORY_MU
from tiers import OTHERS, ci_if
from two_pulleys import open_drive

import beltdyn as bd
from beltdyn.report.powers import _bristles
from beltdyn.report.slip_torque import Steady, full_slip
from beltdyn.report.window import Window
from beltdyn.scenes import get

pytestmark = pytest.mark.filterwarnings("ignore:(full_slip|balance|chatter|slack_span)")

MU = 0.6


def drive(**changes: Any) -> bd.Params:
    law = bd.Dahl(mu_k=MU, sigma=1e4)
    return attrs.evolve(reduction(80), **{"friction": law, **changes})


TURNING = {0: bd.PiecewiseLinear([0.0, 0.1], [0.0, -20.0])}


def loaded(torque: float, t_end: float, params: bd.Params | None = None, **options: Any) -> Any:
    """A run under a load on pulley 1 that is there from 0.2 s on."""
    load = bd.PiecewiseLinear([0.1, 0.2], [0.0, torque], 1)
    return bd.simulate(params or drive(), load, t_end, TURNING, **options)


def held_by_less(report: Any) -> bool:
    """Whether no worst margin is larger than that of the means."""
    return all(
        row.least_margin <= row.margin
        for row in report.pulleys
        if row.margin is not None and row.least_margin is not None
    )


def test_slip_in_full_within_a_steady_mean_is_told() -> None:
    """Ten times a second, with a third of that in the mean."""

    def load(t: float, _theta: Any, _omega: Any) -> list[float]:
        return [0.0, 3.3 * (8.0 + 14.0 * math.sin(20.0 * math.pi * t)) * min(t / 0.05, 1.0)]

    run = bd.simulate(drive(), load, 0.7, TURNING, t_eval=np.linspace(0.0, 0.7, 1401))
    told = run.report(0.4)
    inside = run.t >= told.begin
    arcs = run.arcs
    assert np.max(arcs.slip[inside, 0] / arcs.wrap[inside, 0]) > 0.99, "it does slip in full"
    row, other = told.pulleys
    assert row.used < 0.5, "of the means nothing shows it"
    assert row.used_range.most > 0.98
    assert row.slip_range.most > 0.95 > row.slip_range.mean
    assert row.least_margin <= 1.0 and row.margin <= 1.0
    assert any(note.startswith("full_slip: pulley 0 slips") for note in told.notes)
    assert "pulley 0 slips first, now" in str(told)
    # by its means it would hold more: that torque is told apart from the margin
    assert abs(row.slip_torque) > 2.0 * row.margin * abs(row.belt_torque)
    assert "A margin of 1 at less torque" in told.text(full=True)
    # The other one holds, by less than its means have it.
    assert 1.0 < other.least_margin < 0.6 * other.margin
    assert held_by_less(told) and held_by_less(run.report())
    # Under an even load the friction in use is even, within 1 % of all there is; and the belt's
    told = loaded(26.0, 0.6).report(0.4)
    rims = [
        one.radius * abs(row.speed.mean)
        for one, row in zip(drive().pulleys, told.pulleys, strict=True)
    ]
    assert min(rims) < abs(told.belt_speed) < max(rims)
    row = told.pulleys[0]
    assert row.used_range.most == pytest.approx(row.used, abs=0.01)
    assert row.used_range.least == pytest.approx(row.used, abs=0.01)
    assert row.least_margin == pytest.approx(row.margin, rel=0.03)
    # one load: growing alone is growing together, up to where the driving pulley slips
    other = told.pulleys[1]
    assert row.margin < 0.95 * other.margin < math.inf
    assert other.own_margin == pytest.approx(row.margin, rel=1e-3)
    assert row.slip_torque == pytest.approx(row.margin * row.belt_torque, rel=1e-3)
    assert "A margin of 1" not in told.text(full=True)
    grown = row.margin * other.belt_torque
    assert other.own_slip_torque == pytest.approx(grown, rel=1e-3)


def test_unsteady_drives_have_no_efficiency_and_no_creep() -> None:
    """And what slips all the time no margin; the driver is who puts power in.

    Case 1 of the paper with 1.35 times its torques, more than friction can carry; its case 2, from
    80 to 0 N m; one that rocks; one that brakes, whose motor takes off many times what is put in.
    """
    params, torque, t_end, _ = get("kubas-case-1")
    told = bd.simulate(params, 1.35 * torque, t_end).report()
    for row in told.pulleys:
        assert row.slip_share > 0.97
        assert row.margin <= 1.0 and row.least_margin <= 1.0
    assert held_by_less(told)
    # 3 % of the power is taken off, and 4 % goes into the pulley that runs away.
    assert told.powers["change of what is stored"].power > 900.0
    assert told.efficiency is None
    assert any("no efficiency: what is stored" in note for note in told.notes)
    put_in = sum(row.power for row in told.powers if row.kind == "in")
    shown = re.search(r"losses \+- (\S+) W from the mesh", " ".join(str(told).split()))
    assert shown and float(shown[1]) == pytest.approx(told.efficiency_error * put_in, rel=0.05)
    params, torque, t_end, motion = get("kubas-case-2")
    told = bd.simulate(params, torque, t_end, motion).report()
    assert [told.driver] == [row.name for row in told.powers if row.kind == "in"]
    assert told.efficiency is None and told.creep == ()
    assert any("no creep: the belt's speed changes" in note for note in told.notes)
    # No mean torque slips, but the one at the beginning does. Creep theory holds the sum of the
    # tensions, but for some percent of what the belt gives.
    row = told.pulleys[0]
    assert row.torque.most == pytest.approx(80.0, rel=0.01)
    share = math.tanh(0.5 * math.log(row.limit or 1.0))  # (T1 - T2) / (T1 + T2) in full slip
    assert row.least_margin * 80.0 == pytest.approx(row.hub_load.most * 0.1 * share, rel=0.25)
    assert row.margin is None and row.worst_time < 0.82
    times = np.linspace(0.0, 0.6, 121)
    rocking = {0: bd.PiecewiseLinear(times, -5.0 * np.sin(10.0 * np.pi * times))}
    told = bd.simulate(drive(), bd.Load(1, coulomb=5.0), 0.6, rocking).report(1 / 3)
    assert told.driver == "pulley 0" and told.creep == ()
    assert not any("slips, its rim has" in note for note in told.notes)
    assert "no creep" in told.text(full=True)
    brake = {0: bd.PiecewiseLinear([0.0, 0.2, 0.3], [0.0, -20.0, 0.0])}
    told = bd.simulate(drive(), bd.PiecewiseLinear([0.0], [[0.0, -0.2]]), 0.3, brake).report(0.3)
    assert max(abs(row.share or 0.0) for row in told.powers) > 1.1
    assert "No percentages" in told.text(full=True) and "100.00" not in told.text(full=True)


def test_the_torque_that_grows_alone() -> None:
    """Of two pulleys it is all of it, until one of them slips. Two loads on one crank, the other
    one held: full slip is Euler's there, and its tensions differ by its torque over its radius.
    """

    def state_of(params: bd.Params, shares: list[float], speed: float) -> Steady:
        """A state with these shares of the strain's tension in the spans, in balance."""
        spans = np.array(shares) * float(params.info["strain_tension"])
        pulls = params.route.senses * (spans - np.roll(spans, 1))
        torque = pulls * [pulley.radius for pulley in params.pulleys]
        of = {"params": params, "tension": spans, "torque": torque, "flow": speed}
        return Steady(**of, driver=0, travel=np.zeros(0))

    state = state_of(drive(), [0.7, 1.3], 1.2)
    first, together = full_slip(state)
    own = full_slip(state, [1], alone=True)[0]
    assert first.factor < 0.95 * together.factor, "the driving one slips first, from its load too"
    assert own.factor == pytest.approx(first.factor, rel=1e-5)
    assert own.torque == pytest.approx(first.factor * state.torque[1], rel=1e-5)
    pulleys = [
        bd.Pulley(name="crank", center=(0.0, 0.0), radius=0.08, inertia=2e-3),
        bd.Pulley(name="fan", center=(0.30, 0.0), radius=0.06, inertia=2e-3),
        bd.Pulley(name="pump", center=(0.15, 0.25), radius=0.03, inertia=2e-3),
    ]
    params = drive(pulleys=pulleys)
    state = state_of(params, [1.2, 1.0, 0.8], 0.0)
    together, own = full_slip(state)[2], full_slip(state, [2], alone=True)[0]
    assert math.isfinite(own.factor)
    tight, slack = own.tensions
    assert tight / slack == pytest.approx(math.exp(MU * params.route.wraps[2]), rel=1e-4)
    assert abs(own.torque) == pytest.approx(0.03 * (tight - slack), rel=1e-6)
    assert abs(own.torque) == pytest.approx(own.factor * abs(state.torque[2]), rel=1e-9)
    # The fan's torque does not grow with it, so that there is more tension left at the pump.
    assert own.factor > together.factor


@pytest.mark.ci(guard="test_report_slip.py::test_the_torque_that_grows_alone")
def test_how_far_the_alternator_of_an_engine_is_from_slipping() -> None:
    """Where all torques grow others slip before it; alone it has five times as much to go."""
    told = bd.simulate(*get("serpentine")).report()
    crank = told.pulleys["crank"]
    assert crank.used_range.most > 1.4 * crank.used and crank.least_margin < 0.7 * crank.margin
    for name in ("compressor", "alternator", "steering pump"):
        row = told.pulleys[name]
        assert row.margin == math.inf and row.own_margin > 5.0, name
    assert told.pulleys["compressor"].wrap == pytest.approx(math.pi / 2, rel=0.01)
    assert "later: others slip" in told.text(full=True)


@pytest.mark.filterwarnings("ignore:(compliance|long_links)")
@pytest.mark.filterwarnings("ignore:units")
@pytest.mark.parametrize("mu", [200.0, 250.0, 1e6])
def test_a_belt_that_cannot_slip_has_a_report(mu: float) -> None:
    """Its limit, e^(mu wrap), is no number any more from mu 226 on: unlimited, nothing in use."""
    params = attrs.evolve(reduction(24), friction=bd.Dahl(mu_k=mu, sigma=1e4))
    ramp = bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [-5.0, 0.0]])
    report = bd.simulate(params, ramp + bd.Viscous([0.0, 0.5]), 0.02).report()
    for row in report.pulleys:
        assert row.limit == pytest.approx(math.exp(min(mu * row.wrap, 709.0))) or (
            mu * row.wrap > 709.0 and row.limit == math.inf
        )
        assert row.used is not None and row.used < 0.05
    assert "pulley 1" in str(report)
    assert report.to_dict() is not None


@pytest.mark.filterwarnings("ignore:(compliance|long_links)")
def test_wraps_and_limits_are_those_of_the_belt_line_and_of_euler() -> None:
    """Few links count badly: 1.3 on a small pulley; its limit is by the same wrap."""
    small = bd.Pulley(center=(0.17, 0.09), radius=0.01, inertia=1e-5, side="outside")
    params = drive(pulleys=[*drive().pulleys, small])
    told = loaded(8.0, 0.3, params).report()
    for row, wrap in zip(told.pulleys, params.route.wraps, strict=True):
        assert row.wrap == pytest.approx(wrap, rel=1e-12)
        assert row.limit == pytest.approx(math.exp(MU * wrap), rel=1e-9)
    assert told.pulleys[2].links < 3.0 and "Links on the wrap" in told.text(full=True)
    # of spans that are not known it is not said that no link of them is free
    notes = loaded(8.0, 0.02, outputs=("pulleys",)).report().notes
    assert not any("no link of it is free" in note for note in notes)
    assert any("span_tension" in note and "not asked for" in note for note in notes)
    # Its largest torque is that with tensions of ratio exp(mu wrap) and the sum at rest
    load = bd.PiecewiseLinear([0.0, 0.1], [0.0, 15.0], 0)
    told = bd.simulate(drive(), load, 0.6, {1: lambda t: 0.0}).report()
    assert told.driver is None
    row, wrap = told.pulleys[0], told.pulleys[0].wrap
    share = math.tanh(0.5 * MU * wrap)
    spans = [one.tension.mean for one in told.spans if one.tension is not None]
    assert abs(row.slip_torque) == pytest.approx(0.06 * sum(spans) * share, rel=0.1)
    assert row.margin * 15.0 == pytest.approx(abs(row.slip_torque), rel=0.01)
    # without the places of mounts nothing is told from them
    tensioner = pressing((0.17, -0.055), pivot=(0.24, -0.12), stiffness=40.0, preload=-10.0)
    belt = attrs.evolve(drive().belt, preload=None)
    params = drive(pulleys=[*drive().pulleys, tensioner], belt=belt)
    kept = ("pulleys", "belt", "joints", "contact", "span_tension", "energy")
    known, told = loaded(8.0, 0.3, params).report(), loaded(8.0, 0.3, params, outputs=kept).report()
    assert known.pulleys["tensioner"].wrap is not None
    row = told.pulleys["tensioner"]
    assert row.wrap is None and row.belt_torque is None and row.limit is None
    assert all(one.length is None and one.lateral is None for one in told.spans)
    assert "tensioner" not in told.creep.names() and "pulley 1" in told.creep.names()
    ours, theirs = told.creep["pulley 1"], known.creep["pulley 1"]
    assert ours.radius == pytest.approx(theirs.radius, abs=1e-12)
    assert any("mounts.travel not asked for" in note for note in told.notes)


@pytest.mark.filterwarnings("ignore:long_links")
def test_a_wrap_of_less_than_a_link_has_no_friction_in_use() -> None:
    """Nothing holds its spans apart while no link touches it: that was 531 % of its friction."""
    told = bd.scenes.hard["grazing"].run().report()
    grazed, others = told.pulleys["pulley 1"], (told.pulleys["pulley 0"], told.pulleys["pulley 2"])
    assert grazed.links < 1.0 and grazed.tight is not None
    assert grazed.used is grazed.used_range is grazed.ratio is None
    assert all(0.0 < one.used < 0.1 for one in others)
    assert any(note.startswith("pulley 1: less than a link lies on it") for note in told.notes)
    # Where it slips for a moment, it has a margin, none, and not none for want of a load.
    params = bd.scenes.hard["grazing"].params
    turning = {0: bd.PiecewiseLinear([0.0, 0.02], [0.0, -60.0])}
    load = bd.PiecewiseLinear([0.0, 0.02], [0.0, 8.0], 2)
    told = bd.simulate(params, load, 0.06, turning, rtol=1e-3).report(0.6)
    assert told.pulleys[1].margin == 1.0
    assert not any("want of a load: pulley 1" in note for note in told.notes)


def test_a_margin_is_of_what_friction_falls_to() -> None:
    """Where it falls with slip velocity: a load that grows slowly slips there and not far beyond,
    long before what friction at rest would hold, which is said as well.
    """
    law = bd.ElasticPlastic(mu=0.5, stiffness=1e8, damping=1e3, mu_s=0.8, v_stribeck=0.02)
    falling = drive(friction=law)
    row = loaded(30.0, 0.32, falling).report(0.08).pulleys[0]
    assert row.limit == pytest.approx(math.exp(0.5 * row.wrap), rel=1e-9)
    grows = bd.PiecewiseLinear([0.1, 0.2, 0.68], [0.0, 30.0, 66.0], 1)
    with pytest.warns(bd.AccuracyWarning, match="growth"):  # in full slip, which only ends the run
        run = bd.simulate(falling, grows, 0.68, TURNING)
    with_the_belt = run.pulleys.omega[:, 1] / -12.0 > 0.9
    slips_at = float(run.pulleys.torque[np.flatnonzero(with_the_belt)[-1], 1])
    # the belt's speed falls before by its stretch, and the head on from full slip takes a while
    assert 0.98 < slips_at / (30.0 * row.margin) < 1.1
    assert slips_at < 0.8 * 30.0 * row.sticking_margin


def test_a_load_that_only_friction_at_rest_holds() -> None:
    """Above the limit by mu_k, with most of the wrap sticking: no margin, though nothing slips."""
    law = bd.LuGre(mu_k=0.6, mu_s=0.9, v_stribeck=0.2, sigma=1e4)
    told = loaded(70.0, 0.5, drive(friction=law)).report()
    row = told.pulleys[0]
    assert row.ratio > 0.99 * math.exp(0.6 * row.wrap), "it is loaded beyond mu_k"
    assert row.slip_share < 0.6 and row.used > 1.0
    assert row.margin < 1.0 < 1.1 < row.sticking_margin
    assert not any("full slip" in note or "full_slip" in note for note in told.notes)
    assert any("from 0.9 at those of this window to 0.6" in note for note in told.notes)
    assert "as soon as something makes it slip" in " ".join(str(told).split())


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_axes_on_a_path_put_power_in_or_take_it_off(way: float) -> None:
    """An axis that is drawn out against the belt puts in force times way, and none of it is lost.

    Drawn back, as much is taken off.
    """
    pulleys = list(drive().pulleys)
    move = np.array([[0.0, 0.0], [0.002 * way, 0.0]])
    pulleys[1] = attrs.evolve(pulleys[1], mount=bd.Path(t=[0.2, 0.4], displacement=move))
    load = bd.PiecewiseLinear([0.1, 0.15], [0.0, 10.0], 1)
    told = bd.simulate(drive(pulleys=pulleys), load, 0.4, TURNING).report(0.5)
    row = told.powers["axes that follow a path"]
    assert row.kind == ("in" if way > 0.0 else "out")
    pulley = told.pulleys[1]
    assert pulley.speed is not None
    assert row.power == pytest.approx(pulley.hub_load.mean * 0.002 / 0.2, rel=0.1)
    lost = sum(one.power for one in told.powers if one.kind == "lost")
    put_in = sum(one.power for one in told.powers if one.kind == "in")
    others = sum(one.power for one in told.powers if one.kind != "in")
    assert put_in == pytest.approx(others, rel=1e-9)
    assert lost > 0.0 and (told.efficiency is None or told.efficiency < 1.0)


@pytest.mark.filterwarnings("ignore:(compliance|long_links)")
@pytest.mark.parametrize("scene", ci_if("conveyor".__eq__, ["arm", "conveyor"]))
def test_dry_friction_of_mounts_gives_back_only_what_it_stores(scene: str) -> None:
    """Losses of dampers and Dahl's friction never fall; the ledger has the bristles' energy too.

    They swing within their friction: the ledger's term falls again and again.
    """
    if scene == "arm":
        arm = {"stiffness": 40.0, "preload": -10.0, "damping": 0.05, "friction": 2.0}
        tensioner = pressing((0.17, -0.055), pivot=(0.24, -0.12), **arm)
        belt = attrs.evolve(drive().belt, preload=None)
        shaken = bd.PiecewiseLinear(
            t := np.linspace(0.0, 0.06, 49), 4.0 - 4.0 * np.cos(100.0 * np.pi * t), 1
        )
        run = bd.simulate(
            drive(pulleys=[*drive().pulleys, tensioner], belt=belt),
            shaken,
            0.06,
            TURNING,
            rtol=1e-5,
        )
    else:
        run = bd.simulate(*get("conveyor"))
    ledger = run.energy.mount_loss
    stored = _bristles(Window.last(run, 1.0))
    scale = float(np.ptp(ledger))
    assert np.max(np.maximum.accumulate(ledger) - ledger) > 0.01 * scale
    assert np.min(np.diff(ledger - stored)) > -1e-5 * scale
    for last in (0.05, 0.1, 0.2, 0.4):
        powers = run.report(last).powers
        assert powers["dampers and friction of mounts"].power > -1e-6
        put_in = sum(one.power for one in powers if one.kind == "in")
        others = sum(one.power for one in powers if one.kind != "in")
        assert put_in == pytest.approx(others, rel=1e-9)


def test_a_belt_that_is_stiff_to_bending() -> None:
    """6 % of the driver's torque does not reach the load, nor more of it at full slip; a start is
    in the spans' extremes of the run, a speed lost is given as it is printed.
    """
    params = drive()
    belt = attrs.evolve(params.belt, bending_stiffness=0.005, bending_damping=1e-4)
    load = bd.PiecewiseLinear([0.0, 0.1], [[0.0, 0.0], [0.0, 12.0]])
    result = bd.simulate(attrs.evolve(params, belt=belt), load, 0.6, TURNING)
    report = result.report(0.5)
    row = report.pulleys["pulley 0"]
    assert row.belt_torque and row.slip_torque and row.slip_tensions and row.tight and row.slack
    now = abs(row.belt_torque) - 0.06 * (row.tight - row.slack)
    assert now > 0.02 * abs(row.belt_torque)
    tight, slack = row.slip_tensions
    in_slip = abs(row.slip_torque) - 0.06 * (tight - slack)
    # rho v^2 of both spans cancels but for their stretch, a thousandth
    assert in_slip == pytest.approx(now, abs=2e-3 * abs(row.slip_torque))
    assert held_by_less(report)
    report, spans = result.report(0.2), result.span_tension
    for k, row in enumerate(report.spans):
        assert (row.of_run.least, row.of_run.most) == (spans[:, k].min(), spans[:, k].max())
    (most,) = re.findall(r"at most (\S+) N", " ".join(report.text(full=True).split()))
    assert float(most) == pytest.approx(spans.max(), rel=report.tension_error)
    assert report.mass_tension == pytest.approx(0.1 * report.belt_speed**2, rel=0.02)
    (row,), (plain,) = report.creep, report.to_dict()["creep"]
    assert plain["slower"] == pytest.approx(1.0 - row.ratio / row.nominal, rel=1e-9)
    frame = report.to_frame()
    of_frame = frame[(frame.part == "creep") & (frame.quantity == "slower")].value.item()
    assert of_frame == plain["slower"]


def state_of_theory(share: float, way: int = 1) -> Steady:
    """The state of creep theory at a share of the torque of full slip, turning either way."""
    state = creep_theory.steady(DRIVE, OMEGA, lambda _omega: share * FULL.load)
    speed = OMEGA * RADII[0] / DRIVE.stretch(state.tight)
    spans = [state.tight, state.slack]
    return Steady(
        params=unequal(120),
        tension=np.array(spans if way > 0 else spans[::-1]),
        torque=way * np.array([-state.torque, state.load]),
        flow=-way * speed,
        driver=0,
        travel=np.zeros(0),
    )


@pytest.mark.parametrize(("share", "way"), [(0.05, 1), (0.5, -1), (0.95, 1), (0.9, -1)])
def test_from_any_part_of_it_the_torque_is_that_of_theory(share: float, way: int) -> None:
    """The contact gives by EA/(c R^2) = 6e-4 of what the belt stretches: ask for a tenth of it."""
    state = state_of_theory(share, way)
    small, large = full_slip(state)
    assert share * small.factor == pytest.approx(1.0, rel=6e-5)
    assert abs(small.torque) == pytest.approx(FULL.torque, rel=6e-5)
    np.testing.assert_allclose(small.tensions, (FULL.tight, FULL.slack), rtol=6e-5)
    # The other pulley has the larger wrap and slips later, with its own Euler-Eytelwein.
    assert large.factor > small.factor
    mass = DENSITY * (OMEGA * RADII[0] / DRIVE.stretch(large.tensions[0])) ** 2
    tight, slack = (T - mass * (1.0 + T / EA) for T in large.tensions)
    assert tight / slack == pytest.approx(math.exp(THEORY_MU * DRIVE.wraps[1]), rel=1e-4)
    if share == 0.9:  # past full slip with four fifths of the friction
        law = bd.ElasticPlastic(mu=0.8 * THEORY_MU, stiffness=1e10, damping=1e5)
        small, _ = full_slip(attrs.evolve(state, params=attrs.evolve(state.params, friction=law)))
        assert 0.8 < small.factor < 1.0


def crank_drive(kind: str) -> bd.Params:
    """A drive whose crank, pulley 0, has the least friction to spare."""
    pulleys = [
        bd.Pulley(name="crank", center=(0.0, 0.0), radius=0.05, inertia=2e-3),
        bd.Pulley(name="fan", center=(0.30, 0.0), radius=0.07, inertia=2e-3),
    ]
    if kind == "three":
        pulleys.append(bd.Pulley(name="pump", center=(0.15, -0.20), radius=0.06, inertia=2e-3))
    if kind == "arm":
        # It presses on the tight span from outside.
        pulleys.append(pressing((0.15, -0.030), pivot=(0.21, -0.09), stiffness=60.0, preload=-12.0))
    preload = {} if kind == "arm" else {"preload": 300.0}
    return bd.Params(
        belt=bd.Belt(
            n_bodies=100, linear_density=0.1, axial_stiffness=30e3, axial_damping=2.0, **preload
        ),
        pulleys=pulleys,
        friction=bd.Dahl(mu_k=0.4, sigma=4e4),
    )


def slipping(kind: str, end: float, shares: list[float]) -> bd.Result:
    """Under torques that resist at these shares of what is about full slip, from 0.4 s to the end.

    The crank turns clockwise, with the numbering of the links, from 0.3 s on at 60 rad/s.
    """
    sizes = {"two": [0.0, 15.0], "three": [0.0, 9.0, 8.0], "arm": [0.0, 20.0, 0.0]}[kind]
    load = bd.PiecewiseLinear([0.3, 0.4, end], np.outer([0.0, *shares], sizes))
    motion = {"crank": bd.PiecewiseLinear([0.0, 0.3], [0.0, -60.0])}
    return bd.simulate(crank_drive(kind), load, end, motion, rtol=1e-3, method="rodas4")


@pytest.mark.parametrize(
    ("kind", "pull"),
    [
        ("two", 0.8),
        pytest.param("three", 0.6, marks=pytest.mark.ci(guard=OTHERS)),
        pytest.param("arm", 0.45, marks=pytest.mark.ci(guard=OTHERS)),
    ],
)
def test_the_torque_at_which_a_run_slips(kind: str, pull: float) -> None:
    report = slipping(kind, 1.0, [pull, pull]).report(0.3)
    first = report.first_to_slip
    assert first.name == "crank"
    assert not report.unsteady and 1.2 < first.margin < 3.0
    slips = slipping(kind, 1.1, [first.margin * pull * share for share in (0.95, 1.05)])
    # Over the time in which a dozen links pass, so that their landing is no larger torque.
    torque = np.abs(slips.pulleys.torque[:, 0])
    n = round(0.06 / (slips.t[1] - slips.t[0]))
    carried = np.convolve(torque, np.ones(n) / n, "valid")[slips.t[: 1 - n] > 0.4].max()
    assert slips.pulleys.omega[-1, 1] / (-60.0 * 5.0 / 7.0) < 0.9, "the run has not come to slip"
    assert abs(first.slip_torque) == pytest.approx(carried, rel=0.02)


@pytest.mark.parametrize("bending_stiffness", [0.0, 1.0])
def test_what_bending_takes_off(bending_stiffness: float) -> None:
    """Tensions in full slip reach mu wrap less what the report says, to the next order in the angle
    sqrt(EI/T)/r, 0.29 rad, at which the belt leaves the rim: its square.
    """
    belt = {"preload": 800.0, "n_bodies": 200, "axial_stiffness": 2e5, "model": "links"}
    belt["bending_stiffness"] = bending_stiffness
    law = bd.Dahl(mu_k=0.4, sigma=2e4)
    params = open_drive((0.1, 0.1), 0.4, (0.01, 0.01), friction=law, **belt)
    # the head at a steady 5 rad/s, the other pulley braked until the belt slips on both
    brake = bd.Load(1, coulomb=60.0, viscous=40.0)
    motion = {0: bd.PiecewiseLinear([0.0, 0.05], [0.0, 5.0])}
    report = bd.simulate(params, brake, 0.5, motion=motion).report(last=0.4)
    said = [note for note in report.notes if "resists bending" in note]
    row = report.pulleys[0]
    assert row.slip_share > 0.999
    assert row.used < 0.95 or not bending_stiffness, "which the note says"
    if bending_stiffness == 0.0:
        assert not said
        assert row.used == pytest.approx(1.0, abs=2e-3)
        return
    found = re.search(r"([\d.]+) % on pulley 0", said[0])
    assert found
    angle = bending_stiffness / (0.01 * row.slack)  # squared
    loss = 0.01 * float(found[1])
    assert 1.0 - row.used == pytest.approx(loss, rel=angle, abs=2e-3)
    assert loss > 0.015
