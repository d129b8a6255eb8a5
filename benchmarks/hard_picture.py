"""The pictures of `hard.py`: scenes by methods, on the belt of each scene, and on other belts.

Colours are those of Okabe and Ito, which the colour-blind tell apart; what must not happen has a
mark besides, so that a print without colours shows it too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

Record = dict[str, Any]
Records = Mapping[tuple[str, str, str], Record]
#: The record of a scene by a method, if there is one.
Lookup = Callable[[str, str], Record | None]

#: Colour of a cell, mark in it, and what it means in plain words. Notebook 15 has the same.
LOOK = {
    "solved": ("#009E73", "", "solved: theory and invariants hold; error, where a reference exists,"
               " at most 5 times the claim (or it ends in the error it must)"),
    "said": ("#56B4E9", "w", "finished, and warns that it may be off"),
    "refused": ("#E69F00", "r", "stopped by an error that says why"),
    "budget": ("#F0E442", "b", "not done within its budget of steps or CPU time"),
    "unjudged": ("#BBBBBB", "?", "finished soundly, but nothing to compare with"),
    "quiet": ("#D55E00", "!", "WRONG without a word (must not happen)"),
    "broken": ("#000000", "X", "BROKEN: crash or NaN (must not happen)"),
}  # fmt: skip
NOT_RUN = ("#F2F2F2", "", "not run, or no such belt")
METHODS = {
    "auto": "auto (default)",
    "tsit5": "tsit5, explicit",
    "rk4": "rk4, explicit",
    "rodas4": "rodas4, implicit",
    "lbdf2": "lbdf2, implicit",
    "lie": "lie, implicit",
}
BELTS = {"joint": "belt of links", "string": "belt of point masses", "paper": "the paper's belt"}
#: Height of a row and of a gap between families, widths of a cell and of the names [inches].
ROW, GAP, CELL, NAMES = 0.14, 0.09, 0.25, 2.45
#: Height of the names of methods and belts, of a line of the legend.
HEADS, LINE = 0.95, 0.15


class Sheet:
    """A page to draw on, in inches from its upper left corner."""

    def __init__(self, wide: float, tall: float, title: str, kinds: Iterable[str]) -> None:
        import matplotlib as mpl

        mpl.use("Agg")
        import matplotlib.pyplot as plt

        self.figure = plt.figure(figsize=(wide, tall), dpi=200)
        self.axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set(xlim=(0.0, wide), ylim=(tall, 0.0))
        self.axes.axis("off")
        self.text(0.15, 0.22, title, size=11, bold=True, ha="left")
        looks = [NOT_RUN if kind == "not run" else LOOK[kind] for kind in kinds]
        for k, (colour, mark, text) in enumerate(looks):
            y = 0.42 + k * LINE
            self.cell(0.15, y, colour, mark)
            self.text(0.15 + CELL + 0.07, y + 0.5 * ROW, text, size=6.5, ha="left")

    def text(self, x: float, y: float, text: str, size: float = 6.0, bold: bool = False,
             ha: str = "right", **more: Any) -> None:  # fmt: skip
        weight = "bold" if bold else "normal"
        more = {"va": "center", "fontweight": weight} | more
        self.axes.text(x, y, text, ha=ha, fontsize=size, **more)

    def cell(self, x: float, y: float, colour: str, mark: str) -> None:
        from matplotlib.patches import Rectangle

        self.axes.add_patch(Rectangle((x, y), CELL, ROW, facecolor=colour, edgecolor="w", lw=0.5))
        dark = mark in ("!", "X")
        self.text(x + 0.5 * CELL, y + 0.54 * ROW, mark, size=5.5, bold=dark, ha="center",
                  color="w" if dark else "k")  # fmt: skip

    def names(self, x: float, y: float, rows: Sequence[str], family: Mapping[str, str]) -> Any:
        """Write them left of x with their families; give the place of each row and their end."""
        places: dict[str, float] = {}
        for group in dict.fromkeys(family[name] for name in rows):
            of = [name for name in rows if family[name] == group]
            bar, high = x - NAMES + 0.75, len(of) * ROW
            self.axes.plot([bar, bar], [y + 0.02, y + high - 0.02], color="0.4", lw=1.0)
            self.text(bar - 0.06, y + 0.5 * high, group, size=7, bold=True)
            for name in of:
                self.text(x - 0.08, y + 0.52 * ROW, name)
                places[name] = y
                y += ROW
            y += GAP
        return places, y

    def block(self, x: float, y: float, places: Mapping[str, float], record: Lookup,
              title: str = "") -> None:  # fmt: skip
        """Draw the cells right of x, the methods above y."""
        self.text(x + 0.5 * len(METHODS) * CELL, y - HEADS + 0.05, title, size=8, bold=True,
                  ha="center")  # fmt: skip
        for m, (method, text) in enumerate(METHODS.items()):
            left = x + m * CELL
            self.text(left + 0.5 * CELL, y - 0.04, text, rotation=50, ha="left", va="bottom",
                      rotation_mode="anchor")  # fmt: skip
            for name, at in places.items():
                found = record(name, method)
                self.cell(left, at, *(NOT_RUN if found is None else LOOK[found["kind"]])[:2])

    def shares(self, x: float, y: float, rows: Sequence[str], record: Lookup) -> None:
        """Write under the block which share of its runs is solved, by method."""
        for m, method in enumerate(METHODS):
            of = [found for name in rows if (found := record(name, method)) is not None]
            if of:
                solved = sum(found["kind"] == "solved" for found in of) / len(of)
                self.text(x + (m + 0.5) * CELL, y, f"{solved:.0%}", size=5.5, ha="center")


def kinds_of(records: Iterable[Record]) -> list[str]:
    """Those that occur, in the order of LOOK."""
    shown = {record["kind"] for record in records}
    return [kind for kind in LOOK if kind in shown]


def draw(records: Records, names: Sequence[str]) -> Any:
    """Every scene on its own belt, a cell for each method, in two columns."""
    own = {(r["scene"], r["method"]): r for r in records.values() if r["own"]}
    family = {name: r["family"] for (name, _), r in own.items()}
    rows = [name for name in names if name in family]
    groups = list(dict.fromkeys(family[name] for name in rows))

    def part(*of: str) -> list[str]:
        return [name for name in rows if family[name] in of]

    cuts = range(1, len(groups) + 1)
    cut = min(cuts, key=lambda k: max(len(part(*groups[:k])), len(part(*groups[k:]))))
    columns = [one for one in (part(*groups[:cut]), part(*groups[cut:])) if one]
    kinds = kinds_of(own.values())
    top, column = 0.45 + len(kinds) * LINE + HEADS, NAMES + len(METHODS) * CELL
    tall = max(len(one) * ROW + GAP * len({family[n] for n in one}) for one in columns)
    sheet = Sheet(
        0.1 + column * len(columns) + 0.5, top + tall + 0.3,
        "Drives made to break an integrator: how each run ends", kinds,
    )  # fmt: skip

    def record(name: str, method: str) -> Record | None:
        return own.get((name, method))

    x, ends = NAMES, []
    for one in columns:
        places, end = sheet.names(x, top, one, family)
        sheet.block(x, top, places, record)
        ends.append((end, x))
        x += column + 0.1
    end, x = min(ends)
    sheet.text(x - 0.08, end + 0.1, f"solved, of all {len(rows)} scenes", bold=True)
    sheet.shares(x, end + 0.1, rows, record)
    return sheet.figure


def draw_belts(records: Records, names: Sequence[str]) -> Any:
    """Scenes that were run on another belt than theirs, a block of columns for each belt."""
    family = {r["scene"]: r["family"] for r in records.values() if not r["own"]}
    rows = [name for name in names if name in family]
    shown = [r for r in records.values() if r["scene"] in family]
    belts = [belt for belt in BELTS if any(r["belt"] == belt for r in shown)]
    kinds = [*kinds_of(shown), "not run"]
    top, block = 0.45 + len(kinds) * LINE + HEADS + 0.1, (len(METHODS) + 0.6) * CELL
    tall = len(rows) * ROW + GAP * len(set(family.values()))
    sheet = Sheet(
        0.1 + NAMES + len(belts) * block + 0.4, top + tall + 0.3,
        "The same drives on other belts", kinds,
    )  # fmt: skip
    places, end = sheet.names(NAMES, top, rows, family)
    sheet.text(NAMES - 0.08, end + 0.1, "solved, of the runs", bold=True)
    for k, belt in enumerate(belts):
        x = NAMES + k * block

        def record(name: str, method: str, belt: str = belt) -> Record | None:
            return records.get((name, belt, method))

        sheet.block(x, top, places, record, BELTS[belt])
        sheet.shares(x, end + 0.1, rows, record)
    return sheet.figure
