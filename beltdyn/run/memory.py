"""Available memory, checked before large arrays are made: Linux would grant them and kill later."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from .. import _core

_LEDGER_COPIES = 12  #: Temporary columns, each as long as the times, for building a ledger.
#: Part of what was available a moment ago below which what is needed is little.
_LITTLE = 0.01
_V1, _V2 = Path("/sys/fs/cgroup/memory"), Path("/sys/fs/cgroup")


def available() -> int | None:
    """Return the memory that this process can still get [byte]; None if it is not known."""
    known = [size for size in (_of_machine(), _of_group()) if size is not None]
    return min(known) if known else None


def check_samples(n_t: int, sizes: Mapping[str, int], names: Collection[str], ledger: bool) -> int:
    """Return the memory that outputs need [byte], if there is as much, or it is little."""
    columns = sizes["ENERGY"] + _LEDGER_COPIES if ledger else 0
    widths = {**sizes, "PLANE": 2 * sizes["PLANE"], "ENERGY": columns}
    bytes_of = {name: 8 * widths[size] for name, _group, size, *_ in _core.OUTPUTS}
    bytes_of |= {"pulley": 4 * sizes["CONTACT"], "span_tension": 8 * sizes["PULLEYS"], "across": 8}
    row = sum(bytes_of[name] for name in names)
    needed = n_t * row
    there = _lately(available, int(time.monotonic()))
    if there is None or needed > _LITTLE * there:
        there = available()
    if there is not None and needed > there:
        raise no_room(n_t, needed, f"and {_bytes(there)} are available")
    return needed


@lru_cache(maxsize=1)
def _lately(tell: Callable[[], int | None], _second: int) -> int | None:
    """Return what was available within this second: asking takes as long as a short run."""
    return tell()


def no_room(n_t: int, needed: int, why: str) -> MemoryError:
    """Make the error of samples that need more memory than there is."""
    return MemoryError(
        f"t_eval is too long for the memory: the {n_t} samples need {_bytes(needed)}, {why}; "
        "take fewer times, or run in parts, each from the final_state of the one before"
    )


def _bytes(size: int) -> str:
    return f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"


def _of_machine() -> int | None:
    with suppress(OSError, ValueError):
        sizes = {}
        for line in Path("/proc/meminfo").read_text().splitlines():
            name, _, value = line.partition(":")
            sizes[name] = int(value.split()[0]) * 1024
        if "MemAvailable" in sizes:
            return sizes["MemAvailable"] + sizes.get("SwapFree", 0)
    with suppress(OSError, ValueError, AttributeError):  # no sysconf, or not these names
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def _of_group() -> int | None:
    """Return the memory left by the control groups (container, batch job), the least of them."""
    left = []
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers == "":
                left += _left(_V2, path, "memory.max", "memory.current")
            elif "memory" in controllers.split(","):
                left += _left(_V1, path, "memory.limit_in_bytes", "memory.usage_in_bytes")
    return min(left, default=None)


def _left(root: Path, path: str, limit: str, usage: str) -> list[int]:
    """List the memory left by each group up to the root; in a container some are hidden."""
    folder, left = root / path.lstrip("/"), []
    while True:
        with suppress(OSError, ValueError):  # "max" is no number: no limit
            most = int((folder / limit).read_text())
            used = int((folder / usage).read_text())
            left.append(max(most - used + _reclaimable(folder), 0))
        if folder == root or root not in folder.parents:
            return left
        folder = folder.parent


def _reclaimable(folder: Path) -> int:
    """Return the size of the group's file cache: counted as used, but freed when needed."""
    with suppress(OSError, ValueError):
        rows = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return sum(int(rows.get(name, 0)) for name in ("active_file", "inactive_file"))
    return 0
