"""The command ``beltdyn figures``, which alone knows the paper."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import click

from ..base import files
from ..base.run_warnings import RunWarning, distinct, silenced
from .command_options import PATH, Asked, option, options
from .ending import interruptible, reported, warn
from .written import check_figure, check_writable


@click.command("figures")
@options(
    option("out", PATH, "Folder to write to; made if it is not there.", required=True),
    option("format", str, "Kinds of files, with commas.", "png,pdf"),
    option(
        "size",
        click.Choice(["notebook", "print"]),
        "print: panels as wide as a journal's column.",
        "print",
    ),
    "quiet",
)
def draw_figures(asked: Asked) -> None:
    """Draw the paper's figures 5 to 19 from new runs, and the table of its numbers beside ours.

    Writes fig-05.png, fig-05.pdf and so on, and table.txt.
    """
    check_writable(asked.out, folder=True)
    kinds = [kind.strip().lower().removeprefix(".") for kind in asked.format.split(",")]
    with reported():
        for kind in kinds:
            check_figure("beltdyn figures", "--format", kind)
    written: list[Path] = []

    def so_far() -> str:
        return f"; {len(written)} files written to {asked.out}" if written else ""

    with reported("write", so_far), interruptible():
        comparison, noticed = _write_figures(asked, list(dict.fromkeys(kinds)), written)
    if not asked.quiet:
        click.echo(comparison)
        click.echo(f"written: {len(written)} files in {asked.out}")
    warn(noticed, asked.quiet)


def _write_figures(
    asked: Asked, kinds: list[str], written: list[Path]
) -> tuple[str, list[RunWarning]]:
    import beltdyn_kubas
    from beltdyn_kubas.figures import FIGURES

    with silenced():
        runs = beltdyn_kubas.runs(progress=not asked.quiet)
    comparison = str(beltdyn_kubas.compare(runs))
    asked.out.mkdir(exist_ok=True)

    def write(name: str, content: bytes) -> None:
        path = asked.out / name
        files.write_bytes(path, content)
        written.append(path)

    write("table.txt", f"{comparison}\n".encode())
    hidden = asked.quiet or not sys.stderr.isatty()
    with click.progressbar(
        FIGURES.values(), label="drawing", file=sys.stderr, hidden=hidden
    ) as figures:
        for figure in figures:
            drawn = figure(runs, size=asked.size)
            for kind in kinds:
                picture = io.BytesIO()
                drawn.savefig(picture, format=kind)
                write(f"fig-{figure.number:02d}.{kind}", picture.getvalue())
    return comparison, distinct(run.warnings for run in runs)
