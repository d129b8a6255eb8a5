"""Small drives whose pulleys have mounts: arms, sliders, paths; and states of theirs for tests."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
import reference
from dense import levers
from drives import on_mesh
from laws import EXAMPLES, with_laws
from reference_mounts import Sprung

import beltdyn as bd

#: Methods, with what each promises of its forces, relative to the mean tension.
METHODS: dict[str, dict[str, Any]] = {
    "auto": {"rtol": 1e-4},
    "tsit5": {"rtol": 1e-5},
    "rk4": {},
    "rodas4": {"rtol": 1e-5},
    "lbdf2": {"rtol": 1e-3},
    "lie": {"rtol": 1e-2},
}


def drive(
    pulleys: list[bd.Pulley], n_bodies: int = 48, belt_changes: Any = None, **changes: Any
) -> bd.Params:
    """With a belt of 120 N as the pulleys are drawn."""
    belt: dict[str, Any] = {"length": bd.route(pulleys).length / 1.006, "mesh": "joint"}
    belt |= {"linear_density": 0.10, "axial_stiffness": 20e3, "axial_damping": 1.0}
    belt |= {"bending_stiffness": 0.005, "n_bodies": n_bodies} | (belt_changes or {})
    data: dict[str, Any] = {"contact": bd.Contact(linear=5e7, damping=2e3, compensate=True)}
    data |= {"friction": bd.Dahl(mu_k=0.8, sigma=5e3)} | changes
    return bd.Params(belt=bd.Belt(**belt), pulleys=pulleys, **data)


def arm(**changes: Any) -> bd.Arm:
    """An arm that presses its idler on the back of the belt."""
    data: dict[str, Any] = {"pivot": (0.215, 0.105), "inertia": 0.0025, "mass": 0.2}
    data |= {"stiffness": 10.0, "preload": 6.0, "damping": 0.03, "friction": 0.3}
    return bd.Arm(**(data | changes))


def tensioner(
    mount: bd.Arm | None = None, drag: bd.Drag | None = None, n_bodies: int = 48, **changes: Any
) -> bd.Params:
    """Crank, idler on an arm on the back of the belt, alternator."""
    idler = {"radius": 0.04, "inertia": 0.0002, "side": "outside", "drag": drag}
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
        bd.Pulley(center=(0.135, 0.068), mount=arm() if mount is None else mount, **idler),
        bd.Pulley(center=(0.30, 0.02), radius=0.06, inertia=0.004),
    ]
    return drive(pulleys, n_bodies, **changes)


def slider(**changes: Any) -> bd.Slider:
    """A carriage that a weight of 24 kg pulls to the right."""
    data: dict[str, Any] = {"direction": (1.0, 0.0), "mass": 1.0, "weight": 24.0, "damping": 60.0}
    return bd.Slider(**(data | changes))


def take_up(
    mount: Any = None, n_bodies: int = 36, fixed: bool = False, **changes: Any
) -> bd.Params:
    """Two equal pulleys, the second on a slider, or where it is drawn."""
    mounted = None if fixed else slider() if mount is None else mount
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
        bd.Pulley(center=(0.30, 0.0), radius=0.08, inertia=0.005, mount=mounted),
    ]
    return drive(pulleys, n_bodies, **changes)


def leaning(**changes: Any) -> bd.Params:
    """The take-up on a slope, with gravity, a spring beside the weight, and friction."""
    mount = slider(
        direction=(3.0, -1.0), mass=2.0, weight=15.0, stiffness=2e3, preload=60.0, friction=20.0
    )
    return take_up(mount, gravity=(0.0, -9.81), **changes)


PATH_T = (0.0, 0.01, 0.03, 0.05)
PATH_D = ((0.0, 0.0), (5e-4, 2e-4), (1.5e-3, -4e-4), (1e-3, 3e-4))


def path(**changes: Any) -> bd.Params:
    return take_up(bd.Path(t=PATH_T, displacement=PATH_D), **changes)


def wandering(**changes: Any) -> bd.Params:
    """An axis that goes across by a whole link, so that other links come to touch."""
    far = ((0.0, 0.0), (2e-3, 0.012), (4e-3, 0.03), (1e-3, 0.024))
    return take_up(bd.Path(t=PATH_T, displacement=far), **changes)


DRAG = bd.Drag(coulomb=0.05, viscous=1e-3, quadratic=1e-5)


def stopped(**changes: Any) -> bd.Params:
    """The tensioner with stops a few milliradians away, stiffness and damping chosen."""
    return tensioner(arm(stops=(-0.03, 0.02), friction=0.1), **changes)


def both(laws: bool = False, **changes: Any) -> bd.Params:
    """Crank, idler with drag on an arm, alternator, and below a pulley on a slider; gravity."""
    tensioning = arm(pivot=(0.225, 0.11), preload=8.0, stops=(-0.2, 0.3))
    carriage = slider(direction=(-0.2, -2.0), mass=0.6, weight=14.0, stiffness=500.0, friction=10.0,
                      friction_stiffness=2e4)  # fmt: skip
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
        bd.Pulley(center=(0.14, 0.075), radius=0.04, inertia=0.0002, side="outside", drag=DRAG,
                  mount=tensioning),
        bd.Pulley(center=(0.32, 0.02), radius=0.07, inertia=0.004),
        bd.Pulley(center=(0.18, -0.16), radius=0.05, inertia=0.0005, drag=DRAG, mount=carriage),
    ]  # fmt: skip
    params = drive(pulleys, **{"gravity": (0.0, -9.81)} | changes)
    if laws:
        chosen = (EXAMPLES["lugre"], EXAMPLES["dahl"], EXAMPLES["elastic_plastic"], None)
        return with_laws(params, *chosen)
    return params


def moved_on_path(**changes: Any) -> bd.Params:
    """An arm beside an axis that follows a path."""
    params = tensioner(**changes)
    last = attrs.evolve(params.pulleys[2], mount=bd.Path(t=PATH_T, displacement=PATH_D))
    return attrs.evolve(params, pulleys=[*params.pulleys[:2], last])


DRIVES: dict[str, Any] = {
    "arm": tensioner,
    "arm with stops": stopped,
    "arm on its stop": lambda: tensioner(arm(stops=(-0.008, 0.02), mass=0.0)),
    "arm with drag": lambda: tensioner(drag=DRAG),
    "slider": take_up,
    "slider, gravity": leaning,
    "path": path,
    "far path": wandering,
    "arm and slider": both,
    "arm and slider, three laws": lambda: both(laws=True),
    "arm and path": moved_on_path,
    "no friction": lambda: tensioner(friction=None),
    **{
        name: lambda law=law: tensioner(friction=law)
        for name, law in EXAMPLES.items()
        if name != "dahl"
    },
    "string, arm": lambda: on_mesh(tensioner(drag=DRAG), "string"),
    "string, arm with stops": lambda: on_mesh(stopped(), "string"),
    "string, slider, gravity": lambda: on_mesh(leaning(), "string"),
    "string, path": lambda: on_mesh(path(), "string"),
    "string, arm and slider, three laws": lambda: on_mesh(both(laws=True), "string"),
}


def torque(params: bd.Params) -> bd.TorqueLike:
    """A ramp of 4 N m on the crank against a load on the last but one free pulley."""
    n_p = len(params.pulleys)
    last = [0.0] * n_p
    last[min(n_p - 1, 2)] = 0.3
    ramp = bd.PiecewiseLinear([0.0, 0.02], [[0.0] * n_p, [-4.0] + [0.0] * (n_p - 1)])
    return ramp + bd.Viscous(last)


def shake_mounts(
    oracle: reference.Reference, state: dict[str, Any], seed: int, how: str, by: float = 5e-4
) -> dict[str, Any]:
    """The state with its mounts displaced by up to half a millimetre, or so far, and moving, their
    friction anywhere; "saturated", with all of it; "stops", 0.05 to 0.15 mm in a stop, on the way
    in or out. A path is at some time of its own.
    """
    rng = np.random.default_rng([seed, len(how)])
    n_m = len(oracle.mounted)
    travel, rate, share = np.array(state["travel"], dtype=float), np.zeros(n_m), np.zeros(n_m)
    ends = [one.t[-1] for one in oracle.mounts.values() if not isinstance(one, Sprung)]
    now = float(rng.uniform(0.1, 0.8) * min(ends, default=0.05))  # on the way
    for m, (reach, one) in enumerate(zip(levers(oracle), oracle.mounts.values(), strict=True)):
        if not isinstance(one, Sprung):
            travel[m], rate[m] = now, 1.0
            continue
        travel[m] += by / reach * rng.uniform(-1, 1)
        rate[m] = rng.uniform(0.1, 0.5) * rng.choice([-1, 1]) / reach
        if how == "stops" and one.stops is not None:
            side = int(rng.integers(2))
            depth = rng.uniform(0.5e-4, 1.5e-4) / reach
            travel[m] = one.stops[side] + (depth if side else -depth)
            slow = 0.5 * one.stop_stiffness * depth / one.stop_damping
            rate[m] = slow * rng.choice([-1.0, 0.5, 4.0])
        if one.friction > 0.0:
            share[m] = rng.choice([-1.0, 1.0]) if how == "saturated" else rng.uniform(-0.9, 0.9)
    t = now if any(not isinstance(one, Sprung) for one in oracle.mounts.values()) else state["t"]
    return {**state, "travel": travel, "travel_speed": rate, "mount_friction": share, "t": t}


def tension_of(params: bd.Params) -> float:
    """Scale of forces: that of the strain of the belt line."""
    return float(params.info["strain_tension"])
