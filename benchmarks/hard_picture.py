"""The picture of `hard.py`: scenes by methods, side by side for each belt model.

Colours are those of Okabe and Ito, which the colour-blind tell apart; what must not happen has a
mark besides, so that a print without colours shows it too.
"""

from __future__ import annotations

import collections
from collections.abc import Mapping, Sequence
from typing import Any

Record = dict[str, Any]

#: Colour of a cell, mark in it, and what it means in plain words.
LOOK = {
    "solved": ("#009E73", "", "solved: right within the error it claims"),
    "said": ("#56B4E9", "w", "finished, and warns that it may be off"),
    "refused": ("#F0E442", "r", "stopped with an error that says why"),
    "budget": ("#E69F00", "b", "gave up: would take too long"),
    "unjudged": ("#BBBBBB", "?", "finished, but nothing to compare with"),
    "quiet": ("#D55E00", "!", "WRONG without a word (must not happen)"),
    "broken": ("#000000", "X", "BROKEN: crash or NaN (must not happen)"),
}
METHODS = {
    "auto": "auto (default)",
    "tsit5": "tsit5, explicit",
    "rk4": "rk4, explicit",
    "rodas4": "rodas4, implicit",
    "lbdf2": "lbdf2, implicit",
    "lie": "lie, implicit",
}
BELTS = {"joint": "belt of links", "string": "belt of point masses", "paper": "the paper's belt"}
#: Height of a row and of a gap between families, width of a cell [inches]: 75 rows on A4.
ROW, GAP, CELL = 0.125, 0.09, 0.235


def draw(records: Mapping[tuple[str, str, str], Record], names: Sequence[str]) -> Any:
    """A row for each scene, a block of columns for each belt, a cell for each method."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Patch, Rectangle

    belts = [b for b in BELTS if any(key[1] == b for key in records)]
    family = {key[0]: r["family"] for key, r in records.items()}
    rows = [name for name in names if name in family]
    sizes = collections.Counter(family[name] for name in rows)
    top, bottom, left, right = 1.25, 0.95, 2.55, 0.15
    tall = len(rows) * ROW + len(sizes) * GAP
    block = (len(METHODS) + 0.6) * CELL
    wide = left + len(belts) * block + right
    figure = plt.figure(figsize=(wide, top + tall + bottom), dpi=200)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, wide), ylim=(top + tall + bottom, 0.0))  # inches, downwards
    axes.axis("off")

    y, last = top, ""
    for name in rows:
        if family[name] != last:
            y += GAP if last else 0.0
            last = family[name]
            high = sizes[last] * ROW
            axes.plot([0.72, 0.72], [y + 0.02, y + high - 0.02], color="0.4", lw=1.0)
            axes.text(0.66, y + 0.5 * high, last, ha="right", va="center", fontsize=7,
                      fontweight="bold")  # fmt: skip
        axes.text(left - 0.08, y + 0.52 * ROW, name, ha="right", va="center", fontsize=6)
        for k, belt in enumerate(belts):
            for m, method in enumerate(METHODS):
                record = records.get((name, belt, method))
                x = left + k * block + m * CELL
                if record is None:
                    continue
                colour, mark, _ = LOOK[record["kind"]]
                axes.add_patch(
                    Rectangle((x, y), CELL, ROW, facecolor=colour, edgecolor="w", lw=0.5)
                )
                dark = record["kind"] in ("quiet", "broken")
                axes.text(x + 0.5 * CELL, y + 0.54 * ROW, mark, ha="center", va="center",
                          fontsize=5.5, color="w" if dark else "k",
                          fontweight="bold" if dark else "normal")  # fmt: skip
        y += ROW
    for k, belt in enumerate(belts):
        x = left + k * block
        axes.text(x + 0.5 * len(METHODS) * CELL, 0.50, BELTS[belt], ha="center", va="bottom",
                  fontsize=8, fontweight="bold")  # fmt: skip
        for m, text in enumerate(METHODS.values()):
            axes.text(x + (m + 0.5) * CELL, top - 0.04, text, rotation=50, ha="left", va="bottom",
                      fontsize=6, rotation_mode="anchor")  # fmt: skip
        for m, method in enumerate(METHODS):
            of = [records[n, belt, method] for n in rows if (n, belt, method) in records]
            if of:
                right_ones = sum(r["kind"] == "solved" for r in of) / len(of)
                axes.text(x + (m + 0.5) * CELL, y + 0.09, f"{right_ones:.0%}", ha="center",
                          va="center", fontsize=5.5)  # fmt: skip
    axes.text(left - 0.08, y + 0.09, "solved, of those there are", ha="right", va="center",
              fontsize=6)  # fmt: skip
    axes.text(0.15, 0.20, "Drives made to break an integrator: how each run ends",
              fontsize=11, fontweight="bold", va="center")  # fmt: skip
    shown = {r["kind"] for r in records.values()} | {"solved", "quiet", "broken"}
    handles = [
        Patch(facecolor=colour, label=(f"{mark}  " if mark else "") + text)
        for kind, (colour, mark, text) in LOOK.items()
        if kind in shown
    ]
    figure.legend(handles=handles, loc="lower center", ncols=2, fontsize=6.5, frameon=False)
    return figure
