"""List the promises that the tests guard, and where: `python tests/promises.py` writes PROMISES.md.

A promise is a test with a case in the default tier, in the words of its docstring or its name.
Tests outside it stand in the row of the test that they name as the guard of the same promise.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import tiers

PAGE = tiers.TESTS / "PROMISES.md"
HEAD = """# Promises

What the tests guard, and where: each row is a test of the default tier (`python -m pytest`); the
second column names the tests of the tiers *ci* and *extended* that guard the same promise at
length, or says that further cases of the test itself are in that tier (`+`). Written by
`python tests/promises.py`.
"""


def sentence(of: Any) -> str:
    text = (inspect.getdoc(of) or "").partition("\n\n")[0]
    return re.sub(r"\s+", " ", text.strip()).replace("|", r"\|")


def _place(test: tuple[str, list[Any]]) -> tuple[Path, int]:
    name, cases = test
    return Path(name.partition("::")[0]), min(case.location[1] for case in cases)


def page(items: Iterable[pytest.Item]) -> str:
    """Return the list of collected tests, in whatever order they are."""
    tests = dict(sorted(tiers.by_test(items).items(), key=_place))
    plus, longer = defaultdict(list), defaultdict(list)
    for name, cases in tests.items():
        for tier in tiers.OUTSIDE:
            of_tier = {mark.kwargs["guard"] for case in cases for mark in case.iter_markers(tier)}
            for guard in of_tier:
                if guard == tiers.OTHERS:
                    plus[name].append(f"+ {tier}")
                else:
                    longer[guard].append(f"{tier}: {name}")
    of_file: dict[str, list[str]] = {}
    for name, cases in tests.items():
        if any(map(tiers.guards, cases)):
            file, _, function = name.partition("::")
            title = f"## {file}\n\n{sentence(cases[0].module)}\n\n"
            title += "| promise, test | guarded at length by |\n|---|---|"
            text = sentence(cases[0].function) or function.removeprefix("test_").replace("_", " ")
            row = f"| {text}<br>`{function}` | {'; '.join(plus[name] + longer[name])} |"
            of_file.setdefault(file, [title]).append(row)
    return "\n".join([HEAD, *("\n".join([*rows, ""]) for rows in of_file.values())])


class _Collector:
    def __init__(self) -> None:
        self.items: list[pytest.Item] = []

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self.items = items


def collected() -> list[pytest.Item]:
    """Collect the tests of every tier; marks without a guard are refused (`conftest.py`)."""
    seen, said = _Collector(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = pytest.main(
            ["--collect-only", "-q", "-n", "0", "-m", "", str(tiers.TESTS)], plugins=[seen]
        )
    if code:
        raise SystemExit(said.getvalue())
    return seen.items


if __name__ == "__main__":
    text = page(collected())
    PAGE.write_text(text, "utf-8")
    print(f"{PAGE}: {text.count('<br>`test_')} promises in {text.count('## ')} files")
