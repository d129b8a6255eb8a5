"""Names and lengths in pictures: each can be read, on a screen and at print size."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from pictures import SIZES, check_room, over_lines

import beltdyn as bd

SCENES = ("serpentine", "conveyor", "crossed_belt", "tensioned_alternator")
RUNS: dict[str, bd.Result] = {}
MODES: dict[str, bd.Modes] = {}


def short(name: str) -> bd.Result:
    if name not in RUNS:
        params, torque, _, motion = getattr(bd.scenes, name)()
        times = np.array([0.0, 1e-4])
        RUNS[name] = bd.simulate(params, torque, 1e-4, motion=motion, t_eval=times)
    return RUNS[name]


def drawn(kind: str, scene: str, ax: Axes) -> None:
    if kind == "drive":
        bd.plot.drive(short(scene), ax=ax)
    else:
        bd.plot.layout(getattr(bd.scenes, scene)().params, ax=ax)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("kind", ["drive", "layout"])
def test_no_text_covers_another(kind: str, scene: str, size: tuple[float, float, float]) -> None:
    width, height, points = size
    with matplotlib.rc_context({"font.size": points}):
        figure = Figure(figsize=(width, height), layout="constrained")
        ax = figure.add_subplot()
        drawn(kind, scene, ax)
        check_room(figure)
    words = " ".join(text.get_text() for text in ax.texts if text.get_visible())
    names = getattr(bd.scenes, scene)().params.pulley_names
    assert all(name in words.replace("\n", " ") for name in names)


def test_a_name_is_on_its_pulley_or_next_to_it() -> None:
    """Within the rim where it fits; never nearer to another pulley than to its own."""
    ax = Figure(figsize=(6.4, 4.0), layout="constrained").add_subplot()
    params = bd.scenes.serpentine().params
    bd.plot.layout(params, ax=ax)
    ax.figure.draw_without_rendering()
    centers = ax.transData.transform(params.centers())
    unit = ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])[:, 0]
    rims = np.array([pulley.radius for pulley in params.pulleys]) * (unit[1] - unit[0])
    for k, name in enumerate(params.pulley_names):
        words = {text.get_text().replace("\n", " "): text for text in ax.texts}
        (text,) = [one for word, one in words.items() if word.startswith(name)]
        box = text.get_window_extent()
        gaps = np.hypot(*(centers - np.clip(centers, box.min, box.max)).T) - rims
        assert int(np.argmin(gaps)) == k, name
        if name == "crank":
            corners = np.hypot(*(box.corners() - centers[k]).T)
            assert corners.max() < rims[k]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scene", ["serpentine", "conveyor", "crossed_belt"])
@pytest.mark.parametrize("kind", ["tension_along", "force_along_belt"])
def test_names_over_an_axis(kind: str, scene: str, size: tuple[float, float, float]) -> None:
    """Each stands over its wrap, clear of the others and of the line, and leaves the line room."""
    width, height, points = size
    result = short(scene)
    with matplotlib.rc_context({"font.size": points}):
        figure = Figure(figsize=(width, height), layout="constrained")
        ax = figure.add_subplot()
        getattr(bd.plot, kind)(result, ax=ax)
        check_room(figure)
        named = [text for text in ax.texts if text.get_text()]
        assert sorted(text.get_text() for text in named) == sorted(result.pulleys.names)
        for text in named:
            box = Text.get_window_extent(text)
            x, _ = ax.transData.transform((text.xy[0], 0.0))
            assert box.x0 - 1.0 <= x <= box.x1 + 1.0, text.get_text()
            assert not over_lines(ax, box), text.get_text()
        assert ax.get_window_extent().height > 0.62 * figure.bbox.height


@pytest.mark.parametrize("size", SIZES)
def test_names_and_title_of_a_mode(size: tuple[float, float, float]) -> None:
    params = bd.scenes.serpentine(70).params
    if "mode" not in MODES:
        MODES["mode"] = bd.modes(params, bd.settle(params), n=2, motion={"crank": 0.0})
    width, height, points = size
    with matplotlib.rc_context({"font.size": points}):
        figure = Figure(figsize=(width, height), layout="constrained")
        ax = figure.add_subplot()
        bd.plot.mode(MODES["mode"], 1, ax=ax)
        check_room(figure)
        # a name within a rim ends there: none overruns its pulley
        unit = np.ptp(ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])[:, 0])
        for k, pulley in enumerate(params.pulleys):
            (text,) = [one for one in ax.texts if one.get_text().replace("\n", " ") == pulley.name]
            middle = ax.transData.transform(params.centers()[k])
            box, rim = text.get_window_extent(), unit * pulley.radius
            inside = np.hypot(*(box.corners() - middle).T).max() < rim
            nearest = np.clip(middle, box.min, box.max)
            assert inside or np.hypot(*(nearest - middle)) > rim, pulley.name


@pytest.mark.parametrize("size", SIZES)
def test_a_name_leaves_the_guide_of_a_slider_free(size: tuple[float, float, float]) -> None:
    width, height, points = size
    with matplotlib.rc_context({"font.size": points}):
        ax = Figure(figsize=(width, height), layout="constrained").add_subplot()
        params = bd.scenes.conveyor().params
        bd.plot.layout(params, ax=ax)
        ax.figure.draw_without_rendering()
        (name,) = [text for text in ax.texts if text.get_text().startswith("take-up")]
        (x, y), r = params.pulleys[2].center, params.pulleys[2].radius
        # the guide, to 1.6 radii up and down, and the arrow of the weight below it
        along = ax.transData.transform([(x, y + share * r) for share in np.linspace(1.6, -2.1, 60)])
        assert name.get_window_extent().count_contains(along) == 0


def test_names_stay_where_they_were_placed_when_the_picture_is_drawn() -> None:
    """The room of title, legend and colour bar is known before: names within rims end there."""
    result = short("serpentine")
    ax = Figure(figsize=(6.4, 4.0), layout="constrained").add_subplot()
    bd.plot.drive(result, ax=ax, links=0)
    before = ax.transData.transform(result.params.centers())
    ax.figure.draw_without_rendering()
    after = ax.transData.transform(result.params.centers())
    np.testing.assert_allclose(after, before, atol=0.5)


def test_headroom_on_a_logarithmic_axis() -> None:
    """Six rows of text take their height from the data, over whatever range of powers of ten."""
    ax = Figure(figsize=(6.4, 4.0), layout="constrained").add_subplot()
    ax.plot([0.0, 1.0], [1e-3, 1e6])
    ax.set_yscale("log")
    ax.figure.draw_without_rendering()
    bd.plot.style.add_headroom(ax, rows=6)
    ax.figure.draw_without_rendering()
    free = ax.get_window_extent().y1 - ax.transData.transform((1.0, 1e6))[1]
    row = 1.5 * FontProperties(size="small").get_size_in_points() * ax.figure.dpi / 72.0
    assert 6.0 * row < free < 9.0 * row


@pytest.mark.parametrize("size", [(10.0, 7.0, 10.0), (6.7, 4.9, 8.0)])
def test_legends_of_an_overview_cover_no_line(size: tuple[float, float, float]) -> None:
    width, height, points = size
    with matplotlib.rc_context({"font.size": points}):
        figure = Figure(figsize=(width, height), layout="constrained")
        bd.plot.overview(short("serpentine"), fig=figure)
        figure.draw_without_rendering()
        for ax in figure.axes[:2]:
            legend = ax.get_legend()
            assert len(legend.get_texts()) == 7
            assert not over_lines(ax, legend.get_window_extent())
