"""The tension of a belt at rest, and the length of belt that has a given one.

The core knows the tension in closed form (MODEL section 6), for fine links and a belt laid without
friction. What counts is that of a settled belt, so it is settled here, a few times where the length
is looked for.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

import numpy as np

from .. import _core
from ..base.stopping import stoppable
from .tensioning import Tensioning

#: The arguments of :class:`beltdyn._core.Model` but for the belt's length.
Scene: TypeAlias = "tuple[Any, ...]"

#: Unbalanced force over the tension at which the belt is at rest here: mean tensions were then
#: right to 1e-6, and settling took from half to a hundredth of the time that 1e-9 takes.
RESIDUAL = 1e-6
#: How near a tension must be to the one asked for: a tenth of what is promised, 0.1 %.
CLOSE, PROMISED = 1e-4, 1e-3
#: How near the belt line must be to the length that it has with all mounts in their places.
IN_PLACE = 1e-6
#: Settled belts for one length: most take two or three; bisection of a strain known to a fifth
#: comes within 1e-4 in a dozen.
MOST = 16
#: Strains between which lengths are looked for: hardly any, and what the core allows.
_SLACK, _MOST_STRAIN = 1e-9, _core.MAX_STRAIN * (1.0 - 1e-9)
#: Wall time between two looks for Ctrl-C [s].
_CHUNK = 0.1


def model_of(scene: Scene, length: float) -> _core.Model:
    """Make the core's model of a scene with a belt of that length [m]."""
    belt, *others = scene
    return _core.Model((length, *belt), *others)


def in_place(scene: Scene) -> Scene:
    """Return the scene without its mounts, the last but two of its parts."""
    *others, _mounts, belt_model, couplings = scene
    return (*others, None, belt_model, couplings)


@functools.lru_cache(maxsize=256)
def rest_tension(scene: Scene, length: float, tensioning: Tensioning) -> float:
    """Settle a belt and return its mean tension [N]."""
    model = model_of(scene, length)
    settled = _settled(model, tensioning)
    force, held = model.observe(settled)["force"][0], settled["m"]
    return float(np.average(force, weights=held if held.size else None))


def _settled(model: _core.Model, tensioning: Tensioning) -> dict[str, Any]:
    info = model.info
    options = tensioning._options(int(info["n_pulleys"]), info["n_slots"] > 0)
    sim = _core.Simulation.settle(model, None, tolerance=RESIDUAL, **options)
    with stoppable(sim):
        while not sim.advance(_CHUNK):
            pass
    return sim.state()


def _closed_form(scene: Scene, length: float) -> float:
    return float(model_of(scene, length).info["mean_tension"])


@functools.lru_cache(maxsize=256)
def first_length(scene: Scene, line: float, preload: float) -> float:
    """Find a length by the core's closed form, without settling."""
    stiffness = scene[0][2]

    def tension(strain: float) -> float:
        return _closed_form(scene, line / (1.0 + strain))

    least, most = tension(_SLACK), tension(_MOST_STRAIN)
    if preload > most:
        raise ValueError(
            f"belt.preload is too large: {preload:.6g} N would stretch the belt by more than "
            f"{_core.MAX_STRAIN:g}; at most {most:.4g} N are allowed for EA = {stiffness:.4g} N"
        )
    if preload < least and any(row["flows"] and row["mesh"] == scene[9] for row in _core.BELTS):
        raise ValueError(
            f"belt.preload is too small: {preload:.6g} N, but bending alone tensions the belt to "
            f"{least:.4g} N: take less belt.bending_stiffness"
        )
    if preload < least:
        why = "straight links, longer than the arcs they lie on,", "take more of them"
        if scene[0][4] > 0.0:
            why = f"bending, and {why[0]}", f"{why[1]}, or less belt.bending_stiffness"
        raise ValueError(
            f"belt.preload is too small: {preload:.6g} N, but {why[0]} alone tension the belt to "
            f"{least:.4g} N: {why[1]}"
        )
    strain, _ = solve(
        tension, preload, preload / stiffness, stiffness, (_SLACK, _MOST_STRAIN), 1e-12, 60
    )
    model_of(scene, line / (1.0 + strain)).check_geometry()
    return line / (1.0 + strain)


@functools.lru_cache(maxsize=256)
def find_length(scene: Scene, line: float, preload: float, tensioning: Tensioning) -> float:
    """Find the length whose settled belt has a given tension."""
    first = first_length(scene, line, preload)
    start = line / first - 1.0
    nearby = 1e-3 * start
    slope = (
        _closed_form(scene, line / (1.0 + start + nearby)) - _closed_form(scene, first)
    ) / nearby
    settled: list[tuple[float, float]] = []

    def tension(strain: float) -> float:
        settled.append((strain, rest_tension(scene, line / (1.0 + strain), tensioning)))
        return settled[-1][1]

    bounds = (_SLACK, _MOST_STRAIN)
    try:
        strain, found = solve(tension, preload, start, slope, bounds, CLOSE, MOST)
    except RuntimeError:
        if not settled:
            return first
        strain, found = min(settled, key=lambda one: abs(one[1] - preload))
    if abs(found / preload - 1.0) > PROMISED:
        raise ValueError(
            f"belt.preload of {preload:.6g} N cannot be met within 0.1 %: the nearest tension at "
            f"which the belt comes to rest is {found:.6g} N. Links this long stand on the pulleys "
            "as a polygon, whose tension jumps, or the belt's weight tensions its spans: take more "
            f"than {scene[0][0]} links, or more preload"
        )
    return line / (1.0 + strain)


@functools.lru_cache(maxsize=256)
def find_length_in_place(scene: Scene, line: float, held: float, tensioning: Tensioning) -> float:
    """Find the length with which mounts settle in the places of the drive, several about there."""
    start = line / first_length(in_place(scene), line, held) - 1.0
    radii, outside = scene[2], scene[10]

    def shorter(strain: float) -> float:
        model = model_of(scene, line / (1.0 + strain))
        model.check_geometry()
        centers = model.centers(_settled(model, tensioning)["travel"])
        return 2.0 * line - _core.belt_line(centers, radii, outside)[1]

    bounds = (0.5 * start, 1.5 * start)
    try:
        strain, _ = solve(shorter, line, start, line, bounds, IN_PLACE, MOST)
    except (RuntimeError, ValueError):
        strain = start
    return line / (1.0 + strain)


def solve(
    value: Callable[[float], float],
    target: float,
    start: float,
    slope: float,
    within: tuple[float, float],
    close: float,
    most: int,
) -> tuple[float, float]:
    """Solve for the value of a nearly linear, increasing function: secants within a bracket.

    Returns the place whose value came nearest to the target, > 0, and that value; ``slope`` is
    about that of the function, ``within`` a bracket, ``close`` the relative difference at which to
    stop, ``most`` the largest number of evaluations.
    """
    low, high = within
    at = min(max(start, low), high)
    best = before = (at, value(at))
    for _ in range(most - 1):
        if abs(best[1] / target - 1.0) <= close:
            break
        last = before[1] - target
        low, high = (before[0], high) if last < 0.0 else (low, before[0])
        at = before[0] - last / slope
        if not low < at < high:
            at = 0.5 * (low + high)
        now = (at, value(at))
        if abs(now[1] - target) < abs(best[1] - target):
            best = now
        secant = (now[1] - before[1]) / (now[0] - before[0]) if now[0] != before[0] else slope
        # A polygon that has snapped to another place would give any secant.
        if 0.2 * slope < secant < 5.0 * slope:
            slope = secant
        before = now
    return best


class Info(Mapping[str, float | int]):
    """Derived quantities of a drive by name; the tension at rest is computed when asked for."""

    def __init__(self, values: Mapping[str, float | int], tension: Callable[[], float]) -> None:
        self._values = values
        self._tension = tension

    def __getitem__(self, name: str) -> float | int:
        return self._tension() if name == "mean_tension" else self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"Info({dict(self)})"
