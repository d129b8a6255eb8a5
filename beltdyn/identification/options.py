"""Checked options of an identification: its search and its priors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Self

import attrs

from ..base.checks import flag, integer, one_of, pair, positive, real
from .findings import confidence_of
from .free import Parameter
from .outlier_weights import LOSSES

__all__ = ["Options"]


def _factor(value: object) -> float:
    if real("limit", value) <= 1.0:
        raise ValueError(f"limit must be > 1, got {value:g}")
    return real("limit", value)


def _share(value: object) -> float:
    if positive("diff_step", value) >= 1.0:
        raise ValueError(f"diff_step must be < 1, got {value:g}")
    return real("diff_step", value)


#: The check of each argument.
_CHECKS: dict[str, Callable[[Any], Any]] = {
    "confidence": confidence_of,
    "limit": _factor,
    "jac": partial(one_of, "jac", choices=("3-point", "2-point")),
    "diff_step": _share,
    "tol": partial(positive, "tol"),
    "max_nfev": partial(integer, "max_nfev", least=1),
    "starts": partial(integer, "starts", least=1),
    "mesh": partial(flag, "mesh"),
    "loss": partial(one_of, "loss", choices=LOSSES),
}


@attrs.frozen(kw_only=True)
class Options:
    """Arguments of :func:`beltdyn.identify`; of each prior index, coordinate and its deviation."""

    confidence: float
    limit: float
    jac: str
    diff_step: float
    tol: float
    max_nfev: int
    starts: int
    mesh: bool
    loss: str
    prior: tuple[tuple[int, float, float], ...]

    @classmethod
    def among(cls, given: Mapping[str, Any], parameters: Sequence[Parameter]) -> Self:
        """Return those among the arguments, checked."""
        checked = {name: check(given[name]) for name, check in _CHECKS.items()}
        return cls(**checked, prior=_prior(parameters, given["prior"]))


def _prior(
    parameters: Sequence[Parameter], prior: Mapping[str, tuple[float, float]] | None
) -> tuple[tuple[int, float, float], ...]:
    names = [part.name for part in parameters]
    rows = []
    for name, given in (prior or {}).items():
        if name not in names:
            raise ValueError(f"prior {name!r} is not free; free are {', '.join(names)}")
        part = parameters[names.index(name)]
        value, std = pair(f"prior {name!r}", given, part.unit)
        if std <= 0.0:
            raise ValueError(f"prior {name!r}: the standard deviation must be > 0, got {std:g}")
        if part.log and value <= 0.0:
            raise ValueError(f"prior {name!r}: the value must be > 0, got {value:g}")
        on_scale = std / (value if part.log else part.size)
        rows.append((names.index(name), part.coordinate(value), on_scale))
    return tuple(rows)
