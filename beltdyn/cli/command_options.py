"""The options of the commands, a row each: of a command its own, or one that several have."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import click

from ..base.run_options import USUAL, Options
from ..drive.parts import MESHES

PATH = click.Path(path_type=Path)


class Asked(SimpleNamespace):
    """What a command was called with: its arguments and options, by name."""

    def given(self, name: str) -> bool:
        """Whether an option stood on the command line."""
        source = click.get_current_context().get_parameter_source(name)
        return source is click.core.ParameterSource.COMMANDLINE


class Option(NamedTuple):
    """An option: its name in :class:`Asked`, what it may be (bool: a flag), text and default."""

    name: str
    kind: Any
    text: str
    default: Any = None
    required: bool = False

    def __call__(self, command: Callable[..., None]) -> Callable[..., None]:
        """Add it to a command."""
        more: dict[str, Any] = {"is_flag": True}
        if self.kind is not bool:
            more = {"type": self.kind, "required": self.required}
        if self.kind is not bool and not self.required:
            more |= {"default": self.default, "show_default": self.default is not None}
        name = f"--{self.name.replace('_', '-')}"
        return click.option(name, help=self.text, **more)(command)


def _of_run(name: str) -> Option:
    """Return the option of the command line for an option of a run."""
    row = Options.rows()[name]
    kind = click.Choice(row.limits) if row.kind is str else row.kind
    return Option(name, kind, row.text, getattr(USUAL, name))


#: Those that several commands have.
_SHARED = {
    option.name: option
    for option in (
        *map(_of_run, ("method", "rtol", "step")),
        Option(
            "mesh",
            click.Choice(MESHES),
            "The belt on this mesh in place of the scene's; the cells of ale are chosen.",
        ),
        Option(
            "out",
            PATH,
            "Write the result here: .npz, which Result.load reads; .nc, .csv, .mat for others.",
        ),
        Option("plot", PATH, "Write an overview figure here."),
        Option("animate", PATH, "Write a film (.gif, .mp4, .html)."),
        Option("t_end", float, "End of the run [s], instead of the scene's."),
        Option(
            "last",
            float,
            "The share of the run, from its end, that the report is of: 0.2 is the last fifth.",
            0.2,
        ),
        Option("full", bool, "Print all of the report, not its first screen."),
        Option("verbose", bool, "Print what the integrator did, too."),
        Option("quiet", bool, "Print nothing but errors."),
    )
}

#: Of commands that run one drive.
QUIET_RUN = Option("quiet", bool, "Print nothing but errors; --out keeps the warnings.")


def options(*rows: str | Option) -> Callable[[Callable[[Asked], None]], Callable[..., None]]:
    """Add options to a command, in this order: rows of its own, and names of shared ones."""
    chosen = [
        option
        for row in rows
        for option in ([row] if isinstance(row, Option) else map(_SHARED.__getitem__, row.split()))
    ]

    def decorate(function: Callable[[Asked], None]) -> Callable[..., None]:
        @wraps(function)
        def command(**arguments: Any) -> None:
            function(Asked(**arguments))

        for option in reversed(chosen):
            command = option(command)
        return command

    return decorate
