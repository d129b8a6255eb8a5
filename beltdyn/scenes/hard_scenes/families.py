"""How the drives of hard scenes are made, and where their runs begin, family by family."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import attrs
import numpy as np

from ...base.checks import Array
from ...drive.friction import (
    Coulomb,
    CreepRate,
    Dahl,
    ElasticPlastic,
    Friction,
    Frictionless,
    LuGre,
    MaxwellSlip,
    Threlfall,
)
from ...drive.mounts import Arm, Path, Slider
from ...drive.params import Params
from ...drive.parts import Belt, Contact, Drag, Pulley
from ...drive.scene import Scene
from ...drive.tensioning import Tensioning
from ...loads.loads import Load, Ramp, Step
from ...loads.torques import PiecewiseLinear
from ...outputs.state import State
from ...run.settling import settle
from ..machines import crossed_belt
from .drives import LOCKED, NOTHING, beside, pair, pulled, pulling, ramp, scaled, tensioned
from .hard_scene import HardScene


def _run_up(changes: Mapping[str, Any], t_end: float = 0.03) -> Scene:
    return Scene(pair(changes), ramp(), t_end)


# --- friction laws where they are stiffest, steepest, weakest ---


def _slow_slip(law: Friction) -> Scene:
    """Pulley 0 turns slowly, pulley 1 is locked: the belt sticks and slips."""
    motion = {0: PiecewiseLinear([0.0, 1e-3], [0.0, -0.3]), 1: LOCKED}
    return Scene(pair({"friction": law}), NOTHING, 0.2, motion)


def _reversing() -> Scene:
    """Torques that turn over every 20 us, faster than the contact's own vibration."""
    t = [2e-5 * (k // 2) for k in range(1, 501)]
    values = [-40.0 * (-1.0) ** (k // 2) for k in range(500)]
    return Scene(pair({"friction.sigma": 1e7}), PiecewiseLinear(t, values, 0), 6e-3)


def _tensioned_with_friction() -> Scene:
    """Pulley 1 is moved outwards by 2 mm against friction, which stays in the wraps."""
    tensioning = Tensioning(friction=True, offset={1: (-2e-3, 0.0)})
    params = pair({"friction.sigma": 1e6, "tensioning": tensioning})
    return Scene(params, NOTHING, 0.02, {0: LOCKED, 1: LOCKED})


# --- belts of few links and many, without damping and with far too much, light, heavy, rigid ---


def _few(n: int) -> Scene:
    """Round one pulley, for round two so few links are refused before anything runs."""
    two = pair()
    belt = attrs.evolve(two.belt, n_bodies=n)
    params = attrs.evolve(two, pulleys=two.pulleys[:1], belt=belt)
    return Scene(params, Ramp(0, 0.0, 0.01, -6.0), 0.05)


def _rung() -> Scene:
    """Set a torque that is there at once and gone 0.1 ms later, on a belt that nothing damps."""
    params = pair({"belt.axial_damping": 0.0, "belt.n_bodies": 40})
    torque = PiecewiseLinear([1e-3, 1e-3, 1.1e-3, 1.1e-3], [0.0, -60.0, -60.0, 0.0], 0)
    return Scene(params, torque, 0.02)


# --- contact far too stiff and far too soft, bouncing, grazing, pressed by nothing ---


def _on(contact: Contact, t_end: float) -> Scene:
    return Scene(pair({"contact": contact}), NOTHING, t_end)


def _round_a_pin() -> Params:
    """Round a pulley of 5 mm between two of 50 mm, by links of 10 mm."""
    return Params(
        belt=Belt(
            length=0.905, n_bodies=90, linear_density=0.1, axial_stiffness=50e3, axial_damping=2.0
        ),
        pulleys=[
            Pulley(center=(0.0, 0.0), radius=0.05, inertia=0.01),
            Pulley(center=(0.15, 0.05), radius=0.005, inertia=1e-4),
            Pulley(center=(0.3, 0.0), radius=0.05, inertia=0.01),
        ],
        contact=Contact(linear=2.5e7, damping=1e3),
        friction=Dahl(mu_k=1.0, sigma=1e4),
    )


def _thrown(scene: HardScene) -> State:
    """Throw both spans and the pulleys' wraps outwards, at 10 m/s."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vy=rest.vy + 10.0 * np.sign(rest.y))


def _moving(scene: HardScene, vx: float = 0.0, vy: float = 0.0) -> State:
    """Start with the whole belt at rest but for this velocity."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vx=rest.vx + vx, vy=rest.vy + vy)


# --- loads that jump, strike, shake and lock ---


def _step() -> Scene:
    """Both pulleys in the same sense, so that each half of the drive is the other, turned."""
    values = [[0.0, 0.0], [-20.0, -20.0]]
    return Scene(pair(), PiecewiseLinear([1e-3, 1e-3], values), 0.02)


def _impulse() -> Scene:
    """20 mN m s within 1 us."""
    t = [1e-3, 1e-3, 1.001e-3, 1.001e-3]
    return Scene(pair({"belt.n_bodies": 240}), PiecewiseLinear(t, [0.0, -2e4, -2e4, 0.0], 0), 0.03)


def _noise() -> Scene:
    """Set a torque that jumps anywhere within 20 N m every 10 us."""
    values = np.random.default_rng(26).uniform(-20.0, 20.0, 1000)
    t = 1e-5 * np.arange(1001)
    return Scene(pair(), PiecewiseLinear(np.repeat(t, 2)[1:-1], np.repeat(values, 2), 0), 0.01)


def _reversal() -> Scene:
    """Twice what friction can transmit, one way, and at once the other way."""
    t = [5e-3, 5e-3, 0.02, 0.02]
    return Scene(pair(), PiecewiseLinear(t, [0.0, -60.0, -60.0, 60.0], 0) + ramp(0.0), 0.04)


# --- mounts that hit their stops, hold hardly, swing, stick, jump ---


def _arm(**changes: Any) -> Scene:
    """Take an arm from rest by a step of the torque."""
    given = {"pivot": (0.2, 0.11), "inertia": 1e-3, "tension": 300.0, "stiffness": 20.0}
    arm = Arm(**{**given, **changes})
    return Scene(tensioned(arm), Step(0, 2e-3, -15.0) + ramp(0.0), 0.06)


def _weight() -> Scene:
    """Let a weight of 60 kg pull pulley 1 outwards, on a carriage of 60 kg."""
    slider = Slider(direction=(1.0, 0.0), mass=60.0, weight=60.0)
    params = pair({"belt.preload": None, "pulleys[1].mount": slider, "gravity": (0.0, -9.81)})
    return Scene(params, Step(0, 2e-3, -15.0) + ramp(0.0), 0.3)


def _jump() -> Scene:
    """Let an axis jump by 2 mm within 50 us, and back."""
    near = 50e-6 * np.arange(-5, 7)  # points of a spline that holds still before and after a jump
    ahead = np.where(near <= 0.0, 0.0, -2e-3)
    path = Path(
        t=[0.0, *(5e-3 + near), *(15e-3 + near), 0.02],
        displacement=[(x, 0.0) for x in (0.0, *ahead, *(-2e-3 - ahead), 0.0)],
    )
    return _run_up({"pulleys[1].mount": path}, 0.02)


# --- layouts with pulleys of very unequal size, crossed belts, idlers that only just touch ---


def _idler(depth: float) -> Scene:
    return Scene(beside(depth), Ramp(0, 0.0, 0.01, -6.0) + Load(2, viscous=0.1), 0.03)


# --- fast, for long, near the speeds at which a belt lifts off or loses its stiffness ---

#: Links so short that those which land do not shake the belt.
_FINE = {"belt.n_bodies": 160}


def _driven(omega: list[float], t_end: float, changes: Mapping[str, object] = _FINE) -> Scene:
    """With pulley 0 at speeds from the beginning to the end [rad/s]."""
    speed = PiecewiseLinear([0.0, t_end], [-w for w in omega])
    return Scene(pair(changes), NOTHING, t_end, {0: speed})


def _running(scene: HardScene) -> State:
    """Steadily at the speed at which the motion of pulley 0 begins."""
    return settle(scene.params, speed={0: float(scene.motion[0].values[0, 0])})  # type: ignore[index, union-attr]


def _first_mode(scene: HardScene, state: State) -> Array:
    """Return the first mode of the upper span at each link, 1 in the middle."""
    span = scene.params.pulleys[1].center[0]
    return np.sin(np.pi * np.clip(state.x / span, 0.0, 1.0)) * (state.y > 0.0)


def _plucked(scene: HardScene) -> State:
    """Let the upper span of the running belt move as its first mode, by 2 m/s in the middle."""
    state = _running(scene)
    return attrs.evolve(state, vy=state.vy + 2.0 * _first_mode(scene, state))


def _whipped(scene: HardScene) -> State:
    """Tear the upper span upwards at 60 m/s in the middle, faster than waves across it."""
    rest = settle(scene.params)
    return attrs.evolve(rest, vy=rest.vy + 60.0 * _first_mode(scene, rest))


# --- starts, steps, durations and units that are out of proportion ---


def _pulleys_turning(scene: HardScene) -> State:
    """At rest, but pulley 0 already turns, by 200 rad/s."""
    return attrs.evolve(settle(scene.params), omega=np.array([-200.0, 0.0]))


def _pushed_in(scene: HardScene) -> State:
    """Put every third link off its place by 0.3 mm along y, which joints resist by 1.2 kN."""
    rest = settle(scene.params)
    off = 3e-4 * (np.arange(rest.n_bodies) % 3 == 0)
    return attrs.evolve(rest, y=rest.y + off * np.sign(rest.y))


#: By name, in the order of their families.
MAKE: dict[str, Callable[[], Scene]] = {
    "sigma-1e6": lambda: _run_up({"friction.sigma": 1e6}),
    "sigma-1e7": lambda: _run_up({"friction.sigma": 1e7}),
    "sigma-1e8": lambda: _run_up({"friction.sigma": 1e8}),
    "sigma-tiny": lambda: _run_up({"friction.sigma": 2.0}),
    "mu-0": lambda: Scene(
        pair({"friction": Frictionless()}), PiecewiseLinear([0.0], [-6.0], 0), 0.02
    ),
    "mu-0.01": lambda: pulled(-6.0, {"friction.mu_k": 0.01}),
    "mu-3": lambda: pulled(-34.0, {"friction.mu_k": 3.0}),
    "stribeck-dahl": lambda: _slow_slip(Dahl(mu_k=0.3, sigma=1e5, mu_s=1.2, v_stribeck=0.03)),
    "stribeck-coulomb": lambda: _slow_slip(Coulomb(mu=0.3, v_reg=1e-4, mu_s=1.2, v_stribeck=0.03)),
    "reversal-within-a-step": _reversing,
    "slip-velocity-0": _tensioned_with_friction,
    "coulomb-steep": lambda: _run_up({"friction": Coulomb(mu=0.6, v_reg=1e-6)}),
    "creep-rate-steep": lambda: _run_up({"friction": CreepRate(mu=0.6, v_critical=1e-6)}),
    "threlfall-steep": lambda: _run_up({"friction": Threlfall(mu=0.6, v_reg=1e-6)}),
    "lugre-stiff": lambda: _run_up(
        {"friction": LuGre(mu_k=0.5, mu_s=0.6, v_stribeck=0.01, sigma=1e8)}
    ),
    "elastic-plastic-stiff": lambda: _run_up(
        {"friction": ElasticPlastic(mu=0.6, stiffness=1e13, damping=1e7)}
    ),
    "maxwell-slip-stiff": lambda: _run_up(
        {
            "friction": MaxwellSlip(
                mu=(0.2, 0.2, 0.2), stiffness=(1e7, 1e10, 1e13), damping=(1e2, 1e4, 1e7)
            )
        }
    ),
    "no-axial-damping": _rung,
    "axial-damping-x1000": lambda: pulled(-6.0, {"belt.axial_damping": 2e3}, 0.1),
    "bending-0": lambda: pulled(-6.0, {"belt.model": "links"}),
    "bending-large": lambda: pulled(-6.0, {"belt.bending_stiffness": 0.5, "belt.preload": 600.0}),
    "pulleys-1000-times-lighter": lambda: _run_up({"pulleys[*].inertia": 3.1e-7}, 0.01),
    "pulleys-1000-times-heavier": lambda: _run_up({"pulleys[*].inertia": 0.32}, 0.05),
    "pulley-of-no-inertia": lambda: pulled(-6.0, {"pulleys[0].inertia": 1e-12}),
    "light-pulleys-sigma-1e8": lambda: _run_up(
        {"pulleys[*].inertia": 3.1e-7, "friction.sigma": 1e8}, 0.1
    ),
    "massless-belt": lambda: pulled(-6.0, {"belt.linear_density": 1e-5}),
    "links-4": lambda: _few(4),
    "links-5": lambda: _few(5),
    "links-15": lambda: _run_up({"belt.n_bodies": 15}, 0.05),
    "links-3840": lambda: pulled(-6.0, {"belt.n_bodies": 3840}, 0.03),
    "contact-x1e4": lambda: pulled(-6.0, {"contact.linear": 1.67e13}),
    "contact-x1e-3": lambda: pulled(-6.0, {"contact.linear": 1.67e6, "contact.damping": 4e2}),
    "contact-damping-x100": lambda: pulled(-6.0, {"contact.damping": 1.3e6}),
    "contact-undamped": lambda: _run_up({"contact.damping": 0.0}, 0.01),
    "bouncing": lambda: _on(Contact(linear=1.67e9, damping=1.3e3), 0.02),
    "bouncing-hunt-crossley": lambda: _on(Contact(linear=1.67e9, hunt_crossley=1.0), 0.02),
    "grazing": lambda: Scene(beside(3e-4, 0.12), NOTHING, 0.03),
    "1-newton": lambda: Scene(pair({"belt.preload": 1.0}), ramp(-0.02, 1e-4), 0.05),
    "no-preload": lambda: Scene(pair({"belt.preload": 0.1}), ramp(-0.002, 1e-5), 0.05),
    "slack-span": lambda: Scene(pair({"friction.mu_k": 2.0}), Step(0, 2e-3, -50.0), 0.02),
    "thrown-off": lambda: Scene(_round_a_pin(), NOTHING, 0.01),
    "thrown-apart": lambda: Scene(pair(), NOTHING, 0.01),
    "thrown-through": lambda: _on(Contact(linear=1e6, damping=1e2), 0.01),
    "torque-step": _step,
    "impulse": _impulse,
    "noise": _noise,
    "reversal-in-full-slip": _reversal,
    "dry-drag": lambda: Scene(pair({"pulleys[1].drag": Drag(coulomb=12.0)}), ramp(-6.0, 0.0), 0.1),
    "locked-pulley": lambda: pulled(-25.0),
    "full-slip": lambda: pulled(-50.0),
    "stops-hit-hard": lambda: _arm(stops=(-0.01, 0.01), stop_stiffness=1e7, damping=0.02),
    "soft-arm": lambda: _arm(stiffness=1e-3, damping=0.02),
    "light-arm": lambda: _arm(inertia=1e-9, damping=0.02),
    "dry-pivot": lambda: _arm(friction=4.0, friction_stiffness=4e6),
    "swinging-weight": _weight,
    "path-that-jumps": _jump,
    "radii-1-to-20": lambda: Scene(
        pair(
            {
                "belt.n_bodies": 150,
                "pulleys[0].radius": 0.01,
                "pulleys[0].inertia": 2e-6,
                "pulleys[1].center": (0.3, 0.0),
                "pulleys[1].radius": 0.2,
                "pulleys[1].inertia": 0.2,
            }
        ),
        ramp(-0.5),
        0.05,
    ),
    "crossed": lambda: crossed_belt()._replace(t_end=0.1),
    "back-side": lambda: _idler(0.03),
    "idler-that-just-touches": lambda: _idler(1e-3),
    "10000-rpm": lambda: _driven([1047.2, 1047.2], 0.02, {"belt.preload": 600.0, **_FINE}),
    "lift-off": lambda: _driven([838.0, 1257.0], 0.05),
    "critical-speed": lambda: _driven([885.0, 885.0], 0.02),
    "moving-string": lambda: _driven([548.0, 548.0], 0.1),
    "whip": lambda: Scene(pair({"belt.preload": 20.0}), NOTHING, 0.02),
    "5000-turns": lambda: Scene(
        pair(
            {
                "belt.n_bodies": 24,
                "belt.axial_damping": 20.0,
                "contact.linear": 1.5e7,
                "contact.damping": 2.5e3,
                "pulleys[1].center": (0.15, 0.0),
                "pulleys[*].radius": 0.02,
                "pulleys[*].inertia": 2e-4,
            }
        ),
        ramp(-2.0, 2.0 / 300.0, 1.0),
        115.0,
    ),
    "start-with-pulley-turning": lambda: Scene(pair(), NOTHING, 0.03),
    "start-out-of-place": lambda: Scene(pair(), NOTHING, 0.02),
    "huge-steps": lambda: _run_up({}, 0.1),
    "an-hour": lambda: Scene(
        pair({"pulleys[*].drag": Drag(viscous=50.0)}), Ramp(0, 0.0, 1800.0, -6.0), 3600.0
    ),
    "in-micrometres": lambda: scaled(pulling(), 1e6),
    "in-kilometres": lambda: scaled(pulling(), 1e-3),
}

START: dict[str, Callable[[HardScene], State]] = {
    "bouncing": _thrown,
    "bouncing-hunt-crossley": _thrown,
    "grazing": partial(_moving, vy=1.0),
    "thrown-off": partial(_moving, vy=-40.0),
    "thrown-apart": partial(_moving, vx=-930.0),
    "thrown-through": partial(_moving, vx=-200.0),
    "10000-rpm": _running,
    "lift-off": _running,
    "critical-speed": _running,
    "moving-string": _plucked,
    "whip": _whipped,
    "start-with-pulley-turning": _pulleys_turning,
    "start-out-of-place": _pushed_in,
}
