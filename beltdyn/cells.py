"""What is said of the mesh of an ALE belt, whose cells stand still: its errors, its limits.

Every limit below stands with the argument for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from . import _core, compliance
from .checks import Array
from .parts import Pulley
from .rounding import percent
from .route import Route
from .run_warnings import RunWarning

__all__ = ["Drive", "chosen", "describe", "errors", "finer", "limits", "reach", "trusted"]

#: Length of a cell on a pulley, and cells on half a turn of the largest one, from which on they are
#: longer: a sixth of the half wave of a torsional vibration of 500 Hz, and creep right to 0.02 %.
CELL, HALF_TURN = 0.0125, 30

#: Error of the tensions beside a pulley, over what it takes from one to the other, times the square
#: of the cells on half a turn: against creep theory 0.2, 0.2, 0.2, 0.2 with 10, 20, 40, 80 cells.
CREEP = 0.2
#: The same of histories by the ends of wraps, where bending runs off over sqrt(EI/T): some 0.5 % of
#: the tension on pulleys of three such lengths with cells of one.
ENDS = 0.015
#: Lengths sqrt(EI/T) of which there should be so many at least on a wrap, and on a span: with fewer
#: its ends begin to overlap. Half of that is refused.
WRAP, SPAN = 4.0, 8.0


#: Share of the speed of waves from which on a belt couples modes of a span: by a percent there. And
#: what is left free below the first frequency that is not trusted.
RUNS, NEAR = 0.1, 0.97


class Drive(compliance.Drive, Protocol):
    """The part of :class:`beltdyn.Params` that is needed here; it imports this module."""

    @property
    def _model(self) -> _core.Model: ...
    @property
    def _cells(self) -> NDArray[np.int32]: ...


def chosen(pulleys: Sequence[Pulley], line: Route) -> int:
    """Give how many cells to ask for where that is left open."""
    radii = np.array([pulley.radius for pulley in pulleys])
    length = max(CELL, math.pi * float(radii.max()) / HALF_TURN)
    return 2 * len(pulleys) + math.ceil(float(line.wraps @ radii) / length)


def _on_arcs(params: Drive) -> Array:
    """Give how many cells are on each pulley (n_p,)."""
    cells = params._cells
    return np.array([np.count_nonzero(cells == k) for k in range(len(params.pulleys))])


def _arcs(params: Drive) -> Array:
    return np.asarray(params.route.wraps * [pulley.radius for pulley in params.pulleys])


def reach(params: Drive) -> float:
    """Give the length sqrt(EI/T) over which bending runs off a pulley at rest [m]."""
    return math.sqrt(params.belt.bending_stiffness / float(params.info["strain_tension"]))


def errors(params: Drive, pull: float) -> dict[str, float]:
    """Estimate the errors of the mesh in "tension" and "span_mean", relative to the mean tension.

    At rest there is none. Under load friction is linear within a cell, of second order. Where
    belt with bending stiffness runs on and off cells are to be told from sqrt(EI/T).

    Args:
        params: The drive.
        pull: Largest difference of the tensions on two sides of a pulley [N].
    """
    cells, off = _on_arcs(params), reach(params)
    of_load = CREEP * abs(pull) / float(params.info["strain_tension"])
    mean = of_load / float(np.min(cells * np.pi / params.route.wraps)) ** 2
    radii = np.array([pulley.radius for pulley in params.pulleys])
    coarse = np.minimum(1.0, (_arcs(params) / cells / off) ** 2) if off > 0.0 else 0.0
    ends = ENDS * float(np.max(off / radii * coarse)) if off > 0.0 else 0.0
    return {"tension": mean + ends, "span_mean": mean}


def finer(params: Drive, error: float, allowed: float) -> str:
    """Suggest a number of cells that brings an error of second order down."""
    on_arcs = int(_on_arcs(params).sum())
    number = math.ceil(on_arcs * math.sqrt(error / allowed)) + len(params.pulleys)
    return f"n_bodies = {10 * math.ceil(number / 10.0)}"


def trusted(params: Drive, speed: float) -> float:
    """Give the angular frequency from which on modes across spans are not those of the drive.

    Of the longest span as a string, at a speed of the belt [m/s]: of the first mode that it has not
    or, as what a running string does couples each to its neighbours, of the last that it has.
    """
    wave = math.sqrt(float(params.info["mean_tension"]) / params.belt.linear_density)
    modes = params._model.sizes["MODES"] // len(params.pulleys)
    number = modes + (abs(speed) < RUNS * wave)
    slower = max(0.0, 1.0 - (speed / wave) ** 2)
    return NEAR * number * math.pi * wave * slower / float(np.max(params.route.spans))


def describe(params: Drive) -> str:
    """Say in one line what the error of the mesh is, and of how many cells and modes it is."""
    cells, arcs = _on_arcs(params), _arcs(params)
    modes = params._model.sizes["MODES"] // len(params.pulleys)
    most = errors(params, 2.0 * float(params.info["strain_tension"]))
    return (
        f"{params.info['n_bodies']} cells that stand still, {cells.min()} to {cells.max()} on a "
        f"pulley, of {1e3 * (arcs / cells).min():.2g} to {1e3 * (arcs / cells).max():.2g} mm, and "
        f"{modes} sine modes to a span: none at rest, loads up to {percent(most['span_mean'])} of "
        f"the mean tension, {percent(most['tension'])} of its history, at any speed"
    )


def limits(params: Drive) -> Iterator[RunWarning]:
    """Warn of wraps and spans that are hardly long enough for the ends where bending runs off."""
    off = reach(params)
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
