"""What a command leaves: its files, checked before it runs; what is printed of a run."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base import files
from ..base.checks import one_of
from ..base.optional import optional_module
from ..base.run_warnings import silenced
from ..base.tables import framed
from ..drive import sanity
from ..drive.params import Params
from ..result.errors import Interrupted, SimulationError
from ..result.exported import RESULTS, check_ending
from ..result.result import Result
from ..scenes.hard_scenes import HardScene
from .command_options import Asked
from .ending import BAD_INPUT, FAILED, INTERRUPTED, interruptible, reported, stop, warn

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_files(asked: Asked, endings: Iterable[str] = tuple(RESULTS)) -> None:
    """Stop before the run, which may take long, if a file could not be written after it."""
    named = {
        name: path
        for name in ("out", "plot", "animate", "checkpoint")
        if (path := getattr(asked, name, None)) is not None
    }
    for name, path in named.items():
        if name != "checkpoint":
            check_writable(path)
    for (one, path), (other, same) in combinations(named.items(), 2):
        if path == same:
            stop(f"--{one} and --{other} must not be the same file, {path}", BAD_INPUT)
    with reported():
        if "out" in named:
            check_ending(named["out"], endings)
        if path := named.get("plot"):
            check_figure("--plot", f"the ending of {path}", path.suffix[1:].lower())
        if "animate" in named:
            from ..plot.animation import film_writer

            film_writer(named["animate"])


def check_writable(path: Path, folder: bool = False) -> None:
    """Stop if this cannot be written, or files in this folder, which need not be there yet."""
    what = f"cannot write {'to ' if folder else ''}{path}"
    try:
        there = folder and path.exists()
        if there and not path.is_dir():
            stop(f"{what}: it is a file", BAD_INPUT)
        if not path.parent.is_dir():
            stop(f"{what}: there is no folder {path.parent}", BAD_INPUT)
        # Makes and removes a temporary file in the folder, as writing will.
        files.check_writable(path / "table.txt" if there else path)
    except OSError as error:
        stop(f"{what}: {error.strerror}", BAD_INPUT)


def check_figure(user: str, name: str, kind: str) -> None:
    """Check that matplotlib is there, and writes figures of a kind, which messages call so."""
    optional_module("matplotlib", user, "plot")
    from matplotlib.backend_bases import FigureCanvasBase

    one_of(name, kind, list(FigureCanvasBase.get_supported_filetypes()))


def write_files(*asked: tuple[Path | None, Callable[[Path], Any]]) -> str:
    """Write those of some files that were asked for, each by its function; return their names."""
    written = []
    for path, write in asked:
        if path is None:
            continue
        try:
            write(path)
        except OSError as error:
            stop(f"cannot write {path}: {error.strerror or error}", FAILED)
        written.append(str(path))
    return ", ".join(written)


def _write_result(asked: Asked, result: Result | None) -> str:
    """Write the files of a run, finished or not; return a line that lists them."""
    if result is None:
        return ""

    def draw(path: Path) -> None:
        from ..plot import overview

        save_figure(overview(result), path)

    def film(path: Path) -> None:
        from ..plot import animate

        shown = animate(result)
        hidden = asked.quiet or not sys.stderr.isatty()
        with click.progressbar(
            length=shown.frames, label="animating", file=sys.stderr, hidden=hidden
        ) as bar:
            shown.save(path, progress_callback=lambda _frame, _frames: bar.update(1))

    pictures = ((asked.plot, draw), (asked.animate, film)) if result.t.size else ()
    written = write_files((asked.out, result.save), *pictures)
    what = "" if result.success else " (up to that time)"
    return f"\nwritten{what}: {written}" if written else ""


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in one step, of the kind that the ending of the path names."""
    with files.replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


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
        written = _write_result(asked, ended.result)
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
            written = _write_result(asked, result)
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
