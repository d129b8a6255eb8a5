"""Where runs of hard scenes begin, by what ``start`` says in ``hard.toml``."""

from __future__ import annotations

import attrs
import numpy as np

from ...base.checks import Array
from ...outputs.state import State
from ...run.settling import settle
from .hard_scene import HardScene


def thrown(scene: HardScene) -> State:
    """Throw both spans and the pulleys' wraps outwards, at 10 m/s."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vy=rest.vy + 10.0 * np.sign(rest.y))


def moving(scene: HardScene, vx: float = 0.0, vy: float = 0.0) -> State:
    """Start with the whole belt at rest but for this velocity."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vx=rest.vx + vx, vy=rest.vy + vy)


def running(scene: HardScene) -> State:
    """Steadily at the speed at which the motion of pulley 0 begins."""
    return settle(scene.params, speed={0: float(scene.motion[0].values[0, 0])})  # type: ignore[index, union-attr]


def _first_mode(scene: HardScene, state: State) -> Array:
    """Return the first mode of the upper span at each link, 1 in the middle."""
    span = scene.params.pulleys[1].center[0]
    return np.sin(np.pi * np.clip(state.x / span, 0.0, 1.0)) * (state.y > 0.0)


def plucked(scene: HardScene) -> State:
    """Let the upper span of the running belt move as its first mode, by 2 m/s in the middle."""
    state = running(scene)
    return attrs.evolve(state, vy=state.vy + 2.0 * _first_mode(scene, state))


def whipped(scene: HardScene) -> State:
    """Tear the upper span upwards at 60 m/s in the middle, faster than waves across it."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vy=rest.vy + 60.0 * _first_mode(scene, rest))


def pulley_turning(scene: HardScene) -> State:
    """At rest, but pulley 0 already turns, by 200 rad/s."""
    return attrs.evolve(settle(scene.params), omega=np.array([-200.0, 0.0]))


def pushed_in(scene: HardScene) -> State:
    """Put every third link off its place by 0.3 mm along y, which joints resist by 1.2 kN."""
    rest = settle(scene.params)
    off = 3e-4 * (np.arange(rest.n_bodies) % 3 == 0)
    return attrs.evolve(rest, y=rest.y + off * np.sign(rest.y))
