"""What the tests of pictures share: sizes on screen and in print, and whether texts have room."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib
import pytest
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import BboxBase
from tiers import first

#: Width and height [inch] and font size [pt]: a column of 8.5 cm, a page of 17 cm, a screen.
SIZES = ((3.35, 2.9, 8.0), (6.7, 3.8, 9.0), (6.4, 4.0, 10.0))
#: Tests at each of them; the tightest by default.
SIZED = pytest.mark.parametrize("size", first(1, zip(SIZES)))


@contextmanager
def axes_of(size: tuple[float, float, float]) -> Iterator[Axes]:
    """Axes of a figure of a size, to be drawn into and measured while its font size holds."""
    width, height, points = size
    with matplotlib.rc_context({"font.size": points}):
        yield Figure(figsize=(width, height), layout="constrained").add_subplot()


def ticks(axis: Axis) -> list[Text]:
    """Return the numbers along an axis that are drawn: not those outside its limits."""
    low, high = sorted(axis.get_view_interval())
    return [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]


def texts(ax: Axes) -> list[Text]:
    """Return the texts of axes that are drawn, but for the legend's."""
    found = [*ax.texts, *ticks(ax.xaxis), *ticks(ax.yaxis), ax.title]
    found += [ax.xaxis.label, ax.yaxis.label]
    return [text for text in found if text.get_visible() and text.get_text()]


def labels(ax: Axes) -> list[str]:
    """Return the entries of the legend."""
    legend = ax.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def over_lines(ax: Axes, box: BboxBase) -> bool:
    """Whether a line of the axes, its points joined, runs through a box."""
    paths = (line.get_transform().transform_path(line.get_path()) for line in ax.lines)
    return any(path.intersects_bbox(box, filled=False) for path in paths)


def check_room(figure: Figure) -> None:
    """Check that no text or legend lies over another or reaches beyond the figure."""
    figure.draw_without_rendering()
    boxes = []
    for ax in figure.axes:
        boxes += [(text.get_text(), text.get_window_extent()) for text in texts(ax)]
        legend = ax.get_legend()
        if legend is not None:
            boxes.append(("the legend", legend.get_window_extent()))
    for k, (word, box) in enumerate(boxes):
        assert box.x0 >= -1.0 and box.x1 <= figure.bbox.x1 + 1.0, f"{word!r} is cut off"
        assert box.y0 >= -1.0 and box.y1 <= figure.bbox.y1 + 1.0, f"{word!r} is cut off"
        for other, beside in boxes[:k]:
            assert not box.overlaps(beside.padded(-0.5)), f"{word!r} lies over {other!r}"
