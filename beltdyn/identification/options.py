"""Checked options of an identification: its search and its priors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import attrs

from ..base.checks import between, flag, integer, one_of, pair, positive
from .free import Parameter
from .linear import LOSSES


def _checked(name: str, check: Callable[..., Any], *rule: Any) -> Any:
    return attrs.field(converter=lambda value: check(name, value, *rule))


@attrs.frozen(kw_only=True)
class Options:
    """Arguments of :func:`beltdyn.identify`; of each prior index, coordinate and its deviation."""

    confidence: float = _checked("confidence", between)
    limit: float = _checked("limit", between, 1.0, math.inf)
    jac: str = _checked("jac", one_of, ("3-point", "2-point"))
    diff_step: float = _checked("diff_step", between)
    tol: float = _checked("tol", positive)
    max_nfev: int = _checked("max_nfev", integer, 1)
    starts: int = _checked("starts", integer, 1)
    mesh: bool = _checked("mesh", flag)
    loss: str = _checked("loss", one_of, LOSSES)
    prior: tuple[tuple[int, float, float], ...]

    @classmethod
    def among(cls, given: Mapping[str, Any], parameters: Sequence[Parameter]) -> Self:
        """Return those among the arguments, checked."""
        named = {field.name: given[field.name] for field in attrs.fields(cls)}
        return cls(**named | {"prior": _prior(parameters, given["prior"])})


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
