"""What the README shows runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import beltdyn as bd
from beltdyn import _core

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    found = re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found
    return found


def test_the_examples(capsys: pytest.CaptureFixture[str]) -> None:
    """One after the other, as a reader would; over a shorter time."""
    names: dict[str, object] = {}
    for code in blocks("python"):
        short = re.sub(r"t_end=1\.0(, progress=True)?", "t_end=0.02", code)
        assert short != code
        exec(compile(short, "README.md", "exec"), names)
        assert capsys.readouterr().out
    found = names["found"]
    assert isinstance(found, bd.Identification)
    # 70e3 N was put in: half a percent is several standard deviations
    assert found.values["belt.axial_stiffness"] == pytest.approx(70e3, rel=5e-3)


def test_the_scene_file() -> None:
    scene = bd.Scene.from_toml(blocks("toml")[0])
    assert bd.simulate(*scene[:2], 0.005).success


def test_the_table_of_results_names_what_is_there() -> None:
    result = bd.simulate(*bd.scenes.kubas_case_1()[:2], 1e-3)
    rows = re.findall(r"^\| `(\w+)\.(\w+), ([^`]*)` \|", README, re.MULTILINE)
    assert {group for group, *_ in rows} == {"pulleys", "belt", "joints", "contact"}
    for group, first, others in rows:
        for name in [first, *(other.strip(" .") for other in others.split(","))]:
            assert hasattr(getattr(result, group), name), f"{group}.{name}"


def test_the_commands_are_there() -> None:
    lines = README.splitlines()
    assert 'python -m pip install ".[plot]" && beltdyn run kubas-case-1 --plot case1.png' in lines
    assert 'python -m pip install ".[test]" && python -m pytest' in lines


def test_help_lists_every_warning_and_error() -> None:
    """One table each, of what the core and the package can say; the README names the warnings."""
    fields = (ROOT / "csrc" / "fields.h").read_text(encoding="utf-8")
    of_core = re.findall(r"X\((\w+), [01], \"", fields)
    of_package = {
        code
        for module in ("sanity.py", "observed.py")
        for code in re.findall(
            r'code="(\w+)"', (ROOT / "beltdyn" / module).read_text(encoding="utf-8")
        )
    }
    starred = dict(re.findall(r"X\((\w+), ([01]), \"", fields))
    for code in {*of_core, *of_package}:
        row = re.search(rf"^ +{code}( \*)? +\S", bd.RunWarning.__doc__ or "", re.MULTILINE)
        assert row, code
        assert code not in starred or bool(row[1]) == (starred[code] == "1"), code
        assert f"`{code}`" in README
    symbols = [symbol for symbol, _, kind, _ in _core.ERRORS if kind == "RUN"]
    assert symbols
    for symbol in symbols:
        assert re.search(rf"^ +{symbol} +\S", bd.SimulationError.__doc__ or "", re.MULTILINE)
