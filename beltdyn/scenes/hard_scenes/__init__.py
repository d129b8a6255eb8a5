"""Hard scenes: every way that is known to break this model, in runs of a second at most.

``bd.scenes.hard`` maps their names to :class:`HardScene`; each says what it provokes in an
integrator that is not made for it, and what must hold all the same (``hard.toml``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, partial
from typing import Any

from . import starts, theory
from .drives import made, tables
from .hard_scene import HardScene

__all__ = ["SCENES", "HardScene"]


@cache
def _rows() -> dict[str, dict[str, Any]]:
    """Return what is said of each scene, with its family."""
    families = {name: rows for name, rows in tables().items() if name not in ("holds", "like")}
    return {
        name: {"holds": tables()["holds"].get(row.get("theory")), "family": family, **row}
        for family, rows in families.items()
        for name, row in rows.items()
    }


class _Scenes(Mapping[str, HardScene]):
    """The scenes by name, each made when it is looked up."""

    def __getitem__(self, name: str) -> HardScene:
        row = _rows()[name]
        scene, start = HardScene(*made(row)), row.get("start")
        scene.name, scene.family = name, row["family"]
        scene.provokes, scene.holds = row["provokes"], row["holds"]
        scene.options, scene.expects = dict(row.get("options", {})), row.get("expects")
        moving = partial(starts.moving, **start) if isinstance(start, dict) else None
        scene._start = moving or (start and getattr(starts, start))
        scene._theory = getattr(theory, row["theory"]) if "theory" in row else None
        return scene

    def __iter__(self) -> Iterator[str]:
        return iter(_rows())

    def __len__(self) -> int:
        return len(_rows())

    def __contains__(self, name: object) -> bool:
        return name in _rows()

    def __repr__(self) -> str:
        return f"<{len(self)} hard scenes: {', '.join(self)}>"


SCENES: Mapping[str, HardScene] = _Scenes()
