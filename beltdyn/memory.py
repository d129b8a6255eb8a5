"""How much memory there is, asked before much of it is taken: Linux grants more and kills later."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from . import _core

__all__ = ["available", "check_samples", "no_room"]

_LEDGER_COPIES = 12  #: Columns like the times that building an energy ledger takes besides.
_V1, _V2 = Path("/sys/fs/cgroup/memory"), Path("/sys/fs/cgroup")


def available() -> int | None:
    """Give the memory that this process can still get [byte]; None if the system does not tell."""
    known = [size for size in (_of_machine(), _of_group()) if size is not None]
    return min(known) if known else None


def check_samples(n_t: int, n_bodies: int, n_pulleys: int, ledger: bool) -> int:
    """Give the memory that the samples of a run need [byte], if there is as much.

    Raises:
        MemoryError: There is not; the message says what they take, what there is, what to try.
    """
    widths = {
        "LINKS": n_bodies,
        "PULLEYS": n_pulleys,
        "ENERGY": len(_core.ENERGY_TERMS) + _LEDGER_COPIES if ledger else 0,
    }
    row = sum(8 * widths[size] for _name, _group, size, *_ in _core.OUTPUTS) + 4 * n_bodies
    needed, there = n_t * row, available()
    if there is not None and needed > there:
        raise no_room(n_t, needed, f"and {_bytes(there)} are available")
    return needed


def no_room(n_t: int, needed: int, why: str) -> MemoryError:
    """Give the error of samples that need more than can be had."""
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
    """Give what the tightest control group (a container, a batch job) leaves."""
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
    """Give what each group from this one up to the root leaves; in a container some are hidden."""
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
    """Give what the group's files in memory take: counted as used, given back when needed."""
    with suppress(OSError, ValueError):
        rows = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return sum(int(rows.get(name, 0)) for name in ("active_file", "inactive_file"))
    return 0
