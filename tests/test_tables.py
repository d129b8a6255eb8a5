"""Typed classes and stubs of Python against the tables of the core, ``csrc/fields.h``.

The tables give C its structs, checks and messages by themselves; what is typed by hand in Python,
so that editors and mypy know it, is held to them here: names and order, units in docstrings, the
tuples of the stub, the equations' symbols that a state is made of.
"""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import attrs
import click
import numpy as np
import pytest

import beltdyn as bd
from beltdyn import _core, cli
from beltdyn.base.run_options import USUAL, Options
from beltdyn.drive.friction import LAWS
from beltdyn.drive.rules import rules_of
from beltdyn.outputs import histories

PARTS: dict[str, type] = {
    **{"belt": bd.Belt, "pulley": bd.Pulley, "drag": bd.Drag, "arm": bd.Arm},
    **{"slider": bd.Slider, "isolator": bd.Isolator, "clutch": bd.OverrunningClutch},
    **{"damper": bd.TorsionalDamper, "contact": bd.Contact, **LAWS},
}


def described(cls: type) -> dict[str, str]:
    """Return what a docstring says of each attribute, by name; "The same." is what stands above."""
    lines = (cls.__doc__ or "").partition("Attributes:\n")[2].splitlines()
    found: dict[str, str] = {}
    name = ""
    for line in lines:
        if re.match(r" {4}(\S.*)?$", line):  # no deeper than "Attributes:", or "Raises:"
            break
        if match := re.match(r" {8}(\w+): (.*)", line):
            name = match[1]
            found[name] = match[2]
        elif name:
            found[name] += " " + line.strip()
    previous = ""
    for name, text in found.items():
        found[name] = previous if text.strip() == "The same." else text
        previous = found[name]
    return found


@pytest.mark.parametrize("group", PARTS)
def test_parameters_are_fields_in_order_with_their_units(group: str) -> None:
    """And with their rules: what a docstring says of a bound."""
    assert {row[0] for row in _core.PARAMETERS} == set(PARTS)
    fields, texts = attrs.fields(PARTS[group]), described(PARTS[group])
    # of mounts two numbers stand together in one field, `stops`
    rules = {k: rule for k, rule in rules_of(group).items() if k not in ("lowest", "highest")}
    assert [one.name for one in fields if "rule" in one.metadata and one.name in rules] == [*rules]
    assert list(texts) == [field.name for field in fields]
    for name, rule in rules.items():
        if rule.rule not in ("LINKS", "FLAG"):
            assert f"[{rule.unit}]" in texts[name], rule
            # of parameters whose 0 has a meaning, a docstring says so
            from_0 = {"mu_s": "0: no", "v_stribeck": "> 0"}.get(name, ">= 0")
            bound = {"NONNEGATIVE": from_0, "FINITE": ""}.get(rule.rule, "> 0")
            assert re.search(rf"(?<![<>=]){bound}(?!\d)", texts[name]), rule
            if rule.rule == "FINITE":
                assert not re.search(r"[<>]=? ?0", texts[name]), rule


def test_laws_of_the_table_are_classes_of_the_package() -> None:
    for name, class_name, _ in _core.LAWS:
        assert LAWS[name].__name__ == class_name and LAWS[name].law == name
        assert getattr(bd, class_name) is LAWS[name]
        assert class_name in bd.__all__


def test_state_has_the_fields_of_the_table() -> None:
    fields, texts = [field.name for field in attrs.fields(bd.State)], described(bd.State)
    assert list(texts) == fields == [*(row[0] for row in _core.STATE_FIELDS), "t", "residual"]
    for name, _, unit, _ in _core.STATE_FIELDS:
        assert unit == "its law's" or f"[{unit}]" in texts[name], name


def test_histories_have_the_outputs_of_the_table() -> None:
    """And Stats the counters."""
    for group, cls in histories.GROUPS.items():
        rows = [row for row in _core.OUTPUTS if row[1] == group]
        texts = described(cls)
        names = [row[0] for row in rows]
        if group == "energy":
            names = [name for name, *_ in _core.ENERGY_TERMS]
        fields = {field.name for field in attrs.fields(cls)}
        assert fields - {"pulley", "passed", "names"} == {*names}
        if group == "energy":
            assert sorted(texts) == sorted([*names, "passed"])
            continue
        assert texts.pop("names", None) is None or group == "pulleys"
        first, last = (
            [one] if group == where else []
            for one, where in (("pulley", "contact"), ("passed", "belt"))
        )
        assert list(texts) == [*first, *names, *last]
        for name, _, _, unit, _ in rows:
            assert f"[{unit}]" in texts[name], name
    counters = {name for name, _ in _core.STATS} - {"residual"}
    counters |= {"method", "kernels", "choice", "cpu_time", "wall_time", "settle_time"}
    assert {field.name for field in attrs.fields(histories.Stats)} == counters
    assert set(described(histories.Stats)) == counters


def test_tuples_of_the_stub_have_the_parameters_of_their_group() -> None:
    tree = ast.parse(Path(_core.__file__).with_name("_core.pyi").read_text("utf-8"))
    model = next(n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == "Model")
    init = next(n for n in model.body if isinstance(n, ast.FunctionDef) and n.name == "__init__")
    typed = {arg.arg: ast.unparse(arg.annotation) for arg in init.args.args if arg.annotation}
    for group in ("belt", "contact", "drag"):
        rules = [rule.rule for rule in rules_of(group).values()]
        kinds = ["int" if rule in ("LINKS", "FLAG") else "float" for rule in rules]
        assert f"tuple[{', '.join(kinds)}]" in typed[group]


def test_belts_of_the_table_tell_the_facts_of_the_stub() -> None:
    """And choose themselves: a belt that asks for what a row is has that row."""
    tree = ast.parse(Path(_core.__file__).with_name("_core.pyi").read_text("utf-8"))
    facts = next(n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == "BeltFacts")
    typed = {
        one.target.id: ast.unparse(one.annotation)
        for one in facts.body
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)
    }
    fields = {name for name, *_ in _core.STATE_FIELDS}
    params = bd.scenes.get("kubas_case_1").params
    for row in _core.BELTS:
        assert {name: kind.partition("[")[0] for name, kind in typed.items()} == {
            name: type(value).__name__ for name, value in row.items()
        }
        assert set(row["fields"]) <= fields
        assert not row["bends"] or row["flows"] or "phi" in row["fields"]
        belt = attrs.evolve(
            params.belt, mesh=row["mesh"], model=row["model"], bending_stiffness=0.0
        )
        assert attrs.evolve(params, belt=belt)._belt_facts == row


#: Arguments of simulate that are no options of one run: what is run, on which times, what is kept.
OTHERS = {
    *("params", "torque_fn", "t_end", "motion", "t_eval", "initial", "progress", "outputs"),
    *("verify", "budget", "expected", "checkpoint"),
}


def test_options_of_a_run_are_arguments_of_simulate_and_of_the_core() -> None:
    """Of the same defaults, described with their units; those of the command line say the same."""
    rows, arguments = Options.rows(), inspect.signature(bd.simulate).parameters
    assert [name for name in arguments if name in rows] == sorted(rows, key=[*arguments].index)
    assert set(arguments) - set(rows) == OTHERS
    core = set(inspect.signature(_core.Simulation).parameters)
    assert core - set(rows) == {"model", "state", "torque", "t_end", "motion", "guards"}
    assert set(USUAL.of_core()) == set(rows)
    args = re.split(r"\n *(?:Args|Raises):\n", inspect.getdoc(bd.simulate) or "")[1]
    texts = dict(re.findall(r"^    (\w+): ((?:.|\n     +)*)", args, re.MULTILINE))
    for name, row in rows.items():
        default, usual = arguments[name].default, getattr(USUAL, name)
        assert np.array_equal(default, usual) and type(default) in (type(usual), tuple)
        assert usual is None or isinstance(usual, row.kind)
        assert ("[s]" in texts[name]) == (row.unit == "s"), name
    for name, command in cli.main.commands.items():
        for option in command.params:
            if option.name in rows and name in ("run", "explain"):
                assert isinstance(option, click.Option)
                assert option.default == getattr(USUAL, option.name)
                assert option.help == rows[option.name].text
