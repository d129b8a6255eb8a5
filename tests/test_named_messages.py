"""Messages about pulleys that have names.

Every message is provoked twice, by a drive without names and by the same one with them: the second
must be the first with names in the place of numbers.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from named import NAMES, Dress, Pulleys, as_it_is, named, pulley, with_names

import beltdyn as bd
from beltdyn import run_warnings, sanity

# ------------------------------------------------------------------- messages of the drive


A = pulley(radius=0.08)
B = pulley(center=(0.30, 0.02))
C = pulley(center=(0.10, 0.02), radius=0.04, side="outside")
ROUTES = {
    "overlap": (A, C, B),
    "passed by": (A, pulley(center=(0.15, 0.05), radius=0.02), B),
    "its other side": (A, pulley(center=(0.12, 0.30), radius=0.04, side="outside"), B),
    "through": (A, pulley(center=(0.6, 0.0), radius=0.05, side="outside"), B),
    "outside": (attrs.evolve(A, side="outside"), B),
}


@pytest.mark.parametrize("pulleys", ROUTES.values(), ids=ROUTES.keys())
def test_routes_that_there_are_not(pulleys: Pulleys) -> None:
    texts = []
    for dress in (as_it_is, named):
        with pytest.raises(ValueError) as caught:
            bd.route(dress(pulleys))
        texts.append(str(caught.value))
    assert texts[1] == with_names(texts[0]) != texts[0]


# ------------------------------------------------------------------- messages: each said twice


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


def sinking(dress: Dress) -> object:
    return dressed(dress, drives.plain(), contact=bd.Contact(linear=1e5, compensate=True))


@cache
def at_rest() -> bd.State:
    return bd.settle(drives.plain())


def plain(dress: Dress) -> tuple[bd.Params, bd.State]:
    return dressed(dress, drives.plain()), at_rest()


def thrown(params: bd.Params, rest: bd.State, share: float) -> bd.State:
    """All links to the right, at a share of the speed of stretch waves."""
    wave = math.sqrt(params.belt.axial_stiffness / params.belt.linear_density)
    return attrs.evolve(rest, vx=rest.vx + share * wave)


def overlapping_start(dress: Dress) -> object:
    return bd.settle(dressed(dress, drives.plain()), offset={1: (-0.2, 0.0)})


def missed_pulley(dress: Dress) -> object:
    return bd.settle(dressed(dress, drives.small_idler(0.02, 20)))


def running(
    torque: Any = None,
    t_end: float = 0.1,
    motion: Any = None,
    *,
    initial: Any = None,
    **options: Any,
) -> Callable[[Dress], object]:
    """A run of the plain drive from rest, or from what is made of that."""

    def run(dress: Dress) -> object:
        params, rest = plain(dress)
        start = rest if initial is None else attrs.evolve(rest, **initial(rest))
        used = torque() if isinstance(torque, type) else torque or bd.Viscous([0, 1])
        return bd.simulate(params, used, t_end, motion, initial=start, **options)

    return run


def turned(rest: bd.State) -> dict[str, Any]:
    return {"x": -rest.y, "y": rest.x, "phi": rest.phi + math.pi / 2}


def motion_of_another_kind_from_rest(dress: Dress) -> object:
    return bd.simulate(plain(dress)[0], bd.Viscous([0, 1]), 0.1, {0: lambda t: None})


def motion_of_a_state(dress: Dress) -> object:
    params, rest = plain(dress)
    return rest.at_speed(params, {0: 1.0, 1: 2.0})


def link_far_inside(dress: Dress) -> object:
    params = dressed(dress, drives.plain(), contact=bd.Contact(linear=2e5, damping=100.0))
    start = thrown(params, bd.settle(params), 0.3)
    return bd.simulate(params, bd.Viscous([0, 1]), 0.05, initial=start)


class Noise:
    """A torque that no step can follow, the same numbers for each run."""

    def __init__(self) -> None:
        self.draw = np.random.default_rng(1)

    def __call__(self, *_: object) -> list[float]:
        return [0.0, 2000.0 * float(self.draw.standard_normal())]


class Flicker:
    """A torque that flickers faster than any step can follow."""

    def __init__(self) -> None:
        self.torque = 1e13

    def __call__(self, *_: object) -> list[float]:
        self.torque = -self.torque
        return [0.0, self.torque]


JUMP = bd.PiecewiseLinear([0.0, 1.0], [-50.0, -50.0])
FIXED: dict[str, Any] = {"method": "rk4", "step": 5e-5}
REFUSED: dict[str, Callable[[Dress], object]] = {
    "close pulleys": close_pulleys,
    "sinking": sinking,
    "overlapping start": overlapping_start,
    "missed pulley": missed_pulley,
    "state beside": running(initial=turned),
    "motion that jumps": running(bd.Viscous([0, 0]), motion={1: JUMP}),
    "motion not finite": running(motion={0: lambda t: math.nan if t > 1e-3 else 0.0}),
    "motion of another kind": running(motion={0: lambda t: None}),
    "motion of another kind from rest": motion_of_another_kind_from_rest,
    "motion of a state": motion_of_a_state,
    "torque not finite": running(lambda t, *_: [0.0, math.nan if t > 1e-3 else 0.0]),
    "torque not finite at once": running(lambda *_: [math.inf, 0.0]),
    "fixed step too long": running(
        bd.Viscous([1e3, 0.0]), 0.01, initial=lambda _: {"omega": np.array([1.0, 0.0])}, **FIXED
    ),
    "link far inside": link_far_inside,
    "torque that stalls": running(Noise, 3.0, method="tsit5", rtol=1e-10),
    "step floor": running(Flicker, 1e3 + 1e-3, initial=lambda _: {"t": 1e3}, method="tsit5"),
}


@pytest.mark.parametrize("provoke", REFUSED.values(), ids=REFUSED.keys())
def test_errors_use_names(provoke: Callable[[Dress], object]) -> None:
    errors: list[Any] = []
    for dress in (as_it_is, named):
        with run_warnings.silenced(), pytest.raises(Exception) as caught:
            provoke(dress)
        errors.append(caught.value)
    texts = [str(error) for error in errors]
    assert texts[1] == with_names(texts[0]) != texts[0]
    assert type(errors[0]) is type(errors[1])
    if isinstance(errors[1], bd.SimulationError):
        k = errors[1].pulley
        assert k == errors[0].pulley >= 0
        assert (errors[0].pulley_name, errors[1].pulley_name) == (f"pulley {k}", NAMES[k])
        again = pickle.loads(pickle.dumps(errors[1].with_traceback(None)))
        assert again.pulley_name == NAMES[k]


def test_an_error_of_no_pulley_names_none() -> None:
    params, rest = plain(named)
    with run_warnings.silenced(), pytest.raises(bd.SimulationError) as caught:
        bd.simulate(params, bd.Viscous([0, 1]), 0.1, initial=rest, max_steps=3)
    assert caught.value.pulley == -1 and caught.value.pulley_name == ""


def of_parameters(**changes: Any) -> Callable[[Dress], tuple[bd.RunWarning, ...]]:
    return lambda dress: sanity.check(dressed(dress, drives.plain(), **changes))


def with_second(**changes: Any) -> Callable[[Dress], tuple[bd.RunWarning, ...]]:
    first, second = drives.plain().pulleys
    return of_parameters(pulleys=(first, attrs.evolve(second, **changes)))


def of_run(
    torque: Any, t_end: float, **options: Any
) -> Callable[[Dress], tuple[bd.RunWarning, ...]]:
    def run(dress: Dress) -> tuple[bd.RunWarning, ...]:
        params, rest = plain(dress)
        with run_warnings.silenced():
            return bd.simulate(params, torque, t_end, **({"initial": rest} | options)).warnings

    return run


def without_friction(dress: Dress) -> tuple[bd.RunWarning, ...]:
    params = dressed(dress, drives.plain(), friction=None)
    with run_warnings.silenced():
        return bd.simulate(params, bd.PiecewiseLinear([0.0], [[0.0, 1.0]]), 0.01).warnings


def slack(dress: Dress) -> tuple[bd.RunWarning, ...]:
    """Pulled into a longer loop and back."""
    params, rest = plain(dress)
    out = attrs.evolve(rest, vy=rest.vy + 836.0 * np.sign(rest.y))
    with run_warnings.silenced():
        return bd.simulate(params, bd.Viscous([0, 1]), 0.003, initial=out).warnings


def small_pulley(dress: Dress) -> tuple[bd.RunWarning, ...]:
    return sanity.check(dressed(dress, drives.small_idler(0.02, 30)))


def in_millimetres(dress: Dress) -> tuple[bd.RunWarning, ...]:
    params = drives.plain()
    pulleys = [
        attrs.evolve(p, center=(1e3 * p.center[0], 0.0), radius=1e3 * p.radius + j)
        for j, p in enumerate(params.pulleys)
    ]
    belt = attrs.evolve(params.belt, length=bd.route(pulleys).length / 1.007)
    return sanity.check(dressed(dress, params, pulleys=pulleys, belt=belt))


def pulse(t: float, *_: object) -> list[float]:
    return [-100.0 if 0.02 < t < 0.02002 else 0.0, 0.0]


def faint_pulse(t: float, *_: object) -> list[float]:
    """Ten times what would be let pass."""
    return [-0.1 if 0.02 < t < 0.02002 else 0.0, 0.0]


def flickering(t: float, *_: object) -> list[float]:
    return [0.0, -100.0 * math.sin(3e5 * t)]


COARSE: dict[str, Any] = {
    "method": "rodas4",
    "rtol": 1e-2,
    "torque_interval": 0.01,
    "t_eval": np.linspace(0.0, 0.03, 3001),
}
WARNED: dict[str, tuple[str, Callable[[Dress], tuple[bd.RunWarning, ...]]]] = {
    "compliance": ("compliance", of_parameters(contact=bd.Contact(linear=2e5, damping=100.0))),
    "long links": ("long_links", small_pulley),
    "large": ("units", in_millimetres),
    "light": ("units", with_second(inertia=1e-10)),
    "percent": ("units", with_second(friction=bd.Dahl(mu_k=30.0, sigma=1e4))),
    "no friction": ("no_friction", without_friction),
    "torque in N mm": ("units", of_run(bd.PiecewiseLinear([0.0], [[0.0, -5e4]]), 1e-3)),
    "full slip": ("full_slip", of_run(bd.PiecewiseLinear([0.0], [[-300.0, 300.0]]), 0.02)),
    "slack span": ("slack_span", slack),
    "torque between steps": ("torque", of_run(pulse, 0.03, **COARSE)),
    "faint torque between steps": ("torque", of_run(faint_pulse, 0.03, **COARSE)),
    "torque that jumps": ("rough_torque", of_run(flickering, 0.03, **COARSE)),
    "torque without effect": (
        "torque_ignored",
        of_run(
            bd.Viscous([0.0, 1.0]), 0.01, motion={1: bd.PiecewiseLinear([0.0, 1.0], [0.0, 9.0])}
        ),
    ),
}


@pytest.mark.parametrize(("code", "provoke"), WARNED.values(), ids=WARNED.keys())
def test_warnings_use_names(
    code: str, provoke: Callable[[Dress], tuple[bd.RunWarning, ...]]
) -> None:
    plain, others = (
        [one for one in provoke(dress) if one.code == code] for dress in (as_it_is, named)
    )
    assert plain
    for one, other in zip(plain, others, strict=True):
        assert other.text == with_names(one.text)
        assert code == "units" or other.text != one.text  # of percent only the place has a name
        k = int(one.where[-1])
        span = f"span {NAMES[k]} to {NAMES[1 - k]}"
        assert other.where == (span if code == "slack_span" else with_names(one.where)) != one.where
