"""Plant the faults of `faults.toml` one by one and name the test that finds each.

    python tests/faults/run.py [NAME...] [--left] [--tests DIR] [--note TEXT]
                               [--hints-only | --all-default | --build]

Each edit goes into a copy of its own of the package under `build/faults/`; the tests import that.
The tests that the fault names as hints run first, then the rest of the default tier, then the
others. What found a fault goes into `found.tsv`. The exit code is 1 if a fault was found by nothing
or by the extended tier alone, 2 if an edit does not apply or does not compile.
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from planting import HERE, ROOT, Fault, FaultError, core, faults, package

FOUND = HERE / "found.tsv"
COLUMNS = ("fault", "when", "tests", "tier", "found by", "seconds")
ENDED = " (ended the process)"
# Seconds. A test that takes longer hangs because of the fault: the slowest of the default tier
# takes a tenth of it.
TEST_LIMIT, HINT_LIMIT, TIER_LIMIT = 200, 600, 3600
TIERS = dict(default="not ci and not extended", ci="ci and not extended", extended="extended")
OLD_TIERS = {"default": "not slow", "slow": "slow"}  # of checkouts without tests/tiers.py


def failing(
    tests: Path, where: Path, marks: str, chosen: list[str], limit: float, *options: str
) -> list[str]:
    """Return the tests that fail with the package in a folder, as paths from the tests' folder."""
    witness = where / "witness.tsv"
    witness.unlink(missing_ok=True)
    environment = dict(
        os.environ,
        PYTHONPATH=os.pathsep.join([str(where), str(HERE)]),
        PYTHONDONTWRITEBYTECODE="1",
        PYTHONSAFEPATH="1",  # what a test starts, too, takes no package from the current folder
        BELTDYN_WITNESS=str(witness),
    )
    command = [sys.executable, "-P", "-m", "pytest", "-n", "0", "-q", "--tb=no"]
    command += ["-p", "faults_witness", "-p", "no:cacheprovider", "-o", f"timeout={TEST_LIMIT}"]
    command += ["-m", marks, *(str(tests / one) for one in chosen), *options]
    with (where / "output.txt").open("w") as output:
        try:
            to = {"stdout": output, "stderr": subprocess.STDOUT, "env": environment}
            code = subprocess.run(command, cwd=tests.parent, timeout=limit, **to).returncode
        except subprocess.TimeoutExpired:
            print(f"    not done within {limit:g} s: {' '.join(chosen)}", flush=True)
            return []
    lines = witness.read_text("utf-8").splitlines() if witness.exists() else []
    words = [line.replace("\ttests/", "\t").split("\t") for line in lines]
    failed = [test for word, test in words if word == "failed"]
    if failed or code in (0, 5):
        return failed
    if code == 4 and not words:
        print(f"    no such test: {' '.join(chosen)}", flush=True)
        return []
    return [(words[-1][1] if words else f"pytest, exit code {code}") + ENDED]


def found(fault: Fault, tests: Path, options: argparse.Namespace) -> tuple[str, str]:
    """Return the tier and the test that finds a fault."""
    where = package(fault)
    is_old = not (tests / "tiers.py").exists()
    tiers = OLD_TIERS if is_old else TIERS
    hints = fault.tests_before if is_old and fault.tests_before else fault.tests
    tried = []
    if not options.all_default:
        tried = [(tier, hint, HINT_LIMIT) for tier in tiers for hint in hints]
    if options.all_default or not options.hints_only:
        tried += [(tier, ".", TIER_LIMIT) for tier in tiers]
    for tier, hint, limit in tried:
        chosen, *others = shlex.split(hint)
        if failed := failing(tests, where, tiers[tier], [chosen], limit, "-x", *others):
            return tier, failed[0]
    return "-", "not its hints" if options.hints_only else "nothing"


def fails_anyway(tests: Path, finders: Iterable[str]) -> set[str]:
    """Return which of the tests that found faults fail without them."""
    nodes = sorted({test.removesuffix(ENDED) for test in finders if ".py" in test})
    if not nodes:
        return set()
    print(f"{len(nodes)} tests without a fault", flush=True)
    return set(failing(tests, package(None), "", nodes, TIER_LIMIT))


def recorded() -> dict[tuple[str, str], str]:
    """Return the lines of found.tsv by fault and time."""
    lines = FOUND.read_text("utf-8").splitlines()[1:] if FOUND.exists() else []
    return {(line.split("\t")[0], line.split("\t")[1]): line for line in lines}


def is_found(name: str, when: str) -> bool:
    line = recorded().get((name, when))
    return line is not None and line.split("\t")[3] != "-"


def record(name: str, row: tuple[str, ...], listed: list[Fault]) -> None:
    """Put a row into found.tsv, in place of the one of the same fault and time."""
    order = [fault.name for fault in listed]
    rows = recorded()
    rows[name, row[0]] = "\t".join([name, *row])
    known = [key for key in rows if key[0] in order]
    kept = [rows[key] for key in sorted(known, key=lambda k: (k[1], order.index(k[0])))]
    FOUND.write_text("\n".join(["\t".join(COLUMNS), *kept, ""]), "utf-8")


def commit_of(tests: Path) -> str:
    """Return the last commit that changed the tests, with a plus if they have been changed since.

    What lies in the folder of the faults is none of them.
    """

    def git(*words: str) -> str:
        command = ["git", "-C", str(tests), *words]
        return subprocess.run(command, capture_output=True, text=True).stdout.strip()

    paths = ("--", ".", ":!faults")
    changed = bool(git("status", "-s", "-uno", *paths))
    return git("log", "-1", "--format=%h", *paths) + "+" * changed


def main() -> int:
    parser = argparse.ArgumentParser(description="Plant faults and name the tests that find them.")
    parser.add_argument("names", nargs="*", help="of the faults; all by default")
    parser.add_argument("--tests", type=Path, default=ROOT / "tests", help="of which checkout")
    parser.add_argument("--note", help="what the column `when` says, instead of the commit")
    parser.add_argument("--left", action="store_true", help="only those not found so far")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--hints-only", action="store_true", help="run no more than the hints")
    what.add_argument("--all-default", action="store_true", help="whole tiers, without hints")
    what.add_argument("--build", action="store_true", help="build, and run nothing")
    options = parser.parse_args()
    tests = options.tests.resolve()
    if not (tests / "conftest.py").exists():
        parser.error(f"--tests: {tests} is no folder of tests")
    needed = ("numpy", "pytest", "xdist", "pytest_timeout")
    if missing := [name for name in needed if find_spec(name) is None]:
        parser.error(f"{sys.executable} has no {', '.join(missing)}: install beltdyn[test] in it")
    if options.note and not options.note.isprintable():  # a tab would be a column of found.tsv
        parser.error("--note must be a line of text without tabs")
    os.chdir(ROOT)  # setup.py looks for its sources here
    try:
        listed = faults()
        for fault in listed:
            fault.planted()
        if unknown := set(options.names) - {fault.name for fault in listed}:
            raise FaultError(f"no fault is called {', '.join(sorted(unknown))}")
        commit = commit_of(tests)
        rows = {}
        for fault in listed:
            if options.names and fault.name not in options.names:
                continue
            if options.left and is_found(fault.name, options.note or commit):
                continue
            began = time.monotonic()
            if options.build:
                core(fault)
                print(f"{fault.name}: {time.monotonic() - began:.0f} s", flush=True)
                continue
            tier, test = found(fault, tests, options)
            seconds = f"{time.monotonic() - began:.0f}"
            print(f"{fault.name}: {tier}: {test} ({seconds} s)", flush=True)
            rows[fault.name] = (options.note or commit, commit, tier, test, seconds)
            record(fault.name, rows[fault.name], listed)
        anyway = fails_anyway(tests, (row[3] for row in rows.values() if row[2] != "-"))
        for name, (when, at, tier, test, seconds) in rows.items():
            if tier != "-" and test in anyway:
                print(f"{name}: {test} fails without the fault as well", flush=True)
                rows[name] = (when, at, "-", f"{test} fails without the fault", seconds)
                record(name, rows[name], listed)
    except FaultError as error:
        print(error, file=sys.stderr)
        return 2
    return 1 if any(row[2] in ("-", "extended") for row in rows.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
