"""Settings of a run that its error and its cost depend on, and ladders of them."""

from __future__ import annotations

import math
from typing import Any

import attrs

from .. import _core
from ..drive.params import Params

#: Methods that control their error and are worth a choice ("lie" and "rk4" are for comparison).
METHODS = tuple(name for name in _core.METHODS if name in ("auto", "tsit5", "rodas4", "lbdf2"))
#: Tolerances, from loose to tight; values above 0.1 loosen nothing further.
RTOLS = (1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
#: Numbers of links, as multiples of those of the scene.
_SHARES = (0.25, 0.5, 1.0, 2.0, 4.0)
#: Links on the circumference of the smallest pulley, at least: of a hexagon.
_ROUND = 6
#: Cells of a pulley and the span that follows it, at least.
CELLS = 7


@attrs.frozen(order=True)
class Setting:
    """Settings of a run."""

    n_bodies: int  # links, of an ALE belt about the cells
    method: str
    rtol: float  # error in time that the method is asked for

    @property
    def options(self) -> dict[str, Any]:
        """Keywords for :func:`beltdyn.simulate`, ``method`` and ``rtol``."""
        return {"method": self.method, "rtol": self.rtol}

    def __str__(self) -> str:
        return f"{self.method} at rtol {self.rtol:.2g} with n_bodies = {self.n_bodies}"


def fewest(params: Params) -> int:
    """Return the least number of links that still lie round every pulley; of cells the least."""
    if params._flows:
        return CELLS * len(params.pulleys)
    radius = min(pulley.radius for pulley in params.pulleys)
    return max(8, math.ceil(_ROUND * params.info["length"] / (2.0 * math.pi * radius)))


def meshes(params: Params) -> tuple[int, ...]:
    """Return numbers of links about those of a drive, each twice the one before."""
    n_b, least = params.n_bodies, fewest(params)
    return tuple(n for n in (round(share * n_b) for share in _SHARES) if n >= least)
