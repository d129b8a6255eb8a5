"""The core without Python: its C tests, plain and under sanitizers, its example, its symbols."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "csrc"
COMPILER = os.environ.get("CC", "cc")
STRICT = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
FLAGS = ["-std=c11", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off", "-fopenmp-simd"]
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]
#: Everything that does not see Python or a particular processor.
SOURCES = sorted(
    p for p in CORE.glob("*/*.c")
    if p.parent.name not in ("binding", "examples") and "avx" not in p.name
)  # fmt: skip


def compile_and_link(target: Path, sources: list[Path], *flags: str) -> None:
    command = [COMPILER, *FLAGS, *STRICT, *flags, f"-I{CORE}", *map(str, sources)]
    subprocess.run([*command, "-lm", "-o", str(target)], check=True)


def run(program: Path, *arguments: str) -> str:
    environment = {
        **os.environ,
        "ASAN_OPTIONS": "detect_leaks=1",
        "UBSAN_OPTIONS": "halt_on_error=1",
    }
    done = subprocess.run(
        [program, *arguments], capture_output=True, text=True, env=environment, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_only_the_binding_sees_python() -> None:
    assert len(SOURCES) >= 12
    for path in CORE.rglob("*.[ch]"):
        if re.search(r"#include [<\"](Python|numpy)", path.read_text()):
            assert path.parent.name == "binding", path


@pytest.mark.parametrize(
    "flags",
    [["-O3"], ["-O1", *SANITIZERS], ["-O1", *SANITIZERS, "-DBD_SCALAR"]],
    ids=["plain", "sanitized", "sanitized-scalar"],
)
@pytest.mark.parametrize("program", ["test_core", "test_effects", "test_memory"])
def test_c_tests(tmp_path: Path, program: str, flags: list[str]) -> None:
    """Built with warnings as errors; the sanitized build stops at the first fault or leak."""
    counting = ["-DBD_MALLOC=counting_malloc", "-DBD_FREE=counting_free"]
    target = tmp_path / program
    compile_and_link(
        target,
        [ROOT / "tests" / "c" / f"{program}.c", *SOURCES],
        *flags,
        *(counting if program == "test_memory" else []),
    )
    out = run(target)
    match = re.search(r"(\d+) tests, 0 failures", out)
    assert match, out
    assert int(match[1]) >= 1


def test_a_leak_is_seen(tmp_path: Path) -> None:
    """The sanitized build itself: a program that forgets its model must fail."""
    source = tmp_path / "leak.c"
    source.write_text(
        '#include "scene.h"\nint main(void) { bd_model *model; bd_scene scene = test_scene();\n'
        "  int code = bd_model_create(&model, &scene, NULL); model = NULL; return code; }\n"
    )
    target = tmp_path / "leak"
    compile_and_link(target, [source, *SOURCES], "-O0", *SANITIZERS, f"-I{ROOT / 'tests' / 'c'}",
                     "-Wno-unused-function", "-Wno-unused-const-variable")  # fmt: skip
    done = subprocess.run([target], capture_output=True, text=True)
    assert done.returncode != 0
    assert "LeakSanitizer" in done.stderr


def test_example_runs(tmp_path: Path) -> None:
    """The example of csrc/examples, and that its numbers are those of the Python package."""
    import drives
    import numpy as np

    import beltdyn as bd

    target = tmp_path / "two_pulleys"
    compile_and_link(target, [CORE / "examples" / "two_pulleys.c", *SOURCES], "-O3")
    lines = run(target).splitlines()
    rows = np.array([[float(v) for v in line.split()] for line in lines[1:7]])
    result = bd.simulate(*drives.plain_scene()[:2], 0.05, t_eval=rows[:, 0])
    assert rows[:, 1:3] == pytest.approx(result.pulleys.omega, abs=1e-3)
    assert rows[:, 3] == pytest.approx(result.joints.force.min(axis=1), abs=0.1)
    assert rows[:, 4] == pytest.approx(result.joints.force.max(axis=1), abs=0.1)


def test_exported_symbols_carry_the_prefix(tmp_path: Path) -> None:
    objects = []
    for source in SOURCES:
        target = tmp_path / f"{source.stem}.o"
        command = [COMPILER, *FLAGS, "-fno-pic", f"-I{CORE}", "-c", str(source), "-o", target]
        subprocess.run(command, check=True)
        objects.append(target)
    nm = shutil.which("nm")
    assert nm, "nm (binutils) comes with every C compiler"
    out = subprocess.run([nm, "-g", "--defined-only", *objects], capture_output=True, text=True,
                         check=True).stdout  # fmt: skip
    names = [line.split()[2] for line in out.splitlines() if len(line.split()) == 3]
    assert len(names) > 30
    assert [name for name in names if not name.startswith("bd_")] == []
    # nothing writable at file scope: data (D, B) would be a global
    writable = [line for line in out.splitlines() if re.search(r" [DBC] ", line)]
    assert writable == []


def test_heap_is_asked_in_one_place() -> None:
    for path in SOURCES:
        calls = re.findall(r"\b(?:malloc|calloc|realloc|free)\(", path.read_text())
        assert not calls, f"{path.name}: {calls}"
