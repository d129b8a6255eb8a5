"""Compares two builds: does a change leave all results and texts as they were?

    python benchmarks/freeze.py BEFORE [AFTER] [--only TEXT] [--sizes]
    python benchmarks/freeze.py --quick

BEFORE and AFTER are commits; without AFTER it is the working tree. Each is built with the compiler
of this machine and kept under build/freeze/ by the content of its sources. `freeze_side.py` runs
both, side by side, on the drives of tests/drive_table.py and the built-in scenes, with every method
at every kernel level; compared to the last bit are arrays of results, counters, warnings, messages,
TOML, prints, reports and tables of sweeps. Prints what differs, by kind, each change of a text once
with the drives that have it; ends with 1 if anything does, or if no run was warned of by a code of
`beltdyn.RunWarning`. With --sizes it says how far apart trajectories are: the largest difference of
a joint's force over the mean tension. With --quick nothing is built: the package that is installed
is compared with itself, on one drive.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
BUILDS = ROOT / "build" / "freeze"
SIDE = ROOT / "benchmarks" / "freeze_side.py"
LEVELS = {"baseline": "", "avx2": "avx2", "avx512": "avx512vl"}
#: Lines shown of a change of a text, and names shown of what has it.
MAX_LINES, MAX_NAMES = 8, 6
#: The drive of --quick.
QUICK = "joint-dahl-arm-engine-crossed"


# --- builds ---------------------------------------------------------------------------------------


def git(*command: str) -> bytes:
    return subprocess.run(["git", *command], cwd=ROOT, check=True, capture_output=True).stdout


def sources(commit: str | None, folder: Path) -> None:
    """Put the sources of a commit, or of the working tree, into a folder."""
    if commit:
        subprocess.run(["tar", "x", "-C", str(folder)], input=git("archive", commit), check=True)
        return
    for file in git("ls-files", "-co", "--exclude-standard").decode().splitlines():
        if (ROOT / file).exists():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / file, folder / file)


def digest(folder: Path, *parts: str) -> str:
    """Of the content of the files in these parts of a folder."""
    found = hashlib.sha256()
    for part in parts:
        for path in sorted([folder / part, *(folder / part).rglob("*")]):
            if path.is_file():
                found.update(f"{path.relative_to(folder)} {path.stat().st_size}\n".encode())
                found.update(path.read_bytes())
    return found.hexdigest()[:16]


def build(commit: str | None) -> Path:
    """Where the package stands, built if need be; a core is kept for all packages that have it."""
    with tempfile.TemporaryDirectory(dir=BUILDS) as temporary:
        folder = Path(temporary)
        sources(commit, folder)
        core = BUILDS / f"core-{digest(folder, 'csrc', 'setup.py')}"
        site = BUILDS / f"site-{digest(folder, 'csrc', 'setup.py', 'beltdyn')}"
        if not core.exists():
            # Enough to build it with; what describes the project may be for newer tools.
            (folder / "pyproject.toml").write_text(
                '[project]\nname = "beltdyn"\nversion = "0"\n\n[tool.setuptools]\npackages = []\n'
            )
            command = [sys.executable, "setup.py", "-q", "build_ext", "--inplace", "-j2"]
            subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
            made = next((folder / "beltdyn").glob("_core*.so"))
            (folder / "made").mkdir()
            made.rename(folder / "made" / made.name)
            (folder / "made").rename(core)
        if not site.exists():
            shutil.copytree(folder / "beltdyn", folder / "site" / "beltdyn")
            shutil.copytree(core, folder / "site" / "beltdyn", dirs_exist_ok=True)
            (folder / "site").rename(site)
    return site


# --- two sides ------------------------------------------------------------------------------------


def levels() -> list[str]:
    """Those of this machine, the best one first."""
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return [level for level, needs in LEVELS.items() if needs in flags][::-1]


def look(site: Path | None, keep: Path, only: str) -> dict[str, dict[str, Any]]:
    """What a side tells: of every kind, a value for each name. Texts are of the best level."""
    told: dict[str, dict[str, Any]] = defaultdict(dict)
    for level in levels():
        out = keep / f"{level}.json"
        command = [sys.executable, str(SIDE), str(out), "texts" * (level == levels()[0]), only]
        environment = {**os.environ, "BELTDYN_KERNELS": level}
        environment |= {"PYTHONPATH": str(site)} if site else {}
        environment |= {"OPENBLAS_NUM_THREADS": "1", "COLUMNS": "80", "PYTHONHASHSEED": "0"}
        subprocess.run(command, cwd=keep, env=environment, check=True)
        for kind, values in json.loads(out.read_text("utf-8")).items():
            told[kind] |= values
    return told


def text_change(one: str | None, other: str | None) -> tuple[str, ...]:
    """The lines that differ."""
    if one is None or other is None:
        return ("only before",) if other is None else ("only after",)
    lines = difflib.unified_diff(one.splitlines(), other.splitlines(), n=0, lineterm="")
    return tuple(line for line in lines if not line.startswith(("---", "+++", "@@")))


def array_change(one: Any, other: Any) -> tuple[str, ...]:
    """The arrays that differ."""
    if one is None or other is None:
        return text_change(one and "", other and "")
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    same = len({**one, **other}) - len(names)
    return (f"differ: {', '.join(names)}" if same else "all arrays differ",)


def differences(one: Any, other: Any) -> Iterator[tuple[str, tuple[str, ...], list[str]]]:
    """Kind, change and the names that have it."""
    runs = [side.get("trajectory", {}) for side in (one, other)]
    apart = {name for name in {**runs[0], **runs[1]} if runs[0].get(name) != runs[1].get(name)}
    for kind in {**one, **other}:
        before, after = one.get(kind, {}), other.get(kind, {})
        found: dict[tuple[str, ...], list[str]] = defaultdict(list)
        for name in {**before, **after}:
            if before.get(name) == after.get(name):
                continue
            if kind == "counters" and name in apart:
                found[("as their trajectories do",)].append(name)
                continue
            change = array_change if kind == "trajectory" else text_change
            found[change(before.get(name), after.get(name))].append(name)
        for change, names in found.items():
            yield kind, change, names


def size(folders: tuple[Path, Path], name: str) -> str:
    """Of the largest difference between two runs of a name, "drive method at level"."""
    key, _, level = name.rpartition(" at ")
    kept = [np.load(folder / f"{level}.npz") for folder in folders]
    if any(key not in one for one in kept):
        return "no forces to compare"
    one, two = (kept_one[key] for kept_one in kept)
    if one.shape != two.shape:
        return "ends elsewhere"
    return f"{np.max(np.abs(one - two)) / abs(np.mean(one)):.2g} of the tension"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("before", nargs="?")
    parser.add_argument("after", nargs="?")
    parser.add_argument("--only", default="", metavar="TEXT", help="drives with TEXT in their name")
    parser.add_argument("--sizes", action="store_true", help="say how large differences are")
    parser.add_argument("--quick", action="store_true", help="this package twice, on one drive")
    options = parser.parse_args()
    if options.quick == bool(options.before):
        parser.error("give a commit, or --quick")
    begun = time.monotonic()
    BUILDS.mkdir(parents=True, exist_ok=True)
    if options.quick:
        sites, options.only = (None, None), QUICK
    else:
        sites = tuple(build(commit) for commit in (options.before, options.after))
        same = ", sources identical" * (len({*sites}) < 2)
        print(f"built in {time.monotonic() - begun:.0f} s{same}")
    with tempfile.TemporaryDirectory(dir=BUILDS) as temporary:
        folders = (Path(temporary) / "before", Path(temporary) / "after")
        for folder in folders:
            folder.mkdir()
        with ThreadPoolExecutor(2) as pool:
            one, other = pool.map(look, sites, folders, [options.only] * 2)
        apart: dict[str, int] = defaultdict(int)
        for kind, change, names in differences(one, other):
            apart[kind] += len(names)
            more = f" and {len(names) - MAX_NAMES} more" * (len(names) > MAX_NAMES)
            print(f"{kind} of {', '.join(names[:MAX_NAMES])}{more}")
            lines = [*change[:MAX_LINES], *["..."] * (len(change) > MAX_LINES)]
            print("".join(f"    {line}\n" for line in lines), end="")
            for name in names if options.sizes and kind == "trajectory" else ():
                print(f"    {name}: {size(folders, name)}")
    silent = sorted({**one["codes never warned of"], **other["codes never warned of"]})
    if silent:
        print(f"no run was warned of by {', '.join(silent)}: see warned() in {SIDE.name}")
    counts = [f"{kind} {apart[kind]}/{len({**one[kind], **other[kind]})}" for kind in one]
    print(f"differing: {', '.join(counts)}; {time.monotonic() - begun:.0f} s")
    return int(any(apart.values()) or bool(silent))


if __name__ == "__main__":
    sys.exit(main())
