"""Animations of the running belt, for files and notebooks."""

from __future__ import annotations

import base64
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
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
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..base import files
from ..base.checks import positive
from ..result.result import Result
from . import style
from .history import span_tensions, speeds
from .panel import Indices, choice, draws
from .picture import DrivePicture

#: Endings of files an animation can be written to.
ENDINGS = ("gif", "mp4", "html")
_PANELS: dict[str, Any] = {"tensions": span_tensions, "speeds": speeds}
#: Matplotlib silently drops the frames beyond its size limit; no animation is this large [MB].
_NO_LIMIT = 1e5
#: Lines of which the legend stands beside their axes.
_FEW = 3
#: Height of a line of a legend below the axes [inch].
_LINE = 0.2


@draws()
def animate(
    result: Result,
    *,
    duration: float = 5.0,
    fps: float = 20.0,
    colour: str | None = "tension",
    panel: str | None = "tensions",
    arcs: bool = True,
    slip_from: float = 0.95,
    links: Indices | Mapping[str, int] | None = 0,
    limits: tuple[float, float] | None = None,
) -> Animation:
    """Animate the drive: the belt running, coloured by tension.

    A notebook shows it; ``.save("drive.gif")`` writes it, as does ``"drive.mp4"`` and
    ``"drive.html"``. The frames are samples of the run, equally spaced in time as nearly as the
    samples are; fewer samples than frames give fewer frames, each shown for longer. The title
    shows the time and by how much the animation is slower than the drive. An MP4 needs ffmpeg, or
    ``pip install imageio-ffmpeg``.

    Args:
        duration: Duration of the animation [s].
        fps: Frames per second. A frame of a GIF lasts whole hundredths of a second, so 10, 20, 25
            and 50 are exact.
        panel: What to draw below the drive over time: "tensions", "speeds" or None.
    """
    seconds, rate = positive("duration", duration, "s"), positive("fps", fps, "1/s")
    choice("panel", panel, (*_PANELS, None))
    rows = _frames(result, max(1, round(seconds * rate)))
    picture = DrivePicture(result, slice(None), colour, arcs, slip_from, links, limits)
    heights = [2.2, 1.0] if panel else [1.0]
    height = (4.4 if picture.wide else 5.2) + (1.2 if panel else 0.0)
    figure = style.new_figure(height=height, own=True)
    drive_axes, *below = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[
        :, 0
    ]
    picture.draw(drive_axes)
    picture.move(int(rows[0]))
    pace = _pace(seconds, float(result.t[-1] - result.t[0]))
    digits = _digits(result.t[rows])
    title = drive_axes.set_title(" ", fontsize="medium")
    marks = []
    for ax in below:
        _PANELS[str(panel)](result, ax=ax)
        _legend_outside(figure, ax)
        marks.append(ax.axvline(result.t[rows[0]], color="0.25", linewidth=1.0))
    picture.add_legend(drive_axes)

    def show(row: np.int64) -> list[Artist]:
        now = float(result.t[row])
        title.set_text(f"t = {now:.{digits}f} s   ({pace})")
        for mark in marks:
            mark.set_xdata([now, now])
        return [*picture.move(int(row)), title, *marks]

    return Animation(figure, show, rows, len(rows) / seconds)


def _legend_outside(figure: Figure, ax: Axes) -> None:
    """Put the legend beside the axes, one of many lines below all, so that the drive is large."""
    ax.autoscale(axis="y")  # without the room for a legend above the data
    handles, names = ax.get_legend_handles_labels()
    if len(handles) <= _FEW:
        style.legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return
    if legend := ax.get_legend():
        legend.remove()
    look: dict[str, Any] = {"fontsize": "small", "frameon": False, "ncols": 2}
    figure.legend(handles, names, loc="outside lower center", **look)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + _LINE * (-(-len(handles) // 2)))


def _frames(result: Result, count: int) -> NDArray[np.int64]:
    """Choose the samples nearest to equally spaced times."""
    t = result.t
    times = np.linspace(t[0], t[-1], min(count, t.size))
    after = np.clip(np.searchsorted(t, times), 1, max(t.size - 1, 1))
    nearer = times - t[after - 1] <= t[np.minimum(after, t.size - 1)] - times
    return np.where(nearer, after - 1, after).clip(0, t.size - 1).astype(np.int64)


def _pace(film: float, run: float) -> str:
    if run <= 0.0:
        return "one moment"
    ratio = film / run
    if 0.95 < ratio < 1.05:
        return "real time"
    return f"{ratio:.2g}x slower" if ratio > 1.0 else f"{1.0 / ratio:.2g}x faster"


def _digits(times: NDArray[np.float64]) -> int:
    """Decimals needed to distinguish the times of successive frames."""
    step = (times[-1] - times[0]) / max(len(times) - 1, 1)
    return int(np.clip(np.ceil(-np.log10(step)) if step > 0.0 else 3, 0, 9))


# --- writing -------------------------------------------------------------------------------------


class Animation(FuncAnimation):
    """An animation of a drive, from :func:`animate`.

    Attributes:
        fps: Frames per second.
        frames: Number of frames.
    """

    def __init__(
        self,
        figure: Figure,
        show: Callable[[np.int64], list[Artist]],
        rows: NDArray[np.int64],
        fps: float,
    ) -> None:
        self.fps, self.frames = fps, len(rows)
        # The layout is kept as it is now, because it takes as long as drawing.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        super().__init__(figure, show, frames=rows, interval=1e3 / fps)

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
