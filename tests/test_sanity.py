"""Warnings of data that are hardly meant, and of what a run shows: when, and when not."""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from click.testing import CliRunner

import beltdyn as bd
from beltdyn import cli
from beltdyn.accuracy import differences, observe, with_links
from beltdyn.base import run_warnings
from beltdyn.base.rounding import percent
from beltdyn.drive import sanity
from beltdyn.run import observed

DAHL = bd.Dahl(mu_k=1.0, sigma=1e4)


def drive(
    radii: tuple[float, float] = (0.1, 0.1),
    distance: float = 0.29,
    strain: float = 0.007,
    links: int = 240,
    *,
    density: float = 0.1,
    stiffness: float = 70e3,
    inertia: float = 0.01,
    **changes: Any,
) -> bd.Params:
    """Two pulleys, the belt strained by so much."""
    pulleys = [
        bd.Pulley(center=(x, 0.0), radius=r, inertia=inertia)
        for x, r in zip((0.0, distance), radii, strict=True)
    ]
    belt = bd.Belt(
        length=bd.route(pulleys).length / (1.0 + strain),
        n_bodies=links,
        linear_density=density,
        axial_stiffness=stiffness,
        axial_damping=1.4,
        mesh="paper",
    )
    rest = {"contact": bd.Contact(linear=1e8, damping=1e3), "friction": DAHL} | changes
    return bd.Params(belt=belt, pulleys=pulleys, **rest)


def codes(params: bd.Params) -> list[str]:
    return [one.code for one in sanity.check(params)]


def run(params: bd.Params, torque: Any, t_end: float, **options: Any) -> bd.Result:
    """Run without Python's warnings: those of the result are looked at."""
    with run_warnings.silenced():
        return bd.simulate(params, torque, t_end, **options)


def found(result: bd.Result, code: str) -> list[bd.RunWarning]:
    return [one for one in result.warnings if one.code == code]


def steady(drive: float, load: float = 0.0) -> bd.Torque:
    """Set torques that come within 10 ms and stay."""
    return bd.PiecewiseLinear([0.0, 0.01], [[0.0, 0.0], [drive, load]])


def test_a_calm_drive_says_nothing() -> None:
    assert codes(drive()) == []
    assert "note" not in str(drive())
    result = run(drive(), steady(-10.0, 10.0), 0.05)
    assert result.warnings == ()
    assert "warnings" not in dict(result.summary())
    assert observed.observe(run(drive(), steady(-1.0), 1e-4, t_eval=[])) == ()


@pytest.mark.parametrize(
    ("params", "code", "accuracy", "word"),
    [
        (drive(links=60), "mesh", True, "n_bodies = 220"),
        (drive(strain=0.031), "strain", False, "belt.length = 1.174"),
        (drive(contact=bd.Contact(linear=4e6)), "compliance", True, "contact.linear = 6.2e+06"),
        (drive((0.02, 0.1), strain=0.029, links=90), "long_links", True, "n_bodies = 100"),
        (drive(gravity=(0.0, -9810.0)), "units", False, "mm/s^2"),
    ],
    ids=lambda value: value if isinstance(value, str) and value.isidentifier() else "",
)
def test_what_is_said_of_a_drive(params: bd.Params, code: str, accuracy: bool, word: str) -> None:
    (one,) = [one for one in sanity.check(params) if one.code == code]
    assert one.accuracy is accuracy and one.t is None
    assert word in one.text and "\n" not in one.text
    assert f"  note  {one}" in str(params).splitlines()


def test_what_is_suggested_is_enough_and_not_much_too_much() -> None:
    # mesh: the next ten above what 2 % takes
    assert "mesh" in codes(drive(links=200)) and "mesh" not in codes(drive(links=220))
    # strain: the suggested length rounded up to four digits
    assert "strain" not in codes(drive(strain=0.0299))
    length = attrs.evolve(drive(strain=0.031).belt, length=1.174)
    assert "strain" not in codes(attrs.evolve(drive(strain=0.031), belt=length))
    # contact: the wraps, together 2 pi, at a depth of 0.5 mm take 2 pi 0.5 mm / L off the strain;
    # what is left of 70e3 N x 0.007, 307 N, on its 1.0044 m of arc for each metre of the belt
    # without stress, over 0.1 m x 0.5 mm is 6.17e6 N/m^2
    left = 70e3 * (0.007 - 2.0 * math.pi * 0.5e-3 / drive().belt.length)
    needed = left * (1.0 + left / 70e3) / (0.1 * 0.5e-3)
    assert "compliance" not in codes(drive(contact=bd.Contact(linear=1.001 * needed)))
    assert "compliance" in codes(drive(contact=bd.Contact(linear=0.999 * needed)))
    # links: half a radius is 10 mm
    small = drive((0.02, 0.1), strain=0.029)
    least = math.ceil(small.belt.length / 0.01)
    assert 90 < least <= 100
    assert "long_links" not in codes(with_links(small, least))
    assert "long_links" in codes(with_links(small, least - 1))


def test_mesh_share_against_settled_belts() -> None:
    """Almost half at 60 links; the finest belt has its own, 1/256 of that."""
    contact = bd.Contact(linear=2.5e7, quadratic=5e10, damping=1e3)
    params, finest = drive((0.05, 0.12), strain=0.005, contact=contact), 960
    arcs = params.info["path_length"] - 2.0 * math.hypot(0.29, 0.07)

    def tension(n_bodies: int) -> float:
        fine = with_links(params, n_bodies)
        still = run(fine, bd.Viscous([0.0, 0.0]), 1e-6, t_eval=[0.0], initial=bd.settle(fine))
        return float(still.joints.force.mean())

    fine = tension(finest) / (1.0 + sanity.mesh_share(with_links(params, finest)))
    for links in (60, 120, 240):
        share = sanity.mesh_share(with_links(params, links))
        excess = tension(links) / fine - 1.0
        # Wraps hold whole links: each of their four ends is known to half a link.
        assert excess == pytest.approx(share, rel=2.0 * params.belt.length / links / arcs)
        if links == 60:
            assert share == pytest.approx(0.44, abs=0.01)
    # of the paper's two pulleys a quarter (README, MODEL section 6)
    assert sanity.mesh_share(drives.plain()) == pytest.approx(0.25, abs=0.01)


MACHINES = {
    # radii, distance [m], strain, links; kg/m, N, kg m^2
    "plotter": drive((0.005, 0.005), 0.3, 0.002, 300, density=0.008, stiffness=2e4, inertia=5e-6),
    "cassette": drive((0.004, 0.02), 0.06, 0.1, 300, density=1.3e-3, stiffness=6.0, inertia=2e-7),
    "tape": drive((0.005, 0.03), 0.1, 0.002, 600, density=1.2e-4, stiffness=250.0, inertia=1e-6),
    "lathe": drive((0.04, 0.08), 0.4, 0.008, 240, density=0.1, stiffness=4e4, inertia=0.003),
    "paper": drive(),
    "round": drive((0.02, 0.05), 0.25, 0.07, 240, density=0.04, stiffness=1200.0, inertia=1e-4),
    "steel": drive((0.3, 0.3), 2.0, 0.0006, 300, density=0.78, stiffness=2e7, inertia=0.8),
    "chain": drive((0.04, 0.1), 0.6, 0.0004, 240, density=1.5, stiffness=2e6, inertia=0.005),
    "mill": drive((0.2, 0.9), 2.5, 0.006, 300, density=3.0, stiffness=1.5e6, inertia=60.0),
    "conveyor": drive((0.5, 0.5), 48.0, 0.003, 1000, density=12.0, stiffness=3.2e6, inertia=40.0),
    "ropeway": drive((2.4, 2.4), 900.0, 0.003, 4000, density=7.0, stiffness=5e7, inertia=4e3),
}  # fmt: skip


def at_scale(params: bd.Params, scale: float = 1.0, **belt: float) -> bd.Params:
    """Return the drive with all lengths multiplied, and other data of the belt multiplied."""
    factors = {"length": scale} | belt
    changed = {name: getattr(params.belt, name) * factor for name, factor in factors.items()}
    pulleys = [
        attrs.evolve(p, center=(scale * p.center[0], 0.0), radius=scale * p.radius)
        for p in params.pulleys
    ]
    return attrs.evolve(params, belt=attrs.evolve(params.belt, **changed), pulleys=pulleys)


@pytest.mark.parametrize("name", MACHINES)
def test_units_of_machines_that_exist_are_not_doubted_and_wrong_ones_are(name: str) -> None:
    params = MACHINES[name]
    assert "units" not in codes(params), sanity.check(params)
    # As heavy as pulleys may be, for a shaft and a motor or a flywheel turns with them.
    heavy, in_mm = (
        attrs.evolve(
            params, pulleys=[attrs.evolve(p, inertia=times * p.inertia) for p in params.pulleys]
        )
        for times in (1e3, 1e6)
    )
    assert "units" not in codes(heavy)
    held = [attrs.evolve(p, inertia=1e12 * p.inertia) for p in params.pulleys]
    assert "units" not in codes(attrs.evolve(params, pulleys=held)), "pulleys that keep their speed"
    for wrong, word in (
        (in_mm, "kg mm^2"),
        (at_scale(params, 1e3), "mm"),
        (at_scale(params, axial_stiffness=1e-3), "kN"),
        (at_scale(params, linear_density=1e3), "g/m"),
    ):
        (one,) = [one for one in sanity.check(wrong) if one.code == "units"]
        assert word in one.text


def test_other_units() -> None:
    small = drive((0.003, 0.003), 0.05, inertia=1e-6)
    soft, percent = (bd.Dahl(mu_k=mu_k, sigma=s) for mu_k, s in ((1.0, 10.0), (30.0, 1e4)))
    for params, words in (
        # Small pulleys in mm stay below any limit of their size; their inertia gives them away.
        (at_scale(small, 1e3), "disc of water .* mm"),
        (drive(stiffness=2.1e11, strain=1e-3), "Pa"),  # a modulus
        (drive(density=1e-4), "kg/mm"),
        (drive(friction=soft), "^of friction: "),  # 10 1/mm is 1e4 1/m
        (drive(friction=percent), "^of friction: .*percent"),  # 30 percent is 0.3
    ):
        (one,) = [one for one in sanity.check(params) if one.code == "units"]
        assert re.search(words, f"of {one.where}: {one.text}"), one
    assert "units" not in codes(small)
    # 5e3 and 1e3 1/m are soft, but there are such belts; 3 is a V-belt, a huge coefficient says
    # that nothing is to slip.
    for mu_k, sigma in ((1.0, 1e3), (0.1, 1e4), (3.0, 1e4), (10.0, 1e4), (1e3, 1e4), (1e9, 1e4)):
        assert codes(drive(friction=bd.Dahl(mu_k=mu_k, sigma=sigma))) == []
    # A preload is told as it was given, not as the strain of the belt line.
    asked = attrs.evolve(drive().belt, length=None, preload=300.0, linear_density=15.0)
    (one,) = [one for one in sanity.check(attrs.evolve(drive(), belt=asked)) if one.code == "units"]
    assert "preload of 300 N" in one.text
    # Ten times Earth's gravity is a test rig.
    assert codes(drive(gravity=(0.0, -98.1))) == []


def test_units_of_torques() -> None:
    """The most a belt carries over is 2 T R, here 2 x 490 N x 0.1 m but for the mesh."""
    params = drive(links=60)
    (one,) = found(run(params, steady(-50e3), 0.002), "units")
    assert "N mm" in one.text and one.where == "pulley 0" and 0.0 < one.t < 0.001
    most = 2.0 * 0.1 * 70e3 * (params.info["strain"] + params.info["mesh_strain"])
    assert not found(run(params, steady(-9.9 * most), 0.011), "units")
    assert found(run(params, steady(-10.1 * most), 0.011), "units")
    # Of a Python function the torques are known when it has run.
    assert found(run(params, lambda t, theta, omega: [0.0, 20.0 * most], 0.002), "units")


def test_a_crank_that_its_irregularity_turns_back() -> None:
    """Amplitudes in degrees, as the speed tells exactly: 1 - a o sin; not before it fades in."""
    amplitude, t_end = math.degrees(0.02), 1e-3
    for given, fade, turned in (
        ([0.02, 0.0], None, False),
        ([amplitude, 0.0], None, True),
        ([0.4999, 0.0], None, False),
        ([0.5, 0.05], None, True),  # sin x + 0.2 sin 2x, above 1 before x = 90 deg
        ([amplitude, 0.0], (t_end, 1.0), False),
    ):
        crank = bd.CrankMotion(-84.0, [2, 4], given, fade=fade)
        with run_warnings.silenced():
            result = bd.simulate(drive(), steady(0.0), t_end, motion={0: crank})
        units = [one.text for one in found(result, "units")]
        assert len(units) == turned
        if turned and given[1] == 0.0:
            assert f"to {1.0 - 2.0 * amplitude:.3g} times its mean speed" in units[0]


def test_a_driven_drive_without_friction() -> None:
    free = drive(friction=None)
    driven = run(free, steady(-100.0), 0.02)
    (one,) = found(driven, "no_friction")
    assert one.where == "pulley 0" and one.t > 0.0 and not found(driven, "full_slip")
    assert not found(run(free, steady(0.0), 0.02), "no_friction")
    # Pulleys that only run down are not driven.
    turning = attrs.evolve(bd.settle(free), omega=np.array([-5.0, -5.0]))
    result = run(free, bd.Viscous([0.1, 0.1]), 0.02, initial=turning)
    assert not found(result, "no_friction")


def test_full_slip_says_where_when_and_how_much() -> None:
    """The driving pulley runs away for a while, and then takes hold."""
    params, torque, t_end, _ = bd.scenes.flywheel_start()
    flywheel = run(params, torque, t_end)
    driving, driven = found(flywheel, "full_slip")
    assert (driving.where, driven.where) == ("pulley 0", "pulley 1")
    # A pulley without a torque has none to be lowered.
    assert driving.text.endswith("or lower the torque") and "lower" not in driven.text
    # The belt sticks while torque builds up, over 20 ms, and again once it has dropped, 0.12 s on.
    assert 0.0 < driving.t < 0.02
    sticking = flywheel.slip[-100:, 1]  # but for the driving pulley's swing against the flywheel
    assert np.abs(sticking).max() < 0.02 and abs(sticking.mean()) < 0.005
    # What it says to be lost is the ledger's friction loss, but for the little lost in creep.
    says = r"which dissipates (\S+) J"
    joules = [float(re.search(says, one.text)[1]) for one in (driving, driven)]  # type: ignore[index]
    assert sum(joules) == pytest.approx(flywheel.energy.friction_loss[-1], rel=0.02)
    listed = dict(flywheel.summary())["warnings"]
    assert listed == "2: full_slip (pulley 0), full_slip (pulley 1)"


def test_what_friction_transmits_in_slip_is_what_the_pulley_does_not_gain() -> None:
    """A mean over the time of slip: set torque less inertia times acceleration. Single samples,
    with links that land, have a third more.
    """
    result = run(drives.reduction(40), bd.PiecewiseLinear([0.0, 0.02], [0.0, -90.0], 0), 0.06)
    (slips,) = (one for one in found(result, "full_slip") if one.where == "pulley 0")
    at = [float(one) for one in re.search(r"t = (\S+) and (\S+) s", slips.text).groups()]  # type: ignore[union-attr]
    first, last = np.searchsorted(result.t, np.array(at) - 1e-5)
    during, of = slice(first, last + 1), result.pulleys
    t, omega = result.t[during], of.omega[during, 0]
    gained = result.params.pulleys[0].inertia * np.ptp(omega) / np.ptp(t)
    left = abs(np.mean(of.torque[during, 0])) - gained
    said = float(re.search(r"transmits (\S+) N m", slips.text)[1])  # type: ignore[index]
    assert said == pytest.approx(left, rel=0.02)


def pushed(n_bodies: int | None, inertia: float, torque: float) -> bd.Result:
    """Light pulleys of 12 mm for 0.1 s, in the first 22 ms of which a torque acts."""
    params = drives.light_scene().params
    pulleys = [attrs.evolve(one, radius=0.012, inertia=inertia) for one in params.pulleys]
    mesh = {"mesh": "joint" if n_bodies else "ale", "n_bodies": n_bodies}
    params = attrs.evolve(params, belt=attrs.evolve(params.belt, **mesh), pulleys=pulleys)
    pulse = bd.PiecewiseLinear([0.0, 2e-3, 0.02, 0.022], [0.0, torque, torque, 0.0], 0)
    return run(attrs.evolve(params, gravity=(0.0, 0.0)), pulse, 0.1, rtol=1e-4)


def test_links_that_slow_pulleys_down() -> None:
    """Against an ALE belt, within the factor of three to which errors of meshes are estimated; and
    where they stop them.
    """
    exact = observe(pushed(None, 2e-5, 0.3))
    for n_bodies in (200, 300, 600):
        run = pushed(n_bodies, 2e-5, 0.3)
        told, off = run.accuracy["speed"].space, differences(observe(run), exact)["speed"]
        assert told is not None and off / 3.0 <= told <= 3.0 * off
        said = [one.text for one in found(run, "mesh_speed")]
        if n_bodies == 600:
            assert not said and told < sanity.MESH
            continue
        assert f"by some {percent(told)}, " in said[0] and 'Belt(mesh="ale") has none' in said[0]
        assert "speed" in run.accuracy.sentence() and percent(told) in run.accuracy.sentence()
    assert pushed(None, 2e-5, 0.3).accuracy["speed"].space is None
    caught = pushed(160, 2e-6, 0.1)
    (stopped,) = found(caught, "mesh_speed")
    at = float(re.search(r"up to (\S+) N along", stopped.text)[1])  # type: ignore[index]
    # 8.3 N push for a fifth of the time, and are held
    assert at > 0.1 / 0.012 and np.ptp(caught.pulleys.theta[200:]) < 0.1


def test_pulleys_that_slip_in_full_against_each_other_do_so_without_links() -> None:
    against = run(drive(links=60), steady(-300.0, 300.0), 0.02)
    assert len(found(against, "full_slip")) == 2 and not found(against, "mesh_speed")


def test_corners_of_links_raise_friction_in_full_slip() -> None:
    """A pulley of 12 mm that a large one pulls the belt over, by links of 34 degrees. That ends of
    wraps stand between corners, and belt on the way sticks, is less than a third of it.
    """
    params = drives.light_scene().params
    pulleys = [
        attrs.evolve(one, center=(0.5 * k, 0.0), radius=r, inertia=1.0)
        for k, (one, r) in enumerate(zip(params.pulleys, (0.012, 0.036), strict=True))
    ]
    belt = attrs.evolve(params.belt, n_bodies=160, bending_stiffness=0.0, bending_damping=0.0)
    params = bd.Params(belt=belt, pulleys=pulleys, friction=bd.Dahl(mu_k=0.5, sigma=1e4))
    start = bd.settle(params, speed={1: -28.0})
    motion = {
        0: bd.PiecewiseLinear([0.0, 0.03], [start.omega[0], 0.0]),
        1: bd.PiecewiseLinear([0.0], [start.omega[1]]),
    }
    result = run(params, bd.Viscous([0.0, 0.0]), 0.3, motion=motion, initial=start, rtol=1e-3)
    tight, slack = sorted(np.nanmean(result.span_tension[500:], axis=0), reverse=True)
    carried = slack * math.expm1(0.5 * params.route.wraps[0])
    (slips,) = (one for one in found(result, "full_slip") if one.where == "pulley 0")
    said = float(re.search(r"up to (\S+) % too high: Belt", slips.text)[1])  # type: ignore[index]
    more = 100.0 * ((tight - slack) / carried - 1.0)
    assert more > 3.0 and said == pytest.approx(more, rel=1.0 / 3.0)


def test_just_below_full_slip() -> None:
    """Nine tenths of what Euler-Eytelwein allows are carried without a word; not eleven."""
    params = drive()
    radius, span, ratio = 0.1, 0.29, math.exp(math.pi)
    # Centres are fixed, so the stretch of spans and arcs is what it was at rest:
    # span (T_t + T_s) + 2 R (T_t - T_s)/mu = path T, with T_t = T_s exp(mu pi), mu = 1. The mesh
    # adds 1.6 % to T and the contact takes 4 % off.
    path, tension = params.info["path_length"], params.info["strain_tension"]
    slack = path * tension / (span * (ratio + 1.0) + 2.0 * radius * (ratio - 1.0))
    most = (ratio - 1.0) * slack * radius
    assert run(params, steady(-0.9 * most, 0.9 * most), 0.1).warnings == ()
    above = run(params, steady(-1.1 * most, 1.1 * most), 0.1)
    assert {one.where for one in found(above, "full_slip")} == {"pulley 0", "pulley 1"}
    # Locked by how it was laid: friction is developed, and nothing moves.
    tensioning = bd.Tensioning(friction=True, offset={1: (-0.006, 0.0)})
    locked = run(attrs.evolve(drive(links=60), tensioning=tensioning), steady(0.0), 0.05)
    assert np.abs(locked.contact.mu).max() > 0.99 and not found(locked, "full_slip")


def test_a_slack_span() -> None:
    """A heavy pulley that is jerked takes all tension out of the span behind it."""
    params = drive(strain=0.0005, links=60, friction=bd.Dahl(mu_k=3.0, sigma=1e4))
    result = run(params, steady(-60.0, 60.0), 0.05)
    (one,) = found(result, "slack_span")
    lowest = np.nanmin(result.span_tension, axis=0)
    k = int(np.argmin(lowest))
    assert one.where == f"span pulley {k} to pulley {1 - k}" and lowest.min() <= 0.0
    assert one.t == result.t[np.flatnonzero((result.span_tension <= 0.0).any(axis=1))[0]]
    calm = run(params, steady(-1.0, 1.0), 0.05)
    assert calm.joints.force.min() > 0.0 and not found(calm, "slack_span")


def test_spans_of_a_belt_off_its_pulley_are_slack() -> None:
    """An axis moves in by more than the belt is stretched: spans have no joints that are free of
    both pulleys then, and no tension (NaN), which is no reason to call them tight.
    """
    path = bd.Path(t=[0.0, 0.01], displacement=[(0.0, 0.0), (-2.5e-3, 0.0)])
    pulleys = [
        bd.Pulley(center=(x, 0.0), radius=0.06, inertia=0.002, mount=mount)
        for x, mount in ((0.0, None), (0.25, path))
    ]
    belt = bd.Belt(preload=300.0, n_bodies=60, linear_density=0.1, axial_stiffness=60e3,
                   axial_damping=2.0)  # fmt: skip
    params = bd.Params(belt=belt, pulleys=pulleys, friction=bd.Dahl(mu_k=0.6, sigma=1e4))
    result = run(params, steady(0.0), 0.015)
    off = [~(result.contact.pulley == j).any(axis=1) for j in (0, 1)]
    slack = (off[0] | off[1]) & (result.joints.force <= 0.0).any(axis=1)
    assert slack.any() and not (result.span_tension <= 0.0).any()
    warned = found(result, "slack_span")
    names = {f"span pulley {k} to pulley {1 - k}" for k in (0, 1)}
    assert {one.where for one in warned} == names and result.stats.error is None
    assert all(one.t == result.t[np.flatnonzero(slack)[0]] for one in warned)
    told = str(result.report().text(full=True))
    assert "where a span has no tension, see the notes" in " ".join(told.split())
    assert "none goes slack" not in told


def test_each_is_issued_once_with_its_category_and_kept(tmp_path: Path) -> None:
    """Silence ends with its block."""
    params = drive(links=60)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert found(run(params, steady(-1.0), 0.001), "mesh")
    with pytest.warns(bd.AccuracyWarning, match="^mesh: ") as caught:
        result = bd.simulate(params, steady(-1.0), 0.002)
    assert len(caught) == 1 and caught[0].filename == __file__
    assert dict(result.summary())["warnings"] == "1: mesh"
    assert "mesh" in str(result)
    result.save(tmp_path / "run.npz")
    assert bd.Result.load(tmp_path / "run.npz").warnings == result.warnings


def test_identification_speaks_of_the_best_run_alone() -> None:
    params, torque = drive(links=60), steady(-10.0, 10.0)
    measured = run(params, torque, 0.005)
    experiment = bd.Experiment(torque, t_end=0.005)
    tension = measured.span_tension[:, 0]
    target = experiment.curve("span_tension[0]", measured.t, tension, sigma=1.0)
    guess = attrs.evolve(params, belt=attrs.evolve(params.belt, axial_stiffness=75e3))
    with pytest.warns(bd.AccuracyWarning, match="^mesh: ") as caught:
        best = bd.identify(guess, ["belt.axial_stiffness"], [target], workers=2, max_nfev=4)
    assert best.runs > 4 and len(caught) == 1 and caught[0].filename == __file__
    assert all(found(result, "mesh") for result in best.results.values())


def call(*arguments: object, code: int = 0, **environment: str) -> tuple[list[str], str]:
    runner = CliRunner(env={"FORCE_COLOR": None, "NO_COLOR": None, **environment})
    done = runner.invoke(cli.main, [str(one) for one in arguments])
    assert done.exit_code == code, done.output
    return done.stderr.splitlines(), done.stdout


def test_the_command_line_in_colour_or_quiet(tmp_path: Path) -> None:
    arguments = ("run", "kubas-case-1", "--t-end", "0.002")
    lines, table = call(*arguments)
    assert [line.split(":")[:3] for line in lines] == [["beltdyn", " warning", " mesh"]]
    assert "\x1b" not in lines[0] and "Warnings: mesh (" in " ".join(table.split())
    lines, _ = call(*arguments, FORCE_COLOR="1")
    assert lines[-1].endswith("\x1b[0m") and "\x1b[33mbeltdyn: warning: mesh: " in lines[-1]
    lines, _ = call(*arguments, FORCE_COLOR="1", NO_COLOR="1")
    assert "\x1b[33m" not in lines[-1] and "beltdyn: warning: mesh: " in lines[-1]
    out = tmp_path / "run.npz"
    assert call(*arguments, "--quiet", "--out", out) == ([], "")
    assert found(bd.Result.load(out), "mesh")


def test_a_run_in_millimetres_fails_with_the_word(tmp_path: Path) -> None:
    params = at_scale(drive(links=60, contact=bd.Contact(linear=2.5e7, damping=1e3)), 1e3)
    scene = bd.Scene(params, steady(-100.0), 1.0)
    with pytest.raises(bd.SimulationError) as failed, run_warnings.silenced():
        bd.simulate(*scene[:3])
    assert any("warning before this error: units" in note for note in failed.value.__notes__)
    scene.to_toml(tmp_path / "drive.toml")
    lines, _ = call("run", tmp_path / "drive.toml", code=1)
    assert any(line.startswith("beltdyn: warning: units: ") for line in lines[:-1])
    assert "did not come to rest" in lines[-1]


def test_a_wrap_on_which_hardly_a_link_lies() -> None:
    """An idler that the belt hardly bends round is touched by one link, or by none."""
    params = attrs.evolve(drives.plain(), belt=attrs.evolve(drives.plain().belt, mesh="joint"))
    place = {"center": (0.145, 0.108), "radius": 0.03, "side": "outside"}
    idler = bd.Pulley(inertia=3e-4, name="idler", **place)
    bent = [params.pulleys[0], idler, params.pulleys[1]]
    belt = attrs.evolve(params.belt, length=bd.route(bent).length / 1.004, n_bodies=120)
    short = attrs.evolve(params, pulleys=bent, belt=belt)
    lie = short.route.wraps[1] * 0.03 / short.info["link_length"]
    assert 0.5 < lie < 1.5
    (found,) = [one for one in sanity.check(short) if one.code == "long_links"]
    assert 'pulley "idler"' in found.text and f"only {lie:.2g} links" in found.text
    needed = int(re.search(r"n_bodies = (\d+)", found.text)[1])  # type: ignore[index]
    enough = attrs.evolve(short, belt=attrs.evolve(belt, n_bodies=needed))
    assert not [one for one in sanity.check(enough) if one.code == "long_links"]
