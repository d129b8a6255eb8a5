"""Films: which samples they show, what is told on them, and that the files can be played."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import attrs
import imageio_ffmpeg
import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from PIL import Image

import beltdyn as bd
from beltdyn.plot.animation import film_writer
from beltdyn.plot.picture import _frames, _pace

N_T, T_END = 41, 0.3


@pytest.fixture(scope="module")
def result() -> bd.Result:
    params, torque, *_ = bd.scenes.kubas_case_1()
    return bd.simulate(params, torque, T_END, t_eval=np.linspace(0.0, T_END, N_T))


def thinned(result: bd.Result, rows: Any) -> bd.Result:
    """Return the result with some of its samples."""
    parts = {}
    for name in ("pulleys", "belt", "joints", "contact", "energy"):
        group = getattr(result, name)
        parts[name] = attrs.evolve(group, **{k: v[rows] for k, v in group.arrays().items()})
    return attrs.evolve(result, t=result.t[rows], **parts)


def rows(film: bd.plot.Animation) -> list[int]:
    film._draw_was_started = True  # drawn here, not by an event loop
    return [int(row) for row in film.new_frame_seq()]


def shown(film: bd.plot.Animation, frame: int) -> Any:
    """Show one frame; give the figure."""
    film._func(rows(film)[frame])
    return film._fig


def test_frames_are_samples_equally_spaced(result: bd.Result) -> None:
    # fewer samples than frames keep the duration
    film = bd.plot.animate(result, duration=3.0, fps=50.0, panel="speeds", colour="friction")
    assert film.frames == N_T and film.fps == pytest.approx(N_T / 3.0)
    assert rows(film) == list(range(N_T))
    titles = [shown(film, k).axes[0].get_title() for k in (0, 1, 2, N_T - 1)]
    assert len(set(titles)) == 4, "every frame tells another time"
    assert "t = 0.3" in titles[-1] and "10x slower" in titles[-1]
    assert any("angular velocity" in ax.get_ylabel() for ax in film._fig.axes)
    # of uneven samples the frames are those nearest to 0, 0.1, 0.2 and 0.3 s
    assert _frames(thinned(result, [0, 2, 3, 4, 40]), 4).tolist() == [0, 3, 4, 4]
    film = bd.plot.animate(thinned(result, [0]), duration=1.0, panel=None, colour=None)
    (ax,) = shown(film, 0).axes
    assert rows(film) == [0] and "one moment" in ax.get_title()
    with pytest.raises(ValueError, match="result must hold at least one sample"):
        bd.plot.animate(thinned(result, []))
    # a frame is its sample
    film = bd.plot.animate(result, duration=1.0, fps=11.0, links={"chosen": 7})
    assert film.frames == 11 and film.fps == 11.0
    assert rows(film) == list(range(0, 41, 4))
    limits = set()
    for frame, row in ((0, 0), (5, 20), (10, 40)):
        figure = shown(film, frame)
        force = result.joints.force[row]
        lines = [one for one in figure.axes[0].collections if isinstance(one, LineCollection)][-1]
        np.testing.assert_array_equal(lines.get_array(), (force + np.roll(force, -1)) / 2)
        limits.add(lines.get_clim())
        (panel,) = [ax for ax in figure.axes if "span tension" in ax.get_ylabel()]
        np.testing.assert_array_equal(panel.lines[-1].get_xdata(), [result.t[row]] * 2)
        mark = figure.axes[0].lines[-1]
        assert mark.get_xdata()[0] == result.belt.x[row, 7]
    force = result.joints.force
    tension = (force + np.roll(force, -1, axis=1)) / 2
    assert limits == {(tension.min(), tension.max())}, "one scale for the whole run"
    paces = {3.0: "10x slower", 0.3: "real time", 0.15: "2x faster", 5.0: "17x slower"}
    assert {duration: _pace(duration, T_END) for duration in paces} == paces
    # a run that failed can be filmed as far as it came
    half = attrs.evolve(thinned(result, slice(7)), success=False, status="failed")
    assert rows(bd.plot.animate(half, duration=1.0, fps=4.0)) == [0, 2, 4, 6]


@pytest.fixture(scope="module")
def short(result: bd.Result) -> bd.plot.Animation:
    return bd.plot.animate(result, duration=0.5, fps=10.0)


def test_gif(short: bd.plot.Animation, tmp_path: Path) -> None:
    """Writing it changes nothing global."""
    path, before = tmp_path / "drive.GIF", dict(matplotlib.rcParams)
    seen = []
    short.save(path, dpi=40, progress_callback=lambda k, n: seen.append((k, n)))
    with Image.open(path) as image:
        assert image.format == "GIF" and image.n_frames == 5
        assert image.info["duration"] == 100, "ms: ten frames per second"
        assert image.info["loop"] == 0, "for ever"
    assert seen == [(k, 5) for k in range(5)]
    assert dict(matplotlib.rcParams) == before


@pytest.mark.ci(guard="test_animation.py::test_gif")
def test_mp4(short: bd.plot.Animation, tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    short.save(path, dpi=41)  # an odd number of pixels, which H.264 does not take
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    # The container counts in fractions of a frame, 0.1 s.
    assert frames == 5 and seconds == pytest.approx(0.5, abs=0.05)
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    decode = [ffmpeg, "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    raw = subprocess.run(decode, capture_output=True, check=True, timeout=60)
    assert raw.stderr == b""
    pictures = np.frombuffer(raw.stdout, dtype=np.uint8).reshape(5, -1)
    assert (pictures[0] != pictures[-1]).any()


@pytest.mark.ci(guard="test_animation.py::test_what_ffmpeg_says_comes_out")
def test_without_ffmpeg(
    short: bd.plot.Animation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A notebook shows single pictures in place of a video; an MP4 says what to install."""
    assert short._repr_html_().startswith("<video controls")
    monkeypatch.setattr(shutil, "which", lambda *_: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert short._repr_html_().count("data:image/png;base64") == 5
    short.save(tmp_path / "drive.html", dpi=40)
    text = (tmp_path / "drive.html").read_text()
    assert text.count("data:image/png;base64") == 5 and "<script" in text
    assert [entry.name for entry in tmp_path.iterdir()] == ["drive.html"], "all in one file"
    with pytest.raises(ImportError, match=r"pip install imageio-ffmpeg \(or beltdyn\[animation\]"):
        short.save(tmp_path / "drive.mp4")
    assert not (tmp_path / "drive.mp4").exists()
    film_writer("drive.gif")
    film_writer("drive.html")


def test_what_ffmpeg_says_comes_out(
    short: bd.plot.Animation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, result: bd.Result
) -> None:
    """An ffmpeg that fails: its words in an OSError, no traceback of a subprocess. And what else
    cannot be written.
    """
    script = tmp_path / "ffmpeg"
    script.write_text("#!/bin/sh\ncat >/dev/null\necho 'no such encoder' >&2\nexit 1\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    with pytest.raises(OSError, match=r"ffmpeg could not write .*drive.mp4: no such encoder"):
        short.save(tmp_path / "drive.mp4", dpi=40)
    with pytest.raises(ValueError, match=r"drive.avi must be one of gif, mp4, html"):
        short.save(tmp_path / "drive.avi")
    for ending in ("gif", "mp4", "html"):
        with pytest.raises(FileNotFoundError):
            short.save(tmp_path / "none" / f"drive.{ending}")
    # none that could fail
    monkeypatch.setattr(shutil, "which", lambda *_: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ImportError, match=r"pip install imageio-ffmpeg \(or beltdyn\[animation\]"):
        short.save(tmp_path / "drive.mp4")
    # bad arguments
    options: dict[str, Any]
    for options, kind, message in (
        ({"duration": 0}, ValueError, "duration must be > 0"),
        ({"duration": "1"}, TypeError, "duration must be a real number"),
        ({"fps": -1}, ValueError, "fps must be > 0"),
        ({"fps": float("nan")}, ValueError, "fps must be finite"),
        ({"colour": "speed"}, ValueError, "colour must be one of 'tension', 'friction', None"),
        ({"panel": "x"}, ValueError, "panel must be one of 'tensions', 'speeds', None"),
        ({"links": [60]}, ValueError, r"links\[0\] must be an integer from 0 to 59"),
        ({"limits": 3}, TypeError, "limits must be a pair"),
    ):
        with pytest.raises(kind, match=message):
            bd.plot.animate(result, **options)
