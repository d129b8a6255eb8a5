"""What the README shows runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import beltdyn as bd

README = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found
    return found[1]


def test_the_example(capsys: pytest.CaptureFixture[str]) -> None:
    code = block("python").replace("t_end=1.0, progress=True", "t_end=0.02")
    assert "t_end=0.02" in code
    exec(compile(code, "README.md", "exec"), {})
    assert "[" in capsys.readouterr().out


def test_the_scene_file() -> None:
    scene = bd.Scene.from_toml(block("toml"))
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
