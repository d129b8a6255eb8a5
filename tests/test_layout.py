"""Pulleys on either side of the belt: the route in closed form, and drives that run on it."""

from __future__ import annotations

import math
from pathlib import Path

import drives
import numpy as np
import pytest
import reference
from bridge import sides_of
from click.testing import CliRunner

import beltdyn as bd
from beltdyn.cli import main


def pulley(x: float, y: float, radius: float, side: str = "inside") -> bd.Pulley:
    return bd.Pulley(center=(x, y), radius=radius, inertia=0.01, side=side)


def assert_is_tight(pulleys: tuple[bd.Pulley, ...], route: bd.Route) -> None:
    """Spans touch both circles at right angles to the radii and leave them where arcs end; the
    arcs turn them into each other.
    """
    centers = np.array([one.center for one in pulleys])
    radii = np.array([one.radius for one in pulleys])
    along = (np.roll(route.arrive, -1, axis=0) - route.leave) / route.spans[:, None]
    assert np.linalg.norm(along, axis=1) == pytest.approx(1.0, abs=1e-12)
    for points, direction in ((route.leave, along), (route.arrive, np.roll(along, 1, axis=0))):
        out = points - centers
        assert np.linalg.norm(out, axis=1) == pytest.approx(radii, rel=1e-12)
        assert np.sum(out * direction, axis=1) == pytest.approx(0.0, abs=1e-12)
        # the rim runs along with the belt
        turn = out[:, 0] * direction[:, 1] - out[:, 1] * direction[:, 0]
        assert np.array_equal(np.sign(turn), route.senses)
    angle = np.arctan2(along[:, 1], along[:, 0])
    turned = np.mod(route.senses * (angle - np.roll(angle, 1)), 2.0 * np.pi)
    assert turned == pytest.approx(route.wraps, abs=1e-12)
    assert route.length == pytest.approx(np.sum(route.spans + radii * route.wraps), rel=1e-14)
    assert np.sum(route.senses * route.wraps) == pytest.approx(2.0 * np.pi * route.turns, abs=1e-12)


def test_a_crossed_belt() -> None:
    """Wraps of half a turn and twice asin((r + R) / d), the same on both pulleys."""
    pulleys = (pulley(0.0, 0.0, 0.06), pulley(0.28, 0.21, 0.10, "outside"))
    route = bd.route(pulleys)
    lean = math.asin(0.16 / 0.35)
    assert route.wraps == pytest.approx(math.pi + 2.0 * lean, rel=1e-14)
    assert route.spans == pytest.approx(0.35 * math.cos(lean), rel=1e-14)
    assert route.turns == 0
    assert route.senses.tolist() == [-1, 1]
    assert_is_tight(pulleys, route)


def test_random_layouts() -> None:
    """Against the oracle's belt line; those refused would pass through a pulley or cross."""
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(400):
        n = rng.integers(3, 7)
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, n)) * rng.choice([-1.0, 1.0])
        radii, away = rng.uniform(0.02, 0.08, n), rng.uniform(0.12, 0.3, n)
        centers = (away * [np.cos(angle), np.sin(angle)]).T
        sides = ["inside", *rng.choice(["inside", "outside"], n - 1, p=[0.7, 0.3])]
        pulleys = tuple(map(pulley, *centers.T, radii, map(str, sides)))
        try:
            route = bd.route(pulleys)
        except ValueError:
            continue
        assert_is_tight(pulleys, route)
        assert abs(route.turns) == 1
        found += "outside" in sides
        signs = [1 if side == "inside" else -1 for side in sides]
        *_, winding, path = reference.belt_line(centers, radii, route.length, 90, signs)
        assert winding == route.turns
        assert path == pytest.approx(route.length, rel=1e-12)
    assert found >= 15


def crosses_itself(route: bd.Route, pulleys: list[bd.Pulley]) -> bool:
    """Whether two sides of the belt line as a polygon, arcs in 24 parts, cross each other."""
    along = np.linspace(0.0, 1.0, 24)
    arcs = []
    for k, one in enumerate(pulleys):
        x, y = route.arrive[k] - one.center
        at = math.atan2(y, x) + route.senses[k] * route.wraps[k] * along
        arcs.append(one.center + one.radius * np.column_stack([np.cos(at), np.sin(at)]))
    begin = np.concatenate(arcs)
    end = np.roll(begin, -1, axis=0)

    def left(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        (ax, ay), (bx, by) = np.moveaxis(q - p, -1, 0), np.moveaxis(r - p, -1, 0)
        return ax * by - ay * bx

    a, b, c, d = begin[:, None], end[:, None], begin[None], end[None]
    apart = (left(a, b, c) * left(a, b, d) < 0.0) & (left(c, d, a) * left(c, d, b) < 0.0)
    return bool(apart[np.triu_indices(len(begin), 2)].any())


def with_idlers(rng: np.random.Generator) -> list[bd.Pulley] | None:
    """Three to five pulleys, and up to three idlers on the belt's back, or that just miss it."""
    n = int(rng.integers(3, 6))
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, n)) * rng.choice([-1.0, 1.0])
    radii, away = rng.uniform(0.03, 0.08, n), rng.uniform(0.2, 0.4, n)
    plain = list(map(pulley, *(away * [np.cos(angle), np.sin(angle)]), radii))
    try:
        route = bd.route(plain)
    except ValueError:
        return None
    found = []
    for k, one in enumerate(plain):
        found.append(one)
        span = np.roll(route.arrive, -1, axis=0)[k] - route.leave[k]
        out = route.turns * np.array([span[1], -span[0]]) / np.hypot(*span)
        for part in (0.3, 0.7):
            if rng.random() < 0.3 and len(found) < 7:
                radius, gap = (
                    rng.uniform(0.015, 0.04),
                    rng.choice([0.03, 2e-3]) * rng.uniform(-1, 1),
                )
                x, y = route.leave[k] + part * span + (radius + gap) * out
                found.append(pulley(x, y, radius, "outside"))
    return found if 4 <= len(found) <= 7 and len(found) > n else None


def test_no_belt_is_given_a_loop() -> None:
    """Of random drives with idlers on the back, none that is accepted crosses itself, as by a loop
    of 355 degrees round an idler that the belt misses by a little (a third did).
    """
    rng = np.random.default_rng(11)
    drawn = [with_idlers(rng) for _ in range(150)]
    accepted = missed = 0
    for pulleys in drawn:
        if pulleys is None:
            continue
        try:
            route = bd.route(pulleys)
        except ValueError as error:
            missed += "misses it by" in str(error)
            continue
        accepted += 1
        assert abs(route.turns) == 1 and not crosses_itself(route, pulleys)
    assert accepted >= 10 and missed >= 10


@pytest.mark.parametrize("names", [(None, "pulleys[1]"), ("idler", 'pulley "idler"')])
def test_an_idler_that_the_belt_misses_is_named(names: tuple[str | None, str]) -> None:
    """By how much it misses it: moved by that, it just touches. In a drive of three as of four."""

    def layout(y: float, n: int) -> list[bd.Pulley]:
        idler = bd.Pulley(center=(0.2, y), radius=0.04, inertia=0.01, side="outside", name=names[0])
        around = [pulley(0.0, 0.0, 0.1), idler, pulley(0.4, 0.0, 0.1), pulley(0.2, -0.25, 0.05)]
        return around[:n]

    for n in (3, 4):
        assert 0.0 < bd.route(layout(0.1399, n)).wraps[1] < 0.01
        for away in (1e-4, 1e-3, 0.02):
            with pytest.raises(ValueError, match="cannot be reached") as refused:
                bd.route(layout(0.14 + away, n))
            assert str(refused.value).startswith(f"{names[1]} cannot be reached by the belt")
            assert f"the belt misses it by {away:.3g} m: move it towards the belt" in str(
                refused.value
            )


A, B = pulley(0.0, 0.0, 0.08), pulley(0.30, 0.02, 0.10)


def test_routes_that_there_are_not() -> None:
    for pulleys, message in (
        ((pulley(0.0, 0.0, 0.08, "outside"), B), r"pulleys\[0\] must be inside"),
        ((A, pulley(0.12, 0.30, 0.04, "outside"), B), r"pulleys\[1\] cannot be reached"),
        ((A, pulley(0.15, 0.09, 0.03, "outside"), B, pulley(0.15, 0.0, 0.01)),
         "other side of the belt"),
        ((A, pulley(0.15, 0.05, 0.02), B), "cannot be reached"),
        ((A, pulley(0.10, 0.02, 0.04, "outside"), B), r"pulleys\[0\] and pulleys\[1\] overlap"),
        ((A, B, pulley(0.15, -0.02, 0.03), pulley(0.16, 0.3, 0.03)), "cannot be reached"),
        ((A, pulley(0.6, 0.0, 0.05, "outside"), B),
         r"from pulleys\[0\] to pulleys\[1\] would pass through pulleys\[2\]"),
        # all inside: the span on the far side of a large pulley runs through it
        ((pulley(0.0, 0.0, 0.07), pulley(0.07, 0.07, 0.01), pulley(-0.03, -0.11, 0.015)),
         r"from pulleys\[1\] to pulleys\[2\] would pass through pulleys\[0\]"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            bd.route(pulleys)
    alone = bd.route([A])
    assert alone.length == pytest.approx(2.0 * math.pi * 0.08, rel=1e-14)
    assert alone.spans.tolist() == [0.0]


def test_what_is_no_pulleys() -> None:
    with pytest.raises(ValueError, match=r"pulley\.side must be one of inside, outside, got 'out'"):
        pulley(0.0, 0.0, 0.1, "out")
    with pytest.raises(TypeError, match=r"pulley\.side must be one of inside, outside, got 1"):
        pulley(0.0, 0.0, 0.1, 1)  # type: ignore[arg-type]
    for use in (bd.route, bd.plot.layout):
        with pytest.raises(TypeError, match=r"^pulleys must be a sequence of Pulley, got int"):
            use(3)
        with pytest.raises(TypeError, match=r"^pulleys\[1\] must be a Pulley, got float"):
            use([A, 1.0])
        with pytest.raises(ValueError, match=r"^pulleys must hold at least one Pulley"):
            use([])


@pytest.fixture(scope="module", params=[("crossed", "joint"), ("outside idler", "string")])
def steady(request: pytest.FixtureRequest) -> bd.Result:
    name, mesh = request.param
    scene = drives.scene(name)
    params = drives.on_mesh(scene.params, mesh)
    return bd.simulate(params, scene.torque_fn, scene.t_end, method="rodas4", rtol=1e-3)


def late(result: bd.Result, values: np.ndarray) -> np.ndarray:
    return np.asarray(values[result.t > 0.75 * result.t[-1]].mean(axis=0))


def test_pulleys_turn_with_the_belt_less_creep(steady: bd.Result) -> None:
    """What is lost in speed is the belt's change of stretch, and with Dahl's law the slip that
    friction needs, of the same size; never gained.

    The torques decide the tensions: friction on each pulley, by the spans before and after it,
    balances torque and drag. The belt runs as it is numbered, so what resists makes the span behind
    tighter.
    """
    params, senses = steady.params, steady.params.route.senses
    omega, tension = late(steady, steady.pulleys.omega), late(steady, steady.span_tension)
    slip = late(steady, steady.slip)[1:]
    stretch = np.ptp(tension) / params.belt.axial_stiffness
    assert np.all(slip > 0.0)
    assert 0.7 * stretch < slip.max() < 2.0 * stretch
    torque = late(steady, steady.pulleys.torque)
    drag = [0.0 if one.drag is None else one.drag.viscous for one in params.pulleys]
    assert np.all(omega * senses > 0.0)
    pull = senses * (tension - np.roll(tension, 1)) * [one.radius for one in params.pulleys]
    assert pull == pytest.approx(drag * omega - torque, abs=0.02 * np.max(np.abs(torque)))
    assert np.abs(steady.energy.residual).max() < 5e-3 * steady.energy.passed[-1]


@pytest.mark.parametrize("name", drives.LAYOUTS)
def test_settled_with_the_tension_of_the_line(name: str) -> None:
    """Without friction the tension is the same all round, that of the strain round the route."""
    params = drives.scene(name).params
    mean = bd.settle(params).tension(params).mean
    assert mean == pytest.approx(params.info["strain_tension"], rel=0.01)
    assert params.info["path_length"] == params.route.length
    assert sides_of(params)[0] == 1
    text = params.to_toml()
    assert text.count('side = "outside"') == 1 and "inside" not in text
    assert bd.Params.from_toml(text) == params


def test_layout_is_drawn_and_shown(tmp_path: Path) -> None:
    params = drives.scene("outside idler").params
    ax = bd.plot.layout(params)
    assert len(ax.patches) == 3
    assert "belt line of" in ax.get_title()
    crossed = bd.plot.layout(drives.scene("crossed").params.pulleys)
    assert "crossed" in crossed.get_title()
    scene, picture = tmp_path / "drive.toml", tmp_path / "layout.png"
    drives.scene("crossed").to_toml(scene)
    done = CliRunner().invoke(main, ["show", str(scene), "--plot", str(picture)])
    assert done.exit_code == 0, done.output
    assert "crossed" in done.stdout and "wrap" in done.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    wrong = CliRunner().invoke(main, ["show", str(tmp_path / "none.toml")])
    assert wrong.exit_code == 2
