"""List the promises that the tests guard, and where: `python tests/promises.py` writes PROMISES.md.

A promise is a test of the default tier, in the words of its docstring or its name. Tests outside
that tier stand in the row of the test that they name as the guard of the same promise.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

import tiers

TESTS = Path(__file__).resolve().parent
PAGE = TESTS / "PROMISES.md"
HEAD = """# Promises

What the tests guard, and where: each row is a test of the default tier (`python -m pytest`); the
second column names the tests of the tiers *ci* and *extended* that guard the same promise at
length, or says that further cases of the test itself are in that tier (`+`). Written by
`python tests/promises.py`.
"""


def sentence(text: str) -> str:
    return re.sub(r"\s+", " ", text.strip().partition("\n\n")[0]).replace("|", r"\|")


def tests_of(tree: ast.Module) -> list[tuple[str, str, dict[str, str]]]:
    """Return name, promise, and the guard by tier of each test of a file."""
    functions, of_file = tiers.tests_and_marks(tree)
    found = []
    for node in functions:
        guards = {}
        for mark in map(ast.unparse, (*of_file, *node.decorator_list)):
            for tier in tiers.OUTSIDE:
                if named := re.search(rf"pytest\.mark\.{tier}\(guard='([^']+)'\)", mark):
                    guards[tier] = named[1]
            if "extended_if(" in mark or "first(" in mark:
                guards["extended"] = tiers.OTHERS
            if "ci_if(" in mark or "one_in(" in mark:
                guards["ci"] = tiers.OTHERS
        name = node.name.removeprefix("test_").replace("_", " ")
        found.append((node.name, sentence(ast.get_docstring(node) or name), guards))
    return found


def page() -> str:
    files = sorted(TESTS.rglob("test_*.py"))
    trees = {str(file.relative_to(TESTS)): ast.parse(file.read_text("utf-8")) for file in files}
    of_file = {file: tests_of(tree) for file, tree in trees.items()}
    others: dict[str, list[str]] = defaultdict(list)
    for file, tests in of_file.items():
        for name, _, guards in tests:
            for tier, guard in guards.items():
                if guard != tiers.OTHERS:
                    others[guard].append(f"{tier}: {file}::{name}")
    lines = [HEAD]
    for file, tests in of_file.items():
        rows = [row for row in tests if all(guard == tiers.OTHERS for guard in row[2].values())]
        if rows:
            title = sentence(ast.get_docstring(trees[file]) or "")
            lines.append(
                f"## {file}\n\n{title}\n\n| promise, test | guarded at length by |\n|---|---|"
            )
            for name, text, guards in rows:
                also = [f"+ {tier}" for tier in guards] + others[f"{file}::{name}"]
                lines.append(f"| {text}<br>`{name}` | {'; '.join(also)} |")
            lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
