"""The files that a command writes: checked before it runs, written after it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base import files
from ..result.exported import RESULTS, check_ending
from ..result.result import Result
from .command_options import Asked
from .ending import BAD_INPUT, FAILED, stop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "check_files",
    "figure_kinds",
    "need_matplotlib",
    "save_figure",
    "write_files",
    "write_result",
]


def check_files(asked: Asked, endings: Iterable[str] = tuple(RESULTS)) -> None:
    """Stop before the run, which may take long, if a file could not be written after it."""
    named = {
        name: path
        for name in ("out", "plot", "animate", "checkpoint")
        if (path := getattr(asked, name, None)) is not None
    }
    for name, path in named.items():
        if name != "checkpoint":
            _check_writable(path)
    for (one, path), (other, same) in combinations(named.items(), 2):
        if path == same:
            stop(f"--{one} and --{other} must not be the same file, {path}", BAD_INPUT)
    try:
        if "out" in named:
            check_ending(named["out"], endings)
    except (ValueError, ImportError) as error:
        stop(f"--out: {error}", BAD_INPUT)
    if "plot" in named:
        need_matplotlib("--plot")
        path, kinds = named["plot"], figure_kinds()
        if path.suffix[1:].lower() not in kinds:
            stop(f"cannot plot to {path}: its ending must be one of {', '.join(kinds)}", BAD_INPUT)
    if "animate" in named:
        _check_film(named["animate"])


def _check_writable(path: Path) -> None:
    try:
        if not path.parent.is_dir():
            stop(f"cannot write {path}: there is no folder {path.parent}", BAD_INPUT)
        if path.is_dir():
            stop(f"cannot write {path}: it is a folder", BAD_INPUT)
        # Makes and removes a temporary file in the folder, as writing will.
        files.check_writable(path)
    except OSError as error:
        stop(f"cannot write {path}: {error.strerror}", BAD_INPUT)


def need_matplotlib(what: str) -> None:
    """Stop if it is not installed, which `what` needs."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        stop(
            f"{what} needs matplotlib: python -m pip install matplotlib (or beltdyn[plot])",
            BAD_INPUT,
        )


def figure_kinds() -> list[str]:
    """Return the endings that a figure may have."""
    from matplotlib.backend_bases import FigureCanvasBase

    return list(FigureCanvasBase.get_supported_filetypes())


def _check_film(path: Path) -> None:
    try:
        from ..plot.animation import film_writer

        film_writer(path)
    except ImportError as error:
        stop(f"--animate {path}: {error}", BAD_INPUT)
    except ValueError as error:
        stop(f"--animate: {error}", BAD_INPUT)


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


def write_result(asked: Asked, result: Result | None) -> str:
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
