"""How a belt was brought under preload before the run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias, cast

import attrs
import numpy as np
from numpy.typing import ArrayLike

from ..base import naming
from ..base.checks import integer, pair, shown
from .rules import Rule, from_table, with_choice

Pair: TypeAlias = tuple[float, float]
#: By index; or (pulley, offset), until the drive is known whose pulleys are named.
Offsets: TypeAlias = tuple[Pair, ...] | tuple[tuple[int | str, Pair], ...]


def _key(value: object) -> int | str:
    # The keys of a TOML table are texts; Python refuses to read very long numbers.
    if isinstance(value, str) and not value.isdecimal():
        return str(value)
    is_number = isinstance(value, str) and len(value) < 20
    number = int(str(value)) if is_number else value
    return integer("offset index", number, 0, 9999)


def _is_named(rows: Iterable[object]) -> bool:
    """Whether these are pairs of a pulley and its offset, some pulleys by name."""
    pairs = [row for row in rows if isinstance(row, tuple) and isinstance(row[-1], tuple)]
    return any(isinstance(row[0], str) for row in pairs)


def _offset(value: naming.ByPulley[Sequence[float]] | ArrayLike | None) -> Offsets:
    """Return one (dx, dy) for each pulley up to the last one that moves."""
    if value is None:
        return ()
    if isinstance(value, tuple) and _is_named(value):
        value = dict(value)
    if isinstance(value, Mapping):
        places: dict[Any, Any] = {_key(key): shift for key, shift in value.items()}
        if any(isinstance(key, str) for key in places):
            return tuple(
                (key, pair(f"offset[{key!r}]", shift, "m")) for key, shift in places.items()
            )
        rows: list[Any] = [
            places.get(index, (0.0, 0.0)) for index in range(max(places, default=-1) + 1)
        ]
    elif isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str):
        rows = list(value)
    else:
        raise TypeError(
            "offset must be a mapping {pulley: (dx, dy)} or one (dx, dy) per pulley, "
            f"got {shown(value)}"
        )
    return tuple(pair(f"offset[{index}]", row, "m") for index, row in enumerate(rows))


_RULES = (
    Rule("", "friction", "FLAG", "1", "whether friction acts"),
    Rule("", "move_time", "POSITIVE", "s", "duration of the motion from the offset"),
    Rule("", "shift", "FINITE", "m", "of all links along the belt line"),
)


@attrs.frozen(kw_only=True, field_transformer=from_table("", *_RULES))
class Tensioning:
    """How the belt was tensioned: what :func:`beltdyn.settle` does, the paper's stabilisation.

    The default lays the belt round the pulleys without friction, so its tension is the same
    everywhere. A real belt is tensioned with friction: laid round the pulleys at the strain of the
    belt line, or by moving a pulley, and the friction forces that build up then stay in the wraps.
    For a belt that is tensioned by moving pulley 1 outwards by 6 mm::

        params = attrs.evolve(
            params, tensioning=bd.Tensioning(friction=True, offset={1: (-0.006, 0.0)})
        )

    Attributes:
        friction: Whether friction acts; its state is then kept.
        pulleys: "held": the pulleys do not turn; "free": they may.
        offset: Where the pulley centres start, relative to their places: {pulley: (dx, dy)}, by
            index or name, or one (dx, dy) per pulley from pulley 0 on [m]; pulleys left out, None
            or (): in their places. Kept as a tuple of pairs, in which ``Params`` puts those that
            are named at their places.
        move_time: Duration of the motion from there [s]; None: chosen.
        shift: How far all links are moved along the belt line [m], at most the belt's length either
            way; unmoved, link 0 begins where the belt leaves pulley 0. Without friction the belt
            slides from there to one of the equilibria of its polygon all the same.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    friction: bool = False
    pulleys: str = attrs.field(default="held", validator=with_choice("pulleys", ("held", "free")))
    offset: Offsets = attrs.field(default=(), converter=_offset)
    move_time: float | None = None
    shift: float = 0.0

    def fitted(self, names: Sequence[str]) -> Tensioning:
        """Return a copy for a drive with these pulleys, with names replaced by indices.

        Raises:
            ValueError: There is no such pulley.
        """
        if _is_named(self.offset):
            named = cast(Any, dict(self.offset))
            fitted: Tensioning = attrs.evolve(self, offset=naming.by_index("offset", named, names))
            return fitted
        if len(self.offset) > len(names):
            raise ValueError(
                f"offset index must be that of one of the {len(names)} pulley(s), "
                f"got {len(self.offset) - 1}"
            )
        return self

    def beyond_cells(self) -> str:
        """Return the name of a field that an ALE belt cannot begin with, "" if there is none.

        It is laid at rest without friction, at once: there are no links to move.
        """
        moved = any(one not in (None, (0.0, 0.0)) for one in self.offset)
        asked = {"friction": self.friction, "offset": moved, "shift": self.shift != 0.0}
        return next((name for name, given in asked.items() if given), "")

    def __str__(self) -> str:
        return self.describe(())

    def describe(self, names: Sequence[str]) -> str:
        """Describe it with the names of the pulleys, as far as they are known."""
        places: Any = self.offset if _is_named(self.offset) else enumerate(self.offset)
        words = [
            "with friction" if self.friction else "without friction",
            "pulleys free to turn" if self.pulleys == "free" else "pulleys held",
        ]
        words += [
            f"{naming.label(key, names)} moved to its place from an offset of ({dx:g}, {dy:g}) m"
            for key, (dx, dy) in places
            if (dx, dy) != (0.0, 0.0)
        ]
        if self.shift:
            words.append(f"links moved along the belt line by {self.shift:g} m")
        return ", ".join(words)

    def _options(self, n_pulleys: int, has_friction: bool) -> dict[str, Any]:
        """Return what the core takes."""
        table = np.zeros((n_pulleys, 2))
        for index, shift in enumerate(cast("tuple[Pair, ...]", self.offset)):
            table[index] = shift
        return {
            "friction": self.friction and has_friction,
            "free_pulleys": self.pulleys == "free",
            "offset": table if table.any() else None,
            "move_time": self.move_time or 0.0,
            "shift": self.shift,
        }
