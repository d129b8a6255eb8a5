"""A test outside the default tier names its guard; the list of promises is that of the tests."""

from __future__ import annotations

from typing import Any

import promises
import pytest
import tiers

HERE = "test_tiers.py"
IN_CI = pytest.mark.ci(guard=f"{HERE}::test_short")  # by another name, as files have it
SLIP = "test_the_torque_at_which_a_run_slips"


def case(request: pytest.FixtureRequest, name: str, *marks: Any) -> pytest.Item:
    """Return a test of this file as pytest collects it."""

    def function() -> None:
        """Be there."""

    for mark in marks:
        function = mark(function)
    bare = name.partition("[")[0]
    parent = request.node.parent
    return pytest.Function.from_parent(parent, name=name, originalname=bare, callobj=function)


@pytest.mark.parametrize(
    ("marks", "says"),
    [
        ([pytest.mark.ci()], "ci without guard="),
        ([IN_CI, pytest.mark.extended], "extended without guard="),
        ([pytest.mark.extended(guard="test_none.py::test_x")], "none.py::test_x does not exist"),
        ([pytest.mark.ci(guard=f"{HERE}::test_nothing")], "does not exist"),
        ([pytest.mark.ci(guard=f"{HERE}::{SLIP}")], f"exist, test_report_slip.py::{SLIP} does"),
        ([pytest.mark.ci(guard=f"{HERE}::test_long")], "is not in the default tier itself"),
        ([pytest.mark.ci(guard=f"{HERE}::test_skipped")], "is not in the default tier itself"),
        ([pytest.mark.extended(guard=tiers.OTHERS)], "no case of it is in the default tier"),
        ([pytest.mark.ci(guard=f"test_report_slip.py::{SLIP}")], None),
        ([IN_CI], None),
    ],
)  # fmt: skip
def test_marks_without_a_guard_are_refused(
    request: pytest.FixtureRequest, marks: list[Any], says: str | None
) -> None:
    """Other cases are a guard only if there are some; what counts is what pytest has collected."""
    x = case(request, "test_x[1]", *marks)
    skipped = case(request, "test_skipped", pytest.mark.skipif(True, reason="not here"))
    others = [case(request, "test_short"), case(request, "test_long", IN_CI), skipped]
    found = tiers.faults_of_marks([x, *others], whole_files=True)
    assert len(found) == (says is not None)
    assert all(str(says) in text for text in found)
    if "no case" in str(says):
        assert tiers.faults_of_marks([x, case(request, "test_x[2]")], True) == []
        assert tiers.faults_of_marks([x], whole_files=False) == []


def test_a_promise_has_a_test_that_is_done_by_default(request: pytest.FixtureRequest) -> None:
    """In whatever order the tests come; what is done at length stands beside its guard."""
    long, part = case(request, "test_long", IN_CI), pytest.mark.extended(guard=tiers.OTHERS)
    items = [case(request, "test_short"), long, case(request, "test_short[2]", part)]
    page = promises.page(items)
    row = f"| Be there.<br>`test_short` | + extended; ci: {HERE}::test_long |\n"
    assert page == promises.page(items[::-1]) and page.endswith(f"|---|---|\n{row}")


def test_the_list_of_promises_is_that_of_the_tests(pytestconfig: pytest.Config) -> None:
    items = pytestconfig.stash.get(tiers.ALL, None) or promises.collected()
    assert promises.PAGE.read_text("utf-8") == promises.page(items), "python tests/promises.py"
