"""The drive to scale: drawn once, then moved to any sample."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ..base.checks import Array, pair, real
from ..outputs.arcs import full_friction
from ..outputs.places import follow
from ..outputs.quantity import QUANTITIES
from ..outputs.spans import has_angles, lines_of_cells
from ..result.result import Result
from . import style
from .labels import per_unit, place_names
from .mounting import MountPicture
from .select import choice

__all__ = ["DrivePicture"]

_MAPS = {"tension": "viridis", "friction": "PuOr_r"}
_LABELS = {
    "tension": QUANTITIES["joints.force"].axis(short="belt tension"),
    "friction": QUANTITIES["contact.mu"].axis(),
}
#: Marks of stick and slip: name, colour, dashes; and where they run, in radii.
_ARCS = (
    ("belt sticks", style.COLOURS[0], "-"),
    ("belt slips", style.COLOURS[1], (0, (1.0, 0.8))),
)
_ARC_AT, _SPOKE, _ARROW_AT = 0.86, (0.55, 0.80), 0.42
#: Width of the mark and size of the arrow on a small pulley, in radii.
_SPOKE_WIDTH, _ARROW_SIZE = 0.16, 0.64
#: Arrows show pulleys that turn faster than this share of the highest speed in the run.
_TURNS = 1e-3


class DrivePicture:
    """The artists of a drive."""

    def __init__(
        self,
        result: Result,
        *,
        rows: slice,
        colour: str | None,
        arcs: bool,
        slip_from: float,
        links: Mapping[str, int],
        limits: tuple[float, float] | None,
    ) -> None:
        choice("colour", colour, ("tension", "friction", None))
        if not isinstance(arcs, (bool, np.bool_)):
            raise TypeError(f"arcs must be a bool, got {arcs!r}")
        if not 0.0 < real("slip_from", slip_from) <= 1.0:
            raise ValueError(f"slip_from must be > 0 and <= 1, got {slip_from:g}")
        has_friction = result.params.has_friction
        if colour == "friction" and not has_friction:
            raise ValueError('colour must not be "friction" for a drive without friction')
        self._result = result
        self._rows = rows
        self._colour = colour
        self._links = dict(links)
        self._half = result.params.info["link_length"] / 2.0
        self._kinetic, _ = result.params._slip_limits
        self._slip_from = slip_from
        self._arcs_on = bool(arcs) and has_friction
        self._moves = result.mounts is not None
        self._flows = bool(result.params._belt_facts["flows"])
        self._limits = self._scale(limits)
        self._followed = [self._follow(link) for link in self._links.values()]

    def _follow(self, link: int) -> tuple[NDArray[np.intp], Array] | None:
        """Follow a mark on a belt that flows; None: links carry it, or it is not known."""
        result = self._result
        if not (self._flows and result._has("belt.passed") and result._has("joints.force")):
            return None
        first = range(len(result.t))[self._rows][0]
        return follow(result.params, result.joints.force, result.belt.passed, link, first)

    def _scale(self, limits: object) -> tuple[float, float]:
        if limits is not None:
            low, high = pair("limits", limits, "1" if self._colour == "friction" else "N")
            if not low < high:
                raise ValueError(f"limits must rise, got {low:g}, {high:g}")
            return low, high
        if self._colour == "friction":
            most = float(self._kinetic.max())
            return -most, most
        tension = self._tension(self._rows)
        return float(tension.min()), float(tension.max())

    # --- drawing once ----------------------------------------------------------------------------

    def draw(self, ax: Axes) -> None:
        """Add all artists to the axes; :meth:`move` then places them."""
        params = self._result.params
        self._spokes, self._arrows, self._rims, self._titles = [], [], [], []
        self._mounts = MountPicture(ax, params.pulleys)
        for k, pulley in enumerate(params.pulleys):
            rim = Circle(pulley.center, pulley.radius, fc=style.METAL, ec="0.6", lw=0.8, zorder=1)
            ax.add_patch(rim)
            self._rims.append(rim)
            self._spokes.append(
                ax.plot([], [], color="0.35", lw=2.2, solid_capstyle="butt", zorder=1.5)[0]
            )
            title = style.title(k, pulley)
            size = "medium" if pulley.name is None else "small"
            look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size}
            # The mark that turns passes beneath the name.
            halo = withStroke(linewidth=2.5, foreground=style.METAL)
            name = ax.text(*pulley.center, title, zorder=3.5, path_effects=[halo], **look)
            self._titles.append(name)
            self._arrows.append([self._arrow(ax, k, sense) for sense in (1, -1)])
        self._arcs = [
            LineCollection([], colors=colour, linestyles=[dashes], linewidths=3.2, zorder=2)
            for _, colour, dashes in (_ARCS if self._arcs_on else ())
        ]
        # The dark edge separates the light end of the colour map from the background.
        self._edge = LineCollection([], colors="0.15", linewidths=5.0, capstyle="round", zorder=3)
        self._belt = LineCollection([], linewidths=3.6, capstyle="round", zorder=3.1)
        if self._colour is None:
            self._belt.set_color("0.45")
        for collection in (*self._arcs, self._edge, self._belt):
            ax.add_collection(collection, autolim=False)
        self._marks = [
            ax.plot(
                [],
                [],
                marker="os^Dv"[k % 5],
                ms=8,
                mfc="white",
                mec=style.COLOURS[(k + 3) % len(style.COLOURS)],
                mew=2,
                ls="",
                label=name,
                zorder=4,
            )[0]
            for k, name in enumerate(self._links)
        ]
        self._place(ax)
        style.dress(ax, "x [m]", "y [m]")
        if self._colour is not None:
            self._belt.set_cmap(colormaps[_MAPS[self._colour]].with_extremes(bad=style.FREE))
            self._belt.set_clim(*self._limits)
            self._colour_bar(ax, self._colour)

    def _arrow(self, ax: Axes, k: int, sense: int) -> FancyArrowPatch:
        """Round the axis, anticlockwise for +1."""
        arrow = FancyArrowPatch(
            *self._arrow_ends(k, sense, np.array(self._result.params.pulleys[k].center)),
            connectionstyle=f"arc3,rad={0.32 * sense}",
            arrowstyle="-|>",
            mutation_scale=9,
            shrinkA=0,
            shrinkB=0,
            color="0.25",
            lw=1.1,
            zorder=2,
        )
        ax.add_patch(arrow)
        return arrow

    def _arrow_ends(self, k: int, sense: int, center: Array) -> tuple[Any, Any]:
        ends = np.deg2rad([-35.0, 35.0]) * sense - np.pi / 2.0
        reach = _ARROW_AT * self._result.params.pulleys[k].radius
        at = center[:, None] + reach * np.array([np.cos(ends), np.sin(ends)])
        return tuple(at[:, 0]), tuple(at[:, 1])

    def _centers(self, row: int) -> Array:
        """Axes of the pulleys at a sample (n_p, 2) [m]."""
        params, mounts = self._result.params, self._result.mounts
        return params.centers(None if mounts is None else mounts.travel[row])

    @property
    def wide(self) -> bool:
        """Whether the drive is wider than it is high."""
        (left, right), (bottom, top) = self._extent
        return right - left > 1.5 * (top - bottom)

    @property
    def height(self) -> float:
        """Height of a figure that the picture fills [inch]."""
        bar = self._colour is not None
        beside, below = (0.8, 1.2 + 0.8 * bar) if self.wide else (0.8 + 0.9 * bar, 1.2)
        (left, right), (bottom, top) = self._limits_of_axes
        return style.height_to_scale(np.array([right - left, top - bottom]), beside, below)

    @cached_property
    def _extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Ranges of x and y that hold pulleys and belt at all samples [m]."""
        belt, pulleys = self._result.belt, self._result.params.pulleys

        pivots, rows = MountPicture.reach(pulleys), range(len(self._result.t))[self._rows]
        radii = np.array([pulley.radius for pulley in pulleys])
        # of axes that move, at some twenty of the samples: the belt is looked at in all
        some = rows[:: max(1, len(rows) // 20)] if self._moves else rows[:1]
        centers = np.array([self._centers(row) for row in some])

        def extent(axis: int, belt: Array) -> tuple[float, float]:
            at = centers[..., axis]
            places = [belt, at - radii, at + radii, pivots[:, axis]]
            there = np.concatenate([place.ravel() for place in places])
            return float(there.min()), float(there.max())

        return extent(0, belt.x[self._rows]), extent(1, belt.y[self._rows])

    @property
    def _limits_of_axes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        (left, right), (bottom, top) = self._extent
        margin = 0.05 * max(right - left, top - bottom)
        # Names of pulleys that are small in a wide drive stand above and below it.
        room = 1.8 * margin if self.wide else margin
        return (left - margin, right + margin), (bottom - room, top + room)

    def _place(self, ax: Axes) -> None:
        across, upward = self._limits_of_axes
        ax.set_aspect("equal")
        ax.set_xlim(*across)
        ax.set_ylim(*upward)

    def _colour_bar(self, ax: Axes, colour: str) -> None:
        where: dict[str, Any] = {"orientation": "vertical", "aspect": 25, "shrink": 0.9}
        if self.wide:
            entries = len(self._arcs) + (colour == "friction") + len(self._links)
            pad = style.room_below(ax, rows=-(-entries // style.LEGEND_COLUMNS))
            where = {"orientation": "horizontal", "aspect": 30, "shrink": 0.9} | pad
        ax.figure.colorbar(self._belt, ax=ax, label=_LABELS[colour], **where)

    # --- moving ----------------------------------------------------------------------------------

    def move(self, row: int) -> list[Artist]:
        """Show another sample; return the artists that changed."""
        result = self._result
        ends = self._ends(row)
        self._belt.set_segments(ends)
        self._edge.set_segments(ends)
        if self._colour == "tension":
            self._belt.set_array(self._tension(row))
        elif self._colour == "friction":
            on = result.contact.pulley[row] >= 0
            self._belt.set_array(np.ma.masked_where(~on, result.contact.mu[row]))
        speeds = np.abs(result.pulleys.omega)
        centers = self._centers(row)
        for k, pulley in enumerate(result.params.pulleys):
            angle = result.pulleys.theta[row, k]
            along = pulley.radius * np.array([np.cos(angle), np.sin(angle)])
            inner, outer = (centers[k] + share * along for share in _SPOKE)
            self._spokes[k].set_data([inner[0], outer[0]], [inner[1], outer[1]])
            omega = result.pulleys.omega[row, k]
            turns = abs(omega) > _TURNS * speeds.max()
            for arrow, sense in zip(self._arrows[k], (1, -1), strict=True):
                arrow.set_visible(bool(turns and sense * omega > 0))
                if self._moves:
                    arrow.set_positions(*self._arrow_ends(k, sense, centers[k]))
            if self._moves:
                self._rims[k].set_center(tuple(centers[k]))
                self._titles[k].set_position(tuple(centers[k]))
        if self._arcs:
            on, slips = self._states(row)
            for collection, chosen in zip(self._arcs, (on & ~slips, slips), strict=True):
                collection.set_segments(self._rim_arcs(row, chosen))
        for mark, link, followed in zip(
            self._marks, self._links.values(), self._followed, strict=True
        ):
            x, y = result.belt.x[row, link], result.belt.y[row, link]
            if followed is not None:
                line, part = ends[int(followed[0][row])], followed[1][row]
                x, y = (np.interp(part, np.linspace(0.0, 1.0, len(line)), one) for one in line.T)
            mark.set_data([x], [y])
        return [
            *(self._rims + self._titles if self._moves else []),
            *self._mounts.move(centers),
            self._belt,
            self._edge,
            *self._spokes,
            *self._arcs,
            *self._marks,
            *(arrow for pair_ in self._arrows for arrow in pair_),
        ]

    def _tension(self, rows: int | slice) -> Array:
        """Tension of links, the mean of the joints at their ends; of cells their own."""
        force = self._result.joints.force[rows]
        return force if self._flows else (force + np.roll(force, -1, axis=-1)) / 2.0

    def _ends(self, row: int) -> list[Array]:
        """Both ends of each link, of a string of the bar behind each mass; lines of cells [m]."""
        result, belt = self._result, self._result.belt
        centre = np.stack([belt.x[row], belt.y[row]], axis=-1)
        if self._flows:
            there = result._has("spans.deflection")
            shape = result.spans.deflection[row] if there else None
            return lines_of_cells(result.params, centre, self._centers(row), shape)
        if not has_angles(self._result.params):
            return list(np.stack([centre, np.roll(centre, -1, axis=0)], axis=1))
        along = self._half * np.stack([np.cos(belt.phi[row]), np.sin(belt.phi[row])], axis=-1)
        return list(np.stack([centre - along, centre + along], axis=1))

    def _states(self, rows: int | slice) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Find the links that touch a pulley, and those of them that slip."""
        contact = self._result.contact
        known = self._result._has("contact.velocity")
        velocity = contact.velocity[rows] if known else None
        touched, mu = contact.pulley[rows], contact.mu[rows]
        full = full_friction(self._result.params, touched, velocity)
        on = touched >= 0
        return on, on & (np.abs(mu) >= self._slip_from * full)

    def _rim_arcs(self, row: int, chosen: NDArray[np.bool_]) -> list[Array]:
        """One polyline per run of links of the same state on the same pulley."""
        touched = np.where(chosen, self._result.contact.pulley[row], -1)
        ends, centers = self._ends(row), self._centers(row)
        arcs: list[Array] = []
        last = -1
        for k in np.flatnonzero(touched >= 0):
            pulley = self._result.params.pulleys[touched[k]]
            centre = centers[touched[k]]
            off = ends[k][[0, -1]] - centre
            angles = np.arctan2(off[:, 1], off[:, 0])
            turn = (angles[1] - angles[0] + np.pi) % (2.0 * np.pi) - np.pi
            steps = angles[0] + turn * np.linspace(0.0, 1.0, 5)
            at = _ARC_AT * pulley.radius
            arc = centre + at * np.stack([np.cos(steps), np.sin(steps)], axis=-1)
            if k == last + 1 and k > 0 and touched[k - 1] == touched[k]:
                arcs[-1] = np.concatenate([arcs[-1], arc])
            else:
                arcs.append(arc)
            last = int(k)
        return arcs

    def _place_names(self, ax: Axes) -> None:
        """Put names that do not fit on their pulleys beside them, as at the first sample shown."""
        row = range(len(self._result.t))[self._rows][0]
        radii = self._result.params._radii
        pivots = MountPicture.reach(self._result.params.pulleys)
        belt = np.stack([self._result.belt.x[row], self._result.belt.y[row]], axis=-1)
        place_names(ax, self._titles, self._centers(row), radii, belt, marks=-1, pivots=pivots)
        for rim, spoke, arrows in zip(
            radii * per_unit(ax), self._spokes, self._arrows, strict=True
        ):
            spoke.set_linewidth(min(2.2, _SPOKE_WIDTH * rim))
            for arrow in arrows:
                arrow.set_mutation_scale(min(9.0, _ARROW_SIZE * rim))

    # --- legend ----------------------------------------------------------------------------------

    def add_legend(self, ax: Axes) -> None:
        """Add a legend below the axes for arcs and highlighted links; the last of the layout."""
        handles: list[Artist] = []
        if self._arcs:
            on, slips = self._states(self._rows)
            there = ((on & ~slips).any(), slips.any())
            handles = [
                Line2D([], [], color=colour, ls=dashes, lw=3.2, label=name)
                for (name, colour, dashes), shown in zip(_ARCS, there, strict=True)
                if shown
            ]
        if self._colour == "friction":
            handles.append(Line2D([], [], color=style.FREE, lw=3.6, label="no contact"))
        handles += self._marks
        if handles:
            style.legend_below(ax, handles)
        self._place_names(ax)
