"""Animations as files and in notebooks."""

from __future__ import annotations

import base64
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.animation import (
    AbstractMovieWriter,
    FFMpegWriter,
    FuncAnimation,
    HTMLWriter,
    PillowWriter,
)
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..base import files

#: Endings of files an animation can be written to.
ENDINGS = ("gif", "mp4", "html")
#: Matplotlib silently drops the frames beyond its size limit; no animation is this large [MB].
_NO_LIMIT = 1e5


class Animation(FuncAnimation):
    """An animation of a drive, from :func:`animate` or :func:`animate_mode`.

    Attributes:
        fps: Frames per second.
        frames: Number of frames.
    """

    def __init__(
        self,
        figure: Figure,
        show: Callable[[np.int64], None],
        rows: NDArray[np.int64],
        fps: float,
    ) -> None:
        self.fps, self.frames = fps, len(rows)
        # The layout is kept as it is now, because it takes as long as drawing.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        drawn: Any = show  # of matplotlib it would return artists, for a way to draw not used here
        super().__init__(figure, drawn, frames=rows, interval=1e3 / fps)

    def save(
        self,
        filename: str | os.PathLike[str],
        writer: AbstractMovieWriter | str | None = None,
        *args: Any,
        **options: Any,
    ) -> None:
        """Write a GIF, an MP4 or an HTML file, by the ending of its name.

        Args:
            filename: The file; its ending is one of gif, mp4 and html.
            writer: One of matplotlib's, instead of that of the ending.
            *args: As of ``matplotlib.animation.Animation.save``.
            **options: As of ``matplotlib.animation.Animation.save``: ``dpi``,
                ``progress_callback(frame, n_frames)``.

        Raises:
            ValueError: Animations cannot be written with this ending.
            ImportError: An MP4 needs ffmpeg and there is none; the message says what to install.
            OSError: The file cannot be written; a file that was there before is unchanged.
        """
        if writer is None:
            fps = args[0] if args else options.get("fps")
            writer = film_writer(filename, self.fps if fps is None else fps)
        # A page of which the pictures are in a folder refers to that by its name.
        apart = not writer.embed_frames if isinstance(writer, HTMLWriter) else writer == "html"
        with nullcontext(Path(filename)) if apart else files.replacing(filename) as temporary:
            try:
                super().save(os.fspath(temporary), writer, *args, **options)
            except subprocess.CalledProcessError as error:
                said = str(error.stderr or "").strip().splitlines()
                why = said[-1] if said else f"exit code {error.returncode}"
                why = why.replace(os.fspath(temporary), os.fspath(filename))
                raise OSError(f"ffmpeg could not write {os.fspath(filename)}: {why}") from error

    def _repr_html_(self) -> str:
        """Show it in a notebook: as a video, or as single frames without ffmpeg."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "film.mp4"
            try:
                self.save(path)
            except ImportError:
                path = path.with_suffix(".html")
                self.save(path)
                return path.read_text(encoding="utf-8")
            video = base64.b64encode(path.read_bytes()).decode("ascii")
        source = f'<source type="video/mp4" src="data:video/mp4;base64,{video}">'
        return f"<video controls autoplay loop muted>{source}</video>"


class _FFMpeg(FFMpegWriter):
    """Finds ffmpeg on the PATH or in the package imageio-ffmpeg."""

    @classmethod
    def bin_path(cls) -> str:
        found = shutil.which(str(matplotlib.rcParams["animation.ffmpeg_path"]))
        if found:
            return found
        try:
            return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
        except (ImportError, RuntimeError):
            raise ImportError(
                "an MP4 needs ffmpeg: install it, or python -m pip install imageio-ffmpeg "
                "(or beltdyn[animation])"
            ) from None


def film_writer(path: str | os.PathLike[str], fps: float = 20.0) -> AbstractMovieWriter:
    """Return matplotlib's writer for an animation with this ending."""
    ending = Path(path).suffix[1:].lower()
    if ending not in ENDINGS:
        raise ValueError(f"the ending of {os.fspath(path)} must be one of {', '.join(ENDINGS)}")
    rate: Any = fps  # matplotlib's stubs require an int, its writers do not
    if ending == "gif":
        return PillowWriter(fps=rate)
    if ending == "mp4":
        _FFMpeg.bin_path()
        return _FFMpeg(fps=rate)
    return HTMLWriter(fps=rate, embed_frames=True, default_mode="loop", embed_limit=_NO_LIMIT)
