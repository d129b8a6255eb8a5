"""Typed classes and stubs of Python against the tables of the core, ``csrc/fields.h``.

The tables give C its structs, checks and messages by themselves; what is typed by hand in Python,
so that editors and mypy know it, is held to them here: names and order, units in docstrings, the
tuples of the stub, the equations' symbols that a state is made of.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import attrs
import pytest

import beltdyn as bd
from beltdyn import _core, histories
from beltdyn.friction import LAWS
from beltdyn.rules import rules_of

PARTS: dict[str, type] = {
    "belt": bd.Belt,
    "pulley": bd.Pulley,
    "drag": bd.Drag,
    "arm": bd.Arm,
    "slider": bd.Slider,
    "contact": bd.Contact,
    **LAWS,
}
STUB = Path(_core.__file__).with_name("_core.pyi")


def described(cls: type) -> dict[str, str]:
    """Give what a docstring says of each attribute, by name; "The same." is what stands above."""
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


def says_unit(text: str, unit: str) -> bool:
    return f"[{unit}]" in text


def test_every_group_of_parameters_has_its_class() -> None:
    assert {row[0] for row in _core.PARAMETERS} == set(PARTS)


#: What a docstring says of a rule, and of parameters whose 0 has a meaning.
BOUNDS = {"POSITIVE": "> 0", "POSITIVES": "> 0", "NONNEGATIVE": ">= 0", "FINITE": ""}
WITH_ZERO = {"mu_s": "0: no", "v_stribeck": "> 0"}


@pytest.mark.parametrize("group", PARTS)
def test_parameters_are_fields_in_order_with_their_units(group: str) -> None:
    fields = attrs.fields(PARTS[group])
    # of mounts two numbers stand together in one field, `stops`
    rules = {k: rule for k, rule in rules_of(group).items() if k not in ("lowest", "highest")}
    assert [field.name for field in fields if "rule" in field.metadata and field.name in rules] == [
        *rules
    ]
    texts = described(PARTS[group])
    assert list(texts) == [field.name for field in fields]
    for rule in rules.values():
        if rule.rule not in ("LINKS", "FLAG"):
            assert says_unit(texts[rule.name], rule.unit), rule
            bound = BOUNDS[rule.rule]
            if rule.rule == "NONNEGATIVE":
                bound = WITH_ZERO.get(rule.name, bound)
            assert re.search(rf"(?<![<>=]){bound}(?!\d)", texts[rule.name]), rule
            if rule.rule == "FINITE":
                assert not re.search(r"[<>]=? ?0", texts[rule.name]), rule


def test_laws_of_the_table_are_classes_of_the_package() -> None:
    for name, class_name, _ in _core.LAWS:
        assert LAWS[name].__name__ == class_name and LAWS[name].law == name
        assert getattr(bd, class_name) is LAWS[name]
        assert class_name in bd.__all__


def test_state_has_the_fields_of_the_table() -> None:
    fields = [field.name for field in attrs.fields(bd.State)]
    assert fields == [*(row[0] for row in _core.STATE_FIELDS), "t", "residual"]
    texts = described(bd.State)
    assert list(texts) == fields
    for name, _, unit, _ in _core.STATE_FIELDS:
        if unit != "its law's":
            assert says_unit(texts[name], unit), name


def test_histories_have_the_outputs_of_the_table() -> None:
    for group, cls in histories.GROUPS.items():
        rows = [row for row in _core.OUTPUTS if row[1] == group]
        texts = described(cls)
        names = {row[0] for row in rows if group != "energy"}
        names |= {name for name, *_ in _core.ENERGY_TERMS if group == "energy"}
        of_package = {"pulley", "passed", "names"}
        assert {field.name for field in attrs.fields(cls)} - of_package == names
        if group == "energy":
            columns = [name for name, *_ in _core.ENERGY_TERMS]
            assert sorted(texts) == sorted([*columns, "passed"])
            continue
        assert texts.pop("names", None) is None or group == "pulleys"
        assert list(texts) == [*(["pulley"] if group == "contact" else []), *(r[0] for r in rows)]
        for name, _, _, unit, _ in rows:
            assert says_unit(texts[name], unit), name


def test_stats_have_the_counters_of_the_table() -> None:
    of_core = {name for name, _ in _core.STATS} - {"residual"}
    of_python = {"method", "kernels", "choice", "cpu_time", "wall_time", "settle_time"}
    assert {field.name for field in attrs.fields(bd.histories.Stats)} == of_core | of_python
    assert set(described(bd.histories.Stats)) == of_core | of_python


def annotations_of_model() -> dict[str, Any]:
    tree = ast.parse(STUB.read_text("utf-8"))
    model = next(n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == "Model")
    init = next(n for n in model.body if isinstance(n, ast.FunctionDef) and n.name == "__init__")
    return {arg.arg: arg.annotation for arg in init.args.args if arg.annotation is not None}


@pytest.mark.parametrize("group", ["belt", "contact", "drag"])
def test_tuples_of_the_stub_have_the_parameters_of_their_group(group: str) -> None:
    integers = ("LINKS", "FLAG")
    kinds = ["int" if rule.rule in integers else "float" for rule in rules_of(group).values()]
    assert f"tuple[{', '.join(kinds)}]" in ast.unparse(annotations_of_model()[group])
