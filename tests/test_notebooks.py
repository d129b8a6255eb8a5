"""The committed notebooks: executed, from top to bottom, without errors or warnings.

That they still execute is for CI to find out: ``python -m pytest --nbmake notebooks``.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parent.parent / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


@cache
def code_cells(path: Path) -> list[dict[str, Any]]:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def test_the_readme_lists_them() -> None:
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert NOTEBOOKS
    for path in NOTEBOOKS:
        assert f"({path.name})" in text


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_was_executed_in_order_without_errors_or_warnings(path: Path) -> None:
    cells = code_cells(path)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        assert cell["outputs"], "".join(cell["source"])
        for output in cell["outputs"]:
            assert output["output_type"] != "error", output["evalue"]
            # Warnings are written there.
            assert output.get("name") != "stderr", output["text"]


def test_every_notebook_asserts_what_it_claims_and_is_small() -> None:
    """Every version of a notebook stays in the repository's history."""
    for path in NOTEBOOKS:
        assert "assert" in "".join("".join(cell["source"]) for cell in code_cells(path)), path
        assert path.stat().st_size < 1e6, path
