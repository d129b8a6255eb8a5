"""Plant the faults of `faults.toml` one by one and name the test that finds each.

    python tests/faults/run.py [NAME...] [--tests DIR] [--note TEXT] [--hints-only] [--all-default]

Each edit goes into a copy of its own of the package under `build/faults/`; the tests import that.
The tests that the fault names as hints run first, then the rest of the default tier, then the
others. What found a fault goes into `found.tsv`. The exit code is 1 if a fault was found by nothing
or by the extended tier alone, 2 if an edit does not apply or does not compile.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import runpy
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BUILD = ROOT / "build" / "faults"
FOUND = HERE / "found.tsv"
COLUMNS = ("fault", "when", "tests", "tier", "found by", "seconds")
NOTHING = "nothing"
# A test that takes longer has been found out by the fault: the slowest of the default tier takes
# a tenth of it. Whole tiers have an hour.
TEST_LIMIT, TIER_LIMIT = 200, 3600
TIERS = {
    "default": "not ci and not extended",
    "ci": "ci and not extended",
    "extended": "extended",
}
OLD_TIERS = {"default": "not slow", "slow": "slow"}  # of checkouts without tests/tiers.py
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
        return text.replace(self.old, self.new)


def faults() -> list[Fault]:
    rows = tomllib.loads((HERE / "faults.toml").read_text("utf-8"))["fault"]
    listed = [Fault(**row) for row in rows]
    if len({fault.name for fault in listed}) != len(listed):
        raise FaultError("two faults have one name")
    return listed


# --- building ------------------------------------------------------------------------------------


@cache
def extension() -> Any:
    """Return the extension module as setup.py describes it, but with the lowest kernels alone.

    Those of all instruction levels are compiled from the same headers: what is wrong in one is
    wrong in all, and takes six times as long to compile.
    """
    with mock.patch("setuptools.setup") as setup:
        names = runpy.run_path(str(ROOT / "setup.py"))
    module = setup.call_args.kwargs["ext_modules"][0]
    module.sources = [source for source in module.sources if Path(source) not in names["LEVELS"]]
    module.define_macros = [one for one in module.define_macros if one[0] != "BD_X86_LEVELS"]
    return module


def _run(command: list[str], **options: Any) -> None:
    done = subprocess.run(command, capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise FaultError(f"{' '.join(command[-3:])}: {done.stderr[-2000:]}")


def _compile(tree: Path, source: str, into: Path) -> Path:
    """Compile one file of a tree of sources; the headers it reads are listed beside the object."""
    module = extension()
    target = into / (source.replace("/", "-") + ".o")
    includes = [*module.include_dirs, sysconfig.get_path("include")]
    _run(
        [
            *shlex.split(os.environ.get("CC", "cc")),
            *["-c", source, "-o", str(target), "-MMD", "-fPIC", "-DNDEBUG"],
            *(f"-I{path}" for path in includes),
            *(f"-D{name}={value}" for name, value in module.define_macros),
            *module.extra_compile_args,
            *FAST,
        ],
        cwd=tree,
    )
    return target


def _reads(made: Path) -> set[str]:
    """Return the files that an object was compiled from."""
    rule = made.with_suffix(".d").read_text("utf-8").replace("\\\n", " ")
    return set(rule.partition(":")[2].split())


@cache
def sources_key() -> str:
    """Return a digest of all that the extension module is built from."""
    digest = hashlib.sha256(repr((FAST, extension().sources)).encode())
    for path in [ROOT / "setup.py", *sorted((ROOT / "csrc").rglob("*.[ch]"))]:
        digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def clean_objects() -> dict[str, Path]:
    """Return the objects of the sources as they are, made once."""
    into = BUILD / f"objects-{sources_key()}"
    if not (into / "complete").exists():
        into.mkdir(parents=True, exist_ok=True)
        for source in extension().sources:
            _compile(ROOT, source, into)
        (into / "complete").touch()
    return {s: into / (s.replace("/", "-") + ".o") for s in extension().sources}


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
        for source, clean in objects.items():
            if fault.file in _reads(clean):
                objects[source] = _compile(tree, source, tree)
    linked = tree / "core.so"
    compiler = shlex.split(os.environ.get("CC", "cc"))
    _run([*compiler, "-shared", *map(str, objects.values()), "-lm", "-o", str(linked)])
    linked.replace(made)
    shutil.rmtree(tree, ignore_errors=True)
    return made


def package(fault: Fault | None) -> Path:
    """Return a folder with the package, faulty or as it is, for PYTHONPATH."""
    folder = BUILD / "packages" / (fault.name if fault else "clean")
    built = core(fault)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "beltdyn", folder / "beltdyn", ignore=shutil.ignore_patterns("*.so"))
    shutil.copy2(built, folder / "beltdyn" / f"_core{sysconfig.get_config_var('EXT_SUFFIX')}")
    if fault and not fault.file.startswith("csrc/"):
        (folder / fault.file).write_text(fault.planted(), "utf-8")
    return folder


# --- running tests -------------------------------------------------------------------------------


def failing_test(tests: Path, where: Path, marks: str, hint: str, limit: float) -> str | None:
    """Return the first test that fails with the package in a folder; None if none does."""
    witness = where / "witness.tsv"
    witness.unlink(missing_ok=True)
    environment = dict(
        os.environ,
        PYTHONPATH=os.pathsep.join([str(where), str(HERE)]),
        PYTHONDONTWRITEBYTECODE="1",
        BELTDYN_WITNESS=str(witness),
    )
    chosen, *options = shlex.split(hint)
    command = [sys.executable, "-P", "-m", "pytest", "-n", "0", "-x", "-q", "--tb=no"]
    command += ["-p", "faults_witness", "-p", "no:cacheprovider", "-o", f"timeout={TEST_LIMIT}"]
    command += ["-m", marks, str(tests / chosen), *options]
    with (where / "output.txt").open("w") as output:
        try:
            code = subprocess.run(
                command,
                cwd=tests.parent,
                env=environment,
                timeout=limit,
                stdout=output,
                stderr=subprocess.STDOUT,
            ).returncode
        except subprocess.TimeoutExpired:
            code = -1
    lines = witness.read_text("utf-8").splitlines() if witness.exists() else []
    words = [line.split("\t") for line in lines]
    if failed := [test for word, test in words if word == "failed"]:
        return failed[0]
    if code in (0, 5):
        return None
    if code == 4 and not words:
        print(f"    no such test: {hint}", flush=True)
        return None
    return f"{words[-1][1]} (ended the process)" if words else f"pytest ended with {code}"


_clean: dict[tuple[Path, str], bool] = {}


def passes_clean(tests: Path, test: str, limit: float) -> bool:
    """Return whether a test passes without the fault."""
    node = test.removesuffix(" (ended the process)").partition("tests/")[2]
    if (tests, node) not in _clean:
        hint = shlex.quote(node)
        _clean[tests, node] = failing_test(tests, package(None), "", hint, limit) is None
    return _clean[tests, node]


def found(fault: Fault, tests: Path, options: argparse.Namespace) -> tuple[str, str]:
    """Return the tier and the test that finds a fault."""
    where = package(fault)
    is_old = not (tests / "tiers.py").exists()
    tiers = OLD_TIERS if is_old else TIERS
    hints = fault.tests_before if is_old and fault.tests_before else fault.tests

    def tried() -> Iterator[tuple[str, str, float]]:
        if not options.all_default:
            for tier in tiers:
                yield from ((tier, hint, TIER_LIMIT / 6) for hint in hints)
        if options.all_default or not options.hints_only:
            yield from ((tier, ".", TIER_LIMIT) for tier in tiers)

    for tier, hint, limit in tried():
        if test := failing_test(tests, where, tiers[tier], hint, limit):
            if not passes_clean(tests, test, limit):
                print(f"    fails without the fault too: {test}", flush=True)
                continue
            return tier, test.removeprefix("tests/")
    return "-", "not its hints" if options.hints_only else NOTHING


# --- the record ----------------------------------------------------------------------------------


def record(row: tuple[str, ...], order: list[str]) -> None:
    """Put a row into found.tsv, in place of the one of the same fault and time."""
    lines = FOUND.read_text("utf-8").splitlines()[1:] if FOUND.exists() else []
    rows = {tuple(line.split("\t")[:2]): line for line in lines}
    rows[row[:2]] = "\t".join(row)
    kept = [rows[key] for key in sorted(rows, key=lambda k: (k[1], order.index(k[0])))]
    FOUND.write_text("\n".join(["\t".join(COLUMNS), *kept, ""]), "utf-8")


def commit_of(tests: Path) -> str:
    """Return the commit of the tests, with a plus if they have been changed since."""
    git = ["git", "-C", str(tests)]
    head = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    changed = subprocess.run(
        [*git, "status", "--porcelain", "-uno", "--", "."], capture_output=True, text=True
    )
    return head.stdout.strip() + ("+" if changed.stdout.strip() else "")


def main() -> int:
    parser = argparse.ArgumentParser(description="Plant faults and name the tests that find them.")
    parser.add_argument("names", nargs="*", help="of the faults; all by default")
    parser.add_argument("--tests", type=Path, default=ROOT / "tests", help="of which checkout")
    parser.add_argument("--note", help="what the column `when` says, instead of the commit")
    parser.add_argument("--hints-only", action="store_true", help="run no more than the hints")
    parser.add_argument("--all-default", action="store_true", help="whole tiers, without hints")
    parser.add_argument("--check", action="store_true", help="build only, and run nothing")
    options = parser.parse_args()
    tests = options.tests.resolve()
    os.chdir(ROOT)  # setup.py looks for its sources here
    try:
        listed = faults()
        for fault in listed:
            fault.planted()
        if unknown := set(options.names) - {fault.name for fault in listed}:
            raise FaultError(f"no fault is called {', '.join(sorted(unknown))}")
        commit, blind = commit_of(tests), 0
        for fault in listed:
            if options.names and fault.name not in options.names:
                continue
            began = time.monotonic()
            if options.check:
                core(fault)
                print(f"{fault.name}: {time.monotonic() - began:.0f} s", flush=True)
                continue
            tier, test = found(fault, tests, options)
            seconds = f"{time.monotonic() - began:.0f}"
            print(f"{fault.name}: {tier}: {test} ({seconds} s)", flush=True)
            order = [fault.name for fault in listed]
            record((fault.name, options.note or commit, commit, tier, test, seconds), order)
            blind += tier in ("-", "extended")
    except FaultError as error:
        print(error, file=sys.stderr)
        return 2
    return 1 if blind else 0


if __name__ == "__main__":
    sys.exit(main())
