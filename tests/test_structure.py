"""What may depend on what: read from the sources, without importing or compiling them.

A graph gives, by the name of each file or module, the names of those it depends on.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

Graph = dict[str, set[str]]


def circle(graph: Graph) -> list[str]:
    """Give the names along a circle, the first again at the end; empty if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_a_circle_is_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert set(circle({"a": {"b"}, "b": {"c"}, "c": {"b"}})) == {"b", "c"}


# --- Python: imports ------------------------------------------------------------------------------


def modules() -> dict[str, Path]:
    """Give the file of each module of the package by its dotted name, of the C core the stub."""
    files = {}
    for file in (ROOT / "beltdyn").rglob("*.py*"):
        if file.suffix not in (".py", ".pyi"):
            continue
        parts = file.relative_to(ROOT).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return files


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


def import_graph() -> Graph:
    """Give the arrows between the modules of the package."""
    files = modules()
    return {
        name: {
            target
            for target in imported(name, file, ast.parse(file.read_text("utf-8")), set(files))
            if target in files
        }
        for name, file in files.items()
    }


def in_room(name: str, room: str) -> bool:
    return f"{name}.".startswith(f"{room}.")


def test_the_graph_of_imports_is_that_of_the_package() -> None:
    graph = import_graph()
    assert {"beltdyn.params", "beltdyn.run_warnings"} <= graph["beltdyn.result"]
    assert {"beltdyn.plot", "beltdyn.kubas.rows"} <= graph["beltdyn.kubas.figures"]
    assert "beltdyn.plot" in graph["beltdyn.cli.written"]  # in a function


def test_every_folder_of_the_package_is_installed() -> None:
    folders = {file.parent for file in (ROOT / "beltdyn").rglob("__init__.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    with (ROOT / "pyproject.toml").open("rb") as file:
        assert set(tomllib.load(file)["tool"]["setuptools"]["packages"]) == names


def test_no_circle_of_imports() -> None:
    assert circle(import_graph()) == []


def test_the_library_does_not_know_the_paper() -> None:
    """The room of the paper uses the library; the command `beltdyn figures` alone enters it."""
    enter = {
        name
        for name, targets in import_graph().items()
        if not in_room(name, "beltdyn.kubas")
        and any(in_room(target, "beltdyn.kubas") for target in targets)
    }
    assert enter == {"beltdyn.cli.figures"}


def test_functions_import_only_what_is_heavy_or_may_be_missing() -> None:
    heavy = {"cattrs", "matplotlib", "rich", "tomli_w", "beltdyn.plot", "beltdyn.kubas"}
    files = modules()
    late = {
        (name, target)
        for name, file in files.items()
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
        for target in imported(name, file, node, set(files))
    }
    assert {
        (name, target)
        for name, target in late
        if not any(in_room(target, allowed) for allowed in heavy)
    } == set()


# --- C: includes ----------------------------------------------------------------------------------

#: Folders of csrc/; each may include those after it. CONTRIBUTING.md says so, too.
FOLDERS = ("binding", "run", "solvers", "physics", "model", "kernels", "base")
#: What any file may include: the public interface, and the tables of the folder of friction laws,
#: which themselves include one another only.
PUBLIC = {"beltdyn.h", "fields.h", "friction/laws.h"}
LAWS = "friction"


def include_graph() -> Graph:
    """Give the arrows between the files of the core, by their paths below csrc/."""
    core = ROOT / "csrc"
    return {
        str(file.relative_to(core)): set(
            re.findall(r'^#include "(.+?)"', file.read_text("utf-8"), re.MULTILINE)
        )
        for file in core.rglob("*.[ch]")
    }


def test_contributing_states_the_direction() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    assert f"`{' -> '.join(FOLDERS)}`" in text


def test_every_file_of_the_core_stands_in_a_folder() -> None:
    files = set(include_graph())
    assert {file.partition("/")[0] for file in files} == {
        *FOLDERS,
        LAWS,
        "examples",
        "beltdyn.h",
        "fields.h",
    }


def test_includes_go_one_way() -> None:
    graph = include_graph()
    assert circle(graph) == []
    for file, targets in graph.items():
        folder = file.partition("/")[0]
        for target in targets - PUBLIC:
            if folder == LAWS:
                assert target.startswith(f"{LAWS}/"), f"{file} includes {target}"
                continue
            assert folder in FOLDERS, f"{file} includes {target}"
            there = target.partition("/")[0]
            assert FOLDERS.index(folder) <= FOLDERS.index(there), f"{file} includes {target}"


def test_other_folders_see_one_header() -> None:
    for file, targets in include_graph().items():
        folder = file.partition("/")[0]
        for target in targets - PUBLIC:
            there = target.partition("/")[0]
            assert there == folder or target == f"{there}/{there}.h", f"{file} includes {target}"
