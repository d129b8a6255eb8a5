"""Turning, shifting, mirroring the scene and renumbering the ring change nothing but rounding, with
mounts or without.

Each test starts from one state and its image. Rounding is amplified by the motion, linearly and
mildly over these short runs (a shift of 1e-8 m changes forces by 7e-6 over 0.5 s), so 1e-10 of the
quantity's scale leaves two to three decades above the last bits.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import attrs
import mounted_drives
import numpy as np
import pytest
from drives import LAYOUTS, on_mesh
from drives import scene as scene_of

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
T_END = 0.01
BOUND = 1e-10
FORCES = ("spring_force", "damper_force", "friction_force", "stop_force", "belt_force")
LINKS = ("x", "y", "phi", "vx", "vy", "vphi", "mu", "slip")


class Start(NamedTuple):
    """A running state with slip and links arriving, and what follows from it."""

    params: bd.Params
    torque: Any
    state: bd.State
    expected: bd.Result


@cache
def start_of(name: str) -> Start:
    """Of a scene on a mesh, or of a drive with mounts; arms with stops are thrown against one."""
    scene_name, _, mesh = name.partition(" on ")
    if mesh:
        scene = scene_of(scene_name)
        params, torque, t = on_mesh(scene.params, mesh), scene.torque_fn, 0.06
    else:
        params, t = mounted_drives.DRIVES[name](), 0.02
        torque = mounted_drives.torque(params)
    state = bd.simulate(params, torque, t, t_eval=[t]).final_state
    if "stops" in name:
        state = attrs.evolve(state, travel_speed=[8.0])
    return Start(params, torque, state, run(params, torque, state))


SCENES = [f"{name} on {mesh}" for name in ("kubas-case-1", "three-pulleys", *LAYOUTS)
          for mesh in ("paper", "joint", "string")]  # fmt: skip
MOUNTED = ["arm and slider", "slider, gravity", "arm and path", "arm with stops"]


@pytest.fixture(params=SCENES + MOUNTED)
def start(request: pytest.FixtureRequest) -> Start:
    return start_of(request.param)


def run(params: bd.Params, torque: object, state: bd.State) -> bd.Result:
    end = state.t + T_END
    return bd.simulate(params, torque, end, initial=state, t_eval=np.linspace(state.t, end, 6))


def assert_same(one: bd.Result, other: bd.Result, *, mirrored: bool = False, roll: int = 0) -> None:
    sign = -1.0 if mirrored else 1.0

    def at(values: np.ndarray) -> np.ndarray:
        return np.roll(values, roll, axis=1)

    scale = np.max(np.abs(one.joints.force))
    assert np.max(np.abs(at(one.joints.force) - other.joints.force)) <= BOUND * scale
    stretch = np.max(np.abs(one.joints.deformation))
    assert np.max(np.abs(at(one.joints.deformation) - other.joints.deformation)) <= BOUND * stretch
    assert np.max(np.abs(at(one.contact.normal) - other.contact.normal)) <= BOUND * scale
    assert np.max(np.abs(at(one.contact.mu) - sign * other.contact.mu)) <= BOUND
    assert np.max(np.abs(one.pulleys.theta - sign * other.pulleys.theta)) <= BOUND
    omega = np.max(np.abs(one.pulleys.omega))
    assert np.max(np.abs(one.pulleys.omega - sign * other.pulleys.omega)) <= BOUND * omega
    assert np.array_equal(at(one.contact.pulley), other.contact.pulley)


def signs_of_mounts(params: bd.Params, mirrored: bool) -> np.ndarray:
    """Angles of arms change their sign in a mirror."""
    turns = [mirrored and isinstance(params.pulleys[j].mount, bd.Arm) for j in params.mounted]
    return np.where(turns, -1.0, 1.0)


def assert_mounts_same(
    params: bd.Params, one: bd.Result, other: bd.Result, mirrored: bool = False
) -> None:
    if not params.mounted:
        return
    signs = signs_of_mounts(params, mirrored)
    for name in ("travel", "travel_speed", *FORCES):
        a, b = getattr(one.mounts, name), getattr(other.mounts, name)
        # of all forces on it, of which the belt's is a sum over links
        size = np.abs(a).max(axis=0)
        if name in FORCES:
            sizes = [np.abs(getattr(one.mounts, force)).max(axis=0) for force in FORCES]
            size = np.max(sizes, axis=0)
        assert np.all(np.abs(a - signs * b) <= BOUND * np.maximum(size, 1e-3)), name
    for name in ("mount", "mount_loss", "path_work"):
        a, b = getattr(one.energy, name), getattr(other.energy, name)
        assert (a is None) == (b is None)
        if a is not None:
            a, b = a - a[0], b - b[0]
            assert np.max(np.abs(a - b)) <= BOUND * max(np.max(np.abs(one.energy.kinetic)), 1.0)


def image_of(mount: Any, matrix: np.ndarray, shift: np.ndarray) -> Any:
    """The mount turned or mirrored by the matrix, and shifted; angles change sign in a mirror."""
    if mount is None:
        return None
    if isinstance(mount, bd.Path):
        return bd.Path(t=mount.t, displacement=np.asarray(mount.displacement) @ matrix.T)
    if isinstance(mount, bd.Slider):
        return attrs.evolve(mount, direction=tuple(matrix @ np.asarray(mount.direction)))
    changes: dict[str, Any] = {"pivot": tuple(matrix @ np.asarray(mount.pivot) + shift)}
    if np.linalg.det(matrix) < 0.0:
        changes["preload"] = -mount.preload
        if mount.stops is not None:
            changes["stops"] = (-mount.stops[1], -mount.stops[0])
    return attrs.evolve(mount, **changes)


def drive_image(params: bd.Params, matrix: np.ndarray, shift: np.ndarray) -> bd.Params:
    pulleys = [
        attrs.evolve(
            one,
            center=tuple(matrix @ np.asarray(one.center) + shift),
            mount=image_of(one.mount, matrix, shift),
        )
        for one in params.pulleys
    ]
    return attrs.evolve(params, pulleys=pulleys, gravity=tuple(matrix @ np.asarray(params.gravity)))


def moved(
    params: bd.Params, state: bd.State, angle: float, shift: tuple[float, float]
) -> tuple[bd.Params, bd.State]:
    c, s = np.cos(angle), np.sin(angle)
    turn, by = np.array([[c, -s], [s, c]]), np.array(shift)
    x, y = turn @ np.array([state.x, state.y]) + by[:, None]
    vx, vy = turn @ np.array([state.vx, state.vy])
    image = attrs.evolve(state, x=x, y=y, vx=vx, vy=vy, phi=state.phi + angle)
    return drive_image(params, turn, by), image


def renumbered(params: bd.Params, state: bd.State, first: int) -> bd.State:
    """From another link; links that come to stand behind take the winding along."""
    rolled = {name: np.roll(getattr(state, name), -first, axis=-1) for name in LINKS}
    rolled["phi"][-first:] += 2 * np.pi * params.info["winding"]
    return attrs.evolve(state, **rolled)


# 1.5 m away the state itself is rounded to 2.2e-16 m, 2e-12 of a stretch; farther off see below
@pytest.mark.one_in(5)
@pytest.mark.parametrize(
    ("angle", "shift"), [(np.pi / 2, (0.0, 0.0)), (-2.5, (0.3, -0.1)), (0.0, (1.5, -0.75))]
)
def test_turned_and_shifted(start: Start, angle: float, shift: tuple[float, float]) -> None:
    params, image = moved(start.params, start.state, angle, shift)
    result = run(params, start.torque, image)
    assert_same(start.expected, result)
    assert_mounts_same(start.params, start.expected, result)


def test_far_away_keeps_its_digits() -> None:
    """Settled a kilometre off, the belt is the one settled here: the core works near its origin."""
    params, torque, _ = bd.scenes.kubas_case_1()[:3]
    far = drive_image(params, np.eye(2), np.array([1024.0, -2048.0]))
    here, there = (bd.simulate(p, torque, 0.01, t_eval=[0.0, 0.01]) for p in (params, far))
    # 1024.29 is rounded to 2e-13 m: 1e-9 of a stretch
    assert np.max(np.abs(here.joints.force - there.joints.force)) <= 1e-8 * 600


def test_mirrored(start: Start) -> None:
    """Y -> -y: three pulleys and more run the other way, links numbered along the belt as before.
    Two run clockwise by definition and are visited the other way round; so is a crossed belt's
    ring, reversed links, each turned end for end.
    """
    params, torque, state, expected = start
    winding, backwards = params.info["winding"], len(params.pulleys) == 2
    order = slice(None, None, -1) if backwards and winding != 0 else slice(None)
    image = drive_image(params, np.diag([1.0, -1.0]), np.zeros(2))
    image = attrs.evolve(image, pulleys=image.pulleys[order])
    pieces = torque.terms()
    rows, loads = np.asarray(pieces[0][2]), np.asarray(pieces[1][1])
    reversed_torque = bd.PiecewiseLinear(pieces[0][1], -rows[:, order]) + bd.Viscous(loads[order])
    # joint i (left of link i) is, run backwards, the joint left of link n - i
    n = params.belt.n_bodies
    back = slice(None, None, -1 if backwards else None)
    joint = (n - np.arange(n)) % n if backwards else np.arange(n)
    at_joints = params.belt.mesh == "joint" and params.belt_model == "links"
    contact = joint if at_joints else back
    turn = np.pi * (np.sign(winding) or 1) if backwards else 0.0
    # of links turned end for end, angles are their own again
    signs = {"x": 1.0, "vx": 1.0, "y": -1.0, "vy": -1.0, "vphi": -1.0, "phi": -1.0}
    changes = {name: sign * getattr(state, name)[back] for name, sign in signs.items()}
    changes["phi"] = changes["phi"] - turn
    changes |= {"mu": -state.mu[..., contact], "slip": -state.slip[..., contact]}
    changes |= {"theta": -state.theta[order], "omega": -state.omega[order]}
    if params.mounted:
        of_mounts = signs_of_mounts(params, mirrored=True)
        for name in ("travel", "travel_speed", "mount_friction"):
            changes[name] = of_mounts * getattr(state, name)
    result = run(image, reversed_torque, attrs.evolve(state, **changes))
    if backwards:
        scale = np.max(np.abs(expected.joints.force))
        assert np.max(np.abs(expected.joints.force - result.joints.force[:, joint])) <= (
            BOUND * scale
        )
        assert np.max(np.abs(expected.contact.mu + result.contact.mu[:, contact])) <= BOUND
        assert np.max(np.abs(expected.pulleys.theta + result.pulleys.theta[:, order])) <= BOUND
    else:
        assert_same(expected, result, mirrored=True)
    assert_mounts_same(params, expected, result, mirrored=True)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("first", [17, 1])
def test_renumbered(start: Start, first: int) -> None:
    image = renumbered(start.params, start.state, first)
    result = run(start.params, start.torque, image)
    assert_same(start.expected, result, roll=-first)
    assert_mounts_same(start.params, start.expected, result)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("turns", [-10, 100_000])
@pytest.mark.parametrize("name", SCENES)
def test_turns_of_the_belt_cost_no_digits(name: str, turns: int) -> None:
    """The same belt after it has been round: phi carries whole turns, stretch loses nothing.

    The state given by the user is itself rounded: 2 pi turns to one part in 2^53 over half a link.
    """
    params, torque, state, expected = start_of(name)
    offset = 2 * np.pi * turns
    result = run(params, torque, attrs.evolve(state, phi=state.phi + offset))
    stretch = np.max(np.abs(expected.joints.deformation))
    half = 0.5 * params.info["link_length"]
    given = 4 * half * np.spacing(abs(offset)) / stretch
    error = np.max(np.abs(expected.joints.deformation - result.joints.deformation)) / stretch
    assert error <= max(BOUND, 10 * given)
    told = 0.0 if params.belt.model == "string" else offset  # where its bars are, they point
    assert np.max(np.abs(result.belt.phi - expected.belt.phi - told)) <= 1e-9 + 4 * np.spacing(
        abs(offset)
    )


def test_a_slider_may_be_directed_by_any_length() -> None:
    params, torque, state, expected = start_of("slider, gravity")
    fixed, slid = params.pulleys
    longer = attrs.evolve(slid.mount, direction=tuple(3.0 * np.asarray(slid.mount.direction)))
    changed = attrs.evolve(params, pulleys=[fixed, attrs.evolve(slid, mount=longer)])
    result = run(changed, torque, state)
    assert_same(expected, result)
    assert_mounts_same(params, expected, result)


def test_a_lost_digit_would_show() -> None:
    """The comparisons themselves: a state moved by 1e-9 m, or a mount, or the belt of one on a
    path, moved by 1e-8 m, is not the same.
    """
    params, torque, state, expected = start_of("kubas-case-1 on joint")
    nudged = attrs.evolve(state, x=state.x + 1e-9 * np.eye(len(state.x))[3])
    with pytest.raises(AssertionError):
        assert_same(expected, run(params, torque, nudged))
    for name in MOUNTED:
        params, torque, state, expected = start_of(name)
        on_path = any(isinstance(one.mount, bd.Path) for one in params.pulleys)
        # the travel of a path is the time
        moved_by = {"x": state.x + 1e-8} if on_path else {"travel": state.travel + 1e-8}
        with pytest.raises(AssertionError):
            assert_mounts_same(
                params, expected, run(params, torque, attrs.evolve(state, **moved_by))
            )
