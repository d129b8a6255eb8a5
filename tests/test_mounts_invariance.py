"""Turning, shifting, mirroring a drive with mounts and renumbering its belt change nothing but
rounding; bounds and their argument are those of test_invariance.py.
"""

from __future__ import annotations

from typing import Any

import attrs
import mounted_drives as drives
import numpy as np
import pytest
from test_invariance import BOUND, T_END, assert_same

import beltdyn as bd

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
FORCES = ("spring_force", "damper_force", "friction_force", "stop_force", "belt_force")
Start = tuple[bd.Params, bd.State, bd.Result]


@pytest.fixture(scope="module", params=["arm and slider", "slider, gravity", "arm and path",
                                        "arm with stops"])  # fmt: skip
def start(request: pytest.FixtureRequest) -> Start:
    """A running state, and what follows from it; the arm with stops is thrown against one."""
    params = drives.DRIVES[request.param]()
    t = 0.02
    state = bd.simulate(params, drives.torque(params), t, t_eval=[t]).final_state
    if "stops" in request.param:
        state = attrs.evolve(state, travel_speed=[8.0])
    return params, state, run(params, state)


def run(params: bd.Params, state: bd.State, sign: float = 1.0, order: Any = None) -> bd.Result:
    """Under the torques of mounted_drives.py, their driving part times the sign, in this order."""
    pieces = drives.torque(params).terms()
    rows, loads = sign * np.asarray(pieces[0][2]), np.asarray(pieces[1][1])
    if order is not None:
        rows, loads = rows[:, order], loads[order]
    torque = bd.PiecewiseLinear(pieces[0][1], rows) + bd.Viscous(loads)
    end = state.t + T_END
    times = np.linspace(state.t, end, 6)
    return bd.simulate(params, torque, end, initial=state, t_eval=times)


def image_of(mount: Any, matrix: np.ndarray, shift: np.ndarray) -> Any:
    """The mount turned or mirrored by the matrix, and shifted; angles change sign in a mirror."""
    sign = float(np.sign(np.linalg.det(matrix)))
    if mount is None:
        return None
    if isinstance(mount, bd.Path):
        return bd.Path(t=mount.t, displacement=np.asarray(mount.displacement) @ matrix.T)
    if isinstance(mount, bd.Slider):
        return attrs.evolve(mount, direction=tuple(matrix @ np.asarray(mount.direction)))
    changes: dict[str, Any] = {"pivot": tuple(matrix @ np.asarray(mount.pivot) + shift)}
    if sign < 0.0:
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


def assert_mounts_same(params: bd.Params, one: bd.Result, other: bd.Result, sign: float) -> None:
    arms = np.array([isinstance(params.pulleys[j].mount, bd.Arm) for j in params.mounted])
    signs = np.where(arms, sign, 1.0)
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


@pytest.mark.parametrize(
    ("angle", "shift"), [(0.7, (0.0, 0.0)), (-2.5, (0.3, -0.1)), (0.0, (0.5, -0.25))]
)
def test_turned_and_shifted(start: Start, angle: float, shift: tuple[float, float]) -> None:
    params, state, expected = start
    c, s = np.cos(angle), np.sin(angle)
    matrix, by = np.array([[c, -s], [s, c]]), np.asarray(shift)
    x, y = matrix @ np.array([state.x, state.y]) + by[:, None]
    vx, vy = matrix @ np.array([state.vx, state.vy])
    image = attrs.evolve(state, x=x, y=y, vx=vx, vy=vy, phi=state.phi + angle)
    new = drive_image(params, matrix, by)
    result = run(new, image)
    assert_same(expected, result)
    assert_mounts_same(params, expected, result, 1.0)


def test_mirrored(start: Start) -> None:
    """Y -> -y: three pulleys and more run the other way; two, clockwise by definition, are visited
    the other way round, by a belt numbered backwards.
    """
    params, state, expected = start
    matrix, none = np.diag([1.0, -1.0]), np.zeros(2)
    new = drive_image(params, matrix, none)
    arms = np.array([isinstance(params.pulleys[j].mount, bd.Arm) for j in params.mounted])
    signs = np.where(arms, -1.0, 1.0)
    mounts = {
        "travel": signs * state.travel,
        "travel_speed": signs * state.travel_speed,
        "mount_friction": signs * state.mount_friction,
    }
    if len(params.pulleys) > 2:
        image = attrs.evolve(
            state, y=-state.y, vy=-state.vy, phi=-state.phi, vphi=-state.vphi, mu=-state.mu,
            slip=-state.slip, theta=-state.theta, omega=-state.omega, **mounts,
        )  # fmt: skip
        result = run(new, image, -1.0)
        assert_same(expected, result, mirrored=True)
    else:
        new = attrs.evolve(new, pulleys=new.pulleys[::-1])
        order = slice(None, None, -1)
        n = params.belt.n_bodies
        joint = (n - np.arange(n)) % n
        turn = np.pi * np.sign(params.info["winding"])
        image = attrs.evolve(
            state,
            **{name: getattr(state, name)[::-1] for name in ("x", "vx")},
            **{name: -getattr(state, name)[::-1] for name in ("y", "vy", "vphi")},
            phi=-state.phi[::-1] - turn,
            mu=-state.mu[joint], slip=-state.slip[joint],
            theta=-state.theta[order], omega=-state.omega[order], **mounts,
        )  # fmt: skip
        result = run(new, image, -1.0, order)
        scale = np.max(np.abs(expected.joints.force))
        apart = expected.joints.force - result.joints.force[:, joint]
        assert np.max(np.abs(apart)) <= BOUND * scale
        assert np.max(np.abs(expected.pulleys.theta + result.pulleys.theta[:, order])) <= BOUND
    assert_mounts_same(params, expected, result, -1.0)


@pytest.mark.parametrize("first", [1, 17])
def test_renumbered(start: Start, first: int) -> None:
    params, state, expected = start
    phi = np.roll(state.phi, -first)
    phi[-first:] += 2 * np.pi * params.info["winding"]
    names = ("x", "y", "vx", "vy", "vphi", "mu", "slip")
    rolled = {name: np.roll(getattr(state, name), -first) for name in names}
    result = run(params, attrs.evolve(state, phi=phi, **rolled))
    assert_same(expected, result, roll=-first)
    assert_mounts_same(params, expected, result, 1.0)


def test_a_slider_may_be_directed_by_any_length(start: Start) -> None:
    params, state, expected = start
    pulleys = list(params.pulleys)
    for j in params.mounted:
        mount = pulleys[j].mount
        if isinstance(mount, bd.Slider):
            longer = tuple(3.0 * np.asarray(mount.direction))
            pulleys[j] = attrs.evolve(pulleys[j], mount=attrs.evolve(mount, direction=longer))
    result = run(attrs.evolve(params, pulleys=pulleys), state)
    assert_same(expected, result)
    assert_mounts_same(params, expected, result, 1.0)


def test_a_lost_digit_would_show(start: Start) -> None:
    """The comparison itself: a mount, or the belt, moved by 1e-8 m is not the same."""
    params, state, expected = start
    on_path = any(isinstance(params.pulleys[j].mount, bd.Path) for j in params.mounted)
    moved = {"x": state.x + 1e-8} if on_path else {"travel": state.travel + 1e-8}
    nudged = attrs.evolve(state, **moved)  # the travel of a path is the time
    with pytest.raises(AssertionError):
        assert_mounts_same(params, expected, run(params, nudged), 1.0)
