"""Names and lengths in pictures to scale: each can be read, on a screen and at print size."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pictures import SIZES, check_room

import beltdyn as bd

SCENES = ("serpentine", "conveyor", "crossed_belt", "tensioned_alternator")
RUNS: dict[str, bd.Result] = {}


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
