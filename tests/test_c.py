"""The core without Python: what sees Python, who asks the heap, and the example of `csrc/examples`.

The C tests themselves are programs of the build: `make -C tests/c check`.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import attrs
import drives
import numpy as np
import pytest

import beltdyn as bd

ROOT = Path(__file__).resolve().parent.parent


def test_only_the_binding_sees_python() -> None:
    """And the heap is asked in one place, by way of macros."""
    files = list((ROOT / "csrc").rglob("*.[ch]"))
    assert len(files) > 60
    for path in files:
        text, folder = path.read_text(), path.parent.name
        if folder != "binding":
            assert not re.search(r"#include [<\"](Python|numpy)", text), path
        if folder not in ("binding", "examples") and path.suffix == ".c":
            assert not re.search(r"\b(?:malloc|calloc|realloc|free)\(", text), path


def test_the_example_is_of_the_header_and_has_the_drive_of_the_package() -> None:
    """Numbers of the drive and its load, and functions that are declared: without building it."""
    csrc, drive = ROOT / "csrc", drives.plain()
    text = (csrc / "examples" / "two_pulleys.c").read_text()
    called = set(re.findall(r"\b(bd_\w+)\(", text))
    assert len(called) > 10 and called <= set(
        re.findall(r"\b(bd_\w+)\(", (csrc / "beltdyn.h").read_text())
    )
    numbers = {name: float(v) for name, v in re.findall(r"\.(\w+) = ([-\d.e]+)[,}]", text)}
    for part in (drive.belt, drive.pulleys[1], drive.contact, drive.friction):
        of_part = {
            k: v for k, v in attrs.asdict(part).items() if isinstance(v, float) and k in numbers
        }
        assert of_part and of_part.items() <= numbers.items(), part
    assert f"LINKS = {drive.belt.n_bodies}," in text and "{0.29, 0.0}, .radius" in text
    assert "t[] = {0.0, 0.3}, torques[] = {0.0, 0.0, -100.0, 0.0}" in text


@pytest.mark.ci(
    guard="test_c.py::test_the_example_is_of_the_header_and_has_the_drive_of_the_package"
)
def test_the_example_gives_the_numbers_of_the_package() -> None:
    make = ["make", "-s", "-C", str(ROOT / "tests" / "c"), "example"]
    out = subprocess.run(make, capture_output=True, text=True, check=True, timeout=600).stdout
    rows = np.array([[float(v) for v in line.split()] for line in out.splitlines()[1:7]])
    result = bd.simulate(*drives.plain_scene()[:2], 0.05, t_eval=rows[:, 0])
    assert rows[:, 1:3] == pytest.approx(result.pulleys.omega, abs=1e-3)
    assert rows[:, 3] == pytest.approx(result.joints.force.min(axis=1), abs=0.1)
    assert rows[:, 4] == pytest.approx(result.joints.force.max(axis=1), abs=0.1)
