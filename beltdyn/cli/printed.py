"""Output of a run when it ends, however it ends."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from ..base.run_warnings import silenced
from ..base.tables import framed
from ..drive import sanity
from ..drive.params import Params
from ..outputs.accuracy_report import Accuracy
from ..result.errors import Interrupted, SimulationError
from ..result.result import Result
from ..scenes.hard_scenes import HardScene
from .ending import BAD_INPUT, FAILED, INTERRUPTED, interruptible, stop, warn
from .written import Outputs

__all__ = ["check_share", "print_result", "running", "write"]


def check_share(last: float) -> None:
    """Stop unless --last is a share of a run."""
    if not 0.0 < last <= 1.0:
        stop(f"--last must be > 0 and <= 1 (a share of the run), got {last:g}", BAD_INPUT)


def _hint(checkpoint: Path | None) -> str:
    if checkpoint is None or not checkpoint.exists():
        return ""
    return f"\ngo on with: beltdyn resume {shlex.quote(str(checkpoint))}"


@contextmanager
def running(
    outputs: Outputs,
    checkpoint: Path | None,
    drive: Callable[[], Params] | None,
    scene: HardScene | None = None,
) -> Iterator[None]:
    """Make a run interruptible; if it does not finish, write its results so far and stop."""
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
        if isinstance(ended, SimulationError) and scene and ended.symbol == scene.expects:
            click.echo(f"{ended}{written}")
            if not outputs.quiet:
                click.echo(f"\n{scene.told}\nkept     it ends in {ended.symbol}, as it must")
            sys.exit(0)
        if failed:
            stop(f"{ended}{written}", FAILED)
        hint = _hint(checkpoint) if ended.result else ""
        stop(f"{ended}{written}{hint}", INTERRUPTED)


def write(outputs: Outputs, result: Result, checkpoint: Path | None) -> str:
    """Write the files of a run that finished; return a line that lists them."""
    try:
        with interruptible():
            return outputs.write(result)
    except KeyboardInterrupt:
        stop(f"interrupted while the result was written{_hint(checkpoint)}", INTERRUPTED)


def _print_accuracy(report: Accuracy) -> None:
    """Print the errors that ``verify`` has measured."""
    heading, *rows = report.table()
    framed("estimated errors", rows, heading)
    for remark in report.remarks():
        click.echo(f"  {remark}")


def print_result(
    scene: str, result: Result, last: float, written: str, *, full: bool, verbose: bool
) -> None:
    """Print what was written, how the run went, and the report of its last part."""
    report = None
    try:
        report = result.report(last)
    except ValueError as error:
        missing = f"no report: {error}"
    if full or verbose or report is None:
        framed(scene, result.summary(verbose))
    else:
        end, cost = result.final_state.t, result.stats.cpu_time
        click.echo(f"{scene}: {result.status}, {end:.6g} s in {cost:.3g} s of CPU time")
    if written:
        click.echo(written.strip())
    if result.accuracy.verified:
        _print_accuracy(result.accuracy)
    click.echo(missing if report is None else report.text(full=full))
