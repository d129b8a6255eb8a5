"""The committed notebooks: executed, from top to bottom, without errors or warnings.

That they still execute is for CI to find out: ``python -m pytest --nbmake notebooks``.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parent.parent / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_was_executed_in_order_without_errors_or_warnings(path: Path) -> None:
    """Each is listed in the README, asserts what it claims, and is small: history keeps it."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    cells = [cell for cell in cells if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        assert cell["outputs"], "".join(cell["source"])
        for output in cell["outputs"]:
            assert output["output_type"] != "error", output["evalue"]
            assert output.get("name") != "stderr", output["text"]  # where warnings are written
    assert f"({path.name})" in (FOLDER / "README.md").read_text(encoding="utf-8")
    assert "assert" in "".join("".join(cell["source"]) for cell in cells)
    assert path.stat().st_size < 1e6
