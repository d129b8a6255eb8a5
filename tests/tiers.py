"""The tiers of the tests, default, ci and extended (CONTRIBUTING, Testing), and their marks.

A test outside the default tier names the test that guards the same promise in short:
`@pytest.mark.ci(guard="test_sweep.py::test_name")`; where only some cases of a test are outside it,
the others are its guard. `faults_of_marks` tells of marks that do not.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).resolve().parent
OUTSIDE = ("ci", "extended")
OTHERS = "other cases"


def _marked_if(mark: Any, is_outside: Callable[[Any], bool], cases: Iterable[Any]) -> list[Any]:
    rows = [(case, case if isinstance(case, tuple) else (case,)) for case in cases]
    return [pytest.param(*row, marks=mark if is_outside(case) else ()) for case, row in rows]


def ci_if(is_ci: Callable[[Any], bool], cases: Iterable[Any]) -> list[Any]:
    """The cases, for `pytest.mark.parametrize`; a tuple is several arguments."""
    return _marked_if(pytest.mark.ci(guard=OTHERS), is_ci, cases)


def extended_if(is_extended: Callable[[Any], bool], cases: Iterable[Any]) -> list[Any]:
    """The same for the extended tier."""
    return _marked_if(pytest.mark.extended(guard=OTHERS), is_extended, cases)


def first(n: int, cases: Iterable[Any]) -> list[Any]:
    """The first n by default, the others extended: drawn at random, each stands for all."""
    cases = list(cases)
    return extended_if(cases[n:].__contains__, cases)


def deal(items: Iterable[pytest.Item]) -> None:
    """Of cases marked `one_in(n)` leave every n-th in the default tier, the others are for CI."""
    before: Counter[str] = Counter()
    for item in items:
        mark = item.get_closest_marker("one_in")
        if mark and is_default(item):
            test = item.nodeid.partition("[")[0]
            if before[test] % mark.args[0]:
                item.add_marker(pytest.mark.ci(guard=OTHERS))
            before[test] += 1


def is_default(item: pytest.Item) -> bool:
    return not any(item.get_closest_marker(name) for name in OUTSIDE)


def tests_and_marks(tree: ast.Module) -> tuple[list[ast.FunctionDef], list[ast.expr]]:
    """Return the test functions of a file, and what `pytestmark` marks all of them with."""
    functions, of_file = [], []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            functions.append(node)
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark":
            of_file.append(node.value)
    return functions, of_file


@cache
def _functions(file: Path) -> dict[str, bool]:
    """Return the test functions of a file, and whether all of one is outside the default tier."""
    tree = ast.parse(file.read_text("utf-8"))
    outside = tuple(f"pytest.mark.{name}" for name in OUTSIDE)
    functions, of_file = tests_and_marks(tree)
    return {
        node.name: any(
            ast.unparse(mark).startswith(outside) for mark in (*node.decorator_list, *of_file)
        )
        for node in functions
    }


def faults_of_marks(items: Iterable[pytest.Item], whole_files: bool) -> list[str]:
    """Return what is wrong with the marks of collected tests.

    That some cases are default can be told only where files are collected whole.
    """
    items = list(items)
    # Tests with a case in the default tier, or whose cases have a guard elsewhere.
    guarded = {
        item.nodeid.partition("[")[0]
        for item in items
        if is_default(item)
        or any(m.kwargs.get("guard") != OTHERS for n in OUTSIDE for m in item.iter_markers(n))
    }
    wrong = set()
    for item in items:
        test = item.nodeid.partition("[")[0]
        for mark in (m for name in OUTSIDE for m in item.iter_markers(name)):
            guard = mark.kwargs.get("guard")
            file, _, function = str(guard).partition("::")
            outside = _functions(TESTS / file) if (TESTS / file).is_file() else {}
            if not guard:
                wrong.add(f"{test}: {mark.name} without guard=, the default test of its promise")
            elif guard == OTHERS:
                if whole_files and test not in guarded:
                    wrong.add(f"{test}: no case of it is in the default tier")
            elif function not in outside:
                wrong.add(f"{test}: guard {guard} does not exist")
            elif outside[function]:
                wrong.add(f"{test}: guard {guard} is not in the default tier itself")
    return sorted(wrong)
