"""Loads that a designer takes from a report, and parts of it, against something independent.

Hub loads against the statics of all pulleys together and the samples of the contact; mounts against
the balance of what acts on them; rainflow against the example of the standard, spectra against
sines, the moving string against its closed form, what a soft contact does to radii.
"""

from __future__ import annotations

import math
import sys

import attrs
import numpy as np
import pytest
from two_pulleys import open_drive

import beltdyn as bd
from beltdyn.drive.compliance import compliance
from beltdyn.drive.span import Span
from beltdyn.outputs.histories import BeltHistory
from beltdyn.outputs.spans import joint_points, mid_span
from beltdyn.report import rainflow
from beltdyn.report.hubs import hub_statics
from beltdyn.report.span_rows import dominant
from beltdyn.report.window import Window

pytestmark = pytest.mark.filterwarnings("ignore:(balance|mesh)")

PULSE = 22.0
KINDS = ("in", "out", "lost", "stored", "left")  # of powers


def drive(n_bodies: int, gravity: tuple[float, float] = (0.0, 0.0)) -> bd.Params:
    """A drive with a tensioner arm, whose friction lets it swing and which has stops."""
    params = bd.scenes.tensioned_alternator(n_bodies).params
    *fixed, tensioner = params.pulleys
    arm = attrs.evolve(tensioner.mount, friction=0.3, stops=(-0.1, 0.2))
    pulleys = [*fixed, attrs.evolve(tensioner, mount=arm)]
    return attrs.evolve(params, pulleys=pulleys, gravity=gravity)


@pytest.mark.ci(guard="test_report_loads.py::test_what_acts_on_an_arm_is_in_balance")
def test_a_constant_load_has_a_narrow_range() -> None:
    """Load, speed and tensions are constant but for the mesh: so are the hub loads of a designer.

    The contact of 4 links on the tensioner swings by a third and more of the mean.
    """
    scene = bd.scenes.tensioned_alternator(70)
    steady = bd.simulate(scene.params, scene.torque_fn, 0.4, motion=scene.motion)
    told = steady.report(0.2)
    late = steady.t >= told.begin
    swings = []
    for k, row in enumerate(told.pulleys):
        assert row.hub_load.most - row.hub_load.least < 0.1 * row.hub_load.mean
        raw = np.hypot(*steady.pulleys.load[late, k].T)
        swings.append(float(np.ptp(raw) / raw.mean()))
        # the contact's force has the mean that the spans pull, to what 4 links know of an arc
        x, y = steady.pulleys.load[late, k].mean(axis=0)
        assert row.hub_load.mean == pytest.approx(math.hypot(x, y), rel=0.02)
    assert max(swings) > 0.35
    belt = told.mounts["tensioner"].belt
    raw = steady.mounts.belt_force[late, 0]
    assert belt.mean == pytest.approx(raw.mean(), rel=2e-3)
    assert belt.most - belt.least < 0.7 * np.ptp(raw)


@pytest.mark.filterwarnings("ignore:long_links")
def test_pulleys_carry_the_weight_of_the_belt() -> None:
    """Of all pulleys together the pulls of the spans cancel: what is left is rho L g."""
    params = drive(40, gravity=(0.0, -9.80665))
    still = bd.simulate(params, lambda *_: [0.0, 0.0, 0.0], 0.01)
    statics = hub_statics(Window.last(still, 1.0))
    total = statics[-1].sum(axis=0)
    weight = params.belt.linear_density * params.info["length"] * 9.80665
    assert total[1] == pytest.approx(-weight, rel=2e-3)
    assert abs(total[0]) < 1e-9 * np.abs(statics).max()


def test_what_acts_on_an_arm_is_in_balance() -> None:
    """Its mean acceleration is what its speed changes by over the window, over its inertia; it
    swings with the load, its travel and stops are told; hub loads point where the spans pull.
    """
    knots = np.linspace(0.0, 0.4, 801)
    load = -(5.0 + 2.0 * np.sin(2 * np.pi * PULSE * knots)) * np.minimum(knots / 0.05, 1.0)
    result = bd.simulate(
        drive(70),
        bd.PiecewiseLinear(knots, load, "alternator"),
        0.4,
        motion={"crank": bd.PiecewiseLinear([0.0, 0.1], [0.0, 100.0])},
        t_eval=np.linspace(0.0, 0.4, 1201),
    )
    told = result.report(0.5)
    row, late = told.mounts["tensioner"], result.t >= told.begin
    means = [row.spring, row.damper, row.friction, row.stop, row.belt]
    torques = [one.mean for one in means if one is not None]
    assert len(torques) == 5 and row.kind == "arm"
    speed, arm = result.mounts.travel_speed[late, 0], result.params.pulleys[2].mount
    assert isinstance(arm, bd.Arm)
    change = arm.inertia * (speed[-1] - speed[0]) / (told.end - told.begin)
    # by trapezoids over samples between which links land: 0.5 % of the belt's torque
    assert sum(torques) == pytest.approx(change, abs=5e-3 * abs(torques[-1]))
    travel = result.mounts.travel[late, 0]
    assert (row.travel.least, row.travel.most) == (travel.min(), travel.max())
    assert row.to_stop.least == pytest.approx(travel.min() + 0.1)  # the lower stop is nearer
    # over 4.4 periods a line is found within a tenth of 5 Hz
    assert row.frequency == pytest.approx(PULSE, abs=0.5)
    assert 0.3 < 2.0 * row.amplitude / np.ptp(travel) < 1.2
    lines = told.text(full=True).splitlines()
    (line,) = [one for one in lines if one.strip().startswith("tensioner, travel")]
    assert f" {math.degrees(row.travel.mean):.1f} " in line and " deg " in line
    assert f" {row.frequency:.1f} " in line
    assert any("to the nearer stop" in one for one in lines)
    assert "tensioner, spring" in told._repr_html_()
    assert told.to_dict()["mounts"][0]["travel"]["mean"] == row.travel.mean
    # what dry friction stores is no loss, and is in the balance
    powers = {kind: [one.power for one in told.powers if one.kind == kind] for kind in KINDS}
    assert sum(powers.pop("in")) == pytest.approx(sum(map(sum, powers.values())), rel=1e-9)
    window = Window.last(result, 0.5)
    for pull, pulley in zip(np.moveaxis(hub_statics(window), 1, 0), told.pulleys, strict=True):
        x, y = window.mean(pull)
        assert pulley.hub_direction == pytest.approx(math.atan2(y, x), abs=1e-12)


@pytest.mark.filterwarnings("ignore:(long_links|undamped)")
def test_a_slider_and_a_path() -> None:
    def two(mount: object, **belt: float) -> bd.Params:
        return bd.Params(
            belt=bd.Belt(n_bodies=40, linear_density=0.1, axial_stiffness=60e3, **belt),
            pulleys=[
                bd.Pulley(name="motor", center=(0.0, 0.0), radius=0.05, inertia=0.01),
                bd.Pulley(name="tail", center=(0.4, 0.0), radius=0.05, inertia=0.01, mount=mount),
            ],
            friction=bd.Dahl(mu_k=0.5, sigma=1e4),
        )

    still = lambda *_: [0.0, 0.0]  # noqa: E731
    slider = bd.Slider(direction=(1.0, 0.0), mass=2.0, weight=80.0)
    told = bd.simulate(two(slider, length=1.12), still, 0.02).report(1.0)
    row = told.mounts["tail"]
    pull = 80.0 * 9.80665
    assert row.kind == "slider" and row.to_stop is None and row.damper is None
    assert row.spring.mean == pytest.approx(pull, rel=1e-9)
    assert row.belt.mean == pytest.approx(-pull, rel=1e-3)
    (line,) = (one for one in told.text(full=True).splitlines() if "tail" in one and " mm " in one)
    printed = float(line.partition(" mm ")[2].split()[0])
    assert printed == pytest.approx(1e3 * row.travel.mean, rel=2.0 * told.tension_error)
    assert "spring, hung weight" in told.text(full=True)
    path = bd.Path(t=[0.0, 0.02], displacement=[(0.0, 0.0), (3e-4, -4e-4)])
    told = bd.simulate(two(path, preload=300.0), still, 0.03).report(0.1)
    row = told.mounts[0]
    assert row.kind == "path" and row.belt is None
    assert row.travel.mean == pytest.approx(5e-4, rel=1e-9)
    few = bd.simulate(two(path, preload=300.0), still, 0.01, outputs=("pulleys",)).report(1.0)
    assert any(note.startswith("mounts: mounts.travel") for note in few.notes)
    assert any(note.startswith("hub load of motor, tail") for note in few.notes)


def test_the_middle_of_a_span_is_halfway_along_its_tangent() -> None:
    """Of joints whose "forces" are their coordinates. The belt lies 1 mm from its line at most."""
    params = drive(40)
    rest, route = bd.settle(params), params.route
    line = BeltHistory(**{name: getattr(rest, name)[None] for name in ("x", "y", "phi")})
    points = joint_points(params, line)
    found = [mid_span(params, line, points[..., axis])[0] for axis in (0, 1)]
    after = [*range(1, len(params.pulleys)), 0]
    middle = [0.5 * (route.leave[k] + route.arrive[after[k]]) for k in range(len(after))]
    np.testing.assert_allclose(np.transpose(found), middle, atol=1e-3)


def test_rainflow_counts_the_example_of_the_standard(monkeypatch: pytest.MonkeyPatch) -> None:
    """ASTM E1049-85, figure 6: ranges and counts of its table."""
    cycles = rainflow([-2, 1, -3, 5, -1, 3, -4, 4, -2])
    counts: dict[float, float] = {}
    for one in cycles:
        counts[one.range] = counts.get(one.range, 0.0) + one.count
    assert counts == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    inner = next(one for one in cycles if one.range == 4.0 and one.count == 1.0)
    assert inner.mean == 1.0  # from -1 to 3
    # without the package it names the extra
    monkeypatch.setitem(sys.modules, "rainflow", None)
    with pytest.raises(ImportError, match=r"beltdyn\[report\]"):
        rainflow([0.0, 1.0, 0.0])


T = np.linspace(0.0, 1.0, 401)


def test_lines_of_sines_and_of_a_moving_string() -> None:
    """On a trend, in noise of a tenth of it: within a tenth of the resolution, 1 Hz, and 5 %. None
    of 200 histories of noise has one (the limit is argued for one in a hundred), and no trend.
    """
    noise = np.random.default_rng(1).normal(0.0, 0.3, T.size)
    for frequency in (4.0, 17.3, 60.5, 120.25):
        sine = 3.0 * np.sin(2.0 * np.pi * frequency * T + 0.3)
        line = dominant(T, 500.0 + 40.0 * T + sine + noise)
        assert line.frequency == pytest.approx(frequency, abs=0.1)
        assert line.amplitude == pytest.approx(3.0, rel=0.05)
    random = np.random.default_rng(2)
    assert all(dominant(T, random.normal(size=T.size)) is None for _ in range(200))
    assert dominant(T, 3.0 + T + 0.2 * T**2) is None
    # nor what the window does not hold three periods of, as reports say
    lines = [dominant(T, np.sin(2.0 * np.pi * one * T)) for one in np.arange(2.5, 3.5, 0.02)]
    found = [line.frequency for line in lines if line is not None]
    assert found and 3.0 <= min(found) < 3.1
    assert dominant(T, np.full(T.size, 7.0)) is None
    assert dominant(T[:6], np.sin(T[:6])) is None
    # Waves go out at c - v and come back at c + v: the period is the sum of both times
    tension, density, length = 400.0, 0.1, 0.5
    wave = math.sqrt(tension / density)
    stretch = 1.02
    belt = bd.Belt(
        n_bodies=60, linear_density=density * stretch, axial_stiffness=tension / (stretch - 1.0)
    )

    def moving_string(speed: float) -> float:
        return Span(belt, tension, speed / stretch).string_frequency(length)

    for speed in (0.0, 0.3 * wave, 0.9 * wave):
        one = 1.0 / (length / (wave - speed) + length / (wave + speed))
        assert moving_string(speed) == pytest.approx(one, rel=1e-12)
        assert moving_string(-speed) == pytest.approx(one)
    assert moving_string(1.1 * wave) == 0.0


def test_what_the_radius_does_is_told_apart_from_creep() -> None:
    """A soft contact, not compensated: the smaller pulley loses radius, and the driven one speed.

    The theory is beltdyn.drive.compliance's, right to a fifth of that part, for friction acts
    already where the belt is still sinking in, further out: that much may be told as friction's.
    """
    contact = bd.Contact(linear=5.2e7, damping=2e3)
    law = bd.ElasticPlastic(mu=0.8, stiffness=1e9, damping=1e4)
    belt = {"preload": 400.0, "axial_stiffness": 60e3}
    params = open_drive((0.04, 0.09), 0.3, (2e-3, 2e-3), contact=contact, friction=law, **belt)
    load = bd.PiecewiseLinear([0.1, 0.15], [0.0, 9.0], 1)
    motion = {0: bd.PiecewiseLinear([0.0, 0.1], [0.0, -60.0])}
    result = bd.simulate(params, load, 0.6, motion)
    told = result.report(0.4)
    row = told.creep[0]
    assert not told.unsteady
    tension = [span.tension.mean for span in told.spans if span.tension is not None]
    sunk = compliance(params, tension, abs(told.belt_speed or 0.0))
    # The belt arrives at pulley 1 as slack as span 0 is, at pulley 0 as tight as span 1.
    radius = -math.log((1.0 - sunk.relative_depth[0, 0]) / (1.0 - sunk.relative_depth[1, 0]))
    assert abs(radius) > 3e-3
    assert row.radius == pytest.approx(radius, rel=0.2)
    strains = [1.0 + T / 60e3 for T in tension]
    assert row.stretch == pytest.approx(math.log(strains[1] / strains[0]), rel=1e-6)
    assert abs(row.friction) < 0.2 * abs(radius)
    assert abs(row.remainder) < 0.05 * row.lost
