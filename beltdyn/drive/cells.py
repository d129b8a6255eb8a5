"""The mesh of an ALE belt, whose cells stand still: its errors and limits.

Every limit below stands with the argument for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, TypeVar

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.rounding import percent
from ..base.run_warnings import RunWarning
from .drive import Drive
from .parts import CHOOSE
from .span import Span

#: Error of the tensions beside a pulley, over what it takes from one to the other, times the square
#: of the cells on half a turn: against creep theory 0.2, 0.2, 0.2, 0.2 with 10, 20, 40, 80 cells.
CREEP = 0.2
#: Error of histories over that of means; and what is more where bending runs off over sqrt(EI/T) by
#: longer cells, times that length over the radius. Of random drives (benchmarks/ale.py) against
#: three times the cells true errors are 0.1 to 2 times that, 0.2 to 3 times without bending.
HISTORIES, ENDS = 1.5, 0.02
#: Lengths sqrt(EI/T) of which there should be so many at least on a wrap, and on a span: with fewer
#: its ends begin to overlap. Half of that is refused.
WRAP, SPAN = 4.0, 8.0


#: Of the tension at rest, errors of the lowest frequencies, of so many, and slopes of spans from
#: which on a run is warned.
NEAR_SLACK, FAST, LOWEST, STEEP = 0.1, 0.02, 2, 0.1
#: Share of the time in which belt bends that its damper takes, from which on a run is warned, and
#: by how much of that its losses in bending are too high (U, 480 links: 0.08 at 0.4, 0.15 at 0.8).
LATE, LATE_LOSS = 0.4, 0.2
#: Steps a second of an ALE belt at an rtol, 600 to 3300 measured, the power of rtol by which they
#: fall, and the CPU time of one for each cell, in explicit steps of a link.
STEPS, AT, POWER, STEP = 1800.0, 1e-2, 0.3, 12.0
#: Implicit steps for each link that lands or leaves, 1.5 to 8 measured; explicit ones over
#: 1/(spectral bound).
LANDING, EXPLICIT = 1.5, 2.5
#: Least speed-up for which an ALE belt is recommended, its CPU time being known to a factor of two
#: or three; and the explicit steps of a link that such a run has at least, 0.05 s.
CHEAPER, WORTH = 10.0, 3e5
#: Error above which a frequency is not returned; margin below the first such frequency.
AMISS, NEAR = 0.01, 0.97
#: Angular frequency times the length of a span over the speed of waves along it, above which one
#: sine wave along each makes frequencies wrong by ``AMISS``, (1/90 - 1/pi^4) of its fourth power.
ALONG = (AMISS / (1.0 / 90.0 - 1.0 / math.pi**4)) ** 0.25


D = TypeVar("D", bound=Drive)


def instead(params: D) -> D | None:
    """Return the drive with an ALE belt in place of links; None: it has one, or cannot have it."""
    if params._flows or params._belt_facts["tangents"]:
        return None
    try:
        belt = attrs.evolve(params.belt, mesh=CHOOSE[0], model="auto", n_bodies=None)
        other: D = attrs.evolve(params, belt=belt)
        return None if any(limits(other)) else other
    except (RuntimeError, TypeError, ValueError):  # nor one that does not come to rest
        return None


def landings(params: Drive, speed: float) -> float:
    """Return the number of links a second that land on or leave pulleys, at a belt speed [m/s]."""
    places = 2 * len(params.pulleys)
    return places * abs(speed) * float(params.info["n_bodies"] / params.info["length"])


def _work(params: Drive, rtol: float) -> float:
    """Estimate the CPU time of a second of an ALE belt [explicit steps of a link]."""
    return STEPS * math.pow(AT / rtol, POWER) * STEP * params._usual_cells(params.route)


def cheaper(params: Drive, explicit: float, implicit: float, rtol: float, time: float) -> float:
    """Estimate the speed-up of an ALE belt over a run of links, from the steps of the run."""
    spent = params.info["n_bodies"] * (explicit + params._belt_facts["implicit_cost"] * implicit)
    times = spent / (_work(params, rtol) * time)
    return times if spent > WORTH and times > CHEAPER else 0.0


def describe_cheaper(params: Drive) -> Iterator[str]:
    """Describe from which speed on an ALE belt is ``CHEAPER``, if there is one."""
    steps = CHEAPER * _work(params, AT) / params.info["n_bodies"]
    more = max(0.0, steps / params._belt_facts["implicit_cost"] - STEPS)
    speed = more / (LANDING * landings(params, 1.0))
    slow = params.info["strain_tension"] > 2.0 * params.belt.linear_density * speed**2
    if steps < params.info["spectral_bound"] / EXPLICIT and slow and instead(params) is not None:
        yield (
            f'CPU time: from about {speed:.2g} m/s on Belt(mesh="{CHOOSE[0]}"), through which the '
            "belt flows so that no links land, takes about a tenth"
        )


def _on_arcs(params: Drive) -> Array:
    """Return the number of cells on each pulley (n_p,)."""
    cells = params._cells
    return np.array([np.count_nonzero(cells == k) for k in range(len(params.pulleys))])


def _modes(params: Drive) -> int:
    """Return the number of sine modes of a span."""
    return params._model.sizes["MODES"] // len(params.pulleys)


def _arcs(params: Drive) -> Array:
    return np.asarray(params.route.wraps * params._radii)


def reach(params: Drive) -> float:
    """Return the length sqrt(EI/T) over which bending decays beside a pulley at rest [m]."""
    return math.sqrt(params.belt.bending_stiffness / float(params.info["strain_tension"]))


def errors(params: Drive, pull: float) -> dict[str, float]:
    """Estimate errors of the mesh in "tension" and "span_mean", relative to the mean tension."""
    cells, off = _on_arcs(params), reach(params)
    load = abs(pull) / float(params.info["strain_tension"])
    mean = CREEP * load / float(np.min(cells * np.pi / params.route.wraps)) ** 2
    radii = params._radii
    coarse = np.minimum(1.0, (_arcs(params) / cells / off) ** 2) if off > 0.0 else 0.0
    ends = ENDS * load * float(np.max(off / radii * coarse)) if off > 0.0 else 0.0
    return {"tension": HISTORIES * mean + ends, "span_mean": mean}


def finer(params: Drive, error: float, allowed: float) -> str:
    """Suggest a number of cells that brings an error of second order down."""
    on_arcs = int(_on_arcs(params).sum())
    number = math.ceil(on_arcs * math.sqrt(error / allowed)) + len(params.pulleys)
    return f"n_bodies = {10 * math.ceil(number / 10.0)}"


def trusted(params: Drive, speed: float) -> float:
    """Return the angular frequency above which modes of spans are wrong, at a belt speed [m/s]."""
    wave = params._wave_speed
    modes = _modes(params)
    share = min(abs(speed) / wave, 1.0)
    slower = 1.0 - share**2
    amiss = np.flatnonzero(abs(modes_off(share, modes)) > AMISS) if slower > 0.0 else np.zeros(1)
    number = 1 + (int(amiss[0]) if amiss.size else modes)
    longest = float(np.max(params.route.spans))
    across = NEAR * number * math.pi * wave * slower
    return (min(across, ALONG * _along(params)) if params.info["n_along"] else across) / longest


def modes_off(share: float, modes: int) -> Array:
    """Return the relative error of the frequencies of a running string by so many modes (modes,).

    a_n'' + 2 b sum G_nr a_r' + (n pi)^2 (1 - b^2) a_n = 0 with G_nr = 4 n r / (n^2 - r^2) for odd
    n + r, against n pi (1 - b^2).
    """
    n = np.arange(1, modes + 1)
    apart = np.where((n[:, None] + n) % 2 == 1, n[:, None] ** 2 - n**2, np.inf)
    gyro, still = 8.0 * share * np.outer(n, n) / apart, (n * np.pi) ** 2 * (1.0 - share**2)
    whole = np.block([[np.zeros((modes, modes)), np.eye(modes)], [-np.diag(still), -gyro]])
    rates = np.sort(np.abs(np.linalg.eigvals(whole).imag))[::2]
    return np.asarray(rates / (n * np.pi * (1.0 - share**2)) - 1.0)


def describe(params: Drive) -> str:
    """Describe the error of the mesh in one line, with its numbers of cells and modes."""
    cells, modes = _on_arcs(params), _modes(params)
    long = 1e3 * _arcs(params) / cells
    most = errors(params, 2.0 * float(params.info["strain_tension"]))
    along = " and a wave along it" if params.info["n_along"] else ""
    return (
        f"{params.info['n_bodies']} cells that stand still, {_range(cells, 'd')} on a pulley, "
        f"of {_range(long, '.2g')} mm, and {modes} sine modes to a span{along}: none at rest, "
        f"under load up to {percent(most['span_mean'])} of the mean tension, "
        f"{percent(most['tension'])} of its history, at any speed"
    )


def _range(values: NDArray[Any], places: str) -> str:
    """Return the least and the greatest, or one where both read the same."""
    return " to ".join(dict.fromkeys(f"{one:{places}}" for one in (values.min(), values.max())))


def limits(params: Drive) -> Iterator[RunWarning]:
    """Warn of wraps and spans hardly longer than their ends, where bending decays."""
    off, name = reach(params), params.tensioning.beyond_cells()
    if name:
        yield RunWarning(
            code="tensioning",
            text=f'a belt on the mesh "ale" is laid at rest without friction: tensioning.{name} is '
            "not followed, and what it leaves in the wraps is missing until the belt has run over "
            'them once; Belt(mesh="joint") has it',
        )
    for what, lengths, least in (
        ("the wrap of", _arcs(params), WRAP),
        ("the span that follows", params.route.spans, SPAN),
    ):
        k = int(np.argmin(lengths))
        if lengths[k] < least * off:
            yield RunWarning(
                code="near_limit",
                text=f"{what} {params.label(k)} is {1e3 * lengths[k]:.3g} mm long, only "
                f"{lengths[k] / off:.2g} times the {1e3 * off:.3g} mm over which bending runs off "
                f"a pulley, sqrt(EI/T): below {least:.2g} times tensions may be off by a percent, "
                f'below {0.5 * least:.2g} times the mesh "ale" is refused; "joint" holds',
                where=params.label(k),
                accuracy=True,
            )
    yield from _pairs(params)


def _pairs(params: Drive) -> Iterator[RunWarning]:
    """Warn of a span as heavy as both pulleys at its ends, which swing against each other on it."""
    # Two half waves stand on it then, which it does not have: of equal pulleys of the mass m on
    # spans of the mass M, (w S / 2 c)^2 = M / (m + M / 3) in place of x tan x = M / m with
    # x = w S / 2 c.
    density, radii, spans = params.belt.linear_density, params._radii, params.route.spans
    rims = np.array([pulley.inertia for pulley in params.pulleys]) / radii**2
    rims += density * _arcs(params)
    share = density * spans / np.maximum(rims, np.roll(rims, -1))
    k = int(np.argmax(share))
    most, x = float(share[k]), 1.0
    if len(rims) < 2 or most < 1.0:  # less than 0.7 %
        return
    for _ in range(50):  # each leaves 0.6 of what the one before did, or less
        x = math.atan(most / x)
    amiss = math.sqrt(most / (1.0 + most / 3.0)) / x - 1.0
    if amiss > AMISS:
        yield RunWarning(
            code="near_limit",
            text=f"the span that follows {params.label(k)} weighs {most:.2g} times what pulleys at "
            "its ends do with belt on them: where they swing against each other along it, at "
            f"{x / math.pi * _along(params) / spans[k]:.3g} Hz, they are {percent(amiss)} too fast "
            'and soon out of step; "joint" holds',
            where=params.label(k),
            accuracy=True,
        )


def _along(params: Drive) -> float:
    """Return the speed of waves along the belt, sqrt(EA / rho A) [m/s]."""
    return math.sqrt(params.belt.axial_stiffness / params.belt.linear_density)


def seen(
    params: Drive, tension: Array | None, flow: Array | None, deflection: Array | None
) -> Iterator[tuple[str, str, int, int]]:
    """Return where a run came near the limits of an ALE belt: code, text, sample, span."""

    def most(values: Array) -> tuple[float, int, int]:
        t, k = np.unravel_index(int(np.argmax(values)), values.shape)
        return float(values[t, k]), int(t), int(k)

    rest = float(params.info["strain_tension"])
    if tension is not None:
        span = Span(params.belt, tension, 0.0 if flow is None else flow[:, None])
        thrown = span.centrifugal + 0.0 * tension
        least, t, k = most(-span.pull)
        if -least < NEAR_SLACK * rest:
            yield (
                "near_slack",
                f"has {-least:.3g} N left to press it on its pulleys, of {rest:.4g} N at "
                f"rest: below {percent(0.5 * NEAR_SLACK)} of it the run ends, and tensions may be "
                "off by some percent",
                t,
                k,
            )
        belt = params.belt
        if belt.bending_damping > 0.0 and belt.bending_stiffness > 0.0:
            lag = belt.bending_damping / belt.bending_stiffness
            bends = np.sqrt(np.maximum(span.pull, 0.0) / belt.bending_stiffness)
            late, t, k = most(lag * np.abs(span.speed) * bends)
            if late > LATE:
                yield (
                    "near_limit",
                    f"is damped in bending over {1e3 * lag:.3g} ms, {late:.2g} of the time that "
                    "belt takes through the length where it bends beside a pulley: what it loses "
                    f"there may be {percent(LATE_LOSS * late)} less; from 1 on the run ends",
                    t,
                    k,
                )
        share, t, k = most(np.sqrt(np.clip(thrown / np.maximum(tension, 1e-300), 0.0, 1.0)))
        modes = _modes(params)
        off = abs(modes_off(min(share, 0.99), modes))
        if off[:LOWEST].max() > FAST:
            yield (
                "span_modes",
                f"runs at {percent(share)} of the speed of its waves: with {modes} sine "
                "modes the frequencies of its lateral vibrations are off by "
                f"{', '.join(map(percent, off))}",
                t,
                k,
            )
    if deflection is not None and deflection.size:
        waves = np.arange(1, 1 + deflection.shape[-1]) * np.pi / params.route.spans[:, None]
        slope, t, k = most(np.sum(np.abs(deflection) * waves, axis=-1))
        if slope > STEEP:
            yield (
                "steep_span",
                f"swings with a slope of {slope:.2g}: from {2.0 * STEEP:.2g} on, where what "
                "its swing does to its length is no longer small, the run ends",
                t,
                k,
            )
