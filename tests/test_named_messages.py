"""Messages about pulleys that have names.

Every message is provoked twice, by a drive without names and by the same one with them: the second
must be the first with names in the place of numbers.
"""

from __future__ import annotations

import itertools
import math
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from named import NAMES, Dress, as_it_is, named, pulley, with_names

import beltdyn as bd
from beltdyn import run_warnings, sanity


def dressed(dress: Dress, params: bd.Params, **changes: Any) -> bd.Params:
    """The drive with some of its fields changed; one that is refused is so with its names."""
    changes = {"pulleys": params.pulleys} | changes
    return attrs.evolve(params, **(changes | {"pulleys": dress(changes["pulleys"])}))


def close_pulleys(dress: Dress) -> object:
    """Two that one joint of the belt could touch at once."""
    base = drives.on_mesh(drives.plain(), "joint")
    pulleys = [pulley(center=(x, 0.0), radius=0.03) for x in (0.0, 0.07)]
    length = (2 * 0.07 + 2 * math.pi * 0.03) / 1.01
    belt = attrs.evolve(base.belt, length=length, n_bodies=11, bending_stiffness=0.0)
    return dressed(dress, base, belt=belt, pulleys=pulleys)


@cache
def at_rest() -> bd.State:
    return bd.settle(drives.plain())


def plain(dress: Dress) -> tuple[bd.Params, bd.State]:
    return dressed(dress, drives.plain()), at_rest()


def changed(**changes: Any) -> Callable[[Dress], bd.Params]:
    return lambda dress: dressed(dress, drives.plain(), **changes)


def running(
    torque: Any = None,
    t_end: float = 0.1,
    motion: Any = None,
    *,
    make: Callable[[], Any] | None = None,
    initial: Any = None,
    **options: Any,
) -> Callable[[Dress], Any]:
    """A run of the plain drive from rest, or from what is made of that."""

    def run(dress: Dress) -> Any:
        params, rest = plain(dress)
        start = rest if initial is None else attrs.evolve(rest, **initial(rest))
        used = make() if make else torque or bd.Viscous([0, 1])
        return bd.simulate(params, used, t_end, motion, initial=start, **options)

    return run


def turned(rest: bd.State) -> dict[str, Any]:
    return {"x": -rest.y, "y": rest.x, "phi": rest.phi + math.pi / 2}


def link_far_inside(dress: Dress) -> object:
    """All links thrown to the right, at 0.3 of the speed of stretch waves."""
    params = changed(contact=bd.Contact(linear=2e5, damping=100.0))(dress)
    wave = math.sqrt(params.belt.axial_stiffness / params.belt.linear_density)
    rest = bd.settle(params)
    start = attrs.evolve(rest, vx=rest.vx + 0.3 * wave)
    return bd.simulate(params, bd.Viscous([0, 1]), 0.05, initial=start)


JUMP = bd.PiecewiseLinear([0.0, 1.0], [-50.0, -50.0])
FIXED: dict[str, Any] = {"method": "rk4", "step": 5e-5}


def routed(x: float, y: float, radius: float, side: str = "outside") -> Callable[[Dress], object]:
    """A route that there is not, past this pulley between two others."""
    middle = pulley(center=(x, y), radius=radius, side=side)
    three = (pulley(radius=0.08), middle, pulley(center=(0.30, 0.02)))
    return lambda dress: bd.route(dress(three))


def noise() -> Callable[..., list[float]]:
    """A torque that no step can follow, the same numbers for each run."""
    draw = np.random.default_rng(1)
    return lambda *_: [0.0, 2000.0 * float(draw.standard_normal())]


def flicker() -> Callable[..., list[float]]:
    """A torque that flickers faster than any step can follow."""
    torques = itertools.cycle([[0.0, -1e13], [0.0, 1e13]])
    return lambda *_: next(torques)


JUMP = bd.PiecewiseLinear([0.0, 1.0], [-50.0, -50.0])
FIXED: dict[str, Any] = {"method": "rk4", "step": 5e-5}
REFUSED: dict[str, Callable[[Dress], object]] = {
    "overlap": routed(0.10, 0.02, 0.04),
    "passed by": routed(0.15, 0.05, 0.02, "inside"),
    "its other side": routed(0.12, 0.30, 0.04),
    "through": routed(0.6, 0.0, 0.05),
    "outside": lambda dress: bd.route(dress((pulley(side="outside"), pulley(center=(0.3, 0.0))))),
    "close pulleys": close_pulleys,
    "sinking": changed(contact=bd.Contact(linear=1e5, compensate=True)),
    "overlapping start": lambda dress: bd.settle(plain(dress)[0], offset={1: (-0.2, 0.0)}),
    "missed pulley": lambda dress: bd.settle(dressed(dress, drives.small_idler(0.02, 20))),
    "state beside": running(initial=turned),
    "motion that jumps": running(bd.Viscous([0, 0]), motion={1: JUMP}),
    "motion not finite": running(motion={0: lambda t: math.nan if t > 1e-3 else 0.0}),
    "motion of another kind": running(motion={0: lambda t: None}),
    "motion of a state": lambda dress: at_rest().at_speed(plain(dress)[0], {0: 1.0, 1: 2.0}),
    "torque not finite": running(lambda t, *_: [0.0, math.nan if t > 1e-3 else 0.0]),
    "torque not finite at once": running(lambda *_: [math.inf, 0.0]),
    "fixed step too long": running(
        bd.Viscous([1e3, 0.0]), 0.01, initial=lambda _: {"omega": np.array([1.0, 0.0])}, **FIXED
    ),
    "link far inside": link_far_inside,
    "torque that stalls": running(make=noise, t_end=3.0, method="tsit5", rtol=1e-10),
    "step floor": running(
        make=flicker, t_end=1e3 + 1e-3, initial=lambda _: {"t": 1e3}, method="tsit5"
    ),
}


@pytest.mark.parametrize("provoke", REFUSED.values(), ids=REFUSED.keys())
def test_errors_use_names(provoke: Callable[[Dress], object]) -> None:
    errors: list[Any] = []
    for dress in (as_it_is, named):
        with run_warnings.silenced(), pytest.raises(Exception) as caught:
            provoke(dress)
        errors.append(caught.value)
    plain, other = errors
    assert str(other) == with_names(str(plain)) != str(plain)
    assert type(plain) is type(other)
    if isinstance(other, bd.SimulationError):
        k = other.pulley
        assert k == plain.pulley >= 0
        assert (plain.pulley_name, other.pulley_name) == (f"pulley {k}", NAMES[k])
        again = pickle.loads(pickle.dumps(other.with_traceback(None)))
        assert again.pulley_name == NAMES[k]


def test_an_error_of_no_pulley_names_none() -> None:
    with run_warnings.silenced(), pytest.raises(bd.SimulationError) as caught:
        running(max_steps=3)(named)
    assert caught.value.pulley == -1 and caught.value.pulley_name == ""


def in_millimetres(dress: Dress) -> bd.Params:
    params = drives.plain()
    pulleys = [
        attrs.evolve(p, center=(1e3 * p.center[0], 0.0), radius=1e3 * p.radius + j)
        for j, p in enumerate(params.pulleys)
    ]
    belt = attrs.evolve(params.belt, length=bd.route(pulleys).length / 1.007)
    return dressed(dress, params, pulleys=pulleys, belt=belt)


def with_second(**changes: Any) -> Callable[[Dress], bd.Params]:
    first, second = drives.plain().pulleys
    return changed(pulleys=(first, attrs.evolve(second, **changes)))


def pulse(height: float) -> Callable[..., list[float]]:
    return lambda t, *_: [-height if 0.02 < t < 0.02002 else 0.0, 0.0]


def without_friction(dress: Dress) -> bd.Result:
    return bd.simulate(changed(friction=None)(dress), constant(0.0, 1.0), 0.01)


def pulled(rest: bd.State) -> dict[str, Any]:
    """Into a longer loop, and back."""
    return {"vy": rest.vy + 836.0 * np.sign(rest.y)}


COARSE: dict[str, Any] = {
    "method": "rodas4",
    "rtol": 1e-2,
    "torque_interval": 0.01,
    "t_eval": np.linspace(0.0, 0.03, 3001),
}


def constant(*torques: float) -> bd.Torque:
    return bd.PiecewiseLinear([0.0], [torques])


#: Of a drive, or of a run.
WARNED: dict[str, tuple[str, Callable[[Dress], Any]]] = {
    "compliance": ("compliance", changed(contact=bd.Contact(linear=2e5, damping=100.0))),
    "long links": ("long_links", lambda dress: dressed(dress, drives.small_idler(0.02, 30))),
    "large": ("units", in_millimetres),
    "light": ("units", with_second(inertia=1e-10)),
    "percent": ("units", with_second(friction=bd.Dahl(mu_k=30.0, sigma=1e4))),
    "no friction": ("no_friction", without_friction),
    "torque in N mm": ("units", running(constant(0.0, -5e4), 1e-3)),
    "full slip": ("full_slip", running(constant(-300.0, 300.0), 0.02)),
    "slack span": ("slack_span", running(t_end=0.003, initial=pulled)),
    "torque between steps": ("torque", running(pulse(100.0), 0.03, **COARSE)),
    # ten times what would be let pass
    "faint torque between steps": ("torque", running(pulse(0.1), 0.03, **COARSE)),
    "torque that jumps": (
        "rough_torque",
        running(lambda t, *_: [0.0, -100.0 * math.sin(3e5 * t)], 0.03, **COARSE),
    ),
    "torque without effect": (
        "torque_ignored",
        running(t_end=0.01, motion={1: bd.PiecewiseLinear([0.0, 1.0], [0.0, 9.0])}),
    ),
}


@pytest.mark.parametrize(("code", "provoke"), WARNED.values(), ids=WARNED.keys())
def test_warnings_use_names(code: str, provoke: Callable[[Dress], Any]) -> None:
    found = []
    for dress in (as_it_is, named):
        with run_warnings.silenced():
            what = provoke(dress)
        warned = sanity.check(what) if isinstance(what, bd.Params) else what.warnings
        found.append([one for one in warned if one.code == code])
    assert found[0]
    for one, other in zip(*found, strict=True):
        assert other.text == with_names(one.text)
        assert code == "units" or other.text != one.text  # of percent only the place has a name
        k = int(one.where[-1])
        span = f"span {NAMES[k]} to {NAMES[1 - k]}"
        assert other.where == (span if code == "slack_span" else with_names(one.where)) != one.where
