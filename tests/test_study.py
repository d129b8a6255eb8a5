"""What accuracy costs: studies, suggestions, budgets; costs from tables or steps, not clocks."""

from __future__ import annotations

import csv
import ctypes
import io
import math
import re
import shutil
import sqlite3
import warnings
from collections.abc import Callable, Iterable
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import Any
from unittest import mock

import attrs
import numpy as np
import pytest
from click.testing import CliRunner
from tiers import ci_if

import beltdyn as bd
from beltdyn.accuracy import QUANTITIES, studies
from beltdyn.accuracy.suggestion import chosen
from beltdyn.cli import main
from beltdyn.drive import sanity
from beltdyn.many import content
from beltdyn.many import store as stores
from beltdyn.outputs.accuracy_report import SPACE_FLOOR, WORDS
from beltdyn.verification import budget
from beltdyn.verification.forecast import LADDER, Pilot
from beltdyn.verification.quantities import Observed, differences, observe
from beltdyn.verification.runs import Done, Reached, Setting, fewest

T = np.linspace(0.0, 1.0, 401)
SCENE = bd.scenes.kubas_case_1()
SHORT = SCENE._replace(t_end=0.02)


@attrs.define
class Table:
    """Runs that are not made: error space * (30 / n)^2 and factor * rtol, and a cost of each."""

    space: float = 0.2
    noise: float = 0.0
    factors: dict[str, float] = attrs.field(
        factory=lambda: {"lbdf2": 0.2, "rodas4": 0.3, "tsit5": 0.1, "auto": 0.3}
    )
    now: float = 0.0
    runs: list[Setting] = attrs.field(factory=list)

    def told(self, one: Setting) -> bd.accuracy.Accuracy:
        drive = bd.accuracy.with_links(SCENE.params, one.n_bodies)
        errors = {"space": sanity.mesh_error(drive)["tension"], "time": 5.0 * one.rtol}
        tension = bd.accuracy.QuantityError(quantity="tension", **errors)
        return bd.accuracy.Accuracy(errors=(tension,))

    def cost(self, one: Setting) -> float:
        if one.method == "tsit5":  # for a second, as far as the stability of the mesh allows
            bound = bd.accuracy.with_links(SCENE.params, one.n_bodies).info["spectral_bound"]
            return float(bound) / 2.5 * (1e-6 + 5e-8 * one.n_bodies)
        order = {"lbdf2": 0.7, "rodas4": 0.25}.get(one.method, 0.3)
        return (0.002 if one.method == "lbdf2" else 0.02) * one.n_bodies / 60 * one.rtol**-order

    def errors(self, one: Setting) -> tuple[float, float]:
        return self.space * (30.0 / one.n_bodies) ** 2, self.factors[one.method] * one.rtol

    def __call__(self, one: Setting) -> Done:
        self.runs.append(one)
        self.now += self.cost(one)
        of_space, of_time = self.errors(one)
        # Functions of root mean square 1, orthogonal to each other.
        tension = of_space * math.sqrt(2) * np.sin(2 * np.pi * T)
        tension = tension + of_time * math.sqrt(2) * np.sin(6 * np.pi * T)
        if self.noise:
            random = np.random.default_rng([one.n_bodies, round(-1000 * math.log10(one.rtol))])
            tension = tension + self.noise * random.standard_normal(T.size)
        both = np.column_stack([tension, tension])
        rest = dict.fromkeys(("span_mean", "creep", "friction", "power"), np.zeros(2))
        scales = dict.fromkeys(QUANTITIES, 1.0)
        seen = Observed(t=T, tension=both, speed=0.0 * both, scales=scales, **rest)
        return Done(cpu=self.cost(one), steps=100, seen=seen, accuracy=self.told(one))

    def brute(self, error: float) -> float:
        """Cost of the cheapest setting of the ladder, each on the coarsest mesh that does."""
        costs = []
        for method, rtol in (*LADDER, ("tsit5", error)):
            if (of_time := self.factors[method] * rtol) < error:
                links = 30.0 * math.sqrt(self.space / math.sqrt(error**2 - of_time**2))
                costs.append(self.cost(Setting(max(20, math.ceil(links)), method, rtol)))
        return min(costs)


def suggested(
    table: Table, error: float = 1e-2, limit: float = math.inf, run: Any = None, **changes: Any
) -> Any:
    scene = SCENE._replace(params=attrs.evolve(SCENE.params, **changes))
    pilot = Pilot(run or table, SCENE.params, "tension", limit=limit, clock=lambda: table.now)
    return chosen(pilot, scene, error, "tension")


@pytest.mark.parametrize("space", [0.02, 0.5])
def test_the_setting_suggested_is_right_and_cheap(space: float) -> None:
    for error in (3e-2, 1e-2, 1e-3):
        table = Table(space=space)
        suggestion = suggested(table, error)
        one = suggestion.setting
        assert suggestion.met
        # both parts of the histories are independent
        assert math.hypot(*table.errors(one)) <= 1.1 * error
        assert table.cost(one) == pytest.approx(suggestion.seconds, rel=0.3)
        assert table.cost(one) <= 1.5 * table.brute(error)
        if error == 1e-2 and space == 0.5:  # a mesh is extrapolated, not run
            assert max(one.n_bodies for one in table.runs) < suggestion.n_bodies
            assert table.errors(one)[0] == pytest.approx(suggestion.error_space, rel=0.1)


def test_a_mesh_between_those_tried_is_tried() -> None:
    """Its error may jump, as where spans resonate with the links that pass."""

    class Jumping(Table):
        def errors(self, one: Setting) -> tuple[float, float]:
            of_space, of_time = super().errors(one)
            return of_space * (1.0 if one.n_bodies in (24, 48, 96, 192) else 3.0), of_time

    suggestion = suggested(table := Jumping(space=0.5), 0.07)
    assert suggestion.met and math.hypot(*table.errors(suggestion.setting)) <= 0.07
    assert table.brute(0.07) < suggestion.seconds < 2.0 * table.brute(0.07)


def test_what_cannot_be_had_is_said() -> None:
    """An error, where histories depend on every detail; rigid pulleys, where the contact yields."""
    suggestion = suggested(Table(noise=0.05), limit=20.0)
    assert not suggestion.met and suggestion.error > 0.03
    text = " ".join(str(suggestion).split())
    assert "cannot be promised" in text and f"{suggestion.error / 1e-2:.2g} times" in text
    # Meshes that agree, but do not converge, are not believed beyond what any result would say.
    table = Table(space=0.0, noise=1e-4)
    pilot = Pilot(table, SCENE.params, "tension", limit=20.0, clock=lambda: table.now)
    pilot.explore(1e-2)
    for links, error in zip(pilot.meshes, pilot.space_errors, strict=True):
        said = sanity.mesh_error(bd.accuracy.with_links(SCENE.params, links))["tension"]
        assert error >= said / 3.0 > 1e-4
    best = suggested(table := Table(space=0.5), 1e-6, limit=1.0)
    assert not best.met and best.error_space >= SPACE_FLOOR, "results tell errors no better"
    # The last run may begin just before the limit; it costs no more than it was expected to.
    assert table.now <= 2.0
    soft, stiff = suggested(Table()), suggested(Table(), contact=bd.Contact(compensate=True))
    assert soft.error_contact == -SCENE.params.compliance.relative_tension_change
    assert soft.error_contact > 0.01 > stiff.error_contact
    for one, says in ((soft, True), (stiff, False)):
        assert ("against rigid pulleys" in " ".join(str(one).split())) is says


def pilot_of(table: Table, limit: float) -> Pilot:
    pilot = Pilot(table, SCENE.params, "tension", limit=limit, clock=lambda: table.now)
    pilot.explore(1e-2)
    return pilot


def test_a_pilot_tells_what_it_has_measured() -> None:
    """Or what a result would say, where not even one loose run is affordable."""
    table, probe = Table(), ("lbdf2", 3e-2)
    first = table.cost(Setting(2 * fewest(SCENE.params), *probe))
    assert pilot_of(table, 0.5 * first).time_errors == {probe: 0.15}, "the claim of the run"
    loose = pilot_of(Table(), 1.5 * first).time_errors
    true = {pair: table.errors(Setting(24, *pair))[1] for pair in loose}
    assert probe in loose and len(loose) == 2
    for pair, error in loose.items():  # errors that add up differ by 0.7 of the larger one
        assert 0.8 * true[pair] <= error <= 3.0 * true[pair]


def test_a_pilot_forgets_nothing_and_goes_on_beyond_it() -> None:
    """Tolerances that were not tried are expected to be better than those, at a price, not free."""
    pilot = pilot_of(table := Table(space=0.5), 20.0)
    known = dict(pilot.time_errors)
    table.now += 20.0  # nothing further is affordable
    pilot.explore(1e-5)
    assert pilot.time_errors == known
    untried = {one.method: one for one in pilot.settings() if (one.method, one.rtol) not in known}
    assert "rodas4" in untried
    for one in map(pilot.forecast, untried.values()):
        same = Setting(pilot.time_mesh, one.setting.method, one.setting.rtol)
        least = min(error for (name, _), error in known.items() if name == same.method)
        assert table.errors(same)[1] <= one.time < least
        assert pilot.seconds(same) >= table.cost(same)
    # two meshes suffice to look further than them
    two = pilot_of(table := Table(space=0.5), 8.0 * table.cost(Setting(24, "lbdf2", 3e-2)))
    assert len(two.meshes) == 2 and two.most == 4 * two.meshes[-1]


def test_settings_that_fail_are_left_out() -> None:
    """If all do, the drive never runs, and its error is raised."""
    table = Table()

    def run(one: Setting) -> Done:
        if one.method == "lbdf2":
            raise bd.SimulationError("no")
        return table(one)

    assert suggested(table, run=run).method != "lbdf2"
    with pytest.raises(bd.SimulationError, match="off the pulley"):
        suggested(table, run=mock.Mock(side_effect=bd.SimulationError("off the pulley")))


def test_bad_arguments() -> None:
    suggest, study = bd.accuracy.suggest, bd.accuracy.study
    rows: list[tuple[Any, dict[str, Any], type[Exception]]] = [
        *((suggest, {"error": error}, ValueError) for error in (0.0, 1e-9, 2.0)),
        (suggest, {"quantity": "torque"}, ValueError),
        (suggest, {"limit": -1.0}, ValueError),
        (study, {"methods": "auto"}, TypeError),
        (study, {"methods": ("rk4",)}, ValueError),
        (study, {"n_bodies": ()}, ValueError),
        (study, {"rtols": ()}, ValueError),
        (study, {"finest": 60, "n_bodies": (60,)}, ValueError),
        (study, {"limit": 0.0}, ValueError),
    ]
    for ask, arguments, error in rows:
        with pytest.raises(error, match=next(iter(arguments))):
            ask(SHORT, **arguments)
    message = r"^scene must be a bd\.Scene\(params, torque_fn, t_end\)"
    for ask, wrong in ((study, SCENE.params), (suggest, SCENE[:2]), (suggest, None)):
        with pytest.raises(TypeError, match=message):
            ask(wrong)
    expected = bd.accuracy.Expected(quantity="tension", space=0.1, time=0.1)
    for others in (
        {"method": "rodas4"},
        {"rtol": 1e-3},
        {"step": 1e-5},
        {"verify": True},
        {"expected": expected},
    ):
        with pytest.raises(ValueError, match="budget chooses"):
            bd.simulate(*SHORT, budget=1.0, **others)
    with pytest.raises(TypeError, match=r"expected must be a bd\.accuracy\.Expected, got float"):
        bd.simulate(*SHORT, expected=0.01)


def test_a_suggestion_is_run_as_it_says() -> None:
    """Its options carry the errors expected, which the result tells; no warning says otherwise."""
    suggestion = bd.accuracy.suggest(SHORT, error=0.05)
    result = bd.simulate(*suggestion.scene, **suggestion.options)
    said = result.accuracy["tension"]
    assert (said.space, said.time) == (suggestion.error_space, suggestion.error_time)
    expected = bd.accuracy.Expected(quantity="tension", space=1e-3, time=1e-3)
    with warnings.catch_warnings(record=True) as issued:
        fine = bd.simulate(*SHORT._replace(t_end=1e-3), expected=expected)
    assert "mesh" in [one.code for one in SHORT.params._noticed]
    assert "mesh" not in [one.code for one in fine.warnings]
    assert not any("straight links" in str(one.message) for one in issued)
    assert result.params.belt.n_bodies == suggestion.n_bodies
    assert result.stats.method == suggestion.method
    assert suggestion.params.belt.mesh == SHORT.params.belt.mesh
    finer = bd.accuracy.with_links(SHORT.params, 240)
    fine = bd.simulate(finer, *SHORT[1:], method="rodas4")
    assert suggestion.met and differences(observe(result), observe(fine))["tension"] <= 0.05
    for params in (SHORT.params, bd.scenes.get("serpentine").params):
        coarse = bd.accuracy.with_links(params, fewest(params)).info["link_length"]
        assert 2.0 * math.pi * min(pulley.radius for pulley in params.pulleys) / coarse > 5.0


class Counted:
    """Simulates, and takes the time that the steps would take."""

    def __init__(self) -> None:
        self.now = 0.0

    def simulate(self, *args, watch: Callable[[Reached], None], **options) -> bd.Result:
        result = bd.simulate(*args, **options)
        stats = result.stats
        method = 4 if stats.njev else 1
        seconds = 1e-7 * result.params.belt.n_bodies * method * (stats.steps + stats.rejected)
        self.now += seconds
        watch(Reached(result.final_state, result.t[-1], stats.steps, "auto"))
        return attrs.evolve(result, stats=attrs.evolve(stats, cpu_time=seconds))

    def plan(self, seconds: float) -> budget.Plan:
        options: dict[str, Any] = {"initial": None, "clock": lambda: self.now}
        times = np.linspace(0.0, SHORT.t_end, 201)
        return budget.plan(self.simulate, bd.settle, SHORT, seconds, t_eval=times, **options)


def test_a_budget_that_is_not_used_up_buys_nothing() -> None:
    """The plan says so: the pilot knows of nothing better."""
    plan = (counted := Counted()).plan(0.01)
    assert "none better is known" in str(plan)
    assert counted.now + plan.forecast.seconds < 0.8 * plan.budget


@pytest.mark.parametrize(
    "budgets", ci_if(lambda row: len(row) > 2, [[0.006, 0.03], [0.006, 0.02, 0.03]])
)
def test_more_budget_buys_more_accuracy_and_is_kept(budgets: list[float]) -> None:
    errors = []
    for seconds in budgets:
        counted = Counted()
        plan = counted.plan(seconds)
        chosen = {"initial": plan.initial, **plan.forecast.setting.options}
        counted.simulate(plan.params, *SHORT[1:], watch=lambda _t: None, **chosen)
        assert 0.5 * seconds <= counted.now <= seconds
        assert "better ones would take too long" in str(plan)
        errors.append(plan.forecast.error)
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.5 * errors[0]


def test_a_budget_that_was_exceeded_is_a_warning() -> None:
    plan = attrs.evolve(Counted().plan(0.01), budget=1.0)
    setting = plan.forecast.setting.options
    plain = bd.simulate(plan.params, *SHORT[1:], **setting)
    run = bd.simulate(plan.params, *SHORT[1:], **setting, expected=plan.expected)
    kept, none = plan.judge(run, 0.9)
    assert none == () and str(plan) in kept.message and str(plan) in kept.stats.choice
    # one estimate: what was expected is what the result says, in the same digits
    one, said = kept.accuracy["tension"], plan.forecast
    assert (one.space, one.time) == (said.space, said.time)
    for words in (f"{100.0 * said.space:.2g} % of the mesh", f"{100.0 * said.time:.2g} %"):
        assert words in str(plan) and words in dict(kept.summary())[f"  {WORDS['tension']}"]
    assert kept.accuracy["span_mean"].total == one.total
    assert f"{run.stats.error:.2g}" not in dict(kept.summary(verbose=True)).values()
    assert kept.accuracy["creep"] == plain.accuracy["creep"]
    exceeded, (warning,) = plan.judge(run, 1.5)
    assert warning.code == "budget" and warning in exceeded.warnings
    assert "1.5 s" in warning.text and "1 s" in warning.text
    with pytest.raises(ValueError, match=r"budget is too small: .* take about .* got 1e-05 s"):
        Counted().plan(1e-5)


def test_simulate_says_what_it_chose() -> None:
    """A given state keeps its mesh."""
    result = bd.simulate(*SHORT, budget=0.5, initial=bd.settle(SHORT.params))
    assert result.success and result.params == SHORT.params
    assert "the mesh is that of initial" in result.message
    assert f"with n_bodies = {result.params.belt.n_bodies}" in result.message
    assert "chosen for 0.5 s" in result.message
    assert "chosen for 0.5 s" in dict(result.summary(verbose=True))["method"]


QUICK = {"methods": ("rodas4", "lbdf2"), "rtols": (1e-1, 1e-3), "n_bodies": (24, 48, 96)}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[bd.accuracy.Study, Path]:
    store = tmp_path_factory.mktemp("study") / "runs"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stores, "_LEAST", 0.0)  # written as the runs end
        return bd.accuracy.study(SHORT, store=store, **QUICK), store


def kept(parts: Iterable[Path]) -> list[str]:
    """Return the keys of the runs in parts of a store."""
    found: list[str] = []
    for part in parts:
        with closing(sqlite3.connect(part)) as db:
            found += [key for (key,) in db.execute("SELECT key FROM runs ORDER BY key")]
    return sorted(found)


def test_a_quick_study_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a run that takes long it has one mesh and the beginning alone."""
    seconds = {}

    def runs(scene: bd.Scene, *_: Any) -> Callable[[Setting], Done]:
        return lambda one: Done(
            cpu=seconds[one.n_bodies], steps=1, seen=mock.Mock(), accuracy=mock.Mock()
        )

    monkeypatch.setattr(studies, "Runs", runs)
    whole = {}
    for cost in (0.05, 0.2, 4.0):
        seconds[30] = cost
        scene, options = bd.accuracy.quick(SCENE)
        whole[cost] = (options["n_bodies"], scene.t_end)
    assert whole[0.05] == ([30, 60], SCENE.t_end)
    assert whole[0.2] == ([30], SCENE.t_end)
    assert whole[4.0][0] == [30] and whole[4.0][1] <= 0.1 * SCENE.t_end


def test_errors_of_a_study(made: tuple[bd.accuracy.Study, Path]) -> None:
    """They fall with mesh and tolerance, and add up: by the triangle, with the references' floor.

    The references are of unrelated methods.
    """
    study, _ = made
    assert [row.setting for row in study.rows] == [
        Setting(n_b, method, rtol)
        for n_b, method, rtol in product(QUICK["n_bodies"], QUICK["methods"], QUICK["rtols"])
    ]
    assert study.finest == 192
    space = [found["tension"] for found in study.space.values()]
    assert space[0] > 2.0 * space[1] > 4.0 * space[2] > 0.0
    for loose, tight in zip(study.rows[::2], study.rows[1::2], strict=True):
        assert tight.time["tension"] < loose.time["tension"]
        assert tight.steps > loose.steps
    for row in study.rows:
        assert row.seconds > 0.0 and row.repeats >= 1 and row.steps > 0
        assert set(row.error) == set(row.time) == set(QUANTITIES)
        n_b = row.setting.n_bodies
        parts = study.space[n_b]["tension"] + row.time["tension"] + study.time_floor[n_b]["tension"]
        assert row.error["tension"] <= 1.001 * parts
        assert study.believed(row, "tension") >= study.space[n_b]["tension"]
    for line in study.references:
        links, _, pair = line.partition(" links: ")
        first, second = pair.split(" and ")
        assert first.split()[0] != second.split()[0]
        # as tight as what is compared asks for, no tighter
        assert 1e-5 <= float(first.split()[-1]) <= (1e-4 if int(links) < study.finest else 1e-3)
    for floor, of_space in zip(study.time_floor.values(), study.space.values(), strict=True):
        assert floor["tension"] < of_space["tension"]
    front = study.front("tension")
    errors = [study.believed(row, "tension") for row in front]
    assert errors == sorted(errors, reverse=True)
    assert study.cheapest(errors[0], "tension") == front[0]
    assert study.cheapest(0.99 * errors[-1], "tension") is None
    target = 0.5 * (errors[0] + errors[-1])
    best = study.cheapest(target, "tension")
    assert best == next(row for row in front if study.believed(row, "tension") <= target)


def test_a_study_goes_on_where_it_was_interrupted(
    made: tuple[bd.accuracy.Study, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is finished runs nothing again."""
    study, store = made
    simulate = mock.Mock(side_effect=bd.simulate)
    monkeypatch.setattr(studies, "simulate", simulate)
    again = bd.accuracy.study(SHORT, store=store, **QUICK)
    assert again.rows == study.rows and again.to_csv() == study.to_csv()
    assert not simulate.called
    parts = sorted(store.iterdir())
    torn = tmp_path / "torn"
    torn.mkdir()
    for part in parts[:-2]:
        shutil.copy(part, torn)
    half = parts[-2]
    (torn / f".{half.name}").write_bytes(half.read_bytes()[:40])  # killed while it wrote a part
    again = bd.accuracy.study(SHORT, store=torn, **QUICK)
    runs = [(one.args[0].belt.n_bodies, one.kwargs) for one in simulate.mock_calls]
    done = {(links, kwargs["method"], kwargs["rtol"]) for links, kwargs in runs}
    assert len(done) == len(kept(parts[-2:])) > 1
    assert [row.error for row in again.rows] == [row.error for row in study.rows]
    assert kept(torn.glob("part-*")) == kept(parts)


def test_another_scene_is_not_taken_for_the_same(
    made: tuple[bd.accuracy.Study, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor a store of something else, nor a scene that cannot be told from others."""
    store = tmp_path / "runs"
    shutil.copytree(made[1], store)
    simulate = mock.Mock(side_effect=RuntimeError("not run again"))
    monkeypatch.setattr(studies, "simulate", simulate)
    for other in (SHORT._replace(t_end=0.021), SHORT._replace(torque_fn=bd.Viscous([0.0, 1.0]))):
        with pytest.raises(RuntimeError, match="not run again"):
            bd.accuracy.study(other, store=store, **QUICK)
    with monkeypatch.context() as patch, pytest.raises(RuntimeError, match="not run again"):
        patch.setattr(content, "_build", lambda: "another")  # whose records may lack a field
        bd.accuracy.study(SHORT, store=store, **QUICK)
    path = tmp_path / "scene.toml"
    text = SHORT.to_toml(path)
    with pytest.raises(ValueError, match="it is a file; a store is a folder of its own"):
        bd.accuracy.study(SHORT, store=path, **QUICK)
    assert path.read_text() == text
    row = ctypes.POINTER(ctypes.c_double)
    compiled = ctypes.CFUNCTYPE(None, ctypes.c_double, row, row, row, ctypes.c_void_p)
    scene = SHORT._replace(torque_fn=compiled(lambda *_: None))
    with pytest.raises(ValueError, match="store: runs are known by their content, and what"):
        bd.accuracy.study(scene, store=tmp_path / "more")


def test_runs_under_a_function_are_kept(tmp_path: Path) -> None:
    """They are known by what the function does."""

    def study(gain: float) -> list[str]:
        scene = SHORT._replace(torque_fn=lambda _t, _theta, omega: -gain * omega)
        settings: Any = {"methods": ("lbdf2",), "rtols": (1e-1,), "n_bodies": (30,), "finest": 31}
        bd.accuracy.study(scene, store=tmp_path, **settings)
        return kept(tmp_path.glob("part-*"))

    first = study(0.1)
    assert study(0.1) == first and len(study(0.2)) == 2 * len(first)


def test_a_failed_setting_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*args, **options):
        if options["method"] == "lbdf2" and options["rtol"] == 0.1:
            raise bd.SimulationError("gaped: at once")
        return bd.simulate(*args, **options)

    monkeypatch.setattr(studies, "simulate", fail)
    found = bd.accuracy.study(SHORT, methods=("lbdf2",), rtols=(1e-1, 1e-2), n_bodies=(30,))
    bad, good = found.rows
    assert bad.failure == "gaped: at once" and math.isnan(bad.seconds) and not good.failure
    assert "failed: gaped" in found.table() and list(found.done()) == [good]


def test_a_table_csv_and_figure_hold_all_runs(
    made: tuple[bd.accuracy.Study, Path], tmp_path: Path
) -> None:
    study, _ = made
    rows = list(csv.DictReader(io.StringIO(study.to_csv(tmp_path / "study.csv"))))
    assert (tmp_path / "study.csv").read_text() == study.to_csv()
    for line, row in zip(rows, study.rows, strict=True):
        assert float(line["cpu_seconds"]) == row.seconds
        assert float(line["tension_error"]) == row.error["tension"]
        assert float(line["power_time"]) == row.time["power"]
    assert len(study.table("creep").splitlines()) == len(rows) + 2
    assert all(f"\n{quantity} " in str(study) for quantity in QUANTITIES)
    figure = study.plot("speed", error=0.02)
    assert len(figure.axes) == 4
    labels = [line.get_label() for line in figure.axes[0].get_lines()]
    assert set(QUICK["methods"]) <= set(labels)


def written(folder: Path) -> Path:
    path = folder / "drive.toml"
    SHORT._replace(params=bd.accuracy.with_links(SHORT.params, 30), t_end=4e-3).to_toml(path)
    return path


@pytest.mark.ci(guard="test_study.py::test_a_table_csv_and_figure_hold_all_runs")
def test_the_command_accuracy_writes_what_is_asked(tmp_path: Path) -> None:
    out, plot = tmp_path / "price.csv", tmp_path / "price.png"
    arguments = ["accuracy", str(written(tmp_path)), "--quick", "--quantity", "speed"]
    done = CliRunner().invoke(main, [*arguments, "--out", str(out), "--plot", str(plot)])
    assert done.exit_code == 0, done.output
    assert "error of speed" in done.stdout
    assert len(out.read_text().splitlines()) > 10
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_the_command_run_takes_an_error_or_a_budget(tmp_path: Path) -> None:
    scene_file = written(tmp_path)
    done = CliRunner().invoke(main, ["run", str(scene_file), "--error", "0.05", "--full"])
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("For an error of 5 % of tension")
    text = " ".join(re.sub("[^ -~]", " ", done.stdout).split())
    (mesh,) = re.findall(r"expected error \S+ % \((\S+ %) of the mesh", text)
    assert text.count(f"{mesh} of the mesh") == 3, "foreseen, and of the run's tension and its mean"
    for options in (
        ("--error", "0.1", "--rtol", "1e-3"),
        ("--error", "0.1", "--budget", "1"),
        ("--budget", "1", "--method", "rodas4"),
        ("--error", "-1"),
        ("--budget", "1e-6"),
    ):
        done = CliRunner().invoke(main, ["run", str(scene_file), *options])
        assert done.exit_code == 2
        assert options[0].strip("-") in done.stderr
