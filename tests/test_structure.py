"""What may depend on what: read from the sources, without compiling them.

A graph gives, by the name of each file or module, the names of those it depends on.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import beltdyn as bd
from beltdyn._moved import MOVED

ROOT = Path(__file__).resolve().parent.parent

Graph = dict[str, set[str]]


def modules() -> dict[str, Path]:
    """Return the file of each module of the package by its dotted name, of the C core the stub."""
    package = ROOT / "beltdyn"
    return {
        ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
        for file in (*package.rglob("*.py"), *package.rglob("*.pyi"))
    }


def imported(name: str, file: Path, tree: ast.AST, known: set[str]) -> Iterator[str]:
    """Yield what is imported in a tree, a module of the package or the top package of another.

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


#: Rooms of the package; each may import from those after it. CONTRIBUTING.md says so, too.
ROOMS = (
    "cli", "sweeping", "identification", "accuracy", "plot", "explaining", "vibration",
    "spectra", "scenes", "run", "verification", "many", "result", "report", "outputs", "drive",
    "loads", "base",
)  # fmt: skip
OF_ROOMS = tuple(f"beltdyn.{name}" for name in ROOMS)


def in_room(name: str, *rooms: str) -> bool:
    return any(f"{name}.".startswith(f"{room}.") for room in rooms)


def room(name: str) -> str:
    """Return the room of a module, or "" of what is in none."""
    return name.split(".")[1] if name.count(".") and in_room(name, *OF_ROOMS) else ""


def test_imports_of_the_package_go_one_way_and_have_no_circle() -> None:
    """Those in functions and for type checkers as well. The package of the paper uses the public
    interface alone, and only the command `beltdyn figures` knows it. Functions import only what is
    heavy or may be missing.
    """
    assert f"`{' -> '.join(ROOMS)}`" in (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    files = modules()
    drawing = ("matplotlib", "beltdyn.plot", "beltdyn.accuracy.study_figures")
    rooms = ("beltdyn.explaining", "beltdyn.report", "beltdyn.sweeping")
    heavy = ("rich", "tomli_w", *drawing, *rooms, "beltdyn_kubas")
    graph: Graph = {}
    for name, file in files.items():
        tree = ast.parse(file.read_text("utf-8"))
        graph[name] = {one for one in imported(name, file, tree, set(files)) if one in files}
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                late = set(imported(name, file, node, set(files)))
                assert {one for one in late if not in_room(one, *heavy)} == set(), name
    assert {"beltdyn.drive.params", "beltdyn.base.run_warnings"} <= graph["beltdyn.result.result"]
    assert "beltdyn.plot" in graph["beltdyn.cli.written"]  # in a function
    TopologicalSorter(graph).prepare()  # raises CycleError, which names a circle
    above, below = {"beltdyn", "beltdyn.__main__", "beltdyn._moved"}, {"beltdyn._core"}
    assert {name for name in files if not room(name)} == above | below
    assert {room(name) for name in files} - {""} == set(ROOMS)
    for name in files.keys() - above:
        for target in graph[name] - below:
            if name.startswith("beltdyn.cli.") and target == "beltdyn":
                continue  # its version
            assert room(target), f"{name} imports {target}"
            assert ROOMS.index(room(name)) <= ROOMS.index(room(target)), f"{name} imports {target}"
    paper = [*(ROOT / "notebooks" / "beltdyn_kubas").glob("*.py")]
    assert len(paper) > 5
    for file in paper:
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                assert {"beltdyn"}.issuperset(a.name for a in node.names if "beltdyn" in a.name)
            assert not (isinstance(node, ast.ImportFrom) and "beltdyn" in (node.module or ""))
    knows = {name for name, file in files.items() if "beltdyn_kubas" in file.read_text("utf-8")}
    assert knows == {"beltdyn.cli.figures_command", "beltdyn._moved"}


def test_no_two_modules_have_one_name() -> None:
    """Nor one the name of another room; a room may have a module of its own name."""
    names = [name for name, file in modules().items() if file.name != "__init__.py"]
    count = Counter(name.rpartition(".")[2] for name in names)
    assert [name for name, times in count.items() if times > 1] == []
    assert [
        one for one in names if (end := one.rpartition(".")[2]) in ROOMS and room(one) != end
    ] == []


def test_the_map_of_files_names_every_one() -> None:
    """Tables of CONTRIBUTING; of the core but for headers of folders and files of one level."""
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    table = re.findall(r"^\| `(\w+)` \| (.+) \|$", text, re.MULTILINE)
    rooms = {file.parent for file in modules().values()}
    folders = {ROOT / "csrc" / name for name in FOLDERS} - {ROOT / "csrc" / "binding"}
    for kind, places in ((r"\w+\.py", rooms), (r"\w+\.[ch]", folders)):
        for place in {one for one in places if one.name in (*ROOMS, *FOLDERS)}:
            row = " ".join(words for name, words in table if name == place.name)
            there = {
                file.name
                for file in place.rglob("*")
                if re.fullmatch(kind, file.name)
                if file.stem not in ("__init__", place.name) or file.suffix == ".py"
                if not file.name.endswith(("__init__.py", "_baseline.c", "_avx2.c", "_avx512.c"))
            }
            assert there <= set(re.findall(r"[\w.]+", row)), place


def test_a_module_that_has_moved_says_where_it_is() -> None:
    """Whatever way it is asked for. The names are not those of public things, which never move."""
    there = set(modules())
    assert {f"beltdyn.{name}" for name in MOVED.values()} <= there
    assert {f"beltdyn.{name}" for name in MOVED} & there == set()
    message = r"^beltdyn\.params has moved to beltdyn\.drive\.params"
    for statement in ("import beltdyn.params", "from beltdyn import params"):
        with pytest.raises(ImportError, match=message):
            exec(statement, {})
    with pytest.raises(AttributeError, match=message):
        _ = bd.params  # type: ignore[attr-defined]
    exec("import beltdyn.friction as laws; assert laws.LAWS", {})


def test_docstrings_say_what_is_returned() -> None:
    """In the field's words: "Return", "Describe" or what it does, not "Give", "Tell" or "Say"."""
    has_docstring = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    odd = [
        f"{name}: {text.splitlines()[0]}"
        for name, file in modules().items()
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, has_docstring)
        if (text := ast.get_docstring(node) or "").startswith(("Give ", "Tell ", "Say "))
    ]
    assert not odd


def test_docstrings_of_private_things_have_one_line() -> None:
    """What else there is to say of them are comments, which say why."""
    private = re.compile(r"_[^_]")
    named = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    assert not [
        f"{name}: {node.name}"
        for name, file in modules().items()
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, named) and private.match(node.name)
        if "\n" in (ast.get_docstring(node) or "")
    ]


def test_every_folder_of_the_package_is_installed() -> None:
    folders = {file.parent for file in (ROOT / "beltdyn").rglob("__init__.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    with (ROOT / "pyproject.toml").open("rb") as file:
        assert set(tomllib.load(file)["tool"]["setuptools"]["packages"]) == names | {
            "beltdyn_kubas"
        }


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
