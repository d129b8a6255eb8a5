"""The core without Python: what sees Python, who asks the heap, and the example of `csrc/examples`.

The C tests themselves are programs of the build: `make -C tests/c check`.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import drives
import numpy as np
import pytest

import beltdyn as bd

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "csrc"


def test_only_the_binding_sees_python() -> None:
    files = list(CORE.rglob("*.[ch]"))
    assert len(files) > 60
    for path in files:
        if re.search(r"#include [<\"](Python|numpy)", path.read_text()):
            assert path.parent.name == "binding", path


def test_heap_is_asked_in_one_place() -> None:
    for path in CORE.glob("*/*.c"):
        if path.parent.name not in ("binding", "examples"):
            calls = re.findall(r"\b(?:malloc|calloc|realloc|free)\(", path.read_text())
            assert not calls, f"{path.name}: {calls}"


@pytest.mark.ci(guard="test_c.py::test_only_the_binding_sees_python")
def test_the_example_gives_the_numbers_of_the_package() -> None:
    make = ["make", "-s", "-C", str(ROOT / "tests" / "c"), "example"]
    out = subprocess.run(make, capture_output=True, text=True, check=True, timeout=600).stdout
    lines = out.splitlines()
    rows = np.array([[float(v) for v in line.split()] for line in lines[1:7]])
    result = bd.simulate(*drives.plain_scene()[:2], 0.05, t_eval=rows[:, 0])
    assert rows[:, 1:3] == pytest.approx(result.pulleys.omega, abs=1e-3)
    assert rows[:, 3] == pytest.approx(result.joints.force.min(axis=1), abs=0.1)
    assert rows[:, 4] == pytest.approx(result.joints.force.max(axis=1), abs=0.1)
