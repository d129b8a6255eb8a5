"""A test outside the default tier names its guard; the list of promises is that of the tests."""

from __future__ import annotations

from typing import Any, NamedTuple

import promises
import pytest
import tiers

HERE = "test_tiers.py"


class Collected(NamedTuple):
    """What `tiers` reads of a collected test."""

    nodeid: str
    marks: tuple[Any, ...] = ()

    def iter_markers(self, name: str) -> list[Any]:
        return [mark.mark for mark in self.marks if mark.name == name]

    def get_closest_marker(self, name: str) -> Any:
        return next(iter(self.iter_markers(name)), None)


@pytest.mark.parametrize(
    ("marks", "says"),
    [
        ([pytest.mark.ci()], "ci without guard="),
        ([pytest.mark.extended(guard="test_none.py::test_x")], "does not exist"),
        ([pytest.mark.ci(guard=f"{HERE}::test_nothing")], "does not exist"),
        ([pytest.mark.ci(guard="test_c.py::test_the_example_gives_the_numbers_of_the_package")],
         "is not in the default tier itself"),
        ([pytest.mark.extended(guard=tiers.OTHERS)], "no case of it is in the default tier"),
        ([pytest.mark.ci(guard=f"{HERE}::test_marks_without_a_guard_are_refused")], None),
    ],
)  # fmt: skip
def test_marks_without_a_guard_are_refused(marks: list[Any], says: str | None) -> None:
    """Other cases are a guard only if there are some."""
    items: list[Any] = [Collected(f"{HERE}::test_x[1]", tuple(marks))]
    found = tiers.faults_of_marks(items, whole_files=True)
    assert len(found) == (says is not None)
    assert all(str(says) in text for text in found)
    if "no case" in str(says):
        assert tiers.faults_of_marks([*items, Collected(f"{HERE}::test_x[2]")], True) == []
        assert tiers.faults_of_marks(items, whole_files=False) == []


def test_the_list_of_promises_is_that_of_the_tests() -> None:
    assert promises.PAGE.read_text("utf-8") == promises.page(), "python tests/promises.py"
