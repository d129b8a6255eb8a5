"""Results in places fixed in space: ``along_belt``, ``arcs``, ``hub_load``, and their pictures.

Against the belt line that the drive itself gives, belts whose tension and speed are known in closed
form, and full slip. Slip arcs, hub loads and tensions of a loaded drive are held to creep theory in
``test_creep_theory.py``, loads themselves to the oracle in ``test_hub_loads.py``.
"""

from __future__ import annotations

from typing import Any

import attrs
import drives
import mounted_drives
import numpy as np
import pytest
from matplotlib.figure import Figure
from test_hub_loads import idler, off_statics, statics, straight_line

import beltdyn as bd
from beltdyn.outputs import places

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

SPANS = ("pulley 0 to pulley 1", "pulley 1 to pulley 2", "pulley 2 to pulley 0")
STILL = bd.Viscous([0.0, 0.0, 0.0])
LAYOUTS: dict[str, Any] = {
    "idler": lambda: drives.idler_scene().params,
    "crossed": lambda: drives.crossed_scene().params,
    "two": drives.plain,
}


def at_rest(params: bd.Params) -> bd.Result:
    still = bd.Viscous([0.0] * len(params.pulleys))
    return bd.simulate(params, still, 1e-4, t_eval=[0.0, 1e-4])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_links_at_rest_lie_along_the_line_and_on_its_wraps(layout: str, mesh: str) -> None:
    """As far apart as they are long, where the belt crosses itself as well, to 5 %: that is what
    projecting a link that lies off the line where a wrap ends moves it.

    Parts of the line are its wraps and spans in turn, as long as the route has them. Wraps of the
    belt are those of the line to a link, and nothing slips. With contact along the links and no
    bending they are to a tenth of one, of which compliance takes sqrt(T / c) / r of angle at either
    end.
    """
    params = LAYOUTS[layout]()
    belt = attrs.evolve(params.belt, bending_stiffness=0.0)
    params = drives.on_mesh(attrs.evolve(params, belt=belt), mesh)
    result, line, link = at_rest(params), params.route, params.info["link_length"]
    points = np.stack([result.belt.x, result.belt.y], axis=-1)
    s = places.where(params, points, *places.routes(params, None))
    apart = np.diff(s, axis=1, append=s[:, :1]) % line.length
    np.testing.assert_allclose(apart.sum(axis=1), line.length, rtol=1e-9)
    np.testing.assert_allclose(apart, line.length / params.belt.n_bodies, rtol=0.05)
    radii = np.array([one.radius for one in params.pulleys])
    begins, ends = places.line_parts(line, radii).T
    np.testing.assert_allclose(ends - begins, radii * line.wraps, rtol=1e-12)
    spans = np.roll(begins, -1) - [0.0, *ends[1:]]
    np.testing.assert_allclose(spans, line.spans, rtol=1e-12)
    assert ends[0] == pytest.approx(line.length, rel=1e-12)
    off = (result.arcs.wrap - line.wraps) * radii / link
    soft = 2.0 * np.sqrt(params.info["mean_tension"] / params.contact.linear)
    assert np.abs(off).max() <= (0.1 + soft / link if mesh != "paper" else 1.0)
    assert not result.arcs.slip.any()
    np.testing.assert_array_equal(result.arcs.stick, result.arcs.wrap)


def test_places_know_their_position() -> None:
    """Coordinates of links in a place are those of the line there: of a chord between two links on
    a pulley l^2 / (8 r) inside, and as much again off it in their centres.
    """
    params = drives.on_mesh(drives.idler_scene().params, "joint")
    result, line = at_rest(params), params.route
    found, y = result.along_belt("belt.x"), result.along_belt("belt.y").values[-1]
    points = np.stack([found.values[-1], y], axis=-1)
    inside = 2.0 * params.info["link_length"] ** 2 / (8.0 * 0.04)
    for k, pulley in enumerate(params.pulleys):
        on, (begin, end) = found.part == params.pulley_names[k], found.wraps[k]
        off = np.hypot(*(points[on] - pulley.center).T) - pulley.radius
        assert on.any() and np.abs(off).max() <= inside
        assert ((found.s >= begin) & (found.s <= end) == on).all()
        arrived = np.hypot(*(points[on][0] - line.arrive[k]))
        step = line.length / params.belt.n_bodies
        assert arrived == pytest.approx(found.s[on][0] - begin, abs=0.1 * step + inside)
    assert set(found.part) == {*params.pulley_names, *SPANS}


@pytest.fixture(scope="module")
def loaded() -> bd.Result:
    params, torque, *_ = drives.idler_scene()
    return bd.simulate(params, torque, 0.05, t_eval=np.linspace(0.0, 0.05, 101))


def test_a_place_sees_other_links_pass(loaded: bd.Result) -> None:
    """The tension of a span at a place in it is that of the span, whichever joints are there."""
    found = loaded.along_belt()
    for k, name in enumerate(SPANS):
        on = np.flatnonzero(found.part == name)
        middle = found.values[:, on[len(on) // 2]]
        assert np.ptp(middle) > 10.0, "the load comes"
        # stretch waves within a span: a few per cent of the load
        np.testing.assert_allclose(middle, loaded.span_tension[:, k], atol=0.01 * middle.mean())


@pytest.mark.parametrize("group", ["joints.force", "contact.normal", "belt.x"])
def test_a_belt_without_bending_has_places(group: str) -> None:
    """A string knows no angles: its masses and bars have places all the same, and pictures of them.
    At rest they share the line; tensions are those of its bars.
    """
    base = drives.idler_scene().params
    params = attrs.evolve(base, belt=attrs.evolve(base.belt, bending_stiffness=0.0))
    assert params.belt_model == "string"
    result, line = at_rest(params), params.route
    found = result.along_belt(group)
    assert found.values.shape == (2, found.s.size) and np.isfinite(found.values).all()
    assert set(found.part) == {*params.pulley_names, *SPANS}
    if group == "joints.force":
        at = found.values[-1]
        assert result.joints.force.min() <= at.min() and at.max() <= result.joints.force.max()
        assert bd.plot.tension_along(result, [0.0], ax=(ax := Figure().add_subplot())) is ax
    elif group == "contact.normal":
        pressed = np.isin(found.part, params.pulley_names)
        assert found.values[-1][pressed].mean() > 10.0 * abs(found.values[-1][~pressed]).mean()
    else:
        middle = found.s[np.flatnonzero(found.part == SPANS[0])]
        x = np.interp(middle, found.s, found.values[-1])
        (x0, _), (x1, _) = line.leave[0], line.arrive[1]
        assert x.min() > min(x0, x1) - 1e-3 and x.max() < max(x0, x1) + 1e-3


def test_moving_axes_keep_places_in_their_part() -> None:
    """A take-up that moves by some millimetres: places stand on the line of the time."""
    params = mounted_drives.path(n_bodies=120)
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 0.03, t_eval=[0.0, 0.03])
    x, y = (result.along_belt(f"belt.{name}") for name in ("x", "y"))
    axes = np.array([params.centers(row)[1] for row in result.mounts.travel])
    inside = 2.0 * params.info["link_length"] ** 2 / (8.0 * 0.08)
    on = x.part == "pulley 1"
    for row, axis in enumerate(axes):
        off = np.hypot(x.values[row, on] - axis[0], y.values[row, on] - axis[1])
        assert np.abs(off - 0.08).max() <= inside
    assert np.hypot(*(axes[1] - axes[0])) > inside, "or nothing is shown"


def test_what_is_refused() -> None:
    params = drives.plain()
    result = at_rest(params)
    for name in ("contact.pulley", "belt.phi", "pulleys.omega", "tension"):
        with pytest.raises(ValueError, match=r"name must be one of joints\.deformation"):
            result.along_belt(name)
    with pytest.raises(TypeError, match="name must be one of"):
        result.along_belt(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="places must be from 0 to"):
        result.along_belt(places=[-0.1])
    with pytest.raises(TypeError, match="centrifugal must be a bool"):
        result.hub_load(centrifugal=1)  # type: ignore[arg-type]
    some = bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-4, outputs=("pulleys", "joints"))
    for read in (some.along_belt, lambda: some.arcs, lambda: some.hub_load(centrifugal=False)):
        with pytest.raises(AttributeError, match="was not asked for"):
            read()
    assert some.hub_load() is some.pulleys.load


def test_a_wrap_that_drags_slips_all_over_and_a_free_one_does() -> None:
    """But for the links that have just come; on an idler without friction, everywhere."""
    params, *_ = drives.idler_scene()
    free = attrs.evolve(params.pulleys[1], friction=bd.Frictionless())
    params = attrs.evolve(params, pulleys=[params.pulleys[0], free, params.pulleys[2]],
                          friction=bd.Dahl(mu_k=0.02, sigma=1e5))  # fmt: skip
    pull = bd.PiecewiseLinear([0.0, 0.005], [[0.0] * 3, [-60.0, 0.0, 0.0]])
    result = bd.simulate(params, pull, 0.05, t_eval=[0.04, 0.045, 0.05])
    arcs = result.arcs
    np.testing.assert_array_equal(arcs.slip[:, 1], arcs.wrap[:, 1])
    link = params.info["link_length"] / params.pulleys[0].radius
    assert (arcs.stick[:, 0] <= 2.0 * link).all() and (arcs.wrap[:, 0] > 2.5).all()
    np.testing.assert_allclose(arcs.slip + arcs.stick, arcs.wrap, rtol=1e-12)


@pytest.mark.parametrize("model", ["string", "links"])
def test_running_without_load(model: str) -> None:
    """Steady at 20 m/s, rho v^2 = 40 N of 400 N: loads are (T - rho v^2) (d_1 + d_2) within 0.2 %,
    and without the centrifugal part T (d_1 + d_2). Without dampers in the contact, which a settled
    state does not know and which push links that arrive, 1 % of the load here.
    """
    params = idler(360, model)
    undamped = attrs.evolve(params.contact, damping=0.0)
    params = attrs.evolve(params, contact=undamped)
    start = bd.settle(params, speed={0: 250.0})
    result = bd.simulate(params, STILL, 1e-5, initial=start, t_eval=[0.0])
    tension = result.span_tension[0]
    speed = np.hypot(result.belt.vx, result.belt.vy).mean()
    relief = params.belt.linear_density * speed**2 / (1.0 + tension / 80e3)
    assert relief.mean() > 0.08 * tension.mean()
    line = straight_line(params, float(tension.mean() - relief.mean()))
    off = off_statics(result.hub_load()[0], statics(tension - relief, line))
    assert (off <= 0.002).all(), off
    off = off_statics(result.hub_load(centrifugal=False)[0], statics(tension, line))
    assert (off <= 0.002).all(), off


def test_directions_follow_the_travel() -> None:
    """Of a take-up that a path moves across, the load turns with the line."""
    params = mounted_drives.wandering()
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 0.03, t_eval=[0.0, 0.03])
    flux = result.hub_load(centrifugal=False) - result.pulleys.load
    for row, travel in enumerate(result.mounts.travel):
        across = np.subtract(*params.centers(travel)[::-1])
        if np.abs(flux[row]).max() > 0.0:  # of equal pulleys, along the line of their centres
            cross = flux[row] @ np.array([-across[1], across[0]])
            assert np.abs(cross).max() <= 1e-3 * np.abs(flux[row] @ across).max()


def test_pictures_draw_what_along_belt_and_arcs_give(loaded: bd.Result) -> None:
    ax = Figure().add_subplot()
    assert bd.plot.tension_along(loaded, [0.0, 0.05], ax=ax) is ax
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("place along the belt line [m]", "tension [N]")
    for line, row in zip(ax.lines, (0, -1), strict=True):
        s = np.asarray(line.get_xdata())
        expected = loaded.along_belt("joints.force", s).values[row]
        np.testing.assert_array_equal(line.get_ydata(), expected)
    names = [text.get_text() for text in sorted(ax.texts, key=lambda text: text.xy[0])]
    assert names == ["pulley 1", "pulley 2", "pulley 0"]  # along the belt line
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["t = 0 s", "t = 0.05 s"]
    alone = bd.plot.tension_along(loaded)
    (legend,) = alone.get_legend().get_texts()
    assert legend.get_text() == "t = 0.05 s" and not alone.get_title()
    with pytest.raises(ValueError, match="at least one time"):
        bd.plot.tension_along(loaded, [])
    ax = bd.plot.arcs(loaded)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "arc [deg]")
    for line, wrap in zip(ax.lines, loaded.arcs.wrap.T, strict=True):
        np.testing.assert_allclose(line.get_ydata(), np.degrees(wrap))
    assert len(ax.collections) == 3
    (one,) = bd.plot.arcs(loaded, pulleys=2).lines
    np.testing.assert_allclose(one.get_ydata(), np.degrees(loaded.arcs.wrap[:, 2]))
