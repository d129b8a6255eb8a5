"""The tiers of the tests, default, ci and extended (CONTRIBUTING, Testing), and their marks.

A test outside the default tier names the test that guards the same promise in short:
`@pytest.mark.ci(guard="test_sweep.py::test_name")`; where only some cases of a test are outside it,
the others are its guard. `faults_of_marks` tells of marks that do not. What counts is what pytest
has collected, wherever its marks are written.
"""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).resolve().parent
OUTSIDE = ("ci", "extended")
OTHERS = "other cases"
#: All tests of all files, where all were collected.
ALL = pytest.StashKey[list[pytest.Item]]()


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


def marks(item: pytest.Item) -> list[pytest.Mark]:
    """Return the marks that take a collected test out of the default tier."""
    return [mark for name in OUTSIDE for mark in item.iter_markers(name)]


def is_default(item: pytest.Item) -> bool:
    return not marks(item)


def guards(item: pytest.Item) -> bool:
    """Describe whether a test is done by default; a condition that is a text may hold."""
    skips = (mark for name in ("skip", "skipif") for mark in item.iter_markers(name))
    return is_default(item) and not any(all(mark.args) for mark in skips)


@cache
def _name(path: Path) -> str:
    return Path(os.path.relpath(path.resolve(), TESTS)).as_posix()


def by_test(items: Iterable[pytest.Item]) -> dict[str, list[Any]]:
    """Return the cases of each test, which is named as guards are: `folder/test_file.py::test`."""
    tests = defaultdict(list)
    for item in items:
        function = getattr(item, "originalname", None) or item.name
        tests[f"{_name(item.path)}::{function}"].append(item)
    return dict(tests)


def files() -> dict[str, Path]:
    """Return the files of tests by name, collected or not."""
    return {_name(path): path for path in TESTS.rglob("test_*.py")}


def are_all(items: Iterable[pytest.Item]) -> bool:
    """Describe whether tests, of files that were collected whole, are those of every file."""
    return {test.partition("::")[0] for test in by_test(items)}.issuperset(files())


def _fault(guard: str, tests: dict[str, list[Any]], whole: set[str]) -> str | None:
    file, _, function = guard.partition("::")
    if guard in tests and file in whole:
        return None if any(map(guards, tests[guard])) else "is not in the default tier itself"
    definition = f"\ndef {function}("
    named = [name for name, path in files().items() if definition in path.read_text("utf-8")]
    if file in named and file not in whole:
        return None
    meant = " or ".join(sorted(f"{name}::{function}" for name in named))
    return "does not exist" + (f", {meant} does" if meant else "")


def faults_of_marks(items: Iterable[pytest.Item], whole_files: bool) -> list[str]:
    """Return what is wrong with the marks of collected tests.

    What cases a test has, and of which tiers, can be told only of files that are collected whole;
    of a guard in another file, that it exists.
    """
    tests = by_test(items)
    whole = {test.partition("::")[0] for test in tests} if whole_files else set()
    wrong = set()
    for test, cases in tests.items():
        for case in cases:
            of_case = marks(case)
            named = {mark.kwargs.get("guard") for mark in of_case} - {None, "", OTHERS}
            for mark in of_case:
                if not mark.kwargs.get("guard"):
                    wrong.add(
                        f"{test}: {mark.name} without guard=, the default test of its promise"
                    )
                elif not named and whole_files and not any(map(guards, cases)):
                    wrong.add(f"{test}: no case of it is in the default tier")
            for guard in named:
                if fault := _fault(guard, tests, whole):
                    wrong.add(f"{test}: guard {guard} {fault}")
    return sorted(wrong)
