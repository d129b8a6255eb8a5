"""What README, docstrings and CONTRIBUTING show runs as it stands there, and names what exists."""

from __future__ import annotations

import inspect
import re
import textwrap
from pathlib import Path

import attrs
import pytest
from click.testing import CliRunner

import beltdyn as bd
from beltdyn import _core, cli
from beltdyn.outputs.histories import CouplingHistory, MountHistory

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def example(thing: object) -> str:
    """The first indented example of a docstring, after a paragraph that ends in two colons."""
    found = re.search(r"::\n\n((?:    .*\n|\n)+)", inspect.getdoc(thing) or "")
    assert found, thing
    return textwrap.dedent(found[1])


def test_the_examples(capsys: pytest.CaptureFixture[str]) -> None:
    """One after the other, as a reader would; over a shorter time."""
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert blocks
    for code in [*blocks, example(bd.identify)]:
        short = re.sub(r"t_end=1\.0(, progress=True)?", "t_end=0.02", code)
        assert short != code
        exec(compile(short, "README.md", "exec"), names)
        assert capsys.readouterr().out
    found = names["found"]
    assert isinstance(found, bd.Identification)
    # 70e3 N was put in: half a percent is several standard deviations
    assert found.values["belt.axial_stiffness"] == pytest.approx(70e3, rel=5e-3)
    exec(example(bd.Tensioning), names)
    params = names["params"]
    assert isinstance(params, bd.Params) and params.tensioning.friction


def test_the_scene_file_and_the_methods() -> None:
    scene = bd.Scene.from_toml(example(bd.Scene.from_toml))
    assert scene.params.tensioning.offset == ((0.0, 0.0), (-0.006, 0.0))
    assert bd.simulate(*scene[:2], 0.005).success
    rows = re.findall(r"^(\w+) +\w", example(bd.simulate), re.MULTILINE)
    assert sorted(rows) == sorted(bd.METHODS)


OF_SOME = {"mounts": MountHistory, "couplings": CouplingHistory}


def test_the_table_of_results_names_what_is_there() -> None:
    result = bd.simulate(*bd.scenes.kubas_case_1()[:2], 1e-3)
    rows = re.findall(r"^(\w+) +(\w+, .*?) +\((.*)\)$", example(bd.Result), re.MULTILINE)
    n_t, n_b = result.belt.x.shape
    sizes = {"n_t": n_t, "n_b": n_b, "n_p": 2}
    for group, names, sizes_of in rows:
        for name in names.replace("..., ", "").split(", "):
            if group in OF_SOME:  # of drives that have some
                assert getattr(result, group) is None
                assert name in attrs.fields_dict(OF_SOME[group])
                continue
            shape = tuple(sizes[size] for size in sizes_of.replace(",", " ").split())
            assert getattr(getattr(result, group), name).shape == shape, f"{group}.{name}"
    groups = {"pulleys", "belt", "joints", "contact", *OF_SOME, "energy"}
    assert {group for group, *_ in rows} == groups
    assert result.span_tension.shape == result.slip.shape == (n_t, 2)


def test_the_readme_is_short_and_what_it_and_the_other_pages_name_is_there() -> None:
    lines = README.splitlines()
    assert len(lines) <= 100
    assert 'python -m pip install ".[plot]" && beltdyn run kubas-case-1 --plot case1.png' in lines
    assert 'python -m pip install ".[test]" && python -m pytest' in lines
    pages = ("csrc/MODEL.md", "benchmarks/README.md", "notebooks/README.md")
    for page in ("README.md", "CONTRIBUTING.md", *pages):
        text = (ROOT / page).read_text(encoding="utf-8")
        for link in re.findall(r"\]\(([^)#:]+)\)", text):
            assert ((ROOT / page).parent / link).exists(), link
    shown = CliRunner().invoke(cli.main, ["--help"]).output
    for command in cli.main.commands:
        assert f"beltdyn {command}" in shown
    for code in (0, 1, 2, 130):
        assert re.search(rf"\b{code} \w", shown)


def test_files_that_contributing_names_and_sections_that_the_code_cites_are_there() -> None:
    there = re.sub(r"New file `\S+`", "", CONTRIBUTING)  # test_contributing.py makes those
    paths = re.findall(r"`((?:csrc|beltdyn|tests|benchmarks)/[\w/.]+)`", there)
    assert len(paths) > 30
    assert [path for path in paths if not (ROOT / path).exists()] == []
    page = (ROOT / "csrc" / "MODEL.md").read_text(encoding="utf-8")
    sections = set(re.findall(r"^## (\d+)\. ", page, re.MULTILINE))
    for folder, pattern in (("csrc", "*.[ch]"), ("beltdyn", "*.py"), ("tests", "*.py")):
        for path in (ROOT / folder).rglob(pattern):
            text = path.read_text(encoding="utf-8")
            assert set(re.findall(r"MODEL\W+sections? (\d+)", text)) <= sections, path


def test_help_lists_every_warning_and_error() -> None:
    """One table each, of what the core and the package can say; the README leads to it."""
    fields = (ROOT / "csrc" / "fields.h").read_text(encoding="utf-8")
    starred = dict(re.findall(r"X\((\w+), ([01]), \"", fields))
    package = [ROOT / "beltdyn" / module for module in ("drive/sanity.py", "run/observed.py")]
    text = "".join(path.read_text(encoding="utf-8") for path in package)
    for code in {*starred, *re.findall(r'code="(\w+)"', text)}:
        row = re.search(rf"^ +{code}( \*)? +\S", bd.RunWarning.__doc__ or "", re.MULTILINE)
        assert row, code
        assert code not in starred or bool(row[1]) == (starred[code] == "1"), code
    assert "`help(bd.RunWarning)`" in README
    symbols = [symbol for symbol, _, kind, _ in _core.ERRORS if kind == "RUN"]
    assert symbols
    for symbol in symbols:
        assert re.search(rf"^ +{symbol}: \S", bd.SimulationError.__doc__ or "", re.MULTILINE)
