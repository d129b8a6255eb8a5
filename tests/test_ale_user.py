"""What a user has of an ALE belt, ``Belt(mesh="ale")``: results, reports, files, modes, refusals.

The row of the core is held to its oracle by test_ale_row.py.
"""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
import pytest
from click.testing import CliRunner

import beltdyn as bd
from beltdyn.cli import main
from beltdyn.drive import cells
from beltdyn.explaining.removals import removals_of
from beltdyn.outputs.places import cell_places, follow

BELT = bd.Belt(
    mesh="ale", preload=320.0, linear_density=0.1, axial_stiffness=60e3, axial_damping=20.0,
    bending_stiffness=0.02,
)  # fmt: skip
PULLEYS = (
    bd.Pulley(name="motor", center=(0.0, 0.0), radius=0.05, inertia=0.01),
    bd.Pulley(name="fan", center=(0.5, 0.0), radius=0.08, inertia=0.02),
)
DRIVE = bd.Params(belt=BELT, pulleys=PULLEYS, friction=bd.Dahl(mu_k=0.8, sigma=1e4))
LINKS = attrs.evolve(DRIVE, belt=attrs.evolve(BELT, mesh="joint", n_bodies=120))
SCENE = bd.Scene(
    DRIVE, bd.Load("fan", coulomb=8.0), 0.3, {"motor": bd.PiecewiseLinear([0.0], [100.0])}
)
LINKED = SCENE._replace(params=LINKS)


@pytest.fixture(scope="module")
def run() -> bd.Result:
    return bd.simulate(*SCENE, rtol=1e-3)


def test_cells_are_chosen_and_told() -> None:
    """Links have no number that is chosen; a number given is that of all cells, about."""
    text = str(DRIVE)
    assert f"{DRIVE.n_bodies}, chosen" in text and "number of cells" in text
    assert "cells that stand still" in text and "link" not in text.partition("pulleys[0]")[0]
    more = attrs.evolve(DRIVE, belt=attrs.evolve(BELT, n_bodies=80))
    assert abs(more.n_bodies - 80) <= 4 and more.belt_model == "cells"
    for params in (DRIVE, more):
        assert bd.Params.from_toml(params.to_toml()) == params
    with pytest.raises(TypeError, match=r"^belt\.n_bodies must be an .* 60 to 240 .* chooses its"):
        attrs.evolve(BELT, mesh="joint")
    with pytest.raises(ValueError, match=r"^belt\.n_bodies must be an .* mostly 60"):
        bd.Params.from_toml(DRIVE.to_toml().replace('"ale"', '"joint"'))


def test_cells_are_places_along_the_belt(run: bd.Result) -> None:
    """One tension to a span; on pulleys that of cells, and between their middles in proportion."""
    along = run.along_belt()
    np.testing.assert_array_equal(along.values, run.joints.force)
    edges = cell_places(DRIVE)
    np.testing.assert_allclose(along.s, 0.5 * (edges[1:] + edges[:-1]))
    spans = np.flatnonzero(DRIVE._cells < 0)
    np.testing.assert_array_equal(run.span_tension, run.joints.force[:, spans])
    k = spans[1]
    inside = run.along_belt("joints.force", np.linspace(edges[k], edges[k + 1], 5))
    np.testing.assert_allclose(inside.values, run.joints.force[:, [k] * 5])
    assert set(inside.part) <= {"fan to motor", "motor"}


@pytest.mark.parametrize(("damping", "rtol"), [(20.0, 3e-2), (0.0, 1e-5)])
def test_auto_is_rodas4_at_any_tolerance(damping: float, rtol: float) -> None:
    """`lbdf2` errs by 4 % of the tension at 3e-2, and waves grow under explicit steps where nothing
    damps them.
    """
    params = attrs.evolve(DRIVE, belt=attrs.evolve(BELT, axial_damping=damping))
    stats = bd.simulate(*SCENE._replace(params=params, t_end=0.02), rtol=rtol).stats
    assert stats.method == "rodas4" and stats.changes == 0


def test_a_mark_goes_round_with_the_belt(run: bd.Result) -> None:
    """As far as pulley 0 has turned, but for stretch and creep; once round it is back."""
    passed = run.belt.passed
    rim = (run.pulleys.theta[:, 0] - run.pulleys.theta[0, 0]) * DRIVE.route.senses[0] * 0.05
    assert passed[0] == 0.0
    np.testing.assert_allclose(passed, rim / (1.0 + run.span_tension[:, 1] / 60e3), atol=2e-3 * 1.5)
    where, part = follow(DRIVE, run.joints.force, passed, 0, 0)
    assert where[0] == 0 and part[0] == pytest.approx(0.5)
    length = float(DRIVE.info["length"])
    back = int(np.argmin(abs(abs(passed) - length)))
    at = np.interp(where + part, np.arange(DRIVE.n_bodies + 1), cell_places(DRIVE))
    moved = (at[back] - at[0]) - (abs(passed[back]) - length) * np.sign(passed[back])
    assert abs(moved) < 2e-3


def test_its_report_speaks_of_no_links(run: bd.Result) -> None:
    report = run.report()
    whole = str(report) + report.text(full=True) + str(run)
    assert "link" not in whole and "cell" in report.text(full=True)
    assert not any(row.link_passing for row in report.spans)
    assert report.belt_speed == pytest.approx(-5.0, rel=5e-3)
    creep = report.creep["fan"]
    tight, slack = (
        max(s.tension.mean for s in report.spans),
        min(s.tension.mean for s in report.spans),
    )
    assert creep.stretch == pytest.approx((tight - slack) / 60e3, rel=0.02)
    assert abs(creep.remainder) < 0.1 * creep.lost
    lost = sum(row.power for row in report.powers if row.kind == "lost")
    assert lost == pytest.approx((tight - slack) ** 2 * 5.0 / 60e3, rel=0.1)


def test_files_give_it_back(run: bd.Result, tmp_path: Any) -> None:
    run.save(tmp_path / "run.npz")
    back = bd.Result.load(tmp_path / "run.npz")
    for name, array in run._arrays().items():
        np.testing.assert_array_equal(back._arrays()[name], array)
    assert back.final_state == run.final_state and str(back.report()) == str(run.report())
    data = run.to_xarray()
    assert data["spans.deflection"].dims == ("time", "span", "mode")
    assert data["belt.flow"].dims == ("time",) and "contact.slip" not in data
    run.final_state.save(tmp_path / "state.npz")
    assert bd.State.load(tmp_path / "state.npz") == run.final_state


def test_nothing_of_its_spectrum_is_of_links(run: bd.Result) -> None:
    found = bd.spectra.spectrum(run)
    assert {one.kind for one in found.sources} == {"pulley", "belt"}
    assert bd.spectra.spectrum(run, "spans.deflection").unit == "m"


def test_its_modes_are_those_of_links() -> None:
    """As far as its mesh has them, and none beyond; within 0.7 %, by which a pair of equal spans of
    links differs with where they lie.
    """
    rest, fine = bd.settle(DRIVE), attrs.evolve(LINKS, belt=attrs.evolve(LINKS.belt, n_bodies=240))
    found, links = bd.modes(DRIVE, rest, n=5), bd.modes(fine, bd.settle(fine), n=5)
    np.testing.assert_allclose(found.frequency, links.frequency, rtol=7e-3)
    assert [name.partition(";")[0].rpartition(",")[2] for name in found.names] == [
        name.partition(";")[0].rpartition(",")[2] for name in links.names
    ]
    running = bd.modes(DRIVE, bd.settle(DRIVE, speed={"motor": 500.0}), motion={"motor": 0}, n=20)
    assert (running.frequency < running.beyond).all() and len(running) < 20
    assert "where the mesh lacks modes" in str(running)


def test_a_running_string_by_few_sines() -> None:
    """What is said of frequencies at speed, against the figures of the model's section."""
    assert cells.modes_off(0.5, 2)[0] == pytest.approx(0.014, abs=1e-3)
    assert cells.modes_off(0.5, 4)[0] == pytest.approx(0.0017, abs=1e-4)
    np.testing.assert_allclose(cells.modes_off(0.0, 4), 0.0, atol=1e-12)


def test_what_it_does_not_describe_is_refused_by_name() -> None:
    small = attrs.evolve(PULLEYS[0], radius=0.009)
    stiff = attrs.evolve(BELT, bending_stiffness=0.5, preload=2000.0)
    with pytest.raises(ValueError, match=r'^belt\.mesh "ale" needs a wrap of 2 times .* "joint"$'):
        attrs.evolve(DRIVE, pulleys=[small, PULLEYS[1]], belt=stiff)
    near = [attrs.evolve(one, radius=0.05, center=(0.12 * k, 0.0)) for k, one in enumerate(PULLEYS)]
    with pytest.raises(ValueError, match=r'needs a span of 4 times .* behind pulley "motor"'):
        attrs.evolve(DRIVE, pulleys=near, belt=attrs.evolve(stiff, preload=500.0))
    with pytest.raises(ValueError, match="needs two pulleys at least"):
        attrs.evolve(DRIVE, pulleys=PULLEYS[:1], belt=attrs.evolve(BELT, bending_stiffness=0.0))
    for changes in ({"friction": True}, {"offset": {1: (-1e-3, 0.0)}}, {"shift": 0.01}):
        with pytest.raises(
            ValueError, match=rf'^{next(iter(changes))} is none of a belt on .* "ale"'
        ):
            bd.settle(DRIVE, **changes)
    with pytest.raises(ValueError, match=r'the ALE mesh has cells alone, model "auto"$'):
        attrs.evolve(DRIVE, belt=attrs.evolve(BELT, model="links"))


def test_it_warns_near_its_limits(run: bd.Result) -> None:
    assert not run.warnings and not DRIVE._noticed
    bent = attrs.evolve(DRIVE, belt=attrs.evolve(BELT, bending_stiffness=0.6))
    assert {one.code for one in bent._noticed} == {"near_limit"}
    tensioned = attrs.evolve(DRIVE, tensioning=bd.Tensioning(friction=True))
    assert [one.code for one in tensioned._noticed] == ["tensioning"]
    assert "tensioned without friction" in str(tensioned)
    t = np.linspace(0.0, 0.01, 11)
    with pytest.warns(bd.AccuracyWarning, match="^span_modes: span .* runs at .* sine modes"):
        fast = bd.simulate(
            DRIVE, bd.Viscous([0.0, 0.0]), 0.01, {"motor": bd.PiecewiseLinear([0.0], [900.0])},
            t_eval=t,
        )  # fmt: skip
    assert fast.success


def test_it_is_told_of_where_it_would_be_much_cheaper(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the steps that links took; not where the belt is slow, and not where ALE belts are refused
    or the paper's mesh is asked for. What runs tell is what runs with it take.
    """
    for speed, end, times in ((400.0, 0.05, 10), (20.0, 0.005, 0)):
        motion = {"motor": bd.PiecewiseLinear([0.0], [speed])}
        links, flows = (
            bd.simulate(one, SCENE.torque_fn, end, motion, rtol=1e-2) for one in (LINKS, DRIVE)
        )
        told = [one for one in links.accuracy.notes if one.startswith('Belt(mesh="ale")')]
        assert len(told) == (times > 0) and not flows.accuracy.notes
        assert links.stats.steps > times * flows.stats.steps
        assert all(one in " ".join(str(links.report()).split()) for one in told)
    fast, few = {"motor": bd.PiecewiseLinear([0.0], [400.0])}, ("pulleys.omega",)
    short = bd.simulate(LINKS, SCENE.torque_fn, 0.01, fast, rtol=1e-2, outputs=few)
    assert short.accuracy.notes[0].startswith('Belt(mesh="ale")')  # with no tension to look at
    paper = attrs.evolve(LINKS, belt=attrs.evolve(LINKS.belt, mesh="paper"))
    tensioned = attrs.evolve(LINKS, tensioning=bd.Tensioning(friction=True))
    for drive in (DRIVE, paper, tensioned):
        assert cells.instead(drive) is None and 'on Belt(mesh="ale")' not in str(drive)
    assert 'm/s on Belt(mesh="ale")' in str(LINKS)
    monkeypatch.setattr("beltdyn.accuracy.suggestion.MIN_CPU_TIME", 0.0)
    monkeypatch.setattr(cells, "CHEAPER", 0.0)
    found = bd.accuracy.suggest(SCENE._replace(params=LINKS, t_end=0.002), 0.1)
    assert found.ale is not None and found.ale[0] > 0.0 and found.ale[1] < 0.1
    assert 'With Belt(mesh="ale") the scene took' in " ".join(str(found).split())


def test_it_is_verified_by_other_cells() -> None:
    """Errors in time and of the mesh, each from other runs, named as what they are."""
    accuracy = bd.simulate(*SCENE, rtol=1e-3, verify=True).accuracy
    assert accuracy.verified and any("cells with" in one for one in accuracy.runs)
    assert accuracy["tension"].total < 0.02 and accuracy["creep"].total < 0.05


def test_what_accuracy_costs_of_it() -> None:
    """Implicit methods alone; errors are known far below those that links have on their meshes."""
    found = bd.accuracy.study(SCENE._replace(t_end=0.03), rtols=[1e-2, 1e-3], n_bodies=[19, 38])
    assert {row.setting.method for row in found.done()} == {"auto", "rodas4", "lbdf2"}
    assert found.space_floor["tension"] < 2e-3 and found.time_floor[38]["tension"] < 1e-3
    assert "19, 38 cells" in str(found) and "link" not in str(found) + found.table()


def test_the_command_line_takes_it() -> None:
    """Any scene on the mesh asked for, with cells that are chosen."""
    ran = CliRunner().invoke(main, ["run", "unequal-pulleys", "--mesh", "ale", "--t-end", "0.02"])
    assert ran.exit_code == 0, ran.output
    shown = CliRunner().invoke(main, ["show", "serpentine", "--mesh", "ale"])
    assert shown.exit_code == 0 and "chosen" in shown.output
    refused = CliRunner().invoke(main, ["run", "hard/sigma-1e8", "--mesh", "ale"])
    assert refused.exit_code == 2 and "of its own mesh" in refused.output


def test_pictures_of_it(run: bd.Result) -> None:
    """Spans bend by their sines, and a mark goes along them."""
    ax = bd.plot.drive(run, colour=None, links={"mark": 0})
    lines = max(ax.collections, key=lambda one: len(one.get_paths())).get_paths()
    assert len(lines) == DRIVE.n_bodies
    span = lines[0].vertices
    chord = np.linspace(0.0, 1.0, len(span))[:, None] * (span[-1] - span[0]) + span[0]
    modes = run.spans.deflection[-1, 0]
    expected = abs(modes @ np.sin(0.5 * np.pi * np.arange(1, 1 + modes.size)))
    middle = np.linalg.norm((span - chord)[len(span) // 2])
    assert middle == pytest.approx(expected, rel=1e-6)
    for draw in (bd.plot.tension_along, bd.plot.arcs, bd.plot.force_along_belt, bd.plot.overview):
        assert draw(run) is not None
    with pytest.raises(AttributeError, match=r"^contact\.slip was not"):
        bd.plot.friction_coefficient(run, 3, against="slip")
    modes = bd.modes(DRIVE, bd.settle(DRIVE), n=2)
    assert bd.plot.mode(modes, 1).lines


def test_what_it_simulates_and_why() -> None:
    """Links are an effect that may be left out."""
    (row,) = (one for one in removals_of(LINKED) if "links" in one.name)
    assert row.apply(LINKED).params == DRIVE
    told = bd.explain(*SCENE, ablation=False)
    dampers = [one.name for one in removals_of(SCENE) if "contact" in one.name]
    assert dampers == [one.name for one in removals_of(LINKED) if "contact" in one.name] != []
    assert {"cells", "modes"} <= set(told.state.parts) and "links" not in told.state.parts
    assert "belt that flows" in str(told)
