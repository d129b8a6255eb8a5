"""A pytest plugin that writes down which test began last and which failed, as they do.

`run.py` loads it into the runs that meet a fault: the file tells the test even where the fault ends
the process. Its path is the environment variable BELTDYN_WITNESS.
"""

import os
from pathlib import Path

import pytest

_FILE = Path(os.environ["BELTDYN_WITNESS"])


def _write(word: str, test: str) -> None:
    with _FILE.open("a", encoding="utf-8") as file:
        file.write(f"{word}\t{test}\n")


def pytest_runtest_logstart(nodeid: str) -> None:
    _write("began", nodeid)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed:
        _write("failed", report.nodeid)


def pytest_collectreport(report: pytest.CollectReport) -> None:
    if report.failed:
        _write("failed", report.nodeid)
