"""Figures: what is drawn is what the result holds; nothing global changes; errors name the rule."""

from __future__ import annotations

import inspect
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import attrs
import matplotlib
import numpy as np
import pytest
from drives import pressing
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch
from pictures import labels
from tiers import ci_if

import beltdyn as bd

N_T, T_END = 61, 0.3


@pytest.fixture(scope="module")
def result() -> bd.Result:
    params, torque, *_ = bd.scenes.kubas_case_1()
    return bd.simulate(params, torque, T_END, t_eval=np.linspace(0.0, T_END, N_T))


@pytest.fixture
def ax() -> Axes:
    return Figure().add_subplot()


def drawn(ax: Axes) -> list[tuple[np.ndarray, np.ndarray]]:
    return [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in ax.lines]


def test_each_pulley_span_and_joint_over_time(result: bd.Result) -> None:
    for draw, values, ylabel in (
        (bd.plot.speeds, result.pulleys.omega, "angular velocity [rad/s]"),
        (bd.plot.torques, result.pulleys.torque, "set torque [N m]"),
        (bd.plot.span_tensions, result.span_tension, "span tension [N]"),
        (bd.plot.joint_force, result.joints.force, "joint force [N]"),
        (bd.plot.joint_deformation, 1e3 * result.joints.deformation, "joint deformation [mm]"),
    ):
        ax, columns, chosen = Figure().add_subplot(), [0, 1], ()
        if values.shape[1] > 2:
            assert labels(draw(result, np.int64(7))) == ["joint 7"]
            columns, chosen = [3, 4, 5], (range(3, 6),)
        assert draw(result, *chosen, ax=ax) is ax
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", ylabel)
        assert len(labels(ax)) == len(columns)
        assert not chosen or labels(ax) == [f"joint {k}" for k in columns]
        for (x, y), k in zip(drawn(ax), columns, strict=True):
            np.testing.assert_array_equal(x, result.t)
            np.testing.assert_array_equal(y, values[:, k], ylabel)
    # chosen pulleys keep their looks
    both = bd.plot.speeds(result).lines
    (one,) = bd.plot.speeds(result, pulleys=1).lines
    (same,) = bd.plot.torques(result, pulleys=[1]).lines
    np.testing.assert_array_equal(one.get_ydata(), result.pulleys.omega[:, 1])
    np.testing.assert_array_equal(same.get_ydata(), result.pulleys.torque[:, 1])
    assert one.get_color() == same.get_color() == both[1].get_color() != both[0].get_color()
    # line keywords and runs compared
    ax = Figure().add_subplot()
    bd.plot.speeds(result, label="soft", ax=ax)
    bd.plot.speeds(result, label="stiff", ax=ax)
    assert labels(ax) == [f"{run}, pulley {k}" for run in ("soft", "stiff") for k in (0, 1)]
    looks = {(line.get_color(), str(line.get_linestyle())) for line in ax.lines}
    assert len(looks) == len({colour for colour, _ in looks}) == 4
    bd.plot.joint_force(result, 1, label="measured", c="red", lw=3, ls=":", ax=ax)
    last = ax.lines[-1]
    assert last.get_label() == "measured"
    assert (last.get_color(), last.get_linewidth(), last.get_linestyle()) == ("red", 3, ":")
    # room made for a legend must not freeze the limits
    joints = attrs.evolve(result.joints, force=10 * result.joints.force)
    higher = attrs.evolve(result, joints=joints)
    bd.plot.span_tensions(higher, ax=ax)
    assert ax.get_ylim()[1] >= np.nanmax(higher.span_tension)


def test_force_along_belt(result: bd.Result, ax: Axes) -> None:
    row = 20
    assert bd.plot.force_along_belt(result, result.t[row] + 2e-3, first=1, ax=ax) is ax
    ((x, y),) = drawn(ax)
    # A joint is on the left of its element: half a number before it.
    np.testing.assert_array_equal(x, np.arange(60) + 0.5)
    np.testing.assert_array_equal(y, result.joints.force[row])
    assert "0.1 s" in ax.get_title() and "[N]" in ax.get_ylabel()
    assert ax.get_xlim() == (0.5, 60.5)
    shaded = np.zeros(60, dtype=bool)
    for patch in ax.patches:
        left, right = patch.get_extents().transformed(ax.transData.inverted()).intervalx
        shaded[round(left - 0.5) : round(right - 0.5)] = True
    np.testing.assert_array_equal(shaded, result.contact.pulley[row] >= 0)
    assert sorted(text.get_text() for text in ax.texts) == ["pulley 0", "pulley 1"]
    patches = len(ax.patches)
    bd.plot.force_along_belt(result, 0.06, wraps=False, ax=ax)
    assert len(ax.patches) == patches
    assert labels(ax) == ["t = 0.1 s", "t = 0.06 s"] and ax.get_title() == ""
    assert ax.lines[0].get_color() != ax.lines[1].get_color()


def test_histories_of_a_link_have_gaps_off_the_pulleys(result: bd.Result, ax: Axes) -> None:
    contact = result.contact
    there = contact.pulley >= 0
    k = int(np.flatnonzero(there.any(axis=0) & ~there.all(axis=0))[0])
    on = there[:, k]
    assert bd.plot.contact_forces(result, k, ax=ax) is ax
    assert "[N]" in ax.get_ylabel() and labels(ax) == [f"normal, link {k}", f"friction, link {k}"]
    normal, friction = drawn(ax)
    np.testing.assert_array_equal(normal[1], contact.normal[:, k])
    np.testing.assert_array_equal(friction[1], contact.friction[:, k])
    (line,) = bd.plot.contact_forces(result, k, which="friction").lines
    np.testing.assert_array_equal(line.get_ydata(), contact.friction[:, k])
    for ax, values in (
        (bd.plot.friction_coefficient(result, k), contact.mu),
        (bd.plot.relative_velocity(result, k), contact.velocity),
    ):
        ((x, y),) = drawn(ax)
        np.testing.assert_array_equal(x, result.t)
        np.testing.assert_array_equal(y, np.where(on, values[:, k], np.nan))
    assert "[m/s]" in ax.get_ylabel()
    ((x, y),) = drawn(bd.plot.friction_coefficient(result, k, against="slip"))
    np.testing.assert_array_equal(x, np.where(on, 1e3 * contact.slip[:, k], np.nan))
    np.testing.assert_array_equal(y, np.where(on, contact.mu[:, k], np.nan))
    free = int(np.flatnonzero(~there.any(axis=0))[0])
    over_time = bd.plot.friction_coefficient(result, free)
    assert over_time.get_xlabel() == "time [s]"
    assert labels(over_time) == [f"link {free} (no contact)"]
    assert np.isnan(drawn(over_time)[0][1]).all()
    loop = bd.plot.friction_coefficient(result, [0, 1], against="slip")
    assert loop.get_xlabel() == "slip displacement [mm]" and len(labels(loop)) == 2
    # By hand: contact all along, v_T = 0.02 m/s; the slip starts from 0 again before sample 40
    t = result.t
    slip = 0.02 * np.where(t < t[40] - 1e-9, t, t - t[40] + 5e-4)
    column = {"pulley": np.zeros(N_T, dtype=np.int32), "velocity": np.full(N_T, 0.02)}
    column |= {"slip": slip, "mu": -np.expm1(-1e4 * slip)}
    arrays = {name: getattr(result.contact, name).copy() for name in column}
    for name, values in column.items():
        arrays[name][:, 5:7] = values[:, None]
    arrays["slip"][:, 6] = 0.02 * t  # this one holds on
    changed = attrs.evolve(result, contact=attrs.evolve(result.contact, **arrays))
    for against in ("time", "slip"):
        broken, whole = drawn(bd.plot.friction_coefficient(changed, [5, 6], against=against))
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(broken[1])), [40])
        np.testing.assert_array_equal(np.delete(broken[1], 40), column["mu"])
        assert np.isnan(broken[0][40]) and not np.isnan(whole).any()
    arrays["pulley"][30:, 6] = 1
    changed = attrs.evolve(result, contact=attrs.evolve(result.contact, **arrays))
    ((_, y),) = drawn(bd.plot.relative_velocity(changed, 6))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(y)), [30])
    # a link on one pulley at all samples of a settled drive keeps its slip: no false gap
    contact = result.contact
    held = np.flatnonzero(((contact.pulley >= 0) & (contact.normal > 1.0)).all(axis=0))
    assert held.size > 5
    for _, y in drawn(bd.plot.friction_coefficient(result, held, against="slip")):
        assert y.shape == (N_T,) and not np.isnan(y).any()


def test_a_drive_is_drawn_to_scale_with_arcs_and_arrows(result: bd.Result, ax: Axes) -> None:
    """Links are highlighted; on axes of a plain figure nothing lies over another."""
    row = 30
    assert bd.plot.drive(result, result.t[row], arcs=False, links={"chosen": 7}, ax=ax) is ax
    assert ax.get_aspect() == 1.0 and ax.get_xlabel() == "x [m]" and "0.15 s" in ax.get_title()
    belt = [one for one in ax.collections if isinstance(one, LineCollection)][-1]
    force = result.joints.force[row]
    np.testing.assert_array_equal(belt.get_array(), (force + np.roll(force, -1)) / 2)
    middles = np.array([segment.mean(axis=0) for segment in belt.get_segments()])
    # The mean of both ends is the centre but for rounding of numbers below 1 m.
    np.testing.assert_allclose(middles[:, 0], result.belt.x[row], atol=1e-15)
    np.testing.assert_allclose(middles[:, 1], result.belt.y[row], atol=1e-15)
    lengths = [np.hypot(*(segment[1] - segment[0])) for segment in belt.get_segments()]
    np.testing.assert_allclose(lengths, 1.2 / 60, rtol=1e-12)
    assert [text.get_text() for text in ax.texts] == ["0", "1"] and labels(ax) == ["chosen"]
    (x,), (y,) = ax.lines[-1].get_data()
    assert (x, y) == (result.belt.x[row, 7], result.belt.y[row, 7])
    ax = bd.plot.drive(result, colour="friction", links=[3, 4], ax=Figure().add_subplot())
    assert {"no contact", "link 3", "link 4"} < set(labels(ax))
    belt = [one for one in ax.collections if isinstance(one, LineCollection)][-1]
    mu_k = result.params.friction.mu_k
    assert belt.get_clim() == (-mu_k, mu_k)
    values = belt.get_array()
    np.testing.assert_array_equal(np.ma.getmaskarray(values), result.contact.pulley[-1] < 0)
    np.testing.assert_array_equal(values.data, result.contact.mu[-1])
    ax.figure.draw_without_rendering()
    bar = ax.figure.axes[1].get_window_extent()
    legend, label = ax.get_legend().get_window_extent(), ax.xaxis.label.get_window_extent()
    assert bar.y1 < legend.y0 and legend.y1 < label.y1
    free = attrs.evolve(result, params=attrs.evolve(result.params, friction=None))
    assert labels(bd.plot.drive(free)) == []
    with pytest.raises(ValueError, match=r'colour must not be "friction"'):
        bd.plot.drive(free, colour="friction")
    with pytest.raises(ValueError, match=r"no pulley of it has any"):
        bd.plot.friction_coefficient(free, 0)

    # arrows and marks follow the rotation
    def arrows(ax: Axes) -> list[int]:
        """Of each pulley: 1 counter-clockwise, -1 clockwise, 0 none."""
        found = [patch for patch in ax.patches if isinstance(patch, FancyArrowPatch)]
        senses = []
        for arrow, pulley in zip(found, result.params.pulleys, strict=True):
            path = arrow.get_path().vertices
            (x, y), to = path[0] - pulley.center, path[1] - path[0]
            senses.append(int(np.sign(x * to[1] - y * to[0])) * arrow.get_visible())
        return senses

    assert arrows(bd.plot.drive(result, 0.0)) == [0, 0], "at rest"
    assert arrows(bd.plot.drive(result)) == [-1, -1], "the paper's drive runs clockwise"
    # turned back, and by a quarter of a turn
    theta = np.full_like(result.pulleys.theta, np.pi / 2)
    pulleys = attrs.evolve(result.pulleys, omega=-result.pulleys.omega, theta=theta)
    ax = bd.plot.drive(attrs.evolve(result, pulleys=pulleys))
    assert arrows(ax) == [1, 1]
    mark, centre = ax.lines[1], result.params.pulleys[1].center
    # cos(pi/2) is 6e-17 in floating point
    np.testing.assert_allclose(mark.get_xdata(), centre[0], atol=1e-15)
    assert (np.asarray(mark.get_ydata()) > centre[1]).all()
    # All links of pulley 0 made to slip, none of pulley 1: one arc each, inside the rims. So with
    mu_k, pulley = result.params.friction.mu_k, result.contact.pulley
    mu = np.where(pulley == 0, 0.96 * mu_k, 0.5 * mu_k)
    changed = attrs.evolve(result, contact=attrs.evolve(result.contact, mu=mu))
    law = attrs.evolve(result.params.friction, mu_s=2.0 * mu_k, v_stribeck=0.01)
    contact = attrs.evolve(
        result.contact,
        mu=np.where(pulley >= 0, 1.2 * mu_k, 0.0),
        velocity=np.where(pulley == 0, 1.0, 1e-4),
    )
    params = attrs.evolve(result.params, friction=law)
    for run in (changed, attrs.evolve(result, params=params, contact=contact)):
        ax = bd.plot.drive(run)
        assert labels(ax) == ["belt sticks", "belt slips"]
        *arcs, _edge, _belt = [one for one in ax.collections if isinstance(one, LineCollection)]
        for arc, k in zip(arcs, (1, 0), strict=True):
            points = np.concatenate(arc.get_segments()) - run.params.pulleys[k].center
            radius = run.params.pulleys[k].radius
            assert (np.hypot(*points.T) < radius).all()
            # from the outer end of the first link on it to that of the last one, clockwise
            on = np.flatnonzero(pulley[-1] == k)
            np.testing.assert_array_equal(np.diff(on), 1)
            steps = np.diff(np.unwrap(np.arctan2(points[:, 1], points[:, 0])))
            half = np.arctan2(run.params.info["link_length"] / 2, radius)
            # Links lie tangent to the rim within the contact's compression, 1e-3 of the radius.
            assert -steps.sum() == pytest.approx(2 * half * on.size, rel=0.02)
    assert labels(bd.plot.drive(changed, slip_from=0.97)) == ["belt sticks"]
    assert labels(bd.plot.drive(changed, arcs=False, colour=None)) == []


def test_energy(result: bd.Result, ax: Axes) -> None:
    assert bd.plot.energy(result, ax=ax) is ax
    ledger = result.energy
    top, work, stored = (y for _, y in drawn(ax))
    np.testing.assert_array_equal(work, ledger.drive)
    # Sums of terms of some J: rounding below 1e-12 J.
    np.testing.assert_allclose(stored, ledger.total - ledger.total[0], atol=1e-12)
    np.testing.assert_allclose(top, ledger.losses + stored, atol=1e-12)
    assert ax.get_title().startswith(f"residual at most {np.abs(ledger.residual).max():.1g} J")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "energy [J]")
    assert len(ax.collections) == 3 and len(labels(ax)) == 6
    upper = np.zeros(N_T)
    losses = (ledger.friction_loss, ledger.contact_loss, ledger.joint_loss)
    for area, loss in zip(ax.collections, losses, strict=True):
        upper = upper + loss
        outline = area.get_paths()[0].vertices
        assert outline[:, 1].max() == pytest.approx(upper.max(), rel=1e-12)
    with pytest.raises(ValueError, match="result must carry the energy ledger"):
        bd.plot.energy(attrs.evolve(result, energy=None))
    # samples that begin late: what is stored is told against E(0), not the first sample
    torque, late = bd.scenes.kubas_case_1().torque_fn, result.t[40:]
    run = bd.simulate(result.params, torque, T_END, t_eval=late)
    _, (_, stored) = drawn(bd.plot.energy(run))[1:]
    # Both runs take their own steps: equal within rtol = 1e-4 of what is stored.
    np.testing.assert_allclose(stored, (ledger.total - ledger.total[0])[40:], rtol=1e-4)


WHOLE = ["speeds", "torques", "span_tensions", "force_along_belt", "drive", "energy"]
OF_ONE = "joint_force joint_deformation contact_forces friction_coefficient relative_velocity"
ALL: dict[str, Callable[..., Any]] = {name: getattr(bd.plot, name) for name in WHOLE} | {
    name: lambda r, name=name, **options: getattr(bd.plot, name)(r, 0, **options)
    for name in OF_ONE.split()
}


def test_each_makes_a_figure_of_its_own_and_changes_nothing_global(result: bd.Result) -> None:
    before = dict(matplotlib.rcParams)
    for name, draw in ALL.items():
        ax = draw(result)
        if name in ("speeds", "drive"):  # of lines, and with a colour bar
            assert ax.figure._repr_png_().startswith(b"\x89PNG"), "a notebook shows it"
        assert hasattr(ax.figure, "_repr_png_"), name
        assert ax.get_xlabel() and "[" in ax.get_ylabel(), name
        assert not ax.spines["top"].get_visible() and not ax.spines["right"].get_visible()
        assert dict(matplotlib.rcParams) == before, name
    # an overview is made of them
    given = Figure()
    assert bd.plot.overview(result, t=0.02, fig=given) is given
    speeds, tensions, forces, drive, _bar = given.axes
    np.testing.assert_equal(drawn(speeds), drawn(bd.plot.speeds(result)))
    np.testing.assert_equal(drawn(tensions), drawn(bd.plot.span_tensions(result)))
    np.testing.assert_equal(drawn(forces), drawn(bd.plot.force_along_belt(result, 0.02)))
    assert drive.get_aspect() == 1.0 and "0.02 s" in drive.get_title()


def test_a_run_that_failed_5_ms_in_can_be_drawn(result: bd.Result) -> None:
    """Of one sample. Warnings, such as of empty ranges, are errors here."""
    with pytest.raises(bd.SimulationError) as error:
        bd.simulate(
            result.params,
            lambda t, theta, omega: [float("nan") if t > 5e-3 else 0.0, 0.0],
            0.02,
            t_eval=[0.0, 0.01],
        )
    partial = error.value.result
    assert partial.t.size == 1
    figure = Figure(figsize=(16.0, 12.0))
    for k, draw in enumerate(ALL.values()):
        draw(partial, ax=figure.add_subplot(3, 4, k + 1))
    figure.draw_without_rendering()


BAD: list[tuple[Callable[[bd.Result], Any], type[Exception], str]] = [
    (lambda r: bd.plot.speeds(r, pulleys=2), ValueError, "pulleys must be an integer from 0 to 1"),
    (lambda r: bd.plot.torques(r, pulleys=[0, -1]), ValueError, r"pulleys\[1\] must be an integer"),
    (lambda r: bd.plot.speeds(r, pulleys=[]), ValueError, "pulleys must hold at least one"),
    (lambda r: bd.plot.joint_force(r, 60), ValueError, "joint must be an integer from 0 to 59"),
    (lambda r: bd.plot.contact_forces(r, -1), ValueError, "link must be an integer from 0 to 59"),
    (lambda r: bd.plot.contact_forces(r, 0, which="mu"), ValueError, "which must be one of"),
    (lambda r: bd.plot.contact_forces(r, 0, which=()), ValueError, "which must hold at least"),
    (lambda r: bd.plot.contact_forces(r, 0, which=3), TypeError, "which must be a str"),
    (lambda r: bd.plot.friction_coefficient(r, 0, against="x"), ValueError, "against must be one"),
    (lambda r: bd.plot.force_along_belt(r, 1.0), ValueError, "t must lie within the samples"),
    (lambda r: bd.plot.force_along_belt(r, "now"), TypeError, "t must be a real number"),
    (lambda r: bd.plot.force_along_belt(r, first=-1), ValueError, "first must be an integer >= 0"),
    (lambda r: bd.plot.drive(r, arcs=1), TypeError, "arcs must be a bool"),
    (lambda r: bd.plot.drive(r, limits=(2, 1)), ValueError, "limits must rise, got 2, 1"),
    (lambda r: bd.plot.overview(r, t=2.0), ValueError, "t must lie within the samples"),
    (lambda r: bd.plot.drive(r, slip_from=0), ValueError, "slip_from must be > 0 and <= 1"),
    (lambda r: bd.plot.drive(r, links={"x": 60}), ValueError, r"links\['x'\] must be an integer"),
]


def test_bad_arguments(result: bd.Result) -> None:
    for call, kind, message in BAD:
        with pytest.raises(kind, match=message):
            call(result)
    start = bd.settle(result.params)
    empty = bd.simulate(result.params, bd.Viscous([1, 1]), 1e-4, t_eval=[], initial=start)
    for draw in ALL.values():
        with pytest.raises(TypeError, match="result must be a Result, got Scene"):
            draw(bd.scenes.kubas_case_1())
        with pytest.raises(TypeError, match="ax must be matplotlib axes or None, got int"):
            draw(result, ax=1)
        with pytest.raises(ValueError, match="result must hold at least one sample"):
            draw(empty)
    with pytest.raises(ValueError, match="result must hold at least one sample"):
        bd.plot.overview(empty)
    for of_a_drive in (bd.plot.mode, bd.plot.animate_mode):
        with pytest.raises(TypeError, match=r"modes must be a Modes, got Params: .* bd\.modes"):
            of_a_drive(result.params)
    with pytest.raises(TypeError, match="response must be a FrequencyResponse, got Params"):
        bd.plot.frequency_response(result.params)


def test_help_has_a_text_for_every_argument() -> None:
    """Those that several functions have stand once, and are put together."""
    for name in set(bd.plot.__all__) - {"Animation"}:
        draw = getattr(bd.plot, name)
        text = inspect.getdoc(draw).partition("\nArgs:\n")[2]
        for one in inspect.signature(draw).parameters.values():
            shown = f"**{one.name}" if one.kind is one.VAR_KEYWORD else one.name
            assert f"    {shown}: " in text, (name, shown)
        assert "ValueError: " in text.partition("\nRaises:\n")[2], name


OF_A_DRIVE = "bd.plot.layout(bd.scenes.kubas_case_1().params)"
OF_A_RUN = (
    "r = bd.simulate(*bd.scenes.kubas_case_1()[:2], 1e-3)\n"
    "assert 'matplotlib' not in sys.modules\n"
    "bd.plot.overview(r); bd.plot.animate(r, duration=0.1)._repr_html_()"
)


@pytest.mark.parametrize("draws", ci_if(OF_A_RUN.__eq__, [OF_A_DRIVE, OF_A_RUN]))
def test_plot_is_found_without_an_import_and_without_pyplot(draws: str) -> None:
    """Without matplotlib it says what to install; with it neither pyplot nor a window is needed."""
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "import beltdyn as bd\n"
        "try: bd.plot\nexcept ImportError as error: print(error)\n"
        "assert sys.modules.pop('matplotlib') is None\n"
        f"{draws}\n"
        "print('matplotlib' in sys.modules, 'matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "pip install matplotlib (or beltdyn[plot])" in done.stdout
    assert done.stdout.splitlines()[-1] == "True False"
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        _ = bd.plots


def test_pyplot_has_the_picture_where_it_is_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """`plt.savefig` after a picture writes it; threads, where windows fail, are left alone."""
    import matplotlib.pyplot as plt

    params = bd.scenes.three_pulleys().params
    try:
        ax = bd.plot.layout(params)
        assert plt.gcf() is ax.figure and plt.gca() is ax
        with ThreadPoolExecutor() as pool:
            pool.submit(bd.plot.layout, params).result()
        assert plt.get_fignums() == [1]
        monkeypatch.setattr(matplotlib, "get_backend", lambda: "inline")
        bd.plot.layout(params)
        assert plt.get_fignums() == [1]
    finally:
        plt.close("all")
        del sys.modules["matplotlib.pyplot"]  # other tests draw many figures


@pytest.mark.parametrize("name", ["speeds", "arcs", "force_along_belt", "travel"])
def test_keywords_that_nobody_knows_are_named(name: str, mounted: bd.Result) -> None:
    draw = getattr(bd.plot, name)
    with pytest.raises(TypeError, match=rf"^{name} has no argument 'unit', nor has Line2D of"):
        draw(mounted, unit="rpm")
    with pytest.raises(TypeError, match=r"matplotlib \(did you mean 'linewidth'\?\)$"):
        draw(mounted, linewith=2.0)
    with pytest.raises(TypeError, match=r"aliases"):
        draw(mounted, lw=2.0, linewidth=2.0)
    assert draw(mounted, lw=2.5).lines[0].get_linewidth() == 2.5


@pytest.mark.parametrize("name", ["overview", "drive", "animate", "campbell", "energy"])
def test_a_misspelt_keyword_is_answered_with_the_one_that_is_meant(
    name: str, mounted: bd.Result
) -> None:
    """Functions that pass nothing on to matplotlib answer with their own keywords."""
    draw = getattr(bd.plot, name)
    (*_, meant) = inspect.signature(draw).parameters
    with pytest.raises(
        TypeError, match=rf"^{name} has no argument .* \(did you mean '{meant}'\?\)$"
    ):
        draw(mounted, **{meant + "z": None})


PIVOT = (0.3, -0.05)


@pytest.fixture(scope="module")
def mounted() -> bd.Result:
    """A back-side idler on an arm and a pulley on a slider, which a step of torque moves."""
    slider = bd.Slider(direction=(2.0, 0.0), mass=1.0, weight=2.0, stiffness=1e5)
    arm = {"pivot": PIVOT, "inertia": 3e-3, "stiffness": 30.0, "preload": -18.0, "damping": 0.2}
    belt = {"n_bodies": 100, "linear_density": 0.1, "axial_stiffness": 70e3, "axial_damping": 1.4}
    params = bd.Params(
        belt=bd.Belt(length=1.262, **belt),
        pulleys=[
            bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01),
            bd.Pulley(name="pump", center=(0.4, 0.05), radius=0.06, inertia=0.004, mount=slider),
            pressing((0.2, 0.0), **arm),
        ],
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )
    torque = bd.PiecewiseLinear([0.0, 0.005], [[0, 0, 0], [-20, 0, 0]])
    return bd.simulate(params, torque, t_end=0.02, t_eval=np.linspace(0.0, 0.02, 21))


def test_layout_and_picture_show_pulleys_where_they_are(mounted: bd.Result) -> None:
    """At rest, as drawn, and where they have moved to."""

    def circles(ax: Axes) -> list[np.ndarray]:
        return [np.array(p.center) for p in ax.patches if isinstance(p, Circle)]

    pulleys, rest = mounted.params.pulleys, mounted.params.centers()
    ax = bd.plot.layout(mounted.params)
    np.testing.assert_allclose(circles(ax), rest, atol=1e-15)
    assert np.abs(rest - [p.center for p in pulleys]).max() > 1e-4
    arms = [np.array(line.get_xydata()) for line in ax.lines]
    assert any(a.shape == (2, 2) and np.allclose(a, [PIVOT, rest[2]]) for a in arms)
    np.testing.assert_array_equal(circles(bd.plot.layout(pulleys)), [p.center for p in pulleys])
    ax = bd.plot.drive(mounted, t=0.02)
    expected = mounted.params.centers(mounted.mounts.travel[-1])
    np.testing.assert_allclose(circles(ax), expected, atol=1e-15)
    titles = {text.get_text(): text.get_position() for text in ax.texts}
    np.testing.assert_allclose(titles["tensioner"], expected[2], atol=1e-15)
    assert (np.ptp(mounted.mounts.travel, axis=0) > 1e-4).all()
    # travel over time
    ax = bd.plot.travel(mounted)
    pump, idler = (np.array(line.get_ydata(), dtype=float) for line in ax.lines)
    way = mounted.mounts.travel
    np.testing.assert_allclose(pump, 1e3 * way[:, 0], atol=1e-12)
    np.testing.assert_allclose(idler, np.degrees(way[:, 1]), atol=1e-12)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["pump [mm]", "tensioner [deg]"]
    fixed = attrs.evolve(mounted, mounts=None)
    with pytest.raises(ValueError, match="no pulley of this drive is on an arm or a slider"):
        bd.plot.travel(fixed)
