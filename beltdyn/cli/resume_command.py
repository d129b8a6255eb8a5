"""The command ``beltdyn resume``: going on with a run that was stopped."""

from __future__ import annotations

from pathlib import Path

import click

from ..run.checkpoints import Continued
from ..run.resuming import resume
from .command_options import PATH, QUIET_RUN, Option, options
from .ending import BAD_INPUT, reported, stop, warn
from .printed import check_share, print_result, running, write
from .written import Outputs

__all__ = ["resume_run"]


@click.command("resume")
@click.argument("file", type=PATH)
@options(
    "out plot animate last",
    Option("checkpoint_every", float, "Wall time between two writes of FILE [s]."),
    "full verbose",
    QUIET_RUN,
)
def resume_run(
    file: Path,
    out: Path | None,
    plot: Path | None,
    animate: Path | None,
    last: float,
    checkpoint_every: float | None,
    full: bool,
    verbose: bool,
    quiet: bool,
) -> None:
    """Go on with the run in FILE, which `beltdyn run --checkpoint FILE` wrote, as if not stopped.

    The result is that of the whole run, the same bit for bit; of a run that had finished it is
    given again. FILE is written on, so that this may be killed as well.
    """
    check_share(last)
    outputs = Outputs(out, plot, animate, quiet)
    outputs.check()
    if file in (out, plot, animate):
        stop(f"{file} is the run itself: write to another file", BAD_INPUT)
    if plot is not None or animate is not None:
        with reported(), Continued(file, write=False, every=None) as run:
            if run.start.outputs is not None:
                stop("--plot and --animate draw from all outputs, the run has some", BAD_INPUT)
    with reported("read or write"), running(outputs, file, None):
        result = resume(file, progress=not quiet, every=checkpoint_every)
    written = write(outputs, result, file)
    if not quiet:
        print_result(str(file), result, last, written, full=full, verbose=verbose)
    warn(result.warnings, quiet)
