"""CONTRIBUTING.md, "Adding to it", word by word: its quotes stand in the sources, its toys work.

What the page adds, a friction law and an integration method, is added to a copy of the sources as
the page says; that is built and tried by `contributed.py`, with the copy first on the path. The
checkout is not touched, and what is installed does not know of them.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import beltdyn as bd
from beltdyn import _core

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "CONTRIBUTING.md").read_text("utf-8").partition("\n## Adding to it\n")[2]
PAGE = PAGE.partition("\n## ")[0]


class Block(NamedTuple):
    """A block of code, and the file that the paragraph above it names last."""

    language: str
    file: str
    is_new: bool
    code: str

    def without(self, sign: str) -> str:
        """Of a block of a change: the lines that are there before it, or after it."""
        return "".join(line[1:] for line in self.code.splitlines(True) if line[0] != sign)


def blocks() -> Iterator[Block]:
    """Blocks in their order; one that follows another directly is of the same file."""
    file, is_new = "", False
    for text, language, code in re.findall(r"(.*?)```(\w+)\n(.*?)```\n", PAGE, re.DOTALL):
        paragraph = text.strip().rpartition("\n\n")[2]
        if named := re.findall(r"`((?:csrc|beltdyn)/[\w/.]+)`", paragraph):
            file = named[-1]
            is_new = paragraph.startswith("New file ")
        yield Block(language, file, is_new, code)


BLOCKS = list(blocks())
#: What users of the toys write, tried in `contributed.py`.
EXAMPLES = [block for block in BLOCKS if block.code.startswith("import beltdyn")]
NEW = [block for block in BLOCKS if block.is_new]
CHANGES = [block for block in BLOCKS if block.language == "diff"]
QUOTES = [block for block in BLOCKS if block not in (*EXAMPLES, *NEW, *CHANGES)]


def test_quotes_stand_in_the_file() -> None:
    assert [block.file for block in NEW] == ["csrc/friction/bouc_wen.h", "csrc/solvers/bs32.c"]
    assert len(EXAMPLES) == 2 and len(QUOTES) >= 10
    for block in QUOTES:
        assert (ROOT / block.file).read_text("utf-8").count(block.code) == 1, block


def test_changes_are_of_rows_that_are_there() -> None:
    laws = "csrc/friction/laws.h"
    assert [block.file for block in CHANGES] == [laws, laws, "csrc/solvers/methods.c"]
    for block in CHANGES:
        before, after = block.without("+"), block.without("-")
        assert (ROOT / block.file).read_text("utf-8").count(before) == 1, block
        assert len(after.splitlines()) == len(before.splitlines()) + 1, block


def test_what_is_new_is_complete_and_its_numbers_are_right() -> None:
    """The law has every function that those of csrc/friction share; the method is of order 3, its
    embedded one of order 2. That both work is for CI, which builds them.
    """

    def of_law(text: str) -> set[str]:
        return set(re.findall(rf"{re.search(r'BD_LAW_([a-z_]+)', text)[1]}_(\w+)\(", text))  # type: ignore[index]

    laws = (ROOT / "csrc" / "friction" / "laws.h").read_text("utf-8")
    headers = re.findall(r'#include "(friction/\w+\.h)"', laws)
    texts = [(ROOT / "csrc" / name).read_text("utf-8") for name in headers]
    functions = set.intersection(*(of_law(text) for text in texts if "define BD_LAW_" in text))
    assert len(functions) >= 5 and functions <= of_law(NEW[0].code)
    table = {
        name: [eval(one) for one in row.replace("\n", "").split(",") if one.strip()]
        for name, row in re.findall(r"double (\w+)\[\] = \{(.*?)\};", NEW[1].code, re.DOTALL)
    }
    a, c, error = np.zeros((4, 4)), np.array(table["c"]), np.array(table["error"])
    a[np.tril_indices(4, -1)] = table["a"]
    b = a[3]
    assert a.sum(axis=1) == pytest.approx(c)
    assert [b.sum(), b @ c, b @ c**2, b @ a @ c] == pytest.approx([1.0, 1 / 2, 1 / 3, 1 / 6])
    assert [error.sum(), error @ c] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert abs(error @ c**2) > 0.01


COMPILER = os.environ.get("CC", "cc")
X86 = platform.machine().lower() in {"x86_64", "amd64"}
#: As setup.py has them, but for -O3: what is tried here is little, and compiled for it alone.
FLAGS = [
    "-std=c11", "-O1", "-fPIC", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off",
    "-fvisibility=hidden", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror",
    "-DNPY_NO_DEPRECATED_API=NPY_1_7_API_VERSION", *(["-DBD_X86_LEVELS=1"] if X86 else []),
    f"-isystem{np.get_include()}", f"-isystem{sysconfig.get_path('include')}",
]  # fmt: skip
LEVELS = {
    "avx2": ["-mavx2", "-mfma"],
    "avx512": ["-mavx512f", "-mavx512dq", "-mavx512vl", "-mfma"],
}


def build(tree: Path, site: Path) -> None:
    """Build the package in a folder, as fast as may be."""
    shutil.copytree(tree / "beltdyn", site / "beltdyn")
    sources = sorted(
        path for path in (tree / "csrc").glob("*/*.c") if path.parent.name != "examples"
    )

    def compiled(source: Path) -> str | None:
        level = source.stem.rpartition("_")[2]
        if level in LEVELS and not X86:
            return None
        target = f"{site / '-'.join(source.parts[-2:])}.o"
        flags = [*FLAGS, *LEVELS.get(level, ()), f"-I{tree / 'csrc'}"]
        subprocess.run([COMPILER, *flags, "-c", str(source), "-o", target], check=True)
        return target

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = [target for target in pool.map(compiled, sources) if target]
    bundle = ["-bundle", "-undefined", "dynamic_lookup"]
    shared = bundle if sys.platform == "darwin" else ["-shared"]
    target = site / "beltdyn" / f"_core{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run([COMPILER, *shared, *objects, "-lm", "-o", str(target)], check=True)


def contents() -> dict[str, bytes]:
    return {
        str(path): path.read_bytes()
        for folder in ("csrc", "beltdyn")
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".c", ".h", ".py", ".pyi")
    }


@pytest.mark.ci(
    guard="test_contributing.py::test_what_is_new_is_complete_and_its_numbers_are_right"
)
def test_the_law_and_the_method_of_the_page(tmp_path: Path) -> None:
    tables = (_core.LAWS, _core.METHODS, _core.PARAMETERS)
    before = contents()
    tree, site = tmp_path / "tree", tmp_path / "site"
    built = shutil.ignore_patterns("*.so", "__pyc*")
    for folder in ("csrc", "beltdyn"):
        shutil.copytree(ROOT / folder, tree / folder, ignore=built)
    for block in NEW:
        assert not (tree / block.file).exists()
        (tree / block.file).write_text(block.code, "utf-8")
    for block in CHANGES:
        text = (tree / block.file).read_text("utf-8")
        (tree / block.file).write_text(
            text.replace(block.without("+"), block.without("-")), "utf-8"
        )
    build(tree, site)

    environment = {**os.environ, "PYTHONPATH": str(site), "CONTRIBUTED": str(tree)}
    for name, block in zip(("LAW", "METHOD"), EXAMPLES, strict=True):
        environment[f"{name}_EXAMPLE"] = block.code
    tries = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", ""]
    tries += ["contributed.py", "test_law_slopes.py", "-k", "contributed or bouc_wen"]
    options = {"cwd": ROOT / "tests", "env": environment, "capture_output": True, "text": True}
    done = subprocess.run(tries, timeout=250, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    assert contents() == before
    assert tables == (_core.LAWS, _core.METHODS, _core.PARAMETERS)
    assert "bs32" not in bd.METHODS and not hasattr(bd, "BoucWen")
