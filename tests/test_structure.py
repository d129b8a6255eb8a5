"""What may depend on what: read from the sources, without importing or compiling them.

A graph gives, by the name of each file or module, the names of those it depends on.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

Graph = dict[str, set[str]]


def modules() -> dict[str, Path]:
    """Give the file of each module of the package by its dotted name, of the C core the stub."""
    package = ROOT / "beltdyn"
    return {
        ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
        for file in (*package.rglob("*.py"), *package.rglob("*.pyi"))
    }


def imported(name: str, file: Path, tree: ast.AST, known: set[str]) -> Iterator[str]:
    """Give what is imported in a tree, a module of the package or the top package of another.

    Whether in a function, for type checking only, or at the top makes no difference.
    """
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            source = ".".join([*above, *filter(None, [node.module])])
            found = [f"{source}.{alias.name}" for alias in node.names]
        else:
            continue
        for one in found:
            own = one if one in known else one.rpartition(".")[0]
            yield own if own in known else one.partition(".")[0]


def in_room(name: str, *rooms: str) -> bool:
    return any(f"{name}.".startswith(f"{room}.") for room in rooms)


def test_imports_have_no_circle_and_the_library_does_not_know_the_paper() -> None:
    """The room of the paper uses the library; the command `beltdyn figures` alone enters it.
    Functions import only what is heavy or may be missing.
    """
    files, paper = modules(), "beltdyn.kubas"
    heavy = ("cattrs", "matplotlib", "rich", "tomli_w", "beltdyn.plot", paper)
    graph: Graph = {}
    for name, file in files.items():
        tree = ast.parse(file.read_text("utf-8"))
        graph[name] = {one for one in imported(name, file, tree, set(files)) if one in files}
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                late = set(imported(name, file, node, set(files)))
                assert {one for one in late if not in_room(one, *heavy)} == set(), name
    assert {"beltdyn.params", "beltdyn.run_warnings"} <= graph["beltdyn.result"]
    assert {"beltdyn.plot", "beltdyn.kubas.rows"} <= graph["beltdyn.kubas.figures"]
    assert "beltdyn.plot" in graph["beltdyn.cli.written"]  # in a function
    TopologicalSorter(graph).prepare()  # raises CycleError, which names a circle
    assert {
        name
        for name, targets in graph.items()
        if not in_room(name, paper) and any(in_room(target, paper) for target in targets)
    } == {"beltdyn.cli.figures"}


def test_every_folder_of_the_package_is_installed() -> None:
    folders = {file.parent for file in (ROOT / "beltdyn").rglob("__init__.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    with (ROOT / "pyproject.toml").open("rb") as file:
        assert set(tomllib.load(file)["tool"]["setuptools"]["packages"]) == names


#: Folders of csrc/; each may include those after it. CONTRIBUTING.md says so, too.
FOLDERS = ("binding", "run", "solvers", "belts", "physics", "model", "kernels", "base")
#: What any file may include: the public interface, and the tables of the folder of friction laws,
#: which themselves include one another only.
PUBLIC = {"beltdyn.h", "fields.h", "friction/laws.h"}
LAWS = "friction"


def test_includes_go_one_way() -> None:
    """As CONTRIBUTING states it; of other folders each file sees one header."""
    assert f"`{' -> '.join(FOLDERS)}`" in (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    core = ROOT / "csrc"
    graph: Graph = {
        file.relative_to(core).as_posix(): set(
            re.findall(r'^#include "(.+?)"', file.read_text("utf-8"), re.MULTILINE)
        )
        for file in core.rglob("*.[ch]")
    }
    others = {LAWS, "examples", "beltdyn.h", "fields.h"}
    assert {file.partition("/")[0] for file in graph} == {*FOLDERS, *others}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names a circle
    for file, targets in graph.items():
        folder = file.partition("/")[0]
        for target in targets - PUBLIC:
            there = target.partition("/")[0]
            assert there == folder or target == f"{there}/{there}.h", f"{file} includes {target}"
            if folder == LAWS:
                assert there == LAWS, f"{file} includes {target}"
                continue
            assert folder in FOLDERS, f"{file} includes {target}"
            assert FOLDERS.index(folder) <= FOLDERS.index(there), f"{file} includes {target}"


def test_no_code_asks_which_belt_it_is() -> None:
    """Belt models tell facts: the core calls functions of a row of csrc/belts, Python reads BELTS.

    Their names stand in the public header, in what reads a scene, and where kernels are chosen;
    kernels are compiled for each belt and ask constants of theirs.
    """
    named = re.compile(
        r"BD_MESH_\w|BD_BELT_(MODEL_|AUTO|LINKS|STRING)|bd_belt_(joint|string|paper)\b"
    )
    known = {"beltdyn.h", "binding/model.c", "kernels/rhs.h"}
    core, package = ROOT / "csrc", ROOT / "beltdyn"
    found = {
        file.relative_to(core).as_posix()
        for file in core.rglob("*.[ch]")
        if file.parent.name not in ("belts", "examples") and named.search(file.read_text("utf-8"))
    }
    assert found == known
    asked = re.compile(r"\b(mesh|belt_model) [=!]= ")
    assert not [one for one in package.rglob("*.py") if asked.search(one.read_text("utf-8"))]
