"""The options of the commands, a row each: of a command its own, or one that several have."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeAlias

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


#: What adds an option to a command.
Option: TypeAlias = Callable[[Callable[..., None]], Callable[..., None]]


def option(name: str, kind: Any, text: str, default: Any = None, required: bool = False) -> Option:
    """Return an option: its name in :class:`Asked`, what it may be (bool: a flag), its text."""
    more: dict[str, Any] = {"is_flag": True}
    if kind is not bool:
        more = {"type": kind, "required": required}
    if kind is not bool and not required:
        more |= {"default": default, "show_default": default is not None}
    flag = f"--{name.replace('_', '-')}"
    return click.option(flag, help=text, **more)


def _of_run(name: str) -> Option:
    """Return the option of the command line for an option of a run."""
    row = Options.rows()[name]
    kind = click.Choice(row.limits) if row.kind is str else row.kind
    return option(name, kind, row.text, getattr(USUAL, name))


#: Those that several commands have.
_SHARED = {
    **{name: _of_run(name) for name in ("method", "rtol", "step")},
    "mesh": option(
        "mesh",
        click.Choice(MESHES),
        "Mesh of the belt, instead of the scene's; of ale the number of cells is chosen.",
    ),
    "out": option(
        "out",
        PATH,
        "Write the result here: .npz, which Result.load reads; .nc, .csv, .mat for others.",
    ),
    "plot": option("plot", PATH, "Write an overview figure here."),
    "animate": option("animate", PATH, "Write a film (.gif, .mp4, .html)."),
    "t_end": option("t_end", float, "End of the run [s], instead of the scene's."),
    "last": option(
        "last",
        float,
        "Part of the run, from its end, that the report covers: 0.2 is the last fifth.",
        0.2,
    ),
    "full": option("full", bool, "Print all of the report, not its first screen."),
    "verbose": option("verbose", bool, "Print what the integrator did, too."),
    "quiet": option("quiet", bool, "Print nothing but errors."),
    "quiet_run": option("quiet", bool, "Print nothing but errors; --out keeps the warnings."),
}


def options(*rows: str | Option) -> Callable[[Callable[[Asked], None]], Callable[..., None]]:
    """Add options to a command, in this order: rows of its own, and names of shared ones."""
    chosen: list[Option] = []
    for row in rows:
        chosen += [_SHARED[name] for name in row.split()] if isinstance(row, str) else [row]

    def decorate(function: Callable[[Asked], None]) -> Callable[..., None]:
        def asked(**arguments: Any) -> None:
            function(Asked(**arguments))

        command: Callable[..., None] = wraps(function)(asked)
        for add in reversed(chosen):
            command = add(command)
        return command

    return decorate
