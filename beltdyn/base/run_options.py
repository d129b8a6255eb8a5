"""Options of a run: default, limits, unit and meaning of each, in one table."""

from collections.abc import Mapping
from functools import cache, partial
from typing import Annotated, Any, NamedTuple, Self

import attrs
import numpy as np

from .. import _core
from .checks import Array, flag, integer, one_of, positive, real, real_array
from .described import checked

#: Integration methods, of the core's table; :func:`beltdyn.simulate` describes them.
METHODS = _core.METHODS
_NO_TIMES: Array = np.zeros(0)


class Row(NamedTuple):
    """What an option may be, and what it is.

    Limits are of a text all that it may be, of an integer the least, of a number the least and the
    largest; without them it is > 0.
    """

    kind: type  # of its values; of several times numpy.ndarray
    text: str
    unit: str = ""
    limits: tuple[Any, ...] = ()

    def check(self, name: str, value: object) -> Any:
        """Check a value; return it as a plain one."""
        if self.kind is str:
            return one_of(name, value, self.limits)
        if self.kind is bool:
            return flag(name, value)
        if self.kind is int:
            return integer(name, value, *self.limits)
        if self.kind is np.ndarray:
            return np.sort(real_array(name, value, ndim=1))
        if not self.limits:
            return positive(name, value, self.unit)
        number, (least, most) = real(name, value), self.limits
        if not least <= number <= most:
            raise ValueError(f"{name} must be from {least:g} to {most:g}, got {number:g}")
        return number


def _with_checks(_cls: type, fields: list[Any]) -> list[Any]:
    """Return the fields, each with the check of its row."""
    rows = [one.type.__metadata__[0] for one in fields]
    return [
        checked(one, partial(row.check, one.name), row=row)
        for one, row in zip(fields, rows, strict=True)
    ]


@attrs.frozen(kw_only=True, eq=False, field_transformer=_with_checks)
class Options:
    """How a run is integrated: arguments of :func:`beltdyn.simulate`, checked; each is a row.

    One that is None is chosen by the core, or there is no limit. To add one: a row here, of the
    same name an argument of ``simulate`` with its paragraph, and a keyword of the core's
    ``Simulation``. All else, such as names of sweeps and what a checkpoint keeps, follows.
    """

    method: Annotated[str, Row(str, "Integration method.", limits=METHODS)] = "auto"
    rtol: Annotated[float, Row(float, "Error asked for.", limits=(1e-12, 1.0))] = 1e-4
    step: Annotated[
        float | None, Row(float, "Fixed step [s] of rk4, lbdf2, lie; else the first step.", "s")
    ] = None
    max_step: Annotated[float | None, Row(float, "Longest step [s].", "s")] = None
    max_steps: Annotated[int | None, Row(int, "Most steps.", limits=(1,))] = None
    ledger: Annotated[bool, Row(bool, "Record the energies.")] = True
    torque_interval: Annotated[
        float, Row(float, "Longest time between two calls of a torque function [s].", "s")
    ] = 5e-4
    breakpoints: Annotated[Array, Row(np.ndarray, "Times at which steps end [s].", "s")] = _NO_TIMES

    @classmethod
    @cache
    def rows(cls) -> Mapping[str, Row]:
        """Return the rows by name, in order."""
        return {field.name: field.metadata["row"] for field in attrs.fields(cls)}

    @classmethod
    def among(cls, given: dict[str, Any]) -> Self:
        """Return those among arguments of several kinds."""
        return cls(**{name: given[name] for name in cls.rows()})

    def of_core(self) -> dict[str, Any]:
        """Return keywords of the core's ``Simulation``, for which 0 is "not given"."""
        given = ((name, row.kind, getattr(self, name)) for name, row in self.rows().items())
        return {name: kind(0) if value is None else value for name, kind, value in given}


#: The defaults.
USUAL = Options()
#: Those that a budget of CPU time, or an error asked for, chooses.
BY_BUDGET = ("method", "rtol", "step")
