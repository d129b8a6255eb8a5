"""The core without Python: its C tests, plain and under sanitizers, its example, its symbols."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "csrc"
COMPILER = os.environ.get("CC", "cc")
STRICT = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
FLAGS = [
    "-std=c11", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off",
    "-fno-pic",  # tables of constants stay read-only, as the test of the symbols wants to see
]  # fmt: skip
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]
COUNTING = ["BD_MALLOC=counting_malloc", "BD_FREE=counting_free"]
#: What the files of the kernels consist of, at every instruction level.
KERNELS = "".join(p.read_text() for p in sorted((CORE / "kernels").glob("*.h")))
#: Everything that does not see Python or a particular processor.
SOURCES = sorted(
    p for p in CORE.glob("*/*.c")
    if p.parent.name not in ("binding", "examples") and "avx" not in p.name
)  # fmt: skip


class Core:
    """The core's objects in a folder: each is compiled once for its flags, whoever links it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.known: dict[tuple[Path, tuple[str, ...]], Path] = {}

    def object(self, source: Path, *flags: str) -> Path:
        """Compile one file, with warnings as errors."""
        if (source, flags) not in self.known:
            target = self.folder / f"{source.stem}-{len(self.known)}.o"
            self.known[source, flags] = target
            command = [COMPILER, *FLAGS, *STRICT, *flags, f"-I{CORE}", "-c", str(source)]
            subprocess.run([*command, "-o", str(target)], check=True)
        return self.known[source, flags]

    def objects(self, *flags: str, macros: Sequence[str] = ()) -> list[Path]:
        """Compile the core; a macro is defined in the files that name it, the others stay."""
        found = []
        for path in SOURCES:
            text = path.read_text() + (KERNELS if path.parent.name == "kernels" else "")
            defined = [f"-D{macro}" for macro in macros if macro.partition("=")[0] in text]
            found.append(self.object(path, *flags, *defined))
        return found

    def program(
        self,
        source: Path,
        *flags: str,
        own: Sequence[str] = (),
        macros: Sequence[str] = (),
        more: Sequence[Path] = (),
    ) -> Path:
        """Link a program with the core and more; `own` are flags of its own source alone."""
        flags = (*flags, *os.environ.get("CFLAGS", "").split())
        objects = [self.object(source, *flags, *own), *self.objects(*flags, macros=macros), *more]
        target = objects[0].with_suffix("")
        link = [*flags, "-no-pie", *os.environ.get("LDFLAGS", "").split()]
        subprocess.run([COMPILER, *link, *map(str, objects), "-lm", "-o", str(target)], check=True)
        return target


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return Core(tmp_path_factory.mktemp("core"))


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
    [
        pytest.param(["-O3"], id="plain"),
        pytest.param(["-O1", *SANITIZERS], id="sanitized"),
        pytest.param(
            ["-O1", *SANITIZERS, "-DBD_SCALAR"], id="sanitized-scalar", marks=pytest.mark.slow
        ),
    ],
)
@pytest.mark.parametrize(
    ("program", "own"),
    [
        pytest.param(program, own, id=f"{program}{name}")
        for program in ("test_core", "test_effects", "test_memory", "test_kernels")
        for name, own in (("", []), ("-joints", ["-DTEST_MESH=BD_MESH_JOINT"]))
        if not (own and program == "test_kernels")  # it has no scene
    ],
)
def test_c_tests(core: Core, program: str, own: list[str], flags: list[str]) -> None:
    """Built with warnings as errors; the sanitized build stops at the first fault or leak."""
    source = ROOT / "tests" / "c" / f"{program}.c"
    macros = COUNTING if program == "test_memory" else ()
    target = core.program(source, *flags, own=own, macros=macros)
    out = run(target)
    match = re.search(r"(\d+) tests, 0 failures", out)
    assert match, out
    assert int(match[1]) >= 1


@pytest.mark.skipif(platform.machine().lower() not in {"x86_64", "amd64"}, reason="levels of x86")
def test_kernels_at_every_level(core: Core) -> None:
    """What the processor does not have is left out by the program."""
    levels = {"avx2": ["-mavx2", "-mfma"],
              "avx512": ["-mavx512f", "-mavx512dq", "-mavx512vl", "-mfma"]}  # fmt: skip
    sources = sorted(CORE.glob("kernels/*avx*.c"))
    assert len(sources) == 4
    objects = [core.object(path, "-O3", *levels[path.stem.rpartition("_")[2]]) for path in sources]
    test = ROOT / "tests" / "c" / "test_kernels.c"
    target = core.program(test, "-O3", macros=["BD_X86_LEVELS=1"], more=objects)
    assert ", 0 failures" in run(target)


def test_exponentials_are_counted(core: Core) -> None:
    """None without a Stribeck curve, and none for samples that are not of friction."""
    source = ROOT / "tests" / "c" / "test_exponentials.c"
    target = core.program(source, "-O3", macros=["BD_COUNT_EXPONENTIALS"])
    assert "3 tests, 0 failures" in run(target)


def test_a_leak_is_seen(core: Core, tmp_path: Path) -> None:
    """The sanitized build itself: a program that forgets its model must fail."""
    source = tmp_path / "leak.c"
    source.write_text(
        '#include "scene.h"\nint main(void) { bd_model *model; bd_scene scene = test_scene();\n'
        "  int code = bd_model_create(&model, &scene, NULL); model = NULL; return code; }\n"
    )
    own = ["-O0", f"-I{ROOT / 'tests' / 'c'}", "-Wno-unused-function",
           "-Wno-unused-const-variable"]  # fmt: skip
    target = core.program(source, "-O1", *SANITIZERS, own=own)
    done = subprocess.run([target], capture_output=True, text=True)
    assert done.returncode != 0
    assert "LeakSanitizer" in done.stderr


def test_example_runs(core: Core) -> None:
    """The example of csrc/examples, and that its numbers are those of the Python package."""
    import drives
    import numpy as np

    import beltdyn as bd

    target = core.program(CORE / "examples" / "two_pulleys.c", "-O3")
    lines = run(target).splitlines()
    rows = np.array([[float(v) for v in line.split()] for line in lines[1:7]])
    result = bd.simulate(*drives.plain_scene()[:2], 0.05, t_eval=rows[:, 0])
    assert rows[:, 1:3] == pytest.approx(result.pulleys.omega, abs=1e-3)
    assert rows[:, 3] == pytest.approx(result.joints.force.min(axis=1), abs=0.1)
    assert rows[:, 4] == pytest.approx(result.joints.force.max(axis=1), abs=0.1)


def test_exported_symbols_carry_the_prefix(core: Core) -> None:
    objects = core.objects("-O3")
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
