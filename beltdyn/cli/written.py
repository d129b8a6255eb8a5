"""The files that a command writes: checked before it runs, written after it."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from ..base import files
from ..drive.params import Params
from ..result.exported import RESULTS, check_ending
from ..result.result import Result
from .ending import BAD_INPUT, FAILED, stop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "Outputs",
    "check_out",
    "check_writable",
    "draw_layout",
    "figure_kinds",
    "need_matplotlib",
    "save_figure",
]


def check_writable(path: Path) -> None:
    """Check before the run, which may take long, that the file can be written after it."""
    folder = path.parent
    if not folder.is_dir():
        stop(f"cannot write {path}: there is no folder {folder}", BAD_INPUT)
    if path.is_dir():
        stop(f"cannot write {path}: it is a folder", BAD_INPUT)
    # Makes and removes a temporary file in the folder, as writing will.
    files.check_writable(path)


def check_out(path: Path, endings: Iterable[str]) -> None:
    """Stop unless --out has one of these endings, and what writes it is installed."""
    try:
        check_ending(path, endings)
    except (ValueError, ImportError) as error:
        stop(f"--out: {error}", BAD_INPUT)


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


def _check_plot(path: Path) -> None:
    need_matplotlib("--plot")
    kinds = figure_kinds()
    if path.suffix[1:].lower() not in kinds:
        stop(f"cannot plot to {path}: its ending must be one of {', '.join(kinds)}", BAD_INPUT)


def _check_film(path: Path) -> None:
    try:
        from ..plot.animation import film_writer

        film_writer(path)
    except ImportError as error:
        stop(f"--animate {path}: {error}", BAD_INPUT)
    except ValueError as error:
        stop(f"--animate: {error}", BAD_INPUT)


class Outputs(NamedTuple):
    """The files that were asked for."""

    out: Path | None
    plot: Path | None
    animate: Path | None
    quiet: bool
    checkpoint: Path | None = None
    endings: tuple[str, ...] = tuple(RESULTS)

    def check(self) -> None:
        """Stop before the run if a file could not be written after it."""
        named = {
            option: path
            for option, path in (
                ("--out", self.out),
                ("--plot", self.plot),
                ("--animate", self.animate),
                ("--checkpoint", self.checkpoint),
            )
            if path is not None
        }
        for path in (path for option, path in named.items() if option != "--checkpoint"):
            try:
                check_writable(path)
            except OSError as error:
                stop(f"cannot write {path}: {error.strerror}", BAD_INPUT)
        for (one, path), (other, same) in combinations(named.items(), 2):
            if path == same:
                stop(f"{one} and {other} must not be the same file, {path}", BAD_INPUT)
        if self.out is not None:
            check_out(self.out, self.endings)
        if self.plot is not None:
            _check_plot(self.plot)
        if self.animate is not None:
            _check_film(self.animate)

    def write(self, result: Result | None) -> str:
        """Write them; return a line that lists what was written."""
        if result is None:
            return ""
        drawable = result.t.size > 0
        written = []
        for path, write in (
            (self.out, result.save),
            (self.plot if drawable else None, lambda path: _draw(result, path)),
            (self.animate if drawable else None, lambda path: _film(result, path, self.quiet)),
        ):
            if path is None:
                continue
            try:
                write(path)
            except OSError as error:
                stop(f"cannot write {path}: {error.strerror or error}", FAILED)
            written.append(str(path))
        what = "" if result.success else " (up to that time)"
        return f"\nwritten{what}: {', '.join(written)}" if written else ""


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in one step, of the kind that the ending of the path names."""
    with files.replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


def _draw(result: Result, path: Path) -> None:
    from ..plot import overview

    save_figure(overview(result), path)


def draw_layout(params: Params, path: Path) -> None:
    """Write a figure of pulleys and belt line."""
    from ..plot import layout
    from ..plot.style import new_figure

    figure = new_figure()
    layout(params, ax=figure.add_subplot())
    save_figure(figure, path)


def _film(result: Result, path: Path, quiet: bool) -> None:
    from ..plot import animate

    film = animate(result)
    hidden = quiet or not sys.stderr.isatty()
    with click.progressbar(
        length=film.frames, label="animating", file=sys.stderr, hidden=hidden
    ) as bar:
        film.save(path, progress_callback=lambda _frame, _frames: bar.update(1))
