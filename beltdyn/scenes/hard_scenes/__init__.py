"""Hard scenes: every way that is known to break this model, in runs of a second at most.

``bd.scenes.hard`` maps their names to :class:`HardScene`; each says what it provokes in an
integrator that is not made for it, and what must hold all the same (``hard.toml``).
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from . import theory
from .families import MAKE, START
from .hard_scene import HardScene

__all__ = ["SCENES", "HardScene"]


@cache
def _told() -> dict[str, dict[str, Any]]:
    """Read what is said of each scene, with its family."""
    families = tomllib.loads(Path(__file__).with_name("hard.toml").read_text(encoding="utf-8"))
    usual = families.pop("holds")
    return {
        name: {"holds": usual.get(row.get("theory")), "family": family, **row}
        for family, rows in families.items()
        for name, row in rows.items()
    }


class _Scenes(Mapping[str, HardScene]):
    """The scenes by name, each made when it is looked up."""

    def __getitem__(self, name: str) -> HardScene:
        scene, row = HardScene(*MAKE[name]()), _told()[name]
        scene.name, scene.family = name, row["family"]
        scene.provokes, scene.holds = row["provokes"], row["holds"]
        scene.options, scene.expects = dict(row.get("options", {})), row.get("expects")
        scene._start = START.get(name)
        scene._theory = getattr(theory, row["theory"]) if "theory" in row else None
        return scene

    def __iter__(self) -> Iterator[str]:
        return iter(MAKE)

    def __len__(self) -> int:
        return len(MAKE)

    def __contains__(self, name: object) -> bool:
        return name in MAKE

    def __repr__(self) -> str:
        return f"<{len(self)} hard scenes: {', '.join(self)}>"


SCENES: Mapping[str, HardScene] = _Scenes()
