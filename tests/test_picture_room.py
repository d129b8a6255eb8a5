"""Names and lengths in pictures: each can be read, on a screen and at print size.

In the smallest size by default, a column of a journal.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from pictures import SIZED, SIZES, axes_of, check_room, over_lines
from tiers import first

import beltdyn as bd


def rims(params: bd.Params, ax: Axes) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii of the pulleys, in pixels."""
    unit = np.ptp(ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])[:, 0])
    radii = np.array([pulley.radius for pulley in params.pulleys])
    return ax.transData.transform(params.centers()), unit * radii


pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@cache
def short(name: str) -> bd.Result:
    params, torque, _, motion = getattr(bd.scenes, name)(n_bodies=100)
    return bd.simulate(params, torque, 1e-4, motion=motion, t_eval=np.array([0.0, 1e-4]))


@SIZED
@pytest.mark.parametrize(
    "scene", first(1, ["serpentine", "conveyor", "crossed_belt", "tensioned_alternator"])
)
def test_no_text_covers_another(scene: str, size: tuple[float, float, float]) -> None:
    """In the picture of a drive and in its layout, and names over an axis: each stands over its
    wrap, clear of the others and of the line, and leaves the line room.
    """
    result = short(scene)
    names = result.pulleys.names
    for draw in (bd.plot.drive, lambda r, ax: bd.plot.layout(r.params, ax=ax)):
        with axes_of(size) as ax:
            draw(result, ax=ax)
            check_room(ax.figure)
        words = " ".join(text.get_text() for text in ax.texts if text.get_visible())
        assert all(name in words.replace("\n", " ") for name in names)
    for draw in (bd.plot.tension_along, bd.plot.force_along_belt):
        with axes_of(size) as ax:
            draw(result, ax=ax)
            check_room(ax.figure)
            named = [text for text in ax.texts if text.get_text()]
            assert sorted(text.get_text() for text in named) == sorted(names)
            for text in named:
                box = Text.get_window_extent(text)
                x, _ = ax.transData.transform((text.xy[0], 0.0))
                assert box.x0 - 1.0 <= x <= box.x1 + 1.0, text.get_text()
                assert not over_lines(ax, box), text.get_text()
            assert ax.get_window_extent().height > 0.62 * ax.figure.bbox.height


def test_a_name_is_on_its_pulley_or_next_to_it() -> None:
    """Within the rim where it fits; never nearer to another pulley than to its own. Names stay
    where they were placed when the picture is drawn, for the room of title, legend and colour bar
    is known before.
    """
    with axes_of(SIZES[-1]) as ax:
        params = short("serpentine").params
        bd.plot.drive(short("serpentine"), ax=ax, links=0)
        before = ax.transData.transform(params.centers())
        ax.figure.draw_without_rendering()
        centers, radii = rims(params, ax)
        np.testing.assert_allclose(centers, before, atol=0.5)
        for k, name in enumerate(params.pulley_names):
            words = {text.get_text().replace("\n", " "): text for text in ax.texts}
            (text,) = [one for word, one in words.items() if word.startswith(name)]
            box = text.get_window_extent()
            gaps = np.hypot(*(centers - np.clip(centers, box.min, box.max)).T) - radii
            assert int(np.argmin(gaps)) == k, name
            if name == "crank":
                assert np.hypot(*(box.corners() - centers[k]).T).max() < radii[k]


@pytest.mark.ci(guard="test_picture_room.py::test_no_text_covers_another")
def test_names_of_a_mode_and_legends_of_an_overview() -> None:
    params = bd.scenes.serpentine(70).params
    modes = bd.modes(params, bd.settle(params), n=2, motion={"crank": 0.0})
    with axes_of(SIZES[0]) as ax:
        bd.plot.mode(modes, 1, ax=ax)
        check_room(ax.figure)
        # a name within a rim ends there: none overruns its pulley
        for pulley, middle, rim in zip(modes.params.pulleys, *rims(modes.params, ax), strict=True):
            (text,) = [one for one in ax.texts if one.get_text().replace("\n", " ") == pulley.name]
            box = text.get_window_extent()
            inside = np.hypot(*(box.corners() - middle).T).max() < rim
            nearest = np.clip(middle, box.min, box.max)
            assert inside or np.hypot(*(nearest - middle)) > rim, pulley.name
    with axes_of((6.7, 4.9, 8.0)) as given:
        figure = given.figure
        given.remove()
        bd.plot.overview(short("serpentine"), fig=figure)
        figure.draw_without_rendering()
        for ax in figure.axes[:2]:
            legend = ax.get_legend()
            assert len(legend.get_texts()) == 7
            assert not over_lines(ax, legend.get_window_extent())
    # the guide of a slider is left free, and its weight's arrow
    with axes_of(SIZES[0]) as ax:
        params = bd.scenes.conveyor().params
        bd.plot.layout(params, ax=ax)
        check_room(ax.figure)
        (name,) = [text for text in ax.texts if text.get_text().startswith("take-up")]
        (x, y), r = params.pulleys[2].center, params.pulleys[2].radius
        along = ax.transData.transform([(x, y + share * r) for share in np.linspace(1.6, -2.1, 60)])
        assert name.get_window_extent().count_contains(along) == 0


def test_headroom_on_a_logarithmic_axis() -> None:
    """Six rows of text take their height from the data, over whatever range of powers of ten."""
    with axes_of(SIZES[2]) as ax:
        ax.plot([0.0, 1.0], [1e-3, 1e6])
        ax.set_yscale("log")
        ax.figure.draw_without_rendering()
        row = 1.5 * FontProperties(size="small").get_size_in_points() * ax.figure.dpi / 72.0
        share = 7.0 * row / ax.get_window_extent().height
        bd.plot.style.leave_free(ax, share, above=True)
        ax.figure.draw_without_rendering()
        free = ax.get_window_extent().y1 - ax.transData.transform((1.0, 1e6))[1]
    assert 6.0 * row < free < 9.0 * row
