"""The quantities of a run over time: each a row, of what is in it, its unit, meaning and sign.

Rows come from ``csrc/fields.h``; here stand those that Python computes and what axes of figures
call a quantity. Histories, files, labelled arrays, tables and figures read them.
"""

from __future__ import annotations

from typing import NamedTuple

from .. import _core

#: Mean tensions of spans, computed from joints and contact; the ledger, which is one output.
SPANS, LEDGER = "span_tension", "energy"


class Quantity(NamedTuple):
    """A row of the table.

    ``size``: of what it has a value, as the core's tables name it; "": one number.
    ``short``: what an axis calls it; ``sign``: which sense counts as positive, "" where the text
    says it or there is none.
    """

    name: str
    size: str
    unit: str
    text: str
    short: str
    sign: str = ""

    @property
    def group(self) -> str:
        """Name of its group, "" of one that stands alone."""
        return self.name.rpartition(".")[0]

    @property
    def field(self) -> str:
        """Name in its group."""
        return self.name.rpartition(".")[2]

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Dimensions after time."""
        return dimensions(self.size)

    @property
    def meaning(self) -> str:
        """What it is, and in which sense it counts."""
        return f"{self.text}, {self.sign}" if self.sign else self.text

    def axis(self, unit: str = "", short: str = "") -> str:
        """Return the label of an axis, in another unit or with other words if need be."""
        return f"{short or self.short} [{unit or self.unit}]"


#: Dimensions by size, where there are any.
_DIMENSIONS = {
    "PULLEYS": ("pulley",),
    "PLANE": ("pulley", "xy"),
    "LINKS": ("link",),
    "NODES": ("link",),
    "MODES": ("span", "mode"),
    "JOINTS": ("joint",),
    "CONTACT": ("link",),
    "FRICTION": ("link",),
    "SLIPS": ("link",),
    "MOUNTS": ("mount",),
    "COUPLINGS": ("coupling",),
    "SPANS": ("span",),
}
#: What Python makes of the core's: name, size, unit, text.
_DERIVED = (
    ("contact.pulley", "CONTACT", "1", "index of the pulley that a link touches, -1: none"),
    (
        "belt.passed",
        "FLOW",
        "m",
        "stress-free belt that has passed pulley 0 since the first sample",
    ),
    ("energy.passed", "", "J", "energy transmitted so far, the scale of the residual"),
    (SPANS, "SPANS", "N", "mean joint force of the free span that follows each pulley"),
)
#: On axes, where that is not the text up to a comma or semicolon; and the sense that is positive.
_SHORT = {
    "pulleys.torque": "set torque",
    "joints.deformation": "joint deformation",
    "joints.force": "joint force",
    "contact.normal": "normal force",
    "contact.slip": "slip displacement",
    "contact.velocity": "relative velocity",
    SPANS: "span tension",
}
_SIGNS = {
    "pulleys.omega": "counter-clockwise",
    "contact.velocity": "counter-clockwise",
    "couplings.rim_angle": "counter-clockwise",
    "couplings.rim_speed": "counter-clockwise",
    "couplings.transmitted": "counter-clockwise",
    **dict.fromkeys(
        (f"mounts.{one}_force" for one in ("spring", "damper", "friction", "stop", "belt")),
        "in the sense of the travel",
    ),
}


def dimensions(size: str) -> tuple[str, ...]:
    """Return the dimensions after time of a history of this size."""
    return _DIMENSIONS.get(size, ())


def _row(name: str, size: str, unit: str, text: str) -> Quantity:
    short = _SHORT.get(name, text.partition(",")[0].partition(";")[0])
    return Quantity(name, size, unit, text, short, _SIGNS.get(name, ""))


#: All of them by name, "pulleys.omega"; outputs of the core first, in its order.
QUANTITIES: dict[str, Quantity] = {
    row[0]: _row(*row)
    for row in (
        *(
            (f"{group}.{name}", size, unit, text)
            for name, group, size, unit, text in _core.OUTPUTS
            if group != LEDGER
        ),
        *((f"{LEDGER}.{name}", "", "J", text) for name, _, text in _core.ENERGY_TERMS),
        *_DERIVED,
    )
}
TIME = Quantity("time", "", "s", "time", "time")
