"""Turning, shifting, mirroring the scene and renumbering the ring change nothing but rounding.

Each test starts from one state and its image. Rounding is amplified by the motion, linearly and
mildly over these short runs (a shift of 1e-8 m changes forces by 7e-6 over 0.5 s), so 1e-10 of the
quantity's scale leaves two to three decades above the last bits.
"""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from bridge import fields
from drives import LAYOUTS, on_mesh
from drives import scene as scene_of

import beltdyn as bd

T_END = 0.01
BOUND = 1e-10


@pytest.fixture(scope="module", params=["kubas-case-1", "three-pulleys", *LAYOUTS])
def start(request: pytest.FixtureRequest, mesh: str) -> tuple[bd.scenes.Scene, bd.State, bd.Result]:
    """A running state with slip and links arriving, and what follows from it."""
    scene = scene_of(request.param)
    scene = scene._replace(params=on_mesh(scene.params, mesh))
    state = attrs.evolve(bd.simulate(*scene[:2], 0.06, t_eval=[0.06]).final_state, t=0.06)
    return scene, state, run(scene.params, scene.torque_fn, state)


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


def moved(
    params: bd.Params, state: bd.State, angle: float, shift: tuple[float, float]
) -> tuple[bd.Params, bd.State]:
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    centers = [turn @ p.center + shift for p in params.pulleys]
    new = attrs.evolve(
        params,
        pulleys=[attrs.evolve(p, center=tuple(xy))
                 for p, xy in zip(params.pulleys, centers, strict=True)],
        gravity=tuple(turn @ params.gravity),
    )  # fmt: skip
    x, y = turn @ np.array([state.x, state.y]) + np.array(shift)[:, None]
    vx, vy = turn @ np.array([state.vx, state.vy])
    return new, attrs.evolve(state, x=x, y=y, vx=vx, vy=vy, phi=state.phi + angle)


@pytest.mark.parametrize("angle", [0.7, np.pi / 2, -2.5])
def test_turned(start: tuple[bd.scenes.Scene, bd.State, bd.Result], angle: float) -> None:
    scene, state, expected = start
    params, image = moved(scene.params, state, angle, (0.0, 0.0))
    assert_same(expected, run(params, scene.torque_fn, image))


# 1.5 m away the state itself is rounded to 2.2e-16 m, 2e-12 of a stretch; farther off see below
@pytest.mark.parametrize("shift", [(0.5, -0.25), (1.5, -0.75)])
def test_shifted(
    start: tuple[bd.scenes.Scene, bd.State, bd.Result], shift: tuple[float, float]
) -> None:
    scene, state, expected = start
    params, image = moved(scene.params, state, 0.0, shift)
    assert_same(expected, run(params, scene.torque_fn, image))


def test_far_away_keeps_its_digits() -> None:
    """Settled a kilometre off, the belt is the one settled here: the core works near its origin."""
    params = bd.scenes.kubas_case_1().params
    far = attrs.evolve(
        params,
        pulleys=[attrs.evolve(p, center=(p.center[0] + 1024.0, p.center[1] - 2048.0))
                 for p in params.pulleys],
    )  # fmt: skip
    torque = bd.scenes.kubas_case_1().torque_fn
    here, there = (bd.simulate(p, torque, 0.01, t_eval=[0.0, 0.01]) for p in (params, far))
    # 1024.29 is rounded to 2e-13 m: 1e-9 of a stretch
    assert np.max(np.abs(here.joints.force - there.joints.force)) <= 1e-8 * 600


def test_mirrored(start: tuple[bd.scenes.Scene, bd.State, bd.Result]) -> None:
    """Y -> -y: the belt runs the other way, links numbered along it as before."""
    scene, state, expected = start
    params = attrs.evolve(
        scene.params,
        pulleys=[attrs.evolve(p, center=(p.center[0], -p.center[1])) for p in scene.params.pulleys],
        gravity=(scene.params.gravity[0], -scene.params.gravity[1]),
    )
    if len(params.pulleys) == 2 and params.info["winding"] != 0:
        # two pulleys run clockwise by definition: the mirror image visits them the other way
        params = attrs.evolve(params, pulleys=params.pulleys[::-1])
        order = slice(None, None, -1)
    else:
        order = slice(None)
    # a mirror image seen along its own run: reversed links, each turned end for end
    turn = np.pi * (np.sign(scene.params.info["winding"]) or 1)
    back = slice(None, None, -1)
    same_way = len(params.pulleys) == 2
    # joint i (left of link i) is, run backwards, the joint left of link n - i
    n = scene.params.belt.n_bodies
    joint = (n - np.arange(n)) % n
    at_joints = scene.params.belt.mesh == "joint" and scene.params.belt.model == "links"
    contact = joint if at_joints else back
    phi = -state.phi
    image = attrs.evolve(
        state,
        x=state.x[back] if same_way else state.x,
        y=-state.y[back] if same_way else -state.y,
        vx=state.vx[back] if same_way else state.vx,
        vy=-state.vy[back] if same_way else -state.vy,
        phi=(phi[back] - turn) if same_way else phi,
        vphi=-state.vphi[back] if same_way else -state.vphi,
        mu=-state.mu[contact] if same_way else -state.mu,
        slip=-state.slip[contact] if same_way else -state.slip,
        theta=-state.theta[order],
        omega=-state.omega[order],
    )
    pieces = scene.torque_fn.terms()
    torque = bd.PiecewiseLinear(pieces[0][1], -np.asarray(pieces[0][2])[:, order]) + bd.Viscous(
        np.asarray(pieces[1][1])[order]
    )
    result = run(params, torque, image)
    if not same_way:
        assert_same(expected, result, mirrored=True)
        return
    scale = np.max(np.abs(expected.joints.force))
    assert np.max(np.abs(expected.joints.force - result.joints.force[:, joint])) <= BOUND * scale
    assert np.max(np.abs(expected.contact.mu + result.contact.mu[:, contact])) <= BOUND
    assert np.max(np.abs(expected.pulleys.theta + result.pulleys.theta[:, order])) <= BOUND


@pytest.mark.parametrize("first", [1, 17])
def test_renumbered(start: tuple[bd.scenes.Scene, bd.State, bd.Result], first: int) -> None:
    """Numbering from another link; links that come to stand behind take the winding along."""
    scene, state, expected = start
    winding = scene.params.info["winding"]
    phi = np.roll(state.phi, -first)
    phi[-first:] += 2 * np.pi * winding
    image = attrs.evolve(
        state,
        phi=phi,
        **{name: np.roll(getattr(state, name), -first)
           for name in ("x", "y", "vx", "vy", "vphi", "mu", "slip")},
    )  # fmt: skip
    assert_same(expected, run(scene.params, scene.torque_fn, image), roll=-first)


@pytest.mark.parametrize("turns", [10, -10, 100_000])
def test_turns_of_the_belt_cost_no_digits(
    start: tuple[bd.scenes.Scene, bd.State, bd.Result], turns: int
) -> None:
    """The same belt after it has been round: phi carries whole turns, stretch loses nothing.

    The state given by the user is itself rounded: 2 pi turns to one part in 2^53 over half a link.
    """
    scene, state, expected = start
    offset = 2 * np.pi * turns
    image = attrs.evolve(state, phi=state.phi + offset)
    result = run(scene.params, scene.torque_fn, image)
    stretch = np.max(np.abs(expected.joints.deformation))
    half = 0.5 * scene.params.info["link_length"]
    given = 4 * half * np.spacing(abs(offset)) / stretch
    error = np.max(np.abs(expected.joints.deformation - result.joints.deformation)) / stretch
    assert error <= max(BOUND, 10 * given)
    told = 0.0 if scene.params.belt.model == "string" else offset  # where its bars are, they point
    assert np.max(np.abs(result.belt.phi - expected.belt.phi - told)) <= 1e-9 + 4 * np.spacing(
        abs(offset)
    )


def test_running_for_ten_turns_loses_no_digits() -> None:
    """Run until the belt has been round ten times: the ring closes as exactly as at the start, and
    the state, its turns taken off, goes on exactly like the one that kept them.
    """
    scene = bd.scenes.kubas_case_1()
    params = attrs.evolve(scene.params, belt=attrs.evolve(scene.params.belt, n_bodies=24,
                                                         axial_damping=3.0))  # fmt: skip
    torque = bd.PiecewiseLinear([0.0, 0.05], [[0, 0], [-60, 0]]) + bd.Viscous([0.0, 0.3])
    result = bd.simulate(params, torque, 1.6, t_eval=np.linspace(0, 1.6, 401))
    travelled = -result.belt.phi[-1, 0] / (2 * np.pi)
    assert travelled > 10.0
    # closing: the joints' vectors, summed round the ring from the reported positions, against
    # the deformations the core reports from its own coordinates
    x, y, phi = result.belt.x[-1], result.belt.y[-1], result.belt.phi[-1]
    half = 0.5 * params.info["link_length"]
    dx = x - np.roll(x, 1) - half * (np.cos(phi) + np.roll(np.cos(phi), 1))
    dy = y - np.roll(y, 1) - half * (np.sin(phi) + np.roll(np.sin(phi), 1))
    ex, ey = np.cos(phi) + np.roll(np.cos(phi), 1), np.sin(phi) + np.roll(np.sin(phi), 1)
    along = (dx * ex + dy * ey) / np.hypot(ex, ey)
    stretch = np.max(np.abs(along))
    assert np.max(np.abs(along - result.joints.deformation[-1])) <= 1e-10 * stretch
    end = result.final_state
    bare = attrs.evolve(end, phi=end.phi + 2 * np.pi * round(travelled))
    one, other = (bd.simulate(params, torque, 1.61, initial=s, t_eval=[1.61]) for s in (end, bare))
    gap = np.max(np.abs(one.joints.deformation - other.joints.deformation))
    assert gap <= BOUND * stretch


def test_a_lost_digit_would_show() -> None:
    """The comparison itself: a state moved by 1e-9 m is not the same."""
    scene = bd.scenes.kubas_case_1()
    state = bd.settle(scene.params)
    nudged = attrs.evolve(state, x=state.x + 1e-9 * np.eye(len(state.x))[3])
    one, other = (run(scene.params, scene.torque_fn, s) for s in (state, nudged))
    with pytest.raises(AssertionError):
        assert_same(one, other)
    assert fields(state)["t"] == 0.0
