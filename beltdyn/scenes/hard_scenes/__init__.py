"""Hard scenes: every way that is known to break this model, in runs of a second at most.

``bd.scenes.hard`` maps their names to :class:`HardScene`; each says what it provokes in an
integrator that is not made for it, and what must hold all the same (``hard.toml``). A module for
each family makes their drives.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from ...drive.scene import Scene
from ...outputs.state import State
from . import belts, contacts, jumps, laws, layouts, numerics, speeds, tensioners, theory
from .hard_scene import HardScene

__all__ = ["SCENES", "HardScene"]

_MAKE: dict[str, Callable[[], Scene]] = {
    name: make
    for family in (laws, belts, contacts, jumps, tensioners, layouts, speeds, numerics)
    for name, make in family.MAKE.items()
}
_START: dict[str, Callable[[HardScene], State]] = contacts.START | speeds.START | numerics.START


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
        scene, row = HardScene(*_MAKE[name]()), _told()[name]
        scene.name, scene.family = name, row["family"]
        scene.provokes, scene.holds = row["provokes"], row["holds"]
        scene.options, scene.expects = dict(row.get("options", {})), row.get("expects")
        scene._start = _START.get(name)
        scene._theory = getattr(theory, row["theory"]) if "theory" in row else None
        return scene

    def __iter__(self) -> Iterator[str]:
        return iter(_MAKE)

    def __len__(self) -> int:
        return len(_MAKE)

    def __contains__(self, name: object) -> bool:
        return name in _MAKE

    def __repr__(self) -> str:
        return f"<{len(self)} hard scenes: {', '.join(self)}>"


SCENES: Mapping[str, HardScene] = _Scenes()
