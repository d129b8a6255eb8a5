"""The command ``beltdyn resume``: going on with a run that was stopped."""

from __future__ import annotations

from pathlib import Path

import click

from ..run.checkpoints import Continued
from ..run.resuming import resume
from .ending import BAD_INPUT, reported, stop, warn
from .printed import check_share, print_result, running, write
from .written import Outputs

__all__ = ["resume_run"]


@click.command("resume")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Write the result here: .npz, which Result.load reads; .nc, .csv, .mat for others.",
)
@click.option("--plot", type=click.Path(path_type=Path), help="Write an overview figure here.")
@click.option(
    "--animate", type=click.Path(path_type=Path), help="Write a film (.gif, .mp4, .html)."
)
@click.option(
    "--last",
    type=float,
    default=0.2,
    show_default=True,
    help="The share of the run, from its end, that the report is of: 0.2 is the last fifth.",
)
@click.option(
    "--checkpoint-every",
    type=float,
    help="Wall time between two writes of FILE [s].",
)
@click.option("--full", is_flag=True, help="Print all of the report, not its first screen.")
@click.option("--verbose", is_flag=True, help="Print what the integrator did, too.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors; --out keeps the warnings.")
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
