"""Pictures of sweeps: values where they belong, failed runs marked and counted, room for texts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import swept
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, PathCollection, QuadMesh
from matplotlib.colors import to_rgb
from matplotlib.contour import QuadContourSet
from pictures import SIZES, axes_of, check_room
from pictures import labels as legend
from scipy import stats

import beltdyn as bd
from beltdyn.plot.swept import FAILED_LOOKS, scale_of
from beltdyn.sweeping.names import in_words

PRELOADS = np.array([250.0, 300.0, 350.0, 400.0, 500.0, 600.0, 800.0])
FRICTIONS = np.linspace(0.3, 1.0, 8)
STIFFNESSES = np.geomspace(1e8, 1e11, 7)
LAWS = ["dahl", "lugre", "coulomb"]


def capacity(preload: float, mu: float) -> float:
    return 0.2 * preload * np.tanh(1.5 * mu)


def over_grid(value: Callable[..., Any] = capacity) -> xr.Dataset:
    return swept.of_grid({"belt.preload": PRELOADS, "friction.mu_k": FRICTIONS}, value)


def grid() -> xr.Dataset:
    """Runs that failed in every way, in corners and in the middle."""
    data = over_grid()
    for k in range(3):
        swept.fail(data, "failed", belt__preload=k, friction__mu_k=0)
    for k, status in enumerate(("refused", "measure", "lost", "missing")):
        swept.fail(data, status, belt__preload=6, friction__mu_k=7 - k)
    data["q"][3, 4] = np.nan
    return data


def cube() -> xr.Dataset:
    over = {"belt.preload": PRELOADS, "friction.mu_k": FRICTIONS, "contact.quadratic": STIFFNESSES}
    return swept.of_grid(over, lambda a, b, c: capacity(a, b) * np.log10(c))


def of_laws() -> xr.Dataset:
    over = {"contact.quadratic": STIFFNESSES, "friction.kind": LAWS}
    data = swept.of_grid(over, lambda c, law: len(law) * np.log10(c))
    swept.fail(data, "lost", contact__quadratic=2, friction__kind=1)
    return data


def histories() -> xr.Dataset:
    data = swept.of_grid({"belt.preload": PRELOADS, "friction.mu_k": FRICTIONS[:3]}, capacity)
    t = np.linspace(0.0, 0.5, 101)
    curves = data["q"].values[:, :, None] * (1.0 - np.exp(-20.0 * t))
    dims = ("belt.preload", "friction.mu_k", "time")
    data["curve"] = (dims, curves, {"units": "N", "long_name": "tension of crank to alternator"})
    data = data.assign_coords(time=("time", t, {"units": "s", "long_name": "time"}))
    swept.fail(data, "failed", belt__preload=2, friction__mu_k=1)
    return data


def sampled(n: int = 64) -> xr.Dataset:
    ranges = {
        "belt.preload": stats.norm(400.0, 30.0),
        "contact.quadratic": stats.loguniform(1e8, 1e11),
        "friction.mu_k": (0.3, 0.8),
    }
    samples = bd.sample(ranges, n)
    data = swept.of_samples(samples, samples.values[:, 0] * samples.values[:, 2])
    swept.fail(data, "failed", run=slice(0, 5))
    swept.fail(data, "refused", run=slice(7, 9))
    return data


def by_pulley() -> xr.Dataset:
    data = swept.of_grid({"belt.preload": PRELOADS}, lambda preload: preload)
    both = np.stack([PRELOADS, 2.0 * PRELOADS], axis=1)
    data["load"] = (("belt.preload", "pulley"), both, {"units": "N", "long_name": "hub load"})
    return data.assign_coords(pulley=["crank", "alternator"])


def one(ax: Axes, kind: type) -> Any:
    (found,) = [item for item in ax.collections if isinstance(item, kind)]
    return found


def ticks(axis: Any) -> list[str]:
    return [text.get_text() for text in axis.get_ticklabels()]


def cells(ax: Axes) -> Any:
    """Values of a map, NaN where there are none."""
    return one(ax, QuadMesh).get_array().filled(np.nan)


def lightness(colours: Any) -> Any:
    return np.array([to_rgb(one) for one in colours]) @ [0.2126, 0.7152, 0.0722]


def test_cells_hold_the_values_and_lie_round_their_places(tmp_path: Any) -> None:
    """Whichever way round, in whatever order, from a file as well; parameters stand at axes without
    the numbers of their equations.
    """
    data = grid()
    unit, text = in_words(bd.scenes.kubas_case_1(), "friction.mu_k")
    assert text.endswith("(2.9)")
    data["friction.mu_k"].attrs = {"units": unit, "long_name": text}
    data["q"].attrs["long_name"] = "torque of run (2) in figure (a.1)"
    ax = bd.plot.map(data, "q")
    np.testing.assert_array_equal(cells(ax), data["q"].values.T)
    corners = one(ax, QuadMesh).get_coordinates()
    np.testing.assert_allclose(corners[0, :, 0], [225, 275, 325, 375, 450, 550, 700, 900])
    np.testing.assert_allclose(corners[:, 0, 1], np.linspace(0.25, 1.05, 9))
    assert ax.get_xlabel() == "preload [N]"
    assert ax.get_ylabel() == "kinetic friction coefficient [1]"
    assert ax.figure.axes[-1].get_ylabel() == "torque of run (2) in figure (a.1) [N m]"
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "linear")
    for turned in ({"x": "friction.mu_k"}, {"y": "belt.preload"}):
        other = bd.plot.map(data, "q", **turned)
        np.testing.assert_array_equal(cells(other), data["q"].values)
        assert other.get_xlabel() == "kinetic friction coefficient [1]"
    order = {"belt.preload": [3, 0, 6, 1, 5, 2, 4], "friction.mu_k": slice(None, None, -1)}
    data.isel(order).to_netcdf(tmp_path / "sweep.nc")
    with xr.open_dataset(tmp_path / "sweep.nc") as read:
        mixed = bd.plot.map(read, "q")
        assert legend(mixed) == legend(ax)
        np.testing.assert_array_equal(cells(mixed), cells(ax))
        np.testing.assert_allclose(one(mixed, QuadMesh).get_coordinates(), corners)


def test_failed_runs_are_hatched_and_counted() -> None:
    """So are values without end, as margins of pulleys that no load makes slip."""
    ax = bd.plot.map(grid(), "q")
    assert legend(ax) == [
        "refused: 1 run",
        "failed: 3 runs",
        "no measure: 1 run",
        "worker lost: 1 run",
        "not computed: 1 run",
        "no value: 1 run",
    ]
    hatched = [item for item in ax.collections if isinstance(item, PatchCollection)]
    assert [item.get_hatch() for item in hatched] == [
        look[0] or None for name, look in FAILED_LOOKS.items() if name != "infinite"
    ]
    failed = [path.get_extents() for path in hatched[1].get_paths()]
    edges = one(ax, QuadMesh).get_coordinates()[0, :, 0]
    assert [(cell.x0, cell.x1) for cell in failed] == [tuple(edges[k : k + 2]) for k in range(3)]
    np.testing.assert_allclose([(cell.y0, cell.y1) for cell in failed], [(0.25, 0.35)] * 3)
    data = grid()
    swept.fail(data, "failed", belt__preload=slice(None), friction__mu_k=slice(None))
    ax = bd.plot.map(data, "q")
    assert legend(ax) == ["failed: 56 runs"] and len(ax.figure.axes) == 1
    data = over_grid(lambda a, mu: np.inf if a > 500.0 and mu > 0.9 else capacity(a, mu))
    for draw in (bd.plot.map, bd.plot.lines):
        assert legend(draw(data, "q"))[-1] == "without end: 2 runs"


def test_geometric_values_have_a_logarithmic_axis() -> None:
    data = of_laws()
    ax = bd.plot.map(data, "q")
    assert ax.get_xscale() == "log" and ax.get_yscale() == "linear"
    edges = one(ax, QuadMesh).get_coordinates()[0, :, 0]
    np.testing.assert_allclose(edges, np.geomspace(10**7.75, 10**11.25, 8))
    assert ticks(ax.yaxis) == LAWS
    assert legend(ax) == ["worker lost: 1 run"]
    shares = (np.arange(100) + 0.5) / 100
    linear = [
        np.linspace(1.0, 2.0, 5), np.linspace(1.0, 100.0, 5), PRELOADS, np.geomspace(1.0, 2.0, 5),
        [0.0, 1.0, 10.0, 100.0], [-1.0, -10.0, -100.0], [1.0, 100.0],
        stats.uniform(1.0, 99.0).ppf(shares), stats.norm(50.0, 10.0).ppf(shares),
    ]  # fmt: skip
    geometric = [[1, 2, 5, 10, 20, 50], stats.loguniform(1e8, 1e11).ppf(shares)]
    for log, rows in ((False, linear), (True, geometric)):
        for values in rows:
            data = xr.Dataset(coords={"a": ("a", np.asarray(values))})
            assert scale_of(data, "a").log == log, values
    # other dimensions are chosen
    data = cube()
    ax = bd.plot.map(data, "q", at={"friction.mu_k": 0.5})
    expected = data["q"].sel({"friction.mu_k": 0.5}).values.T
    np.testing.assert_allclose(one(ax, QuadMesh).get_array(), expected)
    assert ax.get_title() == "friction coefficient 0.5"
    assert ax.get_yscale() == "log"
    ax = bd.plot.map(by_pulley(), "load")
    assert ticks(ax.yaxis) == ["crank", "alternator"]
    # Of the plane a + 100 b they are exact: on each the plane has the value of the line
    data = over_grid(lambda a, b: a + 100.0 * b)
    ax = bd.plot.map(data, "q", contours=(400.0, 500.0, 5000.0))
    lines = one(ax, QuadContourSet)
    assert list(lines.levels) == [400.0, 500.0]
    for level, path in zip(lines.levels, lines.get_paths(), strict=True):
        assert len(path.vertices) > 5
        np.testing.assert_allclose(path.vertices @ [1.0, 100.0], level)
    assert sorted(text.get_text() for text in ax.texts) == ["400", "500"]
    assert not bd.plot.map(data, "q", contours=0).texts
    many = one(bd.plot.map(data, "q", contours=4), QuadContourSet).levels
    assert 2 <= len(many) <= 5

    # none runs through a failed run
    swept.fail(data, "failed", belt__preload=3, friction__mu_k=4)
    lines = one(bd.plot.map(data, "q", contours=20), QuadContourSet)
    points = np.concatenate([path.vertices for path in lines.get_paths()])
    cell = (np.abs(points[:, 0] - 412.5) < 37.4) & (np.abs(points[:, 1] - FRICTIONS[4]) < 0.0499)
    assert not cell.any()


def test_runs_at_random_are_points() -> None:
    """With and without lines; entries by pulley in their style, over time a line for each run,
    coloured by what was sampled.
    """
    data = sampled()
    ax = bd.plot.map(data, "y", "belt.preload", "contact.quadratic")
    good = np.isfinite(data["y"].values)
    points = one(ax, PathCollection)
    places = np.stack([data["belt.preload"].values, data["contact.quadratic"].values], axis=1)
    np.testing.assert_array_equal(points.get_offsets(), places[good])
    np.testing.assert_array_equal(points.get_array(), data["y"].values[good])
    assert legend(ax) == ["refused: 2 runs", "failed: 5 runs"]
    crosses = np.concatenate([line.get_xydata() for line in ax.lines])
    assert sorted(crosses.tolist()) == sorted(places[~good].tolist())
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "log")
    ax = bd.plot.lines(data, "y", "belt.preload", "friction.mu_k")
    points = ax.collections[0]
    expected = np.stack([places[:, 0], data["y"].values], axis=1)[good]
    order = np.argsort(expected[:, 0], kind="stable")
    np.testing.assert_array_equal(points.get_offsets(), expected[order])
    light = lightness(points.get_facecolor())
    assert (np.diff(light[np.argsort(data["friction.mu_k"].values[good][order])]) >= 0.0).all()
    assert legend(ax) == ["refused: 2 runs", "failed: 5 runs"]
    lines = bd.plot.lines(data, "y", "belt.preload").lines
    (plain,) = [line for line in lines if line.get_transform() == line.axes.transData]
    assert plain.get_linestyle() == "None"
    samples = bd.sample({"belt.preload": (300.0, 500.0), "friction.mu_k": (0.3, 0.8)}, 16)
    preload, mu = samples.values.T
    data = swept.of_samples(samples, np.stack([preload, 2.0 * preload], axis=1))
    ax = bd.plot.lines(data, "y", "belt.preload", "pulley")
    assert legend(ax) == ["pulley 0", "pulley 1"]
    for k, line in enumerate(ax.lines):
        np.testing.assert_array_equal(line.get_xdata(), np.sort(preload))
        np.testing.assert_array_equal(line.get_ydata(), (k + 1.0) * np.sort(preload))
        assert line.get_linestyle() == "None"
    t = np.linspace(0.0, 1.0, 5)
    data["curve"] = (("run", "time"), mu[:, None] * t, {"units": "N"})
    data = data.assign_coords(time=t)
    lines = bd.plot.lines(data, "curve", by="friction.mu_k").lines
    for line, slope in zip(lines, mu, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), slope * t)
    light = lightness([line.get_color() for line in lines])
    assert (np.diff(light[np.argsort(mu)]) >= 0.0).all() and np.ptp(light) > 0.3
    assert len({line.get_color() for line in bd.plot.lines(data, "curve").lines}) == 1


def test_a_line_for_each_value_with_gaps_and_marks() -> None:
    data = grid()
    ax = bd.plot.lines(data, "q")
    values = [line for line in ax.lines if line.get_transform() == ax.transData]
    assert len(values) == 8
    for k, line in enumerate(values):
        np.testing.assert_array_equal(line.get_xdata(), PRELOADS)
        np.testing.assert_array_equal(line.get_ydata(), data["q"].values[:, k])
    marks = [line for line in ax.lines if line not in values and len(line.get_xdata())]
    failed = [line for line in marks if line.get_marker() == FAILED_LOOKS["failed"][1]]
    assert [list(line.get_xdata()) for line in failed] == [[250.0, 300.0, 350.0]]
    assert failed[0].get_color() == values[0].get_color()
    assert "failed: 3 runs" in legend(ax) and "no value: 1 run" in legend(ax)
    # below all values
    low = ax.transAxes.inverted().transform(ax.transData.transform((300.0, np.nanmin(data["q"]))))
    assert max(float(np.max(line.get_ydata())) for line in marks) < low[1]
    # colours of numbers grow lighter, and their bar has the values
    ax = bd.plot.lines(cube(), "q", at={"contact.quadratic": 1e8})
    light = lightness([line.get_color() for line in ax.lines])
    assert len(light) == 8 and (np.diff(light) > 0.0).all() and light[-1] < 0.8
    bar = ax.figure.axes[-1]
    assert ticks(bar.yaxis) == ["0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1"]
    assert bar.get_ylabel() == "friction coefficient [1]" and legend(ax) == []
    # histories are a line for each run
    data = histories()
    ax = bd.plot.lines(data, "curve", by="belt.preload")
    assert ax.get_xlabel() == "time [s]" and len(ax.lines) == 21
    curves = data["curve"].values.reshape(21, -1)
    for line, curve in zip(ax.lines, curves, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), data["time"])
        np.testing.assert_array_equal(line.get_ydata(), curve)
    colours = [line.get_color() for line in ax.lines]
    assert all(len(set(map(tuple, colours[k : k + 3]))) == 1 for k in range(0, 21, 3))
    assert len(set(map(tuple, colours))) == 7
    assert legend(ax) == ["failed: 1 run"]
    late = bd.plot.lines(data, "curve", at={"time": 0.2512})
    np.testing.assert_array_equal(late.lines[0].get_ydata(), data["curve"].values[:, 0, 50])
    assert late.get_title() == "time 0.25 s"


def test_texts_have_styles_a_legend_and_room() -> None:
    data = of_laws()
    ax = bd.plot.lines(data, "q")
    assert legend(ax) == [*LAWS, "worker lost: 1 run"] and ax.get_xscale() == "log"
    looks = {(line.get_color(), str(line.get_linestyle())) for line in ax.lines[:3]}
    assert len(looks) == 3
    ax = bd.plot.lines(by_pulley(), "load")
    assert legend(ax) == ["crank", "alternator"]
    for line, k in zip(ax.lines, (1, 2), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), k * PRELOADS)
    (alone,) = bd.plot.lines(by_pulley(), "load", at={"pulley": "alternator"}, lw=3).lines
    np.testing.assert_array_equal(alone.get_ydata(), 2.0 * PRELOADS)
    assert alone.get_linewidth() == 3
    # Each law has one place along an axis and one entry in a legend, however often it was run
    laws = ["dahl", "lugre", "dahl", "coulomb", "lugre", "dahl"]
    preload = np.array([300.0, 500.0, 400.0, 350.0, 300.0, 500.0])
    coords = {"run": np.arange(6), "friction.kind": ("run", laws), "belt.preload": ("run", preload)}
    given = xr.Dataset({"q": ("run", np.arange(6.0))}, coords, {"design": '{"kind": "list"}'})
    data = swept.finished(given, ("run",))
    ax = bd.plot.map(data, "q", "belt.preload", "friction.kind")
    assert ticks(ax.yaxis) == ["dahl", "lugre", "coulomb"]
    expected = np.stack([preload, [0, 1, 0, 2, 1, 0]], axis=1)
    np.testing.assert_array_equal(one(ax, PathCollection).get_offsets(), expected)
    ax = bd.plot.lines(data, "q", "belt.preload", "friction.kind")
    assert legend(ax) == ["dahl", "lugre", "coulomb"]
    assert [list(line.get_ydata()) for line in ax.lines] == [[0.0, 2.0, 5.0], [4.0, 1.0], [3.0]]

    zipped = sampled(16)
    zipped.attrs["design"] = '{"kind": "zip"}'
    line = bd.plot.lines(zipped, "y", "belt.preload").lines[0]
    assert line.get_linestyle() == "-" and (np.diff(line.get_xdata()) >= 0.0).all()
    # texts have room
    scattered = {"x": "belt.preload", "y": "contact.quadratic"}
    for size, draw, data, quantity, options in (
        (SIZES[0], bd.plot.map, cube(), "q", {"at": {"friction.mu_k": 0.5}}),
        (SIZES[1], bd.plot.map, sampled(), "y", scattered),
        (SIZES[2], bd.plot.lines, of_laws(), "q", {}),
    ):
        with axes_of(size) as ax:
            draw(data, quantity, ax=ax, **options)
            check_room(ax.figure)
            assert ax.get_window_extent().height > 0.4 * ax.figure.bbox.height


BETWEEN = {"friction.mu_k": 0.35}


def test_what_is_refused() -> None:
    rows: list[tuple[type[Exception], str, Any, dict[str, Any]]] = [
        (ValueError, "quantity must be one of q, got 'p'", "p", {}),
        (ValueError, "x must be one of .*did you mean 'belt.preload'", "q", {"x": "belt.preloads"}),
        (ValueError, "x and (y|by) must differ", "q", {"x": "belt.preload", "2": "belt.preload"}),
        (ValueError, r"q has the dimensions .* by at=\{'.*': \d", "q", {}),
        (ValueError, r"at\['friction.mu_k'\] must be one of 0.3, .* 0.35", "q", {"at": BETWEEN}),
        (TypeError, "at must be a dict", "q", {"at": 3}),
        (ValueError, "at: there is no dimension 'mu', there are belt", "q", {"at": {"mu": 1}}),
        (TypeError, "ax must be matplotlib axes", "q", {"ax": 3, "at": {"friction.mu_k": 0.5}}),
    ]
    data = cube()
    for draw, second in ((bd.plot.map, "y"), (bd.plot.lines, "by")):
        for error, words, quantity, options in rows:
            named = {second if key == "2" else key: value for key, value in options.items()}
            with pytest.raises(error, match=f"^{words}"):
                draw(data, quantity, **named)
    for words, wrong in (
        ("q varies along belt.preload alone", lambda: bd.plot.map(by_pulley(), "q")),
        ("x and y must be two of", lambda: bd.plot.map(sampled(), "y")),
        ("x must be named, one of", lambda: bd.plot.lines(sampled(), "y")),
        ("contours must be", lambda: bd.plot.map(grid(), "q", contours=-1)),
        ("contours must be finite", lambda: bd.plot.map(grid(), "q", contours=(np.nan,))),
        ("dataset must be that of bd.sweep", lambda: bd.plot.map(grid().drop_vars("status"), "q")),
    ):
        with pytest.raises(ValueError, match=f"^{words}"):
            wrong()
    with pytest.raises(TypeError, match=r"^dataset must be the xarray\.Dataset of bd\.sweep"):
        bd.plot.map({"q": 1}, "q")
