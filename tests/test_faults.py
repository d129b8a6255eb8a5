"""The planted faults (faults/README.md) fit the sources and the tests, and were found."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent


def test_every_fault_can_be_planted_and_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The text that it edits occurs once, the tests it names exist, and by `found.tsv` a test that
    runs for every change finds it.
    """
    monkeypatch.syspath_prepend(TESTS / "faults")
    faults = importlib.import_module("planting").faults()
    rows = [line.split("\t") for line in (TESTS / "faults/found.tsv").read_text().splitlines()]
    tiers = {fault: tier for fault, when, _commit, tier, *_ in rows if when == "after"}
    for fault in faults:
        assert fault.planted() != (TESTS.parent / fault.file).read_text("utf-8"), fault.name
        for hint in fault.tests:
            assert (TESTS / re.split("::| ", hint)[0]).is_file(), (fault.name, hint)
        found = tiers.get(fault.name)
        assert found in ("default", "ci"), f"run.py {fault.name} --note after: {found}"
