"""Hard scenes: every way that is known to break this model, in runs of a second at most.

``bd.scenes.hard`` maps their names to :class:`HardScene`; each says what it provokes in an
integrator that is not made for it, and what must hold all the same. A module for each family.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from . import belts, contacts, jumps, laws, layouts, numerics, speeds, tensioners
from .hard_scene import Entry, HardScene

__all__ = ["SCENES", "HardScene"]

_FAMILIES = {
    "friction": laws,
    "belts": belts,
    "contacts": contacts,
    "loads": jumps,
    "tensioners": tensioners,
    "layouts": layouts,
    "speeds": speeds,
    "numerics": numerics,
}
_ENTRIES: dict[str, tuple[str, Entry]] = {
    name: (family, entry)
    for family, module in _FAMILIES.items()
    for name, entry in module.SCENES.items()
}


class _Scenes(Mapping[str, HardScene]):
    """The scenes by name, each made when it is looked up."""

    def __getitem__(self, name: str) -> HardScene:
        family, entry = _ENTRIES[name]
        return entry.scene(name, family)

    def __iter__(self) -> Iterator[str]:
        return iter(_ENTRIES)

    def __len__(self) -> int:
        return len(_ENTRIES)

    def __contains__(self, name: object) -> bool:
        return name in _ENTRIES

    def __repr__(self) -> str:
        return f"<{len(self)} hard scenes: {', '.join(self)}>"


SCENES: Mapping[str, HardScene] = _Scenes()
