"""The faults of `faults.toml`, and packages with one of them, built beside the checkout."""

from __future__ import annotations

import hashlib
import os
import runpy
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from unittest import mock

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BUILD = ROOT / "build" / "faults"
FAST = ["-O1", "-g0"]  # after the flags of setup.py; the bits are the same (-ffp-contract=off)


class FaultError(Exception):
    """A fault that cannot be planted."""


@dataclass(frozen=True)
class Fault:
    """An edit of one file, what it does wrong, and the tests that are tried first."""

    name: str
    kind: str
    file: str
    old: str
    new: str
    wrong: str
    tests: list[str]
    tests_before: list[str] | None = None

    def planted(self) -> str:
        """Return the file with the fault."""
        text = (ROOT / self.file).read_text("utf-8")
        if (times := text.count(self.old)) != 1:
            raise FaultError(f"{self.name}: its old text occurs {times} times in {self.file}")
        planted = text.replace(self.old, self.new)
        if self.file.endswith(".py"):
            try:
                compile(planted, self.file, "exec")
            except SyntaxError as error:
                raise FaultError(f"{self.name}: {error}") from None
        return planted


def faults() -> list[Fault]:
    rows = tomllib.loads((HERE / "faults.toml").read_text("utf-8"))["fault"]
    listed = [Fault(**row) for row in rows]
    if len({fault.name for fault in listed}) != len(listed):
        raise FaultError("two faults have one name")
    return listed


@cache
def extension() -> Any:
    """Return the extension module as setup.py describes it, but with the lowest kernels alone.

    Those of all instruction levels are compiled from the same headers: what is wrong in one is
    wrong in all, and takes six times as long to compile.
    """
    described: dict[str, Any] = {}
    stubs = {  # in place of the version that setup.py needs, which tests do without
        "setuptools": SimpleNamespace(
            Extension=lambda _name, **fields: SimpleNamespace(**fields), setup=described.update
        ),
        "setuptools.command.build_ext": SimpleNamespace(build_ext=object),
        "setuptools.modified": SimpleNamespace(newer_group=None),
    }
    with mock.patch.dict(sys.modules, cast(Any, stubs)):
        runpy.run_path(str(ROOT / "setup.py"))
    module = described["ext_modules"][0]
    module.sources = [source for source in module.sources if "_avx" not in Path(source).name]
    module.define_macros = [one for one in module.define_macros if one[0] != "BD_X86_LEVELS"]
    return module


def _run(command: list[str], **options: Any) -> bytes:
    try:
        done = subprocess.run(command, capture_output=True, **options)
    except FileNotFoundError:
        raise FaultError(f"there is no command {command[0]} (CC names the compiler)") from None
    if done.returncode != 0:
        raise FaultError(f"{' '.join(command[-3:])}: {done.stderr.decode()[-2000:]}")
    return bytes(done.stdout)


def _compiler(source: str) -> list[str]:
    """Return how one file is compiled, up to what is made of it."""
    module = extension()
    return [
        *shlex.split(os.environ.get("CC", "cc")),
        source,
        *(f"-I{path}" for path in [*module.include_dirs, sysconfig.get_path("include")]),
        *(f"-D{name}={value}" for name, value in [*module.define_macros, ("NDEBUG", "1")]),
        *module.extra_compile_args,
        *["-fPIC", *FAST],
    ]


def _object(folder: Path, source: str) -> Path:
    return folder / (source.replace("/", "-") + ".o")


def _compile(tree: Path, source: str, into: Path) -> Path:
    """Compile one file of a tree of sources."""
    _run([*_compiler(source), "-c", "-o", str(_object(into, source))], cwd=tree)
    return _object(into, source)


@cache
def _as_read(tree: Path, source: str) -> str:
    """Return a digest of what the compiler reads of a file and its headers, without comments."""
    return hashlib.sha256(_run([*_compiler(source), "-E", "-P"], cwd=tree)).hexdigest()


@cache
def sources_key() -> str:
    """Return a digest of all that the extension module is built from."""
    read = [(source, _as_read(ROOT, source)) for source in extension().sources]
    return hashlib.sha256(repr((_compiler(""), read)).encode()).hexdigest()[:16]


@cache
def clean_objects() -> dict[str, Path]:
    """Return the objects of the sources as they are, made once."""
    into = BUILD / f"objects-{sources_key()}"
    if not (into / "complete").exists():
        into.mkdir(parents=True, exist_ok=True)
        for source in extension().sources:
            _compile(ROOT, source, into)
        (into / "complete").touch()
    return {source: _object(into, source) for source in extension().sources}


def core(fault: Fault | None) -> Path:
    """Return the extension module with a fault, built unless it is there."""
    in_c = fault is not None and fault.file.startswith("csrc/")
    edit = f"{fault.file}\0{fault.old}\0{fault.new}" if fault and in_c else ""
    key = hashlib.sha256(f"{sources_key()}\0{edit}".encode()).hexdigest()[:16]
    made = BUILD / "cores" / f"{key}.so"
    if made.exists():
        return made
    made.parent.mkdir(parents=True, exist_ok=True)
    objects = dict(clean_objects())
    tree = Path(tempfile.mkdtemp(dir=BUILD))
    if fault and in_c:
        shutil.copytree(ROOT / "csrc", tree / "csrc")
        (tree / fault.file).write_text(fault.planted(), "utf-8")
        for source in objects:
            if _as_read(tree, source) != _as_read(ROOT, source):
                objects[source] = _compile(tree, source, tree)
    linked = tree / "core.so"
    compiler = shlex.split(os.environ.get("CC", "cc"))
    _run([*compiler, "-shared", *map(str, objects.values()), "-lm", "-o", str(linked)])
    linked.replace(made)
    shutil.rmtree(tree, ignore_errors=True)
    return made


def package(fault: Fault | None) -> Path:
    """Return a folder with the package, faulty or as it is, for PYTHONPATH."""
    folder = BUILD / "packages" / (fault.name if fault else f"clean-{os.getpid()}")
    built = core(fault)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "beltdyn", folder / "beltdyn", ignore=shutil.ignore_patterns("*.so"))
    shutil.copy2(built, folder / "beltdyn" / f"_core{sysconfig.get_config_var('EXT_SUFFIX')}")
    if fault and not fault.file.startswith("csrc/"):
        (folder / fault.file).write_text(fault.planted(), "utf-8")
    return folder
