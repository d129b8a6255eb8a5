"""Result of a study: a table of runs, their errors and costs."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterator, Mapping
from textwrap import shorten
from typing import TYPE_CHECKING

import attrs

from ..base import files
from ..base.checks import one_of, positive
from ..base.tables import columns
from ..verification.quantities import QUANTITIES
from ..verification.runs import Setting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Errors for which the printed study names the cheapest setting.
_TARGETS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
Errors = Mapping[str, float]


def quantity_of(name: object) -> str:
    """Check the name of a quantity."""
    return one_of("quantity", name, QUANTITIES)


@attrs.frozen(kw_only=True)
class Row:
    """A setting, its cost and its errors, by quantity and relative [1].

    Attributes:
        setting: Number of links, method, tolerance.
        seconds: CPU time, without settling, the least of ``repeats`` [s]; NaN if the run failed.
        repeats: Number of runs.
        steps: Steps, rejected ones included.
        error: Difference to the reference on the finest mesh: the total error.
        time: Difference to the reference on the same mesh: the error in time.
        failure: Why the run failed, or "".
    """

    setting: Setting
    seconds: float
    repeats: int
    steps: int
    error: Errors
    time: Errors
    failure: str = ""


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Study:
    """What accuracy costs: runs of a scene by method, tolerance and number of links or cells.

    ``print(study)`` names the cheapest settings, :meth:`table` lists all runs, :meth:`plot` draws
    them. Errors are by quantity, those of ``bd.accuracy.QUANTITIES``, relative to the scales of
    :class:`beltdyn.accuracy.Observed`. An error is not known better than its floor.

    Attributes:
        rows: All runs, by mesh, method and tolerance.
        space: By ``n_bodies``, the error in space: of the mesh's own reference.
        time_floor: By ``n_bodies``, the difference of the two references on the mesh.
        space_floor: Difference of the two references on the finest mesh or, if larger, the
            estimated error in space there.
        finest: ``n_bodies`` of the reference in space.
        references: How the references were computed, a line for each mesh.
        mesh: How the belt meets the pulleys, ``Belt.mesh``.
        nodes: What ``n_bodies`` counts: "links", "masses" or "cells".
        n_bodies: Number in the scene itself.
    """

    rows: tuple[Row, ...]
    space: Mapping[int, Errors]
    time_floor: Mapping[int, Errors]
    space_floor: Errors
    finest: int
    references: tuple[str, ...]
    mesh: str
    nodes: str
    n_bodies: int

    def done(self) -> Iterator[Row]:
        """Return the rows of the runs that did not fail."""
        return (row for row in self.rows if not row.failure)

    def believed(self, row: Row, quantity: str) -> float:
        """Return a reliable bound of the error of a run.

        The largest of its total error, its errors in space and in time and the floor: where the
        total is smaller than one of its parts, they cancel each other by chance.
        """
        errors = (row.error, self.space[row.setting.n_bodies], row.time, self.space_floor)
        return max(error[quantity] for error in errors)

    def cheapest(self, error: float, quantity: str = "tension") -> Row | None:
        """Return the run that reaches an error for the least CPU time, None if there is none.

        Args:
            error: The largest total error [1].
            quantity: Quantity whose error it is.

        Raises:
            TypeError, ValueError: An argument breaks its rule.
        """
        quantity, error = quantity_of(quantity), positive("error", error)
        good = [row for row in self.done() if self.believed(row, quantity) <= error]
        return min(good, key=lambda row: row.seconds, default=None)

    def front(self, quantity: str = "tension", method: str | None = None) -> list[Row]:
        """Return the Pareto front of cost and error, of all runs or one method, cheapest first."""
        quantity = quantity_of(quantity)
        best, kept = math.inf, []
        rows = (row for row in self.done() if method in (None, row.setting.method))
        for row in sorted(rows, key=lambda row: row.seconds):
            error = self.believed(row, quantity)
            if error < best:
                best = error
                kept.append(row)
        return kept

    def table(self, quantity: str = "tension") -> str:
        """List all runs as text, with the errors of one quantity.

        Raises:
            TypeError, ValueError: There is no such quantity.
        """
        quantity = quantity_of(quantity)
        rows = [
            (self.nodes, "method", "rtol", "CPU s", "steps", "error", "space", "", "time", "", "")
        ]
        for row in self.rows:
            n_b, method, rtol = attrs.astuple(row.setting)
            head = (f"{n_b}", method, f"{rtol:.0e}")
            if row.failure:
                why = shorten(row.failure.partition(": ")[0], 60, placeholder=" ...")
                rows.append((*head, *[""] * 7, f"failed: {why}"))
                continue
            floors = self.space_floor[quantity], self.time_floor[n_b][quantity]
            errors = row.error[quantity], self.space[n_b][quantity], row.time[quantity]
            in_all, space, time = (f"{error:.1e}" for error in errors)
            of_space, of_time = (f"({floor:.0e})" for floor in floors)
            cost = f"{row.seconds:.4f}", f"{row.steps}"
            rows.append((*head, *cost, in_all, space, of_space, time, of_time, ""))
        title = f"error of {quantity}: in all, in space, in time (floors in brackets)"
        return "\n".join([title, *columns(rows, "><>>>>>>>><", "")])

    def __str__(self) -> str:
        meshes = ", ".join(map(str, self.space))
        rows = [("", *(f"{target:.0e}" for target in _TARGETS))]
        for quantity in QUANTITIES:
            rows.append((quantity, *(self._cell(target, quantity) for target in _TARGETS)))
        lines = [
            f"Price of accuracy: {sum(1 for _ in self.done())} runs on meshes of {meshes} "
            f'{self.nodes} ("{self.mesh}"), reference on {self.finest} {self.nodes}',
            "cheapest setting for an error in all of at most",
            *columns(rows, "<", ""),
            f"Entries: method, rtol, number of {self.nodes}, CPU s; -: no run is so accurate;",
            f"floor: not even the reference, on {self.finest} {self.nodes}, is known so well.",
            f"More {self.nodes} and tighter tolerances (without --quick; n_bodies=, finest=,",
            "rtols=) fill these. To use one: simulate(..., method=, rtol=);",
            "beltdyn run SCENE --error chooses.",
        ]
        return "\n".join(lines)

    def _cell(self, target: float, quantity: str) -> str:
        if self.space_floor[quantity] > target:
            return f"floor {self.space_floor[quantity]:.0e}"
        row = self.cheapest(target, quantity)
        if row is None:
            return "-"
        one = row.setting
        return f"{one.method} {one.rtol:.0e} {one.n_bodies} {row.seconds:.3g}"

    def __repr__(self) -> str:
        return f"Study({len(self.rows)} runs, {len(self.space)} meshes, finest {self.finest})"

    def to_csv(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return all runs as comma-separated values, also written to ``path``.

        A line for each run: its setting, CPU seconds, repeats, steps, and of each quantity the
        total errors, those in space and in time, and the two floors.

        Raises:
            OSError: The file cannot be written; a file that was there before is unchanged.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        kinds = ("error", "space", "time", "space_floor", "time_floor")
        errors = [f"{quantity}_{kind}" for quantity in QUANTITIES for kind in kinds]
        setting, measured = ["n_bodies", "method", "rtol"], ["repeats", "steps", "failure"]
        writer.writerow([*setting, "cpu_seconds", *measured, *errors])
        for row in self.rows:
            n_b = row.setting.n_bodies
            found = [row.error, self.space[n_b], row.time, self.space_floor, self.time_floor[n_b]]
            writer.writerow(
                [*attrs.astuple(row.setting), row.seconds, row.repeats, row.steps, row.failure]
                + [one.get(quantity, math.nan) for quantity in QUANTITIES for one in found]
            )
        if path is not None:
            files.write_bytes(path, text.getvalue().encode())
        return text.getvalue()

    def plot(self, quantity: str = "tension", *, error: float = 1e-2) -> Figure:
        """Draw cost against error by method, against links, and the errors of the cheapest runs.

        Args:
            quantity: Quantity whose errors are shown.
            error: The error for which the cheapest setting is marked.

        Raises:
            TypeError, ValueError: An argument breaks its rule.
            ImportError: There is no matplotlib.
        """
        from .study_figures import price

        return price(self, quantity_of(quantity), positive("error", error))
