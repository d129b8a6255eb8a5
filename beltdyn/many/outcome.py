"""Outcome of a run: how it ended, and what is kept of it; an error is an outcome, too."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import attrs

from .. import _core
from ..result.errors import SimulationError

#: How a run may end, and what that means.
STATUSES = {
    "finished": "it ran to its end",
    "refused": "there is no such drive, load or option",
    "failed": "the run, or settling for it, ended in an error",
    "measure": "measuring raised an error, or gave what does not fit that of the other runs",
    "lost": "a worker process died in it several times",
    "missing": "it was not computed: the sweep was interrupted",
}


@attrs.frozen(eq=False, kw_only=True)
class Outcome:
    """How a run ended, and its results."""

    status: str  # one of STATUSES
    message: str = ""  # why it did not finish, in one line
    warnings: str = ""  # of the run, one in a line
    value: Any = None  # what the run gave; None unless it finished
    layout: Sequence[Any] = ()  # of the value, of plain texts and numbers: many runs have the same
    error: Exception | None = None  # in which it ended, where it is at hand
    kernels: str = ""  # level of the kernels that computed it
    #: Whether it would end so on any machine. What a torque function or a measure raises may be
    #: due to this one; what is refused costs nothing to refuse again.
    reproducible: bool = True
    #: What a run that follows it starts from, such as the arrays of its final state; or None.
    final: Any = None

    @property
    def lasting(self) -> bool:
        """Whether a store may keep it: it ended by itself, and would do so again."""
        return self.status in ("finished", "failed") and self.reproducible


def attempt(
    run: Callable[[], Any], known: type[Exception] | tuple[type[Exception], ...] = Exception
) -> Outcome:
    """Return what a run gives, or a known error as its outcome; Ctrl-C and others are raised."""
    kernels = _core.kernel_level()
    try:
        return Outcome(status="finished", value=run(), kernels=kernels)
    except known as error:
        of_drive = isinstance(error, SimulationError)
        refused = isinstance(error, (TypeError, ValueError))
        result = getattr(error, "result", None)
        name = "" if of_drive or refused else f"{type(error).__name__}: "
        return Outcome(
            status="refused" if refused else "failed",
            message=name + in_line(error),
            warnings="\n".join(map(str, getattr(result, "warnings", ()))),
            error=error,
            kernels=kernels,
            reproducible=of_drive,
        )


def in_line(error: BaseException) -> str:
    """Return the message of an error in one line."""
    return " ".join(str(error).split())
