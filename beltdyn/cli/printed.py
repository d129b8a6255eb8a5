"""What a run prints and leaves when it ends, however it ends."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from .. import sanity
from ..accuracy_report import Accuracy
from ..errors import Interrupted, SimulationError
from ..params import Params
from ..result import Result
from ..run_warnings import silenced
from .ending import BAD_INPUT, FAILED, INTERRUPTED, interruptible, stop, warn
from .written import Outputs

__all__ = [
    "check_share",
    "print_accuracy",
    "print_report",
    "print_summary",
    "running",
    "write",
]


def check_share(last: float) -> None:
    """Stop unless --last is a share of a run."""
    if not 0.0 < last <= 1.0:
        stop(f"--last must be > 0 and <= 1 (a share of the run), got {last:g}", BAD_INPUT)


def _hint(checkpoint: Path | None) -> str:
    if checkpoint is None:
        return ""
    return f"\ngo on with: beltdyn resume {shlex.quote(str(checkpoint))}"


@contextmanager
def running(
    outputs: Outputs, checkpoint: Path | None, drive: Callable[[], Params] | None
) -> Iterator[None]:
    """Let a run be interrupted; where it does not finish, write what there is and stop.

    Args:
        outputs: The files that were asked for.
        checkpoint: The file it is written to as it goes, with which it can go on.
        drive: Gives the drive, whose warnings are told where there is no result.
    """
    try:
        with interruptible(), silenced():
            yield
    except (SimulationError, Interrupted) as ended:
        failed = isinstance(ended, SimulationError)
        written = outputs.write(ended.result)
        if ended.result:
            warn(ended.result.warnings, outputs.quiet)
        elif failed and drive is not None:
            warn(sanity.check(drive()), outputs.quiet)
        if failed:
            stop(f"{ended}{written}", FAILED)
        hint = _hint(checkpoint) if ended.result else ""
        stop(f"{ended}{written}{hint}", INTERRUPTED)


def write(outputs: Outputs, result: Result, checkpoint: Path | None) -> str:
    """Write the files of a run that finished; give a line that lists them."""
    try:
        with interruptible():
            return outputs.write(result)
    except KeyboardInterrupt:
        stop(f"interrupted while the result was written{_hint(checkpoint)}", INTERRUPTED)


def print_accuracy(report: Accuracy) -> None:
    """Print the errors that ``verify`` has measured."""
    from rich.console import Console
    from rich.table import Table

    heading, *rows = report.table()
    table = Table(title="estimated errors", title_justify="left")
    for k, label in enumerate(heading):
        table.add_column(label, justify="right" if k else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    for remark in report.remarks():
        click.echo(f"  {remark}")


def print_report(result: Result, last: float) -> None:
    """Print the report of the last part of a run."""
    try:
        report = str(result.report(last))
    except ValueError as error:
        report = f"no report: {error}"
    click.echo(f"\n{report}")


def print_summary(scene: str, result: Result, written: str, verbose: bool) -> None:
    """Print the most important results, and what was written."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=scene, show_header=False, title_justify="left")
    for label, value in result.summary(verbose):
        table.add_row(label, value)
    Console().print(table)
    if written:
        click.echo(written.strip())
