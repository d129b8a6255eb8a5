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
from ..result.errors import Interrupted, SimulationError
from ..result.result import Result
from ..scenes.hard_scenes import HardScene
from .command_options import Asked
from .ending import BAD_INPUT, FAILED, INTERRUPTED, interruptible, stop, warn
from .written import write_result

__all__ = ["check_share", "finish", "running"]


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
    asked: Asked,
    checkpoint: Path | None,
    drive: Callable[[], Params] | None = None,
    scene: HardScene | None = None,
) -> Iterator[None]:
    """Make a run interruptible; if it does not finish, write its results so far and stop."""
    try:
        with interruptible(), silenced():
            yield
    except (SimulationError, Interrupted) as ended:
        failed = isinstance(ended, SimulationError)
        written = write_result(asked, ended.result)
        if ended.result:
            warn(ended.result.warnings, asked.quiet)
        elif failed and drive is not None:
            warn(sanity.check(drive()), asked.quiet)
        if isinstance(ended, SimulationError) and scene and ended.symbol == scene.expects:
            click.echo(f"{ended}{written}")
            if not asked.quiet:
                click.echo(f"\n{scene.told}\nkept     it ends in {ended.symbol}, as it must")
            sys.exit(0)
        if failed:
            stop(f"{ended}{written}", FAILED)
        hint = _hint(checkpoint) if ended.result else ""
        stop(f"{ended}{written}{hint}", INTERRUPTED)


def finish(
    asked: Asked,
    title: object,
    result: Result,
    checkpoint: Path | None,
    before: str = "",
    after: str = "",
) -> None:
    """Write the files of a run that finished; print how it went, its report, its warnings."""
    try:
        with interruptible():
            written = write_result(asked, result)
    except KeyboardInterrupt:
        stop(f"interrupted while the result was written{_hint(checkpoint)}", INTERRUPTED)
    if asked.quiet:
        return
    click.echo(before, nl=False)
    try:
        report = result.report(asked.last)
        text = report.text(full=asked.full)
    except ValueError as error:
        report, text = None, f"no report: {error}"
    if asked.full or asked.verbose or report is None:
        framed(str(title), result.summary(asked.verbose))
    else:
        end, cost = result.final_state.t, result.stats.cpu_time
        click.echo(f"{title}: {result.status}, {end:.6g} s in {cost:.3g} s of CPU time")
    if written:
        click.echo(written.strip())
    if result.accuracy.verified:
        heading, *rows = result.accuracy.table()
        framed("estimated errors", rows, heading)
        for remark in result.accuracy.remarks():
            click.echo(f"  {remark}")
    click.echo(text)
    click.echo(after, nl=False)
    warn(result.warnings, asked.quiet)
