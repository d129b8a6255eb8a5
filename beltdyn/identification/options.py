"""Checked options of an identification: its search and its priors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

import attrs

from ..base.checks import one_of, pair, positive, real
from .findings import confidence_of
from .free import Parameter
from .outlier_weights import LOSSES

__all__ = ["Options"]


@attrs.frozen(kw_only=True)
class Options:
    """Arguments of :func:`beltdyn.identify`; of each prior index, coordinate and its deviation."""

    confidence: float
    limit: float
    central: bool
    step: float
    tol: float
    loss: str
    prior: tuple[tuple[int, float, float], ...]

    @classmethod
    def checked(
        cls,
        parameters: Sequence[Parameter],
        *,
        confidence: float,
        limit: float,
        jac: str,
        diff_step: float,
        tol: float,
        loss: str,
        prior: Mapping[str, tuple[float, float]] | None,
    ) -> Self:
        """Return the options that these arguments ask for."""
        if real("limit", limit) <= 1.0:
            raise ValueError(f"limit must be > 1, got {limit:g}")
        if positive("diff_step", diff_step) >= 1.0:
            raise ValueError(f"diff_step must be < 1, got {diff_step:g}")
        return cls(
            confidence=confidence_of(confidence),
            limit=float(limit),
            central=one_of("jac", jac, ("3-point", "2-point")) == "3-point",
            step=float(diff_step),
            tol=positive("tol", tol),
            loss=one_of("loss", loss, LOSSES),
            prior=_prior(parameters, prior),
        )


def _prior(
    parameters: Sequence[Parameter], prior: Mapping[str, tuple[float, float]] | None
) -> tuple[tuple[int, float, float], ...]:
    """Return index, coordinate and its standard deviation."""
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
        rows.append((names.index(name), part.coordinate(value), part.deviation(std, value)))
    return tuple(rows)
