"""The command ``beltdyn resume``: going on with a run that was stopped."""

from __future__ import annotations

import click

from ..run.checkpoints import Continued
from ..run.resuming import resume
from .command_options import PATH, QUIET_RUN, Asked, Option, options
from .ending import BAD_INPUT, reported, stop
from .printed import check_share, finish, running
from .written import check_files

__all__ = ["resume_run"]


@click.command("resume")
@click.argument("file", type=PATH)
@options(
    "out plot animate last",
    Option("checkpoint_every", float, "Wall time between two writes of FILE [s]."),
    "full verbose",
    QUIET_RUN,
)
def resume_run(asked: Asked) -> None:
    """Go on with the run in FILE, which `beltdyn run --checkpoint FILE` wrote, as if not stopped.

    The result is that of the whole run, the same bit for bit; of a run that had finished it is
    given again. FILE is written on, so that this may be killed as well.
    """
    file = asked.file
    check_share(asked.last)
    check_files(asked)
    if file in (asked.out, asked.plot, asked.animate):
        stop(f"{file} is the run itself: write to another file", BAD_INPUT)
    if asked.plot is not None or asked.animate is not None:
        with reported(), Continued(file, write=False, every=None) as run:
            if run.start.outputs is not None:
                stop("--plot and --animate draw from all outputs, the run has some", BAD_INPUT)
    with reported("read or write"), running(asked, file):
        result = resume(file, progress=not asked.quiet, every=asked.checkpoint_every)
    finish(asked, file, result, file)
