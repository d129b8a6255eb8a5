"""A report as a whole: twelve questions, how it reads, what it gives, what it cannot tell."""

from __future__ import annotations

import functools
import json
import math
import re
import subprocess
import sys
from typing import Any

import attrs
import drives
import numpy as np
import pandas
import pytest

import beltdyn as bd
from beltdyn import _core
from beltdyn.base.rounding import percent, rounded
from beltdyn.base.tables import fitted
from beltdyn.outputs.averages import span_of
from beltdyn.report import Rows, brief, digits
from beltdyn.report.rows import RESIDUAL, MountRow, Spread
from beltdyn.report.text import tables

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


@functools.cache
def result(t_end: float = 0.4, **options: Any) -> bd.Result:
    """A small accessory drive: crank, alternator, an idler on the back of the belt."""
    belt = {"n_bodies": 100, "linear_density": 0.1, "axial_stiffness": 60e3, "axial_damping": 2.0}
    back = {"inertia": 3e-4, "side": "outside"}
    params = bd.Params(
        belt=bd.Belt(preload=400.0, **belt),
        pulleys=[
            bd.Pulley(name="crank", center=(0.0, 0.0), radius=0.08, inertia=3e-3),
            bd.Pulley(name="alternator", center=(0.30, 0.12), radius=0.035, inertia=1e-3),
            bd.Pulley(name="idler", center=(0.17, 0.035), radius=0.035, **back),
        ],
        friction=bd.Dahl(mu_k=0.8, sigma=2e4),
    )
    load = bd.Load("alternator", coulomb=5.0, factor=bd.PiecewiseLinear([0.1, 0.15], [0.0, 1.0]))
    motion = {"crank": bd.PiecewiseLinear([0.0, 0.1], [0.0, 100.0])}
    return bd.simulate(params, load, t_end, motion, **options)


@functools.cache
def report() -> bd.Report:
    return result().report(0.25)


def test_twelve_questions_of_a_stranger() -> None:
    """Each is answered by a number or a text of the report, and by a row of what it prints."""
    told = report()
    text, alternator = told.text(full=True), told.pulleys["alternator"]
    (span,) = (row for row in told.spans if row.name == "crank to alternator")
    answers: dict[str, Any] = {
        "what load do the alternator's bearings carry?": alternator.hub_load.mean,
        "in which direction?": alternator.hub_direction,
        "how far is it from slipping?": alternator.margin,
        "at which torque does it slip?": alternator.slip_torque,
        "which pulley slips first?": told.first_to_slip.name,
        "where does the power go?": told.efficiency,
        "how much of it is friction on the crank?": told.powers["friction on crank"].power,
        "how fast is the alternator, in 1/min?": alternator.speed.mean * 30.0 / math.pi,
        "why is it slower than its radius says?": told.creep["alternator"].creep,
        "how tight is the tight span?": span.tension.mean,
        "does a span resonate?": span.lateral,
        "what load cycles does a link go through?": told.cycles[0].range,
    }
    for question, answer in answers.items():
        if isinstance(answer, float):
            assert math.isfinite(answer) and answer != 0.0, question
            digits = f"{abs(answer):.2e}".replace(".", "")[:2]
            percent = f"{100.0 * abs(answer):.2e}".replace(".", "")[:2]
            bare = text.replace(".", "")
            assert digits in bare or percent in bare, question
        else:
            assert f"{answer} slips first" in text
    assert not told.unsteady, "can the means be trusted?"


def test_numbers_are_those_of_the_run() -> None:
    run = result()
    before = {name: array.copy() for name, array in run.pulleys.arrays().items()}
    told = run.report(0.25)
    for name, array in run.pulleys.arrays().items():
        assert np.array_equal(array, before[name]), "what it reads off is left as it was"
    late = run.t >= told.begin
    assert told.samples == late.sum() and told.end == run.t[-1]
    for k, row in enumerate(told.pulleys):
        assert row.torque is not None
        omega = run.pulleys.omega[late, k]
        assert row.speed.mean == pytest.approx(np.trapezoid(omega, run.t[late]) / 0.1, rel=1e-9)
        assert (row.speed.least, row.speed.most) == (omega.min(), omega.max())
    # What the belt gives up in tension round a pulley is its torque over the radius.
    tensions = [row.tension.mean for row in told.spans if row.tension is not None]
    torque = told.pulleys["alternator"].belt_torque
    assert abs(torque) / 0.035 == pytest.approx(abs(tensions[0] - tensions[1]), rel=5e-3)
    # Bearings carry what both spans pull with, less rho v^2.
    way, row = run.params.route, told.pulleys["idler"]
    before, after = way.arrive[2] - way.leave[1], way.arrive[0] - way.leave[2]
    mass = 0.1 * (told.belt_speed or 0.0) ** 2
    pull = (tensions[2] - mass) * after / np.linalg.norm(after)
    pull = pull - (tensions[1] - mass) * before / np.linalg.norm(before)
    assert row.hub_load.mean == pytest.approx(float(np.hypot(*pull)), rel=5e-3)
    assert row.hub_direction == pytest.approx(math.atan2(pull[1], pull[0]), abs=0.01)
    # The summary tells the creep of the report, of the whole run, which prints it in percent.
    rows, told = dict(run.summary()), run.report()
    split = told.creep["alternator"]
    slower = 100.0 * (1.0 - split.ratio / split.nominal)
    # to the two digits that are left of a creep whose error is not known
    assert rows["  speed lost against crank"].startswith(f"alternator: {slower:.2g}")
    creep = f"alternator: {100.0 * split.creep * split.slower / split.lost:.2g}"
    assert rows["    by creep alone"].startswith(creep)
    line = next(one for one in told.text(full=True).splitlines() if f"{split.ratio:.4g}" in one)
    printed = [float(cell) for cell in line.split()[2:]]
    assert printed[0] == pytest.approx(slower, abs=5e-3)
    assert sum(printed[1:]) == pytest.approx(printed[0], abs=2.5e-2)  # five numbers' rounding


def test_headings_and_summaries_have_the_units_of_their_numbers() -> None:
    """The numbers are in SI units; what is printed of them is scaled as its heading says."""
    told, run = report(), result()
    printed, titles = {}, " ".join(table.title for table in tables(told))
    for table in tables(told):
        columns = zip(*table.rows, strict=True)
        printed |= {(table.title[:5], *k): v for *k, v in zip(table.heading, columns, strict=True)}
    for heading, numbers in {
        ("Speed", "1/min"): [30.0 / math.pi * one.speed.mean for one in told.pulleys],
        ("Speed", "rad/s"): [one.speed.mean for one in told.pulleys],
        ("Speed", "torque"): [one.torque.mean for one in told.pulleys],
        ("Speed", "power"): [one.power.mean for one in told.pulleys],
        ("Hub l", "hub load N"): [one.hub_load.mean for one in told.pulleys],
        ("Hub l", "to deg"): [math.degrees(one.hub_direction) for one in told.pulleys],
        ("Hub l", "wrap deg"): [math.degrees(one.wrap) for one in told.pulleys],
        ("Hub l", "slip arc deg"): [math.degrees(one.slip_arc) for one in told.pulleys],
        ("Ratio", "torque N m"): [one.belt_torque for one in told.pulleys],
        ("Spans", "mm"): [1e3 * one.length for one in told.spans],
        ("Spans", "tension"): [one.tension.mean for one in told.spans],
        ("Power", "W"): [one.power for one in told.powers],
    }.items():
        cells = [float(cell) for cell in printed[heading]]
        # two digits at least are left by errors, angles are to 1 degree; 0 is to 0.01 W
        assert cells == pytest.approx(numbers, rel=5e-2, abs=0.51 if "deg" in heading[1] else 5e-3)
    assert "torque in N m, power in W (" in titles and "Spans: tension in N," in titles
    rows, late = dict(run.summary()), run.t >= 0.8 * run.t[-1]
    for label, values, unit in (
        ("  pulley speeds", run.pulleys.omega, " rad/s"),
        ("  span tensions", run.span_tension, " N"),
    ):
        assert rows[label].endswith(unit)
        shown = [float(one.split()[-1]) for one in rows[label].removesuffix(unit).split(", ")]
        assert shown == pytest.approx(values[late].mean(axis=0), rel=1e-2)
    left = f"{run.energy.residual[-1]:.2g} J, "
    assert rows["  energy unaccounted for"].startswith(left)
    assert rows["CPU time"] == f"{run.stats.cpu_time:.3g} s"


def test_plain_numbers_and_a_table_of_pandas(monkeypatch: pytest.MonkeyPatch) -> None:
    told, plain, rows = report(), report().to_dict(), report().pulleys
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["pulleys"][0]["speed"]["mean"] == rows["crank"].speed.mean
    assert plain["driver"] == "crank"
    assert rows["idler"] is rows[2] and rows[:2] == (rows[0], rows[1])
    with pytest.raises(KeyError, match="crank, alternator, idler"):
        rows["fan"]
    frame = told.to_frame()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == ["part", "name", "quantity", "unit", "value", "text"]

    def at(part: str, name: str, quantity: str) -> Any:
        row = frame[(frame.part == part) & (frame.name == name) & (frame.quantity == quantity)]
        assert len(row) == 1, (part, name, quantity)
        return row.iloc[0]

    one = at("pulleys", "alternator", "hub_load")
    assert one.value == told.pulleys["alternator"].hub_load.mean and one.unit == "N"
    assert frame.value.dtype == float
    # units are at the fields, not read from docstrings, which -OO drops
    code = "from beltdyn.report import flat; print(flat.unit_of(flat.SpanRow, 'lateral'))"
    bare = subprocess.run([sys.executable, "-OO", "-c", code], capture_output=True, text=True)
    assert bare.stdout == "Hz\n", bare.stderr
    assert (
        "as a moving string, (c^2 - v^2) / (2 l c) with the\n            wave speed c [Hz]; 0"
        in (bd.report.SpanRow.__doc__)
    )
    # a number, or a text
    assert (frame.value.isna() <= frame.text.notna()).all()
    for row in told.powers:
        assert at("powers", row.name, "kind").text == row.kind
        assert at("powers", row.name, "power").value == row.power
    for span in told.spans:
        if span.frequency is not None:
            words = {True: "yes", False: "no", None: "may be"}[span.link_passing]
            assert at("spans", span.name, "link_passing").text == words
    assert (at("report", "", "begin").value, at("report", "", "end").value) == (0.3, 0.4)
    assert at("report", "", "belt_speed").value == told.belt_speed
    texts = {"driver": "crank", "steady": "yes", "first_to_slip": told.first_to_slip.name}
    for quantity, text in texts.items():
        assert at("report", "", quantity).text == text
    notes = frame[(frame.part == "report") & (frame.quantity == "notes")]
    assert tuple(notes.text) == told.notes
    # angles are radians in numbers, and degrees in print
    angles = frame[frame.quantity.isin(["wrap", "slip_arc", "hub_direction"])]
    assert set(angles.unit) == {"rad"} and (angles.value.abs() <= 2.0 * math.pi).all()
    direction = told.pulleys["alternator"].hub_direction
    assert plain["pulleys"][1]["hub_direction"] == direction
    text = told.text(full=True)
    line = next(one for one in text.split("to deg")[1].splitlines() if "altern" in one)
    assert f"{math.degrees(direction):.0f}" in line.split()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"beltdyn\[report\]"):
        report().to_frame()


def test_of_pulleys_that_slip_together_the_first_is_named() -> None:
    """As both of two do: which margin is less is rounding; without one no pulley is."""
    told = report()
    for shares, first in (((1.0, 1.0 - 1e-12), 0), ((1.0, 0.999), 1), ((math.inf, math.inf), None)):
        pairs = zip(told.pulleys, shares, strict=False)
        rows = [attrs.evolve(one, margin=2.0 * x, least_margin=None) for one, x in pairs]
        found = attrs.evolve(told, pulleys=type(told.pulleys)(rows)).first_to_slip
        assert found is (None if first is None else rows[first])


def test_what_a_print_says_of_the_belt_and_its_cycles() -> None:
    """The crank turns counter-clockwise, the belt is laid clockwise: its speed is negative."""
    told, words = report(), " ".join(report().text(full=True).split())
    assert told.belt_speed < 0.0
    assert "against the order of its links" in words
    assert told.to_dict()["belt_speed"] == told.belt_speed
    assert told.to_dict()["first_to_slip"] == told.first_to_slip.name
    assert "Joint 0 is between the last link and link 0." in words
    assert "any joint of the belt goes through the same cycles" in words
    assert "8 classes by their range" in words
    assert "1 rounds" not in words.replace("1.1 rounds", "")
    # A table that is too wide is broken into parts, which keep their first column
    text = report().text(full=True)
    assert max(map(len, text.splitlines())) <= 80
    assert not re.search(r"\b(nan|inf)\b", text)
    for word in ("1/min", "rad/s", "N m", " W", "crank to alternator", "%", "Efficiency", "slips"):
        assert word in text, word
    html = report()._repr_html_()
    assert html.count("<table>") == html.count("</table>") == 7 + 2, "the first screen has two"
    assert "crank to alternator" in html and "<script" not in html
    assert repr(report()).startswith("Report(t = 0.3 to 0.4 s")
    # names are escaped in notebooks
    rows = report().pulleys
    other = attrs.evolve(rows[0], name="<b>&", margin=math.inf)
    named = attrs.evolve(report(), pulleys=type(rows)([other]))
    assert "&lt;b&gt;&amp;" in named._repr_html_() and "<b>&" not in named._repr_html_()
    assert "later: others slip" in named.text(full=True)
    # of means others slip long before, at an instant it does
    other = attrs.evolve(rows[0], margin=math.inf, least_margin=2.0, worst_time=0.35)
    told = attrs.evolve(report(), pulleys=type(rows)([other]))
    words = " ".join(str(told).split())
    assert re.search(r"when all loads have grown 2\.00?-fold at the worst instant", words)
    assert not re.search("(later|inf)-fold", told.text(full=True))
    alike = (("a", 2.0), ("b", 2.01), ("c", 2.1))
    three = [attrs.evolve(rows[0], name=one, margin=m, least_margin=m) for one, m in alike]
    told = attrs.evolve(report(), pulleys=type(rows)(three))
    for text in (str(told), told.text(full=True)):
        assert " a and b slip together, when" in text and "slips first" not in text
    params, torque, _, motion = bd.scenes.serpentine(60)
    told = bd.simulate(params, torque, 0.02, motion=motion).report(1.0)
    text = told.text(full=True)
    assert max(map(len, text.splitlines())) <= 80 and text.count(params.pulley_names[0]) >= 5
    wide = [tuple(f"{'x' * 15}{k}{j}" for k in range(9)) for j in range(3)]
    parts = fitted(wide, 80)
    assert len(parts) == 3  # of 8 columns of 19 characters, 3 fit beside the first
    for part in parts:
        assert [row[0] for row in part] == [row[0] for row in wide]
        assert all(2 + sum(len(cell) + 2 for cell in row) - 2 <= 80 for row in part)
    for j, row in enumerate(wide):
        assert [cell for part in parts for cell in part[j][1:]] == list(row[1:])


def test_what_is_asked_first_is_one_screen() -> None:
    """At most 39 lines of 100 columns, of fifty pulleys too: tensions, slip, hub loads, power."""
    told = report()
    text, alternator = str(told), told.pulleys["alternator"]
    assert text == told.text() and len(text.splitlines()) < 30
    line = next(one for one in text.splitlines() if one.split()[0:1] == ["alternator"])
    of_spans = told.tension_error * np.mean([one.tension.mean for one in told.spans])
    for value in (
        f"{alternator.speed.mean * 30.0 / math.pi:.4g}",
        f"{rounded(alternator.hub_load.mean, 2.0 * of_spans)[0]:.0f}",
        f"{alternator.hub_load.most:.3g}",
        f"{alternator.margin:.1f}",  # of tensions that are off by 3 %
        f"{alternator.least_margin:.1f}",
        f"{100.0 * told.creep['alternator'].slower:.2f}",
    ):
        assert value in line.split(), value
    span = told.spans[0]
    (line,) = (one for one in text.splitlines() if one.startswith(f"  {span.name} "))
    ends = (span.tension.least, span.tension.most, span.of_run.least, span.of_run.most)
    assert {f"{one:.3g}" for one in ends} <= set(line.split())
    assert "  least  mean tension N  most  " in text
    words = " ".join(text.split())
    shown, digits = rounded(100.0 * told.efficiency, 100.0 * told.efficiency_error)
    assert f"efficiency {shown:.{digits - 2}f} %" in words
    assert "alternator slips first" in words and "Errors, estimated: tension" in words
    assert "Warnings: mesh" in words  # its links shake it by 2 %, which four times as many bear out
    assert "Warnings:" not in str(attrs.evolve(told, warnings=()))
    warned = [
        bd.RunWarning(code="full_slip", text="a"),
        bd.RunWarning(code="full_slip", text="b"),
        bd.RunWarning(code="mesh", text="c"),
    ]
    long = "a pulley whose name goes on and on until nothing else has room beside it"
    names = [f"{long} {k}" for k in range(50)]
    many = {
        "pulleys": Rows(attrs.evolve(alternator, name=name) for name in names),
        "spans": Rows(attrs.evolve(span, name=name) for name in names),
        "warnings": tuple(warned),
        "unsteady": ("the mean tension goes up", "so does the speed"),
    }
    told = attrs.evolve(told, **many)
    rows = str(told).splitlines()
    assert len(rows) <= 39 and max(map(len, rows)) <= 100
    assert sum(one.strip().startswith("... and 4") for one in rows) == 2
    assert "Warnings: full_slip (2), mesh" in str(told)
    assert "full_slip: b" in told.text(full=True) and told.to_dict()["warnings"][2]["text"] == "c"
    with pytest.raises(TypeError, match="full"):
        told.text(full=1)


def test_what_does_not_count_and_what_is_left_over_is_told() -> None:
    """Samples without a tension, watts that are none of the parts, lines and margins of a mesh."""
    run, told = result(), report()
    touched = run.contact.pulley.copy()
    touched[100:130][touched[100:130] == 2] = -1  # nothing is on the idler
    contact = attrs.evolve(run.contact, pulley=touched)
    bare = attrs.evolve(run, contact=contact)
    assert np.isnan(bare.span_tension).any(axis=1).sum() == 30
    (note,) = (one for one in bare.report(0.25).notes if "no link touches" in one)
    assert f"no link touches idler in 30 of {run.t.size} samples" in note
    assert not any("no link touches" in one for one in told.notes)
    assert "the rest" not in str(told)
    put_in = sum(one.power for one in told.powers if one.kind == "in")
    powers = [
        attrs.evolve(one, power=0.8 * one.power) if one.kind == "out" else one
        for one in told.powers
    ]
    left = attrs.evolve(told.powers["error of sampling"], power=0.2 * put_in)
    powers = Rows(left if one.name == left.name else one for one in powers)
    assert re.search(r"; the rest, \d+ W: error of sampling", _words(told, powers=powers))

    def of(factor: float, residual: float) -> str:
        def one(row: Any) -> Any:
            power = factor * row.power if row.kind == "lost" else row.power
            return attrs.evolve(row, power=residual if row.name == RESIDUAL else power)

        return _words(told, powers=Rows(map(one, told.powers)))

    lost = sum(one.power for one in told.powers if one.kind == "lost")
    assert f"{digits.loss(told, lost)} W lost (most" in of(1.0, 0.9 * lost)
    assert re.search(r"off, less than some [\d.]+ W lost; ", of(0.1, -0.9 * lost))
    # nor is more known of it than its error, and nothing of shares where nothing is put in
    error = 2.0 * lost / put_in
    assert f"less than some {digits.number(3.0 * lost, 2)} W lost" in _words(
        told, efficiency_error=error
    )
    bare = attrs.evolve(told, powers=Rows(attrs.evolve(one, share=None) for one in told.powers))
    (power,) = (one for one in tables(bare) if one.title.startswith("Power"))
    assert {row[2] for row in power.rows} == {"-"}
    assert f"{digits.loss(told, lost)} W given back by friction" in of(-1.0, 0.9 * lost)
    spans = Rows(
        attrs.evolve(told.spans[0], frequency=99.0, link_passing=passing)
        for passing in (True, None, False)
    )
    _, of_spans, *_ = brief._tables(attrs.evolve(told, spans=spans))
    lines = [row[-2] for row in of_spans.rows]
    assert lines == ["mesh", "99 ?", "99"]
    note = next(row["note"] for row in _core.BELTS if row["note"])
    paper = bd.RunWarning(code="mesh", text=note)
    assert "the drive's own margin is lower" in _words(told, warnings=(paper,))
    assert "own margin" not in _words(told)


def test_the_first_screen_explains_its_columns_and_prints_no_rounding() -> None:
    """A belt that stands has no rho v^2, drums that slip in full no efficiency of 1e-5 %."""
    told = report()
    assert "lost: speed" in _words(told) and "margin: factor" in _words(told)
    spans, no_margin = told.spans, {"margin": None, "least_margin": None}
    bare = Rows(attrs.evolve(one, used=None, used_range=None, **no_margin) for one in told.pulleys)
    alone = _words(told, pulleys=bare, creep=Rows())
    assert "to deg: of the hub load" in alone
    assert not any(word in alone for word in ("lost: ", "used: ", "margin: ", "worst: "))
    assert "rho v^2 0 N" in _words(told, mass_tension=1e-8 * digits.mean_tension(told))
    slips = _words(told, efficiency=-2.3e-7, efficiency_error=1e-9)
    assert "efficiency 0 %" in slips and "Efficiency 0 %" in attrs.evolve(
        told, efficiency=-2.3e-7, efficiency_error=1e-9
    ).text(full=True)
    with pytest.raises(IndexError, match=f"there are {len(spans)} rows, from 0, got 99"):
        spans[99]


def _words(told: bd.Report, **changes: Any) -> str:
    return " ".join(str(attrs.evolve(told, **changes)).split())


def test_what_a_run_does_not_have_is_named() -> None:
    """Outputs; friction, of a drive that stands; a second time."""
    told = result(t_end=0.05, outputs=("pulleys.omega", "span_tension")).report(0.25)
    text = told.text(full=True)
    for name in ("pulleys.torque", "pulleys.load", "joints.force", "contact.friction"):
        assert name in text, name
    assert told.pulleys["crank"].torque is None and told.creep == () and told.powers == ()
    assert told.pulleys["crank"].speed is not None
    assert told.spans[0].tension is not None and not re.search(r"\bnan\b", text)
    assert result(t_end=0.01, outputs=("energy",)).report().notes
    still = result(t_end=0.01, outputs=("belt", "joints", "contact")).report()
    assert still.driver is None and any("no speeds" in note for note in still.notes)
    bare = result(t_end=0.01, outputs=("belt.x",)).report()
    assert str(bare) and bare.text(full=True)
    params, still = result().params, bd.PiecewiseLinear([0.0, 1.0], np.zeros((2, 3)))
    told = bd.simulate(attrs.evolve(params, friction=None), still, 0.01).report()
    assert any("no friction" in note for note in told.notes)
    assert all(row.margin is None for row in told.pulleys)
    assert not re.search(r"\bnan\b", str(told) + told.text(full=True))
    with pytest.raises(ValueError, match="two times"):
        bd.simulate(params, still, 1e-3, t_eval=[1e-3]).report()
    # what integration leaves, 1e-9 rad/s and less, is not printed as a speed
    text = bd.simulate(params, still, 0.01).report(1.0).text(full=True)
    (line,) = [one for one in text.split("Hub loads")[0].splitlines() if " crank " in one]
    assert line.split()[1:3] == ["0", "0"], line


def test_what_is_not_to_be_trusted_is_told() -> None:
    """A split that does not add up; a window of few turns, 100 rad/s over 0.02 s, 0.32 turns; a run
    that ended early; when a pulley slips that does so in one sample, or late in a run.
    """
    told = report()
    with pytest.raises(bd.SimulationError) as failed:
        result(max_steps=300)
    early, reason = failed.value.result.report(), f"failed: {failed.value}"
    assert told.ended_early is None and early.ended_early == reason
    for text in (str(early), early.text(full=True)):
        assert f"the run ended early, {reason}" in " ".join(text.split())
    assert reason in early.to_frame().text.values and early.to_dict()["ended_early"] == reason
    for when, said in (([2e-5], "at t = 2e-05 s"), ([90.0, 90.001], "between t = 90 and 90.001 s")):
        assert span_of(np.array(when)) == said
    row = told.creep[0]
    off = attrs.evolve(row, remainder=0.2 * row.lost, stretch=row.stretch - 0.2 * row.lost)
    assert "Do not trust the split" not in told.text(full=True)
    off = attrs.evolve(told, creep=(off,)).text(full=True)
    assert "Do not trust the split of alternator" in off
    said = [note for note in result().report(0.05).notes if "turns of" in note]
    assert len(said) == 1 and 'the window holds 0.32 turns of pulley "crank"' in said[0]
    # in all of the run there are 5.6, but that is not steady
    told = result().report(1.0)
    assert not any("turns of" in note for note in told.notes)
    assert any("the mean speed of crank goes from" in line for line in told.unsteady)
    assert len(told.unsteady) > 3
    assert f"and {len(told.unsteady) - 1} more" in " ".join(str(told).split())
    assert str(told).count("not steady") == 1
    times = np.concatenate([np.linspace(0.0, 0.03, 50), np.linspace(0.03, 0.04, 60)[1:]])
    times[-10] += 5e-5
    told = result(t_end=0.04, t_eval=tuple(times)).report(0.2)
    assert any("not even in time" in note for note in told.notes)
    assert all(row.frequency is None for row in told.spans)
    # Seconds in place of a share are told apart
    for last in (0.0, -0.1, 1.01, math.nan, "a"):
        with pytest.raises((TypeError, ValueError), match="last"):
            result().report(last)
    for joint in (-1, 100, 1.5):
        with pytest.raises((TypeError, ValueError), match="joint"):
            result().report(joint=joint)
    for call in (result().report, lambda last: bd.spectra.spectrum(result(), last=last)):
        with pytest.raises(ValueError, match=r"<= 1 \(a share of the run\), got 20"):
            call(20.0)


def test_the_command_prints_it() -> None:
    from click.testing import CliRunner

    from beltdyn.cli import main

    def run(*options: str) -> Any:
        return CliRunner().invoke(main, ["run", "three-pulleys", "--t-end", "0.1", *options])

    told = run("--last", "0.5")
    assert told.exit_code == 0
    for words in ("finished", "Means over t = 0.05 to 0.1 s", "slips first", "efficiency", "N m"):
        assert words in told.stdout, words
    assert len(told.stdout.splitlines()) <= 40 < len(run("--full").stdout.splitlines())
    assert "Load cycles" in run("--full").stdout and "pulley speeds" in run("--full").stdout
    few = run("--t-end", "0.01", "--outputs", "pulleys.omega", "--full")
    assert few.exit_code == 0 and "no hub loads: pulleys.load not asked for" in few.stdout
    assert run("--t-end", "0.01", "--quiet").stdout == ""
    of_run = "> 0 and <= 1 (a share of the run)"
    for bad, rule in (("0", of_run), ("1.5", of_run), ("nan", "finite")):
        refused = run("--last", bad)
        assert refused.exit_code == 2
        assert f"--last must be {rule}" in refused.stderr


def test_efficiency_and_powers_have_the_error_of_their_mesh() -> None:
    """The README's drive at 20 m/s under 10 N m: a belt that creeps by 0.14 % loses as much, and
    what 60 links lose beyond are their blows, of m (v l0 / R)^2 / 2 each.
    """
    params = attrs.evolve(
        drives.plain(),
        belt=bd.Belt(
            length=1.2, n_bodies=60, linear_density=0.1, axial_stiffness=70e3, axial_damping=1.4
        ),
        contact=bd.Contact(),
        friction=bd.Dahl(mu_k=1.0, sigma=1e4),
    )
    motion = {0: bd.PiecewiseLinear([0.0, 1.0], [-200.0, -200.0])}
    load = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [0.0, 10.0]])
    run = bd.simulate(params, load, 0.1, motion, rtol=1e-3)
    told = run.report()
    creep = 10.0 / 0.1 / 70e3
    assert told.efficiency is not None and told.efficiency_error is not None
    short = 1.0 - creep - told.efficiency
    assert 1.0 / 3.0 < told.efficiency_error / short < 3.0
    blows = 2.0 * 0.5 * 0.1 * 20.0**3 * (0.02 / 0.1) ** 2
    assert told.powers["damping in the contact"].power == pytest.approx(blows, rel=0.5)
    # in the numbers that are printed
    assert told.power_error is not None and told.power_error > told.efficiency_error
    assert told.power_error == run.accuracy["power"].space
    text = told.text(full=True)
    for one in (text, str(told)):
        assert re.search("fficiency 9[89] %", " ".join(one.split()))
    assert f"The error is some {100.0 * told.efficiency_error:.1f} %" in " ".join(text.split())
    assert (
        f"{1e2 * told.creep[0].slower:.2g} %"
        in dict(run.summary())["  speed lost against pulley 0"]
    )


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [
        (2033.9, 34.0, (2030.0, 3)),
        (902.24, 7.8, (902.0, 3)),
        (0.138, None, (0.14, 2)),
        (99.861, 3e-4, (99.86, 4)),
        (-541.7, 1600.0, (-540.0, 2)),
        (0.0, 0.1, (0.0, 2)),
        (226.9, math.nan, (230.0, 2)),
    ],
)
def test_numbers_have_the_digits_that_their_error_leaves(
    value: float, error: float | None, expected: tuple[float, int]
) -> None:
    assert rounded(value, error) == expected


def test_powers_have_one_error() -> None:
    """Of torques that are set, that of the losses; torques that a motion needs are forces of the
    belt, known to half a link at the ends of arcs.
    """
    scene = bd.scenes.unequal_pulleys()
    driven = bd.simulate(scene.params, scene.torque_fn, 0.1)
    for run, more in ((driven, 0.0), (result(0.08), 0.5 / 100)):
        losses = run.report().efficiency_error
        assert losses and run.accuracy["power"].space == pytest.approx(losses + more, rel=1e-12)


def test_shares_in_percent_have_no_exponent() -> None:
    """Powers, errors, frequencies, warnings: 1e+02 % of what was put in was stored in a run-up."""
    shares = (1e-9, 3.14e-4, 0.0994, 0.0996, 0.996, 1.0, 2.713, -2.0)
    texts = ["<0.0001 %", "0.031 %", "9.9 %", "10 %", "100 %", "100 %", "271 %", "-200 %"]
    assert [percent(one) for one in shares] == texts
    run_up = " ".join(result(0.08).report().notes)
    assert re.search(r"no efficiency: what is stored changes by \d+ W .*, (9\d|100) % of", run_up)


#: Columns of what the drive gives, of whole degrees, of counts, of losses, which have an error of
#: their own, beside what is put in, and of what has the place of another number.
GIVEN = {
    "wrap deg",
    "mm",
    "limit",
    "in",
    "cycles",
    "to deg",
    "slip arc deg",
    "W",
    "%",
}
GIVEN |= {"range", "least", "most", "run: least", "run: most"}


def significant(cell: str) -> int:
    """The most digits of its numbers, but for zeros at the ends, which may be of rounding."""
    bare = (re.sub(r"e.*", "", one).replace(".", "") for one in re.findall(r"\d[\d.]*", cell))
    return max((len(one.strip("0")) for one in bare), default=0)


def _swings(value: Spread) -> Spread:
    return Spread(value.mean, value.least - 1e-3, value.most + 1e-3)


def test_no_number_is_printed_to_more_places_than_its_error_leaves() -> None:
    """Speeds, torques, tensions, loads, ratios, margins, strings, mounts and creep, in full and in
    the first screen: two digits where errors are a third, of what is not given, and four at 1e-5.
    """
    angle, force = Spread(0.123456, 0.12012, 0.12789), Spread(12.3456, -1.23456, 23.4567)
    arm = MountRow(name="idler", kind="arm", travel=angle, to_stop=angle, spring=force, belt=force)
    rows = [  # as speeds and torques are that are not set
        attrs.evolve(one, prescribed=False, torque=_swings(one.torque)) for one in report().pulleys
    ]
    told = attrs.evolve(report(), mounts=Rows([arm]), pulleys=Rows(rows))
    for error, most in ((1e-5, 4), (0.33, 2)):
        off = dict.fromkeys(("tension_error", "power_error", "creep_error"), error)
        by = [bd.QuantityError(quantity=one.quantity, space=error) for one in told.accuracy.errors]
        one = attrs.evolve(told, accuracy=bd.Accuracy(errors=tuple(by)), **off)
        seen = 0
        for table in (*tables(one), *brief._tables(one)):
            for heading, *cells in zip(table.heading, *table.rows, strict=True):
                of_speeds = heading == "ratio" and table.title.startswith("Speed lost")
                if heading not in GIVEN and not of_speeds:  # which is off by parts of a creep
                    shown = max(map(significant, cells))
                    assert shown <= most, (table.title, heading, cells)
                    seen = max(seen, shown)
        assert seen == most
    # a speed and a torque that are set are exact, and so printed; a speed where it varies too
    exact = attrs.evolve(one, pulleys=report().pulleys)
    assert " -5.000 " in str(exact) and " 954.9 " in str(exact), "load and speed that are set"
    run_up = " ".join(result().report(1.0).text(full=True).split())
    assert " crank 835.6 87.5 0.0 to 100.0 " in run_up


def test_losses_and_friction_in_use_have_the_digits_of_their_errors() -> None:
    """Of losses that of the efficiency; of friction that of the logarithm of the ratio."""
    told = attrs.evolve(report(), efficiency_error=1e-4)
    put_in = sum(one.power for one in told.powers if one.kind == "in")
    for lost, digits_left in ((0.1 * put_in, 4), (1e-3 * put_in, 2), (1e-5 * put_in, 2)):
        shown = float(digits.loss(told, 1.2345 * lost))
        assert shown == rounded(1.2345 * lost, 1e-4 * put_in)[0]
        assert shown == float(f"{1.2345 * lost:.{digits_left - 1}e}")
    row = next(one for one in told.pulleys if one.used and one.used_range)
    for error in (1e-6, 1e-2):
        one = attrs.evolve(told, tension_error=error)
        off = digits.tension_off(one) * abs(1.0 / row.slack - 1.0 / row.tight)
        off *= row.used / math.log(row.ratio)
        expected, _ = rounded(100.0 * row.used, 100.0 * max(1e-3, off))
        assert float(digits.used(one, row)[0]) == pytest.approx(expected, rel=1e-12)
    slack = attrs.evolve(row, used_range=Spread(row.used, 0.1, math.inf))
    assert digits.used(told, slack)[2] == "slack"


@pytest.mark.filterwarnings("ignore:mesh:UserWarning")
def test_a_mean_is_not_beyond_its_least_and_most() -> None:
    """As printed, however little the mesh leaves of it: 1100 N stood between 1114 and 1127."""
    told = bd.simulate(*bd.scenes.kubas_case_1()).report()
    rows = [line.split() for line in str(told).splitlines() if re.match(r"  pulley \d", line)]
    assert len(rows) == 4
    for cells in rows:
        if cells[2] == "to":
            least, mean, most = map(float, cells[5:8])
            assert least <= mean <= most, cells
        else:
            assert float(cells[-6]) <= float(cells[-5]), cells  # hub load, and the most of it
